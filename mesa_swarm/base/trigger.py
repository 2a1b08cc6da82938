"""Trigger: after which steps something is stored or measured."""

from dataclasses import dataclass
from typing import Self

from mesa_swarm.base.errors import check_count


@dataclass(frozen=True, slots=True)
class Trigger:
    """Every how many steps something is due: after the steps that `every` divides.

    Whatever takes such a number (`history_every`, `collect_every`, ``watch(every=)`` ...) also takes a trigger.

    Parameters
    ----------
    every : int
        Steps from one to the next, at least 0; with 0 it is never due.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> [step for step in range(1, 31) if Trigger(every=10).is_due(step)]
    [10, 20, 30]
    >>> Trigger(every=0).is_due(10)
    False
    """

    every: int = 1

    def __post_init__(self) -> None:
        """Check the number."""
        object.__setattr__(self, "every", check_count("every", self.every))

    @classmethod
    def of(cls, every: "int | Trigger", name: str = "every", *, minimum: int = 0, maximum: int = 2**31 - 1) -> Self:
        """Return the trigger that a parameter stands for, which is a whole number within limits, or a trigger.

        Raises
        ------
        InvalidValueError
            With the parameter's name.

        Examples
        --------
        >>> Trigger.of(5), Trigger.of(Trigger(every=5))
        (Trigger(every=5), Trigger(every=5))
        """
        number = every.every if isinstance(every, Trigger) else every
        return cls(check_count(name, number, minimum=minimum, maximum=maximum))

    def is_due(self, step: int) -> bool:
        """Return whether it is due after this step."""
        return self.every > 0 and step % self.every == 0

    def last_due(self, step: int) -> int:
        """Return the last step until this one after which it was due, -1 if it never is.

        Examples
        --------
        >>> Trigger(every=10).last_due(25)
        20
        """
        return step - step % self.every if self.every else -1
