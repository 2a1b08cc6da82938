"""The state of a run, carried over to a model that was made with other parameters."""

from collections import deque
from collections.abc import Iterator, Mapping
from copy import copy, deepcopy
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from itertools import zip_longest
from typing import Any

import numpy as np
from mesa import Agent, Model
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.base.errors import InvalidValueError, RecordingError, error_line, shortened
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.control.state_machine import StateMachine
from mesa_swarm.control.team import Team
from mesa_swarm.kernels.part import Column, Part, list_attributes
from mesa_swarm.model.bodies_part import CHANGING
from mesa_swarm.model.control_part import ControlPart
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.mesa_model import add_reporters
from mesa_swarm.model.state import ATOMS, Checkpointed, add_to, attributes_of
from mesa_swarm.recording.attributes import (
    ModelPacker,
    attribute_from_json,
    attribute_to_json,
    own_attributes,
    own_attributes_of_agent,
)
from mesa_swarm.recording.collected_data import reporters_of, set_clock
from mesa_swarm.recording.devices import control_to_json
from mesa_swarm.recording.objects import objects_to_json, other_agents, restore_objects
from mesa_swarm.recording.removed_agents import make_removed, removed_to_json, restore_removed
from mesa_swarm.robots.imperfections import Imperfections
from mesa_swarm.robots.swarm import LASTING, Swarm
from mesa_swarm.world.arena import get_next_id, set_next_id
from mesa_swarm.world.bodies import BodyTable
from mesa_swarm.world.movers import Driven
from mesa_swarm.world.statics import FIRE, FIXED, KINDS

# Columns that follow from the parameters, unless the run has added or removed anything.
MADE = (("robots", "number"), ("robots", "design"))
# Settings of the model itself; those of a standing part are its `settings`.
SETTINGS = ("scale", "collect_every", "threads")
CONTROL = ("control", "arbiter")
# What else of a model may be referred to.
OF_MODEL = ("swarm", "space", "fires", "map", "rng", "random", "streams", "datacollector")
OURS = "mesa_swarm."
# Columns of bodies that follow from parameters, unless the run has changed them by hand.
BY_HAND = ("radius", "resistance", "temperature")
PERFECT = Imperfections()


