"""Networks that learn two tasks one after the other forget the first, unless they rehearse stored points."""

import math

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.learning import Networks, fit, fit_in_turn
from mesa_swarm.learning.networks import present

LEFT, RIGHT = np.linspace(-1, -0.1, 10), np.linspace(0.1, 1, 10)
TASKS = [(LEFT, np.full(10, -0.5)), (RIGHT, np.full(10, 0.5))]


def errors(networks, x, y):
    outputs = np.array([networks.outputs(np.full((len(networks.outer_bias), 1), at)) for at in x])
    return np.median(np.abs(outputs - y[:, None]).mean(axis=0))


def learned(rehearsal, **more):
    return fit_in_turn(TASKS, rng=np.random.default_rng(3), networks=10, rehearsal=rehearsal, **more)


def test_without_rehearsal_the_first_task_is_forgotten_while_the_second_is_learned():
    first, second = learned("none")
    assert errors(first, *TASKS[0]) < 0.05
    assert errors(second, *TASKS[0]) > 5 * errors(first, *TASKS[0])
    assert errors(second, *TASKS[1]) < 0.05


@pytest.mark.parametrize("rehearsal", ["interleaved", "consolidated"])
def test_with_rehearsal_both_tasks_are_known(rehearsal):
    after = learned(rehearsal)[1]
    assert max(errors(after, *task) for task in TASKS) < 0.1


def test_the_first_task_is_learned_alike_with_and_without_interleaving():
    plain, mixed = (learned(way)[0] for way in ("none", "interleaved"))
    assert all(np.array_equal(a, b) for a, b in zip(plain.weights, mixed.weights, strict=True))


def test_networks_returned_for_a_task_do_not_change_with_the_next():
    first, second = learned("none")
    assert not np.array_equal(first.outer, second.outer)


def test_one_task_alone_is_a_fit():
    one = fit_in_turn(TASKS[:1], rng=np.random.default_rng(5), hidden=3, presentations=7, rate=0.2)[0]
    same = fit(*TASKS[0], rng=np.random.default_rng(5), hidden=3, presentations=7, rate=0.2)
    assert all(np.array_equal(a, b) for a, b in zip(one.weights, same.weights, strict=True))


def test_interleaving_presents_every_stored_point_once_a_round(monkeypatch):
    shown = []
    monkeypatch.setattr("mesa_swarm.learning.networks.present", lambda stack, points, **how: shown.append(len(points)))
    for way, expected in (("none", [10, 10]), ("interleaved", [10, 20]), ("consolidated", [10, 10, 10, 20])):
        shown.clear()
        learned(way)
        assert shown == expected


def test_presenting_no_round_changes_nothing():
    stack = Networks.random(2, inputs=1, rng=np.random.default_rng(1))
    before = stack.inner.copy()
    present(stack, np.zeros((3, 2)), rng=np.random.default_rng(1), presentations=0, rate=0.1)
    assert np.array_equal(stack.inner, before)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rehearsal": "sleep"},
        {"tasks": []},
        {"tasks": 3},
        {"tasks": [(LEFT,)]},
        {"tasks": [(LEFT, RIGHT[:3])]},
        {"tasks": [(LEFT, np.full(10, math.nan))]},
        {"networks": 0},
        {"activation": "relu"},
    ],
    ids=str,
)
def test_wrong_arguments_are_refused(wrong):
    with pytest.raises(SwarmError) as refusal:
        fit_in_turn(**{"tasks": TASKS, "rng": np.random.default_rng(1), **wrong})
    assert len(str(refusal.value)) <= 300
