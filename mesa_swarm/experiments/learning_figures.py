"""Figures of learning: collisions over temperature, rewards, fires."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import StrMethodFormatter

from mesa_swarm.analysis.series import central_moving_average
from mesa_swarm.base.errors import InvalidValueError, check_count
from mesa_swarm.base.moved import moved_name
from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.statistics import mean_interval
from mesa_swarm.learning.actions import temperature_at
from mesa_swarm.learning.reward_lab import Profile
from mesa_swarm.learning.rewards import CRITICAL
from mesa_swarm.model.gallery import find_model
from mesa_swarm.viewing.figures import literal, plain_figure
from mesa_swarm.viewing.palette import LIGHT

STYLES = ("--", "-.", ":", "-")
ROWS = ("reward", "learned value Q", "probability of choice")
# Kinds of marks in the key.
MARKS = {
    "leap": "leap of the reward",
    "switch": "change of the best action",
    "plateau": "plateau",
    "undecided": "no action above one half",
}
CRITICAL_NAME = "critical distance"


def reward_figure(profiles: Mapping[str, tuple[Profile, Profile]], critical: float = CRITICAL) -> Figure:
    """Return a figure of rewards, the values learned from each, and the probabilities of choice.

    A column for each title; the critical distance is dotted. Vertical lines mark leaps of the reward, and in the rows
    below changes of the best action. Thick pale lines are plateaus; in shaded stretches no action is chosen more often
    than all others together. The key below names the actions and those marks that occur.

    Parameters
    ----------
    profiles : mapping of title to (reward_profile(), learned_profile())
    critical : float
        Share of the range; the figure ends at five times that, or at the range.

    Examples
    --------
    >>> from mesa_swarm.learning.reward_lab import reward_profile
    >>> profile = reward_profile("a", actions=4, points=11)
    >>> len(reward_figure({"reward a": (profile, profile)}).axes)
    3
    """
    size = 3.6 * len(profiles) + 0.6, 7.6
    figure, grid = plain_figure(size, 3, len(profiles), letters=8, sharex=True, sharey="row")
    for column, (title, (paid, learned)) in zip(grid.T, profiles.items(), strict=True):
        _draw(column[0], paid, paid.values)
        _draw(column[1], learned, learned.values)
        _draw(column[2], learned, learned.values if learned.policy is None else learned.policy)
        column[0].set_title(literal(title), fontsize=11)
        column[-1].set_xlabel("distance ahead (share of the range)", fontsize=9)
        for axes in column:
            axes.axvline(critical, color=LIGHT.ink, linewidth=0.8, linestyle=":")
            axes.set_xlim(0.0, min(5 * critical, 1.0))
    for axes, name in zip(grid[:, 0], ROWS, strict=True):
        axes.set_ylabel(name, fontsize=9)
    widest = max(grid[1], key=lambda axes: len(axes.get_legend_handles_labels()[1]))
    handles, labels = widest.get_legend_handles_labels()
    found = {mark.kind for pair in profiles.values() for profile in pair for mark in profile.marks}
    names = dict.fromkeys(name for kind, name in MARKS.items() if kind in found)
    key = [*zip(handles, labels, strict=True), *((_sample(name), name) for name in (*names, CRITICAL_NAME))]
    figure.legend(
        *zip(*key, strict=True), loc="outside lower center", ncols=2 * len(profiles), fontsize=8, frameon=False
    )
    return figure


def _sample(name: str) -> Artist:
    """Return how a kind of mark is drawn, for the key."""
    if name == MARKS["undecided"]:
        return Patch(color=LIGHT.warn_paper)
    if name == MARKS["plateau"]:
        return Line2D([], [], color=LIGHT.edge, linewidth=5, solid_capstyle="butt")
    if name == CRITICAL_NAME:
        return Line2D([], [], color=LIGHT.ink, linewidth=0.8, linestyle=":")
    return Line2D([], [], color=LIGHT.bad, linewidth=0.8)


def _draw(axes: Axes, profile: Profile, curves: np.ndarray) -> None:
    for mark in profile.marks:
        if mark.kind == "undecided":
            axes.axvspan(mark.start, mark.end, color=LIGHT.warn_paper, linewidth=0)
        elif mark.kind in ("leap", "switch"):
            axes.axvline(mark.start, color=LIGHT.bad, linewidth=0.8)
        else:
            level = curves[np.searchsorted(profile.distance, 0.5 * (mark.start + mark.end))]
            height = level[profile.actions.index(mark.action)]
            axes.plot([mark.start, mark.end], [height, height], color=LIGHT.edge, linewidth=5, solid_capstyle="butt")
    for a, name in enumerate(profile.actions):
        colour, style = COLOURS[a % len(COLOURS)], STYLES[a % len(STYLES)]
        axes.plot(profile.distance, _broken(profile, curves[:, a], name), style, color=colour, lw=1.4, label=name)
    axes.margins(x=0)


def _broken(profile: Profile, curve: np.ndarray, name: str) -> np.ndarray:
    """Return a curve that is not joined across its leaps: the last value before each is left out."""
    drawn = curve.copy()
    for mark in profile.marks:
        if mark.kind == "leap" and mark.action == name:
            drawn[np.searchsorted(profile.distance, mark.start, side="left") - 1] = np.nan
    return drawn


LEARNERS = ("shared", "own")
TITLES = {
    "rounds with the largest out": "later rounds in which\nthe largest fire goes out",
    "fighting at the largest in company": "fighting at the largest fire\nin company",
}


@dataclass(frozen=True, slots=True, eq=False)
class FireRun:
    """A run of the model `LearningFires`: the steps of each round, shape (k,), and the model's results."""

    rounds: np.ndarray
    results: dict[str, float | None]


