"""Events that compiled functions report: numbers written into a row a robot, and a buffer that collects them."""

import math
from typing import NamedTuple

import numpy as np

from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.measuring import FULL, ONLY
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals

# What a kernel returns where a number that was reported is infinite; `FULL` where the buffer is full.
INFINITE = 2
MOST_EVENTS = 4096


class EventBuffer(NamedTuple):
    """Events in the order in which they happened: rows of four columns, and how many are filled, in an array of one."""

    step: Integers
    code: Integers
    unique_id: Integers
    value: Reals
    filled: Integers

    @classmethod
    def empty(cls) -> "EventBuffer":
        """Return a buffer with room for `MOST_EVENTS`."""
        step, code, unique_id = (np.zeros(MOST_EVENTS, np.int64) for _ in range(3))
        return cls(step, code, unique_id, np.zeros(MOST_EVENTS), np.zeros(1, np.int64))


class ReportArrays(NamedTuple):
    """What `collect_events` takes.

    Parameters
    ----------
    reports : float64 ndarray, shape (k, n)
        Of k names a number a robot, NaN where nothing happened; NaN again when it is collected.
    codes : int64 ndarray, shape (k,)
    unique_id : int64 ndarray, shape (n,)
    buffer : EventBuffer
    """

    reports: RealRows
    codes: Integers
    unique_id: Integers
    buffer: EventBuffer


@compiled(nogil=True)
def collect_events(block, step, first, last):
    """Move what was reported into the buffer; what is left when that is full follows in the next call."""
    r = unpack(block, ReportArrays)
    reports, codes, unique_id, buffer = r.reports, r.codes, r.unique_id, r.buffer
    steps, buffered_codes, ids, values, filled = buffer.step, buffer.code, buffer.unique_id, buffer.value, buffer.filled
    for k in range(reports.shape[0]):
        for i in range(reports.shape[1]):
            value = reports[k, i]
            if math.isnan(value):
                continue
            if math.isinf(value):
                return INFINITE
            row = filled[ONLY]
            if row == steps.shape[0]:
                return FULL
            steps[row], buffered_codes[row], ids[row], values[row] = step, codes[k], unique_id[i], value
            reports[k, i], filled[ONLY] = math.nan, row + 1
    return 0
