"""Figures 4.12 to 4.16: the time of a step."""

from collections.abc import Sequence
from time import process_time

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm import ProximitySensor, RobotDesign, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.benchmarks.speed import CIRCLE, MAPS, mean_seconds
from mesa_swarm_studies.drawing import draw_means, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_difference, judged_mean, judged_number
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

# Steps until the number of meetings no longer grows.
WARM_UP = 50
BATCHES = 5
# Of nine sensors that divide the full circle; the first three are those of avoidance.
BEARINGS = (0, 40, -40, 80, -80, 120, -120, 160, -160)


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
    """Return the world that is timed.

    Robots differ in nothing but the number of sensors: avoidance uses the first three, which are those of all, so that
    robots with three, six and nine of them move alike.
    """
    model = SwarmModel(map=map, rng=rng)
    model.add_robots(sensing_design(sensors) if sensors else RobotDesign(name="blind"), robots)
    if sensors:
        model.control = Subsumption(Avoid(distance=15), Explore())
    else:
        model.swarm.columns["command"][:] = CIRCLE
    return model


def sensing_design(sensors: int) -> RobotDesign:
    """Return a design with the first of nine sensors that divide the full circle."""
    return RobotDesign(
        name=f"first {sensors} of 9",
        sensors=tuple(ProximitySensor(bearing_degrees=b, field_of_view_degrees=40) for b in BEARINGS[:sensors]),
    )


ROBOTS = (6, 12, 18, 24, 30, 36, 42, 48)
SENSORS = (3, 6, 9)
SEEDS = 24
# With fewer robots the time of a step hardly depends on them.
FEWEST = 6
DENSE_TO = 42
# Beyond five robots, as in the thesis: the numbers of robots that are judged.
JUDGED = (12, 24, 48)
# A ratio that changes by less is the same.
SAME = 0.1
# Largest bend: three more sensors cost between half and twice as much as the three before.
BEND = 1 / 3
SETTINGS = (
    "processor time of one step, the least of five batches, compiled engine with a grid of neighbours, which the "
    "thesis did not have; robots of radius 5 with the first three of nine sensors that divide the full circle; lines "
    "are least-squares quadratics, as in the thesis"
)

FIXED = (
    "Nearly all of a step's time with few robots is a fixed cost, calls and data collection, so that exponents are far "
    "below 2. What further robots add is judged beside them."
)

Times = dict[tuple, np.ndarray]


def step_times(laboratory: Laboratory, maps: Sequence[str], sensors: Sequence[int]) -> Times:
    """Return milliseconds a step by map and sensors, each of shape (robots, seeds)."""
    kinds = [(name, s) for name in maps for s in sensors]
    budget = laboratory.pick(20.0, 2.0)
    points = [{"robots": n, "map": name, "sensors": s, "milliseconds": budget} for name, s in kinds for n in ROBOTS]
    rows = laboratory.grid(timing_run, points, laboratory.fresh_seeds(SEEDS), alone=True)
    times = 1000 * np.array([[row["seconds"] for row in seeds] for seeds in rows])
    return dict(zip(kinds, times.reshape(len(kinds), len(ROBOTS), -1), strict=True))


def exponents(times: np.ndarray, robots: Sequence[int] = ROBOTS) -> np.ndarray:
    """Return for every seed the b of t = a n^b, by least squares of the logarithms of times (robots, seeds)."""
    x = np.log(np.asarray(robots, float)) - np.log(robots).mean()
    return x @ np.log(times) / (x @ x)


def quadratic(times: np.ndarray) -> np.ndarray:
    """Return the quadratic of n that fits the means of times (robots, seeds) best, at each number of robots."""
    means = times.mean(axis=1)
    return np.polyval(np.polyfit(ROBOTS, means, 2), ROBOTS)


def explained(times: np.ndarray) -> float:
    """Return the share of the variance of mean times over the numbers of robots that the quadratic explains."""
    means = times.mean(axis=1)
    return float(1 - np.sum((means - quadratic(times)) ** 2) / np.sum((means - means.mean()) ** 2))


def at_most_squared(what: str, times: Times) -> list[Check]:
    """Judge whether times grow at most as n^2 on each map, with the fixed cost of a step and without it."""
    with_fixed = [
        judged_mean(f"{what} grows at most as n^2, map {name}: exponent", "O(n^2)", list(exponents(each)), high=2.0)
        for (name, _), each in times.items()
    ]
    return [*with_fixed, *(beyond_fixed(what, name, each) for (name, _), each in times.items())]


