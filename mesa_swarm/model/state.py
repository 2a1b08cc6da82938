"""The part `state`: what a model declares beside its columns; and the fingerprint of any declared value."""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from functools import cached_property
from hashlib import blake2b
from inspect import isroutine
from typing import Any, Protocol, runtime_checkable

import numpy as np
from mesa import Agent

from mesa_swarm.base.errors import InvalidValueError, check_name, shortened
from mesa_swarm.kernels.part import Part
from mesa_swarm.world.read_only import ReadOnlyArray

# Values that are restored with their types and bits: these, NumPy's numbers and arrays, and what holds them.
ATOMS = (bool, int, str, float, type(None))
SEQUENCES: dict[str, type] = {kind.__name__: kind for kind in (list, tuple, set, frozenset, deque)}
# An array of these kinds is its bytes: bool, integers, real and complex numbers, bytes, text, dates and durations.
KINDS = frozenset("biufcSUmM")
DEEPEST = 100
# Bytes; of larger arrays the fingerprint of changes between steps is of sums.
LARGE, SUMS = 1 << 16, 1 << 12


@runtime_checkable
class Checkpointed(Protocol):
    """An attribute of the model, a layer of its control, or a process, with a state of its own: a learner for example.

    A layer whose whole memory is in columns of the swarm (`Swarm.remember`) needs neither method; nor does a process
    whose attributes are plain values and arrays.
    """

    def checkpoint(self) -> dict:
        """Return all that a later step depends on: arrays and plain values (`container.Packer`) by name."""

    def restore(self, state: dict) -> None:
        """Restore what `checkpoint` returned."""


