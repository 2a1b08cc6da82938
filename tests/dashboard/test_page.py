"""The page without a browser: what stands on cards and in the address bar, and where the buttons lead."""

from threading import Event

import ipyvuetify
import pytest
import solara
from anywidget import AnyWidget

from mesa_swarm.dashboard import app
from mesa_swarm.dashboard.app import Places
from mesa_swarm.dashboard.page.controls import ControlPanel
from mesa_swarm.dashboard.page.navigation import Navigation, PageBar
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import FilePicker
from mesa_swarm.dashboard.run.charts import ChartBoard
from mesa_swarm.dashboard.run.exporting import Exporter
from mesa_swarm.dashboard.run.inspector import Inspector
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.viewing.canvas_widget import SwarmCanvas


@pytest.fixture
def session():
    session = Session("fire_fighting", {"n_robots": 4}, seed=3)
    yield session
    session.close()


@pytest.fixture
def drawn():
    """Return what draws a component; all are taken from the page in the end."""
    contexts = []

    def draw(element):
        _, context = solara.render(element, handle_error=False)
        contexts.append(context)
        return context

    yield draw
    for context in contexts:
        context.close()


def texts(context, tag: str) -> list[str]:
    return [widget.children[0] for widget in context.find(ipyvuetify.Html, tag=tag).widgets]


def press(context) -> str:
    """Press the button of the card; return what stood on it."""
    button = context.find(ipyvuetify.Btn).widget
    label = button.children[0]
    button.click()
    return label


def test_settings_that_cannot_be_built_are_distinguished_from_a_model_that_stopped(session, drawn, monkeypatch):
    page = drawn(app.SessionFault(session, ()))
    assert texts(page, "h2") == []
    session.settings["n_robots"] = 9999
    session.reset()
    assert texts(page, "h2") == ["These settings cannot be built"]
    assert press(page) == "Back to the last settings"
    assert (texts(page, "h2"), session.settings["n_robots"], session.error) == ([], 4, "")
    monkeypatch.setattr(FireFighting, "step", lambda model: 1 / 0)
    session.step()
    assert texts(page, "h2") == ["The model stopped"]
    assert press(page) == "Reset"
    assert (texts(page, "h2"), session.error) == ([], "")


def test_a_link_that_cannot_be_built_leads_to_the_defaults(drawn):
    session = Session("fire_fighting", {"k1": -5.0})
    page = drawn(app.SessionFault(session, ()))
    assert texts(page, "h2") == ["These settings cannot be built"]
    assert press(page) == "Back to the defaults"
    assert (texts(page, "h2"), session.model.steps) == ([], 0)
    session.close()


def test_all_faults_of_a_link_are_shown_until_the_user_continues(session, drawn):
    session.note = "step 3 of 20,000"
    page = drawn(app.SessionFault(session, ("unknown foo", "unknown bar")))
    assert texts(page, "p") == ["unknown foo", "unknown bar", "step 3 of 20,000"]
    assert press(page) == "Continue"
    assert texts(page, "p") == []


def test_the_address_bar_holds_a_run_that_was_built_elsewhere(drawn):
    navigation = Navigation("model=fire_fighting&n_robots=4&seed=3", "boids", app.COMPANIONS)
    session = navigation.session
    bar = drawn(app.Header(navigation)).find(PageBar).widget
    assert bar.shown["query"] == "model=fire_fighting&n_robots=4&seed=3"
    settings = session.settings | {"strategy": "A", "n_robots": 10}
    session.adopt(FireFighting(strategy="A", rng=5).run(2), "fire_fighting", settings, 5)
    assert bar.shown["query"] == "model=fire_fighting&strategy=A&seed=5&changed=yes"
    navigation.close()


def test_the_place_of_a_page_whose_session_is_closed_is_taken_again():
    places, first, second = Places(1), Event(), Event()
    assert places.take(first)
    assert places.take(first)  # a page that is drawn anew keeps its place
    assert not places.take(second)
    first.set()
    assert places.take(second)


@pytest.mark.parametrize("widget", [SwarmCanvas, FilePicker, ChartBoard, ControlPanel, Exporter, Inspector, PageBar])
def test_a_widget_replaces_no_method_of_ipywidgets(widget):
    own = {name for kind in widget.__mro__ if kind.__module__.startswith("mesa_swarm") for name in vars(kind)}
    methods = {name for name in own if callable(getattr(AnyWidget, name, None)) and not name.startswith("_")}
    assert methods == set()
