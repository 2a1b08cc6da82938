import random

import pyarrow as pa
import pytest

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import RecordingError, UnstoredStateWarning
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.state_hash import written_state_hash
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.sealed_stream import SealedReader
from support.other_code import other_code


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """Return a recording with changes by hand at steps 150 and 250, checkpoints every 100, and the fingerprint."""
    path, model = tmp_path_factory.mktemp("changed") / "run.arrow", FireFighting(rng=4)
    with model.record(path, checkpoint_every=100):
        model.run(150)
        model.add_obstacle(disc((200, 200), 15))
        model.robots[2].remove()
        model.run(100)
        model.robots[0].heading = 0.5
        model.run(100)
    return path, model.state_hash()


def check_random_steps(path, steps, count, every):
    draw, hashes, model = random.Random(1), [], FireFighting(n_robots=12, rng=7)
    with model.record(path, checkpoint_every=every):
        for _ in range(steps):
            model.step()
            hashes.append(model.state_hash())
    for step in draw.sample(range(1, steps), count):
        again = SwarmModel.resume(path, step=step)
        assert (again.steps, again.state_hash()) == (step, hashes[step - 1])
        last = min(step + 30, steps)
        for _ in range(step, last):  # not run: it stops when all fires are out
            again.step()
        assert again.state_hash() == hashes[last - 1]


@pytest.mark.slow
def test_resumed_at_random_steps_the_run_is_the_uninterrupted_one(tmp_path):
    check_random_steps(tmp_path / "run.arrow", 300, 8, 70)


@pytest.mark.long
def test_resumed_at_thirty_random_steps_the_run_is_the_uninterrupted_one(tmp_path):
    check_random_steps(tmp_path / "run.arrow", 3000, 30, 500)


def test_few_steps_are_run_to_resume(tmp_path, monkeypatch):
    model = FireFighting(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=100) as recorder:
        model.run(380)
    assert recorder.checkpoints == Recording(recorder.path).checkpoints == (0, 100, 200, 300)
    taken, step = [], FireFighting.step
    monkeypatch.setattr(FireFighting, "step", lambda self: (taken.append(1), step(self))[1])
    assert SwarmModel.resume(recorder.path, step=370).steps == 370
    assert len(taken) == 70


@pytest.mark.slow
@pytest.mark.parametrize("step", [150, 151, 200, 249, 250, 251, 300, 350])
def test_after_a_change_by_hand_one_resumes_at_any_step(changed, step):
    path, state_hash = changed
    again = SwarmModel.resume(path, step=step)
    assert len(again.robots) == 9
    while again.completed < min(step + 20, 350):
        again.step()
    assert step < 330 or again.state_hash() == state_hash


@pytest.mark.slow
def test_where_other_code_ran_the_nearest_steps_are_named(tmp_path):
    model = FireFighting(rng=4)
    with (
        other_code(150, lambda model: setattr(model.robots[0], "heading", 0.5)),
        model.record(tmp_path / "run.arrow", checkpoint_every=100),
    ):
        model.run(210)
    for step in (151, 199):
        with pytest.raises(RecordingError, match=r"the nearest steps to resume from are 150 and 200$"):
            SwarmModel.resume(tmp_path / "run.arrow", step=step)
    assert SwarmModel.resume(tmp_path / "run.arrow", step=150).steps == 150
    assert SwarmModel.resume(tmp_path / "run.arrow", step=205).steps == 205


def test_a_damaged_state_after_a_change_is_reported(changed, tmp_path):
    content, path = bytearray(changed[0].read_bytes()), tmp_path / "run.arrow"
    reader = SealedReader(changed[0])
    states = [piece for piece in reader.attached if reader.name(piece) == "checkpoint"]
    place = next(place for place, piece in enumerate(states) if piece.step == 150)
    content[(states[place].begin + states[place].end) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="damaged"):
        SwarmModel.resume(path, step=160)
    assert SwarmModel.resume(path, step=149).steps == 149


