"""How a model hands stretches of steps to the compiled driver, until something in Python is due."""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from functools import partial
from inspect import getattr_static
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.kernels.part import Kernel, Phase, Prepared
from mesa_swarm.kernels.plan import CODE, TAKEN, Driver, Plan
from mesa_swarm.model.function_measures import FunctionMeasure
from mesa_swarm.model.measures import ColumnMeasure, MeasuredRows, Until, measure_of
from mesa_swarm.model.mesa_model import Collector, has_own_events, is_stepped_by_itself, set_steps
from mesa_swarm.model.observers import DrivenObserver
from mesa_swarm.model.reporters import Held

# The most steps of one compiled call, and the most steps of robots in it: Ctrl-C and progress bars wait for its end.
MOST_STEPS, MOST_ROBOT_STEPS = 1000, 100_000
# So few steps are taken one by one: to find out whether they can be driven takes as long.
FEWEST_STEPS = 3
# Where the step of a model is defined, besides those of users.
ENGINE_MODEL = "mesa_swarm.model.engine_model"


class Due:
    """Something of Python, and in which steps it is due: those that `every` divides."""

    def __init__(self, what: str, every: int = 1) -> None:
        self.what, self.every = what, every

    def first_after(self, completed: int) -> int:
        """Return the first step in which it is due, after this number of steps."""
        return completed + self.every - completed % self.every

    def longest(self, completed: int) -> int:
        """Return how many steps can be taken in one call after this number: all before the first in which it is due."""
        return self.first_after(completed) - completed - 1

    @property
    def most(self) -> int:
        """The most steps that can be taken in one call."""
        return self.every - 1

    def __str__(self) -> str:
        return self.what if self.every == 1 else f"{self.what}, every {self.every} steps"


class DueAfterwards(Due):
    """Something of Python that is done when steps are over, of which a compiled call may take the last one too."""

    def longest(self, completed: int) -> int:
        """Return how many steps can be taken in one call: up to the first in which it is due."""
        return self.first_after(completed) - completed

    @property
    def most(self) -> int:
        """The most steps that can be taken in one call."""
        return self.every


