"""Chains: robots that follow each other in a line (thesis 5.3.3), at one moment."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mesa_swarm.analysis.arrays import LARGEST_COORDINATE, check_array, check_headings
from mesa_swarm.analysis.missing import masked_where, without_position
from mesa_swarm.base.errors import InvalidValueError, check_number


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Chains:
    """Which robot follows which, and the resulting chains.

    `leader`, `label` and `place` are masked where robots are missing, if any are.

    Parameters
    ----------
    leader : int64 ndarray, shape (n,)
        Row of the robot that each one follows, -1 for none.
    label : int64 ndarray, shape (n,)
        Number of its chain, -1 for robots alone. Longer chains have smaller numbers; of equally long ones the
        one whose head has the smaller row.
    place : int64 ndarray, shape (n,)
        Position in its chain, counted from the head: 0 for a head, and for robots alone.
    lengths : int64 ndarray, shape (c,)
        Robots in each chain, descending, at least 2.
    closed : bool ndarray, shape (c,)
        Whether the chain is a ring, whose head follows its tail.
    """

    leader: np.ndarray
    label: np.ndarray
    place: np.ndarray
    lengths: np.ndarray
    closed: np.ndarray

    @property
    def missing(self) -> int:
        """The number of robots without a position or a heading."""
        return int(np.ma.count_masked(self.label))

    @property
    def count(self) -> int:
        """The number of chains, including rings."""
        return len(self.lengths)

    @property
    def mean_length(self) -> float:
        """Mean number of robots in a chain, NaN without chains."""
        return float(self.lengths.mean()) if self.count else math.nan

    @property
    def longest(self) -> int:
        """Robots in the longest chain, 0 without chains."""
        return int(self.lengths.max(initial=0))

    @property
    def chained(self) -> float:
        """Share of the robots that are in a chain, without missing ones; NaN where there are no robots."""
        label = np.ma.compressed(self.label)
        return float(np.mean(label >= 0)) if len(label) else math.nan

    def members(self) -> list[np.ndarray]:
        """Return the rows of each chain's robots from head to tail."""
        place, label = np.asarray(self.place), np.asarray(self.label)
        rows = np.lexsort((place, label))[np.count_nonzero(label < 0) :]
        return np.split(rows, np.cumsum(self.lengths)[:-1]) if self.count else []


def chains(
    position: np.ndarray,
    heading: np.ndarray,
    *,
    link_distance: float,
    half_angle_degrees: float = 45.0,
    alignment_degrees: float = 90.0,
) -> Chains:
    """Find the chains: paths of robots each of which has the next one before it.

    1. The robot *before* i is the nearest of those whose centres are within `link_distance` of i's centre and
       within `half_angle_degrees` of i's heading; of equally near ones the smaller row.
    2. i would follow j if j is before i and their headings differ by less than `alignment_degrees`: robots that
       face each other are not a chain. A robot with such a one before it follows none, not one farther away.
    3. Of those that would follow the same j only the nearest does; of equally near ones the smaller row. The
       others follow none.

    Each robot then follows at most one and is followed by at most one, so that each connected part is a path or
    a ring. A ring has no head by itself: it is opened at its longest link (of equally long ones at the follower
    with the smaller row), whose follower counts as the head.

    Parameters
    ----------
    position : ndarray, shape (n, 2), map units
    heading : ndarray, shape (n,), rad
        NaN or masked, as positions: missing; that robot follows none, and none follows it.
    link_distance : float
        Between centres, map units, above 0.
    half_angle_degrees : float
        0 to 180.
    alignment_degrees : float
        Above 0, at most 180.

    Returns
    -------
    Chains

    Raises
    ------
    InvalidValueError
        If an array has another shape or a parameter is out of its range.

    Warns
    -----
    DegreesWarning
        If a heading is beyond 4 pi.

    Examples
    --------
    Three robots that drive to the right, 2 at the tail, and one that comes towards them::

        2>  1>  0>      <3

    >>> found = chains([[20, 0], [10, 0], [0, 0], [35, 0]], [0, 0, 0, np.pi], link_distance=15)
    >>> found.leader, found.place, found.lengths
    (array([-1,  0,  1, -1]), array([0, 1, 2, 0]), array([3]))
    >>> found.label, found.chained
    (array([ 0,  0,  0, -1]), 0.75)
    """
    position = _check_moment(position)
    heading = check_headings("heading", heading, (len(position),))
    links = Links(distance=link_distance, half_angle_degrees=half_angle_degrees, alignment_degrees=alignment_degrees)
    leader, _ = links.between(position, heading)
    result, missing = paths(leader, position), without_position(position) | np.isnan(heading)
    rows = {name: masked_where(missing, getattr(result, name)) for name in ("leader", "label", "place")}
    return replace(result, **rows)


def _check_moment(position: object) -> np.ndarray:
    """Return the positions of one moment, NaN for missing ones; refuse those of several with the way out."""
    points = check_array("position", position, ("n", 2), ("k", "n", 2), missing=True)
    if points.ndim == 3:
        raise InvalidValueError(
            f"position has the shape {points.shape}; expected one moment, (n, 2): follow_chains takes tables over time"
        )
    return points


