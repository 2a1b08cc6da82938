"""The environments by name, for Gymnasium and PettingZoo, and the check for optional packages."""

from importlib.util import find_spec

from mesa_swarm.base.extras import require_extra as need_package

NAMESPACE = "MesaSwarm"
# The task by Gymnasium's name of the environment.
REGISTERED = {
    "CollisionAvoidance-v0": "collision_avoidance",
    "FindFires-v0": "find_fires",
    "ExtinguishFires-v0": "extinguish_fires",
    "Foraging-v0": "foraging",
    "Aggregation-v0": "aggregation",
}


def need_learning_package(package: str, extra: str = "rl") -> None:
    """Check that a package of an extra is installed; if not, the error gives the command that installs it."""
    need_package(package, extra, "this environment needs")


def register() -> None:
    """Make the environments known to ``gymnasium.make`` and ``make_vec``; twice does no harm.

    Where PettingZoo has a registry (1.27 and later), its ``make`` knows them too.
    """
    need_learning_package("gymnasium")
    from gymnasium.envs import registration  # noqa: PLC0415 - heavy, and optional

    for name, task in REGISTERED.items():
        if f"{NAMESPACE}/{name}" not in registration.registry:
            registration.register(
                f"{NAMESPACE}/{name}",
                "mesa_swarm.environments.robot_env:robot_env",
                vector_entry_point="mesa_swarm.environments.robot_env:robot_vector_env",
                kwargs={"task": task},
            )
    if find_spec("pettingzoo") is not None:
        _register_agents()


def _register_agents() -> None:
    import pettingzoo  # noqa: PLC0415 - optional

    registries = getattr(pettingzoo, "parallel_registry", None), getattr(pettingzoo, "aec_registry", None)
    for kind, factory, registry in zip(("parallel", "aec"), ("parallel_env", "env"), registries, strict=True):
        for task in REGISTERED.values():
            name = f"{NAMESPACE}/{task}_v0"
            if registry is not None and name.replace("_v0", "-v0") not in registry:
                pettingzoo.register(kind, name, entry_point=f"mesa_swarm.environments.{task}_v0:{factory}")
