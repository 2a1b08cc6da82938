"""The parts of moving loads, of the oracle whose bits those of the engines have, each by its closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import Map, SwarmModel, disc, rectangle
from mesa_swarm.physics.contact import SLOP
from mesa_swarm.physics.loads import EQUAL, HAIR
from mesa_swarm.physics.surroundings import SLACK, STEP
from support import shapely_loads as loads
from support.shapely_loads import RobotPush, Room, Stop, Wrench, _stops, borne, go, twist_of, wrench_of
from support.tables import note, put, surroundings_of

numbers = st.floats(-5, 5)
pushes = st.lists(st.builds(RobotPush, numbers, numbers, numbers, st.floats(0, 1), st.floats(0, 1)), max_size=5)


def load_at(*shapes, resistance=1.0, bounds=(0, 0, 400, 300)):
    """Return loads of these shapes."""
    model = SwarmModel(map=Map(name="hall", bounds=bounds), rng=1)
    return [model.add_load(shape, resistance=resistance) for shape in shapes]


def straight(force=1.0, way=1.0, x=1.0, y=0.0, arm=0.0):
    return RobotPush(x, y, arm, force, way)


@given(pushes)
def test_pushes_add_up_to_a_force_and_a_torque_whatever_their_order(all_pushes):
    wrench = wrench_of(all_pushes)
    assert wrench == wrench_of(all_pushes[::-1])
    assert wrench.x == pytest.approx(sum(p.force * p.x for p in all_pushes))
    assert wrench.y == pytest.approx(sum(p.force * p.y for p in all_pushes))
    assert wrench.torque == pytest.approx(sum(p.force * p.arm for p in all_pushes))


BOX = rectangle((100, 100), (130, 140))


@pytest.mark.parametrize("resistance", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("part", ["x", "y", "torque"])
def test_a_load_stays_until_the_wrench_leaves_the_ellipsoid_of_its_friction(resistance, part):
    (load,) = load_at(BOX, resistance=resistance)
    lever = load.form.lever
    axis = {"x": (1, 0, 0), "y": (0, 1, 0), "torque": (0, 0, lever)}[part]
    push = RobotPush(axis[0], axis[1], axis[2], 1.0, 1.0)
    for share, moves in ((1.0, False), (1.0 + EQUAL / 4, False), (1.0 + 4 * EQUAL, True), (2.0, True)):
        wrench = Wrench(*(share * resistance * np.array(axis)))
        assert (twist_of(wrench, [push], load, 1e9) is not None) == moves
    mixed = Wrench(0.6 * resistance, 0.0, 0.79 * resistance * lever)
    assert twist_of(mixed, [push], load, 1e9) is None
    mixed = Wrench(0.6 * resistance, 0.0, 0.81 * resistance * lever)
    assert twist_of(mixed, [RobotPush(1.0, 0.0, lever, 1.0, 1.0)], load, 1e9) is not None


def test_a_load_moves_as_fast_as_the_robots_that_push_its_way_on_average_weighted_by_force():
    (load,) = load_at(BOX, resistance=0.5)
    team = [straight(1.0, 2.0), straight(0.5, 0.5), straight(0.25, 9.0, x=-1.0)]
    x, y, turn = twist_of(wrench_of(team), team, load, 1e9)
    assert x == pytest.approx((1.0 * 2.0 + 0.5 * 0.5) / 1.5)
    assert (y, turn) == (0.0, 0.0)


def test_at_the_point_of_a_single_push_a_load_gives_way_at_the_speed_of_that_push():
    (load,) = load_at(BOX, resistance=0.1)
    push = RobotPush(0.0, 1.0, 12.0, 0.8, 0.6)
    x, y, turn = twist_of(wrench_of([push]), [push], load, 1e9)
    assert x == 0.0
    assert y + turn * push.arm == pytest.approx(push.way)
    assert turn / y == pytest.approx(push.arm / load.form.lever**2)


@pytest.mark.parametrize("arm", [0.0, 12.0, -12.0])
def test_no_point_of_a_load_is_moved_farther_than_it_may(arm):
    (load,) = load_at(BOX, resistance=0.1)
    push = RobotPush(0.0, 1.0, arm, 1.0, 50.0)
    x, y, turn = twist_of(wrench_of([push]), [push], load, 2.5)
    assert math.hypot(x, y) + abs(turn) * load.form.reach == pytest.approx(2.5)


def test_a_load_whose_robots_are_all_driven_back_stays():
    (load,) = load_at(BOX, resistance=0.5)
    assert twist_of(Wrench(2.0, 0.0, 0.0), [straight(x=-1.0)], load, 1e9) is None
    assert twist_of(Wrench(2.0, 0.0, 0.0), [straight(x=0.0, y=1.0)], load, 1e9) is None


@given(numbers, numbers)
def test_a_stop_bears_what_goes_into_it_and_nothing_of_what_goes_along_it_or_away(x, y):
    left = borne(Wrench(x, y, 0.0), [Stop(-1.0, 0.0, 0.0)], 10.0)
    hair = HAIR * math.hypot(x, y)
    assert left.y == y
    assert left.torque == 0.0
    assert left.x == pytest.approx(min(x, -hair), abs=1e-12)


def test_stops_in_a_corner_bear_all_that_goes_into_it():
    left = borne(Wrench(3.0, 4.0, 0.0), [Stop(-1.0, 0.0, 0.0), Stop(0.0, -1.0, 0.0)], 10.0)
    assert (left.x, left.y) == pytest.approx((-5 * HAIR, -5 * HAIR))


def test_two_stops_that_bear_a_flat_side_bear_torque_and_one_lets_the_load_turn():
    lever, wrench = 10.0, Wrench(0.0, -1.0, 3.0)
    both = borne(wrench, [Stop(0.0, 1.0, -8.0), Stop(0.0, 1.0, 8.0)], lever)
    assert (both.y, both.torque) == pytest.approx((0.0, 0.0), abs=0.05)
    one = borne(wrench, [Stop(0.0, 1.0, 8.0)], lever)
    force = (HAIR - (-1.0 + 3.0 * 8.0 / lever**2)) / (1.0 + 0.64)
    assert (one.y, one.torque) == pytest.approx((-1.0 + force, 3.0 + 8.0 * force), abs=1e-3)
    assert borne(wrench, [], lever) == wrench


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.5, 0.8125, 0.999, 1.0, 7.0])
def test_a_load_goes_as_far_as_there_is_room_to_a_thousandth_of_its_way(share):
    (load,) = load_at(BOX)
    begin = load.pose
    room = SimpleNamespace(has_room_for=lambda load, pose: pose[0] - begin[0] <= 8.0 * share + 1e-9)
    went = go(load, (8.0, -4.0, 0.2), room)
    assert min(share, 1.0) - 2.0**-10 <= went <= min(share, 1.0) + 1e-9
    assert load.pose == pytest.approx(np.array(begin) + went * np.array([8.0, -4.0, 0.2]))


def pushed(load, position, heading, motion, radius=5.0, max_speed=1.0):
    columns = {
        "position": np.array(position, float),
        "heading": np.array(heading, float),
        "radius": np.full(len(position), radius),
        "max_speed": np.full(len(position), max_speed),
    }
    return loads.pushes_on(load, columns, np.array(motion, float))


@pytest.mark.parametrize("gap", [0.0, 0.25, 0.75])
def test_a_robot_pushes_with_its_speed_into_the_load_and_with_what_is_left_of_its_way(gap):
    (load,) = load_at(BOX)
    (push,) = pushed(load, [(95 - gap, 130)], [0.0], [(0.8, 0.0, 0.0)])
    assert push == pytest.approx(RobotPush(1.0, 0.0, -10.0, 0.8, 0.8 - gap))
    (push,) = pushed(load, [(120, 145 + gap)], [0.0], [(0.0, -0.8, 0.0)])
    assert push == pytest.approx(RobotPush(0.0, -1.0, -5.0, 0.8, 0.8 - gap))


def test_a_robot_that_does_not_reach_the_load_or_drives_away_or_along_does_not_push():
    (load,) = load_at(BOX)
    assert pushed(load, [(94.2, 130)], [0.0], [(0.8, 0.0, 0.0)]) == []
    assert pushed(load, [(95, 130)], [math.pi], [(0.8, 0.0, 0.0)]) == []
    assert pushed(load, [(95, 130)], [math.pi / 2], [(0.8, 0.0, 0.0)]) == []
    assert pushed(load, [(95, 130)], [0.0], [(0.0, 0.0, 0.0)]) == []
    assert pushed(load, [(10, 10)], [0.0], [(0.8, 0.0, 0.0)]) == []


def test_a_push_is_full_at_the_greatest_speed_and_never_more_than_that():
    (load,) = load_at(BOX)
    forces = [pushed(load, [(95, 120)], [0.0], [(v, 0, 0)], max_speed=0.5)[0].force for v in (0.25, 0.5, 0.75)]
    assert forces == pytest.approx([0.5, 1.0, 1.0])


def test_the_speed_of_a_robot_that_turns_is_that_of_its_chord_half_way():
    (load,) = load_at(disc((100, 100), 20))
    turn = 1.0
    (push,) = pushed(load, [(75, 100)], [0.2 - turn / 2], [(0.9, 0.0, turn)])
    assert push.force == pytest.approx(0.9 * math.sin(turn / 2) / (turn / 2) * math.cos(0.2))
    assert push.arm == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("width", "radii", "way"), [(40.0, [4.0, 8.0], 2.0), (40.0, [8.0, 4.0], 2.0), (2.0, [4.0, 8.0], 1.0)]
)
def test_a_load_moves_by_at_most_half_the_least_radius_and_half_its_own_width(width, radii, way):
    (load,) = load_at(rectangle((200, 100), (200 + width, 140)), resistance=0.5)
    around, radii = surroundings([load]), np.array(radii)
    columns = {
        "position": np.array([[200.0 - radii[0], 120.0], [50.0, 50.0]]),
        "heading": np.zeros(2),
        "radius": radii,
        "max_speed": np.full(2, 30.0),
    }
    before, motion = load.pose, np.array([[30.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert loads.push_all(around, Room.around(around), columns, motion) == {0: before}
    assert load.pose == pytest.approx((before[0] + way, before[1], 0.0))
    assert (load.pushers, load.moved) == (1, True)
    assert around.present_shapes[0] == load.shape
    assert loads.push_all(around, Room.around(around), columns, 0 * motion) == {}
    assert (load.pushers, load.moved) == (0, False)


@pytest.mark.parametrize(("depth", "overlaps"), [(-0.1, False), (1.0, False), (3.0, True)])
@pytest.mark.parametrize("place", [(1.0, 0.0), (0.0, 1.0), (-0.6, 0.8)])
def test_a_robot_overlaps_a_load_where_it_does_by_more_than_twice_the_rounding(depth, overlaps, place):
    (load,) = load_at(disc((100, 100), 20))
    centre = np.array([100.0, 100.0]) + (25.0 - depth * SLOP * 5.0) * np.array(place)
    columns = {"position": np.array([centre, [300.0, 100.0]]), "radius": np.array([5.0, 5.0])}
    assert loads.is_overlapped(load, columns) == overlaps


# ---- room


def surroundings(loads_, shapes=(), fires=(), touch=5.0):
    return surroundings_of((0, 0, 400, 300), shapes, fires, loads=loads_, sight=50.0, touch=touch)


@pytest.mark.parametrize("way", [(1, 0), (-1, 0), (0, 1), (0, -1)])
@pytest.mark.parametrize(
    "body", ["wall", "disc", "fire", "load", "mark"],
)  # fmt: skip
def test_a_load_has_room_until_it_touches_a_body(way, body):
    """The load is 20 from the body's rim along each axis."""
    far = np.array(way)
    centre = np.array([200.0, 150.0]) + 40.0 * far
    box = rectangle(centre - 10, centre + 10, contact=body != "mark")
    load, *others = load_at(rectangle((190, 140), (210, 160)), *([box] if body == "load" else []))
    shape = disc(centre, 10) if body == "disc" else box
    around = surroundings(
        [load, *others],
        [shape] if body in {"wall", "disc", "mark"} else [],
        [(*centre, 10.0)] if body == "fire" else [],
    )
    room, (x, y, _) = Room.around(around), load.pose
    assert room.has_room_for(load, (x + 19.99 * far[0], y + 19.99 * far[1], 0.0))
    assert room.has_room_for(load, (x + 20.01 * far[0], y + 20.01 * far[1], 0.0)) == (body == "mark")
    assert (len(room.stops_of(load, 20.5)) > 0) == (body != "mark")
    assert room.stops_of(load, 19.5) == []


