"""Measures of a drive of robots: collisions, the worst robot, speed ahead, and coverage of the map."""

from collections.abc import Callable

import numpy as np

from mesa_swarm.analysis.coverage import coverage
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.environments.scores import cells_in_reach
from mesa_swarm.learning.actions import ranges_of
from mesa_swarm.learning.fitness import SQUARE, Tally
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.swarm_model import SwarmModel

MEASURES = ("collisions", "worst robot", "speed ahead", "coverage")


def driven_world(control: Arbiter, design: RobotDesign, robots: int, world: Map | str, rng: int) -> SwarmModel:
    """Return a model whose robots are driven by a control, without history."""
    model = SwarmModel(map=world, rng=rng, history_every=0, collect_every=0)
    model.add_robots(design, robots)
    model.control = control
    return model


def tallied(
    model: SwarmModel, steps: int, each: Callable[[int], None] = lambda step: None, square: float = SQUARE
) -> Tally:
    """Run a model for a number of steps, and return the tally of its robots.

    `each` is called after each step with its number, from 0 on; `square` is the side of the squares that are counted.
    """
    swarm = model.swarm
    tally = Tally(len(swarm), model.map.bounds, ranges_of(swarm.table.proximity), square)
    for step in range(steps):
        model.step()
        tally.add(swarm.columns)
        each(step)
    return tally


def drive_measured(model: SwarmModel, steps: int) -> dict[str, float]:
    """Run a model, whose robots are all of one design, for a number of steps, and measure them.

    Collisions are per 1,000 steps, of the mean robot and of the worst; the mean speed ahead is a share of max_speed;
    the coverage is the share visited of the cells, of 40 x 40, that robots can reach from where they start.
    """
    reachable = cells_in_reach(model, model.swarm.position)
    positions = np.empty((steps, len(model.swarm), 2))

    def store(step: int) -> None:
        positions[step] = model.swarm.position

    tally = tallied(model, steps, store)
    bumps = 1000.0 * tally.sums[:, 2] / steps
    seen = coverage(positions, reachable, model.map.bounds)
    return dict(zip(MEASURES, (float(bumps.mean()), float(bumps.max()), tally.means()["ahead"], seen), strict=True))
