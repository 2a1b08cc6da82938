"""What happened in a recording: fires that went out, bursts of collisions, groups that merged."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from mesa_swarm.analysis.clusters import clusters

# So many robots that collide in one step are a burst; it lasts until fewer did for so many steps.
BURST_ROBOTS = 5
BURST_GAP = 10
# Groups are looked at so often, with links of so many map units, and need so many robots: a group that only
# flickers at its edge makes no event.
MERGE_EVERY = 10
MERGE_LINK = 30.0
MERGE_ROBOTS = 3


@dataclass(frozen=True, kw_only=True, slots=True)
class Event:
    """Something that happened.

    Parameters
    ----------
    step : int
        When it began.
    kind : str
        "fire out", "collision burst" or "merge".
    ids : tuple of int
        unique_ids: of the fire, of the robots that collided, of the robots of the merged group.
    text : str
        The same in words. A fire has the number that it has in charts and pictures: the first is fire 1.
    """

    step: int
    kind: str
    ids: tuple[int, ...]
    text: str

    def __str__(self) -> str:
        return f"step {self.step}: {self.text}"


def events_of(frames: Iterable) -> list[Event]:
    """Return the events of frames, oldest first; what was not recorded tells of none.

    Parameters
    ----------
    frames : iterable of Frame
        In the order of time; it is gone through up to three times.
    """
    found = [*_fires_out(frames), *_bursts(frames), *_merges(frames)]
    return sorted(found, key=lambda event: (event.step, event.kind, event.ids))


def _fires_out(frames: Iterable) -> Iterator[Event]:
    burning: set[int] = set()
    for frame in frames:
        if "fires" not in frame.columns:
            return
        fires = frame["fires"]
        gone_out = burning & set(fires["fire"][fires["out"]].tolist())
        for number, fire in enumerate(fires["fire"].tolist(), start=1):
            if fire in gone_out:
                yield Event(step=frame.step, kind="fire out", ids=(fire,), text=f"fire {number} is out")
        burning = set(fires["fire"][~fires["out"]].tolist())


def _bursts(frames: Iterable) -> Iterator[Event]:
    burst: list[tuple[int, frozenset[int]]] = []
    for frame in frames:
        if "contacts" not in frame.columns:
            return
        if burst and frame.step - burst[-1][0] > BURST_GAP:
            yield _burst(burst)
            burst = []
        if len(frame["contacts"]) >= BURST_ROBOTS:
            burst.append((frame.step, frozenset(frame["contacts"]["robot"].tolist())))
    if burst:
        yield _burst(burst)


def _burst(burst: list[tuple[int, frozenset[int]]]) -> Event:
    first, last, most = burst[0][0], burst[-1][0], max(len(robots) for _, robots in burst)
    robots = tuple(sorted(frozenset().union(*(robots for _, robots in burst))))
    text = f"up to {most} robots collide at once until step {last}"
    return Event(step=first, kind="collision burst", ids=robots, text=text)


def _merges(frames: Iterable) -> Iterator[Event]:
    before: dict[int, int] = {}
    due = -np.inf
    for frame in frames:
        if "position" not in frame.columns:
            return
        if frame.step < due:
            continue
        due = frame.step + MERGE_EVERY
        label = clusters(frame["position"].astype(float), MERGE_LINK, fewest=MERGE_ROBOTS).label
        now = dict(zip(frame.robots.tolist(), label.tolist(), strict=True))
        for group in range(int(label.max(initial=-1)) + 1):
            members = sorted(robot for robot, its in now.items() if its == group)
            parts = {before[robot] for robot in members if before.get(robot, -1) >= 0}
            if len(parts) > 1:
                text = f"{len(parts)} groups have become one of {len(members)} robots"
                yield Event(step=frame.step, kind="merge", ids=tuple(members), text=text)
        before = now
