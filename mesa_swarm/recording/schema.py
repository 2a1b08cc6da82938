"""What a recording must hold: its provenance, its columns and what it carries, checked before anything is believed.

A checksum that fits proves that a file was not damaged, not that mesa_swarm wrote it. Whatever a recording holds is
therefore checked here once, when it is opened, and its rows where they are decoded.
"""

import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa

from mesa_swarm.errors import RecordingError, shortened
from mesa_swarm.recording.frames import Rows
from mesa_swarm.recording.layout import TABLES, WHOLE
from mesa_swarm.recording.sealed_stream import Piece
from mesa_swarm.robots.swarm import COLUMNS

# In what a recording begins with. A text of JSON takes up to twenty times as much memory once it is read.
LONGEST_TEXT = 1 << 25
MOST_LISTS = 2_000_000
DEEPEST = 50
MOST_EVERY = 1_000_000
# Rows that may be missing between two, where steps failed, and so many steps at most.
MOST_MISSING = 100
MOST_UNSEEN = 100_000
MOST_STEPS = 10**15
MOST_IDS = 2**31 - 1
MOST_ROBOTS = 10_000_000
LARGEST = 1e12
# Of a chunk; those that mesa_swarm writes have at most 256.
MOST_ROWS = 100_000
# Values of one robot in one column.
WIDEST = 100_000
FIRST_COLUMNS = {"step": pa.int64(), "state_hash": pa.string(), "robot": pa.list_(pa.int32())}
# Columns that are never NaN nor infinite, with their largest value; messages are NaN where there are none.
FINITE = {name: LARGEST for name in ("position", "heading", "command", *TABLES)} | {"temperature": sys.float_info.max}
SHOWN = 60


def checked_provenance(facts: dict, source: object) -> dict:
    """Return what a recording says of its origin, if it is complete and of the types that mesa_swarm writes.

    Raises
    ------
    RecordingError
        With the first place at which it is not.
    """
    try:
        _check(facts, PROVENANCE, "")
        if {"map", "rng"} & facts["parameters"].keys():
            raise _FaultError("parameters", "names a map or a seed, which a recording holds itself")
        _check_depth(facts["parameters"])
    except _FaultError as fault:
        raise RecordingError(f"{_end_of(source)} has no provenance that can be used: its {fault}") from None
    return facts


def checked_scenery(scenery: Any) -> dict:
    """Return what a world looks like if a drawing can be made of it.

    Raises
    ------
    RecordingError
        With the first place at which it cannot.

    Examples
    --------
    >>> checked_scenery({"designs": [], "robots": [[1, 2, 0]], "shapes": [], "loads": [], "layers": [], "leave": 9})
    Traceback (most recent call last):
    mesa_swarm.errors.RecordingError: its scenery has robots [1, 2, 0]; expected ascending ids, and one of its designs
    """
    try:
        _check(scenery, SCENERY, "scenery")
        newest = -1
        for first, last, which in scenery["robots"]:
            if not newest < first <= last or which >= len(scenery["designs"]):
                raise RecordingError(
                    f"its scenery has robots {[first, last, which]}; expected ascending ids, and one of its designs"
                )
            newest = last
        if sum(last - first + 1 for first, last, _ in scenery["robots"]) > MOST_ROBOTS:
            raise RecordingError(f"its scenery has more than {MOST_ROBOTS:,} robots")
    except _FaultError as fault:
        raise RecordingError(f"its {fault}") from None
    return scenery


def checked_change(text: bytes) -> Any:
    """Return what a recording tells of what came and went: how many there are now, and what it looks like.

    Raises
    ------
    ValueError
        If it does not tell that.
    """
    return _told(text, CHANGE)


def checked_intervention(text: bytes) -> dict:
    """Return what a recording tells of a change by hand.

    Raises
    ------
    ValueError
        If it does not tell that.
    """
    return _told(text, INTERVENTION)


def read_json(text: bytes) -> Any:
    """Return what a text of JSON says, if it is neither too long nor too deep.

    Raises
    ------
    ValueError
        If it is none.

    Examples
    --------
    >>> read_json(b'{"a": [1]}')
    {'a': [1]}
    """
    lists = 0 if text.startswith(b'"') else text.count(b"[") + text.count(b"{")
    if len(text) > LONGEST_TEXT or lists > MOST_LISTS:
        raise ValueError("a text too long to be believed")
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("a text nested too deeply") from None


