"""Policies: actions, sets of weights, inputs and outputs of a layer; what is refused, in one line."""

from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, LearningError, SwarmError
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.learning import (
    HebbianLearning,
    PolicyLayer,
    QLearning,
    QPolicy,
    WireFittedQ,
)
from mesa_swarm.learning.actions import ACTIONS
from support.q_learners import driven, learned, trained


def test_a_policy_is_what_the_robots_learned_and_does_not_change_with_them():
    model = trained()
    policy = learned(model, collisions=0.5)
    before = policy.networks.inner.copy()
    model.run(20)
    assert (policy.networks.inner == before).all()
    assert (policy.copies, policy.steps) == (3, 3 * 29)
    assert {"reward": "b", "collisions": 0.5, "robots": 3}.items() <= policy.training.items()


def test_without_chances_it_does_what_is_worth_most(policy):
    readings, kinds = np.full((3, 9), -1.0), np.full((3, 9), -1)
    assert (policy.act(readings, kinds) == ACTIONS[policy.values(readings, kinds).argmax(axis=1)]).all()
    tried = {tuple(policy.act(readings, kinds, np.full(3, c))[0]) for c in np.linspace(0, 0.999, 50)}
    assert len(tried) > 1


def test_a_layer_drives_as_the_frozen_learner_does(policy):
    # Of one name, they draw the same chances.
    learner = driven(QLearning(start=policy, frozen=True, name="same"))
    layer = driven(PolicyLayer(policy=policy, name="same"))
    commands = [np.array([model.run(1).swarm.command.copy() for _ in range(40)]) for model in (learner, layer)]
    assert len(np.unique(commands[0].reshape(-1, 2), axis=0)) > 4
    assert (commands[0] == commands[1]).all()


def test_a_greedy_layer_drives_as_its_policy_holds_best(policy):
    model = driven(PolicyLayer(policy=policy, greedy=True)).run(1)
    wanted = policy.act(model.swarm.distance, model.swarm.kind)
    assert (model.swarm.command == wanted * AGENT9.max_speed).all()


def test_a_layer_leaves_robots_to_layers_above_and_explains_why_it_drove(policy):
    model = SwarmModel(map="original", rng=1)
    model.add_robots(AGENT9, 10)
    model.control = Subsumption(Avoid(distance=20), PolicyLayer(policy=policy))
    model.watch()
    model.run(200)
    assert 0 < model.watched["layer"].mean() < 1
    for robot in model.robots:
        assert len(str(model.explain(robot))) < 1500


class Own:
    """A custom policy with no more than is needed to act."""

    steps = 1

    def __init__(self, returns, sensors):
        self.returns, self.sensors = returns, sensors

    def act(self, readings, kinds, chance=None):
        return self.returns(len(readings))


def moved_by(returns, policy, robots=50):
    return driven(PolicyLayer(policy=Own(returns, policy.sensors)), robots=robots).run(2).swarm.command


@pytest.mark.parametrize(
    "returns",
    [
        lambda n: np.ones((1, 2)),
        lambda n: np.ones((n, 3)),
        lambda n: np.ones(2),
        lambda n: np.ones((n, 1)),
        lambda n: [[1.0, 1.0]] * (n - 1),
        lambda n: [[1.0, "fast"]] * n,
        lambda n: [[1.0]] + [[1.0, 1.0]] * (n - 1),
        lambda n: None,
        lambda n: np.ones((n, 2), complex),
        lambda n: np.full((n, 2), np.nan),
        lambda n: [[1.0, 1.0]] * (n - 1) + [[1.0, -np.inf]],
    ],
)
def test_what_a_policy_returns_is_refused_unless_it_is_two_finite_numbers_a_robot(policy, returns):
    with pytest.raises(BehaviourError, match=r"^Policy: its policy returned .*; expected .* \(50, 2\)") as caught:
        moved_by(returns, policy)
    assert "\n" not in str(caught.value)


def test_a_policy_may_return_lists_whole_numbers_and_views(policy):
    wanted = moved_by(lambda n: np.ones((n, 2)), policy)
    assert (wanted == AGENT9.max_speed).all()
    for returns in (
        lambda n: [[1, 1]] * n,
        lambda n: np.ones((n, 2), np.int8),
        lambda n: np.ones((2, n)).T,
        lambda n: np.ones((n, 4), np.float32)[:, ::2],
    ):
        assert (moved_by(returns, policy) == wanted).all()


