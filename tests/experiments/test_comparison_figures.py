"""The picture of a comparison: times that did not occur have no number, and steps are whole."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from mesa_swarm.experiments.figures import comparison_figure, places_of, spread_out, window_means
from mesa_swarm.model.gallery import find_model
from support.comparisons import comparison_of

STEPS, MEASURE = 15_000, "all fires out at"


def panels_of(first, second):
    """Return both panels of a comparison whose fires were out at these steps."""
    columns = {"A": {MEASURE: first}, "B": {MEASURE: second}}
    figure = comparison_figure(comparison_of(columns, find_model("fire_fighting"), "strategy", STEPS), [MEASURE])
    FigureCanvasAgg(figure).draw()
    return figure.axes


def ticks_of(axes) -> list[float]:
    low, high = axes.get_ylim()
    return [tick for tick in axes.get_yticks() if low <= tick <= high]


def lanes_of(axes) -> list[float]:
    return [line.get_ydata()[0] for line in axes.lines if line.get_linestyle() == ":"]


def test_what_never_came_stands_beyond_a_gap_where_no_number_is():
    left, right = panels_of([13_000, 14_200, None], [8_000, 9_500, 7_000])
    (lane,) = lanes_of(left)
    span = 14_200 - 7_000
    assert lane >= 14_200 + 0.25 * span
    assert max(ticks_of(left)) <= 14_200 + 0.1 * span
    assert "not by step 15,000" in [text.get_text() for text in left.texts]
    (lane,) = lanes_of(right)
    assert lane <= -5_000 - 0.25 * 5_000
    assert min(ticks_of(right)) >= -5_000 - 0.1 * 5_000
    assert left.spines["left"].get_bounds()[1] < 14_200 + 0.2 * span, "the axis ends where the numbers do"


@pytest.mark.parametrize(
    "times", [([486, 487], [486, None]), ([486, None], [None, None]), ([5, 5], [6, 5]), ([12, 900], [33, 4_000])]
)
def test_ticks_of_steps_are_whole_numbers(times):
    for axes in panels_of(*times):
        ticks = ticks_of(axes)
        assert ticks
        assert np.array_equal(ticks, np.round(ticks))


def test_where_nothing_ever_came_there_are_no_numbers():
    left, right = panels_of([None, None], [None, None])
    assert ticks_of(left) == []
    assert ticks_of(right) == [0]


@pytest.mark.parametrize(("values", "places"), [(("A", "B"), [0, 1]), ((5, 10, 50), [5, 10, 50]), ((10, 5), [0, 1])])
def test_rising_numbers_stand_at_their_values_and_others_one_after_the_other(values, places):
    assert places_of(values).tolist() == places


def test_dots_are_spread_evenly_and_a_single_one_is_not():
    assert (spread_out(3, 1.0).tolist(), spread_out(1, 1.0).tolist()) == ([-1, 0, 1], [0])


def test_a_series_is_shown_as_means_of_windows_at_their_middles():
    middles, means = window_means(np.array([1, 3, 5, 7]), windows=2)
    assert (middles.tolist(), means.tolist()) == ([1.5, 3.5], [2.0, 6.0])


@pytest.mark.slow
@pytest.mark.parametrize("huge", [np.inf, -np.inf, 1e308, -1.7e308])
def test_numbers_beyond_any_axis_stand_in_a_lane_that_is_labelled(huge):
    columns = {"A": {"size": [1.0, 2.0, 3.0]}, "B": {"size": [2.0, huge, huge]}}
    figure = comparison_figure(comparison_of(columns, find_model("fire_fighting"), "strategy", STEPS), ["size"])
    FigureCanvasAgg(figure).draw()
    for axes, (low, high) in zip(figure.axes, [(1.0, 3.0), (0.0, 1.0)], strict=True):
        (lane,) = lanes_of(axes)
        assert lane > high + 0.2 if huge > 0 else lane < low - 0.2
        assert f"beyond {np.copysign(1e300, huge):g}" in [text.get_text() for text in axes.texts]
        assert max(map(abs, ticks_of(axes)), default=0.0) < 10
