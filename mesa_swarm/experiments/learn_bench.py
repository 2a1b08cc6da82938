"""The benchmark of learning: train, measure, tabulate, draw."""

import json
import math
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.errors import check_choice, check_count
from mesa_swarm.experiments.contestants import DESIGN, HOME, PARTS, ROBOTS, Trained, contestants
from mesa_swarm.experiments.driving import MEASURES, drive_measured, driven_world
from mesa_swarm.experiments.experiment import package_version
from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.fingerprints import engine_hash, fingerprint
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm.experiments.pool import checked_jobs
from mesa_swarm.experiments.runs import Run, call, completed
from mesa_swarm.experiments.statistics import Interval, bootstrap_interquartile_mean, known
from mesa_swarm.experiments.tables import csv_text
from mesa_swarm.files import check_writable
from mesa_swarm.viewing.palette import LIGHT
from mesa_swarm.viewing.pictures import literal, png
from mesa_swarm.world.map import Map, builtin_maps
from mesa_swarm.world.random_map import random_map

LEDGER = "ledger.jsonl"
# Results depend on these files and on the engine; after a change the runs are repeated.
SOURCES = ("experiments/contestants.py", "experiments/driving.py", "experiments/evolution.py")
# Generated maps that no contestant was trained, bred or chosen on: all are compared on GENERATED; UNSEEN, which were
# not looked at before everything else was fixed, show whether the target is reached.
GENERATED, UNSEEN = range(1, 21), range(40_001, 40_021)
EVERY = "every unseen map"
# Measured on every unseen map with every seed: the bred ones, and the rule whose coverage they have to reach.
RULE, BRED = "Avoid + Explore", ("evolved reflex", "evolved network")
MODES = ("frozen", "learning")
OF_TRAINING = ("train wall seconds", "train processor seconds", "robot-steps")
# Worlds of the evaluation have other seeds than those of training.
APART = 1_000_000


@dataclass(frozen=True, kw_only=True, slots=True)
class Benchmark:
    """A benchmark of learning: contestants, all by default, trained with the seeds 1, 2, ...

    `steps` are those of training, of 15 robots on `original`; `evaluation_steps` those on each map.
    """

    seeds: int = 10
    steps: int = 33_000
    evaluation_steps: int = 5000
    only: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_count("seeds", self.seeds, minimum=1, maximum=1000)
        check_count("steps", self.steps, minimum=1, maximum=10_000_000)
        check_count("evaluation_steps", self.evaluation_steps, minimum=1, maximum=1_000_000)
        for name in self.only:
            check_choice("contestant", name, contestants())

    @property
    def names(self) -> list[str]:
        """The contestants, in the order of the table."""
        return [name for name in contestants() if not self.only or name in self.only]

    def maps(self, seed: int) -> tuple[str, ...]:
        """Return the maps on which a training with this seed is measured.

        The built-in ones, and two of the 20 generated ones: ten seeds cover all of them.
        """
        first = 2 * (seed - 1)
        mine = (GENERATED[k % len(GENERATED)] for k in (first, first + 1))
        return (*builtin_maps(), *(f"random {number}" for number in mine))

    def key(self, name: str, seed: int) -> str:
        """Return the fingerprint of all that decides the outcome of a training and its evaluation."""
        version = package_version("mesa-swarm")
        return fingerprint(name, seed, self.steps, self.evaluation_steps, version, engine_hash(*SOURCES))

    def runs(self) -> Iterator[Run]:
        """Yield the trainings: seed by seed, so that an interrupted benchmark is a fair one."""
        for seed in range(1, self.seeds + 1):
            for name in self.names:
                yield Run(partial(measured, self), {"name": name}, seed, self.steps, self.key(name, seed))


@dataclass(frozen=True, slots=True, kw_only=True)
class Training(Outcome):
    """The outcome of a training with a seed: results by ``map|mode|measure``, and of the training."""

    name: str
    seed: int

    def rows(self) -> Iterator[tuple[str, str, str, float]]:
        """Yield map, mode, measure and value of the evaluation."""
        for key, value in self.numbers.items():
            parts = key.split("|")
            if len(parts) == 3 and value is not None:
                yield parts[0], parts[1], parts[2], value

    def curve(self) -> list[float]:
        """Return collisions per robot and 1,000 steps in each part of the training."""
        return [value for key, value in self.numbers.items() if key.startswith("training|") and value is not None]


