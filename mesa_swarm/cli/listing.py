"""What can be run: list. Sources of the gallery's models are read, which takes milliseconds, not run."""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.base.wording import in_brief
from mesa_swarm.cli.lines import print_lines
from mesa_swarm.cli.options import known_model
from mesa_swarm.model.gallery import PACKAGE, class_name, description, find_model, gallery_names, model_names

ROOT = PACKAGE.partition(".")[0]
# Where its help stands among the arguments of what a parameter is declared with.
HELP = {"Slider": 3, "Choice": 1}
PLAIN = ("bool", "float", "int", "str")

commands = typer.Typer()


@commands.command("list")
def list_models(
    model: Annotated[
        str | None, typer.Argument(callback=known_model, metavar="[MODEL]", help="All models by default.")
    ] = None,
) -> None:
    """List the models, those of installed packages too, their parameters and the defaults."""
    for name in model_names() if model is None else (model,):
        try:
            lines = listed(name)
        except SwarmError as error:
            if model is not None:
                raise
            lines = [f"    not loaded: {error}"]
        for line in (name, *lines):
            print_lines([line], 29 if line.startswith("      ") else 0)


def listed(name: str) -> list[str]:
    """Return what a model is and its parameters, as lines.

    Only a model of the gallery is known to be one without an import; any other is imported, which may raise errors.
    """
    if name in gallery_names():
        try:
            folder = next(iter(import_module(PACKAGE).__path__))
            return Source(Path(folder, f"{name}.py").read_bytes()).lines(class_name(name))
        except (NotPlainError, OSError):
            pass
    return lines_of(find_model(name))


def lines_of(model: type) -> list[str]:
    """Return the lines of a class."""
    from mesa_swarm.model.parameters import parameters_of

    return _lines(description(model), [(one.name, one.default, one.help) for one in parameters_of(model).values()])


def _lines(first: str, parameters: Iterable[tuple[str, Any, str]]) -> list[str]:
    """Return a description, if there is one, and the name, default and help of each parameter."""
    settings = [(f"{name}={in_brief(default)}", text) for name, default, text in parameters]
    return [f"    {first}"] * bool(first) + [f"      {setting:28} {text}".rstrip() for setting, text in settings]


class NotPlainError(Exception):
    """A source has something that only running it would explain."""


class Source:
    """The source of a module with a model; it is not run, and nothing but mesa_swarm is imported for it."""

    def __init__(self, text: str | bytes) -> None:
        self.module = ast.parse(text)

    def lines(self, name: str) -> list[str]:
        """Return the lines of the class of this name; what they need that is not plain raises NotPlainError."""
        model = _only(node for node in self.module.body if isinstance(node, ast.ClassDef) and node.name == name)
        start = _only(node for node in model.body if isinstance(node, ast.FunctionDef) and node.name == "__init__")
        if model.decorator_list or start.decorator_list:
            raise NotPlainError
        own = list(self._parameters(start.args))
        known = [name for name, _, _ in own]
        others = [one for one in _common() if model.bases and one[0] not in known]
        return _lines((ast.get_docstring(model) or "").partition("\n")[0], [*own, *others])

    def _parameters(self, given: ast.arguments) -> Iterator[tuple[str, Any, str]]:
        """Yield name, default and help of each parameter."""
        if len(given.posonlyargs) + len(given.args) != 1:
            raise NotPlainError
        for parameter, default in zip(given.kwonlyargs, given.kw_defaults, strict=True):
            if parameter.arg != "rng":
                value = None if default is None else self._value(default)
                yield parameter.arg, value, _help(parameter.annotation, isinstance(value, (int, float)))

    def _value(self, node: ast.expr) -> Any:
        """Return the value of a literal, or of a name, an attribute or a call without arguments."""
        match node:
            case ast.Attribute(value, name):
                return getattr(self._value(value), name)
            case ast.Call(function, [], []):
                return self._value(function)()
            case ast.Name(name):
                return self._named(name)
        try:
            return ast.literal_eval(node)
        except ValueError:
            raise NotPlainError from None

    def _named(self, name: str) -> Any:
        """Return the value of a name that is assigned or imported from mesa_swarm, and only once."""
        if self._bound[name] == 1:
            for line in self.module.body:
                match line:
                    case ast.Assign([ast.Name(target)], value) if target == name:
                        return self._value(value)
                    case ast.ImportFrom(str(source), names) if (name, None) in [(a.name, a.asname) for a in names]:
                        if source.partition(".")[0] == ROOT:
                            return getattr(import_module(source), name)
        raise NotPlainError

    @cached_property
    def _bound(self) -> Counter[str]:
        """How often each name is assigned, imported or defined, anywhere in the module."""
        return Counter(name for node in ast.walk(self.module) if (name := _bound_by(node)))


@cache
def _common() -> list[tuple[str, Any, str]]:
    """Return name, default and help of the parameters that every model takes."""
    package = Path(__file__).parent.parent
    texts = [Path(package, name).read_bytes() for name in ("model/engine_model.py", "model/parameters.py")]
    module, declared = map(ast.parse, texts)
    hints = {line.targets[0].id: line.value for line in declared.body if _is_alias(line)}  # type: ignore[attr-defined]
    model = _only(node for node in module.body if isinstance(node, ast.ClassDef) and node.name == "EngineModel")
    start = _only(node for node in model.body if isinstance(node, ast.FunctionDef) and node.name == "__init__").args
    pairs = zip(start.kwonlyargs, start.kw_defaults, strict=True)
    named = [(one.arg, first, hints.get(getattr(one.annotation, "id", ""))) for one, first in pairs if first]
    return [(name, ast.literal_eval(first), _help(hint, True)) for name, first, hint in named if hint]


def _is_alias(line: ast.stmt) -> bool:
    """Return whether a line gives a name to an annotation."""
    match line:
        case ast.Assign([ast.Name()], ast.Subscript(ast.Name("Annotated"))):
            return True
    return False


def _bound_by(node: ast.AST) -> str | None:
    """Return the name that a part of a program binds, if any."""
    match node:
        case ast.Name(name, ast.Store()) | ast.FunctionDef(name) | ast.ClassDef(name) | ast.arg(name):
            return name
        case ast.alias(name, other):
            return other or name
    return None


def _only(nodes: Iterable[Any]) -> Any:
    found = list(nodes)
    if len(found) != 1:
        raise NotPlainError
    return found[0]


def _help(annotation: ast.expr | None, is_number: bool) -> str:
    """Return the help in an annotation such as ``Annotated[int, Slider(1, 50, 1, "robots")]``."""
    match annotation:
        case ast.Name(name) if name in PLAIN:
            return ""
        case ast.Subscript(ast.Name("Annotated"), ast.Tuple([_, ast.Call(ast.Name(kind), values, [])])):
            if kind in HELP and len(values) > HELP[kind] and (is_number or kind == "Choice"):
                return str(ast.literal_eval(values[HELP[kind]]))
    raise NotPlainError
