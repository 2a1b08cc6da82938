"""Where the centre of a disc may be, among solid things and within bounds, as Shapely geometries."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely

from mesa_swarm.base.errors import InvalidValueError, shortened
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.grid import Grid, cell_index, list_boxes_by_cell
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import cos

# With more solids, or more pairs of them whose boxes overlap once grown, their union takes seconds or minutes.
MOST_UNITED = 2_000
MOST_OVERLAPS = 50_000
# An outline of more corners than SIMPLE may be intricate. SAMPLED of its edges decide: if on average they have more
# than MOST_NEAR others within reach, growing each edge alone is quicker than the whole, by far for a hostile outline.
SIMPLE = 500
SAMPLED = 32
MOST_NEAR = 100
# Its edges are those of a simpler outline, at most this share of the reach away; the reach grows by the same share.
SMOOTHED = 0.01
# Worlds of which the parts of the room are remembered.
REMEMBERED = 256
# Points are tried against this number of the largest solids before all.
STAGES = (30, 500, None)
POINT = 0  # Shapely's number of this type
# Discs are listed by cell if they are at most this many cells wide: larger ones would be in very many lists.
CELLS_PER_DISC = 4
WIDEST_DISC = 3.0
# Corners of a grown disc are rounded: nearer to its rim than this share of its radius, the polygon itself decides.
RIM = 1e-4
USUALLY_NEAR = 1000


def circumscribed_ratio(quarter_segments: int) -> float:
    """Return the ratio of the distance of a polygon's corners to the radius of the circle that it is drawn around.

    Examples
    --------
    >>> round(circumscribed_ratio(16), 4)
    1.0012
    """
    return 1.0 / cos(math.pi / (4 * quarter_segments))


def room_for_disc(
    bounds: Bounds, solids: Sequence[tuple[shapely.Geometry, float]], radius: float, quarter_segments: int
) -> shapely.Geometry:
    """Return where the centre of a disc may be without overlapping anything solid.

    A buffer is a polygon: it is drawn around the circle, not inside it, so that no occupied place counts as free.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max)
    solids : sequence of (geometry, radius)
        A disc is a Point and its radius, a polygon has radius 0.
    radius : float
        The disc's.
    quarter_segments : int
        Corners of a quarter circle.

    Raises
    ------
    InvalidValueError
        If a solid is not a valid Shapely geometry.

    Examples
    --------
    >>> room_for_disc((0, 0, 100, 50), [], 5.0, 16).area
    3600.0
    """
    _check_valid(solids)
    inner = _room_within_border(bounds, radius)
    if not solids or inner.is_empty:
        return inner
    return inner.difference(shapely.union_all(_grow(*_list_pieces(solids, radius), quarter_segments)))


@dataclass(frozen=True, slots=True)
class Crowded:
    """Free places of the centre of a disc among very many solids: their union is not built, points are tried.

    Parameters
    ----------
    inner : shapely Polygon
        The bounds, shrunk by the disc's radius.
    trees : tuple of shapely.STRtree
        Over the solids, grown by the disc's radius: over the largest, over more, and over all.
    discs : SmallDiscs, optional
        Solids that are in none of the trees.

    Examples
    --------
    >>> room = Crowded(shapely.box(0, 0, 9, 9), (shapely.STRtree([shapely.box(0, 0, 5, 9)]),))
    >>> room.holds(np.array([(2, 2), (7, 2)]))
    array([False,  True])
    """

    inner: shapely.Polygon
    trees: tuple[shapely.STRtree, ...]
    discs: "SmallDiscs | None" = None

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Return for each point, shape (n, 2), whether it is free."""
        x_min, y_min, x_max, y_max = self.inner.bounds
        x, y = points.T
        free = (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max)
        if self.discs is not None:
            self.discs.exclude(points, free)
        for tree in self.trees:  # the first, which is quick, excludes most points
            among = np.flatnonzero(free)
            free[among[tree.query(shapely.points(points[among]), predicate="intersects")[0]]] = False
        return free


