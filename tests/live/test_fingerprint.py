"""The fingerprint in compiled code is that of `state_hash`."""

from hashlib import blake2b

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.kernels.block import Block, stack_blocks
from mesa_swarm.live.fingerprint import (
    BLOCK_BYTES,
    DIGEST_BYTES,
    KIND,
    KINDS,
    PIECES,
    DigestArrays,
    Fingerprint,
    TextPiece,
    digest_pieces,
)
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.state_hash import bytes_of_numbers

NUMBERS = st.lists(st.integers(0, 100), max_size=300)


def digest_of(step, blocks):
    kinds = [(KINDS[type(block._values)],) for block in blocks]
    out = np.zeros(DIGEST_BYTES, np.uint8)
    scratch = np.zeros(8, np.uint64), np.zeros(2, np.int64), np.zeros(BLOCK_BYTES, np.uint8)
    words = np.zeros(16, np.uint64), np.zeros(16, np.uint64), np.zeros(20, np.uint8)
    block = Block(DigestArrays(stack_blocks(blocks, KIND + 1, kinds), out, *scratch, *words))
    digest_pieces(block.numbers, step, 0, 0)
    return out.tobytes().hex()


@given(st.integers(0, 10**12), st.binary(max_size=400))
def test_the_digest_of_bytes_is_blake2b(step, text):
    blocks = [Block(TextPiece(np.frombuffer(bytearray(text), np.uint8)))] if text else []
    assert digest_of(step, blocks) == blake2b(f"{step}".encode() + text, digest_size=16).hexdigest()


@given(NUMBERS, st.sampled_from(sorted(PIECES, key=str)))
def test_arrays_of_each_type_count_as_the_numbers_that_they_are_in_python(numbers, kind):
    array = np.array(numbers).astype(kind)
    expected = blake2b(b"3" + bytes_of_numbers(array), digest_size=16).hexdigest()
    assert digest_of(3, [Block(PIECES[kind](array))]) == expected


def test_zero_counts_without_its_sign():
    kind = np.dtype(float)
    assert digest_of(0, [Block(PIECES[kind](np.array([-0.0])))]) == digest_of(0, [Block(PIECES[kind](np.array([0.0])))])


@pytest.mark.parametrize("name", ["fire_fighting", "boids", "ant_trails", "q_learning", "signposts"])
def test_it_is_that_of_the_model_after_every_step(name):
    model = find_model(name)(rng=1)
    model.sense()
    fingerprint = Fingerprint(model)
    for steps in (0, 1, 5, 40):
        model.run(steps)
        assert model.state_hash() == fingerprint.hexdigest(model.completed)
