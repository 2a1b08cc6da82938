"""Order of motion: polarization, milling, alignment of neighbours."""

import math
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from mesa_swarm.analysis.arrays import check_headings, check_points
from mesa_swarm.analysis.missing import Value, by_row, with_position, without_position
from mesa_swarm.base.errors import InvalidValueError, check_number

# Nearer to the centroid than this share of the coordinates' size, what is left of the distance is rounding.
ROUNDING = 1e-12


def directions(position_before: np.ndarray, position_after: np.ndarray) -> np.ndarray:
    """Return the azimuth in which every robot has travelled, which is not always where it heads.

    Parameters
    ----------
    position_before, position_after : ndarrays, shape (n, 2) or (k, n, 2)
        Centres of the same robots at two times, or at k pairs of times, map units. NaN or masked: missing.

    Returns
    -------
    ndarray, shape (n,) or (k, n)
        Radians in [-pi, pi), counter-clockwise from +x; NaN for a robot that has not moved or is missing.

    Raises
    ------
    InvalidValueError
        If an argument has another shape or holds an infinity, or the two are not of one shape.

    Examples
    --------
    >>> directions([[0, 0], [5, 5]], [[0, 2], [5, 5]])
    array([1.57079633,        nan])
    """
    before = check_points("position_before", position_before, table=True)
    after = check_points("position_after", position_after, table=True)
    _check_same_robots("position_after", after[..., 0], "position_before", before[..., 0])
    x, y = np.moveaxis(after - before, -1, 0)
    azimuth = np.arctan2(y, x)
    azimuth[azimuth >= math.pi] = -math.pi
    return np.where((x == 0) & (y == 0), math.nan, azimuth)


def polarization(heading: np.ndarray) -> Value:
    """Return how far the robots point the same way: the length of the mean of their unit vectors.

    ``|mean((cos h_i, sin h_i))|`` (Vicsek et al. 1995, Novel type of phase transition in a system of
    self-driven particles, Phys. Rev. Lett. 75): 1 where all are parallel, 0 where they cancel out, about
    ``sqrt(pi / (4 n))`` for n random ones.

    Parameters
    ----------
    heading : ndarray, shape (n,) or (k, n)
        Radians. Headings, or `directions` of travel; a table over time is measured row by row. NaN or masked: no
        direction; that robot is left out.

    Returns
    -------
    Measure, or Measures, shape (k,)
        In [0, 1]; NaN where no robot has a direction. `missing`: robots left out.

    Raises
    ------
    InvalidValueError
        If `heading` has another shape, or a number is infinite.

    Warns
    -----
    DegreesWarning
        If a heading is beyond 4 pi.

    Examples
    --------
    >>> import numpy as np
    >>> polarization([0.3, 0.3, np.nan])
    1.0 (1 missing)
    >>> round(polarization([0.0, np.pi / 2]), 3)
    0.707
    >>> polarization([[0.3, 0.3], [0.0, np.pi]]).round(3)
    array([1., 0.])
    """
    azimuth = check_headings("heading", heading)
    return by_row(_polarization, azimuth, missing=np.isnan(azimuth))


def _polarization(azimuth: np.ndarray) -> float:
    is_missing = np.isnan(azimuth)
    if is_missing.any():
        azimuth = azimuth[~is_missing]
    if not len(azimuth):
        return math.nan
    return min(math.hypot(np.cos(azimuth).mean(), np.sin(azimuth).mean()), 1.0)


def milling(position: np.ndarray, heading: np.ndarray) -> Value:
    """Return how far the robots circle around their centroid the same way round.

    ``|mean(r_i x v_i)|`` with r_i the unit vector from the centroid to robot i and v_i the unit vector of its
    heading, the group's normalised angular momentum (Couzin et al. 2002, Collective memory and spatial sorting
    in animal groups, J. Theor. Biol. 218): 1 where all go round one way, 0 where they go straight or half of
    them each way. A robot at the centroid counts 0.

    Parameters
    ----------
    position : ndarray, shape (n, 2) or (k, n, 2)
        Centres, map units; a table over time is measured row by row. All robots that have a position make up the
        centroid. NaN or masked: missing; that robot is left out.
    heading : ndarray, shape (n,) or (k, n)
        Radians. Headings, or `directions` of travel. NaN or masked: no direction; that robot is left out of the mean.

    Returns
    -------
    Measure, or Measures, shape (k,)
        In [0, 1]; NaN where no robot has a position and a direction. `missing`: robots left out of the mean.

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape, the two are not of the same robots, or a number is infinite.

    Warns
    -----
    DegreesWarning
        If a heading is beyond 4 pi.

    Examples
    --------
    >>> import numpy as np
    >>> milling([[1, 0], [0, 1], [-1, 0], [0, -1]], [np.pi / 2, np.pi, -np.pi / 2, 0])
    1.0
    """
    points, azimuth, missing = _check_robots(position, heading)
    return by_row(_milling, points, azimuth, missing=missing)


