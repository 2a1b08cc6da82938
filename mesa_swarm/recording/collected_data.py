"""Collected data and the step counter, stored and restored."""

import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from mesa_swarm.base.errors import RecordingError, UnstoredStateWarning, check_name, shortened
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.mesa_model import add_reporters, set_steps
from mesa_swarm.recording.container import PLACES, Checkpoint, Packer, memory_of

MOST_STEPS = 100_000_000
# Types of which one array holds all values exactly.
UNIFORM = {float: np.float64, bool: np.bool_, np.float64: np.float64, np.int64: np.int64, np.bool_: np.bool_}
# Bytes that Python needs for a value of an array, and for a row, in a list.
OF_VALUE, OF_ROW = 48, 128
# Limit in bytes of all that was collected up to a stored state, or as a multiple of the size of the recording.
MOST_COLLECTED, MOST_PACKED = 100_000_000, 64

Path = tuple[str, ...]


def set_clock(model: EngineModel, steps: int) -> None:
    """Set the number of steps that were counted, without taking them; refuse one that no recording has."""
    if type(steps) is not int or not model.steps <= steps <= MOST_STEPS:
        raise RecordingError(f"invalid number of steps: {steps!r:.40}")
    set_steps(model, steps)


def growing_series(model: EngineModel) -> dict[Path, list]:
    """Return all lists that grow with the steps: those of Mesa's DataCollector, and the history of fires."""
    collector, history = model.datacollector, model.fires.history
    if collector._agenttype_records:
        raise RecordingError("datacollector has records of agent types, which cannot be stored; use agent_reporters")
    series: dict[Path, list] = {("model", name): values for name, values in collector.model_vars.items()}
    for table, columns in collector.tables.items():
        series |= {("table", table, name): values for name, values in columns.items()}
    series["agents",] = list(collector._agent_records.items())
    series["history", "steps"], series["history", "rows"] = history.series
    return series | {("events", name): values for name, values in model.events.series().items()}


def lengths_of(model: EngineModel) -> dict[Path, int]:
    """Return the present length of each series."""
    return {path: len(values) for path, values in growing_series(model).items()}


def reporters_of(model: EngineModel) -> dict[str, Any]:
    """Return the reporters with a state, which have `checkpoint` and `restore`, by name."""
    reporters = {name: getattr(r, "func", r) for name, r in model.datacollector.model_reporters.items()}
    return {name: reporter for name, reporter in reporters.items() if hasattr(reporter, "checkpoint")}


def collected_to_json(model: EngineModel, packer: Packer, since: dict[Path, int]) -> list:
    """Return for each series its path, the length that it had, and the values added since then.

    A series that is shorter than in `since`, from `lengths_of`, was started again.
    """
    content = []
    for path, values in growing_series(model).items():
        begin = since.get(path, 0)
        begin = begin if begin <= len(values) else 0
        pack = _pack_rows if path == ("agents",) else _pack
        content.append([list(path), begin, pack(values[begin:], packer, ".".join(path))])
    return content


def without_rest(checkpoint: Checkpoint) -> Checkpoint:
    """Return a checkpoint reduced to what it collected, which is all that later ones refer to."""
    collected = checkpoint.facts["collected"]
    needed_places, empty = set(_places(_json(collected))), np.empty(0)
    arrays = [array.copy() if place in needed_places else empty for place, array in enumerate(checkpoint.arrays)]
    return replace(checkpoint, facts={"collected": collected}, arrays=arrays)


def size_of_collected(checkpoint: Checkpoint) -> int:
    """Return an upper estimate of the bytes that the collected data of a checkpoint take in a model."""
    text = _json(checkpoint.facts["collected"])
    # As often as they are referred to: each time the values become a list.
    arrays = [checkpoint.arrays[place] for place in _places(text) if place < len(checkpoint.arrays)]
    spread = sum(OF_VALUE * math.prod(max(width, 1) for width in array.shape) for array in arrays)
    return memory_of(text) + spread + sum(OF_ROW * len(array) for array in arrays if array.ndim > 1)


def check_collected(size: int, file: int) -> None:
    """Refuse states with more collected data than a file of this size permits."""
    most = max(MOST_COLLECTED, MOST_PACKED * file)
    if size > most:
        raise RecordingError(
            f"collected data need about {size:,} bytes of memory, more than the {most:,} allowed for a recording of "
            f"{file:,} bytes; collect less, or less often"
        )


def join_series(parts: Sequence[tuple[list, Packer]]) -> dict[Path, list]:
    """Return whole series from the parts in which they were stored, oldest first."""
    whole: dict[Path, list] = {}
    for content, packer in parts:
        before, whole = whole, {}
        for names, begin, values in content:
            path, old = tuple(map(str, names)), before.get(tuple(map(str, names)), [])
            if type(begin) is not int or not 0 <= begin <= len(old):
                raise RecordingError("the earlier checkpoint on which it builds is missing")
            whole[path] = old[:begin] + _unpack(values, packer)
    return whole


