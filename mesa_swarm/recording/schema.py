"""The content that a recording must have: provenance, columns, rows and other pieces, checked before they are used.

A matching checksum proves that a file was not damaged, not that mesa_swarm wrote it. The content of a recording is
therefore checked here once, when it is opened, and its rows where they are decoded.
"""

import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from types import FunctionType
from typing import Any

import numpy as np
import pyarrow as pa

from mesa_swarm.base.errors import RecordingError, shortened
from mesa_swarm.base.files import show_path
from mesa_swarm.model.looks import COLOUR, MOST_COLOURS
from mesa_swarm.recording.frames import Rows
from mesa_swarm.recording.layout import FIRST_COLUMNS, PIXELS, TABLES, is_table, table_type
from mesa_swarm.recording.sealed_stream import CHANGE, INTERVENTION, Piece
from mesa_swarm.robots.swarm import COLUMNS
from mesa_swarm.world.fields import MOST_CELLS

# Of the metadata of a recording. A JSON text takes up to twenty times as much memory once it is read.
LONGEST_TEXT = 1 << 25
MOST_LISTS = 2_000_000
DEEPEST = 50
MOST_EVERY = 1_000_000
# Between two rows, where steps failed: missing rows, and steps in all.
MOST_MISSING = 100
MOST_UNSEEN = 100_000
MOST_STEPS = 10**15
MOST_IDS = 2**31 - 1
MOST_ROBOTS = 10_000_000
LARGEST = 1e12
# Of a chunk; mesa_swarm writes at most 256.
MOST_ROWS = 100_000
# Values of one robot in one column.
WIDEST = 100_000
# Columns that are never NaN or infinite, with their largest value; absent messages are NaN.
FINITE = dict.fromkeys(("position", "heading", "command", *TABLES), LARGEST)
FINITE |= dict.fromkeys(("temperature", "fields", "events"), sys.float_info.max)
SHOWN = 60
# Raises an error if a value at a place of a JSON text does not have the form.
Check = Callable[[Any, str], None]


def checked_provenance(facts: dict, source: str | os.PathLike[str]) -> dict:
    """Return the provenance of a recording if it is complete and of the types that mesa_swarm writes."""
    try:
        _check(facts, PROVENANCE, "")
        if {"map", "rng"} & facts["parameters"].keys():
            raise _FaultError("parameters", "contains a map or a seed, which a recording stores separately")
        _check_depth(facts["parameters"])
    except _FaultError as fault:
        raise RecordingError(f"{show_path(source)} has invalid provenance: {fault}") from None
    return facts


def checked_scenery(scenery: Any) -> dict:
    """Return a scenery if it can be drawn."""
    try:
        _check(scenery, SCENERY, "scenery")
        newest = -1
        for first, last, which in scenery["robots"]:
            if not newest < first <= last or which >= len(scenery["designs"]):
                raise RecordingError(
                    f"scenery has robots {[first, last, which]}; expected ascending ids, and one of "
                    f"{len(scenery['designs'])} designs"
                )
            newest = last
        if sum(last - first + 1 for first, last, _ in scenery["robots"]) > MOST_ROBOTS:
            raise RecordingError(f"scenery has more than {MOST_ROBOTS:,} robots")
    except _FaultError as fault:
        raise RecordingError(str(fault)) from None
    return scenery


def checked_content(name: str, content: bytes) -> Any:
    """Return the JSON of a piece, a `CHANGE` of the population or an `INTERVENTION`; a ValueError if it is neither."""
    value = read_json(content)
    _check(value, CONTENTS[name], "")
    return value


def read_json(text: bytes) -> Any:
    """Return the value of a JSON text; a ValueError if it is too long or nested too deeply."""
    lists = 0 if text.startswith(b'"') else text.count(b"[") + text.count(b"{")
    if len(text) > LONGEST_TEXT or lists > MOST_LISTS:
        raise ValueError("JSON text is too long")
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("JSON text is nested too deeply") from None


