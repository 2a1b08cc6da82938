"""The remainder of pages is that of the C library, to the last bit."""

import math

from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.live.remainders import remainder_of

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@given(NUMBERS, NUMBERS.filter(bool))
def test_it_is_that_of_the_c_library(x, y):
    assert math.copysign(1.0, remainder_of(x, y)) == math.copysign(1.0, math.fmod(x, y))
    assert remainder_of(x, y) == math.fmod(x, y)


@given(NUMBERS, st.sampled_from([math.inf, -math.inf]))
def test_of_an_infinite_divisor_all_is_left(x, y):
    assert remainder_of(x, y) == x


@given(NUMBERS)
def test_what_is_undefined_is_not_a_number(x):
    assert math.isnan(remainder_of(x, 0.0))
    assert math.isnan(remainder_of(math.inf, x))
    assert math.isnan(remainder_of(math.nan, x))
