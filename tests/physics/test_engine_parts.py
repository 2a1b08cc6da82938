"""The parts of a step between columns and kernels, and the kernels of radio, beside twins that try all pairs."""

import copy
import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, DifferentialDrive, HolonomicDrive, ProximitySensor, Radio, RobotDesign, rectangle
from mesa_swarm.geometry.grid import Grid
from mesa_swarm.physics.arcs import count_pieces, write_achieved_motion, write_wheel_slip
from mesa_swarm.physics.broadcasts import (
    Channel,
    hear_goals,
    hear_states,
    is_cut,
    nearest_heard,
    obstacles_of,
    send_goals,
)
from mesa_swarm.physics.engine import (
    CompiledEngine,
    drives_by_rows,
    rolling_wheels,
    wheels_of,
    write_motion,
)
from mesa_swarm.physics.sensing import hold_readings
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.robots.swarm import Swarm
from support.solid_worlds import BOUNDS, solid_world

WORLD = solid_world()
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=30)
ENGINES = [CompiledEngine, ShapelyEngine]


def swarm_of(*robots):
    """Return a swarm of these designs at these places, all with heading 0."""
    swarm = Swarm()
    for design, place in robots:
        swarm.add(design, np.array([place], float), np.zeros(1), np.ones(1))
        swarm.agents.append(None)
    return swarm


# ---- readings that are held


