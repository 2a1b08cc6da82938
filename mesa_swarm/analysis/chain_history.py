"""Chains as paths over time (thesis 5.3.3): lasting links, and events: births, mergers, splits, reversals, meetings."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from mesa_swarm.analysis.arrays import LARGEST_COORDINATE, check_array, check_headings, check_steps
from mesa_swarm.analysis.chains import Chains, Links, nearest_ahead, paths
from mesa_swarm.analysis.missing import masked_where, without_position
from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number, shortened

KINDS = ("birth", "end", "merge", "split", "reversal", "meeting")
# The fewest robots of a chain, and of a part that counts as its successor.
FEWEST = 2


@dataclass(frozen=True, kw_only=True, slots=True)
class ChainEvent:
    """An event of chains.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    step : int
        The first recorded step of the new state.
    robots : tuple of int
        Rows: of the chain from head to tail (the new one of a birth or merger, the old one of an end or split);
        of a reversal of order the robots that changed places; of a meeting the two.
    chains : tuple of int
        Numbers of the chains involved, ascending: before and after.

    Examples
    --------
    >>> ChainEvent(kind="merge", step=7, robots=(2, 0, 1, 3), chains=(0, 1)).robots[0]
    2
    """

    kind: str
    step: int
    robots: tuple[int, ...]
    chains: tuple[int, ...]

    @property
    def order(self) -> tuple:
        """Sort key: step, then kind, then robots."""
        return self.step, KINDS.index(self.kind), self.robots, self.chains


@dataclass(frozen=True, slots=True)
class NumberedChain:
    """A chain from head to tail with its number, constant over time; in a closed one, a ring, no robot is ahead."""

    number: int
    robots: tuple[int, ...]
    closed: bool


class Lineage:
    """The succession of chains; see `follow_chains` for the rules.

    After `window` steps the order of two robots is forgotten.
    """

    def __init__(self, window: int) -> None:
        self.chains: tuple[NumberedChain, ...] = ()
        self._window = window
        self._created = 0
        # Of two robots: which was ahead, until which step, in which chain.
        self._together: dict[tuple[int, int], tuple[bool, int, int]] = {}
        self._reversed: dict[int, int] = {}

    def advance(self, step: int, before: int, new_chains: Chains) -> list[ChainEvent]:
        """Return the events of the chains in `step`, given that the last ones existed until `before`."""
        old = self.chains
        shared = find_common_robots(old, new_chains.label)
        numbers = self._numbers(shared, new_chains.count)
        self.chains = tuple(
            NumberedChain(number, tuple(rows.tolist()), bool(closed))
            for number, rows, closed in zip(numbers, new_chains.members(), new_chains.closed, strict=True)
        )
        old_numbers, still = set(old), set(self.chains)
        self._remember([chain for chain in old if chain not in still], before)
        parents = [[old[o].number for _, o, n in shared if n == index] for index in range(len(self.chains))]
        children = [[self.chains[n].number for _, o, n in shared if o == index] for index in range(len(old))]
        events = lineage_events(step, self.chains, parents, ("birth", "merge"))
        events += lineage_events(step, old, children, ("end", "split"))
        for chain in self.chains:
            if chain not in old_numbers and not chain.closed:
                events += self._reversals(step, chain)
        return events

    def _numbers(self, shared: list[tuple[int, int, int]], count: int) -> list[int]:
        """Return each new chain's number: of the old one with which it has most robots in common, or a new one."""
        numbers, used_numbers = [-1] * count, set()
        for _, old, new in sorted(shared, key=lambda s: (-s[0], self.chains[s[1]].number, s[2])):
            if numbers[new] < 0 and old not in used_numbers:
                numbers[new] = self.chains[old].number
                used_numbers.add(old)
        for new in range(count):
            if numbers[new] < 0:
                numbers[new] = self._created
                self._created += 1
        return numbers

    def _remember(self, chains: list[NumberedChain], step: int) -> None:
        """Store the order of robots in these chains, which existed until this step."""
        for chain in chains:
            if not chain.closed:
                for ahead, behind in combinations(chain.robots, 2):
                    pair = min(ahead, behind), max(ahead, behind)
                    self._together[pair] = ahead < behind, step, chain.number

    def _reversals(self, step: int, chain: NumberedChain) -> list[ChainEvent]:
        """Return the reversals of earlier chains of which robots are in this one in the opposite order."""
        reversals: dict[int, list[tuple[bool, int, int, int]]] = {}
        for ahead, behind in combinations(chain.robots, 2):
            earlier = self._together.get((min(ahead, behind), max(ahead, behind)))
            if earlier is not None and step - earlier[1] <= self._window:
                reversals.setdefault(earlier[2], []).append((earlier[0] != (ahead < behind), earlier[1], ahead, behind))
        events = []
        for number, pairs in sorted(reversals.items()):
            fresh = max(until for _, until, _, _ in pairs) >= self._reversed.get(number, 0)
            if fresh and all(opposite for opposite, _, _, _ in pairs):
                reversed_robots = {robot for _, _, *both in pairs for robot in both}
                robots = tuple(robot for robot in chain.robots if robot in reversed_robots)
                chains = tuple(sorted({number, chain.number}))
                events.append(ChainEvent(kind="reversal", step=step, robots=robots, chains=chains))
                self._reversed[number] = step
        return events


