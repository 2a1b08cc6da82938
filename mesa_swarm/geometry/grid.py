"""Uniform grids: which points and boxes are near each other, in time that grows only with their number."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry import Bounds
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import Integers

# A uniform grid as compiled functions take it: x and y of its lower left corner, cells per map unit, columns, rows.
GridNumbers = tuple[float, float, float, int, int]


class CellLists(NamedTuple):
    """Items listed by the cells of a grid: those of cell c are ``items[start[c]:start[c + 1]]``."""

    grid: GridNumbers
    start: Integers
    items: Integers


@dataclass(frozen=True, kw_only=True, slots=True)
class Grid:
    """The geometry of a uniform grid over a rectangle.

    Parameters
    ----------
    x, y : float
        Lower left corner.
    cell : float
        Side of a cell, map units.
    columns, rows : int
        Number of cells along x and y. Points outside belong to the nearest cell.
    """

    x: float
    y: float
    cell: float
    columns: int
    rows: int

    @classmethod
    def over(cls, bounds: Bounds, cell: float, most: int) -> "Grid":
        """Return a grid of cells at least `cell` wide, coarser where there would be more than about `most` cells.

        Examples
        --------
        >>> Grid.over((0.0, 0.0, 800.0, 600.0), 100.0, 100).columns
        8
        """
        x_min, y_min, x_max, y_max = bounds
        width, height = x_max - x_min, y_max - y_min
        side = max(cell, math.sqrt(width * height / most), width / most, height / most)
        columns, rows = max(1, math.ceil(width / side)), max(1, math.ceil(height / side))
        return cls(x=x_min, y=y_min, cell=side, columns=columns, rows=rows)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.columns * self.rows

    def most_cells_of(self, half: float) -> int:
        """Return how many cells a square of this half side may meet, at most.

        Examples
        --------
        >>> Grid(x=0.0, y=0.0, cell=10.0, columns=8, rows=6).most_cells_of(5.0)
        9
        """
        across = math.ceil(2.0 * half / self.cell) + 2
        return min(across, self.columns) * min(across, self.rows)

    @property
    def numbers(self) -> GridNumbers:
        """Arguments of the compiled functions: x, y, 1/cell, columns, rows."""
        return self.x, self.y, 1.0 / self.cell, self.columns, self.rows


@compiled
def cell_index(value: float, origin: float, per_unit: float, count: int) -> int:
    """Return the index of the column (or row) that holds a coordinate, the nearest if it is outside.

    Examples
    --------
    >>> cell_index(250.0, 0.0, 0.01, 8)
    2
    """
    scaled = (value - origin) * per_unit
    if scaled <= 0.0:
        return 0
    if scaled >= count:
        return count - 1
    return int(scaled)


@compiled
def cell_at(x, y, grid):
    """Return the cell that holds a point, see `cell_index`.

    Examples
    --------
    >>> cell_at(25.0, 15.0, Grid(x=0.0, y=0.0, cell=10.0, columns=4, rows=3).numbers)
    6
    """
    left, below, per_unit, columns, rows = grid
    return cell_index(x, left, per_unit, columns) + columns * cell_index(y, below, per_unit, rows)


@compiled
def cells_of(grid):
    """Return the number of cells of a grid."""
    columns, rows = grid[3:]
    return columns * rows


@compiled
def sort_into_cells(position, grid, start, order, cell_of):
    """Sort points by cell (counting sort; within a cell by ascending row).

    Parameters
    ----------
    position : ndarray, shape (n, 2)
    grid : tuple
        `Grid.numbers`.
    start : int64 ndarray, shape (cells + 1,), written
        The points of cell c are ``order[start[c]:start[c + 1]]``.
    order, cell_of : int64 ndarrays, shape (n,), written

    Examples
    --------
    >>> grid = Grid.over((0.0, 0.0, 20.0, 10.0), 10.0, 9)
    >>> start, order = np.zeros(grid.cells + 1, np.int64), np.zeros(2, np.int64)
    >>> sort_into_cells(np.array([[15.0, 5], [5, 5]]), grid.numbers, start, order, order.copy())
    >>> order
    array([1, 0])
    """
    n, cells = position.shape[0], start.shape[0] - 1
    start[:] = 0
    for i in range(n):
        c = cell_at(position[i, 0], position[i, 1], grid)
        cell_of[i] = c
        start[c + 1] += 1
    for c in range(cells):
        start[c + 1] += start[c]
    for i in range(n - 1, -1, -1):
        c = cell_of[i]
        start[c + 1] -= 1
        order[start[c + 1]] = i
    # After the backward fill start[c + 1] is the first index of cell c: shift it home.
    for c in range(cells):
        start[c] = start[c + 1]
    start[cells] = n


@compiled
def list_boxes_by_cell(boxes, reach, grid):
    """Return, for every cell, the boxes that come within `reach` of it.

    Parameters
    ----------
    boxes : ndarray, shape (m, 4)
        x_min, y_min, x_max, y_max.
    reach : float
        Distance from any point of the cell at which a box still matters.
    grid : tuple
        `Grid.numbers`.

    Returns
    -------
    start, items : int64 ndarrays
        The boxes near cell c are ``items[start[c]:start[c + 1]]``, ascending.

    Examples
    --------
    >>> grid = Grid.over((0.0, 0.0, 20.0, 10.0), 10.0, 9)
    >>> start, items = list_boxes_by_cell(np.array([[12.0, 1.0, 13.0, 2.0]]), 1.0, grid.numbers)
    >>> start
    array([0, 0, 1])
    """
    x, y, per_unit, columns, rows = grid
    start = np.zeros(columns * rows + 1, np.int64)
    for fill in range(2):
        if fill == 1:
            for c in range(columns * rows):
                start[c + 1] += start[c]
            items = np.empty(start[columns * rows], np.int64)
            cursor = start[:-1].copy()
        for b in range(boxes.shape[0]):
            left = cell_index(boxes[b, 0] - reach, x, per_unit, columns)
            right = cell_index(boxes[b, 2] + reach, x, per_unit, columns)
            below = cell_index(boxes[b, 1] - reach, y, per_unit, rows)
            above = cell_index(boxes[b, 3] + reach, y, per_unit, rows)
            for row in range(below, above + 1):
                for column in range(left, right + 1):
                    c = column + columns * row
                    if fill == 1:
                        items[cursor[c]] = b
                        cursor[c] += 1
                    else:
                        start[c + 1] += 1
    return start, items
