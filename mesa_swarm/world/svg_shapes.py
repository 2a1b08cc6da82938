"""From one element of an SVG drawing to shapes: discs stay discs, everything else becomes polygons.

Curves are replaced by chords that stray from them by at most `tolerance`, in map units. The stroke does not
count, except where there is nothing else: a line, or an open outline without fill, is as thick as its stroke.
"""

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import shapely

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.world.map_parts import FireSpot
from mesa_swarm.world.map_work import CURVE, DISC, ROUNDED_CORNER, Work
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape, checked_rings, disc, polygon
from mesa_swarm.world.svg_paths import elliptic_arc, nested, subpaths
from mesa_swarm.world.svg_values import LARGEST_ENTRY, is_similarity, length, moved, points, scale_of

MOST_SUBPATHS = 2_000


class Drawn(NamedTuple):
    """An element to be made into shapes: its tag, its attributes, and what it inherits.

    `matrix` leads from its own coordinates to the map's; `place` is how errors name it.
    """

    tag: str
    attributes: Mapping[str, str]
    place: str
    matrix: np.ndarray
    role: str = "obstacle"
    filled: bool = True
    even_odd: bool = False
    stroke_width: str = "1"


def shapes_of(drawn: Drawn, tolerance: float, work: Work) -> list[Shape]:
    """Return the shapes that an element stands for.

    Parameters
    ----------
    drawn : Drawn
        A rect, circle, ellipse, line, polyline, polygon or path.
    tolerance : float
        Largest distance between a curve and the chords it is replaced by, map units.
    work : Work
        What may still be spent.

    Raises
    ------
    InvalidValueError
        If an attribute is wrong or what is drawn is not a simple shape.

    Examples
    --------
    >>> circle = Drawn("circle", {"cx": "40", "cy": "30", "r": "5"}, "<circle> on line 1", np.eye(3))
    >>> [shape.kind for shape in shapes_of(circle, 0.04, Work(100))]
    ['disc']
    """
    return list(_READERS[drawn.tag](drawn, tolerance, work))


def fire_of(drawn: Drawn) -> FireSpot:
    """Return the fire that a circle stands for; `data-temperature` says how hot, 1 if it says nothing.

    Examples
    --------
    >>> fire_of(Drawn("circle", {"cx": "40", "cy": "30", "r": "10"}, "", np.eye(3))).area
    1.0
    """
    round_part = _disc(drawn) if drawn.tag in ("circle", "ellipse") else None
    if round_part is None:
        raise InvalidValueError("is a fire; fires are circles, and stay so when they are transformed")
    text = drawn.attributes.get("data-temperature", "1")
    try:
        temperature = float(text)
    except ValueError:
        raise InvalidValueError(f"data-temperature is {shortened(text)}; expected a number") from None
    return FireSpot(tuple(round_part.position.tolist()), round_part.radius, temperature)


def _round(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    """Yield a disc for what is round in the map, a polygon for what is not."""
    round_part = _disc(drawn)
    work.spend(CURVE if round_part is None else DISC)
    yield round_part or _solid(drawn, work, _ellipse(drawn, tolerance))


def _disc(drawn: Drawn) -> Shape | None:
    """Return the element as a disc, or None if it is not round in the map."""
    x, y, rx, ry = _centre_and_radii(drawn)
    if rx != ry or not is_similarity(drawn.matrix):
        return None
    centre = moved(np.array([x, y]), drawn.matrix)
    # The root of the determinant is exactly 1 for the identity.
    return disc(centre, rx * math.sqrt(abs(np.linalg.det(drawn.matrix[:2, :2]))), contact=_contact(drawn))


def _centre_and_radii(drawn: Drawn) -> tuple[float, float, float, float]:
    names = ("r", "r") if drawn.tag == "circle" else ("rx", "ry")
    rx, ry = (check_number(name, _length(drawn, name), above=0) for name in names)
    return _length(drawn, "cx"), _length(drawn, "cy"), rx, ry


def _ellipse(drawn: Drawn, tolerance: float) -> np.ndarray:
    x, y, rx, ry = _centre_and_radii(drawn)
    return elliptic_arc((x, y), (rx, ry), 0.0, 2 * math.pi, _own(drawn, tolerance))[:-1]


def _rect(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    x, y = _length(drawn, "x"), _length(drawn, "y")
    width = check_number("width", _length(drawn, "width"), above=0)
    height = check_number("height", _length(drawn, "height"), above=0)
    rx, ry = _corner_radii(drawn, width, height)
    if rx == 0 or ry == 0:
        yield _solid(drawn, work, np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)]))
        return
    left, right, low, high = x + rx, x + width - rx, y + ry, y + height - ry
    centres = [(right, high), (left, high), (left, low), (right, low)]
    work.spend(4 * ROUNDED_CORNER)
    quarter, own = math.pi / 2, _own(drawn, tolerance)
    arcs = [elliptic_arc(at, (rx, ry), i * quarter, quarter, own) for i, at in enumerate(centres)]
    yield _solid(drawn, work, np.concatenate(arcs))


