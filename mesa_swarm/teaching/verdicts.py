"""What an exercise requires of the numbers of its runs, and the verdict on an answer."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, check_count, unknown_name


@dataclass(frozen=True, slots=True)
class Criterion:
    """A criterion for one number of every run.

    Parameters
    ----------
    what : str
        Name of the number: of a model's `results`, of an attribute of it, or of an entry of a mapping. With
        `measure` it is only a label.
    at_least, at_most : float
        Limits, both included; at least one of them is given.
    measure : callable, optional
        Takes what a run gave, such as the model, and returns the number.
    misses : int
        The number of seeds on which it may fail, at least 0.

    Raises
    ------
    InvalidValueError
        If no limit is given.

    Examples
    --------
    >>> print(Criterion("fires out", at_least=7))
    fires out: required >= 7
    >>> Criterion("fires out", at_least=7).is_met(6)
    False
    """

    what: str
    _: KW_ONLY
    at_least: float = -math.inf
    at_most: float = math.inf
    measure: Callable[[Any], float] | None = None
    misses: int = 0

    def __post_init__(self) -> None:
        check_count("misses", self.misses)
        if self.at_least == -math.inf and self.at_most == math.inf:
            raise InvalidValueError(f"{self.what!r} has no limit; give at_least, at_most or both")

    def __str__(self) -> str:
        low = f">= {self.at_least:,g}" if self.at_least > -math.inf else ""
        high = f"<= {self.at_most:,g}" if self.at_most < math.inf else ""
        return f"{self.what}: required {' and '.join(part for part in (low, high) if part)}"

    def is_met(self, number: float | None) -> bool:
        """Return whether a number is within the limits, but for rounding; None is not."""
        if number is None:
            return False
        return self.at_least - rounding(self.at_least) <= number <= self.at_most + rounding(self.at_most)

    def number_of(self, outcome: Any) -> float | None:
        """Return the number that a run gave."""
        if self.measure is not None:
            return self.measure(outcome)
        results = outcome if isinstance(outcome, Mapping) else getattr(outcome, "results", dict)()
        if self.what in results:
            return results[self.what]
        if not isinstance(outcome, Mapping) and hasattr(outcome, self.what):
            return getattr(outcome, self.what)
        raise UnknownNameError(unknown_name("result", self.what, results))


def rounding(limit: float) -> float:
    """Return by how much a number may miss a limit that it meets on paper."""
    return ROUNDING * max(1.0, abs(limit)) if math.isfinite(limit) else 0.0


ROUNDING = 1e-6
PASSED = "All criteria met."
NOT_YET = "Not yet."
FAILED_CHECK = "The check itself failed: this is not a mistake in your answer. Please send these lines to your teacher:"
# What a check has done with an answer.
JUDGED, NOT_JUDGED, CHECK_FAILED = "judged", "not judged", "check failed"


@dataclass(frozen=True, slots=True, repr=False)
class Verdict:
    """Whether an answer passes, and why: one line of text or more.

    The status is "judged", "not judged" for an answer that could not be, or "check failed" for an error of the check.
    """

    passed: bool
    text: str
    hint: str = ""
    status: str = JUDGED

    def __repr__(self) -> str:
        if self.passed:
            return f"{PASSED}\n{self.text}"
        if self.status == CHECK_FAILED:
            return f"{FAILED_CHECK}\n{self.text}"
        text = f"{NOT_YET} {self.text[:1].upper()}{self.text[1:].rstrip('.')}."
        if "\n" in self.text or self.text.startswith(" "):
            text = f"{NOT_YET}\n{self.text}"
        return f"{text}\nHint: {self.hint}{'' if self.hint.endswith(('.', '?')) else '.'}" if self.hint else text

    __str__ = __repr__


def verdict_on(
    criteria: Sequence[Criterion], numbers: Sequence[Sequence[float | None]], seeds: Sequence[int]
) -> Verdict:
    """Return the verdict on measured numbers, a row a criterion."""
    rows = list(zip(criteria, numbers, strict=True))
    passes = all(sum(not criterion.is_met(number) for number in row) <= criterion.misses for criterion, row in rows)
    return Verdict(passes, "\n".join(_line(criterion, row, seeds) for criterion, row in rows))


def _line(criterion: Criterion, row: Sequence[float | None], seeds: Sequence[int]) -> str:
    successes, runs = sum(map(criterion.is_met, row)), len(row)
    numbers = ", ".join(map(format_number, row))
    enough = f" ({runs - criterion.misses} required)" if criterion.misses else ""
    return f"  {criterion}; measured {numbers} with {seeds_in_words(seeds)}; {successes} of {runs} seeds pass{enough}"


def format_number(number: float | None) -> str:
    """Return a number for a reader, "undefined" for None and NaN."""
    if number is None or math.isnan(number):
        return "undefined"
    return f"{float(number):,.4g}" if abs(number) < 1000 else f"{number:,.0f}"


def seeds_in_words(seeds: Sequence[int]) -> str:
    """Return which seeds these are."""
    first, last, count = seeds[0], seeds[-1], len(seeds)
    if count > 2 and list(seeds) == list(range(first, last + 1)):
        return f"seeds {first} to {last}"
    names = ", ".join(map(str, seeds[:-1]))
    return f"seeds {names} and {last}" if count > 1 else f"seed {first}"