@dataclass(frozen=True, slots=True, eq=False)
class SmallDiscs:
    """Very many small discs, each grown to a polygon: which points they leave free, without making the polygons.

    A point within a circle is within the polygon around it, and one beyond the polygon's corners is not. Only for
    points between the two the polygon is made, so that the answer is that of the polygons, to the last bit.

    Parameters
    ----------
    centres, reach : ndarrays, shapes (k, 2), (k,)
        Of the circles that the polygons are drawn around.
    quarter_segments : int
        Corners of a quarter circle.
    grid : Grid
        Over what the points are in.
    start, items : int64 ndarrays
        The discs by cell, see `list_boxes_by_cell`.
    """

    centres: np.ndarray
    reach: np.ndarray
    quarter_segments: int
    grid: Grid
    start: np.ndarray
    items: np.ndarray

    @classmethod
    def of(cls, centres: np.ndarray, reach: np.ndarray, quarter_segments: int, grid: Grid) -> "SmallDiscs":
        """Return the discs listed by the cells of a grid.

        Examples
        --------
        >>> grid = Grid.over((0.0, 0.0, 20.0, 10.0), 10.0, 9)
        >>> discs = SmallDiscs.of(np.array([[5.0, 5.0]]), np.array([3.0]), 16, grid)
        >>> free = np.ones(2, bool)
        >>> discs.exclude(np.array([[7.0, 5.0], [9.0, 5.0]]), free)
        >>> free
        array([False,  True])
        """
        far = (reach * circumscribed_ratio(quarter_segments) * (1 + RIM) + _rounding(centres, reach))[:, None]
        boxes = np.column_stack([centres - far, centres + far])
        start, items = list_boxes_by_cell(boxes, 0.0, grid.numbers)
        return cls(centres, reach, quarter_segments, grid, start, items)

    def exclude(self, points: np.ndarray, free: np.ndarray) -> None:
        """Set `free` to False for the points, shape (n, 2), that are in or on a polygon."""
        low = self.reach * (1 - RIM) - _rounding(self.centres, self.reach)
        high = self.reach * circumscribed_ratio(self.quarter_segments) * (1 + RIM) + _rounding(self.centres, self.reach)
        arguments = points, self.centres, low, high, self.start, self.items, self.grid.numbers, free
        near = np.empty((USUALLY_NEAR, 2), np.int64)
        count = exclude_by_circles(*arguments, near)
        if count > len(near):
            near = np.empty((count, 2), np.int64)
            exclude_by_circles(*arguments, near)
        point, disc = near[:count].T
        discs, place = np.unique(disc, return_inverse=True)
        grown = _grow(shapely.points(self.centres[discs]), self.reach[discs], self.quarter_segments)
        free[point[shapely.intersects(grown[place], shapely.points(points[point]))]] = False


def _rounding(centres: np.ndarray, reach: np.ndarray) -> float:
    """Return a bound of the rounding of coordinates of the corners of discs, with a margin."""
    return 1e-14 * float(np.abs(centres).max(initial=0.0) + reach.max(initial=0.0))


@compiled
def exclude_by_circles(points, centres, low, high, start, items, grid, free, near):
    """Set `free` to False for points in circles, and return how many pairs of a free point and a circle are near.

    Parameters
    ----------
    points, centres : ndarrays, shapes (n, 2), (k, 2)
    low, high : ndarrays, shape (k,)
        Below `low` from a centre a point is within that circle, and up to `high` it is near it.
    start, items : int64 ndarrays
        The circles by cell, see `list_boxes_by_cell`.
    grid : tuple
        `Grid.numbers`.
    free : bool ndarray, shape (n,), written
        Only points with True are looked at.
    near : int64 ndarray, shape (m, 2), written
        The first m pairs: point, circle.

    Examples
    --------
    >>> free, near, one = np.ones(2, bool), np.zeros((1, 2), np.int64), np.array([1.0])
    >>> lists = np.array([0, 1]), np.array([0])
    >>> grid = 0.0, 0.0, 1.0, 1, 1
    >>> points = np.array([[0.5, 0.0], [0.0, 1.5]])
    >>> exclude_by_circles(points, np.zeros((1, 2)), one, 2 * one, *lists, grid, free, near)
    1
    >>> free.tolist(), near.tolist()
    ([False, True], [[1, 0]])
    """
    x0, y0, per_unit, columns, rows = grid
    count = 0
    for i in range(points.shape[0]):
        if not free[i]:
            continue
        x, y, before = points[i, 0], points[i, 1], count
        cell = cell_index(x, x0, per_unit, columns) + columns * cell_index(y, y0, per_unit, rows)
        for k in range(start[cell], start[cell + 1]):
            disc = items[k]
            far = math.sqrt((x - centres[disc, 0]) ** 2 + (y - centres[disc, 1]) ** 2)
            if far < low[disc]:
                free[i], count = False, before
                break
            if far <= high[disc]:
                if count < near.shape[0]:
                    near[count, 0], near[count, 1] = i, disc
                count += 1
    return count


