"""HeadOn: two robots that meet head-on decide by chance who leads (thesis 5.3.3, 10.2, its open problem)."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mesa_swarm.control.layer import Senses, nearest_ahead
from mesa_swarm.errors import check_name, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.robots.drive import turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT


@dataclass(kw_only=True)
class HeadOn:
    """Turn round on the spot, at a speed drawn for this encounter, when another robot comes head-on.

    Of two robots that meet both turn round, each at its own random speed. The faster one has turned away
    first and leads; the slower one then still sees it, going away, and follows (with a layer such as
    `Follow` below). Put this layer above `Avoid`, which would make both turn aside.

    Active from when the front sensor sees a robot nearer than `distance` that closes faster than the
    robot's own driving explains, until the robot has turned round by half a turn, or sees ahead a robot that
    goes away.

    Parameters
    ----------
    distance : float
        Map units, at least 0.
    slowest : float
        Speeds are drawn from this share of max_speed to all of it, log-uniformly: what counts is by how many times
        one turns faster than the other. Above 0, at most 1.
    margin : float
        How much faster than by its own speed the other must close, as a share of max_speed, at least 0.
    parting : float
        The other goes away when it is read this much farther than at its nearest, map units, above 0: more than
        the readings of a turning robot differ from sector to sector.

    Examples
    --------
    >>> HeadOn(distance=40).slowest
    0.1
    """

    distance: float = 30.0
    slowest: float = 0.1
    margin: float = 0.25
    parting: float = 1.0
    name: str = "HeadOn"
    commands_wheels: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("HeadOn's distance", self.distance, minimum=0, maximum=LARGEST_RANGE)
        check_number("slowest", self.slowest, above=0, maximum=1)
        check_number("margin", self.margin, minimum=0, maximum=2)
        check_number("parting", self.parting, above=0, maximum=LARGEST_RANGE)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember the last reading ahead and, of an encounter, the least reading, the speed, the turn that is left."""
        self._swarm, self._prefix, self._rng = swarm, prefix, rng
        for memory in ("front", "least"):
            swarm.remember(f"{prefix}.{memory}", (), np.float64, -1.0)
        for memory in ("speed", "left"):
            swarm.remember(f"{prefix}.{memory}", (), np.float64, 0.0)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Turn the robots that meet another head-on."""
        nearest = np.empty(len(layer), np.int64)
        nearest_ahead(senses.distance, senses.kind, senses.bearing, senses.design, nearest)
        columns = self._swarm.columns
        front, least, speed, left = (columns[f"{self._prefix}.{m}"] for m in ("front", "least", "speed", "left"))
        draws = float(self.slowest) ** self._rng.random(len(layer))
        head_on(
            nearest,
            senses.distance,
            senses.kind,
            senses.design,
            senses.forward,
            senses.last_command,
            senses.max_speed,
            senses.radius,
            senses.tendency,
            draws,
            float(self.distance),
            float(self.margin),
            float(self.parting),
            front,
            least,
            speed,
            left,
            command,
            layer,
            index,
        )

    def reason(self, moment: Moment) -> Reason:
        """Return which robot it meets."""
        front = moment.forward[0]
        seeing = (front,) if front >= 0 and moment.kind[front] == ROBOT else ()
        seen = f" ({moment.reading(front)})" if seeing else ""
        return Reason(f"it met a robot head-on{seen}: it turns round to lead or to follow", seeing)


@compiled
def head_on(
    nearest, distance, kind, design, forward, last_command, max_speed, radius, tendency, draws, near, margin, parting,
    front, least, speed, left, command, layer, index,
):  # fmt: skip
    """Begin, go on with and end encounters; `front` is the last reading ahead, -1 for no robot."""
    for i in range(layer.shape[0]):
        s, f = nearest[i], forward[design[i], 0]
        reading = distance[i, f] if f >= 0 and kind[i, f] == ROBOT else -1.0
        if speed[i] > 0.0:
            if s >= 0:
                least[i] = min(least[i], distance[i, s])
            if left[i] <= 0.0 or (s >= 0 and distance[i, s] > least[i] + parting):
                speed[i] = 0.0
        elif 0.0 <= reading < near and front[i] >= 0.0 and layer[i] < 0:
            own = 0.5 * (last_command[i, 0] + last_command[i, 1])
            if front[i] - reading > own + margin * max_speed[i]:
                speed[i], left[i], least[i] = draws[i] * max_speed[i], math.pi, reading
        front[i] = reading
        if speed[i] > 0.0 and layer[i] < 0:
            command[i, 0], command[i, 1] = turn_towards(tendency[i] * left[i], speed[i], radius[i])
            left[i] -= abs(command[i, 1]) / radius[i]
            layer[i] = index
