"""Figure 8.7: utility and reward over the distance to a wall, for several gammas: exact values beside learned ones."""

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm import AGENT9
from mesa_swarm.experiments import mean_interval
from mesa_swarm.gallery import find_model
from mesa_swarm.learning import ApproachValues, approach_values, wall_readings
from mesa_swarm.viewing import LIGHT, plain_figure
from mesa_swarm_studies.drawing import column, draw_means, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_mean, judged_measure, judged_number
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

STEPS = 33_000
SEEDS = 30
# Reward (b), eight actions, d_crit of 0.4 of a robot's diameter: the final settings of the thesis, as we read them.
CRITICAL = 0.08
SETTINGS: dict[str, Any] = {"reward": "b", "actions": 8, "critical": CRITICAL, "reward_of": "state"}
RANGE = max(sensor.range for sensor in AGENT9.proximity)
D_CRIT = CRITICAL * RANGE
# How close a greedy robot's switching point has to be to d_crit, map units: a quarter of a step.
CLOSE = 0.25
T_C = 0.2
# Distances in a step of 1 unit: exact values are computed at each. Where they decide, with two numbers of them.
CELLS, FEWER_CELLS = 10, 4
# The other readings of the thesis's d_crit of 0.4, as shares of the range: of the range, and map units.
OTHER_READINGS = {"0.4 of the range (20 units)": 0.4, "0.4 map units": 0.4 / RANGE}
LEARNED_GAMMAS = (0.0, 0.3, 0.5, 0.7, 0.9)
EXACT_GAMMAS = (0.0, 0.5, 0.7, 0.9, 0.95, 0.99)
DRAWN_GAMMAS = (0.0, 0.5, 0.7, 0.9)
# Distances from a wall at which a robot is asked, map units.
PLACES = np.linspace(0.5, 50.0, 100)
# Utility that has fallen by this share has fallen.
FALLEN = 0.01
FARTHEST_DRAWN = 25.0
# The place of "forward" among the actions.
FORWARD = 3


def foresight_run(rng: int, *, steps: int = STEPS, gamma: float) -> dict[str, float | list[float] | None]:
    """Let one robot learn; return where it turns before a wall ahead, its utility there, and its collisions.

    The distance is the least down to which, coming from far, forward is the best action; None if it never is. So is
    the distance down to which Boltzmann's choice at T_c takes it at least half of the time.
    """
    model = find_model("q_learning")(rng=rng, gamma=gamma, n_robots=1, **SETTINGS).run(steps)
    readings = wall_readings(AGENT9, PLACES)
    values = model.learner.policy().of_robot(0).values(readings, np.where(readings >= 0, 0, -1))
    learned = ApproachValues(gamma, PLACES, np.zeros_like(values), values)
    return {
        "distance": finite(learned.switching_distance),
        "even": finite(learned.even_distance(T_C)),
        "utility": [float(f"{value:.4g}") for value in learned.utility],
        "collisions": float(model.total_collisions),
    }


def finite(distance: float) -> float | None:
    """Return a distance, None if it is infinite."""
    return distance if math.isfinite(distance) else None


def falling_distance(values: ApproachValues) -> float:
    """Return the least distance from which on the utility of forward is nearly what it is far from the wall."""
    fallen = np.flatnonzero(values.utility < (1 - FALLEN) * values.utility[-1])
    return float(values.distance[min(fallen[-1] + 1, len(values.distance) - 1)])


def exact_values(
    laboratory: Laboratory, reward: str = "b", critical: float = CRITICAL, cells: int = CELLS
) -> dict[float, ApproachValues]:
    """Return the exact values for each gamma, at distances of a share of a step; the heading is part of the state."""
    turning = laboratory.pick("exact", "stand")
    return {
        gamma: approach_values(gamma, reward=reward, critical=critical, turning=turning, cells=cells)
        for gamma in EXACT_GAMMAS
    }


def exact_checks(exact: dict[float, ApproachValues]) -> tuple[Check, ...]:
    """Judge what the thesis claims of d_m for a robot that takes the action of the largest exact value."""
    beyond = {gamma: values.switching_distance - D_CRIT for gamma, values in exact.items()}
    return (
        judged_number(
            "gamma 0, exact values, greedy choice: d_m less d_crit",
            "d_m is d_crit",
            beyond[0.0],
            low=-CLOSE,
            high=CLOSE,
            unit=" units",
        ),
        judged_number(
            "gamma above 0, exact values, greedy choice: the largest d_m less d_crit, gamma 0.5 to 0.99",
            "d_m is larger than d_crit",
            max(beyond[gamma] for gamma in EXACT_GAMMAS[1:]),
            low=CLOSE,
            unit=" units",
        ),
        judged_number(
            "gamma towards 1, exact values, greedy choice: d_m at gamma 0.99 less d_m at 0.9",
            "d_m grows without bound",
            beyond[0.99] - beyond[0.9],
            low=CLOSE,
            unit=" units",
        ),
        judged_number(
            "what does grow, exact: the distance below which utility falls by 1 %, gamma 0.95 less gamma 0.5",
            "gamma controls the distance",
            falling_distance(exact[0.95]) - falling_distance(exact[0.5]),
            low=CLOSE,
            unit=" units",
            main=False,
        ),
    )


