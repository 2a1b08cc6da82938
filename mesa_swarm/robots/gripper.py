"""Gripper: an actuator that picks up bodies, and the sensor of what a robot carries."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.robots.actuators import ACT, Actuator
from mesa_swarm.robots.devices import check_kind, check_spelling
from mesa_swarm.robots.sensors import Sensor

LARGEST_REACH = 1e6


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
        self.kernel_for(model, rows).run(model.completed + 1, len(model.swarm))

    def kernel_for(self, model: Any, rows: np.ndarray) -> Kernel:
        """Return what grips and puts down for the robots in these rows, see `Actuator`."""
        if not len(model.movers):
            return sequence_of([])
        bodies, swarm = model.parts.bodies, model.swarm
        carrying, codes = bodies.carrying(), [model.kinds.index(kind) for kind in self.kinds if kind in model.kinds]
        free = np.array([getattr(body, "agent", None) is None for body in bodies.table.agents], np.bool_)
        return carrying.gripping(
            setting=swarm.columns[f"{ACT}{self.name}"],
            robots=np.array(rows),
            grips=np.isin(bodies.table.kind, codes) & free,
            reach=float(self.reach),
            half_angle=float(np.radians(self.field_of_view_degrees) / 2),
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Carried(Sensor):
    """Reads the code of the kind of what the robot carries, see `SwarmModel.kinds`, and -1 for nothing."""

    name: str = "carried"
    spoiled: ClassVar[bool] = False

    @staticmethod
    def read(rows: np.ndarray, bodies_carrier: np.ndarray, bodies_kind: np.ndarray, out: np.ndarray) -> None:
        """Write it for the robots in these rows."""
        out[:] = -1.0
        for body in range(len(bodies_carrier)):
            for i in range(len(rows)):
                if rows[i] == bodies_carrier[body]:
                    out[i, 0] = bodies_kind[body]
