"""Arcs, the motion that a robot achieves when it collides, and slip, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.physics.arcs import (
    LONGEST_PIECE,
    advance_robots,
    count_pieces,
    sinc,
    write_achieved_motion,
    write_wheel_slip,
)

speeds, turns, headings = st.floats(-20, 20), st.floats(-3, 3), st.floats(-3, 3)


def moved(start, heading, motion, pieces=1):
    """Return position and heading after a step of (forward, sideways, turn)."""
    position, azimuth = np.array([start], float), np.array([heading])
    for _ in range(pieces):
        advance_robots(position, azimuth, np.array([motion]), pieces)
    return position, azimuth


def achieved(start, position, heading, motion, extra_turn=0.0, collided=True):
    """Return the motion that one robot achieved."""
    out = np.array([motion], float)
    arguments = (np.array([value], float) for value in (start, position, heading, extra_turn))
    begin, end, before, extra = arguments
    write_achieved_motion(begin, end, before, extra, np.array([collided]), out)
    return out[0]


def test_a_quarter_circle_ends_where_geometry_puts_it():
    radius = 10.0
    position, heading = moved((5.0, 7.0), 0.0, (radius * math.pi / 2, 0.0, math.pi / 2))
    assert position[0] == pytest.approx([5.0 + radius, 7.0 + radius], abs=1e-12)
    assert heading[0] == pytest.approx(math.pi / 2)


@given(headings, speeds, speeds, turns, st.integers(2, 7))
def test_an_arc_in_pieces_ends_where_the_whole_arc_does(heading, forward, sideways, turn, pieces):
    whole, parts = (moved((3.0, -4.0), heading, (forward, sideways, turn), n) for n in (1, pieces))
    assert parts[0][0] == pytest.approx(whole[0][0], abs=1e-9)
    assert math.cos(parts[1][0] - whole[1][0]) == pytest.approx(1.0)


@given(st.floats(-2e-4, 2e-4))
def test_the_series_of_sinc_near_0_agrees_with_the_quotient(half_turn):
    exact = 1.0 if half_turn == 0.0 else math.sin(half_turn) / half_turn
    assert sinc(half_turn) == pytest.approx(exact, abs=1e-15)


@given(headings, speeds, speeds, turns)
def test_a_robot_that_nothing_stops_achieves_its_motion(heading, forward, sideways, turn):
    position, _ = moved((3.0, -4.0), heading, (forward, sideways, turn))
    assert achieved((3.0, -4.0), position[0], heading, (forward, sideways, turn)) == pytest.approx(
        [forward, sideways, turn], abs=1e-9
    )


@given(headings, turns, st.floats(-5, 5), st.floats(-5, 5))
def test_a_robot_that_collides_achieves_its_displacement_turned_back_by_half_its_turn(heading, turn, dx, dy):
    # The chord of an arc points along the heading half-way, and is 2 sin(turn / 2) / turn of the arc's length.
    shortening = 1.0 if abs(turn) < 1e-9 else 2.0 * math.sin(turn / 2) / turn
    forward, sideways, turned = achieved((1.0, 2.0), (1.0 + dx, 2.0 + dy), heading, (9.0, 9.0, turn))
    displacement = complex(dx, dy) * complex(math.cos(heading + turn / 2), -math.sin(heading + turn / 2))
    assert complex(forward, sideways) == pytest.approx(displacement / shortening, abs=1e-9)
    assert turned == turn


def test_half_a_circle_against_a_wall_is_as_long_as_its_diameter_allows():
    # On a half circle to the left a robot ends beside where it began: 3 units to its left, pi / 2 times 3 of arc.
    assert achieved((0, 0), (0, 3), 0.0, (8.0, 0.0, math.pi)) == pytest.approx([1.5 * math.pi, 0.0, math.pi])


def test_the_turn_along_a_wall_counts_as_achieved_but_does_not_rotate_the_displacement():
    assert achieved((0, 0), (2, 1), 0.0, (8.0, 0.0, 0.0), extra_turn=0.25) == pytest.approx([2.0, 1.0, 0.25])


def test_a_robot_whose_arc_is_a_full_circle_is_left_its_speeds():
    # The chord of a full circle is 0: the displacement does not determine the length of the arc.
    assert achieved((0, 0), (0, 0), 0.5, (8.0, 1.0, 2 * math.pi), 0.5) == pytest.approx([8.0, 1.0, 2 * math.pi + 0.5])


def test_a_robot_that_meets_nothing_is_left_as_it_is():
    motion = achieved((0, 0), (1, 1), 0.0, (8.0, 1.0, 0.3), extra_turn=9.0, collided=False)
    assert motion.tolist() == [8.0, 1.0, 0.3]


@pytest.mark.parametrize(
    ("motion", "pieces"),
    [
        ([[2.0, 0.0, 9.0]], 1),
        ([[2.5, 0.0, 0.0]], 1),
        ([[2.6, 0.0, 0.0]], 2),
        ([[3.0, -4.0, 0.0]], 2),
        ([[-5.1, 0, 0]], 3),
    ],
)
def test_no_piece_of_a_step_is_longer_than_half_the_least_radius(motion, pieces):
    radius = np.array([9.0, 5.0])
    both = np.array([[0.0, 0.0, 0.0], *motion])
    assert count_pieces(both, radius) == pieces
    assert np.hypot(*both[1, :2]) / pieces <= LONGEST_PIECE * radius.min()


def test_a_swarm_that_stands_or_is_empty_takes_one_piece():
    assert count_pieces(np.zeros((2, 3)), np.ones(2)) == 1
    assert count_pieces(np.zeros((0, 3)), np.ones(0)) == 1


@given(st.floats(0.01, 9), st.floats(-9, 9), st.booleans())
def test_slip_is_the_share_of_the_command_that_the_wheel_lost(command, wheel, backwards):
    command = -command if backwards else command
    slip = np.empty((1, 2))
    write_wheel_slip(np.array([[command, 0.0]]), np.array([[wheel, wheel]]), slip)
    assert slip[0, 1] == 0.0
    assert command * (1.0 - slip[0, 0]) == pytest.approx(wheel, abs=1e-9)
