import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, Radio, SwarmModel, disc
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.cli import main
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.fire import design_constants
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.changes import ChangeDetector, Intervention, as_remark
from mesa_swarm.robots.imperfections import ROBOTARIUM
from support.other_code import other_code

HAND, LAST = 12, 20


def move(model):
    model.robots[0].position = (40.0, 40.0)


def turn(model):
    model.robots[1].heading = 0.5


def slow_down(model):
    model.robots[2].max_speed = 0.25


def cool(model):
    model.robots[0].temperature = 30.0


def write_column(model):
    model.swarm.columns["heading"][:] = 1.0


def take_out(model):
    model.robots[1].remove()


def add_robots(model):
    model.add_robots(AGENT9, 3)


def add_obstacle(model):
    model.add_obstacle(disc((400, 300), 30))


def add_fire(model):
    model.add_fire((200, 200), radius=20)


def feed_fire(model):
    model.fires[0].temperature = 0.25


def put_out(model):
    model.fires[1].remove()


def change_constants(model):
    model.fire_constants = design_constants(growth_time=500)


def spoil(model):
    model.imperfections = ROBOTARIUM.at(1.0)


def replace_control(model):
    model.control = Subsumption(Avoid(distance=8), Explore())


def talk(model):
    model.communication = Radio(range=200)


def reach_farther(model):
    model.extinguish_range = 60.0


CHANGES = {
    move: "position of robots",
    turn: "heading of robots",
    slow_down: "max_speed of robots",
    cool: "temperature of robots",
    write_column: "heading of robots",
    take_out: "set of robots, obstacles or fires",
    add_robots: "set of robots, obstacles or fires",
    add_obstacle: "set of robots, obstacles or fires",
    add_fire: "set of robots, obstacles or fires",
    feed_fire: "temperature of fires",
    put_out: "set of robots, obstacles or fires",
    change_constants: "fire_constants",
    spoil: "imperfect",
    replace_control: "control",
    talk: "channel",
    reach_farther: "extinguish_range",
}


def recorded(path, change, **how):
    """Record a run that is changed by hand in its middle; return the fingerprints of its steps as well."""
    model, hashes = FireFighting(n_robots=6, strategy="A", rng=3), {}
    with model.record(path, **how):
        for step in range(1, LAST + 1):
            model.step()
            hashes[step] = model.state_hash()
            if step == HAND:
                change(model)
    return Recording(path), hashes


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_a_run_that_was_changed_by_hand_resumes_at_any_step_and_is_verified(change, tmp_path):
    recording, hashes = recorded(tmp_path / "run.arrow", change)
    (intervention,) = recording.interventions
    assert (intervention.step, intervention.checkpoint, recording.checkpoints) == (HAND, 1, (0, HAND))
    assert CHANGES[change] in intervention.what
    for step in (HAND - 1, HAND, HAND + 1, LAST - 1):
        again = SwarmModel.resume(recording.path, step=step)
        assert (again.steps, again.completed) == (step, step)
        assert step == HAND or again.state_hash() == hashes[step]
        for later in range(step + 1, LAST + 1):
            again.step()
            if step >= HAND:
                assert again.state_hash() == hashes[later]
    verification = verify(recording, FireFighting)
    assert verification.same
    assert verification.interventions == (intervention,)
    assert f"all {LAST} rows to step {LAST} are the same; changed by hand: " in str(verification)
    assert f"after step {HAND}" in str(verification)


def test_reading_a_model_is_not_an_intervention(tmp_path):
    model = FireFighting(n_robots=4, rng=1)
    with model.record(tmp_path / "run.arrow"):
        for _ in range(10):
            model.step()
            model.sense()
            model.state_hash()
            model.watch()
            assert len(model.robots) == 4
            assert model.contacts is not None
            assert repr(model)
    assert Recording(tmp_path / "run.arrow").interventions == ()


class Renewing(FireFighting):
    """A model that replaces a fire by another one after every seventh step."""

    def step(self):
        super().step()
        if self.steps % 7 == 0:
            self.fires[0].remove()
            self.add_fire((200, 200), radius=20)


