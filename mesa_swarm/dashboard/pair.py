"""Two worlds played by one clock: both step together, and one looks at both at the same step."""

import threading

from mesa_swarm.dashboard.listeners import Listeners
from mesa_swarm.dashboard.past import Past, Picture
from mesa_swarm.dashboard.play_loop import PlayLoop
from mesa_swarm.dashboard.player import Player, Viewer
from mesa_swarm.model import SwarmModel

NAMES = ("A", "B")


class Side(Player):
    """One of two players that share a clock and a lock.

    Parameters
    ----------
    loop : PlayLoop
    lock : RLock
    """

    def __init__(self, loop: PlayLoop, lock: threading.RLock) -> None:
        super().__init__()
        self.loop, self.lock = loop, lock

    def place(self, model: SwarmModel | None) -> None:
        """Take another model, and forget the pictures of the old one."""
        self.error = ""
        self.past.clear()
        self.model = model

    def advance(self) -> bool:
        """Take one step unless the model is done or broken; return whether there is more to come."""
        with self.minding():
            return not self.error and not self.finished and self._advance()
        return False

    def hand_over(self, fingerprint: bool = False) -> None:
        """Keep a picture of the present, and show what is looked at, whether or not anybody is ready."""
        with self.minding():
            self._keep(fingerprint)
        self._push()


class Pair:
    """Plays two models together, as a `Player` plays one.

    A model that is done, or breaks, stays as it is while the other goes on or, if it broke, both stop.

    Attributes
    ----------
    sides : tuple of two Side
    lock : RLock
        Held while either model changes.
    changed : Listeners
        Told when something else than the pictures changed.
    viewers : tuple of Viewer
        Shown pictures without a world: the step, and numbers of both.

    Examples
    --------
    >>> pair = Pair()
    >>> pair.place(SwarmModel(rng=1), SwarmModel(rng=1))
    >>> pair.step()
    >>> [side.model.steps for side in pair.sides]
    [1, 1]
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.loop = PlayLoop(self._play_step, self.show, self.rest)
        self.sides = Side(self.loop, self.lock), Side(self.loop, self.lock)
        self.changed = Listeners()
        self.viewers: tuple[Viewer, ...] = ()
        self._number = 0

    @property
    def playing(self) -> bool:
        """Whether they are played."""
        return self.loop.playing

    @property
    def error(self) -> str:
        """What went wrong in either, empty if nothing did."""
        wrong = [f"{name}: {side.error}" for name, side in zip(NAMES, self.sides, strict=True) if side.error]
        return "; ".join(wrong)

    @property
    def finished(self) -> bool:
        """Whether both models have stopped running, and nothing later is kept."""
        return all(side.finished for side in self.sides)

    @property
    def past(self) -> Past:
        """The pictures of the side that has come farthest."""
        return max((side.past for side in self.sides), key=lambda past: past.last_step)

    @property
    def is_present(self) -> bool:
        """Whether the latest pictures are looked at."""
        return all(side.past.is_present for side in self.sides)

    def place(self, first: SwarmModel | None, second: SwarmModel | None) -> None:
        """Stop, and go on with two other models."""
        self.loop.pause()
        with self.lock:
            for side, model in zip(self.sides, (first, second), strict=True):
                side.place(model)
        self.rest()

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
        if self._can_step() and not self.finished:
            self.loop.play()
            self.changed.tell()

    def pause(self) -> None:
        """Take no further step, and show how things are."""
        self.loop.pause()
        self.rest()

    def toggle(self) -> None:
        """Play if they are at rest, pause if they are played."""
        if self.playing:
            self.pause()
        else:
            self.play()

    def step(self) -> None:
        """Pause, and take one step in both."""
        self.loop.pause()
        with self.lock:
            if self._can_step():
                self._advance()
        self.rest()

    def back(self) -> None:
        """Pause, and look at the pictures before."""
        self.look(self.past.index - 1)

    def look(self, index: int) -> None:
        """Pause, and look at the pictures of the step that has this index in `past`."""
        self.loop.pause()
        with self.lock:
            shown = self.past.look(index)
            if shown is not None:
                self._look_at(shown.step)
        self.rest()

    def show(self) -> None:
        """Show viewers how things are now; while they are played, only if one of them is ready."""
        watching = [*self.viewers, *(viewer for side in self.sides for viewer in side.viewers)]
        if self.playing and not any(viewer.ready for viewer in watching):
            return
        self._hand_over(fingerprint=False)

    def rest(self) -> None:
        """Show how things are at rest, with a fingerprint of the states, and tell that something changed."""
        self._hand_over(fingerprint=not self.playing)
        self.changed.tell()

    def close(self) -> None:
        """Stop for good; let go of the models, the pictures and everybody who looks."""
        self.loop.pause()
        self.viewers = ()
        self.changed.clear()
        for side in self.sides:
            side.close()

    def _can_step(self) -> bool:
        return not self.error and all(side.model is not None for side in self.sides)

    def _play_step(self, stop: threading.Event) -> bool:
        with self.lock:
            if stop.is_set():
                return False
            goes_on = self._advance()
        if self.error:
            self.rest()  # it broke, which has stopped the thread already
        return goes_on

    def _advance(self) -> bool:
        """Go on by one step, or by one picture that is kept; return whether there is more."""
        if self.is_present:
            return any([side.advance() for side in self.sides])  # a list: both, whatever the first says
        later = [side.past.after().step for side in self.sides if not side.past.is_present]
        self._look_at(min(later))
        return True

    def _look_at(self, step: int) -> None:
        for side in self.sides:
            side.past.look_at(step)

    def _hand_over(self, fingerprint: bool) -> None:
        """Show both sides, and tell the viewers of both at once."""
        for side in self.sides:
            side.hand_over(fingerprint)
        with self.lock:
            self._number += 1
            number, picture = self._number, self._both()
        if picture is not None:
            for viewer in self.viewers:
                viewer.push(number, picture)

    def _both(self) -> Picture | None:
        """Return a picture of no world, with the step that both are looked at, and their fingerprints."""
        shown = [side.past.shown for side in self.sides]
        if None in shown:
            return None
        mark = "-".join(picture.fingerprint for picture in shown)
        return Picture(max(picture.step for picture in shown), b"", {}, (), mark.strip("-"))
