"""The switch "record": the present run, written into a file of the session's until that is too large."""

import shutil
from pathlib import Path

from mesa_swarm.errors import RecordingError
from mesa_swarm.model import SwarmModel
from mesa_swarm.recording.recorder import Recorder, record

# Of one recording, bytes.
MOST_BYTES = 300_000_000
# Steps from one look at the file's size to the next.
LOOK_EVERY = 50


class Tape:
    """Records a model from now on, one recording at a time.

    Parameters
    ----------
    folder : Path
        Where the file is; it must be there when recording begins.
    most_bytes : int
        Recording ends when the file is larger.

    Attributes
    ----------
    path : Path
    first, last : int
        Steps that were recorded; `last` is below `first` if none was.
    ended : str
        Why it ended by itself, empty if it did not.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     tape, model = Tape(Path(folder)), SwarmModel(rng=1)
    ...     tape.start(model)
    ...     tape.stop() if model.run(5) else None
    ...     tape.words
    'steps 1 to 5'
    """

    def __init__(self, folder: Path, most_bytes: int = MOST_BYTES) -> None:
        self.path = folder / "recorded.arrow"
        self.most_bytes = most_bytes
        self.first, self.last = self._before = 1, 0
        self.ended = ""
        self._model: SwarmModel | None = None
        self._recorder: Recorder | None = None

    @property
    def running(self) -> bool:
        """Whether steps are recorded."""
        return self._recorder is not None and not self._recorder.closed

    @property
    def model(self) -> SwarmModel | None:
        """What is recorded now."""
        return self._model

    @property
    def words(self) -> str:
        """Which steps were recorded, in words; empty if none was."""
        return f"steps {self.first:,} to {self.last:,}" if self.last >= self.first else ""

    def start(self, model: SwarmModel) -> None:
        """Record a model from its next step on; what was recorded before is replaced by the first rows."""
        self.stop()
        self._recorder = record(model, self.path, overwrite=True)
        self._model, self.ended = model, ""
        self._before = self.first, self.last
        self.first, self.last = model.completed + 1, model.completed
        model.observers.append(self)

    def after_step(self, model: SwarmModel, step: int) -> None:
        """Take note of a step; called by the model when its class may still have more to do in this step."""
        if self.running:
            self.last = step

    def between_steps(self, model: SwarmModel) -> None:
        """End the recording if it must; called by the model when nothing of the step is left to do."""
        recorder = self._recorder
        if recorder is None:
            return
        if recorder.closed:
            self._note_what_is_left(recorder.written.rows)
            self._end("the recording could not be written any more")
        elif model.completed % LOOK_EVERY == 0 and recorder.written.end > self.most_bytes:
            self._end(f"the recording has {self.most_bytes / 1e6:,.0f} MB, which is the limit")

    def stop(self) -> None:
        """Record no more; what was recorded stays."""
        recorder, model = self._recorder, self._model
        self._recorder = self._model = None
        if model is not None and self in model.observers:
            model.observers.remove(self)
        if recorder is None:
            return
        failed = recorder.closed  # it has closed itself
        try:
            recorder.close()
        except RecordingError:
            failed = True
            raise
        finally:
            if failed:
                self._note_what_is_left(recorder.written.rows)

    def close(self) -> None:
        """Stop; called when a run is broken off."""
        self.stop()

    def copy(self, path: Path) -> None:
        """Copy what was recorded so far."""
        if self._recorder is not None and not self._recorder.closed:
            self._recorder.flush()
        shutil.copyfile(self.path, path)

    def _note_what_is_left(self, rows: int) -> None:
        """Take note of which steps the file holds after a failure: without new rows those that it held before."""
        self.first, self.last = (self.first, self.first + rows - 1) if rows else self._before

    def _end(self, why: str) -> None:
        self.stop()
        self.ended = f"{why}; it ended at step {self.last:,}"
