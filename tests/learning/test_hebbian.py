"""Hebbian learning: against a NumPy twin, frozen, gone on with, and what is wrong is refused."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.errors import InvalidValueError, LearningError, SwarmError
from mesa_swarm.learning import PolicyLayer, ReflexPolicy, SensorLayout, reward
from mesa_swarm.learning.hebbian import HebbianLearning
from mesa_swarm.learning.q_learning import QLearning

PREFIX = "0.HebbianLearning"


def test_the_default_of_critical_that_differs_from_q_learning_s_is_in_the_docstring():
    text = HebbianLearning.__doc__.partition("critical : float")[2].partition(" : ")[0]
    assert f"{HebbianLearning().critical} of the range by default" in text
    assert f"has {QLearning().critical}." in text


def learning(steps, robots=3, seed=1, design=AGENT9, **options):
    model = SwarmModel(map="original", rng=seed)
    model.add_robots(design, robots)
    model.control = Subsumption(HebbianLearning(**options))
    return model.run(steps)


def column(model, name):
    return model.swarm.columns[f"{PREFIX}.{name}"]


def weights(model):
    return np.concatenate([column(model, "weights"), column(model, "constant")[:, None]], axis=1)


def test_learns_by_its_equations():
    layer = HebbianLearning(reward="c", eta=0.05, trace=0.7, gamma=0.8, average=0.1, limit=0.3)
    model = SwarmModel(map="original", rng=3)
    model.add_robots(AGENT9, 4)
    model.control = Subsumption(layer)
    model.run(1)
    w, v, e = weights(model), np.zeros((4, 10)), np.zeros((4, 10, 2))
    x, wheels = None, None
    for _ in range(60):
        known = np.where(model.swarm.distance < 0, 0.0, 1 - np.minimum(model.swarm.distance / 50, 1))
        y = np.column_stack([known, np.ones(4)])
        if x is not None:
            paid = np.array([reward("c", 1 - known[i].max(), *wheels[i], 0.4) for i in range(4)])
            surprise = paid + 0.8 * (v * y).sum(axis=1) - (v * x).sum(axis=1)
            v += 0.1 * surprise[:, None] * x
            w = np.clip(w + 0.05 * surprise[:, None, None] * e, -0.3, 0.3)
        wanted = np.clip(np.einsum("ik,iks->is", y, w), -1, 1)
        wheels = np.clip(wanted + column(model, "tried"), -1, 1)
        e = 0.7 * e + y[:, :, None] * column(model, "tried")[:, None, :]
        np.testing.assert_allclose(weights(model), w, atol=1e-12)
        np.testing.assert_allclose(model.swarm.command, wheels * AGENT9.max_speed, atol=1e-12)
        x = y
        model.step()


def test_what_paid_more_than_expected_is_strengthened_where_it_was_tried():
    model = learning(1, reward="a")
    for name, value in {
        "weights": 0.0,
        "constant": 0.0,
        "constant_trace": 1.0,
        "expected": 0.0,
        "usual": -50.0,
    }.items():
        column(model, name)[:] = value
    before = column(model, "constant").copy()
    model.step()
    assert (column(model, "constant") > before).all()


def test_frozen_it_changes_nothing_and_drives_as_the_policy_does():
    model = learning(200)
    kept = weights(model)
    model.control.layers[0].frozen = True
    model.run(20)
    assert (weights(model) == kept).all()
    policy = model.control.layers[0].policy()
    model.sense()
    wanted = policy.act(model.swarm.distance, model.swarm.kind)
    model.step()
    np.testing.assert_allclose(model.swarm.command, wanted * AGENT9.max_speed, atol=1e-12)


def test_goes_on_where_a_policy_left_off():
    model = learning(100)
    policy = model.control.layers[0].policy(collisions=2.0)
    assert (policy.steps, policy.training["lessons"], policy.training["collisions"]) == (3 * 99, 3 * 99, 2.0)
    again = learning(1, start=policy)
    assert (weights(again) == weights(model)).all()
    assert again.run(10).control.layers[0].policy().steps == policy.steps + 3 * 10
    with pytest.raises(LearningError, match="trained with"):
        learning(1, design=AGENT3, start=policy)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"encoding": "typed", "rows": 20}, "start has encoding 'typed' and squash 'linear'; expected 'distance'"),
        ({"squash": "tanh"}, "start has encoding 'distance' and squash 'tanh'"),
        ({"squash": "threshold"}, "squash 'threshold'"),
        ({"whim": 0.5}, "weights of the whim"),
        ({"units": 2, "rows": 13}, "without hidden units"),
    ],
)
def test_reflexes_that_it_cannot_go_on_with_are_refused_by_name(changes, message):
    given = {"rows": 11, "units": 0, "whim": 0.0, **changes}
    rows, units, whim = given.pop("rows"), given.pop("units"), given.pop("whim")
    wheel = np.full((1, rows, 2), 0.1)
    wheel[:, -2] = whim
    policy = ReflexPolicy(
        sensors=SensorLayout.of(AGENT9), hidden=np.zeros((1, rows, units)), wheel=wheel, steps=1, **given
    )
    with pytest.raises(InvalidValueError) as caught:
        HebbianLearning(start=policy)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_it_can_start_from_a_reflex_designed_by_hand():
    away = ReflexPolicy.reflex(SensorLayout.of(AGENT3), [[0, 0], [0, -2], [-2, 0], [1, 1]])
    model = learning(20, design=AGENT3, start=away, eta=0.0)
    assert (weights(model) == np.delete(away.wheel[0], 3, axis=0)).all()


def test_the_same_seed_gives_the_same_bits_and_weights_stay_within_their_limits():
    one, two = (learning(150, eta=1.0, limit=0.5) for _ in range(2))
    assert one.state_hash() == two.state_hash()
    assert np.abs(weights(one)).max() == 0.5


def test_learns_of_its_own_actions_only():
    model = SwarmModel(map="original", rng=1)
    model.add_robots(AGENT9, 3)
    model.control = Subsumption(Avoid(distance=50), HebbianLearning())
    model.run(100)
    lessons = model.swarm.columns["1.HebbianLearning.lessons"]
    assert (lessons < 99).any()
    driven = SwarmModel(map="original", rng=1)
    driven.add_robots(AGENT9, 3)
    driven.control = Subsumption(PolicyLayer(policy=model.control.layers[1].policy()))
    assert driven.run(3).steps == 3


def test_divergence_names_robot_and_step_and_leaves_what_was_learned():
    model = learning(20)
    kept = weights(model)
    column(model, "expected")[1] = math.inf
    column(model, "seen")[1] = 1.0
    with pytest.raises(LearningError, match=r"HebbianLearning diverged for robot \d+ in step \d+"):
        model.step()
    assert np.isfinite(weights(model)).all()
    assert (weights(model)[1] == kept[1]).all()


def test_diverging_expectations_are_refused_before_they_overflow():
    model = learning(20)
    column(model, "usual")[1] = 1e12
    with pytest.raises(LearningError, match="grow beyond all bounds; lower average or gamma") as caught:
        model.step()
    assert "\n" not in str(caught.value)
    assert column(model, "usual")[1] == 1e12


def test_no_policy_is_learned_without_robots():
    with pytest.raises(LearningError, match="there are no robots"):
        learning(0, robots=0).control.layers[0].policy()


@pytest.mark.parametrize(
    "wrong",
    [
        {"reward": "d"},
        {"eta": 2},
        {"eta": math.nan},
        {"trace": 1},
        {"gamma": 1},
        {"average": 0},
        {"jitter": -0.1},
        {"persistence": 1},
        {"critical": 0},
        {"limit": 0},
        {"start": "mine.npz"},
        {"frozen": "no"},
    ],
)
def test_what_is_out_of_range_is_refused_in_one_line(wrong):
    with pytest.raises(SwarmError) as caught:
        HebbianLearning(**wrong)
    assert "\n" not in str(caught.value)
