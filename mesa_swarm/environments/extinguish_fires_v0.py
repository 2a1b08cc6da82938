"""Extinguishing fires: put out what burns, together where one cannot. PettingZoo's environment, version 0."""

from mesa_swarm.environments.parallel import ParallelSwarmEnv
from mesa_swarm.environments.tasks import ExtinguishFires


def parallel_env(*, render_mode: str | None = None, **task: object) -> ParallelSwarmEnv:
    """Return the environment, in which every robot is an agent; `task` are parameters of `ExtinguishFires`."""
    return ParallelSwarmEnv(ExtinguishFires.of(task), name="extinguish_fires_v0", render_mode=render_mode)
