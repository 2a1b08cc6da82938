"""What is compared: defaults, settings, faults; and the runs over many seeds, in processes that end on request."""

import io
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.dashboard.compare.compare_view import (
    ComparePanel,
    CurveThread,
    captions,
    comparison_groups,
    comparison_values,
    curves_png,
    draw,
    main_reports,
    series_of_pair,
)
from mesa_swarm.dashboard.compare.comparing import ComparedRuns, Comparing, Pair, two_values
from mesa_swarm.dashboard.experiment import many_runs
from mesa_swarm.dashboard.experiment.many_runs import MOST_AT_ONCE, ManyRuns, do_task, workers_for
from mesa_swarm.dashboard.page.controls import ControlPanel
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.experiments.compare import compare
from mesa_swarm.experiments.plan import checked_plan
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import model_names
from mesa_swarm.model.parameters import Parameter, Slider
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.palette import LIGHT, rgb
from support.killing import environment
from support.waiting import wait_until


@pytest.fixture
def comparing():
    session = Session("fire_fighting", {"n_robots": 4}, seed=5)
    yield session.companion(Comparing)
    session.close()


def test_two_worlds_have_the_same_seed_and_differ_in_one_parameter(comparing):
    first, second = (side.model for side in comparing.pair.sides)
    assert np.array_equal(first.swarm.position, second.swarm.position)
    assert (comparing.built, len(first.swarm)) == ({"A": "A", "B": "B", "seed": 5}, 4)
    assert captions(comparing) == ("A: strategy A", "B: strategy B")


@pytest.mark.slow
def test_every_model_of_the_gallery_can_be_compared_in_every_parameter(comparing):
    for name in model_names():
        comparing.choose_model(name)
        assert (comparing.faults, comparing.pair.error) == ({}, ""), name
        for parameter in comparing.choices:
            comparing.parameter = parameter
            fields = comparison_groups(comparing)[0]["fields"]
            assert {field["name"] for field in fields} == {"model", "parameter", "A", "B"}


def test_a_slider_is_compared_at_its_default_and_at_its_farther_end(comparing):
    comparing.choose_parameter("n_robots")
    assert comparing.values == [10, 50]
    assert [len(side.model.swarm) for side in comparing.pair.sides] == [10, 50]
    assert two_values(object, Parameter("share", 0.75, float, Slider(0, 1, 0.1)), []) == [0.75, 0.0]


def test_a_setting_waits_for_a_reset_and_an_impossible_one_is_refused(comparing):
    comparing.choose_parameter("n_robots")
    comparing.set_value("B", "20")
    assert comparing.waiting == {"B"}
    comparing.set_value("A", "20000")
    assert "at most 10000" in comparing.faults["A"]
    comparing.set_count("seed", "many")
    assert comparing.faults["seed"] == "seed is 'many'; expected a whole number at least 0 and at most 9007199254740991"
    comparing.reset()
    assert comparing.waiting == frozenset()
    assert [len(side.model.swarm) for side in comparing.pair.sides] == [10, 20]


def test_worlds_that_cannot_be_built_are_reported_and_replaced(comparing):
    comparing.session.uploads["hall"] = Map(name="hall", bounds=(0, 0, 800, 600))
    comparing.choose_parameter("map")
    assert comparing.values == ["openspace_fire", "hall"]
    comparing.reset()
    assert "map hall has no fires" in comparing.faults["worlds"]
    comparing.start()
    assert "map hall has no fires" in comparing.faults["runs"]
    comparing.pair.step()
    comparing.choose_parameter("strategy")
    assert "worlds" not in comparing.faults


def test_other_parameters_are_those_of_the_session_for_the_same_model_only(comparing):
    assert comparing.shared_settings == {"n_robots": 4}
    comparing.choose_parameter("n_robots")
    assert comparing.shared_settings == {}
    comparing.choose_model("boids")
    assert comparing.shared_settings == {}


def test_the_panel_carries_out_messages(comparing):
    panel = ComparePanel(ControlPanel(), comparing)
    panel.act({"do": "choose", "name": "parameter", "value": "communication"})
    assert comparing.parameter == "communication"
    panel.act({"do": "choose", "name": "B", "value": "goal"})
    assert (comparing.built["B"], panel.widget.values["B"]["text"]) == ("goal", "goal")
    panel.act({"do": "place", "name": "seeds", "value": 12})
    panel.act({"do": "text", "name": "steps", "value": "700"})
    assert (comparing.seeds, comparing.steps) == (12, 700)
    panel.act({"do": "text", "name": "steps", "value": "0"})
    assert "expected a whole number at least 1" in comparison_values(comparing)["steps"]["fault"]
    panel.act({"do": "random"})
    assert comparing.built["seed"] == comparing.seed
    panel.act({"do": "choose", "name": "model", "value": "boids"})
    assert comparing.name == "boids"
    panel.close()


