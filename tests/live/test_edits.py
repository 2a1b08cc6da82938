"""What is changed by hand on a page: robots go where there is room, and only there; discs are listed as others are."""

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Map, SwarmModel, disc, rectangle
from mesa_swarm.geometry.grid import list_boxes_by_cell
from mesa_swarm.live.edits import SPARE_DISCS, DiscsInHand, Hand

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


ROOM = Map(
    name="room", bounds=(0.0, 0.0, 300.0, 200.0), obstacles=(rectangle((90, 40), (130, 60)), disc((220, 90), 14))
)
# A row, a place and a radius; none of it takes the disc away.
CHANGES = st.lists(
    st.tuples(
        st.integers(0, SPARE_DISCS - 1),
        st.none() | st.tuples(st.floats(0, 300), st.floats(0, 200), st.floats(0.1, 25)),
    ),
    max_size=20,
)


def room_with_spare_discs():
    """Return a model with a fire and robots, whose tables have room for discs."""
    model = SwarmModel(map=ROOM, rng=1)
    model.add_fire((30.0, 150.0), radius=10.0)
    model.add_robots(AGENT9, poses=[(10.0, 10.0, 0.0), (25.0, 10.0, 1.0), (280.0, 20.0, 2.0)])
    model.parts.bodies.let_roam(SPARE_DISCS)
    model.sense()
    return model


def listed(lists, cell):
    return lists.items[lists.start[cell] : lists.start[cell + 1]].tolist()


@given(CHANGES)
def test_after_any_changes_all_that_is_there_is_listed_in_its_cells_and_nothing_else(changes):
    model = room_with_spare_discs()
    discs, statics = DiscsInHand(model, b""), model.parts.bodies.scene().statics
    there, robots = {}, model.swarm.position.copy()
    for place, circle in changes:
        row = discs.spare[place]
        if circle is None:
            discs.take(row)
            there.pop(row, None)
        elif discs.put(row, *circle):
            there[row] = circle
        else:
            gaps = np.hypot(*(robots - circle[:2]).T) - model.swarm.radius - circle[2]
            assert gaps.min() < CLOSE
    assert {row: tuple(statics.discs[row]) for row in discs.spare if statics.discs[row, 2] > 0} == there
    low, high = statics.discs[:, :2] - statics.discs[:, 2:], statics.discs[:, :2] + statics.discs[:, 2:]
    ends = statics.edges.reshape(-1, 2, 2)
    boxes = np.concatenate([np.hstack([ends.min(axis=1), ends.max(axis=1)]), np.hstack([low, high])])
    arrays = discs.block._values
    for lists, reach, first in ((statics.sight_cells, arrays.sight, 0), (statics.touch_cells, arrays.touch, 4)):
        present = np.flatnonzero(~np.isnan(boxes[:, 0]))[first:]
        start, items = list_boxes_by_cell(boxes[present], reach, statics.grid.numbers)
        assert lists.start.tolist() == start.tolist()
        cells = range(len(start) - 1)
        assert [listed(lists, cell) for cell in cells] == [
            present[items[start[cell] : start[cell + 1]]].tolist() for cell in cells
        ]


def test_lists_of_cells_have_room_for_all_discs_of_the_largest_radius():
    model = room_with_spare_discs()
    discs, statics = DiscsInHand(model, b""), model.parts.bodies.scene().statics
    for k, row in enumerate(discs.spare):
        assert discs.put(row, 100.0 + 10 * k, 120.0, discs.largest)
    assert statics.sight_cells.start[-1] <= len(statics.sight_cells.items)
    assert statics.touch_cells.start[-1] <= len(statics.touch_cells.items)


def test_those_that_the_model_has_itself_can_be_taken_away_but_no_fire_and_no_body_of_another_kind():
    model = SwarmModel(map=ROOM, rng=1)
    model.add_body(disc((40.0, 40.0), 5.0), kind="tower", mode="fixed")
    model.add_body(disc((60.0, 40.0), 5.0), mode="fixed", temperature=0.5)
    model.add_fire((30.0, 150.0), radius=10.0)
    model.parts.bodies.let_roam(SPARE_DISCS)
    discs = model.parts.bodies.scene().statics.discs
    assert [discs[row].tolist() for row in DiscsInHand(model, b"").own] == [[220.0, 90.0, 14.0]]
