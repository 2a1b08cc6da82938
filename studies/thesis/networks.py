"""Figures 6.5 and 7.3, and section 6.4: small networks, what they forget, Boltzmann's choice."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.errors import check_count
from mesa_swarm.gallery import find_model
from mesa_swarm.learning import Networks, boltzmann, chosen, fit, fit_in_turn
from mesa_swarm.viewing import LIGHT, plain_figure
from mesa_swarm_studies.drawing import column, draw_means, plain_axes
from mesa_swarm_studies.judging import (
    Result,
    judged_difference,
    judged_fact,
    judged_mean,
    judged_measure,
    judged_number,
)
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

POINTS = 30
# An error of this many times the noise is a bad fit: the thesis calls it bias.
BAD = 3.0
NOISE = 0.05
# See `fit_in_turn`.
REHEARSALS = ("none", "interleaved", "consolidated")

Curve = Callable[[np.ndarray], np.ndarray]


def demonstrated(x: np.ndarray) -> np.ndarray:
    """Return a curve of the form that two hidden units can have (6.1): 0.6 tanh(4 x + 1) - 0.4 tanh(3 x - 2)."""
    return 0.6 * np.tanh(4.0 * x + 1.0) - 0.4 * np.tanh(3.0 * x - 2.0)


def drawn_curve(rng: np.random.Generator) -> Curve:
    """Return y = f tanh(d x + b) + g tanh(e x + c) (6.1) with weights drawn at random."""
    d, e = rng.uniform(1, 5, 2)
    b, c = rng.uniform(-2, 2, 2)
    f, g = rng.uniform(-0.8, 0.8, 2)
    return lambda x: f * np.tanh(d * x + b) + g * np.tanh(e * x + c)


def noisy_points(rng: np.random.Generator, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return the points that are shown."""
    x = np.linspace(-1, 1, POINTS)
    return x, curve(x) + rng.normal(0, NOISE, POINTS)


def regression_run(rng: int, *, networks: int, curve: str) -> dict[str, float]:
    """Fit networks to points of one curve; return the share that fits badly, and the median error over the noise."""
    random = np.random.default_rng(rng)
    true = demonstrated if curve == "ours" else drawn_curve(random)
    x, y = noisy_points(random, true)
    fitted = fit(x, y, rng=random, networks=networks)
    outputs = np.array([fitted.outputs(np.full((networks, 1), at)) for at in x])
    errors = np.sqrt(((outputs - true(x)[:, None]) ** 2).mean(axis=0)) / NOISE
    return {"bad": float(np.mean(errors > BAD)), "median": float(np.median(errors))}


def choice_run(rng: int, *, draws: int) -> dict[str, float]:
    """Let chance choose among Q = (3, 2, 1) at T = 1; return the share of the best less its probability."""
    values = np.array([3.0, 2.0, 1.0])
    taken = np.array([chosen(values, 1.0, chance) for chance in np.random.default_rng(rng).random(draws)])
    return {"excess": float(np.mean(taken == 0) - np.exp(3) / np.exp(values).sum())}


def forgetting_run(rng: int, *, networks: int, rehearsal: str) -> dict[str, float]:
    """Learn the left half of a noisy curve, then the right one; return median errors of networks, over the noise."""
    random = np.random.default_rng(rng)
    x, y = noisy_points(random, demonstrated)
    halves = x < 0, x >= 0
    after = fit_in_turn([(x[half], y[half]) for half in halves], rng=random, networks=networks, rehearsal=rehearsal)
    left, right = ((x[half], demonstrated(x[half])) for half in halves)
    return {
        "old task at first": error_of(after[0], *left),
        "old task": error_of(after[1], *left),
        "new task": error_of(after[1], *right),
    }


def error_of(fitted: Networks, x: np.ndarray, y: np.ndarray) -> float:
    """Return the root mean square error of the median network, over the noise."""
    outputs = np.array([fitted.outputs(np.full((len(fitted.outer_bias), 1), place)) for place in x])
    return float(np.median(np.sqrt(((outputs - y[:, None]) ** 2).mean(axis=0))) / NOISE)


