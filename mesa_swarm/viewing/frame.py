"""Frames: what a step looks like, as arrays and as few bytes.

What rounding leaves out: positions are right to within half of 1/65535 of the map's width or height, headings to
half of 1/65536 of a turn, distances to half of 1/254 of the longest sensor's range, commands to half of 1/127 of
the fastest design's speed, heat to half of 1/200 (at most 1.275), temperatures of fires to half of 1/255, azimuths
of contacts to half of 1/256 of a turn. More than 255 robots at a fire are 255.

A chunk is a zlib stream of segments, within which nothing is added or removed. A segment is, little-endian:

1. int32: rows, robots, sensors, fires, loads, contacts in all rows;
2. int32: the step of each row, the robots' ids, the loads' indices, the row of the robot of each contact;
3. float32: x, y and radius of each fire;
4. tracks: columns of unsigned whole numbers, each of them a table (rows, values), see `_coded`;
5. zeros up to a multiple of four bytes.
"""

import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.frames import Frame
from mesa_swarm.viewing.scene import COLUMNS
from mesa_swarm.world.bodies import Load

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


def moment_of_model(model: FireModel, world: dict) -> Moment:
    """Return what there is to draw of a model now; sensors are read anew, to match the poses that one sees.

    Parameters
    ----------
    model : SwarmModel
    world : dict
        Of `world_of_model`.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> from mesa_swarm import AGENT9
    >>> from mesa_swarm.viewing.scene import world_of_model
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
    >>> from mesa_swarm import SwarmModel
    >>> from mesa_swarm.viewing.scene import world_of_model
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


TURN = 2 * np.pi
NOTHING, NOWHERE = 255, 65535
HEAT_STEPS = 200
LEVEL = 9
# A pose goes on as it went; all else stays as it is.
GOES_ON, STAYS = 2, 1


def packed_chunk(moments: Iterable[Moment], world: dict) -> bytes:
    """Return moments in the order of time as one chunk.

    Parameters
    ----------
    moments : iterable of Moment
    world : dict
        Of `worlds_of_recording`, any of them, or `world_of_model`.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> from mesa_swarm.viewing.frame import moment_of_model
    >>> from mesa_swarm.viewing.scene import world_of_model
    >>> model = SwarmModel(rng=1)
    >>> world = world_of_model(model)
    >>> len(zlib.decompress(packed_chunk([moment_of_model(model, world)], world)))
    32
    """
    return zlib.compress(b"".join(_segment(part, world) for part in _segments(moments)), LEVEL)


def _segments(moments: Iterable[Moment]) -> Iterator[list[Moment]]:
    """Cut where robots, fires or loads are added or removed."""
    segment: list[Moment] = []
    for moment in moments:
        if segment and _population(moment) != _population(segment[-1]):
            yield segment
            segment = []
        segment.append(moment)
    if segment:
        yield segment


def _population(moment: Moment) -> tuple:
    columns = moment.columns
    things = columns["ids"], columns["fires"][:, :3], columns["loads"][:, 0], columns["design"]
    return moment.sensors, *(values.tobytes() for values in things)


def _segment(moments: Sequence[Moment], world: dict) -> bytes:
    first, contacts = moments[0].columns, np.concatenate([moment.columns["contacts"] for moment in moments])
    counts = [len(first["ids"]), moments[0].sensors, len(first["fires"]), len(first["loads"]), len(contacts)]
    whole = [
        [len(moments), *counts],
        [moment.step for moment in moments],
        first["ids"].ravel(),
        first["loads"][:, 0],
        contacts[:, 0],
    ]
    parts = [np.asarray(values).astype("<i4").tobytes() for values in whole]
    parts.append(first["fires"][:, :3].astype("<f4").tobytes())
    parts += [_coded(track, order) for track, order in _tracks(moments, contacts[:, 1], world)]
    length = sum(map(len, parts))
    return b"".join([*parts, bytes(-length % 4)])


def _tracks(moments: Sequence[Moment], azimuths: np.ndarray, world: dict) -> Iterator[tuple[np.ndarray, int]]:
    """Iterate over the tracks of a segment, and how each is foretold."""
    rounded = {
        "distance": lambda values: _shares(values, world["reach"], NOTHING - 1, NOTHING),
        "command": lambda values: _whole(values / world["fastest"] * 127 + 128, np.uint8),
        "heat": lambda values: _whole(values * HEAT_STEPS, np.uint8),
        "heard": lambda values: _places(values, world["bounds"]),
    }
    yield _poses(_column(moments, "pose"), world["bounds"]), GOES_ON
    for column in world["columns"]:
        name = column["name"]
        if name in rounded:
            yield rounded[name](_column(moments, name)), STAYS
        elif column["type"] == "i1":
            yield _column(moments, name).astype(np.uint8), STAYS
    fires = _column(moments, "fires")[..., 3:] * [255, 1, 1]
    yield _whole(fires, np.uint8), STAYS
    yield _poses(_column(moments, "loads")[..., 1:], world["bounds"]), GOES_ON
    yield np.array([[len(moment.columns["contacts"])] for moment in moments], np.uint16), STAYS
    yield _turns(azimuths, 256).astype(np.uint8)[:, None], STAYS


def _coded(track: np.ndarray, order: int) -> bytes:
    """Return the differences of each value from what it was, as many times over as the order says.

    Modulo 256 or 65536; all steps of the first value, then of the second ...; of two bytes all low ones first.
    """
    if not track.size:
        return b""
    table = track.reshape(len(track), -1)
    for _ in range(order):
        table = np.diff(table, axis=0, prepend=np.zeros((1, table.shape[1]), table.dtype))
    planes = np.ascontiguousarray(table.T).astype(f"<u{table.itemsize}").view(np.uint8).reshape(-1, table.itemsize)
    return planes.T.tobytes()


def _column(moments: Sequence[Moment], name: str) -> np.ndarray:
    return np.stack([moment.columns[name] for moment in moments]).astype(
        float if moments[0].columns[name].dtype.kind == "f" else moments[0].columns[name].dtype
    )


def _poses(poses: np.ndarray, bounds: Sequence[float]) -> np.ndarray:
    turns = _turns(poses[..., 2:], 65536).astype(np.uint16)
    return np.concatenate([_on_map(poses[..., :2], bounds, 65535), turns], axis=-1)


def _places(places: np.ndarray, bounds: Sequence[float]) -> np.ndarray:
    nowhere = np.isnan(places)
    return np.where(nowhere, np.uint16(NOWHERE), _on_map(np.where(nowhere, 0.0, places), bounds, NOWHERE - 1))


def _on_map(places: np.ndarray, bounds: Sequence[float], most: int) -> np.ndarray:
    low, high = np.array(bounds).reshape(2, 2)
    return np.rint(np.clip((places - low) / (high - low), 0, 1) * most).astype(np.uint16)


def _turns(azimuth: np.ndarray, steps: int) -> np.ndarray:
    return np.rint(azimuth / TURN * steps).astype(np.int64) % steps


def _shares(values: np.ndarray, largest: float, steps: int, nothing: int) -> np.ndarray:
    return np.where(values < 0, nothing, np.clip(np.rint(values / largest * steps), 0, steps)).astype(np.uint8)


def _whole(values: np.ndarray, dtype: type) -> np.ndarray:
    return np.clip(np.rint(values), 0, np.iinfo(dtype).max).astype(dtype)
