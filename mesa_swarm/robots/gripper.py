"""Gripper: an actuator that picks up bodies, and the sensor of what a robot carries."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.elementary import vector_lengths
from mesa_swarm.robots.actuators import ACT, Actuator
from mesa_swarm.robots.devices import check_kind, check_spelling
from mesa_swarm.robots.sensors import Sensor
from mesa_swarm.world.statics import CARRIED, DRIVEN

LARGEST_REACH = 1e6
CLOSED = 0.5


@dataclass(frozen=True, kw_only=True, slots=True)
class Gripper(Actuator):
    """Grips the nearest body ahead, carries it, and puts it down in front of the robot.

    While a rule sets ``me.act.grip`` above 0.5, an empty gripper grips, of the driven bodies of its kinds whose nearest
    point is at most `reach` from the rim of the robot and within `field_of_view_degrees` ahead, the nearest. Where two
    robots reach for the same body, the one that is nearer gets it. At 0.5 and below, the body is put down as
    `SwarmModel.release` does; where there is no room it is carried on. What is set holds until it is set again.

    A carried body is where its robot is; nothing sees it or bumps into it.

    Parameters
    ----------
    reach : float
        Map units, above 0.
    kinds : tuple of str
        The names of the kinds of bodies that it can grip, which the model has to know: `SwarmModel.add_kind`.
    field_of_view_degrees : float
        Above 0, at most 360.

    Raises
    ------
    InvalidValueError
        If a number is out of range, or kinds is not a tuple of names.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, RobotDesign, SwarmModel, disc
    >>> from mesa_swarm.control import Subsumption, behaviour
    >>> @behaviour
    ... def grip(me):
    ...     me.act.grip = 1.0
    ...     return 0.0, 0.0
    >>> model = SwarmModel(rng=1)
    >>> puck = model.add_body(disc((109, 100), 2), kind="puck")
    >>> design = RobotDesign(sensors=(Carried(),), actuators=(Gripper(kinds=("puck",)),))
    >>> (robot,) = model.add_robots(design, poses=[(100, 100, 0.0)])
    >>> model.control = Subsumption(grip)
    >>> model.step()
    >>> puck.carrier is robot, model.kind_code("puck")
    (True, 4)
    >>> model.sense()
    >>> robot.carried
    array([4.])
    """

    reach: float = 3.0
    kinds: tuple[str, ...] = ("puck",)
    field_of_view_degrees: float = 90.0
    name: str = "grip"
    holds: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("reach", self.reach, above=0, maximum=LARGEST_REACH)
        check_number("field_of_view_degrees", self.field_of_view_degrees, above=0, maximum=360)
        if isinstance(self.kinds, str) or not all(isinstance(kind, str) for kind in self.kinds) or not self.kinds:
            raise InvalidValueError(f"kinds is {shortened(self.kinds)}; expected names such as ('puck',)")
        object.__setattr__(self, "kinds", tuple(self.kinds))

    def check_model(self, model: Any) -> None:
        """Refuse misspelt kinds of bodies."""
        for kind in self.kinds:
            check_spelling(model, kind)

    def check_bodies(self, model: Any) -> None:
        """Refuse kinds of bodies that the model does not know, see `check_kind`."""
        for kind in self.kinds:
            check_kind(model, self, kind)

    def apply(self, model: Any, rows: np.ndarray) -> None:
        """Grip and put down what the robots in these rows have set."""
        if not len(model.movers):
            return
        table, closed = model.parts.bodies.table, model.swarm.columns[f"{ACT}{self.name}"][rows] > CLOSED
        carriers = {table.agents[row].carrier for row in table.rows(CARRIED).tolist()}
        robots = [model.swarm.agents[row] for row in rows]
        for robot, grips in zip(robots, closed, strict=True):
            if robot in carriers and not grips:
                model.release(robot)
        empty = [robot for robot, grips in zip(robots, closed, strict=True) if grips and robot not in carriers]
        within_grip = list(self._near(model, empty)) if empty else []
        taken_rows, busy = set[int](), set[int]()
        for _, k, body_row in sorted(within_grip):
            if body_row not in taken_rows and k not in busy:
                taken_rows.add(body_row)
                busy.add(k)
                model.attach(empty[k], table.agents[body_row])

    def _near(self, model: Any, robots: list) -> Iterator[tuple[float, int, int]]:
        """Yield the distance of each body that a robot can grip, the robot's place in the list, and the body's row."""
        table, positions = model.parts.bodies.table, np.array([robot.position for robot in robots])
        radii, free = np.array([float(robot.radius) for robot in robots]), table.rows(DRIVEN)
        apart = vector_lengths(*(table.position[free] - positions[:, None]).transpose(2, 0, 1))
        pairs = np.argwhere(apart <= radii[:, None] + self.reach + table.reach[free])
        for k, row in ((k, int(free[place])) for k, place in pairs.tolist()):
            body = table.agents[row]
            if body.kind not in self.kinds or body.agent is not None:
                continue
            distance, azimuth = body.seen_from(positions[k])
            gap, bearing = distance - radii[k], wrap_angle(azimuth - float(robots[k].heading))
            if gap <= self.reach and abs(bearing) <= np.radians(self.field_of_view_degrees) / 2:
                yield float(gap), k, row


@dataclass(frozen=True, kw_only=True, slots=True)
class Carried(Sensor):
    """Reads the code of the kind of what the robot carries, see `SwarmModel.kinds`, and -1 for nothing."""

    name: str = "carried"
    spoiled: ClassVar[bool] = False

    def arguments(self, model: Any) -> dict[str, np.ndarray]:
        """Return the code of what each robot of the swarm carries."""
        codes = np.full(len(model.swarm), -1.0)
        table = model.parts.bodies.table
        for row in table.rows(CARRIED).tolist():
            codes[table.agents[row].carrier.row] = table.kind[row]
        return {"codes": codes}

    @staticmethod
    def read(rows: np.ndarray, codes: np.ndarray, out: np.ndarray) -> None:  # noqa: D102 - compiled
        for i in range(len(out)):
            out[i, 0] = codes[rows[i]]
