"""Stored experiences from which robots learn again, and a learning rate that falls with the temperature."""

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import LearningError
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.learning import QLearning, WireFittedQ
from mesa_swarm.learning.learner import rate_of
from mesa_swarm.learning.networks import PARTS
from support.q_learners import driven, learned, trained

REPLAYED = ("replay_before", "replay_after", "replay_action", "replay_reward")


def columns(model, *names):
    return [model.swarm.columns[f"0.QLearning.{name}"].copy() for name in names]


class Memory:
    """All experiences of one robot, from which it learns again in plain NumPy."""

    def __init__(self, slots):
        self.slots, self.experiences = slots, []

    def drawn_by(self, chance):
        """Return the experience in a slot: the latest one whose number leaves the slot's as its remainder."""
        slot, count = int(chance * min(len(self.experiences), self.slots)), len(self.experiences)
        return self.experiences[max(number for number in range(slot, count, self.slots))]


def learn(weights, before, action, reward, after, rate, gamma):
    """Make one step of back-propagation in plain NumPy."""

    def value(a, inputs):
        hidden = np.tanh(inputs @ weights[0][a] + weights[1][a])
        return weights[2][a] @ hidden + weights[3][a], hidden

    best = max(value(a, after)[0] for a in range(len(weights[3])))
    now, hidden = value(action, before)
    step = rate * (reward + gamma * best - now)
    slope = step * weights[2][action] * (1 - hidden**2)
    weights[3][action] += step
    weights[2][action] += step * hidden
    weights[1][action] += slope
    weights[0][action] += np.outer(before, slope)


@pytest.mark.parametrize("shared", [False, True])
def test_a_robot_learns_from_the_new_experience_and_then_from_stored_ones_drawn_by_chance(shared):
    options = {"actions": 4, "alpha": 0.5, "eta": 0.4, "gamma": 0.6, "critical": 0.4}
    model = trained(steps=1, robots=3, rng=3, replay=7, replays=3, shared=shared, **options)
    memories = [Memory(7) for _ in range(3)]
    shapes = (4, 9, 18), (4, 18), (4, 18), (4,)
    for _ in range(25):
        before, actions, *weights = columns(model, "inputs", "action", *PARTS)
        stacks = [[w[i].reshape(s) for w, s in zip(weights, shapes, strict=True)] for i in range(3)]
        stream = copy.deepcopy(model.streams["decide.QLearning"])
        model.step()
        after, rewards = columns(model, "inputs", "reward")
        _, chances = stream.random(3), stream.random((3, 3))
        for i, memory in enumerate(memories):
            stack = stacks[0 if shared else i]
            memory.experiences.append((before[i, 0], actions[i], rewards[i], after[i, 0]))
            for experience in (memory.experiences[-1], *map(memory.drawn_by, chances[i])):
                learn(stack, *experience, 0.2, 0.6)
        for part, *expected in zip(columns(model, *PARTS), *stacks, strict=True):
            for i in range(3):
                wanted = expected[0 if shared else i]
                np.testing.assert_allclose(part[i].reshape(wanted.shape), wanted, atol=1e-12)


def test_values_by_which_a_robot_chooses_are_those_after_it_learned_again():
    model = trained(steps=40, replay=20, replays=5, last_temperature=1e-6, beta=1.0)
    policy = learned(model)
    best = policy.values(model.swarm.distance, model.swarm.kind).argmax(axis=1)
    assert (columns(model, "action")[0] == best).all()


def test_only_lessons_of_its_own_actions_are_stored():
    model = SwarmModel(map="original", rng=1)
    model.add_robots(AGENT9, 6)
    model.control = Subsumption(Avoid(distance=25), QLearning(replay=100))
    model.run(60)
    lessons, rewards = (model.swarm.columns[f"1.QLearning.{name}"] for name in ("lessons", "replay_reward"))
    assert len(set(lessons)) > 1
    assert ((rewards != 0).sum(axis=1) <= lessons).all()
    assert not any(row[count:].any() for row, count in zip(rewards, lessons, strict=True))


