"""Points in the space of a model's parameters: ranges, grids, Latin hypercubes and Sobol' sequences."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any, overload

import numpy as np
import pandas as pd
import scipy

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.base.wording import in_brief
from mesa_swarm.model.parameters import Parameter, parameters_of

KINDS = ("latin_hypercube", "sobol")
MOST_POINTS = 1_000_000
# scipy has direction numbers for this many.
MOST_RANGES = 1_000
# Values of a parameter that `shortened` gets; it shows fewer.
MOST_SHOWN = 40


@dataclass(frozen=True, kw_only=True, slots=True)
class Range:
    """Where a parameter may lie: between two ends, on a linear or a logarithmic scale, or at one of some values.

    Whatever takes ranges also takes ``(low, high)``, ``(low, high, "log")``, and of a parameter that is not a number
    its values.

    Parameters
    ----------
    low, high : float or int
        The ends, both included; whole numbers where the parameter is one. Of a logarithmic range both are above 0.
    log : bool
        Whether equal ratios, and not equal differences, are equally probable.
    values : tuple
        At least two different values, equally probable, in place of the ends.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> Range(low=1.0, high=100.0, log=True).at(np.array([0.0, 0.5, 1.0])).tolist()
    [1.0, 10.0, 100.0]
    >>> Range(low=1, high=4).at(np.array([0.0, 0.3, 1.0])).tolist()
    [1, 2, 4]
    >>> Range(values=("A", "B")).at(np.array([0.2, 0.7]))
    ['A', 'B']
    """

    low: float | None = None
    high: float | None = None
    log: bool = False
    values: tuple = ()

    def __post_init__(self) -> None:
        """Check what can be checked without the parameter."""
        if (self.low is None or self.high is None) == (not self.values):
            raise InvalidValueError(f"{self!r} is not a range; give low and high, or values")
        if self.values and self.log:
            raise InvalidValueError(f"{self!r} is not a range; log is for one with ends")
        if len(self.values) == 1:
            raise InvalidValueError(f"a range has only the value {shortened(self.values[0])}; expected at least two")

    @property
    def is_whole(self) -> bool:
        """Whether it holds whole numbers between two ends."""
        return isinstance(self.low, int)

    def at(self, shares: np.ndarray) -> Sequence | np.ndarray:
        """Return the values at shares of the range, 0 to 1, whole numbers and listed values in equal parts of it."""
        if self.low is None or self.high is None:
            places = np.minimum((shares * len(self.values)).astype(int), len(self.values) - 1)
            return [self.values[place] for place in places.tolist()]
        low, high = self.low, self.high + self.is_whole
        numbers = low * (high / low) ** shares if self.log else low + shares * (high - low)
        return np.minimum(np.floor(numbers).astype(int), self.high) if self.is_whole else numbers

    def of(self, parameter: Parameter) -> "Range":
        """Return this range as one of a parameter, with its type; refuse what it cannot be."""
        name = f"range of {parameter.name}"
        if self.low is None or self.high is None:
            values = tuple(map(parameter.checked, self.values))
            if any(value in values[:i] for i, value in enumerate(values)):
                raise InvalidValueError(f"{name} is {shortened(self.values)}; expected different values")
            return replace(self, values=values)
        low, high = parameter.checked(self.low), parameter.checked(self.high)
        if not low < high:
            raise InvalidValueError(f"{name} is {low:g} to {high:g}; expected the lower end first")
        if self.log:
            check_number(f"lower end of the logarithmic {name}", low, above=0)
        return replace(self, low=low, high=high)


def range_text(each: Range) -> str:
    """Return a range as a user would write it.

    Examples
    --------
    >>> range_text(Range(low=0.1, high=0.3, log=True)), range_text(Range(values=("A", "B")))
    ('0.1 to 0.3, log', 'A, B')
    """
    if each.values:
        return ", ".join(map(in_brief, each.values))
    return f"{in_brief(each.low)} to {in_brief(each.high)}{', log' if each.log else ''}"


def checked_ranges(model_class: type, ranges: object) -> dict[str, Range]:
    """Return ranges of a model's parameters by name, checked.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> checked_ranges(find_model("fire_fighting"), {"n_robots": (5, 8)})["n_robots"].high
    8
    """
    if not isinstance(ranges, Mapping) or not 1 <= len(ranges) <= MOST_RANGES:
        raise InvalidValueError(
            f"ranges is {shortened(ranges)}; expected (low, high) of 1 to {MOST_RANGES} parameters by name"
        )
    known = parameters_of(model_class)
    for name in ranges:
        check_choice(f"parameter of {model_class.__name__}", name, known)
    return {name: _range(known[name], given) for name, given in ranges.items()}


def _range(parameter: Parameter, given: Any) -> Range:
    """Return a range of a parameter, of which the ends or the values may be given as a sequence."""
    if isinstance(given, Range):
        return given.of(parameter)
    given = as_list(given)
    if isinstance(given, (str, bytes)) or not isinstance(given, Sequence):
        raise InvalidValueError(f"range of {parameter.name} is {shortened(given)}; expected [low, high]")
    if parameter.kind not in (int, float):
        return Range(values=tuple(given)).of(parameter)
    log = len(given) == 3 and isinstance(given[2], str) and given[2] == "log"
    if not log and len(given) != 2:
        raise InvalidValueError(
            f'range of {parameter.name} is {shortened(given)}; expected [low, high], [low, high, "log"] or '
            "Range(values=...)"
        )
    return Range(low=given[0], high=given[1], log=log).of(parameter)


@dataclass(frozen=True, slots=True)
class Sample:
    """Points that fill a box of parameters evenly.

    Parameters
    ----------
    kind : {"latin_hypercube", "sobol"}
        A Latin hypercube (McKay, Beckman and Conover, Technometrics 21, 1979) has one point in each of `points`
        slices of every range. A scrambled Sobol' sequence (Sobol', USSR Comput. Math. Math. Phys. 7, 1967; Owen's
        scrambling) is even in several dimensions at once.
    ranges : mapping of str to (low, high) or Range
        Of each parameter; whole numbers where the parameter is one, both ends included. Also ``(low, high, "log")``,
        and the values of a parameter that is not a number: see `Range`.
    points : int
        1 to 1,000,000; a power of two for Sobol'.
    rng : int
        Seed of the sample.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> sample = Sample("sobol", {"n_robots": (5, 8)}, points=4)
    >>> sorted(point["n_robots"] for point in sample.settings(find_model("fire_fighting")))
    [5, 6, 7, 8]
    """

    kind: str
    ranges: Mapping[str, Any]
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
        return points_at(checked_ranges(model_class, self.ranges), self._shares())

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


def points_at(ranges: Mapping[str, Range], shares: np.ndarray) -> Points:
    """Return points at shares (points, ranges) of the ranges, each from 0 to 1.

    Examples
    --------
    >>> points_at({"k": Range(low=0.0, high=4.0)}, np.array([[0.5]]))[0]
    {'k': 2.0}
    """
    columns = {name: each.at(column) for (name, each), column in zip(ranges.items(), shares.T, strict=True)}
    return Points(columns, crossed=False)


def grid(model_class: type, values: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return every combination of the values as settings of a model; the last name varies fastest.

    Parameters
    ----------
    model_class : type
    values : mapping of str to sequence, array or Series
        Different values of each parameter, at least one.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> grid(find_model("fire_fighting"), {"strategy": ["A", "B"], "n_robots": [5]})
    [{'strategy': 'A', 'n_robots': 5}, {'strategy': 'B', 'n_robots': 5}]
    """
    return list(Points(grid_columns(model_class, values), crossed=True))


