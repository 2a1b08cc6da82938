"""Charts over time, histograms and phase plots: their numbers are exact, on screen, in pictures and in tables."""

import io

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg

from mesa_swarm import AGENT9, ColourMap, Looks, SwarmModel
from mesa_swarm.dashboard.page.robot_columns import RobotValues, bin_values, values_of_session
from mesa_swarm.dashboard.page.series import Series, row_until
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.run.charts import (
    HISTOGRAM,
    MOST_POINTS,
    OVER_TIME,
    PHASE_PLOT,
    Axis,
    ChosenChart,
    HistogramContent,
    PhaseContent,
    TimeContent,
    message_of,
    thin_places,
)
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.flocking import Flocking

FINITE = st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.lists(st.one_of(FINITE, st.integers(-50, 50).map(float), st.just(np.nan)), max_size=60)


def followed(model, **limits) -> Series:
    series = Series(**limits)
    series.follow(model)
    return series


@pytest.fixture(scope="module")
def flock():
    """A flock of which 300 steps were measured."""
    model = Flocking(n_robots=12, rng=3)
    series = followed(model)
    model.run(300)
    return series


@pytest.fixture
def session():
    session = Session("fire_fighting", seed=2)
    yield session
    session.close()


@pytest.mark.parametrize("steps", [1, MOST_POINTS, MOST_POINTS + 1, 2 * MOST_POINTS + 3, 5 * MOST_POINTS])
def test_the_shown_number_is_that_of_the_last_step_however_wide_the_groups_are(steps):
    model = CollisionAvoidance(n_robots=30, rng=1)
    series = followed(model)
    model.run(steps)
    content = TimeContent.of(series, ChosenChart(OVER_TIME, "total_collisions"))
    assert content.curves.width == 2 ** int(np.ceil(np.log2(max(steps / MOST_POINTS, 1))))
    assert content.row[0] == steps
    assert content.row[1].tolist() == [model.total_collisions]
    layers = series.exact("layers")
    assert layers[1][:-1].tolist() == [100 * np.mean(model.swarm.layer == k) for k in range(len(model.control.layers))]


@given(st.integers(1, 900), st.integers(0, 1000), st.integers(1, 7))
def test_the_row_of_a_step_is_the_last_one_that_is_not_later(rows, step, every):
    steps = np.arange(1, rows + 1) * every
    found = row_until(steps, steps[:, None] * 2.0, step)
    earlier = steps[steps <= step]
    assert (found is None) == (not len(earlier))
    if found is not None:
        assert (found[0], found[1].tolist()) == (earlier[-1], [2.0 * earlier[-1]])


def test_the_number_of_a_displayed_step_is_exact_and_none_stands_before_the_first(flock):
    chosen = ChosenChart(OVER_TIME, "alignment")
    steps, rows = flock.rows("alignment")
    for step in (1, 44, 300):
        assert TimeContent.of(flock, chosen, step=step).row[1].tolist() == rows[steps == step][0].tolist()
    assert TimeContent.of(flock, chosen, step=0).row is None


def test_groups_state_of_which_steps_they_are_means(flock):
    curves = flock.curves("alignment", MOST_POINTS)
    assert curves.width == 2
    assert curves.first[:3].tolist() == [1, 3, 5]
    assert curves.steps[:3].tolist() == [2, 4, 6]
    rows = flock.rows("alignment")[1][:, 0]
    assert curves.mean[0, 20] == pytest.approx(rows[40:42].mean())


@given(VALUES, st.booleans())
def test_the_counts_of_a_histogram_sum_to_the_robots_that_have_a_value(numbers, is_direction):
    values = np.array(numbers, float)
    bins = bin_values(values, is_direction=is_direction)
    assert bins.counts.sum() + bins.without == len(values)
    assert (np.diff(bins.edges) > 0).all()
    assert len(bins.counts) == len(bins.edges) - 1


@given(st.lists(st.floats(1e-300, 1e300), min_size=1, max_size=40))
def test_logarithmic_bins_count_every_value_too(numbers):
    bins = bin_values(np.array(numbers), log=True)
    assert bins.counts.sum() == len(numbers)
    assert (np.diff(bins.edges) > 0).all()


def test_whole_numbers_of_a_small_range_have_a_bin_each():
    bins = bin_values(np.array([3.0, 5.0, 5.0]))
    assert (bins.edges.tolist(), bins.counts.tolist()) == ([2.5, 3.5, 4.5, 5.5], [1, 0, 2])


