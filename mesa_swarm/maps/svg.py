"""SVG maps: a safe walk through the drawing, one element at a time.

The drawing is first walked by defusedxml with document types, entities and external references forbidden;
the shapes are made only once the whole of it has passed. svgelements parses transforms and path data, but never
the document, because it follows `<use>` and is lenient where a map must be exact.

Shapes are rect, circle, ellipse, line, polyline, polygon and path, in groups, with transforms. y is turned
to point up. A class or `data-kind` of `fire` makes a circle a fire, `mark` a mark on the ground; `background`,
text, definitions and elements with `display:none` are ignored. Style sheets are not read.

Curves are replaced by chords that stray from them by at most `tolerance`, in map units. The stroke counts only
where there is no fill: a line is as thick as its stroke, and an outline without fill is a ring of that width.
"""

import io
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax import SAXParseException
from xml.sax.handler import ContentHandler
from xml.sax.xmlreader import Locator

import numpy as np
import shapely
from defusedxml import DefusedXmlException, DTDForbidden
from defusedxml.expatreader import DefusedExpatParser
from svgelements import Arc, Close, CubicBezier, Curve, Line, Matrix, Move, QuadraticBezier
from svgelements import Path as SvgPath

from mesa_swarm.base.errors import InvalidValueError, MapError, check_choice, check_number, shortened
from mesa_swarm.geometry import Bounds
from mesa_swarm.maps.map_parts import (
    CURVE,
    DISC,
    ELEMENT,
    LONGEST_NAME,
    PATH,
    PATH_WORD,
    ROUNDED_CORNER,
    TRANSFORM,
    FireSpot,
    Work,
    check_inside,
    check_map_bounds,
    name_file_in_errors,
    refusal,
)
from mesa_swarm.world.shapes import LARGEST_COORDINATE, MOST_VERTICES, Shape, check_rings, disc, polygon

# CSS pixels by unit. Own table: svgelements rounds a millimetre to 3.7795296 px and reads "abc" as 0.
PIXELS = {"": 1.0, "px": 1.0, "pt": 96 / 72, "pc": 16.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4}
LONGEST_TRANSFORM = 500
LONGEST_LENGTH = 100
NEGLIGIBLE = 1e-12
LARGEST_ENTRY = 1e12

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LENGTH = re.compile(rf"\s*({_NUMBER})\s*([a-zA-Z]*)\s*")
_NUMBERS = re.compile(_NUMBER)
_OF_NUMBERS = re.compile(r"[\d\s,.eE+-]*", re.ASCII)
_TRANSFORM = re.compile(r"(matrix|translate|scale|rotate|skewX|skewY)\s*\(([\d\s,.eE+-]*)\)", re.ASCII)
_TRANSFORM_ARGUMENTS = {
    "matrix": {6},
    "translate": {1, 2},
    "scale": {1, 2},
    "rotate": {1, 3},
    "skewX": {1},
    "skewY": {1},
}
MOST_CHORDS = 10_000
MOST_PATH_WORDS = 40_000

_PATH_TEXT = re.compile(r"\s*[Mm][MmZzLlHhVvCcSsQqTtAa\d\s,.eE+-]*", re.ASCII)
_STRAIGHT_PATH = re.compile(r"\s*(M[\d\s,.eE+-]+Z\s*)+", re.ASCII)
_COMMAND = re.compile(r"([MmZzLlHhVvCcSsQqTtAa])([^MmZzLlHhVvCcSsQqTtAa]*)")
# Numbers that each command takes; an arc's 7 cannot be counted, because its flags need no space between them.
_COMMAND_ARGUMENTS = {"m": 2, "l": 2, "h": 1, "v": 1, "c": 6, "s": 4, "q": 4, "t": 2, "a": 1}
_PATH_WORD = re.compile(r"[a-zA-Z]|[\d.]+")


def length(name: str, text: str) -> float:
    """Return a length in CSS pixels (96 to the inch); units without a fixed size, such as % and em, are refused."""
    match = _LENGTH.fullmatch(text[:LONGEST_LENGTH])
    if not match or match[2].lower() not in PIXELS:
        raise InvalidValueError(f"{name} is {shortened(text)}; expected a length such as 5, 5px, 5mm or 5in")
    return float(match[1]) * PIXELS[match[2].lower()]


