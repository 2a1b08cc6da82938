"""Exported C: compiled without a warning, equal to the policy in Python; what cannot be exported is refused."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT3
from mesa_swarm.base.errors import LearningError, SwarmError
from mesa_swarm.learning import ReflexPolicy, SensorLayout
from mesa_swarm.learning.c_source import c_source, export_c
from support.c_code import acted_in_c, compiled_library, drawn_inputs, needs_cc, place
from support.exported_policies import NINE, POLICIES, in_python, q

INPUTS = 10_000


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("name", POLICIES)
def test_compiled_c_acts_as_the_policy(name, tmp_path):
    policy, rng = POLICIES[name], np.random.default_rng(1)
    library = compiled_library(export_c(policy, tmp_path / "robot.c")[0], policy)
    readings, kinds, chance = drawn_inputs(NINE, INPUTS, rng)
    numbers = rng.integers(0, 1000, INPUTS) if policy.copies > 1 else None
    expected, memory = in_python(policy, readings, kinds, chance, numbers)
    wheels, remembered = acted_in_c(library, policy, readings, kinds, chance, numbers=numbers)
    assert len(np.unique(wheels[:, 0])) > 1
    assert np.abs(wheels - expected).max() <= 1e-6
    assert np.abs(remembered - memory).max(initial=0) <= 1e-6


@needs_cc
@pytest.mark.parametrize("name", ["Q of 4 actions", "a recurrent network", "wires"])
def test_without_a_chance_c_takes_the_best_action_too(name, tmp_path):
    policy = POLICIES[name]
    library = compiled_library(export_c(policy, tmp_path / "robot.c")[0], policy)
    readings, kinds, _ = drawn_inputs(NINE, 300, np.random.default_rng(2))
    wheels, _ = acted_in_c(library, policy, readings, kinds, np.full(300, -1.0))
    assert np.abs(wheels - policy.act(readings, kinds)).max() <= 1e-6


@needs_cc
def test_memory_carries_over_from_step_to_step_until_it_is_reset(tmp_path):
    policy = POLICIES["a recurrent network"]
    library = compiled_library(export_c(policy, tmp_path / "robot.c")[0], policy)
    memory, state = np.zeros((5, 3)), np.zeros((5, 3))
    for seed in range(30):
        inputs = drawn_inputs(NINE, 5, np.random.default_rng(seed))
        expected = policy.act(*inputs, memory)
        wheels, state = acted_in_c(library, policy, *inputs, memory=state)
        assert np.abs(wheels - expected).max() <= 1e-6
    assert np.abs(state - memory).max() <= 1e-6
    library.robot_reset(place(state[2]))
    assert np.flatnonzero((state == 0).all(axis=1)).tolist() == [2]


@needs_cc
@pytest.mark.parametrize("name", ["a recurrent network of 2 robots, typed", "wires of 2 robots, typed"])
def test_one_set_of_weights_can_be_exported_alone(name, tmp_path):
    policy = POLICIES[name]
    library = compiled_library(export_c(policy, tmp_path / "robot.c", copy=1)[0], policy.of_robot(1))
    readings, kinds, chance = drawn_inputs(NINE, 200, np.random.default_rng(4))
    expected, _ = in_python(policy, readings, kinds, chance, np.ones(200, np.int64))
    wheels, _ = acted_in_c(library, policy, readings, kinds, chance)
    assert np.abs(wheels - expected).max() <= 1e-6


@needs_cc
def test_in_single_precision_wheels_differ_by_its_rounding_only(tmp_path):
    policy = POLICIES["a recurrent network"]
    library = compiled_library(export_c(policy, tmp_path / "robot.c", number="float")[0], policy)
    readings, kinds, chance = drawn_inputs(NINE, 1000, np.random.default_rng(5))
    wheels, _ = acted_in_c(library, policy, readings, kinds, chance, number="float")
    difference = np.abs(wheels - in_python(policy, readings, kinds, chance)[0]).max()
    assert 0 < difference < 1e-5


@needs_cc
def test_in_single_precision_choices_differ_where_chance_is_at_a_border_only(tmp_path):
    policy = POLICIES["Q of 4 actions"]
    library = compiled_library(export_c(policy, tmp_path / "robot.c", number="float")[0], policy)
    readings, kinds, chance = drawn_inputs(NINE, 5000, np.random.default_rng(6))
    wheels, _ = acted_in_c(library, policy, readings, kinds, chance, number="float")
    values = policy.values(readings, kinds)
    shares = np.exp((values - values.max(axis=1, keepdims=True)) / policy.temperature)
    borders = np.cumsum(shares, axis=1) / shares.sum(axis=1, keepdims=True)
    clear = np.abs(borders - chance[:, None]).min(axis=1) > 1e-5
    assert clear.mean() > 0.99
    assert (wheels == policy.act(readings, kinds, chance))[clear].all()


@needs_cc
def test_the_generator_of_chances_is_the_documented_one(tmp_path):
    library = compiled_library(export_c(q(4), tmp_path / "robot.c")[0], q(4))
    library.robot_chance.restype = ctypes.c_double
    seed, x, drawn = ctypes.c_uint32(2463534242), 2463534242, []
    for _ in range(1000):
        x ^= (x << 13) & 0xFFFFFFFF
        x ^= x >> 17
        x ^= (x << 5) & 0xFFFFFFFF
        drawn.append(library.robot_chance(ctypes.byref(seed)))
        assert drawn[-1] == (x >> 8) / 2**24
        assert seed.value == x
    assert 0 <= min(drawn) < max(drawn) < 1
    assert abs(np.mean(drawn) - 0.5) < 4 / np.sqrt(12 * 1000)


def test_the_source_is_the_same_each_time_and_names_the_sensors():
    policy = q(4)
    files = c_source(policy, "robot")
    assert files == c_source(policy, "robot")
    assert "0: at 0 degrees, range 50, field of view 30 degrees" in files["robot.h"]


@pytest.mark.parametrize(
    ("policy", "name", "options", "line"),
    [
        (q(4), "Robot", {}, "the name is 'Robot'; expected at most 50 small letters"),
        (q(4), "switch", {}, "and no word of C"),
        (q(4), "robot", {"number": "half"}, "number"),
        (q(4, copies=2), "robot", {"copy": 2}, "index|copy"),
        (None, "robot", {}, "policy is None; expected a policy"),
    ],
)
def test_wrong_options_are_refused_in_one_line(policy, name, options, line):
    with pytest.raises(SwarmError, match=line) as caught:
        c_source(policy, name, **options)
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) <= 300


def test_weights_beyond_single_precision_are_refused():
    weights = np.zeros((1, 5, 2))
    weights[0, 0, 0] = 1e300
    policy = ReflexPolicy(sensors=SensorLayout.of(AGENT3), hidden=np.zeros((1, 5, 0)), wheel=weights)
    with pytest.raises(LearningError, match="beyond the range of float; export it as double"):
        c_source(policy, "robot", number="float")


def test_policies_without_sensors_are_refused():
    none = SensorLayout((), (), ())
    policy = ReflexPolicy(sensors=none, hidden=np.zeros((1, 2, 0)), wheel=np.zeros((1, 2, 2)))
    with pytest.raises(LearningError, match="no proximity sensors"):
        c_source(replace(policy, steps=1), "robot")


def test_a_file_of_another_ending_is_refused(tmp_path):
    with pytest.raises(SwarmError, match="does not end with"):
        export_c(q(4), tmp_path / "robot.h")
    assert not list(tmp_path.iterdir())
