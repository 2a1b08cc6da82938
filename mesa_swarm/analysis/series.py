"""Time series of measures, and collision rates."""

import math

import numpy as np

from mesa_swarm.analysis.arrays import check_array, check_flags_or_missing
from mesa_swarm.analysis.missing import Measure, Measures
from mesa_swarm.base.errors import InvalidValueError, check_count, check_number

MOST_LAYERS = 1000


def central_moving_average(values: np.ndarray, window: int) -> Measures:
    """Return the mean of the values around every step, over shorter windows at the ends.

    ``y_t = mean(v_s)`` over all steps s with ``|s - t| <= (window - 1) / 2`` that there are. A peak stays where
    it is, which it does not in a mean over past steps alone.

    Parameters
    ----------
    values : ndarray, shape (k,)
        One value a step, finite. NaN or masked: missing; it is left out.
    window : int
        Steps, odd, at least 1: as many before as after.

    Returns
    -------
    Measures, shape (k,)
        Within the range of the values; NaN where all values of a window are missing. `missing`: values left out.

    Raises
    ------
    InvalidValueError
        If `values` is not k numbers, one is infinite, or `window` is even or below 1.

    Examples
    --------
    >>> central_moving_average([0, 0, 3, 0, 6], 3)
    array([0., 1., 1., 3., 3.])
    """
    series = check_array("values", values, ("k",), missing=True)
    return Measures.of(_moving_average(series, _half(window)), int(np.isnan(series).sum()))


def _moving_average(series: np.ndarray, half: int) -> np.ndarray:
    """Return the mean over up to `half` steps before and after each, without what is NaN."""
    measured = ~np.isnan(series)
    if not measured.any():
        return np.full(len(series), math.nan)
    # Running sums of what differs from the mean: they stay small, and of a constant they are exactly 0.
    mean = series[measured].mean()
    total = np.concatenate([[0.0], np.cumsum(np.where(measured, series - mean, 0.0))])
    count = np.concatenate([[0], np.cumsum(measured)])
    step = np.arange(len(series))
    first, last = np.maximum(step - half, 0), np.minimum(step + half + 1, len(series))
    number = count[last] - count[first]
    smooth = mean + (total[last] - total[first]) / np.where(number > 0, number, math.nan)
    return np.clip(smooth, series[measured].min(), series[measured].max())


def later_mean(values: np.ndarray, share: float = 0.5) -> Measure:
    """Return the mean over the last part of a series, when what happened at the start has died away.

    Parameters
    ----------
    values : ndarray, shape (k,)
        One value a step. NaN or masked: nothing was measured; it is left out.
    share : float
        Of the series that counts, above 0, at most 1.

    Returns
    -------
    Measure
        NaN where nothing was measured. `missing`: values of that part that are left out.

    Raises
    ------
    InvalidValueError
        If `values` is not k numbers, or `share` is out of its range.

    Examples
    --------
    >>> later_mean([9, 9, 1, 2])
    1.5
    """
    series = check_array("values", values, ("k",), finite=False)
    share = check_number("share", share, above=0, maximum=1)
    later = series[len(series) - math.ceil(share * len(series)) :]
    measured = later[~np.isnan(later)]
    return Measure(float(measured.mean()) if len(measured) else math.nan, len(later) - len(measured))


def _half(window: int) -> int:
    window = check_count("window", window, minimum=1)
    if window % 2 == 0:
        raise InvalidValueError(
            f"window is {window}; expected an odd number of steps, which has a middle: {window - 1} or {window + 1}"
        )
    return window // 2


def time_to(
    values: np.ndarray,
    threshold: float,
    *,
    at_least: bool = True,
    for_good: bool = False,
    steps: np.ndarray | None = None,
) -> int | None:
    """Return the first step at which a measure has reached a threshold, the time to task.

    Parameters
    ----------
    values : ndarray, shape (k,)
        The measure; NaN or masked, where it is not defined or missing, has not reached anything.
    threshold : float
        Inclusive.
    at_least : bool
        Whether it is reached from below, ``value >= threshold``; else from above, ``value <= threshold``.
    for_good : bool
        Whether to wait for the first step after which it never falls back.
    steps : ndarray of int, shape (k,), optional
        The step of each value, ascending; 0, 1, 2, ... if not given.

    Returns
    -------
    int or None
        None if it never is, or with `for_good` not at the end.

    Raises
    ------
    InvalidValueError
        If `values` is not k numbers, `threshold` is NaN, or `steps` are not as many ascending whole numbers.

    Examples
    --------
    >>> time_to([0.2, 0.9, 0.5, 0.95, 1.0], 0.9)
    1
    >>> time_to([0.2, 0.9, 0.5, 0.95, 1.0], 0.9, for_good=True, steps=[0, 10, 20, 30, 40])
    30
    """
    series = check_array("values", values, ("k",), finite=False)
    level = float(check_array("threshold", threshold, (), finite=False))
    if math.isnan(level):
        raise InvalidValueError("threshold is nan; expected a number")
    numbers = _step_numbers(steps, len(series))
    reached = series >= level if at_least else series <= level
    if for_good:
        reached = np.logical_and.accumulate(reached[::-1])[::-1]
    places = np.flatnonzero(reached)
    return int(numbers[places[0]]) if len(places) else None


