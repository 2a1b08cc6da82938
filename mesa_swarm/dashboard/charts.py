"""Charts beside the canvas: measurements over time, histograms of robots, phase plots."""

import re
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, Protocol, cast

import anywidget
import numpy as np
import traitlets
from matplotlib.figure import Figure

from mesa_swarm.dashboard.chart_content import (
    HISTOGRAM,
    LOG_AXES,
    OVER_TIME,
    PHASE_PLOT,
    Axis,
    ChosenChart,
    HistogramContent,
    PhaseContent,
    TimeContent,
    csv_of,
    figure_of,
    histogram_csv,
    histogram_figure,
    phase_csv,
    phase_figure,
    title_of,
)
from mesa_swarm.dashboard.robot_columns import RobotValues, values_of_session
from mesa_swarm.dashboard.series import ChartTable
from mesa_swarm.dashboard.session import Session
from mesa_swarm.dashboard.widgets import Downloads, Link
from mesa_swarm.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.gallery import short_name
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.faults import reported
from mesa_swarm.viewing.pictures import png
from mesa_swarm.viewing.play_loop import Listeners
from mesa_swarm.viewing.player import PackedFrame, Past, Viewer

# Shortest time between updates of the charts while the model is played, s.
EVERY = 0.4
# Number of charts shown by default, and at most.
SHOWN_FIRST, MOST_SHOWN = 3, 12
FIRST = ("at_fires",)
LATER = ("layers", "collisions", "fire_temperature", "total_collisions")


class Charted(Protocol):
    """What has charts: a session that plays a model, or a player of a recording."""

    name: str
    chosen_charts: dict[str, list[str]]
    changed: Listeners

    @property
    def past(self) -> Past:
        """The stored steps, one of which is displayed."""

    @property
    def series(self) -> ChartTable:
        """The measurements."""

    @property
    def playing(self) -> bool:
        """Whether it is played."""

    def add_viewer(self, viewer: Viewer) -> None:
        """Send frames to a viewer from now on."""

    def remove_viewer(self, viewer: Viewer) -> None:
        """Send no more frames to a viewer."""


class ChartBoard(anywidget.AnyWidget):
    """Charts drawn in the browser."""

    _esm = palette.script() + text_of("viewing/elements.js", "dashboard/downloads.js", "dashboard/charts.js")
    # What can be shown, by kind: pairs of a name and its text; and what is shown: id, kind, title and log of each.
    choices = traitlets.Dict().tag(sync=True)
    shown: traitlets.List[dict[str, Any]] = traitlets.List().tag(sync=True)
    fault = traitlets.Unicode("").tag(sync=True)


