"""The Gymnasium face: one robot is commanded, the task's rules drive the others."""

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.environments.actions import shares
from mesa_swarm.environments.camera import METADATA, Camera, checked_mode
from mesa_swarm.environments.registration import need
from mesa_swarm.environments.spaces import action_space, observation_space
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import TASKS, Task
from mesa_swarm.environments.vector import check_seed, new_world
from mesa_swarm.errors import SwarmError, check_choice

need("gymnasium")

from gymnasium import Env  # noqa: E402 - said first what is missing


class RobotEnv(Env):
    """The first robot of a world as a Gymnasium environment.

    Made by ``gymnasium.make("MesaSwarm/CollisionAvoidance-v0")``, or ``FindFires-v0`` or ``ExtinguishFires-v0``.

    Parameters
    ----------
    task : Task
    render_mode : "rgb_array" or None

    Attributes
    ----------
    world : TaskWorld
        The present one, all of whose columns can be read: ``env.unwrapped.world.swarm.collided``.

    Examples
    --------
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> env = RobotEnv(CollisionAvoidance(n_robots=1, map="openspace"))
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(np.array([1, 1]))
    >>> reward, terminated, truncated
    (1.0, False, False)
    """

    metadata = METADATA

    def __init__(self, task: Task, *, render_mode: str | None = None) -> None:
        self.render_mode = checked_mode(render_mode)
        self.task = task
        self.observation_space = observation_space(task)
        self.action_space = action_space(task)
        self.world: TaskWorld | None = None
        self._width = task.observer().width
        self._camera = Camera(task.chart)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Start an episode; without a seed the stream of episodes goes on.

        Returns
        -------
        observation : float32 ndarray
        info : dict
        """
        super().reset(seed=None if seed is None else check_seed(seed))
        self.world = new_world(self.task, 1, self.np_random)
        return self._observation(), {}

    def step(self, action: ArrayLike) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Take a step.

        Parameters
        ----------
        action : array_like, shape (2,), or int

        Returns
        -------
        observation : float32 ndarray
        reward : float
        terminated, truncated : bool
        info : dict
        """
        world = self._running()
        reward = np.empty(1)
        world.advance(shares(self.task.actions, np.asarray(action)[None], reward.shape), reward)
        finished = world.finished
        return self._observation(), float(reward[0]), finished, world.out_of_time and not finished, {}

    def render(self) -> np.ndarray | None:
        """Return a picture of the world, uint8, shape (height, width, 3), or None without a render mode."""
        return None if self.render_mode is None else self._camera.picture(self._running())

    def _running(self) -> TaskWorld:
        if self.world is None:
            raise SwarmError("the environment has no episode yet; call reset() first")
        return self.world

    def _observation(self) -> np.ndarray:
        rows = np.empty((1, self._width), np.float32)
        self._running().observe(rows)
        return rows[0]


def robot_env(*, task: str, render_mode: str | None = None, n_robots: int = 1, **parameters: object) -> RobotEnv:
    """Return the environment that Gymnasium makes.

    Parameters
    ----------
    task : str
        "collision_avoidance", "find_fires" or "extinguish_fires".
    render_mode : "rgb_array" or None
    n_robots : int
        In all.
    **parameters
        Others of the task.

    Examples
    --------
    >>> robot_env(task="find_fires", n_robots=3).task.n_robots
    3
    """
    chosen = TASKS[check_choice("task", task, TASKS)]
    return RobotEnv(chosen.of({**parameters, "n_robots": n_robots}), render_mode=render_mode)
