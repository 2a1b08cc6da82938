"""Published results, each reproduced by a model of the gallery: division of labour, decisions, trails."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.gallery import find_model
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, count_steps, draw_means, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_difference, judged_mean, judged_measure, judged_share
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

Numbers = dict[str, float | None]
SEEDS = 30

# Task allocation: steps after which what is collected counts, of each half of a run.
SETTLING, HALF_RUN = 500, 1_500
DEMANDS = (0.5, 1.0, 1.5, 2.0)
MAJOR_SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)
EFFICIENCY, QUITTING, THRESHOLDS = 3.0, 0.2, {"minors": 1.0, "majors": 8.0}


def allocation_run(rng: int, *, half: int = HALF_RUN, later: float | None = None, **settings: Any) -> Numbers:
    """Return the shares of robots at work in both halves of a run, for the second of which the demand may change."""
    model = find_model("task_allocation")(rng=rng, **settings).run(half)
    if later is not None:
        model.task.demand = later
    collected = model.run(half).datacollector.model_vars
    halves = {"before": slice(min(SETTLING, half // 2), half), "after": slice(half + min(SETTLING, half // 2), None)}
    return {
        f"{name}{when}": mean_of(collected[f"active{name}"][steps])
        for name in ("", "_minors", "_majors")
        for when, steps in halves.items()
    }


def mean_of(values: list) -> float | None:
    """Return the mean of collected values, None if they are unknown."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def equilibrium(demand: float, major_share: float) -> dict[str, float]:
    """Return the shares of minors and majors at work where the paper's equations do not change: by bisection of s."""
    parts = {"minors": 1.0 - major_share, "majors": major_share}
    low, high = 0.0, 1e3
    for _ in range(100):
        stimulus = (low + high) / 2.0
        shares = {name: at_work(stimulus, threshold) for name, threshold in THRESHOLDS.items()}
        enough = sum(parts[name] * share for name, share in shares.items()) >= demand / EFFICIENCY
        low, high = (low, stimulus) if enough else (stimulus, high)
    return shares


def at_work(stimulus: float, threshold: float) -> float:
    """Return the share of robots of a threshold at work at a constant stimulus: rate of beginning over both rates."""
    response = stimulus**2 / (stimulus**2 + threshold**2)
    return response / (response + QUITTING)


def allocation(laboratory: Laboratory) -> Result:
    """Reproduce the fixed threshold model: the share at work follows the demand, and castes replace each other."""
    half, seeds = laboratory.pick(HALF_RUN, 100), laboratory.seeds(SEEDS)
    points: list[dict[str, Any]] = [{"demand": demand} for demand in DEMANDS]
    points += [{"major_share": share} for share in MAJOR_SHARES]
    points += [{"demand": 0.5, "later": 1.0}]
    rows = laboratory.grid(allocation_run, [{**point, "half": half} for point in points], seeds)
    by_demand, by_share, changed = rows[: len(DEMANDS)], rows[len(DEMANDS) : -1], rows[-1]
    return Result(
        checks=(*demand_checks(by_demand, changed), *caste_checks(by_share)),
        pictures={"": caste_figure(by_share)},
        settings=(
            "50 robots, thresholds 1 (minors) and 8 (majors), efficiency 3, quitting 0.2, 20 steps a time unit; "
            "demand 1 and equal parts of both castes unless stated; two halves of "
            f"{HALF_RUN:,} steps, of each of which the first {SETTLING} do not count"
        ),
        remarks=(
            "That the mean share at work is demand divided by efficiency holds for any colony whose stimulus stays "
            "bounded; what the robots add is that it does.",
            "The equations of the paper have no noise; 50 robots respond at random, and their activity is close to, "
            "but not exactly, that of the equations.",
        ),
    )


def demand_checks(by_demand: list[list[dict]], changed: list[dict]) -> list[Check]:
    """Return the checks of the share at work."""
    follows = [
        judged_mean(
            f"the share at work is demand / efficiency: demand {demand:g}",
            f"{demand / EFFICIENCY:.3f}",
            column(rows, "after"),
            low=demand / EFFICIENCY - 0.02,
            high=demand / EFFICIENCY + 0.02,
        )
        for demand, rows in zip(DEMANDS, by_demand, strict=True)
    ]
    rise = judged_mean(
        "it follows the demand during a run: share at work after demand has risen from 0.5 to 1",
        f"{1 / EFFICIENCY:.3f}",
        column(changed, "after"),
        low=1 / EFFICIENCY - 0.02,
        high=1 / EFFICIENCY + 0.02,
    )
    return [*follows, rise]