def numbers(name: str, text: str) -> list[float]:
    """Return a list of numbers separated by spaces, commas or only their signs."""
    if not _OF_NUMBERS.fullmatch(text):
        raise InvalidValueError(f"{name} is {shortened(text)}; expected numbers")
    words = text.replace(",", " ").split()
    if len(words) > 2 * MOST_VERTICES:
        raise InvalidValueError(f"{name} has more than {MOST_VERTICES} points; simplify it first")
    try:
        return [float(word) for word in words]
    except ValueError:  # tightly written, such as 3-4 or .5.5
        if _NUMBERS.sub("", text).strip(" \t\r\n,"):
            raise InvalidValueError(f"{name} is {shortened(text)}; expected numbers") from None
        return [float(word) for word in _NUMBERS.findall(text)]


def points(name: str, text: str) -> np.ndarray:
    """Return (n, 2) points from pairs of numbers."""
    values = numbers(name, text)
    if len(values) % 2 or not values:
        raise InvalidValueError(f"{name} has {len(values)} numbers; expected pairs")
    return np.array(values).reshape(-1, 2)


def transform(text: str) -> np.ndarray:
    """Return the 3 x 3 matrix of a transform attribute."""
    refused = InvalidValueError(f"transform is {shortened(text)}; expected functions such as translate(10, 20)")
    if len(text) > LONGEST_TRANSFORM or _TRANSFORM.sub("", text).strip(" \t\r\n,"):
        raise refused
    for kind, arguments in _TRANSFORM.findall(text):
        values = numbers("transform", arguments)
        if len(values) not in _TRANSFORM_ARGUMENTS[kind]:
            raise refused
        if not np.abs(values).max() <= LARGEST_ENTRY:  # of an angle too: svgelements fails on sines of infinity
            raise InvalidValueError(f"transform has a number beyond {LARGEST_ENTRY:g}")
    own = Matrix(text)
    matrix = np.array([[own.a, own.c, own.e], [own.b, own.d, own.f], [0.0, 0.0, 1.0]], dtype=float)
    return check_matrix(_drop_dust(matrix))


def check_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return a matrix if its numbers are at most 1e12 and areas stay above 0."""
    if not np.abs(matrix).max() <= LARGEST_ENTRY:
        raise InvalidValueError(f"transform has a number beyond {LARGEST_ENTRY:g}")
    if np.linalg.det(matrix[:2, :2]) == 0:
        raise InvalidValueError("transform squeezes the shape to nothing")
    return matrix


def viewbox(text: str, aspect: str, width: float, height: float) -> np.ndarray:
    """Return the matrix from view box to a viewport in pixels (SVG 2, section 8.2).

    `text` is the viewBox attribute, `aspect` preserveAspectRatio, empty for `xMidYMid meet`.
    """
    x, y, box_width, box_height = viewbox_numbers(text)
    align, _, crop = (" ".join(aspect.split()) or "xMidYMid").partition(" ")
    if not re.fullmatch(r"none|x(Min|Mid|Max)Y(Min|Mid|Max)", align) or crop not in ("", "meet", "slice"):
        raise InvalidValueError(f"preserveAspectRatio is {shortened(aspect)}; expected a value such as xMidYMid")
    scales = np.array([width / box_width, height / box_height])
    if align != "none":
        scales[:] = scales.max() if crop == "slice" else scales.min()
    share = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
    aligned = [share[align[1:4]], share[align[5:8]]] if align != "none" else [0.0, 0.0]
    shift = (np.array([width, height]) - scales * [box_width, box_height]) * aligned - scales * [x, y]
    return np.array([[scales[0], 0.0, shift[0]], [0.0, scales[1], shift[1]], [0.0, 0.0, 1.0]])


def viewbox_numbers(text: str) -> list[float]:
    """Return x, y, width and height of a viewBox attribute."""
    values = numbers("viewBox", text)
    if len(values) != 4:
        raise InvalidValueError(f"viewBox is {shortened(text)}; expected 4 numbers")
    for name, value in zip(("x", "y", "width", "height"), values, strict=True):
        above = 0 if name in ("width", "height") else -math.inf
        check_number(f"{name} of viewBox", value, above=above, maximum=LARGEST_COORDINATE)
    return values


def properties(attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the attributes, overridden by the declarations of the style attribute as in CSS."""
    styled = {name: value for name, value in attributes.items() if name != "style"}
    for declaration in attributes.get("style", "").split(";"):
        name, colon, value = declaration.partition(":")
        if colon:
            styled[name.strip()] = value.replace("!important", "").strip()
    return styled


def scale_of(matrix: np.ndarray) -> float:
    """Return the largest factor by which a matrix stretches a length."""
    return float(np.linalg.norm(matrix[:2, :2], 2))


