"""Parameters of learners: their documented defaults and ranges, of which both ends are permitted and nothing beyond."""

import math
import sys

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.learning import (
    HebbianLearning,
    QLearning,
    QPolicy,
    ReflexPolicy,
    SensorLayout,
    TableQLearning,
    WireFittedQ,
)
from mesa_swarm.learning.actions import boltzmann, checked_actions, choose_all, chosen, temperature_at
from mesa_swarm.learning.evolution import Evolution
from mesa_swarm.learning.fire_learning import LearnFires
from mesa_swarm.learning.fitness import Fitness
from mesa_swarm.learning.networks import Networks, fit
from mesa_swarm.learning.reflex_policy import genome_length, half_length
from mesa_swarm.learning.reward_lab import learned_profile, reward_profile
from mesa_swarm.learning.rewards import reward
from mesa_swarm.learning.wire_learning import wire_value

ABOVE_0, LARGEST = math.ulp(0.0), sys.float_info.max
RATES = [
    ("alpha", 0.4, 0.0, 1.0),
    ("eta", 0.1, 0.0, 1.0),
    ("gamma", 0.7, 0.0, 0.999),
    ("beta", 1e-4, 0.0, 1.0),
    ("last_temperature", 0.2, ABOVE_0, 1e6),
    ("first_temperature", None, ABOVE_0, 1e6),
    ("critical", 0.08, ABOVE_0, 1.0),
    ("bump_rate", 0.02, ABOVE_0, 1.0),
    ("bump_window", 1000, 1.0, 1e9),
    ("bump_distance", 0.5, 0.0, 1e6),
    ("alert_gamma", None, 0.0, 0.999),
    ("least_speed", None, -1.0, 1.0),
]
NUMBERS = [
    *((learner, *row) for learner in (QLearning, WireFittedQ) for row in RATES),
    (WireFittedQ, "wires", 4, 1, 8),
    (WireFittedQ, "jitter", 0.2, 0.0, 10.0),
    (HebbianLearning, "eta", 0.03, 0.0, 1.0),
    (HebbianLearning, "forgetting", 0.1, 0.0, 1.0),
    (HebbianLearning, "contact", 1.0, 0.0, 1e6),
    (HebbianLearning, "critical", 0.4, ABOVE_0, 1.0),
    (HebbianLearning, "limit", 10.0, ABOVE_0, 1e6),
    (LearnFires, "arrival", 10, 0.0, 1e6),
    (LearnFires, "put_out", 10, 0.0, 1e6),
    (LearnFires, "step_cost", 0.01, 0.0, 1e6),
    (LearnFires, "alpha", 0.1, 0.0, 1.0),
    (LearnFires, "gamma", 0.999, 0.0, 0.999999),
    (LearnFires, "beta", 1e-4, 0.0, 1.0),
    (LearnFires, "first_temperature", 5, ABOVE_0, 1e6),
    (LearnFires, "last_temperature", 0.1, ABOVE_0, 1e6),
    (LearnFires, "hold", 50, 1, 2**31 - 1),
    (TableQLearning, "sectors", 5, 1, 10),
    (TableQLearning, "alpha", 0.4, 0.0, 1.0),
    (TableQLearning, "gamma", 0.7, 0.0, 0.999),
    (TableQLearning, "beta", 1e-4, 0.0, 1.0),
    (TableQLearning, "critical", 0.08, ABOVE_0, 1.0),
    (TableQLearning, "first_temperature", 1.0, ABOVE_0, 1e6),
    (TableQLearning, "last_temperature", 0.2, ABOVE_0, 1e6),
    (Fitness, "collision_cost", 800, 0.0, 1e6),
    (Fitness, "coverage_worth", 15, 0.0, 1e6),
    (Fitness, "speed_worth", 1, 0.0, 1e6),
    (Fitness, "square", 40, 1.0, 1000.0),
]


