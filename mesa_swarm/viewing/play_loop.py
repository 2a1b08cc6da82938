"""The thread that plays at a given speed, and listeners to changes."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable

import solara

# Steps are taken for this long before a frame is offered again, s.
BATCH_TIME = 1 / 40
# Pause after a batch in which clicks are served, s.
BREATH = 0.001
# A thread that was delayed does not make up for more than this, s.
LONGEST_DEBT = 0.1
# Window of the achieved rate, s.
RATE_TIME = 1.0
AS_FAST_AS_IT_GOES = math.inf


class Listeners:
    """Functions that are called when something changes.

    Never notify while holding a lock: a listener may draw a page, whose lock may be held by a thread that waits for
    yours.
    """

    def __init__(self) -> None:
        self._functions: list[Callable] = []
        self._lock = threading.Lock()
        self.count = 0  # of notifications, also without listeners

    def __len__(self) -> int:
        return len(self._functions)

    def add(self, function: Callable) -> Callable[[], None]:
        """Call a function from now on, until what is returned is called."""
        with self._lock:
            self._functions = [*self._functions, function]

        def leave() -> None:
            with self._lock:
                self._functions = [other for other in self._functions if other is not function]

        return leave

    def notify(self, *news: object) -> None:
        """Call all functions in the order in which they were added."""
        with self._lock:
            self.count += 1
            functions = self._functions
        for function in functions:
            function(*news)

    def clear(self) -> None:
        """Remove all functions."""
        with self._lock:
            self._functions = []


def use_changes(listeners: Listeners) -> int:
    """Draw a Solara component anew whenever these listeners are notified; return how often that was."""
    count, set_count = solara.use_state(0)
    drawn = solara.use_memo(lambda: listeners.count, [listeners])

    def hear(*_: object) -> None:
        set_count(lambda n: n + 1)

    def listen() -> Callable[[], None]:
        leave = listeners.add(hear)
        if listeners.count != drawn:  # between drawing and listening
            hear()
        return leave

    solara.use_effect(listen, [listeners])
    return count


class PlayLoop:
    """Steps at a given speed in a thread of its own.

    A thread that is stopped takes no further step: `step` receives the thread's own stop event, to be checked while
    holding the lock under which it steps, and returns whether to go on. `show` is called after every batch of steps,
    `ended` when the thread ends by itself; `wait` is called with the stop event, which ends it early, and seconds.
    """

    def __init__(
        self,
        step: Callable[[threading.Event], bool],
        show: Callable[[], None],
        ended: Callable[[], None],
        *,
        clock: Callable[[], float] = time.perf_counter,
        wait: Callable[[threading.Event, float], object] = threading.Event.wait,
    ) -> None:
        self.speed = 30.0
        self._step, self._show, self._ended = step, show, ended
        self._clock, self._wait = clock, wait
        self._stop = threading.Event()
        self._stop.set()
        self._taken: deque[tuple[float, int]] = deque()

    @property
    def playing(self) -> bool:
        """Whether a thread steps that was not stopped."""
        return not self._stop.is_set()

    @property
    def rate(self) -> float:
        """Steps a second that were taken in the last second, 0 at rest."""
        batches = list(self._taken)
        if not self.playing or len(batches) < 2:
            return 0.0
        seconds = batches[-1][0] - batches[0][0]
        return sum(steps for _, steps in batches[1:]) / seconds if seconds > 0 else 0.0

    def play(self) -> None:
        """Step from now on."""
        if self.playing:
            return
        self._stop = threading.Event()
        self._taken = deque()
        threading.Thread(target=self._run, args=(self._stop,), name="play", daemon=True).start()

    def pause(self) -> None:
        """Take no further step; the thread ends soon."""
        self._stop.set()

    def _run(self, stop: threading.Event) -> None:
        then, due = self._clock(), 1.0
        while not stop.is_set():
            steps, goes_on = self._batch(stop, due)
            if not goes_on and not stop.is_set():
                stop.set()
                self._ended()
                return
            if steps:
                self._note(steps)
                self._show()
            self._wait(stop, max(BREATH, min((1.0 - (due - steps)) / self.speed, 0.25)))
            now = self._clock()
            due = min(due - steps + (now - then) * self.speed, 1.0 + LONGEST_DEBT * self.speed)
            then = now

    def _batch(self, stop: threading.Event, due: float) -> tuple[int, bool]:
        """Take the steps that are due, as many as fit in a batch; return how many, and whether to go on."""
        end, steps = self._clock() + BATCH_TIME, 0
        while due - steps >= 1.0:
            if not self._step(stop):
                return steps, False
            steps += 1
            if self._clock() > end:
                break
        return steps, True

    def _note(self, steps: int) -> None:
        now = self._clock()
        self._taken.append((now, steps))
        while len(self._taken) > 2 and now - self._taken[0][0] > max(RATE_TIME, 2.5 / self.speed):
            self._taken.popleft()
