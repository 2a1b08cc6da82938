"""Many runs that a kill only interrupts, and their table as Parquet."""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, cast

import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from mesa_swarm.base.errors import InvalidValueError, check_count, shortened
from mesa_swarm.base.files import draft_of, show_path
from mesa_swarm.experiments.experiment import (
    POINT,
    Experiment,
    check_result_names,
    checked_experiment,
    first_built,
)
from mesa_swarm.experiments.ledger import ENDED_BY, Ledger, Outcome
from mesa_swarm.experiments.reports import LEFT_OUT, OF, counted, sum_of_left_out
from mesa_swarm.experiments.run_records import Archive, check_options, chosen_options
from mesa_swarm.experiments.run_tables import RunFiles, row_of, write_csv
from mesa_swarm.experiments.runs import Run, attempt, do_runs, error_in_words
from mesa_swarm.experiments.sampling import Sample
from mesa_swarm.experiments.series import RUN, RunSeries, check_reporters
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.model.parameters import parameters_of

LEDGER = "ledger.jsonl"
SHARD = re.compile(r"([0-9]{1,6})/([0-9]{1,6})")
MOST_SHARDS = 100_000
TABLE = "runs.parquet"
RECORDINGS = "recordings"
RECORDING = "recording"
ROWS_AT_ONCE = 10_000
TYPES = {bool: pa.bool_(), int: pa.int64(), float: pa.float64()}
# How often a run is tried whose worker dies.
TRIES = 3
# Different errors that are reported; the table has all.
MOST_ERRORS = 3


@dataclass(frozen=True, slots=True)
class Shard:
    """One of several parts of a sweep, which machines do without knowing of each other: `number` from 1 to `shards`.

    Examples
    --------
    >>> Shard.parsed("3/10")
    Shard(number=3, shards=10)
    """

    number: int = 1
    shards: int = 1

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_count("number of shards", self.shards, minimum=1, maximum=MOST_SHARDS)
        check_count("shard", self.number, minimum=1, maximum=self.shards)

    @classmethod
    def parsed(cls, text: str) -> "Shard":
        """Return the shard of a text such as "3/10"."""
        found = SHARD.fullmatch(text.strip())
        if found is None:
            raise InvalidValueError(
                f"shard is {shortened(text)}; expected NUMBER/SHARDS, such as 3/10 for the third of ten"
            )
        return cls(int(found[1]), int(found[2]))

    @property
    def ledger(self) -> str:
        """The name of its ledger's file."""
        return f"ledger-{self.number}-of-{self.shards}.jsonl"

    def count(self, experiment: Experiment) -> int:
        """Return how many runs of an experiment it has."""
        return len(range(self.number - 1, len(experiment), self.shards))


WHOLE = Shard()


@dataclass(frozen=True, slots=True)
class Sweep:
    """The outcome of a sweep.

    Parameters
    ----------
    path : Path
        The table, as Parquet, one row a run; the column `point` numbers the points of the design from 0. Of a shard
        its ledger.
    runs, failed, done_before : int
        All runs, or those of the shard; those that ended in an error; those that an earlier call had done.
    errors : tuple of str
        The first different errors, at most three.
    left_out : mapping of str to int
        By reporter, how many rows in all runs were missing (None, NaN or masked) and are left out of its reports; only
        where any were. The table then has the number of each run as "rows left out of NAME".
    tables : tuple of Path
        The tables as text that were written beside it.
    series : RunSeries, optional
        Where series are stored.
    """

    path: Path
    runs: int
    failed: int
    done_before: int
    errors: tuple[str, ...] = ()
    left_out: Mapping[str, int] = field(default_factory=dict, hash=False)
    tables: tuple[Path, ...] = ()
    series: RunSeries | None = None

    @property
    def written(self) -> list[Path]:
        """What was written besides the table: other tables, and folders of series."""
        return [*self.tables, *(() if self.series is None else self.series.folders)]

    def frame(self) -> pd.DataFrame:
        """Return the table."""
        if self.path.name != TABLE:
            raise InvalidValueError(
                f"{show_path(self.path)} is the ledger of a shard; the same sweep without shard makes the table of all"
            )
        return table_of_runs(self.path)


