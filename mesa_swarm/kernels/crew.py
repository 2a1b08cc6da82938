"""Several threads that do the rows of one kernel at the same time, in compiled code.

Threads that help wait in `serve` for jobs, as long as a model takes steps: `share_rows` gives each some ranges of rows,
does its own, and waits for theirs. A kernel that is shared writes only what belongs to its rows, so the results are the
same bits for any number of ranges, and of threads.
"""

import ctypes
import os
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.cgutils import ir
from numba.extending import intrinsic

from mesa_swarm.kernels.block import SIGNATURE, KernelCall, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import IntegerRows, Integers
from mesa_swarm.kernels.waiting import read_word, wait_while, write_word

MOST_THREADS = 256
# Looks at a word before a thread lets others have its processor: about a tenth of a millisecond.
LOOKS = np.int64(4000)
# Places in the size of a crew: into how many ranges rows are cut, and how many threads help.
PARTS, HELPERS = 0, 1
# Places in a job: its number, the call, its step, how many rows there are in how many ranges, and which are meant.
NUMBER, CALL, STEP, ROWS, OF_PARTS, BEGIN, END = 0, 1, 4, 5, 6, 7, 8
# In what is done: the number of the last job, and its code.
CODE = 1
# A code larger than those of kernels, of one that has raised an error.
FAILED = np.int64(2**40)
# A row a helper, which begins where a cache line does: two threads that write to one would wait for each other.
WORDS = 16


class CrewArrays(NamedTuple):
    """Who shares the rows of a model: see `PARTS`; the jobs of helpers and what they have done; what lets others work.

    `rest` is the address of a function of the system, 0 without one.
    """

    size: Integers
    jobs: IntegerRows
    done: IntegerRows
    rest: int


def rows_of_words(rows: int) -> np.ndarray:
    """Return zeros, `WORDS` in a row, each row in cache lines of its own."""
    numbers = np.zeros((rows + 1) * WORDS, np.int64)
    ahead = -numbers.ctypes.data // numbers.itemsize % WORDS
    return numbers[ahead : ahead + rows * WORDS].reshape(rows, WORDS)


# Of all models of this process, one of which has the threads at a time.
JOBS, DONE = rows_of_words(MOST_THREADS), rows_of_words(MOST_THREADS)


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


@intrinsic
def try_call_at(typing_context: Any, address: Any, block: Any, step: Any, first: Any, last: Any) -> Any:
    """Call the function at an address and return its code, `FAILED` for an error; for compiled functions."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        address, *arguments = values
        kind = context.call_conv.get_function_type(types.int64, SIGNATURE)
        function = builder.inttoptr(address, kind.as_pointer())
        status, value = context.call_conv.call_function(builder, function, types.int64, SIGNATURE, arguments)
        return builder.select(status.is_error, context.get_constant(types.int64, int(FAILED)), value)

    return types.int64(types.int64, *SIGNATURE), code


@compiled
def parts_of(crew):
    """Return into how many ranges rows are cut."""
    return unpack(crew, CrewArrays).size[PARTS]


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
    jobs, done, parts, helpers = c.jobs, c.done, c.size[PARTS], c.size[HELPERS]
    for h in range(helpers):
        job = jobs[h]
        job[CALL], job[CALL + 1], job[CALL + 2] = address, address_of(block), block.shape[0]
        job[STEP], job[ROWS], job[OF_PARTS] = step, n, parts
        job[BEGIN], job[END] = parts * (h + 1) // (helpers + 1), parts * (h + 2) // (helpers + 1)
        write_word(job, job[NUMBER] + 1)
    code = do_parts(address, block, step, n, parts, 0, parts // (helpers + 1))
    for h in range(helpers):
        number = jobs[h, NUMBER]
        while read_word(done[h]) != number:
            wait_while(done[h], number - 1, LOOKS)
            _rest(c.rest, done[h], number - 1)
        code = max(code, done[h, CODE])
    if code == FAILED:
        raise RuntimeError("a kernel has failed in one of the threads that share a step")
    return code


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
def _rest(rest, word, value):
    """Let other threads have the processor if a word is still a value."""
    if rest != 0 and read_word(word) == value:
        call_function(rest)


@compiled
def do_parts(address, block, step, n, parts, begin, end):
    """Call a kernel for some of the ranges of n rows; return the largest code."""
    code = np.int64(0)
    for part in range(begin, end):
        first, last = n * part // parts, n * (part + 1) // parts
        if first < last:
            code = max(code, try_call_at(address, block, step, first, last))
    return code


@compiled(nogil=True)
def serve(job, done, rest):
    """Do jobs as they come, until one comes that has no ranges."""
    number = done[NUMBER]
    while True:
        while wait_while(job, number, LOOKS) == number:
            _rest(rest, job, number)
        number += 1
        if job[OF_PARTS] == 0:
            break
        call = unpack(job[CALL:], KernelCall)
        done[CODE] = do_parts(call.address, call.block, job[STEP], job[ROWS], job[OF_PARTS], job[BEGIN], job[END])
        write_word(done, number)
    write_word(done, number)


def end_serving(helpers: int) -> None:
    """Give the first helpers a job that has no ranges."""
    for job in JOBS[:helpers]:
        job[OF_PARTS] = 0
        job[NUMBER] += 1
