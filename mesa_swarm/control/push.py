"""Push: move a load to a goal, together with other robots (thesis 3.2, 10.2, its future work)."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_choice, check_name, check_number
from mesa_swarm.control.layer import Memoryless, RobotColumns, Senses, nearest_of
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.robots.drive import approach
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.world.statics import LOAD

FROM = ("behind", "anywhere")
# Going round a load, a robot turns towards it or away from it by at most this much to hold its distance.
MOST_CORRECTION = 0.6


@dataclass(frozen=True, kw_only=True)
class Push(Memoryless):
    """Go to the nearest load that is seen and push it; from behind, if there is a goal to bring it to.

    A robot that does not hear the goal's beacon because the load is in between is behind the load, as seen from
    the goal: it drives at the load and pushes. One that hears the beacon goes round the load, with it on the
    side of its own tendency, until it does not. No robot needs to know where the goal is, nor which others push
    (occlusion-based transport: Chen, Gauci, Li, Kolling and Gross 2015, IEEE Transactions on Robotics 31, 307-321).

    It needs a model whose `communication` is a `Radio` with beacons and occlusion, unless it pushes from anywhere.
    Active when a sensor sees a load; put `Avoid(loads="never")` above.

    Parameters
    ----------
    side : str
        "behind": only when the goal is not heard. "anywhere": always.
    clearance : float
        Distance to hold from the load while going round it, as the sensor reads it, map units, at least 0.
    critical_angle_degrees : float
        A load seen farther than this from straight ahead is turned to on the spot, 0 to 180.

    Examples
    --------
    >>> Push(side="anywhere").clearance
    20.0
    """

    side: str = "behind"
    clearance: float = 20.0
    critical_angle_degrees: float = 20.0
    name: str = "Push"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_choice("side", self.side, FROM)
        check_number("clearance", self.clearance, minimum=0, maximum=LARGEST_RANGE)
        check_number("Push's critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "PushRule"]:
        """Return what drives the robots that see a load."""
        rule = self.side == "anywhere", float(self.clearance), math.radians(self.critical_angle_degrees)
        return push, PushRule(robots, *rule)

    def reason(self, moment: Moment) -> Reason:
        """Return whether it pushes or goes round, and why."""
        seeing = moment.nearest(LOAD)
        hears = bool(np.isfinite(moment.columns["heard_goal"]).all())
        if self.side == "anywhere":
            why = "it pushes from anywhere"
        else:
            why = "it hears the goal, so it goes round" if hears else "no goal is to be heard here, so it pushes"
        return Reason(f"{moment.reading(seeing[0])}; {why}", tuple(seeing))


class PushRule(NamedTuple):
    """What `push` takes: whether from any side, the distance to hold while going round a load, an angle in rad."""

    robots: RobotColumns
    anywhere: bool
    clearance: float
    critical_angle: float


@compiled(nogil=True)
def push(block, step, first, last):
    """Write the commands of robots that see a load and are driven by no earlier layer."""
    rule = unpack(block, PushRule)
    robots = rule.robots
    distance, command, layer = robots.distance, robots.command, robots.layer
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        nearest = nearest_of(distance, robots.kind, i, LOAD)
        if nearest < 0:
            continue
        towards = robots.bearing[robots.design[i], nearest]
        if not rule.anywhere and not math.isnan(robots.heard_goal[i, 0]):
            towards = way_round(towards, distance[i, nearest], rule.clearance, robots.tendency[i])
        speed, radius = robots.max_speed[i], robots.radius[i]
        command[i, 0], command[i, 1] = approach(towards, rule.critical_angle, speed, radius)
        layer[i] = robots.place
    return 0


@compiled
def way_round(bearing: float, reading: float, clearance: float, side: float) -> float:
    """Return the bearing (rad) of the way round what is seen, with it on the left (side 1) or right (-1)."""
    off = (reading - clearance) / max(clearance, 1.0)
    correction = min(max(off, -MOST_CORRECTION), MOST_CORRECTION)
    return wrap_angle(bearing - side * (0.5 * math.pi - correction))
