"""All that the thesis contains, item by item, with its state here; the page of differences is written from it.

The items and deviations are in `differences.toml` beside this file.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import groupby, pairwise

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_name
from mesa_swarm_studies.registry import table_of

# Of an item: as in the thesis, with a deviation that is stated, left out on purpose, or not there.
WORKS, DIFFERS, NOT_TAKEN, MISSING = "works", "differs", "not taken over", "missing"
STATES = (WORKS, DIFFERS, NOT_TAKEN, MISSING)
COUNTED = dict(zip(STATES, ("work", "differ", "are not taken over", "are missing"), strict=True))
PRESENT = (WORKS, DIFFERS)
SOURCE = "differences.toml"


@dataclass(frozen=True, kw_only=True, slots=True)
class ThesisItem:
    """One thing that the thesis contains, and its state here.

    Parameters
    ----------
    number : int
        From 1 on.
    section : str
        Of the thesis.
    thesis : str
        What it contains or requires.
    state : str
        One of `STATES`.
    here : str
        The deviation and its reason, or what is missing; a remark on what works.
    where : tuple of str
        Names as ``module:name``, of the studies as ``studies.module:name``, or files of the repository.
    tests : tuple of str
        The tests that prove it, as pytest names them. What works or differs needs both.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> thesis_items()[0].state
    'works'
    """

    number: int
    section: str
    thesis: str
    state: str
    here: str = ""
    where: tuple[str, ...] = ()
    tests: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that everything that its state requires is there."""
        check_count("number", self.number, minimum=1)
        name = f"item {self.number}"
        check_choice(f"state of {name}", self.state, STATES)
        _check_texts(name, section=self.section, thesis=self.thesis)
        if self.state in PRESENT:
            _check_texts(name, where=self.where, tests=self.tests)
        if self.state != WORKS:
            _check_texts(name, here=self.here)


@dataclass(frozen=True, kw_only=True, slots=True)
class Deviation:
    """What the thesis prints, and what is done here instead.

    Parameters
    ----------
    number : str
        Such as "E3" for errors and open points of the thesis, and "F3" for other deviations.
    subject, section, printed, here : str
        Group on the page, place in the thesis, what is printed there, and what is done here and why.
    where, tests : tuples of str
        See `ThesisItem`.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> deviations()[0].section
    'A.16'
    """

    number: str
    subject: str
    section: str
    printed: str
    here: str
    where: tuple[str, ...]
    tests: tuple[str, ...]

    def __post_init__(self) -> None:
        """Check that nothing is empty."""
        check_name("number", self.number)
        given = {name: getattr(self, name) for name in ("subject", "section", "printed", "here", "where", "tests")}
        _check_texts(f"deviation {self.number}", **given)


def _check_texts(name: str, **given: str | tuple[str, ...]) -> None:
    empty = [word for word, value in given.items() if not value]
    if empty:
        raise InvalidValueError(f"{name} has no {' and no '.join(empty)}; expected a text in {SOURCE}")


@cache
def _content() -> dict:
    return tomllib.loads((resources.files(__package__) / SOURCE).read_text(encoding="utf-8"))


@cache
def thesis_items() -> tuple[ThesisItem, ...]:
    """Return all items of the thesis by their numbers.

    Examples
    --------
    >>> len(thesis_items())
    205
    """
    return tuple(sorted((ThesisItem(**_entry(one)) for one in _content()["item"]), key=lambda item: item.number))


@cache
def deviations() -> tuple[Deviation, ...]:
    """Return all deviations, subject by subject."""
    return tuple(Deviation(**_entry(one)) for one in _content()["deviation"])


def _entry(fields: dict) -> dict:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}


def chapters() -> dict[str, tuple[ThesisItem, ...]]:
    """Return the items by the titles of the chapters that they are in."""
    starts = [*_content()["chapters"].items(), ("", len(thesis_items()) + 1)]
    return {
        title: tuple(item for item in thesis_items() if first <= item.number < end)
        for (title, first), (_, end) in pairwise(starts)
    }


