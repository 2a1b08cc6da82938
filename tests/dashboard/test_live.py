"""Parameters of a session that change while it runs."""

import pytest

from mesa_swarm.base.errors import RecordingError, SwarmError
from mesa_swarm.dashboard.page.controls import ControlPanel, Panel
from mesa_swarm.dashboard.page.edits import LiveRun
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.run.exporting import Exporting
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.model.parameters import Slider, parameters_of
from mesa_swarm.recording import Recording


def played(name, steps=8, **settings):
    session = Session(name, settings)
    for _ in range(steps):
        session.step()
    return session


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_the_number_of_robots_of_every_model_changes_while_it_runs(name):
    session = played(name)
    before, completed = len(session.model.robots), session.model.completed
    for wanted in (before - 2, before - 1) if before > 3 else (before + 2, before + 1):
        session.set_parameter("n_robots", wanted)
        assert session.faults == {}
        assert len(session.model.robots) == wanted
        session.step()
        assert session.error == ""
    assert session.waiting == frozenset()
    assert session.model.completed == completed + 2


def test_a_parameter_changes_at_once_and_its_neighbours_stay():
    session = played("boids")
    session.set_parameter("sight", 70.0)
    session.set_parameter("n_robots", 20)
    session.set_parameter("noise", 0.2)
    assert len(session.model.robots) == 20
    assert (session.built["sight"], session.built["noise"]) == (70.0, 0.2)
    assert session.model.completed == session.past.last_step == 8
    assert len(session.series) == 8
    session.step()
    assert len(session.series) == 9


def test_what_belongs_to_the_beginning_waits_for_apply():
    session = played("fire_fighting")
    session.set_parameters({"initial_temperature": 0.5, "noise": 0.1})
    assert session.waiting == {"initial_temperature"}
    session.reset()
    assert session.waiting == frozenset()
    assert session.model.fires[0].temperature == 0.5


def test_before_the_first_step_every_change_builds_the_model_anew():
    session = Session("fire_fighting")
    session.set_parameter("initial_temperature", 0.5)
    assert session.waiting == frozenset()
    assert session.model.fires[0].temperature == 0.5
    assert session.edits == ()


def test_a_value_with_which_no_model_can_be_made_is_refused_and_the_run_goes_on():
    session = played("fire_fighting")
    session.set_parameter("join", 200.0)
    assert "expected join below leave" in session.faults["join"]
    session.set_parameter("n_robots", 5000)
    assert "n_robots" in session.faults
    for name in ("join", "n_robots"):
        assert session.settings[name] == session.built[name]
    session.step()
    assert session.error == ""


def test_a_recording_goes_on_while_parameters_change(tmp_path):
    session = played("boids")
    exporting = session.companion(Exporting)
    exporting.record(True)
    session.step()
    session.set_parameter("noise", 0.2)
    session.set_parameter("n_robots", 30)
    exporting.check_recording()
    assert exporting.switch.running
    session.step()
    exporting.switch.copy(tmp_path / "copy.arrow")
    exporting.record(False)
    recording = Recording(tmp_path / "copy.arrow")
    assert len(recording) == 2
    assert [one.step for one in recording.interventions] == [9]
    session.close()


def test_settings_that_wait_are_marked_and_light_up_the_reset_button():
    session = played("fire_fighting")
    panel = Panel(ControlPanel(), session)
    session.set_parameter("initial_temperature", 0.5)
    assert panel.widget.values["initial_temperature"]["waits"]
    assert not panel.widget.values["noise"]["waits"]
    panel.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_all_defaults_are_taken_back_while_it_runs(name):
    session = played(name)
    known = parameters_of(find_model(name)).values()
    slider = next(one for one in known if isinstance(one.control, Slider) and one.name != "n_robots")
    session.set_parameter(slider.name, slider.kind(slider.control.maximum))
    session.set_defaults()
    assert session.settings == {key: one.default for key, one in session.parameters.items()}
    session.step()
    assert session.error == ""


@pytest.mark.parametrize("values", [{"noise": 0.2, "n_robots": 5000}, {"k1": 0.001, "n_robots": 9000, "slip": 0.1}])
def test_of_several_values_none_is_applied_if_one_is_refused(values):
    session = played("fire_fighting")
    model, before = session.model, session.model.state_hash()
    with pytest.raises(SwarmError):
        session.set_parameters(values)
    assert session.run.model is session.model is model
    assert (session.model.state_hash(), session.edits) == (before, ())
    session.step()
    assert len(session.series) == 9


def test_values_that_only_fit_together_wait_if_they_cannot_all_change_now():
    session = played("fire_fighting")
    session.set_parameters({"leave": 5.0, "join": 2.0, "initial_temperature": 0.5})
    assert "initial_temperature" in session.waiting
    assert session.run.model is session.model
    session.step()
    assert session.error == ""


def test_a_change_of_a_model_that_cannot_be_stored_is_not_undone_with_an_earlier_one(monkeypatch):
    session = played("boids", n_robots=2)
    session.edit("obstacle", 100, 100, 20)

    def refuse(run):
        raise RecordingError("a custom part cannot be stored")

    monkeypatch.setattr(LiveRun, "store", refuse)
    session.edit("obstacle", 200, 100, 20)
    assert session.undoable is None


def test_a_change_that_leaves_the_world_as_it_was_makes_browsers_enter_no_other():
    session = played("boids")
    session.step()
    before = session.past.shown
    session.set_parameter("noise", 0.3)
    after = session.past.shown
    assert session.built["noise"] == 0.3
    assert after is not before
    assert after.world is before.world
    session.edit("obstacle", 300.0, 300.0, 10.0)
    assert session.past.shown.world is not before.world


def test_the_canvas_receives_pictures_before_the_panels():
    session, received = played("boids"), []

    class Panel:
        ready = False

        def push(self, number, frame):
            received.append("panel")

    class Canvas(Panel):
        def push(self, number, frame):
            received.append("canvas")

    session.add_viewer(Panel())
    session.add_viewer(Canvas(), first=True)
    del received[:]
    session.step()
    assert received == ["canvas", "panel"]
