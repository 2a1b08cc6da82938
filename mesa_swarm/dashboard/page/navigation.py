"""Where a user is on the page: the model and the tab, links that lead there, and the bar that shows the link."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qsl, urlencode

import anywidget
import traitlets

from mesa_swarm.base.errors import SwarmError, check_choice
from mesa_swarm.dashboard import check_page_model
from mesa_swarm.dashboard.page.edits import Edit, as_text, edits_from, link_value
from mesa_swarm.dashboard.page.session import LARGEST_SEED, Session, checked_setting, whole_number
from mesa_swarm.dashboard.page.widgets import Link, view_script
from mesa_swarm.maps.map import builtin_maps
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parameters import Parameter, parameters_of
from mesa_swarm.viewing.canvas_widget import SPEEDS
from mesa_swarm.viewing.play_loop import Listeners

LONGEST = 4000
# More steps would take longer than a user waits for a link to open.
MOST_STEPS = 20_000
COUNTS = {"seed": LARGEST_SEED, "step": MOST_STEPS}
MOST_FAULTS = 5
# Words of a link besides parameters; those of a tab begin with its name and a dot.
TAB, EDITS, PLAY, TOURS, CHANGED = "tab", "edits", "play", "tour", "changed"
# Values of CHANGED, and what a page states that is opened by such a link.
BY_HAND, OTHER_MAP = "yes", "map"
LEFT_OUT = {
    BY_HAND: "the run behind this link was changed by hand more often than a link can hold; it begins anew",
    OTHER_MAP: "the run behind this link is on an uploaded or drawn map, which a link does not hold; load it here too",
}
WATCH = "watch"


class Linkable(ABC):
    """The state of a tab that a link can hold; `linked` is notified when its words change."""

    name: str
    linked: Listeners

    @property
    def model_shown(self) -> str:
        """The name of the model of the tab, empty for none of the page."""
        return self.name

    @abstractmethod
    def words(self) -> dict[str, str]:
        """Return what the tab shows, as words by name."""

    @abstractmethod
    def show_words(self, words: dict[str, str]) -> list[str]:
        """Show what these words describe; return why some were ignored."""

    def go_on_to(self, step: int, *, plays: bool, speed: float | None) -> None:  # noqa: B027 - some play nothing
        """Go on after a reload: at this step, at this speed unless it is not known, and playing if it was."""

    @abstractmethod
    def close(self) -> None:
        """Stop, and release everything."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Address:
    """The settings in a link."""

    model: str
    # Parameters that are not the model's defaults.
    settings: dict[str, Any] = field(default_factory=dict)
    seed: int = 1
    steps: int = 0
    edits: tuple[Edit, ...] = ()
    tab: str = WATCH
    # Words of the tab.
    words: dict[str, str] = field(default_factory=dict)
    # Whether the model may be played as soon as the page opens; whether it may begin with a tour.
    plays: bool = True
    tour: bool = True
    # Why parts of the link were ignored.
    faults: tuple[str, ...] = ()


def address_from(query: str | None, first: str, tabs: tuple[str, ...] = (WATCH,)) -> Address:
    """Return the settings in a link's query; invalid ones are reported and left out, unknown words are ignored."""
    words = dict(parse_qsl((query or "")[:LONGEST]))
    tab = words.pop(TAB, WATCH)
    tab = tab if tab in tabs else WATCH
    facts: dict[str, Any] = {
        "tab": tab,
        "words": {name.partition(".")[2]: words[name] for name in words if name.startswith(f"{tab}.")},
        "plays": words.pop(PLAY, "") != "no",
        "tour": words.pop(TOURS, "") != "no",
    }
    try:
        name = check_page_model(words.pop("model", first))
    except SwarmError as error:  # the settings of an unknown model cannot be checked
        return Address(model=first, faults=(str(error),), **facts)
    parameters, values, faults = parameters_of(find_model(name)), {}, []
    for word in (word for word in words if word in parameters or word in (*COUNTS, EDITS, CHANGED)):
        try:
            values[word] = _value(parameters, word, words[word])
        except SwarmError as error:
            faults.append(str(error))
    if reason := values.pop(CHANGED, ""):
        faults.append(LEFT_OUT.get(reason, LEFT_OUT[BY_HAND]))
    numbers = {"seed": values.pop("seed", 1), "steps": values.pop("step", 0), "edits": tuple(values.pop(EDITS, ()))}
    if (more := len(faults) - MOST_FAULTS) > 0:
        faults = [*faults[:MOST_FAULTS], f"and {more} more"]
    return Address(model=name, settings=values, faults=tuple(faults), **numbers, **facts)


