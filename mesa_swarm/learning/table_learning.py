"""Q-learning in a look-up table of discrete states (thesis 7.3.2), beside the networks of `QLearning`."""

import math
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.control.layer import RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals, RealTables
from mesa_swarm.learning.actions import (
    ACTIONS,
    action_of,
    as_floats,
    best_of,
    checked_actions,
    chosen,
    drive_by_action,
    named_values,
    ranges_of,
)
from mesa_swarm.learning.learner import (
    COUNT,
    INDEX,
    NUMBER,
    POSITIVE,
    UNBORN,
    Check,
    Declared,
    Lesson,
    RewardedLayer,
    TableLayer,
    begin_lesson,
    end_lesson,
)
from mesa_swarm.learning.policy import ChoosingPolicy, LearnedPolicy, SensorLayout, checked_numbers
from mesa_swarm.learning.rewards import CRITICAL, NEXT_STATE, REWARDS, STATE, rewarded
from mesa_swarm.robots.reasons import Moment, Reason

# A robot's table of eight actions then has 6.4 MB.
MOST_STATES = 100_000
check_sectors = partial(check_count, minimum=1, maximum=64)


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class ValueTables(LearnedPolicy):
    """Values of actions in states, one table or several: base class of `TablePolicy` and `SkillPolicy`."""

    sensors: SensorLayout
    values: np.ndarray
    temperature: float = 0.2
    steps: int = 0
    training: dict = field(default_factory=dict)

    def _check(self, states: int, actions: int) -> None:
        """Refuse tables of another shape, and what is out of its range."""
        self._check_settings()
        values = as_floats(self.values)
        if values.ndim != 3 or not len(values) or values.shape[1:] != (states, actions):
            raise InvalidValueError(f"values have shape {values.shape}; expected (copies, {states}, {actions})")
        if not np.isfinite(values).all():
            raise InvalidValueError("values hold numbers that are not finite; train the policy anew")
        object.__setattr__(self, "values", values)