def is_similarity(matrix: np.ndarray) -> bool:
    """Return whether a matrix turns, mirrors, scales and moves, so that circles stay circles."""
    (a, c), (b, d) = matrix[:2, :2].tolist()
    size = a * a + b * b
    return abs(c * c + d * d - size) <= 1e-9 * size and abs(a * c + b * d) <= 1e-9 * size


def move_points(at: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return points moved by a matrix; the identity leaves every bit as it is."""
    with np.errstate(all="ignore"):  # overflows are refused as shapes
        return at @ matrix[:2, :2].T + matrix[:2, 2]


def _drop_dust(matrix: np.ndarray) -> np.ndarray:
    """Set the rounding error of the cosine of rotate(90) to 0, so that rectangles stay rectangles."""
    linear = matrix[:2, :2]
    linear[np.abs(linear) < NEGLIGIBLE * np.abs(linear).max()] = 0.0
    return matrix


def path_words(text: str) -> int:
    """Return the number of numbers and commands that svgelements would have to read: each takes it some 10 us."""
    if _STRAIGHT_PATH.fullmatch(text):
        return 0
    return len(text) if len(text) > 20 * MOST_PATH_WORDS else len(_PATH_WORD.findall(text))


def subpaths(text: str, tolerance: float) -> Iterator[tuple[bool, np.ndarray]]:
    """Yield (is closed, points) of each subpath of a d attribute, curves replaced by chords.

    A curve is at most `tolerance` away from its chords, in the units of the path.
    """
    if not _PATH_TEXT.fullmatch(text):
        raise InvalidValueError(f"d is {shortened(text)}; expected path data that begins with M")
    if _STRAIGHT_PATH.fullmatch(text):  # as `to_svg` writes them; a hundred times faster than svgelements
        for part in text.split("M")[1:]:
            yield True, points("d", part.strip()[:-1])
    else:
        yield from _curved_subpaths(text, tolerance)


def nest_outlines(rings: list[np.ndarray], even_odd: bool, work: Work) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
    """Yield each outline with its holes according to the fill rule: rings may nest but not cross.

    With `even_odd` every ring inside another changes solid to hole; else opposite directions do.
    """
    areas = np.array([_area(ring, work) for ring in rings], dtype=object)
    work.spend_on_parts(rings)
    inside = _find_containers(areas)
    turns = [1 if even_odd or shapely.is_ccw(shapely.LinearRing(ring)) else -1 for ring in rings]
    outer = [sum(turns[j] for j in around) for around in inside]
    filled = [(_is_filled(n, even_odd), _is_filled(n + turns[i], even_odd)) for i, n in enumerate(outer)]
    holes: dict[int, list[np.ndarray]] = {i: [] for i, state in enumerate(filled) if state == (False, True)}
    for i, state in enumerate(filled):
        if state == (True, False):
            owner = min((j for j in inside[i] if j in holes), key=lambda j: float(shapely.area(areas[j])))
            holes[owner].append(rings[i])
    for i, own in holes.items():
        yield rings[i], own


def elliptic_arc(
    centre: tuple[float, float], radii: tuple[float, float], start: float, sweep: float, tolerance: float
) -> np.ndarray:
    """Return ends of chords on an upright ellipse from azimuth `start` over `sweep` radians."""
    count = chord_count(sweep * math.sqrt(max(radii) / (8 * tolerance)))
    azimuths = start + np.linspace(0, sweep, max(count, math.ceil(sweep)) + 1)
    return np.column_stack([centre[0] + radii[0] * np.cos(azimuths), centre[1] + radii[1] * np.sin(azimuths)])


def chord_count(chords: float) -> int:
    """Return a whole number of chords, at least 1; refuse a number that would fill the memory."""
    if not chords <= MOST_CHORDS:
        raise InvalidValueError("has a curve far larger than the map")
    return max(1, math.ceil(chords))


def _curved_subpaths(text: str, tolerance: float) -> Iterator[tuple[bool, np.ndarray]]:
    parts: list[np.ndarray] = []
    count = 0
    for segment in _segments(text):
        if isinstance(segment, Move):
            yield from _subpath(parts, is_closed=False)
            parts = []
        else:
            parts.append(_chords(segment, tolerance))
            count += len(parts[-1])
        if count > MOST_VERTICES:
            raise InvalidValueError(f"has more than {MOST_VERTICES} points; simplify it first")
        if isinstance(segment, Close):
            yield from _subpath(parts, is_closed=True)
            parts = []
    yield from _subpath(parts, is_closed=False)


def _segments(text: str) -> list:
    incomplete = InvalidValueError(f"d is {shortened(text)}; expected complete path commands")
    # svgelements would guess what is missing
    if not all(_is_complete(command.lower(), arguments) for command, arguments in _COMMAND.findall(text)):
        raise incomplete
    try:
        return list(SvgPath(text))
    except (TypeError, ValueError, IndexError, ZeroDivisionError, OverflowError):
        raise incomplete from None


def _is_complete(command: str, arguments: str) -> bool:
    count = len(numbers("d", arguments))
    if command == "z":
        return count == 0
    return count > 0 and count % _COMMAND_ARGUMENTS[command] == 0


def _subpath(parts: list[np.ndarray], is_closed: bool) -> Iterator[tuple[bool, np.ndarray]]:
    """Yield the joined segments without repeated points, unless they are a single point."""
    if parts:
        at = np.concatenate(parts)
        fresh = np.append(True, (np.diff(at, axis=0) != 0).any(axis=1))
        if fresh.sum() > 1:
            yield is_closed or bool((at[0] == at[-1]).all()), at[fresh]


def _chords(segment: Line | Curve, tolerance: float) -> np.ndarray:
    """Return points on one segment, from its start to its end."""
    ends = np.array([[segment.start.x, segment.start.y], [segment.end.x, segment.end.y]], dtype=np.float64)
    if not np.isfinite(ends).all():
        raise InvalidValueError("d has a number that is not finite")
    if isinstance(segment, (CubicBezier, QuadraticBezier)):
        return _bezier(segment, tolerance)
    if isinstance(segment, Arc) and segment.sweep and segment.rx > 0 and segment.ry > 0:
        count = chord_count(abs(segment.sweep) * math.sqrt(max(segment.rx, segment.ry) / (8 * tolerance)))
        return np.vstack([ends[0], segment.npoint(np.linspace(0, 1, count + 1)[1:-1]), ends[1]])
    return ends  # a straight line, or an arc of no radius, which SVG draws as one


def _bezier(segment: CubicBezier | QuadraticBezier, tolerance: float) -> np.ndarray:
    """Return ends of chords of equal parameter steps; second differences bound how far they stray."""
    inner = (segment.control,) if isinstance(segment, QuadraticBezier) else (segment.control1, segment.control2)
    control = np.array([(point.x, point.y) for point in (segment.start, *inner, segment.end)])
    degree = len(control) - 1
    bend = np.linalg.norm(np.diff(control, n=2, axis=0), axis=1).max()
    count = chord_count(math.sqrt(degree * (degree - 1) / 8 * bend / tolerance))
    return np.vstack([control[0], segment.npoint(np.linspace(0, 1, count + 1)[1:-1]), control[-1]])


def _area(ring: np.ndarray, work: Work) -> shapely.Polygon:
    work.spend_on_outlines(check_rings(ring))
    return polygon(ring).geometry


def _find_containers(areas: np.ndarray) -> list[list[int]]:
    """Return for each area the indices of those around it: larger ones, and earlier ones of the same size."""
    around: list[list[int]] = [[] for _ in areas]
    tree = shapely.STRtree(areas)
    if tree.query(areas, predicate="overlaps").size:
        raise InvalidValueError("has parts that cross each other; unite them in the editor")
    for i, j in tree.query(shapely.point_on_surface(areas), predicate="within").T.tolist():
        if (areas[j].area, i) > (areas[i].area, j):
            around[i].append(j)
    return around


def _is_filled(winding: int, even_odd: bool) -> bool:
    return bool(winding % 2) if even_odd else winding != 0


MOST_SUBPATHS = 2_000
MOST_ELEMENTS = 10_000
DEEPEST_ELEMENT = 100
LONGEST_ATTRIBUTE = 5_000
LONGEST_NAMESPACE = 500
# Curves may stray by this share of the map's longer side: 0.04 units on 800.
TOLERANCE_OF_SIDE = 5e-5

SVG = "http://www.w3.org/2000/svg"
ROLES = ("obstacle", "mark", "fire", "background")
SHAPES = ("rect", "circle", "ellipse", "line", "polyline", "polygon", "path")
GROUPS = ("g", "a")
REFUSED = ("use", "image", "script", "foreignObject", "svg", "switch")
IGNORED = (
    *("title", "desc", "metadata", "defs", "style", "text", "view"),
    *("symbol", "marker", "pattern", "clipPath", "mask", "filter", "linearGradient", "radialGradient"),
)


class SvgElement(NamedTuple):
    """An element to be made into shapes: `matrix` leads from its coordinates to the map's, errors name its `place`."""

    tag: str
    attributes: Mapping[str, str]
    place: str
    matrix: np.ndarray
    role: str = "obstacle"
    filled: bool = True
    even_odd: bool = False
    stroked: bool = False
    stroke_width: str = "1"

    @property
    def is_ring(self) -> bool:
        """Whether only the stroke of a closed outline is painted."""
        return self.stroked and not self.filled


def fire_of(element: SvgElement) -> FireSpot:
    """Return the fire of a circle, of the temperature `data-temperature`, by default 1."""
    round_part = _disc(element) if element.tag in ("circle", "ellipse") else None
    if round_part is None:
        raise InvalidValueError("is a fire; fires are circles, and stay so when they are transformed")
    text = element.attributes.get("data-temperature", "1")
    try:
        temperature = float(text)
    except ValueError:
        raise InvalidValueError(f"data-temperature is {shortened(text)}; expected a number") from None
    return FireSpot(tuple(round_part.position.tolist()), round_part.radius, temperature)


def _round(element: SvgElement, tolerance: float, work: Work) -> Iterator[Shape]:
    """Yield a disc if the element is round in the map, else a polygon."""
    round_part = None if element.is_ring else _disc(element)
    work.spend(CURVE if round_part is None else DISC)
    yield round_part or _fill_or_stroke(element, work, _ellipse(element, tolerance))


def _disc(element: SvgElement) -> Shape | None:
    """Return the element as a disc, or None if it is not round in the map."""
    x, y, rx, ry = _centre_and_radii(element)
    if rx != ry or not is_similarity(element.matrix):
        return None
    centre = move_points(np.array([x, y]), element.matrix)
    # The root of the determinant is exactly 1 for the identity.
    return disc(centre, rx * math.sqrt(abs(np.linalg.det(element.matrix[:2, :2]))), contact=_has_contact(element))


def _centre_and_radii(element: SvgElement) -> tuple[float, float, float, float]:
    names = ("r", "r") if element.tag == "circle" else ("rx", "ry")
    rx, ry = (check_number(name, _length(element, name), above=0) for name in names)
    return _length(element, "cx"), _length(element, "cy"), rx, ry


def _ellipse(element: SvgElement, tolerance: float) -> np.ndarray:
    x, y, rx, ry = _centre_and_radii(element)
    return elliptic_arc((x, y), (rx, ry), 0.0, 2 * math.pi, _own_tolerance(element, tolerance))[:-1]


def _rect(element: SvgElement, tolerance: float, work: Work) -> Iterator[Shape]:
    x, y = _length(element, "x"), _length(element, "y")
    width = check_number("width", _length(element, "width"), above=0)
    height = check_number("height", _length(element, "height"), above=0)
    rx, ry = _corner_radii(element, width, height)
    if rx == 0 or ry == 0:
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        yield _fill_or_stroke(element, work, np.array(corners))
        return
    left, right, low, high = x + rx, x + width - rx, y + ry, y + height - ry
    centres = [(right, high), (left, high), (left, low), (right, low)]
    work.spend(4 * ROUNDED_CORNER)
    quarter, own = math.pi / 2, _own_tolerance(element, tolerance)
    arcs = [elliptic_arc(at, (rx, ry), i * quarter, quarter, own) for i, at in enumerate(centres)]
    yield _fill_or_stroke(element, work, np.concatenate(arcs))


def _corner_radii(element: SvgElement, width: float, height: float) -> tuple[float, float]:
    """Return the radii of rounded corners: a single one holds for both, and half the side is the limit."""
    texts = [element.attributes.get(name, "auto") for name in ("rx", "ry")]
    radii = [None if text == "auto" else check_number("rx", length("rx", text), minimum=0) for text in texts]
    rx, ry = (own if own is not None else other or 0.0 for own, other in (radii, radii[::-1]))
    return min(rx, width / 2), min(ry, height / 2)


def _outline(element: SvgElement, tolerance: float, work: Work) -> Iterator[Shape]:
    """Yield a polygon, or a polyline, which is closed if it is filled, else a thick line."""
    at = points("points", element.attributes.get("points", ""))
    yield _fill_or_stroke(element, work, at) if element.filled or element.tag == "polygon" else _band(element, work, at)


def _line(element: SvgElement, tolerance: float, work: Work) -> Iterator[Shape]:
    ends = [[_length(element, "x1"), _length(element, "y1")], [_length(element, "x2"), _length(element, "y2")]]
    yield _band(element, work, np.array(ends))


def _path(element: SvgElement, tolerance: float, work: Work) -> Iterator[Shape]:
    """Yield closed subpaths as outlines with holes, open ones too if filled, else as bands; without fill as rings."""
    text = element.attributes.get("d", "")
    closed: list[np.ndarray] = []
    bands: list[np.ndarray] = []
    for is_closed, at in subpaths(text, _own_tolerance(element, tolerance)):
        (closed if is_closed or element.filled else bands).append(at)
    if not closed and not bands:
        raise InvalidValueError("d draws nothing")
    if len(closed) > MOST_SUBPATHS:
        raise InvalidValueError(f"d has {len(closed)} parts; expected at most {MOST_SUBPATHS}")
    if element.is_ring:
        bands, closed = [*map(_close_ring, closed), *bands], []
    for outline, holes in nest_outlines(closed, element.even_odd, work):
        yield _solid(element, work, outline, holes)
    for at in bands:
        yield _band(element, work, at)


def _fill_or_stroke(element: SvgElement, work: Work, outline: np.ndarray) -> Shape:
    """Return the area in an outline, or, where only its stroke is painted, a ring."""
    return _band(element, work, _close_ring(outline)) if element.is_ring else _solid(element, work, outline)


def _close_ring(outline: np.ndarray) -> np.ndarray:
    """Return an outline that ends where it begins."""
    return outline if (outline[0] == outline[-1]).all() else np.concatenate([outline, outline[:1]])


def _solid(
    element: SvgElement, work: Work, outline: np.ndarray, holes: Iterable[np.ndarray] = (), are_apart: bool = False
) -> Shape:
    outline, *holes = (move_points(np.asarray(ring), element.matrix) for ring in (outline, *holes))
    rings = check_rings(outline, holes)
    work.spend_on_outlines(rings, are_apart)
    return polygon(rings[0], rings[1:], contact=_has_contact(element))


def _band(element: SvgElement, work: Work, at: np.ndarray) -> Shape:
    """Return a line as thick as its stroke, with square-cut ends and mitred corners as SVG draws it.

    One that ends where it begins is a ring, with a corner there.
    """
    thickness = length("stroke-width", element.stroke_width)
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
    return _solid(element, work, area.exterior.coords, holes, are_apart=True)  # paid for with the line


def _length(element: SvgElement, name: str) -> float:
    return length(name, element.attributes.get(name, "0"))


def _own_tolerance(element: SvgElement, tolerance: float) -> float:
    """Return the tolerance in the element's own coordinates; never 0, by which chords are divided."""
    return max(tolerance / scale_of(element.matrix), sys.float_info.min)


def _has_contact(element: SvgElement) -> bool:
    return element.role != "mark"


_READERS: dict[str, Callable[[SvgElement, float, Work], Iterator[Shape]]] = {
    "rect": _rect,
    "circle": _round,
    "ellipse": _round,
    "line": _line,
    "polyline": _outline,
    "polygon": _outline,
    "path": _path,
}


def read_svg(content: bytes, source: str) -> dict[str, Any]:
    """Return the contents of an SVG drawing, as the keyword arguments of `Map`.

    Errors name the element after `source`, with its id and line; the stem of `source` names a drawing without title.
    """
    work = Work(len(content))
    walk = _walk(content, source, work)
    bounds = walk.bounds
    tolerance = TOLERANCE_OF_SIDE * max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    return {
        "name": walk.name or Path(source).stem.strip()[:LONGEST_NAME],
        "bounds": bounds,
        "obstacles": tuple(_obstacles(walk, tolerance, work)),
        "fires": tuple(_fires(walk)),
    }


class _Walk(ContentHandler):
    """The contents of a drawing, collected element by element before any shape is built."""

    _locator: Locator  # set by ContentHandler.setDocumentLocator

    def __init__(self, source: str, work: Work) -> None:
        super().__init__()
        self.work = work
        self.source = source
        self.elements: list[SvgElement] = []
        self.bounds: Bounds = (0.0, 0.0, 0.0, 0.0)
        self.begun = False
        self._titles: list[str] = []
        self._count = 0
        self._path_words = 0
        self._open: list[tuple[str, SvgElement | None]] = []

    @property
    def name(self) -> str:
        """The title of the drawing, on one line."""
        title = "".join(self._titles).strip()
        return title if title.isprintable() else " ".join(title.split())

    def startPrefixMapping(self, prefix: str | None, uri: str | None) -> None:  # noqa: N802 (SAX's name)
        """Refuse a long name of a namespace: it is repeated for each element in it. `xmlns=""` is None."""
        self.begun = True
        if uri is not None and len(uri) > LONGEST_NAMESPACE:
            place = f"line {self._locator.getLineNumber()}"
            raise refusal(self.source, place, f"a namespace has more than {LONGEST_NAMESPACE} characters")

    def startElementNS(self, name: tuple[str | None, str], qname: str | None, attrs: Any) -> None:  # noqa: N802 (SAX's name)
        """Enter an element."""
        self.begun = True
        space, tag = name
        attributes = {key: value for (own, key), value in attrs.items() if own is None}
        place = self._place(tag, attributes)
        self._count += 1
        with name_file_in_errors(self.source, place):
            _check_size(self._count, len(self._open))
            is_svg = space in (None, SVG)
            self._open.append((tag, self._enter(tag, attributes, place) if is_svg else None))

    def endElementNS(self, name: tuple[str | None, str], qname: str | None) -> None:  # noqa: N802 (SAX's name)
        """Leave an element."""
        self._open.pop()

    def characters(self, content: str) -> None:
        """Collect the text of the drawing's own title."""
        if len(self._open) == 2 and self._open[1][0] == "title":
            self._titles.append(content)

    def _place(self, tag: str, attributes: Mapping[str, str]) -> str:
        identity = f" {attributes['id'][:40]!r}" if "id" in attributes else ""
        return f"<{tag[:40]}>{identity} on line {self._locator.getLineNumber()}"

    def _enter(self, tag: str, attributes: dict[str, str], place: str) -> SvgElement | None:
        """Return what the children inherit; None where they are ignored."""
        if not self._open:
            return self._root(tag, attributes, place)
        if tag in REFUSED:
            raise InvalidValueError(f"<{tag}> is not allowed in a map; draw plain shapes")
        parent = self._open[-1][1]
        if parent is None or tag in IGNORED:
            return None
        if tag not in SHAPES and tag not in GROUPS:
            raise InvalidValueError(f"is not a shape that maps know: {', '.join(SHAPES)}")
        _check_attributes(attributes)
        own = _inherit(parent, tag, attributes, place, self.work)
        if own is None or tag in GROUPS:
            return own
        words = path_words(own.attributes.get("d", ""))
        self._path_words += words
        if self._path_words > MOST_PATH_WORDS:
            raise InvalidValueError(f"brings all paths to more than {MOST_PATH_WORDS} numbers; simplify them")
        self.work.spend(ELEMENT + (PATH if tag == "path" else 0.0) + PATH_WORD * words)
        self.elements.append(own)
        return None

    def _root(self, tag: str, attributes: dict[str, str], place: str) -> SvgElement | None:
        if tag != "svg":
            raise InvalidValueError("is not a drawing; expected <svg>")
        width, height = _size(attributes)
        self.bounds = _bounds(attributes, width, height)
        upright = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, height], [0.0, 0.0, 1.0]])
        box = attributes.get("viewBox")
        aspect = attributes.get("preserveAspectRatio", "")
        matrix = upright if box is None else check_matrix(upright @ viewbox(box, aspect, width, height))
        return _inherit(SvgElement(tag, {}, place, matrix), tag, attributes, place, self.work)