@dataclass(frozen=True, kw_only=True, slots=True)
class Links:
    """The conditions of a link; see `chains`."""

    distance: float
    half_angle_degrees: float = 45.0
    alignment_degrees: float = 90.0

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_number("link_distance", self.distance, above=0, maximum=LARGEST_COORDINATE)
        check_number("half_angle_degrees", self.half_angle_degrees, minimum=0, maximum=180)
        check_number("alignment_degrees", self.alignment_degrees, above=0, maximum=180)

    def between(self, position: np.ndarray, heading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which robot each one follows, or -1, and its distance (infinity for none)."""
        leader, gap = nearest_ahead(position, heading, self.distance, self.half_angle_degrees)
        follower = np.flatnonzero(leader >= 0)
        differ = heading[leader[follower]] - heading[follower]
        follower = follower[np.cos(differ) > math.cos(math.radians(self.alignment_degrees))]
        nearest, _ = _least_of_each(leader[follower], gap[follower], follower, len(leader))
        followed = np.flatnonzero(nearest >= 0)
        leader = np.full(len(leader), -1)
        leader[nearest[followed]] = followed
        return leader, np.where(leader >= 0, gap, math.inf)


def nearest_ahead(
    position: np.ndarray, heading: np.ndarray, reach: float, half_angle_degrees: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the row of the nearest robot within `reach` and an angle of each one's heading, and its distance.

    Without one, -1 and infinity; of equally near ones the smaller row. A robot without position or heading has none
    ahead, and is ahead of none.
    """
    rows = np.flatnonzero(~(without_position(position) | np.isnan(heading)))
    if len(rows) < len(position):
        nearest, distance = np.full(len(position), -1), np.full(len(position), math.inf)
        near, distance[rows] = nearest_ahead(position[rows], heading[rows], reach, half_angle_degrees)
        nearest[rows] = np.where(near >= 0, rows[near], -1)
        return nearest, distance
    if len(position) < 2:
        return np.full(len(position), -1), np.full(len(position), math.inf)
    first, second = cKDTree(position, balanced_tree=False).query_pairs(reach, output_type="ndarray").T
    dx, dy = (position[second] - position[first]).T
    distance, least = np.hypot(dx, dy), math.cos(math.radians(half_angle_degrees))
    unit_x, unit_y = np.cos(heading), np.sin(heading)
    sees = unit_x[first] * dx + unit_y[first] * dy >= least * distance
    is_seen = -unit_x[second] * dx - unit_y[second] * dy >= least * distance
    followers = np.concatenate([first[sees], second[is_seen]])
    leaders = np.concatenate([second[sees], first[is_seen]])
    distance = np.concatenate([distance[sees], distance[is_seen]])
    return _least_of_each(followers, distance, leaders, len(position))


def _least_of_each(group: np.ndarray, size: np.ndarray, row: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return for each of n groups the row of the least size, the smallest row of equal ones, and that size."""
    least = np.full(n, math.inf)
    np.minimum.at(least, group, size)
    candidate = size == least[group]
    best = np.full(n, np.iinfo(np.int64).max)
    np.minimum.at(best, group[candidate], row[candidate])
    return np.where(least < math.inf, best, -1), least


def paths(leader: np.ndarray, position: np.ndarray) -> Chains:
    """Return the paths and rings that leaders, -1 for none, and followers form.

    No robot is followed by two. Positions determine where rings are opened.
    """
    part = _parts(leader)
    ring = _rings(leader, part)
    head, place = _places(_open_rings(leader, position, part, ring))
    size = np.bincount(part, minlength=1)
    heads = np.flatnonzero((head == np.arange(len(head))) & (size[part] >= 2)) if len(head) else head
    heads = heads[np.lexsort((heads, -size[part[heads]]))]
    label_of_head = np.full(len(leader), -1)
    label_of_head[heads] = np.arange(len(heads))
    return Chains(leader=leader, label=label_of_head[head], place=place, lengths=size[part[heads]], closed=ring[heads])


def _parts(leader: np.ndarray) -> np.ndarray:
    """Return the number of each robot's connected part."""
    follower, n = np.flatnonzero(leader >= 0), len(leader)
    if not n:
        return leader
    graph = coo_array((np.ones(len(follower), np.int8), (follower, leader[follower])), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _rings(leader: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return which robots are in a part in which every robot follows one."""
    headed = np.zeros(len(leader), bool)
    headed[part[leader < 0]] = True
    return ~headed[part]


def _open_rings(leader: np.ndarray, position: np.ndarray, part: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """Return the leaders without the longest link of each ring."""
    opened, rows = leader.copy(), np.flatnonzero(ring)
    # The length of a link to a robot that is missing is not known.
    length = np.nan_to_num(np.hypot(*(position[leader[rows]] - position[rows]).T))
    longest, _ = _least_of_each(part[rows], -length, rows, len(leader))
    opened[longest[longest >= 0]] = -1
    return opened


def _places(leader: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the head of each robot's path and the number of links to it, in log2(n) rounds of doubling."""
    head = np.where(leader < 0, np.arange(len(leader)), leader)
    place = (leader >= 0).astype(np.int64)
    while (leader[head] >= 0).any():
        place += place[head]
        head = head[head]
    return head, place
