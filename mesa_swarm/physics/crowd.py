"""The robots in the order of cells: those near each other are near each other in memory."""

from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry.grid import GridNumbers, cell_at, cell_index, cells_of, sort_into_cells
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.crew import share_rows
from mesa_swarm.kernels.type_names import Flags, IntegerRows, Integers, RealRows, Reals
from mesa_swarm.physics.arcs import copy_places, largest_of
from mesa_swarm.physics.contact import ContactArrays

# Room for pairs at the beginning: the least number of pairs, and of how many robots two pairs have room.
FEWEST_PAIRS, PAIRED = 64, 4
# A NumPy number: Numba would compile a function once more for a literal one that is passed to it.
ALL = np.int64(0)
# In the state of pairs: how many there are, whether they are of present places, how many overlap.
SIZE, LISTED, OVERLAPS = 0, 1, 2


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
    """Pairs of robots near each other, and scratch for separating them: room for m pairs.

    `room` (m, 2) has the pairs, by ascending first row; `state` see `SIZE`. `own` has the pairs of each robot, see
    `list_own_pairs`; `overlaps` those that overlap; `selection` those that are looked at, and `later` those whose
    groups are left for later, in a range of each part of the rows; `strayed` which groups have gone too far.
    """

    room: IntegerRows
    state: Integers
    own: Integers
    overlaps: Integers
    selection: Integers
    later: Integers
    strayed: Flags

    @classmethod
    def of(cls, count: int, parts: int = 1) -> "PairArrays":
        """Return room for a number of pairs and more, with rows cut into parts."""
        m = parts * FEWEST_PAIRS + 2 * count
        room, own, selection = np.empty((m, 2), np.int64), np.empty(2 * m, np.int64), np.empty(m + parts, np.int64)
        overlaps, later = np.empty((2, m + 1), np.int64)
        return cls(room, np.zeros(3, np.int64), own, overlaps, selection, later, np.zeros(m, np.bool_))

    @classmethod
    def of_pairs(cls, pairs: np.ndarray) -> "PairArrays":
        """Return room with these pairs."""
        near = cls.of(len(pairs))
        near.room[: len(pairs)], near.state[SIZE] = pairs, len(pairs)
        return near


class Crowd:
    """The robots in the order of cells, and the pairs of robots near each other.

    Attributes
    ----------
    arrays : CrowdArrays
    near : PairArrays
    """

    def __init__(
        self, grid: GridNumbers, position: np.ndarray, radius: np.ndarray, number: np.ndarray, parts: int = 1
    ) -> None:
        self.arrays = CrowdArrays.of(grid, position, radius, number)
        self._block, self._parts = Block(self.arrays), parts
        self.near = PairArrays.of(len(position) // PAIRED, parts)
        self._pairs = Block(self.near)

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
        state = self.near.state
        self.near = PairArrays.of(int(state[SIZE]), self._parts)._replace(state=state)
        self._pairs.replace(self.near)

    def sort(self) -> None:
        """Sort the robots by the cells in which they are now."""
        sort_by_cell(self.block)

    def list_pairs(self, margin: float) -> None:
        """List the pairs within this margin of each other."""
        self.pairs = near_pairs(self.arrays.reference, self.arrays.radii, margin, self.arrays.grid)
        self.near.state[LISTED] = True


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
    sort_into_cells(c.position, c.grid, c.start, c.order, c.cell_of)
    copy_sorted(crowd, ALL, ALL, len(c.order))


@compiled(nogil=True, apart=True)
def copy_sorted(crowd, step, first, last):
    """Copy places, radii and numbers of robots p in [first, last) in the order of cells."""
    c = unpack(crowd, CrowdArrays)
    position, radius, number, order, reference = c.position, c.radius, c.number, c.order, c.reference
    radii, numbers = c.radii, c.numbers
    for p in range(first, last):
        i = order[p]
        reference[p, 0], reference[p, 1] = position[i, 0], position[i, 1]
        radii[p], numbers[p] = radius[i], number[i]
    return 0


# ---- the same by threads: each step of sorting is a kernel of its own, of rows or of cells


class SortCalls(NamedTuple):
    """Addresses of `find_cells`, `fill_cells` and `copy_sorted`, zeros where no threads share the rows."""

    find_cells: int
    fill_cells: int
    copy_sorted: int


@compiled(nogil=True, apart=True)
def sort_together(crew, calls, crowd):
    """Do what `sort_by_cell` does, by threads."""
    c = unpack(crowd, CrowdArrays)
    n, cells = len(c.order), len(c.start) - 1
    share_rows(crew, calls.find_cells, crowd, ALL, n)
    share_rows(crew, calls.fill_cells, crowd, ALL, cells)
    c.start[cells] = n
    share_rows(crew, calls.copy_sorted, crowd, ALL, n)


@compiled(nogil=True)
def find_cells(crowd, step, first, last):
    """Find the cells in which robots i in [first, last) are."""
    c = unpack(crowd, CrowdArrays)
    position, cell_of = c.position, c.cell_of
    for i in range(first, last):
        cell_of[i] = cell_at(position[i, 0], position[i, 1], c.grid)
    return 0


@compiled(nogil=True)
def fill_cells(crowd, step, first, last):
    """Sort the robots that are in cells [first, last) into these, behind those in earlier cells."""
    c = unpack(crowd, CrowdArrays)
    cell_of, start, order, rows = c.cell_of, c.start, c.order, c.scratch.members
    before = within = 0
    for i in range(len(cell_of)):
        before += cell_of[i] < first
        within += first <= cell_of[i] < last
    # Without branches, which no processor could foresee: what does not count is written over.
    count, i = 0, 0
    while count < within:
        rows[before + count] = i
        count += first <= cell_of[i] < last
        i += 1
    own_rows = rows[before : before + within]
    start[first:last] = 0
    for i in own_rows:
        start[cell_of[i]] += 1
    place = before
    for cell in range(first, last):
        place, start[cell] = place + start[cell], place
    for i in own_rows:
        order[start[cell_of[i]]] = i
        start[cell_of[i]] += 1
    # Now each begins where the next one should.
    for cell in range(last - 1, first, -1):
        start[cell] = start[cell - 1]
    start[first] = before
    return 0


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