def check_columns(schema: pa.Schema, source: object) -> None:
    """Refuse columns that are not of the types in which mesa_swarm records.

    Raises
    ------
    RecordingError
    """
    names = schema.names
    first = {field.name: field.type for field in list(schema)[: len(FIRST_COLUMNS)]}
    if first != FIRST_COLUMNS or len(set(names)) < len(names):
        raise RecordingError(f"{_end_of(source)} has other columns than a recording: {shortened(names)}")
    for field in list(schema)[len(FIRST_COLUMNS) :]:
        if not _is_known(field.name, field.type):
            shown = " ".join(str(field.type).split())
            raise RecordingError(f"{_end_of(source)} has column {shortened(field.name)} of type {shown:.{SHOWN}}")


def checked_rows(batch: pa.RecordBatch, first: int, every: int, source: object) -> Rows:
    """Return the rows of a chunk whose form is what its columns promise.

    Parameters
    ----------
    batch : RecordBatch
    first : int
        The step of the first row.
    every : int
        Steps from one row to the next.
    source : object
        What errors begin with.

    Raises
    ------
    RecordingError
    """
    try:
        batch.validate()
        wrong = _wrong_in(batch, first, every)
        rows = None if wrong else Rows(batch)
    except (pa.ArrowException, ValueError, MemoryError, OverflowError):
        wrong = "lists that do not fit together"
    if wrong or rows is None:
        raise RecordingError(f"{_end_of(source)} has {wrong} in its rows from step {first} on")
    check_values(batch, first, source)
    return rows


def check_values(batch: pa.RecordBatch, first: int, source: object) -> None:
    """Refuse rows from this step on that hold numbers which no reader takes; the writer asks too.

    Raises
    ------
    RecordingError
    """
    for name in FINITE.keys() & set(batch.schema.names):
        if not _all_finite(batch.column(name).values, FINITE[name]):
            raise RecordingError(f"{_end_of(source)} has out-of-range values of {name} from step {first} on")


def longest_gap(every: int) -> int:
    """Return how many steps there are at most from one row to the next: some are missing where steps failed.

    Examples
    --------
    >>> longest_gap(1), longest_gap(10_000), longest_gap(500_000)
    (100, 100000, 500000)
    """
    return max(every, min(MOST_MISSING * every, MOST_UNSEEN))


def misplaced(pieces: Sequence[Piece], start: int, every: int) -> Piece | None:
    """Return the first piece whose seal gives a number of rows or a step that cannot follow those before it.

    Parameters
    ----------
    pieces : sequence of Piece
        In the order of the file, those without rows included.
    start : int
        The step at which the recording began.
    every : int

    Examples
    --------
    >>> misplaced([Piece(0, 0, 0, 0, 0, rows=2, step=10), Piece(0, 0, 0, 0, 0, rows=0, step=20)], 3, every=10)
    >>> misplaced([Piece(0, 0, 0, 0, 0, rows=2, step=10**12)], 3, every=10).step
    1000000000000
    """
    earliest, latest, gap = start, start, longest_gap(every)
    for piece in pieces:
        if not piece.rows:
            if not earliest <= piece.step <= latest + gap:
                return piece
            continue
        if piece.rows > MOST_ROWS or piece.step % every or not earliest < piece.step <= latest + gap:
            return piece
        earliest = piece.step + (piece.rows - 1) * every
        latest = piece.step + (piece.rows - 1) * gap
    return None


def _told(text: bytes, form: Any) -> Any:
    told = read_json(text)
    _check(told, form, "")
    return told


def _wrong_in(batch: pa.RecordBatch, first: int, every: int) -> str:
    """Return in words what of a chunk is wrong, an empty text if nothing is."""
    names = batch.schema.names
    steps, _, robots, *columns = batch.columns
    if any(_has_nulls(column) for name, column in zip(names, batch.columns, strict=True) if name != "state_hash"):
        return "missing values"
    if not _follow(steps.to_numpy(), first, every):
        return "steps that do not follow each other"
    begins = robots.offsets
    for name, column in (("robot", robots), *zip(names[3:], columns, strict=True)):
        if (name == "robot" or name in TABLES) and not _grow(column):
            return f"lists of {name} that do not fit together"
        if name not in TABLES and not column.offsets.equals(begins):
            return f"not as many values of {name} as robots"
    return "" if _ascends(robots) else "unique_ids that do not ascend"


def _follow(steps: np.ndarray, first: int, every: int) -> bool:
    gaps = np.diff(steps)
    return steps[:1].tolist() == [first] and bool(
        ((gaps > 0) & (gaps <= longest_gap(every)) & (gaps % every == 0)).all()
    )


def _grow(lists: pa.ListArray) -> bool:
    """Tell whether lists lie one after the other within their values; others need not be looked at again."""
    offsets = lists.offsets.to_numpy()
    return bool(offsets[0] >= 0 and offsets[-1] <= len(lists.values) and (np.diff(offsets) >= 0).all())


