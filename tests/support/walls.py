"""A world with a thin wall that robots go round: a line from one place of theirs to a later one crosses it."""

import math
from collections.abc import Iterable

import shapely

from mesa_swarm import AGENT9, Map, SwarmModel, rectangle
from mesa_swarm.control import Subsumption, behaviour

WALL = shapely.box(88, 59.5, 112, 60.5)


@behaviour
def circle(me):
    return 0.6, 1.0


class Circling(SwarmModel):
    """Three robots that go round a thin wall."""

    def __init__(self, *, rng=None):
        hall = Map(name="hall", bounds=(0, 0, 200, 120), obstacles=[rectangle((88, 59.5), (112, 60.5))], fires=[])
        super().__init__(map=hall, rng=rng)
        turns = (0.0, 2.0, 4.0)
        poses = [(100 + 20 * math.cos(a), 60 + 20 * math.sin(a), a + math.pi / 2) for a in turns]
        self.add_robots(AGENT9, poses=poses)
        self.control = Subsumption(circle)


def crosses(lines: Iterable) -> bool:
    """Return whether any of these lines (k, 2) of points meets the wall."""
    return any(shapely.LineString(line).intersects(WALL) for line in lines)
