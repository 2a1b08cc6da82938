"""Recordings taken apart and written again with right checksums, after one change."""

import copy
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from mesa_swarm.recording.container import PLACES, Checkpoint, from_bytes, to_bytes
from mesa_swarm.recording.sealed_stream import CHECKPOINT, SealedReader, SealedWriter

MISSING = object()
# What stands in the place of each value of a text of JSON; 10**400 and what follows is JSON that Python reads.
EXTREMES = (
    MISSING, None, True, False, -1, 0, 1, 10**6, 10**12, 2**63, 10**400, -0.5, 1e308, float("nan"), float("inf"), "",
    "/etc/passwd", "os:system", "x" * 100_000, "a\nb", [], {}, [[]], [None], {"x": 1}, [1, 2, 3], [0] * 1000, "deep",
)  # fmt: skip


def deep(depth: int = 400) -> list:
    """Return a list in a list in a list."""
    value: list = []
    for _ in range(depth):
        value = [value]
    return value


@dataclass(frozen=True)
class Item:
    """One piece of a recording: rows, or the bytes that it carries; `rows` is the number in its seal."""

    step: int
    batch: pa.RecordBatch | None = None
    name: str = ""
    content: bytes = b""
    rows: int | None = None


@dataclass(frozen=True)
class Parts:
    """All that a recording is made of."""

    facts: dict[str, Any]
    schema: pa.Schema
    items: tuple[Item, ...]

    def with_item(self, place: int, **changes: Any) -> "Parts":
        """Return the same with one item changed."""
        items = list(self.items)
        items[place] = replace(items[place], **changes)
        return replace(self, items=tuple(items))


def taken_apart(path: Path) -> Parts:
    """Return the parts of a whole recording."""
    reader = SealedReader(path)
    facts = {name.decode(): json.loads(text) for name, text in reader.schema.metadata.items()}
    items = [
        Item(piece.step, batch=reader.batch(piece))
        if piece.rows
        else Item(piece.step, name=reader.name(piece), content=reader.content(piece))
        for piece in sorted((*reader.pieces, *reader.attached))
    ]
    return Parts(facts, reader.schema.remove_metadata(), tuple(items))


def put_together(parts: Parts, path: Path, ended: bool = True) -> Path:
    """Write a recording, each piece with the seal that fits it."""
    facts = {name: json.dumps(value) for name, value in parts.facts.items()}
    path.unlink(missing_ok=True)
    writer = SealedWriter(path, parts.schema.with_metadata(facts), overwrite=True)
    for item in parts.items:
        if item.batch is None:
            writer.attach(item.name, item.content, item.step)
        else:
            rows = item.batch.num_rows if item.rows is None else item.rows
            writer._append(writer._message(item.batch), rows, item.step)
    writer.close() if ended else writer.abandon()
    return path


def places(value: Any, longest: int = 3) -> list[tuple]:
    """Return the paths of all values in a JSON value; of long lists the first ones only."""
    inner: list = []
    if isinstance(value, dict):
        inner = list(value.items())
    elif isinstance(value, list):
        inner = list(enumerate(value[:longest]))
    return [(), *[(key, *rest) for key, one in inner for rest in places(one, longest)]]


def changed(value: Any, path: tuple, new: Any) -> Any:
    """Return a JSON value with another one at a path."""
    if not path:
        return deep() if isinstance(new, str) and new == "deep" else {} if new is MISSING else new
    value = copy.deepcopy(value)
    inner = value
    for key in path[:-1]:
        inner = inner[key]
    if new is MISSING:
        del inner[path[-1]]
    else:
        inner[path[-1]] = deep() if isinstance(new, str) and new == "deep" else new
    return value


# ---- changes at random: each takes parts and a generator, and returns other parts and a description


