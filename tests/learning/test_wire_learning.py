"""WireFittedQ: interpolation, back-propagation through it against finite differences, bounds, files."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, LearningError, SwarmError
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import Networks, PolicyLayer, QLearning, WireFittedQ, load_policy, save_policy
from mesa_swarm.learning.wire_learning import STARTS, learn_wire_value, propose, wire_value

SEEDS = st.integers(0, 2**32)


def some(seed):
    rng = np.random.default_rng(seed)
    count = rng.integers(1, 7)
    return rng.uniform(-1, 1, 2), rng.uniform(-1, 1, (count, 2)), rng.uniform(-2, 2, count)


def plain(u, wires, q, c=0.1, eps=0.01):
    distance = ((u - wires) ** 2).sum(axis=1) + c * (q.max() - q) + eps
    return (q / distance).sum() / (1 / distance).sum()


@given(SEEDS)
def test_the_value_is_that_of_plain_numpy_and_between_the_worst_and_the_best(seed):
    u, wires, q = some(seed)
    value, _, _ = wire_value(u, wires, q)
    assert value == pytest.approx(plain(u, wires, q), abs=1e-12)
    assert q.min() - 1e-12 <= value <= q.max() + 1e-12


@given(SEEDS, st.booleans())
def test_gradients_are_those_of_finite_differences_also_at_the_best_wire(seed, at_the_best):
    u, wires, q = some(seed)
    if at_the_best:
        u = wires[q.argmax()].copy()
    _, by_wire, by_value = wire_value(u, wires, q)
    tiny = 1e-6
    for exact, part in ((by_wire, wires), (by_value, q)):
        for place in np.ndindex(part.shape):
            before, sides = part[place], []
            for side in (tiny, -tiny):
                part[place] = before + side
                sides.append(plain(u, wires, q))
            part[place] = before
            assert exact[place] == pytest.approx((sides[0] - sides[1]) / (2 * tiny), abs=2e-6, rel=1e-5)


@pytest.mark.parametrize(
    ("u", "wires", "q"),
    [
        ([0, 0], [[0, 0]], [np.nan]),
        ([0], [[0, 0]], [1]),
        ([0, 0], [[0]], [1]),
        ([0, 0], np.empty((0, 2)), []),
        ("ab", [[0, 0]], [1]),
        ([0, 0], [[0, 0], [1]], [1]),
        ([0, 0], [[0, 0]], 1),
        ([0, 0], [[0, 0]], None),
    ],
)
def test_nonsense_is_refused(u, wires, q):
    with pytest.raises(InvalidValueError) as caught:
        wire_value(u, wires, q)
    assert "\n" not in str(caught.value)


def learning(robots=3, rng=1, **options):
    model = SwarmModel(map="original", rng=rng)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(WireFittedQ(**options))
    return model


def plain_value(networks, inputs, action, wires, c=0.1, eps=0.01):
    """Q of an action by NumPy alone, from the networks on."""
    outputs = networks.outer_bias + (
        networks.outer * np.tanh(np.einsum("k,mkh->mh", inputs, networks.inner) + networks.inner_bias)
    ).sum(axis=1)
    ends = np.tanh(outputs.reshape(wires, 3)[:, :2] + np.arctanh(STARTS[:wires]))
    values = outputs.reshape(wires, 3)[:, 2]
    away = ((action - ends) ** 2).sum(axis=1) + c * (values.max() - values) + eps
    return (values / away).sum() / (1 / away).sum()


@pytest.mark.parametrize("seed", range(5))
def test_a_step_goes_along_the_gradient_that_finite_differences_find(seed):
    rng, wires, rate, tiny = np.random.default_rng(seed), 3, 1e-3, 1e-6
    networks = Networks.random(3 * wires, inputs=4, hidden=5, rng=rng)
    inputs, action = rng.uniform(0, 1, (1, 4)), rng.uniform(-1, 1, (1, 2))
    gap = 1.5 - plain_value(networks, inputs[0], action[0], wires)
    slopes = []
    for weights in networks.weights:
        slope = np.zeros_like(weights)
        for place in np.ndindex(weights.shape):
            before, sides = weights[place], []
            for side in (tiny, -tiny):
                weights[place] = before + side
                sides.append(plain_value(networks, inputs[0], action[0], wires))
            weights[place] = before
            slope[place] = (sides[0] - sides[1]) / (2 * tiny)
        slopes.append(slope)
    before = [weights.copy() for weights in networks.weights]
    hidden, ends, values = np.empty((9, 5)), np.empty((wires, 2)), np.empty(wires)
    assert learn_wire_value(networks.weights, 0, inputs, 0, hidden, ends, values, action, 1.5, rate)
    for old, new, slope in zip(before, networks.weights, slopes, strict=True):
        assert new - old == pytest.approx(rate * gap * slope, abs=1e-8)


def test_wires_begin_near_the_actions_of_the_thesis():
    networks = Networks(np.zeros((12, 9, 18)), np.zeros((12, 18)), np.zeros((12, 18)), np.zeros(12))
    ends, values = np.empty((4, 2)), np.empty(4)
    propose(networks.weights, 0, np.ones((1, 9)), 0, np.empty((12, 18)), ends, values)
    assert ends == pytest.approx(STARTS[:4])


def test_commands_are_any_within_full_speed():
    model = learning(robots=5)
    seen = []
    for _ in range(60):
        model.step()
        seen.append(model.swarm.command.copy())
    assert np.abs(seen).max() <= AGENT9.max_speed
    assert len(np.unique(seen)) > 400


def test_a_policy_of_it_is_saved_drives_and_is_gone_on_with(tmp_path):
    model = learning().run(30)
    policy = load_policy(save_policy(model.control.layers[0].policy(), tmp_path / "wires.npz"))
    actions, values = policy.proposals(model.swarm.distance, model.swarm.kind)
    best = actions[np.arange(3), values.argmax(axis=1)]
    assert policy.act(model.swarm.distance, model.swarm.kind).tolist() == best.tolist()
    again = learning(start=policy).control.layers[0].policy()
    assert (again.networks.inner == policy.networks.inner).all()
    model.control = Subsumption(PolicyLayer(policy=policy))
    assert np.isfinite(model.run(5).swarm.command).all()
    with pytest.raises(SwarmError, match="expected a QPolicy"):
        QLearning(start=policy)


def test_divergence_is_an_error_and_nothing_is_lost():
    model = learning().run(3)
    model.swarm.columns["0.WireFittedQ.reward"][:] = 0.0
    model.swarm.columns["0.WireFittedQ.outer_bias"][1, 2] = np.nan
    before = model.swarm.columns["0.WireFittedQ.inner"][1].copy()
    with pytest.raises(LearningError, match=f"robot {model.robots[1].unique_id} in step 4"):
        model.step()
    assert (model.swarm.columns["0.WireFittedQ.inner"][1] == before).all()


def test_what_it_knew_when_it_diverged_can_be_had():
    model = learning().run(3)
    model.swarm.columns["0.WireFittedQ.outer_bias"][1, 2] = 1e300
    before = {name: column.copy() for name, column in model.swarm.columns.items()}
    with pytest.raises(LearningError, match="diverged for robot"):
        model.step()
    for part in ("inner", "inner_bias", "outer", "outer_bias"):
        column = model.swarm.columns[f"0.WireFittedQ.{part}"]
        assert (column[1] == before[f"0.WireFittedQ.{part}"][1]).all()
        assert (column[0] != before[f"0.WireFittedQ.{part}"][0]).any()
    assert model.control.layers[0].policy().steps == 3 * 3 - 1


def test_a_best_wire_that_is_the_only_one_worth_anything_can_be_learned_of():
    model = learning().run(3)
    model.swarm.columns["0.WireFittedQ.outer_bias"][:, 5::3] = -1e8
    assert model.run(200).steps == 203
    assert all(np.isfinite(column).all() for name, column in model.swarm.columns.items() if "outer" in name)
