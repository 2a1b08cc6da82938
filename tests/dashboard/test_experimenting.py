"""Experiments of the page: what is chosen, the runs in the background, their results, and the job that repeats them."""

import csv
import io
import json
import math
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.cli import app
from mesa_swarm.dashboard.experiment import experimenting as experimenting_module
from mesa_swarm.dashboard.experiment.experiment_results import MEAN, SHARE, GridRuns
from mesa_swarm.dashboard.experiment.experiment_view import (
    STALE,
    ExperimentPanel,
    ExperimentPicture,
    PictureLink,
    experiment_groups,
    experiment_values,
    picture_of,
)
from mesa_swarm.dashboard.experiment.experimenting import Experimenting, checked_values, space_values, usual_values
from mesa_swarm.dashboard.experiment.many_runs import do_task
from mesa_swarm.dashboard.page.controls import ControlPanel
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.experiments.jobs import job_text, read_job
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import model_names
from mesa_swarm.model.parameters import Choice, Parameter, Slider
from support.waiting import wait_until

SMALL = {"values": "2, 3", "q": "noise", "q_values": "0, 0.3", "seeds": "2", "steps": "5", "measure": "fires out"}


@pytest.fixture
def session():
    made = Session("fire_fighting", {"slip": 0.1}, seed=5)
    yield made
    made.close()


@pytest.fixture
def experimenting(session):
    return session.companion(Experimenting)


def choose(experimenting, **choices):
    """Set choices in the order of a link."""
    for name, text in {**SMALL, **choices}.items():
        experimenting.set(name, text)
    assert experimenting.faults == {}


def done_here(experimenting, folder, most=None):
    """Do the runs of what is chosen in this process, and return the results; stop after some of them."""
    found = experimenting.grid if experimenting.is_current else experimenting._results(experimenting._experiment())
    experimenting.grid, heard = found, []

    def send(kind, value):
        if kind in ("before", "run"):
            for run in value if kind == "before" else [value]:
                found.take(run)
            heard.extend([kind] * (len(value) if kind == "before" else 1))
            if kind == "run" and heard.count("run") == most:
                raise KeyboardInterrupt

    with suppress(KeyboardInterrupt):
        GridRuns(found.experiment, folder).do(1, send)
    return found, heard


def repeated(found, measure, folder):
    """Run the job file from the command line, and return the rows of its table as text, by point and seed."""
    name, content = found.job_file(measure)
    folder.mkdir()
    (folder / name).write_bytes(content)
    if name.endswith(".zip"):
        with zipfile.ZipFile(folder / name) as archive:
            archive.extractall(folder)
    job = folder / f"{found.job_name}.toml"
    assert (
        CliRunner().invoke(app, ["sweep", str(job), "--jobs", "1", "--out", str(folder / "out"), "--quiet"]).exit_code
        == 0
    )
    return sweep_rows(folder / "out" / "runs.parquet")


def sweep_rows(path):
    """Return the rows of a table, each as a dict without what is missing."""
    import pandas as pd  # noqa: PLC0415 - beside its one use

    rows = pd.read_parquet(path).to_dict("records")
    return [{name: value for name, value in row.items() if not is_missing(value)} for row in rows]


def is_missing(value):
    return value is None or value == "" or (isinstance(value, float) and math.isnan(value))


def csv_rows(text):
    """Return the rows of a CSV text, each as a dict of numbers and texts without what is missing."""
    return [
        {name: number_or_text(value) for name, value in row.items() if value != ""}
        for row in csv.DictReader(io.StringIO(text))
    ]


def number_or_text(text):
    try:
        return float(text)
    except ValueError:
        return text


def test_a_model_is_varied_in_its_robots_over_their_slider_first(experimenting):
    assert (experimenting.name, experimenting.p, experimenting.values) == (
        "fire_fighting",
        "n_robots",
        [1, 13, 26, 38, 50],
    )
    assert (experimenting.q, experimenting.seeds, experimenting.steps, experimenting.total) == ("", 20, 15_000, 100)
    assert (experimenting.measure, experimenting.summary) == ("all fires out at", SHARE)


def test_every_model_of_the_gallery_can_be_varied_in_every_parameter(experimenting):
    for name in model_names():
        experimenting.choose_model(name)
        assert (experimenting.faults, bool(experimenting.measures)) == ({}, True), name
        for parameter in experimenting.choices:
            experimenting.set("p", parameter)
            picture = picture_of(experimenting)
            assert len(picture["cells"]) == len(picture["axes"][0]["labels"]) == len(experimenting.values)
            json.dumps([picture, experiment_groups(experimenting), experiment_values(experimenting)], allow_nan=False)


