"""Figure 8.6: the two oscillations of robots that learn, and what makes them rarer."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mesa_swarm import AGENT9
from mesa_swarm.experiments import oscillating_robot, oscillation, trained
from mesa_swarm.viewing import LIGHT, plain_figure
from mesa_swarm_studies.drawing import column
from mesa_swarm_studies.judging import Check, Result, judged_difference, judged_mean
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

SEEDS = 24
# Steps in which 15 robots learn with beta 0.005, and in which each is alone afterwards and no longer learns.
LEARNED, WATCHED = 8_000, 300
BESIDE, TOWARDS = "beside a wall", "towards a wall"
# Height of the upper side of the wall.
WALL = 20.0
TURNS, THRESHOLD = "turns to and fro", "back-and-forth at a threshold"
COLD, WARM = 0.05, 0.5
# The thesis's final T; and one so high that every action is equally probable.
FINAL, CHANCE = 0.2, 1e3
# Reward and number of actions of a training, and the scenes and temperatures in which its robots are watched.
CASES: dict[tuple[str, int], tuple[tuple[str, float], ...]] = {
    ("a", 4): ((BESIDE, COLD), (BESIDE, FINAL), (BESIDE, CHANCE)),
    ("a", 8): ((BESIDE, COLD),),
    ("b", 4): ((BESIDE, COLD), (TOWARDS, COLD), (TOWARDS, FINAL), (TOWARDS, WARM), (TOWARDS, CHANCE)),
    ("b", 8): ((BESIDE, COLD), (TOWARDS, COLD), (TOWARDS, WARM)),
    ("c", 4): ((TOWARDS, COLD),),
}
Rows = dict[tuple[str, int], list[dict[str, float]]]
# Title, reward, actions, scene, temperature, measure.
Panel = tuple[str, str, int, str, float, str]
# What counts as an oscillation that occurs: flips per 100 steps, and share of steps.
LEAST_FLIPS, LEAST_SHARE = 2.0, 0.05


def oscillation_run(rng: int, *, reward: str, actions: int, watched: list, learned: int = LEARNED) -> dict[str, float]:
    """Let robots learn; return how they oscillate in each watched scene at its temperature."""
    policy = trained(reward, actions, rng, steps=learned)
    found: dict[str, float] = {}
    for scene, temperature in watched:
        measured = oscillation(policy, scene=scene, rng=rng, temperature=temperature, steps=WATCHED)
        found |= {name_of(scene, temperature, measure): measured[measure] for measure in (TURNS, THRESHOLD)}
    return found


def name_of(scene: str, temperature: float, measure: str) -> str:
    """Return the name of a measure in a scene at a temperature."""
    return f"{measure} {scene} at {temperature:g}"


def trace_run(
    rng: int,
    *,
    reward: str,
    actions: int,
    scene: str,
    temperature: float,
    measure: str,
    robot: int | None,
    learned: int = LEARNED,
) -> dict[str, Any]:
    """Let robots learn; return the way and the commands of one of them, or of the one that oscillates most."""
    policy = trained(reward, actions, rng, steps=learned)
    return oscillating_robot(
        policy, scene=scene, measure=measure, robot=robot, rng=rng, temperature=temperature, steps=WATCHED
    )


def measured(laboratory: Laboratory) -> Rows:
    """Return the runs of every case."""
    seeds, learned = laboratory.fresh_seeds(SEEDS, quick=2), laboratory.pick(LEARNED, 500)
    return {
        case: laboratory.runs(
            oscillation_run, seeds, reward=case[0], actions=case[1], watched=list(map(list, watched)), learned=learned
        )
        for case, watched in CASES.items()
    }


def judged_turns(rows: Rows) -> tuple[Check, ...]:
    """Judge the oscillation beside a wall, and its cures."""
    turns = name_of(BESIDE, COLD, TURNS)
    flips = {case: column(runs, turns) for case, runs in rows.items() if turns in runs[0]}
    return (
        judged_mean(
            "beside a wall, reward (a) and four actions: flips of the turn in 100 steps",
            "robots oscillate",
            flips["a", 4],
            low=LEAST_FLIPS,
        ),
        judged_difference(
            "eight actions make it rarer: flips in 100 steps, reward (a)",
            "cure",
            {"eight actions": flips["a", 8], "four": flips["a", 4]},
        ),
        judged_difference(
            "reward (b) makes it rarer: flips in 100 steps, four actions",
            "cure",
            {"reward (b)": flips["b", 4], "(a)": flips["a", 4]},
        ),
        judged_difference(
            "both make it rarer: flips in 100 steps",
            "final choice",
            {"eight actions and (b)": flips["b", 8], "four and (a)": flips["a", 4]},
            main=False,
        ),
        judged_mean(
            f"robots oscillate at the thesis's final T of {FINAL:g} too: flips in 100 steps, reward (a), four actions",
            "not stated",
            column(rows["a", 4], name_of(BESIDE, FINAL, TURNS)),
            low=LEAST_FLIPS,
            main=False,
        ),
    )


def judged_travel(rows: Rows) -> tuple[Check, ...]:
    """Judge the oscillation to and fro before a wall, and its cures."""
    cold, warm = (name_of(TOWARDS, temperature, THRESHOLD) for temperature in (COLD, WARM))
    usual = column(rows["b", 4], cold)
    return (
        judged_mean(
            f"before a wall, reward (b), four actions, T {COLD}: share of steps to and fro on the spot",
            "robots oscillate at low T",
            usual,
            low=LEAST_SHARE,
        ),
        judged_difference(
            "a higher T makes it rarer: share of steps",
            "for low T",
            {f"T {WARM:g}": column(rows["b", 4], warm), f"{COLD:g}": usual},
        ),
        judged_difference(
            f"reward (c), without the jump, makes it rarer: share of steps at T {COLD}",
            "proposed, not tried",
            {"reward (c)": column(rows["c", 4], cold), "(b)": usual},
            main=False,
        ),
        judged_difference(
            f"eight actions make it rarer: share of steps at T {COLD}",
            "not stated",
            {"eight actions": column(rows["b", 8], cold), "four": usual},
            main=False,
        ),
        judged_difference(
            "a higher T makes it rarer with eight actions too: share of steps",
            "for low T",
            {f"T {WARM:g}": column(rows["b", 8], warm), f"{COLD:g}": column(rows["b", 8], cold)},
            main=False,
        ),
        judged_mean(
            f"robots oscillate at the thesis's final T of {FINAL:g} too: share of steps, four actions",
            "not stated",
            column(rows["b", 4], name_of(TOWARDS, FINAL, THRESHOLD)),
            low=LEAST_SHARE,
            main=False,
        ),
    )


PANELS: tuple[Panel, ...] = (
    ("beside a wall: (a), four actions", "a", 4, BESIDE, COLD, TURNS),
    ("beside a wall: (b), eight actions", "b", 8, BESIDE, COLD, TURNS),
    (f"before a wall: (b), four actions, T {COLD:g}", "b", 4, TOWARDS, COLD, THRESHOLD),
    (f"before a wall: (b), four actions, T {WARM:g}", "b", 4, TOWARDS, WARM, THRESHOLD),
    (f"before a wall: (b), eight actions, T {COLD:g}", "b", 8, TOWARDS, COLD, THRESHOLD),
)


def traced(laboratory: Laboratory, rows: Rows, ill: Panel, *cured: Panel) -> list[dict[str, Any]]:
    """Return the way of the robot that oscillates most, of the run in which robots do, and its ways with cures."""
    _, reward, actions, scene, temperature, measure = ill
    worst = int(np.argmax(column(rows[reward, actions], name_of(scene, temperature, measure))))
    seeds, learned = laboratory.fresh_seeds(SEEDS, quick=2)[worst : worst + 1], laboratory.pick(LEARNED, 500)
    made: list[dict[str, Any]] = []
    for _, reward, actions, scene, temperature, measure in (ill, *cured):
        made += laboratory.runs(
            trace_run,
            seeds,
            reward=reward,
            actions=actions,
            scene=scene,
            temperature=temperature,
            measure=measure,
            robot=made[0]["robot"] if made else None,
            learned=learned,
        )
    return made


def oscillations(laboratory: Laboratory) -> Result:
    """Make figure 8.6: the way and the commands of robots that oscillate, and of robots that are cured."""
    rows = measured(laboratory)
    traces = [*traced(laboratory, rows, *PANELS[:2]), *traced(laboratory, rows, *PANELS[2:])]
    cold, warm = (
        100 * float(np.mean(column(rows["b", 4], name_of(TOWARDS, heat, THRESHOLD)))) for heat in (COLD, WARM)
    )
    return Result(
        checks=(*judged_turns(rows), *judged_travel(rows)),
        pictures={"": oscillation_figure(traces)},
        settings=(
            f"15 robots AGENT9 learn on the map original for {LEARNED:,} steps with beta 0.005, d_crit 0.4 of a "
            f"diameter and r(s, a); then each is alone for {WATCHED} steps without learning, 5 to 25 units beside a "
            "long wall or 15 to 40 before it, within 17 degrees of along it or towards it; flips count with a wall "
            "within 30 units; to and fro on the spot are flips of the direction of travel in which a robot gets "
            "nowhere. The figure shows the robot that oscillates most, of the run in which robots oscillate most, and "
            "the same robot with cures"
        ),
        remarks=(
            f"A higher T does not end the oscillation before a wall: {warm:.0f} % of the steps instead of {cold:.0f} "
            "%. The claims were first worded as cures, and robots watched at T 0.05 and 0.5 only; measures and "
            "criteria are unchanged.",
            by_chance(rows),
        ),
    )


def by_chance(rows: Rows) -> str:
    """Return how often a robot of equally probable actions seems to oscillate."""
    flips = float(np.mean(column(rows["a", 4], name_of(BESIDE, CHANCE, TURNS))))
    share = 100 * float(np.mean(column(rows["b", 4], name_of(TOWARDS, CHANCE, THRESHOLD))))
    return (
        f"A robot of four equally probable actions turns to and fro too, {flips:.0f} times in 100 steps, and is to and "
        f"fro on the spot in {share:.0f} % of them: these measures are of oscillation only where T is low. T {COLD} is "
        f"below the {FINAL:g} at which T ends in the thesis: there what was learned decides nearly alone."
    )


def oscillation_figure(traces: list[dict[str, Any]]) -> Figure:
    """Return a figure with the way of a robot in each case, and below it its commands, as shares of full speed."""
    figure, grid = plain_figure((15.0, 5.4), 2, len(PANELS), letters=8, height_ratios=(1.5, 1))
    for (title, *_), (way, wheels), trace in zip(PANELS, grid.T, traces, strict=True):
        _draw_way(way, trace)
        way.set_title(title, fontsize=10)
        left, right = np.array(trace["left"]), np.array(trace["right"])
        for name, values, colour in (
            ("ahead", 0.5 * (left + right), LIGHT.series[0]),
            ("turn", 0.5 * (right - left), LIGHT.series[1]),
        ):
            wheels.step(np.arange(1, len(values) + 1), values, color=colour, linewidth=0.8, label=name)
        wheels.set(xlabel="step", ylim=(-1.15, 1.6), yticks=(-1, 0, 1), xlim=(0, 100))
    grid[0, 0].set_ylabel("map units")
    grid[1, 0].set_ylabel("command")
    grid[1, 0].legend(frameon=False, fontsize=8, loc="upper left", ncols=2)
    return figure


def _draw_way(axes: Axes, trace: dict[str, Any]) -> None:
    """Draw the way of a robot's centre from its start, a circle of its size where it ends, and the wall."""
    x, y = np.array(trace["x"]), np.array(trace["y"])
    axes.plot(x, y, "-", color=LIGHT.series[0], linewidth=1.0)
    axes.plot(x[:1], y[:1], "o", color=LIGHT.series[0], markersize=4)
    turn = np.linspace(0, 2 * np.pi, 60)
    axes.plot(x[-1] + AGENT9.radius * np.cos(turn), y[-1] + AGENT9.radius * np.sin(turn), color=LIGHT.ink, linewidth=1)
    middle = 0.5 * (x.min() + x.max())
    half = max(0.5 * float(np.ptp(x)) + 10.0, 35.0)
    axes.add_patch(Rectangle((middle - half, WALL - 8.0), 2 * half, 8.0, color=LIGHT.edge, linewidth=0))
    axes.set(xlim=(middle - half, middle + half), ylim=(WALL - 8.0, max(float(y.max()) + 10.0, WALL + 2 * half - 8.0)))
    axes.set_aspect("equal")


ITEMS = (Item(figure="8.6", title="the two oscillations, and what makes them rarer", section="8.3", make=oscillations),)
