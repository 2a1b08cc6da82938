"""What type checkers are told: every function that people call says what it takes and returns."""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import mesa_swarm
from mesa_swarm import environments

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "mesa_swarm"
MYPY = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]
# Numba infers the types of what these decorate, and compares the signatures of overloads with each other.
FOR_NUMBA = {"compiled", "overload"}


def files_of(pattern: str) -> list[Path]:
    """Return the files that a module pattern of mypy's settings means."""
    path = ROOT / pattern.removesuffix(".*").replace(".", "/")
    return sorted(path.rglob("*.py")) if pattern.endswith(".*") else [path.with_suffix(".py")]


def exempted() -> list[str]:
    return next(part["module"] for part in MYPY["overrides"] if part.get("disallow_untyped_defs") is False)


KERNELS = [path for pattern in exempted() for path in files_of(pattern)]


def functions_without_types(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and not FOR_NUMBA & set(map(name_of, node.decorator_list)):
            given = node.args
            arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
            untyped = [a for a in arguments if a and a.annotation is None and a.arg not in ("self", "cls")]
            if untyped or node.returns is None:
                yield f"{path.name}:{node.lineno} {node.name}"


def name_of(decorator: ast.expr) -> str:
    return ast.unparse(decorator.func if isinstance(decorator, ast.Call) else decorator)


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_what_numba_compiles_is_without_types_where_mypy_does_not_ask_for_them(path):
    assert not list(functions_without_types(path))


def test_a_function_without_types_is_found(tmp_path):
    file = tmp_path / "some.py"
    file.write_text("def a(x): ...\ndef b(x: int): ...\ndef c(x: int) -> int: ...\n@compiled\ndef d(x): ...\n")
    assert list(functions_without_types(file)) == ["some.py:1 a", "some.py:2 b"]


def test_where_mypy_does_not_ask_for_types_there_are_compiled_functions():
    for pattern in exempted():
        assert any("@compiled" in path.read_text() for path in files_of(pattern)), pattern


@pytest.mark.parametrize("package", [mesa_swarm, environments], ids=lambda package: package.__name__)
def test_type_checkers_find_every_name_that_is_imported_when_it_is_used(package):
    tree = ast.parse(Path(package.__file__).read_text())
    block = next(n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")
    told = {alias.name: line.module for line in block.body for alias in line.names}
    assert told == {name: f"{package.__name__}.{home}" for name, home in package._HOME.items()}


def test_no_error_is_passed_over_without_saying_which():
    lines = [line for path in PACKAGE.rglob("*.py") for line in path.read_text().splitlines()]
    assert not [line for line in lines if "type: ignore" in line and "type: ignore[" not in line]
