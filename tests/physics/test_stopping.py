"""Which driven bodies loads stop: the kernel decides as Shapely does."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Map, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.physics.shapely_engine import stop_at_loads_by_shapely
from mesa_swarm.physics.stopping import stop_at_loads
from support.doors import with_swinging_doors
from support.tables import put

SIZE = 100.0
# How far bodies are sent, and how far they turn.
WAYS, TURNS = (0.0, 1e-9, 0.5, 5.0, 30.0, 150.0), (0.0, 1e-9, 0.05, 1.0, math.pi, 7.0)
L_SHAPE = np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]) - 1.0


def random_shape(rng):
    """Return a disc, a rectangle, a triangle, an L, or a frame, of any size."""
    centre, size = rng.uniform(15, SIZE - 15, 2), rng.choice([0.5, 3.0, 7.0, 12.0])
    turn = rng.uniform(0, 2 * math.pi)
    axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    outlines = {
        "triangle": [ring[:3] * size],
        "bar": [ring * (size, 0.3)],
        "L": [L_SHAPE * size / 2],
        "frame": [ring * size, ring * (size * 0.6)],
    }
    kind = rng.choice(["disc", "rectangle", *outlines])
    if kind == "disc":
        return disc(centre, size)
    if kind == "rectangle":
        return rectangle(centre - size, centre + size * np.array([1.0, 0.4]))
    outline, *holes = (points @ axes.T + centre for points in outlines[kind])
    return polygon(outline, holes)


def crowded(rng):
    """Return a world of loads and driven bodies of all shapes, as many as have room; loads are pushed or turned."""
    model = SwarmModel(map=Map(bounds=(0, 0, SIZE, SIZE)), rng=1)
    for k in range(rng.integers(2, 24)):
        try:
            if k % 2:
                model.add_load(random_shape(rng), resistance=1.0)
            else:
                model.add_body(random_shape(rng), kind="door")
        except InvalidValueError:
            continue
    around = model.parts.bodies.scene()
    for load in model.loads:
        put(load, (*(load.position + rng.uniform(-2, 2, 2)), rng.uniform(-3, 3)))
    return around


def stopped(stop, around):
    around.bodies.blocked[around.driven] = False
    stop(around)
    return around.bodies.blocked[around.driven].tolist()


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_kernel_and_shapely_stop_the_same_bodies(seed):
    rng = np.random.default_rng(seed)
    around = crowded(rng)
    table, rows = around.bodies, around.driven
    for _ in range(5):
        azimuth, way = rng.uniform(0, 2 * math.pi, len(rows)), rng.choice(WAYS, len(rows))
        table.aim[rows] = table.position[rows] + way[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
        table.aim_heading[rows] = table.heading[rows] + rng.choice(TURNS, len(rows)) * rng.choice([-1, 1], len(rows))
        assert stopped(stop_at_loads, around) == stopped(stop_at_loads_by_shapely, around)


def test_the_worlds_above_have_bodies_that_are_stopped_and_some_that_go():
    found = []
    for seed in range(20):
        around = crowded(np.random.default_rng(seed))
        around.bodies.aim[around.driven] += (20.0, 0.0)
        found += stopped(stop_at_loads, around)
    assert 0.05 * len(found) < sum(found) < 0.95 * len(found)


def door_by(*loads, door=((40, 40), (44, 60))):
    model = SwarmModel(map=Map(bounds=(0, 0, SIZE, SIZE)), rng=1)
    for load in loads:
        model.add_load(load, resistance=1.0)
    body = model.add_body(rectangle(*door), kind="door")
    return model, body, model.parts.bodies.scene()


@pytest.mark.parametrize("stop", [stop_at_loads, stop_at_loads_by_shapely])
@pytest.mark.parametrize(
    ("way", "turn", "blocked"),
    [
        ((20.0, 0.0), 0.0, True),  # to where a load is
        ((40.0, 0.0), 0.0, True),  # past a load
        ((10.9, 0.0), 0.0, False),  # as far as it
        ((0.0, 0.0), 1.2, False),  # it turns beside the load
        ((11.0 - 1e-3, 0.0), math.pi / 2, True),  # and near it
        ((-30.0, 0.0), 0.0, False),
        ((0.0, 0.0), 2.0 * math.pi, False),  # all the way round: it stays
    ],
)
def test_a_body_is_stopped_by_what_is_on_its_way(stop, way, turn, blocked):
    _, _, around = door_by(disc((60, 50), 5), rectangle((70, 80), (90, 84)))
    (row,), table = around.driven, around.bodies
    table.aim[row] += way
    table.aim_heading[row] += turn
    assert stopped(stop, around) == [blocked]


@pytest.mark.parametrize("stop", [stop_at_loads, stop_at_loads_by_shapely])
def test_what_touches_a_load_but_for_rounding_may_slide_along_it(stop):
    _, _, around = door_by(rectangle((44, 0), (50, 90)))
    around.bodies.aim[around.driven] += (0.0, 13.0)
    assert stopped(stop, around) == [False]
    around.bodies.aim[around.driven] += (1e-3, 0.0)
    assert stopped(stop, around) == [True]


def test_without_loads_or_driven_bodies_nothing_is_stopped():
    for loads, doors in ((0, 1), (1, 0)):
        model = SwarmModel(map=Map(bounds=(0, 0, SIZE, SIZE)), rng=1)
        for _ in range(loads):
            model.add_load(disc((50, 50), 5), resistance=1.0)
        for _ in range(doors):
            model.add_body(disc((20, 20), 5), kind="door")
        around = model.parts.bodies.scene()
        stop_at_loads(around)
        assert not around.bodies.blocked.any()


def test_a_load_stops_a_body_in_a_world_without_robots():
    model, body, _ = door_by(disc((60, 50), 5))
    model.step()
    body.position = (60, 50)
    model.step()
    assert body.blocked
    body.position = (20, 50)
    model.step()
    assert not body.blocked
    assert body.position.tolist() == [20, 50]


def test_loads_stop_doors_that_a_process_sends_in_runs_as_in_single_steps():
    driven, stepped = with_swinging_doors(1), with_swinging_doors(1)
    blocked, parts = 0, (7, 1, 250, 42)
    for steps in parts:
        driven.run(steps)
        for _ in range(steps):
            stepped.step()
            blocked += int(stepped.movers.blocked.any())
        assert driven.state_hash() == stepped.state_hash()
    assert 0 < blocked < sum(parts)


def test_tables_that_are_made_for_all_ways_of_loads_are_never_worn():
    """A point of a load may seem to be farther from where it was than any two points of the map are apart."""
    model = SwarmModel(map=Map(bounds=(0, 0, 100, 60)), rng=1)
    load = model.add_load(rectangle((1, 1), (59, 3)), resistance=0.1)
    model.add_robots(AGENT9, poses=[(90, 50, 0.0)])
    model.parts.bodies.let_roam()
    around = model.parts.bodies.scene()
    put(load, (70.0, 58.0, math.pi))
    assert not around.is_worn
    assert model.parts.bodies.scene() is around
    ending = model.parts.bodies.ending()
    assert ending.function(ending.block, 1, 0, 1) == 0
