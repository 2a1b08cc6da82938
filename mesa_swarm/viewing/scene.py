"""Scenes: what stands behind the frames of a model or a recording."""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from operator import itemgetter

from mesa_swarm.errors import RecordingError
from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.provenance import map_of, scenery_of
from mesa_swarm.recording.recording import Recording
from mesa_swarm.world.map import Map
from mesa_swarm.world.shapes import shape_to_json

# name: (table, values a row, type). Wider types first: in a packed frame each array is then aligned.
COLUMNS: dict[str, tuple[str, int | str, str]] = {
    "ids": ("robots", 1, "i4"),
    "pose": ("robots", 3, "f4"),
    "distance": ("robots", "sensors", "f4"),
    "command": ("robots", 2, "f4"),
    "heat": ("robots", 1, "f4"),
    "heard": ("robots", 2, "f4"),
    "fires": ("fires", 6, "f4"),
    "loads": ("loads", 4, "f4"),
    "contacts": ("contacts", 2, "f4"),
    "kind": ("robots", "sensors", "i1"),
    "layer": ("robots", 1, "i1"),
    "design": ("robots", 1, "i1"),
}
# Which recorded column a drawn one is made from, where the names differ; what is always there is not named.
MADE_FROM = {"heat": "temperature", "heard": "heard_from"}
ALWAYS = frozenset({"ids", "pose", "design", "fires", "loads", "contacts"})
# In what the worlds of one recording may differ: robots and loads that came later are known to all of them.
OWN = ("shapes", "layers", "leave")
# Of robots and loads in recordings that do not tell: version 0.1.0 did not write scenery.
USUAL_DESIGN = {"name": "robot", "radius": 5.0, "max_speed": 1.0, "holonomic": False, "sensors": []}
USUAL_RADIUS = 10.0
USUAL_LEAVE = 100.0


def world_of_model(model: FireModel) -> dict:
    """Return the world of a model; make it anew when robots, obstacles or loads were added or removed.

    Parameters
    ----------
    model : SwarmModel

    Returns
    -------
    dict
        As described at the top of ``canvas.js``.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> world_of_model(SwarmModel(rng=1))["bounds"]
    [0.0, 0.0, 800.0, 600.0]
    """
    return _world(scenery_of(model), model.map, COLUMNS)


def worlds_of_recording(recording: Recording) -> list[tuple[int, dict]]:
    """Return the worlds of a recording, each with the first step that it is of, see `world_at`.

    What is not recorded is drawn as it usually is, or not at all. The worlds differ in `OWN` alone.

    Parameters
    ----------
    recording : Recording

    Raises
    ------
    RecordingError
        If it has no positions.
    """
    if "position" not in recording.columns:
        raise RecordingError(f"{recording.path} has no positions to draw; record the column 'position' as well")
    chart = map_of(recording.provenance)
    recorded = [name for name in COLUMNS if name in ALWAYS or MADE_FROM.get(name, name) in recording.columns]
    if "kind" not in recorded or "distance" not in recorded:
        recorded = [name for name in recorded if name not in ("kind", "distance")]
    sceneries = recording.sceneries or ((0, _usual_scenery(recording, chart)),)
    return [(step, _world(scenery, chart, recorded)) for step, scenery in sceneries]


def world_at(worlds: Sequence[tuple[int, dict]], step: int) -> dict:
    """Return the world of a step.

    Parameters
    ----------
    worlds : sequence of (step, dict)
        Of `worlds_of_recording`.
    step : int

    Examples
    --------
    >>> world_at([(10, {"map": "a"}), (20, {"map": "b"})], 19)
    {'map': 'a'}
    """
    return worlds[max(bisect_right(worlds, step, key=itemgetter(0)) - 1, 0)][1]


def knows_bodies(recording: Recording) -> bool:
    """Tell whether a recording says how large its robots are, and what sensors they have."""
    return bool(recording.provenance.get("scenery"))


def _world(scenery: dict, chart: Map, columns: Iterable[str]) -> dict:
    designs = scenery["designs"] or [USUAL_DESIGN]
    ranges = [sensor[4] for design in designs for sensor in design["sensors"]]
    return {
        "map": chart.name,
        "bounds": list(map(float, chart.bounds)),
        "shapes": scenery["shapes"],
        "loads": scenery["loads"],
        "designs": designs,
        "robots": scenery["robots"],
        "layers": scenery["layers"],
        "leave": scenery["leave"],
        "reach": max(ranges, default=0.0) or 1.0,
        "fastest": max(design["max_speed"] for design in designs) or 1.0,
        "columns": [
            dict(zip(("name", "table", "width", "type"), (name, *COLUMNS[name]), strict=True)) for name in columns
        ],
    }


def _usual_scenery(recording: Recording, chart: Map) -> dict:
    first = recording[0] if recording.intact else None
    loads = first["loads"]["load"].tolist() if first and "loads" in first.columns else []
    return {
        "designs": [USUAL_DESIGN],
        "robots": [],
        "shapes": [shape_to_json(shape) for shape in chart.obstacles],
        "loads": [{"id": load, "disc": [0.0, 0.0, USUAL_RADIUS]} for load in loads],
        "layers": [],
        "leave": recording.provenance["parameters"].get("leave", USUAL_LEAVE),
    }
