"""Who meets a face is turned by it or not, and robots that meet stop where they should (PHYSICS 4)."""

import math

import numpy as np
import pytest

from mesa_swarm import disc, rectangle
from mesa_swarm.control import Subsumption
from support.driving import at_wall
from support.scenes import blind, circle, empty

# ---- faces turn who grazes them


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("from_normal", "turns"), [(0, False), (30, False), (59.9, False), (60.1, True), (85, True)])
def test_only_a_grazing_robot_is_turned_parallel_to_a_flat_face(from_normal, turns, side, reverse):
    heading = side * math.radians(from_normal)
    if reverse:
        heading, speed = heading - side * math.pi, -1.0
    else:
        speed = 1.0
    model = at_wall(heading, (speed, speed))
    turned = model.swarm.heading[0]
    if turns:
        parallel = side * math.pi / 2 * (-1 if reverse else 1)
        assert math.remainder(turned - parallel, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    else:
        assert math.remainder(turned - heading, 2 * math.pi) == pytest.approx(0, abs=1e-12)
    assert model.swarm.position[0, 1] == pytest.approx(150 + side * math.sin(math.radians(from_normal)), abs=1e-9)


@pytest.mark.parametrize(("turn_angle", "turns"), [(0.0, True), (44.0, True), (46.0, False), (90.0, False)])
def test_the_angle_from_which_faces_turn_robots_is_the_one_asked_for(turn_angle, turns):
    model = at_wall(math.radians(45), turn_angle_degrees=turn_angle)
    assert (model.swarm.heading[0] == pytest.approx(math.pi / 2)) == turns


def test_an_obstacle_s_face_turns_like_the_border_s():
    model = empty()
    model.add_obstacle(rectangle((0, 0), (400, 100)))
    model.add_robots(blind(), poses=[(200, 105, -0.2)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.step()
    assert model.swarm.heading[0] == pytest.approx(0, abs=1e-9)
    assert model.swarm.position[0] == pytest.approx((200 + math.cos(0.2), 105), abs=1e-9)


@pytest.mark.parametrize("heading", [-1.5, -1.0, -0.6, -0.1])
def test_a_disc_never_turns_a_robot(heading):
    model = empty()
    model.add_obstacle(disc((200, 100), 30))
    model.add_robots(blind(), poses=[(200, 135, heading)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    for _ in range(10):
        model.step()
        assert model.swarm.heading[0] == heading
    assert model.total_collisions > 0


def test_a_vertex_never_turns_a_robot():
    model = empty()
    model.add_obstacle(rectangle((0, 0), (200, 100)))
    model.add_robots(blind(), poses=[(203, 103.9, math.pi + 0.3)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.step()
    assert model.swarm.collided[0]
    assert model.swarm.heading[0] == pytest.approx(-math.pi + 0.3, abs=1e-12)


# ---- robots that meet


@pytest.mark.parametrize("gap", [20.0, 21.7, 0.5])
def test_robots_that_meet_head_on_stop_exactly_in_the_middle(gap):
    model = empty()
    model.add_robots(blind(), poses=[(195 - gap / 2, 150, 0.0), (205 + gap / 2, 150, math.pi)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.run(40)
    assert model.swarm.position == pytest.approx(np.array([[195, 150], [205, 150]]), abs=1e-6)
    assert model.swarm.position.mean(axis=0) == pytest.approx((200, 150), abs=1e-12)
    assert model.swarm.slip == pytest.approx(np.ones((2, 2)), abs=1e-6)


def test_reversing_robots_meet_in_the_middle_too():
    model = empty()
    model.add_robots(blind(), poses=[(180, 150, math.pi), (220, 150, 0.0)])
    model.control = Subsumption(circle(left=-1.0, right=-1.0))
    model.run(40)
    assert model.swarm.position == pytest.approx(np.array([[195, 150], [205, 150]]), abs=1e-6)


def test_the_faster_of_two_robots_pushes_the_slower_back_by_half_of_each_overlap():
    model = empty()
    model.add_robots(blind(max_speed=1.0), poses=[(195, 150, 0.0)])
    model.add_robots(blind(max_speed=0.5), poses=[(205, 150, math.pi)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.step()
    # They overlap by 1.5 after the move; each gives way by 0.75.
    assert model.swarm.position[:, 0] == pytest.approx((195.25, 205.25), abs=1e-9)
    assert model.swarm.slip == pytest.approx(np.array([[0.75, 0.75], [1.5, 1.5]]), abs=1e-9)
