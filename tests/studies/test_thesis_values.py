"""Numbers that the thesis gives, where they are defaults here."""

import inspect
import math
import warnings

import pytest

from mesa_swarm import AGENT3, AGENT6, AGENT9, AGENT_FIRE
from mesa_swarm.base.errors import FireConstantsWarning
from mesa_swarm.control import Gather
from mesa_swarm.experiments.jobs import read_job, sample_jobs
from mesa_swarm.fire.constants import design_constants, robots_needed
from mesa_swarm.learning.q_learning import QLearning as QLayer
from mesa_swarm.maps.map import Map
from mesa_swarm.models.q_learning import QLearning

LEARNING = {
    "first_temperature": 1.0,
    "last_temperature": 0.2,
    "alpha": 0.4,
    "eta": 0.1,
    "gamma": 0.7,
}


def test_the_thesis_s_robot_is_ten_units_across():
    assert {2 * design.radius for design in (AGENT3, AGENT6, AGENT9, AGENT_FIRE)} == {10.0}


def test_the_defaults_of_learning_are_the_values_of_the_thesis():
    model = {name: one.default for name, one in inspect.signature(QLearning).parameters.items()}
    assert {name: model[name] for name in LEARNING} == LEARNING
    assert (model["n_robots"], model["map"]) == (15, "original")
    assert model["beta"] in QLearning.compares[1] == (1e-4, 5e-3)
    assert QLearning.steps_to_compare == 33_000
    layer = QLayer()
    assert [getattr(layer, name) or 1.0 for name in LEARNING] == list(LEARNING.values())
    built = QLearning(n_robots=1, rng=1)
    assert len(built.swarm.designs[0].proximity) == 9


@pytest.mark.parametrize(("job", "robots"), [("q_learning_single", 1), ("q_learning_multi", 15)])
def test_the_jobs_of_learning_are_those_of_the_thesis(job, robots):
    (experiment,) = read_job(f"{job}.toml").experiments
    settings = next(experiment.runs()).settings
    assert (settings["n_robots"], settings["map"], experiment.steps) == (robots, "original", 33_000)


def test_the_two_jobs_of_fire_fighting_differ_in_the_strategy_alone():
    jobs = [read_job(f"fire_fighting_{number}.toml").experiments[0] for number in (1, 2)]
    first, second = (next(job.runs()).settings for job in jobs)
    assert {name for name in first.keys() | second.keys() if first.get(name) != second.get(name)} == {"strategy"}
    assert (first["strategy"], second["strategy"]) == ("A", "B")
    assert jobs[0].steps == jobs[1].steps


def test_the_temperature_needs_43819_steps_to_come_within_5_percent_of_its_end():
    def temperature(steps):
        return 0.2 + 0.8 * (1 - 1e-4) ** steps

    assert math.floor(1000 * (1 - temperature(33_000)) / 0.8) == 963
    assert temperature(43_818) > 1.05 * 0.2 >= temperature(43_819)


def test_fifty_robots_gather_with_10_degrees_for_1000_and_3000_steps():
    runs = read_job("agglomeration.toml").experiments
    assert [run.steps for run in runs] == [1_000, 3_000]
    assert all(next(run.runs()).settings["n_robots"] == 50 for run in runs)
    assert all(next(run.runs()).settings["critical_angle"] == 10.0 for run in runs)
    assert Gather().critical_angle_degrees == 10.0


def test_chains_form_on_a_map_of_four_walls_and_nothing_else():
    (experiment,) = read_job("chain_formation.toml").experiments
    settings = next(experiment.runs()).settings
    assert (settings["map"], settings["n_robots"], experiment.steps) == ("openspace", 50, 3_000)
    map_ = Map.load("openspace")
    left, below, right, above = map_.bounds
    walls = [shape.bounds for shape in map_.obstacles]
    assert len(walls) == 4
    assert all(w == left or e == right or s == below or n == above for w, s, e, n in walls)
    assert all(min(e - w, n - s) == 20 for w, s, e, n in walls)


def test_there_is_a_job_for_each_of_the_seven_runs_of_the_thesis():
    assert sorted(job.removesuffix(".toml") for job in sample_jobs()) == [
        "agglomeration",
        "chain_formation",
        "collision_avoidance",
        "fire_fighting_1",
        "fire_fighting_2",
        "q_learning_multi",
        "q_learning_single",
    ]


def test_nine_sensors_leave_no_gap_in_front_and_blind_spots_behind():
    def seen(bearing):
        return any(
            abs((bearing - sensor.bearing_degrees + 180) % 360 - 180) <= sensor.field_of_view_degrees / 2
            for sensor in AGENT9.proximity
        )

    assert all(seen(bearing) for bearing in range(-90, 91))
    behind = [seen(bearing) for bearing in range(91, 270)]
    assert 0.25 < sum(behind) / len(behind) < 0.75


@pytest.mark.parametrize(("share", "suffices"), [(0.321, True), (0.323, False)])
def test_one_robot_puts_out_what_three_are_to_put_out_in_less_than_0_32_of_the_growth_time(share, suffices):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FireConstantsWarning)
        constants = design_constants(robots=3, growth_time=1_000, extinguish_time=1_000 * share)
    assert (robots_needed(constants, area=16) < 1) == suffices
