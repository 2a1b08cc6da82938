"""The arena: Mesa's experimental ContinuousSpace, made safe, and fed from the swarm's columns."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from random import Random
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar, overload
from weakref import WeakKeyDictionary

import numpy as np
from mesa import Model
from mesa.agent import Agent, AgentSet
from mesa.experimental.continuous_space import ContinuousSpace, ContinuousSpaceAgent

from mesa_swarm.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.world.shapes import as_numbers

# Mesa grows its store by a fifth, which is 0 below three rows.
SMALLEST_STORE = 16
Kind = TypeVar("Kind", bound="ArenaAgent")
Point = Sequence[float] | np.ndarray
Neighbours = tuple[list[ContinuousSpaceAgent], np.ndarray]
ONE_AT_A_TIME = "positions are written one agent at a time; set agent.position"


class ModelCounters(WeakKeyDictionary):
    """A counter of agents for every model, forgotten together with the model."""

    def __getitem__(self, model: Model) -> Iterator[int]:
        """Return the model's counter, a new one from 1 on if it has none yet."""
        return self.setdefault(model, count(1))


# Mesa 3.3 counts agents in a plain dict on the class, which holds every model in memory for good.
# Mesa 3.5 counts in the model and has no such dict.
if hasattr(Agent, "_ids"):
    Agent._ids = ModelCounters(Agent._ids)


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
        """Return a copy of the selected rows."""
        return np.array(super().__getitem__(key))

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
        distances, chosen = super().calculate_distances(point, agents, **kwargs)
        return np.asarray(distances), chosen

    def get_k_nearest_agents(self, point: Point, k: int = 1) -> Neighbours:
        """Return the k agents nearest to `point`, all of them if there are fewer, and their distances."""
        distances, agents = self.calculate_distances(point)
        nearest = np.argsort(distances, kind="stable")[: _checked_k(k)]
        return [agents[i] for i in nearest], distances[nearest]

    def _add_agent(self, agent: Agent) -> int:
        self._rows = None
        index = super()._add_agent(agent)
        self._agent_positions[index] = self.center
        agent._mesa_index = index
        return index

    def _remove_agent(self, agent: Agent) -> None:
        self._rows = None
        first, last = self._agent_to_index[agent], self._n_agents - 1
        super()._remove_agent(agent)
        self._index_to_agent.pop(last, None)
        for index in range(first, last):
            self._index_to_agent[index] = moved = self.active_agents[index]
            moved._mesa_index = index

    def _refresh(self) -> None:
        """Copy the positions in columns elsewhere into the store that Mesa's methods read."""
        if self._rows is None:
            index = self._agent_to_index
            self._rows = [[index[agent] for agent in bodies.agents] for bodies in self._bodies]
        for rows, bodies in zip(self._rows, self._bodies, strict=True):
            if rows:
                self._agent_positions[rows] = bodies.position


class Agents(AgentSet, Generic[Kind]):
    """Agents in order: Mesa's AgentSet, which may also be indexed, as it will not be from Mesa 4 on.

    Mesa's set alone does not hold its agents: that of a model to which nothing else refers would become empty.
    """

    def __init__(self, agents: Iterable[Kind], random: Random | None = None) -> None:
        super().__init__(agents, random)
        self._model = getattr(next(iter(agents), None), "model", None)

    if TYPE_CHECKING:  # Mesa has no types

        def __iter__(self) -> Iterator[Kind]: ...

    @overload
    def __getitem__(self, item: int) -> Kind: ...

    @overload
    def __getitem__(self, item: slice) -> list[Kind]: ...

    def __getitem__(self, item: int | slice) -> Kind | list[Kind]:
        """Return one agent, or a list of them for a slice."""
        return list(self)[item]


class ArenaAgent(ContinuousSpaceAgent):
    """A Mesa agent of the arena whose `pos` is its `position`, as Mesa's drawing code expects.

    Attributes in `_stored_apart`, of a class and its bases, are stored in another way than as they are.
    """

    _stored_apart: ClassVar[tuple[str, ...]] = ("model", "unique_id", "space", "_mesa_index", "pos")

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

    def get_neighbors_in_radius(self, radius: float = 1) -> Neighbours:
        """Return the other agents whose positions are within `radius`, and their distances."""
        # All of them are within an infinite radius.
        limit = radius if isinstance(radius, float) and radius == math.inf else check_number("radius", radius)
        distances, agents = self._others()
        near = np.flatnonzero(distances <= limit)
        return [agents[i] for i in near], distances[near]

    def get_nearest_neighbors(self, k: int = 1) -> Neighbours:
        """Return the k nearest other agents, all if there are fewer, and their distances."""
        number = _checked_k(k)
        distances, agents = self._others()
        nearest = np.argsort(distances, kind="stable")[:number]
        return [agents[i] for i in nearest], distances[nearest]

    def _others(self) -> tuple[np.ndarray, list[Agent]]:
        here = self.position  # first: a removed agent raises here
        distances, agents = self.space.calculate_distances(here)
        mine = self.space._agent_to_index[self]
        return np.delete(distances, mine), [agent for agent in agents if agent is not self]


def _checked_k(k: object) -> int:
    return max(check_count("k", k, minimum=-(2**31)), 0)
