"""Estimates with 95 % intervals: means by the bootstrap or by Student's t, shares by Wilson, and an effect size."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri, stdtrit

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.geometry.masked_arrays import fill_masked

CONFIDENCE = 0.95
# Fewer numbers are all on one side of the true mean in more than 5 % of samples: 2 / 2^5 = 6 %.
FEWEST = 6
# With more the mean is normal: the bootstrap agrees with Student's t.
MOST_RESAMPLED = 1000
RESAMPLES = 9_999
# The same numbers always give the same interval, whatever else was estimated before.
BOOTSTRAP_SEED = 95
# Numbers of other sizes are scaled, or cubes of their differences would be infinite or 0.
LEAST, LARGEST = 1e-60, 1e60
# A result with this ending is the time of an event; None is then later than any step.
TIME = " at"


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate and the limits of its interval; NaN limits mean that they are unknown.

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
        Independent, about normal or many. One value has no limits, nor have several of which one is infinite or NaN;
        none has no mean.
    confidence : float
        Above 0, below 1.

    Raises
    ------
    InvalidValueError
        If an argument is anything else.

    Examples
    --------
    >>> mean_interval([1.0, 2.0, 3.0]).estimate
    2.0
    """
    sample, confidence = _sample(values), _confidence(confidence)
    n = len(sample)
    if n < 2 or not np.isfinite(sample).all():
        return Interval(_mean(sample), math.nan, math.nan)
    scale = _scale(sample)
    sample = sample / scale
    mean = float(sample.mean())
    half = float(stdtrit(n - 1, 0.5 + confidence / 2) * sample.std(ddof=1) / math.sqrt(n))
    return Interval(mean * scale, (mean - half) * scale, (mean + half) * scale)


def _sample(values: Sequence[float]) -> np.ndarray:
    """Return numbers as a row of floats, masked ones as NaN."""
    try:
        sample = np.asarray(fill_masked(values), dtype=float)
    except (TypeError, ValueError, OverflowError):
        sample = np.empty((0, 0))
    if sample.ndim != 1:
        raise InvalidValueError(f"values is {shortened(values)}; expected a list of numbers")
    return sample


def _confidence(confidence: float) -> float:
    """Return a confidence that is above 0 and below 1."""
    if check_number("confidence", confidence, above=0.0, maximum=1.0) == 1.0:
        raise InvalidValueError("confidence is 1; expected a number above 0 and below 1")
    return confidence


def _mean(sample: np.ndarray) -> float:
    """Return the mean, NaN of nothing, and of infinities of both signs."""
    if not len(sample):
        return math.nan
    scale = _scale(sample)
    with np.errstate(invalid="ignore"):
        return float((sample / scale).mean()) * scale


def _scale(sample: np.ndarray) -> float:
    """Return what numbers are to be divided by so that sums and cubes stay in range, a power of two; 1 as a rule."""
    largest = float(np.abs(sample[np.isfinite(sample)]).max(initial=0.0))
    if LEAST < largest < LARGEST or largest == 0:
        return 1.0
    return math.ldexp(1.0, math.frexp(largest)[1] - 1)


def share_interval(happened: float, runs: int, confidence: float = CONFIDENCE) -> Interval:
    """Return the share of runs in which something happened, with Wilson's score interval.

    It is within [0, 1], and not empty where the share is 0 or 1. `scipy.stats.binomtest` takes whole numbers only;
    ties count half here.

    Parameters
    ----------
    happened : float
        0 to `runs`.
    runs : int
        Of none the share is not known.
    confidence : float
        Above 0, below 1.

    Raises
    ------
    InvalidValueError
        If an argument is out of its range.

    Examples
    --------
    >>> share = share_interval(30, 30)
    >>> round(share.low, 3), share.high
    (0.886, 1.0)
    """
    runs = check_count("runs", runs)
    happened, confidence = check_number("happened", happened, minimum=0, maximum=runs), _confidence(confidence)
    if runs == 0:
        return Interval(math.nan, math.nan, math.nan)
    z = float(ndtri(0.5 + confidence / 2))
    share, weight = happened / runs, z * z / runs
    centre = (share + weight / 2) / (1 + weight)
    half = z * math.sqrt(share * (1 - share) / runs + weight / (4 * runs)) / (1 + weight)
    low, high = max(centre - half, 0.0), min(centre + half, 1.0)
    return Interval(share, low if happened else 0.0, high if happened < runs else 1.0)


def known(number: float | None) -> float | None:
    """Return a number, or None for NaN, for which JSON and CSV have no word."""
    return None if number is None or math.isnan(number) else number


