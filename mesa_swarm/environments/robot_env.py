"""Gymnasium environments: one commanded robot, or all commanded robots of several worlds as a vector."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.environments.actions import shares
from mesa_swarm.environments.camera import METADATA, Camera, checked_mode
from mesa_swarm.environments.registration import need
from mesa_swarm.environments.spaces import action_space, observation_space
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import TASKS, Task
from mesa_swarm.environments.vector import Infos, VectorSwarmEnv, check_seed, new_world
from mesa_swarm.errors import SwarmError, check_choice

need("gymnasium")

from gymnasium import Env  # noqa: E402 - the error above names what is missing
from gymnasium.vector import AutoresetMode, VectorEnv  # noqa: E402
from gymnasium.vector.utils import batch_space  # noqa: E402


class RobotEnv(Env):
    """The first robot of a world as a Gymnasium environment.

    Made by ``gymnasium.make("MesaSwarm/CollisionAvoidance-v0")``, or ``FindFires-v0`` or ``ExtinguishFires-v0``. The
    columns of the current `world` can be read: ``env.unwrapped.world.swarm.collided``.
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
        """Start an episode and return observation and info; without a seed the stream of episodes continues."""
        super().reset(seed=None if seed is None else check_seed(seed))
        self.world = new_world(self.task, 1, self.np_random)
        return self._observation(), {}

    def step(self, action: ArrayLike) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Take a step, given two wheel speeds or the number of an action.

        Returns
        -------
        observation, reward, terminated, truncated, info
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
    """Return the environment that Gymnasium makes, of `n_robots` in all; `parameters` are others of the task."""
    chosen = TASKS[check_choice("task", task, TASKS)]
    return RobotEnv(chosen.of({**parameters, "n_robots": n_robots}), render_mode=render_mode)


class RobotVectorEnv(VectorEnv):
    """A flat `VectorSwarmEnv`, for learners with one shared policy.

    Environment w k + i is robot i of world w, where k robots of each world are commanded. With one commanded robot,
    environment w is what `RobotEnv` is with seed + w. A world whose episode ends starts the next in the same step:
    ``infos["final_obs"]`` holds the last observations, and ``infos["_final_obs"]`` which environments have ended.

    Parameters
    ----------
    task : Task
    n_worlds : int
    commanded : int, optional
        How many robots of each world are commanded; all by default.
    render_mode : "rgb_array" or None

    Attributes
    ----------
    swarms : VectorSwarmEnv

    Examples
    --------
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> env = RobotVectorEnv(CollisionAvoidance(n_robots=5, map="openspace"), n_worlds=3)
    >>> observations, infos = env.reset(seed=1)
    >>> env.num_envs, observations.shape
    (15, (15, 9))
    """

    metadata = {**METADATA, "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012 Gymnasium's own form

    def __init__(
        self, task: Task, *, n_worlds: int, commanded: int | None = None, render_mode: str | None = None
    ) -> None:
        self.render_mode = checked_mode(render_mode)
        self.swarms = VectorSwarmEnv(task, n_worlds=n_worlds, commanded=commanded)
        self.num_envs = self.swarms.n_worlds * self.swarms.commanded
        self.single_observation_space, self.single_action_space = observation_space(task), action_space(task)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._camera = Camera(task.chart)

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict | None = None
    ) -> tuple[np.ndarray, Infos]:
        """Start an episode in every world; world w gets seed + w, or the w-th of several seeds."""
        return self._flat(self.swarms.reset(seed=seed)), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Infos]:
        """Take a step in every world; all arrays have one row an environment."""
        shape = self.swarms.n_worlds, self.swarms.commanded
        commands = np.asarray(actions)
        if commands.shape[:1] == (self.num_envs,):
            commands = commands.reshape(*shape, *commands.shape[1:])
        observations, reward, terminated, truncated, infos = self.swarms.step(commands)
        terminated, truncated = np.repeat(terminated, shape[1]), np.repeat(truncated, shape[1])
        if infos:
            infos = {"final_obs": self._flat(infos["final_obs"]), "_final_obs": terminated | truncated}
        return self._flat(observations), reward.ravel(), terminated, truncated, infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return a picture of every world, or None without a render mode."""
        if self.render_mode is None:
            return None
        if not self.swarms.worlds:
            raise SwarmError("the environment has no episode yet; call reset() before render()")
        return tuple(map(self._camera.picture, self.swarms.worlds))

    def _flat(self, array: np.ndarray) -> np.ndarray:
        return array.reshape(self.num_envs, -1)


def robot_vector_env(
    *,
    task: str,
    num_envs: int,
    render_mode: str | None = None,
    n_robots: int = 1,
    commanded: int = 1,
    **parameters: object,
) -> RobotVectorEnv:
    """Return the environment that ``gymnasium.make_vec`` makes, of `num_envs` worlds.

    The first `commanded` robots of each world are commanded: with several of them the environments are as many times
    more.
    """
    chosen = TASKS[check_choice("task", task, TASKS)].of({**parameters, "n_robots": n_robots})
    return RobotVectorEnv(chosen, n_worlds=num_envs, commanded=commanded, render_mode=render_mode)
