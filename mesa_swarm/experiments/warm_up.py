"""Compile once all that the models of the gallery need: for images of machines, and before a lesson."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from time import perf_counter, sleep
from typing import IO

from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.base.wording import quantity
from mesa_swarm.experiments.worker_pool import checked_jobs, ending_with_us
from mesa_swarm.experiments.worker_tasks import WorkerDiedError
from mesa_swarm.kernels.code_files import drop_damaged, is_stored, list_folders, problems, why_not_stored
from mesa_swarm.kernels.compiling import code_folders, compilation, needed_functions, stored_functions
from mesa_swarm.kernels.custom_code import FOLDER
from mesa_swarm.model.gallery import find_model

LAYOUT = "compiling, once per installation: {n_fmt} of {total_fmt} |{bar:30}|"
# Steps after which the models of the gallery have called all functions.
STEPS = 60
# Interval at which the folder is read, s.
SHOWN_EVERY = 0.2


@dataclass(frozen=True, kw_only=True, slots=True)
class WarmUp:
    """What `warm_up` did.

    Attributes
    ----------
    functions : int
        How many were compiled and stored, counted once for each set of types.
    seconds : float
    folder : Path
        Where they are stored: beside the installation, or in the user's cache if that cannot be written to.
    before : tuple of Path
        Where the code is stored that was compiled before.

    Examples
    --------
    >>> print(WarmUp(functions=176, seconds=58.3, folder=Path("cache")))
    compiled 176 functions in 58 s; stored in cache
    """

    functions: int
    seconds: float
    folder: Path
    before: tuple[Path, ...] = ()

    def __str__(self) -> str:
        """Return what was done, in one line."""
        if not self.functions:
            places = " and ".join(map(str, self.before))
            return f"everything is compiled already; the machine code is stored in {places}"
        line = f"compiled {quantity(self.functions, 'function')} in {self.seconds:.0f} s; stored in {self.folder}"
        others = " and ".join(str(place) for place in self.before if place != self.folder)
        return f"{line}, those of before in {others}" if others else line


def warm_up(*, jobs: int = -1, progress: bool = False) -> WarmUp:
    """Compile all that the models of the gallery need, so that no first step has to wait; what is there stays.

    Machine code is for this version of mesa_swarm, of Numba and of Python, and for this kind of processor. With the
    environment variable ``NUMBA_CPU_NAME=generic``, here and in what runs later, it is for all processors of a family.
    Rules, sensors and actuators of your own are compiled when a
    model that has them is run for the first time.

    Parameters
    ----------
    jobs : int
        Processes that work at the same time; -1 for one on each core.
    progress : bool
        Whether to show how many functions are compiled.

    Returns
    -------
    WarmUp

    Raises
    ------
    InvalidValueError
        If `jobs` is not a whole number of at least 1, or -1; or if something is to be compiled and can be stored
        nowhere.
    WorkerDiedError
        If a process fails, or cannot store what it has compiled; what others have compiled stays.

    Examples
    --------
    >>> warm_up(jobs=0)
    Traceback (most recent call last):
    ...
    mesa_swarm.base.errors.InvalidValueError: jobs is 0; expected a whole number at least 1 and at most 1024, or ...
    """
    workers, start = checked_jobs(jobs), perf_counter()
    missing, damaged = missing_functions(), drop_damaged(FOLDER)
    left, before = set().union(*missing.values()), code_folders(set().union(*needed_functions().values()))
    # Damaged code of rules and sensors may be that of any model.
    models = [*missing, *(model for model in needed_functions() if damaged and model not in missing)]
    if models:
        if reason := why_not_stored():
            raise InvalidValueError(reason)
        with progress_bar(len(left), "functions", progress, LAYOUT) as bar:
            _compile_all(models, workers, lambda: bar.update(len(stored_functions(left)) - bar.n))
    count = len(stored_functions(left)) + sum(map(is_stored, damaged))
    return WarmUp(functions=count, seconds=perf_counter() - start, folder=list_folders()[-1], before=before)


def missing_functions() -> dict[str, set[str]]:
    """Return what is not compiled yet, by the names of the models that need it, those that need most first."""
    needed = needed_functions()
    stored = stored_functions(set().union(*needed.values()))
    missing = {model: set(names) - stored for model, names in needed.items()}
    return {
        model: missing[model] for model in sorted(missing, key=lambda model: -len(missing[model])) if missing[model]
    }


def _compile_all(left: list[str], workers: int, show: Callable[[], object]) -> None:
    """Compile what these models need, each in a new process: in one that has run others, Numba would reuse their code.

    What it reuses is for more general types, and the process that later runs only this model would not find its own.
    Each is run, even if what is counted is there by then: its own rules and sensors are stored too.
    """
    running: dict[str, tuple[subprocess.Popen, IO[str]]] = {}
    try:
        while left or running:
            while left and len(running) < workers:
                model = left.pop(0)
                script = ending_with_us(f"from {__name__} import compile_for; compile_for({model!r})")
                errors = _text_file()
                running[model] = subprocess.Popen([sys.executable, "-c", script], stderr=errors), errors
            sleep(SHOWN_EVERY)
            show()
            for model in [model for model, (process, _) in running.items() if process.poll() is not None]:
                _check_ended(model, *running.pop(model))
    finally:
        for process, errors in running.values():
            process.kill()
            process.wait()
            errors.close()


def _text_file() -> IO[str]:
    """Return a file for what a process writes, which a pipe that is not read would block."""
    return TemporaryFile("w+", encoding="utf-8", errors="replace")


def _check_ended(model: str, process: subprocess.Popen, errors: IO[str]) -> None:
    with errors:
        errors.seek(0)
        written = errors.read()
    if process.returncode:
        last = (written.strip().splitlines() or [f"its process ended with status {process.returncode}"])[-1]
        raise WorkerDiedError(f"compiling for {model} failed: {last}")


def compile_for(model: str) -> None:
    """Compile what a model of the gallery needs, in this process alone.

    Raises
    ------
    SwarmError
        If some of it cannot be stored.
    """
    compilation.alone = True
    find_model(model)(rng=1).run(STEPS)
    for problem in problems:
        raise SwarmError(problem)
