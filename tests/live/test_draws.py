"""The generator of pages draws what NumPy's draws."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.live.draws import high_product, next_word
from mesa_swarm.live.image import _words_of

WORDS = st.integers(0, 2**64 - 1)


@given(st.integers(0, 2**32), st.integers(1, 200))
def test_words_are_those_of_numpy(seed, count):
    generator = np.random.Generator(np.random.PCG64(seed))
    words = _words_of(generator)
    expected = generator.integers(2**64, size=count, dtype=np.uint64).tolist()
    assert [int(next_word(words)) for _ in range(count)] == expected
    assert (_words_of(generator) == words).all()


@given(WORDS, WORDS)
def test_the_upper_half_of_a_product_is_exact(one, other):
    assert int(high_product(np.uint64(one), np.uint64(other))) == one * other >> 64
