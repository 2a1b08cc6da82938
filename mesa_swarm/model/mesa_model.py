"""MesaModel: Mesa's model with all that depends on its version: steps, clock, seed, scenario, removal of agents."""

import inspect
import warnings
from collections import defaultdict
from collections.abc import Callable, Container, Mapping
from random import Random
from typing import Any, Self, cast

import mesa
import numpy as np

from mesa_swarm.base.errors import InvalidValueError, StepWarning, UnobservedStepError, shortened
from mesa_swarm.base.streams import Seed
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.kernels.compiling import compilation
from mesa_swarm.model.observers import Observers
from mesa_swarm.model.parameters import check_names
from mesa_swarm.world.arena import ArenaAgent, hold_agents

# Mesa 4 has neither `steps` nor `batch_run`, and seeds `random` in another way.
FOUR = int(mesa.__version__.partition(".")[0]) >= 4
# Attributes that Mesa sets when it needs them: what follows from its own state.
LATE = ("time", "_time", "_batch_context", "_suppress", "subscribers", "_in_step", "_passing")
LARGEST_INT32 = int(np.iinfo(np.int32).max)
# The scenario that a constructor was given, until Mesa's constructor has it.
GIVEN = "_given_scenario"


class MesaModel(mesa.Model):
    """A Mesa model that counts its steps, calls observers and draws the same numbers with Mesa 3.3, 3.5 and 4.

    Attributes
    ----------
    steps : int
        How many steps were begun: Mesa 4 counts time only.
    observers : Observers
    """

    observers: Observers
    running: bool
    _completed: int
    _in_step: bool = False
    _passing: bool = False

    def __new__(cls, *arguments: Any, **keywords: Any) -> Self:
        """Store the arguments of the outermost constructor, with which a recorded model is made again."""
        if "seed" in keywords and not declares(cls, "seed"):
            raise InvalidValueError(f"seed was given to {cls.__name__}; the seed of a model is rng, as in rng=1")
        compilation.expect(cls)
        model = super().__new__(cls)
        if "scenario" in keywords and not declares(cls, "scenario"):
            keywords = without_scenario(cls, keywords)
        # Before any constructor of a subclass has changed them; triggers as recordings have them.
        model.given = tuple(map(_plain, arguments)), {name: _plain(value) for name, value in keywords.items()}
        return model

    def __init__(self, rng: Seed) -> None:
        seed = checked_seed(rng)
        self.__dict__["step"] = self._whole_step  # Mesa wraps, in its constructor, the step that a model has
        super().__init__(rng=seed)
        if FOUR:
            self.steps = 0
            _seed_as_before(self.random, seed, self.rng)
        hold_agents(self)
        scenario = self.__dict__.pop(GIVEN, None)
        if scenario is not None:
            self.scenario = scenario

    def __getstate__(self) -> dict[str, Any]:
        """Return the state of a copy, which nothing observes: neither `observers` nor what Mesa's `observe` added."""
        state = self.__dict__.copy()
        state.pop("_in_step", None)
        if state.get("subscribers"):
            state["subscribers"] = defaultdict(list)
        return state

    def _whole_step(self, *arguments: Any, **keywords: Any) -> None:
        """Take the step of the model's own class, of which the engine's step is a part, and call observers.

        They are called after a step that failed as well: what it has changed stays.
        """
        if FOUR:
            self.steps += 1
        if self._passing:
            return
        observers, number = self.__dict__["observers"], self._completed + 1  # without the cost of the property
        self._in_step = True
        try:
            for observer in observers.due(number):
                observer.before_step(self)
            self._begin_step()
            type(self).step(self, *arguments, **keywords)
            self._end_step()
            for observer in observers.due(number):
                observer.between_steps(self)
        except BaseException:
            _schedule_again(self)
            self._fail_step()
            for observer in observers.complete:
                observer.after_failure(self)
            raise
        finally:
            self._in_step = False

    def _check_observed(self) -> None:
        """Refuse a step that `_whole_step` has not begun, of which observers would know only a part."""
        if not self._in_step and self.__dict__["observers"]:
            name = type(self).__name__
            raise UnobservedStepError(
                f"a step of {name} was taken that its observers, such as a recorder, would miss; call model.step() or "
                f"model.run(...), not {name}.step(model), and do not replace model.step"
            )

    def _begin_step(self) -> None:
        """Prepare for a step, before the model's own class does anything of it."""

    def _fail_step(self) -> None:
        """Notice that a step has failed."""

    def _end_step(self) -> None:
        """Complete a step, after the model's own class has done all of it."""

    def deregister_agent(self, agent: mesa.Agent) -> None:
        """Take an agent out of the model; of robots, obstacles, loads, fires and other bodies as their `remove` does.

        Raises
        ------
        RemovedRobotError
            If a robot or a body was removed already.
        InvalidValueError
            If it is of another model.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> first, second = model.add_robots(AGENT9, 2)
        >>> model.deregister_agent(first)
        >>> model.robots[0] is second, len(model.swarm)
        (True, 1)
        """
        if not isinstance(agent, ArenaAgent):
            super().deregister_agent(agent)
            return
        if agent.model is not self:
            raise InvalidValueError(f"agent is {shortened(agent)} of another model; expected one of model.agents")
        if agent.space is None and agent in self.agents:  # its `remove` has taken it out of the space
            super().deregister_agent(agent)
        else:
            agent.remove()


