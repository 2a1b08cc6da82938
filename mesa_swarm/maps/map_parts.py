"""Shared parts of map readers: limits, checks, one-line errors, and the work that a file may cause.

The cost of geometry grows not with the number of corners but with the number of pairs of edges near each other: a
file of some kilobytes can hold millions of such pairs, and each crossing becomes a corner of the result.
"""

import stat
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.errors import GEOSException

from mesa_swarm.base.errors import (
    InvalidValueError,
    MapError,
    UnknownNameError,
    check_number,
    shortened,
    without_middle,
)
from mesa_swarm.base.files import LONGEST_SHOWN
from mesa_swarm.geometry import Bounds
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape

RADIUS_OF_UNIT_AREA = 10.0
LARGEST_FILE = 20_000_000
LONGEST_NAME = 200


@dataclass(frozen=True, slots=True)
class FireSpot:
    """Where a fire starts, how large, and how hot.

    Parameters
    ----------
    position : (x, y)
        Centre in map units, y up.
    radius : float
        Map units, above 0.
    temperature : float
        Above 0 and at most 1: a fire that starts at 0 would be out.

    Raises
    ------
    InvalidValueError
        If a number is outside its range.

    Examples
    --------
    >>> FireSpot((400, 300), 40).area
    16.0
    """

    position: tuple[float, float]
    radius: float
    temperature: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers and store them as floats."""
        x, y = check_items("position of a fire", self.position, 2)
        values = {
            "position": (coordinate("x of a fire", x), coordinate("y of a fire", y)),
            "radius": check_number("radius of a fire", self.radius, above=0, maximum=LARGEST_COORDINATE),
            "temperature": check_number("temperature of a fire", self.temperature, above=0, maximum=1),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def area(self) -> float:
        """The area in the sense of the fire model, (radius / 10)^2, without pi."""
        return (self.radius / RADIUS_OF_UNIT_AREA) ** 2


def coordinate(name: str, value: object) -> float:
    """Return a number within the limits of coordinates as a float, -0.0 as 0.0, which every file format preserves."""
    return check_number(name, value, minimum=-LARGEST_COORDINATE, maximum=LARGEST_COORDINATE) + 0.0


def check_map_bounds(bounds: object) -> Bounds:
    """Return `(x_min, y_min, x_max, y_max)` as floats if they span an area."""
    names = ("x_min", "y_min", "x_max", "y_max")
    pairs = zip(names, check_items("bounds", bounds, 4), strict=True)
    x_min, y_min, x_max, y_max = (coordinate(f"{name} of the bounds", value) for name, value in pairs)
    check_number("width of the map", x_max - x_min, above=0, maximum=LARGEST_COORDINATE)
    check_number("height of the map", y_max - y_min, above=0, maximum=LARGEST_COORDINATE)
    return x_min, y_min, x_max, y_max


def check_map_name(name: object) -> str:
    """Return a map's name: printable, on one line, without spaces around it."""
    if not isinstance(name, str) or not name.isprintable() or not name.strip():
        raise InvalidValueError(f"name of the map is {shortened(name)}; expected a word or two")
    if name != name.strip() or len(name) > LONGEST_NAME:
        limit = f"at most {LONGEST_NAME} characters, no spaces around them"
        raise InvalidValueError(f"name of the map is {shortened(name)}; expected {limit}")
    return name


def check_inside(subject: str, part: Shape | FireSpot, bounds: Bounds) -> None:
    """Raise InvalidValueError for an obstacle or fire of which no part is within the bounds."""
    if first_points_within([part], bounds).all():
        return  # a tenth of the work
    geometry = part.geometry if isinstance(part, Shape) else shapely.Point(part.position)
    with np.errstate(all="ignore"):  # the geometry library divides by the width of a map, which may be tiny
        distance = shapely.distance(geometry, shapely.box(*bounds))
    if distance > part.radius:
        x, y = geometry.centroid.coords[0]
        area = "({:g}, {:g}) to ({:g}, {:g})".format(*bounds)
        raise InvalidValueError(f"{subject} at ({x:g}, {y:g}) lies outside the map, which spans {area}")


