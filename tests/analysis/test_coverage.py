"""What can be reached: closed forms, gaps, symmetries, a flood fill over a fine raster, and the thesis's maps."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label
from shapely.geometry import Point

from mesa_swarm import Map
from mesa_swarm.analysis import coverage, reachable_cells, visited_cells
from mesa_swarm.analysis.coverage import cells_from_places
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.geometry.free_room import areas_by_cell, room_for_disc

BOX = (0.0, 0.0, 100.0, 80.0)
seeds = st.integers(0, 2**32)


def random_solids(rng):
    """Return some discs and slanting rectangles."""
    discs = [(Point(rng.uniform((0, 0), (100, 80))), rng.uniform(2, 15)) for _ in range(rng.integers(0, 5))]
    walls = [
        (shapely.LineString(rng.uniform((0, 0), (100, 80), (2, 2))).buffer(1.0, cap_style="flat"), 0.0)
        for _ in range(rng.integers(0, 4))
    ]
    return discs + walls


def clearance(points, bounds, solids):
    """Return how large a disc may be at each point, by distances alone."""
    x, y = points.T
    free = np.min([x - bounds[0], bounds[2] - x, y - bounds[1], bounds[3] - y], axis=0)
    places = shapely.points(points)
    for geometry, radius in solids:
        free = np.minimum(free, shapely.distance(places, geometry) - radius)
    return free


def flooded(free, radius, start):
    """Return the part of a fine raster of clearances that a flood from the start fills: no buffers, no polygons."""
    parts, _ = label(free >= radius)
    at = parts[int(start[1] / 80 * len(free)), int(start[0] / 100 * len(free))]
    return (parts == at) & (at > 0)


@pytest.mark.slow
@settings(max_examples=40)
@given(seeds, st.floats(2, 6))
def test_cells_that_a_flood_fills_and_no_others_are_reachable(seed, radius):
    rng = np.random.default_rng(seed)
    solids, start = random_solids(rng), rng.uniform((10, 10), (90, 70))
    x, y = (np.arange(80) + 0.5) * 100 / 80, (np.arange(80) + 0.5)
    raster = np.column_stack([a.ravel() for a in np.meshgrid(x, y)])
    free = clearance(raster, BOX, solids).reshape(80, 80)
    # Places of the raster are up to 1.25 apart: it may close a gap that is open, or open one that is a hair too
    # narrow. The answer lies between the floods of a larger and of a smaller robot.
    larger, smaller = flooded(free, radius + 0.9, start), flooded(free, radius - 0.9, start)
    if not larger.any():
        return
    cells = reachable_cells(BOX, solids, radius, start, (16, 20), fewest_share=0.2)
    most, least = (part.reshape(16, 5, 20, 4).mean(axis=(1, 3)) for part in (smaller, larger))
    assert cells[least > 0.5].all()
    assert not cells[most < 0.1].any()


def test_in_an_empty_world_the_cells_that_the_shrunk_bounds_cover_are_reachable():
    cells = reachable_cells((0, 0, 100, 100), [], 10.0, (50, 50), (10, 10))
    expected = np.zeros((10, 10), bool)
    expected[1:9, 1:9] = True
    np.testing.assert_array_equal(cells, expected)


@pytest.mark.parametrize(("fewest", "expected"), [(0.0, True), (0.24, True), (0.26, False), (0.9, False)])
def test_a_cell_counts_from_the_share_on_that_was_asked_for(fewest, expected):
    # The corner cell of 10 x 10 is free but for a border of 5: a quarter of it.
    assert reachable_cells((0, 0, 100, 100), [], 5.0, (50, 50), (10, 10), fewest_share=fewest)[0, 0] == expected


@pytest.mark.parametrize(("gap", "through"), [(9.99, False), (10.0, False), (10.01, True), (14.0, True)])
def test_a_robot_gets_through_a_gap_between_walls_only_if_it_is_wider_than_the_robot(gap, through):
    walls = [
        (shapely.box(45, 0, 55, 50 - gap / 2), 0.0),
        (shapely.box(45, 50 + gap / 2, 55, 100), 0.0),
    ]
    assert reachable_cells((0, 0, 100, 100), walls, 5.0, (20, 50), (4, 4))[:, 3].any() == through


@pytest.mark.parametrize(("more", "through"), [(-1e-3, False), (0.0, False), (2 * 7.6e-5 * 25 * 2, True)])
def test_the_error_at_a_gap_between_discs_is_as_small_as_documented(more, through):
    # Two discs of radius 20, their centres two robots' radii and `more` farther apart than touching.
    apart = 40 + 10 + more
    discs = [(Point(50, 50 - apart / 2), 20.0), (Point(50, 50 + apart / 2), 20.0)]
    closed = [(shapely.box(49, -50, 51, 50 - apart / 2), 0.0), (shapely.box(49, 50 + apart / 2, 51, 150), 0.0)]
    cells = reachable_cells((0, -20, 100, 120), discs + closed, 5.0, (15, 50), (4, 4))
    assert cells[:, 3].any() == through


def test_the_room_around_a_disc_is_the_circles_to_a_ten_thousandth_and_never_more():
    room = room_for_disc((0, 0, 100, 100), [(Point(50, 50), 15.0)], 5.0, 64)
    missing = 90**2 - math.pi * 20**2 - room.area
    assert 0 <= missing < 2 * 7.6e-5 * math.pi * 20**2


def test_a_room_that_is_closed_off_is_reached_only_by_who_is_inside():
    ring = Point(50, 50).buffer(30).difference(Point(50, 50).buffer(25))
    inside = reachable_cells((0, 0, 100, 100), [(ring, 0.0)], 4.0, (50, 50))
    outside = reachable_cells((0, 0, 100, 100), [(ring, 0.0)], 4.0, (10, 10))
    assert inside.any()
    assert outside.any()
    assert not (inside & outside).any()
    assert inside[20, 20]


@pytest.mark.parametrize("start", [(5.0, 50.0), (30.0 - 1e-7, 50.0), (50.0, 5.0)])
def test_a_robot_may_start_where_it_touches(start):
    solids = [(Point(50, 50), 15.0)]
    assert reachable_cells((0, 0, 100, 100), solids, 5.0, start).any()


def test_a_robot_may_not_start_where_it_overlaps():
    with pytest.raises(InvalidValueError, match=r"start is \(30\.1, 50\), where a robot of radius 5 does not fit"):
        reachable_cells((0, 0, 100, 100), [(Point(50, 50), 15.0)], 5.0, (30.1, 50.0))


def test_a_solid_that_crosses_itself_is_refused():
    bow_tie = shapely.Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])
    with pytest.raises(InvalidValueError, match="expected valid Shapely geometries"):
        reachable_cells((0, 0, 100, 100), [(bow_tie, 0.0)], 5.0, (50, 50))


@pytest.mark.slow
@settings(max_examples=20)
@given(seeds, st.floats(-1e3, 1e3), st.floats(0.1, 20))
def test_cells_stay_when_the_world_is_moved_and_scaled(seed, shift, scale):
    rng = np.random.default_rng(seed)
    solids, start = random_solids(rng), rng.uniform((10, 10), (90, 70))
    if clearance(start[None], BOX, solids)[0] < 3.0 + 1e-3:
        return

    def moved(geometry):
        return shapely.transform(geometry, lambda points: scale * (points + shift))

    there = reachable_cells(
        tuple(scale * (np.array(BOX) + shift)),
        [(moved(geometry), scale * radius) for geometry, radius in solids],
        3.0 * scale,
        scale * (start + shift),
    )
    here = reachable_cells(BOX, solids, 3.0, start)
    # A cell of which almost exactly the least share is free may fall to either side.
    assert (here != there).sum() <= 2


@given(seeds)
def test_the_cells_areas_add_up_to_the_rooms(seed):
    rng = np.random.default_rng(seed)
    room = room_for_disc(BOX, random_solids(rng), 2.0, 16)
    areas = areas_by_cell(room, BOX, 7, 9)
    assert areas.sum() == pytest.approx(room.area)
    row, column = rng.integers(7), rng.integers(9)
    x, y = np.linspace(0, 100, 10), np.linspace(0, 80, 8)
    cell = shapely.box(x[column], y[row], x[column + 1], y[row + 1])
    assert areas[row, column] == pytest.approx(room.intersection(cell).area, abs=1e-9)


@given(seeds, st.integers(0, 50), st.integers(1, 9), st.integers(1, 9))
def test_visited_cells_are_those_that_a_histogram_counts(seed, k, rows, columns):
    points = np.random.default_rng(seed).random((k, 2)) * (100, 80)
    y, x = np.linspace(0, 80, rows + 1), np.linspace(0, 100, columns + 1)
    counts = np.histogram2d(points[:, 1], points[:, 0], bins=(y, x))[0]
    np.testing.assert_array_equal(visited_cells(points, BOX, (rows, columns)), counts > 0)


def test_positions_of_many_robots_count_together():
    positions = np.random.default_rng(1).random((20, 3, 2)) * (100, 80)
    together = visited_cells(positions, BOX, (6, 6))
    alone = [visited_cells(positions[:, i], BOX, (6, 6)) for i in range(3)]
    np.testing.assert_array_equal(together, np.any(alone, axis=0))


def test_the_last_row_and_column_hold_the_border():
    assert visited_cells([[100, 80]], BOX, (4, 5))[3, 4]
    assert visited_cells([[100 + 1e-6, -1e-6]], BOX, (4, 5))[0, 4]


def test_coverage_is_one_where_every_reachable_cell_was_visited_and_zero_where_none_was():
    cells = np.array([[True, False], [True, False]])
    assert coverage([[10, 10], [10, 70]], cells, BOX) == 1.0
    assert coverage([[90, 10]], cells, BOX) == 0.0
    assert coverage(np.empty((0, 2)), cells, BOX) == 0.0


@given(seeds, st.integers(1, 30))
def test_coverage_only_grows_and_does_not_depend_on_order(seed, k):
    rng = np.random.default_rng(seed)
    points, cells = rng.random((k, 2)) * (100, 80), rng.random((5, 5)) < 0.7
    cells[0, 0] = True
    shares = [coverage(points[:t], cells, BOX) for t in range(1, k + 1)]
    assert (np.diff(shares) >= 0).all()
    assert coverage(rng.permutation(points), cells, BOX) == shares[-1]


def test_of_the_map_original_the_cells_that_a_robot_fits_into_are_reachable():
    world = Map.load("original")
    solids = [(shape.geometry, shape.radius) for shape in world.obstacles]
    cells = reachable_cells(world.bounds, solids, 5.0, (45.0, 45.0))
    # 20 x 15 units a cell: the outer walls of 20 fill the first and last columns, and the first and last rows.
    assert not np.concatenate([cells[0], cells[-1], cells[:, 0], cells[:, -1]]).any()
    centres = np.column_stack([a.ravel() for a in np.meshgrid(np.arange(10, 800, 20.0), np.arange(7.5, 600, 15))])
    fits = clearance(centres, world.bounds, solids).reshape(40, 40) > 5.0
    assert cells[fits].all()
    assert 0.7 < cells.mean() < 0.85


@given(seeds)
@settings(max_examples=20)
def test_cells_from_several_places_are_all_that_can_be_reached_from_any_of_them(seed):
    rng = np.random.default_rng(seed)
    solids, points = random_solids(rng), rng.uniform((5, 5), (95, 75), (40, 2))
    places = points[clearance(points, BOX, solids) > 4.1][:3]
    alone = [reachable_cells(BOX, solids, 4.0, place, (8, 10)) for place in places]
    expected = np.any([*alone, visited_cells(places, BOX, (8, 10))], axis=0)
    assert np.array_equal(cells_from_places(BOX, solids, 4.0, places, (8, 10)), expected)


def test_a_place_outside_the_world_is_refused():
    with pytest.raises(InvalidValueError, match=r"^positions holds \(120, 10\); expected points within the bounds"):
        cells_from_places(BOX, [], 4.0, [[120, 10]])


@pytest.mark.parametrize("solids", [[], [(shapely.box(45, 0, 55, 80), 0.0)]])
def test_nothing_is_reached_from_no_place(solids):
    assert not cells_from_places(BOX, solids, 4.0, np.empty((0, 2))).any()
