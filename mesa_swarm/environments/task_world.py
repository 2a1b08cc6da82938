"""One world of a task: a swarm model whose robots, or some of them, are commanded from outside."""

from typing import Any

import mesa
import numpy as np

from mesa_swarm.control import Subsumption
from mesa_swarm.environments.commanded import Commanded
from mesa_swarm.environments.tasks import Task
from mesa_swarm.model import SwarmModel


class TaskWorld(SwarmModel):
    """A world for one episode: `advance`, then `observe`, `finished` and `out_of_time`.

    Its DataCollector collects nothing, so that millions of steps take no memory.

    Parameters
    ----------
    task : Task
    commanded : int
        The first so many robots are commanded, at least 1, at most all; the task's rules drive the others.
    rng : int
        Seed of everything in it.

    Examples
    --------
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> world = TaskWorld(task=CollisionAvoidance(n_robots=3, map="openspace"), commanded=2, rng=1)
    >>> reward = np.empty(2)
    >>> world.advance(np.ones((2, 2)), reward)
    >>> reward
    array([1., 1.])
    """

    def __init__(self, *, task: Task, commanded: int, rng: int) -> None:
        super().__init__(map=task.map, rng=rng, history_every=0, fire_constants=task.constants)
        self.datacollector = mesa.DataCollector()
        self.task = task
        self.commanded = commanded
        self.add_robots(task.design, task.n_robots)
        others = task.others() if commanded < task.n_robots else ()
        self.control = Subsumption(Commanded(commanded), *others)
        commands: Any = self.control.layers[0]  # the copy of Commanded that belongs to this swarm
        self._wheels = commands.wheels
        self._observer = task.observer()
        self._score = task.score(self, commanded)
        self.sense()

    @property
    def finished(self) -> bool:
        """Whether the task is done."""
        return self._score.finished

    @property
    def out_of_time(self) -> bool:
        """Whether the episode's steps are used up."""
        return self.steps >= self.task.max_steps

    def advance(self, shares: np.ndarray, reward: np.ndarray) -> None:
        """Take a step, and write what it was worth to each commanded robot.

        Parameters
        ----------
        shares : ndarray, shape (k, 2)
            What their wheels do, as shares of the greatest speed.
        reward : ndarray, shape (k,), written
        """
        np.multiply(shares, self.task.design.max_speed, out=self._wheels)
        self.step()
        self.sense()
        self._score.reward(reward)

    def observe(self, out: np.ndarray) -> None:
        """Write what the commanded robots are told, shape (k, width)."""
        self._observer.observe(self.swarm.columns, out)
