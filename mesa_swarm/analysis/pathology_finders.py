"""What finds each kind of pathology in a track."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from mesa_swarm.analysis.pathology_track import (
    FIRE,
    LOAD,
    OBSTACLE,
    ROBOT,
    Track,
    at,
    covered,
    flips_of,
    last_before,
    lasting,
    runs,
)
from mesa_swarm.errors import check_count, check_number

FRONT, LEFT, RIGHT = range(3)
FARTHEST = 1e9

# Rows, first and last frame, number of flips.
Found = tuple[tuple[int, ...], int, int, int]


@dataclass(frozen=True, kw_only=True, slots=True)
class Thresholds:
    """What counts as getting nowhere; see `pathology.find_pathologies`.

    Examples
    --------
    >>> Thresholds(fewest_flips=8).window
    60
    """

    near: float = 20.0
    window: int = 60
    fewest_flips: int = 10
    fewest_steps: int = 30
    slow_share: float = 0.2
    stuck_share: float = 0.1
    turned_degrees: float = 60.0
    forward_share: float = 0.25
    facing_degrees: float = 30.0
    gap: float = 5.0

    def __post_init__(self) -> None:
        """Check every value."""
        for name in ("near", "gap"):
            check_number(name, getattr(self, name), minimum=0, maximum=FARTHEST)
        for name in ("window", "fewest_flips", "fewest_steps"):
            check_count(name, getattr(self, name), minimum=2)
        for name in ("slow_share", "stuck_share", "forward_share"):
            check_number(name, getattr(self, name), above=0, maximum=1)
        for name in ("turned_degrees", "facing_degrees"):
            check_number(name, getattr(self, name), minimum=0, maximum=180)


def corridor_flips(track: Track, limits: Thresholds, taken: np.ndarray) -> list[Found]:
    """Find turns away from what is near on the left and on the right by turns, robots alone left out."""
    turn = track.turn
    before = last_before(turn)
    from_any = _away(track, limits, (OBSTACLE, ROBOT, FIRE, LOAD))
    from_solid = _away(track, limits, (OBSTACLE, FIRE, LOAD))
    flip = flips_of(turn) & from_any & at(from_any, before) & (from_solid | at(from_solid, before))
    return _turning(flip, track, limits, taken)


def _away(track: Track, limits: Thresholds, kinds: tuple[int, ...]) -> np.ndarray:
    """Tell who turns away from such a body that is near on the other side, or ahead."""
    front, left, right = (track.reads(kinds, limits.near, which) for which in (FRONT, LEFT, RIGHT))
    return ((track.turn > 0) & (right | front)) | ((track.turn < 0) & (left | front))


def centroid_flips(track: Track, limits: Thresholds, taken: np.ndarray) -> list[Found]:
    """Find turns towards robots that are seen by other sensors after each turn."""
    turn, seen = track.turn, track.kind == ROBOT
    before = last_before(turn)
    left, right = (track.reads((ROBOT,), limits.near, which) for which in (LEFT, RIGHT))
    away = ((turn > 0) & right & ~left) | ((turn < 0) & left & ~right)
    drawn = seen.any(axis=2) & ~away
    other = (seen != at(seen, before)).any(axis=2)
    flip = flips_of(turn) & drawn & at(drawn, before) & other
    return _turning(flip, track, limits, taken)


def threshold_flips(track: Track, limits: Thresholds, taken: np.ndarray) -> list[Found]:
    """Find driving forwards and backwards by turns."""
    flip = flips_of(track.travel)
    return _episodes(_flipping(flip, track, limits, taken), flip)


def _flipping(flip: np.ndarray, track: Track, limits: Thresholds, taken: np.ndarray) -> np.ndarray:
    """Tell in which steps (k, n) flips come fast enough while the robot gets nowhere."""
    row, frame = np.nonzero(flip.T & ~taken.T)
    most = max(len(row) - limits.fewest_flips + 1, 0)
    who, first, last = row[:most], frame[:most], frame[limits.fewest_flips - 1 :]
    others = np.concatenate([np.zeros((1, taken.shape[1]), np.int64), taken.cumsum(axis=0)])
    mine = (who == row[limits.fewest_flips - 1 :]) & (others[first, who] == others[last, who])
    good = mine & (last - first <= limits.window) & _gets_nowhere(track, limits, who, first, last)
    return covered(flip.shape, who[good], first[good], last[good])


def _turning(flip: np.ndarray, track: Track, limits: Thresholds, taken: np.ndarray) -> list[Found]:
    """Return the episodes of turns to and fro, without the steps of journeys."""
    mask = _flipping(flip, track, limits, taken)
    found = _episodes(mask & ~_gets_away(track, limits, mask), flip)
    return [episode for episode in found if episode[3] >= limits.fewest_flips]


def _episodes(mask: np.ndarray, flip: np.ndarray) -> list[Found]:
    return [((i,), a, b, int(np.count_nonzero(flip[a : b + 1, i]))) for i, a, b in runs(mask)]


def _gets_away(track: Track, limits: Thresholds, mask: np.ndarray) -> np.ndarray:
    """Tell in which of these steps (k, n) a robot gets farther than its radius within `window` steps of them.

    Stretches in each of which it does not may, joined, be a journey.
    """
    away = np.zeros(mask.shape, bool)
    for i, a, b in runs(mask):
        length = min(limits.window, b - a)
        way = np.hypot(*(track.position[a + length : b + 1, i] - track.position[a : b + 1 - length, i]).T)
        first = a + np.flatnonzero(way >= track.radius[i])
        away |= covered(mask.shape, np.full(len(first), i), first, first + length)
    return away


def _gets_nowhere(track: Track, limits: Thresholds, row: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Tell who is, after the last step, about where it was after the first, and has not turned away either."""
    way = np.hypot(*(track.position[last, row] - track.position[first, row]).T)
    possible = track.max_speed[row] * (last - first)
    turned = track.heading[last, row] - track.heading[first, row]
    still = way < np.minimum(track.radius[row], limits.slow_share * possible)
    return still & (np.cos(turned) > np.cos(np.radians(limits.turned_degrees)))


