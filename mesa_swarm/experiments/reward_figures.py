"""The picture of the reward laboratory: reward, learned values and choice over the distance ahead."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.pictures import INK, literal
from mesa_swarm.learning.reward_lab import Profile

STYLES = ("--", "-.", ":", "-")
LEAP, DOUBT = "#d55e00", "#e2d3b0"
ROWS = ("reward", "learned value Q", "probability of choice")


def reward_figure(profiles: Mapping[str, tuple[Profile, Profile]], critical: float = 0.4) -> Figure:
    """Return a figure of rewards, what was learned by each, and how it chooses.

    A column for each title; the critical distance is dotted. Vertical lines mark leaps of the reward, and in the rows
    below where another action becomes the best. Thick pale lines are plateaus, shaded stretches those in which no
    action is chosen more often than all others together.

    Parameters
    ----------
    profiles : mapping of title to (reward_profile(), learned_profile())
    critical : float
        Share of the range.

    Examples
    --------
    >>> from mesa_swarm.learning.reward_lab import reward_profile
    >>> profile = reward_profile("a", actions=4, points=11)
    >>> len(reward_figure({"reward a": (profile, profile)}).axes)
    3
    """
    figure = Figure(figsize=(3.6 * len(profiles) + 0.6, 7.6), layout="constrained")
    grid = figure.subplots(3, len(profiles), sharex=True, sharey="row", squeeze=False)
    for column, (title, (paid, learned)) in zip(grid.T, profiles.items(), strict=True):
        _draw(column[0], paid, paid.values)
        _draw(column[1], learned, learned.values)
        _draw(column[2], learned, learned.values if learned.policy is None else learned.policy)
        column[0].set_title(literal(title), fontsize=11)
        column[-1].set_xlabel("distance ahead (share of the range)", fontsize=9)
        for axes in column:
            axes.axvline(critical, color=INK, linewidth=0.8, linestyle=":")
    for axes, name in zip(grid[:, 0], ROWS, strict=True):
        axes.set_ylabel(name, fontsize=9)
    widest = max(grid[1], key=lambda axes: len(axes.get_legend_handles_labels()[1]))
    handles, labels = widest.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4), fontsize=8, frameon=False)
    return figure


def _draw(axes: Axes, profile: Profile, curves: np.ndarray) -> None:
    for mark in profile.marks:
        if mark.kind == "undecided":
            axes.axvspan(mark.start, mark.end, color=DOUBT, alpha=0.5, linewidth=0)
        elif mark.kind in ("leap", "switch"):
            axes.axvline(mark.start, color=LEAP, linewidth=0.8)
        else:
            level = curves[np.searchsorted(profile.distance, 0.5 * (mark.start + mark.end))]
            height = level[profile.actions.index(mark.action)]
            axes.plot([mark.start, mark.end], [height, height], color="#c8c8c8", linewidth=5, solid_capstyle="butt")
    for a, name in enumerate(profile.actions):
        colour, style = COLOURS[a % len(COLOURS)], STYLES[a % len(STYLES)]
        axes.plot(profile.distance, _broken(profile, curves[:, a], name), style, color=colour, lw=1.4, label=name)
    axes.tick_params(labelsize=8)
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)


def _broken(profile: Profile, curve: np.ndarray, name: str) -> np.ndarray:
    """Return a curve that is not joined across its leaps: the last value before each is left out."""
    drawn = curve.copy()
    for mark in profile.marks:
        if mark.kind == "leap" and mark.action == name:
            drawn[np.searchsorted(profile.distance, mark.start, side="left") - 1] = np.nan
    return drawn
