"""What a comparison will do, checked before any of it is done."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from mesa_swarm.errors import (
    InvalidValueError,
    UnknownNameError,
    check_choice,
    check_count,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.gallery import find_model
from mesa_swarm.parameters import Choice, parameters_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.final_state import FinalState, final_state_of

MOST_SEEDS = 100_000
# Seeds are told apart as floats are, in tables and in TOML of other programs.
LARGEST_SEED = 2**53 - 1
MOST_STEPS = 100_000_000
MOST_VALUES = 100
DEFAULT_STEPS = 3_000
# NumPy has no numbers for larger whole ones.
LARGEST_WHOLE = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Run:
    """One run: with which value and seed, for how many steps, and what came of it.

    Parameters
    ----------
    value
        Of the parameter that is compared.
    rng, steps : int
        Its seed, and the steps that it took.
    state_hash : str
        Fingerprint of its final state.
    results : dict of str to float or None
        What the model's ``results`` returned; None means that it did not happen.
    portrait : FinalState, optional
        For figures; of the first seed only.
    """

    value: Any
    rng: int
    steps: int
    state_hash: str
    results: dict[str, float | None]
    portrait: FinalState | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Plan:
    """A model, a parameter, the values that are compared, and over how many seeds and steps.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> plan = checked_plan(find_model("fire_fighting"), seeds=2)
    >>> plan.parameter, plan.values, plan.tasks
    ('strategy', ('A', 'B'), [(1, 'A'), (1, 'B'), (2, 'A'), (2, 'B')])
    """

    model_class: type
    parameter: str
    values: tuple
    seeds: Sequence[int]
    steps: int
    settings: dict[str, Any]
    measures: tuple[str, ...] = ()

    @property
    def tasks(self) -> list[tuple[int, Any]]:
        """Seed and value of every run; every value meets the same seeds."""
        return [(rng, value) for rng in self.seeds for value in self.values]

    def built(self, rng: int, value: Any) -> SwarmModel:
        """Return the model of one run, before its first step."""
        return self.model_class(**self.settings, **{self.parameter: value}, rng=rng)

    def run(self, rng: int, value: Any) -> Run:
        """Do one run."""
        model = self.built(rng, value).run(self.steps)
        portrait = final_state_of(model) if rng == self.seeds[0] else None
        results = model.results()
        kept = numbers_of({name: results[name] for name in self.measures or results})
        return Run(value, rng, model.steps, model.state_hash(), kept, portrait)


def plain(number: Any) -> Any:
    """Return a number of NumPy's as one of Python's, which reads back from a file as the same.

    Examples
    --------
    >>> plain(np.int64(3)), plain(np.array(0.5))
    (3, 0.5)
    """
    return number.item() if isinstance(number, (np.generic, np.ndarray)) and number.ndim == 0 else number


def numbers_of(results: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the results of a run as numbers of Python's, which read back from a file as the same.

    Raises
    ------
    InvalidValueError
        If one of them is no number, or infinite.

    Examples
    --------
    >>> from fractions import Fraction
    >>> numbers_of({"groups": np.int64(3), "share": Fraction(1, 2), "arrived at": None})
    {'groups': 3, 'share': 0.5, 'arrived at': None}
    """
    numbers = {}
    for name, number in results.items():
        simple = plain(number)
        numbers[name] = simple if is_plain(simple) else check_result(name, simple)
    return numbers


def is_plain(number: object) -> bool:
    """Return whether this is what `numbers_of` gives; NaN is, which a run may end in and tables leave out.

    Examples
    --------
    >>> is_plain(None), is_plain(3), is_plain(10**300), is_plain([1.0])
    (True, True, False, False)
    """
    if isinstance(number, float):
        return not math.isinf(number)
    return number is None or (isinstance(number, int) and abs(number) <= LARGEST_WHOLE)


def check_result(name: str, number: object) -> float:
    """Return a result as a float, or refuse it.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> check_result("groups", float("nan"))
    Traceback (most recent call last):
    mesa_swarm.errors.InvalidValueError: result 'groups' is nan; expected a finite number or None
    """
    try:
        return check_number(f"result {shortened(name)}", number)
    except InvalidValueError as error:
        raise InvalidValueError(f"{error} or None") from None


