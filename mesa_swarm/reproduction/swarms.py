"""Figures 5.5 to 5.10: exploring, gathering, chains."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.analysis import (
    clark_evans,
    clusters,
    coverage,
    follow_chains,
    kept_together,
    nearest_neighbour_distances,
    reachable_cells,
)
from mesa_swarm.experiments.statistics import mean_interval
from mesa_swarm.gallery import find_model
from mesa_swarm.reproduction.drawing import column, world_picture
from mesa_swarm.reproduction.judging import Check, Result, judged_difference, judged_mean, judged_share
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.registry import Item
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.run_pictures import trace

Numbers = dict[str, float | None]
# Robots within this distance of each other are in one group, whatever made the group.
GROUP = 40.0
# Claims about groups are judged at that distance, and with others beside it: they should not depend on it.
LINKS = (GROUP, 25.0, 60.0)
# Steps after which robots that are still together are counted.
WINDOW = 200
FRAME = 5
EARLY, LATE = 1_000, 3_000
# Groups of pairs and threes.
SMALL = 3
# Of the map openspace, within its walls.
INNER_AREA = 760.0 * 560.0
# A robot that senses the full front, is quick, and turns on the spot before contact.
EXPLORER = {
    "n_robots": 1,
    "map": "original",
    "design": "WIDE3",
    "max_speed": 4.0,
    "distance": 7.0,
    "spot_distance": 3.5,
}


def exploration_run(rng: int, steps: int = 60_000, **settings: Any) -> Numbers:
    """Let one robot explore the map `original`; return which share of the cells within its reach it visited.

    Cells are those of a 40 x 40 grid in which the robot's centre can be. The robot is the `EXPLORER`, unless
    settings of `CollisionAvoidance` are given.
    """
    model = find_model("collision_avoidance")(rng=rng, **{**EXPLORER, **settings})
    solids = [(obstacle.shape.geometry, obstacle.shape.radius) for obstacle in model.obstacles if obstacle.contact]
    radius, start = float(model.swarm.radius[0]), model.swarm.position[0].copy()
    cells = reachable_cells(model.map.bounds, solids, radius, start)
    watched = model.watch(last=None, columns=("position",))
    model.run(steps)
    return {
        "coverage": coverage(watched["position"], cells, model.map.bounds),
        "collisions": float(model.total_collisions),
    }


def agglomeration_run(rng: int, **settings: Any) -> Numbers:
    """Let robots agglomerate; return their spacing relative to the start, groups, and the pairs that stay together."""
    model = find_model("agglomeration")(rng=rng, **settings)
    spacing = nearest_neighbour_distances(model.swarm.position).mean()
    numbers: Numbers = {"randomness at 0": float(clark_evans(model.swarm.position, INNER_AREA))}
    for step in (EARLY, LATE):
        together = together_until(model, step)
        groups = clusters(model.swarm.position, GROUP)
        numbers.update(grouping(model, step))
        numbers[f"spacing at {step}"] = float(nearest_neighbour_distances(model.swarm.position).mean() / spacing)
        numbers[f"size at {step}"] = groups.mean_size
        numbers[f"small groups at {step}"] = float(np.count_nonzero(groups.sizes <= SMALL))
        numbers[f"local convergence at {step}"] = groups.local_convergence
        numbers[f"kept together at {step}"] = together
    return known(numbers)


def grouping(model: SwarmModel, step: int) -> Numbers:
    """Return how many groups there are, the largest, and the mean size of a robot's own, at each distance of a link."""
    numbers: Numbers = {}
    for link in LINKS:
        groups = clusters(model.swarm.position, link)
        numbers[f"groups at {step}, {link:g}"] = float(groups.count)
        numbers[f"largest at {step}, {link:g}"] = float(groups.sizes.max(initial=1))
        numbers[f"own group at {step}, {link:g}"] = groups.own_size
    return numbers


def together_until(model: SwarmModel, until: int) -> float:
    """Run a model until a step; return the share of pairs in one group that still were after the last 200 steps."""
    model.run(until - WINDOW - model.steps)
    before = clusters(model.swarm.position, GROUP).label
    model.run(WINDOW)
    return kept_together(before, clusters(model.swarm.position, GROUP).label)


