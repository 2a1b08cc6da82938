"""Wire fitting: interpolation, and gradients against finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.learning.wire_learning import wire_value

SEEDS = st.integers(0, 2**32)


def some(seed):
    rng = np.random.default_rng(seed)
    count = rng.integers(1, 7)
    return rng.uniform(-1, 1, 2), rng.uniform(-1, 1, (count, 2)), rng.uniform(-2, 2, count)


def plain(u, wires, q, c=0.1, eps=0.01):
    distance = ((u - wires) ** 2).sum(axis=1) + c * (q.max() - q) + eps
    return (q / distance).sum() / (1 / distance).sum()


@given(SEEDS)
def test_the_value_is_that_of_plain_numpy_and_between_the_worst_and_the_best(seed):
    u, wires, q = some(seed)
    value, _, _ = wire_value(u, wires, q)
    assert value == pytest.approx(plain(u, wires, q), abs=1e-12)
    assert q.min() - 1e-12 <= value <= q.max() + 1e-12


@given(SEEDS, st.booleans())
def test_gradients_are_those_of_finite_differences_also_at_the_best_wire(seed, at_the_best):
    u, wires, q = some(seed)
    if at_the_best:
        u = wires[q.argmax()].copy()
    _, by_wire, by_value = wire_value(u, wires, q)
    tiny = 1e-6
    for exact, part in ((by_wire, wires), (by_value, q)):
        for place in np.ndindex(part.shape):
            before, sides = part[place], []
            for side in (tiny, -tiny):
                part[place] = before + side
                sides.append(plain(u, wires, q))
            part[place] = before
            assert exact[place] == pytest.approx((sides[0] - sides[1]) / (2 * tiny), abs=2e-6, rel=1e-5)


@pytest.mark.parametrize(
    ("u", "wires", "q"),
    [
        ([0, 0], [[0, 0]], [np.nan]),
        ([0], [[0, 0]], [1]),
        ([0, 0], [[0]], [1]),
        ([0, 0], np.empty((0, 2)), []),
        ("ab", [[0, 0]], [1]),
        ([0, 0], [[0, 0], [1]], [1]),
        ([0, 0], [[0, 0]], 1),
        ([0, 0], [[0, 0]], None),
    ],
)
def test_nonsense_is_refused(u, wires, q):
    with pytest.raises(InvalidValueError) as caught:
        wire_value(u, wires, q)
    assert "\n" not in str(caught.value)
