"""Collision avoidance: drive forward without collisions. PettingZoo's environment, version 0."""

from mesa_swarm.environments.parallel import ParallelSwarmEnv
from mesa_swarm.environments.tasks import CollisionAvoidance


def parallel_env(*, render_mode: str | None = None, **task: object) -> ParallelSwarmEnv:
    """Return the environment, in which every robot is an agent; `task` are parameters of `CollisionAvoidance`."""
    return ParallelSwarmEnv(CollisionAvoidance.of(task), name="collision_avoidance_v0", render_mode=render_mode)
