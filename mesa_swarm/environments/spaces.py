"""A task's observations and actions as Gymnasium's spaces."""

import numpy as np

from mesa_swarm.environments.registration import need_learning_package
from mesa_swarm.environments.scores import TeamEncoder
from mesa_swarm.environments.state import StateEncoder
from mesa_swarm.environments.tasks import Task

need_learning_package("gymnasium")

from gymnasium.spaces import Box, Discrete, Space  # noqa: E402 - the error above names what is missing


def observation_space(task: Task, robot: int | None = None) -> Box:
    """Return the space of the observations of a robot, or without one of the widest that a robot of the task has."""
    observer = task.observer()
    width = observer.widths[robot] if robot is not None and isinstance(observer, TeamEncoder) else observer.width
    return Box(0.0, 1.0, (width,), np.float32)


def action_space(task: Task) -> Space:
    """Return the space of one robot's actions."""
    return Box(-1.0, 1.0, (task.numbers,), np.float32) if isinstance(task.actions, str) else Discrete(task.actions)


def state_space(task: Task) -> Box:
    """Return the space of the states of its worlds, for central critics."""
    return Box(-1.0, 1.0, (StateEncoder(task).width,), np.float32)
