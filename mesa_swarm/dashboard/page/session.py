"""One user's model, and the requested settings of the next: what users type and upload is checked here."""

import math
import threading
import time
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from decimal import Decimal
from typing import Any, Protocol, TypeVar, cast

from mesa_swarm.base.errors import InvalidValueError, RecordingError, SwarmError, check_choice, check_count, error_line
from mesa_swarm.dashboard.page.edits import MOST_EDITS, MOST_ROBOTS, Before, Edit, LiveRun, Repetition
from mesa_swarm.dashboard.page.series import Series
from mesa_swarm.maps.map import Map, builtin_maps
from mesa_swarm.maps.map_parts import stop_reading_when
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.info import USUAL_SPEED, model_info
from mesa_swarm.model.parameters import Choice, Parameter, parameters_of
from mesa_swarm.recording.continuing import hand_over
from mesa_swarm.robots.actuators import ACT
from mesa_swarm.robots.radio import HEARD, SEND
from mesa_swarm.robots.snapshots import DECISIONS
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES, Listeners
from mesa_swarm.viewing.player import Player

# Columns of the last steps that stay in memory for the inspector, and how much of them.
WATCHED = (*DECISIONS, "heard_layer", "heard_task", "radiation", "line")
MOST_WATCHED_BYTES = 20_000_000
MOST_WATCHED_STEPS = 1000
# States to go back to, and their bytes together.
MOST_UNDONE, MOST_UNDONE_BYTES = 50, 50_000_000
# Longest time for steps before anything is shown, s; the remaining ones are played, and can be paused.
LONGEST_WAIT = 2.0
# Longest time to wait for the end of the step that is on its way when the user pauses, s.
LONGEST_STEP = 0.5
READER = "map"


@contextmanager
def noted_faults(faults: dict[str, str], name: str) -> Iterator[None]:
    """Note in `faults`, shown beside the control of this name, why its change is refused; else clear it."""
    try:
        yield
    except Exception as problem:  # a model of a user's may raise anything
        faults[name] = reported(problem)
    else:
        faults.pop(name, None)


