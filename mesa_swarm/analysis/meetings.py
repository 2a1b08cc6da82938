"""Head-on meetings of two robots, and what became of them."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.analysis.chain_events import Event
from mesa_swarm.analysis.chains import FARTHEST, nearest_ahead
from mesa_swarm.errors import check_count, check_number

OUTCOMES = ("merged", "dispersed", "unresolved")


@dataclass(frozen=True, kw_only=True, slots=True)
class Meetings:
    """What counts as a meeting, and as its outcome; see `chain_history.follow_chains`.

    Examples
    --------
    >>> Meetings(distance=40).angle_degrees
    20.0
    """

    distance: float = 50.0
    angle_degrees: float = 20.0
    parting_distance: float = 75.0
    window: int = 200
    patience: int = 5

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_number("meeting_distance", self.distance, above=0, maximum=FARTHEST)
        check_number("meeting_angle_degrees", self.angle_degrees, minimum=0, maximum=90)
        check_number("parting_distance", self.parting_distance, minimum=self.distance, maximum=FARTHEST)
        check_count("window", self.window)
        check_count("patience", self.patience, minimum=1)

    def find(self, position: np.ndarray, heading: np.ndarray, chain: np.ndarray) -> list[tuple[int, int, int]]:
        """Return (frame, row, row) of every meeting.

        Parameters
        ----------
        position : ndarray, shape (k, n, 2)
        heading : ndarray, shape (k, n)
        chain : int64 ndarray, shape (k, n)
            Number of each robot's chain, -1 for none.
        """
        found, near = [], np.empty((0, 2), np.int64)
        for frame in range(1, len(position)):
            near = near[distances(position[frame], near) <= self.parting_distance]
            pairs = facing_pairs(position[frame], heading[frame], self.distance, self.angle_degrees)
            first, second = pairs.T
            closing = distances(position[frame], pairs) < distances(position[frame - 1], pairs)
            apart = (chain[frame, first] != chain[frame, second]) | (chain[frame, first] < 0)
            known = (pairs[:, None] == near).all(axis=2).any(axis=1)
            new = pairs[closing & apart & ~known]
            found += [(frame, int(i), int(j)) for i, j in new]
            near = np.concatenate([near, new])
        return found

    def outcome(self, meeting: tuple[int, int, int], steps: np.ndarray, position: np.ndarray, chain: np.ndarray) -> str:
        """Return what became of a meeting, one of `OUTCOMES`: what came first.

        Examples
        --------
        >>> position = np.array([[[0.0, 0], [40, 0]], [[0, 0], [20, 0]], [[0, 0], [90, 0]]])
        >>> Meetings().outcome((1, 0, 1), np.arange(3), position, np.full((3, 2), -1))
        'dispersed'
        """
        frame, i, j = meeting
        last = int(np.searchsorted(steps, steps[frame] + self.window, side="right"))
        together = (chain[frame:, i] == chain[frame:, j]) & (chain[frame:, i] >= 0)
        merged = first_run(together, self.patience)
        gap = np.hypot(*(position[frame:last, i] - position[frame:last, j]).T)
        parted = first_run(gap > self.parting_distance, 1)
        if min(merged, parted) >= last - frame:
            return "unresolved"
        return "merged" if merged < parted else "dispersed"


def facing_pairs(position: np.ndarray, heading: np.ndarray, reach: float, angle_degrees: float) -> np.ndarray:
    """Return the pairs (m, 2) of robots each of which is the nearest one dead ahead of the other.

    Examples
    --------
    >>> facing_pairs(np.array([[0.0, 0], [30, 0], [45, 0]]), np.array([0.0, np.pi, np.pi]), 50.0, 20.0)
    array([[0, 1]])
    """
    nearest, _ = nearest_ahead(position, heading, reach, angle_degrees)
    rows = np.flatnonzero(nearest > np.arange(len(nearest)))
    rows = rows[nearest[nearest[rows]] == rows]
    return np.column_stack([rows, nearest[rows]])


def distances(position: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return how far apart the robots of each pair (m, 2) are.

    Examples
    --------
    >>> distances(np.array([[0.0, 0], [3, 4]]), np.array([[0, 1]]))
    array([5.])
    """
    return np.hypot(*(position[pairs[:, 0]] - position[pairs[:, 1]]).T)


def first_run(mask: np.ndarray, length: int) -> int:
    """Return where the first run of at least so many true values begins, len(mask) if there is none.

    Examples
    --------
    >>> first_run(np.array([True, False, True, True]), 2)
    2
    """
    if length > len(mask):
        return len(mask)
    full = np.lib.stride_tricks.sliding_window_view(mask, length).all(axis=1)
    return int(full.argmax()) if full.any() else len(mask)


def meeting_event(meeting: tuple[int, int, int], steps: np.ndarray, chain: np.ndarray) -> Event:
    """Return a meeting as an event; its chains are those of which the two are.

    Examples
    --------
    >>> meeting_event((0, 0, 1), np.array([7]), np.array([[4, -1]]))
    Event(kind='meeting', step=7, robots=(0, 1), chains=(4,))
    """
    frame, *robots = meeting
    chains = {int(chain[frame, robot]) for robot in robots} - {-1}
    return Event(kind="meeting", step=int(steps[frame]), robots=tuple(robots), chains=tuple(sorted(chains)))