def _walk(content: bytes, source: str, work: Work) -> _Walk:
    walk = _Walk(source, work)
    parser = DefusedExpatParser(1, forbid_dtd=True, forbid_entities=True, forbid_external=True)
    parser.setContentHandler(walk)
    parser.setFeature("http://xml.org/sax/features/external-general-entities", False)
    try:
        parser.parse(io.BytesIO(content))
    except DTDForbidden:
        raise refusal(source, "", "declares a document type; remove the <!DOCTYPE ...> line") from None
    except DefusedXmlException:
        raise refusal(source, "", "declares entities or refers to other files; remove them") from None
    except SAXParseException as error:
        place = f"line {error.getLineNumber()}, column {(error.getColumnNumber() or 0) + 1}"
        raise refusal(source, place, f"not XML: {error.getMessage()}") from None
    except MapError:
        raise
    except (LookupError, ValueError, TypeError) as error:  # encodings that Python has but the XML parser cannot use
        if walk.begun:
            raise  # another error: encodings are named before the first element
        raise refusal(source, "", f"not XML in an encoding such as UTF-8: {error}") from None
    return walk


def _check_size(count: int, depth: int) -> None:
    if count > MOST_ELEMENTS:
        raise InvalidValueError(f"is one of more than {MOST_ELEMENTS} elements; simplify the drawing")
    if depth >= DEEPEST_ELEMENT:
        raise InvalidValueError(f"is nested deeper than {DEEPEST_ELEMENT} groups; ungroup the drawing")


