"""Digests of compiled functions: a change of what code depends on has another one, a change of words has not."""

from typing import NamedTuple

import numpy as np
import pytest

from mesa_swarm.kernels import digests
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.digests import FUNCTIONS, digest_function
from mesa_swarm.kernels.type_names import Integers, Reals
from support.compiled_rooms import import_compiled_rooms

OUTER = "def outer(x):\n    {}\n    return inner(x) + 1\n"


@pytest.fixture
def count_as_ours(monkeypatch):
    """Make the function of a text, which counts as a compiled function of the package."""

    def make(text, **around):
        space = {"__name__": "made", "np": np, **around}
        exec(text, space)
        function = space[text.split("(")[0].removeprefix("def ")]
        monkeypatch.setattr(digests, "FUNCTIONS", digests.FUNCTIONS | {function})
        return function

    return make


def test_every_compiled_function_of_the_package_has_a_digest():
    import_compiled_rooms()
    assert len(FUNCTIONS) > 300
    assert [function for function in FUNCTIONS if digest_function(function) is None] == []


def test_the_digest_of_a_function_changes_with_what_it_calls_however_far_down(count_as_ours):
    digests_of_outer = set()
    for number in (1, 2, 2):
        lowest = count_as_ours(f"def lowest(x):\n    return x + {number}\n")
        inner = count_as_ours("def inner(x):\n    return lowest(x)\n", lowest=lowest)
        digests_of_outer.add(digest_function(count_as_ours(OUTER.format("pass"), inner=inner)))
    assert len(digests_of_outer) == 2
    assert None not in digests_of_outer


def test_docstrings_and_lines_change_no_digest(count_as_ours):
    inner = count_as_ours("def inner(x):\n    return x\n")
    one = count_as_ours(OUTER.format("'''Add.'''"), inner=inner)
    other = count_as_ours(OUTER.format("'''Add one\n\n    to it.'''"), inner=inner)
    assert digest_function(one) == digest_function(other) is not None


def test_functions_that_call_each_other_have_digests(count_as_ours):
    even = count_as_ours("def even(x):\n    return x == 0 or odd(x - 1)\n")
    odd = count_as_ours("def odd(x):\n    return x != 0 and even(x - 1)\n", even=even)
    even.__globals__["odd"] = odd
    assert None not in (digest_function(even), digest_function(odd))
    assert digest_function(even) != digest_function(odd)


def test_the_fields_of_a_block_and_their_types_belong_to_the_digest():
    class Arrays(NamedTuple):
        first: Reals
        second: Integers

    class Others(NamedTuple):
        first: Integers
        second: Integers

    Others.__qualname__ = Arrays.__qualname__

    def reading(kind):
        return lambda block: unpack(block, kind).first[0]

    assert digest_function(reading(Arrays)) == digest_function(reading(Arrays)) is not None
    assert digest_function(reading(Others)) not in (None, digest_function(reading(Arrays)))
