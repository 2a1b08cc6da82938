"""What all that is played shares: a clock, a lock, and whoever is shown pictures."""

import threading
from abc import ABC, abstractmethod
from typing import Protocol

from mesa_swarm.dashboard.listeners import Listeners
from mesa_swarm.dashboard.past import Picture
from mesa_swarm.dashboard.play_loop import PlayLoop


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
    """

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
