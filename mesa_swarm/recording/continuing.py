"""Continuing a run with other parameters, between two steps: a model made with these takes over its state."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from copy import copy, deepcopy
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from itertools import zip_longest
from typing import Any, TypeVar, cast

import numpy as np
from mesa import Agent, Model
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.base.errors import (
    InvalidValueError,
    RecordingError,
    UnknownNameError,
    error_line,
    shortened,
    unknown_name,
)
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.control.state_machine import StateMachine
from mesa_swarm.control.team import Team
from mesa_swarm.kernels.part import Column, Part, list_attributes
from mesa_swarm.model.bodies_part import CHANGING
from mesa_swarm.model.control_part import ControlPart
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.mesa_model import add_reporters
from mesa_swarm.model.process_rule import ProcessRule
from mesa_swarm.model.robots_part import role_of
from mesa_swarm.model.state import ATOMS, Checkpointed, add_to, attributes_of, is_float, quick_fingerprint, stored_state
from mesa_swarm.model.state import KINDS as ARRAY_KINDS
from mesa_swarm.recording.collected_data import reporters_of, set_clock
from mesa_swarm.recording.objects import (
    make_removed,
    objects_to_json,
    other_agents,
    removed_to_json,
    restore_objects,
    restore_removed,
)
from mesa_swarm.recording.provenance import parameters_of_run, provenance_of, rebuild_model
from mesa_swarm.recording.stored_values import (
    OF_MODEL,
    ModelPacker,
    attribute_from_json,
    attribute_to_json,
    control_to_json,
    own_attributes_of_agent,
    owners_of,
)
from mesa_swarm.robots.imperfections import Imperfections
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.swarm import LASTING, Swarm
from mesa_swarm.world.arena import get_next_id, set_next_id
from mesa_swarm.world.bodies import BodyTable
from mesa_swarm.world.statics import FIRE, FIXED, KINDS

Continued = TypeVar("Continued", bound=EngineModel)
# What a run changes of its fires: the other columns follow from the parameters.
OF_FIRES = ("temperature", "out", "out_step")
# Columns that follow from the parameters, unless the run has added or removed anything.
MADE = (("robots", "number"), ("robots", "design"))
# Settings of the model itself; those of a standing part are its `settings`.
SETTINGS = ("scale", "collect_every", "threads")
CONTROL = ("control", "arbiter")
OURS = "mesa_swarm."
# Columns of bodies that follow from parameters, unless the run has changed them by hand.
BY_HAND = ("radius", "resistance", "temperature")
PERFECT = Imperfections()
# Values that are compared as they are; of agents the unique_id counts, of streams the state.
UNDIVIDED = (np.ndarray, np.generic, bytes, complex, Agent, np.random.Generator)


def continued(model: Continued, /, **changes: object) -> Continued:
    """Return a model that continues the run of another one with other parameters.

    A model is made with these, and takes over the state of the run, as by `resume`: the robots where they are, the
    memory of layers, random streams, counters. Its observers continue with it: a recording notes a change by hand.

    Parameters
    ----------
    model : EngineModel
        Between two steps; it is not to be used afterwards.
    **changes
        New values of the model's parameters.

    Raises
    ------
    InvalidValueError
        If a change would only have an effect from the first step of a run on, or makes another world.
    UnknownNameError
        If there is no such parameter.

    Examples
    --------
    >>> from mesa_swarm.models.boids import Boids
    >>> model = continued(Boids(rng=1).run(20), noise=0.1)
    >>> model.steps, model.given[1]["noise"]
    (20, 0.1)
    """
    _check_names(model, changes)
    origin = provenance_of(model, rerun=True)
    new, fresh = rebuild_model(origin, type(model), **changes), rebuild_model(origin, type(model))
    continue_with(new, model, fresh, tuple(changes))
    return cast(Continued, new)


def _check_names(model: EngineModel, changes: Mapping[str, object]) -> None:
    parameters = parameters_of_run(model)
    odd = sorted(set(changes) - parameters.keys())
    if odd:
        raise UnknownNameError(unknown_name(f"parameter of {type(model).__name__}", odd[0], parameters))


class Beginning:
    """A model before its first step, which is continued as `continued` does, again and again with other parameters.

    The model itself and the one like it that `continued` makes are kept: each time only the new model is made.

    Parameters
    ----------
    make : callable
        Returns the model, always the same one, without observers.

    Examples
    --------
    >>> from mesa_swarm.models.boids import Boids
    >>> beginning = Beginning(lambda: Boids(n_robots=10, rng=1))
    >>> [beginning.continued(memory=steps).given[1]["memory"] for steps in (5.0, 6.0)]
    [5.0, 6.0]
    """

    def __init__(self, make: Callable[[], EngineModel]) -> None:
        self._make = make
        self._begin()

    def _begin(self) -> None:
        self._old = self._make()
        origin = provenance_of(self._old, rerun=True)
        self._fresh = rebuild_model(origin, type(self._old))
        # The map is the same each time, and takes as long to read as all else.
        self._map = {"map": self._fresh.map} if origin["takes_map"] else {}
        self._origin, self._hash = {**origin, "takes_map": False}, self._old.state_hash()

    def continued(self, **changes: object) -> EngineModel:
        """Return a model that continues with other parameters; what it raises is of the same kinds."""
        if self._old.state_hash() != self._hash:  # a model that continued it has changed something of it
            self._begin()
        _check_names(self._old, changes)
        new = rebuild_model(self._origin, type(self._old), **{**self._map, **changes})
        # Before the first step nothing shows whether a run changes it, in which the change would be refused.
        if _list_changed_memory(new, self._fresh):
            raise InvalidValueError(f"{shortened(' and '.join(changes))} changes with what processes begin")
        continue_with(new, self._old, self._fresh, tuple(changes))
        return new


def continue_with(new: EngineModel, old: EngineModel, fresh: EngineModel, names: tuple[str, ...]) -> None:
    """Continue the run of `old` with `new`, made with other values of the parameters of these names.

    `fresh` is `old` before its first step. A change that would have no effect, or another one than on a new run, is
    refused, and `old` is as it was.
    """
    if _differs_at_start(new, fresh) or _hidden_by_run(new, old, fresh):
        raise InvalidValueError(
            f"{shortened(' and '.join(names))} belongs to the beginning of a run; make a new model, or reset, with it"
        )
    take_over(new, old, fresh)
    hand_over(old, new, [f"parameter {name}" for name in names])


def match_robots(model: EngineModel, like: EngineModel) -> None:
    """Add robots at free places, or remove the last ones, until there are as many of each design and group as `like`.

    Examples
    --------
    >>> from mesa_swarm.models.boids import Boids
    >>> model = Boids(n_robots=20, rng=1).run(5)
    >>> match_robots(model, Boids(n_robots=22, rng=1))
    >>> len(model.run(5).robots)
    22
    """
    there, targets = _by_kind(model), _by_kind(like)
    model.remove_robots([robot for kind, robots in there.items() for robot in robots[len(targets.get(kind, ())) :]])
    for kind, robots in targets.items():
        lacking = len(robots) - len(there.get(kind, ()))
        if lacking > 0:
            model.add_robots(robots[0].design, lacking, group=robots[0].group)


def _by_kind(model: EngineModel) -> dict[tuple[str, str], list[Robot]]:
    """Return the robots by the name of their design and their group."""
    groups: dict[tuple[str, str], list[Robot]] = {}
    for robot in model.swarm.agents:
        groups.setdefault((robot.design.name, robot.group), []).append(robot)
    return groups


def hand_over(old: EngineModel, new: EngineModel, what: list[str]) -> None:
    """Let the observers of a model continue with another one, which differs in what is named."""
    observers, callees = list(old.observers), old.observers.complete
    old.observers = ()
    new.observers.extend(observers)
    for observer in callees:
        observer.replaced(old, new, what)


def _differs_at_start(new: EngineModel, fresh: EngineModel) -> bool:
    """Return whether the models begin in states that other parameters do not change any more."""
    mine, other = dict(_of_start(new)), dict(_of_start(fresh))
    # What only one of them has, such as the wear of imperfect robots, begins when it is added.
    return any(mine[name] != other[name] for name in mine.keys() & other.keys())


def _of_start(model: EngineModel) -> Iterator[tuple[tuple, bytes]]:
    """Yield the state at the beginning of a run, by name and shape."""
    tables = {"robots": model.swarm.columns, "fires": model.fires.columns}
    yield ("robots",), str(len(model.swarm)).encode()
    for name, column in tables.pop("robots").items():
        if role_of(name) == "state":
            yield (name, column.shape), column.tobytes()
    for prefix, table in tables.items():
        yield from (((prefix, name), table[name].tobytes()) for name in OF_FIRES)
    for body in model.displaced:
        yield ("body", body.unique_id), np.array(body.pose).tobytes()
    for name, field in model.fields.items():
        yield ("field", name, field.values.shape), field.values.tobytes()
    for name, value in model.parts.state.values.items():
        yield ("state", name), quick_fingerprint(value)
    for part in model.parts.added():
        for name, column in part.columns().items():
            if column.role == "state":
                yield (part.name, name, column.array.shape), column.array.tobytes()


def _hidden_by_run(new: EngineModel, old: EngineModel, fresh: EngineModel) -> bool:
    """Return whether the parameters would change attributes or settings that the run has changed itself."""
    mine, now, first = (model.own_attributes for model in (new, old, fresh))
    both = mine.keys() & now.keys() & first.keys()
    by_hand = changed_settings(old, fresh)
    hidden = any(_differ_quickly(mine[name], first[name]) and _differ_quickly(now[name], first[name]) for name in both)
    return hidden or any(key in by_hand for key in changed_settings(new, fresh)) or _is_memory_hidden(new, old, fresh)


def _is_memory_hidden(new: EngineModel, old: EngineModel, fresh: EngineModel) -> bool:
    """Return whether the parameters would change what a process remembers and the run has changed itself."""
    return bool(_list_changed_memory(new, fresh) & _list_changed_memory(old, fresh))


def _list_changed_memory(model: EngineModel, first: EngineModel) -> set[tuple[int, str]]:
    """Return the arrays of processes of functions that differ from another model's: number and name of each."""
    mine, others = (cast(dict[int, Any], one.parts.processes.numbered) for one in (model, first))
    rules = [number for number in mine.keys() & others.keys() if isinstance(others[number], ProcessRule)]
    return {(number, name) for number in rules for name in _changed_arrays(mine[number], others[number])}


