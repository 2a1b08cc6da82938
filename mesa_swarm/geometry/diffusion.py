"""A scalar on a grid: it diffuses, evaporates, is stopped by walls, and is read between the centres of cells.

A grid is an array (rows, columns), row 0 at the bottom; ``frame`` is (x_min, y_min, width, height) of its first cell.
Between two neighbouring cells is a link, the straight line from centre to centre. A link that crosses a wall is
closed: nothing passes it, and readings do not look through it. ``sides`` has bits for the open links of each cell
(`EAST` ...) and `BLOCKED` where the centre lies within a wall; without walls it is of shape (0, 0).
"""

from typing import NamedTuple

import numpy as np

from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.kernels.type_names import ByteRows, Flags, IntegerRows, Integers, RealRows

EAST, WEST, NORTH, SOUTH, BLOCKED = 1, 2, 4, 8, 16
OPEN = EAST | WEST | NORTH | SOUTH
# Smaller values count as 0: what has spread far would otherwise become denormal numbers, which are slow.
LEAST = 1e-250


class FieldArrays(NamedTuple):
    """A field that advances: arguments of `spread` for a sub-step, how many of these a step takes, whether it is empty.

    What is remaining is multiplied in the last sub-step; a field that does not change takes none.
    """

    values: RealRows
    x_share: float
    y_share: float
    remaining: float
    sides: ByteRows
    begins: Integers
    cells: Integers
    sub_steps: int
    empty: Flags


class FieldBlocks(NamedTuple):
    """The numbers of a block of `FieldArrays` for each field."""

    blocks: IntegerRows


@compiled(nogil=True)
def advance_fields(block, step, first, last):
    """Advance all fields by a step, whichever rows of robots these are; see `kernels.part.Kernel`."""
    blocks = unpack(block, FieldBlocks).blocks
    for k in range(blocks.shape[0]):
        advance_field(blocks[k])
    return 0


@compiled
def advance_field(field):
    """Advance a field, a block of `FieldArrays`, by a step."""
    f = unpack(field, FieldArrays)
    values, empty, remaining, sub_steps = f.values, f.empty, f.remaining, f.sub_steps
    if empty[0]:
        return
    for k in range(sub_steps):
        left = remaining if k == sub_steps - 1 else 1.0
        spread(values, f.x_share, f.y_share, left, f.sides, f.begins, f.cells)
    empty[0] = remaining == 0.0


@compiled(nogil=True)
def spread(values, x_share, y_share, remaining, sides, begins, cells):
    """Let each cell give its neighbours their shares of the differences, and multiply all by what is remaining.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
        Changed in place.
    x_share, y_share : float
        At least 0, their sum at most 1/4: all modes then decay without oscillation.
    remaining : float
        From 0 to 1.
    sides : uint8 ndarray, shape (rows, columns) or (0, 0)
    begins, cells : int64 ndarrays, shapes (rows + 1,) and (k,)
        The columns of the cells of each row that have a closed link.
    """
    rows, columns = values.shape
    below, row = np.empty(columns + 2), np.empty(columns + 2)
    for i in range(rows):
        now = values[i]
        for j in range(columns):
            row[j + 1] = now[j]
        row[0], row[-1] = row[1], row[-2]
        if i == 0:
            below = row.copy()
        above = values[i + 1] if i + 1 < rows else row[1:-1]
        for j in range(columns):
            own = row[j + 1]
            x_flow = (row[j] - own) + (row[j + 2] - own)
            y_flow = (below[j + 1] - own) + (above[j] - own)
            new = (own + (x_share * x_flow + y_share * y_flow)) * remaining
            now[j] = new if new >= LEAST else 0.0
        for place in range(begins[i], begins[i + 1]):
            j = cells[place]
            own, links = row[j + 1], sides[i, j]
            x_flow = (row[j] - own if links & WEST else 0.0) + (row[j + 2] - own if links & EAST else 0.0)
            y_flow = (below[j + 1] - own if links & SOUTH else 0.0) + (above[j] - own if links & NORTH else 0.0)
            new = (own + (x_share * x_flow + y_share * y_flow)) * remaining
            now[j] = new if new >= LEAST else 0.0
        below, row = row, below


