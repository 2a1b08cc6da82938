"""Attributes of a model, of its agents, layers and processes, as stored in recordings."""

from functools import cache
from typing import Any

import numpy as np
from mesa.agent import Agent, AgentSet
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.base.errors import RecordingError, check_name, shortened
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import GENERATORS, Checkpointed, attributes_of, checked_state
from mesa_swarm.recording.container import ATOMS, Packer
from mesa_swarm.recording.devices import control_from_json, control_to_json, part_from_json, part_to_json
from mesa_swarm.world.arena import ArenaAgent

# Attributes of each of Mesa's agents that are stored with what the model contains.
# Modules of the handles of robots and bodies.
HANDLES = ("mesa_swarm.robots.", "mesa_swarm.world.", "mesa_swarm.fire.")
OF_AGENTS = frozenset({"model", "unique_id"})
OF_ARENA = OF_AGENTS | {"space", "_mesa_index", "pos"}
# Kinds of references to parts of a model.
REFERENCES = ("of_model", "of_part", "process", "layer", "field")
# Attributes of a model to which others may refer.
OF_MODEL = ("datacollector", "fires", "map", "parts", "random", "rng", "space", "streams", "swarm")


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


def own_attributes(model: EngineModel) -> dict[str, Any]:
    """Return the attributes of a model that are stored as they are."""
    return model.own_attributes


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


def stored_to_json(value: object, name: str, packer: ModelPacker) -> object:
    """Return a value of what a part stores as JSON: as an attribute, but what stores itself whole."""
    if isinstance(value, Arbiter):
        return {"control": control_to_json(value)}
    if isinstance(value, Checkpointed) and not isinstance(value, type):
        return {"own": packer.pack(value.checkpoint(), name)}
    return attribute_to_json(value, name, packer)


def stored_from_json(now: object, name: str, content: dict, packer: ModelPacker) -> object:
    """Return the value for which `stored_to_json` returned this; what is the same as now stays the same object."""
    if "control" in content:
        same = isinstance(now, Arbiter) and control_to_json(now) == content["control"]
        return now if same else control_from_json(content["control"])
    return attribute_from_json(now, name, content, packer)


def _reference(value: object, model: EngineModel) -> dict | None:
    """Return which part of the model an object is: the model itself, or what it stores apart; None if it is neither."""
    if value is model:
        return {"of_model": ""}
    references = [{"of_model": name} for name in OF_MODEL if getattr(model, name) is value]
    for kind, owners in _owners(model).items():
        references += [{kind: key} for key, owner in owners.items() if owner is value]
    return references[0] if references else None


def _owners(model: EngineModel) -> dict[str, dict]:
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
    return _owners(model)[kind][which]


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