def _value(parameters: dict[str, Parameter], word: str, text: str) -> Any:
    """Return the value of one setting in a link."""
    if word in COUNTS:
        return whole_number(word, text, maximum=COUNTS[word])
    if word == EDITS:
        return edits_from(text)
    if word == CHANGED:
        return text
    # A link never names a file: opening a link from others must not make this machine read one.
    return check_choice("map", text, builtin_maps()) if word == "map" else checked_setting(parameters[word], text)


def query_of(session: Session, tab: str = WATCH, words: dict[str, str] | None = None) -> str:
    """Return the query of a link to what a session shows, except for uploaded maps, and to the words of a tab.

    It has the settings with which the run began, and what was changed by hand since; where that cannot be written, and
    where the map was uploaded, it states so.
    """
    query = {TAB: tab} if tab != WATCH else {}
    query |= {"model": session.name}
    run, waits = session.run, session.waiting
    began: dict[str, Any] = {**session.settings, "seed": session.seed} if run is None or waits else run.first
    for name, parameter in session.parameters.items():
        value = began[name]
        if value != parameter.default and value not in session.uploads:
            query[name] = link_value(value)
    query["seed"] = str(began["seed"])
    query |= _of_run(session) if not waits else {}
    if began.get("map") in session.uploads:
        query[CHANGED] = OTHER_MAP
    query |= {f"{tab}.{name}": text for name, text in (words or {}).items()}
    return urlencode(query)


def _of_run(session: Session) -> dict[str, str]:
    """Return the edits of the run and, at rest, the displayed step."""
    edits, moment, words = as_text(session.edits), session.past.shown, {}
    if not session.straight or len(edits) > LONGEST // 2:
        return {CHANGED: BY_HAND}
    if edits:
        words[EDITS] = edits
    if moment and not session.playing and 0 < moment.step <= MOST_STEPS:
        words["step"] = str(moment.step)
    return words


# Makes the state of each tab from the session, None for a tab without one.
Companions = Mapping[str, Callable[[Session], Linkable] | None]
# Keys of the page, in the order of the list that "?" opens.
KEYS = (
    ("space", "plays and pauses"),
    ("right, left", "steps, steps back"),
    ("r", "resets, or applies settings that wait"),
    ("?", "opens and closes this list"),
    ("Esc", "ends a tool, the tour, this list"),
    ("Ctrl+Z", "undoes the last change by hand"),
    ("Tab, Shift+Tab", "move between controls; the focused one has an orange ring"),
    ("Enter, space", "press a button, open a group that was reached by Tab"),
    ("arrows on a slider", "change it by one step; Home and End jump to its ends"),
)
# Stops of the tour: a part of the page by its selector, and what it is for.
TOUR = (
    (".swarm-buttons", "Play and pause with this button or the space bar. The slider beside it sets the speed."),
    (".swarm-panel", "Every slider changes the run at once. What belongs to the beginning of a run waits for Apply."),
    (".swarm-stage", "Click a robot to see what it perceives and why it acts. Edit moves robots and adds walls."),
    (".swarm-past", "The time line: drag it back, and play again from any step in memory."),
    (".swarm-charts", "Measurements of the run. Point at a chart to read its values."),
    (".swarm-header nav", "More models, two worlds side by side, experiments over many runs, recordings."),
)


