"""Figures 8.1 to 8.5, and equation 8.3: robots that learn collision avoidance."""

import math
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.analysis import central_moving_average
from mesa_swarm.experiments import quantity
from mesa_swarm.gallery import find_model
from mesa_swarm.learning import approach_values, reward, temperature_at
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, count_steps, draw_bundle, plain_axes
from mesa_swarm_studies.judging import (
    Check,
    Result,
    judged_difference,
    judged_fact,
    judged_mean,
    judged_measure,
    judged_number,
)
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

STEPS = 33_000
# Of the whole run: the first 1,000 steps of 33,000, the last 3,000, a third.
FIRST, LAST, THIRD = 1 / 33, 1 / 11, 1 / 3
# Points that are stored of a curve smoothed over about 1,000 steps, or over 11.
POINTS, ONE_POINTS = 330, 3300
# Windows of the thesis, for many robots and for one.
MANY_WINDOW, ONE_WINDOW = 1001, 11


def learning_run(rng: int, *, steps: int = STEPS, **settings: Any) -> dict[str, Any]:
    """Let robots learn; return collisions a robot and 1,000 steps early and late, their curve, and their thirds."""
    model = find_model("q_learning")(rng=rng, **settings).run(steps)
    robots = len(model.swarm)
    rate = 1000.0 * np.array(model.datacollector.model_vars["collisions"], float) / robots
    third = round(THIRD * steps)
    smooth = central_moving_average(rate, MANY_WINDOW if robots > 1 else ONE_WINDOW)
    warmth = np.array([temperature_at(step, beta=model.learner.beta) for step in range(1, steps + 1)])
    return {
        "early": float(rate[: round(FIRST * steps)].mean()),
        "late": float(rate[-round(LAST * steps) :].mean()),
        "first third": float(rate[:third].sum()) / 1000,
        "last third": float(rate[-third:].sum()) / 1000,
        "total": float(rate.sum()) / 1000,
        "with temperature": correlation(central_moving_average(rate, MANY_WINDOW), warmth),
        "curve": thinned(smooth, POINTS if robots > 1 else ONE_POINTS),
        "sum": thinned(np.cumsum(rate) / 1000),
        "temperature": thinned(warmth),
        "speed": float(np.mean(model.datacollector.model_vars["forward_speed"][-round(LAST * steps) :])),
    }


def thinned(values: np.ndarray, points: int = POINTS) -> list[float]:
    """Return values at equal steps, the last one too, with six digits."""
    places = np.linspace(0, len(values) - 1, points).round().astype(int)
    return [float(f"{value:.6g}") for value in values[places]]


def correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    """Return Pearson's correlation, None if one of the two never changes."""
    if np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    return round(float(np.corrcoef(a, b)[0, 1]), 12)


SLOW, FAST = 1e-4, 5e-3
RUNS = 30
# d_crit of the figure of rewards, in the thesis's unit, which it does not state.
CRITICAL = 0.4
# How the thesis is read, see the page on readings: d_crit as 0.4 of a diameter, all actions of table 8.1, r(s, a).
READING: dict[str, Any] = {"critical": 0.08, "actions": 8, "reward_of": "state"}
LEARNING = (
    "map original, AGENT9, alpha 0.4, eta 0.1, gamma 0.7, T from 1 to 0.2, reward (b) of the state in which the action "
    "was chosen, all eight actions, readings as shares of the range 50. The thesis's d_crit of 0.4 has no unit; we read"
    " it as 0.4 of a robot's diameter of 10 (see the page on readings), and chose all other distances and speeds"
)
# To which share of their first rate collisions are to fall.
FALL = 0.25
# Controls: T stays what it is at first, or in the end.
HOT, COOL = ({"first_temperature": heat, "last_temperature": heat} for heat in (1.0, 0.2))
ROUNDING = 1e-9