@pytest.mark.parametrize("options", [{}, {"frozen": True}, {"self_adjusting": True, "frozen": True}])
def test_robots_that_start_with_a_policy_begin_at_its_temperature(options):
    policy = learned(trained(steps=100, beta=0.02))
    assert 0.2 < policy.temperature < 0.4
    assert driven(QLearning(start=policy, **options)).control.layers[0].temperature.tolist() == [policy.temperature] * 3
    hot = driven(QLearning(start=policy, first_temperature=2.5, **options))
    assert hot.control.layers[0].temperature.tolist() == [2.5] * 3


def test_self_adjusting_robots_that_start_with_a_cool_policy_still_heat_up_when_they_bump(policy):
    model = driven(QLearning(start=replace(policy, temperature=0.2), self_adjusting=True, bump_window=1))
    model.run(1)
    model.swarm.columns["0.QLearning.bumps"][:] = 1.0
    assert model.control.layers[0].temperature.max() <= 1.0
    layer = model.control.layers[0]
    layer.bump_window = 1e9
    model.step()
    assert layer.temperature == pytest.approx([1.0] * 3)


def test_one_robots_knowledge_can_be_shared_with_all(policy):
    model = driven(QLearning(start=policy.of_robot(1), frozen=True), robots=5).run(1)
    networks = learned(model).networks.inner.reshape(5, 8, 9, 18)
    assert (networks == policy.networks.inner[8:16]).all()


@pytest.mark.parametrize("chance", [[0.5], [[0.5, 0.5]], ["a", "b"]])
def test_chances_that_are_not_a_number_a_robot_are_refused(policy, chance):
    readings, kinds = np.full((2, 9), -1.0), np.full((2, 9), -1)
    with pytest.raises(InvalidValueError, match=r"^chance is .*; expected 2 numbers from 0 to 1"):
        policy.act(readings, kinds, chance)


def test_an_untrained_policy_refuses_to_drive_without_explore():
    policy = QPolicy.untrained(AGENT9, rng=np.random.default_rng(1))
    with pytest.raises(LearningError, match="the policy is untrained"):
        PolicyLayer(policy=policy)
    assert driven(PolicyLayer(policy=policy, explore=True)).run(3).steps == 3


def test_robots_with_other_sensors_are_refused_now_and_later(policy):
    with pytest.raises(LearningError, match="trained with 9 proximity sensors and AGENT3 has 3"):
        driven(PolicyLayer(policy=policy), design=AGENT3)
    with pytest.raises(LearningError, match=r"range 50, .* and AGENT9 has one at 0 degrees, range 40"):
        driven(PolicyLayer(policy=policy), design=AGENT9.with_proximity(range=40))
    with pytest.raises(LearningError, match="trained with"):
        driven(QLearning(start=policy), design=AGENT3)
    model = driven(PolicyLayer(policy=policy))
    model.add_robots(AGENT3, 1)
    with pytest.raises(LearningError, match="trained with"):
        model.step()


@pytest.mark.parametrize(
    ("readings", "kinds"),
    [
        (np.zeros((2, 3)), np.zeros((2, 3))),
        (np.zeros(9), np.zeros(9)),
        (np.zeros((2, 9)), np.zeros((3, 9))),
        (np.full((2, 9), np.nan), np.zeros((2, 9))),
        ("far", "robot"),
    ],
)
def test_readings_of_another_shape_or_not_finite_are_refused(policy, readings, kinds):
    with pytest.raises(InvalidValueError) as caught:
        policy.act(readings, kinds)
    assert "\n" not in str(caught.value)


def test_a_start_of_another_kind_is_refused(policy):
    with pytest.raises(InvalidValueError, match="start has actions 8"):
        QLearning(start=policy, actions=4)


def with_one_gone(layer):
    model = driven(layer, robots=6)
    next(iter(model.robots)).remove()
    return model


