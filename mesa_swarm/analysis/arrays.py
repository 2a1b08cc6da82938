"""Arrays that users hand in, checked once."""

import numpy as np

from mesa_swarm.errors import InvalidValueError, shortened


def check_array(name: str, value: object, *shape: int | None, whole: bool = False) -> np.ndarray:
    """Return `value` as an array of this shape, or say what is wrong with it.

    Parameters
    ----------
    name : str
        The parameter, as the user wrote it.
    value : array-like
        Finite numbers.
    *shape : int or None
        Expected length along each axis, None for any.
    whole : bool
        Whether whole numbers are expected; they come back as int64, others as float64.

    Raises
    ------
    InvalidValueError
        If it is not an array of numbers, or of another shape, or not finite.

    Examples
    --------
    >>> check_array("position", [[1, 2]], None, 2)
    array([[1., 2.]])
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidValueError(f"{name} is {shortened(value)}; expected an array of numbers") from None
    if array.size == 0 and array.ndim == 1 and None in shape[:1]:
        array = array.reshape(tuple(0 if length is None else length for length in shape))
    if array.ndim != len(shape) or any(w not in (None, got) for w, got in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise InvalidValueError(f"{name} has shape {array.shape}; expected ({wanted})")
    if not np.isfinite(array).all():
        raise InvalidValueError(f"{name} holds NaN or infinity; expected finite numbers")
    if not whole:
        return array
    if (array != np.floor(array)).any():
        raise InvalidValueError(f"{name} holds fractions; expected whole numbers")
    return array.astype(np.int64)


def check_steps(steps: object) -> np.ndarray:
    """Return the steps of the frames as int64, or say that they do not ascend.

    Examples
    --------
    >>> check_steps([1, 2, 5])
    array([1, 2, 5])
    """
    array = check_array("steps", steps, None, whole=True)
    if (np.diff(array) <= 0).any():
        raise InvalidValueError("steps do not ascend; expected the step of each frame, in the order of time")
    return array
