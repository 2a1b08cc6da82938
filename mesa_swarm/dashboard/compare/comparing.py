"""Comparison of two worlds on one page, and comparisons over many seeds in their own processes."""

from dataclasses import dataclass
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, SwarmError, check_choice
from mesa_swarm.dashboard import check_page_model
from mesa_swarm.dashboard.compare.pair import NAMES, Pair
from mesa_swarm.dashboard.experiment.many_runs import ManyRuns, Send
from mesa_swarm.dashboard.page.inputs import LARGEST_SEED, checked_setting, whole_number
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.experiments.compare import Comparison, run_plan
from mesa_swarm.experiments.experiment import DEFAULT_STEPS
from mesa_swarm.experiments.figures import comparison_figure, main_measure
from mesa_swarm.experiments.plan import ComparisonPlan, checked_plan
from mesa_swarm.experiments.tables import runs_csv, table_and_notes
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parameters import Choice, Parameter, Slider, parameters_of
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.pictures import png
from mesa_swarm.viewing.play_loop import Listeners

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


class Comparing:
    """A pair of worlds that differ in one parameter, and its effect over many seeds.

    All other parameters are those set for the same model on the Watch page.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.pair, self.runs = Pair(), ManyRuns("comparison")
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
        session = self.session
        if session.name != self.name:
            return {}
        settings = {name: value for name, value in session.settings.items() if value != self.parameters[name].default}
        settings.pop(self.parameter, None)
        return {name: self._find_map(name, value) for name, value in settings.items()}

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
        try:
            self.values[NAMES.index(side)] = self._check_setting(value)
            self.faults.pop(side, None)
        except Exception as problem:  # shown beside the control
            self.faults[side] = reported(problem)
        self.pair.changed.notify()

    def set_count(self, name: str, text: str | int) -> None:
        """Set the "seed" of the two worlds, the number of "seeds", or the "steps" of each run."""
        low, high = {"seed": (0, LARGEST_SEED), "seeds": (FEWEST_SEEDS, MOST_SEEDS), "steps": (1, MOST_STEPS)}[name]
        try:
            setattr(self, name, whole_number(name, text, low, high))
            self.faults.pop(name, None)
        except InvalidValueError as problem:
            self.faults[name] = str(problem)
        self.pair.changed.notify()

    def reset(self) -> None:
        """Stop, and build both worlds as requested."""
        self.built, models = self._request_settings(), (None, None)
        self.faults.pop("worlds", None)
        try:
            models = self._models()
        except Exception as problem:  # a model may raise anything; it is shown
            self.faults["worlds"] = reported(problem)
        self.pair.place(*models)

    def plan(self) -> ComparisonPlan:
        """Return the plan of the comparison over many seeds."""
        values = [self._find_map(self.parameter, value) for value in self.values]
        return checked_plan(
            self.model_class, self.parameter, values, self.seeds, steps=self.steps, settings=self.shared_settings
        )

    def start(self) -> None:
        """Begin to compare over many seeds, in the background."""
        self.pair.pause()
        try:
            self.runs.start(ComparedRuns(self.plan()))
            self.faults.pop("runs", None)
        except Exception as problem:  # as in `reset`
            self.faults["runs"] = reported(problem)
        self.pair.changed.notify()

    @property
    def linked(self) -> Listeners:
        """Notified when the words of a link change."""
        return self.pair.changed

    @property
    def model_shown(self) -> str:
        """The name of the compared model."""
        return self.name

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
        settings = self.shared_settings
        return tuple(
            self.model_class(**settings, **{self.parameter: self._find_map(self.parameter, value)}, rng=self.seed)
            for value in self.values
        )

    def _find_map(self, name: str, value: Any) -> Any:
        """Return the uploaded map of this name, or the value itself."""
        return self.session.uploads.get(value, value) if name == "map" else value

    def _check_setting(self, value: Any) -> Any:
        parameter = self.choices[self.parameter]
        if parameter.name == "map":
            return check_choice("map", value, self.session.map_names(parameter))
        return checked_setting(parameter, value)


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
