"""Models by name or address: the gallery, installed packages, modules, and files.

A name is that of a model of the gallery, or of an entry point of the group ``mesa_swarm.models`` of an installed
package. An address is ``package.module:Class`` or ``./file.py:Class``.
"""

import inspect
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, spec_from_file_location
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import TYPE_CHECKING, Any

from mesa_swarm.base.errors import (
    InvalidValueError,
    SwarmError,
    UnknownNameError,
    locate_error,
    shortened,
    unknown_name,
    without_middle,
)
from mesa_swarm.base.files import check_present_format

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["find_model"]

PACKAGE = "mesa_swarm.models"
GROUP = "mesa_swarm.models"
BASE = "mesa_swarm.swarm_model"  # of SwarmModel itself
OLD_BASE = "mesa_swarm.model"  # the same in recordings of version 0.1.0
FILE = re.compile(r"(?P<file>.+\.py)(?::(?P<name>[\w.]+))?", re.DOTALL)
MODULE = re.compile(r"(?P<module>\w+(?:\.\w+)*):(?P<name>\w+(?:\.\w+)*)")
# A name that can be part of a file's.
PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,59}")
EXPECTED = "expected a subclass of mesa_swarm.SwarmModel"
FORMS = "package.module:Class or ./file.py:Class"


def gallery_names() -> list[str]:
    """Return the names of the models that are part of mesa_swarm, sorted, without importing them."""
    modules = iter_modules(import_module(PACKAGE).__path__)
    return sorted(module.name for module in modules if not module.name.startswith("_"))


def model_names() -> list[str]:
    """Return the names of all models, those of installed packages too, sorted, without importing them."""
    return sorted({*gallery_names(), *_find_entry_points(tuple(sys.path))})


def loaded_models() -> tuple[dict[str, type], dict[str, str]]:
    """Return the classes of all models by name, and by the other names why their models cannot be loaded."""
    models, faults = {}, {}
    for name in model_names():
        try:
            models[name] = find_model(name)
        except SwarmError as error:
            faults[name] = str(error)
    return models, faults


def check_model_name(name: str) -> str:
    """Return a name or an address of a model if it can be one, without importing anything."""
    if isinstance(name, str) and (
        name in gallery_names() or is_address(name) or name in _find_entry_points(tuple(sys.path))
    ):
        return name
    if isinstance(name, str):
        check_present_format(name)
    raise UnknownNameError(f"{unknown_name('model', name, model_names(), beside=4 + len(FORMS))}; or {FORMS}")


def is_address(name: str) -> bool:
    """Return whether this has the form of an address."""
    return isinstance(name, str) and bool(FILE.fullmatch(name) or MODULE.fullmatch(name))


def find_model(name: str) -> type:
    """Return the class of a model by its name or address.

    Parameters
    ----------
    name : str
        Of a model of the gallery, of an installed package, or an address. Of a file with a single model,
        ``:Class`` may be left out.

    Returns
    -------
    type
        A subclass of SwarmModel.

    Raises
    ------
    UnknownNameError
        If there is no such name, file, module or class.
    InvalidValueError
        If the module raises an error when it is imported, or the class is not a SwarmModel.

    Examples
    --------
    >>> find_model("boids") is find_model("mesa_swarm.models.boids:Boids")
    True
    """
    check_model_name(name)
    if name in gallery_names():
        model_class: type = getattr(import_module(f"{PACKAGE}.{name}"), class_name(name))
        return model_class
    if name in _find_entry_points(tuple(sys.path)):
        return _of_package(name, _find_entry_points(tuple(sys.path))[name])
    if file := FILE.fullmatch(name):
        return _class_in(_import_file(file["file"]), file["name"], name)
    module = MODULE.fullmatch(name)
    return _class_in(_import_module(module["module"], name), module["name"], name)  # type: ignore[index]


