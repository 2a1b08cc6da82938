"""Stored states of earlier formats, as parts have them now."""

from typing import Any

import numpy as np

from mesa_swarm.errors import RecordingError
from mesa_swarm.fire.burning import Burning
from mesa_swarm.fire.fires import OF_BODIES
from mesa_swarm.fire.part import BURNING
from mesa_swarm.kernels.part import Part
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.container import Packed
from mesa_swarm.robots.swarm import FAILED_SENSORS

OF_BURNING = f"{Burning.__module__}.{Burning.__qualname__}"
# Attributes of models that were stored as such, with the parts that have them now.
FORMER = {
    "collisions": ("robots", "collisions"),
    "total_collisions": ("robots", "total_collisions"),
    "_turn_angle": ("robots", "turn_angle"),
    "extinguish_range": ("fires", "extinguish_range"),
}


def in_parts(facts: dict) -> dict:
    """Return the facts of a state with what formats before the fourth had elsewhere in parts."""
    if "parts" in facts:
        return facts
    attributes, parts = dict(facts["attributes"]), _stored_of_parts(facts)
    for name, (part, now) in FORMER.items():
        if name in attributes:
            parts[part][now] = attributes.pop(name)
    completed, running = (
        attributes.pop(name, {"plain": plain}) for name, plain in (("_completed", 0), ("running", True))
    )
    burns = attributes.pop("_burns", None)
    processes = [[number, kind] for number, kind, _ in facts.get("processes", ())]
    if burns is not None and burns["plain"] is True:  # older ones have an attribute for burning
        processes = [[BURNING, OF_BURNING], *processes]
    return {
        **facts,
        "attributes": attributes,
        "completed": completed["plain"],
        "running": running["plain"],
        "processes": processes,
        "parts": {name: {"stored": stored} for name, stored in parts.items()},
        "of_swarm": facts["columns"],
    }


def _stored_of_parts(facts: dict) -> dict[str, dict[str, Any]]:
    """Return what parts store, from where it was."""
    part, key = facts.get("imperfect") or (None, None)
    every, places, fires = facts["history"]
    fields = facts.get("scalars", [])
    return {
        "robots": {"noise": {"plain": facts["randomness"]["noise"]}},
        "imperfections": {
            "imperfections": {"part": part},
            "failing": {"plain": FAILED_SENSORS in facts["columns"]},
            "key": {"plain": key},
        },
        "radio": {"radio": {"part": facts["radio"]}},
        "control": {"arbiter": {"control": facts["control"]}, **_states_of_control(facts)},
        "fields": {
            "declared": {"plain": [_listed(declared) for declared, _ in fields]},
            "peaks": {"plain": [dict(map(tuple, state["dict"]))["peak"] for _, state in fields]},
        },
        "fires": {"constants": {"part": facts["constants"]}, "history": {"plain": [every, fires, places]}},
        "processes": _states_of_processes(facts),
        "state": {"values": {"plain": facts.get("state", {"dict": []})}},
    }


def _states_of_control(facts: dict) -> dict[str, Any]:
    """Return what arbiters and layers have stored, by their place; arbiters came first in the list."""
    states = facts["control_state"]
    count = len(states) - _number_of_layers(facts["control"])
    stored: dict[str, Any] = {}
    for place, state in enumerate(states):
        key = f"arbiter {place}" if place < count else f"layer {place - count}"
        if isinstance(state, dict) and key.startswith("layer") and set(state) == {"own"} and _is_packed(state["own"]):
            stored[key] = state
        else:
            stored |= {f"{key} {name}": content for name, content in (state or {}).items()}
    return stored


def _number_of_layers(control: Any) -> int:
    if control is None:
        return 0
    ((name, inner),) = control.items()
    if name == "Team":
        return sum(_number_of_layers(arbiter) for _, arbiter in inner)
    return len(inner["layers"])


def _is_packed(content: Any) -> bool:
    """Return whether a content is what a layer's `checkpoint` returned, rather than an attribute of the name own."""
    return isinstance(content, dict) and "dict" in content


def _states_of_processes(facts: dict) -> dict[str, Any]:
    stored: dict[str, Any] = {}
    for number, _, state in facts.get("processes", ()):
        if set(state) == {"own"} and _is_packed(state["own"]):
            stored[f"{number}"] = state
        else:
            stored |= {f"{number} {name}": content for name, content in state.items()}
    return stored


def columns_in_parts(model: EngineModel, facts: dict, parts: list[tuple[Part, dict]]) -> list[tuple[Part, dict]]:
    """Return parts with their stored columns, which earlier formats have by their names in the swarm."""
    if "of_swarm" not in facts:
        return [(part, content.get("columns", {})) for part, content in parts]
    names = {id(column): name for name, column in model.swarm.columns.items()}
    others = {**{name: column for name, column in facts["fires"].items()}, **_values_of_fields(facts)}
    taken, found = set(), []
    for part, _ in parts:
        if part.name == "bodies":  # whose state was stored with what they are, see `restore_fires`
            continue
        stored = {}
        for name, column in part.columns().items():
            own = names.get(id(column.array))
            content = facts["of_swarm"].get(own) if own is not None else others.get(name)
            if content is not None:
                stored[name] = content
                taken.add(own)
        found.append((part, stored))
    odd = sorted(facts["of_swarm"].keys() - taken)
    if odd:  # refused where the columns of robots are restored
        next(stored for part, stored in found if part.name == "robots")[odd[0]] = facts["of_swarm"][odd[0]]
    return found


def restore_fires(model: EngineModel, facts: dict, packed: Packed) -> None:
    """Write what fires have as bodies, which earlier formats have in a table of fires."""
    if "of_swarm" not in facts:
        return
    table = model.parts.bodies.table
    for name in OF_BODIES:
        column, value = getattr(table, name), packed.unpack(facts["fires"][name])
        shape = (len(model.fires), *column.shape[1:])
        if not isinstance(value, np.ndarray) or value.dtype != column.dtype or value.shape != shape:
            raise RecordingError(f"column {name} of fires does not match the model; expected {column.dtype} {shape}")
        column[model.fires.rows] = value
    table.aim[model.fires.rows] = table.position[model.fires.rows]


def _values_of_fields(facts: dict) -> dict[str, Any]:
    """Return the stored values of fields by name."""
    fields = (
        (_listed(declared)[0], dict(map(tuple, state["dict"]))["values"])
        for declared, state in facts.get("scalars", [])
    )
    return dict(fields)


def _listed(declared: Any) -> list:
    return declared["tuple"] if isinstance(declared, dict) else declared
