"""Several kernels in turn as one."""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from mesa_swarm.kernels.block import CALL_NUMBERS, Block, KernelCall, call_at, code_address, stack_blocks, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import IntegerRows, Integers

NEXT = 0


class SequenceArrays(NamedTuple):
    """What `run_in_turn` takes: rows of numbers of `KernelCall`, and the place of the next call."""

    calls: IntegerRows
    place: Integers


def sequence_of(kernels: Sequence[Kernel]) -> Kernel:
    """Return what runs these kernels one after the other, and does nothing if there are none.

    Examples
    --------
    >>> sequence_of([]).run(1, 10)
    """
    if len(kernels) == 1:
        return kernels[0]
    calls = [Block(KernelCall(code_address(kernel.function), kernel.block)) for kernel in kernels]
    place = np.zeros(1, np.int64)
    block = Block(SequenceArrays(stack_blocks(calls, CALL_NUMBERS), place))
    return Kernel(run_in_turn, block.numbers, (block, kernels, calls), partial(_attend, kernels, place))


def _attend(kernels: Sequence[Kernel], place: np.ndarray, code: int) -> None:
    """Do in Python what the kernel at a place could not; after an error all begin anew."""
    try:
        kernels[place[NEXT]].attend(code)  # type: ignore[misc]
    except BaseException:
        place[NEXT] = 0
        raise


@compiled(nogil=True)
def run_in_turn(block, step, first, last):
    """Run the kernels of a sequence from the next one on; return the code of one that is not done."""
    s = unpack(block, SequenceArrays)
    calls, place = s.calls, s.place
    for k in range(place[NEXT], calls.shape[0]):
        call = unpack(calls[k], KernelCall)
        code = call_at(call.address, call.block, step, first, last)
        if code != 0:
            place[NEXT] = k
            return code
    place[NEXT] = 0
    return 0
