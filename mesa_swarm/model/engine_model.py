"""EngineModel: a Mesa model made of parts, its step and plan, its observers, its fingerprint."""

import os
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from inspect import getattr_static
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar, Self

import mesa
import numpy as np

from mesa_swarm.base.errors import InvalidValueError, StepWarning, check_choice, check_count, check_number, shortened
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.base.streams import Seed, Streams
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.team import Key
from mesa_swarm.kernels.part import Part
from mesa_swarm.kernels.plan import Plan
from mesa_swarm.maps.map import Map
from mesa_swarm.model.bodies_part import BodiesPart
from mesa_swarm.model.common import with_common
from mesa_swarm.model.control_part import ControlPart
from mesa_swarm.model.driving import Driving, Stretch, begin_stretch, describe_driving, list_due_of_model, list_due_rows
from mesa_swarm.model.events import EventLog, EventsPart
from mesa_swarm.model.fields_part import FieldsPart
from mesa_swarm.model.imperfections_part import ImperfectionsPart, imperfections_of
from mesa_swarm.model.measures import Until, check_stops
from mesa_swarm.model.mesa_model import GIVEN, LATE, Collector, MesaModel, add_reporters, rows_in, seed_sequence
from mesa_swarm.model.observers import Observers
from mesa_swarm.model.parameters import Dial, Noise, Slip
from mesa_swarm.model.parts import AnyPart, Parts, delegate
from mesa_swarm.model.processes import Process, ProcessesPart
from mesa_swarm.model.radio_part import RadioPart
from mesa_swarm.model.reporters import copy_held
from mesa_swarm.model.robots_part import RobotsPart
from mesa_swarm.model.state import State, StatePart
from mesa_swarm.model.state_hash import state_hash_of
from mesa_swarm.physics.contact import Contacts
from mesa_swarm.physics.engine import CompiledEngine, Engine
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.physics.threads import check_threads
from mesa_swarm.robots.imperfections import Imperfections
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.real_robots import Scale, check_scale
from mesa_swarm.robots.robot import Robot, remove_together
from mesa_swarm.robots.snapshots import Snapshots
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.arena import Agents, Arena, get_next_id, pause_collection
from mesa_swarm.world.bodies import Body, Load, Obstacle
from mesa_swarm.world.fields import NamedFields
from mesa_swarm.world.movers import Driven, Movers
from mesa_swarm.world.statics import FIRE

ENGINES: dict[str, type[Engine]] = {"compiled": CompiledEngine, "shapely": ShapelyEngine}
REPORTERS = {name: name for name in ("collisions", "total_collisions")}


METHODS = (FunctionType, property, classmethod, staticmethod)


