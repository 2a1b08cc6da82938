"""Grids find all neighbours and nobody else."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.grid import Grid, list_boxes_by_cell, sort_into_cells
from mesa_swarm.physics.contact import near_pairs

BOUNDS = (-50.0, 20.0, 150.0, 170.0)


@given(seed=st.integers(0, 2**32), n=st.integers(0, 80), cell=st.floats(3, 300), most=st.integers(1, 500))
def test_every_point_is_in_the_list_of_its_cell_once(seed, n, cell, most):
    points = np.random.default_rng(seed).uniform((-60, 0), (160, 180), (n, 2))
    grid = Grid.over(BOUNDS, cell, most)
    start, order, cell_of = np.zeros(grid.cells + 1, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64)
    sort_into_cells(points, grid.numbers, start, order, cell_of)
    assert sorted(order) == list(range(n))
    for c in range(grid.cells):
        members = order[start[c] : start[c + 1]]
        assert (cell_of[members] == c).all()
        assert (np.diff(members) > 0).all()


@given(seed=st.integers(0, 2**32), n=st.integers(0, 60), margin=st.floats(0, 40), cell=st.floats(5, 100))
def test_near_pairs_are_all_pairs_that_are_near_each_once(seed, n, margin, cell):
    rng = np.random.default_rng(seed)
    points, radius = rng.uniform((-50, 20), (150, 170), (n, 2)), rng.uniform(1, 8, n)
    grid = Grid.over(BOUNDS, cell, 10_000)
    found = [tuple(sorted(pair)) for pair in near_pairs(points, radius, margin, grid.numbers).tolist()]
    gaps = np.hypot(*(points[:, None] - points[None, :]).transpose(2, 0, 1)) - radius[:, None] - radius[None, :]
    expected = {(i, j) for i in range(n) for j in range(i + 1, n) if gaps[i, j] < margin}
    assert len(found) == len(set(found))
    assert set(found) == expected


@given(seed=st.integers(0, 2**32), n=st.integers(1, 30), reach=st.floats(0, 60))
def test_a_box_is_listed_wherever_a_point_within_reach_of_it_may_be(seed, n, reach):
    rng = np.random.default_rng(seed)
    corner = rng.uniform((-50, 20), (150, 170), (n, 2))
    boxes = np.hstack([corner, corner + rng.uniform(0, 30, (n, 2))])
    grid = Grid.over(BOUNDS, 15.0, 400)
    start, items = list_boxes_by_cell(boxes, reach, grid.numbers)
    x, y = rng.uniform((-50, 20), (150, 170))
    column, row = int((x + 50) / grid.cell), int((y - 20) / grid.cell)
    listed = set(items[start[column + grid.columns * row] : start[column + grid.columns * row + 1]].tolist())
    dx = np.maximum(np.maximum(boxes[:, 0] - x, x - boxes[:, 2]), 0)
    dy = np.maximum(np.maximum(boxes[:, 1] - y, y - boxes[:, 3]), 0)
    assert set(np.flatnonzero(np.hypot(dx, dy) <= reach).tolist()) <= listed


def test_a_huge_world_does_not_get_a_huge_grid():
    assert Grid.over((0.0, 0.0, 1e9, 1e9), 1.0, 1000).cells <= 1100
    assert Grid.over((0.0, 0.0, 1e9, 1.0), 1.0, 1000).cells <= 1100
