"""The tables and pictures of the benchmark of learning."""

import json
import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mesa_swarm.experiments import Interval, bootstrap_mean, csv_text
from mesa_swarm.viewing import LIGHT, literal, plain_figure, png
from mesa_swarm_studies.benchmarks.benchmark_tasks import BenchmarkTask, benchmark_tasks
from mesa_swarm_studies.benchmarks.contestants import HOME
from mesa_swarm_studies.benchmarks.learn_bench import LEARNING_MAPS, MODES, Benchmark, Training

NUMBERS = ("seeds", "steps", "evaluation_steps", "maps")
GROUPS = {"test": "On the test maps", "home": "On the map of the training (`original`)"}
# Of the pictures on a page, which are narrower than those that are stored.
ON_PAGES = 120
HOW = {"frozen": "frozen", "learning": "still learning"}


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """The results of a contestant in a task: on maps of a group ("test" or "home"), "frozen" or "learning".

    `values` has, by measure, the mean over seeds of the means over maps, with its interval; `seeds` those of each
    seed (seeds, measures), NaN where it did not happen on any map.
    """

    task: str
    name: str
    group: str
    mode: str
    values: dict[str, Interval]
    seeds: np.ndarray


def lines_of(runs: Sequence[Training]) -> list[Line]:
    """Return a line for each task, group of maps, mode and contestant, without those that have no such result."""
    return [
        _line(task, name, group, mode, found)
        for task in dict.fromkeys(run.task for run in runs)
        for group in GROUPS
        for mode in MODES
        for name in dict.fromkeys(run.name for run in runs if run.task == task)
        if (found := [_means(run, group, mode) for run in runs if (run.task, run.name) == (task, name)]) and any(found)
    ]


def _means(run: Training, group: str, mode: str) -> dict[str, float]:
    """Return the means over the maps of a group by measure, without those where it did not happen."""
    found: dict[str, list[float]] = {}
    for place, how, measure, value in run.rows():
        if how == mode and group == ("home" if place == HOME else "test"):
            found.setdefault(measure, []).append(value)
    return {measure: _mean(values) for measure, values in found.items()}


def _mean(values: Sequence[float]) -> float:
    happened = [value for value in values if not math.isnan(value)]
    return float(np.mean(happened)) if happened else math.nan


def _line(task: str, name: str, group: str, mode: str, found: Sequence[dict[str, float]]) -> Line:
    measures = benchmark_tasks()[task].measures
    seeds = np.array([[means[measure] for measure in measures] for means in found if means])
    columns = dict(zip(measures, seeds.T, strict=True))
    values = {measure: bootstrap_mean(column[~np.isnan(column)].tolist()) for measure, column in columns.items()}
    return Line(task, name, group, mode, values, seeds)


def markdown(benchmark: Benchmark, runs: Sequence[Training], pictures: str = "") -> str:
    """Return all tables as Markdown: for each task the trainings, then one table for each group of maps and mode.

    `pictures` is the beginning of the names of pictures, such as "pictures/results", if they are to be shown.
    """
    lines = lines_of(runs)
    parts = []
    for task in benchmark.task_names:
        mine = [run for run in runs if run.task == task]
        parts.append(f"### {_title(task)}")
        if pictures:
            parts.append(f"![{_title(task)}: results on the test maps, with 95 % intervals]({pictures}_{task}.png)")
        parts.append(_trainings(benchmark, mine))
        if pictures and any(run.curve() for run in mine):
            parts.append(f"![Collisions in the course of the trainings]({pictures}_curves.png)")
        for group in GROUPS:
            for mode in MODES:
                chosen = [line for line in lines if (line.task, line.group, line.mode) == (task, group, mode)]
                if chosen:
                    parts.append(_results(benchmark, benchmark_tasks()[task], chosen, lines))
    return "\n\n".join(parts) + "\n"


def _title(task: str) -> str:
    return task.replace("_", " ").capitalize()


def report_page(benchmark: Benchmark, runs: Sequence[Training], page: Path) -> str:
    """Return a page: the command that makes it, its settings, and all tables, with their pictures."""
    place = page.name if page.is_absolute() else page.as_posix()
    preface = (
        "For users who compare learners: all tables of the benchmark.\n\nThis page is written by"
        f"\n\n```sh\n{command_of(benchmark)} --report {shlex.quote(place)}\n```\n\n"
        "[Benchmark](../learning.md) describes tasks, contestants and protocol. Values are means over seeds of means "
        "over maps, with 95 % bootstrap intervals over the seeds. In the pictures, full markers are frozen, hollow "
        "ones still learning; of the trainings, thin lines are single seeds, thick ones their median."
    )
    settings = (
        f"Settings: trainings of {benchmark.steps:,} steps of 15 robots; seeds: {benchmark.seeds}; test maps: "
        f"{benchmark.maps}; steps on each: at most {benchmark.evaluation_steps:,}."
    )
    tables = markdown(benchmark, runs, f"pictures/{page.stem}")
    return "\n\n".join(["# Results of the benchmark of learning", preface, settings, tables])


