"""Verdicts follow from outcomes, and outcomes from intervals."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import UnknownNameError
from mesa_swarm.experiments.statistics import Interval, mean_interval
from mesa_swarm_studies import judging
from mesa_swarm_studies.judging import OUTCOMES, VERDICTS, Check, Result, verdict

numbers = st.floats(-1e6, 1e6)


def check(outcome, main=True):
    return Check(claim="c", reported="r", measured="m", criterion="k", outcome=outcome, main=main)


class TestVerdict:
    def test_all_that_passed_is_confirmed(self):
        assert verdict([check("passed"), check("passed", main=False)]) == "confirmed"

    @pytest.mark.parametrize("outcome", ["undecided", "failed"])
    def test_a_side_claim_that_is_not_passed_is_a_limit(self, outcome):
        assert verdict([check("passed"), check(outcome, main=False)]) == "confirmed with limits"

    @pytest.mark.parametrize("outcome", ["undecided", "failed"])
    def test_a_main_claim_that_is_not_passed_is_not_confirmed(self, outcome):
        assert verdict([check("passed"), check(outcome)]) == "not confirmed"

    def test_a_main_claim_that_failed_is_refuted_if_the_reason_is_known(self):
        assert verdict([check("passed"), check("failed")], "its premise is false") == "refuted"

    @pytest.mark.parametrize("checks", [[check("undecided")], [check("passed"), check("failed", main=False)]])
    def test_what_is_undecided_or_a_side_claim_is_not_refuted_whatever_the_reason(self, checks):
        assert verdict(checks, "its premise is false") == verdict(checks)

    def test_it_never_gets_better_when_an_outcome_gets_worse(self):
        for outcomes, mains in product(product(OUTCOMES, repeat=2), product((True, False), repeat=2)):
            for reason in ("", "its premise is false"):
                best = verdict([check("passed", main) for main in mains], reason)
                worse = verdict([check(outcome, main) for outcome, main in zip(outcomes, mains, strict=True)], reason)
                assert VERDICTS.index(worse) >= VERDICTS.index(best)

    def test_an_unknown_outcome_is_refused(self):
        with pytest.raises(UnknownNameError, match="unknown outcome 'maybe'"):
            check("maybe")

    def test_a_result_has_its_verdict_and_limits_and_writes_plain_claims(self):
        result = Result(checks=(check("passed"), check("failed", main=False)), pictures={}, settings="s")
        assert (result.verdict, result.limits) == ("confirmed with limits", ["c"])
        assert result.csv().splitlines()[1:] == ["c,r,m,k,passed,exact,True", "c,r,m,k,failed,exact,False"]


class TestPlaced:
    @given(numbers, numbers, numbers)
    def test_an_interval_is_within_a_limit_or_beyond_it_or_meets_it(self, a, b, limit):
        low, high = sorted((a, b))
        interval = Interval((low + high) / 2, low, high)
        outcome = judging.placed(interval, low=limit)
        assert outcome == ("passed" if low >= limit else "failed" if high < limit else "undecided")
        mirrored = judging.placed(Interval(-interval.estimate, -high, -low), high=-limit)
        assert mirrored == outcome

    def test_unknown_limits_are_undecided(self):
        assert judging.placed(Interval(5.0, math.nan, math.nan), low=1) == "undecided"


class TestChecks:
    def test_a_share_needs_enough_runs(self):
        few, many = (judging.judged_share("c", "r", [True] * n, low=0.9).outcome for n in (10, 40))
        assert (few, many) == ("undecided", "passed")

    def test_a_share_of_zero_fails_and_is_counted(self):
        check = judging.judged_share("c", "r", [False] * 40, low=0.9)
        assert (check.outcome, check.measured) == ("failed", "0 of 40 runs [0 to 9 %]")

    @pytest.mark.parametrize(("by", "outcome"), [(1.0, "passed"), (-1.0, "failed"), (0.0, "undecided")])
    def test_a_difference_is_that_of_pairs(self, by, outcome):
        first = [1.0, 50.0, 100.0, 3.0]
        second = [value + by + wobble for value, wobble in zip(first, (0.1, -0.1, 0.1, -0.1), strict=True)]
        assert judging.judged_difference("c", "r", {"a": first, "b": second}).outcome == outcome

    def test_what_was_not_measured_is_left_out_with_its_pair(self):
        check = judging.judged_difference("c", "r", {"a": [1, None, 1, 1], "b": [2, 5, None, 2.1]})
        assert check.measured.endswith("2 pairs")
        assert judging.judged_mean("c", "r", [1.0, None, 1.0], low=0).measured == "1 [1, 1], 2 runs"

    def test_a_number_without_chance_passes_at_its_limits(self):
        outcomes = [judging.judged_number("c", "r", value, low=1, high=2).outcome for value in (0.999, 1, 2, 2.001)]
        assert outcomes == ["failed", "passed", "passed", "failed"]


class TestPower:
    @pytest.mark.parametrize("runs", [6, 24])
    def test_a_mean_that_far_beyond_its_limit_passes_in_four_of_five_repetitions(self, runs):
        beyond = float(judging.detectable_mean(scaled(runs)).split()[0])
        samples = np.random.default_rng(1).normal(beyond, 1.0, (2_000, runs))
        passed = [judging.placed(mean_interval(sample), low=0.0) == "passed" for sample in samples]
        assert 0.76 < np.mean(passed) < 0.86

    @pytest.mark.slow
    @pytest.mark.parametrize(("runs", "low", "high"), [(40, 0.5, 1.0), (200, 0.8, 1.0), (60, 0.0, 0.2)])
    def test_the_share_that_is_detectable_passes_in_four_of_five_repetitions_and_a_nearer_one_does_not(
        self, runs, low, high
    ):
        share = float(judging.detectable_share(runs, low, high).split()[0])
        nearer = share + (-0.02 if low else 0.02)
        assert chance_to_pass(share, runs, low, high) >= 0.8 - 1e-9
        assert chance_to_pass(nearer, runs, low, high) < 0.8

    def test_too_few_runs_detect_nothing(self):
        assert judging.detectable_share(12, 0.9, 1.0) == "none: too few runs"
        assert judging.detectable_mean([1.0]) == "unknown"

    def test_runs_that_are_all_equal_do_not_show_what_is_detectable(self):
        assert judging.detectable_mean([1.0, 1.0, 1.0]) == "unknown: all runs equal"


def scaled(count):
    """Return as many numbers of standard deviation 1."""
    values = np.arange(float(count))
    return values / values.std(ddof=1)


def chance_to_pass(share, runs, low, high):
    """Return the probability of a check of shares to pass, summed over all counts."""
    return sum(
        math.comb(runs, k) * share**k * (1 - share) ** (runs - k)
        for k in range(runs + 1)
        if judging.judged_share("c", "r", [True] * k + [False] * (runs - k), low=low, high=high).outcome == "passed"
    )
