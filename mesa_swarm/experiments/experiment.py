"""Experiments: points, seeds and steps of a model, checked before anything is run; each run with a key."""

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from itertools import islice, product
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, shortened
from mesa_swarm.experiments.fingerprints import fingerprint, shown_value, source_hash
from mesa_swarm.experiments.ledger import ENDED_BY
from mesa_swarm.experiments.reports import check_report, split_measure
from mesa_swarm.experiments.runs import Run, check_results
from mesa_swarm.experiments.sampling import Points, Sample, as_list, check_different, grid_columns
from mesa_swarm.experiments.series import RUN, RunSeries
from mesa_swarm.experiments.until import EndCondition, checked_condition
from mesa_swarm.maps.map import Map, builtin_maps
from mesa_swarm.model.gallery import find_model, model_address
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.model.state_hash import ENGINE_BITS
from mesa_swarm.swarm_model import SwarmModel

MOST_SEEDS = 100_000
# Seeds are compared as floats are, in tables and in TOML of other programs.
LARGEST_SEED = 2**53 - 1
MOST_STEPS = 100_000_000
DEFAULT_STEPS = 3_000
MOST_RUNS = 100_000_000
# This many points may be impossible before an experiment is refused as a whole.
POINTS_TRIED = 20
# The column that names the point of the design to which a row belongs.
POINT = "point"
FIXED = (POINT, "rng", "steps", "state_hash", "error")
# Looking it up takes a millisecond, and each run asks.
package_version = cache(version)


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """What is to be run: every point with every seed. Made by `checked_experiment`.

    `settings` are the same in all runs; without `measures` all results are wanted; `source` is the fingerprint of the
    model's code; `until` ends runs before their number of steps; `series` is where theirs are stored.
    """

    model_class: type
    settings: dict[str, Any]
    points: Sequence[dict[str, Any]]
    seeds: Sequence[int]
    steps: int
    measures: tuple[str, ...] = ()
    name: str = "run"
    source: str = ""
    until: EndCondition | None = None
    series: RunSeries | None = None

    def __len__(self) -> int:
        """Count the runs."""
        return len(self.points) * len(self.seeds)

    def order(self) -> Iterator[tuple[int, int]]:
        """Yield the numbers of a point and a seed of each run: point by point, and of each the seeds."""
        return product(range(len(self.points)), range(len(self.seeds)))

    def runs(self) -> Iterator[Run]:
        """Return the runs in their order, which is that of the table."""
        return self.part()

    def part(self, number: int = 1, parts: int = 1) -> Iterator[Run]:
        """Yield the runs of one of several equal parts, in the order of the table.

        Examples
        --------
        >>> experiment = checked_experiment("fire_fighting", seeds=5, steps=5)
        >>> [run.rng for run in experiment.part(2, 3)]
        [2, 5]
        """
        for point, seed in islice(self.order(), number - 1, None, parts):
            yield self.run({**self.settings, **self.points[point]}, self.seeds[seed], point)

    def run(self, settings: Mapping[str, Any], rng: int, point: int = 0) -> Run:
        """Return one run, with these settings of all parameters that are set, at the point with this number."""
        return self.keyed_run(settings, rng, self.key(settings, rng), point)

    def keyed_run(self, settings: Mapping[str, Any], rng: int, key: str, point: int = 0) -> Run:
        """Return one run with a key of its own."""
        return Run(self.model_class, settings, rng, self.steps, key, self.reports, point, self.until, self.series)

    @property
    def reports(self) -> tuple[str, ...]:
        """The measures that are reports of the model, each reduced to one number."""
        return tuple(name for name in self.measures if split_measure(name))

    def key(self, settings: Mapping[str, Any], rng: int) -> str:
        """Return the fingerprint of all that decides a run: model, source, version, parameters, seed and steps."""
        defaults = {name: parameter.default for name, parameter in parameters_of(self.model_class).items()}
        place = model_address(self.model_class)
        parameters = {name: shown_value(value) for name, value in {**defaults, **settings}.items()}
        ends = () if self.until is None else (self.until.source,)
        version = package_version("mesa-swarm"), ENGINE_BITS
        decisive = place, self.source, version, parameters, rng, self.steps, *ends
        return fingerprint(*decisive, default=repr)

    @property
    def fixed(self) -> tuple[str, ...]:
        """The columns of its table besides parameters and results."""
        return (*FIXED, *(() if self.until is None else (ENDED_BY,)), *(() if self.series is None else (RUN,)))

    @property
    def columns(self) -> list[str]:
        """The parameters that are set, in the order of the table."""
        return list({**self.settings, **(self.points[0] if self.points else {})})


