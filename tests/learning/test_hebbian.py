"""Hebbian learning: against a NumPy twin, frozen, gone on with, and what is wrong is refused."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, LearningError
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import PolicyLayer, ReflexPolicy, SensorLayout, reward
from mesa_swarm.learning.hebbian import HebbianLearning
from mesa_swarm.learning.q_learning import QLearning
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.searches.drive_measures import tallied

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


def reflex(readings, contact):
    """Return what contacts of AGENT9 add to both wheels."""
    bearings = [0, 30, -30, 60, -60, 90, -90, 140, -140]
    touching = [degrees for degrees, reading in zip(bearings, readings, strict=True) if 0 <= reading <= contact]
    ahead = [math.sin(math.radians(degrees)) for degrees in touching if abs(degrees) <= 90]
    push = any(abs(degrees) > 90 for degrees in touching)
    left, right = (0, 0) if not ahead else (0, -2) if sum(ahead) > 0 else (-2, 0)
    return left + push, right + push


def test_learns_by_its_equations():
    layer = HebbianLearning(reward="c", eta=0.3, forgetting=0.2, contact=12.0, limit=0.5)
    model = SwarmModel(map="original", rng=3)
    model.add_robots(AGENT9, 15)
    model.control = Subsumption(layer)
    w, contacts, wheels = np.zeros((15, 9, 2)), set(), None
    for _ in range(200):
        model.step()
        readings = model.swarm.distance
        x = np.where(readings < 0, 0.0, 1 - np.minimum(readings / 50, 1))
        u = np.array([reflex(row, 12.0) for row in readings], float)
        if wheels is not None:
            paid = [reward("c", 1 - x[i].max(), *wheels[i], 0.4) for i in range(15)]
            np.testing.assert_allclose(model.control.layers[0].last_reward, paid)
        taught = u.any(axis=1) & (wheels is not None)
        wheels = np.clip(1 + np.einsum("is,isk->ik", x, w) + u, -1, 1)
        w[taught] = np.clip(w + 0.3 * (u[:, None] * x[:, :, None] - 0.2 * w), -0.5, 0.5)[taught]
        np.testing.assert_allclose(model.swarm.command, wheels, atol=1e-12)
        np.testing.assert_allclose(column(model, "weights"), w, atol=1e-12)
        contacts |= set(map(tuple, u.tolist()))
    assert contacts == {(0, 0), (0, -2), (-2, 0), (1, 1), (1, -1), (-1, 1)}


@pytest.mark.slow
def test_robots_that_learned_drive_frozen_through_another_map_with_few_collisions():
    def collisions(layer):
        model = SwarmModel(map=random_map(20_000), rng=1_000_101)
        model.add_robots(AGENT9, 15)
        model.control = Subsumption(layer)
        return 1000 * tallied(model, 1000).means()["collisions"]

    policies = [learning(3000, robots=15, eta=eta).control.layers[0].policy() for eta in (0.03, 0.0)]
    learned, untaught = (collisions(PolicyLayer(policy=policy)) for policy in policies)
    assert learned < 5
    assert untaught > 500


@pytest.mark.parametrize("name", ["trace", "gamma", "average", "jitter", "persistence"])
def test_parameters_of_the_former_rule_are_accepted_with_a_warning(name):
    with pytest.warns(DeprecationWarning, match=f"^{name} of HebbianLearning has no effect") as caught:
        HebbianLearning(**{name: 0.5})
    assert caught[0].filename == __file__


@pytest.mark.slow
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
    one, two = (learning(150, eta=1.0, limit=0.5, contact=20.0) for _ in range(2))
    assert one.state_hash() == two.state_hash()
    assert np.abs(weights(one)[:, :-1]).max() == 0.5
