"""Overlaps: where touching ends, and the same answers as Shapely's for any polygon."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely import LineString, MultiPoint, Point, Polygon

from mesa_swarm.geometry.overlap import (
    disc_overlaps_polygon,
    discs_overlap,
    in_polygon,
    nearest_on_segment,
    segments_meet,
    wrapped,
)

numbers = st.floats(-100, 100)
SQUARE = Polygon([(0, 0), (4, 0), (4, 4), (0, 4)])


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


def test_discs_that_touch_exactly_do_not_overlap_and_one_ulp_nearer_they_do():
    assert not discs_overlap(0.0, 0.0, 5.0, 10.0, 0.0, 5.0)
    assert not discs_overlap(0.0, 0.0, 5.0, math.nextafter(10, 11), 0.0, 5.0)
    assert discs_overlap(0.0, 0.0, 5.0, math.nextafter(10, 9), 0.0, 5.0)
    assert not discs_overlap(0.0, 0.0, 5.0, 6.0, 8.0, 5.0)


def test_discs_of_the_same_centre_overlap():
    assert discs_overlap(3.0, 3.0, 1.0, 3.0, 3.0, 0.5)


@given(numbers, numbers, st.floats(0.1, 50), numbers, numbers, st.floats(0.1, 50))
def test_overlap_of_discs_is_mutual(ax, ay, a, bx, by, b):
    assert discs_overlap(ax, ay, a, bx, by, b) == discs_overlap(bx, by, b, ax, ay, a)


@pytest.mark.parametrize(
    ("x", "y"), [(6.0, 2.0), (2.0, -2.0), (-2.0, 2.0), (2.0, 6.0)], ids=["east", "south", "west", "north"]
)
def test_a_disc_that_touches_a_face_exactly_does_not_overlap_and_one_ulp_nearer_it_does(x, y):
    edges = edges_of(SQUARE)
    nearer = [math.nextafter(c, 2.0) for c in (x, y)]
    assert not disc_overlaps_polygon(x, y, 2.0, edges, 0, 4)
    assert disc_overlaps_polygon(*nearer, 2.0, edges, 0, 4)


def test_a_disc_that_touches_a_vertex_exactly_does_not_overlap_though_its_box_does():
    edges = edges_of(SQUARE)
    assert not disc_overlaps_polygon(7.0, 8.0, 5.0, edges, 0, 4)
    assert disc_overlaps_polygon(7.0, 8.0, math.nextafter(5, 6), edges, 0, 4)


def test_a_disc_deep_inside_a_polygon_overlaps_it_and_one_in_its_hole_does_not():
    ring = Polygon(SQUARE.buffer(50).envelope.exterior, [SQUARE.exterior])
    edges = edges_of(ring)
    assert disc_overlaps_polygon(-20.0, -20.0, 1.0, edges, 0, len(edges))
    assert not disc_overlaps_polygon(2.0, 2.0, 1.0, edges, 0, len(edges))


@given(polygons(), numbers, numbers, st.floats(0.01, 40))
def test_a_disc_overlaps_a_polygon_when_shapely_says_so(polygon, x, y, radius):
    gap = polygon.distance(Point(x, y))
    assume(abs(gap - radius) > 1e-9)
    edges = edges_of(polygon)
    assert disc_overlaps_polygon(x, y, radius, edges, 0, len(edges)) == (gap < radius)


@given(polygons(), numbers, numbers)
def test_a_point_is_in_a_polygon_when_shapely_says_so(polygon, x, y):
    assume(polygon.boundary.distance(Point(x, y)) > 1e-9)
    edges = edges_of(polygon)
    assert in_polygon(x, y, edges, 0, len(edges)) == shapely.contains_xy(polygon, x, y)


@given(polygons(), st.data())
def test_a_point_level_with_a_vertex_is_counted_once(polygon, data):
    vertices = shapely.get_coordinates(polygon)
    y = vertices[data.draw(st.integers(0, len(vertices) - 1)), 1]
    x = data.draw(numbers)
    assume(polygon.boundary.distance(Point(x, y)) > 1e-9)
    edges = edges_of(polygon)
    assert in_polygon(x, y, edges, 0, len(edges)) == shapely.contains_xy(polygon, x, y)


@given(polygons(), polygons(), numbers, numbers)
def test_only_the_rows_asked_for_count(polygon, other, x, y):
    assume(polygon.boundary.distance(Point(x, y)) > 1e-9)
    first, both = edges_of(other), np.concatenate([edges_of(other), edges_of(polygon), edges_of(other)])
    last = len(both) - len(first)
    assert in_polygon(x, y, both, len(first), last) == shapely.contains_xy(polygon, x, y)


@given(*[numbers] * 6)
def test_the_nearest_point_of_a_segment_is_as_far_as_shapely_says(x, y, ax, ay, bx, by):
    px, py, _ = nearest_on_segment(x, y, ax, ay, bx, by)
    expected = LineString([(ax, ay), (bx, by)]).distance(Point(x, y))
    assert math.hypot(x - px, y - py) == pytest.approx(expected, abs=1e-9)


def test_the_nearest_point_tells_faces_from_ends():
    assert nearest_on_segment(3.0, 4.0, 0.0, 0.0, 10.0, 0.0) == (3.0, 0.0, True)
    assert nearest_on_segment(0.0, 4.0, 0.0, 0.0, 10.0, 0.0) == (0.0, 0.0, False)
    assert nearest_on_segment(12.0, 4.0, 0.0, 0.0, 10.0, 0.0) == (10.0, 0.0, False)
    assert nearest_on_segment(1.0, 1.0, 7.0, 7.0, 7.0, 7.0) == (7.0, 7.0, False)


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_is_in_its_interval_and_points_the_same_way(angle):
    turned = wrapped(angle)
    assert -math.pi <= turned < math.pi
    assert math.cos(turned) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(turned) == pytest.approx(math.sin(angle), abs=1e-9)


@given(st.floats(-math.pi, math.pi, exclude_max=True))
def test_an_angle_within_half_a_turn_is_left_as_it_is(angle):
    assert wrapped(angle) == angle


def test_half_a_turn_wraps_to_minus_half_a_turn():
    assert wrapped(math.pi) == -math.pi
    assert wrapped(-math.pi) == -math.pi
    assert -math.pi <= wrapped(math.nextafter(-math.pi, -4)) < math.pi


@given(st.tuples(*[st.integers(0, 4)] * 8))
def test_segments_meet_where_shapely_says_that_they_intersect_on_a_lattice_where_they_often_touch(ends):
    # A MultiPoint's hull is a segment, or a point where both ends are the same.
    a, b = MultiPoint([ends[:2], ends[2:4]]).convex_hull, MultiPoint([ends[4:6], ends[6:]]).convex_hull
    assert segments_meet(*map(float, ends)) == a.intersects(b)
