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

from mesa_swarm.errors import InvalidValueError, MapError, check_choice, check_number, shortened
from mesa_swarm.world.map_parts import (
    CURVE,
    DISC,
    ELEMENT,
    LONGEST_NAME,
    PATH,
    PATH_WORD,
    ROUNDED_CORNER,
    TRANSFORM,
    Bounds,
    FireSpot,
    Work,
    check_inside,
    checked_bounds,
    naming,
    refusal,
)
from mesa_swarm.world.shapes import LARGEST_COORDINATE, MOST_VERTICES, Shape, checked_rings, disc, polygon
from mesa_swarm.world.svg_paths import (
    LARGEST_ENTRY,
    MOST_PATH_WORDS,
    checked_matrix,
    elliptic_arc,
    is_similarity,
    length,
    moved,
    nested,
    numbers,
    path_words,
    points,
    properties,
    scale_of,
    subpaths,
    transform,
    viewbox,
    viewbox_numbers,
)

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


class Drawn(NamedTuple):
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


def fire_of(drawn: Drawn) -> FireSpot:
    """Return the fire of a circle, of the temperature `data-temperature`, by default 1."""
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
    """Yield a disc if the element is round in the map, else a polygon."""
    round_part = None if drawn.is_ring else _disc(drawn)
    work.spend(CURVE if round_part is None else DISC)
    yield round_part or _closed(drawn, work, _ellipse(drawn, tolerance))


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
        yield _closed(drawn, work, np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)]))
        return
    left, right, low, high = x + rx, x + width - rx, y + ry, y + height - ry
    centres = [(right, high), (left, high), (left, low), (right, low)]
    work.spend(4 * ROUNDED_CORNER)
    quarter, own = math.pi / 2, _own(drawn, tolerance)
    arcs = [elliptic_arc(at, (rx, ry), i * quarter, quarter, own) for i, at in enumerate(centres)]
    yield _closed(drawn, work, np.concatenate(arcs))


def _corner_radii(drawn: Drawn, width: float, height: float) -> tuple[float, float]:
    """Return the radii of rounded corners: a single one holds for both, and half the side is the limit."""
    given = [drawn.attributes.get(name, "auto") for name in ("rx", "ry")]
    known = [None if text == "auto" else check_number("rx", length("rx", text), minimum=0) for text in given]
    rx, ry = (own if own is not None else other or 0.0 for own, other in (known, known[::-1]))
    return min(rx, width / 2), min(ry, height / 2)


