"""Published results about bodies: sheep that flee, pucks that are carried, food that is brought home."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.experiments import share_interval
from mesa_swarm.gallery import find_model
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, draw_means, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_difference, judged_measure, judged_share
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

Numbers = dict[str, float | None]
SEEDS = 30
HERDING_STEPS = 4_000
NEIGHBOURS = 10
# Flocks of which each sheep is attracted to ten others, and to all.
FLOCKS, UNITED = (12, 16, 20, 24, 32), (20, 40)


def herding_run(rng: int, steps: int = HERDING_STEPS, **settings: Any) -> Numbers:
    """Let one robot herd a flock; return at which step it was at the target, and whether."""
    model = find_model("shepherding")(rng=rng, **settings).run(steps)
    return {"home at": model.home_at, "home": float(model.home_at is not None)}


def shepherding(laboratory: Laboratory) -> Result:
    """Make the share of flocks that are brought to the target, against their size."""
    steps, seeds = laboratory.pick(HERDING_STEPS, 200), laboratory.seeds(SEEDS)
    points = [(n, NEIGHBOURS) for n in FLOCKS] + [(n, 0) for n in UNITED]
    rows = laboratory.grid(herding_run, [{"n_sheep": n, "neighbours": k, "steps": steps} for n, k in points], seeds)
    home = {point: column(runs, "home") for point, runs in zip(points, rows, strict=True)}
    return Result(
        checks=tuple(herding_checks(home)),
        pictures={"": herding_picture(home)},
        settings=(
            f"one robot, {steps:,} steps, weights and lengths of the paper, a metre is 4 map units; sheep start in a "
            "square of 75 m, of which the nearest corner is 106 m from the target; a flock is home if its centre is "
            "within 10 m of the target and all sheep are within 2 N^(2/3) m of the centre"
        ),
        remarks=(
            "The limit is sharp and near half of the flock: 28 of 30 flocks of 20 are home, and none of 24. The "
            "verdict is due to flocks of 32 alone: 5 of 30 are home, and the interval includes the limit of 0.2.",
            "Flocks of 40 with ten neighbours, judged together with those of 32, and of 80 with all, were planned too. "
            "They take long, and were left out before any result was looked at.",
        ),
    )


def herding_checks(home: dict[tuple[int, int], list[float]]) -> list[Check]:
    """Return the checks of who is brought home, by size of the flock and neighbours."""
    of_ten = {n: home[n, NEIGHBOURS] for n in FLOCKS}
    return [
        judged_share(
            "sheep that are attracted to all others are brought home (flocks of 20 and 40)",
            "always",
            happened([*home[20, 0], *home[40, 0]]),
            low=0.9,
        ),
        judged_share(
            "so are small flocks that are attracted to ten neighbours (12 and 16)",
            "from about half the flock on",
            happened([*of_ten[12], *of_ten[16]]),
            low=0.8,
        ),
        judged_share(
            "large flocks that are attracted to ten neighbours are not (32)",
            "rarely",
            happened(of_ten[32]),
            high=0.2,
        ),
        judged_difference(
            "success falls between flocks of 16 and 24: neighbours are 2/3 and 2/5 of the others",
            "limit at about half the flock",
            {"24 sheep": of_ten[24], "16 sheep": of_ten[16]},
            main=False,
        ),
        judged_share(
            "with 24 sheep, whose ten neighbours are less than half the flock, fewer than half of the flocks are home",
            "limit at about half the flock",
            happened(of_ten[24]),
            high=0.5,
            main=False,
        ),
    ]


def happened(shares: list[float]) -> list[bool]:
    """Return whether something happened in each run, from 1 and 0."""
    return [share > 0 for share in shares]


def herding_picture(home: dict[tuple[int, int], list[float]]) -> Figure:
    """Return the share of flocks that are brought home against their size."""
    figure, axes = plain_axes("sheep in the flock", "share of flocks at the target")
    draw_shares(axes, FLOCKS, [home[n, NEIGHBOURS] for n in FLOCKS], "attracted to 10 neighbours", 0)
    draw_shares(axes, UNITED, [home[n, 0] for n in UNITED], "attracted to all others", 1)
    axes.set_ylim(-0.05, 1.05)
    axes.legend(frameon=False, loc="center right")
    return figure


def draw_shares(axes: Axes, x: tuple[int, ...], samples: list[list[float]], label: str, i: int) -> None:
    """Draw the share of runs in which something happened, with Wilson's interval."""
    shares = [share_interval(int(sum(sample)), len(sample)) for sample in samples]
    middle = np.array([share.estimate for share in shares])
    reach = np.array([[share.estimate - share.low, share.high - share.estimate] for share in shares]).T
    axes.errorbar(x, middle, reach, fmt="os^"[i] + "-", color=LIGHT.series[i], markersize=5, capsize=3, label=label)


FORAGING_STEPS = 2_000
# Teams without thresholds; the largest is compared with one of the same size that has them.
TEAMS = (2, 6, 18)


def foraging_run(rng: int, steps: int = FORAGING_STEPS, **settings: Any) -> Numbers:
    """Let robots forage; return items per robot and 1,000 steps, all items, and the energy that an item has cost."""
    model = find_model("foraging")(rng=rng, **settings).run(steps)
    results = model.results()
    items = results["items"]
    return {
        "per robot": 1000 * items / (len(model.swarm) * steps),
        "items": items,
        "cost": results["energy used per item"],
        "energy": results["energy"],
    }


