"""Plain values and arrays in one container, which reading never executes."""

import base64
import json
import math
import re
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import shapely
from shapely.geometry.base import BaseGeometry

from mesa_swarm.base.errors import RecordingError, shortened
from mesa_swarm.model.state import ATOMS, DEEPEST, KINDS, SEQUENCES, is_float
from mesa_swarm.world.read_only import ReadOnlyArray

MAGIC = b"swarm checkpoint 1\n"
LENGTH = 8
# No state is larger; nor may reading it take more memory than this, or than this multiple of its size in the file, so
# that a small file cannot claim much. The writer has the same limits.
LARGEST = 1 << 30
MOST_MEMORY, MOST_TIMES = 100_000_000, 4
MOST_AXES = 32
CODEC = pa.Codec("zstd", compression_level=1)
# References to arrays in packed values, as JSON without spaces.
PLACES = re.compile(r'"(?:array|number)":(\d{1,9})\b')
# `KINDS` with their widths; objects and records are never stored.
DTYPE = re.compile(
    r"[<>|=]?(b1|[iu][1248]|f(2|4|8|12|16)|c(8|16|24|32)|[SU][1-9]\d{0,6}|[mM]8(\[\d{0,6}[A-Za-z]{1,2}\])?)"
)


class Packer:
    """Plain values of a checkpoint: JSON, and the arrays beside it.

    Numbers, texts, None, arrays, Shapely geometries, and lists, tuples, sets, deques and dicts of these are restored
    with their types and bits. An array that is found in two places is stored once and remains one array, and views of
    an array remain views of it.

    Examples
    --------
    >>> packer = Packer()
    >>> content = packer.pack({1: (2.5, np.arange(3))})
    >>> content
    {'dict': [[1, {'tuple': [2.5, {'array': 0}]}]]}
    >>> packer.unpack(content)
    {1: (2.5, array([0, 1, 2]))}
    >>> trail = np.zeros(2)
    >>> first, second = packer.unpack(packer.pack([trail, trail]))
    >>> first is second
    True
    """

    def __init__(self, arrays: list[np.ndarray] | None = None) -> None:
        self.arrays = [] if arrays is None else arrays
        # Packer arrays by their id, with their content: those that are in use keep it. And by that of their root, the
        # array whose memory they view.
        self._contents: dict[int, tuple[np.ndarray, dict]] = {}
        self._of_root: dict[int, list[tuple[np.ndarray, dict]]] = {}
        self._restored: dict[object, np.ndarray] = {}

    def pack(self, value: Any, what: str = "a value", depth: int = 0) -> object:
        """Return a value as JSON, in which numbers stand for arrays."""
        value = value.copy() if isinstance(value, ReadOnlyArray) else value
        kind = type(value)
        if depth > DEEPEST:
            raise RecordingError(f"{what} is nested more than {DEEPEST} deep, or contains itself")
        if kind in ATOMS or is_float(value):
            return value if kind in ATOMS else float(value)
        if isinstance(value, (np.ndarray, np.generic)):
            plain: Any = value
            return self._pack_array(plain, what) if kind is np.ndarray else {"number": self._add_array(value, what)}
        if kind is bytes:
            return {"bytes": base64.b64encode(value).decode()}
        if kind is complex:
            return {"complex": [value.real, value.imag]}
        if isinstance(value, BaseGeometry):
            name = "ring" if isinstance(value, shapely.LinearRing) else "geometry"  # which WKB does not distinguish
            return {name: base64.b64encode(shapely.to_wkb(value)).decode()}
        return self._pack_value(value, what, depth + 1)

    def _pack_value(self, value: Any, what: str, depth: int) -> object:
        kind = type(value)
        if kind is dict:
            return {"dict": [[self.pack(part, what, depth) for part in pair] for pair in value.items()]}
        if SEQUENCES.get(kind.__name__) is not kind:
            raise RecordingError(f"{what} is {shortened(value)}, which cannot be stored")
        members = sorted(value, key=repr) if kind in (set, frozenset) else value
        items = [self.pack(item, what, depth) for item in members]
        if kind is list:
            return items
        return {kind.__name__: items, **({"longest": value.maxlen} if kind is deque else {})}

    def unpack(self, content: Any) -> Any:
        """Return the value for which `pack` returned this."""
        if type(content) in ATOMS:
            return content
        if isinstance(content, list):
            return [self.unpack(item) for item in content]
        try:
            return self._unpack_value(content)
        except (TypeError, ValueError, AttributeError, LookupError, OverflowError):
            raise RecordingError(f"{shortened(content)} cannot be decoded") from None

    def _unpack_value(self, content: dict) -> Any:
        name, inner = list(content.items())[0]  # noqa: RUF015 - the caller expects an IndexError, not StopIteration
        if name in ("array", "number"):
            return self._unpack_array(inner, content.get("view")) if name == "array" else self._array(inner)[()]
        if name == "dict":
            return {self.unpack(key): self.unpack(value) for key, value in inner}
        if name == "deque":
            return deque(map(self.unpack, inner), maxlen=content["longest"])
        if name in ("bytes", "geometry", "ring"):
            raw = base64.b64decode(inner, validate=True)
            return raw if name == "bytes" else _geometry(raw, name)
        if name == "complex":
            return complex(*map(float, inner))
        return SEQUENCES[name](map(self.unpack, inner))

    def _add_array(self, value: np.ndarray | np.generic, what: str) -> int:
        array = np.asarray(value)
        if (
            array.dtype.kind not in KINDS
            or not array.dtype.itemsize
            or type(value) not in (np.ndarray, array.dtype.type)
        ):
            raise RecordingError(f"{what} is an array of {array.dtype}, which cannot be stored")
        self.arrays.append(np.ascontiguousarray(array).reshape(array.shape))
        return len(self.arrays) - 1

    def _array(self, place: object) -> np.ndarray:
        if type(place) is not int or not 0 <= place < len(self.arrays):
            raise RecordingError(f"array {shortened(place)} is not stored")
        return self.arrays[place]

    def adopt(self, content: Any, live: Any, places: frozenset[int] | None = None, *, write: bool = True) -> None:
        """Let arrays of a model, within a value that is now where another was packed, be those that are unpacked.

        They take the stored values, unless `write` is False. `places` limits this to arrays with these numbers.
        """
        if isinstance(live, np.ndarray):
            self._adopt_array(content, live, places, write)
        elif isinstance(live, dict) and isinstance(content, dict) and "dict" in content:
            for key, value in content["dict"]:
                if type(key) in ATOMS and key in live:
                    self.adopt(value, live[key], places, write=write)
        elif isinstance(live, (list, tuple)):
            inner = content.get(type(live).__name__, ()) if isinstance(content, dict) else content
            if isinstance(inner, list):
                for content_item, live_item in zip(inner, live, strict=False):
                    self.adopt(content_item, live_item, places, write=write)

    def _adopt_array(self, content: Any, live: np.ndarray, places: frozenset[int] | None, write: bool) -> None:
        if not isinstance(content, dict) or "array" not in content or not live.flags.writeable:
            return
        place, view = content["array"], content.get("view")
        if place in self._restored or (places is not None and place not in places):
            return
        array = self._array(place)
        whole = live.size == array.size and live.dtype == array.dtype and live.flags.c_contiguous
        layout = [0, list(live.shape), list(live.strides)]
        if not whole or (live.shape != array.shape if view is None else layout != view):
            return
        self._restored[place] = live
        if view:
            self._restored[_key_of(place, view)] = live
        if write:
            live.reshape(-1)[...] = array.reshape(-1)

    def _pack_array(self, value: np.ndarray, what: str) -> dict:
        if id(value) not in self._contents:
            # The root stays in memory with the value, and so does its id.
            self._contents[id(value)] = (value, self._new_content(value, _root_of(value), what))
        return self._contents[id(value)][1]

    def _new_content(self, value: np.ndarray, root: np.ndarray, what: str) -> dict:
        """Return the content of an array; arrays that view one other array are stored as views of it."""
        relatives = self._of_root.setdefault(id(root), [])
        similar = _is_part(value, root)
        for other, _ in relatives:
            if not (similar and _is_part(other, root)) and np.shares_memory(value, other):
                raise RecordingError(f"{what} is a view of an array with another type or shape, which cannot be stored")
        views = [pair for pair in relatives if similar and _is_part(pair[0], root)]
        content = self._view_content(value, root, *views[0], what) if views else {"array": self._add_array(value, what)}
        relatives.append((value, content))
        return content

    def _view_content(self, value: np.ndarray, root: np.ndarray, first: np.ndarray, content: dict, what: str) -> dict:
        memory = np.asarray(root).ravel(order="K")
        if not np.shares_memory(memory, root):
            raise RecordingError(f"{what} is a view of an array that is not contiguous, which cannot be stored")
        if "view" not in content:
            self.arrays[content["array"]] = memory
            content["view"] = _layout_of(first, memory)
        return {"array": content["array"], "view": _layout_of(value, memory)}

    def _unpack_array(self, place: Any, view: Any) -> np.ndarray:
        key = place if view is None else _key_of(place, view)
        if key not in self._restored:
            array = self._array(place)
            if place not in self._restored:
                self._restored[place] = array.copy()
            if view is not None:
                self._restored[key] = _view_array(self._restored[place], *view)
        return self._restored[key]


