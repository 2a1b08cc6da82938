"""Two worlds played by one clock: both step together, and both are displayed at the same step."""

import threading
from dataclasses import dataclass

from mesa_swarm.dashboard.page.series import MOST_NUMBERS, Series
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES, PlayLoop
from mesa_swarm.viewing.player import PackedFrame, Past, Played, Player, Viewer

NAMES = ("A", "B")


class Side(Player):
    """One of two players that share a clock and a lock."""

    def __init__(self, loop: PlayLoop, lock: threading.RLock) -> None:
        super().__init__()
        self.loop, self.lock = loop, lock
        self.series = Series(MOST_NUMBERS // 2)  # also of steps that are no longer stored

    def place(self, model: SwarmModel | None) -> None:
        """Play another model, and remove the pictures of the old one."""
        self.error = ""
        self.past.clear()
        self.model = model
        self.series.follow(model)

    def close(self) -> None:
        """Stop, and release everything."""
        super().close()
        self.series.follow(None)

    def advance(self) -> bool:
        """Take one step unless the model has ended or failed; return whether it can continue."""
        with self.capture_errors():
            return not self.finished and self._advance()
        return False


@dataclass(frozen=True, slots=True)
class Way:
    """The way to a step: whether it is then played on, and at which speed, steps/s."""

    step: int
    plays: bool
    speed: float


class Pair(Played):
    """Plays two models together, as a `Player` plays one.

    When one model ends, the other continues; when one fails, both stop. Viewers receive pictures without a world: the
    step, and the fingerprints of both.
    """

    def __init__(self) -> None:
        super().__init__()
        self.sides = Side(self.loop, self.lock), Side(self.loop, self.lock)
        self._way: Way | None = None

    @property
    def error(self) -> str:  # type: ignore[override] # of both sides
        """The errors of both sides, empty without one."""
        wrong = [f"{name}: {side.error}" for name, side in zip(NAMES, self.sides, strict=True) if side.error]
        return "; ".join(wrong)

    @property
    def finished(self) -> bool:
        """Whether both models have stopped running, and the last pictures are displayed."""
        return all(side.finished for side in self.sides)

    @property
    def past(self) -> Past:  # type: ignore[override] # likewise
        """The pictures of the side with the latest step."""
        return max((side.past for side in self.sides), key=lambda past: past.last_step)

    @property
    def is_present(self) -> bool:
        """Whether the latest pictures are displayed."""
        return all(side.past.is_present for side in self.sides)

    @property
    def completed(self) -> int:
        """The latest step of both models."""
        return max((side.model.completed for side in self.sides if side.model is not None), default=0)

    def go_on_to(self, step: int, *, plays: bool) -> None:
        """Play up to a step as fast as it goes, as after a reload; then play on, or stop there."""
        if self.completed < step and self._can_go_on():
            self._way = Way(step, plays, self.loop.speed)
            self.loop.speed = AS_FAST_AS_IT_GOES
            self.play()
        elif plays:
            self.play()

    def set_speed(self, speed: float) -> None:
        """Set the speed, steps/s, also on the way to a step."""
        self._way = None
        super().set_speed(speed)

    def rest(self) -> None:
        """Show the state at rest; pausing on the way to a step ends the way."""
        if not self.playing:
            self._end_way()
        super().rest()

    def _end_way(self) -> bool:
        """Play as fast as before; return whether to play on."""
        way, self._way = self._way, None
        if way is not None:
            self.loop.speed = way.speed
        return way is None or way.plays

    def place(self, first: SwarmModel | None, second: SwarmModel | None) -> None:
        """Stop, and continue with two other models."""
        self.loop.pause()
        with self.lock:
            for side, model in zip(self.sides, (first, second), strict=True):
                side.place(model)
        self.rest()

    def step(self) -> None:
        """Pause, and take one step in both."""
        self.loop.pause()
        with self.lock:
            if self._can_step():
                self._advance()
        self.rest()

    def look(self, index: int) -> None:
        """Pause, and display the pictures of the step with this index in `past`."""
        self.loop.pause()
        with self.lock:
            past = self.past
            past.look(index)
            if past.shown is not None:
                self._look_at(past.shown.step)
        self.rest()

    def hand_over(self, fingerprint: bool = False) -> None:
        """Show both sides, and notify the viewers of both at once."""
        for side in self.sides:
            side.hand_over(fingerprint)
        self._push()

    def close(self) -> None:
        """Stop, and release the models, the pictures and the viewers."""
        self.loop.pause()
        self.viewers = ()
        self.changed.clear()
        for side in self.sides:
            side.close()

    def _watching(self) -> tuple[Viewer, ...]:
        first, second = self.sides
        return *self.viewers, *first.viewers, *second.viewers

    def _can_go_on(self) -> bool:
        return self._can_step() and not self.finished

    def _can_step(self) -> bool:
        return not self.error and all(side.model is not None for side in self.sides)

    def _play_step(self, stop: threading.Event) -> bool:
        with self.lock:
            if stop.is_set():
                return False
            goes_on = self._advance()
            has_arrived = self._way is not None and self.completed >= self._way.step
        if has_arrived:
            goes_on = self._end_way() and goes_on
            self.changed.notify()
        if self.error:
            self.rest()  # after an error, which has stopped the thread already
        return goes_on

    def _advance(self) -> bool:
        """Advance by one step, or by one stored picture; return whether there are more."""
        if self.is_present:
            return any([side.advance() for side in self.sides])  # a list, so that both advance
        later = [side.recent.step_after() for side in self.sides if not side.past.is_present]
        self._look_at(min(later))
        return True

    def _look_at(self, step: int) -> None:
        for side in self.sides:
            side.recent.look_at(step)

    def _shown(self) -> PackedFrame | None:
        """Return a picture without a world, with the displayed step and both fingerprints."""
        first, second = (side.past.shown for side in self.sides)
        if first is None or second is None:
            return None
        fingerprint = f"{first.fingerprint}-{second.fingerprint}".strip("-")
        return PackedFrame(max(first.step, second.step), b"", {}, (), fingerprint)
