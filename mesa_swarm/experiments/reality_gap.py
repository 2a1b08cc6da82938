"""The reality gap: scores of a model while a dial goes from ideal robots to measured ones."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_number, shortened
from mesa_swarm.base.wording import quantity
from mesa_swarm.experiments.experiment import checked_settings
from mesa_swarm.experiments.figures import COLOURS, drawable, with_lanes_beyond
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.plan import ComparisonPlan, checked_plan
from mesa_swarm.experiments.reports import counted, notes_on_rows, split_measure, sum_of_left_out
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.runs import Run, completed, has_numbers, simulate
from mesa_swarm.experiments.statistics import Interval, bootstrap_mean, pair_differences
from mesa_swarm.experiments.tables import Study, csv_text, fitting, with_limits
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.model.gallery import find_model, short_name
from mesa_swarm.robots.imperfections import PRESETS, Imperfections, combine_imperfections
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.figures import literal, make_plain, plain_figure, png
from mesa_swarm.viewing.palette import LIGHT

DIAL = (0.0, 0.25, 0.5, 0.75, 1.0)
SEEDS = 10
# The parameter that the dial sets, and the column of its places.
IMPERFECTIONS = "imperfections"


@dataclass(frozen=True, kw_only=True, slots=True)
class Gap(Study):
    """The scores of a model over the dial: by place one score a seed, None where it did not happen."""

    model: str
    measure: str
    preset: str
    dial: tuple[float, ...]
    seeds: Sequence[int]
    steps: int
    scores: dict[float, list[float | None]] = field(default_factory=dict)
    # By reporter, how many rows in all runs were missing and are left out of its reports, where any were.
    left_out: dict[str, int] = field(default_factory=dict)
    # Tables of all results, and folders of series, that were written.
    stored: tuple[Path, ...] = ()

    def mean(self, place: float) -> Interval:
        """Return the mean score at a place of the dial, with its interval."""
        return bootstrap_mean([score for score in self.scores[place] if score is not None])

    def lost(self, place: float) -> Interval:
        """Return the difference from the score of ideal robots, on the same seeds."""
        return bootstrap_mean(pair_differences(self.scores[self.dial[0]], self.scores[place]))

    def table(self, width: int | None = None) -> str:
        """Return the scores as text, at most `width` columns wide if that is given."""
        header = ["dial", f"{self.measure} [95 %]", f"minus dial {self.dial[0]:g} [95 %]"]
        rows = [
            [
                f"{place:g}",
                with_limits(self.mean(place)),
                "" if i == 0 else with_limits(self.lost(place), signed=True),
            ]
            for i, place in enumerate(self.dial)
        ]
        seeds = quantity(len(self.seeds), "paired seed")
        title = f"{self.model}, {self.preset} robots: {seeds}, at most {self.steps:,} steps each"
        notes = notes_on_rows(self.left_out)
        return "\n".join([title, "", *fitting([header, *rows], width), *([""] if notes else []), *notes])

    def csv(self) -> str:
        """Return one line a run."""
        runs = ([p, seed, s] for p in self.dial for seed, s in zip(self.seeds, self.scores[p], strict=True))
        return csv_text([["dial", "rng", self.measure], *runs])

    def _texts(self) -> dict[str, str]:
        return {"reality_gap.csv": self.csv()}

    def _pictures(self) -> dict[str, bytes]:
        return {"reality_gap.png": png(gap_figure(self))}


def reality_gap(
    model: str,
    *,
    preset: str = "measured",
    dial: Sequence[float] = DIAL,
    seeds: int | Sequence[int] = SEEDS,
    steps: int | None = None,
    measure: str | None = None,
    settings: dict[str, Any] | None = None,
    jobs: int = 1,
    progress: bool = False,
    out: str | os.PathLike[str] | None = None,
    until: Callable[[Any], object] | str | None = None,
    series: bool | str = False,
    tables: Sequence[str] = (),
) -> Gap:
    """Run a model at every place of the dial, over the same seeds.

    Parameters
    ----------
    model : str
        Its name or address (`gallery.find_model`).
    preset : str
        "measured" or "robotarium", see `robots.imperfections`.
    dial : sequence of float
        0 to 1, rising; robots at 0 are ideal, and their runs bitwise those without any dial.
    seeds : int or sequence of int
    steps : int, optional
        At most; by default those that the model declares.
    measure : str, optional
        The result that is the score, or a report as "mean of NAME" (see `sweep`); by default the model's `headline`,
        else its first result, that it has in every run.
    settings : dict, optional
        Other parameters of the model; `noise` and `slip` are added to what the dial sets, `imperfections` is refused.
    jobs : int
        Processes at a time, -1 for one on each core.
    progress : bool
    out : path, optional
        Folder in which each run is stored as soon as it is done: what was interrupted, or killed, continues
        when it is called again with the same folder.
    until, series, tables
        See `sweep`; series and tables need `out`. The column `imperfections` is the place of the dial.

    Examples
    --------
    >>> gap = reality_gap("agglomeration", dial=(0, 1), seeds=[1], steps=5, settings={"n_robots": 4})
    >>> gap.measure, sorted(gap.scores)
    ('groups', [0.0, 1.0])
    """
    workers, files = checked_jobs(jobs), RunFiles.checked(out, series=series, tables=tables)
    whole, places = PRESETS[check_choice("preset", preset, PRESETS)], checked_dial(dial)
    model_class = find_model(model)
    if IMPERFECTIONS in (settings or {}):
        raise InvalidValueError("imperfections is given as a setting; leave it out, the dial sets it")
    reports = () if measure is None or split_measure(measure) is None else (measure,)
    free = _freed(model_class, settings)
    plan = files.of(checked_plan(model_class, seeds=seeds, steps=steps, settings=free, measures=reports, until=until))
    runs = {place: _runs(plan, settings or {}, whole, place) for place in places}
    rows = _results(plan, runs, measure, files, workers, progress)
    wanted = chosen_measure(rows, measure, getattr(model_class, "headline", ())[:1])
    return Gap(
        model=short_name(model),
        measure=wanted,
        preset=preset,
        dial=places,
        seeds=plan.seeds,
        steps=plan.steps,
        scores={place: [row[wanted] for row in row_of] for place, row_of in rows.items()},
        left_out=sum_of_left_out(row for row_of in rows.values() for row in row_of) if reports else {},
        stored=tuple(files.written),
    )


def _results(
    plan: ComparisonPlan,
    runs: Mapping[float, Sequence[Run]],
    measure: str | None,
    files: RunFiles,
    workers: int,
    progress: bool,
) -> dict[float, list[dict[str, Any]]]:
    """Do the runs at all places of the dial that are not stored, and return the numbers of all, by place."""
    built = plan.built(plan.seeds[0], plan.values[0])
    names = list(dict.fromkeys([*(built.results() if hasattr(built, "results") else ()), *counted(plan.reports)]))

    def check(outcome: Outcome) -> None:
        if measure is not None:
            check_choice("measure", measure, outcome.numbers)  # now, not when all is done

    every = [run for at_place in runs.values() for run in at_place]
    with files.ledger(fits=partial(has_numbers, names=names)) as ledger:
        done = completed(every, simulate, ledger=ledger, each=check, workers=workers, progress=progress)
    files.write(plan, lambda: ((run, done[run.key]) for run in every))
    return {place: [done[run.key].numbers for run in at_place] for place, at_place in runs.items()}


def _freed(model_class: type, settings: dict[str, Any] | None) -> dict[str, Any]:
    """Return the settings without the parameter that the model's own comparison varies."""
    varied = getattr(model_class, "compares", (None,))[0]
    return {name: value for name, value in (settings or {}).items() if name != varied}


