"""The inspector: readings, layer, reason, messages and learned values of one robot, and moving it by hand."""

import math
import time
from collections.abc import Sequence
from typing import Any

import anywidget
import numpy as np
import traitlets

from mesa_swarm.base.errors import InvalidValueError, check_number
from mesa_swarm.control.explain import moment_of
from mesa_swarm.dashboard.page.robot_columns import column_title
from mesa_swarm.dashboard.page.series import find_collided
from mesa_swarm.dashboard.page.session import WATCHED, custom_columns
from mesa_swarm.dashboard.page.widgets import Link, view_script
from mesa_swarm.fire.strategy import FightFire
from mesa_swarm.recording.frames import Frame
from mesa_swarm.recording.layout import columns_of_parts, is_table, shown_of
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, HALF, MOUNT_X, MOUNT_Y, RANGE, DesignTable, RobotDesign
from mesa_swarm.robots.reasons import Moment
from mesa_swarm.robots.robot import Robot
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.player import PackedFrame
from mesa_swarm.viewing.scene import Scene
from mesa_swarm.world.statics import KINDS

# Of the numbers of one custom sensor.
MOST_SHOWN = 12
# Shortest time between updates of the inspector while the model is played, s.
EVERY = 0.2
# Types of values from a field of the page.
Typed = float | str | None


class Inspector(anywidget.AnyWidget):
    """One robot's readings, layer, reason and pose in the browser."""

    _esm = view_script("dashboard/run/inspector.js")
    # From `inspect`, empty if no robot is selected; and why the robot could not be moved.
    inspected = traitlets.Dict().tag(sync=True)
    editable = traitlets.Bool(False).tag(sync=True)
    fault = traitlets.Unicode("").tag(sync=True)


