"""The inspector: one robot closely, with its readings on its own sensor diagram."""

import time
from typing import Any

import anywidget
import solara
import traitlets

from mesa_swarm.dashboard.inspection import inspect, move, neighbour_of, robot_of
from mesa_swarm.dashboard.session import Session
from mesa_swarm.errors import InvalidValueError, in_words
from mesa_swarm.viewing.canvas_widget import text_of
from mesa_swarm.viewing.player import PackedFrame

# While it is played, the inspector is brought up to date so often, s.
EVERY = 0.2


class Inspector(anywidget.AnyWidget):
    """One robot's readings, layer, reason and pose, drawn in the browser.

    Attributes
    ----------
    told : dict
        What `inspection.inspect` says of the robot; empty if none is selected.
    editable : bool
        Whether the robot may be moved now.
    fault : str
        Why it could not be moved.
    """

    _esm = text_of("viewing/elements.js", "dashboard/inspector.js")
    told = traitlets.Dict().tag(sync=True)
    editable = traitlets.Bool(False).tag(sync=True)
    fault = traitlets.Unicode("").tag(sync=True)


class Inspecting:
    """Lets an inspector show the robot that is selected in a session.

    Parameters
    ----------
    inspector : Inspector
    session : Session
    """

    ready = False  # looking closely is no reason to make a picture

    def __init__(self, inspector: Inspector, session: Session) -> None:
        self.inspector, self.session = inspector, session
        self._shown = 0.0
        self._leaves = [session.selection.add(self.select), session.changed.add(self.refresh)]
        inspector.on_msg(self._hear)
        session.add_viewer(self)

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show what is known in the step that is shown, if it is time."""
        if not self.session.playing or time.monotonic() - self._shown >= EVERY:
            self.refresh()

    def select(self) -> None:
        """Show another robot."""
        self.inspector.fault = ""
        self.refresh()

    def refresh(self) -> None:
        """Show what is known now."""
        self._shown = time.monotonic()
        with self.session.lock:
            told = self._known()
            editable = bool(told) and self._may_move()
        with self.inspector.hold_sync():
            self.inspector.told, self.inspector.editable = told, editable
            if not editable:
                self.inspector.fault = ""

    def act(self, message: dict) -> None:
        """Do what the browser asks for."""
        session, value = self.session, message.get("value")
        match message.get("do"):
            case "next" | "previous" if session.model is not None:
                by = 1 if message["do"] == "next" else -1
                session.select(neighbour_of(session.model, session.selected, by))
            case "select":
                self._select(value)
            case "move":
                self._move(message["value"])

    def close(self) -> None:
        """Part them."""
        for leave in self._leaves:
            leave()
        self.session.remove_viewer(self)
        self.inspector.on_msg(self._hear, remove=True)

    def _hear(self, _: object, message: dict, __: list) -> None:
        self.act(message)

    def _known(self) -> dict[str, Any]:
        """Return what is known of the robot in the step that is looked at, nothing if none is selected."""
        model, shown = self.session.model, self.session.past.shown
        if model is None or shown is None:
            return {}
        robot = robot_of(model, self.session.selected)
        return {} if robot is None else inspect(model, robot, shown.step)

    def _may_move(self) -> bool:
        session = self.session
        return not session.playing and session.past.is_present and not session.error

    def _select(self, number: int | None) -> None:
        session = self.session
        if number is not None and (session.model is None or robot_of(session.model, number) is None):
            ids = [robot.unique_id for robot in session.model.swarm.agents] if session.model else []
            there = f"expected one from {ids[0]} to {ids[-1]}" if ids else "there are none"
            self.inspector.fault = f"there is no robot {number}; {there}"
            return
        session.select(number)

    def _move(self, pose: dict[str, float | str | None]) -> None:
        """Move the robot, or say why that cannot be; from then on the run is not the one that its link tells of."""
        session = self.session
        try:
            with session.lock:
                if not self._may_move():
                    raise InvalidValueError("a robot is moved while the run is paused in the present; pause first")
                model = session.model
                robot = None if model is None else robot_of(model, session.selected)
                if model is None or robot is None:
                    raise InvalidValueError(f"there is no robot {session.selected}; select one")
                move(model, robot, pose.get("x"), pose.get("y"), pose.get("heading"))
                session.straight = False
        except Exception as problem:  # whatever was typed is answered beside it
            self.inspector.fault = in_words(problem)
            return
        self.inspector.fault = ""
        session.retake()


@solara.component
def InspectorView(session: Session) -> None:
    """Show the robot that is selected."""
    inspector = Inspector.element()
    solara.use_effect(lambda: Inspecting(solara.get_widget(inspector), session).close, [])
