"""The swarm's columns without a model: what a new robot has, and what stays when rows, layers and bodies go."""

import copy
import math
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, AGENT_FIRE
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.robots.robot import remove_together
from mesa_swarm.robots.snapshots import DECISIONS, HEAT, Snapshots, check_watched
from mesa_swarm.robots.swarm import COLUMNS, LASTING, MESSAGES, Swarm
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.statics import BORDER, FIRE, OBSTACLE, ROBOT
from support.scenes import empty

# What a robot has that has not looked, decided or met anything yet.
NOT_A_NUMBER = {"goal", "sent_goal", "heard_from", "heard_goal"}
NOTHING_YET = {
    "group",
    "distance",
    "kind",
    "layer",
    "task",
    "heard_layer",
    "heard_task",
    "contact_kind",
    "contact_index",
    "fire",
}


def swarm_of(*designs):
    """Return a swarm of one robot of each of these designs, with handles that know only their rows."""
    swarm = Swarm()
    for k, design in enumerate(designs):
        (row,) = swarm.add(design, np.array([[10.0 * k, 5.0]]), np.array([0.25 * k]), np.array([-1.0]))
        swarm.agents.append(SimpleNamespace(row=row, unique_id=100 + k))
    return swarm


def test_a_new_robot_has_the_values_of_one_that_has_done_nothing():
    swarm = swarm_of(AGENT9, AGENT_FIRE)
    given = {"number", "design", "position", "heading", "radius", "max_speed", "tendency"}
    for name in set(COLUMNS) - given:
        expected = math.nan if name in NOT_A_NUMBER else (-1 if name in NOTHING_YET else 0)
        np.testing.assert_array_equal(swarm.columns[name], np.full_like(swarm.columns[name], expected), name)
    assert swarm.number.tolist() == [0, 1]
    assert swarm.design.tolist() == [0, 1]
    assert swarm.position.tolist() == [[0.0, 5.0], [10.0, 5.0]]
    assert (swarm.heading.tolist(), swarm.tendency.tolist()) == ([0.0, 0.25], [-1.0, -1.0])
    assert (swarm.radius.tolist(), swarm.max_speed.tolist()) == ([5.0, 5.0], [1.0, 1.0])


def test_columns_have_two_numbers_for_points_and_pairs_of_wheels_and_one_for_each_sensor():
    swarm = swarm_of(AGENT9, AGENT_FIRE, AGENT3)
    pairs = NOT_A_NUMBER | {"position", "command", "last_command", "slip", "contact_normal"}
    sensors = {"distance": 9, "kind": 9, "error": 9, "radiation": 1, "line": 0}
    for name, column in swarm.columns.items():
        width = (2,) if name in pairs else ((sensors[name],) if name in sensors else ())
        assert column.shape == (3, *width), name


def test_equal_designs_are_stored_once_and_numbers_are_never_given_twice():
    swarm = swarm_of(AGENT9, AGENT3, AGENT9)
    assert swarm.designs == (AGENT9, AGENT3)
    assert swarm.design.tolist() == [0, 1, 0]
    swarm.remove([2])
    (row,) = swarm.add(AGENT3, np.array([[1.0, 1.0]]), np.zeros(1), np.ones(1))
    assert (row, swarm.number.tolist()) == (2, [0, 1, 3])


def test_robots_added_together_get_the_next_rows_and_numbers_in_their_order():
    swarm = swarm_of(AGENT9)
    rows = swarm.add(AGENT3, np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0.5, 1.5]), np.array([1.0, -1.0]))
    assert rows.tolist() == swarm.number[1:].tolist() == [1, 2]
    assert swarm.position[1:].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert (swarm.heading[1:].tolist(), swarm.tendency[1:].tolist()) == ([0.5, 1.5], [1.0, -1.0])


def test_a_swarm_is_printed_with_its_size_and_designs():
    assert repr(Swarm()) == "<Swarm of 0 robots>"
    assert repr(swarm_of(AGENT9, AGENT3)) == "<Swarm of 2 robots (AGENT9, AGENT3)>"


