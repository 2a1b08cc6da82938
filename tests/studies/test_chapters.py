"""The runs of the thesis's chapters, and what tables and pictures are made of."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure

from mesa_swarm.experiments.statistics import Interval
from mesa_swarm.maps.map import Map
from mesa_swarm.viewing.figures import svg
from mesa_swarm_studies.drawing import plain_axes
from mesa_swarm_studies.judging import above_zero, judged_fact, limits_in_words
from mesa_swarm_studies.registry import table_of
from mesa_swarm_studies.thesis import fire_fighting, fire_growth, learning
from mesa_swarm_studies.thesis.complexity import ROBOTS, explained, quadratic, timed_world, timing_run
from mesa_swarm_studies.thesis.maps import share_covered
from mesa_swarm_studies.thesis.networks import (
    choice_run,
    demonstrated,
    forgetting_run,
    memory_run,
    noisy_points,
    regression_figure,
    regression_run,
)
from mesa_swarm_studies.thesis.swarms import agglomeration_run, chain_run, exploration_run, known


def test_the_time_of_a_step_is_positive_and_its_world_has_so_many_sensors():
    assert timing_run(1, robots=5, map="original", sensors=3, milliseconds=1.0)["seconds"] > 0
    assert timed_world(1, 3, "sparse", 0).swarm.distance.shape == (3, 0)


def test_robots_with_three_and_nine_sensors_move_alike():
    three, nine = (timed_world(3, 40, "original", sensors).run(100).swarm for sensors in (3, 9))
    assert (three.position == nine.position).all()
    assert (three.distance == nine.distance[:, :3]).all()


def test_a_quadratic_explains_its_own_values():
    times = np.array([[0.1 * n * n + n + 3.0] * 2 for n in ROBOTS])
    assert np.allclose(quadratic(times), times[:, 0])
    assert explained(times) == pytest.approx(1.0)


def test_a_short_run_puts_out_nothing():
    run = fire_fighting.fire_run(1, strategy="B", steps=20)
    assert (run["out"], run["all out at"], run["largest out"]) == (0, None, False)
    assert fire_fighting.fire_model(1, "A", size=4.0).fires.area[fire_fighting.LARGEST] == 64.0


def test_equal_runs_have_no_winner():
    runs = [{"out": 7, "all out at": 100}, {"out": 7, "all out at": 120}]
    assert fire_fighting.cell_of({"robots": 5, "size": 1.0, "rest": 60.0}, runs, runs).winner == ""


def test_the_example_has_the_corrected_constant_and_a_temperature_each_step():
    chosen = fire_growth.example()
    assert chosen.k2 == pytest.approx(0.0020159, abs=1e-7)
    assert fire_growth.course(chosen, 0.5, robots=0, steps=2).shape == (3,)


def test_the_first_step_is_infinite_where_it_never_happens():
    assert fire_growth.first(np.array([False, True, True])) == 1.0
    assert fire_growth.first(np.array([False])) == math.inf


@pytest.mark.parametrize(
    ("low", "high", "words"), [(-math.inf, 2, "at most 2"), (0.5, math.inf, "at least 0.5"), (0, 1, "0 to 1")]
)
def test_limits_are_put_into_words(low, high, words):
    assert limits_in_words(low, high) == words


def test_a_difference_whose_interval_touches_zero_is_undecided():
    assert above_zero(Interval(1.0, 0.0, 2.0)) == "undecided"
    assert above_zero(Interval(-1.0, -2.0, -0.5)) == "failed"


@pytest.mark.parametrize(("held", "outcome"), [(True, "passed"), (False, "failed")])
def test_a_fact_passes_or_fails(held, outcome):
    assert judged_fact("four walls", "4", held, measured="4").outcome == outcome


def test_a_learning_run_has_a_curve_of_so_many_points():
    run = learning.learning_run(1, steps=330, n_robots=2)
    assert len(run["curve"]) == len(run["temperature"]) == learning.POINTS
    assert run["total"] >= 0


def test_thinned_values_end_with_the_last():
    assert learning.thinned(np.arange(660.0))[-1] == 659.0


def test_a_correlation_needs_values_that_change():
    assert learning.correlation(np.array([1.0, 2.0]), np.array([2.0, 4.0])) == 1.0
    assert learning.correlation(np.ones(2), np.ones(2)) is None


def test_nothing_covers_the_open_space():
    assert share_covered(Map.load("openspace")) == 0.0


def test_networks_are_fitted_to_thirty_noisy_points():
    assert noisy_points(np.random.default_rng(1), demonstrated)[0].shape == (30,)
    assert set(regression_run(1, networks=2, curve="ours")) == {"bad", "median"}


def test_networks_of_a_run_forget_unless_they_rehearse():
    plain, mixed = (forgetting_run(10_001, networks=3, rehearsal=way) for way in ("none", "interleaved"))
    assert plain["old task"] > 3 * plain["old task at first"]
    assert mixed["old task"] < plain["old task"] / 3


def test_runs_in_networks_and_tables_are_measured_alike():
    networks, table = (memory_run(10_001, memory=memory, steps=20) for memory in ("networks", "table"))
    assert networks.keys() == table.keys()
    assert networks != table


def test_choices_follow_their_probabilities():
    assert abs(choice_run(1, draws=1000)["excess"]) < 0.1


def test_a_bar_in_a_cell_is_escaped():
    assert table_of(("a", "b"), [("1", "x|y")]) == "| a | b |\n|---|---|\n| 1 | x\\|y |"


@pytest.mark.slow
def test_runs_of_swarms_measure_what_their_figures_show():
    assert set(exploration_run(1, steps=100)) == {"areas", "collisions", "coverage"}
    assert agglomeration_run(1, n_robots=5)["spacing at 1000"] > 0
    assert agglomeration_run(1, n_robots=5)["groups at 3000, 60"] <= 2
    assert chain_run(1, n_robots=5)["meetings"] >= 0
    assert 1.0 <= chain_run(1, n_robots=5)["own group at 3000, 40"] <= 5.0


def test_what_could_not_be_measured_is_none():
    assert known({"a": math.nan, "b": 0.5}) == {"a": None, "b": 0.5}


def test_axes_are_named_and_the_same_figure_gives_the_same_svg():
    _, axes = plain_axes("step", "collisions")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("step", "collisions")
    first, second = (svg(Figure(figsize=(1, 1))) for _ in range(2))
    assert b"<svg" in first
    assert first == second


def test_the_regression_shows_two_networks_and_the_errors_of_all():
    left, right = regression_figure(networks=7, points=12).axes
    assert len(left.get_lines()) == 4
    errors = right.get_lines()[0].get_ydata()
    assert len(errors) == 7
    assert (np.diff(errors) >= 0).all()
