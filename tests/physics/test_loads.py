"""How robots move loads: closed forms of the limit surface, of sliding along walls, and of who pushes whom."""

import math

import numpy as np
import pytest
import shapely

from mesa_swarm import AGENT9, ProximitySensor, RobotDesign, disc, polygon, rectangle
from mesa_swarm.control import Subsumption
from mesa_swarm.physics import loads as physics
from mesa_swarm.world.form import mean_distance
from mesa_swarm.world.statics import LOAD, Statics
from scenes import PROMISED, ahead, blind, circle, empty, worst_load_overlap, worst_overlap

ENGINES = ("compiled", "shapely")
BOX = rectangle((200, 100), (240, 200))


def world(shape=BOX, resistance=0.5, poses=(), design=None, speed=1.0, **options):
    """Return a model with a load and robots that drive straight on, and the load."""
    model = empty(**options)
    load = model.add_load(shape, resistance=resistance)
    if len(poses):
        model.add_robots(design or blind(), poses=poses)
    model.control = Subsumption(ahead(speed=speed))
    return model, load


def abreast(n, x=195.0, y=150.0, heading=0.0):
    """Return poses of robots side by side, in touch with the left face of the box, centred on y."""
    return [(x, y + 12.0 * (k - (n - 1) / 2), heading) for k in range(n)]


# ---- how many it takes