def test_the_runs_give_the_numbers_of_their_job_on_the_command_line_bit_for_bit(experimenting, tmp_path):
    choose(experimenting, measure="mean of robots_at_fires", steps="60")
    found, heard = done_here(experimenting, tmp_path)
    assert (heard, found.is_complete, experimenting.is_current) == (["run"] * 8, True, True)
    rows = csv_rows(found.csv(experimenting.measure))
    others = [
        {name: value for name, value in row.items() if name != "slip"}
        for row in repeated(found, experimenting.measure, tmp_path / "job")
    ]
    assert rows == others
    assert [(row["n_robots"], row["noise"], row["rng"]) for row in rows[:3]] == [(2, 0, 1), (2, 0, 2), (2, 0.3, 1)]
    assert {"fires out", "mean of robots_at_fires", "state_hash", "steps"} <= rows[0].keys()


def test_the_runs_on_an_uploaded_map_are_repeated_from_the_command_line(experimenting, session, tmp_path):
    session.uploads['my "map"'] = Map.from_toml(Map.load("openspace_fire").to_toml().replace("openspace_fire", "mine"))
    session.set_parameter("map", 'my "map"')
    choose(experimenting, q="strategy", q_values="A")
    found, _ = done_here(experimenting, tmp_path)
    rows = repeated(found, "fires out", tmp_path / "job")
    assert [row["state_hash"] for row in rows] == [row["state_hash"] for row in csv_rows(found.csv("fires out"))]
    assert rows[0]["map"].startswith("mine")
    experimenting.set("p", "map")
    experimenting.set_values("values", ['my "map"', "openspace_fire"])
    assert experimenting.preview().job_file("fires out")[0].endswith(".zip")


def test_a_value_with_the_name_of_an_uploaded_map_is_replaced_in_the_parameter_map_only(experimenting, session):
    session.uploads["A"] = Map(name="A", bounds=(0, 0, 800, 600))
    experimenting.set("p", "strategy")
    assert experimenting.values[0] == "A"
    assert list(experimenting._experiment().points) == [{"strategy": value} for value in experimenting.values]


def test_an_experiment_that_was_stopped_goes_on_with_the_runs_that_are_left(experimenting, tmp_path):
    choose(experimenting)
    found, _ = done_here(experimenting, tmp_path, most=5)
    assert len(found.outcomes) == 5
    assert experimenting.next_action() == ("Go on with 3 runs", True)
    again, heard = done_here(experimenting, tmp_path)
    assert (again, heard) == (found, ["before"] * 5 + ["run"] * 3)
    assert experimenting.next_action() == ("All 8 runs are done", False)


def test_runs_with_the_first_seed_are_done_first_at_all_points(experimenting, tmp_path):
    choose(experimenting)
    found, _ = done_here(experimenting, tmp_path, most=4)
    assert [cell.done for cell in found.cells("fires out", MEAN)] == [1, 1, 1, 1]


def test_runs_that_another_experiment_has_done_are_not_done_again(experimenting, tmp_path):
    choose(experimenting)
    done_here(experimenting, tmp_path)
    experimenting.set("q", "")
    experimenting.set("values", "3, 4")
    _, heard = done_here(experimenting, tmp_path)
    assert heard == ["before"] * 2 + ["run"] * 2


def test_a_setting_that_cannot_be_built_is_an_error_of_its_cell_and_the_others_go_on(experimenting, tmp_path):
    choose(experimenting, q_values="0, 7")
    found, _ = done_here(experimenting, tmp_path)
    picture = picture_of(experimenting)
    assert [cell[4:] for cell in picture["cells"]] == [[2, 2, 0], [0, 2, 2], [2, 2, 0], [0, 2, 2]]
    assert list(picture["errors"]) == ["1", "3"]
    assert "noise is 7" in picture["errors"]["1"]
    assert picture["fault"].startswith("2 of 4 settings have runs that ended in an error: ")
    assert "noise is 7" in csv_rows(found.csv("fires out"))[2]["error"]


