"""Values as stored in recordings: what is declared by class and fields, arbiters, attributes of models and agents."""

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, partial
from importlib import import_module
from itertools import islice
from pkgutil import iter_modules
from typing import Any

import numpy as np
from mesa.agent import Agent, AgentSet
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import control as controls
from mesa_swarm.base.errors import RecordingError, SwarmError, check_name, error_line, shortened
from mesa_swarm.control.conditions import CONDITIONS
from mesa_swarm.control.team import Team, message_label
from mesa_swarm.fire.constants import FireConstants
from mesa_swarm.fire.strategy import FightFire, SeekHeat
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import ATOMS, GENERATORS, Checkpointed, attributes_of, checked_state, refuse_attributes
from mesa_swarm.recording.container import Packer
from mesa_swarm.recording.made_objects import family
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.devices import Device
from mesa_swarm.robots.drive import DirectedSlip, EqualByValues
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.world.arena import ArenaAgent

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
# Modules of the handles of robots and bodies.
HANDLES = ("mesa_swarm.robots.", "mesa_swarm.world.", "mesa_swarm.fire.")
# Attributes of each of Mesa's agents that are stored with what the model contains.
OF_AGENTS = frozenset({"model", "unique_id"})
OF_ARENA = OF_AGENTS | {"space", "_mesa_index", "pos"}
# Kinds of references to parts of a model.
REFERENCES = ("of_model", "of_part", "process", "layer", "field")
# Attributes of a model to which others may refer.
OF_MODEL = ("datacollector", "fires", "map", "parts", "random", "rng", "space", "streams", "swarm")


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
        return {
            "Team": [[_labelled_if_own(k, message_label), control_to_json(arbiter)] for k, arbiter in control.items()]
        }
    layers = [_labelled_if_own(layer, _label_of_layer) for layer in control.layers]
    if isinstance(control, controls.StateMachine):
        states = [[name, len(of_state)] for name, of_state in control.states.items()]
        changes = [
            [change.source, change.target, _labelled_if_own(change.condition, _label_of_layer)]
            for change in control.transitions
        ]
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
    if sum(count for _, count in content["states"]) != len(layers):
        raise RecordingError(f"the states of a machine do not have its {len(layers)} layers in recording")
    layers_left = iter(layers)
    states = {str(name): tuple(islice(layers_left, count)) for name, count in content["states"]}
    changes = [(source, target, part_from_json(condition)) for source, target, condition in content["transitions"]]
    return controls.StateMachine(states, [controls.Transition(source=a, target=b, condition=c) for a, b, c in changes])


def own_code(control: Any) -> list[str]:
    """Return the names of the custom rules in what `control_to_json` returned."""
    if control is not None and "Team" in control:
        return [name for _, arbiter in control["Team"] for name in own_code(arbiter)]
    parts = []
    for arbiter in (control or {}).values():
        parts += [*arbiter["layers"], *(condition for _, _, condition in arbiter.get("transitions", ()))]
    return [str(part[OWN_CODE]) for part in parts if isinstance(part, dict) and OWN_CODE in part]


def _labelled_if_own(part: Any, label: Callable[[Any], str]) -> object:
    """Return a group's name, a design or a layer as JSON; of what has code of a user's only a label."""
    try:
        return part_to_json(part)
    except RecordingError:
        return {OWN_CODE: label(part)}


def _label_of_layer(layer: object) -> str:
    values = [f"{name}={value!r}" for name, value in getattr(layer, "parameters", {}).items()]
    return " ".join([type(layer).__name__, str(getattr(layer, "name", "")), *values])


def _key_from_json(value: object) -> Any:
    if isinstance(value, dict) and OWN_CODE in value:
        raise RecordingError(f"the control is for a design of code of one's own ({shortened(value[OWN_CODE])})")
    return part_from_json(value)


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


