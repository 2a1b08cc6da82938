"""Checkpoints: everything a model needs to continue."""

import json
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np
from mesa import Model
from mesa.agent import Agent

from mesa_swarm.control.arbiter import MOST_LAYERS
from mesa_swarm.errors import RecordingError, SwarmError, asked, in_words, shortened
from mesa_swarm.fire.burning import Burning
from mesa_swarm.fire.model import BURNING, FireModel
from mesa_swarm.mesa_model import has_own_events
from mesa_swarm.recording.attributes import (
    ModelPacked,
    apart_of_agent,
    attribute_from_json,
    attribute_to_json,
    checked_state,
    generator_to_json,
    own_attributes,
    own_attributes_of_agent,
    refuse_attributes,
)
from mesa_swarm.recording.collected import (
    Path,
    collected_to_json,
    joined,
    reporters_of,
    restore_collected,
    set_clock,
)
from mesa_swarm.recording.container import PLACES, Checkpoint, Packed
from mesa_swarm.recording.making import OF_PACKAGE, check_made, check_process_class
from mesa_swarm.recording.parts import (
    classes_near,
    control_from_json,
    control_to_json,
    is_class,
    objects_to_json,
    other_agents,
    part_from_json,
    part_to_json,
    restore_objects,
)
from mesa_swarm.recording.provenance import FORMAT, hash_in_format
from mesa_swarm.recording.removed import make_removed, removed_to_json, restore_removed
from mesa_swarm.robots.design import LARGEST_RADIUS
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.swarm import FAILED_SENSORS, FAILED_WHEELS, WHEELS
from mesa_swarm.state import Checkpointed, attributes_of, declared

LARGEST_NUMBER = 1e15
# Of the state of Python's generator.
WORDS = 625
OURS = ("mesa_swarm.control.", "mesa_swarm.fire.")
# Parts of a stored state that follow how a run is observed.
OBSERVING = ("reporters", "history")
OF_BURNING = f"{Burning.__module__}.{Burning.__qualname__}"


def checkpoint_of(model: FireModel, since: dict[Path, int] | None = None, *, steps: int | None = None) -> Checkpoint:
    """Return the complete state of a model, between two steps; an error names what cannot be stored.

    Stored are the swarm, obstacles, loads, fires, radio, control, processes, the declared state, all random streams,
    Mesa's counters, collected data, and all other attributes of the model that are plain, or have `checkpoint` and
    `restore`; agents that were removed, and to which these refer, are stored as removed. An array that is found in two
    of these is one array again when it is restored. Snapshots of `watch` are not. `since` has the lengths of the
    collected series at the last checkpoint (`lengths_of`): only values added since then are stored. `steps` is what
    Mesa had counted, if it has already counted a step that has not begun.
    """
    state_hash = model.state_hash()  # reads the sensors, as their next use does
    if has_own_events(model):
        raise RecordingError("Mesa's schedule has events besides the step, which cannot be stored")
    packed = ModelPacked(model)
    collected = collected_to_json(model, packed, since or {})
    packed.removed = {}
    facts = {
        "steps": model.steps if steps is None else steps,
        "things": objects_to_json(model),
        "columns": {name: packed.pack(column) for name, column in sorted(model.swarm.columns.items())},
        "disturbed": model.swarm.disturbed,
        **({"scalars": packed.pack(model._fields_as_stored())} if model.fields else {}),
        "fires": {name: packed.pack(column) for name, column in model.fires.columns.items()},
        "collect_every": model.collect_every,
        "history": [model.fires.history.every, list(model.fires.history._places), model.fires.history._fires],
        "constants": part_to_json(model.fire_constants),
        "radio": part_to_json(model.communication),
        **({"scale": part_to_json(model.scale)} if model.scale else {}),
        "imperfect": model._imperfect and [part_to_json(model.imperfections), model._imperfect.key],
        "control": control_to_json(model.control),
        "control_state": _control_state(model, packed),
        "randomness": _randomness(model, packed),
        "collected": collected,
        "reporters": {
            name: packed.pack(reporter.checkpoint(), f"reporter {name}")
            for name, reporter in reporters_of(model).items()
        },
        "attributes": {n: attribute_to_json(v, n, packed) for n, v in own_attributes(model).items()},
        "of_things": _agent_attributes(model, packed),
        **_declared_to_json(model, packed),
    }
    if packed.removed:
        facts["removed"] = removed_to_json(packed)
    return Checkpoint(step=model.completed, state_hash=state_hash, facts=facts, arrays=packed.arrays)


