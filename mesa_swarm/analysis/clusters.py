"""Groups of robots that stand near each other."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mesa_swarm.analysis.arrays import check_length, check_points, check_whole_or_missing
from mesa_swarm.analysis.missing import Value, by_row, masked_where, without_position
from mesa_swarm.base.errors import InvalidValueError, check_count

# A pair takes about 50 bytes: more of them than this would fill a small machine's memory.
MOST_PAIRS = 20_000_000
# The number of pairs is estimated from one robot in this many.
SAMPLED = 16


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Clusters:
    """The groups of a swarm; build it with `clusters`.

    Parameters
    ----------
    label : int64 ndarray, shape (n,)
        Each robot's group, -1 for a robot in none. Groups are numbered from 0 by descending size, those of
        one size by their first robot's row. Masked where robots are missing, which shares and means leave out.
    sizes : int64 ndarray, shape (c,)
        Robots in each group, descending.
    """

    label: np.ndarray
    sizes: np.ndarray

    @property
    def missing(self) -> int:
        """The number of robots without a position."""
        return int(np.ma.count_masked(self.label))

    @property
    def robots(self) -> int:
        """The number of robots that have a position."""
        return len(self.label) - self.missing

    @property
    def count(self) -> int:
        """The number of groups."""
        return len(self.sizes)

    @property
    def grouped(self) -> int:
        """The number of robots in groups."""
        return int(self.sizes.sum())

    @property
    def largest_fraction(self) -> float:
        """Share of all robots that are in the largest group, in [0, 1]; 0 without groups."""
        return int(self.sizes[0]) / self.robots if self.count else 0.0

    @property
    def local_convergence(self) -> float:
        """Share of the grouped robots that are not in the largest group, in [0, 1).

        0 where one group holds all grouped robots, (c - 1) / c for c groups of one size: towards 1 the more
        groups a swarm has settled into instead of one. 0 too without groups: read it beside `alone`.
        """
        return 1.0 - int(self.sizes[0]) / self.grouped if self.count else 0.0

    @property
    def mean_size(self) -> float:
        """Mean number of robots in a group; 0 without groups."""
        return self.grouped / self.count if self.count else 0.0

    @property
    def own_size(self) -> float:
        """Mean over robots of the number of robots in its own group, a robot in no group being one; 0 without robots.

        It is never below `mean_size` where all robots are in groups: large groups hold more of the robots.

        Examples
        --------
        >>> clusters([[0, 0], [10, 0], [20, 0], [200, 0]], 15).own_size
        2.5
        """
        n = self.robots
        return float((self.sizes * self.sizes).sum() + n - self.grouped) / n if n else 0.0

    @property
    def alone(self) -> float:
        """Share of all robots that are in no group, in [0, 1]; 0 without robots."""
        return 1.0 - self.grouped / self.robots if self.robots else 0.0


def clusters(position: np.ndarray, distance: float, *, fewest: int = 2) -> Clusters:
    """Find the groups of robots that are linked by steps of at most `distance`.

    Two robots are linked where ``|x_i - x_j| <= distance``; a group is a connected component of the graph of
    links (single linkage; Sneath 1957, The application of computers to taxonomy). Which robots share a group
    does not depend on their order, nor on where the swarm is or how it is turned.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        Centres, map units. NaN or masked: missing; that robot is linked to none.
    distance : float
        Largest distance between the centres of two linked robots, map units, above 0. Robots of radius 5 with
        10 between their bodies are 20 apart.
    fewest : int
        The fewest robots of a group, at least 1.

    Returns
    -------
    Clusters

    Raises
    ------
    InvalidValueError
        If an argument has the wrong shape or is out of range, or more than about 20 million pairs of
        robots are linked.

    Examples
    --------
    >>> found = clusters([[0, 0], [10, 0], [20, 0], [200, 0], [210, 0], [500, 0]], 15)
    >>> found.label
    array([ 0,  0,  0,  1,  1, -1])
    >>> found.count, found.largest_fraction, round(found.local_convergence, 3)
    (2, 0.5, 0.4)
    """
    points = _check_moment(position)
    fewest = check_count("fewest", fewest, minimum=1)
    missing = without_position(points)
    component = _components(points[~missing] if missing.any() else points, check_length("distance", distance))
    label = np.full(len(points), -1, np.int64)
    label[~missing], sizes = _rank(component, fewest)
    return Clusters(label=masked_where(missing, label), sizes=sizes)


def _check_moment(position: object) -> np.ndarray:
    """Return the positions of one moment, NaN for missing ones; refuse those of several with the way out."""
    points = check_points("position", position, table=True)
    if points.ndim == 3:
        raise InvalidValueError(
            f"position has the shape {points.shape}; expected one moment, (n, 2): [clusters(row, ...) for row in "
            "position]"
        )
    return points


def _components(points: np.ndarray, distance: float) -> np.ndarray:
    n = len(points)
    if not n:
        return np.empty(0, np.int64)
    # Unbalanced trees are quicker to build, and positions even enough for them.
    tree = cKDTree(points, balanced_tree=False)
    _check_pairs(tree, distance)
    i, j = tree.query_pairs(distance, output_type="ndarray").T
    links = coo_array((np.ones(len(i), bool), (i, j)), shape=(n, n))
    return connected_components(links, directed=False)[1]


def _check_pairs(tree: cKDTree, distance: float) -> None:
    """Refuse a number of pairs that would fill the memory, estimated from a sample of robots."""
    sample = tree.data[::SAMPLED]
    others = tree.query_ball_point(sample, distance, return_length=True).mean() - 1
    pairs = int(others * tree.n / 2)
    if pairs > MOST_PAIRS:
        raise InvalidValueError(
            f"distance is {distance:g}, which links about {pairs} pairs of {tree.n} robots; expected at most "
            f"{MOST_PAIRS}: give a smaller distance"
        )


def _rank(component: np.ndarray, fewest: int) -> tuple[np.ndarray, np.ndarray]:
    """Rank the components of at least `fewest` robots by size, then by first row; return labels and sizes."""
    size = np.bincount(component)
    first = np.empty(len(size), np.int64)
    # Of several values written to one place the last stays: backwards, that of the first row.
    first[component[::-1]] = np.arange(len(component))[::-1]
    order = np.lexsort((first, -size))
    order = order[size[order] >= fewest]
    rank = np.full(len(size), -1, np.int64)
    rank[order] = np.arange(len(order))
    return rank[component], size[order]


def kept_together(before: np.ndarray, after: np.ndarray) -> Value:
    """Return the share of pairs of robots that stay in one group: the cohesion of groups over time.

    Of all pairs of robots that were in the same group, the share that is in the same group later (the
    precision with which the earlier partition predicts the later one: Rand 1971, J. Am. Stat. Assoc. 66).

    Parameters
    ----------
    before, after : ndarrays, shape (n,) or (k, n)
        Number of each robot's group at two times, or at k pairs of times, -1 for none: `Clusters.label`,
        `Chains.label`, or `ChainHistory.chain`. Numbers need not be the same at both times. NaN or masked at either
        time: missing; that robot is left out.

    Returns
    -------
    Measure, or Measures, shape (k,)
        In [0, 1]; NaN where no two robots were in one group. `missing`: robots left out.

    Raises
    ------
    InvalidValueError
        If the two are not whole numbers of one shape.

    Examples
    --------
    Of two groups of two, one is still together::

    >>> kept_together([0, 0, 1, 1, -1], [5, 5, 5, -1, -1])
    0.5
    """
    old, missing_before = check_whole_or_missing("before", before, ("n",), ("k", "n"))
    new, missing_after = check_whole_or_missing("after", after, old.shape)
    return by_row(_kept_together, old, new, missing_before | missing_after, missing=missing_before | missing_after)


def _kept_together(old: np.ndarray, new: np.ndarray, missing: np.ndarray) -> float:
    old, new = old[~missing], new[~missing]
    pairs = _pairs_within(old[old >= 0])
    both = (old >= 0) & (new >= 0)
    # A pair is together at both times if it shares both numbers: count the robots with each pair of numbers.
    _, joint = np.unique(np.column_stack([old[both], new[both]]), axis=0, return_inverse=True)
    return _pairs_within(joint.ravel()) / pairs if pairs else math.nan


def _pairs_within(label: np.ndarray) -> int:
    """Return the number of pairs that share a label."""
    counts = np.unique(label, return_counts=True)[1]
    return int((counts * (counts - 1) // 2).sum())