def reading_checks(laboratory: Laboratory) -> tuple[Check, ...]:
    """Judge whether d_m exceeds d_crit for any gamma with the other readings of d_crit."""
    return tuple(
        judged_number(
            f"d_crit read as {reading}, exact values, greedy choice: the largest d_m less d_crit, gamma 0.5 to 0.99",
            "d_m is larger than d_crit",
            max(values.switching_distance for values in exact_values(laboratory, critical=critical).values())
            - critical * RANGE,
            low=CLOSE,
            unit=" units",
            main=False,
        )
        for reading, critical in OTHER_READINGS.items()
    )


GREEDY = "learned values, greedy choice: d_m is larger"
# What is claimed of which measure to be larger with the second gamma than with the first, and what the thesis states.
OF_GAMMA = (
    ("distance", 0.0, 0.7, "learned values, greedy choice: d_m is larger with gamma 0.7", "farther than d_crit"),
    (
        "distance",
        0.5,
        0.9,
        "learned values, greedy choice: d_m is larger with gamma 0.9",
        "to infinity as gamma nears 1",
    ),
    (
        *("collisions", 0.7, 0.0),
        "what gamma does change: one robot collides less in 33,000 steps with gamma 0.7 than with 0",
        "gamma is a choice",
    ),
    ("collisions", 0.9, 0.7, "and less with 0.9 than with 0.7", "gamma is a choice"),
)


def learned_checks(rows: dict[float, list[dict]]) -> tuple[Check, ...]:
    """Judge what robots have learned, and what gamma changes."""
    near = judged_mean(
        "gamma 0, learned values, greedy choice: d_m",
        "d_crit",
        column(rows[0.0], "distance"),
        low=D_CRIT - AGENT9.max_speed,
        high=D_CRIT + AGENT9.max_speed,
        main=False,
    )
    changes = (
        judged_measure(claim, reported, measure, {f"gamma {a:g}": rows[a], f"{b:g}": rows[b]}, main=False)
        for measure, a, b, claim, reported in OF_GAMMA
    )
    return near, *changes


REASON = (
    "With d_crit of 4 units, several steps of 1 unit: at d_crit and beyond, reward (b) charges every action but "
    "forward 1, more than a step into the critical zone costs. If turning leads to open ground, Q*(forward) exceeds "
    "Q*(turning) at d_crit by 2 - gamma (1 - r), where r, above -1, is the reward one step nearer; that is above 0 for "
    "every gamma below 1. Gamma changes the values, which fall from farther away, and with them how often Boltzmann's "
    "choice errs, but not which action is the best."
)


def utility(laboratory: Laboratory) -> Result:
    """Make figure 8.7: utility and reward over the distance ahead, and what gamma changes."""
    steps, seeds = laboratory.pick(STEPS, 3_300), laboratory.fresh_seeds(SEEDS)
    runs = laboratory.grid(foresight_run, [{"gamma": gamma, "steps": steps} for gamma in LEARNED_GAMMAS], seeds)
    rows = dict(zip(LEARNED_GAMMAS, runs, strict=True))
    exact = exact_values(laboratory)
    return Result(
        checks=(*exact_checks(exact), *reading_checks(laboratory), *learned_checks(rows)),
        pictures={"": utility_figure(exact, rows), "gamma": gamma_figure(exact, rows)},
        settings=(
            "AGENT9, reward (b) of the state of the choice, eight actions, d_crit of 4 units (0.4 of a robot's "
            "diameter); exact: value iteration before an endless wall, state distance and heading; learned: map "
            f"original, one robot, alpha 0.4, eta 0.1, beta 1e-4, T from 1 to {T_C}, {steps:,} steps, asked facing a "
            "wall"
        ),
        remarks=(
            near_reading(laboratory),
            even_remark(exact, rows),
            other_reward(laboratory, "a"),
            other_reward(laboratory, "c"),
            *never(rows),
        ),
        reason=REASON,
    )


def even_remark(exact: dict[float, ApproachValues], rows: dict[float, list[dict]]) -> str:
    """Return from where on Boltzmann's choice at T_c takes forward half of the time."""
    learned = {gamma: mean_interval(seen(column(runs, "even"))) for gamma, runs in rows.items()}
    means = "; ".join(f"{m.estimate:.1f} [{m.low:.1f}, {m.high:.1f}] at {gamma:g}" for gamma, m in learned.items())
    return (
        f"Boltzmann's choice at T_c takes forward half of the time from a distance of {by_gamma(exact)} on by exact "
        f"values, and of {means} by learned ones"
    )


