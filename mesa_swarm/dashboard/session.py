"""What one browser session owns: its model, and the wishes for the next one."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, Protocol, TypeVar, cast

from mesa_swarm.dashboard.inspection import watch_closely
from mesa_swarm.dashboard.listeners import Listeners
from mesa_swarm.dashboard.player import Player
from mesa_swarm.dashboard.readings import in_words
from mesa_swarm.dashboard.series import Series
from mesa_swarm.dashboard.wishes import checked_wish, map_from, seed_from
from mesa_swarm.errors import InvalidValueError
from mesa_swarm.fire import FireConstants
from mesa_swarm.gallery import find_model
from mesa_swarm.model import SwarmModel
from mesa_swarm.parameters import Choice, parameters_of
from mesa_swarm.world.map import Map, builtin_maps

# Parameters that a running model takes at once.
LIVE = frozenset(field.name for field in fields(FireConstants)) - {"remarks"}
USUAL_SPEED = 60.0
# Seconds for the steps before anything is shown: whoever waits longer takes the page for a broken one.
LONGEST_WAIT = 5.0


class Companion(Protocol):
    """What a part of the page keeps for a session, also while another part is looked at."""

    def close(self) -> None:
        """Stop, and let go of everything."""


Kind = TypeVar("Kind", bound=Companion)


class Session(Player):
    """A model that one user chooses, changes, plays and resets.

    Parameters
    ----------
    name : str
        Of a model of the gallery.
    wishes : mapping, optional
        Parameters that are not the model's defaults.
    seed : int
        Of everything random, 0 to 2**53 - 1.
    steps : int
        Taken before anything is shown, as many as `LONGEST_WAIT` permits.
    find : function
        Returns the class of a model by its name.

    Attributes
    ----------
    name : str
    model_class : type
    parameters : dict of Parameter
    wishes : dict
        Values of all parameters, for the next model; those in `LIVE` also of the present one.
    seed : int
    faults : dict of str
        What is wrong with a wish, by parameter, or with "seed" or an "upload".
    unbuilt : bool
        Whether `error` says why there is no model as wished, not what went wrong in one.
    note : str
        That fewer steps were taken than asked for, empty if all were.
    built : dict
        What the present model was built from, and was given since.
    series : Series
        What was measured of the present model.
    chosen_charts : dict of list of str
        Keys of the charts that the user wants to see, by model.
    straight : bool
        Whether nothing was changed on the way: the same wishes give the same run.
    adopted : Listeners
        Told when it goes on with a model that was built elsewhere.

    Examples
    --------
    >>> session = Session("fire_fighting")
    >>> session.step()
    >>> session.past.shown.readings[0]
    ('Fires burning', '7 of 7')
    """

    def __init__(
        self,
        name: str,
        wishes: Mapping[str, Any] | None = None,
        seed: int = 1,
        steps: int = 0,
        find: Callable[[str], type[SwarmModel]] = find_model,
    ) -> None:
        self._find = find
        self.uploads: dict[str, Map] = {}
        self.series = Series()
        self.adopted = Listeners()
        self._companions: dict[Callable[[Session], Companion], Companion] = {}
        self.chosen_charts: dict[str, list[str]] = {}
        self.faults: dict[str, str] = {}
        self.built: dict[str, Any] = {}
        self.note, self.unbuilt, self.seed = "", False, seed
        super().__init__()
        self.loop.speed = USUAL_SPEED
        self._enter(name, dict(wishes or {}), seed)
        self.reset(steps)

    @property
    def waiting(self) -> frozenset[str]:
        """The parameters that will be as wished only after a reset; "seed" among them."""
        wished = {**self.wishes, "seed": self.seed}
        return frozenset(name for name, value in wished.items() if self.built.get(name) != value)

    def choose(self, name: str, wishes: Mapping[str, Any] | None = None) -> None:
        """Go on with another model, with its defaults but for these wishes."""
        self.loop.pause()
        with self.lock:
            self._enter(name, dict(wishes or {}), self.seed)
        self.reset()

    def reset(self, steps: int = 0) -> None:
        """Stop, and build a new model as wished; the old one stays where that cannot be."""
        self.loop.pause()
        with self.minding():
            self.error = self.note = ""
            self._build()
            self._catch_up(steps)
        self.rest()

    def go_back(self) -> None:
        """Start over as the present model was built, or from the defaults if there is none."""
        with self.lock:
            last = dict(self.built)
            self.seed = last.pop("seed", self.seed)
            self.wishes = last or self._defaults()
            self.faults = {}
        self.reset()

    def remade(self) -> SwarmModel:
        """Return a model as the present one was at its start; if the run is `straight`, it takes the same steps."""
        with self.lock:
            return self._made(self.built)

    def wish(self, name: str, value: Any) -> None:
        """Wish for a parameter, as its type, and give it to the present model where that can take it."""
        with self.lock:
            try:
                self._take({name: value})
            except Exception as problem:  # what is wrong with a wish is said beside it
                self.faults[name] = in_words(problem)
        self.show()
        self.changed.tell()

    def wish_all(self, values: Mapping[str, Any]) -> None:
        """Wish for several parameters at once."""
        with self.lock:
            self._take(values)
        self.show()
        self.changed.tell()

    def wish_defaults(self) -> None:
        """Wish for the model's defaults."""
        self.wish_all(self._defaults())

    def set_seed(self, text: str | int) -> None:
        """Take another seed for the next model."""
        with self.lock:
            try:
                self.seed = seed_from(text)
                self.faults.pop("seed", None)
            except InvalidValueError as problem:
                self.faults["seed"] = str(problem)
        self.changed.tell()

    def upload(self, name: str, content: bytes) -> None:
        """Take a map from a file that the user hands over, and build the model on it."""
        with self.lock:
            try:
                chart = map_from(name, content)
            except Exception as problem:  # whatever is in a user's file
                self.faults["map"] = in_words(problem)
                taken = False
            else:
                self.faults.pop("map", None)
                taken = True
                known = f"{chart.name} (yours)" if chart.name in builtin_maps() else chart.name
                self.uploads[known], self.wishes["map"] = chart, known
        if taken:
            self.reset()
        else:
            self.changed.tell()

    def map_names(self) -> list[str]:
        """Return the maps that may be wished for: the model's own first, then the others, then uploaded ones."""
        parameter = self.parameters.get("map")
        own = parameter.control.options if parameter and isinstance(parameter.control, Choice) else ()
        return list(dict.fromkeys([*own, *builtin_maps(), *self.uploads]))

    def adopt(self, model: SwarmModel, name: str, wishes: Mapping[str, Any], seed: int) -> None:
        """Stop, and go on with a model that was built elsewhere and has taken steps.

        Parameters
        ----------
        model : SwarmModel
        name : str
            Under which its class is found.
        wishes : mapping
            The parameters from which a reset builds it anew; a Map is kept as if it had been uploaded.
        seed : int
        """
        self.loop.pause()
        with self.lock:
            given = dict(wishes)
            if isinstance(given.get("map"), Map):
                chart = given["map"]
                given["map"] = f"{chart.name} (recorded)"
                self.uploads[given["map"]] = chart
            self._enter(name, given, seed)
            self.model, self.built, self.straight = model, {**self.wishes, "seed": seed}, False
        self.rest()
        self.adopted.tell()

    def companion(self, kind: Callable[["Session"], Kind]) -> Kind:
        """Return the one companion of this kind, made when it is first asked for, and closed with the session."""
        with self.lock:
            if kind not in self._companions:
                self._companions[kind] = kind(self)
            return cast(Kind, self._companions[kind])  # the one that was made by this kind

    def close(self) -> None:
        """Stop for good, and let go of everything."""
        super().close()
        for companion in self._companions.values():
            companion.close()
        self._companions.clear()
        self.series.follow(None)
        self.adopted.clear()
        self.uploads.clear()

    def _enter(self, name: str, wishes: dict[str, Any], seed: int) -> None:
        self.model_class = self._find(name)
        self.name, self.seed = name, seed
        self.parameters = parameters_of(self.model_class)
        self.wishes = self._defaults() | wishes
        self.faults, self.built = {}, {}
        self.model, self.error, self.straight = None, "", True
        self.note, self.unbuilt = "", False
        self.past.clear()

    def _defaults(self) -> dict[str, Any]:
        return {name: parameter.default for name, parameter in self.parameters.items()}

    def _build(self) -> None:
        """Go on with a new model as wished."""
        self.unbuilt = True
        model = self._made({**self.wishes, "seed": self.seed})
        self.past.clear()
        self.series.follow(model)
        watch_closely(model)
        self.model, self.built, self.straight = model, {**self.wishes, "seed": self.seed}, True
        self.unbuilt = False

    def _catch_up(self, steps: int) -> None:
        """Take steps, as many as there is time for, and say if those were not all."""
        if self.model is None:
            return
        end = math.inf
        while self.model.running and self.model.completed < steps:
            self.model.step()
            # The first step may compile kernels, once in the life of an installation.
            end = min(end, time.monotonic() + LONGEST_WAIT)
            if time.monotonic() > end and self.model.completed < steps:
                done = f"step {self.model.completed:,} of {steps:,}"
                self.note = f"{done}: more was asked for than can be computed at once; play on from here"
                return

    def _made(self, given: Mapping[str, Any]) -> SwarmModel:
        """Return a model of these parameters, of which "seed" is one."""
        named = {name: value for name, value in given.items() if name != "seed"}
        if named.get("map") in self.uploads:
            named["map"] = self.uploads[named["map"]]
        return self.model_class(**named, rng=given["seed"])

    def _checked(self, name: str, value: Any) -> Any:
        if name == "map" and value in self.map_names():
            return value
        return checked_wish(self.parameters[name], value)

    def _take(self, values: Mapping[str, Any]) -> None:
        """Wish for these values, unless one of them is refused: then all stays as it was."""
        before = self.wishes
        self.wishes = before | {name: self._checked(name, value) for name, value in values.items()}
        try:
            self._give()
        except Exception:
            self.wishes = before
            raise
        for name in values:
            self.faults.pop(name, None)

    def _give(self) -> None:
        """Give the present model the wishes that it can take."""
        if self.model is None:
            return
        wished = {name: self.wishes[name] for name in LIVE & self.wishes.keys()}
        if any(self.built.get(name) != value for name, value in wished.items()):
            self.model.fire_constants = replace(self.model.fire_constants, **wished, remarks=())
            self.built |= wished
            self.straight = self.model.completed == 0 and self.straight
            self.faults = {name: fault for name, fault in self.faults.items() if name not in wished}
            self.look_now()
