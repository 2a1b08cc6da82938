"""The recorder, its row buffer and its checkpoints."""

import json
import os
import sys
import warnings
import weakref
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from mimetypes import MimeTypes
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa

from mesa_swarm.base.errors import RecordingError, UnstoredStateWarning, shortened, without_middle
from mesa_swarm.base.files import show_path
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.fire.fires_part import BURNING
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.rows import AFTER, ASKED, BEFORE, EVERY, ROWS
from mesa_swarm.model.bodies_part import POSES
from mesa_swarm.model.driving import MOST_STEPS, Due, DueAfterwards
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.observers import DrivenObserver
from mesa_swarm.recording.changes import (
    MOST_POSES,
    ChangeDetector,
    HandMove,
    intervention_to_json,
    move_of,
    moves_to_bytes,
)
from mesa_swarm.recording.checkpoint import checkpoint_of
from mesa_swarm.recording.collected_data import Path as SeriesPath
from mesa_swarm.recording.collected_data import check_collected, lengths_of, size_of_collected
from mesa_swarm.recording.container import to_bytes
from mesa_swarm.recording.layout import Chunk, Layout, default_columns, what_is_python
from mesa_swarm.recording.made_objects import check_agent_class
from mesa_swarm.recording.objects import check_addable, summary
from mesa_swarm.recording.provenance import (
    as_metadata,
    drawn_heat,
    drawn_parts,
    from_metadata,
    provenance_of,
    scenery_of,
    shows,
)
from mesa_swarm.recording.schema import (
    MOST_EVERY,
    check_recorded_columns,
    check_values,
    checked_content,
    checked_scenery,
    longest_gap,
)
from mesa_swarm.recording.sealed_stream import CHANGE, CHECKPOINT, INTERVENTION, MOVES, Sealed, SealedWriter
from mesa_swarm.recording.stored_values import control_to_json, own_code
from mesa_swarm.world.arena import ArenaAgent

HASH_EVERY = 100
# Limits of a chunk. Larger ones make finding a frame slow, smaller ones make the file large.
MOST_ROWS = 256
MOST_BYTES = 2_000_000
MOST_SECONDS = 1.0
CHECKPOINT_EVERY = 1000
# A chunk has 6 kB of metadata, which would be most of the file after many shorter runs.
STEPS_WORTH_A_CHUNK = 10
# Suffixes of recordings, which are Arrow streams; and of other files, besides those that have a MIME type.
KINDS = (".arrow", ".arrows", ".ipc", ".bin")
OTHER_KINDS = {".map", ".toml", ".npz", ".parquet", ".feather", ".jsonl", ".ipynb", ".md", ".webm", ".docx", ".xlsx"}
NO_CHECKPOINTS = "checkpoint_every is 0"


