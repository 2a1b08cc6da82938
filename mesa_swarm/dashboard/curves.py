"""What two worlds report over time, in one chart."""

import io
import threading
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from mesa_swarm.dashboard.pair import Pair, Side
from mesa_swarm.experiments.figures import window_means
from mesa_swarm.experiments.pictures import COOL, HOT, INK, literal

# Not drawn more often, s: a drawing takes a tenth of that.
EVERY = 0.5
MOST_PANELS = 3
# What every model reports is drawn last.
LAST = ("total_collisions", "collisions")
# A line has so many corners at most; each is the mean of the steps between.
CORNERS = 300
SIZE, DOTS_PER_INCH = (10.4, 2.05), 150
STYLES = ((COOL, "-"), (HOT, "--"))
_DRAWING = threading.Lock()

# By name the steps and the numbers, shapes (m,) and (m,).
Reports = dict[str, tuple[np.ndarray, np.ndarray]]


def series_of(pair: Pair) -> tuple[Reports, Reports]:
    """Return what the models of a pair reported, at the steps that are kept; empty where there is no model."""
    with pair.lock:
        first, second = (_reports_of(side) for side in pair.sides)
    return first, second


def _reports_of(side: Side) -> Reports:
    if side.model is None:
        return {}
    collected, charts = side.model.datacollector.model_vars, side.series.charts()
    tables = {chart.key: side.series.rows(chart.key) for chart in charts if chart.key in collected}
    found = {name: (steps, numbers[:, 0]) for name, (steps, numbers) in tables.items()}
    # A report that was never a number is none of the chart's.
    return {name: line for name, line in found.items() if not len(line[0]) or np.isfinite(line[1]).any()}


def curves_png(series: Sequence[Reports], labels: Sequence[str]) -> bytes:
    """Return a chart as PNG: a panel for each of the first three reports, in it a line for each world.

    Parameters
    ----------
    series : sequence of dict
        Of each world by name, the steps and the numbers.
    labels : sequence of str
        Of the worlds.

    Examples
    --------
    >>> steps = np.array([1, 2])
    >>> curves_png([{"fires": (steps, np.array([7, 6]))}, {"fires": (steps, np.array([7, 7]))}], ["A", "B"])[1:4]
    b'PNG'
    """
    names = main_reports(series)
    with _DRAWING:
        figure = Figure(figsize=SIZE)
        panels = figure.subplots(1, max(len(names), 1), squeeze=False)[0]
        figure.subplots_adjust(left=0.045, right=0.985, top=0.77, bottom=0.22, wspace=0.17)
        for name, axes in zip(names, panels, strict=False):
            draw(axes, name, series, labels)
        lines = panels[0].get_legend_handles_labels()
        figure.legend(*lines, loc="upper right", bbox_to_anchor=(1.0, 1.04), ncols=2, fontsize=9.5, frameon=False)
        return _png(figure)


def main_reports(series: Sequence[Reports]) -> list[str]:
    """Return the names of what is drawn: what the model itself reports before what all models do.

    Examples
    --------
    >>> line = np.array([1]), np.array([0])
    >>> main_reports([{"collisions": line, "groups": line}])
    ['groups', 'collisions']
    """
    names = dict.fromkeys(name for one in series for name in one)
    return sorted(names, key=lambda name: LAST.index(name) if name in LAST else -1)[:MOST_PANELS]


def draw(axes: Axes, name: str, series: Sequence[Reports], labels: Sequence[str]) -> None:
    """Draw one report of both worlds into a panel."""
    lines = [one[name] for one in series if name in one]
    for one, label, (colour, style) in zip(series, labels, STYLES, strict=True):
        if name in one:
            middles, means = (window_means(part.astype(float), CORNERS)[1] for part in one[name])
            axes.plot(middles, means, style, color=colour, linewidth=1.8, label=literal(label))
    axes.set_title(literal(name.replace("_", " ")), fontsize=11, loc="left", color=INK)
    axes.set_xlabel("step", fontsize=9, labelpad=1)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    known = [numbers[np.isfinite(numbers)] for _, numbers in lines]
    counts = all((numbers == np.round(numbers)).all() for numbers in known)
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=counts, min_n_ticks=1))
    axes.tick_params(labelsize=9)
    axes.grid(axis="y", color="#dddddd", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlim(0, max([1, *(steps[-1] for steps, _ in lines if len(steps))]))
    if all(numbers.min(initial=0.0) >= 0.0 for numbers in known):
        axes.set_ylim(bottom=0.0, top=None if axes.dataLim.y1 > 0 else 1.0)


def _png(figure: Figure) -> bytes:
    file = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(file, format="png", dpi=DOTS_PER_INCH)
    return file.getvalue()


class CurveThread:
    """Draws the chart of a pair whenever there is something new, but not too often.

    Parameters
    ----------
    pair : Pair
    labels : function
        Returns what the two worlds are called.
    take : function
        Called with a PNG.
    """

    def __init__(self, pair: Pair, labels: Callable[[], Sequence[str]], take: Callable[[bytes], None]) -> None:
        self._pair, self._labels, self._take = pair, labels, take
        self._stop = threading.Event()
        threading.Thread(target=self._run, name="curves", daemon=True).start()

    def close(self) -> None:
        """Draw no more."""
        self._stop.set()

    def _run(self) -> None:
        drawn: tuple = ()
        while not self._stop.is_set():
            labels = tuple(self._labels())
            now = labels, *((id(side.model), side.model and side.model.completed) for side in self._pair.sides)
            if now != drawn:
                drawn = now
                self._take(curves_png(series_of(self._pair), labels))
            self._stop.wait(EVERY)
