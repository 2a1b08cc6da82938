"""Choosing points at a least distance: against the obvious loops, and against closed forms of the lattice."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.grid import Grid, cell_index
from mesa_swarm.geometry.spaced_points import hexagonal_lattice, take_apart

BOUNDS = (-10.0, 5.0, 90.0, 65.0)
seeds = st.integers(0, 2**32 - 1)


def placed_one_by_one(candidates, radius, others, other_radius, most):
    """Return the discs that a person would place: each candidate that overlaps none of those before, by all pairs."""
    discs = [(*place, r) for place, r in zip(others.tolist(), other_radius.tolist(), strict=True)]
    for x, y in candidates.tolist():
        if len(discs) < most and all(math.hypot(x - p, y - q) >= radius + r for p, q, r in discs):
            discs.append((x, y, radius))
    return discs


@given(seeds, st.integers(0, 6), st.integers(0, 20), st.floats(1, 12))
def test_candidates_are_taken_in_order_unless_they_overlap_one_taken_before(seed, old, room, radius):
    rng = np.random.default_rng(seed)
    low, high = BOUNDS[:2], BOUNDS[2:]
    others, other_radius = rng.uniform(low, high, (old, 2)), rng.uniform(1, 12, old)
    candidates = rng.uniform(low, high, (60, 2))
    grid = Grid.over(BOUNDS, radius + max(radius, other_radius.max(initial=0.0)), 500)
    position, radii = np.concatenate([others, np.zeros((room, 2))]), np.concatenate([other_radius, np.zeros(room)])
    head, following = np.full(grid.cells, -1), np.full(old + room, -1)
    x, y, per_unit, columns, rows = grid.numbers
    for k, place in enumerate(others):
        cell = cell_index(place[0], x, per_unit, columns) + columns * cell_index(place[1], y, per_unit, rows)
        following[k], head[cell] = head[cell], k
    taken = take_apart(candidates, radius, position, radii, old, grid.numbers, head, following)
    expected = placed_one_by_one(candidates, radius, others, other_radius, old + room)
    assert np.column_stack([position, radii])[:taken].tolist() == [list(disc) for disc in expected]


def test_discs_that_touch_do_not_overlap():
    grid = Grid.over((0.0, 0.0, 40.0, 40.0), 10.0, 100)
    position, radii = np.zeros((3, 2)), np.zeros(3)
    links = np.full(grid.cells, -1), np.full(3, -1)
    row = np.array([[5.0, 5.0], [14.999, 5.0], [15.0, 5.0], [5.0, 15.0]])
    assert take_apart(row, 5.0, position, radii, 0, grid.numbers, *links) == 3
    assert position.tolist() == [[5.0, 5.0], [15.0, 5.0], [5.0, 15.0]]


@given(st.floats(3, 40), st.floats(0, 100), st.floats(0, 100), st.floats(-50, 50))
def test_a_lattice_is_every_point_of_its_rows_within_the_bounds(spacing, width, height, shift):
    points = hexagonal_lattice((shift, -shift, shift + width, height - shift), spacing)
    step = spacing * (1 + 1e-9)
    expected, y = [], 0.0
    while y <= height:
        x = 0.5 * step if len(expected) % 2 else 0.0
        expected.append(math.floor((width - x) / step) + 1 if x <= width else 0)
        y = len(expected) * step * math.sqrt(3) / 2
    # A point that lies on the border but for rounding may be in or out.
    if min(abs((width / step * 2) % 1 - 0.5), abs((height / step / math.sqrt(0.75)) % 1 - 0.5)) < 0.5 - 1e-6:
        assert len(points) == sum(expected)
    assert (points >= (shift, -shift - 1e-9)).all()
    assert (points <= (shift + width, height - shift + 1e-6)).all()


def test_neighbours_in_a_lattice_are_the_spacing_apart_and_never_less():
    points = hexagonal_lattice((1.0, 2.0, 101.0, 82.0), 10.0)
    apart = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    np.fill_diagonal(apart, math.inf)
    assert (apart.min(axis=1) >= 10.0).all()
    assert apart.min(axis=1) == pytest.approx(10.0, rel=1e-8)
    # Inside, each point has six neighbours at that distance.
    assert np.count_nonzero(apart < 10.001, axis=1).max() == 6
    assert points[0].tolist() == [1.0, 2.0]