@compiled
def block_polygon(sides, frame, edges):
    """Block the cells whose centres a polygon contains, and close the links that its edges (ax, ay, bx, by) cross."""
    x0, y0, width, height = frame
    rows, columns = sides.shape
    first, last = rows, -1
    for k in range(len(edges)):
        first = min(first, max(0, int(np.floor((edges[k, 1] - y0) / height - 0.5))))
        last = max(last, min(rows - 1, int(np.ceil((edges[k, 1] - y0) / height - 0.5))))
    if last < first:
        return
    inside = np.zeros((last - first + 1, columns + 1), np.bool_)
    for ax, ay, bx, by in edges:
        low, high = (min(ay, by) - y0) / height - 0.5, (max(ay, by) - y0) / height - 0.5
        for i in range(max(0, int(np.ceil(low))), min(rows, int(np.ceil(high)))):
            x = ax + (y0 + (i + 0.5) * height - ay) / (by - ay) * (bx - ax)
            j = min(max(int(np.ceil((x - x0) / width - 0.5)), 0), columns)
            inside[i - first, j] = not inside[i - first, j]
            _close_east(sides, i, j - 1)
        low, high = (min(ax, bx) - x0) / width - 0.5, (max(ax, bx) - x0) / width - 0.5
        for j in range(max(0, int(np.ceil(low))), min(columns, int(np.ceil(high)))):
            y = ay + (x0 + (j + 0.5) * width - ax) / (bx - ax) * (by - ay)
            _close_north(sides, min(max(int(np.ceil((y - y0) / height - 0.5)), 0), rows) - 1, j)
    for i in range(first, last + 1):
        within = False
        for j in range(columns):
            within ^= inside[i - first, j]
            if within:
                _block(sides, i, j)


@compiled
def block_disc(sides, frame, x, y, radius):
    """Block the cells whose centres a disc contains, and close the links that its rim crosses."""
    x0, y0, width, height = frame
    rows, columns = sides.shape
    low, high = (y - radius - y0) / height - 0.5, (y + radius - y0) / height - 0.5
    for i in range(max(0, int(np.ceil(low))), min(rows - 1, int(np.floor(high))) + 1):
        half = np.sqrt(max(radius**2 - (y0 + (i + 0.5) * height - y) ** 2, 0.0))
        first = min(max(int(np.ceil((x - half - x0) / width - 0.5)), 0), columns)
        last = min(max(int(np.floor((x + half - x0) / width - 0.5)), -1), columns - 1)
        _close_east(sides, i, first - 1)
        _close_east(sides, i, last)
        for j in range(first, last + 1):
            _block(sides, i, j)
    low, high = (x - radius - x0) / width - 0.5, (x + radius - x0) / width - 0.5
    for j in range(max(0, int(np.ceil(low))), min(columns - 1, int(np.floor(high))) + 1):
        half = np.sqrt(max(radius**2 - (x0 + (j + 0.5) * width - x) ** 2, 0.0))
        _close_north(sides, min(max(int(np.ceil((y - half - y0) / height - 0.5)), 0), rows) - 1, j)
        _close_north(sides, min(max(int(np.floor((y + half - y0) / height - 0.5)), -1), rows - 1), j)


@compiled
def _close_east(sides, i, j):
    if 0 <= j < sides.shape[1] - 1:
        sides[i, j] &= ~EAST
        sides[i, j + 1] &= ~WEST


@compiled
def _close_north(sides, i, j):
    if 0 <= i < sides.shape[0] - 1:
        sides[i, j] &= ~NORTH
        sides[i + 1, j] &= ~SOUTH


@compiled
def _block(sides, i, j):
    sides[i, j] |= BLOCKED
    _close_east(sides, i, j)
    _close_east(sides, i, j - 1)
    _close_north(sides, i, j)
    _close_north(sides, i - 1, j)


@compiled
def open_cell(sides, frame, x, y):
    """Return row and column of the cell in which a point lies; where that is blocked, of the nearest one that is not.

    Nearest is the centre; of equally near ones the lowest, leftmost. Without any, the cell itself.
    """
    x0, y0, width, height = frame
    rows, columns = sides.shape
    u, v = (x - x0) / width - 0.5, (y - y0) / height - 0.5
    i, j = min(max(int(np.floor(v + 0.5)), 0), rows - 1), min(max(int(np.floor(u + 0.5)), 0), columns - 1)
    if not sides[i, j] & BLOCKED:
        return i, j
    best, best_i, best_j = np.inf, i, j
    for ring in range(1, max(rows, columns)):
        if (ring - 0.5) * min(width, height) > best:
            break
        for k in range(max(i - ring, 0), min(i + ring, rows - 1) + 1):
            step = 1 if abs(k - i) == ring else 2 * ring
            for m in range(j - ring, j + ring + 1, step):
                if 0 <= m < columns and not sides[k, m] & BLOCKED:
                    distance = hypot((m - u) * width, (k - v) * height)
                    if distance < best:
                        best, best_i, best_j = distance, k, m
    return best_i, best_j


