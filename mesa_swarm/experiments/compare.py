"""Compare values of a model's parameter over paired seeds, on all cores."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

from mesa_swarm.base.files import write_whole
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.plan import ComparisonPlan, PairedOutcome, PairedRuns, checked_plan
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.runs import completed, has_numbers, stored_in
from mesa_swarm.experiments.tables import WIDEST, Study, finding, runs_csv, summary_csv, summary_rows, text_table
from mesa_swarm.experiments.worker_pool import checked_jobs


@dataclass(frozen=True, slots=True, repr=False)
class Comparison(Study, PairedRuns):
    """The runs of a comparison, with its table, its finding and its files.

    Examples
    --------
    >>> comparison = compare("fire_fighting", seeds=2, steps=5, jobs=1)
    >>> comparison.column("A", "fires out")
    [0, 0]
    """

    def table(self, width: int = WIDEST) -> str:
        """Return the summary as text, at most `width` columns wide."""
        return text_table(self, width)

    def finding(self) -> str:
        """Return the finding in one sentence."""
        return finding(self)

    def _texts(self) -> dict[str, str]:
        summary = summary_csv(summary_rows(self))
        return {"runs.csv": runs_csv(self), "summary.csv": summary, "finding.txt": f"{self.finding()}\n"}

    def _pictures(self) -> dict[str, bytes]:
        from mesa_swarm.experiments.figures import comparison_pictures  # noqa: PLC0415 - slow to load

        return comparison_pictures(self)


def compare(
    model: type | str,
    parameter: str | None = None,
    values: Iterable | None = None,
    seeds: int | Sequence[int] = 30,
    *,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measures: Sequence[str] = (),
    jobs: int = -1,
    progress: bool = False,
    out: str | os.PathLike[str] | None = None,
    until: Callable[[Any], object] | str | None = None,
    series: bool | str = False,
    tables: Sequence[str] = (),
) -> Comparison:
    """Run a model with several values of one parameter over the same seeds, and compare the results.

    Runs with the same seed share their random numbers (common random numbers, [1]_): robots start at the same
    places, and sensors and wheels err alike, so that differences within a seed show the parameter and not chance.
    Every value is compared with the first. The results do not depend on the number of jobs.

    - **in runs**: share of runs in which it happened: the result was not None; Wilson
    - **mean**: over those runs; bootstrap over seeds (`statistics.bootstrap_mean`)
    - **minus the first**: mean of the differences on the same seed, over seeds on which it happened under both;
      bootstrap over these pairs
    - **larger on**: effect size: the share of seeds on which it was larger than under the first value, ties half
      (`statistics.superiority`); Wilson. A result whose name ends in "at" is a time: where it did not happen it counts
      as later than any.

    Parameters
    ----------
    model : type or str
        A SwarmModel with a method ``results``, or its name or address (`gallery.find_model`).
    parameter, values
        By default the model's attribute ``compares``; the values of another parameter may be left
        out if it has a `Choice`.
    seeds : int or sequence of int
        Each value is run with rng 1, 2, ... seeds, or with these; at most 100,000.
    steps : int
        By default the model's attribute ``steps_to_compare``, else 3,000.
    settings : mapping
        Other parameters, the same in all runs.
    measures : sequence of str
        The results that are compared, in this order; all of them by default.
    jobs : int
        Processes that work at the same time; -1 for one on each core.
    progress : bool
        Whether to show a bar with the time left and the time of day at which it is done.
    out : path, optional
        Folder in which each run is stored as soon as it is done. A comparison that was interrupted, or whose process
        was killed, continues when it is called again with the same folder. Runs of code that was changed
        since are other runs (`source_hash`).
    until, series, tables
        See `sweep`; series and tables need `out`, the folder to which they are written.

    Raises
    ------
    SwarmError
        Before anything is run, if anything about it is wrong.

    References
    ----------
    .. [1] Law, Simulation Modeling and Analysis, 5th edition (2015), section 11.2.

    Examples
    --------
    >>> found = compare("fire_fighting", "strategy", ["A", "B"], 2, steps=5, jobs=1)
    >>> found.column("B", "fires out"), found.plan.steps
    ([0, 0], 5)
    >>> compare("agglomeration", "n_robots", [4, 6], seeds=[7], steps=5, jobs=1).runs[0].rng
    7
    """
    workers, files = checked_jobs(jobs), RunFiles.checked(out, series=series, tables=tables)
    plan = checked_plan(model, parameter, values, seeds, steps=steps, settings=settings, measures=measures, until=until)
    return run_plan(plan, workers, progress, folder=files)


def run_plan(
    plan: ComparisonPlan,
    workers: int = 1,
    progress: bool = False,
    heard: Callable[[PairedOutcome], object] = lambda outcome: None,
    folder: RunFiles | str | os.PathLike[str] | None = None,
) -> Comparison:
    """Do all runs of a plan that are not stored, and return all of them.

    Parameters
    ----------
    plan : ComparisonPlan
    workers : int
        Processes, from `checked_jobs`.
    progress : bool
    heard : callable, optional
        Called with each outcome as soon as its run is done.
    folder : RunFiles or path, optional
        Where each run is stored as soon as it is done, and what is written of all.

    Examples
    --------
    >>> len(run_plan(checked_plan("fire_fighting", seeds=1, steps=2)).runs)
    2
    """
    files = RunFiles.at(folder)
    plan = files.of(plan)
    with files.ledger(fits=has_numbers) as ledger:
        runs = list(plan.runs(keyed=ledger is not None))
        stored = stored_in(ledger, runs)
        do = partial(completed, runs, plan.simulate, ledger=ledger, each=heard, workers=workers, progress=progress)
        # Portraits are not stored: for the pictures the runs with the first seed are done again.
        later = [run for run in runs if run.key in stored and run.rng != plan.seeds[0]]
        known = {run.key: plan.paired(run, stored[run.key]) for run in later}
        found = cast(dict[str, PairedOutcome], do(known=known))
        first = found[runs[0].key]
        other = {key for key, outcome in known.items() if not _is_alike(outcome, first)}
        if other:  # runs that have other results than the first
            alike = {key: outcome for key, outcome in found.items() if key not in other}
            found = cast(dict[str, PairedOutcome], do(known=alike))
    done_before = sum(_is_alike(outcome, found[key]) for key, outcome in stored.items())
    # Of two values that are the same map, each has its own name in the tables.
    ordered = (replace(found[run.key], value=run.settings[plan.parameter]) for run in runs)
    comparison = Comparison(plan, tuple(ordered), done_before)
    files.write(
        plan,
        lambda: zip(runs, comparison.runs, strict=True),
        lambda path: write_whole(path, runs_csv(comparison)),
        keeps_csv=True,
    )
    return comparison


def _is_alike(one: Outcome, another: Outcome) -> bool:
    """Return whether two runs have the same results in the same order, whatever their numbers."""
    return list(one.numbers) == list(another.numbers)