def _differ_quickly(first: Any, second: Any) -> bool:
    return first is not second and quick_fingerprint(first) != quick_fingerprint(second)


# ---- the state, as a whole


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
    mine.mode[moving], mine.carrier[moving] = table.mode[moving], table.carrier[moving]
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
    new.parts.replan()  # stages write into the former history


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
    _take_attributes(new, old.own_attributes, fresh.own_attributes, carrier)
    for name in fresh.state.keys() - old.state.keys():
        new.state.pop(name, None)
    new.state.update(_changed_values(old.state, fresh.state, new.state, carrier))
    for kind in ("process", "layer", "agent"):
        for key, was in carrier.old[kind].items():
            _take_owner(kind, carrier.new[kind].get(key), was, carrier.fresh[kind].get(key), carrier)


def _take_owner(kind: str, owner: Any, was: Any, first: Any, carrier: "_Carrier") -> None:
    """Copy what the run has changed in a process, a layer or an agent; what stores itself takes over as a whole."""
    is_whole = kind != "agent" and isinstance(owner, Checkpointed)
    is_ours = kind == "layer" and type(owner).__module__.startswith(OURS)
    is_bare = kind == "process" and first is None and not _copies_itself(owner)  # made without its constructor
    if owner is not None and not is_ours and (is_bare or not is_whole):
        _take_attributes(owner, _values_of(was), _values_of(first), carrier)
    if is_whole and type(owner) is type(was):
        owner.restore(_state_to_take(was, first))


