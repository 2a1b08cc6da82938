"""QLearning: the update of the thesis, the choice, rewards, and what happens to what was learned."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import LearningError, SwarmError
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.learning.actions import ACTIONS, boltzmann, chosen, temperature_at
from mesa_swarm.learning.learner import is_bounded
from mesa_swarm.learning.networks import Networks, back_propagate
from mesa_swarm.learning.q_learning import QLearning
from mesa_swarm.learning.rewards import reward
from mesa_swarm.model.state_hash import written_state_hash

PARTS = ("inner", "inner_bias", "outer", "outer_bias")


def learning(robots=3, design=AGENT9, above=(), rng=1, world="original", **options):
    model = SwarmModel(map=world, rng=rng)
    model.add_robots(design, robots)
    model.control = Subsumption(*above, QLearning(**options))
    return model


def columns(model, *names, place=0):
    return [model.swarm.columns[f"{place}.QLearning.{name}"].copy() for name in names]


def layer_of(model):
    return model.control.layers[-1]


class Twin:
    """One robot's learning by plain NumPy, read off the equations."""

    def __init__(self, model, row):
        self.weights = [
            part[row].reshape(part.shape[1], *sizes)
            for part, sizes in zip(columns(model, *PARTS), ((9, 18), (18,), (18,), ()), strict=True)
        ]

    def value(self, a, inputs):
        inner, inner_bias, outer, outer_bias = (w[a] for w in self.weights)
        hidden = np.tanh(inputs @ inner + inner_bias)
        return float(outer @ hidden + outer_bias), hidden

    def learn(self, a, before, r, after, alpha=0.4, eta=0.1, gamma=0.7):
        best = max(self.value(b, after)[0] for b in range(8))
        value, hidden = self.value(a, before)
        step = eta * (((1 - alpha) * value + alpha * (r + gamma * best)) - value)
        inner, inner_bias, outer, outer_bias = self.weights
        slope = step * outer[a] * (1 - hidden**2)
        outer_bias[a] += step
        outer[a] += step * hidden
        inner_bias[a] += slope
        inner[a] += np.outer(before, slope)


@pytest.mark.slow
@pytest.mark.parametrize("reward_of", ["state", "next state"])
def test_learning_is_that_of_a_plain_twin_step_by_step(reward_of):
    model = learning(robots=2, rng=4, reward_of=reward_of)
    model.step()
    twins = [Twin(model, row) for row in range(2)]
    for _ in range(60):
        before, actions = columns(model, "inputs", "action")
        model.step()
        after, rewards = columns(model, "inputs", "reward")
        for row, twin in enumerate(twins):
            a = actions[row]
            nearest = float({"state": before, "next state": after}[reward_of][row].min())
            assert rewards[row] == pytest.approx(reward("b", nearest, *ACTIONS[a]))
            twin.learn(a, before[row, 0], rewards[row], after[row, 0])
            for part, kept in zip(columns(model, *PARTS), twin.weights, strict=True):
                assert part[row].reshape(kept.shape) == pytest.approx(kept, abs=1e-12)


def test_the_reward_of_the_state_is_r_s_a_and_that_of_the_next_state_differs_only_in_its_reading():
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=[(780.0 - 5.0 - 6.0, 300.0, 0.0)])
    model.control = Subsumption(QLearning(first_temperature=1e-6, last_temperature=1e-6, critical=0.1))
    model.step()
    before, action = columns(model, "inputs", "action")
    model.step()
    after, paid = columns(model, "inputs", "reward")
    assert before.min() != after.min()
    assert paid[0] == pytest.approx(reward("b", float(before.min()), *ACTIONS[action[0]], 0.1))


def test_the_defaults_are_the_thesis_s_final_action_set_and_d_crit_as_0_4_of_a_diameter():
    layer = QLearning()
    assert (layer.actions, layer.reward, layer.reward_of) == (8, "b", "state")
    assert layer.critical * 50.0 == pytest.approx(0.4 * 2 * AGENT9.radius)