def command_of(benchmark: Benchmark) -> str:
    """Return the command line of a benchmark, without its folder.

    Examples
    --------
    >>> command_of(Benchmark(seeds=30, tasks=("avoid",), only=("random", "Q (b)")))
    "mesa-swarm learn-bench --task avoid --only 'random;Q (b)' --seeds 30"
    """
    words = ["mesa-swarm", "learn-bench"]
    for option, separator in (("task", ","), ("only", ";")):
        given = getattr(benchmark, "tasks" if option == "task" else option)
        words += [f"--{option}", separator.join(given)] if given else []
    for address in benchmark.policies:
        words += ["--policy", address]
    for field in fields(Benchmark):
        value = getattr(benchmark, field.name)
        if field.name in NUMBERS and value != field.default:
            words += [f"--{field.name.replace('_', '-')}", str(value)]
    return shlex.join(words)


def _trainings(benchmark: Benchmark, runs: Sequence[Training]) -> str:
    rows = [("contestant", "seeds", "robot-steps", "processor time, s", "single trainings that missed")]
    for name in dict.fromkeys(run.name for run in runs):
        mine = [run.numbers for run in runs if run.name == name]
        steps, used = (np.mean([r[what] for r in mine]) for what in ("robot-steps", "train processor seconds"))
        rows.append((name, str(len(mine)), f"{steps:,.0f}", f"{used:.1f}", _missed(mine)))
    return "\n".join(["**Training**, means over seeds", "", *_table(rows)])


def _missed(trainings: Sequence[dict[str, float]]) -> str:
    """Return how many single trainings missed the validation, of all that were validated."""
    validated = [r for r in trainings if r["passed"] is not None]
    if not validated:
        return ""
    tried = sum(r["trainings"] for r in validated)
    return f"{tried - sum(r['passed'] for r in validated):.0f} of {tried:.0f}"


def _results(benchmark: Benchmark, task: BenchmarkTask, lines: Sequence[Line], every: Sequence[Line]) -> str:
    first = lines[0]
    rule = next((line for line in every if (line.name, line.group) == (task.rule, first.group)), None)
    judged = task.target is not None and rule is not None
    header = ("contestant", *(f"{measure} [95 %]" for measure in task.measures), *(("on target",) if judged else ()))
    rows = [
        (line.name, *map(_cell, line.values.values()), *(_judged(task, line, rule) if judged else ())) for line in lines
    ]
    count = len(benchmark.places(first.task)) - (first.task == "avoid")
    count = min(count, LEARNING_MAPS) if first.mode == "learning" else count
    title = f"{GROUPS[first.group]}{f', {count} of them' if first.group == 'test' else ''}, {HOW[first.mode]}"
    return "\n".join([f"**{title}**", "", *_table([header, *rows])])


def _judged(task: BenchmarkTask, line: Line, rule: Line | None) -> tuple[str]:
    """Return with how many seeds the means over maps are on target."""
    if task.target is None or rule is None or len(rule.seeds) < len(line.seeds):
        return ("",)
    named = [[dict(zip(task.measures, seed, strict=True)) for seed in of.seeds] for of in (line, rule)]
    met = [all(task.target.met(found, own)) for found, own in zip(*named, strict=False)]
    return (f"{sum(met)} of {len(met)}",)


def _cell(interval: Interval) -> str:
    limits = "" if math.isnan(interval.low) else f" [{_brief(interval.low)}, {_brief(interval.high)}]"
    return "-" if math.isnan(interval.estimate) else f"{_brief(interval.estimate)}{limits}"


def _brief(number: float) -> str:
    return f"{number:z.2f}" if abs(number) < 10 else f"{number:,.0f}"


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
    texts = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in rows]
    return [texts[0], "|" + "|".join("-" * (w + 2) for w in widths) + "|", *texts[1:]]


def _known(number: float) -> float | None:
    """Return a number, or None for NaN, for which JSON and CSV have no word."""
    return None if math.isnan(number) else number


def runs_csv(runs: Sequence[Training]) -> str:
    """Return one line for each task, contestant, seed, map, mode and measure."""
    rows = [[run.task, run.name, run.seed, *row[:3], _known(row[3])] for run in runs for row in run.rows()]
    return csv_text([["task", "contestant", "seed", "map", "mode", "measure", "value"], *rows])


def summary_json(benchmark: Benchmark, runs: Sequence[Training]) -> str:
    """Return the settings and the lines of all tables."""
    lines = [
        {
            **{name: getattr(line, name) for name in ("task", "name", "group", "mode")},
            "measures": {m: [_known(v) for v in (i.estimate, i.low, i.high)] for m, i in line.values.items()},
        }
        for line in lines_of(runs)
    ]
    settings = {name: getattr(benchmark, name) for name in NUMBERS}
    return json.dumps({**settings, "lines": lines}, indent=1, allow_nan=False) + "\n"


# Below this, collisions are drawn on a scale that reaches 0.
LINEAR = 0.1
PER_THOUSAND = ("collisions", "worst robot")
COLUMNS = 5


