"""Export from the page: files of a run made in the background, and the switch that records it."""

import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import anywidget
import traitlets

from mesa_swarm.base.errors import ExportError, InvalidValueError, RecordingError, SwarmError, check_choice, check_count
from mesa_swarm.dashboard.page.edits import Repetition
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import Link, view_script
from mesa_swarm.experiments.worker_pool import ending_with_us
from mesa_swarm.model.gallery import short_name
from mesa_swarm.model.observers import Observer
from mesa_swarm.recording.recorder import Recorder, record
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.pictures import Shown, frame_and_scene, png, svg, world_figure
from mesa_swarm.viewing.play_loop import Listeners
from mesa_swarm.viewing.player import PackedFrame

# Largest size of a recording, bytes.
MOST_BYTES = 300_000_000
# Steps between checks of the file's size.
LOOK_EVERY = 50
LIVE = "live"
# Kinds of files with their labels; those with a dot are tables.
KINDS = {
    "png": "Picture (PNG)",
    "svg": "Picture (SVG)",
    "gif": "Animation (GIF)",
    "mp4": "Film (MP4)",
    "html": "Page that replays it (HTML)",
    LIVE: "Page that runs the model (HTML)",
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
# A repeated run lets other threads work after this time, s.
TURN = 0.02
PERCENT = re.compile(r"(\d+) %")
# The bar of the command is read from a pipe.
COMMAND = (
    "import sys; import mesa_swarm.base.work_line as work_done; work_done.always_drawn = True; "
    "from mesa_swarm.cli import main; sys.exit(main())"
)
# Shortest time between updates of the progress and the recorded steps, s.
EVERY = 0.25


class RecordingSwitch(Observer):
    """Records a model from the next step on, one recording at a time, until its file is larger than a limit."""

    def __init__(self, folder: Path, most_bytes: int = MOST_BYTES) -> None:
        self.path = folder / "recorded.arrow"
        self.most_bytes = most_bytes
        # The recorded steps; there are none if the last is below the first.
        self.first, self.last = self._before = 1, 0
        # Why recording stopped before it was switched off.
        self.ended = ""
        self.model: SwarmModel | None = None
        self._recorder: Recorder | None = None

    @property
    def running(self) -> bool:
        """Whether steps are recorded."""
        return self._recorder is not None and not self._recorder.closed

    @property
    def words(self) -> str:
        """Which steps were recorded, in words; empty if none was."""
        return f"steps {self.first:,} to {self.last:,}" if self.last >= self.first else ""

    def start(self, model: SwarmModel) -> None:
        """Record a model from its next step on; the first rows replace the recording before."""
        self.stop()
        self._recorder = record(model, self.path, overwrite=True)
        self.model, self.ended = model, ""
        self._before = self.first, self.last
        self.first, self.last = model.completed + 1, model.completed
        model.observers.append(self)

    def after_step(self, model: SwarmModel, step: int) -> None:
        """Note a step; called by the model before its class has finished the step."""
        if self.running:
            self.last = step

    def replaced(self, old: SwarmModel, new: SwarmModel, what: list[str]) -> None:
        """Continue with the model that has taken the place of another."""
        self.model = new

    def between_steps(self, model: SwarmModel) -> None:
        """End the recording at an error or its limit; called by the model after a complete step."""
        recorder = self._recorder
        if recorder is None:
            return
        if recorder.closed:
            self._note_what_is_left(recorder.written.rows)
            self._end("the recording could not be continued")
        elif model.completed % LOOK_EVERY == 0 and recorder.written.end > self.most_bytes:
            self._end(f"the recording has {self.most_bytes / 1e6:,.0f} MB, which is the limit")

    def stop(self) -> None:
        """Stop recording; the recorded steps stay."""
        recorder, model = self._recorder, self.model
        self._recorder = self.model = None
        if model is not None and self in model.observers:
            model.observers.remove(self)
        if recorder is None:
            return
        has_failed = recorder.closed  # at an error
        try:
            recorder.close()
        except RecordingError:
            has_failed = True
            raise
        finally:
            if has_failed:
                self._note_what_is_left(recorder.written.rows)

    def close(self) -> None:
        """Stop; called when a run is interrupted."""
        self.stop()

    def copy(self, path: Path) -> None:
        """Copy the recording so far."""
        if self._recorder is not None and not self._recorder.closed:
            self._recorder.flush()
        shutil.copyfile(self.path, path)

    def _note_what_is_left(self, rows: int) -> None:
        """Note the steps in the file after a failure: without new rows those from before."""
        self.first, self.last = (self.first, self.first + rows - 1) if rows else self._before

    def _end(self, why: str) -> None:
        self.stop()
        self.ended = f"{why}; it ended at step {self.last:,}"


class CancelledError(SwarmError):
    """The user has cancelled the export."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ExportRequest:
    """A requested file; every value is checked."""

    kind: str
    # "run": the run so far, repeated; "recording": the recorded steps.
    source: str = "run"
    # Steps from one row of a table to the next.
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
        """The ending of the file's name."""
        return "html" if self.kind == LIVE else self.kind.rsplit(".", maxsplit=1)[-1]

    @property
    def table(self) -> str:
        """Which table it is, empty for other files."""
        return self.kind.split(".")[0] if "." in self.kind else ""

    def options(self) -> list[str]:
        """Return the options of the command `export`."""
        if self.table:
            return ["--table", self.table, *(["--every", str(self.every)] if self.every > 1 else [])]
        if self.kind in ("gif", "mp4"):
            return ["--sectors"] * self.sectors + ["--trails", "60"] * self.trails
        return []


class Exporting:
    """Exports a session's run in the background, one file at a time."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.changed = Listeners()
        # Name and content of a file that was made, until the page takes it.
        self._ready: list[tuple[str, bytes | Path]] = []
        self._folder = TemporaryDirectory(prefix="mesa_swarm_")
        self.folder = Path(self._folder.name)
        self.switch = RecordingSwitch(self.folder)
        self.doing, self.message, self.fault = "", "", ""
        self.progress: float | None = None  # the completed share, None if unknown
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen | None = None
        self._cancelled = threading.Event()

    def take_files(self) -> list[tuple[str, bytes | Path]]:
        """Return the name and the content of the file that was made, if it was not taken yet, in a list."""
        files, self._ready = self._ready, []
        return files

    def record(self, on: bool) -> None:
        """Switch recording of the present run on or off."""
        session = self.session
        with session.lock:
            try:
                self.fault = ""
                if not on:
                    self.switch.stop()
                elif session.model is not None:
                    self.switch.start(session.model)
            except (SwarmError, OSError) as problem:
                self.fault = reported(problem)
        self.changed.notify()

    def check_recording(self) -> None:
        """End the recording if the session has another model."""
        with self.session.lock:
            if self.switch.running and self.switch.model is not self.session.model:
                self.switch.stop()

    def start(self, **options: Any) -> None:
        """Begin to make a file, unless one is being made."""
        # Not whether the thread is alive: it still notifies of a file that is ready, when the button is enabled again.
        if self.doing:
            self.fault = "an export is in progress; wait for it, or cancel it"
        else:
            self._cancelled.clear()
            self.doing, self.progress, self.message, self.fault = "Starting", None, "", ""
            self._thread = threading.Thread(target=self._work, args=(options,), name="export", daemon=True)
            self._thread.start()
        self.changed.notify()

    def cancel(self) -> None:
        """Cancel the export."""
        self._cancelled.set()
        process = self._process
        if process is not None:
            process.terminate()

    def close(self) -> None:
        """Cancel, stop recording and delete all files."""
        self.cancel()
        self.changed.clear()
        with self.session.lock:
            self.switch.stop()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(5)
        self._folder.cleanup()

    def _work(self, options: dict[str, Any]) -> None:
        try:
            name = self._make(ExportRequest(**options))
        except CancelledError:
            self.message = "Cancelled."
        except Exception as problem:  # shown beside the button
            self.fault = "" if self._cancelled.is_set() else reported(problem)
            self.message = "Cancelled." if self._cancelled.is_set() else ""
        else:
            self.message = f"{name} is ready."
        self.doing, self.progress = "", None
        self.changed.notify()

    def _make(self, request: ExportRequest) -> str:
        """Make a file, which is then ready, and return its name."""
        session = self.session
        self._ready = []
        for old in self.folder.glob("made*"):
            old.unlink()
        if request.kind in PICTURES:
            step, scene = self._choose_scene()
            figure = world_figure({f"{short_name(session.name)}, step {step:,}": scene}, request.sectors)
            name = f"{short_name(session.name)}_{step}.{request.kind}"
            self._hand_over(name, png(figure) if request.kind == "png" else svg(figure))
            return name
        if request.kind == LIVE:
            name = f"{short_name(session.name)}.html"
            self._hand_over(name, self._make_live_page())
            return name
        source = self.folder / "made.arrow"
        rows = self._from_recording(source) if request.source == "recording" else self._repeat_run(source)
        result = source if request.kind == "arrow" else self.folder / f"made.{request.ending}"
        if result is not source:
            self._check_table(request, rows)
            self._export([str(source), str(result), *request.options()])
        self._check_cancelled()
        if (size := result.stat().st_size) > LARGEST_DOWNLOAD:
            raise ExportError(f"the file has {size / 1e6:,.0f} MB; expected at most 500 MB: record less")
        name = f"{short_name(session.name)}{f'_{request.table}' if request.table else ''}.{request.ending}"
        self._hand_over(name, result)
        return name

    def _make_live_page(self) -> Path:
        """Make a page on which the model runs from the beginning, with the parameters of this run."""
        session = self.session
        with session.lock:
            if session.model is None:
                raise ExportError("no model to export; press Reset first")
            again = session.repetition()
        self._note("Making the page", None)
        path = again.model.export(self.folder / "made.html", live=True, overwrite=True)
        self._check_cancelled()
        return path

    def _choose_scene(self) -> tuple[int, Shown]:
        """Return the displayed step, and what to draw of it."""
        session = self.session
        with session.lock:
            if session.model is None or session.past.shown is None:
                raise ExportError("no model to draw; press Reset first")
            step = session.past.shown.step
            if session.past.is_present:
                return session.model.completed, frame_and_scene(session.model)
            _check_straight(session, "draw an earlier step")
        return step, self._take_steps(session.repetition(), step)

    def _from_recording(self, path: Path) -> int:
        """Copy the recording; return its number of steps."""
        with self.session.lock:
            if not self.switch.words:
                raise ExportError("no steps are recorded; press Record, then Play")
            self.switch.copy(path)
            return self.switch.last - self.switch.first + 1

    def _repeat_run(self, path: Path) -> int:
        """Repeat the run so far while it is recorded; return its number of steps."""
        session = self.session
        with session.lock:
            if session.model is None or not session.model.completed:
                raise ExportError("the run has no steps yet; press Play before exporting")
            _check_straight(session, "repeat it")
            steps, mark = session.model.completed, session.model.state_hash()
            again = session.repetition()
        with record(again.model, path, overwrite=True):
            model = self._take_steps(again, steps, path)
        if model.state_hash() != mark:
            raise ExportError("repeating the run gave another result; press Record, then Play")
        return steps

    def _take_steps(self, again: Repetition, steps: int, path: Path | None = None) -> SwarmModel:
        """Take steps, with pauses in which other threads can work."""
        pause = time.perf_counter() + TURN
        for step in range(1, steps + 1):
            again.step()
            if time.perf_counter() < pause and step < steps:
                continue
            self._check_cancelled()
            if path is not None and path.stat().st_size > MOST_BYTES:
                raise ExportError(f"the run needs more than {MOST_BYTES / 1e6:,.0f} MB; record a part of it")
            self._note("Repeating the run", step / steps)
            time.sleep(TURN / 4)
            pause = time.perf_counter() + TURN
        again.finish()
        return again.model

    def _check_table(self, request: ExportRequest, steps: int) -> None:
        """Refuse tables too large to open."""
        if not request.table:
            return
        model = self.session.model
        things = 0 if model is None else len(model.swarm if request.table == "robots" else model.fires)
        rows = steps * things // request.every
        if rows > MOST_ROWS:
            raise ExportError(f"the table would have {rows:,} rows; expected at most {MOST_ROWS:,}: take fewer steps")

    def _export(self, arguments: list[str]) -> None:
        """Export in another process, which does not slow down the page and can be cancelled."""
        command = [sys.executable, "-c", ending_with_us(COMMAND), "export", *arguments]
        self._note("Making the file", None)
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        output = b""
        stderr = cast(BufferedReader, self._process.stderr)  # a pipe
        with self._process as process:
            if self._cancelled.is_set():
                process.terminate()
            while piece := stderr.read1(4096):
                output = (output + piece)[-4096:]
                shares = PERCENT.findall(output.decode(errors="replace"))
                self._note("Making the file", int(shares[-1]) / 100 if shares else None)
        self._process = None
        self._check_cancelled()
        if process.returncode:
            lines = output.decode(errors="replace").strip().splitlines()
            raise ExportError(lines[-1].removeprefix("mesa-swarm: ") if lines else "the file could not be made")

    def _hand_over(self, name: str, content: bytes | Path) -> None:
        """Offer a file to the page, which takes it at once if it shows the run."""
        self._ready = [(name, content)]
        self.changed.notify()

    def _note(self, doing: str, progress: float | None) -> None:
        if (doing, progress) != (self.doing, self.progress):
            self.doing, self.progress = doing, progress
            self.changed.notify()

    def _check_cancelled(self) -> None:
        if self._cancelled.is_set():
            raise CancelledError


def _check_straight(session: Session, purpose: str) -> None:
    if not session.straight:
        raise InvalidValueError(
            f"the run was changed while running, so the page cannot {purpose}; press Record before a change"
        )


class Exporter(anywidget.AnyWidget):
    """The export panel in the browser."""

    _esm = view_script("dashboard/run/exporter.js")
    # Key, label, and whether the file contains many steps.
    kinds: traitlets.List[list[str | bool]] = traitlets.List().tag(sync=True)
    status = traitlets.Dict().tag(sync=True)


class ExportDesk(Link):
    """Connects an exporter and a session's `Exporting`; recording and export continue after `close`."""

    def __init__(self, exporter: Exporter, session: Session) -> None:
        self.exporter, self.session = exporter, session
        self._lock = threading.Lock()
        self._shown_at = 0.0
        self._doing = ""
        self.exporting = session.companion(Exporting)
        self.connect(exporter, session.changed.add(self.refresh), self.exporting.changed.add(self.report))
        self.refresh()
        self.report()
        self.watch(session)

    def refresh(self) -> None:
        """Show the status; end a recording of another model."""
        self.exporting.check_recording()
        model = self.session.model
        burns = model is not None and len(model.fires) > 0
        kinds_made = {key: label for key, label in KINDS.items() if burns or "fires" not in key}
        kinds: list[list[str | bool]] = [
            [key, label, key not in (*PICTURES, LIVE)] for key, label in kinds_made.items()
        ]
        self.exporter.kinds = kinds
        self._show()

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show the recorded steps, if an update is due."""
        if not self.session.playing or time.monotonic() - self._shown_at >= EVERY:
            self._show()

    def report(self) -> None:
        """Send the file that is ready; show the progress, if an update is due."""
        for name, content in self.exporting.take_files():
            self.downloads.send(name, content)
        if self.exporting.doing != self._doing or time.monotonic() - self._shown_at >= EVERY:
            self._show()

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        match message.get("do"):
            case "record":
                self.exporting.record(bool(message.get("value")))
                self._show()
            case "export":
                self.exporting.start(**message["value"])
                self._show()
            case "cancel":
                self.exporting.cancel()

    def _show(self) -> None:
        with self._lock:
            self._shown_at, self._doing = time.monotonic(), self.exporting.doing
            self.exporter.status = status_of(self.exporting)


def status_of(exporting: Exporting) -> dict[str, Any]:
    """Return the status for the browser."""
    session, switch = exporting.session, exporting.switch
    model = session.model
    steps = model.completed if model is not None else 0
    return {
        "name": short_name(session.name),
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
