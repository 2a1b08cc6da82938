"""Tuning: the goal cannot be reached by standing still, the search stays within its limits, and is reproducible."""

import math
import os

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.q_learning import QLearning
from mesa_swarm.searches import tuning
from mesa_swarm.searches.tuning import LIMITS, THESIS, LearningGoal, Tuned, _placed, goal_run, settings_at, tune
from mesa_swarm_studies.thesis.tuning import GOAL
from support.killing import kill_at_call, lines_in

SHORT = LearningGoal(steps=15, robots=2, least_speed=0.2)


def test_robots_that_stand_still_cost_more_than_robots_that_collide_at_the_goal_s_speed():
    goal = LearningGoal(least_speed=0.28)
    assert goal.cost(collisions=0.0, speed=0.0) > goal.cost(collisions=200.0, speed=0.28)
    assert goal.cost(collisions=40.0, speed=0.5) == goal.cost(collisions=40.0, speed=0.28) == 40.0


def test_robots_that_stand_still_miss_the_goal_s_speed_by_default_too():
    assert LearningGoal().cost(collisions=0, speed=0) == pytest.approx(280.0)
    assert LearningGoal().least_speed == GOAL.least_speed == tuning.LEAST_SPEED


def judged(monkeypatch, thesis, tuned):
    """Return the table and the remarks on runs that are given as collisions and speeds, a pair a run."""
    runs = iter([*thesis, *tuned])
    monkeypatch.setattr(tuning, "goal_run", lambda **settings: dict(zip(tuning.MEASURES, next(runs), strict=True)))
    other = {**THESIS, "gamma": 0.5}
    return tuning.comparison(Tuned(settings=other, goal=LearningGoal(), costs=()), seeds=range(len(thesis)))


SLOWER, FASTER = [(40.0 + i, 0.28) for i in range(6)], [(20.0 + i % 2, 0.3) for i in range(6)]


def test_a_better_result_at_the_goal_s_speed_is_judged_without_a_remark(monkeypatch):
    assert judged(monkeypatch, SLOWER, FASTER).remarks == ()


def test_a_missed_speed_is_stated(monkeypatch):
    still = [(collisions, 0.1) for collisions, _ in FASTER]
    assert judged(monkeypatch, SLOWER, still).remarks == ("the goal's speed was missed: 0.1 instead of 0.28",)


def test_it_is_stated_that_no_difference_was_shown_or_that_collisions_are_more(monkeypatch):
    (remark,) = judged(monkeypatch, SLOWER, SLOWER[::-1]).remarks
    assert remark.startswith("no difference shown")
    (remark,) = judged(monkeypatch, [(collisions, 0.28) for collisions, _ in FASTER], SLOWER).remarks
    assert remark.startswith("more collisions than with the thesis's settings")


@pytest.mark.parametrize("seeds", [[1], range(1)])
def test_a_single_run_which_has_no_interval_does_not_judge(seeds):
    with pytest.raises(SwarmError, match=r"^number of seeds is 1; expected a whole number at least 2"):
        tuning.comparison(Tuned(settings=THESIS, goal=SHORT, costs=()), seeds=seeds)


@given(st.lists(st.floats(-5, 5), min_size=4, max_size=4))
def test_every_place_of_the_search_has_settings_within_the_limits(place):
    for name, value in settings_at(np.array(place)).items():
        low, high = LIMITS[name]
        assert low - 1e-12 <= value <= high + 1e-12


def test_the_search_begins_at_the_thesis_s_settings():
    assert settings_at(_placed(THESIS)) == pytest.approx(THESIS)


def test_a_run_with_the_thesis_s_settings_is_a_run_of_the_model():
    run = goal_run(3, steps=40, robots=4, map="original", **THESIS)
    model = QLearning(n_robots=4, rng=3).run(40)
    assert run["collisions"] == pytest.approx(1000 * model.total_collisions / 160)
    assert run["speed"] == pytest.approx(np.mean(model.datacollector.model_vars["forward_speed"]))


