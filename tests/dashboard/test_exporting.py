"""Export from the page: the run repeated or its recording, in the background, within limits."""

import io
import threading

import numpy as np
import pandas as pd
import pytest

from mesa_swarm.base.errors import InvalidValueError, RecordingError, UnknownNameError
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.run import exporting as module
from mesa_swarm.dashboard.run.exporting import ExportDesk, Exporter, Exporting, ExportRequest, RecordingSwitch
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from support.waiting import wait_until

PNG = b"\x89PNG"


@pytest.fixture
def desk():
    """An exporting of a session after 30 steps; its files are in `made`, which `take_all` puts there."""
    session = Session("fire_fighting", steps=30)
    made = {}

    exporting = session.companion(Exporting)

    def take_all():
        for name, content in exporting.take_files():
            made[name] = content if isinstance(content, bytes) else content.read_bytes()

    exporting.changed.add(take_all)
    exporting.take_all = take_all
    exporting.made = made
    yield exporting
    session.close()
    assert not exporting.folder.exists()


def make(desk, **wanted) -> None:
    desk.start(**wanted)
    wait_until(lambda: not desk.doing)


def recording_of(content: bytes, folder) -> Recording:
    path = folder / "run.arrow"
    path.write_bytes(content)
    return Recording(path)


def test_the_run_so_far_is_exported_without_the_switch(desk, tmp_path):
    make(desk, kind="arrow")
    assert (desk.fault, desk.message) == ("", "fire_fighting.arrow is ready.")
    recording = recording_of(desk.made["fire_fighting.arrow"], tmp_path)
    model = FireFighting(rng=1).run(30)
    assert len(recording) == 30
    assert np.allclose(recording.at(30)["position"], model.swarm.position, atol=1e-4)


def test_pictures_are_of_the_step_that_is_looked_at(desk):
    make(desk, kind="png")
    desk.session.step()
    desk.session.look(0)
    make(desk, kind="svg")
    assert desk.made["fire_fighting_30.png"].startswith(PNG)
    assert b"<svg" in desk.made["fire_fighting_30.svg"]


@pytest.mark.slow
def test_a_page_that_runs_the_model_begins_with_the_settings_of_the_run():
    session, made = Session("fire_fighting", {"n_robots": 4}, steps=3), {}
    exporting = session.companion(Exporting)
    exporting.changed.add(lambda: made.update(exporting.take_files()))
    make(exporting, kind="live")
    assert (exporting.fault, exporting.message) == ("", "fire_fighting.html is ready.")
    page = made["fire_fighting.html"].read_text(encoding="utf-8")
    session.close()
    assert '"robots":4,' in page
    assert "LiveModel" in page


@pytest.mark.slow
def test_a_model_that_cannot_run_on_a_page_is_refused_beside_the_button():
    session = Session("collision_avoidance", {"moving_obstacles": 2}, steps=3)
    exporting = session.companion(Exporting)
    make(exporting, kind="live")
    assert exporting.fault.startswith("CollisionAvoidance cannot run on a page: Wander takes place")
    session.close()


@pytest.mark.slow
def test_a_table_is_made_by_a_process_of_its_own(desk):
    make(desk, kind="fires.csv", every=10)
    assert desk.fault == ""
    table = pd.read_csv(io.BytesIO(desk.made["fire_fighting_fires.csv"]))
    assert table.iloc[:, 0].unique().tolist() == [10, 20, 30]
    assert len(table) == 21


def test_a_run_that_was_changed_is_exported_from_its_recording_only(desk, tmp_path):
    session = desk.session
    desk.record(True)
    session.step()
    with session.lock:
        session.model.robots[0].heading = 1.0
        session.straight = False
    session.step()
    make(desk, kind="arrow")
    assert "changed while running" in desk.fault
    make(desk, kind="arrow", source="recording")
    assert desk.fault == ""
    assert recording_of(desk.made["fire_fighting.arrow"], tmp_path).steps.tolist() == [31, 32]
    session.step()
    assert desk.switch.words == "steps 31 to 33"


def test_what_was_recorded_stays_after_a_reset_and_the_switch_is_off(desk, tmp_path):
    desk.record(True)
    desk.session.step()
    desk.session.reset()
    desk.check_recording()
    desk.session.step()
    assert (desk.switch.running, desk.switch.words) == (False, "steps 31 to 31")
    make(desk, kind="arrow", source="recording")
    assert len(recording_of(desk.made["fire_fighting.arrow"], tmp_path)) == 1


