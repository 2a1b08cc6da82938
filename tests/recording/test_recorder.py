import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, RecordingError, UnknownNameError
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.fire import FireConstants
from mesa_swarm.model.robots_part import RobotsPart
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, record
from mesa_swarm.recording.sealed_stream import SealedWriter


def small(**given):
    model = SwarmModel(map="openspace_fire", rng=3, **given)
    model.add_robots(AGENT9, 4)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def test_what_is_recorded_is_what_was(tmp_path):
    model, positions, contacts = FireFighting(n_robots=30, rng=2), [], []
    with model.record(tmp_path / "run.arrow", exact=True):
        for _ in range(300):
            model.step()
            positions.append(model.swarm.position.copy())
            contacts.append(model.contacts)
    recording = Recording(tmp_path / "run.arrow")
    assert (recording["position"] == positions).all()
    for frame, seen in zip(recording, contacts, strict=True):
        assert frame["contacts"]["robot"].tolist() == seen.robot.tolist()
        assert frame["contacts"]["other"].tolist() == seen.other.tolist()
        assert frame["contacts"]["depth"].tolist() == seen.depth.tolist()
    assert (recording[-1]["fires"]["temperature"] == model.fires.temperature).all()
    assert recording[-1]["fires"]["fire"].tolist() == [fire.unique_id for fire in model.fires]
    assert any(len(seen.robot) for seen in contacts)


def test_a_recorded_run_is_the_run_that_is_not_recorded(tmp_path):
    model = FireFighting(n_robots=10, rng=2)
    with model.record(tmp_path / "run.arrow"):
        model.run(250)
    assert model.state_hash() == FireFighting(n_robots=10, rng=2).run(250).state_hash()


def test_loads_are_recorded_as_they_lie(tmp_path):
    model = CooperativeTransport(rng=1)
    with model.record(tmp_path / "run.arrow", exact=True):
        model.run(50)
    (load,) = model.loads
    assert Recording(tmp_path / "run.arrow")[-1]["loads"].tolist() == [(load.unique_id, *load.pose)]


@pytest.mark.parametrize("every", [4, Trigger(every=4)])
def test_only_multiples_of_every_are_recorded(tmp_path, every):
    model = small().run(3)
    with record(model, tmp_path / "run.arrow", every=every, checkpoint_every=every) as recorder:
        model.run(20)
    assert (recorder.every, recorder.checkpoints) == (4, (3, 7, 11, 15, 19, 23))
    assert Recording(tmp_path / "run.arrow").steps.tolist() == [4, 8, 12, 16, 20]


def test_every_hundredth_step_has_the_models_fingerprint(tmp_path):
    model = small()
    with model.record(tmp_path / "run.arrow"):
        model.run(200)
    hashes = Recording(tmp_path / "run.arrow").hashes
    assert list(hashes) == [1, 100, 200]
    assert hashes[200] == model.state_hash()


def test_robots_obstacles_and_fires_may_come_and_go(tmp_path):
    model = small()
    with model.record(tmp_path / "run.arrow"):
        model.run(5)
        model.robots[1].remove()
        model.fires[0].remove()
        model.run(5)
        model.add_robots(AGENT9, 3)
        model.run(5)
    recording = Recording(tmp_path / "run.arrow")
    assert [len(frame.robots) for frame in recording] == [4] * 5 + [3] * 5 + [6] * 5
    assert len(recording[4]["fires"]) - len(recording[5]["fires"]) == 1
    assert recording[-1].robots.tolist() == [robot.unique_id for robot in model.robots]
    assert len(recording.to_pandas()) == 20 + 15 + 30
    with pytest.raises(InvalidValueError, match="added or removed"):
        recording["position"]


def test_robots_with_more_sensors_than_the_file_has_room_for_are_refused_in_words(tmp_path):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, 2)
    recorder = model.record(tmp_path / "run.arrow")
    model.run(3)
    model.add_robots(AGENT9, 1)
    with pytest.raises(RecordingError, match="add robots of all designs before"):
        model.step()
    assert recorder.closed
    assert len(Recording(tmp_path / "run.arrow")) == 3