def differing_part(one: FireModel, other: FireModel) -> str:
    """Return the name of a part of the state in which two models differ, an empty text if there is none.

    What only observes a run, such as reporters, is not compared, and collected rows are where both models have them.
    """
    mine, others = checkpoint_of(one), checkpoint_of(other)
    for name, what, content, same in _paired_parts(mine.facts, others.facts):
        if name not in OBSERVING and _with_arrays(content, mine) != _with_arrays(same, others):
            return what
    return "" if mine.state_hash == others.state_hash else "its state hash"


def _paired_parts(mine: dict, others: dict) -> Iterator[tuple[str, str, Any, Any]]:
    """Iterate over the parts of two states: the name, that of an inner part with it, and the two contents."""
    for name in sorted({*mine, *others}):
        content, same = mine.get(name), others.get(name)
        if name == "collected":
            series, known = ({tuple(path): values for path, _, values in facts[name]} for facts in (mine, others))
            yield from ((name, f"{name} {' '.join(p)}", series[p], known[p]) for p in series if p in known)
        elif isinstance(content, dict) and isinstance(same, dict):
            yield from ((name, f"{name} {one}", content.get(one), same.get(one)) for one in sorted({*content, *same}))
        else:
            yield name, name, content, same


def _with_arrays(content: Any, checkpoint: Checkpoint) -> tuple[str, list[tuple[str, tuple, bytes]]]:
    """Return a part of a state as a text without the numbers of arrays, and these arrays."""
    text = json.dumps(content, separators=(",", ":"))
    arrays = [checkpoint.arrays[int(place)] for place in PLACES.findall(text)]
    return PLACES.sub("", text), [(array.dtype.str, array.shape, array.tobytes()) for array in arrays]


def restore(
    model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint] = (), *, written_in: int = FORMAT
) -> FireModel:
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
        raise RecordingError(f"{where} cannot be restored: {in_words(error)}") from None
    if state_hash != checkpoint.state_hash or model.completed != checkpoint.step:
        raise RecordingError(f"{where} does not match its state hash: another version of mesa_swarm wrote it")
    return model


def _restore(model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint]) -> None:
    facts, packed = _with_burning(checkpoint.facts), ModelPacked(model, checkpoint.arrays)
    made = restore_objects(model, facts["things"])
    make_removed(packed, facts.get("removed", []))
    model._restore_fields(packed.unpack(facts.get("scalars", [])))
    model.fire_constants = part_from_json(facts["constants"])
    _restore_control(model, facts)
    _adopt(model, facts, packed)
    _restore_control_state(model, facts, packed)
    set_clock(model, facts["steps"])
    model.collect_every = facts.get("collect_every", model.collect_every)  # absent from older checkpoints
    _restore_attributes(model, facts, packed, made)
    _restore_declared(model, facts, packed)
    _restore_columns(model.swarm.columns, facts["columns"], packed)
    _restore_columns(model.fires.columns, facts["fires"], packed)
    _check_columns(model)
    _restore_history(model, facts["history"])
    parts = [(part.facts["collected"], ModelPacked(model, part.arrays)) for part in earlier]
    restore_collected(model, joined([*parts, (facts["collected"], packed)]))
    for name, reporter in reporters_of(model).items():
        reporter.restore(packed.unpack(facts["reporters"][name]))
    model.obstacles_changed()
    model.swarm.version += 1
    model._sensed = None
    _restore_randomness(model, facts["randomness"], packed)
    model.swarm.disturbed = bool(facts["disturbed"])


def _with_burning(facts: dict) -> dict:
    """Return facts in which burning is a process; older checkpoints have an attribute for it."""
    attributes = dict(facts["attributes"])
    burns = attributes.pop("_burns", None)
    if burns is None:
        return facts
    processes = [*([[BURNING, OF_BURNING, {}]] if burns["plain"] is True else []), *facts.get("processes", [])]
    return {**facts, "attributes": attributes, "processes": processes}


def _adopt(model: FireModel, facts: dict, packed: Packed) -> None:
    """Let the columns, and the arrays that a layer or a process restores itself, remain the same."""
    for columns, stored in ((model.swarm.columns, facts["columns"]), (model.fires.columns, facts["fires"])):
        for name in columns.keys() & stored.keys():
            packed.adopt(stored[name], columns[name], write=False)
    owners = [(state, owner) for state, owner in _states_of(model, facts) if isinstance(owner, Checkpointed)]
    shared = _shared_places(facts) if owners else frozenset()
    for state, owner in owners:
        if isinstance(state, dict) and shared:
            packed.adopt(state.get("own"), owner.checkpoint(), shared)