def _plain(value: object) -> object:
    return value.every if isinstance(value, Trigger) else value


def seed_sequence(rng: Seed, generator: np.random.Generator) -> np.random.SeedSequence:
    """Return the root of the streams: the seed itself, or a draw of the generator given instead."""
    if isinstance(rng, (np.random.Generator, np.random.BitGenerator)):
        return np.random.SeedSequence(int(generator.integers(2**63)))
    return cast(np.random.SeedSequence, generator.bit_generator.seed_seq)  # the generator was made of a seed


def checked_seed(rng: Seed) -> Seed:
    """Return what Mesa takes as a seed; anything else is refused before Mesa sees it."""
    if isinstance(rng, np.integer):
        rng = int(rng)
    try:
        # Of a RandomState, NumPy makes a generator whose seed is not known.
        if isinstance(rng, (bool, np.random.RandomState)):
            raise TypeError
        bits = np.random.default_rng(rng).bit_generator
    except (TypeError, ValueError):
        raise InvalidValueError(
            f"rng is {shortened(rng)}; expected a whole number of at least 0, a SeedSequence, a Generator or None"
        ) from None
    if FOUR and "state" not in cast(dict, bits.state["state"]):  # which Mesa 4.0.0a0 reads
        raise InvalidValueError(
            f"rng is of {type(bits).__name__}, of which Mesa {mesa.__version__} makes no model; expected a generator "
            "from numpy.random.default_rng(seed)"
        )
    return rng


def _seed_as_before(random: Random, seed: Seed, generator: np.random.Generator) -> None:
    """Seed the model's `random` as Mesa 3 does: by the seed, or by a draw of the generator made of it."""
    if seed is not None:
        random.seed(seed if isinstance(seed, int) else int(generator.integers(LARGEST_INT32)))


# ---- the clock


def set_steps(model: MesaModel, steps: int) -> None:
    """Set the number of steps that were counted, without taking them."""
    if has_own_events(model):
        _pass_steps(model, steps)
    elif not hasattr(model, "_default_schedule"):  # Mesa 3.3 has no time
        model.steps = steps
    else:
        model._default_schedule.pause()
        model.steps, model.time = steps, float(steps)
        model._default_schedule.resume()


def is_stepped_by_itself(model: MesaModel) -> bool:
    """Return whether `step` is what Mesa made of the step of the model, rather than what has replaced it."""
    step, whole = model.__dict__.get("step"), model.__dict__.get("_user_step")
    functions = [getattr(method, "__func__", None) for method in (step, whole) if method is not None]
    return bool(functions) and all(
        function is MesaModel._whole_step or getattr(function, "__module__", "").startswith("mesa.")
        for function in functions
    )


def has_own_events(model: MesaModel) -> bool:
    """Return whether anything besides the step is scheduled."""
    if not hasattr(model, "_default_schedule"):
        return False
    step = model._default_schedule
    generators = [generator for generator in model._event_generators if generator is not step]
    # While the step is being taken, its own event is not among those that wait.
    waiting = [event for event in model._event_list._events if not event.CANCELED and event is not step._current_event]
    return bool(generators) or bool(waiting) or model.time != model.steps


def _pass_steps(model: MesaModel, steps: int) -> None:
    """Count steps without taking them, so that other scheduled events occur when they are due."""
    model._passing = True
    try:
        while model.steps < steps:
            model.step()
    finally:
        del model._passing


def _schedule_again(model: MesaModel) -> None:
    """Let Mesa take a step after one that failed, as Mesa 3.3 does: later schedules end with an error."""
    schedule = getattr(model, "_default_schedule", None)
    if schedule is not None:
        schedule.pause()
        schedule.resume()


