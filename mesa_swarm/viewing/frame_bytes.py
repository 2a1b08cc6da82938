"""Frames on their way to a browser: one as typed arrays, many as few bytes.

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

Pictures of scalar fields are shrunk to at most 20,000 pixels in chunks. If the scene has fields, rows and columns of
the picture of each follow the first numbers of a segment (int32), the largest value so far of each in each row follows
the fires (float32), and their pixels are its last tracks. If it has parts with discs, the number of discs in each row
follows the contacts (int32), and the place of its part, x, y and radius of each the largest values of fields (float32).
"""

import zlib
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from mesa_swarm.model.looks import label_bytes
from mesa_swarm.recording.frames import NO_ROWS, Frame, field_levels, field_peaks
from mesa_swarm.recording.layout import PIXELS
from mesa_swarm.viewing.palette import value_steps
from mesa_swarm.viewing.scene import COLUMNS, Scene, looks_in
from mesa_swarm.world.fields import average_blocks

TYPES = {"f4": "<f4", "i4": "<i4", "i1": "i1"}
MOST_INDEX = 127
TURN = 2 * np.pi
NOTHING, NOWHERE = 255, 65535
HEAT_STEPS = 200
LEVEL = 9
# A pose goes on as it went; all else stays as it is.
GOES_ON, STAYS = 2, 1
# What frames of a model are packed from.
PACKED_FROM = (
    *("position", "heading", "distance", "kind", "command", "temperature", "heard_from", "layer", "hot"),
    *("fires", "loads", "contacts", "fields", "shown"),
)
# Pixels of a field in each row of a chunk.
MOST_PIXELS = 20_000
FIRE_FIELDS = ("x", "y", "radius", "temperature", "robots", "out")
LOAD_FIELDS = ("x", "y", "heading")
# The columns of one step by name, as `drawn_columns` returns them.
Columns = dict[str, np.ndarray]


def packed_frame(frame: Frame, scene: Scene) -> bytes:
    """Return a frame as the bytes that ``unpacked`` of ``canvas.js`` reads.

    Six little-endian int32: step, and how many robots, sensors, fires, loads and contacts; then the columns of the
    scene, each row after row in its type. A frame of a model needs the columns `PACKED_FROM`. If the scene has fields,
    of each follow zeros up to a multiple of four bytes, int32 rows and columns, float32 its largest value so far, and a
    byte a pixel, from below. If the scene has parts with discs, after such zeros follow int32 their number, and float32
    the place of the part, x, y and radius of each.
    """
    columns = drawn_columns(frame, scene)
    tables = [len(columns[name]) for name in ("fires", "loads", "contacts")]
    head = np.array([frame.step, len(frame.robots), _sensors(columns), *tables], "<i4")
    packed = b"".join([head.tobytes(), *(columns[name].tobytes() for name in scene.columns)])
    for name, peak in zip(scene.fields, field_peaks(frame, scene.fields), strict=True):
        picture, peaks = columns[PIXELS + name], np.array([peak], "<f4")
        packed += bytes(-len(packed) % 4) + np.array(picture.shape, "<i4").tobytes() + peaks.tobytes()
        packed += picture.tobytes()
    if scene.parts:
        discs = columns["shown"]
        packed += bytes(-len(packed) % 4) + np.array([len(discs)], "<i4").tobytes() + discs.tobytes()
    return packed


def drawn_columns(frame: Frame, scene: Scene) -> Columns:
    """Return the columns of a frame that the browser draws, shapes (rows, values), in their types.

    `heat` is a share of the temperature at which a robot is too hot, `heard` a place on the map.
    """
    known, n = frame.columns, len(frame.robots)
    position, heading = known["position"], known.get("heading", np.zeros(n))
    drawn: Columns = {
        name: known[name] for name in ("distance", "kind", "command", "layer", "hot") if name in scene.columns
    }
    if "command" in drawn:
        drawn["command"] = drawn["command"][:, :2]  # others are of drives whose command is not drawn
    drawn["pose"] = pose = np.empty((n, 3), "<f4")
    pose[:, :2], pose[:, 2] = position, heading
    drawn["ids"] = frame.robots
    drawn["design"] = np.maximum(scene.design_of(frame.robots), 0)
    if "heat" in scene.columns:
        drawn["heat"] = known["temperature"] / scene.world(frame.step)["leave"]
    if "heard" in scene.columns:
        drawn["heard"] = position + _turned(known["heard_from"], heading)
    drawn |= _looks(frame, scene)
    fires, loads, contacts = (known.get(table, NO_ROWS[table]) for table in ("fires", "loads", "contacts"))
    drawn["fires"] = _fields(fires, FIRE_FIELDS)
    drawn["loads"] = _loads(loads, scene)
    drawn["contacts"] = _contacts(contacts, frame.robots)
    pictures = {PIXELS + name: field_levels(frame, name) for name in scene.fields}
    if scene.fields:
        pictures["peaks"] = np.array(field_peaks(frame, scene.fields), "<f4")
    if scene.parts:
        pictures["shown"] = scene.discs(frame).astype("<f4")
    return {name: _typed(values, COLUMNS[name][2]) for name, values in drawn.items()} | pictures


