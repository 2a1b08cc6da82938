"""What stands behind a recording and is not in its rows: obstacles, bodies, loads' forms, when robots are too hot."""

import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter, itemgetter
from typing import cast

import numpy as np

from mesa_swarm.errors import RecordingError, SwarmError
from mesa_swarm.experiments.recording_commands import class_of
from mesa_swarm.model import SwarmModel
from mesa_swarm.recording.frames import Frame, Rows
from mesa_swarm.recording.layout import Chunk, Layout
from mesa_swarm.recording.provenance import map_of, rebuilt
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.scenery import scenery_of
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.sensors import ProximitySensor
from mesa_swarm.world.form import Form
from mesa_swarm.world.map_parts import Bounds
from mesa_swarm.world.shapes import Shape, disc, polygon

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


def _made_again(recording: Recording) -> SwarmModel | None:
    """Return the model as the recording began, None if its constructor does not make that."""
    try:
        model = rebuilt(recording.provenance, class_of(recording))
    except SwarmError:
        return None
    start = recording.provenance["start"]
    same = model.completed == start["step"] and model.state_hash() == start["state_hash"]
    return cast(SwarmModel, model) if same else None


def _told(recording: Recording, sceneries: Sequence[tuple[int, dict]], join: float) -> tuple:
    """Return bounds, settings, forms, designs and robots as sceneries tell them."""
    world = map_of(recording.provenance)
    if not sceneries:
        return world.bounds, (Setting(step=0, obstacles=world.obstacles, leave=np.inf, join=np.inf),), {}, (), {}
    try:
        settings = tuple(_settings(sceneries, join))
        _, told = sceneries[0]  # robots and loads are the same in all
        forms = {one["id"]: Form.of(_shape(one)) for one in told["loads"]}
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
            shapes, obstacles = told["shapes"], tuple(_shape(one) for one in told["shapes"])
        leave = float(told["leave"])
        yield Setting(step=step, obstacles=obstacles, leave=leave, join=float(told.get("join", min(join, leave))))


def _shape(told: dict) -> Shape:
    contact = not told.get("mark", False)
    if "disc" in told:
        x, y, radius = told["disc"]
        return disc((x, y), radius, contact=contact)
    shell, *holes = told["rings"]
    return polygon(shell, holes, contact=contact)


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


def _frame_of(recording: Recording, model: SwarmModel) -> Frame:
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
