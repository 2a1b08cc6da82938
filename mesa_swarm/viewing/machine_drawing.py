"""The drawing of a state machine: states as discs, transitions as labelled arrows."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.path import Path as Outline

from mesa_swarm.control.layer import Layer
from mesa_swarm.control.state_machine import StateMachine
from mesa_swarm.viewing.palette import LIGHT, layer_colour
from mesa_swarm.viewing.pictures import literal

# Radius of a disc, and distance of an arrow's ends from it.
RADIUS, GAP = 1.0, 0.06
NAME_SIZE, TEXT_SIZE = 12.0, 8.0
# How far an arrow bends to its left, as a part of its length.
BEND = 0.2
# Arrows this much longer than the shortest one cross others; their labels stand early on their way.
ACROSS, EARLY = 1.4, 0.28
# Room around the discs, in which labels are.
MARGIN = np.array([2.0, 1.4])
# Of one unit of length.
INCHES = 0.78
MOST_LETTERS = 19


def machine_figure(machine: StateMachine) -> Figure:
    """Return the drawing of a state machine.

    A disc is a state, with its layers, most important first; the first state, in which robots begin, has a double rim.
    An arrow has the conditions of all transitions between its two states, in the order in which they are tried.

    Examples
    --------
    >>> from mesa_swarm.control import Halt
    >>> machine_figure(StateMachine({"stay": Halt()})).axes[0].texts[0].get_text()
    'stay'
    """
    count = len(machine.state_names)
    places = dict(zip(machine.state_names, state_places(count), strict=True))
    centre = np.mean(list(places.values()), axis=0)
    figure = Figure(layout="constrained", facecolor=LIGHT.paper)
    axes = figure.add_subplot()
    for number, (name, layers) in enumerate(machine.states.items()):
        _draw_state(axes, name, layers, places[name], number)
    arrows: dict[tuple[str, str], list[str]] = {}
    for one in machine.transitions:
        arrows.setdefault((one.source, one.target), []).append(one.condition.label)
    nearest = min((np.hypot(*(places[a] - places[b])) for a, b in arrows if a != b), default=1.0)
    for (source, target), labels in arrows.items():
        if source == target:
            _draw_loop(axes, places[source], centre, labels)
            continue
        crosses = np.hypot(*(places[source] - places[target])) > ACROSS * nearest
        _draw_arrow(axes, places[source], places[target], labels, EARLY if crosses else 0.5)
    _fit(figure, axes, np.array(list(places.values())))
    return figure


def state_places(count: int) -> np.ndarray:
    """Return the centres of discs (count, 2): in a row up to two, else on a circle, the first at the top."""
    if count <= 2:
        return np.array([[5.2 * k, 0.0] for k in range(count)])
    reach = max(2.9, 2.6 / np.sin(np.pi / count))
    start = np.pi / 2 + (np.pi / count if count % 2 == 0 else 0.0)
    turns = start - 2 * np.pi * np.arange(count) / count
    return reach * np.stack([1.25 * np.cos(turns), np.sin(turns)], axis=1)


def _draw_state(axes: Axes, name: str, layers: Sequence[Layer], place: np.ndarray, number: int) -> None:
    colour = layer_colour(number)
    axes.add_patch(Circle(tuple(place), RADIUS, facecolor=LIGHT.field, edgecolor=colour, linewidth=2.4, zorder=3))
    if number == 0:
        inner = Circle(tuple(place), RADIUS - 0.1, facecolor="none", edgecolor=colour, linewidth=1.0, zorder=4)
        axes.add_patch(inner)
    lines = [_shortened(layer.name) for layer in layers]
    top = 0.13 * len(lines)
    x, y = place
    style: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 5}
    axes.text(x, y + top, literal(_shortened(name)), size=NAME_SIZE, weight="bold", color=LIGHT.ink, **style)
    for k, line in enumerate(lines):
        axes.text(x, y + top - 0.34 - 0.26 * k, literal(line), size=TEXT_SIZE, color=LIGHT.soft, **style)


def _shortened(text: str) -> str:
    return text if len(text) <= MOST_LETTERS else f"{text[: MOST_LETTERS - 1]}…"


def _draw_arrow(axes: Axes, start: np.ndarray, end: np.ndarray, labels: list[str], at: float) -> None:
    """Draw an arrow that bends to its left, so that those of both directions are apart; its label is at this part."""
    way = end - start
    aside = np.array([-way[1], way[0]]) * BEND
    middle = 0.5 * (start + end) + 2.0 * aside
    ends = [place + (RADIUS + GAP) * (middle - place) / np.hypot(*(middle - place)) for place in (start, end)]
    _add_curve(axes, [ends[0], middle, ends[1]], [Outline.MOVETO, Outline.CURVE3, Outline.CURVE3])
    _add_label(axes, (1 - at) ** 2 * ends[0] + 2 * at * (1 - at) * middle + at**2 * ends[1], labels)


def _draw_loop(axes: Axes, place: np.ndarray, centre: np.ndarray, labels: list[str]) -> None:
    """Draw an arrow from a state to itself, on the side away from the centre."""
    out = place - centre
    out = out / np.hypot(*out) if np.hypot(*out) > 0 else np.array([0.0, 1.0])
    across = np.array([-out[1], out[0]])
    ends = [place + (RADIUS + GAP) * (0.9 * out + side * 0.436 * across) for side in (1, -1)]
    bends = [place + 2.1 * out + side * 0.9 * across for side in (1, -1)]
    _add_curve(axes, [ends[0], *bends, ends[1]], [Outline.MOVETO, Outline.CURVE4, Outline.CURVE4, Outline.CURVE4])
    _add_label(axes, place + 2.15 * out, labels)


def _add_curve(axes: Axes, points: list[np.ndarray], codes: list) -> None:
    arrow = FancyArrowPatch(
        path=Outline(np.array(points), codes),
        arrowstyle="-|>",
        mutation_scale=15,
        linewidth=1.5,
        color=LIGHT.soft,
        zorder=2,
    )
    axes.add_patch(arrow)


def _add_label(axes: Axes, place: np.ndarray, labels: list[str]) -> None:
    box: dict[str, Any] = {"facecolor": LIGHT.paper, "edgecolor": "none", "boxstyle": "round,pad=0.18"}
    text = literal("\n".join(labels))
    style: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 6, "linespacing": 1.25}
    axes.text(place[0], place[1], text, size=TEXT_SIZE, color=LIGHT.ink, bbox=box, **style)


def _fit(figure: Figure, axes: Axes, places: np.ndarray) -> None:
    """Let all that is drawn be within the figure, whose scale does not depend on the machine."""
    low, high = places.min(axis=0) - RADIUS - MARGIN, places.max(axis=0) + RADIUS + MARGIN
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.axis("off")
    figure.set_size_inches(INCHES * (high - low))
