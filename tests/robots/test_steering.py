"""Steering: straight on to what is ahead, else a turn on the spot that never goes too far."""

import math

from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.robots.drive import approach

bearings = st.floats(-math.pi, math.pi)


@given(bearings, st.floats(0, math.pi), st.floats(0, 10), st.floats(0.1, 10))
def test_a_robot_drives_straight_where_the_bearing_is_within_the_critical_angle_and_only_there(
    bearing, critical, speed, radius
):
    left, right = approach(bearing, critical, speed, radius)
    if abs(bearing) <= critical:
        assert (left, right) == (speed, speed)
    else:
        assert left == -right
        turn = (right - left) / (2 * radius)
        assert 0 <= turn / bearing <= 1 + 1e-12
        assert abs(right) <= speed


@given(bearings, st.floats(0.1, 10), st.floats(0.1, 10))
def test_left_and_right_are_mirror_images(bearing, speed, radius):
    left, right = approach(bearing, 0.1, speed, radius)
    assert approach(-bearing, 0.1, speed, radius) == (right, left)
