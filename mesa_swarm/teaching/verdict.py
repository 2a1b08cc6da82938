"""What an exercise says of an answer, in plain words."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mesa_swarm.teaching.wish import Wish

PASSED = "Well done: what was asked for came."
NOT_YET = "Not yet."


@dataclass(frozen=True, slots=True, repr=False)
class Verdict:
    """Whether an answer passes, and what is said of it.

    Parameters
    ----------
    passed : bool
    text : str
        One line or more.

    Examples
    --------
    >>> Verdict(False, "there is no answer so far", hint="look at the left wheel")
    Not yet. There is no answer so far.
    Hint: look at the left wheel.
    """

    passed: bool
    text: str
    hint: str = ""

    def __repr__(self) -> str:
        """Return what a notebook shows."""
        if self.passed:
            return f"{PASSED}\n{self.text}"
        said = f"{NOT_YET}\n{self.text}" if "\n" in self.text or self.text.startswith(" ") else self._sentence()
        return f"{said}\nHint: {self.hint}{'' if self.hint.endswith(('.', '?')) else '.'}" if self.hint else said

    __str__ = __repr__

    def _sentence(self) -> str:
        return f"{NOT_YET} {self.text[:1].upper()}{self.text[1:].rstrip('.')}."


def verdict_on(
    wishes: Sequence[Wish], numbers: Sequence[Sequence[float | None]], seeds: Sequence[int], hint: str
) -> Verdict:
    """Return the verdict on the numbers that came, a row a wish.

    Examples
    --------
    >>> verdict_on([Wish("turns", at_most=3)], [[2, 5]], seeds=[1, 2], hint="")
    Not yet.
      turns: at most 3 was asked for; with seeds 1 and 2 came 2, 5: as asked with 1 of 2 seeds
    """
    rows = list(zip(wishes, numbers, strict=True))
    passed = all(sum(not wish.is_met(number) for number in row) <= wish.misses for wish, row in rows)
    return Verdict(passed, "\n".join(_line(wish, row, seeds) for wish, row in rows), hint)


def _line(wish: Wish, row: Sequence[float | None], seeds: Sequence[int]) -> str:
    met, runs = sum(map(wish.is_met, row)), len(row)
    came = ", ".join(map(shown, row))
    enough = f" ({runs - wish.misses} are enough)" if wish.misses else ""
    score = f"all {runs}" if met == runs else f"{met} of {runs}"
    return f"  {wish} was asked for; with {seeds_in_words(seeds)} came {came}: as asked with {score} seeds{enough}"


def shown(number: float | None) -> str:
    """Return a number as a reader wants it, or that it never came.

    Examples
    --------
    >>> shown(1234.5678), shown(None), shown(True)
    ('1,235', 'never', '1')
    """
    if number is None or math.isnan(number):
        return "never"
    return f"{float(number):,.4g}" if abs(number) < 1000 else f"{number:,.0f}"


def seeds_in_words(seeds: Sequence[int]) -> str:
    """Return which seeds these are.

    Examples
    --------
    >>> seeds_in_words([101, 102, 103]), seeds_in_words([4, 9]), seeds_in_words([4])
    ('seeds 101 to 103', 'seeds 4 and 9', 'seed 4')
    """
    first, last, count = seeds[0], seeds[-1], len(seeds)
    if count > 2 and list(seeds) == list(range(first, last + 1)):
        return f"seeds {first} to {last}"
    names = ", ".join(map(str, seeds[:-1]))
    return f"seeds {names} and {last}" if count > 1 else f"seed {first}"