class Companion(Protocol):
    """State of one tab of the page, which stays while another tab is shown."""

    def close(self) -> None:
        """Stop, and release everything."""


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
        Taken before anything is shown, for at most `LONGEST_WAIT`; the others are then played.
    edits : sequence of Edit
        Changes by hand, each applied when its step is reached.
    find : function
        Returns the class of a model by its name.

    Attributes
    ----------
    name : str
    model_class : type
    parameters : dict of Parameter
    settings : dict
        Requested values of all parameters; those that belong to the beginning of a run wait for the next one.
    seed : int
    faults : dict of str
        Why a setting was refused, by parameter or "seed".
    unbuilt : bool
        Whether `error` is about building the model, not about running it.
    note : str
        Why fewer steps were taken than requested; empty if all were, or if `error` has the reason.
    goal : int
        The step up to which it plays automatically, 0 for none.
    own_speed : float
        Steps a second that the user requested last, else those of the model; to its goal it plays as fast as it goes
        until another is requested.
    built : dict
        Settings of the present model.
    series : Series
        Measurements of the present model.
    chosen_charts : dict of list of str
        Keys of the charts that the user chose, by model.
    run : LiveRun or None
        The present model, and what was changed by hand.
    straight : bool
        Whether the same settings and `edits` reproduce the run.
    adopted : Listeners
        Notified when the session continues with a model built elsewhere.

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
        edits: Sequence[Edit] = (),
    ) -> None:
        self._find = find
        self.run: LiveRun | None = None
        self._planned_edits: list[Edit] = list(edits)
        self._before: list[Before] = []
        self.uploads: dict[str, Map] = {}
        # Set when the map that is being read is not needed any more.
        self._reading = threading.Event()
        self._one_reader = threading.Lock()
        self.series = Series()
        self.adopted = Listeners()
        self._companions: dict[Callable[[Session], Companion], Companion] = {}
        self.chosen_charts: dict[str, list[str]] = {}
        self.faults: dict[str, str] = {}
        self.built: dict[str, Any] = {}
        self.note, self.unbuilt, self.seed, self.goal = "", False, seed, 0
        self.straight, self._plays_on = True, False
        super().__init__()
        self._models_speed = USUAL_SPEED
        self.set_speed(USUAL_SPEED)
        self._enter(name, dict(settings or {}), seed)
        self.reset(steps, edits)

    @property
    def waiting(self) -> frozenset[str]:
        """The parameters that will be as requested only after a reset; "seed" among them."""
        settings = {**self.settings, "seed": self.seed}
        return frozenset(name for name, value in settings.items() if self.built.get(name) != value)

    def choose(
        self,
        name: str,
        settings: Mapping[str, Any] | None = None,
        seed: int | None = None,
        steps: int = 0,
        edits: Sequence[Edit] = (),
    ) -> None:
        """Continue with another model, with its defaults except for these settings, after these steps and edits."""
        self.loop.pause()
        with self.lock:
            self._enter(name, dict(settings or {}), self.seed if seed is None else seed)
        self.reset(steps, edits)

    def go_on_to(self, step: int, *, plays: bool, speed: float | None = None) -> None:
        """Play up to a step as fast as it goes, as after a reload; then play on at this speed, or stop there."""
        if speed is not None:
            self.set_speed(speed)
        if self.model is None or self.error:
            return
        if self.model.completed < step and self.model.running:
            self.goal, self._plays_on = step, plays
            self.note = f"going on to step {step:,}, where the page was; press Pause to stop"
            self.loop.speed = AS_FAST_AS_IT_GOES
            self.play()
        elif plays:
            self.play()

    def reset(self, steps: int = 0, edits: Sequence[Edit] = ()) -> None:
        """Stop, and build a new model from the settings; the old one stays if that fails.

        It takes these steps, with these changes by hand on the way.
        """
        self.loop.pause()
        self._planned_edits = list(edits)
        with self.capture_errors():
            self._forget_goal()
            self.error = self.note = ""
            self._build()
            self._catch_up(steps)
            if self.model is not None:
                self._limit_collected(self.model)
        if self.goal:
            self.hand_over()
            self.loop.speed = AS_FAST_AS_IT_GOES
            self.play()
        else:
            self.rest()

    def rest(self) -> None:
        """Show the state at rest; pausing cancels the goal."""
        if self.goal and not self.playing and self.model is not None:
            completed, goal, plays_on = self._count_steps(self.model), self.goal, self._plays_on
            self._forget_goal()
            if completed >= goal or self.error:
                self.note = ""
            elif self.model.running:
                self.note = f"step {completed:,} of {goal:,}: paused early; press Play to continue"
            else:
                self.note = describe_early_end(completed, goal)
            super().rest()
            if plays_on and completed >= goal and not self.error:
                self.play()
            return
        super().rest()

    def _count_steps(self, model: SwarmModel) -> int:
        """Return how many steps a model has completed, also the one that is on its way, if it ends soon."""
        is_held = self.lock.acquire(timeout=LONGEST_STEP)
        try:
            return model.completed
        finally:
            if is_held:
                self.lock.release()

    def set_speed(self, speed: float) -> None:
        """Set the number of steps a second, at once; also on the way to a goal, to which it went as fast as it goes."""
        self.own_speed = speed
        super().set_speed(speed)

    def go_back(self) -> None:
        """Start again with the settings of the present model, or with the defaults if there is no model."""
        with self.lock:
            last = dict(self.built)
            self.seed = last.pop("seed", self.seed)
            self.settings = last or self._defaults()
            self.faults = {}
        self.reset()

    def repetition(self) -> Repetition:
        """Return the present run before its first step; if it is `straight`, its steps are the same."""
        with self.lock:
            if self.run is None:
                raise InvalidValueError("there is no model; press Reset first")
            return Repetition(self.run)

    @property
    def edits(self) -> tuple[Edit, ...]:
        """What was changed by hand in the present run."""
        return tuple(self.run.edits) if self.run is not None else ()

    def edit(self, do: str, *values: float, in_place: bool = False) -> None:
        """Change the present model by hand, as one of `EDITS` does; an error changes nothing.

        `in_place` continues the last edit: a robot that is dragged on.
        """
        with self.lock:
            if self.run is None or self.error:
                raise InvalidValueError("there is no model to change; press Reset first")
            self.look_now()
            before = None if in_place else self._store_state(do)
            self.run.edit(do, values, in_place=in_place)
            self._note_hand_change()
            if before is not None:
                self._remember(before)
            elif not in_place:  # going back farther would take back this change too
                self._before = []
        self.retake()

    @property
    def undoable(self) -> Before | None:
        """The state to which `undo` goes back, None if there is none."""
        return self._before[-1] if self._before else None

    def undo(self) -> None:
        """Go back to the state before the last change by hand, also in time."""
        self.loop.pause()
        with self.lock:
            if not self._before or self.run is None:
                return
            before = self._before.pop()
            old, model = self.run.model, self.run.restore_model(before.state, before.at_start)
            self._rewind(old, model)
            self.run.model, self.run.at_start, self.run.edits = model, before.at_start, list(before.edits)
            self.settings, self.built = dict(before.settings), dict(before.built)
            self._place(model)
        self.retake()

    def _rewind(self, old: SwarmModel, model: SwarmModel) -> None:
        """Let observers continue with a model; after a way back in time only the measurements do."""
        if model.completed < old.completed:
            self.recent.cut(model.completed)
            old.observers = [self.series]
        hand_over(old, model, ["state before a change by hand"])

    def _store_state(self, do: str) -> Before | None:
        """Return the present state; None for a model that has something that cannot be stored."""
        if self.run is None:
            return None
        try:
            state = self.run.store()
        except RecordingError:
            return None
        step = self.run.model.completed
        return Before(do, step, state, self.edits, self.run.at_start, dict(self.settings), dict(self.built))

    def _remember(self, before: Before) -> None:
        self._before.append(before)
        while len(self._before) > MOST_UNDONE or sum(len(moment.state) for moment in self._before) > MOST_UNDONE_BYTES:
            self._before.pop(0)

    def _note_hand_change(self) -> None:
        self.straight = self.straight and len(self.edits) <= MOST_EDITS

    def _place(self, model: SwarmModel) -> None:
        """Go on with another model of the same run."""
        self.model = model
        watch_closely(model)

    def set_parameter(self, name: str, value: Any) -> None:
        """Request a value of a parameter, and apply it to the present model if it can change during a run."""
        with self.lock, noted_faults(self.faults, name):
            self._take({name: value})
        self.retake()

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Request values of several parameters at once."""
        with self.lock:
            self._take(values)
        self.retake()

    def set_defaults(self) -> None:
        """Request the model's defaults."""
        self.set_parameters(self._defaults())

    def set_seed(self, text: str | int) -> None:
        """Set the seed of the next model."""
        with self.lock, noted_faults(self.faults, "seed"):
            self.seed = whole_number("seed", text)
            if self._is_new:
                self._build()
        self.retake()

    def upload(self, name: str, content: bytes) -> None:
        """Read a map from an uploaded file, in a thread without the lock, and build the model on it.

        Another upload, another model and the end of the session cancel it.
        """
        with self.lock:
            self._reading.set()
            self._reading = cancelled = threading.Event()
        threading.Thread(target=self._read_map, args=(name, content, cancelled), name=READER, daemon=True).start()

    def _read_map(self, name: str, content: bytes, cancelled: threading.Event) -> None:
        new_map, fault = None, ""
        try:
            # One at a time; another upload cancels the one before.
            with self._one_reader, stop_reading_when(cancelled.is_set):
                if not cancelled.is_set():
                    new_map = map_from(name, content)
        except CancelledError:
            return
        except Exception as problem:  # a user's file may contain anything
            fault = error_line(problem)
        with self.lock:
            if cancelled.is_set():
                return
            self._take_map(new_map, fault)
        if new_map is not None:
            self.reset()
        else:
            self.changed.notify()

    def _take_map(self, chart: Map | None, fault: str) -> None:
        self.faults.pop("map", None)
        if chart is None:
            self.faults["map"] = fault
            return
        name = f"{chart.name} (yours)" if chart.name in builtin_maps() else chart.name
        self.uploads[name], self.settings["map"] = chart, name

    def take_map(self, chart: Map) -> None:
        """Offer a map that was drawn, and build the model on it."""
        if "map" not in self.parameters:
            raise InvalidValueError(f"{self.name} has a map of its own; save the map, and use it with another model")
        with self.lock:
            self._take_map(chart, "")
        self.reset()

    def map_names(self, parameter: Parameter | None = None) -> list[str]:
        """Return the maps that may be requested: those that a parameter offers, else all built in, then uploaded ones.

        By default the parameter `map` of the model.
        """
        parameter = parameter or self.parameters.get("map")
        charts = parameter.control.options if parameter and isinstance(parameter.control, Choice) else builtin_maps()
        return list(dict.fromkeys([*charts, *self.uploads]))

    def find_map(self, name: str, value: Any) -> Any:
        """Return the uploaded map that a value of the parameter `map` names; any other value as it is."""
        return self.uploads.get(value, value) if name == "map" else value

    def settings_for(self, name: str, varied: Container[str]) -> dict[str, Any]:
        """Return what runs of a model elsewhere have besides what is varied: the parameters that are not its defaults.

        None for another model than that of the session.
        """
        return {
            key: value
            for key, value in self.settings.items()
            if self.name == name and key not in varied and value != self.parameters[key].default
        }

    def adopt(self, model: SwarmModel, name: str, settings: Mapping[str, Any], seed: int) -> None:
        """Stop, and continue with a model that was built elsewhere and has taken steps; a Map counts as uploaded."""
        self.loop.pause()
        with self.lock:
            choices = dict(settings)
            if isinstance(choices.get("map"), Map):
                chart = choices["map"]
                choices["map"] = f"{chart.name} (recorded)"
                self.uploads[choices["map"]] = chart
            self._enter(name, choices, seed)
            self.built, self.straight = {**self.settings, "seed": seed}, False
            self.run = LiveRun(self._make_model, self.parameters, self.built, model)
            self.model = model
            self.series.follow(model)
            self._limit_collected(model)
        self.rest()
        self.adopted.notify()

    def companion(self, kind: Callable[["Session"], Kind]) -> Kind:
        """Return the one companion of this kind, made at the first call, and closed with the session."""
        with self.lock:
            if kind not in self._companions:
                self._companions[kind] = kind(self)
            return cast(Kind, self._companions[kind])  # the one that was made by this kind

    def close(self) -> None:
        """Stop, and release everything."""
        self._reading.set()
        super().close()
        self.run, self._before = None, []
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
        self.model, self.run, self.error, self.straight = None, None, "", True
        self._before = []
        self.note, self.unbuilt = "", False
        self._forget_goal()
        self.past.clear()
        self._take_speed()

    def _take_speed(self) -> None:
        """Play as fast as this model is usually played, unless the user has chosen a speed."""
        was_chosen = self.own_speed != self._models_speed
        try:
            self._models_speed = model_info(self.model_class).speed
        except Exception:  # the panel of explanations shows what is wrong with the file beside the model
            self._models_speed = USUAL_SPEED
        if not was_chosen:
            self.own_speed = self.loop.speed = self._models_speed

    def _defaults(self) -> dict[str, Any]:
        return {name: parameter.default for name, parameter in self.parameters.items()}

    def _build(self) -> None:
        """Go on with a new model as requested."""
        self.unbuilt = True
        settings = {**self.settings, "seed": self.seed}
        run = LiveRun(self._make_model, self.parameters, settings)
        self.past.clear()
        self.series.follow(run.model)
        self.run, self.built, self.straight, self._before = run, settings, True, []
        self._place(run.model)
        self.unbuilt = False

    def _catch_up(self, steps: int) -> None:
        """Take as many of the steps as there is time for; with steps left over, the last one becomes the goal."""
        if self.model is None:
            return
        end = math.inf
        while self.model.running and self.model.completed < steps:
            self._apply_planned()
            self.model.step()
            # The first step may compile kernels, once in the life of an installation.
            end = min(end, time.monotonic() + LONGEST_WAIT)
            if time.monotonic() > end and self.model.completed < steps:
                self.goal = steps
                self.note = f"step {steps:,} takes a while: the run is played up to it; press Pause to stop"
                return
        if self.model.completed < steps:
            self.note = describe_early_end(self.model.completed, steps)
        elif steps:
            self._apply_planned()

    def _take_step(self, model: EngineModel) -> None:
        if self._planned_edits:
            self._apply_planned()
            model = self.model or model
        super()._take_step(model)

    def _apply_planned(self) -> None:
        """Apply the changes of a link that belong to the present step."""
        while self._planned_edits and self.run is not None and self._planned_edits[0].step <= self.run.model.completed:
            edit = self._planned_edits.pop(0)
            try:
                values = self.run.repeat(edit)
            except SwarmError as problem:  # of another version of the model, or a link that was changed
                self.note, self.straight = f"a change in the link was left out: {reported(problem)}", False
                continue
            if self.run.model is not self.model:
                self._place(self.run.model)
            self.built |= values
            self.settings |= values

    def _forget_goal(self) -> None:
        if self.goal:
            self.loop.speed = self.own_speed
        self.goal, self._plays_on = 0, False

    def _play_step(self, stop: threading.Event) -> bool:
        goes_on = super()._play_step(stop)
        is_at_goal = self.goal and self.model is not None and self.model.completed >= self.goal
        return goes_on and not is_at_goal

    def _make_model(self, settings: Mapping[str, Any]) -> SwarmModel:
        """Return a model of these parameters and "seed"."""
        parameters = {name: self.find_map(name, value) for name, value in settings.items() if name != "seed"}
        return self.model_class(**parameters, rng=settings["seed"])

    def _check_setting(self, name: str, value: Any) -> Any:
        if name == "map" and value in self.map_names():
            return value
        return checked_setting(self.parameters[name], value)

    def _take(self, values: Mapping[str, Any]) -> None:
        """Request these values, all or none."""
        before = self.settings
        self.settings = before | {name: self._check_setting(name, value) for name, value in values.items()}
        try:
            self._give(values)
        except Exception:
            self.settings = before
            raise
        for name in values:
            self.faults.pop(name, None)

    @property
    def _is_new(self) -> bool:
        """Whether nothing is lost if the model is built anew."""
        return self.run is not None and not (self.run.model.completed or self.edits or self.error)

    def _give(self, names: Iterable[str]) -> None:
        """Apply settings to the present model; those that belong to the beginning of a run wait for the next one."""
        settings = {name: self.settings[name] for name in names if self.built.get(name) != self.settings[name]}
        if self.run is None or not settings or self.error:
            return
        if self._is_new:
            self._build()
            return
        applied = self.run.set(settings)
        self.built |= {name: settings[name] for name in applied}
        if self.run.model is not self.model:
            self._place(self.run.model)
        if applied:
            self._note_hand_change()
            self.look_now()