def _looks(frame: Frame, scene: Scene) -> Columns:
    """Return the index of each robot's colour, -1 for none, and its text as bytes, as far as the scene has them."""
    drawn: Columns = {}
    values, texts = looks_in(frame, scene)
    if "value" in scene.columns:
        column = scene.looks["column"]
        drawn["value"] = value_steps(values, column["low"], column["high"])
    if "label" in scene.columns:
        drawn["label"] = label_bytes(texts)
    return drawn


def _typed(values: np.ndarray, kind: str) -> np.ndarray:
    table = values if values.ndim > 1 else values[:, None]
    if kind == "i1" and table.dtype.itemsize > 1:
        table = np.minimum(np.maximum(table, -MOST_INDEX - 1), MOST_INDEX)
    return table.astype(TYPES[kind], copy=False)


def _sensors(columns: Columns) -> int:
    """Return how many readings a robot has."""
    return columns["distance"].shape[1] if "distance" in columns else 0


def _fields(table: np.ndarray, fields: Sequence[str], before: int = 0) -> np.ndarray:
    """Return fields of a table as float32 columns, after some columns that are left free."""
    out = np.empty((len(table), before + len(fields)), "<f4")
    for place, field in enumerate(fields, start=before):
        out[:, place] = table[field]
    return out


def _loads(table: np.ndarray, scene: Scene) -> np.ndarray:
    """Return loads with their index in the world instead of their id, -1 where the world does not know them."""
    rows = _fields(table, LOAD_FIELDS, before=1)
    rows[:, 0] = [scene.load_places.get(load, -1) for load in table["load"].tolist()]
    return rows