def test_what_is_not_seen_is_as_far_as_can_be():
    model = learning(robots=20, rng=1).run(1)
    (inputs,) = columns(model, "inputs")
    unseen = model.swarm.distance < 0
    assert 0 < unseen.sum() < unseen.size
    assert (inputs[:, 0][unseen] == 1.0).all()
    assert inputs[:, 0][~unseen] == pytest.approx(model.swarm.distance[~unseen] / 50.0)


def test_typed_inputs_distinguish_robots_from_obstacles():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, poses=[(100, 100, 0.0), (120, 100, 0.0)])
    model.control = Subsumption(QLearning(encoding="typed"))
    model.step()
    (inputs,) = columns(model, "inputs")
    assert inputs.shape == (2, 4, 3)
    assert inputs[0, 1].tolist() == [1.0, 0.0, 0.0]
    assert not inputs[1, 1:].any()


def test_temperature_falls_by_its_schedule():
    model = learning(beta=0.01).run(50)
    assert layer_of(model).temperature == pytest.approx(temperature_at(50, beta=0.01))


@given(st.lists(st.floats(-1e300, 1e300), min_size=1, max_size=8), st.floats(1e-6, 1e6))
def test_boltzmann_never_overflows_and_sums_to_one(values, temperature):
    shares = boltzmann(values, temperature)
    assert shares.sum() == pytest.approx(1.0)
    assert 0 <= chosen(np.array(values), temperature, 0.999) < len(values)


def test_boltzmann_of_the_thesis_and_the_choice_agree():
    values = np.array([3.0, 2.0, 1.0])
    assert boltzmann(values, 1.0) == pytest.approx(np.exp(values) / np.exp(values).sum())
    chances = (np.arange(100_000) + 0.5) / 100_000
    counts = np.bincount([chosen(values, 0.7, chance) for chance in chances]) / len(chances)
    assert counts == pytest.approx(boltzmann(values, 0.7), abs=1e-4)


