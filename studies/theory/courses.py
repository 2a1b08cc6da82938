"""Robots that drive on courses which a theory of physics prescribes, and worlds for such theories."""

import math
from typing import Any

import numpy as np

from mesa_swarm import HolonomicDrive, Map, RobotDesign, SwarmModel
from mesa_swarm.control import Subsumption


class Course:
    """Drive each robot at its full speed along its own azimuth on the map; a subclass changes azimuths in `turn`.

    A layer for robots with a `HolonomicDrive`: their bodies never turn, so that nothing but the course counts. Azimuths
    begin uniform in [-pi, pi).
    """

    name = "Course"

    def bind(self, swarm: Any, prefix: str, rng: np.random.Generator) -> None:
        """Draw the first azimuths."""
        self._swarm, self._rng = swarm, rng
        swarm.remember(f"{prefix}.azimuth", (), np.float64, 0.0)
        self._column = f"{prefix}.azimuth"
        self.azimuth[:] = rng.uniform(-math.pi, math.pi, len(swarm))

    @property
    def azimuth(self) -> np.ndarray:
        """Where each robot drives, rad, shape (n,)."""
        return self._swarm.columns[self._column]

    def turn(self, azimuth: np.ndarray) -> None:
        """Change the azimuths, shape (n,), before robots drive; here they stay as they are."""

    def decide(self, senses: Any, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive all robots."""
        self.turn(self.azimuth)
        ahead = self.azimuth - self._swarm.heading
        command[:, 0] = senses.max_speed * np.cos(ahead)
        command[:, 1] = senses.max_speed * np.sin(ahead)
        layer[:] = index


def disc_robot(*, radius: float, speed: float) -> RobotDesign:
    """Return a robot without sensors that moves in any direction."""
    return RobotDesign(name="disc", radius=radius, sensors=(), drive=HolonomicDrive(), max_speed=speed)


def torus(
    layer: Course, places: np.ndarray, *, side: float, speed: float, steps: int, rng: int, radius: float = 2.0
) -> SwarmModel:
    """Return robots on a torus of this side: each starts at its place on a plane of its own, and no two ever meet.

    A world of the package has walls. So each robot gets a part of one large world, which it cannot leave in `steps`
    steps; the starts are whole multiples of `side` apart from `places` (n, 2), so that ``position % side`` is the
    position on the torus.
    """
    corners, width = apart(len(places), reach=side + speed * steps + 2.0 * radius, unit=side)
    model = SwarmModel(map=Map(name="planes", bounds=(0.0, 0.0, width, width)), rng=rng)
    poses = [(*place, 0.0) for place in (corners + places).tolist()]
    model.add_robots(disc_robot(radius=radius, speed=speed), poses=poses)
    model.control = Subsumption(layer)
    return model


def apart(n: int, *, reach: float, unit: float = 1.0) -> tuple[np.ndarray, float]:
    """Return n places on a square lattice, each farther than `reach` from all edges, and the width of the square.

    Any two are more than twice `reach` apart, and all coordinates are whole multiples of `unit`.

    Examples
    --------
    >>> places, width = apart(3, reach=9.0, unit=10.0)
    >>> places.tolist(), width
    ([[10.0, 10.0], [30.0, 10.0], [10.0, 30.0]], 40.0)
    """
    columns = math.ceil(math.sqrt(n))
    half = unit * (math.floor(reach / unit) + 1)
    row, column = np.divmod(np.arange(n), columns)
    return half * (2.0 * np.column_stack((column, row)) + 1.0), 2.0 * half * columns
