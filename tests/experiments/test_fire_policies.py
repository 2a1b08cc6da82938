"""Policies at fires on unseen maps: what is measured, that seeds decide all, and that wheel actions are learned."""

import numpy as np
import pytest

from mesa_swarm.cli import main
from mesa_swarm.control import Avoid, Explore
from mesa_swarm.errors import SwarmError
from mesa_swarm.experiments.fire_policies import (
    FIRES,
    MEASURES,
    TRAINING,
    UNSEEN,
    FireTrial,
    contenders,
    fire_policies,
    fire_table,
    fought,
    trained_wheels,
)
from mesa_swarm.fire import FightFire
from mesa_swarm.learning import LearnFireWheels
from mesa_swarm.world.random_map import random_map

BRIEF = FireTrial(skill_steps=60, wheel_steps=60, steps=30)


def test_a_run_ends_when_all_fires_are_out_and_shares_are_those_of_its_fires():
    world = random_map(20_200, obstacles=2, size=(300, 300), fires=1)
    layers = Avoid(fires="never"), FightFire(strategy="B"), Explore()
    done = fought(layers, world, 1, 8000)
    assert (done["share found"], done["share out"], done["largest out"]) == (1.0, 1.0, 1.0)
    assert 10 < done["steps"] < 8000
    cut = fought(layers, world, 1, 10)
    assert (cut["share out"], cut["steps"]) == (0.0, 10.0)


@pytest.mark.slow
def test_seeds_decide_all_results_whatever_takes_part():
    every = fire_policies(1, trial=BRIEF)
    assert list(every) == list(contenders(BRIEF))
    assert fire_policies(1, trial=BRIEF, only=["wheel actions"]) == {"wheel actions": every["wheel actions"]}
    assert all(set(row) == set(MEASURES) for runs in every.values() for row in runs)


def test_maps_of_training_are_not_among_those_of_the_comparison():
    assert max(TRAINING) < UNSEEN
    assert all(len(random_map(UNSEEN + k, fires=FIRES).fires) == FIRES for k in (1, 2))


def test_the_table_has_a_line_for_each_contender():
    lines = fire_table({"A": [dict.fromkeys(MEASURES, 1.0)] * 2}).splitlines()
    assert [line.split("|")[1].strip() for line in lines] == ["contender", "----------------"[:9], "A"]


def test_the_command_writes_what_it_prints(tmp_path, capsys):
    brief = ["--skill-steps", "20", "--wheel-steps", "20", "--steps", "20", "--seeds", "2", "--jobs", "1"]
    with pytest.raises(SystemExit) as end:
        main(["fire-policies", *brief, "--only", "strategy B;skills at random", "--out", str(tmp_path / "f")])
    assert end.value.code == 0
    assert (tmp_path / "f" / "fire_policies.md").read_text() in capsys.readouterr().out
    assert len((tmp_path / "f" / "fire_policies.csv").read_text().splitlines()) == 5


def test_contenders_that_do_not_exist_are_refused():
    with pytest.raises(SwarmError, match="unknown only 'C'"):
        fire_policies(1, only=["C"])


@pytest.mark.slow
def test_robots_that_share_what_they_learn_by_wheel_speeds_put_out_the_fires_of_maps_that_they_never_saw():
    shares = []
    for seed in (2001, 2002):
        layer = LearnFireWheels(start=trained_wheels(seed), frozen=True)
        runs = [fought([layer], random_map(20_300 + k, fires=FIRES), seed + k, 8000) for k in range(2)]
        shares += [run["share out"] for run in runs]
    assert np.mean(shares) > 0.7
