"""One user's model, and the requested settings of the next."""

import math
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError
from dataclasses import fields, replace
from typing import Any, Protocol, TypeVar, cast

from mesa_swarm.dashboard.series import Series
from mesa_swarm.errors import InvalidValueError, check_count, in_words
from mesa_swarm.fire import FireConstants
from mesa_swarm.gallery import find_model
from mesa_swarm.parameters import Choice, Parameter, parameters_of
from mesa_swarm.robots.snapshots import DECISIONS
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES, Listeners
from mesa_swarm.viewing.player import Player
from mesa_swarm.world.map import Map, builtin_maps
from mesa_swarm.world.map_parts import stopping_when

MOST_ROBOTS = 10_000
LARGEST_UPLOAD = 1_000_000
LARGEST_SEED = 2**53 - 1
# Columns of the last steps that stay in memory for the inspector, and how much of them.
WATCHED = (*DECISIONS, "heard_layer", "heard_task", "radiation", "line")
MOST_WATCHED_BYTES = 20_000_000
MOST_WATCHED_STEPS = 1000


def checked_setting(parameter: Parameter, value: Any) -> Any:
    """Return what somebody settings for, as the parameter's type.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If it is no such value, or more robots than a page can take.

    Examples
    --------
    >>> checked_setting(Parameter("n_robots", 10, int, None), "12")
    12
    """
    value = parameter.checked(parameter.parse(value) if isinstance(value, str) else value)
    return check_count("n_robots", value, maximum=MOST_ROBOTS) if parameter.name == "n_robots" else value


def map_from(name: str, content: bytes) -> Map:
    """Return the map in a file that was handed over.

    Raises
    ------
    MapError, InvalidValueError
        If it is too large, of another kind, or not a map.

    Examples
    --------
    >>> map_from("hall.svg", b'<svg width="80" height="60"><circle cx="40" cy="20" r="5"/></svg>').name
    'hall'
    """
    if len(content) > LARGEST_UPLOAD:
        raise InvalidValueError(f"{name:.60} has {len(content):,} bytes; expected at most {LARGEST_UPLOAD:,}")
    if name.lower().endswith(".svg"):
        return Map.from_svg(content, name)
    if name.lower().endswith(".toml"):
        try:
            return Map.from_toml(content.decode(), name)
        except UnicodeDecodeError:
            raise InvalidValueError(f"{name:.60} is not UTF-8 text; expected a map as TOML") from None
    raise InvalidValueError(f"{name!r:.60} is no map; expected a file that ends in .svg or .toml")


def seed_from(text: str | int) -> int:
    """Return the seed that somebody typed.

    Raises
    ------
    InvalidValueError
        If it is none.

    Examples
    --------
    >>> seed_from("7")
    7
    """
    try:
        return check_count("seed", int(text), maximum=LARGEST_SEED)
    except ValueError:
        raise InvalidValueError(f"seed is {text!r:.60}; expected a whole number from 0 on") from None


