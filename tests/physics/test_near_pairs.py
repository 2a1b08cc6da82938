"""The pairs that contact watches: all that are near, once each, whatever the grid."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.grid import Grid
from mesa_swarm.physics.contact import near_pairs


@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.floats(0, 30), st.floats(20, 400))
def test_near_pairs_are_all_pairs_within_the_margin_whatever_the_size_of_cells(seed, n, margin, size):
    rng = np.random.default_rng(seed)
    position, radius = rng.uniform(0, size, (n, 2)), rng.uniform(0.5, 9, n)
    grid = Grid.over((0.0, 0.0, size, size), rng.uniform(5, 60), 4 * n + 9)
    pairs = near_pairs(position, radius, margin, grid.numbers)
    apart = np.hypot(*(position[:, None] - position[None]).transpose(2, 0, 1))
    near = np.triu(apart < radius[:, None] + radius + margin, k=1)
    assert sorted(map(tuple, np.sort(pairs, axis=1).tolist())) == list(map(tuple, np.argwhere(near).tolist()))
