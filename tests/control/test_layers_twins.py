"""Layers on readings made by hand: each against a twin of its documentation, and none takes a robot that is driven."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.control import (
    Avoid,
    Cohere,
    Cruise,
    Explore,
    Follow,
    Gather,
    MatchVelocity,
    Perimeter,
    Push,
    Respond,
    Separate,
    Subsumption,
)
from mesa_swarm.control.explore import count_down, turn_on_the_spot
from mesa_swarm.control.flocking import FEWEST, align, track
from mesa_swarm.control.head_on import meet_head_on
from support.made_senses import (
    EACH,
    FIRE,
    LOAD,
    NOTHING_WRITTEN,
    ROBOT,
    ROBOTS,
    decided,
    known_to,
    made_drivers,
    made_senses,
    model_of_three_designs,
)


def on_the_spot(me, bearing):
    rim = min(abs(bearing) * me.radius, me.max_speed)
    return (-rim, rim) if bearing > 0 else (rim, -rim)


def towards(me, bearing, critical_degrees):
    ahead = abs(bearing) <= math.radians(critical_degrees)
    return (me.max_speed, me.max_speed) if ahead else on_the_spot(me, bearing)


def places(me, kind):
    """Return the positions that the readings of such things are taken for."""
    eyes = np.flatnonzero(me.kind == kind)
    return me.sensors[eyes, :2] + me.distance[eyes, None] * me.sensors[eyes, 2:4]


def turns_away(me, layer):
    def fears(s):
        avoided = {
            FIRE: {"always": True, "never": False, "when hot": me.hot}[layer.fires],
            LOAD: layer.loads != "never",
        }
        return s >= 0 and 0 <= me.distance[s] < layer.distance and avoided.get(int(me.kind[s]), True)

    sides = [side for s, side in zip(me.forward, (me.tendency, -1, 1), strict=True) if fears(s)]
    if not sides:
        return None
    inner = -me.max_speed if layer.turn == "stationary" else 0.0
    return (inner, me.max_speed) if sides[-1] > 0 else (me.max_speed, inner)


def nearest_robot_ahead(me):
    ahead = [s for s in np.flatnonzero(me.kind == ROBOT) if abs(me.bearing[s]) < math.pi / 2 - 1e-9]
    return min(ahead, key=lambda s: (me.distance[s], abs(me.bearing[s]), s), default=-1)


def follows(me, layer):
    nearest = nearest_robot_ahead(me)
    if nearest < 0:
        return None
    if abs(me.bearing[nearest]) > math.radians(layer.critical_angle_degrees):
        return on_the_spot(me, me.bearing[nearest])
    far = layer.gap is not None and me.distance[nearest] > layer.gap
    return (me.max_speed * (layer.chase_speed if far else layer.cruise_speed),) * 2


def gathers(me, layer):
    seen = places(me, ROBOT)
    if not len(seen):
        return None
    x, y = seen.mean(axis=0)
    if abs(math.atan2(y, x)) > math.radians(layer.critical_angle_degrees):
        return on_the_spot(me, math.atan2(y, x))
    return (0.0, 0.0) if math.hypot(x, y) <= layer.stop_distance else None


def coheres(me, layer):
    seen = places(me, ROBOT)
    if not len(seen):
        return None
    return me.max_speed * seen.mean(axis=0) / max(layer.distance, np.hypot(*seen.mean(axis=0)))


def separates(me, layer):
    meant = {"robots": me.kind == ROBOT, "others": me.kind != ROBOT, "everything": True}[layer.what]
    near = (me.kind >= 0) & meant & (me.distance < layer.distance)
    if not near.any():
        return None
    total = -((1 - me.distance[near] / layer.distance)[:, None] * me.sensors[near, 2:4]).sum(axis=0)
    return me.max_speed * total / max(1.0, np.hypot(*total))


def cruises(me, layer):
    length = np.hypot(*me.last_command)
    return layer.speed * me.max_speed * (me.last_command / length if length else np.array([1.0, 0.0]))


def pushes(me, layer):
    loads = np.flatnonzero(me.kind == LOAD)
    if not len(loads):
        return None
    nearest = loads[np.argmin(me.distance[loads])]
    bearing = me.bearing[nearest]
    if layer.side == "behind" and not np.isnan(me.heard_goal[0]):
        off = np.clip((me.distance[nearest] - layer.clearance) / max(layer.clearance, 1.0), -0.6, 0.6)
        bearing = math.remainder(bearing - me.tendency * (math.pi / 2 - off), math.tau)
    return towards(me, bearing, layer.critical_angle_degrees)


def responds(me, layer):
    x, y = me.heard_from if layer.to == "state" else me.heard_goal
    if me.hot or me.fire >= 0 or not math.hypot(x, y) > layer.near:
        return None
    return towards(me, math.atan2(y, x), layer.critical_angle_degrees)


TWINS = [
    (Avoid(), turns_away),
    (Avoid(distance=20, turn="stationary", fires="when hot"), turns_away),
    (Avoid(distance=10, fires="never", loads="never"), turns_away),
    (Follow(), follows),
    (Follow(gap=20, chase_speed=0.9, cruise_speed=0.2, critical_angle_degrees=50), follows),
    (Follow(gap=None, critical_angle_degrees=0), follows),
    (Gather(), gathers),
    (Gather(stop_distance=30, critical_angle_degrees=0), gathers),
    (Cohere(), coheres),
    (Cohere(distance=20), coheres),
    (Separate(), separates),
    (Separate(distance=25, what="robots"), separates),
    (Separate(distance=20, what="others"), separates),
    (Cruise(), cruises),
    (Cruise(speed=0.25), cruises),
    (Push(), pushes),
    (Push(clearance=0.5, critical_angle_degrees=45), pushes),
    (Push(side="anywhere"), pushes),
    (Respond(), responds),
    (Respond(to="goal", near=20, critical_angle_degrees=45), responds),
]


@pytest.mark.slow
@pytest.mark.parametrize(("layer", "twin"), TWINS, ids=lambda part: getattr(part, "name", ""))
def test_a_layer_commands_what_its_documentation_promises_and_leaves_other_robots_as_they_are(layer, twin):
    answers = set()
    for seed in range(6):
        senses, drivers = made_senses(seed), made_drivers(seed)
        command, won = decided(layer, senses, drivers, index=seed % 2)
        for i in range(ROBOTS):
            wanted = twin(known_to(senses, i), layer) if drivers[i] < 0 else None
            answers.add(wanted is not None)
            assert won[i] == (drivers[i] if wanted is None else seed % 2)
            assert command[i] == pytest.approx([NOTHING_WRITTEN] * 2 if wanted is None else list(wanted), abs=1e-12)
    assert answers == {True, False}


@pytest.mark.parametrize("layer", [Explore(), Explore(turn_interval=2), MatchVelocity(), Perimeter()])
def test_layers_that_remember_leave_robots_that_are_driven_as_they_are_too(layer):
    model = model_of_three_designs(Subsumption(layer))
    active = 0
    for seed in range(12):
        drivers = made_drivers(seed)
        if hasattr(layer, "memory"):
            for name, value in {"compared": 9, "seen": 1, "velocity": 0.4}.items():
                model.swarm.columns[f"0.{layer.name}.{name}"][:] = value
        command, won = decided(model.control.layers[0], made_senses(seed), drivers, index=0)
        assert (won[drivers >= 0] == drivers[drivers >= 0]).all()
        assert (command[drivers >= 0] == NOTHING_WRITTEN).all()
        assert ((command != NOTHING_WRITTEN).all(axis=1) == (won != drivers)).all()
        active += (won != drivers).sum()
    assert active > 100


def test_a_perimeter_settles_within_its_tolerance_and_leaves_beyond_twice_of_it():
    layer = Perimeter(ring=30, tolerance=5)
    model = model_of_three_designs(Subsumption(layer))
    settled = model.swarm.columns["0.Perimeter.settled"]
    met = set()
    for seed in range(12):
        senses, drivers = made_senses(seed), made_drivers(seed)
        before = np.random.default_rng(seed).random(ROBOTS) < 0.5
        settled[:] = before
        command, won = decided(model.control.layers[0], senses, drivers)
        for i in range(ROBOTS):
            me = known_to(senses, i)
            seen = places(me, ROBOT)
            if drivers[i] >= 0 or not len(seen):
                assert (settled[i], won[i]) == (False, drivers[i])
                continue
            x, y = seen.mean(axis=0)
            off = math.hypot(x, y) - 30
            rests = abs(off) <= (10 if before[i] else 5)
            met |= {(off, bool(before[i]))} if len(seen) == 1 else set()
            x, y = (x, y) if off > 0 and not rests else (-x, -y)
            bearing = math.atan2(y, x)
            straight = (0.0, 0.0) if rests else (me.max_speed, me.max_speed)
            wanted = on_the_spot(me, bearing) if abs(bearing) > math.radians(15) else straight
            assert (settled[i], won[i]) == (rests, 7)
            assert command[i] == pytest.approx(wanted, abs=1e-12)
    assert {(-10.0, True), (-5.0, False), (5.0, False), (10.0, True)} <= met


@given(st.floats(-3.2, 3.2), st.floats(0.1, 5), st.floats(1, 20))
def test_a_turn_on_the_spot_adds_up_to_the_turn_that_was_due_at_full_speed_until_the_last_step(turn, speed, radius):
    left = np.array([turn])
    rims = []
    while left[0] != 0.0:
        command, layer = np.full((1, 2), NOTHING_WRITTEN), np.array([-1])
        turn_on_the_spot(left, np.array([radius]), np.array([speed]), command, layer, 0)
        assert layer[0] == 0
        assert command[0, 0] == -command[0, 1]
        rims.append(command[0, 1])
    assert sum(rims) / radius == pytest.approx(turn, abs=1e-9)
    assert [abs(rim) for rim in rims[:-1]] == [speed] * len(rims[:-1])
    assert all(abs(rim) <= speed for rim in rims)


def test_a_robot_that_cannot_move_does_not_begin_to_turn():
    turn, command, layer = np.array([1.0]), np.full((1, 2), NOTHING_WRITTEN), np.array([-1])
    turn_on_the_spot(turn, np.array([5.0]), np.array([0.0]), command, layer, 0)
    assert (turn[0], layer[0]) == (1.0, -1)


@given(st.integers(1, 9), st.floats(0.1, 3))
def test_a_turn_is_due_after_just_the_interval_of_steps_that_the_robot_drove_itself(interval, drawn):
    straight, turn, driven = np.array([0, 0]), np.zeros(2), np.array([-1, 0])
    for _ in range(interval):
        count_down(straight, turn, np.full(2, drawn), interval, driven)
    assert turn.tolist() == [0.0, 0.0]
    count_down(straight, turn, np.full(2, drawn), interval, driven)
    assert turn.tolist() == [drawn, 0.0]
    assert straight.tolist() == [0, 0]
    count_down(straight, turn, np.full(2, 9.0), interval, driven)  # not while it turns
    assert (turn[0], straight[0]) == (drawn, 0)


def test_exploring_robots_turn_at_once_after_the_interval_and_by_no_more_than_the_largest_turn():
    model = model_of_three_designs(Subsumption(Explore(turn_interval=3, largest_turn_degrees=40, speed=0.5)))
    layer, senses, turned = model.control.layers[0], made_senses(1), np.zeros(ROBOTS)
    for step in range(1, 40):
        command, _ = decided(layer, senses, np.full(ROBOTS, -1))
        straight = command[:, 0] == command[:, 1]
        assert straight.all() == (step < 4) or step > 4
        assert (command[straight, 0] == 0.5 * senses.max_speed[straight]).all()
        turned = np.where(straight, 0.0, turned + command[:, 1] / senses.radius)
        assert (np.abs(turned) <= math.radians(40) + 1e-9).all()
    assert (model.swarm.columns["0.Explore.straight"] <= 3).all()


class Encounter:
    """One robot that may meet another head-on, by the words of the documentation."""

    def __init__(self):
        self.front = self.least = self.speed = self.left = None

    def step(self, me, draw, driven, distance=30.0, margin=0.25, parting=1.0):
        robots = np.flatnonzero(me.kind == ROBOT)
        nearest = nearest_robot_ahead(me)
        reading = me.distance[me.forward[0]] if me.forward[0] in robots else None
        if self.speed is not None:
            self.least = min(self.least, me.distance[nearest]) if nearest >= 0 else self.least
            goes_away = nearest >= 0 and me.distance[nearest] > self.least + parting
            if self.left <= 0 or goes_away:
                self.speed = None
        elif (
            None not in (reading, self.front)
            and reading < distance
            and not driven
            and self.front - reading > me.last_command.mean() + margin * me.max_speed
        ):
            self.speed, self.left, self.least = draw * me.max_speed, math.pi, reading
        self.front = reading
        if self.speed is None or driven:
            return None
        rim = min(self.left * me.radius, self.speed)
        self.left -= rim / me.radius
        return (-rim, rim) if me.tendency > 0 else (rim, -rim)


@pytest.mark.slow
def test_encounters_begin_go_on_and_end_as_documented():
    state = np.full(ROBOTS, -1.0), np.full(ROBOTS, -1.0), np.zeros(ROBOTS), np.zeros(ROBOTS)
    twins, senses, drove = [Encounter() for _ in range(ROBOTS)], None, 0
    for seed in range(60):
        senses, drivers = made_senses(seed, senses), made_drivers(seed)
        comes = np.flatnonzero(np.random.default_rng(seed).random(2 * EACH) < 0.8)  # of those with a sensor ahead
        front = senses.forward[senses.design[comes], 0]
        senses.kind[comes, front] = ROBOT
        senses.distance[comes, front] = np.random.default_rng(seed).choice(
            [0.0, 10.0, 11.0, 25.0, 30.0, 50.0], len(comes)
        )
        draws = np.random.default_rng(seed).choice([0.3, 1.0, 9.0], ROBOTS)
        nearest = np.array([nearest_robot_ahead(known_to(senses, i)) for i in range(ROBOTS)])
        command, won = np.full((ROBOTS, 2), NOTHING_WRITTEN), drivers.copy()
        meet_head_on(
            nearest, senses.distance, senses.kind, senses.design, senses.forward, senses.last_command,
            senses.max_speed, senses.radius, senses.tendency, draws, 30.0, 0.25, 1.0, *state, command, won, 7,
        )  # fmt: skip
        for i, twin in enumerate(twins):
            wanted = twin.step(known_to(senses, i), draws[i], drivers[i] >= 0)
            drove += wanted is not None
            assert won[i] == (drivers[i] if wanted is None else 7)
            assert command[i] == pytest.approx(wanted or [NOTHING_WRITTEN] * 2, abs=1e-12)
    assert drove > 100


def tracked(*centroids, jump=15.0, share=0.5, seen=1, turns=False, command=(0.0, 0.0)):
    """Return the velocity and the number of compared steps after these centroids of what a robot sees."""
    state = np.zeros((1, 2)), np.zeros(1, np.int64), np.zeros((1, 2)), np.zeros(1, np.int64)
    for place in centroids:
        count = np.array([0 if place is None else seen])
        where = np.array([place or (0.0, 0.0)])
        track(where, count, np.array([command]), np.array([5.0]), turns, share, jump, *state)
    return state[2][0].tolist(), int(state[3][0])


def test_displacements_of_just_the_jump_are_counted_and_the_first_sight_is_not():
    assert tracked((10.0, 0.0)) == ([0.0, 0.0], 0)
    assert tracked((10.0, 0.0), (10.0, 15.0)) == ([0.0, 15.0], 1)
    assert tracked((10.0, 0.0), (10.0, 15.1)) == ([0.0, 0.0], 0)


def test_the_first_steps_are_averaged_alike_and_later_ones_with_the_share_of_memory():
    assert tracked((0.0, 0.0), (2.0, 0.0), (6.0, 0.0)) == ([3.0, 0.0], 2)
    assert tracked((0.0, 0.0), (0.0, 2.0), (0.0, 6.0), (0.0, 16.0)) == ([0.0, 6.5], 3)
    assert tracked((0.0, 0.0), (3.0, 0.0), (9.0, 0.0), (18.0, 0.0), share=0.01) == ([pytest.approx(6.0), 0.0], 3)


def test_a_robot_that_sees_none_any_more_forgets_how_they_moved():
    assert tracked((0.0, 0.0), (2.0, 0.0), None) == ([0.0, 0.0], 0)
    assert tracked((0.0, 0.0), (2.0, 0.0), None, (4.0, 0.0)) == ([0.0, 0.0], 0)


def test_a_glider_s_own_command_is_added_to_what_it_saw_move():
    velocity, _ = tracked((10.0, 0.0), (10.0, 0.0), command=(0.5, -0.25))
    assert velocity == [0.5, -0.25]


@pytest.mark.parametrize("steps", [FEWEST - 1, FEWEST])
def test_aligning_begins_with_the_fewest_compared_steps_and_never_exceeds_full_speed(steps):
    velocity = np.array([[3.0, 4.0], [0.3, -0.4], [0.0, 0.0], [1.0, 1.0]])
    command, layer = np.full((4, 2), NOTHING_WRITTEN), np.array([-1, -1, -1, 0])
    align(velocity, np.full(4, steps), FEWEST, np.full(4, 2.0), command, layer, 7)
    wanted = [[1.2, 1.6], [0.3, -0.4], [0.0, 0.0]] if steps == FEWEST else [[NOTHING_WRITTEN] * 2] * 3
    assert layer.tolist() == [7 if steps == FEWEST else -1] * 3 + [0]
    wanted.append([NOTHING_WRITTEN] * 2)  # driven by an earlier layer
    np.testing.assert_allclose(command, wanted)
