"""Recordings made with version 0.3.0 are verified, and go on as the same run without a recording does."""

import mesa
import pytest

from mesa_swarm.recording import Recording
from support.same_bits import columns_digest, differing
from support.stored_recordings import CHECKPOINT_EVERY, RECORDED, STEPS, begun, class_of, path_of, stepped

CHECKPOINTS = tuple(range(0, STEPS, CHECKPOINT_EVERY))
# Beyond the end of the recordings: a model that is resumed there has sensed what robots read in the next step.
LAST = STEPS + 12


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDED)
def test_a_stored_recording_is_verified(name):
    if name == "stored_world" and hasattr(mesa.Model, "schedule_event"):
        pytest.skip("Mesa 3.5 stores rows of agents by a time, of which Mesa 3.3, which wrote this one, has none")
    verdict = class_of(name).verify(path_of(name))
    assert str(verdict) == f"all {STEPS} rows to step {STEPS} are the same"


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDED)
def test_a_stored_recording_resumes_at_its_checkpoints_and_its_end_to_the_same_future(name):
    assert Recording(path_of(name)).checkpoints == CHECKPOINTS
    whole = stepped(begun(name), LAST)
    expected = columns_digest(whole)  # before the hash, for which robots sense
    state_hash = whole.state_hash()
    for step in (*CHECKPOINTS, CHECKPOINT_EVERY + 7, STEPS):
        resumed = class_of(name).resume(path_of(name), step=step)
        assert resumed.completed == step
        assert differing(expected, columns_digest(stepped(resumed, LAST))) == [], step
        assert resumed.state_hash() == state_hash


def test_loads_were_pushed_bodies_carried_and_events_reported_in_the_world_that_is_stored():
    model = stepped(begun("stored_world"))
    assert all(load.pose != first.pose for load, first in zip(model.loads, begun("stored_world").loads, strict=True))
    assert model.movers.carried.any()
    assert {"counted", "flood"} <= set(model.events.names)