class Collector(mesa.DataCollector):
    """The data collector that a model makes for itself: one row a step, also if the model's class collects as well."""

    _collected: tuple[int, int] | None = None
    _warned = False

    def collect(self, model: Any) -> None:
        """Add a row of the present state, in the place of one that was collected after the same step."""
        now = (model.steps, model.completed)
        if self._collected == now:
            self._warn(model)
            for values in self.model_vars.values():
                values.pop()
        super().collect(model)
        self._collected = now

    def note_collected(self, steps: int, completed: int) -> None:
        """Note that the row after a step was added in another way."""
        self._collected = (steps, completed)

    def _warn(self, model: Any) -> None:
        if self._warned:
            return
        self._warned = True
        warnings.warn(
            f"{type(model).__name__} collected step {model.completed} twice, of which the later row counts: a model "
            "collects by itself; leave out datacollector.collect(...), or collect by it alone with collect_every=0",
            StepWarning,
            stacklevel=3,
        )


def add_reporters(collector: mesa.DataCollector, reporters: Mapping[str, Any]) -> None:
    """Let a data collector collect these of the model as well; they are missing in rows that it has already."""
    rows = max(map(len, collector.model_vars.values()), default=0)
    for name in [name for name in reporters if name not in collector.model_reporters]:
        collector.model_reporters[name] = reporters[name]
        collector.model_vars[name] = [None] * rows


def rows_in(collector: mesa.DataCollector) -> tuple[int, ...]:
    """Return how many rows a data collector has of the model, of agents, and of agents of a type."""
    of_agents = (collector._agent_records, collector._agenttype_records)
    return (*map(len, collector.model_vars.values()), *map(len, of_agents))


def collected_of_agents(collector: mesa.DataCollector, steps: int, time: float) -> list[dict[str, Any]]:
    """Return what a data collector has of each agent after a step, or at a time, by which Mesa 4 stores it."""
    when = time if FOUR else steps
    records = [(collector.agent_reporters, row) for row in collector._agent_records.get(when, ())]
    for kind, rows in collector._agenttype_records.get(when, {}).items():
        records += [(collector.agenttype_reporters[kind], row) for row in rows]
    return [{"AgentID": row[1], **dict(zip(reporters, row[2:], strict=True))} for reporters, row in records]


# ---- scenarios


def declares(constructor: Callable[..., Any], name: str) -> bool:
    """Return whether a constructor, or that of a class, has a parameter of this name."""
    return name in inspect.signature(constructor).parameters


def without_scenario(model_class: type, keywords: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a class with the values of a Mesa scenario in the place of ``scenario=``.

    Raises
    ------
    InvalidValueError
        If it is not a scenario, this Mesa has none, or a value is given beside the scenario too.
    UnknownNameError
        If the class has no parameter of a name in the scenario.
    """
    values = _values_of(keywords["scenario"])
    check_names(model_class, values)
    return _combine_parameters(values, keywords)


def parameters_of_scenario(parameters: Container[str], keywords: Mapping[str, Any]) -> dict[str, Any]:
    """Return the same for a base of a class that has a parameter `scenario` and reads the other values itself."""
    values = _values_of(keywords["scenario"])
    return _combine_parameters({name: value for name, value in values.items() if name in parameters}, keywords)


def _combine_parameters(values: dict[str, Any], keywords: Mapping[str, Any]) -> dict[str, Any]:
    others = {name: value for name, value in keywords.items() if name != "scenario"}
    if others.get("rng", 0) is None:
        del others["rng"]
    for name in values.keys() & others.keys():
        raise InvalidValueError(f"{name} is given by the scenario and as a parameter; give it once")
    return {**others, **values}


def _values_of(scenario: Any) -> dict[str, Any]:
    """Return the parameters of a scenario, `rng` among them; None, which Mesa takes for no scenario, has none."""
    if scenario is None:
        return {}
    kind = getattr(getattr(mesa.experimental, "scenarios", None), "Scenario", None)
    if kind is None:
        raise InvalidValueError(
            f"scenario was given, but Mesa {mesa.__version__} has none; install mesa>=3.5 on Python 3.12 or newer, or "
            "give the parameters and rng themselves"
        )
    if not isinstance(scenario, kind):
        raise InvalidValueError(f"scenario is {shortened(scenario)}; expected a Scenario(rng=1, ...) of Mesa's")
    return {**vars(scenario), "rng": _seed_of(scenario)}


def _seed_of(scenario: Any) -> Seed:
    """Return the seed of a scenario; one of Mesa 4 has a generator made of it."""
    if not FOUR:
        return scenario.rng
    generator = scenario.rng.bit_generator
    if type(generator)(generator.seed_seq).state != generator.state:
        raise InvalidValueError(
            "scenario.rng has been drawn from, or was unpickled, so that its seed is unknown; give a new "
            "Scenario(rng=seed, ...)"
        )
    return generator.seed_seq