def just_beyond(lowest, highest):
    if isinstance(lowest, int):
        return lowest - 1, highest + 1
    return math.nextafter(lowest, -math.inf), math.nextafter(highest, math.inf)


@pytest.mark.parametrize(("learner", "name", "default", "lowest", "highest"), NUMBERS)
def test_both_ends_of_a_range_are_permitted_and_nothing_beyond(learner, name, default, lowest, highest):
    assert getattr(learner(), name) == default
    for value in (lowest, highest):
        assert getattr(learner(**{name: value}), name) == value
    for value in just_beyond(lowest, highest):
        with pytest.raises(InvalidValueError, match=f"{name} is"):
            learner(**{name: value})


def test_learners_learn_each_robot_alone_by_time_unless_they_are_set_to_something_else():
    for learner in (QLearning(), WireFittedQ()):
        assert (learner.shared, learner.self_adjusting, learner.frozen) == (False, False, False)
    assert (LearnFires().shared, LearnFires().frozen, HebbianLearning().frozen) == (False, False, False)


EYES, NINE = SensorLayout.of(AGENT3), SensorLayout.of(AGENT9)
RNG = np.random.default_rng(1)


def search(**changes):
    return Evolution(**{"start": [0.0, 0.0], "sigma": 1.0, "population": 8, "seed": 1, **changes})


