"""Figures of comparisons, distributions and paired differences, and of sensitivity and calibration."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator, StrMethodFormatter

from mesa_swarm.base.wording import quantity
from mesa_swarm.experiments.plan import PairedRuns
from mesa_swarm.experiments.sampling import Range
from mesa_swarm.experiments.statistics import TIME, Interval, bootstrap_mean, pair_differences, summarised
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.figures import literal, plain_figure, plain_panels, png
from mesa_swarm.viewing.final_state import FinalState, final_state_of
from mesa_swarm.viewing.palette import LIGHT
from mesa_swarm.viewing.pictures import world_figure

# Of a screen in a lecture room: 16 to 9, letters that can be read from the last row.
WIDE = (12.8, 7.2)
TITLE, TEXT = 17, 14
MOST_ROWS = 12
# Half the width over which the pairs of one value are spread, as a part of the way to the next value.
SPREAD = 0.28
# Distance of a mean from its runs, likewise.
ASIDE = 0.14
# As parts of the range of all numbers: how far beyond it missing numbers are drawn, half the width of that lane, and
# where the axis of numbers ends.
LANE, BROAD, END = 0.3, 0.13, 0.08
# Ranges of larger numbers are beyond what an axis can compute.
LARGEST = 1e300


def main_measure(comparison: PairedRuns) -> str:
    """Return the main measure of a comparison: the model's headline if it was measured, else the first."""
    headline: str = getattr(comparison.plan.model_class, "headline", ("",))[0]
    return headline if headline in comparison.measures else comparison.measures[0]


def comparison_figure(comparison: PairedRuns, measures: Sequence[str]) -> Figure:
    """Return a figure with a row for each measure: on the left all runs, on the right differences on the same seed.

    A thin line is a seed. Rings are means, and bars their 95 % intervals, beside the runs and not upon them. An
    interval of the differences that excludes 0 is drawn in orange. Times that did not occur are drawn on a
    dotted line beyond a gap, where the axis has ended.
    """
    rows = list(measures)[:MOST_ROWS]
    size = WIDE if len(rows) == 1 else (WIDE[0], 3.4 * len(rows))
    figure, panels = plain_figure(size, len(rows), 2, letters=TEXT - 2, width_ratios=(1.15, 1))
    plan = comparison.plan
    title = f"{plan.model_class.__name__}: {plan.parameter} compared over {quantity(len(plan.seeds), 'seed')}"
    figure.suptitle(literal(title), fontsize=TITLE)
    for measure, (left, right) in zip(rows, panels, strict=True):
        _draw_runs(left, comparison, measure)
        _draw_differences(right, comparison, measure)
    return figure


def _draw_runs(axes: Axes, comparison: PairedRuns, measure: str) -> None:
    """Draw every run, those of one seed joined, and the mean under each value."""
    plan = comparison.plan
    places = places_of(plan.values)
    columns = np.array([comparison.column(value, measure) for value in plan.values], float)
    if measure.endswith(TIME):
        axes.yaxis.set_major_locator(MaxNLocator("auto", integer=True, min_n_ticks=1))
        if np.isnan(columns).any():
            _name_lane(axes, columns, 1, f"not by step {plan.steps:,}")
            _end_axis(axes, columns)
            columns = np.where(np.isnan(columns), _lane(columns, 1), columns)
    columns = with_lanes_beyond(axes, drawable(columns))
    faint = min(0.8, 8 / columns.shape[1] + 0.12)
    axes.plot(places, columns, "o-", color=LIGHT.faint, linewidth=0.8, markersize=5, alpha=faint)
    nearest = float(np.diff(np.sort(places)).min())
    for i, (place, value) in enumerate(zip(places, plan.values, strict=True)):
        aside = ASIDE * nearest * (1 if i else -1)  # the first to the left, where no lines are
        draw_interval(axes, place + aside, summarised(comparison.column(value, measure)).mean, LIGHT.series[0])
    axes.set_xlim(places.min() - 0.3 * nearest, places.max() + 0.3 * nearest)
    axes.set_title(literal(fill(measure, 45, break_long_words=False)), fontsize=TEXT)
    _label_values(axes, comparison, measure, places, plan.values)


