"""Measures: declared numbers of a model, which compiled code reads in each step, and conditions that end a run."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from inspect import getattr_static
from typing import Any, NamedTuple
from weakref import ref

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    UnknownNameError,
    check_count,
    check_name,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.kernels.block import CALL_NUMBERS, Block, KernelCall, code_address, stack_blocks
from mesa_swarm.kernels.measuring import (
    COUNT,
    ELEMENT,
    MEAN,
    MEASURING,
    MOST_ROWS,
    ONLY,
    SHARE,
    Kind,
    RowArrays,
    SpeedMeasure,
    StopArrays,
    check_stop,
    measure_rows,
    measure_speeds,
    write_row,
    write_speeds,
)
from mesa_swarm.kernels.part import Kernel

WORDS = ("count", "share", "mean", "value")
# Names besides columns: the speed of the body, as commanded; counters of the part `robots`.
SPEED, COUNTERS = "speed", "robots.counts"
# Properties of models that are these counters, in their order, and the module that defines them.
COUNTED, OWNER = ("collisions", "total_collisions", "robot_steps"), "mesa_swarm.model.engine_model"


class Spec(NamedTuple):
    """What a measure is of: how, a column, which values count, the place of an element, and what nothing gives."""

    how: int
    column: str
    low: float = -math.inf
    high: float = math.inf
    place: int = 0
    empty: float = math.nan

    def __str__(self) -> str:
        return f"{WORDS[self.how]}({self.column!r})"


class ColumnMeasure(partial):
    """A number of a model, declared by the column that it is made of: a reporter, or an attribute of a class.

    As an attribute of a class of models, it is a property that returns the number. A run reads it in compiled code, so
    that it takes no step more slowly; a function of Python would be due after each step. Made by `count`, `share`,
    `mean` and `value`.
    """

    def __get__(self, model: Any, kind: type | None = None) -> Any:
        return self if model is None else self(model)

    @property
    def spec(self) -> Spec:
        """What it is of."""
        return self.args[0]

    def __repr__(self) -> str:
        return str(self.spec)

    def key(self, model: Any) -> Any:
        """Return what its kernel was made of, which keeps that array: no other can have its address."""
        return id(array_of(model, self.spec.column)), self.spec

    def is_in_place(self, model: Any) -> bool:
        """Return whether compiled code can read its column as it is now."""
        try:
            flags = array_of(model, self.spec.column).flags
        except UnknownNameError:  # of a part that may be added later
            return False
        return flags.c_contiguous and flags.writeable

    def is_whole(self, model: Any) -> bool:
        """Return whether it is a whole number."""
        return is_whole_number(self.spec, array_of(model, self.spec.column))

    def kernel(self, model: Any, out: np.ndarray, slot: int) -> Kernel:
        """Return the kernel that writes it into a place of an array."""
        return kernel_of_measure(self.spec, model, out, slot)


def count(column: str, **bounds: Any) -> ColumnMeasure:
    """Return a measure of how many robots, or other rows of a column, have a value within bounds.

    Parameters
    ----------
    column : str
        One of the swarm, such as "collided", or of another part, such as "fires.out".
    equals, at_least, at_most, above, below : number or bool
        Which values count; by default those that are True, or not 0.

    Raises
    ------
    InvalidValueError
        If a bound has another name, or is not a number.
    UnknownNameError
        When a model without such a column reads it.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel, count
    >>> model = SwarmModel(rng=1, model_reporters={"to the left": count("tendency", above=0)})
    >>> robots = model.add_robots(AGENT9, 3, tendency=["left", "right", "left"])
    >>> model.run(2).datacollector.model_vars["to the left"]
    [2, 2]
    """
    return _measure(COUNT, column, bounds, 0.0)


def share(column: str, *, empty: float = math.nan, **bounds: Any) -> ColumnMeasure:
    """Return a measure of the share of rows that `count` counts, 0 to 1; `empty` where there are no rows.

    Examples
    --------
    >>> share("collided").spec.column
    'collided'
    """
    return _measure(SHARE, column, bounds, check_empty(empty))


def mean(column: str, *, empty: float = math.nan) -> ColumnMeasure:
    """Return a measure of the mean of a column of numbers, added up in the order of rows; `empty` without rows.

    "speed" stands for the speed of each body as commanded, map units a step.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel, mean
    >>> from mesa_swarm.control import Explore, Subsumption
    >>> model = SwarmModel(rng=1, model_reporters={"speed": mean("speed")})
    >>> robots = model.add_robots(AGENT9, 2)
    >>> model.control = Subsumption(Explore(speed=0.5))
    >>> model.run(1).datacollector.model_vars["speed"]
    [0.5]
    """
    return ColumnMeasure(read_measure, Spec(MEAN, check_column_name(column), empty=check_empty(empty)))


def value(column: str, place: int = 0) -> ColumnMeasure:
    """Return a measure that is one number of a column, at a place from 0; NaN where there is none.

    Examples
    --------
    >>> value("fires.area", 1).spec.place
    1
    """
    if type(place) is not int or place < 0:
        raise InvalidValueError(f"place is {shortened(place)}; expected a whole number of at least 0")
    return ColumnMeasure(read_measure, Spec(ELEMENT, check_column_name(column), place=place))


def check_column_name(column: str) -> str:
    """Return the name of a column, which is one word or two with a full stop between them."""
    return check_name("column", column)


def check_empty(empty: float) -> float:
    """Return what a measure is where there are no rows: a number, or NaN."""
    return math.nan if isinstance(empty, float) and math.isnan(empty) else check_number("empty", empty)


BOUNDS = ("equals", "at_least", "at_most", "above", "below")


def _measure(how: int, column: str, bounds: dict[str, Any], empty: float) -> ColumnMeasure:
    low, high = interval_of(bounds)
    return ColumnMeasure(read_measure, Spec(how, check_column_name(column), low, high, empty=empty))


def interval_of(bounds: dict[str, Any]) -> tuple[float, float]:
    """Return the least and the largest value within bounds; NaN twice, for what is not 0, without bounds.

    Examples
    --------
    >>> interval_of({"at_least": 2, "below": 3})
    (2.0, 2.9999999999999996)
    """
    for name in bounds:
        if name not in BOUNDS:
            raise InvalidValueError(f"{name} is not a bound; expected some of {', '.join(BOUNDS)}")
    if not bounds:
        return math.nan, math.nan
    numbers = {
        name: float(bound) if isinstance(bound, bool | np.bool_) else check_number(name, bound)
        for name, bound in bounds.items()
    }
    low = max(
        numbers.get("equals", -math.inf),
        numbers.get("at_least", -math.inf),
        math.nextafter(numbers["above"], math.inf) if "above" in numbers else -math.inf,
    )
    high = min(
        numbers.get("equals", math.inf),
        numbers.get("at_most", math.inf),
        math.nextafter(numbers["below"], -math.inf) if "below" in numbers else math.inf,
    )
    return low, high


# ---- reading


def array_of(model: Any, column: str) -> np.ndarray:
    """Return the array of one number a row that is a column of a model.

    Raises
    ------
    UnknownNameError
        With the names that there are.
    InvalidValueError
        If a row of it is several numbers.
    """
    array = find_array(model, column)
    if array.ndim != 1 or array.dtype not in MEASURING:
        raise InvalidValueError(f"column {column} has shape {array.shape}; expected one number a row for a measure")
    return array


def find_array(model: Any, column: str) -> np.ndarray:
    """Return the array that is a column of a model, of any shape."""
    if column == COUNTERS:
        return model.parts.robots.counts
    if column == SPEED:
        swarm = model.swarm
        return speeds_of(swarm.columns["command"], swarm.columns["design"], swarm.table.sideways)
    columns = model.swarm.columns
    return columns[column] if column in columns else find_array_of_part(model, column)


def find_array_of_part(model: Any, column: str) -> np.ndarray:
    """Return the column of a part, of those of every model the same one until bodies or robots change."""
    state, cache = (model.swarm.version, model.parts.bodies.cache.scene), model.driving
    if cache.state != state:
        cache.state, cache.arrays = state, {}
    if column in cache.arrays:
        return cache.arrays[column]
    name, _, of_part = column.partition(".")
    owned = model.parts[name].columns() if name in model.parts else {}
    if of_part not in owned and (array := model.parts.processes.memory_of(name, of_part)) is not None:
        return array
    if of_part not in owned:
        raise UnknownNameError(unknown_name("column", column, list_columns(model)))
    if state[1] is not None and model.parts[name] in model.parts.standing():
        cache.arrays[column] = owned[of_part].array
    return owned[of_part].array


def list_columns(model: Any) -> list[str]:
    """Return the names of all columns that measures may be of."""
    others = [f"{name}.{column}" for name, part in model.parts.items() if name != "robots" for column in part.columns()]
    return [SPEED, *model.swarm.columns, *others]


def read_measure(spec: Spec, model: Any) -> float | int:
    """Return the number that a measure is now."""
    array = array_of(model, spec.column)
    number = measure_rows(array, spec.how, spec.low, spec.high, spec.place, spec.empty)
    return int(number) if is_whole_number(spec, array) and not math.isnan(number) else number


def is_whole_number(spec: Spec, array: np.ndarray) -> bool:
    """Return whether a measure of an array is a whole number."""
    return spec.how == COUNT or (spec.how == ELEMENT and array.dtype.kind in "biu")


def measure_of(model: Any, reporter: Any) -> ColumnMeasure | None:
    """Return the measure that a reporter is, or that the attribute is which it names; None if it is neither."""
    if isinstance(reporter, ColumnMeasure):
        return reporter
    if not isinstance(reporter, str) or reporter in vars(model):
        return None
    attribute = getattr_static(type(model), reporter, None)
    function = getattr(attribute, "fget", None) or getattr(attribute, "function", None)
    if reporter in COUNTED and getattr(function, "__module__", "") == OWNER:
        return value(COUNTERS, COUNTED.index(reporter))
    return attribute if isinstance(attribute, ColumnMeasure) else None


def speeds_of(command: np.ndarray, design: np.ndarray, sideways: np.ndarray) -> np.ndarray:
    """Return the speed of each body as commanded, shape (n,), map units a step.

    Examples
    --------
    >>> speeds_of(np.array([[1.0, 0.5]]), np.array([0]), np.array([False]))
    array([0.75])
    """
    speeds = np.empty(len(command))
    write_speeds(command, design, sideways, speeds)
    return speeds


def kernel_of_measure(spec: Spec, model: Any, out: np.ndarray, slot: int) -> Kernel:
    """Return the kernel that writes a measure of a model into a place of an array."""
    kind = Kind(spec.how, spec.low, spec.high, spec.place, spec.empty, out, slot)
    array = array_of(model, spec.column)
    if spec.column == SPEED:
        columns = model.swarm.columns
        block = Block(SpeedMeasure(columns["command"], columns["design"], model.swarm.table.sideways, array, kind))
        return Kernel(measure_speeds, block.numbers, block)
    function, block_class = MEASURING[array.dtype]
    block = Block(block_class(array, kind))
    return Kernel(function, block.numbers, block)


def list_measured(column: np.ndarray, whole: bool) -> list[float | int]:
    """Return numbers as Python's, whole ones but NaN as such.

    Examples
    --------
    >>> list_measured(np.array([1.0, np.nan]), True)
    [1, nan]
    """
    return [int(number) if whole and not math.isnan(number) else number for number in column.tolist()]


class MeasuredRows:
    """MeasuredRows of measures that a compiled call of many steps writes.

    Parameters
    ----------
    model
    measures : dict of str to ColumnMeasure
    take : callable
        Is given the steps of new rows, (k,), and the values of each measure by its name, lists of k numbers.
    held : dict of str to Held
        Those of the measures that stay the same for some steps: they are functions.
    """

    def __init__(
        self, model: Any, measures: Mapping[str, ColumnMeasure], take: Callable[..., None], held: Mapping[str, Any]
    ) -> None:
        self._names, self._take, self._held = list(measures), take, dict(held)
        self._model = ref(model)
        numbers, noted = np.zeros(len(measures)), np.full(len(measures), -1, np.int64)
        self._numbers, self._noted = numbers, noted
        kernels = [
            measure.kernel(model, numbers, slot, noted, held[name].trigger.every)  # type: ignore[call-arg]
            if name in held
            else measure.kernel(model, numbers, slot)
            for slot, (name, measure) in enumerate(measures.items())
        ]
        self._whole = [measure.is_whole(model) for measure in measures.values()]
        self._measures = list(measures.values())
        calls = [Block(KernelCall(code_address(kernel.function), kernel.block)) for kernel in kernels]
        self._table, self._steps = np.zeros((MOST_ROWS, len(measures))), np.zeros(MOST_ROWS, np.int64)
        self._count, self._failed = np.zeros(1, np.int64), np.zeros(1, np.bool_)
        rows = self._table, self._steps, self._count, self._failed, model.driving.flag
        block = Block(RowArrays(stack_blocks(calls, CALL_NUMBERS), numbers, *rows))
        self.kernel = Kernel(write_row, block.numbers, (block, kernels), lambda code: self.hand_over(), self.finish)

    def begin(self) -> None:
        """Take over what is held, which Python may have measured since."""
        for name, held in self._held.items():
            slot = self._names.index(name)
            self._noted[slot] = held.measured
            self._numbers[slot] = math.nan if held.value is None else held.value

    def finish(self) -> None:
        """Hand over the rows; raise the error of a function that has failed, which is called once more for it."""
        self.hand_over()
        model = self._model()
        if self._failed[ONLY] and model is not None:
            self._failed[ONLY] = False
            for measure in self._measures:
                measure(model)

    def hand_over(self) -> None:
        """Hand over the rows that were written, and what is held."""
        for name, held in self._held.items():
            slot = self._names.index(name)
            if self._noted[slot] >= 0:
                value = self._numbers[slot].item()
                held.hold(int(self._noted[slot]), int(value) if self._whole[slot] and not math.isnan(value) else value)
        count = int(self._count[ONLY])
        if not count:
            return
        self._count[ONLY] = 0
        columns = self._table[:count].T
        values = [list_measured(column, whole) for column, whole in zip(columns, self._whole, strict=True)]
        self._take(self._steps[:count].tolist(), dict(zip(self._names, values, strict=True)))


# ---- conditions that end a run


class Until:
    """A condition that ends a run, for `stops` of a class and ``run(until=...)``: see `until` and `until_zero`.

    Parameters
    ----------
    of : str or ColumnMeasure
        The name of an attribute, or a measure.
    low, high : float
        It holds where the number is not below and not above these.
    every : int
        It is looked at after the steps that this divides.
    """

    def __init__(self, of: str | ColumnMeasure, low: float, high: float, every: int = 1) -> None:
        if not isinstance(of, ColumnMeasure):
            check_name("name of a number", of)
        self.of, self.low, self.high = of, low, high
        self.every = check_count("every", every, minimum=1)

    def __repr__(self) -> str:
        name = self.of if isinstance(self.of, str) else str(self.of.spec)
        return f"until({name!r}, at_least={self.low!r}, at_most={self.high!r})"

    def __call__(self, model: Any) -> bool:
        """Return whether it holds."""
        measure = measure_of(model, self.of)
        if measure is not None:
            return self.low <= measure(model) <= self.high
        try:
            number = getattr(model, str(self.of))
        except AttributeError:
            names = [*vars(model.datacollector).get("model_reporters", ()), *model.swarm.columns]
            raise UnknownNameError(unknown_name("number", str(self.of), names)) from None
        return number is not None and bool(self.low <= number <= self.high)

    def kernel(self, model: Any, flag: np.ndarray) -> Kernel | None:
        """Return what sets a flag where it holds, None if it is of a property that Python computes."""
        measure = measure_of(model, self.of)
        if measure is None:
            return None
        number = np.zeros(1)
        kernel = measure.kernel(model, number, ONLY)
        call = KernelCall(code_address(kernel.function), kernel.block)
        block = Block(StopArrays(call, number, float(self.low), float(self.high), flag))
        return Kernel(check_stop, block.numbers, (block, kernel))


def until(of: str | ColumnMeasure, *, every: int = 1, **bounds: Any) -> Until:
    """Return a condition that holds when a number of a model is within bounds.

    Parameters
    ----------
    of : str or ColumnMeasure
        The name of an attribute of the model, or a measure such as ``share("state", equals=1)``. Attributes that are
        declared as measures, and measures, take no step more slowly; others are computed in Python after each.
    every : int
        After which steps it is looked at: those that this divides.
    equals, at_least, at_most, above, below : number
        At least one of these.

    Raises
    ------
    InvalidValueError
        If there are no bounds, or they are no numbers.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> class Short(SwarmModel):
    ...     stops = until("steps", at_least=7)
    >>> Short(rng=1).run(100).steps
    7
    """
    if not bounds:
        raise InvalidValueError(f"until got no bounds; expected some of {', '.join(BOUNDS)}")
    return Until(of, *interval_of(bounds), every)


def until_zero(of: str | ColumnMeasure) -> Until:
    """Return a condition that holds when a number of a model is 0, such as that of fires that burn.

    Examples
    --------
    >>> until_zero("fires_burning")
    until('fires_burning', at_least=0.0, at_most=0.0)
    """
    return until(of, equals=0)


def check_stops(stops: Any) -> tuple[Until, ...]:
    """Return the conditions that end a run of a class, declared as one or a sequence."""
    conditions = (stops,) if isinstance(stops, Until) else tuple(stops) if isinstance(stops, list | tuple) else (stops,)
    for condition in conditions:
        if not isinstance(condition, Until):
            raise InvalidValueError(
                f"stops is {shortened(stops)}; expected conditions such as until_zero('fires_burning')"
            )
    return conditions
