"""Adaptive designs: points proposed batch by batch, each in view of the results so far, through a sweep's ledger."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from mesa_swarm.base.errors import InvalidValueError, check_count, shortened
from mesa_swarm.base.files import check_writable
from mesa_swarm.base.wording import quantity
from mesa_swarm.experiments.experiment import (
    MOST_RUNS,
    POINT,
    Experiment,
    checked_class,
    checked_experiment,
    checked_measures,
    checked_seeds,
    checked_settings,
    checked_steps,
)
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.sweep import TABLE, run_experiment, table_of_runs
from mesa_swarm.experiments.until import checked_condition
from mesa_swarm.experiments.worker_pool import checked_jobs


class AdaptiveDesign:
    """A sweep whose points are not known before: an optimiser proposes some, gets their results, proposes more.

    `propose` takes points, `results` runs them with every seed and returns their rows of the table. All runs go through
    the ledger of the folder: an optimiser that is started again and proposes the same points, because it is
    deterministic, gets the results of finished runs from there.

    Parameters
    ----------
    model : type or str
        A SwarmModel with a method ``results``, or its name or address.
    seeds, steps, settings, measure, out, jobs, progress, retry_failed, until, tables
        See `sweep`; inside `joblib.parallel_config(backend="dask")` the workers of the cluster do the work.

    Raises
    ------
    SwarmError
        Before anything is run, if anything about it is wrong.

    Examples
    --------
    Halving an interval:

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home:
    ...     design = AdaptiveDesign("fire_fighting", seeds=2, steps=5, measure=["fires out"], out=home, jobs=1)
    ...     first = design.propose([{"n_robots": 2}, {"n_robots": 4}])
    ...     sums = design.results().groupby("point")["fires out"].sum()
    ...     second = design.propose([{"n_robots": 3}])
    ...     first, sums.tolist(), second, design.results()["n_robots"].tolist(), len(design.table())
    (range(0, 2), [0.0, 0.0], range(2, 3), [3, 3], 6)
    """

    def __init__(
        self,
        model: type | str,
        *,
        seeds: int | Sequence[int] = 5,
        steps: int | None = None,
        settings: Mapping[str, Any] | None = None,
        measure: Sequence[str] = (),
        out: str | os.PathLike[str] = "results",
        jobs: int = -1,
        progress: bool = False,
        retry_failed: bool = False,
        until: Callable[[Any], object] | str | None = None,
        tables: Sequence[str] = (),
    ) -> None:
        self._model = checked_class(model)
        self._fixed: dict[str, Any] = {
            "seeds": checked_seeds(seeds),
            "steps": checked_steps(self._model, steps),
            "settings": checked_settings(self._model, settings or {}),
            "measure": checked_measures(measure),
            "until": checked_condition(until),
        }
        self._workers = checked_jobs(jobs)
        self._folder = check_writable(out)
        self._files = RunFiles.checked(self._folder, tables=tables)
        self._progress, self._retry_failed = progress, retry_failed
        self._experiment: Experiment | None = None
        self._points: list[dict[str, Any]] = []
        self._done = 0

    def __repr__(self) -> str:
        done = f"{self._done} with results" if self._done else "none with results"
        return f"<{type(self).__name__} of {self._model.__name__}: {quantity(len(self), 'point')} proposed, {done}>"

    def __len__(self) -> int:
        """Count the points that were proposed."""
        return len(self._points)

    @property
    def experiment(self) -> Experiment:
        """The experiment with all points that were proposed, at least one."""
        if self._experiment is None:
            raise InvalidValueError("no points were proposed; call propose(points) first")
        return replace(self._experiment, points=list(self._points))

    def propose(self, points: Iterable[Mapping[str, Any]]) -> range:
        """Add points to be run, and return their numbers: those of the column `point`.

        Parameters
        ----------
        points : iterable of mappings
            Values of the same parameters in all points of the design.

        Raises
        ------
        SwarmError
            If a value cannot be one of its parameter; no point is added then.
        """
        proposed = _listed(points)
        if self._experiment is None:
            self._experiment = checked_experiment(self._model, proposed, **self._fixed)
            listed = list(self._experiment.points)
        else:
            listed = [checked_settings(self._model, point) for point in proposed]
            names = list(self._experiment.points[0])
            for point in listed:
                if point.keys() != set(names):
                    raise InvalidValueError(f"a point sets {shortened(list(point))}; expected {shortened(names)}")
        count = len(self._points) + len(listed)
        check_count("number of runs", count * len(self._fixed["seeds"]), maximum=MOST_RUNS)
        self._points += listed
        return range(count - len(listed), count)

    def results(self) -> pd.DataFrame:
        """Run the points proposed since the last call, and return their rows: one a run, in order.

        The tables of all points so far are written beside the ledger, as by `sweep`. A run that ends in an error is a
        row with it.

        Raises
        ------
        InvalidValueError
            If no points were proposed since.
        """
        experiment = self.experiment
        if self._done == len(self._points):
            raise InvalidValueError("no points were proposed since the last results; call propose(points) first")
        if self._retry_failed:  # only here: the runs of earlier points would be repeated with every batch
            new = replace(experiment, points=experiment.points[self._done :])
            only_runs = RunFiles(self._folder, names_old=False)
            run_experiment(new, only_runs, self._workers, self._progress, retry_failed=True)
        run_experiment(experiment, self._files, self._workers, self._progress)
        self._files = replace(self._files, names_old=False)  # once is enough
        rows = self.table()
        first, self._done = self._done, len(self._points)
        return rows[rows[POINT] >= first].reset_index(drop=True)

    def table(self) -> pd.DataFrame:
        """Return the table of all points whose results were returned."""
        return table_of_runs(self._folder / TABLE)


def _listed(points: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return points as a list of one or more; refuse a single one."""
    listed = [] if isinstance(points, Mapping) or not isinstance(points, Iterable) else list(points)
    if not listed or not all(isinstance(point, Mapping) for point in listed):
        raise InvalidValueError(
            f"points is {shortened(points)}; expected a list of points, such as [{{'n_robots': 5}}]"
        )
    return listed
