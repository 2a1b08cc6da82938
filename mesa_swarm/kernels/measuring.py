"""Kernels of measures: what counts, means and single numbers of columns are, rows of these, and whether a run ends."""

import math
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.kernels.block import KernelCall, call_at, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import ByteRows, Codes, Flags, IntegerRows, Integers, RealRows, Reals

COUNT, SHARE, MEAN, ELEMENT = range(4)
ONLY = 0


@compiled
def measure_rows(values, how, low, high, place, empty) -> float:
    """Return the measure of an array: how many or which share of its values count, their mean, or one of them."""
    n = values.shape[0]
    if how == ELEMENT:
        return 1.0 * values[place] if place < n else empty
    if n == 0:
        return empty
    if how == MEAN:
        total = 0.0
        for i in range(n):
            total += 1.0 * values[i]
        return total / n
    number = 0
    for i in range(n):
        if math.isnan(low):  # without bounds
            number += values[i] != 0
        else:
            number += low <= values[i] <= high
    return float(number) if how == COUNT else number / n


@compiled
def write_speeds(command, design, sideways, speeds):
    """Write the speed of each body as commanded (n,): the mean of its wheels, or the length of a sideways command."""
    for i in range(speeds.shape[0]):
        if sideways[design[i]]:
            speeds[i] = math.sqrt(command[i, 0] * command[i, 0] + command[i, 1] * command[i, 1])
        else:
            speeds[i] = abs(0.5 * (command[i, 0] + command[i, 1]))


class Kind(NamedTuple):
    """Of a block of a measure: what it is besides its array, and where it is written."""

    how: int
    low: float
    high: float
    place: int
    empty: float
    out: Reals
    slot: int


class RealMeasure(NamedTuple):
    """A measure of real numbers."""

    values: Reals
    kind: Kind


class IntegerMeasure(NamedTuple):
    """A measure of whole numbers."""

    values: Integers
    kind: Kind


class FlagMeasure(NamedTuple):
    """A measure of what is true or not."""

    values: Flags
    kind: Kind


class CodeMeasure(NamedTuple):
    """A measure of small whole numbers."""

    values: Codes
    kind: Kind


class SpeedMeasure(NamedTuple):
    """A measure of speeds as commanded, which are written first."""

    command: RealRows
    design: Integers
    sideways: Flags
    values: Reals
    kind: Kind


@compiled(nogil=True)
def measure_reals(block, step, first, last):
    """Write a measure of real numbers."""
    _write(unpack(block, RealMeasure))
    return 0


@compiled(nogil=True)
def measure_integers(block, step, first, last):
    """Write a measure of whole numbers."""
    _write(unpack(block, IntegerMeasure))
    return 0


@compiled(nogil=True)
def measure_flags(block, step, first, last):
    """Write a measure of what is true or not."""
    _write(unpack(block, FlagMeasure))
    return 0


@compiled(nogil=True)
def measure_codes(block, step, first, last):
    """Write a measure of small whole numbers."""
    _write(unpack(block, CodeMeasure))
    return 0


@compiled(nogil=True)
def measure_speeds(block, step, first, last):
    """Write a measure of the speeds of bodies as commanded."""
    m = unpack(block, SpeedMeasure)
    write_speeds(m.command, m.design, m.sideways, m.values)
    _write(m)
    return 0


@compiled
def _write(m):
    k = m.kind
    k.out[k.slot] = measure_rows(m.values, k.how, k.low, k.high, k.place, k.empty)


MEASURING: dict[Any, tuple[Any, Any]] = {
    np.dtype(np.float64): (measure_reals, RealMeasure),
    np.dtype(np.int64): (measure_integers, IntegerMeasure),
    np.dtype(np.bool_): (measure_flags, FlagMeasure),
    np.dtype(np.int8): (measure_codes, CodeMeasure),
}


class RowArrays(NamedTuple):
    """What `write_row` takes.

    Rows of `KernelCall` of measures, where they write, a table, and how many rows it has; whether a function has raised
    an error, and a flag that ends the run after this step.
    """

    measures: IntegerRows
    numbers: Reals
    table: RealRows
    steps: Integers
    written: Integers
    failed: Flags
    flag: Flags


# The code that a kernel returns when its buffer is full.
FULL = 1
MOST_ROWS = 1000


@compiled(nogil=True)
def write_row(block, step, first, last):
    """Write a row of what measures are now, with the number of the step."""
    r = unpack(block, RowArrays)
    measures, numbers, table, steps, written = r.measures, r.numbers, r.table, r.steps, r.written
    if written[ONLY] == table.shape[0]:
        return FULL
    for k in range(measures.shape[0]):
        call = unpack(measures[k], KernelCall)
        if call_at(call.address, call.block, step, first, last) != 0:
            r.failed[ONLY] = r.flag[ONLY] = True  # the step is whole: its error is raised when it is counted
            return 0
        table[written[ONLY], k] = numbers[k]
    steps[written[ONLY]] = step
    written[ONLY] += 1
    return 0


class StopArrays(NamedTuple):
    """What `check_stop` takes: the measure, where it is written, the interval, and the flag."""

    measure: KernelCall
    number: Reals
    low: float
    high: float
    flag: Flags


@compiled(nogil=True)
def check_stop(block, step, first, last):
    """Set the flag where the number is within the interval."""
    s = unpack(block, StopArrays)
    if call_at(s.measure.address, s.measure.block, step, first, last) != 0:
        s.flag[ONLY] = True  # Python looks at the condition, and raises its error
        return 0
    if s.low <= s.number[ONLY] <= s.high:
        s.flag[ONLY] = True
    return 0


class Copies(NamedTuple):
    """Two arrays, as rows of bytes."""

    source: ByteRows
    target: ByteRows


@compiled(nogil=True)
def copy_rows(block, step, first, last):
    """Copy all rows."""
    c = unpack(block, Copies)
    source, target = c.source, c.target
    for i in range(source.shape[0]):
        for k in range(source.shape[1]):
            target[i, k] = source[i, k]
    return 0