def _milling(points: np.ndarray, azimuth: np.ndarray) -> float:
    points, azimuth = with_position(points, azimuth)
    goes = ~np.isnan(azimuth)
    if not goes.any():
        return math.nan
    out = _away_from_centroid(points)[goes]
    spin = out[:, 0] * np.sin(azimuth[goes]) - out[:, 1] * np.cos(azimuth[goes])
    return min(abs(float(spin.mean())), 1.0)


def neighbour_alignment(position: np.ndarray, heading: np.ndarray, distance: float) -> Value:
    """Return how far robots that are near each other point the same way, wherever others point.

    The mean of cos(h_i - h_j) over all pairs whose centres are at most `distance` apart: the equal-time
    correlation of directions within that distance (Cavagna et al. 2010, Scale-free correlations in starling
    flocks, PNAS 107). Where several flocks go different ways, `polarization` is near 0 and this is not.

    Parameters
    ----------
    position : ndarray, shape (n, 2) or (k, n, 2)
        Centres, map units; a table over time is measured row by row. NaN or masked: missing; pairs with that robot are
        left out.
    heading : ndarray, shape (n,) or (k, n)
        Radians. Headings, or `directions` of travel. NaN or masked: no direction; pairs with that robot are left out.
    distance : float
        Map units, above 0.

    Returns
    -------
    Measure, or Measures, shape (k,)
        In [-1, 1], about 0 for random headings; NaN where no two robots are near each other. `missing`: robots left
        out.

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape, the two are not of the same robots, or `distance` is not above 0.

    Warns
    -----
    DegreesWarning
        If a heading is beyond 4 pi.

    Examples
    --------
    >>> import numpy as np
    >>> neighbour_alignment([[0, 0], [10, 0], [500, 0], [510, 0]], [0, 0, np.pi, np.pi], 50)
    1.0
    """
    points, azimuth, missing = _check_robots(position, heading)
    distance = check_number("distance", distance, above=0)
    return by_row(partial(_neighbour_alignment, distance), points, azimuth, missing=missing)


def _neighbour_alignment(distance: float, points: np.ndarray, azimuth: np.ndarray) -> float:
    points, azimuth = with_position(points, azimuth)
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    agreement = np.cos(azimuth[pairs[:, 0]] - azimuth[pairs[:, 1]])
    agreement = agreement[~np.isnan(agreement)]
    return float(agreement.mean()) if len(agreement) else math.nan


def _away_from_centroid(points: np.ndarray) -> np.ndarray:
    """Return unit vectors away from the centroid, zero for robots at the centroid."""
    offsets = points - points.mean(axis=0)
    length = np.hypot(*offsets.T)
    somewhere = length > ROUNDING * np.abs(points).max()
    return np.where(somewhere, 1.0 / np.where(somewhere, length, 1.0), 0.0)[:, None] * offsets


def _check_robots(position: object, heading: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions and headings of the same robots, and which robots lack one of them."""
    points, azimuth = check_points("position", position, table=True), check_headings("heading", heading)
    _check_same_robots("heading", azimuth, "position", points[..., 0])
    return points, azimuth, without_position(points) | np.isnan(azimuth)


def _check_same_robots(name: str, array: np.ndarray, other_name: str, other: np.ndarray) -> None:
    """Refuse arrays that have not one number for each robot, and row, of the other."""
    if array.shape == other.shape:
        return
    if array.ndim == other.ndim == 1:
        raise InvalidValueError(f"{name} has {len(array)} robots; expected {len(other)}, as many as {other_name}")
    raise InvalidValueError(
        f"{name} is of rows and robots {array.shape}; expected {other.shape}, the same as those of {other_name}"
    )
