"""Experiments of the page: a grid over one or two parameters with seeds, done in the background by a sweep."""

import math
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, SwarmError, check_choice, check_count, check_number
from mesa_swarm.base.wording import quantity
from mesa_swarm.dashboard import check_page_model
from mesa_swarm.dashboard.experiment.experiment_results import MEAN, SHARE, GridResults, GridRuns, SeedBySeed
from mesa_swarm.dashboard.experiment.many_runs import ManyRuns
from mesa_swarm.dashboard.page.navigation import Linkable
from mesa_swarm.dashboard.page.session import Session, checked_setting, noted_faults, whole_number
from mesa_swarm.experiments.experiment import DEFAULT_STEPS, Experiment, checked_experiment
from mesa_swarm.experiments.reports import all_reports
from mesa_swarm.experiments.statistics import TIME
from mesa_swarm.maps.toml import number_text
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parameters import Choice, Parameter, Slider, parameters_of
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.play_loop import Listeners

MOST_VALUES = 100
MOST_POINTS = 2_500
MOST_RUNS = 10_000
MOST_SEEDS = 1_000
MOST_STEPS = 200_000
USUAL_SEEDS = 20
USUAL_VALUES = 5
# No second parameter.
ONLY_ONE = ""
# Choices that a link may set, in the order in which one depends on another.
LINKED = ("model", "p", "values", "q", "q_values", "seeds", "steps", "measure")