def describe_early_end(step: int, goal: int) -> str:
    """Return the message for a run that ended before the requested step."""
    return f"the run ended at step {step:,}, before step {goal:,}"


def custom_columns(model: SwarmModel) -> list[str]:
    """Return the columns of custom sensors, actuators and messages, and of what rules remember."""
    layers = getattr(model.control, "layers", ())
    remembered = [name for layer in layers for name in getattr(layer, "remembered", ())]
    names = (name for name in model.swarm.columns if name.startswith((ACT, SEND, HEARD)))
    return [*model.swarm.table.readings, *names, *remembered]


def watch_closely(model: SwarmModel) -> None:
    """Store what robots perceived and did in the last steps of a model, unless it is watched already."""
    if model.watched is None:
        columns = (*WATCHED, *custom_columns(model))
        a_step = sum(model.swarm.columns[name].nbytes for name in columns)
        model.watch(last=max(2, min(MOST_WATCHED_STEPS, MOST_WATCHED_BYTES // max(a_step, 1))), columns=columns)


LARGEST_MAP_FILE = 1_000_000
LARGEST_SEED = 2**53 - 1


def checked_setting(parameter: Parameter, value: Any, maps: Sequence[str] | None = None) -> Any:
    """Return a requested setting, as the parameter's type and within the number of robots on a page.

    With `maps`, that of the parameter `map` is one of these names.
    """
    if maps is not None and parameter.name == "map":
        return check_choice("map", value, maps)
    value = parameter.checked(parameter.parse(value) if isinstance(value, str) else value)
    return check_count("n_robots", value, maximum=MOST_ROBOTS) if parameter.name == "n_robots" else value


def map_from(name: str, content: bytes) -> Map:
    """Return the map in an uploaded file."""
    if len(content) > LARGEST_MAP_FILE:
        raise InvalidValueError(f"{name:.60} has {len(content):,} bytes; expected at most {LARGEST_MAP_FILE:,}")
    if name.lower().endswith(".svg"):
        return Map.from_svg(content, name)
    if name.lower().endswith(".toml"):
        try:
            return Map.from_toml(content.decode(), name)
        except UnicodeDecodeError:
            raise InvalidValueError(f"{name:.60} is not UTF-8 text; expected a map as TOML") from None
    raise InvalidValueError(f"{name!r:.60} is not a map; expected a file that ends in .svg or .toml")


def whole_number(name: str, text: str | int, minimum: int = 0, maximum: int = LARGEST_SEED) -> int:
    """Return a typed whole number, such as 1000 or 1e3."""
    try:
        number = Decimal(text)
        if number != number.to_integral_value() or not minimum <= number <= maximum:
            raise ValueError
    except (ValueError, ArithmeticError):
        expectation = f"expected a whole number at least {minimum} and at most {maximum}"
        raise InvalidValueError(f"{name} is {text!r:.60}; {expectation}") from None
    return int(number)
