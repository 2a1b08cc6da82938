"""The pairs that contact watches: all that are near, once each, whatever the grid."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Map, SwarmModel
from mesa_swarm.geometry.grid import Grid, cell_index
from mesa_swarm.kernels.block import code_address
from mesa_swarm.physics import engine
from mesa_swarm.physics.crowd import (
    Crowd,
    SortCalls,
    copy_sorted,
    fill_cells,
    find_cells,
    near_pairs,
    sort_together,
)
from mesa_swarm.physics.separation import list_pairs_of, pairs_by_robot
from mesa_swarm.physics.threads import RowCrew
from support.random_worlds import Commanded

seeds, few, margins, sizes = st.integers(0, 2**32 - 1), st.integers(0, 60), st.floats(0, 30), st.floats(20, 400)


def robots(seed, n, size):
    """Return places, radii and a grid."""
    rng = np.random.default_rng(seed)
    position, radius = rng.uniform(0, size, (n, 2)), rng.uniform(0.5, 9, n)
    return position, radius, Grid.over((0.0, 0.0, size, size), rng.uniform(5, 60), 4 * n + 9)


def within(position, radius, margin):
    """Return the pairs i < j within the margin, sorted."""
    apart = np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1))
    near = np.triu(apart < radius[:, None] + radius + margin, k=1)
    return list(map(tuple, np.argwhere(near).tolist()))


def ascending(pairs):
    """Return the same pairs as `within` has them."""
    return sorted(map(tuple, np.sort(pairs, axis=1).tolist()))


@given(seeds, few, margins, sizes)
def test_near_pairs_are_all_pairs_within_the_margin_whatever_the_size_of_cells(seed, n, margin, size):
    position, radius, grid = robots(seed, n, size)
    assert ascending(near_pairs(position, radius, margin, grid.numbers)) == within(position, radius, margin)


@given(seeds, few, margins, sizes)
def test_a_crowd_is_in_the_order_of_cells_and_within_a_cell_in_that_of_rows(seed, n, margin, size):
    position, radius, grid = robots(seed, n, size)
    number = 3 * np.arange(n)
    crowd = Crowd(grid.numbers, position, radius, number)
    crowd.sort()
    order, start = crowd.arrays.order, crowd.arrays.start
    x, y, per_unit, columns, rows = grid.numbers
    cells = [cell_index(a, x, per_unit, columns) + columns * cell_index(b, y, per_unit, rows) for a, b in position]
    assert order.tolist() == sorted(range(n), key=lambda i: (cells[i], i))
    assert (crowd.arrays.reference == position[order]).all()
    assert (crowd.arrays.radii == radius[order]).all()
    assert (crowd.arrays.numbers == number[order]).all()
    assert all(order[start[c] : start[c + 1]].tolist() == sorted(
        i for i in range(n) if cells[i] == c) for c in range(grid.cells))  # fmt: skip
    crowd.list_pairs(margin)
    assert ascending(order[crowd.pairs]) == within(position, radius, margin)


@given(seeds, few, st.integers(0, 100))
def test_the_pairs_of_robots_that_moved_are_found_once_each(seed, n, count):
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, n, (count, 2)) if n > 1 else np.empty((0, 2), np.int64)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    start, own = pairs_by_robot(pairs, n)
    for i in range(n):
        assert own[start[i] : start[i + 1]].tolist() == np.flatnonzero((pairs == i).any(axis=1)).tolist()
    awake = rng.random(n) < 0.4
    moved, chosen = rng.permutation(np.flatnonzero(awake)), np.empty(len(pairs) + 1, np.int64)
    group, strayed = np.zeros(n, np.int64), np.array([False, False, True])
    found = chosen[: list_pairs_of(moved, awake, pairs, start, own, chosen, group, strayed)]
    assert sorted(found.tolist()) == np.flatnonzero(awake[pairs].any(axis=1)).tolist()
    assert list_pairs_of(moved, awake, pairs, start, own, chosen, np.full(n, 2), strayed) == 0


@given(seeds, few, sizes, st.integers(2, 9))
def test_threads_sort_as_one_does(seed, n, size, parts):
    position, radius, grid = robots(seed, n, size)
    one, several = (Crowd(grid.numbers, position, radius, np.arange(n)) for _ in range(2))
    one.sort()
    crew = RowCrew()
    crew.parts = parts
    calls = SortCalls(*map(code_address, (find_cells, fill_cells, copy_sorted)))
    with crew:
        sort_together(crew.numbers, calls, several.block)
    for name in ("start", "order", "cell_of", "reference", "radii", "numbers"):
        assert (getattr(several.arrays, name) == getattr(one.arrays, name)).all(), name


@pytest.mark.parametrize("threads", [1, 2])
def test_after_a_step_the_pairs_are_those_at_the_places_listed_also_where_robots_go_far(monkeypatch, threads):
    """Where a load has to return, robots travel twice in a step: the second time from the pairs of the first."""
    monkeypatch.setattr(engine, "FEWEST_ROWS", 2)
    model = SwarmModel(map=Map(name="hall", bounds=(0, 0, 150, 150)), rng=3, threads=threads)
    model.add_robots(replace(AGENT9, max_speed=9.0), 30)
    model.control = Commanded(np.random.default_rng(1).uniform(-9, 9, (30, 2)))
    anew = 0
    for _ in range(5):
        model.step()
        crowd = model.parts.robots.engine._crowd
        model.sense()
        arrays, listed = crowd.arrays, crowd.arrays.reference.copy()
        model.parts.robots.engine.move(
            model.swarm, model.parts.bodies.scene(), model.swarm.columns["command"], 0.5, None
        )
        anew += not (arrays.reference == listed).all()
        expected = near_pairs(arrays.reference, arrays.radii, model.parts.robots.engine._margin, arrays.grid)
        assert ascending(crowd.pairs) == ascending(expected)
    assert anew == 5
