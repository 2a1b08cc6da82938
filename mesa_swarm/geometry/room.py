"""Where the centre of a disc may be, among solid things and within bounds, as Shapely geometries."""

import math
from collections.abc import Sequence

import numpy as np
import shapely

from mesa_swarm.errors import InvalidValueError, shortened

Bounds = tuple[float, float, float, float]


def outside(quarter_segments: int) -> float:
    """Return by how much a polygon's corners lie farther out than the circle that it is drawn around.

    Examples
    --------
    >>> round(outside(16), 4)
    1.0012
    """
    return 1.0 / math.cos(math.pi / (4 * quarter_segments))


def room_for_disc(
    bounds: Bounds, solids: Sequence[tuple[shapely.Geometry, float]], radius: float, quarter_segments: int
) -> shapely.Geometry:
    """Return where the centre of a disc may be without overlapping anything solid.

    A buffer is a polygon: it is drawn around the circle, not inside it, so that nothing counts as free that
    is not.

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
        If a solid is no valid Shapely geometry.

    Examples
    --------
    >>> room_for_disc((0, 0, 100, 50), [], 5.0, 16).area
    3600.0
    """
    x_min, y_min, x_max, y_max = bounds
    geometries, radii = zip(*solids, strict=True) if solids else ((), ())
    _check_valid(geometries)
    if x_max - x_min <= 2 * radius or y_max - y_min <= 2 * radius:
        return shapely.Polygon()
    inner = shapely.box(x_min + radius, y_min + radius, x_max - radius, y_max - radius)
    if not solids:
        return inner
    grown = shapely.buffer(
        geometries, (np.array(radii) + radius) * outside(quarter_segments), quad_segs=quarter_segments
    )
    return inner.difference(shapely.union_all(grown))


def _check_valid(geometries: Sequence[object]) -> None:
    for geometry in geometries:
        if not (shapely.is_geometry(geometry) and shapely.is_valid(geometry)):
            raise InvalidValueError(f"solids holds {shortened(geometry)}; expected valid Shapely geometries")


def part_around(space: shapely.Geometry, point: np.ndarray, slack: float) -> shapely.Geometry | None:
    """Return the connected part of a space that holds a point or is within `slack` of it, else None.

    Examples
    --------
    >>> two = shapely.union_all([shapely.box(0, 0, 1, 1), shapely.box(5, 0, 7, 1)])
    >>> part_around(two, (6.0, 0.5), 0.0).area
    2.0
    """
    if space.is_empty:
        return None
    parts = shapely.get_parts(space)
    distance = shapely.distance(parts, shapely.Point(point))
    nearest = distance.argmin()
    return parts[nearest] if distance[nearest] <= slack else None


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
