"""The reality gap: what a model scores while a dial goes from ideal robots to measured ones."""

import os
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.errors import InvalidValueError, check_choice, check_number, shortened
from mesa_swarm.experiments.compare import LEDGER, checked_jobs, has_numbers
from mesa_swarm.experiments.experiment import Experiment, Outcome, checked_settings, source_hash
from mesa_swarm.experiments.figures import COLOURS, write_with_pictures
from mesa_swarm.experiments.ledger import Ledger
from mesa_swarm.experiments.plan import checked_plan, checked_seeds, numbers_of
from mesa_swarm.experiments.pool import results_of
from mesa_swarm.experiments.statistics import Interval, bootstrap_mean, pair_differences
from mesa_swarm.experiments.tables import aligned, csv_text, in_words
from mesa_swarm.files import check_writable
from mesa_swarm.gallery import find_model
from mesa_swarm.progress import progress_bar
from mesa_swarm.robots.imperfections import PRESETS, Imperfections
from mesa_swarm.viewing.pictures import literal, png

DIAL = (0.0, 0.25, 0.5, 0.75, 1.0)
SEEDS = 10


@dataclass(frozen=True, kw_only=True, slots=True)
class Gap:
    """The scores of a model over the dial.

    Parameters
    ----------
    model : str
    measure : str
        The result that is the score.
    preset : str
    dial : tuple of float
    seeds : sequence of int
    steps : int
        At most, of every run.
    scores : dict
        By place of the dial, one score a seed; None where it did not happen.
    """

    model: str
    measure: str
    preset: str
    dial: tuple[float, ...]
    seeds: Sequence[int]
    steps: int
    scores: dict[float, list[float | None]] = field(default_factory=dict)

    def mean(self, place: float) -> Interval:
        """Return the mean score at a place of the dial, with its interval."""
        return bootstrap_mean([score for score in self.scores[place] if score is not None])

    def lost(self, place: float) -> Interval:
        """Return by how much the score differs there from that of ideal robots, on the same seeds."""
        return bootstrap_mean(pair_differences(self.scores[self.dial[0]], self.scores[place]))

    def table(self) -> str:
        """Return the scores as text."""
        header = ["dial", f"{self.measure} [95 %]", f"minus dial {self.dial[0]:g} [95 %]"]
        rows = [
            [f"{place:g}", in_words(self.mean(place)), "" if i == 0 else in_words(self.lost(place), signed=True)]
            for i, place in enumerate(self.dial)
        ]
        title = f"{self.model}, {self.preset} robots: {len(self.seeds)} paired seeds, at most {self.steps:,} steps each"
        return "\n".join([title, "", *aligned([header, *rows])])

    def csv(self) -> str:
        """Return one line a run."""
        runs = ([p, seed, s] for p in self.dial for seed, s in zip(self.seeds, self.scores[p], strict=True))
        return csv_text([["dial", "rng", self.measure], *runs])

    def save(self, folder: Path) -> list[Path]:
        """Write the table and the picture, both or none, and return their paths.

        If the picture cannot be drawn, the table is written without it, before that error is raised.
        """
        return write_with_pictures(
            folder, {"reality_gap.csv": self.csv()}, lambda: {"reality_gap.png": png(gap_figure(self))}
        )


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
) -> Gap:
    """Run a model of the gallery at every place of the dial, over the same seeds.

    Parameters
    ----------
    model : str
    preset : str
        "measured" or "robotarium", see `robots.imperfections`.
    dial : sequence of float
        0 to 1, rising; robots at 0 are ideal, and their runs bitwise those without any dial.
    seeds : int or sequence of int
    steps : int, optional
        At most; by default what the model says.
    measure : str, optional
        The result that is the score; by default the model's `headline`, else its first, that it has in every run.
    settings : dict, optional
        Other parameters of the model.
    jobs : int
        Processes at a time, -1 for one on each core.
    progress : bool
    out : path, optional
        Folder in which each run is stored as soon as it is done: what was interrupted, or killed, goes on from there
        when it is called again with the same folder.

    Raises
    ------
    SwarmError
        If anything about it is wrong.

    Examples
    --------
    >>> gap = reality_gap("agglomeration", dial=(0, 1), seeds=[1], steps=5, settings={"n_robots": 4})
    >>> gap.measure, sorted(gap.scores)
    ('groups', [0.0, 1.0])
    """
    workers = checked_jobs(jobs)
    whole = PRESETS[check_choice("preset", preset, PRESETS)]
    places = checked_dial(dial)
    plan = checked_plan(find_model(model), seeds=checked_seeds(seeds), steps=steps, settings=_freed(model, settings))
    tasks = [(model, settings or {}, whole, place, seed, plan.steps) for place in places for seed in plan.seeds]
    names = list(plan.built(plan.seeds[0], plan.values[0]).results())

    def fits(outcome: Outcome) -> bool:
        return has_numbers(outcome) and list(outcome.results or ()) == names

    with nullcontext() if out is None else Ledger(check_writable(out) / LEDGER, fits=fits) as ledger:
        results = _made(tasks, workers, measure, progress, ledger)
    rows = {place: [results[place, seed] for seed in plan.seeds] for place in places}
    wanted = chosen_measure(rows, measure, getattr(find_model(model), "headline", ())[:1])
    scores = {place: [row[wanted] for row in row_of] for place, row_of in rows.items()}
    return Gap(
        model=model, measure=wanted, preset=preset, dial=places, seeds=plan.seeds, steps=plan.steps, scores=scores
    )


