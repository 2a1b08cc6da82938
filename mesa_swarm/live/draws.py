"""NumPy's generator PCG64 in compiled code, for pages: the same words from the same state.

It is the 128-bit permuted congruential generator XSL-RR (M. E. O'Neill, 2014, HMC-CS-2014-0905), with NumPy's
multiplier. A state is four words: the number, high and low, and its increment, high and low.
"""

import numpy as np

from mesa_swarm.kernels.compiled import compiled

HIGH_FACTOR, LOW_FACTOR = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)
HALF, LOW_HALF = np.uint64(32), np.uint64(0xFFFFFFFF)
NONE, ONE, TURN, LAST = np.uint64(0), np.uint64(1), np.uint64(58), np.uint64(63)


@compiled
def high_product(a, b):
    """Return the upper 64 of the 128 bits of a product of two words.

    Examples
    --------
    >>> int(high_product(np.uint64(2**63), np.uint64(6)))
    3
    """
    a_low, a_high, b_low, b_high = a & LOW_HALF, a >> HALF, b & LOW_HALF, b >> HALF
    middle = a_high * b_low + ((a_low * b_low) >> HALF)
    other = a_low * b_high + (middle & LOW_HALF)
    return a_high * b_high + (middle >> HALF) + (other >> HALF)


@compiled
def next_word(state):
    """Advance a state, uint64 (4,), and return its next 64 random bits.

    Examples
    --------
    >>> generator = np.random.Generator(np.random.PCG64(5))
    >>> number, increment = (generator.bit_generator.state["state"][name] for name in ("state", "inc"))
    >>> words = np.array([half for whole in (number, increment) for half in divmod(whole, 2**64)], np.uint64)
    >>> int(next_word(words)) == int(generator.integers(2**64, dtype=np.uint64))
    True
    """
    high, low = state[0], state[1]
    new_low = low * LOW_FACTOR
    new_high = high_product(low, LOW_FACTOR) + high * LOW_FACTOR + low * HIGH_FACTOR
    low = new_low + state[3]
    high = new_high + state[2] + (ONE if low < new_low else NONE)
    state[0], state[1] = high, low
    word, turn = high ^ low, high >> TURN
    return (word >> turn) | (word << ((np.uint64(64) - turn) & LAST))
