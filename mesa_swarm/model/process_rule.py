"""Processes made of a function: of the model in Python, or of arrays and numbers that it names, compiled."""

import inspect
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from importlib import import_module
from types import FunctionType, MappingProxyType
from typing import Any, overload

import numpy as np

from mesa_swarm.base.errors import (
    BehaviourError,
    InvalidValueError,
    SwarmError,
    UncompiledBehaviourWarning,
    UnknownNameError,
    check_count,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.control.source import normal_source, own_randomness
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.custom_functions import compile_custom
from mesa_swarm.kernels.custom_kernels import CHANCE, STEP, STREAM, kernel_of_function
from mesa_swarm.kernels.draws import stream_of
from mesa_swarm.kernels.event_rows import INFINITE, ReportArrays, collect_events, key_of_name
from mesa_swarm.kernels.part import Kernel, Prepared
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.model.processes import Process
from mesa_swarm.robots.devices import warn_of_plain

# The first parameter of a function of the model.
MODEL = "model"
# Columns of robots that a function of arrays may change, and those of parts that ask for something: where driven bodies
# go, and which fires are lit again. All others are locked.
CHANGEABLE = ("temperature", "tendency")
ASKING = ("bodies.aim", "bodies.aim_heading", "fires.light")


class ProcessRule(Process):
    """A process made of a function with `process`; calling it returns one with other numbers.

    Attributes
    ----------
    function : function
    numbers : mapping
        Its parameters with defaults; others are those of another process, which calling this one returns.
    memory : dict of str to ndarray
        What it remembers from step to step.
    every : int
        It takes place in the steps that this divides.
    events : tuple of str
        Names of events that it reports.
    """

    resumable = True

    def __init__(
        self,
        function: FunctionType,
        numbers: Mapping[str, float],
        memory: Mapping[str, np.ndarray],
        every: int,
        events: tuple[str, ...] = (),
    ) -> None:
        self.function, self.numbers, self._every, self.events = function, MappingProxyType(dict(numbers)), every, events
        self._reports, self._prepared = np.empty((len(events), 0)), Prepared()
        self._place = 1  # among those of its name, in the order in which they were added
        self.memory = {name: array.copy() for name, array in memory.items()}
        self.__name__, self.__doc__ = function.__name__, function.__doc__

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self.numbers.items())
        return f"<process {self.__name__}({values})>"

    def __call__(self, **changes: float) -> "ProcessRule":
        """Return the same process with other numbers, and a memory of its own."""
        for name, value in changes.items():
            if name not in self.numbers:
                raise UnknownNameError(unknown_name(f"parameter of {self.__name__}", name, self.numbers))
            check_number(f"{self.__name__}'s {name}", value)
        return ProcessRule(self.function, {**self.numbers, **changes}, self.memory, self.every, self.events)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set one of its numbers, or what it remembers, by its name; or another attribute."""
        if name in self.__dict__.get("numbers", {}):
            check_number(f"{self.__name__}'s {name}", value)
            self.numbers = MappingProxyType({**self.numbers, name: value})
        elif name in self.__dict__.get("memory", {}):
            self.memory[name][:] = value
        else:
            super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        """Return one of its numbers, or what it remembers, by its name: a number, or an array of several."""
        memory, numbers = self.__dict__.get("memory", {}), self.__dict__.get("numbers", {})
        if name in numbers:
            return numbers[name]
        if name not in memory:
            raise AttributeError(f"process {self.__dict__.get('__name__', '')} has no attribute {name}")
        return memory[name][0].item() if len(memory[name]) == 1 else memory[name]

    def __reduce__(self) -> tuple:
        """Return how a copy is made: of the function, or of the process that has replaced it in its module."""
        module, name = self.function.__module__, self.function.__qualname__
        replacing = getattr(sys.modules.get(module), name, None)
        source = (module, name) if isinstance(replacing, ProcessRule) else self.function
        return rule_of_process, (source, dict(self.numbers), self.memory, self.every, self.events, self._place)

    def __deepcopy__(self, memo: dict) -> "ProcessRule":
        return self.for_model()

    def for_model(self) -> "ProcessRule":
        """Return the process that a model has: one with a memory of its own."""
        process = ProcessRule(self.function, self.numbers, self.memory, self.every, self.events)
        process._place = self._place
        return process

    def checkpoint(self) -> dict:
        """Return what it remembers, its numbers, and its source, which the fingerprint of a model includes."""
        return {"memory": self.memory, "numbers": dict(self.numbers), "source": normal_source(self.function)}

    def restore(self, state: dict) -> None:
        """Take back what it remembered; numbers and source are those with which the process was made."""
        for name, array in state["memory"].items():
            self.memory[name][:] = array

    @property
    def every(self) -> int:
        """Steps from one time to the next."""
        return self._every

    @every.setter
    def every(self, every: int) -> None:
        raise InvalidValueError(
            f"every of process {self.__name__} stays {self._every}; remove it from the model and add one with "
            f"process(every={shortened(every)})"
        )

    @property
    def takes_place_every(self) -> int:
        """Steps from one time to the next."""
        return self.every

    @property
    def takes_model(self) -> bool:
        """Whether it is a function of the model, in Python."""
        return next(iter(inspect.signature(self.function).parameters), "") == MODEL

    @property
    def asks(self) -> tuple[str, ...]:
        """The columns of parts that it writes to ask for something."""
        takes = () if self.takes_model else inspect.signature(self.function).parameters
        return tuple(name for name in ASKING if name.replace(".", "_") in takes)

    def check_model(self, model: Any) -> None:
        """Refuse names that a model does not have, and random numbers that its seed does not govern."""
        source = own_randomness(self.function)
        if source and not self.takes_model:
            raise BehaviourError(
                f"process {self.__name__} uses {source}, which the model's seed does not govern; name chance, a number "
                "from 0 to 1 that is drawn in each step, or stream, for draw_number(stream)"
            )
        if not self.takes_model:
            self.arguments(model)
        for name in self.events:
            if name in self.columns_of(model):
                raise InvalidValueError(f"events of process {self.__name__} has {name}, a column; give it another name")
        namesakes = [other for other in model.parts.processes.numbered.values() if self._is_like(other)]
        self._place = 1 + max((other._place for other in namesakes), default=0)

    def _is_like(self, other: Any) -> bool:
        return isinstance(other, ProcessRule) and other.__name__ == self.__name__

    def step(self, model: Any) -> None:
        """Take place."""
        if self.takes_model:
            self._call(model, partial(self.function, model, **self.numbers))
            return
        kernel = self.kernel_for(model)
        if kernel is not None:
            kernel.run(model.steps, len(model.swarm))
        else:
            self._call(model, partial(self.function, **self._present(model)))
            self._reporting(model).run(model.steps, len(model.swarm))

    def _call(self, model: Any, function: Callable[[], Any]) -> None:
        try:
            function()
        except (SwarmError, UncompiledBehaviourWarning):
            raise
        except Exception as error:
            self._reports[:] = np.nan
            problem = " ".join(f"{type(error).__name__}: {error}".split())
            raise BehaviourError(
                f"process {self.__name__} failed in step {model.steps}: it raised {problem}"
            ) from error

    def _stream(self, model: Any) -> np.random.Generator:
        """Return the stream of `chance`: of several processes of one name each has its own."""
        return model.streams[f"process {self.__name__}" + (f"#{self._place}" if self._place > 1 else "")]

    def arguments(self, model: Any) -> dict[str, Any]:
        """Return arrays and numbers by the names that the function takes; `chance` is 0 until it is drawn."""
        columns = self.columns_of(model)
        if self._reports.shape[1] != len(model.swarm):
            self._reports = np.full((len(self.events), len(model.swarm)), np.nan)
        reports = dict(zip(self.events, self._reports, strict=True))
        numbers = {**self.numbers, STEP: int(model.steps), CHANCE: 0.0, STREAM: stream_of(self._stream(model))}
        found: dict[str, Any] = {**columns, **self.memory, **reports, **numbers}
        for name in inspect.signature(self.function).parameters:
            if name not in found:
                raise UnknownNameError(unknown_name(f"parameter of process {self.__name__}", name, sorted(found)))
        return {name: found[name] for name in inspect.signature(self.function).parameters}

    def columns_of(self, model: Any) -> dict[str, np.ndarray]:
        """Return the columns of a model by names with underscores; those that a process may not change are locked."""
        of_swarm = model.swarm.columns
        columns = {
            name: array if name in CHANGEABLE or name[:1].isdigit() else lock_array(array)
            for name, array in of_swarm.items()
        }
        arrays_of_swarm = {id(array) for array in of_swarm.values()}
        for part_name, part in model.parts.items():
            is_added = any(part is added for added in model.parts.added())
            for name, (array, *_) in part.columns().items():
                if id(array) not in arrays_of_swarm:
                    key = f"{part_name}.{name}"
                    columns[key] = array if is_added or key in ASKING else lock_array(array)
        return {name.replace(".", "_"): array for name, array in columns.items()}

    def kernel_for(self, model: Any) -> Kernel | None:
        """Return the function with its arrays as a kernel, None if Numba refuses it."""
        if self.takes_model:
            return None
        arguments = self.arguments(model)
        key = [*map(identity_of, (*arguments.values(), model.swarm.version, *self._of_events(model)))]
        if self._prepared.state != key:
            self._prepared.state, self._prepared.kernel = key, self._make_kernel(model, arguments)
        return self._prepared.kernel

    def _make_kernel(self, model: Any, arguments: dict[str, Any]) -> Kernel | None:
        generator = self._stream(model)
        values = {name: value for name, value in arguments.items() if name not in (STEP, CHANCE, STREAM)}
        if any(isinstance(value, np.ndarray) and not value.flags.c_contiguous for value in values.values()):
            return None
        made = kernel_of_function(self.function, tuple(inspect.signature(self.function).parameters), values)
        if made.code is None:
            warn_of_plain(self.function, f"process {self.__name__}", made.problem)
            return None
        block = Block(made.arrays(*values.values(), stream_of(generator)))
        kernel = Kernel(made.code, block.numbers, (block, generator), partial(self._fail, model))
        if not self.events:
            return kernel
        reporting = self._reporting(model)
        return sequence_of([kernel, reporting])._replace(finish=reporting.finish)

    def _of_events(self, model: Any) -> tuple[np.ndarray, ...]:
        """Return the arrays into which events are collected."""
        events = model.parts.events
        return (events.buffer.filled, events.log.digest) if self.events else ()

    def _reporting(self, model: Any) -> Kernel:
        """Return the kernel that collects the events that were reported."""
        part, ids = model.parts.events, model.swarm.unique_ids.copy()
        codes = np.array([part.code_of(name) for name in self.events], np.int64)
        keys = np.array([key_of_name(name) for name in self.events], np.uint64)
        block = Block(ReportArrays(self._reports, codes, keys, ids, part.buffer, part.log.digest))
        return Kernel(collect_events, block.numbers, block, partial(self._attend_events, model), part.flush)

    def _attend_events(self, model: Any, code: int) -> None:
        """Empty the buffer; refuse a number that no event can have."""
        if code == INFINITE:
            place, row = (int(index) for index in np.argwhere(np.isinf(self._reports))[0])
            value, self._reports[:] = self._reports[place, row], np.nan
            model.parts.events.flush()
            raise BehaviourError(
                f"process {self.__name__} failed in step {model.steps}: it reported {self.events[place]} of robot "
                f"{model.swarm.agents[row].unique_id} as {value}; expected a finite number"
            )
        model.parts.events.flush()

    def _fail(self, model: Any, code: int) -> None:
        """Raise the error of the function, which is called once more for it."""
        try:
            self._call(model, partial(compile_custom(self.function), *self._present(model).values()))
        finally:
            self._reports[:] = np.nan
        raise BehaviourError(f"process {self.__name__} failed in step {model.steps}: it raised an error")

    def _present(self, model: Any) -> dict[str, Any]:
        arguments = self.arguments(model)
        if CHANCE in arguments:
            arguments[CHANCE] = self._stream(model).random()
        return arguments


def rule_of_process(
    source: Any, numbers: dict, memory: dict, every: int, events: tuple[str, ...] = (), place: int = 1
) -> ProcessRule:
    """Return a process of a function, or of that of another process, by its module and its name."""
    function = getattr(import_module(source[0]), source[1]).function if isinstance(source, tuple) else source
    process = ProcessRule(function, numbers, memory, every, events)
    process._place = place
    return process


def identity_of(value: Any) -> Any:
    """Return what differs for another array, or one of another length or type, and for another number."""
    if not isinstance(value, np.ndarray):
        return type(value), repr(value)
    return value.ctypes.data, value.shape, value.dtype.str, value.flags.writeable


@overload
def process(function: Callable) -> ProcessRule: ...


@overload
def process(
    *, memory: Mapping[str, Any] | None = None, every: int = 1, events: Sequence[str] = ()
) -> Callable[[Callable], ProcessRule]: ...


def process(
    function: Callable | None = None,
    *,
    memory: Mapping[str, Any] | None = None,
    every: int = 1,
    events: Sequence[str] = (),
) -> ProcessRule | Callable[[Callable], ProcessRule]:
    """Make a process of a function, to be added by `SwarmModel.add_process`.

    A function of `model` is called with the model in each step, in Python. Any other is compiled, and takes no step
    more slowly: it is called with what its parameters name.

    | parameter | is |
    | --- | --- |
    | a column, such as `position` or `temperature` | an array with a row a robot |
    | a column of another part, `fires_out` | that of ``model.parts["fires"]`` |
    | a name in `memory` | an array of the numbers that the process remembers, to be changed in place |
    | a name in `events` | an array with a row a robot: a number that is set is an event of that robot |
    | `step` | the number of the step, from 1 |
    | `chance` | a number from 0 to 1, drawn in each step |
    | `stream` | from which ``draw_number(stream)`` draws another one, as often as it is called |
    | `bodies_aim`, `bodies_aim_heading` | where driven bodies go in the next step, to be changed in place |
    | `fires_light` | a row a fire: a number above 0 lights it again after this step, at that temperature |
    | one with a default | a number, which ``rule(name=value)`` replaces |

    It may change the columns temperature and tendency, columns of added parts and memory of layers; all others are
    locked. A body that is carried, where ``bodies_carrier[b]`` is not -1, is let go when it is sent elsewhere, and is
    there at once, if no robot and nothing solid is. A function that Numba refuses is run as plain Python, with a
    warning.

    Parameters
    ----------
    function : function
    memory : dict, optional
        What the process remembers: names, and a number or a list of numbers each; hashed, stored and resumed.
    every : int
        It takes place in the steps that this divides, at least 1.
    events : sequence of str, optional
        Names of events that it reports, see `SwarmModel.event`: parameters of the function.

    Raises
    ------
    InvalidValueError
        If it is not a function, a parameter has a default that is not a number, or an event is not a parameter.
    UnknownNameError
        When it is added to a model without what a parameter names.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel
    >>> @process(memory={"farthest": 0.0})
    ... def measure(position, farthest, scale=1.0):
    ...     for i in range(position.shape[0]):
    ...         farthest[0] = max(farthest[0], scale * position[i, 0])
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(AGENT9, poses=[(100, 100, 0.0), (200, 100, 0.0)])
    >>> measuring = model.add_process(measure(scale=2.0))
    >>> model.run(3).processes[0].farthest
    400.0
    """
    if function is None:
        return partial(_process_of, memory=memory, every=every, events=events)
    return _process_of(function, memory, every, events)


def _process_of(function: Callable, memory: Mapping[str, Any] | None, every: int, events: Sequence[str]) -> ProcessRule:
    function = getattr(function, "py_func", function)
    if not isinstance(function, FunctionType):
        raise InvalidValueError(f"process got {shortened(function)}; expected a function of model, or of arrays")
    numbers = {
        name: parameter.default
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.default is not parameter.empty
    }
    for name, number in numbers.items():
        if name in (STEP, CHANCE, STREAM):
            raise InvalidValueError(f"{name} of process {function.__name__} has a default; leave it out: it is given")
        if not isinstance(number, bool):
            check_number(f"{function.__name__}'s {name}", number)
    arrays = {name: check_remembered(function.__name__, name, first) for name, first in (memory or {}).items()}
    names = check_event_names(function, events, {*numbers, *arrays, STEP, CHANCE, STREAM})
    return ProcessRule(function, numbers, arrays, check_count("every", every, minimum=1), names)


def check_event_names(function: FunctionType, events: Any, others: set[str]) -> tuple[str, ...]:
    """Return names of events that are parameters of a function, each of its own; others are refused."""
    if isinstance(events, str) or not isinstance(events, Iterable):
        raise InvalidValueError(f"events is {shortened(events)}; expected names of parameters such as ('delivered',)")
    names, parameters = tuple(events), inspect.signature(function).parameters
    if names and MODEL in parameters:
        raise InvalidValueError(f"process {function.__name__} takes the model and got events; call model.event instead")
    for name in names:
        if not isinstance(name, str) or name not in parameters or name in others or names.count(name) > 1:
            raise InvalidValueError(
                f"events of process {function.__name__} has {shortened(name)}; expected parameters of the function "
                "that are nothing else, each once"
            )
    return names


def check_remembered(process_name: str, name: str, first: Any) -> np.ndarray:
    """Return what a process remembers as an array of numbers or of True and False."""
    try:
        array = np.atleast_1d(np.array(first))
    except ValueError:
        array = np.array([None])
    if array.ndim != 1 or array.dtype.kind not in "bif" or not name.isidentifier():
        raise InvalidValueError(
            f"memory {name} of process {process_name} is {shortened(first)}; expected a number or a list of numbers"
        )
    kinds = {"b": np.bool_, "i": np.int64, "f": np.float64}
    return array.astype(kinds[array.dtype.kind])


def lock_array(array: np.ndarray) -> np.ndarray:
    """Return a view of an array that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view
