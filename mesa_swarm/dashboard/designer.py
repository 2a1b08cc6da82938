"""The constants of the fires from wished-for properties, with what follows from them said live."""

import threading
import warnings
from typing import Any

from mesa_swarm.dashboard.session import Session
from mesa_swarm.errors import FireConstantsWarning, SwarmError
from mesa_swarm.fire import FireConstants, design_constants

# name: (label, help, least, step, most)
WISHES = {
    "growth_time": ("growth time", "steps in which a fire that is left alone grows from T = 0 to 1", 100, 50, 10_000),
    "robots": ("robots needed", "so many put out a fire of the largest size ...", 0.5, 0.5, 20),
    "extinguish_time": ("extinguish time", "... in so many steps", 50, 50, 10_000),
    "balance_temperature": (
        "balance temperature",
        "of the largest fire: heating and cooling balance",
        0.05,
        0.05,
        0.95,
    ),
    "stay_time": ("stay", "steps that a cold robot can stay at the largest fire at T = 1", 10, 10, 1000),
    "rest_time": ("rest", "steps that a robot rests before it fights again", 10, 10, 1000),
}
USUAL = {
    "growth_time": 2000.0,
    "robots": 2.0,
    "extinguish_time": 1600.0,
    "balance_temperature": 0.6,
    "stay_time": 100.0,
    "rest_time": 60.0,
}
CONSTANTS = ("k1", "k2", "k3", "k4", "leave", "join")
# What silences a warning is the whole process's: one at a time.
_SILENCE = threading.Lock()


class Designer:
    """Wishes of what fires and robots are like, made into the constants of a session's model.

    Parameters
    ----------
    session : Session

    Examples
    --------
    >>> designer = Designer(Session("fire_fighting"))
    >>> designer.wish("growth_time", 1000)
    >>> round(designer.session.wishes["k1"], 6)
    0.000693
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.wishes = dict(USUAL)
        self._constants: FireConstants | None = None
        self._warned: tuple[str, ...] = ()
        self._fault = ""

    @property
    def fits(self) -> bool:
        """Whether the model has the constants."""
        return set(CONSTANTS) <= self.session.parameters.keys()

    def wish(self, name: str, value: float) -> None:
        """Wish for a property, and set the constants that give it."""
        self.wishes[name] = float(value)
        try:
            self._constants, self._warned = self._designed()
            self._fault = ""
        except SwarmError as error:
            self._fault = str(error)
            self.session.changed.tell()
        else:
            self.session.wish_all({key: getattr(self._constants, key) for key in CONSTANTS})

    def notes(self) -> list[tuple[str, str]]:
        """Return what there is to say of the constants, each "warning", "remark" or "fault" with its text."""
        if not self.fits:
            return []
        if self._fault:
            return [("fault", self._fault)]
        constants, warned = (self._constants, self._warned) if self._constants else self._designed()
        if any(self.session.wishes[key] != getattr(constants, key) for key in CONSTANTS):
            return [("remark", "k1 to k4, leave or join were set by hand; a wish sets all of them anew")]
        return [("warning" if remark in warned else "remark", remark) for remark in constants.remarks]

    def fields(self) -> list[dict[str, Any]]:
        """Return the sliders of the wishes."""
        return [
            {
                "name": name,
                "label": label,
                "help": text,
                "kind": "slider",
                "live": True,
                "wish": True,
                "low": 0,
                "high": _places(name),
            }
            for name, (label, text, *_) in WISHES.items()
        ]

    def place(self, name: str, place: int) -> None:
        """Wish for the value at a slider's place."""
        _, _, least, step, _ = WISHES[name]
        self.wish(name, round(least + place * step, 6))

    def values(self) -> dict[str, dict[str, Any]]:
        """Return how the sliders are set."""
        return {name: self._value(name, value) for name, value in self.wishes.items()}

    @staticmethod
    def _value(name: str, value: float) -> dict[str, Any]:
        _, _, least, step, _ = WISHES[name]
        return {"text": f"{value:g}", "place": round((value - least) / step), "fault": "", "waits": False}

    def _designed(self) -> tuple[FireConstants, tuple[str, ...]]:
        model = self.session.model
        largest = float(model.fires.area.max()) if model is not None and len(model.fires) else 16.0
        start = float(self.session.wishes.get("initial_temperature", 1.0))
        with _SILENCE, warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always", FireConstantsWarning)
            constants = design_constants(**self.wishes, initial_temperature=start, area=largest, largest_area=largest)
        return constants, tuple(str(warning.message) for warning in heard)


def _places(name: str) -> int:
    _, _, least, step, most = WISHES[name]
    return round((most - least) / step)
