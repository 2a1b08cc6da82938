"""The laboratory: runs on many processes, each stored, so that an interrupted reproduction continues."""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments import Ledger, Outcome, Run, completed, engine_hash, fingerprint

Numbers = dict[str, Any]
Function = Callable[..., Numbers]
Choice = TypeVar("Choice")
RUNS = "runs.jsonl"
FEW = 3
# What runs of several modules are made of, beside the engine.
SHARED = str(Path(__file__).parent / "theory" / "courses.py")
# Seeds from 1 on were looked at while criteria were chosen, those of 10,000 and more while settings were.
FRESH = 1_001


class Laboratory:
    """Does runs on several processes and stores the results of each in a folder.

    A run is a function of a module, called with ``rng`` and settings, that returns numbers and lists of them.
    They are stored under a key of its code, its settings and its seed: the next time they are looked up.
    """

    def __init__(self, folder: Path, *, quick: bool = False, jobs: int = 1, progress: bool = False) -> None:
        self.quick, self.jobs, self.progress = quick, jobs, progress
        self._ledger = Ledger(folder / RUNS)
        self._made: set[str] = set()
        self._found: set[str] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @property
    def made(self) -> int:
        """How many runs were made by this laboratory."""
        return len(self._made)

    @property
    def found(self) -> int:
        """How many of the requested runs had been made before this laboratory was opened."""
        return len(self._found)

    @property
    def path(self) -> Path:
        """The file in which runs are stored."""
        return self._ledger.path

    def close(self) -> None:
        """Close the file in which runs are stored."""
        self._ledger.close()

    def pick(self, full: Choice, quick: Choice) -> Choice:
        """Return the first, or the second where quick is enough."""
        return quick if self.quick else full

    def seeds(self, count: int, quick: int = FEW) -> range:
        """Return seeds 1, 2, ... count, or a few where quick is enough."""
        return range(1, 1 + self.pick(count, quick))

    def fresh_seeds(self, count: int, quick: int = FEW) -> range:
        """Return as many seeds with which nothing was run before settings and criteria were fixed.

        Where quick is enough they are 1, 2, and so on: trials do not touch seeds that will be judged.
        """
        first = self.pick(FRESH, 1)
        return range(first, first + self.pick(count, quick))

    def runs(self, run: Function, seeds: Iterable[int], *, alone: bool = False, **settings: Any) -> list[Numbers]:
        """Return the numbers of a run for every seed, in the order of the seeds."""
        return self.grid(run, [settings], seeds, alone=alone)[0]

    def grid(
        self, run: Function, points: Sequence[Mapping[str, Any]], seeds: Iterable[int], *, alone: bool = False
    ) -> list[list[Numbers]]:
        """Return the numbers of a run at every point, for every seed.

        Runs whose time is measured are done alone: one after the other.
        """
        listed = list(seeds)
        rows = [[Run(run, dict(point), rng, key=key_of(run, point, rng)) for rng in listed] for point in points]
        distinct = list({run.key: run for row in rows for run in row}.values())
        known = {run.key for run in distinct if run.key in self._ledger}
        self._found |= known - self._made
        self._made |= {run.key for run in distinct} - known
        found = completed(
            distinct,
            ledger=self._ledger,
            workers=1 if alone else self.jobs,
            progress=self.progress and len(known) < len(distinct),
        )
        return [[self._numbers(found[run.key]) for run in row] for row in rows]

    def _numbers(self, outcome: Outcome) -> Numbers:
        if outcome.results is None:
            raise InvalidValueError(f"{self.path} has an error instead of the numbers of a run; remove the file")
        return outcome.results


def key_of(run: Function, settings: Mapping[str, Any], rng: int) -> str:
    """Return the fingerprint of all that decides a run: its code, the engine's, the models', its settings and seed."""
    code = engine_hash(inspect.getfile(run), SHARED, models=True)
    return fingerprint(run.__module__, run.__qualname__, code, dict(settings), rng)
