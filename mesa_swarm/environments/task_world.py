"""One world of a task for one episode, and the layer through which a learner drives robots."""

from typing import Any

import mesa
import numpy as np

from mesa_swarm.control import Subsumption
from mesa_swarm.control.layer import Senses
from mesa_swarm.environments.tasks import Task
from mesa_swarm.errors import InvalidValueError, LearningError, check_count
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.swarm_model import SwarmModel


class Commanded:
    """Drive the first robots of a swarm by commands from outside; the layers below drive the others.

    Until `wheels` is written to, the commanded robots stand still.

    Parameters
    ----------
    count : int
        How many robots are commanded, at least 1.

    Attributes
    ----------
    wheels : ndarray, shape (count, 2)
        Rim speeds left and right, map units a step; they are driven from the next step on. The array
        exists once the layer belongs to a swarm: ``model.control.layers[0].wheels``.

    Examples
    --------
    >>> from mesa_swarm.control import Subsumption
    >>> from mesa_swarm import SwarmModel
    >>> from mesa_swarm.robots.design import AGENT9
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    >>> model.control = Subsumption(Commanded(1))
    >>> model.control.layers[0].wheels[:] = 0.5
    >>> model.run(2).swarm.position
    array([[101., 100.]])
    """

    name = "Commanded"
    _wheels: np.ndarray | None = None

    def __init__(self, count: int) -> None:
        self.count = check_count("count", count, minimum=1)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Allocate the commands: a copy of this layer belongs to each swarm."""
        self._wheels = np.zeros((self.count, 2))

    @property
    def wheels(self) -> np.ndarray:
        """The commands of the robots; LearningError if the layer is in no model."""
        if self._wheels is None:
            raise LearningError(
                "this Commanded is in no model, which would use a copy of it; write to the wheels of the copy, such as "
                "model.control.layers[0].wheels"
            )
        return self._wheels

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Copy the commands; this is the uppermost layer.

        Raises
        ------
        InvalidValueError
            If there are fewer robots than are commanded.
        """
        if len(layer) < self.count:
            raise InvalidValueError(
                f"{self.name}({self.count}) has {len(layer)} robots to command; add robots, or command fewer"
            )
        command[: self.count] = self.wheels
        layer[: self.count] = index

    def reason(self, moment: Moment) -> Reason:
        """Return that the decision came from outside."""
        return Reason("it was commanded from outside")


class TaskWorld(SwarmModel):
    """A world for one episode: `advance`, then `observe`, `finished` and `out_of_time`.

    Its DataCollector collects nothing, so that memory does not grow with the steps.

    Parameters
    ----------
    task : Task
    commanded : int
        The number of commanded robots, the first ones; at least 1. The task's rules drive the others.
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
        """Take a step, and write the reward of each commanded robot.

        Parameters
        ----------
        shares : ndarray, shape (k, 2)
            Their wheel speeds, as shares of the greatest speed.
        reward : ndarray, shape (k,), written
        """
        np.multiply(shares, self.task.design.max_speed, out=self._wheels)
        self.step()
        self.sense()
        self._score.reward(reward)

    def observe(self, out: np.ndarray) -> None:
        """Write the observations of the commanded robots, shape (k, width)."""
        self._observer.observe(self.swarm.columns, out)
