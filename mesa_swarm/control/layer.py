"""What a rule may know, what a layer is, and where sensed things are.

A sensor reads a distance, not a direction: what it sees is taken to be in the middle of its sector. That
error is part of the model (PHYSICS 3).
"""

import math
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import draw_number
from mesa_swarm.kernels.elementary import angles_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import (
    CodeRows,
    FlagRows,
    Flags,
    IntegerRows,
    Integers,
    RealRows,
    Reals,
    RealTables,
)
from mesa_swarm.physics.threads import RowCrew
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, MOUNT_X, MOUNT_Y
from mesa_swarm.robots.devices import reserve_names
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT


@dataclass(frozen=True, slots=True, eq=False)
class Senses:
    """What robots know, and what they broadcast, as columns: never where they are, how they slip, or who they are.

    Parameters
    ----------
    distance, kind : ndarrays, shape (n, s)
        Of the proximity sensors.
    radiation : ndarray, shape (n, q)
    line : bool ndarray, shape (n, l)
    temperature, heat : ndarrays, shape (n,)
        The robot's own, and what it took from a fire in the last step.
    hot : bool ndarray, shape (n,)
    fire : int64 ndarray, shape (n,)
        Not below 0 while the robot is extinguishing.
    last_command : ndarray, shape (n, w)
        Of the step before; the robot does not know whether its wheels slipped.
    radius, max_speed, tendency : ndarrays, shape (n,)
    task : int64 ndarray, shape (n,), written by layers
        What the robot works at, as the layer numbers it; -1 before a layer decides.
    goal : ndarray, shape (n, 2), written by layers
        The position that it works at, in its own frame (x ahead, y left); NaN before a layer decides.
    heard_layer, heard_task : int64 ndarrays, shape (n,)
        Of the nearest robot heard that has a task, -1 for none; see `Radio`.
    heard_from, heard_goal : ndarrays, shape (n, 2)
        Where that robot is, and the nearest goal heard, both in the robot's own frame, NaN for none.
    design : int64 ndarray, shape (n,)
        Row of the robot's design in the tables that follow.
    forward : int64 ndarray, shape (d, 3)
        Index of the front, left and right proximity sensors, -1 for none.
    sensors : ndarray, shape (d, s, 9)
        Mounts, axes and ranges, see `DesignTable`.
    bearing, radiation_bearing : ndarrays, shapes (d, s), (d, q), rad
        Of the proximity and the radiation sensors.
    sideways : bool ndarray, shape (d,)
        Whether a command is speeds forward and sideways.
    own : dict
        Of each name of custom sensors, what they read (n, width), NaN for nothing.
    act : dict, written by layers
        Of each name of actuators, what they are set to, (n,) or (n, width).
    send : dict, written by layers
        Of each name of a message, what the robot sends, (n,) or (n, width), NaN for nothing; see `Radio`.
    heard : dict
        What robots hear: `n` (n,) messages, and `range`, `bearing` and each name (n, most, ...), NaN for none.
    """

    distance: np.ndarray
    kind: np.ndarray
    radiation: np.ndarray
    line: np.ndarray
    temperature: np.ndarray
    heat: np.ndarray
    hot: np.ndarray
    fire: np.ndarray
    last_command: np.ndarray
    radius: np.ndarray
    max_speed: np.ndarray
    tendency: np.ndarray
    task: np.ndarray
    goal: np.ndarray
    heard_layer: np.ndarray
    heard_task: np.ndarray
    heard_from: np.ndarray
    heard_goal: np.ndarray
    design: np.ndarray
    forward: np.ndarray
    sensors: np.ndarray
    bearing: np.ndarray
    radiation_bearing: np.ndarray
    sideways: np.ndarray
    own: dict[str, np.ndarray] = field(default_factory=dict)
    act: dict[str, np.ndarray] = field(default_factory=dict)
    send: dict[str, np.ndarray] = field(default_factory=dict)
    heard: dict[str, np.ndarray] = field(default_factory=dict)
    # Of no robot's knowledge: the threads that share its rows.
    _crew: RowCrew | None = None

    @classmethod
    def of(cls, swarm: Swarm, crew: RowCrew | None = None) -> "Senses":
        """Return what the robots of this swarm know, whose rows a crew shares."""
        table = swarm.table
        names = {sense.name for sense in fields(cls)}
        columns: dict[str, Any] = {name: column for name, column in swarm.columns.items() if name in names}
        of_designs: dict[str, Any] = {"forward": table.forward, "sensors": table.proximity, "bearing": table.bearing}
        bearing = angles_of(table.radiation[..., AXIS_Y], table.radiation[..., AXIS_X])
        of_designs["radiation_bearing"] = bearing
        more: dict[str, Any] = {"own": {name: swarm.columns[name] for name in table.readings}}
        for group in ("act", "send", "heard"):
            first = f"{group}."
            more[group] = {n.removeprefix(first): c for n, c in swarm.columns.items() if n.startswith(first)}
        return cls(**columns, **of_designs, sideways=table.sideways, **more, _crew=crew)


