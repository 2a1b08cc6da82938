"""Numbers that compiled functions draw are those that NumPy draws of the same generator."""

from typing import NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_between, draw_number, draw_word, stream_of, words_of
from mesa_swarm.kernels.type_names import Reals


class Drawing(NamedTuple):
    out: Reals
    low: float
    high: float
    stream: Stream


@compiled
def fill_between(block):
    d = unpack(block, Drawing)
    out = d.out
    for i in range(out.shape[0]):
        out[i] = draw_between(d.stream, d.low, d.high)


BOUNDS = st.floats(-1e6, 1e6)


@given(st.integers(0, 2**32), BOUNDS, BOUNDS, st.integers(1, 50))
def test_compiled_draws_are_those_of_the_generator_and_leave_it_in_the_same_state(seed, low, width, count):
    generator, twin = np.random.default_rng(seed), np.random.default_rng(seed)
    out, high = np.empty(count), low + abs(width)
    for _ in range(2):
        fill_between(Block(Drawing(out, low, high, stream_of(generator))).numbers)
        np.testing.assert_array_equal(out, twin.uniform(low, high, count))
    assert draw_number(stream_of(generator)) == twin.random()
    assert generator.bit_generator.state == twin.bit_generator.state


@given(st.integers(0, 2**32))
def test_compiled_words_are_those_of_the_generator_also_between_real_numbers(seed):
    generator, twin = np.random.default_rng(seed), np.random.default_rng(seed)
    for _ in range(3):
        assert int(draw_word(words_of(generator))) == int(twin.integers(2**64, dtype=np.uint64))
        assert draw_number(stream_of(generator)) == twin.random()
    assert generator.bit_generator.state == twin.bit_generator.state
