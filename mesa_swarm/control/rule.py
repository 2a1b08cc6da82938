"""A custom rule as a loop over all robots: its readings, and errors in it."""

import math
import operator
import re
import sys
from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, reduce
from hashlib import blake2b
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll, njit, typeof, types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, overload, register_model

from mesa_swarm.base.errors import BehaviourError, shortened, unknown_name
from mesa_swarm.control.chance import KEY, Draws, begin_draws, reading_chance
from mesa_swarm.control.custom_fields import (
    FieldForm,
    RecordEntry,
    RuleFields,
    copy_fields,
    fields_used,
    plain_arrays,
    record_of,
)
from mesa_swarm.control.layer import Senses
from mesa_swarm.control.limits import (
    MOST_LOOPS,
    VERSION,
    LimitedCompiler,
    LoopsError,
    MemoryKindError,
    allow_loops,
    calls_itself,
    count_loops,
    find_uncounted,
    places_of_loops,
    uncompile,
)
from mesa_swarm.control.source import Read
from mesa_swarm.kernels.block import pack, unpack_as
from mesa_swarm.kernels.custom_code import CustomCode, rename_function, store_on_disk
from mesa_swarm.kernels.digests import digest_function
from mesa_swarm.kernels.draws import Words, draw_word
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import name_type
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.devices import reserve_names, warn_of_plain
from mesa_swarm.robots.drive import speeds_in_words
from mesa_swarm.world.read_only import locked_view

# A robot without a front sensor has me.front == -1. Python and Numba would take that as the last sensor, so
# that a rule would steer by what is behind the robot. Arrays of a type of their own read "nothing" instead.


class Readings(np.ndarray):
    """Readings in plain Python: index -1 reads `nothing`, and no reading can be changed.

    What is computed from them is an ordinary array: it has no `nothing`.
    """

    nothing: float | None = None

    def __getitem__(self, index: Any) -> Any:
        if self.nothing is not None and isinstance(index, (int, np.integer)):
            if index == -1:
                return self.dtype.type(self.nothing)
            if not 0 <= index < len(self):
                raise IndexError(f"sensor {index} does not exist; expected an index below {len(self)}")
        return self.view(np.ndarray)[index]

    def __setitem__(self, index: Any, value: Any) -> None:
        if self.nothing is not None:
            raise TypeError("readings cannot be changed; change a copy()")
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
        """What distinguishes types."""
        return *super().key, str(self.nothing)


register_model(ReadingsType)(models.ArrayModel)


def _reading(nothing: float) -> tuple[Callable, Any]:
    """Return the functions that make readings of an array, in plain Python and in compiled code."""

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

    return readings, typed


# What index -1 reads: of distances and kinds -1, of radiation 0, of lines False; and a bearing that is not there
# would make the wheels' speeds NaN, which is reported.
distances, sensed, bearings = _reading(-1), _reading(0), _reading(math.nan)
READINGS = {"seen": distances, "sensed": sensed, "bearings": bearings}


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
            context.call_conv.return_user_exc(builder, IndexError, ("this sensor does not exist",))
        place = cgutils.pointer_add(builder, array.data, builder.mul(index, stride))
        value = context.unpack_value(builder, kind.dtype, place)
        builder.store(value, result)
    return builder.load(result)


# What a rule returns when it is not active: a pair of numbers like any other, so that it compiles.
PASS = (math.inf, math.inf)
"""What a rule returns to leave the decision to the layers below."""
# Fields of `me` that a model adds with a part, and what is to be done where the part is missing.
MISSING_PARTS = {
    "act": "but no robot has an actuator; give the design some, as in RobotDesign(actuators=(Lamp(),))",
    "memory": "but the rule has no memory; declare it, as in @behaviour(memory={'count': 0})",
    **dict.fromkeys(
        ("send", "heard"),
        "but there is no radio with messages; set model.communication = Radio(range=100, message=('count',))",
    ),
}
CHANGES = "changes its readings; a rule may only read me: change a copy()"
# Numba's words for branches that return unlike things.
UNLIKE = "Can't unify return type"
UNKNOWN = "unknown field of a record:"
# Where a layer stores the function that it was made of: pickle finds it there under the function's own name.
PLACE = ".rule.function"

