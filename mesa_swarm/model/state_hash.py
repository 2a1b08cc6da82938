"""The fingerprint of a model: of all numbers that its steps read or write, whatever they are stored in.

Hashed are the state (columns, poses, fields, declared state, memory of layers, processes, learners), the bodies with
their shapes, the bounds of the map, designs, and the parameters of layers, radio, imperfections and fires; of a rule
its source in normal form, and of rules, functions and methods of custom parts the numbers that they read by name. Not
hashed are what does not change a step: threads, the engine, intervals of collecting, reporters, observers, looks and
the arguments of the constructor as such; nor attributes of a custom model that only its `step` reads, which belong into
`model.state`. Numbers count as float64 or int64 bytes, so that the fingerprint is the same for every version of Python.
"""

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, lru_cache
from hashlib import blake2b
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import shapely
from mesa import Agent
from shapely.geometry.base import BaseGeometry

from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.control.source import Read, is_python_or_numeric, what_is_read
from mesa_swarm.control.team import Team, message_label
from mesa_swarm.kernels.part import HASHED
from mesa_swarm.model.state import ATOMS, DEEPEST, KINDS, SEQUENCES, State, add_to, attributes_of, is_float
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.world.bodies import Body
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import CARRIED, DRIVEN, MODES

# Raised whenever a seed gives other bits than before: 2 since the elementary functions are our own, rules draw by
# counters, and two layers of one name have a stream each. Recordings and ledgers store it.
ENGINE_BITS = 2
# Columns that depend on the order in which things were created are not part of the state.
NOT_HASHED = frozenset({"number", "design", "contact_index", "group"})
# Attributes of arbiters that are described apart, or follow from what is.
OF_ARBITERS = ("layers", "others", "state_names", "transitions")
# Beyond this, floats do not represent all whole numbers.
LARGEST_WHOLE = 2**53
AS_BYTES = struct.Struct("<cd").pack


class Pieces(list):
    """Bytes for a digest, which takes them at once: sooner than one piece after the other."""

    update = list.append

    def add_array(self, array: np.ndarray) -> None:
        """Add the numbers of an array."""
        self.append(bytes_of_numbers(array))

    def hexdigest(self) -> str:
        """Return the digest."""
        return blake2b(b"".join(self), digest_size=16).hexdigest()


def state_hash_of(model: Any) -> str:
    """Return the fingerprint of a model whose sensors were read, see `EngineModel.state_hash`."""
    digest = Pieces([f"{model.completed}".encode()])
    add_state(digest, model)
    return digest.hexdigest()


def add_state(digest: Pieces, model: Any) -> None:
    """Add all that a fingerprint is of but the number of steps, which is its first piece."""
    for name, part in model.parts.items():
        columns = [(key, column.array) for key, column in sorted(part.columns().items()) if column.role in HASHED]
        declared = part.parameters() if hasattr(part, "parameters") else part.store()
        if not columns and declared == {} and any(part is added for added in model.parts.added()):
            continue  # it only derives something
        digest.update(f"part {name};".encode())
        for column_name, array in columns:
            digest.update(f"{column_name} {array.shape};".encode())
            _add_array(digest, array)
        add_part(digest, declared)


def written_state_hash(model: Any) -> str:
    """Return the fingerprint of what steps write, as recordings of version 0.2 and older have it.

    It is without bodies at rest and what steps only read. All sensors are read first.
    """
    model.sense()
    digest, parts, robots = blake2b(digest_size=16), model.parts, model.swarm
    digest.update(f"{model.completed}".encode())
    for load in parts["bodies"].loads:
        digest.update(np.array([*load.pose, load.resistance]).tobytes())
    movers = parts["bodies"].movers
    if len(movers):
        for column in movers.poses:
            digest.update((column + 0).tobytes())
        digest.update(movers.carried.tobytes())
    for name, field in model.fields.items():
        digest.update(f"fields.{name} {field.values.shape}".encode())
        digest.update((field.values + 0).tobytes())
    for prefix, columns in (("robots", robots.columns), ("fires", model.fires.columns)):
        for name, column in sorted(columns.items()):
            if name not in NOT_HASHED:
                digest.update(f"{prefix}.{name} {column.shape}".encode())
                digest.update((column + 0 if column.dtype.kind == "f" else column).tobytes())
    if robots.groups:
        digest.update(f"groups {robots.groups}".encode())
        digest.update(robots.columns["group"].tobytes())
    for name, value in _list_declared(parts):
        digest.update(f"{name};".encode())
        add_to(digest, value)
    return digest.hexdigest()


def _list_declared(parts: Any) -> Iterator[tuple[str, Any]]:
    """Iterate over what a model, its processes and custom layers declare, by name."""
    if parts["state"].values:
        yield "state", parts["state"].values
    if parts["events"].log:
        yield "events", parts["events"].log.arrays()
    yield from parts["processes"].states()
    yield from parts["control"].arrays_of_layers()


