"""Where runs are made: many at a time, each kept, so that an interrupted reproduction goes on where it stopped."""

import inspect
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.experiment import Outcome
from mesa_swarm.experiments.ledger import Ledger
from mesa_swarm.experiments.pool import results_of
from mesa_swarm.gallery import PACKAGE as MODELS
from mesa_swarm.progress import progress_bar

Numbers = dict[str, Any]
Run = Callable[..., Numbers]
Choice = TypeVar("Choice")
DATA = "runs.jsonl"
# What decides what comes of a run; pictures and verdicts may change without runs being done again.
ENGINE = ("geometry", "world", "robots", "physics", "control", "fire", "learning", "analysis")
FEW = 3


class Laboratory:
    """Makes runs on several processes and keeps what came of each in a folder.

    A run is a function of a module, called with ``rng`` and settings, that returns numbers and lists of them.
    What came of it is kept under a key of its code, its settings and its seed: the next time it is looked up.

    Parameters
    ----------
    folder : Path
        Where runs are kept.
    quick : bool
        Whether few seeds and short runs are enough.
    jobs : int
        Processes at a time, at least 1.
    progress : bool
        Whether to show bars.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.reproduction.swarms import chain_run
    >>> with tempfile.TemporaryDirectory() as home, Laboratory(Path(home), quick=True) as laboratory:
    ...     rows = laboratory.runs(chain_run, laboratory.seeds(40), n_robots=3)
    ...     len(rows), laboratory.made
    (3, 3)
    """

    def __init__(self, folder: Path, *, quick: bool = False, jobs: int = 1, progress: bool = False) -> None:
        self.quick, self.jobs, self.progress = quick, jobs, progress
        self.made = self.found = 0
        self._ledger = Ledger(folder / DATA)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @property
    def path(self) -> Path:
        """The file in which runs are stored."""
        return self._ledger.path

    def close(self) -> None:
        """Close the file in which runs are kept."""
        self._ledger.close()

    def pick(self, full: Choice, quick: Choice) -> Choice:
        """Return the first, or the second where quick is enough."""
        return quick if self.quick else full

    def seeds(self, count: int, quick: int = FEW) -> range:
        """Return seeds 1, 2, ...: so many, or a few."""
        return range(1, 1 + self.pick(count, quick))

    def runs(self, run: Run, seeds: Iterable[int], *, alone: bool = False, **settings: Any) -> list[Numbers]:
        """Return what a run gives for every seed, in the order of the seeds."""
        return self.grid(run, [settings], seeds, alone=alone)[0]

    def grid(
        self, run: Run, points: Sequence[Mapping[str, Any]], seeds: Iterable[int], *, alone: bool = False
    ) -> list[list[Numbers]]:
        """Return what a run gives at every point, for every seed.

        Parameters
        ----------
        run : callable
        points : sequence of mappings
            Settings of the run, plain values.
        seeds : iterable of int
        alone : bool
            Whether runs are made one after the other, because their time is measured.
        """
        listed = list(seeds)
        tasks = {key_of(run, point, rng): (dict(point), rng) for point in points for rng in listed}
        missing = {key: task for key, task in tasks.items() if key not in self._ledger}
        self.found += len(tasks) - len(missing)
        self._make(run, missing, 1 if alone else min(self.jobs, max(len(missing), 1)))
        return [[self._kept(run, point, rng) for rng in listed] for point in points]

    def _make(self, run: Run, tasks: dict[str, tuple[dict, int]], workers: int) -> None:
        calls = ((key, run, settings, rng) for key, (settings, rng) in tasks.items())
        with progress_bar(len(tasks), "runs", self.progress and bool(tasks)) as bar:
            for key, numbers in results_of(workers, made, calls):
                self._ledger.append(key, Outcome(results=numbers))
                self.made += 1
                bar.update()

    def _kept(self, run: Run, point: Mapping[str, Any], rng: int) -> Numbers:
        outcome = self._ledger.outcome(key_of(run, point, rng))
        if outcome is None or outcome.results is None:
            raise InvalidValueError(f"{self.path} has an error in place of a run's numbers; remove the file")
        return outcome.results


def made(key: str, run: Run, settings: dict, rng: int) -> tuple[str, Numbers]:
    """Do a run, and return its key and what came of it.

    Examples
    --------
    >>> made("0", lambda rng, times: {"number": rng * times}, {"times": 2}, 3)
    ('0', {'number': 6})
    """
    return key, run(rng, **settings)


def key_of(run: Run, settings: Mapping[str, Any], rng: int) -> str:
    """Return the fingerprint of all that decides a run: its code, the engine's, its settings and its seed.

    Examples
    --------
    >>> key_of(made, {"a": 1}, 1) == key_of(made, {"a": 1.5}, 1)
    False
    """
    said = [run.__module__, run.__qualname__, _file(inspect.getfile(run)), engine_hash(), dict(settings), rng]
    return blake2b(json.dumps(said, sort_keys=True).encode(), digest_size=16).hexdigest()


@cache
def engine_hash() -> str:
    """Return a fingerprint of the files of the engine, its rules, measures and models.

    Examples
    --------
    >>> len(engine_hash())
    32
    """
    package = Path(__file__).parent.parent
    models = Path(next(iter(import_module(MODELS).__path__)))
    folders = [package / name for name in ENGINE] + [models]
    files = [path for folder in folders for path in sorted(folder.glob("*.py"))]
    files += [*sorted(package.glob("*model*.py")), package / "streams.py"]
    return blake2b("".join(_file(path) for path in files).encode(), digest_size=16).hexdigest()


@cache
def _file(path: str | os.PathLike[str]) -> str:
    return blake2b(Path(path).read_bytes(), digest_size=16).hexdigest()
