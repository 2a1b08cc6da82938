"""Learners keep what they know when they are taken out of a control, and go on with it wherever they are put."""

import copy
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import LearningError
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.environments.task_world import Commanded
from mesa_swarm.learning import (
    HebbianLearning,
    LearnFires,
    LearnFireWheels,
    PolicyLayer,
    QLearning,
    TableQLearning,
    WireFittedQ,
    load_policy,
    save_policy,
)

LEARNERS = [QLearning, WireFittedQ, HebbianLearning, LearnFires, LearnFireWheels, TableQLearning]
OF_POLICIES = [QLearning, WireFittedQ, HebbianLearning, TableQLearning]


def learning(learner, steps=60, robots=4, **options):
    model = SwarmModel(map="original", rng=3)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(learner(**options))
    return model.run(steps)


def known(model, place=0):
    prefix = f"{place}.{model.control.layers[place].name}."
    return {n.removeprefix(prefix): c.copy() for n, c in model.swarm.columns.items() if n.startswith(prefix)}


def same(one, other):
    return one.keys() == other.keys() and all(np.array_equal(one[n], other[n], equal_nan=True) for n in one)


# Not wheel actions, whose reward is of the command before, which ends with a control.
@pytest.mark.parametrize("learner", [*OF_POLICIES, LearnFires])
def test_a_run_whose_control_is_replaced_by_the_same_layer_goes_on_to_the_same_bits(learner):
    model = learning(learner)
    model.control = Subsumption(model.control.layers[0])
    assert model.run(60).state_hash() == learning(learner, 120).state_hash()


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_learner_that_is_put_below_a_reflex_knows_what_it_knew(learner):
    model = learning(learner, self_adjusting=True) if learner is QLearning else learning(learner)
    before = known(model)
    model.control = Subsumption(Avoid(distance=3), model.control.layers[0])
    assert same(known(model, 1), before)
    assert model.run(20).steps == 80


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_control_that_is_taken_out_and_put_back_knows_what_it_knew(learner):
    model = learning(learner)
    before, control = known(model), model.control
    model.control = None
    model.run(5)
    model.control = control
    assert same(known(model), before)


def test_robots_go_on_with_their_own_knowledge_though_others_went_and_came_meanwhile():
    model = learning(QLearning)
    before, control = known(model), model.control
    model.control = None
    model.robots[1].remove()
    model.add_robots(AGENT9, 2)
    model.control = control
    assert (known(model)["inner"][:3] == before["inner"][[0, 2, 3]]).all()
    assert not known(model)["born"][3:].any()
    assert np.isfinite(model.run(10).control.layers[0].policy().networks.inner).all()


def test_robots_of_two_designs_keep_what_they_know_too():
    model = learning(QLearning)
    model.add_robots(AGENT3, 1)
    before = known(model.run(5))
    model.control = Subsumption(Avoid(distance=3), model.control.layers[0])
    assert same(known(model, 1), before)


@pytest.mark.slow
@pytest.mark.parametrize("learner", OF_POLICIES)
def test_a_learner_that_was_taken_out_still_has_what_it_learned(learner):
    model = learning(learner)
    layer = model.control.layers[0]
    policy, paid = layer.policy(), layer.last_reward
    model.control = Subsumption(PolicyLayer(policy=policy))
    model.run(5)
    later = layer.policy()
    assert all((later.arrays()[name] == array).all() for name, array in policy.arrays().items())
    assert (later.steps, later.training) == (policy.steps, policy.training)
    assert (layer.last_reward == paid).all()
    if learner is not HebbianLearning:
        assert len(layer.worth(0)) > 2


@pytest.mark.parametrize("learner", LEARNERS)
def test_in_another_model_robots_begin_with_what_was_learned(learner):
    model = learning(learner)
    policy = model.control.layers[0].policy()
    other = learning(learner, 0, robots=2)
    other.control = model.control
    begun = other.control.layers[0].policy()
    for name, array in begun.arrays().items():
        assert (array == policy.arrays()[name][: len(array)]).all()
    assert begun.steps == policy.steps
    if learner is not HebbianLearning:
        assert (other.control.layers[0].temperature == policy.temperature).all()
    assert model.run(5).steps == 65


