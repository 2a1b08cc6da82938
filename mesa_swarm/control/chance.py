"""`me.chance` of custom rules: another number each time that it is read, whatever other robots and rules read.

The numbers are counter-based: in each step a layer draws one key of 64 bits from its stream, and the number of a robot
and how often it has read decide the rest (`kernels.draws.draw_at`).
"""

from typing import Any, NamedTuple

import numpy as np
from numba.core import types
from numba.extending import overload

from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import draw_at

# Places in what is drawn from: the key of the step, and how many numbers the present robot has read.
KEY, READS = 0, 1
PLACES = 2


class Draws(NamedTuple):
    """What `me.chance` draws from.

    Parameters
    ----------
    drawn : uint64 ndarray, shape (2,)
        The key of this step, and how many numbers the robot has read in it.
    number : int
        The robot's.
    """

    drawn: np.ndarray
    number: int


@compiled
def begin_draws(drawn):
    """Return what the next robot draws from: it has read no number yet."""
    drawn[READS] = 0
    return drawn


@compiled
def draw_chance(chance):
    """Return the next number of a robot in this step, from 0 to below 1."""
    drawn = chance.drawn
    reads = drawn[READS]
    drawn[READS] = reads + np.uint64(1)
    return draw_at(drawn[KEY], chance.number, reads)


def read_chance(value: Any) -> Any:
    """Return what a rule reads as an attribute `chance`: the next number where it is that of `me`."""
    return draw_chance(value) if isinstance(value, Draws) else value


@overload(read_chance)
def _compiled_read(value: Any) -> Any:
    def draw(value: Any) -> Any:
        return draw_chance(value)

    def keep(value: Any) -> Any:
        return value

    return draw if isinstance(value, types.NamedTuple) and value.instance_class is Draws else keep


def reading_chance(fields: Any) -> type:
    """Return a class of `me` for plain Python, of which `chance` is another number each time."""
    if "chance" not in fields._fields:
        return fields
    place = fields._fields.index("chance")
    return type(fields.__name__, (fields,), {"__slots__": (), "chance": property(lambda me: draw_chance(me[place]))})
