"""Tables of runs as text: CSV, a row a run, and the table of NetLogo's BehaviorSpace, a row a step of series."""

import csv
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from pyarrow import parquet

from mesa_swarm.base.errors import InvalidValueError, check_choice, shortened
from mesa_swarm.base.files import check_writable, draft_of, show_path
from mesa_swarm.base.progress import notice
from mesa_swarm.experiments.experiment import Experiment, first_built
from mesa_swarm.experiments.fingerprints import shown_value
from mesa_swarm.experiments.ledger import ENDED_BY, RUNS, Ledger, Outcome
from mesa_swarm.experiments.runs import Run
from mesa_swarm.experiments.series import (
    CHOICES,
    FOLDER,
    OF_MODEL,
    RNG,
    RUN,
    STEP,
    RunSeries,
    check_reporters,
    checked_series,
    column_of,
)
from mesa_swarm.model.gallery import model_address

CSV, BEHAVIORSPACE = "csv", "behaviorspace"
# By form the file's name.
FILES = {CSV: "runs.csv", BEHAVIORSPACE: "behaviorspace.csv"}
# Columns after the results.
LAST = ("error", ENDED_BY, RUN)
# Whole numbers up to here are written without a point, as NetLogo does.
LARGEST_EXACT = 2**53
SomeExperiment = TypeVar("SomeExperiment", bound=Experiment)
# Called anew for each pass over the runs: they are not held in memory.
Pairs = Callable[[], Iterable[tuple[Run, Outcome]]]


def checked_forms(tables: object) -> tuple[str, ...]:
    """Return the forms of tables that are wanted, each once: "csv", "behaviorspace".

    Examples
    --------
    >>> checked_forms(["csv", "csv"]), checked_forms("behaviorspace")
    (('csv',), ('behaviorspace',))
    """
    listed = [tables] if isinstance(tables, str) else tables
    if not isinstance(listed, Iterable):
        raise InvalidValueError(f"tables is {shortened(tables)}; expected names, such as ['csv', 'behaviorspace']")
    return tuple(dict.fromkeys(check_choice("form of a table", form, FILES) for form in listed))


@dataclass(frozen=True, slots=True)
class TableHead:
    """What the first lines of a table of BehaviorSpace state: program, name of the experiment, bounds of the world."""

    program: str
    name: str
    bounds: tuple[float, float, float, float]

    @classmethod
    def of(cls, experiment: "Experiment | TableHead") -> "TableHead":
        """Return that of an experiment."""
        if isinstance(experiment, TableHead):
            return experiment
        return cls(model_address(experiment.model_class), experiment.name, first_built(experiment).map.bounds)


