"""A recording played like a model, uploaded in pieces, and continued as a run from any of its steps."""

import os
import threading
from bisect import bisect_left
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import Any, cast

import numpy as np
import pyarrow as pa

from mesa_swarm.base.errors import InvalidValueError, RecordingError, SwarmError, check_choice, check_count, error_line
from mesa_swarm.dashboard import RECORDINGS_VARIABLE, page_models
from mesa_swarm.dashboard.page.edits import MOST_ROBOTS
from mesa_swarm.dashboard.page.navigation import Linkable
from mesa_swarm.dashboard.page.robot_columns import RobotValues, values_of_frame
from mesa_swarm.dashboard.page.series import RecordedSeries, find_collided
from mesa_swarm.dashboard.page.session import LARGEST_SEED, Session, checked_setting
from mesa_swarm.dashboard.page.widgets import Incoming
from mesa_swarm.maps.map import Map, builtin_maps
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.gallery import PACKAGE, find_model, gallery_names
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.recording.frames import Event, Frame, events_of
from mesa_swarm.recording.provenance import is_of, recorded_map
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.resume import resume_watched
from mesa_swarm.recording.verify import Watch
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.frame_bytes import packed_frame
from mesa_swarm.viewing.play_loop import Listeners
from mesa_swarm.viewing.player import PackedFrame, Past, Player, Viewer
from mesa_swarm.viewing.replay_page import damage_notes
from mesa_swarm.viewing.scene import Scene, scene_of_recording
from mesa_swarm.viewing.trails import TRAIL_STEPS, TrailPoint, most_points

MOST_LISTED = 500
# Files of which it is remembered whether they are recordings.
MOST_KNOWN = 20_000
# Recordings begin with an Arrow schema, whose metadata have these names; a larger one is not looked into.
MESSAGE = b"\xff\xff\xff\xff"
METADATA = frozenset({b"format", b"model", b"parameters", b"versions"})
LARGEST_SCHEMA = 64_000_000


def recordings_place() -> Path | None:
    """Return the recording or the folder of recordings of the server, None without one."""
    place = os.environ.get(RECORDINGS_VARIABLE, "")
    return Path(place) if place else None


# Whether a file is a recording, by its path, time of change and size.
_KNOWN: dict[tuple[str, int, int], bool] = {}


def recordings_in(folder: Path) -> list[str]:
    """Return the names of the recordings in a folder, whatever they are called, the latest first."""
    files = []
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with suppress(OSError):  # it may have been deleted meanwhile
                if entry.is_file() and not entry.name.startswith("."):
                    status = entry.stat()
                    files.append((-status.st_mtime_ns, entry.name, status.st_size))
    names: list[str] = []
    for time, name, size in sorted(files):
        key = str(folder / name), time, size
        if key not in _KNOWN:
            if len(_KNOWN) >= MOST_KNOWN:
                _KNOWN.clear()
            _KNOWN[key] = is_recording(folder / name)
        if _KNOWN[key]:
            names.append(name)
            if len(names) == MOST_LISTED:
                break
    return names


