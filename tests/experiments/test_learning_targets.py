"""What learners must reach: a bred network on maps that it never saw, and Q-learning in time."""

import time

import numpy as np
import pytest

from mesa_swarm import AGENT9
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.experiments.contestants import BREEDING, GENERATIONS
from mesa_swarm.experiments.driving import drive_measured, driven_world
from mesa_swarm.experiments.evolution import Trial, evolve
from mesa_swarm.experiments.learn_bench import APART
from mesa_swarm.learning import PolicyLayer, QLearning
from mesa_swarm.world.random_map import random_map

UNSEEN = range(1, 21)


def measured(control, number):
    return drive_measured(driven_world(control, AGENT9, 15, random_map(number), APART + number), 5000)


def means(control):
    rows = [measured(control, number) for number in UNSEEN]
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}


@pytest.mark.slow
def test_a_bred_network_frozen_hardly_collides_is_fast_and_sees_no_less_than_the_rule_on_twenty_unseen_maps():
    used = time.process_time()
    maps = [each if isinstance(each, str) else random_map(each) for each in BREEDING]
    bred = evolve(Trial(), maps=maps, generations=GENERATIONS, rng=2)
    used = time.process_time() - used
    network, rule = means(Subsumption(PolicyLayer(policy=bred.policy))), means(Subsumption(Avoid(), Explore()))
    print(f"\n{bred.policy.steps:,} robot-steps in {used:.0f} s; network {network}; rule {rule}")
    assert not {f"random {number}" for number in UNSEEN} & {each.name for each in maps if not isinstance(each, str)}
    assert bred.policy.steps <= 10_000_000
    assert network["collisions"] <= 0.5
    assert network["speed ahead"] >= 0.6
    assert network["coverage"] >= rule["coverage"]
    assert used <= 60


@pytest.mark.slow
def test_fifteen_robots_learn_for_33_000_steps_in_ten_seconds_of_one_core():
    model = driven_world(Subsumption(QLearning(actions=4)), AGENT9, 15, "original", 1).run(10)
    begun = time.process_time()
    model.run(33_000)
    used = time.process_time() - begun
    print(f"\n{used:.1f} s, {15 * 33_000 / used:,.0f} robot-steps/s")
    assert used <= 10
