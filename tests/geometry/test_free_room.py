import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.geometry.free_room import (
    Crowded,
    areas_by_cell,
    circumscribed_ratio,
    find_part_around,
    room_for_disc,
    room_to_try,
)
from support.pace import work_within

TWO = shapely.union_all([shapely.box(0, 0, 1, 1), shapely.box(5, 0, 7, 1)])


@pytest.mark.parametrize("quarter_segments", [4, 16, 64])
def test_a_grown_disc_is_drawn_around_the_circle_and_touches_it(quarter_segments):
    room = room_for_disc((0, 0, 100, 100), [(Point(50, 50), 15.0)], 5.0, quarter_segments)
    hole = room.interiors[0]
    assert hole.distance(Point(50, 50)) == pytest.approx(20.0, rel=1e-12)
    corners = shapely.get_coordinates(hole) - 50
    assert max(math.hypot(*corner) for corner in corners) == pytest.approx(20.0 * circumscribed_ratio(quarter_segments))


@pytest.mark.parametrize("sides", [(100, 300), (300, 100), (100, 100)])
@pytest.mark.parametrize("radius", [50.0, 60.0])
def test_there_is_no_room_for_a_disc_as_wide_as_the_world(radius, sides):
    room = room_for_disc((7, 3, 7 + sides[0], 3 + sides[1]), [], radius, 16)
    assert room.is_empty
    assert find_part_around(room, (50, 50), 1e9) is None


def test_there_is_no_room_where_all_is_solid():
    assert find_part_around(room_for_disc((0, 0, 9, 9), [(shapely.box(0, 0, 9, 9), 0.0)], 1.0, 16), (4, 4), 1e9) is None


def test_the_nearest_part_within_the_slack_is_taken():
    assert find_part_around(TWO, (4.0, 0.5), 1.0).area == 2.0
    assert find_part_around(TWO, (1.5, 0.5), 4.0).area == 1.0
    assert find_part_around(TWO, (4.0, 0.5), 0.99) is None


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


@pytest.mark.slow
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


def test_without_solids_the_centre_may_be_a_radius_and_more_from_the_border():
    for make in (room_for_disc, room_to_try):
        assert make((10, 20, 110, 60), [], 5.0, 16).bounds == (15, 25, 105, 55)