def _ascends(robots: pa.ListArray) -> bool:
    begins, ids = robots.offsets.to_numpy(), robots.values.to_numpy()[: robots.offsets[-1].as_py()]
    grows = np.diff(ids) > 0
    inner = begins[(begins > 0) & (begins < len(ids))]
    grows[inner - 1] = True  # from one row to the next they may begin again
    return bool(grows[begins[0] :].all()) and not (len(ids) and ids[begins[0] :].min(initial=1) < 1)


def _has_nulls(array: pa.Array) -> bool:
    if array.null_count:
        return True
    if pa.types.is_struct(array.type):
        return any(_has_nulls(array.field(place)) for place in range(array.type.num_fields))
    return pa.types.is_nested(array.type) and _has_nulls(array.values)


def _all_finite(values: pa.Array, largest: float) -> bool:
    if pa.types.is_struct(values.type):
        return all(_all_finite(values.field(place), largest) for place in range(values.type.num_fields))
    if pa.types.is_nested(values.type):
        return _all_finite(values.values, largest)
    if not pa.types.is_floating(values.type) or not len(values):
        return True
    numbers = values.to_numpy()
    return float(numbers.min()) >= -largest and float(numbers.max()) <= largest  # NaN is neither


@lru_cache(maxsize=256)  # most recordings that are opened have the same columns
def _is_known(name: str, kind: pa.DataType) -> bool:
    known = _is_table if name in TABLES else _is_column
    return pa.types.is_list(kind) and known(name, kind.value_type)


def _is_column(name: str, kind: pa.DataType) -> bool:
    """Tell whether a robot's values of this type can be in a column of this name; those of layers may be any."""
    widths = []
    while pa.types.is_fixed_size_list(kind):
        widths.append(kind.list_size)
        kind = kind.value_type
    number = pa.types.is_integer(kind) or _is_real(kind) or pa.types.is_boolean(kind)
    if not number or not 0 < math.prod([1, *widths]) <= WIDEST or not all(width > 0 for width in widths):
        return False
    if name not in COLUMNS:
        return True
    shape, dtype, _ = COLUMNS[name]
    fits = len(shape) == len(widths) and all(width in (own, width * isinstance(own, str)) for own, width in
                                             zip(shape, widths, strict=True))  # fmt: skip
    is_kind = {"f": _is_real, "i": pa.types.is_signed_integer, "b": pa.types.is_boolean}[np.dtype(dtype).kind]
    return fits and is_kind(kind)


def _is_table(name: str, kind: pa.DataType) -> bool:
    return kind in TABLE_TYPES[name]


def _table_type(table: str, real: pa.DataType) -> pa.DataType:
    whole = dict.fromkeys(WHOLE, pa.int32()) | {"out": pa.bool_()}
    return pa.struct([(field, whole.get(field, real)) for field in TABLES[table]])


def _is_real(kind: pa.DataType) -> bool:
    return kind in REALS


# ---- forms of JSON: a type; a dict of forms by key, those with a question mark may be missing; a list of one form;
# a tuple of forms, which is a list of as many; a function that judges; or a set of forms, of which one must fit.


class _FaultError(ValueError):
    """What is wrong at a place of a JSON text."""

    def __init__(self, where: str, what: str) -> None:
        super().__init__(f"{where or 'content'} {what}")


def _check(value: Any, form: Any, where: str) -> None:
    """Refuse a value that does not have a form."""
    if isinstance(form, frozenset):
        if not any(_fits(value, one, where) for one in form):
            raise _unexpected(where, value)
    elif isinstance(form, type):
        if type(value) is not form:
            raise _unexpected(where, value)
    elif isinstance(form, _Items | _Each | _Exactly):
        form.check(value, where)
    elif not form(value):
        raise _unexpected(where, value)


def _fits(value: Any, form: Any, where: str) -> bool:
    try:
        _check(value, form, where)
    except _FaultError:
        return False
    return True


def _unexpected(where: str, value: Any) -> _FaultError:
    return _FaultError(where, f"is {shortened(value) if _is_flat(value) else f'a {type(value).__name__}'}")


def _is_flat(value: Any) -> bool:
    return not isinstance(value, (dict, list))


class _Items:
    """The form of a JSON object: of each key its own."""

    def __init__(self, **forms: Any) -> None:
        self.forms = {name.removesuffix("_"): (form, name.endswith("_")) for name, form in forms.items()}

    def check(self, value: Any, where: str) -> None:
        if not isinstance(value, dict):
            raise _unexpected(where, value)
        for name, (form, optional) in self.forms.items():
            place = f"{where}.{name}" if where else name
            if name in value:
                _check(value[name], form, place)
            elif not optional:
                raise _FaultError(place, "is missing")


