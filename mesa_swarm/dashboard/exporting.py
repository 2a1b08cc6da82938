"""Files of a run made in the background, and the switch that records it."""

import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import anywidget
import solara
import traitlets

from mesa_swarm.dashboard.session import Session
from mesa_swarm.dashboard.widgets import Downloads
from mesa_swarm.errors import (
    ExportError,
    InvalidValueError,
    RecordingError,
    SwarmError,
    check_choice,
    check_count,
    in_words,
)
from mesa_swarm.experiments.pool import ending_with_us
from mesa_swarm.model import Observer
from mesa_swarm.recording.recorder import Recorder, record
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.canvas_widget import text_of
from mesa_swarm.viewing.pictures import Shown, frame_and_scene, png, svg, world_figure
from mesa_swarm.viewing.player import PackedFrame

# Of one recording, bytes.
MOST_BYTES = 300_000_000
# Steps from one look at the file's size to the next.
LOOK_EVERY = 50
# What can be made, and what it is called; those with a dot are tables.
KINDS = {
    "png": "Picture (PNG)",
    "svg": "Picture (SVG)",
    "gif": "Animation (GIF)",
    "mp4": "Film (MP4)",
    "html": "Page that replays it (HTML)",
    "arrow": "Recording (.arrow)",
    "robots.csv": "Table of robots (CSV)",
    "robots.parquet": "Table of robots (Parquet)",
    "fires.csv": "Table of fires (CSV)",
    "fires.parquet": "Table of fires (Parquet)",
}
PICTURES = ("png", "svg")
SOURCES = ("run", "recording")
MOST_ROWS = 5_000_000
LARGEST_DOWNLOAD = 500_000_000
# A run that is made again lets others work after so many seconds of its own.
TURN = 0.02
PERCENT = re.compile(r"(\d+) %")
COMMAND = "import sys; from mesa_swarm.cli import main; sys.exit(main())"
# Shortest time between updates of the progress and the recorded steps, s.
EVERY = 0.25


class RecordingSwitch(Observer):
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
    ...     switch, model = RecordingSwitch(Path(folder)), SwarmModel(rng=1)
    ...     switch.start(model)
    ...     switch.stop() if model.run(5) else None
    ...     switch.words
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


class CancelledError(SwarmError):
    """The user wants it no longer."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be made.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    source : str
        "run": the run so far, made again; "recording": what was recorded.
    every : int
        Steps from one row of a table to the next, at least 1.
    sectors : bool
        Whether pictures show where sensors look.
    trails : bool
        Whether films show where robots were.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If a value is out of its range.
    """

    kind: str
    source: str = "run"
    every: int = 1
    sectors: bool = False
    trails: bool = False

    def __post_init__(self) -> None:
        """Check every value."""
        check_choice("kind", self.kind, KINDS)
        check_choice("source", self.source, SOURCES)
        check_count("every", self.every, minimum=1, maximum=1_000_000)

    @property
    def ending(self) -> str:
        """What the file's name ends with."""
        return self.kind.rsplit(".", maxsplit=1)[-1]

    @property
    def table(self) -> str:
        """Which table it is, empty if it is none."""
        return self.kind.split(".")[0] if "." in self.kind else ""

    def options(self) -> list[str]:
        """Return what the command `export` is given."""
        if self.table:
            return ["--table", self.table, *(["--every", str(self.every)] if self.every > 1 else [])]
        if self.kind in ("gif", "mp4"):
            return ["--sectors"] * self.sectors + ["--trails", "60"] * self.trails
        return []


