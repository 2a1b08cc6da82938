"""What the browser does with bytes, in NumPy, written from the description of the format and not from its code."""

import struct
import zlib
from itertools import accumulate

import numpy as np

TYPES = {"f4": np.dtype("<f4"), "i4": np.dtype("<i4"), "i1": np.dtype("i1")}


def unpacked_frame(packed: bytes, world: dict) -> tuple[int, dict]:
    """Return the step and the columns of a packed frame."""
    step, *counts = struct.unpack_from("<6i", packed)
    rows = dict(zip(("robots", "sensors", "fires", "loads", "contacts"), counts, strict=True))
    columns, at = {}, 24
    for column in world["columns"]:
        width = rows["sensors"] if column["width"] == "sensors" else column["width"]
        size = rows[column["table"]] * width
        values = np.frombuffer(packed, TYPES[column["type"]], size, at)
        columns[column["name"]] = values.reshape(rows[column["table"]], width)
        at += values.nbytes
    for name in world.get("fields", ()):
        at += -at % 4
        shape = struct.unpack_from("<2i", packed, at)
        columns[f"peak.{name}"] = struct.unpack_from("<f", packed, at + 8)[0]
        columns[f"fields.{name}"] = np.frombuffer(packed, np.uint8, shape[0] * shape[1], at + 12).reshape(shape)
        at += 12 + shape[0] * shape[1]
    assert at == len(packed)
    return step, columns


class Reader:
    def __init__(self, packed):
        self.packed, self.at = packed, 0

    def take(self, kind, count):
        values = np.frombuffer(self.packed, kind, count, self.at)
        self.at += values.nbytes
        return values

    def track(self, rows, values, kind, times):
        """Undo differences by summing them up, modulo the type's size."""
        planes = self.take(np.uint8, rows * values * kind(0).itemsize).reshape(kind(0).itemsize, -1)
        table = sum(plane.astype(np.int64) << (8 * place) for place, plane in enumerate(planes))
        table = np.asarray(table, np.int64).reshape(values, rows)
        for _ in range(times):
            table = np.cumsum(table, axis=1)
        return (table % (1 << (8 * kind(0).itemsize))).T


def unpacked_chunk(packed: bytes, world: dict) -> list[tuple[int, dict]]:
    """Return the steps and columns of the frames of a chunk."""
    reader, frames = Reader(zlib.decompress(packed)), []
    while reader.at < len(reader.packed):
        frames += segment(reader, world)
    return frames


def segment(reader: Reader, world: dict) -> list[tuple[int, dict]]:
    rows, n, sensors, f, k, met = reader.take("<i4", 6).tolist()
    shapes = {name: tuple(reader.take("<i4", 2).tolist()) for name in world.get("fields", ())}
    steps, ids, index, robots = (reader.take("<i4", count) for count in (rows, n, k, met))
    discs = reader.take("<f4", 3 * f).reshape(f, 3)
    peaks = reader.take("<f4", rows * len(shapes)).reshape(rows, len(shapes))
    tracks = {"pose": reader.track(rows, 3 * n, np.uint16, 2)}
    widths = {"distance": sensors, "kind": sensors, "command": 2, "heard": 2, "label": 12}
    for column in world["columns"]:
        name = column["name"]
        if column["table"] == "robots" and name not in ("ids", "pose"):
            kind = np.uint16 if name == "heard" else np.uint8
            tracks[name] = reader.track(rows, n * widths.get(name, 1), kind, 1)
    burning, laid = reader.track(rows, 3 * f, np.uint8, 1), reader.track(rows, 3 * k, np.uint16, 2)
    counts = reader.track(rows, 1, np.uint16, 1)[:, 0]
    azimuth = reader.track(met, 1, np.uint8, 1)[:, 0] / 256 * 2 * np.pi
    pictures = {name: reader.track(rows, high * wide, np.uint8, 1) for name, (high, wide) in shapes.items()}
    reader.at += -reader.at % 4
    ends = [0, *accumulate(counts.tolist())]
    low, high = np.array(world["bounds"]).reshape(2, 2)
    frames, wide = [], {"pose": 3} | {name: widths.get(name, 1) for name in tracks if name != "pose"}
    for row in range(rows):
        part = {name: track[row].reshape(n, wide[name]) for name, track in tracks.items()}
        columns = {
            "ids": ids[:, None],
            "pose": pose(part["pose"], low, high),
            "fires": np.hstack([discs, burning[row].reshape(f, 3) / [255, 1, 1]]),
            "loads": np.hstack([index[:, None], pose(laid[row].reshape(k, 3), low, high)]),
            "contacts": np.stack([robots, azimuth], axis=1)[ends[row] : ends[row + 1]],
        }
        for name in part.keys() - {"pose"}:
            columns[name] = value(name, part[name], world, low, high)
        columns |= {f"fields.{name}": track[row].reshape(shapes[name]) for name, track in pictures.items()}
        columns |= {f"peak.{name}": peak for name, peak in zip(shapes, peaks[row].tolist(), strict=True)}
        frames.append((int(steps[row]), columns))
    return frames


def pose(table, low, high):
    return np.hstack([low + table[:, :2] / 65535 * (high - low), table[:, 2:] / 65536 * 2 * np.pi])


def value(name, table, world, low, high):
    if name == "distance":
        return np.where(table == 255, -1.0, table / 254 * world["reach"])
    if name == "command":
        return (table - 128) / 127 * world["fastest"]
    if name == "heat":
        return table / 200
    if name == "heard":
        return np.where(table == 65535, np.nan, low + table / 65534 * (high - low))
    return table.astype(np.uint8).view(np.int8)
