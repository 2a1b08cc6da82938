"""Own models on the page: from a file, and from an installed package; links import none."""

import sys

import pytest

from mesa_swarm.base.errors import UnknownNameError
from mesa_swarm.dashboard import MODEL_VARIABLE, check_page_model, launch, page_models
from mesa_swarm.dashboard.compare.compare_view import comparison_groups as compared_fields
from mesa_swarm.dashboard.compare.comparing import Comparing
from mesa_swarm.dashboard.experiment.experimenting import Experimenting
from mesa_swarm.dashboard.gallery.gallery_view import _drawing_thread, card_of, thumbnail, title
from mesa_swarm.dashboard.page.controls import control_groups, control_values
from mesa_swarm.dashboard.page.navigation import address_from, query_of
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.replay.replaying import Replaying
from mesa_swarm.experiments.jobs import read_job
from mesa_swarm.model.gallery import find_model
from support.own_models import BARE, install_package, write_model
from support.waiting import threads

ADDRESS = "./mine.py:Foraging"


@pytest.fixture(autouse=True)
def folder(model_folder, monkeypatch):
    """Work in an empty folder with a page that was started with one of its models."""
    monkeypatch.setenv(MODEL_VARIABLE, ADDRESS)
    write_model(model_folder)
    return model_folder


def test_the_page_shows_the_model_that_it_was_started_with():
    assert page_models()[-1] == ADDRESS
    assert title(ADDRESS) == "Foraging"
    assert "<svg" in thumbnail(ADDRESS)


def test_a_model_without_a_shipped_picture_has_a_card_at_once_and_its_picture_later():
    card, arrived = card_of(ADDRESS), []
    assert (card["title"], card["still"], card["moving"]) == ("Foraging", "", "")
    stop = _drawing_thread([ADDRESS], arrived.append)
    for thread in threads("gallery"):
        thread.join(60)
    stop()
    assert arrived == [{ADDRESS: thumbnail(ADDRESS)}]


def test_a_link_has_the_address_and_leads_to_the_same_run():
    session = Session(ADDRESS, {"n_robots": 4}, seed=7)
    linked = address_from(query_of(session), ADDRESS)
    assert (linked.model, linked.settings, linked.seed, linked.faults) == (ADDRESS, {"n_robots": 4}, 7, ())
    session.close()


def test_a_link_to_another_file_imports_nothing_and_is_refused(folder):
    (folder / "other.py").write_text("raise SystemExit('imported')\n")
    linked = address_from("model=./other.py:A&n_robots=3", ADDRESS)
    assert linked.model == ADDRESS
    assert linked.faults == (
        "model './other.py:A' was not given to this dashboard, and a link imports none; "
        "start it with: mesa-swarm dashboard ADDRESS",
    )
    assert "other" not in sys.modules
    with pytest.raises(UnknownNameError, match="a link imports none"):
        check_page_model("antigravity:A")


def test_a_wrong_address_is_refused_before_the_page_is_served(monkeypatch):
    monkeypatch.setattr("mesa_swarm.dashboard._serve", pytest.fail)
    with pytest.raises(UnknownNameError, match="no such file"):
        launch("./nothing.py:A")


def test_an_installed_model_is_on_the_page_and_a_spoilt_one_is_not(folder, monkeypatch):
    install_package(folder / "site", {"ant_hill": "anthill.trails:AntTrails", "spoilt": "anthill.nothing:A"})
    monkeypatch.syspath_prepend(str(folder / "site"))
    assert {"ant_hill", ADDRESS} < set(page_models())
    assert "spoilt" not in page_models()
    session = Session("ant_hill")
    assert session.model.steps == 0
    session.close()


