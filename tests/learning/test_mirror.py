"""Mirrored controllers: what is the mirror image is answered by the mirror image; what has no mirror is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, ProximitySensor, RobotDesign
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.learning import SensorLayout
from mesa_swarm.learning.reflex_policy import ReflexPolicy, genome_length, half_length, twins_of, whole_genome

NINE = SensorLayout.of(AGENT9)
# Of bearings 0, 30, -30, 60, -60, 90, -90, 140, -140.
SWAPPED = [0, 2, 1, 4, 3, 6, 5, 8, 7]


def drawn(rng, units, encoding):
    half = rng.normal(size=half_length(NINE, units, encoding))
    genome = whole_genome(NINE, half, units=units, encoding=encoding)
    return ReflexPolicy.of_genome(NINE, genome, units=units, encoding=encoding, steps=1)


@given(st.integers(0, 10**6), st.sampled_from([0, 2, 4]), st.sampled_from(["distance", "typed"]))
@settings(max_examples=40, deadline=None)
def test_in_a_mirrored_world_with_a_mirrored_whim_the_wheels_are_exchanged_in_every_step(seed, units, encoding):
    rng = np.random.default_rng(seed)
    policy = drawn(rng, units, encoding)
    one, other = np.zeros((5, units)), np.zeros((5, units))
    for _ in range(4):
        readings = np.where(rng.random((5, 9)) < 0.4, -1.0, rng.uniform(0, 60, (5, 9)))
        kinds, chance = rng.integers(0, 2, (5, 9)), rng.random(5)
        wheels = policy.act(readings, kinds, chance, one)
        mirrored = policy.act(readings[:, SWAPPED], kinds[:, SWAPPED], 1 - chance, other)
        np.testing.assert_allclose(mirrored, wheels[:, ::-1], atol=1e-9)
        np.testing.assert_allclose(other, np.roll(one, units // 2, axis=1), atol=1e-9)


def test_half_of_the_weights_are_given_and_stand_unchanged_in_the_whole():
    half = np.arange(1.0, 1 + half_length(NINE, 2))
    policy = ReflexPolicy.of_genome(NINE, whole_genome(NINE, half, units=2), units=2)
    assert 2 * len(half) == genome_length(NINE, 2)
    assert (np.concatenate([policy.hidden[0, :, 0], policy.wheel[0, :, 0]]) == half).all()


def test_sensors_that_look_straight_ahead_or_back_are_their_own_mirror_image():
    eyes = [ProximitySensor(bearing_degrees=b, range=30, field_of_view_degrees=20) for b in (180, 0, -45, 45)]
    assert twins_of(SensorLayout.of(RobotDesign(sensors=eyes))).tolist() == [0, 1, 3, 2]


def test_blind_robots_are_mirrored_too():
    blind = SensorLayout.of(RobotDesign(name="blind"))
    assert whole_genome(blind, [0.5, 2.0]).tolist() == [0.5, -0.5, 2.0, 2.0]


@pytest.mark.parametrize(
    ("sensors", "half", "options", "message"),
    [
        (NINE, np.zeros(11), {"units": 1}, "units is 1; expected an even number"),
        (NINE, np.zeros(10), {}, r"half a genome has shape \(10,\); expected \(11,\)"),
        (NINE, np.zeros(11), {"encoding": "kinds"}, "encoding"),
        (SensorLayout((0.0, 30.0), (50.0, 50.0), (20.0, 20.0)), np.zeros(4), {}, "at 30 degrees has no mirror image"),
        (SensorLayout((30.0, -30.0), (50.0, 40.0), (20.0, 20.0)), np.zeros(4), {}, "at 30 degrees has no mirror image"),
    ],
)
def test_what_cannot_be_mirrored_is_refused_in_one_line(sensors, half, options, message):
    with pytest.raises(SwarmError, match=message) as caught:
        whole_genome(sensors, half, **options)
    assert "\n" not in str(caught.value)


def test_agent3_needs_five_weights():
    assert half_length(SensorLayout.of(AGENT3), 0) == 5
