"""Measurements of a run while it is played: numbers after every step, in bounded memory."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mesa_swarm.base.errors import UnknownNameError, unknown_name
from mesa_swarm.experiments.reports import as_number
from mesa_swarm.model.looks import Chart, looks_of
from mesa_swarm.model.observers import Observer
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.error_lines import reported

# Numbers stored of a run, or of two compared ones, 16 MB; beyond that every second row is dropped.
MOST_NUMBERS = 2_000_000
FIRST_ROWS = 1024
NO_LAYER = "no layer"


@dataclass(frozen=True, slots=True)
class Plot:
    """Title, unit and curves of one chart."""

    key: str
    title: str
    unit: str  # empty without a known unit
    names: tuple[str, ...]  # of the curves
    first: int = 0  # the column of the first curve


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
    every = 1
    # In which row a chart last had no number, and why, by key.
    faults: Mapping[str, str] = MappingProxyType({})

    def __init__(self, most_numbers: int) -> None:
        self.most_numbers = most_numbers
        self._lock = threading.Lock()
        self._charts: dict[str, Plot] = {}
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

    @abstractmethod
    def rows(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Return all stored steps (m,) and numbers (m, c) of one chart."""

    def chart(self, key: str) -> Plot:
        """Return one of the charts."""
        charts = {chart.key: chart for chart in self.charts()}
        if key not in charts:
            raise UnknownNameError(unknown_name("chart", key, charts))
        return charts[key]

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


class Series(ChartTable, Observer):
    """Numbers of a model after every step: its reporters, robots at fires, driving layers.

    Call `follow` with a model before its first step. When the memory is full, every second row is dropped:
    the remaining rows are exact, of the steps that are multiples of `every`.
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
                self._arrange(model)

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
            self._arrange(model)

    def after_step(self, model: SwarmModel, step: int) -> None:
        """Count collisions of each robot, and measure, if a row is due; called by the model."""
        with self._lock:
            self._count_collisions(model)
            if step % self.every:
                return
            if self._form != form_of(model):
                self._arrange(model)
            if self._count == len(self._steps):
                self._make_room()
            if step % self.every == 0:
                self._steps[self._count] = step
                faults = measure(model, self._table[self._count])
                self.faults = {**self.faults, **{key: f"no number in step {step}: {faults[key]}" for key in faults}}
                self._count += 1

    @property
    def seconds(self) -> float | None:
        """Seconds of a step, None if the model has no scale."""
        scale = None if self.model is None else self.model.scale
        return None if scale is None else scale.seconds_per_step

    def rows(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Return all stored steps (m,) and numbers (m, c) of one chart."""
        with self._lock:
            chart = self.chart(key)
            columns = slice(chart.first, chart.first + len(chart.names))
            return self._steps[: self._count].copy(), self._table[: self._count, columns].copy()

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

    def _forget(self) -> None:
        self.every, self._count, self.since, self.faults = 1, 0, 0, {}
        self._collided = np.empty(0, np.int64)
        self._steps = np.empty(0, np.int64)
        self._table = np.empty((0, 0))

    def _arrange(self, model: SwarmModel) -> None:
        """Make the columns of all measurements; new ones are NaN before now."""
        old, table = self._charts, self._table
        self._form = form_of(model)
        self._charts = {chart.key: chart for chart in number_columns(charts_of(model))}
        width = sum(len(chart.names) for chart in self._charts.values())
        self._table = np.full((len(self._steps), width), np.nan)
        if not self._count:
            return
        for key, chart in self._charts.items():
            for k, name in enumerate(chart.names):
                if key in old and name in old[key].names:
                    self._table[:, chart.first + k] = table[:, old[key].first + old[key].names.index(name)]

    def _make_room(self) -> None:
        most = max(2, self.most_numbers // max(self._table.shape[1], 1))
        if self._count < most:
            rows = min(max(2 * self._count, FIRST_ROWS), most)
            self._steps = np.concatenate([self._steps, np.zeros(rows - self._count, np.int64)])
            more = np.full((rows - self._count, self._table.shape[1]), np.nan)
            self._table = np.concatenate([self._table, more])
            return
        self.every *= 2
        remaining = np.flatnonzero(self._steps[: self._count] % self.every == 0)
        self._steps[: len(remaining)], self._table[: len(remaining)] = self._steps[remaining], self._table[remaining]
        self._count = len(remaining)


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
    reporters = len(collector.model_vars), len(collector.agent_reporters)
    return len(model.fires), id(model.control), reporters, len(model.events.names)


def number_columns(charts: Iterable[Plot]) -> list[Plot]:
    """Return charts with consecutive columns."""
    plots: list[Plot] = []
    first = 0
    for chart in charts:
        plots.append(replace(chart, first=first))
        first += len(chart.names)
    return plots


def charts_of(model: SwarmModel) -> list[Plot]:
    """Return the charts of a model, in the order in which `measure` writes them."""
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


def measure(model: SwarmModel, row: np.ndarray) -> dict[str, str]:
    """Write the present measurements of a model, NaN for non-numbers; return why charts have none, by their keys."""
    column = 0
    for values in model.datacollector.model_vars.values():
        row[column] = reported_number(values[-1]) if values else np.nan
        column += 1
    means = agent_means(model)
    row[column : column + len(means)] = means
    column += len(means)
    fires = len(model.fires)
    for name in ("robots", "temperature") if fires else ():
        row[column : column + fires] = model.fires.columns[name]
        column += fires
    if model.control is not None:
        layers, robots = len(model.control.layers), len(model.swarm)
        counts = np.bincount(model.swarm.columns["layer"] + 1, minlength=layers + 1)
        row[column : column + layers] = 100.0 * counts[1:] / max(robots, 1)
        row[column + layers] = 100.0 * counts[0] / max(robots, 1)
        column += layers + 1
    if model.events:
        row[column : column + len(model.events.names)] = list(model.events.counts.values())
        column += len(model.events.names)
    faults: dict[str, str] = {}
    for chart in own_charts(model):
        try:
            row[column : column + len(chart.curves)] = chart.numbers(model)
        except Exception as problem:  # a function of a user's may raise anything; the chart has a gap there
            row[column : column + len(chart.curves)] = np.nan
            faults[own_key(chart)] = reported(problem)
        column += len(chart.curves)
    return faults


def agent_means(model: SwarmModel) -> list[float]:
    """Return the mean over all agents of each agent reporter, as collected last; NaN without numbers."""
    collector = model.datacollector
    names, records = list(collector.agent_reporters), collector._agent_records
    if not names or not records:
        return [np.nan] * len(names)
    latest = list(records[next(reversed(records))])
    # Rows begin with the step and the id of the agent.
    columns = ([reported_number(row[place]) for row in latest] for place in range(2, 2 + len(names)))
    finite = ([number for number in column if np.isfinite(number)] for column in columns)
    return [float(np.mean(column)) if column else np.nan for column in finite]


def reported_number(value: object) -> float:
    """Return the value of a reporter as a number, NaN for a missing one and for a non-number."""
    number = as_number(value)
    return np.nan if number is None else number