def chain_run(rng: int, **settings: Any) -> Numbers:
    """Let robots form chains; return their lengths, the outcomes of head-on meetings, and the pairs that stay together.

    Lengths and shares are means over the 200 steps before step 1,000 and before step 3,000.
    """
    model = find_model("chain_formation")(rng=rng, **settings)
    watched = model.watch(last=None, every=FRAME, columns=("position", "heading"))
    numbers = grouping(model, 0)
    for step in (EARLY, LATE):
        numbers[f"kept together at {step}"] = together_until(model, step)
        numbers.update(grouping(model, step))
    history = follow_chains(
        watched["position"], watched["heading"], watched.steps, link_distance=model.link_distance, patience=3
    )
    for step in (EARLY, LATE):
        frames = (watched.steps > step - WINDOW) & (watched.steps <= step)
        numbers[f"length at {step}"] = mean_or_one(history.mean_length[frames])
        numbers[f"chained at {step}"] = float(history.chained[frames].mean())
    outcomes = history.outcomes()
    met = sum(outcomes.values())
    kinds = [event.kind for event in history.events]
    numbers.update({f"{kind}s": float(kinds.count(kind)) for kind in ("merge", "split")})
    numbers["meetings"] = float(met)
    numbers["dispersals"] = float(outcomes["dispersed"])
    numbers["share dispersed"] = outcomes["dispersed"] / met if met else None
    return known(numbers)


def mean_or_one(lengths: np.ndarray) -> float:
    """Return the mean length of chains; a robot alone counts as a chain of one where there is none."""
    return float(np.where(np.isnan(lengths), 1.0, lengths).mean())


def known(numbers: Numbers) -> Numbers:
    """Return the same with None for what could not be measured: JSON has no NaN."""
    return {name: None if value is None or np.isnan(value) else value for name, value in numbers.items()}


SEEDS = 100
EXPLORING_SEEDS = 12
EXPLORING_STEPS = 60_000
# More would make the picture black.
TRACED_STEPS = 20_000
# Nearly all: the rest is a cell that is entered only just.
NEARLY_ALL = 0.95
# The robot of the other figures, which enters a closed orbit.
SLOW = {"design": "AGENT9", "max_speed": 1.0, "distance": 15.0, "spot_distance": 0.0}
GATHERING = "AGENT9, sight 50, stop_distance 12, avoid_distance 4, map openspace, 50 robots"
CHAINING = "AGENT3, sight 50, gap 15, cruise speed 0.7, map openspace, 50 robots"


def exploration(laboratory: Laboratory) -> Result:
    """Make figure 5.5: the trace of one robot."""
    steps, seeds = laboratory.pick(EXPLORING_STEPS, 3_000), laboratory.seeds(EXPLORING_SEEDS)
    points = [{}, SLOW, {**SLOW, "turn_interval": 200}]
    quick, slow, turning = laboratory.grid(exploration_run, [{**p, "steps": steps} for p in points], seeds)
    model = find_model("collision_avoidance")(rng=1, **EXPLORER)
    return Result(
        checks=(*explorer_checks(quick), *plain_robot_checks(slow, turning)),
        pictures={"": trace(model, laboratory.pick(TRACED_STEPS, 3_000))},
        settings=(
            f"map original, {steps:,} steps; WIDE3, max_speed 4, distance 7, spot_distance 3.5; a cell of a "
            "40 x 40 grid counts where the robot's centre can be"
        ),
        remarks=(
            "A robot covers nearly the whole map if it senses the full front, turns on the spot before contact, and "
            "travels far enough. A standard robot enters a closed orbit.",
        ),
    )


def explorer_checks(rows: list[dict]) -> list[Check]:
    """Return the checks of the one robot."""
    return [
        judged_share(
            "one robot reaches all areas of the map (95 % of the cells), in most runs",
            "trace through all areas (one run)",
            [share >= NEARLY_ALL for share in column(rows, "coverage")],
            low=0.5,
        ),
        judged_mean("mean over runs", "one run", column(rows, "coverage"), low=NEARLY_ALL, main=False),
        judged_mean("it has no collisions", "no collisions", column(rows, "collisions"), high=0),
    ]


