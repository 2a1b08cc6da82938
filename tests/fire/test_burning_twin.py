"""One step of fires and heat against the equations of appendix B, written down robot by robot."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.fire.burning import burn, nearest_fire

seeds = st.integers(0, 2**32 - 1)
CONSTANTS = 0.01, 0.4, 0.3, 0.5, 4.0, 1.5
REACH = 10.0


def gaps(place, radius, fires):
    """Return how far a body's rim is from each fire's edge."""
    return [math.dist(place, fire[:2]) - fire[2] - radius for fire in fires.tolist()]


def stepped(world, step):
    """Return what a step makes of a world, by the equations."""
    k1, k2, k3, k4, leave, join = CONSTANTS
    new = {name: column.copy() for name, column in world.items()}
    at = []
    for i, place in enumerate(world["position"].tolist()):
        near = [
            (gap, f) for f, gap in enumerate(gaps(place, world["radius"][i], world["fires"])) if not world["out"][f]
        ]
        gap, f = min(near, default=(math.inf, -1))
        heated = gap <= REACH
        new["heat"][i] = k3 * world["burning"][f] * world["area"][f] if heated else 0.0
        new["warmth"][i] = max(world["warmth"][i] + new["heat"][i] - k4, 0.0)
        new["fire"][i] = f if heated and not world["hot"][i] else -1
        cooled = new["warmth"][i] <= join
        new["hot"][i] = not cooled if world["hot"][i] else new["warmth"][i] >= leave
        at.append(new["fire"][i])
    for f in np.flatnonzero(~world["out"]):
        new["robots"][f] = at.count(f)
        grown = world["burning"][f] + k1 * (world["burning"][f] + 1) - k2 / world["area"][f] * at.count(f)
        new["burning"][f] = np.clip(grown, 0, 1)
        if grown <= 0:
            new["out"][f], new["out_step"][f], new["robots"][f] = True, step, 0
    new["robots"][world["out"]] = 0
    new["fire"] = np.array([-1 if f < 0 or new["out"][f] else f for f in at], np.int64)
    return new


def scattered(rng, n, m):
    """Return a small world in which most robots are at fires."""
    return {
        "position": rng.uniform(0, 90, (n, 2)),
        "radius": rng.uniform(1, 6, n),
        "fires": np.column_stack([rng.uniform(0, 90, (m, 2)), rng.uniform(5, 20, m)]),
        "out": rng.random(m) < 0.2,
        "area": rng.uniform(0.5, 5, m),
        "burning": rng.uniform(0.1, 1, m),
        "out_step": np.full(m, -1),
        "robots": rng.integers(0, 9, m),
        "warmth": rng.uniform(0, 6, n),
        "heat": rng.uniform(0, 2, n),
        "hot": rng.random(n) < 0.3,
        "fire": np.full(n, -1),
    }


@pytest.mark.slow
@given(seeds, st.integers(0, 12), st.integers(0, 4))
def test_fires_and_heat_follow_the_equations_robot_by_robot_for_several_steps(seed, n, m):
    world = scattered(np.random.default_rng(seed), n, m)
    world["burning"][world["out"]] = 0.0
    for step in range(1, 9):
        expected = stepped(world, step)
        position, radius, fires, out, area = (world[k] for k in ("position", "radius", "fires", "out", "area"))
        burning, out_step, robots = (world[k] for k in ("burning", "out_step", "robots"))
        were_out = out.copy()
        went_out = burn(
            position, radius, np.arange(m), fires[:, :2], fires[:, 2], area, CONSTANTS, REACH, step,
            burning, out, out_step, robots, world["warmth"], world["heat"], world["hot"], world["fire"],
        )  # fmt: skip
        assert went_out == bool((out & ~were_out).any())
        for name, column in expected.items():
            np.testing.assert_allclose(world[name], column, atol=1e-12, err_msg=name)


def nearest(x, y, radius, fires, out, reach):
    return nearest_fire(x, y, radius, np.arange(len(fires)), fires[:, :2], fires[:, 2], out, reach)


@given(seeds, st.integers(0, 6))
def test_the_nearest_fire_is_that_with_the_nearest_edge_of_those_that_burn(seed, m):
    rng = np.random.default_rng(seed)
    world, (x, y) = scattered(rng, 1, m), rng.uniform(-20, 110, 2)
    near = [
        gap if not out else math.inf for gap, out in zip(gaps((x, y), 3.0, world["fires"]), world["out"], strict=True)
    ]
    expected = int(np.argmin(near)) if min(near, default=math.inf) <= REACH else -1
    assert nearest(x, y, 3.0, world["fires"], world["out"], REACH) == expected


def test_a_fire_is_in_range_up_to_exactly_the_range_and_of_equally_near_ones_the_first_counts():
    fires, burning = np.array([[0.0, 100.0, 20.0], [0.0, 30.0, 20.0], [0.0, -30.0, 20.0]]), np.zeros(3, bool)
    assert nearest(0.0, 0.0, 5.0, fires, burning, 5.0) == 1
    assert nearest(0.0, 0.0, 5.0, fires, burning, math.nextafter(5.0, 0.0)) == -1
    assert nearest(0.0, -1.0, 5.0, fires, burning, 5.0) == 2
