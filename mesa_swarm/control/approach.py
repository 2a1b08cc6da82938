"""Approach, Retreat and Halt: simple behaviours, of which states of a `StateMachine` are made."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from mesa_swarm.base.errors import check_choice, check_name, check_number
from mesa_swarm.control.layer import Memoryless, RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, direction_of
from mesa_swarm.robots.drive import approach
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.world.statics import KINDS

GOAL, HEAT = "goal", "heat"
TARGETS = (*KINDS, HEAT, GOAL)


@dataclass(frozen=True, kw_only=True, slots=True)
class Steering(Memoryless):
    """Base of `Approach` and `Retreat`: a target, and how far from straight ahead the robot drives straight on."""

    target: str = "robot"
    critical_angle_degrees: float = 20.0
    name: str
    sign: ClassVar[float]
    goes: ClassVar[str]

    def __post_init__(self) -> None:
        """Check every value."""
        check_name("name", self.name)
        check_choice("target", self.target, TARGETS)
        check_number("critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "SteeringRule"]:
        """Return what drives the robots that sense such things."""
        target = TARGETS.index(self.target), self.sign
        return go_towards, SteeringRule(robots, *target, math.radians(self.critical_angle_degrees))

    def reason(self, moment: Moment) -> Reason:
        """Return what it goes to, or away from."""
        where = {HEAT: "where it is hot", GOAL: "the goal that it heard"}
        seeing = moment.seeing(KINDS.index(self.target)) if self.target in KINDS else ()
        return Reason(f"{self.goes} {where.get(self.target, f'each {self.target} that it sees')}", tuple(seeing))


@dataclass(frozen=True, kw_only=True, slots=True)
class Approach(Steering):
    """Drive towards all things of a kind that are sensed, near ones most; turn on the spot while they are not ahead.

    The direction is that of the sum of ``1 / (1 + r)`` over the proximity sensors that see such a thing, r being the
    reading, each in the direction of its sensor: attraction and phototaxis of AutoMoDe [1]_. For "heat" the weights are
    the readings of the radiation sensors; "goal" is the nearest goal or beacon heard. Active when anything is sensed.

    Parameters
    ----------
    target : str
        "obstacle", "robot", "fire", "load", "heat" or "goal".
    critical_angle_degrees : float
        Up to this from straight ahead the robot drives straight on, 0 to 180.

    Raises
    ------
    InvalidValueError, UnknownNameError

    References
    ----------
    .. [1] Francesca, Brambilla, Brutschy, Trianni and Birattari, AutoMoDe: a novel approach to the automatic design of
       control software for robot swarms, Swarm Intelligence 8 (2014) 89-112.

    Examples
    --------
    >>> Approach(target="heat").critical_angle_degrees
    20.0
    """

    name: str = "Approach"
    sign: ClassVar[float] = 1.0
    goes: ClassVar[str] = "it goes to"


@dataclass(frozen=True, kw_only=True, slots=True)
class Retreat(Steering):
    """Drive away from all things of a kind that are sensed; the opposite of `Approach`, with its parameters.

    Examples
    --------
    >>> Retreat(target="robot").name
    'Retreat'
    """

    name: str = "Retreat"
    sign: ClassVar[float] = -1.0
    goes: ClassVar[str] = "it goes away from"


@dataclass(frozen=True, kw_only=True, slots=True)
class Halt(Memoryless):
    """Stand still; always active.

    Examples
    --------
    >>> Halt().name
    'Halt'
    """

    name: str = "Halt"

    def __post_init__(self) -> None:
        """Check the name."""
        check_name("name", self.name)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "HaltRule"]:
        """Return what halts the robots that no other layer drives."""
        return halt_robots, HaltRule(robots)

    def reason(self, moment: Moment) -> Reason:
        """Return that it stands."""
        return Reason("it is to stand")


class SteeringRule(NamedTuple):
    """What `go_towards` takes: a place in `TARGETS`, 1 for towards and -1 for away, and an angle in rad."""

    robots: RobotColumns
    target: int
    sign: float
    critical_angle: float


class HaltRule(NamedTuple):
    """What `halt_robots` takes."""

    robots: RobotColumns


HEAT_PLACE, GOAL_PLACE = TARGETS.index(HEAT), TARGETS.index(GOAL)


@compiled(nogil=True)
def go_towards(block, step, first, last):
    """Write the commands of robots that sense such things and are driven by no earlier layer."""
    rule = unpack(block, SteeringRule)
    robots = rule.robots
    command, layer = robots.command, robots.layer
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        x, y = find_direction(robots, rule.target, i)
        x, y = rule.sign * x, rule.sign * y
        if x != 0.0 or y != 0.0:
            bearing, speed = atan2(y, x), robots.max_speed[i]
            command[i, 0], command[i, 1] = approach(bearing, rule.critical_angle, speed, robots.radius[i])
            layer[i] = robots.place
    return 0


@compiled
def find_direction(robots, target, i):
    """Return where robot i senses a target, as a vector in its own frame, (0, 0) for nothing.

    The sum of the directions of sensors, each weighted: those that see things of a kind by 1 / (1 + reading), radiation
    sensors by what they read.
    """
    d, x, y = robots.design[i], 0.0, 0.0
    if target == GOAL_PLACE:
        x, y = robots.heard_goal[i, 0], robots.heard_goal[i, 1]
        return (0.0 if math.isnan(x) else x), (0.0 if math.isnan(y) else y)
    if target == HEAT_PLACE:
        for q in range(robots.radiation.shape[1]):
            ahead, left = direction_of(robots.radiation_bearing[d, q])
            x += robots.radiation[i, q] * ahead
            y += robots.radiation[i, q] * left
        return x, y
    for s in range(robots.kind.shape[1]):
        if robots.kind[i, s] == target:
            weight = 1.0 / (1.0 + robots.distance[i, s])
            ahead, left = direction_of(robots.bearing[d, s])
            x += weight * ahead
            y += weight * left
    return x, y


@compiled(nogil=True)
def halt_robots(block, step, first, last):
    """Write commands of zero for robots that no earlier layer drives."""
    robots = unpack(block, HaltRule).robots
    for i in range(robots.layer.shape[0]):
        if robots.layer[i] < 0:
            robots.command[i] = 0.0
            robots.layer[i] = robots.place
    return 0
