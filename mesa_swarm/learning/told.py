"""What a policy is told besides readings: chances, and which robot is which."""

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.errors import InvalidValueError, shortened
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import as_floats

# Of robots that nobody numbered.
COUNTED = np.empty(0, np.int64)


def checked_chances(chance: ArrayLike, robots: int) -> np.ndarray:
    """Return the numbers from which a policy draws as an array (n,), or refuse them.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> checked_chances([0.5, 1], 2)
    array([0.5, 1. ])
    """
    chances = as_floats(chance)
    if chances.shape != (robots,):
        raise InvalidValueError(f"chance is {shortened(chance)}; expected {robots} numbers from 0 to 1")
    wrong = first_outside(chances)
    if wrong >= 0:
        raise InvalidValueError(f"chance holds {chances[wrong]:g}; expected numbers from 0 to 1")
    return chances


def checked_numbers(numbers: ArrayLike | None, robots: int) -> np.ndarray:
    """Return the numbers of robots as an array (n,), or refuse them; an empty one tells to count robots from 0.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> checked_numbers(None, 2), checked_numbers([3, 4], 2)
    (array([], dtype=int64), array([3, 4]))
    """
    if numbers is None:
        return COUNTED
    try:
        given = np.asarray(numbers)
    except ValueError:
        given = np.empty(0)
    if given.shape != (robots,) or given.dtype.kind not in "iu":
        raise InvalidValueError(f"numbers is {shortened(numbers)}; expected {robots} whole numbers, one a robot")
    return given.astype(np.int64, copy=False)


@compiled
def first_outside(chances):
    """Return the place of the first number that is not from 0 to 1, or -1."""
    for i in range(chances.shape[0]):
        if not 0.0 <= chances[i] <= 1.0:
            return i
    return -1
