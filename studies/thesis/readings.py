"""How much the verdicts of figures 8.2 to 8.5 depend on how the thesis is read."""

from functools import partial
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.experiments import mean_interval, quantity, with_limits
from mesa_swarm.viewing import LIGHT, plain_figure
from mesa_swarm_studies.drawing import column
from mesa_swarm_studies.judging import PASSED, Check, Result, judged_measure
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item, table_of
from mesa_swarm_studies.thesis.learning import (
    FAST,
    SLOW,
    judged_frequency,
    judged_totals,
    runs_of,
)

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
Reading = tuple[str, int, str]
Rows = dict[Reading, list[dict]]
DEFAULT: Reading = ("0.4 of a diameter", 8, "r(s, a)")
# What changes if one of the three questions is answered otherwise: the reading, a measure, a claim, and whether the
# measure is claimed to be larger.
CLAIMS: tuple[tuple[Reading, str, str, bool], ...] = (
    (("0.4 of the range", 8, "r(s, a)"), "early", "d_crit of 0.4 of the range: fewer collisions at first", False),
    (("0.4 units", 8, "r(s, a)"), "late", "d_crit of 0.4 units: more collisions in the end", True),
    (("0.4 of a diameter", 4, "r(s, a)"), "total", "four actions: fewer collisions in all", False),
    (("0.4 of a diameter", 8, "r(s', a)"), "total", "r(s', a): fewer collisions in all", False),
)


def settings_of(critical: str, actions: int, rewarded: str) -> dict[str, Any]:
    """Return the settings of the model that a way to read the thesis requires."""
    return {"critical": CRITICAL[critical], "actions": actions, "reward_of": REWARDED[rewarded]}


def runs_by_reading(laboratory: Laboratory, robots: int, beta: float) -> Rows:
    """Return the runs of all combinations."""
    return {
        reading: runs_of(laboratory, robots, beta, runs=RUNS, reading=settings_of(*reading))
        for reading in product(CRITICAL, ACTIONS, REWARDED)
    }


def name_of(reading: Reading) -> str:
    """Return a way to read the thesis in words."""
    critical, actions, rewarded = reading
    return f"{critical}, {actions} actions, {rewarded}"


def compared(rows: Rows) -> tuple[Check, ...]:
    """Judge what changes if one of the three questions is answered differently from our default."""
    checks = []
    for reading, measure, claim, more in CLAIMS:
        sides = {"default": rows[DEFAULT], "instead": rows[reading]}
        ordered = sides if more else dict(reversed(sides.items()))
        checks.append(judged_measure(claim, "open", measure, ordered))
    return tuple(checks)


def table(rows: Rows, claims: dict[str, dict[Reading, tuple[Check, ...]]]) -> str:
    """Return the measures, and how many claims of figures hold, by reading."""
    lines = [
        (
            f"**{name_of(reading)}**" if reading == DEFAULT else name_of(reading),
            *(with_limits(mean_interval(known(each, measure))) for measure in MEASURES),
            *(holding(checks[reading]) for checks in claims.values()),
        )
        for reading, each in rows.items()
    ]
    legend = "Measures with 95 % intervals, and how many main claims of each figure pass; our default is in bold."
    return f"{legend}\n\n{table_of(('reading', *MEASURES.values(), *claims), lines)}"


def known(rows: list[dict], measure: str) -> list[float]:
    """Return a measure of all runs in which it is defined."""
    return [value for value in column(rows, measure) if value is not None]


def holding(checks: tuple[Check, ...]) -> str:
    """Return how many main claims hold, and the outcomes of the others."""
    main = [check for check in checks if check.main]
    failed = [f"{check.claim.split(':')[0]}: {check.outcome}" for check in main if check.outcome != PASSED]
    return f"{len(main) - len(failed)} of {len(main)}" + (f" ({'; '.join(failed)})" if failed else "")


def remark(figure: str, claims: dict[Reading, tuple[Check, ...]]) -> str:
    """Return with which readings all main claims of a figure hold."""
    held = [
        name_of(reading)
        for reading, checks in claims.items()
        if all(check.outcome == PASSED for check in checks if check.main)
    ]
    listed = f": {'; '.join(held)}" if 0 < len(held) < len(claims) else ""
    return f"All main claims of figure {figure} hold with {len(held)} of {len(claims)} readings{listed}."