@dataclass(frozen=True, kw_only=True, eq=False)
class TablePolicy(ValueTables, ChoosingPolicy):
    """Choose an action by Boltzmann's probabilities of values in a table, which `TableQLearning` learned.

    Parameters
    ----------
    sensors : SensorLayout
    values : ndarray, shape (copies, states, actions)
        Of the actions in each state, see `TableQLearning.values`. The k-th robot acts by set ``k % copies``.
    edges : tuple of float
    sectors : int
        As for `TableQLearning`.
    temperature, steps, training
        As for `QPolicy`.

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
    stored: ClassVar[tuple[str, ...]] = ("values", "edges")
    checks: ClassVar[dict[str, Check]] = {"sectors": check_sectors, "temperature": POSITIVE}
    edges: tuple[float, ...]
    sectors: int

    def __post_init__(self) -> None:
        shape = as_floats(self.values).shape
        self._check(states_of(self.edges, self.sectors), checked_actions(shape[2]) if len(shape) == 3 else 8)

    def _choices(
        self, readings: ArrayLike, kinds: ArrayLike | None, numbers: ArrayLike | None
    ) -> tuple[np.ndarray, np.ndarray]:
        distance, _ = self.sensors.check_readings(readings, kinds)
        values, count = np.empty((len(distance), self.actions)), checked_numbers(numbers, len(distance))
        look_up(distance, *self._layout, np.array(self.edges, float), int(self.sectors), self.values, count, values)
        return values, ACTIONS

    @cached_property
    def _layout(self) -> tuple[np.ndarray, np.ndarray]:
        """Ranges and bearings (1, s), rad, as those of designs."""
        bearings = [math.remainder(math.radians(degrees), 2 * math.pi) for degrees in self.sensors.bearings]
        return np.array([self.sensors.ranges]), np.array([bearings])

    @property
    def actions(self) -> int:
        """The number of actions."""
        return self.values.shape[2]

    @classmethod
    def _of_arrays(cls, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
        return {**arrays, "edges": tuple(arrays["edges"].ravel().tolist())}


def states_of(edges: object, sectors: int) -> int:
    """Return the number of states, if it is not too large."""
    bins = len(checked_edges(edges)) + 1
    states = bins ** check_sectors("sectors", sectors)
    if states > MOST_STATES:
        raise InvalidValueError(
            f"sectors is {sectors}, which makes {states:,} states with {bins} bins; "
            f"expected at most {MOST_STATES:,}: give fewer sectors or edges"
        )
    return states


@dataclass(kw_only=True)
class TableQLearning(TableLayer[TablePolicy], RewardedLayer[TablePolicy]):
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

    policy_class = TablePolicy
    of_policies, agreed = ("edges", "sectors"), ("edges", "sectors", "actions")
    stated = ("reward", "alpha", "gamma", "beta", "critical", "reward_of", "shared")
    checks: ClassVar[dict[str, Check]] = {
        "edges": lambda _, edges: checked_edges(edges),
        "sectors": check_sectors,
    }
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
        super().__post_init__()
        states_of(self.edges, self.sectors)

    @property
    def states(self) -> int:
        """The number of states: ``sum_k bin_k bins^k`` over the sectors k is that of a robot; bin 0 is the nearest."""
        return (len(self.edges) + 1) ** self.sectors

    def _columns(self) -> dict[str, Declared]:
        """Return the columns: a table, the last state, its nearest reading, action and reward, and the temperature."""
        return {
            "values": ((self.states, self.actions), np.float64, 0.0),
            "state": COUNT,
            "nearest": ((), np.float64, 1.0),
            "action": INDEX,
            "reward": NUMBER,
            "temperature": ((), np.float64, self._begun_at),
        }

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "TableRule"]:
        """Return what learns and chooses."""
        names = "values", "state", "action", "lessons", "nearest", "reward", "temperature"
        rule: Any = (
            *map(self._column, names),
            ranges_of(senses.sensors),
            np.array(self.edges, float),
            np.empty(int(self.sectors)),
            REWARDS.index(self.reward),
            (float(self.alpha), float(self.gamma), float(self.critical)),
            (float(self.beta), float(self.last_temperature)),
            (bool(self.shared), bool(self.frozen), self.reward_of == NEXT_STATE),
        )
        return learn_table, TableRule(robots, self._lesson(), *rule)

    def worth(self, row: int) -> list[tuple[str, float]]:
        """Return the name and value Q(s, a) of each action in the last state of the robot in this row."""
        values = self._column("values")[row, self._column("state")[row]]
        return named_values(values) if self._column("action")[row] >= 0 else []

    def reason(self, moment: Moment) -> Reason:
        """Return the chosen action."""
        return Reason(f"it chose {action_of(moment.command)}, by its table and by chance")


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


class TableRule(NamedTuple):
    """What `learn_table` takes.

    Parameters
    ----------
    robots : RobotColumns
    lesson : Lesson
    values : ndarray, shape (n, states, actions)
    state, action, lessons : int64 ndarrays, shape (n,)
    last, rewards, temperature : ndarrays, shape (n,)
        The nearest reading in the last state, and more columns of robots.
    ranges : ndarray, shape (d, s)
    edges, nearest : ndarrays, shapes (edges,), (sectors,)
        Edges between bins, and the nearest reading of each sector of one robot.
    reward : int
        A place in `REWARDS`.
    rates, cooling, options : tuples
        Alpha, gamma and the critical reading; beta and T_c; whether robots learn together, only act, and are rewarded
        of the next state.
    """

    robots: RobotColumns
    lesson: Lesson
    values: RealTables
    state: Integers
    action: Integers
    lessons: Integers
    last: Reals
    rewards: Reals
    temperature: Reals
    ranges: RealRows
    edges: Reals
    nearest: Reals
    reward: int
    rates: tuple[float, float, float]
    cooling: tuple[float, float]
    options: tuple[bool, bool, bool]


@compiled(nogil=True)
def learn_table(block, step, first_row, last_row):
    """Learn from the last action of each robot by (7.3), and choose the next."""
    rule = unpack(block, TableRule)
    if not begin_lesson(rule.lesson):
        return UNBORN
    robots, values, edges, nearest = rule.robots, rule.values, rule.edges, rule.nearest
    state, action, lessons, layer = rule.state, rule.action, rule.lessons, robots.layer
    last, rewards, temperature = rule.last, rule.rewards, rule.temperature
    alpha, gamma, critical = rule.rates
    beta, coolest = rule.cooling
    shared, frozen, afterwards = rule.options
    for i in range(layer.shape[0]):
        row = 0 if shared else i
        now = state_of(
            robots.distance, rule.ranges, robots.bearing, i, robots.design[i], edges, nearest.shape[0], nearest
        )
        least = nearest.min()
        a = action[i]
        if a >= 0:
            rewards[i] = rewarded(rule.reward, least if afterwards else last[i], ACTIONS[a, 0], ACTIONS[a, 1], critical)
            if not frozen:
                lessons[i] += 1
                target = rewards[i] + gamma * values[row, now, best_of(values[row, now])]
                values[row, state[i], a] = (1.0 - alpha) * values[row, state[i], a] + alpha * target
        if not frozen:
            temperature[i] -= beta * (temperature[i] - coolest)
        state[i], last[i], action[i] = now, least, -1
        if layer[i] < 0:
            action[i] = chosen(values[row, now], temperature[i], rule.lesson.chance[i])
            drive_by_action(action[i], i, robots.max_speed, robots.command, layer, robots.place)
    return end_lesson(rule.lesson, -1)  # means of rewards do not diverge


@compiled
def look_up(distance, ranges, bearing, edges, sectors, values, numbers, rows):
    """Write the value of every action for every robot (n, actions)."""
    nearest = np.empty(sectors)
    for i in range(distance.shape[0]):
        copy = (numbers[i] if numbers.shape[0] else i) % values.shape[0]
        rows[i] = values[copy, state_of(distance, ranges, bearing, i, 0, edges, sectors, nearest)]
