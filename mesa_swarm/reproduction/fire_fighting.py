"""Figures 9.1 to 9.3: fires and their rules, strategies A and B, and where A wins."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.experiments.figures import fires_figure
from mesa_swarm.experiments.portrait import portrait_of
from mesa_swarm.experiments.statistics import bootstrap_mean
from mesa_swarm.experiments.tables import in_words
from mesa_swarm.fire.burning import is_hot, next_temperature
from mesa_swarm.fire.constants import design_constants, robots_needed
from mesa_swarm.reproduction.drawing import column, world_picture
from mesa_swarm.reproduction.fire_runs import LARGEST, MOST_STEPS, fire_model, fire_run
from mesa_swarm.reproduction.judging import judged_difference, judged_fact, judged_mean, judged_share
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.registry import Item
from mesa_swarm.reproduction.result import Check, Result
from mesa_swarm.reproduction.strategy_map import (
    REST,
    Cell,
    cells_figure,
    compared,
    winners_in_words,
)

PAIRS = 200
FIRES = 7
FIGHTING = (
    "map openspace_fire, AGENT_FIRE, 10 robots, the default constants (growth 2,000 steps, two robots put the largest "
    "fire out in 1,600, stay 100, rest 60), at most 15,000 steps; the thesis gives no constants and no number of robots"
)


def fires(laboratory: Laboratory) -> Result:
    """Make figure 9.1: fires as they are drawn, and the requirements that their rules meet (9.2)."""
    model = fire_model(1, "B").run(laboratory.pick(600, 60))
    area = model.fires.area
    drawn = model.fires.radius**2 / area
    checks = (
        judged_fact(
            "the drawn area is proportional to the fire's",
            "proportional",
            bool(np.ptp(drawn) < 1e-9),
            measured=f"radius^2 / area {drawn.min():g} at each",
        ),
        *requirements(),
    )
    title = f"Fire-fighting, strategy B, step {model.steps}: black to red is T, pale is out"
    return Result(checks=checks, pictures={"": world_picture(model, title)}, settings=FIGHTING)


def requirements() -> list[Check]:
    """Return whether the rules of fires meet the thesis's requirements, each tried on its own."""
    chosen = design_constants()
    k = (chosen.k1, chosen.k2, chosen.k3, chosen.k4, chosen.leave, chosen.join)
    needed = [robots_needed(chosen, area, t) for area, t in ((4, 0.5), (16, 0.5), (16, 1.0))]
    fall = [0.5 - next_temperature(0.5, 4.0, n, k) for n in range(4)]
    steps = {
        "effort depends on T and area (robots needed at area 4 and T 0.5, 16 and 0.5, 16 and 1)": (
            needed[0] < needed[1] < needed[2],
            ", ".join(f"{n:.2f}" for n in needed),
        ),
        "a fire left alone grows with time": (next_temperature(0.5, 4.0, 0, k) > 0.5, f"{-fall[0]:+.5f} a step"),
        "there is a terminal temperature": (next_temperature(1.0, 4.0, 0, k) == 1.0, "1"),
        "capacity is additive in robots, each at a constant rate": (
            bool(np.allclose(np.diff(fall), k[1] / 4.0)),
            f"{np.diff(fall)[0]:.5f} a robot and step",
        ),
        "a robot too hot leaves, and may return only when it has cooled": (
            is_hot(k[4], False, k) and is_hot((k[4] + k[5]) / 2, True, k) and not is_hot(k[5], True, k),
            f"hot at {k[4]:g}, until {k[5]:g}",
        ),
        "a robot cools at a constant rate": (k[3] > 0, f"{k[3]:g} a step"),
        "only robots near enough to extinguish take heat": heat_is_near(),
    }
    return [judged_fact(claim, "required (9.2)", held, measured=what) for claim, (held, what) in steps.items()]


def heat_is_near() -> tuple[bool, str]:
    """Return whether in a run only robots within reach of a fire took heat, and how many robot-steps were looked at."""
    model, wrong, seen = fire_model(1, "B"), 0, 0
    reach = 10.0
    for _ in range(300):
        before = ~model.fires.out
        model.step()
        gap = np.linalg.norm(model.swarm.position[:, None] - model.fires.position[None], axis=2)
        gap = np.where(before, gap - model.fires.radius - model.swarm.radius[:, None], np.inf).min(axis=1)
        wrong += int(np.count_nonzero((model.swarm.columns["heat"] > 0) & (gap > reach + 1e-9)))
        seen += len(gap)
    return wrong == 0, f"{wrong} of {seen:,} robot-steps otherwise"