def _draw_differences(axes: Axes, comparison: PairedRuns, measure: str) -> None:
    """Draw the difference of every pair, and their mean, under each value but the first."""
    first, *others = comparison.plan.values
    everywhere = places_of(comparison.plan.values)
    reach = SPREAD * float(np.diff(np.sort(everywhere)).min())
    base = comparison.column(first, measure)
    pairs = {value: _pairs(base, comparison.column(value, measure), measure) for value in others}
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=measure.endswith(TIME), min_n_ticks=1))
    _name_lanes(axes, pairs, first if measure.endswith(TIME) else None)
    below, above = (_lane(np.concatenate([[0.0], *pairs.values()]), side) for side in (-1, 1))
    axes.axhline(0, color=LIGHT.ink, linewidth=1.2)
    for place, (value, differences) in zip(everywhere[1:], pairs.items(), strict=True):
        heights = np.clip(differences, below, above)
        axes.plot(place + spread_out(len(heights), reach), heights, "o", color=LIGHT.faint, markersize=6, alpha=0.7)
        mean = bootstrap_mean(pair_differences(base, comparison.column(value, measure)))
        draw_interval(axes, place + 1.5 * reach, mean, LIGHT.series[1] if mean.excludes_zero else LIGHT.series[0])
    axes.set_xlim(everywhere[1:].min() - 2 * reach, everywhere[1:].max() + 2.5 * reach)
    axes.set_title(literal(fill(f"minus {comparison.plan.parameter} {first}, on the same seed", 32)), fontsize=TEXT)
    _label_values(axes, comparison, measure, everywhere[1:], others, paired=True)


def _pairs(base: Sequence[float | None], column: Sequence[float | None], measure: str) -> np.ndarray:
    """Return the differences in rising order; of times infinite ones too, where one of the two did not occur."""
    differences = np.array(pair_differences(base, column), float)
    if measure.endswith(TIME):
        never = [(a is None) - (b is None) for a, b in zip(base, column, strict=True)]
        differences = np.concatenate([differences, [-np.inf * side for side in never if side]])
    return np.sort(drawable(differences))


def drawable(numbers: np.ndarray) -> np.ndarray:
    """Return numbers, infinite where they are too large for an axis."""
    return np.where(np.abs(numbers) > LARGEST, np.copysign(np.inf, numbers), numbers)


def with_lanes_beyond(axes: Axes, numbers: np.ndarray) -> np.ndarray:
    """Return numbers to draw, infinite ones at lanes beyond the others, which are labelled."""
    drawn = numbers
    for side in (-1, 1):
        is_beyond = numbers == side * np.inf
        if is_beyond.any():
            _name_lane(axes, numbers, side, f"beyond {side * LARGEST:g}")
            _end_axis(axes, numbers)
            drawn = np.where(is_beyond, _lane(numbers, side), drawn)
    return drawn


def _name_lanes(axes: Axes, pairs: dict[Any, np.ndarray], first: Any) -> None:
    """Label where pairs are of which one did not occur, with the first value or another; without it, infinite ones."""
    together = np.concatenate([[0.0], *pairs.values()])
    other = next(iter(pairs)) if len(pairs) == 1 else "this"
    for side, never in ((-1, first), (1, other)):
        if (together == side * np.inf).any():
            _name_lane(axes, together, side, f"beyond {side * LARGEST:g}" if first is None else f"never with {never}")
            _end_axis(axes, together)
    if not np.isfinite(together[1:]).any():
        axes.yaxis.set_major_locator(FixedLocator([0]))
        axes.text(0.5, 0.6, "on no seed with both", transform=axes.transAxes, ha="center", fontsize=TEXT)