COLUMNS = (
    "distance", "kind", "bearing", "radiation", "line", "forward", "radius", "max_speed", "tendency", "temperature",
    "heat", "hot", "fire", "design", "heard_layer", "heard_task", "heard_from", "heard_goal", "counts", "number",
    "drawn",
)  # fmt: skip
COUNTS = COLUMNS.index("counts")
# The fields of `me`, and how each follows from the columns, for robot i of design d.
FIELDS = {
    "distance": "seen(distance[i, :counts[d, 0]])",
    "kind": "seen(kind[i, :counts[d, 0]])",
    "bearing": "bearings(bearing[d, :counts[d, 0]])",
    "radiation": "sensed(radiation[i, :counts[d, 1]])",
    "line": "sensed(line[i, :counts[d, 2]])",
    "front": "forward[d, 0]",
    "left": "forward[d, 1]",
    "right": "forward[d, 2]",
    **{name: f"{name}[i]" for name in ("radius", "max_speed", "tendency", "temperature", "heat", "hot")},
    "extinguishing": "fire[i] >= 0",
    "heard_layer": "heard_layer[i]",
    "heard_task": "heard_task[i]",
    "heard_x": "heard_from[i, 0]",
    "heard_y": "heard_from[i, 1]",
    "goal_x": "heard_goal[i, 0]",
    "goal_y": "heard_goal[i, 1]",
    "chance": "Draws(begin_draws(drawn), number[i])",
}
# Text, since Numba knows a tuple only if its parts are named one by one.
LOOP = """
def run(columns, values, at, command, layer, index):
    USED = columns
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        at[0] = i
        allow_loops(MOST_LOOPS)
        d = design[i]
        me = Me(PARTS)
        taken = take(rule(me, *values), command, i, counts[d, 3])
        if taken == PASSED:
            continue
        if taken != DONE:
            return i if taken == WRONG else -2 - i
        layer[i] = index
    return -1
"""

# The same as a kernel, see `OfKernel`: an error of the rule is a code, and the rule is run anew to raise it.
KERNEL = """
def run_rule(block, step, first, last):
    columns, values, at, command, layer, index, own = take_block(block)
    if own.words.draw:
        own.drawn[KEY] = draw_word(own.words)
    copy_fields(own.copies, True)
    try:
        own.wrong[0] = run(columns, values, at, command, layer, index)
    except Exception:
        return RAISED
    copy_fields(own.copies, False)
    return REFUSED if own.wrong[0] != -1 else 0
"""
# What a kernel returns: the rule has raised an error; it has returned no command of its drive.
RAISED, REFUSED = 1, 2

Me = namedtuple("Me", FIELDS)  # type: ignore[misc]
reserve_names(Me._fields)


class OfKernel(NamedTuple):
    """What a kernel of a rule takes besides the arguments of its loop.

    Parameters
    ----------
    copies : int64 ndarray, shape (k, 7)
        Rows of `FieldCopy`.
    drawn : uint64 ndarray, shape (2,)
        See `Draws`.
    words : Words
        From which the key of a step is drawn, two zeros for a rule that does not read `me.chance`.
    wrong : int64 ndarray, shape (1,)
        What the loop has returned.
    """

    copies: np.ndarray
    drawn: np.ndarray
    words: Words
    wrong: np.ndarray


class WheelsError(Exception):
    """A plain rule returned something else than the numbers of a drive: its only argument."""


class DefectError(Exception):
    """A rule cannot be right, though no robot has come to what is wrong with it."""


