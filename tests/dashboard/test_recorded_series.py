"""The charts of a recording are those of the run that was recorded; recordings are found whatever they are called."""

import os

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.dashboard.page.series import WITHOUT_REPORTERS, RecordedSeries, Series, collected_reporters
from mesa_swarm.dashboard.page.session import WATCHED
from mesa_swarm.dashboard.replay import replaying as listed_recordings
from mesa_swarm.dashboard.replay.replaying import ReplayPlayer, is_recording, recordings_in
from mesa_swarm.dashboard.run.charts import HISTOGRAM, OVER_TIME, ChartBoard, Charting, ChosenChart, HistogramContent
from mesa_swarm.dashboard.run.inspector import Inspector, ReplayInspecting, inspect
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.flocking import Flocking
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.player import readings_of
from mesa_swarm.viewing.scene import scene_of_recording
from support.clock import Clock

STEPS = 60


class Noting(SwarmModel):
    """Robots that note an event now and then."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 3)

    def step(self):
        super().step()
        for name in ("third",) * (self.steps % 3 == 0) + ("tenth",) * (self.steps % 10 == 0):
            self.event(name)


@pytest.fixture(scope="module")
def fires(tmp_path_factory):
    """A recorded run, its numbers, and the readings above its pictures."""
    path = tmp_path_factory.mktemp("recordings") / "fires"
    model = FireFighting(strategy="A", initial_temperature=0.02, n_robots=30, rng=4)
    series, readings, met = Series(), {}, []
    series.follow(model)
    with model.record(path, checkpoint_every=20):
        for step in range(1, STEPS + 1):
            model.step()
            readings[step] = readings_of(model)
            met.append(model.swarm.collided.copy())
    return path, series, readings, np.cumsum(met, axis=0)


def read(path, **limits) -> RecordedSeries:
    recording = Recording(path)
    series = RecordedSeries(recording, scene_of_recording(recording), len(recording), **limits)
    series.read(recording, recording)
    return series


def played(path) -> ReplayPlayer:
    player = ReplayPlayer(path)
    recording = Recording(path)
    player.series.read(recording, recording, player.show_numbers)
    return player


@pytest.mark.parametrize(
    "key", ["collisions", "total_collisions", "at_fires", "layers", "fires_burning", "fire_temperature"]
)
def test_the_charts_of_a_recording_are_those_of_the_run(fires, key):
    path, live, *_ = fires
    recorded = read(path)
    assert recorded.chart(key).title == live.chart(key).title
    assert recorded.chart(key).names == live.chart(key).names
    (steps, rows), (expected_steps, expected) = recorded.rows(key), live.rows(key)
    assert steps.tolist() == expected_steps.tolist()
    assert rows == pytest.approx(expected, rel=1e-6, abs=1e-6, nan_ok=True)


def test_readings_above_a_recording_are_those_of_the_run(fires):
    path, _, readings, _ = fires
    player = played(path)
    for step in (1, 33, STEPS):
        player.look_at(step)
        assert player.past.shown.readings == readings[step]
    player.close()


def test_collisions_so_far_of_each_robot_are_counted(fires):
    path, _, _, met = fires
    player = played(path)
    for step in (1, 33, STEPS):
        player.look_at(step)
        content = HistogramContent.of(player.robots_shown(), ChosenChart(HISTOGRAM, "collisions so far"))
        assert content.values.tolist() == met[step - 1].tolist()
        assert content.bins.counts.sum() == 30
    player.close()


def test_long_recordings_are_thinned_to_exact_rows(fires):
    path, live, *_ = fires
    recorded = read(path, most_numbers=300)
    steps, rows = recorded.rows("total_collisions")
    assert 5 < len(steps) <= 60 // recorded.row_every + 1
    assert recorded.row_every > 1
    live_steps, numbers = live.rows("total_collisions")
    assert rows.tolist() == numbers[np.isin(live_steps, steps)].tolist()
    assert recorded.collisions_of(np.array([1]), STEPS - 1) is not None or recorded._colliding is None


def test_events_of_a_recording_are_counted_by_name(tmp_path):
    model = Noting(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(30)
    recorded = read(tmp_path / "run.arrow")
    assert recorded.chart("events").names == ("third", "tenth")
    assert recorded.rows("events")[1][-1].tolist() == [10, 3]


def test_what_was_not_recorded_is_stated(tmp_path):
    model = Flocking(n_robots=5, rng=1)
    with model.record(tmp_path / "bare", columns=("position", "heading"), checkpoint_every=0):
        model.run(10)
    recorded = read(tmp_path / "bare")
    assert recorded.charts() == []
    assert recorded.note == WITHOUT_REPORTERS
    with model.record(tmp_path / "states", checkpoint_every=4):
        model.run(10)
    reporters = collected_reporters(Recording(tmp_path / "states"))
    assert reporters.keys() <= model.datacollector.model_vars.keys()
    steps, values = reporters["polarization"]
    assert values.tolist() == model.datacollector.model_vars["polarization"][: len(values)]
    assert steps.tolist() == list(range(1, len(values) + 1))
    later = read(tmp_path / "states")
    assert "total_collisions" in {chart.key for chart in later.charts()}, "it is among the reporters"


def test_a_recording_of_every_tenth_step_has_no_sums_that_would_be_wrong(tmp_path):
    model = Flocking(n_robots=5, rng=1)
    with model.record(tmp_path / "run", every=10, checkpoint_every=0):
        model.run(50)
    recorded = read(tmp_path / "run")
    assert "total_collisions" not in {chart.key for chart in recorded.charts()}
    assert (recorded.row_every, recorded.rows("collisions")[0].tolist()) == (10, [10, 20, 30, 40, 50])
    assert recorded.collisions_until(4) is None
    assert recorded.collisions_of(np.array([1]), 4) is None


def test_charts_in_replay_are_those_that_were_chosen_on_watch(fires):
    board, player = ChartBoard(), played(fires[0])
    sent = []
    board.send = lambda content, buffers=(): sent.append(content)
    player.chosen_charts["fire_fighting"] = ["layers", ChosenChart(HISTOGRAM, "heading").text]
    charting = Charting(board, player, clock=Clock(100.0))
    charting.act({"do": "look", "value": True})
    player.look_at(10)
    charting.act({"do": "drawn"})
    assert [one["kind"] for one in sent[-1]["charts"]] == [OVER_TIME, HISTOGRAM]
    assert sent[-1]["looked_at"] == 10
    assert sent[-1]["charts"][0]["row"]["step"] == sent[-1]["charts"][1]["step"] == 10
    charting.close()
    player.close()


def test_a_robot_of_a_recording_is_inspected_as_far_as_it_was_recorded(fires):
    player, inspector = played(fires[0]), Inspector()
    inspecting = ReplayInspecting(inspector, player)
    assert inspector.inspected == {}
    inspecting.act({"do": "next"})
    ids = Recording(fires[0])[0].robots.tolist()
    assert (player.selected, inspector.inspected["id"]) == (ids[0], ids[0])
    inspecting.act({"do": "previous"})
    assert player.selected == ids[-1]
    player.look_at(40)
    found, facts = inspector.inspected, dict(inspector.inspected["facts"])
    model = FireFighting(strategy="A", initial_temperature=0.02, n_robots=30, rng=4)
    model.watch(last=2, columns=WATCHED)
    live = inspect(model.run(40), model.robots[-1], 40)
    assert found["when"] == live["when"] == "step 40"
    assert (found["layer"], found["does"], found["movable"]) == (live["layer"], live["does"], False)
    assert found["pose"] == pytest.approx(live["pose"], abs=0.05)
    assert len(found["sensors"]) == len(live["sensors"])
    assert "reasons" in facts["Not recorded"]
    assert "radiation readings" in facts["Not recorded"]
    assert facts["Collided"] == dict(live["facts"])["Collided"]
    inspecting.act({"do": "select", "value": 10**9})
    assert not inspector.inspected["known"]
    inspecting.act({"do": "select", "value": None})
    assert inspector.inspected == {}
    inspecting.close()
    player.close()


def test_a_recording_of_positions_alone_has_an_inspector_that_names_the_rest(tmp_path):
    model = Flocking(n_robots=5, rng=1)
    with model.record(tmp_path / "bare", columns=("position",)):
        model.run(3)
    player, inspector = played(tmp_path / "bare"), Inspector()
    inspecting = ReplayInspecting(inspector, player)
    inspecting.act({"do": "next"})
    found = inspector.inspected
    assert (found["known"], found["sensors"], found["pose"]) == (True, [], {})
    assert "its command, the layer that drives it, proximity readings" in dict(found["facts"])["Not recorded"]
    inspecting.close()
    player.close()


def test_recordings_are_found_by_their_content(fires, tmp_path):
    content = fires[0].read_bytes()
    for name in ("a.arrow", "b", "c.txt", "d e f"):
        (tmp_path / name).write_bytes(content)
    (tmp_path / "half.arrow").write_bytes(content[:50])
    (tmp_path / "text.arrow").write_text("hello")
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "large").write_bytes(b"\xff\xff\xff\xff\xff\xff\xff\x7f" + bytes(100))
    (tmp_path / "folder").mkdir()
    assert sorted(recordings_in(tmp_path)) == ["a.arrow", "b", "c.txt", "d e f"]
    (tmp_path / "b").write_text("a recording no more")
    os.utime(tmp_path / "c.txt", (1, 1))
    assert recordings_in(tmp_path)[-1] == "c.txt"
    assert "b" not in recordings_in(tmp_path)
    assert recordings_in(tmp_path / "missing") == []


def test_a_file_is_looked_into_once_until_it_changes(fires, tmp_path, monkeypatch):
    content, looked = fires[0].read_bytes(), []
    for k in range(500):
        (tmp_path / f"run {k}").write_bytes(content if k % 100 == 0 else b"text")
    monkeypatch.setattr(listed_recordings, "is_recording", lambda path: looked.append(path.name) or is_recording(path))
    for _ in range(3):
        assert len(recordings_in(tmp_path)) == 5
    assert len(looked) == 500
    (tmp_path / "run 7").write_bytes(content)
    assert len(recordings_in(tmp_path)) == 6
    assert looked[500:] == ["run 7"]
