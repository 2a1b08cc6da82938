"""Succession of chains: births, mergers, splits, reversals, head-on meetings."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from mesa_swarm.analysis.chains import FARTHEST, Chains, nearest_ahead
from mesa_swarm.errors import check_count, check_number

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
    """The succession of chains; see `chain_history.follow_chains` for the rules.

    After `window` steps the order of two robots is forgotten.
    """

    def __init__(self, window: int) -> None:
        self.chains: tuple[NumberedChain, ...] = ()
        self._window = window
        self._created = 0
        # Of two robots: which was ahead, until which step, in which chain.
        self._together: dict[tuple[int, int], tuple[bool, int, int]] = {}
        self._reversed: dict[int, int] = {}

    def advance(self, step: int, before: int, found: Chains) -> list[ChainEvent]:
        """Return the events of the chains in `step`, given that the last ones existed until `before`."""
        old = self.chains
        shared = common(old, found.label)
        numbers = self._numbers(shared, found.count)
        self.chains = tuple(
            NumberedChain(number, tuple(rows.tolist()), bool(closed))
            for number, rows, closed in zip(numbers, found.members(), found.closed, strict=True)
        )
        known, still = set(old), set(self.chains)
        self._remember([chain for chain in old if chain not in still], before)
        events = made(step, shared, old, self.chains) + unmade(step, shared, old, self.chains)
        for chain in self.chains:
            if chain not in known and not chain.closed:
                events += self._reversals(step, chain)
        return events

    def _numbers(self, shared: list[tuple[int, int, int]], count: int) -> list[int]:
        """Return each new chain's number: of the old one with which it has most robots in common, or a new one."""
        numbers, given = [-1] * count, set()
        for robots, old, new in sorted(shared, key=lambda s: (-s[0], self.chains[s[1]].number, s[2])):
            del robots
            if numbers[new] < 0 and old not in given:
                numbers[new] = self.chains[old].number
                given.add(old)
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
        turned: dict[int, list[tuple[bool, int, int, int]]] = {}
        for ahead, behind in combinations(chain.robots, 2):
            earlier = self._together.get((min(ahead, behind), max(ahead, behind)))
            if earlier is not None and step - earlier[1] <= self._window:
                turned.setdefault(earlier[2], []).append((earlier[0] != (ahead < behind), earlier[1], ahead, behind))
        events = []
        for number, pairs in sorted(turned.items()):
            fresh = max(until for _, until, _, _ in pairs) >= self._reversed.get(number, 0)
            if fresh and all(opposite for opposite, _, _, _ in pairs):
                changed = {robot for _, _, *both in pairs for robot in both}
                robots = tuple(robot for robot in chain.robots if robot in changed)
                chains = tuple(sorted({number, chain.number}))
                events.append(ChainEvent(kind="reversal", step=step, robots=robots, chains=chains))
                self._reversed[number] = step
        return events


def common(old: tuple[NumberedChain, ...], label: np.ndarray) -> list[tuple[int, int, int]]:
    """Return (robots in common, index of the old chain, of the new one) where two or more robots are in both."""
    shared = []
    for index, chain in enumerate(old):
        labels = label[list(chain.robots)]
        counts = np.bincount(labels[labels >= 0])
        shared += [(int(counts[new]), index, int(new)) for new in np.flatnonzero(counts >= FEWEST)]
    return shared


def made(step: int, shared: list, old: tuple, new: tuple) -> list[ChainEvent]:
    """Return the births and mergers: new chains that come from none, or from several."""
    events = []
    for index, chain in enumerate(new):
        parents = [old[o].number for _, o, n in shared if n == index]
        if len(parents) != 1:
            chains = tuple(sorted({chain.number, *parents}))
            kind = "merge" if parents else "birth"
            events.append(ChainEvent(kind=kind, step=step, robots=chain.robots, chains=chains))
    return events


def unmade(step: int, shared: list, old: tuple, new: tuple) -> list[ChainEvent]:
    """Return the ends and splits: old chains from which none comes, or several do."""
    events = []
    for index, chain in enumerate(old):
        children = [new[n].number for _, o, n in shared if o == index]
        if len(children) != 1:
            chains = tuple(sorted({chain.number, *children}))
            kind = "split" if children else "end"
            events.append(ChainEvent(kind=kind, step=step, robots=chain.robots, chains=chains))
    return events


OUTCOMES = ("merged", "dispersed", "unresolved")


@dataclass(frozen=True, kw_only=True, slots=True)
class Meetings:
    """The conditions of meetings and their outcomes; see `chain_history.follow_chains`."""

    distance: float = 50.0
    angle_degrees: float = 20.0
    parting_distance: float = 75.0
    window: int = 200
    patience: int = 5

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_number("meeting_distance", self.distance, above=0, maximum=FARTHEST)
        check_number("meeting_angle_degrees", self.angle_degrees, minimum=0, maximum=90)
        check_number("parting_distance", self.parting_distance, minimum=self.distance, maximum=FARTHEST)
        check_count("window", self.window)
        check_count("patience", self.patience, minimum=1)

    def find(self, position: np.ndarray, heading: np.ndarray, chain: np.ndarray) -> list[tuple[int, int, int]]:
        """Return (frame, row, row) of every meeting, given each robot's chain (k, n), -1 for none."""
        found, near = [], np.empty((0, 2), np.int64)
        for frame in range(1, len(position)):
            near = near[distances(position[frame], near) <= self.parting_distance]
            pairs = facing_pairs(position[frame], heading[frame], self.distance, self.angle_degrees)
            first, second = pairs.T
            closing = distances(position[frame], pairs) < distances(position[frame - 1], pairs)
            apart = (chain[frame, first] != chain[frame, second]) | (chain[frame, first] < 0)
            known = (pairs[:, None] == near).all(axis=2).any(axis=1)
            new = pairs[closing & apart & ~known]
            found += [(frame, int(i), int(j)) for i, j in new]
            near = np.concatenate([near, new])
        return found

    def outcome(self, meeting: tuple[int, int, int], steps: np.ndarray, position: np.ndarray, chain: np.ndarray) -> str:
        """Return the outcome of a meeting, one of `OUTCOMES`, whichever came first."""
        frame, i, j = meeting
        last = int(np.searchsorted(steps, steps[frame] + self.window, side="right"))
        together = (chain[frame:, i] == chain[frame:, j]) & (chain[frame:, i] >= 0)
        merged = first_run(together, self.patience)
        gap = np.hypot(*(position[frame:last, i] - position[frame:last, j]).T)
        parted = first_run(gap > self.parting_distance, 1)
        if min(merged, parted) >= last - frame:
            return "unresolved"
        return "merged" if merged < parted else "dispersed"


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
