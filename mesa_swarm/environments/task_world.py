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
    """Drive the first `count` robots of a swarm by commands from outside; the layers below drive the others.

    Their `wheels` (count, 2) are rim speeds left and right, map units a step, 0 at first; robots are driven by them
    from the next step on. They exist once the layer belongs to a swarm: ``model.control.layers[0].wheels``.
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
        """Copy the commands; this is the uppermost layer."""
        if len(layer) < self.count:
            raise InvalidValueError(
                f"{self.name}({self.count}) has {len(layer)} robots to command; add robots, or command fewer"
            )
        command[: self.count, :2] = self.wheels
        layer[: self.count] = index

    def reason(self, moment: Moment) -> Reason:
        """Return that the decision came from outside."""
        return Reason("it was commanded from outside")


class TaskWorld(SwarmModel):
    """A world for one episode: `advance`, then `observe`, `finished` and `out_of_time`.

    The first `commanded` robots are commanded, the task's rules drive the others. Its DataCollector collects nothing,
    so that memory does not grow with the steps.
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
        """Take a step at these shares (k, 2) of the greatest wheel speed; write the commanded robots' rewards (k,)."""
        np.multiply(shares, self.task.design.max_speed, out=self._wheels)
        self.step()
        if self.task.rewards_state:
            self._score.reward(reward)
            self.sense()
        else:
            self.sense()
            self._score.reward(reward)

    def observe(self, out: np.ndarray) -> None:
        """Write the observations of the commanded robots, shape (k, width)."""
        self._observer.observe(self.swarm.columns, out)
