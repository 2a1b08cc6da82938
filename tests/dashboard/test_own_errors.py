"""Errors of a user's model on the page: one line with file and line there, and one traceback in the terminal."""

from copy import deepcopy

import ipyvuetify
import pytest
import solara

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.dashboard import MODEL_VARIABLE, app
from mesa_swarm.dashboard.compare.comparing import Comparing
from mesa_swarm.dashboard.experiment.experiment_results import describe_failed_run
from mesa_swarm.dashboard.experiment.experimenting import Experimenting
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.replay.replay_view import Replay
from mesa_swarm.dashboard.replay.replaying import Replaying
from mesa_swarm.dashboard.run.charts import ChosenChart, TimeContent
from mesa_swarm.model.gallery import find_model
from mesa_swarm.viewing.canvas_widget import SwarmCanvas
from mesa_swarm.viewing.error_lines import reported
from support.own_models import write_model
from support.waiting import wait_until

# One mistake by its name; the error arises in line 9 of the file, within a function that the mistake calls.
MISTAKES = """
from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.model.looks import Chart, Looks

MISTAKE = {mistake!r}

def wrong(*_):
    scores = dict()
    return scores[MISTAKE]

class Mine(SwarmModel):
    looks = Looks(
        label=wrong if MISTAKE == "label" else None,
        charts=(Chart("score", wrong),) if MISTAKE == "chart" else (),
        panels=(wrong,) if MISTAKE == "panel" else (),
    )

    def __init__(self, *, n_robots: int = 3, rng=None):
        reporters = {{"score": wrong}} if MISTAKE == "reporter" else {{}}
        super().__init__(rng=rng, model_reporters=reporters)
        self.add_robots(AGENT9, n_robots)
        if MISTAKE == "constructor":
            wrong()

    def step(self):
        super().step()
        if MISTAKE == "step":
            wrong()

    def results(self):
        return {{"score": wrong() if MISTAKE == "results" else 1.0}}
"""
PLACE = "of_{0}.py, line 9: KeyError: '{0}'"


@pytest.fixture
def own(model_folder, monkeypatch):
    """Write the file of a mistake, and return the address of its model, which the page was started with."""

    def address(mistake: str) -> str:
        (model_folder / f"of_{mistake}.py").write_text(MISTAKES.format(mistake=mistake), encoding="utf-8")
        monkeypatch.setenv(MODEL_VARIABLE, f"./of_{mistake}.py:Mine")
        return f"./of_{mistake}.py:Mine"

    return address


def tracebacks(capfd) -> list[str]:
    """Return the line of each mistake in the tracebacks of the terminal."""
    return [line for line in capfd.readouterr().err.splitlines() if line.startswith(("KeyError", "ZeroDivisionError"))]


@pytest.mark.parametrize("mistake", ["step", "reporter", "label"])
def test_an_error_in_an_own_model_has_file_and_line_and_its_traceback_is_printed_once(own, capfd, mistake):
    session = Session(own(mistake))
    for _ in range(3):
        session.reset()
        session.step()
    assert session.error.startswith(f"of_{mistake}.py, line 9: ")
    assert repr(mistake) in session.error
    session.close()
    assert tracebacks(capfd) == [f"KeyError: {mistake!r}"]


def test_the_model_that_cannot_be_built_is_reported_with_its_place(own, capfd):
    session = Session(own("constructor"))
    assert (session.error, session.unbuilt) == (PLACE.format("constructor"), True)
    assert tracebacks(capfd) == ["KeyError: 'constructor'"]
    comparing = Comparing(session)
    assert comparing.faults["worlds"] == PLACE.format("constructor")
    assert tracebacks(capfd) == []
    comparing.close()
    session.close()


def test_a_chart_whose_function_fails_states_in_which_step_and_where(own, capfd):
    session = Session(own("chart"))
    for _ in range(3):
        session.step()
    assert session.error == ""
    fault = f"no number in step 3: {PLACE.format('chart')}"
    assert session.series.faults == {"own score": fault}
    about, _ = TimeContent.of(session.series, ChosenChart("over time", "own score")).message()
    assert about["note"] == fault
    assert tracebacks(capfd) == ["KeyError: 'chart'"]
    find_model("./of_chart.py:Mine").looks.charts[0].source.__globals__["wrong"].__code__ = (lambda *_: 2.0).__code__
    session.step()
    assert session.series.rows("own score")[1].ravel().tolist()[3:] == [2.0]
    assert session.series.faults == {"own score": fault}, "the gap is still there"
    session.reset()
    assert session.series.faults == {}
    session.close()


