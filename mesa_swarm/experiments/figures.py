"""The pictures of a comparison: final states, robots at each fire over time, what was collected over time."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from mesa_swarm.experiments.comparison_figures import comparison_figure, main_measure
from mesa_swarm.experiments.pictures import COOL, INK, literal, png, world_figure
from mesa_swarm.experiments.portrait import Portrait
from mesa_swarm.files import write_all

if TYPE_CHECKING:  # compare imports this module
    from mesa_swarm.experiments.compare import Comparison

COLOURS = (COOL, "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
OUT_COLOUR = "#9a9a9a"
MOST_PICTURED = 6


def comparison_pictures(comparison: "Comparison") -> dict[str, bytes]:
    """Return the PNGs of a comparison by file name: of all pairs, and of the first seed under its first six values.

    Parameters
    ----------
    comparison : Comparison
    """
    plan = comparison.plan
    portraits = {
        f"{plan.model_class.__name__}, {plan.parameter} {value}, seed {plan.seeds[0]}": portrait
        for value, portrait in list(comparison.portraits.items())[:MOST_PICTURED]
    }
    worlds = {f"{title}, step {portrait.steps:,}": portrait for title, portrait in portraits.items()}
    pictures = {"comparison.png": comparison_figure(comparison, [main_measure(comparison)])}
    if len(comparison.measures) > 1:
        pictures["comparison_all.png"] = comparison_figure(comparison, comparison.measures)
    pictures["final_state.png"] = world_figure(worlds)
    if all(portrait.history["robots"].size for portrait in portraits.values()):
        pictures["robots_at_fires.png"] = fires_figure(portraits)
    else:
        pictures["over_time.png"] = series_figure(portraits)
    return {name: png(figure) for name, figure in pictures.items()}


def write_with_pictures(
    folder: Path, tables: Mapping[str, str], pictures: Callable[[], Mapping[str, bytes]]
) -> list[Path]:
    """Write tables and pictures by name, all of them or none, and return their paths.

    What came of runs that may have taken hours is not lost with a picture that cannot be drawn: then the tables are
    written without any, all of them or none, and the error is raised.

    Parameters
    ----------
    folder : Path
    tables : mapping of str to str
    pictures : callable
        Draws them, and returns PNGs by name.
    """
    try:
        drawn = pictures()
    except Exception:
        write_all(folder, tables)
        raise
    return write_all(folder, {**tables, **drawn})


def fires_figure(portraits: dict[str, Portrait]) -> Figure:
    """Return a figure of the robots at each fire over time, -1 once it is out: a block for each portrait.

    Parameters
    ----------
    portraits : dict of Portrait
        By title; each block has one strip a fire, and all share their axes.
    """
    strips = max(portrait.history["robots"].shape[1] for portrait in portraits.values())
    last = max(portrait.history["steps"][-1] for portrait in portraits.values())
    most = max(portrait.history["robots"].max() for portrait in portraits.values())
    figure = Figure(figsize=(7.5, (0.5 * strips + 0.8) * len(portraits)), layout="constrained")
    blocks = figure.subfigures(len(portraits), 1, squeeze=False).ravel()
    for block, (title, portrait) in zip(blocks, portraits.items(), strict=True):
        _draw_block(block, title, portrait.history, (last, max(most, 1)))
    return figure


def _draw_block(block: SubFigure, title: str, history: dict[str, np.ndarray], limits: tuple[int, int]) -> None:
    last, most = limits
    robots = history["robots"]
    strips = block.subplots(robots.shape[1], 1, sharex=True, sharey=True, squeeze=False).ravel()
    for i, axes in enumerate(strips):
        _draw_strip(axes, i, *_held(history["steps"], robots[:, i], last))
    strips[0].set(xlim=(0, last), ylim=(-1.6, most + 0.6), yticks=[-1, most])
    strips[-1].xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    strips[-1].set_xlabel("step", fontsize=9)
    block.suptitle(literal(title), fontsize=11)
    block.supylabel("robots at the fire (-1 and grey: out)", fontsize=9)


def _held(steps: np.ndarray, robots: np.ndarray, last: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a fire's history, held until the last step of all if it is out: it stays out for ever."""
    if robots[-1] >= 0:
        return steps, robots
    return np.append(steps, last), np.append(robots, -1)


def _draw_strip(axes: Axes, i: int, steps: np.ndarray, robots: np.ndarray) -> None:
    colour = COLOURS[i % len(COLOURS)]
    burning = np.where(robots >= 0, robots, np.nan)
    out = np.where(robots < 0, robots, np.nan)
    axes.axhline(0, color=INK, linewidth=0.3)
    axes.fill_between(steps, burning, step="post", color=colour, alpha=0.35, linewidth=0)
    axes.step(steps, burning, where="post", color=colour, linewidth=1.0, label=f"fire {i + 1}")
    axes.step(steps, out, where="post", color=OUT_COLOUR, linewidth=2.5, label="out", solid_capstyle="butt")
    axes.set_ylabel(f"fire {i + 1}", rotation=0, ha="right", va="center", fontsize=9, color=colour)
    axes.tick_params(labelsize=7, length=2)
    axes.spines[["top", "right"]].set_visible(False)


def series_figure(portraits: dict[str, Portrait]) -> Figure:
    """Return a figure of what was collected of the models in every step, a panel for each variable.

    Lines are means over a fortieth of the steps, so that rare events can be seen as rates.

    Parameters
    ----------
    portraits : dict of Portrait
        By title, which the legend shows.
    """
    names = list(next(iter(portraits.values())).series)
    figure = Figure(figsize=(7.5, 2.3 * len(names) + 0.4), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False).ravel()
    for name, axes in zip(names, panels, strict=True):
        _draw_series(axes, name, portraits)
    panels[-1].set_xlabel("step")
    panels[-1].xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    panels[0].set_xlim(left=0)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", fontsize=9, frameon=False)
    return figure


def _draw_series(axes: Axes, name: str, portraits: dict[str, Portrait]) -> None:
    for i, (title, portrait) in enumerate(portraits.items()):
        rows, means = window_means(portrait.series[name])
        steps = rows * portrait.collect_every
        style = ("-", "--", "-.", ":")[i % 4]
        axes.plot(steps, means, style, color=COLOURS[i % len(COLOURS)], linewidth=1.4, label=literal(title))
    axes.set_ylabel(literal(f"{name.replace('_', ' ')}\n(window mean)"), fontsize=9)
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)


def window_means(values: np.ndarray, windows: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles (in steps, counted from 1) and means of equal windows over a series.

    Examples
    --------
    >>> window_means(np.array([1, 3, 5, 7]), windows=2)
    (array([1.5, 3.5]), array([2., 6.]))
    """
    parts = np.array_split(np.arange(len(values)), max(min(windows, len(values)), 1))
    middles = np.array([part.mean() + 1 for part in parts if len(part)])
    return middles, np.array([values[part].mean() for part in parts if len(part)])
