"""Checks of a result, from the numbers of many runs to a verdict."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.special import stdtrit
from scipy.stats import binom

from mesa_swarm.errors import check_choice
from mesa_swarm.experiments import (
    Interval,
    csv_text,
    mean_interval,
    pair_differences,
    paired_difference,
    share_interval,
    with_limits,
)

# Of a check: its interval is within what is required, includes the limit, or is outside.
PASSED, UNDECIDED, FAILED = "passed", "undecided", "failed"
OUTCOMES = (PASSED, UNDECIDED, FAILED)
CONFIRMED, LIMITED, NOT_CONFIRMED = "confirmed", "confirmed with limits", "not confirmed"
REFUTED = "refuted"
CONFIDENCE = 0.95
# Probability with which an effect of the size that a check calls detectable is detected.
POWER = 0.8
VERDICTS = (CONFIRMED, LIMITED, NOT_CONFIRMED, REFUTED)


def header(source: str) -> tuple[str, ...]:
    """Return the names of the columns of a table of checks; the second is where the claims come from."""
    return "claim", source, "measured", "required", "outcome", "detectable"


@dataclass(frozen=True, kw_only=True, slots=True)
class Check:
    """One claim of the thesis or of a paper, and what it reports, beside the result and what is required.

    The outcome is one of `OUTCOMES`; the verdict depends on main checks. What is detectable states the power of the
    check: how far beyond the limit the truth must be for as many runs to pass with a probability of `POWER`.
    """

    claim: str
    reported: str
    measured: str
    criterion: str
    outcome: str
    main: bool = True
    detectable: str = "exact"

    def __post_init__(self) -> None:
        """Check the outcome."""
        check_choice("outcome", self.outcome, OUTCOMES)

    @property
    def row(self) -> tuple[str, ...]:
        """The check as a row of a table."""
        return self.claim, self.reported, self.measured, self.criterion, self.outcome, self.detectable


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """One result of the thesis or of a paper, reproduced.

    Its own picture is under "", others by a word. The settings state in words what the source leaves open and we have
    chosen. The reason states why a main claim that failed cannot hold, which makes it refuted. Remarks are further
    findings, and the table is a further one, in Markdown.
    """

    checks: tuple[Check, ...]
    pictures: dict[str, Figure]
    settings: str
    remarks: tuple[str, ...] = field(default=())
    reason: str = ""
    table: str = ""

    @property
    def verdict(self) -> str:
        """Confirmed, confirmed with limits, not confirmed, or refuted: see `verdict`."""
        return verdict(self.checks, self.reason)

    @property
    def limits(self) -> list[str]:
        """The claims whose checks have not passed."""
        return [check.claim for check in self.checks if check.outcome != PASSED]

    def csv(self, source: str = "thesis") -> str:
        """Return the checks for other programs."""
        return csv_text([(*header(source), "main"), *((*check.row, check.main) for check in self.checks)])


def verdict(checks: Iterable[Check], reason: str = "") -> str:
    """Return the verdict, which depends on the outcomes of checks, and on whether it is known why one failed.

    Confirmed if all have passed, and confirmed with limits if all main ones have. If a main one failed, so that its
    interval excludes what is claimed, and the reason is known, refuted; otherwise not confirmed.
    """
    listed = list(checks)
    if all(check.outcome == PASSED for check in listed):
        return CONFIRMED
    main = {check.outcome for check in listed if check.main}
    if main <= {PASSED}:
        return LIMITED
    return REFUTED if FAILED in main and reason else NOT_CONFIRMED


def placed(interval: Interval, low: float = -math.inf, high: float = math.inf) -> str:
    """Return whether an interval lies within limits (passed), wholly outside (failed), or across one (undecided).

    With unknown limits of the interval it is undecided.
    """
    if math.isnan(interval.low) or math.isnan(interval.high):
        return UNDECIDED
    if low <= interval.low and interval.high <= high:
        return PASSED
    return FAILED if interval.high < low or interval.low > high else UNDECIDED


def rounded(value: float, digits: int) -> str:
    """Return a number with at least this many digits, without an exponent where it is large.

    Examples
    --------
    >>> rounded(1208.6, 3), rounded(0.04567, 2)
    ('1,209', '0.046')
    """
    return f"{value:,.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"


def detectable_mean(values: Sequence[float]) -> str:
    """Return how far from a limit a mean must be for as many runs to decide: (t_0.975 + t_0.8) s / sqrt(n).

    Student's t has n - 1 degrees of freedom; this is the usual approximation of the noncentral t distribution. It is
    unknown where all values are equal: they do not show how much others would differ.
    """
    n = len(values)
    if n < 2:
        return "unknown"
    if min(values) == max(values):
        return "unknown: all runs equal"
    steps = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2) + stdtrit(n - 1, POWER))
    return f"{rounded(steps * float(np.std(values, ddof=1)) / math.sqrt(n), 2)} beyond"


def detectable_share(runs: int, low: float, high: float) -> str:
    """Return the share nearest to a limit with which as many runs decide that it is within the limits."""
    passing = [k for k in range(runs + 1) if placed(share_interval(k, runs), low, high) == PASSED]
    if not passing:
        return "none: too few runs"
    shares = np.linspace(0, 1, 101)
    chance = binom.pmf(np.array(passing)[:, None], runs, shares).sum(axis=0)
    enough = shares[chance >= POWER]
    if not len(enough):
        return "none: too few runs"
    return f"{enough.min():.2f} or more" if low > 0 else f"{enough.max():.2f} or less"


def limits_in_words(low: float, high: float) -> str:
    """Return limits in words."""
    if high == math.inf:
        return f"at least {low:g}"
    return f"at most {high:g}" if low == -math.inf else f"{low:g} to {high:g}"


def judged_mean(
    claim: str,
    reported: str,
    values: Sequence[float | None],
    *,
    low: float = -math.inf,
    high: float = math.inf,
    main: bool = True,
) -> Check:
    """Judge whether a mean over runs lies within limits; None is left out."""
    seen = [value for value in values if value is not None]
    mean = mean_interval(seen)
    return Check(
        claim=claim,
        reported=reported,
        measured=f"{with_limits(mean)}, {len(seen)} runs",
        criterion=f"mean {limits_in_words(low, high)}",
        outcome=placed(mean, low, high),
        main=main,
        detectable=detectable_mean(seen),
    )


def judged_share(
    claim: str,
    reported: str,
    happened: Sequence[bool],
    *,
    low: float = 0.0,
    high: float = 1.0,
    main: bool = True,
) -> Check:
    """Judge whether the share of runs in which something happened lies within limits (Wilson's interval).

    Limits of 0 and 1 are not limits.
    """
    count = sum(map(bool, happened))
    share = share_interval(count, len(happened))
    return Check(
        claim=claim,
        reported=reported,
        measured=f"{count} of {len(happened)} runs [{100 * share.low:.0f} to {100 * share.high:.0f} %]",
        criterion=f"share {limits_in_words(low if low > 0 else -math.inf, high if high < 1 else math.inf)}",
        outcome=placed(share, low, high),
        main=main,
        detectable=detectable_share(len(happened), low, high),
    )


def judged_difference(
    claim: str, reported: str, sides: Mapping[str, Sequence[float | None]], *, main: bool = True
) -> Check:
    """Judge whether the second of two sides, by their names, is larger in the mean: the paired difference is above 0.

    Pairs with None are left out.
    """
    first, second = sides.values()
    difference, pairs = paired_difference(first, second)
    means = [mean_interval([value for value in side if value is not None]).estimate for side in (first, second)]
    shown = ", ".join(f"{name} {rounded(mean, 3)}" for name, mean in zip(sides, means, strict=True))
    return Check(
        claim=claim,
        reported=reported,
        measured=f"{shown}: {with_limits(difference, signed=True)}, {pairs} pairs",
        criterion="paired difference above 0",
        outcome=above_zero(difference),
        main=main,
        detectable=detectable_mean(pair_differences(first, second)),
    )


def judged_measure(
    claim: str, reported: str, measure: str, sides: Mapping[str, Sequence[Mapping[str, Any]]], *, main: bool = True
) -> Check:
    """Judge whether a measure is larger in the mean in the second of two sets of runs, see `judged_difference`."""
    values = {name: [run[measure] for run in runs] for name, runs in sides.items()}
    return judged_difference(claim, reported, values, main=main)


def above_zero(difference: Interval) -> str:
    """Return whether a difference is above 0 (passed), below (failed) or its interval holds 0 (undecided)."""
    if difference.low > 0:
        return PASSED
    return FAILED if difference.high < 0 else UNDECIDED


def judged_number(
    claim: str,
    reported: str,
    value: float,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    main: bool = True,
) -> Check:
    """Judge a number that does not depend on chance."""
    return Check(
        claim=claim,
        reported=reported,
        measured=f"{value:.6g}{unit}",
        criterion=limits_in_words(low, high),
        outcome=PASSED if low <= value <= high else FAILED,
        main=main,
    )


def judged_fact(
    claim: str, reported: str, held: bool, *, measured: str, criterion: str = "exact", main: bool = True
) -> Check:
    """Judge a fact."""
    outcome = PASSED if held else FAILED
    return Check(claim=claim, reported=reported, measured=measured, criterion=criterion, outcome=outcome, main=main)


# A value of theory is compared with an interval of this confidence: of 70 comparisons with a theory that is right, one
# or more fail by chance in 7 % of all repetitions.
AGAINST_THEORY = 0.999


def judged_theory(
    claim: str, theory: float | Sequence[float], values: Sequence[float], *, within: float, main: bool = True
) -> Check:
    """Judge whether the mean over runs is what a theory predicts, a number, or one for each run.

    Passed if an interval of confidence `AGAINST_THEORY` includes the prediction and reaches at most `within` times it
    to each side; undecided if it includes it and is wider; failed if it excludes it. What is shown is the usual
    interval of 95 %. With a prediction for each run both are those of the differences, around the mean prediction.
    """
    predicted = np.broadcast_to(np.asarray(theory, float), len(values))
    centre = float(predicted.mean())
    off = (np.asarray(values, float) - predicted).tolist()
    shown, wide = mean_interval(off), mean_interval(off, AGAINST_THEORY)
    return Check(
        claim=claim,
        reported=as_exact_as(centre, shown),
        measured=f"{with_limits(moved(shown, centre))}, {len(off)} runs",
        criterion=f"{100 * AGAINST_THEORY:g} % interval includes the theory, within {100 * within:g} %",
        outcome=beside_zero(wide, within * abs(centre)),
        main=main,
        detectable=detectable_deviation(off, centre),
    )


def as_exact_as(number: float, interval: Interval) -> str:
    """Return a number with as many digits as an interval is shown with.

    Examples
    --------
    >>> as_exact_as(140254.3, Interval(140260.0, 140180.0, 140340.0))
    '140,254'
    """
    if math.isnan(interval.low):
        return f"{number:.4g}"
    return with_limits(moved(interval, number - interval.estimate)).split(" [")[0]


def moved(interval: Interval, by: float) -> Interval:
    """Return an interval with all its numbers increased by a number."""
    return Interval(interval.estimate + by, interval.low + by, interval.high + by)


def beside_zero(interval: Interval, most: float) -> str:
    """Return whether an interval excludes 0 (failed), or includes it and is at most so wide to each side (passed)."""
    if math.isnan(interval.low):
        return UNDECIDED
    if interval.excludes_zero:
        return FAILED
    return PASSED if (interval.high - interval.low) / 2 <= most else UNDECIDED


def detectable_deviation(off: Sequence[float], centre: float) -> str:
    """Return by how much of it a theory must be wrong for as many runs to show it with the probability `POWER`."""
    n = len(off)
    if n < 2 or min(off) == max(off):
        return "unknown"
    steps = float(stdtrit(n - 1, 0.5 + AGAINST_THEORY / 2) + stdtrit(n - 1, POWER))
    return f"{rounded(100 * steps * float(np.std(off, ddof=1)) / math.sqrt(n) / abs(centre), 2)} %"
