"""Animations in SVG, as every browser plays them (SMIL): values at even times, or from one moment to the next."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor

import numpy as np


@dataclass(frozen=True, kw_only=True, slots=True)
class Clock:
    """When the values of an animation count.

    Parameters
    ----------
    moments : int
        How many values there are, at least 2: the first at the beginning, the last at the end.
    seconds : float
        From the beginning to the end, whereupon it begins again.
    """

    moments: int
    seconds: float

    @property
    def _repeat(self) -> str:
        return f'dur="{self.seconds:.6g}s" repeatCount="indefinite"'

    def moving(self, kind: str, rows: np.ndarray, digits: int, added: bool = False) -> str:
        """Return what moves or turns an element evenly through rows of numbers; one value if they are all the same.

        The first animation of an element replaces its transform, so that all have to be there.

        Examples
        --------
        >>> Clock(moments=2, seconds=1.0).moving("translate", np.array([[0.0, 1.0], [2.5, 1.0]]), 1)[-71:]
        'type="translate" values="0 1;2.5 1" dur="1s" repeatCount="indefinite"/>'
        """
        texts = [number_row(row, digits) for row in rows.tolist()]
        texts = texts if len(set(texts)) > 1 else texts[:1]
        more = ' additive="sum"' if added else ""
        shown = ";".join(texts)
        return f'<animateTransform attributeName="transform"{more} type="{kind}" values="{shown}" {self._repeat}/>'

    def jumping(self, name: str, values: Sequence[str], tag: str = "animate", more: str = "") -> str:
        """Return what changes an attribute at once wherever the value differs from the one before.

        Examples
        --------
        >>> Clock(moments=3, seconds=2.0).jumping("fill", ["red", "red", "blue"])[50:81]
        'values="red;blue" keyTimes="0;1'
        """
        kept = [i for i in range(len(values)) if i == 0 or values[i] != values[i - 1]]
        if len(kept) == 1:
            return ""
        # Rounded down: at its moment a value counts already, as it does in what moves.
        times = ";".join(f"{floor(1e5 * i / (self.moments - 1)) / 1e5:.5g}" for i in kept)
        shown = ";".join(values[i] for i in kept)
        return (
            f'<{tag} attributeName="{name}"{more} calcMode="discrete" values="{shown}" keyTimes="{times}" '
            f"{self._repeat}/>"
        )


def number_row(numbers: Iterable[float], digits: int) -> str:
    """Return numbers rounded to so many digits, with blanks between them and no zeros at their ends.

    Examples
    --------
    >>> number_row((1.26, -0.01, 30.0), 1)
    '1.3 0 30'
    """
    return " ".join(f"{round(number, digits) + 0.0:.10g}" for number in numbers)
