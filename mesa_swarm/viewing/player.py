"""A model that is played: its frames, its past, and its viewers."""

import threading
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.recording.layout import pictures_of, shown_of
from mesa_swarm.recording.provenance import drawn_heat, drawn_parts
from mesa_swarm.recording.recorder import Recorder
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_frame
from mesa_swarm.viewing.play_loop import Listeners, PlayLoop
from mesa_swarm.viewing.scene import Scene, scene_of
from mesa_swarm.viewing.trails import TrailKeeper, TrailPoint, news

MOST_BYTES = 48_000_000
# Memory of a packed frame besides its content: itself, its readings, its fingerprint.
FRAME_BYTES = 1000
# Memory of a world per character of its text.
WORLD_BYTES = 4
# Played faster than this, steps/s, only frames that were shown are stored for stepping back.
FASTEST_STORED = 100.0
# Rows of collected values that remain at every multiple of this many steps; in between there are up to twice as many.
MOST_COLLECTED = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class PackedFrame:
    """A frame on its way to browsers: its bytes, the world that they are drawn in, numbers and trails beside it."""

    step: int
    content: bytes
    world: dict = field(default_factory=dict, repr=False)
    readings: tuple[tuple[str, str], ...] = ()
    fingerprint: str = ""
    # Where its robots were in the steps up to it, oldest first; frames share the points.
    trail: tuple[TrailPoint, ...] = field(default=(), repr=False)


class Past(ABC):
    """Packed frames in the order of time, one of which is shown."""

    def __init__(self) -> None:
        self.index = 0  # of the frame that is shown

    @abstractmethod
    def __len__(self) -> int:
        """How many there are."""

    @property
    @abstractmethod
    def shown(self) -> PackedFrame | None:
        """The frame that is shown, None if there are none."""

    @property
    @abstractmethod
    def first_step(self) -> int:
        """The step of the earliest frame, 0 without frames."""

    @property
    @abstractmethod
    def last_step(self) -> int:
        """The step of the latest frame, 0 without frames."""

    @abstractmethod
    def clear(self) -> None:
        """Drop all frames."""

    @property
    def is_present(self) -> bool:
        """Whether the latest frame is shown."""
        return self.index >= len(self) - 1

    def look(self, index: int) -> None:
        """Show the frame with this index, or the nearest one."""
        self.index = min(max(index, 0), max(len(self) - 1, 0))


class RecentPast(Past):
    """The last frames of a run, in memory: the oldest are dropped at a limit, the last two always remain."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        super().__init__()
        self.most_bytes = most_bytes
        self._frames: deque[PackedFrame] = deque()
        self._sizes: deque[int] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def shown(self) -> PackedFrame | None:
        """The frame that is shown, None before the first."""
        return self._frames[self.index] if self._frames else None

    @property
    def first_step(self) -> int:
        """The step of the earliest frame, 0 without frames."""
        return self._frames[0].step if self._frames else 0

    @property
    def last_step(self) -> int:
        """The step of the latest frame, 0 without frames."""
        return self._frames[-1].step if self._frames else 0

    def append(self, frame: PackedFrame) -> None:
        """Add a frame and show it; it replaces one of the same step."""
        if self._frames and self._frames[-1].step == frame.step:
            self._frames.pop()
            self._bytes -= self._sizes.pop()
        size = FRAME_BYTES + len(frame.content) + self._size_of_world(frame) + self._size_of_trail(frame)
        self._frames.append(frame)
        self._sizes.append(size)
        self._bytes += size
        while self._bytes > self.most_bytes and len(self._frames) > 2:
            self._frames.popleft()
            self._bytes -= self._sizes.popleft()
        self.index = len(self._frames) - 1

    def _size_of_world(self, frame: PackedFrame) -> int:
        """Return about how much memory the world of a frame takes, 0 if it is that of the frame before."""
        if self._frames and self._frames[-1].world is frame.world:
            return 0
        return WORLD_BYTES * len(repr(frame.world))

    def _size_of_trail(self, frame: PackedFrame) -> int:
        """Return how much memory the points take that the frame before does not have."""
        before = self._frames[-1].trail[-1] if self._frames and self._frames[-1].trail else None
        return sum(point.places.nbytes for point in news(frame.trail, before)[0])

    def cut(self, step: int) -> None:
        """Drop the frames of this step and of later ones."""
        while self._frames and self._frames[-1].step >= step:
            self._frames.pop()
            self._bytes -= self._sizes.pop()
        self.look(self.index)

    def look_at(self, step: int) -> None:
        """Show the latest frame that is not of a later step, or the first."""
        self.look(bisect_right(self._frames, step, key=lambda frame: frame.step) - 1)

    def step_after(self) -> int:
        """Return the step of the frame after the one that is shown, or of the last."""
        return self._frames[min(self.index + 1, len(self) - 1)].step

    def clear(self) -> None:
        """Drop all frames."""
        self._frames.clear()
        self._sizes.clear()
        self._bytes = self.index = 0


class Viewer(Protocol):
    """Receives frames to show."""

    @property
    def ready(self) -> bool:
        """Whether it has shown the last frame that it received."""

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show a frame as soon as possible, unless one of a higher number was received."""


