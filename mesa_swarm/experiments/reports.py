"""Reports of a model over a run (its `model_reporters`), each reduced to one number, such as "mean of alignment"."""

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from mesa_swarm.errors import check_choice
from mesa_swarm.swarm_model import SwarmModel

OF = " of "
REDUCTIONS: dict[str, Callable[[np.ndarray], Any]] = {
    "final value": lambda numbers: numbers[-1],
    "mean": np.mean,
    "minimum": np.min,
    "maximum": np.max,
    "sum": np.sum,
}


def parts_of(measure: str) -> tuple[str, str] | None:
    """Return the reduction and the reporter that a measure names, None if it is another measure.

    Examples
    --------
    >>> parts_of("mean of alignment"), parts_of("items")
    (('mean', 'alignment'), None)
    """
    reduction, of, reporter = measure.partition(OF)
    return (reduction, reporter) if of and reduction in REDUCTIONS else None


def all_reports(model: SwarmModel) -> list[str]:
    """Return every reduction of every report of a model."""
    return [f"{reduction}{OF}{name}" for name in model.datacollector.model_reporters for reduction in REDUCTIONS]


def check_report(measure: str, model: SwarmModel) -> None:
    """Refuse a measure that is not a reduction of a report of the model."""
    _, reporter = parts_of(measure) or ("", measure)
    check_choice(f"report of {type(model).__name__}", reporter, model.datacollector.model_reporters)


def reduced(model: SwarmModel, measures: Iterable[str]) -> dict[str, float | None]:
    """Return these measures of a model that has run, over all rows that it has collected.

    What is not a finite number is left out; None if nothing remains.

    Examples
    --------
    >>> model = SwarmModel(rng=1, model_reporters={"now": "completed"}).run(3)
    >>> reduced(model, ["mean of now", "final value of now"])
    {'mean of now': 2.0, 'final value of now': 3.0}
    """
    named = [(measure, parts) for measure in measures if (parts := parts_of(measure))]
    columns = {reporter: _numbers(model.datacollector.model_vars.get(reporter, ())) for _, (_, reporter) in named}
    return {
        measure: float(REDUCTIONS[reduction](columns[reporter])) if len(columns[reporter]) else None
        for measure, (reduction, reporter) in named
    }


def _numbers(rows: Iterable[object]) -> np.ndarray:
    """Return the finite numbers of a column."""
    numbers = (_number(row) for row in rows)
    return np.array([number for number in numbers if math.isfinite(number)])


def _number(row: Any) -> float:
    if isinstance(row, (str, bytes)) or getattr(row, "ndim", 0) != 0:
        return math.nan
    try:
        return float(row)
    except (TypeError, ValueError, OverflowError):  # a reporter may return anything
        return math.nan
