"""The page: its address bar, theme, links, and places for sessions.

Every browser session builds its own `Session`, and closes it with the page; sessions share nothing.
"""

import math
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from urllib.parse import parse_qsl, urlencode

import anywidget
import solara
import solara.lab
import traitlets
from reacton import ipyvuetify as rv
from solara.server import settings

from mesa_swarm.dashboard import FIRST, MODEL_VARIABLE, check_page_model
from mesa_swarm.dashboard.charts import ChartBoard, Charting
from mesa_swarm.dashboard.compare_view import Compare
from mesa_swarm.dashboard.controls import ControlPanel, Panel
from mesa_swarm.dashboard.exporting import ExportDesk, Exporter
from mesa_swarm.dashboard.gallery_view import Gallery, title
from mesa_swarm.dashboard.info_view import Info
from mesa_swarm.dashboard.inspector import Inspecting, Inspector
from mesa_swarm.dashboard.replay_view import Replay
from mesa_swarm.dashboard.session import LARGEST_SEED, Session, checked_setting, whole_number
from mesa_swarm.dashboard.widgets import Button, Linked, TroubleCard
from mesa_swarm.errors import SwarmError, UnknownNameError, check_choice, in_words, unknown_name
from mesa_swarm.gallery import description, find_model
from mesa_swarm.looks import looks_of
from mesa_swarm.parameters import Parameter, parameters_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing import text_of
from mesa_swarm.viewing.canvas_widget import PlayerView
from mesa_swarm.viewing.palette import style_sheet
from mesa_swarm.viewing.play_loop import Listeners, use_changes
from mesa_swarm.viewing.player import PackedFrame
from mesa_swarm.world.map import builtin_maps

LONGEST = 4000
# More steps would take longer than a user waits for a link to open.
MOST_STEPS = 20_000
COUNTS = {"seed": LARGEST_SEED, "step": MOST_STEPS}
MOST_FAULTS = 5
# Shortest time between drawings of panels while the model is played, s.
EVERY = 0.5


@dataclass(frozen=True, kw_only=True, slots=True)
class Address:
    """The settings in a link."""

    model: str
    # Parameters that are not the model's defaults.
    settings: dict[str, Any] = field(default_factory=dict)
    seed: int = 1
    steps: int = 0
    # Why parts of the link were ignored.
    faults: tuple[str, ...] = ()


def address_from(query: str | None, first: str) -> Address:
    """Return the settings in a link's query; each invalid one is reported, and left out."""
    words = dict(parse_qsl((query or "")[:LONGEST]))
    words.pop("token", None)
    try:
        name = check_page_model(words.pop("model", first))
    except SwarmError as error:  # the settings of an unknown model cannot be checked
        return Address(model=first, faults=(str(error),))
    known, values, faults = parameters_of(find_model(name)), {}, []
    for word, text in words.items():
        try:
            values[word] = _value(name, known, word, text)
        except SwarmError as error:
            faults.append(str(error))
    seed, steps = values.pop("seed", 1), values.pop("step", 0)
    return Address(model=name, settings=values, seed=seed, steps=steps, faults=_first_few(faults))


def _value(model: str, known: dict[str, Parameter], word: str, text: str) -> Any:
    """Return the value of one setting in a link."""
    if word in COUNTS:
        return whole_number(word, text, maximum=COUNTS[word])
    if word not in known:
        raise UnknownNameError(unknown_name(f"parameter of {model}", word, known))
    # A link never names a file: opening a link from others must not make this machine read one.
    return check_choice("map", text, builtin_maps()) if word == "map" else checked_setting(known[word], text)


def _first_few(faults: list[str]) -> tuple[str, ...]:
    more = len(faults) - MOST_FAULTS
    return (*faults[:MOST_FAULTS], f"and {more} more") if more > 0 else tuple(faults)


def query_of(session: Session) -> str:
    """Return the query of a link to what a session shows, except for uploaded maps.

    Settings changed during the run are in it as if they had been set from the start.
    """
    words = {"model": session.name}
    for name, parameter in session.parameters.items():
        value = session.settings[name]
        if value != parameter.default and value not in session.uploads:
            words[name] = repr(value) if isinstance(value, float) else str(value)
    words["seed"] = str(session.seed)
    shown = session.past.shown
    if shown and session.straight and not session.playing and not session.waiting and 0 < shown.step <= MOST_STEPS:
        words["step"] = str(shown.step)
    return urlencode(words)


