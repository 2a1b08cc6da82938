"""Unproductive behaviour: definitions, and how each kind is found."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from mesa_swarm.analysis.arrays import (
    LARGEST_COORDINATE,
    check_array,
    check_headings,
    check_steps,
    check_whole,
    check_whole_or_missing,
)
from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number

OBSTACLE, ROBOT, FIRE, LOAD = 0, 1, 2, 3
FRONT, LEFT, RIGHT = range(3)
# A command below this share of max_speed is rounding.
NOTHING = 1e-9
# Rows, first and last frame, number of flips.
Found = tuple[tuple[int, ...], int, int, int]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Track:
    """The recorded arrays, checked, and in which steps a robot is missing (k, n); see `find_pathologies`."""

    steps: np.ndarray
    position: np.ndarray
    heading: np.ndarray
    command: np.ndarray
    layer: np.ndarray
    distance: np.ndarray
    kind: np.ndarray
    radius: np.ndarray
    max_speed: np.ndarray
    forward: np.ndarray
    missing: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        """Check the arrays, and store them with their types."""
        steps = check_steps(self.steps)
        if (np.diff(steps) != 1).any():
            raise InvalidValueError("steps are not consecutive; expected every step: watch with every=1")
        k = len(steps)
        radius = check_array("radius", self.radius, ("n",))
        n = len(radius)
        distance = check_array("distance", self.distance, (k, n, "s"), missing=True)
        sensors = distance.shape[2]
        forward = check_whole("forward", self.forward, (n, 3))
        if ((forward < -1) | (forward >= sensors)).any():
            raise InvalidValueError(f"forward has an invalid sensor; expected -1 to {sensors - 1}")
        position = check_array("position", self.position, (k, n, 2), missing=True)
        heading = check_headings("heading", self.heading, (k, n))
        command = check_array("command", self.command, (k, n, 2), missing=True)
        layer, without_layer = check_whole_or_missing("layer", self.layer, (k, n))
        missing = np.isnan(position).any(axis=2) | np.isnan(heading) | np.isnan(command).any(axis=2) | without_layer
        arrays = {
            "steps": steps,
            "position": position,
            "heading": heading,
            "command": command,
            "layer": layer,
            "distance": distance,
            "kind": check_whole_or_missing("kind", self.kind, (k, n, sensors))[0],
            "radius": radius,
            "max_speed": check_array("max_speed", self.max_speed, (n,)),
            "forward": forward,
            "missing": missing,
        }
        for name, array in arrays.items():
            object.__setattr__(self, name, array)

    @property
    def turn(self) -> np.ndarray:
        """Side to which each robot turns in each step (k, n): 1 left, -1 right, 0 neither."""
        return self._sign(self.command[..., 1] - self.command[..., 0])

    @property
    def travel(self) -> np.ndarray:
        """Whether each robot is commanded forwards (1), backwards (-1) or neither (0) in each step (k, n)."""
        return self._sign(self.command.sum(axis=2))

    def reads(self, kinds: tuple[int, ...], near: float, side: int) -> np.ndarray:
        """Return the steps (k, n) in which the front (0), left (1) or right (2) sensor reads such a near body."""
        k, n, sensors = self.kind.shape
        if not sensors:
            return np.zeros((k, n), bool)
        index, rows = self.forward[:, side], np.arange(n)
        kind, distance = self.kind[:, rows, index], self.distance[:, rows, index]
        return np.isin(kind, kinds) & (distance >= 0) & (distance < near) & (index >= 0)

    def _sign(self, speed: np.ndarray) -> np.ndarray:
        return np.sign(np.where(np.abs(speed) > NOTHING * self.max_speed, speed, 0.0))


def last_before(sign: np.ndarray) -> np.ndarray:
    """Return for each step (k, n) the last one before it in which the sign was not 0, or -1."""
    last = np.where(sign != 0, np.arange(len(sign))[:, None], -1)
    last = np.maximum.accumulate(last, axis=0)
    return np.concatenate([np.full((1, sign.shape[1]), -1), last[:-1]])[: len(sign)]


def flips_of(sign: np.ndarray) -> np.ndarray:
    """Return the steps (k, n) in which the sign is the opposite of the last one that was not 0."""
    before = last_before(sign)
    return (before >= 0) & (sign * look_up_step(sign, before) < 0)


def look_up_step(values: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return each robot's value in another step (k, n), which may be -1: an arbitrary value then."""
    return values[frame, np.arange(frame.shape[1])] if len(values) else values


