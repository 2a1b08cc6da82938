"""The marks of the laboratory are those of the closed forms, and its readings of a wall are what sensors read."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, LearningError, SwarmError
from mesa_swarm.learning import QPolicy
from mesa_swarm.learning.actions import ACTION_NAMES, ACTIONS, boltzmann
from mesa_swarm.learning.reward_lab import learned_profile, marks_of, reward_profile, wall_readings
from mesa_swarm.world.statics import OBSTACLE

POINTS = 201
STEP = 1 / (POINTS - 1)
CRITICAL = st.floats(0.05, 0.95)


def beyond(kind, wheels):
    """The action term of a reward, as the thesis has it."""
    return sum(wheels) / 2 if kind == "a" else (1.0 if tuple(wheels) == (1, 1) else -1.0)


def marks(profile, kind, action):
    return [mark for mark in profile.marks if mark.kind == kind and mark.action == action]


@pytest.mark.slow
@given(critical=CRITICAL, kind=st.sampled_from("ab"), actions=st.sampled_from([4, 8]))
def test_rewards_a_and_b_leap_at_the_critical_distance_by_the_action_term_and_nowhere_else(critical, kind, actions):
    profile = reward_profile(kind, actions=actions, critical=critical, points=POINTS)
    for name, wheels in zip(ACTION_NAMES[:actions], ACTIONS, strict=False):
        leaps = marks(profile, "leap", name)
        if beyond(kind, wheels) == 0:
            assert leaps == []
        else:
            assert [leap.size for leap in leaps] == [pytest.approx(beyond(kind, wheels), abs=1e-6)]
            assert leaps[0].start == pytest.approx(critical, abs=1e-9)


@pytest.mark.slow
@given(critical=CRITICAL, actions=st.sampled_from([4, 8]))
def test_reward_c_leaps_nowhere(critical, actions):
    assert not [
        m for m in reward_profile("c", actions=actions, critical=critical, points=POINTS).marks if m.kind == "leap"
    ]


@pytest.mark.slow
@given(critical=CRITICAL, kind=st.sampled_from("abc"))
def test_plateaus_begin_where_only_the_action_counts_which_with_c_is_at_twice_the_critical_distance(critical, kind):
    profile = reward_profile(kind, critical=critical, points=POINTS)
    begin = critical if kind != "c" else 2 * critical
    for name in profile.actions:
        plateaus = marks(profile, "plateau", name)
        if begin < 1 - 2 * STEP:
            (plateau,) = plateaus
            assert plateau.start == pytest.approx(begin, abs=STEP + 1e-9)
            assert plateau.end == 1.0
        elif begin > 1:
            assert plateaus == []


def test_the_curves_are_the_thesis_s_below_the_critical_distance_and_0_at_it():
    profile = reward_profile("a", critical=0.4)
    below = profile.distance < 0.4
    expected = np.log((math.e - 1) / 0.4 * profile.distance[below] + 1) - 1
    assert profile.values[below] == pytest.approx(np.repeat(expected[:, None], 8, axis=1))


def test_a_steep_but_continuous_function_is_not_taken_for_a_leap():
    assert marks_of(lambda x: math.tanh(500 * (x - 0.5)), np.linspace(0, 1, 11), "forward") != []
    assert [m for m in marks_of(lambda x: 40 * x, np.linspace(0, 1, 11), "forward") if m.kind == "leap"] == []
    assert [
        m for m in marks_of(lambda x: math.tanh(500 * (x - 0.5)), np.linspace(0, 1, 11), "f") if m.kind == "leap"
    ] == []


@pytest.mark.parametrize("degrees", [0, 90, -90, 37])
@pytest.mark.parametrize("gap", [0.5, 7.0, 20.0, 38.0, 60.0])
def test_what_a_wall_is_read_as_is_what_sensors_read_of_it(degrees, gap):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=[(20 + 5 + gap, 300, math.pi - math.radians(degrees))])
    model.sense()
    assert wall_readings(AGENT9, [gap], degrees)[0] == pytest.approx(model.swarm.distance[0], abs=1e-9)


def untrained(copies=3, **more):
    return QPolicy.untrained(AGENT9, rng=np.random.default_rng(1), copies=copies, **more)


def test_a_learned_profile_of_one_robot_is_what_its_networks_return_and_how_it_chooses():
    policy = untrained(actions=4)
    profile = learned_profile(policy, AGENT9, robot=2, points=7, temperature=0.3)
    readings = wall_readings(AGENT9, profile.distance * 50)
    values = policy.of_robot(2).values(readings, np.where(readings >= 0, 0, -1))
    assert (profile.values == values).all()
    assert profile.policy[3] == pytest.approx(boltzmann(values[3], 0.3))


def test_a_learned_profile_of_all_robots_is_the_mean_of_theirs():
    policy = untrained()
    each = [learned_profile(policy, AGENT9, robot=k, points=9) for k in range(3)]
    whole = learned_profile(policy, AGENT9, points=9)
    assert whole.values == pytest.approx(np.mean([one.values for one in each], axis=0))
    assert whole.policy == pytest.approx(np.mean([one.policy for one in each], axis=0))


def test_a_wall_is_an_obstacle_to_a_policy_that_distinguishes_kinds():
    policy = untrained(1, encoding="typed")
    profile = learned_profile(policy, AGENT9, points=9)
    readings = wall_readings(AGENT9, profile.distance * 50)
    assert (profile.values == policy.values(readings, np.where(readings >= 0, OBSTACLE, -1))).all()


def test_switches_and_doubt_of_a_learned_profile_are_where_its_curves_show_them():
    profile = learned_profile(untrained(1), AGENT9, temperature=0.01)
    best = profile.values.argmax(axis=1)
    switches = [m for m in profile.marks if m.kind == "switch"]
    assert [profile.actions.index(m.action) for m in switches] == best[1:][np.diff(best) != 0].tolist()
    assert [m.start for m in switches] == profile.distance[1:][np.diff(best) != 0].tolist()
    assert all((m.start, m.size) == (m.end, 0.0) for m in switches)
    doubtful = np.zeros(len(best), bool)
    for mark in profile.marks:
        if mark.kind == "undecided":
            doubtful |= (profile.distance >= mark.start) & (profile.distance <= mark.end)
            assert mark.action == profile.actions[best[profile.distance == mark.start][0]]
    assert (doubtful == (profile.policy.max(axis=1) < 0.5)).all()


def test_what_was_found_is_sorted_by_its_place_and_points_are_as_many_as_there_should_be():
    for profile, points in ((reward_profile("a"), 201), (learned_profile(untrained(), AGENT9), 101)):
        assert (profile.distance == np.linspace(0, 1, points)).all()
        assert [m.start for m in profile.marks] == sorted(m.start for m in profile.marks)
    kinds = [(m.start, m.kind, m.action) for m in reward_profile("b", actions=4).marks if m.start > 0]
    at = sorted({start for start, *_ in kinds})
    assert len(at) == 1
    assert [kind for _, kind, _ in kinds] == ["leap"] * 4 + ["plateau"] * 4
    assert [action for *_, action in kinds] == list(ACTION_NAMES[:4]) * 2


@pytest.mark.parametrize("size", [0.0101, -0.0101, 0.0099])
def test_a_leap_is_more_than_a_hundredth_up_or_down(size):
    found = marks_of(lambda x: size if x >= 0.55 else 0.0, np.linspace(0, 1, 11), "forward")
    leaps = [m for m in found if m.kind == "leap"]
    assert [(m.size, m.action) for m in leaps] == ([(size, "forward")] if abs(size) > 0.01 else [])
    assert [m.start for m in leaps] == pytest.approx([0.55] * len(leaps), abs=1e-9)
    plateaus = [(round(m.start, 6), round(m.end, 6)) for m in found if m.kind == "plateau"]
    assert plateaus == [(0.0, 0.5), (0.55 if leaps else 0.6, 1.0)]


@pytest.mark.parametrize(
    ("call", "message", "error"),
    [
        (lambda: reward_profile("d"), "'d'", SwarmError),
        (lambda: reward_profile("a", actions=5), "actions is 5; expected 4 or 8", InvalidValueError),
        (lambda: reward_profile("a", points=2), "points is 2; expected a whole number", InvalidValueError),
        (lambda: reward_profile("a", critical=0), "critical is 0; expected", InvalidValueError),
        (lambda: learned_profile("b", AGENT9), "policy is 'b'; expected a QPolicy", InvalidValueError),
        (lambda: learned_profile(untrained(), AGENT3), "was trained with 9", LearningError),
        (
            lambda: learned_profile(untrained(), AGENT9, robot=3),
            "robot is 3; expected a whole number",
            InvalidValueError,
        ),
    ],
)
def test_nonsense_is_refused_in_words(call, message, error):
    with pytest.raises(error, match=message):
        call()
