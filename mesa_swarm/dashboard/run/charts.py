"""Charts beside the canvas: measurements over time, histograms of robots, phase plots."""

import json
import re
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import anywidget
import numpy as np
import pandas as pd
import traitlets
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError, unknown_name
from mesa_swarm.base.wording import quantity
from mesa_swarm.dashboard.page.robot_columns import Bins, Quantity, RobotValues, bin_values, values_of_session
from mesa_swarm.dashboard.page.series import ChartTable, Curves, Plot, row_until
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import Link, view_script
from mesa_swarm.dashboard.replay.replaying import ReplayPlayer
from mesa_swarm.model.gallery import short_name
from mesa_swarm.viewing import palette
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.figures import literal, plain_figure, png
from mesa_swarm.viewing.player import PackedFrame

MOST_POINTS = 256
POINTS_OF_A_PICTURE = 2048
# Of a phase plot, beside the last one; others are left out evenly.
MOST_PHASE_POINTS = 1024
DASHES = ("-", "--", ":")
OVER_TIME, HISTOGRAM, PHASE_PLOT = "over time", "histogram", "phase plot"
# Axes that may be logarithmic, by kind.
LOG_AXES = {OVER_TIME: "y", HISTOGRAM: "x", PHASE_PLOT: "xy"}
LONGEST_TEXT = 1000
# Beyond it, floats are whole anyway.
LARGEST_WHOLE = 2.0**53


@dataclass(frozen=True, slots=True)
class ChosenChart:
    """What one chart shows: a chart of a series over time, a quantity of robots, or one curve against another.

    Stored as text, in which it is in `Session.chosen_charts`.

    Examples
    --------
    >>> chosen = ChosenChart(HISTOGRAM, "heading")
    >>> chosen.text
    '["histogram", "heading", "", ""]'
    >>> ChosenChart.of(chosen.text) == chosen
    True
    """

    kind: str
    what: str
    against: str = ""  # the curve on the x axis of a phase plot
    log: str = ""  # the logarithmic axes: "", "x", "y" or "xy"

    @property
    def text(self) -> str:
        """All that is to be stored."""
        return json.dumps([self.kind, self.what, self.against, self.log])

    @classmethod
    def of(cls, text: str) -> "ChosenChart":
        """Return the chart that a text describes, which may come from a browser; a key alone is one over time."""
        if not text.startswith("["):
            return cls(OVER_TIME, text)
        try:
            parts = json.loads(text[:LONGEST_TEXT])
            if len(parts) == 4 and all(isinstance(part, str) for part in parts) and parts[0] in LOG_AXES:
                kind, what, against, log = parts
                return cls(kind, what, against, "".join(axis for axis in LOG_AXES[kind] if axis in log))
        except (TypeError, ValueError, RecursionError):
            pass
        raise InvalidValueError(f"chart is {text!r:.60}; expected kind, what, against and logarithmic axes")

    @property
    def place(self) -> tuple[str, str, str]:
        """What distinguishes it from others."""
        return self.kind, self.what, self.against


@dataclass(frozen=True, slots=True)
class Axis:
    """Name and unit of an axis, whether it is logarithmic, and what is not shown as it was chosen, and why."""

    label: str
    log: bool = False
    note: str = ""

    @classmethod
    def of(cls, label: str, values: np.ndarray, log: bool) -> "Axis":
        """Return an axis for these values: a logarithmic one only if all are above 0."""
        finite = values[np.isfinite(values)]
        if not log or not len(finite):
            return cls(label)
        least = float(finite.min())
        return cls(label, True) if least > 0 else cls(label, False, f"no log axis: the least value is {least:.4g}")