def mark_steps(shape: tuple[int, int], row: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return a mask (k, n) of the steps `first` to `last`, inclusive, of these rows."""
    change = np.zeros((shape[0] + 1, shape[1]), np.int64)
    np.add.at(change, (first, row), 1)
    np.add.at(change, (last + 1, row), -1)
    return change.cumsum(axis=0)[:-1] > 0


def find_runs(mask: np.ndarray) -> list[tuple[int, int, int]]:
    """Return (row, first, last) of every run of true values along the first axis."""
    edge = np.diff(mask.astype(np.int8), axis=0, prepend=0, append=0).T
    row, first = np.nonzero(edge > 0)
    _, end = np.nonzero(edge < 0)
    return [(int(i), int(a), int(b) - 1) for i, a, b in zip(row, first, end, strict=True)]


def find_lasting(mask: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Return first step and row of every stretch of `length` steps in a row, without step 0.

    Step 0 is left out as the positions before it are unknown.
    """
    if len(mask) <= length:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    total = np.concatenate([np.zeros((1, mask.shape[1]), np.int64), mask.cumsum(axis=0)])
    first, row = np.nonzero(total[length + 1 :] - total[1:-length] == length)
    return first + 1, row


@dataclass(frozen=True, kw_only=True, slots=True)
class Thresholds:
    """Thresholds of unproductive behaviour; see `find_pathologies`."""

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
            check_number(name, getattr(self, name), minimum=0, maximum=LARGEST_COORDINATE)
        for name in ("window", "fewest_flips", "fewest_steps"):
            check_count(name, getattr(self, name), minimum=2)
        for name in ("slow_share", "stuck_share", "forward_share"):
            check_number(name, getattr(self, name), above=0, maximum=1)
        for name in ("turned_degrees", "facing_degrees"):
            check_number(name, getattr(self, name), minimum=0, maximum=180)


def corridor_flips(track: Track, limits: Thresholds, is_taken: np.ndarray) -> list[Found]:
    """Find alternating turns away from things near on the left and right, of which not all are robots."""
    turn = track.turn
    before = last_before(turn)
    from_any = _away(track, limits, (OBSTACLE, ROBOT, FIRE, LOAD))
    from_solid = _away(track, limits, (OBSTACLE, FIRE, LOAD))
    flip = flips_of(turn) & from_any & look_up_step(from_any, before) & (from_solid | look_up_step(from_solid, before))
    return _turning(flip, track, limits, is_taken)


def _away(track: Track, limits: Thresholds, kinds: tuple[int, ...]) -> np.ndarray:
    """Return where robots (k, n) turn away from such a body that is near on the other side, or ahead."""
    front, left, right = (track.reads(kinds, limits.near, side) for side in (FRONT, LEFT, RIGHT))
    return ((track.turn > 0) & (right | front)) | ((track.turn < 0) & (left | front))


def centroid_flips(track: Track, limits: Thresholds, is_taken: np.ndarray) -> list[Found]:
    """Find turns towards robots that are seen by other sensors after each turn."""
    turn, sees_robot = track.turn, track.kind == ROBOT
    before = last_before(turn)
    left, right = (track.reads((ROBOT,), limits.near, side) for side in (LEFT, RIGHT))
    turns_away = ((turn > 0) & right & ~left) | ((turn < 0) & left & ~right)
    turns_towards = sees_robot.any(axis=2) & ~turns_away
    other = (sees_robot != look_up_step(sees_robot, before)).any(axis=2)
    flip = flips_of(turn) & turns_towards & look_up_step(turns_towards, before) & other
    return _turning(flip, track, limits, is_taken)


def threshold_flips(track: Track, limits: Thresholds, is_taken: np.ndarray) -> list[Found]:
    """Find alternation of driving forwards and backwards."""
    flip = flips_of(track.travel)
    return _episodes(_flipping(flip, track, limits, is_taken), flip)


def _flipping(flip: np.ndarray, track: Track, limits: Thresholds, is_taken: np.ndarray) -> np.ndarray:
    """Return the steps (k, n) in which flips come fast enough while the robot makes no progress."""
    row, frame = np.nonzero(flip.T & ~is_taken.T)
    most = max(len(row) - limits.fewest_flips + 1, 0)
    robot, first, last = row[:most], frame[:most], frame[limits.fewest_flips - 1 :]
    others = np.concatenate([np.zeros((1, is_taken.shape[1]), np.int64), is_taken.cumsum(axis=0)])
    same = (robot == row[limits.fewest_flips - 1 :]) & (others[first, robot] == others[last, robot])
    good = same & (last - first <= limits.window) & _makes_no_progress(track, limits, robot, first, last)
    return mark_steps(flip.shape, robot[good], first[good], last[good])


def _turning(flip: np.ndarray, track: Track, limits: Thresholds, is_taken: np.ndarray) -> list[Found]:
    """Return the episodes of alternating turns, without the steps in which the robot gets away."""
    mask = _flipping(flip, track, limits, is_taken)
    episodes = _episodes(mask & ~_gets_away(track, limits, mask), flip)
    return [episode for episode in episodes if episode[3] >= limits.fewest_flips]


def _episodes(mask: np.ndarray, flip: np.ndarray) -> list[Found]:
    return [((i,), a, b, int(np.count_nonzero(flip[a : b + 1, i]))) for i, a, b in find_runs(mask)]


def _gets_away(track: Track, limits: Thresholds, mask: np.ndarray) -> np.ndarray:
    """Return in which of these steps (k, n) a robot gets farther than its radius within `window` steps of them.

    Short stretches of no progress may add up to progress.
    """
    gets_away = np.zeros(mask.shape, bool)
    for i, a, b in find_runs(mask):
        length = min(limits.window, b - a)
        way = np.hypot(*(track.position[a + length : b + 1, i] - track.position[a : b + 1 - length, i]).T)
        first = a + np.flatnonzero(way >= track.radius[i])
        gets_away |= mark_steps(mask.shape, np.full(len(first), i), first, first + length)
    return gets_away


def _makes_no_progress(
    track: Track, limits: Thresholds, row: np.ndarray, first: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Return whether position and heading after the last step are about those after the first."""
    way = np.hypot(*(track.position[last, row] - track.position[first, row]).T)
    possible = track.max_speed[row] * (last - first)
    turn = track.heading[last, row] - track.heading[first, row]
    still = way < np.minimum(track.radius[row], limits.slow_share * possible)
    return still & (np.cos(turn) > np.cos(np.radians(limits.turned_degrees)))


def stuck_robots(track: Track, limits: Thresholds, is_taken: np.ndarray) -> list[Found]:
    """Find robots that are commanded forwards but do not move."""
    speed, steps = np.where(track.missing, 0.0, track.command.mean(axis=2)), limits.fewest_steps
    driving = (speed >= limits.forward_share * track.max_speed) & (track.max_speed > 0) & ~is_taken
    first, row = find_lasting(driving, steps)
    last = first + steps - 1
    commanded, along = speed.cumsum(axis=0), _progress(track).cumsum(axis=0)
    least = limits.stuck_share * (commanded[last, row] - commanded[first - 1, row])
    progress = along[last, row] - along[first - 1, row]
    still = (_displacement(track, first, last, row) < least) & (progress < least)
    mask = mark_steps(is_taken.shape, row[still], first[still], last[still])
    return [((i,), a, b, 0) for i, a, b in find_runs(mask)]


def _progress(track: Track) -> np.ndarray:
    """Return how far each robot moved along its heading in each step (k, n), 0 in the first and where not known."""
    ahead = np.stack([np.cos(track.heading), np.sin(track.heading)], axis=-1)
    progress = np.zeros(track.heading.shape)
    half_way = (ahead[1:] + ahead[:-1]) / 2
    progress[1:] = (np.diff(track.position, axis=0) * half_way).sum(axis=2)
    return np.where(np.isnan(progress), 0.0, progress)  # where a robot is missing, which no episode spans


def _displacement(track: Track, first: np.ndarray, last: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return how far robots got from before the first to after the last step."""
    return np.hypot(*(track.position[last, row] - track.position[first - 1, row]).T)


def head_on_pairs(track: Track, limits: Thresholds, is_taken: np.ndarray) -> list[Found]:
    """Find pairs that block each other's way."""
    steps = limits.fewest_steps
    turns_on_the_spot = (track.turn != 0) & (track.travel == 0)
    active = ((track.travel > 0) | turns_on_the_spot) & ~is_taken
    begin, row = find_lasting(active, steps)
    end = begin + steps - 1
    still = _displacement(track, begin, end, row) < limits.stuck_share * track.max_speed[row] * steps
    frame, robot = np.nonzero(mark_steps(is_taken.shape, row[still], begin[still], end[still]))
    if not len(robot):
        return []
    first, second, frames = _facing(track, limits, frame, robot)
    order = np.lexsort((frames, second, first))
    first, second, frames = first[order], second[order], frames[order]
    broken = (np.diff(first) != 0) | (np.diff(second) != 0) | (np.diff(frames) != 1)
    bounds = np.concatenate([[0], np.flatnonzero(broken) + 1, [len(frames)]])
    return [
        ((int(first[a]), int(second[a])), int(frames[a]), int(frames[b - 1]), 0)
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
    i, j, frames = robot[pairs[:, 0]], robot[pairs[:, 1]], frame[pairs[:, 0]]
    x, y = (track.position[frames, j] - track.position[frames, i]).T
    apart, least = np.hypot(x, y), np.cos(np.radians(limits.facing_degrees))
    heading, other_heading = track.heading[frames, i], track.heading[frames, j]
    facing = np.cos(heading) * x + np.sin(heading) * y >= least * apart
    facing &= -np.cos(other_heading) * x - np.sin(other_heading) * y >= least * apart
    facing &= apart <= track.radius[i] + track.radius[j] + limits.gap
    return i[facing], j[facing], frames[facing]


# In order of precedence: the function that finds each kind, and its description.
FINDERS = {
    "corridor flip": (corridor_flips, "turned alternately away from things near on its left and right, {flips} times"),
    "centroid flip": (
        centroid_flips,
        "turned alternately left and right, {flips} times, towards robots that changed from sensor to sensor",
    ),
    "head-on pair": (head_on_pairs, "faced each other at close quarters and blocked each other's way"),
    "back-and-forth at a threshold": (threshold_flips, "drove alternately forwards and backwards, {flips} times"),
    "stuck": (stuck_robots, "was commanded forwards but did not move"),
}
KINDS = tuple(FINDERS)


@dataclass(frozen=True, kw_only=True, slots=True)
class Episode:
    """One stretch of unproductive behaviour.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    robots : tuple of int
        Rows, ascending: two for a head-on pair, else one.
    first_step, last_step : int
        Both inclusive; of flips the first and the last.
    flips : int
        How often the turn, or the direction of travel, changed sides; 0 for the other kinds.
    layers : tuple of int
        The layers that drove the robots in these steps, ascending, -1 for none.
    """

    kind: str
    robots: tuple[int, ...]
    first_step: int
    last_step: int
    flips: int = 0
    layers: tuple[int, ...] = ()

    @property
    def steps(self) -> int:
        """The number of steps."""
        return self.last_step - self.first_step + 1

    def describe(self, ids: Sequence[int] | None = None) -> str:
        """Return the episode as one sentence.

        Parameters
        ----------
        ids : sequence of int, optional
            The unique_id of each row; by default robots are named by their rows.

        Examples
        --------
        >>> Episode(kind="stuck", robots=(3,), first_step=10, last_step=49, layers=(1,)).describe()
        'Robot 3 was commanded forwards but did not move, in steps 10 to 49 (layer 1).'
        """
        robots = "Robot " if len(self.robots) == 1 else "Robots "
        robots += " and ".join(str(row if ids is None else ids[row]) for row in self.robots)
        layers = ", ".join(map(str, self.layers))
        drove = f" (layer{'s' if len(self.layers) > 1 else ''} {layers})" if layers else ""
        words = FINDERS[self.kind][1].format(flips=self.flips)
        return f"{robots} {words}, in steps {self.first_step} to {self.last_step}{drove}."


@dataclass(frozen=True, slots=True)
class Pathologies:
    """Episodes, by first step, then kind in the order of `KINDS`, then robots.

    Parameters
    ----------
    episodes : tuple of Episode
    missing : int
        Robots' steps that are in no episode since the robot was missing.

    Examples
    --------
    >>> found = Pathologies((Episode(kind="stuck", robots=(3,), first_step=10, last_step=49),))
    >>> len(found), found.counts()["stuck"], found.of(0)
    (1, 1, ())
    """

    episodes: tuple[Episode, ...]
    missing: int = 0

    def __len__(self) -> int:
        """Count the episodes."""
        return len(self.episodes)

    def __iter__(self) -> Iterator[Episode]:
        """Iterate over the episodes."""
        return iter(self.episodes)

    def __getitem__(self, index: int) -> Episode:
        """Return one episode."""
        return self.episodes[index]

    def counts(self) -> dict[str, int]:
        """Return the number of episodes of each kind."""
        return {kind: len(self.of_kind(kind)) for kind in KINDS}

    def of(self, row: int) -> tuple[Episode, ...]:
        """Return the episodes in which the robot of this row takes part."""
        return tuple(episode for episode in self if row in episode.robots)

    def of_kind(self, kind: str) -> tuple[Episode, ...]:
        """Return the episodes of one kind."""
        check_choice("kind", kind, KINDS)
        return tuple(episode for episode in self if episode.kind == kind)


def find_pathologies(
    *,
    steps: np.ndarray,
    position: np.ndarray,
    heading: np.ndarray,
    command: np.ndarray,
    layer: np.ndarray,
    distance: np.ndarray,
    kind: np.ndarray,
    radius: np.ndarray,
    max_speed: np.ndarray,
    forward: np.ndarray,
    near: float = 20.0,
    window: int = 60,
    fewest_flips: int = 10,
    fewest_steps: int = 30,
    slow_share: float = 0.2,
    turned_degrees: float = 60.0,
    stuck_share: float = 0.1,
    forward_share: float = 0.25,
    facing_degrees: float = 30.0,
    gap: float = 5.0,
) -> Pathologies:
    """Find the episodes in which robots make no progress.

    Let (m_L, m_R) be a robot's command. It *turns* left or right as m_R - m_L is above or below 0; its turn *flips*
    in a step if the last turn before was to the other side.

    - **corridor flip**: the turn flips, both this turn and the one before it are away from something nearer than
      `near`, and one of them at least from an obstacle, fire or load: turning left, the right or the front sensor reads
      it; turning right, the left or the front one
    - **centroid flip**: the turn flips, some sensor sees a robot at both turns, other sensors do than at the turn
      before, and neither turn is away from a robot nearer than `near` that only the sensor of the other side reads
    - **head-on pair**: two robots whose rims are at most `gap` apart, each within `facing_degrees` of the other's
      heading, both commanded to drive forwards or to turn, and slow
    - **back-and-forth at a threshold**: m_L + m_R flips its sign
    - **stuck**: commanded forwards, (m_L + m_R) / 2 >= `forward_share` of `max_speed`, without moving

    *Flips* make an episode where `fewest_flips` of one kind in a row come within `window` steps and the robot makes
    no progress from the first to the last of them: its displacement is below its radius, and below `slow_share` of what
    max_speed would do in that time, and its heading changes by less than `turned_degrees`. (A robot that turns round
    in a blind alley flips too, but turns away.)

    *Head-on pairs* and *stuck* robots last at least `fewest_steps`. A robot is slow if displaced, in `fewest_steps`
    of such commands, by less than `stuck_share` of what max_speed would do. Without moving means that in `fewest_steps`
    of such commands both the displacement and the way along the headings are below `stuck_share` of what was commanded.

    Stretches of a kind that overlap or follow each other at once are one episode; of the first two kinds, without the
    steps in which the robot gets farther than its radius within `window` steps, and only if `fewest_flips` are left. A
    robot's step belongs to one kind: steps of the kinds above are not counted again for those below.

    A robot is *missing* in a step of which its position, heading, command or layer is NaN or masked: no episode of that
    robot has such a step.

    Parameters
    ----------
    steps : ndarray, shape (k,)
        Consecutive.
    position, heading : ndarrays, shape (k, n, 2) and (k, n), rad
        After each step.
    command, layer : ndarrays, shape (k, n, 2) and (k, n)
        Rim speeds left and right, and the layer that chose them, of each step.
    distance, kind : ndarrays, shape (k, n, s)
        The readings before each step: -1, NaN or masked for nothing; 0 obstacle, 1 robot, 2 fire, 3 load.
    radius, max_speed : ndarrays, shape (n,)
    forward : ndarray, shape (n, 3)
        Index of the front, left and right sensors, -1 for none.
    near, gap : float
        Map units, at least 0.
    window, fewest_flips, fewest_steps : int
        At least 2.
    slow_share, stuck_share, forward_share : float
        Above 0, at most 1.
    turned_degrees, facing_degrees : float
        0 to 180.

    Returns
    -------
    Pathologies

    Raises
    ------
    InvalidValueError
        If an array has another shape, steps are missing, or a parameter is out of its range.

    Warns
    -----
    DegreesWarning
        If a heading is beyond 4 pi.

    Examples
    --------
    A robot without sensors that is commanded forwards and does not move:

    >>> k, still = 40, np.zeros((40, 1))
    >>> found = find_pathologies(
    ...     steps=np.arange(k), position=np.zeros((k, 1, 2)), heading=still, command=np.ones((k, 1, 2)),
    ...     layer=still, distance=np.empty((k, 1, 0)), kind=np.empty((k, 1, 0)), radius=[5], max_speed=[1],
    ...     forward=[[-1, -1, -1]],
    ... )
    >>> found[0].describe()
    'Robot 0 was commanded forwards but did not move, in steps 1 to 39 (layer 0).'
    """
    limits = Thresholds(
        near=near, window=window, fewest_flips=fewest_flips, fewest_steps=fewest_steps, slow_share=slow_share,
        turned_degrees=turned_degrees,
        stuck_share=stuck_share, forward_share=forward_share, facing_degrees=facing_degrees, gap=gap,
    )  # fmt: skip
    track = Track(
        steps=steps, position=position, heading=heading, command=command, layer=layer, distance=distance, kind=kind,
        radius=radius, max_speed=max_speed, forward=forward,
    )  # fmt: skip
    is_taken = track.missing.copy()
    episodes = []
    for name, (finder, _) in FINDERS.items():
        findings = finder(track, limits, is_taken)
        episodes += [_episode(name, track, *episode) for episode in findings]
        for robots, first, last, _ in findings:
            is_taken[first : last + 1, robots] = True
    return Pathologies(tuple(sorted(episodes, key=_order)), int(track.missing.sum()))


def _episode(kind: str, track: Track, robots: tuple[int, ...], first: int, last: int, flips: int) -> Episode:
    layers = np.unique(track.layer[first : last + 1, robots])
    return Episode(
        kind=kind,
        robots=robots,
        first_step=int(track.steps[first]),
        last_step=int(track.steps[last]),
        flips=flips,
        layers=tuple(layers.tolist()),
    )


def _order(episode: Episode) -> tuple:
    return episode.first_step, KINDS.index(episode.kind), episode.robots
