"""What two worlds report over time, in one chart."""

import io
import threading
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from mesa_swarm.dashboard.pair import Pair
from mesa_swarm.experiments.figures import window_means
from mesa_swarm.experiments.pictures import COOL, HOT, INK, literal
from mesa_swarm.experiments.portrait import portrait_of

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

Series = dict[str, np.ndarray]


def series_of(pair: Pair) -> tuple[Series, Series]:
    """Return what the models of a pair reported in each step, by name; empty where there is no model."""
    with pair.lock:
        first, second = (portrait_of(side.model).series if side.model else {} for side in pair.sides)
    return first, second


def curves_png(series: Sequence[Series], labels: Sequence[str]) -> bytes:
    """Return a chart as PNG: a panel for each of the first three reports, in it a line for each world.

    Parameters
    ----------
    series : sequence of dict of ndarray
        Of each world by name, a number a step.
    labels : sequence of str
        Of the worlds.

    Examples
    --------
    >>> curves_png([{"fires": np.array([7, 6])}, {"fires": np.array([7, 7])}], ["A", "B"])[1:4]
    b'PNG'
    """
    names = main_reports(series)
    with _DRAWING:
        figure = Figure(figsize=SIZE)
        panels = figure.subplots(1, max(len(names), 1), squeeze=False)[0]
        figure.subplots_adjust(left=0.045, right=0.985, top=0.77, bottom=0.22, wspace=0.17)
        for name, axes in zip(names, panels, strict=False):
            _draw(axes, name, series, labels)
        lines = panels[0].get_legend_handles_labels()
        figure.legend(*lines, loc="upper right", bbox_to_anchor=(1.0, 1.04), ncols=2, fontsize=9.5, frameon=False)
        return _png(figure)


def main_reports(series: Sequence[Series]) -> list[str]:
    """Return the names of what is drawn: what the model itself reports before what all models do.

    Examples
    --------
    >>> main_reports([{"collisions": np.array([0]), "groups": np.array([1])}])
    ['groups', 'collisions']
    """
    names = dict.fromkeys(name for one in series for name in one)
    return sorted(names, key=lambda name: LAST.index(name) if name in LAST else -1)[:MOST_PANELS]


def _draw(axes: Axes, name: str, series: Sequence[Series], labels: Sequence[str]) -> None:
    for one, label, (colour, style) in zip(series, labels, STYLES, strict=True):
        if name in one:
            means = window_means(one[name].astype(float), CORNERS)
            axes.plot(*means, style, color=colour, linewidth=1.8, label=literal(label))
    axes.set_title(literal(name.replace("_", " ")), fontsize=11, loc="left", color=INK)
    axes.set_xlabel("step", fontsize=9, labelpad=1)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    counts = all(one[name].dtype.kind in "bui" for one in series if name in one)
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=counts, min_n_ticks=1))
    axes.tick_params(labelsize=9)
    axes.grid(axis="y", color="#dddddd", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlim(0, max(1, *(len(one.get(name, ())) for one in series)))
    if all(one[name].min(initial=0.0) >= 0.0 for one in series if name in one):
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