CALLS = {
    "sigma": (lambda x: search(sigma=x), ABOVE_0, 1e6),
    "population": (lambda n: search(population=n), 4, 10_000),
    "seed": (lambda n: search(seed=n), 0, 2**31 - 1),
    "step": (lambda x: temperature_at(x, beta=0.5), 0.0, LARGEST),
    "beta": (lambda x: temperature_at(3, beta=x), 0.0, 1.0),
    "first": (lambda x: temperature_at(3, beta=0.5, first=x), ABOVE_0, LARGEST),
    "last": (lambda x: temperature_at(3, beta=0.5, last=x), ABOVE_0, LARGEST),
    "count": (lambda n: Networks.random(n, inputs=3, rng=RNG), 1, None),
    "inputs": (lambda n: Networks.random(2, inputs=n, rng=RNG), 1, None),
    "hidden": (lambda n: Networks.random(2, inputs=3, hidden=n, rng=RNG), 1, None),
    "networks": (lambda n: fit([0.0], [0.0], rng=RNG, networks=n, presentations=1), 1, None),
    "presentations": (lambda n: fit([0.0], [0.0], rng=RNG, presentations=n), 0, None),
    "rate": (lambda x: fit([0.0], [0.0], rng=RNG, presentations=1, rate=x), 0.0, 1.0),
    "copies": (lambda n: QPolicy.untrained(AGENT3, rng=RNG, copies=n), 1, None),
    "temperature": (lambda x: QPolicy.untrained(AGENT3, rng=RNG, temperature=x), ABOVE_0, LARGEST),
    "steps": (lambda n: QPolicy.untrained(AGENT3, rng=RNG, steps=n), 0, None),
    "units": (lambda n: genome_length(EYES, n), 0, 64),
    "nearest": (lambda x: reward("a", x, 1, 1), 0.0, 1.0),
    "left": (lambda x: reward("a", 1, x, 1), -1.0, 1.0),
    "right": (lambda x: reward("a", 1, 1, x), -1.0, 1.0),
    "critical": (lambda x: reward("a", 1, 1, 1, x), ABOVE_0, 1.0),
    "smoothing": (lambda x: wire_value([0, 0], [[0, 0]], [0], smoothing=x), 0.0, LARGEST),
    "points": (lambda n: reward_profile("a", points=n), 3, None),
    "robot": (lambda n: learned_profile(QPolicy.untrained(AGENT3, rng=RNG, copies=2), AGENT3, robot=n), 0, 1),
    "wall_degrees": (
        lambda x: learned_profile(QPolicy.untrained(AGENT3, rng=RNG), AGENT3, wall_degrees=x, points=3),
        -180.0,
        180.0,
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_both_ends_of_what_a_function_takes_are_permitted_and_nothing_beyond(name):
    call, lowest, highest = CALLS[name]
    for value in (lowest, highest):
        if value is not None:
            call(value)
    for value in just_beyond(lowest, lowest if highest is None else highest)[: 1 if highest is None else 2]:
        with pytest.raises(InvalidValueError, match=f"^{name} is"):
            call(value)


def test_policies_may_have_2_to_the_62_steps_of_training_and_no_more():
    genome = np.zeros(genome_length(NINE, 0))
    for make in (
        lambda steps: ReflexPolicy.of_genome(NINE, genome, steps=steps),
        lambda steps: QPolicy.untrained(AGENT3, rng=RNG, steps=steps),
    ):
        assert make(2**62).steps == 2**62
        with pytest.raises(InvalidValueError, match="steps is"):
            make(2**62 + 1024)  # the next one as a float


def test_units_of_mirrored_policies_are_pairs():
    assert [half_length(NINE, units) for units in (0, 2, 64)] == [11, 26, 75 * 33]
    with pytest.raises(InvalidValueError, match="units is 3; expected an even number"):
        half_length(NINE, 3)


def test_a_fit_has_one_network_of_two_hidden_units_and_200_rounds_at_half_of_the_gradient_by_default():
    x = np.linspace(-1, 1, 9)
    plain = fit(x, x**2, rng=np.random.default_rng(4))
    given = fit(x, x**2, rng=np.random.default_rng(4), networks=1, hidden=2, presentations=200, rate=0.5)
    assert all((a == b).all() for a, b in zip(plain.weights, given.weights, strict=True))
    assert plain.inner.shape == (1, 1, 2)
    networks = Networks.random(2, inputs=3, rng=np.random.default_rng(1))
    again = Networks.random(2, inputs=3, rng=np.random.default_rng(1))
    networks.learn(np.ones((2, 3)), np.ones(2))
    again.learn(np.ones((2, 3)), np.ones(2), 0.5)
    assert (networks.inner == again.inner).all()


def test_temperature_begins_at_the_first_and_ends_at_the_last():
    assert temperature_at(0, beta=0.3) == 1.0
    assert temperature_at(1, beta=1) == 0.2
    assert temperature_at(2, beta=0.5, first=9, last=1) == 3.0


def test_equal_values_are_chosen_by_equal_parts_of_the_chance_and_the_first_at_its_end():
    assert [chosen(np.zeros(4), 1.0, chance) for chance in (0.0, 0.25, 0.5, 0.75, 1.0)] == [0, 1, 2, 3, 0]
    values, taken = np.array([[1.0, 3.0, 3.0], [5.0, 3.0, 4.0]]), np.empty(2, np.int64)
    choose_all(values, 1.0, np.empty(0), taken)
    assert taken.tolist() == [1, 0]
    choose_all(values, 1e9, np.array([0.9, 0.5]), taken)
    assert taken.tolist() == [2, 1]


def test_no_temperature_of_0_is_chosen_by():
    assert boltzmann([1.0, 1.0], ABOVE_0).tolist() == [0.5, 0.5]
    with pytest.raises(InvalidValueError, match="temperature is 0"):
        boltzmann([1.0, 1.0], 0)


@pytest.mark.parametrize("values", ["ab", None, [], [[1.0]], [1.0, np.nan], [[1], [1, 2]], 3.0])
def test_values_that_are_no_row_of_numbers_are_refused(values):
    with pytest.raises(InvalidValueError, match=r"^values is .*; expected a row of finite numbers$"):
        boltzmann(values, 1)


@pytest.mark.parametrize("actions", [8.0, "8", 5, None, np.array([4, 8])])
def test_actions_are_the_whole_number_4_or_8(actions):
    with pytest.raises(InvalidValueError, match=r"^actions is .*; expected 4 or 8, a whole number$"):
        QLearning(actions=actions)
    assert checked_actions(np.int64(8)) == 8
