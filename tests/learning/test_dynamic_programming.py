"""Exact values before a wall: they solve Bellman's equation, by two methods, and move as the engine's robots do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, RobotDesign, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.learning import approach_values, reward
from mesa_swarm.learning.actions import ACTION_NAMES, ACTIONS, boltzmann
from mesa_swarm.learning.dynamic_programming import _Wall, value_iteration

ONE_DIMENSION = ("leave", "stand")
BACK, LEFT, RIGHT, FORWARD = range(4)
GAMMAS = (0.0, 0.3, 0.5, 0.7, 0.9, 0.95)
RANGE = 50.0


def solved(paid, following, share, gamma):
    """Policy iteration with an exact linear solve: the independent way to the same values."""
    states = np.arange(paid.shape[1])
    policy = np.zeros(len(states), int)
    while True:
        leading = np.zeros((len(states), len(states)))
        np.add.at(leading, (states, following[policy, states]), 1 - share[policy, states])
        np.add.at(leading, (states, following[policy, states] + 1), share[policy, states])
        worth = np.linalg.solve(np.eye(len(states)) - gamma * leading, paid[policy, states])
        values = paid + gamma * ((1 - share) * worth[following] + share * worth[following + 1])
        better = values.max(axis=0) > values[policy, states] + 1e-9
        if not better.any():
            return values
        policy = np.where(better, values.argmax(axis=0), policy)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), actions=st.integers(1, 5), states=st.integers(2, 12), gamma=st.floats(0, 0.98))
def test_value_iteration_agrees_with_policy_iteration_by_linear_equations(seed, actions, states, gamma):
    random = np.random.default_rng(seed)
    paid = random.uniform(-1, 1, (actions, states))
    following, share = random.integers(0, states - 1, paid.shape), random.random(paid.shape)
    expected = solved(paid, following, share, gamma)
    assert value_iteration(paid, following, share, gamma) == pytest.approx(expected, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("turning", ONE_DIMENSION)
@pytest.mark.parametrize("gamma", [0.7, 0.95])
def test_values_before_a_wall_are_those_of_the_linear_equations(turning, gamma):
    wall = _Wall(AGENT9, 5, turning)
    following, share = wall.following(ACTIONS)
    paid = np.array([[reward("b", near, *move, critical=0.08) for near in wall.nearest()] for move in ACTIONS])
    found = approach_values(gamma, turning=turning, cells=5).values.T
    expected = solved(paid, following, share, gamma)[:, : found.shape[1]]
    assert found == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("kind", ["a", "b", "c"])
def test_with_gamma_0_values_are_rewards(kind):
    values = approach_values(0.0, reward=kind, turning="stand")
    expected = [[reward(kind, x / RANGE, *move, critical=0.08) for move in ACTIONS] for x in values.distance]
    assert values.values == pytest.approx(np.array(expected), abs=1e-12)
    assert np.array_equal(values.values, values.reward)


def test_with_gamma_0_and_the_next_state_forward_pays_what_the_place_that_it_reaches_pays():
    values = approach_values(0.0, turning="stand", reward_of="next state")
    expected = [reward("b", max(x - 1.0, 0.0) / RANGE, 1, 1, critical=0.08) for x in values.distance]
    assert values.values[:, FORWARD] == pytest.approx(expected, abs=1e-12)


@given(gamma=st.floats(0.01, 0.95))
@settings(max_examples=10, deadline=None)
def test_where_turning_leads_to_open_ground_values_near_the_wall_have_a_closed_form(gamma):
    values = approach_values(gamma, turning="leave")
    ground = 1 / (1 - gamma)
    for x in (0.0, 1.5, 3.9, 4.0, 4.9):
        i = np.flatnonzero(np.isclose(values.distance, x))[0]
        here = reward("b", x / RANGE, 1, 1, critical=0.08)
        if x < 4:
            assert values.values[i].max() == pytest.approx(here + gamma * ground, abs=1e-7)
        else:
            then = reward("b", (x - 1) / RANGE, 1, 1, critical=0.08) + gamma * ground
            assert values.values[i, FORWARD] == pytest.approx(1 + gamma * then, abs=1e-7)
            assert values.values[i, LEFT] == pytest.approx(-1 + gamma * ground, abs=1e-7)


@pytest.mark.parametrize("turning", ["stand", "leave"])
@pytest.mark.parametrize("gamma", GAMMAS)
def test_the_greedy_robot_drives_forward_down_to_the_critical_distance_with_every_gamma(gamma, turning):
    values = approach_values(gamma, turning=turning)
    assert values.switching_distance == pytest.approx(4.0, abs=1e-9)
    assert values.even_distance(0.2) == pytest.approx(4.0, abs=1e-9)


@pytest.mark.parametrize("gamma", [0.0, 0.7, 0.95])
def test_so_it_does_where_the_heading_is_part_of_the_state(gamma):
    assert approach_values(gamma, cells=4).switching_distance == pytest.approx(4.0, abs=0.25)


def test_the_distance_from_which_the_utility_falls_does_grow_with_gamma():
    fallen = [approach_values(gamma, turning="stand") for gamma in (0.5, 0.7, 0.9, 0.95)]
    places = [values.distance[np.flatnonzero(values.utility < 0.99)[-1]] for values in fallen]
    assert places == sorted(places)
    assert places[-1] > 2 * places[1]


def test_with_reward_a_the_random_robot_hesitates_the_farther_away_the_larger_gamma_is():
    values = [approach_values(gamma, reward="a", turning="stand") for gamma in (0.0, 0.9, 0.95)]
    assert [one.even_distance(0.2) for one in values] == sorted(one.even_distance(0.2) for one in values)
    assert values[2].even_distance(0.2) > 10
    assert max(one.switching_distance for one in values) < 5


@given(gamma=st.floats(0, 0.95), kind=st.sampled_from("abc"), turning=st.sampled_from(ONE_DIMENSION))
@settings(max_examples=20, deadline=None)
def test_no_value_is_larger_than_the_largest_reward_for_ever(gamma, kind, turning):
    values = approach_values(gamma, reward=kind, turning=turning, cells=2)
    assert np.abs(values.values).max() <= 1 / (1 - gamma) + 1e-6
    assert values.utility.max() <= 1 + 1e-6


def test_the_critical_distance_is_the_switching_distance_wherever_it_is():
    distances = {
        share: approach_values(0.9, critical=share, turning="leave").switching_distance for share in (0.1, 0.4)
    }
    assert distances == {share: pytest.approx(RANGE * share) for share in distances}


def test_probabilities_are_boltzmann_s():
    values = approach_values(0.7, turning="stand", actions=4)
    assert values.probability(0.2)[70] == pytest.approx(boltzmann(values.values[70], 0.2))
    assert values.values.shape == (501, 4)


def test_a_robot_that_never_prefers_forward_switches_at_infinity():
    assert approach_values(0.5, critical=1.0, turning="leave", cells=2).switching_distance in (RANGE, math.inf)


@pytest.mark.slow
@pytest.mark.parametrize("a", range(8), ids=ACTION_NAMES)
@pytest.mark.parametrize("j", [0, 3, 14])
def test_moves_are_those_of_a_robot_of_the_engine(a, j):
    wall = _Wall(AGENT9, 10, "exact")
    gap, heading = 20.0, wall.headings[j]
    left, right = ACTIONS[a]

    @behaviour
    def drive(me, left=1.0, right=1.0):
        """Drive with these shares of the speed."""
        return left * me.max_speed, right * me.max_speed

    model = SwarmModel(map="openspace", rng=1)
    (robot,) = model.add_robots(AGENT9, poses=[(780.0 - AGENT9.radius - gap, 300.0, heading)])
    model.control = Subsumption(drive(left=float(left), right=float(right)))
    model.step()
    following, share = wall.following(ACTIONS)
    state = j * len(wall.distance) + np.flatnonzero(np.isclose(wall.distance, gap))[0]
    turned, cell = divmod(following[a, state], len(wall.distance))
    assert (cell + share[a, state]) / 10 == pytest.approx(780.0 - AGENT9.radius - robot.position[0], abs=1e-9)
    assert wall.headings[turned] == pytest.approx(abs(math.remainder(robot.heading, math.tau)), abs=1e-9)


def test_a_robot_that_touches_the_wall_advances_no_farther():
    wall = _Wall(AGENT9, 10, "stand")
    following, share = wall.following(ACTIONS)
    assert (following + share)[FORWARD, :11].tolist() == [0.0] * 11
    assert (following + share)[BACK, :2].tolist() == [10.0, 11.0]
    assert (following + share)[[LEFT, RIGHT], 7].tolist() == [7.0, 7.0]


@pytest.mark.parametrize(
    "wrong",
    [
        *({"gamma": gamma} for gamma in (-0.1, 1.0, math.nan, "0.7", None)),
        *({"critical": critical} for critical in (0, 1.1, math.nan)),
        *({"cells": cells} for cells in (0, 101, 2.5)),
        {"reward": "d"},
        {"actions": 5},
        {"reward_of": "s"},
        {"turning": "round"},
        {"design": "AGENT9"},
        {"design": RobotDesign(name="blind")},
        {"design": RobotDesign(name="still", sensors=AGENT3.sensors, max_speed=0)},
    ],
    ids=str,
)
def test_wrong_values_are_refused_in_one_line(wrong):
    with pytest.raises(SwarmError) as refusal:
        approach_values(**{"gamma": 0.7, **wrong})
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) <= 300


@pytest.mark.parametrize(
    "table",
    [
        ([[0.0, math.nan]], [[0, 0]], [[0.0, 0.0]]),
        ([[0.0]], [[0]], [[0.0]]),
        ([[0.0, 0.0]], [[0, 1]], [[0.0, 0.0]]),
        ([[0.0, 0.0]], [[0, 0]], [[0.0, 1.5]]),
        ([[0.0, 0.0]], [[0, 0.5]], [[0.0, 0.0]]),
        ([[0.0, 0.0]], [[0, 0, 0]], [[0.0, 0.0]]),
        ("table", [[0, 0]], [[0.0, 0.0]]),
    ],
    ids=str,
)
def test_a_table_of_states_that_does_not_fit_is_refused(table):
    with pytest.raises(InvalidValueError):
        value_iteration(*table, 0.5)


@pytest.mark.parametrize(("gamma", "oscillates"), [(0.5, True), (0.7, True), (0.9, True), (0.95, False)])
def test_moving_to_and_fro_at_the_critical_distance_is_the_best_that_reward_b_allows_up_to_gamma_0_9(gamma, oscillates):
    values = approach_values(gamma, cells=4)
    at, inside = (np.flatnonzero(np.isclose(values.distance, x))[0] for x in (4.0, 3.0))
    for_ever = (1 + gamma * values.reward[inside, BACK]) / (1 - gamma**2)
    assert (values.values[at].max() < for_ever + 1e-6) == oscillates
    assert (values.values[inside].argmax() == BACK) == oscillates