def test_a_load_has_no_room_beyond_the_border():
    (load,) = load_at(disc((200, 150), 10))
    room = Room.around(surroundings([load]))
    for x, y in ((10.01, 150), (389.99, 150), (200, 10.01), (200, 289.99)):
        assert room.has_room_for(load, (x, y, 0.0))
    for x, y in ((9.99, 150), (390.01, 150), (200, 9.99), (200, 290.01)):
        assert not room.has_room_for(load, (x, y, 0.0))


def test_the_stops_of_a_disc_point_at_its_centre_and_those_of_a_box_are_its_corners():
    (round_one,) = load_at(disc((100, 50), 10))
    (stop,) = _stops(round_one, shapely.LineString([(80, 39.99), (120, 39.99)]), 0.1)
    assert stop == pytest.approx(Stop(0.0, 1.0, 0.0))
    (box,) = load_at(rectangle((90, 40), (110, 60)))
    stops = _stops(box, shapely.LineString([(80, 39.99), (120, 39.99)]), 0.1)
    assert sorted(stops) == [pytest.approx(Stop(0.0, 1.0, arm)) for arm in (-10.0, 10.0)]
    (stop,) = _stops(box, shapely.Point(89, 55), 2.0)
    assert stop == pytest.approx(Stop(1.0, 0.0, -5.0))


