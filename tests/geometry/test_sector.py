"""Sectors: exact distances, against closed forms, against Shapely and against thousands of rays."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import LineString, Point

from mesa_swarm.geometry.sector import (
    half_angle,
    is_in_cone,
    ray_azimuth,
    ray_to_disc,
    ray_to_segment,
    rays_to_disc,
    rays_to_segment,
    sector_to_disc,
    sector_to_segment,
)
from mesa_swarm.physics.shapely_engine import View, distance_to_disc, distance_to_polygon, make_wedge

RANGE = 50.0
WIDTHS = [0.0, 0.01, math.pi / 6, math.pi / 2, 3.0, math.pi, 3.3, 5.0, 6.2, 2 * math.pi]
widths = st.sampled_from(WIDTHS) | st.floats(0.001, 6.28)
coordinates = st.floats(-60, 60)
radii = st.floats(0.01, 40)


def view(width, limit=RANGE):
    """Return the same sector as Shapely sees it: apex at the origin, axis along +x."""
    half = width / 2
    edges = [] if width >= 2 * math.pi else [half, -half]
    rays = tuple(LineString([(0, 0), (200 * math.cos(a), 200 * math.sin(a))]) for a in edges)
    return View(Point(0, 0), make_wedge((0.0, 0.0), 0.0, half, 200.0), rays, limit)


def within(distance, limit=RANGE):
    """Return what a sensor of this range makes of a distance: `inf` beyond it, and for NaN."""
    return distance if distance <= limit else math.inf


def disc(x, y, radius, width, limit=RANGE):
    """Return the compiled distance to a disc."""
    return sector_to_disc(float(x), float(y), float(radius), *half_angle(width), float(limit))


def segment(a, b, width, limit=RANGE):
    """Return the compiled distance to a segment."""
    return sector_to_segment(*map(float, (*a, *b)), *half_angle(width), float(limit))


def fan(width, count=20001):
    """Return unit vectors of evenly spread rays, the edges included."""
    azimuth = np.linspace(-width / 2, width / 2, count)
    return np.cos(azimuth), np.sin(azimuth)


# ---- closed forms


def test_a_disc_ahead_is_as_far_as_its_rim():
    assert disc(20, 0, 5, 0.5) == 15.0


def test_a_disc_beside_a_narrow_sector_is_met_where_its_edge_meets_the_rim():
    assert disc(20, 3, 5, 0.0) == 16.0


@pytest.mark.parametrize("width", WIDTHS)
def test_a_disc_that_holds_the_apex_is_at_distance_zero_even_when_its_centre_is_behind(width):
    assert disc(-3, 1, 5, width) == 0.0
    assert disc(-3, 1, 5, width, limit=0.0) == 0.0


@pytest.mark.parametrize("width", WIDTHS)
def test_a_disc_whose_rim_holds_the_apex_is_at_distance_zero(width):
    assert disc(-3, 4, 5, width) == 0.0
    assert disc(5, 0, 5, width) == 0.0


def test_a_disc_is_seen_up_to_exactly_the_range():
    assert disc(55, 0, 5, 0.5) == 50.0
    assert disc(math.nextafter(55, 99), 0, 5, 0.5) == math.inf


def test_a_ray_that_is_tangent_to_a_disc_sees_it_and_one_ulp_farther_away_does_not():
    assert disc(20, 5, 5, 0.0) == 20.0
    assert disc(20, math.nextafter(5, 9), 5, 0.0) == math.inf
    assert disc(20, math.nextafter(5, 0), 5, 0.0) < 20.0


def test_a_half_plane_sees_straight_to_its_sides_and_not_one_ulp_behind():
    assert disc(0, 20, 5, math.pi) == 15.0
    assert segment((0, 7), (0, 9), math.pi) == 7.0
    behind = math.nextafter(0, -1)
    assert segment((behind, 7), (behind, 9), math.pi) == math.inf


def test_a_full_turn_sees_straight_behind():
    assert disc(-20, 0, 5, 2 * math.pi) == 15.0
    assert segment((-10, -5), (-10, 5), 2 * math.pi) == 10.0


@pytest.mark.parametrize("width", [3.3, 5.0, 6.2])
def test_a_wide_sector_sees_on_both_sides_of_its_blind_wedge_across_half_a_turn(width):
    half = width / 2
    behind = segment((-3, -60), (-3, 60), width)
    assert behind == pytest.approx(3 / abs(math.cos(half)))
    assert behind == segment((-3, 60), (-3, -60), width)


def test_a_segment_across_the_axis_is_at_its_foot():
    assert segment((10, -30), (10, 30), 0.5) == 10.0


def test_a_segment_that_ends_in_the_sector_is_at_its_end():
    assert segment((10, 1), (40, 30), 0.5) == pytest.approx(math.hypot(10, 1))


def test_a_segment_whose_foot_is_beside_the_sector_is_met_by_its_edge():
    # x + y = 20 has its foot at 45 degrees; an edge at 30 degrees meets it at 20 / (cos + sin).
    edge = math.radians(30)
    expected = 20 / (math.cos(edge) + math.sin(edge))
    assert segment((0, 20), (20, 0), 2 * edge) == pytest.approx(expected)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_segment_through_the_apex_is_at_distance_zero(width):
    assert segment((-3, -4), (3, 4), width) == 0.0
    assert segment((0, 0), (-3, 4), width) == 0.0
    assert segment((-3, 4), (0, 0), width, limit=0.0) == 0.0


@pytest.mark.parametrize("width", WIDTHS)
def test_a_segment_of_no_length_is_a_point(width):
    seen = segment((10, 2), (10, 2), width)
    assert seen == (math.hypot(10, 2) if width >= 2 * math.atan2(2, 10) else math.inf)
    assert segment((0, 0), (0, 0), width) == 0.0


def test_a_ray_along_a_segment_sees_its_nearer_end():
    assert segment((10, 0), (20, 0), 0.0) == 10.0
    assert segment((20, 0), (10, 0), 0.0) == 10.0
    assert segment((-10, 0), (-20, 0), 0.0) == math.inf


def test_a_segment_behind_the_apex_in_line_with_an_edge_of_the_sector_is_not_seen():
    assert segment((-4, -4), (-1, -1), math.pi / 2) == math.inf
    assert rays_to_segment(-4.0, -4.0, -1.0, -1.0, math.pi / 4, 2, RANGE) == math.inf


def test_a_range_of_zero_sees_only_what_touches_the_apex():
    assert disc(5, 0, 5, 1.0, limit=0.0) == 0.0
    assert disc(math.nextafter(5, 9), 0, 5, 1.0, limit=0.0) == math.inf
    assert segment((1, -1), (1, 1), 1.0, limit=0.0) == math.inf


def test_the_edges_of_a_cone_belong_to_it():
    assert is_in_cone(0.0, -1.0, *half_angle(math.pi))
    assert is_in_cone(-1.0, 0.0, *half_angle(2 * math.pi))
    assert not is_in_cone(-1.0, 0.0, *half_angle(0.0))
    assert is_in_cone(0.0, 0.0, *half_angle(0.0))


def test_a_ray_does_not_see_what_is_behind_it():
    assert ray_to_disc(-20.0, 0.0, 5.0, 1.0, 0.0) == math.inf
    assert ray_to_segment(-5.0, -1.0, -5.0, 1.0, 1.0, 0.0) == math.inf


# ---- rays in the place of sectors


def test_rays_are_spread_evenly_from_edge_to_edge():
    assert [ray_azimuth(k, 5, 1.0) for k in range(5)] == [-1.0, -0.5, 0.0, 0.5, 1.0]
    assert ray_azimuth(0, 1, 1.0) == 0.0


@given(coordinates, coordinates, radii, widths, st.integers(1, 40))
def test_rays_never_see_a_disc_nearer_than_the_sector_does(x, y, radius, width, rays):
    assert rays_to_disc(x, y, radius, width / 2, rays, RANGE) >= disc(x, y, radius, width) - 1e-9


@given(coordinates, coordinates, radii, st.integers(1, 20))
def test_rays_look_along_ray_azimuth(x, y, radius, rays):
    azimuths = [ray_azimuth(k, rays, 0.7) for k in range(rays)]
    hits = [ray_to_disc(x, y, radius, math.cos(a), math.sin(a)) for a in azimuths]
    assert rays_to_disc(x, y, radius, 0.7, rays, RANGE) == within(min(hits))


@given(coordinates, coordinates, coordinates, coordinates, st.integers(1, 20))
def test_rays_meet_a_segment_where_shapelys_do(ax, ay, bx, by, rays):
    azimuths = [ray_azimuth(k, rays, 0.7) for k in range(rays)]
    lines = [LineString([(0, 0), (200 * math.cos(a), 200 * math.sin(a))]) for a in azimuths]
    line = LineString([(ax, ay), (bx, by)])
    ends = [Point(ax, ay), Point(bx, by), Point(0, 0)]
    # Where an end is on a ray, or the apex on the segment, whether they meet is a matter of rounding.
    assume(all(ray.distance(end) > 1e-6 for ray in lines for end in ends[:2]))
    assume(line.distance(ends[2]) > 1e-6)
    hits = [Point(0, 0).distance(ray.intersection(line)) for ray in lines if ray.intersects(line)]
    expected = within(min(hits, default=math.inf))
    assert rays_to_segment(ax, ay, bx, by, 0.7, rays, RANGE) == pytest.approx(expected, abs=1e-6)


# ---- twins


@pytest.mark.slow
@settings(max_examples=400)
@given(coordinates, coordinates, radii, widths)
def test_a_disc_is_as_far_as_shapelys(x, y, radius, width):
    eye, centre = view(width), Point(x, y)
    # Where an edge of the sector only just grazes the rim, whether it is seen is a matter of rounding.
    assume(all(abs(ray.distance(centre) - radius) > 1e-6 for ray in eye.rays))
    expected = distance_to_disc(eye, centre, radius)
    assume(not abs(expected - RANGE) < 1e-9)
    assert disc(x, y, radius, width) == pytest.approx(within(expected), abs=1e-8)


@pytest.mark.slow
@settings(max_examples=400)
@given(coordinates, coordinates, coordinates, coordinates, widths)
def test_a_segment_is_as_far_as_shapelys(ax, ay, bx, by, width):
    eye, line = view(width), LineString([(ax, ay), (bx, by)])
    # An end on an edge of the sector, or the apex on the segment: in or out is a matter of rounding.
    assume(all(ray.distance(Point(end)) > 1e-6 for ray in eye.rays for end in line.coords))
    assume(line.length > 1e-6 and line.distance(eye.apex) > 1e-6)
    expected = distance_to_polygon(eye, line)
    assume(not abs(expected - RANGE) < 1e-9)
    assert segment((ax, ay), (bx, by), width) == pytest.approx(within(expected), abs=1e-7)


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1), widths)
def test_thousands_of_rays_see_a_disc_no_nearer_and_hardly_farther_than_the_sector(seed, width):
    rng = np.random.default_rng(seed)
    (x, y), radius = rng.uniform(-50, 50, 2), rng.uniform(0.5, 30)
    ray_x, ray_y = fan(width)
    along, across = x * ray_x + y * ray_y, x * ray_y - y * ray_x
    met = (along > 0) & (np.abs(across) <= radius)
    hits = along[met] - np.sqrt(radius**2 - across[met] ** 2)
    nearest = 0.0 if math.hypot(x, y) <= radius else within(hits.min(initial=math.inf))
    exact = disc(x, y, radius, width)
    assert exact <= nearest + 1e-9
    assert nearest <= exact + 0.01 or abs(exact - RANGE) < 0.01


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1), widths)
def test_thousands_of_points_of_a_segment_are_no_nearer_and_hardly_farther_than_the_sector(seed, width):
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-50, 50, (2, 2))
    points = a + np.linspace(0, 1, 100_001)[:, None] * (b - a)
    inside = np.abs(np.arctan2(points[:, 1], points[:, 0])) <= width / 2 + 1e-12
    nearest = within(np.hypot(*points[inside].T).min(initial=math.inf))
    exact = segment(a, b, width)
    assert exact <= nearest + 1e-9
    if width > 0.0:
        assert nearest <= exact + 0.01 or abs(exact - RANGE) < 0.01


@given(coordinates, coordinates, radii, widths, widths)
def test_a_wider_sector_never_sees_less(x, y, radius, one, other):
    narrow, wide = sorted((one, other))
    assert disc(x, y, radius, wide) <= disc(x, y, radius, narrow) + 1e-9
    assert segment((x, y), (y, radius), wide) <= segment((x, y), (y, radius), narrow) + 1e-9


@given(coordinates, coordinates, coordinates, coordinates, radii, widths)
def test_a_mirrored_body_is_equally_far(ax, ay, bx, by, radius, width):
    assert disc(ax, -ay, radius, width) == disc(ax, ay, radius, width)
    mirrored = segment((ax, -ay), (bx, -by), width)
    assert mirrored == segment((ax, ay), (bx, by), width)
