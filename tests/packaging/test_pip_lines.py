"""Every line of README and documentation that installs is run, here or elsewhere, and pages show what it enables."""

import importlib.util
import re
import sys
from importlib.metadata import packages_distributions

import pytest

from support.installing import ROOT

SCRIPT = ROOT / "tests" / "packaging" / "pip_lines.py"
SPEC = importlib.util.spec_from_file_location("pip_lines", SCRIPT)
pip_lines = sys.modules["pip_lines"] = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(pip_lines)
OF_PAGES = pip_lines.extras_of_pages()
REQUIRED = [re.split(r"[\[<>=!~; ]", line, maxsplit=1)[0] for line in pip_lines.PROJECT["dependencies"]]
# What a package among these brings along.
BROUGHT = {"networkx", "dask"}
OWNERS = packages_distributions()


def test_all_lines_are_found_wherever_they_stand():
    found = pip_lines.lines()
    assert {line.page for line in found} >= {"README.md", "docs/index.md", "docs/commands.md", "notebooks/README.md"}
    # Every place that installs has such words: none has a form that the pattern does not know.
    typed = sum(text.count("pip install") for text in pip_lines.pages().values())
    assert len(found) == typed > 25
    assert all(line.words and "`" not in line.text for line in found)


def test_every_line_is_run_here_or_elsewhere_as_stated():
    here = pip_lines.run_here()
    assert {line.text for line in pip_lines.lines()} - {line.text for line in here} == pip_lines.ELSEWHERE.keys()
    assert all(line.extras is not None for line in here), "of this package"
    for place, words in pip_lines.ELSEWHERE.values():
        assert words in (ROOT / place).read_text(encoding="utf-8"), place
    assert "tests/packaging/pip_lines.py" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


@pytest.mark.parametrize("line", pip_lines.run_here(), ids=str)
def test_a_line_names_extras_that_there_are_and_constraints_where_there_is_a_copy(line):
    assert line.extras <= pip_lines.EXTRAS.keys()
    assert line.words[:2] == ("-c", "constraints.txt") or line.words[-1].startswith("mesa-swarm")


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted(OF_PAGES))
def test_a_page_shows_no_import_that_its_own_lines_do_not_install(page):
    known = {plain(name) for name in (*REQUIRED, *pip_lines.packages_of(OF_PAGES[page]))} | BROUGHT
    imports, _ = pip_lines.shown_on(page, pip_lines.pages()[page])
    modules = {re.split(r"[ .,]", statement.split(maxsplit=1)[1])[0] for statement in imports}
    outside = modules - set(sys.stdlib_module_names) - {"mesa_swarm", "mesa_swarm_studies"}
    assert {name for name in outside if not {plain(owner) for owner in (name, *OWNERS.get(name, []))} & known} == set()


def test_no_environment_is_asked_for_the_command_of_a_package_that_a_page_makes():
    text = pip_lines.pages()["docs/own_command.md"]
    assert "mesa-swarm visits" in text
    assert "visits" not in pip_lines.shown_on("docs/own_command.md", text)[1]


def plain(name: str) -> str:
    return name.lower().replace("_", "-")
