"""Points in the space of a model's parameters: grids, Latin hypercubes and Sobol' sequences."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, overload

import numpy as np
import pandas as pd
import scipy

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.parameters import Parameter, parameters_of

KINDS = ("latin_hypercube", "sobol")
MOST_POINTS = 1_000_000
# scipy has direction numbers for this many.
MOST_RANGES = 1_000
# Values of a parameter that `shortened` gets; it shows fewer.
MOST_SHOWN = 40


@dataclass(frozen=True, slots=True)
class Sample:
    """Points that fill a box of parameters evenly.

    Parameters
    ----------
    kind : {"latin_hypercube", "sobol"}
        A Latin hypercube (McKay, Beckman and Conover, Technometrics 21, 1979) has one point in each of `points`
        slices of every range. A scrambled Sobol' sequence (Sobol', USSR Comput. Math. Math. Phys. 7, 1967; Owen's
        scrambling) is even in several dimensions at once.
    ranges : mapping of str to (low, high)
        Of each parameter; whole numbers where the parameter is one, both ends included.
    points : int
        1 to 1,000,000; a power of two for Sobol'.
    rng : int
        Seed of the sample.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> sample = Sample("sobol", {"n_robots": (5, 8)}, points=4)
    >>> sorted(point["n_robots"] for point in sample.settings(find_model("fire_fighting")))
    [5, 6, 7, 8]
    """

    kind: str
    ranges: Mapping[str, Sequence[float]]
    points: int
    rng: int = 1

    def __post_init__(self) -> None:
        """Check everything that can be checked without the model."""
        check_choice("kind of sample", self.kind, KINDS)
        points = check_count("points", self.points, minimum=1, maximum=MOST_POINTS)
        check_count("rng", self.rng)
        if self.kind == "sobol" and points & (points - 1):
            near = 1 << (points - 1).bit_length()
            raise InvalidValueError(f"points is {points}; expected a power of two for sobol, such as {near}")
        if not isinstance(self.ranges, Mapping):
            raise InvalidValueError(f"ranges is {shortened(self.ranges)}; expected (low, high) by parameter")
        if not 1 <= len(self.ranges) <= MOST_RANGES:
            raise InvalidValueError(f"{len(self.ranges)} ranges are given; expected 1 to {MOST_RANGES}")

    def settings(self, model_class: type) -> list[dict[str, Any]]:
        """Return the points as settings of a model."""
        return list(self.points_of(model_class))

    def points_of(self, model_class: type) -> "Points":
        """Return the same without taking memory for each point."""
        known = parameters_of(model_class)
        for name in self.ranges:
            check_choice(f"parameter of {model_class.__name__}", name, known)
        columns = {
            name: _scaled(known[name], ends, shares)
            for (name, ends), shares in zip(self.ranges.items(), self._shares().T, strict=True)
        }
        return Points(columns, crossed=False)

    def _shares(self) -> np.ndarray:
        """Return the points in the unit box, shape (points, ranges)."""
        rng = np.random.default_rng(self.rng)
        designs = scipy.stats.qmc  # scipy imports it now: processes that only run models do not wait for it
        sampler = designs.Sobol if self.kind == "sobol" else designs.LatinHypercube
        return sampler(len(self.ranges), rng=rng).random(self.points)


class Points(Sequence[dict[str, Any]]):
    """Points of a grid or a sample, each made when it is read: a million of them take no memory.

    Crossed columns make a grid: every value meets every other, the last name varying fastest. Others are read side by
    side.
    """

    def __init__(self, columns: Mapping[str, Sequence | np.ndarray], *, crossed: bool) -> None:
        self._columns, self._crossed = dict(columns), crossed
        lengths = [len(column) for column in columns.values()]
        self._length = prod(lengths) if crossed else min(lengths, default=0)

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, index: int) -> dict[str, Any]: ...

    @overload
    def __getitem__(self, index: slice) -> list[dict[str, Any]]: ...

    def __getitem__(self, index: int | slice) -> dict[str, Any] | list[dict[str, Any]]:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        row = range(len(self))[index]
        places = dict.fromkeys(self._columns, row)
        for name in reversed(self._columns) if self._crossed else ():
            row, places[name] = divmod(row, len(self._columns[name]))
        return {name: _plain(column[places[name]]) for name, column in self._columns.items()}

    def __eq__(self, other: object) -> bool:
        """Whether there are the same points in the same order, also in a list of them."""
        if not isinstance(other, (Points, list)):
            return NotImplemented
        return len(self) == len(other) and all(one == another for one, another in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]  # as that of a list

    def __repr__(self) -> str:
        shown = ", ".join(f"{name!r}: {shortened(column[:MOST_SHOWN])}" for name, column in self._columns.items())
        return f"Points({{{shown}}}, crossed={self._crossed})"


def grid(model_class: type, values: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return every combination of the values as settings of a model; the last name varies fastest.

    Parameters
    ----------
    model_class : type
    values : mapping of str to sequence, array or Series
        Different values of each parameter, at least one.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> grid(find_model("fire_fighting"), {"strategy": ["A", "B"], "n_robots": [5]})
    [{'strategy': 'A', 'n_robots': 5}, {'strategy': 'B', 'n_robots': 5}]
    """
    return list(Points(grid_columns(model_class, values), crossed=True))