@dataclass(frozen=True, slots=True)
class RunFiles:
    """Where runs are stored as soon as they are done, and what is written of them: series and tables.

    Parameters
    ----------
    folder : Path or None
        Without one nothing is stored.
    parts : tuple of str
        Data sets of series, from `checked_series`.
    forms : tuple of str
        Forms of tables, from `checked_forms`.
    file : str
        The name of the ledger.
    names_old : bool
        Whether a line is printed about tables and series that earlier calls have left there.
    """

    folder: Path | None = None
    parts: tuple[str, ...] = ()
    forms: tuple[str, ...] = ()
    file: str = RUNS
    names_old: bool = True

    @classmethod
    def checked(
        cls, out: str | os.PathLike[str] | None, *, series: object = False, tables: object = (), option: str = "out"
    ) -> "RunFiles":
        """Return the files of a folder that can be written to, or of none; refuse series and tables without one.

        `option` is the argument that names the folder.
        """
        parts, forms = checked_series(series), checked_forms(tables)
        if out is None and (parts or forms):
            what = "series" if parts else "tables"
            raise InvalidValueError(f"{what} are wanted and no folder is named; add {option}=...")
        return cls(None if out is None else check_writable(out), parts, forms)

    @classmethod
    def at(cls, folder: "RunFiles | str | os.PathLike[str] | None") -> "RunFiles":
        """Return files as they are; of a path alone, a folder for runs without series and tables."""
        if isinstance(folder, RunFiles):
            return folder
        return cls(None if folder is None else Path(folder))

    def within(self, name: str) -> "RunFiles":
        """Return the same files in a folder of this name in the folder."""
        return self if self.folder is None else replace(self, folder=self.folder / name)

    def ledger(self, fits: Callable[[Outcome], bool] | None = None) -> AbstractContextManager[Ledger | None]:
        """Return the ledger of the runs as a context, None in it without a folder."""
        return nullcontext() if self.folder is None else Ledger(self.folder / self.file, fits=fits)

    @property
    def series(self) -> RunSeries | None:
        """Where series are stored, None if they are not."""
        return RunSeries(self.folder / FOLDER, self.parts) if self.folder is not None and self.parts else None

    @property
    def tables(self) -> list[Path]:
        """The tables that are written."""
        return [] if self.folder is None else [self.folder / FILES[form] for form in self.forms]

    @property
    def written(self) -> list[Path]:
        """The tables, and the folders of series."""
        return [*self.tables, *(() if self.series is None else self.series.folders)]

    @property
    def stored(self) -> list[Path]:
        """The ledger, and all that is written."""
        return [] if self.folder is None else [self.folder / self.file, *self.written]

    def of(self, experiment: SomeExperiment) -> SomeExperiment:
        """Return an experiment whose series are stored here; refuse a reporter named as a column of all series."""
        if self.series is None:
            return experiment
        check_reporters(first_built(experiment))
        return replace(experiment, series=self.series)

    def write(
        self,
        experiment: Experiment | TableHead,
        pairs: Pairs,
        write_rows: Callable[[Path], object] | None = None,
        *,
        keeps_csv: bool = False,
    ) -> None:
        """Let the series of runs that are all done agree, and write their tables.

        `write_rows` writes the CSV, by default a row a run with all that is known of it. A line is printed about what
        earlier calls have left: with `keeps_csv` the CSV is not that, as a comparison saves it in any case.
        """
        if self.folder is None:
            return
        if self.names_old:
            self._name_old(self.folder, (*self.forms, CSV) if keeps_csv else self.forms)
        if self.series is not None:
            self.series.agree({run.key for run, _ in pairs()})
        for form, path in zip(self.forms, self.tables, strict=True):
            if form == BEHAVIORSPACE:
                write_behaviorspace(path, experiment, pairs)
            else:
                (write_rows or partial(write_all_rows, pairs=pairs))(path)

    def _name_old(self, folder: Path, forms: Sequence[str]) -> None:
        """Print a line about tables and series of an earlier call that this one leaves as they are."""
        names = [name for form, name in FILES.items() if form not in forms]
        names += [f"{FOLDER}/{part}" for part in CHOICES["both"] if part not in self.parts]
        if old := [name for name in names if (folder / name).exists()]:
            notice(f"{', '.join(old)} in {show_path(folder)} are of an earlier call, and were not written anew")


NOTHING_STORED = RunFiles()


def row_of(run: Run, outcome: Outcome) -> dict[str, Any]:
    """Return the row of a run: its parameters, seed, steps and fingerprint, results, what ended it, its error."""
    settings = {name: shown_value(value) for name, value in run.settings.items()}
    steps = outcome.steps if outcome.error is None else None
    fixed = {RNG: run.rng, "steps": steps, "state_hash": outcome.state_hash, "error": outcome.error}
    ended = {} if run.until is None else {ENDED_BY: outcome.ended_by}
    series = {} if run.series is None or outcome.error is not None else {RUN: run.key}
    return {**settings, **fixed, **outcome.numbers, **ended, **series}


def write_all_rows(path: Path, pairs: Pairs) -> Path:
    """Write a row a run as CSV, with all that is known of any run."""
    names = dict.fromkeys(name for pair in pairs() for name in row_of(*pair))
    return write_csv(path, sorted(names, key=LAST.__contains__), (row_of(*pair) for pair in pairs()))


