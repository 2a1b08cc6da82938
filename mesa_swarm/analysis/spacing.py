"""Spacing of robots: nearest neighbours, compared with random positions, and the swarm's extent."""

import math
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from mesa_swarm.analysis.arrays import check_points
from mesa_swarm.analysis.missing import Value, by_row, with_position, without_position
from mesa_swarm.base.errors import check_count, check_number


def nearest_neighbour_distances(position: np.ndarray) -> np.ndarray:
    """Return every robot's distance to the nearest other one.

    Parameters
    ----------
    position : ndarray, shape (n, 2) or (k, n, 2)
        Centres, map units; a table over time is measured row by row. NaN or masked: missing; others do not
        have it as a neighbour.

    Returns
    -------
    ndarray, shape (n,) or (k, n)
        Map units, at least 0; infinite for a lone robot, NaN for a missing one.

    Raises
    ------
    InvalidValueError
        If `position` has another shape or holds an infinity.

    Examples
    --------
    >>> nearest_neighbour_distances([[0, 0], [3, 4], [3, 6]])
    array([5., 2., 2.])
    """
    points = check_points("position", position, table=True)
    rows = points if points.ndim == 3 else points[None]
    distances = np.array([_nearest(row) for row in rows]).reshape(rows.shape[:2])
    return distances if points.ndim == 3 else distances[0]


def _nearest(points: np.ndarray) -> np.ndarray:
    """Return the distances of points of one moment, NaN for missing ones."""
    is_placed = ~without_position(points)
    if not is_placed.all():
        distances = np.full(len(points), math.nan)
        distances[is_placed] = _nearest(points[is_placed])
        return distances
    if len(points) < 2:
        return np.full(len(points), math.inf)
    return cKDTree(points).query(points, k=2)[0][:, 1]


def random_nearest_neighbour_distance(n: int, area: float) -> float:
    """Return the mean distance to the nearest neighbour of points at random.

    ``0.5 / sqrt(n / area)``, for a Poisson process without borders (Clark & Evans 1954, Distance to nearest
    neighbor as a measure of spatial relationships in populations, Ecology 35).

    Parameters
    ----------
    n : int
        Number of robots, at least 1.
    area : float
        Of their region, square map units, above 0.

    Returns
    -------
    float
        Map units, above 0.

    Raises
    ------
    InvalidValueError
        If an argument is out of range.

    Examples
    --------
    >>> random_nearest_neighbour_distance(100, 10_000)
    5.0
    """
    n, area = check_count("n", n, minimum=1), check_number("area", area, above=0.0)
    return 0.5 * math.sqrt(area / n)


def clark_evans(position: np.ndarray, area: float) -> Value:
    """Return the mean distance to the nearest neighbour, relative to that of points at random.

    ``R = mean(d_i) / (0.5 / sqrt(n / area))`` (Clark & Evans 1954, Ecology 35). 0: all in one place; below 1:
    clumped; 1: random; above 1: spread out, at most 2.149 (a triangular lattice). It is not corrected for
    the border, beyond which there are no neighbours: of few robots, random ones come out slightly above 1.

    Parameters
    ----------
    position : ndarray, shape (n, 2) or (k, n, 2)
        Centres, map units; a table over time is measured row by row. NaN or masked: missing; that robot is left out.
    area : float
        Of their region, square map units, above 0.

    Returns
    -------
    Measure, or Measures, shape (k,)
        At least 0; NaN for fewer than two robots. `missing`: robots left out.

    Raises
    ------
    InvalidValueError
        If `position` has another shape or holds an infinity, or `area` is not above 0.

    Examples
    --------
    >>> clark_evans([[0, 0], [0, 10], [10, 0], [10, 10]], 400)
    2.0
    """
    points = check_points("position", position, table=True)
    area = check_number("area", area, above=0.0)
    return by_row(partial(_clark_evans, area), points, missing=without_position(points))


def _clark_evans(area: float, points: np.ndarray) -> float:
    nearest = _nearest(*with_position(points))
    if len(nearest) < 2:
        return math.nan
    return float(nearest.mean()) / random_nearest_neighbour_distance(len(nearest), area)


def dispersion(position: np.ndarray) -> Value:
    """Return the root mean square distance of the robots from their centroid.

    ``sqrt(mean(|x_i - mean(x)|^2))``, the swarm's radius of gyration.

    Parameters
    ----------
    position : ndarray, shape (n, 2) or (k, n, 2)
        Centres, map units; a table over time is measured row by row. NaN or masked: missing; that robot is left out.

    Returns
    -------
    Measure, or Measures, shape (k,)
        Map units, at least 0; NaN without robots. `missing`: robots left out.

    Raises
    ------
    InvalidValueError
        If `position` has another shape or holds an infinity.

    Examples
    --------
    >>> dispersion([[0, 0], [6, 0], [0, 8], [6, 8]])
    5.0
    >>> dispersion([[[0, 0], [6, 0]], [[0, 0], [np.nan, np.nan]]])
    array([3., 0.]) (1 missing)
    """
    points = check_points("position", position, table=True)
    return by_row(_dispersion, points, missing=without_position(points))


def _dispersion(points: np.ndarray) -> float:
    (points,) = with_position(points)
    if not len(points):
        return math.nan
    return math.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
