"""What holds of every learner: what it refuses, whose actions it learns of, with whom it shares, and of copies."""

import copy
import math
import pickle

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import LearningError, SwarmError
from mesa_swarm.control import Avoid, Subsumption, behaviour
from mesa_swarm.learning import (
    HebbianLearning,
    LearnFires,
    LearnFireWheels,
    QLearning,
    TableQLearning,
    WireFittedQ,
    load_policy,
    save_policy,
)

CHOOSING = [QLearning, WireFittedQ, TableQLearning, LearnFires, LearnFireWheels]
LEARNERS = [*CHOOSING, HebbianLearning]
# Values that are out of their range, or not of their kind; those at the ends of ranges are in test_parameters.py.
OF_ALL = [{"frozen": 1}, {"start": "a.npz"}, {"name": ""}]
OF_WHEELS = [{"reward": "d"}, {"reward_of": "action"}, {"reward_of": 1}, {"shared": "no"}, {"shared": 2}]
OF_NETWORKS = [*OF_WHEELS, {"encoding": "colour"}, {"self_adjusting": "no"}, {"eta": math.nan}, {"last_eta": "0.1"}]
WRONG = [
    *((learner, wrong) for learner in LEARNERS for wrong in OF_ALL),
    *((learner, wrong) for learner in (QLearning, WireFittedQ) for wrong in OF_NETWORKS),
    *((QLearning, {"actions": actions}) for actions in (5, "8", 8.0)),
    *((QLearning, wrong) for wrong in ({"replay": -1}, {"replay": 0.5}, {"replays": 0}, {"last_eta": 1.1})),
    *((TableQLearning, wrong) for wrong in OF_WHEELS),
    *((TableQLearning, {"edges": edges}) for edges in ((), (0.5, 0.5), (0.5, 0.2), (0,), (1,), (math.nan,), 1, "ab")),
    *((TableQLearning, wrong) for wrong in ({"sectors": 11}, {"sectors": 2.5}, {"actions": 6})),
    *((LearnFires, wrong) for wrong in ({"hold": 0}, {"arrival": math.nan}, {"shared": "no"})),
    *((LearnFireWheels, {name: -1}) for name in ("work", "approach", "rest", "scorch", "ahead", "near", "eta", "beta")),
    *((LearnFireWheels, {name: 0}) for name in ("margin", "full_heat", "hold", "first_temperature")),
    *((LearnFireWheels, wrong) for wrong in ({"gamma": 1.0}, {"work": math.nan})),
    *((HebbianLearning, wrong) for wrong in ({"reward": "d"}, {"eta": math.nan})),
]  # fmt: skip


@pytest.mark.parametrize(("learner", "wrong"), WRONG, ids=lambda value: getattr(value, "__name__", str(value)))
def test_what_is_out_of_range_or_of_another_kind_is_refused_in_one_line(learner, wrong):
    with pytest.raises(SwarmError, match=f"{list(wrong)[-1]}") as caught:
        learner(**wrong)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) <= 300


def learning(*layers, robots=4, rng=3):
    model = SwarmModel(map="openspace_fire", rng=rng)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(*layers)
    return model


def remembered(model):
    return {name: column.copy() for name, column in model.swarm.columns.items() if name[0].isdigit()}


def learned(model):
    layer = model.control.layers[-1]
    return [
        model.swarm.columns[f"{len(model.control.layers) - 1}.{layer.name}.{name}"].copy() for name in layer.learned
    ]


@pytest.mark.slow
@pytest.mark.parametrize("learner", LEARNERS)
def test_copies_go_on_to_the_same_bits_and_remember_apart(learner):
    model = learning(learner()).run(30)
    before = remembered(model)
    for other in (copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert other.run(30).state_hash() == copy.deepcopy(model).run(30).state_hash()
    assert all(np.array_equal(column, before[name], equal_nan=True) for name, column in remembered(model).items())


@pytest.mark.parametrize("learner", LEARNERS)
def test_what_was_learned_does_not_change_when_frozen_nor_does_the_temperature(learner):
    model = learning(learner()).run(30)
    layer = model.control.layers[0]
    layer.frozen = True
    before, temperature = learned(model), np.array(getattr(layer, "temperature", 0.0))
    model.run(40)
    assert all((now == then).all() for now, then in zip(learned(model), before, strict=True))
    assert np.array_equal(getattr(layer, "temperature", 0.0), temperature)


@behaviour
def always(me):
    """Stand still."""
    return 0.0, 0.0


@pytest.mark.parametrize("learner", [QLearning, WireFittedQ, TableQLearning, LearnFireWheels, HebbianLearning])
def test_robots_that_another_layer_drives_learn_nothing(learner):
    model = learning(always, learner()).run(20)
    assert not model.swarm.columns[f"1.{learner.__name__}.lessons"].any()


@pytest.mark.parametrize("learner", [QLearning, WireFittedQ, TableQLearning, HebbianLearning])
def test_a_lesson_is_learned_in_just_those_steps_that_follow_an_action_of_the_layer_itself(learner):
    model = learning(Avoid(distance=25), learner(), robots=6)
    lessons, own = np.zeros(6, int), np.zeros(6, bool)
    for _ in range(80):
        model.step()
        lessons += own
        own = model.swarm.layer == 1
        assert (model.swarm.columns[f"1.{learner.__name__}.lessons"] == lessons).all()
    assert len(set(lessons)) > 1


def drives_elsewhere(learner, policy):
    model = learning(learner(start=policy, frozen=True), robots=7, rng=9)
    return model.run(50)


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_saved_policy_drives_frozen_robots_of_another_model_unchanged(learner, tmp_path):
    layer = learning(learner()).run(100).control.layers[0]
    policy = load_policy(save_policy(layer.policy(put_out=0.5), tmp_path / "learned.npz"))
    assert policy.steps == layer.policy().steps == policy.training["lessons"] > 0
    assert policy.training["put_out"] == 0.5
    assert policy.copies == (1 if layer.shared else 4)
    one, two = drives_elsewhere(learner, policy), drives_elsewhere(learner, policy)
    assert one.state_hash() == two.state_hash()
    again = one.control.layers[0].policy()
    for name, array in again.arrays().items():
        of_robots = np.concatenate([policy.of_robot(k % policy.copies).arrays()[name] for k in range(again.copies)])
        assert name == "edges" or (array == of_robots).all()
    assert (again.steps, again.settings()) == (policy.steps, pytest.approx(policy.settings()))


@pytest.mark.parametrize("learner", CHOOSING)
def test_robots_that_share_what_they_learn_know_the_same_also_those_that_come_later(learner):
    options = {} if learner is LearnFireWheels else {"shared": True}
    model = learning(learner(**options), robots=6).run(1)
    before = learned(model)
    model.run(400)
    assert any((now[0] != then[0]).any() for now, then in zip(learned(model), before, strict=True))
    model.add_robots(AGENT9, 2)
    model.run(1)
    assert all((part == part[:1]).all() for part in learned(model))


@pytest.mark.parametrize("learner", LEARNERS)
def test_no_policy_is_learned_without_robots(learner):
    with pytest.raises(LearningError, match="there are no robots"):
        learning(learner(), robots=0).run(1).control.layers[0].policy()
