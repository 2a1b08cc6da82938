"""Calibration: parameters at which measures of a model are near their targets, searched by Optuna over a sweep."""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import pandas as pd

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.base.extras import require_extra
from mesa_swarm.base.wording import in_brief, quantity
from mesa_swarm.experiments.experiment import (
    LARGEST_SEED,
    MOST_SEEDS,
    POINT,
    Experiment,
    check_result_names,
    checked_class,
    checked_measures,
)
from mesa_swarm.experiments.reports import LEFT_OUT, OF, notes_on_rows, sum_of_left_out
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.sampling import Range, checked_ranges, range_text
from mesa_swarm.experiments.statistics import FEWEST, Summary, known, mean_interval, summarised
from mesa_swarm.experiments.sweep import run_experiment
from mesa_swarm.experiments.tables import WIDEST, Study, csv_text, fitting, with_limits
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.searches.adaptive import AdaptiveDesign

LOSS, FAILED = "loss", "failed"
# Folder of the runs with fresh seeds, in that of the search.
FRESH = "fresh"
MOST_POINTS = 100_000
LossFunction = Callable[[Mapping[str, float | None]], float | None]


@dataclass(frozen=True, kw_only=True, slots=True)
class Target:
    """The value that the mean of a measure is to have, and the deviation from it that counts as 1.

    Examples
    --------
    >>> Target(value=7.0, scale=2.0).deviation(4.0)
    -1.5
    """

    value: float
    scale: float

    def deviation(self, mean: float) -> float:
        """Return by how many scales a mean deviates."""
        return (mean - self.value) / self.scale