def object_at(address: str) -> Any:
    """Return what a module or a file has by this name: a function, a class, an object.

    Parameters
    ----------
    address : str
        ``package.module:name`` or ``./file.py:name``; packages in the current folder are found too.

    Raises
    ------
    UnknownNameError
        If there is no such file, module or name.
    InvalidValueError
        If it is not an address, or the module raises an error when it is imported.

    Examples
    --------
    >>> object_at("math:hypot")(3, 4)
    5.0
    """
    file, dotted = FILE.fullmatch(address), MODULE.fullmatch(address)
    if dotted is None and (file is None or file["name"] is None):
        raise InvalidValueError(f"{shortened(address)}: expected package.module:name or ./file.py:name")
    if file and file["name"]:
        module, name = _import_file(file["file"], "Python file"), file["name"]
    else:
        module, name = _import_module(dotted["module"], address), dotted["name"]  # type: ignore[index]
    value: Any = module
    for part in name.split("."):
        if not hasattr(value, part):
            raise UnknownNameError(without_middle(f"{address}: there is no {name!r} in {module.__name__}"))
        value = getattr(value, part)
    return value


def class_name(name: str) -> str:
    """Return the name of the class in the module of this name in the gallery."""
    return "".join(word.capitalize() for word in name.split("_"))


def short_name(name: str) -> str:
    """Return a name for files and titles of what a model's name or address stands for.

    Examples
    --------
    >>> short_name("fire_fighting"), short_name("./mine.py:AntTrails"), short_name("./mine.py")
    ('fire_fighting', 'ant_trails', 'mine')
    """
    if not is_address(name):
        return name if PLAIN.fullmatch(name) else "model"
    file = FILE.fullmatch(name)
    last = Path(file["file"]).stem if file and not file["name"] else name.rpartition(":")[2].rpartition(".")[2]
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", last).lower()
    return snake if PLAIN.fullmatch(snake) else "model"


def description(model_class: type) -> str:
    """Return the first line of a model's own docstring, empty if it has none."""
    return inspect.cleandoc(vars(model_class).get("__doc__") or "").partition("\n")[0]


def model_address(model_class: type) -> str:
    """Return module and class as an address, which is the same on every machine and in every process.

    Examples
    --------
    >>> model_address(find_model("boids"))
    'mesa_swarm.models.boids:Boids'
    """
    file = _FILES.paths.get(model_class.__module__)
    return f"{Path(file).stem if file else model_class.__module__}:{model_class.__qualname__}"


def shipped_class(module: str, name: str) -> type | None:
    """Return a class of mesa_swarm by its address, None for any other: importing a module runs it."""
    if (module, name) == (OLD_BASE, "SwarmModel"):
        module = BASE
    if module != BASE and module not in {f"{PACKAGE}.{model}" for model in gallery_names()}:
        return None
    model_class = getattr(import_module(module), name, None)
    return model_class if isinstance(model_class, type) and model_class.__module__ == module else None


@cache
def _find_entry_points(path: tuple[str, ...]) -> "dict[str, tuple[EntryPoint, ...]]":
    """Return the entry points of installed packages by name; `path` is that of the interpreter, for the cache."""
    from importlib.metadata import entry_points  # noqa: PLC0415 - slow to load

    by_name: dict[str, dict[str, EntryPoint]] = {}
    for point in entry_points(group=GROUP):
        by_name.setdefault(point.name, {})[point.value] = point
    return {name: tuple(points[value] for value in sorted(points)) for name, points in sorted(by_name.items())}


def _of_package(name: str, points: "Sequence[EntryPoint]") -> type:
    """Return the class of an entry point."""
    if len(points) > 1:
        raise InvalidValueError(
            f"model {name!r} is in several packages; give one of {', '.join(p.value for p in points)}"
        )
    address = points[0].value.partition("[")[0].replace(" ", "")
    of = f"{name} (an entry point of {points[0].dist.name if points[0].dist else 'a package'})"
    parts = MODULE.fullmatch(address)
    if parts is None:
        raise InvalidValueError(f"{of} is {shortened(points[0].value)}; expected package.module:Class")
    try:
        return _class_in(_import_module(parts["module"], address), parts["name"], address)
    except SwarmError as error:
        raise type(error)(without_middle(f"{of}: {error}")) from None


def _import_file(file: str, what: str = "Python file with a model") -> ModuleType:
    """Return the module of a file, which is imported once in a process."""
    path = Path(file).expanduser()
    try:
        is_there = path.is_file()
    except (OSError, ValueError):  # a name too long for the system, or with a null byte
        is_there = False
    if not is_there:
        raise UnknownNameError(f"{shortened(file)}: no such file; expected the path of a {what}")
    path = path.resolve()
    name = _FILES.name_of(path)
    make_importable({name: str(path)}, (str(path.parent),))
    return _import_or_refuse(name, file)


