"""The drawing of a state machine: states as discs, transitions as labelled arrows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.bezier import BezierSegment
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.path import Path as Outline
from matplotlib.text import Text

from mesa_swarm.control.layer import Layer
from mesa_swarm.control.state_machine import StateMachine
from mesa_swarm.viewing.figures import literal
from mesa_swarm.viewing.palette import LIGHT, layer_colour

# Radius of a disc, of the part of it in which text stands, and distance of an arrow's ends from the disc.
RADIUS, INSIDE, GAP = 1.0, 0.84, 0.06
NAME_SIZE, TEXT_SIZE, SMALLEST = 12.0, 8.0, 6.0
# Layers that are named in a disc; the others are counted.
MOST_LAYERS = 3
# How far an arrow may bend to its left, as a part of its length; the first that passes all other discs is taken.
BENDS = (0.2, 0.12, 0.28, 0.06, 0.36)
# How far from a disc's centre an arrow passes it.
PASSING = 1.2
# The label of an arrow from a state to itself is this much farther from the disc's centre than the arrow.
BEYOND = 1.19
# Parts of an arrow's way at which its label may stand, the preferred one first.
STANDS = np.array(sorted(np.linspace(0.16, 0.84, 35), key=lambda at: abs(at - 0.5)))
# Points of an arrow at which labels look for it; the last is its tip.
POINTS = np.linspace(0.0, 1.0, 60)
# What a label costs that hides a disc or another label, interrupts another arrow, and stands at an end of its own.
HIDING, INTERRUPTING, ASIDE = 100.0, 1.0, 0.9
# How often labels look for a better place, one after another.
ROUNDS = 4
# Discs move apart by these factors until labels hide nothing, and below the second number interrupt nothing either.
SPREADS, ROOMY = (1.0, 1.2, 1.4, 1.7, 2.0, 2.5, 3.0), 1.4
# Free at each side of a label, and above and below it.
PADDING = np.array([0.13, 0.08])
# Room around the discs, in which labels are.
MARGIN = np.array([2.0, 1.4])
# Of one unit of length.
INCHES = 0.78


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Arrangement:
    """Where everything is: the discs' centres, the arrows' Bezier curves, and the middles of their labels."""

    places: np.ndarray  # (states, 2)
    curves: list[np.ndarray]  # of each arrow (3 or 4 control points, 2)
    spots: np.ndarray  # (arrows, 2)
    cost: float  # of the label that hides most


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
    figure = Figure(layout="constrained", facecolor=LIGHT.paper)
    FigureCanvasAgg(figure)  # which measures texts
    axes = figure.add_subplot()
    labels = _labels(machine)
    sizes = np.array([_extent(figure, label, TEXT_SIZE) for label in labels.values()]).reshape(-1, 2)
    layout = _layout(len(machine.state_names), list(labels), sizes + 2 * PADDING)
    for number, (name, layers) in enumerate(machine.states.items()):
        _draw_state(axes, name, layers, layout.places[number], number)
    for curve, spot, label in zip(layout.curves, layout.spots, labels.values(), strict=True):
        _draw_arrow(axes, curve)
        _draw_label(axes, spot, label)
    _fit(figure, axes, layout, sizes)
    return figure


def state_places(count: int) -> np.ndarray:
    """Return the centres of discs (count, 2): in a row up to two, else on a circle, the first at the top."""
    if count <= 2:
        return np.array([[5.2 * k, 0.0] for k in range(count)])
    reach = max(2.9, 2.6 / np.sin(np.pi / count))
    start = np.pi / 2 + (np.pi / count if count % 2 == 0 else 0.0)
    turns = start - 2 * np.pi * np.arange(count) / count
    return reach * np.stack([1.25 * np.cos(turns), np.sin(turns)], axis=1)


def _labels(machine: StateMachine) -> dict[tuple[int, int], str]:
    """Return the label of each arrow, by the numbers of its two states."""
    number = {name: k for k, name in enumerate(machine.state_names)}
    lines: dict[tuple[int, int], list[str]] = {}
    for transition in machine.transitions:
        lines.setdefault((number[transition.source], number[transition.target]), []).append(transition.condition.label)
    return {pair: literal("\n".join(labels)) for pair, labels in lines.items()}


def _extent(figure: Figure | SubFigure, text: str, size: float, weight: str = "normal") -> np.ndarray:
    """Return the width and height of a text, in units of length."""
    shown = Text(text=text, size=size, weight=weight, linespacing=1.25, figure=figure)
    return np.array(shown.get_window_extent().size) / (figure.dpi * INCHES)


def _layout(count: int, pairs: list[tuple[int, int]], sizes: np.ndarray) -> Arrangement:
    """Return the narrowest layout that has room for labels of these sizes (arrows, 2)."""
    for spread in SPREADS:
        places = spread * state_places(count)
        curves = [_curve(places, *pair) for pair in pairs]
        layout = _labelled(places, curves, pairs, sizes)
        if layout.cost < (INTERRUPTING if spread < ROOMY else HIDING):
            break
    return layout


def _curve(places: np.ndarray, source: int, target: int) -> np.ndarray:
    if source == target:
        return _loop(places[source], places.mean(axis=0))
    curves = [_bent(places[source], places[target], bend) for bend in BENDS]
    others = np.delete(places, [source, target], axis=0)
    # Beyond a certain distance from other discs, all bends are equally good: max returns the first.
    return max(curves, key=lambda curve: min(_clearance(curve, others), PASSING))


def _bent(start: np.ndarray, end: np.ndarray, bend: float) -> np.ndarray:
    """Return the curve of an arrow that bends to its left, so that those of both directions are apart."""
    way = end - start
    middle = 0.5 * (start + end) + 2.0 * bend * np.array([-way[1], way[0]])
    ends = [place + (RADIUS + GAP) * (middle - place) / np.hypot(*(middle - place)) for place in (start, end)]
    return np.array([ends[0], middle, ends[1]])


def _loop(place: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the curve of an arrow from a state to itself, on the side away from the centre."""
    out = place - centre
    out = out / np.hypot(*out) if np.hypot(*out) > 0 else np.array([0.0, 1.0])
    across = np.array([-out[1], out[0]])
    ends = [place + (RADIUS + GAP) * (0.9 * out + side * 0.436 * across) for side in (1, -1)]
    bends = [place + 2.1 * out + side * 0.9 * across for side in (1, -1)]
    return np.array([ends[0], *bends, ends[1]])


