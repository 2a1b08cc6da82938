"""Charts beside the canvas, of the measurements of the run so far."""

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import anywidget
import numpy as np
import pandas as pd
import traitlets
from matplotlib.figure import Figure

from mesa_swarm.dashboard.series import Plot, Series
from mesa_swarm.dashboard.session import Session
from mesa_swarm.dashboard.widgets import Downloads, Link
from mesa_swarm.gallery import short_name
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.pictures import literal, png
from mesa_swarm.viewing.player import PackedFrame

# Shortest time between updates of the charts while the model is played, s.
EVERY = 0.4
MOST_POINTS = 256
POINTS_OF_A_PICTURE = 2048
# Number of charts shown by default.
SHOWN_FIRST = 3
FIRST = ("at_fires",)
LATER = ("layers", "collisions", "fire_temperature", "total_collisions")
DASHES = ("-", "--", ":")


class ChartBoard(anywidget.AnyWidget):
    """Charts drawn in the browser."""

    _esm = palette.script() + text_of("viewing/elements.js", "dashboard/downloads.js", "dashboard/charts.js")
    # Key and title of each chart, and the keys of those that are shown.
    charts: traitlets.List[dict[str, Any]] = traitlets.List().tag(sync=True)
    shown: traitlets.List[str] = traitlets.List().tag(sync=True)


class Charting(Link):
    """Connects a chart board and a session's measurements.

    Numbers are sent while the page is visible and has drawn the last ones, at most every `EVERY` seconds while the
    model is played. `clock` returns seconds far above 0.
    """

    ready = False  # charts alone need no picture

    def __init__(self, board: ChartBoard, session: Session, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.board, self.session, self.clock = board, session, clock
        self._downloads = Downloads(board)
        self._lock = threading.Lock()
        self._looked_at: int | None = None
        self._looks = self._waits = False
        self._busy = 0.0
        self._sent = 0.0
        leave_view = partial(session.remove_viewer, self)
        self.connect(board, session.changed.add(self.refresh), leave_view, self._downloads.close)
        self.refresh()
        session.add_viewer(self)

    def refresh(self) -> None:
        """Show the list of charts."""
        titles = {chart.key: chart.title for chart in self.session.series.charts()}
        order = in_order(list(titles))
        known = [{"key": key, "title": titles[key]} for key in order]
        self.board.charts = known
        wanted = self.session.chosen_charts.get(self.session.name, order[:SHOWN_FIRST])
        self.board.shown = [key for key in order if key in wanted]

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show the numbers up to now, if an update is due; mark the displayed step if it is an earlier one."""
        session = self.session
        with self._lock:
            self._looked_at = None if session.past.is_present else frame.step
            self._waits = True
            if not session.playing or self.clock() - self._sent >= EVERY:
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
                self._drawn()
            case "choose":
                self._choose([str(key) for key in value])
            case "csv" | "png" if value in {chart.key for chart in self.session.series.charts()}:
                self._hand_over(str(value), message["do"])
            case _:
                self._downloads.hear(message)

    def _choose(self, keys: list[str]) -> None:
        self.session.chosen_charts[self.session.name] = keys
        self.refresh()
        with self._lock:
            self._waits = True
            self._send_if_free()

    def _drawn(self) -> None:
        with self._lock:
            self._busy = 0.0
            if not self.session.playing:
                self._send_if_free()

    def _send_if_free(self) -> None:
        """Send the numbers if the page is visible and has drawn the last ones."""
        now = self.clock()
        if not (self._looks and self._waits) or now - self._busy < 10 * EVERY:
            return
        self._waits, self._busy, self._sent = False, now, now
        descriptions, buffers = curves_message(self.session.series, self.board.shown)
        seconds = self.session.series.seconds
        message = {"kind": "curves", "charts": descriptions, "looked_at": self._looked_at, "seconds": seconds}
        self.board.send(message, buffers)

    def _hand_over(self, key: str, kind: str) -> None:
        """Make a file in a thread, since a picture takes a while, and send it."""
        series, name = self.session.series, f"{short_name(self.session.name)}_{key}.{kind}"

        def work() -> None:
            content = csv_of(series, key) if kind == "csv" else png(figure_of(series, key))
            self._downloads.send(name, content)

        threading.Thread(target=work, name="chart", daemon=True).start()


def in_order(keys: list[str]) -> list[str]:
    """Return charts in the order of display: fires, those of the model, then those of all models."""
    own = [key for key in keys if key not in FIRST + LATER]
    order = [*FIRST, *LATER, *own] if set(FIRST) & set(keys) else [*own, *LATER]
    return [key for key in order if key in keys]


def curves_message(series: Series, keys: list[str]) -> tuple[list[dict], list[bytes]]:
    """Return descriptions of curves for the browser, and float32 buffers of steps, mean, low and high."""
    descriptions, buffers = [], []
    for chart in series.charts():
        if chart.key not in keys:
            continue
        curves = series.curves(chart.key, MOST_POINTS)
        parts = [curves.steps[None], curves.mean] + ([curves.low, curves.high] if curves.width > 1 else [])
        buffers.append(np.concatenate(parts).astype("<f4").tobytes())
        about = {"key": chart.key, "title": chart.title, "unit": chart.unit, "names": list(chart.names)}
        descriptions.append({**about, "points": len(curves.steps), "banded": curves.width > 1})
    return descriptions, buffers


def csv_of(series: Series, key: str) -> bytes:
    """Return all stored rows of one chart as CSV, with units in the header."""
    chart, (steps, rows) = series.chart(key), series.rows(key)
    columns = {with_unit(name, chart): column for name, column in zip(chart.names, rows.T, strict=True)}
    counts = {
        name: pd.array(c, "Int64") if (np.isnan(c) | (c == np.rint(c))).all() else c for name, c in columns.items()
    }
    times = {} if series.seconds is None else {"time (s)": steps * series.seconds}
    return pd.DataFrame({"step": steps, **times, **counts}).to_csv(index=False, lineterminator="\n").encode()


def with_unit(name: str, chart: Plot) -> str:
    """Return a curve's name, with its unit if it has one."""
    return f"{name} ({chart.unit})" if chart.unit else name


def figure_of(series: Series, key: str) -> Figure:
    """Return one chart as a figure for print: lines are means of groups of steps, bands their ranges."""
    chart, curves = series.chart(key), series.curves(key, POINTS_OF_A_PICTURE)
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.subplots()
    colours = colours_of(chart)
    times = curves.steps * (series.seconds or 1)
    for k, name in enumerate(chart.names):
        colour, dashes = colours[k % len(colours)], DASHES[k // len(colours) % len(DASHES)]
        axes.plot(times, curves.mean[k], label=literal(name), linewidth=1.3, color=colour, linestyle=dashes)
        if curves.width > 1 and len(chart.names) <= 3:
            axes.fill_between(times, curves.low[k], curves.high[k], color=colour, alpha=0.15, linewidth=0)
    axes.set(title=literal(chart.title), xlabel="time (s)" if series.seconds else "step", ylabel=literal(chart.unit))
    axes.spines[["top", "right"]].set_visible(False)
    if len(chart.names) > 1:
        figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    return figure


def colours_of(chart: Plot) -> Sequence[str]:
    """Return the colours of a chart's curves on paper; for layers their own colours, the last without a layer."""
    if chart.key != "layers":
        return palette.LIGHT.series
    return [*map(palette.layer_colour, range(len(chart.names) - 1)), palette.LIGHT.no_layer]
