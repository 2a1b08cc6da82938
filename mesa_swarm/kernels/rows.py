"""Kernels of rows: what columns are after each of many steps, copied into the rows of buffers."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.kernels.block import CALL_NUMBERS, Block, KernelCall, call_at, code_address, stack_blocks, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import (
    ByteRows,
    Bytes,
    IntegerRows,
    Integers,
    RealRows,
    Reals,
    ShortRows,
    SingleRows,
)

# Places in the counts of rows: how many were written, and how many of these before the first one of the buffer; every
# how many steps there is one; a step after which the next row is, and the step of the next row that Python writes.
ROWS, BEFORE, EVERY, AFTER, ASKED = range(5)
# The code that a kernel returns where Python is to write the row.
ASK = 1


class ByteCopy(NamedTuple):
    """A column as bytes, and rows for it."""

    source: Bytes
    target: ByteRows


class SingleCopy(NamedTuple):
    """A column of float64, and rows of float32."""

    source: Reals
    target: SingleRows


class ShortCopy(NamedTuple):
    """A column of int64, and rows of int32."""

    source: Integers
    target: ShortRows


class RealPick(NamedTuple):
    """Which rows of a table are copied into rows of float64, `width` numbers of each, from a place of these on."""

    source: RealRows
    rows: Integers
    width: int
    place: int
    target: RealRows


class SinglePick(NamedTuple):
    """The same for rows of float32."""

    source: RealRows
    rows: Integers
    width: int
    place: int
    target: SingleRows


@compiled(nogil=True)
def copy_bytes(block, step, first, last):
    """Copy a column as it is into row `first`."""
    c = unpack(block, ByteCopy)
    _copy(c.source, c.target, first)
    return 0


@compiled(nogil=True)
def copy_singles(block, step, first, last):
    """Copy a column of float64 as float32 into row `first`."""
    c = unpack(block, SingleCopy)
    _copy(c.source, c.target, first)
    return 0


@compiled(nogil=True)
def copy_shorts(block, step, first, last):
    """Copy a column of int64 as int32 into row `first`."""
    c = unpack(block, ShortCopy)
    _copy(c.source, c.target, first)
    return 0


@compiled
def _copy(source, target, row):
    for i in range(source.shape[0]):
        target[row, i] = source[i]


@compiled(nogil=True)
def pick_reals(block, step, first, last):
    """Copy some rows of a table into row `first`."""
    _pick(unpack(block, RealPick), first)
    return 0


@compiled(nogil=True)
def pick_singles(block, step, first, last):
    """Copy some rows of a table as float32 into row `first`."""
    _pick(unpack(block, SinglePick), first)
    return 0


@compiled
def _pick(p, row):
    source, rows, target = p.source, p.rows, p.target
    for i in range(rows.shape[0]):
        for k in range(source.shape[1]):
            target[row, i * p.width + p.place + k] = source[rows[i], k]


class CopiedRows(NamedTuple):
    """What `copy_row` takes: rows of `KernelCall`, the counts, and the step of each row."""

    copies: IntegerRows
    counts: Integers
    steps: Integers


@compiled(nogil=True)
def copy_row(block, step, first, last):
    """Write the row of the step before this one, if it is due and not written yet."""
    r = unpack(block, CopiedRows)
    copies, counts, steps, of_step = r.copies, r.counts, r.steps, step - 1
    if of_step <= counts[AFTER] or of_step % counts[EVERY] != 0:
        return 0
    row = counts[ROWS] - counts[BEFORE]
    if of_step >= counts[ASKED] or row >= steps.shape[0]:
        return ASK
    for k in range(copies.shape[0]):
        call = unpack(copies[k], KernelCall)
        call_at(call.address, call.block, step, row, row + 1)
    steps[row] = counts[AFTER] = of_step
    counts[ROWS] += 1
    return 0


CHANGED: dict[tuple[Any, Any], tuple[Any, Any]] = {
    (np.dtype(np.float64), np.dtype(np.float32)): (copy_singles, SingleCopy),
    (np.dtype(np.int64), np.dtype(np.int32)): (copy_shorts, ShortCopy),
}
PICKED: dict[Any, tuple[Any, Any]] = {
    np.dtype(np.float64): (pick_reals, RealPick),
    np.dtype(np.float32): (pick_singles, SinglePick),
}


def copy_of(source: np.ndarray, target: np.ndarray) -> Kernel | None:
    """Return what copies an array into rows of a buffer, (k, ...); None if it cannot be copied so.

    Examples
    --------
    >>> target = np.zeros((3, 2), np.float32)
    >>> kernel = copy_of(np.array([1.0, 2.0]), target)
    >>> kernel.function(kernel.block, 1, 2, 3)
    0
    >>> target.tolist()
    [[0.0, 0.0], [0.0, 0.0], [1.0, 2.0]]
    """
    fits = source.shape == target.shape[1:] and source.flags.c_contiguous and source.flags.writeable
    if not fits or not source.size:
        return sequence_of([]) if fits else None
    flat, rows = source.reshape(-1), target.reshape(len(target), -1)
    if source.dtype == target.dtype:
        block = Block(ByteCopy(flat.view(np.uint8), rows.view(np.uint8)))
        return Kernel(copy_bytes, block.numbers, (block, source, target))
    if (source.dtype, target.dtype) not in CHANGED:
        return None
    function, block_class = CHANGED[source.dtype, target.dtype]
    block = Block(block_class(flat, rows))
    return Kernel(function, block.numbers, (block, source, target))


def pick_of(source: np.ndarray, rows: np.ndarray, target: np.ndarray, place: int = 0) -> Kernel:
    """Return what copies rows of a table of float64 into those of a buffer, (k, r) or (k, r, w), from a place on."""
    table, width = source.reshape(len(source), -1), 1 if target.ndim == 2 else target.shape[2]
    function, block_class = PICKED[target.dtype]
    block = Block(block_class(table, rows.copy(), width, place, target.reshape(len(target), len(rows) * width)))
    return Kernel(function, block.numbers, (block, source, target))


def row_kernel(copies: Sequence[Kernel], counts: np.ndarray, steps: np.ndarray, write: Callable[[], None]) -> Kernel:
    """Return what writes rows by these kernels, when robots have read their sensors in the step after that of the row.

    `counts` are as the places above name them; `write` writes a row in Python.
    """
    calls = [Block(KernelCall(code_address(copy.function), copy.block)) for copy in copies]
    block = Block(CopiedRows(stack_blocks(calls, CALL_NUMBERS), counts, steps))
    return Kernel(copy_row, block.numbers, (block, copies), lambda code: write())
