"""Loads: obstacles that give way when robots push hard enough."""

import math

import numpy as np
from mesa import Model

from mesa_swarm.errors import InvalidValueError, check_number
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.world.arena import Arena
from mesa_swarm.world.form import Form, Pose
from mesa_swarm.world.obstacle import Obstacle
from mesa_swarm.world.shapes import Coordinates, Shape

LARGEST_RESISTANCE = 1e9


class Load(Obstacle):
    """A body that moves while robots push harder than it resists; an obstacle in all else.

    Created by `SwarmModel.add_load`; take it out with `remove()`. See `physics.loads` for how it moves.

    Parameters
    ----------
    space, model
        Mesa's.
    shape : Shape
        Where it lies at first.
    resistance : float
        How many robots' full pushes it withstands, above 0.

    Attributes
    ----------
    shape : Shape
        As it lies now; a new one whenever it has moved.
    moved : bool
        Whether it moved in the last step.
    pushers : int
        How many robots pushed it in the last step.
    """

    def __init__(self, space: Arena, model: Model, shape: Shape, resistance: float) -> None:
        super().__init__(space, model, shape)
        self.form = Form.of(shape)
        x, y = shape.position.tolist()
        self.lay((x, y, 0.0))
        self.resistance = resistance
        self.moved = False
        self.pushers = 0

    @property
    def position(self) -> np.ndarray:
        """Its centre (of a polygon the centroid), shape (2,)."""
        return np.array(self.pose[:2])

    @position.setter
    def position(self, value: Coordinates) -> None:
        raise InvalidValueError("loads move only when robots push them; remove this one and add another")

    @property
    def heading(self) -> float:
        """How far it has been turned since it was added, rad in [-pi, pi), counter-clockwise."""
        return self.pose[2]

    @property
    def resistance(self) -> float:
        """How many robots' full pushes it withstands; it moves only when pushed harder than that."""
        return self._resistance

    @resistance.setter
    def resistance(self, value: float) -> None:
        self._resistance = checked_resistance(value)

    def lay(self, pose: Pose) -> None:
        """Lay it at (x, y, heading)."""
        x, y, heading = pose
        self.pose: Pose = (x, y, float(wrapped(heading)))
        self.shape = self.form.shape_at(self.pose)
        self.space._agent_positions[self.space._agent_to_index[self]] = x, y

    def rest(self) -> None:
        """Forget the last step."""
        self.moved, self.pushers = False, 0

    def farthest_from(self, pose: Pose) -> float:
        """Return no less than the distance of any of its points from where it was at another pose."""
        x, y, heading = self.pose
        turned = 2.0 * abs(math.sin((heading - pose[2]) / 2.0))
        return math.hypot(x - pose[0], y - pose[1]) + self.form.reach * turned


def checked_resistance(value: float) -> float:
    """Return a resistance that is one, or say why it is not."""
    return check_number("resistance", value, above=0, maximum=LARGEST_RESISTANCE)
