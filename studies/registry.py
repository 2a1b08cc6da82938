"""Which results of the thesis, of published papers and of theories are reproduced, and the pages that list them."""

import os
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module, resources

import numba
import numpy as np

from mesa_swarm.errors import UnknownNameError, check_choice
from mesa_swarm_studies.judging import AGAINST_THEORY, FAILED, UNDECIDED, VERDICTS, Result, header
from mesa_swarm_studies.laboratory import Laboratory

PACKAGE = "mesa_swarm_studies"
# A module of `thesis` for each subject, in the thesis's order.
CHAPTERS = (
    *("complexity", "avoidance", "swarms", "networks", "learning", "oscillations", "foresight"),
    *("tuning", "fire_fighting", "fire_growth", "maps"),
)
# Modules of `published`.
PAPERS = ("bodies", "decisions", "pucks", "trails")
# What theories of physics predict: the modules of `theory` in the order of the page, and their texts.
THEORIES = ("kinetics", "motion", "sensing", "flocks")
TEXTS = "theory/theory.toml"
THESIS, PAPER, READING, THEORY = "thesis", "paper", "reading", "theory"
# Numbers of earlier versions, which were not those of the thesis's captions.
RENUMBERED = {"6.3": "6.5"}


@dataclass(frozen=True, kw_only=True, slots=True)
class Item:
    """One result of the thesis, a paper or a theory: its number, what it shows, where, and how it is made.

    A result of the thesis has the number of its figure and its section. A result of a paper has the name of the model
    of the gallery that reproduces it, authors and year as its section, the full reference, and a paragraph about what
    was found there and how the model differs. A result of `readings`, which compares ways to read the thesis, has a
    paragraph too.
    """

    figure: str
    title: str
    section: str
    make: Callable[[Laboratory], Result]
    paper: str = ""
    about: str = ""
    readings: bool = False
    theory: bool = False

    @property
    def source(self) -> str:
        """Where the result comes from: "thesis", "paper", "reading" of the thesis, or "theory"."""
        if self.readings:
            return READING
        if self.theory:
            return THEORY
        return PAPER if self.paper else THESIS

    @property
    def place(self) -> str:
        """Section of the thesis, or authors and year of a paper."""
        return self.section if self.paper else f"{THESIS} {self.section}"


@cache
def items() -> dict[str, Item]:
    """Return all results by the number of their figure: thesis (in its order), readings, papers, theories."""
    of_thesis = [item for name in CHAPTERS for item in _items_in(f"thesis.{name}")]
    of_readings = _items_in("thesis.readings")
    of_papers = [item for name in PAPERS for item in _items_in(f"published.{name}")]
    of_theories = [item for name in THEORIES for item in _items_in(f"theory.{name}")]
    in_order = *of_thesis, *of_readings, *sorted(of_papers, key=lambda item: item.figure), *of_theories
    return {item.figure: item for item in in_order}


def _items_in(module: str) -> Sequence[Item]:
    return import_module(f"{PACKAGE}.{module}").ITEMS


def items_of_theory(**make: Callable[[Laboratory], Result]) -> tuple[Item, ...]:
    """Return items of theories by name; their titles, sources and equations are in `theory/theory.toml`."""
    texts = tomllib.loads((resources.files(PACKAGE) / TEXTS).read_text(encoding="utf-8"))
    return tuple(
        Item(
            figure=name,
            title=texts[name]["title"],
            section=texts[name]["section"],
            make=made_by,
            paper=" ".join(texts[name]["paper"].split()),
            about=texts[name]["about"].strip(),
            theory=True,
        )
        for name, made_by in make.items()
    )


def find_item(figure: str) -> Item:
    """Return the result of this number."""
    if figure in RENUMBERED:
        raise UnknownNameError(f"unknown figure {figure!r}; what earlier versions called so is {RENUMBERED[figure]!r}")
    return items()[check_choice("figure", figure, items())]