class Experimenting(Linkable):
    """An experiment that one user chooses, starts, stops and continues.

    All other parameters are those set for the same model on the Watch page. A link may set the choices in `LINKED` by
    `set`, in this order; `words` returns them.

    Attributes
    ----------
    name : str
        The model.
    p, q : str
        The varied parameters; `q` is empty if there is only one.
    values, q_values : list
        Their values.
    seeds, steps : int
    measure : str
        A result of the model, or a report of it as "mean of NAME".
    summary : str
        What is shown of a measure: the mean over seeds, or the share of runs in which it has a value.
    faults : dict of str
        Why a choice was refused, by its name or "runs".
    grid : GridResults or None
        Results of the last experiment that was started, whatever was chosen since.
    """

    def __init__(self, session: Session) -> None:
        self.session, self.runs = session, ManyRuns("experiment")
        self.changed = self.linked = Listeners()
        # Seconds a run by model and steps.
        self._paces: dict[tuple[str, int], float] = {}
        self.runs.changed.add(self._note_pace)
        self.seeds = USUAL_SEEDS
        self.faults: dict[str, str] = {}
        self.grid: GridResults | None = None
        self._folder: TemporaryDirectory | None = None
        self._follows = True
        self.choose_model(session.name)
        self._follows = True

    @property
    def choices(self) -> dict[str, Parameter]:
        """The parameters that can be varied, by name."""
        return {name: p for name, p in self.parameters.items() if p.control or p.kind in (bool, int, float, str)}

    def show_words(self, words: dict[str, str]) -> list[str]:
        """Choose what the words of a link describe; return why some were ignored."""
        for name in LINKED:
            if name in words:
                self.set(name, words[name])
        return [self.faults[name] for name in LINKED if name in words and name in self.faults]

    def words(self) -> dict[str, str]:
        """Return the choices as text, which `set` reads back."""
        texts = {
            "model": self.name,
            "p": self.p,
            "values": values_in_words(self.values),
            "q": self.q,
            "q_values": values_in_words(self.q_values),
            "seeds": str(self.seeds),
            "steps": str(self.steps),
            "measure": self.measure,
        }
        return {name: text for name, text in texts.items() if self.q or name not in ("q", "q_values")}

    @property
    def varied(self) -> dict[str, list]:
        """The values of one or two parameters."""
        return {self.p: self.values} | ({self.q: self.q_values} if self.q else {})

    @property
    def settings(self) -> dict[str, Any]:
        """All parameters that differ from the model's defaults, except for the varied ones."""
        return self.session.settings_for(self.name, self.varied)

    @property
    def points(self) -> int:
        """The number of settings."""
        return math.prod(map(len, self.varied.values()))

    @property
    def total(self) -> int:
        """The number of runs."""
        return self.points * self.seeds

    @property
    def is_current(self) -> bool:
        """Whether the results are of what is chosen now."""
        return self.grid is not None and self.grid.signature == self._results(None).signature

    def follow(self) -> None:
        """Continue with the model of the Watch page, unless another one was chosen here."""
        if self._follows and self.session.name != self.name:
            self.choose_model(self.session.name)
            self._follows = True

    def choose_model(self, name: str) -> None:
        """Vary another model, in its number of robots or its first parameter with a slider."""
        self.name = check_page_model(name)
        self._follows = False
        self.model_class = find_model(name)
        self.parameters = parameters_of(self.model_class)
        self.steps = min(getattr(self.model_class, "steps_to_compare", DEFAULT_STEPS), MOST_STEPS)
        self.faults, self.q = {}, ONLY_ONE
        self.q_values: list = []
        self.measures = self._list_measures()
        headline = getattr(self.model_class, "headline", ("",))[0]
        self.measure = headline if headline in self.measures else next(iter(self.measures), "")
        self.summary = SHARE if self.measure == headline else MEAN
        sliders = [option for option, parameter in self.choices.items() if isinstance(parameter.control, Slider)]
        first = next(iter(["n_robots"] * ("n_robots" in sliders) + sliders + list(self.choices)), "")
        self.choose_parameter("p", first)

    def choose_parameter(self, place: str, name: str) -> None:
        """Choose the parameter "p" or "q", with usual values; an empty name for no parameter "q"."""
        if name or place == "p":
            check_choice("parameter", name, self.choices)
        values = usual_values(self.choices[name], self.map_names()) if name else []
        if place == "p":
            self.p, self.values = name, values
            if self.q == name:
                self.q, self.q_values = ONLY_ONE, []
        elif name == self.p:
            raise InvalidValueError(f"{name} is varied already; choose another parameter")
        else:
            self.q, self.q_values = name, values
        for fault in (place, f"{place}_values", "values"):
            self.faults.pop(fault, None)
        self._note_size()

    def set(self, name: str, text: str) -> None:
        """Set a choice as typed, or as in a link; one that is refused is noted in `faults`."""
        with noted_faults(self.faults, name):
            self._set(name, text)
        self._note_size()
        self.changed.notify()

    def _set(self, name: str, text: str) -> None:
        if name == "model":
            self.choose_model(text)
        elif name in ("p", "q"):
            self.choose_parameter(name, text)
        elif name in ("values", "q_values"):
            self.set_values(name, [part.strip() for part in text.split(",")])
        elif name == "seeds":
            self.seeds = whole_number(name, text, 1, MOST_SEEDS)
        elif name == "steps":
            self.steps = whole_number(name, text, 1, MOST_STEPS)
        elif name == "measure":
            self.measure = check_choice(name, text, self.measures)
            self.summary = self.summary if self.can_be_missing else MEAN
        elif check_choice("choice", name, (*LINKED, "summary")) == "summary":
            self.summary = check_choice(name, text, (MEAN, SHARE))

    def set_values(self, name: str, values: Sequence) -> None:
        """Set "values" or "q_values", given as text or as they are."""
        parameter = self.choices[self.p if name == "values" else self.q]
        setattr(self, name, checked_values(parameter, values, self.map_names()))

    def space(self, name: str, low: str, high: str, number: str) -> None:
        """Set a number of values at equal distances."""
        parameter = self.choices[self.p if name == "values" else self.q]
        with noted_faults(self.faults, name):
            count = whole_number("number of values", number, 1, MOST_VALUES)
            self.set_values(name, space_values(parameter, low, high, count))
        self._note_size()
        self.changed.notify()

    @property
    def can_be_missing(self) -> bool:
        """Whether the measure is the time of an event, which may not occur."""
        return self.measure.endswith(TIME)

    def start(self) -> None:
        """Do all runs, or those that are left, or after the last one those that failed, in the background."""
        with noted_faults(self.faults, "runs"):
            self._check_size()
            results = self.grid if self.grid is not None and self.is_current else self._results(self._experiment())
            self._folder = self._folder or TemporaryDirectory(prefix="mesa_swarm_", ignore_cleanup_errors=True)
            retried = {run: results.outcomes.pop(run) for run in (results.failed if results.is_complete else ())}
            try:
                runs = GridRuns(results.experiment, Path(self._folder.name), retry_failed=bool(retried))
                self.runs.start(runs, results.take)
            except Exception:
                results.outcomes |= retried
                raise
            self.grid = results
        self.changed.notify()

    def stop(self) -> None:
        """Stop at once; finished runs remain."""
        self.runs.stop()
        self._note_pace()
        self.changed.notify()

    @property
    def waiting(self) -> frozenset[str]:
        """The choices that wait for a reset: none."""
        return frozenset()

    def next_action(self) -> tuple[str, bool]:
        """Return the label of the button that starts the runs, and whether it may be pressed."""
        results = self.grid if self.is_current else None
        if results is None or not results.outcomes:
            return f"Run {self.total:,} runs", "runs" not in self.faults
        remaining = self.total - len(results.outcomes)
        if remaining:
            return f"Go on with {remaining:,} runs", True
        failed = len(results.failed)
        return (f"Try {failed:,} failed runs again", True) if failed else (f"All {self.total:,} runs are done", False)

    def size_in_words(self) -> str:
        """Return the number of runs that are chosen, and the time that is left at the last pace, if it is known."""
        sizes = " x ".join(f"{len(values):,} values of {name}" for name, values in self.varied.items())
        seeds = quantity(self.seeds, "seed")
        count = len(self.grid.outcomes) if self.grid is not None and self.is_current else 0
        text = f"{sizes} x {seeds} = {self.total:,} runs" + (f", {count:,} of them done" if count else "")
        pace = self._paces.get((self.name, self.steps))
        duration = timedelta(seconds=round(pace * (self.total - count))) if pace and self.total > count else None
        return text if duration is None else f"{text}; about {duration} at the last pace"

    def _note_pace(self) -> None:
        if self.grid is not None and self.runs.pace:
            self._paces[self.grid.model, self.grid.experiment.steps] = self.runs.pace

    def watch(self, place: int) -> None:
        """Open a point of the results on the Watch page, with the first seed."""
        if self.grid is None or not 0 <= place < len(self.grid.experiment.points):
            return
        results, session = self.grid, self.session
        session.set_seed(results.experiment.seeds[0])
        session.choose(results.model, {**results.settings, **results.point(place)})
        session.adopted.notify()

    def close(self) -> None:
        """Stop, and release everything."""
        self.changed.clear()
        self.runs.close()
        if self._folder is not None:
            self._folder.cleanup()

    def preview(self) -> GridResults:
        """Return results without outcomes of what is chosen now."""
        return self._results(None)

    def _experiment(self) -> SeedBySeed:
        find_map = self.session.find_map
        experiment = checked_experiment(
            self.model_class,
            {name: [find_map(name, value) for value in values] for name, values in self.varied.items()},
            seeds=self.seeds,
            steps=self.steps,
            settings={name: find_map(name, value) for name, value in self.settings.items()},
            measure=self.measures,
        )
        return SeedBySeed(**{name: getattr(experiment, name) for name in Experiment.__dataclass_fields__})

    def _results(self, experiment: SeedBySeed | None) -> GridResults:
        """Return results without outcomes, of what is chosen now."""
        names = [self.settings.get("map"), *self.varied.get("map", ())]
        maps = {name: chart for name, chart in self.session.uploads.items() if name in names}
        return GridResults(
            experiment=experiment or self._bare(),
            model=self.name,
            values={name: list(values) for name, values in self.varied.items()},
            settings=dict(self.settings),
            maps=maps,
        )

    def _bare(self) -> SeedBySeed:
        """Return an experiment that is not checked."""
        return SeedBySeed(
            model_class=self.model_class,
            settings={},
            points=[{}] * min(self.points, MOST_POINTS),
            seeds=range(1, 1 + self.seeds),
            steps=self.steps,
            measures=tuple(self.measures),
        )

    def _list_measures(self) -> list[str]:
        """Return the results of the model, and all reductions of its reports."""
        try:
            session = self.session
            with session.lock:
                same = session.model is not None and session.name == self.name
                live = session.model if same and session.model is not None and session.model.completed else None
                model = self.model_class(rng=1) if live is None else live
                results = list(model.results()) if hasattr(model, "results") else []
                reports = all_reports(model, call=live is None)
                return [*results, *(name for name in reports if name not in results)]
        except Exception as problem:  # a model may raise anything
            self.faults["measure"] = reported(problem)
            return []

    def map_names(self) -> list[str]:
        """Return the maps that may be chosen for the model: those that it offers, else all, and uploaded ones."""
        return self.session.map_names(self.parameters.get("map"))

    def _check_size(self) -> None:
        self._note_size()
        for name in ("runs", "values", "q_values", "seeds", "steps", "measure"):
            if name in self.faults:
                raise SwarmError(self.faults[name])

    def _note_size(self) -> None:
        self.faults.pop("runs", None)
        try:
            check_count("number of settings", self.points, minimum=1, maximum=MOST_POINTS)
            check_count("number of runs", self.total, minimum=1, maximum=MOST_RUNS)
        except InvalidValueError as problem:
            self.faults["runs"] = str(problem)