def room_to_try(
    bounds: Bounds, solids: Sequence[tuple[shapely.Geometry, float]], radius: float, quarter_segments: int
) -> shapely.Geometry | Crowded:
    """Return what `room_for_disc` does, or a `Crowded` room where that would take very long.

    Examples
    --------
    >>> room_to_try((0, 0, 100, 50), [], 5.0, 16).area
    3600.0
    >>> type(room_to_try((0, 0, 100, 50), [(shapely.Point(9, 9), 1.0)] * 3000, 5.0, 16)).__name__
    'Crowded'
    """
    _check_valid(solids)
    inner = _room_within_border(bounds, radius)
    if inner.is_empty or not solids:
        return inner
    pieces, reach = _list_pieces(solids, radius)
    if not _is_crowded(pieces, reach):
        return inner.difference(shapely.union_all(_grow(pieces, reach, quarter_segments)))
    alike = {(content, far): i for i, (content, far) in enumerate(zip(shapely.to_wkb(pieces), reach, strict=True))}
    rows = list(alike.values())
    pieces, reach = pieces[rows], reach[rows]
    grid = Grid.over(inner.bounds, 0.0, CELLS_PER_DISC * len(pieces))
    small = (shapely.get_type_id(pieces) == POINT) & (reach > 0) & (2 * reach <= WIDEST_DISC * grid.cell)
    grown = _grow(pieces[~small], reach[~small], quarter_segments)
    largest_first = grown[np.argsort(-shapely.area(grown), kind="stable")]
    trees = tuple(shapely.STRtree(largest_first[:n]) for n in STAGES) if len(grown) else ()
    discs = SmallDiscs.of(shapely.get_coordinates(pieces[small]), reach[small], quarter_segments, grid)
    return Crowded(inner, trees, discs if small.any() else None)


def _room_within_border(bounds: Bounds, radius: float) -> shapely.Polygon:
    """Return where the centre may be if only the border counts."""
    x_min, y_min, x_max, y_max = bounds
    if x_max - x_min <= 2 * radius or y_max - y_min <= 2 * radius:
        return shapely.Polygon()
    return shapely.box(x_min + radius, y_min + radius, x_max - radius, y_max - radius)


