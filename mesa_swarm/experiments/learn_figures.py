"""Pictures of the benchmark of learning: collisions against speed, and collisions in the course of training."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.learn_bench import Run
from mesa_swarm.experiments.learn_table import FAST, FEW, GROUPS, Line, lines_of
from mesa_swarm.experiments.pictures import INK, literal, png

MARKS = "osD^vP*Xhp"
# Below this, collisions are drawn on a scale that reaches 0.
LINEAR = 0.1
PANELS = {"home": "original, trained on", "built in": "other built-in maps", "generated": "generated maps"}


def learning_pictures(runs: Sequence[Run]) -> dict[str, bytes]:
    """Return the PNGs of a benchmark by file name."""
    pictures = {"learn_bench.png": png(speed_figure(lines_of(runs)))}
    if any(run.curve() for run in runs):
        pictures["learn_curves.png"] = png(curve_figure(runs))
    return pictures


def speed_figure(lines: Sequence[Line]) -> Figure:
    """Return collisions over speed ahead, a panel for each group of maps: full marks frozen, hollow still learning."""
    figure = Figure(figsize=(12.8, 5.6), layout="constrained")
    names = list(dict.fromkeys(line.name for line in lines))
    panels = figure.subplots(1, len(GROUPS), sharex=True, sharey=True)
    for group, axes in zip(GROUPS, panels, strict=True):
        axes.fill_between([FAST, 1.0], 0, FEW, color="#009e73", alpha=0.1, linewidth=0)
        axes.axvline(FAST, color=INK, linewidth=0.5, linestyle=":")
        axes.axhline(FEW, color=INK, linewidth=0.5, linestyle=":")
        for line in (each for each in lines if each.group == group):
            _mark(axes, line, names.index(line.name))
        axes.set_yscale("symlog", linthresh=LINEAR)
        axes.set_ylim(bottom=0)
        axes.set_title(PANELS[group], fontsize=12)
        axes.set_xlabel("mean speed ahead, share of the greatest")
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("collisions per robot and 1,000 steps\n(interquartile mean, 95 %)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _mark(axes: Axes, line: Line, number: int) -> None:
    colour, frozen, c = COLOURS[number % len(COLOURS)], line.mode == "frozen", line.collisions
    reach = np.nan_to_num([[c.estimate - c.low], [c.high - c.estimate]])
    axes.errorbar(
        line.ahead,
        c.estimate,
        yerr=np.maximum(reach, 0.0),
        fmt=MARKS[number % len(MARKS)],
        color=colour,
        markerfacecolor=colour if frozen else "white",
        markersize=8,
        clip_on=False,  # those without collisions stand on the axis
        linewidth=1.0,
        label=literal(line.name) if frozen else None,
    )


def curve_figure(runs: Sequence[Run]) -> Figure:
    """Return collisions in the course of training: a line for each contestant that learns, medians of all seeds."""
    figure = Figure(figsize=(8.5, 4.6), layout="constrained")
    axes = figure.subplots()
    names = list(dict.fromkeys(run.name for run in runs))
    for name in names:
        curves = np.array([run.curve() for run in runs if run.name == name])
        if curves.size:
            middle, colour = np.median(curves, axis=0), COLOURS[names.index(name) % len(COLOURS)]
            at = (np.arange(len(middle)) + 0.5) / len(middle)
            mark = MARKS[names.index(name) % len(MARKS)]
            axes.plot(at, middle, color=colour, marker=mark, markersize=4, label=literal(name))
            axes.fill_between(at, curves.min(axis=0), curves.max(axis=0), color=colour, alpha=0.08, linewidth=0)
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.set(xlim=(0, 1), xlabel="share of the training", ylabel="collisions per robot and 1,000 steps")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9)
    return figure
