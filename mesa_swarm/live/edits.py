"""What is changed by hand on a page: robots are moved where there is room, fires are put out and lit again."""

from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.fire.burning import NO_FIRE, NOT_YET, LightArrays
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import IntegerRows, Integers, RealRows, Reals
from mesa_swarm.physics.contact import StaticArrays
from mesa_swarm.physics.placing import is_free, overlaps_any
from mesa_swarm.world.statics import FIRE, OBSTACLE

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


@compiled(nogil=True)
def set_fire(block, step, first, last):
    """Light the fire `first` at temperature 1 if `last` is above 0, otherwise put it out, after this number of steps.

    As by hand in Python: nothing happens to one that is as it is to be, and robots no longer fight any.
    """
    f = unpack(block, LightArrays)
    burns = last > 0
    if burns != f.out[first]:
        return 0
    f.heat_of[f.rows[first]], f.out[first] = (1.0, False) if burns else (0.0, True)
    f.out_step[first] = NOT_YET if burns else step
    f.seen_as[first] = FIRE if burns else OBSTACLE
    if not burns:
        f.fighters[first] = 0
        f.fire[:] = NO_FIRE
    return 0


def fires_in_hand(model: Any) -> Block:
    """Return what `set_fire` takes of a model with fires."""
    return Block(model.parts.fires.to_light())


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
