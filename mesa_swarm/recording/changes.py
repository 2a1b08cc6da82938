"""Manual changes between steps: their detection, and as stored: interventions, and where driven bodies were sent."""

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
from mesa_swarm.recording.container import Checkpoint, from_bytes, to_bytes
from mesa_swarm.recording.objects import other_agents, summary
from mesa_swarm.recording.schema import checked_content
from mesa_swarm.recording.sealed_stream import INTERVENTION

MOST_NAMED = 5
# Poses in one piece of a file, 1.3 MB in memory.
MOST_POSES = 1 << 15
AGENTS, OF_AGENTS = "set of other agents", "place or attributes of other agents"
# What a change of the set of robots, obstacles or fires changes of other parts as well is not named.
SET, SAME = "set of robots, obstacles or fires", "an attribute set to the value that it had"
DECLARED = ("state of ", "events", "process ")
# Values of attributes that may be changed in place.
IN_PLACE = (np.ndarray, list, dict, set)


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


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class HandMove:
    """Where driven bodies were sent by hand after a step, and before the next one.

    Parameters
    ----------
    step : int
    after : int
        How many complete states had been stored before, so that a move is not repeated on a state that includes it.
    bodies : int64 ndarray, shape (k,)
        unique_ids.
    poses : ndarray, shape (k, 3)
        x, y, heading.
    """

    step: int
    after: int
    bodies: np.ndarray
    poses: np.ndarray

    def apply(self, model: EngineModel) -> None:
        """Send the bodies of a model there, which has to have them."""
        table = model.parts.bodies.table
        rows = {body.unique_id: body.row for body in model.movers.agents}
        low, high = model.space.dimensions.T
        places, headings = self.poses[:, :2], self.poses[:, 2]
        if not rows.keys() >= set(self.bodies.tolist()):
            raise RecordingError(f"step {self.step + 1} cannot be run again: a body that was moved by hand is missing")
        if not ((places >= low) & (places <= high)).all() or not (np.abs(headings) <= np.pi).all():
            raise RecordingError(f"step {self.step + 1} cannot be run again: a body was moved off the map")
        body_rows = [rows[body] for body in self.bodies.tolist()]
        table.aim[body_rows], table.aim_heading[body_rows] = places, headings


def move_of(model: EngineModel, rows: np.ndarray, after: int) -> HandMove:
    """Return where driven bodies, by their rows, are to go in the next step."""
    movers = model.movers
    poses = np.column_stack([movers.aim[rows], movers.aim_heading[rows]])
    bodies = np.array([movers.agents[row].unique_id for row in rows.tolist()], np.int64)
    return HandMove(step=model.completed, after=after, bodies=bodies, poses=poses)


def moves_to_bytes(moves: Sequence[HandMove]) -> bytes:
    """Return moves as stored."""
    heads = np.array([[move.step, move.after, len(move.bodies)] for move in moves], np.int64)
    bodies, poses = (np.concatenate([getattr(move, name) for move in moves]) for name in ("bodies", "poses"))
    return to_bytes(Checkpoint(step=moves[0].step, state_hash="", facts={}, arrays=[heads, bodies, poses]))


def moves_from_bytes(content: bytes) -> list[HandMove]:
    """Return stored moves, checked but for what only the model knows."""
    try:
        heads, bodies, poses = from_bytes(content).arrays
        _check_stored(heads, bodies, poses)
    except ValueError:
        raise RecordingError("moves made by hand cannot be decoded") from None
    ends = np.cumsum(heads[:, 2]).tolist()
    return [
        HandMove(step=step, after=after, bodies=bodies[end - count : end], poses=poses[end - count : end])
        for (step, after, count), end in zip(heads.tolist(), ends, strict=True)
    ]


def _check_stored(heads: np.ndarray, bodies: np.ndarray, poses: np.ndarray) -> None:
    kinds = [(array.dtype.str, array.ndim) for array in (heads, bodies, poses)]
    if kinds != [("<i8", 2), ("<i8", 1), ("<f8", 2)] or heads.shape[1:] != (3,) or poses.shape != (len(bodies), 3):
        raise ValueError
    is_ordered = (np.diff(heads[:, :2], axis=0) >= 0).all()
    if not is_ordered or (heads < 0).any() or (heads[:, 2] > len(bodies)).any() or heads[:, 2].sum() != len(bodies):
        raise ValueError


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
        self._agents = [_AgentRecord.of(agent) for agent in other_agents(model)]
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
        agents, records = other_agents(model), self._agents
        if len(agents) != len(records) or any(map(is_not, agents, (record.agent for record in records))):
            return [AGENTS]
        return [] if all(map(_AgentRecord.is_same, records, agents)) else [OF_AGENTS]

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
    marks: dict[str, Any] = {
        SET: summary(model),
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
        if was.keys() != now.keys() or any(was[name] is not value for name, value in now.items()):
            return False
        return (self.contents, self.place) == (_contents_of(agent), _place_of(agent))


def _contents_of(agent: Agent) -> list[bytes]:
    """Return a fingerprint of each attribute of an agent that may change in place."""
    return [quick_fingerprint(value) for value in vars(agent).values() if isinstance(value, IN_PLACE)]


def _place_of(agent: Agent) -> list[float] | None:
    if not isinstance(agent, ContinuousSpaceAgent) or agent.space is None:
        return None
    return agent.position.tolist()


def _same(name: str, was: dict, now: dict) -> bool:
    return name in was and name in now and was[name] is now[name]
