"""Signposts: robots write on boards, which forget, in which direction a source lies.

WHAT IS IT? Boards such as RFID tags stand at fixed places. A robot that has been at the source writes on boards that
it passes where it came from; one that searches reads the boards that it passes, and turns to where they point.
HOW IT WORKS. Source and boards are a part of the model's own: arrays, a random stream and stages of the step. For
`trust` steps after a visit a robot explores and writes; later it reads, and goes straight on for as long.
HOW TO USE IT. `boards` in a row and a column. THINGS TO NOTICE. After the source has moved, signs are wrong for a time.
REFERENCE. Mamei, Zambonelli, ACM Transactions on Autonomous and Adaptive Systems 2(2) (2007) article 4.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
from numba import njit

from mesa_swarm import (
    AGENT9,
    Column,
    Context,
    Part,
    Phase,
    Seed,
    Sensor,
    Shown,
    Slider,
    Stage,
    SwarmModel,
    compiled_stage,
    value,
)
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, behaviour
from mesa_swarm.errors import check_count, check_number

# Radii of the source and of reading, map units; steps between visits that count, and from fading to fading.
SOURCE, REACH, AGAIN, FADES, NEVER = 30.0, 45.0, 100, 10, 10**6


class Boards(Part):
    """A source that moves now and then, and boards that point to it; a message just written has strength 1."""

    name = "boards"

    def __init__(self, places: np.ndarray, evaporation: float, moves: int, trust: int) -> None:
        self.evaporation, self.moves, self.trust = evaporation, moves, trust
        self.places, self.strength, self.azimuth = places, np.zeros(len(places)), np.zeros(len(places))
        self.since, self.visits, self.written = (np.zeros(0, int) for _ in range(3))
        self.source, self.read, self.seen = np.zeros(2), np.zeros((0, 2)), np.zeros((0, 2))
        self.total = np.zeros(1)

    def bind(self, context: Context) -> None:
        """Take the model's streams, the bounds of the map, and how much of a message is left."""
        self.context, self.kept = context, (1.0 - self.evaporation) ** FADES
        self.low, self.high = np.reshape(context.model.map.bounds, (2, 2)).copy()
        self.discs = np.zeros((len(self.places) + 1, 3))
        draw(self.places, self.strength, self.source, self.discs)

    def columns(self) -> dict[str, Column]:
        """Return source and boards, and of each robot what it reads, its visits, when and where the last one was."""
        places, since = Column(self.places, role="parameter"), Column(self.since, "robots", initial=NEVER)
        columns = {"places": places, "since": since}
        columns |= {name: Column(getattr(self, name)) for name in ("source", "strength", "azimuth", "total")}
        columns["discs"] = Column(self.discs, role="derived")
        return columns | {name: Column(getattr(self, name), "robots") for name in ("read", "seen", "visits", "written")}

    def stages(self) -> Iterator[Stage]:
        """Let robots read before they decide and write after they have moved; move and fade every few steps."""
        stage = partial(compiled_stage, self.context, self)
        yield stage(Phase.EXCHANGE, let_read, "robots read boards")
        for axis, way in enumerate(("east or west", "north or south")):
            yield stage(Phase.PROCESS, move, f"the source moves {way}", every=self.moves, axis=axis)
        yield stage(Phase.PROCESS, visit, "robots visit the source")
        yield stage(Phase.PROCESS, let_write, "robots write on boards")
        yield stage(Phase.PROCESS, fade, "messages fade", every=FADES)
        yield stage(Phase.COLLECT, draw, "boards are drawn")

    def place_source(self) -> None:
        """Put the source at a random place, before the first step."""
        chances = self.context.streams[self.name].random(2).tolist()
        for axis, chance in enumerate(chances):
            move(self.source, self.low, self.high, chance, axis)
        draw(self.places, self.strength, self.source, self.discs)

    def shown(self) -> Shown:
        """Return a large disc for the source, and one of each board, as large as it is strong."""
        discs = np.zeros_like(self.discs)
        draw(self.places, self.strength, self.source, discs)
        discs = self.discs if np.array_equal(discs, self.discs) else discs  # as after a resume
        return Shown("boards", discs, rows={"writes": self.since <= self.trust}, text=f"{self.visits.sum()} visits")


def move(source: np.ndarray, low: np.ndarray, high: np.ndarray, chance: float, axis: int) -> None:
    """Put the source at a random place along an axis."""
    source[axis] = low[axis] + (high[axis] - low[axis]) * (0.1 + 0.8 * chance)


@njit
def find_near(x: float, y: float, places: np.ndarray) -> int:
    """Return the board within reach of a place, -1 if there is none."""
    nearest, board = REACH, -1
    for k in range(len(places)):
        away = math.hypot(x - places[k, 0], y - places[k, 1])
        if away < nearest:
            nearest, board = away, k
    return board


