"""Recordings whose chunks are full, however slow the machine."""

import math

import pytest


def recorded_in_full_chunks(model, path, steps):
    """Record a run; by the clock alone no chunk is written."""
    with pytest.MonkeyPatch.context() as patched, model.record(path):
        patched.setattr("mesa_swarm.recording.recorder.MOST_SECONDS", math.inf)
        model.run(steps)
    return path
