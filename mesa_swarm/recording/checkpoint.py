"""Checkpoints: everything a model needs to continue."""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from mesa import Model
from mesa.agent import Agent, AgentSet
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.control.arbiter import MOST_LAYERS
from mesa_swarm.errors import RecordingError, SwarmError, asked, check_name, in_words, shortened
from mesa_swarm.fire.burning import Burning
from mesa_swarm.fire.model import BURNING, FireModel
from mesa_swarm.recording.collected import (
    Path,
    collected_to_json,
    has_own_events,
    joined,
    reporters_of,
    restore_collected,
    set_clock,
)
from mesa_swarm.recording.container import ATOMS, PLACES, Checkpoint, Packed
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
from mesa_swarm.recording.removed import remains_from_json, remains_to_json
from mesa_swarm.robots.design import LARGEST_RADIUS
from mesa_swarm.state import Checkpointed, attributes_of, declared
from mesa_swarm.world.arena import ArenaAgent

LARGEST_NUMBER = 1e15
# Attributes of each of Mesa's agents that are stored with what the model contains.
OF_AGENTS = frozenset({"model", "unique_id"})
OF_ARENA = OF_AGENTS | {"space", "_mesa_index", "pos"}
# Bit generators of which every state is valid.
GENERATORS = ("PCG64", "PCG64DXSM")
# Kinds of references to parts of a model.
REFERENCES = ("of_model", "process", "layer", "field")
# Of the state of Python's generator.
WORDS = 625
OURS = ("mesa_swarm.control.", "mesa_swarm.fire.")
OF_BURNING = f"{Burning.__module__}.{Burning.__qualname__}"


class ModelPacked(Packed):
    """Plain values of a model, which may refer to its agents by unique_id.

    `removed` are agents that were removed from it and to which values refer; None refuses such values.
    """

    def __init__(self, model: FireModel, arrays: list[np.ndarray] | None = None) -> None:
        super().__init__(arrays)
        self.model = model
        self.removed: dict[int, Agent] | None = None
        self._agents: dict[int, Agent] | None = None

    def pack(self, value: Any, what: str = "a value", depth: int = 0) -> object:
        """Return a value as JSON."""
        if isinstance(value, Agent):
            return {"agent": value.unique_id} if value in self.model.agents else self._packed_removed(value, what)
        if isinstance(value, AgentSet):
            return {"agents": [self.pack(agent, what) for agent in value]}
        return super().pack(value, what, depth)

    def _packed_removed(self, agent: Agent, what: str) -> dict:
        if self.removed is None or agent.model is not self.model:
            raise RecordingError(f"{what} refers to an agent that is not in the model, which cannot be stored")
        self.removed[agent.unique_id] = agent
        return {"removed": agent.unique_id}

    def unpack(self, content: Any) -> Any:
        """Return the value for which `pack` returned this."""
        if isinstance(content, dict) and "removed" in content:
            return (self.removed or {})[content["removed"]]
        if isinstance(content, dict) and "agent" in content:
            if self._agents is None:
                self._agents = {agent.unique_id: agent for agent in self.model.agents}
            return self._agents[content["agent"]]
        if isinstance(content, dict) and "agents" in content:
            return AgentSet([self.unpack(agent) for agent in content["agents"]], random=self.model.random)
        return super().unpack(content)


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


def restore(model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint] = ()) -> FireModel:
    """Restore the state of a checkpoint in a model that was just constructed, and return the model.

    It builds on the collected data of `earlier`, the checkpoints before it in the same recording. A result that is not
    the state that was stored is refused.
    """
    where = f"the checkpoint of step {checkpoint.step}"
    try:
        _restore(model, checkpoint, earlier)
        state_hash = model.state_hash()
    except (SwarmError, ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError,
            ValueError) as error:  # fmt: skip
        raise RecordingError(f"{where} cannot be restored: {in_words(error)}") from None
    if state_hash != checkpoint.state_hash or model.completed != checkpoint.step:
        raise RecordingError(f"{where} does not match its state hash: another version of mesa_swarm wrote it")
    return model


