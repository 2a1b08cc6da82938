"""Figure B.1: how a fire grows, and how robots extinguish it, beside the thesis's equations."""

import math
import warnings
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm.errors import FireConstantsWarning
from mesa_swarm.fire import FireConstants, design_constants, next_temperature
from mesa_swarm_studies.drawing import count_steps, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_fact, judged_number
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

# The example by which (B.9) was found to be wrong: three robots put out a fire of area 1 and T = 1 in 200 steps.
GROWTH, ROBOTS, TIME, AREA = 1000.0, 3, 200, 1.0
LONGEST = 5_000


def growth(laboratory: Laboratory) -> Result:
    """Make figure B.1: the temperature of an unattended fire, and of one that robots extinguish."""
    chosen = example()
    alone = course(chosen, 0.0, robots=0, steps=1_500)
    law = np.minimum(np.exp(chosen.k1 * np.arange(len(alone))) - 1.0, 1.0)
    fought = course(chosen, 1.0, robots=ROBOTS, steps=LONGEST)
    return Result(
        checks=(*left_alone(alone, law), *put_out(chosen, fought), *as_printed(chosen)),
        pictures={"": growth_figure(alone, law, fought)},
        settings="growth time 1,000, area 1, T = 1; here T = 0 is absorbing, and T stays within [0, 1]",
        remarks=(
            f"k2 is {chosen.k2:.7f} by (B.9) corrected and {printed_k2(chosen.k1):.4f} as printed, which adds an area "
            "per time to a dimensionless number.",
        ),
    )


def left_alone(alone: np.ndarray, law: np.ndarray) -> tuple[Check, ...]:
    """Judge whether an unattended fire grows as in the thesis."""
    return (
        judged_number(
            "unattended, T follows e^(k1 t) - 1 (B.1): largest difference", "exact", float(np.abs(alone - law).max()),
            high=0.001,
        ),
        judged_number("T reaches 1 after the growth time of 1,000: steps", "1,000", first(alone >= 1.0), high=1_001),
    )  # fmt: skip


def put_out(chosen: FireConstants, fought: np.ndarray) -> tuple[Check, ...]:
    """Judge whether robots extinguish a fire as in the thesis's equations, once (B.9) is corrected."""
    exact = np.maximum(solution(chosen, np.arange(len(fought))), 0.0)
    return (
        judged_number(
            "three robots extinguish it in 200 steps, constants by (B.9) corrected: steps", "200", first(fought <= 0.0),
            low=199, high=202,
        ),
        judged_number(
            "on the way T follows the solution (B.7): largest difference", "exact",
            float(np.abs(fought - exact).max()), high=0.01,
        ),
    )  # fmt: skip


def as_printed(chosen: FireConstants) -> tuple[Check, ...]:
    """Judge the equations as they are printed."""
    fought = course(replace(chosen, k2=printed_k2(chosen.k1)), 1.0, robots=ROBOTS, steps=LONGEST)
    return (
        judged_number(
            "with k2 by (B.9) as printed they take 200 steps", "200", first(fought <= 0.0), low=199, high=202,
            main=False,
        ),
        judged_number(
            "T stays within [0, 1] by (B.3) as printed: T = 0.001, eight robots, one step later", "0 to 1",
            0.001 + chosen.k1 * 1.001 - chosen.k2 * 8, low=0.0, high=1.0, main=False,
        ),
        judged_fact(
            "by (B.3) as printed a fire cannot start from exactly 0", "cannot start", chosen.k1 * (0 + 1) == 0,
            measured=f"grows by {chosen.k1:.6f} a step", criterion="k1 (T + 1) is 0 at T = 0", main=False,
        ),
    )  # fmt: skip


def growth_figure(alone: np.ndarray, law: np.ndarray, fought: np.ndarray) -> Figure:
    """Return a figure of a fire left alone beside the law, and of one that is put out."""
    times = np.arange(len(alone))
    figure, axes = plain_axes("step", "temperature of the fire")
    axes.plot(times, alone, linewidth=1.8, label="left alone")
    axes.plot(times[:: len(times) // 15], law[:: len(times) // 15], "o", markersize=4, label="e^(k1 t) - 1")
    axes.plot(np.arange(len(fought))[:260], fought[:260], linewidth=1.8, label="three robots, corrected k2")
    axes.legend(frameon=False)
    count_steps(axes)
    return figure


def example() -> FireConstants:
    """Return the constants of the example; that one robot would suffice for it does not matter here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FireConstantsWarning)
        return design_constants(
            growth_time=GROWTH, robots=ROBOTS, extinguish_time=TIME, area=AREA, largest_area=AREA,
            initial_temperature=1.0,
        )  # fmt: skip


def printed_k2(k1: float) -> float:
    """Return k2 by (B.9) as the thesis prints it: k1 A / n multiplies the first term only."""
    grown = math.exp(k1 * TIME)
    return (k1 * AREA / ROBOTS * grown + grown - 1.0) / (grown - 1.0)


def course(chosen: FireConstants, start: float, *, robots: int, steps: int) -> np.ndarray:
    """Return a fire's temperature at steps 0, 1, ..., by the rule of the simulator, in which 0 is absorbing."""
    k = (chosen.k1, chosen.k2, chosen.k3, chosen.k4, chosen.leave, chosen.join)
    temperatures = [start]
    for _ in range(steps):
        now = temperatures[-1]
        temperatures.append(next_temperature(now, AREA, robots, k) if robots == 0 or now > 0.0 else 0.0)
    return np.array(temperatures)


def solution(chosen: FireConstants, times: np.ndarray) -> np.ndarray:
    """Return the solution of (B.2) for a fire at T = 1: (1 + T0 - c) e^(k1 t) + c - 1, c = k2 n / (k1 A) (B.7)."""
    held = chosen.k2 * ROBOTS / (chosen.k1 * AREA)
    return (2.0 - held) * np.exp(chosen.k1 * times) + held - 1.0


def first(happened: np.ndarray) -> float:
    """Return the first step at which something is true, infinity if it never is."""
    return float(happened.argmax()) if happened.any() else math.inf


ITEMS = (Item(figure="B.1", title="how a fire's temperature grows", section="B.1", make=growth),)
