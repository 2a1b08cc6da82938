"""What differs from episode to episode: map, number of robots, speed and imperfections, drawn or given to `reset`."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    UnknownNameError,
    check_count,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.imperfections import MEASURED, Imperfections

FASTEST = 100.0
# What `reset(options=...)` may fix for one episode.
OPTIONS = ("map", "n_robots", "speed", "imperfection")
MapLike = str | os.PathLike | Map
Maps = Sequence[MapLike] | Callable[[np.random.Generator], Map]
Options = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Conditions:
    """What one episode has been drawn to be: its map, the number of all robots, and two factors.

    Parameters
    ----------
    map : Map
    n_robots : int
    speed : float
        The greatest wheel speed as a share of the design's.
    imperfection : float
        The place of the dial from ideal robots, 0, to 1.

    Examples
    --------
    >>> Conditions(map=Map.load("sparse"), n_robots=5).info
    {'map': 'sparse', 'n_robots': 5, 'speed': 1.0, 'imperfection': 0.0}
    """

    map: Map
    n_robots: int
    speed: float = 1.0
    imperfection: float = 0.0

    @property
    def info(self) -> dict[str, Any]:
        """The conditions as plain values, the map by its name."""
        return {"map": self.map.name, "n_robots": self.n_robots, "speed": self.speed, "imperfection": self.imperfection}


@dataclass(frozen=True, kw_only=True, slots=True)
class Variation:
    """What is drawn anew for every episode, each uniformly and independently of the others.

    Parameters
    ----------
    maps : sequence of str, path or Map, or a function
        Drawn with equal probability; or a function that returns a Map for a NumPy Generator, for maps without end.
        Empty for the task's own map.
    n_robots : (least, most), optional
        Numbers of all robots, both included; by default the task's own number.
    speed : (least, most)
        Factors of the design's `max_speed`, above 0, at most 100.
    imperfection : (least, most)
        Places of the dial from ideal robots, 0, to `imperfections`, 1.
    imperfections : Imperfections
        What robots are at 1; `MEASURED` by default.

    Raises
    ------
    InvalidValueError
        If a pair is not ascending or out of its range, or an entry is of another type.

    Examples
    --------
    >>> variation = Variation(maps=("original", "sparse"), n_robots=(5, 15), speed=(0.8, 1.2))
    >>> drawn = variation.draw(np.random.default_rng(1), map=Map.load("original"), n_robots=10)
    >>> drawn.map.name, drawn.n_robots, round(drawn.speed, 2), drawn.imperfection
    ('sparse', 15, 0.86, 0.0)
    """

    maps: Maps = ()
    n_robots: tuple[int, int] | None = None
    speed: tuple[float, float] = (1.0, 1.0)
    imperfection: tuple[float, float] = (0.0, 0.0)
    imperfections: Imperfections = MEASURED

    def __post_init__(self) -> None:
        """Check every value and load the maps."""
        if not callable(self.maps):
            if isinstance(self.maps, (str, os.PathLike, Map)) or not isinstance(self.maps, Sequence):
                raise InvalidValueError(f"maps is {shortened(self.maps)}; expected a sequence of maps, or a function")
            object.__setattr__(self, "maps", tuple(map(Map.load, self.maps)))
        if self.n_robots is not None:
            least, most = _pair("n_robots", self.n_robots)
            least = check_count("least of n_robots", least, minimum=1)
            object.__setattr__(self, "n_robots", (least, check_count("most of n_robots", most, minimum=least)))
        for name, maximum in (("speed", FASTEST), ("imperfection", 1.0)):
            first, last = _pair(name, getattr(self, name))
            lowest = {"above": 0.0} if name == "speed" else {"minimum": 0.0}
            first = check_number(f"least of {name}", first, maximum=maximum, **lowest)
            last = check_number(f"most of {name}", last, minimum=first, maximum=maximum)
            object.__setattr__(self, name, (first, last))
        if not isinstance(self.imperfections, Imperfections):
            raise InvalidValueError(f"imperfections is {shortened(self.imperfections)}; expected Imperfections(...)")

    def draw(self, rng: np.random.Generator, *, map: Map, n_robots: int) -> Conditions:
        """Return the conditions of an episode of a task with this map and number of robots.

        To vary one of them more does not change what is drawn for the others.
        """
        place, number, speed, imperfection = rng.random(4).tolist()
        least, most = (n_robots, n_robots) if self.n_robots is None else self.n_robots
        return Conditions(
            map=self._map(place, rng, map),
            n_robots=least + int(number * (most + 1 - least)),
            speed=_between(self.speed, speed),
            imperfection=_between(self.imperfection, imperfection),
        )

    def _map(self, share: float, rng: np.random.Generator, usual: Map) -> Map:
        if callable(self.maps):
            chart = self.maps(rng)
            if not isinstance(chart, Map):
                raise InvalidValueError(f"maps returned {shortened(chart)}; expected a Map")
            return chart
        charts: Any = self.maps
        return charts[int(share * len(charts))] if charts else usual


def checked_options(options: Options | None, most: int) -> dict[str, Any]:
    """Return the options of `reset`, any of those of `Conditions`, with the types that they have there.

    Parameters
    ----------
    options : mapping or None
        Any of "map" (name, path or Map), "n_robots" (1 to `most`), "speed" (above 0, at most 100) and "imperfection"
        (0 to 1).
    most : int
        The most robots for which the arrays have room.

    Raises
    ------
    UnknownNameError
        If an option is unknown.
    InvalidValueError

    Examples
    --------
    >>> checked_options({"n_robots": 3, "speed": 1}, most=5)
    {'n_robots': 3, 'speed': 1.0}
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise InvalidValueError(f"options is {shortened(options)}; expected a dict such as {{'map': 'original'}}")
    checks: dict[str, Callable[[Any], Any]] = {
        "map": Map.load,
        "n_robots": lambda value: check_count("option n_robots", value, minimum=1, maximum=most),
        "speed": lambda value: check_number("option speed", value, above=0, maximum=FASTEST),
        "imperfection": lambda value: check_number("option imperfection", value, minimum=0, maximum=1),
    }
    for name in options:
        if name not in checks:
            raise UnknownNameError(unknown_name("option", name, OPTIONS))
    return {name: checks[name](value) for name, value in options.items()}


def _pair(name: str, value: object) -> tuple[Any, Any]:
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise InvalidValueError(f"{name} is {shortened(value)}; expected a pair (least, most)")
    return value[0], value[1]


def _between(pair: tuple[float, float], share: float) -> float:
    """Return the number at a share of the way from the first to the second, never beyond it."""
    return min(pair[0] + share * (pair[1] - pair[0]), pair[1])