def forged(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Return parts with one change, and its description."""
    kinds = [of_facts, of_facts, of_scenery, of_column, of_values, of_lists, of_seals, of_order, of_carried, of_state,
             of_state, of_arrays]  # fmt: skip
    return kinds[rng.integers(len(kinds))](parts, rng)


def of_facts(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Change a value of the provenance, or give it a parameter that no recording has."""
    if rng.random() < 0.1:
        name = ("map", "rng", "model_reporters", "self", "policy", "x")[rng.integers(6)]
        value = _extreme(rng)
        more = parts.facts["parameters"] | ({name: value} if value is not MISSING else {})
        return replace(parts, facts=parts.facts | {"parameters": more}), f"parameters.{name} is {value!r:.40}"
    facts = {name: value for name, value in parts.facts.items() if name != "scenery"}
    return _of_json(parts, facts, {"scenery": parts.facts.get("scenery")}, rng)


def of_scenery(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Change a value of the scenery."""
    others = {name: value for name, value in parts.facts.items() if name != "scenery"}
    return _of_json(parts, {"scenery": parts.facts["scenery"]}, others, rng)


def of_column(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Drop a column, give it another name or type."""
    place = int(rng.integers(len(parts.schema)))
    field = parts.schema.field(place)
    kinds = [None, "twice", pa.int8(), pa.string(), pa.float64(), pa.list_(pa.string()), pa.list_(pa.float64()),
             pa.list_(pa.list_(pa.float32(), 2**30)), pa.list_(pa.list_(pa.float32(), 1)), pa.large_list(pa.int32()),
             pa.list_(pa.list_(pa.int32())), pa.list_(pa.struct([("x", pa.float32())])), pa.null(), pa.list_(pa.null()),
             pa.map_(pa.string(), pa.int32()), pa.timestamp("s"), pa.list_(pa.int64())]  # fmt: skip
    kind = kinds[rng.integers(len(kinds))]
    fields = list(parts.schema)
    if kind is None:
        del fields[place]
    elif isinstance(kind, str):
        fields[place] = pa.field(parts.schema.names[int(rng.integers(len(fields)))], field.type)
    else:
        fields[place] = pa.field(field.name, kind)
    schema = pa.schema(fields)
    return _rewritten(parts, schema, place, kind), f"column {field.name} is {kind}"


def of_values(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Put an extreme number or a missing value into a column of one chunk."""
    place, batch = _some_rows(parts, rng)
    column = int(rng.integers(len(batch.columns)))
    number = (np.nan, np.inf, -np.inf, 1e30, -1e30, -1, 0, 127, 2**31 - 1, -(2**31), 10**12, -(2**63), 2**62, None)[
        rng.integers(14)
    ]
    rows = batch.column(column).to_pylist()
    whole = rng.random() < 0.3
    rows = [_spoilt(row, number, whole, rng) for row in rows]
    try:
        values = pa.array(rows, batch.schema.field(column).type)
    except (pa.ArrowException, OverflowError, TypeError, ValueError):
        return of_values(parts, rng)
    return _with_column(parts, place, column, values), f"{number} in {batch.schema.names[column]}"


def of_lists(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Give the lists of a column offsets that do not fit."""
    place, batch = _some_rows(parts, rng)
    column = int(rng.integers(2, len(batch.columns)))
    lists = batch.column(column)
    offsets = lists.offsets.to_numpy().astype(np.int64)
    which = int(rng.integers(len(offsets)))
    offsets[which] += (-1, 1, -(10**6), 10**6, 2**30, -(2**30), 2**31 - 1 - int(offsets[which]))[rng.integers(7)]
    wrong = np.clip(offsets, -(2**31), 2**31 - 1).astype(np.int32)
    buffers = [None, pa.py_buffer(wrong.tobytes())]
    try:
        values = pa.Array.from_buffers(lists.type, len(lists), buffers, children=[lists.values])
    except pa.ArrowException:
        return of_lists(parts, rng)
    return _with_column(parts, place, column, values), f"offsets of {batch.schema.names[column]}"


def of_seals(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Give a seal another number of rows or another step."""
    place = int(rng.integers(len(parts.items)))
    number = (-5, -1, 0, 1, 2, 5, 100, 10**6, 10**12, 10**17)[rng.integers(10)]
    item = parts.items[place]
    if item.batch is not None and rng.random() < 0.5:
        return parts.with_item(place, rows=max(number, 1)), f"{number} rows in a seal"
    if item.batch is not None and rng.random() < 0.5:  # also in the rows, which then fit
        steps = pa.array(item.batch.column(0).to_numpy() - item.step + number)
        parts = _with_column(parts, place, 0, steps)
    return parts.with_item(place, step=number), f"step {number} in a seal"


def of_order(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Leave a piece out, take it twice, or exchange two."""
    items = list(parts.items)
    one, other = rng.integers(len(items), size=2)
    what = ("left out", "twice", "exchanged")[rng.integers(3)]
    if what == "left out":
        del items[one]
    elif what == "twice":
        items.insert(other, items[one])
    else:
        items[one], items[other] = items[other], items[one]
    return replace(parts, items=tuple(items)), f"piece {one} {what}, {other}"


def of_carried(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Change what a piece without rows carries."""
    carried = [place for place, item in enumerate(parts.items) if item.name]
    if not carried:
        return of_seals(parts, rng)
    place = int(rng.choice(carried))
    item = parts.items[place]
    if item.name == "checkpoint" or rng.random() < 0.2:
        contents = (b"", b"\0" * 1000, item.content[:-1], item.content[:40], item.content + b"\0", b"[" * 10**5)
        return parts.with_item(place, content=contents[rng.integers(6)]), f"bytes of a {item.name}"
    value = json.loads(item.content)
    path, new = _some_change(value, rng)
    content = json.dumps(changed(value, path, new)).encode()
    return parts.with_item(place, content=content), f"{item.name}.{_in_words(path)} is {new!r:.40}"


def of_state(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Change a value of a stored state."""
    place, state = _some_state(parts, rng)
    if state is None:
        return of_facts(parts, rng)
    whole = {"facts": state.facts, "step": state.step, "state_hash": state.state_hash}
    path, new = _some_change(whole, rng)
    other = changed(whole, path, new)
    facts = other.get("facts") if isinstance(other, dict) else None
    state = replace(state, facts=facts) if isinstance(facts, dict) else replace(state, facts={})
    if isinstance(other, dict):
        state = replace(state, step=other.get("step"), state_hash=other.get("state_hash"))
    return parts.with_item(place, content=to_bytes(state)), f"state.{_in_words(path)} is {new!r:.40}"


def of_arrays(parts: Parts, rng: np.random.Generator) -> tuple[Parts, str]:
    """Change an array of a stored state: numbers, type or shape."""
    place, state = _some_state(parts, rng)
    if state is None or not state.arrays:
        return of_values(parts, rng)
    which = int(rng.integers(len(state.arrays)))
    arrays, array = list(state.arrays), np.array(state.arrays[which])
    what = int(rng.integers(5))
    if what == 0 and array.size:
        array.reshape(-1)[rng.integers(array.size)] = (-1, 0, 1, 100, 127)[rng.integers(5)]
    elif what == 1 and array.size and array.dtype.kind in "fc":
        array.reshape(-1)[rng.integers(array.size)] = (np.nan, np.inf, 1e300, -1e300)[rng.integers(4)]
    elif what == 2:
        array = array.astype(("f4", "i8", "S3", "U2", "c16", "b1", "M8[s]", "u1")[rng.integers(8)])
    elif what == 3:
        array = (array[:0], array[None], array.reshape(-1), np.zeros(10**6), np.zeros((1,) * 30))[rng.integers(5)]
    elif array.size and array.dtype.kind in "iu":
        array.reshape(-1)[rng.integers(array.size)] = np.iinfo(array.dtype).max
    arrays[which] = array
    return parts.with_item(place, content=to_bytes(replace(state, arrays=arrays))), f"array {which} of a state"


# ---- small parts


def _extreme(rng: np.random.Generator) -> Any:
    return EXTREMES[rng.integers(len(EXTREMES))]


def _some_change(value: Any, rng: np.random.Generator) -> tuple[tuple, Any]:
    found = places(value)
    return found[rng.integers(len(found))], _extreme(rng)


def _in_words(path: tuple) -> str:
    return ".".join(map(str, path))


def _of_json(parts: Parts, facts: dict, others: dict, rng: np.random.Generator) -> tuple[Parts, str]:
    path, new = _some_change(facts, rng)
    other = changed(facts, path, new)
    whole = {**others, **other} if isinstance(other, dict) else others
    return replace(parts, facts=whole), f"{_in_words(path)} is {new!r:.40}"


def _some_rows(parts: Parts, rng: np.random.Generator) -> tuple[int, pa.RecordBatch]:
    place = int(rng.choice([place for place, item in enumerate(parts.items) if item.batch is not None]))
    batch = parts.items[place].batch
    assert batch is not None
    return place, batch


def _some_state(parts: Parts, rng: np.random.Generator) -> tuple[int, Any]:
    found = [place for place, item in enumerate(parts.items) if item.name == "checkpoint"]
    if not found:
        return 0, None
    place = int(rng.choice(found))
    return place, from_bytes(parts.items[place].content)


def _with_column(parts: Parts, place: int, column: int, values: pa.Array) -> Parts:
    batch = parts.items[place].batch
    assert batch is not None
    arrays = list(batch.columns)
    arrays[column] = values
    return parts.with_item(place, batch=pa.RecordBatch.from_arrays(arrays, schema=batch.schema))


def _rewritten(parts: Parts, schema: pa.Schema, place: int, kind: Any) -> Parts:
    """Return the same with other columns: one left out, called otherwise, or empty lists of another type."""
    items = []
    for item in parts.items:
        if item.batch is not None:
            arrays = list(item.batch.columns)
            if kind is None:
                del arrays[place]
            elif not isinstance(kind, str):
                arrays[place] = _like(arrays[place], kind)
            items.append(replace(item, batch=pa.RecordBatch.from_arrays(arrays, schema=schema)))
        else:
            items.append(item)
    return replace(parts, schema=schema, items=tuple(items))


def _like(array: pa.Array, kind: pa.DataType) -> pa.Array:
    try:
        return pa.array(array.to_pylist(), kind)
    except (pa.ArrowException, OverflowError, TypeError, ValueError):
        empty = [[]] * len(array) if pa.types.is_list(kind) or pa.types.is_map(kind) else [None] * len(array)
        return pa.array(empty, kind)


def _spoilt(row: Any, number: Any, whole: bool, rng: np.random.Generator) -> Any:
    """Return a row of a column with the number in place of one value, or of all."""
    if isinstance(row, list):
        if not row:
            return row
        which = range(len(row)) if whole else [int(rng.integers(len(row)))]
        return [_spoilt(one, number, whole, rng) if place in which else one for place, one in enumerate(row)]
    if isinstance(row, dict):
        name = list(row)[int(rng.integers(len(row)))]
        return row | {name: number}
    return number


# ---- one change of a stored state, of which the run had another

# How a run was observed is not compared; and numbers of arrays and names of types encode what is.
OBSERVED = {"collect_every", "reporters", "history"}
ENCODING = {"of", "array", "number"}
READINGS = {f"{begin}{name}" for name in ("distance", "kind", "radiation", "line") for begin in ("", "body.")}


def place_of(parts, step):
    return next(k for k, item in enumerate(parts.items) if item.name == CHECKPOINT and item.step == step)


def with_state(parts, content, step):
    return parts.with_item(place_of(parts, step), content=content)


def leaves(value, path=()):
    """Yield the paths to all numbers, texts and truth values in JSON that are part of a state."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        if key not in ENCODING and not (not path and key in OBSERVED):
            yield from leaves(inner, (*path, key))
    if not isinstance(value, (dict, list)) and value is not None:
        yield path


def changed_leaf(value, path, change):
    if not path:
        return change(value)
    copied = dict(value) if isinstance(value, dict) else list(value)
    copied[path[0]] = changed_leaf(copied[path[0]], path[1:], change)
    return copied


def another(value):
    """Return another value of the same kind."""
    if isinstance(value, bool) or value is None:
        return not value
    return value + 1 if isinstance(value, (int, float)) else f"{value}x"


def forged_json(checkpoint, place):
    """Return a state with one value of its facts changed, and the path to it."""
    paths = list(leaves(checkpoint.facts))
    path = paths[place % len(paths)]
    return replace_state(checkpoint, facts=changed_leaf(checkpoint.facts, path, another)), path


def forged_array(checkpoint, place):
    """Return a state with one number of one of its arrays changed."""
    sizes = [array.size for array in checkpoint.arrays]
    place %= sum(sizes)
    which = int(np.searchsorted(np.cumsum(sizes), place, side="right"))
    arrays = [array.copy() for array in checkpoint.arrays]
    flat = arrays[which].reshape(-1)
    at = place - sum(sizes[:which])
    flat[at] = not flat[at] if flat.dtype == bool else flat[at] + 1
    if flat.dtype.kind == "f" and np.isnan(flat[at]):
        flat[at] = 0.0
    return replace_state(checkpoint, arrays=arrays), (which, at)


def replace_state(checkpoint, **changes):
    given = {name: getattr(checkpoint, name) for name in ("step", "state_hash", "facts", "arrays")}
    return Checkpoint(**{**given, **changes})


def compared_arrays(checkpoint, custom_sensors=()):
    """Return the numbers of the arrays that are part of a state, and are not read anew by sensors."""
    readings = {*READINGS, *custom_sensors}
    facts = {name: content for name, content in checkpoint.facts.items() if name not in OBSERVED}
    robots = facts["parts"]["robots"]
    columns = {name: column for name, column in robots["columns"].items() if name not in readings}
    parts = {**facts["parts"], "robots": {**robots, "columns": columns}}
    return set(map(int, PLACES.findall(json.dumps({**facts, "parts": parts}, separators=(",", ":")))))
