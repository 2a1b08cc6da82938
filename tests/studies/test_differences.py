"""The page of differences: every item of the thesis, with code and tests that exist."""

import ast
import re
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm_studies.registry import items
from mesa_swarm_studies.thesis.differences import (
    COUNTED,
    Deviation,
    ThesisItem,
    by_subject,
    chapters,
    counted,
    deviations,
    page,
    thesis_items,
)

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "appendix" / "differences.md"
ENTRIES = [*deviations(), *thesis_items()]
WHERE = sorted({place for entry in ENTRIES for place in entry.where})
TESTS = sorted({test for entry in ENTRIES for test in entry.tests})
ITEM = {"number": 3, "section": "1", "thesis": "a thing", "state": "works", "where": ("cli:main",), "tests": ("a::b",)}
DEVIATION = {
    "number": "E1",
    "subject": "x",
    "section": "1",
    "printed": "a",
    "here": "b",
    "where": ("c",),
    "tests": ("d",),
}


def test_each_of_the_205_items_occurs_once():
    assert [item.number for item in thesis_items()] == list(range(1, 206))


def test_each_of_the_40_errors_and_open_points_occurs_once_and_other_deviations_are_numbered():
    numbers = [one.number for one in deviations()]
    errors = sorted(int(number[1:]) for number in numbers if number[0] == "E")
    others = sorted(int(number[1:]) for number in numbers if number[0] == "F")
    assert errors == list(range(1, 41))
    assert others == list(range(1, len(others) + 1))
    assert len(errors) + len(others) == len(numbers)


def test_chapters_and_subjects_hold_everything_once():
    in_chapters = [item for some in chapters().values() for item in some]
    assert in_chapters == list(thesis_items())
    subjects = [subject for subject, _ in by_subject()]
    assert len(subjects) == len(set(subjects))


def test_deviations_that_items_refer_to_exist():
    known = {one.number for one in deviations()}
    named = {number for item in thesis_items() for number in re.findall(r"\b[EF]\d+\b", item.here)}
    assert named
    assert named <= known


def test_figures_that_entries_refer_to_are_reproduced():
    named = {figure for entry in ENTRIES for figure in re.findall(r"figures? (\d\.[\d.]*\d)", entry.here)}
    assert named
    assert named <= items().keys()


def test_equations_that_the_code_calls_corrected_are_among_the_deviations():
    sources = [
        path.read_text(encoding="utf-8")
        for folder in ("mesa_swarm", "studies")
        for path in (ROOT / folder).rglob("*.py")
    ]
    corrected = {number for text in sources for number in re.findall(r"([AB5-9]\.\d+),\s+(?:signs )?corrected", text)}
    assert len(corrected) > 4
    listed = {number for one in deviations() for number in re.findall(r"\b[AB5-9]\.\d+", one.section)}
    assert corrected <= listed


@pytest.mark.parametrize("place", WHERE)
def test_what_is_named_as_the_place_of_an_item_exists(place):
    module, colon, name = place.partition(":")
    if not colon:
        assert any((folder / module).is_file() for folder in (ROOT, ROOT / "mesa_swarm"))
        return
    found = import_module(f"mesa_swarm{'_' if module.startswith('studies.') else '.'}{module}")
    for part in name.split("."):
        found = member(found, part)


def member(owner, name):
    """Return an attribute; a field of a dataclass without a default is declared only."""
    fields = getattr(owner, "__dataclass_fields__", {})
    return fields[name] if name in fields else getattr(owner, name)


@cache
def defined_in(path):
    """Return the tests that a file defines, as pytest names them."""
    named = []
    for node in ast.parse((ROOT / path).read_text(encoding="utf-8")).body:
        inner = node.body if isinstance(node, ast.ClassDef) else [node]
        prefix = f"{path}::{node.name}::" if isinstance(node, ast.ClassDef) else f"{path}::"
        named += [f"{prefix}{one.name}" for one in inner if isinstance(one, ast.FunctionDef)]
    return {name for name in named if name.rsplit("::", 1)[1].startswith("test_")}


@pytest.mark.slow
@pytest.mark.parametrize("test", TESTS)
def test_a_test_that_is_named_as_a_proof_exists(test):
    assert test in defined_in(test.split("::")[0])


def test_the_committed_page_is_the_one_that_is_written():
    assert PAGE.read_text(encoding="utf-8") == page()


def test_the_page_has_a_row_for_each_item_and_deviation():
    rows = re.findall(r"^\| \*\*(\d+|[EF]\d+)\*\* \(", page(), re.MULTILINE)
    assert rows == [one.number for _, some in by_subject() for one in some] + [str(n) for n in range(1, 206)]


def test_the_states_add_up():
    numbers = [int(number) for number in re.findall(rf"(\d+) (?:{'|'.join(COUNTED.values())})", counted())]
    assert sum(numbers) == len(thesis_items())


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"state": "work"}, "unknown state of item 3 'work'; did you mean 'works'"),
        ({"where": ()}, "item 3 has no where"),
        ({"tests": ()}, "item 3 has no tests"),
        ({"state": "differs"}, "item 3 has no here"),
        ({"state": "missing", "where": (), "tests": ()}, "item 3 has no here"),
        ({"number": 0}, "number is 0"),
        ({"thesis": ""}, "item 3 has no thesis"),
    ],
)
def test_an_item_without_what_its_state_requires_is_refused_in_one_line(changed, words):
    assert ThesisItem(**ITEM).state == "works"
    with pytest.raises(SwarmError, match=words) as caught:
        ThesisItem(**{**ITEM, **changed})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["subject", "section", "printed", "here", "where", "tests"])
def test_a_deviation_without_one_of_its_fields_is_refused_in_one_line(name):
    assert Deviation(**DEVIATION).number == "E1"
    with pytest.raises(SwarmError, match=f"deviation E1 has no {name}"):
        Deviation(**{**DEVIATION, name: ""})