def _check_attributes(attributes: Mapping[str, str]) -> None:
    for name, text in attributes.items():
        if len(text) > LONGEST_ATTRIBUTE and name not in ("d", "points"):
            raise InvalidValueError(f"{name[:40]} has more than {LONGEST_ATTRIBUTE} characters")


def _size(attributes: Mapping[str, str]) -> tuple[float, float]:
    """Return width and height; a missing one or a percentage is taken from the view box."""
    box = viewbox_numbers(attributes["viewBox"])[2:] if "viewBox" in attributes else (None, None)
    return _side(attributes, "width", box[0]), _side(attributes, "height", box[1])


def _side(attributes: Mapping[str, str], name: str, from_viewbox: float | None) -> float:
    text = attributes.get(name, "100%").strip()
    if (text.endswith("%") or text == "auto") and from_viewbox is not None:
        return from_viewbox
    return check_number(name, length(name, text), above=0, maximum=LARGEST_COORDINATE)


def _bounds(attributes: Mapping[str, str], width: float, height: float) -> Bounds:
    """Return the bounds: from (0, 0), unless `data-bounds` places the drawing elsewhere in the world."""
    if "data-bounds" not in attributes:
        return check_map_bounds((0.0, 0.0, width, height))
    bounds = check_map_bounds(numbers("data-bounds", attributes["data-bounds"]))
    size = bounds[2] - bounds[0], bounds[3] - bounds[1]
    if not np.allclose(size, (width, height), rtol=1e-9):
        sides = f"{size[0]:g} x {size[1]:g}, the drawing {width:g} x {height:g}"
        raise InvalidValueError(f"data-bounds spans {sides}; make them agree")
    return bounds