class Inspecting(Link):
    """Connects an inspector and the selected robot of a session."""

    def __init__(self, inspector: Inspector, session: Any) -> None:
        self.inspector, self.session = inspector, session
        self._shown_at = 0.0
        self.connect(inspector, session.selection.add(self.select), session.changed.add(self.refresh))
        self.watch(session)

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show the robot at the displayed step, if an update is due."""
        if not self.session.playing or time.monotonic() - self._shown_at >= EVERY:
            self.refresh()

    def select(self) -> None:
        """Show another robot."""
        self.inspector.fault = ""
        self.refresh()

    def refresh(self) -> None:
        """Show the selected robot."""
        self._shown_at = time.monotonic()
        with self.session.lock:
            inspected = self._inspect_selected()
            editable = bool(inspected) and self._may_move()
        with self.inspector.hold_sync():
            self.inspector.inspected, self.inspector.editable = inspected, editable
            if not editable:
                self.inspector.fault = ""

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        session, value = self.session, message.get("value")
        match message.get("do"):
            case "next" | "previous" as which:
                session.select(neighbour_of(self._robots(), session.selected, 1 if which == "next" else -1))
            case "select":
                self._select(value)
            case "move":
                self._move(message["value"])

    def _robots(self) -> list[int]:
        """Return the ids of all robots in the order of their rows."""
        return self.session.model.swarm.unique_ids.tolist() if self.session.model else []

    def _inspect_selected(self) -> dict[str, Any]:
        """Return the selected robot at the displayed step, empty if none is selected."""
        model, moment = self.session.model, self.session.past.shown
        if model is None or moment is None:
            return {}
        robot = robot_of(model, self.session.selected)
        return {} if robot is None else inspect(model, robot, moment.step)

    def _may_move(self) -> bool:
        session = self.session
        return not session.playing and session.past.is_present and not session.error

    def _select(self, number: int | None) -> None:
        session, ids = self.session, self._robots()
        if number is not None and number not in ids:
            expectation = f"expected one from {ids[0]} to {ids[-1]}" if ids else "the model has no robots"
            self.inspector.fault = f"unknown robot {number}; {expectation}"
            return
        session.select(number)

    def _move(self, pose: dict[str, float | str | None]) -> None:
        """Move the robot, or show why not."""
        session = self.session
        try:
            with session.lock:
                if not self._may_move():
                    raise InvalidValueError("a robot is moved only at the present step of a paused run; pause first")
            x, y, heading = (_number(name, pose.get(name)) for name in ("x", "y", "heading"))
            check_number("heading", heading, minimum=-360, maximum=360)
            if session.selected is None:
                raise InvalidValueError("no robot is selected; select one")
            session.edit("move", session.selected, x, y, math.radians(heading))
        except Exception as problem:  # shown beside the fields
            self.inspector.fault = reported(problem)
            return
        self.inspector.fault = ""
        self.refresh()


class ReplayInspecting(Inspecting):
    """Connects an inspector and the selected robot of a recording that is played; it moves no robot."""

    def _inspect_selected(self) -> dict[str, Any]:
        """Return the selected robot in the displayed row; of a row that cannot be read, which is reported, nothing."""
        player = self.session
        with player.capture_errors():
            frame = player.rows.frame
            if frame is not None and player.selected is not None and not player.error:
                return inspect_frame(frame, player.rows.scene, player.selected)
        return {}

    def _robots(self) -> list[int]:
        """Return the ids of the robots in the displayed row."""
        with self.session.lock:
            frame = self.session.rows.frame
        return [] if frame is None else frame.robots.tolist()

    def _may_move(self) -> bool:
        return False

    def _select(self, number: int | None) -> None:
        """Select a robot, which the displayed row need not have."""
        if number is None or isinstance(number, int):
            self.session.select(number)


def robot_of(model: SwarmModel, number: int | None) -> Robot | None:
    """Return the robot with this id, None if there is none."""
    return next((robot for robot in model.swarm.agents if robot.unique_id == number), None)


def neighbour_of(ids: Sequence[int], number: int | None, by: int) -> int | None:
    """Return the id that is `by` places after this one, cyclically; None without robots."""
    if not ids:
        return None
    place = ids.index(number) + by if number in ids else (0 if by > 0 else -1)
    return ids[place % len(ids)]


# What is shown of a robot of which more is not known.
UNDECIDED = {"known": True, "does": "", "layer": "", "reason": "", "worth": [], "present": False}


def inspect(model: SwarmModel, robot: Robot, step: int) -> dict[str, Any]:
    """Return the description of a robot at a step, in words and numbers; of a step no longer stored only a message."""
    snapshots = model.watched
    steps = snapshots.steps.tolist() if snapshots is not None else []
    present = step == model.completed
    if snapshots is not None and step in steps:
        columns, when = snapshots.at(step), f"step {step:,}"
    elif present and not steps:
        columns, when = model.swarm.columns, "before the first step"
    else:
        available = f"; readings are available for steps {steps[0]:,} to {steps[-1]:,}" if steps else ""
        return {"id": robot.unique_id, "when": f"step {step:,} is no longer stored{available}", "known": False}
    if set(WATCHED) - set(columns):
        return {"id": robot.unique_id, "when": "the model stores too few columns for the inspector", "known": False}
    moment, _ = moment_of(model.swarm, columns, robot.row, model.kinds)
    position, heading = (columns[name][robot.row] for name in ("position", "heading"))
    decided = step in steps and model.control is not None
    reason = model.explain(robot, step) if decided else None
    why = {"does": reason.does, "layer": reason.layer, "reason": reason.reason} if reason else {}
    return UNDECIDED | {
        "id": robot.unique_id,
        "when": when,
        "radius": robot.radius,
        "sensors": sensor_sectors(moment, reason.sensors if reason else ()),
        **why,
        "facts": [*facts_of(model, robot, moment), *(rows_of_parts(model, robot) if present else ())],
        "worth": worth_of(model, robot) if present and decided else [],
        "pose": pose_of(robot.position, robot.heading) if present else pose_of(position, heading),
        "present": present,
    }


# What the inspector shows of a live robot, by the recorded column that it needs.
RECORDED = {
    "command": "its command",
    "layer": "the layer that drives it",
    "distance": "proximity readings",
    "kind": "what its sensors see",
    "temperature": "its temperature",
    "fire": "the fire that it fights",
    "radiation": "radiation readings",
    "line": "line sensors",
    "heard_from": "messages",
    "contacts": "collisions",
}
# Columns with lines of their own, or without any.
SHOWN_APART = {*RECORDED, "position", "heading", "hot", "heat", "collided", "design", "number", "heard_goal", "task"}


def inspect_frame(frame: Frame, scene: Scene, number: int) -> dict[str, Any]:
    """Return the description of a robot in a recorded row, as far as columns were recorded; others are named."""
    rows, when = np.flatnonzero(frame.robots == number), f"step {frame.step:,}"
    if not len(rows):
        return {"id": number, "when": f"at {when} there is not such a robot", "known": False, "movable": False}
    row, names = int(rows[0]), tuple(scene.world(frame.step)["layers"])
    design = scene.designs[int(scene.design_of(frame.robots[rows])[0])]
    columns = {name: column[row] for name, column in frame.columns.items() if not is_table(name)}
    moment = recorded_moment(design, columns, tuple(scene.world(frame.step).get("kinds", KINDS)))
    layer = int(columns.get("layer", -1))
    has_wheels = "command" in columns and len(moment.command) == 2
    decided = has_wheels and "layer" in columns and frame.step > 0
    return UNDECIDED | {
        "id": number,
        "when": when,
        "movable": False,
        "radius": design.radius,
        "sensors": sensor_sectors(moment, ()),
        "does": moment.motion if decided else "",
        "layer": names[layer] if decided and 0 <= layer < len(names) else "",
        "facts": recorded_facts(frame, scene, row, columns),
        "pose": pose_of(columns["position"], columns["heading"]) if "heading" in columns else {},
    }


def recorded_moment(design: RobotDesign, columns: dict[str, Any], kinds: tuple[str, ...]) -> Moment:
    """Return what a robot of a design read and did in a recorded row; no sensors if readings were not recorded."""
    table, count = DesignTable.of((design,)), len(design.proximity)
    if "distance" not in columns or "kind" not in columns or len(columns["distance"]) < count:
        count = 0
    front, left, right = (int(index) if index < count else -1 for index in table.forward[0])
    return Moment(
        distance=np.asarray(columns.get("distance", ()), float)[:count],
        kind=np.asarray(columns.get("kind", ()), int)[:count],
        sensors=table.proximity[0, :count],
        bearing=table.bearing[0, :count],
        forward=(front, left, right),
        command=np.asarray(columns.get("command", ()), float),
        turns=bool(design.turns),
        columns=columns,
        kinds=kinds,
    )


def recorded_facts(frame: Frame, scene: Scene, row: int, columns: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the other recorded values of a robot, each with its name, and at the end what was not recorded."""
    facts: list[tuple[str, str]] = []
    fires = len(frame.columns.get("fires", ()))
    if fires and "temperature" in columns:
        heat = f", {columns['heat']:+.2f} a step" if "heat" in columns else ""
        hot = columns["hot"] if "hot" in columns else columns["temperature"] >= scene.limits(frame.step)[0]
        facts.append(("Heat", f"{columns['temperature']:.1f}{heat}{' (too hot to fight)' if hot else ''}"))
    if fires and "fire" in columns:
        facts.append(("Fights", fire_name(int(columns["fire"]))))
    names = [name for name in columns if name not in SHOWN_APART and not name.startswith("looks.")]
    for name in [*(name for name in ("radiation", "line") if name in columns), *names]:
        value = columns[name]
        if np.asarray(value).dtype.kind in "biuf":
            facts.append((capitalise_title(column_title(name)), _numbers(value)))
    colliding = find_collided(frame)
    if colliding is not None:
        facts.append(("Collided", "yes" if frame.robots[row] in colliding else "no"))
    relevant = {name: text for name, text in RECORDED.items() if fires or name not in ("temperature", "fire")}
    absent = [text for name, text in relevant.items() if name not in frame.columns]
    return [*facts, ("Not recorded", ", ".join([*absent, "reasons"]))]