def stuck_robots(track: Track, limits: Thresholds, taken: np.ndarray) -> list[Found]:
    """Find robots that are commanded forwards and do not move."""
    speed, steps = track.command.mean(axis=2), limits.fewest_steps
    driving = (speed >= limits.forward_share * track.max_speed) & (track.max_speed > 0) & ~taken
    first, row = lasting(driving, steps)
    last = first + steps - 1
    commanded, along = speed.cumsum(axis=0), _progress(track).cumsum(axis=0)
    least = limits.stuck_share * (commanded[last, row] - commanded[first - 1, row])
    progress = along[last, row] - along[first - 1, row]
    still = (_displacement(track, first, last, row) < least) & (progress < least)
    mask = covered(taken.shape, row[still], first[still], last[still])
    return [((i,), a, b, 0) for i, a, b in runs(mask)]


def _progress(track: Track) -> np.ndarray:
    """Return how far each robot moved along its heading in each step (k, n), 0 in the first."""
    ahead = np.stack([np.cos(track.heading), np.sin(track.heading)], axis=-1)
    moved = np.zeros(track.heading.shape)
    half_way = (ahead[1:] + ahead[:-1]) / 2
    moved[1:] = (np.diff(track.position, axis=0) * half_way).sum(axis=2)
    return moved


def _displacement(track: Track, first: np.ndarray, last: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return how far robots got from before the first to after the last step."""
    return np.hypot(*(track.position[last, row] - track.position[first - 1, row]).T)


def head_on_pairs(track: Track, limits: Thresholds, taken: np.ndarray) -> list[Found]:
    """Find pairs that block each other's way."""
    steps, turns = limits.fewest_steps, track.turn != 0
    wants = ((track.travel > 0) | (turns & (track.travel == 0))) & ~taken
    first, row = lasting(wants, steps)
    last = first + steps - 1
    still = _displacement(track, first, last, row) < limits.stuck_share * track.max_speed[row] * steps
    frame, robot = np.nonzero(covered(taken.shape, row[still], first[still], last[still]))
    if not len(robot):
        return []
    first, second, when = _facing(track, limits, frame, robot)
    order = np.lexsort((when, second, first))
    first, second, when = first[order], second[order], when[order]
    broken = (np.diff(first) != 0) | (np.diff(second) != 0) | (np.diff(when) != 1)
    bounds = np.concatenate([[0], np.flatnonzero(broken) + 1, [len(when)]])
    return [
        ((int(first[a]), int(second[a])), int(when[a]), int(when[b - 1]), 0)
        for a, b in pairwise(bounds)
        if b - a >= steps
    ]


def _facing(track: Track, limits: Thresholds, frame: np.ndarray, robot: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return (row, greater row, frame) wherever two of these robots face each other at close quarters."""
    reach = 2.0 * track.radius.max() + limits.gap
    # Frames are stacked so far apart that robots of different frames are never near each other.
    stacked = np.column_stack([track.position[frame, robot], frame * (2.0 * reach + 1.0)])
    pairs = cKDTree(stacked).query_pairs(reach, output_type="ndarray")
    pairs = np.sort(pairs, axis=1)  # by frame, then by row: ascending rows within a frame
    i, j, when = robot[pairs[:, 0]], robot[pairs[:, 1]], frame[pairs[:, 0]]
    x, y = (track.position[when, j] - track.position[when, i]).T
    apart, least = np.hypot(x, y), np.cos(np.radians(limits.facing_degrees))
    here, there = track.heading[when, i], track.heading[when, j]
    facing = np.cos(here) * x + np.sin(here) * y >= least * apart
    facing &= -np.cos(there) * x - np.sin(there) * y >= least * apart
    facing &= apart <= track.radius[i] + track.radius[j] + limits.gap
    return i[facing], j[facing], when[facing]