def _outline(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    """Yield a polygon, or a polyline, which is closed if it is filled, else a thick line."""
    at = points("points", drawn.attributes.get("points", ""))
    yield _closed(drawn, work, at) if drawn.filled or drawn.tag == "polygon" else _band(drawn, work, at)


def _line(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    ends = [[_length(drawn, "x1"), _length(drawn, "y1")], [_length(drawn, "x2"), _length(drawn, "y2")]]
    yield _band(drawn, work, np.array(ends))


def _path(drawn: Drawn, tolerance: float, work: Work) -> Iterator[Shape]:
    """Yield closed subpaths as outlines with holes, open ones too if filled, else as bands; without fill as rings."""
    text = drawn.attributes.get("d", "")
    closed: list[np.ndarray] = []
    bands: list[np.ndarray] = []
    for is_closed, at in subpaths(text, _own(drawn, tolerance)):
        (closed if is_closed or drawn.filled else bands).append(at)
    if not closed and not bands:
        raise InvalidValueError("d draws nothing")
    if len(closed) > MOST_SUBPATHS:
        raise InvalidValueError(f"d has {len(closed)} parts; expected at most {MOST_SUBPATHS}")
    if drawn.is_ring:
        bands, closed = [*map(_ended, closed), *bands], []
    for outline, holes in nested(closed, drawn.even_odd, work):
        yield _solid(drawn, work, outline, holes)
    for at in bands:
        yield _band(drawn, work, at)


def _closed(drawn: Drawn, work: Work, outline: np.ndarray) -> Shape:
    """Return the area in an outline, or, where only its stroke is painted, a ring."""
    return _band(drawn, work, _ended(outline)) if drawn.is_ring else _solid(drawn, work, outline)


def _ended(outline: np.ndarray) -> np.ndarray:
    """Return an outline that ends where it begins."""
    return outline if (outline[0] == outline[-1]).all() else np.concatenate([outline, outline[:1]])


def _solid(
    drawn: Drawn, work: Work, outline: np.ndarray, holes: Iterable[np.ndarray] = (), are_apart: bool = False
) -> Shape:
    outline, *holes = (moved(np.asarray(ring), drawn.matrix) for ring in (outline, *holes))
    rings = checked_rings(outline, holes)
    work.spend_on_outlines(rings, are_apart)
    return polygon(rings[0], rings[1:], contact=_contact(drawn))


def _band(drawn: Drawn, work: Work, at: np.ndarray) -> Shape:
    """Return a line as thick as its stroke, with square-cut ends and mitred corners as SVG draws it.

    One that ends where it begins is a ring, with a corner there.
    """
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
    "polyline": _outline,
    "polygon": _outline,
    "path": _path,
}


def read_svg(content: bytes, source: str) -> dict[str, Any]:
    """Return the contents of an SVG drawing, as the keyword arguments of `Map`.

    Errors name the element after `source`, with its id and line; the stem of `source` names a drawing without title.
    """
    work = Work(len(content))
    walk = _walked(content, source, work)
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
        self.drawn: list[Drawn] = []
        self.bounds: Bounds = (0.0, 0.0, 0.0, 0.0)
        self.begun = False
        self._titles: list[str] = []
        self._count = 0
        self._path_words = 0
        self._open: list[tuple[str, Drawn | None]] = []

    @property
    def name(self) -> str:
        """The title of the drawing, on one line."""
        title = "".join(self._titles).strip()
        return title if title.isprintable() else " ".join(title.split())

    def startPrefixMapping(self, prefix: str | None, uri: str | None) -> None:  # noqa: N802 (SAX's name)
        """Refuse a long name of a namespace: it is repeated for each element in it. `xmlns=""` is None."""
        self.begun = True
        if uri is not None and len(uri) > LONGEST_NAMESPACE:
            where = f"line {self._locator.getLineNumber()}"
            raise refusal(self.source, where, f"a namespace has more than {LONGEST_NAMESPACE} characters")

    def startElementNS(self, name: tuple[str | None, str], qname: str | None, attrs: Any) -> None:  # noqa: N802 (SAX's name)
        """Enter an element."""
        self.begun = True
        space, tag = name
        attributes = {key: value for (own, key), value in attrs.items() if own is None}
        place = self._place(tag, attributes)
        self._count += 1
        with naming(self.source, place):
            _check_size(self._count, len(self._open))
            known = space in (None, SVG)
            self._open.append((tag, self._entered(tag, attributes, place) if known else None))

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

    def _entered(self, tag: str, attributes: dict[str, str], place: str) -> Drawn | None:
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
        own = _inherited(parent, tag, attributes, place, self.work)
        if own is None or tag in GROUPS:
            return own
        words = path_words(own.attributes.get("d", ""))
        self._path_words += words
        if self._path_words > MOST_PATH_WORDS:
            raise InvalidValueError(f"brings all paths to more than {MOST_PATH_WORDS} numbers; simplify them")
        self.work.spend(ELEMENT + (PATH if tag == "path" else 0.0) + PATH_WORD * words)
        self.drawn.append(own)
        return None

    def _root(self, tag: str, attributes: dict[str, str], place: str) -> Drawn | None:
        if tag != "svg":
            raise InvalidValueError("is not a drawing; expected <svg>")
        width, height = _size(attributes)
        self.bounds = _bounds(attributes, width, height)
        turned = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, height], [0.0, 0.0, 1.0]])
        box = attributes.get("viewBox")
        aspect = attributes.get("preserveAspectRatio", "")
        matrix = turned if box is None else checked_matrix(turned @ viewbox(box, aspect, width, height))
        return _inherited(Drawn(tag, {}, place, matrix), tag, attributes, place, self.work)


def _walked(content: bytes, source: str, work: Work) -> _Walk:
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
        return checked_bounds((0.0, 0.0, width, height))
    bounds = checked_bounds(numbers("data-bounds", attributes["data-bounds"]))
    size = bounds[2] - bounds[0], bounds[3] - bounds[1]
    if not np.allclose(size, (width, height), rtol=1e-9):
        sides = f"{size[0]:g} x {size[1]:g}, the drawing {width:g} x {height:g}"
        raise InvalidValueError(f"data-bounds spans {sides}; make them agree")
    return bounds


def _inherited(parent: Drawn, tag: str, attributes: dict[str, str], place: str, work: Work) -> Drawn | None:
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
        matrix = checked_matrix(matrix @ transform(style["transform"]))
    return Drawn(
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
    for drawn in _placed(walk):
        if drawn.role == "fire":
            continue
        with naming(walk.source, drawn.place):
            for shape in list(_READERS[drawn.tag](drawn, tolerance, work)):
                vertices += len(shape.geometry.exterior.coords) if not shape.is_disc else 1
                if vertices > MOST_VERTICES:
                    raise InvalidValueError(f"brings the drawing to more than {MOST_VERTICES} points; simplify it")
                check_inside("shape", shape, walk.bounds)
                yield shape


def _fires(walk: _Walk) -> Iterator[Any]:
    for drawn in _placed(walk):
        if drawn.role == "fire":
            with naming(walk.source, drawn.place):
                fire = fire_of(drawn)
                check_inside("fire", fire, walk.bounds)
            yield fire


def _placed(walk: _Walk) -> Iterator[Drawn]:
    """Yield all elements, moved to the bounds; done last, where it undoes the move of `to_svg` to the bit."""
    move = np.array([[1.0, 0.0, walk.bounds[0]], [0.0, 1.0, walk.bounds[1]], [0.0, 0.0, 1.0]])
    before = after = move
    for drawn in walk.drawn:
        if drawn.matrix is not before:  # neighbours mostly share one
            before, after = drawn.matrix, move @ drawn.matrix
        yield drawn._replace(matrix=after)
