"""A cheap look at a model after a step, which tells before the next one what somebody has changed in between."""

from itertools import compress
from operator import is_not, itemgetter
from typing import Any

import numpy as np

from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.layout import population_of

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
    model : ObservedWorld

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

    def __init__(self, model: ObservedWorld) -> None:
        self._things = _things(model)
        self._attributes = model.__dict__.copy()

    def changes(self, model: ObservedWorld) -> list[str]:
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


def _things(model: ObservedWorld) -> tuple[Any, ...]:
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
