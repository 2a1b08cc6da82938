"""Arrays checked at the border: shape, numbers, flags, bounds."""

import math

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_number, shortened

# As far from the origin as a map may reach: squares of such lengths are far from overflow.
LARGEST_COORDINATE = 1e9

Axes = tuple[int | str, ...]
Bounds = tuple[float, float, float, float]


def check_array(name: str, value: object, axes: Axes, *, finite: bool = True) -> np.ndarray:
    """Return `value` as an array of float64 of the expected shape, in which a letter stands for any length.

    It is an array or nested lists of real numbers; NaN and infinities are refused where it must be finite.
    """
    array = _table(name, value, axes)
    if array.dtype.kind not in "iuf":
        raise InvalidValueError(f"{name} is an array of {array.dtype}; expected real numbers")
    array = array.astype(float)
    if finite and not np.isfinite(array).all():
        where = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
        raise InvalidValueError(f"{name} is {array[where]:g} at {list(where)}; expected finite numbers")
    return array


def check_points(name: str, value: object, axes: Axes = ("n", 2)) -> np.ndarray:
    """Return `value` as an array of points (x, y) within the largest coordinates."""
    points = check_array(name, value, axes)
    if np.abs(points).max(initial=0.0) > LARGEST_COORDINATE:
        furthest = f"{np.abs(points).max():g}"
        raise InvalidValueError(f"{name} reaches {furthest}; expected coordinates of at most {LARGEST_COORDINATE:g}")
    return points


def check_flags(name: str, value: object, axes: Axes) -> np.ndarray:
    """Return `value` as an array of booleans, given as such or as 0 and 1."""
    array = _table(name, value, axes)
    if array.dtype == bool:
        return array
    if array.dtype.kind not in "iuf" or not ((array == 0) | (array == 1)).all():
        raise InvalidValueError(f"{name} is an array of {array.dtype}; expected booleans, or 0 and 1 only")
    return array == 1


def check_whole(name: str, value: object, axes: Axes) -> np.ndarray:
    """Return `value` as an array of int64, if it holds whole numbers."""
    array = check_array(name, value, axes)
    if (array != np.floor(array)).any():
        raise InvalidValueError(f"{name} holds fractions; expected whole numbers")
    return array.astype(np.int64)


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


def _table(name: str, value: object, axes: Axes) -> np.ndarray:
    wanted = f"an array of shape ({', '.join(map(str, axes))}{',' if len(axes) == 1 else ''})"
    try:
        array = np.asarray(value)
    except ValueError:  # lists of unequal length
        raise InvalidValueError(f"{name} is {shortened(value)}; expected {wanted}") from None
    fits = array.ndim == len(axes) and all(
        isinstance(axis, str) or axis == length for axis, length in zip(axes, array.shape, strict=True)
    )
    if not fits:
        raise InvalidValueError(f"{name} has the shape {array.shape}; expected {wanted}")
    return array
