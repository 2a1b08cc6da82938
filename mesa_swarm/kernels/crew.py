"""Several threads that do the rows of a kernel, in compiled code.

Threads that help wait in `serve`, as long as a model takes steps. `share_rows` publishes a job, a kernel for ranges of
rows; a thread that is free claims the next range, also the one that has published it: where the system lets one wait
for a processor, the others do its work. A kernel that is shared writes only what belongs to its rows, so the results
are the same bits for any number of ranges, and of threads.
"""

import ctypes
import os
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.cgutils import ir
from numba.extending import intrinsic

from mesa_swarm.kernels.block import FAILED, KernelCall, try_call_at, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import IntegerRows, Integers
from mesa_swarm.kernels.waiting import add_to_word, read_word, swap_word, wait_while, write_word

MOST_THREADS = 256
# Looks at a word before a thread lets others have its processor: a few microseconds.
LOOKS = np.int64(100)
# Places in the size of a crew: into how many ranges rows are cut, and how many threads help.
PARTS, HELPING = 0, 1
# Rows of a job: its words; which range is next; how many ranges are done.
WORDS_OF_JOB, CLAIM, DONE, ROWS_OF_JOB = 0, 1, 2, 3
# Its words: the call, its step, and how many rows there are.
CALL, STEP, ROWS = 0, 3, 4
# A claim is one word, so that it changes at once: the number of the job, how many ranges it has, and which is next.
BITS = 12
LAST = (1 << BITS) - 1
# Words of a row, which begins where a cache line does: two threads that write to one would wait for each other.
WORDS = 16


class CrewArrays(NamedTuple):
    """Who shares the rows of a model: see `PARTS`; the job, the code of each range, and what lets others work.

    `rest` is the address of a function of the system, 0 without one.
    """

    size: Integers
    job: IntegerRows
    codes: Integers
    rest: int


def rows_of_words(rows: int) -> np.ndarray:
    """Return zeros, `WORDS` in a row, each row in cache lines of its own."""
    numbers = np.zeros((rows + 1) * WORDS, np.int64)
    ahead = -numbers.ctypes.data // numbers.itemsize % WORDS
    return numbers[ahead : ahead + rows * WORDS].reshape(rows, WORDS)


# Of all models of this process, one of which has the threads at a time.
JOB, CODES = rows_of_words(ROWS_OF_JOB), np.zeros(MOST_THREADS, np.int64)


def address_of_rest() -> int:
    """Return the address of the system's function that lets other threads have the processor, 0 if there is none."""
    library: Any = ctypes.CDLL(None) if os.name == "posix" else getattr(ctypes, "windll").kernel32  # noqa: B009
    function = getattr(library, "sched_yield" if os.name == "posix" else "SwitchToThread", None)
    return 0 if function is None else int(ctypes.cast(function, ctypes.c_void_p).value or 0)


REST = address_of_rest()


@intrinsic
def call_function(typing_context: Any, address: Any) -> Any:
    """Call a function without arguments at an address; for compiled functions."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(ir.IntType(32), [])
        return builder.sext(builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), []), ir.IntType(64))

    return types.int64(types.int64), code


@intrinsic
def address_of(typing_context: Any, array: Any) -> Any:
    """Return where the numbers of an array are; for compiled functions."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ptrtoint(
            context.make_array(signature.args[0])(context, builder, arguments[0]).data, ir.IntType(64)
        )

    return types.int64(array), code


@compiled
def part_of_row(first, n, parts):
    """Return the place of the range of n rows that begins with row `first`, and is not empty."""
    return ((first + 1) * parts - 1) // n


@compiled(nogil=True, apart=True)
def share_rows(crew, address, block, step, n):
    """Call a kernel for the ranges of n rows, by all threads of a crew; return the largest code.

    What Python calls has to release the GIL until then: threads that help may wait for it.

    Raises
    ------
    RuntimeError
        If it has raised an error, when all have ended.
    """
    c = unpack(crew, CrewArrays)
    job, codes, parts = c.job, c.codes, c.size[PARTS]
    if c.size[HELPING] == 0:  # the job may be that of another model
        code = np.int64(0)
        for part in range(parts):
            code = max(code, do_part(address, block, step, n, parts, part))
    else:
        words, claim, done = job[WORDS_OF_JOB], job[CLAIM], job[DONE]
        words[CALL], words[CALL + 1], words[CALL + 2] = address, address_of(block), block.shape[0]
        words[STEP], words[ROWS] = step, n
        write_word(done, np.int64(0))
        write_word(claim, claim_of((read_word(claim) >> 2 * BITS) + 1, parts))
        while claim_part(job, codes):
            pass
        while read_word(done) != parts:
            wait_while(done, read_word(done), LOOKS)
            if read_word(done) != parts:
                let_others_work(c.rest)
        code = codes[:parts].max()
    if code == FAILED:
        raise RuntimeError("a kernel has failed in one of the threads that share a step")
    return code


@compiled
def claim_of(number, parts):
    """Return the claim of a job of which no range is claimed yet."""
    return (number << 2 * BITS) | (parts << BITS)


@compiled(nogil=True, apart=True)
def claim_part(job, codes):
    """Do the next range of the present job, and return whether there was one."""
    words, claim = job[WORDS_OF_JOB], job[CLAIM]
    before = read_word(claim)
    parts, part = (before >> BITS) & LAST, before & LAST
    if parts == LAST or part >= parts:
        return False
    # Words are written before the claim, and not again as long as a range is free: what is read is of this job if the
    # claim is still the same.
    call = unpack(words[CALL:], KernelCall)
    step, n = words[STEP], words[ROWS]
    if swap_word(claim, before, before + 1):
        codes[part] = do_part(call.address, call.block, step, n, parts, part)
        add_to_word(job[DONE], np.int64(1))
    return True


class SharedCall(NamedTuple):
    """What `share_kernel` takes: the numbers of `CrewArrays`, and the address and the block of a kernel."""

    crew: Integers
    address: int
    block: Integers


@compiled(nogil=True)
def share_kernel(block, step, first, last):
    """Call a kernel for the ranges of all rows, by all threads of a crew."""
    call = unpack(block, SharedCall)
    return share_rows(call.crew, call.address, call.block, step, last)


@compiled
def let_others_work(rest):
    """Let other threads have the processor."""
    if rest != 0:
        call_function(rest)


@compiled
def do_part(address, block, step, n, parts, part):
    """Call a kernel for one of the ranges of n rows, if it has rows; return the code."""
    first, last = n * part // parts, n * (part + 1) // parts
    return try_call_at(address, block, step, first, last) if first < last else np.int64(0)


@compiled(nogil=True)
def serve(job, codes, rest):
    """Do ranges of jobs as these come, until one has `LAST` as the number of its ranges."""
    claim = job[CLAIM]
    while True:
        while claim_part(job, codes):
            pass
        before = read_word(claim)
        if (before >> BITS) & LAST == LAST:
            break
        if before & LAST >= (before >> BITS) & LAST and wait_while(claim, before, LOOKS) == before:
            let_others_work(rest)


def begin_serving() -> None:
    """Let there be no job, before threads serve."""
    JOB[:], CODES[:] = 0, 0


def end_serving() -> None:
    """Let threads that serve end."""
    JOB[CLAIM, 0] |= LAST << BITS