def _import_module(module: str, address: str) -> ModuleType:
    """Return a module; packages in the current folder are found too, after all others."""
    first = module.partition(".")[0]
    if first not in sys.modules and _origin(first) is None:
        make_importable({}, (os.getcwd(),))
    try:
        return _import_or_refuse(module, address)
    except ModuleNotFoundError as error:
        raise UnknownNameError(f"{address}: there is no module {error.name!r}; expected {FORMS}") from None


def _import_or_refuse(module: str, address: str) -> ModuleType:
    """Import a module; an error in it becomes one line with the place. One that is not there raises that error."""
    try:
        return import_module(module)
    except (Exception, SystemExit) as error:  # a module of a user's may raise anything
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise
        text = f"{address} cannot be imported: {locate_error(error)}"
        raise InvalidValueError(without_middle(text)) from error


def _class_in(module: ModuleType, name: str | None, address: str) -> type:
    """Return a model of a module, without a name the only one that it defines."""
    models = _models_in(module)
    if name is None:
        if len(models) != 1:
            fault = f"has several models; add one of :{', :'.join(models)}" if models else f"has no model; {EXPECTED}"
            raise InvalidValueError(without_middle(f"{address} {fault}"))
        return models[next(iter(models))]
    kind: Any = module
    for part in name.split("."):
        kind = getattr(kind, part, None)
    if kind is None:
        names = ", ".join(models) or "none"
        raise UnknownNameError(without_middle(f"{address}: there is no class {name!r}; known models: {names}"))
    if not (isinstance(kind, type) and issubclass(kind, _base())):
        raise InvalidValueError(without_middle(f"{address} is {shortened(kind)}; {EXPECTED}"))
    return kind


def _models_in(module: ModuleType) -> dict[str, type]:
    """Return the models that a module itself defines, by name."""
    classes = {value.__name__: value for value in vars(module).values() if isinstance(value, type)}
    of_module = {name: kind for name, kind in sorted(classes.items()) if kind.__module__ == module.__name__}
    return {name: kind for name, kind in of_module.items() if issubclass(kind, _base()) and not name.startswith("_")}


def _base() -> type:
    return import_module(BASE).SwarmModel


@dataclass(frozen=True, slots=True)
class Imported:
    """The files of models that a process has imported, and the folders that it added to its path.

    A process that unpickles this can import the same modules: it comes before the classes that it is for.
    """

    files: dict[str, str]
    folders: tuple[str, ...]

    def __reduce__(self) -> tuple:
        return make_importable, (self.files, self.folders)


def list_imported() -> Imported:
    """Return what another process needs to import the same models."""
    return Imported(dict(_FILES.paths), tuple(folder for folder in _FILES.folders if folder in sys.path))


def make_importable(files: dict[str, str], folders: Sequence[str]) -> Imported:
    """Make the modules of files, by name, and those in folders importable, after all others."""
    _FILES.paths |= files
    _FILES.folders |= dict.fromkeys(folders)
    sys.path += [folder for folder in folders if folder not in sys.path]
    return list_imported()


class FileFinder:
    """Finds the modules of files by the names that were given to them; it stands last in ``sys.meta_path``."""

    def __init__(self) -> None:
        self.paths: dict[str, str] = {}
        self.folders: dict[str, None] = {}

    def name_of(self, path: Path) -> str:
        """Return the name of a file's module: that of the file, unless another module has it already."""
        stem = path.stem.replace(".", "_")
        file = self.paths.get(stem) or _origin(stem)
        if file in (None, str(path)):
            return stem
        return f"{stem}_{blake2b(str(path).encode(), digest_size=4).hexdigest()}"

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Return how a module is made, None if it is not that of a file."""
        return spec_from_file_location(name, self.paths[name]) if name in self.paths else None


def _origin(module: str) -> str | None:
    """Return the file of a module that can be imported, None if there is none."""
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):
        return getattr(sys.modules.get(module), "__file__", None)
    return spec.origin and str(Path(spec.origin).resolve()) if spec else None


_FILES = FileFinder()
sys.meta_path.append(_FILES)  # type: ignore[arg-type]  # a finder by its method
