"""Recordings written by older versions are opened, compared, resumed and drawn."""

import json
from pathlib import Path

import pytest

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.model.state_hash import written_state_hash
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.foraging import Foraging
from mesa_swarm.recording import Recording, provenance, recorder, verify
from mesa_swarm.recording.layout import Layout
from mesa_swarm.recording.objects import summary
from mesa_swarm.recording.recorder import RowBuffer
from mesa_swarm.recording.sealed_stream import CHANGE
from mesa_swarm.viewing.scene import scene_of_recording

# Written by version 0.2.0: a run that was changed by hand after step 70, and one with a gripper and custom bodies.
WRITTEN = {"fire_fighting": (FireFighting, 120), "foraging": (Foraging, 160)}
LAST_HASH = {"fire_fighting": "fba18a0248ea575634ee3e5cc452c812", "foraging": "acc75e28da0eda085907cdffb13e985f"}
FILES = Path(__file__).parent / "files"


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITTEN)
def test_a_file_of_version_0_2_0_is_verified_and_resumed_at_any_step(name):
    model_class, last = WRITTEN[name]
    path = FILES / f"{name}_0.2.0.arrow"
    assert Recording(path).provenance["format"] == 2
    verdict = verify(path, model_class)
    assert verdict.same, verdict
    for step in (30, last):
        model = model_class.resume(path, step=step).run(last - step)
        if step == last or name == "foraging":
            assert written_state_hash(model) == LAST_HASH[name]


def attach_the_population_only(buffer, model):
    buffer.attach(CHANGE, json.dumps(summary(model)).encode(), model.completed)


def recorded_in_format_1(path, change=None):
    """Record as before format 2: readings of before the step, nothing of interventions or of other scenery."""
    model = FireFighting(n_robots=4, strategy="A", rng=3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(provenance, "FORMAT", 1)
        patch.setattr(Layout, "prepare", lambda layout, model: None)
        patch.setattr(recorder.ChangeDetector, "changes", lambda self, model: [])
        patch.setattr(RowBuffer, "_attach_change", attach_the_population_only)
        patch.setattr(FireFighting, "state_hash", written_state_hash)
        with model.record(path, checkpoint_every=10):
            model.run(5)
            if change is not None:
                change(model)
            model.run(20)
    return Recording(path), model.state_hash()


def build(model):
    model.add_obstacle(disc((400, 200), 20))
    model.add_robots(AGENT9, 1)


def test_a_recording_of_format_1_is_verified_and_resumed(tmp_path):
    recording, state_hash = recorded_in_format_1(tmp_path / "run.arrow")
    assert (recording.provenance["format"], recording.interventions) == (1, ())
    assert str(verify(recording, FireFighting)) == "all 25 rows to step 25 are the same"
    assert SwarmModel.resume(recording.path, step=13).run(12).state_hash() == state_hash


def test_one_that_was_changed_by_hand_is_followed_from_the_next_checkpoint(tmp_path):
    recording, state_hash = recorded_in_format_1(tmp_path / "run.arrow", build)
    assert list(recording.changes) == [6]
    assert verify(recording, FireFighting).step == 6
    with pytest.raises(RecordingError, match="nearest steps to resume from are 5 and 10"):
        SwarmModel.resume(recording.path, step=8)
    assert SwarmModel.resume(recording.path, step=12).run(13).state_hash() == state_hash
    ((step, scenery),) = scene_of_recording(recording).changes
    assert (step, len(scenery["shapes"])) == (0, len(FireFighting(rng=1).obstacles))


def test_formats_of_the_future_are_refused(tmp_path, monkeypatch):
    with monkeypatch.context() as future:
        future.setattr(provenance, "FORMAT", 6)
        future.setattr(provenance, "READABLE", (1, 2, 5, 6))
        with FireFighting(n_robots=1, rng=1).record(tmp_path / "run.arrow"):
            pass
    with pytest.raises(RecordingError, match="has format 6, which this version cannot read; expected one of 1, 2, 5"):
        Recording(tmp_path / "run.arrow")