def _states_of(model: FireModel, facts: dict) -> Iterator[tuple[Any, object]]:
    """Iterate over what was stored of layers, processes and attributes, each with what the model has now."""
    parts, layers = ((), ()) if model.control is None else (model.control.parts, model.control.layers)
    yield from zip(facts["control_state"][len(parts) :], layers, strict=False)
    yield from ((state, model._processes.get(number)) for number, _, state in facts.get("processes", ()))
    yield from ((state, model.__dict__.get(name)) for name, state in facts["attributes"].items())


def _shared_places(facts: dict) -> frozenset[int]:
    """Return the numbers of the arrays that are found in more than one place."""
    found = {name: value for name, value in facts.items() if name != "collected"}
    places = Counter(PLACES.findall(json.dumps(found, separators=(",", ":"))))
    return frozenset(int(place) for place, count in places.items() if count > 1)


def _restore_columns(columns: dict[str, np.ndarray], stored: dict, packed: Packed) -> None:
    """Write stored columns into those of a model, which must have the same types and shapes."""
    if "group" in columns and "group" not in stored:  # in older recordings
        columns = {name: column for name, column in columns.items() if name != "group"}
    if stored.keys() != columns.keys():
        odd = sorted(stored.keys() ^ columns.keys())
        raise RecordingError(f"column {shortened(odd[0])} is in the model or in the checkpoint, but not in both")
    apart = Packed(packed.arrays)  # the columns themselves may be what others view
    values = {name: apart.unpack(column) for name, column in stored.items()}
    for name, column in columns.items():
        value = values[name]
        if not isinstance(value, np.ndarray) or value.dtype != column.dtype or value.shape != column.shape:
            raise RecordingError(f"column {name} does not match the model; expected {column.dtype} {column.shape}")
    for name, column in columns.items():
        column[...] = values[name]


def _check_columns(model: FireModel) -> None:
    """Refuse values that compiled functions, which check nothing, would use as an index or a position."""
    robots, fires, designs = model.swarm.columns, model.fires.columns, model.swarm.designs
    ends = {"design": (0, len(designs)), "fire": (-1, len(model.fires)), "layer": (-1, MOST_LAYERS)}
    ends["group"] = (-1, len(model.swarm.groups))
    for name, (first, end) in ends.items():
        if not ((robots[name] >= first) & (robots[name] < end)).all():
            raise RecordingError(f"column {name} has out-of-range values")
    radius, fastest = (np.array([getattr(d, name) for d in designs]) for name in ("radius", "max_speed"))
    low, high = np.reshape(model.map.bounds, (2, 2))
    own, wheels = robots["design"], robots.get(FAILED_WHEELS, np.zeros(1))
    valid = {
        FAILED_WHEELS: ((wheels >= 0) & (wheels < len(WHEELS))).all(),
        "position": all(((c["position"] >= low) & (c["position"] <= high)).all() for c in (robots, fires)),
        "heading": np.isfinite(robots["heading"]).all(),
        "number": len(np.unique(robots["number"])) == len(model.swarm),
        "command": np.isfinite(robots["command"]).all(),
        "radius": not len(own) or (robots["radius"] == radius[own]).all(),
        "max_speed": not len(own) or ((robots["max_speed"] >= 0) & (robots["max_speed"] <= fastest[own])).all(),
        "radius of fires": ((fires["radius"] > 0) & (fires["radius"] <= LARGEST_RADIUS)).all(),
    }
    for name, is_valid in valid.items():
        if not is_valid:
            raise RecordingError(f"column {name} has out-of-range values")


def _restore_history(model: FireModel, stored: list) -> None:
    """Restore the interval and the places of the history of fires; its rows are collected data."""
    history = model.fires.history
    every, places, fires = stored
    numbers = all(type(number) is int and number >= 0 for number in (every, fires, *places))
    if not numbers or len(places) != len(model.fires) or any(place >= fires for place in places) or fires > 1e7:
        raise RecordingError("invalid history of fires")
    history.every, history._places, history._fires = every, list(places), fires


def _control_state(model: FireModel, packed: ModelPacked) -> list:
    if model.control is None:
        return []
    arbiters, layers = model.control.parts, model.control.layers
    return [*(_arbiter_state(one, packed) for one in arbiters), *(_layer_state(layer, packed) for layer in layers)]


def _arbiter_state(arbiter: Any, packed: ModelPacked) -> object:
    values = {} if type(arbiter).__module__.startswith(OURS) else vars(arbiter)
    own = {name: value for name, value in values.items() if name not in ("layers", "weights", "others")}
    return _inner(own, type(arbiter).__name__, packed)