def _state_to_take(was: Any, first: Any) -> Any:
    """Return the state of what stores itself; of a process made of a function the arrays that the run has changed."""
    state = deepcopy(was.checkpoint())
    if isinstance(was, ProcessRule) and isinstance(first, ProcessRule):
        changed = _changed_arrays(was, first)
        state["memory"] = {name: array for name, array in state["memory"].items() if name in changed}
    return state


def _changed_arrays(process: ProcessRule, first: ProcessRule) -> set[str]:
    """Return the names of the arrays that a process remembers and another one does not, or with other numbers."""
    known = first.memory
    return {name for name, array in process.memory.items() if name not in known or _differ_quickly(array, known[name])}


def _values_of(owner: Any) -> dict[str, Any]:
    return own_attributes_of_agent(owner) if isinstance(owner, Agent) else {} if owner is None else attributes_of(owner)


def _take_attributes(owner: Any, values: dict[str, Any], first: dict[str, Any], carrier: "_Carrier") -> None:
    for name in first.keys() - values.keys():
        owner.__dict__.pop(name, None)
    for name, value in _changed_values(values, first, attributes_of(owner), carrier).items():
        object.__setattr__(owner, name, value)


def _changed_values(values: Mapping, first: Mapping, now: Mapping, carrier: "_Carrier") -> dict[str, Any]:
    """Return by name what the run has changed, as values of the new model."""
    changes = {name: value for name, value in values.items() if name not in first or _differ(value, first[name])}
    return {name: carrier.carry(name, value, now.get(name)) for name, value in changes.items()}


