"""The environments by name, for Gymnasium, and the check for the extra `rl`."""

from importlib.util import find_spec

from mesa_swarm.errors import SwarmError

NAMESPACE = "MesaSwarm"
# The task by Gymnasium's name of the environment.
REGISTERED = {
    "CollisionAvoidance-v0": "collision_avoidance",
    "FindFires-v0": "find_fires",
    "ExtinguishFires-v0": "extinguish_fires",
}


def need(package: str) -> None:
    """Check that a package of the extra `rl` is installed; if not, the error gives the command that installs it."""
    if find_spec(package) is None:
        raise SwarmError(f"this environment needs {package}; install it with: pip install 'mesa-swarm[rl]'")


def register() -> None:
    """Make the environments known to ``gymnasium.make`` and ``make_vec``; twice does no harm."""
    need("gymnasium")
    from gymnasium.envs import registration  # noqa: PLC0415 - heavy, and optional

    for name, task in REGISTERED.items():
        if f"{NAMESPACE}/{name}" not in registration.registry:
            registration.register(
                f"{NAMESPACE}/{name}",
                "mesa_swarm.environments.robot_env:robot_env",
                vector_entry_point="mesa_swarm.environments.robot_env:robot_vector_env",
                kwargs={"task": task},
            )
