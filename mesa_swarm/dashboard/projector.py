"""A recording that is played like a model."""

import threading
from bisect import bisect_left
from pathlib import Path

from mesa_swarm.errors import RecordingError
from mesa_swarm.recording.frames import Frame
from mesa_swarm.recording.recording import Recording
from mesa_swarm.viewing.packing import packed_frame
from mesa_swarm.viewing.player import PackedFrame, Past, Player
from mesa_swarm.viewing.scene import Scene, scene_of_recording


class RecordedPast(Past):
    """The rows of a recording: all are there, and none is in memory but the one looked at.

    Parameters
    ----------
    recording : Recording
    rows : int
        So many can be read.
    """

    def __init__(self, recording: Recording, rows: int) -> None:
        super().__init__()
        self._recording: Recording | None = recording
        self._rows = range(rows)
        self._scene = scene_of_recording(recording)
        self._last: tuple[int, PackedFrame] | None = None
        self._ends = tuple(recording[row].step if rows else 0 for row in (0, rows - 1))

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def recording(self) -> Recording:
        """What it shows.

        Raises
        ------
        RecordingError
            If it was let go of.
        """
        if self._recording is None:
            raise RecordingError("the recording was closed; open it again")
        return self._recording

    @property
    def first_step(self) -> int:
        """The step of the first row, 0 if there is none."""
        return self._ends[0]

    @property
    def last_step(self) -> int:
        """The step of the last row, 0 if there is none."""
        return self._ends[1]

    @property
    def shown(self) -> PackedFrame | None:
        """The picture of the row that is looked at, None if there are no rows."""
        if not self._rows:
            return None
        if self._last is None or self._last[0] != self.index:
            frame = self.recording[self.index]
            self._last = self.index, packed_with_readings(frame, self._scene)
        return self._last[1]

    def step_of(self, row: int) -> int:
        """Return the step of a row."""
        return self.recording[row].step

    def look_at(self, step: int) -> None:
        """Look at the first row that is not of an earlier step."""
        self.look(bisect_left(self._rows, step, key=self.step_of))

    def clear(self) -> None:
        """Let go of the recording."""
        self._recording, self._rows, self._last, self.index = None, range(0), None, 0


class Projector(Player):
    """Plays a recording: what a `Player` does to a model, to rows.

    Its speed counts the steps that were taken, also where not every step was recorded.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    provenance : dict
        What the recording says of its run, also once it is closed.

    Raises
    ------
    RecordingError
        If it is no recording, or has nothing to show.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm import SwarmModel
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = SwarmModel(rng=1)
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(3)
    ...     projector = Projector(f"{folder}/run.arrow")
    ...     projector.step()
    ...     projector.past.shown.step
    2
    """

    def __init__(self, path: str | Path) -> None:
        recording = Recording(path)
        rows = recording.intact
        if not rows:
            raise RecordingError(f"{recording.path.name} holds no step that can be shown; choose another file")
        super().__init__()
        self.provenance = recording.provenance
        self.past = self.rows = RecordedPast(recording, rows)
        self._waited = 0
        self.rest()

    @property
    def recording(self) -> Recording:
        """What is played."""
        return self.rows.recording

    @property
    def finished(self) -> bool:
        """Whether the last row is looked at."""
        return self.past.is_present

    @property
    def step_shown(self) -> int:
        """The step that is looked at."""
        with self.lock:
            return self.rows.step_of(self.rows.index) if len(self.rows) else 0

    def step(self) -> None:
        """Pause, and look at the next row."""
        self.look(self.past.index + 1)

    def look(self, index: int) -> None:
        """Pause, and look at one of the rows, for as long as any other when it is played on."""
        self.loop.pause()
        with self.lock:
            self._waited = 0
        super().look(index)

    def look_at(self, step: int) -> None:
        """Pause, and look at the first row that is not of an earlier step."""
        self.loop.pause()
        with self.capture_errors():
            self._waited = 0
            self.rows.look_at(step)
        self.rest()

    def rewind(self) -> None:
        """Pause, and look at the first row, whatever went wrong before."""
        self.error = ""
        self.look(0)

    def _can_go_on(self) -> bool:
        return not self.error and not self.finished

    def _play_step(self, stop: threading.Event) -> bool:
        with self.capture_errors():
            return not stop.is_set() and self._advance()
        self.rest()  # it broke, which has stopped the thread already
        return False

    def _advance(self) -> bool:
        """Wait for one more step, and look at the next row when it is due; return whether there is more."""
        if self.past.is_present:
            return False
        here, following = (self.rows.step_of(row) for row in (self.rows.index, self.rows.index + 1))
        self._waited += 1
        if self._waited >= following - here:
            self._waited = 0
            self.rows.look(self.rows.index + 1)
        return True

    def _store(self, fingerprint: bool = False) -> None:
        """Keep nothing: all is in the file."""

    def _shown(self) -> PackedFrame | None:
        """Return the picture that is looked at, None if it cannot be read, which is then said."""
        with self.capture_errors():
            return None if self.error else self.past.shown
        return None  # what went wrong is in `error`


def packed_with_readings(frame: Frame, scene: Scene) -> PackedFrame:
    """Return what is shown of a recorded frame."""
    world = scene.world(frame.step)
    return PackedFrame(frame.step, packed_frame(frame, scene), world, readings_of_frame(frame), frame.state_hash or "")


def readings_of_frame(frame: Frame) -> tuple[tuple[str, str], ...]:
    """Return the numbers that are shown above the picture, each with its name; what was not recorded has none."""
    readings = [("Robots", f"{len(frame.robots):,}")]
    if len(frame.columns.get("fires", ())):
        fires = frame["fires"]
        readings.append(("Fires burning", f"{int((~fires['out']).sum())} of {len(fires)}"))
    if "contacts" in frame.columns:
        readings.append(("Contacts", f"{len(frame['contacts']):,}"))
    return tuple(readings)
