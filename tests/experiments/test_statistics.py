import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.experiments.statistics import (
    BOOTSTRAP_SEED,
    FEWEST,
    MOST_RESAMPLED,
    RESAMPLES,
    Interval,
    bootstrap_interquartile_mean,
    bootstrap_mean,
    expanded,
    interquartile_mean,
    mean_interval,
    pair_differences,
    paired_difference,
    share_interval,
    summarised,
    superiority,
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


# ---- the bootstrap


@pytest.mark.parametrize("n", [6, 20, 200])
@pytest.mark.parametrize("spread", ["normal", "exponential", "cauchy"])
def test_bootstrap_mean_is_scipys_bca_at_the_expanded_confidence(n, spread):
    rng = np.random.default_rng(n)
    sample = {"normal": rng.normal, "exponential": rng.exponential, "cauchy": rng.standard_cauchy}[spread](size=n)
    twin = stats.bootstrap(
        (sample,),
        np.mean,
        n_resamples=RESAMPLES,
        confidence_level=expanded(n),
        method="BCa",
        rng=np.random.default_rng(BOOTSTRAP_SEED),
    ).confidence_interval
    interval = bootstrap_mean(sample)
    assert (interval.low, interval.high) == pytest.approx((twin.low, twin.high), rel=1e-9)


def test_the_expansion_makes_of_normal_quantiles_those_of_t():
    z = stats.norm.ppf((1 + expanded(9)) / 2)
    assert z == pytest.approx(math.sqrt(9 / 8) * stats.t.ppf(0.975, 8))


@given(st.lists(st.floats(-1e6, 1e6), min_size=FEWEST, max_size=30))
@settings(max_examples=50, deadline=None)
def test_bootstrap_limits_keep_within_the_numbers_and_around_the_mean(values):
    interval = bootstrap_mean(values)
    slack = 1e-9 * max(map(abs, values))
    assert min(values) - slack <= interval.low <= interval.high <= max(values) + slack
    assert interval.low - slack <= interval.estimate <= interval.high + slack


@given(st.lists(st.integers(-1000, 1000), min_size=FEWEST, max_size=20), st.integers(1, 50), st.integers(-99, 99))
@settings(max_examples=50, deadline=None)
def test_bootstrap_limits_go_with_the_unit_and_its_zero(values, scale, shift):
    plain, moved = bootstrap_mean(values), bootstrap_mean([scale * x + shift for x in values])
    expected = scale * plain.low + shift, scale * plain.high + shift
    assert (moved.low, moved.high) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_bootstrap_of_equal_numbers_is_that_number():
    assert bootstrap_mean([0.1] * 7) == Interval(0.1, 0.1, 0.1)


@pytest.mark.parametrize("n", range(1, FEWEST))
def test_fewer_than_six_numbers_have_a_mean_and_no_limits(n):
    interval = bootstrap_mean(list(range(n)))
    assert interval.estimate == (n - 1) / 2
    assert math.isnan(interval.low)
    assert not interval.excludes_zero


def test_bootstrap_of_nothing_is_nan():
    assert math.isnan(bootstrap_mean([]).estimate)


def test_six_is_the_first_number_of_pairs_whose_signs_can_be_significant():
    all_alike = [stats.binomtest(n, n, 0.5).pvalue for n in (FEWEST - 1, FEWEST)]
    assert all_alike[0] > 0.05 > all_alike[1]


def test_where_the_bootstrap_hands_over_to_student_both_agree():
    sample = np.random.default_rng(4).exponential(size=MOST_RESAMPLED + 1)
    before, after = bootstrap_mean(sample[:-1]), bootstrap_mean(sample)
    assert after == mean_interval(sample)
    width = after.high - after.low
    assert abs(before.low - after.low) < 0.05 * width
    assert abs(before.high - after.high) < 0.08 * width


def test_the_bootstrap_touches_no_random_numbers_but_its_own():
    np.random.seed(7)  # noqa: NPY002 - the global one is meant
    before = np.random.get_state()[1].tolist()  # noqa: NPY002
    assert bootstrap_mean([1.0, 2, 3, 4, 5, 9]) == bootstrap_mean([1.0, 2, 3, 4, 5, 9])
    assert np.random.get_state()[1].tolist() == before  # noqa: NPY002


@pytest.mark.long
@pytest.mark.parametrize(
    ("spread", "mean", "n", "least"),
    [
        ("normal", 0.0, 8, 0.93),
        ("normal", 0.0, 30, 0.935),
        ("exponential", 1.0, 12, 0.90),
        ("exponential", 1.0, 30, 0.925),
    ],
)
def test_bootstrap_covers_the_true_mean_in_about_95_percent_of_samples(spread, mean, n, least):
    rng = np.random.default_rng(1)
    samples = rng.normal(size=(2000, n)) if spread == "normal" else rng.exponential(size=(2000, n))
    covered = [interval.low <= mean <= interval.high for interval in map(bootstrap_mean, samples)]
    assert least < np.mean(covered) < 0.975


# ---- the effect size


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=40))
@settings(max_examples=100, deadline=None)
def test_superiority_counts_wins_and_half_of_the_ties(pairs):
    first, second = zip(*pairs, strict=True)
    larger, n = superiority(first, second)
    signs = np.sign(np.subtract(second, first))
    assert n == len(pairs)
    assert larger.estimate == pytest.approx((1 + signs.mean()) / 2)
    assert 0 <= larger.low <= larger.estimate <= larger.high <= 1


