"""The canvas as a widget: in notebooks, on Mesa's page and on the dashboard."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import anywidget
import solara
import traitlets
from reacton.core import Element

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.observers import Observer
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.last_picture import LastPicture
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES
from mesa_swarm.viewing.player import PackedFrame, Past, Played, Player
from mesa_swarm.viewing.trails import TrailPoint, news, packed_points

# Frames on their way to the browser: one is drawn while the next is made.
MOST_AHEAD = 2
# Most frames that a browser draws for one report.
MOST_EACH = 4
# How long the other views of a canvas wait for one that does not answer, s: it may be in a hidden tab.
PATIENCE = 1.0
SPEEDS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 250.0, 500.0, 1000.0, AS_FAST_AS_IT_GOES)
# Interval at which steps that a program takes are shown, s.
EVERY = 0.05
ON_A_PAGE = {"bar": True, "keys": "page", "toggles": {}}
IN_A_NOTEBOOK = {"bar": True, "keys": "own", "toggles": {}, "compact": True, "errors": True}


@dataclass
class CanvasView:
    """One place in which a browser shows a canvas.

    `drawn` is the last frame of which it has reported that it drew it; `since` is when an answer became due, s. It
    reports every one of `each` frames. `trails` is whether it draws trails.
    """

    drawn: int
    since: float
    each: int = 1
    trails: bool = False


class SwarmCanvas(anywidget.AnyWidget):
    """A world drawn in the browser, frame after frame.

    Frames are numbered when they are sent, and each view of the canvas answers with the number that it has drawn, in
    quick succession not for each one: at most `MOST_AHEAD` and those between two answers are on their way to any of
    them, and of those that wait all but the latest are dropped. A view that does not answer for `PATIENCE` seconds is
    not waited for; it shows the latest frame when it can.
    """

    _esm = palette.palette_script() + text_of("viewing/canvas.js", "viewing/elements.js", "viewing/widget.js")
    _css = palette.style_sheet(".swarm-player", '.swarm-player[data-theme="dark"]') + text_of("viewing/widget.css")
    # bar: whether there are buttons; keys: "page" where keys pressed anywhere play and step, "own" where only those
    # pressed in the widget do, "" for none; toggles: what is drawn, by name; head: whether a caption and the readings
    # stand above it; stage: False for buttons without a canvas; compact: small buttons, and all readings in one line;
    # errors: whether it shows by itself why it was stopped, where no card beside it does;
    # remember: under which name the browser stores what is in sight and what is switched on, apart for each model,
    # until its tab is closed; "" or missing for not at all.
    options = traitlets.Dict({"bar": True, "keys": "", "toggles": {}}).tag(sync=True)
    selected = traitlets.Int(None, allow_none=True).tag(sync=True)
    # The last state at rest as the address of a PNG, in notebooks only: what a stored notebook shows without a kernel.
    picture = traitlets.Unicode("").tag(sync=True)

    def __init__(self, **traits: object) -> None:
        super().__init__(**traits)
        self.commands: dict[str, Callable] = {}  # called when a button or a key is pressed
        self.still: Callable[[], bytes] | None = None  # a PNG, for places that show no widgets
        self.caught_up: Callable[[], None] = lambda: None  # the browser has drawn all that it was sent
        self.clock: Callable[[], float] = time.monotonic
        self._lock = threading.RLock()
        self.traced: Callable[[bool], object] = lambda on: None  # views begin to need trails, or none does any more
        self._views: dict[str, CanvasView] = {}
        self._last_point: TrailPoint | None = None  # of the trails that were sent
        self._frame: PackedFrame | None = None
        self._beside: dict = {}
        self._state: dict = {}
        self._world: dict | None = None
        self._waits = False
        self._pushed = self._sent = 0  # the player's numbers, then this canvas's own
        self.on_msg(lambda _, message, __: self._hear(message))

    @property
    def ready(self) -> bool:
        """Whether a browser shows it, and all views that answer have room for another frame."""
        with self._lock:
            views = self._views.values()
            return self._some_have_room() and all(self._has_room(view) or self._is_late(view) for view in views)

    @property
    def draws_trails(self) -> bool:
        """Whether any view draws trails."""
        return any(view.trails for view in list(self._views.values()))

    def push(self, number: int, frame: PackedFrame, **beside: object) -> None:
        """Show a frame as soon as the browser has room, unless one of a higher number was received."""
        with self._lock:
            if number > self._pushed:
                self._pushed, self._frame, self._beside, self._waits = number, frame, beside, True
                self._send_frame()

    def show_state(self, **state: object) -> None:
        """Send the browser the fields that have changed (playing, speed, ...), and the number of the newest frame."""
        with self._lock:
            state["newest"] = self._pushed
            changed = {name: value for name, value in state.items() if self._state.get(name) != value}
            self._state |= changed
            if changed and self._views:
                self.send({"kind": "state", "state": changed})

    def _hear(self, message: dict) -> None:
        """Handle a message of the browser."""
        name, value, view = message.get("do"), message.get("value"), str(message.get("view", ""))
        if name == "ready":
            self._begin(view)
        elif name == "left":
            with self._lock:
                self._views.pop(view, None)
                self._send_frame()
            self.traced(self.draws_trails)
        elif name == "trails":
            with self._lock:
                if view in self._views:
                    self._views[view].trails = bool(value)
            self.traced(self.draws_trails)
        elif name == "drawn":
            if self._note_drawn(view, message["value"], message.get("each")):
                self.caught_up()
        elif name in self.commands:
            self.commands[name](*(() if value is None else (value,)))

    def _begin(self, view: str) -> None:
        """Send everything to a view that was just opened, and nothing of it to the others."""
        with self._lock:
            self._sent = max(self._sent, 1)
            self._views[view] = CanvasView(self._sent - 1, self.clock())
            self.send({"kind": "state", "state": self._state, "to": view})
            if self._frame is not None:
                self._waits = self._waits and len(self._views) > 1
                self._world = self._world or self._frame.world
                self.send({"kind": "world", "world": self._frame.world, "to": view})
                self._send_picture(self._frame, None, to=view)

    def _note_drawn(self, view: str, number: int, each: object) -> bool:
        """Note which frame a view has drawn, and send it the next one; return whether it has drawn all."""
        with self._lock:
            if view in self._views:
                drawn, rarely = max(self._views[view].drawn, number), min(each, MOST_EACH) if type(each) is int else 1
                self._views[view] = replace(self._views[view], drawn=drawn, since=self.clock(), each=max(1, rarely))
                self._send_frame()
            return view in self._views and self._views[view].drawn == self._sent

    def _has_room(self, view: CanvasView) -> bool:
        return self._sent - view.drawn < MOST_AHEAD + view.each - 1

    def _is_late(self, view: CanvasView) -> bool:
        return self.clock() - view.since > PATIENCE

    def _some_have_room(self) -> bool:
        return any(self._has_room(view) for view in self._views.values())

    def _send_frame(self) -> None:
        """Send all views the frame that waits; at rest none waits for another, since there may be no later occasion."""
        frame, at_rest = self._frame, self._beside.get("rest")
        if frame is None or not self._waits or not (self._some_have_room() if at_rest else self.ready):
            return
        self._waits = False
        if frame.world is not self._world:
            self._world, self._last_point = frame.world, None
            self.send({"kind": "world", "world": frame.world})
        now = self.clock()
        for view in self._views.values():
            if view.drawn == self._sent:
                view.since = now
        self._sent += 1
        self._send_picture(frame, self._last_point)
        self._last_point = frame.trail[-1] if frame.trail else None

    def _send_picture(self, frame: PackedFrame, last: TrailPoint | None, **only: str) -> None:
        """Send a picture to views that have the trails up to a point, None for no trails."""
        fields = {"step": frame.step, "readings": frame.readings, "fingerprint": frame.fingerprint}
        numbers, trail, buffers = {"number": self._sent, "pushed": self._pushed}, {}, [frame.content]
        if frame.trail and self.draws_trails:
            points, more = news(frame.trail, last)
            trail = {"trail": {"more": more, "steps": [point.step for point in points]}}
            trail["trail"]["moved"] = [point.moved for point in points]
            buffers.append(packed_points(points, frame.world["bounds"]))
        self.send({"kind": "picture", **numbers, **fields, **trail, **self._beside, **only}, buffers)

    def _repr_mimebundle_(self, **wanted: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]] | None:
        """Return the widget, and a PNG for places that show no widgets."""
        bundle = super()._repr_mimebundle_(**wanted)
        if bundle is not None and self.still is not None:
            bundle[0]["image/png"] = self.still()
        return bundle


class Connection:
    """Shows a player on a canvas, whose buttons control it; of a pair only the buttons, and no robot is selected."""

    def __init__(self, canvas: SwarmCanvas, player: Played, reset: Callable[[], None] | None = None) -> None:
        self.canvas, self.player, self._reset = canvas, player, reset
        canvas.commands = {name: getattr(player, name) for name in ("toggle", "play", "pause", "step", "back")}
        canvas.commands |= {"look": player.look, "speed": lambda index: player.set_speed(SPEEDS[index])}
        if reset is not None:
            canvas.commands["reset"] = reset
        self._leaves = [player.changed.add(self.send_state)]
        if isinstance(player, Player):
            canvas.traced = partial(player.trace, self)
            self._let_select(player)
        self.send_state()
        player.add_viewer(self, first=True)

    @property
    def ready(self) -> bool:
        """Whether the canvas has room for another frame."""
        return self.canvas.ready

    def push(self, number: int, frame: PackedFrame) -> None:
        """Send a frame, with the achieved rate and the extent of the past."""
        player = self.player
        rate, rest = rate_text(player.loop.rate), not player.playing
        self.canvas.push(number, frame, rate=rate, rest=rest, **extent_of(player.past))

    def send_state(self) -> None:
        """Send whether it is played, and how fast."""
        player = self.player
        self.canvas.show_state(
            playing=player.playing,
            finished=player.finished,
            error=player.error,
            speed=nearest_speed(player.loop.speed),
            speeds=[speed_text(speed) for speed in SPEEDS],
            can_reset=self._reset is not None,
            waits=bool(player.waiting),
        )

    def close(self) -> None:
        """Disconnect them."""
        self.canvas.commands, self.canvas.traced = {}, lambda on: None
        for leave in self._leaves:
            leave()
        self.canvas.unobserve_all("selected")
        self.player.remove_viewer(self)

    def _let_select(self, player: Player) -> None:
        def show_selection() -> None:
            self.canvas.selected = player.selected

        self._leaves.append(player.selection.add(show_selection))
        self.canvas.observe(lambda change: player.select(change["new"]), "selected")
        show_selection()


@solara.component
def PlayerView(player: Played, reset: Callable[[], None], options: dict = ON_A_PAGE) -> None:
    """Show a player on a canvas with buttons, and pause it when the canvas is removed."""
    canvas = SwarmCanvas.element(options=options)

    def connect() -> Callable[[], None]:
        connection = Connection(solara.get_widget(canvas), player, reset)

        def part() -> None:
            player.pause()
            connection.close()

        return part

    solara.use_effect(connect, [])


def extent_of(past: Past) -> dict[str, int]:
    """Return the extent of the time line."""
    return {"index": past.index, "length": len(past), "first": past.first_step, "last": past.last_step}


def nearest_speed(speed: float) -> int:
    """Return the index in `SPEEDS` of the slowest one that is not slower."""
    return next(index for index, one in enumerate(SPEEDS) if one >= speed)


def speed_text(speed: float) -> str:
    """Return a speed in words."""
    return "as fast as it goes" if speed == AS_FAST_AS_IT_GOES else f"{speed:,g} steps/s"


def rate_text(rate: float) -> str:
    """Return an achieved rate in words."""
    if rate == 0.0:
        return "at rest"
    return f"{rate:.2g}" if rate < 10 else f"{rate:,.0f}"


class Watcher(Observer):
    """Shows steps of a player's model that a program takes, not those of the player itself.

    While a cell is executed the browser cannot report what it has drawn; the last step is shown afterwards.
    """

    def __init__(self, player: Player) -> None:
        self._player = player
        self._model: EngineModel | None = None
        self._shown = 0.0
        player.changed.add(self.follow)
        self.follow()

    def follow(self) -> None:
        """Watch the present model of the player, and not the one before."""
        model = self._player.model
        if model is self._model:
            return
        if self._model is not None and self in self._model.observers:
            self._model.observers.remove(self)
        if model is not None:
            model.observers.append(self)
        self._model = model

    def after_step(self, model: EngineModel, step: int) -> None:
        """Show the step, unless one was shown just now."""
        now = time.perf_counter()
        if not self._player.stepping and now - self._shown >= EVERY:
            self._shown = now
            self._player.show()

    def catch_up(self) -> None:
        """Show the last step, if it was not."""
        player = self._player
        is_behind = player.model is not None and player.model.completed != player.past.last_step
        if is_behind and player.past.is_present and not player.playing:
            player.rest()


@dataclass(frozen=True, kw_only=True, slots=True)
class Beside:
    """What stands beside the canvas: controls and charts all, none or those of these names; the inspector; Reset."""

    controls: bool | Sequence[str] = False
    charts: bool | Sequence[str] = False
    inspector: bool = False
    reset: bool = False

    def __post_init__(self) -> None:
        for name in ("controls", "charts"):
            value = getattr(self, name)
            names = not isinstance(value, (bool, str)) and isinstance(value, Sequence)
            if not isinstance(value, bool) and not (names and all(isinstance(one, str) for one in value)):
                raise InvalidValueError(f"{name} is {shortened(value)}; expected True, False or a list of names")

    def __bool__(self) -> bool:
        """Whether there is anything."""
        return bool(self.controls or self.charts or self.inspector or self.reset)


def show_canvas(model: EngineModel, *, speed: float = 60.0, width: int | None = None, height: int = 560) -> SwarmCanvas:
    """Return a widget on which a model is seen and played; see `SwarmModel.show`."""
    canvas = SwarmCanvas(options=IN_A_NOTEBOOK)
    give_size(canvas, width, height)
    show_on(canvas, Player(model), speed)
    return canvas


def show_on(canvas: SwarmCanvas, player: Player, speed: float, reset: Callable[[], None] | None = None) -> None:
    """Show a player on a canvas of a notebook, with steps that a program takes, and a picture where no widget works."""
    player.set_speed(check_number("speed", speed, above=0, maximum=1000))
    Connection(canvas, player, reset)
    canvas.caught_up = Watcher(player).catch_up
    LastPicture(canvas, player)


def give_size(widget: anywidget.AnyWidget, width: int | None, height: int) -> None:
    """Give a widget its size, CSS pixels; by default it is as wide as its cell, and it is never wider."""
    widget.layout.height = f"{check_count('height', height, minimum=100, maximum=10_000)}px"
    widget.layout.max_width = "100%"
    if width is not None:
        widget.layout.width = f"{check_count('width', width, minimum=200, maximum=10_000)}px"


@solara.component
def _WorldView(model: EngineModel, occasion: object) -> None:
    element = SwarmCanvas.element(options={"bar": False, "keys": "", "toggles": {}, "errors": True})
    player = solara.use_memo(lambda: Player(model), [model])
    solara.use_effect(lambda: Connection(solara.get_widget(element), player).close, [player])
    solara.use_effect(player.show, [occasion])


def swarm_canvas(model: EngineModel) -> Element:
    """Return the canvas of a model, as a component of Mesa's `SolaraViz`.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> swarm_canvas(SwarmModel(rng=1)).component.name  # as in SolaraViz(model, components=[swarm_canvas])
    '_WorldView'
    """
    return _WorldView(model, occasion=object())
