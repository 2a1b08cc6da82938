"""Grids: every point and every box is listed where it belongs, against the obvious loops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.grid import Grid, cell_index, list_boxes_by_cell, sort_into_cells

coordinates = st.floats(-50, 250)
points = st.lists(st.tuples(coordinates, coordinates), max_size=40)
sizes = st.floats(0, 60)
boxes = st.lists(st.tuples(coordinates, coordinates, sizes, sizes), max_size=15)
BOUNDS = (-10.0, 5.0, 190.0, 155.0)


@st.composite
def grids(draw):
    """Draw grids over the same rectangle, coarse and fine."""
    return Grid.over(BOUNDS, draw(st.floats(3, 400)), draw(st.integers(1, 300)))


def cell_of(x, y, grid):
    """Return the cell of a point, the nearest cell if it is outside."""
    column = min(max(int(np.floor((x - grid.x) / grid.cell)), 0), grid.columns - 1)
    row = min(max(int(np.floor((y - grid.y) / grid.cell)), 0), grid.rows - 1)
    return column + grid.columns * row


def centre_of(cell, grid):
    """Return the middle of a cell."""
    row, column = divmod(cell, grid.columns)
    return grid.x + (column + 0.5) * grid.cell, grid.y + (row + 0.5) * grid.cell


@given(st.floats(0.01, 500), st.integers(1, 1000))
def test_a_grid_covers_its_rectangle_with_cells_wide_enough_and_not_too_many(cell, most):
    grid = Grid.over(BOUNDS, cell, most)
    assert grid.cell >= cell
    assert grid.columns * grid.cell >= 200 * (1 - 1e-12)
    assert grid.rows * grid.cell >= 150 * (1 - 1e-12)
    assert grid.cells <= most + grid.columns + grid.rows + 1


@given(st.floats(0.1, 300), st.floats(0.1, 300), st.floats(0.01, 500), st.integers(1, 1000))
def test_a_grid_is_no_coarser_than_it_must_be_nor_has_cells_beyond_its_rectangle(width, height, cell, most):
    grid = Grid.over((-7.0, 3.0, width - 7.0, height + 3.0), cell, most)
    assert (grid.x, grid.y) == (-7.0, 3.0)
    assert grid.cell == cell or grid.cells >= most * (1 - 1e-9)
    assert grid.cells <= most + grid.columns + grid.rows + 1
    assert (grid.columns - 1) * grid.cell < width * (1 + 1e-9)
    assert (grid.rows - 1) * grid.cell < height * (1 + 1e-9)
    assert grid.numbers == (-7.0, 3.0, 1 / grid.cell, grid.columns, grid.rows)


@pytest.mark.parametrize("extent", [(1000.0, 1e-6), (1e-6, 1000.0), (0.0, 10.0), (10.0, 0.0)])
def test_a_grid_over_a_strip_has_about_as_many_cells_as_asked_for(extent):
    grid = Grid.over((0.0, 0.0, *extent), 1e-9, 50)
    assert {grid.columns, grid.rows} == {1, 50}


def test_a_cell_holds_its_lower_and_left_border_and_the_last_one_the_border_of_the_grid_too():
    assert [cell_index(value, 10.0, 0.5, 3) for value in (9.0, 10.0, 11.9, 12.0, 14.0, 15.9, 16.0, 99.0)] == [
        *(0, 0, 0, 1, 2, 2, 2, 2)
    ]


@given(st.floats(allow_nan=False), st.integers(1, 100))
def test_every_coordinate_has_a_cell(value, count):
    assert 0 <= cell_index(value, -10.0, 0.3, count) < count


@given(points, grids())
def test_every_point_is_listed_once_in_its_own_cell_in_ascending_order(where, grid):
    position = np.array(where, dtype=float).reshape(-1, 2)
    n = len(position)
    start, order, cells = np.full(grid.cells + 1, 7), np.zeros(n, np.int64), np.zeros(n, np.int64)
    sort_into_cells(position, grid.numbers, start, order, cells)
    assert start[0] == 0
    assert start[-1] == n
    for cell in range(grid.cells):
        listed = order[start[cell] : start[cell + 1]].tolist()
        assert listed == np.flatnonzero(cells == cell).tolist()
    centres = {cell: centre_of(cell, grid) for cell in set(cells.tolist())}
    for (x, y), cell in zip(np.clip(position, BOUNDS[:2], BOUNDS[2:]), cells.tolist(), strict=True):
        assert max(abs(x - centres[cell][0]), abs(y - centres[cell][1])) <= grid.cell * (0.5 + 1e-9)


@given(boxes, st.floats(0, 80), grids(), st.tuples(coordinates, coordinates))
def test_a_cell_lists_every_box_within_reach_of_any_point_in_it(where, reach, grid, point):
    table = np.array([(x, y, x + w, y + h) for x, y, w, h in where], dtype=float).reshape(-1, 4)
    start, items = list_boxes_by_cell(table, reach, grid.numbers)
    cell = cell_of(*point, grid)
    listed = items[start[cell] : start[cell + 1]]
    away = np.maximum(0, np.maximum(table[:, :2] - point, point - table[:, 2:]))
    assert set(np.flatnonzero(away.max(axis=1) < reach - 1e-9)) <= set(listed.tolist())


@given(boxes, st.floats(0, 80), grids())
def test_boxes_are_listed_exactly_in_the_cells_that_they_grown_by_the_reach_meet(where, reach, grid):
    table = np.array([(x, y, x + w, y + h) for x, y, w, h in where], dtype=float).reshape(-1, 4)
    start, items = list_boxes_by_cell(table, reach, grid.numbers)
    expected = [[] for _ in range(grid.cells)]
    for b, box in enumerate(table):
        first = cell_of(box[0] - reach, box[1] - reach, grid)
        last = cell_of(box[2] + reach, box[3] + reach, grid)
        (low, left), (high, right) = divmod(first, grid.columns), divmod(last, grid.columns)
        for row in range(low, high + 1):
            for column in range(left, right + 1):
                expected[column + grid.columns * row].append(b)
    assert [items[start[c] : start[c + 1]].tolist() for c in range(grid.cells)] == expected
