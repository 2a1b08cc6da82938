"""Which steps of a recording are exported, of those that were asked for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_count, shortened


@dataclass(frozen=True, kw_only=True, slots=True)
class Choice:
    """Which steps are wanted.

    Parameters
    ----------
    steps : sequence of int, optional
        Exactly these.
    every : int, optional
        All that are multiples of it, at least 1.
    first, last : int, optional
        None before and none after these.

    Raises
    ------
    InvalidValueError
        If steps are given beside the others, or `last` is before `first`.
    """

    steps: Sequence[int] | None = None
    every: int | None = None
    first: int | None = None
    last: int | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        if self.steps is not None:
            self._check_steps(self.steps)
        if self.every is not None:
            check_count("every", self.every, minimum=1)
        first = 0 if self.first is None else check_count("first (--from)", self.first)
        if self.last is not None and check_count("last (--to)", self.last) < first:
            raise InvalidValueError(f"last (--to) is {self.last}, before first (--from), {first}; exchange them")

    @property
    def is_made(self) -> bool:
        """Whether anything was asked for."""
        return (self.steps, self.every, self.first, self.last) != (None, None, None, None)

    def _check_steps(self, steps: Sequence[int]) -> None:
        if (self.every, self.first, self.last) != (None, None, None):
            raise InvalidValueError("steps are given beside every, first or last; give either")
        if isinstance(steps, (str, int)) or not len(steps):
            raise InvalidValueError(f"steps is {shortened(steps)}; expected a list such as [0, 1000, 3000]")
        for step in steps:
            check_count("step", step)

    def among(self, there: np.ndarray) -> list[int]:
        """Return the wanted ones of the steps that there are, ascending.

        Raises
        ------
        InvalidValueError
            If one of them is not there, or none is.

        Examples
        --------
        >>> Choice(every=10, first=5).among(np.arange(1, 31))
        [10, 20, 30]
        >>> Choice(steps=[3, 1]).among(np.arange(1, 31))
        [1, 3]
        """
        if self.steps is not None:
            return sorted({_checked_step(int(step), there) for step in self.steps})
        every = _checked_every(self.every, there)
        first, last = _checked_ends(self.first, self.last, there)
        wanted = there[(there >= first) & (there <= last) & (there % every == 0)]
        if not len(wanted):
            raise InvalidValueError(f"no step from {first} to {last} is a multiple of {every}; choose a smaller every")
        return wanted.tolist()

    def thinned(self, there: np.ndarray, most: int) -> list[int]:
        """Return the wanted ones; if `every` was not given, so that they are at most `most`, evenly spaced."""
        if self.every is not None:
            return self.among(there)
        all_steps = self.among(there)
        gap = _gap(there)
        stride = -(-len(all_steps) // most) * gap
        kept = [step for step in all_steps if step % stride == 0]
        return kept if len(kept) > 1 else all_steps[:: stride // gap]


def _checked_step(step: int, there: np.ndarray) -> int:
    if step in there:
        return step
    place = int(np.searchsorted(there, step))
    near = f"; the nearest are {there[place - 1]} and {there[place]}" if 0 < place < len(there) else ""
    raise InvalidValueError(f"step {step} was not recorded; {_in_words(there)}{near}")


def _checked_every(every: int | None, there: np.ndarray) -> int:
    """Refuse intervals that would silently become longer ones."""
    gap = _gap(there)
    if every is not None and every % gap:
        raise InvalidValueError(f"every is {every}; every {gap} steps were recorded, so give a multiple of {gap}")
    return 1 if every is None else every


def _checked_ends(first: int | None, last: int | None, there: np.ndarray) -> tuple[int, int]:
    for name, end in (("first (--from)", first), ("last (--to)", last)):
        if end is not None and not 0 <= end <= there[-1]:
            raise InvalidValueError(f"{name} is {end}; {_in_words(there)}")
    return int(there[0]) if first is None else first, int(there[-1]) if last is None else last


def _gap(there: np.ndarray) -> int:
    """Return how many steps are between two rows."""
    return int(np.gcd.reduce(np.diff(there))) if len(there) > 1 else 1


def _in_words(there: np.ndarray) -> str:
    return f"there are {len(there)} steps from {there[0]} to {there[-1]}"