def take_over(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Copy the state of a model to a `new` one that has taken no step yet.

    Values of `old` that differ from those in `fresh`, which is `old` before its first step, are state; the others
    follow from parameters. So do its robots and other objects, and what drives them: what was added, removed or
    replaced during the run is.
    """
    if _take_objects(new, old, fresh):
        for _, name in MADE:
            new.swarm.columns[name][:] = old.swarm.columns[name]
    set_clock(new, old.steps)
    new.parts.set_completed(old.completed)
    new.running = old.running if old.running != fresh.running else new.running
    _take_kinds(new, old)
    _take_bodies(new, old, fresh)
    _take_settings(new, old, fresh)
    _take_fields(new, old, fresh)
    _take_processes(new, old, fresh)
    _take_standing_parts(new, old, fresh)
    _take_randomness(new, old)
    carrier = _Carrier(new, old, fresh)
    _take_added_parts(new, old, fresh, carrier)
    _take_values(new, old, fresh, carrier)
    carrier.finish()
    new.events.replace({name: list(series) for name, series in old.events.series().items()})
    _take_collected(new, old, fresh)
    new.parts.bodies.changed()
    new.swarm.disturbed = old.swarm.disturbed


# ---- objects


def _take_objects(new: EngineModel, old: EngineModel, fresh: EngineModel) -> bool:
    """Add and remove what was added and removed during the run; return whether anything was.

    The change itself has to make the same objects as without it.
    """
    remade = _objects_of(new) != _objects_of(old)
    if remade:
        for name, ids in _objects_of(new).items():
            was = _objects_of(fresh)[name]
            if ids != was:
                raise InvalidValueError(
                    f"the change makes a world with {len(ids)} {name} instead of the {len(was)} recorded; "
                    "change only parameters that leave them as they are"
                )
        restore_objects(new, _changed_objects(*map(objects_to_json, (new, old, fresh))), from_file=False)
    set_next_id(new, max(get_next_id(new), get_next_id(old)))
    new.swarm.robots_created = max(new.swarm.robots_created, old.swarm.robots_created)
    return remade


def _objects_of(model: EngineModel) -> dict[str, list[int]]:
    """Return the unique_ids of all agents by kind."""
    kinds = {name: getattr(model, name) for name in ("robots", "fires", "obstacles", "loads", "bodies")}
    kinds["agents"] = other_agents(model)
    return {name: [agent.unique_id for agent in agents] for name, agents in kinds.items()}


def _changed_objects(new: dict, old: dict, fresh: dict) -> dict:
    """Return the stored objects of `old`, but with those designs and shapes of `new` that the run did not change."""
    designs = [_unless_changed(*designs) for designs in zip_longest(new["designs"], old["designs"], fresh["designs"])]
    mine, first = ({body["id"]: body for body in model["obstacles"]} for model in (new, fresh))
    bodies = [_merge_bodies(mine.get(body["id"], {}), body, first.get(body["id"], {})) for body in old["obstacles"]]
    kinds = [*dict.fromkeys(kind for model in (old, new) for kind in model.get("kinds", KINDS))]
    return {**old, "designs": designs[: len(old["designs"])], "obstacles": bodies, "kinds": kinds}


def _merge_bodies(new: dict, old: dict, fresh: dict) -> dict:
    return {name: _unless_changed(new.get(name), value, fresh.get(name)) for name, value in old.items()}


def _unless_changed(new: Any, old: Any, fresh: Any) -> Any:
    """Return the value that follows from the new parameters, unless the run has changed it since its beginning."""
    return new if old == fresh and new is not None else old


def _take_kinds(new: EngineModel, old: EngineModel) -> None:
    """Let readings and contacts have the codes of the run's kinds, to which the new model may add."""
    new.parts.bodies.table.set_kinds((*old.kinds, *(name for name in new.kinds if name not in old.kinds)))


def _take_bodies(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Put bodies where they are, and agents of other classes as well."""
    mine, table = new.parts.bodies.table, old.parts.bodies.table
    first_ids = {body.unique_id for body in fresh.parts.bodies.table.agents}
    is_added = np.array([body.unique_id not in first_ids for body in table.agents], bool)
    moving, burns = (table.mode != FIXED) | is_added, table.kind == FIRE
    for name in CHANGING:
        if name in BY_HAND:
            rows = _changed_by_hand(name, table, fresh.parts.bodies.table) | (burns & (name == "temperature"))
        else:
            rows = moving
        getattr(mine, name)[rows] = getattr(table, name)[rows]
    mine.mode[moving] = table.mode[moving]
    for body, was in zip(mine.agents, table.agents, strict=True):
        if isinstance(body, Driven):
            body.carrier = None if was.carrier is None else new.swarm.agents[was.carrier.row]
    for agent, was in zip(other_agents(new), other_agents(old), strict=True):
        if isinstance(agent, ContinuousSpaceAgent):
            agent.position = was.position
    new.parts.bodies.changed()


def _changed_by_hand(name: str, table: BodyTable, first: BodyTable) -> np.ndarray:
    """Return which bodies have another value in a column than they began with; those that were added later have."""
    at_start = {body.unique_id: getattr(first, name)[body.row].tobytes() for body in first.agents}
    column = getattr(table, name)
    return np.array([column[body.row].tobytes() != at_start.get(body.unique_id) for body in table.agents], bool)


# ---- settings and control


def changed_settings(model: EngineModel, other: EngineModel) -> list[tuple[str, str]]:
    """Return the settings in which two models of the same class differ, by the name of the part, "" for the model."""
    mine, others = _settings(model), _settings(other)
    return [key for key, value in mine.items() if _comparable(key, value) != _comparable(key, others[key])]


def _settings(model: EngineModel) -> dict[tuple[str, str], Any]:
    of_parts = {
        (part.name, name): part.store()[name]
        for part in model.parts.standing()
        for name in getattr(part, "settings", ())
    }
    return {("", name): getattr(model, name) for name in SETTINGS} | of_parts


def _comparable(key: tuple[str, str], value: Any) -> Any:
    """Return what is equal for equal settings: what an arbiter is made of, None for what `Robot.fail` sets."""
    if key != CONTROL:
        return None if value == PERFECT else value
    layers = getattr(value, "layers", ())
    rules = [layer.rule.function.__code__ if isinstance(layer, Behaviour) else None for layer in layers]
    return type(value), control_to_json(value), [type(layer) for layer in layers], rules


def _take_settings(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    by_hand = [key for key in changed_settings(old, fresh) if key not in changed_settings(new, fresh)]
    values = _settings(old)
    for part, name in by_hand:
        if part:
            new.parts[part].restore({name: values[part, name]})
        else:
            setattr(new, name, values[part, name])
    if CONTROL in by_hand:
        _keep_fields(new.control, old.control)
    imperfections, effect = old.parts.imperfections.store(), new.parts.imperfections.effect
    if effect is None and imperfections["imperfections"] != PERFECT and not imperfections["failing"]:
        imperfections["key"] = None  # robots are ideal by the new parameters
    new.parts.imperfections.restore({"failing": imperfections["failing"], "key": imperfections["key"]})
    for name, declaration in old.swarm.memory_columns.items():
        if not name[:1].isdigit() and not name.startswith(LASTING):  # of no layer, arbiter or imperfection
            new.swarm.remember(name, *declaration)


def _keep_fields(control: Any, old: Any) -> None:
    """Let learners, which begin anew where they are bound, have their former fields; their columns follow."""
    for layer, was in zip(getattr(control, "layers", ()), getattr(old, "layers", ()), strict=True):
        if is_dataclass(layer) and type(layer).__module__.startswith(OURS):
            for field in fields(layer):
                if getattr(layer, field.name) is not getattr(was, field.name):
                    object.__setattr__(layer, field.name, getattr(was, field.name))


# ---- parts


def _take_standing_parts(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Copy the columns of each part, and what else is the run's of robots, machines and fires."""
    by_label = _by_label(new, old)
    for part in new.parts.standing():
        if part is not new.parts.bodies:  # whose poses are taken over with them
            _take_columns(part, old.parts[part.name], by_label)
        part.bind(new.parts.context())
    robots = old.parts.robots
    new.parts.robots.restore({n: value for n, value in robots.store().items() if n not in robots.settings})
    new.swarm.groups = (*old.swarm.groups, *(name for name in new.swarm.groups if name not in old.swarm.groups))
    new.swarm.regrouped += 1
    _take_speeds(new, old)
    _take_states(new, old, by_label)
    _take_fires(new, old, fresh)


def _take_columns(part: Part, was: Part, by_label: bool = True, *, all_of_them: bool = False) -> None:
    """Copy the columns that are not parameters, of which those of another shape are left out, or refused."""
    columns = _columns(part, by_label)
    for name, (array, _, role, _) in _columns(was, by_label).items():
        shape = columns[name].array.shape if name in columns else None
        if role == "parameter" or (part.name, name) in MADE:
            continue
        if shape == array.shape:
            columns[name].array[...] = array
        elif all_of_them:
            raise InvalidValueError(
                f"the change makes part {part.name} with column {name} of shape {shape} instead of {array.shape}; "
                "change only parameters that leave it"
            )


def _columns(part: Part, by_label: bool) -> Mapping[str, Column]:
    return part.columns(by_label) if isinstance(part, ControlPart) else part.columns()


def _take_speeds(new: EngineModel, old: EngineModel) -> None:
    """Keep limits of speed that the run has set, as far as the designs permit them."""
    limit, was = new.swarm.columns["max_speed"], old.swarm.columns["max_speed"]
    mine, others = (np.array([robot.design.max_speed for robot in model.swarm.agents]) for model in (new, old))
    limit[:] = np.where(was != others, np.minimum(was, mine), limit)


def _take_states(new: EngineModel, old: EngineModel, by_label: bool) -> None:
    """Give states of machines, which were copied as numbers, the numbers that they have by name in the new machines."""
    others = _arbiters(old, by_label)
    for key, machine in _arbiters(new, by_label).items():
        was = others.get(key)
        if isinstance(machine, StateMachine) and isinstance(was, StateMachine):
            now, fired = (new.swarm.columns[name] for name in machine.noted)
            now[:] = _renumber_states(now, was.state_names, machine.state_names)
            if machine.transitions != was.transitions:
                fired.fill(-1)


def _renumber_states(now: np.ndarray, before: tuple[str, ...], after: tuple[str, ...]) -> np.ndarray:
    """Return the states, given as indices of names, as indices of other names."""
    lacking = [before[number] for number in np.unique(now).tolist() if before[number] not in after]
    if lacking:
        raise InvalidValueError(
            f"the change makes a machine without the state {shortened(lacking[0])}, in which there are robots; change "
            "only parameters that leave it"
        )
    return np.array([after.index(name) if name in after else -1 for name in before], np.int64)[now]


def _arbiters(model: EngineModel, by_label: bool) -> dict[tuple, Arbiter]:
    keys = [key for key in model.parts.control.prefixes(by_label) if not key[1]]
    return dict(zip(keys, (arbiter for _, arbiter in model.parts.control.labelled_arbiters()), strict=True))


def _layers(model: EngineModel, by_label: bool) -> dict[tuple, Any]:
    keys = [key for key in model.parts.control.prefixes(by_label) if key[1]]
    return dict(zip(keys, getattr(model.control, "layers", ()), strict=True))


def _by_label(new: EngineModel, old: EngineModel) -> bool:
    """Return whether arbiters are the same if their labels are; else all layers are of one."""
    return isinstance(new.control, Team) and isinstance(old.control, Team)


def _take_fires(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Have fires that were added where they are, and the history, of which the interval may follow the parameters."""
    first = {fire.unique_id for fire in fresh.fires}
    added_rows = [row for row, fire in enumerate(old.fires.agents) if fire.unique_id not in first]
    for name, column in old.fires.own.items():
        new.fires.own[name][added_rows] = column[added_rows]
    every = old if old.fires.history.every != fresh.fires.history.every else new
    interval = every.fires.history.every
    new.fires.history = deepcopy(old.fires.history)
    new.fires.history.every = interval


def _take_fields(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Remove and add the fields that the run did, in its order; their values follow where the grid is the same."""
    for name in [name for name in fresh.fields if name in new.fields and name not in old.fields]:
        new.remove_field(name)
    for name, field in old.fields.items():
        if name not in fresh.fields and name not in new.fields:
            new.add_field(field.declaration)
        if name in new.fields and new.fields[name].values.shape == field.values.shape:
            new.fields[name].peak = field.peak
    live = new.parts.fields.live
    order = dict.fromkeys([*(name for name in old.fields if name in live), *live])
    new.parts.fields.live = {name: live[name] for name in order}


def _take_randomness(new: EngineModel, old: EngineModel) -> None:
    for name, state in old.streams.state().items():
        new.streams[name].bit_generator.state = state
    new.rng.bit_generator.state = old.rng.bit_generator.state
    new.random.setstate(old.random.getstate())


# ---- attributes, declared state, processes, layers, agents


def _take_values(new: EngineModel, old: EngineModel, fresh: EngineModel, carrier: "_Carrier") -> None:
    """Copy what the run has changed in attributes, the declared state, processes, custom layers and other agents."""
    for mine, values, first in _owners_of_values(new, old, fresh, carrier):
        for name in first.keys() - values.keys():
            mine.pop(name, None)
        for name, value in values.items():
            if name not in first or _differ(value, first[name]):
                mine[name] = carrier.carry(name, value, mine.get(name))


def _take_processes(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Add and remove the processes that the run did; the attributes of those that are added follow."""
    mine, others, first = (model.parts.processes.numbered for model in (new, old, fresh))
    for number in others.keys() - first.keys() - mine.keys():
        kind: Any = type(others[number])
        mine = {**mine, number: kind.__new__(kind)}
    if mine.keys() < others.keys():
        raise InvalidValueError("the change makes a model with fewer processes; change parameters that leave them")
    new.parts.processes.have({number: mine[number] for number in others})


def _take_added_parts(new: EngineModel, old: EngineModel, fresh: EngineModel, carrier: "_Carrier") -> None:
    """Add and remove the parts that the run did, and give each the state of the run: columns and what it stores."""
    for part in new.parts.added():
        if part.name not in old.parts and part.name in fresh.parts:
            new.remove_part(part.name)
    for was in old.parts.added():
        if was.name not in new.parts:
            kind: Any = type(was)
            part = kind.__new__(kind)
            for name, value in list_attributes(was).items():
                object.__setattr__(part, name, carrier.carry(name, value, None))
            carrier.memo[id(was)] = new.add_part(part)
        _take_part(new.parts[was.name], was, fresh.parts.get(was.name), carrier)


def _take_part(part: Part, was: Part, first: Part | None, carrier: "_Carrier") -> None:
    now, before = part.store(), {} if first is None else first.store()
    changes = {n: v for n, v in was.store().items() if n not in before or _differ(v, before[n])}
    part.restore({name: carrier.carry(name, value, now.get(name)) for name, value in changes.items()})
    _take_columns(part, was, all_of_them=True)


class _Carrier:
    """Values of one model as values of another: with its agents, columns, streams and parts in their places."""

    def __init__(self, new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
        self._there = ModelPacker(old)
        self._here, self._there.removed_agents = ModelPacker(new, self._there.arrays), {}
        self._here.present = None
        by_label = _by_label(new, old)
        self.new, self.old, self.fresh = (_by_place(model, by_label) for model in (new, old, fresh))
        # What stands in the new model for what is in the old one, by its identity, as `deepcopy` asks.
        self.memo = {
            id(value): self.new[kind][key]
            for kind, values in self.old.items()
            for key, value in values.items()
            if key in self.new[kind]
        }

    def carry(self, name: str, value: Any, now: Any) -> Any:
        """Return a value of the old model as one of the new one; of what cannot be stored a copy."""
        try:
            content = attribute_to_json(value, name, self._there)
        except RecordingError:
            return self._copy(name, value)
        if "column" in content:  # type: ignore[operator]
            if id(value) not in self.memo:
                column = shortened(content["column"])  # type: ignore[index]
                raise InvalidValueError(f"the change makes a model without the column {column}, which is in use")
            return self.memo[id(value)]
        make_removed(self._here, removed_to_json(self._there))
        return attribute_from_json(now, name, content, self._here)  # type: ignore[arg-type]

    def finish(self) -> None:
        """Restore the attributes of agents that were removed."""
        restore_removed(self._here, removed_to_json(self._there))

    def _copy(self, name: str, value: Any) -> Any:
        try:
            return deepcopy(value, self.memo)
        except Exception as error:  # an object of a user's may raise anything
            raise InvalidValueError(
                f"{name} cannot be copied to the model that goes on: {error_line(error)}; give its class "
                "checkpoint() and restore(state)"
            ) from None


def _by_place(model: EngineModel, by_label: bool) -> dict[str, dict[Any, Any]]:
    """Return what has a counterpart in another model, by its kind and by what is the same there."""
    columns = {part.name: _columns(part, by_label) for part in model.parts.values()}
    return {
        "model": {"": model, **{name: getattr(model, name) for name in OF_MODEL}},
        "part": dict(model.parts),
        "stream": dict(model.streams.items()),
        "column": {(part, name): one.array for part, named in columns.items() for name, one in named.items()},
        "field": dict(model.fields),
        "process": model.parts.processes.numbered,
        "arbiter": _arbiters(model, by_label),
        "layer": _layers(model, by_label),
        "agent": {agent.unique_id: agent for agent in model.agents},
    }


def _owners_of_values(
    new: EngineModel, old: EngineModel, fresh: EngineModel, carrier: "_Carrier"
) -> Iterator[tuple[Any, dict, dict]]:
    """Iterate over what has values: where those of the new model are, those of the old one, and the first ones.

    What stores itself takes over at once.
    """
    yield new.__dict__, own_attributes(old), own_attributes(fresh)
    yield new.state, dict(old.state), dict(fresh.state)
    owner: Any
    for kind in ("process", "layer", "agent"):
        for key, was in carrier.old[kind].items():
            owner, first = carrier.new[kind].get(key), carrier.fresh[kind].get(key)
            is_whole = kind != "agent" and isinstance(owner, Checkpointed)
            is_ours = kind == "layer" and type(owner).__module__.startswith(OURS)
            is_bare = kind == "process" and first is None  # made without its constructor
            if owner is not None and not is_ours and (is_bare or not is_whole):
                yield _Attributes(owner), _values_of(was), _values_of(first)
            if is_whole and type(owner) is type(was):
                owner.restore(deepcopy(was.checkpoint()))


def _values_of(owner: Any) -> dict[str, Any]:
    return own_attributes_of_agent(owner) if isinstance(owner, Agent) else {} if owner is None else attributes_of(owner)


class _Attributes:
    """The attributes of an object, written like the values of a dict."""

    def __init__(self, owner: object) -> None:
        self.owner = owner

    def get(self, name: str) -> Any:
        return getattr(self.owner, name, None)

    def pop(self, name: str, default: None) -> None:
        self.owner.__dict__.pop(name, default)

    def __setitem__(self, name: str, value: Any) -> None:
        object.__setattr__(self.owner, name, value)


def _differ(first: Any, second: Any) -> bool:
    """Return whether two values differ, objects of any class by all their attributes."""
    return first is not second and _deep_digest(first) != _deep_digest(second)


def _deep_digest(value: Any) -> bytes:
    digest = blake2b(digest_size=16)
    _add_deeply(digest, value, set())
    return digest.digest()


def _add_deeply(digest: Any, value: Any, entered: set[int]) -> None:
    """Add a value to a digest, and the attributes of objects of any class, each once; of agents the unique_id."""
    kind = type(value)
    if kind in ATOMS or isinstance(value, (np.ndarray, np.generic, Agent, np.random.Generator)):
        add_to(digest, value)
        return
    if id(value) in entered or isinstance(value, (Model, Swarm, type)):
        digest.update(f"{kind.__name__};".encode())
        return
    entered.add(id(value))
    if isinstance(value, Mapping):
        parts: list[Any] = [part for pair in value.items() for part in pair]
    elif isinstance(value, (list, tuple, deque)):
        parts = list(value)
    elif isinstance(value, (set, frozenset)):
        parts = sorted(value, key=repr)
    else:
        parts = [part for pair in sorted(attributes_of(value).items()) for part in pair]
    digest.update(f"{kind.__qualname__} {len(parts)};".encode())
    for part in parts:
        _add_deeply(digest, part, entered)


# ---- collected data


def _take_collected(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Copy collected data; a reporter that is new with the parameters has no values in the rows before."""
    mine, others = new.datacollector, old.datacollector
    if type(others) is not type(fresh.datacollector) or others.tables.keys() != mine.tables.keys():
        new.datacollector = mine = copy(others)  # replaced by hand
        mine.model_vars = {name: list(values) for name, values in others.model_vars.items()}
        mine._agent_records = dict(others._agent_records)
        return
    by_hand = others.model_reporters.keys() - fresh.datacollector.model_reporters.keys()
    add_reporters(mine, {name: reporter for name, reporter in others.model_reporters.items() if name in by_hand})
    rows = max(map(len, others.model_vars.values()), default=0)
    for name, values in mine.model_vars.items():
        values[:] = others.model_vars.get(name, [None] * rows)
    for name, columns in mine.tables.items():
        for column, values in columns.items():
            values[:] = others.tables[name].get(column, values)
    mine._agent_records = dict(others._agent_records)
    mine._agenttype_records = dict(others._agenttype_records)
    reporters = reporters_of(old)
    for name, reporter in reporters_of(new).items():
        if name in reporters:
            reporter.restore(reporters[name].checkpoint())