@pytest.mark.parametrize("name", ["fire_fighting", "flocking", "puck_clustering", "ant_trails"])
def test_every_quantity_of_a_model_has_one_value_a_robot(name):
    session = Session(name)
    for _ in range(5):
        session.step()
    robots, n = values_of_session(session), len(session.model.swarm)
    for quantity in robots.quantities.values():
        content = HistogramContent.of(robots, ChosenChart(HISTOGRAM, quantity.name))
        assert content.values.shape == (n,)
        assert content.bins.counts.sum() + content.bins.without == n
    assert {"heading", "commanded speed", "neighbours", "collisions so far"} <= robots.quantities.keys()
    session.close()


def test_a_histogram_is_of_the_displayed_step(session):
    headings, met = {}, {}
    for step in range(1, 9):
        session.step()
        headings[step] = np.degrees(session.model.swarm.heading)
        met[step] = session.model.swarm.collided.copy()
    for _ in range(3):
        session.back()
    robots = values_of_session(session)
    assert robots.step == 5
    assert robots.quantities["heading"].measure().tolist() == headings[5].tolist()
    so_far = np.sum([met[step] for step in range(1, 6)], axis=0)
    assert robots.quantities["collisions so far"].measure().tolist() == so_far.tolist()
    missing = HistogramContent.of(robots, ChosenChart(HISTOGRAM, "max speed"))
    assert missing.note == "at step 5 it is not known; the present step has it"
    assert values_of_session(session, at_present=True).step == 8


def test_collisions_so_far_are_counted_by_robot_also_when_some_are_removed():
    model = CollisionAvoidance(n_robots=60, rng=2)
    series, counts = followed(model), {robot.unique_id: 0 for robot in model.robots}
    for step in range(1, 61):
        model.step()
        for robot, met in zip(model.swarm.agents, model.swarm.collided.tolist(), strict=True):
            counts[robot.unique_id] += met
        if step == 30:
            for robot in list(model.robots)[5:15]:
                robot.remove()
    expected = [counts[robot.unique_id] for robot in model.swarm.agents]
    assert sum(expected) > 0
    assert series.collisions_of(model, model.completed).tolist() == expected
    assert series.collisions_of(model, 30) is None


def test_what_a_model_of_the_users_own_measures_fails_or_is_missing_in_words():
    class Failing(SwarmModel):
        looks = Looks(column=ColourMap(lambda model: 1 / 0, label="energy"))

        def __init__(self, *, rng=None):
            super().__init__(rng=rng)
            self.add_robots(AGENT9, 2)

    model = Failing(rng=1)
    session = Session("failing", find=lambda name: Failing)
    session.model = model
    session.past.clear()
    content = HistogramContent.of(values_of_session(session), ChosenChart(HISTOGRAM, "energy"))
    assert content.note
    assert content.bins.counts.sum() == 0
    session.close()


def test_the_points_of_a_phase_plot_are_those_of_both_series(flock):
    chosen = ChosenChart(PHASE_PLOT, "Polarization", "Layers that drive: Explore")
    content = PhaseContent.of(flock, chosen, step=44)
    names = flock.chart("layers").names
    assert content.steps.tolist() == list(range(1, 301))
    assert content.across.tolist() == flock.rows("layers")[1][:, names.index("Explore")].tolist()
    assert content.up.tolist() == flock.rows("polarization")[1][:, 0].tolist()
    assert (content.mark[0], content.mark[1].tolist()) == (44, [content.across[43], content.up[43]])
    few = PhaseContent.of(flock, chosen, most=100)
    assert few.steps.tolist() == [*range(1, 301, 4), 300]
    assert few.up.tolist() == content.up[few.steps - 1].tolist()
    assert few.mark[0] == 300


@given(st.integers(0, 5000), st.integers(1, 300))
def test_points_are_left_out_evenly_and_the_last_one_stays(count, most):
    places = thin_places(count, most)
    assert len(places) <= most + 1
    assert (np.diff(places[:-1]) == places[1] - places[0]).all() if len(places) > 2 else True
    assert count == 0 or (places[0], places[-1]) == (0, count - 1)


def test_an_axis_is_logarithmic_only_where_all_values_are_above_0():
    assert Axis.of("a", np.array([1.0, np.nan, 3.0]), True) == Axis("a", True)
    assert Axis.of("a", np.array([1.0, 3.0]), False) == Axis("a")
    assert Axis.of("a", np.array([0.0, 3.0]), True) == Axis("a", False, "no log axis: the least value is 0")
    assert Axis.of("a", np.empty(0), True) == Axis("a")


