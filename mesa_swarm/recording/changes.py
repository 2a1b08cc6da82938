"""Manual changes between steps: their detection, and interventions as stored."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from operator import is_not
from typing import Any, NamedTuple

import numpy as np
from mesa import Agent
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.kernels.part import STORED, Itself, Part
from mesa_swarm.model.bodies_part import POSES
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import quick_fingerprint
from mesa_swarm.recording.layout import population_of
from mesa_swarm.recording.schema import checked_content
from mesa_swarm.recording.sealed_stream import INTERVENTION
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
    remarks = [f"{' and '.join(change.what)} after step {change.step}" for change in interventions[:MOST_NAMED]]
    more = len(interventions) - len(remarks)
    remarks += [f"and more after {more} other steps"] if more else []
    states = "state" if len(interventions) == 1 else "states"
    return f"; changed by hand: {', '.join(remarks)} (continued from the stored {states})"


AGENTS, OF_AGENTS = "set of other agents", "place or attributes of other agents"
# What a change of the set of robots, obstacles or fires changes of other parts as well is not named.
SET, SAME = "set of robots, obstacles or fires", "an attribute set to the value that it had"
DECLARED = ("state of ", "events", "process ")
# Values of attributes that may be changed in place.
IN_PLACE = (np.ndarray, list, dict, set)


class ChangeDetector:
    """Change detection between steps, in a few microseconds.

    Detected are robots, obstacles, loads, fires, processes, parts and other agents that were added or removed; what
    each part marks (`mark`): whatever handles set, columns that were written directly, bodies that were moved, values
    of fields, settings that were replaced, values of `model.state`; of parts that were added all columns and what they
    store. Besides every other attribute of the model and of other agents that was replaced; arrays, lists, dicts and
    sets of other agents that were changed in place.

    Not detected are draws from the model's random streams; changes within an attribute of the model, such as a list,
    an array, a learner or the memory of a layer; attributes that robots and bodies were given. What a failed step has
    left behind is reported like a change by hand.
    """

    __slots__ = ("_agents", "_attributes", "_marks")

    def __init__(self, model: EngineModel) -> None:
        self._marks = _marks_of(model)
        self._agents = [_AgentRecord.of(agent) for agent in _other_agents(model)]
        self._attributes = model.own_attributes

    def changes(self, model: EngineModel) -> list[str]:
        """Return the names of what has changed in the model, an empty list if nothing has."""
        marks, attributes = _marks_of(model), model.own_attributes
        of_agents = self._of_others(model)
        # Nothing was replaced, as a rule: seen at once where names stand in the same order.
        differs = any(map(is_not, self._attributes.values(), attributes.values()))
        if marks == self._marks and not of_agents and not differs and len(attributes) == len(self._attributes):
            return []
        was = self._attributes
        names = [name.lstrip("_") for name in {**was, **attributes} if not _same(name, was, attributes)]
        replacements, writings, declarations = self._of_parts(marks)
        names += [*replacements, *writings, *of_agents, *declarations]
        return names or ([SAME] if marks != self._marks else [])

    def _of_parts(self, marks: dict[str, Any]) -> tuple[list[str], list[str], list[str]]:
        """Return the names of what was replaced, written, and declared."""
        was = self._marks
        names = [name for name in {**was, **marks} if name not in was or name not in marks or was[name] != marks[name]]
        replacements = [name for name in names if isinstance(marks.get(name, was.get(name)), Itself)]
        declarations = [name for name in names if name.startswith(DECLARED)]
        writings = [name for name in names if name not in (SAME, *replacements, *declarations)]
        if SET in writings:  # all columns have other rows then
            writings = [SET]
        return replacements, writings, sorted(declarations, key=lambda name: name.startswith(DECLARED[-1]))

    def _of_others(self, model: EngineModel) -> list[str]:
        """Return what has changed in agents other than robots and bodies."""
        agents = _other_agents(model)
        if len(agents) != len(self._agents):
            return [AGENTS]
        if all(record.is_same(agent) for record, agent in zip(self._agents, agents, strict=True)):
            return []
        return [
            AGENTS
            if any(record.agent is not agent for record, agent in zip(self._agents, agents, strict=True))
            else OF_AGENTS
        ]

    def find_moved(self, model: EngineModel) -> np.ndarray | None:
        """Return the rows of the driven bodies that were sent elsewhere, None if any has been put elsewhere already."""
        *poses, aim, aim_heading = self._marks[POSES]
        movers = model.movers
        if poses != [movers.position.tobytes(), movers.heading.tobytes()]:
            return None
        has_other_aim = (movers.aim != np.frombuffer(aim).reshape(-1, 2)).any(axis=1)
        return np.flatnonzero(has_other_aim | (movers.aim_heading != np.frombuffer(aim_heading)))


def _marks_of(model: EngineModel) -> dict[str, Any]:
    """Return what each part marks, by a few words, and the settings of the model itself."""
    robots = model.swarm.agents
    marks: dict[str, Any] = {
        SET: (len(robots), robots[-1].unique_id if robots else 0, population_of(model)[1:]),
        "running": model.running,
        "scale": model.scale,
        "collect_every": model.collect_every,
    }
    for name, part in model.parts.items():
        mark = getattr(part, "mark", None)
        marks |= _mark_of(name, part) if mark is None else mark()
    return marks


def _mark_of(name: str, part: Part) -> dict[str, Any]:
    """Return what is marked of a part that was added: its columns, and all that it stores."""
    columns = part.columns().items()
    marks = {f"{key} of {name}": quick_fingerprint(column.array) for key, column in columns if column.role in STORED}
    return {**marks, f"state of {name}": quick_fingerprint(part.store())}


class _AgentRecord(NamedTuple):
    """An agent as it was: its attributes, what those hold that can be changed in place, and its place in the space."""

    agent: Agent
    attributes: dict[str, Any]
    contents: list[bytes]
    place: list[float] | None

    @classmethod
    def of(cls, agent: Agent) -> "_AgentRecord":
        return cls(agent, vars(agent).copy(), _contents_of(agent), _place_of(agent))

    def is_same(self, agent: Agent) -> bool:
        was, now = self.attributes, vars(agent)
        if agent is not self.agent or len(was) != len(now) or _place_of(agent) != self.place:
            return False
        if not all(name in was and was[name] is value for name, value in now.items()):
            return False
        return _contents_of(agent) == self.contents


def _other_agents(model: EngineModel) -> list[Agent]:
    """Return the agents that are neither robots nor bodies, of most models none."""
    kinds = [kind for kind in model.agents_by_type if not issubclass(kind, ArenaAgent)]
    return [agent for kind in kinds for agent in model.agents_by_type[kind]] if kinds else []


def _contents_of(agent: Agent) -> list[bytes]:
    """Return a fingerprint of each attribute of an agent that may change in place."""
    return [quick_fingerprint(value) for value in vars(agent).values() if isinstance(value, IN_PLACE)]


def _place_of(agent: Agent) -> list[float] | None:
    if not isinstance(agent, ContinuousSpaceAgent) or agent.space is None:
        return None
    return agent.position.tolist()


def _same(name: str, was: dict, now: dict) -> bool:
    return name in was and name in now and was[name] is now[name]