VERDICTS_IN_WORDS = """\
Verdicts are computed. A check is *passed* if its interval lies entirely within what is required, *failed* if entirely
outside, and *undecided* if it includes the limit. A result is **confirmed** if all its checks are passed, **confirmed
with limits** if all main checks are, and otherwise **not confirmed**, or **refuted** where a main check failed for a
reason that is known and stated. Side claims are in italics. The column "detectable" is the power of a check: how far
beyond the limit of what is required the truth has to be for as many runs to pass the check with a probability of 80 %;
checks without chance are exact, and where all runs gave the same number it is unknown.
"""
INTRODUCTION = f"""\
# Reproduced results

For readers of the thesis: which of its results hold over many seeds, and which do not.

This page is written by `mesa-swarm reproduce --report docs/appendix/reproduction.md`; `mesa-swarm reproduce --figure
8.3` reproduces a single figure, with its picture and table. The thesis reports one run of each behaviour. Here each is
repeated over many seeds, and comparisons are paired by seed: same start positions and same noise. Intervals are 95 %
(Student's t for means and differences, Wilson's for shares).

{VERDICTS_IN_WORDS}
The thesis gives few distances, speeds and constants: we chose the others, which are listed as settings. Where the
thesis leaves open what a number means, a reading with which its results hold was chosen; how much the verdicts depend
on that is on the page [how one reads](readings.md). Settings were chosen in runs with seeds of 10,000 and more, and
settings and criteria were fixed before the judged runs, which have seeds from 1,001 on. Trials of the program had the
first three of these before criteria were fixed (5.8 to 5.10; 8.2 to 8.6 in short runs). After a first judgement
criteria were made stricter in 4.16 and 8.4, replaced in 5.5, where no number of runs could pass, and added in 4.12,
4.13, 8.2 to 8.4, 8.6, 8.7 and 9.4. Earlier verdicts, of seeds from 1 on, led to other measures of cohesion (5.9),
exploration (5.5) and learning (8.2 to 8.7), and are in the list of changes. Two side claims of 8.3, which had failed,
were removed after the judgement: the numbers of collisions that they required are not in the thesis. Figures have the
numbers of the thesis's captions; results without a figure have those of their section or equation. Many results are
pictures in the thesis: the column "thesis" quotes its text about them.
"""
OF_READINGS = f"""\
# How much the verdicts depend on how one reads

For readers of the thesis: what changes where its text can be read in several ways.

This page is written by `mesa-swarm reproduce --readings --report docs/appendix/readings.md`.

{VERDICTS_IN_WORDS}
Settings and criteria were fixed, and committed, before the runs that are judged, which have seeds from 1,001 on. The
combinations are all that the three questions allow; none was left out. Verdicts on this page are about what a reading
changes; the second table of each section has the claims of the thesis that hold under it. To repeat a single section:
`mesa-swarm reproduce --figure readings-8.3`.
"""
OF_PAPERS = f"""\
# Published results

For readers of the papers: which of their results the models of the gallery reproduce.

This page is written by `mesa-swarm reproduce --published --report docs/appendix/published.md`; `mesa-swarm reproduce
--figure task_allocation` reproduces a single result, with its picture and table. Each result is one model of the
gallery, built on public names alone, beside what a paper reports. Runs are repeated over many
seeds; comparisons are paired by seed. Intervals are 95 % (Student's t for means and differences, Wilson's for shares).

{VERDICTS_IN_WORDS}
Settings and criteria were fixed before the runs that are judged, which have seeds from 1 on; settings were chosen in
runs with seeds of 10,000 and more. The robots differ from the animals and robots of the papers: each section states
how.
"""
OF_THEORIES = f"""\
# Validation: what physics predicts

For users who want to trust the engine: runs beside what can be computed with pencil and paper.

This page is written by `mesa-swarm validate --report docs/appendix/validation.md`; with `--quick` the command is a
trial of a minute. Whatever can be computed with pencil and paper is measured here in runs of the package, each repeated
over many seeds.

Verdicts are computed. A check is *passed* if the {100 * AGAINST_THEORY:g} % interval of the mean over runs (Student's
t) includes the theory and is as narrow as required, *undecided* if it includes the theory but is wider, and *failed*
if it excludes the theory. The interval is that wide because there are many comparisons: with 70 of them, and theories
that are right, one or more fail by chance in 7 % of all repetitions. What is printed are the usual 95 % intervals, of
which one in twenty does not include even a theory that is right. The column "detectable" is the error of a theory that
as many runs detect with a probability of 80 %. Other checks are passed if their 95 % interval lies within what is
required. A result is **confirmed** if all its checks are passed, **confirmed with limits** if all main checks are;
side claims are in italics.

Settings and criteria were fixed before the runs that are judged, which have seeds from 1,001 on; settings were chosen
in runs with seeds of 10,000 and more, and none was changed afterwards. Theories are compared at settings where they
hold; a claim about settings where they do not states so. To repeat a single section: `mesa-swarm validate --only
kinetic_collisions`.
"""
OF_A_SELECTION = """\
# Selected results

This page has only these of the {total} results of the thesis, of readings of it, of papers and of theories: {names}. It
is written by `mesa-swarm {command} --report FILE.md`.

Intervals are 95 % (Student's t for means and differences, Wilson's for shares).

"""

