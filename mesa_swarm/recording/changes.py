"""Manual changes between steps: their detection, and interventions as stored."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from operator import is_not, itemgetter
from typing import Any, NamedTuple

import numpy as np
from mesa import Agent
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.errors import RecordingError
from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.layout import population_of
from mesa_swarm.recording.schema import checked_content
from mesa_swarm.recording.sealed_stream import INTERVENTION
from mesa_swarm.state import declared, fingerprint
from mesa_swarm.world.arena import ArenaAgent

MOST_NAMED = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class Intervention:
    """What was changed by hand after a step, and before the next one.

    Parameters
    ----------
    what : tuple of str
        The changed attributes and columns, see `ChangeDetector`.
    why_not : str
        Why the state after it was not stored; empty if it was.
    checkpoint : int or None
        Index of that state in `Recording.checkpoints`, None if it was not stored.
    """

    step: int
    what: tuple[str, ...]
    why_not: str = ""
    checkpoint: int | None = None

    def __str__(self) -> str:
        return f"after step {self.step}, changed by hand: {', '.join(self.what)}"


def intervention_to_json(what: Sequence[str], why_not: str) -> bytes:
    """Return an intervention as stored."""
    return json.dumps({"what": list(what), "why_not": why_not}).encode()


def intervention_from_json(step: int, content: bytes, checkpoint: int | None) -> Intervention:
    """Return a stored intervention."""
    try:
        fields = checked_content(INTERVENTION, content)
    except ValueError:
        raise RecordingError(f"the intervention after step {step} cannot be decoded") from None
    why_not = fields["why_not"] or ("" if checkpoint is not None else "the recording ends before it")
    return Intervention(step=step, what=tuple(fields["what"]), why_not=why_not, checkpoint=checkpoint)


def as_remark(interventions: Sequence[Intervention]) -> str:
    """Return what a verdict adds about interventions, an empty text if there were none."""
    if not interventions:
        return ""
    listed = [f"{' and '.join(one.what)} after step {one.step}" for one in interventions[:MOST_NAMED]]
    more = len(interventions) - len(listed)
    listed += [f"and more after {more} other steps"] if more else []
    states = "state" if len(interventions) == 1 else "states"
    return f"; changed by hand: {', '.join(listed)} (continued from the stored {states})"


# Columns that handles set, and wheel commands, which persist where no controller decides.
OF_ROBOTS = ("position", "heading", "command", "max_speed", "tendency", "temperature", "group")
OF_FIRES = ("temperature", "out")
POSES = "pose of driven bodies"
AGENTS, OF_AGENTS = "set of other agents", "place or attributes of other agents"
PROCESSES = "set of processes"
CHANGES = (
    "set of robots, obstacles or fires",
    "an attribute set to the value that it had",
    *(f"{name} of robots" for name in OF_ROBOTS),
    *(f"{name} of fires" for name in OF_FIRES),
    "pose or resistance of loads",
    POSES,
    "values of fields",
)
# Values of attributes that may be changed in place.
IN_PLACE = (np.ndarray, list, dict, set)
ROBOTS, FIRES, BYTES = itemgetter(*OF_ROBOTS), itemgetter(*OF_FIRES), np.ndarray.tobytes


class ChangeDetector:
    """Change detection between steps, in a few microseconds.

    Detected are robots, obstacles, loads, fires and other agents that were added or removed; whatever their handles
    set, columns of `OF_ROBOTS` and `OF_FIRES` that were written directly, loads and other agents that were moved,
    values of fields; every attribute of the model and of other agents that was replaced: `control`, `fire_constants`,
    `imperfections`, `communication`, a number, a text; arrays, lists, dicts and sets of other agents that were changed
    in place; and whatever changed in `model.state`, processes and other declared state.

    Not detected are attributes that change when a model is read (`World._fleeting`), such as its data collector; draws
    from the model's random streams; changes within an attribute of the model, such as a list, an array, a learner or
    the memory of a layer; other columns that were written directly; attributes that robots and bodies were given. What
    a failed step has left behind is reported like a change by hand.
    """

    __slots__ = ("_agents", "_attributes", "_declared", "_fleeting", "_objects", "_processes")

    def __init__(self, model: FireModel) -> None:
        self._objects = _objects(model)
        self._agents = [_Seen.of(agent) for agent in _other_agents(model)]
        self._processes = model.processes
        self._attributes = model.__dict__.copy()
        self._fleeting = declared(model, "_fleeting")
        self._declared = _declared(model)

    def changes(self, model: FireModel) -> list[str]:
        """Return the names of what has changed in the model, an empty list if nothing has."""
        was, now, objects = self._attributes, model.__dict__, _objects(model)
        stated = _declared(model)
        # Nothing was replaced, as a rule: seen at once where names stand in the same order.
        replaced = compress(now, map(is_not, was.values(), now.values()))
        others = self._of_others(model)
        unchanged = objects == self._objects and stated == self._declared and not others
        if unchanged and len(was) == len(now) and self._fleeting.issuperset(replaced):
            return []
        names = [name for name in {**was, **now} if name not in self._fleeting and not _same(name, was, now)]
        changes = [name.lstrip("_") for name in names] + self._of_objects(objects) + others
        different = [name for name in {**self._declared, **stated} if self._declared.get(name) != stated.get(name)]
        changes += [name for name in different if name not in changes]
        return changes or ([CHANGES[1]] if objects != self._objects else [])

    def _of_others(self, model: FireModel) -> list[str]:
        """Return what has changed in agents other than robots and bodies, and which processes there are."""
        processes = model.processes
        if len(processes) != len(self._processes) or any(map(is_not, processes, self._processes)):
            return [PROCESSES]
        agents = _other_agents(model)
        if len(agents) != len(self._agents):
            return [AGENTS]
        if all(seen.is_same(agent) for seen, agent in zip(self._agents, agents, strict=True)):
            return []
        return [
            AGENTS
            if any(seen.agent is not agent for seen, agent in zip(self._agents, agents, strict=True))
            else OF_AGENTS
        ]

    def moved(self, model: FireModel) -> np.ndarray | None:
        """Return the rows of the driven bodies that were sent elsewhere, None if any has been put elsewhere already."""
        *placed, aim, aim_heading = self._objects[CHANGES.index(POSES)]
        movers = model.movers
        if placed != [movers.position.tobytes(), movers.heading.tobytes()]:
            return None
        sent = (movers.aim != np.frombuffer(aim).reshape(-1, 2)).any(axis=1)
        return np.flatnonzero(sent | (movers.aim_heading != np.frombuffer(aim_heading)))

    def _of_objects(self, objects: tuple) -> list[str]:
        different = [name for name, was, now in zip(CHANGES, self._objects, objects, strict=True) if was != now]
        if CHANGES[0] in different:  # all columns have other rows then
            return [CHANGES[0]]
        return [name for name in different if name != CHANGES[1]]


class _Seen(NamedTuple):
    """An agent as it was: its attributes, what those hold that can be changed in place, and its place in the space."""

    agent: Agent
    attributes: dict[str, Any]
    contents: list[bytes]
    place: list[float] | None

    @classmethod
    def of(cls, agent: Agent) -> "_Seen":
        return cls(agent, vars(agent).copy(), _contents_of(agent), _place_of(agent))

    def is_same(self, agent: Agent) -> bool:
        was, now = self.attributes, vars(agent)
        if agent is not self.agent or len(was) != len(now) or _place_of(agent) != self.place:
            return False
        if not all(name in was and was[name] is value for name, value in now.items()):
            return False
        return _contents_of(agent) == self.contents


def _other_agents(model: FireModel) -> list[Agent]:
    """Return the agents that are neither robots nor bodies, of most models none."""
    kinds = [kind for kind in model.agents_by_type if not issubclass(kind, ArenaAgent)]
    return [agent for kind in kinds for agent in model.agents_by_type[kind]] if kinds else []


def _contents_of(agent: Agent) -> list[bytes]:
    """Return a fingerprint of each attribute of an agent that may change in place."""
    return [fingerprint(value) for value in vars(agent).values() if isinstance(value, IN_PLACE)]


def _place_of(agent: Agent) -> list[float] | None:
    if not isinstance(agent, ContinuousSpaceAgent) or agent.space is None:
        return None
    return agent.position.tolist()


def _declared(model: FireModel) -> dict[str, bytes]:
    """Return a fingerprint of each declared value and process by name, of most models none."""
    if not (model._state or model._processes or model._events):
        return {}
    state = {f"state of {name}": fingerprint(value) for name, value in model._state.items()}
    state["events"] = str(len(model._events)).encode()
    return state | {name: fingerprint(value) for name, value in model._stated_processes()}


def _same(name: str, was: dict, now: dict) -> bool:
    return name in was and name in now and was[name] is now[name]


def _objects(model: FireModel) -> tuple[Any, ...]:
    """Return what is compared of robots, fires and loads, in the order of `CHANGES`."""
    swarm, agents = model.swarm, model.swarm.agents
    version, *others = population_of(model)
    return (
        (len(agents), agents[-1].unique_id if agents else 0, others),
        (swarm.disturbed, version),
        *map(BYTES, ROBOTS(swarm.columns)),
        *map(BYTES, FIRES(model.fires.columns)),
        [(load.pose, load.resistance) for load in model._loads] if model._loads else (),
        () if model._movers is None else tuple(map(BYTES, model._movers.poses)),
        [field.changes for field in model._fields.values()] if model._fields else (),
    )