def test_robots_keep_their_networks_when_one_before_them_is_removed():
    taught = learned(trained(robots=6))
    learner = with_one_gone(QLearning(start=taught, frozen=True, name="same"))
    layer = with_one_gone(PolicyLayer(policy=taught, name="same"))
    commands = [np.array([model.run(1).swarm.command.copy() for _ in range(40)]) for model in (learner, layer)]
    assert (commands[0] == commands[1]).all()


@pytest.mark.parametrize("learner", [QLearning, WireFittedQ, HebbianLearning])
def test_numbers_choose_the_set_by_which_each_robot_acts_and_of_robot_gives_that_set(learner):
    model = driven(learner(), robots=3).run(30)
    policy = model.control.layers[0].policy()
    readings, kinds = np.random.default_rng(1).uniform(0, 50, (7, 9)), np.zeros((7, 9))
    numbers = np.array([5, 4, 0, 1, 2, 2, 300])
    wheels = policy.act(readings, kinds, numbers=numbers)
    for i, number in enumerate(numbers):
        alone = policy.of_robot(number % 3)
        assert alone.copies == 1
        assert alone.act(readings[i : i + 1], kinds[i : i + 1]).tolist() == [wheels[i].tolist()]
    assert (policy.act(readings, kinds) == policy.act(readings, kinds, numbers=np.arange(7))).all()
    assert policy.copies == 3
    assert policy.act(np.empty((0, 9)), np.empty((0, 9))).shape == (0, 2)
    with pytest.raises(InvalidValueError, match="index is 3"):
        policy.of_robot(3)


@pytest.mark.parametrize("numbers", [[0], [0.5, 1.5], "ab", [[0], [0, 1]], [[0, 1]]])
def test_numbers_that_are_not_one_a_robot_are_refused(policy, numbers):
    with pytest.raises(InvalidValueError, match=r"^numbers is .*; expected 2 whole numbers"):
        policy.act(np.full((2, 9), -1.0), numbers=numbers)


def test_a_policy_of_ones_own_with_copies_need_not_know_of_numbers(policy):
    own = Own(lambda n: np.ones((n, 2)), policy.sensors)
    own.copies = 3
    assert (with_one_gone(PolicyLayer(policy=own)).run(1).swarm.command == AGENT9.max_speed).all()


@pytest.mark.parametrize("learner", [QLearning, WireFittedQ, HebbianLearning])
def test_a_policy_that_knows_distances_only_acts_on_readings_alone(learner):
    policy = driven(learner()).run(5).control.layers[0].policy()
    readings = np.where(np.random.default_rng(1).random((3, 9)) < 0.5, -1.0, 20.0)
    assert (policy.act(readings) == policy.act(readings, np.where(readings < 0, -1, 0))).all()
    with pytest.raises(InvalidValueError):
        policy.act(np.full((3, 9), np.nan))
    with pytest.raises(InvalidValueError):
        policy.act("far")


def test_a_policy_that_distinguishes_kinds_needs_them():
    policy = QPolicy.untrained(AGENT9, rng=np.random.default_rng(1), encoding="typed")
    with pytest.raises(InvalidValueError, match=r"^kinds is None; expected .* encoding is 'typed'"):
        policy.act(np.full((3, 9), 20.0))


@pytest.mark.parametrize("chance", [2.0, -0.1, np.nan, np.inf])
def test_a_chance_that_is_none_is_refused(policy, chance):
    with pytest.raises(InvalidValueError, match=r"^chance holds .*; expected numbers from 0 to 1$"):
        policy.act(np.full((2, 9), -1.0), chance=[0.5, chance])
    assert policy.act(np.full((2, 9), -1.0), chance=[0, 1]).shape == (2, 2)


@pytest.mark.parametrize(
    "wrong",
    [{"encoding": "x"}, {"actions": 8.0}, {"actions": "8"}, {"copies": 0}, {"rng": 1}, {"design": "AGENT9"}],
)
def test_what_is_no_untrained_policy_is_refused_in_one_line(wrong):
    given = {"design": AGENT9, "rng": np.random.default_rng(1), **wrong}
    with pytest.raises(SwarmError, match=f"^{next(iter(wrong))} is|^unknown encoding"):
        QPolicy.untrained(given.pop("design"), **given)