def test_pictures_have_the_axes_of_the_page(flock, session):
    session.step()
    robots = values_of_session(session)
    logarithmic = ChosenChart(HISTOGRAM, "smallest distance reading", log="x")
    phase = ChosenChart(PHASE_PLOT, "Layers that drive: Avoid", "Alignment", "xy")
    scales = {True: "log", False: "linear"}
    (about,), _ = message_of(flock, [ChosenChart(OVER_TIME, "alignment", log="y")], robots, None)
    axes = TimeContent.of(flock, ChosenChart(OVER_TIME, "alignment", log="y")).figure().axes[0]
    assert (axes.get_yscale(), axes.get_ylabel()) == (scales[about["y"]["log"]], "Alignment")
    (about,), _ = message_of(flock, [logarithmic], robots, None)
    histogram = HistogramContent.of(robots, logarithmic).figure()
    assert about["x"] == {"label": "smallest distance reading (map units)", "log": True}
    assert (histogram.axes[0].get_xlabel(), histogram.axes[0].get_xscale()) == (about["x"]["label"], "log")
    assert histogram.axes[0].get_ylabel() == about["y"]["label"] == "robots"
    (about,), _ = message_of(flock, [phase], robots, None)
    axes = PhaseContent.of(flock, phase).figure().axes[0]
    assert axes.get_xlabel() == about["x"]["label"] == "Alignment"
    assert axes.get_ylabel() == about["y"]["label"] == "Layers that drive: Avoid (% of robots)"
    assert (axes.get_xscale(), axes.get_yscale()) == tuple(scales[about[axis]["log"]] for axis in "xy")
    FigureCanvasAgg(histogram).draw()


def test_pictures_can_be_drawn_before_anything_was_measured():
    series = followed(FireFighting(rng=1))
    phase = ChosenChart(PHASE_PLOT, "Collisions in all", "Collisions in a step")
    FigureCanvasAgg(PhaseContent.of(series, phase).figure()).draw()
    FigureCanvasAgg(HistogramContent.of(RobotValues(0), ChosenChart(HISTOGRAM, "x")).figure()).draw()
    assert PhaseContent.of(series, phase).csv().decode().count("\n") == 1


def test_tables_have_all_points_and_all_bins(flock, session):
    chosen = ChosenChart(PHASE_PLOT, "Polarization", "Collisions in all")
    table = pd.read_csv(io.BytesIO(PhaseContent.of(flock, chosen).csv()))
    assert table["step"].tolist() == list(range(1, 301))
    assert table["Polarization"].tolist() == flock.rows("polarization")[1][:, 0].tolist()
    assert table["Collisions in all (collisions)"].tolist() == flock.rows("total_collisions")[1][:, 0].tolist()
    session.step()
    content = HistogramContent.of(values_of_session(session), ChosenChart(HISTOGRAM, "heading"))
    table = pd.read_csv(io.BytesIO(content.csv()))
    assert table["robots"].sum() == len(session.model.swarm)
    assert table["heading (degrees) from"].tolist() == list(range(-180, 180, 15))
    assert table["heading (degrees) to"].tolist() == list(range(-165, 181, 15))


def test_means_of_agents_are_charts():
    reporters = {"heading": lambda agent: getattr(agent, "heading", None), "word": lambda agent: "far"}
    model = SwarmModel(rng=1, agent_reporters=reporters)
    robots = model.add_robots(AGENT9, 4)
    series = followed(model)
    model.run(3)
    steps, rows = series.rows("agents heading")
    assert series.chart("agents heading").title == "Mean heading of agents"
    assert steps.tolist() == [1, 2, 3]
    assert rows[-1, 0] == pytest.approx(np.mean([robot.heading for robot in robots]))
    assert np.isnan(series.rows("agents word")[1]).all()


def test_measuring_goes_on_with_another_object_of_the_same_run():
    first, whole = FireFighting(rng=3), FireFighting(rng=3)
    series = followed(first)
    first.run(20)
    second = FireFighting(rng=3).run(20)
    series.rebind(second)
    assert series not in first.observers
    second.run(10)
    alone = followed(whole)
    whole.run(30)
    for key in ("layers", "at_fires", "total_collisions"):
        assert [part.tolist() for part in series.rows(key)] == [part.tolist() for part in alone.rows(key)]
    assert series.collisions_of(second, 30).tolist() == alone.collisions_of(whole, 30).tolist()
    series.rebind(second)
    second.run(1)
    assert len(series) == 31, "it measures each step once"


def test_rows_of_later_steps_are_dropped_when_the_run_goes_on_from_an_earlier_one():
    series = followed(FireFighting(rng=3))
    series.model.run(20)
    earlier = FireFighting(rng=3).run(12)
    series.rebind(earlier)
    earlier.run(2)
    assert series.rows("layers")[0].tolist() == list(range(1, 15))
