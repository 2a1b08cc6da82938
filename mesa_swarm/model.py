"""EngineModel: the world, its step, written once, its observers and its fingerprint."""

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ClassVar, Self

import mesa
import numpy as np

from mesa_swarm.control.arbiter import Arbiter, driver
from mesa_swarm.control.explain import Explanation, explanation
from mesa_swarm.control.layer import Senses
from mesa_swarm.control.team import Key, Team, robots_of
from mesa_swarm.errors import (
    BehaviourError,
    InvalidValueError,
    StepWarning,
    asked,
    check_choice,
    check_count,
    check_number,
    shortened,
)
from mesa_swarm.imperfect_model import ImperfectModel
from mesa_swarm.mesa_model import Collector, add_reporters, rows_in
from mesa_swarm.moved import moved_name
from mesa_swarm.observers import Observers
from mesa_swarm.parameters import Dial, Noise, Slip
from mesa_swarm.physics.contact import Contacts
from mesa_swarm.physics.engine import CompiledEngine, Engine, begin_way
from mesa_swarm.physics.own_parts import OwnParts, clear_actions
from mesa_swarm.physics.radio import Channel, send_goals
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.physics.threads import checked_threads
from mesa_swarm.progress import progress_bar
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.drive import clear_unused, limit_command, speeds_in_words
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.snapshots import DECISIONS, Snapshots, check_watched
from mesa_swarm.state import attributes_of
from mesa_swarm.state_hash import (
    described_bodies,
    described_designs,
    described_movers,
    described_process,
    state_hash_of,
)
from mesa_swarm.streams import Seed
from mesa_swarm.trigger import Trigger
from mesa_swarm.world.map import Map
from mesa_swarm.world.statics import SOURCE

ENGINES: dict[str, type[Engine]] = {"compiled": CompiledEngine, "shapely": ShapelyEngine}
REPORTERS = {name: name for name in ("collisions", "total_collisions")}
# What is known of the present step, or of the last one.
OF_STEP = ("_begun", "_omitted", "_rows_begun", "_row_due", "_row_added", "_mixed")


