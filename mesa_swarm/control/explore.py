"""Explore: go straight on, and optionally turn by chance now and then."""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_count, check_name, check_number
from mesa_swarm.control.layer import Senses, kernel_with
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm


@dataclass(kw_only=True)
class Explore:
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
    commands_wheels: ClassVar[bool] = True

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

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that no other layer drives."""
        if self.turn_interval:
            columns, largest = self._swarm.columns, math.radians(self.largest_turn_degrees)
            straight, turn = columns[f"{self._prefix}.straight"], columns[f"{self._prefix}.turn"]
            turns = self._rng.uniform(-largest, largest, len(layer))
            count_down(straight, turn, turns, self.turn_interval, layer)
            turn_on_the_spot(turn, senses.radius, senses.max_speed, command, layer, index)
        go_straight(senses.max_speed, float(self.speed), command, layer, index)

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> Kernel | None:
        """Return what `decide` does where robots never turn by chance."""
        if self.turn_interval:
            return None
        return kernel_with(go_straight_all, StraightArrays(senses.max_speed, float(self.speed), command, layer, index))

    def reason(self, moment: Moment) -> Reason:
        """Return whether it turns by chance."""
        left, right = moment.command
        turns = self.turn_interval > 0 and left == -right != 0.0
        return Reason("a random turn is due" if turns else "nothing else wants to drive")


class StraightArrays(NamedTuple):
    """The arguments of `go_straight`, in its order."""

    max_speed: Reals
    share: float
    command: RealRows
    layer: Integers
    place: int


@compiled(nogil=True)
def go_straight_all(block, step, first, last):
    """Do what `go_straight` does, for all rows."""
    go_straight(*unpack(block, StraightArrays))
    return 0


@compiled
def go_straight(max_speed, share, command, layer, index):
    """Drive straight on where no layer is active yet."""
    for i in range(layer.shape[0]):
        if layer[i] < 0:
            command[i, 0] = share * max_speed[i]
            command[i, 1] = share * max_speed[i]
            layer[i] = index


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