class ShortWay:
    """A property that an attribute of the same name hides: models of before may have one."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function, self.__doc__ = function, function.__doc__

    def __get__(self, model: Any, kind: type) -> Any:
        return self if model is None else self.function(model)


class RowsOfStep:
    """What is known of the rows that a model and its class collect, in the present step and the one before."""

    def __init__(self) -> None:
        self.first = 0  # the steps that were completed when the present one began
        self.omitted = False  # whether a warning was given of a step without the model's own
        self.before: tuple[int, ...] | None = None  # during a step with a data collector of the user's own
        self.is_due = False
        self.by_model: bool | None = None  # whether the model added the row of the step before, rather than its class
        self.mixed = False  # whether a warning was given that both do


class EngineModel(MesaModel):
    """A Mesa model made of parts, advanced step by step; `SwarmModel` adds fires and recordings.

    What the model is made of lies in `parts`; the attributes and methods here are short ways to these.

    Attributes
    ----------
    parts : Parts
    map : Map
    space : Arena
    swarm : Swarm
    streams : Streams
    stops : Until or sequence of Until
        Of a class: conditions, of which any ends the run; see `until`. A model stops running after the step in which
        one holds, and goes on when it no longer does.
    stopped_at : int
        The step in which the run ended for the first time, None before, of a class with `stops`.
    """

    map: Map
    space: Arena
    swarm: Swarm
    stops: ClassVar[Until | Sequence[Until]] = ()
    conditions: ClassVar[tuple[Until, ...]] = ()
    _parts: Parts
    if TYPE_CHECKING:
        fires: Any  # of the part that `SwarmModel` adds
        fire_constants: Any

    def __init_subclass__(cls, shows_all: bool = False, **keywords: Any) -> None:
        """Let the constructor of the class take the parameters that every model takes."""
        super().__init_subclass__(**keywords)
        declared = getattr_static(cls, "stops")
        if not isinstance(declared, METHODS):  # else it is something of a user's
            cls.conditions = check_stops(declared)
        # A class of several bases may inherit its constructor from one and a default of these parameters from another.
        if "__init__" in cls.__dict__ or len(cls.__bases__) > 1:
            cls.__init__ = with_common(cls, shows_all)  # type: ignore[method-assign]

    def __init__(
        self,
        *,
        map: str | os.PathLike | Map = "openspace",
        rng: Seed = None,
        engine: str = "compiled",
        threads: int | None = None,
        turn_angle_degrees: float = 60.0,
        collect_every: int | Trigger = 1,
        communication: Radio | None = None,
        noise: Noise = 0.0,
        slip: Slip = 0.0,
        imperfections: Dial = 0.0,
        model_reporters: dict | None = None,
        agent_reporters: dict | None = None,
        scale: Scale | None = None,
    ) -> None:
        of_user = {*self.__dict__} - {"given", "_common"}
        effect = imperfections_of(noise, slip, imperfections)
        self.driving = Driving()
        turn_angle = np.radians(check_number("turn_angle_degrees", turn_angle_degrees, minimum=0, maximum=90))
        computing: Engine = ENGINES[check_choice("engine", engine, ENGINES)]()
        computing.threads = check_threads(threads)
        self.map, self.scale = Map.load(map), scale
        super().__init__(rng)
        self.streams = Streams(seed_sequence(rng, self.rng))
        x_min, y_min, x_max, y_max = self.map.bounds
        self.space = Arena([[x_min, x_max], [y_min, y_max]], random=self.random, n_agents=0)
        self.swarm = Swarm()
        self.space.attach(self.swarm)
        self._completed, self._rows = 0, RowsOfStep()
        self._stand(computing, turn_angle, communication)
        if effect is not None:
            self.imperfections = effect
        self.observers = ()
        self.collect_every = collect_every
        for name, reporters in (("model_reporters", model_reporters), ("agent_reporters", agent_reporters)):
            if reporters is not None and not isinstance(reporters, Mapping):
                raise InvalidValueError(f"{name} is {shortened(reporters)}; expected a dict of reporters by name")
        reporters = {name: copy_held(reporter) for name, reporter in (model_reporters or {}).items()}
        self.datacollector = Collector({**REPORTERS, **reporters}, agent_reporters)
        get_next_id(self)  # from here on the model has its counter
        self._own = frozenset({*self.__dict__, *LATE, "_own", "_common", "scenario", GIVEN} - of_user)
        if type(self).conditions:
            self.stopped_at: int | None = None

    def _stand(self, engine: Engine, turn_angle: float, radio: Radio | None) -> None:
        """Make the parts that every model has, and the obstacles of the map."""
        self._parts = Parts(self)
        stand = self._parts.stand
        stand(BodiesPart(self))
        stand(RobotsPart(self, engine, turn_angle))
        stand(ImperfectionsPart(self))
        stand(RadioPart(self, radio))
        stand(ControlPart(self))
        stand(FieldsPart(self))
        stand(ProcessesPart(self))
        stand(StatePart())
        stand(EventsPart(self))
        with pause_collection():
            if type(self).add_obstacle is EngineModel.add_obstacle:
                self._parts.bodies.add_obstacles(self.map.obstacles)
                return
            for shape in self.map.obstacles:
                self.add_obstacle(shape)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Let the parts of a copied or unpickled model take what they need of it."""
        getattr(super(), "__setstate__", self.__dict__.update)(state)  # newer versions of Mesa have their own
        self._parts.bind()

    @property
    def reserved(self) -> frozenset[str]:
        """The names of the attributes that the model has made itself, and Mesa for it."""
        return self._own

    @property
    def own_attributes(self) -> dict[str, Any]:
        """The attributes that a derived class or a user has given the model, by name: those that are stored as such."""
        return {name: value for name, value in self.__dict__.items() if name not in self._own}

    @property
    def parts(self) -> Parts:
        """What the model is made of: its parts by name, in the order of their stages.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(map="openspace_fire", rng=1).parts["fires"].columns()["area"].array.shape
        (7,)
        """
        return self._parts

    @parts.setter
    def parts(self, value: object) -> None:
        raise InvalidValueError(
            f"parts is {shortened(value)}; model.parts is what the model is made of: use another name, or add_part(...)"
        )

    @ShortWay
    def plan(self) -> Plan:
        """Return the stages of a step in their order, which can be printed.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> [stage.name for _, stage in SwarmModel(rng=1).plan.stages][:2]
        ['robots read their sensors', 'robots move, and contacts are resolved']
        """
        self.parts.replan()  # which layers are compiled is known after the first step
        besides = [str(due) for due in (*list_due_of_model(self), *list_due_rows(self))]
        plan = self.parts.plan
        return plan._replace(besides=tuple(besides), driven=describe_driving(self, plan))

    def add_part(self, part: AnyPart) -> AnyPart:
        """Add a part, whose stages belong to each step from now on, and return it; see `Part`.

        Raises
        ------
        InvalidValueError
            If it lacks a method, its name is not one word, or the model has a part of that name.

        Examples
        --------
        >>> from mesa_swarm import Part, SwarmModel
        >>> class Season(Part):
        ...     name = "season"
        ...
        ...     def __init__(self, days=90):
        ...         self.days = days
        >>> model = SwarmModel(rng=1)
        >>> season = model.add_part(Season())
        >>> model.parts["season"].store()
        {'days': 90}
        """
        return self.parts.add(part)

    def remove_part(self, name: str) -> Part:
        """Take a part that was added out of the model, between two steps, and return it.

        Raises
        ------
        UnknownNameError
            If there is none of this name.
        InvalidValueError
            If every model has it.
        """
        return self.parts.remove(name)

    @property
    def scale(self) -> Scale | None:
        """How long a metre and a step are, which pictures, charts and tables show; None if it has none.

        Examples
        --------
        >>> from mesa_swarm import E_PUCK, SwarmModel
        >>> model = SwarmModel(scale=E_PUCK.scale, rng=1)
        >>> robots = model.add_robots(E_PUCK.design(), 5)
        >>> round(model.scale.metres(model.map.width), 2)
        5.92
        """
        return self._scale

    @scale.setter
    def scale(self, scale: Scale | None) -> None:
        self._scale = check_scale(scale)

    @property
    def robots(self) -> Agents[Robot]:
        """The robots as Mesa agents, in the order of the swarm's rows."""
        agents = Agents.of_list(self.swarm.agents, self.random)
        self.swarm.listed[id(agents)] = agents
        return agents

    add_robots = delegate("robots", RobotsPart.add_robots)

    remove_robots = delegate("robots", RobotsPart.remove_robots)

    def remove_all_agents(self) -> None:
        """Take all agents out of the model, between two steps; robots at once, which is much quicker."""
        remove_together(self.swarm.agents)
        super().remove_all_agents()

    @property
    def obstacle_list(self) -> list[Body]:
        """The obstacles, loads, driven bodies and ground marks as a list, quicker to look at; to be read only."""
        return self.parts.bodies.listed

    @property
    def bodies(self) -> Agents[Body]:
        """All bodies as Mesa agents, in the order in which they came: obstacles, loads, driven ones, fires, marks."""
        return Agents(self.parts.bodies.table.agents, random=self.random)

    @property
    def obstacles(self) -> Agents[Obstacle]:
        """The obstacles, loads and ground marks as Mesa agents, in the order in which they were added."""
        return Agents([body for body in self.obstacle_list if isinstance(body, Obstacle)], random=self.random)

    @property
    def loads(self) -> Agents[Load]:
        """The loads as Mesa agents, in the order in which they were added."""
        return Agents(self.parts.bodies.loads, random=self.random)

    @property
    def displaced(self) -> list[Load | Driven]:
        """The bodies that may change their places, loads and driven bodies, in the order in which they were added."""
        return self.parts.bodies.displaced

    @property
    def movers(self) -> Movers:
        """The poses of all driven bodies as arrays, to be read only; see `move_bodies`."""
        return self.parts.bodies.movers

    @property
    def kinds(self) -> tuple[str, ...]:
        """The names of what sensors see: the place of a name is its code in `swarm.kind` and `swarm.contact_kind`.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).kinds
        ('obstacle', 'robot', 'fire', 'load')
        """
        return self.parts.bodies.kinds

    add_kind = delegate("bodies", BodiesPart.add_kind)

    kind_code = delegate("bodies", BodiesPart.kind_code)

    add_body = delegate("bodies", BodiesPart.add_body)

    move_bodies = delegate("bodies", BodiesPart.move_bodies)

    attach = delegate("bodies", BodiesPart.attach)

    release = delegate("bodies", BodiesPart.release)

    carried_by = delegate("bodies", BodiesPart.carried_by)

    add_obstacle = delegate("bodies", BodiesPart.add_obstacle)

    add_load = delegate("bodies", BodiesPart.add_load)

    @property
    def fields(self) -> NamedFields:
        """The scalar fields by name, in the order in which they were added."""
        return self.parts.fields.named()

    add_field = delegate("fields", FieldsPart.add_field)

    remove_field = delegate("fields", FieldsPart.remove_field)

    @property
    def state(self) -> State:
        """Custom values that belong to the model's state: hashed, stored, resumed and copied with it.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> model.state["delivered"] = 0
        >>> model.state["delivered"] += 2
        >>> model.state["delivered"]
        2
        """
        return self.parts.state.values

    @state.setter
    def state(self, values: Mapping[str, Any]) -> None:
        self.parts.state.values = State(values)

    @property
    def processes(self) -> tuple[Process, ...]:
        """What happens in each step besides robots, in the order in which it was added."""
        return tuple(self.parts.processes.numbered.values())

    add_process = delegate("processes", ProcessesPart.add_process)

    remove_process = delegate("processes", ProcessesPart.remove_process)

    @property
    def events(self) -> EventLog:
        """What happened, as arrays: `step`, `name`, `unique_id` and `value`; see `event`."""
        return self.parts.events.log

    event = delegate("events", EventsPart.event)

    @property
    def imperfections(self) -> Imperfections | None:
        """How the robots differ from ideal ones, or None; may be changed between steps.

        The parameters `noise`, `slip` and `imperfections` of a model set it; a value set later replaces all three.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> from mesa_swarm.robots.imperfections import ROBOTARIUM
        >>> model = SwarmModel(noise=0.1, rng=1)
        >>> model.imperfections.sensing.error
        0.1
        >>> model.imperfections = ROBOTARIUM.at(0.5)
        >>> model.imperfections.sensing.dropout
        0.0175
        """
        return self.parts.imperfections.imperfections

    @imperfections.setter
    def imperfections(self, imperfections: Imperfections | None) -> None:
        self.parts.imperfections.set_imperfections(imperfections)

    @property
    def observers(self) -> Observers:
        """What is called around each step and each run, see `Observer`: a list to append to and remove from."""
        return self.__dict__["observers"]

    @observers.setter
    def observers(self, observers: Iterable[Any]) -> None:
        self.__dict__["observers"] = Observers(observers)

    @property
    def datacollector(self) -> mesa.DataCollector:
        """What is collected in each step, see `collect_every`; it may be replaced by another data collector.

        Such a collector gets `collisions` and `total_collisions` as well. It is collected by the model's class, as is
        usual in Mesa, or else, in steps in which that does not collect, by the model at the end of the step.

        Raises
        ------
        InvalidValueError
            If it is replaced by something else than a data collector.

        Examples
        --------
        >>> import mesa
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> class Usual(SwarmModel):
        ...     def __init__(self, *, rng=None):
        ...         super().__init__(rng=rng)
        ...         self.datacollector = mesa.DataCollector(model_reporters={"robots": lambda model: len(model.robots)})
        ...
        ...     def step(self):
        ...         super().step()
        ...         self.datacollector.collect(self)
        >>> Usual(rng=1).run(5).datacollector.get_model_vars_dataframe().shape
        (5, 3)
        """
        return self.__dict__["datacollector"]

    @datacollector.setter
    def datacollector(self, collector: mesa.DataCollector) -> None:
        if not isinstance(collector, mesa.DataCollector):
            raise InvalidValueError(f"datacollector is {shortened(collector)}; expected a mesa.DataCollector(...)")
        add_reporters(collector, REPORTERS)
        self.__dict__["datacollector"] = collector

    @property
    def threads(self) -> int:
        """How many threads share each step of the compiled engine; may be changed between steps.

        The state has the same bits for any number. Worlds of fewer than 500 robots are not shared, which would make
        them hardly faster, and of fewer than 10,000 only in `run`. See `mesa_swarm.physics.threads`.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1, threads=2).threads
        2
        """
        return self.parts.robots.engine.threads

    @threads.setter
    def threads(self, threads: int) -> None:
        self.parts.robots.engine.threads = check_threads(threads)
        self.parts.replan()

    @property
    def collect_every(self) -> int:
        """Steps between two rows of `datacollector`, 0 for no rows at all; may be changed between steps.

        A row of the usual two numbers takes 50 bytes: 10 million steps with ``collect_every=1`` take half a gigabyte.
        Rows are collected after the steps that it divides; `mesa.batch_run` needs one after each step.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> model = SwarmModel(rng=1, collect_every=10).run(40)
        >>> len(model.datacollector.get_model_vars_dataframe())
        4
        """
        return self._collect_every.every

    @collect_every.setter
    def collect_every(self, every: int | Trigger) -> None:
        self._collect_every = Trigger.of(every, "collect_every")

    @property
    def communication(self) -> Radio | None:
        """How robots broadcast to each other, or None; a change, between steps, clears all messages."""
        return self.parts.radio.radio

    @communication.setter
    def communication(self, radio: Radio | None) -> None:
        self.parts.radio.set_radio(radio)

    @property
    def control(self) -> Arbiter | None:
        """What drives the robots: an arbiter such as `Subsumption`, or None.

        It may be set to a mapping of designs and names of groups to arbiters, and then is a `Team`: a mapping of
        the same keys to the arbiters that belong to this model. The arbiter of a robot's group drives it, or else that
        of its design; every robot needs one.

        Examples
        --------
        >>> from mesa_swarm import AGENT3, AGENT9, SwarmModel
        >>> from mesa_swarm.control import Avoid, Explore, Subsumption
        >>> model = SwarmModel(rng=1)
        >>> scouts, others = model.add_robots(AGENT9, 2, group="scouts"), model.add_robots(AGENT3, 3)
        >>> avoid = Avoid(distance=15)
        >>> model.control = {"scouts": Subsumption(avoid, Explore()), AGENT3: Subsumption(avoid)}
        >>> model.control.names
        ('scouts: Avoid', 'Explore', 'AGENT3: Avoid')
        """
        return self.parts.control.arbiter

    @control.setter
    def control(self, control: Arbiter | Mapping[Key, Arbiter | None] | None) -> None:
        self.parts.control.set_control(control)

    @property
    def collisions(self) -> int:
        """How many robots overlapped anything in the last step."""
        return self.parts.robots.collisions

    @collisions.setter
    def collisions(self, collisions: int) -> None:
        self.parts.robots.collisions = collisions

    @property
    def total_collisions(self) -> int:
        """The sum of `collisions` over all steps."""
        return self.parts.robots.total_collisions

    @total_collisions.setter
    def total_collisions(self, collisions: int) -> None:
        self.parts.robots.total_collisions = collisions

    @ShortWay
    def robot_steps(self) -> int:
        """Return the sum of the number of robots over all steps, by which collisions are divided."""
        return self.parts.robots.robot_steps

    def step(self) -> None:
        """Advance the world by one step.

        | phase | reads | writes |
        | --- | --- | --- |
        | sense | position, heading, bodies | distance, kind, radiation, line, own sensors |
        | exchange | layer, task, sent_goal, pose, obstacles | heard_layer, heard_task, heard_from, heard_goal |
        | decide | what robots know (`control.Senses`) | command, layer, task, goal, sent_goal, act |
        | act | what actuators are set to | what they are about |
        | move | command, loads, driven bodies' aims | loads, driven bodies, position, heading |
        | resolve | position, bodies | position, heading, slip, collided, contacts |
        | process | position, fields | fields; then what each of `processes` changes |
        | collect | everything | datacollector, history |

        Every robot acts on what was published after the previous step; nothing depends on their order. Fields are the
        first to advance in their phase.
        Without `communication` nothing is exchanged.

        Raises
        ------
        UnobservedStepError
            If the model has observers, and the method of the class was called beside the model's own ``model.step()``.
        """
        self._check_observed()
        plan = self._parts.plan
        for call in plan.calls:
            call()
        self._completed += 1
        for call in plan.collecting:
            call()
        self._collect()
        if self.conditions:
            self._check_stops()

    def _check_stops(self) -> None:
        """Stop running where a condition of the class holds; go on where it no longer does."""
        due = [condition for condition in self.conditions if self._completed % condition.every == 0]
        if any(condition(self) for condition in due):
            self._end_run()
        elif len(due) < len(self.conditions):
            return
        elif not self.running and self.stopped_at is not None:
            self.running = True

    def _end_run(self) -> None:
        self.running = False
        if self.stopped_at is None:
            self.stopped_at = self.steps

    sense = delegate("robots", RobotsPart.sense)

    def run(self, steps: int, progress: bool = False, *, until: Callable[[Self], object] | None = None) -> Self:
        """Take this many steps, fewer if the model stops running, and return the model.

        Parameters
        ----------
        steps : int
        progress : bool
            Whether to show a bar with the time left and the time of day at which the run ends.
        until : callable, optional
            Called with the model after each step; the run ends when it returns True. A declared condition, such as
            ``until_zero("fires_burning")``, takes no step more slowly.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).run(3).steps
        3
        >>> SwarmModel(rng=1).run(30, until=lambda model: model.steps > 4).steps
        5
        """
        with closing(self._list_stretches(steps, progress, until)) as stretches:
            for stretch in stretches:
                stretch.take()
        return self

    def _list_stretches(
        self, steps: int, progress: bool = False, until: Callable[[Self], object] | None = None
    ) -> Generator[Stretch, None, None]:
        """Take the steps of a run, but for stretches that this yields, each of which is to be taken before the next."""
        stops = (until,) if isinstance(until, Until) else ()
        with progress_bar(check_count("steps", steps), "steps", progress) as bar, self._observed_run():
            left = bar.total
            while left and self.running:
                stretch = begin_stretch(self, left, stops) if until is None or stops else None
                if stretch is None:
                    self.step()
                else:
                    yield stretch
                taken = 1 if stretch is None else stretch.taken
                left -= taken
                bar.update(taken)
                if self._is_ended(until):
                    break

    def _is_ended(self, until: Callable[[Self], object] | None) -> bool:
        """Return whether a run ends after this step."""
        if until is None or (isinstance(until, Until) and self._completed % until.every):
            return False
        return bool(until(self))

    def _collect(self) -> None:
        if self._collect_every.is_due(self._completed):
            collector = self.__dict__["datacollector"]
            if self._rows.before is None:
                collector.collect(self)
            else:
                self._rows.is_due = True
        for observer in self.__dict__["observers"].due(self._completed):  # without the cost of the property
            observer.after_step(self, self._completed)

    @property
    def completed(self) -> int:
        """How many steps were completed."""
        return self._completed

    def _begin_step(self) -> None:
        rows, collector = self._rows, self.__dict__["datacollector"]
        rows.first = self._completed
        if type(collector) is not Collector:
            rows.before, rows.is_due = rows_in(collector), False
        self.parts.begin_step()

    def _fail_step(self) -> None:
        self.parts.robots.forget_readings()  # which were those of the step that failed

    def _end_step(self) -> None:
        if self._rows.before is not None:
            self._collect_once(self._rows.before)
        if self._completed == self._rows.first and not self._rows.omitted:
            self._rows.omitted = True
            name = type(self).__name__
            warnings.warn(
                f"{name}.step took no step of the model, so that nothing in it has moved; call super().step() in "
                "it, once",
                StepWarning,
                stacklevel=3,
            )

    def _collect_once(self, rows_begun: tuple[int, ...]) -> None:
        """Collect by a collector of the user's own, unless the step of the model's class has."""
        collector, is_due = self.__dict__["datacollector"], self._rows.is_due
        self._rows.before, self._rows.is_due = None, False
        if not is_due:
            return
        is_added = rows_in(collector) == rows_begun
        if is_added:
            collector.collect(self)
        if self._rows.by_model is not None and self._rows.by_model != is_added and not self._rows.mixed:
            self._rows.mixed = True
            warnings.warn(
                f"{type(self).__name__} collects after some steps only, and the model after the others, so that each "
                "has a row; collect_every=0 leaves collecting to the class",
                StepWarning,
                stacklevel=4,
            )
        self._rows.by_model = is_added

    @property
    def contacts(self) -> "Contacts":
        """The deepest contact of every robot that collided in the last step."""
        return Contacts.of(self.swarm, self.obstacle_list, {FIRE: self.parts.bodies.fires()})

    watch = delegate("control", ControlPart.watch)

    @property
    def watched(self) -> Snapshots | None:
        """What `watch` stores, None without it."""
        return self.parts.control.snapshots

    explain = delegate("control", ControlPart.explain)

    def state_hash(self) -> str:
        """Return a fingerprint of all numbers that steps read or write: equal for equal runs, in any number of threads.

        Hashed are all columns, bodies of every kind with their shapes and poses, fields, the bounds of the map,
        designs, parameters of layers, of the radio, of imperfections and of what burns, rules by their source and the
        constants that they read, processes, learners and the declared state. Not hashed are threads, the engine,
        `collect_every`, reporters, observers, looks, parameters that nothing reads, attributes of a model that only its
        own `step` reads (use `state`), states of random streams, and Mesa agents of other classes. All sensors are read
        first, so that the fingerprint is independent of earlier readings.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> one, other = SwarmModel(rng=1), SwarmModel(rng=1)
        >>> one.state_hash() == other.state_hash()
        True
        >>> mark = other.add_obstacle(disc((100, 100), 5))
        >>> one.state_hash() == other.state_hash()
        False
        """
        self.sense()
        return state_hash_of(self)

    @contextmanager
    def _observed_run(self) -> Iterator[None]:
        """Call observers when a run is over; an error or Ctrl-C closes them, so that what they recorded is stored."""
        begin = self.completed
        try:
            yield
        except BaseException:
            for observer in self.observers.complete:
                observer.break_off()
            raise
        for observer in self.observers.complete:
            observer.after_run(self, self.completed - begin)


# As the constructors of derived classes, it gets the common parameters that these have not declared.
EngineModel.__init__ = with_common(EngineModel)  # type: ignore[method-assign]
