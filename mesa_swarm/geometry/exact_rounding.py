"""Sums and lengths that round as CPython's do: `math.fsum` and `math.hypot`, whatever the library of C is."""

import math

from mesa_swarm.geometry.outlines import add_exactly, multiply_exactly
from mesa_swarm.kernels.compiled import compiled

# More parts without common digits than a sum of floats can have.
MOST_PARTS = 64
LEAST_NORMAL = 2.0**-1022


@compiled(apart=True)
def exact_sum(terms, count, parts):
    """Return the sum of the first terms, rounded once, so that their order is nothing to it (Shewchuk 1997).

    Parameters
    ----------
    terms : ndarray
        Finite numbers.
    count : int
    parts : ndarray, shape (MOST_PARTS,), written

    Examples
    --------
    >>> import numpy as np
    >>> exact_sum(np.array([0.1] * 10), 10, np.empty(MOST_PARTS))
    1.0
    """
    n = 0
    for k in range(count):
        total, size = terms[k], 0
        for part in range(n):
            total, error = add_exactly(total, parts[part])
            if error != 0.0:
                parts[size] = error
                size += 1
        parts[size] = total
        n = size + 1 if total != 0.0 else size
    return rounded_sum(n, parts)


@compiled
def rounded_sum(n, parts):
    """Return the sum of n parts without common digits, least first, rounded once."""
    total, error = 0.0, 0.0
    while n > 0 and error == 0.0:
        n -= 1
        total, error = add_exactly(total, parts[n])
    # Half-way cases round to even, unless what is left decides.
    if n > 0 and (error < 0.0) == (parts[n - 1] < 0.0):
        double_error = 2.0 * error
        rounded = total + double_error
        if rounded - total == double_error:
            return rounded
    return total


@compiled(apart=True)
def hypot(x, y):
    """Return the length of a vector as `math.hypot` rounds it: correctly, but for one case in some millions.

    Examples
    --------
    >>> hypot(3.0, 4.0)
    5.0
    """
    x, y = abs(x), abs(y)
    largest = max(x, y)
    if not 0.0 < largest < math.inf:
        return largest
    unit = LEAST_NORMAL if largest < 0.25 * LEAST_NORMAL else 1.0
    scale = math.ldexp(1.0, -math.frexp(largest / unit)[1])
    total, error, small_error = 1.0, 0.0, 0.0
    for part in (x / unit * scale, y / unit * scale):
        square, rest = multiply_exactly(part, 0.0, part, 0.0)
        total, low = add_exactly(total, square)
        error += rest
        small_error += low
    length = math.sqrt(total - 1.0 + (error + small_error))
    square, rest = multiply_exactly(-length, 0.0, length, 0.0)
    total, low = add_exactly(total, square)
    error += rest
    small_error += low
    return unit * ((length + (total - 1.0 + (error + small_error)) / (2.0 * length)) / scale)