def table_of_runs(path: Path) -> pd.DataFrame:
    """Return the table that a sweep wrote, of as many columns as it has results."""
    # By one thread: Arrow's threads keep far more than the table, gigabytes on one processor for 30,000 columns.
    return pd.read_parquet(path, use_threads=False)


def sweep(
    model: type | str,
    varied: Mapping[str, Sequence] | Sample | Sequence[Mapping] = (),
    *,
    seeds: int | Sequence[int] = 30,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measure: Sequence[str] = (),
    out: str | os.PathLike[str] = "results",
    jobs: int = -1,
    record: bool | Mapping[str, Any] | None = None,
    progress: bool = False,
    retry_failed: bool = False,
    shard: tuple[int, int] | None = None,
    until: Callable[[Any], object] | str | None = None,
    series: bool | str = False,
    tables: Sequence[str] = (),
) -> Sweep:
    """Run a model at every point of a grid or sample with every seed, and write a table of the results.

    Each finished run is stored before the next is waited for. A sweep that was interrupted, or whose process
    or workers were killed, continues when it is called again with the same folder; runs that another
    sweep has done there are not done again. A run that ends in an error is recorded with it. A run whose worker
    dies is tried again, three times in all. Runs of code that was changed since are other runs (`source_hash`).

    Parameters
    ----------
    model : type or str
        A SwarmModel with a method ``results`` or with reports that `measure` names, or its name or address
        (`gallery.find_model`).
    varied : mapping, Sample or sequence of mappings
        A grid (values by parameter), a sample, or settings of your own, point by point.
    seeds : int or sequence, array or Series of int
        Seeds 1, 2, ... seeds, or these; the same at every point.
    steps : int, optional
        By default the model's attribute ``steps_to_compare``, else 3,000.
    settings : mapping, optional
        Other parameters, the same in all runs.
    measure : sequence of str
        The results that are wanted, all of them by default; reports too, as "final value of NAME", "mean of NAME",
        "minimum of NAME", "maximum of NAME", "sum of NAME" or "rows left out of NAME" of the model's `model_reporters`
        (`reports.reduced`): over the rows that were collected, without missing ones, which are counted.
    out : path
        Folder of the ledger and the table.
    jobs : int
        Processes on this machine; -1 for one on each core, 1 for this one. Inside
        `joblib.parallel_config(backend="dask")` the workers of the cluster do the work.
    record : bool or mapping, optional
        Whether every run is recorded, with these options of `mesa_swarm.recording.record` (True: its defaults), to
        ``recordings/KEY.arrow`` in that folder, which all workers must be able to reach. The table gets a column
        with the names. Runs that were done before but not recorded are done again.
    progress : bool
        Whether to show a bar with the time left, in a terminal or notebook.
    retry_failed : bool
        Whether to repeat runs that ended in an error before.
    shard : tuple of int, optional
        ``(3, 10)`` does the third of ten parts only, into a ledger of its own in the same folder; ten processes on
        machines that share that folder do all of them. The same call without it collects what all shards have
        done, does the runs that are missing, and writes the table.
    until : callable or str, optional
        Ends a run before its number of steps: a function of the model, called after each step, or an expression over
        its `model_reporters` such as ``"fires_burning == 0"`` (`until.checked_condition`). The column `ended_by` is
        then "condition", "steps", or "model" where the model stopped by itself.
    series : bool or str
        Whether the rows that models collect are stored, "model", "agents", or both: of each run in a Parquet file
        in ``series/model``, and in ``series/agents`` what `agent_reporters` report, of robots `x`, `y` and `heading` if
        there are none. Columns are `run`, the parameters (``parameter NAME`` where a reporter has that name), `rng`,
        `step` and, of agents, `unique_id`; ``pandas.read_parquet`` reads either folder as one table, and the table of
        runs gets the column `run`.
    tables : sequence of str
        "csv" for the table as ``runs.csv``, "behaviorspace" for ``behaviorspace.csv``, in the form of NetLogo's tables:
        a row a step with `series`, else a row a run.

    Raises
    ------
    SwarmError
        Before anything is run, if anything about it is wrong.
    SchedulerLostError
        If the scheduler of a cluster ends. Finished runs are stored: the same call does the rest.

    Notes
    -----
    On a cluster (``pip install 'mesa-swarm[cluster]'`` on all its machines, the same versions everywhere)::

        DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL=60s dask scheduler   # on one machine
        dask worker tcp://SCHEDULER:8786 --nthreads 1 --nworkers -1  # on every machine

        with Client("tcp://SCHEDULER:8786"), parallel_config(backend="dask"):
            sweep(FireFighting, {"strategy": ["A", "B"]}, seeds=1000)

    Only the process that calls `sweep` writes files, except for recordings. A worker process that dies is noticed
    at once, since its connection closes; one that falls silent, as on a machine that vanishes, after ``WORKER_TTL``. A
    shorter one than 30 s drops workers that are merely busy. While no worker is connected, a line on standard
    error reports it. See docs/clusters.md.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home:
    ...     made = sweep("fire_fighting", {"n_robots": [2, 3]}, seeds=2, steps=5, out=home, jobs=1)
    ...     made.runs, made.failed, made.frame()["n_robots"].tolist()
    (4, 0, [2, 2, 3, 3])
    """
    workers, options = checked_jobs(jobs), chosen_options(record)
    files = RunFiles.checked(out, series=series, tables=tables)
    experiment = checked_experiment(
        model, varied, seeds=seeds, steps=steps, settings=settings, measure=measure, until=until
    )
    if options is not None:
        check_options(options, experiment)
    check_columns_of(experiment, recorded=options is not None, series=files.parts)
    chosen = WHOLE if shard is None else checked_shard(shard)
    return run_experiment(experiment, files, workers, progress, options, retry_failed, shard=chosen)


