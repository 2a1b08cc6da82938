"""Parts of the page that all tabs use: buttons, links to widgets, downloads, uploads, folds; and the page's title."""

import threading
from collections.abc import Callable, Generator, Sequence
from functools import partial
from pathlib import Path, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import Any

import anywidget
import solara
import traitlets
from reacton import ipyvuetify as rv

from mesa_swarm.base.files import unwritable
from mesa_swarm.viewing import text_of
from mesa_swarm.viewing.player import PackedFrame, Played

# Most letters of the stored name, within the limits of file systems.
LONGEST_NAME = 60


def view_script(name: str) -> str:
    """Return the module of a widget: this script, and before it what all views share."""
    return text_of("viewing/elements.js", "dashboard/page/view.js", name)


@solara.component
def Button(
    label: str,
    act: Callable[[], object],
    class_: str = "",
    *,
    more: str = "",
    enabled: bool = True,
    pressed: bool | None = None,
    current: str = "",
) -> None:
    """Show a button; of a toggle, whether it is pressed; of one of several, ``aria-current`` if it is chosen."""
    about = {"type": "button"} | ({} if enabled else {"disabled": True})
    if current:
        about["aria-current"] = current
    if pressed is not None:
        about["aria-pressed"] = "true" if pressed else "false"
    children = [label, rv.Html(tag="small", children=[more])] if more else [label]
    button = rv.Html(tag="button", class_=class_, attributes=about, children=children)
    rv.use_event(button, "click", lambda *_: act())


@solara.component
def TroubleCard(title: str, *texts: str, way_out: tuple[str, Callable[[], object]] | None = None) -> None:
    """Show an error, and a button that resolves it."""
    with rv.Html(tag="section", class_="swarm-trouble", attributes={"role": "alert"}):
        if title:
            rv.Html(tag="h2", children=[title])
        for text in texts:
            rv.Html(tag="p", children=[text])
        if way_out:
            label, act = way_out
            solara.Button(label, act)


@solara.component
def Linked(widget: type[anywidget.AnyWidget], link: Callable[..., Any], *sources: object, **traits: object) -> None:
    """Show a widget, connected by a link until it is removed."""
    element = widget.element(**traits)
    solara.use_effect(lambda: link(solara.get_widget(element), *sources).close, [])


PIECE = 1_000_000
TYPES = {
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".gif": "image/gif",
    ".mp4": "video/mp4",
    ".html": "text/html",
    ".csv": "text/csv",
}


# Each piece with whether it is the last one.
Pieces = Generator[tuple[bytes, bool], None, None]


class Downloads:
    """Sends files in pieces, each when the browser requests it: the widget's view receives them (view.js)."""

    def __init__(self, widget: anywidget.AnyWidget) -> None:
        self._widget = widget
        self._lock = threading.Lock()
        self._open: dict[int, tuple[str, Pieces]] = {}
        self._number = 0

    def send(self, name: str, content: bytes | Path) -> None:
        """Send a file under a name."""
        with self._lock:
            self._number += 1
            number = self._number
            self._open[number] = name, pieces_of(content, PIECE)
        self.hear({"do": "more", "value": number})

    def hear(self, message: dict) -> bool:
        """Send the next piece, if the message requests it; return whether it does."""
        if message.get("do") != "more":
            return False
        with self._lock:
            number = message.get("value")
            if number not in self._open:
                return True
            name, pieces = self._open[number]
            piece, last = next(pieces)
            if last:
                pieces.close()
                del self._open[number]
        kind = TYPES.get(Path(name).suffix, "application/octet-stream")
        self._widget.send({"kind": "file", "number": number, "name": name, "type": kind, "last": last}, [piece])
        return True

    def close(self) -> None:
        """Release the pieces that were not requested."""
        with self._lock:
            for _, pieces in self._open.values():
                pieces.close()
            self._open.clear()


