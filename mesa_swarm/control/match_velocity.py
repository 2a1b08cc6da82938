"""MatchVelocity: drive as those that are seen drive, which makes flocks (thesis 5.3.4)."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mesa_swarm.control.apparent import FEWEST, Apparent
from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import check_name, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.physics.motion import sinc
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT


@dataclass(kw_only=True)
class MatchVelocity:
    """Drive the arc that takes the robot as far, and in the same direction, as its neighbours moved.

    In one step a robot can reach the point T = m, the displacement of the visible centroid in a step, along
    an arc that begins in its own direction; T must lie ahead. Wheels that would have to turn faster than
    they can are slowed together, so that the robot keeps to the arc and needs several steps.

    Active when robots have been seen for a few steps, their centroid moves by at least `slowest`, and T
    lies within 90 degrees. Others, and robots whose neighbours stand still (which would otherwise stand still
    together for ever), are left to the layers below.

    Parameters
    ----------
    memory : float
        Steps over which the neighbours' velocity is averaged, at least 1: sensors that tell no direction
        inside their sectors make single steps useless.
    jump : float
        The centroid of the same neighbours moves at most this far in a step, map units, above 0; where it
        seems to move farther others have come or gone, and the step is not counted.
    slowest : float
        Share of max_speed below which the neighbours count as standing still, 0 to 1.

    Examples
    --------
    >>> MatchVelocity(memory=10).slowest
    0.1
    """

    memory: float = 20.0
    jump: float = 15.0
    slowest: float = 0.1
    name: str = "MatchVelocity"
    commands_wheels: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_name("name", self.name)
        check_number("MatchVelocity's memory", self.memory, minimum=1, maximum=1e6)
        check_number("MatchVelocity's jump", self.jump, above=0)
        check_number("MatchVelocity's slowest", self.slowest, minimum=0, maximum=1)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember where the centroid was, and how it moves."""
        self._apparent = Apparent(swarm, prefix, float(self.memory), float(self.jump), True)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that know how others move."""
        velocity, compared = self._apparent.update(senses)
        drive_arcs(
            velocity, compared, FEWEST, float(self.slowest), senses.max_speed, senses.radius, command, layer, index
        )

    def reason(self, moment: Moment) -> Reason:
        """Say whom it matches."""
        seeing = moment.seeing(ROBOT)
        return Reason(f"it matches the motion of the robots that {len(seeing)} of its sensors see", tuple(seeing))


@compiled
def drive_arcs(velocity, compared, fewest, slowest, max_speed, radius, command, layer, index):
    """Write the commands of robots that know their neighbours' velocity and are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        x, y = velocity[i, 0], velocity[i, 1]
        length = math.hypot(x, y)
        if layer[i] >= 0 or compared[i] < fewest or x <= 0.0 or length < slowest * max_speed[i]:
            continue
        bearing = math.atan2(y, x)
        # The chord of an arc that turns by 2 b points along b, and is sinc(b) times as long as the arc.
        speed, rim = length / sinc(bearing), 2.0 * bearing * radius[i]
        share = min(1.0, max_speed[i] / (speed + abs(rim)))
        command[i, 0] = share * (speed - rim)
        command[i, 1] = share * (speed + rim)
        layer[i] = index