def test_runs_that_failed_are_tried_again_and_only_those(experimenting, tmp_path, monkeypatch):
    choose(experimenting, q_values="0, 7")
    found, _ = done_here(experimenting, tmp_path)
    assert experimenting.next_action() == ("Try 4 failed runs again", True)
    heard = []
    GridRuns(found.experiment, tmp_path, retry_failed=True).do(1, lambda kind, value: heard.append((kind, value)))
    assert [(kind, len(value)) for kind, value in heard if kind == "before"] == [("before", 4)]
    assert [kind for kind, _ in heard].count("run") == 4
    monkeypatch.setattr(experimenting.runs, "start", lambda runs, take: 1 / 0)
    experimenting.start()
    assert (len(found.outcomes), "division" in experimenting.faults["runs"]) == (8, True)
    begun = []
    monkeypatch.setattr(experimenting.runs, "start", lambda runs, take: begun.append(runs))
    experimenting.start()
    assert [runs.retry_failed for runs in begun] == [True]
    assert (len(found.outcomes), found.failed) == (4, [])


def test_an_experiment_of_which_nothing_can_be_built_is_refused_with_the_reason(experimenting):
    choose(experimenting, q_values="7, 8")
    experimenting.start()
    assert "noise is 7" in experimenting.faults["runs"]
    assert (experimenting.runs.running, experimenting.grid) == (False, None)


def test_too_many_runs_settings_values_seeds_and_steps_are_refused(experimenting):
    experimenting.set("seeds", "1000")
    experimenting.space("values", "1", "50", "11")
    assert (
        experimenting.faults["runs"] == "number of runs is 11000; expected a whole number at least 1 and at most 10000"
    )
    experimenting.start()
    assert not experimenting.runs.running
    experimenting.set("seeds", "1")
    assert "runs" not in experimenting.faults
    experimenting.set("q", "noise")
    experimenting.space("values", "1", "50", "50")
    experimenting.space("q_values", "0", "1", "100")
    assert "number of settings is 5000" in experimenting.faults["runs"]
    picture_of(experimenting)
    for name, text, words in [
        ("seeds", "1001", "at most 1000"),
        ("steps", "200001", "at most 200000"),
        ("steps", "many", "expected a whole number"),
        ("values", "2, 2", "has 2 twice"),
        ("values", "", "expected a whole number"),
        ("values", "2, 20000", "at most 10000"),
        ("q", "n_robots", "is varied already"),
        ("measure", "happiness", "unknown measure"),
    ]:
        experimenting.set(name, text)
        assert words in experimenting.faults[name], (name, text)
        experimenting.faults.clear()
    experimenting.space("values", "a", "2", "3")
    assert experimenting.faults["values"] == "from is 'a'; expected a number"
    experimenting.space("values", "1", "2", "101")
    assert "at most 100" in experimenting.faults["values"]


def test_values_are_spaced_ticked_and_typed_as_the_parameters_type():
    count, share = Parameter("count", 3, int, Slider(0, 10, 1)), Parameter("share", 0.5, float, Slider(0, 1, 0.1))
    assert space_values(count, 0, 4, 3) == [0, 2, 4]
    assert space_values(share, 0, 0.3, 4) == [0.0, 0.1, 0.2, 0.3]
    assert space_values(share, 0.5, 1, 1) == [0.5]
    assert usual_values(Parameter("flag", True, bool, None), []) == [False, True]
    assert usual_values(Parameter("rule", "a", str, Choice(("a", "b"))), []) == ["a", "b"]
    assert usual_values(Parameter("note", "", str, None), []) == [""]
    assert checked_values(Parameter("flag", True, bool, None), ["True"], []) == [True]
    with pytest.raises(InvalidValueError, match="is empty"):
        checked_values(Parameter("size", None, str, None), ["None"], [])


def test_results_are_of_what_was_started_whatever_is_chosen_later(experimenting, session, tmp_path):
    choose(experimenting)
    done_here(experimenting, tmp_path)
    before = picture_of(experimenting)
    assert before["stale"] == ""
    experimenting.set("measure", "sum of fires_burning")
    assert picture_of(experimenting)["stale"] == ""
    assert picture_of(experimenting)["title"] == "sum of fires_burning: mean over seeds, by robots and noise"
    experimenting.set("measure", "fires out")
    experimenting.set("seeds", "3")
    after = picture_of(experimenting)
    assert after == {**before, "stale": STALE}
    assert experimenting.next_action() == ("Run 12 runs", True)
    experimenting.set("seeds", "2")
    session.set_parameter("slip", 0.2)
    assert picture_of(experimenting)["stale"] == STALE
    assert "slip 0.1" in picture_of(experimenting)["about"]
    experimenting.set("model", "boids")
    assert picture_of(experimenting)["cells"] == before["cells"]


