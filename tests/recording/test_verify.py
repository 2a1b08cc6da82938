import pytest

from mesa_swarm import SwarmModel, disc
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.cli import main
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.fire import FireConstants
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.sealed_stream import SealedReader
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.robots.radio import Radio
from support.other_code import other_code


class Own(SwarmModel):
    """A custom model, whose constructor takes a function."""

    def __init__(self, *, map, n=3, constants=None, radio=None, rng=None):
        super().__init__(map=map, rng=rng, fire_constants=constants, communication=radio)
        self.add_robots(AGENT9, n)
        self.control = Subsumption(Avoid(distance=15), Explore())


def recorded(model, path, steps=30, **how):
    with model.record(path, **how):
        model.run(steps)
    return Recording(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", model_names())
def test_every_model_runs_again_as_it_was_recorded(name, tmp_path):
    model_class = find_model(name)
    verification = verify(recorded(model_class(rng=1), tmp_path / "run.arrow", 110), model_class)
    assert verification.same
    assert str(verification) == "all 110 rows to step 110 are the same"


def test_a_recording_that_begins_late_runs_again(tmp_path):
    recording = recorded(FireFighting(rng=1).run(33), tmp_path / "run.arrow", every=7)
    assert verify(recording, FireFighting).same


def test_a_run_without_a_seed_runs_again(tmp_path):
    assert verify(recorded(FireFighting(), tmp_path / "run.arrow"), FireFighting).same


def test_maps_constants_and_radios_are_recorded_whole(tmp_path):
    hall = Map(name="hall", bounds=(0, 0, 300, 200), obstacles=[disc((150, 100), 20.125)])
    model = Own(map=hall, constants=FireConstants(0.001, 0.02, 0.08, 0.25, 250, 150), radio=Radio(range=77), rng=3)
    assert verify(recorded(model, tmp_path / "run.arrow"), Own).same


def test_the_first_step_and_robot_that_differ_are_named(tmp_path):
    model = FireFighting(n_robots=8, rng=1)
    with other_code(20, lambda model: setattr(model.robots[5], "heading", 0.123)), model.record(tmp_path / "run.arrow"):
        model.run(40)
    verification = verify(Recording(tmp_path / "run.arrow"), FireFighting)
    assert not verification.same
    assert (verification.step, verification.rows) == (21, 20)
    assert verification.robots == (model.robots[5].unique_id,)
    assert str(verification).startswith("step 21 is the first that differs: ")


def test_what_differs_but_was_not_recorded_is_found_by_the_fingerprint(tmp_path):
    model = FireFighting(n_robots=3, rng=1)
    with (
        other_code(20, lambda model: setattr(model.fires[0], "temperature", 0.5)),
        model.record(tmp_path / "run.arrow", columns=("layer",)),
    ):
        model.run(110)
    verification = verify(Recording(tmp_path / "run.arrow"), FireFighting)
    assert (verification.same, verification.step, verification.robots) == (False, 100, ())
    assert "not recorded" in str(verification)


def test_a_model_that_was_changed_by_hand_before_and_not_stored_is_refused_in_words(tmp_path):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 3)
    with pytest.raises(RecordingError, match="changed by hand"):
        verify(recorded(model, tmp_path / "run.arrow", checkpoint_every=0), SwarmModel)


def test_another_class_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"FireFighting, not of .*CooperativeTransport"):
        verify(recorded(FireFighting(rng=1), tmp_path / "run.arrow"), CooperativeTransport)


def test_what_was_recorded_with_rerun_false_is_not_run_again(tmp_path):
    with pytest.raises(RecordingError, match="rerun=False"):
        verify(recorded(FireFighting(rng=1), tmp_path / "run.arrow", rerun=False), FireFighting)


def status_of(*words):
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, words)))
    return ended.value.code


def test_the_command_line_records_and_verifies(tmp_path, capsys):
    path = tmp_path / "run.arrow"
    typed = ("run", "fire_fighting", "--steps", 20, "--quiet", "--record", path)
    assert status_of(*typed) == 0
    assert status_of("verify", path, "--quiet") == 0
    assert "all 20 rows to step 20 are the same" in capsys.readouterr().out
    assert status_of(*typed) == 2
    assert "exists already" in capsys.readouterr().err
    assert status_of(*typed, "--force") == 0


