"""Agents that were removed from a model and to which it still refers: stored as removed, and restored as removed."""

from typing import Any

from mesa import Agent
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.base.errors import RecordingError, shortened
from mesa_swarm.fire.fires import Fire
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import refuse_attributes
from mesa_swarm.recording.attributes import (
    ModelPacker,
    apart_of_agent,
    attribute_from_json,
    attribute_to_json,
    own_attributes_of_agent,
)
from mesa_swarm.recording.made_objects import check_agent_class
from mesa_swarm.recording.objects import (
    agent_class,
    body_to_json,
    class_of_agent,
    restore_outline,
    restore_shape,
    restore_state,
    state_to_json,
)
from mesa_swarm.robots.robot import Robot
from mesa_swarm.world.arena import ArenaAgent
from mesa_swarm.world.bodies import Body, BodyTable, Form
from mesa_swarm.world.movers import Driven
from mesa_swarm.world.shapes import disc
from mesa_swarm.world.statics import DRIVEN, FIXED, PUSHED

GONE = -1  # the row of a removed handle


def removed_to_json(packer: ModelPacker) -> list:
    """Return what is stored of removed agents to which values refer, and of those to which these refer."""
    entries: list[list] = []
    agents = packer.removed_agents or {}
    while len(entries) < len(agents):
        for unique_id in list(agents)[len(entries) :]:
            agent = agents[unique_id]
            what = f"removed {type(agent).__name__} {unique_id}'s "
            attributes = {n: attribute_to_json(v, what + n, packer) for n, v in own_attributes_of_agent(agent).items()}
            entries.append([unique_id, [*class_of_agent(agent), _remains(agent)], attributes])
    return entries


def make_removed(packer: ModelPacker, entries: list) -> None:
    """Make the handles of removed agents, without their attributes; those of the same kind that are known stay."""
    present = packer.removed_agents or {}
    there = {agent.unique_id for agent in packer.model.agents}
    new = {unique_id: remains for unique_id, remains, _ in entries if unique_id not in present}
    if there & new.keys():
        raise RecordingError(f"agent {min(there & new.keys())} is stored as removed and as present")
    agents = {key: _remains_from_json(packer.model, key, remains, packer.present) for key, remains in new.items()}
    packer.removed_agents = {**present, **agents}


def restore_removed(packer: ModelPacker, entries: list) -> None:
    """Restore the attributes of removed agents."""
    for unique_id, _, values in entries:
        agent: Any = (packer.removed_agents or {})[unique_id]
        refuse_attributes(agent, values, apart_of_agent(agent))
        for name, content in values.items():
            object.__setattr__(agent, name, attribute_from_json(None, name, content, packer))


def _remains(agent: Agent) -> dict:
    """Return what the handle of a removed agent still has."""
    if not isinstance(agent, Body):
        return {}
    return {**body_to_json(agent), "kind": agent.kind, **state_to_json(agent)}


def _remains_from_json(model: EngineModel, unique_id: int, content: Any, present: frozenset[type] | None) -> Agent:
    """Return a removed agent of a class that is loaded, made without its constructor."""
    module, name, remains = content
    kind = agent_class(module, name)
    if kind is None:
        raise RecordingError(f"agents of class {shortened(name)} cannot be made: import it from {shortened(module)}")
    if present is not None and not issubclass(kind, ArenaAgent):
        check_agent_class(kind, kind in present)
    agent: Any = object.__new__(kind)
    agent.model, agent.unique_id = model, unique_id
    if isinstance(agent, ContinuousSpaceAgent):
        agent.space = agent._mesa_index = None  # type: ignore[assignment]
    if isinstance(agent, Robot):
        agent.swarm, agent.row = model.swarm, GONE
    elif isinstance(agent, Body):
        _restore_body(model, agent, remains)
    return agent


def _restore_body(model: EngineModel, body: Any, remains: dict) -> None:
    """Give a removed body the table of its own, which has what it was."""
    kind, form, mode = str(remains.get("kind", "")), None, FIXED
    if isinstance(body, Fire):
        body.fires, body.index = model.fires, GONE
    if "shape" in remains or isinstance(body, Fire):  # without a shape in recordings of version 0.2.0
        shape = restore_shape(remains["shape"]) if "shape" in remains else disc(model.map.bounds[:2], 1.0)
        remains = {name: value for name, value in remains.items() if name not in ("pose", "aim")}
    else:
        name, mode = ("driven", DRIVEN) if isinstance(body, Driven) else ("load", PUSHED)
        form = Form.about_origin(*restore_outline(remains[name]))
        shape = form.shape_at((0.0, 0.0, 0.0))
    if isinstance(body, Driven):
        body.agent = body.carrier = None
    kinds = model.kinds if kind in model.kinds else (*model.kinds, kind)
    BodyTable(kinds).add(body, shape, form, mode=mode, kind=kinds.index(kind))
    restore_state(body, remains, model.map.bounds)
