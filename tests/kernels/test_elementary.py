"""The elementary functions of the package are right to one unit in the last place, whatever the C library does."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numba import njit

from mesa_swarm.kernels import elementary as own
from mesa_swarm.kernels.custom_functions import compile_custom

# Digits with which the references are computed: the largest angle has 309 before its point.
DIGITS = 380
UNARY = ("sin", "cos", "atan", "exp", "log", "log1p", "expm1", "tanh")
SPECIAL = (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 5e-324, -5e-324, 1e308, -1e308, 0.5, 2.0)

numbers = st.floats(allow_nan=False, allow_infinity=False)
# Also what occurs in models, which is seldom drawn among all numbers.
usual = numbers | st.floats(-10, 10) | st.floats(-1000, 1000)


def arctangent_of_inverse(n):
    """Return the arc whose tangent is 1 / n (J. Machin's series has 5 and 239)."""
    square, power, total, k = n * n, Decimal(1) / n, Decimal(0), 1
    while power > Decimal(10) ** -(DIGITS + 5):
        total += power / k if k % 4 == 1 else -power / k
        power, k = power / square, k + 2
    return total


with localcontext() as context:
    context.prec = DIGITS + 10
    PI = 4 * (4 * arctangent_of_inverse(5) - arctangent_of_inverse(239))


def series(x, first):
    """Return the sine (first 1) or the cosine (0) of a small number."""
    term, total, k = (x if first else Decimal(1)), Decimal(0), first
    while abs(term) > Decimal(10) ** -DIGITS:
        total += term
        term *= -x * x / ((k + 1) * (k + 2))
        k += 2
    return total


def sine(x):
    quarters = (x / (PI / 2)).to_integral_value()
    rest, quarter = x - quarters * PI / 2, int(quarters % 4) % 4
    value = series(rest, 1 - quarter % 2)
    return value if quarter < 2 else -value


def arctangent(x):
    """Return the arc of a tangent from 0 to 1, of which the series converges after three halvings."""
    for _ in range(3):
        x = x / (1 + (1 + x * x).sqrt())
    term, total, k = x, Decimal(0), 1
    while abs(term) > Decimal(10) ** -(DIGITS // 2):
        total += term / k
        term, k = -term * x * x, k + 2
    return 8 * total


def azimuth(y, x):
    """Return the angle of a direction with x or y above 0, both at least 0."""
    return arctangent(y / x) if y <= x else PI / 2 - arctangent(x / y)


REFERENCES = {
    "sin": sine,
    "cos": lambda x: sine(x + PI / 2),
    "atan": lambda x: azimuth(x, Decimal(1)) if x >= 0 else -azimuth(-x, Decimal(1)),
    "exp": lambda x: x.exp(),
    "log": lambda x: x.ln(),
    "log1p": lambda x: (1 + x).ln(),
    "expm1": lambda x: x.exp() - 1,
    "tanh": lambda x: 1 - 2 / ((2 * x).exp() + 1),
}
LIMITS = {"exp": 700.0, "expm1": 700.0, "tanh": 400.0}


def units_off(value, exact):
    """Return by how many units in the last place a number is wrong."""
    return float(abs(Decimal(value) - exact) / Decimal(math.ulp(float(exact))))


@pytest.mark.parametrize("name", UNARY)
@given(x=usual)
def test_a_function_is_right_to_one_unit_in_the_last_place(name, x):
    assume(abs(x) > 1e-150 and abs(x) <= LIMITS.get(name, math.inf))
    x = {"log": abs(x), "log1p": x if x > -1 else -x}.get(name, x)
    with localcontext() as context:
        context.prec = DIGITS
        assert units_off(getattr(own, name)(x), REFERENCES[name](Decimal(x))) <= 1.0


@given(usual, usual)
def test_a_length_is_right_to_one_unit_in_the_last_place(x, y):
    length = own.hypot(x, y)
    assume(0.0 < length < math.inf)
    with localcontext() as context:
        context.prec = DIGITS
        assert units_off(length, (Decimal(x) ** 2 + Decimal(y) ** 2).sqrt()) <= 1.0


@given(usual, usual)
def test_an_angle_is_right_to_one_unit_in_the_last_place(y, x):
    assume(abs(y) > 1e-150 and abs(x) > 1e-150 and 1e-150 < abs(y / x) < 1e150)
    with localcontext() as context:
        context.prec = DIGITS
        exact = azimuth(abs(Decimal(y)), abs(Decimal(x)))
        exact = (PI - exact if x < 0 else exact).copy_sign(Decimal(y))
        assert units_off(own.atan2(y, x), exact) <= 1.0


@given(st.floats(1e-300, 1e300), st.floats(-1.0, 1.0), st.booleans())
def test_a_power_is_right_to_one_unit_in_the_last_place(x, share, whole):
    y = share * 690.0 / max(abs(math.log(x)), 1e-300)
    y = float(round(y)) if whole else y
    assume(y != 0.0 and abs(y) < 1e15)
    with localcontext() as context:
        context.prec = DIGITS
        assert units_off(own.power(x, y), (Decimal(x).ln() * Decimal(y)).exp()) <= 1.0


@given(st.floats(1e-4, 1e4), st.integers(-60, 60))
def test_a_power_of_a_whole_number_is_a_product(x, n):
    product = 1.0
    for _ in range(abs(n)):
        product *= x
    assert own.whole_power(-x, n) * (-1) ** n == own.whole_power(x, n)
    assert own.whole_power(x, n) == pytest.approx(product if n >= 0 else 1.0 / product, rel=1e-13)


def same(a, b):
    return (math.isnan(a) and math.isnan(b)) or (a == b and math.copysign(1.0, a) == math.copysign(1.0, b))


def test_powers_are_those_of_python_at_zeros_infinities_and_negative_numbers():
    numbers = [*SPECIAL, -2.0, 3.0, -3.0, 0.5, -0.5, 1e300, -1e300, 1e16, 2.0**53 + 2]
    for x in numbers:
        for y in numbers:
            try:
                expected = math.pow(x, y)
            except OverflowError:
                expected = math.copysign(math.inf, x) if y % 2 == 1 else math.inf
            except ValueError:
                is_odd = y % 2 == 1
                expected = math.nan if x else math.copysign(math.inf, x) if is_odd else math.inf
            ours = own.power(x, y)
            assert same(ours, expected) or abs(ours - expected) <= math.ulp(expected), (x, y)


@pytest.mark.parametrize("name", ["atan2", "hypot"])
def test_functions_of_two_numbers_are_those_of_python_at_zeros_and_infinities(name):
    for a in SPECIAL:
        for b in SPECIAL:
            ours, theirs = getattr(own, name)(a, b), getattr(math, name)(a, b)
            assert same(ours, theirs) or abs(ours - theirs) <= math.ulp(theirs), (a, b)


@pytest.mark.parametrize("name", UNARY)
def test_functions_of_one_number_are_those_of_python_at_zeros_and_infinities(name):
    beyond = {"sin": math.nan, "cos": math.nan, "exp": math.inf, "expm1": math.inf}
    for x in SPECIAL:
        try:
            expected = getattr(math, name)(x)
        except (ValueError, OverflowError):  # which compiled functions cannot raise
            expected = beyond.get(name, -math.inf if x in (0.0, -1.0) and (name, x) != ("log", -1.0) else math.nan)
        ours = getattr(own, name)(x)
        assert same(ours, expected) or abs(ours - expected) <= math.ulp(expected), x


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_direction_has_the_bits_of_cosine_and_sine(x):
    assert own.direction_of(x) == (own.cos(x), own.sin(x))


def test_functions_are_odd_or_even():
    for x in np.random.default_rng(1).normal(0.0, 50.0, 500).tolist():
        assert own.sin(-x) == -own.sin(x)
        assert own.cos(-x) == own.cos(x)
        assert own.atan2(-x, 2.0) == -own.atan2(x, 2.0)
        assert own.tanh(-x) == -own.tanh(x)


def test_functions_of_arrays_have_the_bits_of_those_of_numbers():
    rng = np.random.default_rng(2)
    y, x = rng.normal(size=(2, 3, 4))
    assert own.angles_of(y, x).tolist() == [[own.atan2(*pair) for pair in zip(*rows)] for rows in zip(y, x)]  # noqa: B905
    assert own.vector_lengths(x, 1.0).tolist() == [[own.hypot(a, 1.0) for a in row] for row in x]
    cosines, sines = own.directions_of(y[:, ::2])
    assert cosines.shape == (3, 2)
    assert [*zip(cosines.ravel(), sines.ravel(), strict=True)] == [own.direction_of(a) for a in y[:, ::2].ravel()]


def test_a_compiled_function_of_a_user_calls_them_for_numbers_in_every_notation():
    def trigonometry(x, y):
        turned = np.exp(1j * x)
        return (
            *(math.sin(x), np.cos(x), math.atan2(y, x), np.arctan2(y, x), math.hypot(x, y), np.hypot(x, y)),
            *(math.exp(x), np.log(y), math.tanh(x), math.log1p(y), np.expm1(x), math.atan(y)),
            *(turned.real, turned.imag, abs(complex(x, y))),
        )

    compiled = compile_custom(trigonometry)
    for x, y in np.random.default_rng(3).uniform(0.1, 3.0, (50, 2)).tolist():
        expected = (
            *(own.sin(x), own.cos(x), own.atan2(y, x), own.atan2(y, x), own.hypot(x, y), own.hypot(x, y)),
            *(own.exp(x), own.log(y), own.tanh(x), own.log1p(y), own.expm1(x), own.atan(y)),
            *(own.cos(x), own.sin(x), own.hypot(x, y)),
        )
        assert compiled(x, y) == expected


def test_powers_in_a_compiled_function_of_a_user_are_of_the_package_in_every_notation():
    def powers(x, y, n):
        growing = x
        growing **= y
        return x**y, x**n, math.pow(x, y), growing, x**0.5, x**2, 3**n, x**-2, 2.0**n

    compiled = compile_custom(powers)
    for x, y in np.random.default_rng(5).uniform(0.1, 3.0, (50, 2)).tolist():
        expected = own.power(x, y), own.whole_power(x, 5), own.power(x, y), own.power(x, y), own.power(x, 0.5)
        assert compiled(x, y, 5) == (*expected, x * x, 243, pytest.approx(1 / (x * x)), 32.0)


def test_an_array_is_raised_in_place():
    def root(values, y):
        values **= y

    values = np.array([4.0, 9.0])
    compile_custom(root)(values, 0.5)
    assert values.tolist() == [2.0, 3.0]


def test_powers_of_arrays_and_complex_numbers_are_as_before():
    found = compile_custom(lambda values, y: (values**y, (1j * y) ** 2.0, values ** np.float64(2.0)))
    squares, negative, others = found(np.array([1.0, 2.0]), 3.0)
    assert (squares.tolist(), others.tolist()) == ([1.0, 8.0], [1.0, 4.0])
    assert negative == pytest.approx(-9.0)


def test_a_compiled_function_of_a_user_keeps_functions_of_arrays_and_of_whole_numbers():
    def of_arrays(values):
        return np.sin(values), np.hypot(values, values), math.sin(2), abs(-3), np.abs(values)

    values = np.array([0.5, -1.5])
    sines, lengths, sine_of_2, whole, magnitudes = compile_custom(of_arrays)(values)
    np.testing.assert_allclose(sines, np.sin(values), rtol=1e-15)
    np.testing.assert_allclose(lengths, np.hypot(values, values), rtol=1e-15)
    assert (sine_of_2, whole, magnitudes.tolist()) == (own.sin(2.0), 3, [0.5, 1.5])


def test_functions_of_arrays_of_any_layout_have_the_bits_of_those_of_numbers():
    x = np.arange(6.0).reshape(2, 3)
    assert own.vector_lengths(x.T, 0 * x.T).tolist() == x.T.tolist()
    assert own.angles_of(np.arange(3.0), np.arange(1.0, 3.0)[:, None]).shape == (2, 3)
    assert own.directions_of(x.T)[1].tolist() == [[own.sin(value) for value in row] for row in x.T.tolist()]
    assert own.directions_of(0.5)[0].shape == ()


def test_whole_and_short_numbers_are_taken_as_real_ones():
    assert own.hypot(3 * 10**9, 4 * 10**9) == 5e9
    assert own.hypot(2**40, 2**40) == own.hypot(2.0**40, 2.0**40)
    short = np.float32(0.1), np.float32(0.2)
    assert own.hypot(*short) == own.hypot(*map(float, short))
    assert own.atan2(*short) == own.atan2(*map(float, short))
    assert own.atan(short[0]) == own.atan(float(short[0]))
    assert own.exp(2) == own.exp(2.0)


def test_compiled_functions_of_a_user_take_truths_and_arrays_to_write_to_as_before():
    def sines(truth, values, out):
        np.sin(values, out)
        return math.exp(truth), np.sin(truth), math.atan2(truth, 2)

    out = np.zeros(2)
    assert compile_custom(sines)(True, np.array([0.5, 1.0]), out) == (own.exp(1.0), own.sin(1.0), own.atan2(1.0, 2.0))
    np.testing.assert_allclose(out, np.sin([0.5, 1.0]))


def test_compiled_helpers_of_a_user_get_them_too():
    @njit
    def sine_of(x):
        return math.sin(x)

    compiled = compile_custom(lambda x: sine_of(x) + 0.0)
    for x in np.random.default_rng(4).uniform(-9.0, 9.0, 200).tolist():
        assert compiled(x) == own.sin(x)
