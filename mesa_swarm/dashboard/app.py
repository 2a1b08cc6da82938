# ruff: noqa: N802 - Solara's components are named like classes
"""The page: tabs, the panel of controls, and a world that one can play.

Every browser session builds its own `Session`, and closes it when the page is closed; nothing is shared between them.
"""

import os
from collections.abc import Callable

import solara
import solara.lab
from reacton import ipyvuetify as rv
from solara.server import settings

from mesa_swarm.dashboard import FIRST, MODEL_VARIABLE
from mesa_swarm.dashboard.address import address_from, query_of
from mesa_swarm.dashboard.buttons import TroubleCard
from mesa_swarm.dashboard.canvas_widget import SwarmCanvas, use_connection
from mesa_swarm.dashboard.charts import Charts
from mesa_swarm.dashboard.compare_view import Compare
from mesa_swarm.dashboard.controls import ControlPanel, Panel
from mesa_swarm.dashboard.export_view import ExportView
from mesa_swarm.dashboard.gallery_view import Gallery, title
from mesa_swarm.dashboard.inspector import InspectorView
from mesa_swarm.dashboard.listeners import use_changes
from mesa_swarm.dashboard.page_bar import PageBar
from mesa_swarm.dashboard.places import Places
from mesa_swarm.dashboard.replay_view import Replay
from mesa_swarm.dashboard.scripts import text_of
from mesa_swarm.dashboard.session import Session
from mesa_swarm.gallery import description

CSS = text_of("style.css")
WATCH, MODELS = "Watch", "Models"
CANVAS = {"bar": True, "keys": "page", "toggles": {}}
# What stands beside the canvas, from top to bottom: components that are given the session.
BESIDE: tuple = (InspectorView, Charts, ExportView)
# More tabs: names, and components that are given the session.
MORE_TABS: dict = {"Compare": Compare, "Replay": Replay}

PLACES = Places()

# Of itself Solara reports its use, has the browser ask solara.dev whether it works, and keeps a page that vanished
# without a word (its model plays on) for a day.
settings.telemetry.mixpanel_enable = False
settings.main.mode = "production"
settings.kernel.cull_timeout = "10m"
settings.theme.show_banner = False


@solara.component
def Layout(children: list) -> None:
    """Show the page and nothing else: no bar of Solara's above it."""
    solara.Div(children=children)


@solara.component
def Page() -> None:
    """Show the page, if there is a place for one more."""
    leave = solara.use_memo(PLACES.take, [])
    solara.use_effect(lambda: leave, [])
    solara.Title("mesa_swarm")
    solara.Style(CSS)
    with rv.Html(tag="main", class_="swarm"):
        if leave is None:
            Full()
        else:
            Room()


@solara.component
def Full() -> None:
    """Show that too many pages are open."""
    TroubleCard(
        "No place left",
        f"{PLACES.most} pages of this dashboard are open, and each has a model of its own.",
        "Close one that nobody needs, wait a minute, and load this page again.",
    )


@solara.component
def Room() -> None:
    """Show what the address asks for."""
    search = solara.use_router().search
    asked = solara.use_memo(lambda: address_from(search, os.environ.get(MODEL_VARIABLE, FIRST)), [])
    session = solara.use_memo(lambda: Session(asked.model, asked.wishes, asked.seed, asked.steps), [])
    tab, choose_tab = solara.use_state(WATCH)
    solara.use_effect(lambda: session.close, [])
    solara.use_effect(lambda: session.adopted.add(lambda: choose_tab(WATCH)), [])

    def choose_model(name: str) -> None:
        session.choose(name)
        choose_tab(WATCH)

    with solara.Div(classes=["swarm-room"]):
        Header(session, tab, choose_tab)
        if tab == MODELS:
            Gallery(session.name, choose_model)
        elif tab in MORE_TABS:
            MORE_TABS[tab](session)
        else:
            Watch(session, asked.faults)


@solara.component
def Header(session: Session, tab: str, choose_tab: Callable[[str], None]) -> None:
    """Show the name, the tabs and the switch between light and dark."""
    use_changes(session.changed)
    with rv.Html(tag="header", class_="swarm-header"):
        solara.HTML(tag="h1", unsafe_innerHTML="mesa_swarm")
        with rv.Html(tag="nav", attributes={"aria-label": "Pages"}):
            for name in (WATCH, MODELS, *MORE_TABS):
                Tab(name, name == tab, choose_tab).key(name)
        shown = rv.Html(tag="b", children=[title(session.name)])
        rv.Html(tag="p", children=[shown, f" {description(session.model_class)}"])
        PageBar.element(query=query_of(session), on_dark=lambda dark: setattr(solara.lab.theme, "dark", dark))


@solara.component
def Tab(name: str, chosen: bool, choose_tab: Callable[[str], None]) -> None:
    """Show one tab as a button."""
    about = {"type": "button", "aria-current": "page"} if chosen else {"type": "button"}
    button = rv.Html(tag="button", children=[name], attributes=about)
    rv.use_event(button, "click", lambda *_: choose_tab(name))


@solara.component
def Watch(session: Session, faults: tuple[str, ...]) -> None:
    """Show the controls on the left, the world in the middle, and what tells of it on the right."""
    classes = ["swarm-watch", "swarm-beside"] if BESIDE else ["swarm-watch"]
    with solara.Div(classes=classes):
        Controls(session)
        with solara.Div(classes=["swarm-middle"]):
            Trouble(session, faults)
            World(session)
        if BESIDE:
            with solara.Div(classes=["swarm-side"]):
                for component in BESIDE:
                    component(session)


@solara.component
def Controls(session: Session) -> None:
    """Show the panel of controls."""
    panel = ControlPanel.element()
    solara.use_effect(lambda: Panel(solara.get_widget(panel), session).close, [])


@solara.component
def World(session: Session) -> None:
    """Show the canvas with its buttons."""
    use_connection(SwarmCanvas.element(options=CANVAS), session, session.reset)


@solara.component
def Trouble(session: Session, faults: tuple[str, ...]) -> None:
    """Show what went wrong in the model, or with the link, on a card."""
    use_changes(session.changed)
    left, leave = solara.use_state(False)
    told = (*faults, *filter(None, [session.note]))
    if session.error and session.unbuilt:
        way_out = "Back to the last settings" if session.built else "Back to the defaults", session.go_back
        TroubleCard("These settings cannot be built", session.error, way_out=way_out).key("unbuilt")
    elif session.error:
        TroubleCard("The model stopped", session.error, way_out=("Reset", session.reset)).key("error")
    elif told and not left:
        way_out = "Go on without it", lambda: leave(True)
        head = "On the way" if session.goal and not faults else "Not all of the link could be followed"
        TroubleCard(head, *told, way_out=way_out).key("fault")
