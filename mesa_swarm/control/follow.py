"""Follow: drive after the nearest robot ahead, which makes chains (thesis 5.2.3.2, 5.3.3)."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from mesa_swarm.base.errors import check_name, check_number
from mesa_swarm.control.layer import Memoryless, RobotColumns, Senses, sensor_ahead
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.robots.drive import turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.world.statics import ROBOT


@dataclass(frozen=True, kw_only=True)
class Follow(Memoryless):
    """Turn on the spot towards the nearest robot ahead; drive after it, faster while it is far.

    Active when a sensor with |bearing| < 90 degrees sees a robot (5.2).

    Parameters
    ----------
    critical_angle_degrees : float
        A robot seen farther than this from straight ahead is turned to on the spot, 0 to 180.
    gap : float or None
        The follower goes at `chase_speed` while the sensor reads more than this, map units, and at
        `cruise_speed` when it is nearer. None for no such rule: always at cruise speed, so that
        followers stay at the limit of their sight and chains break.
    chase_speed, cruise_speed : float
        Shares of max_speed, 0 to 1.

    Examples
    --------
    >>> Follow(gap=None).cruise_speed
    0.7
    """

    critical_angle_degrees: float = 10.0
    gap: float | None = 15.0
    chase_speed: float = 1.0
    cruise_speed: float = 0.7
    name: str = "Follow"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Follow's critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)
        if self.gap is not None:
            check_number("gap", self.gap, minimum=0, maximum=LARGEST_RANGE)
        check_number("chase_speed", self.chase_speed, minimum=0, maximum=1)
        check_number("cruise_speed", self.cruise_speed, minimum=0, maximum=1)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "FollowRule"]:
        """Return what drives the robots that see another ahead."""
        gap = math.inf if self.gap is None else float(self.gap)
        rule = math.radians(self.critical_angle_degrees), gap, float(self.chase_speed), float(self.cruise_speed)
        return follow_robots, FollowRule(robots, *rule)

    def reason(self, moment: Moment) -> Reason:
        """Return which robot it follows, and whether it must catch up."""
        seeing = moment.nearest(ROBOT, ahead=True)
        reading = moment.distance[seeing[0]]
        far = "" if self.gap is None else f" {'>' if reading > self.gap else '<='} gap {self.gap:g}"
        return Reason(f"nearest robot ahead: {moment.name(seeing[0])} {reading:.1f}{far}", tuple(seeing))


class FollowRule(NamedTuple):
    """What `follow_robots` takes: an angle in rad, the gap, and shares of speed beyond it and within."""

    robots: RobotColumns
    critical_angle: float
    gap: float
    chase: float
    cruise: float


@compiled(nogil=True)
def follow_robots(block, step, first, last):
    """Write the commands of robots that see another ahead and are driven by no earlier layer."""
    rule = unpack(block, FollowRule)
    robots = rule.robots
    distance, bearing, command, layer = robots.distance, robots.bearing, robots.command, robots.layer
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        s = sensor_ahead(distance, robots.kind, bearing, robots.design, i)
        if s < 0:
            continue
        towards = bearing[robots.design[i], s]
        if abs(towards) > rule.critical_angle:
            command[i, 0], command[i, 1] = turn_towards(towards, robots.max_speed[i], robots.radius[i])
        else:
            speed = robots.max_speed[i] * (rule.chase if distance[i, s] > rule.gap else rule.cruise)
            command[i, 0], command[i, 1] = speed, speed
        layer[i] = robots.place
    return 0