def test_a_column_cannot_be_replaced_and_other_attributes_can():
    swarm = swarm_of(AGENT9)
    with pytest.raises(InvalidValueError, match=r"^swarm.heading cannot be replaced; change a robot by its handle"):
        swarm.heading = np.zeros(1)
    swarm.disturbed = True
    assert swarm.disturbed


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda swarm: pickle.loads(pickle.dumps(swarm))])
def test_a_copy_has_read_only_views_of_its_own_columns(duplicate):
    swarm = swarm_of(AGENT9, AGENT3)
    twin = duplicate(swarm)
    twin.columns["heading"][:] = 2.0
    assert twin.heading.tolist() == [2.0, 2.0]
    assert swarm.heading.tolist() == [0.0, 0.25]
    assert not twin.heading.flags.writeable


@given(st.sets(st.integers(0, 5), min_size=1))
def test_removed_rows_go_and_all_others_move_up_in_order(gone):
    swarm = swarm_of(*[AGENT9, AGENT3] * 3)
    agents, version = list(swarm.agents), swarm.version
    swarm.remove(sorted(gone))
    left = [row for row in range(6) if row not in gone]
    assert swarm.number.tolist() == left
    assert swarm.position[:, 0].tolist() == [10.0 * row for row in left]
    assert [agents[row].row for row in left] == list(range(len(left))) == [agent.row for agent in swarm.agents]
    assert {agents[row].row for row in gone} == {-1}
    assert swarm.version > version


@given(
    st.lists(st.tuples(st.sampled_from([OBSTACLE, ROBOT, FIRE]), st.integers(-1, 4)), min_size=6, max_size=6),
    st.sampled_from([OBSTACLE, ROBOT, FIRE]),
    st.integers(0, 4),
)
def test_what_robots_met_is_renumbered_when_a_body_of_that_kind_goes(met, kind, index):
    swarm = swarm_of(*[AGENT3] * 6)
    swarm.columns["contact_kind"][:], swarm.columns["contact_index"][:] = zip(*met, strict=True)
    swarm.forget_contacts(kind, np.array([index]))
    bodies = [b for b in range(5) if b != index]
    for (what, which), now in zip(met, swarm.contact_index.tolist(), strict=True):
        expected = which if what != kind or which < 0 else (BORDER if which == index else bodies.index(which))
        assert now == expected
    assert swarm.contact_kind.tolist() == [what for what, _ in met]


def test_robots_that_met_one_of_several_that_go_met_nothing_that_is_there_and_the_others_keep_theirs():
    swarm = swarm_of(*[AGENT3] * 5)
    swarm.columns["contact_kind"][:] = ROBOT
    swarm.columns["contact_index"][:] = [4, 3, 1, 2, 0]
    swarm.remove([1, 3])
    assert swarm.contact_index.tolist() == [2, BORDER, 0]


def test_memories_of_layers_go_with_the_layers_and_those_of_bodies_with_the_bodies():
    swarm = swarm_of(AGENT9, AGENT3)
    swarm.remember("layer.count", (), np.int64, 7)[0] = 8
    swarm.remember(LASTING + "wear", ("proximity", 3), np.float64, 0.5)[1] = 2.0
    assert swarm.remember("layer.count", (), np.int64, 0).tolist() == [8, 7]
    assert swarm.columns[LASTING + "wear"].shape == (2, 9, 3)
    swarm.add(AGENT3, np.zeros((1, 2)), np.zeros(1), np.ones(1))
    assert swarm.columns["layer.count"].tolist() == [8, 7, 7]
    assert swarm.columns[LASTING + "wear"][:, 0, 0].tolist() == [0.5, 2.0, 0.5]
    version = swarm.version
    swarm.forget()
    assert set(swarm.columns) == {*COLUMNS, LASTING + "wear"}
    assert swarm.version > version
    version = swarm.version
    swarm.remember("layer.count", (), np.int64, 1)
    swarm.drop_body_columns()
    assert set(swarm.columns) == {*COLUMNS, "layer.count"}
    assert swarm.version > version + 1
    assert swarm.columns["layer.count"].tolist() == [1, 1, 1]


