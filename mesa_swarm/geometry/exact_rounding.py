"""Sums that round as CPython's do, `math.fsum`."""

from mesa_swarm.geometry.outlines import add_exactly
from mesa_swarm.kernels.compiled import compiled

# More parts without common digits than a sum of floats can have.
MOST_PARTS = 64


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
