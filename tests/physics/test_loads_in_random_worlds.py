"""Loads in random worlds: both engines move them alike, and no place, direction, side or order is preferred."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from support.pace import in_time
from support.random_worlds import differences, hauled, load_state, outcome, random_world, state, with_loads

EXACT = 1e-9
# Many steps of a crowd multiply rounding.
CLOSE = 1e-7
NUDGE, JUMP = 1e-10, 1e-6
STEPS = 12

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=12)


def run(world, engine="compiled", steps=STEPS):
    """Return where robots and loads are after some steps."""
    model = world.model(engine).run(steps)
    return state(model) | load_state(model)


def generic(world, engine="compiled"):
    """Return the outcome of a world, if it does not jump when the robots are moved very slightly."""
    found, nudged = run(world, engine), run(world.nudged(NUDGE), engine)
    assume(max(differences(found, nudged).values()) < JUMP)
    return found


def check_same(here, there):
    found = differences(here, there)
    assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=CLOSE)


def check_engines(world):
    """Assert that both engines move everything alike, unless the slow one's own outcome jumps."""
    oracle, ours = run(world, "shapely"), run(world)
    if max(differences(oracle, ours).values()) > CLOSE:
        generic(world, "shapely")
    check_same(oracle, ours)


@pytest.mark.slow
@settings(max_examples=6)
@given(seeds)
def test_both_engines_move_loads_alike(seed):
    check_engines(hauled(seed))


@pytest.mark.long
@settings(max_examples=in_time(150))
@given(seeds)
def test_both_engines_move_loads_alike_in_hundreds_of_worlds(seed):
    check_engines(hauled(seed))


@pytest.mark.slow
@few
@given(seeds)
def test_both_engines_read_and_do_the_same_in_random_worlds_with_loads(seed):
    world = with_loads(random_world(seed), seed, 8)
    oracle = outcome(world.model("shapely"))
    found = differences(outcome(world.model()), oracle)
    if max(found.values()) > EXACT:
        assume(max(differences(oracle, outcome(world.nudged(NUDGE).model("shapely"))).values()) < JUMP)
    assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=EXACT)


@pytest.mark.slow
def test_both_engines_agree_to_the_last_digits_after_one_step():
    for seed in range(12):
        world = hauled(seed)
        found = differences(run(world, steps=1), run(world, "shapely", steps=1))
        assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=EXACT)


@pytest.mark.slow
@few
@given(seeds)
def test_the_order_in_which_robots_were_created_is_nothing_to_loads(seed):
    world = hauled(seed)
    order = np.random.default_rng(seed).permutation(len(world.poses))
    here = generic(world)
    check_same({n: c if n.startswith("load") else c[order] for n, c in here.items()}, run(world.reordered(order)))


@pytest.mark.slow
@few
@given(seeds)
def test_a_world_with_loads_turned_by_a_quarter_does_the_same_turned(seed):
    world = hauled(seed)
    here = generic(world)
    there = run(
        world.moved(
            lambda points: np.stack([-points[..., 1], points[..., 0]], axis=-1), lambda heading: heading + math.pi / 2
        )
    )
    for name in ("position", "load_position"):
        there[name] = np.stack([there[name][:, 1], -there[name][:, 0]], axis=-1)
    there["heading"] = np.mod(there["heading"] - math.pi / 2 + math.pi, 2 * math.pi) - math.pi
    check_same(here, there)


@pytest.mark.slow
@few
@given(seeds)
def test_a_mirrored_world_with_loads_does_the_same_mirrored(seed):
    world = hauled(seed)
    here = generic(world)
    image = replace(
        world.moved(lambda points: points * [1.0, -1.0], lambda heading: -heading), commands=world.commands[:, ::-1]
    )
    there = run(image)
    for name in ("position", "load_position"):
        there[name] = there[name] * [1.0, -1.0]
    there |= {name: -there[name] for name in ("heading", "load_heading")}
    there["slip"] = there["slip"][:, ::-1]
    check_same(here, there)


def test_the_worlds_above_have_loads_that_move_turn_and_are_taken_back():
    moved = [hauled(seed).model() for seed in range(10)]
    before = [load_state(model) for model in moved]
    after = [load_state(model.run(STEPS)) for model in moved]
    ways = np.concatenate(
        [np.hypot(*(a["load_position"] - b["load_position"]).T) for a, b in zip(after, before, strict=True)]
    )
    turns = np.concatenate([a["load_heading"] for a in after])
    assert (ways > 0.1).sum() > 20
    assert (abs(turns) > 0.01).sum() > 5