def _inherit(parent: SvgElement, tag: str, attributes: dict[str, str], place: str, work: Work) -> SvgElement | None:
    """Return an element with what it inherits from its parent; None if it is invisible."""
    style = {key: value for key, value in properties(attributes).items() if value != "inherit"}
    role = _role(attributes) or parent.role
    if style.get("display") == "none" or role == "background":
        return None
    for cut in ("clip-path", "mask"):
        if style.get(cut, "none") != "none":
            raise InvalidValueError(f"is cut by a {cut}; cut the shape itself in the editor")
    matrix = parent.matrix
    if "transform" in style:
        work.spend(TRANSFORM * (1 + style["transform"].count("(")))
        matrix = check_matrix(matrix @ transform(style["transform"]))
    return SvgElement(
        tag,
        style,
        place,
        matrix,
        role,
        filled=_paints(style["fill"]) if "fill" in style else parent.filled,
        even_odd=style["fill-rule"] == "evenodd" if "fill-rule" in style else parent.even_odd,
        stroked=_paints(style["stroke"]) if "stroke" in style else parent.stroked,
        stroke_width=style.get("stroke-width", parent.stroke_width),
    )


def _paints(paint: str) -> bool:
    return paint not in ("none", "transparent")


def _role(attributes: Mapping[str, str]) -> str | None:
    if "data-kind" in attributes:
        return check_choice("data-kind", attributes["data-kind"], ROLES)
    return next((word for word in attributes.get("class", "").split() if word in ROLES), None)


