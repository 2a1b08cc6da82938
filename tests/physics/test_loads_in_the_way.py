"""Loads and what is in their way: they slide along walls, push robots along, and are held."""

import math

import pytest

from mesa_swarm import RobotDesign, disc, rectangle
from mesa_swarm.control import Subsumption
from mesa_swarm.world.statics import LOAD
from support.pushing import BOX, ENGINES, abreast, note_returns, world
from support.scenes import PROMISED, ahead, blind, empty, worst_load_overlap, worst_overlap

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
    slippery = RobotDesign(name="slippery", slip_probability=0.3, slip_magnitude=0.5)

    def held():
        model, _ = world(rectangle((340, 100), (380, 200)), 0.5, abreast(3, 335.0), design=slippery)
        model.add_robots(blind(max_speed=0.0), poses=[(391, 150, 0.0)])
        return model.run(30)

    untouched, _ = world(design=slippery, poses=[(50, 50, 0.0)] * 4)
    by_kernels = held()
    taken = note_returns(monkeypatch)
    by_python = held()
    assert taken
    assert by_kernels.state_hash() == by_python.state_hash()
    after = {each.streams["slip"].random() for each in (by_kernels, by_python, untouched.run(30))}
    assert len(after) == 1


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("aside", [0.0, 1 / 3, 1.9])
def test_a_load_that_meets_a_robot_halfway_drives_it_back_wherever_rounding_leaves_its_centre(engine, aside):
    """Half a radius each: the centre then lies on the load's face, or a rounding to either side of it."""
    model = empty(engine=engine)
    load = model.add_load(rectangle((150 + aside, 100), (250 + aside, 200)), resistance=0.5)
    model.add_robots(blind(5.0, 2.5), poses=[(145 + aside, 105 + 15 * k, 0.0) for k in range(7)])
    (robot,) = model.add_robots(blind(5.0, 2.5), poses=[(255 + aside, 150, math.pi)])
    model.control = Subsumption(ahead)
    for step in range(1, 4):
        model.step()
        assert load.position[0] == pytest.approx(200 + aside + 2.5 * step)
        assert robot.position[0] == pytest.approx(255 + aside + 2.5 * step)
        assert worst_overlap(model) <= PROMISED
