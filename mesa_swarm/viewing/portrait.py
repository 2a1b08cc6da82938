"""All that pictures show of a model or of a recorded step."""

import math
import warnings
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from operator import attrgetter, itemgetter
from typing import cast

import numpy as np

from mesa_swarm.control.layer import Senses, centroids
from mesa_swarm.errors import ExportError, ExportWarning, RecordingError, SwarmError
from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.frames import Frame, Rows
from mesa_swarm.recording.layout import Chunk, Layout
from mesa_swarm.recording.provenance import map_of, rebuilt, scenery_of
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.resume import shipped_class_of
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.sensors import ProximitySensor
from mesa_swarm.world.bodies import Form, Load
from mesa_swarm.world.map_parts import Bounds
from mesa_swarm.world.shapes import Shape, shape_from_json


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Portrait:
    """The world at one moment, and what was recorded until then.

    Parameters
    ----------
    steps : int
    bounds : (x_min, y_min, x_max, y_max)
    obstacles, loads : tuples of Shape
        Loads as they lie now; they are not among the obstacles.
    designs : tuple of RobotDesign
    robots : dict of ndarrays
        position, heading, radius, design and hot, a row a robot; perceived (n, 2), if it was asked for, is where
        a robot perceives the centroid of those that it sees, nan where it sees none.
    fires : dict of ndarrays
        position, radius, temperature and out, a row a fire.
    history : dict of ndarrays
        steps (k,), temperature and robots (k, f) of the fires; the last row is the present.
    series : dict of ndarrays
        What the DataCollector collected of the model in every step, by name; numbers only.
    """

    steps: int
    bounds: Bounds
    obstacles: tuple[Shape, ...]
    loads: tuple[Shape, ...]
    designs: tuple[RobotDesign, ...]
    robots: dict[str, np.ndarray]
    fires: dict[str, np.ndarray]
    history: dict[str, np.ndarray]
    series: dict[str, np.ndarray]
    collect_every: int = 1


def portrait_of(model: FireModel, *, perceived: bool = False) -> Portrait:
    """Return the portrait of a model as it is now.

    Parameters
    ----------
    model : SwarmModel
    perceived : bool
        Whether to show where robots perceive the centroid of those that they see; all sensors are then read.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> portrait_of(SwarmModel(map="openspace_fire", rng=1)).fires["out"].sum()
    np.int64(0)
    """
    robots = ("position", "heading", "radius", "design", "hot")
    fires = ("position", "radius", "temperature", "out")
    columns = {name: model.swarm.columns[name].copy() for name in robots}
    return Portrait(
        steps=model.steps,
        bounds=model.map.bounds,
        obstacles=tuple(obstacle.shape for obstacle in model.obstacles if not isinstance(obstacle, Load)),
        loads=tuple(load.shape for load in model.loads),
        designs=model.swarm.designs,
        robots={**columns, **({"perceived": _perceived(model)} if perceived else {})},
        fires={name: model.fires.columns[name].copy() for name in fires},
        history=_history(model),
        series=_series(model),
        collect_every=model.collect_every,
    )


def _perceived(model: FireModel) -> np.ndarray:
    """Return where on the map each robot perceives the centroid of the robots that it sees, nan for none."""
    model.sense()
    centroid, seen = centroids(Senses.of(model.swarm))
    cosine, sine = np.cos(model.swarm.heading), np.sin(model.swarm.heading)
    x, y = centroid.T
    place = model.swarm.position + np.column_stack([cosine * x - sine * y, sine * x + cosine * y])
    return np.where(seen[:, None] > 0, place, np.nan)


def _history(model: FireModel) -> dict[str, np.ndarray]:
    """Return the fires' history with the present as its last row, which is else missing between two rows."""
    fires, history = model.fires, model.fires.history
    tables = {name: getattr(history, name) for name in ("steps", "temperature", "robots")}
    if len(tables["steps"]) and tables["steps"][-1] < model.steps:
        now = {"steps": model.steps, "temperature": fires.temperature, "robots": np.where(fires.out, -1, fires.robots)}
        tables = {name: np.concatenate([table, [now[name]]]) for name, table in tables.items()}
    return tables


def _series(model: FireModel) -> dict[str, np.ndarray]:
    collected = {name: np.array(values) for name, values in model.datacollector.model_vars.items()}
    return {name: values for name, values in collected.items() if values.dtype.kind in "biuf" and values.ndim == 1}


