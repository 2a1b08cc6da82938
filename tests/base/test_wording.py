"""Values as a reader sees them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.wording import quantity, time_text

UNITS = {"s": 1, "min": 60, "h": 3600}


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.01, "0.01 s"), (59.94, "59.9 s"), (59.95, "1 min 0 s"), (60, "1 min 0 s"), (3725.9, "1 h 2 min 6 s")],
)
def test_times_are_written_with_the_units_that_a_reader_uses(seconds, text):
    assert time_text(seconds) == text


@given(st.floats(1, 1e7))
def test_the_text_of_a_time_is_that_time_within_half_of_its_last_digit(seconds):
    words = time_text(seconds).replace(",", "").split()
    read = sum(float(number) * UNITS[unit] for number, unit in zip(words[::2], words[1::2], strict=True))
    assert abs(read - seconds) <= (0.05001 if seconds < 60 else 0.5001)


def test_one_thing_is_named_in_the_singular_and_no_thing_in_the_plural():
    assert [quantity(n, "seed") for n in (0, 1, 2, 1200)] == ["0 seeds", "1 seed", "2 seeds", "1,200 seeds"]
