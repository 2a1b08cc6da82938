"""Frames: what a step looks like, in a recording or in a model; tables of frames, and the events that they show."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
import pandas as pd
import pyarrow as pa

from mesa_swarm.analysis.clusters import clusters
from mesa_swarm.base.errors import UnknownNameError, unknown_name
from mesa_swarm.control.layer import Senses, centroids
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.looks import looks_of
from mesa_swarm.recording.layout import (
    PIXELS,
    READINGS,
    TABLES,
    discs_of,
    field_type,
    is_table,
    pictures_of,
    robot_columns,
)
from mesa_swarm.world.fields import levels_of, values_of_levels
from mesa_swarm.world.statics import FIRE, KINDS, LOAD

# Fewest robots that collide in one step of a burst, and the most steps without such a step within it.
BURST_ROBOTS = 5
BURST_GAP = 10
# Steps between searches for groups, length of a link in map units, and fewest robots: a group that flickers at its edge
# makes no event.
MERGE_EVERY = 10
MERGE_LINK = 30.0
MERGE_ROBOTS = 3
# Robots that the text of an event or a verdict names.
MOST_NAMED = 3
AXES = {"position": ("x", "y"), "command": ("command_left", "command_right")}
# What pictures show of a step.
PICTURED = ("position", "heading", "command", "hot", "fires", "loads", "fields", "shown")
TABLE_TYPES = {
    table: np.dtype([(field, field_type(field, np.float64)) for field in fields]) for table, fields in TABLES.items()
}
NO_ROWS = {table: np.empty(0, kind) for table, kind in TABLE_TYPES.items()}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False, repr=False)
class Frame:
    """What a step looks like; ``frame["position"]`` is a column, ``frame["fires"]["x"]`` one of a table.

    Parameters
    ----------
    step : int
    state_hash : str or None
        The model's fingerprint; recordings have one in about every hundredth row.
    robots : int32 ndarray, shape (n,)
        unique_id of each robot, in the order of all columns.
    columns : dict of ndarray
        Columns of shape (n, ...); tables as structured arrays. In them `fire` and what robots met are unique_ids; the
        robots' own column `fire` is the index of a row of fires, -1 for none. Of each field the table `fields` has a
        row, numbered from 0, and a column such as `fields.trail` its picture or values, see `field_values`.
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


def frame_of(model: EngineModel, columns: Sequence[str] = PICTURED, *, perceived: bool = False) -> Frame:
    """Return the frame of a model as it is now; it does not change with the model.

    Columns are those of the swarm and of added parts, and "fires", "contacts", "loads", "fields", "shown". If readings
    are among them, the sensors are read for the current poses. `perceived` adds a column of that name, shape (n, 2):
    where on the map each robot perceives the centroid of the robots that it sees, nan where it sees none.
    """
    if perceived or not READINGS.isdisjoint(columns):
        model.sense()
    sources = robot_columns(model)
    values: dict[str, np.ndarray] = {}
    for name in columns:
        if name == "fields":
            values |= _live_fields(model)
        elif name == "shown":
            values |= {name: _live_discs(model)} if model.parts.added() else {}
        elif name in LIVE_TABLES:
            values[name] = LIVE_TABLES[name](model)
        elif name in sources:
            values[name] = sources[name].copy()
        else:
            raise UnknownNameError(unknown_name("column", name, (*sources, *TABLES)))
    if perceived:
        values["perceived"] = _locate_perceived(model)
    looks = looks_of(model)
    if looks is not None:
        values |= looks.columns_of(model)
    robots = model.swarm.unique_ids.astype(np.int32)
    return Frame(step=model.completed, state_hash=None, robots=robots, columns=values)


def _live_fires(model: EngineModel) -> np.ndarray:
    fires = model.fires
    table = np.empty(len(fires), TABLE_TYPES["fires"])
    table["fire"] = [fire.unique_id for fire in fires.agents]
    table["x"], table["y"] = fires.position.T
    for name in ("radius", "temperature", "robots", "out"):
        table[name] = fires.columns[name]
    return table


