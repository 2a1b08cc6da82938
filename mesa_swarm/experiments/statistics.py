"""Estimates with 95 % intervals: means and paired differences by Student's t, shares by Wilson."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate and the limits of its interval; NaN limits say that there is too little to tell.

    Examples
    --------
    >>> Interval(0.5, 0.2, 0.8).meets(Interval(0.9, 0.7, 1.0))
    True
    """

    estimate: float
    low: float
    high: float

    def meets(self, other: "Interval") -> bool:
        """Whether the two intervals share a point; unknown limits meet everything."""
        return not (self.high < other.low or other.high < self.low)

    @property
    def excludes_zero(self) -> bool:
        """Whether zero lies outside the limits."""
        return self.low > 0 or self.high < 0


def mean_interval(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Return the mean with Student's t interval, mean +- t s / sqrt(n).

    Parameters
    ----------
    values : sequence of float
        Independent, about normal or many. One value has no limits, none has no mean.
    confidence : float
        Between 0 and 1.

    Examples
    --------
    >>> mean_interval([1.0, 2.0, 3.0]).estimate
    2.0
    """
    sample = np.asarray(values, dtype=float)
    n = len(sample)
    if n == 0:
        return Interval(math.nan, math.nan, math.nan)
    mean = float(sample.mean())
    if n == 1:
        return Interval(mean, math.nan, math.nan)
    half = float(stdtrit(n - 1, 0.5 + confidence / 2) * sample.std(ddof=1) / math.sqrt(n))
    return Interval(mean, mean - half, mean + half)


def share_interval(happened: int, runs: int, confidence: float = CONFIDENCE) -> Interval:
    """Return the share of runs in which something happened, with Wilson's score interval.

    It keeps within [0, 1] and says something even where it happened never or always.

    Examples
    --------
    >>> share = share_interval(30, 30)
    >>> round(share.low, 3), share.high
    (0.886, 1.0)
    """
    if runs == 0:
        return Interval(math.nan, math.nan, math.nan)
    z = float(ndtri(0.5 + confidence / 2))
    share, weight = happened / runs, z * z / runs
    centre = (share + weight / 2) / (1 + weight)
    half = z * math.sqrt(share * (1 - share) / runs + weight / (4 * runs)) / (1 + weight)
    low, high = max(centre - half, 0.0), min(centre + half, 1.0)
    return Interval(share, low if happened else 0.0, high if happened < runs else 1.0)


def paired_difference(first: Sequence[float | None], second: Sequence[float | None]) -> tuple[Interval, int]:
    """Return the mean of second - first with Student's t interval, and the number of pairs.

    Pairs in which either is None, because it did not happen, are left out.

    Examples
    --------
    >>> difference, pairs = paired_difference([1.0, 2.0, None], [2.0, 3.0, 4.0])
    >>> difference.estimate, pairs
    (1.0, 2)
    """
    pairs = zip(first, second, strict=True)
    differences = [b - a for a, b in pairs if a is not None and b is not None]
    return mean_interval(differences), len(differences)


@dataclass(frozen=True, slots=True)
class Summary:
    """What one measure did over the runs with one value of the parameter.

    Parameters
    ----------
    runs, happened : int
        Runs, and those in which it happened: the measure was not None.
    share, mean : Interval
        Of runs in which it happened; of the measure over those runs.
    """

    runs: int
    happened: int
    share: Interval
    mean: Interval


def summarised(values: Sequence[float | None]) -> Summary:
    """Summarise a measure; None means that it did not happen in that run.

    Examples
    --------
    >>> summarised([100.0, None, 300.0]).mean.estimate
    200.0
    """
    seen = [value for value in values if value is not None]
    return Summary(len(values), len(seen), share_interval(len(seen), len(values)), mean_interval(seen))