class TestRewards:
    @given(st.sampled_from("abc"), st.floats(0, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(0.01, 1))
    def test_are_between_minus_one_and_one(self, kind, nearest, left, right, critical):
        assert -1 <= reward(kind, nearest, left, right, critical) <= 1

    def test_are_those_of_the_thesis(self):
        for left, right in ACTIONS:
            assert reward("a", 0.4, left, right, 0.4) == (left + right) / 2
            assert reward("b", 0.4, left, right, 0.4) == (1 if left == right == 1 else -1)
        assert reward("a", 0.1, 1, 1, 0.4) == pytest.approx(math.log(4.2957 * 0.1 + 1) - 1, abs=1e-5)
        assert [reward(kind, 0.0, 1, 1) for kind in "abc"] == [-1, -1, -1]

    def test_only_c_does_not_leap_at_the_critical_distance(self):
        leaps = [abs(reward(k, 0.4, 1, 1, 0.4) - reward(k, 0.4 - 1e-9, 1, 1, 0.4)) for k in "abc"]
        assert leaps == pytest.approx([1, 1, 0], abs=1e-8)

    @pytest.mark.parametrize("wrong", [("d", 1, 1, 1), ("a", math.nan, 1, 1), ("a", 1, 1.5, 1), ("a", 1, 1, 1, 0)])
    def test_refuse_nonsense(self, wrong):
        with pytest.raises(SwarmError):
            reward(*wrong)


class TestWhatIsLearned:
    def test_is_the_robots_own(self):
        model = learning().run(20)
        inner, lessons = columns(model, "inner", "lessons")
        assert (inner[0] != inner[1]).all()
        assert lessons.tolist() == [19, 19, 19]

    def test_stays_when_other_robots_go_and_new_ones_begin_anew(self):
        model = learning().run(20)
        before = columns(model, "inner")[0]
        model.robots[1].remove()
        model.add_robots(AGENT9, 1)
        layer_of(model).frozen = True
        model.step()
        after = columns(model, "inner")[0]
        assert (after[:2] == before[[0, 2]]).all()
        assert after[2].any()

    def test_stays_when_robots_with_more_sensors_come(self):
        model = learning(robots=1, design=AGENT3).run(5)
        layer_of(model).frozen = True
        policy = layer_of(model).policy()
        model.step()
        model.add_robots(AGENT9, 1)
        model.step()
        views = layer_of(model)._weights
        readings, kinds = model.swarm.distance[:1, :3], model.swarm.kind[:1, :3]
        wide = type(policy.networks)(*(w[:8] for w in views))
        inputs = np.ones((8, 9))
        inputs[:, :3] = np.where(readings < 0, 1.0, readings / 50.0)
        assert wide.outputs(inputs) == pytest.approx(policy.values(readings, kinds)[0])

    def test_works_below_a_reflex(self):
        model = learning(robots=10, above=(Avoid(distance=10),)).run(300)
        layers, lessons = model.swarm.layer, columns(model, "lessons", place=1)[0]
        assert (lessons < 299).any()
        assert (lessons > 0).all()
        assert set(layers.tolist()) <= {0, 1}


def test_robots_may_be_added_after_the_control_and_may_have_no_sensors():
    model = SwarmModel(rng=1)
    model.control = Subsumption(QLearning())
    model.run(2)
    model.add_robots(AGENT9, 2)
    model.add_robots(type(AGENT9)(name="blind"), 1)
    assert np.isfinite(columns(model.run(20), "inner")[0]).all()


def test_self_adjusting_robots_keep_trying_while_they_bump_and_cool_when_they_do_not():
    model = learning(self_adjusting=True, bump_window=100, bump_distance=0.5)
    layer, swarm = layer_of(model), model.swarm
    model.step()
    for _ in range(300):
        swarm.columns["0.QLearning.bumps"][:] = [0.0, 0.01, 1.0]
        model.step()
    assert layer.temperature == pytest.approx([0.2, 0.6, 1.0], abs=0.21)


def test_gamma_follows_bumps_too_where_robots_adapt_it():
    model = learning(self_adjusting=True, gamma=0.5, alert_gamma=0.9)
    model.swarm.columns["0.QLearning.bumps"][:] = [0.0, 0.01, 1.0]
    assert layer_of(model).discount == pytest.approx([0.5, 0.7, 0.9])
    assert layer_of(learning(gamma=0.5, alert_gamma=0.9)).discount == pytest.approx([0.5] * 3)


@pytest.mark.parametrize("bumps", [0.0, 0.01, 1.0])
def test_a_lesson_discounts_by_the_gamma_of_the_robot(bumps):
    twins = [
        learning(robots=1, self_adjusting=True, gamma=0.5, alert_gamma=0.9),
        learning(robots=1, self_adjusting=True, gamma=0.5 + 0.4 * min(1.0, bumps / 0.02)),
    ]
    for model in twins:
        model.step()
        model.swarm.columns["0.QLearning.bumps"][:] = bumps
        model.step()
    assert columns(twins[0], *PARTS)[0] == pytest.approx(columns(twins[1], *PARTS)[0], abs=1e-12)


def test_an_alert_gamma_equal_to_gamma_changes_no_bit():
    plain, same = (learning(self_adjusting=True, **more).run(30) for more in ({}, {"alert_gamma": 0.7}))
    assert written_state_hash(plain) == written_state_hash(same)


def test_robots_with_a_least_speed_grow_hotter_while_they_are_fast_and_cooler_while_they_are_slow():
    model = learning(robots=2, self_adjusting=True, least_speed=0.3, bump_window=100, first_temperature=2.0)
    for _ in range(400):
        model.swarm.columns["0.QLearning.pace"][:] = [1.0, -1.0]
        model.step()
    assert layer_of(model).temperature == pytest.approx([2.0, 0.2])
    model.swarm.columns["0.QLearning.temperature"][:] = 1.0
    model.swarm.columns["0.QLearning.pace"][:] = [1.0, -1.0]
    model.step()
    assert layer_of(model).temperature == pytest.approx([1.01, 0.99])


def test_what_a_robot_remembers_of_its_speed_is_the_mean_of_its_actions():
    model = learning(robots=1, self_adjusting=True, least_speed=0.3, bump_window=10)
    model.step()
    action = int(columns(model, "action")[0][0])
    model.step()
    assert columns(model, "pace")[0] == pytest.approx(0.3 + 0.1 * (ACTIONS[action].mean() - 0.3))
    assert "0.QLearning.pace" not in learning(least_speed=0.3).swarm.columns


def test_divergence_names_the_robot_and_the_step_and_keeps_what_was_learned():
    model = learning().run(5)
    model.swarm.columns["0.QLearning.outer"][1, 0] = np.inf
    model.swarm.columns["0.QLearning.action"][1] = 0
    before = columns(model, "inner")[0]
    with pytest.raises(LearningError, match=rf"diverged for robot {model.robots[1].unique_id} in step 6") as caught:
        model.step()
    assert "\n" not in str(caught.value)
    assert (columns(model, "inner")[0][1] == before[1]).all()
    assert np.isfinite(columns(model, "inner")[0]).all()


HASTY = {"alpha": 1, "eta": 1, "gamma": 0, "beta": 0, "first_temperature": 1e6, "last_temperature": 1e6}


@pytest.mark.parametrize("options", [{}, {"shared": True}])
def test_what_a_learner_knew_when_it_diverged_can_be_had_and_driven_by(options):
    model = learning(robots=5, rng=3, **{**HASTY, **options})
    for _ in range(3000):
        before = columns(model, *PARTS)
        try:
            model.step()
        except LearningError as error:
            robot = int(str(error).split("robot ")[1].split()[0])
            break
    else:
        raise AssertionError("it did not diverge")
    row = [each.unique_id for each in model.robots].index(robot)
    after = columns(model, *PARTS)
    assert all(np.isfinite(part).all() for part in after)
    if not options.get("shared"):
        assert all((new[row] == old[row]).all() for new, old in zip(after, before, strict=True))
    policy = layer_of(model).policy()
    assert np.isfinite(policy.values(model.swarm.distance, model.swarm.kind)).all()


def test_every_step_after_a_divergence_stays_finite_and_reports_it_or_learns():
    model, diverged = learning(robots=5, rng=3, **HASTY), 0
    for _ in range(1500):
        lessons = columns(model, "lessons")[0].sum()
        try:
            model.step()
        except LearningError:
            diverged += 1
        else:
            assert columns(model, "lessons")[0].sum() == lessons + (5 if model.steps > 1 else 0)
    assert diverged > 1
    assert all(np.isfinite(part).all() for part in columns(model, *PARTS))


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9), st.floats(-1e300, 1e300))
def test_a_step_within_bounds_leaves_weights_finite(step, outer, inner):
    networks = Networks(np.full((1, 2, 3), inner), np.full((1, 3), inner), np.full((1, 3), outer), np.zeros(1))
    hidden = np.array([-1.0, 0.0, 1.0])
    assert is_bounded(networks.outer, 0, step)
    back_propagate(*networks.weights, 0, np.ones((1, 2)), 0, hidden, step)
    assert all(np.isfinite(weights).all() for weights in networks.weights)


@pytest.mark.parametrize(
    ("step", "outer"), [(2e9, 0.0), (math.nan, 0.0), (0.0, -2e9), (0.0, math.nan), (0.0, math.inf)]
)
def test_steps_and_weights_beyond_bounds_are_not_taken(step, outer):
    assert not is_bounded(np.array([[0.0, outer, 0.0]]), 0, step)
