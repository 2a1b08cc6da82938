"""Figures 4.12 to 4.16: the time of a step."""

from collections.abc import Sequence
from time import process_time

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.experiments.bench import CIRCLE, MAPS, mean_seconds, on_map
from mesa_swarm.reproduction.drawing import draw_means, plain_axes
from mesa_swarm.reproduction.judging import Check, Result, judged_difference, judged_mean
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.registry import Item
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.swarm_model import SwarmModel

# Steps until the number of meetings no longer grows.
WARM_UP = 50
BATCHES = 5


def timing_run(rng: int, *, robots: int, map: str, sensors: int, milliseconds: float) -> dict[str, float]:
    """Return the processor time of a step: the least mean of five batches, which other programs disturb least.

    Robots with 3, 6 or 9 sensors avoid and explore; with 0, they move in circles, and only contact is computed. A batch
    takes about this number of milliseconds of processor time.
    """
    model = timed_world(rng, robots, map, sensors).run(WARM_UP)
    each = max(mean_seconds(model.step, 20, process_time), 1e-6)
    steps = max(int(milliseconds / 1000 / each), 5)
    return {"seconds": min(mean_seconds(model.step, steps, process_time) for _ in range(BATCHES))}


def timed_world(rng: int, robots: int, map: str, sensors: int) -> SwarmModel:
    """Return the world that is timed."""
    if sensors:
        return on_map(robots, map, sensors, rng)
    model = SwarmModel(map=map, rng=rng)
    model.add_robots(RobotDesign(name="blind"), robots)
    model.swarm.columns["command"][:] = CIRCLE
    return model


ROBOTS = (6, 12, 18, 24, 30, 36, 42, 48)
SENSORS = (3, 6, 9)
SEEDS = 8
# With fewer robots the time of a step hardly depends on them.
FEWEST = 6
DENSE_TO = 42
SETTINGS = (
    "processor time of one step, the least of five batches, compiled engine with a grid of neighbours, which the "
    "thesis did not have; robots of radius 5"
)

Times = dict[tuple, np.ndarray]


def step_times(laboratory: Laboratory, maps: Sequence[str], sensors: Sequence[int]) -> Times:
    """Return milliseconds a step by map and sensors, each of shape (robots, seeds)."""
    kinds = [(name, s) for name in maps for s in sensors]
    budget = laboratory.pick(20.0, 2.0)
    points = [{"robots": n, "map": name, "sensors": s, "milliseconds": budget} for name, s in kinds for n in ROBOTS]
    rows = laboratory.grid(timing_run, points, laboratory.seeds(SEEDS), alone=True)
    times = 1000 * np.array([[row["seconds"] for row in seeds] for seeds in rows])
    return dict(zip(kinds, times.reshape(len(kinds), len(ROBOTS), -1), strict=True))


def exponents(times: np.ndarray, robots: Sequence[int] = ROBOTS) -> np.ndarray:
    """Return for every seed the b of t = a n^b, by least squares of the logarithms of times (robots, seeds)."""
    x = np.log(np.asarray(robots, float)) - np.log(robots).mean()
    return x @ np.log(times) / (x @ x)


def at_most_squared(what: str, times: Times) -> list[Check]:
    """Judge whether times grow at most as n^2 on each map."""
    return [
        judged_mean(f"{what} grows at most as n^2, map {name}: exponent", "O(n^2)", list(exponents(each)), high=2.0)
        for (name, _), each in times.items()
    ]


def contact_alone(laboratory: Laboratory) -> Result:
    """Make figure 4.12: contact alone on three maps."""
    times = step_times(laboratory, MAPS, (0,))
    checks = at_most_squared("contact", times)
    dense, wide = times["original", 0][-1], times["openspace", 0][-1]
    matters = judged_difference(
        "the map matters: ms a step of 48 robots", "yes", wide, dense, names=("open", "dense"), main=False
    )
    return Result(
        checks=(*checks, matters), pictures={"": times_figure(times, "contact alone, ms a step")}, settings=SETTINGS
    )


def whole_step(laboratory: Laboratory) -> Result:
    """Make figure 4.13: the whole step on three maps."""
    times = step_times(laboratory, MAPS, (3,))
    checks = at_most_squared("the step", times)
    few = [i for i, n in enumerate(ROBOTS) if FEWEST <= n <= DENSE_TO]
    dense = exponents(times["original", 3][few], [ROBOTS[i] for i in few])
    less = judged_mean(
        "on the dense map it grows less than in proportion up to 42 robots: exponent", "below 1", list(dense), high=1.0
    )
    return Result(
        checks=(*checks, less),
        pictures={"": times_figure(times, "whole step, 3 sensors, ms")},
        settings=SETTINGS,
    )


