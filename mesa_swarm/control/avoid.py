"""Avoid: turn away from what is near (thesis 5.2.2)."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.control.layer import Memoryless, Senses
from mesa_swarm.errors import check_choice, check_name, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.world.statics import FIRE, LOAD

TURNS = ("translational", "stationary")
FIRES = ("always", "never", "when hot")
LOADS = ("always", "never")


@dataclass(frozen=True, kw_only=True)
class Avoid(Memoryless):
    """Turn away when the front, left or right sensor sees something nearer than `distance`.

    Active when one of the three is activated. They are checked in the order front, left, right, and the
    last that is activated wins: left turns the robot right, right turns it left, front turns it to the side
    of its own tendency, which never changes (a side drawn in every step would turn it nowhere).

    Parameters
    ----------
    distance : float
        A sensor is activated when 0 <= reading < distance, map units, at least 0.
    turn : str
        "translational" stops one wheel; "stationary" turns on the spot, which swings to and fro for ever in a
        corridor where both side sensors are activated.
    fires : str
        Whether burning fires are avoided: "always", "never" or "when hot".
    loads : str
        Whether loads are avoided: "always" or "never".

    Examples
    --------
    >>> Avoid(distance=20).turn
    'translational'
    """

    distance: float = 15.0
    turn: str = "translational"
    fires: str = "always"
    loads: str = "always"
    name: str = "Avoid"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Avoid's distance", self.distance, minimum=0, maximum=LARGEST_RANGE)
        check_choice("turn", self.turn, TURNS)
        check_choice("fires", self.fires, FIRES)
        check_choice("loads", self.loads, LOADS)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Turn the robots that are near something."""
        avoid(
            senses.distance,
            senses.kind,
            senses.hot,
            senses.tendency,
            senses.max_speed,
            senses.design,
            senses.forward,
            float(self.distance),
            FIRES.index(self.fires),
            self.loads == "always",
            -1.0 if self.turn == "stationary" else 0.0,
            command,
            layer,
            index,
        )

    def reason(self, moment: Moment) -> Reason:
        """Return which sensor decided: of those that were activated, the last of front, left, right."""
        fears_fire = self.fires == "always" or (self.fires == "when hot" and bool(moment.columns["hot"]))
        fears = fears_fire, self.loads == "always"
        forward = [s for s in moment.forward if s >= 0]
        near = [s for s in forward if is_activated(moment.distance[s], moment.kind[s], self.distance, *fears)]
        rounds_up = round(float(moment.distance[near[-1]]), 1) >= self.distance
        below = "just under" if rounds_up else "<"
        return Reason(f"{moment.reading(near[-1])} {below} {self.distance:g}", tuple(near))


@compiled
def avoid(distance, kind, hot, tendency, max_speed, design, forward, near, fires, loads, inner, command, layer, index):
    """Write the turns of robots that no earlier layer drives; `inner` is the inner wheel's share of speed."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        d = design[i]
        front, left, right = forward[d, 0], forward[d, 1], forward[d, 2]
        fears_fire = fires == 0 or (fires == 2 and hot[i])
        turn = 0.0
        if front >= 0 and is_activated(distance[i, front], kind[i, front], near, fears_fire, loads):
            turn = tendency[i]
        if left >= 0 and is_activated(distance[i, left], kind[i, left], near, fears_fire, loads):
            turn = -1.0
        if right >= 0 and is_activated(distance[i, right], kind[i, right], near, fears_fire, loads):
            turn = 1.0
        if turn != 0.0:
            command[i, 0] = max_speed[i] * (inner if turn > 0.0 else 1.0)
            command[i, 1] = max_speed[i] * (1.0 if turn > 0.0 else inner)
            layer[i] = index


@compiled
def is_activated(distance, kind, near, fears_fire, fears_load):
    """Return whether a sensor sees something too near."""
    return 0.0 <= distance < near and (fears_fire or kind != FIRE) and (fears_load or kind != LOAD)