# Parameters that a running model takes at once.
LIVE = frozenset(field.name for field in fields(FireConstants)) - {"remarks"}
USUAL_SPEED = 60.0
# Seconds for the steps before anything is shown; what is left of them is played, and can be paused.
LONGEST_WAIT = 2.0
READER = "map"


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
    settings : mapping, optional
        Parameters that are not the model's defaults.
    seed : int
        Of everything random, 0 to 2**53 - 1.
    steps : int
        Taken before anything is shown, as many as `LONGEST_WAIT` permits; the others are played then.
    find : function
        Returns the class of a model by its name.

    Attributes
    ----------
    name : str
    model_class : type
    parameters : dict of Parameter
    settings : dict
        Values of all parameters, for the next model; those in `LIVE` also of the present one.
    seed : int
    faults : dict of str
        What is wrong with a wish, by parameter, or with "seed" or an "upload".
    unbuilt : bool
        Whether `error` says why there is no model as wished, not what went wrong in one.
    note : str
        That fewer steps were taken than asked for; empty if all were, or `error` says why not.
    goal : int
        The step up to which it plays by itself, 0 for none.
    own_speed : float
        Steps a second that the user requested for, also while it plays as fast as it goes up to its goal.
    built : dict
        What the present model was built from, and was given since.
    series : Series
        What was measured of the present model.
    chosen_charts : dict of list of str
        Keys of the charts that the user wants to see, by model.
    straight : bool
        Whether nothing was changed on the way: the same settings give the same run.
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
        settings: Mapping[str, Any] | None = None,
        seed: int = 1,
        steps: int = 0,
        find: Callable[[str], type[SwarmModel]] = find_model,
    ) -> None:
        self._find = find
        self.uploads: dict[str, Map] = {}
        # Set once the map that is being read is waited for no longer.
        self._reading = threading.Event()
        self._one_reader = threading.Lock()
        self.series = Series()
        self.adopted = Listeners()
        self._companions: dict[Callable[[Session], Companion], Companion] = {}
        self.chosen_charts: dict[str, list[str]] = {}
        self.faults: dict[str, str] = {}
        self.built: dict[str, Any] = {}
        self.note, self.unbuilt, self.seed, self.goal = "", False, seed, 0
        super().__init__()
        self.set_speed(USUAL_SPEED)
        self._enter(name, dict(settings or {}), seed)
        self.reset(steps)

    @property
    def waiting(self) -> frozenset[str]:
        """The parameters that will be as requested only after a reset; "seed" among them."""
        requested = {**self.settings, "seed": self.seed}
        return frozenset(name for name, value in requested.items() if self.built.get(name) != value)

    def choose(self, name: str, settings: Mapping[str, Any] | None = None) -> None:
        """Go on with another model, with its defaults but for these settings."""
        self.loop.pause()
        with self.lock:
            self._enter(name, dict(settings or {}), self.seed)
        self.reset()

    def reset(self, steps: int = 0) -> None:
        """Stop, and build a new model as wished; the old one stays where that cannot be."""
        self.loop.pause()
        with self.minding():
            self._forget_goal()
            self.error = self.note = ""
            self._build()
            self._catch_up(steps)
            if self.model is not None:
                self._keep_window(self.model)
        if self.goal:
            self.hand_over()
            self.loop.speed = AS_FAST_AS_IT_GOES
            self.play()
        else:
            self.rest()

    def rest(self) -> None:
        """Show how things are at rest; what is paused goes no further towards its goal."""
        if self.goal and not self.playing and self.model is not None:
            done, goal = self.model.completed, self.goal
            self._forget_goal()
            if done >= goal or self.error:
                self.note = ""
            elif self.model.running:
                self.note = f"step {done:,} of {goal:,}: it was paused on its way; play on from here"
            else:
                self.note = ended_early(done, goal)
        super().rest()

    def set_speed(self, speed: float) -> None:
        """Play at so many steps a second from now on."""
        self.own_speed = speed
        super().set_speed(speed)

    def go_back(self) -> None:
        """Start over as the present model was built, or from the defaults if there is none."""
        with self.lock:
            last = dict(self.built)
            self.seed = last.pop("seed", self.seed)
            self.settings = last or self._defaults()
            self.faults = {}
        self.reset()

    def remade(self) -> SwarmModel:
        """Return a model as the present one was at its start; if the run is `straight`, it takes the same steps."""
        with self.lock:
            return self._made(self.built)

    def set_parameter(self, name: str, value: Any) -> None:
        """Wish for a parameter, as its type, and give it to the present model where that can take it."""
        with self.lock:
            try:
                self._take({name: value})
            except Exception as problem:  # what is wrong with a wish is said beside it
                self.faults[name] = in_words(problem)
        self.show()
        self.changed.tell()

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Wish for several parameters at once."""
        with self.lock:
            self._take(values)
        self.show()
        self.changed.tell()

    def set_defaults(self) -> None:
        """Wish for the model's defaults."""
        self.set_parameters(self._defaults())

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
        """Read a map from a file that the user hands over, in a thread without the lock, and build the model on it.

        Another upload, another model and the end of the session cancel it: what it reads is then dropped.
        """
        with self.lock:
            self._reading.set()
            self._reading = cancelled = threading.Event()
        threading.Thread(target=self._read_map, args=(name, content, cancelled), name=READER, daemon=True).start()

    def _read_map(self, name: str, content: bytes, cancelled: threading.Event) -> None:
        chart, fault = None, ""
        try:
            # One at a time: a user who uploads again and again waits for none of them, and neither do others.
            with self._one_reader, stopping_when(cancelled.is_set):
                if not cancelled.is_set():
                    chart = map_from(name, content)
        except CancelledError:
            return
        except Exception as problem:  # whatever is in a user's file
            fault = in_words(problem)
        with self.lock:
            if cancelled.is_set():
                return
            self._take_map(chart, fault)
        if chart is not None:
            self.reset()
        else:
            self.changed.tell()

    def _take_map(self, chart: Map | None, fault: str) -> None:
        self.faults.pop("map", None)
        if chart is None:
            self.faults["map"] = fault
            return
        known = f"{chart.name} (yours)" if chart.name in builtin_maps() else chart.name
        self.uploads[known], self.settings["map"] = chart, known

    def map_names(self) -> list[str]:
        """Return the maps that may be requested for: the model's own first, then the others, then uploaded ones."""
        parameter = self.parameters.get("map")
        own = parameter.control.options if parameter and isinstance(parameter.control, Choice) else ()
        return list(dict.fromkeys([*own, *builtin_maps(), *self.uploads]))

    def adopt(self, model: SwarmModel, name: str, settings: Mapping[str, Any], seed: int) -> None:
        """Stop, and go on with a model that was built elsewhere and has taken steps.

        Parameters
        ----------
        model : SwarmModel
        name : str
            Under which its class is found.
        settings : mapping
            The parameters from which a reset builds it anew; a Map is kept as if it had been uploaded.
        seed : int
        """
        self.loop.pause()
        with self.lock:
            given = dict(settings)
            if isinstance(given.get("map"), Map):
                chart = given["map"]
                given["map"] = f"{chart.name} (recorded)"
                self.uploads[given["map"]] = chart
            self._enter(name, given, seed)
            self.model, self.built, self.straight = model, {**self.settings, "seed": seed}, False
            self.series.follow(model)
            self._keep_window(model)
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
        self._reading.set()
        super().close()
        for companion in self._companions.values():
            companion.close()
        self._companions.clear()
        self.series.follow(None)
        self.adopted.clear()
        self.uploads.clear()

    def _enter(self, name: str, settings: dict[str, Any], seed: int) -> None:
        self._reading.set()
        self.model_class = self._find(name)
        self.name, self.seed = name, seed
        self.parameters = parameters_of(self.model_class)
        self.settings = self._defaults() | settings
        self.faults, self.built = {}, {}
        self.model, self.error, self.straight = None, "", True
        self.note, self.unbuilt = "", False
        self._forget_goal()
        self.past.clear()

    def _defaults(self) -> dict[str, Any]:
        return {name: parameter.default for name, parameter in self.parameters.items()}

    def _build(self) -> None:
        """Go on with a new model as requested."""
        self.unbuilt = True
        model = self._made({**self.settings, "seed": self.seed})
        self.past.clear()
        self.series.follow(model)
        watch_closely(model)
        self.model, self.built, self.straight = model, {**self.settings, "seed": self.seed}, True
        self.unbuilt = False

    def _catch_up(self, steps: int) -> None:
        """Take steps, as many as there is time for; if those were not all, the last of them is the goal."""
        if self.model is None:
            return
        end = math.inf
        while self.model.running and self.model.completed < steps:
            self.model.step()
            # The first step may compile kernels, once in the life of an installation.
            end = min(end, time.monotonic() + LONGEST_WAIT)
            if time.monotonic() > end and self.model.completed < steps:
                self.goal = steps
                self.note = f"step {steps:,} takes a while: the run is played up to there, and Pause ends that"
                return
        if self.model.completed < steps:
            self.note = ended_early(self.model.completed, steps)

    def _forget_goal(self) -> None:
        if self.goal:
            self.loop.speed = self.own_speed
        self.goal = 0

    def _play_step(self, stop: threading.Event) -> bool:
        goes_on = super()._play_step(stop)
        reached = self.goal and self.model is not None and self.model.completed >= self.goal
        return goes_on and not reached

    def _made(self, given: Mapping[str, Any]) -> SwarmModel:
        """Return a model of these parameters, of which "seed" is one."""
        named = {name: value for name, value in given.items() if name != "seed"}
        if named.get("map") in self.uploads:
            named["map"] = self.uploads[named["map"]]
        return self.model_class(**named, rng=given["seed"])

    def _checked(self, name: str, value: Any) -> Any:
        if name == "map" and value in self.map_names():
            return value
        return checked_setting(self.parameters[name], value)

    def _take(self, values: Mapping[str, Any]) -> None:
        """Wish for these values, unless one of them is refused: then all stays as it was."""
        before = self.settings
        self.settings = before | {name: self._checked(name, value) for name, value in values.items()}
        try:
            self._give()
        except Exception:
            self.settings = before
            raise
        for name in values:
            self.faults.pop(name, None)

    def _give(self) -> None:
        """Give the present model the settings that it can take."""
        if self.model is None:
            return
        requested = {name: self.settings[name] for name in LIVE & self.settings.keys()}
        if any(self.built.get(name) != value for name, value in requested.items()):
            self.model.fire_constants = replace(self.model.fire_constants, **requested, remarks=())
            self.built |= requested
            self.straight = self.model.completed == 0 and self.straight
            self.faults = {name: fault for name, fault in self.faults.items() if name not in requested}
            self.look_now()


def ended_early(step: int, goal: int) -> str:
    """Return in words that a run was over before the step that was asked for.

    Examples
    --------
    >>> ended_early(1596, 3000)
    'the run ended at step 1,596, before step 3,000'
    """
    return f"the run ended at step {step:,}, before step {goal:,}"


def watch_closely(model: SwarmModel) -> None:
    """Have a model keep what robots knew and did in its last steps, unless it keeps what it wants itself.

    Examples
    --------
    >>> model = SwarmModel(rng=1)
    >>> watch_closely(model)
    >>> len(model.run(5).watched)
    5
    """
    if model.watched is None:
        a_step = sum(model.swarm.columns[name].nbytes for name in WATCHED)
        model.watch(last=max(2, min(MOST_WATCHED_STEPS, MOST_WATCHED_BYTES // max(a_step, 1))), columns=WATCHED)
