"""Missing values, NaN or masked: measures that carry how many they leave out."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mesa_swarm.analysis.arrays import check_headings, check_points
from mesa_swarm.base.errors import InvalidValueError

# What a measure returns: a `Measure`, or of a table over time `Measures` with one for each row.
Value = Any


class Measure(float):
    """A measure of a swarm at one moment: a float that also has the number of values that it leaves out.

    What is computed of it, and copies, are plain floats.

    Attributes
    ----------
    missing : int
        Robots, positions or values that were NaN or masked.
    outside : int
        Positions beyond the bounds of the world.

    Examples
    --------
    >>> found = Measure(0.5, missing=3)
    >>> found, found.missing, 2 * found, str(found)
    (0.5 (3 missing), 3, 1.0, '0.5')
    """

    missing: int
    outside: int

    def __new__(cls, value: float, missing: int = 0, outside: int = 0) -> "Measure":
        """Return a float with two counts."""
        measure = super().__new__(cls, value)
        measure.missing, measure.outside = int(missing), int(outside)
        return measure

    def __repr__(self) -> str:
        counts = {"missing": self.missing, "outside": self.outside}
        words = ", ".join(f"{count:,} {name}" for name, count in counts.items() if count)
        return f"{float(self)!r} ({words})" if words else repr(float(self))

    __str__ = float.__repr__

    def __reduce__(self) -> tuple:
        return float, (float(self),)

    def __deepcopy__(self, memo: dict) -> float:
        """Return a plain float: data collectors copy each value, which the usual way would take 10 microseconds."""
        return float(self)


class Measures(np.ndarray):
    """Measures over time, one for each row of a table: an array that also has the numbers of values left out.

    What is computed of it, its parts and its copies have no such numbers: `missing` is None.

    Attributes
    ----------
    missing : int64 ndarray, shape (k,), or int
        How many values of each row were NaN or masked; of all, where rows count together.

    Examples
    --------
    >>> found = Measures.of([0.5, 1.0], missing=np.array([3, 0]))
    >>> found, found.missing, found[0]
    (array([0.5, 1. ]) (3 missing), array([3, 0]), np.float64(0.5))
    """

    missing: np.ndarray | int | None

    @classmethod
    def of(cls, values: Any, missing: np.ndarray | int) -> "Measures":
        """Return values with the numbers of those that they leave out."""
        measures = np.array(values).view(cls)
        measures.missing = missing
        return measures

    def __array_finalize__(self, source: object) -> None:
        self.missing = None

    def __array_wrap__(self, array: np.ndarray, context: Any = None, return_scalar: bool = False) -> Any:
        """Return what was computed as a plain array or number."""
        return array[()] if return_scalar else np.asarray(array)

    def __repr__(self) -> str:
        count = 0 if self.missing is None else int(np.sum(self.missing))
        return f"{np.asarray(self)!r} ({count:,} missing)" if count else repr(np.asarray(self))

    def __reduce__(self) -> Any:
        return np.asarray(self).__reduce__()


def by_row(function: Callable[..., float], *arrays: np.ndarray, missing: np.ndarray) -> Value:
    """Return a measure of the arrays of one moment, or of those of each row of tables over time.

    `missing` has one flag for each robot, and another axis before it in tables.
    """
    if missing.ndim == 1:
        return Measure(function(*arrays), int(np.count_nonzero(missing)))
    rows = [function(*row) for row in zip(*arrays, strict=True)]
    return Measures.of(np.array(rows, float), missing.sum(axis=1))


def without_position(points: np.ndarray) -> np.ndarray:
    """Return which points (..., 2) have no position: an x or y that is NaN."""
    return np.isnan(points).any(axis=-1)


def with_position(points: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the points (n, 2) that have a position, and the rows of other arrays that belong to them."""
    is_placed = ~without_position(points)
    if is_placed.all():  # the same memory, so that sums over it have the same bits
        return points, *others
    return tuple(array[is_placed] for array in (points, *others))


def masked_where(missing: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return numbers of robots as they are, or if any is missing masked there."""
    return np.ma.array(rows, mask=missing) if missing.any() else rows


def count_missing(*, position: np.ndarray | None = None, heading: np.ndarray | None = None) -> int | np.ndarray:
    """Return how many robots have no position or no heading: NaN or masked.

    Parameters
    ----------
    position : ndarray, shape (n, 2) or (k, n, 2), optional
        Map units. A robot without x has no position, nor has one without y.
    heading : ndarray, shape (n,) or (k, n), optional
        Radians, of the same robots.

    Returns
    -------
    int, or int64 ndarray, shape (k,)
        Of a table over time one number for each row.

    Raises
    ------
    InvalidValueError
        If neither is given, one has the wrong shape, or the two are not of the same robots.

    Examples
    --------
    >>> count_missing(position=np.ma.array([[0, 0], [9, 9]], mask=[[0, 0], [1, 1]]), heading=[0.0, np.nan])
    1
    >>> count_missing(heading=[[0.0, np.nan], [0.0, 1.0]])
    array([1, 0])
    """
    missing = [] if position is None else [without_position(check_points("position", position, table=True))]
    missing += [] if heading is None else [np.isnan(check_headings("heading", heading))]
    if not missing:
        raise InvalidValueError("neither position nor heading is given; give one or both")
    if len({flags.shape for flags in missing}) > 1:
        shapes = " and ".join(str(flags.shape) for flags in missing)
        raise InvalidValueError(f"position and heading are of robots {shapes}; expected the same robots and steps")
    counts = np.logical_or.reduce(missing).sum(axis=-1)
    return int(counts) if counts.ndim == 0 else counts
