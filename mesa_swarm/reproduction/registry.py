"""Which results of the thesis are made again, and which function makes each."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module

from mesa_swarm.errors import check_choice
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.result import Result

# A module for each subject, in the thesis's order.
CHAPTERS = ("complexity", "swarms", "networks", "learning", "fire_fighting", "fire_growth", "maps")


@dataclass(frozen=True, kw_only=True, slots=True)
class Item:
    """One result of the thesis.

    Parameters
    ----------
    figure : str
        Its number.
    title : str
        What it shows.
    section : str
        Where the thesis tells of it.
    make : callable
        Takes a `Laboratory` and returns a `Result`.
    """

    figure: str
    title: str
    section: str
    make: Callable[[Laboratory], Result]


@cache
def items() -> dict[str, Item]:
    """Return all results by the number of their figure, in the thesis's order.

    Examples
    --------
    >>> list(items())[:2], len(items())
    (['4.12', '4.13'], 28)
    """
    modules = (import_module(f"mesa_swarm.reproduction.{name}") for name in CHAPTERS)
    return {item.figure: item for module in modules for item in module.ITEMS}


def find_item(figure: str) -> Item:
    """Return the result of this number.

    Raises
    ------
    UnknownNameError
        With the nearest number, if there is none.

    Examples
    --------
    >>> find_item("7.3").section
    '7.4'
    """
    return items()[check_choice("figure", figure, items())]
