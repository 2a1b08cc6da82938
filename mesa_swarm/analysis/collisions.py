"""How often robots bump into things."""

import numpy as np

from mesa_swarm.analysis.arrays import check_flags
from mesa_swarm.analysis.series import central_moving_average
from mesa_swarm.errors import InvalidValueError

# Of the curves of 15 robots in the thesis; for one robot it used 11.
WINDOW = 1001


def collision_frequency(collided: np.ndarray, window: int = WINDOW) -> np.ndarray:
    """Return the collisions a robot and step, smoothed over time.

    The mean over the robots, then the central moving average over `window` steps, shorter at the ends.

    Parameters
    ----------
    collided : bool ndarray, shape (k, n)
        Whether each of n robots, at least one, collided in each of k steps.
    window : int
        Steps, odd: 1001 suits many robots, 11 one robot; 1 does not smooth.

    Returns
    -------
    ndarray, shape (k,)
        In [0, 1].

    Raises
    ------
    InvalidValueError
        If `collided` is no such table, or `window` is even or below 1.

    Examples
    --------
    >>> collision_frequency([[True, True], [False, True], [False, False]], window=3)
    array([0.75, 0.5 , 0.25])
    """
    table = _table(collided)
    return central_moving_average(np.count_nonzero(table, axis=1) / table.shape[1], window)


def cumulative_collisions(collided: np.ndarray) -> np.ndarray:
    """Return how many collisions every robot has had up to and including each step.

    Parameters
    ----------
    collided : bool ndarray, shape (k, n)
        Whether each of n robots, at least one, collided in each of k steps.

    Returns
    -------
    int64 ndarray, shape (k, n)
        The last row holds the totals.

    Raises
    ------
    InvalidValueError
        If `collided` is no such table.

    Examples
    --------
    >>> cumulative_collisions([[True, False], [True, True]])
    array([[1, 0],
           [2, 1]])
    """
    return np.cumsum(_table(collided), axis=0, dtype=np.int64)


def _table(collided: np.ndarray) -> np.ndarray:
    table = check_flags("collided", collided, ("k", "n"))
    if not table.shape[1]:
        raise InvalidValueError("collided has no robots; expected an array of shape (k, n) with n of at least 1")
    return table