# Of whom nothing else is known: a body of the usual size, without sensors.
UNKNOWN = RobotDesign(name="unknown", radius=5.0)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Setting:
    """What is true from one step on, until the next setting.

    Parameters
    ----------
    step : int
    obstacles : tuple of Shape
        The same one in settings that differ in something else.
    leave, join : float
        A robot is too hot to fight from `leave` on, until it has cooled to `join`.
    """

    step: int
    obstacles: tuple[Shape, ...]
    leave: float
    join: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scene:
    """What pictures need besides a recording's rows.

    Parameters
    ----------
    name : str
        Of the model.
    bounds : (x_min, y_min, x_max, y_max)
    settings : tuple of Setting
        In the order of time, at least one.
    forms : dict of Form
        Of the loads, by unique_id.
    designs : tuple of RobotDesign
        The last one is that of robots of whom nothing is known.
    robots : mapping
        By unique_id, the radius and the place of the design among `designs`.
    start : Frame or None
        What the first row would be, had the state before the first step been recorded.
    note : str
        What cannot be shown; empty if all can.
    """

    name: str
    bounds: Bounds
    settings: tuple[Setting, ...]
    forms: dict[int, Form]
    designs: tuple[RobotDesign, ...]
    robots: Mapping[int, tuple[float, int]]
    start: Frame | None
    note: str

    def at(self, step: int) -> Setting:
        """Return the setting of a step."""
        return self.settings[max(bisect_right(self.settings, step, key=attrgetter("step")) - 1, 0)]


class Bodies(Mapping[int, tuple[float, int]]):
    """The radius and the design of each robot, by unique_id, looked up in the runs of a scenery.

    Examples
    --------
    >>> bodies = Bodies([[3, 5, 0], [8, 1_000_000_000, 1]], radii=[5.0, 7.0])
    >>> bodies[4], bodies[8], bodies.get(6)
    ((5.0, 0), (7.0, 1), None)
    """

    def __init__(self, runs: Sequence[Sequence[int]], radii: Sequence[float]) -> None:
        self._runs, self._radii = runs, radii

    def __getitem__(self, robot: int) -> tuple[float, int]:
        place = bisect_right(self._runs, robot, key=itemgetter(0)) - 1
        first, last, which = self._runs[place] if place >= 0 else (0, -1, 0)
        if not first <= robot <= last:
            raise KeyError(robot)
        return self._radii[which], which

    def __iter__(self) -> Iterator[int]:
        return (one for first, last, _ in self._runs for one in range(first, last + 1))

    def __len__(self) -> int:
        return sum(last - first + 1 for first, last, _ in self._runs)


def scene_of(recording: Recording) -> Scene:
    """Return what a recording's pictures need besides its rows: what it says itself, and where it began.

    Where it began is known of models that come with mesa_swarm and were not changed by hand before: a file cannot
    make anybody import other code. What recordings of old versions do not say is taken from such a model too; of
    others the map says what stands there, and robots are drawn with a radius of 5.

    Parameters
    ----------
    recording : Recording

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.models.cooperative_transport import CooperativeTransport
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = CooperativeTransport(rng=1)
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(5)
    ...     scene = scene_of(Recording(f"{folder}/run.arrow"))
    >>> len(scene.forms), len(scene.robots), scene.note
    (1, 5, '')
    """
    model = _made_again(recording)
    join = np.inf if model is None else model.fire_constants.join
    sceneries = recording.sceneries
    if not sceneries and model is not None:
        sceneries = ((model.completed, scenery_of(model)),)
    bounds, settings, forms, designs, robots = _told(recording, sceneries, join)
    return Scene(
        name=recording.provenance["model"]["name"],
        bounds=bounds,
        settings=settings,
        forms=forms,
        designs=(*designs, UNKNOWN),
        robots=robots,
        start=None if model is None else _frame_of(recording, model),
        note=_note(recording, robots, told=bool(sceneries)),
    )


def _made_again(recording: Recording) -> FireModel | None:
    """Return the model as the recording began, None if its constructor does not make that."""
    try:
        model = rebuilt(recording.provenance, shipped_class_of(recording))
    except SwarmError:
        return None
    start = recording.provenance["start"]
    same = model.completed == start["step"] and model.state_hash() == start["state_hash"]
    return cast(FireModel, model) if same else None


