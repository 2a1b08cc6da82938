"""Random numbers in compiled functions: drawn from a model's own streams, or a function of a key and of what asks.

A compiled function calls NumPy's function that draws one number, by its address, with the address of the state of the
generator. So the stream moves on as if Python had drawn, and what is stored, copied or drawn later is the same.

Where it may not depend on others how many numbers one has drawn before, they are counter-based: `draw_at` mixes a key,
which a stream gives, with numbers of what asks (J. K. Salmon and others, 2011, SC '11, for the idea).
"""

import ctypes
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.cgutils import ir
from numba.extending import intrinsic

from mesa_swarm.kernels.compiled import compiled

# Of SplitMix64 (G. L. Steele, D. Lea and C. H. Flood, 2014, OOPSLA '14).
GOLDEN, FIRST_FACTOR, SECOND_FACTOR = map(np.uint64, (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))


class Stream(NamedTuple):
    """A stream of random numbers for compiled functions, in a `Block`; the generator has to live as long.

    Parameters
    ----------
    draw : int
        The address of the function that draws a number, uniform in [0, 1).
    state : int
        The address of what it changes.
    """

    draw: int
    state: int


def stream_of(generator: np.random.Generator) -> Stream:
    """Return what compiled functions take of a generator.

    Examples
    --------
    >>> generator = np.random.default_rng(1)
    >>> draw_number(stream_of(generator)) == np.random.default_rng(1).random()
    True
    """
    interface = generator.bit_generator.ctypes
    return Stream(_address_of(interface.next_double), _address_of(interface.state))


class Words(NamedTuple):
    """A stream of words of 64 random bits for compiled functions, likewise: where nothing is drawn, two zeros.

    Parameters
    ----------
    draw : int
        The address of the function that draws a word.
    state : int
        The address of what it changes.
    """

    draw: int
    state: int


def words_of(generator: np.random.Generator) -> Words:
    """Return what compiled functions take of a generator to draw words of 64 bits.

    Examples
    --------
    >>> generator = np.random.default_rng(1)
    >>> int(draw_word(words_of(generator))) == int(np.random.default_rng(1).integers(2**64, dtype=np.uint64))
    True
    """
    interface = generator.bit_generator.ctypes
    return Words(_address_of(interface.next_uint64), _address_of(interface.state))


def _address_of(pointer: Any) -> int:
    return int(ctypes.cast(pointer, ctypes.c_void_p).value or 0)


def _call_at_address(result: Any) -> Any:
    """Return what writes the code of a call of a function of an address, by its own address."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address, state = arguments
        place = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(result, [place])
        function = builder.inttoptr(address, kind.as_pointer())
        return builder.call(function, [builder.inttoptr(state, place)])

    return code


@intrinsic
def _call(typing_context: Any, function: Any, state: Any) -> Any:
    """Call a function that takes an address and returns a real number, by its own address."""
    return types.float64(types.int64, types.int64), _call_at_address(ir.DoubleType())


@intrinsic
def _call_for_word(typing_context: Any, function: Any, state: Any) -> Any:
    """Call a function that takes an address and returns 64 bits, by its own address."""
    return types.uint64(types.int64, types.int64), _call_at_address(ir.IntType(64))


@compiled
def draw_number(stream: Stream) -> float:
    """Return a number uniform in [0, 1), as ``generator.random()`` does; for compiled functions."""
    return _call(stream.draw, stream.state)  # type: ignore[call-arg]


@compiled
def draw_between(stream: Stream, low: float, high: float) -> float:
    """Return a number uniform in [low, high), as ``generator.uniform(low, high)`` does; for compiled functions."""
    return low + (high - low) * _call(stream.draw, stream.state)  # type: ignore[call-arg]


@compiled
def draw_word(words: Words) -> int:
    """Return 64 random bits, as ``generator.integers(2**64, dtype=uint64)`` does; for compiled functions."""
    return _call_for_word(words.draw, words.state)  # type: ignore[call-arg]


@compiled
def mix_bits(bits):
    """Return 64 bits that all depend on all of those given (the finaliser of SplitMix64)."""
    bits = (bits ^ (bits >> np.uint64(30))) * FIRST_FACTOR
    bits = (bits ^ (bits >> np.uint64(27))) * SECOND_FACTOR
    return bits ^ (bits >> np.uint64(31))


@compiled
def mix_number(bits, number):
    """Return 64 bits that depend on all of those given, and on a whole number."""
    return mix_bits(bits + GOLDEN * np.uint64(number))


@compiled
def number_of_bits(bits):
    """Return the number in [0, 1) that the first 53 of 64 bits are."""
    return (bits >> np.uint64(11)) * 2.0**-53


@compiled
def draw_at(key, first, second):
    """Return a number in [0, 1) that a key of 64 bits and two whole numbers decide, such as a robot's and a count.

    Examples
    --------
    >>> key = np.uint64(1)
    >>> draw_at(key, 2, 3) == draw_at(key, 2, 3), draw_at(key, 2, 3) == draw_at(key, 3, 2)
    (True, False)
    """
    return number_of_bits(mix_number(mix_number(key, first), second))
