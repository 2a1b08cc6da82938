"""Figures 5.5 to 5.10: exploring, gathering, chains."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm import SwarmModel
from mesa_swarm.analysis import (
    clark_evans,
    clusters,
    coverage,
    follow_chains,
    kept_together,
    nearest_neighbour_distances,
    reachable_cells,
)
from mesa_swarm.experiments import mean_interval
from mesa_swarm.gallery import find_model
from mesa_swarm.viewing import trace
from mesa_swarm_studies.drawing import column, world_picture
from mesa_swarm_studies.judging import Check, Result, judged_difference, judged_mean, judged_measure, judged_share
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

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
# Wheels that slip and sensors that err: without them a robot enters a closed orbit, which no real one would.
NOISE: dict[str, Any] = {"slip_probability": 0.1, "error_probability": 0.1}
# Areas of 100 x 100 map units, which a robot with a sight of 50 overlooks from the middle; and cells of 20 x 15.
AREAS, CELLS = (6, 8), (40, 40)


def exploration_run(rng: int, steps: int = 60_000, **settings: Any) -> Numbers:
    """Let one robot explore the map `original`; return which share of the areas and cells within its reach it visited.

    Those count in which the robot's centre can be. Settings are those of `CollisionAvoidance`.
    """
    model = find_model("collision_avoidance")(rng=rng, n_robots=1, map="original", **settings)
    solids = [(obstacle.shape.geometry, obstacle.shape.radius) for obstacle in model.obstacles if obstacle.contact]
    radius, start, bounds = float(model.swarm.radius[0]), model.swarm.position[0].copy(), model.map.bounds
    watched = model.watch(last=None, columns=("position",))
    model.run(steps)
    shares = {
        name: coverage(watched["position"], reachable_cells(bounds, solids, radius, start, parts), bounds)
        for name, parts in (("areas", AREAS), ("coverage", CELLS))
    }
    return {**shares, "collisions": float(model.total_collisions)}


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
EXPLORING_SEEDS = 40
EXPLORING_STEPS = 60_000
# More would make the picture black.
TRACED_STEPS = 20_000
# Nearly all: the rest is a cell that is entered only just.
NEARLY_ALL = 0.95
GATHERING = "AGENT9, sight 50, stop_distance 12, avoid_distance 4, map openspace, 50 robots"
CHAINING = "AGENT3, sight 50, gap 15, cruise speed 0.7, map openspace, 50 robots"


def exploration(laboratory: Laboratory) -> Result:
    """Make figure 5.5: the trace of one robot."""
    steps, seeds = laboratory.pick(EXPLORING_STEPS, 3_000), laboratory.fresh_seeds(EXPLORING_SEEDS)
    three, nine = ({"design": design, **NOISE} for design in ("AGENT3", "AGENT9"))
    points: list[dict[str, Any]] = [three, nine, {"design": "AGENT3"}, {**three, "turn_interval": 200}]
    rows = laboratory.grid(exploration_run, [{**point, "steps": steps} for point in points], seeds)
    model = find_model("collision_avoidance")(rng=1, n_robots=1, map="original", **three)
    return Result(
        checks=(*reach_checks("AGENT3", rows[0]), *reach_checks("AGENT9", rows[1], main=False), *noise_checks(*rows)),
        pictures={"": trace(model, laboratory.pick(TRACED_STEPS, 3_000))},
        settings=(
            f"map original, {steps:,} steps, speed 1, distance 15, translational turns; wheels slip by half and "
            "sensors err by a fifth with probability 0.1; an area is one of 48 squares of 100 x 100, which a robot "
            "with a sight of 50 overlooks from its middle; a cell is one of 40 x 40; both count where the "
            "robot's centre can be"
        ),
        remarks=(
            "The section has one trace and no number. Earlier this item judged a robot that was built for it (WIDE3, "
            "wide sensors, speed 4), which had no collisions; here the plain robots are judged, with the noise that "
            "makes them leave closed orbits. Then their mean of collisions was to be 0, which no number of runs can "
            "show; now most runs are to be without.",
        ),
    )


def reach_checks(design: str, rows: list[dict], *, main: bool = True) -> list[Check]:
    """Return the checks of how much of the map a robot of this design reaches."""
    return [
        judged_share(
            f"one robot reaches all areas of the map, in most runs ({design})",
            "trace through all areas (one run)",
            [share == 1.0 for share in column(rows, "areas")],
            low=0.5,
            main=main,
        ),
        judged_mean(
            f"share of areas, mean over runs ({design})", "all", column(rows, "areas"), low=NEARLY_ALL, main=False
        ),
        judged_mean(
            f"share of cells, mean over runs ({design})", "all", column(rows, "coverage"), low=NEARLY_ALL, main=False
        ),
        no_collisions(f"it has no collisions, in most runs ({design})", rows, main=main),
    ]


def no_collisions(claim: str, rows: list[dict], *, main: bool = False) -> Check:
    """Return the check that most runs of a robot are without collisions."""
    return judged_share(
        claim, "no collisions (one run)", [n == 0 for n in column(rows, "collisions")], low=0.5, main=main
    )


def noise_checks(noisy: list[dict], _: list[dict], plain: list[dict], turning: list[dict]) -> list[Check]:
    """Return the checks of what noise and random turns do to a robot with three sensors."""

    def more(claim: str, reported: str, few: list[dict], many: list[dict]) -> Check:
        return judged_measure(claim, reported, "coverage", {"without": few, "with": many}, main=False)

    return [
        more("with noise it reaches more cells than without", "artefact of noise-free runs", plain, noisy),
        more("with random turns it reaches more cells", "proposed (5.3.1)", noisy, turning),
        no_collisions("without noise it has no collisions, in most runs (AGENT3)", plain),
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
        {"robots per group at 1,000": column(rows, f"size at {EARLY}"), "at 3,000": column(rows, f"size at {LATE}")},
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


def gathering_picture(step: int, **settings: Any) -> Figure:
    """Return a picture of agglomerating robots at a step, with lines to what each robot perceives."""
    model = find_model("agglomeration")(rng=1, **settings).run(step)
    return world_picture(model, f"Agglomeration, step {model.steps:,}", perceived=True)


def chains_early(laboratory: Laboratory) -> Result:
    """Make figure 5.9: chains have formed, and hold more robots together than clusters do."""
    seeds = laboratory.fresh_seeds(SEEDS)
    rows, groups = laboratory.runs(chain_run, seeds), laboratory.runs(agglomeration_run, seeds)
    checks = (
        judged_mean("most robots are in chains", "chains in the picture", column(rows, f"chained at {EARLY}"), low=0.5),
        *(check for link in LINKS for check in cohesion_checks(groups, rows, link)),
        judged_measure(
            "grouped pairs stay in one group: share that still are 200 steps later",
            "higher cohesion",
            f"kept together at {LATE}",
            {"clusters": groups, "chains": rows},
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

    def judged(claim: str, name: str, *, fewer: bool = False) -> Check:
        sides = {"chains": rows, "clusters": groups} if fewer else {"clusters": groups, "chains": rows}
        measure, claim = f"{name} at {LATE}, {link:g}", f"{claim}, links of {link:g}"
        return judged_measure(claim, "higher cohesion", measure, sides, main=link == GROUP)

    return [
        judged("a robot's own group is larger in chains", "own group"),
        judged("the largest group is larger", "largest"),
        judged("there are fewer groups", "groups", fewer=True),
    ]


def chains_late(laboratory: Laboratory) -> Result:
    """Make figure 5.10: chains have merged, and what their two rules do."""
    seeds = laboratory.fresh_seeds(SEEDS)
    rows, loose = laboratory.grid(chain_run, [{}, {"gap_rule": "off"}], seeds)
    merging = judged_difference(
        "chains go on merging",
        "longer later",
        {
            "robots per chain at 1,000": column(rows, f"length at {EARLY}"),
            "at 3,000": column(rows, f"length at {LATE}"),
        },
    )
    hurrying = judged_measure(
        "the gap rule makes chains longer",
        "without it chains break",
        f"length at {LATE}",
        {"without": loose, "with": rows},
        main=False,
    )
    return Result(
        checks=(merging, hurrying, parting_check(rows)),
        pictures={"": chain_picture(laboratory.pick(LATE, 200))},
        settings=CHAINING,
    )


def parting_check(rows: list[dict]) -> Check:
    """Return the check of chains that meet head-on and disperse."""
    return judged_mean(
        "head-on pairs approach, then disperse: share of meetings",
        "seen",
        column(rows, "share dispersed"),
        low=0.25,
        main=False,
    )


MOVING_SEEDS = 60
# More of robots that meet head-on: that a rule changes nothing takes many runs.
HEAD_ON_SEEDS = 120
NUMBER_RULE, OUR_RULE = "a communicated number", "only robots without followers turn round"
# How much shorter chains may be by a rule that should not shorten them: a tenth.
TENTH = 0.1


def head_on(laboratory: Laboratory) -> Result:
    """Judge the two proposals for robots that meet head-on, and our own (5.2.3.2, 5.3.3, 10.2)."""
    points = [{}, {"head_on": "on"}, {"head_on": "number"}, {"head_on": "chain"}]
    without, speed, number, chain = laboratory.grid(chain_run, points, laboratory.fresh_seeds(HEAD_ON_SEEDS))
    return Result(
        checks=(
            *turning_checks("random turning speeds", without, speed),
            *turning_checks(NUMBER_RULE, without, number),
            *turning_checks(OUR_RULE, without, chain),
            longer("chains are longer by number than by speed", {"by speed": speed, "by number": number}),
        ),
        pictures={"": chain_picture(2_000, head_on="number")},
        settings=(
            f"{CHAINING}; HeadOn() by speed, HeadOn(leader='number') by number, HeadOn(leader='chain') by chain, as "
            "chosen on seeds from 10,000 on; lengths are means over the 200 steps before step 3,000"
        ),
        remarks=(
            "By speed both robots turn round, the leader of a chain towards its own followers. By number a robot that "
            "is followed does not turn round: one that none follows does, and becomes the head of its chain. By chain "
            "nothing else happens, and robots that none follows do not wait for each other: our own rule, chosen "
            "among eight on seeds from 10,200 on. The first 60 seeds of the other two were judged before, with the same"
            " criteria.",
        ),
    )


def turning_checks(rule: str, without: list[dict], ruled: list[dict]) -> list[Check]:
    """Return the checks of one rule against none."""
    length = f"length at {LATE}"
    ratio = [one / other for one, other in zip(column(ruled, length), column(without, length), strict=True)]
    proposed = "not proposed" if rule == OUR_RULE else "proposed (10.2)"
    return [
        judged_measure(
            f"{rule}: fewer meetings disperse", proposed, "share dispersed", {"with": ruled, "without": without},
            main=rule != OUR_RULE,
        ),
        judged_mean(
            f"{rule}: chains are at most a tenth shorter, length relative to none", "implied", ratio, low=1.0 - TENTH,
            main=rule == NUMBER_RULE,
        ),
        longer(f"{rule}: chains are longer", {"without": without, "with": ruled}),
    ]  # fmt: skip


def longer(claim: str, sides: dict[str, list[dict]]) -> Check:
    """Judge whether chains are longer in the second of two sets of runs."""
    return judged_measure(claim, "hoped for", f"length at {LATE}", sides, main=False)


# The ways in which groups move.
MOVING = {
    "lead": "a leader of the lowest rank",
    "match": "velocity matching",
    "together": "all together",
    "together by chain": "all together, head-on by chain",
}


def moving_groups(laboratory: Laboratory) -> Result:
    """Judge whether groups that move lead to fewer and larger groups (5.3.2, 5.3.4, 10.2)."""
    points = [{"moving": how} for how in ("off", *MOVING)]
    still, *moved = laboratory.grid(agglomeration_run, points, laboratory.fresh_seeds(MOVING_SEEDS))
    of = dict(zip(MOVING, moved, strict=True))
    return Result(
        checks=tuple(check for how in MOVING for check in moving_checks(how, still, of[how])),
        pictures={"": gathering_picture(laboratory.pick(LATE, 200), moving="lead")},
        settings=(
            f"{GATHERING}; groups are of robots that links of {GROUP:g} join, at step 3,000; Lead(speed=0.3) with a "
            "radio of range 100, MatchVelocity() above Gather; together: these two and HeadOn by number or by chain; "
            "settings chosen on seeds from 10,000 on"
        ),
        remarks=(
            "Global agglomeration would be one group of 50: "
            + "; ".join(
                f"with {MOVING[how]} the largest group has "
                f"{mean_interval(column(of[how], f'largest at {LATE}, {GROUP:g}')).estimate:.1f}"
                for how in MOVING
            )
            + " robots.",
        ),
    )


def moving_checks(how: str, still: list[dict], moved: list[dict]) -> list[Check]:
    """Return the checks of one way in which groups move, against groups that stay; a leader's are the main ones."""
    reported, stay = "not proposed" if how == "together by chain" else "proposed", "groups that stay"

    def judged(claim: str, name: str, *, fewer: bool = False) -> Check:
        sides = {how: moved, stay: still} if fewer else {stay: still, how: moved}
        measure = f"{name} at {LATE}, {GROUP:g}"
        return judged_measure(f"{MOVING[how]}: {claim}", reported, measure, sides, main=how == "lead")

    return [
        judged("a robot's own group is larger", "own group"),
        judged("the largest group is larger", "largest"),
        judged("there are fewer groups", "groups", fewer=True),
    ]


def chain_picture(step: int, **settings: Any) -> Figure:
    """Return a picture of robots in chains at a step."""
    model = find_model("chain_formation")(rng=1, **settings).run(step)
    return world_picture(model, f"Chain formation, step {model.steps:,}")


ITEMS = (
    Item(figure="5.5", title="trace of one exploring robot", section="5.3.1", make=exploration),
    Item(figure="5.6", title="agglomeration at the start", section="5.3.2", make=gathering_start),
    Item(figure="5.7", title="agglomeration after 1,000 steps", section="5.3.2", make=gathering_early),
    Item(figure="5.8", title="agglomeration after 3,000 steps", section="5.3.2", make=gathering_late),
    Item(figure="5.9", title="chains have formed", section="5.3.3", make=chains_early),
    Item(figure="5.10", title="merged chains, and the effect of their rules", section="5.3.3", make=chains_late),
    Item(figure="5.3.4", title="groups that move", section="5.3.2, 5.3.4, 10.2", make=moving_groups),
    Item(figure="10.2", title="robots that meet head-on", section="5.2.3.2, 5.3.3, 10.2", make=head_on),
)
