"""RuleFields of `me` that a model adds: custom readings, what robots hear, and records that a rule writes."""

import dis
from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import FunctionType
from typing import Any, NamedTuple, cast

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, shortened
from mesa_swarm.control.limits import LARGEST_WHOLE, MemoryKindError
from mesa_swarm.geometry.masked_arrays import fill_masked, holds_masked
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import ByteRows
from mesa_swarm.robots.devices import check_identifier, reserve_names
from mesa_swarm.world.read_only import locked_view

# What a rule may write, each a record with a field a name.
WRITTEN = ("act", "memory", "send")
reserve_names((*WRITTEN, "heard"))
KINDS = {"b": np.bool_, "i": np.int64, "u": np.int64, "f": np.float64}


class FieldForm(NamedTuple):
    """Names of the fields that a model adds, in the order of `RuleFields.arrays`, and their types.

    `readings` are names of custom sensors, `outputs` pairs of a record's name and its type, `heard` the names of what
    messages hold.
    """

    readings: tuple[str, ...] = ()
    outputs: tuple[tuple[str, np.dtype], ...] = ()
    heard: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the fields."""
        return (*self.readings, *(name for name, _ in self.outputs), *(("heard",) if self.heard else ()))


class Records:
    """Columns as an array of records, which a rule can assign to: ``me.act.lamp = 1.0``."""

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        self._columns = columns
        rows = len(next(iter(columns.values())))
        kind = np.dtype([(name, column.dtype, column.shape[1:]) for name, column in columns.items()])
        self.array = np.empty(rows, kind)

    def load(self) -> None:
        """Read the columns."""
        for name, column in self._columns.items():
            self.array[name] = column

    def store(self) -> None:
        """Write the columns."""
        for name, column in self._columns.items():
            column[...] = self.array[name]

    def copies(self) -> list[Block]:
        """Return what copies each column to its field and back, as `copy_fields` takes it."""
        rows, fields = len(self.array), cast(Any, self.array.dtype.fields)
        records = self.array.view(np.uint8).reshape(rows, -1)
        columns = {name: column.view(np.uint8).reshape(rows, -1) for name, column in self._columns.items()}
        return [Block(FieldCopy(column, records, fields[name][1])) for name, column in columns.items()]


class FieldCopy(NamedTuple):
    """The bytes of a column, of the records, and where in these the field begins."""

    column: ByteRows
    records: ByteRows
    offset: int


@compiled
def copy_fields(copies, loads):
    """Copy columns to fields of records, or back where it does not load; `copies` are rows of `FieldCopy`."""
    for k in range(copies.shape[0]):
        copy = unpack(copies[k], FieldCopy)
        for i in range(copy.column.shape[0]):
            for b in range(copy.column.shape[1]):
                if loads:
                    copy.records[i, copy.offset + b] = copy.column[i, b]
                else:
                    copy.column[i, b] = copy.records[i, copy.offset + b]


class RuleFields:
    """The values of the fields that a model adds for one rule."""

    def __init__(
        self,
        readings: Mapping[str, np.ndarray] | None = None,
        outputs: Mapping[str, Mapping[str, np.ndarray]] | None = None,
        heard: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        readings, outputs, heard = readings or {}, outputs or {}, heard or {}
        records = {name: Records(columns) for name, columns in outputs.items() if columns}
        self._records = tuple(records.values())
        kinds = tuple((name, record.array.dtype) for name, record in records.items())
        self.form = FieldForm(tuple(readings), kinds, tuple(heard))
        inputs = tuple(map(locked_view, readings.values())), tuple(map(locked_view, heard.values()))
        self.arrays = (*inputs[0], *(record.array for record in self._records), *inputs[1])

    def load(self) -> None:
        """Read what rules and layers before have written."""
        for records in self._records:
            records.load()

    def store(self) -> None:
        """Write what the rule has written."""
        for records in self._records:
            records.store()

    def copies(self) -> list[Block]:
        """Return what copies columns to records and back."""
        return [copy for records in self._records for copy in records.copies()]


class RecordEntry:
    """A record in plain Python: its fields can be read and assigned, and there are no others."""

    __slots__ = ("_array", "_row", "_word")

    def __init__(self, array: np.ndarray, row: int, word: str) -> None:
        for name, value in (("_array", array), ("_row", row), ("_word", word)):
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        value = self._column(name)[self._row]
        return value.view(_KeptArray) if isinstance(value, np.ndarray) else value

    def __setattr__(self, name: str, value: Any) -> None:
        column = self._column(name)
        _check_kept(name, column.dtype, value)
        column[self._row] = value

    def _column(self, name: str) -> np.ndarray:
        if name not in self._array.dtype.names:
            raise AttributeError(f"me.{self._word} has no field {name!r}", name=name, obj=self)
        return self._array[name]


class _KeptArray(np.ndarray):
    """A list in the memory of a plain rule: it refuses numbers that do not fit its type."""

    def __setitem__(self, index: Any, value: Any) -> None:
        _check_kept("", self.dtype, value)
        super().__setitem__(index, value)

    def __array_wrap__(self, array: np.ndarray, *_: Any) -> Any:
        """Return what is computed as ordinary arrays and numbers."""
        return np.asarray(array)[()]


def _check_kept(name: str, kind: np.dtype, value: Any) -> None:
    """Refuse fractions and NaN where whole numbers are stored, and other numbers than 0 and 1 for True and False."""
    numbers = np.asarray(value)
    if kind.kind == "i" and numbers.dtype.kind == "f":
        fits = (numbers == np.floor(numbers)) & (np.abs(numbers) < LARGEST_WHOLE)
    elif kind.kind == "b" and numbers.dtype.kind in "iuf":
        fits = (numbers == 0) | (numbers == 1)
    else:
        return
    if not fits.all():
        raise MemoryKindError(name, float(numbers[~fits].flat[0]) if numbers.ndim else float(numbers))


class RecordEntries:
    """An array of records in plain Python."""

    def __init__(self, array: np.ndarray, word: str) -> None:
        self._array, self._word = array, word

    def __getitem__(self, row: int) -> RecordEntry:
        return RecordEntry(self._array, row, self._word)


def plain_arrays(form: FieldForm, arrays: Sequence[np.ndarray]) -> tuple:
    """Return the values of the fields as plain Python needs them."""
    first = len(form.readings)
    words = {first + place: name for place, (name, _) in enumerate(form.outputs)}
    return tuple(RecordEntries(array, words[k]) if k in words else array for k, array in enumerate(arrays))


def fields_used(function: FunctionType, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return which fields of its first parameter, `me`, a function's code uses: all where more than a field is used.

    Examples
    --------
    >>> fields_used(lambda me: (me.radius, me.heat), ("heat", "hot", "radius"))
    ('heat', 'radius')
    >>> fields_used(lambda me: max(me), ("heat", "hot", "radius"))
    ('heat', 'hot', 'radius')
    """
    code = function.__code__
    me = code.co_varnames[0] if code.co_argcount else ""
    if not me or me in code.co_cellvars:
        return names
    used_names = set()
    for step, after in pairwise(dis.get_instructions(code)):
        loaded = step.argval if isinstance(step.argval, tuple) else (step.argval,)
        if me in loaded:
            is_field = step.opname.startswith("LOAD_FAST") and after.opname in ("LOAD_ATTR", "LOAD_METHOD")
            if not is_field or loaded.index(me) < len(loaded) - 1:
                return names
            used_names.add(after.argval)
    return tuple(name for name in names if name in used_names)