def apart(count, pitch=20.0):
    """Return unit discs that are far from each other, and the bounds of the square that holds them."""
    side = math.ceil(math.sqrt(count))
    return [(Point(pitch * (k % side), pitch * (k // side)), 1.0) for k in range(count)], (0, 0, *[pitch * side] * 2)


@pytest.mark.parametrize(("count", "is_crowd"), [(2000, False), (2001, True)])
def test_more_than_two_thousand_solids_are_a_crowd(count, is_crowd):
    solids, bounds = apart(count)
    assert isinstance(room_to_try(bounds, solids, 1.0, 4), Crowded) is is_crowd


def piled(*counts):
    """Return piles of small discs, far apart, in each of which all would overlap once grown by 5, and now none."""
    return [(Point(100 * pile + 0.01 * k, 10), 0.004) for pile, count in enumerate(counts) for k in range(count)]


@pytest.mark.parametrize(
    ("counts", "is_crowd"),
    [((316,), False), ((317,), True), ((224, 224, *[1] * 60), False), ((225, 225, *[1] * 60), True)],
)
def test_more_than_fifty_thousand_pairs_that_overlap_once_grown_are_a_crowd(counts, is_crowd):
    # n discs in a pile are n (n - 1) / 2 pairs: 49,770 of 316 and 50,086 of 317; 49,952 and 50,400 of two piles.
    room = room_to_try((0, 0, 7000, 20), piled(*counts), 5.0, 4)
    assert isinstance(room, Crowded) is is_crowd


@pytest.mark.slow
def test_in_a_crowd_a_place_is_free_if_it_is_far_enough_from_every_solid():
    rng = np.random.default_rng(3)
    centres, radii = rng.uniform(0, 300, (2400, 2)), rng.uniform(0.1, 2.5, 2400)
    room = room_to_try((0, 0, 300, 200), list(zip(map(Point, centres), radii, strict=True)), 2.0, 16)
    points = rng.uniform(-10, 310, (4000, 2))
    x, y = points.T
    gap = np.min(np.hypot(*(points[:, None] - centres).transpose(2, 0, 1)) - radii, axis=1)
    gap = np.min([gap, x, 300 - x, y, 200 - y], axis=0)
    free = room.holds(points)
    assert free[gap > 2.0 * circumscribed_ratio(16) + 0.01].all()
    assert not free[gap < 2.0].any()
    assert free.any()


def test_the_areas_of_cells_are_those_of_the_parts_in_them_wherever_the_bounds_are():
    space = shapely.Point(3, -4).buffer(3.0)
    areas = areas_by_cell(space, (-1, -8, 7, 1), 3, 4)
    for row in range(3):
        for column in range(4):
            cell = shapely.box(-1 + 2 * column, -8 + 3 * row, 1 + 2 * column, -5 + 3 * row)
            assert areas[row, column] == pytest.approx(space.intersection(cell).area, abs=1e-12)


def test_the_first_solid_that_is_no_valid_geometry_is_named():
    bow_tie = shapely.Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])
    with pytest.raises(InvalidValueError, match=r"solids holds <POLYGON \(\(0 0, 10 10"):
        room_for_disc((0, 0, 9, 9), [(Point(1, 1), 1.0), (bow_tie, 0.0), ("text", 0.0)], 1.0, 16)


def test_a_long_jagged_outline_is_grown_whole_and_so_exactly():
    x = np.arange(0, 1500.0, 1.5)
    coast = shapely.Polygon([(-1, -9), *np.column_stack([x, 20 + 3 * (np.arange(len(x)) % 2)]), (1500, -9)])
    room = room_for_disc((0, -50, 1500, 100), [(coast, 0.0)], 5.0, 16)
    inner = shapely.box(5, -45, 1495, 95)
    assert room.equals(inner.difference(coast.buffer(5.0 * circumscribed_ratio(16), quad_segs=16)))


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 1.0, 1e6]), st.booleans())
@settings(max_examples=12, deadline=None)
def test_among_very_many_discs_a_place_is_free_exactly_where_it_is_on_none_of_their_polygons(seed, scale, mixed):
    rng = np.random.default_rng(seed)
    centres, radii = (
        scale * rng.uniform(500, 1500, (2100, 2)),
        scale * rng.choice([1.0, 2.5, 40.0], 2100, p=(0.6, 0.39, 0.01)),
    )
    solids = list(zip(map(Point, centres), radii, strict=True))
    solids += [(shapely.box(*centre, *(centre + 9 * scale)), 0.0) for centre in centres[:30] * mixed]
    reach = 2.0 * scale
    room = room_to_try((400 * scale, 400 * scale, 1600 * scale, 1600 * scale), solids, reach, 16)
    assert isinstance(room, Crowded)
    # On the rims of discs, and between circle and polygon: there all depends on rounding.
    of, azimuth, factor = (
        rng.integers(0, 2100, 4000),
        rng.integers(0, 256, 4000) * math.tau / 256,
        rng.integers(-2, 3, 4000),
    )
    far = (radii[of] + reach) * rng.choice([1.0, 1.0006, circumscribed_ratio(16)], 4000) * (1 + factor * 2e-16)
    rims = centres[of] + far[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    points = np.concatenate([scale * rng.uniform(400, 1600, (2000, 2)), rims])
    grown = [shape.buffer((own + reach) * circumscribed_ratio(16), quad_segs=16) for shape, own in solids]
    met = shapely.STRtree(grown).query(shapely.points(points), predicate="intersects")[0]
    free = shapely.contains_xy(room.inner, points)
    free[met] = False
    assert room.holds(points).tolist() == free.tolist()
    assert 0.1 < free.mean() < 0.9