class PageBar(anywidget.AnyWidget):
    """A button that switches between light and dark; it also writes `query` into the address bar, without a reload."""

    _esm = """
    const KEY = "mesa_swarm.theme", WORDS = { auto: "as the system", light: "light", dark: "dark" };
    const NEXT = { auto: "dark", dark: "light", light: "auto" };
    const SIGNS = { auto: "\\u25D0", light: "\\u2600", dark: "\\u263E" };

    export default {
      render({ model, el }) {
        const system = matchMedia("(prefers-color-scheme: dark)");
        const button = document.createElement("button");
        button.type = "button";
        button.className = "swarm-theme";
        const choice = () => WORDS[localStorage.getItem(KEY)] ? localStorage.getItem(KEY) : "auto";
        const apply = () => {
          const dark = choice() === "auto" ? system.matches : choice() === "dark", page = el.closest(".v-application");
          button.textContent = SIGNS[choice()];
          button.title = `Theme: ${WORDS[choice()]}`;
          button.setAttribute("aria-label", button.title);
          for (const one of [page, document.getElementById("app")]) {
            one?.classList.toggle("theme--dark", dark);
            one?.classList.toggle("theme--light", !dark);
          }
          model.set("dark", dark);
          model.save_changes();
        };
        const write = () => history.replaceState(history.state, "", `${location.pathname}?${model.get("query")}`);
        button.addEventListener("click", () => (localStorage.setItem(KEY, NEXT[choice()]), apply()));
        system.addEventListener("change", apply);
        model.on("change:query", write);
        el.append(button);
        apply();
        if (model.get("query")) write();
        return () => (system.removeEventListener("change", apply), model.off("change:query", write));
      },
    };
    """
    query = traitlets.Unicode("").tag(sync=True)
    dark = traitlets.Bool(False).tag(sync=True)


MOST_PAGES = 40


class Places:
    """A limited number of places, each held by a page until its session is closed."""

    def __init__(self, most: int = MOST_PAGES) -> None:
        self.most = most
        self._holders: set[threading.Event] = set()
        self._lock = threading.Lock()

    def take(self, closed: threading.Event) -> bool:
        """Take a place until this event is set; return False if all are taken.

        The place does not depend on what the page does at its end: a panel that fails there keeps none.
        """
        with self._lock:
            self._holders = {holder for holder in self._holders if not holder.is_set()}
            if closed not in self._holders and len(self._holders) >= self.most:
                return False
            self._holders.add(closed)
            return True


CSS = style_sheet(".v-application", ".v-application.theme--dark") + text_of("dashboard/style.css", "dashboard/info.css")
WATCH, MODELS = "Watch", "Models"
# More tabs: names, and components that are called with the session.
MORE_TABS: dict = {"Compare": Compare, "Replay": Replay}

PLACES = Places()

# By default Solara reports its use, lets the browser contact solara.dev, and keeps the session of a page that
# disappeared without closing (its model plays on) for a day.
settings.telemetry.mixpanel_enable = False
settings.main.mode = "production"
settings.kernel.cull_timeout = "10m"
settings.theme.show_banner = False


@solara.component
def Layout(children: list) -> None:
    """Show the page only, without Solara's bar above it."""
    solara.Div(children=children)


@solara.component
def Page() -> None:
    """Show the page, if fewer than the largest number of pages are open."""
    has_place = solara.use_memo(lambda: PLACES.take(solara.kernel_closed_event()), [])
    solara.Title("mesa_swarm")
    solara.Style(CSS)
    with rv.Html(tag="main", class_="swarm"):
        if not has_place:
            TroubleCard(
                "Too many pages are open",
                f"{PLACES.most} pages of this dashboard are open, each with its own model.",
                "Close one, wait a minute, and load this page again.",
            )
        else:
            Room()


@solara.component
def Room() -> None:
    """Show the page with the settings of its address."""
    search = solara.use_router().search
    linked = solara.use_memo(lambda: address_from(search, os.environ.get(MODEL_VARIABLE, FIRST)), [])
    session = solara.use_memo(lambda: Session(linked.model, linked.settings, linked.seed, linked.steps), [])
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
            Watch(session, linked.faults)