def test_the_chart_has_a_line_for_each_world(comparing):
    for _ in range(10):
        comparing.pair.step()
    first, second = series_of_pair(comparing.pair)
    assert first.keys() == second.keys()
    assert main_reports([first, second]) == ["fires_burning", "robots_at_fires", "total_collisions"]
    assert first["fires_burning"][0].tolist() == list(range(1, 11))
    pixels = np.asarray(Image.open(io.BytesIO(curves_png([first, second], ["one", "two"]))).convert("RGB")).astype(int)
    for colour in map(rgb, LIGHT.series[:2]):
        assert (np.abs(pixels - colour).sum(axis=2) < 30).sum() > 100


def test_the_chart_shows_every_step_where_it_was_taken_though_the_models_forget_the_early_ones(monkeypatch):
    monkeypatch.setattr("mesa_swarm.viewing.player.MOST_COLLECTED", 20)
    pair = Pair()
    pair.place(*(SwarmModel(rng=1, model_reporters={"now": "completed"}) for _ in "AB"))
    for _ in range(50):
        pair.step()
    assert len(pair.sides[0].model.datacollector.model_vars["now"]) == 30
    axes = Figure().subplots()
    draw(axes, "now", series_of_pair(pair), ("A", "B"))
    for line in axes.get_lines():
        assert line.get_xdata().tolist() == line.get_ydata().tolist() == list(range(1, 51))
    assert axes.get_xlim() == (0, 50)
    pair.close()


@pytest.mark.slow
def test_the_lines_of_long_runs_are_drawn_from_few_numbers_at_their_steps():
    pair = Pair()
    for side in pair.sides:
        side.series.most_numbers = 100
    pair.place(*(SwarmModel(rng=1, collect_every=0, model_reporters={"word": lambda _: "far"}) for _ in "AB"))
    for side in pair.sides:
        side.model.collect_every = 1
    for _ in range(300):
        pair.step()
    steps, numbers = series_of_pair(pair)[1]["collisions"][:2]
    assert 10 < len(steps) == len(numbers) <= 50
    assert (steps % pair.sides[1].series.row_every == 0).all()
    assert curves_png(series_of_pair(pair), ("A", "B")).startswith(b"\x89PNG")
    pair.close()
    assert series_of_pair(pair) == ({}, {})


def test_the_chart_is_drawn_when_there_is_something_new_and_no_more_when_closed(comparing):
    pictures = []
    thread = CurveThread(comparing.pair, lambda: ("A", "B"), pictures.append)
    wait_until(lambda: pictures)
    comparing.pair.step()
    wait_until(lambda: len(pictures) >= 2)
    thread.close()
    assert pictures[0] != pictures[1]


def test_the_runs_send_each_completed_one_and_then_the_report():
    sent = []
    plan = checked_plan("fire_fighting", seeds=2, steps=5)
    do_task(ComparedRuns(plan), 1, lambda kind, value: sent.append((kind, value)))
    assert [kind for kind, _ in sent] == ["run"] * 4 + ["report"]
    assert (ManyRuns().running, ManyRuns().left) == (False, "")
    report, found = sent[-1][1], compare("fire_fighting", seeds=2, steps=5, jobs=1)
    assert report.finding == found.finding()
    assert report.picture[1:4] == b"PNG"
    assert [line[1] for line in report.table[:3]] == ["strategy", "A", "B"]
    assert pickle.loads(pickle.dumps(report)) == report


def test_an_error_of_a_model_in_a_run_is_sent():
    sent = []
    plan = checked_plan("fire_fighting", seeds=2, steps=5)
    plan.settings["n_robots"] = -1
    do_task(ComparedRuns(plan), 1, lambda kind, value: sent.append((kind, value)))
    assert sent[0][0] == "error"
    assert "n_robots is -1" in sent[0][1]