def find_common_robots(old: tuple[NumberedChain, ...], label: np.ndarray) -> list[tuple[int, int, int]]:
    """Return (robots in common, index of the old chain, of the new one) where two or more robots are in both."""
    shared = []
    for index, chain in enumerate(old):
        labels = label[list(chain.robots)]
        counts = np.bincount(labels[labels >= 0])
        shared += [(int(counts[new]), index, int(new)) for new in np.flatnonzero(counts >= FEWEST)]
    return shared


def lineage_events(
    step: int, chains: tuple[NumberedChain, ...], relatives: list[list[int]], kinds: tuple[str, str]
) -> list[ChainEvent]:
    """Return an event for each chain that has no relative in the other frame (`kinds[0]`) or several (`kinds[1]`)."""
    events = []
    for chain, numbers in zip(chains, relatives, strict=True):
        if len(numbers) != 1:
            kind, chain_numbers = kinds[bool(numbers)], tuple(sorted({chain.number, *numbers}))
            events.append(ChainEvent(kind=kind, step=step, robots=chain.robots, chains=chain_numbers))
    return events


OUTCOMES = ("merged", "dispersed", "unresolved")


@dataclass(frozen=True, kw_only=True, slots=True)
class Meetings:
    """The conditions of meetings and their outcomes; see `follow_chains`."""

    distance: float = 50.0
    angle_degrees: float = 20.0
    parting_distance: float = 75.0
    window: int = 200
    patience: int = 5

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_number("meeting_distance", self.distance, above=0, maximum=LARGEST_COORDINATE)
        check_number("meeting_angle_degrees", self.angle_degrees, minimum=0, maximum=90)
        check_number("parting_distance", self.parting_distance, minimum=self.distance, maximum=LARGEST_COORDINATE)
        check_count("window", self.window)
        check_count("patience", self.patience, minimum=1)

    def find(self, position: np.ndarray, heading: np.ndarray, chain: np.ndarray) -> list[tuple[int, int, int]]:
        """Return (frame, row, row) of every meeting, given each robot's chain (k, n), -1 for none."""
        meetings, near = [], np.empty((0, 2), np.int64)
        for frame in range(1, len(position)):
            near = near[~(distances(position[frame], near) > self.parting_distance)]  # a missing one may be near
            pairs = facing_pairs(position[frame], heading[frame], self.distance, self.angle_degrees)
            first, second = pairs.T
            closing = distances(position[frame], pairs) < distances(position[frame - 1], pairs)
            apart = (chain[frame, first] != chain[frame, second]) | (chain[frame, first] < 0)
            is_old = (pairs[:, None] == near).all(axis=2).any(axis=1)
            new = pairs[closing & apart & ~is_old]
            meetings += [(frame, int(i), int(j)) for i, j in new]
            near = np.concatenate([near, new])
        return meetings

    def outcome(self, meeting: tuple[int, int, int], steps: np.ndarray, position: np.ndarray, chain: np.ndarray) -> str:
        """Return the outcome of a meeting, one of `OUTCOMES`, whichever came first."""
        frame, i, j = meeting
        last = int(np.searchsorted(steps, steps[frame] + self.window, side="right"))
        together = (chain[frame:, i] == chain[frame:, j]) & (chain[frame:, i] >= 0)
        merging = first_run(together, self.patience)
        gap = np.hypot(*(position[frame:last, i] - position[frame:last, j]).T)
        parting = first_run(gap > self.parting_distance, 1)
        if min(merging, parting) >= last - frame:
            return "unresolved"
        return "merged" if merging < parting else "dispersed"


def facing_pairs(position: np.ndarray, heading: np.ndarray, reach: float, angle_degrees: float) -> np.ndarray:
    """Return the pairs (m, 2) of robots each of which is the nearest one dead ahead of the other."""
    nearest, _ = nearest_ahead(position, heading, reach, angle_degrees)
    rows = np.flatnonzero(nearest > np.arange(len(nearest)))
    rows = rows[nearest[nearest[rows]] == rows]
    return np.column_stack([rows, nearest[rows]])


