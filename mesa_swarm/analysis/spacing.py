"""Spacing of robots: nearest neighbours, compared with random positions, and the swarm's extent."""

import math

import numpy as np
from scipy.spatial import cKDTree

from mesa_swarm.analysis.arrays import check_points
from mesa_swarm.errors import check_count, check_number


def nearest_neighbour_distances(position: np.ndarray) -> np.ndarray:
    """Return every robot's distance to the nearest other one.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        Centres, map units.

    Returns
    -------
    ndarray, shape (n,)
        Map units, at least 0; infinite for a lone robot.

    Raises
    ------
    InvalidValueError
        If `position` is not n finite points.

    Examples
    --------
    >>> nearest_neighbour_distances([[0, 0], [3, 4], [3, 6]])
    array([5., 2., 2.])
    """
    points = check_points("position", position)
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


def clark_evans(position: np.ndarray, area: float) -> float:
    """Return the mean distance to the nearest neighbour, relative to that of points at random.

    ``R = mean(d_i) / (0.5 / sqrt(n / area))`` (Clark & Evans 1954, Ecology 35). 0: all in one place; below 1:
    clumped; 1: random; above 1: spread out, at most 2.149 (a triangular lattice). It is not corrected for
    the border, beyond which there are no neighbours: of few robots, random ones come out slightly above 1.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        Centres, map units.
    area : float
        Of their region, square map units, above 0.

    Returns
    -------
    float
        At least 0; NaN for fewer than two robots.

    Raises
    ------
    InvalidValueError
        If `position` is not n finite points or `area` is not above 0.

    Examples
    --------
    >>> clark_evans([[0, 0], [0, 10], [10, 0], [10, 10]], 400)
    2.0
    """
    nearest = nearest_neighbour_distances(position)
    area = check_number("area", area, above=0.0)
    if len(nearest) < 2:
        return math.nan
    return float(nearest.mean()) / random_nearest_neighbour_distance(len(nearest), area)


def dispersion(position: np.ndarray) -> float:
    """Return the root mean square distance of the robots from their centroid.

    ``sqrt(mean(|x_i - mean(x)|^2))``, the swarm's radius of gyration.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        Centres, map units.

    Returns
    -------
    float
        Map units, at least 0; NaN without robots.

    Raises
    ------
    InvalidValueError
        If `position` is not n finite points.

    Examples
    --------
    >>> dispersion([[0, 0], [6, 0], [0, 8], [6, 8]])
    5.0
    """
    points = check_points("position", position)
    if not len(points):
        return math.nan
    return math.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
