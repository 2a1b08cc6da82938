"""Checkpoints: everything a model needs to continue; states of earlier formats become parts as they are read."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from mesa.agent import Agent

from mesa_swarm.base.errors import RecordingError, SwarmError, error_line, shortened
from mesa_swarm.control.arbiter import MOST_LAYERS
from mesa_swarm.fire.burning import Burning
from mesa_swarm.fire.fires import OF_BODIES
from mesa_swarm.fire.fires_part import BURNING
from mesa_swarm.kernels.part import STORED, Part
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.mesa_model import has_own_events
from mesa_swarm.model.state import Checkpointed, checked_state, refuse_attributes
from mesa_swarm.recording.collected_data import (
    Path,
    collected_to_json,
    join_series,
    reporters_of,
    restore_collected,
    set_clock,
)
from mesa_swarm.recording.container import PLACES, Checkpoint, Packer
from mesa_swarm.recording.made_objects import check_made
from mesa_swarm.recording.objects import (
    added_to_json,
    make_removed,
    objects_to_json,
    other_agents,
    removed_to_json,
    restore_added,
    restore_objects,
    restore_removed,
)
from mesa_swarm.recording.provenance import FORMAT, hash_in_format
from mesa_swarm.recording.stored_values import (
    ModelPacker,
    apart_of_agent,
    attributes_to_json,
    generator_to_json,
    own_attributes_of_agent,
    part_from_json,
    part_to_json,
    restore_attributes,
    stored_from_json,
    stored_to_json,
)
from mesa_swarm.robots.design import LARGEST_RADIUS
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.swarm import FAILED_SENSORS, FAILED_WHEELS, WHEELS
from mesa_swarm.world.bodies import LARGEST_RESISTANCE
from mesa_swarm.world.statics import FIRE, FIXED, PUSHED

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
        "parts": {name: {"stored": values} for name, values in parts.items()},
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
            "declared": {"plain": [_as_list(field) for field, _ in fields]},
            "peaks": {"plain": [_state_of(state)["peak"] for _, state in fields]},
        },
        "fires": {"constants": {"part": facts["constants"]}, "history": {"plain": [every, fires, places]}},
        "processes": _states_by_name((f"{number}", state) for number, _, state in facts.get("processes", ())),
        "state": {"values": {"plain": facts.get("state", {"dict": []})}},
    }


def _states_of_control(facts: dict) -> dict[str, Any]:
    """Return what arbiters and layers have stored, by their place; arbiters came first in the list."""
    states = [state or {} for state in facts["control_state"]]
    count = len(states) - _number_of_layers(facts["control"])
    return {
        **{f"arbiter {k} {n}": content for k, state in enumerate(states[:count]) for n, content in state.items()},
        **_states_by_name((f"layer {place}", state) for place, state in enumerate(states[count:])),
    }


def _states_by_name(states: Iterable[tuple[str, dict]]) -> dict[str, Any]:
    """Return states of layers or processes by their keys: what `checkpoint` returned, or else each attribute."""
    content_by_name: dict[str, Any] = {}
    for key, state in states:
        # An attribute of the name own is not packed itself.
        if set(state) == {"own"} and isinstance(state["own"], dict) and "dict" in state["own"]:
            content_by_name[key] = state
        else:
            content_by_name |= {f"{key} {name}": content for name, content in state.items()}
    return content_by_name


def _number_of_layers(control: Any) -> int:
    if control is None:
        return 0
    ((name, inner),) = control.items()
    if name == "Team":
        return sum(_number_of_layers(arbiter) for _, arbiter in inner)
    return len(inner["layers"])


def columns_in_parts(model: EngineModel, facts: dict, parts: list[tuple[Part, dict]]) -> list[tuple[Part, dict]]:
    """Return parts with their stored columns, which earlier formats have by their names in the swarm."""
    if "of_swarm" not in facts:
        return [(part, content.get("columns", {})) for part, content in parts]
    names = {id(column): name for name, column in model.swarm.columns.items()}
    fields = {_as_list(field)[0]: _state_of(state)["values"] for field, state in facts.get("scalars", [])}
    others = {**facts["fires"], **fields}
    swarm_names, columns = set(), []
    for part, _ in parts:
        if part.name == "bodies":  # whose state was stored with what they are, see `restore_fires`
            continue
        of_part = {}
        for name, column in part.columns().items():
            swarm_name = names.get(id(column.array))
            content = facts["of_swarm"].get(swarm_name) if swarm_name is not None else others.get(name)
            if content is not None:
                of_part[name] = content
                swarm_names.add(swarm_name)
        columns.append((part, of_part))
    odd = sorted(facts["of_swarm"].keys() - swarm_names)
    if odd:  # refused where the columns of robots are restored
        next(of_robots for part, of_robots in columns if part.name == "robots")[odd[0]] = facts["of_swarm"][odd[0]]
    return columns


def restore_fires(model: EngineModel, facts: dict, packer: Packer) -> None:
    """Write what fires have as bodies, which earlier formats have in a table of fires."""
    if "of_swarm" not in facts:
        return
    table = model.parts.bodies.table
    for name in OF_BODIES:
        column, value = getattr(table, name), packer.unpack(facts["fires"][name])
        shape = (len(model.fires), *column.shape[1:])
        if not isinstance(value, np.ndarray) or value.dtype != column.dtype or value.shape != shape:
            raise RecordingError(f"column {name} of fires does not match the model; expected {column.dtype} {shape}")
        column[model.fires.rows] = value
    table.aim[model.fires.rows] = table.position[model.fires.rows]


def _as_list(field: Any) -> list:
    return field["tuple"] if isinstance(field, dict) else field


def _state_of(packed: dict) -> dict[str, Any]:
    return dict(map(tuple, packed["dict"]))


# Of the state of Python's generator.
WORDS = 625
# Parts of a stored state that follow how a run is observed, and what of that a part stores.
OBSERVING, HISTORY = ("reporters",), "history"


def checkpoint_of(model: EngineModel, since: dict[Path, int] | None = None, *, steps: int | None = None) -> Checkpoint:
    """Return the complete state of a model, between two steps; an error names what cannot be stored.

    Stored are its agents, its parts with their columns, all random streams, Mesa's counters, collected data, and all
    other attributes of the model that are plain, or have `checkpoint` and `restore`; agents that were removed, and to
    which these refer, are stored as removed. An array that is found in two of these is one array again when it is
    restored. Snapshots of `watch` are not. `since` has the lengths of the collected series at the last checkpoint
    (`lengths_of`): only values added since then are stored. `steps` is what Mesa had counted, if it has already counted
    a step that has not begun.
    """
    state_hash = model.state_hash()  # reads the sensors, as their next use does
    if has_own_events(model):
        raise RecordingError("Mesa's schedule has events besides the step, which cannot be stored")
    packer = ModelPacker(model)
    collected = collected_to_json(model, packer, since or {})
    packer.removed_agents = {}
    facts = {
        "steps": model.steps if steps is None else steps,
        "completed": model.completed,
        "running": packer.pack(model.running),
        "things": objects_to_json(model),
        **added_to_json(model, packer),
        "parts": {name: _part_to_json(part, packer) for name, part in model.parts.items()},
        "disturbed": model.swarm.disturbed,
        "collect_every": model.collect_every,
        **({"scale": part_to_json(model.scale)} if model.scale else {}),
        "randomness": _randomness(model, packer),
        "collected": collected,
        "reporters": {
            name: packer.pack(reporter.checkpoint(), f"reporter {name}")
            for name, reporter in reporters_of(model).items()
        },
        "attributes": attributes_to_json(model.own_attributes, "", packer),
        "of_things": _agent_attributes(model, packer),
    }
    if packer.removed_agents:
        facts["removed"] = removed_to_json(packer)
    return Checkpoint(step=model.completed, state_hash=state_hash, facts=facts, arrays=packer.arrays)


def _part_to_json(part: Part, packer: ModelPacker) -> dict:
    """Return the columns and the other state of a part, without those of which there are none."""
    columns = {name: packer.pack(column.array) for name, column in part.columns().items() if column.role in STORED}
    values = {name: stored_to_json(value, part.word_of(name), packer) for name, value in part.store().items()}
    return {name: content for name, content in (("columns", columns), ("stored", values)) if content}


def differing_part(model: EngineModel, twin: EngineModel) -> str:
    """Return the name of a part of the state in which two models differ, an empty text if there is none.

    What only observes a run, such as reporters, is not compared, and collected rows are where both models have them.
    """
    mine, others = checkpoint_of(model), checkpoint_of(twin)
    here, there = (_named_parts(checkpoint.facts) for checkpoint in (mine, others))
    for path in sorted(here.keys() | there.keys()):
        is_collected = path[0] == "collected" and not (path in here and path in there)
        content, same = here.get(path), there.get(path)
        if not is_collected and _with_arrays(content, mine) != _with_arrays(same, others):
            return " ".join(path[1::2] if path[0] in ("added", "parts") else path)
    return "" if mine.state_hash == others.state_hash else "its state hash"


def _named_parts(facts: dict) -> dict[tuple[str, ...], Any]:
    """Return the parts of a state, by paths that order and name them, without what only observes a run."""
    parts: dict[tuple[str, ...], Any] = {}
    for name, content in facts.items():
        if name == "collected":
            parts |= {(name, *path): values for path, _, values in content}
        elif name == "added":
            parts |= {(name, part, "", "as it is made"): values for part, *values in content}
        elif name == "parts":
            kinds = ((part, kind, values) for part, by_kind in content.items() for kind, values in by_kind.items())
            parts |= {
                (name, p, kind, key): values[key] for p, kind, values in kinds for key in values if key != HISTORY
            }
        elif isinstance(content, dict):
            parts |= {(name, key): value for key, value in content.items() if name not in OBSERVING}
        else:
            parts[name,] = content
    return parts


def _with_arrays(content: Any, checkpoint: Checkpoint) -> tuple[str, list[tuple[str, tuple, bytes]]]:
    """Return a part of a state as a text without the numbers of arrays, and these arrays."""
    text = json.dumps(content, separators=(",", ":"))
    arrays = [checkpoint.arrays[int(place)] for place in PLACES.findall(text)]
    return PLACES.sub("", text), [(array.dtype.str, array.shape, array.tobytes()) for array in arrays]


def restore(
    model: EngineModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint] = (), *, written_in: int = FORMAT
) -> EngineModel:
    """Restore the state of a checkpoint in a model that was just constructed, and return the model.

    It builds on the collected data of `earlier`, the checkpoints before it in the same recording, which is of the
    format `written_in`. A result that is not the state that was stored is refused.
    """
    where = f"the checkpoint of step {checkpoint.step}"
    try:
        _restore(model, checkpoint, earlier)
        state_hash = hash_in_format(model, written_in)
    except (SwarmError, ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError,
            ValueError) as error:  # fmt: skip
        raise RecordingError(f"{where} cannot be restored: {error_line(error)}") from None
    if state_hash != checkpoint.state_hash or model.completed != checkpoint.step:
        raise RecordingError(f"{where} does not match its state hash: another version of mesa_swarm wrote it")
    return model


def _restore(model: EngineModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint]) -> None:
    facts, packer = in_parts(checkpoint.facts), ModelPacker(model, checkpoint.arrays)
    remade = restore_objects(model, facts["things"])
    restore_added(model, facts, packer)
    make_removed(packer, facts.get("removed", []))
    parts = [(part, facts["parts"].get(name, {})) for name, part in model.parts.items()]
    for part, content in parts:
        first = {name: value for name, value in _stored(content).items() if name in part.first}
        if first:
            _restore_stored(part, first, packer)
    model.scale = part_from_json(facts.get("scale"))
    columns = columns_in_parts(model, facts, parts)
    _adopt(model, parts, columns, facts, packer)
    set_clock(model, facts["steps"])
    model.parts.set_completed(facts["completed"])
    model.collect_every = facts.get("collect_every", model.collect_every)  # absent from older checkpoints
    model.running = _checked_running(packer.unpack(facts["running"]))
    for part, content in parts:
        rest = {name: value for name, value in _stored(content).items() if name not in part.first}
        _restore_stored(part, rest, packer)
    _restore_attributes(model, facts, packer, remade)
    for part, contents in columns:
        _restore_columns(part, contents, packer)
    restore_fires(model, facts, packer)
    _check_columns(model)
    series = [(checkpoint.facts["collected"], ModelPacker(model, checkpoint.arrays)) for checkpoint in earlier]
    restore_collected(model, join_series([*series, (facts["collected"], packer)]))
    for name, reporter in reporters_of(model).items():
        reporter.restore(packer.unpack(facts["reporters"][name]))
    model.parts.bind()
    model.parts.bodies.changed()
    model.swarm.version += 1
    model.parts.robots.forget_readings()
    _restore_randomness(model, facts["randomness"], packer)
    model.swarm.disturbed = bool(facts["disturbed"])


def _stored(content: dict) -> dict:
    contents = content.get("stored", {})
    if not isinstance(contents, dict):
        raise RecordingError("invalid state of a part")
    return contents


def _restore_stored(part: Part, contents: dict, packer: ModelPacker) -> None:
    """Give a part values that are stored; objects that are the same stay the same."""
    now, kind = part.store(), type(part)
    if kind.restore is Part.restore:  # which sets attributes
        refuse_attributes(part, contents)
    part.restore({name: stored_from_json(now.get(name), name, content, packer) for name, content in contents.items()})


def _checked_running(running: Any) -> Any:
    if type(running) not in (bool, np.bool_):
        raise RecordingError(f"invalid running: {shortened(running)}")
    return running


def _adopt(model: EngineModel, parts: list, columns: list, facts: dict, packer: Packer) -> None:
    """Let the columns, and the arrays that a layer or a process restores itself, remain the same."""
    for part, contents in columns:
        for name, column in part.columns().items():
            if name in contents:
                packer.adopt(contents[name], column.array, write=False)
    owners = [(content, owner) for content, owner in _owners(model, parts, facts) if isinstance(owner, Checkpointed)]
    shared = _shared_places(facts) if owners else frozenset()
    for content, owner in owners:
        if isinstance(content, dict) and shared:
            packer.adopt(content.get("own"), owner.checkpoint(), shared)


def _owners(model: EngineModel, parts: list, facts: dict) -> Iterator[tuple[Any, object]]:
    """Iterate over what was stored of parts and attributes, each with what the model has now."""
    for part, content in parts:
        now = part.store()
        yield from ((content, now.get(name)) for name, content in _stored(content).items())
    yield from ((state, model.__dict__.get(name)) for name, state in facts["attributes"].items())


def _shared_places(facts: dict) -> frozenset[int]:
    """Return the numbers of the arrays that are found in more than one place."""
    without_series = {name: value for name, value in facts.items() if name != "collected"}
    places = Counter(PLACES.findall(json.dumps(without_series, separators=(",", ":"))))
    return frozenset(int(place) for place, count in places.items() if count > 1)


def _restore_columns(part: Part, contents: dict, packer: Packer) -> None:
    """Write stored columns into those of a part, which must have the same types and shapes."""
    columns = {name: column.array for name, column in part.columns().items() if column.role in STORED}
    if "group" in columns and "group" not in contents:  # in older recordings
        columns.pop("group")
    if contents.keys() != columns.keys():
        odd = sorted(contents.keys() ^ columns.keys())
        raise RecordingError(f"column {shortened(odd[0])} is in the model or in the checkpoint, but not in both")
    apart = Packer(packer.arrays)  # the columns themselves may be what others view
    values = {name: apart.unpack(column) for name, column in contents.items()}
    for name, column in columns.items():
        value = values[name]
        if not isinstance(value, np.ndarray) or value.dtype != column.dtype or value.shape != column.shape:
            raise RecordingError(f"column {name} does not match the model; expected {column.dtype} {column.shape}")
    for name, column in columns.items():
        column[...] = values[name]


def _check_columns(model: EngineModel) -> None:
    """Refuse values that compiled functions, which check nothing, would use as an index or a position."""
    robots, bodies, designs = model.swarm.columns, model.parts.bodies.table, model.swarm.designs
    ends = {"design": (0, len(designs)), "fire": (-1, len(model.fires)), "layer": (-1, MOST_LAYERS)}
    ends["group"] = (-1, len(model.swarm.groups))
    for name, (first, end) in ends.items():
        if not ((robots[name] >= first) & (robots[name] < end)).all():
            raise RecordingError(f"column {name} has out-of-range values")
    radius, fastest = (np.array([getattr(d, name) for d in designs]) for name in ("radius", "max_speed"))
    low, high = np.reshape(model.map.bounds, (2, 2))
    design, wheels = robots["design"], robots.get(FAILED_WHEELS, np.zeros(1))
    moving, fires, loads = bodies.mode != FIXED, bodies.kind == FIRE, bodies.mode == PUSHED
    places = (robots["position"], bodies.position[moving | fires], bodies.aim[moving])
    at_rest = np.flatnonzero(~(moving | fires)).tolist()
    shapes = np.array([[*(shape := bodies.shape_of(row)).position, shape.radius] for row in at_rest]).reshape(-1, 3)
    heat, turns = bodies.temperature, np.concatenate([bodies.heading, bodies.aim_heading])
    valid = {
        FAILED_WHEELS: ((wheels >= 0) & (wheels < len(WHEELS))).all(),
        "position": all(((place >= low) & (place <= high)).all() for place in places)
        and (bodies.position[at_rest] == shapes[:, :2]).all(),
        "heading of bodies": (np.abs(turns) <= np.pi).all(),
        "temperature of bodies": (np.isnan(heat) | ((heat >= 0) & (heat <= 1))).all()
        and not np.isnan(heat[fires]).any(),
        "resistance": ((bodies.resistance[loads] > 0) & (bodies.resistance[loads] <= LARGEST_RESISTANCE)).all(),
        "heading": np.isfinite(robots["heading"]).all(),
        "number": len(np.unique(robots["number"])) == len(model.swarm),
        "command": np.isfinite(robots["command"]).all(),
        "radius": not len(design) or (robots["radius"] == radius[design]).all(),
        "max_speed": not len(design) or ((robots["max_speed"] >= 0) & (robots["max_speed"] <= fastest[design])).all(),
        "radius of bodies": (bodies.radius[at_rest] == shapes[:, 2]).all(),
        "radius of fires": ((bodies.radius[fires] > 0) & (bodies.radius[fires] <= LARGEST_RADIUS)).all(),
    }
    for name, is_valid in valid.items():
        if not is_valid:
            raise RecordingError(f"column {name} has out-of-range values")


def _restore_attributes(
    model: EngineModel, facts: dict, packer: ModelPacker, remade: dict[Agent, Agent | None]
) -> None:
    attributes = facts["attributes"]
    for name in model.own_attributes.keys() - attributes.keys():
        del model.__dict__[name]
    restore_attributes(model, attributes, packer, model.reserved)
    _restore_agents(model, dict(facts["of_things"]), packer, remade)
    restore_removed(packer, facts.get("removed", []))


def _restore_agents(
    model: EngineModel, values_by_id: dict[int, dict], packer: ModelPacker, remade: dict[Agent, Agent | None]
) -> None:
    """Restore attributes of agents; `remade` are those without constructor, each with one of its class that had one."""
    for agent in other_agents(model):
        for name in own_attributes_of_agent(agent).keys() - values_by_id.get(agent.unique_id, {}).keys():
            delattr(agent, name)
    agents = {agent.unique_id: agent for agent in model.agents}
    for unique_id, values in values_by_id.items():
        agent = agents[unique_id]
        if agent in remade:
            check_made(agent, values, remade[agent])
        restore_attributes(agent, values, packer, apart_of_agent(agent))


def _agent_attributes(model: EngineModel, packer: ModelPacker) -> list:
    """Return the attributes that users have added to robots and other agents, and all of agents of their own."""
    extra = []
    for agent in model.agents:
        if isinstance(agent, Robot) and not agent.__dict__:  # as most of them, and there may be very many
            continue
        attributes = own_attributes_of_agent(agent)
        if attributes:
            what = f"{type(agent).__name__} {agent.unique_id}'s "
            extra.append([agent.unique_id, attributes_to_json(attributes, what, packer)])
    return extra


def _randomness(model: EngineModel, packer: Packer) -> dict:
    version, words, gauss = model.random.getstate()
    return {
        "streams": {name: packer.pack(state) for name, state in model.streams.state().items()},
        "rng": generator_to_json(model.rng, "rng", packer),
        "random": [version, packer.pack(np.array(words, np.uint32)), gauss],
    }


def _restore_randomness(model: EngineModel, facts: dict, packer: Packer) -> None:
    for name, state in facts["streams"].items():
        model.streams[name].bit_generator.state = checked_state(packer.unpack(state))
    model.rng.bit_generator.state = checked_state(packer.unpack(facts["rng"]))
    version, content, gauss = facts["random"]
    words = packer.unpack(content)
    if not isinstance(words, np.ndarray) or words.shape != (WORDS,):
        raise RecordingError("invalid state of Python's random numbers")
    model.random.setstate((version, tuple(words.tolist()), gauss))
