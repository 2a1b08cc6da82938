"""Handles never break though rows move, stale handles raise, and columns are read-only and move together."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, AGENT_FIRE, LineSensor, ProximitySensor, RobotDesign
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError, SwarmError, UnknownNameError
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.swarm import COLUMNS
from support.scenes import ahead, blind, empty

DESIGNS = [AGENT3, AGENT9, blind(), AGENT_FIRE, RobotDesign(radius=3, sensors=(LineSensor(), LineSensor()))]
MESA_S = {"rng", "random", "scenario"}
GETTERS = sorted(name for name in dir(Robot) if isinstance(getattr(Robot, name), property) and name not in MESA_S)
SETTERS = [name for name in GETTERS if getattr(Robot, name).fset]
GOOD = {"position": (9, 9), "pos": (9, 9), "heading": 1, "max_speed": 0.5, "tendency": "left", "temperature": 1}
GOOD["group"] = "scouts"


def marked(n=6, design=AGENT9):
    """Return a model whose robots stand in a row and have their ids in their temperatures."""
    model = empty()
    robots = model.add_robots(design, poses=[(20 + 20 * k, 50, 0.1 * k) for k in range(n)])
    for robot in robots:
        robot.temperature = robot.unique_id
    return model, robots


def test_the_lists_below_name_every_property():
    assert {"position", "heading", "radius", "distance", "kind", "command", "layer", "fire"} <= set(GETTERS)
    assert set(SETTERS) == set(GOOD)


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 10**6)), min_size=1, max_size=25))
def test_handles_never_break_however_robots_come_and_go(moves):
    model, robots = empty(), []
    for k, (add, which) in enumerate(moves):
        if add or not robots:
            pose = (10 + 12 * k, 10 + 11 * k, 0.01 * k)
            robots += model.add_robots(DESIGNS[which % len(DESIGNS)], poses=[pose])
            robots[-1].temperature = 1000 + robots[-1].unique_id
        else:
            robots.pop(which % len(robots)).remove()
        ids = [robot.unique_id for robot in model.robots]
        assert ids == sorted(ids) == [robot.unique_id for robot in robots]
        assert [robot.row for robot in robots] == list(range(len(robots)))
        assert {len(column) for column in model.swarm.columns.values()} == {len(robots)}
        for row, robot in enumerate(robots):
            assert robot.temperature == 1000 + robot.unique_id
            assert robot.radius == robot.design.radius
            assert len(robot.distance) == len(robot.kind) == len(robot.design.proximity)
            assert (robot.position == model.swarm.position[row]).all()


@pytest.mark.parametrize("name", GETTERS)
def test_reading_anything_of_a_removed_robot_raises(name):
    _, robots = marked()
    robots[2].remove()
    with pytest.raises(RemovedRobotError, match="robot 3 was removed; take a handle from"):
        getattr(robots[2], name)
    getattr(robots[3], name)


@pytest.mark.parametrize("name", SETTERS)
def test_writing_anything_to_a_removed_robot_raises_and_changes_no_other(name):
    model, robots = marked()
    robots[2].remove()
    before = model.state_hash()
    with pytest.raises(RemovedRobotError):
        setattr(robots[2], name, GOOD[name])
    assert model.state_hash() == before


@pytest.mark.parametrize(
    "use", [lambda r: r.remove(), lambda r: r.get_neighbors_in_radius(9), lambda r: r.get_nearest_neighbors(2)]
)
def test_any_use_of_a_removed_robot_raises(use):
    model, robots = marked()
    model.remove_robots([robots[0]])
    with pytest.raises(RemovedRobotError):
        use(robots[0])


@pytest.mark.parametrize("name", sorted(COLUMNS))
def test_columns_cannot_be_written_to(name):
    column = getattr(marked()[0].swarm, name)
    with pytest.raises(ValueError, match="read-only"):
        column[...] = 0


def test_writing_to_what_a_handle_returns_is_refused():
    model, robots = marked()
    before = model.state_hash()
    for name in ("position", "command", "distance", "kind", "pos", "goal", "radiation", "line", "slip"):
        with pytest.raises(ValueError, match="set the property as a whole"):
            getattr(robots[0], name)[...] = 7
    assert model.state_hash() == before


def test_designs_with_different_numbers_of_sensors_live_together_padded_with_nothing():
    model = empty()
    three = model.add_robots(AGENT3, poses=[(100, 150, 0.0)])[0]
    none = model.add_robots(blind(), poses=[(120, 150, 0.0)])[0]
    nine = model.add_robots(AGENT9, poses=[(140, 150, math.pi)])[0]
    model.sense()
    assert model.swarm.distance.shape == (3, 9)
    assert (model.swarm.distance[0, 3:] == -1).all()
    assert (model.swarm.kind[0, 3:] == -1).all()
    assert (model.swarm.distance[1] == -1).all()
    assert (len(three.distance), len(none.distance), len(nine.distance)) == (3, 0, 9)
    assert three.distance[0] == pytest.approx(10)
    assert nine.distance[0] == pytest.approx(10)


def test_a_robot_reads_the_same_alone_and_among_designs_with_more_sensors():
    readings = []
    for others in (False, True):
        model = empty()
        robot = model.add_robots(AGENT3, poses=[(20, 20, -2.0)])[0]
        if others:
            model.add_robots(AGENT_FIRE, poses=[(300, 200, 0.0)])
            model.add_robots(DESIGNS[-1], poses=[(350, 200, 0.0)])
        model.sense()
        readings.append((robot.distance, robot.kind))
    assert (readings[0][0] == readings[1][0]).all()
    assert (readings[0][1] == readings[1][1]).all()
    assert (readings[0][0] >= 0).any()


def test_adding_and_removing_between_steps_preserves_the_columns_of_all_others():
    model, robots = marked(6)
    model.control = Subsumption(Explore(turn_interval=1000))
    model.run(5)
    names = [n for n in model.swarm.columns if n not in {"number", "contact_index"}]
    stored = {n: model.swarm.columns[n][[0, 1, 3, 5]].copy() for n in names}
    model.remove_robots([robots[4], robots[2]])
    model.add_robots(AGENT_FIRE, poses=[(200, 200, 0.0)])
    for name in names:
        now = model.swarm.columns[name][:4]
        np.testing.assert_array_equal(now[..., : stored[name].shape[-1]] if now.ndim > 1 else now, stored[name], name)
    assert any(n.endswith(".straight") and (stored[n] > 0).any() for n in names)


def test_what_layers_remember_moves_with_the_rows():
    model, robots = marked(4)
    model.control = Subsumption(Explore(turn_interval=1000))
    model.run(3)
    late = model.add_robots(AGENT9, poses=[(200, 200, 0.0)])[0]
    model.run(2)
    robots[1].remove()
    model.step()
    straight = next(c for n, c in model.swarm.columns.items() if n.endswith(".straight"))
    assert straight.tolist() == [6, 6, 6, 3]
    assert late.row == 3


def test_a_new_control_forgets_what_the_old_one_remembered():
    model, _ = marked(2)
    model.control = Subsumption(Explore(turn_interval=1000))
    model.run(3)
    model.control = Subsumption(Explore(turn_interval=1000))
    straight = next(c for n, c in model.swarm.columns.items() if n.endswith(".straight"))
    assert straight.tolist() == [0, 0]
    model.control = None
    assert set(model.swarm.columns) == set(COLUMNS)


def test_all_robots_may_be_removed_and_others_added():
    model, robots = marked(5, AGENT_FIRE)
    model.control = Subsumption(ahead)
    model.run(2)
    model.remove_robots(model.robots)
    assert len(model.swarm) == len(model.robots) == len(model.contacts.robot) == 0
    model.run(3)
    assert model.swarm.position.shape == (0, 2)
    late = model.add_robots(AGENT3, 2)
    model.run(2)
    assert min(robot.unique_id for robot in late) > max(robot.unique_id for robot in robots)


def test_a_robot_named_twice_in_a_list_to_remove_is_removed_once():
    model, robots = marked(3)
    model.remove_robots([robots[0], robots[0]])
    assert [r.unique_id for r in model.robots] == [2, 3]


def test_a_list_to_remove_with_a_removed_robot_removes_none():
    model, robots = marked(3)
    robots[0].remove()
    with pytest.raises(RemovedRobotError):
        model.remove_robots([robots[1], robots[0]])
    assert [r.unique_id for r in model.robots] == [2, 3]


BAD = {
    "position": [
        (math.nan, 5),
        (5, math.inf),
        (-0.001, 5),
        (400.001, 5),
        (5,),
        (1, 2, 3),
        5,
        None,
        "ab",
        [[1, 2]],
        ("a", 1),
    ],
    "pos": [(math.nan, 5), (500, 5), 5, "ab"],
    "heading": [math.nan, math.inf, "1", True, None, (1,), [1, 2]],
    "max_speed": [math.nan, -0.1, 1.1, "1", None],
    "temperature": [math.nan, math.inf, -0.1, "1", None],
}


@pytest.mark.parametrize(
    ("name", "value"), [(n, v) for n, values in BAD.items() for v in values if (n, v) != ("pos", None)]
)
def test_a_wrong_value_is_refused_on_one_line_and_nothing_is_written(name, value):
    model, robots = marked(3)
    model.step()
    before = model.state_hash()
    with pytest.raises(InvalidValueError, match="position" if name == "pos" else name) as caught:
        setattr(robots[1], name, value)
    assert "\n" not in str(caught.value)
    assert model.state_hash() == before
    assert not model.swarm.disturbed


def test_a_position_added_to_is_checked_before_anything_is_written():
    _, robots = marked(3)
    with pytest.raises(InvalidValueError):
        robots[1].position += (0, 1e6)
    assert robots[1].position.tolist() == [40, 50]
    robots[1].position += (1, 2)
    assert robots[1].position.tolist() == [41, 52]


def test_an_unknown_tendency_suggests_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'right'"):
        marked()[1][0].tendency = "rigth"


@pytest.mark.parametrize("name", ["radius", "command", "layer", "distance", "kind", "fire", "collided", "design"])
def test_what_only_the_engine_writes_cannot_be_set(name):
    with pytest.raises(AttributeError):
        setattr(marked()[1][0], name, 0)


@given(st.floats(-1e6, 1e6))
def test_headings_are_wrapped_between_minus_pi_and_pi(heading):
    _, robots = marked(1)
    robots[0].heading = heading
    assert -math.pi <= robots[0].heading < math.pi
    assert math.remainder(robots[0].heading - heading, 2 * math.pi) == pytest.approx(0, abs=1e-9)


def test_a_robot_that_is_moved_is_seen_at_its_new_place():
    model, robots = marked(2, RobotDesign(sensors=(ProximitySensor(range=80),)))
    model.step()
    robots[0].position, robots[0].heading = (200, 200), 0.0
    robots[1].position = (230, 200)
    model.sense()
    assert robots[0].distance.tolist() == pytest.approx([20])


def test_tendencies_are_about_half_left_and_as_asked_for_if_they_are():
    model = empty(4000, 4000)
    model.add_robots(blind(), 1000)
    assert abs(int((model.swarm.tendency > 0).sum()) - 500) < 80
    assert {r.tendency for r in model.add_robots(blind(), 5, tendency="right")} == {"right"}
    assert [r.tendency for r in model.add_robots(blind(), 2, tendency=["left", "right"])] == ["left", "right"]


def test_views_taken_before_rows_move_show_the_past_and_do_not_change():
    model, robots = marked(3)
    view = model.swarm.position
    robots[0].remove()
    assert view[:, 0].tolist() == [20, 40, 60]
    assert model.swarm.position[:, 0].tolist() == [40, 60]


def test_errors_of_handles_are_all_of_the_family():
    assert issubclass(RemovedRobotError, SwarmError)
