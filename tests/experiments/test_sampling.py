"""Grids and samples of parameters."""

from collections import Counter

import numpy as np
import pandas as pd
import pytest

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.plan import checked_seeds
from mesa_swarm.experiments.sampling import Sample, grid
from mesa_swarm.gallery import find_model

FIRE = find_model("fire_fighting")
GRID = {"strategy": ["A", "B"], "n_robots": [2, 3]}


def test_a_grid_has_every_combination_and_the_last_name_varies_fastest():
    assert [tuple(point.values()) for point in grid(FIRE, GRID)] == [("A", 2), ("A", 3), ("B", 2), ("B", 3)]


@pytest.mark.parametrize("kind", ["latin_hypercube", "sobol"])
def test_a_sample_has_one_point_in_each_slice_of_every_range(kind):
    points = Sample(kind, {"k1": (0.0, 64.0), "k3": (1.0, 2.0)}, points=64, rng=3).settings(FIRE)
    assert sorted(int(point["k1"]) for point in points) == list(range(64))
    assert sorted(int((point["k3"] - 1) * 64) for point in points) == list(range(64))


def test_a_sample_depends_on_its_seed_only():
    ranges = {"k1": (0.0, 1.0)}
    one, same, other = (Sample("sobol", ranges, points=8, rng=rng).settings(FIRE) for rng in (1, 1, 2))
    assert one == same != other


def test_whole_numbers_of_a_sample_reach_both_ends_equally_often():
    points = Sample("latin_hypercube", {"n_robots": (3, 6)}, points=400).settings(FIRE)
    assert Counter(point["n_robots"] for point in points) == {3: 100, 4: 100, 5: 100, 6: 100}


@pytest.mark.parametrize("kind", [np.array, pd.Series, pd.Index])
def test_values_seeds_and_ranges_may_be_arrays_and_series(kind):
    assert grid(FIRE, {"k1": kind([0.1, 0.2]), "n_robots": kind([2, 3])}) == grid(
        FIRE, {"k1": [0.1, 0.2], "n_robots": [2, 3]}
    )
    assert checked_seeds(kind([7, 5])) == (7, 5)
    ranges = Sample("sobol", {"k1": kind([0.0, 1.0])}, points=2).settings(FIRE)
    assert ranges == Sample("sobol", {"k1": [0.0, 1.0]}, points=2).settings(FIRE)


@pytest.mark.parametrize("values", [np.array(3), np.array([]), pd.Series([], dtype=float)])
def test_an_array_without_values_is_refused_as_a_list_without_any_is(values):
    with pytest.raises(InvalidValueError, match=r"k1 is .*; expected a list of values"):
        grid(FIRE, {"k1": values})
    if np.ndim(values):
        with pytest.raises(InvalidValueError, match="number of seeds is 0"):
            checked_seeds(values)
