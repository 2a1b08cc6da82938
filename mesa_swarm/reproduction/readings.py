"""How much the verdicts of figures 8.2 to 8.5 depend on how the thesis is read."""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.statistics import mean_interval
from mesa_swarm.experiments.tables import with_limits
from mesa_swarm.reproduction.drawing import column
from mesa_swarm.reproduction.judging import PASSED, Check, Result, judged_difference
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.learning import (
    FALL,
    FAST,
    FAST_FALL,
    READING,
    SLOW,
    judged_frequency,
    judged_totals,
    runs_of,
)
from mesa_swarm.reproduction.registry import Item, table_of

RUNS = 24
# d_crit as a share of the range of 50 units, by what 0.4 is a share of.
CRITICAL = {"0.4 of the range": 0.4, "0.4 of a diameter": 0.08, "0.4 units": 0.008}
ACTIONS = 8, 4
REWARDED = {"r(s, a)": "state", "r(s', a)": "next state"}
MEASURES = {
    "early": "collisions, first 1,000 steps",
    "late": "last 3,000",
    "total": "in all",
    "with temperature": "correlation with T",
    "speed": "speed at the end",
}
FIGURES = "8.2", "8.3", "8.4", "8.5"


@dataclass(frozen=True, kw_only=True, slots=True)
class Reading:
    """One way to read the thesis, with its runs: one robot, and 15 with T falling slowly and fast."""

    critical: str
    actions: int
    rewarded: str
    one: list[dict]
    slow: list[dict]
    fast: list[dict]

    @property
    def name(self) -> str:
        """In words."""
        return f"{self.critical}, {self.actions} actions, {self.rewarded}"

    @property
    def claims(self) -> dict[str, tuple[Check, ...]]:
        """The main checks of each figure, with these runs."""
        checks = (
            judged_frequency(self.one, FALL),
            judged_frequency(self.slow, FALL),
            judged_frequency(self.fast, FAST_FALL),
            judged_totals(self.slow, self.fast),
        )
        return {
            figure: tuple(check for check in each if check.main) for figure, each in zip(FIGURES, checks, strict=True)
        }


def settings_of(critical: str, actions: int, rewarded: str) -> dict[str, Any]:
    """Return the settings of the model that a way to read the thesis requires."""
    return {"critical": CRITICAL[critical], "actions": actions, "reward_of": REWARDED[rewarded]}


def readings_of(laboratory: Laboratory) -> list[Reading]:
    """Return the runs of all combinations."""
    made = []
    for critical, actions, rewarded in product(CRITICAL, ACTIONS, REWARDED):
        reading = settings_of(critical, actions, rewarded)
        one, slow, fast = (
            runs_of(laboratory, robots, beta, runs=RUNS, reading=reading)
            for robots, beta in ((1, SLOW), (15, SLOW), (15, FAST))
        )
        made.append(Reading(critical=critical, actions=actions, rewarded=rewarded, one=one, slow=slow, fast=fast))
    return made


def compared(made: list[Reading]) -> tuple[Check, ...]:
    """Judge what changes if one of the three questions is answered differently from our default."""
    runs = {(each.critical, each.actions, each.rewarded): each.slow for each in made}
    usual = runs["0.4 of a diameter", 8, "r(s, a)"]
    others = (
        ("0.4 of the range", 8, "r(s, a)", "early", "d_crit of 0.4 of the range: fewer collisions at first", False),
        ("0.4 units", 8, "r(s, a)", "late", "d_crit of 0.4 units: more collisions in the end", True),
        ("0.4 of a diameter", 4, "r(s, a)", "total", "four actions: fewer collisions in all", False),
        ("0.4 of a diameter", 8, "r(s', a)", "total", "r(s', a): fewer collisions in all", False),
    )
    checks = []
    for critical, actions, rewarded, measure, claim, more in others:
        sides = column(usual, measure), column(runs[critical, actions, rewarded], measure)
        names = "default", "instead"
        first, second = (sides, names) if more else (sides[::-1], names[::-1])
        checks.append(judged_difference(claim, "open", *first, names=second))
    return tuple(checks)


