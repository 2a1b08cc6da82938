"""Nearest points, crossings and insides agree with Shapely's for any polygon."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely import LineString, MultiPoint, Point, Polygon

from mesa_swarm.geometry.overlap import is_in_polygon, nearest_on_segment, segments_meet, wrap_angle

numbers = st.floats(-100, 100)


@st.composite
def polygons(draw):
    """Draw stars, concave as a rule, half of them with a hole."""
    lengths = draw(st.lists(st.floats(5, 60), min_size=3, max_size=12))
    turn = draw(st.floats(0, 6))
    azimuths = [turn + 2 * math.pi * k / len(lengths) for k in range(len(lengths))]
    points = np.array([(r * math.cos(a), r * math.sin(a)) for r, a in zip(lengths, azimuths, strict=True)])
    star = Polygon(points, [0.5 * points] if draw(st.booleans()) else [])
    assume(star.is_valid)
    return star


def edges_of(polygon):
    """Return the edges of all rings as rows ax, ay, bx, by."""
    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    return np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in rings])


@given(polygons(), numbers, numbers)
def test_a_point_is_in_a_polygon_when_it_is_in_shapelys(polygon, x, y):
    assume(polygon.boundary.distance(Point(x, y)) > 1e-9)
    edges = edges_of(polygon)
    assert is_in_polygon(x, y, edges, 0, len(edges)) == shapely.contains_xy(polygon, x, y)


@given(polygons(), st.integers(0, 30), numbers)
def test_a_point_level_with_a_vertex_is_counted_once(polygon, k, x):
    vertices = shapely.get_coordinates(polygon)
    y = vertices[k % len(vertices), 1]
    assume(polygon.boundary.distance(Point(x, y)) > 1e-9)
    edges = edges_of(polygon)
    assert is_in_polygon(x, y, edges, 0, len(edges)) == shapely.contains_xy(polygon, x, y)


@given(polygons(), polygons(), numbers, numbers)
def test_only_the_given_rows_count(polygon, other, x, y):
    assume(polygon.boundary.distance(Point(x, y)) > 1e-9)
    first, both = edges_of(other), np.concatenate([edges_of(other), edges_of(polygon), edges_of(other)])
    last = len(both) - len(first)
    assert is_in_polygon(x, y, both, len(first), last) == shapely.contains_xy(polygon, x, y)


@given(*[numbers] * 6)
def test_the_nearest_point_of_a_segment_is_as_far_as_shapelys(x, y, ax, ay, bx, by):
    px, py, _ = nearest_on_segment(x, y, ax, ay, bx, by)
    expected = LineString([(ax, ay), (bx, by)]).distance(Point(x, y))
    assert math.hypot(x - px, y - py) == pytest.approx(expected, abs=1e-9)


def test_the_nearest_point_is_on_the_face_or_at_an_end():
    assert nearest_on_segment(3.0, 4.0, 0.0, 0.0, 10.0, 0.0) == (3.0, 0.0, True)
    assert nearest_on_segment(0.0, 4.0, 0.0, 0.0, 10.0, 0.0) == (0.0, 0.0, False)
    assert nearest_on_segment(10.0, 4.0, 0.0, 0.0, 10.0, 0.0) == (10.0, 0.0, False)
    assert nearest_on_segment(12.0, 4.0, 0.0, 0.0, 10.0, 0.0) == (10.0, 0.0, False)
    assert nearest_on_segment(1.0, 1.0, 7.0, 7.0, 7.0, 7.0) == (7.0, 7.0, False)


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_heading_is_in_its_interval_and_points_the_same_way(heading):
    turned = wrap_angle(heading)
    assert -math.pi <= turned < math.pi
    assert math.cos(turned) == pytest.approx(math.cos(heading), abs=1e-9)
    assert math.sin(turned) == pytest.approx(math.sin(heading), abs=1e-9)


@given(st.floats(-math.pi, math.pi, exclude_max=True))
def test_a_heading_within_half_a_turn_is_left_as_it_is(heading):
    assert wrap_angle(heading) == heading


def test_half_a_turn_wraps_to_minus_half_a_turn():
    assert wrap_angle(math.pi) == -math.pi
    assert wrap_angle(-math.pi) == -math.pi
    assert -math.pi <= wrap_angle(math.nextafter(-math.pi, -4)) < math.pi


@given(st.tuples(*[st.integers(0, 4)] * 8))
def test_segments_meet_where_shapelys_intersect_on_a_lattice_where_they_often_touch(ends):
    # A MultiPoint's hull is a segment, or a point where both ends are the same.
    a, b = MultiPoint([ends[:2], ends[2:4]]).convex_hull, MultiPoint([ends[4:6], ends[6:]]).convex_hull
    assert segments_meet(*map(float, ends)) == a.intersects(b)