def options_of(parameter: Parameter, maps: Sequence[str]) -> list[str]:
    """Return the values that can be ticked, as text; none for numbers and free texts."""
    if parameter.name == "map":
        return list(maps)
    if isinstance(parameter.control, Choice):
        return list(parameter.control.options)
    return ["False", "True"] if parameter.kind is bool else []


def values_in_words(values: Sequence) -> str:
    """Return values as one types them, numbers exactly.

    Examples
    --------
    >>> values_in_words([0.0, 0.1, 2.5e-7])
    '0, 0.1, 2.5e-07'
    """
    return ", ".join(number_text(value) if isinstance(value, float) else str(value) for value in values)


def usual_values(parameter: Parameter, maps: Sequence[str]) -> list:
    """Return values of a parameter to begin with: five over its slider, all that can be ticked, or its default."""
    if isinstance(parameter.control, Slider):
        slider = parameter.control
        return space_values(parameter, slider.minimum, slider.maximum, USUAL_VALUES)
    options = options_of(parameter, maps)
    return checked_values(parameter, options[:MOST_VALUES], maps) if options else [parameter.default]


def space_values(parameter: Parameter, low: Any, high: Any, number: int) -> list:
    """Return this number of values at equal distances; of whole numbers different ones only.

    Examples
    --------
    >>> space_values(Parameter("n_robots", 10, int, Slider(1, 50, 1)), 1, 4, 10)
    [1, 2, 3, 4]
    """
    start, end = (check_number(name, _number(name, end)) for name, end in (("from", low), ("to", high)))
    numbers = np.linspace(start, end, number).round(12)
    if parameter.kind is int:
        return list(dict.fromkeys(np.rint(numbers).astype(int).tolist()))
    return list(dict.fromkeys(numbers.tolist()))


def _number(name: str, text: Any) -> float:
    try:
        return float(text)
    except ValueError:
        raise InvalidValueError(f"{name} is {text!r:.60}; expected a number") from None


def checked_values(parameter: Parameter, values: Sequence, maps: Sequence[str]) -> list:
    """Return different values of a parameter, each checked; texts are read as its type."""
    distinct: list = []
    for value in values:
        setting = checked_setting(parameter, value, maps)
        if setting is None:
            raise InvalidValueError(f"a value of {parameter.name} is empty; expected values separated by commas")
        if setting in distinct:
            raise InvalidValueError(f"{parameter.name} has {setting!r:.60} twice; expected different values")
        distinct.append(setting)
    if not 1 <= len(distinct) <= MOST_VALUES:
        raise InvalidValueError(f"{parameter.name} has {len(distinct)} values; expected 1 to {MOST_VALUES}")
    return distinct
