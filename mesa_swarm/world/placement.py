"""Random free places for robots: within the free space, never overlapping."""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import shapely

from mesa_swarm.base.errors import PlacementError
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.free_room import Crowded, circumscribed_ratio, room_for_disc, room_to_try
from mesa_swarm.geometry.grid import Grid
from mesa_swarm.geometry.spaced_points import hexagonal_lattice, link_by_cell, take_apart
from mesa_swarm.world.shapes import Shape

# A buffer is a polygon, of this many corners a quarter.
QUARTER_SEGMENTS = 16
# So few shapes are compared with those of worlds before.
MOST_KNOWN_SHAPES = 200
# Random places that are tried for each robot before a lattice is used.
TRIES = 200
MOST_CANDIDATES = 2_000_000
MOST_ROBOTS = 10_000_000
# Where less than this share of the bounding box is free, points are drawn from triangles instead.
SPARSE = 0.01
# Points that fill what a lattice leaves free, and offsets of the lattice that are tried.
FILLING = 20_000
OFFSETS = 8
# The same, and the most points of a lattice, where testing a point takes long.
FILLING_CROWD = 2_000
MOST_LATTICE_IN_CROWD = 2_000


def free_space(bounds: Bounds, shapes: Sequence[Shape], radius: float) -> shapely.Geometry:
    """Return where the centre of a disc may be without overlapping a solid shape."""
    return room_for_disc(bounds, _solids(shapes), radius, QUARTER_SEGMENTS)


def free_places(bounds: Bounds, shapes: Sequence[Shape], radius: float) -> shapely.Geometry | Crowded:
    """Return what `free_space` does, or for `place_apart` a `Crowded` room where that would take very long.

    Among more than 2000 solid shapes, or 50,000 pairs of them that overlap, places are found only by trying: a map
    that is nearly full may then count as full.
    """
    find_room = _find_known_room if len(shapes) <= MOST_KNOWN_SHAPES else _find_room
    return find_room(bounds, tuple(shapes), float(radius))


def _find_room(bounds: Bounds, shapes: tuple[Shape, ...], radius: float) -> shapely.Geometry | Crowded:
    return room_to_try(bounds, _solids(shapes), radius, QUARTER_SEGMENTS)


# Worlds on the same map share their room.
_find_known_room = lru_cache(maxsize=32)(_find_room)


def _solids(shapes: Sequence[Shape]) -> list[tuple[shapely.Geometry, float]]:
    return [(shape.geometry, shape.radius) for shape in shapes if shape.contact]


def place_apart(
    n: int,
    radius: float,
    space: shapely.Geometry | Crowded,
    others: np.ndarray,
    other_radius: np.ndarray,
    rng: np.random.Generator,
    where: str = "the map",
) -> np.ndarray:
    """Return n random places, shape (n, 2), at which discs overlap neither each other nor those that are there already.

    `space` is from `free_space` or `free_places` for this radius. Places are drawn one after the other; where that gets
    stuck, from a triangular lattice. If they do not fit, the message states how many would on `where`, and no large
    array has been allocated.
    """
    room = _most_that_fit(_outline(space), float(radius))
    if n > room:
        is_counted = room <= MOST_CANDIDATES
        fit = len(_pack_discs(space, radius, others, other_radius, room)) if is_counted else f"at most {room}"
        raise PlacementError(_does_not_fit(n, radius, where, fit))
    if n > MOST_ROBOTS:
        raise PlacementError(_does_not_fit(n, radius, "one world, on which the limit is", MOST_ROBOTS))
    if not n:
        return np.empty((0, 2))
    table = _DiscTable(others, other_radius, n, radius, space)
    draw = _points_of(space)
    while table.missing and table.tried < TRIES * n:
        number = min(max(2 * table.missing, 64), MOST_CANDIDATES)
        candidates = draw(number, rng)
        table.take(candidates)
        # In a crowd all points drawn count, even if none of them is free: the loop has to end.
        table.tried += number if isinstance(space, Crowded) else len(candidates)
    if not table.missing:
        return table.new
    packed = _pack_discs(space, radius, others, other_radius, room)
    if len(packed) < n:
        raise PlacementError(_does_not_fit(n, radius, where, len(packed)))
    return packed[np.sort(rng.permutation(len(packed))[:n])]


def _pack_discs(
    space: shapely.Geometry | Crowded, radius: float, others: np.ndarray, other_radius: np.ndarray, room: int
) -> np.ndarray:
    """Return densely packed places: always the same ones, so that a message's number holds."""
    if not room:
        return np.empty((0, 2))
    rng = np.random.default_rng(0)
    table = _DiscTable(others, other_radius, room, radius, space)
    table.take(_lattice_in(space, radius, rng))
    table.take(_points_of(space)(FILLING_CROWD if isinstance(space, Crowded) else FILLING, rng))
    return table.new


