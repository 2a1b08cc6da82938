"""Avoid: turn away from what is near (thesis 5.2.2)."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_choice, check_count, check_name, check_number
from mesa_swarm.control.layer import CompiledLayer, RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_number, stream_of
from mesa_swarm.kernels.type_names import Integers
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import FIRE, LOAD

TURNS = ("translational", "stationary")
FIRES = ("always", "never", "when hot")
LOADS = ("always", "never")
FRONTS = ("tendency", "random", "back up")
SIDES = ("last", "ignore both")
LONGEST_MANOEUVRE = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Avoid(CompiledLayer):
    """Turn away when the front, left or right sensor sees something nearer than `distance`.

    Active when one of the three is activated. They are checked in the order front, left, right, and the
    last that is activated wins: left turns the robot right, right turns it left, front turns it to the side
    of its own tendency, which never changes.

    The other values of `front` and `sides` are those that the thesis rejects (5.2.2): for comparison.

    Parameters
    ----------
    distance : float
        A sensor is activated when 0 <= reading < distance, map units, at least 0.
    turn : str
        "translational" stops one wheel; "stationary" turns on the spot, which swings to and fro for ever in a
        corridor where both side sensors are activated.
    fires : str
        Whether burning fires are avoided: "always", "never" or "when hot".
    loads : str
        Whether loads are avoided: "always" or "never".
    front : str
        What the front sensor does: "tendency" turns to the robot's own side; "random" to a side drawn anew in every
        step, which turns it nowhere in the mean; "back up" drives back for `back_steps` and then turns to its own side
        for `turn_steps`, whatever its sensors see meanwhile.
    sides : str
        What left and right sensor do when both are activated: of "last" the right one wins; "ignore both" leaves the
        decision to the front sensor, so that a robot goes straight on in a narrow corridor.
    back_steps, turn_steps : int
        Of "back up", 0 to 1,000,000.

    Raises
    ------
    InvalidValueError
        If a number is out of its range, or `name` is not one line of text.
    UnknownNameError
        If `turn`, `fires`, `loads`, `front` or `sides` is not one of its names.

    Examples
    --------
    >>> Avoid(distance=20).turn
    'translational'
    """

    distance: float = 15.0
    turn: str = "translational"
    fires: str = "always"
    loads: str = "always"
    front: str = "tendency"
    sides: str = "last"
    back_steps: int = 10
    turn_steps: int = 10
    name: str = "Avoid"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Avoid's distance", self.distance, minimum=0, maximum=LARGEST_RANGE)
        check_choice("turn", self.turn, TURNS)
        check_choice("fires", self.fires, FIRES)
        check_choice("loads", self.loads, LOADS)
        check_choice("front", self.front, FRONTS)
        check_choice("sides", self.sides, SIDES)
        check_count("back_steps", self.back_steps, maximum=LONGEST_MANOEUVRE)
        check_count("turn_steps", self.turn_steps, maximum=LONGEST_MANOEUVRE)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Take the random stream of sides, and remember the steps that are left of backing up and turning."""
        if self.front == "random":
            object.__setattr__(self, "_rng", rng)
        if self.front == "back up":
            object.__setattr__(self, "_left", (swarm, f"{prefix}.left"))
            swarm.remember(f"{prefix}.left", (), np.int64, 0)

    def shares_rows(self, function: Any) -> bool:
        """Return whether threads can share the rows: where it draws no sides."""
        return function is avoid and self.front != "random"

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "AvoidRule"]:
        """Return what turns the robots that are near something."""
        inner = -1.0 if self.turn == "stationary" else 0.0
        near = float(self.distance), FIRES.index(self.fires), self.loads == "always", self.sides == "ignore both"
        stream, left = NO_STREAM, np.empty(0, np.int64)
        if self.front == "random":
            stream = stream_of(self._rng)  # type: ignore[attr-defined]
        if self.front == "back up":
            swarm, name = self._left  # type: ignore[attr-defined]
            left = swarm.columns[name]
        steps = self.back_steps + self.turn_steps, self.turn_steps
        return avoid, AvoidRule(robots, *near, inner, FRONTS.index(self.front), *steps, left, stream)

    def reason(self, moment: Moment) -> Reason:
        """Return which sensor decided: of those that were activated, the last of front, left, right."""
        near = self._find_activated(moment)
        if self.front == "back up" and (not near or moment.command[0] == moment.command[1]):
            return Reason("it met something ahead and, for a time, does not look")
        rounds_up = round(float(moment.distance[near[-1]]), 1) >= self.distance
        below = "just under" if rounds_up else "<"
        return Reason(f"{moment.reading(near[-1])} {below} {self.distance:g}", tuple(near))

    def _find_activated(self, moment: Moment) -> list[int]:
        """Return which of the front, left and right sensor are activated, and count."""
        fears_fire = self.fires == "always" or (self.fires == "when hot" and bool(moment.columns["hot"]))
        fears = fears_fire, self.loads == "always"
        near = [
            s
            for s in moment.forward
            if s >= 0 and is_activated(moment.distance[s], moment.kind[s], self.distance, *fears)
        ]
        both = self.sides == "ignore both" and {*moment.forward[1:]} <= {*near}
        return [s for s in near if s == moment.forward[0]] if both else near


