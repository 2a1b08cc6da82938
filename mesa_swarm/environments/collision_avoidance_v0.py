"""Collision avoidance: drive forward without collisions. PettingZoo's environment, version 0."""

from mesa_swarm.environments.parallel import ParallelSwarmEnv
from mesa_swarm.environments.tasks import CollisionAvoidance

NAME = "collision_avoidance_v0"


def parallel_env(*, render_mode: str | None = None, **task: object) -> ParallelSwarmEnv:
    """Return the environment, in which every robot is an agent.

    Parameters
    ----------
    render_mode : "rgb_array" or None
    **task
        Parameters of `CollisionAvoidance`: n_robots, map, max_steps, actions, ...

    Examples
    --------
    >>> parallel_env(n_robots=2).possible_agents
    ['robot_0', 'robot_1']
    """
    return ParallelSwarmEnv(CollisionAvoidance.of(task), name=NAME, render_mode=render_mode)