def distances(position: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the distance of each pair (m, 2) of robots."""
    return np.hypot(*(position[pairs[:, 0]] - position[pairs[:, 1]]).T)


def first_run(mask: np.ndarray, length: int) -> int:
    """Return where the first run of at least `length` true values begins, len(mask) without one."""
    if length > len(mask):
        return len(mask)
    full = np.lib.stride_tricks.sliding_window_view(mask, length).all(axis=1)
    return int(full.argmax()) if full.any() else len(mask)


def meeting_event(meeting: tuple[int, int, int], steps: np.ndarray, chain: np.ndarray) -> ChainEvent:
    """Return a meeting as an event, with the chains of the two robots."""
    frame, *robots = meeting
    chains = {int(chain[frame, robot]) for robot in robots} - {-1}
    return ChainEvent(kind="meeting", step=int(steps[frame]), robots=tuple(robots), chains=tuple(sorted(chains)))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ChainHistory:
    """Chains over k frames, and their events.

    `leader`, `chain` and `place` are masked where a robot is missing and is not known to be in a chain, if any is.

    Parameters
    ----------
    steps : int64 ndarray, shape (k,)
    leader : int64 ndarray, shape (k, n)
        The robot that each one follows lastingly, -1 for none.
    chain : int64 ndarray, shape (k, n)
        Number of its chain, the same over time, -1 for robots alone.
    place : int64 ndarray, shape (k, n)
        Position in its chain, 0 for the head.
    events : tuple of ChainEvent
        By step, then kind, then robots.
    fates : tuple of (ChainEvent, str)
        The meetings, and the outcome of each.
    missing : int64 ndarray, shape (k,)
        Robots without a position or a heading in each frame.
    """

    steps: np.ndarray
    leader: np.ndarray
    chain: np.ndarray
    place: np.ndarray
    events: tuple[ChainEvent, ...]
    fates: tuple[tuple[ChainEvent, str], ...]
    missing: np.ndarray

    @property
    def lengths(self) -> tuple[np.ndarray, ...]:
        """For each frame the robots in each chain, descending."""
        rows = (np.unique(row[row >= 0], return_counts=True)[1] for row in np.asarray(self.chain))
        return tuple(np.sort(counts)[::-1] for counts in rows)

    @property
    def count(self) -> np.ndarray:
        """Number of chains in each frame (k,)."""
        return np.count_nonzero((np.asarray(self.chain) >= 0) & (np.asarray(self.place) == 0), axis=1)

    @property
    def mean_length(self) -> np.ndarray:
        """Mean number of robots in a chain in each frame (k,), NaN without chains."""
        robots, count = np.count_nonzero(np.asarray(self.chain) >= 0, axis=1), self.count
        return np.where(count > 0, robots / np.maximum(count, 1), np.nan)

    @property
    def chained(self) -> np.ndarray:
        """Share of the robots that are in a chain in each frame (k,), without masked ones; NaN without robots."""
        robots = np.count_nonzero(~np.ma.getmaskarray(self.chain), axis=1)
        return np.count_nonzero(np.asarray(self.chain) >= 0, axis=1) / np.where(robots > 0, robots, np.nan)

    def of(self, kind: str) -> tuple[ChainEvent, ...]:
        """Return the events of one kind."""
        check_choice("kind", kind, KINDS)
        return tuple(event for event in self.events if event.kind == kind)

    def counts(self) -> dict[str, int]:
        """Return the number of events of each kind."""
        return {kind: len(self.of(kind)) for kind in KINDS}

    def outcome(self, meeting: ChainEvent) -> str:
        """Return the outcome of a meeting: "merged", "dispersed" or "unresolved"; see `follow_chains`.

        Raises
        ------
        InvalidValueError
            If it is not a meeting of this history.
        """
        for event, outcome in self.fates:
            if event == meeting:
                return outcome
        raise InvalidValueError(f"{shortened(meeting)} is not a meeting of this history; expected one of of('meeting')")

    def outcomes(self) -> dict[str, int]:
        """Return the number of meetings with each outcome."""
        return {outcome: sum(fate == outcome for _, fate in self.fates) for outcome in OUTCOMES}


def follow_chains(
    position: np.ndarray,
    heading: np.ndarray,
    steps: np.ndarray,
    *,
    link_distance: float,
    half_angle_degrees: float = 45.0,
    alignment_degrees: float = 90.0,
    patience: int = 5,
    window: int = 200,
    meeting_distance: float = 50.0,
    meeting_angle_degrees: float = 20.0,
    parting_distance: float = 75.0,
    reversal_distance: float = 10.0,
) -> ChainHistory:
    """Follow chains over time.

    *Links.* In each frame `chains` finds which robot follows which. Changes within `patience` frames are flicker:
    a link exists from the first of `patience` frames in a row in which it is seen, until the first of `patience`
    frames in a row in which it is not; a change of which the record shows fewer frames does not count. Links so
    settled make paths and rings again, as those of one frame do.

    *Identity.* A new chain is a successor of an old one if two or more robots are in both. Each number goes on to
    one successor, each successor has one number: those with most robots in common first, then smaller numbers.

    - **birth**: a chain without predecessor: no two of its robots were in one chain in the frame before
    - **end**: a chain without a successor
    - **merge**: a chain that is the successor of two or more
    - **split**: a chain that has two or more successors
    - **reversal**: robots that were in one chain at most `window` steps ago are in one (again or still), every two of
      them in the opposite order, once for each time the old chain lost its order; or a chain that drove forwards drives
      backwards, or the other way round, by at least `reversal_distance` (the mean over its robots of the way along
      their headings; the step is that in which it had come farthest)
    - **meeting**: two robots that are not in one chain, each of which is the nearest one within `meeting_distance` and
      within `meeting_angle_degrees` of the other's heading, and nearer to the other than in the frame before; once for
      each pair until they are farther apart than `parting_distance`

    *Missing robots* have no position or heading, NaN or masked, in some frames. A missing robot has no links then,
    which within `patience` frames is flicker; it meets no other, and has no part in the way of its chain.

    A single robot that joins or leaves a chain is not an event, and neither is the state of the first frame.

    *Outcome of a meeting*, whichever comes first, if within `window` steps: ``merged``, the two are in one chain, and
    stay so for at least `patience` frames; ``dispersed``, they are farther apart than `parting_distance`. Else
    ``unresolved``: neither, or the record ends.

    Parameters
    ----------
    position : ndarray, shape (k, n, 2), map units
    heading : ndarray, shape (k, n), rad
    steps : ndarray, shape (k,)
        The step of each frame, ascending.
    link_distance, half_angle_degrees, alignment_degrees
        As for `chains`.
    patience : int
        Frames, at least 1, which takes every frame as it is.
    window : int
        Steps, at least 0.
    meeting_distance, parting_distance, reversal_distance : float
        Map units, above 0; `parting_distance` at least `meeting_distance`. The defaults suit robots of radius 5.
    meeting_angle_degrees : float
        0 to 90.

    Returns
    -------
    ChainHistory

    Raises
    ------
    InvalidValueError
        If an array has another shape or a parameter is out of its range.

    Warns
    -----
    DegreesWarning
        If a heading is beyond 4 pi.

    Examples
    --------
    Two chains of two, of which the hind one catches up::

        step 0    3> 2>         1> 0>
        step 1         3> 2>    1> 0>
        step 2              3> 2> 1> 0>

    >>> x = np.array([[40, 30, 10, 0], [40, 30, 15, 5], [40, 30, 20, 10]])
    >>> track = np.stack([x, np.zeros_like(x)], axis=-1)
    >>> history = follow_chains(track, np.zeros((3, 4)), [0, 1, 2], link_distance=12, patience=1)
    >>> history.events
    (ChainEvent(kind='merge', step=2, robots=(0, 1, 2, 3), chains=(0, 1)),)
    >>> history.mean_length
    array([2., 2., 4.])
    """
    steps = check_steps(steps)
    position = check_array("position", position, (len(steps), "n", 2), missing=True)
    heading = check_headings("heading", heading, position.shape[:2])
    missing = without_position(position) | np.isnan(heading)
    check_number("reversal_distance", reversal_distance, above=0, maximum=LARGEST_COORDINATE)
    links = Links(distance=link_distance, half_angle_degrees=half_angle_degrees, alignment_degrees=alignment_degrees)
    rule = Meetings(
        distance=meeting_distance,
        angle_degrees=meeting_angle_degrees,
        parting_distance=parting_distance,
        window=window,
        patience=patience,
    )
    leaders = [links.between(*frame)[0] for frame in zip(position, heading, strict=True)]
    leader = settle_links(np.array(leaders, np.int64).reshape(heading.shape), int(patience))
    chain, place, events = _follow_links(leader, position, steps, window)
    events += find_backings(position, heading, chain, steps, reversal_distance)
    meetings = rule.find(position, heading, chain)
    fates = [(meeting_event(m, steps, chain), rule.outcome(m, steps, position, chain)) for m in meetings]
    events += [meeting for meeting, _ in fates]
    is_unknown = missing & (chain < 0)
    return ChainHistory(
        steps=steps,
        leader=masked_where(is_unknown, leader),
        chain=masked_where(is_unknown, chain),
        place=masked_where(is_unknown, place),
        missing=missing.sum(axis=1),
        events=tuple(sorted(events, key=lambda event: event.order)),
        fates=tuple(sorted(fates, key=lambda fate: fate[0].order)),
    )


def settle_links(leader: np.ndarray, patience: int) -> np.ndarray:
    """Return lasting links (k, n), -1 for none, without changes within `patience` frames.

    If no robot has two followers in any frame, none has among the lasting links: while the new one is seen
    `patience` times in a row, the old one is not.
    """
    lasting = np.full_like(leader, -1)
    held, missing, row = (np.full(leader.shape[1], fill) for fill in (-1, 0, 0))
    for frame, now in enumerate(leader):
        row = np.where(now == leader[frame - 1], row + 1, 1) if frame else row + 1
        missing = np.where(now == held, 0, missing + 1)
        is_lost = (held >= 0) & (missing >= patience)
        come = (now >= 0) & (now != held) & (row >= patience)
        held = np.where(come, now, np.where(is_lost, -1, held))
        missing[come] = 0
        lasting[frame] = held
        since = slice(max(frame + 1 - patience, 0), frame + 1)
        lasting[since, is_lost | come] = held[is_lost | come]
    return lasting


def _follow_links(leader: np.ndarray, position: np.ndarray, steps: np.ndarray, window: int) -> tuple:
    """Return chain numbers (k, n), places (k, n) and the events that changes of links make."""
    chain, place = np.full_like(leader, -1), np.zeros_like(leader)
    lineage, events = Lineage(window), []
    for frame in range(len(steps)):
        if frame and (leader[frame] == leader[frame - 1]).all():
            chain[frame], place[frame] = chain[frame - 1], place[frame - 1]
            continue
        chains = paths(leader[frame], position[frame])
        happened = lineage.advance(int(steps[frame]), int(steps[max(frame - 1, 0)]), chains)
        events += happened if frame else []
        numbers = np.array([*(c.number for c in lineage.chains), -1])
        chain[frame], place[frame] = numbers[chains.label], chains.place
    return chain, place, events


def find_backings(
    position: np.ndarray, heading: np.ndarray, chain: np.ndarray, steps: np.ndarray, least: float
) -> list[ChainEvent]:
    """Return the reversals of chains that begin to drive backwards, or forwards again; see `follow_chains`."""
    if len(position) < 2:
        return []
    shift, ahead = np.diff(position, axis=0), heading[1:]
    forward = np.zeros(heading.shape)
    forward[1:] = shift[..., 0] * np.cos(ahead) + shift[..., 1] * np.sin(ahead)
    events = []
    for number, frames, travel in _travels(forward, chain):
        for turn in turning_points(np.cumsum(travel), least):
            robots = tuple(np.flatnonzero(chain[frames[turn]] == number).tolist())
            events.append(ChainEvent(kind="reversal", step=int(steps[frames[turn]]), robots=robots, chains=(number,)))
    return events


def _travels(forward: np.ndarray, chain: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield for each chain its number, its frames, and the mean way forward of its robots in each of them."""
    frame, row = np.nonzero(chain >= 0)
    keys, inverse = np.unique(chain[frame, row] * len(chain) + frame, return_inverse=True)
    way = forward[frame, row]
    measured = ~np.isnan(way)  # of a robot that is or was missing it is not known
    counts = np.bincount(inverse, measured, len(keys))
    mean = np.bincount(inverse, np.where(measured, way, 0.0), len(keys)) / np.maximum(counts, 1)
    number, frames = np.divmod(keys, len(chain))
    bounds = np.flatnonzero(np.diff(number, prepend=-1, append=-1))
    for first, last in pairwise(bounds):
        yield int(number[first]), frames[first:last], mean[first:last]


def turning_points(way: np.ndarray, least: float) -> list[int]:
    """Return where a way turns round and then goes at least so far in the other direction."""
    turns, direction = [], 0
    high = low = 0
    for now in range(len(way)):
        high = now if way[now] >= way[high] else high
        low = now if way[now] <= way[low] else low
        if direction >= 0 and way[high] - way[now] >= least:
            turns += [high] if direction else []
            direction, low = -1, now
        elif direction <= 0 and way[now] - way[low] >= least:
            turns += [low] if direction else []
            direction, high = 1, now
    return turns