class Played(ABC):
    """Base class of players: plays in a thread, steps forth and back."""

    error: str
    past: Past

    def __init__(self) -> None:
        self.loop = PlayLoop(self._play_step, self.show, self.rest)
        # Held while a model changes; hold it to look at a model that may be played.
        self.lock = threading.RLock()
        # Notified when anything but the frame changes: playing or not, an error, another model.
        self.changed = Listeners()
        self.viewers: tuple[Viewer, ...] = ()
        self._number = 0

    @property
    def waiting(self) -> frozenset[str]:
        """Settings that have an effect only after a reset; none by default."""
        return frozenset()

    @property
    def playing(self) -> bool:
        """Whether it is played."""
        return self.loop.playing

    def add_viewer(self, viewer: Viewer, *, first: bool = False) -> None:
        """Send frames to a viewer from now on, after the others or, if it shows them quickly, before them."""
        self.viewers = (viewer, *self.viewers) if first else (*self.viewers, viewer)
        self.show()

    def remove_viewer(self, viewer: Viewer) -> None:
        """Send no more frames to a viewer."""
        self.viewers = tuple(other for other in self.viewers if other is not viewer)

    def set_speed(self, speed: float) -> None:
        """Set the speed, steps/s."""
        self.loop.speed = speed
        self.changed.notify()

    def play(self) -> None:
        """Step in a thread until paused, finished or broken."""
        if self._can_go_on():
            self.loop.play()
            self.changed.notify()

    def pause(self) -> None:
        """Take no further step, and show the present."""
        self.loop.pause()
        self.rest()

    def toggle(self) -> None:
        """Play if it is at rest, pause if it plays."""
        if self.playing:
            self.pause()
        else:
            self.play()

    def back(self) -> None:
        """Pause, and show the frame before."""
        self.look(self.past.index - 1)

    def show(self) -> None:
        """Show the present; while it plays, only if a viewer is ready."""
        playing = self.playing
        if not playing or any(viewer.ready for viewer in self._watching()):
            self.hand_over()
        if playing and not self.playing:  # packing the frame failed
            self.changed.notify()

    def rest(self) -> None:
        """Show the present at rest, with a fingerprint of the state, and notify listeners."""
        self.hand_over(fingerprint=not self.playing)
        self.changed.notify()

    def _watching(self) -> tuple[Viewer, ...]:
        """Return the viewers for which a frame would be packed."""
        return self.viewers

    def _push(self) -> None:
        """Send viewers the frame that is shown."""
        with self.lock:
            self._number += 1
            number, frame = self._number, self._shown()
        if frame is not None:
            for viewer in self.viewers:
                viewer.push(number, frame)

    @property
    @abstractmethod
    def finished(self) -> bool:
        """Whether there is nothing more to play."""

    @abstractmethod
    def step(self) -> None:
        """Pause, and go on by one step."""

    @abstractmethod
    def look(self, index: int) -> None:
        """Pause, and show the frame with this index in `past`."""

    @abstractmethod
    def hand_over(self, fingerprint: bool = False) -> None:
        """Store a frame of the present, and show the frame in question, whether or not a viewer is ready."""

    @abstractmethod
    def _can_go_on(self) -> bool:
        """Return whether there is a step to take."""

    @abstractmethod
    def _play_step(self, stop: threading.Event) -> bool:
        """Take a step in the thread unless `stop` is set; return whether to go on."""

    @abstractmethod
    def _shown(self) -> PackedFrame | None:
        """Return the frame that is shown, None without frames."""