def checked_shard(shard: object) -> Shard:
    """Return a shard of a pair such as (3, 10)."""
    if not isinstance(shard, Sequence) or isinstance(shard, str) or len(shard) != 2:
        raise InvalidValueError(f"shard is {shortened(shard)}; expected a pair, such as (3, 10) for the third of ten")
    return Shard(*shard)


def run_experiment(
    experiment: Experiment,
    folder: RunFiles | str | os.PathLike[str],
    workers: int = 1,
    progress: bool = False,
    record: Mapping[str, Any] | None = None,
    retry_failed: bool = False,
    heard: Callable[[Run, Outcome], object] = lambda run, outcome: None,
    shard: Shard = WHOLE,
    words: Callable[[BaseException], str] = error_in_words,
) -> Sweep:
    """Do the outstanding runs of an experiment, and write its table.

    Parameters
    ----------
    experiment : Experiment
    folder : RunFiles or path
        Where runs are stored, and what is written of them: of a path the table alone.
    workers : int
        Processes, from `checked_jobs`.
    progress, record, retry_failed
        See `sweep`; `record` are options, or None.
    heard : function
        Called with each new run and its outcome, after it was stored.
    shard : Shard
        The runs to do; there are tables only of all.
    words : function
        Returns one line about the error of a run; called in the process of the run.
    """
    files = RunFiles.at(folder)
    if files.forms and shard.shards > 1:
        raise InvalidValueError("tables are of all shards; leave them out here (--table), and collect all with them")
    home = cast(Path, files.folder)
    archive = None if record is None else Archive(home / RECORDINGS, record)
    experiment = files.of(experiment)
    taken = _taken(experiment, archive)
    runs = partial(experiment.part, shard.number, shard.shards)
    with Ledger(_ledger_of(shard, home), retry_failed=retry_failed, fits=_fitting(experiment, taken)) as ledger:
        _collect(ledger, home, runs if shard.shards > 1 else None)
        before = sum(_is_done(run, ledger, archive) for run in runs())
        for run, outcome in do_runs(
            (run for run in runs() if not _is_done(run, ledger, archive)),
            partial(_done, taken, archive, words),
            count=shard.count(experiment),
            done=before,
            ledger=ledger,
            workers=workers,
            tries=TRIES,
            progress=progress,
        ):
            if archive is not None and outcome.error is not None:
                archive.clear(run.key)
            heard(run, outcome)
        paths = [ledger.path]
        if shard.shards == 1:
            paths = write_tables(experiment, ledger, files, archive)
        failed, errors = _failures(runs(), ledger)
        left_out = _left_out(experiment, runs(), ledger)
    path, *others = paths
    return Sweep(path, shard.count(experiment), failed, before, errors, left_out, tuple(others), experiment.series)


def _ledger_of(shard: Shard, folder: Path) -> Path:
    return folder / (shard.ledger if shard.shards > 1 else LEDGER)


