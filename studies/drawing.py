"""Drawing for all results: figures with plain axes, means with their spread, files."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter
from numpy.typing import ArrayLike

from mesa_swarm import SwarmModel
from mesa_swarm.experiments import mean_interval
from mesa_swarm.viewing import LIGHT, frame_of, plain_figure, scene_of, world_figure

# Points of long lines: more cannot be seen.
MOST_POINTS = 1000
FAINT = 0.18


def plain_axes(x: str, y: str) -> tuple[Figure, Axes]:
    """Return a figure with named axes without a frame."""
    figure, ((axes,),) = plain_figure((7.5, 4.2), grid=True)
    axes.set(xlabel=x, ylabel=y)
    axes.set_prop_cycle(color=LIGHT.series)
    return figure, axes


def count_steps(axes: Axes) -> None:
    """Format steps as 10,000."""
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))


def name_places(axes: Axes, places: Sequence[float]) -> None:
    """Label the places where something was measured on a logarithmic axis, instead of powers of ten."""
    axes.set_xticks(places, [f"{place:g}" for place in places])
    axes.minorticks_off()


def draw_bundle(axes: Axes, x: ArrayLike, curves: np.ndarray, colour: str, label: str) -> None:
    """Draw curves, a row each, faintly, and their mean over them."""
    thin = slice(None, None, max(1, curves.shape[1] // MOST_POINTS))
    shown = np.asarray(x)[thin]
    axes.plot(shown, curves[:, thin].T, color=colour, alpha=FAINT, linewidth=0.6)
    axes.plot(shown, curves.mean(axis=0)[thin], color=colour, linewidth=2.0, label=label)


def draw_means(
    axes: Axes, x: ArrayLike, samples: Iterable[Iterable[float | None]], label: str, i: int, *, joined: bool = True
) -> None:
    """Draw the mean of every sample with its 95 % interval, joined by a line or not; None is left out."""
    intervals = [mean_interval([value for value in sample if value is not None]) for sample in samples]
    means = np.array([interval.estimate for interval in intervals])
    reach = np.array([[m.estimate - m.low, m.high - m.estimate] for m in intervals]).T
    style = "os^vD"[i % 5] + ("-" if joined else "")
    colour = LIGHT.series[i % len(LIGHT.series)]
    axes.errorbar(x, means, np.nan_to_num(reach), fmt=style, color=colour, markersize=5, capsize=3, label=label)


def world_picture(model: SwarmModel, title: str, *, perceived: bool = False) -> Figure:
    """Return a picture of a model's world as it is now, with its legend."""
    figure = world_figure({title: (frame_of(model, perceived=perceived), scene_of(model))})
    figure.set_size_inches(7.0, 6.0)
    return figure


def column(rows: Sequence[dict], name: str) -> list:
    """Return one number of every run."""
    return [row[name] for row in rows]
