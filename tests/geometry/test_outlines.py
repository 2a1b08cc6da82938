"""Distances and nearest points of outlines are those of Shapely, bit for bit."""

import math

import numpy as np
import pytest
import shapely
from shapely import LineString, MultiPolygon, Point, Polygon

from mesa_swarm.geometry import outlines as ours
from mesa_swarm.geometry.outlines import outlines_of
from mesa_swarm.world.bodies import placed

WORLDS, PAIRS = 40, 25


def star(rng, grid):
    """Return a simple polygon, concave as a rule, perhaps with a hole; on a grid distances are equal by intent."""
    n = int(rng.integers(3, 12))
    azimuth = rng.uniform(0, 6) + np.arange(n) * 2 * math.pi / n
    points = rng.uniform(4, 20, n)[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    centre = rng.uniform(0, 60, 2)
    holes = [centre + 0.4 * points] if rng.random() < 0.3 else []
    made = Polygon(np.round(centre + points) if grid else centre + points, [] if grid else holes)
    return made if made.is_valid and made.area else star(rng, grid)


def box(rng):
    low, size = rng.integers(0, 60, 2), rng.integers(1, 20, 2)
    return shapely.box(*low, *(low + size))


def several(rng):
    parts = shapely.union_all([star(rng, False) for _ in range(3)])
    return parts if isinstance(parts, MultiPolygon) else several(rng)


def line(rng, grid):
    ends = rng.uniform(0, 60, (2, 2))
    return LineString(np.round(ends) if grid else ends)


def point(rng, grid):
    place = rng.uniform(0, 60, 2)
    return Point(np.round(place) if grid else place)


def random_world(seed):
    """Return geometries, those of some worlds on a grid, where many touch, and are as far from several others."""
    rng = np.random.default_rng(seed)
    grid = bool(seed % 2)
    made = [star(rng, grid) for _ in range(PAIRS // 2)] + [box(rng) for _ in range(PAIRS // 4)]
    made += [line(rng, grid) for _ in range(PAIRS // 2)] + [point(rng, grid) for _ in range(PAIRS // 2)]
    return made + [several(rng) for _ in range(2)]


def is_point(geometry):
    return geometry.geom_type == "Point"


def same(a, b):
    return np.float64(a).tobytes() == np.float64(b).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(WORLDS))
def test_distances_and_nearest_points_of_all_pairs_are_those_of_shapely(seed):
    world = random_world(seed)
    table = outlines_of(world, np.zeros(len(world)))
    for a, first in enumerate(world):
        for b, second in enumerate(world):
            if is_point(second):
                check_point(a, first, second, table)
            elif not is_point(first):
                check_pair(a, b, first, second, table)


def check_point(a, solid, place, table):
    gap, v = ours.gap_to_point(a, place.x, place.y, math.inf, table)
    assert same(gap, solid.distance(place))
    if gap and not is_point(solid):
        (px, py), _ = shapely.get_coordinates(shapely.shortest_line(solid, place)).tolist()
        assert ours.nearest_on_line(place.x, place.y, *table.points[v : v + 2].ravel()) == (px, py)


def check_pair(a, b, first, second, table):
    gap, i, j = ours.gap_between(a, b, math.inf, table)
    assert same(gap, first.distance(second))
    assert ours.gap_between(a, b, gap + 1e-3, table) == (gap, i, j)
    if gap:
        ends = shapely.get_coordinates(shapely.shortest_line(first, second)).ravel().tolist()
        assert list(ours.nearest_of_segments(i, j, table.points)) == ends


def test_what_is_inside_or_on_a_polygon_is_that_of_shapely_for_points_next_to_its_edges():
    rng = np.random.default_rng(3)
    for _ in range(60):
        solid = star(rng, False)
        table = outlines_of([solid], [0.0])
        edge = rng.integers(len(table.points) - 1, size=40)
        share = rng.uniform(0, 1, (40, 1))
        places = (1 - share) * table.points[edge] + share * table.points[edge + 1]
        places = np.vstack([places, np.nextafter(places, rng.uniform(-9, 9, places.shape)), table.points])
        covered = [ours.is_covered(x, y, 0, table) for x, y in places.tolist()]
        assert covered == (shapely.intersects_xy(solid, places)).tolist()


@pytest.mark.parametrize("seed", range(20))
def test_a_placed_solid_is_where_shapely_places_it_and_in_its_normal_form(seed):
    rng = np.random.default_rng(seed)
    pose = (*rng.uniform(-50, 50, 2).tolist(), float(rng.choice([0.0, math.pi / 2, rng.uniform(-3, 3)])))
    shell = shapely.box(-10, -8, 10, 8)
    holes = [shapely.box(x, y, x + 2, y + 3).exterior for x, y in ((-8, -5), (3, 1), (-2, -2), (5, -6))]
    for solid in (shapely.normalize(Polygon(shell.exterior, holes)), shapely.normalize(star(rng, False))):
        table = outlines_of([solid], [0.0])
        ours.place_solid(0, *pose, table)
        assert table.points.tobytes() == shapely.get_coordinates(placed(solid, pose)).tobytes()
        ours.normalize_solid(0, table)
        rings = [table.points[table.rings[r] : table.rings[r + 1]] for r in table.order]
        normal = shapely.normalize(placed(solid, pose))
        assert np.concatenate(rings).tobytes() == shapely.get_coordinates(normal).tobytes()
        assert (table.boxes[0] == normal.bounds).all()
