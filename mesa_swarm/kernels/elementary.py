"""Sine, logarithm and other elementary functions of IEEE operations only: the same bits on every machine.

Those of C libraries, processors and browsers differ in the last bit, and so would runs. These use nothing but sums,
products, quotients, square roots and the bits of a number, which IEEE 754 decides, and are right to one unit in the
last place. They are for compiled functions, and for whatever else decides the state of a model; compiled rules of a
user get them in place of those of `math` (`kernels.custom_functions`). What draws or describes may take others.

Methods and coefficients are those of fdlibm (K. C. Ng and others, Sun Microsystems), of which this is the notice:

    Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
    Developed at SunSoft, a Sun Microsystems, Inc. business.
    Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is
    preserved.

Large angles are reduced as M. Payne and R. Hanek (1983) did, and `hypot` is corrected as C. F. Borges (2020) did.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.kernels.compiled import compiled

# ---- sine, cosine

# 2 / pi, and pi / 2 in three parts of 33 bits each, of which multiples below 2**20 are exact, with what remains.
TURNS = 6.36619772367581382433e-01
QUARTER_1 = 1.57079632673412561417e00
QUARTER_2, QUARTER_2_REST = 6.07710050630396597660e-11, 2.02226624879595063154e-21
QUARTER_3, QUARTER_3_REST = 2.02226624871116645580e-21, 8.47842766036889956997e-32
# Beyond this angle a reduction takes all bits of 2 / pi.
LARGE_ANGLE = 823549.6
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
# Binary digits of 2 / pi, in words of 64 bits after a word of zeros.
DIGITS_OF_TURNS = np.array([
    0, 0xA2F9836E4E441529, 0xFC2757D1F534DDC0, 0xDB6295993C439041, 0xFE5163ABDEBBC561, 0xB7246E3A424DD2E0,
    0x06492EEA09D1921C, 0xFE1DEB1CB129A73E, 0xE88235F52EBB4484, 0xE99C7026B45F7E41, 0x3991D639835339F4,
    0x9C845F8BBDF9283B, 0x1FF897FFDE05980F, 0xEF2F118B5A0A6D1F, 0x6D367ECF27CB09B7, 0x4F463F669E5FEA2D,
    0x7527BAC7EBE5F17B, 0x3D0739F78A5292EA, 0x6BFB5FB11F8D5D08, 0x56033046FC7B6BAB, 0xF0CFBC209AF4361D,
], np.uint64)  # fmt: skip
LOW_HALF, HALF_BITS, WORD_BITS, TWO_BITS = np.uint64(2**32 - 1), np.uint64(32), 64, np.uint64(2)
# Of a number: the bits of its exponent after those of its fraction, and what is added to the exponent.
FRACTION_BITS, FRACTION, EXPONENT, BIAS = 52, 2**52 - 1, 2047, 1023
QUARTER, QUARTER_REST = 1.57079632679489655800e00, 6.12323399573676603587e-17
# Factor by which a number is split into two of 26 bits (Dekker 1971).
SPLITTING = 2.0**27 + 1.0


@compiled
def reduce_angle(x):
    """Return how many quarter turns an angle has, modulo 4, and what remains, from -pi/4 to pi/4, as a sum of two."""
    if not abs(x) <= LARGE_ANGLE:
        return reduce_large_angle(x)
    quarters = math.floor(x * TURNS + 0.5)
    first = x - quarters * QUARTER_1
    rest = quarters * QUARTER_2
    second = first - rest
    rest = quarters * QUARTER_2_REST - ((first - second) - rest)
    if abs(second - rest) < 2.0**-50 * abs(x):  # most digits have cancelled
        first, rest = second, quarters * QUARTER_3
        second = first - rest
        rest = quarters * QUARTER_3_REST - ((first - second) - rest)
    azimuth = second - rest
    return int(quarters) & 3, azimuth, (second - azimuth) - rest


@compiled
def sine_near(x, rest):
    """Return the sine of x + rest, from -pi/4 to pi/4."""
    z = x * x
    w = z * z
    r = S2 + z * (S3 + z * S4) + z * w * (S5 + z * S6)
    v = z * x
    return x - ((z * (0.5 * rest - v * r) - rest) - v * S1)


@compiled
def cosine_near(x, rest):
    """Return the cosine of x + rest, from -pi/4 to pi/4."""
    z = x * x
    w = z * z
    r = z * (C1 + z * (C2 + z * C3)) + w * w * (C4 + z * (C5 + z * C6))
    half = 0.5 * z
    near = 1.0 - half
    return near + (((1.0 - near) - half) + (z * r - x * rest))


@compiled
def reduce_large_angle(x):
    """Return the same for an angle of any size, by the digits of 2 / pi that its exponent selects."""
    bits = np.float64(abs(x)).view(np.int64)
    exponent = bits >> FRACTION_BITS
    if exponent == EXPONENT:
        return 0, x - x, 0.0
    number = np.uint64((bits & FRACTION) | (FRACTION + 1))
    # Digits before these would add whole turns, those after them less than half of the last place.
    begin = exponent - BIAS - FRACTION_BITS - 2 + WORD_BITS
    _, high = multiply_words(number, select_word(begin))
    carried, middle = multiply_words(number, select_word(begin + WORD_BITS))
    high += carried
    carried, low = multiply_words(number, select_word(begin + 2 * WORD_BITS))
    middle += carried
    high += np.uint64(middle < carried)
    return measure_remainder(high, middle, low, x < 0.0)


@compiled
def measure_remainder(high, middle, low, is_negative):
    """Return quarter turns and what remains of an angle, which three words have in quarter turns, modulo 4."""
    after = np.uint64(WORD_BITS) - TWO_BITS
    fraction = np.int64((high << TWO_BITS) | (middle >> after))
    more = (middle << TWO_BITS) | (low >> after)
    quarters = np.int64(high >> after) + (fraction < 0)
    first = np.float64((fraction >> 11) << 11) * 2.0**-64
    rest = (np.float64(fraction & 2047) + np.float64(more) * 2.0**-64) * 2.0**-64
    turned = first + rest
    rest -= turned - first
    azimuth, error = product_and_error(turned, QUARTER)
    error += turned * QUARTER_REST + rest * QUARTER
    if is_negative:
        return -quarters & 3, -(azimuth + error), (azimuth + error - azimuth) - error
    return quarters & 3, azimuth + error, error - (azimuth + error - azimuth)


@compiled
def select_word(begin):
    """Return the 64 digits of 2 / pi from this place on; the first 64 are zeros."""
    word, shift = begin // WORD_BITS, np.uint64(begin % WORD_BITS)
    if shift == 0:
        return DIGITS_OF_TURNS[word]
    return (DIGITS_OF_TURNS[word] << shift) | (DIGITS_OF_TURNS[word + 1] >> (np.uint64(WORD_BITS) - shift))


@compiled
def multiply_words(a, b):
    """Return the product of two words of 64 bits as two words, the higher one first."""
    low_a, high_a, low_b, high_b = a & LOW_HALF, a >> HALF_BITS, b & LOW_HALF, b >> HALF_BITS
    low, across = low_a * low_b, high_a * low_b
    middle = across + (low >> HALF_BITS)
    other = low_a * high_b + (middle & LOW_HALF)
    return high_a * high_b + (middle >> HALF_BITS) + (other >> HALF_BITS), a * b


@compiled
def product_and_error(a, b):
    """Return the product of two numbers, and what it lacks to be exact (Dekker 1971)."""
    high_a, high_b = SPLITTING * a, SPLITTING * b
    high_a, high_b = high_a - (high_a - a), high_b - (high_b - b)
    low_a, low_b, product = a - high_a, b - high_b, a * b
    return product, ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b


@compiled
def sin(x):
    """Return the sine of an angle in radians, as `math.sin` does; NaN of what is not finite.

    Examples
    --------
    >>> sin(0.5)
    0.479425538604203
    """
    quarters, azimuth, rest = reduce_angle(x)
    value = sine_near(azimuth, rest) if quarters & 1 == 0 else cosine_near(azimuth, rest)
    return value if quarters < 2 else -value


@compiled
def cos(x):
    """Return the cosine of an angle in radians, as `math.cos` does; NaN of what is not finite.

    Examples
    --------
    >>> cos(0.5)
    0.8775825618903728
    """
    quarters, azimuth, rest = reduce_angle(x)
    value = cosine_near(azimuth, rest) if quarters & 1 == 0 else sine_near(azimuth, rest)
    return value if quarters & 1 == quarters >> 1 else -value


@compiled
def direction_of(heading):
    """Return cosine and sine of an angle, the bits of `cos` and `sin`: its direction.

    Examples
    --------
    >>> direction_of(0.5) == (cos(0.5), sin(0.5))
    True
    """
    quarters, azimuth, rest = reduce_angle(heading)
    x, y = cosine_near(azimuth, rest), sine_near(azimuth, rest)
    if quarters & 1:
        x, y = -y, x
    return (x, y) if quarters < 2 else (-x, -y)


# ---- the angle of a direction, and its length

# Arcs whose tangents are 1/2, 1 and 3/2, and of a quarter turn, with what they lack; where the next is nearer.
ARCS = (4.63647609000806093515e-01, 7.85398163397448278999e-01, 9.82793723247329054082e-01, QUARTER)
ARC_RESTS = (2.26987774529616870924e-17, 3.06161699786838301793e-17, 1.39033110312309984516e-17, QUARTER_REST)
NEARER_1, NEARER_2, NEARER_3, NEARER_4 = 0.4375, 0.6875, 1.1875, 2.4375
A1, A2, A3 = 3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01
A4, A5, A6 = -1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02
A7, A8, A9 = 6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02
A10, A11 = -3.65315727442169155270e-02, 1.62858201153657823623e-02
HALF_TURN, HALF_TURN_REST = 3.1415926535897931160e00, 1.2246467991473531772e-16


@compiled
def atan(x):
    """Return the angle of this tangent, from -pi/2 to pi/2, as `math.atan` does.

    Examples
    --------
    >>> atan(1.0)
    0.7853981633974483
    """
    return math.copysign(angle_of_tangent(abs(1.0 * x), 0.0)[0], x)


@compiled
def angle_of_tangent(a, more):
    """Return the angle whose tangent is a, at least 0, plus `more`, less than its last place; and what it lacks."""
    nearest, tangent = 0, a
    if a < NEARER_1:
        nearest = -1
    elif a < NEARER_2:
        tangent = (2.0 * a - 1.0) / (2.0 + a)
    elif a < NEARER_3:
        nearest, tangent = 1, (a - 1.0) / (a + 1.0)
    elif a < NEARER_4:
        nearest, tangent = 2, (a - 1.5) / (1.0 + 1.5 * a)
    else:
        nearest, tangent = 3, -1.0 / a
    z = tangent * tangent
    w = z * z
    odd = z * (A1 + w * (A3 + w * (A5 + w * (A7 + w * (A9 + w * A11)))))
    lacks = tangent * (odd + w * (A2 + w * (A4 + w * (A6 + w * (A8 + w * A10)))))
    lacks -= more
    arc = 0.0
    if nearest >= 0:
        arc = ARCS[nearest]
        lacks -= ARC_RESTS[nearest]
    before = lacks - tangent
    azimuth = arc - before
    return azimuth, (arc - azimuth) - before if nearest >= 0 else (tangent - azimuth) - lacks


@compiled
def atan2(y, x):
    """Return the angle of the direction (x, y) in radians, from -pi to pi, as `math.atan2` does.

    Examples
    --------
    >>> atan2(1.0, -1.0)
    2.356194490192345
    """
    if math.isnan(x) or math.isnan(y):
        return x + y
    across, ahead = abs(1.0 * y), abs(1.0 * x)
    if math.isinf(across) and math.isinf(ahead):
        across, ahead = 1.0, 1.0
    if across == 0.0:
        azimuth, rest = 0.0, 0.0
    elif ahead == 0.0:
        azimuth, rest = QUARTER, QUARTER_REST
    else:
        azimuth, rest = angle_of_quotient(across, ahead)
    if math.copysign(1.0, x) < 0.0:
        before, azimuth = azimuth, HALF_TURN - azimuth
        azimuth += ((HALF_TURN - azimuth) - before) + (HALF_TURN_REST - rest)
    return math.copysign(azimuth, y)


@compiled
def angle_of_quotient(a, b):
    """Return the angle whose tangent is a / b, of finite numbers above 0, and what it lacks."""
    tangent = a / b
    if not 2.0**-50 < tangent < 2.0**50 or not SHORTEST < b < LONGEST:
        return angle_of_tangent(tangent, 0.0)
    product, error = product_and_error(tangent, b)
    return angle_of_tangent(tangent, ((a - product) - error) / (b + a * tangent))


# Beyond these a square would overflow, or lose digits; factors by which it does not.
LONGEST, SHORTEST, LARGER, SMALLER = 2.0**510, 2.0**-450, 2.0**600, 2.0**-600


@compiled
def hypot(x, y):
    """Return the length of (x, y), as `math.hypot` does: infinite if either is, else NaN if either is.

    Examples
    --------
    >>> hypot(3.0, 4.0)
    5.0
    """
    a, b = abs(1.0 * x), abs(1.0 * y)
    if a < b:
        a, b = b, a
    if SHORTEST < a < LONGEST:
        return correct_length(a, b)
    if math.isinf(x) or math.isinf(y):
        return math.inf
    if not a > 0.0:  # NaN as well
        return a + b
    scale = SMALLER if a >= LONGEST else LARGER
    return correct_length(scale * a, scale * b) / scale


@compiled
def correct_length(a, b):
    """Return the length of (a, b), of which a is the larger and above 0."""
    length = math.sqrt(a * a + b * b)
    if length <= 2.0 * b:
        more = length - b
        lacks = a * (2.0 * more - a) + (more - 2.0 * (a - b)) * more
    else:
        more = length - a
        lacks = 2.0 * more * (a - 2.0 * b) + (4.0 * more - b) * b + more * more
    return length - lacks / (2.0 * length)


# ---- exponential function and logarithm

LOG_2, LOG_2_REST, PER_LOG_2 = 6.93147180369123816490e-01, 1.90821492927058770002e-10, 1.44269504088896338700e00
Q1, Q2, Q3 = -3.33333333333331316428e-02, 1.58730158725481460165e-03, -7.93650757867487942473e-05
Q4, Q5 = 4.00821782732936239552e-06, -2.01099218183624371326e-07
# Beyond these the result is infinite, zero.
LARGEST_EXPONENT, LEAST_EXPONENT = 709.782712893383973096, -745.13321910194110842
L1, L2, L3 = 6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01
L4, L5, L6 = 2.222219843214978396e-01, 1.818357216161805012e-01, 1.531383769920937332e-01
L7 = 1.479819860511658591e-01
# The bits of the square root of 1/2, whose fraction decides which power of 2 is nearest; and the least normal number.
ROOT_BITS, LEAST_NORMAL = 0x3FE6A09E667F3BCD, 2.0**-1022


@compiled
def power_of_2(k):
    """Return 2 to the power k, from -1022 to 1023."""
    return np.int64((k + BIAS) << FRACTION_BITS).view(np.float64)


@compiled
def expm1_lacks(r, rest):
    """Return what r lacks to be e to the power r + rest, minus 1, negated."""
    half = 0.5 * r
    square = r * half
    r1 = 1.0 + square * (Q1 + square * (Q2 + square * (Q3 + square * (Q4 + square * Q5))))
    t = 3.0 - r1 * half
    e = square * ((r1 - t) / (6.0 - r * t))
    return (r * (e - rest) - rest) - square


@compiled
def exp(x):
    """Return e to the power x, as `math.exp` does; infinite beyond 709.78.

    Examples
    --------
    >>> exp(1.0)
    2.718281828459045
    """
    return exp_of_sum(x, 0.0)


@compiled
def exp_of_sum(x, rest):
    """Return e to the power x + rest, of which the rest is small beside x."""
    if not LEAST_EXPONENT <= x <= LARGEST_EXPONENT:
        return x if math.isnan(x) else math.inf if x > 0.0 else 0.0
    k = math.floor(x * PER_LOG_2 + 0.5)
    high, low = x - k * LOG_2, k * LOG_2_REST - rest
    r, power = high - low, int(k)
    near = 1.0 + r
    value = near + ((1.0 - near) + r - expm1_lacks(r, (high - r) - low))
    if power > BIAS:
        return value * 2.0 * power_of_2(power - 1)
    if power < 1 - BIAS:
        return value * power_of_2(power + 2 * FRACTION_BITS) * 2.0 ** (-2 * FRACTION_BITS)
    return value * power_of_2(power)


@compiled
def split_number(x):
    """Return k and f of a positive number, which is 2**k (1 + f), of which 1 + f is near 1."""
    bits = np.float64(x).view(np.int64)
    k = (bits - ROOT_BITS) >> FRACTION_BITS
    return k, np.int64(bits - (k << FRACTION_BITS)).view(np.float64) - 1.0


@compiled
def log_near(f, k, rest):
    """Return the logarithm of 2**k (1 + f) + rest * 2**k, of which 1 + f is near 1."""
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    r = w * (L2 + w * (L4 + w * L6)) + z * (L1 + w * (L3 + w * (L5 + w * L7)))
    half = 0.5 * f * f
    return k * LOG_2 - ((half - (s * (half + r) + (k * LOG_2_REST + rest))) - f)


@compiled
def log(x):
    """Return the natural logarithm, as `math.log` does; minus infinity of 0, NaN of what is negative.

    Examples
    --------
    >>> log(10.0)
    2.302585092994046
    """
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else math.nan if x < 0.0 else x
    scaled = x if x >= LEAST_NORMAL else x * 2.0**54
    k, f = split_number(scaled)
    return log_near(f, float(k) if x >= LEAST_NORMAL else k - 54.0, 0.0)


@compiled
def log1p(x):
    """Return the natural logarithm of 1 + x, as `math.log1p` does, also where x is small.

    Examples
    --------
    >>> log1p(1.0)
    0.6931471805599453
    """
    if not -1.0 < x < math.inf:
        return -math.inf if x == -1.0 else math.nan if x < -1.0 else x
    if abs(x) < 2.0**-53:
        return x
    whole = 1.0 + x
    k, f = split_number(whole)
    lacks = 1.0 - (whole - x) if k > 1 else x - (whole - 1.0)
    return log_near(x, 0.0, 0.0) if k == 0 else log_near(f, float(k), lacks / whole)


@compiled
def expm1(x):
    """Return e to the power x, minus 1, as `math.expm1` does, also where x is small.

    Examples
    --------
    >>> expm1(1e-10)
    1.00000000005e-10
    """
    if not -38.0 < x <= LARGEST_EXPONENT:
        return x if math.isnan(x) else math.inf if x > 0.0 else -1.0
    k = math.floor(x * PER_LOG_2 + 0.5) if abs(x) > 0.5 * LOG_2 else 0.0
    high, low = x - k * LOG_2, k * LOG_2_REST
    r = high - low
    return scale_expm1(r, (high - r) - low, int(k)) if k != 0.0 else r - expm1_lacks(r, 0.0)


@compiled
def scale_expm1(r, rest, k):
    """Return 2**k times e to the power r + rest, minus 1; k is not 0."""
    e = expm1_lacks(r, rest)
    if k == -1:
        return 0.5 * (r - e) - 0.5
    if k == 1:
        return -2.0 * (e - (r + 0.5)) if r < -0.25 else 1.0 + 2.0 * (r - e)
    if k < 0 or k > 56:
        value = 1.0 - (e - r)
        return (value * 2.0 * power_of_2(k - 1) if k > BIAS else value * power_of_2(k)) - 1.0
    small = power_of_2(-k)
    return ((1.0 - small) - (e - r) if k < 20 else (r - (e + small)) + 1.0) * power_of_2(k)


# ---- powers

THIRD, THIRD_REST, FIFTH, FIFTH_REST = 1.0 / 3.0, 1.850371707708594e-17, 0.2, -1.1102230246251566e-17
# 1 / 7, 1 / 9 and so on, of the series of the logarithm.
ODD_PARTS = 1.0 / np.arange(7.0, 31.0, 2.0)
# Beyond this exponent a power is 0 or infinite, but of 1.
LARGEST_POWER = 2.0**65


@compiled
def log_in_two(x):
    """Return the logarithm of a positive number as the sum of two, right to about 2**-66 of it.

    Of 2**k (1 + f) it is k log 2 + 2 (s + s**3 / 3 + s**5 / 5 + ...) with s = f / (2 + f), the first terms in pairs of
    numbers (Dekker 1971).
    """
    k, f = split_number(x if x >= LEAST_NORMAL else x * 2.0**54)
    k = float(k) if x >= LEAST_NORMAL else k - 54.0
    below = 2.0 + f
    s = f / below
    product, error = product_and_error(s, below)
    s_rest = ((f - product) - error - s * (f - (below - 2.0))) / below
    z, error = product_and_error(s, s)
    z_rest, tail = error + 2.0 * s * s_rest, 0.0
    for part in ODD_PARTS[::-1]:
        tail = tail * z + part
    tail *= z * z
    a, error = product_and_error(z, FIFTH)
    q = a + tail
    q_rest = (a - q) + tail + (error + z_rest * FIFTH + z * FIFTH_REST)
    v = THIRD + q
    v_rest = (THIRD - v) + q + (THIRD_REST + q_rest)
    u, error = product_and_error(z, v)
    w = 1.0 + u
    w_rest = (1.0 - w) + u + (error + z * v_rest + z_rest * v)
    p, error = product_and_error(2.0 * s, w)
    p_rest = error + 2.0 * (s * w_rest + s_rest * w)
    first = k * LOG_2
    total = first + p
    return total, ((first - total) + p if k != 0.0 else 0.0) + (p_rest + k * LOG_2_REST)


@compiled
def power(x, y):
    """Return x to the power y, as `math.pow` does; NaN of what is negative to a power that is not whole.

    Examples
    --------
    >>> power(2.0, 0.5), power(-2.0, 3.0)
    (1.4142135623730951, -8.0)
    """
    if y == 0.0 or x == 1.0:
        return 1.0
    is_whole = math.isinf(y) or np.floor(y) == y
    if math.isnan(x) or math.isnan(y) or (x < 0.0 and not is_whole and not math.isinf(x)):
        return math.nan
    is_odd = is_whole and not math.isinf(y) and y - 2.0 * np.floor(0.5 * y) == 1.0
    return (math.copysign(1.0, x) if is_odd else 1.0) * power_of_size(abs(x), y)


@compiled
def power_of_size(x, y):
    """Return the power of a number that is not negative; the exponent is not 0."""
    if x == 1.0:
        return 1.0
    if x == 0.0 or math.isinf(x) or abs(y) >= LARGEST_POWER:
        return math.inf if (x > 1.0) == (y > 0.0) else 0.0
    high, low = log_in_two(x)
    product, error = product_and_error(y, high)
    return exp_of_sum(product, error + y * low)


@compiled
def whole_power(x, n):
    """Return x to the power of a whole number, by squaring: 1 / x to the power -n of a negative one.

    Examples
    --------
    >>> whole_power(0.5, 3), whole_power(2.0, -1)
    (0.125, 0.5)
    """
    result, left = 1.0, abs(n)
    while left > 0:
        if left & 1:
            result *= x
        left >>= 1
        x *= x
    return result if n >= 0 else 1.0 / result


# ---- hyperbolic tangent


@compiled
def tanh(x):
    """Return the hyperbolic tangent, as `math.tanh` does.

    Examples
    --------
    >>> tanh(1.0)
    0.7615941559557649
    """
    return tanh_in_line(x)


@compiled
def write_tanh(values):
    """Replace numbers (k,) by their hyperbolic tangents: several at a time, where a processor can."""
    for k in range(values.shape[0]):
        values[k] = tanh_in_line(values[k])


# Without branches, and as part of the loops that call them, so that processors can compute several at a time.


@compiled(inline=True)
def tanh_in_line(x):
    """Return what `tanh` does."""
    a = abs(x)
    t, more = expm1_in_two(2.0 * (a if a <= 22.0 else 22.0))
    below = t + 2.0
    value = t / below
    product, error = product_and_error(value, below)
    lacks = (t - product) - error + more - value * ((2.0 - below) + t + more)
    return math.copysign(value + lacks / below if a <= 22.0 else 1.0 if a > 22.0 else x, x)


@compiled(inline=True)
def expm1_in_two(x):
    """Return e to the power x, minus 1, as the sum of two numbers, of x from 0 to 44."""
    k = np.floor(x * PER_LOG_2 + 0.5)
    high, low = x - k * LOG_2, k * LOG_2_REST
    r, power = high - low, power_of_2(np.int64(np.int32(k)))
    whole, part = power - 1.0, power * r
    first = whole + part
    seen = first - whole
    rest = ((whole - (first - seen)) + (part - seen)) - power * expm1_lacks(r, (high - r) - low)
    return first + rest, rest - (first + rest - first)


# ---- the same of arrays, for what is not compiled


@compiled
def write_directions(angles, x, y):
    """Write cosines and sines of angles; all arrays are flat."""
    for k in range(angles.shape[0]):
        x[k], y[k] = direction_of(angles[k])


@compiled
def write_angles(y, x, angles):
    """Write the angles of directions, likewise."""
    for k in range(angles.shape[0]):
        angles[k] = atan2(y[k], x[k])


@compiled
def write_lengths(x, y, lengths):
    """Write the lengths of vectors, likewise."""
    for k in range(lengths.shape[0]):
        lengths[k] = hypot(x[k], y[k])


def directions_of(angles: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return cosines and sines of an array of angles in radians, each of its shape, see `direction_of`.

    Examples
    --------
    >>> directions_of([0.0, 0.5])[1].tolist()
    [0.0, 0.479425538604203]
    """
    array = np.array(angles, float, order="C")
    x, y = np.empty(array.shape), np.empty(array.shape)
    write_directions(array.reshape(-1), x.reshape(-1), y.reshape(-1))
    return x, y


def angles_of(y: ArrayLike, x: ArrayLike) -> np.ndarray:
    """Return the angles of arrays of directions in radians, from -pi to pi, see `atan2`.

    Examples
    --------
    >>> angles_of([1.0, 1.0], [1.0, -1.0]).tolist()
    [0.7853981633974483, 2.356194490192345]
    """
    return _apply(write_angles, y, x)


def vector_lengths(x: ArrayLike, y: ArrayLike) -> np.ndarray:
    """Return the lengths of arrays of vectors, see `hypot`.

    Examples
    --------
    >>> vector_lengths([3.0, 0.0], [4.0, 1.0]).tolist()
    [5.0, 1.0]
    """
    return _apply(write_lengths, x, y)


def _apply(write: Any, first: ArrayLike, second: ArrayLike) -> np.ndarray:
    arrays = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
    a, b = (np.array(values, order="C") for values in arrays)
    result = np.empty(a.shape)
    write(a.reshape(-1), b.reshape(-1), result.reshape(-1))
    return result