def _geometry(content: bytes, name: str) -> BaseGeometry:
    try:
        geometry = shapely.from_wkb(content)
    except shapely.errors.ShapelyError:
        raise ValueError from None
    return shapely.LinearRing(geometry.coords) if name == "ring" else geometry


def _root_of(array: np.ndarray) -> np.ndarray:
    """Return the array whose memory an array views; if it is not a view, the array itself."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array


def _is_part(array: np.ndarray, root: np.ndarray) -> bool:
    """Return whether an array can be stored as a view of its root."""
    return array.dtype == root.dtype and 0 < array.nbytes <= root.nbytes


def _layout_of(array: np.ndarray, memory: np.ndarray) -> list:
    """Return where an array lies in memory: offset in bytes, shape, and strides."""
    offset = array.__array_interface__["data"][0] - memory.__array_interface__["data"][0]
    return [offset, list(array.shape), list(array.strides)]


def _key_of(place: Any, view: Any) -> tuple:
    offset, shape, strides = view
    return place, offset, tuple(shape), tuple(strides)


def _view_array(whole: np.ndarray, offset: int, shape: list, strides: list) -> np.ndarray:
    """Return a view of an array, which cannot reach beyond it, nor be larger."""
    if len(shape) > MOST_AXES or math.prod(shape) > whole.size:
        raise ValueError
    return np.ndarray(tuple(shape), whole.dtype, whole.reshape(-1), offset, tuple(strides))


@dataclass(kw_only=True, eq=False)
class Checkpoint:
    """The complete state of a model after a step: facts as JSON, and the arrays to which these refer by number.

    The restored model must have the same `state_hash`.
    """

    step: int
    state_hash: str
    facts: dict
    arrays: list[np.ndarray] = field(default_factory=list)


def to_bytes(checkpoint: Checkpoint) -> bytes:
    """Return a checkpoint as bytes, unless it is too large for `from_bytes`."""
    parts = [np.ascontiguousarray(array).tobytes() for array in checkpoint.arrays]
    head = {
        "step": checkpoint.step,
        "state_hash": checkpoint.state_hash,
        "facts": checkpoint.facts,
        "arrays": [[array.dtype.str, list(array.shape)] for array in checkpoint.arrays],
    }
    words = json.dumps(head, separators=(",", ":")).encode()
    whole = b"".join([len(words).to_bytes(LENGTH, "little"), words, *parts])
    compressed = MAGIC + len(whole).to_bytes(LENGTH, "little") + CODEC.compress(whole, asbytes=True)
    needed, allowed = 2 * len(whole) + memory_of(words), _find_most_memory(compressed)
    if len(whole) > LARGEST or needed > allowed:
        raise RecordingError(
            f"the state has {len(whole):,} bytes and needs about {needed:,} to be read, more than the {allowed:,} of "
            "a checkpoint; use smaller arrays, or collect less"
        )
    return compressed


def memory_of(words: bytes | str) -> int:
    """Return an upper estimate of the bytes that a JSON text takes once it is read."""
    count: Any = words.count
    objects, lists, values = (count(sign if isinstance(words, str) else sign.encode()) for sign in "{[,")
    # Texts with one rare letter take four bytes a letter, beside the JSON text itself.
    return 5 * len(words) + 230 * objects + 90 * lists + 48 * values


def _find_most_memory(compressed: bytes) -> int:
    return max(MOST_MEMORY, MOST_TIMES * len(compressed))


def from_bytes(content: bytes) -> Checkpoint:
    """Return the checkpoint that `to_bytes` wrote; every size is checked before memory is allocated."""
    try:
        return _read(content)
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError, MemoryError, OSError, RecursionError):
        raise RecordingError("the checkpoint is damaged, or was written by another version") from None


def _read(content: bytes) -> Checkpoint:
    begin = len(MAGIC) + LENGTH
    size = int.from_bytes(content[len(MAGIC) : begin], "little")
    allowed = _find_most_memory(content)
    if not content.startswith(MAGIC) or not LENGTH <= size <= min(LARGEST, allowed // 2):
        raise ValueError
    whole = CODEC.decompress(content[begin:], decompressed_size=size, asbytes=True)
    at = LENGTH + int.from_bytes(whole[:LENGTH], "little")
    if len(whole) != size or at > size:
        raise ValueError
    words = whole[LENGTH:at]
    if 2 * size + memory_of(words) > allowed:
        raise ValueError
    head = json.loads(words)
    arrays = []
    for dtype, shape in head["arrays"]:
        array, at = _array(whole, at, dtype, shape)
        arrays.append(array)
    step, state_hash, facts = head["step"], head["state_hash"], head["facts"]
    if at != size or type(step) is not int or not isinstance(state_hash, str) or not isinstance(facts, dict):
        raise ValueError
    return Checkpoint(step=step, state_hash=state_hash, facts=facts, arrays=arrays)


def _array(whole: bytes, at: int, name: Any, shape: Any) -> tuple[np.ndarray, int]:
    """Return the array that begins at an offset, and the offset of its end."""
    if not isinstance(name, str) or not DTYPE.fullmatch(name) or len(shape) > MOST_AXES:
        raise ValueError
    if not all(type(width) is int and 0 <= width <= LARGEST for width in shape):
        raise ValueError
    dtype, count = np.dtype(name), math.prod(shape)
    end = at + count * dtype.itemsize
    if end > len(whole):  # so every array is at most as large as what was read
        raise ValueError
    array = np.frombuffer(whole, dtype, count, at) if end > at else np.zeros(count, dtype)
    return array.reshape(shape), end
