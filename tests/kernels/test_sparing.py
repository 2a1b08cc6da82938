"""Numba's compiler with less work: the same instructions, and Numba as it was afterwards."""

import re

import numpy as np
import pytest
from numba import njit
from numba.core.compiler import Flags
from numba.core.registry import cpu_target
from numba.core.targetconfig import TargetConfig

from mesa_swarm.kernels.sparing import compile_sparingly, list_values


def total(numbers, factor):
    result = 0.0
    for number in numbers[:-1]:
        result += factor * number if number > 0 else np.sin(number)
    return result


def instructions_of(dispatcher):
    """Return the instructions that Numba writes, without what numbers its functions."""
    dispatcher(np.arange(4.0), 2.0)
    (text,) = dispatcher.inspect_asm().values()
    return re.sub(r"B\d+v\d+", "Bv", text)  # in symbols the length of the name comes first


def made():
    return object()


def how_numba_is():
    return cpu_target.target_context.codegen()._library_class, TargetConfig.values


def test_the_instructions_are_those_that_numba_writes_by_itself():
    plain, sparing = njit(total), njit(total)
    compile_sparingly(sparing)
    assert instructions_of(sparing) == instructions_of(plain)


def test_numba_is_as_before_also_where_a_function_is_refused():
    before = how_numba_is()
    refused = njit(made)
    compile_sparingly(refused)
    with pytest.raises(Exception, match="object"):
        refused()
    assert how_numba_is() == before


def test_values_of_flags_are_those_that_numba_lists():
    flags = Flags()
    assert list_values(flags) == flags.values()
    flags.nrt = flags.no_cfunc_wrapper = True
    assert list_values(flags) == flags.values()
    assert list_values(Flags(flags)) == flags.values()
