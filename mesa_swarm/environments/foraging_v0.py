"""Foraging: bring food to a nest. PettingZoo's environment, version 0."""

from typing import Any

from mesa_swarm.environments.parallel import AECEnv, ParallelSwarmEnv, parallel_of, with_turns
from mesa_swarm.environments.tasks import Foraging

NAME = "foraging_v0"


def parallel_env(
    *, render_mode: str | None = None, max_cycles: int | None = None, clip: bool = False, **task: object
) -> ParallelSwarmEnv:
    """Return the environment, in which every robot is an agent; `task` are parameters of `Foraging`."""
    return parallel_of(Foraging, NAME, task, render_mode=render_mode, max_cycles=max_cycles, clip=clip)


def env(**parameters: Any) -> AECEnv:
    """Return the same environment with turns (AEC): the world advances when all robots have acted."""
    return with_turns(parallel_env(**parameters))
