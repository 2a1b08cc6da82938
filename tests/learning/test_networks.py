"""Networks: outputs and gradients of units of all kinds, first weights, and the thesis's regression."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3
from mesa_swarm.base.errors import InvalidValueError, LearningError, SwarmError
from mesa_swarm.learning import Networks, QPolicy, SensorLayout, fit
from mesa_swarm.learning.networks import random_weights
from mesa_swarm_studies.thesis.networks import regression_figure

FORMULAS = {
    "tanh": np.tanh,
    "step": lambda x: np.where(x >= 0, 1.0, 0.0),
    "linear": lambda x: x,
    "logistic": lambda x: 1 / (1 + np.exp(-x)),
}
SMOOTH = ("tanh", "linear", "logistic")
PARTS = ("inner", "inner_bias", "outer", "outer_bias")


def networks(activation, gain=1.0, seed=1):
    return Networks.random(3, inputs=2, hidden=4, rng=np.random.default_rng(seed), activation=activation, gain=gain)


@pytest.mark.parametrize("activation", FORMULAS)
@pytest.mark.parametrize("gain", [1.0, 0.5, 3.0])
def test_an_output_is_that_of_the_formula(activation, gain):
    stack, inputs = networks(activation, gain), np.random.default_rng(2).normal(size=(3, 2))
    hidden = FORMULAS[activation](gain * (stack.inner_bias + np.einsum("mk,mkh->mh", inputs, stack.inner)))
    assert stack.outputs(inputs) == pytest.approx(stack.outer_bias + (hidden * stack.outer).sum(axis=1))


@settings(max_examples=25, deadline=None)
@given(activation=st.sampled_from(SMOOTH), gain=st.sampled_from([1.0, 0.7, 2.0]), seed=st.integers(0, 10**6))
def test_a_lesson_is_a_step_down_the_numerical_gradient(activation, gain, seed):
    random = np.random.default_rng(seed)
    stack, inputs, targets = networks(activation, gain, seed), random.normal(size=(3, 2)), random.normal(size=3)
    moved, errors = copy.deepcopy(stack), targets - stack.outputs(inputs)
    assert moved.learn(inputs, targets, rate=0.1) == pytest.approx(errors)
    for part in PARTS:
        before = getattr(stack, part)
        for place in np.ndindex(before.shape):
            losses = []
            for sign in (1, -1):
                shifted = copy.deepcopy(stack)
                getattr(shifted, part)[place] += sign * 1e-5
                losses.append(0.5 * ((targets - shifted.outputs(inputs)) ** 2).sum())
            slope = (losses[0] - losses[1]) / 2e-5
            assert getattr(moved, part)[place] - before[place] == pytest.approx(-0.1 * slope, abs=1e-8)


def test_a_step_learns_by_the_slope_of_the_logistic_unit_and_its_outer_weights_by_their_own():
    stack, inputs = networks("step"), np.array([[0.3, -0.4]] * 3)
    moved, error = copy.deepcopy(stack), 1.0 - stack.outputs(inputs)
    moved.learn(inputs, np.ones(3), rate=0.1)
    sums = stack.inner_bias + np.einsum("mk,mkh->mh", inputs, stack.inner)
    logistic = FORMULAS["logistic"](sums)
    back = 0.1 * error[:, None] * stack.outer * logistic * (1 - logistic)
    assert moved.outer - stack.outer == pytest.approx(0.1 * error[:, None] * FORMULAS["step"](sums))
    assert moved.inner_bias - stack.inner_bias == pytest.approx(back)
    assert moved.inner - stack.inner == pytest.approx(inputs[:, :, None] * back[:, None, :])


def test_tanh_of_another_gain_is_a_scaled_tanh_and_the_default_is_plain_tanh():
    stack = networks("tanh", 2.0)
    doubled = Networks(2 * stack.inner, 2 * stack.inner_bias, stack.outer, stack.outer_bias)
    inputs = np.array([[0.3, -0.4]] * 3)
    assert stack.outputs(inputs) == pytest.approx(doubled.outputs(inputs))
    assert (doubled.activation, doubled.gain) == ("tanh", 1.0)


def errors_of(activation, truth, rate=0.05):
    x, random = np.linspace(-1, 1, 30), np.random.default_rng(1)
    fitted = fit(x, truth(x), rng=random, networks=20, hidden=8, rate=rate, activation=activation)
    outputs = np.array([fitted.outputs(np.full((20, 1), place)) for place in x])
    return np.sqrt(((outputs - truth(x)[:, None]) ** 2).mean(axis=0))


def test_linear_units_fit_a_line_and_cannot_fit_a_bend_which_the_other_units_fit():
    def bend(x):
        return np.tanh(5 * x)

    assert np.median(errors_of("linear", lambda x: 0.5 * x + 0.2)) < 0.01
    x = np.linspace(-1, 1, 30)
    line = np.polyval(np.polyfit(x, bend(x), 1), x)
    best = np.sqrt(((line - bend(x)) ** 2).mean())
    assert np.median(errors_of("linear", bend)) > 0.99 * best
    assert max(np.median(errors_of(name, bend)) for name in ("tanh", "logistic", "step")) < 0.8 * best


def test_step_units_learn_a_jump():
    assert np.median(errors_of("step", lambda x: np.where(x > 0.2, 0.5, -0.5))) < 0.25


def test_the_demonstration_can_be_drawn_with_every_kind_of_unit():
    assert all(len(regression_figure(points=5, networks=2, activation=name).axes) == 2 for name in FORMULAS)


def test_policies_have_units_of_tanh():
    stack = Networks.random(4, inputs=3, rng=np.random.default_rng(1), activation="logistic")
    with pytest.raises(SwarmError, match="expected tanh"):
        QPolicy(sensors=SensorLayout.of(AGENT3), networks=stack, actions=4)


@pytest.mark.parametrize("wrong", [{"activation": "relu"}, {"gain": 0}, {"gain": math.nan}, {"gain": "1"}], ids=str)
def test_wrong_units_are_refused(wrong):
    with pytest.raises(SwarmError):
        Networks.random(1, inputs=1, rng=np.random.default_rng(1), **wrong)


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


@pytest.mark.parametrize("bits", [np.random.PCG64, np.random.MT19937])
def test_random_weights_are_those_that_the_generator_itself_draws(bits):
    rng, twin = np.random.Generator(bits(3)), np.random.Generator(bits(3))
    low, high = 1 / math.sqrt(5), 1 / math.sqrt(8)
    shapes = ((2, 4, 7), low), ((2, 7), low), ((2, 7), high), ((2,), high)
    expected = [twin.uniform(-limit, limit, shape) for shape, limit in shapes]
    found = random_weights(2, 4, 7, rng)
    assert all(np.array_equal(one, other) for one, other in zip(found, expected, strict=True))
    assert rng.random() == twin.random()
