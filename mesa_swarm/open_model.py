"""OpenModel: what users add to a world: processes, declared state, events."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

from mesa_swarm.errors import InvalidValueError, asked, shortened
from mesa_swarm.events import WITHOUT_ROBOT, EventLog
from mesa_swarm.robots.robot import Robot
from mesa_swarm.state import State, state_of
from mesa_swarm.world_model import World


@runtime_checkable
class Process(Protocol):
    """What happens in each step besides robots: growth, weather, a plan of moving doors; see `SwarmModel.add_process`.

    Any object with `step` serves; `fire.Burning` is one. Its attributes are part of the model's state: plain values,
    arrays and random generators are hashed, stored and resumed. A class with other attributes has two more methods,
    `checkpoint`, which returns all on which a later step depends, as plain values and arrays by name, and `restore`,
    which takes it back. A class may have a method ``check_model(model)``, which raises an error if a model lacks what
    the process needs; it is called before the process is added.

    `resume` makes a process that no constructor adds without the constructor of its class, which has to be in the
    module of the model's class, to derive from `Process` or declare ``resumable = True``, and to declare its attributes
    by annotations or values in the class.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> class Tide(Process):
    ...     level: float = 0.0
    ...
    ...     def step(self, model):
    ...         self.level += 0.5
    >>> model = SwarmModel(rng=1)
    >>> tide = model.add_process(Tide())
    >>> model.run(3).processes[0].level
    1.5
    """

    def step(self, model: Any) -> None:
        """Advance by one step; called after contacts are resolved, in the order in which processes were added."""
        return


class OpenModel(World):
    """A world with processes, declared state and events; `EngineModel` adds the step."""

    _stored_apart: ClassVar[tuple[str, ...]] = ("_state", "_processes", "_events")

    def __init__(self, **named: Any) -> None:
        self._state = State()
        self._events = EventLog()
        self._processes: dict[int, Process] = {}  # by the number under which they are stored
        super().__init__(**named)

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
        return self._state

    @state.setter
    def state(self, values: Mapping[str, Any]) -> None:
        self._state = State(values)

    @property
    def processes(self) -> tuple[Process, ...]:
        """What happens in each step besides robots, in the order in which it was added."""
        return tuple(self._processes.values())

    def add_process(self, process: Process) -> Process:
        """Add what happens in each step besides robots, after contacts are resolved, and return it.

        Parameters
        ----------
        process : Process
            Any object with ``step(model)``. Its attributes are part of the model's state.

        Raises
        ------
        InvalidValueError
            If it has no `step`, was added before, or refuses this model.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> class Rain:
        ...     amount = 0
        ...
        ...     def step(self, model):
        ...         self.amount += 2
        >>> model = SwarmModel(rng=1)
        >>> rain = model.add_process(Rain())
        >>> model.run(3).processes[0].amount
        6
        """
        if isinstance(process, type) or not callable(asked(process, "step")):
            raise InvalidValueError(
                f"process is {shortened(process)}; expected an object with step(model), see Process"
            )
        if any(process is one for one in self._processes.values()):
            raise InvalidValueError(f"process {shortened(process)} was added before; expected another one")
        check = asked(process, "check_model")
        if callable(check):
            check(self)
        self._processes[max(self._processes, default=0) + 1] = process
        return process

    def remove_process(self, process: Process) -> None:
        """Remove a process; what it has changed stays.

        Raises
        ------
        InvalidValueError
            If it is not one of `processes`.
        """
        others = {number: one for number, one in self._processes.items() if one is not process}
        if len(others) == len(self._processes):
            raise InvalidValueError(f"process is {shortened(process)}; expected one of model.processes")
        self._processes = others

    @property
    def events(self) -> EventLog:
        """What happened, as arrays: `step`, `name`, `unique_id` and `value`; see `event`."""
        return self._events

    def event(self, name: str, *, robot: Robot | None = None, value: float = 1.0) -> None:
        """Note that something happened in this step: it is counted, hashed, stored, recorded, and shown in replays.

        Parameters
        ----------
        name : str
            One line of text, the same for events of one kind.
        robot : Robot, optional
            To which, or by which, it happened.
        value : float
            How much, any finite number.

        Raises
        ------
        InvalidValueError
            If a value is not permitted, or the robot is of another model.
        RemovedRobotError
            If the robot was removed.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(AGENT9, 1)
        >>> model.event("delivered", robot=robot, value=2.0)
        >>> model.event("delivered")
        >>> len(model.events), model.events.value, model.events.count("delivered")
        (2, array([2., 1.]), 2)
        """
        unique_id = WITHOUT_ROBOT
        if robot is not None:
            if not isinstance(robot, Robot) or robot.model is not self:
                raise InvalidValueError(f"robot is {shortened(robot)}; expected one of this model's robots, or None")
            robot.alive()
            unique_id = robot.unique_id
        self._events.append(self.steps, name, unique_id, value)

    def _process(self) -> None:
        """Advance what changes in each step besides robots."""
        for process in tuple(self._processes.values()):
            process.step(self)

    def _declared_state(self) -> Iterator[tuple[str, Any]]:
        """Iterate over what the model and its processes declare, by name."""
        if self._state:
            yield "state", self._state
        if self._events:
            yield "events", self._events.arrays()
        yield from self._stated_processes()

    def _stated_processes(self) -> Iterator[tuple[str, Any]]:
        """Iterate over the state of processes, by name."""
        for number, process in self._processes.items():
            if state := state_of(process):
                yield f"process {number} ({type(process).__name__})", state
