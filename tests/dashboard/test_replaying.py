"""A recording that is played, handed over, searched for events, and left for a run that goes on."""

import os
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.dashboard import RECORDINGS_VARIABLE
from mesa_swarm.dashboard.page.controls import ControlPanel
from mesa_swarm.dashboard.page.series import RecordedSeries
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import FilePicker, Incoming
from mesa_swarm.dashboard.replay.replay_view import BranchPanel, Upload
from mesa_swarm.dashboard.replay.replaying import LARGEST_RECORDING, Replaying, ReplayPlayer
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES, BREATH
from support.clock import Clock
from support.disks import small_disk
from support.forging import changed, put_together, taken_apart
from support.waiting import threads, wait_until

STEPS = 120


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with recordings, one of each kind that matters here."""
    place = tmp_path_factory.mktemp("recordings")
    model = FireFighting(strategy="A", initial_temperature=0.02, rng=4)
    with model.record(place / "fires.arrow"):
        model.run(STEPS)
    own = SwarmModel(rng=1)
    own.add_robots(AGENT9, 3)
    with own.record(place / "own.arrow", every=10):
        own.run(100)
    boids = Boids(n_robots=5, rng=1)
    with boids.record(place / "boids.arrow"):
        boids.run(3)
    (place / "text.arrow").write_text("not a recording at all")
    other = Boids(n_robots=3, rng=2)
    with other.record(place / "evening run"):
        other.run(2)
    return place


@pytest.fixture
def replaying(folder, monkeypatch):
    monkeypatch.setenv(RECORDINGS_VARIABLE, str(folder))
    session = Session("boids")
    yield session.companion(Replaying)
    session.close()


def opened(replaying: Replaying, name: str = "fires.arrow") -> ReplayPlayer:
    replaying.open_listed(name)
    assert replaying.fault == ""
    wait_until(lambda: replaying.events is not None)
    return replaying.player


def hand_over(replaying: Replaying, name: str, content: bytes, piece: int = 100_000) -> None:
    assert replaying.begin_upload(name, len(content))
    for begin in range(0, len(content), piece):
        assert replaying.take(content[begin : begin + piece])
    replaying.end_upload()


def test_a_recording_is_stepped_scrubbed_and_rewound(folder):
    player = ReplayPlayer(folder / "fires.arrow")
    assert (len(player.past), player.step_shown) == (STEPS, 1)
    player.step()
    player.step()
    player.back()
    assert player.step_shown == 2
    player.look(10_000)
    assert (player.step_shown, player.finished) == (STEPS, True)
    player.step()
    assert player.step_shown == STEPS
    player.look_at(57)
    assert (player.step_shown, player.past.shown.step) == (57, 57)
    player.rewind()
    assert player.step_shown == 1
    player.close()


def test_what_is_shown_is_what_the_model_was(folder):
    player = ReplayPlayer(folder / "fires.arrow")
    player.look_at(100)
    model = FireFighting(strategy="A", initial_temperature=0.02, rng=4).run(100)
    assert player.past.shown.fingerprint == model.state_hash()
    burning = f"{model.fires_burning} of {len(model.fires)}"
    assert ("Fires burning", burning) in player.past.shown.readings
    player.close()


def test_a_recording_is_played_to_its_end_and_no_further(folder):
    player = ReplayPlayer(folder / "fires.arrow")
    player.set_speed(AS_FAST_AS_IT_GOES)
    player.play()
    wait_until(lambda: not threads("play"))
    assert (player.playing, player.finished, player.step_shown) == (False, True, STEPS)
    player.play()
    assert not player.playing
    player.close()


def test_speed_counts_steps_also_where_only_every_tenth_was_recorded(folder):
    player = ReplayPlayer(folder / "own.arrow")
    assert player.past.step_of(1) - player.past.step_of(0) == 10
    rows = []

    def step(stop):
        goes_on = player._play_step(stop)
        rows.append(player.past.index)
        return goes_on

    times = Clock().times(50, step, speed=100.0)
    assert rows == [(k + 1) // 10 for k in range(50)]
    assert times[rows.index(4)] == pytest.approx(0.39, abs=1.01 * BREATH)
    player.close()


def test_a_row_that_one_jumps_to_is_shown_as_long_as_any_other(folder):
    player, go_on = ReplayPlayer(folder / "own.arrow"), threading.Event()
    for jump in (lambda: player.look(1), lambda: player.look_at(player.past.step_of(1))):
        player.rewind()
        for _ in range(9):
            player._play_step(go_on)
        jump()
        for _ in range(9):
            player._play_step(go_on)
        assert player.past.index == 1
        player._play_step(go_on)
        assert player.past.index == 2
    player.close()


def test_an_unreadable_row_is_reported(folder, monkeypatch):
    player = ReplayPlayer(folder / "fires.arrow")
    real = type(player.recording).__getitem__

    def torn(recording, row):
        if row == 50:
            raise RecordingError("damaged from step 51 on")
        return real(recording, row)

    monkeypatch.setattr(type(player.recording), "__getitem__", torn)
    player.look(50)
    assert player.error.endswith(": damaged from step 51 on")
    player.play()
    assert not player.playing
    player.rewind()
    assert (player.error, player.past.shown.step) == ("", 1)
    player.close()


def test_recordings_of_the_folder_are_listed_and_nothing_else_is_opened(replaying, folder):
    assert set(replaying.listed) == {"boids.arrow", "fires.arrow", "own.arrow", "evening run"}
    for name in ("../fires.arrow", str(folder / "fires.arrow"), "missing.arrow", ""):
        replaying.open_listed(name)
        assert replaying.player is None
        assert "not found" in replaying.fault


def test_without_a_folder_nothing_is_listed(monkeypatch):
    monkeypatch.delenv(RECORDINGS_VARIABLE, raising=False)
    replaying = Replaying(Session("boids"))
    assert replaying.listed == []
    replaying.close()


def test_a_single_recording_is_opened_at_once(folder, monkeypatch):
    monkeypatch.setenv(RECORDINGS_VARIABLE, str(folder / "fires.arrow"))
    replaying = Replaying(Session("boids"))
    assert (replaying.listed, replaying.player.step_shown) == (["fires.arrow"], 1)
    replaying.close()


def test_a_file_that_is_not_a_recording_is_refused_in_one_line(replaying, folder):
    replaying._open(folder / "text.arrow", "text.arrow")
    assert replaying.player is None
    assert replaying.fault.startswith("text.arrow is not a recording")
    assert "\n" not in replaying.fault


def test_events_are_found_and_jumped_to(replaying):
    player = opened(replaying)
    outs = [event for event in replaying.events if event.kind == "fire out"]
    assert outs
    player.look_at(outs[0].step)
    before, after = (
        dict(player.past.shown.readings)["Fires burning"],
        (player.back(), dict(player.past.shown.readings)["Fires burning"])[1],
    )
    assert int(before.split()[0]) < int(after.split()[0])


def test_a_recording_is_handed_over_in_pieces_and_deleted_afterwards(replaying, folder):
    content = (folder / "fires.arrow").read_bytes()
    hand_over(replaying, "mine.arrow", content, piece=10_000)
    place = replaying._upload.path.parent
    assert (replaying.fault, replaying.name, replaying.player.step_shown) == ("", "mine.arrow", 1)
    wait_until(lambda: replaying.events is not None)
    replaying.open_listed("fires.arrow")
    assert not place.exists()


def test_a_recording_stays_open_until_another_one_could_be_opened(replaying, folder, monkeypatch):
    content = (folder / "fires.arrow").read_bytes()
    hand_over(replaying, "mine.arrow", content)
    wait_until(lambda: replaying.events is not None)
    open_one, events, place = replaying.player, replaying.events, replaying._upload.path.parent
    open_one.look_at(60)
    replaying.set_parameter("strategy", "B")
    wrong = (
        ("bad.arrow", b"nothing", "bad.arrow is not a recording"),
        ("my half.arrow", content[: len(content) // 50], "my half.arrow"),
        ("empty.arrow", b"", ""),
    )
    for name, text, fault in wrong:
        hand_over(replaying, name, text)
        assert replaying.fault.startswith(fault)
        assert "\n" not in replaying.fault
        assert (replaying.player, replaying.name, replaying.events) == (open_one, "mine.arrow", events)
    replaying.open_listed("text.arrow")
    replaying.open_listed("missing.arrow")
    assert not replaying.begin_upload("large.arrow", LARGEST_RECORDING + 1)
    assert (open_one.step_shown, replaying.changes) == (60, {"strategy": "B"})
    assert place.exists()
    monkeypatch.setattr("mesa_swarm.dashboard.replay.replaying.LARGEST_RECORDING", 1000)
    assert replaying.begin_upload("lying.arrow", 10)
    assert (replaying.busy, replaying.player) == ("receiving lying.arrow ...", open_one)
    assert not replaying.take(b"x" * 2000)
    assert (replaying.busy, replaying.player) == ("", open_one)


@pytest.mark.parametrize("name", ["../../up.arrow", "..", "", "a\0b/\ud800.arrow", "C:\\x\\" + "long" * 90, "é" * 300])
def test_a_file_is_kept_in_its_folder_whatever_it_is_called(name):
    incoming = Incoming(name)
    assert incoming.take(b"abc") == 3
    incoming.end()
    assert [path.read_bytes() for path in incoming.path.parent.iterdir()] == [b"abc"]
    incoming.discard()
    assert not incoming.path.parent.exists()


def test_what_is_too_large_is_refused_before_and_while_it_comes(replaying, monkeypatch):
    assert not replaying.begin_upload("large.arrow", LARGEST_RECORDING + 1)
    assert replaying.fault == "large.arrow has 200,000,001 bytes; expected at most 200,000,000"
    monkeypatch.setattr("mesa_swarm.dashboard.replay.replaying.LARGEST_RECORDING", 1000)
    assert replaying.begin_upload("lying.arrow", 10)
    place = replaying._coming.path.parent
    assert not replaying.take(b"x" * 2000)
    assert "too large" in replaying.fault
    assert not replaying.take(b"more")
    assert not place.exists()


def test_the_button_asks_for_the_next_piece_until_all_has_come(replaying, folder, monkeypatch):
    sent = []
    picker = FilePicker()
    monkeypatch.setattr(picker, "send", sent.append)
    upload, content = Upload(picker, replaying), (folder / "fires.arrow").read_bytes()
    upload.act({"do": "begin", "name": "mine.arrow", "size": len(content)}, [])
    upload.act({"do": "piece", "last": False}, [memoryview(content)[:5000]])
    upload.act({"do": "piece", "last": True}, [memoryview(content)[5000:]])
    assert [message["go"] for message in sent] == [True, True, False]
    assert replaying.player.step_shown == 1
    upload.close()


def test_the_session_goes_on_from_a_step_as_the_recorded_run_did(replaying):
    session, changes = replaying.session, []
    session.adopted.add(lambda: changes.append(session.name))
    opened(replaying).look_at(60)
    replaying.branch()
    wait_until(lambda: changes)
    assert (session.name, session.model.completed, session.seed, session.settings["strategy"]) == (
        "fire_fighting",
        60,
        4,
        "A",
    )
    alone = FireFighting(strategy="A", initial_temperature=0.02, rng=4).run(61)
    session.step()
    assert session.model.state_hash() == alone.state_hash()
    assert session.waiting == frozenset()
    session.back()
    assert session.past.shown.step == 60
    session.reset()
    fresh = FireFighting(strategy="A", initial_temperature=0.02, rng=4)
    assert (session.model.steps, session.model.state_hash()) == (0, fresh.state_hash())


def test_a_branch_may_have_other_parameters(replaying):
    opened(replaying).look_at(60)
    panel = BranchPanel(ControlPanel(), replaying)
    panel.act({"do": "choose", "name": "strategy", "value": "B"})
    assert panel.widget.values["strategy"]["text"] == "B"
    panel.act({"do": "choose", "name": "strategy", "value": "C"})
    assert "strategy" in replaying.fault
    panel.act({"do": "text", "name": "k2", "value": "0.02"})
    assert replaying.changes == {"strategy": "B", "k2": 0.02}
    replaying.branch()
    wait_until(lambda: replaying.session.name == "fire_fighting")
    session = replaying.session
    wait_until(lambda: session.model is not None)
    assert (session.model.completed, session.settings["strategy"], session.model.fire_constants.k2) == (60, "B", 0.02)
    panel.act({"do": "choose", "name": "strategy", "value": "A"})
    assert replaying.changes == {"k2": 0.02}
    panel.close()


@pytest.mark.parametrize("names", [("fires.arrow", "boids.arrow"), ("boids.arrow", "fires.arrow")])
def test_the_panel_of_a_recording_does_not_affect_the_next_one(replaying, names):
    first, second = names
    opened(replaying, first)
    panel = BranchPanel(ControlPanel(), replaying)
    shown = panel.widget.values
    opened(replaying, second)
    assert panel.widget.values == shown
    panel.act({"do": "text", "name": next(iter(shown)), "value": "3"})
    assert (replaying.changes, replaying.fault) == ({}, "")
    panel.close()


def test_what_is_known_of_a_recording_can_be_asked_for_while_it_is_being_closed(replaying):
    replaying.open_listed("fires.arrow")
    replaying.player.close()
    assert (replaying.model_shown, replaying.notes) == ("fire_fighting", [])
    assert replaying.parameters["strategy"] == "A"
    replaying.open_listed("boids.arrow")
    assert replaying.model_shown == "boids"


def test_a_change_that_makes_another_world_is_refused_in_words(replaying):
    opened(replaying)
    replaying.set_parameter("n_robots", 11)
    replaying.branch()
    wait_until(lambda: not replaying.busy)
    assert "11 robots instead of the 10" in replaying.fault
    assert replaying.session.name == "boids"


def test_a_model_that_is_not_of_the_gallery_can_be_looked_at_only(replaying):
    opened(replaying, "own.arrow")
    assert (replaying.model_shown, replaying.parameters) == ("", {})
    replaying.branch()
    wait_until(lambda: not replaying.busy)
    assert "SwarmModel is not a model of this page" in replaying.fault


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="open files are read from /proc, which is missing")
def test_closing_ends_a_branch_that_is_being_run_again_and_shows_how_far_it_is(replaying, folder, monkeypatch):
    model = Boids(n_robots=5, rng=1)
    with model.record(folder / "long.arrow", checkpoint_every=0):
        model.run(400)
    player = opened(replaying, "long.arrow")
    player.look(399)
    original = Boids.step
    monkeypatch.setattr(Boids, "step", lambda model: (time.sleep(0.05), original(model)))
    monkeypatch.setattr("mesa_swarm.dashboard.replay.replaying.SHOWN_EVERY", 0.0)
    replaying.branch()
    wait_until(lambda: "repeating step" in replaying.busy)
    assert replaying.busy.startswith("continuing from step 400: repeating step ")
    replaying.close()
    wait_until(lambda: "branch" not in [thread.name for thread in threading.enumerate()])


class AskedMeanwhile(threading.Event):
    """While the given time is requested, another thread does something, for which it waits a little."""

    def __init__(self, time, do):
        super().__init__()
        self.left, self.thread = time, threading.Thread(target=do)

    def is_set(self):
        found = super().is_set()
        self.left -= 1
        if self.left == 0:
            self.thread.start()
            self.thread.join(0.5)
        return found


@pytest.mark.parametrize("time", [1, 2])
def test_a_recording_that_is_closed_during_a_branch_shows_no_progress(replaying, monkeypatch, time):
    opened(replaying)
    monkeypatch.setattr("mesa_swarm.dashboard.replay.replaying.SHOWN_EVERY", -1.0)
    closing = replaying._stop = AskedMeanwhile(time, replaying._leave)
    replaying._watch(60, closing)(Boids(n_robots=2, rng=1))
    closing.thread.join()
    assert closing.is_set()
    assert replaying.busy == ""


def test_a_recording_that_is_closed_while_a_branch_fails_has_no_fault(replaying):
    opened(replaying, "own.arrow")
    closing = replaying._stop = AskedMeanwhile(1, replaying._leave)
    replaying._branch(replaying._path, 1, {}, closing)
    closing.thread.join()
    assert closing.is_set()
    assert (replaying.busy, replaying.fault) == ("", "")


def test_events_that_are_found_when_a_recording_is_closed_are_not_those_of_the_next(replaying, monkeypatch):
    opened(replaying)

    def late(rows):
        replaying._leave()
        raise RecordingError("torn")

    monkeypatch.setattr("mesa_swarm.dashboard.replay.replaying.events_of", late)
    monkeypatch.setattr(RecordedSeries, "read", lambda *given: None)
    rows = SimpleNamespace(stop=replaying._stop, recording=None)
    replaying._search(rows, replaying.player)
    assert (replaying.fault, replaying.events) == ("", [])


def test_recorded_parameters_that_no_model_takes_do_not_reach_the_controls(replaying, folder):
    whole = taken_apart(folder / "boids.arrow")
    for name, value in (("n_robots", {"x": 1}), ("sight", "<b>"), ("memory", [1])):
        facts = changed(whole.facts, ("parameters", name), value)
        put_together(replace(whole, facts=facts), folder / "odd.arrow")
        opened(replaying, "odd.arrow")
        assert (replaying.model_shown, replaying.parameters) == ("", {})
    (folder / "odd.arrow").unlink()


def test_closing_lets_go_of_file_folder_and_threads(replaying, folder):
    content = (folder / "fires.arrow").read_bytes()
    hand_over(replaying, "mine.arrow", content)
    place, player = str(replaying._upload.path.parent), replaying.player
    player.play()
    replaying.session.close()
    del player
    names = ("events", "play", "branch")
    wait_until(lambda: not any(thread.name in names for thread in threading.enumerate()))
    assert not os.path.exists(place)
    wait_until(lambda: place not in Path("/proc/self/maps").read_text())


def test_an_upload_that_the_disk_does_not_take_is_refused_in_words_and_leaves_nothing(tmp_path, monkeypatch):
    with small_disk(tmp_path / "disk", 64) as disk:
        monkeypatch.setattr("tempfile.tempdir", str(disk))
        replaying = Replaying(Session("boids"))
        assert replaying.begin_upload("run.arrow", 200_000)
        assert not replaying.take(b"x" * 200_000)
        assert replaying.fault.startswith("run.arrow cannot be written: No space left on device")
        assert list(disk.iterdir()) == []
        assert replaying.busy == ""
        replaying.close()
