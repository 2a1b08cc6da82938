"""The last picture of a model in a notebook, which is stored with the notebook and shown where there is no kernel."""

import asyncio
import sys
from base64 import b64encode
from collections.abc import Callable
from typing import Any, Protocol

from mesa_swarm.viewing.pictures import DOTS_PER_INCH, png, world_figure
from mesa_swarm.viewing.player import PackedFrame, Player

# Characters of a stored picture, and the resolutions that are tried one after the other.
MOST_CHARACTERS = 300_000
RESOLUTIONS = (DOTS_PER_INCH, 100, 50, 25)
# How long a model is at rest before it is drawn, s: between two clicks on Step nothing is drawn.
DELAY = 1.0


class Pictured(Protocol):
    """A widget, and a picture that stands in for it."""

    picture: str
    still: Callable[[], bytes] | None
    comm: Any


class LastPicture:
    """Draws a player's model at rest, for places that cannot show its widget.

    It is a viewer of the player, and draws in the thread that executes cells, where no program changes the model
    meanwhile: a moment after the last button was pressed, and at the end of each cell that took steps. While the model
    is played, and before the widget is displayed, nothing is drawn or stored.
    """

    ready = False  # it needs no frames

    def __init__(self, canvas: Pictured, player: Player) -> None:
        self.canvas, self.player = canvas, player
        self._drawn: tuple | None = None  # the state that was drawn last, None before the widget is displayed
        self._due: asyncio.TimerHandle | None = None
        self._loop = running_loop()
        self._shell: Any = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
        canvas.still = self.still
        if self._shell is not None:
            self._shell.events.register("post_run_cell", self.after_cell)
        player.add_viewer(self)

    def push(self, number: int, frame: PackedFrame) -> None:
        """Draw the model in a moment, unless it goes on before."""
        if self._loop is not None and self._drawn and not self.player.playing and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._postpone)

    def still(self) -> bytes:
        """Return a PNG of the model as it is, and store it in the widget."""
        with self.player.lock:
            self._drawn = self._state()
            figure = world_figure({"": self.player.model} if self.player.model is not None else {})
            whole = content = png(figure)
            for dots in RESOLUTIONS[1:]:
                if len(png_address(content)) <= MOST_CHARACTERS:
                    break
                content = png(figure, dots)
        self.canvas.picture = png_address(content) if len(png_address(content)) <= MOST_CHARACTERS else ""
        return whole

    def after_cell(self, result: object = None) -> None:
        """Draw what the cell has changed; called by IPython."""
        if self.canvas.comm is None:  # the widget was closed
            self._shell.events.unregister("post_run_cell", self.after_cell)
        else:
            self.draw()

    def draw(self) -> None:
        """Store a picture of the model, if it is at rest and has changed since the last one."""
        player = self.player
        if self._drawn and not player.playing and not player.error and self._drawn != self._state():
            self.still()

    def _state(self) -> tuple:
        model = self.player.model
        return id(model), "" if model is None else model.state_hash()

    def _postpone(self) -> None:
        if self._due is not None:
            self._due.cancel()
        self._due = asyncio.get_running_loop().call_later(DELAY, self.draw)


def png_address(content: bytes) -> str:
    """Return a PNG as an address that needs no file."""
    return f"data:image/png;base64,{b64encode(content).decode()}"


def running_loop() -> asyncio.AbstractEventLoop | None:
    """Return the event loop that executes cells, None outside notebooks."""
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None