def _obstacles(walk: _Walk, tolerance: float, work: Work) -> Iterator[Shape]:
    """Make the obstacles one by one, and refuse the drawing as soon as it becomes too large."""
    vertices = 0
    for element in _place_elements(walk):
        if element.role == "fire":
            continue
        with name_file_in_errors(walk.source, element.place):
            for shape in list(_READERS[element.tag](element, tolerance, work)):
                vertices += len(shape.geometry.exterior.coords) if not shape.is_disc else 1
                if vertices > MOST_VERTICES:
                    raise InvalidValueError(f"brings the drawing to more than {MOST_VERTICES} points; simplify it")
                check_inside("shape", shape, walk.bounds)
                yield shape


def _fires(walk: _Walk) -> Iterator[Any]:
    for element in _place_elements(walk):
        if element.role == "fire":
            with name_file_in_errors(walk.source, element.place):
                fire = fire_of(element)
                check_inside("fire", fire, walk.bounds)
            yield fire


def _place_elements(walk: _Walk) -> Iterator[SvgElement]:
    """Yield all elements, moved to the bounds; done last, where it undoes the move of `to_svg` to the bit."""
    move = np.array([[1.0, 0.0, walk.bounds[0]], [0.0, 1.0, walk.bounds[1]], [0.0, 0.0, 1.0]])
    before = after = move
    for element in walk.elements:
        if element.matrix is not before:  # neighbours mostly share one
            before, after = element.matrix, move @ element.matrix
        yield element._replace(matrix=after)
