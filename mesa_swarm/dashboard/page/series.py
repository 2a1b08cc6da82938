"""The numbers of charts, in bounded memory: of a run after every step, and of a recording under the same names."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from mesa_swarm.base.errors import RecordingError, UnknownNameError, unknown_name
from mesa_swarm.experiments.reports import as_number
from mesa_swarm.model.looks import Chart, looks_of
from mesa_swarm.model.observers import Observer
from mesa_swarm.recording.collected_data import check_collected, join_series, size_of_collected, without_rest
from mesa_swarm.recording.container import Packer
from mesa_swarm.recording.frames import Frame
from mesa_swarm.recording.recording import Recording
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.scene import Scene

# Numbers stored of a run, or of two compared ones, 16 MB; beyond that every second row is dropped.
MOST_NUMBERS = 2_000_000
FIRST_ROWS = 1024
# Rows of a recording after which what was read so far is shown.
SHOWN_ROWS = 2000
NO_LAYER = "no layer"
WITHOUT_REPORTERS = "Reporters of the model are recorded with its complete states, of which this recording has none."

# Numbers of charts at one step by the keys of the charts.
Numbers = Mapping[str, Sequence[float] | np.ndarray]
# Steps and numbers of reporters by name, shapes (m,) and (m,).
Reporters = dict[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, slots=True)
class Plot:
    """Title, unit and curves of one chart."""

    key: str
    title: str
    unit: str  # empty without a known unit
    names: tuple[str, ...]  # of the curves


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Curves for drawing: means over groups of rows, and the least and greatest of each."""

    # The last step of each group, shape (m,); numbers of shape (c, m); rows in a group; the first step of each.
    steps: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    width: int
    first: np.ndarray


