"""Figures of sensitivity and calibration."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from mesa_swarm.experiments.calibration import LOSS, Calibration
from mesa_swarm.experiments.figures import ASIDE, TEXT, TITLE, WIDE, draw_interval
from mesa_swarm.experiments.sampling import Range
from mesa_swarm.experiments.sensitivity import RANKING, Sensitivity
from mesa_swarm.viewing.palette import LIGHT
from mesa_swarm.viewing.pictures import literal
from mesa_swarm.wording import quantity

# Panels of parameters in a row, and at most.
IN_A_ROW = 4
MOST_PANELS = 12
SMALL = 11


def sensitivity_figure(found: Sensitivity) -> Figure:
    """Return a figure: above the indices with their intervals, below the measure at all points over each parameter.

    The parameters are ranked. A dotted line is the ranking index that seeds alone give a parameter without effect.
    """
    names = found.ranked()[:MOST_PANELS]
    rows = -(-len(names) // IN_A_ROW)
    figure = Figure(figsize=(WIDE[0], 4.2 + 2.7 * rows), layout="constrained")
    above, below = _halves(figure, 4.2, 2.7 * rows)
    title = f"{found.experiment.model_class.__name__}: {found.plan.title}, {quantity(len(found.shares), 'point')}"
    above.suptitle(literal(f"{title}, {quantity(len(found.experiment.seeds), 'seed')}"), fontsize=TITLE)
    panels = np.ravel(above.subplots(1, 1 if found.plan.method == "sobol" else 2))
    _draw_indices(panels[0], found, names)
    for panel in panels[1:]:
        _draw_plane(panel, found, names)
    panels_of = dict(zip(names, _panels(below, len(names)), strict=True))
    means = found.numbers.mean(axis=1)
    for (name, each), column in zip(found.plan.ranges.items(), found.shares.T, strict=True):
        if name in panels_of:
            _draw_over(panels_of[name], name, each, each.at(column), means)
    below.supylabel("mean over seeds", fontsize=SMALL)
    return figure


def _draw_indices(axes: Axes, found: Sensitivity, names: list[str]) -> None:
    """Draw S1 and ST side by side, or mu*, at each parameter."""
    shown = list(found.indices) if found.plan.method == "sobol" else [RANKING["morris"]]
    for k, index in enumerate(shown):
        colour = LIGHT.series[k]
        for place, name in enumerate(names):
            aside = ASIDE * (2 * k - len(shown) + 1)
            draw_interval(axes, place + aside, found.indices[index][name], colour)
        axes.plot([], [], "o-", color=colour, markerfacecolor=LIGHT.field, linewidth=4, label=index)
    axes.axhline(0, color=LIGHT.ink, linewidth=1.2)
    if found.floor > 0:
        axes.axhline(found.floor, color=LIGHT.ink, linewidth=1, linestyle=":", label="by chance")
    axes.set_xticks(range(len(names)), [literal(name) for name in names])
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.tick_params(labelsize=TEXT - 2)
    axes.set_ylabel("share of variance" if found.plan.method == "sobol" else "effect over the range", fontsize=TEXT)
    axes.legend(fontsize=TEXT - 2, frameon=False)
    _plain(axes)


def _draw_plane(axes: Axes, found: Sensitivity, names: list[str]) -> None:
    """Draw Morris's plane: how much the effect of a parameter depends on the others, over its mean size."""
    for name in names:
        x, y = (found.indices[index][name].estimate for index in ("mu*", "sigma"))
        axes.plot(x, y, "o", color=LIGHT.series[0], markersize=9)
        axes.annotate(literal(name), (x, y), (7, 5), textcoords="offset points", fontsize=TEXT - 2)
    axes.margins(0.15)
    axes.set_xlabel("mu*", fontsize=TEXT)
    axes.set_ylabel("sigma: interactions and curvature", fontsize=TEXT)
    axes.tick_params(labelsize=TEXT - 2)
    _plain(axes)


def _draw_over(axes: Axes, name: str, each: Range, values: Any, heights: np.ndarray) -> None:
    """Draw numbers over the values of a parameter."""
    if each.values:
        axes.set_xticks(range(len(each.values)), [literal(str(value)) for value in each.values])
        axes.set_xlim(-0.5, len(each.values) - 0.5)
    else:
        axes.set_xscale("log" if each.log else "linear")
    faint = float(np.clip(60 / max(len(heights), 1), 0.15, 0.7))
    axes.plot(_places(each, values), heights, "o", color=LIGHT.series[0], markersize=4, alpha=faint, markeredgewidth=0)
    axes.set_xlabel(literal(f"{name}{', log' if each.log else ''}"), fontsize=SMALL)
    _plain(axes)


def _places(each: Range, values: Any) -> np.ndarray:
    """Return where the values of a parameter are on its axis: listed ones one after the other."""
    return np.array([each.values.index(value) for value in values] if each.values else values, float)


def calibration_figure(found: Calibration) -> Figure:
    """Return a figure: above the loss of all points in their order, below over each parameter; the best one is ringed.

    A line is the least loss so far.
    """
    history, ranges = found.history, found.ranges
    names = list(ranges)[:MOST_PANELS]
    rows = -(-len(names) // IN_A_ROW)
    figure = Figure(figsize=(WIDE[0], 3.6 + 2.7 * rows), layout="constrained")
    above, below = _halves(figure, 3.6, 2.7 * rows)
    title = f"{found.experiment.model_class.__name__}: {quantity(len(history), 'point')} of a search"
    above.suptitle(literal(f"{title}, {quantity(len(found.experiment.seeds), 'seed')} at each"), fontsize=TITLE)
    losses = history[LOSS].to_numpy(float)
    axes = above.subplots()
    axes.plot(losses, "o", color=LIGHT.faint, markersize=5, label="a point")
    axes.plot(np.fmin.accumulate(losses), color=LIGHT.series[0], linewidth=2, drawstyle="steps-post", label="least")
    axes.plot(found.point, losses[found.point], "o", label="best", **_ring())
    axes.set_xlabel("point", fontsize=TEXT)
    axes.set_ylabel("loss", fontsize=TEXT)
    axes.legend(fontsize=TEXT - 2, frameon=False)
    axes.tick_params(labelsize=TEXT - 2)
    _by_ratio(axes, losses)
    _plain(axes)
    for panel, name in zip(_panels(below, len(names)), names, strict=True):
        _draw_over(panel, name, ranges[name], list(history[name]), losses)
        panel.plot(_places(ranges[name], [found.best[name]]), losses[found.point], "o", **_ring())
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
    grid = np.ravel(figure.subplots(-(-count // IN_A_ROW), min(count, IN_A_ROW), squeeze=False, sharey=True))
    for axes in grid[count:]:
        axes.set_visible(False)
    return list(grid[:count])


def _by_ratio(axes: Axes, losses: np.ndarray) -> None:
    """Draw losses on a logarithmic axis if all of them are above 0."""
    if np.nanmin(losses) > 0:
        axes.set_yscale("log")


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
