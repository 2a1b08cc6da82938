import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from mesa_swarm.experiments.statistics import (
    Interval,
    mean_interval,
    paired_difference,
    share_interval,
    summarised,
)

numbers = st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=40)


@given(numbers)
@settings(max_examples=100, deadline=None)
def test_mean_interval_is_scipys_t_interval(values):
    spread = np.std(values, ddof=1)
    if spread < 1e-9:
        return
    expected = stats.t.interval(0.95, len(values) - 1, np.mean(values), spread / math.sqrt(len(values)))
    interval = mean_interval(values)
    assert (interval.low, interval.high) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_mean_interval_of_two_values_is_the_closed_form():
    # half width t_{0.975, 1} s / sqrt(2) with s = |a - b| / sqrt(2), t = tan(0.475 pi)
    interval = mean_interval([1.0, 3.0])
    assert interval.estimate == 2.0
    assert interval.high - interval.estimate == pytest.approx(math.tan(0.475 * math.pi) * 1.0)


def test_mean_interval_of_one_value_has_no_limits():
    interval = mean_interval([3.0])
    assert interval.estimate == 3.0
    assert math.isnan(interval.low)
    assert math.isnan(interval.high)


def test_mean_of_nothing_is_nan():
    assert math.isnan(mean_interval([]).estimate)


def test_mean_interval_covers_the_true_mean_in_about_95_percent_of_samples():
    rng = np.random.default_rng(1)
    samples = rng.normal(5.0, 2.0, (2000, 8))
    covered = [interval.low <= 5.0 <= interval.high for interval in map(mean_interval, samples)]
    assert 0.935 < np.mean(covered) < 0.965


@given(st.integers(1, 200), st.data())
@settings(max_examples=100, deadline=None)
def test_share_interval_is_scipys_wilson_interval(runs, data):
    happened = data.draw(st.integers(0, runs))
    expected = stats.binomtest(happened, runs).proportion_ci(0.95, method="wilson")
    interval = share_interval(happened, runs)
    assert (interval.low, interval.high) == pytest.approx((expected.low, expected.high), abs=1e-9)


def test_share_interval_of_always_and_never_are_mirror_images():
    always, never = share_interval(30, 30), share_interval(0, 30)
    z2 = stats.norm.ppf(0.975) ** 2
    assert (never.low, always.high) == (0.0, 1.0)
    assert always.low == pytest.approx(30 / (30 + z2))
    assert never.high == pytest.approx(1 - always.low)


def test_share_of_no_runs_is_nan():
    assert math.isnan(share_interval(0, 0).estimate)


def test_paired_difference_is_scipys_paired_t_test():
    rng = np.random.default_rng(2)
    first, second = rng.normal(size=(2, 20))
    expected = stats.ttest_rel(second, first).confidence_interval(0.95)
    interval, pairs = paired_difference(first.tolist(), second.tolist())
    assert (interval.low, interval.high) == pytest.approx((expected.low, expected.high))
    assert pairs == 20


def test_paired_difference_leaves_out_pairs_in_which_either_did_not_happen():
    interval, pairs = paired_difference([1.0, None, 3.0, 5.0], [2.0, 9.0, None, 6.0])
    assert (interval.estimate, interval.low, interval.high, pairs) == (1.0, 1.0, 1.0, 2)


def test_pairing_sees_what_unpaired_intervals_hide():
    base = np.linspace(0, 1000, 20)
    difference, _ = paired_difference(base.tolist(), (base + 1).tolist())
    assert difference.excludes_zero
    assert mean_interval(base).meets(mean_interval(base + 1))


def test_summary_counts_none_as_not_happened():
    summary = summarised([10.0, None, 30.0, None])
    assert (summary.runs, summary.happened, summary.share.estimate, summary.mean.estimate) == (4, 2, 0.5, 20.0)


def test_summary_of_what_never_happened_has_a_share_of_zero_and_no_mean():
    summary = summarised([None, None])
    assert summary.share.estimate == 0.0
    assert math.isnan(summary.mean.estimate)


@pytest.mark.parametrize(
    ("interval", "excludes"),
    [(Interval(1, 0.5, 2), True), (Interval(-1, -2, -0.5), True), (Interval(1, -1, 3), False)],
)
def test_an_interval_excludes_zero_only_if_both_limits_are_on_one_side(interval, excludes):
    assert interval.excludes_zero is excludes


def test_unknown_limits_exclude_nothing_and_meet_everything():
    unknown = mean_interval([3.0])
    assert not unknown.excludes_zero
    assert unknown.meets(Interval(0.0, -1.0, 1.0))
