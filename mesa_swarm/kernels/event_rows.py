"""Events that compiled functions report: numbers written into a row a robot, and a buffer that collects them."""

import math
from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import mix_bits, mix_number
from mesa_swarm.kernels.measuring import FULL, ONLY
from mesa_swarm.kernels.type_names import Flags, Integers, RealRows, Reals, Unsigned

# What a kernel returns where a number that was reported is infinite; `FULL` where the buffer is full.
INFINITE = 2
MOST_EVENTS = 4096
# Places in a digest of events: how many there are, and what they were.
COUNT, MIX = 0, 1


class EventBuffer(NamedTuple):
    """Events in the order in which they happened: rows of four columns, and how many are filled, in an array of one.

    One that `wraps` begins anew when it is full, for those who need the last events only; also in an array of one.
    """

    step: Integers
    code: Integers
    unique_id: Integers
    value: Reals
    filled: Integers
    wraps: Flags

    @classmethod
    def empty(cls) -> "EventBuffer":
        """Return a buffer with room for `MOST_EVENTS`."""
        step, code, unique_id = (np.zeros(MOST_EVENTS, np.int64) for _ in range(3))
        return cls(step, code, unique_id, np.zeros(MOST_EVENTS), np.zeros(1, np.int64), np.zeros(1, np.bool_))


class ReportArrays(NamedTuple):
    """What `collect_events` takes.

    Parameters
    ----------
    reports : float64 ndarray, shape (k, n)
        Of k names a number a robot, NaN where nothing happened; NaN again when it is collected.
    codes : int64 ndarray, shape (k,)
    keys : uint64 ndarray, shape (k,)
        Of the names, see `key_of_name`.
    unique_id : int64 ndarray, shape (n,)
    buffer : EventBuffer
    digest : uint64 ndarray, shape (2,)
        Of all events, see `mix_event`.
    """

    reports: RealRows
    codes: Integers
    keys: Unsigned
    unique_id: Integers
    buffer: EventBuffer
    digest: Unsigned


def key_of_name(name: str) -> np.uint64:
    """Return 64 bits that stand for the name of events.

    Examples
    --------
    >>> int(key_of_name("lost")) == int(key_of_name("lost")), int(key_of_name("lost")) == int(key_of_name("found"))
    (True, False)
    """
    return np.uint64(int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), "little"))


@compiled
def mix_event(digest, step, key, unique_id, value):
    """Count an event in a digest, and mix it into what the digest is of those before; a value of -0 counts as 0."""
    bits = mix_number(mix_number(mix_bits(digest[MIX] ^ key), step), unique_id)
    digest[MIX] = mix_bits(bits ^ np.float64(value + 0.0).view(np.uint64))
    digest[COUNT] += np.uint64(1)


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
            if row >= steps.shape[0]:
                if not buffer.wraps[ONLY]:
                    return FULL
                row %= steps.shape[0]
            steps[row], buffered_codes[row], ids[row], values[row] = step, codes[k], unique_id[i], value
            mix_event(r.digest, step, r.keys[k], unique_id[i], value)
            reports[k, i] = math.nan
            filled[ONLY] += 1
    return 0
