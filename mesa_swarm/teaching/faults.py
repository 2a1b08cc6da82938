"""Whose error it is that a check of an exercise met: the learner's, or the check's own."""

import functools
import linecache
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, FunctionType, TracebackType
from typing import Any

from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.errors import SwarmError, shortened, without_middle

PACKAGE = str(Path(__file__).parent.parent)
LIBRARIES = ("site-packages", "dist-packages", "<frozen")
# Names that are missing in a check are missing whatever the answer is.
UNDENIABLE = NameError, ImportError


class CheckError(Exception):
    """An error of the check itself; its cause is what happened."""

    def __init__(self, seed: int | None = None) -> None:
        super().__init__(seed)
        self.seed = seed


def code_of(thing: Any) -> set[CodeType]:
    """Return the code of a function, rule, layer or class: what is defined within it, and its methods.

    Examples
    --------
    >>> len(code_of(lambda: [lambda: 1])), code_of(3)
    (2, set())
    """
    if isinstance(thing, FunctionType):
        return set(_nested(thing.__code__))
    if isinstance(thing, type):
        own = thing.__module__.partition(".")[0] not in ("builtins", "mesa_swarm")
        return set().union(*map(code_of, vars(thing).values())) if own else set()
    within = _function_within(thing)
    if within is not None:
        return code_of(within)
    return code_of(type(thing)) if hasattr(thing, "decide") else set()


def _function_within(thing: Any) -> Any:
    """Return the function of a rule, a method, a property or a function with fixed arguments, None for others."""
    if isinstance(thing, Behaviour):
        return thing.rule.function
    if isinstance(thing, functools.partial):
        return thing.func
    within = getattr(thing, "__func__", getattr(thing, "__wrapped__", None))  # of a method, or behind functools.cache
    return thing.fget if isinstance(thing, property) else within


def _nested(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _nested(constant)


@dataclass(frozen=True, slots=True)
class Place:
    """A line that is neither the package's nor a library's."""

    code: CodeType
    number: int

    @property
    def line(self) -> str:
        """Its text, "" if it is not known."""
        return linecache.getline(self.code.co_filename, self.number).strip()


def places_of(trace: TracebackType | None) -> list[Place]:
    """Return the places of a traceback that are neither the package's nor a library's, the last one first."""
    places = [Place(frame.f_code, number) for frame, number in traceback.walk_tb(trace)]
    return [place for place in places[::-1] if not _is_of_library(place.code.co_filename)]


def _is_of_library(file: str) -> bool:
    return file.startswith(PACKAGE) or any(part in file for part in LIBRARIES)


@dataclass(frozen=True, slots=True)
class Authors:
    """Whose code is whose.

    Parameters
    ----------
    answer : object
        The learner's: a function, rule, class, layer or plain value.
    check : tuple of callable
        What the check is made of.
    """

    answer: Any
    check: tuple[Any, ...] = ()

    def is_learners(self, place: Place) -> bool | None:
        """Return whether the learner wrote the code of a place; None if that is not known, as of helper functions."""
        own, checks = code_of(self.answer), set().union(*map(code_of, self.check))
        if place.code in own or place.code in checks:
            return place.code in own
        in_own, in_checks = (place.code.co_filename in {code.co_filename for code in codes} for codes in (own, checks))
        return None if in_own == in_checks else in_own

    def is_last_learners(self, error: BaseException) -> bool | None:
        """Return whether the learner wrote the last place of an error of which that is known."""
        known = map(self.is_learners, places_of(error.__traceback__))
        return next((learners for learners in known if learners is not None), None)

    def in_words(self, error: BaseException, *, surely: bool = False) -> str:
        """Return an error of an answer in words, with the line of the learner's own code where it happened.

        What happened in code that the learner may not have written is named as such, unless the answer is `surely` its
        cause.
        """
        text = " ".join(str(error).split())
        places = [place for place in places_of(error.__traceback__) if place.line]
        if not isinstance(error, SwarmError):
            own = next((place.line for place in places if self.is_learners(place)), "")
            text = f"it stopped with {type(error).__name__}: {text or 'no details'}{own and f', at the line: {own}'}"
        if surely or not places or self.is_learners(places[0]):
            return text
        return (
            f"{text.rstrip('.')}. This happened in {places[0].code.co_name}, at the line: {places[0].line}; if you did "
            "not write that, and your answer is what is required, send this to your teacher"
        )


@contextmanager
def part_of_check(authors: Authors, seed: int | None = None, *, uses_answer: bool = False) -> Iterator[None]:
    """Turn errors of the check's own code into CheckError; those of the learner's code are passed on.

    With `uses_answer`, in code that works on what the learner gave, only such errors are the check's for certain as do
    not depend on that, such as a name that is missing: the others are passed on too.
    """
    try:
        yield
    except CheckError:
        raise
    except Exception as error:
        learners = authors.is_last_learners(error)
        if learners or (uses_answer and not (learners is False and isinstance(error, UNDENIABLE))):
            raise
        raise CheckError(seed) from error


def also_without(run: Callable[[], Any], seed: int) -> None:
    """Raise CheckError if what has failed with an answer fails without it too."""
    try:
        run()
    except Exception as error:
        raise CheckError(seed) from error


def report(error: CheckError, version: str) -> str:
    """Return what the learner is to send to the teacher: the error, where it happened, and with which seed."""
    cause = error.__cause__ or error
    lines = [f"{type(cause).__name__}: {' '.join(str(cause).split()) or 'no details'}"]
    places = places_of(cause.__traceback__)[:1]
    lines += [f"in {place.code.co_name}, line {place.number}: {place.line or 'unknown'}" for place in places]
    seed = "" if error.seed is None else f"with seed {shortened(error.seed)}, "
    return "\n".join(f"  {without_middle(line)}" for line in [*lines, f"{seed}mesa_swarm {version}"])
