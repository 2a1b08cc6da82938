"""Wire fitting: the value of every action between a few that networks propose, with exact gradients (thesis 7.3.2)."""

import math

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import as_floats

SMOOTHING = 0.1
TINY = 0.01


def wire_value(
    action: ArrayLike, wires: ArrayLike, values: ArrayLike, *, smoothing: float = SMOOTHING, tiny: float = TINY
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return what an action is worth, and how that changes with the wires and their values.

    ``Q(u) = sum_i(q_i / D_i) / sum_i(1 / D_i)`` with ``D_i = |u - u_i|^2 + c (q_max - q_i) + eps``. It is never
    above q_max, which it nearly is at the best wire. The gradients are exact, also for the best wire, on
    which all D_i depend.

    Parameters
    ----------
    action : ndarray, shape (2,)
        u, wheel commands as shares of max_speed.
    wires : ndarray, shape (w, 2)
        u_i, the actions that are proposed.
    values : ndarray, shape (w,)
        q_i, what each of them is worth.
    smoothing, tiny : float
        c, at least 0, and eps, above 0.

    Returns
    -------
    (float, ndarray, ndarray)
        Q(u), dQ/du_i of shape (w, 2), dQ/dq_i of shape (w,).

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> value, _, _ = wire_value([1.0, 1.0], [[1.0, 1.0], [-1.0, -1.0]], [1.0, -1.0])
    >>> round(value, 3)
    0.998
    """
    u, ends, q = as_floats(action), as_floats(wires), as_floats(values)
    finite = all(np.isfinite(part).all() for part in (u, ends, q))
    if u.shape != (2,) or q.ndim != 1 or not len(q) or ends.shape != (len(q), 2) or not finite:
        raise InvalidValueError(
            f"action is {shortened(action)}, wires are {shortened(wires)} and values {shortened(values)}; "
            "expected finite numbers of shapes (2,), (w, 2) and (w,)"
        )
    c, eps = check_number("smoothing", smoothing, minimum=0), check_number("tiny", tiny, above=0)
    by_wire, by_value = np.empty((len(q), 2)), np.empty(len(q))
    return float(interpolate(u[0], u[1], ends, q, c, eps, by_wire, by_value)), by_wire, by_value


@compiled
def interpolate(left, right, wires, values, smoothing, tiny, by_wire, by_value):
    """Return Q(left, right); write its derivatives by the wires (w, 2) and by their values (w,)."""
    count = values.shape[0]
    best = 0
    for i in range(1, count):
        if values[i] > values[best]:
            best = i
    weights, weighted = 0.0, 0.0
    for i in range(count):
        away = distance_to(left, right, wires[i, 0], wires[i, 1], values[best] - values[i], smoothing, tiny)
        weights += 1.0 / away
        weighted += values[i] / away
    value = weighted / weights
    pulled = 0.0
    for i in range(count):
        away = distance_to(left, right, wires[i, 0], wires[i, 1], values[best] - values[i], smoothing, tiny)
        by_distance = (value - values[i]) / (away * away * weights)
        by_value[i] = 1.0 / (away * weights) - smoothing * by_distance
        by_wire[i, 0] = 2.0 * (wires[i, 0] - left) * by_distance
        by_wire[i, 1] = 2.0 * (wires[i, 1] - right) * by_distance
        pulled += smoothing * by_distance
    by_value[best] += pulled  # q_max is its value: it is in every D_i
    return value


@compiled
def distance_to(left, right, wire_left, wire_right, below, smoothing, tiny):
    """Return D_i of a wire whose value is `below` under the best one's."""
    return (left - wire_left) ** 2 + (right - wire_right) ** 2 + smoothing * below + tiny


@compiled
def squashed(said, start):
    """Return a wheel command in (-1, 1) of what a network says: 0 gives `start`."""
    return math.tanh(said + math.atanh(start))
