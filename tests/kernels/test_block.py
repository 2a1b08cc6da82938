"""Arguments in a block: a compiled function takes out what was put in, of copies that of the copies."""

import copy
import pickle
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import typeof

from mesa_swarm.kernels.block import Block, pack, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import Codes, Flags, RealRows, Reals, declared_type, name_type, types_in_words


class Inner(NamedTuple):
    codes: Codes
    pair: tuple[int, float]
    nothing: Codes | None


class Outer(NamedTuple):
    table: RealRows
    inner: Inner
    flags: Flags
    cube: Annotated[np.ndarray, "int64[3C]"]
    factor: float


class Single(NamedTuple):
    array: Reals


sizes, whole, real = st.integers(0, 5), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False)


@compiled
def change_and_sum(block):
    """Change arrays in place, and return the numbers and sums."""
    b = unpack(block, Outer)
    table, flags, cube = b.table, b.flags, b.cube
    (number, share), codes, nothing = b.inner.pair, b.inner.codes, b.inner.nothing
    table *= b.factor
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
    return Outer(table, Inner(codes, (number, share), None), flags, rng.integers(-9, 9, (rows, columns, 3)), factor)


@pytest.mark.slow
@given(sizes, sizes, whole, real, st.floats(-9, 9))
def test_a_compiled_function_takes_out_of_a_block_what_was_put_in(rows, columns, number, share, factor):
    given = values(rows, columns, number, share, factor)
    table, (codes, *_), flags, cube, _ = copy.deepcopy(given)
    result = change_and_sum(Block(given).numbers)
    assert result == (number, share, True, codes.sum(), cube.shape, cube[:, -1:, ::2].sum())
    assert (given.table == table * factor).all()
    assert (given.flags == ~flags).all()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_of_a_block_refers_to_copies_of_its_arrays(copied):
    given = values(3, 2)
    block, table = copied((Block(given), given[0]))
    change_and_sum(block.numbers)
    assert (table == 2 * given[0]).all()


def test_a_block_keeps_the_arrays_that_it_refers_to():
    block = Block(Single(np.arange(1e5)))
    others = [np.zeros(10**5) for _ in range(9)]
    assert first_and_sum(block.numbers) == (99999.0, 4999950000.0)
    assert len(others) == 9


@compiled
def first_and_sum(block):
    """Return the last and the sum."""
    array = unpack(block, Single).array
    return array[-1], array.sum()


@pytest.mark.parametrize(
    "wrong", [np.zeros(3, np.float32), np.zeros((2, 2)), np.zeros(6)[::2], np.zeros((2, 2)).T[0], 1.0, None]
)
def test_arguments_of_other_types_are_refused(wrong):
    with pytest.raises(TypeError, match=r"a block got .*; expected .*Single\(float64\[1C\]\)"):
        Block(Single(wrong))


def test_an_array_that_cannot_be_written_to_is_refused():
    array = np.zeros(3)
    array.flags.writeable = False
    with pytest.raises(TypeError, match=r"float64\[1Cr\]"):
        Block(Single(array))


@compiled
def is_none(block):
    """Return whether there is no block."""
    return unpack(block, Single) is None


def test_a_block_of_a_read_only_array_has_its_address():
    array = np.arange(3.0)
    numbers = pack((array,)).tolist()
    array.flags.writeable = False
    assert pack((array,)).tolist() == numbers == [array.ctypes.data, 3]


def test_instead_of_a_block_there_may_be_none():
    assert is_none(None)
    assert not is_none(Block(Single(np.zeros(2))).numbers)


def test_the_types_of_named_tuples_are_read_from_their_names():
    kind = typeof(values(2, 3))
    assert kind == declared_type(Outer)
    assert types_in_words(name_type(kind)) == (kind,)
