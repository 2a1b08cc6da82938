"""Tuning: the goal cannot be reached by standing still, the search stays within its limits, and is reproducible."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.errors import SwarmError
from mesa_swarm.experiments.tuning import LIMITS, THESIS, LearningGoal, _placed, goal_run, settings_at, tune
from mesa_swarm.models.q_learning import QLearning

SHORT = LearningGoal(steps=15, robots=2, least_speed=0.2)


def test_robots_that_stand_still_cost_more_than_robots_that_collide_at_the_goal_s_speed():
    goal = LearningGoal(least_speed=0.28)
    assert goal.cost(collisions=0.0, speed=0.0) > goal.cost(collisions=200.0, speed=0.28)
    assert goal.cost(collisions=40.0, speed=0.5) == goal.cost(collisions=40.0, speed=0.28) == 40.0


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


@pytest.mark.parametrize(
    "wrong",
    [
        {"goal": "fast"},
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
