"""Grids and samples of parameters."""

import math
from collections import Counter

import numpy as np
import pandas as pd
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.experiments.experiment import checked_experiment
from mesa_swarm.experiments.plan import checked_seeds
from mesa_swarm.experiments.sampling import Points, Range, Sample, grid
from mesa_swarm.model.gallery import find_model
from mesa_swarm.swarm_model import SwarmModel
from support.pace import work_within

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


class Listing(SwarmModel):
    """A model with parameters that cannot be hashed."""

    def __init__(self, *, sizes: list = [1], pair: dict = {}, rng=None) -> None:  # noqa: B006 - it is not changed
        super().__init__(rng=rng)

    def results(self):
        """Return a number."""
        return {"a": 1.0}


@pytest.mark.parametrize(
    ("name", "values"), [("sizes", [[1], [2], [1, [2]]]), ("pair", [{"a": 1}, {"a": 2}, {"a": [1]}])]
)
def test_values_of_a_grid_may_be_lists_and_dicts(name, values):
    assert grid(Listing, {name: values}) == [{name: value} for value in values]
    assert len(checked_experiment(Listing, {name: values}, seeds=2, steps=2)) == 6


@pytest.mark.parametrize(
    ("name", "values"), [("sizes", [[1, {}], [1.0, {}]]), ("pair", [{"a": 1, "b": 2}, {"b": 2.0, "a": True}])]
)
def test_lists_and_dicts_that_are_equal_are_refused_as_values_that_are_there_twice(name, values):
    with pytest.raises(InvalidValueError, match=rf"{name} has .* twice; expected different values"):
        grid(Listing, {name: values})


def test_many_lists_are_distinguished_in_little_time():
    with work_within(2.0):
        assert len(grid(Listing, {"sizes": [[k] for k in range(20_000)]})) == 20_000


def test_lists_that_hold_what_can_only_be_compared_are_distinguished():
    with pytest.raises(InvalidValueError, match=r"sizes has .* twice"):
        grid(Listing, {"sizes": [[bytearray(b"a")], [bytearray(b"b")], [bytearray(b"a")]]})


def test_points_are_equal_if_they_are_the_same_one_by_one():
    values = {"strategy": ["A", "B"], "k1": [0.1, 0.2]}
    one, same, other = (
        checked_experiment(FIRE, v, seeds=2, steps=2) for v in (values, values, {**values, "k1": [0.1, 0.3]})
    )
    assert (one == same, one == other, one.points == grid(FIRE, values), one.points == 3) == (True, False, True, False)
    sample = Sample("sobol", {"k1": (0.0, 1.0)}, points=4)
    assert sample.points_of(FIRE) == sample.settings(FIRE)


def test_points_show_in_one_short_line_what_they_are():
    assert repr(Points({"a": [1, 2]}, crossed=True)) == "Points({'a': [1, 2]}, crossed=True)"
    sample = Sample("sobol", {"k1": (0.0, 1.0)}, points=1024).points_of(FIRE)
    text = repr([Points({"a": [[0.5] * 10_000] * 10_000}, crossed=True), sample])
    assert len(text) < 500
    assert " at 0x" not in text


def test_crossed_columns_vary_the_last_name_fastest_and_others_are_read_side_by_side():
    columns = {"a": [1, 2], "b": [3, 4]}
    assert list(Points(columns, crossed=True))[1:3] == [{"a": 1, "b": 4}, {"a": 2, "b": 3}]
    assert list(Points(columns, crossed=False)) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]


def test_a_logarithmic_range_has_as_many_points_in_each_decade():
    points = Sample("latin_hypercube", {"k1": (1e-4, 1e-1, "log")}, points=30).settings(FIRE)
    assert Counter(math.floor(math.log10(point["k1"])) for point in points) == {-4: 10, -3: 10, -2: 10}


def test_the_values_of_a_parameter_that_is_not_a_number_are_equally_frequent():
    points = Sample("sobol", {"strategy": ["A", "B"], "n_robots": Range(values=(5, 20))}, points=8).settings(FIRE)
    assert Counter((point["strategy"], point["n_robots"]) for point in points) == {
        (strategy, n): 2 for strategy in "AB" for n in (5, 20)
    }


@pytest.mark.parametrize("log", [False, True])
def test_the_ends_of_a_range_are_reached_and_never_passed(log):
    ends = np.array([0.0, 1.0])
    assert Range(low=2, high=9, log=log).at(ends).tolist() == [2, 9]
    assert Range(low=0.5, high=4.0, log=log).at(ends).tolist() == [0.5, 4.0]
    assert Range(values=("A", "B", "C")).at(ends) == ["A", "C"]


@pytest.mark.parametrize(
    "wrong",
    [{}, {"low": 1}, {"low": 1, "high": 2, "values": (1, 2)}, {"values": (1,)}, {"values": (1, 2), "log": True}],
)
def test_a_range_has_two_ends_or_at_least_two_values(wrong):
    with pytest.raises(InvalidValueError, match="a range"):
        Range(**wrong)
