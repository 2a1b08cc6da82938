"""A model that somebody watches: it is played, stepped and stepped back, and whoever looks gets pictures of it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from mesa_swarm.dashboard.listeners import Listeners
from mesa_swarm.dashboard.past import KeptPast, Past, Picture
from mesa_swarm.dashboard.played import Played
from mesa_swarm.dashboard.readings import in_words, readings_of
from mesa_swarm.model import SwarmModel
from mesa_swarm.recording.recorder import Recorder
from mesa_swarm.viewing.moments import moment_of_model, packed_frame
from mesa_swarm.viewing.worlds import world_of_model

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
    >>> player = Player(SwarmModel(rng=1))
    >>> player.step()
    >>> player.step()
    >>> player.back()
    >>> player.past.shown.step, player.model.steps
    (1, 2)
    """

    def __init__(self, model: SwarmModel | None = None) -> None:
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

    def _take_step(self, model: SwarmModel) -> None:
        self.stepping = True
        try:
            model.step()
        finally:
            self.stepping = False
        if model.completed % MOST_COLLECTED == 0:
            self._keep_window(model)
        if self.loop.speed <= FASTEST_KEPT:
            self._keep()

    def _keep_window(self, model: SwarmModel) -> None:
        if not self._is_own:
            forget_collected(model, MOST_COLLECTED)

    def _keep(self, fingerprint: bool = False) -> None:
        """Make a picture of the present, unless an earlier one is looked at or there is one."""
        if self.model is None or self.error or not self.past.is_present:
            return
        known = self.past.shown
        if known is None or known.step != self.model.completed or (fingerprint and not known.fingerprint):
            self.kept.append(self._picture(self.model, fingerprint))

    def _picture(self, model: SwarmModel, fingerprint: bool) -> Picture:
        standing = model.obstacle_list
        last = standing[-1].unique_id if standing else 0  # ids only grow: with the number it tells of every change
        key = id(model), model.swarm.version, len(standing), last, id(model.control), model.fire_constants.leave
        if key != self._world_key:
            self._world, self._world_key = world_of_model(model), key
        frame = packed_frame(moment_of_model(model, self._world), self._world)
        mark = model.state_hash() if fingerprint else ""
        return Picture(model.completed, frame, self._world, readings_of(model), mark)


def forget_collected(model: SwarmModel, rows: int) -> None:
    """Keep the last so many rows of what a model collects in every step, unless they are being recorded.

    Examples
    --------
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