def temperatures(laboratory: Laboratory) -> Result:
    """Show equation 8.3: how T falls."""
    steps = range(0, STEPS + 1, 100)
    run = laboratory.pick(2_000, 200)
    learned = float(find_model("q_learning")(n_robots=1, beta=FAST, rng=1).run(run).learner.temperature[0])
    # In its first step a robot has nothing to learn from yet.
    error = min(abs(learned - temperature_at(run - lag, beta=FAST)) for lag in (0, 1))
    end = temperature_at(STEPS, beta=SLOW)
    checks = (
        judged_number("T of a learning robot differs from the law (8.3) by at most", "0", error, high=ROUNDING),
        judged_number(
            "at beta 1e-4, 33,000 steps bring T 95 % of the way", "95 %", 100 * (1 - end) / 0.8, low=95.0, unit=" %"
        ),
        judged_number(
            "after them T is within 5 % of its end", "95 % of T_c", 100 * (end / 0.2 - 1), high=5.0, unit=" % above",
            main=False,
        ),
        judged_number(
            "(8.1), T = e^(-beta t) + T_c, starts at the thesis's T of 1", "same path", 1.2, low=1.0, high=1.0,
            main=False,
        ),
    )  # fmt: skip
    figure, axes = plain_axes("step", "temperature T")
    for beta in (SLOW, FAST):
        axes.plot(steps, [temperature_at(step, beta=beta) for step in steps], linewidth=1.8, label=f"beta {beta:g}")
    axes.set_ylim(0, 1.05)
    axes.legend(frameon=False)
    count_steps(axes)
    needed = math.log(0.01 / 0.8) / math.log1p(-SLOW)
    return Result(
        checks=checks,
        pictures={"": figure},
        settings="T from 1 to 0.2",
        remarks=(f"At beta 1e-4, T is within 5 % of its end after {math.ceil(needed):,} steps.",),
    )


def rewards(laboratory: Laboratory) -> Result:
    """Make figure 8.1: the rewards over the nearest reading."""
    readings = np.linspace(0, 1, 501)
    worth = partial(reward, critical=CRITICAL)
    half = CRITICAL / 2
    q = (math.exp(worth("b", half, 1, 1) + 1) - 1) / half
    leaps = {kind: worth(kind, CRITICAL, 1, 1) - worth(kind, CRITICAL - 1e-9, 1, 1) for kind in "abc"}
    checks = (
        judged_number("q for d_crit 0.4, from a reward below it", "4.2957", q, low=4.29565, high=4.29575),
        judged_number("reward when touching", "-1", worth("b", 0.0, 1, 1), low=-1, high=-1),
        judged_number("reward just below d_crit", "0", worth("b", CRITICAL - 1e-12, 1, 1), low=-1e-9, high=1e-9),
        judged_number("jump of (b) at d_crit, driving ahead", "discontinuity (8.3)", leaps["b"], low=0.99, high=1.01),
        judged_number("jump of (c), its remedy", "proposed", leaps["c"], low=-1e-6, high=1e-6),
        judged_number("largest Q at gamma 0.7 (8.4), by value iteration", "3.3", largest(0.7), low=3.25, high=3.35),
        judged_number("largest Q at gamma 0.9 (8.4), by value iteration", "10", largest(0.9), low=9.99, high=10.01),
        judged_fact(
            "(8.5) is defined without a detection, if that reads -1 as in the thesis",
            "-1 for no detection",
            q * -1 + 1 > 0,
            measured=f"ln({q * -1 + 1:.2f}): undefined; here no detection reads as the range",
            criterion="the logarithm's argument is above 0",
            main=False,
        ),
    )
    figure, axes = plain_axes("nearest reading, in the unit of d_crit", "reward")
    ways = {(1, 1): "ahead", (1, 0): "one wheel ahead", (1, -1): "turning on the spot"}
    for kind, wheels, style in (
        ("a", (1, 1), (0, (4, 4))), ("a", (1, 0), "-."), ("a", (1, -1), (0, (1, 3))), ("b", (1, 1), "-"),
        ("b", (1, 0), ":"), ("c", (1, 1), "--"),
    ):  # fmt: skip
        values = [worth(kind, float(reading), *wheels) for reading in readings]
        way = ways[wheels]
        axes.plot(readings, values, linestyle=style, linewidth=1.8, label=f"({kind}), {way}")
    axes.legend(frameon=False)
    return Result(checks=checks, pictures={"": figure}, settings="d_crit 0.4, in the thesis's unit")