def test_tables_are_worn_when_a_load_has_moved_by_their_slack_less_one_step():
    touch = 6.0
    (load,) = load_at(disc((200, 150), 10))
    around = surroundings([load], touch=touch)
    assert around.slack == (SLACK - STEP) * touch
    assert around.reference.tolist() == [[200.0, 150.0, 0.0]]
    for moved, worn in ((0.0, False), (around.slack - 0.01, False), (around.slack + 0.01, True)):
        put(load, (200.0, 150.0 + moved, 0.0))
        assert around.is_worn == worn


def test_without_loads_there_is_no_room_to_look_after_and_nothing_wears():
    around = surroundings([])
    assert around.room is None
    assert not around.is_worn
    assert len(around.loads) == len(around.rows) == len(around.reference) == 0


def test_a_load_that_followed_is_in_the_tables_where_it_is_now():
    (load,) = load_at(disc((200, 150), 10))
    around = surroundings([load], [rectangle((20, 20), (40, 40))])
    put(load, (210.0, 160.0, 0.0))
    around.follow()
    assert around.statics.discs.tolist() == [[210.0, 160.0, 10.0]]
    assert around.present_shapes[1] == load.shape


def test_loads_that_are_taken_back_take_those_with_them_that_then_have_no_room():
    first, second, third = load_at(*(disc((100 + 21 * k, 100), 10) for k in range(3)))
    around = surroundings([first, second, third])
    before = {k: load.pose for k, load in enumerate((first, second, third))}
    put(first, (104.0, 100.0, 0.0))
    put(second, (125.0, 100.0, 0.0))
    put(third, (150.0, 100.0, 0.0))
    for load in (first, second, third):
        note(load, moved=True, pushers=0)
    # The second returns to 121: the first, at 104, is then 17 from it; the third, at 150, is 29.
    loads.take_back(around, Room.around(around), before, [1])
    assert [load.pose[0] for load in (first, second, third)] == [100.0, 121.0, 150.0]
    assert [load.moved for load in (first, second, third)] == [False, False, True]
    assert list(before) == [2]
    assert around.statics.discs[:2, 0].tolist() == [100.0, 121.0]


def test_the_room_of_a_world_is_all_static_bodies_but_its_loads():
    (load,) = load_at(disc((200, 150), 10))
    around = surroundings([load], [rectangle((20, 20), (40, 40)), disc((60, 60), 7)], [(90.0, 90.0, 3.0)])
    room = Room.around(around)
    assert len(room.solids) == 4 + 4 + 2
    assert room.radii.tolist() == [0.0] * 8 + [7.0, 3.0]