def test_a_panel_that_fails_states_where(own, capfd):
    session = Session(own("panel"))
    _, context = solara.render(app.OwnPanels(session), handle_error=False)
    session.step()
    texts = [widget.children[0] for widget in context.find(ipyvuetify.Html, tag="p").widgets]
    context.close()
    session.close()
    assert texts == [PLACE.format("panel")]
    assert tracebacks(capfd) == ["KeyError: 'panel'"]


def test_results_that_fail_state_where_on_the_experiment_tab(own, capfd):
    session = Session(own("results"))
    experimenting = session.companion(Experimenting)
    assert experimenting.faults["measure"] == PLACE.format("results")
    assert tracebacks(capfd) == ["KeyError: 'results'"]
    session.close()


@pytest.mark.slow
def test_runs_of_an_experiment_that_fail_state_where_and_print_one_traceback(own, capfd):
    session = Session(own("step"))
    experimenting = session.companion(Experimenting)
    experimenting.set("steps", "2")
    experimenting.set("seeds", "3")
    capfd.readouterr()
    experimenting.start()
    wait_until(lambda: not experimenting.runs.running, 120)
    errors = set(experimenting.grid.errors().values())
    session.close()
    assert errors == {PLACE.format("step")}
    assert tracebacks(capfd) == ["KeyError: 'step'"]


@pytest.mark.slow
def test_a_comparison_over_many_seeds_that_fails_states_where_although_it_failed_in_another_process(own, capfd):
    session = Session(own("step"))
    comparing = Comparing(session)
    comparing.choose_parameter("noise")
    comparing.set_count("steps", 2)
    capfd.readouterr()
    comparing.start()
    wait_until(lambda: not comparing.runs.running, 120)
    assert comparing.runs.error == PLACE.format("step")
    comparing.close()
    session.close()
    assert tracebacks(capfd) == ["KeyError: 'step'"]


def test_the_first_of_many_processes_prints_the_traceback_of_a_run(tmp_path, capfd):
    try:
        raise ZeroDivisionError("division by zero")
    except ZeroDivisionError as problem:
        lines = {describe_failed_run(tmp_path, problem) for _ in range(5)}
    (line,) = lines
    assert line.startswith("test_own_errors.py, line ")
    assert line.endswith(": ZeroDivisionError: division by zero")
    assert tracebacks(capfd) == ["ZeroDivisionError: division by zero"]


def test_a_setting_that_is_refused_prints_nothing(capfd):
    session = Session("boids")
    session.set_parameter("n_robots", -1)
    assert session.faults["n_robots"].startswith("n_robots is -1; expected")
    assert reported(InvalidValueError("n is 0; expected 1")) == "n is 0; expected 1"
    session.close()
    assert capfd.readouterr().err == ""


def test_a_player_in_a_notebook_is_given_the_line_to_show(own, monkeypatch):
    states = []
    monkeypatch.setattr(SwarmCanvas, "send", lambda self, message, buffers=None: states.append(deepcopy(message)))
    model = find_model(own("step"))(rng=1)
    view = model.show()
    view._hear({"do": "ready", "view": "a"})
    view.commands["step"]()
    shown = [message["state"]["error"] for message in states if "error" in message.get("state", {})]
    assert shown == ["", PLACE.format("step")]
    assert view.options["errors"], "it shows the error itself: no card stands beside it"


def test_the_replay_tab_opens_for_a_model_by_address(model_folder, monkeypatch):
    write_model(model_folder, "replayed_one.py")
    monkeypatch.setenv(MODEL_VARIABLE, "./replayed_one.py:Foraging")
    session = Session("./replayed_one.py:Foraging")
    replaying = session.companion(Replaying)
    assert (replaying.model_shown, replaying.parameters, replaying.words()) == ("", {}, {})
    _, context = solara.render(Replay(session), handle_error=False)
    context.close()
    session.close()