def test_a_learner_without_replay_has_no_columns_for_it_and_draws_no_further_numbers():
    model = trained()
    assert not [name for name in model.swarm.columns if "replay" in name]
    stream = copy.deepcopy(model.streams["decide.QLearning"])
    model.step()
    assert stream.random(3).shape == (3,)
    assert stream.bit_generator.state == model.streams["decide.QLearning"].bit_generator.state


def test_a_frozen_learner_stores_nothing_and_learns_nothing_again():
    start = learned(trained(replay=10))
    model = driven(QLearning(start=start, frozen=True, replay=10)).run(20)
    stored = columns(model, *REPLAYED, "lessons")
    assert [np.unique(column).tolist() for column in stored] == [[1.0], [1.0], [0], [0.0], [0]]
    assert all((a == b).all() for a, b in zip(learned(model).networks.weights, start.networks.weights, strict=True))


class Rehearsing(SwarmModel):
    """Three robots that learn from what they stored."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 3)
        self.control = Subsumption(QLearning(replay=10, replays=2, last_eta=0.01))


def test_a_run_with_replay_is_resumed_to_the_same_bits(tmp_path):
    whole = Rehearsing(rng=1)
    with whole.record(tmp_path / "run.arrows", checkpoint_every=20):
        whole.run(20)
    again = Rehearsing.resume(tmp_path / "run.arrows")
    assert again.steps == 20
    assert again.run(10).state_hash() == whole.run(10).state_hash()


def test_a_policy_stores_replay_and_the_last_rate_where_they_are_used():
    names = ("replay", "replays", "last_eta")
    assert not set(names) & learned(trained()).training.keys()
    training = learned(trained(replay=10, replays=2, last_eta=0.01)).training
    assert [training[name] for name in names] == [10, 2, 0.01]


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0.01, 10), st.floats(0.01, 10), st.floats(-1, 2))
def test_the_rate_is_linear_in_the_temperature_and_stays_between_its_ends(first, last, hot, cold, share):
    temperature = cold + share * (hot - cold)
    rate = rate_of((first, last), temperature, (1e-4, hot, cold))
    assert min(first, last) - 1e-12 <= rate <= max(first, last) + 1e-12
    if abs(hot - cold) > 1e-3:
        assert rate == pytest.approx(last + (first - last) * min(max(share, 0), 1), abs=1e-9)
    assert rate_of((first, first), temperature, (1e-4, hot, cold)) == first


@pytest.mark.parametrize("learner", [QLearning, WireFittedQ])
def test_a_learner_begins_with_the_first_rate_and_ends_with_the_last_one(learner):
    def weights_of(beta, **rates):
        return driven(learner(beta=beta, **rates)).run(30).control.layers[0].policy().networks.outer

    hot, cold = weights_of(0.0, eta=0.2), weights_of(1.0, eta=0.05)
    assert (weights_of(0.0, eta=0.2, last_eta=0.05) == hot).all()
    assert (weights_of(1.0, eta=0.2, last_eta=0.05) == cold).all()
    between = weights_of(0.1, eta=0.2, last_eta=0.05)
    assert (between != weights_of(0.1, eta=0.2)).any()
    assert (between != weights_of(0.1, eta=0.05)).any()


@pytest.mark.parametrize(("stored", "changed"), [(0, 10), (20, 10), (20, 0)])
def test_replay_cannot_change_in_a_model_whose_robots_learn(stored, changed):
    model = trained(steps=5, replay=stored)
    learner = model.control.layers[0]
    learner.replay = changed
    with pytest.raises(LearningError, match=f"replay is {changed}, and robots of its model store {stored} experiences"):
        model.run(1)
    learner.replay = stored
    model.control = Subsumption(Avoid())
    learner.replay = changed
    with pytest.raises(LearningError, match=f"replay is {changed}, and"):
        model.control = Subsumption(learner)
    learner.replay = stored
    model.control = Subsumption(learner)
    assert model.run(3).control.layers[0].policy().steps == 7 * len(model.robots)


def test_experiences_that_diverge_are_an_error_that_names_the_robot():
    model = trained(steps=5, replay=10)
    model.swarm.columns["0.QLearning.replay_reward"][1] = 1e30
    with pytest.raises(LearningError, match=f"robot {model.robots[1].unique_id} in step 6"):
        model.run(1)
