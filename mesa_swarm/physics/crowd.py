"""The robots in the order of cells: those near each other are near each other in memory."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.geometry.grid import sort_into_cells
from mesa_swarm.physics.separation import near_pairs

PAIRS_PER_ROBOT, FEWEST_PAIRS = 2, 64


class Crowd:
    """Copies of the columns that neighbours need, in the order of cells, and the pairs of robots near each other.

    Row p is the robot in row ``order[p]`` of the swarm; cell c of the grid holds rows ``start[c]`` to
    ``start[c + 1]``. Within a cell they ascend by row of the swarm, so that the order follows from the places alone.

    Attributes
    ----------
    cells : tuple
        `Grid.numbers`.
    start, order : int64 ndarrays, shapes (cells + 1,), (n,)
    listed : ndarray, shape (n, 2)
        The places at which they were sorted.
    radii : ndarray, shape (n,)
    sorted : tuple
        What `sort_by_cell` writes: start, order, the cell of each, listed, radii and numbers.
    pairs : int64 ndarray, shape (m, 2)
        The pairs that were within the margin there.
    arrays : tuple
        What `travel` takes: order, places, those before a piece, radii, numbers, which are free of static bodies, their
        contacts (kind, index, normal, depth, face), and 0 to n - 1.
    """

    def __init__(self, cells: tuple, count: int, n: int) -> None:
        self.cells = cells
        self.start, self.order, self._cell_of = np.zeros(count + 1, np.int64), np.arange(n), np.zeros(n, np.int64)
        self.listed, self.radii, self._numbers = np.zeros((n, 2)), np.zeros(n), np.zeros(n, np.int64)
        self.pairs = np.empty((0, 2), np.int64)
        self._rooms: dict[int, np.ndarray] = {}
        contacts = np.full(n, -1), np.full(n, -1), np.zeros((n, 2)), np.zeros(n), np.zeros((n, 3))
        self.sorted = self.start, self.order, self._cell_of, self.listed, self.radii, self._numbers
        places, before, free = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n, np.bool_)
        self.arrays: tuple[Any, ...] = (
            *(self.order, places, before, self.radii, self._numbers, free),
            contacts,
            np.arange(n),
        )

    def sort(self, position: np.ndarray, radius: np.ndarray, number: np.ndarray) -> None:
        """Sort the robots by the cells in which they are now."""
        sort_by_cell(position, radius, number, self.cells, *self.sorted)

    def list_pairs(self, margin: float) -> None:
        """List the pairs within this margin of each other."""
        self.pairs = near_pairs(self.listed, self.radii, margin, self.cells)

    def pairs_from(self, first: int, last: int, find: Callable[..., int], *given: Any) -> np.ndarray:
        """Return the pairs of rows [first, last): ``find(first, last, room, *given)`` writes them.

        It returns how many there are, also where there is not room for all.
        """
        room = self._rooms.get(first)
        if room is None:
            room = np.empty((FEWEST_PAIRS + PAIRS_PER_ROBOT * (last - first), 2), np.int64)
        while (count := find(first, last, room, *given)) >= len(room):
            room = np.empty((FEWEST_PAIRS + 2 * count, 2), np.int64)
        self._rooms[first] = room
        return room[:count]


@compiled
def sort_by_cell(position, radius, number, cells, start, order, cell_of, places, radii, numbers):
    """Sort robots by cell, and copy their places, radii and numbers in that order."""
    sort_into_cells(position, cells, start, order, cell_of)
    for p in range(order.shape[0]):
        i = order[p]
        places[p, 0], places[p, 1] = position[i, 0], position[i, 1]
        radii[p], numbers[p] = radius[i], number[i]