def largest(gamma: float) -> float:
    """Return the largest exact value of an action, with reward (b)."""
    return float(approach_values(gamma, turning="leave").values.max())


def runs_of(
    laboratory: Laboratory, robots: int, beta: float, *, runs: int = RUNS, reading: dict[str, Any] = READING
) -> list[dict]:
    """Return learning runs, which several figures share; the reading has settings of the model."""
    steps, seeds = laboratory.pick(STEPS, 3_300), laboratory.fresh_seeds(runs, quick=2)
    return laboratory.runs(learning_run, seeds, steps=steps, n_robots=robots, beta=beta, **reading)


def falling(rows: list[dict]) -> Check:
    """Judge whether collisions of the end are at most a share of those of the start, in the mean of runs."""
    early, late = column(rows, "early"), column(rows, "late")
    return judged_difference(
        f"collisions fall to {FALL:.0%} or less: per robot and 1,000 steps",
        "to about 0",
        {"last 3,000 steps": late, f"{FALL:.0%} of the first 1,000": [FALL * value for value in early]},
    )


def judged_frequency(rows: list[dict]) -> tuple[Check, ...]:
    """Judge how often robots collide in a run, and how fast they drive."""
    return (
        falling(rows),
        judged_mean(
            "collisions correlate with T: correlation over a run",
            "correlate",
            column(rows, "with temperature"),
            low=0.0,
        ),
        judged_mean(
            "the robots drive ahead in the last 3,000 steps: share of full speed",
            "fast, no number",
            column(rows, "speed"),
            low=0.5,
            main=False,
        ),
    )


def judged_controls(rows: list[dict], hot: list[dict], cool: list[dict]) -> tuple[Check, ...]:
    """Judge what T has to do with it: robots learn meanwhile, so that collisions may fall whatever T does."""
    return (
        judged_measure(
            "T matters: fewer collisions in the last 3,000 steps than with T constant at 1",
            "fewer as T falls",
            "late",
            {"T falls": rows, "constant": hot},
        ),
        judged_measure(
            "T, not time: the correlation is higher than with the same curve where T is constant at 0.2",
            "correlate with T",
            "with temperature",
            {"T constant": cool, "falls": rows},
            main=False,
        ),
    )


def frequency(laboratory: Laboratory, robots: int, beta: float) -> Result:
    """Make one of figures 8.2 to 8.4: how often robots collide, with T."""
    rows = runs_of(laboratory, robots, beta)
    hot, cool = (runs_of(laboratory, robots, beta, reading={**READING, **control}) for control in (HOT, COOL))
    return Result(
        checks=(*judged_frequency(rows), *judged_controls(rows, hot, cool)),
        pictures={"": frequency_figure(rows, robots, beta, laboratory.pick(STEPS, 3_300))},
        settings=f"{LEARNING}; {quantity(robots, 'robot')}, beta {beta:g}",
        remarks=(below_share(rows),),
    )


def below_share(rows: list[dict]) -> str:
    """Return in how many single runs collisions fall to the share, which means of runs do not show."""
    fallen = sum(late <= FALL * early for early, late in zip(column(rows, "early"), column(rows, "late"), strict=True))
    return (
        f"In {fallen} of {len(rows)} single runs collisions fall to {FALL:.0%} or less. With fast cooling 50 % were "
        "enough in earlier judgements, and there were no runs with T constant."
    )


