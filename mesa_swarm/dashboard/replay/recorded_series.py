"""The numbers of charts of a recording, under the names that they have on the Watch page."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.dashboard.page.series import (
    MOST_NUMBERS,
    NO_LAYER,
    ChartTable,
    event_plot,
    fire_plots,
    layer_plot,
    number_names,
    reported_number,
    reporter_plot,
)
from mesa_swarm.recording.collected_data import check_collected, join_series, size_of_collected, without_rest
from mesa_swarm.recording.container import Packer
from mesa_swarm.recording.frames import Frame
from mesa_swarm.recording.recording import Recording
from mesa_swarm.viewing.scene import Scene

# Rows after which what was read so far is shown.
SHOWN_ROWS = 2000
WITHOUT_REPORTERS = "Reporters of the model are recorded with its complete states, of which this recording has none."


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
        self._tables: dict[str, np.ndarray] = {}
        # Ids of the robots that collided, row after row, and where each row ends; None if there are too many.
        self._colliding: list[np.ndarray] | None = [] if self.is_whole and "contacts" in recording.columns else None
        self._totals: list[int] = []

    @property
    def seconds(self) -> float | None:
        """Seconds of a step, None without a scale."""
        scale = self.scene.scale
        return None if scale is None else scale.seconds_per_step

    def rows(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Return all stored steps (m,) and numbers (m, c) of one chart."""
        with self._lock:
            chart = self.chart(key)
            return self._steps[: self._count].copy(), self._tables[chart.key][: self._count].copy()

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
                self._arrange(frame, reporters)
            self._note_collisions(frame)
            for name in frame.columns["events"]["name"].tolist() if "events" in frame.columns else ():
                events[name] = events.get(name, 0) + 1
            if row % self._stride == 0:
                self._put(frame, events, reporters)
            if row and row % SHOWN_ROWS == 0:
                show()
        self.complete = True
        show()

    def _arrange(self, frame: Frame, reporters: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
        """Make the charts, with as many rows as there is memory for."""
        reporters_known = set(reporters)
        if "contacts" in self._columns or "collided" in self._columns:
            reporters_known |= {"collisions", *(["total_collisions"] if self.is_whole else [])}
        first = [name for name in ("collisions", "total_collisions") if name in reporters_known]
        charts = [*map(reporter_plot, [*first, *(name for name in reporters if name not in first)])]
        if "fires" in self._columns:
            charts += fire_plots(len(frame["fires"]))
        layers = self._layers()
        if "layer" in self._columns and layers:
            charts.append(layer_plot(layers))
        width = sum(len(chart.names) for chart in charts) + 1
        stride = 1
        while -(-self._rows // stride) * width > self.most_numbers:
            stride *= 2
        rows = -(-self._rows // stride)
        with self._lock:
            self.every, self._stride = self._spacing * stride, stride
            self._steps = np.zeros(rows, np.int64)
            self._charts = {chart.key: chart for chart in charts}
            self._tables = {chart.key: np.full((rows, len(chart.names)), np.nan) for chart in charts}

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

    def _put(self, frame: Frame, events: dict[str, int], reporters: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
        with self._lock:
            row, tables = self._count, self._tables
            self._steps[row] = frame.step
            for name, (steps, values) in reporters.items():
                place = int(np.searchsorted(steps, frame.step, side="right")) - 1
                # After the last recorded state nothing is known.
                if place >= 0 and (place < len(steps) - 1 or frame.step == steps[-1]):
                    tables[name][row] = values[place]
            robots = find_collided(frame)
            if robots is not None and "collisions" in tables:
                tables["collisions"][row] = len(robots)
            if robots is not None and self.is_whole:
                tables["total_collisions"][row] = self._totals[-1]
            self._put_fires(frame, row)
            if "layers" in tables:
                tables["layers"][row] = self._shares(frame)
            self._put_events(events, row)
            self._count = row + 1

    def _put_fires(self, frame: Frame, row: int) -> None:
        if "at_fires" in self._tables and "fires" in frame.columns:
            fires = frame["fires"]
            for key, name in (("at_fires", "robots"), ("fire_temperature", "temperature")):
                table = self._tables[key]
                if len(fires) > table.shape[1]:
                    more = np.full((len(table), len(fires) - table.shape[1]), np.nan)
                    self._tables[key] = table = np.hstack([table, more])
                    self._charts |= {plot.key: plot for plot in fire_plots(len(fires)) if plot.key == key}
                table[row, : len(fires)] = fires[name]

    def _shares(self, frame: Frame) -> np.ndarray:
        """Return the share of robots that each layer drives, of all layers that there ever were; the last of none."""
        names = number_names(tuple(self.scene.world(frame.step)["layers"]))
        place = [self._charts["layers"].names.index(name) for name in (*names, NO_LAYER)]
        layer = frame["layer"].astype(np.int64)
        counts = np.bincount(np.clip(layer, -1, len(names) - 1) + 1, minlength=len(names) + 1)
        shares = np.zeros(len(self._charts["layers"].names))
        shares[place] = 100.0 * np.roll(counts, -1) / max(len(layer), 1)
        return shares

    def _put_events(self, events: dict[str, int], row: int) -> None:
        if not events:
            return
        table = self._tables.get("events", np.empty((len(self._steps), 0)))
        if table.shape[1] < len(events):
            more = np.full((len(table), len(events) - table.shape[1]), np.nan)
            self._tables["events"] = table = np.hstack([table, more])
            self._charts["events"] = event_plot(events)
        table[row] = list(events.values())


def find_collided(frame: Frame) -> np.ndarray | None:
    """Return the ids of the robots that collided in the step of a frame, None if that was not recorded."""
    if "contacts" in frame.columns:  # one row for each robot
        return np.asarray(frame["contacts"]["robot"], np.int64)
    if "collided" in frame.columns:
        return np.asarray(frame.robots[frame["collided"].astype(bool)], np.int64)
    return None


def collected_reporters(recording: Recording) -> dict[str, tuple[np.ndarray, np.ndarray]]:
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


def _note_on(reporters: dict[str, tuple[np.ndarray, np.ndarray]], last: int) -> str:
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