def sensor_sectors(moment: Moment, triggered: Sequence[int]) -> list[dict[str, Any]]:
    """Return sector (in the robot's frame), reading and triggering state of each proximity sensor."""
    return [
        {
            "mount": [float(row[MOUNT_X]), float(row[MOUNT_Y])],
            "bearing": math.atan2(row[AXIS_Y], row[AXIS_X]),
            "half": float(row[HALF]),
            "range": float(row[RANGE]),
            "distance": float(moment.distance[s]),
            "kind": int(moment.kind[s]),
            "words": moment.reading(s),
            "triggered": s in triggered,
        }
        for s, row in enumerate(moment.sensors)
    ]


def facts_of(model: SwarmModel, robot: Robot, moment: Moment) -> list[tuple[str, str]]:
    """Return the other readings and states of a robot, each with its name."""
    columns, facts = moment.columns, []
    if robot.group:
        facts.append(("Group", robot.group))
    if len(model.fires):
        state = " (too hot to fight)" if columns["hot"] else ""
        facts.append(("Heat", f"{columns['temperature']:.1f}, {columns['heat']:+.2f} a step{state}"))
        facts.append(("Fights", fire_name(int(columns["fire"]))))
    if len(robot.design.radiation):
        readings = columns["radiation"][: len(robot.design.radiation)]
        facts.append(("Radiation", " ".join(f"{reading:.2f}" for reading in readings)))
    if len(robot.design.line):
        over = ["mark" if on else "ground" for on in columns["line"][: len(robot.design.line)]]
        facts.append(("Line sensors", ", ".join(over)))
    facts += custom_of(model, columns)
    if model.communication is not None:
        facts += messages_of(model, columns)
    facts += rows_of_body(model, robot)
    facts.append(("Collided", "yes" if columns["collided"] else "no"))
    return facts


