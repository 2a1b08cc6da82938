"""Avoid: turn away from what is near (thesis 5.2.2)."""

from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_choice, check_count, check_name, check_number
from mesa_swarm.control.layer import Memoryless, Senses, kernel_with
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import CodeRows, Flags, IntegerRows, Integers, RealRows, Reals
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
SENSED = attrgetter("distance", "kind", "hot", "max_speed", "design", "forward")
# How many of the first arguments `avoid` and `back_up` have both.
SHARED = 10


@dataclass(frozen=True, kw_only=True)
class Avoid(Memoryless):
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

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Turn the robots that are near something."""
        arguments = self._arguments(senses, command, layer, index)
        if self.front == "random":
            sides = np.where(self._rng.random(len(layer)) < 0.5, 1.0, -1.0)  # type: ignore[attr-defined]
            arguments = arguments._replace(tendency=sides)
        if self.front == "back up":
            swarm, name = self._left  # type: ignore[attr-defined]
            manoeuvre = self.back_steps + self.turn_steps, self.turn_steps, arguments.inner
            back_up(*arguments[:SHARED], manoeuvre, swarm.columns[name], command, layer, index)
        avoid(*arguments)

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> Kernel | None:
        """Return what `decide` does, where that is without random numbers and memory."""
        if self.front != "tendency":
            return None
        return kernel_with(avoid_all, self._arguments(senses, command, layer, index))

    def _arguments(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> "AvoidArrays":
        inner = -1.0 if self.turn == "stationary" else 0.0  # the inner wheel's share of speed in a turn
        near = float(self.distance), FIRES.index(self.fires), self.loads == "always"
        turn = self.sides == "ignore both", inner
        return AvoidArrays(*(*SENSED(senses), senses.tendency, *near, *turn, command, layer, index))

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


class AvoidArrays(NamedTuple):
    """The arguments of `avoid`, in its order."""

    distance: RealRows
    kind: CodeRows
    hot: Flags
    max_speed: Reals
    design: Integers
    forward: IntegerRows
    tendency: Reals
    near: float
    fires: int
    loads: bool
    ignores_both: bool
    inner: float
    command: RealRows
    layer: Integers
    place: int


@compiled(nogil=True)
def avoid_all(block, step, first, last):
    """Do what `avoid` does, for all rows."""
    avoid(*unpack(block, AvoidArrays))
    return 0


@compiled
def avoid(
    distance, kind, hot, max_speed, design, forward, tendency, near, fires, loads, ignores_both, inner,
    command, layer, index,
):  # fmt: skip
    """Write the turns of robots that no earlier layer drives; `inner` is the inner wheel's share of speed."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        d = design[i]
        front, left, right = forward[d, 0], forward[d, 1], forward[d, 2]
        fears_fire = fires == 0 or (fires == 2 and hot[i])
        turn = ahead = 0.0
        if front >= 0 and is_activated(distance[i, front], kind[i, front], near, fears_fire, loads):
            turn = ahead = tendency[i]
        if left >= 0 and is_activated(distance[i, left], kind[i, left], near, fears_fire, loads):
            turn = -1.0
        if right >= 0 and is_activated(distance[i, right], kind[i, right], near, fears_fire, loads):
            both = (
                ignores_both and left >= 0 and is_activated(distance[i, left], kind[i, left], near, fears_fire, loads)
            )
            turn = ahead if both else 1.0
        if turn != 0.0:
            write_turn(command, i, turn, max_speed[i], inner)
            layer[i] = index


@compiled
def back_up(
    distance, kind, hot, max_speed, design, forward, tendency, near, fires, loads, manoeuvre, left,
    command, layer, index,
):  # fmt: skip
    """Write the commands of robots that back up and turn; `manoeuvre` is its steps, those of the turn, and `inner`."""
    steps, turn_steps, inner = manoeuvre
    for i in range(layer.shape[0]):
        front = forward[design[i], 0]
        if layer[i] >= 0:
            continue
        fears_fire = fires == 0 or (fires == 2 and hot[i])
        if left[i] == 0 and front >= 0 and is_activated(distance[i, front], kind[i, front], near, fears_fire, loads):
            left[i] = steps
        if left[i] == 0:
            continue
        if left[i] > turn_steps:
            command[i, 0], command[i, 1] = -max_speed[i], -max_speed[i]
        else:
            write_turn(command, i, tendency[i], max_speed[i], inner)
        left[i] -= 1
        layer[i] = index


@compiled
def write_turn(command, i, side, speed, inner):
    """Write the wheel speeds of a turn to the left (side above 0) or right."""
    command[i, 0] = speed * (inner if side > 0.0 else 1.0)
    command[i, 1] = speed * (1.0 if side > 0.0 else inner)


@compiled
def is_activated(distance, kind, near, fears_fire, fears_load):
    """Return whether a sensor sees something too near."""
    return 0.0 <= distance < near and (fears_fire or kind != FIRE) and (fears_load or kind != LOAD)