def test_superiority_without_ties_is_the_sign_tests_share_with_wilsons_interval():
    larger, n = superiority([0] * 10, [1] * 7 + [-1] * 3)
    assert (larger, n) == (share_interval(7, 10), 10)


def test_superiority_the_other_way_round_is_what_is_left_to_one():
    first, second = [1, 5, None, 7, 2], [2, 5, 3, None, 1]
    for times in (False, True):
        one, other = superiority(first, second, times=times)[0], superiority(second, first, times=times)[0]
        assert one.estimate + other.estimate == pytest.approx(1)
        assert one.low + other.high == pytest.approx(1)


def test_superiority_of_normal_differences_is_the_closed_form():
    # McGraw and Wong: the normal distribution's function at the mean difference over its standard deviation
    rng = np.random.default_rng(5)
    larger, _ = superiority(np.zeros(20_000).tolist(), rng.normal(0.5, 1.0, 20_000).tolist())
    assert larger.low < stats.norm.cdf(0.5) < larger.high


def test_a_time_that_never_came_is_later_than_any_and_two_of_them_tie():
    larger, n = superiority([None, 5, None], [3, None, None], times=True)
    assert (larger.estimate, n) == ((0 + 1 + 0.5) / 3, 3)


def test_superiority_of_no_pairs_is_nan():
    larger, n = superiority([None], [3])
    assert math.isnan(larger.estimate)
    assert n == 0


def test_pair_differences_are_second_minus_first():
    assert pair_differences([1, None, 3], [5, 1, 1]) == [4, -2]


# ---- shares, pairs, summaries


@given(st.integers(1, 200), st.data())
@settings(max_examples=100, deadline=None)
def test_share_interval_is_scipys_wilson_interval(runs, drawn):
    happened = drawn.draw(st.integers(0, runs))
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


# ---- numbers of any size


any_numbers = st.lists(
    st.one_of(
        st.floats(),
        st.sampled_from([0.0, 5e-324, -5e-324, 1e-200, 1e154, 1e308, -1e308, math.inf, -math.inf, math.nan]),
    ),
    max_size=20,
)
ESTIMATES = [mean_interval, bootstrap_mean, bootstrap_interquartile_mean]
# Rounding of a sum, and of numbers too small to be exact.
SLACK, SMALLEST = 1e-12, 1e-322


@pytest.mark.slow
@pytest.mark.parametrize("estimate", ESTIMATES)
@given(any_numbers)
@settings(max_examples=100, deadline=None)
def test_of_any_numbers_there_is_an_estimate_within_them_or_none(estimate, values):
    interval = estimate(values)
    if any(map(math.isnan, values)) or not values or {math.inf, -math.inf} <= set(values):
        if estimate is not bootstrap_interquartile_mean or not values:
            assert math.isnan(interval.estimate)
        return
    size = max((abs(x) for x in values if math.isfinite(x)), default=0.0)
    slack = min(size, 1e308) * SLACK + SMALLEST
    assert min(values) - slack <= interval.estimate <= max(values) + slack
    if all(map(math.isfinite, values)) and len(values) >= FEWEST:
        assert interval.low <= interval.estimate + slack
        assert interval.high >= interval.estimate - slack
    elif not all(map(math.isfinite, values)):
        assert math.isnan(interval.low)
        assert math.isnan(interval.high)


