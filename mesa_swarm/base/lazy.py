"""Imports that are quick: names that are imported when they are first used, and no garbage collection meanwhile."""

import gc
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from importlib import import_module
from types import FunctionType
from typing import Any


def lazy_names(package: str, modules: Mapping[str, str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package whose names are imported when they are first used.

    A name must not be that of a module of the same package: whichever is imported last would replace the other.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    modules : mapping of str to str
        By module, without ``mesa_swarm.``: the names that it defines, separated by spaces.

    Examples
    --------
    >>> of_package, names_of_package = lazy_names("mesa_swarm", {"errors": "SwarmError", "streams": "Streams"})
    >>> of_package("SwarmError").__module__
    'mesa_swarm.base.errors'
    """
    homes = {name: module for module, names in modules.items() for name in names.split()}

    def import_name(name: str) -> object:
        """Import a public name from where it lives."""
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        # These bring in a thousand modules; those that are imported later are few.
        with nullcontext() if {"mesa", "numba"} <= sys.modules.keys() else without_collection():
            value = getattr(import_module(f"mesa_swarm.{homes[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        """List the public names."""
        return sorted({*vars(sys.modules[package]), *homes})

    return import_name, names


class ImportedMethod:
    """A method that is a function of the same name in a module which is imported when it is first used."""

    def __init__(self, module: str) -> None:
        self._module = module  # without ``mesa_swarm.``

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the name."""
        self._name = name

    def __get__(self, instance: object, owner: type) -> Callable[..., Any]:
        """Return the function, with the instance, if there is one, as its first argument."""
        function: FunctionType = getattr(import_module(f"mesa_swarm.{self._module}"), self._name)
        return function.__get__(instance, owner)


@contextmanager
def without_collection(*, for_good: bool = False) -> Iterator[None]:
    """Suspend garbage collection for imports, which leave no garbage but a hundred thousand objects to look at.

    These count as old afterwards, so that the next collections pass over them. It is a fifth of the time from the
    first import to the first step. Where collection is switched off already, or parts of it are, nothing changes.

    Parameters
    ----------
    for_good : bool
        Whether no collection ever looks at them again, not even when the program ends: for programs, not for
        libraries, since all other objects there are at that moment are exempt too.

    Examples
    --------
    >>> with without_collection():
    ...     gc.isenabled()
    False
    >>> gc.isenabled()
    True
    """
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        if for_good:
            gc.freeze()
        elif not gc.get_freeze_count():  # objects that the program itself has exempted stay so
            gc.freeze()
            gc.unfreeze()
