"""The swarm as PettingZoo and Gymnasium environments, and many worlds at once as plain arrays.

Where Gymnasium is installed, importing this makes ``gymnasium.make("MesaSwarm/CollisionAvoidance-v0")`` work, and where
PettingZoo is, ``pettingzoo.make("parallel", "MesaSwarm/collision_avoidance_v0")``. Names are imported when they are
first used: `VectorSwarmEnv` needs neither Gymnasium nor PettingZoo.
"""

from importlib.util import find_spec
from typing import TYPE_CHECKING

from mesa_swarm.base.lazy import lazy_names
from mesa_swarm.environments.registration import register

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.environments.parallel import ParallelSwarmEnv
    from mesa_swarm.environments.robot_env import RobotEnv, RobotVectorEnv
    from mesa_swarm.environments.sb3 import SharedPolicyVecEnv
    from mesa_swarm.environments.state import StateEncoder
    from mesa_swarm.environments.task_world import Commanded, TaskWorld
    from mesa_swarm.environments.tasks import (
        Aggregation,
        CollisionAvoidance,
        ExtinguishFires,
        FindFires,
        Foraging,
        Task,
    )
    from mesa_swarm.environments.variation import Conditions, Variation
    from mesa_swarm.environments.vector import VectorSwarmEnv

# Module: the public names that live in it.
_MODULES = {
    "environments.parallel": "ParallelSwarmEnv",
    "environments.robot_env": "RobotEnv RobotVectorEnv",
    "environments.sb3": "SharedPolicyVecEnv",
    "environments.state": "StateEncoder",
    "environments.task_world": "Commanded TaskWorld",
    "environments.tasks": "Aggregation CollisionAvoidance ExtinguishFires FindFires Foraging Task",
    "environments.variation": "Conditions Variation",
    "environments.vector": "VectorSwarmEnv",
}

__all__ = [
    "Aggregation",
    "CollisionAvoidance",
    "Commanded",
    "Conditions",
    "ExtinguishFires",
    "FindFires",
    "Foraging",
    "ParallelSwarmEnv",
    "RobotEnv",
    "RobotVectorEnv",
    "SharedPolicyVecEnv",
    "StateEncoder",
    "Task",
    "TaskWorld",
    "Variation",
    "VectorSwarmEnv",
    "register",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)

if find_spec("gymnasium") is not None:
    register()