def restore_collected(model: EngineModel, series: dict[Path, list]) -> None:
    """Replace the series of a model by these, if it collects the same ones.

    Of a reporter that was added by hand the values are kept, and later ones are missing: it cannot be stored. One that
    the model did not have then has no values in the rows before.
    """
    _match_reporters(model, series)
    mine = growing_series(model)
    events = [path for path in mine if path[0] == "events"]
    series = {**{path: [] for path in events}, **series}  # absent from older checkpoints
    if mine.keys() != series.keys():
        raise RecordingError("the collected series do not match those of the model's constructor")
    collector, history = model.datacollector, model.fires.history
    for path, values in series.items():
        if path[0] in ("model", "table", "history"):
            mine[path][:] = values
    model.events.replace({name: series[path] for path in events for name in path[1:]})
    collector._agent_records.clear()
    collector._agent_records.update(series["agents",])
    steps, rows = history.series
    if len(steps) != len(rows) or not all(
        isinstance(row, np.ndarray) and row.ndim == 2 and len(row) == 2 for row in rows
    ):
        raise RecordingError("invalid history of fires")


def _match_reporters(model: EngineModel, series: dict[Path, list]) -> None:
    """Let a model and the series that are stored of it have the same reporters of the model."""
    mine, others = ({path for path in paths if path[0] == "model"} for paths in (growing_series(model), series))
    by_hand = sorted(check_name("reporter", path[1]) for path in others - mine)
    if by_hand:
        add_reporters(model.datacollector, dict.fromkeys(by_hand, missing_reporter))
        warnings.warn(
            f"{type(model).__name__} was recorded with a reporter that its constructor does not make "
            f"({shortened(by_hand[0])}); its values are missing from here on: add it again",
            UnstoredStateWarning,
            stacklevel=2,
        )
    rows = max((len(series[path]) for path in others), default=0)
    series.update({path: [None] * rows for path in mine - others})


def missing_reporter(model: EngineModel) -> None:
    """Report nothing: in the place of a reporter that could not be stored."""


def _pack(values: list, packer: Packer, what: str) -> object:
    kinds = {type(value) for value in values}
    if len(kinds) == 1:
        (kind,) = kinds
        if kind in UNIFORM:
            return {"of": kind.__module__ + "." + kind.__name__, "array": packer.pack(np.array(values, UNIFORM[kind]))}
        if kind is int and all(abs(value) < 1 << 62 for value in values):
            return {"of": "builtins.int", "array": packer.pack(np.array(values, np.int64))}
        if kind is np.ndarray and len({(value.shape, value.dtype) for value in values}) == 1:
            return {"of": "rows", "array": packer.pack(np.stack(values), what)}
    return packer.pack(list(values), what)


def _pack_rows(values: list, packer: Packer, what: str) -> object:
    """Return the rows collected of agents at each step by columns, which are arrays as a rule."""
    rows = [row for _, rows in values if type(rows) is list for row in rows]
    regular = all(type(pair) is tuple and type(pair[1]) is list for pair in values)
    if not rows or not regular or {type(row) for row in rows} != {tuple} or len({len(row) for row in rows}) != 1:
        return packer.pack(values, what)
    return {
        "of": "agents",
        "steps": _pack([step for step, _ in values], packer, what),
        "counts": packer.pack(np.array([len(rows) for _, rows in values], np.int64)),
        "columns": [_pack(list(column), packer, what) for column in zip(*rows, strict=True)],
    }


def _unpack_rows(content: dict, packer: Packer) -> list:
    steps, columns = _unpack(content["steps"], packer), [_unpack(column, packer) for column in content["columns"]]
    counts = packer.unpack(content["counts"])
    if not isinstance(counts, np.ndarray) or counts.dtype != np.int64 or (counts < 0).any():
        raise RecordingError("invalid data collected of agents")
    rows, ends = list(zip(*columns, strict=True)), accumulate(counts.tolist(), initial=0)
    if counts.sum(dtype=object) != len(rows):
        raise RecordingError("invalid data collected of agents")
    return [(step, rows[begin:end]) for step, (begin, end) in zip(steps, pairwise(ends), strict=True)]


def _json(content: list) -> str:
    return json.dumps(content, separators=(",", ":"))


def _places(text: str) -> list[int]:
    return list(map(int, PLACES.findall(text)))


def _unpack(content: Any, packer: Packer) -> list:
    if isinstance(content, list):
        return packer.unpack(content)
    if content["of"] == "agents":
        return _unpack_rows(content, packer)
    values = packer.unpack(content["array"])
    if not isinstance(values, np.ndarray) or not values.ndim:
        raise RecordingError("a collected series cannot be decoded")
    if content["of"] == "rows":
        return [row.copy() for row in values]
    return values.tolist() if str(content["of"]).startswith("builtins.") else list(values)
