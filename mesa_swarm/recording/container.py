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

from mesa_swarm.errors import RecordingError, shortened

ATOMS = (bool, int, str, float, type(None))
# An array of these kinds is its bytes: bool, integers, real and complex numbers, bytes, text, dates and durations.
KINDS = frozenset("biufcSUmM")
DEEPEST = 100
SEQUENCES: dict[str, type] = {kind.__name__: kind for kind in (list, tuple, set, frozenset, deque)}
MAGIC = b"swarm checkpoint 1\n"
LENGTH = 8
# No state is larger; nor may reading it take more memory than this, or than this multiple of its size in the file, so
# that a small file cannot claim much. The writer has the same limits.
LARGEST = 1 << 30
MOST_MEMORY, MOST_TIMES = 100_000_000, 4
MOST_AXES = 32
CODEC = pa.Codec("zstd", compression_level=1)
# `KINDS` with their widths; objects and records are never stored.
DTYPE = re.compile(
    r"[<>|=]?(b1|[iu][1248]|f(2|4|8|12|16)|c(8|16|24|32)|[SU][1-9]\d{0,6}|[mM]8(\[\d{0,6}[A-Za-z]{1,2}\])?)"
)


class Packed:
    """Plain values of a checkpoint: JSON, and the arrays beside it.

    Numbers, texts, None, arrays, and lists, tuples, sets, deques and dicts of these are restored with their types and
    bits.

    Examples
    --------
    >>> packed = Packed()
    >>> content = packed.pack({1: (2.5, np.arange(3))})
    >>> content
    {'dict': [[1, {'tuple': [2.5, {'array': 0}]}]]}
    >>> packed.unpack(content)
    {1: (2.5, array([0, 1, 2]))}
    """

    def __init__(self, arrays: list[np.ndarray] | None = None) -> None:
        self.arrays = [] if arrays is None else arrays
        self._taken: set[int] = set()

    def pack(self, value: Any, what: str = "a value", depth: int = 0) -> object:
        """Return a value as JSON, in which numbers stand for arrays."""
        kind = type(value)
        if depth > DEEPEST:
            raise RecordingError(f"{what} is nested more than {DEEPEST} deep, or contains itself")
        if kind in ATOMS:
            return value
        if isinstance(value, (np.ndarray, np.generic)):
            return {"array" if kind is np.ndarray else "number": self._added(value, what)}
        if kind is bytes:
            return {"bytes": base64.b64encode(value).decode()}
        if kind is complex:
            return {"complex": [value.real, value.imag]}
        return self._packed(value, what, depth + 1)

    def _packed(self, value: Any, what: str, depth: int) -> object:
        kind = type(value)
        if kind is dict:
            return {"dict": [[self.pack(part, what, depth) for part in pair] for pair in value.items()]}
        if SEQUENCES.get(kind.__name__) is not kind:
            raise RecordingError(f"{what} is {shortened(value)}, which cannot be stored")
        ordered = sorted(value, key=repr) if kind in (set, frozenset) else value
        items = [self.pack(item, what, depth) for item in ordered]
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
            return self._unpacked(content)
        except (TypeError, ValueError, AttributeError, LookupError, OverflowError):
            raise RecordingError(f"{shortened(content)} cannot be decoded") from None

    def _unpacked(self, content: dict) -> Any:
        name, given = list(content.items())[0]  # noqa: RUF015 - the caller expects an IndexError, not StopIteration
        if name in ("array", "number"):
            array = self._array(given)
            return array.copy() if name == "array" else array[()]
        if name == "dict":
            return {self.unpack(key): self.unpack(value) for key, value in given}
        if name == "deque":
            return deque(map(self.unpack, given), maxlen=content["longest"])
        if name == "bytes":
            return base64.b64decode(given, validate=True)
        if name == "complex":
            return complex(*map(float, given))
        return SEQUENCES[name](map(self.unpack, given))

    def _added(self, value: np.ndarray | np.generic, what: str) -> int:
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
        if type(place) is not int or not 0 <= place < len(self.arrays) or place in self._taken:
            raise RecordingError(f"array {shortened(place)} is not stored, or was read already")
        self._taken.add(place)  # each is stored for one value: many references to one array would fill the memory
        return self.arrays[place]


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
    packed = MAGIC + len(whole).to_bytes(LENGTH, "little") + CODEC.compress(whole, asbytes=True)
    needed, allowed = 2 * len(whole) + memory_of(words), _allowed(packed)
    if len(whole) > LARGEST or needed > allowed:
        raise RecordingError(
            f"the state has {len(whole):,} bytes and needs about {needed:,} to be read, more than the {allowed:,} of "
            "a checkpoint; use smaller arrays, or collect less"
        )
    return packed


def memory_of(words: bytes | str) -> int:
    """Return an upper estimate of the bytes that a JSON text takes once it is read."""
    count: Any = words.count
    objects, lists, values = (count(sign if isinstance(words, str) else sign.encode()) for sign in "{[,")
    # Texts with one rare letter take four bytes a letter, beside the JSON text itself.
    return 5 * len(words) + 230 * objects + 90 * lists + 48 * values


def _allowed(packed: bytes) -> int:
    return max(MOST_MEMORY, MOST_TIMES * len(packed))


def from_bytes(content: bytes) -> Checkpoint:
    """Return the checkpoint that `to_bytes` wrote; every size is checked before memory is allocated."""
    try:
        return _read(content)
    except RecordingError:
        raise
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError, MemoryError, OSError, RecursionError):
        raise RecordingError("the checkpoint is damaged, or was written by another version") from None


def _read(content: bytes) -> Checkpoint:
    begin = len(MAGIC) + LENGTH
    size = int.from_bytes(content[len(MAGIC) : begin], "little")
    allowed = _allowed(content)
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