def learn_bench(
    benchmark: Benchmark,
    *,
    out: str | os.PathLike[str],
    jobs: int = 1,
    resume: bool = True,
    progress: bool = False,
) -> list[Training]:
    """Train and measure all contestants.

    Each finished training is on the disk, with its measurements, before the next is waited for. A benchmark that
    was interrupted continues when it is called again with the same folder, unless `resume` is False: then all is done
    again. Results do not depend on the number of jobs.
    """
    workers = checked_jobs(jobs)
    file = check_writable(out) / LEDGER
    runs = list(benchmark.runs())
    with Ledger(file, retry_failed=True, fits=is_training) as ledger:
        if not resume:
            ledger.clear()
        found = completed(runs, call, ledger=ledger, workers=workers, progress=progress, unit="trainings")
    return [Training(**found[run.key].stored(), name=run.settings["name"], seed=run.rng) for run in runs]


def is_training(outcome: Outcome) -> bool:
    """Return whether an outcome is one of `measured`: figures of the training, all measures of each map and mode."""
    results = outcome.numbers
    places = {key.rpartition("|")[0] for key in results if key.count("|") == 2}
    wanted = {*OF_TRAINING, *(f"{place}|{measure}" for place in places for measure in MEASURES)}
    curve = [key for key in results if key.startswith("training|")]
    parts = min(PARTS, outcome.steps)
    known = {*wanted, *(f"training|{k:02}" for k in range(parts))}
    numbers = all(isinstance(value, (int, float)) and math.isfinite(value) for value in results.values())
    return numbers and wanted <= results.keys() <= known and len(curve) in (0, parts)


def measured(benchmark: Benchmark, *, name: str, rng: int) -> dict[str, float]:
    """Train a contestant with a seed, and measure it on all its maps."""
    begun, used = time.perf_counter(), time.process_time()
    trained = contestants()[name](rng, benchmark.steps)
    figures = time.perf_counter() - begun, time.process_time() - used, float(trained.robot_steps)
    results = dict(zip(OF_TRAINING, figures, strict=True))
    results |= {f"training|{k:02}": value for k, value in enumerate(trained.curve)}
    for place in benchmark.maps(rng):
        for mode in MODES:
            for measure, value in _measures(trained, mode, place, rng, benchmark.evaluation_steps).items():
                results[f"{place}|{mode}|{measure}"] = value
    if name in (RULE, *BRED):
        means = on_every_map(trained, rng, benchmark.evaluation_steps)
        results |= {f"{EVERY}|frozen|{measure}": value for measure, value in means.items()}
    return results


def on_every_map(trained: Trained, seed: int, steps: int) -> dict[str, float]:
    """Return by measure the means over all unseen maps, frozen."""
    rows = [_measures(trained, "frozen", f"random {number}", seed, steps) for number in UNSEEN]
    return {measure: float(np.mean([row[measure] for row in rows])) for measure in rows[0]}


def _measures(trained: Trained, mode: str, place: str, seed: int, steps: int) -> dict[str, float]:
    control = getattr(trained, mode)
    if control is None:
        return {}
    return drive_measured(driven_world(control, DESIGN, ROBOTS, map_named(place), APART + seed), steps)


def map_named(place: str) -> Map:
    """Return a map by the name that results have."""
    word, _, number = place.partition(" ")
    return random_map(int(number)) if word == "random" else Map.load(place)


def group_of(place: str) -> str:
    """Return the group of a map: that of the training, another built-in one, a generated one, or all unseen."""
    if place in (HOME, EVERY):
        return "home" if place == HOME else "every"
    return "generated" if place.startswith("random") else "built in"


TITLES = {
    "home": "On the map of the training (`original`)",
    "built in": "On the other built-in maps",
    "generated": "On generated maps that were not used for training",
}
HOW = {"frozen": "frozen", "learning": "still learning"}
GROUPS = tuple(TITLES)
HEADER = ("contestant", "collisions [95 %]", "worst", "ahead", "coverage")
# Required: few collisions, most of the greatest speed, and the coverage of the rule.
FEW, FAST = 0.5, 0.6


@dataclass(frozen=True, slots=True)
class Line:
    """The results of one contestant on maps of one group, one of `GROUPS`, "frozen" or "learning".

    Collisions are per robot and 1,000 steps; they, the speed ahead and the coverage are interquartile means over seeds
    and maps; `worst` is of the worst robot of all.
    """

    name: str
    group: str
    mode: str
    collisions: Interval
    worst: float
    ahead: float
    coverage: float


def lines_of(runs: Sequence[Training]) -> list[Line]:
    """Return a line for each group of maps, mode and contestant, without those that do not learn while they drive."""
    names = list(dict.fromkeys(run.name for run in runs))
    lines = []
    for group in GROUPS:
        for mode in MODES:
            for name in names:
                found = values_of(runs, name, group, mode)
                if found["collisions"]:
                    lines.append(_line(name, group, mode, found))
    return lines


