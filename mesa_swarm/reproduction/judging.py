"""Checks of a result, from the numbers of many runs to a verdict."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from mesa_swarm.errors import check_choice
from mesa_swarm.experiments.statistics import Interval, mean_interval, paired_difference, share_interval
from mesa_swarm.experiments.tables import csv_text, with_limits

# Of a check: the data say so, they do not settle it, they say the opposite.
HOLDS, UNSETTLED, FAILS = "holds", "unsettled", "fails"
OUTCOMES = (HOLDS, UNSETTLED, FAILS)
CONFIRMED, LIMITED, NOT_CONFIRMED = "confirmed", "confirmed with limits", "not confirmed"
VERDICTS = (CONFIRMED, LIMITED, NOT_CONFIRMED)
HEADER = ("claim", "the thesis", "here", "criterion", "outcome")


@dataclass(frozen=True, kw_only=True, slots=True)
class Check:
    """One claim of the thesis beside what came out.

    Parameters
    ----------
    claim : str
        What is claimed.
    reported : str
        What the thesis reports of it.
    measured : str
        What came out.
    criterion : str
        When it holds.
    outcome : str
        "holds", "unsettled" or "fails".
    main : bool
        Whether the result stands and falls with it.

    Examples
    --------
    >>> Check(claim="a", reported="1", measured="1", criterion="equal", outcome="holds").main
    True
    """

    claim: str
    reported: str
    measured: str
    criterion: str
    outcome: str
    main: bool = True

    def __post_init__(self) -> None:
        """Check the outcome."""
        check_choice("outcome", self.outcome, OUTCOMES)

    @property
    def row(self) -> tuple[str, ...]:
        """The check as a row of a table."""
        return self.claim, self.reported, self.measured, self.criterion, self.outcome


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """What came of one result of the thesis.

    Parameters
    ----------
    checks : tuple of Check
        At least one of them a main one.
    pictures : dict of matplotlib Figure
        The result's own under "", others by a word.
    settings : str
        Of what was run, in words: what the thesis leaves open and we have chosen.
    remarks : tuple of str
        What else came out.
    """

    checks: tuple[Check, ...]
    pictures: dict[str, Figure]
    settings: str
    remarks: tuple[str, ...] = field(default=())

    @property
    def verdict(self) -> str:
        """Confirmed, confirmed with limits, or not confirmed: see `verdict`."""
        return verdict(self.checks)

    @property
    def limits(self) -> list[str]:
        """The claims that do not hold."""
        return [check.claim for check in self.checks if check.outcome != HOLDS]

    def csv(self) -> str:
        """Return the checks for other programs."""
        return csv_text([(*HEADER, "main"), *((*check.row, check.main) for check in self.checks)])


def verdict(checks: Iterable[Check]) -> str:
    """Return what follows from checks: nothing but their outcomes counts.

    Confirmed if all hold; not confirmed if a main one does not; else confirmed with limits.

    Examples
    --------
    >>> same = dict(claim="a", reported="1", measured="2", criterion="equal")
    >>> verdict([Check(**same, outcome="holds"), Check(**same, outcome="fails", main=False)])
    'confirmed with limits'
    >>> verdict([Check(**same, outcome="unsettled")])
    'not confirmed'
    """
    listed = list(checks)
    if all(check.outcome == HOLDS for check in listed):
        return CONFIRMED
    return LIMITED if all(check.outcome == HOLDS for check in listed if check.main) else NOT_CONFIRMED


def placed(interval: Interval, low: float = -math.inf, high: float = math.inf) -> str:
    """Return whether an interval lies within limits (holds), wholly outside (fails), or across one (unsettled).

    Unknown limits of the interval settle nothing, unless all that was seen are the same number.

    Examples
    --------
    >>> placed(Interval(2.0, 1.0, 3.0), low=0.5), placed(Interval(2.0, 1.0, 3.0), low=1.5)
    ('holds', 'unsettled')
    >>> placed(Interval(2.0, 1.0, 3.0), high=0.5)
    'fails'
    """
    if math.isnan(interval.low) or math.isnan(interval.high):
        return UNSETTLED
    if low <= interval.low and interval.high <= high:
        return HOLDS
    return FAILS if interval.high < low or interval.low > high else UNSETTLED


def limits_in_words(low: float, high: float) -> str:
    """Return limits as a reader would say them.

    Examples
    --------
    >>> limits_in_words(-math.inf, 2), limits_in_words(0.5, math.inf), limits_in_words(0, 1)
    ('at most 2', 'at least 0.5', '0 to 1')
    """
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
    """Judge whether a mean over runs lies within limits; None is left out.

    Examples
    --------
    >>> judged_mean("groups", "many", [5.0, 6.0, 7.0], low=1).outcome
    'holds'
    """
    seen = [value for value in values if value is not None]
    mean = mean_interval(seen)
    return Check(
        claim=claim,
        reported=reported,
        measured=f"{with_limits(mean)}, {len(seen)} runs",
        criterion=f"mean {limits_in_words(low, high)}",
        outcome=placed(mean, low, high),
        main=main,
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

    A share that is to be at most or at least so much has one-sided limits: 0 and 1 are no limits.

    Examples
    --------
    >>> judged_share("all out", "always", [True] * 40, low=0.9).outcome
    'holds'
    >>> judged_share("all out", "always", [True] * 3, low=0.9).outcome
    'unsettled'
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
    )


def judged_difference(
    claim: str,
    reported: str,
    first: Sequence[float | None],
    second: Sequence[float | None],
    *,
    names: tuple[str, str],
    main: bool = True,
) -> Check:
    """Judge whether the second of a pair is larger in the mean: the interval of the paired difference is above 0.

    Parameters
    ----------
    claim, reported : str
    first, second : sequences of float or None
        Of the same seeds; pairs with None are left out.
    names : (str, str)
        What the two are.
    main : bool

    Examples
    --------
    >>> check = judged_difference("grow", "longer", [1, 2, 3], [3, 4, 5.5], names=("before", "after"))
    >>> check.outcome, check.measured
    ('holds', 'before 2, after 4.17: +2.17 [+1.45, +2.88], 3 pairs')
    """
    difference, pairs = paired_difference(first, second)
    means = [mean_interval([value for value in side if value is not None]).estimate for side in (first, second)]
    sides = ", ".join(f"{name} {mean:.3g}" for name, mean in zip(names, means, strict=True))
    return Check(
        claim=claim,
        reported=reported,
        measured=f"{sides}: {with_limits(difference, signed=True)}, {pairs} pairs",
        criterion="paired difference above 0",
        outcome=above_zero(difference),
        main=main,
    )


def above_zero(difference: Interval) -> str:
    """Return whether a difference is above 0 (holds), below (fails) or its interval holds 0 (unsettled).

    Examples
    --------
    >>> above_zero(Interval(1.0, 0.0, 2.0)), above_zero(Interval(-1.0, -2.0, -0.5))
    ('unsettled', 'fails')
    """
    if difference.low > 0:
        return HOLDS
    return FAILS if difference.high < 0 else UNSETTLED


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
    """Judge a number that chance has no part in.

    Examples
    --------
    >>> judged_number("q", "4.2957", 4.29570457, low=4.29565, high=4.29575).outcome
    'holds'
    """
    return Check(
        claim=claim,
        reported=reported,
        measured=f"{value:.6g}{unit}",
        criterion=limits_in_words(low, high),
        outcome=HOLDS if low <= value <= high else FAILS,
        main=main,
    )


def judged_fact(
    claim: str, reported: str, held: bool, *, measured: str, criterion: str = "exactly so", main: bool = True
) -> Check:
    """Judge what is so or not.

    Examples
    --------
    >>> judged_fact("four walls", "4", True, measured="4").outcome
    'holds'
    """
    outcome = HOLDS if held else FAILS
    return Check(claim=claim, reported=reported, measured=measured, criterion=criterion, outcome=outcome, main=main)
