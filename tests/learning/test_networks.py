"""Networks: outputs, gradients, first weights, and the thesis's regression."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError, LearningError
from mesa_swarm.learning.networks import Networks, fit

SIZES = st.tuples(st.integers(1, 4), st.integers(1, 6), st.integers(1, 8), st.integers(0, 2**32))


def some(sizes):
    count, inputs, hidden, seed = sizes
    rng = np.random.default_rng(seed)
    return Networks.random(count, inputs=inputs, hidden=hidden, rng=rng), rng.uniform(-1, 1, (count, inputs)), rng


def plain_outputs(networks, inputs):
    """The same by NumPy alone."""
    hidden = np.tanh(np.einsum("mk,mkh->mh", inputs, networks.inner) + networks.inner_bias)
    return networks.outer_bias + (networks.outer * hidden).sum(axis=1)


@given(SIZES)
def test_outputs_are_those_of_plain_numpy(sizes):
    networks, inputs, _ = some(sizes)
    assert networks.outputs(inputs) == pytest.approx(plain_outputs(networks, inputs), abs=1e-13)


@given(SIZES)
def test_a_step_goes_down_the_gradient_that_finite_differences_find(sizes):
    networks, inputs, rng = some(sizes)
    targets, rate, tiny = rng.uniform(-1, 1, len(inputs)), 0.05, 1e-6
    errors = targets - networks.outputs(inputs)
    gradients = []
    for weights in networks.weights:
        gradient = np.zeros_like(weights)
        for place in np.ndindex(weights.shape):
            before = weights[place]
            loss = []
            for side in (tiny, -tiny):
                weights[place] = before + side
                loss.append(0.5 * (targets[place[0]] - plain_outputs(networks, inputs)[place[0]]) ** 2)
            weights[place] = before
            gradient[place] = (loss[0] - loss[1]) / (2 * tiny)
        gradients.append(gradient)
    before = [weights.copy() for weights in networks.weights]
    assert networks.learn(inputs, targets, rate) == pytest.approx(errors)
    for old, new, gradient in zip(before, networks.weights, gradients, strict=True):
        assert new - old == pytest.approx(-rate * gradient, abs=1e-9)


def test_first_weights_are_uniform_within_the_root_of_what_feeds_a_node():
    networks = Networks.random(400, inputs=8, rng=np.random.default_rng(1))
    assert networks.inner.shape == (400, 8, 16)
    for weights, feeding in zip(networks.weights, (9, 9, 17, 17), strict=True):
        limit = 1 / np.sqrt(feeding)
        assert 0.95 * limit < np.abs(weights).max() <= limit
        assert weights.std() == pytest.approx(limit / np.sqrt(3), rel=0.1)


def test_regression_as_in_the_thesis_fits_badly_in_less_than_a_tenth_of_the_runs():
    rng = np.random.default_rng(6)
    x, noise = np.linspace(-1, 1, 30), 0.05
    curve = 0.6 * np.tanh(4 * x + 1) - 0.4 * np.tanh(3 * x - 2)
    fitted = fit(x, curve + rng.normal(0, noise, 30), rng=rng, networks=300, presentations=200, rate=0.5)
    fits = np.array([fitted.outputs(np.full((300, 1), at)) for at in x])
    root_mean_square = np.sqrt(((fits - curve[:, None]) ** 2).mean(axis=0))
    assert np.mean(root_mean_square > 3 * noise) < 0.1
    assert np.median(root_mean_square) < 1.5 * noise


@pytest.mark.parametrize(
    ("inputs", "targets", "rate"),
    [
        (np.zeros((2, 2)), np.zeros(2), 0.5),
        (np.full((2, 3), np.nan), np.zeros(2), 0.5),
        (np.zeros((2, 3)), np.zeros(3), 0.5),
        (np.zeros((2, 3)), np.array([0, np.inf]), 0.5),
        (np.zeros((2, 3)), np.zeros(2), 1.5),
        ("nothing", np.zeros(2), 0.5),
    ],
)
def test_what_has_another_shape_or_is_not_finite_is_refused_and_nothing_is_learned(inputs, targets, rate):
    networks = Networks.random(2, inputs=3, rng=np.random.default_rng(1))
    before = [weights.copy() for weights in networks.weights]
    with pytest.raises(InvalidValueError) as caught:
        networks.learn(inputs, targets, rate)
    assert "\n" not in str(caught.value)
    assert all((a == b).all() for a, b in zip(before, networks.weights, strict=True))


def shaped(**changed):
    parts = {"inner": np.ones((2, 3, 4)), "inner_bias": np.ones((2, 4)), "outer": np.ones((2, 4))}
    return Networks(**{**parts, "outer_bias": np.ones(2), **changed})


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"outer": np.ones((2, 1))}, r"^outer is an array of float64, shape \(2, 1\); expected .* shape \(2, 4\)$"),
        ({"inner": np.ones((2, 3, 400))}, "^inner_bias is .*(2, 4).*; expected .*(2, 400)"),
        ({"inner_bias": np.ones((3, 4))}, "^inner_bias is"),
        ({"outer_bias": np.ones((2, 1))}, r"^outer_bias is .*; expected .* shape \(2,\)$"),
        ({"inner": np.ones((3, 4))}, r"^inner is .*; expected .* shape \(m, k, h\)$"),
        ({"inner": np.ones((2, 3, 4)).tolist()}, r"^inner is \[\[\[1.0, .*; expected an array of float64"),
        ({"inner": None}, "^inner is None"),
        ({"outer": np.ones((2, 4), int)}, "^outer is an array of int64"),
        ({"outer": np.full((2, 4), np.nan)}, "^outer holds weights that are not finite"),
        ({"outer_bias": np.array([1, np.inf])}, "^outer_bias holds weights that are not finite"),
    ],
)
def test_parts_that_do_not_fit_together_are_refused_by_name(changed, message):
    assert shaped().outputs(np.ones((2, 3))).shape == (2,)
    with pytest.raises(InvalidValueError, match=message) as caught:
        shaped(**changed)
    assert "\n" not in str(caught.value)


def test_the_arrays_are_taken_as_they_are_and_learn():
    outer = np.ones((2, 4))
    shaped(outer=outer).learn(np.ones((2, 3)), np.zeros(2))
    assert (outer != 1).all()


ROW = np.linspace(-1, 1, 50)


@pytest.mark.parametrize(
    ("x", "y", "rng", "message"),
    [
        (ROW[:3], ROW[:4], np.random.default_rng(1), "^x has 3 numbers and y 4; expected equal lengths"),
        ([], [], np.random.default_rng(1), "^x is .*; expected a row of finite numbers"),
        (ROW, ROW[:, None], np.random.default_rng(1), "^y is .*; expected a row"),
        ("far", ROW, np.random.default_rng(1), "^x is .*; expected a row"),
        (ROW, np.full(50, np.nan), np.random.default_rng(1), "^y is .*; expected a row"),
        (ROW, ROW, 1, "^rng is 1; expected a generator such as numpy.random.default_rng"),
    ],
)
def test_what_cannot_be_fitted_is_refused_by_name(x, y, rng, message):
    with pytest.raises(InvalidValueError, match=message) as caught:
        fit(x, y, rng=rng)
    assert "\n" not in str(caught.value)


def test_a_fit_that_diverges_is_refused_instead_of_returning_nan():
    with pytest.raises(LearningError, match=r"^the fit diverged.*; lower rate, which is 1"):
        fit(ROW, 1e3 * ROW, rng=np.random.default_rng(1), rate=1.0, hidden=10)
