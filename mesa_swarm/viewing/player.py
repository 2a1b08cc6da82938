"""A model that is played: its frames, its past, and its viewers."""

import threading
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from mesa_swarm.errors import in_words
from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.recorder import Recorder
from mesa_swarm.viewing.frame import moment_of_model, packed_frame
from mesa_swarm.viewing.play_loop import Listeners, PlayLoop
from mesa_swarm.viewing.readings import readings_of
from mesa_swarm.viewing.scene import world_of_model

MOST_BYTES = 48_000_000
# What a picture takes besides its frame: itself, its readings, its fingerprint.
PICTURE_BYTES = 1000
# Of a world, for each letter that it is written with.
WORLD_BYTES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """What is shown of a step: a packed frame, the world that it is drawn in, numbers beside it."""

    step: int
    frame: bytes
    world: dict = field(default_factory=dict, repr=False)
    readings: tuple[tuple[str, str], ...] = ()
    fingerprint: str = ""


class Past(ABC):
    """Pictures in the order of time, and the one that is looked at.

    Attributes
    ----------
    index : int
        Of the picture that is looked at.
    """

    def __init__(self) -> None:
        self.index = 0

    @abstractmethod
    def __len__(self) -> int:
        """How many there are."""

    @property
    @abstractmethod
    def shown(self) -> Picture | None:
        """The picture that is looked at, None if there are none."""

    @property
    @abstractmethod
    def first_step(self) -> int:
        """The step of the earliest picture, 0 if there is none."""

    @property
    @abstractmethod
    def last_step(self) -> int:
        """The step of the latest picture, 0 if there is none."""

    @abstractmethod
    def clear(self) -> None:
        """Forget everything."""

    @property
    def is_present(self) -> bool:
        """Whether the picture that is looked at is the latest."""
        return self.index >= len(self) - 1

    def look(self, index: int) -> None:
        """Look at the picture with this index, the nearest one if there is none."""
        self.index = min(max(index, 0), max(len(self) - 1, 0))


