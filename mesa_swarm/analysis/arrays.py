"""Arrays checked at the border: shape, numbers, flags, bounds; masked numbers become NaN: refused, or missing."""

import math
import sys
import warnings
from numbers import Real

import numpy as np

from mesa_swarm.base.errors import DegreesWarning, InvalidValueError, check_number, shortened
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.masked_arrays import fill_masked

# As far from the origin as a map may reach: squares of such lengths are far from overflow.
LARGEST_COORDINATE = 1e9
# Headings in radians are rarely larger.
LARGEST_HEADING = 4 * math.pi

Axes = tuple[int | str, ...]


def check_array(name: str, value: object, *axes: Axes, finite: bool = True, missing: bool = False) -> np.ndarray:
    """Return `value` as an array of float64 of one of the expected shapes, in which a letter stands for any length.

    It is an array or nested lists of real numbers. NaN and infinities are refused where it must be finite; if numbers
    may be missing, NaN, None and masked ones are NaN.
    """
    array = _table(name, value, axes)
    if array.dtype.kind not in "iuf" and not _holds_numbers(array):
        raise InvalidValueError(f"{name} is an array of {array.dtype}; expected real numbers")
    array = array.astype(float)  # None, as a collector has it, is NaN
    if finite and (wrong := np.isinf(array) if missing else ~np.isfinite(array)).any():
        place = tuple(np.argwhere(wrong)[0].tolist())
        expected = "finite numbers, or NaN for missing ones" if missing else "finite numbers"
        raise InvalidValueError(f"{name} is {array[place]:g} at {list(place)}; expected {expected}")
    return array


def _holds_numbers(array: np.ndarray) -> bool:
    return array.dtype == object and all(number is None or isinstance(number, Real) for number in array.flat)


def check_points(name: str, value: object, *axes: Axes, table: bool = False, missing: bool | None = None) -> np.ndarray:
    """Return `value` as an array of points (x, y) within the largest coordinates.

    If it may be a `table` over time as well, or with other `axes`, points may also be missing: NaN or masked.
    """
    shapes = axes or ((("n", 2), ("k", "n", 2)) if table else (("n", 2),))
    may_miss = table if missing is None else missing
    points = check_array(name, value, *shapes, finite=not may_miss)
    furthest = np.fmax.reduce(np.abs(points), axis=None, initial=0.0)
    if furthest > LARGEST_COORDINATE:
        check_array(name, points, *shapes, missing=may_miss)  # infinity is named with its place
        raise InvalidValueError(f"{name} reaches {furthest:g}; expected coordinates of at most {LARGEST_COORDINATE:g}")
    return points


def check_headings(name: str, value: object, *axes: Axes) -> np.ndarray:
    """Return `value` as headings of n robots, or as a table of them over time; NaN and masked ones are NaN.

    A heading beyond 4 pi is probably in degrees, of which a warning is given.
    """
    headings = check_array(name, value, *(axes or (("n",), ("k", "n"))), finite=False)
    largest = np.fmax.reduce(np.abs(headings), axis=None, initial=0.0)
    if largest == math.inf:
        raise InvalidValueError(f"{name} holds an infinity; expected radians, or NaN for no direction")
    if largest > LARGEST_HEADING:
        warnings.warn(
            f"{name} reaches {largest:g}, beyond 4 pi; expected radians: numpy.radians converts degrees",
            DegreesWarning,
            stacklevel=_level_of_user(),
        )
    return headings


def check_flags(name: str, value: object, axes: Axes) -> np.ndarray:
    """Return `value` as an array of booleans, given as such or as 0 and 1."""
    flags, missing = check_flags_or_missing(name, value, axes)
    if missing.any():
        place = np.argwhere(missing)[0].tolist()
        raise InvalidValueError(f"{name} is NaN or masked at {place}; expected booleans, or 0 and 1 only")
    return flags


def check_flags_or_missing(name: str, value: object, axes: Axes) -> tuple[np.ndarray, np.ndarray]:
    """Return `value`, booleans given as such or as 0 and 1, as an array of booleans, and which of them are missing.

    Missing ones, NaN or masked, are False.
    """
    array = _table(name, value, (axes,))
    missing = np.isnan(array) if array.dtype.kind == "f" else np.zeros(array.shape, bool)
    if array.dtype == bool:
        return array, missing
    if array.dtype.kind not in "iuf" or not ((array == 0) | (array == 1) | missing).all():
        raise InvalidValueError(f"{name} is an array of {array.dtype}; expected booleans, or 0 and 1 only")
    return array == 1, missing


def check_whole(name: str, value: object, *axes: Axes) -> np.ndarray:
    """Return `value` as an array of int64, if it holds whole numbers."""
    return check_whole_or_missing(name, check_array(name, value, *axes), *axes)[0]


def check_whole_or_missing(name: str, value: object, *axes: Axes, default: int = -1) -> tuple[np.ndarray, np.ndarray]:
    """Return `value`, whole numbers, as an array of int64, and which of them are missing: NaN or masked.

    Missing ones have the default.
    """
    array = check_array(name, value, *axes, missing=True)
    missing = np.isnan(array)
    if (array != np.floor(array))[~missing].any():
        raise InvalidValueError(f"{name} holds fractions; expected whole numbers")
    return np.where(missing, default, array).astype(np.int64), missing


def check_steps(steps: object) -> np.ndarray:
    """Return the steps of the frames as int64, if they ascend."""
    array = check_whole("steps", steps, ("k",))
    if (np.diff(array) <= 0).any():
        raise InvalidValueError("steps do not ascend; expected the step of each frame, in the order of time")
    return array


def check_bounds(value: object) -> Bounds:
    """Return the bounds of a world as four floats, if they enclose an area."""
    x_min, y_min, x_max, y_max = check_points("bounds", value, (4,)).tolist()
    if x_max <= x_min or y_max <= y_min:
        raise InvalidValueError(f"bounds is {shortened(value)}; expected (x_min, y_min, x_max, y_max) with an area")
    return x_min, y_min, x_max, y_max


def check_length(name: str, value: object) -> float:
    """Return `value` as a length above 0, of at most any map's size."""
    return check_number(name, value, above=0.0, maximum=math.sqrt(8) * LARGEST_COORDINATE)


def _table(name: str, value: object, shapes: tuple[Axes, ...]) -> np.ndarray:
    try:
        array = value if type(value) is np.ndarray else fill_masked(value)
    except ValueError:  # lists of unequal length
        raise InvalidValueError(f"{name} is {shortened(value)}; expected {_wanted(shapes)}") from None
    for axes in shapes:
        if _fits(array.shape, axes):
            return array
    raise InvalidValueError(f"{name} has the shape {array.shape}; expected {_wanted(shapes)}")


def _wanted(shapes: tuple[Axes, ...]) -> str:
    return f"an array of shape {' or '.join(map(_in_words, shapes))}"


def _in_words(axes: Axes) -> str:
    return f"({', '.join(map(str, axes))}{',' if len(axes) == 1 else ''})"


def _fits(shape: tuple[int, ...], axes: Axes) -> bool:
    """Return whether a shape is an expected one."""
    return len(shape) == len(axes) and all(
        isinstance(axis, str) or axis == length for axis, length in zip(axes, shape, strict=True)
    )


def _level_of_user() -> int:
    """Return the stack level, for a warning of the caller, of the code that called this package."""
    package, level, frame = __name__.rpartition(".")[0], 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(package):
        frame, level = frame.f_back, level + 1
    return level
