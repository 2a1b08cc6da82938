"""Kernels in turn: one that is not done is called again, and the others go on after it."""

from typing import NamedTuple

import numpy as np
import pytest

from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import Integers


class Entry(NamedTuple):
    """What `write_entry` takes: where all write, how many have, the number of this one, and whether it may."""

    entries: Integers
    count: Integers
    number: int
    allowed: Integers


@compiled
def write_entry(block, step, first, last):
    e = unpack(block, Entry)
    if e.allowed[0] == 0:
        return 7
    e.entries[e.count[0]] = 100 * step + 10 * last + e.number
    e.count[0] += 1
    return 0


def kernels_of(entries, allowed, attend=None):
    count = np.zeros(1, np.int64)
    blocks = [Block(Entry(entries, count, number, ok)) for number, ok in enumerate(allowed)]
    return count, [Kernel(write_entry, block.numbers, block, attend) for block in blocks]


@pytest.mark.parametrize("n", [0, 1, 3])
def test_kernels_run_in_their_order_with_the_step_and_the_rows(n):
    entries = np.full(3, -1)
    _, kernels = kernels_of(entries, [np.ones(1, np.int64)] * n)
    sequence_of(kernels).run(2, 5)
    assert entries[:n].tolist() == [250, 251, 252][:n]
    assert (entries[n:] == -1).all()


def test_what_one_cannot_do_is_done_for_it_and_the_others_are_not_run_again():
    entries, allowed = np.full(3, -1), [np.ones(1, np.int64), np.zeros(1, np.int64), np.ones(1, np.int64)]
    codes = []

    def attend(code):
        codes.append(code)
        allowed[1][0] = 1

    _, kernels = kernels_of(entries, allowed, attend)
    sequence_of(kernels).run(1, 0)
    assert (entries.tolist(), codes) == ([100, 101, 102], [7])


def test_after_an_error_all_run_anew():
    entries, allowed = np.full(4, -1), [np.ones(1, np.int64), np.zeros(1, np.int64)]

    def attend(code):
        raise KeyError(code)

    count, kernels = kernels_of(entries, allowed, attend)
    sequence = sequence_of(kernels)
    with pytest.raises(KeyError):
        sequence.run(1, 0)
    allowed[1][0] = 1
    sequence.run(2, 0)
    assert (entries[: count[0]]).tolist() == [100, 200, 201]