def beyond_fixed(what: str, name: str, times: np.ndarray) -> Check:
    """Judge the growth of what robots add to the fixed cost: with n^2, from 24 to 48 four times that from 12 to 24."""
    few, some, many = (times[ROBOTS.index(n)] for n in JUDGED)
    return judged_difference(
        f"without the fixed cost {what} grows at most as n^2, map {name}: ms of further robots",
        "O(n^2)",
        {"from 24 to 48": list(many - some), "four times those from 12 to 24": list(4 * (some - few))},
        main=False,
    )


def contact_alone(laboratory: Laboratory) -> Result:
    """Make figure 4.12: contact alone on three maps."""
    times = step_times(laboratory, MAPS, (0,))
    checks = at_most_squared("contact", times)
    dense, wide = times["original", 0][-1], times["openspace", 0][-1]
    matters = judged_difference(
        "the map matters: ms a step of 48 robots", "yes", {"open": wide, "dense": dense}, main=False
    )
    return Result(
        checks=(*checks, matters),
        pictures={"": times_figure(times, "contact alone, ms a step")},
        settings=SETTINGS,
        remarks=(FIXED,),
    )


def whole_step(laboratory: Laboratory) -> Result:
    """Make figure 4.13: the whole step on three maps."""
    times = step_times(laboratory, MAPS, (3,))
    few = [i for i, n in enumerate(ROBOTS) if FEWEST <= n <= DENSE_TO]
    dense = exponents(times["original", 3][few], [ROBOTS[i] for i in few])
    less = judged_mean(
        "on the dense map it grows less than in proportion up to 42 robots: exponent", "below 1", list(dense), high=1.0
    )
    trend = [
        judged_number(
            f"a quadratic in n describes the means, map {name}: share of their variance",
            "quadratic trend line",
            explained(each),
            low=0.95,
            main=False,
        )
        for (name, _), each in times.items()
    ]
    return Result(
        checks=(*at_most_squared("the step", times), less, *trend),
        pictures={"": times_figure(times, "whole step, 3 sensors, ms")},
        settings=SETTINGS,
        remarks=(FIXED,),
    )


def contact_share(laboratory: Laboratory) -> Result:
    """Make figure 4.14: contact and the whole step relative to six robots, and the share of contact in a step."""
    contact, whole = step_times(laboratory, MAPS, (0,)), step_times(laboratory, MAPS, (3,))
    shares = {(name, 3): contact[name, 0] / whole[name, 3] for name in MAPS}
    checks = tuple(
        judged_difference(
            f"the share of contact falls with robots, map {name}",
            "falls",
            {"share at 48": shares[name, 3][-1], "at 6": shares[name, 3][0]},
        )
        for name in MAPS
    )
    slower = judged_difference(
        "from 6 to 48 robots the whole step grows by a larger factor than contact, map original",
        "both normalised in one figure",
        {
            "contact": contact["original", 0][-1] / contact["original", 0][0],
            "whole step": whole["original", 3][-1] / whole["original", 3][0],
        },
        main=False,
    )
    return Result(
        checks=(*checks, slower),
        pictures={"": normalised_figure(contact, whole), "share": times_figure(shares, "contact alone / whole step")},
        settings=SETTINGS,
        remarks=(
            "The thesis tested all pairs for contact in interpreted code. Here the fixed cost of a step, calls and "
            "data collection, is a large part of it while robots are few. Contact alone is timed with robots that "
            "sense nothing and move in circles, the whole step with robots that avoid: the share is of two kinds of "
            "runs.",
        ),
    )


def by_sensors(laboratory: Laboratory) -> Result:
    """Make figure 4.15: the step with three, six and nine sensors."""
    times = step_times(laboratory, MAPS[:1], SENSORS)
    more = [
        judged_difference(
            f"{b} sensors take longer than {a}: ms a step of 48 robots",
            "longer",
            {f"{a} sensors": times["original", a][-1], f"{b} sensors": times["original", b][-1]},
        )
        for a, b in ((3, 6), (6, 9))
    ]
    steeper = judged_difference(
        "extra time of nine sensors grows with robots: ms",
        "grows",
        {
            "at 6": times["original", 9][0] - times["original", 3][0],
            "at 48": times["original", 9][-1] - times["original", 3][-1],
        },
    )
    return Result(
        checks=(*more, steeper), pictures={"": times_figure(times, "whole step, map original, ms")}, settings=SETTINGS
    )


