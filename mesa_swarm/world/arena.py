"""The arena: Mesa's experimental ContinuousSpace, made safe, and fed from the swarm's columns."""

import gc
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from random import Random
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NoReturn, Protocol, TypeVar, overload
from weakref import ref

import numpy as np
from mesa import Model
from mesa.agent import Agent, AgentSet
from mesa.experimental.continuous_space import ContinuousSpace, ContinuousSpaceAgent

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.world.read_only import read_only
from mesa_swarm.world.shapes import as_numbers

# Mesa grows its store by a fifth, which is 0 below three rows.
SMALLEST_STORE = 16
Kind = TypeVar("Kind", bound="ArenaAgent")
Point = Sequence[float] | np.ndarray
Neighbours = tuple[list[ContinuousSpaceAgent], np.ndarray]
ONE_AT_A_TIME = "positions are written one agent at a time; set agent.position"


class _Counter:
    """The unique_ids of a model's agents, counted in an attribute of the model, as Mesa does from 3.5 on."""

    def __init__(self, model: Model) -> None:
        self._model = model

    def __iter__(self) -> Iterator[int]:
        return self

    def __next__(self) -> int:
        """Return the unique_id of the next agent, and count it."""
        unique_id = get_next_id(self._model)
        set_next_id(self._model, unique_id + 1)
        return unique_id


class ModelCounters:
    """The counters of all models, in the place of the table in which Mesa 3.3 looks them up.

    Each model has its own count, so that a copy or an unpickled model goes on counting where the original was.
    """

    def __getitem__(self, model: Model) -> _Counter:
        return _Counter(model)


def get_next_id(model: Model) -> int:
    """Return the unique_id of the next agent of a model: 1 for the first one."""
    if "agent_id_counter" not in model.__dict__:  # a new model; or one that an older version has pickled
        present = (agent.unique_id for agent in getattr(model, "_agents", ()))
        set_next_id(model, max(present, default=0) + 1)
    return model.agent_id_counter


def set_next_id(model: Model, unique_id: int) -> None:
    """Set the unique_id of the next agent of a model."""
    model.agent_id_counter = unique_id


# Mesa 3.3 counts agents in a plain dict on the class, which holds every model in memory for good, and in which a
# copied model has no entry. From Mesa 3.5 on the model counts, and there is no such dict.
if hasattr(Agent, "_ids"):
    for _model, _counter in Agent._ids.items():
        set_next_id(_model, int(repr(_counter).removeprefix("count(").removesuffix(")")))
    Agent._ids = ModelCounters()


class Positioned(Protocol):
    """Agents whose positions are a column of their own: a swarm, or fires."""

    agents: list[Any]
    position: np.ndarray


class PositionTable(np.ndarray):
    """Positions as they are now, one row an agent; writing a row moves the agent, within bounds only.

    A row that is read is a copy, so that ``agent.position += step`` is checked before anything is written.
    """

    arena: "Arena | None" = None

    def __getitem__(self, key: Any) -> Any:
        """Return a copy of the selected rows, which cannot be written to."""
        return read_only(np.array(super().__getitem__(key)))

    def __setitem__(self, key: Any, value: Any) -> None:
        """Move one agent."""
        if self.arena is None or not isinstance(key, (int, np.integer)):
            raise InvalidValueError(ONE_AT_A_TIME)
        agent = self.arena.active_agents[key]
        kind: Any = type(agent)
        if isinstance(agent, ArenaAgent) and kind.position is not ContinuousSpaceAgent.position:
            agent.position = value
        else:
            self.arena.place(agent, value)