def regression_figure(
    truth: Curve = demonstrated, *, rng: int = 1, points: int = POINTS, networks: int = 40, activation: str = "tanh"
) -> Figure:
    """Return the thesis's demonstration of regression (6.3): noisy points, the best network, the worst, and all errors.

    Two hidden units, 200 presentations of every point, learning rate 0.5. The networks begin with different weights:
    some stay bad.

    Examples
    --------
    >>> len(regression_figure(points=5, networks=2).axes)
    2
    """
    chance = np.random.default_rng(check_count("rng", rng))
    x = np.linspace(-1.0, 1.0, check_count("points", points, minimum=2))
    y = truth(x) + NOISE * chance.standard_normal(len(x))
    fitted = fit(x, y, rng=chance, networks=check_count("networks", networks, minimum=2), activation=activation)
    fine = np.linspace(-1.0, 1.0, 201)
    outputs = np.array([fitted.outputs(np.full((networks, 1), place)) for place in fine])
    errors = np.sqrt(((outputs - truth(fine)[:, None]) ** 2).mean(axis=0))
    order = errors.argsort()
    figure, ((left, right),) = plain_figure((9.0, 3.6), 1, 2, width_ratios=(2, 1))
    left.plot(x, y, "o", markersize=3.5, color=LIGHT.soft, label="noisy points")
    left.plot(fine, truth(fine), ":", color=LIGHT.ink, linewidth=1.2, label="without noise")
    for which, name, style, colour in ((0, "best", "-", LIGHT.series[0]), (-1, "worst", "--", LIGHT.series[1])):
        label = f"{name} of {networks} networks"
        left.plot(fine, outputs[:, order[which]], style, color=colour, linewidth=1.5, label=label)
    left.set(xlabel="x", ylabel="y")
    left.legend(fontsize=8, frameon=False)
    right.plot(np.arange(1, networks + 1), errors[order], "o", markersize=4, color=LIGHT.series[0])
    right.axhline(NOISE, color=LIGHT.soft, linestyle=":", linewidth=1.0)
    right.annotate("noise", (1, NOISE), textcoords="offset points", xytext=(0, 3), fontsize=8)
    right.set(xlabel="network, from the best to the worst", ylabel="error (root mean square)")
    right.set_ylim(bottom=0)
    return figure


SEEDS = 40
VALUES = (3.0, 2.0, 1.0)
# Smaller differences come from rounding.
ROUNDING = 1e-12


def regression(laboratory: Laboratory) -> Result:
    """Make figure 6.5: two runs of a regression, one good and one bad."""
    seeds = laboratory.seeds(SEEDS)
    networks = laboratory.pick(50, 10)
    same, drawn = laboratory.grid(
        regression_run, [{"networks": networks, "curve": kind} for kind in ("ours", "drawn")], seeds
    )
    checks = (
        judged_mean(
            "share of networks that fit badly (error above three times the noise)",
            "less than 10 %",
            column(same, "bad"),
            high=0.1,
        ),
        judged_mean(
            "error of the median network, relative to the noise",
            "good fit in the picture",
            column(same, "median"),
            high=1.5,
        ),
        judged_mean(
            "the same share for random curves",
            "less than 10 %",
            column(drawn, "bad"),
            high=0.1,
            main=False,
        ),
    )
    return Result(
        checks=checks,
        pictures={"": regression_figure(rng=6, networks=laboratory.pick(100, 20))},
        settings=(
            "1-2-1 networks of tanh units, eta 0.5, 200 presentations of each of 30 points in random order, noise "
            "0.05; the thesis's points are unknown; ours follow 0.6 tanh(4x + 1) - 0.4 tanh(3x - 2)"
        ),
    )


def choice(laboratory: Laboratory) -> Result:
    """Make figure 7.3: Boltzmann's probabilities of three actions over the temperature."""
    temperatures = np.geomspace(0.05, 20, 200)
    shares = np.array([boltzmann(VALUES, t) for t in temperatures])
    rows = laboratory.runs(choice_run, laboratory.seeds(SEEDS), draws=laboratory.pick(10_000, 1_000))
    exact = np.exp(VALUES) / np.exp(VALUES).sum()
    checks = (
        judged_number(
            "probabilities at T = 1 differ from e^(Q/T) / sum (7.4) by at most",
            "0",
            float(np.abs(boltzmann(VALUES, 1.0) - exact).max()),
            high=ROUNDING,
        ),
        judged_number("cold, the best action is certain: its probability at T = 0.05", "1", shares[0, 0], low=0.999),
        judged_number(
            "hot, all are similar: largest minus smallest at T = 20", "0", float(np.ptp(shares[-1])), high=0.05
        ),
        judged_fact(
            "the best action's probability falls monotonically with T",
            "falls",
            bool((np.diff(shares[:, 0]) < 0).all()),
            measured=f"{shares[0, 0]:.3f} to {shares[-1, 0]:.3f}",
        ),
        judged_mean(
            "robots choose accordingly: share of the best action at T = 1 minus its probability",
            "0",
            column(rows, "excess"),
            low=-0.005,
            high=0.005,
        ),
    )
    figure, axes = plain_axes("temperature T", "probability")
    for value, line in zip(VALUES, shares.T, strict=True):
        axes.plot(temperatures, line, linewidth=1.8, label=f"Q = {value:g}")
    axes.set(xscale="log", ylim=(-0.02, 1.02))
    axes.legend(frameon=False)
    return Result(checks=checks, pictures={"": figure}, settings="Q = (3, 2, 1), as in the thesis")


FORGETTING_SEEDS = 30


