"""Recordings written by older versions are opened, compared, resumed and drawn."""

import json
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.experiments import experiment
from mesa_swarm.experiments.experiment import checked_experiment
from mesa_swarm.model.state_hash import ENGINE_BITS, written_state_hash
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
FILES = Path(__file__).parent / "files"
OTHER_BITS = (
    "steps of mesa-swarm 0.2.0 have other bits (1) than those of this version (2); to run them again, "
    "use mesa-swarm 0.2.0"
)


@pytest.mark.parametrize("name", WRITTEN)
def test_a_file_of_version_0_2_0_is_read_and_drawn_but_not_verified_since_its_steps_have_other_bits(name, monkeypatch):
    monkeypatch.chdir(FILES)
    model_class, last = WRITTEN[name]
    path = f"{name}_0.2.0.arrow"
    recording = Recording(path)
    assert (recording.provenance["format"], len(recording), recording[-1].step) == (2, last, last)
    scene_of_recording(recording).build()
    with pytest.raises(RecordingError) as refused:
        verify(path, model_class)
    assert str(refused.value) == f"{path} cannot be verified: {OTHER_BITS}"


@pytest.mark.slow
def test_a_file_of_version_0_2_0_is_resumed_from_its_stored_states_and_at_no_step_between(monkeypatch):
    monkeypatch.chdir(FILES)
    path = "fire_fighting_0.2.0.arrow"
    frames = {frame.step: frame for frame in Recording(path)}
    for step in (0, 60, 70):
        model = FireFighting.resume(path, step=step)
        if step == 60:
            np.testing.assert_array_equal(model.swarm.position.astype(np.float32), frames[60]["position"])
        assert model.run(5).completed == step + 5
    with pytest.raises(RecordingError) as refused:
        FireFighting.resume(path, step=65)
    assert OTHER_BITS in str(refused.value)
    assert str(refused.value).endswith("; the nearest steps to resume from are 60 and 70")


@pytest.mark.parametrize("step", [80, 100])
def test_a_state_of_a_model_that_has_processes_now_which_it_had_not_is_refused(step, monkeypatch):
    monkeypatch.chdir(FILES)  # errors of long paths are shortened
    with pytest.raises(RecordingError) as refused:
        Foraging.resume("foraging_0.2.0.arrow", step=step)
    assert f"Foraging has other processes and parts now; {OTHER_BITS}" in str(refused.value)
    assert str(refused.value).endswith("steps with stored states: 0, 80, 160")


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
            for step in range(25):  # one by one: compiled calls read sensors before rows
                if step == 5 and change is not None:
                    change(model)
                model.step()
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


def test_other_bits_are_refused_by_verify_and_by_resume_between_stored_states(tmp_path, monkeypatch):
    with monkeypatch.context() as future:
        future.setattr(provenance, "ENGINE_BITS", 3)
        model = FireFighting(n_robots=2, rng=1)
        with model.record(tmp_path / "run.arrow", checkpoint_every=10):
            model.run(15)
    assert Recording(tmp_path / "run.arrow").provenance["engine_bits"] == 3
    with pytest.raises(RecordingError, match=r"other bits \(3\) than those of this version \(2\)"):
        verify(tmp_path / "run.arrow", FireFighting)
    assert FireFighting.resume(tmp_path / "run.arrow", step=10).completed == 10
    with pytest.raises(RecordingError, match=r"the nearest steps to resume from are 10$"):
        FireFighting.resume(tmp_path / "run.arrow", step=12)


def test_a_recording_of_other_bits_without_stored_states_is_not_run_again(tmp_path, monkeypatch):
    with monkeypatch.context() as future:
        future.setattr(provenance, "ENGINE_BITS", 3)
        model = FireFighting(n_robots=2, rng=1)
        with model.record(tmp_path / "run.arrow", checkpoint_every=0):
            model.run(5)
    with pytest.raises(RecordingError, match="to run them again, use mesa-swarm"):
        FireFighting.resume(tmp_path / "run.arrow", step=3)


def test_engine_bits_are_one_number_in_recordings_and_keys_of_runs(monkeypatch, tmp_path):
    study = checked_experiment("fire_fighting", seeds=1, steps=10)
    key = study.key({"n_robots": 2}, 1)
    with FireFighting(n_robots=1, rng=1).record(tmp_path / "run.arrow"):
        pass
    assert Recording(tmp_path / "run.arrow").provenance["engine_bits"] == ENGINE_BITS
    monkeypatch.setattr(experiment, "ENGINE_BITS", ENGINE_BITS + 1)
    assert study.key({"n_robots": 2}, 1) != key
