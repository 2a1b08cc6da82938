"""Objects that a stored state has made without their constructors: of which classes, and with which attributes.

A recording comes from anywhere. It could name any class that is loaded, and give an object of it any attributes, with
which its `step` or its `__del__` then works. So only classes that expect to be made are, with what they declare.
"""

import dis
import re
import sys
from collections.abc import Container
from functools import cache
from types import BuiltinFunctionType, FunctionType, WrapperDescriptorType
from typing import Any

from mesa.agent import Agent

from mesa_swarm.base.errors import RecordingError, shortened
from mesa_swarm.fire.spreading import Spreading
from mesa_swarm.kernels.part import Part
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.processes import Process
from mesa_swarm.model.scattering import Wander
from mesa_swarm.world.arena import ArenaAgent

# The attribute by which a class declares that it may be made so.
RESUMABLE = "resumable"
# Processes that ship with the package, which any model may have been given.
OF_PACKAGE = (Spreading, Wander)
ADDABLE = {"process": Process, "part": Part}
FUNCTIONS = (FunctionType, BuiltinFunctionType, WrapperDescriptorType)
# What Python adds to classes that derive from a protocol.
OF_PROTOCOLS = ("_abc_impl", "_is_protocol", "_is_runtime_protocol")


def check_addable_class(kind: type, what: str) -> None:
    """Refuse a class of processes, or parts, which is `what`, that no constructor may be skipped of.

    Raises
    ------
    RecordingError
        If it does not derive from `Process` or `Part`, or has `__del__`; processes may declare ``resumable = True``.

    Examples
    --------
    >>> class Tide(Process):
    ...     level: float = 0.0
    >>> check_addable_class(Tide, "process")
    """
    base = ADDABLE[what]
    is_permitted = what == "process" and (kind in OF_PACKAGE or getattr(kind, RESUMABLE, False) is True)
    if base not in kind.__mro__ and not is_permitted:
        raise RecordingError(
            f"{what} {kind.__name__} is not one that the model's constructor adds, and its class does not derive from "
            f"mesa_swarm.{base.__name__}; add the {what} in the constructor, or derive its class"
        )
    _check_no_del(kind)


def check_agent_class(kind: type, present: bool) -> None:
    """Refuse a class of agents that no constructor may be skipped of.

    Permitted are classes of Mesa's own, those of which the model's constructor makes agents, `present`, and those that
    declare ``resumable = True``.

    Raises
    ------
    RecordingError
    """
    if not (present or _is_mesas(kind) or getattr(kind, RESUMABLE, False) is True):
        raise RecordingError(
            f"agents of class {kind.__name__} are not made by the model's constructor, and the class does not declare "
            "resumable = True; declare that, or let the constructor make one"
        )
    _check_no_del(kind)


def check_made(instance: Any, names: Any, like: Any = None) -> None:
    """Refuse attributes of an object made without its constructor that its class does not declare.

    Declared are what has an annotation or a value in the class or a base, and slots, besides what Mesa's own classes
    assign. Of agents permitted are also the attributes of one that the model's constructor makes, `like`, and what
    methods of such a class assign; of Mesa's own classes all.
    """
    kind = type(instance)
    if isinstance(instance, Agent) and _is_mesas(kind):
        return
    attributes = declared_attributes(kind) | assigned_attributes(kind, like is None)  # type: ignore[arg-type]
    attributes |= frozenset(getattr(like, "__dict__", ()))
    odd = sorted(name for name in names if name not in attributes)
    if odd:
        raise RecordingError(
            f"attribute {shortened(odd[0])} of {kind.__name__} is not declared by its class; annotate it there, as in "
            f"{odd[0]:.40}: float = 0.0"
        )


@cache
def declared_attributes(kind: type) -> frozenset[str]:
    """Return the names that a class or a base annotates, gives a value that is not a method, or has as a slot.

    Examples
    --------
    >>> class Tide(Process):
    ...     level: float
    ...     steps = 0
    >>> sorted(declared_attributes(Tide))
    ['level', 'steps']
    """
    names: set[str] = set()
    for base in kind.__mro__[:-1]:
        members = vars(base)
        names |= set(members.get("__annotations__", ()))
        names |= {name for name, value in members.items() if not _is_code(value)}
    return frozenset(name for name in names if name not in OF_PROTOCOLS and not name.startswith("__"))


@cache
def assigned_attributes(kind: type, of_mesa: bool = False) -> frozenset[str]:
    """Return the names of attributes that the methods of a class and its bases assign, or of Mesa's classes only."""
    bases = [base for base in kind.__mro__ if _is_mesas(base) or not of_mesa]
    methods = [value for base in bases for value in vars(base).values() if isinstance(value, FunctionType)]
    steps = (step for method in methods for step in dis.get_instructions(method))
    return frozenset(step.argval for step in steps if step.opname == "STORE_ATTR")


def _is_mesas(kind: type) -> bool:
    return kind.__module__.partition(".")[0] == "mesa"


def _is_code(value: Any) -> bool:
    """Return whether a value of a class is a method or a property, rather than a slot or a plain value."""
    return isinstance(value, (*FUNCTIONS, property, classmethod, staticmethod))


def _check_no_del(kind: type) -> None:
    if hasattr(kind, "__del__"):
        raise RecordingError(f"{kind.__name__} has a method __del__, and is not made without its constructor")


def find_agent_class(module: object, name: object, present: Container[type] | None, *, handles: bool = False) -> Any:
    """Return the class of agents of this name that is loaded, which may be one of `handles` of robots and bodies.

    It is checked, unless `present`, the classes of which the model's constructor makes agents, is None.
    """
    kind = find_loaded_class(Agent, str(module), str(name))
    if kind is None or (issubclass(kind, ArenaAgent) and not handles):
        raise RecordingError(f"agents of class {shortened(name)} cannot be made: import it from {shortened(module)}")
    if present is not None and not issubclass(kind, ArenaAgent):
        check_agent_class(kind, kind in present)
    return kind


def classes_near(model: EngineModel) -> list[type]:
    """Return the classes in the modules that define the class of a model, which are loaded: nothing is imported."""
    names = dict.fromkeys(kind.__module__ for kind in type(model).__mro__ if issubclass(kind, EngineModel))
    modules = [sys.modules[name] for name in names if name in sys.modules]
    return [kind for module in modules for kind in vars(module).values() if isinstance(kind, type)]


def is_class(kind: type, module: str, name: str) -> bool:
    """Return whether a class may be one that was recorded: its name is, and the last word of its module.

    A file may be run as a program, whose module is called ``__main__``, imported, or loaded by its path.
    """
    words = {_last_word(module), _last_word(kind.__module__)}
    return kind.__qualname__ == name and (len(words) == 1 or "__main__" in words)


def _last_word(module: str) -> str:
    """Return the last word of a module's address, without what `gallery` adds where a file's name is taken."""
    return re.sub(r"_[0-9a-f]{8}$", "", module.rpartition(".")[2])


def find_loaded_class(base: type, module: str, name: str) -> type | None:
    """Return the class that was recorded: a base or a loaded class derived from it; None without one, or if unclear."""
    alike = [kind for kind in family(base) if is_class(kind, module, name)]
    exact = [kind for kind in alike if kind.__module__ == module]
    return (exact or alike)[0] if exact or len(alike) == 1 else None


def family(base: type) -> list[type]:
    """Return a class and all loaded classes that are derived from it."""
    children: list[type] = base.__subclasses__()
    return [base, *(descendant for child in children for descendant in family(child))]
