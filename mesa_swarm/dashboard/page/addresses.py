"""Links: what the page shows as words in its address, and back."""

from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable
from urllib.parse import parse_qsl, urlencode

from mesa_swarm.base.errors import SwarmError, check_choice
from mesa_swarm.dashboard import check_page_model
from mesa_swarm.dashboard.page.edits import Edit, as_text, edits_from, link_value
from mesa_swarm.dashboard.page.inputs import LARGEST_SEED, checked_setting, whole_number
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.maps.map import builtin_maps
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parameters import Parameter, parameters_of
from mesa_swarm.viewing.play_loop import Listeners

LONGEST = 4000
# More steps would take longer than a user waits for a link to open.
MOST_STEPS = 20_000
COUNTS = {"seed": LARGEST_SEED, "step": MOST_STEPS}
MOST_FAULTS = 5
# Words of a link besides parameters; those of a tab begin with its name and a dot.
TAB, EDITS, PLAY, TOUR, CHANGED = "tab", "edits", "play", "tour", "changed"
# Values of CHANGED, and what a page states that is opened by such a link.
BY_HAND, OTHER_MAP = "yes", "map"
LEFT_OUT = {
    BY_HAND: "the run behind this link was changed by hand more often than a link can hold; it begins anew",
    OTHER_MAP: "the run behind this link is on an uploaded or drawn map, which a link does not hold; load it here too",
}
WATCH = "watch"


@runtime_checkable
class Linkable(Protocol):
    """The state of a tab that can be written into a link."""

    @property
    def model_shown(self) -> str:
        """The name of the model of the tab, empty for none of the page."""

    @property
    def linked(self) -> Listeners:
        """Notified when the words change."""

    def words(self) -> dict[str, str]:
        """Return what the tab shows, as words by name."""

    def show_words(self, words: dict[str, str]) -> list[str]:
        """Show what these words describe; return why some were ignored."""


@runtime_checkable
class Resumable(Protocol):
    """What is played on a tab."""

    def go_on_to(self, step: int, *, plays: bool, speed: float | None) -> None:
        """Go on after a reload: at this step, at this speed unless it is not known, and playing if it was."""


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
        "tour": words.pop(TOUR, "") != "no",
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
