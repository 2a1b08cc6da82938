"""The panel of controls: sliders, lists, fields, and the designer of fire constants."""

import math
import secrets
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import anywidget
import traitlets

from mesa_swarm.base.errors import FireConstantsWarning, InvalidValueError, SwarmError
from mesa_swarm.dashboard.page.session import LARGEST_MAP_FILE, Session
from mesa_swarm.dashboard.page.widgets import Link, view_script
from mesa_swarm.fire import FireConstants, design_constants
from mesa_swarm.model.parameters import Choice, Parameter, Slider
from mesa_swarm.viewing.play_loop import Listeners


class Requirement(NamedTuple):
    """A required property: its slider, and its usual value."""

    label: str
    help: str
    usual: float
    least: float
    step: float
    most: float

    def place(self, value: float) -> int:
        """Return the position of a value on the slider."""
        return round((value - self.least) / self.step)


REQUIREMENTS = {
    "growth_time": Requirement(
        "growth time", "steps in which a fire that is left alone grows from T = 0 to 1", 2000.0, 100, 50, 10_000
    ),
    "robots": Requirement(
        "robots needed", "to put out a fire of the largest size in the extinguish time", 2.0, 0.5, 0.5, 20
    ),
    "extinguish_time": Requirement("extinguish time", "steps in which these robots put it out", 1600.0, 50, 50, 10_000),
    "balance_temperature": Requirement(
        "balance temperature", "of the largest fire: heating and cooling balance", 0.6, 0.05, 0.05, 0.95
    ),
    "stay_time": Requirement(
        "stay", "steps that a cold robot can stay at the largest fire at T = 1", 100.0, 10, 10, 1000
    ),
    "rest_time": Requirement("rest", "steps that a robot rests before it fights again", 60.0, 10, 10, 1000),
}
CONSTANTS = ("k1", "k2", "k3", "k4", "leave", "join")
# Warning filters belong to the whole process, so one thread at a time changes them.
_SILENCE = threading.Lock()