def plain_robot_checks(slow: list[dict], turning: list[dict]) -> list[Check]:
    """Return the checks of a robot like those of the other figures, without and with random turns."""
    return [
        judged_mean(
            "a standard robot does the same (AGENT9, speed 1, distance 15)",
            "trace through all areas",
            column(slow, "coverage"),
            low=NEARLY_ALL,
            main=False,
        ),
        judged_difference(
            "with random turns a standard robot reaches more",
            "proposed (5.3.1)",
            column(slow, "coverage"),
            column(turning, "coverage"),
            names=("without", "with"),
            main=False,
        ),
    ]


def gathering_start(laboratory: Laboratory) -> Result:
    """Make figure 5.6: fifty robots at random."""
    rows = laboratory.runs(agglomeration_run, laboratory.fresh_seeds(SEEDS))
    check = judged_mean(
        "robots start at random places (Clark and Evans's ratio is 1)",
        "50 robots, random",
        column(rows, "randomness at 0"),
        low=0.9,
        high=1.2,
    )
    return Result(checks=(check,), pictures={"": gathering_picture(0)}, settings=GATHERING)


def gathering_early(laboratory: Laboratory) -> Result:
    """Make figure 5.7: the same after 1,000 steps."""
    rows = laboratory.runs(agglomeration_run, laboratory.fresh_seeds(SEEDS))
    return Result(
        checks=tuple(gathering_checks(rows, EARLY)),
        pictures={"": gathering_picture(laboratory.pick(EARLY, 100))},
        settings=GATHERING,
    )


def gathering_late(laboratory: Laboratory) -> Result:
    """Make figure 5.8: the same after 3,000 steps."""
    rows = laboratory.runs(agglomeration_run, laboratory.fresh_seeds(SEEDS))
    merging = judged_difference(
        "groups go on merging",
        "fewer, larger groups at 3,000",
        column(rows, f"size at {EARLY}"),
        column(rows, f"size at {LATE}"),
        names=("robots per group at 1,000", "at 3,000"),
        main=False,
    )
    return Result(
        checks=(*gathering_checks(rows, LATE), merging),
        pictures={"": gathering_picture(laboratory.pick(LATE, 200))},
        settings=GATHERING,
    )


def gathering_checks(rows: list[dict], step: int) -> list[Check]:
    """Return the checks of the groups at a step."""
    return [
        judged_mean(
            "robots agglomerate: mean distance to the nearest robot, relative to the start",
            "groups in the picture",
            column(rows, f"spacing at {step}"),
            high=0.5,
        ),
        judged_share(
            "there are many groups, never one (local convergence)",
            "many groups",
            [groups > 1 for groups in column(rows, f"groups at {step}, {GROUP:g}")],
            low=0.9,
        ),
        judged_share(
            "groups of two or three robots are among them",
            "groups of 2 to 3",
            [small > 0 for small in column(rows, f"small groups at {step}")],
            low=0.9,
        ),
    ]


def gathering_picture(step: int) -> Figure:
    """Return a picture of agglomerating robots at a step, with lines to what each robot perceives."""
    model = find_model("agglomeration")(rng=1).run(step)
    return world_picture(model, f"Agglomeration, step {model.steps:,}", perceived=True)


def chains_early(laboratory: Laboratory) -> Result:
    """Make figure 5.9: chains have formed, and hold more robots together than clusters do."""
    seeds = laboratory.fresh_seeds(SEEDS)
    rows, groups = laboratory.runs(chain_run, seeds), laboratory.runs(agglomeration_run, seeds)
    checks = (
        judged_mean("most robots are in chains", "chains in the picture", column(rows, f"chained at {EARLY}"), low=0.5),
        *(check for link in LINKS for check in cohesion_checks(groups, rows, link)),
        judged_difference(
            "grouped pairs stay in one group: share that still are 200 steps later",
            "higher cohesion",
            column(groups, f"kept together at {LATE}"),
            column(rows, f"kept together at {LATE}"),
            names=("clusters", "chains"),
            main=False,
        ),
        judged_mean("chains merge, times per run", "seen", column(rows, "merges"), low=1, main=False),
        judged_mean("chains split, times per run", "seen", column(rows, "splits"), low=1, main=False),
    )
    by_chance = mean_interval(column(rows, f"own group at 0, {GROUP:g}")).estimate
    return Result(
        checks=checks,
        pictures={"": chain_picture(laboratory.pick(EARLY, 100))},
        settings=f"{CHAINING}; groups are of robots that links join, at step 3,000; clusters: {GATHERING}",
        remarks=(
            "Cohesion is read as what the section describes: groups merge, and do not converge into many small ones. "
            f"A robot's own group is averaged over robots, not over groups; at the random start it has {by_chance:.2f} "
            "robots.",
            "Clusters at rest keep their pairs together because they do not move; chains exchange robots as they "
            "merge and split. That measure was the main one before.",
        ),
    )


