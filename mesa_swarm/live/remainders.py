"""The remainder of a division, `fmod` of the C library, in compiled code: exact, so that every library has its bits."""

import math

import numpy as np

from mesa_swarm.kernels.compiled import compiled

# Of numbers of 64 bits (IEEE 754): how many bits the fraction has, the largest exponent, and the bit of the sign.
FRACTION, MOST, ONE = np.int64(52), np.int64(0x7FF), np.int64(1)
HIDDEN, FRACTION_BITS, WITHOUT_SIGN = ONE << FRACTION, (ONE << FRACTION) - ONE, np.int64(0x7FFFFFFFFFFFFFFF)


@compiled
def remainder_of(x, y):
    """Return what is left of x by division by y, with the sign of x; NaN for an infinite x, or 0 as y.

    Examples
    --------
    >>> remainder_of(-7.5, 2.0), remainder_of(5.0, math.inf)
    (-1.5, 5.0)
    """
    if y == 0.0 or math.isnan(x) or math.isnan(y) or math.isinf(x):
        return math.nan
    bits, other = np.float64(x).view(np.int64) & WITHOUT_SIGN, np.float64(y).view(np.int64) & WITHOUT_SIGN
    if bits < other:
        return x
    exponent, least = max(bits >> FRACTION, ONE), max(other >> FRACTION, ONE)
    whole = (bits & FRACTION_BITS) | (HIDDEN if bits >> FRACTION else np.int64(0))
    divisor = (other & FRACTION_BITS) | (HIDDEN if other >> FRACTION else np.int64(0))
    for _ in range(exponent - least):
        whole = (whole - divisor if whole >= divisor else whole) << ONE
    whole = whole - divisor if whole >= divisor else whole
    return math.copysign(number_of_fraction(whole, least), x)


@compiled
def number_of_fraction(whole, exponent):
    """Return a number of this fraction, below twice the hidden bit, and this exponent."""
    if whole == 0:
        return 0.0
    while whole < HIDDEN and exponent > ONE:
        whole, exponent = whole << ONE, exponent - ONE
    bits = whole if whole < HIDDEN else (whole & FRACTION_BITS) | (exponent << FRACTION)
    return np.int64(bits).view(np.float64)
