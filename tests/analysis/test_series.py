"""Over time: averages by slicing, times by looking, shares by counting."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.analysis import (
    central_moving_average,
    collision_frequency,
    cumulative_collisions,
    later_mean,
    layer_shares,
    time_to,
)

series = st.lists(st.floats(-1e3, 1e3), max_size=60).map(np.array)
odd = st.integers(0, 40).map(lambda half: 2 * half + 1)
tables = st.builds(
    lambda seed, k, n: np.random.default_rng(seed).random((k, n)) < 0.3,
    st.integers(0, 2**32),
    st.integers(0, 40),
    st.integers(1, 12),
)


@given(series, odd)
def test_the_moving_average_is_the_mean_of_the_slice_around_each_step(values, window):
    half = window // 2
    expected = [values[max(t - half, 0) : t + half + 1].mean() for t in range(len(values))]
    np.testing.assert_allclose(central_moving_average(values, window), expected, atol=1e-9)


@given(series, odd, st.floats(-5, 5), st.floats(-1e3, 1e3))
def test_the_moving_average_follows_scale_shift_and_reversal(values, window, scale, shift):
    smooth = central_moving_average(values, window)
    np.testing.assert_allclose(
        central_moving_average(scale * values + shift, window), scale * smooth + shift, atol=1e-8
    )
    np.testing.assert_allclose(central_moving_average(values[::-1], window), smooth[::-1], atol=1e-9)


@given(st.floats(-1e6, 1e6), st.integers(1, 50), odd)
def test_the_moving_average_of_a_constant_is_the_constant(value, k, window):
    np.testing.assert_array_equal(central_moving_average(np.full(k, value), window), np.full(k, value))


@given(st.integers(3, 50), odd)
def test_the_moving_average_keeps_a_straight_line_where_the_window_is_whole(k, window):
    line, half = np.arange(k) * 2.0, window // 2
    np.testing.assert_allclose(central_moving_average(line, window)[half : k - half], line[half : k - half], atol=1e-9)


def test_a_window_of_one_does_not_smooth():
    values = np.random.default_rng(1).random(50)
    np.testing.assert_allclose(central_moving_average(values, 1), values, atol=1e-15)


def test_the_window_of_1001_steps_spreads_one_event_over_500_steps_each_side():
    values = np.zeros(3001)
    values[1500] = 1.0
    smooth = central_moving_average(values, 1001)
    np.testing.assert_allclose(smooth[1000:2001], 1 / 1001, rtol=1e-9)
    np.testing.assert_allclose(np.concatenate([smooth[:1000], smooth[2001:]]), 0.0, atol=1e-15)


@given(tables, odd)
def test_the_collision_frequency_is_the_mean_of_the_block_around_each_step(collided, window):
    half = window // 2
    expected = [collided[max(t - half, 0) : t + half + 1].mean() for t in range(len(collided))]
    frequency = collision_frequency(collided, window)
    np.testing.assert_allclose(frequency, expected, atol=1e-12)
    assert 0 <= frequency.min(initial=0) <= frequency.max(initial=0) <= 1


@given(tables, st.randoms(use_true_random=False))
def test_collisions_follow_the_robots_when_they_change_places(collided, random):
    order = random.sample(range(collided.shape[1]), collided.shape[1])
    np.testing.assert_array_equal(collision_frequency(collided[:, order]), collision_frequency(collided))
    np.testing.assert_array_equal(cumulative_collisions(collided[:, order]), cumulative_collisions(collided)[:, order])


@given(tables)
def test_cumulative_collisions_count_what_has_happened_so_far(collided):
    expected = [[int(collided[: t + 1, i].sum()) for i in range(collided.shape[1])] for t in range(len(collided))]
    total = cumulative_collisions(collided)
    np.testing.assert_array_equal(total, np.reshape(expected, collided.shape))
    assert total.dtype == np.int64


def by_looking(values, threshold, at_least, for_good):
    """Return the first index by the definition."""
    ok = [bool(v >= threshold if at_least else v <= threshold) for v in values]
    for t in range(len(ok)):
        if ok[t] and (not for_good or all(ok[t:])):
            return t
    return None


@given(
    st.lists(st.sampled_from([0.0, 0.5, 1.0, np.nan, np.inf, -np.inf]), max_size=12),
    st.booleans(),
    st.booleans(),
)
def test_the_time_to_a_task_is_the_first_step_that_looks_right(values, at_least, for_good):
    expected = by_looking(values, 0.5, at_least, for_good)
    assert time_to(np.array(values), 0.5, at_least=at_least, for_good=for_good) == expected
    steps = np.arange(len(values)) * 100 + 7
    numbered = time_to(np.array(values), 0.5, at_least=at_least, for_good=for_good, steps=steps)
    assert numbered == (None if expected is None else 100 * expected + 7)


@given(series, st.floats(-1e3, 1e3))
def test_the_time_for_good_is_never_before_the_first_time(values, threshold):
    first, last = time_to(values, threshold), time_to(values, threshold, for_good=True)
    assert last is None or first <= last
    assert time_to(-values, -threshold, at_least=False) == first


def test_what_falls_back_at_the_end_was_not_reached_for_good():
    assert time_to([0, 1, 1, 0], 1) == 1
    assert time_to([0, 1, 1, 0], 1, for_good=True) is None


def test_an_empty_series_reaches_nothing():
    assert time_to([], 1) is None
    assert time_to([], 1, for_good=True, steps=[]) is None


@given(st.integers(0, 2**32), st.integers(0, 20), st.integers(1, 12), st.integers(1, 5))
def test_layer_shares_count_who_is_driven_by_what(seed, k, n, layers):
    layer = np.random.default_rng(seed).integers(-1, layers, (k, n))
    shares = layer_shares(layer, layers)
    expected = np.array([[(row == number).sum() / n for number in [*range(layers), -1]] for row in layer])
    np.testing.assert_allclose(shares, expected.reshape(k, layers + 1), atol=1e-15)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    np.testing.assert_array_equal(layer_shares(layer[:, ::-1], layers), shares)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50), st.floats(0.01, 1))
def test_the_later_mean_is_that_of_the_last_values_and_ignores_what_was_not_measured(values, share):
    count = max(1, math.ceil(share * len(values)))
    assert later_mean(values, share) == pytest.approx(sum(values[-count:]) / count, abs=1e-6)
    assert later_mean([*values, math.nan], 1) == pytest.approx(sum(values) / len(values), abs=1e-6)


def test_the_later_mean_of_nothing_is_not_a_number():
    assert math.isnan(later_mean([]))
