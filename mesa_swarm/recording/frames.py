"""Frames, the rows of a recording, and the events that they show."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
import pyarrow as pa

from mesa_swarm.analysis.clusters import clusters
from mesa_swarm.errors import UnknownNameError, unknown_name
from mesa_swarm.recording.layout import TABLES

# Fewest robots that collide in one step of a burst, and the most steps without such a step within it.
BURST_ROBOTS = 5
BURST_GAP = 10
# Steps between searches for groups, length of a link in map units, and fewest robots: a group that flickers at its edge
# makes no event.
MERGE_EVERY = 10
MERGE_LINK = 30.0
MERGE_ROBOTS = 3
AXES = {"position": ("x", "y"), "command": ("command_left", "command_right")}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False, repr=False)
class Frame:
    """The record of one step; ``frame["position"]`` is a column, ``frame["fires"]["x"]`` one of a table.

    Parameters
    ----------
    step : int
    state_hash : str or None
        Present at about every hundredth step.
    robots : int32 ndarray, shape (n,)
        unique_id of each robot, in the order of all columns.
    columns : dict of ndarray
        Columns of shape (n, ...); tables as structured arrays.
    """

    step: int
    state_hash: str | None
    robots: np.ndarray
    columns: dict[str, np.ndarray]

    def __repr__(self) -> str:
        return f"<Frame of step {self.step}, {len(self.robots)} robots: {', '.join(self.columns)}>"

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.columns:
            raise UnknownNameError(unknown_name("recorded column", name, self.columns))
        return self.columns[name]


class Rows:
    """The rows of a chunk as arrays; frames are slices of them.

    Parameters
    ----------
    batch : RecordBatch
    """

    def __init__(self, batch: pa.RecordBatch) -> None:
        steps, hashes, robots, *columns = batch.columns
        self._steps, self._hashes = steps.to_numpy().tolist(), hashes.to_pylist()
        named = list(zip(batch.schema.names[3:], columns, strict=True))
        # A robot has the same index in all columns: one slice serves them all.
        self._begins, self._robots = robots.offsets.to_numpy().tolist(), _locked(robots)
        self._columns = {name: _locked(column) for name, column in named}
        self._tables = [(n, self._columns[n], c.offsets.to_numpy().tolist()) for n, c in named if n in TABLES]
        self._of_robots = [(name, values) for name, values in self._columns.items() if name not in TABLES]

    def __len__(self) -> int:
        return len(self._steps)

    def __iter__(self) -> Iterator[Frame]:
        return map(self._frame, range(len(self._steps)))

    def __getitem__(self, row: int) -> Frame:
        if row >= len(self):
            raise IndexError(row)
        return self._frame(row)

    def _frame(self, row: int) -> Frame:
        own = slice(self._begins[row], self._begins[row + 1])
        columns = {name: values[own] for name, values in self._of_robots}
        for name, values, begins in self._tables:
            columns[name] = values[begins[row] : begins[row + 1]]
        return Frame(step=self._steps[row], state_hash=self._hashes[row], robots=self._robots[own], columns=columns)


def _locked(column: pa.ListArray) -> np.ndarray:
    """Return all values of a list column, which frames share, as a read-only array."""
    values = _array(column.values)
    values.flags.writeable = False
    return values


def _array(values: pa.Array) -> np.ndarray:
    """Return Arrow values as NumPy arrays: lists of fixed length as further axes, structs as structured arrays."""
    if pa.types.is_fixed_size_list(values.type):
        inner = _array(values.values)
        return inner.reshape(len(values), values.type.list_size, *inner.shape[1:])
    if pa.types.is_struct(values.type):
        parts = {field.name: _array(values.field(i)) for i, field in enumerate(values.type)}
        table = np.empty(len(values), [(name, part.dtype) for name, part in parts.items()])
        for name, part in parts.items():
            table[name] = part
        return table
    return values.to_numpy(zero_copy_only=False)  # of numbers a read-only view


def table_of(frames: Iterable[Frame], table: str) -> pd.DataFrame:
    """Return the rows of frames as a table, see `Recording.to_pandas`.

    Parameters
    ----------
    frames : iterable of Frame
    table : str
        "robots", "fires", "contacts" or "loads".
    """
    parts = [_robot_table(frame) if table == "robots" else _table(frame, table) for frame in frames]
    names = parts[0].keys() if parts else ("step",)
    return pd.DataFrame({name: np.concatenate([part[name] for part in parts] or [np.empty(0)]) for name in names})


def _robot_table(frame: Frame) -> dict[str, np.ndarray]:
    flat = {"step": np.full(len(frame.robots), frame.step), "robot": frame.robots}
    for name, values in frame.columns.items():
        if name in TABLES:
            continue
        width = int(np.prod(values.shape[1:]))
        parts = [values] if values.ndim == 1 else values.reshape(len(values), width).T
        names = [name] if values.ndim == 1 else AXES.get(name) or [f"{name}_{i}" for i in range(width)]
        flat |= dict(zip(names, parts, strict=True))
    return flat


def _table(frame: Frame, name: str) -> dict[str, np.ndarray]:
    rows = frame[name]
    return {"step": np.full(len(rows), frame.step), **{field: rows[field] for field in rows.dtype.names or ()}}


@dataclass(frozen=True, kw_only=True, slots=True)
class Event:
    """Something that happened.

    Parameters
    ----------
    step : int
        Its first step.
    kind : str
        "fire out", "collision burst" or "merge".
    ids : tuple of int
        unique_ids: of the fire, of the robots that collided, of the robots of the merged group.
    text : str
        A description. Fires are numbered from 1, as in charts and pictures.
    """

    step: int
    kind: str
    ids: tuple[int, ...]
    text: str

    def __str__(self) -> str:
        return f"step {self.step}: {self.text}"


def events_of(frames: Iterable) -> list[Event]:
    """Return the events of frames, oldest first; a table or column that was not recorded has no events.

    Parameters
    ----------
    frames : iterable of Frame
        In the order of steps; iterated over up to three times.
    """
    found = [*_fires_out(frames), *_bursts(frames), *_merges(frames)]
    return sorted(found, key=lambda event: (event.step, event.kind, event.ids))


def _fires_out(frames: Iterable) -> Iterator[Event]:
    burning: set[int] = set()
    for frame in frames:
        if "fires" not in frame.columns:
            return
        fires = frame["fires"]
        gone_out = burning & set(fires["fire"][fires["out"]].tolist())
        for number, fire in enumerate(fires["fire"].tolist(), start=1):
            if fire in gone_out:
                yield Event(step=frame.step, kind="fire out", ids=(fire,), text=f"fire {number} is out")
        burning = set(fires["fire"][~fires["out"]].tolist())


def _bursts(frames: Iterable) -> Iterator[Event]:
    burst: list[tuple[int, frozenset[int]]] = []
    for frame in frames:
        if "contacts" not in frame.columns:
            return
        if burst and frame.step - burst[-1][0] > BURST_GAP:
            yield _burst(burst)
            burst = []
        if len(frame["contacts"]) >= BURST_ROBOTS:
            burst.append((frame.step, frozenset(frame["contacts"]["robot"].tolist())))
    if burst:
        yield _burst(burst)


def _burst(burst: list[tuple[int, frozenset[int]]]) -> Event:
    first, last, most = burst[0][0], burst[-1][0], max(len(robots) for _, robots in burst)
    robots = tuple(sorted(frozenset().union(*(robots for _, robots in burst))))
    text = f"up to {most} robots collide at once until step {last}"
    return Event(step=first, kind="collision burst", ids=robots, text=text)


def _merges(frames: Iterable) -> Iterator[Event]:
    before: dict[int, int] = {}
    due = -np.inf
    for frame in frames:
        if "position" not in frame.columns:
            return
        if frame.step < due:
            continue
        due = frame.step + MERGE_EVERY
        label = clusters(frame["position"].astype(float), MERGE_LINK, fewest=MERGE_ROBOTS).label
        now = dict(zip(frame.robots.tolist(), label.tolist(), strict=True))
        for group in range(int(label.max(initial=-1)) + 1):
            members = sorted(robot for robot, its in now.items() if its == group)
            parts = {before[robot] for robot in members if before.get(robot, -1) >= 0}
            if len(parts) > 1:
                text = f"{len(parts)} groups have become one of {len(members)} robots"
                yield Event(step=frame.step, kind="merge", ids=tuple(members), text=text)
        before = now