def _layer_state(layer: Any, packed: ModelPacked) -> object:
    if isinstance(layer, Checkpointed):
        return {"own": packed.pack(layer.checkpoint(), f"layer {getattr(layer, 'name', '')}")}
    if type(layer).__module__.startswith(OURS):
        return None
    return _inner(getattr(layer, "__dict__", {}), f"layer {getattr(layer, 'name', '')}", packed)


def _inner(values: dict, what: str, packed: ModelPacked) -> dict:
    swarm = packed.model.swarm
    return {n: attribute_to_json(v, f"{what}'s {n}", packed) for n, v in values.items() if v is not swarm}


def _restore_imperfect(model: FireModel, stored: list | None, columns: Collection[str]) -> None:
    """Restore the imperfections, and the key of their random numbers."""
    if stored is None and model.imperfections is None:
        return
    part, key = stored or (None, 0)
    model.imperfections = part_from_json(part)
    if FAILED_SENSORS in columns:
        model.prepare_failures()
    if type(key) is not int or not 0 <= key < 2**64:
        raise RecordingError(f"invalid key of imperfections: {shortened(key)}")
    if model._imperfect is not None:
        model._imperfect.key = key


def _restore_control(model: FireModel, facts: dict) -> None:
    """Restore the radio and the control, unless the model's constructor has made the same."""
    _restore_imperfect(model, facts.get("imperfect"), facts["columns"])
    model.scale = part_from_json(facts.get("scale"))
    radio = part_from_json(facts["radio"])
    if model.communication != radio:
        model.communication = radio
    if control_to_json(model.control) != facts["control"]:
        model.control = control_from_json(facts["control"])


def _restore_control_state(model: FireModel, facts: dict, packed: ModelPacked) -> None:
    if model.control is None:
        return
    arbiters, states = model.control.parts, facts["control_state"]
    for arbiter, state in zip(arbiters, states, strict=False):
        _restore_inner(arbiter, state, packed)
    for layer, state in zip(model.control.layers, states[len(arbiters) :], strict=True):
        if isinstance(layer, Checkpointed):
            layer.restore(packed.unpack(state["own"]))
        elif state is not None:
            _restore_inner(layer, state, packed)


def _restore_inner(owner: object, state: dict, packed: ModelPacked) -> None:
    if state and type(owner).__module__.startswith(OURS):
        raise RecordingError(f"{type(owner).__name__} has no state of its own")
    refuse_attributes(owner, state)
    for name, content in state.items():
        object.__setattr__(owner, name, attribute_from_json(getattr(owner, name, None), name, content, packed))


def _declared_to_json(model: FireModel, packed: ModelPacked) -> dict:
    """Return `model.state` and processes, without those of which there are none."""
    declared_state = {
        "state": model._state and packed.pack(dict(model._state), "state"),
        "processes": [_process_to_json(place, process, packed) for place, process in model._processes.items()],
    }
    return {name: content for name, content in declared_state.items() if content}


def _process_to_json(number: int, process: object, packed: ModelPacked) -> list:
    kind = type(process)
    what = f"process {kind.__name__}"
    if isinstance(process, Checkpointed):
        state: dict = {"own": packed.pack(process.checkpoint(), what)}
    else:
        state = _inner(attributes_of(process), what, packed)
    return [number, f"{kind.__module__}.{kind.__qualname__}", state]


def _restore_declared(model: FireModel, facts: dict, packed: ModelPacked) -> None:
    model.state = packed.unpack(facts["state"]) if "state" in facts else {}
    stored = {number: (kind, state) for number, kind, state in facts.get("processes", ())}
    for number, process in list(model._processes.items()):
        if number not in stored:
            model.remove_process(process)
    if BURNING in stored:
        model._begin_burning()
    for number, (kind, state) in stored.items():
        own: Any = model._processes.get(number)
        if own is None:
            own = model._processes[number] = _made_process(model, kind)
            check_made(own, () if isinstance(own, Checkpointed) else state)
        elif not _is_kind(type(own), kind):
            raise RecordingError(_odd_process(model, kind))
        _restore_process(own, state, packed)
    model._processes = {number: model._processes[number] for number in sorted(model._processes)}


def _made_process(model: FireModel, kind: str) -> Any:
    """Make a process that no constructor adds, of a class in the model's own module or the package, without it."""
    classes = (*classes_near(model), *OF_PACKAGE)
    found = next((one for one in classes if _is_kind(one, kind) and callable(asked(one, "step"))), None)
    if found is None or issubclass(found, Agent | Model):
        raise RecordingError(_odd_process(model, kind))
    check_process_class(found)
    return object.__new__(found)


