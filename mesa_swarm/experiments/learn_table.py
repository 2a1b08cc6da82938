"""What the benchmark of learning found, as tables: text for the terminal and the documentation, CSV, JSON."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.experiments.driving import MEASURES
from mesa_swarm.experiments.learn_bench import BRED, EVERY, MODES, RULE, Benchmark, Run, group_of
from mesa_swarm.experiments.statistics import Interval, bootstrap_interquartile_mean
from mesa_swarm.experiments.tables import csv_text

TITLES = {
    "home": "On the map of the training (`original`)",
    "built in": "On the other built-in maps",
    "generated": "On generated maps that nobody was trained on",
}
HOW = {"frozen": "frozen", "learning": "still learning"}
GROUPS = tuple(TITLES)
HEADER = ("contestant", "collisions [95 %]", "worst", "ahead", "coverage")
# What is asked of a good one: hardly any collisions, most of the greatest speed, and to see what the rule sees.
FEW, FAST = 0.5, 0.6


@dataclass(frozen=True, slots=True)
class Line:
    """What one contestant did on maps of one group.

    Parameters
    ----------
    name, group, mode : str
        Of the contestant; one of `GROUPS`; "frozen" or "learning".
    collisions : Interval
        Interquartile mean over seeds and maps, per robot and 1,000 steps.
    worst : float
        Of the worst robot of all.
    ahead, coverage : float
        Interquartile means.
    """

    name: str
    group: str
    mode: str
    collisions: Interval
    worst: float
    ahead: float
    coverage: float


def lines_of(runs: Sequence[Run]) -> list[Line]:
    """Return a line for each group of maps, mode and contestant, those left out that do not learn while they drive."""
    names = list(dict.fromkeys(run.name for run in runs))
    lines = []
    for group in GROUPS:
        for mode in MODES:
            for name in names:
                found = values_of(runs, name, group, mode)
                if found["collisions"]:
                    lines.append(_line(name, group, mode, found))
    return lines


def values_of(runs: Sequence[Run], name: str, group: str, mode: str) -> dict[str, list[float]]:
    """Return what one contestant did on maps of a group: by measure, a value for each seed and map."""
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


def markdown(benchmark: Benchmark, runs: Sequence[Run]) -> str:
    """Return all tables as Markdown: how long training took, then one table for each group of maps and mode."""
    parts = [_training(benchmark, runs)]
    lines = lines_of(runs)
    for group in GROUPS:
        for mode in MODES:
            rows = [_cells(line) for line in lines if (line.group, line.mode) == (group, mode)]
            if rows:
                parts.append("\n".join([f"**{TITLES[group]}, {HOW[mode]}**", "", *_table([HEADER, *rows])]))
    parts += [seed_by_seed(runs, name) for name in BRED if _on_every_map(runs, name)]
    return "\n\n".join(parts) + "\n"


def _training(benchmark: Benchmark, runs: Sequence[Run]) -> str:
    rows = [("contestant", "seeds", "robot-steps of training", "wall time, s", "processor time, s")]
    for name in dict.fromkeys(run.name for run in runs):
        mine = [run.results for run in runs if run.name == name]
        wall, used = (np.mean([r[f"train {what} seconds"] for r in mine]) for what in ("wall", "processor"))
        rows.append((name, str(len(mine)), f"{mine[0]['robot-steps']:,.0f}", f"{wall:.1f}", f"{used:.1f}"))
    title = f"**Training: {benchmark.steps:,} steps of 15 robots on `original`; evaluation: "
    return "\n".join([f"{title}{benchmark.evaluation_steps:,} steps a map**", "", *_table(rows)])


def _on_every_map(runs: Sequence[Run], name: str) -> dict[int, list[float]]:
    """Return by seed the collisions, the speed ahead and the coverage, means over all unseen maps."""
    asked = [f"{EVERY}|frozen|{measure}" for measure in ("collisions", "speed ahead", "coverage")]
    found = {run.seed: [run.results.get(key) for key in asked] for run in runs if run.name == name}
    return {seed: [v for v in values if v is not None] for seed, values in found.items() if None not in values}


def seed_by_seed(runs: Sequence[Run], name: str) -> str:
    """Return a table of who reaches what is asked: by each seed alone, and in the mean."""
    mine, rule = _on_every_map(runs, name), _on_every_map(runs, RULE)
    found = {str(seed): (*values, rule[seed][2] if seed in rule else math.nan) for seed, values in mine.items()}
    found["mean"] = tuple(np.mean(list(found.values()), axis=0))
    rows = [
        (row, f"{c:.2f}", f"{a:.2f}", f"{s:.3f}", f"{r:.3f}", _reached(c, a, s, r))
        for row, (c, a, s, r) in found.items()
    ]
    header = ("seed", "collisions", "ahead", "coverage", "of the rule", "reached")
    title = f"**{name}: each seed on all twenty unseen maps, frozen (means)**"
    return "\n".join([title, "", *_table([header, *rows])])


def _reached(collisions: float, ahead: float, seen: float, of_the_rule: float) -> str:
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


def runs_csv(runs: Sequence[Run]) -> str:
    """Return one line for each contestant, seed, map and mode."""
    rows = []
    for run in runs:
        places = dict.fromkeys((place, mode) for place, mode, _, _ in run.rows())
        for place, mode in places:
            values = [run.results[f"{place}|{mode}|{measure}"] for measure in MEASURES]
            rows.append([run.name, run.seed, place, group_of(place), mode, *values])
    return csv_text([["contestant", "seed", "map", "group", "mode", *MEASURES], *rows])


def summary_json(benchmark: Benchmark, runs: Sequence[Run]) -> str:
    """Return the settings and the lines of all tables."""
    lines = [
        {
            **{name: getattr(line, name) for name in ("name", "group", "mode", "worst", "ahead", "coverage")},
            "collisions": line.collisions.estimate,
            "collisions_low": _finite(line.collisions.low),
            "collisions_high": _finite(line.collisions.high),
        }
        for line in lines_of(runs)
    ]
    settings = {name: getattr(benchmark, name) for name in ("seeds", "steps", "evaluation_steps")}
    return json.dumps({**settings, "lines": lines}, indent=1, allow_nan=False) + "\n"


def _finite(number: float) -> float | None:
    return None if math.isnan(number) else number