def checked_experiment(
    model: type | str,
    varied: Mapping[str, Sequence] | Sample | Sequence[Mapping] = (),
    *,
    seeds: int | Sequence[int] = 30,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measure: Sequence[str] = (),
    name: str = "run",
    until: object = None,
) -> Experiment:
    """Return an experiment after building its model once; see `sweep`."""
    model_class = checked_class(model)
    fixed = checked_settings(model_class, settings or {})
    points = _points(model_class, varied)
    for both in fixed.keys() & points[0].keys():
        raise InvalidValueError(f"{both} is set and varied at once; leave one out")
    experiment = Experiment(
        model_class=model_class,
        settings=fixed,
        points=points,
        seeds=checked_seeds(seeds),
        steps=checked_steps(model_class, steps),
        measures=checked_measures(measure),
        name=name,
        source=source_hash(model_class),
        until=checked_condition(until),
    )
    check_count("number of runs", len(experiment), minimum=1, maximum=MOST_RUNS)
    check_result_names(check_measures(experiment, first_built(experiment)), {*experiment.fixed, *experiment.columns})
    return experiment


def checked_class(model: object) -> type:
    """Return the class of a model, or of the model of this name or address."""
    model_class = find_model(model) if isinstance(model, str) else model
    if not isinstance(model_class, type):
        raise InvalidValueError(f"model is {shortened(model)}; expected a class, or the name or address of a model")
    return model_class


def checked_steps(model_class: type, steps: int | None) -> int:
    """Return the steps of each run, by default those that the model declares."""
    default = getattr(model_class, "steps_to_compare", DEFAULT_STEPS)
    return check_count("steps", default if steps is None else steps, minimum=1, maximum=MOST_STEPS)


def checked_seeds(seeds: object) -> Sequence[int]:
    """Return seeds 1, 2, ... for a number of them, or those of a list."""
    seeds = as_list(seeds)
    if isinstance(seeds, (str, bytes)) or not isinstance(seeds, Sequence):
        return range(1, 1 + check_count("seeds", seeds, minimum=1, maximum=MOST_SEEDS))
    listed = tuple(check_count("seeds", seed, maximum=LARGEST_SEED) for seed in seeds)
    check_count("number of seeds", len(listed), minimum=1, maximum=MOST_SEEDS)
    return tuple(check_different("seeds", listed, "ones"))


def checked_measures(measures: object) -> tuple[str, ...]:
    """Return the names of results that are wanted; refuse a single text, and names that are repeated."""
    if isinstance(measures, str) or not isinstance(measures, Iterable):
        raise InvalidValueError(f"measure is {shortened(measures)}; expected a list of names, such as ['fires out']")
    names = tuple(measures)
    for name in names:
        if not isinstance(name, str):
            raise InvalidValueError(f"measure has {shortened(name)}; expected names, such as 'fires out'")
    return tuple(check_different("measure", names, "ones"))


def checked_settings(model_class: type, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings as the types of a model's parameters, files of maps read."""
    known, checked = parameters_of(model_class), {}
    for name, value in settings.items():
        check_choice(f"parameter of {model_class.__name__}", name, known)
        is_file = name == "map" and value not in builtin_maps()
        # Files of maps are read once and here, so that workers elsewhere need none.
        checked[name] = known[name].checked(Map.load(value) if is_file else value)
    return checked


def _points(model_class: type, varied: Mapping | Sample | Sequence[Mapping]) -> Sequence[dict[str, Any]]:
    """Return the points, checked; those of grids and samples are made lazily."""
    if isinstance(varied, Sample):
        return varied.points_of(model_class)
    if isinstance(varied, Mapping):
        columns = grid_columns(model_class, varied)
        if "map" in columns:
            columns["map"] = [checked_settings(model_class, {"map": each})["map"] for each in columns["map"]]
        return Points(columns, crossed=True)
    points = [checked_settings(model_class, point) for point in varied or [{}]]
    for point in points:
        if point.keys() != points[0].keys():
            both = f"{shortened(list(points[0]))} and {shortened(list(point))}"
            raise InvalidValueError(f"points set {both}; expected the same parameters in all")
    return points


def check_measures(experiment: Experiment, model: SwarmModel) -> Mapping[str, Any]:
    """Refuse results and reports of a model that are unknown or not numbers; return the results, if it has any.

    Those of the condition that ends runs are checked too.
    """
    results: Mapping[str, Any] = {}
    if experiment.until is not None:
        experiment.until.check(model)
    if hasattr(model, "results") or not experiment.reports:
        check_results(model)
        results = model.results()
    for name in experiment.measures:
        if name not in results and split_measure(name):
            check_report(name, model)
        else:
            check_choice(f"result of {experiment.model_class.__name__}", name, results)
    return results


def check_result_names(results: Iterable[str], taken: Set[str]) -> None:
    """Refuse results that are named as other columns of the table."""
    for name in results:
        if name in taken:
            raise InvalidValueError(f"result {shortened(name)} is named as another column; rename it in results()")


def first_built(experiment: Experiment) -> SwarmModel:
    """Return the model at the first point at which it can be built; a run that cannot be is an error in the table."""
    first_error = None
    for point in islice(experiment.points, POINTS_TRIED):
        try:
            return experiment.model_class(**experiment.settings, **point, rng=experiment.seeds[0])
        except Exception as error:  # of a user's model it may be any
            first_error = first_error or error
    raise first_error or InvalidValueError("the experiment has no points; give at least one")