def table(made: list[Reading]) -> str:
    """Return the measures of 15 robots with T falling slowly, and which claims hold, by reading."""
    rows = [
        (
            f"**{each.name}**" if settings_of(each.critical, each.actions, each.rewarded) == READING else each.name,
            *(with_limits(mean_interval(known(each.slow, measure))) for measure in MEASURES),
            *map(holding, each.claims.values()),
        )
        for each in made
    ]
    return table_of(("reading", *MEASURES.values(), *FIGURES), rows)


def known(rows: list[dict], measure: str) -> list[float]:
    """Return a measure of all runs in which it is defined."""
    return [value for value in column(rows, measure) if value is not None]


def holding(checks: tuple[Check, ...]) -> str:
    """Return how many claims hold, and the outcomes of the others."""
    failed = [f"{check.claim.split(':')[0]}: {check.outcome}" for check in checks if check.outcome != PASSED]
    return f"{len(checks) - len(failed)} of {len(checks)}" + (f" ({'; '.join(failed)})" if failed else "")


def readings_figure(made: list[Reading]) -> Figure:
    """Return a figure of 15 robots with T falling slowly: early and late collisions, correlation with T, and speed."""
    figure = Figure(figsize=(11.0, 5.2), layout="constrained")
    rates, warmth, speed = figure.subplots(1, 3, sharey=True, width_ratios=(2, 1, 1))
    places = np.arange(len(made))[::-1]
    _draw_dots(rates, made, "early", COLOURS[1], "first 1,000 steps")
    _draw_dots(rates, made, "late", COLOURS[0], "last 3,000 steps")
    _draw_dots(warmth, made, "with temperature", COLOURS[0], "")
    _draw_dots(speed, made, "speed", COLOURS[0], "")
    rates.set(xlabel="collisions a robot and 1,000 steps", xscale="log", yticks=places)
    rates.set_yticklabels([each.name for each in made])
    rates.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.1), ncols=2)
    warmth.axvline(0, color="0.5", linewidth=0.8)
    warmth.set(xlabel="correlation with T", xlim=(-1, 1))
    speed.set(xlabel="share of full speed, end", xlim=(0, 1))
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
    return figure


def _draw_dots(axes: Axes, made: list[Reading], measure: str, colour: str, label: str) -> None:
    means = [mean_interval(known(each.slow, measure)) for each in made]
    centre = np.array([mean.estimate for mean in means])
    reach = np.array([[mean.estimate - mean.low, mean.high - mean.estimate] for mean in means]).T
    places = np.arange(len(made))[::-1]
    axes.errorbar(centre, places, xerr=np.nan_to_num(reach), fmt="o", color=colour, markersize=5, label=label)


def readings(laboratory: Laboratory) -> Result:
    """Repeat the learning runs with every way to read the thesis."""
    made = readings_of(laboratory)
    return Result(
        checks=compared(made),
        pictures={"": readings_figure(made)},
        settings=(
            f"{RUNS} runs of 33,000 steps for each of 12 readings with one robot, and with 15 for both rates of "
            "cooling; map original, AGENT9, alpha 0.4, eta 0.1, gamma 0.7, T from 1 to 0.2, reward (b); collisions are "
            "per robot and 1,000 steps, those in all per robot; measures are of 15 robots with T falling slowly"
        ),
        table=(
            "Measures with 95 % intervals, and how many main claims of each figure pass their checks; our default is "
            f"in bold.\n\n{table(made)}"
        ),
    )


ABOUT = """\
The thesis leaves three questions open. *What is d_crit = 0.4 a share of?* Of the sensors' range (20 units), of a
robot's diameter (4 units), or of nothing: 0.4 units. *Which actions?* Table 8.1 lists eight; the first four were used
before the others were added. *Which state is rewarded?* By its equations that in which the action was chosen, r(s, a);
a program that computes the reward after the move has r(s', a). Our default is 0.4 of a diameter, eight actions and
r(s, a)."""
ITEMS = (
    Item(
        figure="readings",
        title="twelve ways to read chapter 8",
        section="8.2 and 8.3",
        make=readings,
        about=ABOUT,
        readings=True,
    ),
)