class Arena(ContinuousSpace):
    """A bounded plane in which robots, obstacles, fires and any other Mesa agents have positions.

    Everything that Mesa's class offers works, without its defects: it may be created for no agents, a position
    out of bounds is refused before anything is written, and positions that are read are never a stale view.
    Robots and fires have their positions in their own columns, which are read on demand. The worlds of
    `SwarmModel` do not wrap around.
    """

    _n_agents: int
    _agent_positions: np.ndarray

    def __init__(
        self, dimensions: Sequence[Point], torus: bool = False, random: Random | None = None, n_agents: int = 100
    ) -> None:
        super().__init__(dimensions, torus=torus, random=random, n_agents=max(n_agents, SMALLEST_STORE))
        self._bodies: list[Positioned] = []
        self._rows: list[list[int]] | None = None

    def attach(self, bodies: Positioned) -> None:
        """Take the positions of these agents from their own column from now on."""
        self._bodies.append(bodies)

    @property
    def agent_positions(self) -> np.ndarray:
        """Positions of all agents, shape (n, d), in the order of `active_agents`."""
        self._refresh()
        table = np.array(self._agent_positions[: self._n_agents]).view(PositionTable)
        table.arena = self
        return table

    @agent_positions.setter
    def agent_positions(self, value: np.ndarray) -> None:
        """Ignore the view that Mesa makes after each change: this table is made when it is read."""
        if value.base is not self._agent_positions:
            raise InvalidValueError(ONE_AT_A_TIME)

    def place(self, agent: ContinuousSpaceAgent, position: Point) -> None:
        """Write the position of an agent that is stored in the arena itself, if it is within bounds."""
        self._agent_positions[self._agent_to_index[agent]] = self.checked_point(position)

    def checked_point(self, position: Point) -> np.ndarray:
        """Return a position as an array of floats, or raise InvalidValueError if it is not within this arena."""
        point = as_numbers(position)
        if point.shape != (self.ndims,) or not self.in_bounds(point):
            expected = f"x and y within {self.dimensions.tolist()}"
            raise InvalidValueError(f"position {shortened(position)} is outside the arena; expected {expected}")
        return point

    def calculate_difference_vector(self, point: Point, agents: Iterable[Agent] | None = None) -> np.ndarray:
        """Return the vectors from `point` to the agents (all of them by default)."""
        self._refresh()
        return np.asarray(super().calculate_difference_vector(point, agents))

    def calculate_distances(
        self, point: Point, agents: Iterable[Agent] | None = None, **kwargs: Any
    ) -> tuple[np.ndarray, list[Agent]]:
        """Return the distances from `point` to the agents (all by default), and the agents."""
        self._refresh()
        distances, nearby_agents = super().calculate_distances(point, agents, **kwargs)
        return np.asarray(distances), nearby_agents

    def get_k_nearest_agents(self, point: Point, k: int = 1) -> Neighbours:
        """Return the k agents nearest to `point`, all of them if there are fewer, and their distances."""
        distances, agents = self.calculate_distances(point)
        nearest = np.argsort(distances, kind="stable")[: _check_k(k)]
        return [agents[i] for i in nearest], distances[nearest]

    @property
    def _agent_to_index(self) -> "Indices":
        """The index of every agent, which the agents have themselves: Mesa's table would take 40 bytes of each."""
        return Indices(self)

    @_agent_to_index.setter
    def _agent_to_index(self, value: dict) -> None:
        """Ignore the empty table of Mesa's constructor."""

    @property
    def _index_to_agent(self) -> dict[int, Agent]:
        return dict(enumerate(self.active_agents))

    @_index_to_agent.setter
    def _index_to_agent(self, value: dict) -> None:
        """Ignore the empty table of Mesa's constructor."""

    def _add_agent(self, agent: Agent) -> int:
        index = self._n_agents
        self.add_together([agent])
        agent._mesa_index = index
        return index

    def add_together(self, agents: Sequence[Agent]) -> None:
        """Append agents, which are given their indices by the caller."""
        self._rows = None
        begin, self._n_agents = self._n_agents, self._n_agents + len(agents)
        if self._n_agents > len(self._agent_positions):
            more = self._n_agents // 5 if len(agents) == 1 else 0  # others are to come, one by one
            grown = np.empty((self._n_agents + more, self.ndims))
            grown[:begin] = self._agent_positions[:begin]
            self._agent_positions = grown
        self._agent_positions[begin : self._n_agents] = self.center
        self.active_agents += agents

    def _remove_agent(self, agent: Agent) -> None:
        self.remove_together([agent])

    def remove_together(self, agents: Iterable[Agent]) -> None:
        """Take agents out of the arena, which costs as much as to take out one; those behind them move up."""
        rows = sorted(self._agent_to_index[agent] for agent in agents)
        self._rows = None
        first = rows[0] if rows else self._n_agents
        others = np.delete(np.arange(first, self._n_agents), np.array(rows, int) - first)
        staying = [self.active_agents[index] for index in others.tolist()]
        self._n_agents = first + len(staying)
        self._agent_positions[first : self._n_agents] = self._agent_positions[others]
        self.active_agents[first:] = staying
        for index, agent in enumerate(staying, first):
            agent._mesa_index = index

    def _refresh(self) -> None:
        """Copy the positions in columns elsewhere into the store that Mesa's methods read."""
        if self._rows is None:
            self._rows = [[agent._mesa_index for agent in bodies.agents] for bodies in self._bodies]
        for rows, bodies in zip(self._rows, self._bodies, strict=True):
            if rows:
                self._agent_positions[rows] = bodies.position


