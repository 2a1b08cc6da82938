"""Uniform grids: which points and boxes are near each other, in time that grows only with their number."""

import math
from dataclasses import dataclass

import numpy as np

from mesa_swarm.geometry.compiled import compiled


@dataclass(frozen=True, kw_only=True, slots=True)
class Grid:
    """A uniform grid over a rectangle from (x, y), its lower left corner; points outside belong to the nearest cell."""

    x: float
    y: float
    cell: float
    columns: int
    rows: int

    @classmethod
    def over(cls, bounds: tuple[float, float, float, float], cell: float, most: int) -> "Grid":
        """Return a grid of cells at least `cell` wide, coarser where there would be more than about `most` cells."""
        x_min, y_min, x_max, y_max = bounds
        width, height = x_max - x_min, y_max - y_min
        side = max(cell, math.sqrt(width * height / most), width / most, height / most)
        columns, rows = max(1, math.ceil(width / side)), max(1, math.ceil(height / side))
        return cls(x=x_min, y=y_min, cell=side, columns=columns, rows=rows)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.columns * self.rows

    @property
    def numbers(self) -> tuple[float, float, float, int, int]:
        """Arguments of the compiled functions: x, y, 1/cell, columns, rows."""
        return self.x, self.y, 1.0 / self.cell, self.columns, self.rows


@compiled
def cell_index(value: float, origin: float, per_unit: float, count: int) -> int:
    """Return the index of the column (or row) that holds a coordinate, the nearest if it is outside."""
    scaled = (value - origin) * per_unit
    if scaled <= 0.0:
        return 0
    if scaled >= count:
        return count - 1
    return int(scaled)


@compiled
def sort_into_cells(position, grid, start, order, cell_of):
    """Sort points by cell with a counting sort, within a cell by ascending row; `grid` is `Grid.numbers`.

    Written are `start`, shape (cells + 1,), `order` and `cell_of`, shape (n,): the points of cell c are
    ``order[start[c]:start[c + 1]]``.
    """
    x, y, per_unit, columns, rows = grid
    n = position.shape[0]
    start[:] = 0
    for i in range(n):
        column = cell_index(position[i, 0], x, per_unit, columns)
        c = column + columns * cell_index(position[i, 1], y, per_unit, rows)
        cell_of[i] = c
        start[c + 1] += 1
    for c in range(columns * rows):
        start[c + 1] += start[c]
    for i in range(n - 1, -1, -1):
        c = cell_of[i]
        start[c + 1] -= 1
        order[start[c + 1]] = i
    # After the backward fill start[c + 1] is the first index of cell c: shift it home.
    for c in range(columns * rows):
        start[c] = start[c + 1]
    start[columns * rows] = n


@compiled
def list_boxes_by_cell(boxes, reach, grid):
    """Return, for every cell, the boxes (x_min, y_min, x_max, y_max) that come within `reach` of any point of it.

    Those of cell c are ``items[start[c]:start[c + 1]]``, ascending; `grid` is `Grid.numbers`.
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