def checked_plan(
    model: type | str,
    parameter: str | None = None,
    values: Iterable | None = None,
    seeds: int | Sequence[int] = 30,
    *,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measures: Sequence[str] = (),
) -> Plan:
    """Return the plan of a comparison, after building the model once with every value.

    Parameters
    ----------
    model : type or str
        A SwarmModel with a method ``results``, or the name of one of the gallery.
    parameter, values
        By default what the model's attribute ``compares`` says; the values of another parameter may be left
        out if it has a `Choice`.
    seeds : int or sequence of int
        Each value is run with rng 1, 2, ... seeds, or with these; at most 100,000.
    steps : int
        By default what the model's attribute ``steps_to_compare`` says, else 3,000.
    settings : mapping
        Other parameters, the same in all runs.
    measures : sequence of str
        The results that are compared, in this order; all of them by default.

    Raises
    ------
    SwarmError
        If anything about it is wrong.
    """
    model_class = checked_class(model)
    settings = dict(settings or {})
    default = getattr(model_class, "steps_to_compare", DEFAULT_STEPS)
    compared, chosen = _checked_values(model_class, parameter, values, settings)
    plan = Plan(
        model_class,
        compared,
        chosen,
        checked_seeds(seeds),
        check_count("steps", default if steps is None else steps, minimum=1, maximum=MOST_STEPS),
        settings,
        checked_measures(measures),
    )
    for value in plan.values:
        built = plan.built(plan.seeds[0], value)
        check_results(model_class, built)
        for name in plan.measures:
            check_choice(f"result of {model_class.__name__}", name, built.results())
    return plan


def checked_class(model: object) -> type:
    """Return the class of a model that is given itself or by its name in the gallery.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> checked_class("fire_fighting").__name__
    'FireFighting'
    """
    model_class = find_model(model) if isinstance(model, str) else model
    if not isinstance(model_class, type):
        raise InvalidValueError(f"model is {shortened(model)}; expected a class or the name of a model")
    return model_class


def checked_seeds(seeds: object) -> Sequence[int]:
    """Return seeds 1, 2, ... for a number of them, or those of a list.

    Examples
    --------
    >>> list(checked_seeds(3)), checked_seeds([7, 5])
    ([1, 2, 3], (7, 5))
    """
    seeds = as_list(seeds)
    if isinstance(seeds, (str, bytes)) or not isinstance(seeds, Sequence):
        return range(1, 1 + check_count("seeds", seeds, minimum=1, maximum=MOST_SEEDS))
    listed = tuple(check_count("seeds", seed, maximum=LARGEST_SEED) for seed in seeds)
    check_count("number of seeds", len(listed), minimum=1, maximum=MOST_SEEDS)
    if len(set(listed)) < len(listed):
        raise InvalidValueError(f"seeds is {shortened(seeds)}; expected different ones")
    return listed


def as_list(values: object) -> object:
    """Return the values of an array or series as a list of Python's own, anything else as it is.

    Examples
    --------
    >>> import numpy as np
    >>> as_list(np.arange(2)), as_list("A")
    ([0, 1], 'A')
    """
    return values.tolist() if isinstance(values, (np.ndarray, pd.Series, pd.Index)) else values


def checked_measures(measures: object) -> tuple[str, ...]:
    """Return the names of results that are wanted, refused if one is there twice or if it is one text.

    Examples
    --------
    >>> checked_measures(["fires out"])
    ('fires out',)
    """
    if isinstance(measures, str) or not isinstance(measures, Iterable):
        raise InvalidValueError(f"measures is {shortened(measures)}; expected a list of names, such as ['fires out']")
    names = tuple(measures)
    if len(set(names)) < len(names):
        raise InvalidValueError(f"measures is {shortened(names)}; expected different ones")
    return names


def check_results(model_class: type, model: SwarmModel) -> None:
    """Refuse a model that does not say what came of it, in numbers.

    Raises
    ------
    InvalidValueError
    """
    results = getattr(model, "results", None)
    if results is None:
        raise InvalidValueError(f"{model_class.__name__} has no method results(), which returns what is compared")
    for name, number in results().items():
        if number is not None and not isinstance(number, (bool, np.bool_)):
            check_result(name, number)


def _checked_values(
    model_class: type, parameter: str | None, values: Iterable | None, settings: dict
) -> tuple[str, tuple]:
    parameter, by_default = _checked_parameter(model_class, parameter)
    for name in settings:
        check_choice(f"parameter of {model_class.__name__}", name, parameters_of(model_class))
    if parameter in settings:
        raise InvalidValueError(f"{parameter} is set and compared at once; leave one out")
    values = tuple(by_default if values is None else values)
    if not 2 <= len(values) <= MOST_VALUES:
        raise InvalidValueError(f"{len(values)} values of {parameter} are given; expected 2 to {MOST_VALUES}")
    if any(value in values[:i] for i, value in enumerate(values)):
        raise InvalidValueError(f"values of {parameter} are {shortened(values)}; expected different ones")
    return parameter, values


def _checked_parameter(model_class: type, name: str | None) -> tuple[str, tuple]:
    """Return the parameter to compare and the values that it has by default."""
    known = parameters_of(model_class)
    declared, values = getattr(model_class, "compares", (None, ()))
    name = declared if name is None else name
    if name is None:
        raise InvalidValueError(f"{model_class.__name__} does not say what to compare; give a parameter and values")
    if name not in known:
        raise UnknownNameError(unknown_name(f"parameter of {model_class.__name__}", name, known))
    if name != declared:
        control = known[name].control
        values = control.options if isinstance(control, Choice) else ()
    return name, values
