"""Which results of the thesis are reproduced, and the page that lists them."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module

import numba
import numpy as np

from mesa_swarm.errors import check_choice
from mesa_swarm.reproduction.judging import HEADER, VERDICTS, Result
from mesa_swarm.reproduction.laboratory import Laboratory

# A module for each subject, in the thesis's order.
CHAPTERS = ("complexity", "swarms", "networks", "learning", "fire_fighting", "fire_growth", "maps")


@dataclass(frozen=True, kw_only=True, slots=True)
class Item:
    """One result of the thesis: its number, what it shows, where, and how it is made."""

    figure: str
    title: str
    section: str
    make: Callable[[Laboratory], Result]


@cache
def items() -> dict[str, Item]:
    """Return all results by the number of their figure, in the thesis's order."""
    modules = (import_module(f"mesa_swarm.reproduction.{name}") for name in CHAPTERS)
    return {item.figure: item for module in modules for item in module.ITEMS}


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


@dataclass(frozen=True, kw_only=True, slots=True)
class Made:
    """A reproduced result, and the seconds that it took."""

    item: Item
    result: Result
    seconds: float


def report(made: Sequence[Made], *, quick: bool = False) -> str:
    """Return the page; it states if few seeds were enough."""
    parts = [INTRODUCTION, surroundings(made, quick), summary(made), *map(section, made)]
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
    return (
        f"## {one.item.figure}: {one.item.title}\n\n"
        f"Thesis {one.item.section}. **{one.result.verdict.capitalize()}.**\n\n"
        f"{table_of(HEADER, rows)}\n\nSettings: {one.result.settings}.\n{remarks}"
    )


def table_of(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, *rows]
    cells = ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]
    return "\n".join([cells[0], "|" + "---|" * len(header), *cells[1:]])