class Rule:
    """A function about one robot, compiled when first used. All variants of a behaviour share it."""

    def __init__(self, function: FunctionType) -> None:
        self.function = function
        self.name = function.__name__
        self._loops: dict[tuple, tuple[tuple[int, ...], Callable]] = {}
        self._kernels: dict[str, Any] = {}
        self._versions: dict[str, int] = {}
        self._with_names: list[FunctionType] = []
        self._compiled: set[int] = set()

    def version_of(self, read: Read) -> int:
        """Return the number of the version of the rule that reads this, see `source.what_is_read`.

        Compiled code has what it reads as constants: where that has changed, the rule is compiled again. Versions are
        compared as texts, in which 7, 7.0 and True differ, and NaN is like itself.
        """
        text = repr(read)
        if text not in self._versions:
            self._versions[text] = len(self._versions)
            self._with_names.append(_with_names(self.function))
        return self._versions[text]

    @property
    def is_plain(self) -> bool:
        """Whether the rule runs as plain Python, which is known after its first step."""
        return any(version not in self._compiled for version, *_ in self._loops)

    def is_compiled(self, read: Read) -> bool:
        """Return whether this process has compiled the version of the rule that reads this."""
        return self._versions.get(repr(read), -1) in self._compiled

    def __deepcopy__(self, memo: dict) -> "Rule":
        """Return the rule itself: functions are never copied."""
        return self

    def __reduce__(self) -> tuple:
        """Pickle the function by its name, by which pickle finds the layer that was made of it."""
        function = self.function
        name = function.__qualname__.removesuffix(PLACE)
        home = sys.modules.get(function.__module__)
        value = reduce(lambda part, word: getattr(part, word, None), name.split("."), home)
        if getattr(getattr(value, "rule", None), "function", None) is function:
            function.__qualname__ = name + PLACE
        elif value is not function:
            raise BehaviourError(
                f"rule {name} of {function.__module__} cannot be pickled, since it is not found by that name; "
                "define it at the top level of a module"
            )
        return rule_of, (function,)

    def run(
        self, version: int, columns: tuple, fields: RuleFields, values: tuple, at: np.ndarray, *outputs: Any
    ) -> int:
        """Apply the rule to every robot that no layer drives yet; return the first whose speeds are not finite, or -1.

        Where it returns more or fewer numbers than a robot's drive takes, that robot's row r is returned as -2 - r.
        `version` is that of `version_of`.
        `columns` are those of `columns_of`, and `drawn` of `Draws`; `fields` are what the model adds; `outputs` are
        the columns `command` and `layer`, and the index of the layer. `at` (1,) is set to the robot that the rule is
        about, to name it if the rule raises an error.
        """
        form = fields.form
        kinds = version, form, *map(type, values)
        arrays = *columns, *fields.arrays
        if kinds in self._loops:
            return self._call_loop(kinds, arrays, values, at, *outputs)
        numbers = _numbers_in(columns)
        (places, loop), problem = _compile_if_possible(
            self.function, self._with_names[version], form, arrays, values, numbers
        )
        inputs = tuple([arrays[place] for place in places])
        if not problem:
            self._compiled.add(version)
            self._loops[kinds] = places, loop
            return loop(inputs, values, at, *outputs)
        names = find_uncounted(self.function)
        if names:  # what may not end is named before it begins
            self._complain(problem, form, numbers[0], names)
        # What a rule does wrong to a robot is seen in plain Python: Numba only knows types.
        wrong = loop(inputs, values, at, *outputs)
        if wrong < 0:
            at[0] = -1
            if not names:
                self._complain(problem, form, numbers[0])
            self._loops[kinds] = places, loop
        return wrong

    def _call_loop(self, kinds: tuple, arrays: tuple, *arguments: Any) -> int:
        places, loop = self._loops[kinds]
        return loop(tuple([arrays[place] for place in places]), *arguments)

    def kernel_for(
        self, version: int, columns: tuple, fields: RuleFields, values: tuple, own: OfKernel, *outputs: Any
    ) -> Kernel | None:
        """Return what `run` does for the same arguments, as one function; None before the first run, and in Python."""
        kinds = version, fields.form, *map(type, values)
        if kinds not in self._loops or version not in self._compiled:
            return None
        places, loop = self._loops[kinds]
        arrays = *columns, *fields.arrays
        inputs = tuple([arrays[place] for place in places])
        if not all(array.flags.c_contiguous for array in inputs):
            return None
        arguments = inputs, values, np.array([-1]), *outputs, own
        kind = typeof(arguments)
        key = f"{version} {name_type(kind)}"
        if key not in self._kernels:
            self._kernels[key] = _compile_kernel(loop, kind)
        return Kernel(self._kernels[key], pack(arguments), arguments)

    def _complain(self, problem: str, form: FieldForm, numbers: int, names: Sequence[str] = ()) -> None:
        """Refuse a rule that is wrong somewhere; warn of one that is only slow."""
        defect = find_defect(problem, form, self.function, numbers)
        if defect:
            raise DefectError(defect)
        limits = f"; loops in {', '.join(names)} are not counted, and may not end" if names else ""
        warn_of_plain(self.function, f"rule {self.name}", problem, limits)


@cache
def rule_of(function: FunctionType) -> Rule:
    """Return the rule that is made of a function, always the same one, so that it is compiled once."""
    return Rule(function)