def test_one_arbiter_whose_learner_learned_nothing_begins_anew_in_many_models():
    control = Subsumption(QLearning())
    models = [SwarmModel(map="original", rng=seed) for seed in (3, 4)]
    for model in models:
        model.add_robots(AGENT9, 4)
        model.control = control
    assert models[0].run(60).state_hash() == learning(QLearning).state_hash()
    assert models[1].control.layers[0].policy().steps == 0


def test_a_control_that_is_refused_leaves_the_one_before_and_what_it_knows():
    model, other = learning(QLearning), SwarmModel(map="original", rng=1)
    other.add_robots(AGENT3, 1)
    other.control = Subsumption(QLearning())
    strange = other.run(5).control.layers[0].policy()
    with pytest.raises(LearningError, match="trained with 3 proximity sensors"):
        model.control = Subsumption(QLearning(start=strange))
    assert model.run(60).state_hash() == learning(QLearning, 120).state_hash()


def test_copies_of_a_model_whose_control_was_taken_out_can_put_it_back():
    model = learning(QLearning)
    before = known(model)
    model.kept, model.control = model.control, None
    other = copy.deepcopy(model)
    other.control = other.kept
    assert same(known(other), before)


@pytest.mark.parametrize("learner", OF_POLICIES[:3])
def test_a_frozen_learner_without_training_is_refused(learner):
    with pytest.raises(LearningError, match=rf"^{learner.__name__} is frozen and untrained; give it a trained"):
        learner(frozen=True)
    policy = learning(learner, 5).control.layers[0].policy()
    with pytest.raises(LearningError, match="is frozen and untrained"):
        learner(frozen=True, start=replace(policy, steps=0))
    model = learning(learner, 0)
    model.control = Subsumption(learner(frozen=True, start=policy))
    assert model.run(5).control.layers[0].policy().steps == policy.steps


@pytest.mark.parametrize("learner", OF_POLICIES)
def test_a_policy_states_where_it_comes_from_and_what_it_started_from(learner, tmp_path):
    first = learning(learner, 9).control.layers[0].policy(collisions=0.5)
    model = learning(learner, 0, start=load_policy(save_policy(first, tmp_path / "first.npz")))
    model.control = Subsumption(Avoid(distance=3), model.run(6).control.layers[0])
    again = load_policy(save_policy(model.control.layers[1].policy(), tmp_path / "again.npz"))
    provenance = {
        "learner": learner.__name__,
        "mesa_swarm": version("mesa-swarm"),
        "design": "AGENT9",
        "map": "original",
    }
    assert {**provenance, "model_steps": 9, "collisions": 0.5, "lessons": 32}.items() <= first.training.items()
    assert "started_from" not in first.training
    assert {**provenance, "model_steps": 6, "lessons": 20}.items() <= again.training.items()
    assert first.training.items() <= again.training["started_from"].items()


@pytest.mark.parametrize("learner", OF_POLICIES)
@pytest.mark.parametrize("ask", [lambda layer: layer.policy(), lambda layer: layer.last_reward])
def test_a_learner_that_is_in_no_model_states_where_to_ask(learner, ask):
    layer = learner()
    model = SwarmModel(map="original", rng=3)
    model.add_robots(AGENT9, 2)
    model.control = Subsumption(layer)
    model.run(3)
    with pytest.raises(LearningError, match=rf"^this {layer.name} is in no model.* model\.control\.layers\[0\]"):
        ask(layer)


@pytest.mark.parametrize("layer", [QLearning(), WireFittedQ(), LearnFires()])
def test_so_do_temperatures(layer):
    with pytest.raises(LearningError, match="is in no model"):
        _ = layer.temperature


def test_so_does_worth():
    for layer in (QLearning(), WireFittedQ()):
        with pytest.raises(LearningError, match="is in no model"):
            layer.worth(0)


def test_so_do_the_wheels_of_commanded_robots():
    layer = Commanded(2)
    with pytest.raises(LearningError, match=r"this Commanded is in no model.* model\.control\.layers\[0\]"):
        _ = layer.wheels
    model = learning(QLearning, 0)
    model.control = Subsumption(layer)
    assert model.control.layers[0].wheels.shape == (2, 2)
