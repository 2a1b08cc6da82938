"""Hints in stages: which one an exercise shows after how many answers."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any


@dataclass
class Tries:
    """How many answers in a row an exercise has refused, and the last of them."""

    count: int = 0
    answer: Any = None

    def add(self, answer: Any) -> bool:
        """Count an answer and return True, unless it is the last one again: its cell has not run since."""
        if self.count and is_same(self.answer, answer):
            return False
        self.count, self.answer = self.count + 1, kept(answer)
        return True


# By the stages of the exercise's hint.
_tries: dict[tuple[str, ...], Tries] = {}


def forget(stages: tuple[str, ...]) -> None:
    """Let an exercise begin with the first stage again."""
    _tries.pop(stages, None)


def next_stage(hint: str | Sequence[str], answer: Any, *, judged: bool) -> str:
    """Return the hint after an answer that did not pass, "" for none.

    Parameters
    ----------
    hint : str or sequence of str
        Its stages.
    answer : object
        The learner's.
    judged : bool
        Whether the answer was judged: one that could not be, such as one with a misspelt name, uses no stage up, and
        shows again what was shown.
    """
    stages = stages_of(hint)
    tries = _tries.setdefault(stages, Tries()) if any(stages) else Tries()
    new = tries.add(answer) if judged and any(stages) else True
    if not tries.count:
        return ""
    stage = min(tries.count, len(stages))
    again = "" if new else "; your answer is the same as before"
    label = f"({stage} of {len(stages)}{again}) " if len(stages) > 1 else ""
    return label + stages[stage - 1]


def stages_of(hint: str | Sequence[str]) -> tuple[str, ...]:
    """Return the stages of a hint."""
    return (hint,) if isinstance(hint, str) else tuple(hint)


def is_code(answer: Any) -> bool:
    """Return whether an answer is a function, a rule or a class, which a cell makes anew when it runs."""
    return callable(answer) or hasattr(answer, "decide")


def kept(answer: Any) -> Any:
    """Return an answer as it is now: numbers may be changed in place, functions are replaced."""
    try:
        return answer if is_code(answer) else deepcopy(answer)
    except Exception:  # an answer of any type may be given
        return object()


def is_same(before: Any, now: Any) -> bool:
    """Return whether an answer is the one before.

    Examples
    --------
    >>> is_same({"distance": 6}, {"distance": 6}), is_same(lambda: 1, lambda: 1)
    (True, False)
    """
    if is_code(before) or is_code(now):
        return before is now
    try:
        return type(before) is type(now) and bool(before == now)
    except Exception:  # an answer of any type may be given
        return False