class Designer:
    """The constants of a session's model, designed from required properties of fires and robots."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.requirements = {name: requirement.usual for name, requirement in REQUIREMENTS.items()}
        self._constants: FireConstants | None = None
        self._warned: tuple[str, ...] = ()
        self._fault = ""

    @property
    def fits(self) -> bool:
        """Whether the model has the constants."""
        return set(CONSTANTS) <= self.session.parameters.keys()

    def require(self, name: str, value: float) -> None:
        """Require a property, and set the constants that give it."""
        self.requirements[name] = float(value)
        try:
            self._constants, self._warned = self._design()
            self._fault = ""
        except SwarmError as error:
            self._fault = str(error)
            self.session.changed.notify()
        else:
            self.session.set_parameters({key: getattr(self._constants, key) for key in CONSTANTS})

    def notes(self) -> list[tuple[str, str]]:
        """Return remarks on the constants, each "warning", "remark" or "fault" with its text."""
        if not self.fits:
            return []
        if self._fault:
            return [("fault", in_labels(self._fault))]
        constants, warned = (self._constants, self._warned) if self._constants else self._design()
        if any(self.session.settings[key] != getattr(constants, key) for key in CONSTANTS):
            return [("remark", "k1 to k4, leave or join were set by hand; any of these sliders sets all of them again")]
        remarks = [("warning" if remark in warned else "remark", in_labels(remark)) for remark in constants.remarks]
        return [*remarks, *(("remark", text) for text in self._beyond(constants))]

    def _beyond(self, constants: FireConstants) -> Iterator[str]:
        """Yield remarks on the constants that their sliders do not reach."""
        for key in CONSTANTS:
            value, control = getattr(constants, key), self.session.parameters[key].control
            if isinstance(control, Slider) and not control.minimum <= value <= control.maximum:
                end = control.minimum if value < control.minimum else control.maximum
                yield f"{key} is {value:.4g}, beyond its slider, which ends at {end:g}"

    def fields(self) -> list[dict[str, Any]]:
        """Return the sliders of the requirements."""
        about = {"kind": "slider", "designed": True, "low": 0}
        return [
            {**about, "name": name, "label": need.label, "help": need.help, "high": need.place(need.most)}
            for name, need in REQUIREMENTS.items()
        ]

    def place(self, name: str, place: int) -> None:
        """Require the value at a position of a slider."""
        slider = REQUIREMENTS[name]
        self.require(name, round(slider.least + place * slider.step, 6))

    def values(self) -> dict[str, dict[str, Any]]:
        """Return the values of the sliders."""
        return {
            name: {"text": f"{value:g}", "place": REQUIREMENTS[name].place(value), "fault": "", "waits": False}
            for name, value in self.requirements.items()
        }

    def _design(self) -> tuple[FireConstants, tuple[str, ...]]:
        model = self.session.model
        largest = float(model.fires.area.max()) if model is not None and len(model.fires) else 16.0
        start = float(self.session.settings.get("initial_temperature", 1.0))
        requirements: dict[str, Any] = {**self.requirements, "initial_temperature": start}
        with _SILENCE, warnings.catch_warnings(record=True) as raised:
            warnings.simplefilter("always", FireConstantsWarning)
            constants = design_constants(**requirements, area=largest, largest_area=largest)
        return constants, tuple(str(warning.message) for warning in raised)


def in_labels(text: str) -> str:
    """Return a text in which requirements are called as their sliders are, not as the arguments of a function.

    Examples
    --------
    >>> in_labels("ask for more robots or a longer extinguish_time")
    'ask for more robots or a longer extinguish time'
    """
    for name, requirement in REQUIREMENTS.items():
        if "_" in name:
            text = text.replace(name, requirement.label)
    return text


# Groups of parameters; the others belong to "Behaviour".
GROUPS = {
    "Robots": ("n_robots", "design", "max_speed", "cruise_speed", "speed", "sight", "sensors"),
    "World": ("map", "load", "resistance", "initial_temperature", "history_every"),
    "Fires and heat": ("k1", "k2", "k3", "k4", "leave", "join"),
    "Communication": ("communication", "communication_range"),
    "Disturbances": ("noise", "slip", "imperfections", "slip_probability", "error_probability"),
}
OTHERS = "Behaviour"
ORDER = ("World", "Robots", OTHERS, "Communication", "Fires and heat", "Disturbances")
LARGEST_RANDOM_SEED = 999_999
# The end of the slider of seeds; more can be typed.
MOST_SLID = 100


class ControlPanel(anywidget.AnyWidget):
    """Sliders, lists and fields in the browser, which send what the user sets; a bare one has no seed and defaults."""

    _esm = view_script("dashboard/page/panel.js")
    bare = traitlets.Bool(False).tag(sync=True)
    groups: traitlets.List[dict[str, Any]] = traitlets.List().tag(sync=True)
    values = traitlets.Dict().tag(sync=True)
    notes: traitlets.List[list[str]] = traitlets.List().tag(sync=True)
    largest_map = traitlets.Int(LARGEST_MAP_FILE).tag(sync=True)


class PanelLink(Link):
    """Connects a control panel of any tab and what it controls, which notifies of changes.

    `groups` returns all controls in groups, `values` the value of each by name, in the format of the browser.
    """

    def __init__(
        self, widget: ControlPanel, changed: Listeners, groups: Callable[[], list[dict]], values: Callable[[], dict]
    ) -> None:
        self.widget, self._groups, self._values = widget, groups, values
        self.connect(widget, changed.add(self.refresh))
        self.refresh()

    def refresh(self) -> None:
        """Show all values, and the controls where there are others."""
        self.widget.groups, self.widget.values = self._groups(), self._values()


class Panel(PanelLink):
    """Connects a control panel and a session, of which it has all parameters, or those of these names only."""

    def __init__(self, widget: ControlPanel, session: Session, names: Sequence[str] | None = None) -> None:
        self.session, self.designer = session, Designer(session)
        super().__init__(widget, session.changed, lambda: control_groups(session, names), self._all_values)

    def refresh(self) -> None:
        """Show all values, and remarks on those of the designer."""
        super().refresh()
        self.widget.notes = [list(note) for note in self.designer.notes()]

    def _all_values(self) -> dict[str, dict[str, Any]]:
        return control_values(self.session) | (self.designer.values() if self.designer.fits else {})

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        session, name = self.session, message.get("name", "")
        value: Any = message.get("value")
        match message.get("do"):
            case "place" if name in session.parameters:
                session.set_parameter(name, value_at(int(value), session.parameters[name]))
            case "place" if name in self.designer.requirements:
                self.designer.place(name, int(value))
            case "text" if name == "seed":
                session.set_seed(str(value))
            case "text" | "choose" if name in session.parameters:
                session.set_parameter(name, str(value))
            case "random":
                session.set_seed(secrets.randbelow(LARGEST_RANDOM_SEED))
                session.reset()
            case "defaults":
                session.set_defaults()
            case "reset":
                session.reset()
            case "upload" if buffers and "map" in session.parameters:
                session.upload(str(name), bytes(buffers[0]))


def control_groups(session: Session, names: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """Return all controls in groups, or those of these names, in the format of the panel."""
    groups: dict[str, list] = {title: [] for title in ORDER}
    for parameter in session.parameters.values():
        field = field_of(parameter, session) if names is None or parameter.name in names else None
        if field:
            groups[group_of(parameter.name)].append(field)
    result: list[dict[str, Any]] = [{"title": title, "fields": members} for title, members in groups.items() if members]
    designer = Designer(session)
    if designer.fits and names is None:
        result.append({"title": "Design the constants", "fields": designer.fields(), "notes": True})
    return result


def group_of(name: str) -> str:
    """Return the title of the group that a parameter belongs to."""
    return next((title for title, names in GROUPS.items() if name in names), OTHERS)


def field_of(parameter: Parameter, session: Session) -> dict[str, Any] | None:
    """Return one control, None for a parameter that the page cannot set."""
    about: dict[str, Any] = {"name": parameter.name, "label": parameter_label(parameter.name), "help": parameter.help}
    if parameter.name == "map":
        return {**about, "kind": "choice", "options": session.map_names(parameter), "upload": True}
    if isinstance(parameter.control, Choice):
        return {**about, "kind": "choice", "options": list(parameter.control.options)}
    if isinstance(parameter.control, Slider):
        low, high = slider_ends(parameter)
        return {**about, "kind": "slider", "low": low, "high": high}
    if parameter.kind is bool:
        return {**about, "kind": "choice", "options": ["True", "False"]}
    return {**about, "kind": "text"} if parameter.kind in (int, float, str) else None


def choice_field(name: str, label: str, options: Sequence[str], help_text: str = "") -> dict[str, Any]:
    """Return a list of which one is chosen, with effect at once."""
    return {"name": name, "label": label, "help": help_text, "kind": "choice", "options": list(options), "live": True}


def run_fields(fewest: int, each_seed: str) -> list[dict[str, Any]]:
    """Return the controls of many runs: the number of seeds, at least `fewest`, and the steps of each run."""
    seeds = {"name": "seeds", "label": "seeds", "help": f"1, 2, 3 ...: {each_seed}", "live": True}
    steps = {"name": "steps", "label": "steps", "help": "of each run, unless the model ends earlier", "live": True}
    return [{**seeds, "kind": "slider", "low": fewest, "high": MOST_SLID}, {**steps, "kind": "text"}]


def parameter_label(name: str) -> str:
    """Return a parameter's name as a label."""
    return name.removeprefix("n_").replace("_", " ")