def caste_checks(by_share: list[list[dict]]) -> list[Check]:
    """Return the checks of what minors and majors do, over the share of majors."""
    few, equal, many = by_share[0], by_share[len(by_share) // 2], by_share[-1]
    theory = [equilibrium(1.0, share)["majors"] for share in MAJOR_SHARES]
    return [
        judged_difference(
            "minors work more than majors where there are as many of each",
            "specialists",
            {"majors": column(equal, "_majorsafter"), "minors": column(equal, "_minorsafter")},
        ),
        judged_measure(
            "majors work more where minors are few (Wilson's removal of minors)",
            "majors take over",
            "_majorsafter",
            {"10 % majors": few, "90 % majors": many},
        ),
        *(
            judged_mean(
                f"share of majors at work is that of the equations: {share:.0%} majors",
                f"{value:.3f}",
                column(rows, "_majorsafter"),
                low=value - 0.05,
                high=value + 0.05,
                main=False,
            )
            for share, value, rows in zip(MAJOR_SHARES, theory, by_share, strict=True)
        ),
    ]


def caste_figure(by_share: list[list[dict]]) -> Figure:
    """Return a figure of the activity of both castes over the share of majors, with that of the equations."""
    figure, axes = plain_axes("share of majors", "share at work")
    fine = np.linspace(0.02, 0.98, 97)
    theory = [equilibrium(1.0, share) for share in fine]
    for i, caste in enumerate(THRESHOLDS):
        draw_means(axes, MAJOR_SHARES, [column(rows, f"_{caste}after") for rows in by_share], caste, i)
        axes.plot(fine, [shares[caste] for shares in theory], color=LIGHT.soft, linewidth=1.0, zorder=0)
    draw_means(axes, MAJOR_SHARES, [column(rows, "after") for rows in by_share], "all robots", 2)
    axes.plot([], [], color=LIGHT.soft, linewidth=1.0, label="equations")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return figure


# Best of n: steps after which robots that still differ do not agree, and the shares for the better site at first.
LONGEST = 30_000
EVEN, FEW_RIGHT = 0.5, 0.35


def decision_run(rng: int, *, steps: int = LONGEST, **settings: Any) -> Numbers:
    """Return when all robots had one opinion, the number of steps if they never had, and whether it was right."""
    model = find_model("best_of_n")(rng=rng, **settings).run(steps)
    return {
        "agreed": float(model.agreed_at is not None),
        "steps": float(model.agreed_at or steps),
        "right": float(model.for_left == 1.0),
    }


def decision(laboratory: Laboratory) -> Result:
    """Reproduce the trade-off between speed and accuracy of the majority rule and the voter model."""
    steps, seeds = laboratory.pick(LONGEST, 500), laboratory.seeds(SEEDS)
    points = [(rule, share) for share in (EVEN, FEW_RIGHT) for rule in ("voter", "majority")]
    rows = laboratory.grid(
        decision_run, [{"rule": rule, "first_share": share, "steps": steps} for rule, share in points], seeds
    )
    made = dict(zip(points, rows, strict=True))
    return Result(
        checks=(*speed_checks(made), *accuracy_checks(made)),
        pictures={"": decision_figure(made)},
        settings=(
            f"40 robots, qualities 1 and 0.8, mean times of exploring 50 and of advertising 200 steps, range 60; at "
            f"first {EVEN:.0%} or {FEW_RIGHT:.0%} of the robots are for the better site; {SEEDS} seeds, at "
            f"most {LONGEST:,} steps"
        ),
        remarks=(
            "The paper's Kilobots hear robots within 10 to 20 cm and pool what they heard for some time; here a robot "
            "decides by the robots that it hears in one step.",
            "Accuracy is judged mainly at 35% right at first, chosen in trials because both rules hardly err with "
            "equal numbers; there the majority rule mostly settles on the opinion with which most robots begin.",
        ),
    )


def speed_checks(made: dict[tuple, list[dict]]) -> list[Check]:
    """Return the checks of how long a decision takes."""
    agreed = [
        judged_share(
            f"all robots agree within {LONGEST:,} steps: {rule} rule, {share:.0%} right at first",
            "consensus",
            [row["agreed"] == 1.0 for row in rows],
            low=0.8,
            main=share == EVEN,
        )
        for (rule, share), rows in made.items()
    ]
    faster = judged_measure(
        "the majority rule is faster: steps until all agree, 50% right at first",
        "considerable speed-up",
        "steps",
        {"majority": made["majority", EVEN], "voter": made["voter", EVEN]},
    )
    return [*agreed, faster]


def accuracy_checks(made: dict[tuple, list[dict]]) -> list[Check]:
    """Return the checks of whether the better site is chosen."""
    better = [
        judged_share(
            f"most swarms choose the better site, 50% right at first: {rule} rule",
            "yes",
            [row["right"] == 1.0 for row in made[rule, EVEN]],
            low=0.5,
        )
        for rule in ("voter", "majority")
    ]
    accurate = [
        judged_measure(
            f"the voter model is more accurate: share of right decisions, {share:.0%} right at first",
            "lower accuracy of the majority rule",
            "right",
            {"majority": made["majority", share], "voter": made["voter", share]},
            main=share == FEW_RIGHT,
        )
        for share in (FEW_RIGHT, EVEN)
    ]
    return [*better, *accurate]


def decision_figure(made: dict[tuple, list[dict]]) -> Figure:
    """Return a figure of the share of swarms that have agreed on each site over time."""
    figure, axes = plain_axes("step", f"share of swarms, {FEW_RIGHT:.0%} right at first")
    for i, rule in enumerate(("voter", "majority")):
        rows = made[rule, FEW_RIGHT]
        for right, style in ((1.0, "-"), (0.0, "--")):
            times = sorted(row["steps"] for row in rows if row["agreed"] and row["right"] == right)
            shares = np.arange(len(times) + 1) / len(rows)
            label = f"{rule}, {'better' if right else 'worse'} site"
            axes.step([0.0, *times], shares, style, where="post", color=LIGHT.series[i], label=label)
    axes.set_ylim(-0.02, 1.02)
    count_steps(axes)
    axes.legend(frameon=False)
    return figure


ITEMS: tuple[Item, ...] = (
    Item(
        figure="task_allocation",
        title="response thresholds divide labour",
        section="Bonabeau et al. 1996",
        make=allocation,
        paper=(
            "E. Bonabeau, G. Theraulaz and J.-L. Deneubourg, Quantitative study of the fixed threshold model for the "
            "regulation of division of labour in insect societies, Proceedings of the Royal Society B 263 (1996) "
            "1565-1569."
        ),
        about=(
            "In the paper workers of two castes respond to the stimulus of one task above thresholds that differ. The "
            "share of workers that are active settles where their work balances the demand; majors, of the high "
            "threshold, are active only where minors are few, as E. O. Wilson found in ants of the genus Pheidole. In "
            "the model `task_allocation` robots take the place of workers. They perceive the same stimulus everywhere, "
            "as in the paper, through a custom sensor; a custom actuator is their work, a process the stimulus."
        ),
    ),
    Item(
        figure="best_of_n",
        title="majority rule is faster, voter model more accurate",
        section="Valentini et al. 2016",
        make=decision,
        paper=(
            "G. Valentini, E. Ferrante, H. Hamann and M. Dorigo, Collective decision with 100 Kilobots: speed versus "
            "accuracy in binary discrimination problems, Autonomous Agents and Multi-Agent Systems 30 (2016) 553-580; "
            "the voter model: G. Valentini, H. Hamann and M. Dorigo, Self-organized collective decision making: the "
            "weighted voter model, AAMAS 2014, 45-52."
        ),
        about=(
            "In the papers robots explore one of two sites, return to the nest, and broadcast their opinion for a "
            "random time that is proportional to the quality that they measured; then each takes the opinion of a "
            "random neighbour (voter) or of most of its neighbours (majority). The majority rule decides sooner, the "
            "voter model more often for the better site. In the model `best_of_n` a custom sensor reads the bearing of "
            "a light, the place and its quality; opinions are custom messages, states are the memory of one rule."
        ),
    ),
)
