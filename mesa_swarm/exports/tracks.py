"""Tracks: what each robot, fire or load did over some steps, also if it came late or left early."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Track:
    """One thing over time.

    Parameters
    ----------
    number : int
        unique_id.
    values : ndarray, shape (k, m)
        Where it was not there, what it had next before that, or first after.
    present : bool ndarray, shape (k,)
    """

    number: int
    values: np.ndarray
    present: np.ndarray


def tracks(moments: Iterable[tuple[np.ndarray, np.ndarray]]) -> Iterator[Track]:
    """Yield the track of everything, by unique_id.

    Parameters
    ----------
    moments : iterable of (ids, values)
        Shapes (n,) and (n, m), at each of the steps.

    Examples
    --------
    >>> moments = [(np.array([7]), np.array([[1.0]])), (np.array([7, 8]), np.array([[2.0], [5.0]]))]
    >>> [(track.number, track.values.ravel().tolist(), track.present.tolist()) for track in tracks(moments)]
    [(7, [1.0, 2.0], [True, True]), (8, [5.0, 5.0], [False, True])]
    """
    found = list(moments)
    places: dict[int, list[tuple[int, int]]] = {}
    for moment, (ids, _) in enumerate(found):
        for row, number in enumerate(ids.tolist()):
            places.setdefault(number, []).append((moment, row))
    for number in sorted(places):
        values = np.array([found[moment][1][row] for moment, row in places[number]])
        present = np.zeros(len(found), bool)
        present[[moment for moment, _ in places[number]]] = True
        latest = np.maximum(np.cumsum(present) - 1, 0)
        yield Track(number=number, values=values[latest], present=present)