class ChartTable(ABC):
    """The numbers of charts, one row a step: of a run that is played, or of a recording; `most_numbers` are stored."""

    # Steps from one stored row to the next.
    row_every = 1
    # In which row a chart last had no number, and why, by key.
    faults: Mapping[str, str] = MappingProxyType({})

    def __init__(self, most_numbers: int) -> None:
        self.most_numbers = most_numbers
        self._lock = threading.Lock()
        self._charts: dict[str, Plot] = {}
        # Of each chart one row a step; as many rows as there are steps, of which `_count` are written.
        self._tables: dict[str, np.ndarray] = {}
        self._steps: np.ndarray = np.empty(0, np.int64)
        self._count = 0

    def __len__(self) -> int:
        """Return the number of stored rows."""
        return self._count

    @property
    @abstractmethod
    def seconds(self) -> float | None:
        """Seconds of a step, None without a scale."""

    def charts(self) -> list[Plot]:
        """Return the charts."""
        return list(self._charts.values())

    def chart(self, key: str) -> Plot:
        """Return one of the charts."""
        if key not in self._charts:
            raise UnknownNameError(unknown_name("chart", key, self._charts))
        return self._charts[key]

    def rows(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Return all stored steps (m,) and numbers (m, c) of one chart."""
        return self.chart_and_rows(key)[1:]

    def chart_and_rows(self, key: str) -> tuple[Plot, np.ndarray, np.ndarray]:
        """Return a chart with all its stored steps (m,) and numbers (m, c): it may get more curves at any time."""
        with self._lock:
            chart = self.chart(key)
            return chart, self._steps[: self._count].copy(), self._tables[chart.key][: self._count].copy()

    def curves(self, key: str, most: int) -> Curves:
        """Return the curves of one chart with at most `most` points each.

        The width of groups is a power of two, so that drawn points stay while rows are added.
        """
        steps, rows = self.rows(key)
        width = 1
        while len(rows) > most * width:
            width *= 2
        return group_rows(steps, rows, width)

    def exact(self, key: str, step: int | None = None) -> tuple[int, np.ndarray] | None:
        """Return step and numbers (c,) of the last stored row that is not after a step, None without one."""
        return row_until(*self.rows(key), step)

    def labels(self) -> dict[str, tuple[str, int]]:
        """Return every curve by a name that is unique, as the key of its chart and its index there."""
        labels: dict[str, tuple[str, int]] = {}
        for chart in self.charts():
            for k, name in enumerate(chart.names):
                label = chart.title if len(chart.names) == 1 else f"{chart.title}: {name}"
                labels[label if label not in labels else f"{label} ({chart.key})"] = chart.key, k
        return labels

    def _arrange(self, charts: Iterable[Plot]) -> None:
        """Make the tables of these charts; curves of known names keep their numbers, others are NaN before now."""
        old, tables = self._charts, self._tables
        self._charts = {chart.key: chart for chart in charts}
        self._tables = {
            key: np.full((len(self._steps), len(chart.names)), np.nan) for key, chart in self._charts.items()
        }
        for key in self._charts.keys() & old.keys():
            for k, name in enumerate(self._charts[key].names):
                if name in old[key].names:
                    self._tables[key][:, k] = tables[key][:, old[key].names.index(name)]

    def _put(self, step: int, numbers: Numbers) -> None:
        """Write the next row; curves without numbers stay NaN there."""
        self._steps[self._count] = step
        for key, values in numbers.items():
            self._tables[key][self._count, : len(values)] = values
        self._count += 1


class Series(ChartTable, Observer):
    """Numbers of a model after every step: its reporters, robots at fires, driving layers.

    Call `follow` with a model before its first step. When the memory is full, every second row is dropped:
    the remaining rows are exact, of the steps that are multiples of `row_every`.
    """

    # Steps in which each robot collided, by `Swarm.number`, which stays when others are removed.
    _collided: np.ndarray

    def __init__(self, most_numbers: int = MOST_NUMBERS) -> None:
        super().__init__(most_numbers)
        self.model: SwarmModel | None = None
        self._form: tuple = ()
        self._forget()

    def follow(self, model: SwarmModel | None) -> None:
        """Clear everything, and measure this model from now on."""
        with self._lock:
            if self.model is not None and self in self.model.observers:
                self.model.observers.remove(self)
            self.model, self._form = model, ()
            self._forget()
            if model is not None:
                self.since = model.completed
                model.observers.append(self)
                self._measure_anew(model)

    def replaced(self, old: SwarmModel, new: SwarmModel, what: list[str]) -> None:
        """Continue with the model that has taken the place of another."""
        self.rebind(new)

    def rebind(self, model: SwarmModel) -> None:
        """Go on with another object of the same run: stored rows stay, as far as they are not of later steps."""
        with self._lock:
            if self.model is not None and self in self.model.observers:
                self.model.observers.remove(self)
            self.model = model
            self._count = int(np.searchsorted(self._steps[: self._count], model.completed, side="right"))
            if self not in model.observers:
                model.observers.append(self)
            self._measure_anew(model)

    def after_step(self, model: SwarmModel, step: int) -> None:
        """Count collisions of each robot, and measure, if a row is due; called by the model."""
        with self._lock:
            self._count_collisions(model)
            if step % self.row_every:
                return
            if self._form != form_of(model):
                self._measure_anew(model)
            if self._count == len(self._steps):
                self._make_room()
            if step % self.row_every == 0:
                numbers, faults = take_numbers(model)
                self._put(step, numbers)
                self.faults = {**self.faults, **{key: f"no number in step {step}: {faults[key]}" for key in faults}}

    @property
    def seconds(self) -> float | None:
        """Seconds of a step, None if the model has no scale."""
        scale = None if self.model is None else self.model.scale
        return None if scale is None else scale.seconds_per_step

    def collisions_of(self, model: SwarmModel, step: int) -> np.ndarray | None:
        """Return in how many steps since `since` each robot collided up to a step, shape (n,); None if not stored.

        Of steps before the present one this is known as long as the model has stored all later ones (`watch`).
        """
        with self._lock:
            number = model.swarm.columns["number"]
            counts = np.zeros(int(number.max(initial=-1)) + 1, np.int64)
            counts[: len(self._collided)] = self._collided[: len(counts)]
        later = model.completed - step
        if later:
            snapshots = model.watched
            if snapshots is None or "collided" not in snapshots.columns or np.sum(snapshots.steps > step) != later:
                return None
            return counts[number] - snapshots["collided"][-later:].sum(axis=0)
        return counts[number]

    def _count_collisions(self, model: SwarmModel) -> None:
        number = model.swarm.columns["number"][model.swarm.columns["collided"]]
        most = int(number.max(initial=-1)) + 1
        if most > len(self._collided):
            more = np.zeros(max(most, 2 * len(self._collided)) - len(self._collided), np.int64)
            self._collided = np.concatenate([self._collided, more])
        self._collided[number] += 1

    def _measure_anew(self, model: SwarmModel) -> None:
        """Make the charts that a model has now."""
        self._form = form_of(model)
        self._arrange(charts_of(model))

    def _forget(self) -> None:
        self.row_every, self._count, self.since, self.faults = 1, 0, 0, {}
        self._collided = np.empty(0, np.int64)
        self._steps = np.empty(0, np.int64)
        self._charts, self._tables = {}, {}

    def _make_room(self) -> None:
        """Add rows as long as there is memory, else drop every second one."""
        most = max(2, self.most_numbers // max(sum(table.shape[1] for table in self._tables.values()), 1))
        if self._count < most:
            more = min(max(2 * self._count, FIRST_ROWS), most) - self._count
            self._steps = np.concatenate([self._steps, np.zeros(more, np.int64)])
            for key, table in self._tables.items():
                self._tables[key] = np.concatenate([table, np.full((more, table.shape[1]), np.nan)])
            return
        self.row_every *= 2
        remaining = np.flatnonzero(self._steps[: self._count] % self.row_every == 0)
        self._count = len(remaining)
        for stored in (self._steps, *self._tables.values()):
            stored[: self._count] = stored[remaining]


def row_until(steps: np.ndarray, rows: np.ndarray, step: int | None) -> tuple[int, np.ndarray] | None:
    """Return step and numbers of the last row that is not after a step, or of the last; None if there is none."""
    row = (len(steps) if step is None else int(np.searchsorted(steps, step, side="right"))) - 1
    return None if row < 0 else (int(steps[row]), rows[row])


def group_rows(steps: np.ndarray, rows: np.ndarray, width: int) -> Curves:
    """Return means, least and greatest numbers of groups of `width` rows, without NaN."""
    if width == 1 or not len(rows):
        return Curves(steps, rows.T, rows.T, rows.T, 1, steps)
    starts = np.arange(0, len(rows), width)
    is_finite = np.isfinite(rows)
    counts = np.add.reduceat(is_finite, starts, axis=0, dtype=float)
    totals = np.add.reduceat(np.where(is_finite, rows, 0.0), starts, axis=0)
    mean = np.divide(totals, counts, out=np.full_like(totals, np.nan), where=counts > 0)
    ends = np.append(starts[1:], len(rows)) - 1
    low, high = np.fmin.reduceat(rows, starts, axis=0), np.fmax.reduceat(rows, starts, axis=0)
    return Curves(steps[ends], mean.T, low.T, high.T, width, steps[starts])


def form_of(model: SwarmModel) -> tuple:
    """Return a key that changes with the columns."""
    collector = model.datacollector
    reporters = tuple(collector.model_vars), tuple(collector.agent_reporters)
    return len(model.fires), id(model.control), reporters, tuple(model.events.names)


def charts_of(model: SwarmModel) -> list[Plot]:
    """Return the charts of a model."""
    charts = [reporter_plot(name) for name in model.datacollector.model_vars]
    for name in model.datacollector.agent_reporters:
        title = f"Mean {name.replace('_', ' ')} of agents"
        charts.append(Plot(f"agents {name}", title, "", (title,)))
    charts += fire_plots(len(model.fires))
    if model.control is not None:
        charts.append(layer_plot(layer_names(model)))
    if model.events:
        charts.append(event_plot(model.events.names))
    return charts + [Plot(own_key(chart), chart.name, chart.unit, chart.curves) for chart in own_charts(model)]


def own_key(chart: Chart) -> str:
    """Return the key of a chart that a model declares."""
    return f"own {chart.name}"


def reporter_plot(name: str) -> Plot:
    """Return the chart of a reporter of the model."""
    titles = {"collisions": ("Collisions in a step", "robots"), "total_collisions": ("Collisions in all", "collisions")}
    title, unit = titles.get(name, (name.replace("_", " ").capitalize(), ""))
    return Plot(name, title, unit, (title,))


def fire_plots(fires: int) -> list[Plot]:
    """Return the charts of fires, which are numbered from 1; no charts without fires."""
    names = tuple(f"fire {number}" for number in range(1, fires + 1))
    robots = Plot("at_fires", "Robots at each fire", "robots", names)
    return [robots, Plot("fire_temperature", "Temperature of each fire", "", names)] if fires else []


def layer_plot(names: Iterable[str]) -> Plot:
    """Return the chart of the layers that drive."""
    return Plot("layers", "Layers that drive", "% of robots", (*names, NO_LAYER))


def event_plot(names: Iterable[str]) -> Plot:
    """Return the chart of events."""
    return Plot("events", "Events so far", "events", tuple(names))


def own_charts(model: SwarmModel) -> tuple[Chart, ...]:
    """Return the charts that a model declares."""
    looks = looks_of(model)
    return looks.charts if looks is not None else ()


def layer_names(model: SwarmModel) -> tuple[str, ...]:
    """Return the names of a model's layers, numbered where names repeat."""
    return number_names(model.control.names if model.control is not None else ())


def number_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names, numbered from 1 where they repeat."""
    return tuple(f"{name} {k + 1}" if names.count(name) > 1 else name for k, name in enumerate(names))


def take_numbers(model: SwarmModel) -> tuple[dict[str, Sequence[float] | np.ndarray], dict[str, str]]:
    """Return the present numbers of a model's charts, NaN for non-numbers, and why charts have none, by their keys."""
    reporters = model.datacollector.model_vars.items()
    numbers: dict[str, Sequence[float] | np.ndarray] = {
        name: [reported_number(values[-1]) if values else np.nan] for name, values in reporters
    }
    numbers |= {f"agents {name}": [mean] for name, mean in agent_means(model).items()}
    if len(model.fires):
        columns = model.fires.columns
        numbers |= {"at_fires": columns["robots"], "fire_temperature": columns["temperature"]}
    if model.control is not None:
        numbers["layers"] = percent_by_layer(model.swarm.columns["layer"], len(model.control.layers))
    if model.events:
        numbers["events"] = list(model.events.counts.values())
    faults: dict[str, str] = {}
    for chart in own_charts(model):
        key = own_key(chart)
        try:
            numbers[key] = chart.numbers(model)
        except Exception as problem:  # a function of a user's may raise anything; the chart has a gap there
            numbers[key], faults[key] = [np.nan] * len(chart.curves), reported(problem)
    return numbers, faults


def percent_by_layer(layer: np.ndarray, layers: int) -> np.ndarray:
    """Return the percentage of robots that each of these layers drives, and last of those that none drives."""
    counts = np.bincount(layer + 1, minlength=layers + 1)
    return 100.0 * np.concatenate((counts[1:], counts[:1])) / max(len(layer), 1)


def agent_means(model: SwarmModel) -> dict[str, float]:
    """Return the mean over all agents of each agent reporter, as collected last; NaN without numbers."""
    collector = model.datacollector
    records = collector._agent_records
    latest = list(records[next(reversed(records))]) if records else []
    means: dict[str, float] = {}
    for place, name in enumerate(collector.agent_reporters, start=2):  # rows begin with the step and the agent's id
        finite = [number for row in latest if np.isfinite(number := reported_number(row[place]))]
        means[name] = float(np.mean(finite)) if finite else np.nan
    return means


def reported_number(value: object) -> float:
    """Return the value of a reporter as a number, NaN for a missing one and for a non-number."""
    number = as_number(value)
    return np.nan if number is None else number


class RecordedSeries(ChartTable):
    """Numbers of the rows of a recording: reporters, robots at fires, layers, collisions, events.

    `read` fills it, in a thread of its own; until then it has fewer rows. Of long recordings only every second row is
    stored, or every fourth and so on. Collisions in all are known where every step from the first was recorded.
    """

    def __init__(self, recording: Recording, scene: Scene, rows: int, most_numbers: int = MOST_NUMBERS) -> None:
        super().__init__(most_numbers)
        self.scene = scene
        facts = recording.provenance
        self._columns = recording.columns
        # Whether each step from the first is there, so that sums are those of the run.
        self.is_whole = facts["every"] == 1 and facts["start"]["step"] == 0
        self.complete = False
        self.note = ""
        self._spacing, self._rows = facts["every"], rows
        # Ids of the robots that collided, row after row, and where each row ends; None if there are too many.
        self._colliding: list[np.ndarray] | None = [] if self.is_whole and "contacts" in recording.columns else None
        self._totals: list[int] = []

    @property
    def seconds(self) -> float | None:
        """Seconds of a step, None without a scale."""
        scale = self.scene.scale
        return None if scale is None else scale.seconds_per_step

    def collisions_until(self, row: int) -> int | None:
        """Return the number of collisions up to a row of the recording, None if it is not known."""
        return self._totals[row] if self.is_whole and row < len(self._totals) else None

    def collisions_of(self, robots: np.ndarray, row: int) -> np.ndarray | None:
        """Return in how many steps each of these robots collided up to a row, None if it is not known."""
        with self._lock:
            if self._colliding is None or row >= len(self._colliding):
                return None
            ids_met = np.concatenate(self._colliding[: row + 1])
        ids, counts = np.unique(ids_met, return_counts=True)
        if not len(ids):
            return np.zeros(len(robots), np.int64)
        place = np.minimum(np.searchsorted(ids, robots), len(ids) - 1)
        return np.where(ids[place] == robots, counts[place], 0)

    def read(self, recording: Recording, frames: Iterable[Frame], show: Callable[[], object] = lambda: None) -> None:
        """Fill it with the frames of all rows; `show` is called now and then, and at the end."""
        reporters = collected_reporters(recording)
        self.note = _note_on(reporters, self._rows and recording[self._rows - 1].step)
        events: dict[str, int] = {}
        for row, frame in enumerate(frames):
            if not row:
                self._begin(frame, reporters)
            self._note_collisions(frame)
            for name in frame.columns["events"]["name"].tolist() if "events" in frame.columns else ():
                events[name] = events.get(name, 0) + 1
            if row % self._stride == 0:
                self._add(frame, events, reporters)
            if row and row % SHOWN_ROWS == 0:
                show()
        self.complete = True
        show()

    def _begin(self, frame: Frame, reporters: Reporters) -> None:
        """Make the charts, with as many rows as there is memory for."""
        names = set(reporters)
        if "contacts" in self._columns or "collided" in self._columns:
            names |= {"collisions", *(["total_collisions"] if self.is_whole else [])}
        first = [name for name in ("collisions", "total_collisions") if name in names]
        charts = [reporter_plot(name) for name in dict.fromkeys((*first, *reporters))]
        if "fires" in self._columns:
            charts += fire_plots(len(frame["fires"]))
        layers = self._layers()
        if "layer" in self._columns and layers:
            charts.append(layer_plot(layers))
        width = sum(len(chart.names) for chart in charts) + 1
        stride = 1
        while -(-self._rows // stride) * width > self.most_numbers:
            stride *= 2
        with self._lock:
            self.row_every, self._stride = self._spacing * stride, stride
            self._steps = np.zeros(-(-self._rows // stride), np.int64)
            self._arrange(charts)

    def _layers(self) -> tuple[str, ...]:
        """Return the names of all layers that there ever were."""
        names = (number_names(tuple(scenery["layers"])) for _, scenery in self.scene.changes)
        return tuple(dict.fromkeys(name for layers in names for name in layers))

    def _note_collisions(self, frame: Frame) -> None:
        robots = find_collided(frame)
        with self._lock:
            if robots is None:
                self._colliding = None
                return
            self._totals.append((self._totals[-1] if self._totals else 0) + len(robots))
            if self._totals[-1] > self.most_numbers:
                self._colliding = None
            if self._colliding is not None:
                self._colliding.append(robots)

    def _measure_frame(self, frame: Frame, events: dict[str, int], reporters: Reporters) -> Numbers:
        """Return the numbers of a row; charts of which it knows none are left out."""
        numbers: dict[str, Sequence[float] | np.ndarray] = {}
        for name, (steps, values) in reporters.items():
            place = int(np.searchsorted(steps, frame.step, side="right")) - 1
            # After the last recorded state nothing is known.
            if place >= 0 and (place < len(steps) - 1 or frame.step == steps[-1]):
                numbers[name] = [values[place]]
        robots = find_collided(frame)
        if robots is not None:
            totals = {"total_collisions": [self._totals[-1]]} if self.is_whole else {}
            numbers |= {"collisions": [len(robots)], **totals}
        if "at_fires" in self._charts and "fires" in frame.columns:
            numbers |= {"at_fires": frame["fires"]["robots"], "fire_temperature": frame["fires"]["temperature"]}
        if "layers" in self._charts:
            numbers["layers"] = self._shares(frame)
        return numbers | ({"events": list(events.values())} if events else {})

    def _add(self, frame: Frame, events: dict[str, int], reporters: Reporters) -> None:
        """Add a row, and the curves of fires and events that are new."""
        with self._lock:
            numbers = self._measure_frame(frame, events, reporters)
            charts = [*fire_plots(len(numbers.get("at_fires", ()))), event_plot(events)]
            widths = {key: len(chart.names) for key, chart in self._charts.items()}
            wider = {chart.key: chart for chart in charts if len(chart.names) > widths.get(chart.key, 0)}
            if wider:
                self._arrange((self._charts | wider).values())
            self._put(frame.step, numbers)

    def _shares(self, frame: Frame) -> np.ndarray:
        """Return the percentage of robots that each layer drives, of all that there ever were; the last of none."""
        names, curves = number_names(tuple(self.scene.world(frame.step)["layers"])), self._charts["layers"].names
        shares = np.zeros(len(curves))
        places = [curves.index(name) for name in (*names, NO_LAYER)]
        layer = np.clip(frame["layer"].astype(np.int64), -1, len(names) - 1)  # a file may contain anything
        shares[places] = percent_by_layer(layer, len(names))
        return shares


def find_collided(frame: Frame) -> np.ndarray | None:
    """Return the ids of the robots that collided in the step of a frame, None if that was not recorded."""
    if "contacts" in frame.columns:  # one row for each robot
        return np.asarray(frame["contacts"]["robot"], np.int64)
    if "collided" in frame.columns:
        return np.asarray(frame.robots[frame["collided"].astype(bool)], np.int64)
    return None


def collected_reporters(recording: Recording) -> Reporters:
    """Return steps and numbers of the model's reporters up to the last recorded state, by name.

    Empty if no complete states were recorded, or if they cannot be read.
    """
    try:
        states, every = [], 1
        for place in range(len(recording.checkpoints)):
            state = recording.checkpoint(place)
            every = int(state.facts.get("collect_every", 1))
            states.append(without_rest(state))
        check_collected(sum(map(size_of_collected, states)), recording.path.stat().st_size)
        series = join_series([(reporters_in(state.facts["collected"]), Packer(state.arrays)) for state in states])
        lines = {path[1]: _with_steps(values, states[-1].step, every) for path, values in series.items()}
    except (RecordingError, LookupError, TypeError, ValueError, OSError, MemoryError):  # a file may contain anything
        return {}
    return {name: line for name, line in lines.items() if line is not None and np.isfinite(line[1]).any()}


def _note_on(reporters: Reporters, last: int) -> str:
    """Return why reporters are missing, or are known up to an earlier step than the last one."""
    if not reporters:
        return WITHOUT_REPORTERS
    last_known = max(int(steps[-1]) for steps, _ in reporters.values())
    end = f"Reporters of the model are recorded with its complete states, up to step {last_known:,}."
    return end if last_known < last and reporters.keys() - {"collisions", "total_collisions"} else ""


def reporters_in(content: list) -> list:
    """Return what was collected of the model's reporters, without that of agents, tables and fires."""
    return [series for series in content if series[0][0] == "model"]


def _with_steps(values: list[Any], last: int, every: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the step of each collected value and the values as numbers, None if their steps are not known."""
    if every < 1 or not 0 < len(values) <= last // every:
        return None
    steps = last // every * every - every * np.arange(len(values))[::-1]
    return steps, np.array([reported_number(value) for value in values])
