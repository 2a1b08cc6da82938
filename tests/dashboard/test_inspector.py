"""The inspector: it shows what a robot knew, and robots are moved only where there is room."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from mesa_swarm.dashboard.page.edits import apply_edit
from mesa_swarm.dashboard.page.navigation import query_of
from mesa_swarm.dashboard.page.session import MOST_WATCHED_BYTES, WATCHED, Session, watch_closely
from mesa_swarm.dashboard.run.inspector import Inspecting, Inspector, inspect
from mesa_swarm.learning import WireFittedQ
from mesa_swarm.learning.actions import ACTION_NAMES
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.q_learning import QLearning
from mesa_swarm.viewing.canvas_widget import Connection, SwarmCanvas


@pytest.fixture
def inspecting():
    """An inspector of a session in which the first robot is selected."""
    session = Session("fire_fighting")
    inspecting = Inspecting(Inspector(), session)
    session.select(session.model.robots[0].unique_id)
    yield inspecting
    inspecting.close()
    session.close()


def test_nothing_is_shown_before_a_robot_is_selected(inspecting):
    inspecting.session.select(None)
    assert inspecting.inspector.inspected == {}
    assert not inspecting.inspector.editable


def test_before_the_first_step_there_are_readings_and_no_reason(inspecting):
    inspected = inspecting.inspector.inspected
    assert (inspected["when"], inspected["reason"], inspected["known"]) == ("before the first step", "", True)
    assert len(inspected["sensors"]) == len(inspecting.session.model.robots[0].design.proximity)


def test_it_shows_the_explanation(inspecting):
    session = inspecting.session
    for _ in range(20):
        session.step()
        robot, inspected = session.model.robots[0], inspecting.inspector.inspected
        why = session.model.explain(robot)
        assert (inspected["layer"], inspected["does"], inspected["reason"]) == (why.layer, why.does, why.reason)
        assert [k for k, one in enumerate(inspected["sensors"]) if one["triggered"]] == sorted(why.sensors)


def test_of_an_earlier_step_the_readings_of_that_step_are_shown(inspecting):
    session, seen = inspecting.session, {}
    for step in range(1, 6):
        session.step()
        seen[step] = inspecting.inspector.inspected
    session.back()
    session.back()
    inspected = inspecting.inspector.inspected
    assert inspected["when"] == "step 3"
    assert (inspected["sensors"], inspected["reason"]) == (seen[3]["sensors"], seen[3]["reason"])
    assert inspected["pose"] == seen[3]["pose"]
    assert not inspected["present"]
    assert not inspecting.inspector.editable


def test_of_a_step_that_is_no_longer_stored_there_is_only_a_message():
    model = CollisionAvoidance(rng=1)
    model.watch(last=5, columns=WATCHED)
    inspected = inspect(model.run(20), model.robots[0], 3)
    assert inspected["when"] == "step 3 is no longer stored; readings are available for steps 16 to 20"
    assert not inspected["known"]


def test_what_is_kept_is_bounded_for_large_swarms():
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=[(400, 300, 0.0)] * 10_000)
    watch_closely(model)
    a_step = sum(model.swarm.columns[name].nbytes for name in WATCHED)
    assert model.watched._stored.maxlen * a_step <= MOST_WATCHED_BYTES


def test_watching_does_not_change_a_run():
    watched, alone = Session("fire_fighting", seed=4, steps=60).model, FireFighting(rng=4).run(60)
    assert watched.state_hash() == alone.state_hash()


def test_messages_are_shown():
    model = FireFighting(communication="goal", communication_range=1000.0, rng=2)
    watch_closely(model)
    while not np.isfinite(model.swarm.heard_goal).any():
        model.step()
    robot = model.robots[int(np.flatnonzero(np.isfinite(model.swarm.heard_goal[:, 0]))[0])]
    facts = dict(inspect(model, robot, model.steps)["facts"])
    x, y = robot.swarm.heard_goal[robot.row]
    assert facts["Hears"] == f"a goal {math.hypot(x, y):.0f} away at {math.degrees(math.atan2(y, x)):+.0f} degrees"
    assert facts["Heat"].startswith(f"{robot.temperature:.1f}")


@pytest.mark.parametrize("shared", ["no", "yes"])
def test_values_of_actions_are_those_of_the_policy_that_was_learned(shared):
    model = QLearning(n_robots=3, rng=1, shared=shared)
    watch_closely(model)
    assert inspect(model, model.robots[0], 0)["worth"] == []
    model.run(30)
    for row, robot in enumerate(model.robots):
        worth = inspect(model, robot, 30)["worth"]
        readings, kinds = model.watched["distance"][-1], model.watched["kind"][-1]
        policy = model.learner.policy()
        expected = policy.values(readings, kinds)[row]
        assert [name for name, _ in worth] == list(ACTION_NAMES)
        assert [value for _, value in worth] == pytest.approx(expected)


def test_wires_are_shown_with_their_values():
    model = SwarmModel(map="original", rng=1)
    model.add_robots(AGENT9, 2)
    layer = WireFittedQ()
    model.control = Subsumption(layer)
    model.watch(last=2)
    layer = model.control.layers[0]
    assert layer.worth(0) == []
    model.run(20)
    actions, values = layer.policy().proposals(model.watched["distance"][-1], model.watched["kind"][-1])
    for row in range(2):
        worth = layer.worth(row)
        assert [value for _, value in worth] == pytest.approx(values[row])
        assert worth[0][0] == f"wheels {actions[row, 0, 0]:+.2f} {actions[row, 0, 1]:+.2f}"


def test_a_moved_robot_is_in_the_link_to_the_step(inspecting):
    session = inspecting.session
    session.step()
    assert "step=1" in query_of(session)
    before = session.past.shown
    inspecting.act({"do": "move", "value": {"x": "300", "y": " 420.5 ", "heading": "-90"}})
    assert inspecting.inspector.fault == ""
    robot = session.model.robots[0]
    assert robot.position.tolist() == [300, 420.5]
    assert robot.heading == pytest.approx(-math.pi / 2)
    assert inspecting.inspector.inspected["pose"] == {"x": 300.0, "y": 420.5, "heading": -90.0}
    assert session.past.shown.step == 1
    assert session.past.shown.content != before.content
    assert session.past.shown.fingerprint != before.fingerprint
    number = robot.unique_id
    assert query_of(session).endswith(f"edits=1%2Cmove%2C{number}%2C300%2C420.5%2C-1.5707963267948966&step=1")
    session.reset()
    assert session.straight


@pytest.mark.parametrize(
    ("pose", "fault"),
    [
        ({"x": "2", "y": "300", "heading": "0"}, "an obstacle by 5; choose"),
        ({"x": "-50", "y": "300", "heading": "0"}, "the border of the map by"),
        ({"x": "abc", "y": "300", "heading": "0"}, "x is 'abc'; expected a number"),
        ({"x": "nan", "y": "300", "heading": "0"}, "x is nan; expected"),
        ({"y": "300", "heading": "0"}, "x is None; expected a number"),
        ({"x": "300", "y": "420", "heading": "1e30"}, "heading is"),
    ],
)
def test_an_impossible_place_is_reported_in_one_line_and_nothing_moves(inspecting, pose, fault):
    before = inspecting.session.model.state_hash()
    inspecting.act({"do": "move", "value": pose})
    assert fault in inspecting.inspector.fault
    assert "\n" not in inspecting.inspector.fault
    assert inspecting.session.model.state_hash() == before
    assert inspecting.session.straight


def test_robots_fires_obstacles_and_loads_are_in_the_way():
    model = SwarmModel(map="openspace", rng=1)
    one, other = model.add_robots(AGENT9, poses=[(100, 100, 0), (200, 100, 0)])
    model.add_obstacle(disc((300, 300), 20))
    model.add_obstacle(disc((600, 300), 20, contact=False))
    model.add_fire((500, 400), radius=10)
    model.add_load(disc((400, 200), 15), resistance=1)
    for place, what in (
        ((209, 100), f"robot {other.unique_id} by 1"),
        ((300, 300), "an obstacle by 25"),
        ((514, 400), "fire 1 by 1"),
        ((400, 181), "a load by 1"),
    ):
        with pytest.raises(InvalidValueError, match=what):
            apply_edit(model, "move", (one.unique_id, *place, 0))
    apply_edit(model, "move", (one.unique_id, 600, 300, 0))
    apply_edit(model, "move", (one.unique_id, 600, 300, math.pi / 4))
    assert one.heading == pytest.approx(math.pi / 4)
    model.step()
    assert one.position.tolist() == [600, 300]


def test_no_robot_is_moved_while_it_is_played_or_the_past_is_looked_at(inspecting):
    session, pose = inspecting.session, {"x": "300", "y": "420", "heading": "0"}
    session.step()
    session.step()
    session.back()
    inspecting.act({"do": "move", "value": pose})
    assert "pause first" in inspecting.inspector.fault
    session.look_now()
    session.play()
    inspecting.act({"do": "move", "value": pose})
    session.pause()
    assert session.straight


def test_one_goes_from_robot_to_robot_and_the_canvas_follows(inspecting):
    session, canvas = inspecting.session, SwarmCanvas()
    connection = Connection(canvas, session)
    ids = [robot.unique_id for robot in session.model.robots]
    assert canvas.selected == ids[0]
    inspecting.act({"do": "next"})
    assert canvas.selected == inspecting.inspector.inspected["id"] == ids[1]
    inspecting.act({"do": "previous"})
    inspecting.act({"do": "previous"})
    assert canvas.selected == ids[-1]
    canvas.selected = ids[3]
    assert inspecting.inspector.inspected["id"] == ids[3]
    inspecting.act({"do": "select", "value": 99_999})
    assert "unknown robot 99999" in inspecting.inspector.fault
    inspecting.act({"do": "select", "value": None})
    assert canvas.selected is None
    inspecting.act({"do": "next"})
    assert canvas.selected == ids[0]
    connection.close()


def test_a_removed_robot_is_not_shown(inspecting):
    session = inspecting.session
    session.model.remove_robots([session.model.robots[0]])
    session.step()
    assert inspecting.inspector.inspected == {}