class Link:
    """Connects a widget and what it shows, until `close`: the browser's messages are passed to `act`, files are sent.

    As a viewer of what is played it needs no picture.
    """

    ready = False

    def connect(self, widget: anywidget.AnyWidget, *leave: Callable[[], None]) -> None:
        """Listen to a widget; what `leave` does is done at the end."""
        self._widget, self.downloads = widget, Downloads(widget)
        self._leave = [*leave, self.downloads.close]
        widget.on_msg(self._receive)

    def watch(self, player: Played) -> None:
        """Be a viewer of a player: its frames are pushed."""
        self._leave.append(partial(player.remove_viewer, self))
        player.add_viewer(self)

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show what goes with a frame, if an update is due."""

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""

    def close(self) -> None:
        """Disconnect."""
        for leave in self._leave:
            leave()
        self._widget.on_msg(self._receive, remove=True)

    def _receive(self, _: object, message: dict, buffers: Sequence) -> None:
        if not self.downloads.hear(message):
            self.act(message, buffers)


def pieces_of(content: bytes | Path, size: int) -> Pieces:
    """Yield the pieces of bytes or of a file, and whether each is the last one."""
    if isinstance(content, bytes):
        for start in range(0, max(len(content), 1), size):
            yield content[start : start + size], start + size >= len(content)
        return
    with content.open("rb") as file:
        piece = file.read(size)
        while True:
            following = file.read(size)
            yield piece, not following
            if not following:
                return
            piece = following


class FilePicker(anywidget.AnyWidget):
    """A button that opens the browser's choice of files."""

    _esm = """
    export default {
      render({ model, el }) {
        const file = document.createElement("input"), button = document.createElement("button");
        Object.assign(file, { type: "file", accept: model.get("accept"), hidden: true });
        file.setAttribute("aria-label", model.get("label"));
        Object.assign(button, { type: "button", textContent: model.get("label") });
        let chosen = null, from = 0;
        const next = async () => {
          const part = await chosen.slice(from, from + model.get("piece")).arrayBuffer();
          from += part.byteLength;
          model.send({ do: "piece", last: from >= chosen.size }, undefined, [part]);
        };
        const receive = (message) => chosen && (message.go ? next() : (chosen = null));
        button.addEventListener("click", () => file.click());
        file.addEventListener("change", () => {
          [chosen, from] = [file.files[0], 0];
          if (chosen) model.send({ do: "begin", name: chosen.name, size: chosen.size });
          file.value = "";
        });
        model.on("msg:custom", receive);
        el.append(file, button);
        return () => model.off("msg:custom", receive);
      },
    };
    """
    label = traitlets.Unicode("Upload").tag(sync=True)
    accept = traitlets.Unicode("").tag(sync=True)  # endings of names, in the format of HTML
    piece = traitlets.Int(PIECE).tag(sync=True)


class Incoming:
    """An uploaded file that arrives in pieces; it is stored under nearly the same name, since errors quote it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._folder = TemporaryDirectory(prefix="mesa_swarm_", ignore_cleanup_errors=True)
        self.path = Path(self._folder.name, harmless(name))
        self._file = self.path.open("wb", buffering=0)  # otherwise a full disk would be noticed only at the end

    def take(self, piece: bytes) -> int:
        """Take the next piece; return the number of bytes so far."""
        remaining = memoryview(piece)
        try:
            while remaining:
                remaining = remaining[self._file.write(remaining) :]
        except OSError as error:
            raise unwritable(Path(self.name), error, cure="the server's disk is full or broken") from None
        return self._file.tell()

    def end(self) -> None:
        """Note that all pieces have arrived."""
        self._file.close()

    def discard(self) -> None:
        """Delete the file, and its folder."""
        self.end()
        self._folder.cleanup()


def harmless(name: str) -> str:
    """Return a name that is safe in any file system."""
    letters = [letter if letter.isalnum() or letter in " ._-()" else "_" for letter in PureWindowsPath(name).name]
    return "".join(letters)[-LONGEST_NAME:].strip(" .") or "file"


LEFT, RIGHT = "left", "right"
PRODUCT = "mesa_swarm"


class ColumnFold(anywidget.AnyWidget):
    """A button between a column and the world that folds the column; the browser remembers it."""

    _esm = view_script("dashboard/page/layout.js")
    part = traitlets.Unicode("fold").tag(sync=True)
    side = traitlets.Unicode(LEFT).tag(sync=True)
    label = traitlets.Unicode("Settings").tag(sync=True)
    # Whether the column is folded at first where it stands below the world.
    folded_below = traitlets.Bool(False).tag(sync=True)


class ScreenButtons(anywidget.AnyWidget):
    """Buttons for the world alone on the screen, and for large type on a projector."""

    _esm = view_script("dashboard/page/layout.js")
    part = traitlets.Unicode("screen").tag(sync=True)


def page_title(name: str, tab: str, first: str) -> str:
    """Return the title of the page of one model and tab; the first tab needs no name."""
    return f"{name} - {PRODUCT}" if tab == first else f"{tab}: {name} - {PRODUCT}"
