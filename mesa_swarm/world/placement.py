"""Free random places for robots: within the free space, never overlapping."""

import math
from collections.abc import Sequence

import numpy as np
import shapely

from mesa_swarm.errors import PlacementError
from mesa_swarm.geometry.grid import Grid
from mesa_swarm.geometry.packing import hexagonal_lattice, take_apart
from mesa_swarm.world.shapes import Shape

# A buffer is a polygon: this many corners a quarter, drawn around the circle, not inside it.
QUARTER_SEGMENTS = 16
OUTSIDE = 1.0 / math.cos(math.pi / (4 * QUARTER_SEGMENTS))
# Random places that are tried for each robot before a lattice is laid out.
TRIES = 200
MOST_CANDIDATES = 2_000_000


def free_space(
    bounds: tuple[float, float, float, float], shapes: Sequence[Shape], fires: np.ndarray, radius: float
) -> shapely.Geometry:
    """Return where the centre of a disc may be without overlapping anything that stands still.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max)
    shapes : sequence of Shape
        Marks are passed over.
    fires : ndarray, shape (f, 3)
        x, y, radius.
    radius : float

    Examples
    --------
    >>> free_space((0, 0, 100, 50), [], np.empty((0, 3)), 5.0).area
    3600.0
    """
    x_min, y_min, x_max, y_max = bounds
    if x_max - x_min <= 2 * radius or y_max - y_min <= 2 * radius:
        return shapely.Polygon()
    inner = shapely.box(x_min + radius, y_min + radius, x_max - radius, y_max - radius)
    solid = [(s.geometry, s.radius) for s in shapes if s.contact]
    solid += [(shapely.Point(x, y), r) for x, y, r in fires]
    if not solid:
        return inner
    geometries, radii = zip(*solid, strict=True)
    grown = shapely.buffer(geometries, (np.array(radii) + radius) * OUTSIDE, quad_segs=QUARTER_SEGMENTS)
    return inner.difference(shapely.union_all(grown))


def place_apart(
    n: int,
    radius: float,
    space: shapely.Geometry,
    others: np.ndarray,
    other_radius: np.ndarray,
    rng: np.random.Generator,
    where: str = "the map",
) -> np.ndarray:
    """Return n random places, shape (n, 2), at which discs overlap neither each other nor anybody else.

    Places are drawn one after the other; where that gets stuck, from a triangular lattice.

    Parameters
    ----------
    n : int
    radius : float
    space : shapely geometry
        From `free_space` for this radius.
    others, other_radius : ndarrays, shapes (k, 2), (k,)
        Discs that are there already.
    rng : numpy.random.Generator
    where : str
        For the message.

    Raises
    ------
    PlacementError
        If they do not fit; the message says how many would. Nothing large is allocated before.
    """
    room = _most_that_fit(space, radius)
    if n > room:
        raise PlacementError(_does_not_fit(n, radius, where, f"at most {room}"))
    table = _Placed(others, other_radius, n, radius, space)
    while table.missing and table.tried < TRIES * n:
        table.take(_random_points(space, min(max(2 * table.missing, 64), MOST_CANDIDATES), rng))
    if not table.missing:
        return table.new
    lattice = _lattice_in(space, radius, rng)
    packed = _Placed(others, other_radius, len(lattice), radius, space)
    packed.take(lattice)
    fit = len(packed.new)
    if fit < n:
        raise PlacementError(_does_not_fit(n, radius, where, f"{max(fit, len(table.new))}"))
    return packed.new[np.sort(rng.permutation(fit)[:n])]


class _Placed:
    """Discs placed so far, those of others first, in linked lists by cell."""

    def __init__(self, others, other_radius, room: int, radius: float, space) -> None:
        self.tried = 0
        self._old = len(others)
        self._position = np.concatenate([others, np.empty((room, 2))])
        self._radius = np.concatenate([other_radius, np.full(room, radius)])
        cell = radius + float(self._radius.max(initial=radius))
        bounds = space.bounds if not space.is_empty else (0.0, 0.0, 1.0, 1.0)
        self._grid = Grid.over(bounds, cell, 64 + 4 * len(self._radius))
        self._head = np.full(self._grid.cells, -1, np.int64)
        self._following = np.full(len(self._radius), -1, np.int64)
        self._link(others)

    def _link(self, others: np.ndarray) -> None:
        """List those who are there already, whatever they overlap."""
        x0, y0, per_unit, columns, rows = self._grid.numbers
        column = np.clip(((others[:, 0] - x0) * per_unit).astype(int), 0, columns - 1)
        row = np.clip(((others[:, 1] - y0) * per_unit).astype(int), 0, rows - 1)
        for k, cell in enumerate(column + columns * row):
            self._following[k] = self._head[cell]
            self._head[cell] = k
        self._taken = len(others)

    @property
    def missing(self) -> int:
        return len(self._position) - self._taken

    @property
    def new(self) -> np.ndarray:
        return self._position[self._old : self._taken]

    def take(self, candidates: np.ndarray) -> None:
        radius = self._radius[-1] if len(self._radius) else 0.0
        self.tried += len(candidates)
        self._taken = take_apart(
            candidates,
            radius,
            self._position,
            self._radius,
            self._taken,
            self._grid.numbers,
            self._head,
            self._following,
        )


def _random_points(space: shapely.Geometry, n: int, rng: np.random.Generator) -> np.ndarray:
    x_min, y_min, x_max, y_max = space.bounds
    points = rng.random((n, 2)) * (x_max - x_min, y_max - y_min) + (x_min, y_min)
    return points[shapely.contains_xy(space, points)]


def _lattice_in(space: shapely.Geometry, radius: float, rng: np.random.Generator) -> np.ndarray:
    """Return the lattice points in the free space, of the best of a few offsets, the unmoved one included."""
    x_min, y_min, x_max, y_max = space.bounds
    best = np.empty((0, 2))
    for dx, dy in [(0.0, 0.0), *rng.random((8, 2)) * 2 * radius]:
        points = hexagonal_lattice((x_min + dx, y_min + dy, x_max, y_max), 2 * radius)
        points = points[shapely.intersects_xy(space, points)]
        best = points if len(points) > len(best) else best
    return best


def _most_that_fit(space: shapely.Geometry, radius: float) -> int:
    """Return more than can fit: the bodies' area cannot exceed the free space grown by a radius."""
    if space.is_empty:
        return 0
    # Nothing is packed denser than pi / sqrt(12).
    return 1 + int(space.buffer(radius).area * (math.pi / math.sqrt(12)) / (math.pi * radius**2))


def _does_not_fit(n: int, radius: float, where: str, fit: str) -> str:
    return f"{n} robots of radius {radius:g} do not fit on {where}: {fit} would; ask for fewer or a larger map"