class Indices(Mapping):
    """The index of each agent of an arena, by the agent."""

    def __init__(self, arena: Arena) -> None:
        self._arena = arena

    def __getitem__(self, agent: Agent) -> int:
        index = getattr(agent, "_mesa_index", None)
        if index is None or agent.space is not self._arena:
            raise KeyError(agent)
        return index

    def __iter__(self) -> Iterator[Agent]:
        return iter(self._arena.active_agents)

    def __len__(self) -> int:
        return len(self._arena.active_agents)


class Agents(AgentSet, Generic[Kind]):
    """Agents in order: Mesa's AgentSet, which may also be indexed, as it will not be from Mesa 4 on.

    Mesa's set alone does not hold its agents: that of a model to which nothing else refers would become empty.
    """

    def __init__(self, agents: Iterable[Kind], random: Random | None = None) -> None:
        super().__init__(agents, random)
        self._model = getattr(next(iter(agents), None), "model", None)

    @classmethod
    def of_list(cls, agents: list[Kind], random: Random) -> "Agents[Kind]":
        """Return the agents of a list, of which a set is made when it is needed: not for their number or one of them.

        Before an agent is removed, call `settle`; the list may not change before.
        """
        agent_set = cls((), random)
        del agent_set._agents
        agent_set._list, agent_set._model = agents, agents[0].model if agents else None
        return agent_set

    def settle(self) -> None:
        """Make the set, if it has not been made."""
        if "_agents" not in self.__dict__:
            self._update(self._list)
            del self._list

    def __getattr__(self, name: str) -> Any:
        if name != "_agents" or "_list" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        self.settle()
        return self._agents

    def __len__(self) -> int:
        """How many agents there are."""
        return len(self.__dict__.get("_list", self.__dict__.get("_agents", ())))

    if TYPE_CHECKING:  # Mesa has no types

        def __iter__(self) -> Iterator[Kind]: ...

    @overload
    def __getitem__(self, item: int) -> Kind: ...

    @overload
    def __getitem__(self, item: slice) -> list[Kind]: ...

    def __getitem__(self, item: int | slice) -> Kind | list[Kind]:
        """Return one agent, or a list of them for a slice."""
        items = self.__dict__.get("_list")
        return (list(self) if items is None else items)[item]


class _Held(dict):
    """Agents as keys: a dict with what Mesa's set asks of its weak ones."""

    def keyrefs(self) -> list[ref]:
        """Return weak references to the agents: one that is removed while Mesa goes through them may vanish."""
        return list(map(ref, self))


class Registered(AgentSet):
    """The agents of a model: Mesa's set, but it holds them itself, as from Mesa 3.5 on, with a third of the memory.

    Sets that are derived from it are Mesa's own.
    """

    def __init__(self, agents: Iterable[Agent], random: Random | None = None) -> None:
        members = list(agents)
        super().__init__(members if random is None else (), random)
        self._update(members)

    def __iter__(self) -> Iterator[Agent]:
        return iter(self._agents)

    def __copy__(self) -> AgentSet:
        return AgentSet(self, self.random)

    @classmethod
    def _from_iterable(cls, agents: Iterable[Agent]) -> AgentSet:
        return AgentSet(agents)

    def shuffle(self, inplace: bool = False) -> AgentSet:
        """Return the agents in random order, or put these here in random order."""
        shuffled = super().shuffle()
        return self._update(shuffled) if inplace else shuffled

    def _update(self, agents: Iterable[Agent]) -> "Registered":
        self._agents = _Held.fromkeys(agents)
        return self


def hold_agents(model: Model) -> None:
    """Let the set of all agents of a new model hold them itself; that of Mesa 3.5 does so already."""
    if type(model._all_agents) is AgentSet:
        model._all_agents = Registered((), random=model.random)


def registers_together(model: Model) -> bool:
    """Return whether `register_together` may take the place of the model's own way to register agents."""
    return type(model).register_agent is Model.register_agent and isinstance(model._all_agents, Registered)