def columns_of(senses: Senses, designs: tuple[RobotDesign, ...], number: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return what a rule may know of all robots, read-only, and how many sensors of each kind the designs have.

    The last are the robots' numbers, by which `me.chance` is drawn.
    """
    counts = [(len(d.proximity), len(d.radiation), len(d.line), d.numbers) for d in designs]
    columns = (
        senses.distance, senses.kind, senses.bearing, senses.radiation, senses.line, senses.forward,
        senses.radius, senses.max_speed, senses.tendency, senses.temperature, senses.heat, senses.hot,
        senses.fire, senses.design, senses.heard_layer, senses.heard_task, senses.heard_from, senses.heard_goal,
        np.array(counts, np.int64).reshape(-1, 4), number,
    )  # fmt: skip
    return tuple(map(locked_view, columns))


def _with_names(function: FunctionType, **names: Any) -> FunctionType:
    """Return a function with names of its own: those around it as they are now, and others."""
    around = {**function.__globals__, **names}
    copy = FunctionType(function.__code__, around, function.__name__, function.__defaults__, function.__closure__)
    copy.__kwdefaults__, copy.__qualname__ = function.__kwdefaults__, function.__qualname__
    return copy


def _compile_if_possible(
    function: FunctionType, snapshot: FunctionType, form: FieldForm, columns: tuple, values: tuple, numbers: list[int]
) -> tuple[tuple[tuple[int, ...], Callable], str]:
    """Return the loop over all robots, compiled if that can be, and Numba's explanation if not.

    `snapshot` is compiled: the function with the names around it as they were when the robots were given the rule.
    """
    recursive = calls_itself(function)
    if recursive:
        return _plain_loop(function, form), f"{recursive} calls itself"
    variants = [snapshot, *(_with_longer_pass(snapshot, count) for count in numbers if count != len(PASS))]
    problems = []
    for variant in variants:
        loop, problem = _try_compiling(variant, form, columns, values, numbers)
        if not problem:
            return loop, ""
        problems.append(problem)
    return _plain_loop(function, form), problems[0]


def _numbers_in(columns: tuple) -> list[int]:
    """Return the numbers of commands of all designs, ascending; of two-wheeled robots where there is none."""
    return np.unique(columns[COUNTS][:, 3]).tolist() or [2]


def _with_longer_pass(function: FunctionType, count: int) -> FunctionType:
    """Return a rule in which the name `PASS` is for this count of numbers: all its branches have to be of one type."""
    passes = {n: (math.inf,) * count for n in function.__code__.co_names if function.__globals__.get(n) is PASS}
    return _with_names(function, **passes)


def _try_compiling(
    function: FunctionType, form: FieldForm, columns: tuple, values: tuple, numbers: list[int]
) -> tuple[tuple[tuple[int, ...], Callable], str]:
    """Return the compiled loop, and Numba's explanation if it cannot be, or the rule does not return a command."""
    fields = fields_used(function, (*Me._fields, *form.names))
    digest = digest_function(function, str(form), fields, numbers, VERSION, places_of_loops(function))
    # Bounds are checked: an index that is one too many would otherwise read another robot's memory.
    rule: Any = njit(error_model="numpy", boundscheck=True, pipeline_class=LimitedCompiler)(
        rename_function(function, digest)
    )
    places, loop = _loop(form, fields, rule, COMPILED)

    def returned() -> list[Any]:
        return [result.signature.return_type for result in rule.overloads.values()]

    def is_right() -> bool:
        return all(_is_command(kind, numbers) for kind in returned())

    run: Any = store_on_disk(njit(error_model="numpy")(rename_function(loop, digest)), digest, is_right)
    no_rows = np.empty(0, np.int64)
    try:
        run(tuple(columns[place] for place in places), values, no_rows, np.empty((0, 2)), no_rows, 0)
        problem = ""
    except KeyError as error:  # Numba's for a field that a record does not have
        problem = f"{UNKNOWN} {error.args[0]}"
    except Exception as error:  # it was about no robot, so that the rule itself cannot have raised it
        problem = str(error) or type(error).__name__
    if not is_right():
        problem = f"{UNLIKE}: {returned()[0]}"
    return (places, run), problem


def _compile_kernel(loop: Any, kind: Any) -> Any:
    """Return a compiled loop as a function of a block of arguments of this type."""
    space: dict[str, Any] = {"__name__": __name__, **OF_KERNEL, "run": loop, "take_block": unpack_as(kind)}
    exec(KERNEL, space)
    code = loop._cache.name if isinstance(loop._cache, CustomCode) else None
    digest = code and blake2b(f"{code} {name_type(kind)}".encode(), digest_size=16).hexdigest()
    return store_on_disk(njit(error_model="numpy", nogil=True)(rename_function(space["run_rule"], digest)), digest)


def _is_command(kind: Any, numbers: list[int]) -> bool:
    if not isinstance(kind, types.BaseTuple) or len(kind) not in (len(PASS), *numbers):
        return False
    parts: Any = kind
    return all(isinstance(types.unliteral(part), (types.Integer, types.Float)) for part in parts)


PASSED, DONE, WRONG, MISFIT = range(4)


def _expressions(form: FieldForm) -> dict[str, str]:
    """Return how each field of `me` follows from the columns, those that a model adds too."""
    arrays = (f"array_{k}[i]" for k in range(_count_of_arrays(form)))
    readings = {name: f"bearings({next(arrays)})" for name in form.readings}
    outputs = {name: next(arrays) for name, _ in form.outputs}
    return FIELDS | readings | outputs | ({"heard": f"Heard({', '.join(arrays)})"} if form.heard else {})


def _count_of_arrays(form: FieldForm) -> int:
    return len(form.readings) + len(form.outputs) + len(form.heard)


def write_command(speeds: tuple, command: np.ndarray, i: int, numbers: int) -> int:
    """Write what a rule returned as the command of robot i, and return what it was; its drive takes `numbers`.

    PASSED if it left the robot to other layers, DONE, WRONG if a number is not finite, MISFIT if there are more or
    fewer; in plain Python a `WheelsError` instead of the latter.
    """
    if all(speed == math.inf for speed in speeds):
        return PASSED
    if len(speeds) != numbers:
        raise WheelsError(speeds)
    for w, speed in enumerate(speeds):
        command[i, w] = speed
    return DONE if all(map(math.isfinite, speeds)) else WRONG


@overload(write_command)
def _compiled_take(speeds: tuple, command: np.ndarray, i: int, numbers: int) -> Callable:
    return _take_pair if len(speeds) == len(PASS) else _take_several


def _take_pair(speeds: tuple, command: np.ndarray, i: int, numbers: int) -> int:
    left, right = speeds
    if left == math.inf and right == math.inf:
        return PASSED
    if numbers != 2:
        return MISFIT
    command[i, 0] = left
    command[i, 1] = right
    return DONE if math.isfinite(left) and math.isfinite(right) else WRONG


def _take_several(speeds: tuple, command: np.ndarray, i: int, numbers: int) -> int:
    passes = finite = True
    for speed in literal_unroll(speeds):
        passes = passes and speed == math.inf
        finite = finite and math.isfinite(speed)
    if passes or numbers != len(speeds):
        return PASSED if passes else MISFIT
    w = 0  # Numba unrolls no enumerate()
    for speed in literal_unroll(speeds):
        command[i, w] = speed
        w += 1  # noqa: SIM113
    return DONE if finite else WRONG


# What the text of the loop uses.
OF_LOOP = {
    "Draws": Draws,
    "take": write_command,
    "PASSED": PASSED,
    "DONE": DONE,
    "WRONG": WRONG,
    "MOST_LOOPS": MOST_LOOPS,
}
# What the text of the kernel uses.
OF_KERNEL = {"draw_word": draw_word, "copy_fields": copy_fields, "KEY": KEY, "RAISED": RAISED, "REFUSED": REFUSED}
BEGINNINGS = (begin_draws.py_func, begin_draws)
LIMITS = (lambda count: None, allow_loops)  # a plain rule counts by itself
PLAIN, COMPILED = (
    {
        **OF_LOOP,
        "allow_loops": LIMITS[place],
        "begin_draws": BEGINNINGS[place],
        **{name: pair[place] for name, pair in READINGS.items()},
    }
    for place in (0, 1)
)


def _loop(
    form: FieldForm,
    fields: Iterable[str],
    rule: Callable,
    names_of_parts: Mapping[str, Any],
    make_me: Callable[[type], type] = lambda fields: fields,
) -> tuple[tuple[int, ...], FunctionType]:
    """Return the loop that applies a rule, compiled or not, to every robot that no layer drives yet.

    It fills only these fields of `me`, and takes only the columns and arrays that these need, whose places come first:
    each column in its arguments costs time while it is compiled, and each field in every step.
    """
    expressions = _expressions(form)
    parts = {name: expressions[name] for name in expressions if name in fields} or {"radius": expressions["radius"]}
    text = LOOP.replace("PARTS", ", ".join(parts.values()))
    names = (*COLUMNS, *(f"array_{k}" for k in range(_count_of_arrays(form))))
    places = tuple(k for k, name in enumerate(names) if re.search(rf"\b{name}\b", text))
    space: dict[str, Any] = {
        "__name__": __name__,
        "Me": make_me(namedtuple("Me", list(parts))),
        "Heard": namedtuple("Heard", form.heard),
        "rule": rule,
        **names_of_parts,
    }
    exec(text.replace("USED", "".join(f"{names[k]}, " for k in places)), space)
    return places, space["run"]


def _plain_loop(function: FunctionType, form: FieldForm) -> tuple[tuple[int, ...], Callable]:
    """Return the same loop for a rule that stays plain Python, whatever it returns."""
    rule = uncompile(function)

    def checked(me: Any, *values: float) -> tuple:
        with count_loops():
            wheels = rule(me, *values)
        if not isinstance(wheels, tuple) or not wheels or not all(map(_is_number, wheels)):
            raise WheelsError(wheels)
        return wheels

    places, loop = _loop(form, (*Me._fields, *form.names), checked, PLAIN, reading_chance)

    def run(columns: tuple, *more: Any) -> int:
        count = len(columns) - _count_of_arrays(form)
        with np.errstate(all="ignore"):  # as in compiled rules: what is not finite is reported
            return loop((*columns[:count], *plain_arrays(form, columns[count:])), *more)

    return places, run


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def describe_expected(numbers: int) -> str:
    """Return what a rule is expected to return for a robot whose drive takes `numbers`."""
    return f"expected {speeds_in_words(numbers)}{' (left, right)' if numbers == 2 else ''}, or PASS"


def unknown_field(name: str, known_fields: Iterable[str], owner: str = "me") -> str:
    """Return what is wrong with a field that `me`, or a part of it, does not have: if a device is missing, which."""
    if owner == "me" and name in MISSING_PARTS:
        return f"uses me.{name}, {MISSING_PARTS[name]}"
    return f"uses an {unknown_name(f'field of {owner}', name, known_fields)}"


def find_defect(problem: str, form: FieldForm, function: FunctionType, numbers: int) -> str:
    """Return what is wrong with a rule that Numba refused, or nothing if it is only slow."""
    field = re.search(r"Unknown attribute '(\w+)' of type (Me|Heard)\(", problem)
    if field:
        is_me = field[2] == "Me"
        known_fields = (*Me._fields, *form.names) if is_me else form.heard
        return unknown_field(field[1], known_fields, "me" if is_me else "me.heard")
    if problem.startswith(UNKNOWN):
        name = problem.removeprefix(UNKNOWN).strip()
        record = record_of(function, name)
        fields = [field for word, kind in form.outputs if f"me.{word}" == record for field in kind.names or ()]
        return unknown_field(name, fields, record)
    if re.search(r"Cannot modify readonly|No definition for lowering Me\(.*\)\.\w+ =", problem):
        return CHANGES
    if UNLIKE in problem:
        speeds = speeds_in_words(numbers).replace(" finite", "")
        return f"does not return {speeds} in every branch; {describe_expected(numbers)}"
    return ""


def _fields_of(owner: Any) -> tuple[str, tuple[str, ...]]:
    """Return the name and the fields of `me` or a part of it."""
    if isinstance(owner, RecordEntry):
        return f"me.{owner._word}", owner._array.dtype.names
    return {"Me": "me", "Heard": "me.heard"}.get(type(owner).__name__, ""), getattr(owner, "_fields", ())


def describe_failure(error: Exception, numbers: int) -> str:
    """Return what a rule did wrong, of the error that it raised for a robot whose drive takes `numbers`."""
    if isinstance(error, DefectError):
        return str(error)
    if isinstance(error, WheelsError):
        hint = " (a branch without return?)" if error.args[0] is None else ""
        return f"returned {shortened(error.args[0])}{hint}; {describe_expected(numbers)}"
    if isinstance(error, LoopsError | MemoryKindError):
        return _describe_limit(error)
    if isinstance(error, AttributeError):
        owner, known_fields = _fields_of(error.obj)
        if error.name not in known_fields:
            return unknown_field(str(error.name), known_fields, owner)
    return f"raised {type(error).__name__}: {error}"


def _describe_limit(error: LoopsError | MemoryKindError) -> str:
    """Return which limit a rule went beyond: that of its loops, or the type of what it remembers."""
    if isinstance(error, LoopsError):
        line, name = error.args
        return f"looped more than {MOST_LOOPS:,} times in one step, in {name}, line {line}; let the loop end"
    name, value = error.args
    subject = f"me.memory.{name}" if name else "a number in a list of me.memory"
    return (
        f"set {subject} to {value:g}, which does not fit the type of its first value; begin a number with 0.0 to store "
        "fractions"
    )