def counted() -> str:
    """Return how many items are in which state.

    Examples
    --------
    >>> counted().split(" items")[0]
    '205'
    """
    count = Counter(item.state for item in thesis_items())
    counts = ", ".join(f"{count[state]} {COUNTED[state]}" for state in STATES if count[state])
    return f"{count.total()} items: {counts}"


INTRODUCTION = """\
# Differences from the thesis

For readers of the thesis: where this package deviates from it, and where each of its items is.

mesa_swarm reimplements the simulations of a thesis of the University of Cape Town (*Development of a Simple Swarm
Behaviour Simulator and Development of a Reinforcement Learning AI System for Swarm Members*; the simulator was RAS2D).
This page lists every deviation, and then everything that the thesis contains with its state here. It is written by
`mesa-swarm reproduce --items --report docs/appendix/differences.md`; without `--report` the command prints the items.

Each row names the code and, in italics, the tests that prove it: with underscores for spaces and `test_` before it,
such a sentence is the name of a test; the words of its class come first, if it has one. Another test ensures that all
these names exist. Figures have verdicts of
their own, see [reproduced results](reproduction.md); equations are on the page [physics](../physics.md).
"""
DEVIATIONS = """\
## Deviations

Where the thesis is wrong, incomplete or contradictory, and what is done here. Numbers with E are errors and open
points of the thesis; those with F are deviations for other reasons.
"""
ITEMS = """\
## All items of the thesis

{counted}.

*Differs*: it is there, with the stated deviation. *Missing*: it is not there, but could be. *Not taken over*: it is
left out on purpose.
"""


def page() -> str:
    """Return the page, as Markdown."""
    parts = [INTRODUCTION, DEVIATIONS]
    parts += [_section(subject, _table_of_deviations(some)) for subject, some in by_subject()]
    parts += [ITEMS.format(counted=counted())]
    parts += [_section(title, _table_of_items(some)) for title, some in chapters().items()]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def by_subject() -> list[tuple[str, list[Deviation]]]:
    """Return subjects with their deviations, in the order of the file."""
    return [(subject, list(some)) for subject, some in groupby(deviations(), key=lambda one: one.subject)]


def _section(title: str, table: str) -> str:
    return f"### {title}\n\n{table}"


def _table_of_deviations(some: Iterable[Deviation]) -> str:
    rows = [(_named(one.number, one.section, one.printed), one.here, _proof(one.where, one.tests)) for one in some]
    return table_of(("printed", "here, and why", "code and proof"), rows)


def _table_of_items(some: Iterable[ThesisItem]) -> str:
    rows = [
        (_named(one.number, one.section, one.thesis), _state(one.state, one.here), _proof(one.where, one.tests))
        for one in some
    ]
    return table_of(("the thesis", "here", "code and proof"), rows)


def _named(number: int | str, section: str, text: str) -> str:
    return f"**{number}** ({section}) {text}"


def _state(state: str, here: str) -> str:
    shown = state if state == WORKS else f"**{state}**"
    return f"{shown}: {here}" if here else shown


def _proof(where: Sequence[str], tests: Sequence[str]) -> str:
    names = ", ".join(f"`{place}`" for place in where)
    return "; ".join([names, *(f"*{sentence(test)}*" for test in tests)]) if where else "-"


def sentence(test: str) -> str:
    """Return what a test proves, as its name states it, with the words of its class first.

    Examples
    --------
    >>> sentence("tests/robots/test_wheels.py::TestEveryWheel::test_is_round")
    'every wheel is round'
    """
    words = [re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.removeprefix("Test")).lower() for name in test.split("::")[1:]]
    return " ".join(words).replace(" test_", " ").removeprefix("test_").replace("_", " ")


def lines() -> list[str]:
    """Return a line for each item, for a terminal, and one that counts them."""
    return [*(f"{one.number:3} {one.state:8} {one.thesis}" for one in thesis_items()), counted()]
