"""Figures 5.5 to 5.10: one robot that explores, robots that gather, robots that make chains."""

from matplotlib.figure import Figure

from mesa_swarm.experiments.run_pictures import trace
from mesa_swarm.gallery import find_model
from mesa_swarm.reproduction.drawing import column, world_picture
from mesa_swarm.reproduction.judging import judged_difference, judged_mean, judged_share
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.registry import Item
from mesa_swarm.reproduction.result import Check, Result
from mesa_swarm.reproduction.swarm_runs import (
    EARLY,
    EXPLORER,
    LATE,
    agglomeration_run,
    chain_run,
    exploration_run,
)

SEEDS = 40
EXPLORING_SEEDS = 12
EXPLORING_STEPS = 60_000
# More would make the picture black.
TRACED_STEPS = 20_000
# Nearly all: the rest is a cell that is entered only just.
NEARLY_ALL = 0.95
# The robot of the other figures, which falls into an orbit.
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
            "A robot sees nearly everything if it sees all that is ahead, turns on the spot before it would touch "
            "something, and has way enough. A plain one falls into an orbit.",
        ),
    )


def explorer_checks(rows: list[dict]) -> list[Check]:
    """Return what is claimed of the one robot."""
    return [
        judged_share(
            "one robot reaches all areas of the map (95 % of the cells), in most runs",
            "trace through all areas (one run)",
            [share >= NEARLY_ALL for share in column(rows, "coverage")],
            low=0.5,
        ),
        judged_mean("in the mean of runs it does", "one run", column(rows, "coverage"), low=NEARLY_ALL, main=False),
        judged_mean("it collides with nothing", "no collisions", column(rows, "collisions"), high=0),
    ]


def plain_robot_checks(slow: list[dict], turning: list[dict]) -> list[Check]:
    """Return whether a robot like those of the other figures reaches as much, without and with random turns."""
    return [
        judged_mean(
            "so does a plain robot (AGENT9, speed 1, distance 15)",
            "trace through all areas",
            column(slow, "coverage"),
            low=NEARLY_ALL,
            main=False,
        ),
        judged_difference(
            "random turns let a plain robot reach more",
            "proposed (5.3.1)",
            column(slow, "coverage"),
            column(turning, "coverage"),
            names=("without", "with"),
            main=False,
        ),
    ]


def gathering_start(laboratory: Laboratory) -> Result:
    """Make figure 5.6: fifty robots at random."""
    rows = laboratory.runs(agglomeration_run, laboratory.seeds(SEEDS))
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
    rows = laboratory.runs(agglomeration_run, laboratory.seeds(SEEDS))
    return Result(
        checks=tuple(gathering_checks(rows, EARLY)),
        pictures={"": gathering_picture(laboratory.pick(EARLY, 100))},
        settings=GATHERING,
    )


def gathering_late(laboratory: Laboratory) -> Result:
    """Make figure 5.8: the same after 3,000 steps."""
    rows = laboratory.runs(agglomeration_run, laboratory.seeds(SEEDS))
    merging = judged_difference(
        "groups go on merging",
        "fewer, larger groups at 3,000",
        column(rows, f"size at {EARLY}"),
        column(rows, f"size at {LATE}"),
        names=("robots a group at 1,000", "at 3,000"),
        main=False,
    )
    return Result(
        checks=(*gathering_checks(rows, LATE), merging),
        pictures={"": gathering_picture(laboratory.pick(LATE, 200))},
        settings=GATHERING,
    )


def gathering_checks(rows: list[dict], step: int) -> list[Check]:
    """Return what is claimed of the groups at a step."""
    return [
        judged_mean(
            "robots agglomerate: mean distance to the nearest, of what it was at the start",
            "groups in the picture",
            column(rows, f"spacing at {step}"),
            high=0.5,
        ),
        judged_share(
            "there are many groups, never one (local convergence)",
            "many groups",
            [groups > 1 for groups in column(rows, f"groups at {step}")],
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
    """Return a picture of agglomerating robots at a step, with lines to what each perceives."""
    model = find_model("agglomeration")(rng=1).run(step)
    return world_picture(model, f"Agglomeration, step {model.steps:,}", perceived=True)


def chains_early(laboratory: Laboratory) -> Result:
    """Make figure 5.9: chains have formed."""
    seeds = laboratory.seeds(SEEDS)
    rows, groups = laboratory.runs(chain_run, seeds), laboratory.runs(agglomeration_run, seeds)
    checks = (
        judged_mean("most robots are in chains", "chains in the picture", column(rows, f"chained at {EARLY}"), low=0.5),
        judged_difference(
            "chains have a higher cohesion than clusters: pairs in a group that are in one 200 steps later",
            "higher",
            column(groups, f"kept together at {LATE}"),
            column(rows, f"kept together at {LATE}"),
            names=("clusters", "chains"),
        ),
        judged_mean("chains merge, times a run", "seen", column(rows, "merges"), low=1, main=False),
        judged_mean("chains split, times a run", "seen", column(rows, "splits"), low=1, main=False),
    )
    return Result(
        checks=checks,
        pictures={"": chain_picture(laboratory.pick(EARLY, 100))},
        settings=CHAINING,
        remarks=(
            "Clusters that have come to rest hold together by standing still. Cohesion may be meant as keeping "
            "together while moving, which clusters never have to.",
        ),
    )


def chains_late(laboratory: Laboratory) -> Result:
    """Make figure 5.10: chains have merged, and what their two rules do."""
    seeds = laboratory.seeds(SEEDS)
    rows, loose, leading = laboratory.grid(chain_run, [{}, {"gap_rule": "off"}, {"head_on": "on"}], seeds)
    merging = judged_difference(
        "chains go on merging",
        "longer later",
        column(rows, f"length at {EARLY}"),
        column(rows, f"length at {LATE}"),
        names=("robots a chain at 1,000", "at 3,000"),
    )
    hurrying = judged_difference(
        "the rule that followers hurry makes chains longer",
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
    """Return what is claimed of chains that meet head-on, without and with the rule that one of them leads."""
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
            "that rule makes chains longer",
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
    Item(figure="5.10", title="chains have merged, and what their rules do", section="5.3.3", make=chains_late),
)