def values_of(runs: Sequence[Training], name: str, group: str, mode: str) -> dict[str, list[float]]:
    """Return the results of one contestant on maps of a group: by measure, a value for each seed and map."""
    found: dict[str, list[float]] = {measure: [] for measure in MEASURES}
    for run in runs:
        for place, how, measure, value in run.rows() if run.name == name else ():
            if group_of(place) == group and how == mode:
                found[measure].append(value)
    return found


def _line(name: str, group: str, mode: str, found: dict[str, list[float]]) -> Line:
    ahead, seen = (bootstrap_interquartile_mean(found[m]).estimate for m in ("speed ahead", "coverage"))
    collisions = bootstrap_interquartile_mean(found["collisions"])
    return Line(name, group, mode, collisions, max(found["worst robot"]), ahead, seen)


def markdown(benchmark: Benchmark, runs: Sequence[Training]) -> str:
    """Return all tables as Markdown: the training times, then one table for each group of maps and mode."""
    parts = [_training(benchmark, runs)]
    lines = lines_of(runs)
    for group in GROUPS:
        for mode in MODES:
            rows = [_cells(line) for line in lines if (line.group, line.mode) == (group, mode)]
            if rows:
                parts.append("\n".join([f"**{TITLES[group]}, {HOW[mode]}**", "", *_table([HEADER, *rows])]))
    parts += [seed_by_seed(runs, name) for name in BRED if _on_every_map(runs, name)]
    return "\n\n".join(parts) + "\n"


def _training(benchmark: Benchmark, runs: Sequence[Training]) -> str:
    rows = [("contestant", "seeds", "robot-steps of training", "wall time, s", "processor time, s")]
    for name in dict.fromkeys(run.name for run in runs):
        mine = [run.numbers for run in runs if run.name == name]
        wall, used = (np.mean([r[f"train {what} seconds"] for r in mine]) for what in ("wall", "processor"))
        rows.append((name, str(len(mine)), f"{mine[0]['robot-steps']:,.0f}", f"{wall:.1f}", f"{used:.1f}"))
    title = f"**Training: {benchmark.steps:,} steps of 15 robots on `original`; evaluation: "
    return "\n".join([f"{title}{benchmark.evaluation_steps:,} steps a map**", "", *_table(rows)])


def _on_every_map(runs: Sequence[Training], name: str) -> dict[int, list[float]]:
    """Return by seed the collisions, the speed ahead and the coverage, means over all unseen maps."""
    required = [f"{EVERY}|frozen|{measure}" for measure in ("collisions", "speed ahead", "coverage")]
    found = {run.seed: [run.numbers.get(key) for key in required] for run in runs if run.name == name}
    return {seed: [v for v in values if v is not None] for seed, values in found.items() if None not in values}


def seed_by_seed(runs: Sequence[Training], name: str) -> str:
    """Return a table of what is required, by each seed alone, and in the mean."""
    mine, rule = _on_every_map(runs, name), _on_every_map(runs, RULE)
    found = {str(seed): (*values, rule[seed][2] if seed in rule else math.nan) for seed, values in mine.items()}
    found["mean"] = tuple(np.mean(list(found.values()), axis=0))
    rows = [
        (row, f"{c:.2f}", f"{a:.2f}", f"{s:.3f}", f"{r:.3f}", _passed(c, a, s, r))
        for row, (c, a, s, r) in found.items()
    ]
    header = ("seed", "collisions", "ahead", "coverage", "of the rule", "passed")
    title = f"**{name}: each seed on all twenty unseen maps, frozen (means)**"
    return "\n".join([title, "", *_table([header, *rows])])


def _passed(collisions: float, ahead: float, seen: float, of_the_rule: float) -> str:
    return "yes" if collisions <= FEW and ahead >= FAST and seen >= of_the_rule else "no"


def _cells(line: Line) -> tuple[str, ...]:
    c = line.collisions
    limits = "" if math.isnan(c.low) else f" [{_brief(c.low)}, {_brief(c.high)}]"
    return line.name, f"{_brief(c.estimate)}{limits}", _brief(line.worst), f"{line.ahead:z.2f}", f"{line.coverage:.2f}"


def _brief(number: float) -> str:
    return f"{number:.2f}" if number < 10 else f"{number:.0f}"


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
    texts = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in rows]
    return [texts[0], "|" + "|".join("-" * (w + 2) for w in widths) + "|", *texts[1:]]