def readings_figure(rows: Rows) -> Figure:
    """Return a figure of early and late collisions, their correlation with T, and speed, by reading."""
    figure, ((rates, warmth, speed),) = plain_figure((11.0, 5.2), 1, 3, grid=True, sharey=True, width_ratios=(2, 1, 1))
    places = np.arange(len(rows))[::-1]
    _draw_dots(rates, rows, "early", LIGHT.series[1], "first 1,000 steps")
    _draw_dots(rates, rows, "late", LIGHT.series[0], "last 3,000 steps")
    _draw_dots(warmth, rows, "with temperature", LIGHT.series[0], "")
    _draw_dots(speed, rows, "speed", LIGHT.series[0], "")
    rates.set_xscale("symlog", linthresh=1.0)
    rates.set(xlabel="collisions a robot and 1,000 steps", xlim=(0, None), yticks=places)
    rates.set_yticklabels(list(map(name_of, rows)))
    rates.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.1), ncols=2)
    warmth.axvline(0, color=LIGHT.faint, linewidth=0.8)
    warmth.set(xlabel="correlation with T", xlim=(-1, 1))
    speed.set(xlabel="share of full speed, end", xlim=(0, 1))
    return figure


def _draw_dots(axes: Axes, rows: Rows, measure: str, colour: str, label: str) -> None:
    means = [mean_interval(known(each, measure)) for each in rows.values()]
    centre = np.array([mean.estimate for mean in means])
    reach = np.array([[mean.estimate - mean.low, mean.high - mean.estimate] for mean in means]).T
    places = np.arange(len(rows))[::-1]
    axes.errorbar(centre, places, xerr=np.nan_to_num(reach), fmt="o", color=colour, markersize=5, label=label)


def frequency(laboratory: Laboratory, robots: int, figure: str) -> Result:
    """Repeat the runs of figure 8.2 or 8.3, T falling slowly, with every way to read the thesis."""
    rows = runs_by_reading(laboratory, robots, SLOW)
    claims = {reading: judged_frequency(each) for reading, each in rows.items()}
    return result(rows, {figure: claims}, f"{quantity(robots, 'robot')}, beta {SLOW:g}")


def fast(laboratory: Laboratory) -> Result:
    """Repeat the runs of figures 8.4 and 8.5, T falling fast, with every way to read the thesis."""
    slow, rows = (runs_by_reading(laboratory, 15, beta) for beta in (SLOW, FAST))
    claims = {
        "8.4": {reading: judged_frequency(each) for reading, each in rows.items()},
        "8.5": {reading: judged_totals(slow[reading], each) for reading, each in rows.items()},
    }
    return result(rows, claims, f"15 robots, beta {FAST:g}")


def result(rows: Rows, claims: dict[str, dict[Reading, tuple[Check, ...]]], settings: str) -> Result:
    """Return the result of these runs."""
    return Result(
        checks=compared(rows),
        pictures={"": readings_figure(rows)},
        settings=(
            f"{settings}; {RUNS} runs of 33,000 steps for each of 12 readings; map original, AGENT9, alpha 0.4, eta "
            "0.1, gamma 0.7, T from 1 to 0.2, reward (b); collisions are per robot and 1,000 steps, in all per robot"
        ),
        remarks=tuple(remark(figure, checks) for figure, checks in claims.items()),
        table=table(rows, claims),
    )


QUESTIONS = """\
The thesis leaves three questions open. *What is d_crit = 0.4 a share of?* Of the sensors' range (20 units), of a
robot's diameter (4 units), or of nothing: 0.4 units. *Which actions?* Table 8.1 lists eight; the first four were used
before the others were added. *Which state is rewarded?* By its equations that in which the action was chosen, r(s, a);
a program that computes the reward after the move has r(s', a). Our default is 0.4 of a diameter, eight actions and
r(s, a)."""
SAME = "The same readings, and the same claims about what they change."
ITEMS = (
    Item(
        figure="readings-8.3",
        title="twelve ways to read chapter 8, 15 robots, T falling slowly",
        section="8.2 and 8.3",
        make=partial(frequency, robots=15, figure="8.3"),
        about=QUESTIONS,
        readings=True,
    ),
    Item(
        figure="readings-8.2",
        title="the same, one robot",
        section="8.2 and 8.3",
        make=partial(frequency, robots=1, figure="8.2"),
        about=SAME,
        readings=True,
    ),
    Item(
        figure="readings-8.5",
        title="the same, 15 robots, T falling fast, and totals",
        section="8.2 and 8.3",
        make=fast,
        about=SAME,
        readings=True,
    ),
)
