"""What one user replays, uploads in pieces, and runs that branch off."""

import os
import threading
from bisect import bisect_left
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import Any, cast

from mesa_swarm.dashboard import RECORDINGS_VARIABLE
from mesa_swarm.dashboard.session import LARGEST_SEED, MOST_ROBOTS, Session
from mesa_swarm.dashboard.widgets import Incoming
from mesa_swarm.errors import InvalidValueError, RecordingError, SwarmError, check_choice, check_count, in_words
from mesa_swarm.fire.model import FireModel
from mesa_swarm.gallery import class_name, find_model, model_names
from mesa_swarm.parameters import parameters_of
from mesa_swarm.recording.frames import Event, Frame, events_of
from mesa_swarm.recording.provenance import map_of
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.resume import resumed
from mesa_swarm.recording.verify import Watch
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.packing import packed_frame
from mesa_swarm.viewing.play_loop import Listeners
from mesa_swarm.viewing.player import PackedFrame, Past, Player
from mesa_swarm.viewing.scene import Scene, scene_of_recording
from mesa_swarm.world.map import Map, builtin_maps

ENDING = ".arrow"
LARGEST_UPLOAD = 200_000_000
MOST_LISTED = 500
MOST_EVENTS = 500


# Seconds from one message about what is being done to the next.
SHOWN_EVERY = 0.5


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


class ReplayPlayer(Player):
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
    ...     player = ReplayPlayer(f"{folder}/run.arrow")
    ...     player.step()
    ...     player.past.shown.step
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
        with self.minding():
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
        with self.minding():
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

    def _keep(self, fingerprint: bool = False) -> None:
        """Keep nothing: all is in the file."""

    def _shown(self) -> PackedFrame | None:
        """Return the picture that is looked at, None if it cannot be read, which is then said."""
        with self.minding():
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


class StoppedError(Exception):
    """What is done in the background is no longer waited for."""


