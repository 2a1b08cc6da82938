"""Runs of robots that teach themselves to touch nothing (thesis 8.3 and 8.4)."""

from functools import cache
from typing import Any

import numpy as np

from mesa_swarm.analysis import central_moving_average
from mesa_swarm.gallery import find_model
from mesa_swarm.learning.actions import temperature_at
from mesa_swarm.model import SwarmModel
from mesa_swarm.robots.design import AGENT9

STEPS = 33_000
# Of the whole run: the first 1,000 steps of 33,000, the last 3,000, a third.
FIRST, LAST, THIRD = 1 / 33, 1 / 11, 1 / 3
# What is kept of a curve that is smoothed over about 1,000 steps, or over 11.
POINTS, ONE_POINTS = 330, 3300
# Windows of the thesis, for many robots and for one.
MANY_WINDOW, ONE_WINDOW = 1001, 11
FORWARD = 3
# Distances from a wall at which a robot is asked, map units: up to where its sensors see nothing.
PLACES = np.linspace(0.5, 55.0, 110)


def learning_run(rng: int, *, steps: int = STEPS, **settings: Any) -> dict[str, Any]:
    """Let robots learn; return collisions a robot and 1,000 steps early and late, their curve, and their thirds.

    Examples
    --------
    >>> run = learning_run(1, steps=330, n_robots=2)
    >>> len(run["curve"]), run["total"] >= 0
    (330, True)
    """
    model = find_model("q_learning")(rng=rng, **settings).run(steps)
    robots = len(model.swarm)
    rate = 1000.0 * np.array(model.datacollector.model_vars["collisions"], float) / robots
    third = round(THIRD * steps)
    smooth = central_moving_average(rate, MANY_WINDOW if robots > 1 else ONE_WINDOW)
    warmth = np.array([temperature_at(step, beta=model.learner.beta) for step in range(1, steps + 1)])
    return {
        "early": float(rate[: round(FIRST * steps)].mean()),
        "late": float(rate[-round(LAST * steps) :].mean()),
        "first third": float(rate[:third].sum()) / 1000,
        "last third": float(rate[-third:].sum()) / 1000,
        "total": float(rate.sum()) / 1000,
        "with temperature": correlation(central_moving_average(rate, MANY_WINDOW), warmth),
        "curve": kept(smooth, POINTS if robots > 1 else ONE_POINTS),
        "sum": kept(np.cumsum(rate) / 1000),
        "temperature": kept(warmth),
        "speed": float(np.mean(model.datacollector.model_vars["forward_speed"][-round(LAST * steps) :])),
    }


def kept(values: np.ndarray, points: int = POINTS) -> list[float]:
    """Return so many values at equal steps, the last one too, with six digits.

    Examples
    --------
    >>> kept(np.arange(660.0))[-1]
    659.0
    """
    places = np.linspace(0, len(values) - 1, points).round().astype(int)
    return [float(f"{value:.6g}") for value in values[places]]


def correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    """Return Pearson's correlation, None if one of the two never changes.

    Examples
    --------
    >>> correlation(np.array([1.0, 2.0]), np.array([2.0, 4.0])), correlation(np.ones(2), np.ones(2))
    (1.0, None)
    """
    if np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    return round(float(np.corrcoef(a, b)[0, 1]), 12)


def avoidance_run(rng: int, *, steps: int = STEPS, gamma: float, **settings: Any) -> dict[str, float | None]:
    """Let one robot learn; return at which distance from a wall ahead it no longer goes on, map units.

    It is asked what every action is worth, from far to near: the distance is the one from which forward is
    no longer the best. None if forward never is.

    Examples
    --------
    >>> avoidance_run(1, steps=50, gamma=0.7).keys()
    dict_keys(['distance', 'collisions'])
    """
    model = find_model("q_learning")(rng=rng, gamma=gamma, n_robots=1, **settings).run(steps)
    distance, kind = readings_before_a_wall()
    best = model.learner.policy().values(distance, kind).argmax(axis=1)
    return {"distance": turning_distance(best == FORWARD), "collisions": float(model.total_collisions)}


def turning_distance(forward: np.ndarray) -> float | None:
    """Return the least of `PLACES` down to which, coming from far, forward is the best action at each.

    Examples
    --------
    >>> turning_distance(PLACES > 20.0)
    20.5
    >>> turning_distance(PLACES < 20.0) is None
    True
    """
    if not forward[-1]:
        return None
    turned = np.flatnonzero(~forward)
    return float(PLACES[turned[-1] + 1]) if len(turned) else 0.0


@cache
def readings_before_a_wall() -> tuple[np.ndarray, np.ndarray]:
    """Return what an AGENT9 that faces a long wall reads at each of `PLACES`: distances and kinds (110, 9).

    Examples
    --------
    >>> readings_before_a_wall()[0].shape
    (110, 9)
    """
    model = SwarmModel(map="openspace", rng=1)
    (robot,) = model.add_robots(AGENT9, poses=[(400.0, 300.0, 0.0)])
    distances, kinds = [], []
    for place in PLACES:
        robot.position = (780.0 - AGENT9.radius - place, 300.0)
        model.sense()
        distances.append(model.swarm.distance[0].copy())
        kinds.append(model.swarm.kind[0].copy())
    return np.array(distances), np.array(kinds)