reserve_names(sense.name for sense in fields(Senses))


class Layer(Protocol):
    """One rule of a subsumption, for all robots at once.

    A rule about one robot is written more simply with `behaviour`. A custom layer is a class with
    these two. It may have a third, ``reason(moment) -> Reason``, why it drove a robot (`SwarmModel.explain`), and a
    fourth, ``unbind()``, which is called before another control takes the place of the one that it is in, and all
    columns are dropped.
    It may declare what it commands: ``commands_wheels`` is True for speeds of wheels left and right, False for speeds
    forward and sideways. It is then refused for robots with a drive of the other kind. ``numbers`` is how many numbers
    of a command it writes, 2 by default: it is refused for drives that take more or fewer. A layer for drives of all
    kinds declares None.

    A layer that derives from `CompiledLayer` has, instead of `decide`, a compiled function with its arguments; see
    `Explore`, which remembers something, and `Avoid`.
    """

    @property
    def name(self) -> str:
        """What pictures and explanations call it."""

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Take what the layer needs: columns to remember in (`swarm.remember`), a random stream."""

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Write `command` (n, w) and ``layer = index`` where the layer is active and `layer` is still -1.

        There it may also write what the robot is to broadcast: `senses.task` and `senses.goal`.
        """


class RobotColumns(NamedTuple):
    """What compiled layers know of robots, see `Senses`, and what they write; `place` is the layer's index."""

    distance: RealRows
    kind: CodeRows
    radiation: RealRows
    line: FlagRows
    temperature: Reals
    heat: Reals
    hot: Flags
    fire: Integers
    last_command: RealRows
    radius: Reals
    max_speed: Reals
    tendency: Reals
    task: Integers
    goal: RealRows
    heard_layer: Integers
    heard_task: Integers
    heard_from: RealRows
    heard_goal: RealRows
    design: Integers
    forward: IntegerRows
    sensors: RealTables
    bearing: RealRows
    radiation_bearing: RealRows
    command: RealRows
    layer: Integers
    place: int


SENSED = attrgetter(*RobotColumns._fields[: RobotColumns._fields.index("command")])


def columns_for(senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> RobotColumns:
    """Return the columns of senses, and what a layer writes."""
    columns: Any = *SENSED(senses), command, layer, index
    return RobotColumns(*columns)


def kernel_with(function: Any, arguments: NamedTuple, rows: bool = False) -> Kernel:
    """Return the kernel of a function and a block of these arguments; `rows` is whether threads may share its rows."""
    block = Block(arguments)
    return Kernel(function, block.numbers, block, rows=rows)


class CompiledLayer:
    """Base of layers that are one compiled function, which decides for all rows of robots.

    `arguments` returns the function, ``int64 f(block, step, first, last)``, and the named tuple of what its block
    holds, of which the first is `RobotColumns`.
    """

    commands_wheels: ClassVar[bool | None] = True

    def shares_rows(self, function: Any) -> bool:
        """Return whether threads can share a function: it decides only for the rows it is given, and draws nothing."""
        return False

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, NamedTuple]:
        """Return the compiled function, and what its block holds; of `senses` only what `robots` lacks, as messages."""
        raise NotImplementedError

    def lacks(self, senses: Senses) -> str:
        """Return what is missing in the model, and what to do, as the text of an error; "" for nothing."""
        return ""

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> Kernel | None:
        """Return what decides on these columns, None where something is missing for it."""
        if self.lacks(senses):
            return None
        function, arguments = self.arguments(columns_for(senses, command, layer, index), senses)
        return kernel_with(function, arguments, self.shares_rows(function))

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Write the commands of robots that no other layer drives, and the index of the layer, by the kernel.

        Raises
        ------
        InvalidValueError
            If something is missing in the model that the layer needs.
        """
        kernel = self.kernel_for(senses, command, layer, index)
        if kernel is None:
            raise InvalidValueError(self.lacks(senses))
        kernel.run(0, len(layer))


class Memoryless(CompiledLayer):
    """Base of layers that remember nothing and command the wheels left and right; others override `commands_wheels`."""

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember nothing."""