def _step_numbers(steps: np.ndarray | None, k: int) -> np.ndarray:
    if steps is None:
        return np.arange(k)
    numbers = check_array("steps", steps, ("k",))
    if len(numbers) != k or (numbers != np.floor(numbers)).any() or (np.diff(numbers) <= 0).any():
        raise InvalidValueError(
            f"steps are {len(numbers)} numbers from {numbers.min(initial=0):g} to {numbers.max(initial=0):g}; "
            f"expected {k} ascending whole numbers, one for each of values"
        )
    return numbers


def layer_shares(layer: np.ndarray, layers: int) -> Measures:
    """Return the share of robots that each layer drives at every step.

    Parameters
    ----------
    layer : int ndarray, shape (k, n)
        The index of the layer that drives each robot, -1 for none; at least one robot. NaN or masked: missing; that
        robot is left out.
    layers : int
        How many layers there are, at least 1.

    Returns
    -------
    Measures, shape (k, layers + 1)
        In [0, 1], the last column for none; every row adds up to 1, or is NaN if all its robots are missing.
        `missing`: robots left out of each row.

    Raises
    ------
    InvalidValueError
        If `layer` is not such a table, or holds anything but -1, 0, ..., layers - 1.

    Examples
    --------
    >>> layer_shares([[0, 0, 1, -1]], 2)
    array([[0.5 , 0.25, 0.25]])
    """
    layers = check_count("layers", layers, minimum=1, maximum=MOST_LAYERS)
    table = check_array("layer", layer, ("k", "n"), missing=True)
    if not table.shape[1]:
        raise InvalidValueError("layer has no robots; expected an array of shape (k, n) with n of at least 1")
    wrong = table[(table != np.floor(table)) & ~np.isnan(table) | (table < -1) | (table >= layers)]
    if len(wrong):
        raise InvalidValueError(f"layer holds {wrong[0]:g}; expected whole numbers from -1 to {layers - 1}")
    missing = np.isnan(table)
    counts = np.stack([(table == number).sum(axis=1) for number in [*range(layers), -1]], axis=1)
    return Measures.of(counts / _count_present(missing)[:, None], missing.sum(axis=1))


def _count_present(missing: np.ndarray) -> np.ndarray:
    """Return how many robots of each row (k, n) are not missing, NaN for none."""
    counts = np.count_nonzero(~missing, axis=1)
    return np.where(counts > 0, counts, math.nan)


# Of the curves of 15 robots in the thesis; for one robot it used 11.
WINDOW = 1001


def collision_frequency(collided: np.ndarray, window: int = WINDOW) -> Measures:
    """Return the collisions a robot and step, smoothed over time.

    The mean over the robots, then the central moving average over `window` steps, shorter at the ends.

    Parameters
    ----------
    collided : bool ndarray, shape (k, n)
        Whether each of n robots, at least one, collided in each of k steps. NaN or masked: missing; that robot is left
        out.
    window : int
        Steps, odd: 1001 suits many robots, 11 one robot; 1 does not smooth.

    Returns
    -------
    Measures, shape (k,)
        In [0, 1]; NaN where all robots are missing in all steps of a window. `missing`: robots left out of each row.

    Raises
    ------
    InvalidValueError
        If `collided` is not such a table, or `window` is even or below 1.

    Examples
    --------
    >>> collision_frequency([[True, True], [False, True], [False, False]], window=3)
    array([0.75, 0.5 , 0.25])
    """
    table, missing = _table(collided)
    frequency = np.count_nonzero(table, axis=1) / _count_present(missing)
    return Measures.of(_moving_average(frequency, _half(window)), missing.sum(axis=1))


def cumulative_collisions(collided: np.ndarray) -> Measures:
    """Return how many collisions every robot has had up to and including each step.

    Parameters
    ----------
    collided : bool ndarray, shape (k, n)
        Whether each of n robots, at least one, collided in each of k steps. NaN or masked: missing, and not counted.

    Returns
    -------
    int64 Measures, shape (k, n)
        The last row holds the totals. `missing`: robots of which a collision in that row would not be counted.

    Raises
    ------
    InvalidValueError
        If `collided` is not such a table.

    Examples
    --------
    >>> cumulative_collisions([[True, False], [True, True]])
    array([[1, 0],
           [2, 1]])
    """
    table, missing = _table(collided)
    return Measures.of(np.cumsum(table, axis=0, dtype=np.int64), missing.sum(axis=1))


def _table(collided: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    table, missing = check_flags_or_missing("collided", collided, ("k", "n"))
    if not table.shape[1]:
        raise InvalidValueError("collided has no robots; expected an array of shape (k, n) with n of at least 1")
    return table, missing
