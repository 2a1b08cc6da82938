"""Sums of compiled code are those of CPython, bit for bit."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.exact_rounding import MOST_PARTS, exact_sum

DRAWS = 100_000
# Sums of fewer than ten of these are finite.
numbers = st.floats(-1e150, 1e150)


def summed(values):
    return exact_sum(np.array(values, float), len(values), np.empty(MOST_PARTS))


def bits(number):
    return np.float64(number).tobytes()


@given(st.lists(numbers, max_size=9))
def test_a_sum_is_that_of_fsum_whatever_the_numbers(values):
    assert bits(summed(values)) == bits(math.fsum(values))


@pytest.mark.slow
def test_sums_are_those_of_fsum_where_terms_cancel_and_half_way():
    rng = np.random.default_rng(1)
    for _ in range(DRAWS // 5):
        values = rng.choice([1.0, -1.0, 2.0**-53, 2.0**-54, 3.0 * 2.0**-54, 2.0**-106, rng.normal()], 5)
        values = values * 2.0 ** rng.integers(-60, 60, 5) if rng.random() < 0.5 else values
        assert bits(summed(values)) == bits(math.fsum(values))
