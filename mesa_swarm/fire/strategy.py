"""The layers that fight fires, with the thesis's strategies A and B, and that seek the hottest fire (PHYSICS 7)."""

import math
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_name, check_number
from mesa_swarm.control.layer import Memoryless, Senses, kernel_with
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import CodeRows, Flags, Integers, RealRows, Reals, RealTables
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, MOUNT_X, MOUNT_Y
from mesa_swarm.robots.drive import approach
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.world.statics import FIRE

STRATEGIES = ("A", "B")
# The task of a robot that extinguishes a fire, or waits at one until it may.
FIGHTS = 0
SENSED = attrgetter(*["distance", "kind", "heat", "hot", "fire", "max_speed", "radius", "design", "bearing", "sensors"])
FELT = attrgetter("radiation", "radiation_bearing", "hot", "fire", "max_speed", "radius", "design")


@dataclass(frozen=True, kw_only=True)
class FightFire(Memoryless):
    """Go to a fire that is seen, stay while extinguishing it, and leave when too hot.

    Strategy A: a robot that is too hot ignores fires until it is cool; the layers below make it explore, and
    `Avoid(fires="when hot")` above turns it away. Strategy B: it backs off until it takes no more
    heat, waits there, facing the same fire, and returns when it is cool; put `Avoid(fires="never")` above.

    Active while a burning fire is seen or being extinguished and, under A, the robot is not too hot.

    A robot that extinguishes, or waits at a fire, has task 0, and for its goal what it sees of that fire.

    Parameters
    ----------
    strategy : str
        "A" or "B".
    critical_angle_degrees : float
        A fire seen farther than this from straight ahead is turned to on the spot, 0 to 180.

    Examples
    --------
    >>> FightFire(strategy="A").name
    'FightFire'
    """

    strategy: str = "B"
    critical_angle_degrees: float = 10.0
    name: str = "FightFire"

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_name("name", self.name)
        check_choice("strategy", self.strategy, STRATEGIES)
        check_number("critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that see, fight, or wait for a fire."""
        fight(*self._arguments(senses, command, layer, index))

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> Kernel:
        """Return what `decide` does."""
        return kernel_with(fight_all, self._arguments(senses, command, layer, index))

    def _arguments(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> "FightArrays":
        rule = self.strategy == "B", math.radians(self.critical_angle_degrees)
        return FightArrays(*(*SENSED(senses), *rule, command, layer, index, senses.task, senses.goal))

    def reason(self, moment: Moment) -> Reason:
        """Return what it does, at which fire."""
        seeing = moment.nearest(FIRE)
        where = f" ({moment.reading(seeing[0])})" if seeing else ""
        if moment.columns["hot"]:
            stays = "backs out of the heat" if moment.columns["heat"] > 0 else "waits until it is cool"
            return Reason(f"it is too hot, at {moment.columns['temperature']:.0f}, and {stays}{where}", tuple(seeing))
        if moment.columns["fire"] >= 0:
            return Reason(f"it puts out a fire{where}", tuple(seeing))
        return Reason(f"it goes to a fire{where}", tuple(seeing))


class FightArrays(NamedTuple):
    """The arguments of `fight`, in its order."""

    distance: RealRows
    kind: CodeRows
    heat: Reals
    hot: Flags
    fire: Integers
    max_speed: Reals
    radius: Reals
    design: Integers
    bearing: RealRows
    sensors: RealTables
    returns: bool
    critical_angle: float
    command: RealRows
    layer: Integers
    place: int
    task: Integers
    goal: RealRows


@compiled(nogil=True)
def fight_all(block, step, first, last):
    """Do what `fight` does, for all rows."""
    fight(*unpack(block, FightArrays))
    return 0


@compiled
def fight(
    distance, kind, heat, hot, fire, max_speed, radius, design, bearing, sensors, returns, critical_angle,
    command, layer, index, task, goal,
):  # fmt: skip
    """Write the commands, tasks and goals of robots that no earlier layer drives; `returns` is strategy B."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or (hot[i] and not returns):
            continue
        sensor = nearest_seen(distance[i], kind[i])
        if fire[i] < 0 and sensor < 0 and not (hot[i] and heat[i] > 0.0):
            continue
        layer[i] = index
        speed, d = max_speed[i], design[i]
        if hot[i] or fire[i] >= 0:
            task[i] = FIGHTS
            if sensor >= 0:
                # Where a sensor sees something: in the middle of its sector, for all that the robot knows.
                goal[i, 0] = sensors[d, sensor, MOUNT_X] + distance[i, sensor] * sensors[d, sensor, AXIS_X]
                goal[i, 1] = sensors[d, sensor, MOUNT_Y] + distance[i, sensor] * sensors[d, sensor, AXIS_Y]
        if hot[i]:
            backward = -speed if heat[i] > 0.0 else 0.0
            command[i, 0], command[i, 1] = backward, backward
        elif fire[i] >= 0:
            command[i, 0], command[i, 1] = 0.0, 0.0
        else:
            command[i, 0], command[i, 1] = approach(bearing[d, sensor], critical_angle, speed, radius[i])


@compiled
def nearest_seen(distance, kind):
    """Return the proximity sensor that sees the nearest burning fire, -1 if none does."""
    nearest = -1
    for s in range(distance.shape[0]):
        if kind[s] == FIRE and (nearest < 0 or distance[s] < distance[nearest]):
            nearest = s
    return nearest


@dataclass(frozen=True, kw_only=True)
class SeekHeat(Memoryless):
    """Go to the hottest fire that the radiation sensors feel, rather than to the nearest that is seen.

    Active while one of them reads more than `least` and the robot is neither too hot nor extinguishing; put it above
    `FightFire`, which stays at a fire that the robot reaches. A radiation sensor reads how hot the hottest fire in its
    sector is, not where in it: the robot turns until the sensor that looks most nearly ahead feels it. Robots without
    such sensors, beside others with some, are left to the layers below.

    Parameters
    ----------
    least : float
        Readings up to this are ignored, 0 to 1.
    critical_angle_degrees : float
        A sensor that points farther than this from straight ahead makes the robot turn on the spot, 0 to 180.

    Raises
    ------
    InvalidValueError
        If a number is out of its range, or `name` is not one line of text; in the first step of a model whose robots
        have no radiation sensor.

    Examples
    --------
    >>> SeekHeat(least=0.2).name
    'SeekHeat'
    """

    least: float = 0.0
    critical_angle_degrees: float = 10.0
    name: str = "SeekHeat"

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_name("name", self.name)
        check_number("least", self.least, minimum=0, maximum=1)
        check_number("critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that feel a fire."""
        if len(layer) and not senses.radiation.shape[1]:
            raise InvalidValueError(
                "SeekHeat feels fires by radiation sensors, but robots have none; add RadiationSensor() to their "
                "sensors, as in RobotDesign(sensors=(*AGENT9.sensors, RadiationSensor()))"
            )
        rule = float(self.least), math.radians(self.critical_angle_degrees)
        seek_heat(*FELT(senses), *rule, command, layer, index)

    def reason(self, moment: Moment) -> Reason:
        """Return how hot it is where it goes."""
        heats = moment.columns.get("radiation")
        return Reason("it feels a fire" if heats is None else f"it feels a fire of temperature {max(heats):.2f}")


@compiled
def seek_heat(radiation, bearing, hot, fire, max_speed, radius, design, least, critical_angle, command, layer, index):
    """Write the commands of robots that no earlier layer drives; of equal readings that most nearly ahead counts."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or hot[i] or fire[i] >= 0:
            continue
        d, best = design[i], -1
        for q in range(radiation.shape[1]):
            if radiation[i, q] <= least:
                continue
            if (
                best < 0
                or radiation[i, q] > radiation[i, best]
                or (radiation[i, q] == radiation[i, best] and abs(bearing[d, q]) < abs(bearing[d, best]))
            ):
                best = q
        if best >= 0:
            layer[i] = index
            command[i, 0], command[i, 1] = approach(bearing[d, best], critical_angle, max_speed[i], radius[i])
