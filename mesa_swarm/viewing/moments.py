"""Moments: what changes from step to step in a drawing, of a model that runs or of a recorded frame, and as bytes."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.model import SwarmModel
from mesa_swarm.recording.frames import Frame
from mesa_swarm.viewing.worlds import COLUMNS
from mesa_swarm.world.load import Load

TYPES = {"f4": "<f4", "i4": "<i4", "i1": "i1"}
MOST_INDEX = 127
FIRE_FIELDS = ("x", "y", "radius", "temperature", "robots", "out")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Moment:
    """All that is drawn of one step.

    Parameters
    ----------
    step : int
    sensors : int
        Readings a robot in `distance` and `kind`.
    columns : dict of ndarray
        Those of `worlds.COLUMNS` that are known, shape (rows, values), map units and rad; `heat` is a share of
        the temperature at which a robot is too hot, `heard` a place on the map.
    """

    step: int
    sensors: int
    columns: dict[str, np.ndarray]


def moment_of_model(model: SwarmModel, world: dict) -> Moment:
    """Return what there is to draw of a model now; sensors are read anew, to match the poses that one sees.

    Parameters
    ----------
    model : SwarmModel
    world : dict
        Of `world_of_model`.

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> from mesa_swarm.viewing.worlds import world_of_model
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(AGENT9, poses=[(100, 200, 0.5)])
    >>> moment_of_model(model, world_of_model(model)).columns["pose"]
    array([[100. , 200. ,   0.5]], dtype=float32)
    """
    model.sense()
    swarm, contacts = model.swarm, model.contacts
    ids = np.array([robot.unique_id for robot in swarm.agents], np.int32)
    fires = [model.fires.position, *(model.fires.columns[name] for name in FIRE_FIELDS[2:])]
    loads = [(load.unique_id, *load.pose) for load in model.obstacle_list if isinstance(load, Load)]
    given = {
        "ids": ids,
        "fires": np.column_stack(fires),
        "loads": _placed_loads(np.array(loads, float).reshape(-1, 4), world),
        "contacts": _contacts(ids, contacts.robot, contacts.normal),
    }
    return _moment(model.completed, given | _robots(swarm.columns, ids, world))


def moment_of_frame(frame: Frame, world: dict) -> Moment:
    """Return what there is to draw of a recorded frame.

    Parameters
    ----------
    frame : Frame
        Of a `Recording`.
    world : dict
        Of `worlds_of_recording`, that of the frame's step.
    """
    known, ids = frame.columns, frame.robots
    given = {"ids": ids, "fires": np.empty((0, 6)), "loads": np.empty((0, 4)), "contacts": np.empty((0, 2))}
    if "fires" in known:
        given["fires"] = _stacked(known["fires"], FIRE_FIELDS)
    if "loads" in known:
        given["loads"] = _placed_loads(_stacked(known["loads"], ("load", "x", "y", "heading")), world)
    if "contacts" in known:
        table = known["contacts"]
        given["contacts"] = _contacts(ids, table["robot"], _stacked(table, ("normal_x", "normal_y")))
    return _moment(frame.step, given | _robots(known, ids, world))


def packed_frame(moment: Moment, world: dict) -> bytes:
    """Return a moment as the bytes that ``unpacked`` of ``canvas.js`` reads.

    Six little-endian int32: step, and how many robots, sensors, fires, loads and contacts; then the columns of
    ``world["columns"]``, each row after row in its type.

    Examples
    --------
    >>> from mesa_swarm.viewing.worlds import world_of_model
    >>> model = SwarmModel(rng=1)
    >>> world = world_of_model(model)
    >>> len(packed_frame(moment_of_model(model, world), world))
    24
    """
    tables = [len(moment.columns[name]) for name in ("fires", "loads", "contacts")]
    head = np.array([moment.step, len(moment.columns["ids"]), moment.sensors, *tables], "<i4")
    parts = [moment.columns[column["name"]].astype(TYPES[column["type"]]).tobytes() for column in world["columns"]]
    return b"".join([head.tobytes(), *parts])


def _moment(step: int, columns: dict[str, np.ndarray]) -> Moment:
    typed = {name: _table(values, COLUMNS[name][2]) for name, values in columns.items()}
    sensors = typed["distance"].shape[1] if "distance" in typed else 0
    return Moment(step=step, sensors=sensors, columns=typed)


def _table(values: np.ndarray, kind: str) -> np.ndarray:
    table = values if values.ndim > 1 else values[:, None]
    return (np.clip(table, -MOST_INDEX - 1, MOST_INDEX) if kind == "i1" else table).astype(TYPES[kind])


def _robots(known: dict[str, np.ndarray], ids: np.ndarray, world: dict) -> dict[str, np.ndarray]:
    """Return the robots' columns, from those of a swarm or of a recording."""
    wanted = {column["name"] for column in world["columns"]}
    position = known["position"]
    heading = known.get("heading", np.zeros(len(position)))
    columns = {name: known[name] for name in ("distance", "kind", "command", "layer") if name in wanted}
    columns["pose"] = np.column_stack([position, heading])
    columns["design"] = design_of(ids, world)
    if "heat" in wanted:
        columns["heat"] = known["temperature"] / world["leave"]
    if "heard" in wanted:
        columns["heard"] = position + _turned(known["heard_from"], heading)
    return columns


def design_of(ids: np.ndarray, world: dict) -> np.ndarray:
    """Return the index of each robot's design, 0 for robots that the world does not know.

    Examples
    --------
    >>> design_of(np.array([4, 7, 9]), {"robots": [[3, 5, 0], [6, 8, 1]]})
    array([0, 1, 0])
    """
    if not world["robots"]:
        return np.zeros(len(ids), int)
    first, last, design = np.array(world["robots"]).T
    run = np.maximum(np.searchsorted(first, ids, side="right") - 1, 0)
    return np.where((ids >= first[run]) & (ids <= last[run]), design[run], 0)


def _contacts(ids: np.ndarray, robots: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the row of each robot that met something, and the azimuth in which that is."""
    return np.column_stack([np.searchsorted(ids, robots), np.arctan2(-normal[:, 1], -normal[:, 0])])


def _placed_loads(table: np.ndarray, world: dict) -> np.ndarray:
    """Return loads with their index in the world instead of their id, -1 where the world does not know them."""
    places = {load["id"]: place for place, load in enumerate(world["loads"])}
    return np.column_stack([[places.get(int(one), -1) for one in table[:, 0]], table[:, 1:]])


def _stacked(table: np.ndarray, fields: tuple[str, ...]) -> np.ndarray:
    return np.column_stack([table[field].astype(float) for field in fields])


def _turned(vector: np.ndarray, heading: np.ndarray) -> np.ndarray:
    cosine, sine = np.cos(heading), np.sin(heading)
    x, y = vector.T
    return np.column_stack([x * cosine - y * sine, x * sine + y * cosine])
