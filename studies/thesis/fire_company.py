"""Figure 9.1: a second robot comes to a fire, its temperature falls, and both stay longer."""

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm import AGENT_FIRE, SwarmModel
from mesa_swarm.gallery import find_model
from mesa_swarm.viewing import LIGHT, draw_world, frame_of, make_plain, scene_of
from mesa_swarm_studies.drawing import column
from mesa_swarm_studies.judging import Result, judged_difference, judged_mean, judged_measure
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

# The second fire of the map, large and in the middle.
LARGEST = 1
# A second robot comes while the first is there: its first stay at the large fire takes 100 steps.
DELAYS = 20, 80
# From the edge of the fire, within sight of it.
AWAY = 30.0
STAYING_STEPS = 3_000
STAYING_SEEDS = 100
# Until two robots have put the fire out.
SHOWN_STEPS = 4_000


def stay_run(rng: int, *, company: bool, steps: int = STAYING_STEPS) -> dict[str, Any]:
    """Let one robot fight the large fire, alone or with a second one that comes while it is there.

    Return the mean stay of each robot at the fire, between coming and leaving too hot, and by how much the fire's
    temperature changes from the second one's coming, or the same step, to the end.
    """
    chance = np.random.default_rng(rng)
    bearing, delay = chance.uniform(-math.pi, math.pi), int(chance.integers(*DELAYS))
    other = bearing + chance.uniform(math.pi / 3, 5 * math.pi / 3)
    model = lone_fire_model(rng, bearing)
    fights, temperature, comes = [], [], steps
    for step in range(steps):
        model.step()
        if comes == steps and model.swarm.fire[0] == LARGEST:
            comes = step + delay
        if step == comes and company:
            add_beside_fire(model, other)
        fights.append([*(model.swarm.fire == LARGEST), False][:2])
        temperature.append(float(model.fires.temperature[LARGEST]))
    first, second = np.array(fights).T
    return {
        "first stays": mean_stay(first),
        "second stays": mean_stay(second),
        "change": temperature[-1] - temperature[min(comes, steps - 1)],
        "temperature": temperature[::10],
    }


def lone_fire_model(rng: int, bearing: float) -> SwarmModel:
    """Return a model of strategy B with one robot, at this bearing from the large fire and in sight of it."""
    model = find_model("fire_fighting")(rng=rng, strategy="B", n_robots=0)
    add_beside_fire(model, bearing)
    return model


def add_beside_fire(model: SwarmModel, bearing: float) -> None:
    """Add a robot that faces the large fire."""
    away = model.fires.radius[LARGEST] + AGENT_FIRE.radius + AWAY
    x, y = model.fires.position[LARGEST] + away * np.array([math.cos(bearing), math.sin(bearing)])
    model.add_robots(AGENT_FIRE, poses=[(x, y, bearing + math.pi)])


def mean_stay(fights: np.ndarray) -> float | None:
    """Return the mean number of steps of the stays that have ended; None without any."""
    changes = np.flatnonzero(np.diff(np.concatenate([[False], fights])))
    lengths = np.diff(changes)[::2]
    return float(lengths.mean()) if len(lengths) else None


def second_robot(laboratory: Laboratory) -> Result:
    """Make figure 9.1: a series of frames in which a second robot comes to a fire, and what that changes."""
    points = [{"company": company, "steps": laboratory.pick(STAYING_STEPS, 600)} for company in (False, True)]
    alone, joined = laboratory.grid(stay_run, points, laboratory.fresh_seeds(STAYING_SEEDS))
    checks = (
        judged_mean("T falls once a second robot has come: change of T", "T falls", column(joined, "change"), high=0.0),
        judged_measure(
            "T falls further than with one robot", "T falls", "change", {"with a second robot": joined, "alone": alone}
        ),
        *(
            judged_difference(
                f"the {which} robot stays longer than one that is alone: steps", "both stay longer",
                {"alone": column(alone, "first stays"), "with the other": column(joined, f"{which} stays")},
            )
            for which in ("first", "second")
        ),
    )  # fmt: skip
    return Result(
        checks=checks,
        pictures={"": series_figure(laboratory.pick(SHOWN_STEPS, 600))},
        settings=(
            f"the large fire of openspace_fire, strategy B, default constants, {STAYING_STEPS:,} steps; robots begin "
            f"{AWAY:g} from its edge at random bearings, the second {DELAYS[0]} to {DELAYS[1]} steps after the first "
            "has reached it; pairs of runs differ in the second robot only"
        ),
    )


def series_figure(steps: int) -> Figure:
    """Return six frames of one run, from the first robot's coming on, and the fire's temperature over its steps."""
    model, second, times = lone_fire_model(1, 0.6), 60, [0, 45, 75, 110, 3 * steps // 4, steps]
    figure = Figure(figsize=(10.0, 8.6), layout="constrained")
    panels = figure.subplot_mosaic("012;345;TTT", height_ratios=(3, 3, 2))
    temperature = []
    for step in range(steps + 1):
        if step == second:
            add_beside_fire(model, 2.6)
        if step in times:
            draw_close(panels[str(times.index(step))], model)
        temperature.append(model.fires.temperature[LARGEST])
        model.step()
    axes = panels["T"]
    axes.plot(temperature, color=LIGHT.series[0])
    axes.axvline(second, color=LIGHT.series[1], linestyle="--", label="a second robot comes")
    axes.set(xlabel="step", ylabel="temperature of the fire")
    make_plain(axes)
    axes.legend(frameon=False)
    return figure


def draw_close(axes: Axes, model: SwarmModel) -> None:
    """Draw the large fire and what is near it."""
    draw_world((frame_of(model), scene_of(model)), axes)
    (x, y), reach = model.fires.position[LARGEST], model.fires.radius[LARGEST] + 3 * AWAY / 2
    fighting = int(model.fires.robots[LARGEST])
    title = f"step {model.steps:,}: T {model.fires.temperature[LARGEST]:.3f}, fought by {fighting}"
    axes.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach), xlabel="", ylabel="", xticks=[], yticks=[])
    axes.set_title(title, fontsize=10)


ITEMS = (Item(figure="9.1", title="a second robot comes to a fire", section="9.3", make=second_robot),)