class EngineModel(ImperfectModel):
    """A world of robots, bodies and processes, advanced step by step; `SwarmModel` adds recordings."""

    _control: Arbiter | None = None
    _completed: int = 0
    _begun: int = 0  # the steps that were completed when the present one began
    _omitted: bool = False  # whether a warning was given of a step without the model's own
    _rows_begun: tuple[int, ...] | None = None  # during a step with a data collector of the user's own
    _row_due: bool = False
    _row_added: bool | None = None  # whether the model added the row of the step before, rather than its class
    _mixed: bool = False  # whether a warning was given that both do
    _snapshots: Snapshots | None = None
    _stored_apart: ClassVar[tuple[str, ...]] = (
        *("_engine", "_own_parts", "_channel", "_control", "_senses", "_senses_version", "_sensed"),
        *("_noise", "_snapshots", "observers", "datacollector", "_collect_every", *OF_STEP),
    )
    _fleeting: ClassVar[tuple[str, ...]] = (
        *("observers", "_senses", "_senses_version", "_sensed", "_noise", "_snapshots", "datacollector", *OF_STEP),
    )
    _numbers: ClassVar[dict[str, tuple[type, ...]]] = {
        "running": (bool, np.bool_),
        **dict.fromkeys(("collisions", "total_collisions", "_completed"), (int,)),
        "_turn_angle": (float, int, np.float64),
    }

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
        self._turn_angle = np.radians(check_number("turn_angle_degrees", turn_angle_degrees, minimum=0, maximum=90))
        self._engine: Engine = ENGINES[check_choice("engine", engine, ENGINES)]()
        self.threads = checked_threads(threads)
        super().__init__(map=map, rng=rng, noise=noise, slip=slip, imperfections=imperfections, scale=scale)
        self.observers = ()
        self.communication = communication
        self.collect_every = collect_every
        self._own_parts = OwnParts()
        self.collisions = 0
        self.total_collisions = 0
        self._senses: Senses | None = None
        self._senses_version = -1
        self._sensed: tuple | None = None
        self._noise: tuple | None = None
        for name, given in (("model_reporters", model_reporters), ("agent_reporters", agent_reporters)):
            if given is not None and not isinstance(given, Mapping):
                raise InvalidValueError(f"{name} is {shortened(given)}; expected a dict of reporters by name")
        self.datacollector = Collector({**REPORTERS, **(model_reporters or {})}, agent_reporters)

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

        The state has the same bits for any number. Worlds of fewer than some ten thousand robots are not shared: they
        would not be faster. See `mesa_swarm.physics.threads`.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1, threads=2).threads
        2
        """
        return self._engine.threads

    @threads.setter
    def threads(self, threads: int) -> None:
        self._engine.threads = checked_threads(threads)

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
        return None if self._channel is None else self._channel.radio

    @communication.setter
    def communication(self, radio: Radio | None) -> None:
        if radio is not None and not isinstance(radio, Radio):
            raise InvalidValueError(f"communication is {shortened(radio)}; expected Radio(...) or None")
        for beacon in () if radio is None else radio.beacons:
            self._checked_point(beacon)
        self._channel = None if radio is None else Channel(radio)
        self.swarm.set_messages({} if radio is None else radio.columns())
        self.swarm.clear_messages()

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
        return self._control

    @control.setter
    def control(self, control: Arbiter | Mapping[Key, Arbiter | None] | None) -> None:
        if isinstance(control, Mapping) and not isinstance(control, Team):
            control = Team(control)
        if control is not None and (isinstance(control, type) or asked(control, "bound") is None):
            raise InvalidValueError(
                f"control is {shortened(control)}; expected an arbiter such as Subsumption(Avoid(), Explore())"
            )
        if isinstance(control, Arbiter):
            control.check_robots(robots_of(self.swarm))
        before = self._control
        if isinstance(before, Arbiter):
            before.unbind()
        try:
            self._drive_by(control)
        except Exception:
            self._drive_by(before)
            raise

    def _drive_by(self, control: Arbiter | None) -> None:
        self.swarm.forget()
        self.swarm.columns["command"].fill(0.0)
        self.swarm.columns["layer"].fill(-1)
        self.swarm.clear_messages()
        if self._snapshots is not None:
            self._snapshots.forget()  # layer indices changed
        self._control = None if control is None else control.bound(self.swarm, self.streams)
        self._note_memory()

    def _note_memory(self) -> None:
        """Let snapshots store what explains the decisions of the control."""
        if self._snapshots is not None:
            self._snapshots.noted = getattr(self._control, "noted", ())

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
        if self._movers is not None:
            self._follow_agents(self._movers)
        self.sense()
        if self._channel is not None:
            self._exchange(self._channel)
        if self._control is not None:
            self._decide(self._control)
        if self.swarm.table.actions:
            self._own_parts.act(self, self._current_scene())
        self._move()
        if self._fields is not None:
            self._advance_fields(self._fields)
        if self._snapshots is not None:
            self._snapshots.note()
        if self._processes:
            self._process()
        self._completed += 1
        self._collect()

    def sense(self) -> None:
        """Read all sensors for the current poses; reading twice gives the same."""
        scene = self._current_scene()
        state = (self._completed, self.swarm.version, scene)
        if self._sensed != state or self.swarm.disturbed:
            self._engine.sense(self.swarm, scene, self._completed, self._noise_draws())
            if self._imperfect is not None:
                self._imperfect.spoil_readings(self.swarm, self._completed)
            self._sensed = state
        if self.swarm.table.readings:
            # Always: what they read, such as a user's own agents, may have changed since the last reading.
            self._own_parts.sense(self, scene)
            if self._imperfect is not None:
                self._imperfect.spoil_custom(self.swarm, self._completed)

    def run(self, steps: int, progress: bool = False) -> Self:
        """Take this many steps, fewer if the model stops running, and return the model.

        Parameters
        ----------
        steps : int
        progress : bool
            Whether to show a bar with the time left and the time of day at which the run ends.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).run(3).steps
        3
        """
        with progress_bar(check_count("steps", steps), "steps", progress) as bar, self._observed_run():
            for _ in range(bar.total):
                if not self.running:
                    break
                self.step()
                bar.update()
        return self

    def _exchange(self, channel: Channel) -> None:
        loses = channel.radio.loss_probability > 0
        word = self.streams["communication"].integers(2**64, dtype=np.uint64) if loses else np.uint64(0)
        channel.exchange(self.swarm, self._current_scene(), word)

    def _decide(self, control: Arbiter) -> None:
        columns = self.swarm.columns
        command, layer = columns["command"], columns["layer"]
        columns["task"].fill(-1)
        columns["goal"].fill(np.nan)
        if self.swarm.table.actions:
            clear_actions(self.swarm)
        if self._channel is not None:
            self._channel.begin_decision(self.swarm)
        if self._senses is None or self._senses_version != self.swarm.version:
            self._senses = Senses.of(self.swarm)
            self._senses_version = self.swarm.version
        columns["last_command"][:] = command
        control.decide(self._senses, command, layer)
        if self.swarm.table.mixed:
            clear_unused(command, columns["design"], self.swarm.table.numbers)
        wrong = limit_command(command, columns["max_speed"], columns["design"], self.swarm.table.sideways)
        if wrong >= 0:
            name = driver(control, int(layer[wrong]))
            raise BehaviourError(
                f"{name} commanded NaN to robot {self.swarm.agents[wrong].unique_id} in step {self.steps}; "
                f"expected {speeds_in_words(self.swarm.agents[wrong].design.numbers)}"
            )
        if self._channel is not None:
            send_goals(columns["position"], columns["heading"], columns["goal"], columns["sent_goal"])

    def _move(self) -> None:
        for load in self._loads:
            load.rest()
        if self._movers is None:
            self._move_robots()
            return
        moving = self._current_scene().moving
        if moving is not None:
            moving.begin()
        if moving is not None and not len(self.swarm):
            begin_way(self._current_scene())
            moving.go_freely()
        self._move_robots()
        self._movers.rest()
        if self._movers.carried.any():
            self._movers.carry_along()

    def _move_robots(self) -> None:
        if not len(self.swarm):
            return
        scene, table = self._current_scene(), self.swarm.table
        if self.swarm.disturbed:
            self._engine.settle(self.swarm, scene)
            self.swarm.disturbed = False
        draws = self.streams["slip"].random((len(self.swarm), table.wheels)) if table.slips else None
        driven = self.swarm.columns["command"]
        if self._imperfect is not None:
            driven = self._imperfect.driven_wheels(self.swarm, self._completed)
        self._engine.move(self.swarm, scene, driven, self._turn_angle, draws)

    def _collect(self) -> None:
        self.collisions = int(np.count_nonzero(self.swarm.columns["collided"]))
        self.total_collisions += self.collisions
        if self._snapshots is not None and self._snapshots.trigger.is_due(self._completed):
            self._snapshots.append(self._completed)
        if self._collect_every.is_due(self._completed):
            collector = self.__dict__["datacollector"]
            if self._rows_begun is None:
                collector.collect(self)
            else:
                self._row_due = True
        for observer in self.__dict__["observers"].complete:  # without the cost of the property
            observer.after_step(self, self._completed)

    def _check_driven(self, design: RobotDesign, group: str) -> None:
        """Refuse robots that the control is not for."""
        if isinstance(self._control, Arbiter):
            self._control.check_robots([(design, group)])

    @property
    def completed(self) -> int:
        """How many steps were completed."""
        return self._completed

    def _begin_step(self) -> None:
        self._begun = self._completed
        collector = self.__dict__["datacollector"]
        if type(collector) is not Collector:
            self._rows_begun, self._row_due = rows_in(collector), False
        if self._movers is not None:
            self._movers.begin_step()

    def _end_step(self) -> None:
        if self._rows_begun is not None:
            self._collect_once(self._rows_begun)
        if self._completed == self._begun and not self._omitted:
            self._omitted = True
            name = type(self).__name__
            warnings.warn(
                f"{name}.step took no step of the model, so that nothing in it has moved; call super().step() in "
                "it, once",
                StepWarning,
                stacklevel=3,
            )

    def _collect_once(self, rows_begun: tuple[int, ...]) -> None:
        """Collect by a collector of the user's own, unless the step of the model's class has."""
        collector, due = self.__dict__["datacollector"], self._row_due
        self._rows_begun, self._row_due = None, False
        if not due:
            return
        is_added = rows_in(collector) == rows_begun
        if is_added:
            collector.collect(self)
        if self._row_added is not None and self._row_added != is_added and not self._mixed:
            self._mixed = True
            warnings.warn(
                f"{type(self).__name__} collects after some steps only, and the model after the others, so that each "
                "has a row; collect_every=0 leaves collecting to the class",
                StepWarning,
                stacklevel=4,
            )
        self._row_added = is_added

    @property
    def contacts(self) -> "Contacts":
        """The deepest contact of every robot that collided in the last step."""
        return Contacts.of(self.swarm, self._obstacles, {SOURCE: self._heat_bodies()})

    def watch(
        self, last: int | None = 100, *, every: int | Trigger = 1, columns: tuple[str, ...] = DECISIONS
    ) -> Snapshots:
        """Store what robots know and do in the next steps, and return the store.

        Watching again begins with an empty store; `last=None` stores every step, and memory grows without end.

        Parameters
        ----------
        last : int or None
            How many snapshots to store; the oldest are dropped.
        every : int
            Steps from one to the next.
        columns : tuple of str
            Of the swarm, those that `explain` needs by default.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> snapshots = model.watch(last=50)
        >>> len(model.run(60).watched)
        50
        """
        self._snapshots = Snapshots(self.swarm, last=last, every=every, columns=columns)
        self._note_memory()
        return self._snapshots

    @property
    def watched(self) -> Snapshots | None:
        """What `watch` stores, None without it."""
        return self._snapshots

    def explain(self, robot: Robot, step: int | None = None) -> Explanation:
        """Return why a robot did what it did in the last step, or in another stored one; call `watch` first.

        Parameters
        ----------
        robot : Robot
            One of `model.robots`.
        step : int, optional

        Returns
        -------
        Explanation
            As a text one sentence: what the robot did, the layer that won, the readings that triggered it.

        Raises
        ------
        InvalidValueError
            If `watch` was not called, columns are missing, control is None, or the step is not stored.
        RemovedRobotError
            If the robot was removed.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> from mesa_swarm.control import Avoid, Explore, Subsumption
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(AGENT9, poses=[(765, 300, 0.0)], tendency="left")
        >>> model.control = Subsumption(Avoid(distance=10.5), Explore())
        >>> snapshots = model.watch()
        >>> print(model.run(1).explain(robot))
        step 1: robot 5 turns left while moving; Avoid: front sensor 10.0 (an obstacle) < 10.5
        """
        if not isinstance(robot, Robot) or robot.model is not self:
            raise InvalidValueError(f"robot is {shortened(robot)}; expected one of this model's robots")
        row, snapshots = robot.alive(), check_watched(self._snapshots, DECISIONS, "explain")
        if self._control is None:
            raise InvalidValueError("control is None, which explains nothing; set model.control")
        wanted = int(snapshots.steps[-1]) if step is None else check_count("step", step)
        return explanation(self._control, self.swarm, snapshots, row, wanted, self._kinds)

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

    def _hashed_parameters(self) -> Iterator[tuple[str, Any]]:
        """Iterate over what steps read besides what they write, by name."""
        yield "map", self.map.bounds
        yield "bodies", described_bodies(self._obstacles)
        if self._movers is not None and self._movers.agents:
            yield "driven bodies", described_movers(self._movers)
        yield "fields", [field.declared for field in self.fields.values()]
        yield "designs", described_designs(self.swarm.designs, self.swarm.columns["design"])
        yield "turn angle", self._turn_angle
        yield "radio", self.communication
        if self._imperfect is not None:
            yield "imperfections", [self._imperfect.imperfections, self._imperfect.key]
        yield "processes", [described_process(process) for process in self.processes]
        if self._control is not None:
            yield "control", self._control

    def _declared_state(self) -> Iterator[tuple[str, Any]]:
        yield from super()._declared_state()
        for place, layer in enumerate(getattr(self._control, "layers", ())):
            own = {} if type(layer).__module__.startswith("mesa_swarm.") else attributes_of(layer)
            arrays = {name: value for name, value in own.items() if isinstance(value, np.ndarray)}
            if arrays:
                yield f"layer {place}", arrays

    def _hashed_columns(self) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
        """Iterate over the tables of columns that are part of the state, each with a prefix for their names."""
        yield "robots", self.swarm.columns

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

    def _noise_draws(self) -> np.ndarray | None:
        """Return this step's draws for the sensors' errors, the same for every reading of the step."""
        if not self.swarm.table.noisy:
            return None
        shape, stream = self.swarm.distance.shape, self.streams["noise"]
        if self._noise is None or self._noise[0] != self._completed:
            self._noise = (self._completed, stream.bit_generator.state, None)
        step, before, draws = self._noise
        if draws is None or draws.shape != shape:
            # Robots were added or removed since the last reading: draw as if that had not taken place.
            stream.bit_generator.state = before
            draws = stream.random(shape)
            self._noise = (step, before, draws)
        return draws


if not TYPE_CHECKING:  # with this, a type checker would take any name for one of this module

    def __getattr__(name: str) -> object:
        """Return a name that was in this module before, from where it is now."""
        return moved_name(__name__, name)
