"""Neighbour sensors of bodies, against an independent twin, by Shapely."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesa import Agent
from shapely import LineString, Point

from mesa_swarm import NeighbourSensor, Recording, RobotDesign, SwarmModel, disc, rectangle
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.recording import verify
from support.scenes import empty

RANGE, MOST = 120.0, 2
DOG = RobotDesign(
    sensors=(
        NeighbourSensor(range=RANGE, k=MOST, kind="sheep"),
        NeighbourSensor(range=RANGE, k=MOST, kind="sheep", occluded=True, name="seen"),
    )
)
PLACES = st.lists(
    st.tuples(st.integers(20, 380), st.integers(20, 280), st.floats(-3.0, 3.0)),
    min_size=2,
    max_size=8,
    unique_by=lambda p: p[:2],
)


def world(dogs, sheep, engine="compiled"):
    model = empty(400, 300, engine=engine)
    model.add_obstacle(rectangle((190, 60), (200, 240)))
    for k, (x, y, _) in enumerate(sheep):
        mode = ("driven", "fixed")[k % 2]
        model.add_body(disc((x, y), 4) if k % 3 else rectangle((x - 3, y - 3), (x + 3, y + 3)), kind="sheep", mode=mode)
    model.add_body(disc((100, 150), 10), kind="goat")
    model.add_robots(DOG, poses=dogs)
    model.sense()
    return model


def nearest(model, i, occluded):
    place, found = model.swarm.position[i], []
    for index, body in enumerate(model.bodies):
        away, line = math.dist(place, body.position), LineString([place, body.position])
        gaps = [line.distance(other.shape.geometry) - other.shape.radius for other in model.bodies if other is not body]
        inside = any(other.shape.geometry.contains(Point(place)) for other in model.bodies)
        if min(map(abs, gaps)) < 1e-6 or abs(away - RANGE) < 1e-6 or inside:
            return None  # a matter of rounding
        if body.kind == "sheep" and away <= RANGE and not (occluded and min(gaps) <= 0.0):
            found.append((away, index))
    return sorted(found)[:MOST]


@pytest.mark.slow
@given(PLACES, PLACES)
@settings(max_examples=40, deadline=None)
def test_the_nearest_bodies_of_a_kind_are_those_of_a_twin_and_of_both_engines(dogs, sheep):
    model, twin = (world(dogs, sheep, engine) for engine in ("compiled", "shapely"))
    bodies = list(model.bodies)
    for name, occluded in (("sheep", False), ("seen", True)):
        np.testing.assert_array_equal(model.swarm.columns[name], twin.swarm.columns[name])
        for i, robot in enumerate(model.robots):
            expected = nearest(model, i, occluded)
            if expected is None:
                continue
            values = model.swarm.columns[name][i]
            assert np.isfinite(values).sum() == 2 * len(expected)
            for k, (away, index) in enumerate(expected):
                dx, dy = bodies[index].position - robot.position
                assert values[2 * k] == pytest.approx(away)
                turned = values[2 * k + 1] - (math.atan2(dy, dx) - robot.heading)
                assert math.remainder(turned, 2 * math.pi) == pytest.approx(0.0, abs=1e-9) or away < 1e-6


def test_of_equally_near_bodies_those_added_first_are_seen_and_carried_ones_not():
    model = empty(400, 300)
    first, second, third = (model.add_body(disc(at, 2), kind="sheep") for at in ((130, 100), (70, 100), (100, 160)))
    (dog,) = model.add_robots(DOG, poses=[(100, 100, 0.0)])
    model.sense()
    assert dog.sheep == pytest.approx([30.0, 0.0, 30.0, math.pi])
    model.attach(dog, first)
    model.sense()
    assert dog.sheep == pytest.approx([30.0, math.pi, 60.0, math.pi / 2])
    second.remove()
    third.remove()
    model.sense()
    assert np.isnan(dog.sheep).all()


def test_fires_are_seen_while_they_burn_and_loads_where_they_are():
    sensors = (
        NeighbourSensor(kind="fire", k=1, name="flames"),
        NeighbourSensor(kind="load", k=1, occluded=True, name="crate"),
    )
    model = empty(400, 300)
    fire, load = model.add_fire((150, 100), radius=10), model.add_load(disc((100, 50), 8), resistance=1.0)
    (robot,) = model.add_robots(RobotDesign(sensors=sensors), poses=[(100, 100, 0.0)])
    model.sense()
    assert robot.flames == pytest.approx([50.0, 0.0])
    assert robot.crate == pytest.approx([50.0, -math.pi / 2])
    load.move_to((100.0, 40.0, 0.0))
    fire.remove()
    model.sense()
    assert np.isnan(robot.flames).all()
    assert robot.crate[0] == pytest.approx(60.0)


@behaviour
def chase(me):
    turn = 0.5 * me.sheep[1] if me.sheep[0] > 12 else 0.0
    return me.max_speed * (1 - turn), me.max_speed * (1 + turn)


class Flock(SwarmModel):
    """Dogs that chase the nearest of plain Mesa agents."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.sheep = []
        for x in (200, 400, 600):
            agent = Agent(self)
            agent.pos = (x, 300.0)
            self.sheep.append(agent)
            self.add_body(disc(agent.pos, 4), kind="sheep", agent=agent)
        self.add_robots(RobotDesign(sensors=(NeighbourSensor(range=400, k=1, kind="sheep"),)), 5)
        self.control = Subsumption(chase)

    def step(self):
        for agent in self.sheep:
            agent.pos = (agent.pos[0], agent.pos[1] + 0.5)
        super().step()


@pytest.mark.slow
def test_robots_chase_plain_agents_and_their_run_is_recorded_verified_and_resumed(tmp_path):
    model = Flock(rng=1)
    model.sense()
    before = model.swarm.sheep[:, 0].mean()
    with model.record(tmp_path / "run.arrow", columns=("position", "sheep"), exact=True):
        model.run(60)
    assert model.swarm.sheep[:, 0].mean() < before
    assert verify(Recording(tmp_path / "run.arrow"), Flock).same
    assert Flock.resume(tmp_path / "run.arrow").state_hash() == model.state_hash()
