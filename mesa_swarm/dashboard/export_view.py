"""Export from the page: what to make of the run, how far it is, and the switch that records."""

import threading
import time
from typing import Any

import anywidget
import solara
import traitlets

from mesa_swarm.dashboard.exporting import KINDS, PICTURES, Exporting
from mesa_swarm.dashboard.session import Session
from mesa_swarm.dashboard.widgets import Downloads
from mesa_swarm.viewing.canvas_widget import text_of
from mesa_swarm.viewing.player import PackedFrame

# Progress, and what was recorded, are told so often, s.
EVERY = 0.25


class Exporter(anywidget.AnyWidget):
    """Lists, a button and a bar in the browser.

    Attributes
    ----------
    kinds : list of [str, str, bool]
        What Python can make: key, label, and whether it is of the whole run.
    told : dict
        How things are.
    """

    _esm = text_of("viewing/elements.js", "dashboard/downloads.js", "dashboard/exporter.js")
    kinds: traitlets.List[list[str | bool]] = traitlets.List().tag(sync=True)
    told = traitlets.Dict().tag(sync=True)


class ExportDesk:
    """Lets an exporter show what a session's `Exporting` does, and start it.

    Parameters
    ----------
    exporter : Exporter
    session : Session
    """

    ready = False  # files are no reason to make a picture

    def __init__(self, exporter: Exporter, session: Session) -> None:
        self.exporter, self.session = exporter, session
        self._downloads = Downloads(exporter)
        self._lock = threading.Lock()
        self._told = 0.0
        self._doing = ""
        self.exporting = session.companion(Exporting)
        self.exporting.connect(self._downloads.send, self.tell)
        self._leave = session.changed.add(self.refresh)
        exporter.on_msg(self._hear)
        self.refresh()
        session.add_viewer(self)

    def refresh(self) -> None:
        """Show how things are; a recording of another model has ended."""
        self.exporting.check_tape()
        model = self.session.model
        burns = model is not None and len(model.fires) > 0
        made = {key: label for key, label in KINDS.items() if burns or "fires" not in key}
        kinds: list[list[str | bool]] = [[key, label, key not in PICTURES] for key, label in made.items()]
        if self.exporter.kinds != kinds:
            self.exporter.kinds = kinds
        self._show()

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show how much was recorded, if it is time."""
        if not self.session.playing or time.monotonic() - self._told >= EVERY:
            self._show()

    def tell(self) -> None:
        """Show what is being made, now and then while that goes on."""
        if self.exporting.doing != self._doing or time.monotonic() - self._told >= EVERY:
            self._show()

    def act(self, message: dict) -> None:
        """Do what the browser asks for."""
        match message.get("do"):
            case "record":
                self.exporting.record(bool(message.get("value")))
                self._show()
            case "export":
                self.exporting.start(**message["value"])
                self._show()
            case "cancel":
                self.exporting.cancel()
            case _:
                self._downloads.hear(message)

    def close(self) -> None:
        """Part them; what is recorded or made goes on."""
        self._leave()
        self.session.remove_viewer(self)
        self.exporter.on_msg(self._hear, remove=True)
        self.exporting.disconnect()
        self._downloads.close()

    def _hear(self, _: object, message: dict, __: list) -> None:
        self.act(message)

    def _show(self) -> None:
        with self._lock:
            self._told, self._doing = time.monotonic(), self.exporting.doing
            told = told_of(self.exporting)
            if told != self.exporter.told:
                self.exporter.told = told


def told_of(exporting: Exporting) -> dict[str, Any]:
    """Return how things are, as the browser wants it."""
    session, tape = exporting.session, exporting.tape
    model = session.model
    steps = model.completed if model is not None else 0
    return {
        "name": session.name,
        "steps": steps if session.straight else 0,
        "straight": session.straight,
        "recording": tape.running,
        "recorded": tape.words,
        "ended": tape.ended,
        "doing": exporting.doing,
        "progress": exporting.progress,
        "message": exporting.message,
        "fault": exporting.fault,
    }


@solara.component
def ExportView(session: Session) -> None:
    """Show what can be made of the run."""
    exporter = Exporter.element()
    solara.use_effect(lambda: ExportDesk(solara.get_widget(exporter), session).close, [])