@pytest.mark.slow
@pytest.mark.parametrize("estimate", ESTIMATES)
@given(st.lists(st.integers(-1000, 1000), min_size=FEWEST, max_size=12), st.sampled_from([-1000, -300, 300, 1013]))
@settings(max_examples=50, deadline=None)
def test_an_interval_of_huge_or_tiny_numbers_is_that_of_usual_ones_in_another_unit(estimate, values, power):
    plain = estimate([float(x) for x in values])
    scaled = estimate([math.ldexp(x, power) for x in values])
    expected = [math.ldexp(number, power) for number in (plain.estimate, plain.low, plain.high)]
    assert [scaled.estimate, scaled.low, scaled.high] == expected


@given(st.floats(-1e300, 1e300), st.integers(FEWEST, 20), st.integers(1, 5))
@settings(max_examples=50, deadline=None)
def test_numbers_that_differ_by_rounding_alone_have_limits_among_them(value, n, others):
    values = [value] * n + [math.nextafter(value, math.inf)] * others
    interval = bootstrap_mean(values)
    slack = abs(value) * 1e-15 + SMALLEST
    assert values[0] - slack <= interval.low <= interval.high <= values[-1] + slack


def test_an_infinite_number_makes_the_mean_infinite_and_the_limits_unknown():
    for values in ([1.0, math.inf], [1.0] * 7 + [math.inf]):
        interval = bootstrap_mean(values)
        assert interval.estimate == math.inf
        assert math.isnan(interval.low)
        assert not interval.excludes_zero
    assert math.isnan(mean_interval([math.inf, -math.inf]).estimate)


def test_masked_numbers_are_no_numbers_of_a_sample():
    assert math.isnan(mean_interval(np.ma.array([1.0, 2.0], mask=[False, True])).estimate)


@given(st.floats(), st.floats(), st.floats())
@settings(max_examples=200, deadline=None)
def test_a_share_is_one_of_runs_or_it_is_refused(happened, runs, confidence):
    possible = runs >= 0 and float(runs).is_integer() and runs < 2**31 and 0 <= happened <= runs and 0 < confidence < 1
    if possible:
        share = share_interval(happened, runs, confidence)
        assert math.isnan(share.estimate) if runs == 0 else 0 <= share.low <= share.estimate <= share.high <= 1
    else:
        with pytest.raises(InvalidValueError, match=r"^(happened|runs|confidence) is .*; expected "):
            share_interval(happened, runs, confidence)


REFUSED = {
    "happened is 6; expected a finite number at least 0 and at most 5": lambda: share_interval(6, 5),
    "happened is 1;": lambda: share_interval(1, 0),
    "runs is -1;": lambda: share_interval(0, -1),
    "confidence is 1;": lambda: mean_interval([1.0, 2.0], 1),
    "confidence is 0;": lambda: bootstrap_mean([1.0, 2.0], 0),
    "confidence is nan;": lambda: bootstrap_interquartile_mean([1.0, 2.0], math.nan),
    "n is 1;": lambda: expanded(1),
    "values is 3; expected a list of numbers": lambda: mean_interval(3),
    "values is [[1.0]]; expected a list": lambda: bootstrap_mean([[1.0]]),
    "values is ['a']; expected a list": lambda: bootstrap_interquartile_mean(["a"]),
    "1 and 2 numbers are not pairs": lambda: pair_differences([1.0], [1.0, 2.0]),
    "2 and 1 numbers are not pairs": lambda: superiority([1.0, 2.0], [1.0]),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_is_no_sample_or_no_share_is_refused_in_one_line(words):
    with pytest.raises(InvalidValueError) as caught:
        REFUSED[words]()
    assert str(caught.value).startswith(words)


def test_a_result_that_is_not_a_number_counts_as_missing():
    assert pair_differences([1.0, math.nan, 3.0], [2.0, 1.0, math.nan]) == [1.0]
    assert superiority([1.0, math.nan], [2.0, 1.0])[1] == 1
    assert superiority([1.0, math.nan], [2.0, 1.0], times=True)[0].estimate == 0.5
    assert summarised([1.0, math.nan]).happened == 1


def test_results_that_are_infinite_alike_have_no_difference_but_tie():
    assert pair_differences([math.inf, 1.0, math.inf], [math.inf, 3.0, 1.0]) == [2.0, -math.inf]
    assert superiority([math.inf], [math.inf])[0].estimate == 0.5


def test_the_interquartile_mean_of_nothing_is_nan():
    assert math.isnan(interquartile_mean(np.empty(0)))
    assert np.isnan(interquartile_mean(np.empty((3, 0)))).all()
