"""Respond: which robots go where, and what custom rules hear."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT_FIRE, Radio
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import PASS, Avoid, Respond, Subsumption, behaviour
from mesa_swarm.control.layer import Senses
from mesa_swarm.fire import FightFire
from support.scenes import blind, circle, empty


@behaviour
def still(me, never=0.0):
    """Stand."""
    return PASS if never > 0.0 else (0.0, 0.0)


def calling(*places, to="state", **options):
    """Return a model with a robot that looks along +x at (200, 150), called from these places by beacons."""
    model = empty(communication=Radio(range=150, beacons=places))
    model.add_robots(blind(), poses=[(200, 150, 0.0)])
    model.control = Subsumption(Respond(to=to, **options), still)
    return model.run(1)


@pytest.mark.parametrize(
    ("place", "command"),
    [((300, 150), [1, 1]), ((200, 250), [-1, 1]), ((200, 50), [1, -1]), ((280, 155), [1, 1]), ((100, 150), [-1, 1])],
    ids=["ahead", "left", "right", "nearly ahead", "behind"],
)
def test_a_robot_goes_straight_to_what_is_ahead_and_turns_on_the_spot_to_what_is_not(place, command):
    model = calling(place, to="goal")
    assert model.swarm.layer.tolist() == [0]
    sign = -1 if place == (100, 150) and model.swarm.command[0, 0] > 0 else 1
    assert model.swarm.command[0].tolist() == [sign * c for c in command]


def test_a_robot_that_is_near_or_hears_nothing_is_left_to_the_layers_below():
    assert calling((259, 150), to="goal").swarm.layer.tolist() == [1]
    assert calling((261, 150), to="goal").swarm.layer.tolist() == [0]
    assert calling((261, 150), to="goal", near=62).swarm.layer.tolist() == [1]
    assert calling(to="goal").swarm.layer.tolist() == [1]


def test_to_state_goals_are_nothing():
    assert calling((300, 150), to="state").swarm.layer.tolist() == [1]


def called_to_a_fire(to, below=still):
    """Return a model in which a robot fights a fire and another looks away from it, too far to see it."""
    model = empty(communication=Radio(range=200, state=to == "state", goal=to == "goal"))
    model.add_fire((100, 150), radius=30)
    poses = [(136, 150, math.pi), (270, 130, 0.0)]
    model.add_robots(AGENT_FIRE, poses=poses)
    model.control = Subsumption(Avoid(fires="never"), FightFire(strategy="B"), Respond(to=to), below)
    return model


@pytest.mark.slow
@pytest.mark.parametrize("to", ["state", "goal"])
def test_a_robot_that_is_called_arrives_at_the_fire_and_fights_it(to):
    model = called_to_a_fire(to, circle(left=1.0))
    fought = set()
    for _ in range(400):
        fought |= set(np.flatnonzero(model.run(1).swarm.fire >= 0).tolist())
    assert fought == {0, 1}
    silent = called_to_a_fire(to)
    silent.communication = None
    assert silent.run(400).swarm.position[1].tolist() == [270, 130]


def test_a_robot_that_is_too_hot_or_fights_does_not_respond():
    model = called_to_a_fire("goal").run(3)
    assert model.swarm.layer.tolist() == [1, 2]
    assert model.swarm.fire[0] == 0
    for name, value, index in (("hot", True, 1), ("fire", 0, 1)):
        column = model.swarm.columns[name]
        before, column[index] = column[index], value
        layer = np.full(2, -1)
        Respond(to="goal").decide(Senses.of(model.swarm), np.zeros((2, 2)), layer, 0)
        assert layer[index] == -1
        column[index] = before


def test_a_rule_of_ones_own_hears_states_and_goals():
    @behaviour
    def follows(me, close=20.0):
        if me.heard_task < 0 or me.heard_layer != 1:
            return PASS
        if math.isnan(me.goal_x) or math.hypot(me.heard_x, me.heard_y) < close:
            return 0.0, 0.0
        return (-0.1, 0.1) if me.goal_y > 0.0 else (0.1, -0.1)

    model = empty(communication=Radio())
    model.add_fire((100, 150), radius=30)
    model.add_robots(AGENT_FIRE, poses=[(136, 150, math.pi), (200, 150, math.pi / 2)])
    model.control = Subsumption(follows, FightFire(strategy="B"), still)
    model.run(3)
    assert model.swarm.layer.tolist() == [1, 0]
    assert model.swarm.command[1].tolist() == [-0.1, 0.1]


@pytest.mark.parametrize("options", [{"near": -1}, {"near": math.nan}, {"critical_angle_degrees": 181}])
def test_a_wrong_parameter_is_refused(options):
    with pytest.raises(InvalidValueError, match=next(iter(options))):
        Respond(**options)


def test_an_unknown_call_is_refused():
    with pytest.raises(UnknownNameError, match="did you mean 'state'"):
        Respond(to="stat")