def first_points_within(parts: Sequence[Shape | FireSpot], bounds: Bounds) -> np.ndarray:
    """Return for each obstacle or fire whether its first point is within the bounds, as it nearly always is."""
    if not parts:
        return np.empty(0, bool)
    geometries = [part.geometry for part in parts if isinstance(part, Shape)]
    if geometries:
        points, owner = shapely.get_coordinates(geometries, return_index=True)
        x, y = points[np.searchsorted(owner, np.arange(len(parts)))].T
    else:
        x, y = np.array([part.position for part in parts]).T
    return (bounds[0] <= x) & (x <= bounds[2]) & (bounds[1] <= y) & (y <= bounds[3])


def refusal(source: str, place: str, reason: object) -> MapError:
    """Return the error that names, on one line, the file, the place in it, and the reason."""
    shown_source = source if len(source) <= LONGEST_SHOWN + 3 else f"...{source[-LONGEST_SHOWN:]}"
    text = " ".join(": ".join(str(part) for part in (shown_source, place, reason) if part).split())
    return MapError(without_middle(text))


@contextmanager
def name_file_in_errors(source: str, place: str = "") -> Iterator[None]:
    """Turn a wrong value into a MapError that names the file and the place."""
    try:
        yield
    except (InvalidValueError, UnknownNameError) as error:
        raise refusal(source, place, error) from None
    except GEOSException as error:  # rounding that the geometry library cannot handle
        raise refusal(source, place, f"cannot be computed by the geometry library: {error}") from None


def file_content(path: Path, limit: int = LARGEST_FILE) -> bytes:
    """Return a file's bytes; its kind and size are checked before reading, since a device may have no end."""
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):
            raise refusal(str(path), "", "is a folder or device; expected a file")
        if about.st_size > limit:
            raise refusal(str(path), "", f"has {about.st_size} bytes; expected at most {limit}")
        return path.read_bytes()
    except OSError as error:
        raise refusal(str(path), "", error.strerror) from None