def test_a_bare_model_has_inputs_and_compares_what_every_model_has(folder, monkeypatch):
    (folder / "bare.py").write_text(BARE)
    monkeypatch.setenv(MODEL_VARIABLE, "./bare.py:Bare")
    session = Session("./bare.py:Bare")
    assert session.error == ""
    fields = [field for group in control_groups(session) for field in group["fields"]]
    assert {field["name"]: field["kind"] for field in fields} == {
        "n_robots": "text", "flag": "choice", "note": "text",
        "noise": "slider", "slip": "slider", "imperfections": "slider",
    }  # fmt: skip
    session.set_parameter("flag", "False")
    session.set_parameter("n_robots", "3")
    session.reset()
    assert (session.settings["flag"], len(session.model.swarm)) == (False, 3)
    assert control_values(session)["flag"]["text"] == "False"
    comparing = Comparing(session)
    assert (comparing.name, comparing.parameter, comparing.faults) == ("./bare.py:Bare", "noise", {})
    comparing.close()
    session.close()


def test_a_recording_of_the_page_s_own_model_can_be_continued(folder):
    model = find_model(ADDRESS)(n_robots=3, rng=5)
    with model.record("run.arrow"):
        model.run(6)
    session = Session("boids")
    replaying = session.companion(Replaying)
    replaying._open(folder / "run.arrow", "run.arrow")
    assert replaying.model_shown == ADDRESS
    assert replaying.parameters == {"n_robots": 3, "noise": 0.0, "slip": 0.0, "imperfections": 0.0}
    session.close()


@pytest.mark.slow
def test_runs_of_a_comparison_on_the_page_are_those_of_the_file():
    session = Session(ADDRESS)
    comparing = Comparing(session)
    assert (comparing.name, comparing.values) == (ADDRESS, [2, 3])
    comparing.set_count("seeds", 2)
    comparing.set_count("steps", 5)
    comparing.start()
    assert comparing.faults == {}
    for thread in threads("many runs"):
        thread.join(60)
    assert comparing.runs.error == ""
    assert comparing.runs.report is not None
    session.close()
    comparing.close()


@pytest.mark.slow
def test_an_experiment_with_a_model_of_a_file_has_a_job_for_the_folder_of_the_file(folder, monkeypatch):
    address = f"{folder}/bare.py:Bare"
    (folder / "bare.py").write_text(BARE)
    monkeypatch.setenv(MODEL_VARIABLE, address)
    session = Session(address)
    experimenting = session.companion(Experimenting)
    assert (experimenting.faults, experimenting.measure) == ({}, "final value of collisions")
    for name, text in {"p": "n_robots", "values": "2, 3", "q": "flag", "seeds": "2", "steps": "5"}.items():
        experimenting.set(name, text)
    experimenting.start()
    assert experimenting.faults == {}
    for thread in threads("many runs"):
        thread.join(60)
    found = experimenting.grid
    assert [cell.counted for cell in found.cells(experimenting.measure, "mean")] == [2, 2, 2, 2]
    name, content = found.job_file(experimenting.measure)
    assert str(folder).encode() not in content
    (folder / name).write_bytes(content)
    (read,) = read_job(folder / name).experiments
    assert {run.key for run in read.runs()} == {run.key for run in found.experiment.runs()}
    session.close()


def test_a_parameter_without_a_slider_is_compared_if_the_model_names_it(folder, monkeypatch):
    (folder / "bare.py").write_text(BARE + '    compares = "n_robots", (2, 5)\n')
    monkeypatch.setenv(MODEL_VARIABLE, "./bare.py:Bare")
    session = Session("./bare.py:Bare")
    comparing = Comparing(session)
    assert (comparing.name, comparing.parameter, comparing.values) == ("./bare.py:Bare", "n_robots", [2, 5])
    assert [len(side.model.swarm) for side in comparing.pair.sides] == [2, 5]
    comparing.set_value("B", "7")
    comparing.reset()
    assert [len(side.model.swarm) for side in comparing.pair.sides] == [2, 7]
    assert [field["kind"] for field in compared_fields(comparing)[0]["fields"]] == ["choice", "choice", "text", "text"]
    comparing.close()
    session.close()
