"""The measures of which the Shapely twin is made, by closed forms."""

import math

import numpy as np
import pytest
import shapely
from shapely import LineString, Point

from mesa_swarm.physics.shapely_engine import (
    View,
    distance_to_disc,
    distance_to_polygon,
    is_on_map,
    make_wedge,
    overlapping_pairs,
    places_on_rings,
    ring_around_map,
    way_out,
)
from support.shapely_loads import _touching_corners

AHEAD = LineString([(0, 0), (50, 0)])
VIEW = View(Point(0, 0), AHEAD, (AHEAD,), 50.0)


def test_pairs_of_robots_that_overlap_are_found_once():
    assert overlapping_pairs(np.array([[0.0, 0], [20, 0], [9, 0]]), np.full(3, 5.0)).tolist() == [[0, 2]]


def test_the_way_out_of_a_polygon_crosses_its_nearest_edge():
    assert way_out(shapely.box(0, 0, 4, 4), Point(4, 1)).tolist() == pytest.approx([1.0, 0.0])


def test_a_place_is_on_the_map_where_both_coordinates_are():
    assert is_on_map(np.array([[3.0, 4.0], [3.0, 11.0]]), (0, 0, 10, 10)).tolist() == [True, False]


def test_room_is_first_looked_for_an_eighth_of_a_radius_away():
    first = next(places_on_rings(np.zeros(2), 8.0, (0, 0, 10, 10)))
    assert first[0].tolist() == [1.0, 0.0]
    assert np.hypot(*first.T) == pytest.approx(np.ones(len(first)))


def test_the_outside_of_a_map_reaches_as_far_as_its_margin_all_round():
    assert ring_around_map((0, 0, 10, 10), 5).area == 20**2 - 10**2


def test_a_ray_measures_the_way_to_a_polygon_and_to_a_disc_beside_it():
    assert distance_to_polygon(VIEW, shapely.box(10, -5, 20, 5)) == 10.0
    assert math.isnan(distance_to_polygon(VIEW, shapely.box(10, 5, 20, 15)))
    assert distance_to_disc(VIEW, Point(20, 3), 5.0) == 16.0
    assert distance_to_disc(VIEW, Point(20, 6), 5.0) == math.inf


@pytest.mark.parametrize("half", [0.1, math.pi / 4, 1.5, 3.0])
def test_a_wedge_covers_its_whole_sector(half):
    area = make_wedge((0, 0), 0.3, half, 10.0)
    azimuths = 0.3 + 0.999 * half * np.linspace(-1, 1, 50)
    assert shapely.contains_xy(area, 9.999 * np.cos(azimuths), 9.999 * np.sin(azimuths)).all()
    assert area.area > half * 10**2


@pytest.mark.parametrize(("half", "triangles"), [(0.1, 1), (0.5, 1), (0.6, 2), (1.5, 3), (2.5, 5), (math.pi, 6)])
def test_a_wedge_is_cut_into_as_few_triangles_as_steps_of_60_degrees_make(half, triangles):
    assert make_wedge((3, 4), 0.3, half, 10.0).area == pytest.approx(triangles * 10**2 * math.tan(half / triangles))


def test_a_wedge_without_width_is_a_line_as_long_as_the_reach():
    line = make_wedge((3, 4), math.pi / 2, 0.0, 10.0)
    assert line.length == pytest.approx(10.0)
    assert line.coords[1] == pytest.approx((3, 14))


def test_corners_of_either_body_that_touch_the_other_are_found_once():
    found = _touching_corners(shapely.box(0, 0, 4, 4), shapely.box(4, 1, 9, 9), 0.01)
    assert sorted(found) == [(4.0, 1.0), (4.0, 4.0)]
