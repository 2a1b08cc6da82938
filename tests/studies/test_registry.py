"""Exactly the thesis's figures that a computer can make, each of which is made; the page lists them all."""

import re
from pathlib import Path

import pytest

from mesa_swarm.base.errors import UnknownNameError
from mesa_swarm_studies.judging import PASSED, REFUTED, VERDICTS, Check, verdict
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Made, find_item, items, report

FIGURES = [
    *(f"4.{i}" for i in range(12, 17)),
    *(f"5.{i}" for i in range(5, 11)),
    "6.5",
    "7.3",
    "eq8.3",
    *(f"8.{i}" for i in range(1, 8)),
    *(f"9.{i}" for i in range(1, 4)),
    "B.1",
    *(f"D.{i}" for i in range(1, 5)),
]
# Claims of sections that no figure shows.
SECTIONS = ["5.2.2", "5.3.4", "10.2", "6.4", "7.3.2", "tuning", "req9.2", "9.4", "9.5"]
# These take no runs; the others are made in the slow tests.
FAST = ("8.1", "B.1", "D.1", "D.2", "D.3", "D.4")
APPENDIX = Path(__file__).parents[2] / "docs" / "appendix"
PAGE = APPENDIX / "reproduction.md"


def test_the_registry_has_exactly_the_figures_of_the_thesis_that_a_computer_can_make():
    of_thesis = [figure for figure, item in items().items() if item.source == "thesis"]
    assert [figure for figure in of_thesis if figure not in SECTIONS] == FIGURES
    assert [figure for figure in of_thesis if figure in SECTIONS] == SECTIONS


def test_an_unknown_figure_is_refused_with_the_nearest():
    with pytest.raises(UnknownNameError, match=r"unknown figure '8.9'; did you mean '8\.\d'\?"):
        find_item("8.9")


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """What several figures are made of is run once."""
    with Laboratory(tmp_path_factory.mktemp("figures"), quick=True) as made:
        yield made


@pytest.mark.parametrize(
    "figure", [pytest.param(f, marks=() if f in FAST else pytest.mark.long, id=f) for f in FIGURES + SECTIONS]
)
def test_a_figure_is_made_quickly(figure, laboratory):
    result = find_item(figure).make(laboratory)
    assert result.verdict in VERDICTS
    assert any(check.main for check in result.checks)
    assert "" in result.pictures
    assert all(all(check.row) for check in result.checks)


@pytest.mark.parametrize("figure", FAST)
def test_what_chance_has_no_part_in_does_not_fail_in_the_main(figure, laboratory):
    assert find_item(figure).make(laboratory).verdict != "not confirmed"


def test_quick_verdicts_are_marked_everywhere_and_the_page_counts_its_runs(laboratory):
    item = find_item("D.3")
    made = [Made(item=item, result=item.make(laboratory), seconds=60.0)]
    page = report(made, quick=True, runs=(3, 2))
    assert page.count("onfirmed (quick)") == 2
    assert "in 1 minutes" in page
    assert "3 runs were made, and 2 of an earlier call were reused." in page
    assert "(quick)" not in report(made)


def heading_and_summary(laboratory, figures):
    """Return the first paragraph of a page of these figures, which only one of them is made for, and the rest."""
    result = find_item("D.3").make(laboratory)
    page = report([Made(item=find_item(figure), result=result, seconds=1.0) for figure in figures])
    title, first, rest = page.split("\n\n", 2)
    return title, " ".join(first.split()), rest


@pytest.mark.parametrize(
    "figures",
    [("D.3",), ("8.1", "D.3"), ("readings-8.3",), ("task_allocation",), ("8.1", "task_allocation"), ("sector_hits",)],
    ids=str,
)
def test_a_page_of_selected_figures_states_that_it_has_only_these(figures, laboratory):
    title, first, rest = heading_and_summary(laboratory, figures)
    assert title == "# Selected results"
    assert first.startswith(f"This page has only these of the {len(items())} results")
    assert f"theories: {', '.join(figures)}. " in first
    command, option = ("validate", "--only") if figures == ("sector_hits",) else ("reproduce", "--figure")
    assert f"mesa-swarm {command} {' '.join(f'{option} {figure}' for figure in figures)} --report" in first
    assert "## All results" not in rest
    assert "## Selected results" in rest
    assert "A check is *passed* if" in rest


@pytest.mark.parametrize(
    ("source", "title"),
    [
        ("thesis", "# Reproduced results"),
        ("paper", "# Published results"),
        ("reading", "# How much the verdicts depend on how one reads"),
        ("theory", "# Validation: what physics predicts"),
    ],
)
def test_a_page_of_all_results_of_a_source_states_that_these_are_all(source, title, laboratory):
    figures = [figure for figure, item in items().items() if item.source == source]
    begin, first, rest = heading_and_summary(laboratory, figures)
    assert begin == title
    assert "only" not in first
    assert "## All results" in rest


def test_the_page_has_every_figure_once_with_its_verdict_and_was_made_with_all_seeds():
    page = PAGE.read_text()
    sections = re.findall(r"^## ([\w.]+): ", page, re.M)
    assert [figure for figure in sections if figure not in SECTIONS] == FIGURES
    assert re.findall(r"^\| ([\w.]+) \| .*\| \*\*", page, re.M) == sections
    verdicts = "|".join(map(str.capitalize, VERDICTS))
    assert len(re.findall(rf"^Thesis .*\*\*({verdicts})\.\*\*$", page, re.M)) == len(sections)
    assert "--quick" not in page


def checks_in(section):
    """Return the checks of the first table of a section: claims in italics are not main ones."""
    lines = section.split("| detectable |\n", 1)[1].split("\n\n")[0].splitlines()[1:]
    rows = [re.split(r"(?<!\\) \| ", line.strip("| ")) for line in lines]
    return [
        Check(claim=row[0].strip("*"), reported="", measured="", criterion="", outcome=row[-2], main=row[0][0] != "*")
        for row in rows
    ]


@pytest.mark.parametrize("name", ["reproduction", "readings", "published", "validation"])
def test_the_verdicts_and_counts_of_a_page_follow_from_its_checks(name):
    summary, *sections = re.split(r"^## (?!All results)", (APPENDIX / f"{name}.md").read_text(), flags=re.M)
    lines = {row[0]: row for row in re.findall(r"^\| (\S+) \| .* \| \*\*(.+?)\*\* \| (.*) \|$", summary, re.M)}
    verdicts = []
    for section in sections:
        _, stated, failed = lines[section.split(":")[0]]
        checks = checks_in(section)
        assert stated == verdict(checks, reason="stated" if stated == REFUTED else "")
        assert f"**{stated.capitalize()}.**" in section
        assert failed == ("; ".join(check.claim for check in checks if check.outcome != PASSED) or "-")
        verdicts.append(stated)
    counted = ", ".join(f"{verdicts.count(each)} {each}" for each in VERDICTS)
    assert f"\n{counted}.\n" in summary
    assert len(verdicts) == len(lines)
