"""Tasks learned one after another: networks forget, unless they rehearse stored points (thesis 6.4)."""

from collections.abc import Sequence
from copy import deepcopy

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, shortened
from mesa_swarm.learning.networks import TANH, Networks, points_of, present

REHEARSALS = ("none", "interleaved", "consolidated")


def fit_in_turn(
    tasks: Sequence[tuple[ArrayLike, ArrayLike]],
    *,
    rng: np.random.Generator,
    rehearsal: str = "none",
    networks: int = 1,
    hidden: int = 8,
    presentations: int = 200,
    rate: float = 0.1,
    activation: str = TANH,
) -> list[Networks]:
    """Fit the same networks to one task after another; return them as they are after each.

    Parameters
    ----------
    tasks : sequence of (x, y), ndarrays of shape (p,)
        Points, as for `fit`.
    rng : numpy.random.Generator
    rehearsal : str
        "none": only the points of the task are presented. "interleaved": together with them, the stored points of all
        earlier tasks, in every round. "consolidated": the points of the task alone, and afterwards as many rounds with
        all stored points, those of the task included: twice the presentations.
    networks, hidden, presentations, rate, activation
        As for `fit`.

    Returns
    -------
    list of Networks
        One for each task.

    Raises
    ------
    InvalidValueError, UnknownNameError, LearningError

    Examples
    --------
    >>> left, right = np.linspace(-1, -0.1, 10), np.linspace(0.1, 1, 10)
    >>> tasks = [(left, np.full(10, -0.5)), (right, np.full(10, 0.5))]
    >>> after = {way: fit_in_turn(tasks, rng=np.random.default_rng(1), rehearsal=way)[1] for way in REHEARSALS}
    >>> [bool(abs(after[way].outputs([[-0.5]])[0] + 0.5) < 0.2) for way in REHEARSALS]
    [False, True, True]
    """
    check_choice("rehearsal", rehearsal, REHEARSALS)
    shown = _checked_tasks(tasks)
    stack = Networks.random(
        check_count("networks", networks, minimum=1), inputs=1, hidden=hidden, rng=rng, activation=activation
    )
    after = []
    for k, points in enumerate(shown):
        stored = np.concatenate(shown[: k + 1])
        first = stored if rehearsal == "interleaved" else points
        for one in (first, stored) if rehearsal == "consolidated" else (first,):
            present(stack, one, rng=rng, presentations=presentations, rate=rate)
        after.append(deepcopy(stack))
    return after


def _checked_tasks(tasks: Sequence[tuple[ArrayLike, ArrayLike]]) -> list[np.ndarray]:
    """Return the points of each task (p, 2)."""
    try:
        pairs = [(x, y) for x, y in tasks]
    except (TypeError, ValueError):
        raise InvalidValueError(f"tasks is {shortened(tasks)}; expected pairs (x, y) of arrays") from None
    if not pairs:
        raise InvalidValueError("tasks is empty; give at least one pair (x, y)")
    return [points_of(x, y) for x, y in pairs]
