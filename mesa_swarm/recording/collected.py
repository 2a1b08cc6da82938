"""What a model collects over its steps, told by what came since the last checkpoint, and put together again."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mesa_swarm.errors import RecordingError
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.plain import Packed

# What one array holds exactly, and what it is called.
UNIFORM = {float: np.float64, bool: np.bool_, np.float64: np.float64, np.int64: np.int64, np.bool_: np.bool_}

Path = tuple[str, ...]


def series_of(model: ObservedWorld) -> dict[Path, list]:
    """Return all lists that grow with the steps: what Mesa's DataCollector holds, and the history of fires."""
    collector, history = model.datacollector, model.fires.history
    if collector._agenttype_records:
        raise RecordingError("datacollector holds records of agent types, which cannot be stored")
    series: dict[Path, list] = {("model", name): values for name, values in collector.model_vars.items()}
    for table, columns in collector.tables.items():
        series |= {("table", table, name): values for name, values in columns.items()}
    series["agents",] = list(collector._agent_records.items())
    series["history", "steps"], series["history", "rows"] = history._steps, history._rows
    return series


def lengths_of(model: ObservedWorld) -> dict[Path, int]:
    """Return how long each series is now."""
    return {path: len(values) for path, values in series_of(model).items()}


def reporters_of(model: ObservedWorld) -> dict[str, Any]:
    """Return the reporters that remember something, and say so by `checkpoint` and `restore`, by name."""
    found = {name: getattr(r, "func", r) for name, r in model.datacollector.model_reporters.items()}
    return {name: reporter for name, reporter in found.items() if hasattr(reporter, "checkpoint")}


def collected_to_json(model: ObservedWorld, packed: Packed, since: dict[Path, int]) -> list:
    """Return what came since the series had these lengths: for each its path, where it goes on, and the values.

    Parameters
    ----------
    model : ObservedWorld
    packed : Packed
    since : dict
        From `lengths_of`; empty for all there is. A series that is shorter now was begun anew.
    """
    told = []
    for path, values in series_of(model).items():
        begin = since.get(path, 0)
        begin = begin if begin <= len(values) else 0
        told.append([list(path), begin, _pack(values[begin:], packed, ".".join(path))])
    return told


def joined(parts: Sequence[tuple[list, Packed]]) -> dict[Path, list]:
    """Return the series that were told in parts, oldest first.

    Raises
    ------
    RecordingError
        If a part is missing.
    """
    whole: dict[Path, list] = {}
    for told, packed in parts:
        before, whole = whole, {}
        for names, begin, values in told:
            path, old = tuple(map(str, names)), before.get(tuple(map(str, names)), [])
            if type(begin) is not int or not 0 <= begin <= len(old):
                raise RecordingError("an earlier checkpoint, which it goes on from, is missing")
            whole[path] = old[:begin] + _unpack(values, packed)
    return whole


def lay_collected(model: ObservedWorld, series: dict[Path, list]) -> None:
    """Make a model hold these series.

    Raises
    ------
    RecordingError
        If it collects other things.
    """
    mine = series_of(model)
    if mine.keys() != series.keys():
        raise RecordingError("the model collects other things than its constructor says")
    collector, history = model.datacollector, model.fires.history
    for path, values in series.items():
        if path[0] in ("model", "table", "history"):
            mine[path][:] = values
    collector._agent_records.clear()
    collector._agent_records.update(series["agents",])
    if len(history._steps) != len(history._rows) or not all(
        isinstance(row, np.ndarray) and row.ndim == 2 and len(row) == 2 for row in history._rows
    ):
        raise RecordingError("the history of fires is none")


def _pack(values: list, packed: Packed, what: str) -> object:
    kinds = {type(value) for value in values}
    if len(kinds) == 1:
        (kind,) = kinds
        if kind in UNIFORM:
            return {"of": kind.__module__ + "." + kind.__name__, "array": packed.pack(np.array(values, UNIFORM[kind]))}
        if kind is int and all(abs(value) < 1 << 62 for value in values):
            return {"of": "builtins.int", "array": packed.pack(np.array(values, np.int64))}
        if kind is np.ndarray and len({(value.shape, value.dtype) for value in values}) == 1:
            return {"of": "rows", "array": packed.pack(np.stack(values), what)}
    return packed.pack(list(values), what)


def _unpack(told: Any, packed: Packed) -> list:
    if isinstance(told, list):
        return packed.unpack(told)
    values = packed.unpack(told["array"])
    if not isinstance(values, np.ndarray) or not values.ndim:
        raise RecordingError("a collected series is none")
    if told["of"] == "rows":
        return [row.copy() for row in values]
    return values.tolist() if str(told["of"]).startswith("builtins.") else list(values)
