"""The plan of a step: all stages in their order; and the driver, one compiled call that takes many steps."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.kernels.block import Block, KernelCall, call_at, code_address, stack_blocks, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel, Part, Phase, Stage
from mesa_swarm.kernels.type_names import Flags, IntegerRows, Integers

# Places in the progress of a driver: steps taken, the kernel that is next, the code that it has returned; of a flag.
TAKEN, NEXT, CODE, ONLY = 0, 1, 2, 0
# Columns of a row of orders: how many steps, the other arguments of `drive_steps`, and whether a world begins.
STEPS, COMPLETED, BEGUN, ROWS, BEGINS = 0, 1, 2, 3, 4
# The column of a row of calls with every how many steps it is due, after the numbers of a `KernelCall`.
EVERY = 3


class Plan(NamedTuple):
    """The stages of a step, in the order of phases, and within a phase of parts.

    Parameters
    ----------
    stages : tuple of (str, Stage)
        Each with the name of its part.
    version : tuple
        Of the robots' columns, and the scene of bodies, for which it was made.
    calls, collecting : tuples of callables
        What a step calls before it is counted as completed, and afterwards.
    besides : tuple of str
        What in Python each step calls besides its stages, such as the `step` of a class, observers or reporters.
    driven : str
        How many steps one compiled call takes.

    Examples
    --------
    >>> from mesa_swarm.model.engine_model import EngineModel
    >>> print(EngineModel(rng=1).plan)
    phase    part    what                                    how
    sense    robots  robots read their sensors               compiled: sense_robots
    move     robots  robots move, and contacts are resolved  compiled: move_robots
    collect  robots  collisions are counted                  compiled: count_collided
    driven: up to 1000 steps in one compiled call
    """

    stages: tuple[tuple[str, Stage], ...]
    version: Any
    calls: tuple[Callable[[], None], ...]
    collecting: tuple[Callable[[], None], ...]
    besides: tuple[str, ...] = ()
    driven: str = ""

    @classmethod
    def of(cls, parts: Iterable[Part], version: Any, completed: Callable[[], int]) -> "Plan":
        """Return the plan of these parts; `completed` returns how many steps were completed."""
        stages = [(part.name, stage) for part in parts for stage in part.stages()]
        stages.sort(key=lambda pair: pair[1].phase)  # stable: in the order of parts
        calls = [(stage.phase is Phase.COLLECT, call_when_due(stage, completed)) for _, stage in stages]
        advancing = tuple(call for collects, call in calls if not collects)
        return cls(tuple(stages), version, advancing, tuple(call for collects, call in calls if collects))

    def __str__(self) -> str:
        """Return a table of the stages, what is compiled, and what makes Python due."""
        rows = [("phase", "part", "what", "how"), *(_row(part, stage) for part, stage in self.stages)]
        widths = [max(len(row[column]) for row in rows) for column in range(3)]
        lines = ["  ".join((*map(str.ljust, row, widths), row[3])) for row in rows]
        lines += [f"besides: {reason}" for reason in self.besides]
        return "\n".join(line.rstrip() for line in (*lines, self.driven)).rstrip()


def _row(part: str, stage: Stage) -> tuple[str, str, str, str]:
    every = "" if stage.every == 1 else f" every {stage.every} steps"
    function: Any = stage.kernel and stage.kernel.function
    names = function.__name__ if function else stage.compiled
    compiled = f"compiled: {names}" if names else ""
    python = f"Python: {stage.python}" if stage.python else "" if compiled else "Python"
    return stage.phase.name.lower(), part, f"{stage.name}{every}", "; ".join(way for way in (compiled, python) if way)


def call_when_due(stage: Stage, completed: Callable[[], int]) -> Callable[[], None]:
    """Return what calls a stage in the steps that its interval divides; `completed` steps were taken before."""
    if stage.every == 1:
        return stage.call
    ahead = 0 if stage.phase is Phase.COLLECT else 1  # steps are counted before what is collected

    def call() -> None:
        if (completed() + ahead) % stage.every == 0:
            stage.call()

    return call


# ---- the driver


class DriveArrays(NamedTuple):
    """What `drive_steps` takes: a row a kernel, its progress, and a flag that a kernel sets to end after this step."""

    calls: IntegerRows
    progress: Integers
    stop: Flags


class Driver:
    """Kernels that one compiled call takes through many steps.

    Parameters
    ----------
    kernels : sequence of (Kernel, int)
        In the order of a step, each with every how many steps it is due.
    stop : bool ndarray, shape (1,)
        A kernel sets it where the steps are to end.

    Attributes
    ----------
    progress : int64 ndarray, shape (3,)
        How many steps of this call are taken, which kernel is next in the step that is not, and its code, 0 if it waits
        for nothing.
    numbers : int64 ndarray
        The numbers of its block, for `drive_worlds`.
    """

    def __init__(self, kernels: Sequence[tuple[Kernel, int]], stop: np.ndarray) -> None:
        self._kernels, self._every = [kernel for kernel, _ in kernels], [every for _, every in kernels]
        self._stop, self.progress = stop, np.zeros(3, np.int64)
        blocks = [Block(KernelCall(code_address(kernel.function), kernel.block)) for kernel, _ in kernels]
        calls = stack_blocks(blocks, EVERY + 1, [(every,) for _, every in kernels])
        self._block = Block(DriveArrays(calls, self.progress, stop))
        self.numbers = self._block.numbers

    def is_of(self, kernels: Sequence[tuple[Kernel, int]]) -> bool:
        """Return whether it has these kernels, due in the same steps."""
        return self._every == [every for _, every in kernels] and all(
            kernel is mine for (kernel, _), mine in zip(kernels, self._kernels, strict=True)
        )

    def begin(self) -> None:
        """Forget what was taken before."""
        self.progress[:], self._stop[ONLY] = 0, False

    def attend(self, code: int) -> None:
        """Do in Python what the kernel that is next could not."""
        self._kernels[self.progress[NEXT]].attend(code)  # type: ignore[misc]

    def finish(self) -> None:
        """Take what kernels have written into buffers: of all kernels, also where one raises an error."""
        with ExitStack() as stack:
            for kernel in reversed(self._kernels):
                if kernel.finish is not None:
                    stack.callback(kernel.finish)

    def take(self, steps: int, completed: int, begun: int, rows: int, note: Callable[[int, int], None]) -> None:
        """Take at most this many steps of this many robots after `completed` ones; `begun` were counted.

        ``note(taken, more)`` is called with how many steps are taken, and 1 in a step that has begun besides, before
        Python is needed, and at the end. An error is raised in the step in which it occurs.
        """
        self.begin()
        try:
            self._go_on(steps, completed, begun, rows, note)
        except KeyboardInterrupt:  # raised when the compiled call is over
            self.finish_step(completed, begun, rows, note)
            raise
        finally:
            note(int(self.progress[TAKEN]), int(self.progress[CODE] != 0))
            self.finish()

    def _go_on(self, steps: int, completed: int, begun: int, rows: int, note: Callable[[int, int], None]) -> None:
        while drive_steps(self.numbers, steps, completed, begun, rows):
            self._attend(note)

    def finish_step(self, completed: int, begun: int, rows: int, note: Callable[[int, int], None]) -> None:
        """Take the step to its end in which a kernel waits for Python, if there is one."""
        if self.progress[CODE]:
            steps = int(self.progress[TAKEN]) + 1
            self._attend(note)
            self._go_on(steps, completed, begun, rows, note)

    def _attend(self, note: Callable[[int, int], None]) -> None:
        note(int(self.progress[TAKEN]), 1)
        self.attend(int(self.progress[CODE]))


@compiled(nogil=True)
def drive_steps(block, steps, completed, begun, rows):
    """Take steps from where the progress is, until they are done, the flag is set, or a kernel returns a code."""
    d = unpack(block, DriveArrays)
    calls, progress, stop = d.calls, d.progress, d.stop
    place = progress[NEXT]
    for taken in range(progress[TAKEN], steps):
        if stop[ONLY] and place == 0:  # where Python has set it within a step, that one is taken to its end
            break
        while place < calls.shape[0]:
            row = calls[place]
            if row[EVERY] == 1 or (completed + taken + 1) % row[EVERY] == 0:
                call = unpack(row, KernelCall)
                code = call_at(call.address, call.block, begun + taken + 1, 0, rows)
                if code != 0:
                    progress[TAKEN], progress[NEXT], progress[CODE] = taken, place, code
                    return code
            place += 1
        place = 0
        progress[TAKEN], progress[NEXT] = taken + 1, 0
    progress[CODE] = 0
    return 0


class WorldsArrays(NamedTuple):
    """What `drive_worlds` takes, a row a world: see there."""

    blocks: IntegerRows
    orders: IntegerRows
    codes: Integers


@compiled(nogil=True)
def drive_worlds(block, step, first, last):
    """Take steps of worlds, of each as `drive_steps` does, and write the code with which each has ended.

    For rows `first` to `last`: of `blocks` the numbers of its driver, of `orders` the other arguments, and whether it
    begins and forgets what was taken before.
    """
    a = unpack(block, WorldsArrays)
    blocks, orders, codes = a.blocks, a.orders, a.codes
    for w in range(first, last):
        order = orders[w]
        if order[BEGINS]:
            d = unpack(blocks[w], DriveArrays)
            d.progress[TAKEN], d.progress[NEXT], d.stop[ONLY] = 0, 0, False
        codes[w] = drive_steps(blocks[w], order[STEPS], order[COMPLETED], order[BEGUN], order[ROWS])
    return 0