def _runs(plan: ComparisonPlan, settings: dict[str, Any], whole: Imperfections, place: float) -> list[Run]:
    """Return a run for each seed of a plan; keys are those of a sweep, with the imperfections of the robots."""
    keyed = {**checked_settings(plan.model_class, settings), "imperfections of robots": repr(whole.at(place))}
    make, dialled = partial(imperfect, plan.model_class, whole), {**settings, IMPERFECTIONS: place}
    return [replace(plan.keyed_run(dialled, rng, plan.key(keyed, rng)), make=make) for rng in plan.seeds]


def imperfect(model_class: type, whole: Imperfections, /, imperfections: float, **settings: Any) -> SwarmModel:
    """Return a model whose robots have these at a place of the dial, besides what its own settings make of them."""
    model, more = model_class(**settings), whole.at(imperfections)
    if more is not None:
        model.imperfections = combine_imperfections(model.imperfections, more)
    return model


def checked_dial(dial: Sequence[float]) -> tuple[float, ...]:
    """Return places of the dial that rise from 0 to 1 at most."""
    places = tuple(check_number("dial", place, minimum=0, maximum=1) for place in dial)
    if len(places) < 2 or any(b <= a for a, b in pairwise(places)):
        raise InvalidValueError(f"dial is {shortened(dial)}; expected at least two rising places such as (0, 0.5, 1)")
    return places


def chosen_measure(rows: dict[float, list[dict]], measure: str | None, first: Sequence[str] = ()) -> str:
    """Return the result that is the score: the one that is wanted, or the first that every run has.

    The names in `first` come before all others.
    """
    runs = [run for place in rows.values() for run in place]
    if measure is not None:
        return check_choice("measure", measure, runs[0])
    names = (*first, *runs[0])
    return next((name for name in names if all(run[name] is not None for run in runs)), next(iter(runs[0])))


def gap_figure(gap: Gap) -> Figure:
    """Return the standard picture: the score over the dial, each seed a thin line, means with their intervals."""
    figure, ((axes,),) = plain_figure((7.5, 4.5))
    draw_gap(axes, gap)
    return figure


def gaps_figure(gaps: Sequence[Gap]) -> Figure:
    """Return the standard pictures of several models, at least one, two in a row."""
    rows = (len(gaps) + 1) // 2
    figure = Figure(figsize=(11, 3.4 * rows), layout="constrained")
    for place, gap in enumerate(gaps, 1):
        draw_gap(figure.add_subplot(rows, 2, place), gap)
    return figure


def draw_gap(axes: Axes, gap: Gap) -> None:
    """Draw the standard picture."""
    scores = np.array([gap.scores[place] for place in gap.dial], float)
    scores = with_lanes_beyond(axes, drawable(scores))
    axes.plot(gap.dial, scores, color=LIGHT.faint, linewidth=0.7, alpha=0.5)
    means = drawable(np.array([(mean.estimate, mean.low, mean.high) for mean in map(gap.mean, gap.dial)]))
    estimate, low, high = np.where(np.isinf(means), np.nan, means).T
    reach = np.nan_to_num([estimate - low, high - estimate])
    axes.errorbar(gap.dial, estimate, reach, fmt="o-", color=COLOURS[0], linewidth=2, capsize=4)
    if not np.isnan(estimate[0]):
        axes.axhline(estimate[0], color=COLOURS[1], linestyle="--", linewidth=1)
    axes.set(xlabel=literal(f"dial: 0 ideal, 1 {gap.preset}"), ylabel=literal(gap.measure))
    axes.set_title(literal(f"{gap.model}: {quantity(len(gap.seeds), 'seed')} (thin), their mean, 95 %"), fontsize=11)
    make_plain(axes, grid=True)
