"""Runs end at a condition or at their number of steps, whichever is first, and their row names which of both it was."""

import pandas as pd
import pytest

from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.experiments.compare import compare
from mesa_swarm.experiments.experiment import checked_experiment
from mesa_swarm.experiments.reality_gap import reality_gap
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.experiments.until import checked_condition
from mesa_swarm.searches.calibration import calibrate
from mesa_swarm.searches.sensitivity import sensitivity


class Counting(SwarmModel):
    """Robots and some reports, with a name of two words, with missing values, and with texts."""

    compares = "n_robots", (2, 3)

    def __init__(self, *, n_robots: int = 2, stops_at: int = 100, every: int = 1, rng=None):
        reporters = {
            "now": lambda model: model.completed,
            "half time": lambda model: model.completed / 2,
            "late": lambda model: model.completed if model.completed > 3 else None,
            "word": lambda model: "abc",
        }
        super().__init__(rng=rng, collect_every=every, model_reporters=reporters)
        self.stops_at = stops_at
        self.add_robots(AGENT3, n_robots)

    def step(self):
        super().step()
        self.running = self.completed < self.stops_at

    def results(self):
        return {"robots": len(self.robots)}


def ended(until, tmp_path, **settings):
    """Return the steps of a run, and what ended it."""
    row = sweep(Counting, seeds=1, steps=8, settings=settings, until=until, out=tmp_path, jobs=1).frame().iloc[0]
    return row["steps"], row["ended_by"]


@pytest.mark.parametrize(
    ("until", "steps"),
    [
        ("now == 3", 3),
        ("'half time' >= 2", 4),
        ("now > 2 and not now < 5", 5),
        ("late", 4),
        ("late != 4", 5),
        ("2 * now - 1 > 8 or steps == 7", 5),
        ("now / 0 == 1 or 1 < now < 3", 2),
        (lambda model: model.completed == 6, 6),
    ],
)
def test_a_run_ends_after_the_first_step_at_which_the_condition_holds(until, steps, tmp_path):
    assert ended(until, tmp_path) == (steps, "condition")


def test_a_run_ends_at_its_number_of_steps_or_where_its_model_stops_if_that_is_first(tmp_path):
    assert ended("now > 100", tmp_path) == (8, "steps")
    assert ended("now > 100", tmp_path, stops_at=5) == (5, "model")
    assert ended("now == 8", tmp_path) == (8, "condition")


def test_a_condition_is_of_every_step_also_where_rows_are_collected_now_and_then(tmp_path):
    assert [ended("now == 3", tmp_path, every=every) for every in (0, 4)] == [(3, "condition")] * 2


@pytest.mark.parametrize(
    "text",
    [
        *("", "now ==", "now = 3", "3", "True", "open('x')", "now.real == 1", "now[0] == 1", "now ** 9 > 1", "[now]"),
        *("lambda: now", "now if now else 1", "now in late", "b'x' == now", "1j < now", "now; late", "x := now"),
        *("__import__('os').system('true')", "(" * 900, "now > " + "9" * 400, "now > 1" + " or now > 1" * 200),
    ],
)
def test_what_is_no_comparison_of_reporters_is_refused_in_one_line_and_never_executed(text):
    with pytest.raises(InvalidValueError, match="expected a comparison of reporters with numbers") as refused:
        checked_condition(text)
    assert len(str(refused.value)) < 300
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("until", "words"),
    [
        ("nwo == 3", "unknown report of Counting in until 'nwo'; did you mean 'now'"),
        ("word == 3", "reporter 'word' of Counting returned 'abc'; expected a number"),
        (3, "until is 3; expected a function of the model, or an expression"),
    ],
)
def test_a_condition_that_cannot_be_is_refused_before_any_run(until, words, tmp_path):
    makes = [
        lambda: checked_experiment(Counting, until=until),
        lambda: compare(Counting, seeds=1, until=until),
        lambda: sweep(Counting, until=until, out=tmp_path),
    ]
    for make in makes:
        with pytest.raises(SwarmError, match=words):
            make()
    assert not list(tmp_path.iterdir())


