"""The models of mesa_swarm, by name."""

import inspect
from importlib import import_module
from pkgutil import iter_modules

from mesa_swarm.errors import check_choice

PACKAGE = "mesa_swarm.models"
BASE = "mesa_swarm.swarm_model"  # of SwarmModel itself
OLD_BASE = "mesa_swarm.model"  # the same in recordings of version 0.1.0


def model_names() -> list[str]:
    """Return the names of all models, sorted, without importing them.

    Examples
    --------
    >>> "fire_fighting" in model_names()
    True
    """
    modules = iter_modules(import_module(PACKAGE).__path__)
    return sorted(module.name for module in modules if not module.name.startswith("_"))


def find_model(name: str) -> type:
    """Return the class of the model with this name: module and class are the same words.

    Raises
    ------
    UnknownNameError
        With the nearest name.

    Examples
    --------
    >>> find_model("fire_fighting").__name__
    'FireFighting'
    """
    check_choice("model", name, model_names())
    return getattr(import_module(f"{PACKAGE}.{name}"), class_name(name))


def class_name(name: str) -> str:
    """Return the name of the class in the module of this name.

    Examples
    --------
    >>> class_name("fire_fighting")
    'FireFighting'
    """
    return "".join(word.capitalize() for word in name.split("_"))


def description(model_class: type) -> str:
    """Return the first line of a model's docstring.

    Examples
    --------
    >>> description(find_model("fire_fighting"))
    'Robots that put out fires with strategy A or B.'
    """
    return (inspect.getdoc(model_class) or "").partition("\n")[0]


def shipped_class(module: str, name: str) -> type | None:
    """Return a class of mesa_swarm by its address, None for any other: importing a module runs it.

    Examples
    --------
    >>> shipped_class("mesa_swarm.models.fire_fighting", "FireFighting").__name__, shipped_class("os", "path")
    ('FireFighting', None)
    """
    if (module, name) == (OLD_BASE, "SwarmModel"):
        module = BASE
    if module != BASE and module not in {f"{PACKAGE}.{model}" for model in model_names()}:
        return None
    found = getattr(import_module(module), name, None)
    return found if isinstance(found, type) and found.__module__ == module else None
