"""The state of a whole world as numbers, for central critics: what no robot could know."""

from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.environments.task import Task
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.kernels.elementary import directions_of
from mesa_swarm.swarm_model import SwarmModel

OF_ROBOT, OF_FIRE, OF_THING = 9, 5, 3


class StateEncoder:
    """Turns a world into one row of numbers in [-1, 1], always of the same width.

    A row is, in this order:

    - the share of the episode's steps that are used up;
    - for each robot, rule-driven ones included: 1; x and y as shares of the map's width and height; cosine and sine of
      its heading; the speeds of its left and right wheel as shares of the greatest; 1 or 0 for: it collided in the
      last step; its temperature as a share of the one at which it leaves a fire, at most 1;
    - for each fire: 1; x and y likewise; its temperature, at most 1; 1 or 0 for: it is out;
    - for each thing that the task has added, such as the nest and the items of `Foraging`: 1; x and y likewise.

    Rows of robots, fires and things that an episode does not have, and of robots that were removed, are 0.

    Parameters
    ----------
    task : Task
        Its largest number of robots and of fires give the width; of maps that a function draws only those count that
        have no more fires than the task's own.

    Examples
    --------
    >>> from mesa_swarm.environments import FindFires
    >>> StateEncoder(FindFires(n_robots=4)).width
    72
    """

    def __init__(self, task: Task) -> None:
        self.robots = task.most_robots
        varied: Any = () if task.variation is None or callable(task.variation.maps) else task.variation.maps
        self.fires = max(len(chart.fires) for chart in (task.chart, *varied))
        self.things = task.most_things
        self.width = 1 + OF_ROBOT * self.robots + OF_FIRE * self.fires + OF_THING * self.things
        self._task = task
        self._leave = float(task.constants.leave)

    def write(self, world: TaskWorld, out: np.ndarray) -> None:
        """Write the state of a world, shape (width,).

        Raises
        ------
        InvalidValueError
            If the world has more fires or things than the row has room for.
        """
        fires = len(world.fires)
        if fires > self.fires:
            raise InvalidValueError(
                f"map {world.map.name} has {fires} fires; the state has room for {self.fires}: give the task a map "
                "with as many, or list the maps in Variation(maps=...)"
            )
        out.fill(0.0)
        out[0] = world.steps / self._task.max_steps
        robots, burning, things = np.split(out[1:], np.cumsum((OF_ROBOT * self.robots, OF_FIRE * self.fires)))
        self._write_robots(world, robots.reshape(self.robots, OF_ROBOT))
        places = world.task.things(world)
        if len(places) > self.things:
            raise InvalidValueError(
                f"the world has {len(places)} things; the state has room for {self.things}: add none during an episode"
            )
        rows = things.reshape(self.things, OF_THING)[: len(places)]
        rows[:, 0], rows[:, 1:] = 1.0, _shares(world, places)
        table, columns = burning.reshape(self.fires, OF_FIRE)[:fires], world.fires.columns
        table[:, 0] = 1.0
        table[:, 1:3] = _shares(world, columns["position"][:fires])
        table[:, 3] = np.minimum(columns["temperature"][:fires], 1.0)
        table[:, 4] = columns["out"][:fires]

    def _write_robots(self, world: TaskWorld, out: np.ndarray) -> None:
        """Write each robot's numbers where they were when the episode began."""
        columns, numbers = world.swarm.columns, world.roster().numbers
        table = np.empty((len(numbers), OF_ROBOT))
        fastest = columns["max_speed"][:, None]
        table[:, 0] = 1.0
        table[:, 1:3] = _shares(world, columns["position"])
        table[:, 3], table[:, 4] = directions_of(columns["heading"])
        table[:, 5:7] = columns["command"][:, :2] / np.where(fastest > 0, fastest, 1.0)
        table[:, 7] = columns["collided"]
        table[:, 8] = np.minimum(columns["temperature"] / self._leave, 1.0)
        out[numbers] = table


def _shares(world: SwarmModel, position: np.ndarray) -> np.ndarray:
    x_min, y_min, x_max, y_max = world.map.bounds
    return np.clip((position - (x_min, y_min)) / (x_max - x_min, y_max - y_min), 0.0, 1.0)