class Replaying:
    """A recording that is open, and what one does with it.

    Parameters
    ----------
    session : Session
        Goes on with what branches off.

    Attributes
    ----------
    player : ReplayPlayer or None
        Plays the open recording.
    events : list of Event or None
        None while they are looked for.
    changes : dict
        Parameters that are other after branching.
    fault : str
        Why a recording could not be opened or branched off, empty if nothing is wrong.
    notes : list of str
        What must be said of the open recording.
    changed : Listeners

    Examples
    --------
    >>> replaying = Replaying(Session("boids"))
    >>> replaying.player is None, replaying.fault
    (True, '')
    >>> replaying.close()
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.changed = Listeners()
        self.player: ReplayPlayer | None = None
        self.events: list[Event] | None = []
        self.changes: dict[str, Any] = {}
        self.notes: list[str] = []
        self.fault = self.name = self._going_on = ""
        self._path = Path()
        self._stop = threading.Event()
        # Held while a recording is left, and while what is done for it in the background says something.
        self._saying = threading.Lock()
        # The open recording if it was handed over, and one that is on its way.
        self._own: Incoming | None = None
        self._coming: Incoming | None = None
        place = recordings_place()
        if place is not None and place.is_file():
            self.open_listed(place.name)

    @property
    def listed(self) -> list[str]:
        """The names of recordings on the machine that serves the page, the latest first."""
        place = recordings_place()
        if place is None:
            return []
        found = [place] if place.is_file() else [path for path in place.glob(f"*{ENDING}") if path.is_file()]
        found.sort(key=lambda path: (-path.stat().st_mtime, path.name))
        return [path.name for path in found[:MOST_LISTED]]

    @property
    def busy(self) -> str:
        """What is being done in the background, empty if nothing is."""
        coming = self._coming
        return f"receiving {coming.name:.60} ..." if coming else self._going_on

    @property
    def provenance(self) -> dict[str, Any]:
        """What the open recording says of its run, nothing if none is open."""
        player = self.player  # once: another thread may open another recording
        return player.provenance if player else {}

    @property
    def model_name(self) -> str:
        """The name in the gallery of the recorded model, empty if it is none of these."""
        return _gallery_name(self.provenance)

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters that the recorded run had, by name; only those of a model of the gallery."""
        recorded = self.provenance  # once, as above
        model_name = _gallery_name(recorded)
        if not model_name:
            return {}
        known, given = parameters_of(find_model(model_name)), recorded["parameters"]
        return {name: given.get(name, known[name].default) for name in known if name != "map"}

    def open_listed(self, name: str) -> None:
        """Open one of the recordings that are `listed`."""
        place = recordings_place()
        if place is None or name not in self.listed:
            self._say(f"there is no recording {name!r:.60} any more; choose another one")
        else:
            self._open(place if place.is_file() else place / name, name)

    def begin_upload(self, name: str, size: int) -> bool:
        """Make room for a recording that is handed over in pieces; return whether it may come."""
        if size > LARGEST_UPLOAD:
            self._say(f"{name:.60} has {size:,} bytes; expected at most {LARGEST_UPLOAD:,}")
            return False
        self._drop()
        self._coming = Incoming(name)
        self.changed.tell()
        return True

    def take(self, piece: bytes) -> bool:
        """Take the next piece; return whether more may come."""
        coming = self._coming
        if coming is None:
            return False
        try:
            if coming.take(piece) <= LARGEST_UPLOAD:
                return True
            fault = f"{coming.name:.60} is too large; expected at most {LARGEST_UPLOAD:,} bytes"
        except InvalidValueError as problem:  # the disk is full
            fault = in_words(problem)
        self._drop()
        self._say(fault)
        return False

    def end_upload(self) -> None:
        """Open what was handed over; what is no recording is deleted, and the open one stays."""
        coming, self._coming = self._coming, None
        if coming is not None:
            coming.end()
            if not self._open(coming.path, coming.name, coming):
                coming.discard()

    def set_parameter(self, name: str, value: Any) -> None:
        """Wish for another value of a parameter, from the branching on."""
        try:
            parameter = parameters_of(find_model(self.model_name))[check_choice("parameter", name, self.parameters)]
            value = parameter.checked(parameter.parse(value) if isinstance(value, str) else value)
            self.changes[name] = value
            if value == self.parameters[name]:
                del self.changes[name]
            self.fault = ""
        except Exception as problem:  # what is wrong with a wish is said
            self.fault = in_words(problem)
        self.changed.tell()

    def branch(self) -> None:
        """Have the session go on from the step that is looked at, with the parameters requested for."""
        if self.player is None or self.busy:
            return
        self.player.pause()
        step, changes, path = self.player.step_shown, dict(self.changes), self._path
        stop = self._stop
        if self._say_of(stop, _going_on=f"going on from step {step:,} ...", fault=""):
            threading.Thread(target=self._branch, args=(path, step, changes, stop), name="branch", daemon=True).start()

    def close(self) -> None:
        """Let go of the recording, and of what was handed over."""
        self.changed.clear()
        self._drop()
        self._leave()

    def _branch(self, path: Path, step: int, changes: dict[str, Any], stop: threading.Event) -> None:
        try:
            (settings, seed), name = self._origin(), self.model_name
            model = cast(SwarmModel, resumed(Recording(path), SwarmModel, step, changes, self._watch(step, stop)))
        except StoppedError:
            return
        except Exception as problem:  # whatever a recorded model raises
            self._say_of(stop, _going_on="", fault=in_words(problem).replace(str(path), self.name))
            return
        if self._say_of(stop, _going_on="", fault=""):
            self.session.adopt(model, name, settings | changes, seed)

    def _watch(self, step: int, stop: threading.Event) -> Watch:
        """Return what shows how far running again is, and ends it once the recording was closed."""
        shown = monotonic()

        def watch(model: FireModel) -> None:
            nonlocal shown
            if stop.is_set():
                raise StoppedError
            if monotonic() - shown > SHOWN_EVERY:
                shown = monotonic()
                self._say_of(stop, _going_on=f"going on from step {step:,}: step {model.completed:,} is run again ...")

        return watch

    def _say_of(self, stop: threading.Event, **said: Any) -> bool:
        """Set attributes for the recording of this stop, unless it was left meanwhile; return whether it is open."""
        with self._saying:
            if stop.is_set():
                return False
            for name, value in said.items():
                setattr(self, name, value)
        self.changed.tell()
        return True

    def _origin(self) -> tuple[dict[str, Any], int]:
        """Return parameters and seed from which the recorded model was built."""
        recorded = self.provenance
        if not self.model_name:
            raise RecordingError(
                f"{recorded['model']['name']} is no model of this page; go on in Python with its class's resume"
            )
        settings = self.parameters
        if "n_robots" in settings:
            check_count("n_robots", settings["n_robots"], maximum=MOST_ROBOTS)
        if "map" in parameters_of(find_model(self.model_name)):
            settings["map"] = _chart_of(recorded)
        seed = recorded["seed"]
        if not isinstance(seed, int) or not 0 <= seed <= LARGEST_SEED:
            raise InvalidValueError(f"seed is {seed!r:.60}; expected a whole number, so that the page can reset it")
        return settings, seed

    def _open(self, path: Path, name: str, own: Incoming | None = None) -> bool:
        """Open another recording in place of the open one, which stays if that cannot be; return whether it could."""
        try:
            player = ReplayPlayer(path)
        except Exception as problem:  # whatever is in a user's file
            self._say(in_words(problem).replace(str(path), name))
            return False
        player.set_speed(self.session.own_speed)
        self._leave(player)
        self._path, self.name, self._own = path, name, own
        self.events, self.notes = None, _notes_of(player)
        rows = _Rows(path, len(player.past), self._stop)
        threading.Thread(target=self._find_events, args=(rows,), name="events", daemon=True).start()
        self.changed.tell()
        return True

    def _find_events(self, rows: "_Rows") -> None:
        try:
            found = events_of(rows)
        except StoppedError:
            return
        except Exception as problem:  # whatever is in a user's file
            self._say_of(rows.stop, events=[], fault=in_words(problem).replace(str(self._path), self.name))
        else:
            self._say_of(rows.stop, events=found)

    def _say(self, fault: str) -> None:
        self.fault = fault
        self.changed.tell()

    def _drop(self) -> None:
        """Take no more of what is on its way."""
        coming, self._coming = self._coming, None
        if coming is not None:
            coming.discard()

    def _leave(self, player: ReplayPlayer | None = None) -> None:
        """Let go of the open recording, for another one or none; a file that was handed over is deleted."""
        with self._saying:
            self._stop.set()
            self._stop = threading.Event()
            left, self.player = self.player, player
            self.events, self.changes, self.notes = [], {}, []
            self.name = self.fault = self._going_on = ""
        if left is not None:
            left.close()
        own, self._own = self._own, None
        if own is not None:
            own.discard()