@pytest.mark.slow
def test_a_recording_ends_at_its_limit_with_a_message(tmp_path):
    switch, model = RecordingSwitch(tmp_path, most_bytes=20_000), FireFighting(rng=1)
    switch.start(model)
    while switch.running:
        model.run(50)
    assert switch.ended == f"the recording has 0 MB, which is the limit; it ended at step {switch.last:,}"
    model.run(50)
    assert Recording(switch.path).steps.tolist() == list(range(1, switch.last + 1))


def test_a_recording_that_ends_at_its_limit_has_whole_steps_only(tmp_path, monkeypatch):
    class More(FireFighting):
        def step(self):
            super().step()
            self.robots[0].heading += 0.1

    monkeypatch.setattr("mesa_swarm.dashboard.run.exporting.LOOK_EVERY", 3)
    switch, model = RecordingSwitch(tmp_path, most_bytes=1), More(n_robots=3, rng=1)
    switch.start(model)
    model.run(3)
    assert (switch.running, switch.last) == (False, 3)
    assert Recording(switch.path).at(3)["heading"][0] == np.float32(model.robots[0].heading)


def test_a_recording_that_cannot_replace_the_one_before_leaves_it_and_its_steps(tmp_path, monkeypatch):
    switch, model = RecordingSwitch(tmp_path), FireFighting(n_robots=3, rng=1)
    switch.start(model)
    model.run(20)
    switch.stop()
    before = switch.path.read_bytes()
    monkeypatch.setattr("mesa_swarm.recording.sealed_stream.put_in_place", _full)
    switch.start(model)
    for _ in range(5):
        model.step()
    assert switch.path.read_bytes() == before
    with pytest.raises(RecordingError, match="is untouched"):
        switch.stop()
    assert switch.path.read_bytes() == before
    assert switch.words == "steps 1 to 20"
    assert [path.name for path in tmp_path.iterdir()] == ["recorded.arrow"]


def test_a_recording_that_failed_in_the_last_step_claims_no_more_steps_than_it_has(tmp_path, monkeypatch):
    switch, model = RecordingSwitch(tmp_path), FireFighting(n_robots=3, rng=1)
    switch.start(model)
    model.run(20)
    model.step()
    monkeypatch.setattr("mesa_swarm.recording.sealed_stream.SealedWriter.write", _full)
    with pytest.raises(OSError, match="No space"):
        switch._recorder.flush()
    switch.stop()
    assert switch.words == "steps 1 to 20"
    assert len(Recording(switch.path)) == 20


def _full(*_):
    raise OSError(28, "No space left on device")


def test_a_large_recording_that_is_about_to_be_replaced_does_not_end_the_new_one(tmp_path):
    switch, model = RecordingSwitch(tmp_path, most_bytes=100_000), FireFighting(n_robots=3, rng=1)
    switch.path.write_bytes(bytes(200_000))
    switch.start(model)
    for _ in range(50):
        model.step()
    assert switch.running
    switch.stop()
    assert len(Recording(switch.path)) == 50


def test_recording_does_not_change_a_run(desk):
    desk.record(True)
    for _ in range(10):
        desk.session.step()
    assert desk.session.model.state_hash() == FireFighting(rng=1).run(40).state_hash()


def test_it_is_cancelled_and_the_next_one_is_made(desk, monkeypatch):
    monkeypatch.setattr(module, "TURN", 1e-9)
    desk.session.reset(steps=600)
    desk.start(kind="gif")
    wait_until(lambda: desk.progress)
    assert 0 < desk.progress <= 1
    desk.start(kind="png")
    assert "an export is in progress" in desk.fault
    desk.cancel()
    wait_until(lambda: not desk.doing)
    assert (desk.message, desk.made) == ("Cancelled.", {})
    make(desk, kind="png")
    assert list(desk.made) == ["fire_fighting_600.png"]


@pytest.mark.slow
def test_a_process_is_cancelled(desk):
    desk.start(kind="gif")
    wait_until(lambda: desk._process is not None)
    desk.cancel()
    wait_until(lambda: not desk.doing)
    assert (desk.message, desk.fault, desk.made) == ("Cancelled.", "", {})


