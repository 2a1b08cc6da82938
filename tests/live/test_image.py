"""Arrays in an image are where blocks lead to."""

from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

from mesa_swarm.errors import ExportError
from mesa_swarm.kernels.block import Block, KernelCall, note_blocks, stack_blocks
from mesa_swarm.kernels.draws import Stream, stream_of
from mesa_swarm.kernels.type_names import IntegerRows, Integers, Reals
from mesa_swarm.live.image import Functions, Image, clean_memory

BASE, CODE = 1024, 2**40 + 64


class Numbers(NamedTuple):
    values: Reals
    share: float
    inner: Integers


class Drawing(NamedTuple):
    stream: Stream


class Rows(NamedTuple):
    calls: IntegerRows


def image_of(root, notes, streams=(), functions=None):
    return Image([root], notes, {CODE: "kernel"}, streams, Functions() if functions is None else functions, BASE)


def numbers_at(image, address, count):
    begin = address - image.base
    return np.frombuffer(image.content[begin : begin + 8 * count], np.int64).tolist()


def test_a_block_leads_to_copies_of_its_arrays():
    with note_blocks() as notes:
        values, inner = np.array([1.5, 2.5]), Block(KernelCall(CODE, np.arange(3)))
        root = Block(Numbers(values, 0.5, inner.numbers))
    image = image_of(root, notes)
    address, count, share, place, length = numbers_at(image, image.address_of(root.numbers), 5)
    assert (count, length, np.int64(share).view(np.float64)) == (2, 3, 0.5)
    assert np.frombuffer(image.content, np.float64, 2, address - BASE).tolist() == [1.5, 2.5]
    function, array, size = numbers_at(image, place, 3)
    assert (function, numbers_at(image, array, size)) == (Functions.FIRST, [0, 1, 2])


def test_views_of_one_array_overlap_in_the_image_as_well():
    with note_blocks() as notes:
        table = np.arange(6.0)
        inner = Block(Numbers(table[2:4], 0.0, np.zeros(1, np.int64)))
        root = Block(Numbers(table, 0.0, inner.numbers))
    image = image_of(root, notes)
    assert image.address_of(table[2:4]) - image.address_of(table) == 16


def test_rows_of_blocks_lead_to_what_their_blocks_do():
    with note_blocks() as notes:
        blocks = [Block(KernelCall(CODE, np.full(2, 7))), None]
        root = Block(Rows(stack_blocks(blocks, 4, [(9,), (0,)])))
    image = image_of(root, notes)
    address, rows, _ = numbers_at(image, image.address_of(root.numbers), 3)
    function, array, size, more, *zeros = numbers_at(image, address, 4 * rows)
    assert (function, size, more, zeros) == (Functions.FIRST, 2, 9, [0, 0, 0, 0])
    assert numbers_at(image, array, 2) == [7, 7]


def test_a_stream_is_four_words_of_its_state():
    generator = np.random.default_rng(4)
    with note_blocks() as notes:
        root = Block(Drawing(stream_of(generator)))
    functions = Functions()
    image = image_of(root, notes, [generator], functions)
    draw, state = numbers_at(image, image.address_of(root.numbers), 2)
    assert functions.places["draw_number"] == draw
    words = np.frombuffer(image.content, np.uint64, 4, state - BASE)
    assert int(words[0]) << 64 | int(words[1]) == generator.bit_generator.state["state"]["state"]


def test_a_stream_of_others_is_refused():
    with note_blocks() as notes:
        root = Block(Drawing(stream_of(np.random.default_rng(4))))
    with pytest.raises(ExportError, match="not one of the model's own"):
        image_of(root, notes)


def test_addresses_of_blocks_that_were_not_noted_are_refused():
    inner = Block(KernelCall(CODE, np.arange(3)))
    with note_blocks() as notes:
        root = Block(Rows(inner.numbers.reshape(1, 3)))
    with pytest.raises(ExportError, match="addresses"):
        image_of(root, notes)


def test_scratch_is_zero_while_an_image_is_made_and_as_before_afterwards():
    before = np.empty, np.empty_like
    with clean_memory():
        assert not np.empty(1000).any()
        assert not np.empty_like(np.ones(1000)).any()
    assert (np.empty, np.empty_like) == before


def test_what_is_compiled_meanwhile_has_the_functions_that_it_names():
    with clean_memory():
        made = njit(lambda n: np.zeros(n) + np.empty(n).size)(3)
        assert not np.empty(1000).any()
    assert made.tolist() == [3.0, 3.0, 3.0]
