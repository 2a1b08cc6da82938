"""The canvas as a widget: in notebooks, on Mesa's page and on the dashboard."""

import threading
import time
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import anywidget
import solara
import traitlets
from reacton.core import Element

from mesa_swarm.errors import check_count, check_number
from mesa_swarm.fire.model import FireModel
from mesa_swarm.model import Observer
from mesa_swarm.viewing.pictures import png, world_figure
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES
from mesa_swarm.viewing.player import Past, Picture, Played, Player
from mesa_swarm.viewing.portrait import portrait_of


def text_of(*names: str) -> str:
    """Return files of the package, one after the other: a widget is one module.

    Parameters
    ----------
    *names : str

    Examples
    --------
    >>> text_of("viewing/elements.js", "dashboard/panel.js").count("export default")
    1
    """
    here = files("mesa_swarm")
    return "".join((here / name).read_text(encoding="utf-8") for name in names)


# Pictures on their way to the browser: one is drawn while the next is made.
MOST_AHEAD = 2
SPEEDS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 250.0, 500.0, 1000.0, AS_FAST_AS_IT_GOES)


def script() -> str:
    """Return the widget's one module: the canvas, and what stands around it.

    Examples
    --------
    >>> "export default" in script()
    True
    """
    return text_of("viewing/canvas.js", "viewing/elements.js", "viewing/widget.js")


class SwarmCanvas(anywidget.AnyWidget):
    """A world drawn in the browser, picture after picture.

    Pictures are numbered when they are sent, and the browser says which one it has drawn: no more than
    `MOST_AHEAD` are on their way, and of those that wait only the latest is kept.

    Parameters
    ----------
    options : dict
        ``bar``: whether there are buttons; ``keys``: "page" where keys pressed anywhere play and step, "own"
        where only those pressed in the widget do, "" for none; ``toggles``: what is drawn, by name; ``head``:
        whether a caption and the readings stand above it; ``stage``: False for buttons without a picture.
    selected : int or None
        Id of the robot that is marked.

    Attributes
    ----------
    commands : dict
        What is called, by name, when a button or a key is pressed.
    still : function or None
        Returns a PNG, for places where no widget can live.
    caught_up : function
        Called when the browser has drawn what it was sent.

    Examples
    --------
    >>> canvas = SwarmCanvas()
    >>> canvas.ready, canvas.selected
    (False, None)
    """

    _esm = script()
    _css = text_of("viewing/widget.css")
    options = traitlets.Dict({"bar": True, "keys": "", "toggles": {}}).tag(sync=True)
    selected = traitlets.Int(None, allow_none=True).tag(sync=True)

    def __init__(self, **traits: object) -> None:
        super().__init__(**traits)
        self.commands: dict[str, Callable] = {}
        self.still: Callable[[], bytes] | None = None
        self.caught_up: Callable[[], None] = lambda: None
        self._lock = threading.RLock()
        self._picture: Picture | None = None
        self._beside: dict = {}
        self._state: dict = {}
        self._world: dict | None = None
        self._seen = self._waits = False
        self._pushed = self._sent = self._drawn = 0  # the player's numbers, then this canvas's own
        self.on_msg(lambda _, message, __: self._hear(message))

    @property
    def ready(self) -> bool:
        """Whether a browser shows it and has room for another picture."""
        return self._seen and self._sent - self._drawn < MOST_AHEAD

    def push(self, number: int, picture: Picture, **beside: object) -> None:
        """Show a picture as soon as the browser has room, unless it was given one of a higher number.

        Parameters
        ----------
        number : int
        picture : Picture
        **beside
            What else is told with it.
        """
        with self._lock:
            if number > self._pushed:
                self._pushed, self._picture, self._beside, self._waits = number, picture, beside, True
                self._send_picture()

    def tell(self, **state: object) -> None:
        """Tell the browser whether it is played, how fast, and the like, and which picture belongs to that."""
        with self._lock:
            state["newest"] = self._pushed
            changed = {name: value for name, value in state.items() if self._state.get(name) != value}
            self._state |= changed
            if changed and self._seen:
                self.send({"kind": "state", "state": changed})

    def _hear(self, message: dict) -> None:
        """Do what the browser asks for."""
        name, value = message.get("do"), message.get("value")
        if name == "ready":
            self._begin()
        elif name == "drawn":
            with self._lock:
                self._drawn = max(self._drawn, message["value"])
                self._send_picture()
            if self._drawn == self._sent:
                self.caught_up()
        elif name in self.commands:
            self.commands[name](*(() if value is None else (value,)))

    def _begin(self) -> None:
        """Tell a view that has just been opened all that it must know."""
        with self._lock:
            self._seen, self._drawn, self._world = True, self._sent, None
            self._waits = self._picture is not None
            self.send({"kind": "state", "state": self._state})
            self._send_picture()

    def _send_picture(self) -> None:
        picture = self._picture
        if picture is None or not self._waits or not self.ready:
            return
        self._waits = False
        if picture.world is not self._world:
            self._world = picture.world
            self.send({"kind": "world", "world": picture.world})
        self._sent += 1
        told = {"step": picture.step, "readings": picture.readings, "fingerprint": picture.fingerprint}
        numbers = {"number": self._sent, "pushed": self._pushed}
        self.send({"kind": "picture", **numbers, **told, **self._beside}, [picture.frame])

    def _repr_mimebundle_(self, **wanted: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]] | None:
        """Return the widget, and beside it a picture."""
        bundle = super()._repr_mimebundle_(**wanted)
        if bundle is not None and self.still is not None:
            bundle[0]["image/png"] = self.still()
        return bundle


