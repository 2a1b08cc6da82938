"""Points in the space of a model's parameters: grids, Latin hypercubes and Sobol' sequences."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np
from scipy.stats import qmc

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.experiments.plan import as_list
from mesa_swarm.parameters import Parameter, parameters_of

KINDS = ("latin_hypercube", "sobol")
MOST_POINTS = 1_000_000
# scipy's direction numbers go so far.
MOST_RANGES = 1_000


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

    Raises
    ------
    InvalidValueError, UnknownNameError

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
        if not 1 <= len(self.ranges) <= MOST_RANGES:
            raise InvalidValueError(f"{len(self.ranges)} ranges are given; expected 1 to {MOST_RANGES}")

    def settings(self, model_class: type) -> list[dict[str, Any]]:
        """Return the points as settings of a model."""
        known = parameters_of(model_class)
        for name in self.ranges:
            check_choice(f"parameter of {model_class.__name__}", name, known)
        columns = [
            _scaled(known[name], ends, shares)
            for (name, ends), shares in zip(self.ranges.items(), self._shares().T, strict=True)
        ]
        return [dict(zip(self.ranges, row, strict=True)) for row in zip(*columns, strict=True)]

    def _shares(self) -> np.ndarray:
        """Return the points in the unit box, shape (points, ranges)."""
        rng = np.random.default_rng(self.rng)
        sampler = qmc.Sobol if self.kind == "sobol" else qmc.LatinHypercube
        return sampler(len(self.ranges), rng=rng).random(self.points)


def grid(model_class: type, values: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return every combination of the values as settings of a model; the last name varies fastest.

    Parameters
    ----------
    model_class : type
    values : mapping of str to sequence, array or Series
        Different values of each parameter, at least one.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> grid(find_model("fire_fighting"), {"strategy": ["A", "B"], "n_robots": [5]})
    [{'strategy': 'A', 'n_robots': 5}, {'strategy': 'B', 'n_robots': 5}]
    """
    columns = {name: list(_values(model_class, name, listed)) for name, listed in values.items()}
    size = prod(map(len, columns.values()))
    if size > MOST_POINTS:
        raise InvalidValueError(f"the grid has {size:.3g} points; expected at most {MOST_POINTS:,}")
    return [dict(zip(columns, row, strict=True)) for row in product(*columns.values())]


def _values(model_class: type, name: str, listed: Any) -> Iterator[Any]:
    """Yield the values of one parameter of a grid, checked."""
    known = parameters_of(model_class)
    check_choice(f"parameter of {model_class.__name__}", name, known)
    values = as_list(listed)
    if isinstance(values, (str, bytes)) or not isinstance(values, Sequence) or not values:
        raise InvalidValueError(f"{name} is {shortened(listed)}; expected a list of values")
    seen: list[Any] = []
    for value in values:
        checked = known[name].checked(value)
        if checked in seen:
            raise InvalidValueError(f"{name} has {shortened(value)} twice; expected different values")
        seen.append(checked)
        yield checked


def _scaled(parameter: Parameter, ends: object, shares: np.ndarray) -> list[Any]:
    """Return shares of a range as values in it."""
    ends = as_list(ends)
    if parameter.kind not in (int, float):
        raise InvalidValueError(f"{parameter.name} is no number; expected one, or put its values into a grid")
    if isinstance(ends, (str, bytes)) or not isinstance(ends, Sequence) or len(ends) != 2:
        raise InvalidValueError(f"range of {parameter.name} is {shortened(ends)}; expected [low, high]")
    low, high = (parameter.checked(end) for end in ends)
    width = check_number(f"width of the range of {parameter.name}", high - low, above=0)
    if parameter.kind is float:
        return (low + shares * width).tolist()
    return (low + np.floor(shares * (width + 1)).astype(int)).tolist()
