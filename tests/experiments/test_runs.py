"""Runs, their outcomes, and the experiment that they are part of."""

from fractions import Fraction

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.experiments.experiment import (
    check_result_names,
    checked_class,
    checked_experiment,
    checked_seeds,
    checked_settings,
    checked_steps,
    shown_value,
)
from mesa_swarm.experiments.fingerprints import engine_hash, fingerprint
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.plan import checked_plan
from mesa_swarm.experiments.runs import (
    Run,
    attempt,
    call,
    do_runs,
    error_in_words,
    has_numbers,
    is_plain,
    numbers_of,
    simulate,
)
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import find_model

FIRE = find_model("fire_fighting")


def test_runs_of_functions_yield_their_numbers():
    squares = [Run(lambda rng: {"square": rng**2}, {}, rng) for rng in (2, 3)]
    assert [outcome.results for _, outcome in do_runs(squares, call, count=2)] == [{"square": 4}, {"square": 9}]


def test_a_run_of_a_model_has_its_results_and_one_that_fails_its_error():
    assert simulate(Run(FIRE, {"n_robots": 2}, rng=1, steps=5)).numbers["fires out"] == 0
    failed = attempt(Run(FIRE, {"n_robots": -1}, rng=1, steps=5))
    assert failed.error.startswith("InvalidValueError: n_robots is -1; expected a whole number at least 0")


def test_an_error_is_one_line_without_addresses():
    assert error_in_words(ValueError("no\n<Robot object at 0x7f00>")) == "ValueError: no <Robot object>"


def test_results_become_numbers_of_pythons():
    numbers = numbers_of({"groups": np.int64(3), "share": Fraction(1, 2), "arrived at": None})
    assert numbers == {"groups": 3, "share": 0.5, "arrived at": None}
    assert type(numbers["groups"]) is int


@pytest.mark.parametrize(
    ("number", "plain"), [(None, True), (3, True), (float("nan"), False), (10**300, False), ([1.0], False)]
)
def test_a_plain_result_is_a_number_that_a_file_holds_or_none(number, plain):
    assert is_plain(number) is plain
    assert has_numbers(Outcome(results={"groups": number})) is plain


def test_an_error_has_no_numbers():
    assert not has_numbers(Outcome(error="it broke"))


def test_an_experiment_runs_point_by_point_and_a_comparison_seed_by_seed():
    two = checked_experiment("fire_fighting", {"strategy": ["A", "B"]}, seeds=[7, 5], steps=5)
    assert [(run.settings["strategy"], run.rng) for run in two.runs()] == [("A", 7), ("A", 5), ("B", 7), ("B", 5)]
    plan = checked_plan("fire_fighting", seeds=2)
    assert (plan.parameter, plan.values) == ("strategy", ("A", "B"))
    assert [(run.rng, run.settings["strategy"]) for run in plan.runs()] == [(1, "A"), (1, "B"), (2, "A"), (2, "B")]


def test_a_model_is_found_by_name_and_declares_its_steps():
    assert checked_class("fire_fighting") is FIRE
    assert checked_steps(FIRE, None) == FIRE.steps_to_compare == 15_000


def test_seeds_are_counted_from_one_or_listed():
    assert (list(checked_seeds(3)), checked_seeds([7, 5])) == ([1, 2, 3], (7, 5))


def test_settings_are_checked_and_a_map_is_shown_by_name_and_content():
    assert checked_settings(FIRE, {"n_robots": 3}) == {"n_robots": 3}
    shown = [shown_value(Map.load(name)) for name in ("original", "original", "sparse")]
    assert shown[0] == shown[1] != shown[2]
    assert shown[0].startswith("original (")
    assert shown_value(2.5) == 2.5


def test_a_result_that_is_named_as_another_column_is_refused():
    with pytest.raises(InvalidValueError, match=r"result 'steps' is named as another column; rename it in results\(\)"):
        check_result_names({"steps": 1.0}, {"rng", "steps"})


def test_a_fingerprint_does_not_depend_on_the_order_of_settings():
    assert fingerprint("boids", {"a": 1, "b": 2}, 7) == fingerprint("boids", {"b": 2, "a": 1}, 7)
    assert fingerprint("boids", {"a": 1}, 7) != fingerprint("boids", {"a": 1}, 8)


def test_the_hash_of_the_engine_depends_on_the_files_that_it_covers():
    assert engine_hash() == engine_hash()
    assert len({engine_hash(), engine_hash("base/errors.py"), engine_hash(models=True)}) == 3