def register_together(model: Model, space: Arena, agents: Sequence["ArenaAgent"], rows: range) -> None:
    """Give new agents of one class all that Mesa's constructors would give them one after the other, and their rows.

    The model is one that `registers_together`.
    """
    first, unique_id = space._n_agents, get_next_id(model)
    set_next_id(model, unique_id + len(agents))
    numbers = _numbers((unique_id, first, rows.start), len(agents))
    for agent, own_id, index, row in zip(agents, *numbers, strict=True):
        agent.model, agent.space = model, space
        agent.unique_id, agent._mesa_index, agent.row = own_id, index, row  # type: ignore[attr-defined]
    space.add_together(agents)
    alike = model._agents_by_type.setdefault(type(agents[0]), Registered((), random=model.random))
    members = dict.fromkeys(agents)
    for registered in (model._agents, model._all_agents._agents, alike._agents):
        registered.update(members)


def _numbers(begins: Sequence[int], count: int) -> list[list[int]]:
    """Return consecutive numbers from each of these on; where they overlap, they are the same objects."""
    low, high = min(begins), max(begins)
    if high - low > count:
        return [list(range(begin, begin + count)) for begin in begins]
    numbers = list(range(low, high + count))
    return [numbers[begin - low : begin - low + count] for begin in begins]


@contextmanager
def pause_collection() -> Iterator[None]:
    """Let no garbage be collected while very many objects are made that stay: all would be visited, repeatedly."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class ArenaAgent(ContinuousSpaceAgent):
    """A Mesa agent of the arena whose `pos` is its `position`, as Mesa's drawing code expects.

    What a class of handles has itself it annotates: recordings store all else that an agent was given.
    """

    _made_by: ClassVar[str] = "model.add_body(...)"

    @property
    def pos(self) -> np.ndarray:
        """The position."""
        return self.position

    @pos.setter
    def pos(self, value: np.ndarray | None) -> None:
        # Mesa's Agent sets None when it is created, before there is anything to move.
        if value is not None:
            self.position = value

    def __copy__(self) -> "ArenaAgent":
        """Return the agent itself: a second handle would not be updated when its row moves."""
        return self

    def remove(self) -> None:
        """Take the agent out of its space and out of the model."""
        leave_together([self])
        Agent.remove(self)

    @classmethod
    def create_agents(cls, model: Model, n: int, *arguments: Any, **keywords: Any) -> NoReturn:
        """Refuse to make agents that are rows of their model's arrays.

        Raises
        ------
        InvalidValueError
            Always; it names the method of the model that makes such agents.
        """
        cls._refuse(".create_agents")

    @classmethod
    def from_dataframe(cls, model: Model, df: Any, **keywords: Any) -> NoReturn:
        """Refuse to make agents that are rows of their model's arrays, see `create_agents`."""
        cls._refuse(".from_dataframe")

    @classmethod
    def _refuse(cls, method: str) -> NoReturn:
        raise InvalidValueError(
            f"{cls.__name__}{method} is not available: a model makes its robots and bodies itself; use {cls._made_by}"
        )

    def get_neighbors_in_radius(self, radius: float = 1) -> Neighbours:
        """Return the other agents whose positions are within `radius`, and their distances."""
        # All of them are within an infinite radius.
        limit = radius if isinstance(radius, float) and radius == math.inf else check_number("radius", radius)
        distances, agents = self._distances_to_others()
        near = np.flatnonzero(distances <= limit)
        return [agents[i] for i in near], distances[near]

    def get_nearest_neighbors(self, k: int = 1) -> Neighbours:
        """Return the k nearest other agents, all if there are fewer, and their distances."""
        number = _check_k(k)
        distances, agents = self._distances_to_others()
        nearest = np.argsort(distances, kind="stable")[:number]
        return [agents[i] for i in nearest], distances[nearest]

    def _distances_to_others(self) -> tuple[np.ndarray, list[Agent]]:
        position = self.position  # first: a removed agent raises here
        distances, agents = self.space.calculate_distances(position)
        index = self.space._agent_to_index[self]
        return np.delete(distances, index), [agent for agent in agents if agent is not self]


def leave_together(agents: Sequence[ArenaAgent]) -> None:
    """Take agents out of their space at once, before each is taken out of the model.

    By this `MesaModel.deregister_agent` knows agents that are being removed from those that are to be.
    """
    agents[0].space.remove_together(agents)
    for agent in agents:
        agent.space = agent._mesa_index = None


def _check_k(k: object) -> int:
    return max(check_count("k", k, minimum=-(2**31)), 0)
