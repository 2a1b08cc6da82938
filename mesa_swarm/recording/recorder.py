"""The recorder, and its row buffer."""

import json
import os
import sys
import weakref
from bisect import bisect_left
from collections.abc import Callable, Sequence
from mimetypes import MimeTypes
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Any

import pyarrow as pa

from mesa_swarm.errors import RecordingError, check_count, shortened
from mesa_swarm.files import shown_path
from mesa_swarm.fire.model import FireModel
from mesa_swarm.model import Observer
from mesa_swarm.recording.changes import Mark, intervention_to_json
from mesa_swarm.recording.checkpoint import checkpoint_of
from mesa_swarm.recording.collected import Path as SeriesPath
from mesa_swarm.recording.collected import check_collected, lengths_of, size_of_collected
from mesa_swarm.recording.container import to_bytes
from mesa_swarm.recording.layout import DEFAULT, Chunk, Layout, population_of
from mesa_swarm.recording.parts import control_to_json, own_code, summary
from mesa_swarm.recording.provenance import as_metadata, from_metadata, provenance_of, scenery_of, shows
from mesa_swarm.recording.schema import (
    MOST_EVERY,
    check_columns,
    check_values,
    checked_change,
    checked_scenery,
    longest_gap,
)
from mesa_swarm.recording.sealed_stream import CHANGE, CHECKPOINT, INTERVENTION, Sealed, SealedWriter

HASH_EVERY = 100
# A chunk ends with whichever comes first. Larger ones make finding a frame slow, smaller ones make the file large.
MOST_ROWS = 256
MOST_BYTES = 2_000_000
MOST_SECONDS = 1.0