def runs_csv(runs: Sequence[Training]) -> str:
    """Return one line for each contestant, seed, map and mode."""
    rows = []
    for run in runs:
        places = dict.fromkeys((place, mode) for place, mode, _, _ in run.rows())
        for place, mode in places:
            values = [run.numbers[f"{place}|{mode}|{measure}"] for measure in MEASURES]
            rows.append([run.name, run.seed, place, group_of(place), mode, *values])
    return csv_text([["contestant", "seed", "map", "group", "mode", *MEASURES], *rows])


def summary_json(benchmark: Benchmark, runs: Sequence[Training]) -> str:
    """Return the settings and the lines of all tables."""
    lines = [
        {
            **{name: getattr(line, name) for name in ("name", "group", "mode", "worst", "ahead", "coverage")},
            "collisions": line.collisions.estimate,
            "collisions_low": known(line.collisions.low),
            "collisions_high": known(line.collisions.high),
        }
        for line in lines_of(runs)
    ]
    settings = {name: getattr(benchmark, name) for name in ("seeds", "steps", "evaluation_steps")}
    return json.dumps({**settings, "lines": lines}, indent=1, allow_nan=False) + "\n"


MARKS = "osD^vP*Xhp"
# Below this, collisions are drawn on a scale that reaches 0.
LINEAR = 0.1
PANELS = {"home": "original, trained on", "built in": "other built-in maps", "generated": "generated maps"}


def learning_pictures(runs: Sequence[Training]) -> dict[str, bytes]:
    """Return the PNGs of a benchmark by file name."""
    pictures = {"learn_bench.png": png(speed_figure(lines_of(runs)))}
    if any(run.curve() for run in runs):
        pictures["learn_curves.png"] = png(curve_figure(runs))
    return pictures


def speed_figure(lines: Sequence[Line]) -> Figure:
    """Return collisions over speed ahead, a panel for each group of maps: full markers frozen, hollow learning."""
    figure = Figure(figsize=(12.8, 5.6), layout="constrained")
    names = list(dict.fromkeys(line.name for line in lines))
    panels = figure.subplots(1, len(GROUPS), sharex=True, sharey=True)
    for group, axes in zip(GROUPS, panels, strict=True):
        axes.fill_between([FAST, 1.0], 0, FEW, color=LIGHT.good, alpha=0.1, linewidth=0)
        axes.axvline(FAST, color=LIGHT.ink, linewidth=0.5, linestyle=":")
        axes.axhline(FEW, color=LIGHT.ink, linewidth=0.5, linestyle=":")
        for line in (each for each in lines if each.group == group):
            _mark(axes, line, names.index(line.name))
        axes.set_yscale("symlog", linthresh=LINEAR)
        axes.set_ylim(bottom=0)
        axes.set_title(PANELS[group], fontsize=12)
        axes.set_xlabel("mean speed ahead, share of the greatest")
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("collisions per robot and 1,000 steps\n(interquartile mean, 95 %)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _mark(axes: Axes, line: Line, number: int) -> None:
    colour, frozen, c = COLOURS[number % len(COLOURS)], line.mode == "frozen", line.collisions
    reach = np.nan_to_num([[c.estimate - c.low], [c.high - c.estimate]])
    axes.errorbar(
        line.ahead,
        c.estimate,
        yerr=np.maximum(reach, 0.0),
        fmt=MARKS[number % len(MARKS)],
        color=colour,
        markerfacecolor=colour if frozen else LIGHT.field,
        markersize=8,
        clip_on=False,  # those without collisions stand on the axis
        linewidth=1.0,
        label=literal(line.name) if frozen else None,
    )


def curve_figure(runs: Sequence[Training]) -> Figure:
    """Return collisions in the course of training: a line for each contestant that learns, medians of all seeds."""
    figure = Figure(figsize=(8.5, 4.6), layout="constrained")
    axes = figure.subplots()
    names = list(dict.fromkeys(run.name for run in runs))
    for name in names:
        curves = np.array([run.curve() for run in runs if run.name == name])
        if curves.size:
            middle, colour = np.median(curves, axis=0), COLOURS[names.index(name) % len(COLOURS)]
            at = (np.arange(len(middle)) + 0.5) / len(middle)
            mark = MARKS[names.index(name) % len(MARKS)]
            axes.plot(at, middle, color=colour, marker=mark, markersize=4, label=literal(name))
            axes.fill_between(at, curves.min(axis=0), curves.max(axis=0), color=colour, alpha=0.08, linewidth=0)
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.set(xlim=(0, 1), xlabel="share of the training", ylabel="collisions per robot and 1,000 steps")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9)
    return figure