def check_recorded_columns(schema: pa.Schema, source: str | os.PathLike[str]) -> None:
    """Refuse columns that are not of the types in which mesa_swarm records."""
    names = schema.names
    first = {field.name: field.type for field in list(schema)[: len(FIRST_COLUMNS)]}
    if first != FIRST_COLUMNS or len(set(names)) < len(names):
        raise RecordingError(
            f"{show_path(source)} has columns {shortened(names)}; expected {', '.join(FIRST_COLUMNS)} first, no repeats"
        )
    for field in list(schema)[len(FIRST_COLUMNS) :]:
        if not _is_known(field.name, field.type):
            words = " ".join(str(field.type).split())
            raise RecordingError(
                f"{show_path(source)} has invalid column {shortened(field.name)}: type {words:.{SHOWN}}"
            )


def checked_rows(batch: pa.RecordBatch, first: int, every: int, source: str | os.PathLike[str]) -> Rows:
    """Return the rows of a chunk, from step `first` on, if they match the schema and each other.

    There is a row after `every` steps, except where steps failed; errors begin with `source`.
    """
    try:
        batch.validate()
        wrong = _wrong_in(batch, first, every)
        rows = None if wrong else Rows(batch)
    except (pa.ArrowException, ValueError, MemoryError, OverflowError):
        wrong = "inconsistent lists"
    if wrong or rows is None:
        raise RecordingError(f"{show_path(source)} has {wrong} in its rows from step {first} on")
    check_values(batch, first, source)
    return rows


def check_values(batch: pa.RecordBatch, first: int, source: str | os.PathLike[str]) -> None:
    """Refuse rows from this step on with out-of-range values; the writer checks them too."""
    for name in batch.schema.names:
        largest = FINITE.get("fields" if name.startswith(PIXELS) else name)
        if largest is not None and not _all_finite(batch.column(name).values, largest):
            raise RecordingError(f"{show_path(source)} has out-of-range values of {name} from step {first} on")


def longest_gap(every: int) -> int:
    """Return the largest number of steps from one row to the next: rows are missing where steps failed."""
    return max(every, min(MOST_MISSING * every, MOST_UNSEEN))


