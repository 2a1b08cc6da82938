"""Models that reproduce papers are made of public names alone, as a user's own would be."""

import ast
import inspect
import re
import sys
from pathlib import Path

import pytest

from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm_studies.registry import items

PUBLIC = {
    "mesa_swarm",
    *(f"mesa_swarm.{room}" for room in ("control", "analysis", "model.parameters", "errors")),
    *("numpy", "mesa", "numba", "shapely"),
}
STANDARD = set(sys.stdlib_module_names)
PAPERS = {name: item for name, item in items().items() if item.source == "paper"}
APPENDIX = Path(__file__).parents[2] / "docs" / "appendix"


def published_pages() -> str:
    return "".join(page.read_text(encoding="utf-8") for page in sorted(APPENDIX.glob("published*.md")))


def source_of(name: str) -> str:
    return Path(inspect.getfile(find_model(name))).read_text(encoding="utf-8")


def imported(tree: ast.AST) -> set[str]:
    """Return the modules that a file imports, or imports from."""
    plain = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    return plain | {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}


def inner_attributes(tree: ast.AST) -> set[str]:
    """Return the attributes that begin with an underscore, without `__init__` and the like and the file's own."""
    own = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    return {name for name in used - own if name.startswith("_") and not name.endswith("__")}


def is_public(module: str) -> bool:
    return module in PUBLIC or module.partition(".")[0] in STANDARD | {"numpy", "shapely"}


def test_imports_and_attributes_that_are_not_public_are_found():
    tree = ast.parse("import mesa_swarm.physics.engine\nfrom numpy.linalg import norm\nmodel._engine.sense()\n")
    assert [module for module in imported(tree) if not is_public(module)] == ["mesa_swarm.physics.engine"]
    assert inner_attributes(tree) == {"_engine"}


@pytest.mark.parametrize("name", PAPERS)
class TestEveryModelOfAPaper:
    def test_is_in_the_gallery_under_the_name_of_its_result(self, name):
        assert name in model_names()

    def test_imports_public_modules_only(self, name):
        assert [module for module in sorted(imported(ast.parse(source_of(name)))) if not is_public(module)] == []

    def test_uses_no_inner_attribute(self, name):
        assert inner_attributes(ast.parse(source_of(name))) == set()

    def test_names_its_paper(self, name):
        assert re.search(r"\b(19|20)\d\d\b", PAPERS[name].paper)
        assert "REFERENCE" in source_of(name)

    def test_has_a_section_with_its_verdict_and_its_picture_on_the_page(self, name):
        section = published_pages().partition(f"\n## {name}: ")[2].partition("\n## ")[0]
        assert re.search(r"\*\*(Confirmed|Confirmed with limits|Not confirmed)\.\*\*", section)
        assert f"(pictures/{name}.png)" in section
        assert (APPENDIX / "pictures" / f"{name}.png").stat().st_size > 0
        assert "--quick" not in section


def test_the_pages_have_a_section_for_each_result_and_no_other():
    assert sorted(re.findall(r"^## (\w+): ", published_pages(), re.M)) == sorted(PAPERS)
