"""Types for type checkers: every public function is annotated."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import mesa_swarm
from mesa_swarm import control, environments, experiments, fire, viewing

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "mesa_swarm"
MYPY = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]
# Numba infers the types of what these decorate, and compares the signatures of overloads with each other.
FOR_NUMBA = {"compiled", "overload"}
IMPORTS = "from mesa_swarm.models.fire_fighting import FireFighting"
NUMBERS = "ndarray[tuple[Any, ...], dtype[float64]]"
READ_FIRST = {
    "model.run(3)": "FireFighting",
    "model.run(3).results()": "dict[str, float | None]",
    "model.robots[0]": "Robot",
    "model.robots[:2]": "list[Robot]",
    "[robot for robot in model.robots]": "list[Robot]",
    "model.robots[0].position": NUMBERS,
    "model.swarm.heading": NUMBERS,
    "model.fires[0].position": NUMBERS,
    "model.obstacles[0]": "Obstacle",
    "model.loads[0]": "Load",
}


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


@pytest.mark.slow
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


LAZY = [mesa_swarm, control, environments, experiments, fire, viewing]


@pytest.mark.parametrize("package", LAZY, ids=lambda package: package.__name__)
def test_type_checkers_find_every_name_that_is_imported_when_it_is_used(package):
    tree = ast.parse(Path(package.__file__).read_text())
    block = next(n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")
    found = {alias.name: line.module for line in block.body for alias in line.names}
    assert found == {name: f"mesa_swarm.{home}" for home, names in package._MODULES.items() for name in names.split()}


@pytest.mark.slow
def test_type_checkers_know_what_people_read_first(tmp_path):
    file = tmp_path / "reads.py"
    reads = "\n".join(f"reveal_type({expression})" for expression in READ_FIRST)
    file.write_text(f"{IMPORTS}\nmodel = FireFighting(rng=1)\n{reads}\n")
    command = [sys.executable, "-m", "mypy", str(file)]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout
    revealed = [re.sub(r"\b(?:\w+\.)+(?=\w)", "", text) for text in re.findall(r'type is "(.+)"', found)]
    # Older NumPys write it so.
    revealed = [text.replace("floating[_64Bit]", "float64") for text in revealed]
    assert dict(zip(READ_FIRST, revealed, strict=True)) == READ_FIRST


def test_no_error_is_passed_over_without_its_type():
    paths = [*PACKAGE.rglob("*.py"), *(ROOT / "studies").rglob("*.py")]
    lines = [line for path in paths for line in path.read_text().splitlines()]
    assert not [line for line in lines if "type: ignore" in line and "type: ignore[" not in line]