def test_columns_are_those_that_were_asked_for(tmp_path):
    model = small()
    with model.record(tmp_path / "run.arrow", columns=("position", "tendency")):
        model.run(2)
    assert Recording(tmp_path / "run.arrow").columns == ("position", "tendency")
    with pytest.raises(UnknownNameError, match="did you mean 'position'"):
        model.record(tmp_path / "other.arrow", columns=("postion",))
    with pytest.raises(InvalidValueError, match="expected names"):
        model.record(tmp_path / "other.arrow", columns="position")
    assert not (tmp_path / "other.arrow").exists()


def test_a_file_is_replaced_only_if_asked(tmp_path):
    path = tmp_path / "run.arrow"
    path.write_text("precious")
    with pytest.raises(RecordingError, match="exists already"):
        small().record(path)
    assert path.read_text() == "precious"
    small().record(path, overwrite=True).close()
    assert len(Recording(path)) == 0


@pytest.mark.parametrize("place", ["missing/run.arrow", ".", "a\0b"])
def test_a_place_that_cannot_be_written_is_refused_in_words(tmp_path, place):
    with pytest.raises(RecordingError, match="choose another"):
        small().record(tmp_path / place)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="nothing is read-only for root")
def test_a_folder_that_is_read_only_is_refused_in_words(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(RecordingError, match="Permission denied"):
        small().record(tmp_path / "run.arrow")


class FullDisk:
    """A file on a disk with room for a number of bytes."""

    def __init__(self, file, room):
        self._file, self._room = file, room

    def __getattr__(self, name):
        return getattr(self._file, name)

    def write(self, content):
        if not self._room:
            raise OSError(28, "No space left on device")
        part = content[: self._room]
        self._room -= len(part)
        return self._file.write(part)


def test_on_a_full_disk_what_was_written_remains_and_the_model_may_go_on(tmp_path):
    model = small()
    recorder = model.record(tmp_path / "run.arrow")
    model.run(20)
    recorder.flush()
    writer = recorder._buffer.writer
    writer._file = FullDisk(writer._file, 300)
    for _ in range(20):
        model.step()
    with pytest.raises(RecordingError, match=r"No space left on device; its 20 rows so far remain"):
        recorder.flush()
    assert recorder.closed
    assert len(Recording(tmp_path / "run.arrow")) == 20
    assert (tmp_path / "run.arrow").stat().st_size == writer.sealed.end
    assert model.run(1).steps == 41


@pytest.mark.parametrize("moment", range(1, 6))
def test_ctrl_c_while_a_chunk_is_written_neither_loses_nor_doubles_a_row(tmp_path, monkeypatch, moment):
    model, calls = small(), []
    recorder = model.record(tmp_path / "run.arrow")
    for _ in range(10):
        model.step()
    whole = {name: getattr(SealedWriter, name) for name in ("_put", "_message", "write")}

    def interrupted(name):
        def call(self, *given):
            calls.append(name)
            if len(calls) == moment:
                raise KeyboardInterrupt
            value = whole[name](self, *given)
            if name == "_put" and moment == 5:
                raise KeyboardInterrupt  # after the bytes, before the counts
            return value

        return call

    with monkeypatch.context() as patch:
        for name in whole:
            patch.setattr(SealedWriter, name, interrupted(name))
        with pytest.raises(KeyboardInterrupt):
            recorder.flush()
    model.run(5)
    recorder.close()
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 16))


def test_ctrl_c_closes_the_recording_of_a_run(tmp_path, monkeypatch):
    model = small()
    recorder = model.record(tmp_path / "run.arrow")
    move = RobotsPart.move

    def interrupted(part):
        if model.steps == 8:
            raise KeyboardInterrupt
        move(part)

    monkeypatch.setattr(RobotsPart, "move", interrupted)
    model.parts.replan()
    with pytest.raises(KeyboardInterrupt):
        model.run(20, until=lambda model: False)  # which makes Python due in each step
    assert recorder.closed
    assert Recording(tmp_path / "run.arrow").complete
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 8))


@pytest.mark.slow
def test_a_recording_that_is_not_closed_is_closed_when_the_program_ends(tmp_path):
    program = (
        "import sys; from mesa_swarm.models.fire_fighting import FireFighting; "
        "model = FireFighting(rng=1); model.record(sys.argv[1]); model.run(7)"
    )
    subprocess.run([sys.executable, "-c", program, str(tmp_path / "run.arrow")], check=True)
    assert len(Recording(tmp_path / "run.arrow")) == 7
    assert Recording(tmp_path / "run.arrow").complete


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_of_a_model_is_not_recorded(tmp_path, duplicate):
    model = FireFighting(rng=1)
    with model.record(tmp_path / "run.arrow"):
        twin = duplicate(model)
        twin.run(5)
        model.run(3)
    assert len(Recording(tmp_path / "run.arrow")) == 3


