"""Policies that are learned at fires for the benchmark: that seeds decide all, and that wheel actions are learned."""

from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import LearnFireWheels
from mesa_swarm.searches.validation_gate import VALIDATION
from mesa_swarm_studies.benchmarks.benchmark_tasks import TEST, TRAIN, benchmark_tasks
from mesa_swarm_studies.benchmarks.fire_policies import FIRES, TRAINING, trained_skills, trained_wheels
from mesa_swarm_studies.benchmarks.task_contestants import contestants_of

SETTING = benchmark_tasks()["extinguish_fires"]


def test_a_run_ends_when_all_fires_are_out():
    small = replace(SETTING, maps={"obstacles": 2, "size": (300, 300), "fires": 1}, steps=8000)
    rule = contestants_of("extinguish_fires")["strategy B"](1, 0).frozen
    done = small.drive(rule, "random 20200", 1, 8000)
    assert (done["fires out"], done["largest fire out"]) == (1.0, 1.0)
    assert 10 < done["steps"] < 8000
    cut = small.drive(rule, "random 20200", 1, 10)
    assert (cut["fires out"], cut["steps"]) == (0.0, 10.0)


def test_the_maps_of_training_are_not_those_of_validation_or_test():
    assert not {*TRAINING, *TRAIN} & {*VALIDATION, *TEST}
    assert len(SETTING.map_named(f"random {TEST[0]}").fires) == FIRES


@pytest.mark.parametrize("train", [trained_skills, trained_wheels])
@pytest.mark.parametrize("wrong", [{"seed": "one"}, {"seed": -1}, {"steps": 0}, {"steps": "many"}], ids=str)
def test_a_wrong_seed_or_number_of_steps_is_refused_before_training(train, wrong):
    with pytest.raises(InvalidValueError, match=f"^({next(iter(wrong))}|rng) is "):
        train(**{"seed": 1, "steps": 10, **wrong})


@pytest.mark.long
def test_seeds_decide_what_is_learned():
    skills, again, other = (trained_skills(seed, 60).arrays()["values"] for seed in (1, 1, 2))
    assert (skills == again).all()
    assert not (skills == other).all()
    wheels, again, other = (trained_wheels(seed, 60).networks.inner for seed in (1, 1, 2))
    assert (wheels == again).all()
    assert not (wheels == other).all()


def test_the_rule_passes_the_gate_of_its_task_and_validations_are_ordered_by_passing_and_by_the_main_measure():
    small = replace(benchmark_tasks()["aggregation"], maps={"size": (200, 200), "obstacles": 0})
    gate = small.gate(20)
    rule = gate.validate(Subsumption(*small.task.others()))
    assert rule.passed
    found = [replace(rule, measures={"largest cluster": size}, met=(size > 0.5,)) for size in (0.3, 0.9, 0.4, 0.6)]
    assert [each.measures["largest cluster"] for each in sorted(found, key=gate.rank)] == [0.9, 0.6, 0.4, 0.3]


@pytest.mark.long
def test_robots_that_share_what_they_learn_by_wheel_speeds_put_out_the_fires_of_maps_that_they_never_saw():
    shares = []
    for seed in (2001, 2002):
        control = Subsumption(LearnFireWheels(start=trained_wheels(seed), frozen=True))
        shares += [SETTING.drive(control, f"random {20_300 + k}", seed, 8000)["fires out"] for k in range(2)]
    assert np.mean(shares) > 0.7
