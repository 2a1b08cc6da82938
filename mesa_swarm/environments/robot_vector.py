"""Gymnasium's vector face: every commanded robot of several worlds is an environment of its own."""

from collections.abc import Sequence

import numpy as np

from mesa_swarm.environments.camera import METADATA, Camera, checked_mode
from mesa_swarm.environments.registration import need
from mesa_swarm.environments.spaces import action_space, observation_space
from mesa_swarm.environments.tasks import TASKS, Task
from mesa_swarm.environments.vector import Infos, VectorSwarmEnv
from mesa_swarm.errors import SwarmError, check_choice

need("gymnasium")

from gymnasium.vector import AutoresetMode, VectorEnv  # noqa: E402 - said first what is missing
from gymnasium.vector.utils import batch_space  # noqa: E402


class RobotVectorEnv(VectorEnv):
    """A `VectorSwarmEnv` laid out flat, as learners with one shared policy want it.

    Environment w k + i is robot i of world w, where k robots of each world are commanded. With one commanded robot,
    environment w is what `RobotEnv` is with seed + w. A world whose episode ends starts the next in the same step:
    ``infos["final_obs"]`` holds what was seen before, and ``infos["_final_obs"]`` which environments that concerns.

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
        told = np.asarray(actions)
        if told.shape[:1] == (self.num_envs,):
            told = told.reshape(*shape, *told.shape[1:])
        observations, reward, terminated, truncated, infos = self.swarms.step(told)
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
    """Return the environment that ``gymnasium.make_vec`` makes.

    Parameters
    ----------
    task : str
        "collision_avoidance", "find_fires" or "extinguish_fires".
    num_envs : int
        Worlds; with several commanded robots in each there are that many times as many environments.
    render_mode : "rgb_array" or None
    n_robots : int
        Of each world, in all.
    commanded : int
        Of each world: the first ones.
    **parameters
        Others of the task.

    Examples
    --------
    >>> robot_vector_env(task="find_fires", num_envs=4).num_envs
    4
    """
    chosen = TASKS[check_choice("task", task, TASKS)].of({**parameters, "n_robots": n_robots})
    return RobotVectorEnv(chosen, n_worlds=num_envs, commanded=commanded, render_mode=render_mode)