def _corner_radii(drawn: Drawn, width: float, height: float) -> tuple[float, float]:
    """Return the radii of rounded corners: one given stands for both, and half the side is the most."""
    given = [drawn.attributes.get(name, "auto") for name in ("rx", "ry")]
    known = [None if text == "auto" else check_number("rx", length("rx", text), minimum=0) for text in given]
    rx, ry = (own if own is not None else other or 0.0 for own, other in (known, known[::-1]))
    return min(rx, width / 2), min(ry, height / 2)


def _polygon(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    yield _solid(drawn, work, _points(drawn))


def _polyline(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    yield _solid(drawn, work, _points(drawn)) if drawn.filled else _band(drawn, work, _points(drawn))


def _line(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    ends = [[_length(drawn, "x1"), _length(drawn, "y1")], [_length(drawn, "x2"), _length(drawn, "y2")]]
    yield _band(drawn, work, np.array(ends))


def _path(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    """Yield closed subpaths as outlines with holes, open ones too if filled, else as bands."""
    text = drawn.attributes.get("d", "")
    closed: list[np.ndarray] = []
    bands: list[np.ndarray] = []
    for is_closed, at in subpaths(text, _own(drawn, tolerance)):
        (closed if is_closed or drawn.filled else bands).append(at)
    if not closed and not bands:
        raise InvalidValueError("d draws nothing")
    if len(closed) > MOST_SUBPATHS:
        raise InvalidValueError(f"d has {len(closed)} parts; expected at most {MOST_SUBPATHS}")
    for outline, holes in nested(closed, drawn.even_odd, work):
        yield _solid(drawn, work, outline, holes)
    for at in bands:
        yield _band(drawn, work, at)


def _solid(
    drawn: Drawn, work: Work, outline: np.ndarray, holes: Iterable[np.ndarray] = (), are_apart: bool = False
) -> Shape:
    outline, *holes = (moved(np.asarray(ring), drawn.matrix) for ring in (outline, *holes))
    rings = checked_rings(outline, holes)
    work.spend_on_outlines(rings, are_apart)
    return polygon(rings[0], rings[1:], contact=_contact(drawn))


def _band(drawn: Drawn, work: Work, at: np.ndarray) -> Shape:
    """Return a line as thick as its stroke, with square-cut ends and mitred corners as SVG draws it."""
    thickness = length("stroke-width", drawn.stroke_width)
    width = check_number("stroke-width", thickness, above=0, maximum=LARGEST_COORDINATE)
    if not np.abs(at).max() <= LARGEST_ENTRY:
        raise InvalidValueError(f"is a line with a coordinate that is not within {LARGEST_ENTRY:g}")
    if (at == at[0]).all():
        raise InvalidValueError("is a line without length")
    work.spend_on_band(at, width)
    area = shapely.LineString(at).buffer(width / 2, cap_style="flat", join_style="mitre", mitre_limit=4.0)
    if area.geom_type != "Polygon" or area.is_empty:
        raise InvalidValueError("is a line too thin for where it lies; give it a larger stroke-width")
    holes = [ring.coords for ring in area.interiors]
    return _solid(drawn, work, area.exterior.coords, holes, are_apart=True)  # paid for with the line


def _points(drawn: Drawn) -> np.ndarray:
    return points("points", drawn.attributes.get("points", ""))


def _length(drawn: Drawn, name: str) -> float:
    return length(name, drawn.attributes.get(name, "0"))


def _own(drawn: Drawn, tolerance: float) -> float:
    """Return the tolerance in the element's own coordinates; never 0, by which chords are divided."""
    return max(tolerance / scale_of(drawn.matrix), sys.float_info.min)


def _contact(drawn: Drawn) -> bool:
    return drawn.role != "mark"


_READERS: dict[str, Callable[[Drawn, float, Work], Iterator[Shape]]] = {
    "rect": _rect,
    "circle": _round,
    "ellipse": _round,
    "line": _line,
    "polyline": _polyline,
    "polygon": _polygon,
    "path": _path,
}