def decode_text(content: bytes, source: str) -> str:
    """Return UTF-8 bytes as text, without a byte-order mark."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refusal(source, f"byte {error.start + 1}", "not UTF-8 text") from None


def bytes_of(content: str | bytes, source: str) -> bytes:
    """Return text as UTF-8, and bytes as they are."""
    try:
        return content.encode() if isinstance(content, str) else content
    except UnicodeEncodeError as error:  # half of a surrogate pair
        raise refusal(source, f"character {error.start + 1}", "not Unicode text") from None


def check_items(name: str, value: Any, length: int, expected: str = "") -> tuple:
    """Return the items of a list, tuple or array of a given length."""
    try:
        items = () if isinstance(value, (str, bytes)) or not hasattr(value, "__len__") else tuple(value)
    except Exception:  # of a user's class that is not a list
        items = ()
    if len(items) != length:
        raise InvalidValueError(f"{name} is {shortened(value)}; expected {expected or f'{length} numbers'}")
    return items


# All work is counted in microseconds of an ordinary processor. Limit of a file up to a megabyte; of a larger one, which
# the page does not accept, for each megabyte.
MOST_WORK = 1_100_000.0
# Limit of a single shape, of which less is known beforehand.
MOST_ON_SHAPE = 850_000.0
# Bytes of a file that may cause the least work only.
SMALL_FILE = 1_000_000
TOO_MUCH = "brings the map to more work than its file may make; draw fewer, simpler shapes"
LINE_TOO_CLOSE = "is a line that crosses itself, or comes near itself, too often; simplify it"

# Of any element of a drawing.
ELEMENT = 20.0
DISC = 25.0
POLYGON = 40.0
CORNER = 1.2
# Of edges whose boxes touch.
PAIR = 0.1
# An ellipse, a rounded corner, a path, one of the numbers of a path with curves, and a function of a transform.
CURVE = 60.0
ROUNDED_CORNER = 25.0
PATH = 90.0
PATH_WORD = 12.0
TRANSFORM = 20.0
# A hole is compared with its outline corner by corner.
HOLE = 15.0
HOLE_CORNER = 0.003
# Of one path's outlines whose boxes touch, and of their corners; each edge near an edge of another one counts more.
RELATION = 40.0
RELATED_CORNER = 0.2
RELATED_PAIR = 1.0
# Of a line, of one that is searched for crossings, of its points, of edges near each other, and of edges that cross.
BAND = 50.0
SEARCHED = 60.0
BAND_CORNER = 10.0
BAND_PAIR = 0.2
CROSSING = 25.0
# Sides of a line that is wider than this share of its length and breadth cross where rounding is tried again.
WIDE = 0.25
WIDE_CROSSING = 150.0
# Where joins of a line's sides are shorter than this share of half its width, the line is straight.
STRAIGHT = 0.01
# Outlines are not searched for near edges if even all pairs of edges would cost less than this.
UNSEEN = 200.0
# Sixteen bytes each, and some more for intermediate results: at most, and enough at a time.
MOST_PAIRS_AT_ONCE = 1_000_000
ENOUGH_PAIRS = 100_000

_is_given_up: ContextVar[Callable[[], bool]] = ContextVar("given_up", default=lambda: False)


@contextmanager
def stop_reading_when(is_given_up: Callable[[], bool]) -> Iterator[None]:
    """Stop reading maps within the block, in this thread, at the next shape once `is_given_up` returns True.

    The reader then raises `concurrent.futures.CancelledError`.
    """
    token = _is_given_up.set(is_given_up)
    try:
        yield
    finally:
        _is_given_up.reset(token)


class Work:
    """Work that reading one map file of `size` bytes or characters may still cause: `left`, in microseconds."""

    def __init__(self, size: int) -> None:
        self.left = MOST_WORK * max(1.0, size / SMALL_FILE)
        self._is_given_up = _is_given_up.get()

    def spend(self, cost: float) -> None:
        """Subtract the cost of work that is about to begin, and refuse it if that is more than is left.

        A `CancelledError` is raised once the map is no longer waited for, see `stop_reading_when`.
        """
        if self._is_given_up():
            raise CancelledError("the map is no longer waited for")
        if not cost <= self.left:
            raise InvalidValueError(TOO_MUCH)
        self.left -= cost

    def spend_on_outlines(self, rings: Sequence[np.ndarray], are_apart: bool = False) -> None:
        """Spend the cost of checking and storing a polygon: an outline, then its holes, (n, 2) arrays.

        `are_apart` means that the pairs of edges near each other are paid for already.
        """
        corners = sum(map(len, rings))
        holes = HOLE_CORNER * (len(rings) - 1) * len(rings[0])
        self.spend(POLYGON + CORNER * corners + holes + (HOLE * (len(rings) - 1)))
        if not are_apart:
            self._spend_on_pairs(rings, PAIR)

    def spend_on_parts(self, rings: Sequence[np.ndarray]) -> None:
        """Spend the cost of finding which of a path's outlines contain which."""
        if len(rings) < 2:
            return
        low, high = (np.array([end(ring, axis=0) for ring in rings]) for end in (np.min, np.max))
        sizes = np.array([len(ring) for ring in rings])
        most = int(self._affordable / RELATION) + len(rings)
        for first, second in self._touching(np.hstack([low, high]), most, TOO_MUCH):
            apart = first != second
            corners = sizes[first[apart]] + sizes[second[apart]]
            self.spend(RELATION * apart.sum() + RELATED_CORNER * corners.sum())
        self._spend_on_pairs(rings, RELATED_PAIR)

    def spend_on_band(self, at: np.ndarray, width: float) -> None:
        """Spend the cost of a thick line, whose sides are overlaid; refuse one that crosses itself too often."""
        self.spend(BAND + BAND_CORNER * len(at))
        if len(at) <= 3:
            return
        self.spend(SEARCHED)
        sides = _sides(at, width / 2)
        rank = np.concatenate([np.arange(len(sides) // 2), np.arange(len(sides) // 2) - 2 * len(sides)])
        long = np.sqrt(((sides[:, 2:] - sides[:, :2]) ** 2).sum(axis=1)) > STRAIGHT * width / 2
        sides, rank = sides[long], rank[long]
        least = self.left - self._affordable
        crossing = WIDE_CROSSING if width > WIDE * np.ptp(at, axis=0).max() else CROSSING
        for first, second in self._touching(_boxes(sides), int(self._affordable / BAND_PAIR), LINE_TOO_CLOSE):
            apart = np.abs(rank[first] - rank[second]) > 2  # a corner's own edges meet, or cross where it is flat
            cost = BAND_PAIR * len(first) + crossing / 2 * _crossings(sides[first[apart]], sides[second[apart]])
            if self.left - cost < least:
                raise InvalidValueError(LINE_TOO_CLOSE)
            self.left -= cost

    @property
    def _affordable(self) -> float:
        """The limit of any single shape: no more in a large file than in a small one."""
        return max(0.0, min(self.left, MOST_ON_SHAPE))

    def _spend_on_pairs(self, rings: Sequence[np.ndarray], price: float) -> None:
        """Spend the price of all pairs of edges near each other; the pairs of a few edges need not be counted."""
        count = sum(map(len, rings))
        at_most = price * count * (count - 1) / 2
        if at_most <= min(UNSEEN, self.left):
            self.left -= at_most
            return
        boxes = _boxes(np.concatenate([_edges(ring) for ring in rings]))
        at_most = price * _most_pairs(boxes)
        if at_most <= self._affordable / 5:
            self.left -= at_most
            return
        affordable = int(self._affordable / price)
        too_close = f"has an outline of {count} edges that come near each other too often; simplify it"
        pairs = 0
        for first, second in self._touching(boxes, 2 * affordable + 3 * count, too_close):
            pairs += int((first < second).sum())
        if pairs > affordable:
            raise InvalidValueError(too_close)
        self.left -= price * pairs

    def _touching(self, boxes: np.ndarray, most: int, refusal: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the pairs of boxes that touch, each both ways and each box with itself; refuse more than most."""
        count = 0
        for first, second in _list_touching(boxes):
            count += len(first)
            if count > most:
                raise InvalidValueError(refusal)
            self.spend(0.0)  # stops if reading is cancelled
            yield first, second


def _list_touching(boxes: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the pairs of boxes that touch, each both ways and each box with itself, in parts of a bounded size."""
    if not len(boxes):
        return
    solid = shapely.box(*boxes.T)
    tree = shapely.STRtree(solid)
    # A box may touch all others, wherever they are in the file: only this number can be queried at once.
    batch = max(1, MOST_PAIRS_AT_ONCE // len(boxes))
    parts: list[np.ndarray] = []
    count = 0
    for first in range(0, len(boxes), batch):
        pairs = tree.query(solid[first : first + batch])
        pairs[0] += first
        parts.append(pairs)
        count += pairs.shape[1]
        if count >= ENOUGH_PAIRS or first + batch >= len(boxes):
            pairs = np.concatenate(parts, axis=1)
            for begin in range(0, count, ENOUGH_PAIRS):
                yield tuple(pairs[:, begin : begin + ENOUGH_PAIRS])
            parts, count = [], 0


def _most_pairs(boxes: np.ndarray) -> int:
    """Return the number of pairs of boxes that overlap in x, or in y if fewer: sorting is quicker than searching."""
    fewest = len(boxes) ** 2
    for low, high in (boxes[:, [0, 2]].T, boxes[:, [1, 3]].T):
        begins = np.searchsorted(np.sort(low), high, side="right")
        ends = np.searchsorted(np.sort(high), low, side="left")
        fewest = min(fewest, int((begins - ends).sum() - len(boxes)) // 2)
    return fewest


def _edges(ring: np.ndarray) -> np.ndarray:
    """Return the ends of a ring's edges, shape (n, 4), the closing one included."""
    return np.hstack([ring, np.roll(ring, -1, axis=0)])


def _boxes(edges: np.ndarray) -> np.ndarray:
    return np.hstack([np.minimum(edges[:, :2], edges[:, 2:]), np.maximum(edges[:, :2], edges[:, 2:])])


def _sides(at: np.ndarray, half: float) -> np.ndarray:
    """Return the edges along both sides of a thick line, those that join them at its corners included."""
    step = np.diff(at, axis=0)
    length = np.sqrt((step**2).sum(axis=1))
    start, end, step = at[:-1][length > 0], at[1:][length > 0], step[length > 0]
    away = half * np.column_stack([-step[:, 1], step[:, 0]]) / length[length > 0, None]
    sides = []
    for shift in (away, -away):
        corners = np.stack([start + shift, end + shift], axis=1).reshape(-1, 2)
        sides.append(np.hstack([corners[:-1], corners[1:]]))
    return np.concatenate(sides)


def _crossings(sides: np.ndarray, other_sides: np.ndarray) -> int:
    """Return the number of pairs of edges that cross or touch."""
    apart = (_side_of(sides, other_sides[:, :2]) * _side_of(sides, other_sides[:, 2:]) > 0) | (
        _side_of(other_sides, sides[:, :2]) * _side_of(other_sides, sides[:, 2:]) > 0
    )
    return int((~apart).sum())


def _side_of(edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return 1 for points on the left of the edges, -1 on the right, 0 on their lines."""
    along, towards = edges[:, 2:] - edges[:, :2], points - edges[:, :2]
    return np.sign(along[:, 0] * towards[:, 1] - along[:, 1] * towards[:, 0])