def test_one_core_is_left_to_the_page(monkeypatch):
    plan = checked_plan("fire_fighting", seeds=30, steps=5)
    for cores, workers in ((1, 1), (2, 1), (8, 7), (500, 60)):
        monkeypatch.setattr(many_runs, "cpu_count", lambda cores=cores: cores)
        assert workers_for(ComparedRuns(plan)) == workers


def group_of(pid: int) -> list[int]:
    """Return the processes of a group that still work."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, group = (folder / "stat").read_text().rsplit(")")[-1].split()[:3]
        except OSError:
            continue
        if int(group) == pid and state != "Z":
            found.append(int(folder.name))
    return found


@pytest.mark.slow
def test_runs_in_the_background_give_what_they_give_in_the_foreground():
    runs, progress = ManyRuns(), []
    runs.changed.add(lambda: progress.append((runs.done, runs.total)))
    runs.start(ComparedRuns(checked_plan("fire_fighting", seeds=3, steps=50)))
    assert runs.running
    with pytest.raises(SwarmError, match="cancel it first"):
        runs.start(ComparedRuns(checked_plan("fire_fighting", seeds=3, steps=50)))
    wait_until(lambda: not runs.running)
    assert (runs.error, progress[-1]) == ("", (6, 6))
    assert runs.report.finding == compare("fire_fighting", seeds=3, steps=50, jobs=1).finding()
    runs.close()


def test_a_plan_that_cannot_be_sent_takes_no_place_on_the_server(monkeypatch):
    plan = checked_plan("fire_fighting", "strategy", ["A", "B"], 2, steps=3)
    monkeypatch.setattr(many_runs, "workers_for", lambda plan: lambda: 1)
    runs = ManyRuns()
    for _ in range(MOST_AT_ONCE + 1):
        with pytest.raises((AttributeError, pickle.PicklingError)):
            runs.start(ComparedRuns(plan))
    assert not runs.running


def test_a_process_that_has_been_ended_is_not_ended_again(monkeypatch):
    process = subprocess.Popen([sys.executable, "-c", ""], start_new_session=True)
    process.wait()
    monkeypatch.setattr(os, "killpg", lambda group, signal: pytest.fail("this group may be another's by now"))
    many_runs._end(process)
    assert process.returncode == 0


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="this system has no process groups")
def test_cancelling_ends_all_processes_before_a_run_is_done_and_makes_room_for_the_next(monkeypatch):
    monkeypatch.setattr(many_runs, "cpu_count", lambda: 3)
    plan = checked_plan("fire_fighting", seeds=10, steps=1_000_000)
    for _ in range(MOST_AT_ONCE + 1):
        runs = ManyRuns()
        runs.start(ComparedRuns(plan))
        pid = runs._process.pid
        wait_until(lambda pid=pid: len(group_of(pid)) >= 3)
        runs.cancel()
        wait_until(lambda pid=pid: not group_of(pid), 20.0)
        assert (runs.running, runs.report, runs.error) == (False, None, "cancelled after 0 of 20 runs")
        runs.close()


@pytest.mark.slow
def test_closing_a_session_ends_its_runs_and_too_many_at_once_are_refused():
    sessions = [Session("fire_fighting") for _ in range(MOST_AT_ONCE + 1)]
    rivals = [session.companion(Comparing) for session in sessions]
    for rival in rivals:
        rival.set_count("steps", "200000")
        rival.start()
    pids = [rival.runs._process.pid for rival in rivals[:-1]]
    assert "try again when one is done" in rivals[-1].faults["runs"]
    for session in sessions:
        session.close()
    wait_until(lambda: not any(map(group_of, pids)), 20.0)


PAGE = """
import time
from mesa_swarm.dashboard.experiment import many_runs
from mesa_swarm.dashboard.compare.comparing import ComparedRuns
from mesa_swarm.experiments.plan import checked_plan
many_runs.cpu_count = lambda: 3
process = many_runs._begin_process(ComparedRuns(checked_plan("fire_fighting", seeds=2, steps=1_000_000)))
print(process.pid, flush=True)
time.sleep(1000)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="this system has no process groups")
def test_runs_end_when_the_page_that_started_them_is_gone():
    page = subprocess.Popen([sys.executable, "-c", PAGE], env=environment(), stdout=subprocess.PIPE)
    runs = int(page.stdout.readline())
    wait_until(lambda: len(group_of(runs)) >= 3)  # the process and its workers
    page.kill()
    page.communicate()
    wait_until(lambda: not group_of(runs), 30.0)
