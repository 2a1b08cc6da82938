"""Figures of sensitivity and calibration."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator, NullLocator

from mesa_swarm.experiments.figures import ASIDE, TEXT, TITLE, WIDE, draw_interval
from mesa_swarm.experiments.sampling import Range
from mesa_swarm.experiments.statistics import Interval
from mesa_swarm.viewing.figures import literal, plain_panels
from mesa_swarm.viewing.palette import LIGHT

# Panels of parameters in a row, and at most.
IN_A_ROW = 4
MOST_PANELS = 12
SMALL = 11


def sensitivity_figure(
    title: str,
    indices: Mapping[str, Mapping[str, Interval]],
    points: Mapping[str, tuple[Range, Sequence | np.ndarray]],
    means: np.ndarray,
    *,
    floor: float,
) -> Figure:
    """Return a figure: above the indices with their intervals, below the measure at all points over each parameter.

    Parameters
    ----------
    title : str
    indices : mapping of str to mapping of str to Interval
        S1 and ST, or mu*, mu and sigma, of each parameter.
    points : mapping of str to (Range, values)
        Of each parameter, in the order in which they are drawn; the first twelve are.
    means : ndarray
        The measure at each point.
    floor : float
        The index that chance alone gives, a dotted line; NaN if that is not known.
    """
    names = list(points)[:MOST_PANELS]
    below_height = 2.7 * -(-len(names) // IN_A_ROW)
    figure = Figure(figsize=(WIDE[0], 4.2 + below_height), layout="constrained")
    above, below = _halves(figure, 4.2, below_height)
    above.suptitle(literal(title), fontsize=TITLE)
    is_plane = "sigma" in indices
    sides = plain_panels(above, 1, 1 + is_plane, letters=TEXT - 2, grid=True)[0]
    _draw_indices(sides[0], {"mu*": indices["mu*"]} if is_plane else indices, names, floor)
    sides[0].set_ylabel("effect over the range" if is_plane else "share of variance", fontsize=TEXT)
    if is_plane:
        _draw_plane(sides[1], indices, names)
    for axes, name in zip(_panels(below, len(names)), names, strict=True):
        _draw_over(axes, name, *points[name], means)
    below.supylabel("mean over seeds", fontsize=SMALL)
    return figure


def _draw_indices(axes: Axes, indices: Mapping[str, Mapping[str, Interval]], names: list[str], floor: float) -> None:
    """Draw indices side by side at each parameter."""
    for k, (index, of) in enumerate(indices.items()):
        colour = LIGHT.series[k]
        for place, name in enumerate(names):
            draw_interval(axes, place + ASIDE * (2 * k - len(indices) + 1), of[name], colour)
        axes.plot([], [], "o-", color=colour, markerfacecolor=LIGHT.field, linewidth=4, label=index)
    axes.axhline(0, color=LIGHT.ink, linewidth=1.2)
    if floor > 0:
        axes.axhline(floor, color=LIGHT.ink, linewidth=1, linestyle=":", label="by chance")
    axes.set_xticks(range(len(names)), [literal(name) for name in names])
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.legend(fontsize=TEXT - 2, frameon=False)


def _draw_plane(axes: Axes, indices: Mapping[str, Mapping[str, Interval]], names: list[str]) -> None:
    """Draw Morris's plane: how much the effect of a parameter depends on the others, over its mean size."""
    places: dict[tuple[float, float], list[str]] = {}
    for name in names:
        x, y = (indices[index][name].estimate for index in ("mu*", "sigma"))
        places.setdefault((x, y), []).append(name)
    for place, there in places.items():  # several without effect are in the same place
        axes.plot(*place, "o", color=LIGHT.series[0], markersize=9)
        axes.annotate(literal(", ".join(there)), place, (7, 5), textcoords="offset points", fontsize=TEXT - 2)
    axes.margins(0.15)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("mu*", fontsize=TEXT)
    axes.set_ylabel("sigma: interactions, curvature", fontsize=TEXT - 2)


