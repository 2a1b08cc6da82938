"""Custom rules: the decorator, and the layer that it makes."""

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from types import FunctionType
from typing import Any, overload

import numpy as np

from mesa_swarm.base.errors import (
    BehaviourError,
    InvalidValueError,
    UncompiledBehaviourWarning,
    UnknownNameError,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.control.chance import KEY, PLACES
from mesa_swarm.control.custom_fields import RuleFields, check_memory, fields_used
from mesa_swarm.control.layer import Senses
from mesa_swarm.control.rule import (
    PASS,
    RAISED,
    OfKernel,
    Rule,
    columns_of,
    describe_expected,
    describe_failure,
    rule_of,
)
from mesa_swarm.control.source import Read, own_randomness, uses_attribute, what_is_read
from mesa_swarm.kernels.block import stack_blocks
from mesa_swarm.kernels.draws import Words, words_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.robots.swarm import Swarm

# Of which senses a rule has views, the views, and the fields that the model adds.
NOT_KNOWN = (None, (), RuleFields())


__all__ = ["PASS", "Behaviour", "behaviour"]
# Functions that return something to wait for, which no step does.
NOT_AT_ONCE = (inspect.iscoroutinefunction, inspect.isgeneratorfunction, inspect.isasyncgenfunction)
# Beyond this, floats do not represent all whole numbers.
LARGEST_WHOLE = 2**53
# Of a row of `FieldCopy`.
COPY_NUMBERS = 7


class Behaviour:
    """A rule about one robot, as a layer. Made by `behaviour`; call it to change the rule's parameters."""

    # As many as the rule returns: known when it is compiled.
    numbers = None

    def __init__(
        self, rule: Rule, parameters: dict[str, float], memory: Mapping[str, np.ndarray] | None = None
    ) -> None:
        self.rule = rule
        self.parameters = parameters
        self.memory = dict(memory or {})
        self._prefix = ""
        self.name = rule.name
        self.__doc__ = rule.function.__doc__
        self._views: tuple = NOT_KNOWN
        self._swarm: Any = None  # where it is bound
        self._read: Read | None = None
        self._version = -1

    @property
    def read(self) -> Read:
        """What the rule reads besides its arguments: compiled as it was at its first step, in plain Python as it is."""
        begun = self._read is not None and self.rule.is_compiled(self._read)
        return self._read if begun else what_is_read(self.rule.function)  # type: ignore[return-value]

    @property
    def remembered(self) -> tuple[str, ...]:
        """The columns of the swarm in which it remembers, once it is part of a model's control."""
        return tuple(f"{self._prefix}.{name}" for name in self.memory) if self._prefix else ()

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self.parameters.items())
        return f"<Behaviour {self.name}({values})>"

    def __getstate__(self) -> dict:
        """Leave out the views of columns: copies have columns of their own."""
        return {**self.__dict__, "_views": NOT_KNOWN, "_version": -1}

    def __call__(self, **changes: float) -> "Behaviour":
        """Return the same rule with other parameters."""
        values = dict(self.parameters)
        for name, value in changes.items():
            if name not in values:
                raise UnknownNameError(unknown_name(f"parameter of {self.name}", name, values))
            values[name] = _check_value(f"{self.name}'s {name}", value, values[name])
        return Behaviour(self.rule, values, self.memory)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Store the swarm, and the stream of `me.chance` if the rule reads it; make columns for what it remembers.

        A rule that draws random numbers itself is refused, since the model's seed does not govern them.
        """
        source = own_randomness(self.rule.function)
        if source:
            raise BehaviourError(
                f"rule {self.name} uses {source}, which the model's seed does not govern; "
                "use me.chance, another number from 0 to 1 each time that it is read"
            )
        if self._swarm is not swarm:
            self._read, self._version = None, -1
        self._swarm, self._prefix = swarm, prefix
        for name, first in self.memory.items():
            swarm.remember(f"{prefix}.{name}", first.shape, first.dtype.type, first)
        self._rng = rng if fields_used(self.rule.function, ("chance",)) else None  # what it passes me to may draw

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Apply the rule to every robot that no earlier layer drives."""
        if not len(layer):
            return
        if self._rng is not None:
            self._look(senses)[0][-1][KEY] = self._rng.integers(2**64, dtype=np.uint64)
        self._apply(senses, command, layer, index)

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> Kernel | None:
        """Return what `decide` does; None before the first step, in which the rule is compiled, and for plain rules."""
        if self._version < 0 or not len(layer):
            return None
        columns, fields = self._look(senses)
        blocks = fields.copies()
        copies = stack_blocks(blocks, COPY_NUMBERS)
        words = Words(0, 0) if self._rng is None else words_of(self._rng)
        own = OfKernel(copies, columns[-1], words, np.array([-1]))
        values = tuple(self.parameters.values())
        kernel = self.rule.kernel_for(self._version, columns, fields, values, own, command, layer, index)

        def attend(code: int) -> None:
            if code == RAISED:  # as it does again, of which the error has the words
                self._apply(senses, command, layer, index)
            self._check_result(int(own.wrong[0]), command)

        return kernel and kernel._replace(kept=[kernel.kept, blocks], attend=attend)

    def begin(self) -> None:
        """Take the rule as it is now, with what it reads by name, unless that was done before."""
        if self._version < 0:
            self._read = self.read
            self._version = self.rule.version_of(self._read)

    def _apply(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Apply the rule with the numbers that were drawn for this step."""
        at = np.array([-1])
        values = tuple(self.parameters.values())
        try:
            columns, fields = self._look(senses)
            fields.load()
            self.begin()
            wrong = self.rule.run(self._version, columns, fields, values, at, command, layer, index)
            fields.store()
        except UncompiledBehaviourWarning:  # where warnings are errors
            raise
        except Exception as error:
            raise self._refusal(at[0], describe_failure(error, self._numbers(at[0]))) from error
        self._check_result(wrong, command)

    def _check_result(self, wrong: int, command: np.ndarray) -> None:
        """Raise an error for the robot whose rule has returned something else than a command, see `Rule.run`."""
        if wrong < -1:
            row = -2 - wrong
            raise self._refusal(row, f"returns a command of another drive; {describe_expected(self._numbers(row))}")
        if wrong >= 0:
            numbers = self._numbers(wrong)
            speeds = ", ".join(f"{speed:g}" for speed in command[wrong, :numbers])
            raise self._refusal(wrong, f"returned ({speeds}); {describe_expected(numbers)}")

    def _look(self, senses: Senses) -> tuple[tuple[np.ndarray, ...], RuleFields]:
        """Return what the rule may know; views are made again when robots are added or removed."""
        if self._views[0] is not senses:
            drawn = np.zeros(PLACES, np.uint64)
            columns = (*columns_of(senses, self._swarm.designs, self._swarm.number), drawn)
            self._views = senses, columns, self._fields(senses)
        return self._views[1], self._views[2]

    def _fields(self, senses: Senses) -> RuleFields:
        """Return what the model adds to `me`; only records that the rule uses, for they are copied in each step."""
        memory = {name: self._swarm.columns[f"{self._prefix}.{name}"] for name in self.memory}
        writable = {"act": senses.act, "memory": memory, "send": senses.send}
        outputs = {name: columns for name, columns in writable.items() if uses_attribute(self.rule.function, name)}
        return RuleFields(senses.own, outputs, senses.heard)

    def _numbers(self, row: int) -> int:
        """Return how many numbers the drive of the robot in this row takes."""
        return self._swarm.agents[row].design.numbers

    def _refusal(self, row: int, problem: str) -> BehaviourError:
        robot = self._swarm.agents[row]
        subject = f" for robot {robot.unique_id}" if row >= 0 else ""
        return BehaviourError(
            f"rule {self.name} failed{subject} in step {robot.model.steps}: it {' '.join(problem.split())}"
        )


@overload
def behaviour(rule: Callable) -> Behaviour: ...


@overload
def behaviour(*, memory: Mapping[str, Any] | None = None) -> Callable[[Callable], Behaviour]: ...


def behaviour(
    rule: Callable | None = None, *, memory: Mapping[str, Any] | None = None
) -> Behaviour | Callable[[Callable], Behaviour]:
    """Make a layer of a rule about one robot.

    The rule gets `me`, what the robot knows: `distance`, `kind`, `bearing` (one entry a proximity sensor), `radiation`,
    `line`; `front`, `left`, `right` (indices of sensors); `radius`, `max_speed`, `tendency` (1 left, -1 right),
    `temperature`, `heat`, `hot`, `extinguishing`; and `chance`, a number from 0 to below 1, another one each
    time that it is read, independent of what other robots read. None of it can be changed. An index is -1 where the
    robot has no such sensor, and index -1 reads nothing: a distance and kind of -1, no radiation, no line, a bearing of
    NaN.

    With a `Radio` it also hears of the nearest robot that has a task: `heard_layer` and `heard_task` (-1 for
    none), and where that is, `heard_x` ahead and `heard_y` left; and where the nearest goal is, `goal_x` and
    `goal_y` (NaN for none).

    A model adds fields: the name of each custom `Sensor` (an array; -1 and what the robot does not have read NaN);
    `act`, to which numbers for its actuators are assigned, ``me.act.lamp = 1.0``; with messages (`Radio`) `send`,
    likewise, and `heard`. With ``@behaviour(memory={"count": 0})`` each robot has a number of its own that the rule
    reads and assigns, ``me.memory.count += 1``. What is assigned stays if the rule returns `PASS`.

    The rule returns the speeds of the left and the right wheel, or as many numbers as the robots' drive takes (see
    `Drive`), or `PASS`, by this name, to leave the robot to the layers below. Its other parameters need defaults:
    numbers, True or False. It is compiled when first used; a rule that cannot be is run as plain Python, with a
    warning. Its loops, and those of the functions that it calls, take at most 1,000,000 iterations for a robot and
    step: more are an error (`mesa_swarm.control.limits`). Models with rules of the top level of a module can be
    pickled.

    Parameters
    ----------
    rule : function
    memory : dict, optional
        What each robot remembers from step to step: names, and with what each begins, a number, True or False, or a
        list of numbers. The type of the first value stays: 0 refuses 0.5, which 0.0 takes. Each is a column of the
        swarm, such as ``0.pause.steps`` of the first layer; it is part of a checkpoint, and begins anew when
        `SwarmModel.control` is set.

    Raises
    ------
    InvalidValueError
        If it is not a function of me, does not return at once (async, yield), or a parameter of it has no such default.

    Examples
    --------
    >>> @behaviour
    ... def timid(me, distance=20.0):
    ...     if 0 <= me.distance[me.front] < distance:
    ...         return -me.max_speed, -me.max_speed
    ...     return PASS
    >>> timid(distance=25)
    <Behaviour timid(distance=25.0)>
    >>> @behaviour(memory={"steps": 0})
    ... def pause(me, every=10):
    ...     me.memory.steps += 1
    ...     return (0.0, 0.0) if me.memory.steps % every == 0 else PASS
    """
    if rule is None:
        return partial(_behaviour, memory=memory)
    return _behaviour(rule, memory)


def _behaviour(rule: Callable, memory: Mapping[str, Any] | None) -> Behaviour:
    function = getattr(rule, "py_func", rule)  # as it was written, if Numba has it already
    if not isinstance(function, FunctionType):
        raise InvalidValueError(f"behaviour got {shortened(rule)}; expected a function of me")
    if any(is_kind(function) for is_kind in NOT_AT_ONCE):
        raise InvalidValueError(
            f"rule {function.__name__} is async or yields; expected a function that returns two speeds or PASS at once"
        )
    parameters = list(inspect.signature(function).parameters.values())
    if not parameters:
        raise InvalidValueError(f"rule {function.__name__} takes nothing; expected me as its first parameter")
    values = {parameter.name: _default(function.__name__, parameter) for parameter in parameters[1:]}
    return Behaviour(rule_of(function), values, check_memory(function.__name__, memory))


def _default(rule: str, parameter: inspect.Parameter) -> float:
    if parameter.kind is not parameter.POSITIONAL_OR_KEYWORD or parameter.default is parameter.empty:
        raise InvalidValueError(
            f"rule {rule} has the parameter {parameter} without a default; give it one, such as {parameter.name}=1.0"
        )
    return _check_value(f"{rule}'s {parameter.name}", parameter.default, parameter.default)


def _check_value(name: str, value: float, before: float) -> float:
    """Return a value of the type that the rule was written for, so that it is compiled once."""
    if isinstance(before, bool):
        if not isinstance(value, (bool, np.bool_)):
            raise InvalidValueError(f"{name} is {shortened(value)}; expected True or False")
        return bool(value)
    number = check_number(name, value)
    whole = isinstance(before, int) and number == int(number) and abs(number) <= LARGEST_WHOLE
    return int(number) if whole else number