def relative_to_three(laboratory: Laboratory) -> Result:
    """Make figure 4.16: the step relative to that of robots with three sensors, over the number of robots."""
    times = step_times(laboratory, MAPS[:1], SENSORS)
    ratios = {("original", s): times["original", s] / times["original", 3] for s in SENSORS}
    return Result(
        checks=(*straight(times), *same_ratio(times)),
        pictures={"": times_figure(ratios, "whole step relative to 3 sensors", trend=False)},
        settings=f"{SETTINGS}; the bend is ((t9 - t6) - (t6 - t3)) / (t9 - t3), t3 being the time with 3 sensors; "
        "robots with three, six and nine sensors move alike, since avoidance uses three",
        remarks=(
            "A step has a fixed cost, calls and data collection, which does not depend on sensors: it makes the ratio "
            "smaller while robots are few. The last claim removes it: it compares what further robots cost. Bends of "
            "0.5 were allowed, and the same ratio was a side claim, in earlier judgements.",
        ),
    )


def straight(times: Times) -> list[Check]:
    """Judge whether time grows linearly with sensors."""
    three, six, nine = (times["original", s] for s in SENSORS)
    bend = ((nine - six) - (six - three)) / (nine - three)
    return [
        judged_mean(
            f"linear in sensors with {n} robots: bend, 0 for a straight line",
            "linear beyond 5 robots",
            list(bend[ROBOTS.index(n)]),
            low=-BEND,
            high=BEND,
        )
        for n in JUDGED
    ]


def same_ratio(times: Times) -> list[Check]:
    """Judge whether nine sensors cost the same relative to three, whatever the number of robots."""
    few, some, many = (
        np.array([times["original", s][ROBOTS.index(n)] for s in (SENSORS[0], SENSORS[-1])]) for n in JUDGED
    )
    ratio_few, ratio_many = few[1] / few[0], many[1] / many[0]
    further_few, further_many = (some - few)[1] / (some - few)[0], (many - some)[1] / (many - some)[0]
    return [
        judged_mean(
            "the ratio of nine to three sensors is the same for every n: at 48 minus at 12",
            "the same for every n",
            list(ratio_many - ratio_few),
            low=-SAME,
            high=SAME,
        ),
        judged_mean(
            "the same ratio of what further robots cost: from 24 to 48 minus from 12 to 24",
            "the same for every n",
            list(further_many - further_few),
            low=-2 * SAME,
            high=2 * SAME,
            main=False,
        ),
    ]


def times_figure(times: Times, what: str, *, trend: bool = True) -> Figure:
    """Return a figure with the means of each map or number of sensors, and the quadratics that fit them best."""
    figure, axes = plain_axes("robots", what)
    several = len({sensors for _, sensors in times}) > 1
    for i, ((name, sensors), values) in enumerate(times.items()):
        draw_means(axes, ROBOTS, values, f"{sensors} sensors" if several else name, i, joined=not trend)
        if trend:
            axes.plot(ROBOTS, quadratic(values), color=LIGHT.series[i], linewidth=1.2)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return figure


def normalised_figure(contact: Times, whole: Times) -> Figure:
    """Return a figure of contact and of the whole step, each relative to its time with the fewest robots."""
    figure, axes = plain_axes("robots", f"time relative to {ROBOTS[0]} robots")
    for i, name in enumerate(MAPS):
        for times, sensors, label, line in ((contact, 0, "contact", "--"), (whole, 3, "whole step", "-")):
            means = times[name, sensors].mean(axis=1)
            axes.plot(ROBOTS, means / means[0], line, color=LIGHT.series[i], linewidth=1.6, label=f"{name}, {label}")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return figure


ITEMS = (
    Item(figure="4.12", title="time of contact resolution on three maps", section="4.8", make=contact_alone),
    Item(figure="4.13", title="time of a step on three maps", section="4.8", make=whole_step),
    Item(
        figure="4.14",
        title="contact and the whole step, normalised, and their ratio",
        section="4.8",
        make=contact_share,
    ),
    Item(figure="4.15", title="time of a step with 3, 6 and 9 sensors", section="4.8", make=by_sensors),
    Item(
        figure="4.16",
        title="cost relative to three sensors, over robots",
        section="4.8",
        make=relative_to_three,
    ),
)