class ModelPacker(Packer):
    """Plain values of a model, which may refer to its agents by unique_id.

    `removed` are agents that were removed from it and to which values refer; None refuses such values. `present` are
    the classes of agents that the model has had at first; None where values come from a model rather than from a file,
    so that agents of any class may be made.
    """

    def __init__(self, model: EngineModel, arrays: list[np.ndarray] | None = None) -> None:
        super().__init__(arrays)
        self.model = model
        self.removed_agents: dict[int, Agent] | None = None
        self._agents: dict[int, Agent] | None = None
        self.present: frozenset[type] | None = frozenset(model.agents_by_type)

    def pack(self, value: Any, what: str = "a value", depth: int = 0) -> object:
        """Return a value as JSON."""
        if isinstance(value, Agent):
            return {"agent": value.unique_id} if value in self.model.agents else self._pack_removed(value, what)
        if isinstance(value, AgentSet):
            return {"agents": [self.pack(agent, what) for agent in value]}
        return super().pack(value, what, depth)

    def _pack_removed(self, agent: Agent, what: str) -> dict:
        if self.removed_agents is None or agent.model is not self.model:
            raise RecordingError(f"{what} refers to an agent that is not in the model, which cannot be stored")
        self.removed_agents[agent.unique_id] = agent
        return {"removed": agent.unique_id}

    def unpack(self, content: Any) -> Any:
        """Return the value for which `pack` returned this."""
        if isinstance(content, dict) and "removed" in content:
            return (self.removed_agents or {})[content["removed"]]
        if isinstance(content, dict) and "agent" in content:
            if self._agents is None:
                self._agents = {agent.unique_id: agent for agent in self.model.agents}
            return self._agents[content["agent"]]
        if isinstance(content, dict) and "agents" in content:
            return AgentSet([self.unpack(agent) for agent in content["agents"]], random=self.model.random)
        return super().unpack(content)


def own_attributes_of_agent(agent: Agent) -> dict[str, Any]:
    """Return the attributes of an agent that are stored as they are."""
    apart = apart_of_agent(agent)
    values = agent.__dict__ if isinstance(agent, ArenaAgent) else attributes_of(agent)
    return {name: value for name, value in values.items() if name not in apart}


def apart_of_agent(agent: Agent) -> frozenset[str]:
    """Return the names of the attributes of an agent that are not stored as they are."""
    kind: Any = type(agent)
    return of_handles(kind) | (OF_ARENA if isinstance(agent, ContinuousSpaceAgent) else OF_AGENTS)


@cache
def of_handles(kind: type) -> frozenset[str]:
    """Return the attributes that handles of robots and bodies have themselves: classes of the package annotate them.

    Examples
    --------
    >>> from mesa_swarm.robots.robot import Robot
    >>> sorted(of_handles(Robot))
    ['row', 'swarm']
    """
    bases = [base for base in kind.__mro__ if issubclass(base, ArenaAgent) and base.__module__.startswith(HANDLES)]
    return frozenset(name for base in bases for name in vars(base).get("__annotations__", ()) if name != "_made_by")


def attribute_to_json(value: object, name: str, packer: ModelPacker) -> object:
    """Return an attribute as JSON: plain, a random generator, a part of the model, or an object with a state."""
    reference = None if type(value) in ATOMS else _reference(value, packer.model)
    if reference is not None:
        return reference
    if isinstance(value, np.random.Generator):
        stream = packer.model.streams.name_of(value)
        return {"generator": generator_to_json(value, name, packer)} if stream is None else {"stream": stream}
    if isinstance(value, Checkpointed) and not isinstance(value, type):
        return {"own": packer.pack(value.checkpoint(), name)}
    for column, array in packer.model.swarm.columns.items():
        if value is array:
            return {"column": column}
    try:
        return {"plain": packer.pack(value, name)}
    except RecordingError as error:
        try:
            return {"part": part_to_json(value)}
        except RecordingError:
            raise RecordingError(f"{error}; give its class checkpoint() and restore(state)") from None


