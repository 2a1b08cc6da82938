"""Comparisons: what one will do, checked before any of it is done, and the paired runs that it did."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, check_choice, shortened
from mesa_swarm.experiments.experiment import (
    Experiment,
    check_measures,
    checked_class,
    checked_measures,
    checked_seeds,
    checked_settings,
    checked_steps,
)
from mesa_swarm.experiments.fingerprints import source_hash
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.reports import sum_of_left_out
from mesa_swarm.experiments.runs import Run, outcome_of
from mesa_swarm.experiments.sampling import check_different
from mesa_swarm.experiments.until import checked_condition
from mesa_swarm.model.parameters import Choice, parameters_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.final_state import FinalState, final_state_of

MOST_VALUES = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedOutcome(Outcome):
    """The outcome of a run of a comparison; the first seed has a portrait of the final state, which is not stored."""

    value: Any
    rng: int
    portrait: FinalState | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonPlan(Experiment):
    """An experiment that compares values of one parameter over the same seeds."""

    parameter: str
    values: tuple

    def runs(self, *, keyed: bool = False) -> Iterator[Run]:
        """Yield the runs: seed by seed, and with each all values, so that pairs are done together.

        Keys are those of a sweep, so that runs of changed code are other runs.
        """
        points = [{**self.settings, **point} for point in self.points]
        measures = {"measures of a comparison": list(self.measures)}
        checked = [{**checked_settings(self.model_class, point), **measures} for point in points if keyed]
        for rng in self.seeds:
            for k, point in enumerate(points):
                key = self.key(checked[k], rng) if keyed else f"{rng} {k}"
                yield self.keyed_run(point, rng, key, k)

    def built(self, rng: int, value: Any) -> SwarmModel:
        """Return the model of one run, before its first step."""
        return self.model_class(**self.settings, **{self.parameter: value}, rng=rng)

    def simulate(self, run: Run) -> PairedOutcome:
        """Do one run, and draw the portrait of one with the first seed."""
        model = run.made()
        watch = run.watched(model)
        portrait = final_state_of(model) if run.rng == self.seeds[0] else None
        outcome = outcome_of(model, self.measures, self.reports)
        return run.stored(model, watch, self.paired(run, outcome, portrait))

    def paired(self, run: Run, outcome: Outcome, portrait: FinalState | None = None) -> PairedOutcome:
        """Return the outcome of a run as one of this comparison."""
        return PairedOutcome(**outcome.stored(), value=run.settings[self.parameter], rng=run.rng, portrait=portrait)


@dataclass(frozen=True, slots=True, repr=False)
class PairedRuns:
    """The runs of a plan: what tables, figures and findings are made of.

    They are by seed, then by value, whatever the order in which they were done.
    """

    plan: ComparisonPlan
    runs: tuple[PairedOutcome, ...]
    done_before: int = field(default=0, compare=False)

    def column(self, value: Any, measure: str) -> list[float | None]:
        """Return a measure in all runs with one value, by seed."""
        return [run.numbers[measure] for run in self.runs if run.value == value]

    @property
    def measures(self) -> list[str]:
        """The names of what was measured."""
        return list(self.plan.measures or self.runs[0].numbers)

    @property
    def left_out(self) -> dict[str, int]:
        """How many rows of each reporter were missing in all runs, and left out of its reports, where any were."""
        return sum_of_left_out(run.numbers for run in self.runs)

    @property
    def portraits(self) -> dict[Any, FinalState]:
        """The final state under each value, with the first seed."""
        return {run.value: run.portrait for run in self.runs if run.portrait is not None}


def checked_plan(
    model: type | str,
    parameter: str | None = None,
    values: Iterable | None = None,
    seeds: int | Sequence[int] = 30,
    *,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measures: Sequence[str] = (),
    until: object = None,
) -> ComparisonPlan:
    """Return the plan of a comparison, after building the model once with every value; see `compare`."""
    model_class = checked_class(model)
    settings = dict(settings or {})
    compared, chosen = _checked_values(model_class, parameter, values, settings)
    plan = ComparisonPlan(
        model_class=model_class,
        settings=settings,
        points=[{compared: value} for value in chosen],
        seeds=checked_seeds(seeds),
        steps=checked_steps(model_class, steps),
        measures=checked_measures(measures),
        source=source_hash(model_class),
        parameter=compared,
        values=chosen,
        name="comparison",
        until=checked_condition(until),
    )
    for value in plan.values:
        check_measures(plan, plan.built(plan.seeds[0], value))
    return plan


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
    return parameter, tuple(check_different(parameter, values, "ones"))


def _declared_comparison(model_class: type) -> tuple[str | None, tuple]:
    """Return a model's attribute ``compares``; without one, no parameter and no values."""
    declared = getattr(model_class, "compares", (None, ()))
    if not isinstance(declared, tuple | list) or len(declared) != 2 or not isinstance(declared[1], tuple | list):
        raise InvalidValueError(
            f"compares of {model_class.__name__} is {shortened(declared)}; expected a parameter and a tuple of its "
            'values, as in compares = "strategy", ("A", "B")'
        )
    return declared[0], tuple(declared[1])


def _checked_parameter(model_class: type, name: str | None) -> tuple[str, tuple]:
    """Return the parameter to compare and the values that it has by default."""
    known = parameters_of(model_class)
    declared, values = _declared_comparison(model_class)
    name = declared if name is None else name
    if name is None:
        raise InvalidValueError(
            f"{model_class.__name__} has no attribute compares with a parameter and values; give both"
        )
    if check_choice(f"parameter of {model_class.__name__}", name, known) != declared:
        control = known[name].control
        values = control.options if isinstance(control, Choice) else ()
    return name, values