INTRODUCTIONS = {THESIS: INTRODUCTION, READING: OF_READINGS, PAPER: OF_PAPERS, THEORY: OF_THEORIES}


@dataclass(frozen=True, kw_only=True, slots=True)
class Made:
    """A reproduced result, and the seconds that it took."""

    item: Item
    result: Result
    seconds: float


def report(made: Sequence[Made], *, quick: bool = False, runs: tuple[int, int] = (0, 0)) -> str:
    """Return the page; it states if few seeds were enough, and how many runs were made and found."""
    parts = [
        introduction_of(made),
        surroundings(made, quick, runs),
        summary(made, quick),
        *(section(one, quick) for one in made),
    ]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def is_selection(made: Sequence[Made]) -> bool:
    """Return whether these are fewer than all results of one source."""
    sources, figures = {one.item.source for one in made}, {one.item.figure for one in made}
    return len(sources) > 1 or any(item.source in sources and item.figure not in figures for item in items().values())


def introduction_of(made: Sequence[Made]) -> str:
    """Return what begins a page of these results."""
    sources = {one.item.source for one in made}
    of_source = INTRODUCTIONS[sources.copy().pop()] if len(sources) == 1 else INTRODUCTION
    if not is_selection(made):
        return of_source
    names = [one.item.figure for one in made]
    command, option = ("validate", "--only") if sources == {THEORY} else ("reproduce", "--figure")
    words = " ".join([command, *(f"{option} {name}" for name in names)])
    begin = OF_A_SELECTION.format(names=", ".join(names), total=len(items()), command=words)
    # Without the title and the paragraph about the whole page; what is settled for all results of a source follows.
    return begin + (VERDICTS_IN_WORDS if len(sources) > 1 else of_source.split("\n\n", 2)[2])


def surroundings(made: Sequence[Made], quick: bool, runs: tuple[int, int]) -> str:
    """Return the versions, the time that it took, and the load of the machine."""
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores" if hasattr(os, "getloadavg") else "load unknown"
    few = "\n**Few seeds, short runs (`--quick`): these verdicts mean nothing.**\n" if quick else ""
    minutes = sum(one.seconds for one in made) / 60
    done, found = runs
    reused = f", and {found:,} of an earlier call were reused" if found else ""
    return (
        f"{few}\nMade with NumPy {np.__version__} and Numba {numba.__version__} in {minutes:.0f} minutes, {load}: "
        f"{done:,} runs were made{reused}.\n"
    )


def marked(result: Result, quick: bool) -> str:
    """Return the verdict, marked where it is one of few seeds, which may leave all that did not pass undecided."""
    if not quick:
        return result.verdict
    outcomes = {check.outcome for check in result.checks}
    return f"{UNDECIDED if UNDECIDED in outcomes and FAILED not in outcomes else result.verdict} (quick)"


def summary(made: Sequence[Made], quick: bool) -> str:
    """Return how many results have which verdict, and a line for each."""
    count = {name: sum(one.result.verdict == name for one in made) for name in VERDICTS}
    counted = ", ".join(f"{number} {name}" for name, number in count.items())
    lines = [
        (one.item.figure, one.item.title, f"**{marked(one.result, quick)}**", "; ".join(one.result.limits) or "-")
        for one in made
    ]
    table = table_of(("figure", "shows", "verdict", "not passed"), lines)
    return f"## {'Selected' if is_selection(made) else 'All'} results\n\n{counted}.\n\n{table}"


def section(one: Made, quick: bool = False) -> str:
    """Return the section of one result, in which the claims that are not main ones are in italics."""
    rows = [(check.claim if check.main else f"*{check.claim}*", *check.row[1:]) for check in one.result.checks]
    remarks = "".join(f"\n- {remark}" for remark in one.result.remarks)
    where = one.item.paper or f"Thesis {one.item.section}."
    why = f"{one.result.reason}\n\n" if one.result.reason else ""
    table = table_of(header(one.item.source), rows)
    more = f"\n\n{one.result.table}" if one.result.table else ""
    return (
        f"## {one.item.figure}: {one.item.title}\n\n"
        f"{where} **{marked(one.result, quick).capitalize()}.**\n\n"
        f"{why}{described(one.item)}{table}{more}\n\nSettings: {one.result.settings}.\n{remarks}"
    )


def described(item: Item) -> str:
    """Return the paragraph about the result of a paper or of readings, and the picture."""
    about = f"{item.about}\n\n" if item.about else ""
    return f"{about}![{item.title}](pictures/{item.figure}.png)\n\n"


def table_of(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, *rows]
    cells = ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]
    return "\n".join([cells[0], "|" + "---|" * len(header), *cells[1:]])
