"""Reports of a model over a run (its `model_reporters`), each reduced to one number, such as "mean of alignment"."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import mesa
import numpy as np
import pandas as pd

from mesa_swarm.base.errors import InvalidValueError, check_choice, read_attribute, shortened
from mesa_swarm.swarm_model import SwarmModel

OF = " of "
FINAL, SUM, LEFT_OUT = "final value", "sum", "rows left out"
# Of the rows that are numbers; the other reductions are of all rows.
OF_NUMBERS: dict[str, Callable[[np.ndarray], Any]] = {
    "mean": np.mean,
    "minimum": np.min,
    "maximum": np.max,
    SUM: np.sum,
}
REDUCTIONS = (FINAL, *OF_NUMBERS, LEFT_OUT)


def split_measure(measure: str) -> tuple[str, str] | None:
    """Return the reduction and the reporter that a measure names, None if it is another measure.

    Examples
    --------
    >>> split_measure("mean of alignment"), split_measure("items")
    (('mean', 'alignment'), None)
    """
    reduction, of, reporter = measure.partition(OF)
    return (reduction, reporter) if of and reduction in REDUCTIONS else None


def all_reports(model: SwarmModel, *, call: bool = False) -> list[str]:
    """Return every reduction of every report of a model, without those that `reduced` would refuse.

    What reporters return is known from the last row; where there are no rows, they may be called now if `call`, which
    can change their state and the model's.
    """
    collector = model.datacollector
    reductions = [reduction for reduction in REDUCTIONS if reduction != SUM or model.collect_every <= 1]
    names = [name for name in collector.model_reporters if _is_number(model, name, call)]
    return [f"{reduction}{OF}{name}" for name in names for reduction in reductions]


def _is_number(model: SwarmModel, reporter: str, call: bool) -> bool:
    """Return whether a report is a number, as far as that is known."""
    rows = model.datacollector.model_vars[reporter]
    try:
        if rows or call:
            _number(model, reporter, rows[-1] if rows else _now(model, reporter))
    except InvalidValueError:
        return False
    except Exception:  # of a user's reporter, which may need a step
        return True
    return True


def counted(measures: Iterable[str]) -> tuple[str, ...]:
    """Return measures of reports, and for each reporter among them the measure of how many rows it leaves out.

    Examples
    --------
    >>> counted(["mean of alignment", "sum of alignment"])
    ('mean of alignment', 'sum of alignment', 'rows left out of alignment')
    """
    listed = list(measures)
    reporters = [parts[1] for measure in listed if (parts := split_measure(measure))]
    return tuple(dict.fromkeys([*listed, *(f"{LEFT_OUT}{OF}{name}" for name in reporters)]))


def sum_of_left_out(runs: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Return how many rows of each reporter are left out in all runs, from their measures, where any are.

    Examples
    --------
    >>> sum_of_left_out([{"mean of alignment": 0.5, "rows left out of alignment": 3, "rows left out of order": 0}])
    {'alignment': 3}
    """
    counts: dict[str, int] = {}
    for numbers in runs:
        for name, number in numbers.items():
            if number and name.startswith(LEFT_OUT + OF):
                reporter = name.removeprefix(LEFT_OUT + OF)
                counts[reporter] = counts.get(reporter, 0) + int(number)
    return counts


def notes_on_rows(counts: Mapping[str, int]) -> list[str]:
    """Return a note on the rows of each reporter that are left out, none where none are.

    Examples
    --------
    >>> notes_on_rows({"alignment": 3})
    ['Rows left out, since they have no number: 3 of alignment.']
    """
    listed = ", ".join(f"{count:,}{OF}{name}" for name, count in counts.items())
    return [f"Rows left out, since they have no number: {listed}."] if listed else []


def check_report(measure: str, model: SwarmModel) -> None:
    """Refuse a measure that is not a reduction of a report of the model, or a report that is not a number.

    A reporter that raises an error before the first step may be right after it.
    """
    reduction, reporter = split_measure(measure) or ("", measure)
    _check_known(model, reporter)
    _check_sum(model, reduction, reporter)
    check_reporter(model, reporter)


def check_reporter(model: SwarmModel, reporter: str) -> None:
    """Refuse a reporter of a model that returns anything but a number; one that needs a step first may be right."""
    try:
        value = _now(model, reporter)
    except Exception:  # of a user's reporter it may be any
        return
    _number(model, reporter, value)


def latest_number(model: SwarmModel, reporter: str) -> float:
    """Return the number that a reporter has after the last step, NaN if it is missing: as collected, else as of now.

    Examples
    --------
    >>> latest_number(SwarmModel(rng=1, model_reporters={"now": "completed"}, collect_every=2).run(3), "now")
    3.0
    """
    rows, every = model.datacollector.model_vars[reporter], model.collect_every
    is_collected = rows and every and model.completed % every == 0
    return _number(model, reporter, rows[-1] if is_collected else _now(model, reporter))


