"""What a chart shows: measurements over time, a histogram of robots, a phase plot; as numbers, table and picture."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from mesa_swarm.dashboard.robot_columns import Bins, Quantity, RobotValues, binned
from mesa_swarm.dashboard.series import ChartTable, Curves, Plot, row_until
from mesa_swarm.errors import InvalidValueError, UnknownNameError, unknown_name
from mesa_swarm.viewing import palette
from mesa_swarm.viewing.faults import reported
from mesa_swarm.viewing.figures import literal, plain_figure
from mesa_swarm.wording import quantity

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
        known = values[np.isfinite(values)]
        if not log or not len(known):
            return cls(label)
        least = float(known.min())
        return cls(label, True) if least > 0 else cls(label, False, f"no log axis: the least value is {least:.4g}")


@dataclass(frozen=True, slots=True, eq=False)
class TimeContent:
    """A chart over time: its curves, the exact last or displayed row, its axes."""

    chart: Plot
    curves: Curves
    row: tuple[int, np.ndarray] | None
    x: Axis
    y: Axis

    @classmethod
    def of(
        cls, series: ChartTable, chosen: ChosenChart, most: int = MOST_POINTS, step: int | None = None
    ) -> "TimeContent":
        """Return the content of a chart of a series, with the exact row of a step."""
        chart, curves = series.chart(chosen.what), series.curves(chosen.what, most)
        y = Axis.of(label_of(chart), curves.low, "y" in chosen.log)
        return cls(chart, curves, series.exact(chosen.what, step), Axis(time_label(series)), y)


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
    def of(cls, robots: RobotValues, chosen: ChosenChart) -> "HistogramContent":
        """Return the histogram of a quantity; without values where it is not known at that step."""
        quantity = robots.quantities.get(chosen.what)
        if quantity is None:
            missing = Axis(chosen.what, False, robots.missing or "there are no robots")
            nothing = Quantity(chosen.what, "", lambda: np.empty(0))
            return cls(nothing, robots.step, np.empty(0), binned(np.empty(0)), missing, Axis("robots"))
        try:
            values = quantity.measure()
        except Exception as problem:  # a function of a user's may raise anything
            return cls.of(RobotValues(robots.step, missing=reported(problem)), chosen)
        x = Axis.of(quantity.label, values, "x" in chosen.log)
        bins = binned(values, log=x.log, is_direction=quantity.is_direction)
        return cls(quantity, robots.step, values, bins, x, Axis("robots"))

    @property
    def summary(self) -> str:
        """The number of robots, their mean, and the sample standard deviation."""
        known = self.values[np.isfinite(self.values)]
        words = [quantity(len(known), "robot")]
        if len(known) and not self.quantity.is_direction:
            words.append(f"mean {known.mean():.4g}")
            words += [f"standard deviation {known.std(ddof=1):.3g}"] if len(known) > 1 else []
        return ", ".join(words)

    @property
    def note(self) -> str:
        """Why an axis is not as chosen, and how many robots have no value."""
        without = self.bins.without
        words = f"{without:,} robot{' has' if without == 1 else 's have'} no value" if without else ""
        return "; ".join(filter(None, [self.x.note, words]))


@dataclass(frozen=True, slots=True, eq=False)
class PhaseContent:
    """One curve against another, in the order of time; `mark` is the present or displayed point."""

    steps: np.ndarray
    across: np.ndarray
    up: np.ndarray
    mark: tuple[int, np.ndarray] | None
    x: Axis
    y: Axis

    @classmethod
    def of(
        cls, series: ChartTable, chosen: ChosenChart, most: int = MOST_PHASE_POINTS, step: int | None = None
    ) -> "PhaseContent":
        """Return the points of two curves of a series, all of them exact, and the last one of all among them."""
        (steps, across, below), (later, up, beside) = (curve_of(series, one) for one in (chosen.against, chosen.what))
        both = min(len(steps), len(later))  # a row may have been added between the two
        steps, across, up = steps[:both], across[:both], up[:both]
        x, y = Axis.of(below, across, "x" in chosen.log), Axis.of(beside, up, "y" in chosen.log)
        mark = row_until(steps, np.column_stack([across, up]), step)
        shown = thinned(both, most)
        return cls(steps[shown], across[shown], up[shown], mark, x, y)


def curve_of(series: ChartTable, label: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Return steps and numbers of a curve by its label, and the label with its unit."""
    labels = series.labels()
    if label not in labels:
        raise UnknownNameError(unknown_name("curve", label, labels))
    key, k = labels[label]
    steps, rows = series.rows(key)
    return steps, rows[:, k], with_unit(label, series.chart(key))


