"""What writes a recording while its model runs."""

import json
import os
import sys
import weakref
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from types import TracebackType

from mesa_swarm.errors import RecordingError, check_count, shortened
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.checkpoint import checkpoint_of
from mesa_swarm.recording.collected import Path as SeriesPath
from mesa_swarm.recording.collected import lengths_of
from mesa_swarm.recording.container import to_bytes
from mesa_swarm.recording.layout import DEFAULT, Chunk, Layout, population_of
from mesa_swarm.recording.provenance import as_metadata, provenance_of
from mesa_swarm.recording.sealed_stream import CHANGE, CHECKPOINT, SealedWriter
from mesa_swarm.recording.things import summary

HASH_EVERY = 100
CHECKPOINT_EVERY = 1000
# A chunk ends with whichever comes first. Larger ones make finding a frame slow, smaller ones make the file large.
MOST_ROWS = 256
MOST_BYTES = 2_000_000
MOST_SECONDS = 1.0


class Recorder:
    """Writes down the model after its steps; made by `record`, and closed by `close`, at exit, or as a context.

    Parameters
    ----------
    model : ObservedWorld
    path : Path
    every : int
        Steps from one row to the next.
    layout : Layout
    writer : SealedWriter
    checkpoint_every : int
        Fewest steps from one checkpoint to the next; 0 for none.

    Attributes
    ----------
    path : Path
    """

    def __init__(
        self,
        model: ObservedWorld,
        path: Path,
        every: int,
        layout: Layout,
        writer: SealedWriter,
        checkpoint_every: int = 0,
    ) -> None:
        self.path = path
        self.every = every
        self._tape = _Tape(layout, writer)
        self._checkpoints = _Checkpoints(self._tape, checkpoint_every)
        try:
            self._checkpoints.put_if_due(model)
        except (RecordingError, OSError):
            writer.abandon()
            raise
        self._observers = model.observers
        self._observers.append(self)
        self._finish = weakref.finalize(self, _close_silently, self._tape)

    def __repr__(self) -> str:
        return f"<Recorder of {len(self)} rows to {self.path}{', closed' if self.closed else ''}>"

    def __len__(self) -> int:
        """How many rows were recorded, those that are not yet in the file included."""
        return self._tape.rows

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, where: TracebackType | None) -> None:
        self.close()

    @property
    def closed(self) -> bool:
        """Whether nothing more is recorded."""
        return self._tape.writer.closed

    def after_step(self, model: ObservedWorld, step: int) -> None:
        """Record the model if a row is due; called by the model at the end of each step."""
        if step % self.every or self.closed:
            return
        try:
            self._tape.put(model, step)
        except (RecordingError, OSError):
            self._abandon()
            raise

    def between_steps(self, model: ObservedWorld) -> None:
        """Store a checkpoint if one is due; called by the model when nothing of the step is left to do."""
        if self.closed or model.completed < self._checkpoints.due:
            return
        try:
            self._checkpoints.put_if_due(model)
        except (RecordingError, OSError):
            self._abandon()
            raise

    @property
    def checkpoints(self) -> tuple[int, ...]:
        """The steps of which the complete state was stored."""
        return tuple(self._checkpoints.steps)

    @property
    def why_no_checkpoint(self) -> str:
        """What could not be stored when a checkpoint was due last; an empty text if all could."""
        return self._checkpoints.why_not

    def flush(self) -> None:
        """Write what was recorded so far into the file and have the system put it on the disk."""
        if self.closed:
            return
        try:
            self._tape.flush()
            self._tape.writer.sync()
        except (RecordingError, OSError):
            self._abandon()
            raise

    def close(self) -> None:
        """Write what is left and end the file; a second time does nothing."""
        if self in self._observers:
            self._observers.remove(self)
        self._tape.close()
        self._finish.detach()

    def _abandon(self) -> None:
        """Stop where the file cannot be written: the model may go on, and every step would fail again."""
        if self in self._observers:
            self._observers.remove(self)
        self._tape.writer.abandon()