def let_read(
    position: np.ndarray, since: np.ndarray, places: np.ndarray, strength: np.ndarray, azimuth: np.ndarray,
    read: np.ndarray, trust: int,
) -> None:  # fmt: skip
    """Let robots that search read the board within reach."""
    for i in range(len(read)):
        board = find_near(position[i, 0], position[i, 1], places) if since[i] > trust else -1
        read[i, 0], read[i, 1] = (strength[board], azimuth[board]) if board >= 0 else (0.0, 0.0)


def visit(
    position: np.ndarray, source: np.ndarray, since: np.ndarray, visits: np.ndarray, seen: np.ndarray, total: np.ndarray
) -> None:
    """Count visits to the source."""
    for i in range(len(since)):
        there = math.hypot(position[i, 0] - source[0], position[i, 1] - source[1]) < SOURCE
        if there and since[i] > AGAIN:
            visits[i] += 1
            total[0] += 1.0
        since[i] = 0 if there else since[i] + 1
        if there:
            seen[i] = source


def let_write(
    position: np.ndarray, since: np.ndarray, seen: np.ndarray, places: np.ndarray, azimuth: np.ndarray,
    strength: np.ndarray, written: np.ndarray, trust: int,
) -> None:  # fmt: skip
    """Let robots that were at the source lately write where it lies, seen from the board within reach."""
    for i in range(len(since)):
        board = find_near(position[i, 0], position[i, 1], places) if since[i] <= trust else -1
        if board >= 0:
            azimuth[board] = math.atan2(seen[i, 1] - places[board, 1], seen[i, 0] - places[board, 0])
            strength[board] = 1.0
            written[i] += 1


def fade(strength: np.ndarray, kept: float) -> None:
    """Let a share of each message evaporate."""
    for k in range(len(strength)):
        strength[k] *= kept


def draw(places: np.ndarray, strength: np.ndarray, source: np.ndarray, discs: np.ndarray) -> None:
    """Write the discs that stand for boards and source."""
    for k in range(len(places)):
        discs[k, 0], discs[k, 1], discs[k, 2] = places[k, 0], places[k, 1], 3.0 + 12.0 * math.sqrt(strength[k])
    discs[-1, 0], discs[-1, 1], discs[-1, 2] = source[0], source[1], SOURCE


@dataclass(frozen=True, kw_only=True)
class Sign(Sensor):
    """What a robot reads on a board: how strong it is, and the bearing to which it points, rad."""

    name: str = "sign"
    width: int = 2

    @staticmethod
    def read(rows: np.ndarray, boards_read: np.ndarray, heading: np.ndarray, out: np.ndarray) -> None:
        """Fill `out` (n, 2) with what the part `boards` let each robot read."""
        for i in range(len(out)):
            out[i, 0] = boards_read[rows[i], 0]
            out[i, 1] = (boards_read[rows[i], 1] - heading[i] + np.pi) % (2.0 * np.pi) - np.pi


@behaviour(memory={"left": 0})
def follow(me: Any, trust: int = 200) -> Any:
    """Turn to where a board points, and go straight on for some steps."""
    turn = max(-1.0, min(1.0, me.sign[1])) if me.sign[0] > 0.1 else 0.0
    me.memory.left = trust if me.sign[0] > 0.1 else max(me.memory.left - 1, 0)
    if me.memory.left == 0:
        return PASS
    return me.max_speed * min(1.0, 1.0 - 2.0 * turn), me.max_speed * min(1.0, 1.0 + 2.0 * turn)


class Signposts(SwarmModel):
    """Robots that look for a source, and leave messages on boards about where it lies."""

    compares, steps_to_compare = ("boards", (0, 6)), 2_000
    visits = value("boards.total")  # how often robots have come to the source so far

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 60, 1, "robots")] = 20,
        boards: Annotated[int, Slider(0, 12, 1, "boards in a row and in a column")] = 6,
        evaporation: Annotated[float, Slider(0, 0.05, 0.001, "share of a message lost in a step")] = 0.003,
        moves: Annotated[int, Slider(100, 5_000, 100, "steps for which the source stays")] = 1_000,
        trust: Annotated[int, Slider(10, 500, 10, "steps for which robots write, and follow a sign")] = 200,
        rng: Seed = None,
    ) -> None:
        super().__init__(map="openspace", rng=rng, model_reporters={"visits": "visits"})
        shares = (np.indices((check_count("boards", boards, maximum=50),) * 2).reshape(2, -1).T + 0.5) / max(boards, 1)
        places = np.ascontiguousarray(shares * (self.map.width, self.map.height) + self.map.bounds[:2])
        share, trust = check_number("evaporation", evaporation, minimum=0, maximum=1), check_count("trust", trust)
        self.add_part(Boards(places, share, check_count("moves", moves, minimum=1), trust)).place_source()
        self.add_robots(replace(AGENT9, sensors=(*AGENT9.sensors, Sign())), check_count("n_robots", n_robots))
        self.control = Subsumption(Avoid(distance=12), follow(trust=trust), Explore())

    def results(self) -> dict[str, float]:
        """Return the measure used by a comparison."""
        return {"visits": self.visits}