def find_misplaced(pieces: Sequence[Piece], start: int, every: int) -> Piece | None:
    """Return the first piece whose seal has a number of rows or a step that cannot follow those before it.

    The pieces, those without rows included, are in the order of the file; the recording began at step `start`.
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


def _wrong_in(batch: pa.RecordBatch, first: int, every: int) -> str:
    """Return what is wrong with a chunk, an empty text if nothing is."""
    names = batch.schema.names
    steps, _, robots, *columns = batch.columns
    if any(_has_nulls(column) for name, column in zip(names, batch.columns, strict=True) if name != "state_hash"):
        return "missing values"
    if not _follow(steps.to_numpy(), first, every):
        return "steps out of order"
    begins = robots.offsets
    for name, column in (("robot", robots), *zip(names[3:], columns, strict=True)):
        if (name == "robot" or is_table(name)) and not _grow(column):
            return f"inconsistent lists of {name}"
        if not is_table(name) and not column.offsets.equals(begins):
            return f"a number of values of {name} other than that of robots"
    return "" if _ascends(robots) else "unique_ids that do not ascend"


def _follow(steps: np.ndarray, first: int, every: int) -> bool:
    gaps = np.diff(steps)
    return steps[:1].tolist() == [first] and bool(
        ((gaps > 0) & (gaps <= longest_gap(every)) & (gaps % every == 0)).all()
    )


def _grow(lists: pa.ListArray) -> bool:
    """Return whether lists follow each other within their values."""
    offsets = lists.offsets.to_numpy()
    return bool(offsets[0] >= 0 and offsets[-1] <= len(lists.values) and (np.diff(offsets) >= 0).all())


def _ascends(robots: pa.ListArray) -> bool:
    begins, ids = robots.offsets.to_numpy(), robots.values.to_numpy()[: robots.offsets[-1].as_py()]
    grows = np.diff(ids) > 0
    inner = begins[(begins > 0) & (begins < len(ids))]
    grows[inner - 1] = True  # each row starts again
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
    if not pa.types.is_list(kind):
        return False
    if name.startswith(PIXELS):
        return _is_picture(kind.value_type)
    return kind.value_type in TABLE_TYPES[name] if name in TABLES else _is_column(name, kind.value_type)


def _is_picture(kind: pa.DataType) -> bool:
    """Return whether a column may hold rows of pixels of this type: a picture, or exact values."""
    is_row = pa.types.is_fixed_size_list(kind) and 0 < kind.list_size <= MOST_CELLS
    return is_row and kind.value_type in (pa.uint8(), pa.float64())


def _is_column(name: str, kind: pa.DataType) -> bool:
    """Return whether a column of this name may have this type; columns of layers may have any."""
    widths = []
    while pa.types.is_fixed_size_list(kind):
        widths.append(kind.list_size)
        kind = kind.value_type
    number = pa.types.is_integer(kind) or kind in REALS or pa.types.is_boolean(kind)
    if not number or not 0 < math.prod([1, *widths]) <= WIDEST or not all(width > 0 for width in widths):
        return False
    if name not in COLUMNS:
        return True
    shape, dtype, _ = COLUMNS[name]
    fits = [isinstance(size, str) or size == width for size, width in zip(shape, widths, strict=False)]
    is_kind = {"f": REALS.__contains__, "i": pa.types.is_signed_integer, "b": pa.types.is_boolean}
    return len(shape) == len(widths) and all(fits) and is_kind[np.dtype(dtype).kind](kind)


class _FaultError(ValueError):
    """An invalid field of a JSON value."""

    def __init__(self, where: str, what: str) -> None:
        super().__init__(f"{where or 'content'} {what}")


def _check(value: Any, form: Any, where: str) -> None:
    """Refuse a value that has not the form.

    A form is a function that raises, a type, a text, a list of alternatives, a tuple with a form for each item of a
    list, or a dict with one for each key of an object; a key with a trailing underscore is optional.
    """
    if isinstance(form, FunctionType):
        form(value, where)
    elif isinstance(form, dict):
        _check_items(value, form, where)
    elif isinstance(form, tuple):
        if type(value) is not list or len(value) != len(form):
            raise _unexpected(where, value)
        for item, item_form in zip(value, form, strict=True):
            _check(item, item_form, where)
    elif isinstance(form, list):
        if not any(_fits(value, choice, where) for choice in form):
            raise _unexpected(where, value)
    elif type(value) is not form and not (isinstance(form, str) and value == form):
        raise _unexpected(where, value)


def _check_items(value: Any, forms: dict[str, Any], where: str) -> None:
    if not isinstance(value, dict):
        raise _unexpected(where, value)
    for key, form in forms.items():
        name = key.removesuffix("_")
        place = f"{where}.{name}" if where else name
        if name in value:
            _check(value[name], form, place)
        elif name == key:
            raise _FaultError(place, "is missing")


def _fits(value: Any, form: Any, where: str) -> bool:
    try:
        _check(value, form, where)
    except _FaultError:
        return False
    return True


def _unexpected(where: str, value: Any) -> _FaultError:
    kind = type(value)
    return _FaultError(where, f"is a {kind.__name__}" if kind in (dict, list) else f"is {shortened(value)}")


def _form_of_each(kind: type[list] | type[dict], form: Any, *, least: int = 0, most: int = MOST_LISTS) -> Check:
    """Return the form of a JSON list, or of an object, whose values have one form."""

    def check(value: Any, where: str) -> None:
        if type(value) is not kind or not least <= len(value) <= most:
            raise _unexpected(where, value)
        for item in _inside(value):
            _check(item, form, where)

    return check


def _number(least: float, most: float = LARGEST, kinds: tuple[type, ...] = (int, float)) -> Check:
    """Return the form of a number within inclusive limits."""

    def check(value: Any, where: str) -> None:
        if type(value) not in kinds or not least <= value <= most:
            raise _unexpected(where, value)

    return check


def _whole(most: int, least: int = 0) -> Check:
    return _number(least, most, (int,))


def _colour(value: Any, where: str) -> None:
    """Refuse what is not a colour: pictures and pages are drawn with it."""
    if not isinstance(value, str) or not COLOUR.fullmatch(value):
        raise _unexpected(where, value)


def _check_depth(value: Any) -> None:
    """Refuse values nested so deeply that writing or comparing them might fail."""
    level: Sequence[Any] = [value]
    for _ in range(DEEPEST):
        level = [inner for item in level for inner in _inside(item)]
    if level:
        raise _FaultError("parameters", f"are nested more than {DEEPEST} deep")


def _inside(value: Any) -> Iterable[Any]:
    """Return the values of a list or object, none of any other value."""
    return value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


REALS = (pa.float32(), pa.float64())
TABLE_TYPES = {name: [table_type(name, real) for real in REALS] for name in TABLES}
NUMBER, NOT_NEGATIVE, POSITIVE = _number(-LARGEST), _number(0), _number(math.ulp(0.0))
STEP, ID = _whole(MOST_STEPS), _whole(MOST_IDS)
RINGS = _form_of_each(list, _form_of_each(list, (NUMBER, NUMBER)), least=1)


def _shape(**more: Any) -> list:
    more |= {"mark_": bool, "kind_": str, "temperature_": _number(0, 1)}
    return [{"disc": (NUMBER, NUMBER, POSITIVE), **more}, {"rings": RINGS, **more}]


DESIGN = {
    "name": str,
    "radius": POSITIVE,
    "max_speed": NOT_NEGATIVE,
    "holonomic": bool,
    "sensors": _form_of_each(list, (NUMBER, NUMBER, NUMBER, NOT_NEGATIVE, POSITIVE), most=WIDEST),
}
LOOKS = {
    "kinds_": _form_of_each(dict, (_colour, _colour)),
    "column_": {
        "name": str,
        "label": str,
        "low": NUMBER,
        "high": NUMBER,
        "colours": _form_of_each(list, (_colour, _colour), most=MOST_COLOURS),
    },
    "label_": str,
}
SCENERY = {
    "designs": _form_of_each(list, DESIGN),
    "robots": _form_of_each(list, (ID, ID, ID)),
    "shapes": _form_of_each(list, _shape()),
    "loads": _form_of_each(list, _shape(id=ID)),
    "kinds_": _form_of_each(list, str),
    "layers": _form_of_each(list, str),
    "leave": NUMBER,
    "join_": NUMBER,
    "looks_": LOOKS,
    "scale_": (_number(1e-9, 1e9), _number(1e-9, 1e9)),
    "parts_": _form_of_each(list, (str, [_colour, ""]), most=WIDEST),
}
POPULATION = ((ID, ID),) * 3
CONTENTS = {
    CHANGE: [POPULATION, {"there": POPULATION, "scenery_": dict}],  # in format 1 the population alone
    INTERVENTION: {"what": _form_of_each(list, str), "why_not": str},
}
ENTROPY = _whole((1 << 4096) - 1)
SEED = [ENTROPY, {"entropy": [ENTROPY, _form_of_each(list, ENTROPY)], "spawn_key": _form_of_each(list, ENTROPY)}]
PROVENANCE = {
    "engine_bits_": _whole(MOST_STEPS, 1),
    "model": {"module": str, "name": str},
    "parameters": dict,
    "takes_map": bool,
    "map": str,
    "scenery_": [dict, type(None)],
    "seed": SEED,
    "versions": _form_of_each(dict, str),
    "platform": str,
    "rerun": bool,
    "every": _whole(MOST_EVERY, 1),
    "exact": bool,
    "hash_every_": _whole(MOST_STEPS, 1),
    "checkpoint_every_": STEP,
    "why_no_checkpoint_": str,
    "start": {"step": STEP, "state_hash": str, "events_": STEP},
}
