"""Perimeter: form a ring around the others, turned outwards."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_name, check_number
from mesa_swarm.control.layer import CompiledLayer, RobotColumns, Senses, perceive_centroid
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, hypot
from mesa_swarm.kernels.type_names import Flags
from mesa_swarm.robots.drive import turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT


@dataclass(kw_only=True)
class Perimeter(CompiledLayer):
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

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("ring", self.ring, minimum=0, maximum=LARGEST_RANGE)
        check_number("tolerance", self.tolerance, minimum=0, maximum=LARGEST_RANGE)
        check_number("Perimeter's critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember which robots have settled on the ring."""
        self._swarm, self._settled = swarm, f"{prefix}.settled"
        swarm.remember(self._settled, (), np.bool_, False)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "RingRule"]:
        """Return what drives the robots that see others."""
        rule = float(self.ring), float(self.tolerance), math.radians(self.critical_angle_degrees)
        return keep_ring, RingRule(robots, *rule, self._swarm.columns[self._settled])

    def reason(self, moment: Moment) -> Reason:
        """Return how far the centroid is, and on which side of the ring the robot is."""
        seeing = moment.seeing(ROBOT)
        distance = hypot(*moment.position_of(seeing))
        off = distance - self.ring
        if abs(off) <= 2.0 * self.tolerance:  # between one and two tolerances it may have settled or not
            where = "on" if abs(off) <= self.tolerance else "at the edge of"
        else:
            where = "outside" if off > 0.0 else "inside"
        words = f"the centroid of the robots it sees is {distance:.1f} away: {where} the ring of {self.ring:g}"
        return Reason(words, tuple(seeing))


class RingRule(NamedTuple):
    """What `keep_ring` takes: distances, an angle in rad, and which robots have settled on the ring."""

    robots: RobotColumns
    ring: float
    tolerance: float
    critical_angle: float
    rests: Flags


@compiled(nogil=True)
def keep_ring(block, step, first, last):
    """Write the commands of robots that see others and are driven by no earlier layer."""
    rule = unpack(block, RingRule)
    robots, rests, tolerance = rule.robots, rule.rests, rule.tolerance
    command, layer = robots.command, robots.layer
    for i in range(layer.shape[0]):
        x, y, count = perceive_centroid(robots.distance, robots.kind, robots.sensors, robots.design, i)
        if layer[i] >= 0 or count == 0:
            rests[i] = False
            continue
        distance = hypot(x, y)
        rests[i] = abs(distance - rule.ring) <= (2.0 * tolerance if rests[i] else tolerance)
        # Towards the centroid from outside the ring, else away from it.
        towards = 1.0 if distance > rule.ring and not rests[i] else -1.0
        bearing = atan2(towards * y, towards * x)
        layer[i] = robots.place
        if abs(bearing) > rule.critical_angle:
            command[i, 0], command[i, 1] = turn_towards(bearing, robots.max_speed[i], robots.radius[i])
        else:
            speed = 0.0 if rests[i] else robots.max_speed[i]
            command[i, 0], command[i, 1] = speed, speed
    return 0
