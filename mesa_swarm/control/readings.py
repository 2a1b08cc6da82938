"""What a rule sees of one robot's sensors: arrays that cannot be changed, of which index -1 reads nothing."""

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, overload, register_model

# A robot without a front sensor has me.front == -1. Python and Numba would take that as the last sensor, so
# that a rule would steer by what is behind the robot. Arrays of a type of their own read "nothing" instead.


class Readings(np.ndarray):
    """Readings in plain Python: index -1 reads `nothing`, and no reading can be changed.

    What is computed from them is an ordinary array: it has no `nothing`.
    """

    nothing: float | None = None

    def __getitem__(self, index: Any) -> Any:
        """Return a reading, or what NumPy returns for slices and the like."""
        if self.nothing is not None and isinstance(index, (int, np.integer)):
            if index == -1:
                return self.dtype.type(self.nothing)
            if not 0 <= index < len(self):
                raise IndexError(f"there is no sensor {index}, of {len(self)}")
        return self.view(np.ndarray)[index]

    def __setitem__(self, index: Any, value: Any) -> None:
        if self.nothing is not None:
            raise TypeError("what a robot sees cannot be changed; change a copy() of it")
        super().__setitem__(index, value)

    def __array_wrap__(self, array: np.ndarray, *_: Any) -> Any:
        """Return sums and the like as ordinary arrays and numbers."""
        return np.asarray(array)[()]


class ReadingsType(types.Array):
    """The same for Numba: an array's data, with an index -1 of its own."""

    def __init__(self, array: types.Array, nothing: float) -> None:
        self.nothing = nothing
        name = f"readings({array.dtype}, {array.layout}, {nothing})"
        super().__init__(array.dtype, 1, array.layout, readonly=True, name=name)

    @property
    def key(self) -> tuple:
        """What tells types apart."""
        return *super().key, str(self.nothing)


register_model(ReadingsType)(models.ArrayModel)


def _reading(nothing: float) -> Callable[[np.ndarray], Readings]:
    """Return the function that makes readings of an array, in plain Python and in compiled code."""

    def readings(array: np.ndarray) -> Readings:
        view = array.view(Readings)
        view.nothing = nothing
        return view

    @intrinsic
    def typed(context: Any, array: types.Array) -> tuple[Any, Callable]:
        result = ReadingsType(array, nothing)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            context.nrt.incref(builder, result, arguments[0])
            return arguments[0]

        return result(array), generate

    @overload(readings)
    def compiled_readings(array):  # without types, for Numba wants the signature of what it returns
        # Numba needs a plain function there, and passes the context itself.
        return lambda array: typed(array)  # type: ignore[call-arg]  # noqa: PLW0108

    return readings


# What index -1 reads: of distances and kinds -1, of radiation 0, of lines False; and a bearing that is not there
# would make the wheels' speeds NaN, which is reported.
seen, sensed, bearings = _reading(-1), _reading(0), _reading(math.nan)


@lower_builtin(operator.getitem, ReadingsType, types.Integer)
def _read(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Emit what `Readings.__getitem__` does, by hand: a call would count references, which costs more than to read."""
    kind, index_type = signature.args
    array = context.make_array(kind)(context, builder, arguments[0])
    index = context.cast(builder, arguments[1], index_type, types.intp)
    length, (stride,) = builder.extract_value(array.shape, 0), cgutils.unpack_tuple(builder, array.strides)
    nothing = context.get_constant(kind.dtype, kind.nothing)
    result = cgutils.alloca_once_value(builder, nothing)
    with builder.if_then(builder.icmp_signed("!=", index, index.type(-1))):
        with builder.if_then(builder.icmp_unsigned(">=", index, length), likely=False):
            context.call_conv.return_user_exc(builder, IndexError, ("there is no such sensor",))
        place = cgutils.pointer_add(builder, array.data, builder.mul(index, stride))
        value = context.unpack_value(builder, kind.dtype, place)
        builder.store(value, result)
    return builder.load(result)
