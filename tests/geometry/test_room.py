import math

import numpy as np
import pytest
import shapely
from shapely.geometry import Point

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.geometry.room import Crowded, outside, part_around, room_for_disc, room_to_try
from support.pace import work_within

TWO = shapely.union_all([shapely.box(0, 0, 1, 1), shapely.box(5, 0, 7, 1)])


@pytest.mark.parametrize("quarter_segments", [4, 16, 64])
def test_a_grown_disc_is_drawn_around_the_circle_and_touches_it(quarter_segments):
    room = room_for_disc((0, 0, 100, 100), [(Point(50, 50), 15.0)], 5.0, quarter_segments)
    hole = room.interiors[0]
    assert hole.distance(Point(50, 50)) == pytest.approx(20.0, rel=1e-12)
    corners = shapely.get_coordinates(hole) - 50
    assert max(math.hypot(*corner) for corner in corners) == pytest.approx(20.0 * outside(quarter_segments))


@pytest.mark.parametrize("radius", [50.0, 60.0])
def test_there_is_no_room_for_a_disc_as_wide_as_the_world(radius):
    room = room_for_disc((0, 0, 100, 300), [], radius, 16)
    assert room.is_empty
    assert part_around(room, (50, 50), 1e9) is None


def test_there_is_no_room_where_all_is_solid():
    assert part_around(room_for_disc((0, 0, 9, 9), [(shapely.box(0, 0, 9, 9), 0.0)], 1.0, 16), (4, 4), 1e9) is None


def test_the_nearest_part_within_the_slack_is_taken():
    assert part_around(TWO, (4.0, 0.5), 1.0).area == 2.0
    assert part_around(TWO, (1.5, 0.5), 4.0).area == 1.0
    assert part_around(TWO, (4.0, 0.5), 0.99) is None


def test_what_is_no_geometry_is_refused():
    with pytest.raises(InvalidValueError, match="solids holds None; expected valid Shapely geometries"):
        room_for_disc((0, 0, 9, 9), [(None, 1.0)], 1.0, 16)


@pytest.mark.parametrize("crowd", [1, 400, 3000])
def test_each_of_many_solids_that_is_not_a_geometry_is_refused(crowd):
    with pytest.raises(InvalidValueError, match="solids holds None; expected valid Shapely geometries"):
        room_to_try((0, 0, 9, 9), [(None, 1.0)] * crowd, 1.0, 16)


def spiked(spikes, inner, outer):
    """Return a star about (50, 50)."""
    azimuth = np.arange(2 * spikes) * math.pi / spikes
    far = np.where(np.arange(2 * spikes) % 2, inner, outer)
    return shapely.Polygon(50 + np.column_stack([np.cos(azimuth), np.sin(azimuth)]) * far[:, None])


def test_a_star_of_thousands_of_spikes_is_grown_within_seconds_and_nothing_is_called_free_that_is_not():
    star = spiked(2500, 10, 30)
    with work_within(5):
        room = room_for_disc((0, 0, 100, 100), [(star, 0.0)], 5.0, 16)
        tried = room_to_try((0, 0, 100, 100), [(star, 0.0)], 5.0, 16)
    assert isinstance(tried, Crowded)
    points = np.random.default_rng(1).uniform(5, 95, (2000, 2))
    distance = shapely.distance(star, shapely.points(points))
    for free in (shapely.contains_xy(room, points), tried.holds(points)):
        assert (distance[free] >= 5.0).all()
        assert free[distance > 5.0 * 1.03].all()


def test_a_round_outline_of_very_many_corners_is_grown_whole():
    azimuth = np.linspace(0, math.tau, 50_000, endpoint=False)
    ring = shapely.Polygon(50 + 20 * np.column_stack([np.cos(azimuth), np.sin(azimuth)]))
    room = room_to_try((0, 0, 100, 100), [(ring, 0.0)], 5.0, 16)
    assert room.area == pytest.approx(90**2 - math.pi * 25**2, rel=1e-3)