def _contacts(table: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """Return the row of each robot that met something, and the azimuth in which that is."""
    rows = np.empty((len(table), 2), "<f4")
    rows[:, 0] = np.searchsorted(ids, table["robot"])
    rows[:, 1] = np.arctan2(-table["normal_y"].astype(float), -table["normal_x"].astype(float))
    return rows


def _turned(vector: np.ndarray, heading: np.ndarray) -> np.ndarray:
    cosine, sine = np.cos(heading), np.sin(heading)
    x, y = vector.T
    return np.column_stack([x * cosine - y * sine, x * sine + y * cosine])


def packed_chunk(frames: Iterable[Frame], scene: Scene) -> bytes:
    """Return frames in the order of time as one chunk."""
    return packed_rows(((frame.step, _less(drawn_columns(frame, scene))) for frame in frames), scene.world())


def _less(columns: Columns) -> Columns:
    """Return columns with smaller pictures of fields."""
    small = {name: average_blocks(values, MOST_PIXELS) for name, values in columns.items() if name.startswith(PIXELS)}
    return {**columns, **{name: np.rint(values).astype(np.uint8) for name, values in small.items()}}


def packed_rows(rows: Iterable[tuple[int, Columns]], world: dict) -> bytes:
    """Return rows (step, drawn columns) in the order of time as one chunk, rounded as the limits of a world permit."""
    return zlib.compress(b"".join(_segment(part, world) for part in _segments(rows)), LEVEL)


def _segments(rows: Iterable[tuple[int, Columns]]) -> Iterator[list[tuple[int, Columns]]]:
    """Cut where robots, fires or loads are added or removed."""
    segment: list[tuple[int, Columns]] = []
    for row in rows:
        if segment and _population(row[1]) != _population(segment[-1][1]):
            yield segment
            segment = []
        segment.append(row)
    if segment:
        yield segment


def _population(columns: Columns) -> tuple:
    bodies = columns["ids"], columns["fires"][:, :3], columns["loads"][:, 0], columns["design"]
    pictures = [values.shape for name, values in columns.items() if name.startswith(PIXELS)]
    return _sensors(columns), *(values.tobytes() for values in bodies), *pictures


def _segment(segment: Sequence[tuple[int, Columns]], world: dict) -> bytes:
    steps, rows = zip(*segment, strict=True)
    first, contacts = rows[0], np.concatenate([columns["contacts"] for columns in rows])
    counts = [len(first["ids"]), _sensors(first), len(first["fires"]), len(first["loads"]), len(contacts)]
    pictures = [PIXELS + name for name in world.get("fields", ())]
    counts += [length for name in pictures for length in first[name].shape]
    whole = [[len(rows), *counts], steps, first["ids"].ravel(), first["loads"][:, 0], contacts[:, 0]]
    discs = [columns["shown"] for columns in rows if world.get("parts")]
    whole.append([len(table) for table in discs])
    parts = [np.asarray(values).astype("<i4").tobytes() for values in whole]
    parts.append(first["fires"][:, :3].astype("<f4").tobytes())
    parts += [columns["peaks"].tobytes() for columns in rows if pictures]
    parts += [table.astype("<f4").tobytes() for table in discs]
    parts += [_coded(track, order) for track, order in _tracks(rows, contacts[:, 1], world)]
    parts += [_coded(np.stack([columns[name] for columns in rows]), STAYS) for name in pictures]
    length = sum(map(len, parts))
    return b"".join([*parts, bytes(-length % 4)])


def _tracks(rows: Sequence[Columns], azimuths: np.ndarray, world: dict) -> Iterator[tuple[np.ndarray, int]]:
    """Iterate over the tracks of a segment, and the predictor order of each."""
    rounded = {
        "distance": lambda values: _shares(values, world["reach"], NOTHING - 1, NOTHING),
        "command": lambda values: _whole(values / world["fastest"] * 127 + 128, np.uint8),
        "heat": lambda values: _whole(values * HEAT_STEPS, np.uint8),
        "heard": lambda values: _places(values, world["bounds"]),
    }
    yield _poses(_column(rows, "pose"), world["bounds"]), GOES_ON
    for column in world["columns"]:
        name = column["name"]
        if name in rounded:
            yield rounded[name](_column(rows, name)), STAYS
        elif column["type"] == "i1":
            yield _column(rows, name).astype(np.uint8), STAYS
    fires = _column(rows, "fires")[..., 3:] * [255, 1, 1]
    yield _whole(fires, np.uint8), STAYS
    yield _poses(_column(rows, "loads")[..., 1:], world["bounds"]), GOES_ON
    yield np.array([[len(columns["contacts"])] for columns in rows], np.uint16), STAYS
    yield _turns(azimuths, 256).astype(np.uint8)[:, None], STAYS


def _coded(track: np.ndarray, order: int) -> bytes:
    """Return the differences of each value from the one before, of the given order.

    Modulo 256 or 65536; all steps of the first value, then of the second ...; of two bytes all low ones first.
    """
    if not track.size:
        return b""
    table = track.reshape(len(track), -1)
    for _ in range(order):
        table = np.diff(table, axis=0, prepend=np.zeros((1, table.shape[1]), table.dtype))
    planes = np.ascontiguousarray(table.T).astype(f"<u{table.itemsize}").view(np.uint8).reshape(-1, table.itemsize)
    return planes.T.tobytes()


def _column(rows: Sequence[Columns], name: str) -> np.ndarray:
    column = np.stack([columns[name] for columns in rows])
    return column.astype(float) if column.dtype.kind == "f" else column


def _poses(poses: np.ndarray, bounds: Sequence[float]) -> np.ndarray:
    turns = _turns(poses[..., 2:], 65536).astype(np.uint16)
    return np.concatenate([on_map(poses[..., :2], bounds, 65535), turns], axis=-1)


def _places(places: np.ndarray, bounds: Sequence[float]) -> np.ndarray:
    nowhere = np.isnan(places)
    return np.where(nowhere, np.uint16(NOWHERE), on_map(np.where(nowhere, 0.0, places), bounds, NOWHERE - 1))


def on_map(places: np.ndarray, bounds: Sequence[float], most: int) -> np.ndarray:
    """Return places as whole numbers from 0 to `most` along the width and the height of the map."""
    low, high = np.array(bounds).reshape(2, 2)
    return np.rint(np.clip((places - low) / (high - low), 0, 1) * most).astype(np.uint16)


def _turns(azimuth: np.ndarray, steps: int) -> np.ndarray:
    return np.rint(azimuth / TURN * steps).astype(np.int64) % steps


def _shares(values: np.ndarray, largest: float, steps: int, nothing: int) -> np.ndarray:
    return np.where(values < 0, nothing, np.clip(np.rint(values / largest * steps), 0, steps)).astype(np.uint8)


def _whole(values: np.ndarray, dtype: type) -> np.ndarray:
    return np.clip(np.rint(values), 0, np.iinfo(dtype).max).astype(dtype)
