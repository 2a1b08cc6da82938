"""Designs, their devices, controls and other declared values as stored in recordings: by class and fields."""

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, partial
from importlib import import_module
from itertools import islice
from pkgutil import iter_modules
from typing import Any

import numpy as np

from mesa_swarm import control as controls
from mesa_swarm.base.errors import RecordingError, SwarmError, error_line, shortened
from mesa_swarm.control.conditions import CONDITIONS
from mesa_swarm.control.team import Key, Team, message_label
from mesa_swarm.fire.constants import FireConstants
from mesa_swarm.fire.strategy import FightFire, SeekHeat
from mesa_swarm.recording.container import ATOMS
from mesa_swarm.recording.made_objects import family
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.devices import Device
from mesa_swarm.robots.drive import DirectedSlip, EqualByValues
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.real_robots import Scale

# Bases of devices and drives: what derives from them in these rooms is stored by the name of its class, as are:
BASES = (Device, EqualByValues)
ROOMS = ("mesa_swarm.robots.", "mesa_swarm.physics.")
OF_MODELS = (RobotDesign, DirectedSlip, FireConstants, Radio, Imperfection, Imperfections, Scale)
FLOCKING = (controls.Align, controls.Cohere, controls.Cruise, controls.MatchVelocity, controls.Separate)
TOWARDS_BODIES = (controls.Follow, controls.Gather, controls.HeadOn, controls.Perimeter, controls.Push)
OF_MACHINES = (controls.Approach, controls.Halt, controls.Retreat, *CONDITIONS)
LAYERS = (*FLOCKING, *TOWARDS_BODIES, controls.Avoid, controls.Explore, controls.Respond, FightFire, SeekHeat)
CLASSES: dict[str, type] = {kind.__name__: kind for kind in (*OF_MODELS, *LAYERS, *OF_MACHINES)}
OWN_CODE = "code of one's own"  # a key of stored states
ARBITERS = {kind.__name__: kind for kind in (controls.StateMachine, controls.Subsumption, controls.VectorSum)}


def part_to_json(part: Any) -> object:
    """Return a part as ``{class: fields}``, its own parts likewise; plain values as they are."""
    if isinstance(part, np.generic):
        part = part.item()
    if type(part) in ATOMS:
        return part
    if type(part) in (tuple, list):
        return [part_to_json(item) for item in part]
    name = type(part).__name__
    if CLASSES.get(name) is not type(part) and not _is_built_in(type(part)):
        if isinstance(part, Device):
            return {OWN_CODE: [name, *(part_to_json(getattr(part, field.name)) for field in _fields(part))]}
        raise RecordingError(f"{shortened(part)} is of class {name}, which cannot be recorded")
    return {name: {field.name: part_to_json(getattr(part, field.name)) for field in _fields(part)}}


def _fields(part: Any) -> tuple:
    return fields(part) if is_dataclass(part) else ()


def part_from_json(value: object, near: Sequence[type] = ()) -> Any:
    """Return the part that `part_to_json` wrote; lists become tuples. Custom parts are of the classes `near`."""
    if type(value) in ATOMS:
        return value
    if isinstance(value, list):
        return tuple(part_from_json(item, near) for item in value)
    name, content = _only_item(value)
    if name == OWN_CODE:
        return _custom_part(content, near)
    kind = _class_called(name)
    if kind is None or not isinstance(content, dict):
        raise RecordingError(f"unknown part {shortened(name)} in recording")
    return make_stored(str(name), kind, {field: part_from_json(item, near) for field, item in content.items()})


def _is_built_in(kind: type) -> bool:
    is_of_package = issubclass(kind, BASES) and kind.__module__.startswith(ROOMS)
    return is_of_package and is_dataclass(kind) and not kind.__name__.startswith("_")


def _class_called(name: object) -> type | None:
    """Return the class whose objects are stored by this name, None if there is none."""
    if name not in CLASSES and name not in _list_derived():
        _load_rooms()
    return {**_list_derived(), **CLASSES}.get(str(name))


def _list_derived() -> dict[str, type]:
    return {kind.__name__: kind for base in BASES for kind in family(base) if _is_built_in(kind)}


@cache
def _load_rooms() -> None:
    """Import all of the rooms, where there may be devices that nothing has used yet."""
    for room in ROOMS:
        for module in iter_modules(import_module(room[:-1]).__path__, room):
            import_module(module.name)


