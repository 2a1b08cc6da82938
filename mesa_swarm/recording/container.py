"""A checkpoint as bytes: a JSON head, and arrays as they lie in memory, compressed. Nothing in it is ever run."""

import json
import math
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa

from mesa_swarm.errors import RecordingError

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
