"""Overlap of discs and polygons, against Shapely, and at exact tangency."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely.geometry import LineString, Point

from mesa_swarm.geometry.overlap import (
    disc_overlaps_polygon,
    discs_overlap,
    in_polygon,
    nearest_on_segment,
    wrapped,
)

OUTLINE = [(0, 0), (60, 0), (60, 50), (40, 50), (40, 20), (20, 20), (20, 50), (0, 50)]
HOLE = [(5, 5), (15, 5), (15, 15), (5, 15)]
CONCAVE = shapely.Polygon(OUTLINE, [HOLE])
PLACES = st.floats(-20, 80)


def edges_of(polygon):
    rings = [shapely.get_coordinates(r) for r in (polygon.exterior, *polygon.interiors)]
    return np.vstack([np.hstack([ring[:-1], ring[1:]]) for ring in rings])


EDGES = edges_of(CONCAVE)


def test_discs_that_touch_do_not_overlap_and_one_ulp_nearer_they_do():
    assert not discs_overlap(0.0, 0.0, 5.0, 10.0, 0.0, 5.0)
    assert not discs_overlap(0.0, 0.0, 5.0, math.nextafter(10, 11), 0.0, 5.0)
    assert discs_overlap(0.0, 0.0, 5.0, math.nextafter(10, 9), 0.0, 5.0)


@given(x=PLACES, y=PLACES)
def test_a_point_is_in_a_concave_polygon_with_a_hole_where_shapely_says_so(x, y):
    assume(CONCAVE.boundary.distance(Point(x, y)) > 1e-9)
    assert in_polygon(x, y, EDGES, 0, len(EDGES)) == CONCAVE.contains(Point(x, y))


@given(x=PLACES, y=PLACES, radius=st.floats(0.1, 15))
def test_a_disc_overlaps_a_polygon_where_it_is_nearer_than_its_radius(x, y, radius):
    distance = CONCAVE.distance(Point(x, y))
    assume(abs(distance - radius) > 1e-9)
    assert disc_overlaps_polygon(x, y, radius, EDGES, 0, len(EDGES)) == (distance < radius)


def test_a_disc_near_a_corner_is_measured_to_the_corner_not_to_its_bounding_box():
    square = edges_of(shapely.box(0, 0, 10, 10))
    assert not disc_overlaps_polygon(14.0, 14.0, 5.0, square, 0, 4)
    assert disc_overlaps_polygon(13.0, 13.0, 5.0, square, 0, 4)


@pytest.mark.parametrize(
    ("y", "overlaps"), [(15.0, False), (math.nextafter(15, 16), False), (math.nextafter(15, 14), True)]
)
def test_a_disc_that_touches_a_face_does_not_overlap_it(y, overlaps):
    square = edges_of(shapely.box(0, 0, 10, 10))
    assert disc_overlaps_polygon(5.0, y, 5.0, square, 0, 4) == overlaps


@given(x=PLACES, y=PLACES, a=st.tuples(PLACES, PLACES), b=st.tuples(PLACES, PLACES))
def test_the_nearest_point_of_a_segment_is_as_near_as_shapely_says(x, y, a, b):
    px, py, _ = nearest_on_segment(x, y, *a, *b)
    assert math.hypot(x - px, y - py) == pytest.approx(LineString([a, b]).distance(Point(x, y)), abs=1e-9)


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_is_in_its_interval_and_points_the_same_way(angle):
    small = wrapped(angle)
    assert -math.pi <= small < math.pi
    assert math.cos(small - angle) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("angle", "expected"), [(math.pi, -math.pi), (-math.pi, -math.pi), (0.0, 0.0), (3.0, 3.0)])
def test_the_ends_of_the_interval_are_where_they_should_be(angle, expected):
    assert wrapped(angle) == expected
