"""Studies are made of public names alone, as a study of a user's own would be, and the package does not know them."""

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STUDIES = sorted((ROOT / "studies").rglob("*.py"))
PACKAGE = [path for folder in ("mesa_swarm", "models") for path in sorted((ROOT / folder).rglob("*.py"))]
OURS, STUDIES_NAME = "mesa_swarm", "mesa_swarm_studies"


def imports(source: str) -> Iterator[tuple[str, str]]:
    """Iterate over what a source imports anywhere in it: the module, and the name, "" for the module itself.

    Programs that are written as texts count too.
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from ((str(node.module), alias.name) for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "\nfrom mesa_swarm" in node.value:
            yield from imports(node.value)


def inner_attributes(source: str) -> set[str]:
    """Return attributes with an underscore of anything but `self` and `cls`, without a named tuple's documented one."""
    return {
        node.attr
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute)
        and node.attr.startswith("_")
        and not node.attr.endswith("__")
        and node.attr != "_asdict"
        and ast.unparse(node.value) not in ("self", "cls")
    }


def is_public(module: str, name: str) -> bool:
    """Return whether a name is listed in `__all__` of its module; the package itself may be imported whole."""
    if module.partition(".")[0] != OURS or (module, name) == (OURS, ""):
        return True
    return name in {*getattr(import_module(module), "__all__", ()), "__version__"}


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_study_uses_public_names_only(path):
    source = path.read_text(encoding="utf-8")
    assert [found for found in imports(source) if not is_public(*found)] == []
    assert inner_attributes(source) == set()


@pytest.mark.slow
def test_the_package_does_not_import_its_studies():
    found = {path: imports(path.read_text(encoding="utf-8")) for path in PACKAGE}
    assert len(found) > 200
    assert [path for path, names in found.items() if any(module.startswith(STUDIES_NAME) for module, _ in names)] == []


@pytest.mark.parametrize(
    "line",
    [
        "import mesa_swarm.physics.engine",
        "from mesa_swarm.physics.engine import Engine",
        "from mesa_swarm.learning import actions",
        "def f():\n    from mesa_swarm import _MODULES",
        "PROGRAM = '''\nfrom mesa_swarm.physics.engine import Engine\n'''",
    ],
)
def test_a_name_that_is_not_public_is_found(line):
    assert [found for found in imports(line) if not is_public(*found)]