def test_cleared_messages_are_those_of_a_new_robot_and_nothing_else_is_cleared():
    swarm = swarm_of(AGENT9, AGENT_FIRE)
    for column in swarm.columns.values():
        column.fill(1)
    swarm.clear_messages()
    new = swarm_of(AGENT9, AGENT_FIRE)
    for name, column in swarm.columns.items():
        expected = new.columns[name] if name in MESSAGES else np.ones_like(column)
        np.testing.assert_array_equal(column, expected, name)


def test_former_names_of_methods_do_the_same_and_are_deprecated():
    swarm = swarm_of(AGENT9)
    swarm.remember(LASTING + "wear", (), np.float64, 0.5)
    swarm.columns["task"].fill(3)
    for former, now in ((swarm.shed, "drop_body_columns"), (swarm.hush, "clear_messages")):
        with pytest.warns(DeprecationWarning, match=f"is called {now} now") as caught:
            former()
        assert caught[0].filename == __file__
    assert set(swarm.columns) == set(COLUMNS)
    assert swarm.task.tolist() == [-1]


# ---- handles


SCALARS = {"layer": 7, "task": 6, "fire": 5, "heat": 0.5, "temperature": 2.5, "heading": 1.5, "radius": 4.0}


def test_a_handle_reads_its_own_row():
    model = empty()
    robots = model.add_robots(AGENT_FIRE, poses=[(50 + 20 * k, 50, 0.0) for k in range(3)])
    columns = model.swarm.columns
    for k, (name, value) in enumerate(SCALARS.items()):
        columns[name][:] = [k, value, k + 1]
        assert getattr(robots[1], name) == value
    for name in ("hot", "collided"):
        columns[name][:] = [False, True, False]
        assert [getattr(robot, name) for robot in robots] == [False, True, False]
    for name in ("position", "command", "goal", "slip", "distance", "kind", "radiation", "line"):
        columns[name][:] = np.arange(columns[name].size).reshape(columns[name].shape) % 2
        got = getattr(robots[1], name)
        assert got.tolist() == columns[name][1].tolist()
        assert not np.shares_memory(got, columns[name])


def test_a_handle_has_a_side_to_turn_to():
    model = empty()
    robots = model.add_robots(AGENT3, poses=[(50 + 20 * k, 50, 0.0) for k in range(2)], tendency=["left", "right"])
    assert model.swarm.tendency.tolist() == [1.0, -1.0]
    assert [robot.tendency for robot in robots] == ["left", "right"]
    robots[0].tendency = "right"
    robots[1].tendency = "left"
    assert model.swarm.tendency.tolist() == [-1.0, 1.0]
    assert model.swarm.disturbed


def test_speed_and_heat_may_be_set_from_nothing_to_the_most_that_there_is():
    (robot,) = empty().add_robots(AGENT3, poses=[(50, 50, 0.0)])
    for value in (0.0, AGENT3.max_speed):
        robot.max_speed = value
        assert robot.max_speed == value
    for value in (0.0, 1e12):
        robot.temperature = value
        assert robot.temperature == value


def test_to_take_out_no_robots_changes_nothing():
    model = empty()
    model.add_robots(AGENT3, poses=[(50, 50, 0.0)])
    before = model.state_hash()
    remove_together([])
    assert model.state_hash() == before


def test_a_handle_is_printed_with_its_pose_or_as_removed():
    robots = empty().add_robots(AGENT3, poses=[(50.123, 60.456, 0.789), (100, 100, 0.0)])
    assert repr(robots[0]) == "<Robot 1 at (50.12, 60.46), heading 0.79>"
    robots[0].remove()
    assert repr(robots[0]) == "<Robot 1, removed>"
    assert repr(robots[1]) == "<Robot 2 at (100.0, 100.0), heading 0.0>"


# ---- snapshots


