"""A model that somebody watches: it is played, stepped and stepped back, and whoever looks gets pictures of it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from mesa_swarm.dashboard.listeners import Listeners
from mesa_swarm.dashboard.past import Past, Picture
from mesa_swarm.dashboard.play_loop import PlayLoop
from mesa_swarm.dashboard.readings import in_words, readings_of
from mesa_swarm.model import SwarmModel
from mesa_swarm.viewing.moments import moment_of_model, packed_frame
from mesa_swarm.viewing.worlds import world_of_model

# Played faster than this, steps a second, only what was shown is kept for stepping back.
FASTEST_KEPT = 100.0


class Viewer(Protocol):
    """Whoever is shown pictures: `ready` if it has done with the last one."""

    ready: bool

    def push(self, number: int, picture: Picture) -> None:
        """Show a picture, now or as soon as it can, unless it had one of a higher number."""


class Player:
    """Plays a model, step by step or in a thread.

    Nothing here raises what a model raises: it is said in `error`, and the model is then left alone. While an
    earlier picture is looked at, steps go through the pictures that are kept, up to the present.

    Parameters
    ----------
    model : SwarmModel, optional

    Attributes
    ----------
    model : SwarmModel or None
    error : str
        What went wrong, empty if nothing did.
    past : Past
        The pictures that are kept.
    loop : PlayLoop
    lock : RLock
        Held while the model changes; hold it to look at a model that may be played.
    stepping : bool
        Whether it is taking a step.
    changed : Listeners
        Told when something else than the picture changed: playing or not, an error, another model.
    selected : int or None
        Id of the robot that is looked at closely.
    selection : Listeners
        Told when that is another one.

    Examples
    --------
    >>> player = Player(SwarmModel(rng=1))
    >>> player.step()
    >>> player.step()
    >>> player.back()
    >>> player.past.shown.step, player.model.steps
    (1, 2)
    """

    def __init__(self, model: SwarmModel | None = None) -> None:
        self.model, self.error = model, ""
        self.past = Past()
        self.loop = PlayLoop(self._play_step, self.show, self.rest)
        self.lock = threading.RLock()
        self.changed = Listeners()
        self.selected: int | None = None
        self.selection = Listeners()
        self.viewers: tuple[Viewer, ...] = ()
        self.stepping = False
        self._number = 0
        self._world: dict = {}
        self._world_key: tuple = ()
        self.rest()

    @property
    def playing(self) -> bool:
        """Whether it is played."""
        return self.loop.playing

    @property
    def finished(self) -> bool:
        """Whether the model has stopped running, and nothing later is kept."""
        return self.model is not None and not self.model.running and self.past.is_present

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
        if self.model is None or self.error or self.finished:
            return
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

    def step(self) -> None:
        """Pause, and take one step."""
        self.loop.pause()
        if self.model is not None and not self.error:
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

    def show(self) -> None:
        """Show viewers how things are now; while it plays, only if one of them is ready."""
        if self.playing and not any(viewer.ready for viewer in self.viewers):
            return
        with self.minding():
            self._keep()
        self._push()

    def rest(self) -> None:
        """Show how things are at rest, with a fingerprint of the state, and tell that something changed."""
        with self.minding():
            self._keep(fingerprint=not self.playing)
        self._push()
        self.changed.tell()

    def retake(self) -> None:
        """Look at the present, and show it anew: the model was changed by hand between two steps."""
        with self.minding():
            if self.model is not None and not self.error:
                self.past.append(self._picture(fingerprint=not self.playing))
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

    def _play_step(self, stop: threading.Event) -> bool:
        with self.minding():
            return not stop.is_set() and not self.finished and self._advance()
        self.rest()  # it broke, which has stopped the thread already
        return False

    def _advance(self) -> bool:
        """Go on by one step, or by one picture that is kept; return whether there is more."""
        if not self.past.is_present:
            self.past.forward()
            return True
        self.stepping = True
        try:
            self.model.step()
        finally:
            self.stepping = False
        if self.loop.speed <= FASTEST_KEPT:
            self._keep()
        return True

    def _keep(self, fingerprint: bool = False) -> None:
        """Make a picture of the present, unless an earlier one is looked at or there is one."""
        if self.model is None or self.error or not self.past.is_present:
            return
        known = self.past.shown
        if known is None or known.step != self.model.completed or (fingerprint and not known.fingerprint):
            self.past.append(self._picture(fingerprint))

    def _picture(self, fingerprint: bool) -> Picture:
        model = self.model
        key = id(model), model.swarm.version, len(model.obstacle_list), id(model.control), model.fire_constants.leave
        if key != self._world_key:
            self._world, self._world_key = world_of_model(model), key
        frame = packed_frame(moment_of_model(model, self._world), self._world)
        mark = model.state_hash() if fingerprint else ""
        return Picture(model.completed, frame, self._world, readings_of(model), mark)

    def _push(self) -> None:
        with self.lock:
            self._number += 1
            number, picture = self._number, self.past.shown
        if picture is not None:
            for viewer in self.viewers:
                viewer.push(number, picture)