def switching(exact: dict[float, ApproachValues]) -> str:
    """Return the greedy switching distance for each gamma."""
    return ", ".join(f"{values.switching_distance:.3g} at gamma {gamma:g}" for gamma, values in exact.items())


def by_gamma(exact: dict[float, ApproachValues]) -> str:
    """Return from where on forward has a probability of 1/2, for each gamma."""
    return ", ".join(f"{values.even_distance(T_C):.3g} at gamma {gamma:g}" for gamma, values in exact.items())


def near_reading(laboratory: Laboratory) -> str:
    """Return the greedy d_m where d_crit is less than a step, with two numbers of distances in a step."""
    critical = OTHER_READINGS["0.4 map units"]
    rows = [(cells, exact_values(laboratory, critical=critical, cells=cells)) for cells in (CELLS, FEWER_CELLS)]
    found = "; ".join(f"with {cells} distances in a step {switching(exact)}" for cells, exact in rows)
    return (
        "The refutation holds for a d_crit of several steps. Read as 0.4 map units, less than a step of 1, the zone "
        "is entered before it is seen, and there the claim holds for gamma near 1: greedy d_m by gamma, "
        f"{found}. Values of forward and turning then nearly tie, so that d_m depends on how finely distances are "
        "resolved, but it grows with each"
    )


def other_reward(laboratory: Laboratory, reward: str) -> str:
    """Return what is so with another reward, exactly."""
    exact = exact_values(laboratory, reward)
    even = by_gamma(exact)
    return f"With reward ({reward}), exactly: greedy d_m {switching(exact)}; forward half of the time from {even} on"


def never(rows: dict[float, list[dict]]) -> tuple[str, ...]:
    """Return in how many runs forward is not the best action anywhere, if in any."""
    counts = {gamma: column(runs, "distance").count(None) for gamma, runs in rows.items()}
    counted = ", ".join(f"{count} of {len(rows[gamma])} at gamma {gamma:g}" for gamma, count in counts.items() if count)
    return (f"In some runs forward is not the best action far from everything: {counted}.",) if counted else ()


def seen(values: list[float | None]) -> list[float]:
    """Return values without None."""
    return [value for value in values if value is not None]


def utility_figure(exact: dict[float, ApproachValues], rows: dict[float, list[dict]]) -> Figure:
    """Return the curves of utility over distance, exact and learned, and the reward."""
    figure, (panels,) = plain_figure((9.5, 4.2), 1, 2, grid=True, sharey=True)
    for axes, title in zip(panels, ("exact", "learned, mean of runs"), strict=True):
        axes.set_title(title, fontsize=11)
        axes.set(xlabel="distance from the wall ahead, map units", xlim=(0, FARTHEST_DRAWN))
        axes.axvline(D_CRIT, color=LIGHT.faint, linestyle=":", linewidth=1)
        draw_reward(axes, exact[0.0])
    for i, gamma in enumerate(DRAWN_GAMMAS):
        learned = np.mean(column(rows[gamma], "utility"), axis=0)
        curves = ((exact[gamma].distance, exact[gamma].utility), (PLACES, learned))
        for axes, (x, y) in zip(figure.axes, curves, strict=True):
            axes.plot(x, y, color=LIGHT.series[i], linewidth=1.8, label=f"utility, gamma {gamma:g}")
    figure.axes[0].set_ylabel("reward; utility (1 - gamma) Q(s, forward)")
    figure.axes[0].legend(frameon=False, fontsize=9)
    return figure


def draw_reward(axes: Axes, values: ApproachValues) -> None:
    """Draw the reward of forward, with its leap."""
    before = values.distance < D_CRIT
    for side, label in ((before, "reward of forward"), (~before, "")):
        axes.plot(values.distance[side], values.reward[side, FORWARD], "k--", linewidth=1.2, label=label, zorder=3)


def gamma_figure(exact: dict[float, ApproachValues], rows: dict[float, list[dict]]) -> Figure:
    """Return what depends on gamma: the switching distance, hardly, and collisions."""
    figure, axes = plain_axes("gamma", "greedy switching distance, map units")
    drawn = [gamma for gamma in EXACT_GAMMAS if gamma <= LEARNED_GAMMAS[-1]]
    axes.plot(drawn, [exact[gamma].switching_distance for gamma in drawn], "k--", label="exact distance (left)")
    draw_means(
        axes, LEARNED_GAMMAS, [column(rows[g], "distance") for g in LEARNED_GAMMAS], "learned distance (left)", 0
    )
    axes.set_ylim(bottom=0)
    counts = axes.twinx()
    collisions = [column(rows[gamma], "collisions") for gamma in LEARNED_GAMMAS]
    draw_means(counts, LEARNED_GAMMAS, collisions, "collisions (right)", 1)
    counts.set(ylabel="collisions of one robot in a run", ylim=(0, None))
    counts.spines["top"].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


ITEMS = (Item(figure="8.7", title="utility and reward over distance and gamma", section="8.4", make=utility),)