def _take_processes(new: EngineModel, old: EngineModel, fresh: EngineModel) -> None:
    """Add and remove the processes that the run did; the attributes of those that are added follow."""
    mine, others, first = (model.parts.processes.numbered for model in (new, old, fresh))
    for number in others.keys() - first.keys() - mine.keys():
        kind, other = cast(Any, type(others[number])), cast(Any, others[number])
        mine = {**mine, number: other.for_model() if _copies_itself(other) else kind.__new__(kind)}
    if mine.keys() < others.keys():
        raise InvalidValueError("the change makes a model with fewer processes; change parameters that leave them")
    new.parts.processes.have({number: mine[number] for number in others})


def _copies_itself(process: Any) -> bool:
    """Return whether a process is made for a model as a copy, as one made of a function is."""
    return callable(getattr(process, "for_model", None))


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
    part.restore(_changed_values(was.store(), {} if first is None else first.store(), part.store(), carrier))
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
        **owners_of(model),
        "of_model": {"": model, **{name: getattr(model, name) for name in OF_MODEL}},
        "stream": dict(model.streams.items()),
        "column": {(part, name): column.array for part, named in columns.items() for name, column in named.items()},
        "arbiter": _arbiters(model, by_label),
        "layer": _layers(model, by_label),
        "agent": {agent.unique_id: agent for agent in model.agents},
    }


def _differ(first: Any, second: Any) -> bool:
    """Return whether two values differ, objects by what their `checkpoint` returns, or else by all their attributes."""
    return first is not second and _deep_digest(first) != _deep_digest(second)


def _deep_digest(value: Any) -> bytes:
    digest = blake2b(digest_size=16)
    for part in _divide(value, set()):
        add_to(digest, part)
    return digest.digest()


def _divide(value: Any, entered: set[int]) -> Iterator[Any]:
    """Iterate over the plain values in a value, and of each object in it, once, over its class and its state."""
    kind, of_objects = type(value), isinstance(value, np.ndarray) and value.dtype.kind not in ARRAY_KINDS
    if kind in ATOMS or is_float(value) or (isinstance(value, UNDIVIDED) and not of_objects):
        yield value
        return
    yield kind.__qualname__
    if id(value) in entered or isinstance(value, (Model, Swarm, type)):
        return
    entered.add(id(value))
    if of_objects or isinstance(value, (list, tuple, deque)):
        parts: list[Any] = [value.shape, *value.ravel().tolist()] if of_objects else list(value)
    elif isinstance(value, (set, frozenset)):
        parts = sorted(value, key=repr)
    else:
        pairs = value.items() if isinstance(value, Mapping) else sorted(stored_state(value).items())
        parts = [part for pair in pairs for part in pair]
    yield len(parts)
    for part in parts:
        yield from _divide(part, entered)


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