def test_the_command_line_exits_with_1_if_a_recording_differs(tmp_path, capsys):
    model = FireFighting(rng=1)
    with other_code(5, lambda model: setattr(model.robots[0], "heading", 1.0)), model.record(tmp_path / "run.arrow"):
        model.run(10)
    assert status_of("verify", tmp_path / "run.arrow", "--quiet") == 1
    assert "step 6 is the first that differs" in capsys.readouterr().out


def test_the_command_line_looks_up_no_class_but_its_own(tmp_path, capsys):
    recorded(Own(map="sparse", rng=1), tmp_path / "run.arrow")
    assert status_of("verify", tmp_path / "run.arrow", "--quiet") == 2
    assert "is not part of mesa_swarm" in capsys.readouterr().err


def test_ctrl_c_on_the_command_line_keeps_what_was_recorded(tmp_path, capsys, monkeypatch):
    step = FireFighting.step

    def interrupted(self):
        step(self)
        if self.steps == 12:
            raise KeyboardInterrupt

    monkeypatch.setattr(FireFighting, "step", interrupted)
    path = tmp_path / "run.arrow"
    assert status_of("run", "fire_fighting", "--quiet", "--record", path) == 130
    assert f"12 steps are recorded in {path}" in capsys.readouterr().out
    assert Recording(path).complete
    assert len(Recording(path)) == 12


@pytest.mark.slow
def test_verify_compares_what_is_whole_of_a_damaged_recording_and_ends_with_status_1(recorded_run, tmp_path, capsys):
    content = recorded_run.read_bytes()
    path = tmp_path / "run.arrow"
    for place in damaged_places(recorded_run):
        path.write_bytes(content[:place] + bytes([content[place] ^ 4]) + content[place + 1 :])
        assert status_of("verify", path, "--quiet") == 1
        assert capsys.readouterr().out == (
            f"all 256 rows to step 256 are the same; {path} is damaged after step 256: "
            "256 rows are whole, the rest is not read\n"
        )


def damaged_places(path):
    """Return a place among the rows of the second chunk, and one in how long it is."""
    second = SealedReader(path).pieces[1]
    return (second.batch + second.seal) // 2, second.batch + 5


@pytest.mark.slow
def test_verify_compares_the_whole_rows_of_a_recording_that_was_not_closed(recorded_run, tmp_path, capsys):
    path = tmp_path / "run.arrow"
    path.write_bytes(recorded_run.read_bytes()[:-200])
    assert status_of("verify", path, "--quiet") == 0
    assert "run.arrow was not closed: 512 rows are whole, " in capsys.readouterr().out


def test_a_damaged_state_is_reported_though_all_rows_are_whole(recorded_run, tmp_path):
    content, state = recorded_run.read_bytes(), SealedReader(recorded_run).attached[0]
    place, path = (state.batch + state.seal) // 2, tmp_path / "run.arrow"
    path.write_bytes(content[:place] + bytes([content[place] ^ 4]) + content[place + 1 :])
    verification = verify(Recording(path), FireFighting)
    assert not verification.same
    assert verification.text.endswith("is damaged at the piece of step 0: 600 rows are whole")


@pytest.mark.slow
def test_a_recording_is_verified_by_its_path_and_by_any_class_above_its_model(recorded):
    verdicts = [
        verify(str(recorded), FireFighting),
        verify(Recording(recorded), FireFighting),
        FireFighting.verify(recorded),
        SwarmModel.verify(recorded),
    ]
    assert {str(verdict) for verdict in verdicts} == {"all 600 rows to step 600 are the same"}


def test_what_is_no_recording_is_refused_in_one_line():
    with pytest.raises(RecordingError, match="path is 3; expected the name of a recording"):
        verify(3, FireFighting)


def test_a_model_that_was_built_by_hand_is_verified_from_the_state_with_which_it_began(tmp_path):
    model = SwarmModel(map="openspace_fire", rng=3)
    model.add_robots(AGENT9, 4)
    model.control = Subsumption(Avoid(distance=15), Explore())
    with model.record(tmp_path / "run.arrow"):
        model.run(30)
        model.robots[0].position = (400, 300)
        model.run(30)
    verdict = SwarmModel.verify(tmp_path / "run.arrow")
    assert verdict.same
    assert len(verdict.interventions) == 1
    assert verdict.text == "all 60 rows to step 60 are the same, from the stored state of step 0"
