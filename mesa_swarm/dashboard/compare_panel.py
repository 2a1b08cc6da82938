"""The controls of a comparison, in the panel that the page has for a model's parameters."""

import secrets
from typing import Any

from mesa_swarm.dashboard.comparing import FEWEST_SEEDS, Comparing
from mesa_swarm.dashboard.controls import LARGEST_RANDOM_SEED, ControlPanel, field_of, label_of, place_of, value_at
from mesa_swarm.dashboard.pair import NAMES
from mesa_swarm.dashboard.readings import value_text
from mesa_swarm.gallery import model_names
from mesa_swarm.parameters import Slider

# The slider goes so far; more can be typed.
MOST_SLID = 100


class ComparePanel:
    """Lets a control panel show and change what is compared.

    Parameters
    ----------
    widget : ControlPanel
    comparing : Comparing
    """

    def __init__(self, widget: ControlPanel, comparing: Comparing) -> None:
        self.widget, self.comparing = widget, comparing
        self._leave = comparing.pair.changed.add(self.refresh)
        self._shown: tuple = ()
        self._hear = lambda _, message, __: self.act(message)
        widget.on_msg(self._hear)
        self.refresh()

    def refresh(self) -> None:
        """Show how everything is set."""
        comparing = self.comparing
        shown = comparing.name, comparing.parameter, tuple(comparing.session.map_names())
        if shown != self._shown:
            self._shown = shown
            self.widget.groups = groups_of(comparing)
        values = values_of(comparing)
        if values != self.widget.values:
            self.widget.values = values

    def act(self, message: dict) -> None:
        """Do what the user asks for."""
        comparing, name = self.comparing, message.get("name", "")
        value: Any = message.get("value")
        match message.get("do"):
            case "choose" if name == "model":
                comparing.choose_model(str(value))
            case "choose" if name == "parameter":
                comparing.choose_parameter(str(value))
            case "choose" if name in NAMES:
                comparing.wish(name, str(value))
                comparing.reset()
            case "text" if name in NAMES:
                comparing.wish(name, str(value))
            case "place" if name in NAMES:
                comparing.wish(name, value_at(int(value), comparing.choices[comparing.parameter]))
            case "place" if name == "seeds":
                comparing.set_count("seeds", int(value))
            case "text" if name in ("seed", "seeds", "steps"):
                comparing.set_count(name, str(value))
            case "random":
                comparing.set_count("seed", secrets.randbelow(LARGEST_RANDOM_SEED))
                comparing.reset()
            case "defaults":
                comparing.choose_model(comparing.name)

    def close(self) -> None:
        """Part them."""
        self._leave()
        self.widget.on_msg(self._hear, remove=True)


def groups_of(comparing: Comparing) -> list[dict[str, Any]]:
    """Return all controls in groups, as the panel wants them.

    Examples
    --------
    >>> from mesa_swarm.dashboard.session import Session
    >>> comparing = Comparing(Session("fire_fighting"))
    >>> [field["label"] for field in groups_of(comparing)[0]["fields"]]
    ['model', 'parameter', 'strategy in A', 'strategy in B']
    >>> comparing.close()
    """
    choice = {"kind": "choice", "live": True}
    fields = [
        {**choice, "name": "model", "label": "model", "help": "", "options": model_names()},
        {**choice, "name": "parameter", "label": "parameter", "options": list(comparing.choices)},
    ]
    fields[1]["help"] = "the one that differs; all others are as on the Watch page"
    return [
        {"title": "Two worlds", "fields": [*fields, *(_value_field(comparing, name) for name in NAMES)]},
        {"title": "Many seeds", "fields": _run_fields()},
    ]


def _value_field(comparing: Comparing, name: str) -> dict[str, Any]:
    """Return the control of the value in world A or B."""
    parameter = comparing.choices[comparing.parameter]
    field = field_of(parameter, comparing.session) or {}
    at_once = not isinstance(parameter.control, Slider)
    label = f"{label_of(parameter.name)} in {name}"
    said = parameter.help if name == NAMES[0] else ""
    return {**field, "name": name, "label": label, "help": said, "upload": False, "live": at_once}


def _run_fields() -> list[dict[str, Any]]:
    seeds = {"name": "seeds", "label": "seeds", "help": "1, 2, 3 ...: each is run with A and with B"}
    steps = {"name": "steps", "label": "steps", "help": "of each run, unless its model is done before"}
    return [
        {**seeds, "kind": "slider", "low": FEWEST_SEEDS, "high": MOST_SLID, "live": True},
        {**steps, "kind": "text", "live": True},
    ]


def values_of(comparing: Comparing) -> dict[str, dict[str, Any]]:
    """Return how each control is set, whether it waits for a reset, and what is wrong with it."""
    texts = {"model": comparing.name, "parameter": comparing.parameter, "seed": comparing.seed}
    texts |= {"seeds": comparing.seeds, "steps": comparing.steps}
    values: dict[str, dict[str, Any]] = {name: {"text": str(text)} for name, text in texts.items()}
    values["seeds"]["place"] = min(comparing.seeds, MOST_SLID)
    parameter = comparing.choices[comparing.parameter]
    for name, value in zip(NAMES, comparing.values, strict=True):
        values[name] = {"text": value_text(value)}
        if isinstance(parameter.control, Slider):
            values[name]["place"] = place_of(value, parameter)
    for name, entry in values.items():
        entry["waits"] = name in comparing.waiting
        entry["fault"] = comparing.faults.get(name, "")
    return values
