"""How much work a map file may make: estimated from sizes and boxes before any of it is begun.

What makes geometry expensive is not how many corners there are but how many pairs of edges come near each other: a
file of some kilobytes can hold millions of such pairs, and each of its crossings becomes a corner of what is made.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
import shapely

from mesa_swarm.errors import InvalidValueError

# All work is counted in microseconds of an ordinary processor. This is what a file up to a megabyte may take; a
# larger one, which no page takes, may take as much for each megabyte.
MOST_WORK = 1_100_000.0
# And of it any single shape, of which less is known beforehand.
MOST_ON_SHAPE = 850_000.0
# Bytes of a file that is given no more than the least.
SMALL_FILE = 1_000_000
TOO_MUCH = "brings the map to more work than its file may make; draw fewer, simpler shapes"
LINE_TOO_CLOSE = "is a line that crosses itself, or comes near itself, too often; simplify it"

# Of a drawing, before it is known what it is.
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
# A hole is looked for in its outline corner by corner.
HOLE = 15.0
HOLE_CORNER = 0.003
# Of one path's outlines whose boxes touch, and of their corners; each edge near an edge of another one counts more.
RELATION = 40.0
RELATED_CORNER = 0.2
RELATED_PAIR = 1.0
# Of a line, of one that is looked through for crossings, of its points, of edges near each other, and that cross.
BAND = 50.0
LOOKED_THROUGH = 60.0
BAND_CORNER = 10.0
BAND_PAIR = 0.2
CROSSING = 25.0
# Sides of a line that is wider than this share of its length and breadth cross where rounding is tried again.
WIDE = 0.25
WIDE_CROSSING = 150.0
# Joins of a line's sides that are shorter than this share of half its width are where it goes straight on.
STRAIGHT = 0.01
# Outlines of which each edge may lie near each other one for less than this are not looked at.
UNSEEN = 200.0
# Sixteen bytes each, and some more for what is computed of them: at most, and enough to go on with.
MOST_PAIRS_AT_ONCE = 1_000_000
ENOUGH_PAIRS = 100_000

_given_up: ContextVar[Callable[[], bool]] = ContextVar("given_up", default=lambda: False)


@contextmanager
def stopping_when(given_up: Callable[[], bool]) -> Iterator[None]:
    """Have maps that are read within, in this thread, stop at their next shape once this returns True.

    Parameters
    ----------
    given_up : callable
        Asked before each shape.

    Raises
    ------
    concurrent.futures.CancelledError
        When reading stops.

    Examples
    --------
    >>> with stopping_when(lambda: True):
    ...     Work(1000).spend(1.0)
    Traceback (most recent call last):
    concurrent.futures._base.CancelledError: the map is no longer waited for
    """
    token = _given_up.set(given_up)
    try:
        yield
    finally:
        _given_up.reset(token)


class Work:
    """What may still be spent on reading one map file.

    Parameters
    ----------
    size : int
        Bytes, or characters, of the file.

    Attributes
    ----------
    left : float
        Microseconds.

    Examples
    --------
    >>> work = Work(1000)
    >>> work.spend_on_outlines([np.array([(0.0, 0.0), (9.0, 0.0), (0.0, 9.0)])])
    >>> round(work.left, 1)
    1099956.1
    """

    def __init__(self, size: int) -> None:
        self.left = MOST_WORK * max(1.0, size / SMALL_FILE)
        self._given_up = _given_up.get()

    def spend(self, cost: float) -> None:
        """Take the cost of work that is about to begin from what is left.

        Raises
        ------
        InvalidValueError
            If that is more than is left.
        concurrent.futures.CancelledError
            Once the map is no longer waited for, see `stopping_when`.
        """
        if self._given_up():
            raise CancelledError("the map is no longer waited for")
        if not cost <= self.left:
            raise InvalidValueError(TOO_MUCH)
        self.left -= cost

    def spend_on_outlines(self, rings: Sequence[np.ndarray], are_apart: bool = False) -> None:
        """Spend what it takes to check and keep a polygon: an outline, and holes in it.

        Parameters
        ----------
        rings : list of (n, 2) arrays
            The outline, then the holes.
        are_apart : bool
            Whether the pairs of their edges that come near each other are paid for already.

        Raises
        ------
        InvalidValueError
            If that is more than is left.
        """
        corners = sum(map(len, rings))
        holes = HOLE_CORNER * (len(rings) - 1) * len(rings[0])
        self.spend(POLYGON + CORNER * corners + holes + (HOLE * (len(rings) - 1)))
        if not are_apart:
            self._spend_on_pairs(rings, PAIR)

    def spend_on_parts(self, rings: Sequence[np.ndarray]) -> None:
        """Spend what it takes to find out which of a path's outlines lie in which."""
        if len(rings) < 2:
            return
        low, high = (np.array([end(ring, axis=0) for ring in rings]) for end in (np.min, np.max))
        sizes = np.array([len(ring) for ring in rings])
        most = int(self._affordable / RELATION) + len(rings)
        for one, other in self._touching(np.hstack([low, high]), most, TOO_MUCH):
            apart = one != other
            corners = sizes[one[apart]] + sizes[other[apart]]
            self.spend(RELATION * apart.sum() + RELATED_CORNER * corners.sum())
        self._spend_on_pairs(rings, RELATED_PAIR)

    def spend_on_band(self, at: np.ndarray, width: float) -> None:
        """Spend what it takes to draw a line with a thick pen: both its sides are laid over each other.

        Raises
        ------
        InvalidValueError
            If the line crosses itself, or comes near itself, too often.
        """
        self.spend(BAND + BAND_CORNER * len(at))
        if len(at) <= 3:
            return
        self.spend(LOOKED_THROUGH)
        sides = _sides(at, width / 2)
        rank = np.concatenate([np.arange(len(sides) // 2), np.arange(len(sides) // 2) - 2 * len(sides)])
        long = np.hypot(*(sides[:, 2:] - sides[:, :2]).T) > STRAIGHT * width / 2
        sides, rank = sides[long], rank[long]
        least = self.left - self._affordable
        crossing = WIDE_CROSSING if width > WIDE * np.ptp(at, axis=0).max() else CROSSING
        for one, other in self._touching(_boxes(sides), int(self._affordable / BAND_PAIR), LINE_TOO_CLOSE):
            apart = np.abs(rank[one] - rank[other]) > 2  # a corner's own edges meet, or cross where it is flat
            cost = BAND_PAIR * len(one) + crossing / 2 * _crossings(sides[one[apart]], sides[other[apart]])
            if self.left - cost < least:
                raise InvalidValueError(LINE_TOO_CLOSE)
            self.left -= cost

    @property
    def _affordable(self) -> float:
        """What any single shape may take: no more in a large file than in a small one."""
        return max(0.0, min(self.left, MOST_ON_SHAPE))

    def _spend_on_pairs(self, rings: Sequence[np.ndarray], price: float) -> None:
        """Spend on all pairs of edges that come near each other; a few edges are not worth counting their pairs."""
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
        for one, other in self._touching(boxes, 2 * affordable + 3 * count, too_close):
            pairs += int((one < other).sum())
        if pairs > affordable:
            raise InvalidValueError(too_close)
        self.left -= price * pairs

    def _touching(self, boxes: np.ndarray, most: int, refusal: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the pairs of boxes that touch, each both ways and each box with itself; refuse more than most."""
        found = 0
        for one, other in _touching(boxes):
            found += len(one)
            if found > most:
                raise InvalidValueError(refusal)
            self.spend(0.0)  # asks whether the map is still waited for
            yield one, other


def _touching(boxes: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the pairs of boxes that touch, each both ways and each box with itself, in parts of a bounded size."""
    if not len(boxes):
        return
    solid = shapely.box(*boxes.T)
    tree = shapely.STRtree(solid)
    # A box may touch all others, wherever they lie in the file: only so many can be asked for at once.
    batch = max(1, MOST_PAIRS_AT_ONCE // len(boxes))
    parts: list[np.ndarray] = []
    count = 0
    for first in range(0, len(boxes), batch):
        pairs = tree.query(solid[first : first + batch])
        pairs[0] += first
        parts.append(pairs)
        count += pairs.shape[1]
        if count >= ENOUGH_PAIRS or first + batch >= len(boxes):
            one, other = np.concatenate(parts, axis=1)
            for begin in range(0, count, ENOUGH_PAIRS):
                yield one[begin : begin + ENOUGH_PAIRS], other[begin : begin + ENOUGH_PAIRS]
            parts, count = [], 0


def _most_pairs(boxes: np.ndarray) -> int:
    """Return how many pairs of boxes overlap in x, or in y if those are fewer: sorting is quicker than looking."""
    fewest = len(boxes) ** 2
    for low, high in (boxes[:, [0, 2]].T, boxes[:, [1, 3]].T):
        begun = np.searchsorted(np.sort(low), high, side="right")
        ended = np.searchsorted(np.sort(high), low, side="left")
        fewest = min(fewest, int((begun - ended).sum() - len(boxes)) // 2)
    return fewest


def _edges(ring: np.ndarray) -> np.ndarray:
    """Return the ends of a ring's edges, shape (n, 4), the closing one included."""
    return np.hstack([ring, np.roll(ring, -1, axis=0)])


def _boxes(edges: np.ndarray) -> np.ndarray:
    return np.hstack([np.minimum(edges[:, :2], edges[:, 2:]), np.maximum(edges[:, :2], edges[:, 2:])])


def _sides(at: np.ndarray, half: float) -> np.ndarray:
    """Return the edges along both sides of a thick line, those that join them at its corners included."""
    step = np.diff(at, axis=0)
    length = np.hypot(*step.T)
    start, end, step = at[:-1][length > 0], at[1:][length > 0], step[length > 0]
    away = half * np.column_stack([-step[:, 1], step[:, 0]]) / length[length > 0, None]
    sides = []
    for shift in (away, -away):
        corners = np.stack([start + shift, end + shift], axis=1).reshape(-1, 2)
        sides.append(np.hstack([corners[:-1], corners[1:]]))
    return np.concatenate(sides)


def _crossings(one: np.ndarray, other: np.ndarray) -> int:
    """Return how many of the pairs of edges cross or touch."""
    apart = (_side_of(one, other[:, :2]) * _side_of(one, other[:, 2:]) > 0) | (
        _side_of(other, one[:, :2]) * _side_of(other, one[:, 2:]) > 0
    )
    return int((~apart).sum())


def _side_of(edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return 1 for points on the left of the edges, -1 on the right, 0 on their lines."""
    along, towards = edges[:, 2:] - edges[:, :2], points - edges[:, :2]
    return np.sign(along[:, 0] * towards[:, 1] - along[:, 1] * towards[:, 0])
