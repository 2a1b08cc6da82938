"""The layers that fight fires, with the thesis's strategies A and B, and that seek the hottest fire (PHYSICS 7)."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from mesa_swarm.base.errors import check_choice, check_name, check_number
from mesa_swarm.control.layer import Memoryless, RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, MOUNT_X, MOUNT_Y
from mesa_swarm.robots.drive import approach
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.world.statics import FIRE

STRATEGIES = ("A", "B")
# The task of a robot that extinguishes a fire, or waits at one until it may.
FIGHTS = 0


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

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "FightRule"]:
        """Return what drives the robots that see, fight, or wait for a fire."""
        return fight, FightRule(robots, self.strategy == "B", math.radians(self.critical_angle_degrees))

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


class FightRule(NamedTuple):
    """What `fight` takes: whether robots return when they are cool, which is strategy B, and an angle in rad."""

    robots: RobotColumns
    returns: bool
    critical_angle: float


@compiled(nogil=True)
def fight(block, step, first, last):
    """Write the commands, tasks and goals of robots that no earlier layer drives."""
    rule = unpack(block, FightRule)
    robots = rule.robots
    distance, command, layer, sensors = robots.distance, robots.command, robots.layer, robots.sensors
    for i in range(layer.shape[0]):
        hot, fire = robots.hot[i], robots.fire[i]
        if layer[i] >= 0 or (hot and not rule.returns):
            continue
        sensor = nearest_seen(distance[i], robots.kind[i])
        if fire < 0 and sensor < 0 and not (hot and robots.heat[i] > 0.0):
            continue
        layer[i] = robots.place
        speed, d = robots.max_speed[i], robots.design[i]
        if hot or fire >= 0:
            robots.task[i] = FIGHTS
            if sensor >= 0:
                # Where a sensor sees something: in the middle of its sector, for all that the robot knows.
                robots.goal[i, 0] = sensors[d, sensor, MOUNT_X] + distance[i, sensor] * sensors[d, sensor, AXIS_X]
                robots.goal[i, 1] = sensors[d, sensor, MOUNT_Y] + distance[i, sensor] * sensors[d, sensor, AXIS_Y]
        if hot:
            backward = -speed if robots.heat[i] > 0.0 else 0.0
            command[i, 0], command[i, 1] = backward, backward
        elif fire >= 0:
            command[i, 0], command[i, 1] = 0.0, 0.0
        else:
            bearing = robots.bearing[d, sensor]
            command[i, 0], command[i, 1] = approach(bearing, rule.critical_angle, speed, robots.radius[i])
    return 0


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

    def lacks(self, senses: Senses) -> str:
        """Return that sensors are missing."""
        if not len(senses.design) or senses.radiation.shape[1]:
            return ""
        return (
            "SeekHeat feels fires by radiation sensors, but robots have none; add RadiationSensor() to their "
            "sensors, as in RobotDesign(sensors=(*AGENT9.sensors, RadiationSensor()))"
        )

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "SeekRule"]:
        """Return what drives the robots that feel a fire."""
        return seek_heat, SeekRule(robots, float(self.least), math.radians(self.critical_angle_degrees))

    def reason(self, moment: Moment) -> Reason:
        """Return how hot it is where it goes."""
        heats = moment.columns.get("radiation")
        return Reason("it feels a fire" if heats is None else f"it feels a fire of temperature {max(heats):.2f}")


class SeekRule(NamedTuple):
    """What `seek_heat` takes: readings up to `least` are ignored; an angle in rad."""

    robots: RobotColumns
    least: float
    critical_angle: float


@compiled(nogil=True)
def seek_heat(block, step, first, last):
    """Write the commands of robots that no earlier layer drives; of equal readings that most nearly ahead counts."""
    rule = unpack(block, SeekRule)
    robots, radiation, bearing = rule.robots, rule.robots.radiation, rule.robots.radiation_bearing
    command, layer = robots.command, robots.layer
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or robots.hot[i] or robots.fire[i] >= 0:
            continue
        d, best = robots.design[i], -1
        for q in range(radiation.shape[1]):
            if radiation[i, q] <= rule.least:
                continue
            if (
                best < 0
                or radiation[i, q] > radiation[i, best]
                or (radiation[i, q] == radiation[i, best] and abs(bearing[d, q]) < abs(bearing[d, best]))
            ):
                best = q
        if best >= 0:
            layer[i] = robots.place
            speed, radius = robots.max_speed[i], robots.radius[i]
            command[i, 0], command[i, 1] = approach(bearing[d, best], rule.critical_angle, speed, radius)
    return 0
