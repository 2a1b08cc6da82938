"""The state of a run, carried over to a model that was made with other parameters."""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from copy import copy, deepcopy
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from itertools import zip_longest
from typing import Any

import numpy as np
from mesa import Agent, Model
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.control.state_machine import StateMachine
from mesa_swarm.control.team import Team
from mesa_swarm.errors import InvalidValueError, RecordingError, in_words, shortened
from mesa_swarm.kernels.part import Part, made_of
from mesa_swarm.model.bodies import CHANGING
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.mesa_model import add_reporters
from mesa_swarm.model.state import ATOMS, Checkpointed, add_to, attributes_of
from mesa_swarm.recording.attributes import (
    ModelPacked,
    attribute_from_json,
    attribute_to_json,
    own_attributes,
    own_attributes_of_agent,
)
from mesa_swarm.recording.collected import reporters_of, set_clock
from mesa_swarm.recording.devices import control_to_json
from mesa_swarm.recording.objects import objects_to_json, other_agents, restore_objects
from mesa_swarm.recording.removed import make_removed, removed_to_json, restore_removed
from mesa_swarm.robots.imperfections import Imperfections
from mesa_swarm.robots.swarm import FAILED_SENSORS, LASTING, Swarm
from mesa_swarm.world.arena import next_id, set_next_id
from mesa_swarm.world.bodies import FIXED, BodyTable
from mesa_swarm.world.movers import Driven
from mesa_swarm.world.statics import FIRE

# Columns that follow from parameters; all others are the state of the run.
OF_PARAMETERS = frozenset({"number", "design", "radius", "max_speed"})
# Those of them that are the run's where it has added or removed robots.
MADE = frozenset({"number", "design"})
# Settings that may be changed by hand between steps: such a change is kept, unless the parameters change it as well.
SETTINGS = (
    *("communication", "imperfections", "fire_constants", "extinguish_range", "scale", "collect_every", "threads"),
)
# Parts of a model to which its attributes may refer.
PARTS = ("swarm", "space", "fires", "map", "rng", "random", "streams", "datacollector")
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
    remade = _take_objects(new, old, fresh)
    set_clock(new, old.steps)
    new.parts.set_completed(old.completed)
    new.running = old.running if old.running != fresh.running else new.running
    new.collisions, new.total_collisions = old.collisions, old.total_collisions
    _take_kinds(new, old)
    _take_bodies(new, old, fresh)
    _take_settings(new, old, fresh)
    _take_columns(new, old, OF_PARAMETERS - MADE if remade else OF_PARAMETERS)
    _take_fires(new, old, fresh)
    _take_fields(new, old, fresh)
    _take_randomness(new, old)
    _take_values(new, old, fresh)
    _take_added_parts(new, old, fresh)
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
    set_next_id(new, max(next_id(new), next_id(old)))
    new.swarm.robots_created = max(new.swarm.robots_created, old.swarm.robots_created)
    return remade


def _objects_of(model: EngineModel) -> dict[str, list[int]]:
    """Return the unique_ids of all agents by kind."""
    kinds = {name: getattr(model, name) for name in ("robots", "fires", "obstacles", "loads", "bodies")}
    kinds["agents"] = other_agents(model)
    return {name: [agent.unique_id for agent in agents] for name, agents in kinds.items()}


def _changed_objects(new: dict, old: dict, fresh: dict) -> dict:
    """Return the stored objects of `old`, but with those designs and shapes of `new` that the run did not change."""
    designs = [_unless_changed(*three) for three in zip_longest(new["designs"], old["designs"], fresh["designs"])]
    mine, first = ({body["id"]: body for body in model["obstacles"]} for model in (new, fresh))
    bodies = [_merged(mine.get(body["id"], {}), body, first.get(body["id"], {})) for body in old["obstacles"]]
    return {**old, "designs": designs[: len(old["designs"])], "obstacles": bodies}


def _merged(new: dict, old: dict, fresh: dict) -> dict:
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
    moving, burns = table.mode != FIXED, table.kind == FIRE
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
    begun = {body.unique_id: getattr(first, name)[body.row].tobytes() for body in first.agents}
    column = getattr(table, name)
    return np.array([column[body.row].tobytes() != begun.get(body.unique_id) for body in table.agents], bool)


