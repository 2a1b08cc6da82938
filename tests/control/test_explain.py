"""Explaining: which layer drove a robot, in every model, of every rule; and what is refused."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, disc
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, RemovedRobotError
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, VectorSum, behaviour
from mesa_swarm.control.arbiter import name_driver
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.robots.reasons import Moment, Reason
from support.explanations import AHEAD, explanation, first, watched
from support.scenes import ahead, blind, empty

# ---- custom rules, and no layer


def test_a_rule_of_ones_own_is_explained_by_its_readings():
    model = watched(ahead, design=AGENT3, obstacles=[AHEAD])
    why = explanation(model.run(1))
    assert (why.layer, why.sensors) == ("ahead", (0,))
    assert why.reason == "front sensor 10.0 (an obstacle)"


def test_the_reason_of_a_rule_whose_robot_sees_nothing():
    assert explanation(watched(ahead, design=AGENT3).run(1)).reason == "its sensors see nothing"
    assert explanation(watched(ahead, design=blind()).run(1)).reason == "its sensors see nothing"


def test_a_layer_of_ones_own_may_have_its_reason():
    class Loud(Explore):
        def reason(self, moment):
            assert isinstance(moment, Moment)
            return Reason("it likes to be heard")

    why = explanation(watched(Loud(name="Loud")).run(1))
    assert (why.layer, why.reason) == ("Loud", "it likes to be heard")


def test_the_explanation_where_no_layer_was_active():
    @behaviour
    def silent(me):
        return PASS if me.max_speed >= 0 else (0.0, 0.0)

    model = watched(silent)
    why = explanation(model.run(1))
    assert (why.layer, why.reason, why.sensors) == ("", "", ())
    assert str(why) == f"step 1: robot {first(model).unique_id} stays; no layer was active"


def test_a_design_with_fewer_sensors_than_others_is_explained_by_its_own():
    model = watched(ahead, design=AGENT3, obstacles=[AHEAD])
    model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    model.add_robots(blind(), poses=[(100, 250, 0.0)])
    whys = [model.explain(robot) for robot in model.run(1).robots]
    assert [why.reason for why in whys] == ["front sensor 10.0 (an obstacle)", *["its sensors see nothing"] * 2]


@pytest.mark.parametrize(
    ("left", "right", "words"),
    [
        (0, 0, "stays"),
        (0.7, 0.7, "goes ahead at 0.7"),
        (-1, -1, "backs up at 1"),
        (-0.5, 0.5, "turns left on the spot"),
        (0.5, -0.5, "turns right on the spot"),
        (0.2, 0.9, "turns left while moving"),
        (1, 0, "turns right while moving"),
    ],
)
def test_wheel_speeds_in_words(left, right, words):
    nothing = np.empty(0)
    moment = Moment(nothing, nothing, nothing, nothing, (-1, -1, -1), np.array([left, right]), True, {})
    assert moment.motion == words


def test_a_layer_s_index_is_described_by_its_name():
    control = Subsumption(Avoid(), Explore())
    assert [name_driver(control, index) for index in (1, -1, 7)] == ["Explore", "no layer", "unknown layer 7"]


# ---- every model


@pytest.mark.slow
@pytest.mark.parametrize("name", model_names())
def test_in_every_model_every_robot_can_be_explained_in_every_step(name):
    model = find_model(name)(rng=1)
    stored = model.watch(last=None)
    model.run(120)
    layers = {""} | {layer.name for layer in model.control.layers}
    for step in stored.steps[::7]:
        for row, robot in enumerate(model.robots):
            why = model.explain(robot, int(step))
            assert why.layer in layers
            assert (why.layer == "") == (stored.at(step)["layer"][row] < 0)
            assert set(why.sensors) <= set(np.flatnonzero(stored.at(step)["kind"][row] >= 0).tolist())
            assert len(str(why)) < 1500
            assert "\n" not in str(why)


# ---- wrong use


def test_a_step_in_the_past_is_explained_by_what_was_known_then():
    model = watched(Avoid(distance=15), Explore(), design=AGENT3, obstacles=[disc((230, 150), 5)])
    model.run(40)
    layers = [explanation(model, step).layer for step in range(1, 41)]
    assert layers[:5] == ["Explore"] * 5
    assert "Avoid" in layers


NOTHING = r"no steps are stored to explain; call model\.watch\(\) before"
COLUMNS = r"not stored: position, heading, command, d.*; add"


@pytest.mark.parametrize(("columns", "words"), [(None, NOTHING), (("layer",), COLUMNS)])
def test_where_nothing_is_stored_the_error_names_the_cure(columns, words):
    model = empty()
    model.add_robots(AGENT3, poses=[(200, 150, 0.0)])
    model.control = Subsumption(Explore())
    if columns:
        model.watch(columns=columns)
    model.run(2)
    with pytest.raises(InvalidValueError, match=words):
        model.explain(first(model))


@pytest.mark.parametrize("change", ["come", "go", "control", "nothing"])
def test_where_stored_steps_were_dropped_the_error_gives_the_reason(change):
    model = watched(Explore(), poses=[(200, 150, 0.0), (100, 100, 0.0)])
    if change != "nothing":
        model.run(2)
    if change == "come":
        model.add_robots(AGENT3, poses=[(300, 250, 0.0)])
    elif change == "go":
        model.robots[1].remove()
    elif change == "control":
        model.control = Subsumption(Avoid())
    words = r"no step is stored to explain: .* robots were added or removed, .* run the model on"
    with pytest.raises(InvalidValueError, match=words):
        model.explain(first(model))
    assert explanation(model.run(1)).step == model.steps


def test_an_explanation_is_plain_values_whatever_kind_of_number_the_step_is():
    model = watched(Explore()).run(20)
    for step in (None, 20, 20.0, np.int64(20)):
        why = explanation(model, step)
        assert str(why).startswith("step 20: ")
        assert json.loads(json.dumps(asdict(why)))["step"] == 20


@pytest.mark.parametrize("index", [1, 7])
def test_a_layer_that_writes_an_unknown_index_is_reported(index):
    unknown = index

    class Stray:
        name = "Stray"

        def bind(self, swarm, prefix, rng): ...

        def decide(self, senses, command, layer, index):
            layer[:] = unknown

    model = watched(Stray()).run(1)
    with pytest.raises(BehaviourError, match=rf"layer {index} drove robot \d+ in step 1, of 1 layers; a custom layer"):
        model.explain(first(model))


@pytest.mark.parametrize("step", [0, 3, "x", None])
def test_a_step_that_is_not_stored_is_refused(step):
    model = watched(Explore())
    if step is not None:
        model.run(2)
    with pytest.raises(InvalidValueError, match=r"is not stored|no step is stored|a whole number") as caught:
        model.explain(first(model), step)
    assert "\n" not in str(caught.value)


def test_other_objects_than_robots_of_this_model_are_refused():
    model, other = watched(Explore()).run(1), watched(Explore()).run(1)
    for wrong in (first(other), 0, None, "robot"):
        with pytest.raises(InvalidValueError, match="expected one of this model's robots"):
            model.explain(wrong)


def test_a_removed_robot_is_refused():
    model = watched(Explore(), poses=[(200, 150, 0.0), (100, 100, 0.0)]).run(1)
    robot = first(model)
    robot.remove()
    with pytest.raises(RemovedRobotError):
        model.explain(robot)


def test_the_robots_that_stay_are_not_mistaken_for_those_that_went():
    model = watched(Avoid(), Explore(), poses=[(200, 150, 0.0), (100, 100, 0.0)], obstacles=[AHEAD]).run(1)
    first(model).remove()
    with pytest.raises(InvalidValueError, match="no step is stored"):
        model.explain(first(model))
    assert explanation(model.run(1)).layer == "Explore"


def test_another_control_is_not_asked_about_steps_of_the_former():
    model = watched(Avoid(), Explore()).run(2)
    model.control = Subsumption(Explore(name="Other"))
    with pytest.raises(InvalidValueError, match="no step is stored"):
        explanation(model)
    assert explanation(model.run(1)).layer == "Other"


def test_without_control_there_is_nothing_to_explain():
    model = watched(Explore())
    model.control = None
    model.run(1)
    with pytest.raises(InvalidValueError, match=r"control is None, which explains nothing; set model\.control"):
        model.explain(first(model))


def test_under_a_sum_the_largest_share_is_reported_and_not_that_nothing_else_drives():
    model = empty()
    model.add_robots(AGENT9, poses=[(380, 150, 0.0)])
    model.control = VectorSum(Avoid(distance=40), Explore(), weights=(1, 2))
    model.watch()
    why = explanation(model.run(1))
    assert why.layer == "Explore"
    assert why.reason == "its share of the sum of all active layers is the largest"
