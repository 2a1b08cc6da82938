"""Signposts: robots write on boards, which forget, in which direction a source lies.

WHAT IS IT? Boards such as RFID tags stand at fixed places. A robot that has been at the source writes on boards that
it passes where it came from; one that searches reads the boards that it passes, and turns to where they point.
HOW IT WORKS. Source and boards are a part of the model's own: arrays, a random stream and stages of the step. For
`trust` steps after a visit a robot explores and writes; later it reads, and goes straight on for as long.
HOW TO USE IT. `boards` in a row and a column. THINGS TO NOTICE. After the source has moved, signs are wrong for a time.
REFERENCE. Mamei, Zambonelli, ACM Transactions on Autonomous and Adaptive Systems 2(2) (2007) article 4.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from mesa_swarm import AGENT9, Column, Context, Part, Phase, Seed, Sensor, Shown, Slider, Stage, SwarmModel
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

    def bind(self, context: Context) -> None:
        """Take the swarm, the bounds of the map, and a random stream."""
        self.swarm, self.rng = context.model.swarm, context.streams["boards"]
        self.low, self.high = np.reshape(context.model.map.bounds, (2, 2))

    def columns(self) -> dict[str, Column]:
        """Return source and boards, and of each robot what it reads, its visits, when and where the last one was."""
        places, since = Column(self.places, role="parameter"), Column(self.since, "robots", initial=NEVER)
        columns = {"places": places, "since": since}
        columns |= {name: Column(getattr(self, name)) for name in ("source", "strength", "azimuth")}
        return columns | {name: Column(getattr(self, name), "robots") for name in ("read", "seen", "visits", "written")}

    def stages(self) -> Iterator[Stage]:
        """Let robots read before they decide and write after they have moved; move and fade every few steps."""
        yield Stage(Phase.EXCHANGE, self.let_read, "robots read boards")
        yield Stage(Phase.PROCESS, self.move, "the source moves", every=self.moves)
        yield Stage(Phase.PROCESS, self.let_write, "robots visit the source, and write on boards")
        yield Stage(Phase.PROCESS, self.fade, "messages fade", every=FADES)

    def move(self) -> None:
        """Put the source at a random place."""
        self.source[:] = self.low + (self.high - self.low) * (0.1 + 0.8 * self.rng.random(2))

    def near(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of those chosen robots that are near a board, and the board of each."""
        away = np.hypot(*(self.swarm.position[:, None] - self.places).transpose(2, 0, 1))
        rows = np.flatnonzero(chosen & (away.min(axis=1, initial=np.inf) < REACH))
        return rows, away[rows].argmin(axis=1) if len(rows) else rows

    def let_read(self) -> None:
        """Let robots that search read the board within reach."""
        rows, board = self.near(self.since > self.trust)
        self.read[:] = 0.0
        self.read[rows] = np.column_stack([self.strength, self.azimuth])[board]

    def let_write(self) -> None:
        """Count visits to the source; let robots that were there lately write where it lies, seen from a board."""
        there = np.hypot(*(self.swarm.position - self.source).T) < SOURCE
        self.visits += there & (self.since > AGAIN)
        self.since += 1
        self.since[there], self.seen[there] = 0, self.source
        rows, board = self.near(self.since <= self.trust)
        x, y = (self.seen[rows] - self.places[board]).T
        self.azimuth[board], self.strength[board] = np.arctan2(y, x), 1.0
        self.written[rows] += 1

    def fade(self) -> None:
        """Let a share of each message evaporate."""
        self.strength *= (1.0 - self.evaporation) ** FADES

    def shown(self) -> Shown:
        """Return a large disc for the source, and one of each board, as large as it is strong."""
        discs = np.vstack([np.column_stack([self.places, 3.0 + 12.0 * np.sqrt(self.strength)]), [*self.source, SOURCE]])
        return Shown("boards", discs, rows={"writes": self.since <= self.trust}, text=f"{self.visits.sum()} visits")


@dataclass(frozen=True, kw_only=True)
class Sign(Sensor):
    """What a robot reads on a board: how strong it is, and the bearing to which it points, rad."""

    name: str = "sign"
    width: int = 2

    def arguments(self, model: SwarmModel) -> dict[str, np.ndarray]:
        """Return what the part `boards` let each robot read."""
        return {"message": model.parts["boards"].columns()["read"].array}

    @staticmethod
    def read(rows: np.ndarray, message: np.ndarray, heading: np.ndarray, out: np.ndarray) -> None:
        """Fill `out` (n, 2)."""
        out[:, 0], out[:, 1] = message[rows, 0], (message[rows, 1] - heading + np.pi) % (2.0 * np.pi) - np.pi


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
        places = shares * (self.map.width, self.map.height) + self.map.bounds[:2]
        share, trust = check_number("evaporation", evaporation, minimum=0, maximum=1), check_count("trust", trust)
        self.add_part(Boards(places, share, check_count("moves", moves, minimum=1), trust)).move()
        self.add_robots(replace(AGENT9, sensors=(*AGENT9.sensors, Sign())), check_count("n_robots", n_robots))
        self.control = Subsumption(Avoid(distance=12), follow(trust=trust), Explore())

    @property
    def visits(self) -> float:
        """How often robots have come to the source so far."""
        return float(self.parts["boards"].columns()["visits"].array.sum())

    def results(self) -> dict[str, float]:
        """Return the measure used by a comparison."""
        return {"visits": self.visits}