def _reach(numbers: np.ndarray) -> tuple[float, float, float]:
    """Return the smallest and the largest of the finite numbers, and their difference."""
    finite = numbers[np.isfinite(numbers)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return low, high, (high - low) or 1.0


def _lane(numbers: np.ndarray, side: int) -> float:
    """Return where to draw missing numbers: beyond a gap after all others."""
    low, high, span = _reach(numbers)
    return high + LANE * span if side > 0 else low - LANE * span


def _name_lane(axes: Axes, numbers: np.ndarray, side: int, text: str) -> None:
    """Draw and label the place of missing numbers."""
    lane, half = _lane(numbers, side), BROAD * _reach(numbers)[2]
    axes.axhspan(lane - half, lane + half, color=LIGHT.band, linewidth=0, zorder=0)
    axes.axhline(lane, color=LIGHT.ink, linewidth=0.8, linestyle=":")
    above = ("axes fraction", "data")
    axes.annotate(literal(text), (0.5, lane), (0, 6), above, "offset points", ha="center", fontsize=TEXT - 2)


def _end_axis(axes: Axes, numbers: np.ndarray) -> None:
    """Let the axis and its labels end with the numbers."""
    if not np.isfinite(numbers).any():
        axes.yaxis.set_major_locator(FixedLocator([]))
        axes.spines["left"].set_visible(False)
        return
    low, high, span = _reach(numbers)
    first, last = low - END * span, high + END * span
    ticks = np.asarray(axes.yaxis.get_major_locator().tick_values(low, high))
    axes.yaxis.set_major_locator(FixedLocator(ticks[(first <= ticks) & (ticks <= last)].tolist()))
    axes.update_datalim([(0.0, first), (0.0, last)], updatex=False)
    axes.spines["left"].set_bounds(first, last)


def places_of(values: Sequence[Any]) -> np.ndarray:
    """Return the positions of values on an axis: rising numbers by value, others one after the other."""
    numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
    if numbers and all(a < b for a, b in pairwise(values)):
        return np.array(values, float)
    return np.arange(len(values), dtype=float)


def spread_out(n: int, reach: float) -> np.ndarray:
    """Return offsets of n dots beside each other."""
    return np.linspace(-reach, reach, n) if n > 1 else np.zeros(n)


def draw_interval(axes: Axes, place: float, interval: Interval, colour: str) -> None:
    """Draw an estimate as a ring and its interval as a bar, upright at a place, unless it is beyond all axes."""
    if not abs(interval.estimate) <= LARGEST:
        return
    if max(abs(interval.low), abs(interval.high)) <= LARGEST:
        axes.plot([place, place], [interval.low, interval.high], color=colour, linewidth=4, solid_capstyle="butt")
    axes.plot(
        place, interval.estimate, "o", color=colour, markersize=11, markerfacecolor=LIGHT.field, markeredgewidth=3
    )


def _label_values(
    axes: Axes, comparison: PairedRuns, measure: str, places: np.ndarray, values: Sequence[Any], paired: bool = False
) -> None:
    """Name the values below the axis, with the number of runs in which it occurred if not in all."""
    plan = comparison.plan
    labels = [f"{literal(str(value))}{_count(comparison, measure, value, paired)}" for value in values]
    turned: dict[str, Any] = {"rotation": 45, "ha": "right"} if len(labels) * max(map(len, labels)) > 60 else {}
    axes.set_xticks(places, labels, **turned)
    axes.set_xlabel(literal(plan.parameter), fontsize=TEXT)
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:,.6g}"))


def _count(comparison: PairedRuns, measure: str, value: Any, paired: bool) -> str:
    column = comparison.column(value, measure)
    first = comparison.column(comparison.plan.values[0], measure)
    n = len(pair_differences(first, column)) if paired else sum(number is not None for number in column)
    return f"\n{n} of {len(column)} {'pairs' if paired else 'runs'}" if n < len(column) else ""


COLOURS = LIGHT.series
MOST_PICTURED = 6


def comparison_pictures(comparison: PairedRuns) -> dict[str, bytes]:
    """Return the PNGs of a comparison by file name: of all pairs, and of the first seed under its first six values."""
    plan = comparison.plan
    portraits = {
        f"{plan.model_class.__name__}, {plan.parameter} {value}, seed {plan.seeds[0]}": portrait
        for value, portrait in list(comparison.portraits.items())[:MOST_PICTURED]
    }
    worlds = {f"{title}, step {portrait.frame.step:,}": portrait for title, portrait in portraits.items()}
    pictures = {"comparison.png": comparison_figure(comparison, [main_measure(comparison)])}
    if len(comparison.measures) > 1:
        pictures["comparison_all.png"] = comparison_figure(comparison, comparison.measures)
    pictures["final_state.png"] = world_figure(worlds)
    if all(portrait.history["robots"].size for portrait in portraits.values()):
        pictures["robots_at_fires.png"] = fires_figure(portraits)
    elif all(portrait.series for portrait in portraits.values()):
        pictures["over_time.png"] = series_figure(portraits)
    return {name: png(figure) for name, figure in pictures.items()}


def fires_figure(runs: Mapping[str, FinalState | SwarmModel]) -> Figure:
    """Return a figure of the robots at each fire over time, -1 once it is out: a block for each run, a strip a fire."""
    states = (run if isinstance(run, FinalState) else final_state_of(run) for run in runs.values())
    histories = {title: state.history for title, state in zip(runs, states, strict=True)}
    strips = max(history["robots"].shape[1] for history in histories.values())
    last = max(history["steps"][-1] for history in histories.values())
    most = max(history["robots"].max() for history in histories.values())
    figure = Figure(figsize=(7.5, (0.5 * strips + 0.8) * len(histories)), layout="constrained")
    blocks = figure.subfigures(len(histories), 1, squeeze=False).ravel()
    for block, (title, history) in zip(blocks, histories.items(), strict=True):
        _draw_block(block, title, history, (last, max(most, 1)))
    return figure


