"""Approach, Retreat and Halt: simple behaviours, of which states of a `StateMachine` are made."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mesa_swarm.base.errors import check_choice, check_name, check_number
from mesa_swarm.control.layer import Memoryless, Senses
from mesa_swarm.kernels.compiled import compiled
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

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that sense such things."""
        towards, critical = (
            self.sign * directions_to_targets(senses, self.target),
            math.radians(self.critical_angle_degrees),
        )
        go_towards(towards, senses.max_speed, senses.radius, critical, command, layer, index)

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

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Halt the robots that no other layer drives."""
        halt_robots(command, layer, index)

    def reason(self, moment: Moment) -> Reason:
        """Return that it stands."""
        return Reason("it is to stand")


def directions_to_targets(senses: Senses, target: str) -> np.ndarray:
    """Return where each robot senses a target, as vectors (n, 2) in its own frame, (0, 0) for nothing."""
    if target == GOAL:
        return np.nan_to_num(senses.heard_goal)
    sums = np.empty((len(senses.design), 2))
    if target == HEAT:
        sum_of_heat(senses.radiation, senses.radiation_bearing, senses.design, sums)
    else:
        sum_of_things(senses.distance, senses.kind, senses.bearing, senses.design, KINDS.index(target), sums)
    return sums


@compiled
def sum_of_things(distance, kind, bearing, design, target, sums):
    """Write the sum of directions of sensors that see things of a kind, each weighted by 1 / (1 + reading)."""
    for i in range(sums.shape[0]):
        sums[i, 0], sums[i, 1] = 0.0, 0.0
        for s in range(kind.shape[1]):
            if kind[i, s] == target:
                weight = 1.0 / (1.0 + distance[i, s])
                sums[i, 0] += weight * math.cos(bearing[design[i], s])
                sums[i, 1] += weight * math.sin(bearing[design[i], s])


@compiled
def sum_of_heat(radiation, bearing, design, sums):
    """Write the sum of directions of radiation sensors, each weighted by its reading."""
    for i in range(sums.shape[0]):
        sums[i, 0], sums[i, 1] = 0.0, 0.0
        for q in range(radiation.shape[1]):
            sums[i, 0] += radiation[i, q] * math.cos(bearing[design[i], q])
            sums[i, 1] += radiation[i, q] * math.sin(bearing[design[i], q])


@compiled
def go_towards(towards, max_speed, radius, critical_angle, command, layer, index):
    """Write the commands of robots that have a direction and are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        x, y = towards[i, 0], towards[i, 1]
        if layer[i] < 0 and (x != 0.0 or y != 0.0):
            command[i, 0], command[i, 1] = approach(math.atan2(y, x), critical_angle, max_speed[i], radius[i])
            layer[i] = index


@compiled
def halt_robots(command, layer, index):
    """Write commands of zero for robots that no earlier layer drives."""
    for i in range(layer.shape[0]):
        if layer[i] < 0:
            for w in range(command.shape[1]):
                command[i, w] = 0.0
            layer[i] = index