class _Rows:
    """The frames of a recording, which is opened once more: two threads must not read the same one."""

    def __init__(self, path: Path, rows: int, stop: threading.Event) -> None:
        self._recording, self._rows, self.stop = Recording(path), rows, stop

    def __iter__(self) -> Iterator[Frame]:
        for row in range(self._rows):
            if self.stop.is_set():
                raise StoppedError
            yield self._recording[row]


def recordings_place() -> Path | None:
    """Return the recording or the folder of them that the server was told of, None if there is none."""
    told = os.environ.get(RECORDINGS_VARIABLE, "")
    return Path(told) if told else None


def _notes_of(player: ReplayPlayer) -> list[str]:
    recording, last = player.recording, player.past.last_step
    if len(player.past) < len(recording):
        return [f"The recording is damaged after step {last}; what follows is left out."]
    if recording.damage:
        return [f"The recording {recording.damage}."]
    return [] if recording.complete else [f"The recording was not closed; it is whole up to step {last}."]


def _gallery_name(provenance: dict[str, Any]) -> str:
    recorded = provenance.get("model", {"module": "", "name": ""})
    name = recorded["module"].rpartition(".")[2]
    shipped = name in model_names() and (recorded["module"], recorded["name"]) == _place_of(name)
    return name if shipped and _are_permitted(name, provenance["parameters"]) else ""


def _are_permitted(name: str, given: dict[str, Any]) -> bool:
    """Tell whether a model of the gallery takes these parameters: others would stand in the page's controls."""
    known = parameters_of(find_model(name))
    try:
        for one in known.keys() & given.keys():
            known[one].checked(given[one])
    except SwarmError:
        return False
    return True


def _place_of(name: str) -> tuple[str, str]:
    model_class = find_model(name)
    return model_class.__module__, class_name(name)


def _chart_of(provenance: dict[str, Any]) -> Map | str:
    """Return the name of a recorded map if it comes with mesa_swarm, else the map."""
    chart = map_of(provenance)
    if chart.name in builtin_maps() and Map.load(chart.name).to_toml() == chart.to_toml():
        return chart.name
    return chart
