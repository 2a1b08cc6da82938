"""The search: it finds a known optimum, is repeated from its history bit for bit, and refuses bad fitnesses."""

import math

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError, LearningError
from mesa_swarm.learning.evolution import Evolution


def sphere(x):
    return -float(((x - 1.5) ** 2).sum())


def searched(generations, seed=1, history=()):
    search = Evolution(np.zeros(6), sigma=0.5, population=10, seed=seed)
    for fitness in history:
        search.tell(fitness)
    while search.generations < generations:
        search.tell([sphere(x) for x in search.ask()])
    return search


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_finds_the_middle_of_a_sphere(seed):
    assert np.abs(searched(120, seed).mean - 1.5).max() < 1e-5


def test_a_search_with_the_same_history_continues_bit_for_bit():
    whole = searched(12)
    again = searched(12, history=whole.history[:7])
    assert again.history == whole.history
    assert (again.mean == whole.mean).all()
    assert all((a == b).all() for a, b in zip(again.means, whole.means, strict=True))


def test_asks_the_same_until_the_fitnesses_are_known():
    search = searched(2)
    first = search.ask()
    first[:] = 0
    assert (search.ask() == search.ask()).all()
    assert search.ask().any()


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_fitness_that_is_no_number_is_refused_with_candidate_and_generation_and_changes_nothing(wrong):
    search = searched(3)
    asked = search.ask()
    with pytest.raises(LearningError, match="the fitness of candidate 4 in generation 3 is"):
        search.tell([0.0] * 4 + [wrong] + [0.0] * 5)
    assert search.generations == 3
    assert (search.ask() == asked).all()


def test_a_wrong_number_of_fitnesses_is_refused():
    with pytest.raises(LearningError, match="3 fitnesses given; expected 10"):
        searched(0).tell([1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    "wrong",
    [
        {"start": [1.0]},
        {"start": [1.0, math.nan]},
        {"start": "here"},
        {"start": [[1.0, 2.0]]},
        {"sigma": 0},
        {"population": 3},
        {"seed": -1},
    ],
)
def test_what_is_no_search_is_refused_in_one_line(wrong):
    with pytest.raises(InvalidValueError) as caught:
        Evolution(**{"start": [0.0, 0.0], "sigma": 1.0, "population": 8, "seed": 1, **wrong})
    assert "\n" not in str(caught.value)
