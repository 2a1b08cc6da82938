"""Agents that were removed from a model and to which it still refers: stored as removed, and restored as removed."""

from typing import Any

from mesa import Agent
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.errors import RecordingError, shortened
from mesa_swarm.fire.fires import Fire
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import refuse_attributes
from mesa_swarm.recording.attributes import (
    ModelPacked,
    apart_of_agent,
    attribute_from_json,
    attribute_to_json,
    own_attributes_of_agent,
)
from mesa_swarm.recording.making import check_agent_class
from mesa_swarm.recording.objects import (
    agent_class,
    body_to_json,
    checked_pose,
    class_of_agent,
    restored_outline,
    restored_shape,
    stored_outline,
)
from mesa_swarm.robots.robot import Robot
from mesa_swarm.world.arena import ArenaAgent
from mesa_swarm.world.bodies import Body, Form, Load, Loads, Obstacle, checked_resistance
from mesa_swarm.world.movers import Driven

GONE = -1  # the row of a removed handle


def removed_to_json(packed: ModelPacked) -> list:
    """Return what is stored of removed agents to which values refer, and of those to which these refer."""
    stored: list[list] = []
    removed = packed.removed or {}
    while len(stored) < len(removed):
        for unique_id in list(removed)[len(stored) :]:
            agent = removed[unique_id]
            what = f"removed {type(agent).__name__} {unique_id}'s "
            own = {n: attribute_to_json(v, what + n, packed) for n, v in own_attributes_of_agent(agent).items()}
            stored.append([unique_id, _remains_to_json(agent), own])
    return stored


def make_removed(packed: ModelPacked, stored: list) -> None:
    """Make the handles of removed agents, without their attributes; those of the same kind that are known stay."""
    known = packed.removed or {}
    there = {agent.unique_id for agent in packed.model.agents}
    new = {unique_id: remains for unique_id, remains, _ in stored if unique_id not in known}
    if there & new.keys():
        raise RecordingError(f"agent {min(there & new.keys())} is stored as removed and as present")
    made = {one: _remains_from_json(packed.model, one, remains, packed.present) for one, remains in new.items()}
    packed.removed = {**known, **made}


def restore_removed(packed: ModelPacked, stored: list) -> None:
    """Restore the attributes of removed agents."""
    for unique_id, _, values in stored:
        agent: Any = (packed.removed or {})[unique_id]
        refuse_attributes(agent, values, apart_of_agent(agent))
        for name, content in values.items():
            object.__setattr__(agent, name, attribute_from_json(None, name, content, packed))


def _remains_to_json(agent: Agent) -> list:
    """Return the class of a removed agent, and what its handle still has."""
    return [*class_of_agent(agent), _remains(agent)]


def _remains(agent: Agent) -> dict:
    if not isinstance(agent, Body):
        return {}
    if isinstance(agent, Fire):
        return {"kind": agent.kind}
    if isinstance(agent, Driven):
        return {"kind": agent.kind, "driven": stored_outline(agent.form.outline, agent.form.radius)}
    return {"kind": agent.kind, **body_to_json(agent)}


def _remains_from_json(model: EngineModel, unique_id: int, stored: Any, present: frozenset[type] | None) -> Agent:
    """Return a removed agent of a class that is loaded, made without its constructor."""
    module, name, remains = stored
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
    elif isinstance(agent, Fire):
        agent.fires, agent.row = model.fires, GONE
    if isinstance(agent, Body):
        agent._kind = str(remains.get("kind", ""))
        _restore_body(model, agent, remains)
    return agent


def _restore_body(model: EngineModel, body: Any, remains: dict) -> None:
    if isinstance(body, Driven):
        body.form = Form.about_origin(*restored_outline(remains["driven"]))
        body.movers, body.row, body.agent, body.carrier, body._shown = model.movers, GONE, None, None, None
    elif isinstance(body, Load):
        body.form = Form.about_origin(*restored_outline(remains["load"]))
        *place, heading = checked_pose("removed load", remains["pose"], model.map.bounds)
        Loads().add(body, position=place, heading=heading, resistance=checked_resistance(remains["resistance"]))
        body.note(moved=bool(remains["moved"]), pushers=int(remains["pushers"]))
        body._shown = None
    elif isinstance(body, Obstacle):
        body.shape = restored_shape(remains["shape"])
