"""What is changed by hand on a page: robots that are moved, where there is room."""

from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import IntegerRows, Integers, RealRows, Reals
from mesa_swarm.physics.contact import StaticArrays
from mesa_swarm.physics.placing import is_free, overlaps_any

# What `put_robot` returns where there is no room.
NO_ROOM = 1


class PutArrays(NamedTuple):
    """What `put_robot` takes: a place (2,), positions and radii of robots, and numbers of a block of what is solid."""

    place: Reals
    position: RealRows
    radius: Reals
    statics: Integers
    rings: IntegerRows


@compiled(nogil=True)
def put_robot(block, step, first, last):
    """Put the robot in row `first` at a place; return `NO_ROOM` where it would overlap anything or leave the map."""
    p = unpack(block, PutArrays)
    x, y, statics = p.place[0], p.place[1], unpack(p.statics, StaticArrays)
    low_x, low_y, high_x, high_y = statics.bounds[0], statics.bounds[1], statics.bounds[2], statics.bounds[3]
    if not (low_x <= x <= high_x and low_y <= y <= high_y):
        return NO_ROOM
    if not is_free(x, y, p.radius[first], statics, p.rings) or overlaps_any(first, x, y, p.position, p.radius):
        return NO_ROOM
    p.position[first, 0], p.position[first, 1] = x, y
    return 0


class Hand:
    """What a page moves robots of a model with.

    Attributes
    ----------
    block : Block
        Of `PutArrays`.
    place : float64 ndarray, shape (2,)
    """

    def __init__(self, model: Any) -> None:
        columns, engine, scene = model.swarm.columns, model.parts.robots.engine, model.parts.bodies.scene()
        self.place = np.zeros(2)
        positions = columns["position"], columns["radius"]
        self.block = Block(PutArrays(self.place, *positions, engine._statics.numbers, scene.statics.rings))

    def put(self, row: int, x: float, y: float) -> bool:
        """Put a robot at a place, and return whether there is room."""
        self.place[:] = x, y
        return put_robot(self.block.numbers, 0, row, row + 1) == 0
