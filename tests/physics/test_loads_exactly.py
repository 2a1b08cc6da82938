"""The compiled loads move as those of Shapely and plain Python do, to the last bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import polygon
from support import shapely_loads
from support.pushing import note_returns
from support.random_worlds import hauled, load_state, state

STEPS = 40
BENT = polygon([(20, 20), (44, 20), (44, 27), (28, 27), (28, 40), (20, 40)])
RING = polygon([(60, 60), (90, 60), (90, 90), (60, 90)], [[(64, 64), (64, 86), (86, 86), (86, 64)]])


def after(world, steps, seed=None):
    """Return the bytes of all that a world's robots and loads are after some steps, with doors that go about."""
    model = world.model()
    doors = []
    if seed is not None:
        rng = np.random.default_rng(seed)
        for shape in (BENT, RING):
            try:
                model.add_load(shape, resistance=0.3)
                doors.append(model.add_body(polygon([(5, 100), (12, 100), (9, 106)]), kind="door"))
            except ValueError:
                pass
    for step in range(steps):
        for door in doors if step else ():
            place = np.clip(door.position + rng.uniform(-2, 2, 2), 10, 100)
            door.move_to((*place, door.heading + rng.uniform(-0.2, 0.2)))
        try:
            model.step()
        except ValueError as problem:
            assert "no room is left" in str(problem)
            break
    return {name: column.tobytes() for name, column in (state(model) | load_state(model)).items()}


@pytest.mark.long
@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_loads_are_where_the_oracle_has_them_in_hundreds_of_worlds(seed):
    check(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_loads_are_where_the_oracle_has_them_bit_for_bit(seed):
    check(seed)


def check(seed):
    world = hauled(seed)
    ours = after(world, STEPS, seed if seed % 2 else None)
    with pytest.MonkeyPatch.context() as patch:
        shapely_loads.use(patch)
        assert after(world, STEPS, seed if seed % 2 else None) == ours


@pytest.mark.slow
def test_the_worlds_above_have_loads_that_slide_and_some_that_are_taken_back(monkeypatch):
    taken = note_returns(monkeypatch)
    for seed in range(8):
        after(hauled(seed), STEPS)
    assert taken