def paired_difference(first: Sequence[float | None], second: Sequence[float | None]) -> tuple[Interval, int]:
    """Return the mean of second - first with Student's t interval, and the number of pairs.

    Pairs in which either is None or NaN, because it did not happen, are left out.

    Examples
    --------
    >>> difference, pairs = paired_difference([1.0, 2.0, None], [2.0, 3.0, 4.0])
    >>> difference.estimate, pairs
    (1.0, 2)
    """
    differences = pair_differences(first, second)
    return mean_interval(differences), len(differences)


def pair_differences(first: Sequence[float | None], second: Sequence[float | None]) -> list[float]:
    """Return second - first of each pair that has a difference: neither is None or NaN, nor are both infinite alike.

    Examples
    --------
    >>> pair_differences([1.0, 2.0, None], [2.0, 5.0, 4.0])
    [1.0, 3.0]
    """
    pairs = _pairs(first, second)
    return [b - a for a, b in pairs if a is not None and b is not None and not (math.isinf(a) and a == b)]


def _pairs(first: Sequence[float | None], second: Sequence[float | None]) -> list[tuple[float | None, float | None]]:
    """Return pairs, None for NaN."""
    if len(first) != len(second):
        raise InvalidValueError(f"{len(first)} and {len(second)} numbers are not pairs; expected as many of each")
    return list(zip(map(known, first), map(known, second), strict=True))