class _DiscTable:
    """Discs placed so far, those of others first, in linked lists by cell."""

    def __init__(
        self, others: np.ndarray, other_radius: np.ndarray, room: int, radius: float, space: shapely.Geometry | Crowded
    ) -> None:
        self.tried = 0
        self._old = len(others)
        self._position = np.concatenate([others, np.empty((room, 2))])
        self._radius = np.concatenate([other_radius, np.full(room, radius)])
        cell = radius + float(self._radius.max(initial=radius))
        outline = _outline(space)
        bounds = outline.bounds if not outline.is_empty else (0.0, 0.0, 1.0, 1.0)
        self._grid = Grid.over(bounds, cell, 64 + 4 * len(self._radius))
        self._head = np.full(self._grid.cells, -1, np.int64)
        self._following = np.full(len(self._radius), -1, np.int64)
        link_by_cell(others, self._grid.numbers, self._head, self._following)  # whatever they overlap
        self._count = len(others)

    @property
    def missing(self) -> int:
        return len(self._position) - self._count

    @property
    def new(self) -> np.ndarray:
        return self._position[self._old : self._count]

    def take(self, candidates: np.ndarray) -> None:
        radius = self._radius[-1] if len(self._radius) else 0.0
        discs = self._position, self._radius, self._count
        self._count = take_apart(candidates, radius, *discs, self._grid.numbers, self._head, self._following)


def _outline(space: shapely.Geometry | Crowded) -> shapely.Geometry:
    """Return the free space, or in a crowd the area that contains it."""
    return space.inner if isinstance(space, Crowded) else space


def _points_of(space: shapely.Geometry | Crowded) -> Callable[[int, np.random.Generator], np.ndarray]:
    """Return a function that draws uniform points of the free space, from its box or, if that is sparse, triangles."""
    x_min, y_min, x_max, y_max = _outline(space).bounds
    if not isinstance(space, Crowded) and space.area < SPARSE * (x_max - x_min) * (y_max - y_min):
        return _points_of_triangles(shapely.constrained_delaunay_triangles(space))

    def draw(n: int, rng: np.random.Generator) -> np.ndarray:
        points = rng.random((n, 2))  # there may be millions
        points *= (x_max - x_min, y_max - y_min)
        points += (x_min, y_min)
        return points[space.holds(points) if isinstance(space, Crowded) else shapely.contains_xy(space, points)]

    return draw


def _points_of_triangles(triangles: shapely.Geometry) -> Callable[[int, np.random.Generator], np.ndarray]:
    parts = shapely.get_parts(triangles)
    a, b, c = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3].transpose(1, 0, 2)
    share = shapely.area(parts) / shapely.area(parts).sum()

    def draw(n: int, rng: np.random.Generator) -> np.ndarray:
        which, u, v = rng.choice(len(parts), n, p=share), rng.random((n, 1)), rng.random((n, 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        return a[which] + u * (b - a)[which] + v * (c - a)[which]

    return draw


def _lattice_in(space: shapely.Geometry | Crowded, radius: float, rng: np.random.Generator) -> np.ndarray:
    """Return the lattice points in the free space, of the best of a few offsets, the unmoved one included."""
    x_min, y_min, x_max, y_max = _outline(space).bounds
    best = np.empty((0, 2))
    most = MOST_LATTICE_IN_CROWD if isinstance(space, Crowded) else MOST_CANDIDATES
    if (x_max - x_min) * (y_max - y_min) > most * radius**2 * math.sqrt(12):
        return best
    for dx, dy in [(0.0, 0.0), *rng.random((OFFSETS, 2)) * 2 * radius]:
        points = hexagonal_lattice((x_min + dx, y_min + dy, x_max, y_max), 2 * radius)
        points = points[space.holds(points) if isinstance(space, Crowded) else shapely.intersects_xy(space, points)]
        best = points if len(points) > len(best) else best
    return best


@lru_cache(maxsize=32)
def _most_that_fit(space: shapely.Geometry, radius: float) -> int:
    """Return an upper bound: the bodies' area cannot exceed the free space grown by a radius."""
    # Also of a box as wide as the robot but for rounding, which has no area to draw from.
    if not space.area:
        return 0
    return 1 + int(space.buffer(radius * circumscribed_ratio(QUARTER_SEGMENTS)).area / (math.pi * radius**2))


def _does_not_fit(n: int, radius: float, where: str, fit: int | str) -> str:
    subject = f"{n} robot of radius {radius:g} does" if n == 1 else f"{n} robots of radius {radius:g} do"
    return f"{subject} not fit on {where}: {fit} would; ask for fewer or a larger map"