@given(st.integers(0, 60))
def test_only_sensors_whose_period_divides_the_step_are_refreshed(step):
    periods = (1, 2, 5), (3,)
    designs = [RobotDesign(sensors=[ProximitySensor(period=p) for p in row]) for row in periods]
    swarm = swarm_of((designs[0], (20, 20)), (designs[1], (60, 20)))
    swarm.columns["distance"][:], swarm.columns["kind"][:] = 7.0, 1
    columns, old = swarm.columns, (np.full((2, 3), 4.0), np.full((2, 3), 2, np.int8))
    hold_readings(step, columns["design"], swarm.table.noise, *old, columns["distance"], columns["kind"])
    fresh = [[step % p == 0 for p in row] for row in periods]
    assert swarm.distance[0].tolist() == [7.0 if due else 4.0 for due in fresh[0]]
    assert swarm.kind[0].tolist() == [1 if due else 2 for due in fresh[0]]
    assert swarm.distance[1, 0] == (7.0 if fresh[1][0] else 4.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_slow_sensor_waits_and_a_quick_one_beside_it_does_not(engine):
    slow = RobotDesign(sensors=[ProximitySensor(range=60), ProximitySensor(range=60, period=3)])
    swarm, engine = swarm_of((slow, (15, 30))), engine()
    for step, read in ((3, [20.0, 20.0]), (4, [19.0, 20.0]), (5, [18.0, 20.0]), (6, [17.0, 17.0])):
        swarm.columns["position"][0, 0] = 35 - read[0]
        engine.sense(swarm, WORLD.surroundings, step, None)
        assert swarm.distance[0] == pytest.approx(read)


# ---- drives


def test_each_drive_moves_its_own_rows():
    gliding = RobotDesign(name="gliding", drive=HolonomicDrive())
    swarm = swarm_of((AGENT3, (20, 20)), (gliding, (60, 20)), (AGENT9, (20, 60)), (gliding, (90, 60)))
    drives = drives_by_rows(swarm)
    assert [(drive, rows.tolist()) for drive, rows in drives] == [
        (DifferentialDrive(), [0, 2]),
        (HolonomicDrive(), [1, 3]),
    ]
    wheels, motion = np.array([[0.2, 0.4], [0.3, -0.1], [1.0, -1.0], [0.0, 0.5]]), np.full((4, 3), 9.0)
    write_motion(swarm, drives, wheels, motion)
    expected = [[0.3, 0.0, 0.02], [0.3, -0.1, 0.0], [0.0, 0.0, -0.2], [0.0, 0.5, 0.0]]
    assert motion == pytest.approx(np.array(expected))
    assert wheels_of(swarm, drives, motion) == pytest.approx(wheels)


def test_equal_drives_share_one_call_for_all_robots():
    swarm = swarm_of((AGENT3, (20, 20)), (AGENT9, (60, 20)))
    assert drives_by_rows(swarm) == [(DifferentialDrive(), slice(None))]


def test_wheels_roll_as_commanded_without_draws_and_slip_with_them():
    swarm = swarm_of((AGENT3.with_slip(probability=0.5, magnitude=0.25), (20, 20)))
    swarm.columns["command"][:] = [[0.8, -0.4]]
    assert rolling_wheels(swarm, swarm.command, None).tolist() == [[0.8, -0.4]]
    assert rolling_wheels(swarm, swarm.command, np.array([[0.4, 0.6]])).tolist() == [[pytest.approx(0.6), -0.4]]


@pytest.mark.parametrize("collided", [False, True])
def test_slip_compares_the_command_with_what_was_achieved_where_a_robot_collided_and_with_its_wheels_else(collided):
    swarm = swarm_of((AGENT3, (30, 30)), (AGENT3, (60, 60)))
    swarm.columns["command"][:] = [[0.8, 0.8], [0.5, 0.5]]

    class Pushing(ShapelyEngine):
        def travel(self, swarm, surroundings, motion, turn_angle):
            swarm.columns["position"][0, 0] += 0.2
            swarm.columns["collided"][:] = [collided, False]
            return np.zeros(2)

    Pushing().move(swarm, WORLD.surroundings, swarm.columns["command"], 0.3, None)
    assert swarm.slip[0] == pytest.approx([0.75, 0.75] if collided else [0.0, 0.0])
    assert swarm.slip[1].tolist() == [0.0, 0.0]


@given(st.integers(1, 40), st.floats(0.5, 20))
def test_a_step_of_whole_pieces_is_not_cut_into_one_more_by_rounding(pieces, radius):
    motion = np.array([[0.0, 0.5 * radius * pieces, 1.0], [0.1 * radius, 0.0, 0.0]])
    assert count_pieces(motion, np.array([radius, 2 * radius])) == pieces
    motion[0, 1] *= 1.001
    assert count_pieces(motion, np.array([radius, 2 * radius])) == pieces + 1


@pytest.mark.parametrize("off", [0.9e-6, 1.1e-6, -1.1e-6])
def test_only_an_arc_whose_chord_is_no_longer_than_rounding_leaves_the_speeds_as_they_are(off):
    turn = 2 * math.pi * (1 - off)
    motion = np.array([[8.0, 1.0, turn]])
    write_achieved_motion(np.zeros((1, 2)), np.zeros((1, 2)), np.zeros(1), np.zeros(1), np.array([True]), motion)
    assert motion[0].tolist() == ([8.0, 1.0, turn] if abs(off) < 1e-6 else [0.0, 0.0, turn])


def test_the_slip_of_each_wheel_is_its_own():
    slip = np.full((3, 2), 9.0)
    write_wheel_slip(
        np.array([[1.0, 0.5], [0.0, -2.0], [4.0, 0.0]]), np.array([[0.5, 0.5], [3.0, -1.0], [-4.0, 1.0]]), slip
    )
    assert slip.tolist() == [[0.5, 0.0], [0.0, 0.5], [2.0, 0.0]]


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_notices_other_robots_and_other_surroundings(engine):
    narrow = RobotDesign(sensors=(ProximitySensor(range=16, field_of_view_degrees=10),))
    engine, swarm = engine(), swarm_of((narrow, (30, 40)))
    other = solid_world((rectangle((50, 30), (60, 50)),))
    engine.sense(swarm, WORLD.surroundings, 1, None)
    assert swarm.distance[0, 0] == -1.0
    engine.sense(swarm, other.surroundings, 1, None)
    assert swarm.distance[0, 0] == pytest.approx(15.0)
    swarm.add(narrow, np.array([[45.0, 40.0]]), np.zeros(1), np.ones(1))
    swarm.agents.append(None)
    engine.sense(swarm, other.surroundings, 1, None)
    assert swarm.distance[:, 0] == pytest.approx([5.0, 0.0])
    engine.settle(swarm, WORLD.surroundings)
    assert swarm.position.tolist() == [[30.0, 40.0], [45.0, 40.0]]
    engine.move(swarm, WORLD.surroundings, swarm.columns["command"], 0.3, None)
    assert not swarm.collided.any()


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_moves_and_settles_a_world_without_robots(engine):
    engine, swarm = engine(), Swarm()
    engine.sense(swarm, WORLD.surroundings, 1, None)
    engine.settle(swarm, WORLD.surroundings)
    engine.move(swarm, WORLD.surroundings, swarm.columns["command"], 0.3, None)
    assert len(swarm.position) == 0


# ---- radio


@few
@given(seeds, st.floats(5, 80), st.integers(1, 400))
def test_of_the_senders_in_range_the_one_whose_target_is_nearest_is_heard_and_of_equals_the_smallest_number(
    seed, reach, cells
):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 12, 2)
    position = rng.integers(0, 8, (n, 2)) * 10.0 + BOUNDS[:2]
    places, targets = (rng.integers(0, 8, (m, 2)) * 10.0 + BOUNDS[:2] for _ in range(2))
    number, numbers = rng.permutation(20)[:n], rng.permutation(20)[:m]
    grid = Grid.over(BOUNDS, rng.uniform(1, 40), cells).numbers
    limits = reach, 0.0, np.uint64(1), False
    statics = WORLD.statics
    obstacles = statics.edges, statics.discs, *statics.touch_cells, None
    heard = nearest_heard(position, number, places, targets, numbers, limits, grid, obstacles)
    for i in range(n):
        near = [j for j in range(m) if math.dist(places[j], position[i]) <= reach and numbers[j] != number[i]]
        best = min(near, key=lambda j: (((targets[j] - position[i]) ** 2).sum(), numbers[j]), default=-1)
        assert heard[i] == best


