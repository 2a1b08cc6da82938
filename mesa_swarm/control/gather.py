"""Gather: go to the robots that are seen, and stay near them (thesis 5.2.3.1); Lead: what makes groups move (5.3.2)."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_name, check_number
from mesa_swarm.control.layer import (
    CompiledLayer,
    Memoryless,
    RobotColumns,
    Senses,
    draw_numbers,
    perceive_centroid,
)
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, stream_of
from mesa_swarm.kernels.elementary import atan2, hypot
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals
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

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "GatherRule"]:
        """Return what turns or stops the robots that see others."""
        return gather_robots, GatherRule(robots, math.radians(self.critical_angle_degrees), float(self.stop_distance))

    def reason(self, moment: Moment) -> Reason:
        """Return where the others were seen."""
        seeing = moment.seeing(ROBOT)
        x, y = moment.position_of(seeing)
        where = f"{hypot(x, y):.1f} away at {math.degrees(atan2(y, x)):+.0f} degrees"
        return Reason(f"the centroid of the robots it sees is {where}", tuple(seeing))


class GatherRule(NamedTuple):
    """What `gather_robots` takes; the angle in rad."""

    robots: RobotColumns
    critical_angle: float
    stop_distance: float


@compiled(nogil=True)
def gather_robots(block, step, first, last):
    """Write the commands of robots that see others and are driven by no earlier layer."""
    rule = unpack(block, GatherRule)
    robots = rule.robots
    command, layer = robots.command, robots.layer
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        x, y, count = perceive_centroid(robots.distance, robots.kind, robots.sensors, robots.design, i)
        if count == 0:
            continue
        bearing = atan2(y, x)
        if abs(bearing) > rule.critical_angle:
            command[i, 0], command[i, 1] = turn_towards(bearing, robots.max_speed[i], robots.radius[i])
            layer[i] = robots.place
        elif hypot(x, y) <= rule.stop_distance:
            command[i, 0], command[i, 1] = 0.0, 0.0
            layer[i] = robots.place
    return 0


@dataclass(kw_only=True)
class Lead(CompiledLayer):
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

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Lead's speed", self.speed, minimum=0, maximum=1)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember the rank."""
        self._swarm, self._prefix, self._rng = swarm, prefix, rng
        swarm.remember(f"{prefix}.rank", (), np.float64, 0.0)

    def lacks(self, senses: Senses) -> str:
        """Return that a message is missing."""
        if "rank" in senses.send:
            return ""
        return 'Lead compares ranks, but robots broadcast none; set model.communication = Radio(message=("rank",))'

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "LeadRule"]:
        """Return what drives the robots that lead."""
        rank, heard = self._swarm.columns[f"{self._prefix}.rank"], senses.heard
        messages = senses.send["rank"], heard["n"], heard["rank"]
        return lead, LeadRule(robots, float(self.speed), rank, *messages, stream_of(self._rng))

    def reason(self, moment: Moment) -> Reason:
        """Return that it leads."""
        return Reason("no robot that it hears has a lower rank: it leads")


class LeadRule(NamedTuple):
    """What `lead` takes: the share of speed, ranks of robots, what they send, and of how many they hear which."""

    robots: RobotColumns
    share: float
    rank: Reals
    sent: Reals
    senders: Integers
    heard: RealRows
    stream: Stream


@compiled(nogil=True)
def lead(block, step, first, last):
    """Send ranks; drive the robots that hear others, all of higher rank, and are driven by no earlier layer."""
    rule = unpack(block, LeadRule)
    robots, rank = rule.robots, rule.rank
    draw_numbers(rule.stream, rank)
    for i in range(rank.shape[0]):
        rule.sent[i] = rank[i]
        leads = robots.layer[i] < 0 and rule.senders[i] > 0
        for k in range(rule.senders[i]):
            leads = leads and not rule.heard[i, k] < rank[i]
        if leads:
            speed = rule.share * robots.max_speed[i]
            robots.command[i, 0], robots.command[i, 1] = speed, speed
            robots.layer[i] = robots.place
    return 0