def bootstrap_mean(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Return the mean with its bootstrap interval, which never leaves the range of the numbers.

    The numbers are drawn anew, with replacement, 9,999 times; the limits are those between which the means of such
    samples lie, corrected for bias and skewness (BCa, [1]_) and widened by the little by which so few numbers
    understate how they spread ([2]_): with z of the normal distribution,
    z' = z0 + (z0 + z) / (1 - a (z0 + z)) at z = -+ sqrt(n / (n - 1)) t_{n - 1}.

    Parameters
    ----------
    values : sequence of float
        Independent, of any distribution. Of equal numbers both limits are that number; fewer than six have no
        limits, nor have numbers of which one is infinite or NaN, and none have no mean; more than 1,000 have Student's
        t interval, which is then the same.
    confidence : float
        Above 0, below 1.

    Returns
    -------
    Interval
        The same for the same numbers, whenever it is computed.

    Raises
    ------
    InvalidValueError
        If an argument is anything else.

    References
    ----------
    .. [1] Efron, Better bootstrap confidence intervals, Journal of the American Statistical Association 82 (1987).
    .. [2] Hesterberg, What teachers should know about the bootstrap, The American Statistician 69 (2015).

    Examples
    --------
    >>> bootstrap_mean([3.0, 3.0, 3.0, 3.0, 3.0, 3.0])
    Interval(estimate=3.0, low=3.0, high=3.0)
    >>> interval = bootstrap_mean([0, 0, 0, 0, 0, 0, 0, 100])
    >>> interval.estimate, interval.low >= 0
    (12.5, True)
    """
    sample, confidence = _sample(values), _confidence(confidence)
    if len(sample) > MOST_RESAMPLED:
        return mean_interval(values, confidence)
    if len(sample) < FEWEST or not np.isfinite(sample).all():
        return Interval(_mean(sample), math.nan, math.nan)
    if sample.min() == sample.max():
        return Interval(float(sample[0]), float(sample[0]), float(sample[0]))
    scale = _scale(sample)
    sample = sample / scale
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    means = sample[rng.integers(0, len(sample), (RESAMPLES, len(sample)))].mean(axis=1)
    low, high = np.quantile(means, _bca_levels(sample, means, expanded(len(sample), confidence)))
    return Interval(float(sample.mean()) * scale, float(low) * scale, float(high) * scale)


def expanded(n: int, confidence: float = CONFIDENCE) -> float:
    """Return the nominal confidence at which a bootstrap of n numbers has the one wanted (Hesterberg 2015).

    Examples
    --------
    >>> round(expanded(10), 4), round(expanded(1000), 4)
    (0.9829, 0.9504)
    """
    n = check_count("n", n, minimum=2)
    return 1 - 2 * float(ndtr(-math.sqrt(n / (n - 1)) * stdtrit(n - 1, 0.5 + _confidence(confidence) / 2)))


def interquartile_mean(values: np.ndarray) -> np.ndarray:
    """Return the mean of the middle half of the last axis: a quarter of the numbers is left out at either end.

    With n numbers, n // 4 at either end; NaN without numbers.

    Examples
    --------
    >>> float(interquartile_mean(np.array([0.0, 2.0, 4.0, 1000.0])))
    3.0
    """
    ordered = np.sort(np.asarray(fill_masked(values), dtype=float), axis=-1)
    cut = ordered.shape[-1] // 4
    middle = ordered[..., cut : ordered.shape[-1] - cut]
    if not middle.size:
        return np.full(middle.shape[:-1], math.nan)
    scale = _scale(middle)
    with np.errstate(invalid="ignore"):
        return (middle / scale).mean(axis=-1) * scale


def bootstrap_interquartile_mean(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Return the interquartile mean with its percentile bootstrap interval [1]_.

    Parameters
    ----------
    values : sequence of float
        Fewer than six have no limits, nor have numbers of which one is infinite or NaN, and none have no mean.
    confidence : float
        Above 0, below 1.

    Returns
    -------
    Interval
        The same for the same numbers, whenever it is computed.

    References
    ----------
    .. [1] Agarwal et al., Deep reinforcement learning at the edge of the statistical precipice, NeurIPS (2021).

    Examples
    --------
    >>> interval = bootstrap_interquartile_mean([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 500.0])
    >>> interval.estimate, interval.low
    (1.0, 1.0)
    """
    sample, confidence = _sample(values), _confidence(confidence)
    estimate = float(interquartile_mean(sample))
    if len(sample) < FEWEST or not np.isfinite(sample).all():
        return Interval(estimate, math.nan, math.nan)
    scale = _scale(sample)
    sample = sample / scale
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    drawn = interquartile_mean(sample[rng.integers(0, len(sample), (RESAMPLES, len(sample)))])
    low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(estimate, float(low) * scale, float(high) * scale)


def _bca_levels(sample: np.ndarray, means: np.ndarray, confidence: float) -> np.ndarray:
    """Return at which quantiles of the resampled means the limits are."""
    centred = sample - sample.mean()
    below = (np.mean(means < sample.mean()) + np.mean(means <= sample.mean())) / 2
    # Of numbers that differ by rounding alone, no mean may be on one side.
    bias = ndtri(np.clip(below, 0.5 / len(means), 1 - 0.5 / len(means)))
    skew = np.sum(centred**3) / (6 * np.sum(centred**2) ** 1.5)
    z = bias + ndtri(np.array([(1 - confidence) / 2, (1 + confidence) / 2]))
    # From 0 on, the limit is the very last of the means.
    left = np.maximum(1 - skew * z, 1e-300)
    return ndtr(bias + z / left)


def superiority(
    first: Sequence[float | None], second: Sequence[float | None], *, times: bool = False
) -> tuple[Interval, int]:
    """Return how probable it is that the second number of a pair is the larger one, and the number of pairs.

    This is the effect size of a paired comparison that needs no units and no normal distribution, the
    common-language effect size [1]_ with ties counted half [2]_: A = (pairs in which the second is larger
    + half of those in which both are equal) / pairs. 0.5 means no effect, 1 that the second was larger on every
    seed. The matched-pairs rank statistic by signs is 2 A - 1. The interval is Wilson's, too wide rather than too
    narrow where there are ties.

    Parameters
    ----------
    first, second : sequence of float or None
        Of the same seeds.
    times : bool
        Whether None, or NaN, means later than any number, and of two of them neither was earlier; else such pairs are
        left out.

    References
    ----------
    .. [1] McGraw and Wong, A common language effect size statistic, Psychological Bulletin 111 (1992).
    .. [2] Vargha and Delaney, A critique and improvement of the CL statistics, Journal of Educational and
       Behavioral Statistics 25 (2000).

    Examples
    --------
    >>> larger, pairs = superiority([1, 2, 3, None], [2, 2, 1, 5])
    >>> larger.estimate, pairs
    (0.5, 3)
    >>> superiority([100, 200], [None, 300], times=True)[0].estimate
    1.0
    """
    pairs = _pairs(first, second)
    if times:
        pairs = [(_at_last(a), _at_last(b)) for a, b in pairs]
    scores = [0.5 * ((b > a) + (b >= a)) for a, b in pairs if a is not None and b is not None]
    return share_interval(sum(scores), len(scores)), len(scores)


def _at_last(step: float | None) -> float:
    return math.inf if step is None else step


@dataclass(frozen=True, slots=True)
class Summary:
    """A measure over the runs with one value of the parameter.

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
    """Summarise a measure; None, or NaN, means that it did not happen in that run.

    Examples
    --------
    >>> summarised([100.0, None, 300.0]).mean.estimate
    200.0
    """
    seen = [value for value in map(known, values) if value is not None]
    return Summary(len(values), len(seen), share_interval(len(seen), len(values)), bootstrap_mean(seen))