class Exporting:
    """Makes one file at a time of a session's run, in the background.

    Parameters
    ----------
    session : Session

    Attributes
    ----------
    switch : RecordingSwitch
    doing : str
        What is being done now, empty if nothing is.
    progress : float or None
        Share of it that is done, None if that is not known.
    message, fault : str
        What became of the last one.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self._deliver: Callable[[str, bytes | Path], None] | None = None
        self._tell: Callable[[], None] = _nobody
        self._undelivered: tuple[str, bytes | Path] | None = None
        self._folder = TemporaryDirectory(prefix="mesa_swarm_")
        self.folder = Path(self._folder.name)
        self.switch = RecordingSwitch(self.folder)
        self.doing, self.message, self.fault = "", "", ""
        self.progress: float | None = None
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen | None = None
        self._cancelled = threading.Event()

    def connect(self, deliver: Callable[[str, bytes | Path], None], tell: Callable[[], None]) -> None:
        """Have somebody told of changes and given what is made; what was made while nobody was there comes now.

        Parameters
        ----------
        deliver : function
            Called with a file's name, and its content or path.
        tell : function
            Called when something changed: progress, an end, a fault.
        """
        self._deliver, self._tell = deliver, tell
        made, self._undelivered = self._undelivered, None
        if made is not None:
            deliver(*made)

    def disconnect(self) -> None:
        """Tell nobody; what goes on goes on."""
        self._deliver, self._tell = None, _nobody

    def record(self, on: bool) -> None:
        """Record the present run from now on, or no longer."""
        session = self.session
        with session.lock:
            try:
                self.fault = ""
                if not on:
                    self.switch.stop()
                elif session.model is not None:
                    self.switch.start(session.model)
            except (SwarmError, OSError) as problem:
                self.fault = in_words(problem)
        self._tell()

    def check_recording(self) -> None:
        """End the recording if its model is played no more."""
        with self.session.lock:
            if self.switch.running and self.switch.model is not self.session.model:
                self.switch.stop()

    def start(self, **wanted: Any) -> None:
        """Begin to make a file, unless one is being made."""
        if self._thread is not None and self._thread.is_alive():
            self.fault = "a file is being made already; wait for it, or cancel it"
        else:
            self._cancelled.clear()
            self.doing, self.progress, self.message, self.fault = "Starting", None, "", ""
            self._thread = threading.Thread(target=self._work, args=(wanted,), name="export", daemon=True)
            self._thread.start()
        self._tell()

    def cancel(self) -> None:
        """Break off what is being made."""
        self._cancelled.set()
        process = self._process
        if process is not None:
            process.terminate()

    def close(self) -> None:
        """Break off, stop recording and delete all files."""
        self.cancel()
        with self.session.lock:
            self.switch.stop()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(5)
        self._folder.cleanup()

    def _work(self, wanted: dict[str, Any]) -> None:
        try:
            name = self._make(Wanted(**wanted))
        except CancelledError:
            self.message = "Cancelled."
        except Exception as problem:  # whatever went wrong is said beside the button
            self.fault = "" if self._cancelled.is_set() else in_words(problem)
            self.message = "Cancelled." if self._cancelled.is_set() else ""
        else:
            self.message = f"{name} is made."
        self.doing, self.progress = "", None
        self._tell()

    def _make(self, wanted: Wanted) -> str:
        """Make a file, hand it over and return its name."""
        session = self.session
        self._undelivered = None
        for old in self.folder.glob("made*"):
            old.unlink()
        if wanted.kind in PICTURES:
            step, shown = self._shown()
            figure = world_figure({f"{session.name}, step {step:,}": shown}, wanted.sectors)
            name = f"{session.name}_{step}.{wanted.kind}"
            self._hand_over(name, png(figure) if wanted.kind == "png" else svg(figure))
            return name
        source = self.folder / "made.arrow"
        rows = self._from_recording(source) if wanted.source == "recording" else self._run_again(source)
        made = source if wanted.kind == "arrow" else self.folder / f"made.{wanted.ending}"
        if made is not source:
            self._check_table(wanted, rows)
            self._export([str(source), str(made), *wanted.options()])
        self._check_cancelled()
        if made.stat().st_size > LARGEST_DOWNLOAD:
            raise ExportError(f"the file has {made.stat().st_size / 1e6:,.0f} MB; expected at most 500 MB: record less")
        name = f"{session.name}{f'_{wanted.table}' if wanted.table else ''}.{wanted.ending}"
        self._hand_over(name, made)
        return name

    def _shown(self) -> tuple[int, Shown]:
        """Return the step that is looked at, and what is drawn of it."""
        session = self.session
        with session.lock:
            if session.model is None or session.past.shown is None:
                raise ExportError("there is no model to draw; reset first")
            step = session.past.shown.step
            if session.past.is_present:
                return session.model.completed, frame_and_scene(session.model)
            _check_straight(session, "draw an earlier step")
        return step, self._taken(session.remade(), step)

    def _from_recording(self, path: Path) -> int:
        """Copy the switch; return how many steps are on it."""
        with self.session.lock:
            if not self.switch.words:
                raise ExportError("nothing was recorded; switch Record on, and play")
            self.switch.copy(path)
            return self.switch.last - self.switch.first + 1

    def _run_again(self, path: Path) -> int:
        """Make the run so far again while it is recorded; return how many steps that is."""
        session = self.session
        with session.lock:
            if session.model is None or not session.model.completed:
                raise ExportError("nothing has happened yet; play, then export")
            _check_straight(session, "make it again")
            steps, mark = session.model.completed, session.model.state_hash()
            model = session.remade()
        with record(model, path, overwrite=True):
            self._taken(model, steps, path)
        if model.state_hash() != mark:
            raise ExportError("the run did not come out the same a second time; switch Record on, and play")
        return steps

    def _taken(self, model: SwarmModel, steps: int, path: Path | None = None) -> SwarmModel:
        """Take steps, with pauses in which others can work."""
        pause = time.perf_counter() + TURN
        for step in range(1, steps + 1):
            model.step()
            if time.perf_counter() < pause and step < steps:
                continue
            self._check_cancelled()
            if path is not None and path.stat().st_size > MOST_BYTES:
                raise ExportError(f"the run takes more than {MOST_BYTES / 1e6:,.0f} MB; record a part of it")
            self._note("Making the run again", step / steps)
            time.sleep(TURN / 4)
            pause = time.perf_counter() + TURN
        return model

    def _check_table(self, wanted: Wanted, steps: int) -> None:
        """Refuse tables that nobody could open."""
        if not wanted.table:
            return
        model = self.session.model
        things = 0 if model is None else len(model.swarm if wanted.table == "robots" else model.fires)
        rows = steps * things // wanted.every
        if rows > MOST_ROWS:
            raise ExportError(f"the table would have {rows:,} rows; expected at most {MOST_ROWS:,}: take fewer steps")

    def _export(self, arguments: list[str]) -> None:
        """Let a process of its own export, so that the page is not slowed down and one can cancel it."""
        command = [sys.executable, "-c", ending_with_us(COMMAND), "export", *arguments]
        self._note("Making the file", None)
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        said = b""
        stderr = cast(BufferedReader, self._process.stderr)  # which is a pipe
        with self._process as process:
            if self._cancelled.is_set():
                process.terminate()
            while piece := stderr.read1(4096):
                said = (said + piece)[-4096:]
                shares = PERCENT.findall(said.decode(errors="replace"))
                self._note("Making the file", int(shares[-1]) / 100 if shares else None)
        self._process = None
        self._check_cancelled()
        if process.returncode:
            lines = said.decode(errors="replace").strip().splitlines()
            raise ExportError(lines[-1].removeprefix("mesa-swarm: ") if lines else "the file could not be made")

    def _hand_over(self, name: str, content: bytes | Path) -> None:
        if self._deliver is None:
            self._undelivered = name, content
        else:
            self._deliver(name, content)

    def _note(self, doing: str, progress: float | None) -> None:
        if (doing, progress) != (self.doing, self.progress):
            self.doing, self.progress = doing, progress
            self._tell()

    def _check_cancelled(self) -> None:
        if self._cancelled.is_set():
            raise CancelledError


def _nobody() -> None:
    """Be told in vain."""


def _check_straight(session: Session, purpose: str) -> None:
    if not session.straight:
        raise InvalidValueError(
            f"the run was changed on the way, so one cannot {purpose}; switch Record on before changing it"
        )


class Exporter(anywidget.AnyWidget):
    """Lists, a button and a bar in the browser.

    Attributes
    ----------
    kinds : list of [str, str, bool]
        What Python can make: key, label, and whether it is of the whole run.
    told : dict
        How things are.
    """

    _esm = text_of("viewing/elements.js", "dashboard/downloads.js", "dashboard/exporter.js")
    kinds: traitlets.List[list[str | bool]] = traitlets.List().tag(sync=True)
    status = traitlets.Dict().tag(sync=True)


class ExportDesk:
    """Lets an exporter show what a session's `Exporting` does, and start it.

    Parameters
    ----------
    exporter : Exporter
    session : Session
    """

    ready = False  # files are no reason to make a picture

    def __init__(self, exporter: Exporter, session: Session) -> None:
        self.exporter, self.session = exporter, session
        self._downloads = Downloads(exporter)
        self._lock = threading.Lock()
        self._shown = 0.0
        self._doing = ""
        self.exporting = session.companion(Exporting)
        self.exporting.connect(self._downloads.send, self.report)
        self._leave = session.changed.add(self.refresh)
        exporter.on_msg(self._hear)
        self.refresh()
        session.add_viewer(self)

    def refresh(self) -> None:
        """Show how things are; a recording of another model has ended."""
        self.exporting.check_recording()
        model = self.session.model
        burns = model is not None and len(model.fires) > 0
        made = {key: label for key, label in KINDS.items() if burns or "fires" not in key}
        kinds: list[list[str | bool]] = [[key, label, key not in PICTURES] for key, label in made.items()]
        if self.exporter.kinds != kinds:
            self.exporter.kinds = kinds
        self._show()

    def push(self, number: int, picture: PackedFrame) -> None:
        """Show how much was recorded, if it is time."""
        if not self.session.playing or time.monotonic() - self._shown >= EVERY:
            self._show()

    def report(self) -> None:
        """Show what is being made, now and then while that goes on."""
        if self.exporting.doing != self._doing or time.monotonic() - self._shown >= EVERY:
            self._show()

    def act(self, message: dict) -> None:
        """Do what the browser asks for."""
        match message.get("do"):
            case "record":
                self.exporting.record(bool(message.get("value")))
                self._show()
            case "export":
                self.exporting.start(**message["value"])
                self._show()
            case "cancel":
                self.exporting.cancel()
            case _:
                self._downloads.hear(message)

    def close(self) -> None:
        """Part them; what is recorded or made goes on."""
        self._leave()
        self.session.remove_viewer(self)
        self.exporter.on_msg(self._hear, remove=True)
        self.exporting.disconnect()
        self._downloads.close()

    def _hear(self, _: object, message: dict, __: list) -> None:
        self.act(message)

    def _show(self) -> None:
        with self._lock:
            self._shown, self._doing = time.monotonic(), self.exporting.doing
            status = status_of(self.exporting)
            if status != self.exporter.status:
                self.exporter.status = status


def status_of(exporting: Exporting) -> dict[str, Any]:
    """Return how things are, as the browser wants it."""
    session, switch = exporting.session, exporting.switch
    model = session.model
    steps = model.completed if model is not None else 0
    return {
        "name": session.name,
        "steps": steps if session.straight else 0,
        "straight": session.straight,
        "recording": switch.running,
        "recorded": switch.words,
        "ended": switch.ended,
        "doing": exporting.doing,
        "progress": exporting.progress,
        "message": exporting.message,
        "fault": exporting.fault,
    }


@solara.component
def ExportView(session: Session) -> None:
    """Show what can be made of the run."""
    exporter = Exporter.element()
    solara.use_effect(lambda: ExportDesk(solara.get_widget(exporter), session).close, [])
