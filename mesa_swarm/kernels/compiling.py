"""What is compiled while a user waits: counted, and noted in place of a progress bar.

A function is compiled once for each set of types with which it is called. Which of these the first steps of a model of
the gallery need is in `NEEDED`, a file that ``python tests/support/compiled_functions.py`` writes from counted runs.
"""

import gc
import json
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from numba.core import event

from mesa_swarm.base.progress import note
from mesa_swarm.kernels.code_files import PACKAGE, file_of, is_stored, list_all_folders, name_types, why_not_stored
from mesa_swarm.kernels.compiled import stem_of
from mesa_swarm.kernels.digests import FUNCTIONS

NEEDED = Path(__file__).with_name("needed.json")
# What is needed by every model of the gallery, in that file.
EVERY = "every"
MODELS = f"{PACKAGE.name}.models."
# Imported when something is to be compiled; it imports this module.
PRECOMPILE = f"{PACKAGE.name}.kernels.precompile"


class Compilation(event.Listener):
    """The functions of the package that this process has compiled, and those that its models need."""

    def __init__(self) -> None:
        self.compiled: dict[str, None] = {}
        self.expected: dict[str, None] = {}
        self._models: dict[tuple[str, ...], None] = {}
        self._exact = True
        self._depth, self._collects = 0, False
        # Whether no other processes are to help.
        self.alone = False

    def expect(self, model_class: type) -> None:
        """Count what the first steps of such a model need from now on; costs nothing until something is compiled."""
        self._models[tuple(base.__module__ for base in model_class.__mro__)] = None

    def lacks(self, model_class: type) -> bool:
        """Return whether something that a model of the gallery needs is not compiled; of others it is not known."""
        names, exact = needed_by(base.__module__ for base in model_class.__mro__)
        return exact and not stored_functions(names).union(self.compiled).issuperset(names)

    def on_start(self, event: Any) -> None:
        """Show how far it is, before a function is compiled."""
        self._pause_collection()
        if event.data["dispatcher"].py_func in FUNCTIONS:
            self._resolve()
            self._show()

    def on_end(self, event: Any) -> None:
        """Count a function that has been compiled."""
        self._resume_collection()
        dispatcher = event.data["dispatcher"]
        if dispatcher.py_func not in FUNCTIONS:
            return
        self.compiled[name_of(dispatcher.py_func, event.data["args"])] = None
        self._show()

    def _pause_collection(self) -> None:
        """Let Python not look for garbage meanwhile: it would go through all that Numba holds, again and again."""
        if self._depth == 0:
            self._collects = gc.isenabled()
            gc.disable()
        self._depth += 1

    def _resume_collection(self) -> None:
        self._depth -= 1
        if self._depth == 0 and self._collects:
            gc.enable()

    def text(self) -> str:
        """Return how far it is in words, "" if nothing more is expected."""
        total = len(self.compiled | self.expected)
        missing = self.expected.keys() - self.compiled.keys()
        count = total - len(missing - stored_functions(missing))
        if count == total and self._exact:
            return ""
        return compiling_progress(count, total, self._exact)

    def _resolve(self) -> None:
        """Find out what the models that were made since the last time need and is not there."""
        models, self._models = self._models, {}
        if not models:
            return
        for modules in models:
            names, exact = needed_by(modules)
            stored_names = stored_functions(names)
            self.expected |= dict.fromkeys(name for name in names if name not in stored_names)
            self._exact = self._exact and exact
        if not self.alone and not why_not_stored():
            self.alone = True
            import_module(PRECOMPILE).start_compiling(list(self.expected))

    def _show(self) -> None:
        note(self.text())


def compiling_progress(done: int, total: int, exact: bool = True) -> str:
    """Return how far compiling is.

    Examples
    --------
    >>> compiling_progress(34, 60), compiling_progress(34, 60, exact=False)
    ('compiling, once per installation: 34 of 60', 'compiling, once per installation: 34 of at least 60')
    """
    return f"compiling, once per installation: {done} of {'' if exact else 'at least '}{total}"


def name_of(function: Any, arguments: Iterable[Any]) -> str:
    """Return the name by which a function of the package, for arguments of these types, is counted.

    Examples
    --------
    >>> from numba import types
    >>> from mesa_swarm.geometry.overlap import wrap_angle
    >>> name_of(wrap_angle.py_func, (types.float64,))
    'geometry.overlap.wrap_angle float64'
    """
    return f"{stem_of(function)} {name_types(arguments)}"


def stored_functions(names: Iterable[str]) -> set[str]:
    """Return which of these functions are compiled already for this machine, in whole files on disk."""
    return {name for name in names if (file := _file_of(name)) is not None and is_stored(file)}


def code_folders(names: Iterable[str]) -> tuple[Path, ...]:
    """Return the folders in which machine code of some of these functions is stored."""
    files = [_file_of(name) for name in names]
    return tuple(place for place in list_all_folders() if any((place / file).exists() for file in files if file))


def _file_of(name: str) -> str | None:
    """Return the file of a function's code, None if there is no such function."""
    stem, _, words = name.partition(" ")
    try:
        return file_of(stem, words, function_named(stem)._cache.digest() or "")
    except (ImportError, AttributeError):
        return None


@cache
def function_named(stem: str) -> Any:
    """Return the compiled function of a name, as `compiled.stem_of` returns it."""
    module, _, attribute = stem.rpartition(".")
    return getattr(import_module(f"{PACKAGE.name}.{module}"), attribute)


def needed_functions() -> dict[str, list[str]]:
    """Return the names of the functions that the first steps of each model of the gallery need, by its name."""
    table = _table()
    return {model: table[EVERY] + more for model, more in table.items() if model != EVERY}


def needed_by(modules: Iterable[str]) -> tuple[list[str], bool]:
    """Return what a model needs, of the modules of its class and its bases, and whether that is all.

    Of a subclass of a model of the gallery it is at least what that model needs, of any other what all do.
    """
    table = _table()
    for place, module in enumerate(modules):
        model = module.removeprefix(MODELS)
        if module.startswith(MODELS) and model in table:
            return table[EVERY] + table[model], place == 0
    return table[EVERY], False


@cache
def _table() -> dict[str, list[str]]:
    return json.loads(NEEDED.read_text(encoding="utf-8"))


compilation = Compilation()
event.register("numba:compile", compilation)