def _custom_part(content: Any, near: Sequence[type]) -> Device:
    """Return a custom sensor or actuator, of which the name of its class and the values of its fields are stored."""
    name, *values = content
    kind = next((kind for kind in near if kind.__name__ == name and issubclass(kind, Device)), None)
    if kind is None or not is_dataclass(kind) or len(fields(kind)) != len(values):
        raise RecordingError(
            f"the robots have a custom part ({shortened(content)}), which is found only in a model that adds such "
            "robots in its constructor, or has its class in its own module"
        )
    items = zip((field.name for field in fields(kind)), values, strict=True)
    return make_stored(name, kind, {field: part_from_json(item, near) for field, item in items})


def control_to_json(control: controls.Arbiter | None) -> object:
    """Return the layers and weights of an arbiter, or of each of a team; of custom rules only their names."""
    if control is None:
        return None
    if isinstance(control, Team):
        return {"Team": [[_key_to_json(key), control_to_json(arbiter)] for key, arbiter in control.items()]}
    layers = [_layer_to_json(layer) for layer in control.layers]
    if isinstance(control, controls.StateMachine):
        states = [[name, len(of_state)] for name, of_state in control.states.items()]
        changes = [[change.source, change.target, _layer_to_json(change.condition)] for change in control.transitions]
        return {"StateMachine": {"layers": layers, "states": states, "transitions": changes}}
    weights = getattr(control, "weights", None)
    return {type(control).__name__: {"layers": layers, "weights": None if weights is None else list(weights)}}


def control_from_json(value: object) -> Any:
    """Return the arbiter that `control_to_json` wrote; custom rules and arbiters are refused."""
    if value is None:
        return None
    name, content = _only_item(value)
    if name == "Team" and isinstance(content, list):
        arbiters = {_key_from_json(key): control_from_json(arbiter) for key, arbiter in map(tuple, content)}
        return make_stored(name, lambda: Team(arbiters), {})
    if name not in ARBITERS or not isinstance(content, dict) or not isinstance(content.get("layers"), list):
        raise RecordingError(f"unknown arbiter {shortened(name)} in recording")
    rules = own_code(value)
    if rules:
        raise RecordingError(f"the control has a custom rule ({shortened(rules[0])}), which cannot be recorded")
    layers = [part_from_json(layer) for layer in content["layers"]]
    if name == "StateMachine":
        return make_stored(name, partial(_machine, layers, content), {})
    more = {} if content.get("weights") is None else {"weights": content["weights"]}
    return make_stored(name, lambda: ARBITERS[name](*layers, **more), {})


def _machine(layers: list, content: dict) -> controls.StateMachine:
    """Return the state machine of these layers, of which the number in each state is stored."""
    layers_left = iter(layers)
    states = {str(name): tuple(islice(layers_left, count)) for name, count in content["states"]}
    changes = [(source, target, part_from_json(condition)) for source, target, condition in content["transitions"]]
    return controls.StateMachine(states, [controls.Transition(source=a, target=b, condition=c) for a, b, c in changes])


def own_code(control: Any) -> list[str]:
    """Return the names of the custom rules in what `control_to_json` returned."""
    if control is not None and "Team" in control:
        return [name for _, arbiter in control["Team"] for name in own_code(arbiter)]
    layers = [layer for arbiter in (control or {}).values() for layer in arbiter["layers"]]
    layers += [part for arbiter in (control or {}).values() for _, _, part in arbiter.get("transitions", ())]
    return [str(layer[OWN_CODE]) for layer in layers if isinstance(layer, dict) and OWN_CODE in layer]


def _key_to_json(key: Key) -> object:
    """Return a group's name, or a design; one with a custom drive only by its name."""
    try:
        return part_to_json(key)
    except RecordingError:
        return {OWN_CODE: message_label(key)}


def _key_from_json(value: object) -> Any:
    if isinstance(value, dict) and OWN_CODE in value:
        raise RecordingError(f"the control is for a design of code of one's own ({shortened(value[OWN_CODE])})")
    return part_from_json(value)


def _layer_to_json(layer: object) -> object:
    try:
        return part_to_json(layer)
    except RecordingError:
        values = [f"{name}={value!r}" for name, value in getattr(layer, "parameters", {}).items()]
        return {OWN_CODE: " ".join([type(layer).__name__, str(getattr(layer, "name", "")), *values])}


def _only_item(value: object) -> tuple[object, object]:
    if not isinstance(value, dict) or len(value) != 1:
        raise RecordingError(f"{shortened(value)} is not a part; expected a class and its fields")
    ((name, content),) = value.items()
    return name, content


def make_stored(name: str, maker: Callable, arguments: dict) -> Any:
    """Return what a maker makes of stored arguments; an error of it becomes one line that names it."""
    try:
        return maker(**arguments)
    except (SwarmError, TypeError, ValueError, AttributeError, LookupError, OverflowError) as error:
        raise RecordingError(f"{name} of the recording cannot be made: {error_line(error)}") from None
