"""What learners must reach: a bred reflex on maps that it never saw, and Q-learning in time."""

from statistics import mean

import pytest

from mesa_swarm import AGENT9
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import QLearning
from mesa_swarm.learning.evolution import Evolution
from mesa_swarm.searches.drive_measures import driven_world
from mesa_swarm.searches.validation_gate import driven_by
from mesa_swarm_studies.benchmarks.benchmark_tasks import TEST, benchmark_tasks
from mesa_swarm_studies.benchmarks.contestants import BREEDING, CHOOSING, Trained, bred, contestants
from support.machine import slowness
from support.pace import processor_seconds

# Not chosen: the first of the benchmark's ten.
SEED = 1
# Twenty test maps of the benchmark, and twenty more that nothing is trained or chosen on.
TWENTY, UNSEEN = TEST[:20], range(40_001, 40_021)


def drives_on(maps, trained):
    return [benchmark_tasks()["avoid"].drive(trained.frozen, f"random {k}", SEED, 5000) for k in maps]


def means_on(maps, trained):
    rows = drives_on(maps, trained)
    return {measure: mean(row[measure] for row in rows) for measure in rows[0]}


@pytest.mark.long
def test_a_bred_reflex_frozen_hardly_collides_is_fast_and_sees_no_less_than_the_rule_on_twenty_unseen_maps(monkeypatch):
    bred(0, SEED, 0.001)  # compiles, or reads a cache
    slow, usual = [], Evolution.tell
    monkeypatch.setattr(Evolution, "tell", lambda self, worth: slow.append(slowness()) or usual(self, worth))
    found = []
    used = processor_seconds(lambda: found.append(bred(0, SEED).policy))
    trained = Trained(frozen=driven_by(found[0]), robot_steps=found[0].steps)
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


@pytest.mark.long
def test_shared_q_learning_cools_in_a_million_robot_steps_and_frozen_it_hardly_collides_on_nine_of_ten_unseen_maps():
    # Its processor time is in the benchmark's table of trainings.
    learned = contestants()["shared Q (b), cooled"](SEED, 33_000)
    drives = drives_on(TWENTY, learned)
    rule = mean(row["coverage"] for row in drives_on(TWENTY, contestants()["Avoid + Explore"](SEED, 0)))
    print(f"\n{learned.robot_steps:,} robot-steps; {drives}; coverage of the rule {rule}")
    assert learned.robot_steps <= 1_000_000
    assert sum(row["collisions"] <= 0.5 for row in drives) >= 0.9 * len(TWENTY)
    assert min(row["speed ahead"] for row in drives) >= 0.6
    assert mean(row["coverage"] for row in drives) >= rule


@pytest.mark.long
def test_fifteen_robots_learn_for_33_000_steps_in_ten_seconds_of_one_core():
    model = driven_world(Subsumption(QLearning()), AGENT9, 15, "original", 1).run(10)
    used = processor_seconds(lambda: model.run(33_000))
    slow = max(slowness() for _ in range(5))
    print(f"\n{used:.1f} s, {15 * 33_000 / used:,.0f} robot-steps/s; {slow:.1f} times slower than usual")
    assert used <= 10 * slow