def is_recording(path: Path) -> bool:
    """Return whether a file begins as a recording does: with an Arrow schema that has its metadata.

    It may still be damaged, which is found when it is opened.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(8)
            size = int.from_bytes(begin[4:], "little")
            if begin[:4] != MESSAGE or not 0 < size <= LARGEST_SCHEMA:
                return False
            schema = pa.ipc.read_schema(pa.py_buffer(begin + file.read(size)))
    except (OSError, pa.ArrowException, ValueError, MemoryError):
        return False
    return set(schema.metadata or ()) >= METADATA


LARGEST_RECORDING = 200_000_000
MOST_EVENTS = 500
# Shortest time between messages about background work, s.
SHOWN_EVERY = 0.5


class RecordedPast(Past):
    """The rows of a recording; only the displayed one is in memory."""

    def __init__(self, recording: Recording, rows: int) -> None:
        super().__init__()
        self._recording: Recording | None = recording
        self._rows = range(rows)
        self._scene = scene_of_recording(recording)
        self._last: tuple[tuple, PackedFrame] | None = None
        self.has_trails = False  # whether trails are drawn
        self._points: dict[int, tuple[TrailPoint, np.ndarray]] = {}  # of the displayed rows, and their robots
        self.series = RecordedSeries(recording, self._scene, rows)
        self._ends = tuple(recording[row].step if rows else 0 for row in (0, rows - 1))

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def recording(self) -> Recording:
        """The open recording; an error if it was closed."""
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
        """The picture of the displayed row, None if there are no rows."""
        if not self._rows:
            return None
        key = self.index, self.series.collisions_until(self.index), self.has_trails
        if self._last is None or self._last[0] != key:
            frame, trail = self.recording[self.index], self._trail() if self.has_trails else ()
            self._last = key, replace(pack_with_readings(frame, self._scene, key[1]), trail=trail)
        return self._last[1]

    def _trail(self) -> tuple[TrailPoint, ...]:
        """Return where the robots of the displayed row were in the rows before it, as far as they are the same."""
        points, self._points = self._points, {}
        now, robots = self._point(self.index, points)
        most, trail = most_points(len(robots)), [now]
        for row in range(self.index - 1, -1, -1):
            try:
                point, others = self._point(row, points)
            except SwarmError:  # a damaged row, which is reported when it is displayed
                break
            if len(trail) == most or now.step - point.step > TRAIL_STEPS or not np.array_equal(robots, others):
                break
            trail.append(point)
        return tuple(reversed(trail))

    def _point(self, row: int, points: dict[int, tuple[TrailPoint, np.ndarray]]) -> tuple[TrailPoint, np.ndarray]:
        if row not in points:
            frame = self.recording[row]
            points[row] = TrailPoint(frame.step, frame["position"].astype(np.float32)), frame.robots
        self._points[row] = points[row]
        return points[row]

    @property
    def frame(self) -> Frame | None:
        """The displayed row as it was recorded, None if there are no rows."""
        return self.recording[self.index] if self._rows else None

    def robots_shown(self) -> RobotValues:
        """Return the quantities of the robots of the displayed row."""
        frame = self.frame
        if frame is None:
            return RobotValues(0)
        return values_of_frame(frame, self._scene, self.series.collisions_of(frame.robots, self.index))

    @property
    def scene(self) -> Scene:
        """What stands behind the rows."""
        return self._scene

    def step_of(self, row: int) -> int:
        """Return the step of a row."""
        return self.recording[row].step

    def look_at(self, step: int) -> None:
        """Display the first row that is not of an earlier step."""
        self.look(bisect_left(self._rows, step, key=self.step_of))

    def clear(self) -> None:
        """Release the recording."""
        self._recording, self._rows, self._last, self.index, self._points = None, range(0), None, 0, {}


class ReplayPlayer(Player):
    """Plays the rows of a recording as a `Player` plays a model.

    Its speed is in steps of the run, also where not every step was recorded.
    """

    def __init__(self, path: str | Path) -> None:
        recording = Recording(path)
        rows = recording.intact
        if not rows:
            raise RecordingError(f"{recording.path.name} contains no readable step; choose another file")
        super().__init__()
        self.provenance = recording.provenance  # also once the recording is closed
        self.past = self.rows = RecordedPast(recording, rows)
        # By this name charts are chosen, as on the Watch page; both share the choice.
        self.name = _page_name(recording.provenance) or recording.provenance["model"]["name"]
        self.series = self.rows.series
        self.chosen_charts: dict[str, list[str]] = {}
        self._ticks = 0
        self.rest()

    @property
    def recording(self) -> Recording:
        """The recording that is played."""
        return self.rows.recording

    def robots_shown(self) -> RobotValues:
        """Return the quantities of the robots of the displayed row."""
        with self.lock:
            return self.rows.robots_shown()

    @property
    def finished(self) -> bool:
        """Whether the last row is displayed."""
        return self.past.is_present

    @property
    def step_shown(self) -> int:
        """The displayed step."""
        with self.lock:
            return self.rows.step_of(self.rows.index) if len(self.rows) else 0

    def step(self) -> None:
        """Pause, and display the next row."""
        self.look(self.past.index + 1)

    def look(self, index: int) -> None:
        """Pause, and display one of the rows."""
        self.loop.pause()
        with self.lock:
            self._ticks = 0
        super().look(index)

    def look_at(self, step: int) -> None:
        """Pause, and display the first row that is not of an earlier step."""
        self.loop.pause()
        with self.capture_errors():
            self._ticks = 0
            self.rows.look_at(step)
        self.rest()

    def show_numbers(self) -> None:
        """Show what was read of the whole recording meanwhile: numbers above the picture, charts."""
        if not self.playing:
            self._push()
        self.changed.notify()

    def trace(self, viewer: Viewer, on: bool) -> None:
        """Show where robots were before the displayed row, as long as any viewer draws trails."""
        super().trace(viewer, on)
        if self.rows.has_trails != bool(self._tracing):
            self.rows.has_trails = bool(self._tracing)
            self._push()

    def rewind(self) -> None:
        """Pause, clear the error, and display the first row."""
        self.error = ""
        self.look(0)

    def _can_go_on(self) -> bool:
        return not self.error and not self.finished

    def _play_step(self, stop: threading.Event) -> bool:
        with self.capture_errors():
            return not stop.is_set() and self._advance()
        self.rest()  # after an error, which has stopped the thread already
        return False

    def _advance(self) -> bool:
        """Wait for one more step, and display the next row when it is due; return whether there are more."""
        if self.past.is_present:
            return False
        here, following = (self.rows.step_of(row) for row in (self.rows.index, self.rows.index + 1))
        self._ticks += 1
        if self._ticks >= following - here:
            self._ticks = 0
            self.rows.look(self.rows.index + 1)
        return True

    def _store(self, fingerprint: bool = False) -> None:
        """Store nothing: all is in the file."""

    def _shown(self) -> PackedFrame | None:
        """Return the displayed picture, None if it cannot be read, with the reason in `error`."""
        with self.capture_errors():
            return None if self.error else self.past.shown
        return None  # the reason is in `error`


def pack_with_readings(frame: Frame, scene: Scene, total: int | None = None) -> PackedFrame:
    """Return the picture of a recorded frame; `total` is the number of collisions so far, if known."""
    world, readings = scene.world(frame.step), readings_of_frame(frame, total)
    return PackedFrame(frame.step, packed_frame(frame, scene), world, readings, frame.state_hash or "")


def readings_of_frame(frame: Frame, total: int | None = None) -> tuple[tuple[str, str], ...]:
    """Return the numbers above the picture, each with its name as on the Watch page; only recorded ones."""
    robots, colliding = f"{len(frame.robots):,}", find_collided(frame)
    if len(frame.columns.get("fires", ())):
        fires = frame["fires"]
        burning = ("Fires burning", f"{int((~fires['out']).sum())} of {len(fires)}")
        readings = [burning, ("Robots at fires", f"{int(np.maximum(fires['robots'], 0).sum())} of {robots}")]
    else:
        readings = [("Robots", robots)]
    if colliding is not None:
        readings.append(("Collisions", f"{len(colliding):,} now" + ("" if total is None else f", {total:,} in all")))
    return tuple(readings)


class StoppedError(Exception):
    """The background work is no longer needed."""


class Replaying(Linkable):
    """The open recording, its upload, its events, and runs branched off it."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.changed = self.linked = Listeners()
        self.player: ReplayPlayer | None = None
        self.events: list[Event] | None = []  # None during the search
        self.changes: dict[str, Any] = {}  # parameters that differ after branching
        self.notes: list[str] = []
        self.fault = self.name = self._activity = ""
        self._path = Path()
        self._stop = threading.Event()
        # Held while a recording is closed, and while background work changes attributes.
        self._changing = threading.Lock()
        # The open recording if it was uploaded, and an upload in progress.
        self._upload: Incoming | None = None
        self._coming: Incoming | None = None
        place = recordings_place()
        if place is not None and place.is_file():
            self.open_listed(place.name)

    @property
    def listed(self) -> list[str]:
        """The names of recordings on the server, the latest first."""
        place = recordings_place()
        if place is None:
            return []
        return [place.name] if place.is_file() else recordings_in(place)

    @property
    def busy(self) -> str:
        """The present background work, empty without any."""
        coming = self._coming
        return f"receiving {coming.name:.60} ..." if coming else self._activity

    @property
    def provenance(self) -> dict[str, Any]:
        """Provenance of the open recording, empty if none is open."""
        player = self.player  # once: another thread may open another recording
        return player.provenance if player else {}

    @property
    def model_shown(self) -> str:
        """The name of the recorded model on the page, empty for other models."""
        return _page_name(self.provenance)

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters of the recorded run by name; empty for models that are not on the page."""
        facts = self.provenance  # once, as above
        model_name = _page_name(facts)
        if not model_name:
            return {}
        parameters, settings = parameters_of(find_model(model_name)), facts["parameters"]
        return {name: settings.get(name, parameters[name].default) for name in parameters if name != "map"}

    def open_listed(self, name: str) -> None:
        """Open one of the recordings that are `listed`."""
        place = recordings_place()
        if place is None or name not in self.listed:
            self._fail(f"recording {name!r:.60} not found; choose another one")
        else:
            self._open(place if place.is_file() else place / name, name)

    def begin_upload(self, name: str, size: int) -> bool:
        """Begin the upload of a recording in pieces; return whether it is accepted."""
        if size > LARGEST_RECORDING:
            self._fail(f"{name:.60} has {size:,} bytes; expected at most {LARGEST_RECORDING:,}")
            return False
        self._drop()
        self._coming = Incoming(name)
        self.changed.notify()
        return True

    def take(self, piece: bytes) -> bool:
        """Take the next piece; return whether more are accepted."""
        coming = self._coming
        if coming is None:
            return False
        try:
            if coming.take(piece) <= LARGEST_RECORDING:
                return True
            fault = f"{coming.name:.60} is too large; expected at most {LARGEST_RECORDING:,} bytes"
        except InvalidValueError as problem:  # the disk is full
            fault = error_line(problem)
        self._drop()
        self._fail(fault)
        return False

    def end_upload(self) -> None:
        """Open the uploaded file; if it is not a recording, it is deleted, and the open one stays."""
        coming, self._coming = self._coming, None
        if coming is not None:
            coming.end()
            if not self._open(coming.path, coming.name, coming):
                coming.discard()

    def set_parameter(self, name: str, value: Any) -> None:
        """Request another value of a parameter after branching."""
        try:
            parameter = parameters_of(find_model(self.model_shown))[check_choice("parameter", name, self.parameters)]
            self.changes[name] = value = checked_setting(parameter, value)
            if value == self.parameters[name]:
                del self.changes[name]
            self.fault = ""
        except Exception as problem:  # shown beside the control
            self.fault = reported(problem)
        self.changed.notify()

    def branch(self) -> None:
        """Continue in the session from the displayed step, with the requested parameters."""
        if self.player is None or self.busy:
            return
        self.player.pause()
        step, changes, path = self.player.step_shown, dict(self.changes), self._path
        stop = self._stop
        if self._update(stop, _activity=f"continuing from step {step:,} ...", fault=""):
            threading.Thread(target=self._branch, args=(path, step, changes, stop), name="branch", daemon=True).start()

    def words(self) -> dict[str, str]:
        """Return the open recording, unless it was uploaded, and the displayed step, as words of a link."""
        if self.player is None or self.name not in self.listed:
            return {}
        return {"recording": self.name, "step": str(self.player.step_shown)}

    def show_words(self, words: dict[str, str]) -> list[str]:
        """Show the recording and the step of a link; return why some were ignored."""
        if "recording" in words and words["recording"] != self.name:
            self.open_listed(words["recording"])
        if self.player is not None and words.get("step", "").isdecimal():
            self.player.look_at(int(words["step"]))
        return [self.fault] if self.fault else []

    def go_on_to(self, step: int, *, plays: bool, speed: float | None) -> None:
        """Go on after a reload with the recording that is open again."""
        if self.player is None:
            return
        if speed is not None:
            self.player.set_speed(speed)
        self.player.look_at(step)
        if plays:
            self.player.play()

    def close(self) -> None:
        """Release the recording, and delete uploads."""
        self.changed.clear()
        self._drop()
        self._leave()

    def _branch(self, path: Path, step: int, changes: dict[str, Any], stop: threading.Event) -> None:
        try:
            (settings, seed), name = self._origin(), self.model_shown
            watch = self._watch(step, stop)
            model = cast(SwarmModel, resume_watched(Recording(path), find_model(name), step, changes, watch))
        except StoppedError:
            return
        except Exception as problem:  # a recorded model may raise anything
            self._update(stop, _activity="", fault=reported(problem).replace(str(path), self.name))
            return
        if self._update(stop, _activity="", fault=""):
            self.session.adopt(model, name, settings | changes, seed)

    def _watch(self, step: int, stop: threading.Event) -> Watch:
        """Return a function that shows the progress of repeating steps, and ends it once the recording is closed."""
        last_time = monotonic()

        def watch(model: EngineModel) -> None:
            nonlocal last_time
            if stop.is_set():
                raise StoppedError
            if monotonic() - last_time > SHOWN_EVERY:
                last_time = monotonic()
                self._update(stop, _activity=f"continuing from step {step:,}: repeating step {model.completed:,} ...")

        return watch

    def _update(self, stop: threading.Event, **values: Any) -> bool:
        """Set attributes unless the recording of this stop was closed; return whether it is open."""
        with self._changing:
            if stop.is_set():
                return False
            for name, value in values.items():
                setattr(self, name, value)
        self.changed.notify()
        return True

    def _origin(self) -> tuple[dict[str, Any], int]:
        """Return the parameters and the seed of the recorded model."""
        facts = self.provenance
        if not self.model_shown:
            raise RecordingError(
                f"{facts['model']['name']} is not a model of this page; in Python use `resume` of its class"
            )
        settings = self.parameters
        if "n_robots" in settings:
            check_count("n_robots", settings["n_robots"], maximum=MOST_ROBOTS)
        if "map" in parameters_of(find_model(self.model_shown)):
            settings["map"] = _chart_of(facts)
        seed = facts["seed"]
        if not isinstance(seed, int) or not 0 <= seed <= LARGEST_SEED:
            raise InvalidValueError(f"seed is {seed!r:.60}; expected a whole number of at least 0")
        return settings, seed

    def _open(self, path: Path, name: str, upload: Incoming | None = None) -> bool:
        """Open another recording in place of the open one, which stays if that fails; return whether it opened."""
        try:
            player = ReplayPlayer(path)
        except Exception as problem:  # a user's file may contain anything
            self._fail(error_line(problem).replace(str(path), name))
            return False
        player.set_speed(self.session.own_speed)
        player.chosen_charts = self.session.chosen_charts
        self._leave(player)
        self._path, self.name, self._upload = path, name, upload
        self.events, self.notes = None, list(damage_notes(player.recording))
        rows = _Rows(path, len(player.past), self._stop)
        threading.Thread(target=self._search, args=(rows, player), name="events", daemon=True).start()
        self.changed.notify()
        return True

    def _search(self, rows: "_Rows", player: ReplayPlayer) -> None:
        """Read the numbers of charts, which are shown while they are read, then the events."""
        try:
            player.series.read(rows.recording, rows, player.show_numbers)
            events = events_of(rows)
        except StoppedError:
            return
        except Exception as problem:  # a user's file may contain anything
            self._update(rows.stop, events=[], fault=error_line(problem).replace(str(self._path), self.name))
        else:
            self._update(rows.stop, events=events)

    def _fail(self, fault: str) -> None:
        self.fault = fault
        self.changed.notify()

    def _drop(self) -> None:
        """Cancel the upload in progress."""
        coming, self._coming = self._coming, None
        if coming is not None:
            coming.discard()

    def _leave(self, player: ReplayPlayer | None = None) -> None:
        """Close the open recording, for another one or none; an uploaded file is deleted."""
        with self._changing:
            self._stop.set()
            self._stop = threading.Event()
            old_player, self.player = self.player, player
            self.events, self.changes, self.notes = [], {}, []
            self.name = self.fault = self._activity = ""
        if old_player is not None:
            old_player.close()
        upload, self._upload = self._upload, None
        if upload is not None:
            upload.discard()


class _Rows:
    """The frames of a recording, opened again: two threads must not read the same one."""

    def __init__(self, path: Path, rows: int, stop: threading.Event) -> None:
        self.recording, self._rows, self.stop = Recording(path), rows, stop

    def __iter__(self) -> Iterator[Frame]:
        for row in range(self._rows):
            if self.stop.is_set():
                raise StoppedError
            yield self.recording[row]


def _page_name(provenance: dict[str, Any]) -> str:
    """Return the name of the recorded model on the page, empty for others: a recording makes it import none."""
    if not provenance:
        return ""
    model = provenance["model"]
    shipped = {f"{PACKAGE}.{name}": name for name in gallery_names()}
    page_names = () if model["module"] in shipped else [name for name in page_models() if name not in gallery_names()]
    for name in (*page_names, shipped.get(model["module"])):
        if name and is_of(provenance, find_model(name)) and _are_permitted(name, provenance["parameters"]):
            return name
    return ""


def _are_permitted(name: str, settings: dict[str, Any]) -> bool:
    """Return whether a model of the page permits these parameters."""
    parameters = parameters_of(find_model(name))
    try:
        for key in parameters.keys() & settings.keys():
            parameters[key].checked(settings[key])
    except SwarmError:
        return False
    return True


def _chart_of(provenance: dict[str, Any]) -> Map | str:
    """Return the name of a recorded map if it is a built-in one, else the map."""
    chart = recorded_map(provenance)
    if chart.name in builtin_maps() and Map.load(chart.name).to_toml() == chart.to_toml():
        return chart.name
    return chart