class _Tape:
    """Rows gathered in a chunk, and the file they go to.

    What is pending follows from two counts, rows put and rows sealed, so that Ctrl-C between any two
    instructions neither loses a row nor writes one twice.
    """

    def __init__(self, layout: Layout, writer: SealedWriter) -> None:
        self.writer = writer
        self.rows = 0
        self._layout = layout
        self._chunk: Chunk | None = None
        self._hashed = -1
        self._written_at = self._synced_at = perf_counter()

    def put(self, model: ObservedWorld, step: int) -> None:
        """Keep the model as it is now."""
        chunk = self._chunk
        if chunk is None or chunk.population != population_of(model):
            self.flush()
            if chunk is not None:
                self.attach(CHANGE, json.dumps(summary(model)).encode(), step)
            chunk = self._chunk = self._new_chunk(model)
        state_hash = None
        if step // HASH_EVERY != self._hashed:
            state_hash, self._hashed = model.state_hash(), step // HASH_EVERY
        row = self.rows - self.writer.sealed.rows
        chunk.put(row, step, state_hash)
        self.rows += 1
        if row + 1 == chunk.capacity or perf_counter() - self._written_at > MOST_SECONDS:
            self.flush()

    def attach(self, name: str, content: bytes, step: int) -> None:
        """Write what is no row, after all rows before it."""
        self.flush()
        self.writer.attach(name, content, step)

    def flush(self) -> None:
        """Write the pending rows as one chunk."""
        pending = self.rows - self.writer.sealed.rows
        if self._chunk is not None and pending:
            self.writer.write(self._chunk.batch(pending), int(self._chunk.steps[0]))
        self._written_at = perf_counter()
        if self._written_at - self._synced_at > MOST_SECONDS:
            self.writer.sync()
            self._synced_at = self._written_at

    def close(self) -> None:
        """Write what is left and end the file."""
        if self.writer.closed:
            return
        try:
            self.flush()
            self.writer.close()
        except (RecordingError, OSError):
            self.writer.abandon()
            raise

    def _new_chunk(self, model: ObservedWorld) -> Chunk:
        row_bytes = Chunk(self._layout, model, 1).row_bytes
        return Chunk(self._layout, model, max(1, min(MOST_ROWS, MOST_BYTES // row_bytes)))


class _Checkpoints:
    """Complete states, stored every so many steps; what is collected over the steps is told from one to the next."""

    def __init__(self, tape: _Tape, every: int) -> None:
        self.steps: list[int] = []
        self.why_not = ""
        self.due = 0 if every else sys.maxsize
        self._tape = tape
        self._every = every
        self._since: dict[SeriesPath, int] = {}

    def put_if_due(self, model: ObservedWorld) -> None:
        """Store the model as it is now, unless it holds what cannot be stored."""
        step = model.completed
        if step < self.due:
            return
        self.due = step + self._every
        try:
            content = to_bytes(checkpoint_of(model, self._since))
        except RecordingError as error:
            self.why_not = str(error)
            return
        self._tape.attach(CHECKPOINT, content, step)
        self.why_not, self._since = "", lengths_of(model)
        self.steps.append(step)


def _close_silently(tape: _Tape) -> None:
    """Close at exit, when nobody is left whom an error would reach."""
    try:
        tape.close()
    except (RecordingError, OSError):
        return


def record(
    model: ObservedWorld,
    path: str | os.PathLike[str],
    *,
    every: int = 1,
    columns: Sequence[str] | None = None,
    exact: bool = False,
    overwrite: bool = False,
    rerun: bool = True,
    checkpoint_every: int = CHECKPOINT_EVERY,
) -> Recorder:
    """Write the model after each of the next steps to a file, from which `Recording` reads.

    The file is an Arrow IPC stream, compressed with zstd, one row a step, which any Arrow reader opens. Rows
    are written in chunks of at most 256 rows, 2 MB or a second; a program that is killed loses at most the
    chunk that was not written yet.

    Parameters
    ----------
    model : ObservedWorld
        Any `SwarmModel`.
    path : str or Path
    every : int
        Steps from one row to the next, at least 1: steps that are its multiples are recorded.
    columns : sequence of str, optional
        Of the swarm, and "fires", "contacts", "loads"; by default what one needs to look at the run. Columns
        of sensors that no robot has are left out.
    exact : bool
        Whether real numbers keep all 64 bits. By default they keep the first 24 (float32), which is 3e-5 map
        units at 800, and files are half as large; state hashes are always of all bits.
    overwrite : bool
        Whether a file that is there is replaced.
    rerun : bool
        Whether the model must be one that can be run again from what the file says of it.
    checkpoint_every : int
        Steps from one checkpoint, the complete state, to the next; 0 stores none. With them `resume` need not
        run all steps again, and goes on from models that were changed by hand. A model that holds what cannot
        be stored is recorded without, see `Recorder.why_no_checkpoint`.

    Returns
    -------
    Recorder
        Close it when done; Ctrl-C during `model.run` and the end of the program close it too.

    Raises
    ------
    RecordingError
        If the file is there already or cannot be written, or a parameter of the model cannot be told.
    InvalidValueError, UnknownNameError
        If a parameter is not permitted.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> from mesa_swarm.recording import Recording, record
    >>> model = FireFighting(rng=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with record(model, f"{folder}/run.arrow"):
    ...         end = model.run(20)
    ...     len(Recording(f"{folder}/run.arrow"))
    20
    """
    every = check_count("every", every, minimum=1)
    checkpoint_every = check_count("checkpoint_every", checkpoint_every)
    layout = Layout(model, DEFAULT if columns is None else columns, exact)
    facts = provenance_of(model, rerun)
    facts |= {
        "every": every,
        "exact": bool(exact),
        "hash_every": HASH_EVERY,
        "checkpoint_every": checkpoint_every,
        "why_no_checkpoint": _why_not(model) if checkpoint_every else "checkpoint_every is 0",
        "start": {"step": model.completed, "state_hash": model.state_hash()},
    }
    target = _checked_path(path)
    writer = SealedWriter(target, layout.schema.with_metadata(as_metadata(facts)), overwrite)
    return Recorder(model, target, every, layout, writer, checkpoint_every)


def _why_not(model: ObservedWorld) -> str:
    """Return what cannot be stored of a model, an empty text if all can."""
    try:
        checkpoint_of(model, lengths_of(model))
    except RecordingError as error:
        return str(error)
    return ""


def _checked_path(path: object) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise RecordingError(f"path is {shortened(path)}; expected the name of a file such as 'run.arrow'")
    return Path(path)