def _live_contacts(model: EngineModel) -> np.ndarray:
    if not model.swarm.collided.any():
        return NO_ROWS["contacts"]
    contacts = model.contacts
    table = np.empty(len(contacts.robot), TABLE_TYPES["contacts"])
    for name in ("robot", "kind", "other", "depth"):
        table[name] = getattr(contacts, name)
    table["normal_x"], table["normal_y"] = contacts.normal.T
    return table


def _live_fields(model: EngineModel) -> dict[str, np.ndarray]:
    """Return the table of fields and their pictures, nothing without fields."""
    fields = pictures_of(model)
    if not fields:
        return {}
    rows = [(place, field.peak, field.total) for place, field in enumerate(fields.values())]
    pictures = {PIXELS + name: field.levels() for name, field in fields.items()}
    return {"fields": np.array(rows, TABLE_TYPES["fields"]), **pictures}


def _live_discs(model: EngineModel) -> np.ndarray:
    table = discs_of(model)
    rows = np.empty(len(table), TABLE_TYPES["shown"])
    for place, field in enumerate(TABLES["shown"]):
        rows[field] = table[:, place]
    return rows


def field_names(columns: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the fields that are among columns, in their order."""
    return tuple(name.removeprefix(PIXELS) for name in columns if name.startswith(PIXELS))


def field_levels(frame: Frame, name: str) -> np.ndarray:
    """Return the picture of a field in a frame, uint8 (rows, columns), row 0 at the bottom, see `levels_of`."""
    pixels = frame[PIXELS + name]
    if pixels.dtype == np.uint8 or not pixels.size:
        return pixels.astype(np.uint8, copy=False)
    return levels_of(pixels, _peak(frame, name) or pixels.max())


def field_values(frame: Frame, name: str) -> np.ndarray:
    """Return the values of a field in a frame, shape (rows, columns), row 0 at the bottom.

    They are exact if they were recorded so. Else they are known to within 0.4 % of the largest value so far, the
    smaller ones better, and of a field of more than 120,000 cells they are means of blocks of cells.
    """
    pixels = frame[PIXELS + name]
    return values_of_levels(pixels, _peak(frame, name)) if pixels.dtype == np.uint8 else pixels


def field_peaks(frame: Frame, names: Sequence[str]) -> list[float]:
    """Return the largest value so far of each field of these names, 0 where it is not known."""
    return [_peak(frame, name) if PIXELS + name in frame.columns else 0.0 for name in names]


def _peak(frame: Frame, name: str) -> float:
    place = field_names(frame.columns).index(name)
    peaks = frame.columns.get("fields", NO_ROWS["fields"])["peak"]
    return float(peaks[place]) if place < len(peaks) else 0.0


def _live_events(model: EngineModel) -> np.ndarray:
    """Return the events of the last step."""
    log = model.events
    return np.array(log.rows(int(np.searchsorted(log.step, model.steps))), TABLE_TYPES["events"])


LIVE_TABLES: Mapping[str, Callable[[EngineModel], np.ndarray]] = {
    "fires": _live_fires,
    "contacts": _live_contacts,
    "loads": lambda model: np.array([(load.unique_id, *load.pose) for load in model.displaced], TABLE_TYPES["loads"]),
    "events": _live_events,
}


def _locate_perceived(model: EngineModel) -> np.ndarray:
    centroid, counts = centroids(Senses.of(model.swarm))
    cosine, sine = np.cos(model.swarm.heading), np.sin(model.swarm.heading)
    x, y = centroid.T
    place = model.swarm.position + np.column_stack([cosine * x - sine * y, sine * x + cosine * y])
    return np.where(counts[:, None] > 0, place, np.nan)


class Rows:
    """The rows of a chunk as arrays; frames are slices of them."""

    def __init__(self, batch: pa.RecordBatch) -> None:
        steps, hashes, robots, *columns = batch.columns
        self._steps, self._hashes = steps.to_numpy().tolist(), hashes.to_pylist()
        pairs = list(zip(batch.schema.names[3:], columns, strict=True))
        # A robot has the same index in all columns: one slice serves them all.
        self._begins, self._robots = robots.offsets.to_numpy().tolist(), _lock_values(robots)
        self._columns = {name: _lock_values(column) for name, column in pairs}
        self._tables = [(n, self._columns[n], c.offsets.to_numpy().tolist()) for n, c in pairs if is_table(n)]
        self._of_robots = [(name, values) for name, values in self._columns.items() if not is_table(name)]

    def __len__(self) -> int:
        return len(self._steps)

    def __iter__(self) -> Iterator[Frame]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, row: int) -> Frame:
        rows = slice(self._begins[row], self._begins[row + 1])
        columns = {name: values[rows] for name, values in self._of_robots}
        for name, values, begins in self._tables:
            columns[name] = values[begins[row] : begins[row + 1]]
        return Frame(step=self._steps[row], state_hash=self._hashes[row], robots=self._robots[rows], columns=columns)


def _lock_values(column: pa.ListArray) -> np.ndarray:
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
    if pa.types.is_string(values.type):
        return np.array(values.to_pylist(), TABLE_TYPES["events"]["name"])
    return values.to_numpy(zero_copy_only=False)  # of numbers a read-only view


def table_of(frames: Iterable[Frame], table: str, kinds: Mapping[int, str] | None = None) -> pd.DataFrame:
    """Return the rows of frames as a table for people, see `Recording.to_pandas`.

    `kinds` has the kind of each load by unique_id, where it is not the usual one.

    Robots and loads have their unique_id. Fires are numbered 1, 2, ... as in pictures: in the column `fire` of fires
    and of robots (there -1 for no fire), and as what robots met in contacts, if fires were recorded as well.
    """
    parts = [_robot_table(frame) if table == "robots" else _table(frame, table, kinds or {}) for frame in frames]
    names = parts[0].keys() if parts else ("step",)
    return pd.DataFrame({name: np.concatenate([part[name] for part in parts] or [np.empty(0)]) for name in names})


def _robot_table(frame: Frame) -> dict[str, np.ndarray]:
    flat = {"step": np.full(len(frame.robots), frame.step), "robot": frame.robots}
    for name, column in frame.columns.items():
        if is_table(name):
            continue
        values = np.where(column >= 0, column + 1, column) if name == "fire" else column
        width = int(np.prod(values.shape[1:]))
        parts = [values] if values.ndim == 1 else values.reshape(len(values), width).T
        axes = AXES.get(name, ())
        names = [name] if values.ndim == 1 else axes if len(axes) == width else [f"{name}_{i}" for i in range(width)]
        flat |= dict(zip(names, parts, strict=True))
    return flat


def _table(frame: Frame, name: str, kinds: Mapping[int, str]) -> dict[str, np.ndarray]:
    rows = frame[name]
    columns = {"step": np.full(len(rows), frame.step), **{field: rows[field] for field in rows.dtype.names or ()}}
    if name == "loads":
        columns["kind"] = np.array([kinds.get(load, KINDS[LOAD]) for load in rows["load"].tolist()], object)
    elif name == "fields":
        names = field_names(frame.columns)
        columns["name"] = np.array([names[place] if place < len(names) else "" for place in rows["field"]], object)
    elif name == "fires":
        columns["fire"] = np.arange(1, len(rows) + 1, dtype=rows["fire"].dtype)
    elif name == "contacts" and "fires" in frame.columns:
        numbers = {fire: number for number, fire in enumerate(frame["fires"]["fire"].tolist(), start=1)}
        other = [
            numbers.get(other, other) if kind == FIRE else other
            for kind, other in zip(rows["kind"].tolist(), rows["other"].tolist(), strict=True)
        ]
        columns["other"] = np.array(other, rows["other"].dtype)
    return columns


@dataclass(frozen=True, kw_only=True, slots=True)
class Event:
    """Something that happened.

    Parameters
    ----------
    step : int
        Its first step.
    kind : str
        "fire out", "collision burst" or "merge", or the name of events of the model's own (`SwarmModel.event`).
    ids : tuple of int
        unique_ids: of the fire, of the robots that collided, of those of the merged group or of the model's own events.
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

    The frames, in the order of steps, are iterated over up to four times.
    """
    finders = {"fires": _fires_out, "contacts": _bursts, "position": _merges, "events": _list_noted}
    events: list[Event] = []
    for column, find_events in finders.items():
        events += find_events(_with_column(frames, column))
    return sorted(events, key=lambda event: (event.step, event.kind, event.ids))


def _with_column(frames: Iterable, column: str) -> Iterator[Frame]:
    """Iterate over frames that have a column: all, or none."""
    return takewhile(lambda frame: column in frame.columns, frames)


def _list_noted(frames: Iterable) -> Iterator[Event]:
    """Iterate over the events of the model's own; those of one step and name are one."""
    for frame in frames:
        together: dict[tuple[int, str], list[tuple[int, float]]] = {}
        for step, name, unique_id, value in frame["events"].tolist():
            together.setdefault((step, name), []).append((unique_id, value))
        for (step, name), pairs in together.items():
            ids = tuple(dict.fromkeys(unique_id for unique_id, _ in pairs if unique_id >= 0))
            yield Event(step=step, kind=name, ids=ids, text=_describe_noted(name, ids, [value for _, value in pairs]))


def _describe_noted(name: str, ids: Sequence[int], values: Sequence[float]) -> str:
    times = f" {len(values)} times" if len(values) > 1 else ""
    value = f"value {sum(values):g}" if set(values) != {1.0} else ""
    return ": ".join(filter(None, (name + times, ", ".join(filter(None, (name_robots(ids), value))))))


def name_robots(ids: Sequence[int]) -> str:
    """Return a few robots by their unique_ids as text, an empty text for none."""
    more = f" and {len(ids) - MOST_NAMED} more" if len(ids) > MOST_NAMED else ""
    return f"robot{'s' if len(ids) > 1 else ''} {', '.join(map(str, ids[:MOST_NAMED]))}{more}" if ids else ""


def _fires_out(frames: Iterable) -> Iterator[Event]:
    burning: set[int] = set()
    for frame in frames:
        fires = frame["fires"]
        gone_out = burning & set(fires["fire"][fires["out"]].tolist())
        for number, fire in enumerate(fires["fire"].tolist(), start=1):
            if fire in gone_out:
                yield Event(step=frame.step, kind="fire out", ids=(fire,), text=f"fire {number} is out")
        burning = set(fires["fire"][~fires["out"]].tolist())


def _bursts(frames: Iterable) -> Iterator[Event]:
    burst: list[tuple[int, frozenset[int]]] = []
    for frame in frames:
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
    next_step = -np.inf
    for frame in frames:
        if frame.step < next_step:
            continue
        next_step = frame.step + MERGE_EVERY
        label = clusters(frame["position"].astype(float), MERGE_LINK, fewest=MERGE_ROBOTS).label
        now = dict(zip(frame.robots.tolist(), label.tolist(), strict=True))
        for group in range(int(label.max(initial=-1)) + 1):
            members = sorted(robot for robot, label in now.items() if label == group)
            parts = {before[robot] for robot in members if before.get(robot, -1) >= 0}
            if len(parts) > 1:
                text = f"{len(parts)} groups have become one of {len(members)} robots"
                yield Event(step=frame.step, kind="merge", ids=tuple(members), text=text)
        before = now
