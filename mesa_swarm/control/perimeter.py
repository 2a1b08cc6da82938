"""Perimeter: form a ring around the others, turned outwards."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mesa_swarm.base.errors import check_name, check_number
from mesa_swarm.control.layer import Senses, centroids
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.robots.drive import turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT


@dataclass(kw_only=True)
class Perimeter:
    """Go to the ring at a distance around the perceived centroid, stay on it, and turn outwards there.

    Farther out than the ring the robot drives towards the centroid of the robots that it sees, farther in it
    drives away from it, and on the ring it turns its back to it and stays, until it is off by twice the tolerance
    (else it would turn to and fro at the edge of the ring). It needs sensors that see behind it. Active when a
    robot is seen.

    Parameters
    ----------
    ring : float
        Distance from the robot's centre to the centroid, map units, at least 0.
    tolerance : float
        Half the width of the ring, map units, at least 0.
    critical_angle_degrees : float
        How exactly it is turned outwards, 0 to 180.

    Examples
    --------
    >>> Perimeter(ring=60).tolerance
    4.0
    """

    ring: float = 40.0
    tolerance: float = 4.0
    critical_angle_degrees: float = 15.0
    name: str = "Perimeter"
    commands_wheels: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("ring", self.ring, minimum=0, maximum=LARGEST_RANGE)
        check_number("tolerance", self.tolerance, minimum=0, maximum=LARGEST_RANGE)
        check_number("Perimeter's critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember which robots have settled on the ring."""
        self._swarm, self._settled = swarm, f"{prefix}.settled"
        swarm.remember(self._settled, (), np.bool_, False)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that see others."""
        centroid, count = centroids(senses)
        critical = math.radians(self.critical_angle_degrees)
        ring, tolerance = float(self.ring), float(self.tolerance)
        rests = self._swarm.columns[self._settled]
        keep_ring(
            centroid, count, senses.max_speed, senses.radius, ring, tolerance, critical, rests, command, layer, index
        )

    def reason(self, moment: Moment) -> Reason:
        """Return how far the centroid is, and on which side of the ring the robot is."""
        seeing = moment.seeing(ROBOT)
        distance = math.hypot(*moment.position_of(seeing))
        off = distance - self.ring
        if abs(off) <= 2.0 * self.tolerance:  # between one and two tolerances it may have settled or not
            where = "on" if abs(off) <= self.tolerance else "at the edge of"
        else:
            where = "outside" if off > 0.0 else "inside"
        words = f"the centroid of the robots it sees is {distance:.1f} away: {where} the ring of {self.ring:g}"
        return Reason(words, tuple(seeing))


@compiled
def keep_ring(centroid, count, max_speed, radius, ring, tolerance, critical_angle, rests, command, layer, index):
    """Write the commands of robots that see others and are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or count[i] == 0:
            rests[i] = False
            continue
        x, y = centroid[i, 0], centroid[i, 1]
        distance = math.hypot(x, y)
        rests[i] = abs(distance - ring) <= (2.0 * tolerance if rests[i] else tolerance)
        # Towards the centroid from outside the ring, else away from it.
        towards = 1.0 if distance > ring and not rests[i] else -1.0
        bearing = math.atan2(towards * y, towards * x)
        layer[i] = index
        if abs(bearing) > critical_angle:
            command[i, 0], command[i, 1] = turn_towards(bearing, max_speed[i], radius[i])
        else:
            speed = 0.0 if rests[i] else max_speed[i]
            command[i, 0], command[i, 1] = speed, speed