def thinned(count: int, most: int) -> np.ndarray:
    """Return at most `most` + 1 places of `count` ones, evenly from the first on, and the last one.

    Examples
    --------
    >>> thinned(10, 4)
    array([0, 4, 8, 9])
    """
    stride = 1
    while -(-count // stride) > most:
        stride *= 2
    places = np.arange(0, count, stride)
    return places if not count or places[-1] == count - 1 else np.append(places, count - 1)


def title_of(chosen: ChosenChart, series: ChartTable) -> str:
    """Return the title of a chart."""
    if chosen.kind == OVER_TIME:
        return series.chart(chosen.what).title
    return f"{chosen.what} against {chosen.against}" if chosen.kind == PHASE_PLOT else f"Histogram of {chosen.what}"


def csv_of(series: ChartTable, key: str) -> bytes:
    """Return all stored rows of one chart as CSV, with units in the header."""
    chart, (steps, rows) = series.chart(key), series.rows(key)
    columns = {with_unit(name, chart): column for name, column in zip(chart.names, rows.T, strict=True)}
    return written({**times_of(series, steps), **{name: in_whole(c) for name, c in columns.items()}})


def histogram_csv(content: HistogramContent) -> bytes:
    """Return the bins of a histogram as CSV: from, to, robots."""
    label, edges = content.quantity.label, content.bins.edges
    return written({f"{label} from": edges[:-1], f"{label} to": edges[1:], "robots": content.bins.counts})


def phase_csv(series: ChartTable, chosen: ChosenChart) -> bytes:
    """Return all stored points of a phase plot as CSV."""
    content = PhaseContent.of(series, chosen, most=sys.maxsize)
    columns = {content.x.label: in_whole(content.across), content.y.label: in_whole(content.up)}
    return written({**times_of(series, content.steps), **columns})


def times_of(series: ChartTable, steps: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of steps, and of times if they are known."""
    return {"step": steps, **({} if series.seconds is None else {"time (s)": steps * series.seconds})}


def in_whole(column: np.ndarray) -> Any:
    """Return a column as whole numbers, if it has no others."""
    is_whole = (np.isnan(column) | ((column == np.rint(column)) & (np.abs(column) < LARGEST_WHOLE))).all()
    return pd.array(column, "Int64") if is_whole else column


def written(columns: dict[str, Any]) -> bytes:
    """Return columns as CSV."""
    return pd.DataFrame(columns).to_csv(index=False, lineterminator="\n").encode()


def with_unit(name: str, chart: Plot) -> str:
    """Return a curve's name, with its unit if it has one."""
    return f"{name} ({chart.unit})" if chart.unit else name


def label_of(chart: Plot) -> str:
    """Return the name and the unit of the y axis of a chart over time; a title may name the unit itself."""
    return chart.title if chart.unit.lower() in chart.title.lower() else with_unit(chart.title, chart)


def time_label(series: ChartTable) -> str:
    """Return the name and the unit of the axis of time."""
    return "step" if series.seconds is None else "time (s)"


def figure_of(series: ChartTable, key: str, log: str = "") -> Figure:
    """Return one chart as a figure for print: lines are means of groups of steps, bands their ranges."""
    content = TimeContent.of(series, ChosenChart(OVER_TIME, key, log=log), POINTS_OF_A_PICTURE)
    chart, curves = content.chart, content.curves
    figure, axes = _figure(content.x, content.y, chart.title)
    colours = colours_of(chart)
    times = curves.steps * (series.seconds or 1)
    for k, name in enumerate(chart.names):
        colour, dashes = colours[k % len(colours)], DASHES[k // len(colours) % len(DASHES)]
        axes.plot(times, curves.mean[k], label=literal(name), linewidth=1.3, color=colour, linestyle=dashes)
        if curves.width > 1 and len(chart.names) <= 3:
            axes.fill_between(times, curves.low[k], curves.high[k], color=colour, alpha=0.15, linewidth=0)
    if len(chart.names) > 1:
        figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    return figure


def histogram_figure(content: HistogramContent) -> Figure:
    """Return a histogram as a figure for print."""
    figure, axes = _figure(content.x, content.y, f"Step {content.step:,}: {content.summary}")
    edges = content.bins.edges
    axes.bar(edges[:-1], content.bins.counts, np.diff(edges), align="edge", color=palette.LIGHT.series[0], alpha=0.85)
    if content.quantity.is_direction:
        axes.set_xticks(range(-180, 181, 90))
    return figure


def phase_figure(series: ChartTable, chosen: ChosenChart, step: int | None = None) -> Figure:
    """Return a phase plot as a figure for print: coloured along time, with the present or displayed point."""
    content = PhaseContent.of(series, chosen, POINTS_OF_A_PICTURE, step)
    figure, axes = _figure(content.x, content.y, title_of(chosen, series))
    points = np.column_stack([content.across, content.up])
    times = content.steps * (series.seconds or 1)
    colours = ListedColormap(palette.LIGHT.values)
    norm = Normalize(times[0], max(times[-1], times[0] + 1)) if len(times) else Normalize(0, 1)
    lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap=colours, norm=norm, linewidths=1.2)
    lines.set_array(times[1:].astype(float))
    axes.add_collection(lines)
    if len(points):
        axes.scatter(content.across, content.up, c=times, cmap=colours, norm=norm, s=4)
    if content.mark is not None:
        axes.plot(*content.mark[1], "o", markersize=8, markerfacecolor="none", color=palette.LIGHT.selection)
    figure.colorbar(lines, ax=axes, label=time_label(series))
    return figure


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
