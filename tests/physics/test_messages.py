"""Messages of named numbers, and the sensor of neighbours, against independent twins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString

from mesa_swarm import AGENT9, Lamp, NeighbourSensor, Radio, RobotDesign, rectangle
from mesa_swarm.base.errors import BehaviourError, InvalidValueError
from mesa_swarm.control import PASS, Subsumption, behaviour
from support.scenes import empty

RANGE, MOST = 120.0, 3
WALL = rectangle((195, 100), (205, 200))
EYES = RobotDesign(
    name="eyes",
    radius=2.0,
    sensors=(
        NeighbourSensor(range=RANGE, k=MOST, occluded=True),
        NeighbourSensor(name="open", range=RANGE, k=1, lamp=True),
    ),
    actuators=(Lamp(),),
)
PLACES = st.lists(st.tuples(st.integers(1, 39), st.integers(1, 29)), min_size=1, max_size=12, unique=True).map(
    lambda cells: [(10.0 * x, 10.0 * y, 0.01 * x * y) for x, y in cells if not 18 <= x <= 22] or [(10.0, 10.0, 0.0)]
)


@behaviour
def count(me):
    me.send.count = me.heard.n
    me.send.vector[1] = me.heard.range[0]
    me.act.lamp = me.radius
    return 0.0, 0.0


def world(poses, **radio):
    model = empty(400, 300, communication=Radio(range=RANGE, message={"count": 1, "vector": 2}, most=MOST, **radio))
    model.add_obstacle(WALL)
    model.add_robots(EYES, poses=poses)
    model.control = Subsumption(count)
    return model


def neighbours_of(model, i, *, occluded, most):
    """Return (distance, row) of the nearest robots, by Shapely."""
    position = model.swarm.position
    near = [(math.dist(position[i], place), j) for j, place in enumerate(position) if j != i]
    seen = [
        (away, j)
        for away, j in near
        if away <= RANGE and not (occluded and LineString(position[[i, j]]).intersects(WALL.geometry))
    ]
    return sorted(seen)[:most]


def bearing_of(model, i, j):
    dx, dy = model.swarm.position[j] - model.swarm.position[i]
    return math.remainder(math.atan2(dy, dx) - model.swarm.heading[i], 2 * math.pi)


@pytest.mark.slow
@given(PLACES)
@settings(max_examples=30, deadline=None)
def test_messages_and_neighbours_are_those_of_a_twin_nearest_first(poses):
    model = world(poses, occlusion=True)
    model.run(3)
    heard = {name.removeprefix("heard."): column for name, column in model.swarm.columns.items() if "heard." in name}
    for i in range(len(poses)):
        expected = neighbours_of(model, i, occluded=True, most=MOST)
        assert heard["n"][i] == len(expected)
        for k in range(MOST):
            values = [heard["range"][i, k], heard["bearing"][i, k], *model.swarm.neighbour[i, 2 * k : 2 * k + 2]]
            if k >= len(expected):
                assert np.isnan(values).all()
                continue
            away, j = expected[k]
            bearing = bearing_of(model, i, j)
            assert values == pytest.approx([away, bearing] * 2, abs=1e-9)
            assert heard["count"][i, k] == heard["n"][j]
            nearest = neighbours_of(model, j, occluded=True, most=1)[0][0]
            assert heard["vector"][i, k, 1] == pytest.approx(nearest, abs=1e-9)
            assert math.isnan(heard["vector"][i, k, 0])


def test_a_lamp_is_seen_in_the_step_after_it_was_set_and_by_none_without_lamps():
    model = world([(50, 50, 0.0), (80, 50, 0.0)])
    model.sense()
    assert model.swarm.open[:, 2].tolist() == [0.0, 0.0]
    model.run(2)
    assert model.swarm.open[:, 2].tolist() == [2.0, 2.0]
    dark = empty(400, 300)
    dark.add_robots(RobotDesign(sensors=(NeighbourSensor(lamp=True, k=1),)), poses=[(50, 50, 0.0), (80, 50, 0.0)])
    dark.sense()
    assert dark.swarm.neighbour[0].tolist()[:2] == [30.0, 0.0]
    assert np.isnan(dark.swarm.neighbour[:, 2]).all()


def test_robots_of_another_design_are_seen_but_see_nothing():
    model = empty(400, 300)
    model.add_robots(AGENT9, poses=[(50, 50, 0.0)])
    model.add_robots(EYES, poses=[(80, 50, math.pi / 2)])
    model.sense()
    assert model.swarm.neighbour[1, :2] == pytest.approx([30.0, math.pi / 2])
    assert np.isnan(model.swarm.neighbour[0]).all()


def test_a_robot_that_sets_nothing_sends_nothing():
    @behaviour
    def the_left_one(me):
        if me.neighbour[0] > 0 and math.cos(me.neighbour[1]) > 0:
            me.send.count = 5.0
        return 0.0, 0.0

    model = world([(50, 50, 0.0), (80, 50, 0.0)])
    model.control = Subsumption(the_left_one)
    model.run(2)
    assert model.swarm.columns["heard.n"].tolist() == [0, 1]
    assert model.swarm.columns["heard.count"][:, 0].tolist()[1] == 5.0


def test_a_lost_broadcast_is_lost_for_one_hearer_and_step_and_the_next_nearest_is_heard():
    poses = [(60.0 + 10 * (k % 10), 60.0 + 10 * (k // 10), 0.0) for k in range(60)]
    model = world(poses, loss_probability=0.5)
    model.run(2)
    ranges = model.swarm.columns["heard.range"]
    assert (model.swarm.columns["heard.n"] == MOST).all()
    assert (np.diff(ranges, axis=1) >= 0).all()
    first = np.isclose(ranges[:, 0], 10.0).mean()
    assert 0.75 < first < 0.99  # 1 - 0.5 ** (2, 3 or 4 neighbours at 10)


def test_a_change_of_the_radio_changes_the_columns_and_a_new_control_clears_them():
    model = world([(50, 50, 0.0), (80, 50, 0.0)])
    model.run(2)
    model.control = Subsumption(behaviour(lambda me: PASS))
    assert not model.swarm.columns["heard.n"].any()
    assert np.isnan(model.swarm.columns["send.count"]).all()
    model.communication = None
    assert not [name for name in model.swarm.columns if name.startswith(("send.", "heard."))]


def wrong(me):
    return me.heard.rnge[0], 1.0


def test_an_unknown_field_of_what_is_heard_is_refused_with_the_nearest_name():
    model = world([(50, 50, 0.0)])
    model.control = Subsumption(behaviour(wrong))
    with pytest.raises(BehaviourError, match=r"unknown field of me.heard 'rnge'; did you mean 'range'"):
        model.step()


@pytest.mark.parametrize(
    "message", ["count", 3, {"n": 1}, {"range": 1}, {"count": 0}, {"count": math.nan}, ["a", "a"], {"a b": 1}, [["a"]]]
)
def test_messages_without_names_and_widths_are_refused(message):
    with pytest.raises(InvalidValueError):
        Radio(message=message)


@pytest.mark.parametrize("wrong", [{"most": 0}, {"most": math.nan}, {"state": False, "goal": False}])
def test_a_radio_refuses_what_cannot_be(wrong):
    with pytest.raises(InvalidValueError):
        Radio(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [{"range": math.nan}, {"k": 0}, {"lamp": 1}, {"occluded": "no"}, {"kind": 3}, {"kind": "sheep", "lamp": True}],
)
def test_a_neighbour_sensor_refuses_what_cannot_be(wrong):
    with pytest.raises(InvalidValueError):
        NeighbourSensor(**wrong)