def foraging(laboratory: Laboratory) -> Result:
    """Make the efficiency of foraging robots against their number, without and with thresholds."""
    steps, seeds = laboratory.pick(FORAGING_STEPS, 200), laboratory.seeds(SEEDS)
    points = [{"n_robots": n, "thresholds": "no", "steps": steps} for n in TEAMS]
    points.append({"n_robots": TEAMS[-1], "thresholds": "yes", "steps": steps})
    *working, resting = laboratory.grid(foraging_run, points, seeds)
    return Result(
        checks=tuple(foraging_checks(working, resting)),
        pictures={"": foraging_picture(working, resting)},
        settings=(
            f"{steps:,} steps; an arena of 400 x 400 with a nest of radius 45 in its middle; 20 items of food, each "
            "worth 20; a robot uses 0.05 a step outside the nest and 0.005 in it; the store begins at 250 and holds 500"
        ),
        remarks=(
            "Why thresholds cost energy, by the means over runs: with them 7 of 18 robots are outside on average, "
            "without them 14, and the energy used outside for an item is 17.6 against 18.3. But 42 items are brought "
            "instead of 76, and resting robots add 2.5 to each. If rest cost nothing, thresholds would save a little.",
            "With thresholds the store stays near where it began (245 on average at the end), as it is meant to; "
            "without them it rises to 327.",
        ),
    )


def foraging_checks(working: list[list[dict]], resting: list[dict]) -> list[Check]:
    """Return the checks of teams that always work, by size, and of the largest team with thresholds."""
    two, six, many = working
    per_robot = "items per robot and 1,000 steps"
    return [
        judged_measure(
            f"a robot brings less in a team of 6 than in one of 2: {per_robot}",
            "efficiency falls with the size of the group",
            "per robot",
            {"6 robots": six, "2 robots": two},
        ),
        judged_measure(
            f"a robot brings less in a team of 18 than in one of 6: {per_robot}",
            "efficiency falls with the size of the group",
            "per robot",
            {"18 robots": many, "6 robots": six},
        ),
        judged_measure(
            "with thresholds, 18 robots use less energy for an item",
            "thresholds allot robots efficiently",
            "cost",
            {"with": resting, "without": many},
        ),
        judged_measure(
            "all robots together bring more: items of teams of 18 and of 6",
            "larger groups bring more in all",
            "items",
            {"6 robots": six, "18 robots": many},
            main=False,
        ),
        judged_share(
            "with thresholds the nest ends with at least a quarter of the full store",
            "the nest's energy is maintained",
            [energy >= 125 for energy in column(resting, "energy")],
            low=0.9,
            main=False,
        ),
    ]


def foraging_picture(working: list[list[dict]], resting: list[dict]) -> Figure:
    """Return the energy used for an item, and the items of a robot, against the number of robots."""
    figure, axes = plain_axes("robots", "items per robot and 1,000 steps")
    draw_means(axes, TEAMS, [column(rows, "per robot") for rows in working], "items per robot, all work", 0)
    costs = axes.twinx()
    costs.set_ylabel("energy used for an item")
    draw_means(costs, TEAMS, [column(rows, "cost") for rows in working], "energy per item, all work", 1)
    draw_means(costs, (TEAMS[-1],), [column(resting, "cost")], "energy per item, with thresholds", 2)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8)
    return figure


ITEMS = (
    Item(
        figure="foraging",
        title="a robot brings less in a large team; thresholds do not save energy",
        section="Krieger, Billeter and Keller 2000",
        make=foraging,
        paper=(
            "Krieger, Billeter and Keller, Ant-like task allocation and recruitment in cooperative robots, Nature 406, "
            "992-995 (2000)."
        ),
        about=(
            "Up to twelve robots brought food to a nest whose energy they used up; each left the nest when its energy "
            "was below the robot's own threshold. Robots are in each other's way, so that large groups are less "
            "efficient, and thresholds send out only as many as are needed. Here robots grip items, find the nest by "
            "a beacon, and are up to 18; nothing recruits others, and items that were brought are replaced at random "
            "places, singly, not in patches. What thresholds are compared with, robots that always work, is ours."
        ),
    ),
    Item(
        figure="shepherding",
        title="one robot herds a flock, if its sheep are attracted to enough others",
        section="Stroembom et al. 2014",
        make=shepherding,
        paper=(
            "Stroembom, Mann, Wilson, Hailes, Morton, Sumpter and King, Solving the shepherding problem, J. R. Soc. "
            "Interface 11, 20140719 (2014)."
        ),
        about=(
            "One shepherd that collects the farthest agent and drives the collected flock brings it to a target. In "
            "the paper this depends on how many neighbours an agent is attracted to: about half of the flock are "
            "needed, so that with a given number of neighbours only flocks up to a certain size come home. Here the "
            "sheep are plain Mesa agents of the model, with bodies that robots see and that push robots aside; the "
            "shepherd is a robot with a body, omnidirectional wheels, a camera for where the flock is, and infrared "
            "sensors by which it slows down near sheep. There is a border, 50 m from the target and from the start, "
            "and the shepherd has no blind angle."
        ),
    ),
)
