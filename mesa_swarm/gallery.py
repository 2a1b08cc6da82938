"""The models of mesa_swarm, by name."""

import inspect
from importlib import import_module
from pkgutil import iter_modules

from mesa_swarm.errors import check_choice

PACKAGE = "mesa_swarm.models"
BASE = "mesa_swarm.swarm_model"  # of SwarmModel itself
OLD_BASE = "mesa_swarm.model"  # the same in recordings of version 0.1.0


def model_names() -> list[str]:
    """Return the names of all models, sorted, without importing them."""
    modules = iter_modules(import_module(PACKAGE).__path__)
    return sorted(module.name for module in modules if not module.name.startswith("_"))


def find_model(name: str) -> type:
    """Return the class of the model with this name: module and class are the same words."""
    check_choice("model", name, model_names())
    return getattr(import_module(f"{PACKAGE}.{name}"), class_name(name))


def class_name(name: str) -> str:
    """Return the name of the class in the module of this name."""
    return "".join(word.capitalize() for word in name.split("_"))


def description(model_class: type) -> str:
    """Return the first line of a model's docstring."""
    return (inspect.getdoc(model_class) or "").partition("\n")[0]


def shipped_class(module: str, name: str) -> type | None:
    """Return a class of mesa_swarm by its address, None for any other: importing a module runs it."""
    if (module, name) == (OLD_BASE, "SwarmModel"):
        module = BASE
    if module != BASE and module not in {f"{PACKAGE}.{model}" for model in model_names()}:
        return None
    found = getattr(import_module(module), name, None)
    return found if isinstance(found, type) and found.__module__ == module else None
