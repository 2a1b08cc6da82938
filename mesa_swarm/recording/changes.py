"""Changes made by hand between steps: their detection, and interventions as stored."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from operator import is_not, itemgetter
from typing import Any

import numpy as np

from mesa_swarm.errors import RecordingError
from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.layout import population_of
from mesa_swarm.recording.schema import checked_intervention

MOST_TOLD = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class Intervention:
    """What was changed by hand after a step, and before the next one.

    Parameters
    ----------
    step : int
    what : tuple of str
        In words, see `Mark`.
    why_not : str
        Why the state after it was not stored; empty if it was.
    checkpoint : int or None
        Place of that state among `Recording.checkpoints`, None if there is none.

    Examples
    --------
    >>> print(Intervention(step=20, what=("control", "heading of robots")))
    after step 20 somebody changed control, heading of robots
    """

    step: int
    what: tuple[str, ...]
    why_not: str = ""
    checkpoint: int | None = None

    def __str__(self) -> str:
        return f"after step {self.step} somebody changed {', '.join(self.what)}"


def intervention_to_json(what: Sequence[str], why_not: str) -> bytes:
    """Return what a recording keeps of an intervention.

    Examples
    --------
    >>> intervention_to_json(["control"], "")
    b'{"what": ["control"], "why_not": ""}'
    """
    return json.dumps({"what": list(what), "why_not": why_not}).encode()


def intervention_from_json(step: int, content: bytes, checkpoint: int | None) -> Intervention:
    """Return the intervention that was kept.

    Raises
    ------
    RecordingError
        If it is none.
    """
    try:
        told = checked_intervention(content)
        what, why_not = tuple(told["what"]), told["why_not"]
    except ValueError:
        raise RecordingError(f"what was changed by hand after step {step} is not told") from None
    why_not = why_not or ("" if checkpoint is not None else "the recording ends before it")
    return Intervention(step=step, what=what, why_not=why_not, checkpoint=checkpoint)


def in_words(interventions: Sequence[Intervention]) -> str:
    """Return what must be said beside a verdict: nothing if nobody intervened.

    Examples
    --------
    >>> in_words([Intervention(step=20, what=("control",)), Intervention(step=30, what=("running",))])
    '; by hand were changed control after step 20, running after step 30, each time the stored state was taken'
    >>> in_words([])
    ''
    """
    if not interventions:
        return ""
    told = [f"{' and '.join(one.what)} after step {one.step}" for one in interventions[:MOST_TOLD]]
    more = len(interventions) - len(told)
    told += [f"and more after {more} other steps"] if more else []
    taken = "where the stored state was taken" if len(interventions) == 1 else "each time the stored state was taken"
    return f"; by hand were changed {', '.join(told)}, {taken}"


# Columns that handles set, and the commands of the wheels, which stay where nothing decides.
OF_ROBOTS = ("position", "heading", "command", "max_speed", "tendency", "temperature")
OF_FIRES = ("temperature", "out")
WORDS = (
    "which robots, obstacles or fires there are",
    "something that was set to what it was",
    *(f"{name} of robots" for name in OF_ROBOTS),
    *(f"{name} of fires" for name in OF_FIRES),
    "pose or resistance of loads",
)
ROBOTS, FIRES, BYTES = itemgetter(*OF_ROBOTS), itemgetter(*OF_FIRES), np.ndarray.tobytes
# Attributes of a model that change when it is looked at or when Mesa counts a step, and on which no step depends.
LOOKED_AT = frozenset(
    (
        *("steps", "_time", "time", "_sensed", "_noise", "_scene", "_scene_table", "_senses", "_senses_version"),
        *("_snapshots", "observers", "datacollector", "_collect_every", "_batch_context", "_suppress", "subscribers"),
        *("agent_id_counter",),
    )
)


class Mark:
    """What a model is like after a step, as far as a few microseconds can tell.

    Noticed are robots, obstacles, loads and fires that come or go; whatever their handles set, columns of
    `OF_ROBOTS` and `OF_FIRES` that are written directly, and loads that are laid elsewhere; every attribute of the
    model that is replaced: `control`, `fire_constants`, `imperfections`, `communication`, a number, a text.

    Not noticed are attributes that change when a model is looked at (`LOOKED_AT`), as its data collector; draws from
    the model's random streams; what changes within an attribute, as a list, an array, a learner or the memory of a
    layer; other columns that are written directly; what is written onto agents. What a step that failed has left is
    noticed as if somebody had changed it.

    Parameters
    ----------
    model : FireModel

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> (robot,) = model.add_robots(AGENT9, 1)
    >>> mark = Mark(model)
    >>> model.sense()
    >>> mark.changes(model)
    []
    >>> robot.heading, model.extinguish_range = 0.5, 20.0
    >>> mark.changes(model)
    ['extinguish_range', 'heading of robots']
    """

    __slots__ = ("_attributes", "_things")

    def __init__(self, model: FireModel) -> None:
        self._things = _things(model)
        self._attributes = model.__dict__.copy()

    def changes(self, model: FireModel) -> list[str]:
        """Return in words what of the model is other now, an empty list if nothing is."""
        was, now, things = self._attributes, model.__dict__, _things(model)
        # Nothing was replaced, as a rule: seen at once where names stand in the same order.
        replaced = compress(now, map(is_not, was.values(), now.values()))
        if things == self._things and len(was) == len(now) and LOOKED_AT.issuperset(replaced):
            return []
        names = [name for name in {**was, **now} if name not in LOOKED_AT and not _same(name, was, now)]
        words = [name.lstrip("_") for name in names] + self._in_words(things)
        return words or ([WORDS[1]] if things != self._things else [])

    def _in_words(self, things: tuple) -> list[str]:
        different = [word for word, was, now in zip(WORDS, self._things, things, strict=True) if was != now]
        if WORDS[0] in different:  # all columns have other rows then
            return [WORDS[0]]
        return [word for word in different if word != WORDS[1]]


def _same(name: str, was: dict, now: dict) -> bool:
    return name in was and name in now and was[name] is now[name]


def _things(model: FireModel) -> tuple[Any, ...]:
    """Return what is compared of robots, fires and loads, in the order of `WORDS`."""
    swarm, agents = model.swarm, model.swarm.agents
    version, *others = population_of(model)
    return (
        (len(agents), agents[-1].unique_id if agents else 0, others),
        (swarm.disturbed, version),
        *map(BYTES, ROBOTS(swarm.columns)),
        *map(BYTES, FIRES(model.fires.columns)),
        [(load.pose, load.resistance) for load in model._loads] if model._loads else (),
    )