@compiled
def cells_at(shape, sides, frame, positions):
    """Return the index of the cell of each position (n, 2) in the flat grid, see `open_cell`."""
    rows, columns = shape
    x0, y0, width, height = frame
    cells = np.empty(len(positions), np.int64)
    for k in range(len(positions)):
        x, y = positions[k]
        if sides.size:
            i, j = open_cell(sides, frame, x, y)
        else:
            i = min(max(int(np.floor((y - y0) / height)), 0), rows - 1)
            j = min(max(int(np.floor((x - x0) / width)), 0), columns - 1)
        cells[k] = i * columns + j
    return cells


@compiled
def deposit(values, cells, amounts):
    """Add amounts to cells of a flat grid, in their order, and return the largest value that one has then."""
    largest = 0.0
    for k in range(len(cells)):
        values[cells[k]] += amounts[k]
        largest = max(largest, values[cells[k]])
    return largest


@compiled
def withdraw(values, cells, amounts, withdrawn):
    """Take amounts from cells of a flat grid, in their order, of each at most what it has; write what was taken."""
    for k in range(len(cells)):
        withdrawn[k] = min(amounts[k], values[cells[k]])
        values[cells[k]] -= withdrawn[k]


@compiled
def interpolate_cells(values, sides, frame, positions, levels, slopes):
    """Interpolate values and slopes bilinearly between the centres of cells.

    The slope of a cell is the central difference of its neighbours. What is behind a closed link counts as the value on
    this side of it, and so does what is beyond the border.

    Parameters
    ----------
    values, sides, frame
        See the module.
    positions : ndarray, shape (n, 2)
    found : ndarray, shape (n,)
        The values are written to it.
    slopes : ndarray, shape (n, 2)
        The slopes in x and y are written to it.
    """
    x0, y0, width, height = frame
    rows, columns = values.shape
    for k in range(len(positions)):
        levels[k] = slopes[k, 0] = slopes[k, 1] = 0.0
        u, v = (positions[k, 0] - x0) / width - 0.5, (positions[k, 1] - y0) / height - 0.5
        i, j = min(max(int(np.floor(v + 0.5)), 0), rows - 1), min(max(int(np.floor(u + 0.5)), 0), columns - 1)
        if sides.size and sides[i, j] & BLOCKED:
            i, j = open_cell(sides, frame, positions[k, 0], positions[k, 1])
            levels[k] = values[i, j]
            continue
        m, n = j + 1 if u >= j else j - 1, i + 1 if v >= i else i - 1
        own, beside, over, across = _weights(sides, rows, columns, i, j, n, m, abs(u - j), abs(v - i))
        for weight, row, column in ((own, i, j), (beside, i, m), (over, n, j), (across, n, m)):
            if weight > 0.0:
                x_slope, y_slope = _slopes(values, sides, row, column)
                levels[k] += weight * values[row, column]
                slopes[k, 0] += weight * x_slope / width
                slopes[k, 1] += weight * y_slope / height


@compiled
def _weights(sides, rows, columns, i, j, n, m, s, t):
    """Return the weights of the cells (i, j), (i, m), (n, j), (n, m); those out of reach leave theirs to the others."""
    s, t = min(s, 0.5), min(t, 0.5)
    x_way, y_way = EAST if m > j else WEST, NORTH if n > i else SOUTH
    x_open = 0 <= m < columns and (not sides.size or sides[i, j] & x_way > 0)
    y_open = 0 <= n < rows and (not sides.size or sides[i, j] & y_way > 0)
    by_x = x_open and 0 <= n < rows and (not sides.size or sides[i, m] & y_way > 0)
    by_y = y_open and 0 <= m < columns and (not sides.size or sides[n, j] & x_way > 0)
    beside, over, across = s * (1 - t) if x_open else 0.0, (1 - s) * t if y_open else 0.0, s * t
    if not (by_x or by_y):
        beside += across * (0.5 if y_open else 1.0) if x_open else 0.0
        over += across * (0.5 if x_open else 1.0) if y_open else 0.0
        across = 0.0
    return 1.0 - beside - over - across, beside, over, across


@compiled
def _slopes(values, sides, i, j):
    """Return half the differences of the neighbours of a cell in x and y."""
    rows, columns = values.shape
    own, links = values[i, j], sides[i, j] if sides.size else OPEN
    east = values[i, j + 1] if j + 1 < columns and links & EAST else own
    west = values[i, j - 1] if j > 0 and links & WEST else own
    north = values[i + 1, j] if i + 1 < rows and links & NORTH else own
    south = values[i - 1, j] if i > 0 and links & SOUTH else own
    return 0.5 * (east - west), 0.5 * (north - south)