def _draw_over(axes: Axes, name: str, each: Range, values: Any, heights: np.ndarray) -> None:
    """Draw numbers over the values of a parameter."""
    if each.values:
        axes.set_xticks(range(len(each.values)), [literal(str(value)) for value in each.values])
        axes.set_xlim(-0.5, len(each.values) - 0.5)
    elif each.low is not None and each.high is not None:
        axes.set_xscale("log" if each.log else "linear")
        if each.is_whole and not each.log:
            axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        axes.set_xlim(*Range(low=float(each.low), high=float(each.high), log=each.log).at(np.array([-0.04, 1.04])))
    if each.log and each.low is not None and each.high is not None:
        ticks = np.geomspace(each.low, each.high, 3)
        axes.set_xticks(ticks, [f"{tick:.3g}" for tick in ticks])
        axes.xaxis.set_minor_locator(NullLocator())
    faint = float(np.clip(60 / max(len(heights), 1), 0.15, 0.7))
    axes.plot(_places(each, values), heights, "o", color=LIGHT.series[0], markersize=4, alpha=faint, markeredgewidth=0)
    axes.set_xlabel(literal(f"{name}{', log' if each.log else ''}"), fontsize=SMALL)


def _places(each: Range, values: Any) -> np.ndarray:
    """Return where the values of a parameter are on its axis: listed ones one after the other."""
    return np.array([each.values.index(value) for value in values] if each.values else values, float)


def calibration_figure(
    title: str, points: Mapping[str, tuple[Range, Sequence | np.ndarray]], losses: np.ndarray, best: int
) -> Figure:
    """Return a figure: above the loss of all points in their order, below over each parameter; the best one is ringed.

    A line is the least loss so far.
    """
    names = list(points)[:MOST_PANELS]
    below_height = 2.7 * -(-len(names) // IN_A_ROW)
    figure = Figure(figsize=(WIDE[0], 3.6 + below_height), layout="constrained")
    above, below = _halves(figure, 3.6, below_height)
    above.suptitle(literal(title), fontsize=TITLE)
    axes = plain_panels(above, letters=TEXT - 2, grid=True)[0, 0]
    axes.plot(losses, "o", color=LIGHT.faint, markersize=5, label="point")
    axes.plot(
        np.fmin.accumulate(losses), color=LIGHT.series[0], linewidth=2, drawstyle="steps-post", label="least so far"
    )
    axes.plot(best, losses[best], "o", label="best", **_ring())
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("point", fontsize=TEXT)
    axes.set_ylabel("loss", fontsize=TEXT)
    axes.legend(fontsize=TEXT - 2, frameon=False)
    _by_ratio(axes, losses)
    for panel, name in zip(_panels(below, len(names)), names, strict=True):
        each, values = points[name]
        _draw_over(panel, name, each, values, losses)
        panel.plot(_places(each, [values[best]]), losses[best], "o", **_ring())
        _by_ratio(panel, losses)
    below.supylabel("loss", fontsize=SMALL)
    return figure


def _ring() -> dict[str, Any]:
    """Return how the best point is drawn."""
    return {"markersize": 12, "markerfacecolor": "none", "markeredgecolor": LIGHT.series[1], "markeredgewidth": 3}


def _halves(figure: Figure, above: float, below: float) -> tuple[SubFigure, SubFigure]:
    """Return the upper and the lower part of a figure, with these heights."""
    halves = figure.subfigures(2, 1, squeeze=False, height_ratios=(above, below))
    return halves[0, 0], halves[1, 0]


def _panels(figure: SubFigure, count: int) -> list[Axes]:
    """Return a number of panels, several in a row, that share the axis of heights."""
    grid = plain_panels(figure, -(-count // IN_A_ROW), min(count, IN_A_ROW), grid=True, sharey=True).ravel()
    for axes in grid[count:]:
        axes.set_visible(False)
    return list(grid[:count])


def _by_ratio(axes: Axes, losses: np.ndarray) -> None:
    """Draw losses on a logarithmic axis if all of them are above 0."""
    if np.nanmin(losses) > 0:
        axes.set_yscale("log")
