"""What a rule's code uses, found without running it."""

import dis
import random
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

GENERATORS = (np.random.Generator, np.random.RandomState, np.random.BitGenerator, random.Random)


def uses_attribute(function: FunctionType, name: str) -> bool:
    """Tell whether a function, or one that it calls by name, asks anything for an attribute of this name.

    Examples
    --------
    >>> uses_attribute(lambda me: me.chance < 0.5, "chance")
    True
    """
    return any(name in _operands(part, "LOAD_ATTR", "LOAD_METHOD") for part in _functions(function))


def own_randomness(function: FunctionType) -> str | None:
    """Return the name of a source of random numbers that the function uses, or None.

    Examples
    --------
    >>> own_randomness(lambda me: np.random.random())
    'np.random'
    """
    for part in _functions(function):
        attributes = _operands(part, "LOAD_ATTR", "LOAD_METHOD", "IMPORT_FROM")
        for name, value in _values(part):
            if value is np and "random" in attributes:
                return f"{name}.random"
            if _is_random(value):
                return name
        for name in _operands(part, "IMPORT_NAME"):
            if name in ("random", "numpy.random") or (name == "numpy" and "random" in attributes):
                return name
    return None


def _is_random(value: Any) -> bool:
    if isinstance(value, ModuleType):
        return value.__name__ in ("random", "numpy.random")
    home = str(getattr(value, "__module__", ""))
    made = isinstance(value, GENERATORS) or isinstance(getattr(value, "__self__", None), GENERATORS)
    return made or home == "random" or home.startswith("numpy.random")


def _functions(function: FunctionType) -> list[FunctionType]:
    """Return a function and the functions in reach by the names that it uses, compiled ones as they were written."""
    found = [function]
    for part in found:
        called = (getattr(value, "py_func", value) for _, value in _values(part))
        found += [value for value in called if isinstance(value, FunctionType) and value not in found]
    return found


def _values(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield the global and enclosing names that a function uses, with what they stand for now."""
    names = _operands(function, "LOAD_GLOBAL", "LOAD_NAME")
    yield from ((name, function.__globals__[name]) for name in sorted(names) if name in function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # not yet assigned
            continue


def _operands(function: FunctionType, *operations: str) -> set[str]:
    """Return the names on which the function's code, and code nested in it, does one of these operations."""
    codes = [function.__code__]
    for code in codes:
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    steps = (step for code in codes for step in dis.get_instructions(code))
    return {step.argval for step in steps if step.opname in operations}