def test_the_same_with_other_observers_and_a_class_that_does_more_after_the_step(tmp_path):
    model = Renewing(rng=2)
    with model.record(tmp_path / "run.arrow"):
        model.run(30)
    recording = Recording(tmp_path / "run.arrow")
    assert recording.interventions == ()
    assert len(recording.changes) == 4
    assert verify(recording, Renewing).same


def test_a_verdict_names_the_first_manual_changes_and_counts_the_others():
    changed = [Intervention(step=step, what=("control", "running")) for step in range(1, 8)]
    assert as_remark([]) == ""
    assert as_remark(changed[:1]).endswith("control and running after step 1 (continued from the stored state)")
    assert as_remark(changed).endswith("after step 5, and more after 2 other steps (continued from the stored states)")


def test_an_attribute_that_is_set_to_the_value_that_it_had_is_detected_too(tmp_path):
    model = FireFighting(n_robots=3, rng=1)
    detector = ChangeDetector(model.run(3))
    model.robots[0].heading = model.robots[0].heading
    assert detector.changes(model) == ["an attribute set to the value that it had"]


def test_a_load_that_is_moved_is_detected():
    model = CooperativeTransport(n_robots=3, load="box", rng=2)
    detector = ChangeDetector(model.run(2))
    model.loads[0].move_to((400.0, 200.0, 0.5))
    assert detector.changes(model) == ["pose or resistance of loads"]


def test_an_attribute_that_is_added_or_deleted_is_detected():
    model = FireFighting(n_robots=3, rng=1)
    model.old = 1
    detector = ChangeDetector(model)
    del model.old
    model.new = 2
    assert detector.changes(model) == ["old", "new"]


