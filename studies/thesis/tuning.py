"""T and gamma tuned to a goal, off-line and by the robots themselves (8.4, 10.3), beside the thesis's values."""

from typing import Any

from matplotlib.figure import Figure

from mesa_swarm.experiments import mean_interval
from mesa_swarm.searches import LearningGoal, goal_run
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_mean, judged_measure
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

SEEDS = 30
# The mean forward speed of the thesis's robots in their first 1,000 steps, with seeds from 10,000 on, was 0.276.
GOAL = LearningGoal(steps=1_000, least_speed=0.28)
# How much less than the goal's speed counts as the goal's.
SLACK = 0.02
SLOW, FAST, OFFLINE, ONLINE = "thesis, beta 1e-4", "thesis, beta 5e-3", "tuned off-line", "self-adjusting"
# The thesis's values (8.3).
THESIS: dict[str, Any] = {"first_temperature": 1.0, "last_temperature": 0.2, "beta": 1e-4, "gamma": 0.7}
# Off-line: `tune(GOAL)`, rounded. Self-adjusting: chosen among settings of T_0, window, gamma and
# speed that were tried with seeds from 10,000 on.
CONTESTANTS: dict[str, dict[str, Any]] = {
    SLOW: THESIS,
    FAST: {**THESIS, "beta": 5e-3},
    OFFLINE: {"first_temperature": 2.25, "last_temperature": 0.167, "beta": 3.24e-4, "gamma": 0.943},
    ONLINE: {
        "self_adjusting": True,
        "first_temperature": 2.0,
        "alert_gamma": 0.95,
        # Above the goal's: robots begin hot, which is slow.
        "least_speed": 0.4,
        "bump_window": 300,
    },
}


def contestant_run(rng: int, *, contestant: str, steps: int) -> dict[str, float]:
    """Let the robots of a contestant learn; return their collisions and their speed."""
    return goal_run(rng, steps=steps, robots=GOAL.robots, map=GOAL.map, **CONTESTANTS[contestant])


def tuned_checks(name: str, rows: dict[str, list[dict]], *, main: bool) -> tuple[Check, ...]:
    """Judge whether a contestant reaches the goal, and reaches it better than the thesis's values."""
    fewer = (
        judged_measure(
            f"{name}: fewer collisions a robot in the first 1,000 steps than with the {thesis}",
            "proposed, no number",
            "collisions",
            {name: rows[name], thesis: rows[thesis]},
            main=main and thesis == SLOW,
        )
        for thesis in (SLOW, FAST)
    )
    reached = judged_mean(
        f"{name}: the robots drive at the goal's speed, {GOAL.least_speed:g} of the full one",
        "proposed, no number",
        column(rows[name], "speed"),
        low=GOAL.least_speed - SLACK,
        main=main,
    )
    return (*fewer, reached)


def tuning(laboratory: Laboratory) -> Result:
    """Compare tuned and self-adjusting robots with those of the thesis."""
    seeds = laboratory.fresh_seeds(SEEDS)
    points = [{"contestant": name, "steps": laboratory.pick(GOAL.steps, 100)} for name in CONTESTANTS]
    rows = dict(zip(CONTESTANTS, laboratory.grid(contestant_run, points, seeds), strict=True))
    return Result(
        checks=(*tuned_checks(OFFLINE, rows, main=True), *tuned_checks(ONLINE, rows, main=False)),
        pictures={"": goal_figure(rows)},
        settings=(
            f"the goal is to collide as rarely as possible in the first {GOAL.steps:,} steps while driving at "
            f"{GOAL.least_speed:g} of the full speed, that of the thesis's robots, as robots that stand still do not "
            f"collide either; map {GOAL.map}, {GOAL.robots} robots; {described_contestants()}; both were tuned with "
            "seeds from 10,000 on and judged with fresh ones"
        ),
        remarks=(trade(rows),),
    )


def described_contestants() -> str:
    """Return the settings of all contestants in words."""
    return "; ".join(
        f"{name}: {', '.join(f'{setting} {value}' for setting, value in settings.items())}"
        for name, settings in CONTESTANTS.items()
    )


def trade(rows: dict[str, list[dict]]) -> str:
    """Return collisions, speed, and collisions over the distance that robots set out to drive."""
    parts = []
    for name, runs in rows.items():
        collisions, speed = (mean_interval(column(runs, measure)) for measure in ("collisions", "speed"))
        rate = mean_interval([run["collisions"] / run["speed"] for run in runs if run["speed"] > 0])
        parts.append(
            f"{name}: {collisions.estimate:.1f} [{collisions.low:.1f}, {collisions.high:.1f}] collisions at a speed of "
            f"{speed.estimate:.3f} [{speed.low:.3f}, {speed.high:.3f}], {rate.estimate:.0f} [{rate.low:.0f}, "
            f"{rate.high:.0f}] in 1,000 lengths of a full step ahead"
        )
    return "; ".join(parts)


def goal_figure(rows: dict[str, list[dict]]) -> Figure:
    """Return a figure of collisions over speed: a dot a run, and means with their intervals."""
    figure, axes = plain_axes("mean forward speed, share of the full one", "collisions a robot in 1,000 steps")
    axes.axvline(GOAL.least_speed, color=LIGHT.faint, linestyle=":", linewidth=1)
    for i, (name, runs) in enumerate(rows.items()):
        speeds, collisions = column(runs, "speed"), column(runs, "collisions")
        axes.plot(speeds, collisions, ".", color=LIGHT.series[i], alpha=0.35, markersize=5)
        x, y = mean_interval(speeds), mean_interval(collisions)
        axes.errorbar(
            x.estimate,
            y.estimate,
            xerr=[[x.estimate - x.low], [x.high - x.estimate]],
            yerr=[[y.estimate - y.low], [y.high - y.estimate]],
            fmt="os^D"[i],
            color=LIGHT.series[i],
            capsize=3,
            label=name,
        )
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return figure


ITEMS = (Item(figure="tuning", title="T and gamma tuned to a goal", section="8.4, 10.3", make=tuning),)
