"""Measures of a drive of robots: collisions, the worst robot, speed ahead, and coverage of the map."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.analysis.coverage import coverage
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.environments.scores import cells_in_reach
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import Integers, RealRows, RealTables
from mesa_swarm.learning.actions import ranges_of
from mesa_swarm.learning.fitness import SQUARE, Tally
from mesa_swarm.maps.map import Map
from mesa_swarm.model.observers import DrivenObserver
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.swarm_model import SwarmModel

MEASURES = ("collisions", "worst robot", "speed ahead", "coverage")


def driven_world(control: Arbiter, design: RobotDesign, robots: int, world: Map | str, rng: int) -> SwarmModel:
    """Return a model whose robots are driven by a control, without history."""
    model = SwarmModel(map=world, rng=rng, history_every=0, collect_every=0)
    model.add_robots(design, robots)
    model.control = control
    return model


class TallyingObserver(DrivenObserver):
    """Adds each step of a model to a tally, and stores where robots are."""

    def __init__(self, tally: Tally, positions: np.ndarray) -> None:
        self._tally, self._positions = tally, positions
        self._kernel: Kernel | None = None
        self._version = -1

    def last_kernel(self, model: SwarmModel) -> Kernel:
        """Return what adds the step that is over."""
        swarm = model.swarm
        if self._kernel is None or self._version != swarm.version:
            adding, row = self._tally.kernel_for(swarm.columns), np.array([self._tally.steps])
            block = Block(PositionRows(swarm.columns["position"], self._positions, row))
            storing = Kernel(store_positions, block.numbers, block)
            self._kernel = sequence_of([adding, storing]) if len(self._positions) else adding
            self._version = swarm.version
        return self._kernel

    def after_step(self, model: SwarmModel, step: int) -> None:
        """Add a step that was taken by itself."""
        self.last_kernel(model).run(step, len(model.swarm))


class PositionRows(NamedTuple):
    """What `store_positions` takes: the column, a row a step (steps, n, 2), and which row is the next."""

    position: RealRows
    rows: RealTables
    next_row: Integers


@compiled(nogil=True)
def store_positions(block: Any, step: int, first: int, last: int) -> int:
    """Store where robots are."""
    p: Any = unpack(block, PositionRows)  # type: ignore[call-arg]
    position, rows, row = p.position, p.rows, p.next_row[0]
    for i in range(position.shape[0]):
        rows[row, i, 0], rows[row, i, 1] = position[i, 0], position[i, 1]
    p.next_row[0] += 1
    return 0


def tallied(
    model: SwarmModel,
    steps: int,
    each: Callable[[int], None] | None = None,
    square: float = SQUARE,
    positions: np.ndarray | None = None,
) -> Tally:
    """Run a model for a number of steps, and return the tally of its robots.

    `each` is called after each step with its number, from 0 on; `square` is the side of the squares that are counted.
    Where robots are after each step is written into `positions` (steps, n, 2).
    """
    swarm = model.swarm
    tally = Tally(len(swarm), model.map.bounds, ranges_of(swarm.table.proximity), square)
    observer = TallyingObserver(tally, np.empty((0, 0, 2)) if positions is None else positions)
    model.observers.append(observer)
    try:
        if each is None:
            model.run(steps)
        for step in range(tally.steps, steps):  # also those after a condition has ended the run
            model.step()
            if each is not None:
                each(step)
    finally:
        model.observers.remove(observer)
    return tally


def drive_measured(model: SwarmModel, steps: int) -> dict[str, float]:
    """Run a model, whose robots are all of one design, for a number of steps, and measure them.

    Collisions are per 1,000 steps, of the mean robot and of the worst; the mean speed ahead is a share of max_speed;
    the coverage is the share visited of the cells, of 40 x 40, that robots can reach from where they start.
    """
    reachable = cells_in_reach(model, model.swarm.position)
    positions = np.empty((steps, len(model.swarm), 2))
    tally = tallied(model, steps, positions=positions)
    bumps = 1000.0 * tally.sums[:, 2] / steps
    seen = coverage(positions, reachable, model.map.bounds)
    return dict(zip(MEASURES, (float(bumps.mean()), float(bumps.max()), tally.means()["ahead"], seen), strict=True))
