"""Fingerprints of code and of runs: whether a stored outcome is still that of the code that would be run now."""

import inspect
import json
import re
import sys
from collections.abc import Callable, Iterable
from functools import cache, partial
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from types import CodeType

from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import PACKAGE as MODELS

PACKAGE = Path(__file__).resolve().parent.parent
# The version number of these packages stands for their content.
VERSIONED = ("builtins", "mesa", "mesa_swarm")
# Files that decide the result of a run, apart from those that define the runs.
ENGINE = (
    *("kernels", "geometry", "world", "maps", "robots", "physics", "control", "model", "fire", "learning", "analysis"),
    *("base/streams.py", "swarm_model.py"),
)


def fingerprint(*parts: object, default: Callable | None = None) -> str:
    """Return the key of a run: a fingerprint of all that decides its outcome, as JSON."""
    return blake2b(json.dumps(parts, sort_keys=True, default=default).encode(), digest_size=16).hexdigest()


def files_hash(paths: Iterable[Path]) -> str:
    """Return a fingerprint of the content of files; of a folder all Python files in it."""
    digest = blake2b(digest_size=8)
    for path in paths:
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.read_bytes())
    return digest.hexdigest()


@cache
def engine_hash(*more: str, models: bool = False) -> str:
    """Return a fingerprint of the files of the engine, its rules and measures.

    `more` are other files or folders, absolute or relative to the package; with `models` the gallery counts too.
    """
    gallery = [Path(next(iter(import_module(MODELS).__path__)))] if models else []
    return files_hash([*(PACKAGE / name for name in (*ENGINE, *more)), *gallery])


def source_hash(model_class: type) -> str:
    """Return a fingerprint of the code of a model.

    It covers the files of the modules in which the class and its bases are written, those of the gallery too, and
    the code of their methods as it was loaded, which is all that there is of a class that was typed into a notebook.
    Packages with a version (mesa_swarm without its gallery, and mesa) are represented by it. Other files that a model
    imports, and other cells of a notebook, are not covered: after a change in them, choose another folder for
    the results.
    """
    digest = blake2b(digest_size=8)
    for base in model_class.__mro__:
        if base.__module__.startswith(MODELS) or base.__module__.split(".")[0] not in VERSIONED:
            path = getattr(sys.modules.get(base.__module__), "__file__", None)
            digest.update(Path(path).read_bytes() if path and Path(path).is_file() else b"")
            digest.update(repr(_methods(base)).encode())
    return digest.hexdigest()


def shown_value(value: object) -> object:
    """Return a parameter's value as it is stored: a map by name and content."""
    if not isinstance(value, Map):
        return value
    return f"{value.name} ({blake2b(value.to_toml().encode(), digest_size=8).hexdigest()})"


def function_hash(function: Callable) -> str:
    """Return a fingerprint of a function that is called with a model: its code, defaults and the values it closes over.

    Of a partial it covers the arguments too, of an object with ``__call__`` its attributes and its class.
    """
    if isinstance(function, partial):
        return fingerprint(function_hash(function.func), _shown(function.args), _shown(function.keywords))
    if not hasattr(function, "__code__"):
        return fingerprint(source_hash(type(function)), _shown(function), _shown(getattr(function, "__dict__", {})))
    cells = [cell.cell_contents for cell in getattr(function, "__closure__", None) or ()]
    values = [function_hash(value) if hasattr(value, "__code__") else _shown(value) for value in cells]
    return fingerprint(
        function.__qualname__, _instructions(function.__code__), _shown(function.__defaults__), values, default=str
    )


def without_addresses(text: str) -> str:
    """Return a text without the addresses of objects in memory, which differ between processes."""
    return re.sub(r" at 0x[0-9a-fA-F]+", "", text)


def _shown(value: object) -> str:
    return without_addresses(repr(value))


def _methods(base: type) -> list:
    """Return what the methods of a class do, by name."""
    members = sorted(vars(base).items())
    return [(name, _instructions(code)) for name, member in members for code in _codes(member)]


def _codes(member: object) -> list[CodeType]:
    parts = (member.fget, member.fset) if isinstance(member, property) else (member,)
    functions = [inspect.unwrap(part) for part in map(_bare, parts) if callable(part)]
    return [function.__code__ for function in functions if hasattr(function, "__code__")]


def _bare(member: object) -> object:
    return member.__func__ if isinstance(member, (staticmethod, classmethod)) else member


def _instructions(code: CodeType) -> tuple:
    """Return what a code object does, without the file and the address from which it was loaded."""
    return code.co_code.hex(), code.co_names, [_constant(value) for value in code.co_consts]


def _constant(value: object) -> object:
    if isinstance(value, CodeType):
        return _instructions(value)
    return sorted(map(repr, value)) if isinstance(value, frozenset) else repr(value)
