"""Chains as paths over time (thesis 5.3.3): lasting links, and events of chains."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mesa_swarm.analysis.arrays import check_array, check_steps
from mesa_swarm.analysis.chain_events import KINDS, OUTCOMES, ChainEvent, Lineage, Meetings, meeting_event
from mesa_swarm.analysis.chains import FARTHEST, Links, paths
from mesa_swarm.errors import InvalidValueError, check_choice, check_number, shortened


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ChainHistory:
    """Chains over k frames, and their events.

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
    """

    steps: np.ndarray
    leader: np.ndarray
    chain: np.ndarray
    place: np.ndarray
    events: tuple[ChainEvent, ...]
    fates: tuple[tuple[ChainEvent, str], ...]

    @property
    def lengths(self) -> tuple[np.ndarray, ...]:
        """For each frame the robots in each chain, descending."""
        rows = (np.unique(row[row >= 0], return_counts=True)[1] for row in self.chain)
        return tuple(np.sort(counts)[::-1] for counts in rows)

    @property
    def count(self) -> np.ndarray:
        """Number of chains in each frame (k,)."""
        return np.count_nonzero((self.chain >= 0) & (self.place == 0), axis=1)

    @property
    def mean_length(self) -> np.ndarray:
        """Mean number of robots in a chain in each frame (k,), NaN without chains."""
        robots, count = np.count_nonzero(self.chain >= 0, axis=1), self.count
        return np.where(count > 0, robots / np.maximum(count, 1), np.nan)

    @property
    def chained(self) -> np.ndarray:
        """Share of the robots that are in a chain in each frame (k,), NaN where there are no robots."""
        k, n = self.chain.shape
        return np.count_nonzero(self.chain >= 0, axis=1) / n if n else np.full(k, np.nan)

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

    ========  ======================================================================================================
    event     what it is
    ========  ======================================================================================================
    birth     a chain without predecessor: no two of its robots were in one chain in the frame before
    end       a chain without a successor
    merge     a chain that is the successor of two or more
    split     a chain that has two or more successors
    reversal  robots that were in one chain at most `window` steps ago are in one (again or still), every two of them
              in the opposite order, once for each time the old chain lost its order; or a chain that drove forwards
              drives backwards, or the other way round, by at least `reversal_distance` (the mean over its robots of
              the way along their headings; the step is that in which it had come farthest)
    meeting   two robots that are not in one chain, each of which is the nearest one within `meeting_distance` and
              within `meeting_angle_degrees` of the other's heading, and nearer to the other than in the frame
              before; once for each pair until they are farther apart than `parting_distance`
    ========  ======================================================================================================

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
    position = check_array("position", position, (len(steps), "n", 2))
    heading = check_array("heading", heading, position.shape[:2])
    check_number("reversal_distance", reversal_distance, above=0, maximum=FARTHEST)
    links = Links(distance=link_distance, half_angle_degrees=half_angle_degrees, alignment_degrees=alignment_degrees)
    rule = Meetings(
        distance=meeting_distance,
        angle_degrees=meeting_angle_degrees,
        parting_distance=parting_distance,
        window=window,
        patience=patience,
    )
    seen = [links.between(*frame)[0] for frame in zip(position, heading, strict=True)]
    leader = settled(np.array(seen, np.int64).reshape(heading.shape), int(patience))
    chain, place, events = _followed(leader, position, steps, window)
    events += backings(position, heading, chain, steps, reversal_distance)
    met = rule.find(position, heading, chain)
    fates = [(meeting_event(m, steps, chain), rule.outcome(m, steps, position, chain)) for m in met]
    events += [meeting for meeting, _ in fates]
    return ChainHistory(
        steps=steps,
        leader=leader,
        chain=chain,
        place=place,
        events=tuple(sorted(events, key=lambda event: event.order)),
        fates=tuple(sorted(fates, key=lambda fate: fate[0].order)),
    )


def settled(leader: np.ndarray, patience: int) -> np.ndarray:
    """Return lasting links (k, n), -1 for none, without changes within `patience` frames.

    If no robot has two followers in any frame, none has among the lasting links: while the new one is seen
    `patience` times in a row, the old one is not.
    """
    lasting = np.full_like(leader, -1)
    held, missing, row = (np.full(leader.shape[1], fill) for fill in (-1, 0, 0))
    for frame, now in enumerate(leader):
        row = np.where(now == leader[frame - 1], row + 1, 1) if frame else row + 1
        missing = np.where(now == held, 0, missing + 1)
        gone = (held >= 0) & (missing >= patience)
        come = (now >= 0) & (now != held) & (row >= patience)
        held = np.where(come, now, np.where(gone, -1, held))
        missing[come] = 0
        lasting[frame] = held
        since = slice(max(frame + 1 - patience, 0), frame + 1)
        lasting[since, gone | come] = held[gone | come]
    return lasting


def _followed(leader: np.ndarray, position: np.ndarray, steps: np.ndarray, window: int) -> tuple:
    """Return chain numbers (k, n), places (k, n) and the events that changes of links make."""
    chain, place = np.full_like(leader, -1), np.zeros_like(leader)
    lineage, events = Lineage(window), []
    for frame in range(len(steps)):
        if frame and (leader[frame] == leader[frame - 1]).all():
            chain[frame], place[frame] = chain[frame - 1], place[frame - 1]
            continue
        found = paths(leader[frame], position[frame])
        happened = lineage.advance(int(steps[frame]), int(steps[max(frame - 1, 0)]), found)
        events += happened if frame else []
        numbers = np.array([*(c.number for c in lineage.chains), -1])
        chain[frame], place[frame] = numbers[found.label], found.place
    return chain, place, events


def backings(
    position: np.ndarray, heading: np.ndarray, chain: np.ndarray, steps: np.ndarray, least: float
) -> list[ChainEvent]:
    """Return the reversals of chains that begin to drive backwards, or forwards again; see `follow_chains`."""
    if len(position) < 2:
        return []
    moved, ahead = np.diff(position, axis=0), heading[1:]
    forward = np.zeros(heading.shape)
    forward[1:] = moved[..., 0] * np.cos(ahead) + moved[..., 1] * np.sin(ahead)
    events = []
    for number, frames, travel in _travels(forward, chain):
        for turn in turning_points(np.cumsum(travel), least):
            rows = np.flatnonzero(chain[frames[turn]] == number)
            events.append((number, frames[turn], rows))
    return [
        ChainEvent(kind="reversal", step=int(steps[frame]), robots=tuple(rows.tolist()), chains=(number,))
        for number, frame, rows in events
    ]


def _travels(forward: np.ndarray, chain: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield for each chain its number, its frames, and the mean way forward of its robots in each of them."""
    frame, row = np.nonzero(chain >= 0)
    keys, inverse = np.unique(chain[frame, row] * len(chain) + frame, return_inverse=True)
    mean = np.bincount(inverse, forward[frame, row], len(keys)) / np.bincount(inverse, minlength=len(keys))
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