def cohesion_checks(groups: list[dict], rows: list[dict], link: float) -> list[Check]:
    """Return the checks of chains against clusters with links of at most this length; one length is the main one."""
    sides = "clusters", "chains"

    def judged(claim: str, name: str, *, fewer: bool = False) -> Check:
        pair = [column(side, f"{name} at {LATE}, {link:g}") for side in (groups, rows)]
        pair, names = (pair[::-1], sides[::-1]) if fewer else (pair, sides)
        claim = f"{claim}, links of {link:g}"
        return judged_difference(claim, "higher cohesion", *pair, names=names, main=link == GROUP)

    return [
        judged("a robot's own group is larger in chains", "own group"),
        judged("the largest group is larger", "largest"),
        judged("there are fewer groups", "groups", fewer=True),
    ]


def chains_late(laboratory: Laboratory) -> Result:
    """Make figure 5.10: chains have merged, and what their two rules do."""
    seeds = laboratory.fresh_seeds(SEEDS)
    rows, loose, leading = laboratory.grid(chain_run, [{}, {"gap_rule": "off"}, {"head_on": "on"}], seeds)
    merging = judged_difference(
        "chains go on merging",
        "longer later",
        column(rows, f"length at {EARLY}"),
        column(rows, f"length at {LATE}"),
        names=("robots per chain at 1,000", "at 3,000"),
    )
    hurrying = judged_difference(
        "the gap rule makes chains longer",
        "without it chains break",
        column(loose, f"length at {LATE}"),
        column(rows, f"length at {LATE}"),
        names=("without", "with"),
        main=False,
    )
    return Result(
        checks=(merging, hurrying, *head_on_checks(rows, leading)),
        pictures={"": chain_picture(laboratory.pick(LATE, 200))},
        settings=CHAINING,
    )


def head_on_checks(rows: list[dict], leading: list[dict]) -> list[Check]:
    """Return the checks of chains that meet head-on, without and with random turning speeds."""
    return [
        judged_mean(
            "head-on pairs approach, then disperse: share of meetings",
            "seen",
            column(rows, "share dispersed"),
            low=0.25,
            main=False,
        ),
        judged_difference(
            "random turning speeds (10.2) leave fewer meetings dispersed",
            "proposed",
            column(leading, "share dispersed"),
            column(rows, "share dispersed"),
            names=("with", "without"),
            main=False,
        ),
        judged_difference(
            "random turning speeds make chains longer",
            "hoped for",
            column(rows, f"length at {LATE}"),
            column(leading, f"length at {LATE}"),
            names=("without", "with"),
            main=False,
        ),
    ]


def chain_picture(step: int) -> Figure:
    """Return a picture of robots in chains at a step."""
    model = find_model("chain_formation")(rng=1).run(step)
    return world_picture(model, f"Chain formation, step {model.steps:,}")


ITEMS = (
    Item(figure="5.5", title="trace of one exploring robot", section="5.3.1", make=exploration),
    Item(figure="5.6", title="agglomeration at the start", section="5.3.2", make=gathering_start),
    Item(figure="5.7", title="agglomeration after 1,000 steps", section="5.3.2", make=gathering_early),
    Item(figure="5.8", title="agglomeration after 3,000 steps", section="5.3.2", make=gathering_late),
    Item(figure="5.9", title="chains have formed", section="5.3.3", make=chains_early),
    Item(figure="5.10", title="merged chains, and the effect of their rules", section="5.3.3", make=chains_late),
)
