"""Exact sector distances, against closed forms, Shapely, and very many rays."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon

from mesa_swarm.geometry.sector import (
    half_angle,
    in_cone,
    ray_to_disc,
    rays_to_disc,
    rays_to_segment,
    sector_to_disc,
    sector_to_segment,
)

ANGLES = st.one_of(
    st.floats(0.001, 2 * math.pi), st.sampled_from([0.0, math.pi / 2, math.pi, 3 * math.pi / 2, 2 * math.pi])
)
PLACES = st.floats(-60, 60)
RANGE = 50.0


def wedge(field_of_view, reach=RANGE):
    """Return the sector about +x as a fan that reaches beyond its range; built otherwise than in the package."""
    bearings = np.linspace(-field_of_view / 2, field_of_view / 2, 49)
    far = 2 * reach / math.cos(field_of_view / 96)
    arc = [(far * math.cos(b), far * math.sin(b)) for b in bearings]
    return Polygon(arc[:-1]) if field_of_view == 2 * math.pi else Polygon([(0, 0), *arc])


def rays_of(field_of_view, n=20_001):
    half = field_of_view / 2
    bearings = np.linspace(-half, half, n)
    return np.cos(bearings), np.sin(bearings)


@given(x=PLACES, y=PLACES, radius=st.floats(0.5, 20), field_of_view=ANGLES)
def test_no_ray_in_the_sector_meets_a_disc_sooner_and_one_meets_it_as_soon(x, y, radius, field_of_view):
    seen = sector_to_disc(x, y, radius, *half_angle(field_of_view), RANGE)
    cosine, sine = rays_of(field_of_view)
    hits = [ray_to_disc(x, y, radius, c, s) for c, s in zip(cosine, sine, strict=True)]
    nearest = min(hits)
    nearest = nearest if nearest <= RANGE else math.inf
    if math.isinf(nearest):
        # At most the disc grazes the sector between two rays.
        assert math.isinf(seen) or field_of_view > 0
    else:
        assert seen <= nearest + 1e-9
        assert seen >= nearest - 0.5


@given(a=st.tuples(PLACES, PLACES), b=st.tuples(PLACES, PLACES), field_of_view=ANGLES)
def test_a_segment_is_as_near_as_its_part_in_the_sector_is_for_shapely(a, b, field_of_view):
    assume(field_of_view > 0)
    line = LineString([a, b])
    sector = wedge(field_of_view)
    assume(sector.buffer(1e-6).intersection(line).is_empty == sector.buffer(-1e-6).intersection(line).is_empty)
    assume(line.length > 1e-3)
    part = sector.intersection(line)
    expected = math.inf if part.is_empty else part.distance(Point(0, 0))
    assume(abs(expected - RANGE) > 1e-6)
    expected = expected if expected <= RANGE else math.inf
    assert sector_to_segment(*a, *b, *half_angle(field_of_view), RANGE) == pytest.approx(expected, abs=1e-7)


@given(x=PLACES, y=PLACES, radius=st.floats(0.5, 20), field_of_view=ANGLES)
def test_a_disc_is_as_near_as_a_fine_polygon_in_its_place_is_for_shapely(x, y, radius, field_of_view):
    assume(field_of_view > 0.01)
    sector = wedge(field_of_view)
    inner = Point(x, y).buffer(radius, quad_segs=256)
    assume(sector.intersection(Point(x, y).buffer(radius - 0.05)).is_empty == sector.intersection(inner).is_empty)
    part = sector.intersection(inner)
    expected = math.inf if part.is_empty else part.distance(Point(0, 0))
    assume(abs(expected - RANGE) > 1e-2)
    expected = expected if expected <= RANGE else math.inf
    assert sector_to_disc(x, y, radius, *half_angle(field_of_view), RANGE) == pytest.approx(expected, abs=0.5, rel=0.02)


@given(x=PLACES, y=PLACES, radius=st.floats(0.5, 20), field_of_view=ANGLES)
def test_what_is_seen_does_not_change_when_left_and_right_are_exchanged(x, y, radius, field_of_view):
    cone = half_angle(field_of_view)
    assert sector_to_disc(x, y, radius, *cone, RANGE) == sector_to_disc(x, -y, radius, *cone, RANGE)


@given(x=PLACES, y=PLACES, radius=st.floats(0.5, 20), width=st.floats(0.01, 6), k=st.integers(1, 40))
def test_rays_never_see_nearer_than_the_sector(x, y, radius, width, k):
    exact = sector_to_disc(x, y, radius, *half_angle(width), RANGE)
    assert rays_to_disc(x, y, radius, width / 2, k, RANGE) >= exact - 1e-9


def test_many_rays_see_what_the_sector_sees():
    exact = sector_to_segment(12, -3, 20, 15, *half_angle(0.7), RANGE)
    assert rays_to_segment(12, -3, 20, 15, 0.35, 10_000, RANGE) == pytest.approx(exact, abs=1e-3)


def test_a_disc_straight_ahead_is_its_centre_less_its_radius_away():
    assert sector_to_disc(30, 0, 4, *half_angle(0.3), RANGE) == 26


def test_a_disc_beside_the_sector_is_met_by_the_nearer_edge():
    angle = 0.4
    x, y = 20.0, 12.0
    along = x * math.cos(angle / 2) + y * math.sin(angle / 2)
    across = -x * math.sin(angle / 2) + y * math.cos(angle / 2)
    expected = along - math.sqrt(10**2 - across**2)
    assert sector_to_disc(x, y, 10, *half_angle(angle), RANGE) == pytest.approx(expected, abs=1e-12)


def test_a_sector_of_range_zero_sees_only_what_it_touches():
    assert sector_to_disc(5, 0, 5, *half_angle(1.0), 0.0) == 0.0
    assert math.isinf(sector_to_disc(5.001, 0, 5, *half_angle(1.0), 0.0))
    assert sector_to_segment(0, -1, 0, 1, *half_angle(1.0), 0.0) == 0.0


def test_a_sector_without_width_is_a_ray():
    assert sector_to_disc(20, 3, 5, *half_angle(0.0), RANGE) == pytest.approx(20 - 4)
    assert math.isinf(sector_to_disc(20, 5.0001, 5, *half_angle(0.0), RANGE))
    assert math.isinf(sector_to_disc(-20, 0, 5, *half_angle(0.0), RANGE))
    assert sector_to_segment(7, -1, 7, 1, *half_angle(0.0), RANGE) == 7
    assert sector_to_segment(7, 0, 9, 0, *half_angle(0.0), RANGE) == 7


def test_a_sector_of_exactly_pi_sees_half_the_plane():
    cone = half_angle(math.pi)
    assert sector_to_disc(0, 20, 5, *cone, RANGE) == 15
    assert sector_to_disc(-3, 20, 5, *cone, RANGE) == pytest.approx(20 - 4)
    assert math.isinf(sector_to_disc(-5.001, 20, 5, *cone, RANGE))
    assert sector_to_segment(0, 5, 0, 9, *cone, RANGE) == 5


@given(x=PLACES, y=PLACES)
def test_a_full_turn_sees_everything_within_range(x, y):
    assert in_cone(x, y, *half_angle(2 * math.pi))
    gap = math.hypot(x, y) - 3
    seen = sector_to_disc(x, y, 3, *half_angle(2 * math.pi), RANGE)
    assume(abs(gap - RANGE) > 1e-9)
    assert seen == (pytest.approx(max(gap, 0.0)) if gap <= RANGE else math.inf)


@given(azimuth=st.floats(-math.pi, math.pi), width=st.floats(0.01, 6.2), distance=st.floats(1, 40))
def test_a_cone_that_points_across_plus_minus_pi_is_like_any_other(azimuth, width, distance):
    relative = math.remainder(azimuth - math.pi, 2 * math.pi)
    assume(abs(abs(relative) - width / 2) > 1e-9)
    x, y = distance * math.cos(relative), distance * math.sin(relative)
    assert in_cone(x, y, *half_angle(width)) == (abs(relative) < width / 2)


def test_an_apex_inside_or_on_the_rim_of_a_disc_is_at_distance_zero():
    cone = half_angle(0.1)
    assert sector_to_disc(-1, 0, 5, *cone, RANGE) == 0.0
    assert sector_to_disc(5, 0, 5, *cone, RANGE) == 0.0
    assert sector_to_disc(math.nextafter(5, 6), 0, 5, *cone, RANGE) == pytest.approx(0.0, abs=1e-14)


def test_a_disc_exactly_at_the_end_of_the_range_is_seen_and_one_ulp_farther_is_not():
    cone = half_angle(0.5)
    assert sector_to_disc(55, 0, 5, *cone, RANGE) == 50
    assert math.isinf(sector_to_disc(math.nextafter(55, 56), 0, 5, *cone, RANGE))


def test_an_edge_that_touches_a_disc_sees_it_and_one_that_misses_it_by_little_does_not():
    cone = half_angle(math.pi)
    assert sector_to_disc(-5, 20, 5, *cone, RANGE) == 20
    assert math.isinf(sector_to_disc(math.nextafter(-5, -6), 20, 5, *cone, RANGE))


def test_a_segment_that_is_a_point_is_seen_like_one():
    assert sector_to_segment(8, 1, 8, 1, *half_angle(1.0), RANGE) == pytest.approx(math.hypot(8, 1))
    assert math.isinf(sector_to_segment(8, 9, 8, 9, *half_angle(1.0), RANGE))


def test_a_segment_that_crosses_a_wide_sector_behind_the_apex_is_met_by_an_edge():
    cone = half_angle(1.5 * math.pi)
    expected = shapely.distance(wedge(1.5 * math.pi).intersection(LineString([(-10, -30), (-10, 30)])), Point(0, 0))
    assert sector_to_segment(-10, -30, -10, 30, *cone, RANGE) == pytest.approx(expected)
