"""The worlds that are timed: the peers' workload, contact alone, and the thesis's maps."""

import math
from collections.abc import Callable
from time import perf_counter

import numpy as np

from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model import SwarmModel
from mesa_swarm.robots.design import AGENT3, AGENT6, AGENT9, RobotDesign
from mesa_swarm.world.map import Map
from mesa_swarm.world.shapes import disc

AREA_PER_ROBOT = 40  # in robot bodies
ROBOTS_PER_OBSTACLE = 10
OBSTACLE_RADIUS = 5.0
BY_SENSORS = {3: AGENT3, 6: AGENT6, 9: AGENT9}


def peer_workload(n: int, rng: int = 1) -> SwarmModel:
    """Return the world in which other simulators were timed.

    AGENT9 with range 16, Avoid and Explore, 40 robot bodies of area a robot, a small obstacle per 10 robots.

    Parameters
    ----------
    n : int
        Robots.
    rng : int

    Examples
    --------
    >>> model = peer_workload(50)
    >>> len(model.robots), len(model.obstacles)
    (50, 5)
    """
    design = AGENT9.with_proximity(range=16)
    model = SwarmModel(map=_scattered(n, design.radius, rng), rng=rng)
    model.add_robots(design, n)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def _scattered(n: int, radius: float, rng: int) -> Map:
    """Return a square map with obstacles in the cells of a grid, drawn so that none overlap."""
    side = math.sqrt(AREA_PER_ROBOT * math.pi * n) * radius
    obstacles = max(n // ROBOTS_PER_OBSTACLE, 1)
    cells = math.ceil(math.sqrt(obstacles))
    random = np.random.default_rng(rng)
    chosen = random.permutation(cells * cells)[:obstacles]
    room = side / cells - 2 * OBSTACLE_RADIUS
    corners = np.column_stack(np.divmod(chosen, cells)) * (side / cells)
    centres = corners + OBSTACLE_RADIUS + random.random((obstacles, 2)) * room
    return Map(
        name=f"{n} robots", bounds=(0, 0, side, side), obstacles=tuple(disc(c, OBSTACLE_RADIUS) for c in centres)
    )


def contact_alone(n: int, rng: int = 1) -> SwarmModel:
    """Return a world of robots without sensors and control that drive in circles, whatever is in the way.

    Driving straight on, all would end in heaps at the border.

    Examples
    --------
    >>> contact_alone(10).swarm.distance.shape
    (10, 0)
    """
    model = SwarmModel(map=_scattered(n, 5.0, rng), rng=rng)
    model.add_robots(RobotDesign(name="blind", radius=5.0, max_speed=1.0), n)
    model.swarm.columns["command"][:] = (1.0, 0.8)
    return model


def on_map(n: int, name: str = "original", sensors: int = 9, rng: int = 1) -> SwarmModel:
    """Return n robots with so many sensors that avoid and explore on a map of the thesis.

    Examples
    --------
    >>> on_map(3, "sparse", sensors=6).swarm.distance.shape
    (3, 6)
    """
    model = SwarmModel(map=name, rng=rng)
    model.add_robots(BY_SENSORS[sensors], n)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def step_seconds(step: Callable[[], None], repetitions: int, budget: float) -> float:
    """Return the seconds of one step: the median over repetitions, each of as many steps as its budget allows.

    Parameters
    ----------
    step : callable
    repetitions : int
        At least 1.
    budget : float
        Seconds for all of them together, about.

    Examples
    --------
    >>> step_seconds(lambda: None, repetitions=3, budget=0.001) < 0.01
    True
    """
    for _ in range(5):
        step()
    started = perf_counter()
    step()
    count = max(int(budget / repetitions / max(perf_counter() - started, 1e-7)), 1)
    return float(np.median([_mean_seconds(step, count) for _ in range(repetitions)]))


def _mean_seconds(step: Callable[[], None], count: int) -> float:
    started = perf_counter()
    for _ in range(count):
        step()
    return (perf_counter() - started) / count