# ---- settings and control


def changed_settings(model: EngineModel, other: EngineModel) -> list[str]:
    """Return the settings in which two models of the same class differ, `control` among them."""
    names = [name for name in SETTINGS if _setting(model, name) != _setting(other, name)]
    return names if _same_control(model.control, other.control) else [*names, "control"]


def _setting(model: EngineModel, name: str) -> Any:
    """Return a setting; imperfections that change nothing, as `Robot.fail` sets them, count as None."""
    value = getattr(model, name)
    return None if value == PERFECT else value


def _take_settings(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    by_parameters = changed_settings(new, fresh)
    by_hand = [name for name in changed_settings(old, fresh) if name not in by_parameters]
    for name in by_hand:
        if name != "control":
            setattr(new, name, getattr(old, name))
    if (
        old.parts.imperfections.effect is not None
        and new.parts.imperfections.effect is None
        and old.imperfections == PERFECT
    ):
        new.imperfections = PERFECT
    if FAILED_SENSORS in old.swarm.columns:
        new.parts.imperfections.prepare_failures()
    if new.parts.imperfections.effect is not None and old.parts.imperfections.effect is not None:
        new.parts.imperfections.effect.key = old.parts.imperfections.effect.key
    if "control" in by_hand:
        new.control = old.control
        _keep_fields(new.control, old.control)


def _same_control(one: Arbiter | None, other: Arbiter | None) -> bool:
    """Return whether two controls are made of the same arbiters, layers and rules."""
    if type(one) is not type(other) or control_to_json(one) != control_to_json(other):
        return False
    pairs = zip(getattr(one, "layers", ()), getattr(other, "layers", ()), strict=True)
    return all(type(layer) is type(same) and _same_rule(layer, same) for layer, same in pairs)


def _same_rule(layer: Any, other: Any) -> bool:
    return not isinstance(layer, Behaviour) or layer.rule.function.__code__ == other.rule.function.__code__


def _keep_fields(control: Any, old: Any) -> None:
    """Let learners, which begin anew where they are bound, have their former fields; their columns follow."""
    for layer, was in zip(getattr(control, "layers", ()), getattr(old, "layers", ()), strict=True):
        if is_dataclass(layer) and type(layer).__module__.startswith(OURS):
            for field in fields(layer):
                if getattr(layer, field.name) is not getattr(was, field.name):
                    object.__setattr__(layer, field.name, getattr(was, field.name))


# ---- columns


def _take_columns(new: EngineModel, old: EngineModel, of_parameters: frozenset[str]) -> None:
    renamed = _renamed_columns(new, old)
    for name, declared in old.swarm.memory_columns.items():
        if not name[:1].isdigit() and not name.startswith(LASTING):  # of no layer, arbiter or imperfection
            new.swarm.remember(name, *declared)
    for name, column in new.swarm.columns.items():
        source = old.swarm.columns.get(renamed(name))
        if name not in of_parameters and source is not None and source.shape == column.shape:
            column[...] = source
    _take_speeds(new, old)
    _take_states(new, old)
    new.swarm.groups = (*old.swarm.groups, *(name for name in new.swarm.groups if name not in old.swarm.groups))
    new.swarm.regrouped += 1


def _take_speeds(new: EngineModel, old: EngineModel) -> None:
    """Keep limits of speed that the run has set, as far as the designs permit them."""
    limit, was = new.swarm.columns["max_speed"], old.swarm.columns["max_speed"]
    mine, others = (np.array([robot.design.max_speed for robot in model.swarm.agents]) for model in (new, old))
    limit[:] = np.where(was != others, np.minimum(was, mine), limit)


def _take_states(new: EngineModel, old: EngineModel) -> None:
    """Give states of machines, which were copied as numbers, the numbers that they have by name in the new machines."""
    others = dict(_machines(old, _by_label(new, old)))
    for key, machine in _machines(new, _by_label(new, old)):
        if key in others:
            now, fired = (new.swarm.columns[name] for name in machine.noted)
            now[:] = _numbered(now, others[key].state_names, machine.state_names)
            if machine.transitions != others[key].transitions:
                fired.fill(-1)


def _numbered(now: np.ndarray, before: tuple[str, ...], after: tuple[str, ...]) -> np.ndarray:
    """Return the states, given as indices of names, as indices of other names."""
    gone = [before[number] for number in np.unique(now).tolist() if before[number] not in after]
    if gone:
        raise InvalidValueError(
            f"the change makes a machine without the state {shortened(gone[0])}, in which there are robots; change "
            "only parameters that leave it"
        )
    return np.array([after.index(name) if name in after else -1 for name in before], np.int64)[now]


def _machines(model: EngineModel, by_label: bool) -> Iterator[tuple[tuple[str, int], StateMachine]]:
    """Iterate over the state machines of a control, by their label and their place among those of the label."""
    count = Counter[str]()
    for label, arbiter in model.parts.control.labelled_arbiters():
        key = label if by_label else ""
        if isinstance(arbiter, StateMachine):
            yield (key, count[key]), arbiter
        count[key] += 1


def _renamed_columns(new: EngineModel, old: EngineModel) -> Callable[[str], str]:
    """Return a function of a column's name in one model that returns its name in the other, "" if it has none."""
    mine, others = (model.parts.control.prefixes(_by_label(new, old)) for model in (new, old))
    own = {prefix: key for key, prefix in mine.items()}
    longest_first = sorted(own, key=len, reverse=True)

    def renamed(name: str) -> str:
        if not name[:1].isdigit():
            return name
        prefix = next((prefix for prefix in longest_first if name.startswith(f"{prefix}.")), "")
        return others[own[prefix]] + name.removeprefix(prefix) if own.get(prefix) in others else ""

    return renamed


def _by_label(new: EngineModel, old: EngineModel) -> bool:
    """Return whether arbiters are the same if their labels are; else all layers are of one."""
    return isinstance(new.control, Team) and isinstance(old.control, Team)


def _matching_layers(new: EngineModel, old: EngineModel) -> Iterator[tuple[Any, Any]]:
    """Iterate over the layers of one model with those of another that are the same: of the same prefix's key."""
    mine, others = (model.parts.control.prefixes(_by_label(new, old)) for model in (new, old))
    for key, prefix in mine.items():
        if key in others and key[1]:
            places = (int(name.partition(".")[0]) for name in (prefix, others[key]))
            index, other = places
            yield new.control.layers[index], old.control.layers[other]  # type: ignore[union-attr]


# ---- fires, fields, random streams


def _take_fires(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    first = {fire.unique_id for fire in fresh.fires}
    added = [row for row, fire in enumerate(old.fires.agents) if fire.unique_id not in first]
    for name, column in old.fires.own.items():
        rows = added if name == "area" else slice(None)
        new.fires.own[name][rows] = column[rows]
    every = old if old.fires.history.every != fresh.fires.history.every else new
    interval = every.fires.history.every
    new.fires.history = deepcopy(old.fires.history)
    new.fires.history.every = interval


def _take_fields(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Remove and add the fields that the run did, and copy the values of those of the same name and grid."""
    for name in [name for name in fresh.fields if name in new.fields and name not in old.fields]:
        new.remove_field(name)
    for name, field in old.fields.items():
        if name not in fresh.fields and name not in new.fields:
            new.add_field(field.declared)
    for name, field in new.fields.items():
        if name in old.fields and old.fields[name].values.shape == field.values.shape:
            field.restore(old.fields[name].checkpoint())
    if new.parts.fields.live:
        order = [*(name for name in old.fields if name in new.parts.fields.live), *new.parts.fields.live]
        new.parts.fields.live = {name: new.parts.fields.live[name] for name in order}


def _take_randomness(new: EngineModel, old: EngineModel) -> None:
    for name, state in old.streams.state().items():
        new.streams[name].bit_generator.state = state
    new.rng.bit_generator.state = old.rng.bit_generator.state
    new.random.setstate(old.random.getstate())
    new.parts.robots.noise = old.parts.robots.noise  # this step's sensor errors, which may have been drawn already


# ---- attributes, declared state, processes, layers, agents


def _take_values(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Copy what the run has changed in attributes, the declared state, processes, custom layers and other agents."""
    _take_processes(new, old, fresh)
    carrier = _Carrier(new, old)
    for mine, values, first in _owners_of_values(new, old, fresh):
        for name in first.keys() - values.keys():
            mine.pop(name, None)
        for name, value in values.items():
            if name not in first or _differ(value, first[name]):
                mine[name] = carrier.carried(name, value, mine.get(name))
    carrier.finish()
    for owner, was in _checkpointed(new, old):
        owner.restore(deepcopy(was.checkpoint()))
    new.events.replace({name: list(series) for name, series in old.events.series().items()})


def _take_processes(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Add and remove the processes that the run did; the attributes of those that are added follow."""
    mine, others, first = (model.parts.processes.numbered for model in (new, old, fresh))
    for number in others.keys() - first.keys() - mine.keys():
        kind: Any = type(others[number])
        mine = {**mine, number: kind.__new__(kind)}
    if mine.keys() < others.keys():
        raise InvalidValueError("the change makes a model with fewer processes; change parameters that leave them")
    new.parts.processes.have({number: mine[number] for number in others})


def _take_added_parts(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Add and remove the parts that the run did, and give each the state of the run: columns and what it stores."""
    for part in new.parts.added():
        if part.name not in old.parts and part.name in fresh.parts:
            new.remove_part(part.name)
    carrier = _Carrier(new, old)
    for was in old.parts.added():
        if was.name not in new.parts:
            kind: Any = type(was)
            part = kind.__new__(kind)
            for name, value in made_of(was).items():
                object.__setattr__(part, name, carrier.carried(name, value, None))
            new.add_part(part)
        _take_part(new.parts[was.name], was, fresh.parts.get(was.name), carrier)
    carrier.finish()


def _take_part(part: Part, was: Part, first: Part | None, carrier: "_Carrier") -> None:
    now, before = part.store(), {} if first is None else first.store()
    changed = {n: v for n, v in was.store().items() if n not in before or _differ(v, before[n])}
    part.restore({name: carrier.carried(name, value, now.get(name)) for name, value in changed.items()})
    columns = part.columns()
    for name, (array, _, role, _) in was.columns().items():
        if role == "parameter":
            continue
        shape = columns[name].array.shape if name in columns else None
        if shape != array.shape:
            raise InvalidValueError(
                f"the change makes part {part.name} with column {name} of shape {shape} instead of {array.shape}; "
                "change only parameters that leave it"
            )
        columns[name].array[...] = array


class _Carrier:
    """Values of one model as values of another: with its agents, columns, streams and parts in their places."""

    def __init__(self, new: EngineModel, old: EngineModel) -> None:
        self._new, self._old = new, old
        self._there = ModelPacked(old)
        self._here, self._there.removed = ModelPacked(new, self._there.arrays), {}
        self._here.present = None
        renamed = _renamed_columns(old, new)
        self._columns = {name: renamed(name) for name in old.swarm.columns}
        self._memo: dict[int, Any] | None = None

    def carried(self, name: str, value: Any, now: Any) -> Any:
        """Return a value of the old model as one of the new one; of what cannot be stored a copy."""
        try:
            content = attribute_to_json(value, name, self._there)
        except RecordingError:
            return self._copied(name, value)
        if "column" in content:  # type: ignore[operator]
            return self._column(content["column"])  # type: ignore[index]
        make_removed(self._here, removed_to_json(self._there))
        return attribute_from_json(now, name, content, self._here)  # type: ignore[arg-type]

    def finish(self) -> None:
        """Restore the attributes of agents that were removed."""
        restore_removed(self._here, removed_to_json(self._there))

    def _column(self, name: str) -> np.ndarray:
        if self._columns.get(name) not in self._new.swarm.columns:
            raise InvalidValueError(f"the change makes a model without the column {shortened(name)}, which is in use")
        return self._new.swarm.columns[self._columns[name]]

    def _copied(self, name: str, value: Any) -> Any:
        if self._memo is None:
            self._memo = self._counterparts()
        try:
            return deepcopy(value, self._memo)
        except Exception as error:  # an object of a user's may raise anything
            raise InvalidValueError(
                f"{name} cannot be copied to the model that goes on: {in_words(error)}; give its class "
                "checkpoint() and restore(state)"
            ) from None

    def _counterparts(self) -> dict[int, Any]:
        """Return what stands in the new model for the parts of the old one, by their identity, as `deepcopy` asks."""
        new, old = self._new, self._old
        pairs: list[tuple[Any, Any]] = [(old, new)]
        pairs += [(getattr(old, name), getattr(new, name)) for name in PARTS]
        pairs += [(stream, new.streams[name]) for name, stream in old.streams.items()]
        pairs += [(old.swarm.columns[name], column) for name, column in self._same_columns()]
        mine = {agent.unique_id: agent for agent in new.agents}
        pairs += [(agent, mine[agent.unique_id]) for agent in old.agents if agent.unique_id in mine]
        pairs += [
            (process, new.parts.processes.numbered[number]) for number, process in old.parts.processes.numbered.items()
        ]
        pairs += [(was, layer) for layer, was in _matching_layers(new, old)]
        pairs += [(field, new.fields[name]) for name, field in old.fields.items() if name in new.fields]
        return {id(there): here for there, here in pairs}

    def _same_columns(self) -> Iterator[tuple[str, np.ndarray]]:
        """Iterate over the names of columns of the old model, each with the column that it is in the new one."""
        columns = self._new.swarm.columns
        yield from ((name, columns[other]) for name, other in self._columns.items() if other in columns)


def _owners_of_values(new: EngineModel, old: EngineModel, fresh: EngineModel) -> Iterator[tuple[Any, dict, dict]]:
    """Iterate over what has values: where those of the new model are, those of the old one, and the first ones."""
    yield new.__dict__, own_attributes(old), own_attributes(fresh)
    yield new.state, dict(old.state), dict(fresh.state)
    for number, process in new.parts.processes.numbered.items():
        if not isinstance(process, Checkpointed):
            before = (
                attributes_of(fresh.parts.processes.numbered[number])
                if number in fresh.parts.processes.numbered
                else {}
            )
            yield _Attributes(process), attributes_of(old.parts.processes.numbered[number]), before
    firsts = {id(layer): first for layer, first in _matching_layers(new, fresh)}
    for layer, was in _matching_layers(new, old):
        if not type(layer).__module__.startswith(OURS) and not isinstance(layer, Checkpointed):
            first = _without_swarm(attributes_of(firsts[id(layer)])) if id(layer) in firsts else {}
            yield _Attributes(layer), _without_swarm(attributes_of(was)), first
    yield from _owners_of_agents(new, old, fresh)


def _owners_of_agents(new: EngineModel, old: EngineModel, fresh: EngineModel) -> Iterator[tuple[Any, dict, dict]]:
    firsts = {agent.unique_id: agent for agent in fresh.agents}
    others = {agent.unique_id: agent for agent in old.agents}
    for agent in new.agents:
        was, first = others[agent.unique_id], firsts.get(agent.unique_id)
        before = {} if first is None else own_attributes_of_agent(first)
        values = own_attributes_of_agent(was)
        if values or before:
            yield _Attributes(agent), values, before


def _checkpointed(new: EngineModel, old: EngineModel) -> Iterator[tuple[Any, Any]]:
    """Iterate over processes and layers that store and restore themselves, with those of the old model."""
    pairs: list[tuple[Any, Any]] = [
        (process, old.parts.processes.numbered[number]) for number, process in new.parts.processes.numbered.items()
    ]
    for owner, was in (*pairs, *_matching_layers(new, old)):
        if isinstance(owner, Checkpointed) and type(owner) is type(was):
            yield owner, was


def _without_swarm(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if not isinstance(value, Swarm)}


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


def _differ(one: Any, other: Any) -> bool:
    """Return whether two values differ, objects of any class by all their attributes."""
    return one is not other and _deep_digest(one) != _deep_digest(other)


def _deep_digest(value: Any) -> bytes:
    digest = blake2b(digest_size=16)
    _add_deeply(digest, value, set())
    return digest.digest()


def _add_deeply(digest: Any, value: Any, seen: set[int]) -> None:
    """Add a value to a digest, and the attributes of objects of any class, each once; of agents the unique_id."""
    kind = type(value)
    if kind in ATOMS or isinstance(value, (np.ndarray, np.generic, Agent, np.random.Generator)):
        add_to(digest, value)
        return
    if id(value) in seen or isinstance(value, (Model, Swarm, type)):
        digest.update(f"{kind.__name__};".encode())
        return
    seen.add(id(value))
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
        _add_deeply(digest, part, seen)


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
