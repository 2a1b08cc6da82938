"""Outlines of SVG paths: curves replaced by chords, subpaths told apart, holes given to what they pierce."""

import math
import re
from collections.abc import Iterator

import numpy as np
import shapely
from svgelements import Arc, Close, CubicBezier, Curve, Line, Move, Path, QuadraticBezier

from mesa_swarm.errors import InvalidValueError, shortened
from mesa_swarm.world.map_work import Work
from mesa_swarm.world.shapes import MOST_VERTICES, checked_rings, polygon
from mesa_swarm.world.svg_values import numbers, points

MOST_CHORDS = 10_000
MOST_PATH_WORDS = 40_000

_PATH_TEXT = re.compile(r"\s*[Mm][MmZzLlHhVvCcSsQqTtAa\d\s,.eE+-]*", re.ASCII)
_STRAIGHT_PATH = re.compile(r"\s*(M[\d\s,.eE+-]+Z\s*)+", re.ASCII)
_COMMAND = re.compile(r"([MmZzLlHhVvCcSsQqTtAa])([^MmZzLlHhVvCcSsQqTtAa]*)")
# Numbers that each command takes; an arc's 7 cannot be counted, because its flags need no space between them.
_COMMAND_ARGUMENTS = {"m": 2, "l": 2, "h": 1, "v": 1, "c": 6, "s": 4, "q": 4, "t": 2, "a": 1}
_PATH_WORD = re.compile(r"[a-zA-Z]|[\d.]+")


def path_words(text: str) -> int:
    """Return how many numbers and commands svgelements would have to read: each takes it some 10 us.

    Examples
    --------
    >>> path_words("M 0,0 c 1,1 2,2 3,3 z")
    11
    """
    if _STRAIGHT_PATH.fullmatch(text):
        return 0
    return len(text) if len(text) > 20 * MOST_PATH_WORDS else len(_PATH_WORD.findall(text))


def subpaths(text: str, tolerance: float) -> Iterator[tuple[bool, np.ndarray]]:
    """Yield (is closed, points) of each subpath, curves replaced by chords.

    Parameters
    ----------
    text : str
        The d attribute.
    tolerance : float
        Largest distance between a curve and its chords, in the units of the path.

    Raises
    ------
    InvalidValueError
        If the text is not path data, or would make too many points.

    Examples
    --------
    >>> [(closed, at.tolist()) for closed, at in subpaths("M 0 0 h 10 v 10 z", 0.04)]
    [(True, [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 0.0]])]
    """
    if not _PATH_TEXT.fullmatch(text):
        raise InvalidValueError(f"d is {shortened(text)}; expected path data that begins with M")
    if _STRAIGHT_PATH.fullmatch(text):  # what we write ourselves, and a hundred times faster than svgelements
        for part in text.split("M")[1:]:
            yield True, points("d", part.strip()[:-1])
    else:
        yield from _curved_subpaths(text, tolerance)


def nested(rings: list[np.ndarray], even_odd: bool, work: Work) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
    """Yield each outline with its holes, as the fill rule has it: rings may nest but not cross.

    Parameters
    ----------
    rings : list of (n, 2) arrays
        Closed subpaths.
    even_odd : bool
        Whether every ring inside another changes solid to hole; else opposite directions do.
    work : Work
        What may still be spent.

    Raises
    ------
    InvalidValueError
        If a ring crosses itself or another one.

    Examples
    --------
    >>> square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    >>> [len(holes) for _, holes in nested([10 * square, 1 + square], True, Work(100))]
    [1]
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
    """Return ends of chords on an upright ellipse from angle `start` over `sweep` radians.

    Examples
    --------
    >>> elliptic_arc((0, 0), (1, 2), 0, math.pi, 1.0).round(3)[:3].tolist()
    [[1.0, 0.0], [0.707, 1.414], [0.0, 2.0]]
    """
    count = chord_count(sweep * math.sqrt(max(radii) / (8 * tolerance)))
    angles = start + np.linspace(0, sweep, max(count, math.ceil(sweep)) + 1)
    return np.column_stack([centre[0] + radii[0] * np.cos(angles), centre[1] + radii[1] * np.sin(angles)])


def chord_count(wished: float) -> int:
    """Return a whole number of chords, at least 1; refuse what would flood the memory.

    Examples
    --------
    >>> chord_count(3.2)
    4
    """
    if not wished <= MOST_CHORDS:
        raise InvalidValueError("has a curve far larger than the map")
    return max(1, math.ceil(wished))


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
    """Yield the joined segments without repeated points; nothing for a pen that was only set down."""
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
    control = np.array([(point.x, point.y) for point in _control_points(segment)])
    degree = len(control) - 1
    bend = np.linalg.norm(np.diff(control, n=2, axis=0), axis=1).max()
    count = chord_count(math.sqrt(degree * (degree - 1) / 8 * bend / tolerance))
    inner = segment.npoint(np.linspace(0, 1, count + 1)[1:-1])
    return np.vstack([control[0], inner, control[-1]])


def _control_points(segment: CubicBezier | QuadraticBezier) -> tuple:
    if isinstance(segment, QuadraticBezier):
        return segment.start, segment.control, segment.end
    return segment.start, segment.control1, segment.control2, segment.end


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