@pytest.mark.slow
def test_verify_goes_on_after_each_change_by_hand(changed):
    verification = verify(Recording(changed[0]), FireFighting)
    assert verification.same
    assert [one.step for one in verification.interventions] == [150, 250]


def test_parameters_may_change_and_the_world_is_that_after_a_change_by_hand(changed):
    assert SwarmModel.resume(changed[0], step=120, strategy="A").run(5).steps == 125
    again = SwarmModel.resume(changed[0], step=350, strategy="A")
    assert len(again.robots) == 9
    assert written_state_hash(again) == written_state_hash(SwarmModel.resume(changed[0], step=350))


def test_a_model_that_was_made_by_hand_is_resumed(tmp_path):
    model = SwarmModel(rng=2)
    model.add_robots(AGENT9, 5)
    model.control = Subsumption(Avoid(distance=15), Explore())
    model.run(7)
    with model.record(tmp_path / "run.arrow"):
        model.run(40)
    assert SwarmModel.resume(tmp_path / "run.arrow", step=7).run(40).state_hash() == model.state_hash()


def test_without_checkpoints_a_run_is_resumed_from_its_beginning(tmp_path):
    model = FireFighting(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=0):
        model.run(60)
    recording = Recording(tmp_path / "run.arrow")
    assert recording.checkpoints == ()
    assert recording.provenance["why_no_checkpoint"] == "checkpoint_every is 0"
    assert SwarmModel.resume(tmp_path / "run.arrow", step=30).run(30).state_hash() == model.state_hash()


class Befriended(FireFighting):
    """A model with a value that cannot be stored."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.friend = object()


def test_of_a_model_that_cannot_be_stored_the_reason_is_and_it_is_run_again(tmp_path):
    model, match = Befriended(rng=1), "^Befriended is recorded without checkpoints, .* friend is <object"
    with pytest.warns(UnstoredStateWarning, match=match) as seen:
        recorder = model.record(tmp_path / "run.arrow")
    assert [(str(one.message).count("\n"), one.filename) for one in seen] == [(0, __file__)]
    with recorder:
        model.run(30)
    assert recorder.checkpoints == ()
    assert recorder.why_no_checkpoint.startswith("friend is <object")
    assert Recording(recorder.path).provenance["why_no_checkpoint"] == recorder.why_no_checkpoint
    assert Befriended.resume(recorder.path, step=20).run(10).state_hash() == model.state_hash()


def test_a_torn_recording_resumes_from_its_last_whole_checkpoint(tmp_path):
    path, model = tmp_path / "run.arrow", FireFighting(rng=1)
    with model.record(path, checkpoint_every=50):
        model.run(120)
    content = path.read_bytes()
    reader = SealedReader(path)
    last = reader.attached[-1]
    path.write_bytes(content[: last.end - 9])
    assert Recording(path).checkpoints == (0, 50)
    assert SwarmModel.resume(path).run(20).state_hash() == model.state_hash()
    flipped = bytearray(content)
    flipped[last.begin + (last.end - last.begin) // 2] ^= 1
    path.write_bytes(flipped)
    assert SwarmModel.resume(path, step=100).run(20).state_hash() == model.state_hash()


def test_any_arrow_reader_opens_a_recording_with_checkpoints(tmp_path):
    model = FireFighting(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=10):
        model.run(35)
    with pa.ipc.open_stream(str(tmp_path / "run.arrow")) as reader:
        assert reader.read_all()["step"].to_pylist() == list(range(1, 36))


@pytest.mark.slow
def test_the_file_does_not_grow_with_the_square_of_the_run(tmp_path):
    sizes = []
    model = FireFighting(n_robots=2, history_every=1, rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=100, columns=("layer",)):
        model.run(1200)
    reader = SealedReader(tmp_path / "run.arrow")
    sizes = [len(reader.content(piece)) for piece in reader.attached]
    assert max(sizes[-3:]) < 1.5 * min(sizes[1:4])
