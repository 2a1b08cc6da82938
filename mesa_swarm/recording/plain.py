"""Plain values as JSON and arrays, exactly, and back; nothing that is read becomes anything else."""

import base64
from collections import deque
from typing import Any

import numpy as np

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