def reduced(model: SwarmModel, measures: Iterable[str]) -> dict[str, float | None]:
    """Return these measures of a model that has run, over all rows that it has collected.

    A row that is None, NaN or masked is missing: the final value is then None, and the other reductions are of the rows
    that are numbers, None if there are none; "rows left out" counts the missing ones. Infinity is a number. Where the
    last row is not of the last step (`collect_every`), the final value is measured now.

    Raises
    ------
    InvalidValueError
        If a row is anything but a number, the model has collected no rows, a sum is requested and not every step was
        collected, or a sum is beyond the largest number.

    Examples
    --------
    >>> model = SwarmModel(rng=1, model_reporters={"now": "completed"}).run(3)
    >>> reduced(model, ["mean of now", "final value of now"])
    {'mean of now': 2.0, 'final value of now': 3.0}
    """
    named = {measure: parts for measure in measures if (parts := split_measure(measure))}
    rows = {reporter: _rows(model, reporter) for _, reporter in named.values()}
    return {measure: _reduced(model, *parts, rows[parts[1]]) for measure, parts in named.items()}


def _reduced(model: SwarmModel, reduction: str, reporter: str, rows: np.ndarray) -> float | None:
    _check_sum(model, reduction, reporter)
    missing = np.isnan(rows)
    if reduction == LEFT_OUT:
        return int(missing.sum())
    number = _final(model, reporter, rows) if reduction == FINAL else _of_numbers(reduction, reporter, rows[~missing])
    return None if math.isnan(number) else number


def _of_numbers(reduction: str, reporter: str, numbers: np.ndarray) -> float:
    """Return a reduction of numbers, NaN of none."""
    if not len(numbers):
        return math.nan
    with np.errstate(over="ignore", invalid="ignore"):
        number = float(OF_NUMBERS[reduction](numbers))
        if math.isfinite(number) or not np.isfinite(numbers).all():
            return number
        if reduction == SUM:
            raise InvalidValueError(f"sum of {reporter} is beyond the largest number, 1.8e308; report smaller numbers")
        largest = np.abs(numbers).max()
        return float(np.mean(numbers / largest) * largest)


def _final(model: SwarmModel, reporter: str, rows: np.ndarray) -> float:
    """Return the value after the last step, NaN if it is missing."""
    if (model.collect_every > 1 and model.completed % model.collect_every) or _collects_now_and_then(model):
        return _number(model, reporter, _now(model, reporter))
    return float(rows[-1]) if len(rows) else math.nan


def _check_known(model: SwarmModel, reporter: str) -> None:
    check_choice(f"report of {type(model).__name__}", reporter, model.datacollector.model_reporters)


def _check_sum(model: SwarmModel, reduction: str, reporter: str) -> None:
    """Refuse a sum over some of the steps."""
    if reduction == SUM and _collects_now_and_then(model):
        raise InvalidValueError(
            f"sum of {reporter} would be over {_count_of_rows(model):,} of {model.completed:,} steps, those in which "
            f"{type(model).__name__} collects; collect in every step, or measure the mean of {reporter}"
        )
    if reduction == SUM and model.collect_every > 1:
        raise InvalidValueError(
            f"sum of {reporter} would be over one step in {model.collect_every} (collect_every); collect every step, "
            f"or measure the mean of {reporter}"
        )


def _collects_now_and_then(model: SwarmModel) -> bool:
    """Return whether collecting is left to the class of a model, which has not collected after every step."""
    return model.collect_every == 0 and 0 < _count_of_rows(model) < model.completed


def _count_of_rows(model: SwarmModel) -> int:
    return max(map(len, model.datacollector.model_vars.values()), default=0)


def _now(model: SwarmModel, reporter: str) -> object:
    """Return what a reporter returns in the model's present state."""
    collector = mesa.DataCollector(model_reporters={reporter: model.datacollector.model_reporters[reporter]})
    collector.collect(model)
    return collector.model_vars[reporter][-1]


def _rows(model: SwarmModel, reporter: str) -> np.ndarray:
    """Return the rows of a reporter as numbers, NaN where one is missing."""
    _check_known(model, reporter)
    rows = model.datacollector.model_vars[reporter]
    if not rows and model.completed:
        raise InvalidValueError(
            f"report {shortened(reporter)} of {type(model).__name__} has no rows after {model.completed:,} steps, "
            f"since collect_every is {model.collect_every}; collect more often, or run more steps"
        )
    return np.array([_number(model, reporter, row) for row in rows], float)


def _number(model: SwarmModel, reporter: str, row: Any) -> float:
    """Return a row as a number, NaN if it is missing; refuse anything else."""
    number = as_number(row)
    if number is None:
        raise InvalidValueError(
            f"reporter {shortened(reporter)} of {type(model).__name__} returned {shortened(row)}; expected a number, "
            "or None where there is none: let it return one number, such as a count or a mean"
        )
    return number


def as_number(row: Any) -> float | None:
    """Return what a reporter returned as a number, NaN if it is missing, None if it is anything else.

    Examples
    --------
    >>> as_number(True), as_number(np.ma.masked), as_number("3.5")
    (1.0, nan, None)
    """
    if row is None or row is pd.NA or row is np.ma.masked:
        return math.nan
    # Arrays of one number would be taken for it, with a warning, and of a complex number its real part.
    if isinstance(row, (str, bytes, complex, np.complexfloating)) or read_attribute(row, "ndim", 0) != 0:
        return None
    try:
        return float(row)
    except Exception:  # a class of the user's may raise anything
        return None