def test_snapshots_store_every_step_of_the_decisions_unless_limited():
    swarm = swarm_of(AGENT9)
    stored, last = Snapshots(swarm), Snapshots(swarm, last=1, every=4, columns=("heading",))
    assert (stored.columns, stored.every, last.every) == (DECISIONS, 1, 4)
    for step in (3, 5, 6):
        swarm.columns["heading"][:] = step
        stored.append(step)
        last.append(step)
    assert (stored.steps.tolist(), last.steps.tolist()) == ([3, 5, 6], [6])
    assert stored["heading"].tolist() == [[3.0], [5.0], [6.0]]
    assert stored.at(5)["heading"].tolist() == [5.0]
    assert list(last.at(6)) == ["heading"]


def test_a_step_stored_twice_is_read_as_it_was_the_second_time():
    swarm = swarm_of(AGENT9)
    stored = Snapshots(swarm)
    for heading in (1.0, 2.0):
        swarm.columns["heading"][:] = heading
        stored.append(4)
    assert stored.at(4)["heading"].tolist() == [2.0]


def test_noted_heat_is_stored_once_and_later_steps_have_their_own():
    swarm = swarm_of(AGENT_FIRE)
    stored = Snapshots(swarm, columns=("heading", *HEAT))
    stored.note()
    for name in ("heading", *HEAT):
        swarm.columns[name][:] = 1
    stored.append(1)
    stored.append(2)
    first, second = stored.at(1), stored.at(2)
    assert {name: first[name].tolist() for name in HEAT} == {**{name: [0] for name in HEAT}, "fire": [-1]}
    assert first["heading"].tolist() == [1.0]
    assert {name: second[name].tolist() for name in HEAT} == {name: [1] for name in HEAT}


def test_other_robots_drop_what_is_stored_and_other_columns_of_the_same_robots_do_not():
    swarm = swarm_of(AGENT9, AGENT9)
    stored = Snapshots(swarm)
    stored.append(1)
    swarm.remember("layer.count", (), np.int64, 0)
    assert stored.steps.tolist() == [1]
    swarm.remove([0])
    assert len(stored) == 0
    stored.append(2)
    assert stored.steps.tolist() == [2]
    stored.forget()
    assert stored["position"].shape == (0, 1, 2)


def test_an_unknown_column_or_step_is_refused():
    stored = Snapshots(swarm_of(AGENT9), columns=("heading",))
    with pytest.raises(UnknownNameError, match="unknown watched column 'position'"):
        stored["position"]
    with pytest.raises(InvalidValueError, match=r"^step 1 is not stored; none are stored yet"):
        stored.at(1)
    with pytest.raises(InvalidValueError, match=r"^columns is "):
        Snapshots(swarm_of(AGENT9), columns=("heading", 5))


def test_what_a_purpose_needs_is_checked_in_one_sentence():
    with pytest.raises(InvalidValueError, match=r"^no steps are stored to draw; call model.watch\(\) before"):
        check_watched(None, ("heading",), "draw")
    stored = Snapshots(swarm_of(AGENT9), columns=("heading", "layer"))
    with pytest.raises(InvalidValueError, match=r"^columns needed to draw are not stored: position, kind; add them"):
        check_watched(stored, ("position", "heading", "kind"), "draw")
    with pytest.raises(InvalidValueError, match=r"^no step is stored to draw: none was taken since"):
        check_watched(stored, ("heading",), "draw")
    stored.append(1)
    assert check_watched(stored, ("heading",), "draw") is stored


def test_a_dropped_column_can_no_longer_be_read():
    swarm = Swarm()
    swarm.remember("0.X.turn", (), np.float64, 0.0)
    swarm.remember("body.worn", (), np.float64, 0.0)
    swarm.forget()
    assert not hasattr(swarm, "0.X.turn")
    swarm.drop_body_columns()
    assert not hasattr(swarm, "body.worn")


def test_a_pickled_swarm_holds_every_column_once():
    swarm = SwarmModel(rng=1).swarm
    swarm.remember("0.X.many", (10_000,), np.float64, 0.0)
    swarm._resize(np.arange(0), 100)
    assert len(pickle.dumps(swarm)) < 1.2 * sum(column.nbytes for column in swarm.columns.values())


def test_a_column_is_an_array_or_does_not_exist():
    assert not set(COLUMNS) & set(vars(Swarm))
