"""Which of the robots with which an episode began are still in its world."""

import numpy as np
from numpy.typing import NDArray

from mesa_swarm.errors import SwarmError
from mesa_swarm.robots.swarm import Swarm

NONE_GONE: NDArray[np.int64] = np.empty(0, np.int64)


class Roster:
    """The robots with which an episode began, numbered by their first rows; they may be removed, but none be added.

    Parameters
    ----------
    swarm : Swarm
        As it is when the episode begins.

    Attributes
    ----------
    ids : int64 ndarray, shape (rows,)
        The unique_id of the robot in each row.
    numbers : int64 ndarray, shape (rows,)
        The number of the robot in each row, ascending.
    complete : bool
        Whether all robots are still there.
    """

    def __init__(self, swarm: Swarm) -> None:
        self.ids = swarm.unique_ids
        self._begun = len(self.ids)
        self.numbers = np.arange(self._begun)
        self.complete = True

    def gone(self, swarm: Swarm) -> NDArray[np.int64]:
        """Return the rows of robots that were removed since the last `drop`, as they were numbered before.

        Raises
        ------
        SwarmError
            If robots were added.
        """
        ids = swarm.unique_ids
        if np.array_equal(ids, self.ids):
            self.ids = ids
            return NONE_GONE
        added = np.setdiff1d(ids, self.ids)
        if len(added):
            raise SwarmError(
                f"robot {added[0]} was added to the world of an episode, which keeps the robots with which it began; "
                "give the task more by n_robots, or add none"
            )
        return np.flatnonzero(~np.isin(self.ids, ids))

    def drop(self, rows: NDArray[np.int64]) -> None:
        """Note that the robots of these rows were removed."""
        self.ids = np.delete(self.ids, rows)
        self.numbers = np.delete(self.numbers, rows)
        self.complete = len(self.numbers) == self._begun

    def remaining(self, first: int) -> int:
        """Return how many of the first robots are still there; they have the first rows."""
        return first if self.complete else int(np.searchsorted(self.numbers, first))

    def present(self, first: int) -> NDArray[np.bool_]:
        """Return which of the first robots are still there."""
        there = np.zeros(first, np.bool_)
        there[self.numbers[: self.remaining(first)]] = True
        return there

    def spread(self, rows: np.ndarray, out: np.ndarray) -> None:
        """Write rows of robots to the places of their numbers, as many as `out` has room for; 0 for removed robots."""
        k = self.remaining(len(out))
        if not self.complete:
            out[:] = 0
            out[self.numbers[:k]] = rows[:k]
        else:
            out[:] = rows[:k]