def _freed(model: str, settings: dict[str, Any] | None) -> dict[str, Any]:
    """Return the settings without the parameter that the model's own comparison varies."""
    varied = getattr(find_model(model), "compares", (None,))[0]
    return {name: value for name, value in (settings or {}).items() if name != varied}


def _made(
    tasks: list[tuple], workers: int, measure: str | None, progress: bool, ledger: Ledger | None
) -> dict[tuple[float, int], dict]:
    """Return the results of all runs by place and seed; those that the ledger has are not done again."""
    keys = {} if ledger is None else {task[3:5]: _key(*task) for task in tasks}
    stored = {at: ledger.outcome(key) for at, key in keys.items()} if ledger is not None else {}
    results = {at: outcome.results or {} for at, outcome in stored.items() if outcome is not None}
    left = [task for task in tasks if task[3:5] not in results]
    with progress_bar(len(tasks), "runs", progress) as bar:
        bar.initial = bar.n = len(results)
        bar.refresh()
        for place, seed, row in results_of(min(workers, max(len(left), 1)), gap_run, left):
            if measure is not None:
                check_choice("measure", measure, row)  # now, not when all is done
            results[place, seed] = row
            if ledger is not None:
                ledger.append(keys[place, seed], Outcome(results=row))
            bar.update()
    return results


def _key(model: str, settings: dict, whole: Imperfections, place: float, rng: int, steps: int) -> str:
    """Return the fingerprint of a run: that of a sweep's, and how imperfect the robots are."""
    model_class = find_model(model)
    experiment = Experiment(model_class, {}, (), (), steps, source=source_hash(model_class))
    imperfect = {"imperfections of robots": repr(whole.at(place))}
    return experiment.key({**checked_settings(model_class, settings), **imperfect}, rng)


def gap_run(
    model: str, settings: dict, whole: Imperfections, place: float, rng: int, steps: int
) -> tuple[float, int, dict]:
    """Do one run, and return its place, seed and results."""
    built = find_model(model)(**settings, rng=rng)
    built.imperfections = whole.at(place)
    return place, rng, numbers_of(built.run(steps).results())


def checked_dial(dial: Sequence[float]) -> tuple[float, ...]:
    """Return places of the dial that rise from 0 to 1 at most.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> checked_dial([0, 1])
    (0.0, 1.0)
    """
    places = tuple(check_number("dial", place, minimum=0, maximum=1) for place in dial)
    if len(places) < 2 or any(b <= a for a, b in pairwise(places)):
        raise InvalidValueError(f"dial is {shortened(dial)}; expected at least two rising places such as (0, 0.5, 1)")
    return places


def chosen_measure(rows: dict[float, list[dict]], measure: str | None, first: Sequence[str] = ()) -> str:
    """Return the result that is the score: the one that is wanted, or the first that there is in every run.

    What `first` names is looked at before all others.

    Examples
    --------
    >>> chosen_measure({0.0: [{"arrived at": None, "way left": 3.0}]}, None)
    'way left'
    """
    runs = [run for place in rows.values() for run in place]
    if measure is not None:
        return check_choice("measure", measure, runs[0])
    names = (*first, *runs[0])
    return next((name for name in names if all(run[name] is not None for run in runs)), next(iter(runs[0])))


def gap_figure(gap: Gap) -> Figure:
    """Return the standard picture: the score over the dial, each seed a thin line, means with their intervals.

    Parameters
    ----------
    gap : Gap
    """
    figure = Figure(figsize=(7.5, 4.5), layout="constrained")
    draw_gap(figure.add_subplot(), gap)
    return figure


def gaps_figure(gaps: Sequence[Gap]) -> Figure:
    """Return the standard pictures of several models, two in a row.

    Parameters
    ----------
    gaps : sequence of Gap
        At least one.
    """
    rows = (len(gaps) + 1) // 2
    figure = Figure(figsize=(11, 3.4 * rows), layout="constrained")
    for place, gap in enumerate(gaps, 1):
        draw_gap(figure.add_subplot(rows, 2, place), gap)
    return figure


def draw_gap(axes: Axes, gap: Gap) -> None:
    """Draw the standard picture."""
    scores = np.array([gap.scores[place] for place in gap.dial], float)
    axes.plot(gap.dial, scores, color="#8a8a8a", linewidth=0.7, alpha=0.5)
    means = [gap.mean(place) for place in gap.dial]
    reach = np.nan_to_num([[m.estimate - m.low for m in means], [m.high - m.estimate for m in means]])
    axes.errorbar(gap.dial, [m.estimate for m in means], reach, fmt="o-", color=COLOURS[0], linewidth=2, capsize=4)
    axes.axhline(means[0].estimate, color=COLOURS[1], linestyle="--", linewidth=1)
    axes.set(xlabel=literal(f"dial: 0 ideal, 1 {gap.preset}"), ylabel=literal(gap.measure))
    axes.set_title(literal(f"{gap.model}: {len(gap.seeds)} seeds (thin), their mean, 95 %"), fontsize=11)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