@dataclass(frozen=True, kw_only=True, slots=True, repr=False, eq=False)
class Calibration(Study):
    """The outcome of a calibration, its table, picture and files; made by `calibrate`.

    Parameters
    ----------
    experiment : Experiment
        The model, settings, seeds and steps of the search.
    ranges : mapping of str to Range
    targets : mapping of str to Target
        Empty if the loss is a function of the user's.
    history : DataFrame
        One row a point of the search, in order: `point`, the parameters, the means of the measures over the seeds,
        `failed` runs, and `loss`, NaN where there is none.
    point : int
        The point with the least loss.
    best : dict
        Its parameters.
    seeds : sequence of int
        The fresh seeds, none of which the search has used.
    measures : mapping of str to Summary
        Each measure of the best point over the fresh seeds.
    failed : int
        Runs with fresh seeds that ended in an error.
    loss : float
        The loss of the best point over the fresh seeds, NaN where there is none.
    left_out : mapping of str to int
        By reporter, how many rows in all runs were missing and are left out of its reports, where any were.
    """

    experiment: Experiment
    ranges: Mapping[str, Range]
    targets: Mapping[str, Target]
    history: pd.DataFrame
    point: int
    best: dict[str, Any]
    seeds: Sequence[int]
    measures: Mapping[str, Summary]
    failed: int
    loss: float
    left_out: Mapping[str, int] = field(default_factory=dict)

    @property
    def searched(self) -> dict[str, Any]:
        """The best point's row of the history: its means in the search, which selection has made too good."""
        return dict(self.history.iloc[self.point])

    def table(self, width: int = WIDEST) -> str:
        """Return the best parameters, and the measures there, as text, at most `width` columns wide."""
        chosen = [["parameter", "range", "best"]]
        chosen += [[name, range_text(each), in_brief(self.best[name])] for name, each in self.ranges.items()]
        head = ["measure", "target", "in the search", "fresh seeds [95 %]", "deviation"]
        rows = [self._row(name, summary) for name, summary in self.measures.items()]
        seeds, fresh = len(self.experiment.seeds), len(self.seeds)
        title = (
            f"{self.experiment.model_class.__name__}: best of {quantity(len(self.history), 'point')}, "
            f"{quantity(seeds, 'seed')} at each, then {quantity(fresh, 'fresh seed')}"
        )
        tables = [*fitting(chosen, width), "", *fitting([head, *rows], width)]
        return "\n".join([title, "", *tables, "", *self._notes()])

    def _row(self, name: str, summary: Summary) -> list[str]:
        target, mean = self.targets.get(name), summary.mean
        wanted = "-" if target is None else in_brief(target.value)
        apart = "-" if target is None or math.isnan(mean.estimate) else f"{target.deviation(mean.estimate):+.3g}"
        missing = summary.runs - summary.happened
        fewer = f" ({summary.happened} of {summary.runs} runs)" if missing else ""
        searched = _number(self.searched[name])
        before = "-" if math.isnan(searched) else f"{searched:.4g}"
        return [name, wanted, before, f"{with_limits(mean)}{fewer}", apart]

    def _notes(self) -> list[str]:
        notes = ["in the search: means over the seeds that chose this point, therefore optimistic."]
        few = f"no intervals: they need at least {FEWEST}" if len(self.seeds) < FEWEST else "bootstrap intervals (BCa)"
        notes.append(f"fresh seeds: {few}.")
        if self.targets:
            scales = ", ".join(f"{name} {each.scale:.4g}" for name, each in self.targets.items())
            notes.append(f"deviation: (mean - target) / scale; scales: {scales}.")
        notes.append(f"Loss {self.searched[LOSS]:.4g} in the search, {self.loss:.4g} over fresh seeds.")
        without = int(self.history[LOSS].isna().sum())
        if without:
            why = "failed runs, or measures that did not happen or are infinite"
            notes.append(f"{quantity(without, 'point')} had no loss: {why}.")
        if self.failed:
            notes.append(f"{quantity(self.failed, 'run')} with fresh seeds ended in an error and are left out.")
        return [*notes, *notes_on_rows(self.left_out)]

    def finding(self) -> str:
        """Return the finding in one sentence."""
        place = ", ".join(f"{name} {in_brief(value)}" for name, value in self.best.items())
        found = [
            f"{name} was {with_limits(summary.mean)}{self._verdict(name, summary)}"
            for name, summary in self.measures.items()
            if summary.happened or name in self.targets
        ]
        return f"With {place}, over {quantity(len(self.seeds), 'fresh seed')}: {'; '.join(found)}."

    def _verdict(self, name: str, summary: Summary) -> str:
        target, mean = self.targets.get(name), summary.mean
        if target is None:
            return ""
        wanted = f" for a target of {in_brief(target.value)}"
        if math.isnan(mean.low):
            return f"{wanted} (no interval)"
        inside = mean.low <= target.value <= mean.high
        return f"{wanted}, which is {'within' if inside else 'outside'} the interval"

    def csv(self) -> str:
        """Return the measures of the best point as CSV: target, mean in the search, mean and limits of fresh seeds."""
        head = ["measure", "target", "scale", "in the search", "runs", "happened", "mean", "low", "high"]
        rows = []
        for name, summary in self.measures.items():
            target, mean = self.targets.get(name), summary.mean
            wanted = (None, None) if target is None else (target.value, target.scale)
            numbers = map(known, (_number(self.searched[name]), mean.estimate, mean.low, mean.high))
            searched, *limits = numbers
            rows.append([name, *wanted, searched, summary.runs, summary.happened, *limits])
        return csv_text([head, *rows])

    def figure(self) -> Any:
        """Return the picture, a Matplotlib figure: the loss of all points in order, and over each parameter."""
        from mesa_swarm.experiments.figures import calibration_figure  # noqa: PLC0415 - slow to load

        title = f"{self.experiment.model_class.__name__}: {quantity(len(self.history), 'point')} of a search"
        return calibration_figure(
            f"{title}, {quantity(len(self.experiment.seeds), 'seed')} at each",
            {name: (each, list(self.history[name])) for name, each in self.ranges.items()},
            self.history[LOSS].to_numpy(float),
            self.point,
        )

    def _texts(self) -> dict[str, str]:
        history = self.history.to_csv(index=False, lineterminator="\n")
        return {"best.csv": self.csv(), "history.csv": history, "calibration.txt": f"{self!r}\n"}

    def _pictures(self) -> dict[str, bytes]:
        from mesa_swarm.viewing.figures import png  # noqa: PLC0415 - slow to load

        return {"calibration.png": png(self.figure())}