def test_a_cell_has_the_mean_with_a_bootstrap_interval_or_the_share_with_wilsons(experimenting):
    experimenting.set("values", "2, 3")
    experimenting.set("seeds", "3")
    found = experimenting.preview()
    times = [10.0, None, 20.0, None, None, None]
    for number, time in enumerate(times):
        found.take((number, Outcome(results={"all fires out at": time})))
    first, second = found.cells("all fires out at", MEAN)
    assert (first.interval.estimate, first.counted, first.done, second.counted) == (15.0, 2, 3, 0)
    assert math.isnan(second.interval.estimate)
    first, second = found.cells("all fires out at", SHARE)
    assert (first.interval.estimate, second.interval.estimate, second.counted) == (2 / 3, 0.0, 3)
    experimenting.grid = found
    assert [cell[3] for cell in picture_of(experimenting)["cells"]] == ["67 % [21-94 %]", "0 % [0-56 %]"]
    experimenting.set("summary", MEAN)
    note = picture_of(experimenting)["note"]
    assert note.startswith("Means over n = 3 seeds at each setting, 95 % intervals (bootstrap, BCa). Fewer than 6")
    assert note.endswith("Runs in which it did not occur are left out.")


def test_a_cell_opens_its_setting_on_watch_with_the_first_seed(experimenting, session, tmp_path):
    choose(experimenting)
    opened = []
    session.adopted.add(lambda: opened.append(session.name))
    experimenting.watch(3)
    assert opened == []
    done_here(experimenting, tmp_path)
    PictureLink(ExperimentPicture(), experimenting).act({"do": "watch", "value": 3})
    assert opened == ["fire_fighting"]
    assert (len(session.model.swarm), session.settings["noise"], session.settings["slip"], session.seed) == (
        3,
        0.3,
        0.1,
        1,
    )
    experimenting.watch(4)
    assert len(opened) == 1


def test_the_panel_carries_out_messages(experimenting):
    widget = ControlPanel()
    panel = ExperimentPanel(widget, experimenting)
    kinds = [field["kind"] for group in widget.groups for field in group["fields"]]
    assert kinds == ["choice", "choice", "span", "choice", "slider", "text", "choice", "choice"]
    panel.act({"do": "choose", "name": "q", "value": "strategy"})
    panel.act({"do": "tick", "name": "q_values", "value": ["B"]})
    panel.act({"do": "span", "name": "values", "value": ["2", "6", "3"]})
    assert experimenting.varied == {"n_robots": [2, 4, 6], "strategy": ["B"]}
    assert widget.values["values"]["span"] == ["2", "6", "3"]
    assert widget.values["q_values"]["ticked"] == ["B"]
    panel.act({"do": "tick", "name": "q_values", "value": []})
    assert widget.values["q_values"]["fault"]
    panel.act({"do": "text", "name": "q_values", "value": "A"})
    panel.act({"do": "choose", "name": "measure", "value": "robots_at_fires (each step)"})
    assert experimenting.measure == "mean of robots_at_fires"
    panel.act({"do": "choose", "name": "reduction", "value": "maximum"})
    panel.act({"do": "choose", "name": "measure", "value": "fires_burning (each step)"})
    assert experimenting.measure == "maximum of fires_burning"
    panel.act({"do": "place", "name": "seeds", "value": 7})
    panel.act({"do": "text", "name": "steps", "value": "50"})
    assert (experimenting.seeds, experimenting.steps, experimenting.faults) == (7, 50, {})
    panel.act({"do": "choose", "name": "q", "value": "(no other)"})
    panel.act({"do": "choose", "name": "p", "value": "map"})
    assert (experimenting.q, widget.groups[0]["fields"][2]["kind"]) == ("", "ticks")
    panel.close()


def test_the_model_is_that_of_watch_until_another_is_chosen(experimenting, session):
    session.choose("boids")
    experimenting.follow()
    assert experimenting.name == "boids"
    experimenting.set("model", "foraging")
    session.choose("agglomeration")
    experimenting.follow()
    assert experimenting.name == "foraging"


def test_the_choices_as_words_are_read_back_by_another_page(experimenting):
    choose(experimenting, q_values="0.123456789, 0.5", measure="maximum of robots_at_fires")
    other = Session("boids")
    read = other.companion(Experimenting)
    for name, text in experimenting.words().items():
        read.set(name, text)
    assert (read.faults, read.words(), read.varied) == ({}, experimenting.words(), experimenting.varied)
    read.set("q", "")
    assert list(read.words()) == ["model", "p", "values", "seeds", "steps", "measure"]
    read.set("colour", "red")
    assert "unknown choice 'colour'" in read.faults["colour"]
    other.close()