class RowBuffer:
    """The rows of a chunk, before they are written to a file.

    The pending rows follow from two counts, rows added and rows sealed, so that Ctrl-C between any two instructions
    neither loses a row nor writes one twice. Within compiled calls a kernel adds rows, and asks for those that Python
    has to add: with a state hash, and the last one of a chunk.
    """

    def __init__(self, layout: Layout, writer: SealedWriter, model: EngineModel, every: int = 1) -> None:
        self.writer = writer
        self._gap, self.newest, self._every = longest_gap(every), model.completed, every
        self._counts, self._known = np.zeros(ASKED + 1, np.int64), 0  # those of `kernels.rows`; rows that Python knows
        self._counts[EVERY] = every
        self._layout = layout
        self._signs, self._scenery = _signs_of_scenery(model), scenery_of(model)
        self._chunk: Chunk | None = None
        self._hashed = -1
        self._moves: list[HandMove] = []
        self._event_count = len(model.events)
        self._written_at = self._synced_at = perf_counter()

    @property
    def rows(self) -> int:
        """How many rows were added."""
        return int(self._counts[ROWS])

    def put(self, model: EngineModel, later: bool = False) -> None:
        """Add a row with the present state of the model; a full chunk may be written later, by a thread."""
        self.take_rows()
        chunk, step = self._chunk, model.completed
        if chunk is not None and self.rows - self.writer.rows == chunk.capacity:  # Ctrl-C came before it was written
            self.flush()
        self._check_gap(step)
        self._layout.prepare(model)
        signs = _signs_of_scenery(model)
        if chunk is None or signs != self._signs or not chunk.fits(model):
            self.flush()
            if signs != self._signs:
                self._attach_change(model)
                self._signs = signs
            row_bytes = Chunk(self._layout, model, 1).row_bytes
            chunk = self._chunk = Chunk(self._layout, model, max(1, min(MOST_ROWS, MOST_BYTES // row_bytes)))
        state_hash = None
        if step // HASH_EVERY != self._hashed:
            state_hash, self._hashed = model.state_hash(), step // HASH_EVERY
        row = self.rows - self.writer.rows
        chunk.put(model, row, state_hash, self._event_count)
        self._known, self.newest, self._event_count = self._known + 1, step, len(model.events)
        self._counts[ROWS] = self._known
        if row + 1 == chunk.capacity or perf_counter() - self._written_at > MOST_SECONDS:
            self.flush(later)

    def find_kernel(self, model: EngineModel, ask: Callable[[], None]) -> tuple[str, Kernel | None]:
        """Return why Python adds each row, empty if it does not, and what adds rows; None if the next begins a chunk.

        `ask` is called for a row that Python is to add.
        """
        why = what_is_python(model, self._layout)
        chunk = None if why else self._chunk_of(model)
        kernel = None if chunk is None else chunk.kernel(model, self._counts, ask)
        return why or ("" if chunk is None else chunk.why_not), kernel

    def _chunk_of(self, model: EngineModel) -> Chunk | None:
        """Return the chunk to which the next row belongs, None if it begins another one."""
        chunk, row = self._chunk, self.next_row(model)
        if chunk is None or row > self.newest + self._gap or _signs_of_scenery(model) != self._signs:
            return None
        return chunk if chunk.fits(model) else None

    def next_row(self, model: EngineModel) -> int:
        """Return the step of the next row."""
        return model.completed + self._every - model.completed % self._every

    def prepare(self, model: EngineModel) -> None:
        """Let the kernel add the next rows, up to the first that has a state hash or is the last one of the chunk."""
        counts, row = self._counts, self.next_row(model)
        counts[BEFORE], counts[AFTER], counts[ASKED] = self.writer.rows, model.completed, row
        if self._chunk is not None and row // HASH_EVERY == self._hashed:
            last = row + (self._chunk.capacity - 1 - self.rows + self.writer.rows) * self._every
            counts[ASKED] = min(last, -(-(self._hashed + 1) * HASH_EVERY // self._every) * self._every)

    def put_asked(self, model: EngineModel) -> bool:
        """Add a row for which the kernel has asked, and return whether the kernel may add those after it."""
        chunk = self._chunk
        self._counts[AFTER] = sys.maxsize  # if this fails, the step is taken to its end without a row
        if self.newest < model.completed:
            self.put(model, later=True)
        if self._chunk is chunk:
            self.prepare(model)
        return self._chunk is chunk

    def take_rows(self) -> None:
        """Complete the rows that the kernel has added."""
        rows, sealed = self.rows, self.writer.rows
        if self._chunk is not None and self._known < rows:
            self._chunk.complete(self._known - sealed, rows - sealed, self._event_count)
            self.newest = int(self._chunk.steps[rows - sealed - 1])
            self._event_count = int(self._chunk.event_counts[rows - sealed])
            self._known = rows

    def end_chunk(self) -> None:
        """Write the pending rows; those to come are of another model."""
        self.flush()
        self._chunk = None

    def attach(self, name: str, content: bytes, step: int) -> None:
        """Write a piece without rows, after all rows and moves before it."""
        self.flush()
        self._write_moves()
        self.writer.attach(name, content, step)

    def note(self, move: HandMove) -> None:
        """Store a move, which is written before the next rows."""
        if sum(len(move.bodies) for move in self._moves) > MOST_POSES:
            self._write_moves()
        self._moves.append(move)

    def forget_move(self, step: int) -> None:
        """Forget the move after a step: the next step, for which it was made, has failed."""
        if self._moves and self._moves[-1].step == step:
            self._moves.pop()

    def flush(self, later: bool = False) -> None:
        """Write the pending rows as one chunk."""
        self.take_rows()
        pending = self.rows - self.writer.rows
        if self._chunk is not None and pending:
            self._write_moves()
            if later:
                write = partial(self._write, self._chunk.copy(pending), pending, self.writer.write_now)
                self.writer.write_later(write, pending)
            else:
                self._write(self._chunk, pending, self.writer.write)
        self._written_at = perf_counter()
        if self._written_at - self._synced_at > MOST_SECONDS:
            self.writer.sync()
            self._synced_at = self._written_at

    def close(self, broken_off: bool = False) -> None:
        """Write the pending rows and end the file; one without rows replaces no other if it was broken off."""
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

    def _write_moves(self) -> None:
        """Write the pending moves; those that Ctrl-C lets it write twice are the same."""
        if self._moves:
            self.writer.attach(MOVES, moves_to_bytes(self._moves), self._moves[0].step)
            self._moves = []

    def _write(self, chunk: Chunk, rows: int, write: Callable[[pa.RecordBatch, int], None]) -> None:
        """Write the first rows of a chunk; if one has out-of-range values, write those before it and raise."""
        batch, first = chunk.batch(rows), int(chunk.steps[0])
        try:
            check_values(batch, first, show_path(self.writer.path))
        except RecordingError:
            good = bisect_left(range(1, rows), True, key=lambda number: not _is_readable(chunk.batch(number)))
            if good:
                write(chunk.batch(good), first)
            raise
        write(batch, first)

    def _attach_change(self, model: EngineModel) -> None:
        """Write the present population, and the scenery if it has changed."""
        change: dict[str, Any] = {"there": summary(model)}
        scenery = scenery_of(model)
        if not shows(self._scenery, scenery):
            change["scenery"] = self._scenery = scenery
        content = json.dumps(change).encode()
        try:
            checked_scenery(checked_content(CHANGE, content).get("scenery", scenery))
        except (RecordingError, ValueError) as error:
            raise RecordingError(
                f"{show_path(self.writer.path)} cannot store the objects of step {model.completed}: {error}"
            ) from None
        self.attach(CHANGE, content, model.completed)

    def _check_gap(self, step: int) -> None:
        if step > self.newest + self._gap:
            raise RecordingError(
                f"{show_path(self.writer.path)} cannot continue at step {step} after step {self.newest}; "
                f"expected at most {self._gap:,} steps from row to row; start another recording"
            )


def _signs_of_scenery(model: EngineModel) -> tuple:
    """Return what changes whenever the scenery may change."""
    return model.swarm.version, summary(model), model.fire_constants, drawn_parts(model), drawn_heat(model)


def _is_readable(batch: pa.RecordBatch) -> bool:
    try:
        check_values(batch, 0, "")
    except RecordingError:
        return False
    return True


class RowDue(DueAfterwards):
    """A recorder of which Python adds the row of a step, or stores the complete state after it.

    Parameters
    ----------
    what : str
    step : int
        The first of these steps.
    every : int
        The most steps from one to the next, 0 if there is only this one.
    """

    def __init__(self, what: str, step: int, every: int = 0) -> None:
        super().__init__(f"observer Recorder: {what}", every or MOST_STEPS)
        self.step, self.is_one = step, not every

    def first_after(self, completed: int) -> int:
        """Return the step."""
        return self.step

    def __str__(self) -> str:
        return self.what if self.is_one else super().__str__()


class Recorder(DrivenObserver):
    """Writes the model to a file after its steps; made by `record`, and closed by `close`, at exit, or as a context.

    Parameters
    ----------
    model : EngineModel
    path : Path
    trigger : Trigger
        When a row is due.
    layout : Layout
    writer : SealedWriter
    checkpoints : _Checkpoints
    state : bytes
        The present state of the model as `_Checkpoints.content` returns it.

    Attributes
    ----------
    path : Path
    every : int
        Steps from one row to the next.
    """

    def __init__(
        self,
        model: EngineModel,
        path: Path,
        trigger: Trigger,
        layout: Layout,
        writer: SealedWriter,
        checkpoints: "_Checkpoints",
        state: bytes,
    ) -> None:
        self.path = path
        self.every = trigger.every
        self._trigger = trigger
        self._buffer = RowBuffer(layout, writer, model, self.every)
        self._checkpoints = checkpoints
        try:
            checkpoints.attach(model, checkpoints.fitting(state, self._buffer), self._buffer)
        except BaseException:
            writer.abandon()
            raise
        self._detector = ChangeDetector(model)
        self._replacements: list[str] = []  # what a model that has taken the place of another differs in
        self._unwritten: EngineModel | None = None
        self._driven: EngineModel | None = None  # one of which a compiled call takes steps
        self._kernel: Kernel | None = None
        self._failure: Exception | None = None  # to write a row, within a compiled call
        self._first_step = model.completed  # the steps that were completed when the present one began
        self._observers = model.observers
        self._observers.append(self)
        self._finish = weakref.finalize(self, _close_silently, self._buffer)

    def __repr__(self) -> str:
        return f"<Recorder of {len(self)} rows to {self.path}{', closed' if self.closed else ''}>"

    def __len__(self) -> int:
        """Return the number of recorded rows, including those that are not yet in the file."""
        return self._buffer.rows

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, where: TracebackType | None) -> None:
        self.close() if kind is None else self.break_off()

    @property
    def closed(self) -> bool:
        """Whether nothing more is recorded."""
        return self._buffer.writer.closed

    def before_step(self, model: EngineModel) -> None:
        """Store the state if it was changed by hand since the last step; called by the model before each step."""
        if not self.closed:
            self._note_changes(model, model.steps - 1)

    def _note_changes(self, model: EngineModel, steps: int) -> None:
        """Store the state, after this number of steps that Mesa has counted, if it was changed by hand."""
        self._first_step = model.completed
        what, self._replacements = self._replacements or self._detector.changes(model), []
        moved_rows = self._detector.find_moved(model) if what == [POSES] else None
        if moved_rows is not None:
            self._write_or_stop(self._buffer.note, move_of(model, moved_rows, len(self._checkpoints.steps)))
        elif what:
            model.parts.robots.forget_readings()  # as without a recorder: columns may have been written directly
            self._write_or_stop(self._checkpoints.put_intervention, model, steps, what, self._buffer)

    def after_step(self, model: EngineModel, step: int) -> None:
        """Note that a row is due; called by the model before a derived class may do more in this step.

        Raises
        ------
        RecordingError
            If the step was not begun on its own, so that its row or the one before would be missing; the recording
            ends before.
        """
        if self.closed:
            return
        if self._first_step != step - 1:
            self._unwritten = None
            self._end(broken_off=True)
            raise RecordingError(
                f"step {step} was not taken by a model.step() of its own, so that rows would be missing: {self.path} "
                f"ends after step {self._first_step}; a step() of your own may call super().step() once"
            )
        if self._trigger.is_due(step):
            self._unwritten = model

    def after_failure(self, model: EngineModel) -> None:
        """Record the row of a step that failed in the part of a derived class; called by the model."""
        if not self.closed:
            self._buffer.forget_move(model.completed)
            self._put_row()

    def between_steps(self, model: EngineModel) -> None:
        """Record what is due; called by the model at the very end of a step."""
        if self.closed:
            return
        self._put_row()
        if model.completed >= self._checkpoints.next_step:
            self._write_or_stop(self._checkpoints.put, model, self._buffer)
        self._detector = ChangeDetector(model)

    def list_due(self, model: EngineModel) -> Iterator[Due]:
        """Yield in which step Python is due next: to add a row of itself, or to store the complete state."""
        if self.closed:
            return
        why, self._kernel = self._buffer.find_kernel(model, partial(_ask, weakref.ref(self), weakref.ref(model)))
        if why:
            yield RowDue(why, self._buffer.next_row(model), self.every)
        elif self._kernel is None:
            yield RowDue("the next row begins a chunk", self._buffer.next_row(model))
        if self._checkpoints.every:
            step = max(self._checkpoints.next_step, model.completed + 1)
            yield RowDue("checkpoints", step, self._checkpoints.every)

    def before_stretch(self, model: EngineModel, steps: int) -> None:
        """Store the state if it was changed by hand, before a compiled call; its kernel adds rows to the buffer."""
        if not self.closed:
            self._driven = model
            self._note_changes(model, model.steps)
            self._buffer.prepare(model)

    def kernel(self, model: EngineModel) -> Kernel | None:
        """Return what adds rows, which `list_due` has found."""
        return None if self.closed else self._kernel

    def _put_asked(self, model: EngineModel) -> None:
        """Add a row for which the kernel has asked; an error is raised when the step is over, which has begun."""
        try:
            goes_on = self._buffer.put_asked(model)
        except (RecordingError, OSError) as error:
            self._failure, goes_on = error, False
        if not goes_on:
            model.driving.flag[:] = True

    def after_stretch(self, model: EngineModel) -> None:
        """Record what is due after a compiled call.

        Raises
        ------
        RecordingError, OSError
            If a row could not be written during the call.
        """
        failure, self._failure = self._failure, None
        if failure is not None:
            self._abandon()
            raise failure
        if not self.closed:
            self._write_or_stop(self._buffer.writer.finish)
        self.between_steps(model)

    def after_run(self, model: EngineModel, steps: int) -> None:
        """Write the pending rows, so that they can be read, unless the run was short; called at the end of `run`."""
        if steps >= STEPS_WORTH_A_CHUNK and not self.closed:
            self._write_or_stop(self._buffer.flush)

    def replaced(self, old: EngineModel, new: EngineModel, what: list[str]) -> None:
        """Continue with the model that has taken the place of another: a change by hand."""
        if self.closed:
            return
        self._observers = new.observers
        self._replacements = [*self._replacements, *what]
        self._write_or_stop(self._buffer.end_chunk)

    def _put_row(self) -> None:
        driven, self._driven = self._driven, None
        if driven is not None and self._lacks_row(driven):
            self._unwritten = driven
        model, self._unwritten = self._unwritten, None
        if model is not None:
            self._write_or_stop(self._buffer.put, model)

    def _lacks_row(self, model: EngineModel) -> bool:
        """Return whether the last row of a compiled call is due, which it leaves to Python."""
        self._buffer.take_rows()
        is_new = model.completed > max(self._first_step, self._buffer.newest)
        return is_new and self._trigger.is_due(model.completed)

    def _write_or_stop(self, write: Callable, *arguments: object) -> None:
        """Write, and stop recording if that fails."""
        try:
            write(*arguments)
        except (RecordingError, OSError):
            self._abandon()
            raise

    @property
    def checkpoints(self) -> tuple[int, ...]:
        """The steps of which the complete state was stored."""
        return tuple(self._checkpoints.steps)

    @property
    def why_no_checkpoint(self) -> str:
        """Why the last due checkpoint was not stored; empty if it was."""
        return self._checkpoints.why_not

    @property
    def written(self) -> Sealed:
        """The bytes written, and the rows in the file of this name: none while it is a draft beside another."""
        writer = self._buffer.writer
        return writer.sealed if writer.is_in_place else writer.sealed._replace(rows=0)

    def flush(self) -> None:
        """Write all pending rows to the file and synchronise it to disk."""
        if not self.closed:
            self._write_or_stop(self._buffer.flush)
            self._write_or_stop(self._buffer.writer.sync)

    def close(self) -> None:
        """Write the pending rows and end the file; a second call does nothing.

        A recording without rows replaces an older one too, as requested.
        """
        self._end(broken_off=False)

    def break_off(self) -> None:
        """Close after an error or Ctrl-C: a recording without rows does not replace an older one."""
        self._end(broken_off=True)

    def _end(self, broken_off: bool) -> None:
        if self in self._observers:
            self._observers.remove(self)
        if not self.closed:
            self._put_row()
        self._buffer.close(broken_off)
        self._finish.detach()

    def _abandon(self) -> None:
        """Stop recording when the file cannot be written, so that the model can continue."""
        if self in self._observers:
            self._observers.remove(self)
        self._buffer.writer.abandon()


def _ask(recorder: Callable[[], Recorder | None], model: Callable[[], EngineModel | None]) -> None:
    """Let a recorder add a row: a kernel of its buffer that held it would keep both for ever."""
    recorder()._put_asked(model())  # type: ignore[union-attr, arg-type]


class _Checkpoints:
    """Complete states at intervals of at most `every` steps, 0 for none; each has what was collected since the last.

    `steps` are those of which a state is in the file, `why_not` is why the last one that was due is not.
    """

    def __init__(self, every: int, model: EngineModel) -> None:
        self.steps: list[int] = []
        self.why_not = "" if every else NO_CHECKPOINTS
        self.next_step = 0 if every else sys.maxsize
        self.every = every
        self.warned = False  # that states are not stored
        self._control = control_to_json(model.control)
        self._processes, self._kinds = {*model.parts.processes.numbered}, {*model.agents_by_type}
        self._parts = {*model.parts}
        self._since: dict[SeriesPath, int] = {}
        self._collected = self._more = 0

    def put(self, model: EngineModel, buffer: RowBuffer) -> None:
        """Store the present state of the model, unless it cannot be stored."""
        self.attach(model, self.fitting(self.content(model, model.steps), buffer), buffer)

    def put_intervention(self, model: EngineModel, steps: int, what: list[str], buffer: RowBuffer) -> None:
        """Store what was changed after this number of steps that Mesa has counted, and the state after the change."""
        content = self.fitting(self.content(model, steps), buffer)
        buffer.attach(INTERVENTION, intervention_to_json(what, self.why_not), model.completed)
        self.attach(model, content, buffer)

    def content(self, model: EngineModel, steps: int) -> bytes:
        """Return the state as bytes; no bytes, and set `why_not`, if it cannot be stored in any file."""
        if not self.every:
            return b""
        self.next_step = model.completed + self.every
        try:
            self._check_control(model)
            self._check_classes(model)
            checkpoint = checkpoint_of(model, self._since, steps=steps)
            content = to_bytes(checkpoint)
        except RecordingError as error:
            self.why_not = str(error)
            return b""
        self._more, self.why_not = size_of_collected(checkpoint), ""
        return content

    def fitting(self, content: bytes, buffer: RowBuffer) -> bytes:
        """Return what `content` has returned; no bytes, and set `why_not`, if it collects too much for the file yet."""
        if not content:
            return b""
        try:
            check_collected(self._collected + self._more, buffer.writer.sealed.end)
        except RecordingError as error:
            self.why_not = str(error)
            return b""
        return content

    def attach(self, model: EngineModel, content: bytes, buffer: RowBuffer) -> None:
        """Write what `fitting` has returned, or warn once that states are not stored."""
        if content:
            buffer.attach(CHECKPOINT, content, model.completed)
            self._since = lengths_of(model)
            self._collected += self._more
            self.steps.append(model.completed)
        elif self.every and not self.warned:
            self.warned = True
            name, step = type(model).__name__, model.completed
            text = f"the state of {name} after step {step} cannot be stored in its recording: "
            warnings.warn(without_middle(text + self.why_not), UnstoredStateWarning, stacklevel=2)

    def _check_control(self, model: EngineModel) -> None:
        """Refuse a control with custom rules that it did not have when the recording began."""
        now = control_to_json(model.control)
        rules = own_code(now)
        if rules and now != self._control:
            raise RecordingError(
                f"its control has a custom rule ({rules[0]}), which cannot be recorded: resume from an earlier "
                "step and set it again, or record a model whose class has the rule"
            )

    def _check_classes(self, model: EngineModel) -> None:
        """Refuse processes and agents, added since the recording began, that would not be made again."""
        numbered = model.parts.processes.numbered
        for number in numbered.keys() - self._processes - {BURNING}:  # which the first fire begins
            check_addable(numbered[number], "process", model)
        for part in model.parts.added():
            if part.name not in self._parts:
                check_addable(part, "part", model)
        for kind in model.agents_by_type.keys() - self._kinds:
            if not issubclass(kind, ArenaAgent):
                check_agent_class(kind, present=False)


def _close_silently(buffer: RowBuffer) -> None:
    """Close at exit, when an error can no longer be handled."""
    with suppress(RecordingError, OSError):
        buffer.close(broken_off=True)


def record(
    model: EngineModel,
    path: str | os.PathLike[str],
    *,
    every: int | Trigger = 1,
    columns: Sequence[str] | None = None,
    exact: bool = False,
    overwrite: bool = False,
    rerun: bool = True,
    checkpoint_every: int | Trigger = CHECKPOINT_EVERY,
) -> Recorder:
    """Write the model after each of the next steps to a file, from which `Recording` reads.

    The file is an Arrow IPC stream, compressed with zstd, one row a step, which any Arrow reader opens. Rows
    are written in chunks of at most 256 rows, 2 MB or a second, by a thread while a compiled call takes more steps; a
    program that is killed loses at most the chunks that were not written yet. At the end of a `model.run` of ten steps
    or more all rows are in the file and can be read, though it is still open; after shorter runs, and after
    `model.step`, `Recorder.flush` writes them.

    A row is the state of the model at the end of a step. Its readings are those for its own poses; those on which its
    commands and layers were decided are in the row of the step before.

    Manual changes between two steps are detected before the next one (see `ChangeDetector`), stored, and followed by a
    checkpoint (`Recording.interventions`). Where nothing but poses of driven bodies was set, these alone are stored.

    Parameters
    ----------
    model : EngineModel
        Any `SwarmModel`.
    path : str or Path
    every : int
        Steps from one row to the next, 1 to 1,000,000: its multiples are recorded. Or a `Trigger`.
    columns : sequence of str, optional
        Of the swarm, and "fires", "contacts", "loads", "fields", "events"; of added parts columns with a row a robot,
        as "part.column", and "shown", their discs. By default those needed to view the run, also those that the
        model's looks name, and of parts those of a few numbers a robot. Columns of sensors that no robot has are
        omitted. Of fields pictures are stored, see `Recording.fields`.
    exact : bool
        Whether real numbers are stored as float64. By default they are float32, which is 3e-5 map units at 800, and
        files are half as large; state hashes are always of all bits.
    overwrite : bool
        Whether an existing file is replaced. It is unchanged until the first rows are on disk, a second after the
        first of them or at the next `Recorder.flush`; or until the recording is closed, even without rows. A file that
        another process is recording is not replaced.
    rerun : bool
        Whether to require that the model can be run again from its recorded parameters.
    checkpoint_every : int
        Most steps from one checkpoint, the complete state, to the next, or a `Trigger`; 0 stores none, also after
        changes by hand. With checkpoints `resume` need not run all steps again, and can continue models that were
        changed by hand. A model whose state cannot be stored, or is too large, is recorded without: an
        `UnstoredStateWarning` names the attribute, see also `Recorder.why_no_checkpoint`.

    Returns
    -------
    Recorder
        Close it when done; Ctrl-C during `model.run` and the end of the program close it too.

    Raises
    ------
    RecordingError
        If the file exists already or cannot be written, a parameter of the model cannot be recorded, or `Recording`
        would refuse to read it.
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
    trigger = Trigger.of(every, minimum=1, maximum=MOST_EVERY)
    most_steps = Trigger.of(checkpoint_every, "checkpoint_every").every
    layout = Layout(model, default_columns(model) if columns is None else columns, exact)
    facts, checkpoints = provenance_of(model, rerun), _Checkpoints(most_steps, model)
    state = checkpoints.content(model, model.steps)
    facts |= {
        "every": trigger.every,
        "exact": bool(exact),
        "hash_every": HASH_EVERY,
        "checkpoint_every": most_steps,
        "why_no_checkpoint": checkpoints.why_not,
        "start": {
            "step": model.completed,
            "state_hash": model.state_hash(),
            **({"events": len(model.events)} if model.events else {}),
        },
    }
    schema = layout.schema.with_metadata(as_metadata(facts))
    _check_readable(schema)
    if most_steps and not state:
        checkpoints.warned = True
        text = f"{type(model).__name__} is recorded without checkpoints, so that resume runs it again from its start: "
        warnings.warn(without_middle(text + checkpoints.why_not), UnstoredStateWarning, stacklevel=2)
    writer = SealedWriter(target, schema, overwrite)
    return Recorder(model, target, trigger, layout, writer, checkpoints, state)


def _check_readable(schema: pa.Schema) -> None:
    """Refuse to begin a recording that `Recording` would refuse to open or to draw."""
    try:
        check_recorded_columns(schema, "the model")
        checked_scenery(from_metadata(schema.metadata, "the model")["scenery"])
    except RecordingError as error:
        raise RecordingError(f"this recording would be unreadable: {error}") from None


def _checked_path(path: object) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise RecordingError(f"path is {shortened(path)}; expected the name of a file such as 'run.arrow'")
    target = Path(path)
    suffix = target.suffix.lower()
    kind, compression = MimeTypes().guess_type(f"_{suffix}")
    if suffix in OTHER_KINDS or compression or (kind and suffix not in KINDS):
        raise RecordingError(
            f"{show_path(target)} has the suffix of another kind of file; expected a name such as "
            f"{show_path(target.with_suffix('.arrow').name)}"
        )
    return target