class Tape:
    """Rows gathered in a chunk, and the file they go to.

    What is pending follows from two counts, rows put and rows sealed, so that Ctrl-C between any two
    instructions neither loses a row nor writes one twice.
    """

    def __init__(self, layout: Layout, writer: SealedWriter, model: FireModel, every: int = 1) -> None:
        self.writer = writer
        self._gap, self._newest = longest_gap(every), model.completed
        self.rows = 0
        self._layout = layout
        self._seen, self._scenery = _seen(model), scenery_of(model)
        self._chunk: Chunk | None = None
        self._hashed = -1
        self._written_at = self._synced_at = perf_counter()

    def put(self, model: FireModel) -> None:
        """Keep the model as it is now."""
        chunk, step = self._chunk, model.completed
        self._check_gap(step)
        self._layout.prepare(model)
        seen = _seen(model)
        if chunk is None or seen != self._seen:
            self.flush()
            if seen != self._seen:
                self._tell_change(model)
                self._seen = seen
            chunk = self._chunk = self._new_chunk(model)
        state_hash = None
        if step // HASH_EVERY != self._hashed:
            state_hash, self._hashed = model.state_hash(), step // HASH_EVERY
        row = self.rows - self.writer.sealed.rows
        chunk.put(row, step, state_hash)
        self.rows, self._newest = self.rows + 1, step
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
            self._write(self._chunk, pending)
        self._written_at = perf_counter()
        if self._written_at - self._synced_at > MOST_SECONDS:
            self.writer.sync()
            self._synced_at = self._written_at

    def close(self, broken_off: bool = False) -> None:
        """Write what is left and end the file; one without rows replaces no other if it was broken off."""
        if self.writer.closed:
            return
        try:
            self.flush()
            if broken_off and not self.writer.is_in_place:
                self.writer.abandon()
            self.writer.close()
        except (RecordingError, OSError):
            self.writer.abandon()
            raise

    def _write(self, chunk: Chunk, rows: int) -> None:
        """Write the first rows of a chunk; if no reader would take one of them, those before it, and say so."""
        batch, first = chunk.batch(rows), int(chunk.steps[0])
        try:
            check_values(batch, first, shown_path(self.writer.path))
        except RecordingError:
            good = bisect_left(range(1, rows), True, key=lambda number: not _is_readable(chunk.batch(number)))
            if good:
                self.writer.write(chunk.batch(good), first)
            raise
        self.writer.write(batch, first)

    def _tell_change(self, model: FireModel) -> None:
        """Write what there is since the last row, and what it looks like if that is news."""
        told: dict[str, Any] = {"there": summary(model)}
        scenery = scenery_of(model)
        if not shows(self._scenery, scenery):
            told["scenery"] = self._scenery = scenery
        text = json.dumps(told).encode()
        try:
            checked_scenery(checked_change(text).get("scenery", scenery))
        except (RecordingError, ValueError) as error:
            raise RecordingError(
                f"{shown_path(self.writer.path)} cannot hold what came or went at step {model.completed}: {error}"
            ) from None
        self.attach(CHANGE, text, model.completed)

    def _check_gap(self, step: int) -> None:
        if step > self._newest + self._gap:
            raise RecordingError(
                f"{shown_path(self.writer.path)} cannot go on at step {step}: the last row is of step {self._newest}, "
                f"and at most {self._gap:,} steps may lie between two; start another recording"
            )

    def _new_chunk(self, model: FireModel) -> Chunk:
        row_bytes = Chunk(self._layout, model, 1).row_bytes
        return Chunk(self._layout, model, max(1, min(MOST_ROWS, MOST_BYTES // row_bytes)))


def _seen(model: FireModel) -> tuple:
    """Return what differs whenever the model may look other than it did, besides what rows hold."""
    return population_of(model), model.fire_constants


def _is_readable(batch: pa.RecordBatch) -> bool:
    try:
        check_values(batch, 0, "")
    except RecordingError:
        return False
    return True


CHECKPOINT_EVERY = 1000
# A chunk takes 6 kB beside its rows: in a loop of shorter runs these would be most of the file.
STEPS_WORTH_A_CHUNK = 10
# Endings of recordings, which are Arrow streams; and those of files that are none, besides what MIME types there are.
KINDS = (".arrow", ".arrows", ".ipc", ".bin")
OTHER_KINDS = {".map", ".toml", ".npz", ".parquet", ".feather", ".jsonl", ".ipynb", ".md", ".webm", ".docx", ".xlsx"}
NO_CHECKPOINTS = "checkpoint_every is 0"


class Recorder(Observer):
    """Writes down the model after its steps; made by `record`, and closed by `close`, at exit, or as a context.

    Parameters
    ----------
    model : FireModel
    path : Path
    every : int
        Steps from one row to the next.
    layout : Layout
    writer : SealedWriter
    checkpoint_every : int
        Most steps from one checkpoint to the next; 0 for none.

    Attributes
    ----------
    path : Path
    """

    def __init__(
        self,
        model: FireModel,
        path: Path,
        every: int,
        layout: Layout,
        writer: SealedWriter,
        checkpoint_every: int = 0,
    ) -> None:
        self.path = path
        self.every = every
        self._tape = Tape(layout, writer, model, every)
        self._checkpoints = _Checkpoints(self._tape, checkpoint_every, model)
        try:
            if checkpoint_every:
                self._checkpoints.put(model)
        except BaseException:
            writer.abandon()
            raise
        self._mark = Mark(model)
        self._unwritten: FireModel | None = None
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
        self.close() if kind is None else self.break_off()

    @property
    def closed(self) -> bool:
        """Whether nothing more is recorded."""
        return self._tape.writer.closed

    def before_step(self, model: FireModel) -> None:
        """Store the state if somebody changed it since the last step; called by the model before each step."""
        if self.closed:
            return
        what = self._mark.changes(model)
        if what:
            model._sensed = None  # columns that are written directly do not tell: without us, they were read now
            self._guarded(self._checkpoints.put_intervention, model, what)

    def after_step(self, model: FireModel, step: int) -> None:
        """Take note that a row is due; called by the model when its class may still have more to do in this step."""
        if not step % self.every and not self.closed:
            self._unwritten = model

    def after_failure(self, model: FireModel) -> None:
        """Record the row of a step that failed when only the class's own part was left; called by the model."""
        if not self.closed:
            self._put_row()

    def between_steps(self, model: FireModel) -> None:
        """Record what is due; called by the model when nothing of the step is left to do."""
        if self.closed:
            return
        self._put_row()
        if model.completed >= self._checkpoints.due:
            self._guarded(self._checkpoints.put, model)
        self._mark = Mark(model)

    def after_run(self, model: FireModel, steps: int) -> None:
        """Write what is pending, so that it can be read, unless the run was short; called at the end of `run`."""
        if steps >= STEPS_WORTH_A_CHUNK and not self.closed:
            self._guarded(self._tape.flush)

    def _put_row(self) -> None:
        model, self._unwritten = self._unwritten, None
        if model is not None:
            self._guarded(self._tape.put, model)

    def _guarded(self, write: Callable, *given: object) -> None:
        """Write, and stop recording if that fails."""
        try:
            write(*given)
        except (RecordingError, OSError):
            self._abandon()
            raise

    @property
    def checkpoints(self) -> tuple[int, ...]:
        """The steps of which the complete state was stored."""
        return tuple(self._checkpoints.steps)

    @property
    def why_no_checkpoint(self) -> str:
        """Why the last checkpoint that was due was not stored; an empty text if it was."""
        return self._checkpoints.why_not

    @property
    def written(self) -> Sealed:
        """How many bytes were written, and how many rows stand under the recording's name: none beside an older one."""
        writer = self._tape.writer
        return writer.sealed if writer.is_in_place else writer.sealed._replace(rows=0)

    def flush(self) -> None:
        """Write what was recorded so far into the file and have the system put it on the disk."""
        if not self.closed:
            self._guarded(self._tape.flush)
            self._guarded(self._tape.writer.sync)

    def close(self) -> None:
        """Write what is left and end the file; a second time does nothing.

        A recording without rows replaces an older one too: somebody asked for it.
        """
        self._end(broken_off=False)

    def break_off(self) -> None:
        """Close after an error or Ctrl-C: a recording that has no rows by then does not replace an older one."""
        self._end(broken_off=True)

    def _end(self, broken_off: bool) -> None:
        if self in self._observers:
            self._observers.remove(self)
        if not self.closed:
            self._put_row()
        self._tape.close(broken_off)
        self._finish.detach()

    def _abandon(self) -> None:
        """Stop where the file cannot be written: the model may go on, and every step would fail again."""
        if self in self._observers:
            self._observers.remove(self)
        self._tape.writer.abandon()


class _Checkpoints:
    """Complete states, stored every so many steps; what is collected over the steps is told from one to the next."""

    def __init__(self, tape: Tape, every: int, model: FireModel) -> None:
        self.steps: list[int] = []
        self.why_not = "" if every else NO_CHECKPOINTS
        self.due = 0 if every else sys.maxsize
        self._tape = tape
        self._every = every
        self._control = control_to_json(model.control)
        self._since: dict[SeriesPath, int] = {}
        self._collected = self._more = 0

    def put(self, model: FireModel) -> None:
        """Store the model as it is now, unless it holds what cannot be stored."""
        self._attach(model, self._content(model, model.steps))

    def put_intervention(self, model: FireModel, what: list[str]) -> None:
        """Tell what somebody changed before the step that Mesa has counted just now, and store what came of it."""
        content = self._content(model, model.steps - 1) if self._every else b""
        self._tape.attach(INTERVENTION, intervention_to_json(what, self.why_not), model.completed)
        self._attach(model, content)

    def _content(self, model: FireModel, steps: int) -> bytes:
        """Return a checkpoint as bytes; none, and why, if there is none."""
        self.due = model.completed + self._every
        try:
            self._check_control(model)
            checkpoint = checkpoint_of(model, self._since, steps=steps)
            content = to_bytes(checkpoint)
            self._more = size_of_collected(checkpoint)
            check_collected(self._collected + self._more, self._tape.writer.sealed.end)
        except RecordingError as error:
            self.why_not = str(error)
            return b""
        self.why_not = ""
        return content

    def _check_control(self, model: FireModel) -> None:
        """Refuse a control with code that the model's constructor, as far as is known, does not give it."""
        now = control_to_json(model.control)
        own = own_code(now)
        if own and now != self._control:
            raise RecordingError(
                f"its control has code of one's own in it ({own[0]}), which no recording holds: set it again by hand "
                "after resuming from before, or record a model whose class has the rule"
            )

    def _attach(self, model: FireModel, content: bytes) -> None:
        if content:
            self._tape.attach(CHECKPOINT, content, model.completed)
            self._since = lengths_of(model)
            self._collected += self._more
            self.steps.append(model.completed)


def _close_silently(tape: Tape) -> None:
    """Close at exit, when nobody is left whom an error would reach."""
    try:
        tape.close(broken_off=True)
    except (RecordingError, OSError):
        return


def record(
    model: FireModel,
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
    chunk that was not written yet. At the end of a `model.run` of ten steps or more all rows are in the file and can be
    read, though it is still open; after shorter ones, and after `model.step`, `Recorder.flush` puts them there.

    A row is the model when nothing of the step is left to do. Its readings are those of its own poses, as whoever looks
    at the model sees them; those on which its commands and layers were decided stand in the row of the step before.

    What somebody changes by hand between two steps is noticed before the next one, as far as `Mark` says, told in the
    file, and followed by a checkpoint (`Recording.interventions`): each such change makes the file longer by one.

    Parameters
    ----------
    model : FireModel
        Any `SwarmModel`.
    path : str or Path
    every : int
        Steps from one row to the next, 1 to 1,000,000: steps that are its multiples are recorded.
    columns : sequence of str, optional
        Of the swarm, and "fires", "contacts", "loads"; by default what one needs to look at the run. Columns
        of sensors that no robot has are left out.
    exact : bool
        Whether real numbers keep all 64 bits. By default they keep the first 24 (float32), which is 3e-5 map
        units at 800, and files are half as large; state hashes are always of all bits.
    overwrite : bool
        Whether a file that is there is replaced. It stays as it is until the first rows are on the disk, a second
        after the first of them or at the next `Recorder.flush`; or until the recording is closed, also without rows.
        What another process is recording is not replaced.
    rerun : bool
        Whether the model must be one that can be run again from what the file says of it.
    checkpoint_every : int
        Most steps from one checkpoint, the complete state, to the next; 0 stores none, also after changes by hand.
        With them `resume` need not run all steps again, and goes on from models that were changed by hand. A model
        that holds what cannot be stored, or much that is large, is recorded without, see `Recorder.why_no_checkpoint`.

    Returns
    -------
    Recorder
        Close it when done; Ctrl-C during `model.run` and the end of the program close it too.

    Raises
    ------
    RecordingError
        If the file is there already or cannot be written, a parameter of the model cannot be told, or `Recording` would
        refuse to read it.
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
    target = _checked_path(path)
    every = check_count("every", every, minimum=1, maximum=MOST_EVERY)
    checkpoint_every = check_count("checkpoint_every", checkpoint_every)
    layout = Layout(model, DEFAULT if columns is None else columns, exact)
    facts = provenance_of(model, rerun)
    facts |= {
        "every": every,
        "exact": bool(exact),
        "hash_every": HASH_EVERY,
        "checkpoint_every": checkpoint_every,
        "why_no_checkpoint": _why_not(model) if checkpoint_every else NO_CHECKPOINTS,
        "start": {"step": model.completed, "state_hash": model.state_hash()},
    }
    schema = layout.schema.with_metadata(as_metadata(facts))
    _check_readable(schema)
    writer = SealedWriter(target, schema, overwrite)
    return Recorder(model, target, every, layout, writer, checkpoint_every)


def _check_readable(schema: pa.Schema) -> None:
    """Refuse to begin a recording that `Recording` would refuse to open or to show."""
    try:
        check_columns(schema, "the model")
        checked_scenery(from_metadata(schema.metadata, "the model")["scenery"])
    except RecordingError as error:
        raise RecordingError(f"no reader would take this recording: {error}") from None


def _why_not(model: FireModel) -> str:
    """Return what cannot be stored of a model, an empty text if all can."""
    try:
        to_bytes(checkpoint_of(model, lengths_of(model)))
    except RecordingError as error:
        return str(error)
    return ""


def _checked_path(path: object) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise RecordingError(f"path is {shortened(path)}; expected the name of a file such as 'run.arrow'")
    target = Path(path)
    ending = target.suffix.lower()
    kind, packed = MimeTypes().guess_type(f"_{ending}")
    if ending in OTHER_KINDS or packed or (kind and ending not in KINDS):
        raise RecordingError(
            f"{shown_path(target)} has the ending of another kind of file; expected a name such as "
            f"{shown_path(target.with_suffix('.arrow').name)}"
        )
    return target