def _ledgers(folder: Path) -> list[Path]:
    """Return the ledgers in a folder: that of the whole sweep, then those of shards."""
    return [path for path in (folder / LEDGER, *sorted(folder.glob("ledger-*-of-*.jsonl"))) if path.exists()]


def _collect(ledger: Ledger, folder: Path, runs: Callable[[], Iterator[Run]] | None) -> None:
    """Copy what the other ledgers in the folder have of these runs, by default of all."""
    others = [path for path in _ledgers(folder) if path != ledger.path]
    keys = {run.key for run in runs()} if runs is not None and others else None
    for path in others:
        ledger.absorb(path, keys)


def _failures(runs: Iterable[Run], ledger: Ledger) -> tuple[int, tuple[str, ...]]:
    """Return how many runs ended in an error, and the first different errors; memory does not grow with the runs."""
    failed, errors = 0, dict[str, None]()
    for _, outcome in _stored(runs, ledger):
        if outcome.error is not None:
            failed += 1
            if len(errors) < MOST_ERRORS:
                errors[outcome.error] = None
    return failed, tuple(errors)


def _left_out(experiment: Experiment, runs: Iterable[Run], ledger: Ledger) -> dict[str, int]:
    """Return how many rows of each reporter the reports of all these runs leave out, where any do."""
    names = counted(experiment.reports)
    counts = ({name: outcome.numbers.get(name) for name in names} for _, outcome in _stored(runs, ledger))
    return sum_of_left_out(counts) if names else {}


def done_before(
    experiment: Experiment,
    folder: RunFiles | str | os.PathLike[str],
    record: Mapping[str, Any] | None = None,
    shard: Shard = WHOLE,
) -> int:
    """Return how many runs of an experiment, or a shard, are done in a folder, without changing anything there.

    If options of recordings are given, runs that were not recorded do not count, and where series are wanted those
    without.

    Examples
    --------
    >>> done_before(checked_experiment("fire_fighting", seeds=2, steps=5), "nowhere")
    0
    """
    files = RunFiles.at(folder)
    home = cast(Path, files.folder)
    archive = None if record is None else Archive(home / RECORDINGS, record)
    experiment = files.of(experiment)
    runs = partial(experiment.part, shard.number, shard.shards)
    done: set[str] = set()
    for path in _ledgers(home):
        with Ledger(path, read_only=True, fits=_fitting(experiment, _taken(experiment, archive))) as ledger:
            done.update(run.key for run in runs() if _is_done(run, ledger, archive))
    return sum(run.key in done for run in runs()) if done else 0


def stored_runs(experiment: Experiment, folder: Path) -> Iterator[tuple[Run, Outcome]]:
    """Yield the runs of an experiment that are done in a folder with their outcomes, without changing anything there.

    Examples
    --------
    >>> list(stored_runs(checked_experiment("fire_fighting", seeds=2, steps=5), Path("nowhere")))
    []
    """
    if (folder / LEDGER).exists():
        fits = _fitting(experiment, _taken(experiment, None))
        with Ledger(folder / LEDGER, read_only=True, fits=fits) as ledger:
            yield from _stored(experiment.runs(), ledger)


def check_columns_of(experiment: Experiment, *, recorded: bool, series: Sequence[str] = ()) -> None:
    """Refuse an experiment that is to be stored so, but has a result or a reporter named as a column that this adds."""
    if recorded or series:
        built = first_built(experiment)
        added = {*((RECORDING,) if recorded else ()), *((RUN,) if series else ())}
        check_result_names(built.results() if hasattr(built, "results") else {}, added)
        if series:
            check_reporters(built)


def _taken(experiment: Experiment, archive: Archive | None) -> set[str]:
    """Return the names of the columns that are not results; refuse a parameter that is named as another of them."""
    fixed = {*experiment.fixed, *(() if archive is None else (RECORDING,))}
    for name in experiment.columns:
        if name in fixed:
            raise InvalidValueError(f"parameter {name} is named as a column of the table; rename it in the model")
    return {*fixed, *experiment.columns}


def _fitting(experiment: Experiment, taken: set[str]) -> Callable[[Outcome], bool]:
    """Return whether an outcome can be a row of this experiment's table, as a function of outcomes."""
    return partial(_has_row, taken, set(counted(experiment.reports)))


