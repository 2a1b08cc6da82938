"""The robots in the order of cells: those near each other are near each other in memory."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.geometry.grid import GridNumbers, cell_index, cells_of, sort_into_cells
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import Flags, IntegerRows, Integers, RealRows, Reals
from mesa_swarm.physics.arcs import copy_places, largest_of
from mesa_swarm.physics.contact import ContactArrays

FEWEST_PAIRS = 64
# In the state of pairs.
SIZE, LISTED = 0, 1


class PushArrays(NamedTuple):
    """Scratch for separating robots, a row a robot, as `separation.Groups` has it; `push` is 0 and none is `awake`.

    Of `start` there is one more; `members` and `moved` are rows of robots, of which threads take their own ranges.
    """

    start: Integers
    push: RealRows
    awake: Flags
    group: Integers
    begins: RealRows
    members: Integers
    moved: Integers

    @classmethod
    def of(cls, n: int) -> "PushArrays":
        """Return scratch for n robots."""
        rows = np.zeros((3, n), np.int64)
        start, group, members, moved = np.zeros(n + 1, np.int64), *rows
        return cls(start, np.zeros((n, 2)), np.zeros(n, np.bool_), group, np.zeros((n, 2)), members, moved)


class CrowdArrays(NamedTuple):
    """Copies of the columns that neighbours need, in the order of cells, as compiled functions take them.

    The first three are these columns. Row p of the copies is the robot in row ``order[p]`` of the swarm; cell c of the
    grid holds rows ``start[c]`` to ``start[c + 1]``. Within a cell they ascend by row of the swarm, so that the order
    follows from the places alone. `cell_of`, `reference`, `radii` and `numbers` are the cell of each, its place when
    they were sorted, radius and number; `places` and `before` where it is now, and was before this piece of the step;
    `free` whether it is clear of static bodies; `rows` are 0 to n - 1. `directions`, by row of the swarm, are headings
    with cosine and sine, see `recall_direction`; `scratch` is that of separating robots.
    """

    position: RealRows
    radius: Reals
    number: Integers
    grid: GridNumbers
    start: Integers
    order: Integers
    cell_of: Integers
    reference: RealRows
    radii: Reals
    numbers: Integers
    places: RealRows
    before: RealRows
    free: Flags
    contacts: ContactArrays
    rows: Integers
    directions: RealRows
    scratch: PushArrays

    @classmethod
    def of(cls, grid: GridNumbers, position: np.ndarray, radius: np.ndarray, number: np.ndarray) -> "CrowdArrays":
        """Return room for copies of these columns."""
        n = len(position)
        start, order, cell_of = np.zeros(cells_of(grid) + 1, np.int64), np.arange(n), np.zeros(n, np.int64)
        reference, radii, numbers = np.zeros((n, 2)), np.zeros(n), np.zeros(n, np.int64)
        places, before, free = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n, np.bool_)
        sorted_arrays = start, order, cell_of, reference, radii, numbers
        contacts, rows, directions = ContactArrays.of(n), np.arange(n), np.full((n, 3), np.nan)
        others = contacts, rows, directions, PushArrays.of(n)
        return cls(position, radius, number, grid, *sorted_arrays, places, before, free, *others)


class PairArrays(NamedTuple):
    """Room for pairs of robots near each other (m, 2); how many there are, and whether they are of present places."""

    room: IntegerRows
    state: Integers


class Crowd:
    """The robots in the order of cells, and the pairs of robots near each other.

    Attributes
    ----------
    arrays : CrowdArrays
    near : PairArrays
    """

    def __init__(self, grid: GridNumbers, position: np.ndarray, radius: np.ndarray, number: np.ndarray) -> None:
        self.arrays = CrowdArrays.of(grid, position, radius, number)
        self._block = Block(self.arrays)
        self.near = PairArrays(_room_for(len(position)), np.zeros(2, np.int64))
        self._pairs = Block(self.near)
        self._rooms: dict[int, np.ndarray] = {}

    @property
    def block(self) -> np.ndarray:
        """The arrays as compiled functions take them: the numbers of a block."""
        return self._block.numbers

    @property
    def block_of_pairs(self) -> np.ndarray:
        """The numbers of a block of `near`, which stay where they are when there is more room."""
        return self._pairs.numbers

    @property
    def pairs(self) -> np.ndarray:
        """The pairs (m, 2) that were within the margin where robots were sorted."""
        return self.near.room[: self.near.state[SIZE]]

    @pairs.setter
    def pairs(self, pairs: np.ndarray) -> None:
        self.near.state[SIZE] = len(pairs)
        if len(pairs) >= len(self.near.room):
            self.make_room()
        self.near.room[: len(pairs)] = pairs

    def make_room(self) -> None:
        """Make room for as many pairs as were counted; those that there were are dropped."""
        self.near = self.near._replace(room=_room_for(int(self.near.state[SIZE])))
        self._pairs.replace(self.near)

    def sort(self) -> None:
        """Sort the robots by the cells in which they are now."""
        sort_by_cell(self.block)

    def list_pairs(self, margin: float) -> None:
        """List the pairs within this margin of each other."""
        self.pairs = near_pairs(self.arrays.reference, self.arrays.radii, margin, self.arrays.grid)
        self.near.state[LISTED] = True

    def pairs_from(self, first: int, last: int, find: Callable[..., int], *arguments: Any) -> np.ndarray:
        """Return the pairs of rows [first, last): ``find(*given, first, last, room)`` writes them.

        It returns how many there are, also where there is not room for all.
        """
        room = self._rooms.get(first)
        if room is None:
            room = _room_for(last - first)
        while (count := find(*arguments, first, last, room)) >= len(room):
            room = _room_for(count)
        self._rooms[first] = room
        return room[:count]


def _room_for(count: int) -> np.ndarray:
    return np.empty((FEWEST_PAIRS + 2 * count, 2), np.int64)


@compiled
def put_pairs(pairs, near):
    """Count pairs, and copy them into the room for them if it is large enough, which is returned."""
    room = near.room
    near.state[SIZE] = len(pairs)
    if len(pairs) > len(room):
        return False
    copy_places(pairs, room)
    return True


@compiled
def sort_by_cell(crowd):
    """Sort robots by cell, and copy their places, radii and numbers in that order."""
    c = unpack(crowd, CrowdArrays)
    position, radius, number, order, reference = c.position, c.radius, c.number, c.order, c.reference
    radii, numbers = c.radii, c.numbers
    sort_into_cells(position, c.grid, c.start, order, c.cell_of)
    for p in range(order.shape[0]):
        i = order[p]
        reference[p, 0], reference[p, 1] = position[i, 0], position[i, 1]
        radii[p], numbers[p] = radius[i], number[i]


@compiled(apart=True)
def near_pairs(position, radius, margin, grid):
    """Return the pairs (i, j) of robots that overlap or come within `margin` of it, i before j in the order of cells.

    The first of a pair is the one whose cell, or within a cell whose row, comes first.
    """
    n = position.shape[0]
    x, y, per_unit, columns, rows = grid
    start = np.zeros(columns * rows + 1, np.int64)
    order = np.empty(n, np.int64)
    cell_of = np.empty(n, np.int64)
    sort_into_cells(position, grid, start, order, cell_of)
    pairs = np.empty((max(n, 16), 2), np.int64)
    count = 0
    largest = largest_of(radius)
    for i in range(n):
        far = radius[i] + largest + margin
        column, row = cell_of[i] % columns, cell_of[i] // columns
        first = cell_index(position[i, 0] - far, x, per_unit, columns)
        last = cell_index(position[i, 0] + far, x, per_unit, columns)
        highest = cell_index(position[i, 1] + far, y, per_unit, rows)
        # Each pair is found once, from the earlier of its two cells.
        for r in range(row, highest + 1):
            left = column if r == row else first
            for k in range(start[left + columns * r], start[last + columns * r + 1]):
                j = order[k]
                if cell_of[j] == cell_of[i] and j <= i:
                    continue
                near = radius[i] + radius[j] + margin
                dx, dy = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
                if dx * dx + dy * dy < near * near:
                    if count == pairs.shape[0]:
                        pairs = np.concatenate((pairs, np.empty_like(pairs)))
                    pairs[count, 0] = i
                    pairs[count, 1] = j
                    count += 1
    return pairs[:count]
