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
    """Drive the first robots of a swarm as told from outside; the layers below drive the others.

    Until somebody writes to `wheels`, the commanded robots stand still.

    Parameters
    ----------
    count : int
        How many robots are commanded, at least 1.

    Attributes
    ----------
    wheels : ndarray, shape (count, 2)
        Rim speeds left and right, map units a step; what is written here is driven in the next steps. It is
        there once the layer belongs to a swarm: ``model.control.layers[0].wheels``.

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
        """Make room for the commands: a copy of this layer belongs to each swarm."""
        self._wheels = np.zeros((self.count, 2))

    @property
    def wheels(self) -> np.ndarray:
        """What the commanded robots are told; LearningError if the layer is in no model."""
        if self._wheels is None:
            raise LearningError(
                "this Commanded is in no model: a model drives by a copy of it; write to the wheels of "
                "model.control.layers[0], or whichever layer it is there"
            )
        return self._wheels

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Hand on what was told; this is the uppermost layer.

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
        """Say that nobody in here decided."""
        return Reason("it was told so from outside")


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
