"""Figures 8.2 to 8.5 are judged by what the thesis's text states, which has no number of collisions."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mesa_swarm_studies.registry import find_item
from mesa_swarm_studies.thesis import learning

PAGE = Path(__file__).parents[2] / "docs" / "appendix" / "reproduction.md"
FIGURES = ["8.2", "8.3", "8.4", "8.5"]
# "To about 0" is the only number of collisions of the text.
STATED = {"0"}


def made_up_runs(*_args, **_settings):
    """Two runs of everything that the figures measure."""
    points = learning.POINTS
    names = ("early", "late", "first third", "last third", "total", "with temperature", "speed")
    curves = {name: np.linspace(0.1, 1.0, points).tolist() for name in ("curve", "sum", "temperature")}
    return [dict.fromkeys(names, 0.5 + place) | curves for place in (0.0, 0.25)]


def numbers_in(text):
    return set(re.findall(r"\d+(?:\.\d+)?", text))


@pytest.mark.parametrize("figure", FIGURES)
def test_no_claim_about_collisions_quotes_a_number_that_the_thesis_does_not_have(figure, monkeypatch):
    monkeypatch.setattr(learning, "runs_of", made_up_runs)
    result = find_item(figure).make(SimpleNamespace(pick=lambda full, _: full))
    assert set().union(*(numbers_in(check.reported) for check in result.checks)) <= STATED


@pytest.mark.parametrize("figure", FIGURES)
def test_the_page_has_exactly_the_claims_that_are_judged(figure, monkeypatch):
    monkeypatch.setattr(learning, "runs_of", made_up_runs)
    result = find_item(figure).make(SimpleNamespace(pick=lambda full, _: full))
    section = PAGE.read_text().split(f"\n## {figure}: ")[1].split("\n## ")[0]
    rows = [line.split(" | ") for line in section.splitlines() if line.startswith("| ")][1:]
    claims = [check.claim if check.main else f"*{check.claim}*" for check in result.checks]
    assert [row[0].removeprefix("| ") for row in rows] == claims
    assert [row[1] for row in rows] == [check.reported for check in result.checks]
