"""Threads that do the rows of a kernel: each row once, whatever fails, and the next job is done."""

import threading
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.kernels.block import Block, code_address, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.crew import HELPING, REST, WORDS, let_others_work, part_of_row, rows_of_words, share_rows
from mesa_swarm.kernels.type_names import Integers
from mesa_swarm.kernels.waiting import read_word, write_word
from mesa_swarm.physics.threads import ROW_THREADS, RowCrew


def split_rows(n, parts):
    """Return the first row of each range of n rows, and one past its last."""
    return [(n * part // parts, n * (part + 1) // parts) for part in range(parts)]


class CountedRows(NamedTuple):
    """How often each row was taken, and with which step."""

    taken: Integers
    steps: Integers


@compiled(nogil=True)
def count_rows(block, step, first, last):
    """Count the rows that are taken; the code is the first row, so that the largest is that of the last range."""
    a = unpack(block, CountedRows)
    for i in range(first, last):
        a.taken[i] += 1
        a.steps[i] = step
    return first


@compiled(nogil=True)
def fail_at_row(block, step, first, last):
    """Raise an error for the range in which the row is that `step` names."""
    for i in range(first, last):
        unpack(block, CountedRows).taken[i] += 1
    if first <= step < last:
        raise ValueError("this row")
    return 0


@compiled(nogil=True)
def meet(block, step, first, last):
    """Wait until all three ranges have begun: 0 if they have, 1 if that takes very long."""
    taken = unpack(block, CountedRows).taken
    write_word(taken[first:], np.int64(1))
    for _ in range(step):
        if read_word(taken) + read_word(taken[1:]) + read_word(taken[2:]) == 3:
            return 0
        let_others_work(unpack(block, CountedRows).steps[0])
    return 1


@pytest.fixture
def crew(monkeypatch):
    """Return a crew of three threads, whatever this machine has."""
    monkeypatch.setattr("mesa_swarm.physics.threads.count_processors", lambda: 3)
    return RowCrew()


@pytest.fixture(scope="module")
def addresses():
    return code_address(count_rows), code_address(fail_at_row)


@given(n=st.integers(1, 200), parts=st.integers(1, 20), drawn=st.data())
def test_the_range_that_begins_with_a_row_follows_from_the_row(n, parts, drawn):
    ranges = [pair for pair in enumerate(split_rows(n, parts)) if pair[1][0] < pair[1][1]]
    part, (first, _) = drawn.draw(st.sampled_from(ranges))
    assert part_of_row(first, n, parts) == part


@pytest.mark.parametrize("n", [0, 1, 2, 5, 1000])
@pytest.mark.parametrize("parts", [1, 2, 3, 8])
def test_each_row_is_taken_once_by_any_number_of_threads(crew, addresses, n, parts):
    crew.parts = parts
    block = Block(rows := CountedRows(np.zeros(n, np.int64), np.zeros(n, np.int64)))
    with crew:
        assert crew._size[HELPING] == min(parts, 3) - 1
        codes = [share_rows(crew.numbers, addresses[0], block.numbers, step, n) for step in range(50)]
    assert crew._size[HELPING] == 0
    assert rows.taken.tolist() == [50] * n
    assert rows.steps.tolist() == [49] * n
    assert codes == [max((first for first, last in split_rows(n, parts) if first < last), default=0)] * 50


@pytest.mark.parametrize("row", [0, 4, 8])
def test_an_error_in_one_range_is_raised_when_all_have_ended_and_the_next_call_is_shared(crew, addresses, row):
    crew.parts = 3
    block = Block(rows := CountedRows(np.zeros(9, np.int64), np.zeros(9, np.int64)))
    with crew:
        with pytest.raises(RuntimeError, match="failed in one of the threads"):
            share_rows(crew.numbers, addresses[1], block.numbers, row, 9)
        assert rows.taken.tolist() == [1] * 9
        share_rows(crew.numbers, addresses[0], block.numbers, 7, 9)
    assert rows.taken.tolist() == [2] * 9


def test_who_shares_while_the_threads_are_busy_does_all_itself(crew, addresses):
    other = RowCrew()
    crew.parts = other.parts = 3
    block = Block(rows := CountedRows(np.zeros(9, np.int64), np.zeros(9, np.int64)))
    with crew, other:
        assert (crew._size[HELPING], other._size[HELPING]) == (2, 0)
        share_rows(other.numbers, addresses[0], block.numbers, 1, 9)
        share_rows(crew.numbers, addresses[0], block.numbers, 1, 9)
    assert rows.taken.tolist() == [2] * 9


def test_threads_serve_the_next_model_after_an_error_of_one(crew, addresses):
    crew.parts = 3
    block = Block(rows := CountedRows(np.zeros(9, np.int64), np.zeros(9, np.int64)))
    with pytest.raises(KeyboardInterrupt), crew:
        raise KeyboardInterrupt
    assert not ROW_THREADS._lock.locked()
    with crew:
        share_rows(crew.numbers, addresses[0], block.numbers, 1, 9)
    assert rows.taken.tolist() == [1] * 9


def test_rows_of_words_begin_with_cache_lines():
    for count in (1, 2, 5):
        words = rows_of_words(count)
        assert words.shape == (count, WORDS)
        assert words.ctypes.data % (8 * WORDS) == 0


def test_ranges_are_done_at_the_same_time(crew):
    """Each waits for the others: one thread after the other would never end."""
    crew.parts = 3
    block = Block(CountedRows(np.zeros(3, np.int64), np.full(3, REST)))
    with crew:
        assert share_rows(crew.numbers, code_address(meet), block.numbers, 10**8, 3) == 0


def test_a_thread_that_sleeps_wakes_for_the_next_job(crew, addresses):
    crew.parts, slept = 3, threading.Event()
    block = Block(rows := CountedRows(np.zeros(9, np.int64), np.zeros(9, np.int64)))
    for _ in range(3):
        with crew:
            share_rows(crew.numbers, addresses[0], block.numbers, 1, 9)
        slept.wait(0.05)  # longer than it looks for work
    assert rows.taken.tolist() == [3] * 9