def grid_columns(model_class: type, values: Mapping[str, Any]) -> dict[str, list]:
    """Return the checked values of each parameter of a grid, which has not too many points."""
    columns = {name: _values(model_class, name, listed) for name, listed in values.items()}
    size = prod(map(len, columns.values()))
    if size > MOST_POINTS:
        shown = f"{size:,}" if size < 1e15 else "more than 1e15"
        raise InvalidValueError(f"the grid has {shown} points; expected at most {MOST_POINTS:,}")
    return columns


def _values(model_class: type, name: str, listed: Any) -> list[Any]:
    """Return the values of one parameter of a grid, checked."""
    known = parameters_of(model_class)
    check_choice(f"parameter of {model_class.__name__}", name, known)
    values = as_list(listed)
    if isinstance(values, (str, bytes)) or not isinstance(values, Sequence) or not values:
        raise InvalidValueError(f"{name} is {shortened(listed)}; expected a list of values")
    if len(values) > MOST_POINTS:
        raise InvalidValueError(f"{name} has {len(values):,} values; expected at most {MOST_POINTS:,}")
    return check_different(name, map(known[name].checked, values))


def check_different(name: str, values: Iterable[Any], what: str = "values") -> list[Any]:
    """Return values as a list, or refuse them if two are equal.

    Examples
    --------
    >>> check_different("n_robots", [3, 4, 3])
    Traceback (most recent call last):
    ...
    mesa_swarm.base.errors.InvalidValueError: n_robots has 3 twice; expected different values
    """
    seen: set[Any] = set()
    others: list[Any] = []  # values without a hash, such as objects of a user's class
    listed = []
    for value in values:
        try:
            is_twice = (same := _hashable(value)) in seen
            seen.add(same)
        except TypeError:
            is_twice = any(_is_same(value, other) for other in others)
            others.append(value)
        if is_twice:
            raise InvalidValueError(f"{name} has {shortened(value)} twice; expected different {what}")
        listed.append(value)
    return listed


def _is_same(value: Any, other: Any) -> bool:
    """Return whether two values are equal, also if they are arrays."""
    if isinstance(value, np.ndarray) or isinstance(other, np.ndarray):
        return bool(np.array_equal(value, other))
    return bool(value == other)


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
