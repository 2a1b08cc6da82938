"""Hidden units besides tanh: outputs by their formulas, and gradients that agree with finite differences."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.learning import Networks, QPolicy, SensorLayout, fit
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
    moved = copy.deepcopy(stack)
    moved.learn(inputs, targets, rate=0.1)
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
