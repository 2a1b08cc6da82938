"""Gather: go to the robots that are seen, and stay near them (thesis 5.2.3.1); Lead: what makes groups move (5.3.2)."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_name, check_number
from mesa_swarm.control.layer import Memoryless, Senses, centroids, draw_once
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.robots.drive import turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT


@dataclass(frozen=True, kw_only=True)
class Gather(Memoryless):
    """Turn on the spot towards the perceived centroid of the robots that are seen, and stay once it is near.

    Active when a robot is seen and the centroid (5.1) is either farther than the critical angle from straight
    ahead (the robot turns on the spot) or ahead within `stop_distance` (it stays). When the centroid is ahead
    and far, the layers below drive: exploring straight on leads to it.

    Parameters
    ----------
    critical_angle_degrees : float
        0 to 180.
    stop_distance : float
        From the robot's centre to the centroid, map units, at least 0.

    Examples
    --------
    >>> Gather(stop_distance=25).critical_angle_degrees
    10.0
    """

    critical_angle_degrees: float = 10.0
    stop_distance: float = 20.0
    name: str = "Gather"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Gather's critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)
        check_number("stop_distance", self.stop_distance, minimum=0, maximum=LARGEST_RANGE)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Turn or stop the robots that see others."""
        centroid, count = centroids(senses)
        critical = math.radians(self.critical_angle_degrees)
        gather_robots(
            centroid, count, senses.max_speed, senses.radius, critical, float(self.stop_distance), command, layer, index
        )

    def reason(self, moment: Moment) -> Reason:
        """Return where the others were seen."""
        seeing = moment.seeing(ROBOT)
        x, y = moment.position_of(seeing)
        where = f"{math.hypot(x, y):.1f} away at {math.degrees(math.atan2(y, x)):+.0f} degrees"
        return Reason(f"the centroid of the robots it sees is {where}", tuple(seeing))


@compiled
def gather_robots(centroid, count, max_speed, radius, critical_angle, stop_distance, command, layer, index):
    """Write the commands of robots that see others and are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or count[i] == 0:
            continue
        bearing = math.atan2(centroid[i, 1], centroid[i, 0])
        if abs(bearing) > critical_angle:
            command[i, 0], command[i, 1] = turn_towards(bearing, max_speed[i], radius[i])
            layer[i] = index
        elif math.hypot(centroid[i, 0], centroid[i, 1]) <= stop_distance:
            command[i, 0], command[i, 1] = 0.0, 0.0
            layer[i] = index


@dataclass(kw_only=True)
class Lead:
    """Drive slowly straight on where no robot within range has a lower rank, so that the others move after it.

    Each robot draws a rank at random once, and broadcasts it: it needs ``communication = Radio(message=("rank",))``.
    Above `Gather` the robot of the lowest rank leads those that gather about it; groups that meet merge, and one leader
    remains. Active where others are heard, all of higher rank.

    Parameters
    ----------
    speed : float
        Share of max_speed, 0 to 1: low, so that the others keep up.

    Raises
    ------
    InvalidValueError
        If the speed is out of its range, or `name` is not one line of text; in the first step of a model whose
        `communication` has no message "rank".

    Examples
    --------
    >>> Lead(speed=0.2).name
    'Lead'
    """

    speed: float = 0.3
    name: str = "Lead"
    commands_wheels: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Lead's speed", self.speed, minimum=0, maximum=1)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember the rank."""
        self._swarm, self._prefix, self._rng = swarm, prefix, rng
        swarm.remember(f"{prefix}.rank", (), np.float64, 0.0)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that lead."""
        if "rank" not in senses.send:
            raise InvalidValueError(
                'Lead compares ranks, but robots broadcast none; set model.communication = Radio(message=("rank",))'
            )
        rank = draw_once(self._swarm.columns[f"{self._prefix}.rank"], self._rng)
        np.copyto(senses.send["rank"], rank)
        heard = senses.heard
        lead(rank, heard["n"], heard["rank"], senses.max_speed, float(self.speed), command, layer, index)

    def reason(self, moment: Moment) -> Reason:
        """Return that it leads."""
        return Reason("no robot that it hears has a lower rank: it leads")


@compiled
def lead(rank, count, heard, max_speed, share, command, layer, index):
    """Write the commands of robots that hear others, all of higher rank, and are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        leads = layer[i] < 0 and count[i] > 0
        for k in range(count[i]):
            leads = leads and not heard[i, k] < rank[i]
        if leads:
            command[i, 0], command[i, 1] = share * max_speed[i], share * max_speed[i]
            layer[i] = index
