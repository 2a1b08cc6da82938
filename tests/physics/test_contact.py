"""Overlaps with edges and discs: where touching ends, and which way out."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from mesa_swarm.physics.contact import coincident_direction, disc_overlap, edge_overlap
from mesa_swarm.physics.travel import turn_along_faces

numbers = st.floats(-20, 20)
# The solid side is on the left: below this edge.
FLOOR = np.array([[10.0, 0.0, -10.0, 0.0]])


def test_a_disc_that_touches_a_face_does_not_overlap_and_one_ulp_nearer_it_does():
    assert edge_overlap(2.0, 5.0, 5.0, FLOOR, 0)[0] == 0.0
    depth, nx, ny, flat = edge_overlap(2.0, math.nextafter(5.0, 0.0), 5.0, FLOOR, 0)
    assert depth > 0.0
    assert (nx, ny, flat) == (0.0, 1.0, True)


def test_a_disc_that_touches_a_vertex_does_not_overlap_though_its_box_does():
    assert edge_overlap(13.0, 4.0, 5.0, FLOOR, 0)[0] == 0.0
    depth, nx, ny, flat = edge_overlap(13.0, 4.0, 5.5, FLOOR, 0)
    assert depth == pytest.approx(0.5)
    assert (nx, ny) == pytest.approx((0.6, 0.8))
    assert not flat


@pytest.mark.parametrize("y", [0.0, 1e-7, -1e-7])
def test_a_centre_on_a_face_leaves_it_on_the_open_side_by_all_of_its_radius(y):
    depth, nx, ny, flat = edge_overlap(2.0, y, 5.0, FLOOR, 0)
    assert (nx, ny, flat) == (0.0, 1.0, True)
    assert depth == pytest.approx(5.0 - y, abs=1e-12)


@given(*[numbers] * 6, st.floats(0.5, 9))
def test_an_overlap_with_an_edge_is_as_deep_as_shapelys_distance(x, y, ax, ay, bx, by, radius):
    gap = shapely.LineString([(ax, ay), (bx, by)]).distance(shapely.Point(x, y))
    assume(gap > 1e-3)
    depth, nx, ny, _ = edge_overlap(x, y, radius, np.array([[ax, ay, bx, by]]), 0)
    assert depth == pytest.approx(max(radius - gap, 0.0), abs=1e-9)
    if depth > 0.0:
        out = shapely.Point(x + depth * nx, y + depth * ny)
        assert math.hypot(nx, ny) == pytest.approx(1.0)
        assert shapely.LineString([(ax, ay), (bx, by)]).distance(out) == pytest.approx(radius, abs=1e-6)


def test_discs_that_touch_do_not_overlap_and_one_ulp_nearer_they_do():
    discs = np.array([[10.0, 0.0, 5.0]])
    assert disc_overlap(0.0, 0.0, 5.0, discs, 0)[0] == 0.0
    depth, nx, ny = disc_overlap(math.nextafter(0.0, 1.0) + 1e-9, 0.0, 5.0, discs, 0)
    assert depth == pytest.approx(1e-9, rel=1e-3)
    assert (nx, ny) == (-1.0, 0.0)


def test_a_disc_on_the_centre_of_another_leaves_it_by_both_radii():
    assert disc_overlap(3.0, 4.0, 2.0, np.array([[3.0, 4.0, 5.0]]), 0) == (7.0, 1.0, 0.0)


@given(st.integers(0, 10**6), st.integers(0, 10**6))
def test_coincident_robots_part_in_opposite_directions_along_a_unit_vector(a, b):
    assume(a != b)
    ax, ay = coincident_direction(a, b)
    assert (ax, ay) == tuple(-c for c in coincident_direction(b, a))
    assert math.hypot(ax, ay) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("heading", "turn"), [(-0.1, 0.1), (-0.7, 0.7), (-1.4, 0.0), (0.1, 0.0), (math.pi + 0.2, -0.2)]
)
def test_only_a_robot_that_meets_a_face_at_a_grazing_incidence_is_turned_along_it(heading, turn):
    # The face's normal is +y; a robot is turned if it travels more than 0.3 rad from the normal's opposite.
    headings, extra = np.array([heading]), np.zeros(1)
    turn_along_faces(np.zeros(1, int), headings, np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.5]]), 0.3, extra)
    assert extra[0] == pytest.approx(turn, abs=1e-12)
    assert math.cos(headings[0] - heading - turn) == pytest.approx(1.0)


def test_a_robot_that_stands_or_met_no_face_is_not_turned():
    headings, extra = np.array([-0.5, -0.5]), np.zeros(2)
    motion, face = np.array([[0.0, 0, 1], [1, 0, 0]]), np.array([[0.0, 1, 0.5], [0, 0, 0]])
    turn_along_faces(np.arange(2), headings, motion, face, 0.3, extra)
    assert headings.tolist() == [-0.5, -0.5]
    assert extra.tolist() == [0.0, 0.0]