def fire_run(controller: str, *, rng: int, steps: int = 60_000, **settings: float) -> FireRun:
    """Let robots of the model `LearningFires`, with these settings, fight fires in rounds, and return the outcome."""
    model = find_model("learning_fires")(controller=controller, rng=rng, **settings)
    model.run(check_count("steps", steps, minimum=1))
    return FireRun(np.array([row[0] for row in model.rounds], dtype=float), model.results())


def fire_figure(runs: Mapping[str, Sequence[FireRun]]) -> Figure:
    """Return a figure of runs by controller: a dot a run with means and 95 % intervals, and how long rounds last.

    Examples
    --------
    >>> run = fire_run("shared", rng=1, steps=20, round_steps=10, n_robots=2)
    >>> len(fire_figure({"shared": [run, run]}).axes)
    3
    """
    if not runs or not all(runs.values()):
        raise InvalidValueError("runs are missing; expected at least one run of every controller")
    figure, ((*shares, rounds),) = plain_figure((11.0, 3.6), 1, 3, letters=8, width_ratios=(1, 1, 1.3))
    for axes, (measure, title) in zip(shares, TITLES.items(), strict=True):
        for place, done in enumerate(runs.values()):
            _draw_dots(axes, place, [run.results[measure] for run in done], COLOURS[place % len(COLOURS)])
        axes.set_xticks(range(len(runs)), list(map(literal, runs)), rotation=30)
        axes.set_title(title, fontsize=10)
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:.0%}"))
        axes.set_ylim(-0.03, 1.03)
    _draw_rounds(rounds, runs)
    return figure


def _draw_dots(axes: Axes, place: int, values: list[float | None], colour: str) -> None:
    known = [value for value in values if value is not None]
    beside = place + np.linspace(-0.25, 0.25, max(len(known), 2))[: len(known)]
    axes.plot(beside, known, "o", markersize=3, color=colour, alpha=0.6)
    if len(known) > 1:
        mean = mean_interval(known)
        axes.plot([place - 0.32, place + 0.32], [mean.estimate] * 2, color=LIGHT.ink, linewidth=1.6)
        axes.plot([place] * 2, [max(mean.low, 0.0), min(mean.high, 1.0)], color=LIGHT.ink, linewidth=1.0)


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