def _clearance(curve: np.ndarray, discs: np.ndarray) -> float:
    """Return the distance of a curve from the nearest centre of a disc (discs, 2), infinity without discs."""
    apart = BezierSegment(curve)(POINTS)[:, None] - discs
    return float(np.hypot(apart[..., 0], apart[..., 1]).min(initial=np.inf))


def _labelled(
    places: np.ndarray, curves: list[np.ndarray], pairs: list[tuple[int, int]], sizes: np.ndarray
) -> Arrangement:
    """Return the layout in which each label stands at the best part of its arrow, given where the others are."""
    ways = np.array([BezierSegment(curve)(POINTS) for curve in curves]).reshape(-1, len(POINTS), 2)
    stands = [_stands(curve, places[pair[0]], pair[0] == pair[1]) for curve, pair in zip(curves, pairs, strict=True)]
    spots = np.array([options[0] for options in stands]).reshape(-1, 2)
    costs = np.zeros(len(curves))
    for _ in range(ROUNDS):
        for k, options in enumerate(stands):
            hidden, crossed = _hidden(options, k, sizes, places, spots), _crossed(options, k, sizes, ways)
            penalties = HIDING * hidden + INTERRUPTING * crossed + ASIDE * abs(2 * STANDS - 1)
            best = int(penalties.argmin())
            spots[k], costs[k] = options[best], penalties[best]
    return Arrangement(places=places, curves=curves, spots=spots, cost=float(costs.max(initial=0.0)))


def _stands(curve: np.ndarray, place: np.ndarray, loop: bool) -> np.ndarray:
    """Return where the label of an arrow may stand (stands, 2): on it, or beyond a loop, which is as small as it."""
    on = BezierSegment(curve)(STANDS)
    return place + BEYOND * (on - place) if loop else on