@solara.component
def Header(session: Session, tab: str, choose_tab: Callable[[str], None]) -> None:
    """Show the name, the tabs and the switch between light and dark."""
    use_changes(session.changed)
    with rv.Html(tag="header", class_="swarm-header"):
        solara.HTML(tag="h1", unsafe_innerHTML="mesa_swarm")
        with rv.Html(tag="nav", attributes={"aria-label": "Pages"}):
            for name in (WATCH, MODELS, *MORE_TABS):
                Button(name, partial(choose_tab, name), current="page" if name == tab else "").key(name)
        shown = rv.Html(tag="b", children=[title(session.name)])
        rv.Html(tag="p", children=[shown, f" {description(session.model_class)}"])
        PageBar.element(query=query_of(session), on_dark=lambda dark: setattr(solara.lab.theme, "dark", dark))


@solara.component
def Watch(session: Session, faults: tuple[str, ...]) -> None:
    """Show the controls on the left, the world in the middle, and readings on the right."""
    with solara.Div(classes=["swarm-watch", "swarm-beside"]):
        Linked(ControlPanel, Panel, session)
        with solara.Div(classes=["swarm-middle"]):
            Trouble(session, faults)
            PlayerView(session, session.reset)
        with solara.Div(classes=["swarm-side"]):
            Info(session)
            Linked(Inspector, Inspecting, session)
            Linked(ChartBoard, Charting, session)
            OwnPanels(session)
            Linked(Exporter, ExportDesk, session)


class Beat:
    """Notifies when panels are to be drawn anew: after a change at rest, and now and then while a model is played."""

    ready = False  # panels alone need no picture

    def __init__(self, session: Session, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.changed = Listeners()
        self._session, self._clock, self._last = session, clock, -math.inf

    def begin(self) -> Callable[[], None]:
        """Notify from now on, until what is returned is called."""
        self._session.add_viewer(self)
        return partial(self._session.remove_viewer, self)

    def push(self, number: int, frame: PackedFrame) -> None:
        """Notify, if that is due."""
        if not self._session.playing or self._clock() - self._last >= EVERY:
            self._last = self._clock()
            if "mesa.visualization.utils" in sys.modules:  # components made for Mesa's SolaraViz listen to this
                counter = sys.modules["mesa.visualization.utils"].update_counter
                counter.set(counter.value + 1)
            self.changed.notify()


@solara.component
def OwnPanels(session: Session) -> None:
    """Show the panels that the model declares."""
    use_changes(session.changed)
    beat = solara.use_memo(lambda: Beat(session), [])
    solara.use_effect(beat.begin, [])
    panels = session.model.looks.panels if session.model is not None and looks_of(session.model) else ()
    for place, panel in enumerate(panels):
        with solara.Div(classes=["swarm-own"]):
            OwnPanel(panel, session, beat).key(f"{session.name} {place}")


@solara.component
def OwnPanel(panel: Callable[[SwarmModel], object], session: Session, beat: Beat) -> None:
    """Show one panel of the present model; what it raises is shown in its place."""
    use_changes(beat.changed)
    use_changes(session.changed)
    try:
        with session.lock:
            if session.model is not None:
                getattr(panel, "f", panel)(session.model)  # here, so that it is drawn anew with the same model
    except Exception as problem:  # a panel of a user's may raise anything
        TroubleCard("A panel of the model failed", in_words(problem))


@solara.component
def Trouble(session: Session, faults: tuple[str, ...]) -> None:
    """Show an error of the model or of the link on a card."""
    use_changes(session.changed)
    left, leave = solara.use_state(False)
    problems = (*faults, *filter(None, [session.note]))
    if session.error and session.unbuilt:
        way_out = "Back to the last settings" if session.built else "Back to the defaults", session.go_back
        TroubleCard("These settings cannot be built", session.error, way_out=way_out).key("unbuilt")
    elif session.error:
        TroubleCard("The model stopped", session.error, way_out=("Reset", session.reset)).key("error")
    elif problems and not left:
        way_out = "Continue", lambda: leave(True)
        head = "Still running" if session.goal and not faults else "Parts of the link were ignored"
        TroubleCard(head, *problems, way_out=way_out).key("fault")
