"""Obstacles as Mesa agents."""

import numpy as np
from mesa import Model

from mesa_swarm.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.world.arena import Arena, ArenaAgent
from mesa_swarm.world.shapes import Coordinates, Shape


class Obstacle(ArenaAgent):
    """Something that stands in the world and never moves, or a mark painted on its ground.

    Created by `SwarmModel.add_obstacle`; take it out with `remove()`.

    Parameters
    ----------
    space, model
        Mesa's.
    shape : Shape
        From `disc`, `rectangle` or `polygon`.
    """

    def __init__(self, space: Arena, model: Model, shape: Shape) -> None:
        self.shape = shape
        super().__init__(space, model)
        index = space._agent_to_index[self]
        space._agent_positions[index] = shape.position

    def __repr__(self) -> str:
        if self.space is None:
            return f"<{type(self).__name__} {self.unique_id}, removed>"
        x, y = (round(float(number), 2) for number in self.position)
        name = type(self).__name__
        return f"<{name} {self.unique_id}, {self.shape.kind} at ({x}, {y}){'' if self.contact else ', a mark'}>"

    @property
    def contact(self) -> bool:
        """Whether bodies bump into it; False for a mark on the ground."""
        return self.shape.contact

    @property
    def position(self) -> np.ndarray:
        """Centre of a disc or centroid of a polygon, shape (2,)."""
        return self.shape.position

    @position.setter
    def position(self, value: Coordinates) -> None:
        raise InvalidValueError("obstacles do not move; remove this one and add another")

    def remove(self) -> None:
        """Take the obstacle out of the world, between two steps."""
        if self.space is None:
            raise RemovedRobotError("this obstacle has been removed already; take one from model.obstacles")
        model = self.model
        super().remove()
        model.obstacles_changed()
