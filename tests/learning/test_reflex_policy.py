"""Reflexes and small networks: against a NumPy twin, with their memory, in layers, in files; what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import LearningError, SwarmError
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import PolicyLayer, SensorLayout, load_policy, save_policy
from mesa_swarm.learning.reflex_policy import ReflexPolicy, genome_length
from mesa_swarm.world.statics import ROBOT

NINE = SensorLayout.of(AGENT9)
SQUASHED = {
    "linear": lambda x: np.clip(x, -1, 1),
    "threshold": lambda x: np.where(x > 0, 1.0, -1.0),
    "tanh": np.tanh,
}


def drawn(seed=1, units=2, squash="linear", copies=1, encoding="distance"):
    rng = np.random.default_rng(seed)
    rows = (18 if encoding == "typed" else 9) + units + 2
    hidden, wheel = rng.normal(size=(copies, rows, units)), rng.normal(size=(copies, rows, 2))
    options = {"squash": squash, "encoding": encoding, "steps": 7, "training": {"learner": "luck"}}
    return ReflexPolicy(sensors=NINE, hidden=hidden, wheel=wheel, **options)


def twin(policy, readings, kinds, chance, memory):
    """Return wheels and memory of each robot, by the equation."""
    wheels = []
    for i, reading in enumerate(readings):
        near = np.where(reading < 0, 0.0, 1 - np.minimum(reading / policy.sensors.ranges, 1))
        if policy.encoding == "typed":
            near = np.concatenate([near, np.where(kinds[i] == ROBOT, near, 0.0)])
        whim = [2 * chance[i] - 1, 1.0]
        copy = i % len(policy.wheel)
        memory[i] = np.tanh(np.concatenate([near, memory[i], whim]) @ policy.hidden[copy])
        wheels.append(SQUASHED[policy.squash](np.concatenate([near, memory[i], whim]) @ policy.wheel[copy]))
    return np.array(wheels)


def driven(policy, steps, design=AGENT9, seed=2, robots=4, **options):
    model = SwarmModel(map="original", rng=seed)
    model.add_robots(design, robots)
    model.control = Subsumption(PolicyLayer(policy=policy, **options))
    return model.run(steps)


@given(
    st.integers(0, 10**6),
    st.sampled_from([0, 1, 3]),
    st.sampled_from(sorted(SQUASHED)),
    st.integers(1, 3),
    st.sampled_from(["distance", "typed"]),
)
@settings(max_examples=60, deadline=None)
def test_acts_by_its_equation_over_several_steps(seed, units, squash, copies, encoding):
    policy, rng = drawn(seed, units, squash, copies, encoding), np.random.default_rng(seed)
    kept, other = np.zeros((5, units)), np.zeros((5, units))
    for _ in range(4):
        readings = np.where(rng.random((5, 9)) < 0.4, -1.0, rng.uniform(0, 60, (5, 9)))
        kinds, chance = rng.integers(0, 4, (5, 9)), rng.random(5)
        wheels = policy.act(readings, kinds, chance, kept)
        np.testing.assert_allclose(wheels, twin(policy, readings, kinds, chance, other), atol=1e-12)
        np.testing.assert_allclose(kept, other, atol=1e-12)


def test_without_chances_there_is_no_whim_and_without_memory_nothing_was_before():
    policy, readings = drawn(), np.full((3, 9), 20.0)
    plain = policy.act(readings, np.zeros((3, 9)))
    assert (plain == policy.act(readings, np.zeros((3, 9)), np.full(3, 0.5), np.zeros((3, 2)))).all()
    assert (plain != policy.act(readings, np.zeros((3, 9)), np.full(3, 0.9))).any()


def test_braitenbergs_vehicle_turns_away_from_what_is_at_its_side():
    away = ReflexPolicy.reflex(SensorLayout.of(AGENT3), [[0, 0], [0, -2], [-2, 0], [1, 1]])
    left, right = away.act([[-1.0, 10.0, -1.0]], [[-1, 0, -1]])[0]
    assert left > right
    assert (away.wheel[0, 3] == 0).all()  # no whim


def test_a_layer_keeps_each_robots_memory_from_step_to_step():
    model = driven(drawn(), 5)
    kept = model.swarm.columns["0.Policy.memory"].copy()
    assert kept.shape == (4, 2)
    model.step()
    layer = model.control.layers[0]
    state = layer._rng.bit_generator.state
    other = kept.copy()
    model.sense()
    ahead = model.swarm.distance.copy(), model.swarm.columns["0.Policy.memory"].copy()
    model.step()
    layer._rng.bit_generator.state = state
    twin(layer.policy, ahead[0], model.swarm.kind, layer._rng.random(4), ahead[1])
    np.testing.assert_allclose(model.swarm.columns["0.Policy.memory"], ahead[1], atol=1e-12)
    assert (ahead[1] != other).any()


def test_robots_that_come_later_remember_nothing_and_others_keep_what_they_had():
    model = driven(drawn(), 5)
    kept = model.swarm.columns["0.Policy.memory"].copy()
    model.add_robots(AGENT9, 1)
    assert (model.swarm.columns["0.Policy.memory"][:4] == kept).all()
    assert (model.swarm.columns["0.Policy.memory"][4] == 0).all()


@pytest.mark.slow
def test_a_layer_gives_the_same_bits_with_the_same_seed_and_greedily_without_whims():
    assert len({driven(drawn(), 30).state_hash() for _ in range(2)}) == 1
    assert driven(drawn(), 30).state_hash() != driven(drawn(), 30, greedy=True).state_hash()


def test_a_genome_is_all_weights_row_by_row():
    genome = np.arange(genome_length(NINE, 2), dtype=float)
    policy = ReflexPolicy.of_genome(NINE, genome, units=2)
    assert (np.concatenate([policy.hidden.ravel(), policy.wheel.ravel()]) == genome).all()
    assert (policy.memory, policy.wheel.shape) == (2, (1, 13, 2))


@pytest.mark.parametrize("units", [0, 2])
@pytest.mark.parametrize("encoding", ["distance", "typed"])
def test_a_file_gives_back_all_of_it(tmp_path, units, encoding):
    policy = drawn(units=units, squash="tanh", copies=2, encoding=encoding)
    again = load_policy(save_policy(policy, tmp_path / "mine.npz"))
    assert all((a == b).all() for a, b in zip(again.arrays().values(), policy.arrays().values(), strict=True))
    assert (again.sensors, again.steps, again.squash) == (policy.sensors, 7, "tanh")
    assert (again.encoding, again.training["learner"]) == (encoding, "luck")


def test_parts_from_before_there_were_encodings_are_of_a_policy_that_knows_distances_only():
    policy = drawn()
    again = ReflexPolicy.restored(NINE, 7, {}, {"squash": "linear"}, policy.arrays())
    assert again.encoding == "distance"
    with pytest.raises(SwarmError):
        ReflexPolicy.restored(NINE, 7, {}, {"squash": "linear", "colour": "red"}, policy.arrays())
    with pytest.raises(SwarmError):
        ReflexPolicy.restored(NINE, 7, {}, {"encoding": "distance"}, policy.arrays())


def test_a_policy_that_knows_robots_distinguishes_them_from_walls_at_the_same_distance():
    wheel = np.zeros((1, 20, 2))
    wheel[0, 9] = -1.0  # the robot ahead
    wheel[0, 19] = 1.0
    policy = ReflexPolicy(sensors=NINE, hidden=np.zeros((1, 20, 0)), wheel=wheel, encoding="typed", steps=1)
    readings = np.full((2, 9), -1.0)
    readings[:, 0] = 12.5  # of a range of 50
    kinds = np.full((2, 9), -1)
    kinds[:, 0] = [0, ROBOT]
    assert policy.act(readings, kinds).tolist() == [[1.0, 1.0], [0.25, 0.25]]


@pytest.mark.parametrize(
    "changed",
    [
        {"wheel": np.zeros((1, 12, 2))},
        {"wheel": np.zeros((2, 13, 2))},
        {"hidden": np.zeros((1, 13))},
        {"hidden": np.zeros((0, 13, 2)), "wheel": np.zeros((0, 13, 2))},
        {"wheel": np.full((1, 13, 2), math.nan)},
        {"hidden": np.full((1, 13, 2), math.inf)},
        {"squash": "sigmoid"},
        {"squash": []},
        {"encoding": "typed"},
        {"encoding": "kinds"},
        {"steps": -1},
    ],
)
def test_what_is_no_policy_is_refused_in_one_line(changed):
    policy = drawn()
    parts = {"sensors": NINE, "hidden": policy.hidden, "wheel": policy.wheel, **changed}
    with pytest.raises(SwarmError) as caught:
        ReflexPolicy(**parts)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "given_",
    [
        {"readings": np.zeros((2, 3)), "kinds": np.zeros((2, 3))},
        {"readings": np.full((2, 9), math.nan)},
        {"chance": np.zeros(3)},
        {"memory": np.zeros((2, 5))},
    ],
)
def test_what_it_cannot_act_on_is_refused_in_one_line(given_):
    inputs = {"readings": np.zeros((2, 9)), "kinds": np.zeros((2, 9)), **given_}
    with pytest.raises(SwarmError) as caught:
        drawn().act(**inputs)
    assert "\n" not in str(caught.value)


def test_genomes_and_reflexes_of_a_wrong_length_are_refused():
    with pytest.raises(SwarmError, match=r"genome has shape \(5,\); expected \(52,\)"):
        ReflexPolicy.of_genome(NINE, np.zeros(5), units=2)
    with pytest.raises(SwarmError, match="weights have shape"):
        ReflexPolicy.reflex(NINE, np.zeros((9, 2)))
    with pytest.raises(SwarmError, match="units is 65"):
        genome_length(NINE, 65)


def test_other_robots_and_untrained_policies_are_refused():
    with pytest.raises(LearningError, match="trained with 9 proximity sensors"):
        driven(drawn(), 1, design=AGENT3)
    with pytest.raises(LearningError, match="untrained"):
        PolicyLayer(policy=ReflexPolicy.of_genome(NINE, np.zeros(52), units=2))