class KeptPast(Past):
    """The last pictures of a run, in memory.

    Parameters
    ----------
    most_bytes : int
        The oldest go when they take more than this, with the worlds that they are drawn in; the last two always stay.

    Examples
    --------
    >>> past = KeptPast()
    >>> for step in range(3):
    ...     past.append(Picture(step, b""))
    >>> past.look(past.index - 1)
    >>> past.shown.step, past.is_present
    (1, False)
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        super().__init__()
        self.most_bytes = most_bytes
        self._pictures: deque[Picture] = deque()
        self._sizes: deque[int] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._pictures)

    @property
    def shown(self) -> Picture | None:
        """The picture that is looked at, None before the first."""
        return self._pictures[self.index] if self._pictures else None

    @property
    def first_step(self) -> int:
        """The step of the earliest picture, 0 if there is none."""
        return self._pictures[0].step if self._pictures else 0

    @property
    def last_step(self) -> int:
        """The step of the latest picture, 0 if there is none."""
        return self._pictures[-1].step if self._pictures else 0

    def append(self, picture: Picture) -> None:
        """Keep a new picture, and look at it; it replaces one of the same step."""
        if self._pictures and self._pictures[-1].step == picture.step:
            self._pictures.pop()
            self._bytes -= self._sizes.pop()
        size = PICTURE_BYTES + len(picture.frame) + self._size_of_world(picture)
        self._pictures.append(picture)
        self._sizes.append(size)
        self._bytes += size
        while self._bytes > self.most_bytes and len(self._pictures) > 2:
            self._pictures.popleft()
            self._bytes -= self._sizes.popleft()
        self.index = len(self._pictures) - 1

    def _size_of_world(self, picture: Picture) -> int:
        """Return about how much memory a world takes that the picture before was not drawn in."""
        if self._pictures and self._pictures[-1].world is picture.world:
            return 0
        return WORLD_BYTES * len(repr(picture.world))

    def look_at(self, step: int) -> None:
        """Look at the latest picture that is not of a later step, the first if there is none."""
        self.look(bisect_right(self._pictures, step, key=lambda picture: picture.step) - 1)

    def step_after(self) -> int:
        """Return the step of the picture after the one that is looked at, of the last if there is none."""
        return self._pictures[min(self.index + 1, len(self) - 1)].step

    def clear(self) -> None:
        """Forget everything."""
        self._pictures.clear()
        self._sizes.clear()
        self._bytes = self.index = 0


class Viewer(Protocol):
    """Whoever is shown pictures."""

    @property
    def ready(self) -> bool:
        """Whether it has done with the last picture."""

    def push(self, number: int, picture: Picture) -> None:
        """Show a picture, now or as soon as it can, unless it had one of a higher number."""


class Played(ABC):
    """What is played by buttons: in a thread, step by step, forth and back.

    Attributes
    ----------
    loop : PlayLoop
    lock : RLock
        Held while a model changes; hold it to look at a model that may be played.
    changed : Listeners
        Told when something else than the picture changed: playing or not, an error, another model.
    viewers : tuple of Viewer
    error : str
        What went wrong, empty if nothing did.
    past : Past
        The frames that one can return to.
    """

    error: str
    past: Past

    def __init__(self) -> None:
        self.loop = PlayLoop(self._play_step, self.show, self.rest)
        self.lock = threading.RLock()
        self.changed = Listeners()
        self.viewers: tuple[Viewer, ...] = ()
        self._number = 0

    @property
    def playing(self) -> bool:
        """Whether it is played."""
        return self.loop.playing

    def add_viewer(self, viewer: Viewer) -> None:
        """Show pictures to somebody from now on."""
        self.viewers = (*self.viewers, viewer)
        self.show()

    def remove_viewer(self, viewer: Viewer) -> None:
        """Show pictures to somebody no longer."""
        self.viewers = tuple(other for other in self.viewers if other is not viewer)

    def set_speed(self, speed: float) -> None:
        """Play at so many steps a second from now on."""
        self.loop.speed = speed
        self.changed.tell()

    def play(self) -> None:
        """Step in a thread until paused, finished or broken."""
        if self._can_go_on():
            self.loop.play()
            self.changed.tell()

    def pause(self) -> None:
        """Take no further step, and show how things are."""
        self.loop.pause()
        self.rest()

    def toggle(self) -> None:
        """Play if it is at rest, pause if it plays."""
        if self.playing:
            self.pause()
        else:
            self.play()

    def show(self) -> None:
        """Show viewers how things are now; while it plays, only if one of them is ready."""
        playing = self.playing
        if not playing or any(viewer.ready for viewer in self._watching()):
            self.hand_over()
        if playing and not self.playing:  # making the picture broke it
            self.changed.tell()

    def rest(self) -> None:
        """Show how things are at rest, with a fingerprint of the state, and tell that something changed."""
        self.hand_over(fingerprint=not self.playing)
        self.changed.tell()

    def _watching(self) -> tuple[Viewer, ...]:
        """Return all for whom a picture would be made."""
        return self.viewers

    def _push(self) -> None:
        """Show viewers what is looked at."""
        with self.lock:
            self._number += 1
            number, picture = self._number, self._shown()
        if picture is not None:
            for viewer in self.viewers:
                viewer.push(number, picture)

    @property
    @abstractmethod
    def finished(self) -> bool:
        """Whether there is nothing more to play."""

    @abstractmethod
    def step(self) -> None:
        """Pause, and go on by one step."""

    @abstractmethod
    def back(self) -> None:
        """Pause, and go back by one frame."""

    @abstractmethod
    def look(self, index: int) -> None:
        """Pause, and look at the frame with this index in `past`."""

    @abstractmethod
    def hand_over(self, fingerprint: bool = False) -> None:
        """Keep a picture of the present, and show what is looked at, whether or not anybody is ready."""

    @abstractmethod
    def _can_go_on(self) -> bool:
        """Return whether there is a step to take."""

    @abstractmethod
    def _play_step(self, stop: threading.Event) -> bool:
        """Take a step in the thread, unless it was told to stop; return whether to go on."""

    @abstractmethod
    def _shown(self) -> Picture | None:
        """Return the picture that is looked at, None if there is none."""


# Played faster than this, steps a second, only what was shown is kept for stepping back.
FASTEST_KEPT = 100.0
# Of what a model that is played itself collects (Mesa's DataCollector, the history of fires), so many rows stay at
# every multiple of so many steps, and fewer than twice as many between two of them.
MOST_COLLECTED = 10_000


class Player(Played):
    """Plays a model, step by step or in a thread.

    Nothing here raises what a model raises: it is said in `error`, and the model is then left alone. While an
    earlier picture is looked at, steps go through the pictures that are kept, up to the present.

    Parameters
    ----------
    model : SwarmModel, optional
        One of a program's own: what it has collected is all kept. Of models that a page makes, old rows are forgotten.

    Attributes
    ----------
    model : SwarmModel or None
    error : str
        What went wrong, empty if nothing did.
    past : Past
        The pictures that one can go back to.
    stepping : bool
        Whether it is taking a step.
    selected : int or None
        Id of the robot that is looked at closely.
    selection : Listeners
        Told when that is another one.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> player = Player(SwarmModel(rng=1))
    >>> player.step()
    >>> player.step()
    >>> player.back()
    >>> player.past.shown.step, player.model.steps
    (1, 2)
    """

    def __init__(self, model: FireModel | None = None) -> None:
        super().__init__()
        self.model, self.error = model, ""
        self._is_own = model is not None
        self.kept = KeptPast()
        self.past: Past = self.kept
        self.selected: int | None = None
        self.selection = Listeners()
        self.stepping = False
        self._world: dict = {}
        self._world_key: tuple = ()
        self.rest()

    @property
    def finished(self) -> bool:
        """Whether the model has stopped running, and nothing later is kept."""
        return self.model is not None and not self.model.running and self.past.is_present

    def step(self) -> None:
        """Pause, and take one step."""
        self.loop.pause()
        with self.minding():
            self._advance()
        self.rest()

    def back(self) -> None:
        """Pause, and look at the picture before."""
        self.look(self.past.index - 1)

    def look(self, index: int) -> None:
        """Pause, and look at one of the pictures that are kept."""
        self.loop.pause()
        with self.lock:
            self.past.look(index)
        self.rest()

    def look_now(self) -> None:
        """Look at the present."""
        with self.lock:
            self.past.look(len(self.past))

    def hand_over(self, fingerprint: bool = False) -> None:
        """Keep a picture of the present, and show what is looked at, whether or not anybody is ready."""
        with self.minding():
            self._keep(fingerprint)
        self._push()

    def retake(self) -> None:
        """Look at the present, and show it anew: the model was changed by hand between two steps."""
        with self.minding():
            if self.model is not None and not self.error:
                self.kept.append(self._picture(self.model, fingerprint=not self.playing))
        self._push()
        self.changed.tell()

    def select(self, robot: int | None) -> None:
        """Look closely at the robot with this id, or at none."""
        if robot != self.selected:
            self.selected = robot
            self.selection.tell()

    def close(self) -> None:
        """Stop for good; let go of the model, the pictures and everybody who looks."""
        self.loop.pause()
        self.viewers = ()
        self.changed.clear()
        self.selection.clear()
        with self.lock:
            self.model = None
            self.past.clear()
            self._world, self._world_key = {}, ()

    @contextmanager
    def minding(self) -> Iterator[None]:
        """Hold the lock, and say what goes wrong within instead of raising it."""
        with self.lock:
            try:
                yield
            except Exception as problem:  # whatever a model raises is shown, or the page would be dead
                self.loop.pause()
                self.error = in_words(problem)

    def _can_go_on(self) -> bool:
        return self.model is not None and not self.error and not self.finished

    def _shown(self) -> Picture | None:
        return self.past.shown

    def _play_step(self, stop: threading.Event) -> bool:
        with self.minding():
            return not stop.is_set() and not self.finished and self._advance()
        self.rest()  # it broke, which has stopped the thread already
        return False

    def _advance(self) -> bool:
        """Go on by one step, or by one picture that is kept, unless it is broken; return whether it did."""
        if self.model is None or self.error:
            return False
        if self.past.is_present:
            self._take_step(self.model)
        else:
            self.past.look(self.past.index + 1)
        return True

    def _take_step(self, model: FireModel) -> None:
        self.stepping = True
        try:
            model.step()
        finally:
            self.stepping = False
        if model.completed % MOST_COLLECTED == 0:
            self._keep_window(model)
        if self.loop.speed <= FASTEST_KEPT:
            self._keep()

    def _keep_window(self, model: FireModel) -> None:
        if not self._is_own:
            forget_collected(model, MOST_COLLECTED)

    def _keep(self, fingerprint: bool = False) -> None:
        """Make a picture of the present, unless an earlier one is looked at or there is one."""
        if self.model is None or self.error or not self.past.is_present:
            return
        known = self.past.shown
        if known is None or known.step != self.model.completed or (fingerprint and not known.fingerprint):
            self.kept.append(self._picture(self.model, fingerprint))

    def _picture(self, model: FireModel, fingerprint: bool) -> Picture:
        standing = model.obstacle_list
        last = standing[-1].unique_id if standing else 0  # ids only grow: with the number it tells of every change
        key = id(model), model.swarm.version, len(standing), last, id(model.control), model.fire_constants.leave
        if key != self._world_key:
            self._world, self._world_key = world_of_model(model), key
        frame = packed_frame(moment_of_model(model, self._world), self._world)
        mark = model.state_hash() if fingerprint else ""
        return Picture(model.completed, frame, self._world, readings_of(model), mark)


def forget_collected(model: FireModel, rows: int) -> None:
    """Keep the last so many rows of what a model collects in every step, unless they are being recorded.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> model = SwarmModel(rng=1).run(20)
    >>> forget_collected(model, 5)
    >>> len(model.datacollector.model_vars["collisions"])
    5
    """
    if any(isinstance(observer, Recorder) for observer in model.observers):
        return  # it stores what came since it looked last
    collector = model.datacollector
    for values in collector.model_vars.values():
        del values[: max(0, len(values) - rows)]
    for step in list(collector._agent_records)[:-rows]:
        del collector._agent_records[step]
    model.fires.history.forget(rows)
