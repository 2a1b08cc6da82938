"""The page: its header and tabs, and places for sessions.

Every browser session builds its own `Session`, and closes it with the page; sessions share nothing.
"""

import math
import os
import sys
import threading
import time
from collections.abc import Callable
from functools import partial

import solara
import solara.lab
from reacton import ipyvuetify as rv
from solara.server import settings

from mesa_swarm.dashboard import FIRST, MODEL_VARIABLE
from mesa_swarm.dashboard.compare.compare_view import Compare
from mesa_swarm.dashboard.compare.comparing import Comparing
from mesa_swarm.dashboard.experiment.experiment_view import ExperimentTab
from mesa_swarm.dashboard.experiment.experimenting import Experimenting
from mesa_swarm.dashboard.gallery.gallery_view import Gallery, title
from mesa_swarm.dashboard.page.controls import ControlPanel, Panel
from mesa_swarm.dashboard.page.navigation import WATCH, Companions, Navigation, PageBar, PageLink
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import (
    LEFT,
    PRODUCT,
    RIGHT,
    Button,
    ColumnFold,
    Linked,
    ScreenButtons,
    TroubleCard,
    page_title,
)
from mesa_swarm.dashboard.replay.replay_view import Replay
from mesa_swarm.dashboard.replay.replaying import Replaying
from mesa_swarm.dashboard.run.charts import ChartBoard, Charting
from mesa_swarm.dashboard.run.editing import Editing, Editor
from mesa_swarm.dashboard.run.exporting import ExportDesk, Exporter
from mesa_swarm.dashboard.run.info_view import Info
from mesa_swarm.dashboard.run.inspector import Inspecting, Inspector
from mesa_swarm.model.gallery import description, find_model
from mesa_swarm.model.looks import looks_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing import text_of
from mesa_swarm.viewing.canvas_widget import ON_A_PAGE, PlayerView
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.palette import style_sheet
from mesa_swarm.viewing.play_loop import Listeners, use_changes
from mesa_swarm.viewing.player import PackedFrame

# Shortest time between drawings of panels while the model is played, s.
EVERY = 0.5
MOST_PAGES = 40


class Places:
    """A limited number of places, each held by a page until its session is closed."""

    def __init__(self, most: int = MOST_PAGES) -> None:
        self.most = most
        self._holders: set[threading.Event] = set()
        self._lock = threading.Lock()

    def take(self, connection: threading.Event) -> bool:
        """Take a place until this event is set; return False if all are taken.

        The place does not depend on what the page does at its end: a panel that fails there keeps none.
        """
        with self._lock:
            self._holders = {holder for holder in self._holders if not holder.is_set()}
            if connection not in self._holders and len(self._holders) >= self.most:
                return False
            self._holders.add(connection)
            return True


STYLES = tuple(
    f"dashboard/{name}.css"
    for name in (
        "page/style",
        "gallery/gallery",
        "run/info",
        "run/charts",
        "run/editing",
        "experiment/experiment",
        "page/layout",
    )
)
CSS = style_sheet(".v-application", ".v-application.theme--dark") + text_of(*STYLES)
MODELS = "models"
# More tabs: names, and components that are called with the session.
MORE_TABS: dict = {"compare": Compare, "experiment": ExperimentTab, "replay": Replay}
# The state of tabs that is written into links.
COMPANIONS: Companions = {
    WATCH: None,
    MODELS: None,
    "compare": Comparing,
    "experiment": Experimenting,
    "replay": Replaying,
}

PLACES = Places()

# By default Solara reports its use, lets the browser contact solara.dev, and keeps the session of a page that
# disappeared without closing (its model plays on) for a day.
settings.telemetry.mixpanel_enable = False
settings.main.mode = "production"
settings.kernel.cull_timeout = "10m"
settings.theme.show_banner = False
settings.theme.title = PRODUCT


@solara.component
def Layout(children: list) -> None:
    """Show the page only, without Solara's bar above it."""
    solara.Div(children=children)


@solara.component
def Page() -> None:
    """Show the page, if fewer than the largest number of pages are open."""
    has_place = solara.use_memo(lambda: PLACES.take(solara.kernel_closed_event()), [])
    solara.Title(PRODUCT)
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
    first = os.environ.get(MODEL_VARIABLE, FIRST)
    navigation = solara.use_memo(lambda: Navigation(search, first, COMPANIONS), [])
    use_changes(navigation.changed)
    solara.use_effect(lambda: navigation.close, [])
    session = navigation.session
    with solara.Div(classes=["swarm-room"]):
        Header(navigation)
        if navigation.tab == MODELS:
            Gallery(session.name, navigation.choose)
        elif navigation.tab in MORE_TABS:
            MORE_TABS[navigation.tab](session)
        else:
            Watch(session, navigation.faults)


