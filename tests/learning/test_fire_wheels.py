"""Robots that learn to fight fires by wheel speeds: what steps are worth, what one lesson changes, and policies."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, AGENT_FIRE, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, LearningError
from mesa_swarm.control import Subsumption
from mesa_swarm.fire import FireConstants
from mesa_swarm.learning import FireWheelPolicy, LearnFireWheels, Networks, SensorLayout
from mesa_swarm.learning.actions import ACTIONS
from mesa_swarm.learning.fire_wheels import AT_FIRE, COOLING, FREE, IN_HEAT, UNITS, shaped

SHAPING = (5.0, 3.0, 2.0, 7.0, 0.5, 4.0, 8.0)
LASTING = FireConstants(k1=1e-9, k2=1e-12, k3=0.0, k4=0.0, leave=1.0, join=0.0)
PREFIX = "0.LearnFireWheels"


@pytest.mark.parametrize(
    ("situation", "nearest", "before", "clearance", "worth"),
    [
        (AT_FIRE, 3.0, 4.0, np.inf, 5.0),
        (IN_HEAT, 3.0, 4.0, np.inf, -7.0),
        (COOLING, 20.0, 20.0, np.inf, 2.0),
        (COOLING, -1.0, 20.0, np.inf, 0.0),
        (FREE, 20.0, 21.0, np.inf, 3.0),
        (FREE, 20.0, -1.0, np.inf, 0.0),  # came into sight
        (FREE, -1.0, -1.0, np.inf, 0.5),
        (FREE, -1.0, -1.0, 8.0, 0.5),
        (FREE, -1.0, -1.0, 2.0, 0.5 + 4.0 * (2.0 / 8.0 - 1.0)),
        (AT_FIRE, 3.0, 4.0, 0.0, 1.0),
    ],
)
def test_steps_are_worth_what_is_documented(situation, nearest, before, clearance, worth):
    assert shaped(situation, nearest, before, before - nearest, 1.0, clearance, SHAPING) == pytest.approx(worth)


def world(layer, robots=4, seed=1, **options):
    model = SwarmModel(map="openspace_fire", rng=seed, **options)
    model.add_robots(AGENT_FIRE, robots)
    model.control = Subsumption(layer)
    return model


def networks_of(model):
    return [model.swarm.columns[f"{PREFIX}.{part}"] for part in ("inner", "inner_bias", "outer", "outer_bias")]


def values_of(policy, inputs):
    inner, bias, outer, outer_bias = policy.networks.weights
    return outer_bias + (outer * np.tanh(bias + np.einsum("i,aih->ah", inputs, inner))).sum(axis=1)


def test_one_lesson_moves_the_value_of_the_action_taken_towards_its_discounted_reward():
    layer = LearnFireWheels(hold=4, gamma=0.9, eta=1e-4, ahead=0.5, approach=0.0, near=0.0)
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT_FIRE, poses=[(400, 300, 0.0)])
    model.control = Subsumption(layer)
    model.run(4)
    inputs = model.swarm.columns[f"{PREFIX}.inputs"][0].copy()
    action = int(model.swarm.columns[f"{PREFIX}.action"][0])
    before = model.control.layers[0].policy()
    model.run(1)
    after = model.control.layers[0].policy()
    assert not inputs.any()  # nothing is seen or felt here
    reward = 0.5 * ACTIONS[action].mean() * sum(0.9**k for k in range(4))
    target = reward + 0.9**4 * values_of(before, inputs).max()
    change = values_of(after, inputs) - values_of(before, inputs)
    error = target - values_of(before, inputs)[action]
    hidden = np.tanh(before.networks.inner_bias[action])
    slope = 1 + (hidden**2).sum() + (before.networks.outer[action] ** 2 * (1 - hidden**2) ** 2).sum()
    assert change[action] == pytest.approx(1e-4 * error * slope, rel=1e-3)
    assert np.count_nonzero(change) == 1


def test_an_action_lasts_until_its_steps_are_over_or_the_situation_changes():
    model = world(LearnFireWheels(hold=7, first_temperature=1e6, beta=0.0), robots=10)
    commands, situations = [], []
    for _ in range(70):
        model.step()
        commands.append(model.swarm.command.copy())
        situations.append(model.swarm.columns[f"{PREFIX}.situation"].copy())
    changed = (np.diff(commands, axis=0) != 0).any(axis=2)
    ages = np.arange(1, 70)[:, None] % 7 == 0
    same = (np.array(situations) == situations[0]).all(axis=0)
    assert same.any()
    assert not changed[:, same][~np.broadcast_to(ages, changed.shape)[:, same]].any()
    assert changed[:, same].any()


def test_a_frozen_robot_takes_the_action_of_the_largest_value():
    networks = Networks(np.zeros((8, 32, UNITS)), np.zeros((8, UNITS)), np.zeros((8, UNITS)), np.arange(8.0))
    networks.outer_bias[6] = 9.0
    policy = FireWheelPolicy(sensors=SensorLayout.of(AGENT_FIRE), networks=networks, temperature=1e-3, steps=1)
    model = world(LearnFireWheels(start=policy, frozen=True)).run(3)
    assert (model.swarm.command == ACTIONS[6]).all()


def test_without_a_trained_start_it_cannot_be_frozen_and_other_sensors_are_refused():
    with pytest.raises(LearningError, match="is frozen and untrained"):
        LearnFireWheels(frozen=True)
    model = SwarmModel(map="original", rng=1)
    model.add_robots(AGENT9.with_proximity(range=20), 1)
    with pytest.raises(LearningError, match="the policy was trained with"):
        model.control = Subsumption(LearnFireWheels())


def test_what_is_no_policy_of_wheel_actions_is_refused():
    eyes, networks = SensorLayout.of(AGENT_FIRE), Networks.random(8, inputs=9, rng=np.random.default_rng(1))
    with pytest.raises(InvalidValueError, match="networks have the shape"):
        FireWheelPolicy(sensors=eyes, networks=networks)
    with pytest.raises(InvalidValueError, match="networks is 3"):
        FireWheelPolicy(sensors=eyes, networks=3)
    with pytest.raises(InvalidValueError, match="sensors is 3; expected SensorLayout"):
        FireWheelPolicy(sensors=3, networks=Networks.random(8, inputs=32, hidden=16, rng=np.random.default_rng(1)))
    with pytest.raises(InvalidValueError, match="start is 'mine'"):
        LearnFireWheels(start="mine")