def mode_in_hash(body: Body) -> str:
    """Return how a body moves, with what robots carry as driven bodies."""
    return MODES[DRIVEN] if body.mode == MODES[CARRIED] else body.mode


def describe_bodies(bodies: Sequence[Body]) -> list:
    """Return what bodies, those at rest too, are: mode, kind, and outlines, of bodies that move about their centres.

    What robots carry has the mode of driven bodies: who carries it is part of its state. The order in which those at
    rest were created does not count, as no step depends on it.
    """
    at_rest = [body for body in bodies if body.mode == "fixed"]
    bodies = [*_sort_bodies(at_rest), *(body for body in bodies if body.mode != "fixed")]
    geometries = [body.shape.geometry if body.mode == "fixed" else body.form.outline for body in bodies]  # type: ignore[attr-defined]
    return [
        ";".join(f"{mode_in_hash(body)} {body.kind} {body.contact}" for body in bodies),
        shapely.get_type_id(geometries),
        shapely.get_num_coordinates(geometries),
        shapely.get_num_interior_rings(geometries),
        shapely.get_coordinates(geometries),
        np.array([_radius_of(body) for body in bodies], float),
        np.array([_heat_of(body) for body in bodies], float),
    ]


def _sort_bodies(bodies: list[Body]) -> list[Body]:
    """Return bodies at rest in an order that follows from what they are."""
    outlines = shapely.to_wkb(np.array([body.shape.geometry for body in bodies], object))  # at once: 20 times faster
    ranks = [
        (body.kind, body.contact, body.shape.radius, outline, _heat_of(body))
        for body, outline in zip(bodies, outlines, strict=True)
    ]
    return [bodies[place] for place in sorted(range(len(bodies)), key=ranks.__getitem__)]


def _heat_of(body: Body) -> float:
    return -1.0 if body.temperature is None else body.temperature


def _radius_of(body: Body) -> float:
    return body.shape.radius if body.mode == "fixed" else body.form.radius  # type: ignore[attr-defined]


def describe_designs(designs: Sequence[RobotDesign], rows: np.ndarray) -> dict[bytes, np.ndarray]:
    """Return the robots of each design, by its digest: independent of the order in which designs came.

    Designs that no robot has are left out. `rows` are the indices of the robots' designs (n,).
    """
    return {_digest_of_design(designs[place]): rows == place for place in np.unique(rows).tolist()}


def _digest_of_design(design: RobotDesign) -> bytes:
    try:
        return _known_digest(design)
    except TypeError:  # a custom drive may have no hash
        return digest_of_part(design)


@lru_cache(maxsize=256)
def _known_digest(design: RobotDesign) -> bytes:
    return digest_of_part(design)


def digest_of_part(value: Any) -> bytes:
    """Return the digest of the parameters of a part."""
    digest = blake2b(digest_size=16)
    add_part(digest, value)
    return digest.digest()


def add_part(digest: Any, value: Any, depth: int = 0) -> None:
    """Add what is read of a part to a digest: numbers, texts, arrays, and what holds them; fields of dataclasses.

    Of functions the source counts, of learners what `checkpoint` returns, of other objects only the type.
    """
    kind = type(value)
    if kind is float or kind is int or kind is bool or is_float(value):
        digest.update(_number(value))
    elif kind in ATOMS or kind in (bytes, complex):
        digest.update(f"{kind.__name__} {value!r};".encode())
    elif isinstance(value, np.generic) and value.dtype.kind in "biuf":
        digest.update(_number(value.item()))
    elif isinstance(value, (np.ndarray, np.generic)):
        _add_array(digest, np.asarray(value))
    elif depth > DEEPEST:
        digest.update(f"{kind.__name__};".encode())
    elif isinstance(value, (dict, State, *SEQUENCES.values())):
        _add_items(digest, value, depth)
    else:
        _add_object(digest, value, depth)


def _number(value: float) -> bytes:
    """Return a number as bytes: as float64 where that is exact, so that 15 and 15.0 are the same."""
    if type(value) is int and not -LARGEST_WHOLE <= value <= LARGEST_WHOLE:
        return f"integer {value:x};".encode()
    return AS_BYTES(b"f", math.nan if value != value else value + 0.0)  # noqa: PLR0124 - NaN differs from itself


def _add_array(digest: Any, array: np.ndarray) -> None:
    digest.update(f"array {array.shape};".encode())
    if isinstance(digest, Pieces):
        digest.add_array(array)
    else:
        digest.update(bytes_of_numbers(array))


def bytes_of_numbers(array: np.ndarray) -> bytes:
    """Return the numbers of an array as those of float64 or int64, other kinds as they are."""
    if array.dtype.kind == "f":
        return (np.asarray(array, np.float64) + 0.0).tobytes()
    if array.dtype.kind in "biu":
        return np.asarray(array, np.int64 if array.dtype.kind != "u" else np.uint64).tobytes()
    return f"{array.dtype.str}".encode() + array.tobytes() if array.dtype.kind in KINDS else b""