def test_runs_with_other_conditions_are_other_runs_and_those_without_have_the_keys_of_before(tmp_path):
    texts = [None, "now > 3", "now  >  3", "now > 4"]
    plain, first, spaced, other = (next(checked_experiment(Counting, until=text).runs()).key for text in texts)
    assert first == spaced
    assert len({plain, first, other}) == 3
    limits = [next(checked_experiment(Counting, until=beyond(n)).runs()).key for n in (3, 3, 4)]
    assert limits[0] == limits[1] != limits[2]
    assert "ended_by" not in sweep(Counting, seeds=1, steps=2, out=tmp_path, jobs=1).frame()


def beyond(limit):
    """Return a condition that closes over a limit."""
    return lambda model: model.completed > limit


@pytest.mark.slow
def test_a_comparison_ends_at_a_condition_and_continues_from_its_ledger(tmp_path):
    how = {"seeds": 2, "steps": 8, "out": tmp_path, "until": "now == 3"}
    made = [compare(Counting, jobs=jobs, **how) for jobs in (2, 1)]
    assert [comparison.done_before for comparison in made] == [0, 4]
    assert made[0].runs == made[1].runs
    assert {(run.steps, run.ended_by) for run in made[1].runs} == {(3, "condition")}
    made[1].save(tmp_path)
    rows = (tmp_path / "runs.csv").read_text().splitlines()
    assert rows[0].endswith(",robots,ended_by")
    assert all(row.endswith(",condition") for row in rows[1:])


def test_a_reality_gap_is_measured_at_a_condition():
    gap = reality_gap(
        "fire_fighting", dial=(0, 1), seeds=1, steps=60, measure="final value of collisions", until="steps == 9"
    )
    assert list(gap.scores) == [0.0, 1.0]


def test_a_search_for_parameters_ends_its_runs_at_a_condition(tmp_path):
    pytest.importorskip("optuna")
    pytest.importorskip("SALib")
    how = {"seeds": 2, "steps": 8, "until": "now == 3", "jobs": 1}
    ranges = {"n_robots": (2, 4), "stops_at": (20, 40)}
    calibrate(Counting, ranges, lambda means: means["robots"], points=2, batch=2, fresh=2, out=tmp_path / "a", **how)
    sensitivity(Counting, ranges, "mean of now", method="morris", points=2, out=tmp_path / "b", **how)
    for folder in ("a", "a/fresh", "b"):
        assert set(pd.read_parquet(tmp_path / folder / "runs.parquet")["steps"]) == {3}


def test_an_error_in_a_condition_is_that_of_the_run(tmp_path):
    made = sweep(Counting, seeds=1, steps=3, until=lambda model: model.nothing, out=tmp_path, jobs=1)
    assert made.failed == 1
    assert "has no attribute 'nothing'" in made.errors[0]


class Running(Counting):
    """A model with its own way to take many steps."""

    def run(self, steps, progress=False):
        return super().run(steps, progress)


def test_a_model_with_its_own_way_to_run_needs_no_condition(tmp_path):
    assert sweep(Running, seeds=1, steps=3, out=tmp_path, jobs=1).failed == 0


def test_a_model_runs_until_a_function_of_it_is_true():
    assert Counting(rng=1).run(9, until=lambda model: model.completed == 4).completed == 4


@pytest.mark.parametrize(
    ("until", "steps"),
    [
        ("not late", 9),  # missing for three steps, and never 0 afterwards
        ("not (late > 5)", 4),
        ("late != 5", 4),
        ("late < 5 or now == 2", 2),
        ("not (late > 5 and now > 2)", 1),  # the second part is false
        ("not (late > 5 or now > 20)", 4),
    ],
)
def test_what_is_missing_decides_nothing_also_where_it_is_denied(until, steps):
    assert Counting().run(9, until=checked_condition(until)).completed == steps