class Navigation:
    """The model and the tab that a page shows, and its address.

    Attributes
    ----------
    session : Session
    tab : str
        Key of the tab that is shown.
    faults : tuple of str
        Why parts of the address were ignored.
    changed : Listeners
        Notified when another tab or address is shown.
    """

    def __init__(self, query: str | None, first: str, companions: Companions) -> None:
        self.first, self.companions = first, dict(companions)
        self.changed = Listeners()
        address = address_from(query, first, tuple(self.companions))
        self.session = Session(address.model, address.settings, address.seed, address.steps, edits=address.edits)
        self.address, self.faults, self.tab = address, address.faults, address.tab
        self.motion = True  # unless the user prefers less
        self._resumes = False
        self._last: dict[str, str] | None = None
        self._take_words(address)
        self.session.adopted.add(lambda: self.go(WATCH))

    @property
    def query(self) -> str:
        """The query of a link to what is shown."""
        state = self._state_of(self.tab)
        return query_of(self.session, self.tab, state.words() if state else None)

    @property
    def model_shown(self) -> str:
        """The name of the model of the present tab, empty for none of the page."""
        state = self._state_of(self.tab)
        return state.model_shown if state else self.session.name

    @property
    def place(self) -> str:
        """The model and the tab: what Back and Forward walk."""
        return f"{self.session.name} {self.tab}"

    @property
    def shown(self) -> dict[str, str]:
        """The place and its query; on the way to another place still the last ones."""
        return self._last or {"place": self.place, "query": self.query}

    @contextmanager
    def _moving(self) -> Iterator[None]:
        """Go to another place at once: what changes on the way is not a place of its own."""
        self._last = self.shown
        try:
            yield
        finally:
            self._last = None
            self.changed.notify()

    @property
    def tours(self) -> bool:
        """Whether a first visit begins with the tour: not one by a link to a step or to another tab."""
        return self.address.tour and not self.address.steps and self.address.tab == WATCH

    @property
    def tab_changes(self) -> Listeners:
        """Notified when the words of the present tab change."""
        state = self._state_of(self.tab)
        return state.linked if state else self.changed

    def go(self, tab: str) -> None:
        """Show another tab."""
        goes_on = self._turn_to(tab)
        self.changed.notify()
        if goes_on:
            self.session.play()

    def _turn_to(self, tab: str) -> bool:
        """Show another tab; return whether the run goes on that was paused while it was not seen."""
        if self.tab == WATCH and tab != WATCH:
            self._resumes = self.session.playing
        goes_on, self._resumes = self._resumes and tab == WATCH, self._resumes and tab != WATCH
        self.tab = tab
        return goes_on

    def choose(self, name: str, settings: Mapping[str, Any] | None = None) -> None:
        """Show another model, and play it."""
        with self._moving():
            self.tab, self._resumes = WATCH, False
            self.session.choose(name, settings)
        self._play()

    def visit(self, query: str) -> None:
        """Show what an address describes."""
        address = address_from(query.removeprefix("?"), self.first, tuple(self.companions))
        with self._moving():
            goes_on = self._turn_to(address.tab)
            if not self._shows(address):
                goes_on = self._resumes = False
                self.session.choose(address.model, address.settings, address.seed, address.steps, address.edits)
            self.address, self.faults = address, address.faults
            self._take_words(address)
        if goes_on:
            self.session.play()

    def begin(self, *, motion: bool, resume: Mapping[str, Any] | None) -> None:
        """Begin when the browser has opened the page: play, unless the link names a step, or go on after a reload."""
        self.motion = motion
        if resume:
            self._resume(resume)
        elif self.tab == WATCH and self.address.plays and not self.address.steps:
            self._play()

    def close(self) -> None:
        """Stop, and release everything."""
        self.changed.clear()
        self.session.close()

    def _play(self) -> None:
        if self.motion and not self.session.error and self.address.plays:
            self.session.play()

    def _shows(self, address: Address) -> bool:
        """Return whether the session shows the run of an address already, at its step if that has one."""
        now = address_from(query_of(self.session), self.first)
        same = (now.model, now.settings, now.seed, now.edits) == (
            address.model, address.settings, address.seed, address.edits,
        )  # fmt: skip
        return same and address.steps in (0, now.steps)

    def _resume(self, resume: Mapping[str, Any]) -> None:
        """Go on after a reload: the tab is where it was, as fast, and playing if it was."""
        state = self.session if self.tab == WATCH else self._state_of(self.tab)
        if state is not None:
            place = _whole(resume.get("speed"), len(SPEEDS))
            speed = SPEEDS[place] if place < len(SPEEDS) else None
            state.go_on_to(_whole(resume.get("step")), plays=bool(resume.get("playing")), speed=speed)

    def _state_of(self, tab: str) -> Linkable | None:
        kind = self.companions.get(tab)
        return self.session.companion(kind) if kind else None

    def _take_words(self, address: Address) -> None:
        state = self._state_of(address.tab)
        if state and address.words:
            self.faults = (*self.faults, *state.show_words(address.words))


def _whole(value: object, otherwise: int = 0) -> int:
    return int(value) if isinstance(value, (int, float)) and 0 <= value < LARGEST_SEED else otherwise


class PageBar(anywidget.AnyWidget):
    """Buttons for the theme, the link, the keys and the tour; it also writes the query into the address bar."""

    _esm = view_script("dashboard/page/page_bar.js")
    # The query, and the place, model and tab: a new place is a new entry of the browser's history.
    shown = traitlets.Dict({"query": "", "place": ""}).tag(sync=True)
    dark = traitlets.Bool(False).tag(sync=True)
    key_list: traitlets.List[list[str]] = traitlets.List(list(map(list, KEYS))).tag(sync=True)
    stops: traitlets.List[list[str]] = traitlets.List(list(map(list, TOUR))).tag(sync=True)
    # Whether a first visit begins with the tour.
    tours = traitlets.Bool(True).tag(sync=True)


class PageLink(Link):
    """Connects the bar and a navigation."""

    def __init__(self, bar: PageBar, navigation: Navigation) -> None:
        self.navigation = navigation
        self.connect(bar)

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        match message.get("do"):
            case "begin":
                self.navigation.begin(motion=not message.get("still"), resume=message.get("resume"))
            case "visit":
                self.navigation.visit(str(message.get("query", "")))
