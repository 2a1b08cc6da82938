"""Two worlds played by one clock, and their comparison over many seeds in processes of its own."""

import threading
from dataclasses import dataclass
from typing import Any

from mesa_swarm.base.errors import SwarmError, check_choice
from mesa_swarm.dashboard import check_page_model
from mesa_swarm.dashboard.experiment.many_runs import ManyRuns, Send
from mesa_swarm.dashboard.page.navigation import Linkable
from mesa_swarm.dashboard.page.series import MOST_NUMBERS, Series
from mesa_swarm.dashboard.page.session import LARGEST_SEED, Session, checked_setting, noted_faults, whole_number
from mesa_swarm.experiments.compare import Comparison, run_plan
from mesa_swarm.experiments.experiment import DEFAULT_STEPS
from mesa_swarm.experiments.figures import comparison_figure, main_measure
from mesa_swarm.experiments.plan import ComparisonPlan, checked_plan
from mesa_swarm.experiments.tables import runs_csv, table_and_notes
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parameters import Choice, Parameter, Slider, parameters_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.pictures import png
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES, PlayLoop
from mesa_swarm.viewing.player import PackedFrame, Past, Played, Player, Viewer

NAMES = ("A", "B")


class Side(Player):
    """One of two players that share a clock and a lock."""

    def __init__(self, loop: PlayLoop, lock: threading.RLock) -> None:
        super().__init__()
        self.loop, self.lock = loop, lock
        self.series = Series(MOST_NUMBERS // 2)  # also of steps that are no longer stored

    def place(self, model: SwarmModel | None) -> None:
        """Play another model, and remove the pictures of the old one."""
        self.error = ""
        self.past.clear()
        self.model = model
        self.series.follow(model)

    def close(self) -> None:
        """Stop, and release everything."""
        super().close()
        self.series.follow(None)

    def advance(self) -> bool:
        """Take one step unless the model has ended or failed; return whether it can continue."""
        with self.capture_errors():
            return not self.finished and self._advance()
        return False


@dataclass(frozen=True, slots=True)
class Way:
    """The way to a step: whether it is then played on, and at which speed, steps/s."""

    step: int
    plays: bool
    speed: float


class Pair(Played):
    """Plays two models together, as a `Player` plays one.

    When one model ends, the other continues; when one fails, both stop. Viewers receive pictures without a world: the
    step, and the fingerprints of both.
    """

    def __init__(self) -> None:
        super().__init__()
        self.sides = Side(self.loop, self.lock), Side(self.loop, self.lock)
        self._way: Way | None = None

    @property
    def error(self) -> str:  # type: ignore[override] # of both sides
        """The errors of both sides, empty without one."""
        wrong = [f"{name}: {side.error}" for name, side in zip(NAMES, self.sides, strict=True) if side.error]
        return "; ".join(wrong)

    @property
    def finished(self) -> bool:
        """Whether both models have stopped running, and the last pictures are displayed."""
        return all(side.finished for side in self.sides)

    @property
    def past(self) -> Past:  # type: ignore[override] # likewise
        """The pictures of the side with the latest step."""
        return max((side.past for side in self.sides), key=lambda past: past.last_step)

    @property
    def is_present(self) -> bool:
        """Whether the latest pictures are displayed."""
        return all(side.past.is_present for side in self.sides)

    @property
    def completed(self) -> int:
        """The latest step of both models."""
        return max((side.model.completed for side in self.sides if side.model is not None), default=0)

    def go_on_to(self, step: int, *, plays: bool) -> None:
        """Play up to a step as fast as it goes, as after a reload; then play on, or stop there."""
        if self.completed < step and self._can_go_on():
            self._way = Way(step, plays, self.loop.speed)
            self.loop.speed = AS_FAST_AS_IT_GOES
            self.play()
        elif plays:
            self.play()

    def set_speed(self, speed: float) -> None:
        """Set the speed, steps/s, also on the way to a step."""
        self._way = None
        super().set_speed(speed)

    def rest(self) -> None:
        """Show the state at rest; pausing on the way to a step ends the way."""
        if not self.playing:
            self._end_way()
        super().rest()

    def _end_way(self) -> bool:
        """Play as fast as before; return whether to play on."""
        way, self._way = self._way, None
        if way is not None:
            self.loop.speed = way.speed
        return way is None or way.plays

    def place(self, first: SwarmModel | None, second: SwarmModel | None) -> None:
        """Stop, and continue with two other models."""
        self.loop.pause()
        with self.lock:
            for side, model in zip(self.sides, (first, second), strict=True):
                side.place(model)
        self.rest()

    def step(self) -> None:
        """Pause, and take one step in both."""
        self.loop.pause()
        with self.lock:
            if self._can_step():
                self._advance()
        self.rest()

    def look(self, index: int) -> None:
        """Pause, and display the pictures of the step with this index in `past`."""
        self.loop.pause()
        with self.lock:
            past = self.past
            past.look(index)
            if past.shown is not None:
                self._look_at(past.shown.step)
        self.rest()

    def hand_over(self, fingerprint: bool = False) -> None:
        """Show both sides, and notify the viewers of both at once."""
        for side in self.sides:
            side.hand_over(fingerprint)
        self._push()

    def close(self) -> None:
        """Stop, and release the models, the pictures and the viewers."""
        self.loop.pause()
        self.viewers = ()
        self.changed.clear()
        for side in self.sides:
            side.close()

    def _watching(self) -> tuple[Viewer, ...]:
        first, second = self.sides
        return *self.viewers, *first.viewers, *second.viewers

    def _can_go_on(self) -> bool:
        return self._can_step() and not self.finished

    def _can_step(self) -> bool:
        return not self.error and all(side.model is not None for side in self.sides)

    def _play_step(self, stop: threading.Event) -> bool:
        with self.lock:
            if stop.is_set():
                return False
            goes_on = self._advance()
            has_arrived = self._way is not None and self.completed >= self._way.step
        if has_arrived:
            goes_on = self._end_way() and goes_on
            self.changed.notify()
        if self.error:
            self.rest()  # after an error, which has stopped the thread already
        return goes_on

    def _advance(self) -> bool:
        """Advance by one step, or by one stored picture; return whether there are more."""
        if self.is_present:
            return any([side.advance() for side in self.sides])  # a list, so that both advance
        later = [side.recent.step_after() for side in self.sides if not side.past.is_present]
        self._look_at(min(later))
        return True

    def _look_at(self, step: int) -> None:
        for side in self.sides:
            side.recent.look_at(step)

    def _shown(self) -> PackedFrame | None:
        """Return a picture without a world, with the displayed step and both fingerprints."""
        first, second = (side.past.shown for side in self.sides)
        if first is None or second is None:
            return None
        fingerprint = f"{first.fingerprint}-{second.fingerprint}".strip("-")
        return PackedFrame(max(first.step, second.step), b"", {}, (), fingerprint)


# Of the picture, inches: small, so that its text is large beside the table.
SIZE = (8.6, 6.8)


@dataclass(frozen=True, kw_only=True, slots=True)
class Report:
    """Results of a comparison, ready to be shown."""

    title: str
    finding: str
    table: list[list[str]]  # the first line is the header
    notes: list[str]
    picture: bytes  # a PNG
    runs: str  # every run, as CSV


def report_of(comparison: Comparison) -> Report:
    """Return the report of a comparison."""
    plan = comparison.plan
    table, notes = table_and_notes(comparison)
    figure = comparison_figure(comparison, [main_measure(comparison)])
    figure.set_size_inches(*SIZE)
    return Report(
        title=f"{plan.model_class.__name__}, {plan.parameter}: {len(plan.seeds)} paired seeds, {plan.steps:,} steps",
        finding=comparison.finding(),
        table=table,
        notes=notes,
        picture=png(figure),
        runs=runs_csv(comparison),
    )


@dataclass(frozen=True, slots=True)
class ComparedRuns:
    """The runs of a comparison, to be done in the background."""

    plan: ComparisonPlan

    def __len__(self) -> int:
        return len(self.plan)

    def do(self, workers: int, send: Send) -> None:
        """Do all runs, and send a message for each, and the report."""
        send("report", report_of(run_plan(self.plan, workers, heard=lambda run: send("run", run.rng))))


FEWEST_SEEDS, MOST_SEEDS, USUAL_SEEDS = 2, 1000, 30
MOST_STEPS = 200_000


class Comparing(Linkable):
    """A pair of worlds that differ in one parameter, and its effect over many seeds.

    All other parameters are those set for the same model on the Watch page.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.pair, self.runs = Pair(), ManyRuns("comparison")
        self.linked = self.pair.changed
        self.pair.set_speed(session.own_speed)
        self.seed, self.seeds = session.seed, USUAL_SEEDS
        # Why a setting was refused, by "A", "B", "worlds", "seed", "seeds", "steps" or "runs".
        self.faults: dict[str, str] = {}
        self.choose_model(session.name)

    @property
    def choices(self) -> dict[str, Parameter]:
        """The parameters that can be compared, by name."""
        parameters, always = self.parameters.values(), ("map", getattr(self.model_class, "compares", (None,))[0])
        return {p.name: p for p in parameters if p.name in always or isinstance(p.control, (Choice, Slider))}

    @property
    def shared_settings(self) -> dict[str, Any]:
        """All parameters that differ from the model's defaults, except the compared one."""
        settings = self.session.settings_for(self.name, (self.parameter,))
        return {name: self.session.find_map(name, value) for name, value in settings.items()}

    @property
    def waiting(self) -> frozenset[str]:
        """Of "A", "B" and "seed" those that will be as requested only after a reset."""
        return frozenset(name for name, value in self._request_settings().items() if self.built.get(name) != value)

    def choose_model(self, name: str) -> None:
        """Compare another model, in the parameter that it suggests."""
        self.name = check_page_model(name)
        self.model_class = find_model(name)
        self.parameters = parameters_of(self.model_class)
        self.steps = min(getattr(self.model_class, "steps_to_compare", DEFAULT_STEPS), MOST_STEPS)
        suggested = getattr(self.model_class, "compares", (None,))[0]
        self.choose_parameter(suggested if suggested in self.choices else next(iter(self.choices)))

    def choose_parameter(self, name: str) -> None:
        """Compare another parameter, and build both worlds."""
        self.parameter = check_choice("parameter", name, self.choices)
        maps = self.session.map_names(self.parameters.get("map"))
        self.values = two_values(self.model_class, self.choices[name], maps)
        self.faults = {}
        self.reset()

    def set_value(self, side: str, value: Any) -> None:
        """Set the value in world A or B, from the next reset on."""
        with noted_faults(self.faults, side):
            parameter = self.choices[self.parameter]
            self.values[NAMES.index(side)] = checked_setting(parameter, value, self.session.map_names(parameter))
        self.pair.changed.notify()

    def set_count(self, name: str, text: str | int) -> None:
        """Set the "seed" of the two worlds, the number of "seeds", or the "steps" of each run."""
        low, high = {"seed": (0, LARGEST_SEED), "seeds": (FEWEST_SEEDS, MOST_SEEDS), "steps": (1, MOST_STEPS)}[name]
        with noted_faults(self.faults, name):
            setattr(self, name, whole_number(name, text, low, high))
        self.pair.changed.notify()

    def reset(self) -> None:
        """Stop, and build both worlds as requested."""
        self.built, models = self._request_settings(), (None, None)
        with noted_faults(self.faults, "worlds"):
            models = self._models()
        self.pair.place(*models)

    def plan(self) -> ComparisonPlan:
        """Return the plan of the comparison over many seeds."""
        values, settings = self._find_values(), self.shared_settings
        return checked_plan(self.model_class, self.parameter, values, self.seeds, steps=self.steps, settings=settings)

    def start(self) -> None:
        """Begin to compare over many seeds, in the background."""
        self.pair.pause()
        with noted_faults(self.faults, "runs"):
            self.runs.start(ComparedRuns(self.plan()))
        self.pair.changed.notify()

    def words(self) -> dict[str, str]:
        """Return what is compared, as words of a link; settings of both worlds are those of the session."""
        first, second = (str(value) for value in self.values)
        counts = {name: str(getattr(self, name)) for name in ("seed", "seeds", "steps")}
        return {"model": self.name, "parameter": self.parameter, "A": first, "B": second, **counts}

    def show_words(self, words: dict[str, str]) -> list[str]:
        """Compare what the words of a link describe; return why some were ignored."""
        try:
            if words.get("model", self.name) != self.name:
                self.choose_model(words["model"])
            if words.get("parameter", self.parameter) != self.parameter:
                self.choose_parameter(words["parameter"])
        except SwarmError as problem:
            return [reported(problem)]
        for name in NAMES:
            if name in words:
                self.set_value(name, words[name])
        for name in ("seed", "seeds", "steps"):
            if name in words:
                self.set_count(name, words[name])
        faults = list(self.faults.values())
        self.reset()
        return faults

    def go_on_to(self, step: int, *, plays: bool, speed: float | None) -> None:
        """Go on after a reload."""
        if speed is not None:
            self.pair.set_speed(speed)
        self.pair.go_on_to(step, plays=plays)

    def close(self) -> None:
        """Stop and release everything."""
        self.runs.close()
        self.pair.close()

    def _request_settings(self) -> dict[str, Any]:
        first, second = self.values
        return {"A": first, "B": second, "seed": self.seed}

    def _models(self) -> tuple:
        settings, values = self.shared_settings, self._find_values()
        return tuple(self.model_class(**settings, **{self.parameter: value}, rng=self.seed) for value in values)

    def _find_values(self) -> list:
        """Return both values, of uploaded maps the maps."""
        return [self.session.find_map(self.parameter, value) for value in self.values]


def two_values(model_class: type, parameter: Parameter, maps: list[str]) -> list:
    """Return two values of a parameter that are worth comparing.

    Those that the model suggests; else the first two of a list, or the default and the farther end of the slider.
    """
    name, values = getattr(model_class, "compares", (None, ()))
    if parameter.name == name and len(values) >= 2:
        return list(values[:2])
    control = parameter.control
    if isinstance(control, Slider):
        default, slider = parameter.default, control
        ends = sorted((slider.minimum, slider.maximum), key=lambda end: -abs(end - default))
        return [default, parameter.kind(ends[0])]
    options = list(control.options) if isinstance(control, Choice) and parameter.name != "map" else maps
    return (options * 2)[:2]
