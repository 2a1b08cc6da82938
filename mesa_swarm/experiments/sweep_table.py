"""The table of a sweep, as Parquet: always the same bytes for the same outcomes, whatever the order they came in."""

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from mesa_swarm.experiments.experiment import Experiment, Outcome, Task, shown_value
from mesa_swarm.experiments.ledger import Ledger
from mesa_swarm.experiments.run_records import Archive
from mesa_swarm.files import draft_of
from mesa_swarm.parameters import parameters_of

ROWS_AT_ONCE = 10_000
RECORDING = "recording"
TYPES = {bool: pa.bool_(), int: pa.int64(), float: pa.float64()}


def write_table(experiment: Experiment, ledger: Ledger, path: Path, archive: Archive | None = None) -> Path:
    """Write one row a run, in the experiment's order, whole or not at all; never more than 10,000 are in memory.

    Parameters
    ----------
    experiment : Experiment
        All of whose runs are done.
    ledger : Ledger
    path : Path
        Of the Parquet file. Columns: the parameters that are set, `rng`, `steps`, `state_hash`, the results, `error`.
    archive : Archive, optional
        If there is one, `recording` names each run's file in it.

    Raises
    ------
    InvalidValueError
        If it cannot be written. The runs are in the ledger, and are not done again.
    """
    schema = _schema(experiment, ledger)
    if archive is not None:
        schema = schema.append(pa.field(RECORDING, pa.string()))
    with draft_of(path) as draft, parquet.ParquetWriter(draft, schema) as writer:
        for rows in _batches(_row(*pair, archive) for pair in _done(experiment, ledger)):
            writer.write_table(pa.Table.from_pylist(rows, schema=schema))
    return path


def _schema(experiment: Experiment, ledger: Ledger) -> pa.Schema:
    """Return the columns; a result that only some runs have gets its place by the first run that has it."""
    known = parameters_of(experiment.model_class)
    fields = [(name, TYPES.get(known[name].kind, pa.string())) for name in experiment.columns]
    fields += [("rng", pa.int64()), ("steps", pa.int64()), ("state_hash", pa.string())]
    names: dict[str, None] = dict.fromkeys(experiment.measure)
    if not names:
        for _, outcome in _done(experiment, ledger):
            names.update(dict.fromkeys(outcome.results or ()))
    return pa.schema([*fields, *((name, pa.float64()) for name in names), ("error", pa.string())])


def _done(experiment: Experiment, ledger: Ledger) -> Iterator[tuple[Task, Outcome]]:
    for task in experiment.tasks():
        outcome = ledger.outcome(task.key)
        if outcome is not None:
            yield task, outcome


def _row(task: Task, outcome: Outcome, archive: Archive | None) -> dict[str, Any]:
    settings = {name: shown_value(value) for name, value in task.settings.items()}
    failed = outcome.error is not None
    fixed = {
        "rng": task.rng,
        "steps": None if failed else outcome.steps,
        "state_hash": outcome.state_hash,
        "error": outcome.error,
    }
    file = None if archive is None else archive.file(task.key)
    recording = {RECORDING: file.name} if file is not None and file.exists() else {}
    return {**settings, **fixed, **(outcome.results or {}), **recording}


def _batches(rows: Iterable[dict]) -> Iterator[list[dict]]:
    rows = iter(rows)
    while batch := list(islice(rows, ROWS_AT_ONCE)):
        yield batch