def _hidden(options: np.ndarray, k: int, sizes: np.ndarray, places: np.ndarray, spots: np.ndarray) -> np.ndarray:
    """Return how many discs and other labels the k-th label would overlap at each of these places."""
    from_discs = np.maximum(abs(options[:, None] - places) - sizes[k] / 2, 0.0)
    on_discs = np.hypot(from_discs[..., 0], from_discs[..., 1]) < RADIUS + GAP
    on_labels = (abs(options[:, None] - spots) < (sizes[k] + sizes) / 2).all(axis=2)
    on_labels[:, k] = False
    return on_discs.sum(axis=1) + on_labels.sum(axis=1)


def _crossed(options: np.ndarray, k: int, sizes: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return how many arrows the k-th label would interrupt at each of these places; of its own, the tip counts."""
    ways = ways.copy()
    ways[k] = ways[k, -1]
    covered = (abs(options[:, None, None] - ways) < sizes[k] / 2).all(axis=3)
    return covered.any(axis=2).sum(axis=1)


def _draw_state(axes: Axes, name: str, layers: Sequence[Layer], place: np.ndarray, number: int) -> None:
    colour = layer_colour(number)
    axes.add_patch(Circle(tuple(place), RADIUS, facecolor=LIGHT.field, edgecolor=colour, linewidth=2.4, zorder=3))
    if number == 0:
        inner = Circle(tuple(place), RADIUS - 0.1, facecolor="none", edgecolor=colour, linewidth=1.0, zorder=4)
        axes.add_patch(inner)
    lines = [layer.name for layer in layers[:MOST_LAYERS]]
    if len(layers) > MOST_LAYERS:
        lines.append(f"{len(layers) - MOST_LAYERS} more")
    top = 0.13 * len(lines)
    _draw_line(axes, place, top, name, size=NAME_SIZE, weight="bold", color=LIGHT.ink)
    for k, line in enumerate(lines):
        _draw_line(axes, place, top - 0.34 - 0.26 * k, line, size=TEXT_SIZE, color=LIGHT.soft)


def _draw_line(axes: Axes, place: np.ndarray, above: float, text: str, *, size: float, **style: Any) -> None:
    """Write a line this far above the centre of a disc, as small and short as the disc demands."""
    weight = style.get("weight", "normal")
    text, size = _fitted(axes.figure, text, size, weight, 2 * np.sqrt(INSIDE**2 - above**2))
    x, y = place
    axes.text(x, y + above, literal(text), size=size, ha="center", va="center", zorder=5, **style)


def _fitted(figure: Figure | SubFigure, text: str, size: float, weight: str, room: float) -> tuple[str, float]:
    """Return a text and its size that fit: smaller letters first, then fewer."""
    while (width := _extent(figure, literal(text), SMALLEST, weight)[0]) > room:
        text = f"{text[: min(int(len(text) * room / width), len(text) - 2)]}…"
    usual = _extent(figure, literal(text), size, weight)[0]
    return text, max(SMALLEST, size * min(1.0, room / usual))


def _draw_arrow(axes: Axes, curve: np.ndarray) -> None:
    bent = Outline.CURVE3 if len(curve) == 3 else Outline.CURVE4
    arrow = FancyArrowPatch(
        path=Outline(curve, [Outline.MOVETO] + [bent] * (len(curve) - 1)),
        arrowstyle="-|>",
        mutation_scale=15,
        linewidth=1.5,
        color=LIGHT.soft,
        zorder=2,
    )
    axes.add_patch(arrow)


def _draw_label(axes: Axes, place: np.ndarray, label: str) -> None:
    box: dict[str, Any] = {"facecolor": LIGHT.paper, "edgecolor": "none", "boxstyle": "round,pad=0.18"}
    style: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 6, "linespacing": 1.25}
    axes.text(place[0], place[1], label, size=TEXT_SIZE, color=LIGHT.ink, bbox=box, **style)


def _fit(figure: Figure, axes: Axes, layout: Arrangement, sizes: np.ndarray) -> None:
    """Let all that is drawn be within the figure, whose scale does not depend on the machine."""
    around, beside = RADIUS + MARGIN, sizes / 2 + GAP
    ways = [BezierSegment(curve)(POINTS) for curve in layout.curves]
    low = np.concatenate([layout.places - around, layout.spots - beside, *ways]).min(axis=0)
    high = np.concatenate([layout.places + around, layout.spots + beside, *ways]).max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.axis("off")
    figure.set_size_inches(INCHES * (high - low))
