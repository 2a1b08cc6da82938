"""Which results of the thesis, and of published papers, are reproduced, and the pages that list them."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules

import numba
import numpy as np

from mesa_swarm.errors import check_choice
from mesa_swarm.reproduction.judging import VERDICTS, Result, header
from mesa_swarm.reproduction.laboratory import Laboratory

PACKAGE = "mesa_swarm.reproduction"
# A module for each subject, in the thesis's order.
CHAPTERS = ("complexity", "swarms", "networks", "learning", "fire_fighting", "fire_growth", "maps")
# Modules whose names begin with this hold the results of papers.
PUBLISHED = "published"
THESIS, PAPER = "thesis", "paper"


@dataclass(frozen=True, kw_only=True, slots=True)
class Item:
    """One result of the thesis or of a paper: its number, what it shows, where, and how it is made.

    A result of the thesis has the number of its figure and its section. A result of a paper has the name of the model
    of the gallery that reproduces it, authors and year as its section, the full reference, and a paragraph about what
    was found there and how the model differs.
    """

    figure: str
    title: str
    section: str
    make: Callable[[Laboratory], Result]
    paper: str = ""
    about: str = ""

    @property
    def source(self) -> str:
        """Where the result comes from: "thesis" or "paper"."""
        return PAPER if self.paper else THESIS

    @property
    def place(self) -> str:
        """Section of the thesis, or authors and year of a paper."""
        return self.section if self.paper else f"{THESIS} {self.section}"


@cache
def items() -> dict[str, Item]:
    """Return all results by the number of their figure: the thesis's in its order, then those of papers by name."""
    of_thesis = [item for name in CHAPTERS for item in _items_in(name)]
    of_papers = [item for name in _published() for item in _items_in(name)]
    return {item.figure: item for item in (*of_thesis, *sorted(of_papers, key=lambda item: item.figure))}


def _items_in(module: str) -> Sequence[Item]:
    return import_module(f"{PACKAGE}.{module}").ITEMS


def _published() -> list[str]:
    modules = iter_modules(import_module(PACKAGE).__path__)
    return sorted(module.name for module in modules if module.name.startswith(PUBLISHED))


def find_item(figure: str) -> Item:
    """Return the result of this number."""
    return items()[check_choice("figure", figure, items())]


INTRODUCTION = """\
# Reproduced results

This page is written by `mesa-swarm reproduce --all --report docs/reproduction.md`; `mesa-swarm reproduce --figure 8.3`
reproduces a single figure, with its picture and table. The thesis reports one run of each behaviour. Here each is
repeated over many seeds, and comparisons are paired by seed: same start positions and same noise. Intervals are 95 %
(Student's t for means and differences, Wilson's for shares).

Verdicts are computed. A check is *passed* if its interval lies entirely within what is required, *failed* if entirely
outside, and *undecided* if it includes the limit. A result is **confirmed** if all its checks are passed, **confirmed
with limits** if all main checks are, otherwise **not confirmed**. Side claims are in italics. No setting was tuned to
confirm a claim; the thesis gives few distances, speeds and constants, so that we chose the settings, which are listed.
Two criteria were changed after the results were known: 5.5 requires most runs and has the mean as a side claim, and in
8.3 to 8.5 speed, for which the thesis gives no number, became a side claim; both made a verdict milder. The thesis
reports many results as pictures: the column "thesis" quotes its text about them. The numbering of the pictures within a
section (4.12 to 4.16, 5.6 to 5.10, 8.1 to 8.6, 9.1 to 9.3) is our reading of that text.
"""
OF_PAPERS = """\
# Published results

This page is written by `mesa-swarm reproduce --published --report docs/published.md`; `mesa-swarm reproduce --figure
task_allocation` reproduces a single result, with its picture and table. Each result is one model of the gallery, of at
most 150 lines that use public names alone, beside what a paper reports. Runs are repeated over many seeds; comparisons
are paired by seed. Intervals are 95 % (Student's t for means and differences, Wilson's for shares).

Verdicts are computed. A check is *passed* if its interval lies entirely within what is required, *failed* if entirely
outside, and *undecided* if it includes the limit. A result is **confirmed** if all its checks are passed, **confirmed
with limits** if all main checks are, otherwise **not confirmed**. Side claims are in italics. Settings and criteria
were fixed before the runs that are judged, which have seeds from 1 on; settings were chosen in runs with seeds of
10,000 and more. The robots differ from the animals and robots of the papers: each section states how.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Made:
    """A reproduced result, and the seconds that it took."""

    item: Item
    result: Result
    seconds: float


def report(made: Sequence[Made], *, quick: bool = False) -> str:
    """Return the page; it states if few seeds were enough."""
    introduction = OF_PAPERS if all(one.item.source == PAPER for one in made) else INTRODUCTION
    parts = [introduction, surroundings(made, quick), summary(made), *map(section, made)]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def surroundings(made: Sequence[Made], quick: bool) -> str:
    """Return the versions, the time that it took, and the load of the machine."""
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores" if hasattr(os, "getloadavg") else "load unknown"
    minutes = sum(one.seconds for one in made) / 60
    few = "\n**Few seeds, short runs (`--quick`): these verdicts mean nothing.**\n" if quick else ""
    with_what = f"NumPy {np.__version__} and Numba {numba.__version__}"
    return (
        f"{few}\nMade with {with_what}. The last call took {minutes:.0f} minutes; {load}. Earlier runs were reused.\n"
    )


def summary(made: Sequence[Made]) -> str:
    """Return how many results have which verdict, and a line for each."""
    count = {name: sum(one.result.verdict == name for one in made) for name in VERDICTS}
    counted = ", ".join(f"{number} {name}" for name, number in count.items())
    lines = [
        (one.item.figure, one.item.title, f"**{one.result.verdict}**", "; ".join(one.result.limits) or "-")
        for one in made
    ]
    table = table_of(("figure", "shows", "verdict", "not passed"), lines)
    return f"## All results\n\n{counted}.\n\n{table}"


def section(one: Made) -> str:
    """Return the section of one result, in which the claims that are not main ones are in italics."""
    rows = [(check.claim if check.main else f"*{check.claim}*", *check.row[1:]) for check in one.result.checks]
    remarks = "".join(f"\n- {remark}" for remark in one.result.remarks)
    where = one.item.paper or f"Thesis {one.item.section}."
    return (
        f"## {one.item.figure}: {one.item.title}\n\n"
        f"{where} **{one.result.verdict.capitalize()}.**\n\n"
        f"{described(one.item)}{table_of(header(one.item.source), rows)}\n\nSettings: {one.result.settings}.\n{remarks}"
    )


def described(item: Item) -> str:
    """Return the paragraph about the result of a paper, and its picture."""
    if item.source == THESIS:
        return ""
    return f"{item.about}\n\n![{item.title}](pictures/{item.figure}.png)\n\n"


def table_of(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, *rows]
    cells = ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]
    return "\n".join([cells[0], "|" + "---|" * len(header), *cells[1:]])