class Charting(Link):
    """Connects a chart board and the measurements of a session or of a recording.

    Numbers are sent while the page is visible and has drawn the last ones, at most every `EVERY` seconds while the
    model is played. `robots` returns the quantities of robots; `clock` returns seconds far above 0.
    """

    ready = False  # charts alone need no picture

    def __init__(
        self,
        board: ChartBoard,
        session: Charted,
        robots: Callable[[], RobotValues] | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.board, self.session, self.clock = board, session, clock
        self._robots = robots
        self._downloads = Downloads(board)
        self._lock = threading.Lock()
        self._looked_at: int | None = None
        self._looks = self._waits = False
        self._busy = self._sent = 0.0
        self._rows = 0
        self._keys: tuple[str, ...] = ()
        leave_view = partial(session.remove_viewer, self)
        self.connect(board, session.changed.add(self.refresh), leave_view, self._downloads.close)
        self.refresh()
        session.add_viewer(self)

    def refresh(self) -> None:
        """Show which charts there are; send them if others are chosen, or if there are more numbers at rest."""
        series, before = self.session.series, self.board.shown
        self._keys = tuple(chart.key for chart in series.charts())
        self.board.choices = choices_of(series, self._values(at_present=True))
        self.board.shown = [self._described(one) for one in self._available()]
        with self._lock:
            more = self._rows != len(series) and not self.session.playing
            self._waits = self._waits or more or self.board.shown != before
        if more or self.board.shown != before:
            self._send_if_free()

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show the numbers up to now, if an update is due; mark the displayed step if it is an earlier one."""
        session = self.session
        with self._lock:
            self._looked_at = None if session.past.is_present else frame.step
            self._waits = True
            due = not session.playing or self.clock() - self._sent >= EVERY
        if due:
            if self._keys != tuple(chart.key for chart in session.series.charts()):
                self.refresh()
            self._send_if_free()

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        value: Any = message.get("value")
        match message.get("do"):
            case "look":
                with self._lock:
                    self._looks, self._busy, self._waits = bool(value), 0.0, True
                self._send_if_free()
            case "drawn":
                with self._lock:
                    self._busy = 0.0
                if not self.session.playing:
                    self._send_if_free()
            case "add" | "remove" | "log" | "csv" | "png" as request:
                try:
                    self._carry_out(request, ChosenChart.of(str(value)), str(message.get("axis", "")))
                except SwarmError as problem:
                    self.board.fault = reported(problem)
            case _:
                self._downloads.hear(message)

    def _carry_out(self, request: str, chosen: ChosenChart, axis: str) -> None:
        self.board.fault = ""
        if request in ("csv", "png"):
            if chosen.place in {one.place for one in self._available()}:
                self._hand_over(chosen, request)
            return
        charts = self._chosen()
        if request == "add":
            self._check_new(chosen)
            if chosen.place not in {one.place for one in charts}:
                charts.append(chosen)
        elif request == "remove":
            charts = [one for one in charts if one.place != chosen.place]
        elif axis in LOG_AXES[chosen.kind]:
            charts = [with_log(one, axis) if one.place == chosen.place else one for one in charts]
        self.session.chosen_charts[self.session.name] = [one.text for one in charts]
        self.refresh()

    def _check_new(self, chosen: ChosenChart) -> None:
        if not is_available(chosen, self.board.choices):
            raise InvalidValueError(f"there is not a chart of {chosen.what!r:.60}; choose one of the list")
        if len(self._available()) >= MOST_SHOWN:
            raise InvalidValueError(f"{MOST_SHOWN} charts are shown, which is the most; remove one first")

    def _chosen(self) -> list[ChosenChart]:
        """Return the charts that the user chose, also those that there are not at present, or the usual ones."""
        texts = self.session.chosen_charts.get(self.session.name)
        if texts is not None:
            known = []
            for text in texts:
                with suppress(InvalidValueError):  # it may come from a link or a browser
                    known.append(ChosenChart.of(text))
            return known
        keys = in_order([chart.key for chart in self.session.series.charts()])
        return [ChosenChart(OVER_TIME, key) for key in keys[:SHOWN_FIRST]]

    def _available(self) -> list[ChosenChart]:
        return [one for one in self._chosen() if is_available(one, self.board.choices)]

    def _described(self, chosen: ChosenChart) -> dict[str, str]:
        title = title_of(chosen, self.session.series)
        return {"id": replace(chosen, log="").text, "kind": chosen.kind, "title": title, "log": chosen.log}

    def _values(self, *, at_present: bool = False) -> RobotValues:
        """Return the quantities of robots, measured when they are needed: hold the lock of a session meanwhile."""
        if self._robots is not None:
            return self._robots()
        session = cast(Session, self.session)
        with session.lock:
            return values_of_session(session, at_present=at_present)

    def _send_if_free(self) -> None:
        """Send the numbers if the page is visible and has drawn the last ones."""
        with self._lock:
            now = self.clock()
            if not (self._looks and self._waits) or now - self._busy < 10 * EVERY:
                return
            self._waits, self._busy, self._sent = False, now, now
            looked_at, self._rows = self._looked_at, len(self.session.series)
        charts, buffers = self._message(looked_at)
        seconds = self.session.series.seconds
        self.board.send({"kind": "curves", "charts": charts, "looked_at": looked_at, "seconds": seconds}, buffers)

    def _message(self, step: int | None) -> tuple[list[dict], list[bytes]]:
        chosen = self._available()
        if all(one.kind != HISTOGRAM for one in chosen):
            return message_of(self.session.series, chosen, RobotValues(0), step)
        # A histogram is measured while the model rests between two steps.
        lock = getattr(self.session, "lock", threading.RLock())
        with lock:
            return message_of(self.session.series, chosen, self._values(), step)

    def _hand_over(self, chosen: ChosenChart, kind: str) -> None:
        """Make a file in a thread, since a picture takes a while, and send it."""
        series, step = self.session.series, self._looked_at
        robots = self._values() if chosen.kind == HISTOGRAM else RobotValues(0)
        histogram = HistogramContent.of(robots, chosen) if chosen.kind == HISTOGRAM else None
        name = f"{short_name(self.session.name)}_{file_name(chosen, robots.step)}.{kind}"

        def work() -> None:
            table, figure = files_of(series, chosen, histogram, step)
            self._downloads.send(name, table() if kind == "csv" else png(figure()))

        threading.Thread(target=work, name="chart", daemon=True).start()


def with_log(chosen: ChosenChart, axis: str) -> ChosenChart:
    """Return a chart with this axis logarithmic, or linear if it is logarithmic."""
    return replace(chosen, log="".join(one for one in "xy" if (one in chosen.log) != (one == axis)))


def in_order(keys: list[str]) -> list[str]:
    """Return charts in the order of display: fires, those of the model, then those of all models."""
    own = [key for key in keys if key not in FIRST + LATER]
    order = [*FIRST, *LATER, *own] if set(FIRST) & set(keys) else [*own, *LATER]
    return [key for key in order if key in keys]


def choices_of(series: ChartTable, robots: RobotValues) -> dict[str, list[list[str]]]:
    """Return what can be shown, by kind: a name and a text of each."""
    titles = {chart.key: chart.title for chart in series.charts()}
    return {
        OVER_TIME: [[key, titles[key]] for key in in_order(list(titles))],
        HISTOGRAM: [[name, quantity.label] for name, quantity in robots.quantities.items()],
        PHASE_PLOT: [[label, label] for label in series.labels()],
    }


def is_available(chosen: ChosenChart, choices: dict[str, list[list[str]]]) -> bool:
    """Return whether a chart can be shown at present."""
    known = {name for name, _ in choices.get(chosen.kind, [])}
    return chosen.what in known and (chosen.kind != PHASE_PLOT or chosen.against in known)


def file_name(chosen: ChosenChart, step: int) -> str:
    """Return the name of a file, without its ending; that of a histogram has its step."""
    words = {
        OVER_TIME: chosen.what,
        HISTOGRAM: f"{chosen.what} histogram step {step}",
        PHASE_PLOT: f"{chosen.what} against {chosen.against}",
    }
    return re.sub(r"\W+", "_", words[chosen.kind]).strip("_")


def message_of(
    series: ChartTable, charts: Sequence[ChosenChart], robots: RobotValues, step: int | None
) -> tuple[list[dict], list[bytes]]:
    """Return descriptions of charts for the browser, and a float64 buffer each: see the top of ``charts.js``."""
    makers: dict[str, Callable[[ChosenChart], tuple[dict, list[np.ndarray]]]] = {
        OVER_TIME: lambda one: curves_message(TimeContent.of(series, one, step=step), series),
        HISTOGRAM: lambda one: histogram_message(HistogramContent.of(robots, one)),
        PHASE_PLOT: lambda one: phase_message(PhaseContent.of(series, one, step=step)),
    }
    descriptions, buffers = [], []
    for one in charts:
        try:
            about, arrays = makers[one.kind](one)
        except UnknownNameError:  # the model has just lost it
            continue
        lengths = [len(array) for array in arrays]
        descriptions.append({"id": replace(one, log="").text, "kind": one.kind, "lengths": lengths, **about})
        buffers.append(np.concatenate(arrays).astype("<f8").tobytes())
    return descriptions, buffers


def curves_message(content: TimeContent, series: ChartTable) -> tuple[dict, list[np.ndarray]]:
    """Return what describes a chart over time, and first and last steps, means, and least and greatest numbers."""
    chart, curves = content.chart, content.curves
    parts = [curves.first, curves.steps, *curves.mean]
    parts += [*curves.low, *curves.high] if curves.width > 1 else []
    about = {
        "names": list(chart.names),
        "colours": "layers" if chart.key == "layers" else "series",
        "points": len(curves.steps),
        "banded": curves.width > 1,
        "every": series.every,
        "row": row_json(content.row),
        "note": "; ".join(filter(None, [series.faults.get(chart.key, ""), content.y.note])),
        **axes_json(content.x, replace(content.y, label=chart.unit or chart.title)),  # the name is above
    }
    return about, parts


def histogram_message(content: HistogramContent) -> tuple[dict, list[np.ndarray]]:
    """Return what describes a histogram, and its edges and counts."""
    about: dict[str, Any] = {"step": content.step, "summary": content.summary, "points": len(content.bins.counts)}
    about["robots"] = int(content.bins.counts.sum())
    about |= {"degrees": content.quantity.is_direction, "note": content.note, **axes_json(content.x, content.y)}
    return about, [content.bins.edges, content.bins.counts]


def phase_message(content: PhaseContent) -> tuple[dict, list[np.ndarray]]:
    """Return what describes a phase plot, and steps and places of its points."""
    note = "; ".join(f"{axis.label}: {axis.note}" for axis in (content.x, content.y) if axis.note)
    about = {"points": len(content.steps), "row": row_json(content.mark), "note": note}
    return {**about, **axes_json(content.x, content.y)}, [content.steps, content.across, content.up]


def axes_json(x: Axis, y: Axis) -> dict[str, dict]:
    """Return the axes for the browser."""
    return {name: {"label": axis.label, "log": axis.log} for name, axis in (("x", x), ("y", y))}


def row_json(row: tuple[int, np.ndarray] | None) -> dict[str, Any] | None:
    """Return a row for the browser, with None for what is not a number."""
    if row is None:
        return None
    return {"step": row[0], "values": [float(value) if np.isfinite(value) else None for value in row[1]]}


def files_of(
    series: ChartTable, chosen: ChosenChart, histogram: HistogramContent | None, step: int | None
) -> tuple[Callable[[], bytes], Callable[[], Figure]]:
    """Return what makes the CSV and the figure of a chart."""
    if histogram is not None:
        return partial(histogram_csv, histogram), partial(histogram_figure, histogram)
    if chosen.kind == PHASE_PLOT:
        return partial(phase_csv, series, chosen), partial(phase_figure, series, chosen, step)
    return partial(csv_of, series, chosen.what), partial(figure_of, series, chosen.what, chosen.log)
