"""CHANGELOG.md: versions with dates, their sections, and the list of what is deprecated; the version in other files."""

import ast
import re
from datetime import date

import pytest
import yaml

import mesa_swarm
from mesa_swarm.base.moved import HOMES, NAMES
from mesa_swarm.learning.hebbian import WITHOUT_EFFECT
from support.installing import ROOT

TEXT = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
VERSION = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", re.MULTILINE)
SECTIONS = ["Added", "Changed", "Deprecated", "Removed", "Fixed"]
ROW = re.compile(r"^\| `([^`]+)` \| (?:`([^`]+)`|(without effect)) \|$", re.MULTILINE)
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def deprecated_by_warnings() -> dict[str, str]:
    """Return what calls of `warnings.warn` name as deprecated, and what it is called now."""
    found = {}
    for path in (ROOT / "mesa_swarm").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and "DeprecationWarning" in map(ast.unparse, node.args):
                message = node.args[0]
                if isinstance(message, ast.Constant):
                    old, new = re.fullmatch(r"(.+?) is (?:called )?(.+) now", message.value).groups()
                    found[old] = new
                else:  # those of moved.py and of hebbian.py are made from their lists
                    assert path.name in {"moved.py", "hebbian.py"}, path
    return found


def test_the_newest_version_is_that_of_the_package():
    assert VERSION.findall(TEXT)[0][0] == mesa_swarm.__version__


def test_versions_and_dates_descend():
    versions = [tuple(map(int, version.split("."))) for version, _ in VERSION.findall(TEXT)]
    dates = [date.fromisoformat(day) for _, day in VERSION.findall(TEXT)]
    assert versions == sorted(set(versions), reverse=True)
    assert dates == sorted(dates, reverse=True)
    assert len(re.findall("^## ", TEXT, re.MULTILINE)) == len(versions)


def test_each_version_has_the_usual_sections_in_their_order():
    for part in VERSION.split(TEXT)[3::3]:
        sections = re.findall(r"^### (.+)$", part, re.MULTILINE)
        assert sections == [section for section in SECTIONS if section in sections]
        assert len(sections) > 1


@pytest.mark.slow
def test_the_list_of_deprecated_names_is_that_of_the_code():
    listed = {old: new or effect for old, new, effect in ROW.findall(TEXT)}
    without = {f"HebbianLearning({', '.join(f'{name}=' for name in WITHOUT_EFFECT)})": "without effect"}
    assert listed == {**deprecated_by_warnings(), **without}
    assert not listed.keys() & {**HOMES, **NAMES}.keys(), "former addresses are listed in one place"
    assert "`moved.py` of the package lists" in " ".join(TEXT.split())


def test_the_changes_of_a_version_fit_on_a_page():
    for part in VERSION.split(TEXT)[3::3]:
        assert len(part.splitlines()) <= 130
        assert max(map(len, part.splitlines())) <= 120


def test_the_citation_has_the_version_and_its_date():
    newest = VERSION.findall(TEXT)[0]
    assert (CITATION["version"], CITATION["date-released"].isoformat()) == newest
    page = (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")
    assert f"version = {{{newest[0]}}}" in page
    assert f"year    = {{{newest[1][:4]}}}" in page


def test_the_citation_is_complete():
    required = {"cff-version", "message", "title", "authors", "abstract", "keywords", "license", "type", "version"}
    assert required <= CITATION.keys()