class Connection:
    """Lets a canvas show a player, and the canvas's buttons play it.

    Parameters
    ----------
    canvas : SwarmCanvas
    player : Played
        Of a pair only the buttons are shown: there is no robot to select.
    reset : function, optional
        What the button of this name does; without, there is none.
    """

    def __init__(self, canvas: SwarmCanvas, player: Played, reset: Callable[[], None] | None = None) -> None:
        self.canvas, self.player, self._reset = canvas, player, reset
        canvas.commands = {name: getattr(player, name) for name in ("toggle", "play", "pause", "step", "back")}
        canvas.commands |= {"look": player.look, "speed": lambda index: player.set_speed(SPEEDS[index])}
        if reset is not None:
            canvas.commands["reset"] = reset
        self._leaves = [player.changed.add(self.tell)]
        if isinstance(player, Player):
            self._let_select(player)
        self.tell()
        player.add_viewer(self)

    @property
    def ready(self) -> bool:
        """Whether the canvas has room for another picture."""
        return self.canvas.ready

    def push(self, number: int, picture: Picture) -> None:
        """Hand a picture on, with what the player says of itself."""
        player = self.player
        rate, rest = rate_text(player.loop.rate), not player.playing
        self.canvas.push(number, picture, rate=rate, rest=rest, **extent_of(player.past))

    def tell(self) -> None:
        """Hand on whether it is played, and how fast."""
        player = self.player
        self.canvas.tell(
            playing=player.playing,
            finished=player.finished,
            error=player.error,
            speed=nearest_speed(player.loop.speed),
            speeds=[speed_text(speed) for speed in SPEEDS],
            can_reset=self._reset is not None,
        )

    def close(self) -> None:
        """Part them."""
        self.canvas.commands = {}
        for leave in self._leaves:
            leave()
        self.canvas.unobserve_all("selected")
        self.player.remove_viewer(self)

    def _let_select(self, player: Player) -> None:
        def mark() -> None:
            self.canvas.selected = player.selected

        self._leaves.append(player.selection.add(mark))
        self.canvas.observe(lambda change: player.select(change["new"]), "selected")
        mark()


def use_connection(canvas: Element, player: Played, reset: Callable[[], None]) -> None:
    """Let a canvas of a Solara page show a player while it stands there, and pause it after that."""

    def connect() -> Callable[[], None]:
        connection = Connection(solara.get_widget(canvas), player, reset)

        def part() -> None:
            player.pause()
            connection.close()

        return part

    solara.use_effect(connect, [])


def extent_of(past: Past) -> dict[str, int]:
    """Return what the time line is told of the pictures that one can go back to."""
    return {"index": past.index, "length": len(past), "first": past.first_step, "last": past.last_step}


def nearest_speed(speed: float) -> int:
    """Return the index in `SPEEDS` of the slowest one that is not slower.

    Examples
    --------
    >>> SPEEDS[nearest_speed(55)]
    60.0
    """
    return next(index for index, one in enumerate(SPEEDS) if one >= speed)


def speed_text(speed: float) -> str:
    """Return a speed in words.

    Examples
    --------
    >>> speed_text(0.5), speed_text(AS_FAST_AS_IT_GOES)
    ('0.5 steps/s', 'as fast as it goes')
    """
    return "as fast as it goes" if speed == AS_FAST_AS_IT_GOES else f"{speed:,g} steps/s"


def rate_text(rate: float) -> str:
    """Return an achieved rate in words.

    Examples
    --------
    >>> rate_text(0.0), rate_text(0.512), rate_text(1234.5)
    ('at rest', '0.51', '1,234')
    """
    if rate == 0.0:
        return "at rest"
    return f"{rate:.2g}" if rate < 10 else f"{rate:,.0f}"


# Steps that a program takes are shown so often, s.
EVERY = 0.05


class Watcher(Observer):
    """Shows steps that a program takes, not those of the player itself.

    While a cell is executed the browser cannot say what it has drawn: the last step is shown when it can.
    """

    def __init__(self, player: Player) -> None:
        self._player = player
        self._shown = 0.0

    def after_step(self, model: FireModel, step: int) -> None:
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


def show(model: FireModel, *, speed: float = 60.0, height: int = 560) -> SwarmCanvas:
    """Return a widget on which a model is seen and played; see `SwarmModel.show`."""
    player = Player(model)
    player.loop.speed = check_number("speed", speed, above=0, maximum=1000)
    canvas = SwarmCanvas(options={"bar": True, "keys": "own", "toggles": {}})
    canvas.layout.height = f"{check_count('height', height, minimum=100, maximum=10_000)}px"
    canvas.still = lambda: png(world_figure({"": portrait_of(model)}))
    Connection(canvas, player)
    watcher = Watcher(player)
    canvas.caught_up = watcher.catch_up
    model.observers.append(watcher)
    return canvas


@solara.component
def _WorldView(model: FireModel, occasion: object) -> None:
    element = SwarmCanvas.element(options={"bar": False, "keys": "", "toggles": {}})
    player = solara.use_memo(lambda: Player(model), [model])
    solara.use_effect(lambda: Connection(solara.get_widget(element), player).close, [player])
    solara.use_effect(player.show, [occasion])


def swarm_canvas(model: FireModel) -> Element:
    """Return the canvas of a model, as a component of Mesa's `SolaraViz`.

    Parameters
    ----------
    model : SwarmModel

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> swarm_canvas(SwarmModel(rng=1)).component.name  # as in SolaraViz(model, components=[swarm_canvas])
    '_WorldView'
    """
    return _WorldView(model, occasion=object())