def calibrate(
    model: type | str,
    ranges: Mapping[str, Any],
    target: Mapping[str, Any] | LossFunction,
    *,
    points: int = 80,
    batch: int = 8,
    seeds: int | Sequence[int] = 5,
    fresh: int = 20,
    measure: Sequence[str] = (),
    missing: Mapping[str, float] | None = None,
    sampler: Any = None,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    rng: int = 1,
    out: str | os.PathLike[str] = "results/calibration",
    jobs: int = -1,
    progress: bool = False,
    retry_failed: bool = False,
    until: Callable[[Any], object] | str | None = None,
    tables: Sequence[str] = (),
) -> Calibration:
    """Search the parameters at which measures of a model are nearest to their targets, on all cores.

    Optuna proposes points in batches of a fixed size and receives their losses in a fixed order, so that the result
    does not depend on `jobs`. The loss of a point is the sum over measures of ((mean - target) / scale)^2, means being
    those over the seeds. The best of many points owes part of its loss to luck (the winner's curse): it is run again
    with seeds that the search has not used, and only those give the means and intervals of the result.

    All runs go through the ledger of the folder `out`: after a kill the same call proposes the same points and
    finds the finished runs there.

    A point of which a run ends in an error, or has a measure that is infinite, or did not happen and has no number in
    `missing`, has no loss: Optuna learns that it failed, and it is never the best.

    Parameters
    ----------
    model : type or str
        A SwarmModel with a method ``results`` or the reports that are named, or its name or address
        (`gallery.find_model`).
    ranges : mapping of str to (low, high), (low, high, "log"), values or Range
        See `sampling.Range`.
    target : mapping of str to float or (float, float), or function
        By measure its target, or target and scale; the scale is by default the size of the target, 1 for a target of 0.
        Or a function that takes the means by measure (None for one that did not happen in each run) and returns the
        loss to be minimised, None for a point without one.
    points : int
        Points of the search, at least 1.
    batch : int
        Points that are proposed at a time, at least 1; more use more cores, fewer learn more from each other.
    seeds : int or sequence of int
        Seeds 1, 2, ... seeds at each point of the search, or these.
    fresh : int
        Seeds of the best point's runs at the end: those that follow the largest of `seeds`.
    measure : sequence of str
        For a function: the measures that it takes, all results by default; reports too, as in `sweep`.
    missing : mapping of str to float, optional
        The number that counts where a measure did not happen (None), such as `steps` for a time.
    sampler : optuna.samplers.BaseSampler, optional
        A new one, with a seed; by default Optuna's TPE ([1]_) with the seed `rng`.
    steps, settings, jobs, progress, retry_failed, until, tables
        See `sweep`; inside `joblib.parallel_config(backend="dask")` the workers of the cluster do the work.
    rng : int
        Seed of the search.
    out : path
        Folder of the ledger and the table of all runs; those with fresh seeds are in its folder ``fresh``.

    Raises
    ------
    SwarmError
        Before anything is run, if anything is wrong or Optuna is missing; afterwards if no point has a loss.

    References
    ----------
    .. [1] Bergstra et al., Algorithms for hyper-parameter optimization, NeurIPS 24 (2011).

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home:
    ...     found = calibrate(
    ...         "fire_fighting", {"n_robots": (2, 5)}, {"fires out": 0}, points=2, batch=2, seeds=1, fresh=2, steps=5,
    ...         out=home, jobs=1,
    ...     )
    >>> found.loss, list(found.seeds), len(found.history)
    (0.0, [2, 3], 2)
    """
    need_optuna()
    model_class, workers = checked_class(model), checked_jobs(jobs)
    checked, losses = checked_ranges(model_class, ranges), _checked_losses(target, measure, missing)
    for name, count in (("points", points), ("batch", batch)):
        check_count(name, count, minimum=1, maximum=MOST_POINTS)
    check_count("fresh", fresh, minimum=1, maximum=MOST_SEEDS)
    design = AdaptiveDesign(
        model_class,
        seeds=seeds,
        steps=steps,
        settings=settings,
        measure=losses.measure,
        out=out,
        jobs=workers,
        progress=progress,
        retry_failed=retry_failed,
        until=until,
        tables=tables,
    )
    files = RunFiles.checked(out, tables=tables).within(FRESH)
    history = _searched(design, checked, losses, _checked_sampler(sampler, rng), points, batch)
    how: dict[str, Any] = {"workers": workers, "progress": progress, "retry_failed": retry_failed}
    return _judged(design, history, checked, losses, fresh, files, how)


def _judged(
    design: AdaptiveDesign,
    history: pd.DataFrame,
    ranges: Mapping[str, Range],
    losses: "_Losses",
    fresh: int,
    files: RunFiles,
    how: dict[str, Any],
) -> Calibration:
    """Run the best point of a search again with fresh seeds, and return what is known of it then."""
    point, experiment = int(history[LOSS].argmin()), design.experiment
    again = replace(experiment, points=[experiment.points[point]], seeds=_fresh_seeds(experiment.seeds, fresh))
    made = run_experiment(again, files, **how)
    frame = made.frame()
    rows = losses.numbers(frame, again)
    return Calibration(
        experiment=experiment,
        ranges=ranges,
        targets=losses.targets,
        history=history,
        point=point,
        best=dict(again.points[0]),
        seeds=again.seeds,
        measures={str(name): summarised(list(map(known, rows[name]))) for name in rows},
        failed=made.failed,
        loss=losses.of(rows),
        left_out=sum_of_left_out(row for table in (design.table(), frame) for row in _counts(table)),
    )