@dataclass(frozen=True, slots=True, eq=False)
class TimeContent:
    """A chart over time: its curves, the exact last or displayed row, its axes."""

    series: ChartTable
    chart: Plot
    curves: Curves
    row: tuple[int, np.ndarray] | None
    x: Axis
    y: Axis

    @classmethod
    def of(
        cls, series: ChartTable, choice: ChosenChart, most: int = MOST_POINTS, step: int | None = None
    ) -> "TimeContent":
        """Return the content of a chart of a series, with the exact row of a step."""
        chart, curves = series.chart(choice.what), series.curves(choice.what, most)
        y = Axis.of(chart_axis_label(chart), curves.low, "y" in choice.log)
        return cls(series, chart, curves, series.exact(choice.what, step), Axis(time_label(series)), y)

    def message(self) -> tuple[dict[str, Any], list[np.ndarray]]:
        """Return what describes it, and first and last steps, means, and least and greatest numbers."""
        chart, curves = self.chart, self.curves
        parts = [curves.first, curves.steps, *curves.mean]
        parts += [*curves.low, *curves.high] if curves.width > 1 else []
        about = {
            "names": list(chart.names),
            "colours": "layers" if chart.key == "layers" else "series",
            "points": len(curves.steps),
            "banded": curves.width > 1,
            "every": self.series.row_every,
            "row": row_json(self.row),
            "note": "; ".join(filter(None, [self.series.faults.get(chart.key, ""), self.y.note])),
            **axes_json(self.x, replace(self.y, label=chart.unit or chart.title)),  # the name is above
        }
        return about, parts

    def csv(self) -> bytes:
        """Return all stored rows as CSV, with units in the header."""
        chart, steps, rows = self.series.chart_and_rows(self.chart.key)
        named = zip(chart.names, rows.T, strict=True)
        columns = {with_unit(name, chart): in_whole(column) for name, column in named}
        return csv_of_columns({**times_of(self.series, steps), **columns})

    def figure(self) -> Figure:
        """Return it as a figure: lines are means of groups of steps, bands their ranges."""
        chart, curves = self.chart, self.curves
        figure, axes = _figure(self.x, self.y, chart.title)
        colours = colours_of(chart)
        times = curves.steps * (self.series.seconds or 1)
        for k, name in enumerate(chart.names):
            colour, dashes = colours[k % len(colours)], DASHES[k // len(colours) % len(DASHES)]
            axes.plot(times, curves.mean[k], label=literal(name), linewidth=1.3, color=colour, linestyle=dashes)
            if curves.width > 1 and len(chart.names) <= 3:
                axes.fill_between(times, curves.low[k], curves.high[k], color=colour, alpha=0.15, linewidth=0)
        if len(chart.names) > 1:
            figure.legend(loc="outside right upper", frameon=False, fontsize=9)
        return figure


@dataclass(frozen=True, slots=True, eq=False)
class HistogramContent:
    """A histogram of the robots at a step."""

    quantity: Quantity
    step: int
    values: np.ndarray
    bins: Bins
    x: Axis
    y: Axis

    @classmethod
    def of(cls, robots: RobotValues, choice: ChosenChart) -> "HistogramContent":
        """Return the histogram of a quantity; without values where it is not known at that step."""
        quantity = robots.quantities.get(choice.what)
        if quantity is None:
            axis = Axis(choice.what, False, robots.missing or "there are no robots")
            nothing = Quantity(choice.what, "", lambda: np.empty(0))
            return cls(nothing, robots.step, np.empty(0), bin_values(np.empty(0)), axis, Axis("robots"))
        try:
            values = quantity.measure()
        except Exception as problem:  # a function of a user's may raise anything
            return cls.of(RobotValues(robots.step, missing=reported(problem)), choice)
        x = Axis.of(quantity.label, values, "x" in choice.log)
        bins = bin_values(values, log=x.log, is_direction=quantity.is_direction)
        return cls(quantity, robots.step, values, bins, x, Axis("robots"))

    @property
    def summary(self) -> str:
        """The number of robots, their mean, and the sample standard deviation."""
        finite = self.values[np.isfinite(self.values)]
        words = [quantity(len(finite), "robot")]
        if len(finite) and not self.quantity.is_direction:
            words.append(f"mean {finite.mean():.4g}")
            words += [f"standard deviation {finite.std(ddof=1):.3g}"] if len(finite) > 1 else []
        return ", ".join(words)

    @property
    def note(self) -> str:
        """Why an axis is not as chosen, and how many robots have no value."""
        without = self.bins.without
        words = f"{without:,} robot{' has' if without == 1 else 's have'} no value" if without else ""
        return "; ".join(filter(None, [self.x.note, words]))

    def message(self) -> tuple[dict[str, Any], list[np.ndarray]]:
        """Return what describes it, and its edges and counts."""
        about = {
            "step": self.step,
            "summary": self.summary,
            "points": len(self.bins.counts),
            "robots": int(self.bins.counts.sum()),
            "degrees": self.quantity.is_direction,
            "note": self.note,
            **axes_json(self.x, self.y),
        }
        return about, [self.bins.edges, self.bins.counts]

    def csv(self) -> bytes:
        """Return its bins as CSV: from, to, robots."""
        label, edges = self.quantity.label, self.bins.edges
        return csv_of_columns({f"{label} from": edges[:-1], f"{label} to": edges[1:], "robots": self.bins.counts})

    def figure(self) -> Figure:
        """Return it as a figure."""
        figure, axes = _figure(self.x, self.y, f"Step {self.step:,}: {self.summary}")
        edges, colour = self.bins.edges, palette.LIGHT.series[0]
        axes.bar(edges[:-1], self.bins.counts, np.diff(edges), align="edge", color=colour, alpha=0.85)
        if self.quantity.is_direction:
            axes.set_xticks(range(-180, 181, 90))
        return figure


@dataclass(frozen=True, slots=True, eq=False)
class PhaseContent:
    """One curve against another, in the order of time; `mark` is the present or displayed point."""

    series: ChartTable
    choice: ChosenChart
    steps: np.ndarray
    across: np.ndarray
    up: np.ndarray
    mark: tuple[int, np.ndarray] | None
    x: Axis
    y: Axis

    @classmethod
    def of(
        cls, series: ChartTable, choice: ChosenChart, most: int = MOST_PHASE_POINTS, step: int | None = None
    ) -> "PhaseContent":
        """Return the points of two curves of a series, all of them exact, and the last one of all among them."""
        (steps, across, below), (later, up, beside) = (curve_of(series, what) for what in (choice.against, choice.what))
        both = min(len(steps), len(later))  # a row may have been added between the two
        steps, across, up = steps[:both], across[:both], up[:both]
        x, y = Axis.of(below, across, "x" in choice.log), Axis.of(beside, up, "y" in choice.log)
        mark = row_until(steps, np.column_stack([across, up]), step)
        rows = thin_places(both, most)
        return cls(series, choice, steps[rows], across[rows], up[rows], mark, x, y)

    def message(self) -> tuple[dict[str, Any], list[np.ndarray]]:
        """Return what describes it, and steps and places of its points."""
        note = "; ".join(f"{axis.label}: {axis.note}" for axis in (self.x, self.y) if axis.note)
        about = {"points": len(self.steps), "row": row_json(self.mark), "note": note, **axes_json(self.x, self.y)}
        return about, [self.steps, self.across, self.up]

    def csv(self) -> bytes:
        """Return all stored points as CSV."""
        whole = PhaseContent.of(self.series, self.choice, most=sys.maxsize)
        columns = {whole.x.label: in_whole(whole.across), whole.y.label: in_whole(whole.up)}
        return csv_of_columns({**times_of(self.series, whole.steps), **columns})

    def figure(self) -> Figure:
        """Return it as a figure: coloured along time, with the present or displayed point."""
        figure, axes = _figure(self.x, self.y, chart_title(self.choice, self.series))
        points = np.column_stack([self.across, self.up])
        times = self.steps * (self.series.seconds or 1)
        colours = ListedColormap(palette.LIGHT.values)
        norm = Normalize(times[0], max(times[-1], times[0] + 1)) if len(times) else Normalize(0, 1)
        ways = list(np.stack([points[:-1], points[1:]], axis=1))
        lines = LineCollection(ways, cmap=colours, norm=norm, linewidths=1.2)
        lines.set_array(times[1:].astype(float))
        axes.add_collection(lines)
        if len(points):
            axes.scatter(self.across, self.up, c=times, cmap=colours, norm=norm, s=4)
        if self.mark is not None:
            axes.plot(*self.mark[1], "o", markersize=8, markerfacecolor="none", color=palette.LIGHT.selection)
        figure.colorbar(lines, ax=axes, label=time_label(self.series))
        return figure


# What one chart shows: for the browser by `message`, as a table by `csv`, as a figure for print by `figure`.
ChartContent = TimeContent | HistogramContent | PhaseContent


def chart_content(
    choice: ChosenChart, series: ChartTable, robots: RobotValues, step: int | None, *, printed: bool = False
) -> ChartContent:
    """Return what a chart shows at a step; `printed` with more points than a browser draws."""
    if choice.kind == HISTOGRAM:
        return HistogramContent.of(robots, choice)
    kind, most = (TimeContent, MOST_POINTS) if choice.kind == OVER_TIME else (PhaseContent, MOST_PHASE_POINTS)
    return kind.of(series, choice, POINTS_OF_A_PICTURE if printed else most, step)


def curve_of(series: ChartTable, label: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Return steps and numbers of a curve by its label, and the label with its unit."""
    labels = series.labels()
    if label not in labels:
        raise UnknownNameError(unknown_name("curve", label, labels))
    key, k = labels[label]
    steps, rows = series.rows(key)
    return steps, rows[:, k], with_unit(label, series.chart(key))


def thin_places(count: int, most: int) -> np.ndarray:
    """Return at most `most` + 1 places of `count` ones, evenly from the first on, and the last one.

    Examples
    --------
    >>> thin_places(10, 4)
    array([0, 4, 8, 9])
    """
    stride = 1
    while -(-count // stride) > most:
        stride *= 2
    places = np.arange(0, count, stride)
    return places if not count or places[-1] == count - 1 else np.append(places, count - 1)


def chart_title(choice: ChosenChart, series: ChartTable) -> str:
    """Return the title of a chart."""
    if choice.kind == OVER_TIME:
        return series.chart(choice.what).title
    return f"{choice.what} against {choice.against}" if choice.kind == PHASE_PLOT else f"Histogram of {choice.what}"


def times_of(series: ChartTable, steps: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of steps, and of times if they are known."""
    return {"step": steps, **({} if series.seconds is None else {"time (s)": steps * series.seconds})}


def in_whole(column: np.ndarray) -> Any:
    """Return a column as whole numbers, if it has no others."""
    is_whole = (np.isnan(column) | ((column == np.rint(column)) & (np.abs(column) < LARGEST_WHOLE))).all()
    return pd.array(column, "Int64") if is_whole else column


def csv_of_columns(columns: dict[str, Any]) -> bytes:
    """Return columns as CSV."""
    return pd.DataFrame(columns).to_csv(index=False, lineterminator="\n").encode()


def with_unit(name: str, chart: Plot) -> str:
    """Return a curve's name, with its unit if it has one."""
    return f"{name} ({chart.unit})" if chart.unit else name


def chart_axis_label(chart: Plot) -> str:
    """Return the name and the unit of the y axis of a chart over time; a title may name the unit itself."""
    return chart.title if chart.unit.lower() in chart.title.lower() else with_unit(chart.title, chart)


def time_label(series: ChartTable) -> str:
    """Return the name and the unit of the axis of time."""
    return "step" if series.seconds is None else "time (s)"


def _figure(x: Axis, y: Axis, title: str) -> tuple[Figure, Axes]:
    figure, ((axes,),) = plain_figure((7, 3.6))
    axes.set(title=literal(title), xlabel=literal(x.label), ylabel=literal(y.label))
    if x.log:
        axes.set_xscale("log")
    if y.log:
        axes.set_yscale("log")
    return figure, axes


def colours_of(chart: Plot) -> Sequence[str]:
    """Return the colours of a chart's curves on paper; for layers their own colours, the last without a layer."""
    if chart.key != "layers":
        return palette.LIGHT.series
    return [*map(palette.layer_colour, range(len(chart.names) - 1)), palette.LIGHT.no_layer]


# Shortest time between updates of the charts while the model is played, s.
EVERY = 0.4
# Number of charts shown by default, and at most.
SHOWN_FIRST, MOST_SHOWN = 3, 12
FIRST = ("at_fires",)
LATER = ("layers", "collisions", "fire_temperature", "total_collisions")


class ChartBoard(anywidget.AnyWidget):
    """Charts drawn in the browser."""

    _esm = palette.palette_script() + view_script("dashboard/run/charts.js")
    # What can be shown, by kind: pairs of a name and its text; and what is shown: id, kind, title and log of each.
    choices = traitlets.Dict().tag(sync=True)
    shown: traitlets.List[dict[str, Any]] = traitlets.List().tag(sync=True)
    fault = traitlets.Unicode("").tag(sync=True)


class Charting(Link):
    """Connects a chart board and the measurements of a session or of a recording.

    Numbers are sent while the page is visible and has drawn the last ones, at most every `EVERY` seconds while the
    model is played; `clock` returns seconds far above 0.
    """

    def __init__(
        self,
        board: ChartBoard,
        session: Session | ReplayPlayer,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.board, self.session, self.clock = board, session, clock
        self._lock = threading.Lock()
        self._looked_at: int | None = None
        self._looks = self._waits = False
        self._busy = self._sent_at = 0.0
        self._rows = 0
        self._keys: tuple[str, ...] = ()
        self.connect(board, session.changed.add(self.refresh))
        self.refresh()
        self.watch(session)

    def refresh(self) -> None:
        """Show which charts there are; send them if others are chosen, or if there are more numbers at rest."""
        series, before = self.session.series, self.board.shown
        self._keys = tuple(chart.key for chart in series.charts())
        self.board.choices = choices_of(series, self._values(at_present=True))
        self.board.shown = [self._describe_chart(choice) for choice in self._available()]
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
            is_due = not session.playing or self.clock() - self._sent_at >= EVERY
        if is_due:
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

    def _carry_out(self, request: str, choice: ChosenChart, axis: str) -> None:
        self.board.fault = ""
        if request in ("csv", "png"):
            if choice.place in {available.place for available in self._available()}:
                self._hand_over(choice, request)
            return
        charts = self._list_chosen()
        if request == "add":
            self._check_new(choice)
            if choice.place not in {present.place for present in charts}:
                charts.append(choice)
        elif request == "remove":
            charts = [present for present in charts if present.place != choice.place]
        elif axis in LOG_AXES[choice.kind]:
            charts = [with_log(present, axis) if present.place == choice.place else present for present in charts]
        self.session.chosen_charts[self.session.name] = [present.text for present in charts]
        self.refresh()

    def _check_new(self, choice: ChosenChart) -> None:
        if not is_available(choice, self.board.choices):
            raise InvalidValueError(f"there is not a chart of {choice.what!r:.60}; choose one of the list")
        if len(self._available()) >= MOST_SHOWN:
            raise InvalidValueError(f"{MOST_SHOWN} charts are shown, which is the most; remove one first")

    def _list_chosen(self) -> list[ChosenChart]:
        """Return the charts that the user chose, also those that there are not at present, or the usual ones."""
        texts = self.session.chosen_charts.get(self.session.name)
        if texts is not None:
            choices = []
            for text in texts:
                with suppress(InvalidValueError):  # it may come from a link or a browser
                    choices.append(ChosenChart.of(text))
            return choices
        keys = order_charts([chart.key for chart in self.session.series.charts()])
        return [ChosenChart(OVER_TIME, key) for key in keys[:SHOWN_FIRST]]

    def _available(self) -> list[ChosenChart]:
        return [choice for choice in self._list_chosen() if is_available(choice, self.board.choices)]

    def _describe_chart(self, choice: ChosenChart) -> dict[str, str]:
        title = chart_title(choice, self.session.series)
        return {"id": replace(choice, log="").text, "kind": choice.kind, "title": title, "log": choice.log}

    def _values(self, *, at_present: bool = False) -> RobotValues:
        """Return the quantities of robots, measured when they are needed: hold the lock of a session meanwhile."""
        with self.session.lock:
            if isinstance(self.session, ReplayPlayer):
                return self.session.robots_shown()
            return values_of_session(self.session, at_present=at_present)

    def _send_if_free(self) -> None:
        """Send the numbers if the page is visible and has drawn the last ones."""
        with self._lock:
            now = self.clock()
            if not (self._looks and self._waits) or now - self._busy < 10 * EVERY:
                return
            self._waits, self._busy, self._sent_at = False, now, now
            looked_at, self._rows = self._looked_at, len(self.session.series)
        charts, buffers = self._message(looked_at)
        seconds = self.session.series.seconds
        self.board.send({"kind": "curves", "charts": charts, "looked_at": looked_at, "seconds": seconds}, buffers)

    def _message(self, step: int | None) -> tuple[list[dict], list[bytes]]:
        charts = self._available()
        if all(chart.kind != HISTOGRAM for chart in charts):
            return message_of(self.session.series, charts, RobotValues(0), step)
        with self.session.lock:  # a histogram is measured while the model rests between two steps
            return message_of(self.session.series, charts, self._values(), step)

    def _hand_over(self, choice: ChosenChart, kind: str) -> None:
        """Make a file in a thread, since a picture takes a while, and send it."""
        robots = self._values() if choice.kind == HISTOGRAM else RobotValues(0)
        content = chart_content(choice, self.session.series, robots, self._looked_at, printed=True)
        name = f"{short_name(self.session.name)}_{file_name(choice, robots.step)}.{kind}"

        def work() -> None:
            self.downloads.send(name, content.csv() if kind == "csv" else png(content.figure()))

        threading.Thread(target=work, name="chart", daemon=True).start()


def with_log(choice: ChosenChart, axis: str) -> ChosenChart:
    """Return a chart with this axis logarithmic, or linear if it is logarithmic."""
    return replace(choice, log="".join(letter for letter in "xy" if (letter in choice.log) != (letter == axis)))


def order_charts(keys: list[str]) -> list[str]:
    """Return charts in the order of display: fires, those of the model, then those of all models."""
    own_keys = [key for key in keys if key not in FIRST + LATER]
    order = [*FIRST, *LATER, *own_keys] if set(FIRST) & set(keys) else [*own_keys, *LATER]
    return [key for key in order if key in keys]


def choices_of(series: ChartTable, robots: RobotValues) -> dict[str, list[list[str]]]:
    """Return what can be shown, by kind: a name and a text of each."""
    titles = {chart.key: chart.title for chart in series.charts()}
    return {
        OVER_TIME: [[key, titles[key]] for key in order_charts(list(titles))],
        HISTOGRAM: [[name, quantity.label] for name, quantity in robots.quantities.items()],
        PHASE_PLOT: [[label, label] for label in series.labels()],
    }


def is_available(choice: ChosenChart, choices: dict[str, list[list[str]]]) -> bool:
    """Return whether a chart can be shown at present."""
    names = {name for name, _ in choices.get(choice.kind, [])}
    return choice.what in names and (choice.kind != PHASE_PLOT or choice.against in names)


def file_name(choice: ChosenChart, step: int) -> str:
    """Return the name of a file, without its ending; that of a histogram has its step."""
    words = {
        OVER_TIME: choice.what,
        HISTOGRAM: f"{choice.what} histogram step {step}",
        PHASE_PLOT: f"{choice.what} against {choice.against}",
    }
    return re.sub(r"\W+", "_", words[choice.kind]).strip("_")


def message_of(
    series: ChartTable, charts: Sequence[ChosenChart], robots: RobotValues, step: int | None
) -> tuple[list[dict], list[bytes]]:
    """Return descriptions of charts for the browser, and a float64 buffer each: see the top of ``charts.js``."""
    descriptions, buffers = [], []
    for choice in charts:
        try:
            about, arrays = chart_content(choice, series, robots, step).message()
        except UnknownNameError:  # the model has just lost it
            continue
        lengths = [len(array) for array in arrays]
        descriptions.append({"id": replace(choice, log="").text, "kind": choice.kind, "lengths": lengths, **about})
        buffers.append(np.concatenate(arrays).astype("<f8").tobytes())
    return descriptions, buffers


def axes_json(x: Axis, y: Axis) -> dict[str, dict]:
    """Return the axes for the browser."""
    return {name: {"label": axis.label, "log": axis.log} for name, axis in (("x", x), ("y", y))}


def row_json(row: tuple[int, np.ndarray] | None) -> dict[str, Any] | None:
    """Return a row for the browser, with None for what is not a number."""
    if row is None:
        return None
    return {"step": row[0], "values": [float(value) if np.isfinite(value) else None for value in row[1]]}