def judged_totals(slow: list[dict], fast: list[dict]) -> tuple[Check, ...]:
    """Judge the totals of 15 robots with both rates of cooling."""
    flat = [
        judged_difference(
            f"the total flattens, beta {beta:g}: collisions per robot",
            "plateau",
            {
                "last third of the run": column(rows, "last third"),
                "half of the first": [value / 2 for value in column(rows, "first third")],
            },
        )
        for beta, rows in ((SLOW, slow), (FAST, fast))
    ]
    return (
        *flat,
        judged_measure(
            "fast cooling: more collisions early, per robot and 1,000 steps",
            "more early",
            "early",
            {"beta 1e-4": slow, "5e-3": fast},
        ),
        judged_measure(
            "fast cooling: fewer collisions in all, per robot",
            "fewer in all",
            "total",
            {"beta 5e-3": fast, "1e-4": slow},
        ),
    )


def totals(laboratory: Laboratory) -> Result:
    """Make figure 8.5: cumulative collisions, for both rates."""
    slow, fast = (runs_of(laboratory, 15, beta) for beta in (SLOW, FAST))
    figure, axes = plain_axes("step", "collisions of a robot so far")
    steps = np.linspace(0, laboratory.pick(STEPS, 3_300), POINTS)
    for i, (beta, rows) in enumerate(((SLOW, slow), (FAST, fast))):
        draw_bundle(axes, steps, np.array(column(rows, "sum")), LIGHT.series[i], f"beta {beta:g}")
    axes.legend(frameon=False)
    count_steps(axes)
    return Result(checks=judged_totals(slow, fast), pictures={"": figure}, settings=f"{LEARNING}; 15 robots")


def frequency_figure(rows: list[dict], robots: int, beta: float, last: int) -> Figure:
    """Return a figure of how often robots collide, smoothed, and of T; the axis holds all that is drawn."""
    figure, axes = plain_axes("step", "collisions a robot and 1,000 steps")
    curves = np.array(column(rows, "curve"))
    steps = np.linspace(0, last, curves.shape[1])
    mean = f"collisions, mean of {quantity(len(rows), 'run')}"
    if robots > 1:
        draw_bundle(axes, steps, curves, LIGHT.series[0], mean)
        shown, single = curves, "collisions, each run"
    else:
        shown, single = curves[:1], "collisions, one run"
        axes.plot(steps, curves[0], color=LIGHT.series[0], alpha=0.4, linewidth=0.6)
        window = MANY_WINDOW * curves.shape[1] // STEPS
        smooth = central_moving_average(curves.mean(axis=0), window | 1)
        axes.plot(steps, smooth, color=LIGHT.series[0], linewidth=2.0, label=mean)
    warmth = axes.twinx()
    warmth.plot(np.linspace(0, last, POINTS), rows[0]["temperature"], color=LIGHT.series[1], linewidth=1.6)
    warmth.set(ylabel="T", ylim=(0, 1.05))
    axes.set_ylim(0, max(1.05 * float(shown.max()), 1.0))
    axes.set_title(f"beta {beta:g}, {quantity(len(rows), 'run')} of {quantity(robots, 'robot')}", fontsize=10)
    axes.plot([], [], color=LIGHT.series[0], alpha=0.5, linewidth=0.6, label=single)
    axes.plot([], [], color=LIGHT.series[1], linewidth=1.6, label="T, temperature of the choice")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    count_steps(axes)
    return figure


ONE = partial(frequency, robots=1, beta=SLOW)
SLOWLY = partial(frequency, robots=15, beta=SLOW)
QUICKLY = partial(frequency, robots=15, beta=FAST)
ITEMS = (
    Item(figure="eq8.3", title="how the temperature of the choice falls", section="8.3", make=temperatures),
    Item(figure="8.1", title="the rewards", section="8.2", make=rewards),
    Item(figure="8.2", title="collisions of one learning robot", section="8.3", make=ONE),
    Item(figure="8.3", title="collisions of 15, temperature falling slowly", section="8.3", make=SLOWLY),
    Item(figure="8.4", title="collisions of 15, temperature falling fast", section="8.3", make=QUICKLY),
    Item(figure="8.5", title="cumulative collisions, for both", section="8.3", make=totals),
)
