"""The swarm as PettingZoo and Gymnasium environments, and many worlds at once as plain arrays.

Where Gymnasium is installed, importing this makes ``gymnasium.make("MesaSwarm/CollisionAvoidance-v0")`` work. Names are
imported when they are first used: `VectorSwarmEnv` needs neither Gymnasium nor PettingZoo.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

from mesa_swarm.environments.registration import register

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.environments.parallel import ParallelSwarmEnv
    from mesa_swarm.environments.robot_env import RobotEnv, RobotVectorEnv
    from mesa_swarm.environments.task_world import Commanded
    from mesa_swarm.environments.tasks import CollisionAvoidance, ExtinguishFires, FindFires, Task
    from mesa_swarm.environments.vector import VectorSwarmEnv

_HOME = {
    "CollisionAvoidance": "tasks",
    "Commanded": "task_world",
    "ExtinguishFires": "tasks",
    "FindFires": "tasks",
    "ParallelSwarmEnv": "parallel",
    "RobotEnv": "robot_env",
    "RobotVectorEnv": "robot_env",
    "Task": "tasks",
    "VectorSwarmEnv": "vector",
}

__all__ = [
    "CollisionAvoidance",
    "Commanded",
    "ExtinguishFires",
    "FindFires",
    "ParallelSwarmEnv",
    "RobotEnv",
    "RobotVectorEnv",
    "Task",
    "VectorSwarmEnv",
    "register",
]


def __getattr__(name: str) -> object:
    """Import a public name from where it lives."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return sorted([*globals(), *__all__])


if find_spec("gymnasium") is not None:
    register()