def rows_of_parts(model: SwarmModel, robot: Robot) -> list[tuple[str, str]]:
    """Return what added parts have of a robot now: their columns, and the rows that they show."""
    rows = {f"{picture.name} {name}": values for picture in shown_of(model) for name, values in picture.rows.items()}
    columns = {column_title(name): values for name, values in columns_of_parts(model).items()}
    return [(capitalise_title(name), _in_words(np.asarray(v)[robot.row])) for name, v in {**columns, **rows}.items()]


def _in_words(value: Any) -> str:
    """Return a value of a robot in words: numbers, or a text as it is."""
    return _numbers(value) if np.asarray(value).dtype.kind in "biuf" else str(value)


def fire_name(index: int) -> str:
    """Return a fire's name by its index, which is below 0 for no fire: fires are numbered from 1 everywhere."""
    return f"fire {index + 1}" if index >= 0 else "no fire"


def rows_of_body(model: SwarmModel, robot: Robot) -> list[tuple[str, str]]:
    """Return the present state of a robot's battery, if it has one, and what of it failed."""
    has_battery = robot.design.battery > 0 or model.swarm.battery_life > 0
    battery = [("Battery", f"{100 * robot.battery:.0f} %")] if has_battery else []
    return battery + ([("Failed", ", ".join(robot.failures))] if robot.failures else [])


def custom_of(model: SwarmModel, columns: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what custom sensors read, actuators were set to, and messages held, each with its name."""
    names = [name for name in custom_columns(model) if name in columns]
    return [(capitalise_title(column_title(name)), _numbers(columns[name])) for name in names]


def capitalise_title(text: str) -> str:
    """Return a title with a capital; the name of a layer, which may be a name in code, stays as it is."""
    return text if " remembers " in text else text.capitalize()


def _numbers(values: Any) -> str:
    """Return the first numbers in words, a dash for nothing."""
    flat = np.asarray(values, float).ravel()
    text = " ".join("-" if np.isnan(number) else f"{number:.4g}" for number in flat[:MOST_SHOWN])
    return f"{text} ..." if len(flat) > MOST_SHOWN else text


def messages_of(model: SwarmModel, columns: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the messages that a robot received."""
    messages = []
    if columns["heard_task"] >= 0:
        messages.append(("Hears", f"a robot {where(columns['heard_from'])}: {_task_of(model, columns)}"))
    if np.isfinite(columns["heard_goal"]).all():
        messages.append(("Hears", f"a goal {where(columns['heard_goal'])}"))
    return messages or [("Hears", "nothing")]


def _task_of(model: SwarmModel, columns: dict[str, Any]) -> str:
    """Return the layer that drives the robot that was heard, and its task; of FightFire it is always the same."""
    layer, task = int(columns["heard_layer"]), int(columns["heard_task"])
    if layer < 0 or model.control is None:
        return f"no layer, task {task}"
    name = model.control.names[layer]
    return name if isinstance(model.control.layers[layer], FightFire) else f"{name}, task {task}"


def where(place: np.ndarray) -> str:
    """Return a place in a robot's frame in words."""
    x, y = map(float, place)
    return f"{math.hypot(x, y):.0f} away at {math.degrees(math.atan2(y, x)):+.0f} degrees"


def worth_of(model: SwarmModel, robot: Robot) -> list[tuple[str, float]]:
    """Return the value of each action to a robot that learns, an empty list for others."""
    layers = model.control.layers_of(robot.row) if model.control is not None else ()
    learners = [layer for layer in layers if hasattr(layer, "worth")]
    return learners[0].worth(robot.row) if learners else []


def pose_of(position: np.ndarray, heading: float) -> dict[str, float]:
    """Return a pose in map units and degrees, rounded."""
    degrees = round(math.degrees(heading), 1)
    return {"x": round(float(position[0]), 2), "y": round(float(position[1]), 2), "heading": degrees + 0.0}


def _number(name: str, value: Typed) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]  # refused below, like any other non-number
        return check_number(name, number, minimum=-1e9, maximum=1e9)
    except (TypeError, ValueError) as error:
        is_checked = isinstance(error, InvalidValueError)
        raise InvalidValueError(str(error) if is_checked else f"{name} is {value!r:.40}; expected a number") from None