def test_files_are_sent_under_names_of_the_experiment(experimenting, tmp_path):
    widget, sent = ExperimentPicture(), []
    link = PictureLink(widget, experimenting)
    widget.send = lambda message, buffers: sent.append((message["name"], bytes(buffers[0])))
    link.act({"do": "csv"})
    assert sent == []
    choose(experimenting)
    done_here(experimenting, tmp_path)
    link.act({"do": "csv"})
    link.act({"do": "job"})
    assert [name for name, _ in sent] == ["experiment_fire_fighting.csv", "experiment_fire_fighting.toml"]
    path = tmp_path / "job.toml"
    path.write_bytes(sent[1][1])
    (read,) = read_job(path).experiments
    assert (len(read), read.steps, read.settings) == (8, 5, {"slip": 0.1})
    assert widget.picture["command"] == "mesa-swarm sweep experiment_fire_fighting.toml"
    link.close()


def test_a_job_text_reads_back_as_what_it_was_made_from(tmp_path):
    grid = {"n_robots": [1, 2], "noise": [0.1, 1e-05]}
    text = job_text(
        "fire_fighting", ["About it."], steps=7, seeds=3, parameters={"strategy": "B"}, grid=grid, measure=[]
    )
    (tmp_path / "job.toml").write_text(text)
    (read,) = read_job(tmp_path / "job.toml").experiments
    assert list(read.points) == [{"n_robots": n, "noise": noise} for n in (1, 2) for noise in (0.1, 1e-05)]
    assert (read.steps, list(read.seeds), read.settings, read.measures) == (7, [1, 2, 3], {"strategy": "B"}, ())
    with pytest.raises(InvalidValueError, match="no place in a job file"):
        job_text("fire_fighting", grid={"n_robots": [None]})


def test_reports_are_measures_of_a_sweep_and_an_unknown_one_is_refused(tmp_path):
    made = sweep(
        "boids",
        {"n_robots": [3]},
        seeds=2,
        steps=20,
        out=tmp_path,
        jobs=1,
        measure=["mean of polarization", "alignment"],
    )
    frame = made.frame()
    assert frame["mean of polarization"].between(0, 1).all()
    assert list(frame.columns[-3:]) == ["mean of polarization", "alignment", "error"]
    with pytest.raises(ValueError, match="unknown report of Boids 'happiness'"):
        sweep("boids", seeds=1, steps=20, out=tmp_path, jobs=1, measure=["mean of happiness"])
    more = sweep("boids", {"n_robots": [3]}, seeds=2, steps=20, out=tmp_path, jobs=1, measure=["sum of polarization"])
    assert more.done_before == 0


@pytest.mark.slow
def test_the_runs_in_the_background_are_stopped_and_go_on(experimenting):
    choose(experimenting, values="2, 5, 10, 20", seeds="10", steps="300")
    experimenting.start()
    wait_until(lambda: experimenting.runs.done >= 3)
    experimenting.stop()
    found = experimenting.grid
    stopped = len(found.outcomes)
    assert (experimenting.runs.running, experimenting.runs.error, 3 <= stopped < 80) == (False, "", True)
    assert "at the last pace" in experimenting.size_in_words()
    folder = Path(experimenting._folder.name)
    experimenting.start()
    wait_until(lambda: not experimenting.runs.running)
    assert (experimenting.runs.error, experimenting.grid is found, found.is_complete) == ("", True, True)
    assert experimenting.runs.before >= stopped
    experimenting.session.close()
    assert not folder.exists()


def test_an_error_of_the_process_is_shown(experimenting, monkeypatch, tmp_path):
    choose(experimenting)
    sent = []
    found = experimenting._results(experimenting._experiment())
    (tmp_path / "ledger.jsonl").write_text("another file\n")
    do_task(GridRuns(found.experiment, tmp_path), 1, lambda kind, value: sent.append((kind, value)))
    assert sent[-1][0] == "error"
    assert "is not a ledger" in sent[-1][1]
    monkeypatch.setattr(experimenting_module, "GridRuns", lambda *_, **__: 1 / 0)
    experimenting.start()
    assert "ZeroDivisionError" in experimenting.faults["runs"]