def _draw_block(block: SubFigure, title: str, history: dict[str, np.ndarray], limits: tuple[int, int]) -> None:
    last, most = limits
    robots = history["robots"]
    strips = plain_panels(block, robots.shape[1], letters=7, sharex=True, sharey=True).ravel()
    for i, axes in enumerate(strips):
        _draw_strip(axes, i, *_held(history["steps"], robots[:, i], last))
    strips[0].set(xlim=(0, last), ylim=(-1.6, most + 0.6), yticks=[-1, most])
    strips[-1].xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    strips[-1].set_xlabel("step", fontsize=9)
    block.suptitle(literal(title), fontsize=11)
    block.supylabel("robots at the fire (-1 and grey: out)", fontsize=9)


def _held(steps: np.ndarray, robots: np.ndarray, last: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a fire's history, held until the last step of all if it is out: 0 is absorbing."""
    if robots[-1] >= 0:
        return steps, robots
    return np.append(steps, last), np.append(robots, -1)


def _draw_strip(axes: Axes, i: int, steps: np.ndarray, robots: np.ndarray) -> None:
    colour = COLOURS[i % len(COLOURS)]
    burning = np.where(robots >= 0, robots, np.nan)
    out = np.where(robots < 0, robots, np.nan)
    axes.axhline(0, color=LIGHT.ink, linewidth=0.3)
    axes.fill_between(steps, burning, step="post", color=colour, alpha=0.35, linewidth=0)
    axes.step(steps, burning, where="post", color=colour, linewidth=1.0, label=f"fire {i + 1}")
    axes.step(steps, out, where="post", color=LIGHT.faint, linewidth=2.5, label="out", solid_capstyle="butt")
    axes.set_ylabel(f"fire {i + 1}", rotation=0, ha="right", va="center", fontsize=9)
    axes.tick_params(length=2)


def series_figure(portraits: dict[str, FinalState]) -> Figure:
    """Return a figure of the variables that were collected in every step, a panel for each.

    Lines are means over a fortieth of the steps, so that rare events can be seen as rates.
    """
    names = list(next(iter(portraits.values())).series)
    figure, grid = plain_figure((7.5, 2.3 * len(names) + 0.4), len(names), sharex=True)
    panels = grid[:, 0]
    for name, axes in zip(names, panels, strict=True):
        _draw_series(axes, name, portraits)
    panels[-1].set_xlabel("step")
    panels[-1].xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    panels[0].set_xlim(left=0)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", fontsize=9, frameon=False)
    return figure


def _draw_series(axes: Axes, name: str, portraits: dict[str, FinalState]) -> None:
    windows = [window_means(portrait.series[name]) for portrait in portraits.values()]
    axes.yaxis.set_major_locator(MaxNLocator(5))
    drawn = with_lanes_beyond(axes, drawable(np.concatenate([means for _, means in windows])))
    ends = np.cumsum([len(means) for _, means in windows])
    curves = np.split(drawn, ends[:-1])
    for i, ((title, portrait), (rows, _), means) in enumerate(zip(portraits.items(), windows, curves, strict=True)):
        steps = rows * portrait.collect_every
        style = ("-", "--", "-.", ":")[i % 4]
        axes.plot(steps, means, style, color=COLOURS[i % len(COLOURS)], linewidth=1.4, label=literal(title))
    axes.set_ylabel(literal(f"{name.replace('_', ' ')}\n(window mean)"), fontsize=9)
    axes.margins(x=0)


def window_means(values: np.ndarray, windows: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles (in steps, counted from 1) and means of equal windows over a series."""
    parts = np.array_split(np.arange(len(values)), max(min(windows, len(values)), 1))
    middles = np.array([part.mean() + 1 for part in parts if len(part)])
    with np.errstate(over="ignore"):  # a mean that is too large is infinite
        return middles, np.array([values[part].mean() for part in parts if len(part)])


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
    figure, above, below = _halves(title, 4.2, len(names))
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
    figure, above, below = _halves(title, 3.6, len(names))
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


def _halves(title: str, height: float, panels: int) -> tuple[Figure, SubFigure, SubFigure]:
    """Return a figure, its upper part of this height, with the title, and its lower one with room for panels."""
    below = 2.7 * -(-panels // IN_A_ROW)
    figure = Figure(figsize=(WIDE[0], height + below), layout="constrained")
    halves = figure.subfigures(2, 1, squeeze=False, height_ratios=(height, below))
    halves[0, 0].suptitle(literal(title), fontsize=TITLE)
    return figure, halves[0, 0], halves[1, 0]


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