@pytest.mark.parametrize(
    ("limit", "value", "wanted", "fault"),
    [
        ("MOST_ROWS", 299, {"kind": "robots.csv"}, "the table would have 300 rows; expected at most 299"),
        ("LARGEST_DOWNLOAD", 10, {"kind": "arrow"}, "expected at most 500 MB"),
        ("MOST_BYTES", 10, {"kind": "arrow"}, "the run needs more than 0 MB"),
    ],
)
def test_limits_are_reported_in_a_message(desk, monkeypatch, limit, value, wanted, fault):
    monkeypatch.setattr(module, "TURN", -1.0 if limit == "MOST_BYTES" else 1.0)
    monkeypatch.setattr(module.time, "sleep", lambda _: None)
    monkeypatch.setattr(module, limit, value)
    desk.start(**wanted)
    desk._thread.join(30)
    assert fault in desk.fault
    assert desk.made == {}


def test_before_the_first_step_there_is_nothing_to_export_but_a_picture(desk):
    desk.session.reset()
    make(desk, kind="html")
    assert "the run has no steps yet" in desk.fault
    make(desk, kind="html", source="recording")
    assert "no steps are recorded" in desk.fault
    make(desk, kind="png")
    assert desk.made["fire_fighting_0.png"].startswith(PNG)


def test_a_file_can_be_wanted_while_the_page_is_still_notified_that_the_one_before_is_ready(desk):
    notified, go_on = threading.Event(), threading.Event()

    def notify():
        if not desk.doing and "30.png" in desk.message:
            notified.set()
            go_on.wait(30)

    leave = desk.changed.add(notify)
    desk.start(kind="png")
    first = desk._thread
    assert notified.wait(30)
    assert first.is_alive()
    leave()
    make(desk, kind="svg")
    assert desk.fault == ""
    assert b"<svg" in desk.made["fire_fighting_30.svg"]
    go_on.set()
    first.join(30)


@pytest.mark.slow
def test_an_error_of_the_command_is_shown(desk, monkeypatch):
    monkeypatch.setattr(ExportRequest, "options", lambda self: ["--table", "robbots"])
    make(desk, kind="robots.csv")
    assert "unknown recorded table 'robbots'" in desk.fault
    assert not desk.fault.startswith("mesa-swarm")


def test_constants_that_were_set_before_the_first_step_are_in_the_run_that_is_made_again(desk, tmp_path):
    session = desk.session
    session.reset()
    session.set_parameter("k1", 0.002)
    for _ in range(5):
        session.step()
    make(desk, kind="arrow")
    assert desk.fault == ""


def test_what_was_made_while_another_page_was_shown_is_handed_over_when_one_comes_back(desk):
    desk.changed.clear()
    desk.record(True)
    make(desk, kind="png")
    assert desk.made == {}
    desk.session.step()
    desk.take_all()
    assert list(desk.made) == ["fire_fighting_30.png"]
    assert desk.switch.words == "steps 31 to 31"


def test_wrong_requests_are_refused():
    with pytest.raises(UnknownNameError):
        ExportRequest(kind="exe")
    with pytest.raises(UnknownNameError):
        ExportRequest(kind="png", source="moon")
    with pytest.raises(InvalidValueError):
        ExportRequest(kind="robots.csv", every=0)
    assert ExportRequest(kind="mp4", trails=True, sectors=True).options() == ["--sectors", "--trails", "60"]


def test_the_page_receives_the_status():
    session, exporter = Session("boids"), Exporter()
    sent = []
    exporter.send = lambda content, buffers=(): sent.append(content)
    desk = ExportDesk(exporter, session)
    assert [kind for kind, _, _ in exporter.kinds if "fires" in kind] == []
    assert (exporter.status["steps"], exporter.status["recording"]) == (0, False)
    desk.act({"do": "record", "value": True})
    session.step()
    assert (exporter.status["steps"], exporter.status["recorded"]) == (1, "steps 1 to 1")
    desk.act({"do": "export", "value": {"kind": "png"}})
    wait_until(lambda: exporter.status["message"])
    assert sent[-1]["name"] == "boids_1.png"
    desk.act({"do": "record", "value": False})
    assert not exporter.status["recording"]
    session.choose("fire_fighting")
    assert any("fires" in kind for kind, _, _ in exporter.kinds)
    desk.close()
    assert desk.exporting.folder.exists(), "another page of the session may show it again"
    session.close()
    assert not desk.exporting.folder.exists()
