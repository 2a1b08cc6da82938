"""Boids: Reynolds's three rules (1987), from what infrared sensors see, for drives that can go sideways.

The layers command a velocity in the robot's own frame, forward and sideways to the left (`HolonomicDrive`), and
are meant to be added up by `VectorSum`. Where Reynolds's birds know how their neighbours fly, these robots tell it
from how the neighbours' perceived centroid moves.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mesa_swarm.control.apparent import FEWEST, Apparent
from mesa_swarm.control.layer import Senses
from mesa_swarm.control.perception import centroids
from mesa_swarm.errors import check_choice, check_name, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.robots.table import AXIS_X, AXIS_Y
from mesa_swarm.world.statics import ROBOT

WHAT = ("robots", "others", "everything")


@dataclass(frozen=True, kw_only=True)
class Separate:
    """Move away from what is near: the nearer, the faster.

    Active when a sensor sees something nearer than `distance`. Each such sensor adds a vector away from what it
    sees, of length 1 - reading / distance; the sum, at most 1 long, times max_speed is the velocity.

    Parameters
    ----------
    distance : float
        Map units, above 0.
    what : str
        "robots", "others" (obstacles, fires, loads) or "everything".

    Examples
    --------
    >>> Separate(distance=10, what="robots").name
    'Separate'
    """

    distance: float = 15.0
    what: str = "everything"
    name: str = "Separate"
    commands_wheels: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_name("name", self.name)
        check_number("Separate's distance", self.distance, above=0, maximum=LARGEST_RANGE)
        check_choice("what", self.what, WHAT)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Write velocities away from what is near."""
        what = WHAT.index(self.what)
        separate_from(
            senses.distance, senses.kind, senses.sensors, senses.design, senses.max_speed, float(self.distance), what,
            command, layer, index,
        )  # fmt: skip

    def reason(self, moment: Moment) -> Reason:
        """Say what is near."""
        near = [int(s) for s in np.flatnonzero(moment.kind >= 0) if moment.distance[s] < self.distance]
        seeing = [s for s in near if WHAT[int(moment.kind[s] != ROBOT)] == self.what or self.what == "everything"]
        return Reason("near: " + ", ".join(map(moment.reading, seeing)), tuple(seeing))


@compiled
def separate_from(distance, kind, sensors, design, max_speed, near, what, command, layer, index):
    """Write velocities away from what is nearer than `near`, of robots that are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        d, x, y, count = design[i], 0.0, 0.0, 0
        for s in range(distance.shape[1]):
            meant = what == 2 or (kind[i, s] == ROBOT) == (what == 0)
            if kind[i, s] >= 0 and meant and distance[i, s] < near:
                weight = 1.0 - distance[i, s] / near
                x -= weight * sensors[d, s, AXIS_X]
                y -= weight * sensors[d, s, AXIS_Y]
                count += 1
        if count:
            share = max_speed[i] / max(1.0, math.hypot(x, y))
            command[i, 0], command[i, 1] = share * x, share * y
            layer[i] = index


@dataclass(kw_only=True)
class Align:
    """Move as the neighbours move.

    Active when robots have been seen for a few steps; see `Apparent` in `control.apparent`.

    Parameters
    ----------
    memory : float
        Steps over which the neighbours' velocity is averaged, at least 1.
    jump : float
        The centroid of the same neighbours moves at most this far in a step, map units, above 0.

    Examples
    --------
    >>> Align(memory=5).name
    'Align'
    """

    memory: float = 10.0
    jump: float = 15.0
    name: str = "Align"
    commands_wheels: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_name("name", self.name)
        check_number("Align's memory", self.memory, minimum=1, maximum=1e6)
        check_number("Align's jump", self.jump, above=0)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember where the centroid was, and how it moves."""
        self._apparent = Apparent(swarm, prefix, float(self.memory), float(self.jump), False)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Write the neighbours' velocities."""
        velocity, compared = self._apparent.update(senses)
        align(velocity, compared, FEWEST, senses.max_speed, command, layer, index)

    def reason(self, moment: Moment) -> Reason:
        """Say whom it matches."""
        seeing = moment.seeing(ROBOT)
        return Reason(f"it moves as the robots that {len(seeing)} of its sensors see", tuple(seeing))


@compiled
def align(velocity, compared, fewest, max_speed, command, layer, index):
    """Write the neighbours' velocities, at most max_speed, of robots that are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or compared[i] < fewest:
            continue
        length = math.hypot(velocity[i, 0], velocity[i, 1])
        share = min(1.0, max_speed[i] / length) if length > 0.0 else 0.0
        command[i, 0], command[i, 1] = share * velocity[i, 0], share * velocity[i, 1]
        layer[i] = index


@dataclass(frozen=True, kw_only=True)
class Cohere:
    """Move towards the perceived centroid of the neighbours, slower as it gets near.

    Active when a robot is seen.

    Parameters
    ----------
    distance : float
        Centroids nearer than this, map units, above 0, are approached more slowly: by their share of it.

    Examples
    --------
    >>> Cohere().distance
    40.0
    """

    distance: float = 40.0
    name: str = "Cohere"
    commands_wheels: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_name("name", self.name)
        check_number("Cohere's distance", self.distance, above=0, maximum=LARGEST_RANGE)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Write velocities towards the centroid."""
        centroid, seen = centroids(senses)
        cohere(centroid, seen, senses.max_speed, float(self.distance), command, layer, index)

    def reason(self, moment: Moment) -> Reason:
        """Say how far the centroid is."""
        seeing = moment.seeing(ROBOT)
        away = math.hypot(*moment.position_of(seeing))
        return Reason(f"the centroid of the robots it sees is {away:.1f} away", tuple(seeing))


@compiled
def cohere(centroid, seen, max_speed, near, command, layer, index):
    """Write velocities towards the centroid, of robots that are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or seen[i] == 0:
            continue
        share = max_speed[i] / max(near, math.hypot(centroid[i, 0], centroid[i, 1]))
        command[i, 0], command[i, 1] = share * centroid[i, 0], share * centroid[i, 1]
        layer[i] = index


@dataclass(frozen=True, kw_only=True)
class Cruise:
    """Go on in the direction in which the robot was last told to go; at first, ahead. Always active.

    Parameters
    ----------
    speed : float
        Share of max_speed, 0 to 1.

    Examples
    --------
    >>> Cruise(speed=0.5).name
    'Cruise'
    """

    speed: float = 0.7
    name: str = "Cruise"
    commands_wheels: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the parameter."""
        check_name("name", self.name)
        check_number("Cruise's speed", self.speed, minimum=0, maximum=1)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember nothing: the last command is enough."""

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Write velocities along the last command."""
        cruise(senses.last_command, senses.max_speed, float(self.speed), command, layer, index)

    def reason(self, moment: Moment) -> Reason:
        """Say that nothing is needed for it."""
        return Reason("it goes on as before")


@compiled
def cruise(last_command, max_speed, share, command, layer, index):
    """Write velocities along the last command, of robots that are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        x, y = last_command[i, 0], last_command[i, 1]
        length = math.hypot(x, y)
        if length > 0.0:
            x, y = x / length, y / length
        else:
            x, y = 1.0, 0.0
        command[i, 0], command[i, 1] = share * max_speed[i] * x, share * max_speed[i] * y
        layer[i] = index