def _list_pieces(solids: Sequence[tuple[shapely.Geometry, float]], radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what is to be grown, and by how much: the solids, but of intricate ones each edge."""
    geometries = np.array([geometry for geometry, _ in solids], object)
    whole = np.array([own for _, own in solids], float) + radius
    large = np.flatnonzero(shapely.get_num_coordinates(geometries) > SIMPLE)
    if not len(large):
        return geometries, whole
    pieces: list[shapely.Geometry] = []
    reach: list[float] = []
    for geometry, far in zip(geometries.tolist(), whole.tolist(), strict=True):
        edges = _edges_if_intricate(geometry, far)
        pieces += [geometry, *edges]
        reach += [0.0, *[(1 + SMOOTHED) * far] * len(edges)] if len(edges) else [far]
    return np.array(pieces), np.array(reach)


def _edges_if_intricate(geometry: shapely.Geometry, reach: float) -> np.ndarray:
    """Return the edges of an outline if those near each other are too many to grow it whole, else none.

    The sides of a grown outline are overlaid, and those of a star of some thousand spikes all cross each other:
    that takes minutes, and gigabytes.
    """
    if shapely.get_num_coordinates(geometry) <= SIMPLE:
        return np.array([])
    rings = shapely.get_rings(shapely.simplify(geometry, SMOOTHED * reach))
    edges = np.concatenate([_edges(shapely.get_coordinates(ring)) for ring in rings])
    if len(edges) <= SIMPLE:
        return np.array([])
    low, high = edges.min(axis=1) - reach, edges.max(axis=1) + reach
    boxes = shapely.box(*low.T, *high.T)
    sampled = boxes[np.linspace(0, len(boxes) - 1, SAMPLED).astype(int)]
    near = shapely.STRtree(boxes).query(sampled).shape[1] / SAMPLED
    return shapely.linestrings(edges) if near > MOST_NEAR else np.array([])


def _edges(ring: np.ndarray) -> np.ndarray:
    """Return the ends of the edges of a closed ring, shape (n, 2, 2)."""
    return np.stack([ring[:-1], ring[1:]], axis=1)


def _grow(pieces: np.ndarray, reach: np.ndarray, quarter_segments: int) -> np.ndarray:
    grown = pieces.copy()
    far = reach > 0
    grown[far] = shapely.buffer(
        pieces[far], reach[far] * circumscribed_ratio(quarter_segments), quad_segs=quarter_segments
    )
    return grown


def _is_crowded(pieces: np.ndarray, reach: np.ndarray) -> bool:
    if len(pieces) > MOST_UNITED:
        return True
    if len(pieces) * (len(pieces) - 1) // 2 <= MOST_OVERLAPS:
        return False
    boxes = shapely.box(*(shapely.bounds(pieces) + reach[:, None] * (-1.0, -1.0, 1.0, 1.0)).T)
    return (shapely.STRtree(boxes).query(boxes).shape[1] - len(boxes)) // 2 > MOST_OVERLAPS


def _check_valid(solids: Sequence[tuple[object, float]]) -> None:
    geometries = [geometry for geometry, _ in solids]
    good = shapely.is_geometry(geometries)
    good &= shapely.is_valid([geometry if fits else None for geometry, fits in zip(geometries, good, strict=True)])
    if not good.all():
        wrong = geometries[int(np.argmin(good))]
        raise InvalidValueError(f"solids holds {shortened(wrong)}; expected valid Shapely geometries")


def find_part_around(space: shapely.Geometry, point: np.ndarray, slack: float) -> shapely.Geometry | None:
    """Return the connected part of a space that holds a point or is within `slack` of it, or None.

    Examples
    --------
    >>> two = shapely.union_all([shapely.box(0, 0, 1, 1), shapely.box(5, 0, 7, 1)])
    >>> find_part_around(two, (6.0, 0.5), 0.0).area
    2.0
    """
    if space.is_empty:
        return None
    parts = shapely.get_parts(space)
    distance = shapely.distance(parts, shapely.Point(point))
    nearest = distance.argmin()
    return parts[nearest] if distance[nearest] <= slack else None


def cells_of_nearest_parts(
    bounds: Bounds,
    solids: tuple[tuple[shapely.Geometry, float], ...],
    radius: float,
    quarter_segments: int,
    points: np.ndarray,
    shape: tuple[int, int],
    fewest_share: float,
) -> np.ndarray:
    """Return the cells of the parts of the room for a disc in which points (n, 2) are, or to which they are nearest.

    Those are cells, bool of `shape` (rows, columns), of which a part covers more than `fewest_share`.

    Examples
    --------
    >>> wall = (shapely.box(45, 0, 55, 100), 0.0)
    >>> cells_of_nearest_parts((0, 0, 100, 100), (wall,), 5.0, 16, np.array([[20, 20]]), (1, 4), 0.01)
    array([[ True,  True, False, False]])
    """
    parts, covered = _parts_by_cell(bounds, solids, radius, quarter_segments, shape, fewest_share)
    if not len(points) or not len(parts):
        return np.zeros(shape, bool)
    away = shapely.distance(parts[:, None], shapely.points(np.asarray(points, float))) if len(parts) > 1 else None
    nearest = slice(None) if away is None else np.unique(away.argmin(axis=0))
    return np.asarray(covered[nearest].any(axis=0))


@lru_cache(maxsize=REMEMBERED)
def _parts_by_cell(
    bounds: Bounds,
    solids: tuple[tuple[shapely.Geometry, float], ...],
    radius: float,
    quarter_segments: int,
    shape: tuple[int, int],
    fewest_share: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts of the room for a disc, and which cells each of them covers (parts, rows, columns)."""
    parts = shapely.get_parts(room_for_disc(bounds, solids, radius, quarter_segments))
    x_min, y_min, x_max, y_max = bounds
    fewest = fewest_share * (x_max - x_min) * (y_max - y_min) / (shape[0] * shape[1])
    covered = [areas_by_cell(part, bounds, *shape) > fewest for part in parts]
    return parts, np.array(covered, bool).reshape(-1, *shape)


def areas_by_cell(space: shapely.Geometry, bounds: Bounds, rows: int, columns: int) -> np.ndarray:
    """Return how much of a space lies in each of the equal cells that the bounds are cut into.

    Returns
    -------
    ndarray, shape (rows, columns)
        Row 0 at y_min.

    Examples
    --------
    >>> areas_by_cell(shapely.box(0, 0, 3, 1), (0, 0, 4, 2), 2, 2)
    array([[2., 1.],
           [0., 0.]])
    """
    x_min, y_min, x_max, y_max = bounds
    x, y = np.linspace(x_min, x_max, columns + 1), np.linspace(y_min, y_max, rows + 1)
    # Cut into strips first: a cell then looks at its strip's few corners.
    strips = shapely.intersection(space, shapely.box(x_min, y[:-1], x_max, y[1:]))
    cells = shapely.box(x[:-1], y[:-1, None], x[1:], y[1:, None])
    return shapely.area(shapely.intersection(strips[:, None], cells))
