"""Draws for errors of sensors: those of the generator, once a step, whatever robots come or go within it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.physics.sensor_noise import SensorNoise

SHAPES = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 3)), min_size=1, max_size=6)


def former_draws(generator, noise, step, shape):
    """Return the draws of a step as Python drew them before a kernel did, and what it remembered."""
    if noise is None or noise[0] != step:
        noise = (step, generator.bit_generator.state, None)
    step, before, draws = noise
    if draws is None or draws.shape != shape:
        generator.bit_generator.state = before
        draws = generator.random(shape)
    return (step, before, draws)


@given(st.integers(0, 2**32), SHAPES, st.lists(st.integers(0, 1), min_size=6, max_size=6))
def test_draws_and_the_stream_are_as_python_drew_them_whatever_shapes_follow_in_whatever_steps(seed, shapes, advances):
    generator, twin = np.random.default_rng(seed), np.random.default_rng(seed)
    noise, former, step = SensorNoise(generator), None, 3
    for shape, goes_on in zip(shapes, advances, strict=False):
        step += goes_on
        former = former_draws(twin, former, step, shape)
        np.testing.assert_array_equal(noise.draw(step, shape), former[2])
        assert generator.bit_generator.state == twin.bit_generator.state
        stored = noise.store()
        assert stored[:2] == former[:2]
        np.testing.assert_array_equal(stored[2], former[2])


def test_before_any_draw_nothing_is_stored():
    assert SensorNoise(np.random.default_rng(1)).store() is None


@pytest.mark.parametrize("shape", [(2, 3), (4, 3)])
def test_what_was_stored_is_taken_back_and_drawn_anew_only_for_other_robots(shape):
    noise = SensorNoise(np.random.default_rng(1))
    noise.draw(5, (2, 3))
    step, _, draws = noise.store()
    again = SensorNoise(np.random.default_rng(1))
    again.generator.bit_generator.state = noise.generator.bit_generator.state
    again.restore(step, draws)
    np.testing.assert_array_equal(again.draw(5, shape), np.random.default_rng(1).random(shape))


def test_robots_that_come_after_the_last_reading_of_a_step_change_nothing_of_the_stream():
    generator, twin = np.random.default_rng(1), np.random.default_rng(1)
    noise = SensorNoise(generator)
    noise.draw(5, (2, 3))
    noise.arrays_for((4, 3))  # as when a kernel is made
    twin.random((2, 3))
    np.testing.assert_array_equal(noise.draw(6, (4, 3)), twin.random((4, 3)))
