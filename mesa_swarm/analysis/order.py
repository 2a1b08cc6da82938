"""Order of motion: polarization, milling, alignment of neighbours."""

import math

import numpy as np
from scipy.spatial import cKDTree

from mesa_swarm.analysis.arrays import check_array, check_points
from mesa_swarm.errors import InvalidValueError, check_number

# Nearer to the centroid than this share of the coordinates' size, what is left of the distance is rounding.
ROUNDING = 1e-12


def directions(position_before: np.ndarray, position_after: np.ndarray) -> np.ndarray:
    """Return the azimuth in which every robot has travelled, which is not always where it heads.

    Parameters
    ----------
    position_before, position_after : ndarrays, shape (n, 2)
        Centres of the same robots at two times, map units.

    Returns
    -------
    ndarray, shape (n,)
        Radians in [-pi, pi), counter-clockwise from +x; NaN for a robot that has not moved.

    Raises
    ------
    InvalidValueError
        If an argument is not n finite points, or the two are not of one length.

    Examples
    --------
    >>> directions([[0, 0], [5, 5]], [[0, 2], [5, 5]])
    array([1.57079633,        nan])
    """
    before = check_points("position_before", position_before)
    after = check_points("position_after", position_after)
    _check_same_robots("position_after", after, "position_before", before)
    x, y = (after - before).T
    azimuth = np.arctan2(y, x)
    azimuth[azimuth >= math.pi] = -math.pi
    return np.where((x == 0) & (y == 0), math.nan, azimuth)


def polarization(heading: np.ndarray) -> float:
    """Return how far the robots point the same way: the length of the mean of their unit vectors.

    ``|mean((cos h_i, sin h_i))|`` (Vicsek et al. 1995, Novel type of phase transition in a system of
    self-driven particles, Phys. Rev. Lett. 75): 1 where all are parallel, 0 where they cancel out, about
    ``sqrt(pi / (4 n))`` for n random ones.

    Parameters
    ----------
    heading : ndarray, shape (n,)
        Radians. Headings, or `directions` of travel. NaN: no direction; that robot is left out.

    Returns
    -------
    float
        In [0, 1]; NaN where no robot has a direction.

    Raises
    ------
    InvalidValueError
        If `heading` is not n numbers, or one is infinite.

    Examples
    --------
    >>> import numpy as np
    >>> polarization([0.3, 0.3, np.nan])
    1.0
    >>> round(polarization([0.0, np.pi / 2]), 3)
    0.707
    """
    known = _azimuths(heading)
    known = known[~np.isnan(known)]
    if not len(known):
        return math.nan
    return min(math.hypot(np.cos(known).mean(), np.sin(known).mean()), 1.0)


def milling(position: np.ndarray, heading: np.ndarray) -> float:
    """Return how far the robots circle around their centroid the same way round.

    ``|mean(r_i x v_i)|`` with r_i the unit vector from the centroid to robot i and v_i the unit vector of its
    heading, the group's normalised angular momentum (Couzin et al. 2002, Collective memory and spatial sorting
    in animal groups, J. Theor. Biol. 218): 1 where all go round one way, 0 where they go straight or half of
    them each way. A robot at the centroid counts 0.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        Centres, map units. All robots make up the centroid.
    heading : ndarray, shape (n,)
        Radians. Headings, or `directions` of travel. NaN: no direction; that robot is left out of the mean.

    Returns
    -------
    float
        In [0, 1]; NaN where no robot has a direction.

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape, the two are not of one length, or a number is infinite.

    Examples
    --------
    >>> import numpy as np
    >>> milling([[1, 0], [0, 1], [-1, 0], [0, -1]], [np.pi / 2, np.pi, -np.pi / 2, 0])
    1.0
    """
    points, azimuth = check_points("position", position), _azimuths(heading)
    _check_same_robots("heading", azimuth, "position", points)
    known = ~np.isnan(azimuth)
    if not known.any():
        return math.nan
    out = _away_from_centroid(points)[known]
    spin = out[:, 0] * np.sin(azimuth[known]) - out[:, 1] * np.cos(azimuth[known])
    return min(abs(float(spin.mean())), 1.0)


def neighbour_alignment(position: np.ndarray, heading: np.ndarray, distance: float) -> float:
    """Return how far robots that are near each other point the same way, wherever others point.

    The mean of cos(h_i - h_j) over all pairs whose centres are at most `distance` apart: the equal-time
    correlation of directions within that distance (Cavagna et al. 2010, Scale-free correlations in starling
    flocks, PNAS 107). Where several flocks go different ways, `polarization` is near 0 and this is not.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        Centres, map units.
    heading : ndarray, shape (n,)
        Radians. Headings, or `directions` of travel. NaN: no direction; pairs with that robot are left out.
    distance : float
        Map units, above 0.

    Returns
    -------
    float
        In [-1, 1], about 0 for random headings; NaN where no two robots are near each other.

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape, the two are not of one length, or `distance` is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> neighbour_alignment([[0, 0], [10, 0], [500, 0], [510, 0]], [0, 0, np.pi, np.pi], 50)
    1.0
    """
    points, azimuth = check_points("position", position), _azimuths(heading)
    _check_same_robots("heading", azimuth, "position", points)
    pairs = cKDTree(points).query_pairs(check_number("distance", distance, above=0), output_type="ndarray")
    agreement = np.cos(azimuth[pairs[:, 0]] - azimuth[pairs[:, 1]])
    agreement = agreement[~np.isnan(agreement)]
    return float(agreement.mean()) if len(agreement) else math.nan


def _away_from_centroid(points: np.ndarray) -> np.ndarray:
    """Return unit vectors away from the centroid, zero for robots at the centroid."""
    away = points - points.mean(axis=0)
    length = np.hypot(*away.T)
    somewhere = length > ROUNDING * np.abs(points).max()
    return np.where(somewhere, 1.0 / np.where(somewhere, length, 1.0), 0.0)[:, None] * away


def _azimuths(heading: np.ndarray) -> np.ndarray:
    azimuth = check_array("heading", heading, ("n",), finite=False)
    if np.isinf(azimuth).any():
        raise InvalidValueError("heading holds an infinity; expected radians, or NaN for no direction")
    return azimuth


def _check_same_robots(name: str, array: np.ndarray, other_name: str, other: np.ndarray) -> None:
    if len(array) != len(other):
        raise InvalidValueError(f"{name} has {len(array)} robots; expected {len(other)}, as many as {other_name}")
