"""Robots placed inside bodies or inside each other: each finds free room nearby, in both engines."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Map, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import PlacementError

ENGINES = ("compiled", "shapely")
RADIUS = AGENT9.radius
SIZE = (100, 80)
SOLIDS = (rectangle((40, 25), (80, 55)), polygon([(20, 60), (60, 62), (20, 64)]), disc((30, 25), 12))
# Bodies may overlap by this share of a radius (PHYSICS 4).
TOLERANCE = 1e-3 * RADIUS
BODIES = shapely.union_all([solid.geometry.buffer(solid.radius + RADIUS, quad_segs=64) for solid in SOLIDS])
# Where a robot's centre may be.
ROOM = shapely.box(RADIUS, RADIUS, SIZE[0] - RADIUS, SIZE[1] - RADIUS) - BODIES

points = st.tuples(st.floats(1, 99), st.floats(1, 79))


def standing(engine, places, solids=SOLIDS, size=SIZE):
    """Return the positions of robots without a controller after their first step."""
    model = SwarmModel(map=Map(name="hall", bounds=(0, 0, *size), obstacles=solids), rng=1, engine=engine)
    model.add_robots(AGENT9, poses=[(x, y, 0.0) for x, y in places])
    model.step()
    return model.swarm.position.copy()


def gaps(position):
    """Return how far apart the edges of each two robots are."""
    distance = np.linalg.norm(position[:, None] - position, axis=-1)
    return distance[np.triu_indices(len(position), 1)] - 2 * RADIUS


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@settings(max_examples=20)
@given(places=st.lists(points, min_size=2, max_size=8))
def test_robots_placed_anywhere_overlap_nothing_after_the_first_step(engine, places):
    position = standing(engine, places)
    assert gaps(position).min() >= -TOLERANCE
    assert shapely.distance(ROOM, shapely.points(position)).max() <= TOLERANCE


@pytest.mark.parametrize("engine", ENGINES)
def test_robots_on_one_spot_between_walls_line_up(engine):
    lane = (rectangle((0, 0), (100, 30)), rectangle((0, 50), (100, 80)))
    position = standing(engine, [(50, 40)] * 5, lane)
    assert gaps(position).min() >= -TOLERANCE
    assert np.abs(position[:, 1] - 40).max() <= 20 - 10 - RADIUS + TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_crowd_that_pushing_cannot_separate_finds_room(engine):
    position = standing(engine, [(6 + 0.1 * k, 6) for k in range(30)], ())
    assert gaps(position).min() >= -TOLERANCE
    assert ((position >= RADIUS - TOLERANCE) & (position <= np.array(SIZE) - RADIUS + TOLERANCE)).all()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@given(place=points)
def test_one_robot_moves_to_the_nearest_room_within_a_ring(engine, place):
    (position,) = standing(engine, [place])
    needed, moved = ROOM.distance(shapely.Point(place)), math.dist(place, position)
    assert needed - TOLERANCE <= moved <= 1.1 * needed + 0.25 * RADIUS


@pytest.mark.parametrize("engine", ENGINES)
def test_robots_that_are_free_stay_exactly_where_they_are(engine):
    places = np.array([(8.0, 8.0), (8.0 + 2 * RADIUS, 8.0), (90.0, 70.0)])
    np.testing.assert_array_equal(standing(engine, places), places)


@pytest.mark.slow
@given(places=st.lists(points, min_size=1, max_size=4))
def test_both_engines_find_the_same_room(places):
    np.testing.assert_allclose(standing("compiled", places), standing("shapely", places), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_for_which_no_room_is_left_is_named(engine):
    with pytest.raises(
        PlacementError, match=r"no room is left for robot \d of 9 \(radius \S+\); remove robots or obstacles"
    ):
        standing(engine, [(10 + k, 10) for k in range(9)], (), (4.5 * RADIUS, 4.5 * RADIUS))