def _told(recording: Recording, sceneries: Sequence[tuple[int, dict]], join: float) -> tuple:
    """Return bounds, settings, forms, designs and robots as sceneries tell them."""
    world = map_of(recording.provenance)
    if not sceneries:
        return world.bounds, (Setting(step=0, obstacles=world.obstacles, leave=np.inf, join=np.inf),), {}, (), {}
    try:
        settings = tuple(_settings(sceneries, join))
        _, told = sceneries[0]  # robots and loads are the same in all
        forms = {one["id"]: Form.of(shape_from_json(one)) for one in told["loads"]}
        designs = tuple(_design(one) for one in told["designs"])
        robots = Bodies(told["robots"], [design.radius for design in designs])
    except SwarmError as error:
        raise RecordingError(f"{recording.path} does not say clearly what its world looks like: {error}") from None
    return world.bounds, settings, forms, designs, robots


def _settings(sceneries: Sequence[tuple[int, dict]], join: float) -> Iterator[Setting]:
    shapes: list | None = None
    obstacles: tuple[Shape, ...] = ()
    for step, told in sceneries:
        if told["shapes"] != shapes:
            shapes, obstacles = told["shapes"], tuple(shape_from_json(one) for one in told["shapes"])
        leave = float(told["leave"])
        yield Setting(step=step, obstacles=obstacles, leave=leave, join=float(told.get("join", min(join, leave))))


def _design(told: dict) -> RobotDesign:
    """Return a design as far as one sees it."""
    sensors = tuple(
        ProximitySensor(
            bearing_degrees=math.degrees(bearing),
            range=reach,
            field_of_view_degrees=min(2 * math.degrees(half), 360.0),
            mount=(x, y),
        )
        for x, y, bearing, half, reach in told["sensors"]
    )
    return RobotDesign(name=told["name"], radius=told["radius"], max_speed=told["max_speed"], sensors=sensors)


def _frame_of(recording: Recording, model: FireModel) -> Frame:
    layout = Layout(model, recording.columns, recording.provenance["exact"])
    chunk = Chunk(layout, model, 1)
    chunk.put(0, model.completed, None)
    return Rows(chunk.batch(1))[0]


def _note(recording: Recording, known: Mapping, told: bool) -> str:
    """Say what cannot be drawn as it was."""
    if not told:
        return (
            f"{recording.provenance['model']['name']} cannot be made again: all robots are drawn with a radius of "
            f"{UNKNOWN.radius:g}, obstacles as they are on the map, loads not at all"
        )
    if len(recording) and not {*recording[0].robots.tolist(), *recording[-1].robots.tolist()} <= known.keys():
        return f"robots that were added while this was recorded are drawn with a radius of {UNKNOWN.radius:g}"
    return ""


NEEDED = ("position", "heading")
NO_FIRES = {"position": np.zeros((0, 2)), "radius": np.zeros(0), "temperature": np.zeros(0), "out": np.zeros(0, bool)}