def forgetting(laboratory: Laboratory) -> Result:
    """Measure how much networks forget of a task while they learn another, with and without rehearsal."""
    points = [{"networks": laboratory.pick(20, 4), "rehearsal": way} for way in REHEARSALS]
    runs = laboratory.grid(forgetting_run, points, laboratory.fresh_seeds(FORGETTING_SEEDS))
    rows = dict(zip(REHEARSALS, runs, strict=True))
    plain = column(rows["none"], "old task")
    rehearsed = [
        judged_difference(
            f"{way} learning: error of the old task is smaller than without rehearsal, relative to the noise",
            "prevents forgetting",
            {way: column(rows[way], "old task"), "none": plain},
        )
        for way in REHEARSALS[1:]
    ]
    checks = (
        judged_difference(
            "networks forget: error of the old task grows while they learn the new one, relative to the noise",
            "forgetting",
            {"before": column(rows["none"], "old task at first"), "after": plain},
        ),
        *rehearsed,
    )
    figure, axes = plain_axes("", "error of the median network over the noise")
    for i, task in enumerate(("old task", "new task")):
        places = np.arange(len(REHEARSALS)) + 0.1 * i
        draw_means(axes, places, [column(rows[way], task) for way in REHEARSALS], f"{task}, after both", i)
    for line in axes.get_lines():  # nothing lies between two ways
        line.set_linestyle("")
    axes.axhline(
        float(np.mean(column(rows["none"], "old task at first"))), color=LIGHT.faint, linestyle=":", linewidth=1
    )
    axes.set_xticks(np.arange(len(REHEARSALS)) + 0.05, REHEARSALS)
    axes.margins(x=0.15)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return Result(
        checks=checks,
        pictures={"": figure},
        settings=(
            "1-8-1 networks of tanh units, eta 0.1, 200 presentations of each of 15 points of the left half of the "
            "curve of 6.5, then of the right half; consolidated: then 200 more of all points; dotted: the old task "
            "before"
        ),
    )


MEMORY_STEPS = 10_000
MEMORY_BETA = 1e-3
MEMORIES = ("networks", "table")


def memory_run(rng: int, *, memory: str, steps: int) -> dict[str, float]:
    """Let 15 robots learn in networks or tables; return reward, collisions and speed of the first and last tenth."""
    model = find_model("q_learning")(rng=rng, memory=memory, beta=MEMORY_BETA).run(steps)
    tenth, variables = steps // 10, model.datacollector.model_vars
    rates = {"reward": 1.0, "collisions": 1000.0 / len(model.swarm), "forward_speed": 1.0}
    return {
        f"{name} {when}": factor * float(np.mean(variables[name][part]))
        for name, factor in rates.items()
        for when, part in (("early", slice(tenth)), ("late", slice(-tenth, None)))
    }


def tables(laboratory: Laboratory) -> Result:
    """Compare robots that learn in a look-up table of discrete states with robots that learn in networks."""
    points = [{"memory": memory, "steps": laboratory.pick(MEMORY_STEPS, 500)} for memory in MEMORIES]
    runs = laboratory.grid(memory_run, points, laboratory.fresh_seeds(FORGETTING_SEEDS))
    rows = dict(zip(MEMORIES, runs, strict=True))
    learns = [
        judged_difference(
            f"robots learn in {name}: mean reward of the last tenth of a run is above that of the first",
            "either may be used",
            {"first": column(rows[memory], "reward early"), "last": column(rows[memory], "reward late")},
        )
        for memory, name in zip(MEMORIES, ("networks", "a table"), strict=True)
    ]
    late = [
        judged_measure(
            f"in the last tenth: {claim}",
            "networks generalise",
            f"{measure} late",
            {less: rows[less], more: rows[more]},
            main=False,
        )
        for claim, measure, less, more in (
            ("networks are rewarded more", "reward", "table", "networks"),
            ("networks collide less, a robot and 1,000 steps", "collisions", "networks", "table"),
            ("networks drive faster", "forward_speed", "table", "networks"),
        )
    ]
    figure, axes = plain_axes("mean forward speed, share of the full one", "collisions a robot in 1,000 steps")
    for i, memory in enumerate(MEMORIES):
        for when, marker in (("early", "o"), ("late", "s")):
            places = column(rows[memory], f"forward_speed {when}"), column(rows[memory], f"collisions {when}")
            label = f"{memory}, {'first' if when == 'early' else 'last'} tenth"
            axes.plot(
                *places, marker, color=LIGHT.series[i], alpha=0.4 if when == "early" else 0.9, markersize=5, label=label
            )
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return Result(
        checks=(*learns, *late),
        pictures={"": figure},
        settings=(
            f"map original, 15 robots, {MEMORY_STEPS:,} steps, beta {MEMORY_BETA:g}, otherwise the defaults of the "
            "model; the table has 243 states: the nearest reading in each of five sectors in three bins, with edges at "
            "0.08 and 0.3 of the range"
        ),
    )


ITEMS = (
    Item(figure="6.5", title="two runs of a regression", section="6.3", make=regression),
    Item(figure="6.4", title="forgetting, and rehearsal against it", section="6.4", make=forgetting),
    Item(figure="7.3.2", title="a look-up table beside networks", section="7.3.2", make=tables),
    Item(figure="7.3", title="Boltzmann's probabilities", section="7.4", make=choice),
)
