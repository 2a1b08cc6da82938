import math

import pytest
import shapely
from shapely.geometry import Point

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.geometry.room import outside, part_around, room_for_disc

TWO = shapely.union_all([shapely.box(0, 0, 1, 1), shapely.box(5, 0, 7, 1)])


@pytest.mark.parametrize("quarter_segments", [4, 16, 64])
def test_a_grown_disc_is_drawn_around_the_circle_and_touches_it(quarter_segments):
    room = room_for_disc((0, 0, 100, 100), [(Point(50, 50), 15.0)], 5.0, quarter_segments)
    hole = room.interiors[0]
    assert hole.distance(Point(50, 50)) == pytest.approx(20.0, rel=1e-12)
    corners = shapely.get_coordinates(hole) - 50
    assert max(math.hypot(*corner) for corner in corners) == pytest.approx(20.0 * outside(quarter_segments))


@pytest.mark.parametrize("radius", [50.0, 60.0])
def test_there_is_no_room_for_a_disc_as_wide_as_the_world(radius):
    room = room_for_disc((0, 0, 100, 300), [], radius, 16)
    assert room.is_empty
    assert part_around(room, (50, 50), 1e9) is None


def test_there_is_no_room_where_all_is_solid():
    assert part_around(room_for_disc((0, 0, 9, 9), [(shapely.box(0, 0, 9, 9), 0.0)], 1.0, 16), (4, 4), 1e9) is None


def test_the_nearest_part_within_the_slack_is_taken():
    assert part_around(TWO, (4.0, 0.5), 1.0).area == 2.0
    assert part_around(TWO, (1.5, 0.5), 4.0).area == 1.0
    assert part_around(TWO, (4.0, 0.5), 0.99) is None


def test_what_is_no_geometry_is_refused():
    with pytest.raises(InvalidValueError, match="solids holds None; expected valid Shapely geometries"):
        room_for_disc((0, 0, 9, 9), [(None, 1.0)], 1.0, 16)
