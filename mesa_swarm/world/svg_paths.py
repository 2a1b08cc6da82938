"""SVG numbers, lengths and transforms, and paths flattened with their holes.

Every reader here is strict where browsers are lenient: an attribute that is not understood is refused,
because a silently misread map is worse than an error.
"""

import math
import re
from collections.abc import Iterator, Mapping

import numpy as np
import shapely
from svgelements import Arc, Close, CubicBezier, Curve, Line, Matrix, Move, Path, QuadraticBezier

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.world.map_parts import Work
from mesa_swarm.world.shapes import LARGEST_COORDINATE, MOST_VERTICES, checked_rings, polygon

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
    found = _LENGTH.fullmatch(text[:LONGEST_LENGTH])
    if not found or found[2].lower() not in PIXELS:
        raise InvalidValueError(f"{name} is {shortened(text)}; expected a length such as 5, 5px, 5mm or 5in")
    return float(found[1]) * PIXELS[found[2].lower()]


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
        return _tight_numbers(name, text)


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
        given = numbers("transform", arguments)
        if len(given) not in _TRANSFORM_ARGUMENTS[kind]:
            raise refused
        if not np.abs(given).max() <= LARGEST_ENTRY:  # of an angle too: svgelements fails on sines of infinity
            raise InvalidValueError(f"transform has a number beyond {LARGEST_ENTRY:g}")
    own = Matrix(text)
    matrix = np.array([[own.a, own.c, own.e], [own.b, own.d, own.f], [0.0, 0.0, 1.0]], dtype=float)
    return checked_matrix(_without_dust(matrix))


def checked_matrix(matrix: np.ndarray) -> np.ndarray:
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
    merged = {name: value for name, value in attributes.items() if name != "style"}
    for declaration in attributes.get("style", "").split(";"):
        name, colon, value = declaration.partition(":")
        if colon:
            merged[name.strip()] = value.replace("!important", "").strip()
    return merged


def scale_of(matrix: np.ndarray) -> float:
    """Return the largest factor by which a matrix stretches a length."""
    return float(np.linalg.norm(matrix[:2, :2], 2))


def is_similarity(matrix: np.ndarray) -> bool:
    """Return whether a matrix turns, mirrors, scales and moves, so that circles stay circles."""
    (a, c), (b, d) = matrix[:2, :2].tolist()
    size = a * a + b * b
    return abs(c * c + d * d - size) <= 1e-9 * size and abs(a * c + b * d) <= 1e-9 * size


def moved(at: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return points moved by a matrix; the identity leaves every bit as it is."""
    with np.errstate(all="ignore"):  # overflows are refused as shapes
        return at @ matrix[:2, :2].T + matrix[:2, 2]


def _tight_numbers(name: str, text: str) -> list[float]:
    if _NUMBERS.sub("", text).strip(" \t\r\n,"):
        raise InvalidValueError(f"{name} is {shortened(text)}; expected numbers")
    return [float(word) for word in _NUMBERS.findall(text)]


def _without_dust(matrix: np.ndarray) -> np.ndarray:
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


def nested(rings: list[np.ndarray], even_odd: bool, work: Work) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
    """Yield each outline with its holes according to the fill rule: rings may nest but not cross.

    With `even_odd` every ring inside another changes solid to hole; else opposite directions do.
    """
    areas = np.array([_area(ring, work) for ring in rings], dtype=object)
    work.spend_on_parts(rings)
    inside = _containing(areas)
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


def chord_count(required: float) -> int:
    """Return a whole number of chords, at least 1; refuse a number that would fill the memory."""
    if not required <= MOST_CHORDS:
        raise InvalidValueError("has a curve far larger than the map")
    return max(1, math.ceil(required))


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
        return list(Path(text))
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
    work.spend_on_outlines(checked_rings(ring))
    return polygon(ring).geometry


def _containing(areas: np.ndarray) -> list[list[int]]:
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