@given(seeds)
def test_a_broadcast_is_cut_where_the_line_meets_an_obstacle_and_not_by_fires(seed):
    rng, s = np.random.default_rng(seed), WORLD.surroundings.statics
    (ax, ay), (bx, by) = rng.uniform(BOUNDS[:2], BOUNDS[2:], (2, 2))
    if rng.random() < 0.2:
        bx = ax
    obstacles = obstacles_of(WORLD.surroundings)
    line = shapely.LineString([(ax, ay), (bx, by)])
    outlines = [polygon.boundary for polygon in WORLD.solids.polygons[1:]]
    gaps = [outline.distance(line) for outline in outlines]
    gaps += [line.distance(shapely.Point(x, y)) - r for x, y, r in s.discs[: s.first_apart]]
    assume(min(map(abs, gaps)) == 0.0 or min(map(abs, gaps)) > 1e-6)
    assert is_cut(ax, ay, bx, by, obstacles) == is_cut(bx, by, ax, ay, obstacles) == (min(gaps) <= 0.0)


@given(seeds)
def test_goals_sent_from_their_own_frames_are_heard_in_the_frames_of_the_hearers(seed):
    rng = np.random.default_rng(seed)
    position, heading, goal = rng.uniform(20, 60, (4, 2)), rng.uniform(-3, 3, 4), rng.uniform(-9, 9, (4, 2))
    goal[3] = math.nan
    sent = np.empty((4, 2))
    send_goals(position, heading, goal, sent)
    axes = np.exp(1j * heading)
    on_map = position @ [1, 1j] + goal @ [1, 1j] * axes
    assert (sent @ [1, 1j])[:3] == pytest.approx(on_map[:3])
    assert np.isnan(sent[3]).all()
    limits, number, heard = (1e3, 0.0, np.uint64(1), False), np.arange(4), np.empty((4, 2))
    statics, beacons = WORLD.statics, np.array([[30.0, 30.0]])
    obstacles = statics.edges, statics.discs, *statics.touch_cells, None
    hear_goals(position, heading, number, sent, beacons, limits, WORLD.grid, obstacles, heard)
    for i in range(4):
        others = [30 + 30j, *(on_map[j] for j in range(3) if j != i)]
        nearest = min(others, key=lambda z: abs(z - complex(*position[i])))
        assert complex(*heard[i]) == pytest.approx((nearest - complex(*position[i])) / axes[i])