def test_the_same_arguments_give_the_same_settings_and_costs():
    first, second = (tune(SHORT, generations=2, population=4, seeds=[1, 2], rng=5) for _ in range(2))
    assert first.settings == second.settings
    assert first.costs == second.costs
    assert np.shape(first.costs) == (2, 4)


def test_a_candidate_costs_what_its_mean_collisions_and_its_mean_speed_cost():
    found = tune(SHORT, generations=1, population=4, seeds=[1, 2])
    runs = [goal_run(seed, steps=15, robots=2, map="original", **found.settings) for seed in (1, 2)]
    means = {name: np.mean([run[name] for run in runs]) for name in ("collisions", "speed")}
    assert min(found.costs[0]) == pytest.approx(SHORT.cost(**means))


TUNING = """
goal = module.LearningGoal(steps=15, robots=2, least_speed=0.2)
module.tune(goal, generations=2, population=4, seeds=[1, 2], rng=5, out=home)
"""


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_search_whose_process_is_killed_continues_with_what_is_done_and_ends_in_the_same_result(
    tmp_path, monkeypatch
):
    kill_at_call(tuning.__name__, "goal_run", 11, TUNING, tmp_path, tmp_path / "errors")
    assert lines_in(tmp_path / "runs.jsonl") == 10
    done = []
    monkeypatch.setattr(tuning, "goal_run", lambda **settings: done.append(settings) or goal_run(**settings))
    arguments = {"generations": 2, "population": 4, "seeds": [1, 2], "rng": 5}
    again = tune(SHORT, out=tmp_path, tables=["csv"], **arguments)
    assert len(done) == 6
    assert again == tune(SHORT, **arguments)
    rows = pd.read_csv(tmp_path / "runs.csv")
    assert rows["rng"].tolist() == [1, 2] * 8
    assert [*rows] == [*LIMITS, "rng", "steps", "state_hash", "collisions", "speed", "error"]


def test_runs_of_another_goal_speed_are_found_and_those_of_other_worlds_are_not(tmp_path):
    tune(SHORT, generations=1, population=4, seeds=[1], out=tmp_path)
    faster, longer = LearningGoal(steps=15, robots=2, least_speed=0.3), LearningGoal(steps=16, robots=2)
    for goal, runs in ((faster, 4), (longer, 8)):
        tune(goal, generations=1, population=4, seeds=[1], out=tmp_path)
        assert lines_in(tmp_path / "runs.jsonl") == runs


@pytest.mark.parametrize(
    "wrong",
    [
        {"goal": "fast"},
        {"tables": ["csv"]},
        {"generations": 0},
        {"population": 3},
        {"seeds": []},
        {"seeds": 3},
        {"seeds": [1.5]},
        {"rng": -1},
        {"jobs": 0},
    ],
    ids=str,
)
def test_wrong_arguments_are_refused_before_anything_runs(wrong):
    with pytest.raises(SwarmError) as refusal:
        tune(**{"goal": SHORT, **wrong})
    assert len(str(refusal.value)) <= 300


@pytest.mark.parametrize(
    "wrong", [{"steps": 0}, {"least_speed": math.nan}, {"least_speed": 1.5}, {"robots": 0}, {"map": 3}], ids=str
)
def test_a_goal_out_of_its_ranges_is_refused(wrong):
    with pytest.raises(SwarmError):
        LearningGoal(**wrong)


@pytest.mark.parametrize("missing", [math.nan, None, math.inf])
def test_a_run_without_a_speed_or_a_count_has_no_cost(missing):
    for wrong in ({"collisions": missing, "speed": 0.5}, {"collisions": 1.0, "speed": missing}):
        with pytest.raises(SwarmError, match=r"^(collisions|speed) is .*; expected a finite number"):
            SHORT.cost(**wrong)