class SceneRows:
    """The steps of a recording that can be exported, and their frames: as many as are whole.

    Parameters
    ----------
    recording : Recording

    Attributes
    ----------
    recording : Recording
    steps : int64 ndarray, shape (k,)

    Raises
    ------
    ExportError
        If nothing was recorded.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.steps = np.array([frame.step for frame in islice(recording, recording.intact)], np.int64)
        if not len(self.steps):
            raise ExportError(f"{recording.path} {recording.damage or 'has no rows'}; there is nothing to export")
        if recording.damage:
            _warn(f"{recording.path} {recording.damage}; the whole rows are exported")
        elif not recording.complete:
            _warn(f"{recording.path} was not closed: its {len(self.steps)} whole rows are exported")

    def frame(self, step: int) -> Frame:
        """Return the frame of a recorded step."""
        return self.recording[int(np.searchsorted(self.steps, step))]


class Portraits:
    """What pictures show of the steps of a recording.

    Parameters
    ----------
    rows : SceneRows

    Attributes
    ----------
    scene : Scene
    steps : int64 ndarray, shape (k,)
        Those that can be shown: the recorded ones and, if it is known, the one at which the recording began.

    Raises
    ------
    ExportError
        If positions or headings were not recorded.
    """

    def __init__(self, rows: SceneRows) -> None:
        missing = [name for name in NEEDED if name not in rows.recording.columns]
        if missing:
            raise ExportError(
                f"{missing[0]} was not recorded in {rows.recording.path}; pictures need it, tables do not"
            )
        self.scene: Scene = scene_of(rows.recording)
        if self.scene.note:
            _warn(self.scene.note)
        self._rows = rows
        self._start = _start_before(rows, self.scene)
        self.steps = rows.steps if self._start is None else np.array([self._start.step, *rows.steps])
        self._hot: list[np.ndarray] | None = None

    def frame(self, step: int) -> Frame:
        """Return the frame of one of the steps."""
        return self._start if self._start and step == self._start.step else self._rows.frame(step)

    def at(self, step: int) -> Portrait:
        """Return the portrait of one of the steps."""
        frame, scene = self.frame(step), self.scene
        return Portrait(
            steps=frame.step,
            bounds=scene.bounds,
            obstacles=scene.at(frame.step).obstacles,
            loads=self._loads(frame),
            designs=scene.designs,
            robots=self._robots(frame),
            fires=_fires(frame),
            history={},
            series={},
        )

    def hot(self, frame: Frame) -> np.ndarray:
        """Return which robots are too hot to fight, as recorded or as their temperatures since the first row tell."""
        if "hot" in frame.columns:
            return frame["hot"]
        if "temperature" not in frame.columns or frame is self._start:
            return np.zeros(len(frame.robots), bool)
        if self._hot is None:
            frames = (self._rows.frame(step) for step in self._rows.steps)
            self._hot = list(hot_robots(frames, self.scene))
        return self._hot[int(np.searchsorted(self._rows.steps, frame.step))]

    def radius_of(self, robot: int) -> float:
        """Return the radius of the robot with this unique_id."""
        return self.scene.robots.get(robot, (self.scene.designs[-1].radius, 0))[0]

    def _robots(self, frame: Frame) -> dict[str, np.ndarray]:
        unknown = self.scene.designs[-1].radius, len(self.scene.designs) - 1
        bodies = [self.scene.robots.get(robot, unknown) for robot in frame.robots.tolist()]
        radius, design = np.array(bodies).reshape(-1, 2).T
        return {
            "position": frame["position"].astype(float),
            "heading": frame["heading"].astype(float),
            "radius": radius,
            "design": design.astype(int),
            "hot": self.hot(frame),
        }

    def _loads(self, frame: Frame) -> tuple:
        if "loads" not in frame.columns:
            return ()
        forms = self.scene.forms
        return tuple(forms[load].shape_at(tuple(pose)) for load, *pose in frame["loads"].tolist() if load in forms)


def hot_robots(frames: Iterator[Frame], scene: Scene) -> Iterator[np.ndarray]:
    """Yield which robots are too hot in each frame: from `leave` on, until they have cooled to `join`.

    Robots that are first seen between the two are taken as not too hot.
    """
    hot, robots = np.zeros(0, bool), np.zeros(0, int)
    for frame in frames:
        if not np.array_equal(robots, frame.robots):
            hot, robots = np.isin(frame.robots, robots[hot]), frame.robots
        temperature, setting = frame["temperature"], scene.at(frame.step)
        hot = (temperature >= setting.leave) | (hot & (temperature > setting.join))
        yield hot


def _start_before(rows: SceneRows, scene: Scene) -> Frame | None:
    """Return the frame at which the recording began, if it is known and as far from the first row as rows are."""
    start = scene.start
    before = start is not None and start.step < rows.steps[0] and start.step % rows.recording.provenance["every"] == 0
    return start if before else None


def _fires(frame: Frame) -> dict[str, np.ndarray]:
    if "fires" not in frame.columns:
        return NO_FIRES
    fires = frame["fires"]
    # Single precision may have rounded a temperature to just above 1.
    return {
        "position": np.column_stack([fires["x"], fires["y"]]).astype(float),
        "radius": fires["radius"].astype(float),
        "temperature": np.clip(fires["temperature"].astype(float), 0.0, 1.0),
        "out": fires["out"],
    }


def _warn(text: str) -> None:
    warnings.warn(text, ExportWarning, stacklevel=2)
