"""The worlds of benchmarks: of time, of driving and of learning."""

import math

import numpy as np
import pytest

from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.experiments.learning_figures import fire_run
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.searches.drive_measures import MEASURES, drive_measured, driven_world
from mesa_swarm_studies.benchmarks import speed as timing
from mesa_swarm_studies.benchmarks.learn_bench import is_training
from mesa_swarm_studies.benchmarks.speed import (
    CUSTOM_RULE,
    FIRST_STEP,
    FULL,
    LEARNERS,
    LISTING,
    MEASUREMENTS,
    Effort,
    Goal,
    NotMeasuredError,
    bytes_per_robot,
    contact_alone,
    free_bytes,
    gathering,
    goals_csv,
    largest_world,
    on_map,
    paired_seconds,
    peer_workload,
    printed_numbers,
    recorded_step,
    step_seconds,
    two_threads,
)
from mesa_swarm_studies.thesis.networks import demonstrated


def test_robots_of_contact_alone_have_no_sensors_and_drive_in_circles():
    model = contact_alone(10)
    assert model.swarm.distance.shape == (10, 0)
    model.run(3)
    assert (model.swarm.command == (1.0, 0.8)).all()


def test_robots_on_a_map_have_so_many_sensors():
    assert on_map(3, "sparse", sensors=6).swarm.distance.shape == (3, 6)


def test_the_time_of_a_step_that_does_nothing_is_short():
    assert 0 <= step_seconds(lambda: None, repetitions=3, budget=0.001) < 0.01


def test_a_goal_is_an_upper_or_a_lower_limit():
    most, least = Goal(what="a", unit="s", limit=2.0), Goal(what="a", unit="s", limit=2.0, least=True)
    assert [most.passed(value) for value in (1.9, 2.0, 2.1)] == [True, True, False]
    assert [least.passed(value) for value in (1.9, 2.0, 2.1)] == [False, True, True]


def test_a_number_without_a_limit_is_neither_passed_nor_missed():
    training = Goal(what="training", unit="s")
    assert training.verdict(3.14159) == "training, s: 3.14"
    assert goals_csv([(training, 3.0)]).splitlines()[1] == "training,s,3.0,,,"


def test_no_two_goals_are_of_the_same():
    named = [(goal.what, goal.unit) for measurement in MEASUREMENTS for goal in measurement.goals]
    assert len(set(named)) == len(named)


def test_robots_that_gather_are_in_crowds():
    model = gathering(300).run(100)
    assert model.collisions > 0
    assert model.datacollector.model_vars["collisions"] == []


def test_pairs_of_threads_take_the_same_steps_as_a_run():
    model, same = peer_workload(20), peer_workload(20)
    one, two, faster = paired_seconds(model, repetitions=3, budget=0.001)
    assert min(one, two, faster) > 0
    assert model.state_hash() == same.run(model.steps).state_hash()


def test_two_threads_are_not_measured_on_one_processor(monkeypatch):
    monkeypatch.setattr(timing.joblib, "cpu_count", lambda: 1)
    with pytest.raises(NotMeasuredError, match="one processor"):
        two_threads(10, FULL)


@pytest.mark.slow
def test_the_largest_world_is_measured_in_its_own_process():
    placed, two, growth, peak = largest_world(1500)
    assert (placed > 0, math.isfinite(growth)) == (True, True)
    assert math.isnan(two) or two > 0
    assert math.isnan(peak) or 0.05 < peak < 5


def test_a_recorded_step_takes_some_share_of_a_plain_one():
    assert recorded_step(5, Effort(repetitions=1, budget=0.0)) > 0


def test_the_largest_world_is_not_made_without_memory_for_it(monkeypatch):
    assert free_bytes() > 0
    monkeypatch.setattr(timing, "free_bytes", lambda: 1e9)
    with pytest.raises(NotMeasuredError, match=r"3\.0 GB of free memory are needed, 1\.0 GB are free"):
        largest_world(1_000_000)


def test_a_process_that_fails_is_reported_in_one_line():
    with pytest.raises(NotMeasuredError, match="status 1: ValueError: wrong"):
        printed_numbers("raise ValueError('wrong')")


def test_processes_have_one_thread_and_the_environment_that_is_given(monkeypatch):
    monkeypatch.setenv("MESA_SWARM_THREADS", "2")
    program = "import os; print(int('MESA_SWARM_THREADS' in os.environ), os.environ['NUMBER'])"
    assert printed_numbers(program, environment={"NUMBER": "3.5"}) == [0, 3.5]


@pytest.mark.slow
@pytest.mark.parametrize(("program", "count"), [(CUSTOM_RULE, 1), (LISTING, 1), (FIRST_STEP, 3)])
def test_a_program_that_is_measured_prints_its_numbers(program, count):
    numbers = printed_numbers(program)
    assert len(numbers) == count
    assert min(numbers) > 0


@pytest.mark.slow
def test_learners_print_robot_steps_and_the_time_of_a_new_episode():
    assert min(printed_numbers(LEARNERS, "2", "3")) > 0


def test_a_robot_takes_some_hundred_bytes():
    assert 200 < bytes_per_robot(500) < 5000


def test_a_robot_that_drives_ahead_in_open_space_does_not_collide():
    measured = drive_measured(driven_world(Subsumption(Explore()), AGENT9, 1, "openspace", 1), 10)
    assert tuple(measured) == MEASURES
    assert (measured["collisions"], measured["speed ahead"]) == (0.0, 1.0)


def test_an_outcome_without_all_measures_is_not_a_training():
    assert not is_training(Outcome(results={"robot-steps": 15.0}))


def test_rounds_of_learning_fires_have_their_steps():
    assert fire_run("shared", rng=1, steps=30, round_steps=10, n_robots=2).rounds.tolist() == [10, 10, 10]


def test_the_demonstrated_curve_is_that_of_two_units():
    assert demonstrated(np.array([0.0]))[0] == pytest.approx(0.6 * np.tanh(1) + 0.4 * np.tanh(2))
