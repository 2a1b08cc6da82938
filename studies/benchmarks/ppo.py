"""PPO of Stable-Baselines3 with one policy for all robots, as a contestant of the benchmark."""

from importlib.util import find_spec
from typing import Any

import numpy as np

from mesa_swarm.environments import CollisionAvoidance, SharedPolicyVecEnv, Variation
from mesa_swarm.experiments import Controller
from mesa_swarm.world.random_map import random_map
from mesa_swarm_studies.benchmarks.benchmark_tasks import TRAIN

WORLDS, ROBOT_STEPS = 16, 1_500_000
# The same as on the page about PPO.
SETTINGS: dict[str, Any] = {
    "n_steps": 128,
    "batch_size": 3840,
    "n_epochs": 10,
    "learning_rate": 1e-3,
    "gamma": 0.95,
    "policy_kwargs": {"net_arch": [32, 32], "log_std_init": -1.0},
}


def is_installed() -> bool:
    """Return whether Stable-Baselines3 can be imported."""
    return find_spec("stable_baselines3") is not None


def trained_by_ppo(seed: int, share: float = 1.0) -> tuple[Controller, int]:
    """Return a controller that PPO trained on the maps of the benchmark, and the robot-steps that it took.

    It acts without random choices. On one machine the same seed gives the same weights.

    Parameters
    ----------
    seed : int
    share : float
        Of 1.5 million robot-steps; at least one round of learning is done.

    Raises
    ------
    SwarmError
        If Stable-Baselines3 is missing.
    """
    variation = Variation(maps=[random_map(number) for number in TRAIN])
    task = CollisionAvoidance(encoding="typed", collision_cost=30.0, max_steps=1000, variation=variation)
    worlds: Any = SharedPolicyVecEnv(task, n_worlds=WORLDS, seed=seed)
    import torch  # noqa: PLC0415 - optional, and slow to import
    from stable_baselines3 import PPO  # noqa: PLC0415

    torch.set_num_threads(1)  # so small networks are trained fastest by one thread
    learner = PPO("MlpPolicy", worlds, seed=seed, device="cpu", **SETTINGS).learn(max(int(ROBOT_STEPS * share), 1))

    def act(observations: np.ndarray) -> np.ndarray:
        return learner.predict(observations, deterministic=True)[0]

    return Controller(name="PPO", make=lambda: act, width=task.observer().width), int(learner.num_timesteps)