def _counts(table: pd.DataFrame) -> Iterator[dict[str, float]]:
    """Return how many rows of reports each run leaves out, of runs that ended in an error none."""
    names = [str(name) for name in table if str(name).startswith(LEFT_OUT + OF)]
    return (dict(zip(names, row, strict=True)) for row in table[names].fillna(0).to_numpy(float).tolist())


def _number(mean: float | None) -> float:
    """Return a mean of the history, NaN for one that is missing: pandas stores it as None beside texts."""
    return math.nan if mean is None else float(mean)


def need_optuna() -> None:
    """Check that Optuna is installed; if not, the error gives the command that installs it."""
    require_extra("optuna", "calibration", "calibration needs", "Optuna")


@dataclass(frozen=True, kw_only=True, slots=True)
class _Losses:
    """How the rows of a point become its loss: by targets, or by a function of the user's."""

    targets: Mapping[str, Target]
    function: LossFunction | None
    measure: tuple[str, ...]
    missing: Mapping[str, float]

    def numbers(self, table: pd.DataFrame, experiment: Experiment) -> pd.DataFrame:
        """Return the measures of the runs that ended in no error, with numbers for those that did not happen."""
        taken = {*experiment.fixed, *experiment.columns}
        names = list(self.measure) or [str(name) for name in table if name not in taken]
        check_result_names(names, {LOSS, FAILED})
        for name in self.missing.keys() - set(names):
            raise InvalidValueError(f"missing has {shortened(name)}, which is not one of the measures; leave it out")
        return table.loc[table["error"].isna(), names].astype(float).fillna(dict(self.missing))

    def of(self, rows: pd.DataFrame) -> float:
        """Return the loss of a point, of which no run is missing, from its numbers; NaN if it has none."""
        means = _means(rows)
        if self.function is None:
            apart = [
                math.nan if means[name] is None else each.deviation(means[name]) for name, each in self.targets.items()
            ]
            return _finite(sum_of_squares(apart))
        given = self.function(means)
        return _finite(math.nan if given is None else check_loss(given))


def _finite(loss: float) -> float:
    """Return a loss, NaN for one that is infinite."""
    return loss if math.isfinite(loss) else math.nan


def sum_of_squares(numbers: Sequence[float]) -> float:
    """Return the sum of squares, rounded once; infinity where it is beyond the largest number.

    Examples
    --------
    >>> sum_of_squares([3.0, 4.0]), sum_of_squares([1e200, 1.0])
    (25.0, inf)
    """
    try:
        return math.fsum(number * number for number in numbers)
    except OverflowError:  # of a partial sum
        return math.inf


def check_loss(given: object) -> float:
    """Return the loss that a function of the user's has returned as a float, or refuse it."""
    try:
        return float(given)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InvalidValueError(f"target returned {shortened(given)}; expected a number, or None for no loss") from None


def _means(rows: pd.DataFrame) -> dict[str, Any]:
    """Return the mean of each measure, None where it did not happen in all runs."""
    return {str(name): None if rows[name].isna().any() or rows.empty else _mean(rows[name]) for name in rows}


def _mean(column: pd.Series) -> float:
    mean = float(column.mean())
    return mean if math.isfinite(mean) else mean_interval(column.tolist()).estimate  # of huge numbers it may be finite


def _checked_losses(target: object, measure: Sequence[str], missing: Mapping[str, float] | None) -> _Losses:
    numbers = {name: check_number(f"missing {name}", number) for name, number in (missing or {}).items()}
    if callable(target):
        return _Losses(targets={}, function=target, measure=checked_measures(measure), missing=numbers)
    if not isinstance(target, Mapping) or not target:
        raise InvalidValueError(
            f'target is {shortened(target)}; expected a value by measure, such as {{"fires out": 7}}, or a function'
        )
    if measure:
        raise InvalidValueError("measure is given beside targets, which name their measures; leave it out")
    targets = {name: _checked_target(name, given) for name, given in target.items()}
    for name in numbers.keys() - targets.keys():
        raise InvalidValueError(f"missing has {shortened(name)}, which has no target; leave it out")
    return _Losses(targets=targets, function=None, measure=checked_measures(list(targets)), missing=numbers)


