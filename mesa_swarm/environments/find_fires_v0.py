"""Finding fires: search for what burns. PettingZoo's environment, version 0."""

from mesa_swarm.environments.parallel import ParallelSwarmEnv
from mesa_swarm.environments.tasks import FindFires

NAME = "find_fires_v0"


def parallel_env(*, render_mode: str | None = None, **task: object) -> ParallelSwarmEnv:
    """Return the environment, in which every robot is an agent.

    Parameters
    ----------
    render_mode : "rgb_array" or None
    **task
        Parameters of `FindFires`: n_robots, map, max_steps, actions, ...

    Examples
    --------
    >>> parallel_env(n_robots=2).possible_agents
    ['robot_0', 'robot_1']
    """
    return ParallelSwarmEnv(FindFires.of(task), name=NAME, render_mode=render_mode)