def _restore(model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint]) -> None:
    facts, packed = _with_burning(checkpoint.facts), ModelPacked(model, checkpoint.arrays)
    restore_objects(model, facts["things"])
    make_removed(packed, facts.get("removed", []))
    model._restore_fields(packed.unpack(facts.get("scalars", [])))
    model.fire_constants = part_from_json(facts["constants"])
    _restore_control(model, facts)
    _adopt(model, facts, packed)
    _restore_control_state(model, facts, packed)
    set_clock(model, facts["steps"])
    model.collect_every = facts.get("collect_every", model.collect_every)  # absent from older checkpoints
    _restore_attributes(model, facts, packed)
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
    own = robots["design"]
    valid = {
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


def _restore_imperfect(model: FireModel, stored: list | None) -> None:
    """Restore the imperfections, and the key of their random numbers."""
    if stored is None and model.imperfections is None:
        return
    part, key = stored or (None, 0)
    model.imperfections = part_from_json(part)
    if type(key) is not int or not 0 <= key < 2**64:
        raise RecordingError(f"invalid key of imperfections: {shortened(key)}")
    if model._imperfect is not None:
        model._imperfect.key = key


def _restore_control(model: FireModel, facts: dict) -> None:
    """Restore the radio and the control, unless the model's constructor has made the same."""
    _restore_imperfect(model, facts.get("imperfect"))
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
        elif not _is_kind(type(own), kind):
            raise RecordingError(_odd_process(model, kind))
        _restore_process(own, state, packed)
    model._processes = {number: model._processes[number] for number in sorted(model._processes)}


def _made_process(model: FireModel, kind: str) -> Any:
    """Make a process that no constructor adds, of a class in the model's own module, without its constructor."""
    found = next((one for one in classes_near(model) if _is_kind(one, kind) and callable(asked(one, "step"))), None)
    if found is None or issubclass(found, Agent | Model):
        raise RecordingError(_odd_process(model, kind))
    return found.__new__(found)


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
    for name, content in state.items():
        value = attribute_from_json(getattr(process, name, None), name, content, packed)
        object.__setattr__(process, name, value)


def own_attributes(model: FireModel) -> dict[str, Any]:
    """Return the attributes of a model that are stored as they are."""
    apart = declared(model, "_stored_apart")
    return {name: value for name, value in model.__dict__.items() if name not in apart}


def attribute_to_json(value: object, name: str, packed: ModelPacked) -> object:
    """Return an attribute as JSON: plain, a random generator, a part of the model, or an object with a state."""
    reference = None if type(value) in ATOMS else _reference(value, packed.model)
    if reference is not None:
        return reference
    if isinstance(value, np.random.Generator):
        stream = packed.model.streams.name_of(value)
        return {"generator": _generator(value, name, packed)} if stream is None else {"stream": stream}
    if isinstance(value, Checkpointed) and not isinstance(value, type):
        return {"own": packed.pack(value.checkpoint(), name)}
    for column, own in packed.model.swarm.columns.items():
        if value is own:
            return {"column": column}
    try:
        return {"plain": packed.pack(value, name)}
    except RecordingError as error:
        try:
            return {"part": part_to_json(value)}
        except RecordingError:
            raise RecordingError(f"{error}; give its class checkpoint() and restore(state)") from None


def _reference(value: object, model: FireModel) -> dict | None:
    """Return which part of the model an object is: the model itself, or what it stores apart; None if it is neither."""
    if value is model:
        return {"of_model": ""}
    apart = declared(model, "_stored_apart")
    names = [name for name in sorted(apart & model.__dict__.keys()) if model.__dict__[name] is value]
    found = [{"of_model": name} for name in names]
    for kind, owners in _owners(model).items():
        found += [{kind: key} for key, owner in owners.items() if owner is value]
    return found[0] if found else None


def _owners(model: FireModel) -> dict[str, dict]:
    """Return by their keys the objects whose state is stored, to which attributes may refer."""
    layers = dict(enumerate(getattr(model.control, "layers", ())))
    return {"process": model._processes, "layer": layers, "field": model._fields or {}}


def _referred(kind: str, which: Any, model: FireModel) -> object:
    """Return the object for which `_reference` returned this."""
    if kind == "of_model":
        if which not in declared(model, "_stored_apart") | {""}:
            raise RecordingError(f"{shortened(which)} is not a part of a model")
        return model.__dict__[which] if which else model
    return _owners(model)[kind][which]


def _restore_attributes(model: FireModel, facts: dict, packed: ModelPacked) -> None:
    attributes = facts["attributes"]
    _refuse(declared(model, "_stored_apart") & attributes.keys())
    for name in own_attributes(model).keys() - attributes.keys():
        del model.__dict__[name]
    for name, content in attributes.items():
        model.__dict__[name] = attribute_from_json(model.__dict__.get(name), name, content, packed)
    numbers = {name: kinds for base in type(model).__mro__ for name, kinds in vars(base).get("_numbers", {}).items()}
    for name, kinds in numbers.items():
        number: Any = getattr(model, name, None)
        if type(number) not in kinds or not 0 <= number < LARGEST_NUMBER:
            raise RecordingError(f"invalid {name}: {shortened(number)}")
    _restore_agents(model, dict(facts["of_things"]), packed)
    restore_removed(packed, facts.get("removed", []))


def _restore_agents(model: FireModel, stored: dict[int, dict], packed: ModelPacked) -> None:
    for agent in other_agents(model):
        for name in own_attributes_of_agent(agent).keys() - stored.get(agent.unique_id, {}).keys():
            delattr(agent, name)
    agents = {agent.unique_id: agent for agent in model.agents}
    for unique_id, values in stored.items():
        agent = agents[unique_id]
        _refuse(apart_of_agent(agent) & values.keys())
        for name, content in values.items():
            value = attribute_from_json(getattr(agent, name, None), name, content, packed)
            object.__setattr__(agent, name, value)


def removed_to_json(packed: ModelPacked) -> list:
    """Return what is stored of removed agents to which values refer, and of those to which these refer."""
    stored: list[list] = []
    removed = packed.removed or {}
    while len(stored) < len(removed):
        for unique_id in list(removed)[len(stored) :]:
            agent = removed[unique_id]
            what = f"removed {type(agent).__name__} {unique_id}'s "
            own = {n: attribute_to_json(v, what + n, packed) for n, v in own_attributes_of_agent(agent).items()}
            stored.append([unique_id, remains_to_json(agent), own])
    return stored


def make_removed(packed: ModelPacked, stored: list) -> None:
    """Make the handles of removed agents, without their attributes; those of the same kind that are known stay."""
    known = packed.removed or {}
    there = {agent.unique_id for agent in packed.model.agents}
    new = {unique_id: remains for unique_id, remains, _ in stored if unique_id not in known}
    if there & new.keys():
        raise RecordingError(f"agent {min(there & new.keys())} is stored as removed and as present")
    packed.removed = {**known, **{one: remains_from_json(packed.model, one, remains) for one, remains in new.items()}}


def restore_removed(packed: ModelPacked, stored: list) -> None:
    """Restore the attributes of removed agents."""
    for unique_id, _, values in stored:
        agent: Any = (packed.removed or {})[unique_id]
        _refuse(apart_of_agent(agent) & values.keys())
        for name, content in values.items():
            object.__setattr__(agent, name, attribute_from_json(None, name, content, packed))


def _refuse(names: frozenset[str]) -> None:
    if names:
        raise RecordingError(f"attribute {min(names)} is not part of a state")


def attribute_from_json(now: object, name: str, content: dict, packed: ModelPacked) -> object:
    """Return the attribute for which `attribute_to_json` returned this; what has a state of its own stays the same."""
    ((kind, value),) = content.items()
    if kind == "stream":
        return packed.model.streams[check_name("stream", value)]
    if kind == "generator":
        if not isinstance(now, np.random.Generator):
            raise RecordingError(f"{name} is not a random generator in this model")
        now.bit_generator.state = _checked_state(packed.unpack(value))
        return now
    if kind == "own":
        if not isinstance(now, Checkpointed):
            raise RecordingError(f"{name} has no checkpoint() and restore(state) in this model")
        now.restore(packed.unpack(value))
        return now
    if kind == "column":
        return packed.model.swarm.columns[value]
    if kind in REFERENCES:
        return _referred(kind, value, packed.model)
    return part_from_json(value) if kind == "part" else packed.unpack(value)


def apart_of_agent(agent: Agent) -> frozenset[str]:
    """Return the names of the attributes of an agent that are not stored as they are."""
    return declared(agent, "_stored_apart") | (OF_ARENA if isinstance(agent, ContinuousSpaceAgent) else OF_AGENTS)


def _agent_attributes(model: FireModel, packed: ModelPacked) -> list:
    """Return the attributes that users have added to robots and other agents, and all of agents of their own."""
    extra = []
    for agent in model.agents:
        own = own_attributes_of_agent(agent)
        if own:
            what = f"{type(agent).__name__} {agent.unique_id}'s "
            extra.append([agent.unique_id, {n: attribute_to_json(v, what + n, packed) for n, v in own.items()}])
    return extra


def own_attributes_of_agent(agent: Agent) -> dict[str, Any]:
    """Return the attributes of an agent that are stored as they are."""
    apart = apart_of_agent(agent)
    values = agent.__dict__ if isinstance(agent, ArenaAgent) else attributes_of(agent)
    return {name: value for name, value in values.items() if name not in apart}


def _randomness(model: FireModel, packed: Packed) -> dict:
    version, words, gauss = model.random.getstate()
    return {
        "streams": {name: packed.pack(state) for name, state in model.streams.state().items()},
        "rng": _generator(model.rng, "rng", packed),
        "random": [version, packed.pack(np.array(words, np.uint32)), gauss],
        "noise": packed.pack(model._noise),
    }


def _restore_randomness(model: FireModel, facts: dict, packed: Packed) -> None:
    for name, state in facts["streams"].items():
        model.streams[name].bit_generator.state = _checked_state(packed.unpack(state))
    model.rng.bit_generator.state = _checked_state(packed.unpack(facts["rng"]))
    version, content, gauss = facts["random"]
    words = packed.unpack(content)
    if not isinstance(words, np.ndarray) or words.shape != (WORDS,):
        raise RecordingError("invalid state of Python's random numbers")
    model.random.setstate((version, tuple(words.tolist()), gauss))
    noise = packed.unpack(facts["noise"])
    if noise is not None:
        _, before, draws = noise
        _checked_state(before)
        if not isinstance(draws, np.ndarray) or draws.dtype != float:
            raise RecordingError("invalid sensor noise")
    model._noise = noise


def _generator(generator: np.random.Generator, name: str, packed: Packed) -> object:
    state = generator.bit_generator.state
    if state["bit_generator"] not in GENERATORS:
        raise RecordingError(f"{name} is a {state['bit_generator']}, which cannot be stored; use PCG64")
    return packed.pack(state)


def _checked_state(state: object) -> dict:
    if not isinstance(state, dict) or state.get("bit_generator") not in GENERATORS:
        raise RecordingError("invalid state of a random stream")
    return state