def write_csv(path: Path, names: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> Path:
    """Write rows as CSV under a line of names, whole or not at all; what is missing is an empty field."""
    lines = ([row.get(name) for name in names] for row in rows)
    return _write(path, [names], lines, quoting=csv.QUOTE_MINIMAL)


def write_behaviorspace(path: Path, experiment: Experiment | TableHead, pairs: Pairs) -> Path:
    """Write the table of NetLogo's BehaviorSpace, as NetLogo 6.4 does: six lines about the experiment, then the rows.

    Where series are stored there is a row for each row that was collected, with the reporters; else one for each run,
    with its results after the last step. Runs that ended in an error have none, but keep their numbers.

    Parameters
    ----------
    path : Path
    experiment : Experiment or TableHead
        A `TableHead` of runs that are not those of one model.
    pairs : callable
        Returns runs with their outcomes, in the order in which they are numbered, from 1.
    """
    head = TableHead.of(experiment)
    low_x, low_y, high_x, high_y = head.bounds
    about: list[list[Any]] = [
        [f"BehaviorSpace results (mesa-swarm {version('mesa-swarm')})", "Table version 2.0"],
        [head.program],
        [head.name],
        [datetime.now().astimezone().strftime("%m/%d/%Y %H:%M:%S:000 %z")],
        ["min-pxcor", "max-pxcor", "min-pycor", "max-pycor"],
        [low_x, high_x, low_y, high_y],
    ]
    settings = list(dict.fromkeys(name for run, _ in pairs() for name in run.settings))
    reporters = list(dict.fromkeys(name for pair in pairs() for name in _reporters(*pair)))
    columns = ["[run number]", *(column_of(name, reporters) for name in settings), RNG, "[step]", *reporters]
    rows = (
        [number, *(shown_value(run.settings.get(name)) for name in settings), run.rng, step, *map(row.get, reporters)]
        for number, (run, outcome) in enumerate(pairs(), start=1)
        for step, row in _steps(run, outcome)
    )
    return _write(path, [*about, columns], rows, quoting=csv.QUOTE_ALL, shown=in_netlogo)


def _file_of_steps(run: Run) -> Path | None:
    """Return the file of the rows of the model after each step, None if they are not stored."""
    if run.series is None or OF_MODEL not in run.series.parts:
        return None
    return run.series.file(OF_MODEL, run.key)


def _reporters(run: Run, outcome: Outcome) -> list[str]:
    """Return the names of what is known of a run."""
    file = _file_of_steps(run)
    if file is None or outcome.error is not None:
        return list(outcome.numbers)
    names = parquet.read_schema(file).names
    return names[names.index(STEP) + 1 :]


def _steps(run: Run, outcome: Outcome) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Yield the steps of a run that are known, with what was reported after each."""
    if outcome.error is not None:
        return
    file = _file_of_steps(run)
    if file is None:
        yield outcome.steps, outcome.numbers
    else:
        yield from ((row[STEP], row) for row in parquet.ParquetFile(file).read().to_pylist())


def in_netlogo(value: Any) -> str:
    """Return a value as NetLogo writes it; one that is missing, which NetLogo does not know, is empty.

    Examples
    --------
    >>> in_netlogo(5.0), in_netlogo(0.25), in_netlogo(True), in_netlogo([1, "A"]), in_netlogo(None)
    ('5', '0.25', 'true', '[1 A]', '')
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer() and abs(value) <= LARGEST_EXACT:
        return str(int(value))
    return f"[{' '.join(map(in_netlogo, value))}]" if isinstance(value, list) else str(value)


def _write(
    path: Path, above: Iterable[Sequence], rows: Iterable[Sequence], *, quoting: Any, shown: Any = lambda value: value
) -> Path:
    with draft_of(path) as draft, open(draft, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, quoting=quoting, lineterminator="\n")
        writer.writerows(map(shown, row) for rows_of in (above, rows) for row in rows_of)
    return path
