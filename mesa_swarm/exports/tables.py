"""Tables of a recording as CSV or Parquet, written in pieces."""

import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from mesa_swarm.errors import ExportError, ExportWarning
from mesa_swarm.exports.portraits import Rows
from mesa_swarm.files import draft_of
from mesa_swarm.progress import progress_bar
from mesa_swarm.recording.frames import table_of

STEPS_AT_ONCE = 256


def export_csv(rows: Rows, path: Path, steps: Sequence[int], table: str, progress: bool) -> None:
    """Write a table as CSV, whole or not at all.

    Parameters
    ----------
    rows : Rows
    path : Path
    steps : sequence of int
        Which ones.
    table : str
        "robots", "fires", "contacts" or "loads".
    progress : bool
        Whether to show a bar.
    """
    with draft_of(path, ExportError) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        for number, piece in enumerate(pieces(rows, steps, table, progress)):
            piece.to_csv(file, index=False, header=number == 0, lineterminator="\n")


def export_parquet(rows: Rows, path: Path, steps: Sequence[int], table: str, progress: bool) -> None:
    """Write a table as Parquet, whole or not at all; parameters as for `export_csv`."""
    found = pieces(rows, steps, table, progress)
    first = pa.Table.from_pandas(next(found), preserve_index=False)
    with draft_of(path, ExportError) as draft, parquet.ParquetWriter(draft, first.schema, compression="zstd") as writer:
        writer.write_table(first)
        for piece in found:
            writer.write_table(pa.Table.from_pandas(piece, first.schema, preserve_index=False))


def pieces(rows: Rows, steps: Sequence[int], table: str, progress: bool) -> Iterator[pd.DataFrame]:
    """Yield the table of some steps, never more than 256 at once; warn at the end if it is empty.

    Raises
    ------
    UnknownNameError
        If that table was not recorded.
    """
    rows.recording.checked_table(table)
    found = 0
    with progress_bar(len(steps), "steps", progress) as bar:
        for begin in range(0, len(steps), STEPS_AT_ONCE):
            chosen = steps[begin : begin + STEPS_AT_ONCE]
            piece = table_of((rows.frame(step) for step in chosen), table)
            found += len(piece)
            yield piece
            bar.update(len(chosen))
    if not found:
        text = f"{rows.recording.path} has no {table} in these steps: the table is empty"
        warnings.warn(text, ExportWarning, stacklevel=2)
