"""Respond: go to where help is needed, as others broadcast it."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from mesa_swarm.base.errors import check_choice, check_name, check_number
from mesa_swarm.control.layer import Memoryless, RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, hypot
from mesa_swarm.kernels.type_names import RealRows
from mesa_swarm.robots.drive import approach
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE

TO = ("state", "goal")


@dataclass(frozen=True, kw_only=True)
class Respond(Memoryless):
    """Go to the nearest robot that is at work, or to the nearest goal that is broadcast.

    Active where something was heard that is farther than `near`, and the robot neither fights a fire nor
    is too hot to. Nearer than that the layers below take over: robots about what calls them would else
    circle without end. A robot that goes on and away is called back.

    `near` should be a little more than what the robot's sensors see. Where both do, a layer above that turns
    it to what it sees and this one, which turns it to what it hears, may turn it to and fro without end.

    It needs a model whose `communication` is a `Radio`.

    Parameters
    ----------
    to : str
        "state": to the nearest robot heard that has a task. "goal": to the nearest goal heard.
    near : float
        Centre to centre, or centre to goal, map units, at least 0.
    critical_angle_degrees : float
        What is farther than this from straight ahead is turned to on the spot, 0 to 180.

    References
    ----------
    T. Balch and R. C. Arkin, Communication in reactive multiagent robotic systems, Autonomous Robots 1
    (1994) 27-52.

    Examples
    --------
    >>> Respond(to="goal").near
    60.0
    """

    to: str = "state"
    near: float = 60.0
    critical_angle_degrees: float = 10.0
    name: str = "Respond"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_choice("to", self.to, TO)
        check_number("near", self.near, minimum=0, maximum=LARGEST_RANGE)
        check_number("critical_angle_degrees", self.critical_angle_degrees, minimum=0, maximum=180)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "RespondRule"]:
        """Return what drives the robots that were called."""
        target = senses.heard_from if self.to == "state" else senses.heard_goal
        critical = math.radians(self.critical_angle_degrees)
        return respond_to_fires, RespondRule(robots, target, float(self.near), critical)

    def reason(self, moment: Moment) -> Reason:
        """Return where the call came from."""
        x, y = moment.columns["heard_from" if self.to == "state" else "heard_goal"]
        where = f"{hypot(x, y):.0f} away at {math.degrees(atan2(y, x)):+.0f} degrees"
        return Reason(f"it heard of {'a robot at work' if self.to == 'state' else 'a goal'} {where}")


class RespondRule(NamedTuple):
    """What `respond_to_fires` takes: where each robot is called to, NaN without a call; a distance, an angle in rad."""

    robots: RobotColumns
    target: RealRows
    near: float
    critical_angle: float


@compiled(nogil=True)
def respond_to_fires(block, step, first, last):
    """Write the commands of robots that were called and that no earlier layer drives."""
    rule = unpack(block, RespondRule)
    robots, target = rule.robots, rule.target
    command, layer = robots.command, robots.layer
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or robots.hot[i] or robots.fire[i] >= 0:
            continue
        x, y = target[i, 0], target[i, 1]
        if hypot(x, y) > rule.near:
            layer[i] = robots.place
            bearing, speed = atan2(y, x), robots.max_speed[i]
            command[i, 0], command[i, 1] = approach(bearing, rule.critical_angle, speed, robots.radius[i])
    return 0
