"""Fitness of a run: fast, straight and far from things; or fast, everywhere and without collisions."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_number, shortened
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import FlagRows, Flags, Integers, RealRows, Reals
from mesa_swarm.learning.reflex_policy import nearness

FITNESSES = ("floreano", "careful")
# Squares in which robots have been are counted: 40 x 40 map units, four robots of the thesis side by side.
SQUARE = 40.0
# Sums for each robot, and the columns of which they are made.
SUMS = ("floreano", "ahead", "collisions")
ONLY = 0
TALLIED = ("distance", "design", "command", "max_speed", "collided", "position")


@dataclass(frozen=True, kw_only=True, slots=True)
class Fitness:
    """The fitness of several robots in one run; more is better.

    "floreano" is the mean over robots and steps of

        ``V (1 - sqrt(dv)) (1 - i)``

    with V the mean of the wheels' absolute speeds, dv half of the difference between their signed speeds, both as
    shares of max_speed, and i the greatest nearness that any sensor reads, 0 to 1 [1]_. "careful" is

        ``speed_worth v - collision_cost c + coverage_worth a``

    with v the mean speed ahead as a share of max_speed, c the collisions a robot and step, and a the share of the
    map's squares in which any robot has been.

    Parameters
    ----------
    kind : str
        "floreano" or "careful".
    collision_cost, coverage_worth, speed_worth : float
        At least 0; of "careful" only. Where coverage outweighs speed by far, robots may evolve to drive backwards.
    square : float
        Side of the squares, map units, 1 to 1,000. With small ones it pays to drive near walls.

    Raises
    ------
    InvalidValueError, UnknownNameError

    References
    ----------
    .. [1] Floreano and Mondada, Automatic creation of an autonomous agent, From Animals to Animats 3 (1994).

    Examples
    --------
    >>> Fitness(kind="careful", collision_cost=100, coverage_worth=0).of(ahead=0.75, collisions=0.0025)
    0.5
    """

    kind: str = "careful"
    collision_cost: float = 800.0
    coverage_worth: float = 15.0
    speed_worth: float = 1.0
    square: float = SQUARE

    def __post_init__(self) -> None:
        check_choice("fitness", self.kind, FITNESSES)
        check_number("collision_cost", self.collision_cost, minimum=0, maximum=1e6)
        check_number("coverage_worth", self.coverage_worth, minimum=0, maximum=1e6)
        check_number("speed_worth", self.speed_worth, minimum=0, maximum=1e6)
        check_number("square", self.square, minimum=1, maximum=1000)

    def of(self, *, floreano: float = 0.0, ahead: float = 0.0, collisions: float = 0.0, covered: float = 0.0) -> float:
        """Return the fitness of a run from its means over robots and steps, and the share of squares visited."""
        if self.kind == "floreano":
            return floreano
        return self.speed_worth * ahead - self.collision_cost * collisions + self.coverage_worth * covered


def floreano(left: float, right: float, nearest: float) -> float:
    """Return ``V (1 - sqrt(dv)) (1 - i)`` of one robot in one step.

    Parameters
    ----------
    left, right : float
        Wheel commands as shares of max_speed, -1 to 1.
    nearest : float
        i, the greatest nearness: 0 nothing in range, 1 touching.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> floreano(1.0, 1.0, 0.0), floreano(1.0, 0.0, 0.0).__round__(3), floreano(-1.0, 1.0, 0.0)
    (1.0, 0.146, 0.0)
    """
    for name, wheel in (("left", left), ("right", right)):
        check_number(name, wheel, minimum=-1, maximum=1)
    return fast_straight_far(float(left), float(right), check_number("nearest", nearest, minimum=0, maximum=1))


class Tally:
    """Sums over the steps of a run: for each robot, and of squares in which any robot has been.

    `ranges` (d, s) are those of each design's sensors, see `actions.ranges_of`; `square` is the side of the squares,
    map units. `sums` (n, 3) are of Floreano's and Mondada's products, of speeds ahead, of collisions.
    """

    def __init__(
        self, robots: int, bounds: tuple[float, float, float, float], ranges: np.ndarray, square: float = SQUARE
    ) -> None:
        x_min, y_min, x_max, y_max = bounds
        self.sums = np.zeros((robots, len(SUMS)))
        self.visited = np.zeros((math.ceil((y_max - y_min) / square), math.ceil((x_max - x_min) / square)), np.bool_)
        self._steps = np.zeros(1, np.int64)
        self._left, self._below, self._ranges, self._square = float(x_min), float(y_min), ranges, float(square)

    @property
    def steps(self) -> int:
        """How many steps were added."""
        return int(self._steps[ONLY])

    def add(self, columns: dict[str, np.ndarray]) -> None:
        """Add the last step from the swarm's columns."""
        self.kernel_for(columns).run(0, len(self.sums))

    def kernel_for(self, columns: dict[str, np.ndarray]) -> Kernel:
        """Return what adds a step from these columns."""
        block = Block(
            FitnessArrays(
                **{name: columns[name] for name in TALLIED},
                ranges=self._ranges,
                left=self._left,
                below=self._below,
                square=self._square,
                visited=self.visited,
                sums=self.sums,
                steps=self._steps,
            )
        )
        return Kernel(add_step, block.numbers, block)

    def means(self) -> dict[str, float]:
        """Return the means over robots and steps, and the share of squares visited, as `Fitness.of` takes them."""
        if not self.steps or not len(self.sums):
            raise InvalidValueError(f"{shortened(self.steps)} steps of {len(self.sums)} robots; expected some of both")
        means = self.sums.mean(axis=0) / self.steps
        return {**dict(zip(SUMS, means.tolist(), strict=True)), "covered": float(self.visited.mean())}


class FitnessArrays(NamedTuple):
    """What `add_step` takes: columns of the swarm, the arguments of `Tally`, and what it counts."""

    distance: RealRows
    design: Integers
    command: RealRows
    max_speed: Reals
    collided: Flags
    position: RealRows
    ranges: RealRows
    left: float
    below: float
    square: float
    visited: FlagRows
    sums: RealRows
    steps: Integers


@compiled(nogil=True)
def add_step(block, step, first, last):
    """Add a step to every robot's sums, and mark its square as visited."""
    t = unpack(block, FitnessArrays)
    distance, design, command, max_speed, collided, position = (
        t.distance, t.design, t.command, t.max_speed, t.collided, t.position
    )  # fmt: skip
    ranges, left_border, below, square, visited, sums = t.ranges, t.left, t.below, t.square, t.visited, t.sums
    t.steps[ONLY] += 1
    for i in range(command.shape[0]):
        speed = max_speed[i] if max_speed[i] > 0.0 else 1.0
        left, right = command[i, 0] / speed, command[i, 1] / speed
        nearest = 0.0
        for s in range(distance.shape[1]):
            nearest = max(nearest, nearness(distance[i, s], ranges[design[i], s]))
        sums[i, 0] += fast_straight_far(left, right, nearest)
        sums[i, 1] += 0.5 * (left + right)
        sums[i, 2] += 1.0 if collided[i] else 0.0
        row = min(max(int((position[i, 1] - below) / square), 0), visited.shape[0] - 1)
        column = min(max(int((position[i, 0] - left_border) / square), 0), visited.shape[1] - 1)
        visited[row, column] = True
    return 0


@compiled
def fast_straight_far(left, right, nearest):
    """Return V (1 - sqrt(dv)) (1 - i)."""
    speed, difference = 0.5 * (abs(left) + abs(right)), 0.5 * abs(left - right)
    return speed * (1.0 - math.sqrt(difference)) * (1.0 - nearest)