def _checked_target(name: str, given: Any) -> Target:
    """Return the target of a measure, given as a number, or as a number and a scale."""
    if isinstance(given, Target):
        return given
    pair = given if isinstance(given, Sequence) and not isinstance(given, str) else (given, None)
    if len(pair) != 2:
        raise InvalidValueError(f"target of {name} is {shortened(given)}; expected a number, or (number, scale)")
    value = check_number(f"target of {name}", pair[0])
    scale = (abs(value) or 1.0) if pair[1] is None else check_number(f"scale of {name}", pair[1], above=0)
    return Target(value=value, scale=scale)


def _checked_sampler(sampler: Any, rng: int) -> Any:
    """Return a sampler of Optuna's, by default TPE with a seed."""
    from optuna.samplers import BaseSampler, TPESampler  # noqa: PLC0415 - optional, and slow to load

    seed = check_count("rng", rng)
    if sampler is None:
        # Points of a batch stay apart from those whose losses are not known yet.
        return TPESampler(seed=seed, constant_liar=True)
    if not isinstance(sampler, BaseSampler):
        raise InvalidValueError(f"sampler is {shortened(sampler)}; expected one of optuna.samplers")
    return sampler


def _searched(
    design: AdaptiveDesign, ranges: Mapping[str, Range], losses: _Losses, sampler: Any, points: int, batch: int
) -> pd.DataFrame:
    """Return the history of a search: one row a point."""
    from optuna import create_study  # noqa: PLC0415 - optional, and slow to load
    from optuna.trial import TrialState  # noqa: PLC0415

    space = {name: _distribution(each) for name, each in ranges.items()}
    rows: list[dict[str, Any]] = []
    error = ""
    with _without_log():
        study = create_study(sampler=sampler)
        while len(rows) < points:
            trials = [study.ask(space) for _ in range(min(batch, points - len(rows)))]
            design.propose([_settings(ranges, trial.params) for trial in trials])
            numbers_of = range(len(rows), len(rows) + len(trials))
            for trial, point, (_, table) in zip(trials, numbers_of, design.results().groupby(POINT), strict=True):
                numbers = losses.numbers(table, design.experiment)
                failed = len(table) - len(numbers)
                error = error or next(iter(table["error"].dropna()), "")
                loss = math.nan if failed else losses.of(numbers)
                rows.append(
                    {POINT: point, **design.experiment.points[point], **_means(numbers), FAILED: failed, LOSS: loss}
                )
                if math.isnan(loss):
                    study.tell(trial, state=TrialState.FAIL)
                else:
                    study.tell(trial, loss)
    if all(math.isnan(row[LOSS]) for row in rows):
        why = "a measure did not happen, see missing (--missing), or is infinite"
        why = f"a run ended in {shortened(error)}" if error else why
        raise InvalidValueError(
            f"none of {quantity(len(rows), 'point')} has a loss: {why}; choose other ranges or targets"
        )
    return pd.DataFrame(rows)


def _distribution(each: Range) -> Any:
    """Return a range as Optuna takes it; of listed values their indices, since values may be of any type."""
    from optuna.distributions import (  # noqa: PLC0415 - optional, and slow to load
        CategoricalDistribution,
        FloatDistribution,
        IntDistribution,
    )

    if each.low is None or each.high is None:
        return CategoricalDistribution(range(len(each.values)))
    if each.is_whole:
        return IntDistribution(int(each.low), int(each.high), log=each.log)
    return FloatDistribution(each.low, each.high, log=each.log)


def _settings(ranges: Mapping[str, Range], chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Return what Optuna has chosen as settings of the model."""
    return {name: each.values[chosen[name]] if each.values else chosen[name] for name, each in ranges.items()}


@contextmanager
def _without_log() -> Iterator[None]:
    """Silence Optuna's lines about each study, which would break the progress bar; warnings are still shown."""
    from optuna import logging  # noqa: PLC0415 - optional, and slow to load

    before = logging.get_verbosity()
    logging.set_verbosity(max(before, logging.WARNING))
    try:
        yield
    finally:
        logging.set_verbosity(before)


def _fresh_seeds(seeds: Sequence[int], count: int) -> range:
    """Return seeds that follow the largest of those that were used."""
    first = max(seeds) + 1
    check_count("largest fresh seed", first + count - 1, maximum=LARGEST_SEED)
    return range(first, first + count)
