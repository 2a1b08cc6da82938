"""The source of a model, as a fingerprint: runs of other code are other runs."""

import inspect
import sys
from hashlib import blake2b
from pathlib import Path
from types import CodeType

from mesa_swarm.gallery import PACKAGE

# What these contain is told apart by their versions.
VERSIONED = ("builtins", "mesa", "mesa_swarm")


def source_hash(model_class: type) -> str:
    """Return a fingerprint of the code of a model.

    It covers the files of the modules in which the class and its bases are written, those of the gallery too, and
    the code of their methods as it was loaded, which is all that there is of a class that was typed into a notebook.
    Packages with a version (mesa_swarm but for its gallery, and mesa) are left to it. Other files that a model
    imports, and other cells of a notebook, are not looked at: after a change in them, choose another folder for
    the results.

    Parameters
    ----------
    model_class : type

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> source_hash(find_model("boids")) == source_hash(find_model("boids"))
    True
    >>> source_hash(find_model("boids")) == source_hash(find_model("flocking"))
    False
    """
    found = blake2b(digest_size=8)
    for base in model_class.__mro__:
        if base.__module__.startswith(PACKAGE) or base.__module__.split(".")[0] not in VERSIONED:
            found.update(_file(base))
            found.update(repr(_methods(base)).encode())
    return found.hexdigest()


def _file(base: type) -> bytes:
    """Return the file in which a class is written, nothing if there is none."""
    path = getattr(sys.modules.get(base.__module__), "__file__", None)
    return Path(path).read_bytes() if path and Path(path).is_file() else b""


def _methods(base: type) -> list:
    """Return what the methods of a class do, by name."""
    members = sorted(vars(base).items())
    return [(name, _said(code)) for name, member in members for code in _codes(member)]


def _codes(member: object) -> list[CodeType]:
    parts = (member.fget, member.fset) if isinstance(member, property) else (member,)
    functions = [inspect.unwrap(part) for part in map(_bare, parts) if callable(part)]
    return [function.__code__ for function in functions if hasattr(function, "__code__")]


def _bare(member: object) -> object:
    return member.__func__ if isinstance(member, (staticmethod, classmethod)) else member


def _said(code: CodeType) -> tuple:
    """Return what a code object does, without where it was loaded from and where in memory it is."""
    return code.co_code.hex(), code.co_names, [_constant(value) for value in code.co_consts]


def _constant(value: object) -> object:
    if isinstance(value, CodeType):
        return _said(value)
    return sorted(map(repr, value)) if isinstance(value, frozenset) else repr(value)
