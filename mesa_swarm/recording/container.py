"""Plain values and arrays in one container, never executed."""

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
# An array of these kinds is its bytes: bool, whole, real and complex numbers, bytes, text, dates and durations.
KINDS = frozenset("biufcSUmM")
DEEPEST = 100
MADE_OF_LISTS: dict[str, type] = {kind.__name__: kind for kind in (list, tuple, set, frozenset, deque)}


class Packed:
    """Plain values on their way into a checkpoint: JSON, and the arrays beside it.

    Numbers, texts, None, arrays, and lists, tuples, sets, deques and dicts of these keep their types and bits.

    Parameters
    ----------
    arrays : list of ndarray, optional

    Examples
    --------
    >>> packed = Packed()
    >>> told = packed.pack({1: (2.5, np.arange(3))})
    >>> told
    {'dict': [[1, {'tuple': [2.5, {'array': 0}]}]]}
    >>> packed.unpack(told)
    {1: (2.5, array([0, 1, 2]))}
    """

    def __init__(self, arrays: list[np.ndarray] | None = None) -> None:
        self.arrays = [] if arrays is None else arrays
        self._taken: set[int] = set()

    def pack(self, value: Any, what: str = "a value", depth: int = 0) -> object:
        """Return a value as JSON has it.

        Raises
        ------
        RecordingError
            If it is, or holds, anything else.
        """
        kind = type(value)
        if depth > DEEPEST:
            raise RecordingError(f"{what} is nested more than {DEEPEST} deep, or holds itself")
        if kind in ATOMS:
            return value
        if isinstance(value, (np.ndarray, np.generic)):
            return {"array" if kind is np.ndarray else "number": self._kept(value, what)}
        if kind is bytes:
            return {"bytes": base64.b64encode(value).decode()}
        if kind is complex:
            return {"complex": [value.real, value.imag]}
        return self._packed(value, what, depth + 1)

    def _packed(self, value: Any, what: str, depth: int) -> object:
        """Return what holds other values as JSON has it."""
        kind = type(value)
        if kind is dict:
            return {"dict": [[self.pack(part, what, depth) for part in pair] for pair in value.items()]}
        if MADE_OF_LISTS.get(kind.__name__) is not kind:
            raise RecordingError(f"{what} is {shortened(value)}, which cannot be stored")
        ordered = sorted(value, key=repr) if kind in (set, frozenset) else value
        items = [self.pack(item, what, depth) for item in ordered]
        if kind is list:
            return items
        return {kind.__name__: items, **({"longest": value.maxlen} if kind is deque else {})}

    def unpack(self, told: Any) -> Any:
        """Return the value that `pack` told.

        Raises
        ------
        RecordingError
            If it tells of none.
        """
        if type(told) in ATOMS:
            return told
        if isinstance(told, list):
            return [self.unpack(item) for item in told]
        try:
            return self._unpacked(told)
        except (TypeError, ValueError, AttributeError, LookupError, OverflowError):
            raise RecordingError(f"{shortened(told)} is no stored value") from None

    def _unpacked(self, told: dict) -> Any:
        name, given = list(told.items())[0]  # noqa: RUF015 - an IndexError is told in words, StopIteration is not
        if name in ("array", "number"):
            array = self._array(given)
            return array.copy() if name == "array" else array[()]
        if name == "dict":
            return {self.unpack(key): self.unpack(value) for key, value in given}
        if name == "deque":
            return deque(map(self.unpack, given), maxlen=told["longest"])
        if name == "bytes":
            return base64.b64decode(given, validate=True)
        if name == "complex":
            return complex(*map(float, given))
        return MADE_OF_LISTS[name](map(self.unpack, given))

    def _kept(self, value: np.ndarray | np.generic, what: str) -> int:
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
            raise RecordingError(f"there is no stored array {shortened(place)} that was not taken yet")
        self._taken.add(place)  # each is stored for one value: many that name one array would fill the memory
        return self.arrays[place]


MAGIC = b"swarm checkpoint 1\n"
LENGTH = 8
# No state is larger; nor may it take more memory to be read than this, or than some times what it takes in the file,
# so that a small file cannot ask for much. What is written keeps to the same limits.
LARGEST = 1 << 30
MOST_MEMORY, MOST_TIMES = 100_000_000, 4
MOST_AXES = 32
CODEC = pa.Codec("zstd", compression_level=1)
# What `plain.KINDS` names, with a width; objects and records are never stored.
DTYPE = re.compile(
    r"[<>|=]?(b1|[iu][1248]|f(2|4|8|12|16)|c(8|16|24|32)|[SU][1-9]\d{0,6}|[mM]8(\[\d{0,6}[A-Za-z]{1,2}\])?)"
)


@dataclass(kw_only=True)
class Checkpoint:
    """The complete state of a model after a step: facts as JSON has them, and arrays that these number.

    Parameters
    ----------
    step : int
    state_hash : str
        The model's fingerprint, with which a restored one is compared.
    facts : dict
    arrays : list of ndarray
    """

    step: int
    state_hash: str
    facts: dict
    arrays: list[np.ndarray] = field(default_factory=list)


def to_bytes(checkpoint: Checkpoint) -> bytes:
    """Return a checkpoint as bytes.

    Raises
    ------
    RecordingError
        If it is too large: `from_bytes` would refuse it.

    Examples
    --------
    >>> kept = Checkpoint(step=3, state_hash="ab", facts={"x": 0.1}, arrays=[np.arange(2)])
    >>> from_bytes(to_bytes(kept)).arrays
    [array([0, 1])]
    """
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
    needed, believed = 2 * len(whole) + memory_of(words), _believed(packed)
    if len(whole) > LARGEST or needed > believed:
        raise RecordingError(
            f"the state has {len(whole):,} bytes and takes about {needed:,} to be read, more than the {believed:,} of "
            "a checkpoint; keep large arrays out of it, or collect less"
        )
    return packed


def memory_of(words: bytes | str) -> int:
    """Return about how many bytes a text of JSON takes once it is read, rather too many.

    Examples
    --------
    >>> memory_of("[1,[]]"), memory_of(b'{"x":[]}')
    (258, 360)
    """
    count: Any = words.count
    objects, lists, values = (count(mark if isinstance(words, str) else mark.encode()) for mark in "{[,")
    # Texts in which one letter is rare take four bytes a letter, beside the text of JSON itself.
    return 5 * len(words) + 230 * objects + 90 * lists + 48 * values


def _believed(packed: bytes) -> int:
    return max(MOST_MEMORY, MOST_TIMES * len(packed))


def from_bytes(content: bytes) -> Checkpoint:
    """Return the checkpoint that `to_bytes` wrote; every size is checked before memory is spent on it.

    Raises
    ------
    RecordingError
        If it is none.
    """
    try:
        return _read(content)
    except RecordingError:
        raise
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError, MemoryError, OSError, RecursionError):
        raise RecordingError("the checkpoint is damaged, or was written by another version") from None


def _read(content: bytes) -> Checkpoint:
    begin = len(MAGIC) + LENGTH
    size = int.from_bytes(content[len(MAGIC) : begin], "little")
    believed = _believed(content)
    if not content.startswith(MAGIC) or not LENGTH <= size <= min(LARGEST, believed // 2):
        raise ValueError
    whole = CODEC.decompress(content[begin:], decompressed_size=size, asbytes=True)
    at = LENGTH + int.from_bytes(whole[:LENGTH], "little")
    if len(whole) != size or at > size:
        raise ValueError
    words = whole[LENGTH:at]
    if 2 * size + memory_of(words) > believed:
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
    """Return the array that begins there, and where it ends."""
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
