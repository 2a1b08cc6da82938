"""Q-learning as in the thesis, and its policies."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, LearningError, check_choice, check_count, shortened
from mesa_swarm.control.layer import RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import draw_number
from mesa_swarm.kernels.type_names import IntegerRows, Integers, RealRows, Reals, RealTables
from mesa_swarm.learning.actions import (
    ACTIONS,
    ENCODINGS,
    action_of,
    best_of,
    check_action_count,
    checked_actions,
    chosen,
    drive_by_action,
    least_of,
    named_values,
    write_inputs,
)
from mesa_swarm.learning.learner import (
    INDEX,
    UNBORN,
    Check,
    Declared,
    Learner,
    Lesson,
    NetworkLesson,
    UnboundState,
    adapt,
    begin_lesson,
    discount_of,
    end_lesson,
    is_bounded,
    rate_of,
)
from mesa_swarm.learning.networks import NetworkPolicy, Networks, back_propagate, forward
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.learning.rewards import rewarded
from mesa_swarm.model.parameters import YES_NO
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm

# What a robot adapts to its collisions: nothing, T, or gamma too.
ADJUSTING = (*YES_NO, "with gamma")
# The gamma of a robot that collides often; the largest of the thesis (8.2).
ALERT_GAMMA = 0.9
# Columns of stored experiences: inputs before and after, the action, its reward.
REPLAYED = ("replay_before", "replay_after", "replay_action", "replay_reward")
# What only networks have, with the defaults of models.
OF_NETWORKS = {"encoding": "distance", "eta": 0.1, "self_adjusting": "no"}


def adjusted(answer: str | bool) -> dict[str, Any]:
    """Return the settings of a learner for one of `ADJUSTING`, True or False."""
    if not isinstance(answer, bool | np.bool_):
        answer = check_choice("self_adjusting", answer, ADJUSTING)
    return {
        "self_adjusting": answer not in (False, "no"),
        "alert_gamma": ALERT_GAMMA if answer == ADJUSTING[-1] else None,
    }


def in_a_table(memory: str, networks: "QLearning", **settings: str | float) -> bool:
    """Return whether `memory` is "table", to which settings of networks do not apply: these must have their defaults.

    Parameters
    ----------
    memory : str
        "networks" or "table".
    networks : QLearning
        The learner with networks of these settings.
    **given
        Settings among `OF_NETWORKS`, as the user gave them.

    Raises
    ------
    InvalidValueError, UnknownNameError
    """
    is_table = check_choice("memory", memory, ("networks", "table")) == "table"
    for name, value in settings.items():
        if is_table and getattr(networks, name) != getattr(QLearning, name):
            raise InvalidValueError(
                f"{name} is {shortened(value)}, which does not apply to memory 'table'; "
                f"expected {OF_NETWORKS[name]!r}, or memory 'networks'"
            )
    return is_table


@dataclass(frozen=True, kw_only=True, eq=False)
class QPolicy(NetworkPolicy):
    """Choose an action by Boltzmann's probabilities of values from networks.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        ``copies * actions`` of them, robot after robot. The k-th robot acts by set ``k % copies``.
    actions : int
        4 or 8.
    encoding : str
        "distance" or "typed".
    temperature : float
        Of the choice, above 0.
    steps : int
        Robot-steps of training, 0 for none.
    training : dict
        Provenance, and figures of its training.

    Raises
    ------
    InvalidValueError
        If the networks do not fit the sensors and actions, or hold anything that is not finite.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    >>> policy.act([[20.0, -1.0, -1.0]], [[0, -1, -1]]).shape
    (1, 2)
    """

    family: ClassVar[str] = "q"
    checks: ClassVar[dict] = {"actions": check_action_count, **NetworkPolicy.checks}
    choices_field: ClassVar[str] = "actions"
    networks_per_choice: ClassVar[int] = 1
    actions: int = 8

    def __post_init__(self) -> None:
        self._check_parts()

    @classmethod
    def untrained(
        cls,
        design: RobotDesign,
        *,
        rng: np.random.Generator,
        copies: int = 1,
        actions: int = 8,
        encoding: str = "distance",
        **more: Any,
    ) -> "QPolicy":
        """Return a policy with small random weights for a design; `more` are other fields of the policy."""
        sensors = SensorLayout.of(design)
        inputs = ENCODINGS[check_choice("encoding", encoding, ENCODINGS)] * len(sensors)
        count = check_count("copies", copies, minimum=1) * checked_actions(actions)
        networks = Networks.random(count, inputs=inputs, hidden=2 * len(sensors), rng=rng)
        return cls(sensors=sensors, networks=networks, actions=actions, encoding=encoding, **more)

    def values(
        self, readings: ArrayLike, kinds: ArrayLike | None = None, *, numbers: ArrayLike | None = None
    ) -> np.ndarray:
        """Return the value of every action (n, actions), given readings and kinds (n, s); see `act`."""
        known = self._kernel_arguments(readings, kinds, numbers)
        values = np.empty((len(known[0]), self.actions))
        value_of_actions(*known, values)
        return values

    def _choices(
        self, readings: ArrayLike, kinds: ArrayLike | None, numbers: ArrayLike | None
    ) -> tuple[np.ndarray, np.ndarray]:
        return self.values(readings, kinds, numbers=numbers), ACTIONS


@compiled
def value_of_actions(distance, kind, ranges, weights, numbers, values):
    """Write the value of every action for every robot (n, actions)."""
    robots, count = values.shape
    copies = weights[3].shape[0] // count
    now, hidden = np.empty((1, weights[0].shape[1])), np.empty(weights[0].shape[2])
    for i in range(robots):
        number = numbers[i] if numbers.shape[0] else i
        write_inputs(distance, kind, ranges, i, 0, now, 0)
        action_values(weights, (number % copies) * count, now, 0, hidden, values[i])


@compiled
def action_values(weights, first, inputs, row, hidden, values):
    """Write the value of each action for one robot, by its networks from `first` on."""
    inner, inner_bias, outer, outer_bias = weights
    for a in range(values.shape[0]):
        values[a] = forward(inner, inner_bias, outer, outer_bias, first + a, inputs, row, hidden)


@dataclass(kw_only=True)
class QLearning(Learner[QPolicy]):
    """Learn in every step the values of a few actions, and choose by them; always active.

    Each robot has a network for each action, of its sensors' readings, twice as many hidden units as
    proximity sensors, and one output, Q(s, a). In every step, without episodes, the network of the action
    that was taken makes one step of back-propagation towards ``Q + alpha (r + gamma max_a' Q(s', a') - Q)``
    (7.3), where s' follows the action. Then an action is chosen by Boltzmann's
    probabilities (7.4) at a temperature that falls to its limit: ``T <- T - beta (T - T_c)`` (8.3).

    What is learned is in columns of the swarm, one row a robot. In a `Subsumption` a robot learns of its own
    actions only, not of those of layers above.

    A model learns with a copy of the layer that it is given, such as ``model.control.layers[0]``. The copy's state
    outlasts a change of controls: put into a control of the same model again, it continues unchanged; in another
    model, robots start with its `policy()`.

    Parameters
    ----------
    reward : str
        "a", "b" or "c", see `learning.rewards`.
    actions : int
        8, or the first 4 of them: back, left and right on the spot, forward.
    encoding : str
        "distance", as in the thesis, or "typed": also whether a sensor sees a robot, a fire or a load.
    alpha : float
        Weight of a new experience, 0 to 1.
    eta : float
        Rate of back-propagation, 0 to 1.
    last_eta : float, optional
        The rate at T_c, 0 to 1; in between it is linear in the temperature:
        ``eta(T) = last_eta + (eta - last_eta) (T - T_c) / (T_0 - T_c)``. By default eta is constant. With a small one
        the last steps of a training do not undo what the others learned: a frozen policy then acts as the learner did.
    gamma : float
        Discount of the next step's value, 0 to below 1.
    beta : float
        How fast the temperature falls, 0 to 1.
    first_temperature : float, optional
        T_0, above 0; 1 by default. With a start, its temperature by default.
    last_temperature : float
        T_c, above 0.
    critical : float
        Reading, as a share of the range, below which the reward depends on nearness only; above 0, at most 1. The
        thesis's d_crit of 0.4 has no unit. The default is 0.4 of a robot's diameter of 10 with a range of 50, chosen
        because collisions then fall with T, as the thesis states: see the page on readings.
    reward_of : str
        "state", as in the thesis: the reward is r(s, a), of the readings with which the action was chosen; or
        "next state": r(s', a), of the readings that follow it.
    replay : int
        The number of its latest experiences that each robot stores, 0 to 1,000,000; 0, the default, stores none.
        From these it learns again, in each step, besides its new experience [1]_.
    replays : int
        How many stored experiences, drawn at random with replacement, a robot learns from again in each step, 1 to
        10,000.
    shared : bool
        Whether all robots learn with one set of networks, from one experience after the other in the order of
        the robots' ids.
    self_adjusting : bool
        Whether a robot's temperature follows its recent rate of bumps instead of time:
        ``T = T_c + (T_0 - T_c) min(1, b / bump_rate)``, where b is the share of recent steps, about the last
        `bump_window`, that ended with a reading of at most `bump_distance`.
    bump_rate : float
        Share of steps, above 0, at most 1.
    bump_window : int
        Steps, at least 1.
    bump_distance : float
        Map units, at least 0.
    alert_gamma : float, optional
        The gamma of a self-adjusting robot whose rate of bumps is `bump_rate` or more, 0 to below 1; between that and
        `gamma`, which applies to a robot that does not bump, it is in proportion. `gamma` by default: it is constant.
    least_speed : float, optional
        The mean forward speed that a self-adjusting robot is to drive at, a share of max_speed, -1 to 1. Instead of
        following bumps, its temperature then grows by the share 1 / `bump_window` in each step while the mean of
        recent steps, about the last `bump_window`, is at least this, up to the larger of T_0 and T_c; otherwise it
        falls by as much, down to the smaller: the robot chooses as much at random as its speed permits.
    frozen : bool
        Whether it only acts, at each robot's temperature, without learning; this requires a trained `start`.
    start : QPolicy, optional
        The initial policy of new robots, small random weights by default: the way to continue from a saved
        policy. The k-th robot ever made gets set ``k % copies``, or set 0 where networks are shared.
        Sensors must be those that it was trained with; robots may be larger or faster, as actions are shares of
        max_speed.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If a value is out of its range, or `start` has other actions or another encoding.
    LearningError
        If it is frozen and has no trained start.

    References
    ----------
    .. [1] Lin, Self-improving reactive agents based on reinforcement learning, planning and teaching, Machine
       Learning 8 (1992) 293-321.

    Examples
    --------
    >>> QLearning(reward="b", beta=5e-3).gamma
    0.7
    """

    policy_class = QPolicy
    of_policies = agreed = ("actions", "encoding")
    checks: ClassVar[dict[str, Check]] = {
        "replay": partial(check_count, maximum=1_000_000),
        "replays": partial(check_count, minimum=1, maximum=10_000),
    }
    last_action = INDEX
    actions: int = 8
    replay: int = 0
    replays: int = 1
    start: QPolicy | None = None
    name: str = "QLearning"

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "QRule"]:
        """Return what learns and chooses."""
        lesson = self._network_lesson(senses)
        _, inputs, hidden = lesson.weights[0].shape
        scratch = np.empty((1, inputs)), np.empty(hidden), np.empty(self._count)
        action = self._column("action")
        return learn_and_choose, QRule(robots, self._lesson(), lesson, action, self._past(), *scratch)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Make the columns of the swarm; in the same model, continue with what was learned before."""
        if isinstance(self._home, UnboundState) and self._home.swarm is swarm:
            self._check_replay()
        super().bind(swarm, prefix, rng)

    def _check_replay(self) -> None:
        """Check that robots store as many experiences as when they began to learn."""
        column = self._robots.columns.get(f"{self._prefix}.replay_action")
        stored = 0 if column is None else column.shape[1]
        if stored != self.replay:
            raise LearningError(
                f"{self.name}: replay is {shortened(self.replay)}, and robots of its model store {stored} experiences; "
                f"set {stored}, or continue with QLearning(start=learner.policy(), replay=...)"
            )

    def _columns(self) -> dict[str, Declared]:
        """Return the columns, also those of the experiences that each robot stores."""
        inputs: Declared = ((self.replay, *self._inputs), np.float64, 1.0)
        columns = (inputs, inputs, ((self.replay,), np.int64, 0), ((self.replay,), np.float64, 0.0))
        return {**super()._columns(), **(dict(zip(REPLAYED, columns, strict=True)) if self.replay else {})}

    def _past(self) -> "StoredPast":
        """Return all stored experiences, and where the chances are drawn for those to learn from again."""
        robots = len(self._column("action"))
        self._check_replay()
        if not self.replay:
            nothing, none = np.empty((robots, 0, 0)), np.empty((robots, 0))
            return StoredPast(nothing, nothing, np.empty((robots, 0), np.int64), none, none)
        before, after, action, reward = map(self._column, REPLAYED)
        shape, chance = (*before.shape[:2], math.prod(before.shape[2:])), np.empty((robots, self.replays))
        return StoredPast(before.reshape(shape), after.reshape(shape), action, reward, chance)

    def _set_apart(self) -> list[str]:
        return [*super()._set_apart(), *(("replay", "replays") if self.replay else ())]

    def worth(self, row: int) -> list[tuple[str, float]]:
        """Return the name and value Q(s, a) of each action at the last choice of the robot in this row.

        Before its first choice the list is empty.
        """
        return named_values(self._last_outputs(row)) if self._column("action")[row] >= 0 else []

    def reason(self, moment: Moment) -> Reason:
        """Return the chosen action, and the nearest reading."""
        sensors = np.flatnonzero(moment.kind >= 0)
        near = (int(sensors[np.argmin(moment.distance[sensors])]),) if len(sensors) else ()
        beside = f" with {moment.reading(near[0])}" if near else " with nothing in sight"
        return Reason(f"it chose {action_of(moment.command)}, by what it learned and by chance,{beside}", near)


class StoredPast(NamedTuple):
    """Experiences that robots store.

    Parameters
    ----------
    before, after : ndarrays, shape (n, e, k)
        Inputs before and after each.
    action, reward : ndarrays, shape (n, e)
    chance : ndarray, shape (n, replays)
        By which those to learn from again are drawn.
    """

    before: RealTables
    after: RealTables
    action: IntegerRows
    reward: RealRows
    chance: RealRows


class QRule(NamedTuple):
    """What `learn_and_choose` takes; `now`, `hidden` and `values` are for inputs, units and outputs of one robot."""

    robots: RobotColumns
    lesson: Lesson
    networks: NetworkLesson
    action: Integers
    past: StoredPast
    now: RealRows
    hidden: Reals
    values: Reals


@compiled(nogil=True)
def learn_and_choose(block, step, first_row, last_row):
    """Learn from the last action of each robot, and choose the next."""
    rule = unpack(block, QRule)
    if not begin_lesson(rule.lesson):
        return UNBORN
    robots, networks, action, past = rule.robots, rule.networks, rule.action, rule.past
    for i in range(past.chance.shape[0]):
        for k in range(past.chance.shape[1]):
            past.chance[i, k] = draw_number(rule.lesson.stream)
    distance, kind, command, layer = robots.distance, robots.kind, robots.command, robots.layer
    ranges, weights, inputs, lessons = networks.ranges, networks.weights, networks.inputs, networks.lessons
    rewards, temperature, bumps, pace = networks.rewards, networks.temperature, networks.bumps, networks.pace
    reward, rates, cooling, bumping = networks.reward, networks.rates, networks.cooling, networks.bumping
    gamma, alert, critical = networks.discounts
    shared, self_adjusting, frozen, afterwards = networks.options
    chance, now, hidden, values = rule.lesson.chance, rule.now, rule.hidden, rule.values
    count = values.shape[0]
    diverged = -1
    for i in range(layer.shape[0]):
        first = 0 if shared else i * count
        nearest = write_inputs(distance, kind, ranges, i, robots.design[i], now, 0)
        action_values(weights, first, now, 0, hidden, values)
        a = action[i]
        if a >= 0:
            reading = nearest if afterwards else least_of(inputs, i, distance.shape[1])
            rewards[i] = rewarded(reward, reading, ACTIONS[a, 0], ACTIONS[a, 1], critical)
            rate = rate_of(rates, temperature[i], cooling)
            discount = discount_of(gamma, alert, bumps[i], bumping[0], self_adjusting)
            target = rewards[i] + discount * values[best_of(values)]
            if not frozen and not learn_network_value(weights, first + a, inputs, i, hidden, target, rate):
                diverged = i if diverged < 0 else diverged
            elif not frozen:
                lessons[i] += 1
            action_values(weights, first + a, now, 0, hidden, values[a : a + 1])
            if not frozen and past.action.shape[1]:
                store(past, i, lessons[i], inputs, a, rewards[i], now)
                if not learn_again(weights, first, past, i, lessons[i], hidden, values, discount, rate):
                    diverged = i if diverged < 0 else diverged
                action_values(weights, first, now, 0, hidden, values)
        if not frozen:
            ahead = 0.5 * (ACTIONS[a, 0] + ACTIONS[a, 1]) if a >= 0 else bumping[3]
            adapt(distance, i, ahead, temperature, bumps, pace, cooling, bumping, self_adjusting)
        action[i] = -1
        if layer[i] < 0:
            action[i] = chosen(values, temperature[i], chance[i])
            drive_by_action(action[i], i, robots.max_speed, command, layer, robots.place)
        for k in range(inputs.shape[1]):
            inputs[i, k] = now[0, k]
    return end_lesson(rule.lesson, diverged)


@compiled
def store(past, i, lessons, inputs, action, reward, now):
    """Store the last experience of robot i, its `lessons`-th, in place of its oldest."""
    before, after, actions, rewards = past.before, past.after, past.action, past.reward
    e = (lessons - 1) % actions.shape[1]
    actions[i, e], rewards[i, e] = action, reward
    for k in range(inputs.shape[1]):
        before[i, e, k], after[i, e, k] = inputs[i, k], now[0, k]


@compiled
def learn_again(weights, first, past, i, lessons, hidden, values, discount, rate):
    """Learn again from stored experiences of robot i, which chances draw; return False if its values diverge."""
    before, after, actions, rewards, chances = past.before, past.after, past.action, past.reward, past.chance
    stored = min(lessons, actions.shape[1])
    for k in range(chances.shape[1]):
        e = min(int(chances[i, k] * stored), stored - 1)
        action_values(weights, first, after[i], e, hidden, values)
        target = rewards[i, e] + discount * values[best_of(values)]
        if not learn_network_value(weights, first + actions[i, e], before[i], e, hidden, target, rate):
            return False
    return True


@compiled
def learn_network_value(weights, m, inputs, i, hidden, target, rate):
    """Move Q of the action of robot i to its target; return False, changing nothing, if it diverges."""
    inner, inner_bias, outer, outer_bias = weights
    step = rate * (target - forward(inner, inner_bias, outer, outer_bias, m, inputs, i, hidden))
    if not is_bounded(outer, m, step):
        return False
    back_propagate(inner, inner_bias, outer, outer_bias, m, inputs, i, hidden, step)
    return True