def record_of(function: FunctionType, field: str) -> str:
    """Return which of the records a function's code uses a field of, `me` if that is not seen in it."""
    words = (step.argval for step in dis.get_instructions(function) if step.opname.endswith(("_ATTR", "_METHOD")))
    return next((f"me.{before}" for before, after in pairwise(words) if after == field and before in WRITTEN), "me")


def check_memory(rule: str, memory: object) -> dict[str, np.ndarray]:
    """Return the first value of each name that a rule remembers, as an array of its type.

    Raises
    ------
    InvalidValueError
    """
    if memory is None:
        return {}
    if not isinstance(memory, Mapping):
        raise InvalidValueError(f"memory of rule {rule} is {shortened(memory)}; expected names and first values")
    return {check_identifier(f"memory of rule {rule}", name): _first(rule, name, v) for name, v in memory.items()}


def _first(rule: str, name: str, value: object) -> np.ndarray:
    try:
        array = fill_masked(value)
        if holds_masked(value) and np.isnan(array).any():
            array = np.empty(0, object)
    except Exception:  # of a class of the user's, or lists of unequal lengths
        array = np.empty(0, object)
    if array.dtype.kind not in KINDS or array.ndim > 1 or not array.size:
        raise InvalidValueError(
            f"memory {name} of rule {rule} is {shortened(value)}; expected a number, True, False, or a list of numbers"
        )
    return array.astype(KINDS[array.dtype.kind])
