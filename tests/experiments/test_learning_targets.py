"""What learners must reach: a bred reflex on maps that it never saw, and Q-learning in time."""

from statistics import mean

import pytest

from mesa_swarm import AGENT9
from mesa_swarm.control import Subsumption
from mesa_swarm.experiments.benchmark_tasks import TEST, benchmark_tasks
from mesa_swarm.experiments.contestants import BREEDING, CHOOSING, contestants
from mesa_swarm.experiments.driving import driven_world
from mesa_swarm.learning import QLearning
from mesa_swarm.learning.evolution import Evolution
from support.machine import slowness
from support.pace import processor_seconds

# Not chosen: the first of the benchmark's ten.
SEED = 1
# Twenty test maps.
UNSEEN = TEST[:20]


def means_on(maps, trained):
    rows = [benchmark_tasks()["avoid"].drive(trained.frozen, f"random {k}", SEED, 5000) for k in maps]
    return {measure: mean(row[measure] for row in rows) for measure in rows[0]}


@pytest.mark.slow
def test_a_bred_reflex_frozen_hardly_collides_is_fast_and_sees_no_less_than_the_rule_on_twenty_unseen_maps(monkeypatch):
    contestants()["evolved reflex"](SEED, 33)  # compiles, or reads a cache
    slow, usual = [], Evolution.tell
    monkeypatch.setattr(Evolution, "tell", lambda self, worth: slow.append(slowness()) or usual(self, worth))
    bred = []
    used = processor_seconds(lambda: bred.append(contestants()["evolved reflex"](SEED, 33_000)))
    (trained,) = bred
    rule = contestants()["Avoid + Explore"](SEED, 0)
    reflex, mark = (means_on(UNSEEN, each) for each in (trained, rule))
    time_used = f"{used:.0f} s on a processor {mean(slow):.2f} times slower than usual"
    print(f"\n{trained.robot_steps:,} robot-steps in {time_used}; reflex {reflex}; rule {mark}")
    assert not set(UNSEEN) & {*BREEDING, *CHOOSING}
    assert trained.robot_steps <= 10_000_000
    assert reflex["collisions"] <= 0.5
    assert reflex["speed ahead"] >= 0.6
    assert reflex["coverage"] >= mark["coverage"]
    assert used / mean(slow) <= 60, time_used


@pytest.mark.slow
def test_fifteen_robots_learn_for_33_000_steps_in_ten_seconds_of_one_core():
    model = driven_world(Subsumption(QLearning()), AGENT9, 15, "original", 1).run(10)
    used = processor_seconds(lambda: model.run(33_000))
    slow = max(slowness() for _ in range(5))
    print(f"\n{used:.1f} s, {15 * 33_000 / used:,.0f} robot-steps/s; {slow:.1f} times slower than usual")
    assert used <= 10 * slow
