"""Changing the world by mouse and keyboard: the tools beside the canvas, undo, and the map as a file."""

import threading
from collections.abc import Callable, Sequence

import anywidget
import numpy as np
import traitlets

from mesa_swarm.base.errors import InvalidValueError, check_choice
from mesa_swarm.dashboard.page.edits import EDITS, SET, Edit, find_thing_at
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import Link, view_script
from mesa_swarm.fire.fires import Fire
from mesa_swarm.maps.map import FireSpot, Map
from mesa_swarm.robots.robot import Robot
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing import palette
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.world.bodies import Body, Load

DRAWN = "drawn"
# What a change is called where it is undone.
WORDS = {
    "move": "move", "robot": "new robot", "wall": "wall", "obstacle": "disc", "load": "body to push", "fire": "fire",
    "switch": "fire put out or lit", "remove": "removal", "clear": "removal of all obstacles",
}  # fmt: skip


# Changes that are listed, the latest ones.
MOST_LISTED = 20


def describe_edit(edit: Edit) -> str:
    """Return a change by hand in a few words.

    Examples
    --------
    >>> describe_edit(Edit(20, "set", ("noise", "0.3"))), describe_edit(Edit(30, "wall", (1.0, 2.0, 30.0, 40.0, 5.0)))
    ('step 20: noise = 0.3', 'step 30: wall')
    """
    pairs = zip(edit.values[::2], edit.values[1::2], strict=False)
    what = ", ".join(f"{name} = {value}" for name, value in pairs) if edit.do == SET else WORDS[edit.do]
    return f"step {edit.step:,}: {what}"


class Editor(anywidget.AnyWidget):
    """The tools in the browser."""

    _esm = palette.palette_script() + view_script("dashboard/run/editor.js")
    # What undo would do, why the last change was refused, how many there were, whether the model takes a map.
    status = traitlets.Dict().tag(sync=True)