def _has_row(taken: set[str], reports: set[str], outcome: Outcome) -> bool:
    """Return whether an outcome can be a row of the table: single numbers, named differently from other columns.

    An outcome that lacks a report, or how many rows it leaves out, is of an earlier sweep that did not need it.
    """
    results = outcome.numbers
    if outcome.error is None and not reports <= results.keys():
        return False
    return results.keys().isdisjoint(taken) and not any(isinstance(value, list) for value in results.values())


def _is_done(run: Run, ledger: Ledger, archive: Archive | None) -> bool:
    """Return whether a run need not be done; one that failed may have no recording and no series."""
    if run.is_kept and (archive is None or archive.file(run.key).exists()):
        return run.key in ledger
    outcome = ledger.outcome(run.key)
    return outcome is not None and outcome.error is not None


def _done(taken: set[str], archive: Archive | None, words: Callable[[BaseException], str], run: Run) -> Outcome:
    """Do a run, and record it if there is an archive; a result named as another column is an error."""
    outcome = attempt(run, words=words) if archive is None else archive.attempt(run)
    try:
        check_result_names(outcome.numbers, taken)
    except InvalidValueError as error:
        return Outcome(error=error_in_words(error))
    return outcome


def write_tables(experiment: Experiment, ledger: Ledger, files: RunFiles, archive: Archive | None) -> list[Path]:
    """Write one row a run, in the experiment's order, as Parquet and in other forms; return the paths.

    Each is written whole or not at all; never more than 10,000 rows are in memory.

    Parameters
    ----------
    experiment : Experiment
        All of whose runs are done.
    ledger : Ledger
    files : RunFiles
        The folder, and what is written to it.
    archive : Archive or None
        If there is one, `recording` names each run's file in it.

    Raises
    ------
    InvalidValueError
        If one cannot be written. The runs are in the ledger, and are not done again.
    """
    schema = _schema(experiment, ledger, archive)

    def pairs() -> Iterator[tuple[Run, Outcome]]:
        return _stored(experiment.runs(), ledger)

    def rows() -> Iterator[dict[str, Any]]:
        return (_row(run, outcome, archive) for run, outcome in pairs())

    path = cast(Path, files.folder) / TABLE
    with draft_of(path) as draft, parquet.ParquetWriter(draft, schema) as writer:
        for some in _batches(rows()):
            writer.write_table(pa.Table.from_pylist(some, schema=schema))
    files.write(experiment, pairs, lambda place: write_csv(place, schema.names, rows()))
    return [path, *files.tables]


def _schema(experiment: Experiment, ledger: Ledger, archive: Archive | None) -> pa.Schema:
    """Return the columns; a result that only some runs have is placed by the first run that has it."""
    known = parameters_of(experiment.model_class)
    fields = [(POINT, pa.int64())]
    fields += [(name, TYPES.get(known[name].kind, pa.string())) for name in experiment.columns]
    fields += [("rng", pa.int64()), ("steps", pa.int64()), ("state_hash", pa.string())]
    names: dict[str, None] = dict.fromkeys(experiment.measures)
    if not names:
        for _, outcome in _stored(experiment.runs(), ledger):
            names.update(dict.fromkeys(outcome.numbers))
    names.update(dict.fromkeys(f"{LEFT_OUT}{OF}{name}" for name in _left_out(experiment, experiment.runs(), ledger)))
    texts = ["error", *(name for name in experiment.fixed if name in (ENDED_BY, RUN))]
    texts += [] if archive is None else [RECORDING]
    return pa.schema([*fields, *((name, pa.float64()) for name in names), *((name, pa.string()) for name in texts)])


def _stored(runs: Iterable[Run], ledger: Ledger) -> Iterator[tuple[Run, Outcome]]:
    for run in runs:
        outcome = ledger.outcome(run.key)
        if outcome is not None:
            yield run, outcome


def _row(run: Run, outcome: Outcome, archive: Archive | None) -> dict[str, Any]:
    file = None if archive is None else archive.file(run.key)
    recording = {RECORDING: file.name} if file is not None and file.exists() else {}
    return {POINT: run.point, **row_of(run, outcome), **recording}


def _batches(rows: Iterable[dict]) -> Iterator[list[dict]]:
    rows = iter(rows)
    while batch := list(islice(rows, ROWS_AT_ONCE)):
        yield batch
