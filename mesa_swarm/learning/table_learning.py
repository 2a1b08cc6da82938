"""Q-learning in a look-up table of discrete states (thesis 7.3.2), beside the networks of `QLearning`."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import (
    InvalidValueError,
    check_choice,
    check_count,
    check_flag,
    check_name,
    check_number,
    shortened,
)
from mesa_swarm.control.layer import Senses
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.learning.actions import (
    ACTION_NAMES,
    ACTIONS,
    as_floats,
    best_of,
    checked_actions,
    choose_all,
    chosen,
    ranges_of,
)
from mesa_swarm.learning.learner import TRAINING_PARAMETERS
from mesa_swarm.learning.policy import SensorLayout, check_stored, checked_chances, checked_numbers, sensors_of
from mesa_swarm.learning.rewards import CRITICAL, NEXT_STATE, REWARD_STATES, REWARDS, STATE, rewarded
from mesa_swarm.learning.value_tables import TableLayer, ValueTables
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm

# A robot's table of eight actions then has 6.4 MB.
MOST_STATES = 100_000
# Stored in a policy's `training`: those of networks that tables have too.
OF_TABLES = tuple(name for name in TRAINING_PARAMETERS if name not in ("eta", "self_adjusting"))


@dataclass(frozen=True, kw_only=True, eq=False)
class TablePolicy(ValueTables):
    """Choose an action by Boltzmann's probabilities of values in a table, which `TableQLearning` learned.

    Parameters
    ----------
    sensors : SensorLayout
    values : ndarray, shape (copies, states, actions)
        Of the actions in each state, see `TableQLearning.values`. The k-th robot acts by set ``k % copies``.
    edges : tuple of float
    sectors : int
        As for `TableQLearning`.
    temperature : float
        Of the choice, above 0.
    steps : int
        Robot-steps of training, 0 for none.
    training : dict
        Provenance, and figures of its training.

    Raises
    ------
    InvalidValueError
        If the values do not fit the states, or are not finite.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> near_or_far = np.array([[[1.0, 0, 0, 0], [0, 0, 0, 1.0]]])  # back when something is near, otherwise forward
    >>> policy = TablePolicy(sensors=SensorLayout.of(AGENT3), values=near_or_far, edges=(0.2,), sectors=1, steps=1)
    >>> policy.act([[5.0, -1.0, -1.0], [40.0, -1.0, -1.0]])
    array([[-1., -1.],
           [ 1.,  1.]])
    """

    family: ClassVar[str] = "table"
    edges: tuple[float, ...]
    sectors: int

    def __post_init__(self) -> None:
        shape = as_floats(self.values).shape
        self._check(states_of(self.edges, self.sectors), checked_actions(shape[2]) if len(shape) == 3 else 8)

    def act(
        self,
        readings: ArrayLike,
        kinds: ArrayLike | None = None,
        chance: ArrayLike | None = None,
        *,
        numbers: ArrayLike | None = None,
    ) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `Policy.act`.

        The robot with number k, of ``numbers`` (n,), acts by set ``k % copies``; by default they are 0, 1, and so on.
        """
        distance, _ = self.sensors.check_readings(readings, kinds)
        given = np.empty((len(distance), self.values.shape[2]))
        count = checked_numbers(numbers, len(distance))
        look_up(distance, *self._layout, np.array(self.edges, float), int(self.sectors), self.values, count, given)
        chances = np.empty(0) if chance is None else checked_chances(chance, len(distance))
        taken = np.empty(len(distance), np.int64)
        choose_all(given, float(self.temperature), chances, taken)
        return ACTIONS[taken]

    @cached_property
    def _layout(self) -> tuple[np.ndarray, np.ndarray]:
        """Ranges and bearings (1, s), rad, as those of designs."""
        bearings = [math.remainder(math.radians(degrees), 2 * math.pi) for degrees in self.sensors.bearings]
        return np.array([self.sensors.ranges]), np.array([bearings])

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the values and the edges by name."""
        return {"values": np.asarray(self.values, np.float64), "edges": np.array(self.edges, np.float64)}

    def settings(self) -> dict:
        """Return the other fields that acting depends on."""
        return {"sectors": self.sectors, "temperature": self.temperature}

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> "TablePolicy":
        """Return the policy with these parts, from a file."""
        check_stored(cls.family, (*arrays, *settings), ("values", "edges", "sectors", "temperature"))
        edges = tuple(arrays["edges"].ravel().tolist())
        return cls(sensors=sensors, values=arrays["values"], edges=edges, steps=steps, training=training, **settings)


def states_of(edges: object, sectors: int) -> int:
    """Return the number of states, if it is not too large."""
    bins = len(checked_edges(edges)) + 1
    states = bins ** check_count("sectors", sectors, minimum=1, maximum=64)
    if states > MOST_STATES:
        raise InvalidValueError(
            f"sectors is {sectors}, which makes {states:,} states with {bins} bins; "
            f"expected at most {MOST_STATES:,}: give fewer sectors or edges"
        )
    return states


@dataclass(kw_only=True)
class TableQLearning(TableLayer):
    """Learn the values of actions in a table, one a robot, in every step; drive by Boltzmann's choice.

    The circle around a robot is divided into equal sectors, the first centred straight ahead and the others following
    to the left. The nearest reading of the sensors in each sector falls into one of a few bins; the bins of all
    sectors are the state. A sector without sensors always reads the range. The update is (7.3) itself,
    ``Q(s, a) <- (1 - alpha) Q(s, a) + alpha (r + gamma max_a' Q(s', a'))``: without networks there is neither eta nor
    generalisation, so that what is learned in one state changes no other.

    Parameters
    ----------
    edges : tuple of float
        Edges between bins, as shares of the range, above 0 and below 1, ascending: two of them make three bins.
    sectors : int
        At least 1; there are (bins to the power of sectors) states, at most 100,000. With an odd number, sectors are
        symmetric.
    reward, actions, alpha, gamma, beta, critical, reward_of, shared
        As for `QLearning`.
    first_temperature, last_temperature : float
        T_0 and T_c, above 0. With a start, its temperature is the first.
    frozen : bool
        Whether it only acts, without learning: by the values of its start, at random without one.
    start : TablePolicy, optional
        The initial policy of new robots, with the same states and actions. The k-th robot ever made gets table
        ``k % copies``, or table 0 where they share one.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> TableQLearning(edges=(0.1, 0.4), sectors=5).states
    243
    """

    edges: tuple[float, ...] = (CRITICAL, 0.3)
    sectors: int = 5
    reward: str = "b"
    actions: int = 8
    alpha: float = 0.4
    gamma: float = 0.7
    beta: float = 1e-4
    first_temperature: float = 1.0
    last_temperature: float = 0.2
    critical: float = CRITICAL
    reward_of: str = STATE
    shared: bool = False
    frozen: bool = False
    start: TablePolicy | None = None
    name: str = "TableQLearning"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        self.edges = checked_edges(self.edges)
        states_of(self.edges, self.sectors)
        checked_actions(self.actions)
        check_choice("reward", self.reward, REWARDS)
        check_choice("reward_of", self.reward_of, REWARD_STATES)
        for name in ("alpha", "beta"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)
        check_number("gamma", self.gamma, minimum=0, maximum=0.999)
        check_number("critical", self.critical, above=0, maximum=1)
        for name in ("first_temperature", "last_temperature"):
            check_number(name, getattr(self, name), above=0, maximum=1e6)
        for name in ("shared", "frozen"):
            setattr(self, name, check_flag(name, getattr(self, name)))
        self._check_start()

    def _check_start(self) -> None:
        """Check that it can continue from its start."""
        start = self.start
        if start is None:
            return
        if not isinstance(start, TablePolicy):
            raise InvalidValueError(f"start is {shortened(start)}; expected a TablePolicy, as policy() returns it")
        given, own = (start.edges, start.sectors, start.values.shape[2]), (self.edges, self.sectors, self.actions)
        if given != own:
            raise InvalidValueError(
                f"start has edges, sectors and actions {shortened(given)}; expected {shortened(own)}"
            )

    @property
    def states(self) -> int:
        """The number of states."""
        return (len(self.edges) + 1) ** self.sectors

    def policy(self, **training: str | float) -> TablePolicy:
        """Return what the robots have learned so far as a policy that no longer learns; see `QLearning.policy`."""
        sensors = sensors_of(self._robots)
        self._init_new_robots()
        return TablePolicy(
            sensors=sensors,
            values=self._column("values")[: 1 if self.shared else None].copy(),
            edges=self.edges,
            sectors=int(self.sectors),
            temperature=float(self._column("temperature").mean()),
            **self._training(OF_TABLES, training),
        )

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns: a table, the last state, its nearest reading, action and reward, and the temperature."""
        self._check_sensors()
        swarm.remember(f"{prefix}.values", (self.states, self.actions), np.float64, 0.0)
        swarm.remember(f"{prefix}.born", (), np.bool_, False)
        swarm.remember(f"{prefix}.state", (), np.int64, 0)
        swarm.remember(f"{prefix}.nearest", (), np.float64, 1.0)
        swarm.remember(f"{prefix}.action", (), np.int64, -1)
        swarm.remember(f"{prefix}.reward", (), np.float64, 0.0)
        first = self.first_temperature if self.start is None else self.start.temperature
        swarm.remember(f"{prefix}.temperature", (), np.float64, first)
        swarm.remember(f"{prefix}.lessons", (), np.int64, 0)

    @property
    def values(self) -> np.ndarray:
        """Every robot's values of the actions in each state (n, states, actions); a copy.

        The state is ``sum_k bin_k bins^k`` over the sectors k; bin 0 is the nearest.
        """
        return self._column("values").copy()

    @property
    def last_reward(self) -> np.ndarray:
        """Every robot's reward for its last action (n,); a copy."""
        return self._column("reward").copy()

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Learn from the last action, and choose the next one for robots that no other layer drives."""
        self._init_new_robots()
        values = self._column("values")
        learn_table(
            senses.distance, ranges_of(senses.sensors), senses.bearing, senses.design, senses.max_speed, values,
            tuple(map(self._column, ("state", "action", "lessons"))),
            tuple(map(self._column, ("nearest", "reward", "temperature"))),
            self._rng.random(len(layer)), np.array(self.edges), int(self.sectors), REWARDS.index(self.reward),
            (float(self.alpha), float(self.gamma), float(self.critical)),
            (float(self.beta), float(self.last_temperature)),
            (bool(self.shared), bool(self.frozen), self.reward_of == NEXT_STATE), command, layer, index,
        )  # fmt: skip
        if self.shared:
            values[1:] = values[:1]

    def worth(self, row: int) -> list[tuple[str, float]]:
        """Return the name and value Q(s, a) of each action in the last state of the robot in this row."""
        if self._column("action")[row] < 0:
            return []
        values = self._column("values")[row, self._column("state")[row]]
        return [(name, float(value)) for name, value in zip(ACTION_NAMES, values, strict=False)]

    def reason(self, moment: Moment) -> Reason:
        """Return the chosen action."""
        speeds = moment.command / max(float(np.abs(moment.command).max()), 1e-300)
        action = ACTION_NAMES[int(np.argmin(np.abs(ACTIONS - speeds).sum(axis=1)))]
        return Reason(f"it chose {action}, by its table and by chance")


def checked_edges(edges: object) -> tuple[float, ...]:
    """Return edges between bins, if they ascend between 0 and 1."""
    if not isinstance(edges, tuple | list) or not edges:
        raise InvalidValueError(
            f"edges is {shortened(edges)}; expected a tuple of shares of the range, such as (0.1, 0.4)"
        )
    checked = tuple(check_number("edges", edge, above=0, maximum=1) for edge in edges)
    if checked[-1] >= 1 or any(first >= second for first, second in pairwise(checked)):
        raise InvalidValueError(f"edges is {shortened(edges)}; expected ascending numbers above 0 and below 1")
    return checked


@compiled
def state_of(distance, ranges, bearing, i, d, edges, sectors, nearest):
    """Return the state of robot i of design d; write the nearest reading of each sector, a share of the range."""
    nearest[:] = 1.0
    width = 2.0 * math.pi / sectors
    for s in range(distance.shape[1]):
        if distance[i, s] >= 0.0 and ranges[d, s] > 0.0:
            k = math.floor(bearing[d, s] / width + 0.5) % sectors
            nearest[k] = min(nearest[k], distance[i, s] / ranges[d, s])
    state, power = 0, 1
    for k in range(sectors):
        place = 0
        while place < edges.shape[0] and nearest[k] >= edges[place]:
            place += 1
        state += power * place
        power *= edges.shape[0] + 1
    return state


@compiled
def learn_table(
    distance, ranges, bearing, design, max_speed, values, doing, worth, chance, edges, sectors, reward, rates,
    cooling, options, command, layer, index,
):  # fmt: skip
    """Learn from the last action by (7.3) and choose the next."""
    state, action, lessons = doing
    last, rewards, temperature = worth
    alpha, gamma, critical = rates
    beta, coolest = cooling
    shared, frozen, afterwards = options
    nearest = np.empty(sectors)
    for i in range(layer.shape[0]):
        row = 0 if shared else i
        now = state_of(distance, ranges, bearing, i, design[i], edges, sectors, nearest)
        least = nearest.min()
        a = action[i]
        if a >= 0:
            rewards[i] = rewarded(reward, least if afterwards else last[i], ACTIONS[a, 0], ACTIONS[a, 1], critical)
            if not frozen:
                lessons[i] += 1
                target = rewards[i] + gamma * values[row, now, best_of(values[row, now])]
                values[row, state[i], a] = (1.0 - alpha) * values[row, state[i], a] + alpha * target
        if not frozen:
            temperature[i] -= beta * (temperature[i] - coolest)
        state[i], last[i], action[i] = now, least, -1
        if layer[i] < 0:
            action[i] = chosen(values[row, now], temperature[i], chance[i])
            command[i, 0] = max_speed[i] * ACTIONS[action[i], 0]
            command[i, 1] = max_speed[i] * ACTIONS[action[i], 1]
            layer[i] = index


@compiled
def look_up(distance, ranges, bearing, edges, sectors, values, numbers, given):
    """Write the value of every action for every robot (n, actions)."""
    nearest = np.empty(sectors)
    for i in range(distance.shape[0]):
        copy = (numbers[i] if numbers.shape[0] else i) % values.shape[0]
        given[i] = values[copy, state_of(distance, ranges, bearing, i, 0, edges, sectors, nearest)]