class HeldDue(Due):
    """A reporter that holds its value for some steps: it is due in the first row after these."""

    def __init__(self, name: str, held: Held, collect_every: int) -> None:
        super().__init__(f"reporter {name}, a function in Python", max(held.trigger.every, collect_every))
        self.held, self.collect_every = held, collect_every

    def first_after(self, completed: int) -> int:
        """Return the first collected step in which another value is measured."""
        measured, trigger, step = self.held.measured, self.held.trigger, completed + 1
        if trigger.last_due(step) == measured:
            step = measured + trigger.every
        return -(-step // self.collect_every) * self.collect_every


class Driving(Prepared):
    """What drives a model: its driver and the rows of measures, made anew where these have changed."""

    driver: Driver | None = None
    rows: MeasuredRows | None = None
    rows_key: Any = None
    stops: Sequence[tuple[Kernel, int]] = ()
    stops_key: Any = None
    ahead: int = 0  # how many more steps were begun than completed
    undriven: Plan | None = None  # one of which a stage is Python in each step

    def __init__(self) -> None:
        self.flag = np.zeros(1, np.bool_)
        # Columns of parts that every model has: they are replaced when bodies or robots change.
        self.arrays: dict[str, np.ndarray] = {}


class Stretch(NamedTuple):
    """Steps of a model that one compiled call takes: its driver, how many at most, and the numbers at its begin."""

    model: Any
    driver: Driver
    steps: int
    completed: int
    begun: int
    rows: int
    observers: Sequence[DrivenObserver]

    def note(self, taken: int, more: int) -> None:
        """Let the model count the steps that are taken, and 1 in a step that has begun besides."""
        self.model.parts.set_completed(self.completed + taken)
        set_steps(self.model, self.begun + taken + more)

    @property
    def taken(self) -> int:
        """How many steps are taken."""
        return int(self.driver.progress[TAKEN])

    def take(self) -> None:
        """Take the steps."""
        try:
            self._drive()
        except BaseException:
            self.end_early()
            raise
        self.end()

    def _drive(self) -> None:
        try:
            with self.model.parts.robots.engine.at_work(self.rows):
                self.driver.take(self.steps, self.completed, self.begun, self.rows, self.note)
        finally:
            self.settle()

    def end(self) -> None:
        """Let what was taken along notice that the steps are over."""
        for observer in self.observers:
            observer.after_stretch(self.model)

    def end_early(self) -> None:
        """Let observers notice that a step has failed, or the end if an interrupt came between two steps."""
        self.model.parts.robots.forget_readings()
        if self.driver.progress[CODE] == 0:
            self.end()
            return
        for observer in self.model.observers.complete:
            observer.after_failure(self.model)

    def finish_step(self) -> None:
        """Take a step to its end that an interrupt has left within it."""
        self.driver.finish_step(self.completed, self.begun, self.rows, self.note)

    def settle(self) -> None:
        """Let the model stop running where a condition of its class has ended the steps."""
        flag = self.model.driving.flag
        if flag[0]:
            flag[0] = False
            if self.model.conditions:
                self.model._check_stops()


def drive_model(model: Any, steps: int, stops: Sequence[Until] = ()) -> int:
    """Take at most this many steps in one compiled call, and return how many; 0 if something in Python is due.

    `stops` end the run besides those of the class.
    """
    stretch = begin_stretch(model, steps, stops)
    if stretch is None:
        return 0
    stretch.take()
    return stretch.taken


def begin_stretch(model: Any, steps: int, stops: Sequence[Until] = ()) -> Stretch | None:
    """Prepare a model for the next steps of one compiled call; None if something in Python is due."""
    plan, cache = model.parts.plan, model.driving
    if plan is cache.undriven or longest_stretch(model, plan, steps, stops) < FEWEST_STEPS:
        return None
    model.parts.replan()  # parameters may have been set by hand since
    plan = model.parts.plan
    most = longest_stretch(model, plan, steps, stops)
    if most < FEWEST_STEPS:
        return None
    observers = model.observers.driven()
    for observer in observers:
        observer.before_stretch(model, most)
    driver = driver_of(model, model.parts.plan, stops)
    completed, begun = model.completed, model.steps
    cache.ahead = begun - completed
    model.parts.begin_step()
    return Stretch(model, driver, most, completed, begun, len(model.swarm), observers)


def longest_stretch(model: Any, plan: Plan, steps: int, stops: Sequence[Until] = ()) -> int:
    """Return how many steps can be taken until something in Python is due, at most `steps`."""
    most = min(steps, most_steps_of(model))
    if most < FEWEST_STEPS:
        return 0
    completed = model.completed
    if any(stage.kernel is None and stage.every < FEWEST_STEPS for _, stage in plan.stages):
        model.driving.undriven = plan
        return 0
    for due in list_due(model, plan, stops):
        most = min(most, due.longest(completed))
        if most < FEWEST_STEPS:
            return 0
    return most


def most_steps_of(model: Any) -> int:
    """Return the most steps of one compiled call, of however many robots those that are worth one."""
    return min(MOST_STEPS, max(MOST_ROBOT_STEPS // max(len(model.swarm), 1), FEWEST_STEPS))


def list_due(model: Any, plan: Plan, stops: Sequence[Until] = ()) -> Iterator[Due]:
    """Iterate over what in Python makes steps be taken one by one, and in which steps."""
    yield from list_due_of_model(model, stops)
    if model.observers.driven() and not senses_first(plan):
        yield Due("a stage before robots read their sensors")
    for part, stage in plan.stages:
        if stage.kernel is None:
            yield Due(f"{part}: {stage.name}", stage.every)
    yield from list_due_rows(model)


def list_due_of_model(model: Any, stops: Sequence[Until] = ()) -> Iterator[Due]:
    """Iterate over what besides stages and rows is due in each step: methods of classes, observers, conditions."""
    for kind in takewhile(lambda kind: kind.__module__ != ENGINE_MODEL, type(model).__mro__):
        if "step" in vars(kind):
            yield Due(f"{kind.__name__}.step, a method in Python; declare stops, measures, parts or processes instead")
    if not is_stepped_by_itself(model):
        yield Due("model.step was replaced")
    if isinstance(getattr_static(type(model), "running", None), property):
        yield Due("running is a property in Python; declare stops")
    if model.steps != model.completed:
        yield Due("a step failed before, so that more were begun than completed")
    if has_own_events(model):
        yield Due("events scheduled by Mesa")
    yield from list_due_observers(model)
    for condition in (*type(model).conditions, *stops):
        if measure_in_place(model, condition.of) is None:
            cure = "declare it by count, share, mean, value or measure"
            yield Due(f"stops by {condition.of}, a property in Python; {cure}", condition.every)


def list_due_observers(model: Any) -> Iterator[Due]:
    """Iterate over observers, and over what is due of those that compiled calls take along."""
    observers = model.observers
    for observer, every in zip(observers, observers.intervals, strict=True):
        if isinstance(observer, DrivenObserver):
            yield from observer.list_due(model)
        else:
            yield Due(f"observer {type(observer).__name__}", every)


def list_due_rows(model: Any) -> Iterator[Due]:
    """Iterate over what makes rows of the data collector be collected in Python."""
    every, collector = model.collect_every, model.datacollector
    if not every:
        return
    if type(collector) is not Collector:
        yield Due(f"datacollector {type(collector).__name__} of the model's class", every)
        return
    if collector.agent_reporters or collector.agenttype_reporters:
        yield Due("reporters of agents", every)
    for name, reporter in collector.model_reporters.items():
        held = held_of(reporter)
        if held is not None and held_function(model, held) is None:
            yield HeldDue(name, held, every)
        elif held is None and measure_in_place(model, reporter) is None:
            cure = "declare it by count, share, mean, value or measure, or hold it"
            yield Due(f"reporter {name}, a function in Python; {cure}", every)


def measure_in_place(model: Any, reporter: Any) -> ColumnMeasure | None:
    """Return the measure that a reporter is, if compiled code can read its column as it is now."""
    measure = measure_of(model, reporter)
    return measure if measure is not None and measure.is_in_place(model) else None


def held_function(model: Any, held: Held | None) -> ColumnMeasure | None:
    """Return the measure of a function that is held, if compiled code can compute it."""
    measure = None if held is None else measure_in_place(model, held.name)
    return measure if isinstance(measure, FunctionMeasure) else None


def held_of(reporter: Any) -> Held | None:
    """Return what holds the value of a reporter, if anything does."""
    function = getattr(reporter, "func", None)
    return function if isinstance(reporter, partial) and isinstance(function, Held) else None


def driver_of(model: Any, plan: Plan, stops: Sequence[Until]) -> Driver:
    """Return what drives a model, made anew where kernels have changed."""
    cache = model.driving
    kernels = [*kernels_of_stages(plan), *kernels_of_rows(model), *kernels_of_stops(model, stops)]
    kernels = add_kernels_of_observers(model, kernels)
    if cache.driver is None or not cache.driver.is_of(kernels):
        cache.driver = Driver(kernels, cache.flag)
    return cache.driver


def kernels_of_stages(plan: Plan) -> list[tuple[Kernel, int]]:
    """Return the kernels of a plan, each with every how many steps it is due."""
    return [(stage.kernel, stage.every) for _, stage in plan.stages if stage.kernel is not None]


def senses_first(plan: Plan) -> bool:
    """Return whether the first thing in a step is that robots read their sensors."""
    part, stage = plan.stages[0]
    return (part, stage.phase) == ("robots", Phase.SENSE)


def add_kernels_of_observers(model: Any, kernels: list[tuple[Kernel, int]]) -> list[tuple[Kernel, int]]:
    """Return the kernels of a step with those that observers have, behind the first, of sensing, and at the end."""
    observers = model.observers.driven()
    behind = [(kernel, 1) for observer in observers if (kernel := observer.kernel(model)) is not None]
    last = [(kernel, 1) for observer in observers if (kernel := observer.last_kernel(model)) is not None]
    return [*kernels[:1], *behind, *kernels[1:], *last]


def kernels_of_rows(model: Any) -> list[tuple[Kernel, int]]:
    """Return the kernel that writes the rows of the data collector, if it collects."""
    if not model.collect_every:
        return []
    cache, collector = model.driving, model.datacollector
    declared, held = measures_of_rows(model)
    key = (collector, *((name, measure.key(model)) for name, measure in declared.items()))
    if cache.rows is None or cache.rows_key != key:
        cache.rows, cache.rows_key = MeasuredRows(model, declared, partial(take_rows, model), held), key
    cache.rows.begin()
    return [(cache.rows.kernel, model.collect_every)]


def measures_of_rows(model: Any) -> tuple[dict[str, ColumnMeasure], dict[str, Held]]:
    """Return the reporters that compiled code reads, by name, and those of them that are held for some steps."""
    declared: dict[str, ColumnMeasure] = {}
    held: dict[str, Held] = {}
    for name, reporter in model.datacollector.model_reporters.items():
        holding = held_of(reporter)
        measure = measure_in_place(model, reporter) if holding is None else held_function(model, holding)
        if measure is not None:
            declared[name] = measure
            held |= {} if holding is None else {name: holding}
    return declared, held


def take_rows(model: Any, steps: list[int], values: dict[str, list]) -> None:
    """Add rows of measures to the data collector, beside values that are held."""
    collector = model.datacollector
    for name, reporter in collector.model_reporters.items():
        held = held_of(reporter)
        rows = values[name] if held is None or name in values else [deepcopy(held.value) for _ in steps]
        collector.model_vars[name].extend(rows)
    collector.note_collected(steps[-1], steps[-1] - model.driving.ahead)


def kernels_of_stops(model: Any, stops: Sequence[Until]) -> list[tuple[Kernel, int]]:
    """Return the kernels that set the flag where the run is to end."""
    cache, key = model.driving, []
    for condition in (*type(model).conditions, *stops):
        measure = measure_in_place(model, condition.of)
        if measure is not None:
            key.append((condition, measure.key(model)))
    if cache.stops_key != key:
        cache.stops = [(condition.kernel(model, cache.flag), condition.every) for condition, _ in key]
        cache.stops_key = key
    return cache.stops


def describe_driving(model: Any, plan: Plan) -> str:
    """Return in a line how many steps of a model one compiled call takes, and what is due in between."""
    dues = list(list_due(model, plan))
    most = min([most_steps_of(model), *(due.most for due in dues)])
    if most < FEWEST_STEPS and dues:
        return "one step at a time: what is Python is due in each"
    then = "" if all(isinstance(due, DueAfterwards) for due in dues) else ", then one in Python"
    return f"driven: up to {most} steps in one compiled call{then}"