class Player(Played):
    """Plays a model, step by step or in a thread.

    An error that the model raises is shown in `error` instead of being raised, and the model is not touched again.
    While an earlier frame is shown, steps go through the stored frames up to the present. A model that is given to the
    constructor keeps all that it has collected; of models that a page makes, old rows are dropped.
    """

    def __init__(self, model: EngineModel | None = None) -> None:
        super().__init__()
        self.model, self.error = model, ""
        self._is_own = model is not None
        self.recent = RecentPast()
        self.past: Past = self.recent
        self.selected: int | None = None
        self.selection = Listeners()
        self.stepping = False
        # The viewers that draw trails, for which is noted where robots were: nothing is without them.
        self._tracing: frozenset[Viewer] = frozenset()
        self._trails = TrailKeeper()
        self._scene: Scene | None = None
        self._world: dict = {}
        self._scene_key: tuple = ()
        self.rest()

    @property
    def finished(self) -> bool:
        """Whether the model has stopped running, and the latest frame is shown."""
        return self.model is not None and not self.model.running and self.past.is_present

    def step(self) -> None:
        """Pause, and take one step."""
        self.loop.pause()
        with self.capture_errors():
            self._advance()
        self.rest()

    def look(self, index: int) -> None:
        """Pause, and show the frame with this index in `past`."""
        self.loop.pause()
        with self.lock:
            self.past.look(index)
        self.rest()

    def look_now(self) -> None:
        """Show the present."""
        with self.lock:
            self.past.look(len(self.past))

    def hand_over(self, fingerprint: bool = False) -> None:
        """Store a frame of the present, and show the frame in question, whether or not a viewer is ready."""
        with self.capture_errors():
            self._store(fingerprint)
        self._push()

    def retake(self) -> None:
        """Replace the frame of the present, because the model was changed by hand between two steps, and show it."""
        with self.capture_errors():
            if self.model is not None and not self.error:
                self.recent.append(self._packed(self.model, fingerprint=not self.playing))
        self._push()
        self.changed.notify()

    def remove_viewer(self, viewer: Viewer) -> None:
        """Send no more frames to a viewer."""
        super().remove_viewer(viewer)
        self.trace(viewer, False)

    def trace(self, viewer: Viewer, on: bool) -> None:
        """Note where robots are after each step, as long as any viewer draws trails."""
        with self.capture_errors():
            self._tracing = self._tracing | {viewer} if on else self._tracing - {viewer}
            self._trails.follow(self.model if self._tracing else None)
            self._trails.points()

    def select(self, robot: int | None) -> None:
        """Select the robot with this unique_id, or none."""
        if robot != self.selected:
            self.selected = robot
            self.selection.notify()

    def close(self) -> None:
        """Stop for good, and drop the model, the frames, viewers and listeners."""
        self.loop.pause()
        self.viewers = ()
        self.changed.clear()
        self.selection.clear()
        with self.lock:
            self.model = None
            self._tracing = frozenset()
            self._trails.follow(None)
            self.past.clear()
            self._scene, self._scene_key = None, ()

    @contextmanager
    def capture_errors(self) -> Iterator[None]:
        """Hold the lock, and put errors into `error` instead of raising them."""
        with self.lock:
            try:
                yield
            except Exception as problem:  # any error of a model is shown: a page must go on
                self.loop.pause()
                self.error = reported(problem)

    def _can_go_on(self) -> bool:
        return self.model is not None and not self.error and not self.finished

    def _shown(self) -> PackedFrame | None:
        return self.past.shown

    def _play_step(self, stop: threading.Event) -> bool:
        with self.capture_errors():
            return not stop.is_set() and not self.finished and self._advance()
        self.rest()  # an error has stopped the thread already
        return False

    def _advance(self) -> bool:
        """Go on by one step, or by one stored frame, unless there was an error; return whether it did."""
        if self.model is None or self.error:
            return False
        if self.past.is_present:
            self._take_step(self.model)
        else:
            self.past.look(self.past.index + 1)
        return True

    def _take_step(self, model: EngineModel) -> None:
        if self._tracing:
            self._trails.follow(model)
        self.stepping = True
        try:
            model.step()
        finally:
            self.stepping = False
        if model.completed % MOST_COLLECTED == 0:
            self._limit_collected(model)
        if self.loop.speed <= FASTEST_STORED:
            self._store()

    def _limit_collected(self, model: EngineModel) -> None:
        if not self._is_own:
            forget_collected(model, MOST_COLLECTED)

    def _store(self, fingerprint: bool = False) -> None:
        """Store a frame of the present, unless an earlier one is shown or it is stored already."""
        if self.model is None or self.error or not self.past.is_present:
            return
        shown = self.past.shown
        if shown is None or shown.step != self.model.completed or (fingerprint and not shown.fingerprint):
            self.recent.append(self._packed(self.model, fingerprint))

    def _packed(self, model: EngineModel, fingerprint: bool) -> PackedFrame:
        standing = model.obstacle_list
        last = standing[-1].unique_id if standing else 0  # ids only grow: with the number they identify every change
        key = id(model), model.swarm.version, len(standing), last, id(model.control), model.fire_constants.leave
        key = *key, *pictures_of(model), *map(tuple, drawn_parts(model)), drawn_heat(model)
        if self._scene is None or key != self._scene_key:
            self._scene, self._scene_key = scene_of(model), key
            world = self._scene.world()
            # Browsers enter another world, which takes a while: most changes of a model leave it as it was.
            self._world = self._world if self._world == world else world
        content = packed_frame(frame_of(model, PACKED_FROM), self._scene)
        state_hash = model.state_hash() if fingerprint else ""
        if self._tracing:
            self._trails.follow(model)
        trail = self._trails.points()
        return PackedFrame(model.completed, content, self._world, readings_of(model), state_hash, trail)


def readings_of(model: EngineModel) -> tuple[tuple[str, str], ...]:
    """Return the numbers that are shown above the picture, each with its name."""
    texts = tuple((shown.name, shown.text) for shown in shown_of(model) if shown.text)
    fires, collisions = model.fires, f"{model.collisions:,} now, {model.total_collisions:,} in all"
    if not len(fires):
        return ("Robots", f"{len(model.swarm):,}"), ("Collisions", collisions), *texts
    burning, fighting = int((~fires.out).sum()), int((model.swarm.fire >= 0).sum())
    return (
        ("Fires burning", f"{burning} of {len(fires)}"),
        ("Robots at fires", f"{fighting} of {len(model.swarm):,}"),
        ("Collisions", collisions),
        *texts,
    )


def forget_collected(model: EngineModel, rows: int) -> None:
    """Drop all but the last rows of what a model collects in every step, unless they are being recorded."""
    if any(isinstance(observer, Recorder) for observer in model.observers):
        return  # it stores the rows since it was last called
    collector = model.datacollector
    for values in collector.model_vars.values():
        del values[: max(0, len(values) - rows)]
    for step in list(collector._agent_records)[:-rows]:
        del collector._agent_records[step]
    model.fires.history.forget(rows)
