"""The picture of what robots learn about fires, beside strategies A and B, followers and chance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from mesa_swarm.errors import InvalidValueError, check_count
from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.pictures import INK, literal
from mesa_swarm.experiments.statistics import mean_interval
from mesa_swarm.gallery import find_model

LEARNERS = ("shared", "own")
TITLES = {
    "rounds with the largest out": "later rounds in which\nthe largest fire goes out",
    "fighting at the largest in company": "fighting at the largest fire\nin company",
}


@dataclass(frozen=True, slots=True, eq=False)
class FireRun:
    """What a run of the model `LearningFires` shows.

    Parameters
    ----------
    rounds : ndarray, shape (k,)
        How many steps each lasted.
    results : dict
        Of the model.
    """

    rounds: np.ndarray
    results: dict[str, float | None]


def fire_run(controller: str, *, rng: int, steps: int = 60_000, **settings: float) -> FireRun:
    """Let robots fight fires in rounds and return what came of it.

    Parameters
    ----------
    controller : str
    rng, steps : int
    **settings
        Of the model `LearningFires`.

    Examples
    --------
    >>> fire_run("shared", rng=1, steps=30, round_steps=10, n_robots=2).rounds
    array([10., 10., 10.])
    """
    model = find_model("learning_fires")(controller=controller, rng=rng, **settings)
    model.run(check_count("steps", steps, minimum=1))
    return FireRun(np.array([row[0] for row in model.rounds], dtype=float), model.results())


def fire_figure(runs: Mapping[str, Sequence[FireRun]]) -> Figure:
    """Return a figure of runs by controller: a dot a run with means and 95 % intervals, and how long rounds last.

    Parameters
    ----------
    runs : mapping of controller to a sequence of FireRun

    Examples
    --------
    >>> run = fire_run("shared", rng=1, steps=20, round_steps=10, n_robots=2)
    >>> len(fire_figure({"shared": [run, run]}).axes)
    3
    """
    if not runs or not all(runs.values()):
        raise InvalidValueError("runs are missing; expected at least one run of every controller")
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    *shares, rounds = figure.subplots(1, 3, width_ratios=(1, 1, 1.3))
    for axes, (measure, title) in zip(shares, TITLES.items(), strict=True):
        for place, done in enumerate(runs.values()):
            _draw_dots(axes, place, [run.results[measure] for run in done], COLOURS[place % len(COLOURS)])
        axes.set_xticks(range(len(runs)), list(map(literal, runs)), rotation=30, fontsize=9)
        axes.set_title(title, fontsize=10)
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:.0%}"))
        axes.set_ylim(-0.03, 1.03)
    _draw_rounds(rounds, runs)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    return figure


def _draw_dots(axes: Axes, place: int, values: list[float | None], colour: str) -> None:
    known = [value for value in values if value is not None]
    beside = place + np.linspace(-0.25, 0.25, max(len(known), 2))[: len(known)]
    axes.plot(beside, known, "o", markersize=3, color=colour, alpha=0.6)
    if len(known) > 1:
        mean = mean_interval(known)
        axes.plot([place - 0.32, place + 0.32], [mean.estimate] * 2, color=INK, linewidth=1.6)
        axes.plot([place] * 2, [max(mean.low, 0.0), min(mean.high, 1.0)], color=INK, linewidth=1.0)


def _draw_rounds(axes: Axes, runs: Mapping[str, Sequence[FireRun]]) -> None:
    for place, (controller, done) in enumerate(runs.items()):
        colour = COLOURS[place % len(COLOURS)]
        if controller in LEARNERS:
            most = min(len(run.rounds) for run in done)
            lasted = np.array([run.rounds[:most] for run in done]).mean(axis=0) if most else np.empty(0)
            axes.plot(np.arange(1, most + 1), lasted, ".-", color=colour, label=literal(controller))
        elif any(len(run.rounds) for run in done):
            mean = float(np.mean(np.concatenate([run.rounds for run in done])))
            axes.axhline(mean, color=colour, linestyle="--", linewidth=1.2, label=literal(controller))
    axes.set_title("steps of a round (mean of the runs)", fontsize=10)
    axes.set_xlabel("round", fontsize=9)
    axes.set_ylim(bottom=0)
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    if axes.get_legend_handles_labels()[1]:
        axes.legend(fontsize=8, frameon=False, loc="lower left")
