"""Measures made of a function of arrays: compiled, an attribute of a model, and in a run as quick as `count`."""

import inspect
from collections.abc import Callable, Mapping
from importlib import import_module
from operator import attrgetter
from types import FunctionType
from typing import Any

import numpy as np

from mesa_swarm.base.errors import (
    BehaviourError,
    InvalidValueError,
    SwarmError,
    UnknownNameError,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.control.source import own_randomness
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.custom_code import rename_function, store_on_disk
from mesa_swarm.kernels.custom_functions import VERSION, compile_custom, is_refused, returns_whole_number
from mesa_swarm.kernels.custom_kernels import MEASURE, STEP, kernel_of_function
from mesa_swarm.kernels.digests import digest_function
from mesa_swarm.kernels.draws import Stream
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.model.measures import ColumnMeasure
from mesa_swarm.model.process_rule import identity_of
from mesa_swarm.physics.own_devices import array_of_parts, names_of_parts
from mesa_swarm.robots.devices import warn_of_plain
from mesa_swarm.world.read_only import locked_view


class MeasuredFunction:
    """A function of arrays that returns a number, and what it takes besides arrays."""

    def __init__(self, function: FunctionType) -> None:
        self.function, self.name = function, function.__qualname__
        self.place = function.__module__, function.__qualname__
        parameters = inspect.signature(function).parameters
        self.takes = tuple(parameters)
        self.numbers = {name: one.default for name, one in parameters.items() if one.default is not one.empty}
        for name, number in self.numbers.items():
            check_number(f"{self.name}'s {name}", number)
        digest = digest_function(function, VERSION)
        self._run: Any = store_on_disk(compile_custom(rename_function(function, digest)), digest)

    def __str__(self) -> str:
        return f"measure {self.name}"

    def is_whole(self, model: Any) -> bool:
        """Return whether it returns whole numbers, by its types: it is not called."""
        return returns_whole_number(self._run, tuple(self.arguments(model).values()))

    def arguments(self, model: Any) -> dict[str, Any]:
        """Return what the function takes by name: columns, arrays of parts and processes, numbers of the model."""
        return {name: self._value(model, name) for name in self.takes}

    def _value(self, model: Any, name: str) -> Any:
        if name == STEP:
            return int(model.steps)
        number, array = vars(model).get(name, self.numbers.get(name)), self._array(model, name)
        if isinstance(number, np.generic):
            number = number.item()
        if array is not None and number is not None:
            raise InvalidValueError(
                f"parameter {name} of measure {self.name} is a column, and a number of the model or of the function as "
                "well; give the number another name"
            )
        if array is not None:
            return locked_view(array)
        if isinstance(number, (int, float)):
            return number
        if name in vars(model):
            raise InvalidValueError(
                f"parameter {name} of measure {self.name} is the attribute {name} of the model, {shortened(number)}; "
                "expected a number"
            )
        known = [*model.swarm.columns, *names_of_parts(model), *self.numbers, STEP]
        raise UnknownNameError(unknown_name(f"parameter of measure {self.name}", name, sorted(known)))

    def _array(self, model: Any, name: str) -> np.ndarray | None:
        if name in model.swarm.columns:
            return model.swarm.columns[name]
        try:
            return array_of_parts(model, name)
        except KeyError:
            return None

    def read(self, model: Any) -> Any:
        """Return the number as it is now."""
        values = tuple(self.arguments(model).values())
        try:
            number = self._number(values)
        except SwarmError:
            raise
        except Exception as error:
            problem = " ".join(f"{type(error).__name__}: {error}".split())
            raise BehaviourError(f"measure {self.name} failed in step {model.steps}: it raised {problem}") from error
        return int(number) if isinstance(number, (bool, np.bool_)) else number

    def _number(self, values: tuple) -> Any:
        try:
            return self._run(*values)
        except Exception as error:
            if self._run is self.function or not is_refused(self._run, values):
                raise
            warn_of_plain(self.function, f"measure {self.name}", str(error) or type(error).__name__)
            self._run = self.function
        return self._run(*values)


class FunctionMeasure(ColumnMeasure):
    """A number of a model, computed by a function of arrays; made by `measure`."""

    @property
    def function(self) -> MeasuredFunction:
        """What computes it."""
        return self.args[0]

    def __repr__(self) -> str:
        return f"measure {self.function.name}"

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the name of an attribute of a class, which a function without a name has not."""
        self.function.place = owner.__module__, f"{owner.__qualname__}.{name}"
        self.function.name = f"{owner.__qualname__}.{name}"

    def __reduce__(self) -> tuple:
        """Return how a copy is made: by its name in its module, if it has one."""
        place = self.function.place
        return (measure_of_name, place) if _find(*place) is self else (measure, (self.function.function,))

    def __deepcopy__(self, memo: dict) -> "FunctionMeasure":
        return self

    def key(self, model: Any) -> Any:
        """Return what its kernel was made of."""
        return id(self.function), *map(identity_of, self.function.arguments(model).values())

    def is_in_place(self, model: Any) -> bool:
        """Return whether compiled code can compute it."""
        try:
            made, values = self._made(model)
            arrays = [value for value in values.values() if isinstance(value, np.ndarray)]
            return made.code is not None and all(array.flags.c_contiguous for array in arrays)
        except UnknownNameError:  # of a part that may be added later
            return False

    def is_whole(self, model: Any) -> bool:
        """Return whether it is a whole number."""
        return self.function.is_whole(model)

    def kernel(self, model: Any, out: np.ndarray, slot: int, noted: np.ndarray | None = None, every: int = 1) -> Kernel:
        """Return the kernel that writes it into a place of an array, again after the steps that `every` divides."""
        made, values = self._made(model)
        more = out, np.full(slot + 1, -1, np.int64) if noted is None else noted, slot, every
        block = Block(made.arrays(*values.values(), *more, Stream(0, 0)))
        return Kernel(made.code, block.numbers, block)

    def _made(self, model: Any) -> tuple[Any, Mapping[str, Any]]:
        values = {name: value for name, value in self.function.arguments(model).items() if name != STEP}
        more = {"out": np.zeros(1), "noted": np.zeros(1, np.int64), "slot": 0, "every": 1}
        return kernel_of_function(self.function.function, self.function.takes, {**values, **more}, MEASURE), values


def measure_of_name(module: str, name: str) -> Any:
    """Return the measure of this name in a module."""
    return attrgetter(name)(import_module(module))


def _find(module: str, name: str) -> Any:
    try:
        return measure_of_name(module, name)
    except (AttributeError, ImportError):  # of a function within another
        return None


def read_function(function: MeasuredFunction, model: Any) -> Any:
    """Return the number that a function of arrays computes of a model."""
    return function.read(model)


def measure(function: Callable) -> FunctionMeasure:
    """Return a measure that a function of arrays computes: compiled, so that a run takes no step more slowly.

    As an attribute of a class of models it is a property that returns the number as it is now; it is a reporter, `held`
    holds it for some steps, and `until` ends a run by it. Pages show it.

    Parameters
    ----------
    function : function
        Of what its parameters name: columns of robots, such as `position`; columns of parts, `bodies_position`, of
        layers, `control_temperature`, and what processes remember, `nest_energy`; numbers that are attributes of the
        model; `step`; others need a default.
        It returns a number and changes nothing.

    Raises
    ------
    InvalidValueError
        If it is not a function, or a default is not a number.
    UnknownNameError
        When a model without what a parameter names reads it.

    Examples
    --------
    >>> import math
    >>> from mesa_swarm import AGENT9, SwarmModel, held, measure
    >>> class Turning(SwarmModel):
    ...     @measure
    ...     @staticmethod
    ...     def polarization(heading):
    ...         x, y = np.cos(heading).sum(), np.sin(heading).sum()
    ...         return math.hypot(x, y) / len(heading)
    >>> model = Turning(rng=1, model_reporters=held("polarization", every=5))
    >>> robots = model.add_robots(AGENT9, poses=[(100, 100, 0.0), (200, 100, 0.0)])
    >>> model.run(20).polarization
    1.0
    """
    function = getattr(function, "__func__", function)
    function = getattr(function, "py_func", function)
    if not isinstance(function, FunctionType):
        raise InvalidValueError(f"measure got {shortened(function)}; expected a function of arrays")
    source = own_randomness(function)
    if source:
        raise BehaviourError(f"measure {function.__qualname__} uses {source}, which the model's seed does not govern")
    made = FunctionMeasure(read_function, MeasuredFunction(function))
    made.__doc__ = function.__doc__
    return made


__all__ = ["FunctionMeasure", "measure"]
