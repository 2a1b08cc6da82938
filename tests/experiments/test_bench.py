"""The worlds of benchmarks: of time, of driving and of learning."""

import numpy as np
import pytest

from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.experiments.bench import contact_alone, on_map, step_seconds
from mesa_swarm.experiments.driving import MEASURES, drive_measured, driven_world
from mesa_swarm.experiments.learn_bench import Benchmark, group_of, is_training, map_named
from mesa_swarm.experiments.learning_figures import demonstrated, fire_run
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.robots.design import AGENT9


def test_robots_of_contact_alone_have_no_sensors_and_drive_in_circles():
    model = contact_alone(10)
    assert model.swarm.distance.shape == (10, 0)
    model.run(3)
    assert (model.swarm.command == (1.0, 0.8)).all()


def test_robots_on_a_map_have_so_many_sensors():
    assert on_map(3, "sparse", sensors=6).swarm.distance.shape == (3, 6)


def test_the_time_of_a_step_that_does_nothing_is_short():
    assert 0 <= step_seconds(lambda: None, repetitions=3, budget=0.001) < 0.01


def test_a_robot_that_drives_ahead_in_open_space_does_not_collide():
    measured = drive_measured(driven_world(Subsumption(Explore()), AGENT9, 1, "openspace", 1), 10)
    assert tuple(measured) == MEASURES
    assert (measured["collisions"], measured["speed ahead"]) == (0.0, 1.0)


def test_ten_seeds_of_a_benchmark_cover_the_generated_maps():
    bench = Benchmark(seeds=10)
    assert len(list(bench.runs())) == 100
    assert bench.maps(1) == ("original", "sparse", "openspace", "openspace_fire", "random 1", "random 2")
    generated = [place for seed in range(1, 11) for place in bench.maps(seed) if place.startswith("random")]
    assert generated == [f"random {number}" for number in range(1, 21)]


def test_an_outcome_without_all_measures_is_not_a_training():
    assert not is_training(Outcome(results={"robot-steps": 15.0}))


@pytest.mark.parametrize(("place", "group"), [("original", "home"), ("sparse", "built in"), ("random 7", "generated")])
def test_maps_have_names_and_groups(place, group):
    assert map_named(place).name == place
    assert group_of(place) == group


def test_rounds_of_learning_fires_have_their_steps():
    assert fire_run("shared", rng=1, steps=30, round_steps=10, n_robots=2).rounds.tolist() == [10, 10, 10]


def test_the_demonstrated_curve_is_that_of_two_units():
    assert demonstrated(np.array([0.0]))[0] == pytest.approx(0.6 * np.tanh(1) + 0.4 * np.tanh(2))