BETAS = (1e-4, 5e-3)
# The thesis smooths over 1,001 steps for many robots, and over 11 for one.
WINDOWS = {True: 1001, False: 11}


@dataclass(frozen=True, slots=True, eq=False)
class LearningRun:
    """A run of learning: the robots that collided in each step (k,), the temperature of the choice (k,)."""

    collisions: np.ndarray
    temperature: np.ndarray
    n_robots: int


def learning_run(*, beta: float, rng: int, steps: int = 33_000, progress: bool = False, **settings: Any) -> LearningRun:
    """Let robots of the model `QLearning` learn to avoid collisions, and return their collisions by step."""
    model = find_model("q_learning")(beta=beta, rng=rng, **settings)
    model.run(check_count("steps", steps, minimum=1), progress)
    layer = model.learner
    temperature = [
        temperature_at(step, beta=beta, first=layer.first_temperature, last=layer.last_temperature)
        for step in range(steps)
    ]
    collisions = np.array(model.datacollector.model_vars["collisions"], dtype=float)
    return LearningRun(collisions, np.array(temperature), len(model.swarm))


def learning_figure(
    runs: Mapping[float, LearningRun] | None = None, *, rng: int = 1, steps: int = 33_000, **settings: Any
) -> Figure:
    """Return the thesis's graphs of one run with each beta: collisions a step with T, and their total.

    Collisions are means of a robot over a central window: 1,001 steps for several robots, 11 for one, shorter at
    the ends.

    Parameters
    ----------
    runs : mapping of beta to LearningRun, optional
        By default both of the thesis's betas are run: 15 robots, 33,000 steps.
    rng, steps : int
        Of these runs.
    **settings
        Of the model `QLearning`.

    Examples
    --------
    >>> figure = learning_figure(steps=30, n_robots=2)
    >>> [axes.get_ylabel() for axes in figure.axes[2:4]]
    ['collisions of a robot in all', 'T']
    """
    if runs is None:
        runs = {beta: learning_run(beta=beta, rng=rng, steps=steps, **settings) for beta in BETAS}
    if not runs:
        raise InvalidValueError("runs is empty; expected at least one run by its beta")
    figure = Figure(figsize=(8.0, 2.4 * len(runs) + 2.6), layout="constrained")
    panels = figure.subplots(len(runs) + 1, 1, sharex=True)
    for i, (beta, run) in enumerate(runs.items()):
        colour = COLOURS[i % len(COLOURS)]
        _draw_frequency(panels[i], f"beta {beta:g}", run, colour)
        total = run.collisions.cumsum() / run.n_robots
        panels[-1].plot(np.arange(1, len(total) + 1), total, ("-", "--")[i % 2], color=colour, label=f"beta {beta:g}")
    panels[-1].set_ylabel("collisions of a robot in all", fontsize=9)
    panels[-1].set_xlabel("step")
    panels[-1].xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    panels[-1].legend(fontsize=8, frameon=False)
    panels[-1].margins(x=0)
    panels[-1].set_ylim(bottom=0)
    return figure


def _draw_frequency(axes: Axes, title: str, run: LearningRun, colour: str) -> None:
    step = np.arange(1, len(run.collisions) + 1)
    frequency = central_moving_average(run.collisions / run.n_robots, WINDOWS[run.n_robots > 1])
    axes.plot(step, frequency, color=colour, linewidth=1.2)
    axes.set_title(title, fontsize=10)
    axes.set_ylabel("collisions a robot and step", fontsize=9)
    axes.set_ylim(bottom=0)
    heat = axes.twinx()
    heat.plot(step, run.temperature, color=LIGHT.soft, linestyle=":", linewidth=1.2)
    heat.set_ylabel("T", fontsize=9, color=LIGHT.soft)
    heat.set_ylim(0, None)
    for each in (axes, heat):
        each.tick_params(labelsize=8)
        each.margins(x=0)


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> object:
        """Return a name that was in this module before, from where it is now; `from` asks twice, which warns once."""
        return globals().setdefault(name, moved_name(__name__, name))
