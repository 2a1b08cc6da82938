"""Arguments in a block: a compiled function takes out what was put in, of copies that of the copies."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.block import Block, unpack
from mesa_swarm.geometry.compiled import compiled

WORDS = "float64[2C] (int8[1C] (int64 float64) none) bool[1C] int64[3C] float64"
sizes, whole, real = st.integers(0, 5), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False)


@compiled
def change_and_sum(block):
    """Change arrays in place, and return the numbers and sums."""
    table, (codes, (number, share), nothing), flags, cube, factor = unpack(block, WORDS)
    table *= factor
    for i in range(flags.shape[0]):
        flags[i] = not flags[i]
    return number, share, nothing is None, codes.sum(), cube.shape, cube[:, -1:, ::2].sum()


def values(rows, columns, number=7, share=0.25, factor=2.0):
    """Return arguments of these sizes."""
    rng = np.random.default_rng([rows, columns])
    table, codes, flags = (
        rng.random((rows, columns)),
        rng.integers(-99, 99, rows).astype(np.int8),
        rng.random(rows) < 0.5,
    )
    return table, (codes, (number, share), None), flags, rng.integers(-9, 9, (rows, columns, 3)), factor


@given(sizes, sizes, whole, real, st.floats(-9, 9))
def test_a_compiled_function_takes_out_of_a_block_what_was_put_in(rows, columns, number, share, factor):
    given = values(rows, columns, number, share, factor)
    table, (codes, *_), flags, cube, _ = copy.deepcopy(given)
    result = change_and_sum(Block(WORDS, *given).numbers)
    assert result == (number, share, True, codes.sum(), cube.shape, cube[:, -1:, ::2].sum())
    assert (given[0] == table * factor).all()
    assert (given[2] == ~flags).all()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_of_a_block_refers_to_copies_of_its_arrays(copied):
    given = values(3, 2)
    block, table = copied((Block(WORDS, *given), given[0]))
    change_and_sum(block.numbers)
    assert (table == 2 * given[0]).all()


def test_a_block_keeps_the_arrays_that_it_refers_to():
    block = Block("float64[1C]", np.arange(1e5))
    others = [np.zeros(10**5) for _ in range(9)]
    assert first_and_sum(block.numbers) == (99999.0, 4999950000.0)
    assert len(others) == 9


@compiled
def first_and_sum(block):
    """Return the last and the sum."""
    (array,) = unpack(block, "float64[1C]")
    return array[-1], array.sum()


@pytest.mark.parametrize(
    "wrong", [np.zeros(3, np.float32), np.zeros((2, 2)), np.zeros(6)[::2], np.zeros((2, 2)).T[0], 1.0, None]
)
def test_arguments_of_other_types_are_refused(wrong):
    with pytest.raises(TypeError, match=r"a block got .*; expected float64\[1C\]"):
        Block("float64[1C]", wrong)


def test_an_array_that_cannot_be_written_to_is_refused():
    array = np.zeros(3)
    array.flags.writeable = False
    with pytest.raises(TypeError, match=r"float64\[1Cr\]"):
        Block("float64[1C]", array)