class Editing(Link):
    """Connects the tools and a session."""

    def __init__(self, editor: Editor, session: Session) -> None:
        self.editor, self.session = editor, session
        self._fault = ""
        self._dragged: Dragging | None = None
        self.connect(editor, session.changed.add(self.refresh))
        self.refresh()

    def refresh(self) -> None:
        """Show what can be undone, and the last fault."""
        before = self.session.undoable
        undo = f"Undo: {WORDS[before.do]}, back to step {before.step:,}" if before else ""
        self.editor.status = {
            "undo": undo,
            "fault": self._fault,
            "edits": [describe_edit(edit) for edit in self.session.edits[-MOST_LISTED:]],
            "takes_map": "map" in self.session.parameters,
        }

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser, or show why not."""
        acts: dict[str, Callable[[dict], object]] = {
            "use": lambda edit: self.use(str(edit["tool"]), edit["values"], edit.get("near", 0.0), edit.get("like")),
            "grab": lambda edit: self.grab(edit["values"][0], edit["values"][1], edit.get("near", 0.0)),
            "drag": lambda edit: self.drag(*edit["values"]),
            "drop": lambda edit: self.drop(*edit["values"]),
            "clear": lambda _: self.session.edit("clear"),
            "undo": lambda _: self.session.undo(),
            "save": lambda edit: self.save(str(edit["value"])),
            "apply": lambda _: self.session.take_map(edited_map(self._model, DRAWN)),
        }
        try:
            acts[check_choice("message", message.get("do"), acts)](message)
            self._fault = ""
        except Exception as problem:  # shown beside the tools
            self._fault = reported(problem)
        self.refresh()

    @property
    def _model(self) -> SwarmModel:
        if self.session.model is None:
            raise InvalidValueError("there is no model to change; press Reset first")
        return self.session.model

    def use(self, tool: str, values: Sequence[float], near: float = 0.0, like: float | None = None) -> None:
        """Use a tool at a place: the first two values."""
        session, (x, y, *more) = self.session, map(float, values)
        with session.lock:
            there = find_thing_at(self._model, x, y, near)
        if tool == "erase":
            session.edit("remove", _find_thing(there, x, y).unique_id)
        elif tool == "move":
            self._move(_find_thing(there, x, y), *more)
        elif tool == "fire" and isinstance(there, Fire):
            session.edit("switch", there.unique_id)
        elif tool == "robot":
            session.edit("robot", x, y, *more, -1.0 if like is None else like)
        else:
            session.edit(check_choice("tool", tool, tuple(EDITS)), x, y, *more)

    def grab(self, x: float, y: float, near: float = 0.0) -> None:
        """Begin to drag what is at a place; the run waits meanwhile."""
        with self.session.lock:
            target = find_thing_at(self._model, x, y, near)
        if target is not None:
            self._dragged = Dragging(self.session, target, x, y)

    def drag(self, x: float, y: float) -> None:
        """Drag on."""
        if self._dragged is not None:
            self._dragged.to(x, y)

    def drop(self, x: float, y: float) -> None:
        """End dragging."""
        dragged, self._dragged = self._dragged, None
        if dragged is not None:
            dragged.end(x, y)

    def save(self, kind: str) -> None:
        """Send the world as a map file: "toml" or "svg"."""
        with self.session.lock:
            chart = edited_map(self._model, DRAWN)
        text = chart.to_toml() if check_choice("kind", kind, ("toml", "svg")) == "toml" else chart.to_svg()
        threading.Thread(target=self.downloads.send, args=(f"{DRAWN}.{kind}", text.encode()), daemon=True).start()

    def _move(self, target: Robot | Body, x: float, y: float) -> None:
        self.session.edit("move", target.unique_id, x, y, _heading(target))


class Dragging:
    """Something that follows the pointer: robots and loads at once, others when they are dropped."""

    def __init__(self, session: Session, grabbed: Robot | Body, x: float, y: float) -> None:
        self._session, self._number, self._heading = session, grabbed.unique_id, _heading(grabbed)
        self._offset = np.subtract(grabbed.position, (x, y))
        self._at_once = isinstance(grabbed, Robot | Load)
        self._has_begun = False
        self._played = session.playing
        if self._played:
            session.pause()

    def to(self, x: float, y: float) -> None:
        """Follow the pointer to a place, if there is room."""
        if self._at_once:
            self._move(x, y)

    def end(self, x: float, y: float) -> None:
        """Move to the place, and let the run go on."""
        try:
            self._move(x, y)
        finally:
            if self._played:
                self._session.play()

    def _move(self, x: float, y: float) -> None:
        place = np.add(self._offset, (x, y)).tolist()
        self._session.edit("move", self._number, *place, self._heading, in_place=self._has_begun)
        self._has_begun = self._at_once


def _find_thing(there: Robot | Body | None, x: float, y: float) -> Robot | Body:
    if there is None:
        raise InvalidValueError(f"there is nothing at ({x:.4g}, {y:.4g}); choose a place on a robot, a fire or a body")
    return there


def _heading(of: Robot | Body) -> float:
    return float(of.pose[2] if isinstance(of, Load) else getattr(of, "heading", 0.0))


def edited_map(model: SwarmModel, name: str) -> Map:
    """Return the map of a model as it is now, with the obstacles and fires that were added, without loads and robots.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, disc
    >>> model = SwarmModel(map="openspace", rng=1)
    >>> added = model.add_obstacle(disc((400, 300), 20)), model.add_fire((100, 100), radius=10)
    >>> drawn = edited_map(model, "drawn")
    >>> len(drawn.obstacles) - len(model.map.obstacles), len(drawn.fires)
    (1, 1)
    """
    fires = tuple(
        FireSpot(position=tuple(fire.position.tolist()), radius=fire.radius, temperature=fire.temperature)
        for fire in model.fires.agents
        if not fire.out
    )
    obstacles = tuple(body.shape for body in model.obstacle_list if body.mode == "fixed")
    return Map(name=name, bounds=model.map.bounds, obstacles=obstacles, fires=fires)