@pytest.mark.parametrize("engine", ENGINES)
def test_one_robot_does_not_move_what_withstands_one_and_a_half(engine):
    model, load = world(resistance=1.5, poses=abreast(1), engine=engine)
    model.run(500 if engine == "compiled" else 50)
    assert load.position.tolist() == [220.0, 150.0]
    assert (load.heading, load.moved, load.pushers) == (0.0, False, 1)
    assert model.swarm.position[0] == pytest.approx((195, 150), abs=1e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_five_robots_abreast_move_it_at_their_speed(engine):
    model, load = world(resistance=1.5, poses=abreast(5), engine=engine)
    model.run(60)
    assert load.position == pytest.approx((280, 150), abs=1e-9)
    assert load.heading == pytest.approx(0.0, abs=1e-12)
    assert (load.moved, load.pushers) == (True, 5)
    assert model.swarm.position[:, 0] == pytest.approx(np.full(5, 255.0), abs=1e-9)


@pytest.mark.parametrize("resistance", [1, 2, 3, 4])
@pytest.mark.parametrize("more", [0, 1])
def test_a_face_gives_way_to_one_robot_more_than_it_withstands(resistance, more):
    model, load = world(resistance=resistance, poses=abreast(resistance + more))
    model.run(20)
    assert load.moved is bool(more)
    assert load.position == pytest.approx((220 + 20 * more, 150), abs=1e-9)


def test_robots_at_half_their_speed_push_half_as_hard_and_move_it_half_as_fast():
    for resistance, way in ((0.99, 10.0), (1.01, 0.0)):
        model, load = world(resistance=resistance, poses=abreast(2), speed=0.5)
        model.run(20)
        assert load.position == pytest.approx((220 + way, 150), abs=1e-9)


def test_a_robot_that_drives_along_or_away_pushes_nothing():
    model, load = world(poses=[(195, 110, math.pi / 2), (195, 140, math.pi), (195, 180, -math.pi / 2)])
    model.step()
    assert (load.pushers, load.moved) == (0, False)


def test_a_robot_pushes_by_the_share_of_its_speed_that_is_straight_into_the_load():
    for degrees, moves in ((59.9, True), (60.1, False)):
        model, load = world(disc((220, 150), 20), 0.5, [(195, 150, math.radians(degrees))])
        model.step()
        assert load.moved is moves


def test_a_robot_on_its_way_pushes_when_it_arrives_with_what_is_left_of_its_step():
    model, load = world(poses=[(193.75, 150, 0.0)])
    model.step()
    assert (load.pushers, load.moved) == (0, False)
    model.step()
    assert load.position == pytest.approx((220.75, 150))
    assert model.swarm.position[0] == pytest.approx((195.75, 150))
    assert not model.swarm.collided.any()


def test_wheels_that_slip_push_less_hard():
    slippery = RobotDesign(name="slippery", slip_probability=1.0, slip_magnitude=0.5)
    for resistance, moves in ((0.49, True), (0.51, False)):
        model, load = world(resistance=resistance, poses=abreast(1), design=slippery)
        model.step()
        assert load.moved is moves


# ---- the limit surface


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("offset", [-40.0, -10.0, 0.0, 25.0])
def test_an_off_centre_push_turns_a_box_about_the_point_that_the_limit_surface_tells(engine, offset):
    model, load = world(poses=[(195, 150 + offset, 0.0)], engine=engine)
    model.step()
    square = load.form.lever**2
    share = square / (square + offset**2)
    assert load.position == pytest.approx((220 + share, 150), abs=1e-9)
    assert load.heading == pytest.approx(-offset / square * share, abs=1e-12)


@pytest.mark.parametrize(("offset", "side"), [(-30, 1), (30, -1)])
def test_a_box_that_is_pushed_for_long_turns_to_the_side_of_the_push(offset, side):
    model, load = world(poses=[(195, 150 + offset, 0.0)])
    model.run(40)
    assert side * load.heading > 0.3
    assert worst_overlap(model) <= PROMISED


@pytest.mark.parametrize("margin", [-1e-6, 1e-6])
def test_an_off_centre_push_moves_what_the_same_push_at_the_centre_does_not(margin):
    lever, offset = world()[1].form.lever, 40.0
    limit = math.hypot(1.0, offset / lever)
    model, load = world(resistance=limit * (1 - margin), poses=[(195, 150 + offset, 0.0)])
    model.step()
    assert limit > 1.3
    assert load.moved is (margin > 0)


def test_a_disc_is_not_turned_by_robots_that_push_its_rim():
    model, load = world(disc((220, 150), 30), 0.2, [(185, 150, 0.0), (220 - 35 * 0.6, 150 + 35 * 0.8, -0.3)])
    model.run(5)
    assert load.moved
    assert load.heading == 0.0


def test_a_couple_turns_a_box_on_the_spot():
    model, load = world(poses=[(195, 110, 0.0), (245, 190, math.pi)])
    model.step()
    assert load.position == pytest.approx((220, 150), abs=1e-12)
    assert load.heading == pytest.approx(1.0 / 40.0)  # both points of contact keep up with their robots


def test_opposite_pushes_cancel():
    model, load = world(resistance=0.5, poses=abreast(3) + abreast(3, 245.0, heading=math.pi))
    model.run(50)
    assert load.position.tolist() == [220.0, 150.0]
    assert load.pushers == 6


def test_the_majority_goes_at_its_own_pace_and_drives_the_others_back():
    model, load = world(resistance=0.5, poses=abreast(3) + abreast(2, 245.0, heading=math.pi))
    model.run(10)
    assert load.position == pytest.approx((230, 150), abs=1e-9)
    assert model.swarm.position[3:, 0] == pytest.approx(np.full(2, 255.0), abs=1e-5)
    assert worst_overlap(model) <= PROMISED


def test_slower_robots_slow_down_those_who_push_with_them():
    model = empty()
    load = model.add_load(BOX, resistance=1.0)
    model.add_robots(blind(5, 1.0), poses=[(195, 140, 0.0)])
    model.add_robots(blind(5, 0.5), poses=[(195, 160, 0.0)])
    model.control = Subsumption(ahead)
    model.step()
    assert load.position == pytest.approx((220.75, 150), abs=0.01)


def test_no_point_of_a_load_moves_farther_in_a_step_than_half_the_least_radius():
    model, load = world(poses=[(195, 130, 0.0)], design=blind(5, 15.0))
    pose = load.pose
    model.step()
    assert load.moved
    assert load.farthest_from(pose) == pytest.approx(2.5, rel=1e-3)


# ---- walls, corners, other loads


def test_a_load_stops_at_the_border_without_a_gap():
    model, load = world(rectangle((340, 100), (380, 200)), poses=abreast(3, 335.0))
    model.run(60)
    assert load.shape.bounds[2] == pytest.approx(400.0, abs=1e-3)
    assert worst_load_overlap(model) <= 1e-7
    assert not load.moved


@pytest.mark.parametrize("engine", ENGINES)
def test_a_disc_pushed_aslant_into_a_wall_slides_along_it(engine):
    robot = (220 - 35 * math.sqrt(0.5), 30 + 35 * math.sqrt(0.5), -math.pi / 4)
    model, load = world(disc((220, 30), 30), 0.3, [robot], engine=engine)
    model.step()
    # The robot pushes it from under itself: the point of contact keeps the robot's pace along the normal.
    assert load.position == pytest.approx((220 + math.sqrt(2), 30), abs=2e-3)
    model.run(20)
    assert load.position[0] > 230
    assert load.position[1] == pytest.approx(30, abs=1e-2)
    assert worst_load_overlap(model) <= 1e-7


def test_what_slides_along_a_wall_resists_the_part_of_the_push_that_the_wall_leaves():
    robot = (220 - 35 * math.sqrt(0.5), 30 + 35 * math.sqrt(0.5), -math.pi / 4)
    for resistance, moves in ((0.70, True), (0.71, False)):
        model, load = world(disc((220, 30), 30), resistance, [robot])
        model.step()
        assert load.moved is moves


@pytest.mark.parametrize("seams", [False, True])
def test_a_box_pressed_to_a_wall_slides_along_it_and_stays_flush(seams):
    model = empty(600, 300)
    for k in range(10) if seams else range(1):
        model.add_obstacle(rectangle((60 * k, 80), (60 * k + (60 if seams else 600), 100)))
    load = model.add_load(rectangle((100, 100), (220, 140)), resistance=0.5)
    model.add_robots(blind(), poses=[(95, 114, 0.0), (95, 126, 0.0), (190, 145, -math.pi / 2)])
    model.control = Subsumption(ahead)
    model.run(80)
    assert load.pushers == 3
    assert load.position == pytest.approx((240, 120), abs=0.1)
    assert load.heading == pytest.approx(0.0, abs=1e-3)
    assert worst_load_overlap(model) <= 1e-7


def test_a_box_pushed_along_a_wall_below_its_centre_lifts_its_far_end_and_pivots_on_the_near_one():
    model, load = world(rectangle((100, 0), (160, 40)), 0.5, [(95, 6, 0.0), (95, 18, 0.0)])
    model.step()
    corners = load.form.body_at(load.pose).geometry.exterior.coords
    lowest = min(corners, key=lambda corner: corner[1])
    assert load.heading > 1e-3
    assert lowest == pytest.approx((101, 0), abs=0.2)
    assert lowest[1] == pytest.approx(0.0, abs=1e-3)


def test_a_load_in_a_corner_stays_there():
    model, load = world(rectangle((340, 240), (400, 300)), 0.1, [(335, 235 + 5, 0.8), (370, 235, math.pi / 2)])
    model.run(30)
    assert load.position == pytest.approx((370, 270), abs=1e-6)
    assert load.pushers == 2


def test_a_load_that_lies_against_a_wall_can_be_pushed_off_it():
    model, load = world(rectangle((0, 100), (40, 200)), 0.5, [(45, 130, math.pi), (45, 170, math.pi)])
    model.run(5)
    assert load.position == pytest.approx((20, 150), abs=1e-6)
    model, load = world(rectangle((20, 100), (60, 120)), 0.5, [(40, 95, math.pi / 2)])
    model.add_obstacle(rectangle((0, 100), (20, 120)))
    model.run(30)
    assert load.position == pytest.approx((40, 140), abs=1e-6)


def test_a_load_does_not_push_another():
    model, load = world(poses=abreast(3))
    other = model.add_load(disc((270, 150), 10), resistance=0.1)
    model.run(60)
    assert other.position.tolist() == [270.0, 150.0]
    assert load.shape.bounds[2] == pytest.approx(260.0, abs=1e-3)


def test_a_fire_stops_a_load():
    model, load = world(poses=abreast(3))
    model.add_fire((270, 150), radius=10)
    model.run(60)
    assert load.shape.bounds[2] == pytest.approx(260.0, abs=1e-3)


# ---- robots that are in the way


@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_ahead_is_pushed_along_and_notes_the_load_as_its_contact(engine):
    model = empty(engine=engine)
    load = model.add_load(BOX, resistance=0.5)
    model.add_robots(blind(), poses=[(195, 150, 0.0)])
    model.add_robots(blind(max_speed=0.0), poses=[(246, 150, 0.0)])
    model.control = Subsumption(ahead)
    model.run(10)
    contacts = model.contacts
    assert model.swarm.position[1] == pytest.approx((255, 150), abs=1e-5)
    assert contacts.robot.tolist() == [model.robots[1].unique_id]
    assert (contacts.kind.tolist(), contacts.other.tolist()) == ([LOAD], [load.unique_id])
    assert contacts.normal[0] == pytest.approx((1.0, 0.0))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_between_a_load_and_a_wall_holds_the_load(engine):
    model, load = world(rectangle((340, 100), (380, 200)), 0.5, abreast(3, 335.0), engine=engine)
    model.add_robots(blind(max_speed=0.0), poses=[(391, 150, 0.0)])
    for _ in range(30):
        model.step()
        assert worst_overlap(model) <= PROMISED
    assert load.shape.bounds[2] == pytest.approx(390.0, abs=1.0)
    assert not load.moved


def test_a_load_that_is_held_does_not_hold_another():
    model, held = world(rectangle((340, 200), (380, 240)), 0.5, abreast(1, 335.0, 220.0) + abreast(1, 195.0, 50.0))
    free = model.add_load(rectangle((200, 30), (240, 70)), resistance=0.5)
    model.add_robots(blind(max_speed=0.0), poses=[(394, 220, 0.0)])
    model.run(40)
    assert not held.moved
    assert free.position == pytest.approx((260, 50), abs=1e-9)


def test_slip_is_drawn_once_a_step_even_if_the_step_is_done_again(monkeypatch):
    taken = []
    real = physics.take_back
    monkeypatch.setattr(physics, "take_back", lambda *args: (taken.append(1), real(*args)))
    slippery = RobotDesign(name="slippery", slip_probability=0.3, slip_magnitude=0.5)
    model, _ = world(rectangle((340, 100), (380, 200)), 0.5, abreast(3, 335.0), design=slippery)
    model.add_robots(blind(max_speed=0.0), poses=[(391, 150, 0.0)])
    untouched, _ = world(design=slippery, poses=[(50, 50, 0.0)] * 4)
    for each in (model, untouched):
        each.run(30)
    assert taken
    after = [each.streams["slip"].random() for each in (model, untouched)]
    assert after[0] == after[1]


# ---- tables, tables of statics, sensors


def test_tables_that_follow_a_load_are_those_that_are_made_anew():
    model, load = world(poses=[(195, 130, 0.0)])
    model.add_load(disc((100, 50), 10), resistance=0.1)
    model.add_robots(blind(), poses=[(85, 50, 0.2)])
    scene = model._current_scene()
    model.run(8)
    assert load.heading > 0.01
    assert model._current_scene() is scene
    bodies = [load.form.body_at(load.pose) for load in model.loads]
    fresh = Statics.of(model.map.bounds, bodies, np.empty((0, 3)), np.empty(0, bool), sight=0, touch=5, loads=[0, 1])
    for name in ("edges", "discs", "owner", "kind", "body", "rings"):
        assert (getattr(scene.statics, name) == getattr(fresh, name)).all()


def test_the_tables_are_made_anew_only_when_a_load_has_moved_by_several_radii():
    model, _ = world(poses=abreast(3))
    scenes = set()
    for _ in range(100):
        model.step()
        scenes.add(id(model._scene))
        model.scenes = [*getattr(model, "scenes", []), model._scene]  # kept, so that no id is used twice
    assert 3 <= len(scenes) <= 7


@pytest.mark.parametrize("engine", ENGINES)
def test_sensors_see_a_load_as_such_where_it_lies_now(engine):
    model, load = world(poses=abreast(3), engine=engine)
    (watcher,) = model.add_robots(AGENT9, poses=[(300, 150, math.pi)])
    watcher.max_speed = 0.0
    model.sense()
    assert watcher.distance[0] == -1.0
    model.run(20)
    model.sense()
    assert (watcher.kind[0], watcher.distance[0]) == (LOAD, pytest.approx(295 - 260))
    load.remove()
    model.sense()
    assert watcher.kind[0] != LOAD


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sensor_inside_a_load_reads_zero_and_a_wall_in_the_same_place_first(engine):
    feeler = RobotDesign(sensors=(ProximitySensor(mount=(9.0, 0.0), field_of_view_degrees=20),))
    model = empty(engine=engine)
    model.add_load(BOX, resistance=1)
    model.add_load(rectangle((380, 100), (400, 200)), resistance=1)
    model.add_robots(feeler, poses=[(194, 150, 0.0), (374, 150, 0.0), (6, 150, math.pi)])
    model.sense()
    assert model.swarm.distance[:, 0].tolist() == [0.0, 0.0, 0.0]
    assert model.swarm.kind[:, 0].tolist() == [LOAD, LOAD, 0]


# ---- the mean distance of a body's points from its centre


@pytest.mark.parametrize(("a", "b"), [(1, 1), (40, 100), (3, 500)])
def test_the_mean_distance_of_a_rectangle_is_the_closed_form(a, b):
    d = math.hypot(a, b)
    closed = d / 6 + a**2 / (12 * b) * math.log((b + d) / a) + b**2 / (12 * a) * math.log((a + d) / b)
    shape = rectangle((-a / 2, -b / 2), (a / 2, b / 2))
    assert mean_distance(shape.geometry, 0.0) == pytest.approx(closed, rel=1e-12)


def test_the_mean_distance_of_a_disc_is_two_thirds_of_its_radius_and_a_polygon_tends_to_it():
    azimuth = np.linspace(0, 2 * math.pi, 2000, endpoint=False)
    rim = polygon(30 * np.column_stack([np.cos(azimuth), np.sin(azimuth)]))
    assert mean_distance(disc((0, 0), 30).geometry, 30.0) == pytest.approx(20.0)
    assert mean_distance(rim.geometry, 0.0) == pytest.approx(20.0, rel=1e-5)


def test_the_mean_distance_of_a_concave_polygon_with_a_hole_is_what_a_sum_over_a_raster_gives():
    star = polygon([(-30, -20), (40, -25), (5, 0), (30, 30), (-20, 25)], [[(-15, -5), (-5, -5), (-10, 5)]]).geometry
    x, y = np.meshgrid(np.arange(-30, 40, 0.1) + 0.05, np.arange(-25, 30, 0.1) + 0.05)
    inside = shapely.contains_xy(star, x, y)
    assert mean_distance(star, 0.0) == pytest.approx(np.hypot(x, y)[inside].mean(), rel=1e-3)


def test_robots_that_circle_around_loads_leave_them_in_their_own_way():
    hashes = []
    for _ in range(2):
        model, _ = world(disc((200, 150), 25), 0.4)
        model.add_robots(AGENT9, 20)
        model.control = Subsumption(circle(left=0.8))
        hashes.append(model.run(100).state_hash())
    assert hashes[0] == hashes[1]