def _is_kind(kind: type, stored: str) -> bool:
    """Return whether a process of this class may have been stored, see `is_class`."""
    return is_class(kind, stored.removesuffix(f".{kind.__qualname__}"), kind.__qualname__) and stored.endswith(
        f".{kind.__qualname__}"
    )


def _odd_process(model: FireModel, kind: str) -> str:
    return (
        f"process {shortened(kind)} is not one that the constructor of {type(model).__name__} adds, and its class is "
        f"not in {type(model).__module__}; add the process in the constructor, or define its class there"
    )


def _restore_process(process: Any, state: dict, packed: ModelPacked) -> None:
    if isinstance(process, Checkpointed):
        process.restore(packed.unpack(state["own"]))
        return
    for name in [name for name in getattr(process, "__dict__", {}) if name not in state]:
        delattr(process, name)
    refuse_attributes(process, state)
    for name, content in state.items():
        value = attribute_from_json(getattr(process, name, None), name, content, packed)
        object.__setattr__(process, name, value)


def _restore_attributes(model: FireModel, facts: dict, packed: ModelPacked, made: dict[Agent, Agent | None]) -> None:
    attributes = facts["attributes"]
    refuse_attributes(model, attributes, declared(model, "_stored_apart"))
    for name in own_attributes(model).keys() - attributes.keys():
        del model.__dict__[name]
    for name, content in attributes.items():
        model.__dict__[name] = attribute_from_json(model.__dict__.get(name), name, content, packed)
    numbers = {name: kinds for base in type(model).__mro__ for name, kinds in vars(base).get("_numbers", {}).items()}
    for name, kinds in numbers.items():
        number: Any = getattr(model, name, None)
        if type(number) not in kinds or not 0 <= number < LARGEST_NUMBER:
            raise RecordingError(f"invalid {name}: {shortened(number)}")
    _restore_agents(model, dict(facts["of_things"]), packed, made)
    restore_removed(packed, facts.get("removed", []))


def _restore_agents(
    model: FireModel, stored: dict[int, dict], packed: ModelPacked, made: dict[Agent, Agent | None]
) -> None:
    """Restore attributes of agents; `made` are those without constructor, each with one of its class that had one."""
    for agent in other_agents(model):
        for name in own_attributes_of_agent(agent).keys() - stored.get(agent.unique_id, {}).keys():
            delattr(agent, name)
    agents = {agent.unique_id: agent for agent in model.agents}
    for unique_id, values in stored.items():
        agent = agents[unique_id]
        refuse_attributes(agent, values, apart_of_agent(agent))
        if agent in made:
            check_made(agent, values, made[agent])
        for name, content in values.items():
            value = attribute_from_json(getattr(agent, name, None), name, content, packed)
            object.__setattr__(agent, name, value)


def _agent_attributes(model: FireModel, packed: ModelPacked) -> list:
    """Return the attributes that users have added to robots and other agents, and all of agents of their own."""
    extra = []
    for agent in model.agents:
        if isinstance(agent, Robot) and not agent.__dict__:  # as most of them, and there may be very many
            continue
        own = own_attributes_of_agent(agent)
        if own:
            what = f"{type(agent).__name__} {agent.unique_id}'s "
            extra.append([agent.unique_id, {n: attribute_to_json(v, what + n, packed) for n, v in own.items()}])
    return extra


def _randomness(model: FireModel, packed: Packed) -> dict:
    version, words, gauss = model.random.getstate()
    return {
        "streams": {name: packed.pack(state) for name, state in model.streams.state().items()},
        "rng": generator_to_json(model.rng, "rng", packed),
        "random": [version, packed.pack(np.array(words, np.uint32)), gauss],
        "noise": packed.pack(model._noise),
    }


def _restore_randomness(model: FireModel, facts: dict, packed: Packed) -> None:
    for name, state in facts["streams"].items():
        model.streams[name].bit_generator.state = checked_state(packed.unpack(state))
    model.rng.bit_generator.state = checked_state(packed.unpack(facts["rng"]))
    version, content, gauss = facts["random"]
    words = packed.unpack(content)
    if not isinstance(words, np.ndarray) or words.shape != (WORDS,):
        raise RecordingError("invalid state of Python's random numbers")
    model.random.setstate((version, tuple(words.tolist()), gauss))
    noise = packed.unpack(facts["noise"])
    if noise is not None:
        _, before, draws = noise
        checked_state(before)
        if not isinstance(draws, np.ndarray) or draws.dtype != float:
            raise RecordingError("invalid sensor noise")
    model._noise = noise