def test_a_goal_with_one_number_missing_is_not_sent():
    limits, heard = (1e3, 0.0, np.uint64(1), False), np.empty((2, 2))
    statics, none = WORLD.statics, np.empty((0, 2))
    obstacles = statics.edges, statics.discs, *statics.touch_cells, None
    place = np.array([[20.0, 20.0], [40.0, 10.0]]), np.zeros(2), np.arange(2)
    for number in (0, 1):
        sent = np.full((2, 2), math.nan)
        sent[0] = 15.0
        sent[0, number] = math.inf if number else math.nan
        hear_goals(*place, sent, none, limits, WORLD.grid, obstacles, heard)
        assert np.isnan(heard).all()


def test_the_state_of_the_nearest_robot_at_work_is_heard_from_its_place():
    statics = WORLD.statics
    obstacles = statics.edges, statics.discs, *statics.touch_cells, None
    position = np.array([[20.0, 10.0], [25.0, 10.0], [20.0, 17.0]])
    layer, task = np.array([3, 4, 5]), np.array([0, -1, 2])
    out = np.empty(3, np.int64), np.empty(3, np.int64), np.empty((3, 2))
    limits = 1e3, 0.0, np.uint64(1), False
    hear_states(
        position, np.array([0.0, math.pi / 2, 0.0]), np.arange(3), layer, task, limits, WORLD.grid, obstacles, *out
    )
    assert (out[0].tolist(), out[1].tolist()) == ([5, 3, 3], [2, 0, 0])
    assert out[2] == pytest.approx(np.array([[0, 7], [0, 5], [0, -7]]), abs=1e-12)
    hear_states(position, np.zeros(3), np.arange(3), layer, task - 9, limits, WORLD.grid, obstacles, *out)
    assert (out[0].tolist(), out[1].tolist()) == ([-1] * 3, [-1] * 3)
    assert np.isnan(out[2]).all()


@pytest.mark.parametrize(("state", "goal"), [(True, False), (False, True), (True, True)])
def test_a_channel_carries_what_its_radio_broadcasts_and_notices_other_robots_and_obstacles(state, goal):
    swarm = swarm_of((AGENT3, (20, 40)), (AGENT3, (70, 40)))
    channel = Channel(Radio(range=60, state=state, goal=goal, occlusion=True))
    swarm.columns["task"][:], swarm.columns["layer"][:] = [7, -1], 2
    swarm.columns["sent_goal"][0] = 30.0, 40.0

    def heard(around):
        for name in ("heard_layer", "heard_task"):
            swarm.columns[name].fill(-1)
        for name in ("heard_from", "heard_goal"):
            swarm.columns[name].fill(math.nan)
        channel.kernel(swarm, around.surroundings).run(1, len(swarm))
        return swarm.heard_task.tolist(), swarm.heard_goal[1].tolist()

    there = [-1, 7] if state else [-1, -1], [-40.0, 0.0] if goal else pytest.approx([math.nan] * 2, nan_ok=True)
    nothing = [-1, -1], pytest.approx([math.nan] * 2, nan_ok=True)
    assert heard(WORLD) == there
    assert heard(solid_world((rectangle((40, 30), (50, 50)),))) == nothing
    assert heard(WORLD) == there
    swarm.add(AGENT3, np.array([[65.0, 40.0]]), np.zeros(1), np.ones(1))
    swarm.agents.append(None)
    swarm.columns["task"][2] = 9
    assert heard(WORLD)[0] == ([9, 9, 7] if state else [-1] * 3)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_copied_engine_refers_to_no_arrays_of_the_first(engine):
    engine, swarm = engine(), swarm_of((AGENT9, (20, 20)))
    engine.threads = 3
    engine.sense(swarm, WORLD.surroundings, 1, None)
    twin, other = copy.deepcopy((engine, swarm))
    assert (twin.threads, vars(twin).keys()) == (3, vars(type(engine)()).keys())
    other.columns["command"][:] = 1.0
    twin.move(other, WORLD.surroundings, other.columns["command"], 0.3, None)
    assert (other.position[0, 0], swarm.position[0, 0]) == (21.0, 20.0)