class _Each:
    """The form of a JSON list, or of the values of an object, that are all alike."""

    def __init__(self, kind: type[list] | type[dict], form: Any, most: int = MOST_LISTS) -> None:
        self.kind, self.form, self.most = kind, form, most

    def check(self, value: Any, where: str) -> None:
        if type(value) is not self.kind or len(value) > self.most:
            raise _unexpected(where, value)
        for one in value.values() if isinstance(value, dict) else value:
            _check(one, self.form, where)


class _Exactly:
    """The form of a JSON list that has one form for each of its items."""

    def __init__(self, *forms: Any) -> None:
        self.forms = forms

    def check(self, value: Any, where: str) -> None:
        if type(value) is not list or len(value) != len(self.forms):
            raise _unexpected(where, value)
        for one, form in zip(value, self.forms, strict=True):
            _check(one, form, where)


def _whole(most: int, least: int = 0) -> Callable[[Any], bool]:
    return lambda value: type(value) is int and least <= value <= most


def _number(value: Any) -> bool:
    return type(value) in (int, float) and -LARGEST <= value <= LARGEST


def _positive(value: Any) -> bool:
    return _number(value) and value > 0


def _not_negative(value: Any) -> bool:
    return _number(value) and value >= 0


def _some_seed(value: Any) -> bool:
    return type(value) is int and 0 <= value < 1 << 4096


def _check_depth(value: Any) -> None:
    """Refuse what is nested so deeply that writing or comparing it might fail."""
    level: Sequence[Any] = [value]
    for _ in range(DEEPEST):
        level = [inner for one in level if not _is_flat(one) for inner in _inside(one)]
    if level:
        raise _FaultError("parameters", f"are nested more than {DEEPEST} deep")


def _inside(value: dict | list) -> Iterable[Any]:
    return value.values() if isinstance(value, dict) else value


def _end_of(source: object) -> str:
    text = str(source)
    return text if len(text) <= SHOWN * 2 else f"...{text[-2 * SHOWN :]}"


REALS = (pa.float32(), pa.float64())
TABLE_TYPES = {name: [_table_type(name, real) for real in REALS] for name in TABLES}
STEP = _whole(MOST_STEPS)
POINT = _Exactly(_number, _number)
RINGS = _Each(list, _Each(list, POINT))
SHAPE = frozenset(
    {
        _Items(disc=_Exactly(_number, _number, _positive), mark_=bool),
        _Items(rings=lambda rings: bool(rings) and _fits(rings, RINGS, ""), mark_=bool),
    }
)
DESIGN = _Items(
    name=str,
    radius=_positive,
    max_speed=_not_negative,
    holonomic=bool,
    sensors=_Each(list, _Exactly(_number, _number, _number, _not_negative, _positive), most=WIDEST),
)
# Indices of designs and layers are bytes where they are drawn.
SCENERY = _Items(
    designs=_Each(list, DESIGN),
    robots=_Each(list, _Exactly(_whole(MOST_IDS), _whole(MOST_IDS), _whole(MOST_IDS))),
    shapes=_Each(list, SHAPE),
    loads=_Each(list, lambda load: _fits(load, SHAPE, "") and _fits(load.get("id"), _whole(MOST_IDS), "")),
    layers=_Each(list, str),
    leave=_number,
    join_=_number,
)
THERE = _Exactly(*[_Exactly(_whole(MOST_IDS), _whole(MOST_IDS))] * 3)
CHANGE = frozenset({THERE, _Items(there=THERE, scenery_=dict)})  # format 1 had nothing but what there is
INTERVENTION = _Items(what=_Each(list, str), why_not=str)
SEED = frozenset(
    {
        _some_seed,
        _Items(entropy=frozenset({_some_seed, _Each(list, _some_seed)}), spawn_key=_Each(list, _some_seed)),
    }
)
PROVENANCE = _Items(
    model=_Items(module=str, name=str),
    parameters=dict,
    takes_map=bool,
    map=str,
    scenery_=lambda scenery: scenery is None or isinstance(scenery, dict),
    seed=SEED,
    versions=_Each(dict, str),
    platform=str,
    rerun=bool,
    every=_whole(MOST_EVERY, 1),
    exact=bool,
    hash_every_=_whole(MOST_STEPS, 1),
    checkpoint_every_=STEP,
    why_no_checkpoint_=str,
    start=_Items(step=STEP, state_hash=str),
)
