"""How robots move loads: closed forms of how many it takes, and of the limit surface."""

import math

import numpy as np
import pytest

from mesa_swarm import RobotDesign, disc
from mesa_swarm.control import Subsumption
from support.pushing import BOX, ENGINES, abreast, world
from support.scenes import PROMISED, ahead, blind, empty, worst_overlap
from support.tables import farthest_from

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
def test_an_off_centre_push_turns_a_box_about_the_point_from_the_limit_surface(engine, offset):
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
    assert farthest_from(load, pose) == pytest.approx(2.5, rel=1e-3)
