"""A robot at a fire, alone and with a second one; single robots; followers."""

import numpy as np
import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm_studies.thesis.fire_company import LARGEST, lone_fire_model, mean_stay, stay_run
from mesa_swarm_studies.thesis.fire_fighting import fire_run, search_run, searching_model


def test_stays_are_counted_from_coming_to_leaving():
    fights = np.array([0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1], bool)
    assert mean_stay(fights) == 3.0
    assert mean_stay(np.zeros(4, bool)) is None


def test_a_robot_alone_stays_as_long_as_its_heat_allows_and_the_fire_does_not_cool():
    run = stay_run(10_000, company=False, steps=1_000)
    # The first stay, from no heat to 100, then from 10: one degree a step.
    assert run["first stays"] == pytest.approx(np.mean([100, *[90] * 5]), abs=1.0)
    assert run["change"] == 0.0
    assert run["second stays"] is None


def test_with_a_second_robot_the_fire_cools_and_both_stay_longer():
    alone, joined = (stay_run(10_001, company=company) for company in (False, True))
    assert joined["change"] < 0.0
    assert min(joined["first stays"], joined["second stays"]) > alone["first stays"]


def test_runs_are_equal_until_the_second_robot_has_come():
    alone, joined = (stay_run(10_002, company=company, steps=60) for company in (False, True))
    assert alone["temperature"] == joined["temperature"]


def test_a_robot_begins_in_sight_of_the_large_fire_and_goes_to_it():
    model = lone_fire_model(10_003, 1.0).run(60)
    assert model.swarm.fire.tolist() == [LARGEST]


@pytest.mark.slow
@pytest.mark.parametrize("strategy", ["A", "B"])
def test_where_fires_need_two_robots_one_puts_none_out(strategy):
    assert fire_run(10_000, strategy=strategy, robots=1, alone=False, steps=6_000)["out"] == 0
    assert fire_run(10_000, strategy=strategy, robots=1, steps=15_000)["out"] > 0


def test_a_robot_that_has_not_found_a_fire_counts_with_all_steps():
    assert search_run(10_000, team="half", steps=1) == {"all": 1.0, "explorers": 1.0, "followers": 1.0}


def test_in_the_mixed_team_the_last_half_follow():
    model = searching_model(10_000, "half")
    assert [robot.group for robot in model.robots] == ["explorers"] * 5 + ["followers"] * 5
    follow, seen = model.control.names.index("Follow"), set()
    for _ in range(2_000):
        model.step()
        seen |= set(np.flatnonzero(model.swarm.layer == follow).tolist())
    assert seen
    assert min(seen) >= 5


def test_without_follow_all_robots_explore_as_before():
    assert "Follow" not in FireFighting(rng=3).control.names
    assert FireFighting(rng=3, follow="on").control.names == ("Avoid", "FightFire", "Follow", "Explore")
