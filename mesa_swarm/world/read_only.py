"""What a handle returns: a copy that refuses to be written to, since nothing would change by it."""

import operator
from collections.abc import Callable
from ctypes import c_char
from typing import Any, NoReturn

import numpy as np

from mesa_swarm.base.errors import InvalidValueError

IN_PLACE = ("add", "sub", "mul", "truediv", "floordiv", "mod", "pow", "and", "or", "xor", "lshift", "rshift", "matmul")


class ReadOnlyArray(np.ndarray):
    """A copy of a robot's, a body's or an event's values, of which no element can be set.

    Whatever is computed from it, and ``copy()``, is an ordinary array. ``robot.position += (1, 0)`` is
    ``robot.position = robot.position + (1, 0)``.

    Raises
    ------
    InvalidValueError
        If an element is set.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel
    >>> (robot,) = SwarmModel(rng=1).add_robots(AGENT9, poses=[(100, 200, 0.0)])
    >>> robot.position[0] = 150
    Traceback (most recent call last):
        ...
    mesa_swarm.base.errors.InvalidValueError: an element of a copy was set, which would change nothing; set the ...
    >>> robot.position += (50, 0)
    >>> robot.position
    array([150., 200.])
    """

    def __setitem__(self, key: Any, value: Any) -> None:
        if not self.flags.writeable:
            _refuse()
        super().__setitem__(key, value)

    def __repr__(self) -> str:
        return repr(np.asarray(self))

    def __array_wrap__(self, array: np.ndarray, *_: Any) -> Any:
        """Return what is computed as ordinary arrays and numbers."""
        return np.asarray(array)[()]

    def copy(self, order: Any = "C") -> Any:
        """Return an ordinary array, which can be written to."""
        return np.array(self, order=order)

    def __copy__(self) -> Any:
        return self.copy()

    def __deepcopy__(self, memo: dict | None) -> Any:
        return self.copy()

    def __reduce__(self) -> Any:
        return self.copy().__reduce__()


def read_only(values: Any) -> Any:
    """Return an array as one that refuses to be written to; it is not copied.

    Examples
    --------
    >>> read_only(np.array([1.0, 2.0])) * 2
    array([2., 4.])
    """
    array = np.asarray(values).view(ReadOnlyArray)
    array.flags.writeable = False
    return array


def locked_view(array: np.ndarray) -> np.ndarray:
    """Return a view that cannot be written to, of NumPy's own type, which compiled functions take."""
    view = array.view()
    view.flags.writeable = False
    return view


def writable_view(array: np.ndarray) -> np.ndarray:
    """Return an array of the same memory that compiled functions take as one that they may write to.

    For those that read only, so that they need not be compiled for locked arrays as well.

    Examples
    --------
    >>> locked = locked_view(np.arange(3))
    >>> writable_view(locked).flags.writeable, writable_view(locked).ctypes.data == locked.ctypes.data
    (True, True)
    """
    if array.flags.writeable or not array.size:
        return array if array.flags.writeable else array.copy()
    memory: Any = (c_char * array.nbytes).from_address(array.ctypes.data)
    memory.kept = array
    return np.frombuffer(memory, array.dtype).reshape(array.shape)


def _refuse() -> NoReturn:
    raise InvalidValueError(
        "an element of a copy was set, which would change nothing; set the property as a whole, as in "
        "robot.position = (x, y), or write to a copy()"
    )


def _in_place(name: str) -> Callable:
    """Return the operator of an augmented assignment: a new array where this one is read-only."""
    compute = getattr(operator, name if hasattr(operator, name) else f"{name}_")

    def method(self: ReadOnlyArray, other: Any) -> Any:
        if self.flags.writeable:
            return getattr(np.ndarray, f"__i{name}__")(self, other)
        return compute(np.asarray(self), other)

    return method


for _name in IN_PLACE:
    setattr(ReadOnlyArray, f"__i{_name}__", _in_place(_name))