class State(MutableMapping[str, Any]):
    """Custom values that belong to the state of a model, by name, see `SwarmModel.state`.

    Values are numbers, texts, truth values, None, NumPy arrays, and lists, tuples, sets and dicts of these. They are
    part of the state hash, and are stored, resumed and copied with the model.

    Raises
    ------
    InvalidValueError
        If a name is not one line of text, or a value is of another kind.

    Examples
    --------
    >>> state = State()
    >>> state["delivered"] = 0
    >>> state["delivered"] += 1
    >>> state
    {'delivered': 1}
    """

    def __init__(self, values: Mapping[str, Any] | None = None) -> None:
        self._values: dict[str, Any] = {}
        if values is not None and not isinstance(values, Mapping):
            raise InvalidValueError(
                f"state is {shortened(values)}; expected values by name, as in model.state['n'] = 0"
            )
        self.update(values or {})

    def __repr__(self) -> str:
        return repr(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def __setitem__(self, name: str, value: Any) -> None:
        """Declare a value, or replace it."""
        check_name("name of a value of state", name)
        self._values[name] = check_plain(f"state[{name!r}]", value)

    def __delitem__(self, name: str) -> None:
        del self._values[name]


class StatePart(Part):
    """Values that belong to the state of a model, by name.

    Attributes
    ----------
    values : State
    """

    name = "state"

    def __init__(self) -> None:
        self.values = State()

    def parameters(self) -> dict[str, Any]:
        """Return all values by name."""
        return dict(self.values)

    def mark(self) -> dict[str, Any]:
        """Return a fingerprint of each value."""
        return {f"state of {name}": quick_fingerprint(value) for name, value in self.values.items()}

    def store(self) -> dict[str, Any]:
        """Return all values."""
        return {"values": dict(self.values)}

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned, checked."""
        self.values = State(stored.get("values"))


# Bit generators of which every state is valid.
GENERATORS = ("PCG64", "PCG64DXSM")


def checked_state(state: object) -> dict:
    """Return the stored state of a random generator if it may be one."""
    if not isinstance(state, dict) or state.get("bit_generator") not in GENERATORS:
        raise InvalidValueError("invalid state of a random stream")
    return state


def refuse_attributes(owner: object, names: Iterable[str], reserved: frozenset[str] = frozenset()) -> None:
    """Refuse stored attributes that are not part of an object's state, or would hide what its class does.

    `reserved` are those that are stored in another way.
    """
    for name in sorted(names):
        if name in reserved or name.startswith("__") or _is_method(type(owner), name):
            raise InvalidValueError(f"attribute {shortened(name)[1:-1]} is not part of a state")


def _is_method(kind: type, name: str) -> bool:
    """Return whether a class has a method or property of this name, not only a value or a field."""
    member = next((vars(base)[name] for base in kind.__mro__ if name in vars(base)), None)
    if isinstance(member, cached_property) or name in getattr(kind, "__dataclass_fields__", {}):
        return False
    return isroutine(member) or isinstance(member, (property, classmethod, staticmethod))


def check_plain(name: str, value: Any) -> Any:
    """Return a value if it can be stored with its type and bits."""
    odd = _odd_in(value, 0)
    if odd is None:
        return value
    raise InvalidValueError(
        f"{name} is or has {shortened(odd[0])}; expected numbers, texts, arrays of these, and lists, tuples, sets or "
        "dicts of them"
    )


def is_float(value: object) -> bool:
    """Return whether a value is a float, or one that carries more, such as a measure, and is stored without that."""
    return isinstance(value, float) and not isinstance(value, np.generic)


def _odd_in(value: Any, depth: int) -> tuple[Any] | None:
    """Return the first value within another that cannot be stored, None if there is none."""
    kind = type(value)
    if kind in ATOMS or kind in (bytes, complex) or is_float(value):
        return None
    if isinstance(value, (np.ndarray, np.generic)):
        exact = (
            kind in (np.ndarray, ReadOnlyArray, value.dtype.type) and value.dtype.kind in KINDS and value.dtype.itemsize
        )
        return None if exact else (value,)
    if depth > DEEPEST or (kind is not dict and SEQUENCES.get(kind.__name__) is not kind):
        return (value,)
    inner = (*value.keys(), *value.values()) if kind is dict else value
    return next((odd for item in inner if (odd := _odd_in(item, depth + 1))), None)


def attributes_of(owner: object) -> dict[str, Any]:
    """Return the attributes of an object by name: those of its `__dict__` and of its slots."""
    slots = [slot for kind in type(owner).__mro__ for slot in _slots_of(kind) if hasattr(owner, slot)]
    return {**{slot: getattr(owner, slot) for slot in reversed(slots)}, **getattr(owner, "__dict__", {})}


def _slots_of(kind: type) -> tuple[str, ...]:
    slots = kind.__dict__.get("__slots__", ())
    names = (slots,) if isinstance(slots, str) else tuple(slots)
    return tuple(name for name in names if name not in ("__dict__", "__weakref__"))


def stored_state(owner: object) -> dict[str, Any]:
    """Return the state of a process or a layer: what its `checkpoint` returns, without one its attributes."""
    if isinstance(owner, Checkpointed) and not isinstance(owner, type):
        return owner.checkpoint()
    return attributes_of(owner)


def quick_fingerprint(value: Any) -> bytes:
    """Return what differs, almost surely, after a value was changed, in a microsecond and one for each 10 kB.

    Of what cannot be stored only the type counts.
    """
    digest = blake2b(digest_size=16)
    add_to(digest, value, quickly=True)
    return digest.digest()


def add_to(digest: Any, value: Any, depth: int = 0, *, quickly: bool = False) -> None:
    """Add a value to a digest: equal for equal values, whatever the order of dicts and sets.

    Of agents the unique_id counts, of random generators the state, of other objects only the type.
    """
    kind = type(value)
    if isinstance(value, (np.ndarray, np.generic)):
        _add_array(digest, np.asarray(value), quickly)
    elif is_float(value):
        digest.update(f"float {value + 0.0!r};".encode())
    elif kind in ATOMS or kind in (bytes, complex):
        digest.update(f"{kind.__name__} {value!r};".encode())
    elif depth > DEEPEST or not isinstance(value, (dict, State, *SEQUENCES.values())):
        _add_object(digest, value, depth, quickly)
    else:
        items = _in_order(value)
        digest.update(f"{kind.__name__} {len(items)};".encode())
        for item in items:
            add_to(digest, item, depth + 1, quickly=quickly)


def _in_order(values: Any) -> list:
    """Return the items of a container, those of a dict as pairs, in an order that follows from the values alone."""
    if isinstance(values, (dict, State)):
        return sorted(values.items(), key=lambda item: repr(item[0]))
    return sorted(values, key=repr) if isinstance(values, (set, frozenset)) else list(values)


def _add_object(digest: Any, value: Any, depth: int, quickly: bool) -> None:
    digest.update(f"{type(value).__name__};".encode())
    if isinstance(value, Agent):
        digest.update(f"{value.unique_id};".encode())
    elif isinstance(value, np.random.Generator):
        add_to(digest, value.bit_generator.state, depth + 1, quickly=quickly)


def _add_array(digest: Any, array: np.ndarray, quickly: bool) -> None:
    digest.update(f"{array.dtype.str}{array.shape};".encode())
    if array.dtype.kind not in KINDS:
        return
    if quickly and array.nbytes > LARGE:
        digest.update(_condense_array(array))
    else:
        digest.update((array + 0 if array.dtype.kind == "f" else array).tobytes())


def _condense_array(array: np.ndarray) -> bytes:
    """Return sums of the bytes of an array, read as whole numbers, and the bytes that are left over."""
    content = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    whole = len(content) // (8 * SUMS) * 8 * SUMS
    sums = content[:whole].view(np.uint64).reshape(-1, SUMS).sum(axis=0)
    return sums.tobytes() + content[whole:].tobytes()