class AvoidRule(NamedTuple):
    """What `avoid` takes.

    Parameters
    ----------
    near : float
    fires : int
        Whether they are avoided, a place in `FIRES`.
    loads, ignores_both : bool
    inner : float
        The inner wheel's share of speed in a turn.
    front : int
        What the front sensor does, a place in `FRONTS`.
    steps, turn_steps : int
        Of backing up and turning, and of turning alone.
    left : int64 ndarray, shape (n,)
        The steps that are left of these, of a layer that backs up.
    stream : Stream
        Of sides, of a layer that draws them.
    """

    robots: RobotColumns
    near: float
    fires: int
    loads: bool
    ignores_both: bool
    inner: float
    front: int
    steps: int
    turn_steps: int
    left: Integers
    stream: Stream


NO_STREAM = Stream(0, 0)
RANDOM, BACK_UP = FRONTS.index("random"), FRONTS.index("back up")


@compiled(nogil=True)
def avoid(block, step, first, last):
    """Write the turns of robots in rows [first, last) that no earlier layer drives."""
    rule = unpack(block, AvoidRule)
    robots, near = rule.robots, rule.near
    distance, kind, command, layer = robots.distance, robots.kind, robots.command, robots.layer
    if rule.front == BACK_UP:
        back_up(rule, first, last)
    for i in range(first, last):
        tendency = robots.tendency[i]
        if rule.front == RANDOM:  # drawn for all robots, also those that other layers drive
            tendency = 1.0 if draw_number(rule.stream) < 0.5 else -1.0
        if layer[i] >= 0:
            continue
        front, left, right = find_forward(robots.forward, robots.design[i])
        fears_fire = rule.fires == 0 or (rule.fires == 2 and robots.hot[i])
        turn = ahead = 0.0
        if front >= 0 and is_activated(distance[i, front], kind[i, front], near, fears_fire, rule.loads):
            turn = ahead = tendency
        if left >= 0 and is_activated(distance[i, left], kind[i, left], near, fears_fire, rule.loads):
            turn = -1.0
        if right >= 0 and is_activated(distance[i, right], kind[i, right], near, fears_fire, rule.loads):
            both = (
                rule.ignores_both
                and left >= 0
                and is_activated(distance[i, left], kind[i, left], near, fears_fire, rule.loads)
            )
            turn = ahead if both else 1.0
        if turn != 0.0:
            write_turn(command, i, turn, robots.max_speed[i], rule.inner)
            layer[i] = robots.place
    return 0


@compiled
def find_forward(forward, design):
    """Return the front, left and right sensor of a design, -1 for none."""
    return forward[design, 0], forward[design, 1], forward[design, 2]


@compiled
def back_up(rule, first, last):
    """Write the commands of robots in rows [first, last) that back up and turn."""
    robots, left = rule.robots, rule.left
    distance, kind, command, layer = robots.distance, robots.kind, robots.command, robots.layer
    for i in range(first, last):
        front = robots.forward[robots.design[i], 0]
        if layer[i] >= 0:
            continue
        fears_fire = rule.fires == 0 or (rule.fires == 2 and robots.hot[i])
        if front >= 0 and is_activated(distance[i, front], kind[i, front], rule.near, fears_fire, rule.loads):
            left[i] = rule.steps if left[i] == 0 else left[i]
        if left[i] == 0:
            continue
        speed = robots.max_speed[i]
        if left[i] > rule.turn_steps:
            command[i, 0], command[i, 1] = -speed, -speed
        else:
            write_turn(command, i, robots.tendency[i], speed, rule.inner)
        left[i] -= 1
        layer[i] = robots.place


@compiled
def write_turn(command, i, side, speed, inner):
    """Write the wheel speeds of a turn to the left (side above 0) or right."""
    command[i, 0] = speed * (inner if side > 0.0 else 1.0)
    command[i, 1] = speed * (1.0 if side > 0.0 else inner)


@compiled
def is_activated(distance, kind, near, fears_fire, fears_load):
    """Return whether a sensor sees something too near."""
    return 0.0 <= distance < near and (fears_fire or kind != FIRE) and (fears_load or kind != LOAD)
