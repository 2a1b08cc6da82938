"""The rooms of the package that hold compiled functions, and the import of all their modules."""

import pkgutil
from importlib import import_module

import mesa_swarm

ROOMS = ("kernels", "geometry", "robots", "physics", "control", "fire", "learning", "environments")
# These need packages of extras.
OF_EXTRAS = ("sb3", "onnx_files")


def import_compiled_rooms():
    """Import every module that may hold a compiled function."""
    for room in ROOMS:
        for module in pkgutil.iter_modules([f"{mesa_swarm.__path__[0]}/{room}"]):
            if module.name not in OF_EXTRAS:
                import_module(f"mesa_swarm.{room}.{module.name}")
