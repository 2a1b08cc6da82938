"""What one browser session owns: its model, the wishes for the next one, and the thread that plays it."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from mesa_swarm.dashboard.drawing import (
    draw_fires,
    draw_loads,
    draw_robots,
    draw_sectors,
    draw_shapes,
    drawing,
    label_fires,
)
from mesa_swarm.errors import SwarmError
from mesa_swarm.fire import FireConstants
from mesa_swarm.model import SwarmModel
from mesa_swarm.parameters import parameters_of
from mesa_swarm.world.load import Load

FRAME_TIME = 0.05
# Parameters that a running model takes at once.
LIVE = frozenset(field.name for field in fields(FireConstants)) - {"remarks"}


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What the page shows: the drawing, the numbers above it, whether it plays, and what went wrong."""

    svg: str = ""
    readings: tuple[tuple[str, str], ...] = ()
    playing: bool = False
    error: str = ""


class Session:
    """A model that one user plays, pauses, steps and resets.

    Nothing here raises: what goes wrong is said in `frame.error`, and `reset` starts again. A thread that has
    been told to stop takes no further step, so none of an old run reaches the model of a new one.

    Parameters
    ----------
    model_class : type
        A model that is built from keywords and `rng`.

    Attributes
    ----------
    wishes : dict
        Parameters of the next model; those in `LIVE` also of the present one.
    seed, speed, sectors : int, int, bool
        Of the next model; steps a frame; whether sectors are drawn.
    frame : Frame
        The latest.

    Examples
    --------
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> session = Session(FireFighting)
    >>> session.step()
    >>> session.frame.readings[:2]
    (('Step', '1'), ('Fires burning', '7 of 7'))
    """

    speed = 5

    def __init__(self, model_class: Callable[..., SwarmModel]) -> None:
        self.model_class = model_class
        self.wishes: dict[str, Any] = {name: p.default for name, p in parameters_of(model_class).items()}
        self.seed, self.sectors = 1, True
        self.model: SwarmModel | None = None
        self.frame = Frame()
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self.reset()

    def reset(self) -> None:
        """Stop, and build a new model as wished; the old one stays where that cannot be."""
        self.pause()
        with self._changing():
            self.model = self.model_class(**self.wishes, rng=self.seed)

    def change(self, name: str, value: Any) -> None:
        """Wish for a parameter, and give it to the present model where it can take it."""
        with self._changing():
            self.wishes[name] = value
            if name in LIVE and self.model is not None:
                wished = {key: self.wishes[key] for key in LIVE & self.wishes.keys()}
                self.model.fire_constants = replace(self.model.fire_constants, **wished, remarks=())

    def show_sectors(self, sectors: bool) -> None:
        """Draw sectors from now on, or no longer."""
        with self._changing():
            self.sectors = sectors

    def play(self, redraw: Callable[[], None]) -> None:
        """Step in a thread until paused, reset, finished or broken; call `redraw` after every frame."""
        self.pause()
        self._stop = threading.Event()
        self.frame = replace(self.frame, playing=True)
        threading.Thread(target=self._run, args=(self._stop, redraw), name="play", daemon=True).start()

    def pause(self) -> None:
        """Take no further step."""
        self._stop.set()
        with self._lock:
            self.frame = replace(self.frame, playing=False)

    def step(self) -> None:
        """Pause, and take one step."""
        self.pause()
        with self._changing():
            self.model.step()

    def _run(self, stop: threading.Event, redraw: Callable[[], None]) -> None:
        while not stop.is_set():
            began = time.perf_counter()
            self._advance(stop)
            redraw()
            # A pause even after a slow frame: clicks are served in it.
            stop.wait(max(FRAME_TIME + began - time.perf_counter(), FRAME_TIME / 4))

    def _advance(self, stop: threading.Event) -> None:
        with self._lock:
            if stop.is_set():
                return
            with self._changing():
                for _ in range(self.speed):
                    if not self.model.running:
                        stop.set()
                    if stop.is_set():
                        break
                    self.model.step()

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Make a new frame of what is changed within, or of what went wrong."""
        with self._lock:
            svg, readings, error = self.frame.svg, self.frame.readings, ""
            try:
                yield
                svg, readings = _drawn(self.model, self.sectors), _readings(self.model)
            except Exception as problem:  # whatever a model raises is shown, or the page would be dead
                self._stop.set()
                error = _in_words(problem)
            self.frame = Frame(svg, readings, not self._stop.is_set(), error)


def _drawn(model: SwarmModel, sectors: bool) -> str:
    """Return the drawing of a model; sectors are sensed anew, so that they match the poses that one sees."""
    model.sense()
    x_min, y_min, x_max, y_max = model.map.bounds
    corner, size = np.array([x_min, y_min]), (x_max - x_min, y_max - y_min)
    swarm, fires = model.swarm, model.fires
    position, burning = swarm.position - corner, fires.position - corner
    layers = [
        draw_shapes([body.shape for body in model.obstacles if not isinstance(body, Load)], corner),
        draw_loads([load.shape for load in model.loads], corner),
        draw_fires(burning, fires.radius, fires.temperature, fires.out),
        draw_robots(position, swarm.heading, swarm.radius),
    ]
    if sectors:
        sensors = swarm.table.proximity[swarm.columns["design"]]
        layers.insert(2, draw_sectors(position, swarm.heading, sensors, swarm.distance))
    return drawing(size, layers, label_fires(burning, fires.radius, fires.out, fires.robots, size))


def _readings(model: SwarmModel) -> tuple[tuple[str, str], ...]:
    """Return the numbers that are shown above the drawing, each with its name."""
    fires, collisions = model.fires, f"{model.collisions:,} now, {model.total_collisions:,} in all"
    readings = {"Step": f"{model.steps:,}", "Collisions": collisions}
    if len(fires):
        burning, fighting = int((~fires.out).sum()), int((model.swarm.fire >= 0).sum())
        at_fires = {"Fires burning": f"{burning} of {len(fires)}", "Robots at fires": f"{fighting}"}
        readings = {"Step": readings["Step"], **at_fires, "Collisions": collisions}
    return tuple(readings.items())


def _in_words(problem: Exception) -> str:
    line = (str(problem).splitlines() or [""])[0]
    return line if isinstance(problem, SwarmError) else f"{type(problem).__name__}: {line}; Reset starts again"