def grid_columns(model_class: type, values: Mapping[str, Any]) -> dict[str, list]:
    """Return the checked values of each parameter of a grid, which has not too many points."""
    columns = {name: list(_values(model_class, name, listed)) for name, listed in values.items()}
    size = prod(map(len, columns.values()))
    if size > MOST_POINTS:
        shown = f"{size:,}" if size < 1e15 else "more than 1e15"
        raise InvalidValueError(f"the grid has {shown} points; expected at most {MOST_POINTS:,}")
    return columns


def _values(model_class: type, name: str, listed: Any) -> Iterator[Any]:
    """Yield the values of one parameter of a grid, checked."""
    known = parameters_of(model_class)
    check_choice(f"parameter of {model_class.__name__}", name, known)
    values = as_list(listed)
    if isinstance(values, (str, bytes)) or not isinstance(values, Sequence) or not values:
        raise InvalidValueError(f"{name} is {shortened(listed)}; expected a list of values")
    if len(values) > MOST_POINTS:
        raise InvalidValueError(f"{name} has {len(values):,} values; expected at most {MOST_POINTS:,}")
    seen: set[Any] = set()
    others: list[Any] = []  # values without a hash, such as objects of a user's class
    for value in values:
        checked = known[name].checked(value)
        try:
            is_twice = (same := _hashable(checked)) in seen
            seen.add(same)
        except TypeError:
            is_twice = checked in others
            others.append(checked)
        if is_twice:
            raise InvalidValueError(f"{name} has {shortened(value)} twice; expected different values")
        yield checked


def as_list(values: object) -> object:
    """Return the values of an array or series as a list of Python's own, anything else as it is."""
    return values.tolist() if isinstance(values, (np.ndarray, pd.Series, pd.Index)) else values


def _hashable(value: Any) -> Any:
    """Return a hashable value for lists, tuples and dicts, equal where they are equal."""
    if isinstance(value, (list, tuple)):
        return isinstance(value, list), tuple(map(_hashable, value))
    if isinstance(value, dict):
        return dict, frozenset((key, _hashable(item)) for key, item in value.items())
    return value


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _scaled(parameter: Parameter, ends: object, shares: np.ndarray) -> np.ndarray:
    """Return shares of a range as values in it."""
    ends = as_list(ends)
    if parameter.kind not in (int, float):
        raise InvalidValueError(f"{parameter.name} is not a number; expected one, or put its values into a grid")
    if isinstance(ends, (str, bytes)) or not isinstance(ends, Sequence) or len(ends) != 2:
        raise InvalidValueError(f"range of {parameter.name} is {shortened(ends)}; expected [low, high]")
    low, high = (parameter.checked(end) for end in ends)
    width = check_number(f"width of the range of {parameter.name}", high - low, above=0)
    if parameter.kind is float:
        return low + shares * width
    return low + np.floor(shares * (width + 1)).astype(int)
