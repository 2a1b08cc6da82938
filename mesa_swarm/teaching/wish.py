"""What an exercise asks of a run."""

import math
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any

from mesa_swarm.errors import InvalidValueError, UnknownNameError, check_count, unknown_name


@dataclass(frozen=True, slots=True)
class Wish:
    """What is asked of one number of every run.

    Parameters
    ----------
    what : str
        Name of the number: of a model's `results`, of an attribute of it, or of an entry of a mapping. With
        `measure` it only names it.
    at_least, at_most : float
        Limits, both included; at least one of them is given.
    measure : callable, optional
        Takes what a run gave, such as the model, and returns the number.
    misses : int
        On so many seeds it may be missed, at least 0.

    Raises
    ------
    InvalidValueError
        If no limit is given.

    Examples
    --------
    >>> print(Wish("fires out", at_least=7))
    fires out: at least 7
    >>> Wish("fires out", at_least=7).is_met(6)
    False
    """

    what: str
    _: KW_ONLY
    at_least: float = -math.inf
    at_most: float = math.inf
    measure: Callable[[Any], float] | None = None
    misses: int = 0

    def __post_init__(self) -> None:
        """Check that something is asked."""
        check_count("misses", self.misses)
        if self.at_least == -math.inf and self.at_most == math.inf:
            raise InvalidValueError(f"wish {self.what!r} has no limit; give at_least, at_most or both")

    def __str__(self) -> str:
        """Return what is asked in words."""
        low = f"at least {self.at_least:,g}" if self.at_least > -math.inf else ""
        high = f"at most {self.at_most:,g}" if self.at_most < math.inf else ""
        return f"{self.what}: {' and '.join(part for part in (low, high) if part)}"

    def is_met(self, number: float | None) -> bool:
        """Tell whether a number is as asked; None says that it did not happen."""
        return number is not None and self.at_least <= number <= self.at_most

    def number_of(self, outcome: Any) -> float | None:
        """Return the number that a run gave.

        Examples
        --------
        >>> Wish("turns", at_most=3).number_of({"turns": 2})
        2
        """
        if self.measure is not None:
            return self.measure(outcome)
        results = outcome if isinstance(outcome, Mapping) else getattr(outcome, "results", dict)()
        if self.what in results:
            return results[self.what]
        if not isinstance(outcome, Mapping) and hasattr(outcome, self.what):
            return getattr(outcome, self.what)
        raise UnknownNameError(unknown_name("result", self.what, results))
