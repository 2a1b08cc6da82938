"""The canvas in notebooks, and on Mesa's own page."""

import time

import solara
from reacton.core import Element

from mesa_swarm.dashboard.canvas_widget import Connection, SwarmCanvas
from mesa_swarm.dashboard.player import Player
from mesa_swarm.errors import check_count, check_number
from mesa_swarm.experiments.pictures import png, world_figure
from mesa_swarm.experiments.portrait import portrait_of
from mesa_swarm.model import SwarmModel

# Steps that a program takes are shown so often, s.
EVERY = 0.05


class Watcher:
    """Shows steps that a program takes, not those of the player itself.

    While a cell is executed the browser cannot say what it has drawn: the last step is shown when it can.
    """

    def __init__(self, player: Player) -> None:
        self._player = player
        self._shown = 0.0

    def after_step(self, model: SwarmModel, step: int) -> None:
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

    def close(self) -> None:
        """Leave it as it is: there is nothing to close."""


def show(model: SwarmModel, *, speed: float = 60.0, height: int = 560) -> SwarmCanvas:
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
def _WorldView(model: SwarmModel, occasion: object) -> None:  # noqa: N802 - Solara's components are named like classes
    element = SwarmCanvas.element(options={"bar": False, "keys": "", "toggles": {}})
    player = solara.use_memo(lambda: Player(model), [model])
    solara.use_effect(lambda: Connection(solara.get_widget(element), player).close, [player])
    solara.use_effect(player.show, [occasion])


def swarm_canvas(model: SwarmModel) -> Element:
    """Return the canvas of a model, as a component of Mesa's `SolaraViz`.

    Parameters
    ----------
    model : SwarmModel

    Examples
    --------
    >>> swarm_canvas(SwarmModel(rng=1)).component.name  # as in SolaraViz(model, components=[swarm_canvas])
    '_WorldView'
    """
    return _WorldView(model, occasion=object())
