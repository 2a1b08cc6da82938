"""Choosing points at a least distance from each other."""

import numpy as np

from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.grid import cell_index
from mesa_swarm.kernels.compiled import compiled


@compiled
def take_apart(candidates, radius, others, other_radius, count, grid, head, following):
    """Take candidates in order, except those that overlap one taken before, and return how many are taken in all.

    Parameters
    ----------
    candidates : ndarray, shape (m, 2)
    radius : float
        Of the discs to place.
    others, other_radius : ndarrays, shapes (k, 2), (k,)
        Rows 0..taken-1 are placed already; further rows are written.
    taken : int
    grid : tuple
        `Grid.numbers` with cells at least radius + the largest other radius wide.
    head, following : int64 ndarrays, shapes (cells,), (k,), written
        Linked lists of the placed discs by cell, -1 at the end.
    """
    x0, y0, per_unit, columns, rows = grid
    for c in range(candidates.shape[0]):
        if count == others.shape[0]:
            return count
        x, y = candidates[c, 0], candidates[c, 1]
        column, row = cell_index(x, x0, per_unit, columns), cell_index(y, y0, per_unit, rows)
        if _is_apart(x, y, radius, others, other_radius, column, row, columns, rows, head, following):
            others[count, 0], others[count, 1] = x, y
            other_radius[count] = radius
            following[count] = head[column + columns * row]
            head[column + columns * row] = count
            count += 1
    return count


@compiled
def _is_apart(x, y, radius, others, other_radius, column, row, columns, rows, head, following):
    """Return whether a disc at (x, y) overlaps none of those placed in the cells around."""
    for r in range(max(row - 1, 0), min(row + 1, rows - 1) + 1):
        for q in range(max(column - 1, 0), min(column + 1, columns - 1) + 1):
            k = head[q + columns * r]
            while k >= 0:
                near = radius + other_radius[k]
                if (x - others[k, 0]) ** 2 + (y - others[k, 1]) ** 2 < near * near:
                    return False
                k = following[k]
    return True


@compiled
def link_by_cell(position, grid, head, following):
    """Add discs to the linked lists of their cells, whatever they overlap.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
    grid : tuple
        `Grid.numbers`.
    head, following : int64 ndarrays, shapes (cells,), (k,), written
        As of `take_apart`; k is at least n.

    Examples
    --------
    >>> head, following = np.full(2, -1), np.full(2, -1)
    >>> link_by_cell(np.array([[0.5, 0.5], [0.7, 0.5]]), (0.0, 0.0, 1.0, 2, 1), head, following)
    >>> head.tolist(), following.tolist()
    ([1, -1], [-1, 0])
    """
    x0, y0, per_unit, columns, rows = grid
    for k in range(position.shape[0]):
        column = cell_index(position[k, 0], x0, per_unit, columns)
        cell = column + columns * cell_index(position[k, 1], y0, per_unit, rows)
        following[k] = head[cell]
        head[cell] = k


def hexagonal_lattice(bounds: Bounds, spacing: float) -> np.ndarray:
    """Return the points of a triangular lattice, the densest there is, that lie within bounds.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max)
    spacing : float
        Distance between neighbours.

    Examples
    --------
    >>> len(hexagonal_lattice((0.0, 0.0, 11.0, 11.0), 10.0))
    3
    """
    x_min, y_min, x_max, y_max = bounds
    # A hair wider than required, so that rounding never makes neighbours overlap.
    step = spacing * (1 + 1e-9)
    rows = np.arange(int((y_max - y_min) / (step * np.sqrt(0.75))) + 1)
    columns = np.arange(int((x_max - x_min) / step) + 1)
    x = x_min + step * (columns[None, :] + 0.5 * (rows[:, None] % 2))
    y = np.broadcast_to(y_min + step * np.sqrt(0.75) * rows[:, None], x.shape)
    points = np.column_stack([x.ravel(), y.ravel()])
    return points[points[:, 0] <= x_max]