def slider_of(parameter: Parameter) -> Slider:
    """Return the slider of a parameter."""
    if not isinstance(parameter.control, Slider):
        raise InvalidValueError(f"{parameter.name} has no slider; choose or type its value")
    return parameter.control


def slider_ends(parameter: Parameter) -> tuple[int, int]:
    """Return the positions of the ends of a slider, counted in its steps from the default.

    Browsers move a slider to the nearest step: counted from another origin, this would change a default such as
    k1 = ln 2 / 2000.
    """
    slider, default = slider_of(parameter), parameter.default
    low = math.floor(round((slider.minimum - default) / slider.step, 9))
    return low, math.ceil(round((slider.maximum - default) / slider.step, 9))


def value_at(place: int, parameter: Parameter) -> float:
    """Return the value at a slider's position, within its range."""
    slider = slider_of(parameter)
    value = min(max(parameter.default + place * slider.step, slider.minimum), slider.maximum)
    return parameter.kind(round(value, 12)) if place else parameter.default


def slider_position(value: float, parameter: Parameter) -> int:
    """Return the position of a slider that is nearest to a value."""
    low, high = slider_ends(parameter)
    return min(max(round((value - parameter.default) / slider_of(parameter).step), low), high)


def control_values(session: Session) -> dict[str, dict[str, Any]]:
    """Return the value of each control, whether it waits for a reset, and its fault."""
    values = {name: value_of(session.settings[name], parameter) for name, parameter in session.parameters.items()}
    fields = with_faults({"seed": {"text": str(session.seed)}} | values, session)
    refused = session.error.partition(" is ")[0]  # the parameter with which no model could be built
    if refused in values and not fields[refused]["fault"]:
        fields[refused]["fault"] = session.error
    return fields


def value_of(value: Any, parameter: Parameter) -> dict[str, Any]:
    """Return the value of a control: its text, and the position of its slider if it has one."""
    place = {"place": slider_position(value, parameter)} if isinstance(parameter.control, Slider) else {}
    return {"text": value_text(value), "waits": False, "fault": ""} | place


def value_text(value: Any) -> str:
    """Return a value as it is shown."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def with_faults(values: dict[str, dict[str, Any]], source: Any) -> dict[str, dict[str, Any]]:
    """Return values of controls with the `waiting` and `faults` of a session or a comparison."""
    marks = {name: {"waits": name in source.waiting, "fault": source.faults.get(name, "")} for name in values}
    return {name: value | marks[name] for name, value in values.items()}
