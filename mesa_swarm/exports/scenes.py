"""What stands behind a recording and is not in its rows: obstacles, bodies, loads' forms, when robots are too hot."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.errors import RecordingError, SwarmError
from mesa_swarm.experiments.recording_commands import class_of
from mesa_swarm.model import SwarmModel
from mesa_swarm.recording.layout import Chunk, Layout
from mesa_swarm.recording.provenance import rebuilt
from mesa_swarm.recording.recording import Frame, Recording, chunk_of
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.world.form import Form
from mesa_swarm.world.load import Load
from mesa_swarm.world.map import Map
from mesa_swarm.world.map_parts import Bounds
from mesa_swarm.world.shapes import Shape, disc, polygon

# Of whom nothing else is known: a body of the usual size, without sensors.
UNKNOWN = RobotDesign(name="unknown", radius=5.0)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scene:
    """What pictures need besides a recording's rows.

    Parameters
    ----------
    name : str
        Of the model.
    bounds : (x_min, y_min, x_max, y_max)
    obstacles : tuple of Shape
    forms : dict of Form
        Of the loads, by unique_id.
    designs : tuple of RobotDesign
        The last one is that of robots of whom nothing is known.
    robots : dict
        By unique_id, the radius and the place of the design among `designs`.
    leave, join : float
        A robot is too hot to fight from `leave` on, until it has cooled to `join`.
    start : Frame or None
        What the first row would be, had the state before the first step been recorded.
    note : str
        What cannot be shown; empty if all can.
    """

    name: str
    bounds: Bounds
    obstacles: tuple[Shape, ...]
    forms: dict[int, Form]
    designs: tuple[RobotDesign, ...]
    robots: dict[int, tuple[float, int]]
    leave: float
    join: float
    start: Frame | None
    note: str


def scene_of(recording: Recording) -> Scene:
    """Return what a recording's pictures need besides its rows, from its model as the constructor makes it.

    Only models that come with mesa_swarm are made: a file cannot make anybody import other code. Of others, and of
    models that were changed by hand, there is what the recording says of their scenery; in recordings of older
    versions, which do not, what the map says, and robots are drawn with a radius of 5.

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
    try:
        model = rebuilt(recording.provenance, class_of(recording))
    except SwarmError:
        return _scene_as_told(recording)
    start = recording.provenance["start"]
    if model.completed == start["step"] and model.state_hash() == start["state_hash"]:
        return _scene_of_model(recording, model)
    return _scene_as_told(recording)


def _scene_as_told(recording: Recording) -> Scene:
    """Return what the recording itself says of a model that cannot be made again, or was changed by hand."""
    told = recording.provenance.get("scenery", {})
    world = Map.from_toml(recording.provenance["map"], "the recording's map")
    name = recording.provenance["model"]["name"]
    try:
        obstacles = tuple(_shape(one) for one in told["shapes"]) if told else world.obstacles
        forms = {one["id"]: Form.of(_shape(one)) for one in told.get("loads", ())}
        designs = [RobotDesign(name=one["name"], radius=one["radius"]) for one in told.get("designs", ())]
        runs = [(range(first, last + 1), which) for first, last, which in told.get("robots", ())]
        robots = {one: (designs[which].radius, which) for ids, which in runs for one in ids}
        leave = float(told.get("leave", np.inf))
    except (KeyError, TypeError, ValueError, IndexError, AttributeError):
        raise RecordingError(f"{recording.path} does not say clearly what its world looks like") from None
    return Scene(
        name=name,
        bounds=world.bounds,
        obstacles=obstacles,
        forms=forms,
        designs=(*designs, UNKNOWN),
        robots=robots,
        leave=leave,
        join=leave,
        start=None,
        note=_note(recording, robots),
    )


def _shape(told: dict) -> Shape:
    contact = not told.get("mark", False)
    if "disc" in told:
        x, y, radius = told["disc"]
        return disc((x, y), radius, contact=contact)
    shell, *holes = told["rings"]
    return polygon(shell, holes, contact=contact)


def _scene_of_model(recording: Recording, model: SwarmModel) -> Scene:
    swarm = model.swarm
    rows = zip(swarm.agents, swarm.radius.tolist(), swarm.columns["design"].tolist(), strict=True)
    robots = {robot.unique_id: (radius, design) for robot, radius, design in rows}
    return Scene(
        name=type(model).__name__,
        bounds=model.map.bounds,
        obstacles=tuple(body.shape for body in model.obstacles if not isinstance(body, Load)),
        forms={load.unique_id: load.form for load in model.loads},
        designs=(*swarm.designs, UNKNOWN),
        robots=robots,
        leave=model.fire_constants.leave,
        join=model.fire_constants.join,
        start=_frame_of(recording, model),
        note="",
    )


def _frame_of(recording: Recording, model: SwarmModel) -> Frame:
    layout = Layout(model, recording.columns, recording.provenance["exact"])
    chunk = Chunk(layout, model, 1)
    chunk.put(0, model.completed, None)
    return chunk_of(chunk.batch(1))[0]


def _note(recording: Recording, known: dict) -> str:
    """Say what cannot be drawn as it was."""
    if "scenery" not in recording.provenance:
        return (
            f"{recording.provenance['model']['name']} cannot be made again: all robots are drawn with a radius of "
            f"{UNKNOWN.radius:g}, obstacles as they are on the map, loads not at all"
        )
    if len(recording) and not {*recording[0].robots.tolist(), *recording[-1].robots.tolist()} <= known.keys():
        return f"robots that were added while this was recorded are drawn with a radius of {UNKNOWN.radius:g}"
    return ""