def paired_runs(laboratory: Laboratory) -> tuple[list[dict], list[dict]]:
    """Return the paired runs of A and of B that two figures share."""
    steps = laboratory.pick(MOST_STEPS, 4_000)
    points = [{"strategy": strategy, "steps": steps} for strategy in "AB"]
    first, second = laboratory.grid(fire_run, points, laboratory.seeds(PAIRS, quick=6))
    return first, second


def strategy_a(laboratory: Laboratory) -> Result:
    """Make figure 9.2: robots at each fire under A."""
    leaving, _ = paired_runs(laboratory)
    most = column(leaving, "most at the largest")
    checks = (
        judged_share(
            "A leaves the large central fire burning",
            "left burning (one run)",
            [not out for out in column(leaving, "largest out")],
            low=0.8,
        ),
        judged_mean("A puts out most others: of 6", "the others out (one run)", column(leaving, "others out"), low=5.0),
        judged_share(
            "never more than one robot is at the large fire",
            "never more than one",
            [count <= 1 for count in most],
            low=0.8,
            main=False,
        ),
        judged_mean(
            "share of the time in which two or more are there",
            "0",
            column(leaving, "together at the largest"),
            high=0.05,
            main=False,
        ),
    )
    return Result(
        checks=checks,
        pictures={"": history_figure(laboratory, "A")},
        settings=f"{FIGHTING}; {len(leaving)} seeds",
        remarks=(f"At most {max(most)} robots were at the large fire at once in any of the runs.",),
    )


def strategy_b(laboratory: Laboratory) -> Result:
    """Make figure 9.3: robots at each fire under B, and how both compare around there."""
    leaving, waiting = paired_runs(laboratory)
    cells = compared(laboratory)
    checks = (
        judged_share(
            "B puts out all seven fires",
            "all out (one run)",
            [out == FIRES for out in column(waiting, "out")],
            low=0.9,
        ),
        judged_difference(
            "B puts out more fires than A",
            "7 against 6 (one run each)",
            column(leaving, "out"),
            column(waiting, "out"),
            names=("A", "B"),
        ),
        judged_share(
            "robots meet at the large fire: two or more at once",
            "implicit cooperation",
            [count >= 2 for count in column(waiting, "most at the largest")],
            low=0.9,
        ),
        everywhere("B is at least as good with 5 to 50 robots", cells, lambda c: c.size == 1.0 and c.rest == REST),
        everywhere("B is at least as good with every size of fires and rest time", cells, lambda c: True),
    )
    return Result(
        checks=checks,
        pictures={"": history_figure(laboratory, "B"), "where": cells_figure(cells)},
        settings=f"{FIGHTING}; {len(waiting)} paired seeds",
        remarks=(paired_in_words(leaving, waiting), *winners_in_words(cells)),
    )


def everywhere(claim: str, cells: list[Cell], wanted: Callable[[Cell], bool]) -> Check:
    """Judge whether A is clearly better in none of the cells that are wanted."""
    chosen = [cell for cell in cells if wanted(cell)]
    count = {side: sum(cell.winner == side for cell in chosen) for side in ("A", "B", "")}
    return judged_fact(
        claim,
        "not looked at",
        count["A"] == 0,
        measured=f"A better in {count['A']}, B in {count['B']}, neither clearly in {count['']} of {len(chosen)} cells",
        criterion="A clearly better in no cell",
        main=False,
    )


def paired_in_words(leaving: list[dict], waiting: list[dict]) -> str:
    """Say what paired runs say of one run each."""
    more = sum(b > a for a, b in zip(column(leaving, "out"), column(waiting, "out"), strict=True))
    fewer = sum(b < a for a, b in zip(column(leaving, "out"), column(waiting, "out"), strict=True))
    times = [time for time in column(waiting, "all out at") if time is not None]
    large = sum(column(leaving, "largest out"))
    quick = in_words(bootstrap_mean(times)) if times else "-"
    return (
        f"Of {len(leaving)} pairs B put out more fires in {more} and fewer in {fewer}. A put out the large fire in "
        f"{large} of {len(leaving)} runs. B was done after {quick} steps, in {len(times)} runs."
    )


def history_figure(laboratory: Laboratory, strategy: str) -> Figure:
    """Return a figure of the robots at each fire over time, for the first seed."""
    model = fire_model(1, strategy).run(laboratory.pick(6_000, 600))
    return fires_figure({f"strategy {strategy}, seed 1, fire {LARGEST + 1} is the large one": portrait_of(model)})


ITEMS = (
    Item(figure="9.1", title="fires, and what is required of them", section="9.2, 9.3", make=fires),
    Item(figure="9.2", title="robots at each fire, strategy A", section="9.4", make=strategy_a),
    Item(figure="9.3", title="robots at each fire, strategy B", section="9.4", make=strategy_b),
)