def learning_pictures(
    runs: Sequence[Training], stem: str = "learn_bench", dots_per_inch: float = 200
) -> dict[str, bytes]:
    """Return the PNGs of a benchmark by file name: the results of each task, and the course of the trainings."""
    lines = lines_of(runs)
    figures = {task: task_figure(task, lines) for task in dict.fromkeys(run.task for run in runs)}
    if any(run.curve() for run in runs):
        figures["curves"] = curve_figure(runs)
    return {f"{stem}_{name}.png": png(figure, dots_per_inch) for name, figure in figures.items()}


def task_figure(task: str, lines: Sequence[Line]) -> Figure:
    """Return the results on the test maps: a row for each contestant, a panel for each measure.

    Full markers are frozen, hollow ones still learning; bars are the 95 % intervals of the means.
    """
    mine = [line for line in lines if (line.task, line.group) == (task, "test")]
    names = list(dict.fromkeys(line.name for line in mine))
    measures = benchmark_tasks()[task].measures
    size = 3.0 + 2.6 * len(measures), 1.6 + 0.36 * len(names)
    figure, (panels,) = plain_figure(size, 1, len(measures), letters=9, sharey=True)
    for measure, axes in zip(measures, panels, strict=True):
        for line in mine:
            _mark(axes, line, measure, names.index(line.name))
        if measure in PER_THOUSAND:
            axes.set_xscale("symlog", linthresh=LINEAR)
        axes.set_xlim(left=min(0.0, *(_lowest(line.values[measure]) for line in mine)))
        axes.set_title(literal(measure), fontsize=11)
        axes.set_xlabel("per robot and 1,000 steps" if measure in PER_THOUSAND else "", fontsize=9)
        axes.grid(axis="y", color=LIGHT.faint, linewidth=0.4, alpha=0.5)
    panels[0].set_yticks(range(len(names)), [literal(name) for name in names], fontsize=10)
    panels[0].set_ylim(len(names) - 0.5, -0.5)
    if any(line.mode == "learning" for line in mine):
        handles = [Line2D([], [], **_style(mode), linestyle="", label=HOW[mode]) for mode in MODES]
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return figure


def _lowest(interval: Interval) -> float:
    """Return the lower limit, or the estimate if that is not known; 0 if neither is."""
    known_numbers = [number for number in (interval.low, interval.estimate) if not math.isnan(number)]
    return min(known_numbers, default=0.0)


def _style(mode: str) -> dict[str, Any]:
    colour = LIGHT.series[MODES.index(mode)]
    return {"marker": "o", "color": colour, "markerfacecolor": colour if mode == "frozen" else LIGHT.field}


def _mark(axes: Axes, line: Line, measure: str, row: int) -> None:
    value = line.values[measure]
    reach = np.nan_to_num([[value.estimate - value.low], [value.high - value.estimate]])
    axes.errorbar(
        value.estimate,
        row + 0.22 * MODES.index(line.mode),
        xerr=np.maximum(reach, 0.0),
        **_style(line.mode),
        markersize=6,
        linewidth=1.2,
        clip_on=False,  # those without collisions stand on the axis
    )


def curve_figure(runs: Sequence[Training]) -> Figure:
    """Return collisions in the course of training: a panel for each contestant that learns.

    Thin lines are single seeds, the thick one is their median.
    """
    names = [name for name in dict.fromkeys(run.name for run in runs) if any(_curves(runs, name))]
    columns = min(len(names), COLUMNS)
    rows = -(-len(names) // columns)
    size = 2.3 * columns + 0.6, 2.1 * rows + 0.5
    figure, panels = plain_figure(size, rows, columns, letters=9, sharex=True, sharey=True)
    for axes, name in zip(panels.flat, names, strict=False):
        _draw_curves(axes, np.array(list(_curves(runs, name))))
        axes.set_title(literal(name), fontsize=10)
    panels[0, 0].set_ylim(0, 1.2 * max(max(curve) for name in names for curve in _curves(runs, name)) + LINEAR)
    for axes in panels.flat[len(names) :]:
        axes.set_visible(False)
    figure.legend(
        *panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9, frameon=False
    )
    figure.supxlabel("share of the training", fontsize=10)
    figure.supylabel("collisions per robot and 1,000 steps", fontsize=10)
    return figure


def _draw_curves(axes: Axes, curves: np.ndarray) -> None:
    """Draw the curves (seeds, parts) of a contestant."""
    at = (np.arange(curves.shape[1]) + 0.5) / curves.shape[1]
    # Not clipped: many curves end on the axis.
    thin = axes.plot(at, curves.T, color=LIGHT.series[0], linewidth=0.6, alpha=0.4, clip_on=False)
    thin[0].set_label("single seeds")
    axes.plot(at, np.median(curves, axis=0), color=LIGHT.series[0], linewidth=2.0, clip_on=False, label="their median")
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.set(xlim=(0, 1), xticks=(0, 0.5, 1))


def _curves(runs: Sequence[Training], name: str) -> Iterator[list[float]]:
    return (run.curve() for run in runs if run.name == name and run.curve())