def test_a_change_before_the_first_step_is_stored(tmp_path):
    model = FireFighting(n_robots=3, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.add_robots(AGENT9, 2)
        model.run(5)
    recording = Recording(tmp_path / "run.arrow")
    assert [one.step for one in recording.interventions] == [0]
    assert list(recording.changes) == [1]
    assert verify(recording, FireFighting).same
    assert len(SwarmModel.resume(recording.path, step=0).robots) == 5
    assert SwarmModel.resume(recording.path, step=2).run(3).state_hash() == model.state_hash()


def test_changes_at_each_step_are_all_stored(tmp_path):
    model = FireFighting(n_robots=3, rng=1)
    with model.record(tmp_path / "run.arrow"):
        for step in range(8):
            model.step()
            model.robots[step % 3].heading = 0.1 * step
    recording = Recording(tmp_path / "run.arrow")
    assert [one.step for one in recording.interventions] == list(range(1, 8))
    verification = verify(recording, FireFighting)
    assert verification.same
    assert "heading of robots after step 5, and more after 2 other steps (continued" in str(verification)
    assert SwarmModel.resume(recording.path, step=3).completed == 3


def test_a_run_that_all_robots_left_is_verified_and_resumes(tmp_path):
    model = FireFighting(n_robots=3, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
        model.remove_robots(list(model.robots))
        model.run(3)
    verification = verify(Recording(tmp_path / "run.arrow"), FireFighting)
    assert (verification.same, verification.rows) == (True, 6)
    assert FireFighting.resume(tmp_path / "run.arrow", step=5).run(1).state_hash() == model.state_hash()


def test_each_stored_state_is_read_once(tmp_path, monkeypatch):
    model, places, read = FireFighting(n_robots=3, rng=1), [], Recording.checkpoint
    with model.record(tmp_path / "run.arrow"):
        for _ in range(6):
            model.robots[0].heading += 0.1
            model.step()
    monkeypatch.setattr(Recording, "checkpoint", lambda self, place: places.append(place) or read(self, place))
    assert verify(Recording(tmp_path / "run.arrow"), FireFighting).same
    assert places == list(range(7))


def test_without_checkpoints_a_verdict_names_the_step_after_which_the_run_cannot_be_repeated(tmp_path):
    recording, _ = recorded(tmp_path / "run.arrow", turn, checkpoint_every=0)
    verification = verify(recording, FireFighting)
    assert (verification.same, verification.step, verification.rows) == (False, HAND + 1, HAND)
    assert str(verification) == (
        f"step {HAND + 1} is the first that cannot be compared: after step {HAND}, changed by hand: heading of robots; "
        "the state then was not stored (checkpoint_every is 0)"
    )
    with pytest.raises(RecordingError, match=f"not stored .*; the nearest steps to resume from are {HAND}$"):
        SwarmModel.resume(recording.path, step=HAND + 3)
    assert SwarmModel.resume(recording.path, step=HAND).completed == HAND


def test_a_value_that_cannot_be_stored_is_named(tmp_path):
    def befriend(model):
        model.friend = object()

    recording, _ = recorded(tmp_path / "run.arrow", befriend)
    (intervention,) = recording.interventions
    assert intervention.what == ("friend",)
    assert intervention.why_not.startswith("friend is <object")
    assert "not stored (friend is <object" in str(verify(recording, FireFighting))


def test_a_later_checkpoint_is_not_taken_for_the_state_after_what_could_not_be_stored(tmp_path):
    class Forgetful(FireFighting):
        def step(self):
            super().step()
            self.friend = None

    path, model = tmp_path / "run.arrow", Forgetful(n_robots=6, rng=3)
    with model.record(path, checkpoint_every=5):
        model.run(4)
        model.friend = object()
        model.run(8)
    recording = Recording(path)
    (intervention,) = recording.interventions
    assert (intervention.step, intervention.checkpoint, recording.checkpoints) == (4, None, (0, 9))
    assert intervention.why_not.startswith("friend is <object")
    assert "step 5 is the first that cannot be compared: after step 4, changed" in str(verify(recording, Forgetful))
    assert Forgetful.resume(path).state_hash() == model.state_hash()
    with pytest.raises(RecordingError, match=r"the nearest steps to resume from are 4 and 9$"):
        Forgetful.resume(path, step=7)


def test_what_was_computed_is_still_compared_after_an_intervention(tmp_path):
    with other_code(15, lambda model: setattr(model.robots[2], "heading", 1.0)):
        recording, _ = recorded(tmp_path / "run.arrow", turn)
    verification = verify(recording, FireFighting)
    assert (verification.same, verification.step) == (False, 16)
    assert "step 16 is the first that differs" in str(verification)
    assert "after step 12" in str(verification)


def test_a_damaged_intervention_is_no_surprise(tmp_path):
    recording, _ = recorded(tmp_path / "run.arrow", turn)
    content = bytearray(recording.path.read_bytes())
    place = content.index(b"\0intervention\0")
    content[place + 20] ^= 1
    recording.path.write_bytes(content)
    with pytest.raises(RecordingError, match="is damaged"):
        verify(Recording(recording.path), FireFighting)


def test_a_design_with_more_sensors_than_the_file_has_room_for_is_still_refused(tmp_path):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, 2)
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
        model.add_robots(AGENT9, 1)
        with pytest.raises(RecordingError, match="add robots of all designs before"):
            model.step()
    assert len(Recording(tmp_path / "run.arrow")) == 3


def test_the_command_line_names_manual_changes(tmp_path, capsys):
    recorded(tmp_path / "run.arrow", turn)
    with pytest.raises(SystemExit) as ended:
        main(["verify", str(tmp_path / "run.arrow"), "--quiet"])
    assert ended.value.code == 0
    assert (
        "changed by hand: heading of robots after step 12 (continued from the stored state)" in capsys.readouterr().out
    )


def test_readings_of_a_row_are_those_of_its_own_poses(tmp_path):
    model, seen = FireFighting(n_robots=12, rng=3), []
    with model.record(tmp_path / "run.arrow", exact=True):
        for _ in range(40):
            model.step()
            model.sense()
            seen.append(model.swarm.distance.copy())
    assert np.array_equal(Recording(tmp_path / "run.arrow")["distance"], seen)
