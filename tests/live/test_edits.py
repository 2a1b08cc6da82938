"""Robots that are moved by hand on a page go where there is room, and only there."""

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.live.edits import Hand

PLACES, CLOSE = st.floats(-50, 900), 1e-3


def room_at(model, x, y):
    """Return how far a robot there would be from everything, by Shapely; below 0 where it overlaps something."""
    x0, y0, x1, y1 = model.map.bounds
    border = min(x - x0, y - y0, x1 - x, y1 - y)
    solid = min(shapely.distance(shape.geometry, shapely.Point(x, y)) for shape in model.map.obstacles)
    others = np.hypot(*(model.swarm.position[1:] - (x, y)).T).min() - AGENT9.radius
    return min(border, solid, others) - AGENT9.radius


@given(PLACES, PLACES)
def test_a_robot_is_put_where_there_is_room_and_stays_where_there_is_none(x, y):
    model = SwarmModel(map="sparse", rng=1)
    model.add_robots(AGENT9, 12)
    model.sense()
    before, room = model.swarm.position.copy(), room_at(model, x, y)
    fits = Hand(model).put(0, x, y)
    assert fits or room < CLOSE
    assert not fits or room > -CLOSE
    expected = [(x, y), *before[1:].tolist()] if fits else before.tolist()
    assert model.swarm.position.tolist() == [list(place) for place in expected]
