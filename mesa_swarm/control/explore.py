"""Explore: go straight on, and optionally turn by chance now and then."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_count, check_name, check_number
from mesa_swarm.control.layer import CompiledLayer, RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_between, stream_of
from mesa_swarm.kernels.type_names import Integers, Reals
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm


@dataclass(kw_only=True)
class Explore(CompiledLayer):
    """Drive straight on; always active.

    Parameters
    ----------
    speed : float
        Share of the robot's max_speed, 0 to 1.
    turn_interval : int
        After this many steps of driving straight the robot turns on the spot; 0 for never.
    largest_turn_degrees : float
        Each such turn is drawn uniformly from plus or minus this angle, 0 to 180.

    Examples
    --------
    >>> Explore(turn_interval=200).largest_turn_degrees
    180.0
    """

    speed: float = 1.0
    turn_interval: int = 0
    largest_turn_degrees: float = 180.0
    name: str = "Explore"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Explore's speed", self.speed, minimum=0, maximum=1)
        check_count("turn_interval", self.turn_interval)
        check_number("largest_turn_degrees", self.largest_turn_degrees, minimum=0, maximum=180)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember how long each robot has driven straight, and how much of a turn is left."""
        self._swarm, self._prefix, self._rng = swarm, prefix, rng
        if self.turn_interval:
            swarm.remember(f"{prefix}.straight", (), np.int64, 0)
            swarm.remember(f"{prefix}.turn", (), np.float64, 0.0)

    def shares_rows(self, function: Any) -> bool:
        """Return whether threads can share the rows: where it draws no turns."""
        return function is go_straight

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, NamedTuple]:
        """Return what drives the robots that no other layer drives, and turns them now and then if it is to."""
        straight = StraightRule(robots, float(self.speed))
        if not self.turn_interval:
            return go_straight, straight
        columns, largest = self._swarm.columns, math.radians(self.largest_turn_degrees)
        memory = columns[f"{self._prefix}.straight"], columns[f"{self._prefix}.turn"]
        turns = np.empty(len(robots.layer))
        rule = TurningRule(straight, self.turn_interval, largest, *memory, turns, stream_of(self._rng))
        return turn_now_and_then, rule

    def reason(self, moment: Moment) -> Reason:
        """Return whether it turns by chance."""
        left, right = moment.command
        turns = self.turn_interval > 0 and left == -right != 0.0
        return Reason("a random turn is due" if turns else "nothing else wants to drive")


class StraightRule(NamedTuple):
    """What `go_straight` takes: `share` of their largest speed is how fast robots go."""

    robots: RobotColumns
    share: float


class TurningRule(NamedTuple):
    """What `turn_now_and_then` takes.

    Parameters
    ----------
    straight : StraightRule
    interval : int
        Steps from turn to turn.
    largest : float
        Turn, rad.
    steps : int64 ndarray, shape (n,)
        Steps that each robot has driven straight.
    turn, turns : ndarrays, shape (n,), rad
        What remains of a turn, and those that are drawn in a step.
    stream : Stream
        Of turns.
    """

    straight: StraightRule
    interval: int
    largest: float
    steps: Integers
    turn: Reals
    turns: Reals
    stream: Stream


@compiled(nogil=True)
def go_straight(block, step, first, last):
    """Drive straight on where no layer is active yet."""
    drive_straight(unpack(block, StraightRule), first, last)
    return 0


@compiled(nogil=True)
def turn_now_and_then(block, step, first, last):
    """Drive straight on where no layer is active yet, and turn by chance after an interval."""
    rule = unpack(block, TurningRule)
    robots, turns = rule.straight.robots, rule.turns
    for i in range(turns.shape[0]):
        turns[i] = draw_between(rule.stream, -rule.largest, rule.largest)
    count_down(rule.steps, rule.turn, turns, rule.interval, robots.layer)
    turn_on_the_spot(rule.turn, robots.radius, robots.max_speed, robots.command, robots.layer, robots.place)
    drive_straight(rule.straight, first, last)
    return 0


@compiled
def drive_straight(rule, first, last):
    """Command both wheels the same speed where no layer is active yet, in rows [first, last)."""
    robots = rule.robots
    command, layer = robots.command, robots.layer
    for i in range(first, last):
        if layer[i] < 0:
            command[i, 0] = rule.share * robots.max_speed[i]
            command[i, 1] = rule.share * robots.max_speed[i]
            layer[i] = robots.place


@compiled
def count_down(straight, turn, turns, interval, layer):
    """Begin a turn where a robot has driven straight for `interval` steps."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or turn[i] != 0.0:
            continue
        straight[i] += 1
        if straight[i] > interval:
            straight[i] = 0
            turn[i] = turns[i]


@compiled
def turn_on_the_spot(turn, radius, max_speed, command, layer, index):
    """Turn where a turn (rad) is left, at full speed and never beyond it; `turn` is what remains."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or turn[i] == 0.0 or max_speed[i] == 0.0:
            continue
        rim = min(abs(turn[i]) * radius[i], max_speed[i])
        side = 1.0 if turn[i] > 0.0 else -1.0
        command[i, 0] = -side * rim
        command[i, 1] = side * rim
        left = abs(turn[i]) - rim / radius[i]
        turn[i] = side * left if left > 1e-12 else 0.0
        layer[i] = index
