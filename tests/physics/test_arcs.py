"""Wheels become motion by exact arcs (PHYSICS 2)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.kernels.elementary import direction_of
from mesa_swarm.physics.arcs import advance_robots, recall_direction, sinc
from mesa_swarm.robots.drive import DifferentialDrive
from support.driving import alone, pose_of

wheel = st.floats(-1, 1)


def test_equal_wheels_drive_straight_along_the_heading():
    x, y, heading = pose_of(alone(0.5, 0.5, 40, (200, 150, 2.0)))
    assert (x, y) == pytest.approx((200 + 20 * math.cos(2), 150 + 20 * math.sin(2)), abs=1e-12)
    assert heading == 2.0


def test_opposite_wheels_turn_on_the_spot_by_the_rim_speed_over_the_radius():
    x, y, heading = pose_of(alone(-0.5, 0.5, 10))
    assert (x, y) == (200, 150)
    assert heading == pytest.approx(10 * 0.5 / 5, abs=1e-12)


@pytest.mark.slow
@given(left=wheel, right=wheel, heading=st.floats(-3, 3))
def test_one_step_goes_along_the_arc_around_the_instantaneous_centre(left, right, heading):
    x, y, turned = pose_of(alone(left, right, 1, (200, 150, heading)))
    speed, omega = (left + right) / 2, (right - left) / 10
    if abs(omega) > 1e-3:
        centre = speed / omega
        dx = centre * (math.sin(heading + omega) - math.sin(heading))
        dy = -centre * (math.cos(heading + omega) - math.cos(heading))
        assert (x, y) == pytest.approx((200 + dx, 150 + dy), abs=1e-11)
    assert math.hypot(x - 200, y - 150) <= abs(speed) + 1e-12
    assert math.remainder(turned - heading - omega, 2 * math.pi) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("steps", [3, 4, 7, 100, 629])
@pytest.mark.parametrize("side", [1, -1])
def test_a_circle_of_any_number_of_steps_closes(steps, side):
    omega = side * 2 * math.pi / steps
    position, heading = np.array([[0.0, 0.0]]), np.array([0.3])
    farthest = 0.0
    for _ in range(steps):
        advance_robots(position, heading, np.array([[4.0, 0.0, omega]]), 1)
        farthest = max(farthest, np.hypot(*position[0]))
    assert position[0] == pytest.approx((0, 0), abs=1e-9)
    assert math.remainder(heading[0] - 0.3, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert farthest > 1.9 * 4.0 / abs(omega) * math.sin(math.pi / 3)


def test_a_robot_that_drives_a_full_circle_is_back_where_it_was():
    # omega = (1 - left) / 10 = 2 pi / 100
    left = 1 - 10 * 2 * math.pi / 100
    half, whole = alone(left, 1.0, 50), alone(left, 1.0, 100)
    radius = (1 + left) / 2 * 100 / (2 * math.pi)
    assert pose_of(half)[:2] == pytest.approx((200, 150 + 2 * radius), abs=1e-9)
    assert pose_of(whole) == pytest.approx((200, 150, 0), abs=1e-9)
    assert whole.total_collisions == 0


@given(left=wheel, right=wheel, parts=st.integers(2, 200))
def test_one_long_step_ends_where_many_short_ones_of_the_same_ratio_do(left, right, parts):
    def drive(steps, share):
        position, heading, motion = np.zeros((1, 2)), np.array([0.7]), np.empty((1, 3))
        DifferentialDrive().motion(share * np.array([[left, right]]), np.array([5.0]), motion)
        for _ in range(steps):
            advance_robots(position, heading, motion, 1)
        return (*position[0], heading[0])

    assert drive(1, 1.0) == pytest.approx(drive(parts, 1.0 / parts), abs=1e-11)


@given(left=wheel, right=wheel, pieces=st.integers(1, 50))
def test_cutting_a_step_into_pieces_changes_nothing(left, right, pieces):
    ends = []
    for rounds in (1, pieces):
        position, heading = np.zeros((1, 2)), np.array([0.7])
        for _ in range(rounds):
            advance_robots(position, heading, np.array([[(left + right) / 2, 0.0, (right - left) / 10]]), rounds)
        ends.append((*position[0], heading[0]))
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


@given(half_turn=st.floats(-3, 3))
def test_sinc_is_smooth_where_it_changes_its_formula(half_turn):
    assert sinc(half_turn) == pytest.approx(float(np.sinc(half_turn / math.pi)), abs=1e-15)
    assert sinc(half_turn * 1e-4) == pytest.approx(float(np.sinc(half_turn * 1e-4 / math.pi)), abs=1e-15)


@given(st.lists(st.tuples(st.integers(0, 1), st.sampled_from([0.0, -0.0, 1.5]) | st.floats(-4, 4)), max_size=8))
def test_a_direction_that_is_recalled_has_the_bits_of_one_that_is_computed(headings):
    known = np.full((2, 3), np.nan)
    for row, heading in headings * 2:
        recalled = np.array(recall_direction(row, heading, known))
        assert recalled.tobytes() == np.array(direction_of(heading)).tobytes()