def _add_items(digest: Any, values: Any, depth: int) -> None:
    if isinstance(values, (dict, State)):
        items: list = sorted(((digest_of_part(key), value) for key, value in values.items()), key=lambda item: item[0])
    elif isinstance(values, (set, frozenset)):
        items = sorted(map(digest_of_part, values))
    else:
        items = list(values)
    digest.update(f"items {len(items)};".encode())
    for item in items:
        add_part(digest, item, depth + 1)


def _add_object(digest: Any, value: Any, depth: int) -> None:
    kind = type(value)
    digest.update(f"{kind.__qualname__};".encode())
    describe, names, has_checkpoint = _parts_of(kind)  # type: ignore[arg-type]
    if describe is not None:
        add_part(digest, describe(value), depth + 1)
    if values := values_read_by(value):
        add_part(digest, values, depth + 1)
    for name in names:
        digest.update(f"{name};".encode())
        add_part(digest, getattr(value, name), depth + 1)
    if has_checkpoint:
        add_part(digest, value.checkpoint(), depth + 1)


@cache
def _parts_of(kind: type) -> tuple[Callable[[Any], Any] | None, tuple[str, ...], bool]:
    """Return how objects of a class are described, which fields count, and whether they have a state of their own."""
    describe = next((describe for base, describe in DESCRIBED if issubclass(kind, base)), None)
    if describe is None and _has(kind, "arrays", "settings"):
        describe = describe_policy
    has_fields = describe is None and is_dataclass(kind)
    names = tuple(field.name for field in fields(kind)) if has_fields else ()  # type: ignore[arg-type]
    return describe, names, kind is not type and _has(kind, "checkpoint", "restore")


def _has(kind: type, *methods: str) -> bool:
    """Return whether a class has all of these methods."""
    return all(callable(getattr(kind, name, None)) for name in methods)


def describe_process(process: Any) -> list:
    """Return what a process is besides its plain state, which is hashed with the state of the model.

    Dataclasses and functions that it holds count, and numbers that its methods read by name.
    """
    attributes = {} if _has(type(process), "checkpoint", "restore") else attributes_of(process)
    plain = (*ATOMS, np.ndarray, np.generic, np.random.Generator)
    parts = {name: value for name, value in attributes.items() if not isinstance(value, plain)}
    return [type(process).__qualname__, parts, values_read_by(process)]


def values_read_by(part: Any) -> list:
    """Return the plain values that the methods of a custom class read by name, as they were when first asked for."""
    return _values_read_by(type(part))  # type: ignore[arg-type]


@cache
def _values_read_by(kind: type) -> list:
    bases = [base for base in kind.__mro__ if not is_python_or_numeric(base.__module__)]
    methods = [value for base in bases for value in vars(base).values() if isinstance(value, FunctionType)]
    return [[method.__qualname__, values] for method in methods if (values := what_is_read(method).values)]


def describe_policy(policy: Any) -> list:
    """Return the numbers of a trained policy, but not how it was trained."""
    return [policy.arrays(), policy.settings()]


def describe_control(control: Arbiter) -> list:
    """Return the arbiters of a control, each with its layers, and what else it is made of."""
    if isinstance(control, Team):
        return [
            [message_label(key), describe_control(part) if part is not None else None] for key, part in control.items()
        ]
    layers = [describe_layer(layer) for layer in control.layers]
    if graph := control._graph():
        return [type(control).__qualname__, layers, *graph]
    parameters = {name: value for name, value in attributes_of(control).items() if name not in OF_ARBITERS}
    return [type(control).__qualname__, layers, parameters, values_read_by(control)]


def describe_layer(layer: Any) -> Any:
    """Return what a layer reads: the fields of a dataclass, all attributes of another."""
    if isinstance(layer, Behaviour) or is_dataclass(layer) or _has(type(layer), "checkpoint", "restore"):
        return layer
    return [type(layer).__qualname__, attributes_of(layer), values_read_by(layer)]


def describe_rule(behaviour: Behaviour) -> list:
    """Return the code of a rule and what it reads, its parameters, and with what its memory begins."""
    return [_digest_of_read(behaviour.read), behaviour.parameters, behaviour.memory]


@lru_cache(maxsize=1024)
def _digest_of_read(read: Read) -> bytes:
    return digest_of_part(read)


# How objects are described that are not dataclasses, or not by their fields.
DESCRIBED: tuple[tuple[type, Callable[[Any], Any]], ...] = (
    (Agent, lambda agent: agent.unique_id),
    (Behaviour, describe_rule),
    (Arbiter, describe_control),
    (FunctionType, what_is_read),
    (SimpleNamespace, vars),
    (Shape, lambda shape: [shape.geometry, shape.radius, shape.contact]),
    (BaseGeometry, lambda geometry: [geometry.geom_type, shapely.get_coordinates(geometry)]),
)
