"""Published results about bodies: sheep that flee, pucks that are carried, food that is brought home."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.statistics import share_interval
from mesa_swarm.gallery import find_model
from mesa_swarm.reproduction.drawing import column, plain_axes
from mesa_swarm.reproduction.judging import Check, Result, judged_difference, judged_share
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.registry import Item

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
            "Flocks of 40 with ten neighbours, and of 80 with all, were planned too. They take long, and were left out "
            "before any result was looked at.",
        ),
    )


def herding_checks(home: dict[tuple[int, int], list[float]]) -> list[Check]:
    """Return the checks of who is brought home, by size of the flock and neighbours."""
    of_ten = {n: home[n, NEIGHBOURS] for n in FLOCKS}
    return [
        judged_share(
            "sheep that are attracted to all others are brought home (flocks of 20 and 40)",
            "always",
            [*home[20, 0], *home[40, 0]],
            low=0.9,
        ),
        judged_share(
            "so are small flocks that are attracted to ten neighbours (12 and 16)",
            "from about half the flock on",
            [*of_ten[12], *of_ten[16]],
            low=0.8,
        ),
        judged_share(
            "large flocks that are attracted to ten neighbours are not (32)",
            "rarely",
            of_ten[32],
            high=0.2,
        ),
        judged_difference(
            "success falls between flocks of 16 and 24: neighbours are 2/3 and 2/5 of the others",
            "limit at about half the flock",
            of_ten[24],
            of_ten[16],
            names=("24", "16"),
            main=False,
        ),
        judged_share(
            "with 24 sheep, whose ten neighbours are less than half the flock, fewer than half of the flocks are home",
            "limit at about half the flock",
            of_ten[24],
            high=0.5,
            main=False,
        ),
    ]


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
    axes.errorbar(x, middle, reach, fmt="os^"[i] + "-", color=COLOURS[i], markersize=5, capsize=3, label=label)


ITEMS = (
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