@solara.component
def Header(navigation: Navigation) -> None:
    """Show the name, the tabs and the page bar."""
    session = navigation.session
    use_changes(session.changed)
    use_changes(navigation.changed)
    use_changes(navigation.tab_changes)
    with rv.Html(tag="header", class_="swarm-header"):
        solara.HTML(tag="h1", unsafe_innerHTML="mesa_swarm")
        with rv.Html(tag="nav", attributes={"aria-label": "Pages"}):
            for name in (WATCH, MODELS, *MORE_TABS):
                current = "page" if name == navigation.tab else ""
                Button(name.capitalize(), partial(navigation.go, name), current=current).key(name)
        model = navigation.model_shown
        heading = rv.Html(tag="b", children=[title(model) if model else ""])
        # Always there: what follows it would be made anew if it came and went.
        rv.Html(tag="p", children=[heading, f" {description(find_model(model))}" if model else ""])
        traits = {"shown": navigation.shown, "tours": navigation.tours}
        solara.Title(page_title(title(model or session.name), navigation.tab.capitalize(), WATCH.capitalize()))
        ScreenButtons.element()
        bar = PageBar.element(**traits, on_dark=lambda dark: setattr(solara.lab.theme, "dark", dark))
        solara.use_effect(lambda: PageLink(solara.get_widget(bar), navigation).close, [])


@solara.component
def Watch(session: Session, faults: tuple[str, ...]) -> None:
    """Show the controls on the left, the world in the middle, and readings on the right."""
    with solara.Div(classes=["swarm-watch", "swarm-beside"]):
        Linked(ControlPanel, Panel, session)
        ColumnFold.element(side=LEFT, label="Settings", folded_below=True)
        with solara.Div(classes=["swarm-middle"]):
            with solara.Div(classes=["swarm-unseen"]):  # its tools are put upon the canvas
                Linked(Editor, Editing, session)
            SessionFault(session, faults).key(f"trouble {faults}")
            PlayerView(session, session.reset, {**ON_A_PAGE, "remember": WATCH})
        ColumnFold.element(side=RIGHT, label="Robot, charts, export")
        with solara.Div(classes=["swarm-side"]):
            Info(session)
            Linked(Inspector, Inspecting, session)
            Linked(ChartBoard, Charting, session)
            EventList(session)
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
        TroubleCard("A panel of the model failed", reported(problem))


@solara.component
def SessionFault(session: Session, faults: tuple[str, ...]) -> None:
    """Show an error of the model or of the link on a card."""
    use_changes(session.changed)
    is_left, leave = solara.use_state(False)
    problems = (*faults, *filter(None, [session.note]))
    if session.error and session.unbuilt:
        way_out = "Back to the last settings" if session.built else "Back to the defaults", session.go_back
        TroubleCard("These settings cannot be built", session.error, way_out=way_out).key("unbuilt")
    elif session.error:
        TroubleCard("The model stopped", session.error, way_out=("Reset", session.reset)).key("error")
    elif problems and not is_left:
        way_out = "Continue", lambda: leave(True)
        head = "Still running" if session.goal and not faults else "Parts of the link were ignored"
        TroubleCard(head, *problems, way_out=way_out).key("fault")


# Of the last events, and of names.
MOST_LISTED, MOST_NAMES = 8, 12


class EventNews(Beat):
    """Notifies when the events of a session are others, or are stored for other steps."""

    _state = (0, 0)

    def push(self, number: int, frame: PackedFrame) -> None:
        """Notify, if there is something new."""
        model = self._session.model
        state = (id(model), 0 if model is None else len(model.events))
        if state != self._state:
            self._state = state
            self.changed.notify()


def go_to(session: Session, step: int) -> None:
    """Display the first stored step that is not before this one."""
    session.pause()
    with session.lock:
        past = session.recent
        past.look_at(step)
        moment = past.shown
        if moment is not None and moment.step < step:
            past.look(past.index + 1)
    session.rest()


@solara.component
def EventList(session: Session) -> None:
    """Show how many events of each name there were, and the last ones; nothing for models without events."""
    use_changes(session.changed)
    news = solara.use_memo(lambda: EventNews(session), [])
    solara.use_effect(news.begin, [])
    use_changes(news.changed)
    with session.lock:
        model, past = session.model, session.past
        if model is None or not len(model.events):
            return
        counts = model.events.counts
        last = model.events.rows(max(0, len(model.events) - MOST_LISTED))[::-1]
        first_step, last_step = past.first_step, past.last_step
    with solara.Div(classes=["swarm-happened"]):
        solara.HTML(tag="h2", unsafe_innerHTML="Events")
        names = [f"{name} {count:,}" for name, count in list(counts.items())[:MOST_NAMES]]
        more = f", and {len(counts) - MOST_NAMES} more names" if len(counts) > MOST_NAMES else ""
        rv.Html(tag="p", children=[", ".join(names) + more])
        with solara.Div(classes=["swarm-list"]):
            for place, (step, name, robot, value) in enumerate(last):
                text = event_text(name, robot, value)
                is_stored = first_step <= step <= last_step
                Button(f"step {step:,}", partial(go_to, session, step), more=text, enabled=is_stored).key(f"{place}")
        if last[-1][0] < first_step:
            text = f"Steps {first_step:,} to {last_step:,} are in memory."
            rv.Html(tag="p", class_="swarm-hint", children=[text])


def event_text(name: str, robot: int, value: float) -> str:
    """Return an event in words.

    Examples
    --------
    >>> event_text("delivered", 7, 2.0), event_text("opened", -1, 1.0)
    ('delivered: robot 7, value 2', 'opened')
    """
    parts = [*([f"robot {robot}"] if robot >= 0 else []), *([f"value {value:g}"] if value != 1.0 else [])]
    return f"{name}: {', '.join(parts)}" if parts else name