def contact_share(laboratory: Laboratory) -> Result:
    """Make figure 4.14: the share of contact in a step."""
    contact, whole = step_times(laboratory, MAPS, (0,)), step_times(laboratory, MAPS, (3,))
    shares = {(name, 3): contact[name, 0] / whole[name, 3] for name in MAPS}
    checks = tuple(
        judged_difference(
            f"the share of contact falls with robots, map {name}",
            "falls",
            shares[name, 3][-1],
            shares[name, 3][0],
            names=("share at 48", "at 6"),
        )
        for name in MAPS
    )
    return Result(
        checks=checks,
        pictures={"": times_figure(shares, "contact alone / whole step")},
        settings=SETTINGS,
        remarks=(
            "The thesis tested all pairs for contact in interpreted code. Here the fixed cost of a step, calls and "
            "data collection, is a large part of it while robots are few.",
        ),
    )


def by_sensors(laboratory: Laboratory) -> Result:
    """Make figure 4.15: the step with three, six and nine sensors."""
    times = step_times(laboratory, MAPS[:1], SENSORS)
    more = [
        judged_difference(
            f"{b} sensors take longer than {a}: ms a step of 48 robots",
            "longer",
            times["original", a][-1],
            times["original", b][-1],
            names=(str(a), str(b)),
        )
        for a, b in ((3, 6), (6, 9))
    ]
    steeper = judged_difference(
        "extra time of nine sensors grows with robots: ms",
        "grows",
        times["original", 9][0] - times["original", 3][0],
        times["original", 9][-1] - times["original", 3][-1],
        names=("at 6", "at 48"),
    )
    return Result(
        checks=(*more, steeper), pictures={"": times_figure(times, "whole step, map original, ms")}, settings=SETTINGS
    )


def linear_in_sensors(laboratory: Laboratory) -> Result:
    """Make figure 4.16: the step over the number of sensors, for each number of robots."""
    times = step_times(laboratory, MAPS[:1], SENSORS)
    three, six, nine = (times["original", s] for s in SENSORS)
    bend = ((nine - six) - (six - three)) / (nine - three)
    checks = tuple(
        judged_mean(
            f"linear in sensors with {n} robots: bend, 0 for a straight line",
            "linear beyond 5 robots",
            list(bend[i]),
            low=-0.5,
            high=0.5,
            main=n >= 24,
        )
        for i, n in enumerate(ROBOTS)
        if n in (6, 24, 48)
    )
    figure, axes = plain_axes("sensors", "whole step, map original, ms")
    for k, i in enumerate((0, 3, 5, 7)):
        draw_means(axes, SENSORS, [times["original", s][i] for s in SENSORS], f"{ROBOTS[i]} robots", k)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return Result(
        checks=checks,
        pictures={"": figure},
        settings=f"{SETTINGS}; the bend is ((t9 - t6) - (t6 - t3)) / (t9 - t3), t3 being the time with 3 sensors",
        remarks=(
            "The designs AGENT3, AGENT6 and AGENT9 differ in where their sensors look as well, so that their robots "
            "crowd differently and each sensor costs differently.",
        ),
    )


def times_figure(times: Times, what: str) -> Figure:
    """Return a figure with a line for each map or number of sensors."""
    figure, axes = plain_axes("robots", what)
    several = len({sensors for _, sensors in times}) > 1
    for i, ((name, sensors), values) in enumerate(times.items()):
        draw_means(axes, ROBOTS, values, f"{sensors} sensors" if several else name, i)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return figure


ITEMS = (
    Item(figure="4.12", title="time of contact resolution on three maps", section="4.8", make=contact_alone),
    Item(figure="4.13", title="time of a step on three maps", section="4.8", make=whole_step),
    Item(figure="4.14", title="share of contact in a step", section="4.8", make=contact_share),
    Item(figure="4.15", title="time of a step with 3, 6 and 9 sensors", section="4.8", make=by_sensors),
    Item(figure="4.16", title="time of a step over sensors", section="4.8", make=linear_in_sensors),
)
