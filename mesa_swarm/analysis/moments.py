"""Measures of one moment as compiled functions, for measures and processes of arrays: nothing is checked."""

import math

import numpy as np

from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, direction_of, hypot

# Cosines of the angles that `chains` takes by default.
COSINE_OF_45, COSINE_OF_90 = math.cos(math.radians(45.0)), math.cos(math.radians(90.0))


@compiled
def group_sizes(position: np.ndarray, distance: float) -> np.ndarray:
    """Return how many robots each group has, a single robot being one: the groups of `clusters` with ``fewest=1``.

    Groups come in the order of their first robots. The time grows with the square of the number of robots.

    Parameters
    ----------
    position : float64 ndarray, shape (n, 2)
        Map units.
    distance : float
        Largest distance between the centres of two linked robots, map units.

    Returns
    -------
    int64 ndarray, shape (c,)

    Examples
    --------
    >>> group_sizes(np.array([[0.0, 0.0], [50.0, 0.0], [10.0, 0.0], [20.0, 0.0]]), 15.0)
    array([3, 1])
    """
    n, count = position.shape[0], 0
    found, waiting, sizes = np.zeros(n, np.bool_), np.empty(n, np.int64), np.zeros(n, np.int64)
    for first in range(n):
        if found[first]:
            continue
        found[first], waiting[0], last = True, first, 1
        while last > 0:
            last -= 1
            i = waiting[last]
            sizes[count] += 1
            for j in range(first + 1, n):
                if not found[j] and hypot(position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]) <= distance:
                    found[j], waiting[last] = True, j
                    last += 1
        count += 1
    return sizes[:count]


@compiled
def chain_lengths(position: np.ndarray, heading: np.ndarray, link_distance: float) -> np.ndarray:
    """Return how many robots each chain has: the chains of `chains`, for its angles by default, in no order.

    The time grows with the square of the number of robots.

    Parameters
    ----------
    position : float64 ndarray, shape (n, 2)
        Map units.
    heading : float64 ndarray, shape (n,)
        Radians.
    link_distance : float
        Largest distance between the centres of two robots that follow each other, map units.

    Returns
    -------
    int64 ndarray, shape (c,)
        Each at least 2.

    Examples
    --------
    >>> position = np.array([[20.0, 0.0], [10.0, 0.0], [0.0, 0.0], [35.0, 0.0]])
    >>> chain_lengths(position, np.array([0.0, 0.0, 0.0, np.pi]), 15.0)
    array([3])
    """
    n, count = heading.shape[0], 0
    follower = find_followers(position, heading, link_distance)
    follows, lengths = np.zeros(n, np.bool_), np.zeros(n, np.int64)
    for i in range(n):
        if follower[i] >= 0:
            follows[follower[i]] = True
    for rings in range(2):  # chains with a head first: what remains are rings
        for head in range(n):
            if follower[head] < 0 or (rings == 0 and follows[head]):
                continue
            length, i = 0, head
            while i >= 0:
                following = follower[i]
                length, follower[i], i = length + 1, -1, following
            lengths[count], count = length - (1 if rings == 1 else 0), count + 1
    return lengths[:count]


@compiled
def find_followers(position: np.ndarray, heading: np.ndarray, link_distance: float) -> np.ndarray:
    """Return the robot that follows each, -1 for none; see `chains`."""
    n = heading.shape[0]
    follower, least_gap = np.full(n, -1), np.full(n, math.inf)
    for i in range(n):
        cosine, sine = direction_of(heading[i])
        leader, gap = -1, math.inf
        for j in range(n):
            dx, dy = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
            distance = hypot(dx, dy)
            ahead = distance <= link_distance and dx * cosine + dy * sine >= COSINE_OF_45 * distance
            if j != i and ahead and distance < gap:
                leader, gap = j, distance
        if leader >= 0:
            leader_cosine, leader_sine = direction_of(heading[leader])
            same_way = cosine * leader_cosine + sine * leader_sine > COSINE_OF_90
            if same_way and gap < least_gap[leader]:
                follower[leader], least_gap[leader] = i, gap
    return follower


@compiled
def mean_gap(position: np.ndarray) -> float:
    """Return the mean distance of robots from the nearest other, between centres; NaN for fewer than two.

    Parameters
    ----------
    position : float64 ndarray, shape (n, 2)
        Map units.

    Examples
    --------
    >>> mean_gap(np.array([[0.0, 0.0], [10.0, 0.0], [40.0, 0.0]]))
    16.666666666666668
    """
    n, total = position.shape[0], 0.0
    for i in range(n):
        least = math.inf
        for j in range(n):
            if j != i:
                least = min(least, hypot(position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]))
        total += least
    return total / n if n > 1 else math.nan


@compiled
def order_of(heading: np.ndarray) -> float:
    """Return the length of the mean of unit vectors, as `polarization` does; NaN headings are left out.

    Parameters
    ----------
    heading : float64 ndarray, shape (n,)
        Radians.

    Examples
    --------
    >>> order_of(np.array([0.3, 0.3, np.nan])), round(order_of(np.array([0.0, np.pi / 2])), 3)
    (1.0, 0.707)
    """
    x, y, count = 0.0, 0.0, 0
    for azimuth in heading:
        if not math.isnan(azimuth):
            cosine, sine = direction_of(azimuth)
            x, y, count = x + cosine, y + sine, count + 1
    return min(hypot(x, y) / count, 1.0) if count > 0 else math.nan


@compiled
def alignment_within(position: np.ndarray, heading: np.ndarray, distance: float) -> float:
    """Return the mean cosine of the angles between robots that are near each other, as `neighbour_alignment` does.

    Parameters
    ----------
    position : float64 ndarray, shape (n, 2)
        Map units.
    heading : float64 ndarray, shape (n,)
        Radians; NaN for no direction: pairs with that robot are left out.
    distance : float
        Map units.

    Examples
    --------
    >>> alignment_within(np.array([[0.0, 0.0], [10.0, 0.0], [500.0, 0.0]]), np.array([0.0, 0.0, 3.0]), 50.0)
    1.0
    """
    total, count, n = 0.0, 0, position.shape[0]
    x, y = np.empty(n), np.empty(n)
    for i in range(n):
        x[i], y[i] = direction_of(heading[i]) if not math.isnan(heading[i]) else (math.nan, math.nan)
    for i in range(n):
        for j in range(i):
            dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
            cosine = x[i] * x[j] + y[i] * y[j]
            if dx * dx + dy * dy <= distance * distance and not math.isnan(cosine):
                total, count = total + cosine, count + 1
    return total / count if count > 0 else math.nan


@compiled
def travel_of(before: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the azimuth in which each robot has travelled, as `directions` does, rad; NaN for one at rest.

    Parameters
    ----------
    before, position : float64 ndarrays, shape (n, 2)
        Map units.

    Examples
    --------
    >>> travel_of(np.zeros((2, 2)), np.array([[0.0, 2.0], [0.0, 0.0]])).round(3)
    array([1.571,   nan])
    """
    azimuth = np.empty(position.shape[0])
    for i in range(azimuth.shape[0]):
        x, y = position[i, 0] - before[i, 0], position[i, 1] - before[i, 1]
        azimuth[i] = math.nan if x == 0.0 and y == 0.0 else atan2(y, x)
    return azimuth
