"""Many models that take their steps side by side: one compiled call for all of them, shared by threads."""

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, shortened
from mesa_swarm.kernels.block import Block, code_address
from mesa_swarm.kernels.crew import share_rows
from mesa_swarm.kernels.plan import BEGINS, WorldsArrays, drive_worlds
from mesa_swarm.model.driving import Stretch
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.physics.threads import RowCrew, check_threads

AnyModel = TypeVar("AnyModel", bound=EngineModel)


def drive(models: Iterable[AnyModel], steps: int, threads: int | None = None) -> list[AnyModel]:
    """Let each of several models take this many steps, as ``model.run(steps)`` does, and return the models in a list.

    Their steps are those of single runs, to the last bit, in any number of threads; so are rows, conditions that end a
    run, and errors. What one compiled call can take, see ``print(model.plan)``, it takes of all models, and threads
    share these; a model of which Python is due in each step gains nothing.

    Parameters
    ----------
    models : iterable of models
        Each of them once.
    steps : int
        At least 0; a model that stops running takes fewer.
    threads : int, optional
        How many threads share the models, 1 to 256; by default the largest number of `threads` of a model, which is
        that in the environment variable MESA_SWARM_THREADS, or 1.

    Raises
    ------
    InvalidValueError
        If something is not a model, a model is there twice, or a number is wrong.
    Exception
        What a step of a model raises, of several that of the first model, when the others have taken their steps.

    Examples
    --------
    >>> from mesa_swarm import drive
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> models = drive([FireFighting(rng=seed) for seed in range(4)], 200, threads=2)
    >>> [model.steps for model in models]
    [200, 200, 200, 200]
    """
    worlds = check_models(models)
    check_count("steps", steps)
    crew = max((model.threads for model in worlds), default=1) if threads is None else check_threads(threads)
    runs = [ModelRun(model, steps) for model in worlds]
    try:
        while together := [run for run in runs if run.begin_stretch()]:
            take_together(together, crew)
    finally:
        for run in runs:
            run.close()
    for error in (run.error for run in runs if run.error is not None):
        raise error
    return worlds


class ModelRun:
    """The run of a model, a stretch of steps after the other.

    Attributes
    ----------
    stretch : Stretch or None
        Steps that are to be taken in a compiled call; None when the run is over.
    error : Exception or None
        What a step has raised, which ends the run.
    """

    def __init__(self, model: EngineModel, steps: int) -> None:
        has_own_run = type(model).run is not EngineModel.run
        self._stretches = run_itself(model, steps) if has_own_run else model._list_stretches(steps)
        self.stretch: Stretch | None = None
        self.error: Exception | None = None

    def begin_stretch(self) -> bool:
        """Take steps until a compiled call can take more; return whether it can."""
        if self.error is None:
            with self.ending():
                self.stretch = next(self._stretches, None)
        return self.error is None and self.stretch is not None

    def attend(self, code: int) -> bool:
        """Do in Python what the compiled call could not, and return whether it goes on."""
        stretch: Any = self.stretch
        stretch.note(stretch.taken, 1)
        with self.ending(stretch):
            stretch.driver.attend(code)
        return self.error is None

    def finish_step(self) -> None:
        """Take a step to its end that an interrupt has left within it."""
        stretch: Any = self.stretch
        if self.error is None:
            with self.ending(stretch):
                stretch.finish_step()

    def finish(self) -> None:
        """Count the steps that were taken, and take what was written into buffers."""
        stretch: Any = self.stretch
        if self.error is None:
            stretch.note(stretch.taken, 0)
        with self.ending():
            stretch.driver.finish()
        stretch.settle()
        if self.error is None:
            with self.ending():
                stretch.end()

    @contextmanager
    def ending(self, stretch: Stretch | None = None) -> Iterator[None]:
        """End the run if an error is raised, in a step of this stretch if there is one."""
        try:
            yield
        except Exception as error:
            self.error = error
            if stretch is not None:
                stretch.end_early()
            self.close()

    def close(self) -> None:
        """End the run, so that what observes it is closed."""
        self._stretches.close()


def run_itself(model: EngineModel, steps: int) -> Generator[Stretch, None, None]:
    """Run a model of which the class has a `run` of its own; no stretches are left."""
    model.run(steps)
    yield from ()


def take_together(runs: Sequence[ModelRun], threads: int) -> None:
    """Take the stretches that runs have begun, in compiled calls that threads share."""
    stretches: list[Any] = [run.stretch for run in runs]
    blocks = np.array([stretch.driver.numbers for stretch in stretches], np.int64)
    orders = np.array([(s.steps, s.completed, s.begun, s.rows, True) for s in stretches], np.int64)
    try:
        call_worlds(blocks, orders, threads, lambda row, code: runs[row].attend(code))
    except KeyboardInterrupt:
        for run in runs:
            run.finish_step()
        raise
    finally:
        for run in runs:
            run.finish()


def call_worlds(blocks: np.ndarray, orders: np.ndarray, threads: int, attend: Callable[[int, int], object]) -> None:
    """Take the steps of a world for each row in one compiled call, or one a thread.

    Parameters
    ----------
    blocks, orders : int64 ndarrays
        As `drive_worlds` takes them.
    threads : int
    attend : callable
        Is given a row and the code with which it has ended, if that is not 0, and returns whether it is to go on.
    """
    pending = np.arange(len(blocks))
    while len(pending):
        codes = np.zeros(len(pending), np.int64)
        share_worlds(blocks[pending], orders[pending], codes, threads)
        orders[pending, BEGINS] = False
        rows = pending[codes != 0].tolist()
        pending = np.array(
            [row for row, code in zip(rows, codes[codes != 0].tolist(), strict=True) if attend(row, code)], np.int64
        )


def share_worlds(blocks: np.ndarray, orders: np.ndarray, codes: np.ndarray, threads: int) -> None:
    """Let threads take rows of worlds."""
    n, block = len(blocks), Block(WorldsArrays(blocks, orders, codes))
    parts = min(threads, n)
    if parts < 2:
        drive_worlds(block.numbers, np.int64(0), np.int64(0), n)
        return
    crew = RowCrew()
    crew.parts = parts
    with crew:
        share_rows(crew.numbers, code_address(drive_worlds), block.numbers, np.int64(0), n)


def check_models(models: Iterable[AnyModel]) -> list[AnyModel]:
    """Return models in a list, each of which is there once."""
    if isinstance(models, EngineModel) or not isinstance(models, Iterable):
        raise InvalidValueError(f"models is {shortened(models)}; expected several models, such as [model, other]")
    worlds = list(models)
    places: dict[int, int] = {}
    for place, model in enumerate(worlds):
        if not isinstance(model, EngineModel):
            raise InvalidValueError(f"models has {shortened(model)} at place {place}; expected models only")
        first = places.setdefault(id(model), place)
        if first != place:
            raise InvalidValueError(f"models has the same model at places {first} and {place}; expected each once")
    return worlds
