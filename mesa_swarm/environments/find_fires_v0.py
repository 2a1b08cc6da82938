"""Finding fires: search for what burns. PettingZoo's environment, version 0."""

from mesa_swarm.environments.parallel import ParallelSwarmEnv
from mesa_swarm.environments.tasks import FindFires


def parallel_env(*, render_mode: str | None = None, **task: object) -> ParallelSwarmEnv:
    """Return the environment, in which every robot is an agent; `task` are parameters of `FindFires`."""
    return ParallelSwarmEnv(FindFires.of(task), name="find_fires_v0", render_mode=render_mode)