def attributes_to_json(values: dict[str, Any], owner: str, packer: ModelPacker) -> dict[str, object]:
    """Return attributes as JSON by name; errors name them with their owner, as in "Robot 3's colour"."""
    return {name: attribute_to_json(value, owner + name, packer) for name, value in values.items()}


def restore_attributes(
    owner: Any, contents: dict[str, dict], packer: ModelPacker, reserved: frozenset[str] = frozenset()
) -> None:
    """Give an object the attributes for which `attributes_to_json` returned these, none of them a reserved one."""
    refuse_attributes(owner, contents, reserved)
    now = attributes_of(owner)
    for name, content in contents.items():
        object.__setattr__(owner, name, attribute_from_json(now.get(name), name, content, packer))


def stored_to_json(value: object, name: str, packer: ModelPacker) -> object:
    """Return a value of what a part stores as JSON: as an attribute, but what stores itself whole."""
    if isinstance(value, controls.Arbiter):
        return {"control": control_to_json(value)}
    if isinstance(value, Checkpointed) and not isinstance(value, type):
        return {"own": packer.pack(value.checkpoint(), name)}
    return attribute_to_json(value, name, packer)


def stored_from_json(now: object, name: str, content: dict, packer: ModelPacker) -> object:
    """Return the value for which `stored_to_json` returned this; what is the same as now stays the same object."""
    if "control" in content:
        same = isinstance(now, controls.Arbiter) and control_to_json(now) == content["control"]
        return now if same else control_from_json(content["control"])
    return attribute_from_json(now, name, content, packer)


def _reference(value: object, model: EngineModel) -> dict | None:
    """Return which part of the model an object is: the model itself, or what it stores apart; None if it is neither."""
    if value is model:
        return {"of_model": ""}
    references = [{"of_model": name} for name in OF_MODEL if getattr(model, name) is value]
    for kind, owners in owners_of(model).items():
        references += [{kind: key} for key, owner in owners.items() if owner is value]
    return references[0] if references else None


def owners_of(model: EngineModel) -> dict[str, dict[Any, Any]]:
    """Return by their keys the objects whose state is stored, to which attributes may refer."""
    layers = dict(enumerate(getattr(model.control, "layers", ())))
    numbered, live = model.parts.processes.numbered, model.parts.fields.live
    return {"of_part": dict(model.parts), "process": numbered, "layer": layers, "field": live}


def _find_referred(kind: str, which: Any, model: EngineModel) -> object:
    """Return the object for which `_reference` returned this."""
    if kind == "of_model":
        if which not in (*OF_MODEL, ""):
            raise RecordingError(f"{shortened(which)} is not a part of a model")
        return getattr(model, which) if which else model
    return owners_of(model)[kind][which]


def attribute_from_json(now: object, name: str, content: dict, packer: ModelPacker) -> object:
    """Return the attribute for which `attribute_to_json` returned this; what has a state of its own stays the same."""
    ((kind, value),) = content.items()
    if kind == "stream":
        return packer.model.streams[check_name("stream", value)]
    if kind == "generator":
        if not isinstance(now, np.random.Generator):
            raise RecordingError(f"{name} is not a random generator in this model")
        now.bit_generator.state = checked_state(packer.unpack(value))
        return now
    if kind == "own":
        if not isinstance(now, Checkpointed):
            raise RecordingError(f"{name} has no checkpoint() and restore(state) in this model")
        now.restore(packer.unpack(value))
        return now
    if kind == "column":
        return packer.model.swarm.columns[value]
    if kind in REFERENCES:
        return _find_referred(kind, value, packer.model)
    return part_from_json(value) if kind == "part" else packer.unpack(value)


def generator_to_json(generator: np.random.Generator, name: str, packer: Packer) -> object:
    """Return the state of a random generator."""
    state = generator.bit_generator.state
    if state["bit_generator"] not in GENERATORS:
        raise RecordingError(f"{name} is a {state['bit_generator']}, which cannot be stored; use PCG64")
    return packer.pack(state)
