"""Reachable cells of a world, and the share of them that was visited."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from mesa_swarm.analysis.arrays import check_bounds, check_flags, check_length, check_points
from mesa_swarm.analysis.missing import Measure, Measures, without_position
from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.free_room import (
    areas_by_cell,
    cells_of_nearest_parts,
    circumscribed_ratio,
    find_part_around,
    room_for_disc,
)

# Corners of a quarter circle of a grown body: its outline is at most 7.6e-5 of its radius too far out.
QUARTER_SEGMENTS = 64
# How much two bodies that touch may overlap, relative to a robot's radius (PHYSICS 4).
TOUCH = 1e-6
MOST_CELLS_A_SIDE = 1000
# A cell counts where free space covers more of it than this: slivers are hardly ever met.
FEWEST_SHARE = 0.01


def reachable_cells(
    bounds: Bounds,
    solids: Sequence[tuple],
    radius: float,
    start: Sequence[float],
    cells: tuple[int, int] = (40, 40),
    *,
    fewest_share: float = FEWEST_SHARE,
) -> np.ndarray:
    """Return which cells of a world the centre of a disc can reach from its start.

    Free space is the bounds shrunk by `radius`, less the solids grown by it; what can be reached is the
    connected part of it around `start`; a cell counts where that part covers more than `fewest_share` of it.

    Grown bodies are polygons of 256 corners drawn around the true outline, so that nothing counts as free that
    is not: an outline of radius R is at most 7.6e-5 R too far out, and a gap that is less than twice that wider
    than the robot counts as closed. So does one that is exactly as wide.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max)
        Of the world, map units.
    solids : sequence of (geometry, radius)
        Shapely geometries of the obstacles, each grown by a radius of at least 0: a disc is
        a Point and its radius, a polygon has 0.
    radius : float
        The robot's, map units, above 0.
    start : (x, y)
        A place where the robot fits; touching is allowed.
    cells : (rows, columns)
        Of equal cells that the bounds are cut into, 1 to 1000 each.
    fewest_share : float
        0 to 0.99. 0 counts every cell that the robot's centre gets into at all; the default leaves out slivers
        that a random walk hardly meets.

    Returns
    -------
    bool ndarray, shape (rows, columns)
        Row 0 is at y_min, column 0 at x_min.

    Raises
    ------
    InvalidValueError
        If an argument is out of range, a solid is not a Shapely geometry, or the robot does not fit at `start`.

    Examples
    --------
    >>> import shapely
    >>> wall = shapely.box(45, 0, 55, 100)
    >>> reachable_cells((0, 0, 100, 100), [(wall, 0.0)], 5.0, (20, 20), cells=(2, 4))
    array([[ True,  True, False, False],
           [ True,  True, False, False]])
    """
    x_min, y_min, x_max, y_max = limits = check_bounds(bounds)
    radius, place = check_length("radius", radius), check_points("start", start, (2,))
    rows, columns = _check_shape("cells", cells)
    fewest_share = check_number("fewest_share", fewest_share, minimum=0.0, maximum=0.99)
    parts = _check_solids(solids)
    space = room_for_disc(limits, parts, radius, QUARTER_SEGMENTS)
    widest = radius + max((grown for _, grown in parts), default=0.0)
    part = find_part_around(space, place, TOUCH * radius + (circumscribed_ratio(QUARTER_SEGMENTS) - 1.0) * widest)
    if part is None:
        x, y = place
        raise InvalidValueError(f"start is ({x:g}, {y:g}), where a robot of radius {radius:g} does not fit")
    cell = (x_max - x_min) * (y_max - y_min) / (rows * columns)
    return areas_by_cell(part, limits, rows, columns) > fewest_share * cell


def cells_from_places(
    bounds: Bounds, solids: Sequence[tuple], radius: float, places: np.ndarray, cells: tuple[int, int] = (40, 40)
) -> np.ndarray:
    """Return which cells of a world the centres of discs can reach from any of several places.

    They are those of `reachable_cells`, and those in which the places are. The free space of the last few hundred
    worlds is remembered: many episodes on one map cost hardly more than one.

    Parameters
    ----------
    bounds, solids, radius, cells
        As for `reachable_cells`.
    places : ndarray, shape (n, 2)
        Where discs fit, map units, within the bounds.

    Returns
    -------
    bool ndarray, shape (rows, columns)
        Row 0 is at y_min, column 0 at x_min.

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape or is out of range, or a place lies outside the bounds.

    Examples
    --------
    >>> import shapely
    >>> wall = shapely.box(45, 0, 55, 100)
    >>> cells_from_places((0, 0, 100, 100), [(wall, 0.0)], 5.0, [[80, 20], [80, 30]], cells=(2, 4))
    array([[False, False,  True,  True],
           [False, False,  True,  True]])
    """
    limits, shape = check_bounds(bounds), _check_shape("cells", cells)
    places = _check_inside(check_points("positions", places), limits)
    reached = _cells_of(places, limits, shape)
    radius, parts = check_length("radius", radius), tuple(_check_solids(solids))
    return reached | cells_of_nearest_parts(limits, parts, radius, QUARTER_SEGMENTS, places, shape, FEWEST_SHARE)


def visited_cells(positions: np.ndarray, bounds: Bounds, shape: tuple[int, int]) -> Measures:
    """Return which cells of a world any of the positions is in.

    Parameters
    ----------
    positions : ndarray, shape (k, 2) or (k, n, 2)
        Centres over k steps, of one robot or of n, map units, within the bounds. A point between two cells is in
        the upper or right one. NaN or masked: missing, and in none.
    bounds : (x_min, y_min, x_max, y_max)
    shape : (rows, columns)
        Of equal cells that the bounds are cut into.

    Returns
    -------
    bool Measures, shape (rows, columns)
        Row 0 is at y_min, column 0 at x_min. `missing`: positions left out.

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape or is out of range, or a position lies outside the bounds.

    Examples
    --------
    >>> visited_cells([[10, 10], [90, 10]], (0, 0, 100, 50), (1, 4))
    array([[ True, False, False,  True]])
    """
    limits, cells = check_bounds(bounds), _check_shape("shape", shape)
    points, missing = _flatten(positions)
    return Measures.of(_cells_of(_check_inside(points, limits), limits, cells), missing)


def _cells_of(points: np.ndarray, limits: Bounds, shape: tuple[int, int]) -> np.ndarray:
    """Return which cells any of the points is in, which are within the limits."""
    rows, columns = shape
    lower, upper = np.array(limits[:2]), np.array(limits[2:])
    cell = ((points - lower) / (upper - lower) * (columns, rows)).astype(int)
    column, row = np.clip(cell, 0, (columns - 1, rows - 1)).T
    is_visited = np.zeros((rows, columns), bool)
    is_visited[row, column] = True
    return is_visited


def coverage(positions: np.ndarray, cells: np.ndarray, bounds: Bounds) -> Measure:
    """Return the share of the reachable cells that any of the positions is in.

    Parameters
    ----------
    positions : ndarray, shape (k, 2) or (k, n, 2)
        Centres over k steps, of one robot or of n, map units. NaN or masked: missing, and in no cell, as those are that
        lie outside the bounds.
    cells : bool ndarray, shape (rows, columns)
        Which cells can be reached, from `reachable_cells`; at least one.
    bounds : (x_min, y_min, x_max, y_max)
        The same as there.

    Returns
    -------
    Measure
        In [0, 1]. `missing` and `outside`: positions that were missing, and that lie outside the bounds.

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape or is out of range, or no cell can be reached.

    Examples
    --------
    >>> cells = [[True, True, False, True]]
    >>> coverage([[10, 10], [90, 10]], cells, (0, 0, 100, 50))
    0.6666666666666666
    >>> coverage([[10, 10], [90, 10], [120, 10]], cells, (0, 0, 100, 50))
    0.6666666666666666 (1 outside)
    """
    reachable = check_flags("cells", cells, ("rows", "columns"))
    if not reachable.any():
        raise InvalidValueError("cells has no reachable cell; expected at least one that is True")
    limits, shape = check_bounds(bounds), _check_shape("shape", reachable.shape)
    points, missing = _flatten(positions)
    is_beyond = _is_beyond(points, limits)
    is_visited = _cells_of(points[~is_beyond] if is_beyond.any() else points, limits, shape)
    share = int((is_visited & reachable).sum()) / int(reachable.sum())
    return Measure(share, missing, int(is_beyond.sum()))


def _check_shape(name: str, shape: object) -> tuple[int, int]:
    if not isinstance(shape, Sequence) or isinstance(shape, str) or len(shape) != 2:
        raise InvalidValueError(f"{name} is {shortened(shape)}; expected two whole numbers (rows, columns)")
    rows, columns = (
        check_count(f"{name}' {word}", number, minimum=1, maximum=MOST_CELLS_A_SIDE)
        for word, number in zip(("rows", "columns"), shape, strict=True)
    )
    return rows, columns


def _check_solids(solids: object) -> list[tuple]:
    """Return pairs of a geometry, which `room_for_disc` checks, and a radius."""
    if not isinstance(solids, Iterable):
        raise InvalidValueError(f"solids is {shortened(solids)}; expected a list of (geometry, radius)")
    discs = []
    for solid in solids:
        if not isinstance(solid, Sequence) or len(solid) != 2:
            raise InvalidValueError(f"solids holds {shortened(solid)}; expected pairs of (geometry, radius)")
        discs.append((solid[0], check_number("a solid's radius", solid[1], minimum=0.0)))
    return discs


def _flatten(positions: Any) -> tuple[np.ndarray, int]:
    """Return all positions that are there as one list of points, and the number of missing ones."""
    points = check_points("positions", positions, ("k", 2), ("k", "n", 2), missing=True).reshape(-1, 2)
    missing = without_position(points)
    return (points[~missing] if missing.any() else points), int(missing.sum())


def _is_beyond(points: np.ndarray, limits: Bounds) -> np.ndarray:
    """Return which points lie outside the bounds."""
    # Bodies may overlap the border by a hair, and so may a point robot's centre.
    slack = TOUCH * max(limits[2] - limits[0], limits[3] - limits[1])
    return np.maximum(limits[:2] - points, points - limits[2:]).max(axis=1, initial=-np.inf) > slack


def _check_inside(points: np.ndarray, limits: Bounds) -> np.ndarray:
    is_beyond = _is_beyond(points, limits)
    if is_beyond.any():
        x, y = points[is_beyond][0]
        raise InvalidValueError(f"positions holds ({x:g}, {y:g}); expected points within the bounds {limits}")
    return points
