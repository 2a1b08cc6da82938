"""Sensitivity of a measure to a model's parameters: Sobol' indices and Morris's screening, by SALib over a sweep."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.base.extras import require_extra
from mesa_swarm.base.wording import in_brief, quantity
from mesa_swarm.experiments.experiment import Experiment, checked_class, checked_experiment
from mesa_swarm.experiments.reports import notes_on_rows
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.sampling import Range, checked_ranges, points_at, range_text
from mesa_swarm.experiments.statistics import Interval
from mesa_swarm.experiments.sweep import Sweep, run_experiment
from mesa_swarm.experiments.tables import WIDEST, Study, csv_text, fitting, known, with_limits
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.model.parameters import parameters_of

METHODS = ("sobol", "morris")
# By method: the index that ranks, and what the indices are.
RANKING = {"sobol": "ST", "morris": "mu*"}
NOTES = {
    "sobol": "S1: share of the variance that the parameter explains alone. ST: with all its interactions.",
    "morris": (
        "mu*: mean size of the effect of moving the parameter over its whole range. mu: with its sign. "
        "sigma: how much the effect depends on the other parameters."
    ),
}
# Levels of Morris's grid, and how far a step goes on it, as a share of the range.
LEVELS, STEP = 4, 2 / 3
MOST_POINTS = 100_000
RESAMPLES = 1_000
# The same results always give the same intervals.
BOOTSTRAP_SEED = 95
# Scaled numbers that differ less are equal.
LEAST_SPREAD = 1e-9
# What is smaller than this share of others is an error of rounding.
ROUNDING = 1e-12
# Squares of larger numbers may be infinite.
LARGEST = 1e150
# Quantile of the normal distribution for 95 %.
Z = 1.959963984540054


@dataclass(frozen=True, kw_only=True, slots=True)
class SensitivityPlan:
    """What is varied, how, and what is measured.

    Parameters
    ----------
    method : {"sobol", "morris"}
    ranges : mapping of str to Range
    measure : str
    points : int
        Base points of Sobol', trajectories of Morris.
    difference : tuple of str and two values, or None
        A parameter, and the values between which the measure is compared on the same seed: second minus first.
    missing : float or None
        What counts where the measure did not happen.
    rng : int
        Seed of the design.
    """

    method: str
    ranges: Mapping[str, Range]
    measure: str
    points: int
    difference: tuple[str, Any, Any] | None
    missing: float | None
    rng: int

    def shares(self) -> np.ndarray:
        """Return the design as shares (points, parameters) of the ranges."""
        problem = self.problem()
        if self.method == "sobol":
            from SALib.sample.sobol import sample  # noqa: PLC0415 - optional, and slow to load

            return sample(problem, self.points, calc_second_order=False, seed=self.rng)
        from SALib.sample.morris import sample as trajectories  # noqa: PLC0415

        return trajectories(problem, self.points, num_levels=LEVELS, seed=self.rng)

    def problem(self) -> dict[str, Any]:
        """Return the ranges as SALib takes them: the unit box."""
        return {"num_vars": len(self.ranges), "names": list(self.ranges), "bounds": [[0.0, 1.0]] * len(self.ranges)}

    @property
    def title(self) -> str:
        """What the indices are of."""
        if self.difference is None:
            return self.measure
        name, first, second = self.difference
        return f"{self.measure}, {name} {second} minus {first}"


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Sensitivity(Study):
    """Indices of sensitivity with 95 % intervals, their table, picture and files; made by `sensitivity`.

    Parameters
    ----------
    plan : SensitivityPlan
    experiment : Experiment
    sweep : Sweep
        Its runs, and their table.
    shares : ndarray
        (points, parameters) The design, as shares of the ranges.
    numbers : ndarray
        (points, seeds) The measure.
    indices : mapping of str to mapping of str to Interval
        Each index, "S1" and "ST" or "mu*", "mu" and "sigma", of each parameter.
    chance : float
        The share of the variance of the points' means that is due to seeds; NaN with one seed.
    """

    plan: SensitivityPlan
    experiment: Experiment
    sweep: Sweep
    shares: np.ndarray
    numbers: np.ndarray
    indices: Mapping[str, Mapping[str, Interval]]
    chance: float

    def ranked(self) -> list[str]:
        """Return the parameters, the one with the largest ST or mu* first."""
        ranking = self.indices[RANKING[self.plan.method]]
        return sorted(ranking, key=lambda name: -np.nan_to_num(ranking[name].estimate))

    def frame(self) -> pd.DataFrame:
        """Return the indices, one row a parameter: estimate, and lower and upper limit."""
        rows = {
            name: {
                f"{index}{end}": number
                for index, of in self.indices.items()
                for end, number in zip(("", " low", " high"), _ends(of[name]), strict=True)
            }
            for name in self.plan.ranges
        }
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")

    def table(self, width: int = WIDEST) -> str:
        """Return the indices as text, at most `width` columns wide, the largest first."""
        plan, seeds = self.plan, len(self.experiment.seeds)
        head = ["parameter", "range", *(f"{index} [95 %]" for index in self.indices)]
        rows = [
            [name, range_text(plan.ranges[name]), *(with_limits(of[name]) for of in self.indices.values())]
            for name in self.ranked()
        ]
        base = f"{plan.points:,} {'base points' if plan.method == 'sobol' else 'trajectories'}"
        size = f"{base}, {quantity(len(self.shares), 'point')}, {quantity(seeds, 'seed')} at each"
        title = f"{self.experiment.model_class.__name__}: sensitivity of {plan.title}; {size}"
        return "\n".join([title, "", *fitting([head, *rows], width), "", *self.notes()])

    def notes(self) -> list[str]:
        """Return how the indices are to be read."""
        intervals = f"Intervals: +- 1.96 standard deviations of {RESAMPLES:,} bootstrap samples of points and seeds."
        if not self._is_certain:
            intervals = "Intervals are unknown: in some bootstrap samples the measure is the same at every point."
        notes = [NOTES[self.plan.method], intervals, *notes_on_rows(self.sweep.left_out)]
        if np.isnan(self.chance):
            return [*notes, "One seed: what is due to chance is not known."]
        if self.chance == 0:
            return [*notes, "The differences between points are the same with every seed."]
        if self.chance >= 1:
            return [*notes, "Seeds account for all of the variance of the points' means; use more seeds."]
        ranking = RANKING[self.plan.method]
        return [
            *notes,
            f"Seeds cause {round(100 * self.chance) if self.chance > 0.1 else f'{100 * self.chance:.2g}'} % of the "
            "variance of the points' means: "
            f"{ranking} of a parameter without effect can be {in_brief(float(f'{self.floor:.2g}'))}.",
        ]

    @property
    def _is_certain(self) -> bool:
        """Whether the index by which parameters are ranked has an interval for each of them."""
        return all(math.isfinite(each.low) for each in self.indices[RANKING[self.plan.method]].values())

    @property
    def floor(self) -> float:
        """The ST or mu* that a parameter without effect has on average if each run of a seed differs by chance."""
        if self.plan.method == "sobol":
            return self.chance
        # The mean size of the difference of two normal numbers, divided by the step.
        return 2 * float(np.sqrt(self.chance * self.numbers.mean(axis=1).var(ddof=1) / np.pi)) / STEP

    def finding(self) -> str:
        """Return the finding in one sentence."""
        plan = self.plan
        if np.ptp(self.numbers.mean(axis=1)) == 0:
            return f"{plan.title} was {self.numbers.mean():g} at every point: it does not depend on these parameters."
        if not self._is_certain:
            return f"{plan.title}: no ranking, since intervals are unknown; use more points, or another measure."
        index, floor = RANKING[plan.method], np.nan_to_num(self.floor)
        ranking, names = self.indices[index], self.ranked()
        without = [name for name in names if ranking[name].low <= floor]
        if len(without) == len(names):
            return f"No effect of any parameter on {plan.title} beyond chance is shown; use more points or seeds."
        first, *others = [name for name in names if name not in without]
        level = [name for name in others if ranking[name].meets(ranking[first])]
        top = f"{plan.title} depends most on {first} ({index} {with_limits(ranking[first])})"
        if level:
            top = f"{plan.title} depends most on {', '.join([first, *level])}, whose {index} are not clearly different"
        return f"{top}{'; no effect beyond chance is shown for ' if without else ''}{', '.join(without)}."

    def csv(self) -> str:
        """Return the indices as CSV, one line a parameter and index, empty where an interval is not known."""
        rows = [
            [name, range_text(each), index, *map(known, _ends(of[name]))]
            for name, each in self.plan.ranges.items()
            for index, of in self.indices.items()
        ]
        return csv_text([["parameter", "range", "index", "estimate", "low", "high"], *rows])

    def figure(self) -> Any:
        """Return the picture, a Matplotlib figure: the indices, and the measure over each parameter."""
        from mesa_swarm.experiments.figures import sensitivity_figure  # noqa: PLC0415 - slow to load

        title = f"{self.experiment.model_class.__name__}: {self.plan.title}, {quantity(len(self.shares), 'point')}"
        of = dict(zip(self.plan.ranges, self.shares.T, strict=True))
        points = {name: (self.plan.ranges[name], self.plan.ranges[name].at(of[name])) for name in self.ranked()}
        return sensitivity_figure(
            f"{title}, {quantity(len(self.experiment.seeds), 'seed')}",
            self.indices,
            points,
            self.numbers.mean(axis=1),
            floor=self.floor,
        )

    def _texts(self) -> dict[str, str]:
        return {"sensitivity.csv": self.csv(), "sensitivity.txt": f"{self!r}\n"}

    def _pictures(self) -> dict[str, bytes]:
        from mesa_swarm.viewing.figures import png  # noqa: PLC0415 - slow to load

        return {"sensitivity.png": png(self.figure())}


def sensitivity(
    model: type | str,
    ranges: Mapping[str, Any],
    measure: str,
    *,
    method: str = "sobol",
    points: int = 64,
    seeds: int | Sequence[int] = 20,
    difference: tuple[str, Any, Any] | None = None,
    missing: float | None = None,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    rng: int = 1,
    out: str | os.PathLike[str] = "results/sensitivity",
    jobs: int = -1,
    progress: bool = False,
    retry_failed: bool = False,
    until: Callable[[Any], object] | str | None = None,
    series: bool | str = False,
    tables: Sequence[str] = (),
) -> Sensitivity:
    """Measure how much a measure of a model depends on each of its parameters, on all cores.

    - **sobol**: for parameters uniform in their ranges, shares of the variance of the measure (its mean over the
      seeds): S1_i = V(E(y | x_i)) / V(y), what x_i explains alone, and ST_i = E(V(y | all but x_i)) / V(y), with all
      its interactions ([1]_, [2]_; Saltelli's design of points (parameters + 2) points and his estimators of 2010).
    - **morris**: effects of single steps over two thirds of a range, divided by 2/3, along random trajectories of
      parameters + 1 points ([3]_): mu* is the mean of their sizes, mu their mean, sigma their standard deviation, all
      in units of the measure.

    Every point is run with every seed. A 95 % interval is the estimate +- 1.96 standard deviations of 1,000 bootstrap
    samples of the base points or trajectories, as in SALib, and of the seeds too: it covers what another design and
    other seeds would have given. `Sensitivity.chance` is the share of the variance of the points' means that seeds
    cause; ST and mu* of a parameter without effect are that much too large.

    The runs are those of a sweep in the folder `out`: after a kill the same call continues, and other measures of the
    same runs need no new ones. The result does not depend on `jobs`.

    Parameters
    ----------
    model : type or str
        A SwarmModel with a method ``results`` or the report `measure`, or its name or address (`gallery.find_model`).
    ranges : mapping of str to (low, high), (low, high, "log"), values or Range
        At least two parameters, see `sampling.Range`.
    measure : str
        A result, or a report as "mean of NAME": see `sweep`.
    method : {"sobol", "morris"}
    points : int
        Base points of Sobol', a power of two; trajectories of Morris, of which 10 to 50 are usual. At least 2.
    seeds : int or sequence of int
        Seeds 1, 2, ... seeds at each point, or these.
    difference : (str, value, value), optional
        A parameter and two of its values: the indices are then of the measure with the second minus that with the
        first, on the same seed.
    missing : float, optional
        The number that counts where the measure did not happen (None), such as `steps` for a time. Without it a
        missing measure is an error, and so is an infinite one.
    steps, settings, jobs, progress, retry_failed, until, series, tables
        See `sweep`; inside `joblib.parallel_config(backend="dask")` the workers of the cluster do the work.
    rng : int
        Seed of the design.
    out : path
        Folder of the ledger and the table of all runs.

    Raises
    ------
    SwarmError
        Before anything is run, if anything is wrong or SALib is missing; after all runs are done, if some ended in an
        error: their parameters have no measure, and a design has no use for other points.

    References
    ----------
    .. [1] Sobol', Global sensitivity indices for nonlinear mathematical models and their Monte Carlo estimates,
       Mathematics and Computers in Simulation 55 (2001).
    .. [2] Saltelli et al., Variance based sensitivity analysis of model output, Computer Physics Communications 181
       (2010).
    .. [3] Morris, Factorial sampling plans for preliminary computational experiments, Technometrics 33 (1991);
       Campolongo, Cariboni and Saltelli, An effective screening design for sensitivity analysis of large models,
       Environmental Modelling and Software 22 (2007).

    Examples
    --------
    >>> import tempfile
    >>> ranges = {"n_robots": (2, 5), "k1": (1e-4, 1e-2, "log")}
    >>> how = {"method": "morris", "points": 2, "seeds": 2, "steps": 20, "jobs": 1}
    >>> with tempfile.TemporaryDirectory() as home:
    ...     found = sensitivity("fire_fighting", ranges, "mean of robots_at_fires", out=home, **how)
    >>> found.sweep.runs, list(found.indices)
    (12, ['mu*', 'mu', 'sigma'])
    """
    need_salib()
    model_class, workers = checked_class(model), checked_jobs(jobs)
    plan = _checked_plan(model_class, ranges, measure, method, points, difference, missing, rng)
    files, shares = RunFiles.checked(out, series=series, tables=tables), plan.shares()
    how: dict[str, Any] = {"seeds": seeds, "steps": steps, "settings": settings, "until": until}
    experiment = checked_experiment(model_class, _varied(plan, shares), measure=[measure], **how)
    made = run_experiment(experiment, files, workers, progress, retry_failed=retry_failed)
    numbers = _numbers(plan, experiment, made)
    estimated = partial(_sobol if plan.method == "sobol" else _morris, shares)
    indices = _indices(estimated, numbers, list(plan.ranges), _groups(plan.method, len(plan.ranges)))
    return Sensitivity(plan, experiment, made, shares, numbers, indices, _chance(numbers))


def need_salib() -> None:
    """Check that SALib is installed; if not, the error gives the command that installs it."""
    require_extra("SALib", "sensitivity", "sensitivity needs", "SALib")


def _checked_plan(
    model_class: type,
    ranges: object,
    measure: object,
    method: str,
    points: int,
    difference: object,
    missing: float | None,
    rng: int,
) -> SensitivityPlan:
    checked = checked_ranges(model_class, ranges)
    if len(checked) < 2:
        raise InvalidValueError("1 range is given; expected at least two, since indices compare parameters")
    check_choice("method", method, METHODS)
    count = check_count("points", points, minimum=2, maximum=MOST_POINTS)
    if method == "sobol" and count & (count - 1):
        near = 1 << (count - 1).bit_length()
        raise InvalidValueError(f"points is {count}; expected a power of two for sobol, such as {near}")
    if not isinstance(measure, str):
        raise InvalidValueError(f"measure is {shortened(measure)}; expected the name of a result")
    return SensitivityPlan(
        method=method,
        ranges=checked,
        measure=measure,
        points=count,
        difference=_checked_difference(model_class, checked, difference),
        missing=None if missing is None else check_number("missing", missing),
        rng=check_count("rng", rng),
    )


def _checked_difference(model_class: type, ranges: Mapping[str, Range], given: Any) -> tuple[str, Any, Any] | None:
    """Return a parameter and two different values of it, or None."""
    if given is None:
        return None
    if not isinstance(given, Sequence) or isinstance(given, str) or len(given) != 3:
        raise InvalidValueError(f'difference is {shortened(given)}; expected such as ("strategy", "A", "B")')
    known_ones = parameters_of(model_class)
    name = check_choice(f"parameter of {model_class.__name__}", given[0], known_ones)
    first, second = (known_ones[name].checked(value) for value in given[1:])
    if name in ranges or first == second:
        raise InvalidValueError(f"difference is {shortened(given)}; expected two values of a parameter without a range")
    return name, first, second


def _varied(plan: SensitivityPlan, shares: np.ndarray) -> Sequence[dict[str, Any]]:
    """Return the points of the sweep: those of the design, each of them twice in a row for a difference."""
    points = points_at(plan.ranges, shares)
    if plan.difference is None:
        return list(points)
    name, *values = plan.difference
    return [{**point, name: value} for point in points for value in values]


def _numbers(plan: SensitivityPlan, experiment: Experiment, made: Sweep) -> np.ndarray:
    """Return the measure at each point of the design with each seed, or refuse runs that have none."""
    if made.failed:
        raise InvalidValueError(
            f"{made.failed:,} of {made.runs:,} runs ended in an error, such as {shortened(made.errors[0])}; narrow the "
            "ranges, or repeat these runs with retry_failed=True (--retry-failed)"
        )
    column = made.frame()[plan.measure].to_numpy(float)
    lacking = int(np.isnan(column).sum())
    if lacking and plan.missing is None:
        raise InvalidValueError(
            f"{shortened(plan.measure)} did not happen in {lacking:,} of {made.runs:,} runs; give the number that "
            "counts for it as missing (--missing), or choose a measure that every run has"
        )
    filled = column if plan.missing is None else np.where(np.isnan(column), plan.missing, column)
    beyond = int((np.abs(filled) > LARGEST).sum())
    if beyond:
        raise InvalidValueError(
            f"{shortened(plan.measure)} is infinite or beyond {LARGEST:g} in {beyond:,} of {made.runs:,} runs, so that "
            "its variance is not known; choose a measure that is finite in every run, or narrow the ranges"
        )
    if plan.difference is None:
        return filled.reshape(-1, len(experiment.seeds))
    pairs = filled.reshape(-1, 2, len(experiment.seeds))
    return pairs[:, 1] - pairs[:, 0]


def _groups(method: str, parameters: int) -> int:
    """Return how many rows of a design belong together: a base point with its variations, or a trajectory."""
    return parameters + 2 if method == "sobol" else parameters + 1


def _sobol(_shares: np.ndarray, blocks: np.ndarray, _chosen: np.ndarray) -> dict[str, np.ndarray]:
    """Return S1 and ST of numbers (base points, parameters + 2) in the order of Saltelli's design."""
    from SALib.analyze.sobol import first_order, total_order  # noqa: PLC0415 - optional, and slow to load

    scaled = (blocks - blocks.mean()) / (blocks.std() or 1.0)
    a, mixed, b = scaled[:, 0], scaled[:, 1:-1], scaled[:, -1]
    if np.ptp([a, b]) < LEAST_SPREAD:  # SALib would warn and return zeros
        return {name: np.full(blocks.shape[1] - 2, np.nan) for name in ("S1", "ST")}
    return {
        "S1": np.array([first_order(a, column, b) for column in mixed.T]),
        "ST": np.array([total_order(a, column, b) for column in mixed.T]),
    }


def _morris(shares: np.ndarray, blocks: np.ndarray, chosen: np.ndarray) -> dict[str, np.ndarray]:
    """Return mu*, mu and sigma of numbers (trajectories, parameters + 1); `chosen` are the trajectories' numbers."""
    paths = shares.reshape(-1, blocks.shape[1], shares.shape[1])[chosen]
    moves = np.diff(paths, axis=1)
    which = np.abs(moves).argmax(axis=2)
    steps = np.take_along_axis(moves, which[..., None], axis=2)[..., 0]
    effects = np.empty((len(blocks), shares.shape[1]))
    np.put_along_axis(effects, which, np.diff(blocks, axis=1) / steps, axis=1)
    return {"mu*": np.abs(effects).mean(axis=0), "mu": effects.mean(axis=0), "sigma": effects.std(axis=0, ddof=1)}


def _indices(
    estimated: Callable[..., dict[str, np.ndarray]], numbers: np.ndarray, names: list[str], rows: int
) -> dict[str, dict[str, Interval]]:
    """Return estimates with intervals from bootstrap samples of groups of rows and of seeds."""
    blocks = numbers.reshape(-1, rows, numbers.shape[1])
    groups, seeds = len(blocks), numbers.shape[1]
    found = estimated(blocks.mean(axis=2), np.arange(groups))
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    drawn: dict[str, list[np.ndarray]] = {index: [] for index in found}
    for _ in range(RESAMPLES):
        chosen, some = rng.integers(groups, size=groups), rng.integers(seeds, size=seeds)
        weights = np.bincount(some, minlength=seeds) / seeds
        for index, values in estimated(blocks[chosen] @ weights, chosen).items():
            drawn[index].append(values)
    least = ROUNDING * max(float(np.nanmax(np.abs(values), initial=0.0)) for values in found.values())
    return {
        index: {
            name: _interval(x, s, least)
            for name, x, s in zip(names, values, np.std(drawn[index], axis=0, ddof=1), strict=True)
        }
        for index, values in found.items()
    }


def _interval(estimate: float, deviation: float, least: float) -> Interval:
    """Return an estimate with its interval; what is smaller than `least` is an error of rounding, and 0."""
    x, half = (0.0 if abs(number) < least else float(number) for number in (estimate, Z * deviation))
    return Interval(x, x - half, x + half)


def _chance(numbers: np.ndarray) -> float:
    """Return the share of the variance of the points' means that is due to seeds, what all points share left out."""
    points, seeds = numbers.shape
    if seeds < 2:
        return float("nan")
    means = numbers.mean(axis=1)
    rest = numbers - means[:, None] - numbers.mean(axis=0) + numbers.mean()
    spread = means.var(ddof=1)
    noise = float((rest**2).sum()) / ((points - 1) * (seeds - 1)) / seeds
    return float(noise / spread) if noise > ROUNDING**2 * spread else 0.0


def _ends(interval: Interval) -> tuple[float, float, float]:
    return interval.estimate, interval.low, interval.high