def test_two_recordings_of_one_model_do_not_disturb_each_other(tmp_path):
    model = small()
    with model.record(tmp_path / "a.arrow"), model.record(tmp_path / "b.arrow", every=2):
        model.run(10)
    assert len(Recording(tmp_path / "a.arrow")) == 10
    assert len(Recording(tmp_path / "b.arrow")) == 5


def test_a_parameter_that_cannot_be_recorded_is_refused_before_a_file_is_made(tmp_path):
    for given in ({"model_reporters": {"n": lambda model: 1}}, {"rng": np.random.default_rng(1)}):
        model = SwarmModel(**given)
        with pytest.raises(RecordingError, match="which cannot be recorded"):
            model.record(tmp_path / "run.arrow")
        assert not (tmp_path / "run.arrow").exists()
        model.record(tmp_path / "run.arrow", rerun=False).close()
        (tmp_path / "run.arrow").unlink()


def test_the_file_contains_its_provenance(tmp_path):
    model = FireFighting(n_robots=3, rng=7)
    record(model, tmp_path / "run.arrow").close()
    facts = Recording(tmp_path / "run.arrow").provenance
    assert facts["model"] == {"module": "mesa_swarm.models.fire_fighting", "name": "FireFighting"}
    assert facts["parameters"]["n_robots"] == 3
    assert facts["parameters"]["strategy"] == "B"
    assert facts["seed"] == 7
    assert facts["versions"]["mesa-swarm"]
    assert facts["map"] == model.map.to_toml()
    assert facts["start"] == {"step": 0, "state_hash": model.state_hash()}


def test_parts_that_are_parameters_are_recorded(tmp_path):
    constants = FireConstants(0.001, 0.02, 0.08, 0.25, 250, 150)
    small(fire_constants=constants).record(tmp_path / "run.arrow").close()
    facts = Recording(tmp_path / "run.arrow").provenance
    assert facts["parameters"]["fire_constants"]["FireConstants"]["k2"] == 0.02


@pytest.mark.slow
@pytest.mark.parametrize("exact", [False, True])
def test_poses_and_temperatures_of_50_robots_over_3000_steps_take_less_than_3_mb(tmp_path, exact):
    model = FireFighting(n_robots=50, strategy="A", k2=0.001, rng=1)  # the fires last
    with model.record(tmp_path / "run.arrow", columns=("position", "heading", "temperature"), exact=exact):
        model.run(3000)
    assert len(Recording(tmp_path / "run.arrow")) == 3000
    assert (tmp_path / "run.arrow").stat().st_size < 3_000_000


def test_after_a_run_all_its_rows_can_be_read_and_the_recorder_goes_on(tmp_path):
    model = small()
    recorder = model.record(tmp_path / "run.arrow")
    for steps in (100, 30, 10):
        model.run(steps)
        recording = Recording(tmp_path / "run.arrow")
        assert (len(recording), recording[-1].step) == (model.completed, model.completed)
        assert not recording.complete
        assert not recorder.closed
    recorder.close()
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 141))


@pytest.mark.slow
def test_runs_of_one_step_make_no_larger_a_file_than_one_run_of_all(tmp_path):
    sizes = []
    for name, lengths in (("one", [300]), ("many", [1] * 300), ("tens", [10] * 30)):
        model = small()
        with model.record(tmp_path / name):
            for steps in lengths:
                model.run(steps)
        sizes.append((tmp_path / name).stat().st_size)
    assert sizes[1] == pytest.approx(sizes[0], rel=0.02)
    assert sizes[2] < sizes[0] + 30 * 8_000


def test_who_looks_for_a_step_that_is_not_in_an_open_file_hears_that_it_is_open(tmp_path):
    model = small()
    with model.record(tmp_path / "run.arrow"):
        model.run(20)
        model.run(5)
        with pytest.raises(InvalidValueError, match=r"at most 20; it is not closed: call close\(\)"):
            SwarmModel.resume(tmp_path / "run.arrow", step=25)
        with pytest.raises(InvalidValueError, match="it is not closed"):
            Recording(tmp_path / "run.arrow").at(25)