@compiled
def draw_numbers(stream, number):
    """Draw a number in (0, 1] for each robot, and store it for those that have none yet, which is 0."""
    for i in range(number.shape[0]):
        drawn = 1.0 - draw_number(stream)
        if number[i] == 0.0:
            number[i] = drawn


def centroids(senses: Senses) -> tuple[np.ndarray, np.ndarray]:
    """Return where each robot perceives the centroid of the robots that it sees, and by how many sensors.

    The centroid (n, 2) is in the robot's own frame, x ahead and y to the left, (0, 0) where no robot is seen: the mean
    of the reconstructed positions over the sensors that see a robot now (5.1, corrected: not over all sensors).
    """
    n = len(senses.distance)
    centroid, counts = np.empty((n, 2)), np.empty(n, np.int64)
    perceive_robots(senses.distance, senses.kind, senses.sensors, senses.design, centroid, counts)
    return centroid, counts


@compiled
def perceive_robots(distance, kind, sensors, design, centroid, counts):
    """Write the mean reconstructed position (n, 2) of what sees a robot, and the number of such sensors (n,)."""
    for i in range(distance.shape[0]):
        centroid[i, 0], centroid[i, 1], counts[i] = perceive_centroid(distance, kind, sensors, design, i)


@compiled
def perceive_centroid(distance, kind, sensors, design, i):
    """Return the mean reconstructed position of what robot i sees of robots, 0 for none, and by how many sensors."""
    d, count, x, y = design[i], 0, 0.0, 0.0
    for s in range(distance.shape[1]):
        if kind[i, s] == ROBOT:
            count += 1
            x += sensors[d, s, MOUNT_X] + distance[i, s] * sensors[d, s, AXIS_X]
            y += sensors[d, s, MOUNT_Y] + distance[i, s] * sensors[d, s, AXIS_Y]
    if not count:
        return 0.0, 0.0, 0
    return x / count, y / count, count


@compiled
def nearest_of(distance, kind, i, target):
    """Return the sensor of robot i with the nearest thing of a kind, or -1."""
    nearest = -1
    for s in range(distance.shape[1]):
        if kind[i, s] == target and (nearest < 0 or distance[i, s] < distance[i, nearest]):
            nearest = s
    return nearest


@compiled
def find_nearest_ahead(distance, kind, bearing, design, nearest):
    """Write which sensor with |bearing| < 90 degrees sees the nearest robot (n,), -1 if none does (5.2, corrected)."""
    for i in range(distance.shape[0]):
        nearest[i] = sensor_ahead(distance, kind, bearing, design, i)


@compiled
def sensor_ahead(distance, kind, bearing, design, i):
    """Return which sensor of robot i sees the nearest robot ahead, -1 if none does.

    Of equal distances the sensor that looks more nearly ahead counts, then the first.
    """
    d, best = design[i], -1
    for s in range(distance.shape[1]):
        if kind[i, s] != ROBOT or abs(bearing[d, s]) >= 0.5 * math.pi - 1e-9:
            continue
        if (
            best < 0
            or distance[i, s] < distance[i, best]
            or (distance[i, s] == distance[i, best] and abs(bearing[d, s]) < abs(bearing[d, best]))
        ):
            best = s
    return best
