"""Q-learning with continuous actions: wire fitting, the learner and its policy."""

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.control.layer import Senses, columns_for
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import log, tanh
from mesa_swarm.learning.actions import ACTIONS, as_floats, best_of, chosen, least_of, write_inputs
from mesa_swarm.learning.learner import LARGEST, Check, Learner, adapt, discount_of, end_lesson, is_bounded, rate_of
from mesa_swarm.learning.networks import NetworkPolicy, back_propagate, forward
from mesa_swarm.learning.rewards import rewarded

SMOOTHING = 0.1
TINY = 0.01


def wire_value(
    action: ArrayLike, wires: ArrayLike, values: ArrayLike, *, smoothing: float = SMOOTHING, tiny: float = TINY
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the value of an action, and its gradients by the wires and their values.

    ``Q(u) = sum_i(q_i / D_i) / sum_i(1 / D_i)`` with ``D_i = |u - u_i|^2 + c (q_max - q_i) + eps``. It is never
    above q_max, and nearly q_max at the best wire. The gradients are exact, also for the best wire, on
    which all D_i depend.

    Parameters
    ----------
    action : ndarray, shape (2,)
        u, wheel commands as shares of max_speed.
    wires : ndarray, shape (w, 2)
        u_i, the proposed actions.
    values : ndarray, shape (w,)
        q_i, their values.
    smoothing, tiny : float
        c, at least 0, and eps, above 0.

    Returns
    -------
    (float, ndarray, ndarray)
        Q(u), dQ/du_i of shape (w, 2), dQ/dq_i of shape (w,).

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> value, _, _ = wire_value([1.0, 1.0], [[1.0, 1.0], [-1.0, -1.0]], [1.0, -1.0])
    >>> round(value, 3)
    0.998
    """
    u, ends, q = as_floats(action), as_floats(wires), as_floats(values)
    finite = all(np.isfinite(part).all() for part in (u, ends, q))
    if u.shape != (2,) or q.ndim != 1 or not len(q) or ends.shape != (len(q), 2) or not finite:
        raise InvalidValueError(
            f"action is {shortened(action)}, wires are {shortened(wires)} and values {shortened(values)}; "
            "expected finite numbers of shapes (2,), (w, 2) and (w,)"
        )
    c, eps = check_number("smoothing", smoothing, minimum=0), check_number("tiny", tiny, above=0)
    by_wire, by_value = np.empty((len(q), 2)), np.empty(len(q))
    return float(interpolate(u[0], u[1], ends, q, c, eps, by_wire, by_value)), by_wire, by_value


@compiled
def interpolate(left, right, wires, values, smoothing, tiny, by_wire, by_value):
    """Return Q(left, right); write its derivatives by the wires (w, 2) and by their values (w,)."""
    count = values.shape[0]
    best = best_of(values)
    weights, weighted = 0.0, 0.0
    for i in range(count):
        away = distance_to(left, right, wires[i, 0], wires[i, 1], values[best] - values[i], smoothing, tiny)
        weights += 1.0 / away
        weighted += values[i] / away
    value = weighted / weights
    pulled = 0.0
    for i in range(count):
        away = distance_to(left, right, wires[i, 0], wires[i, 1], values[best] - values[i], smoothing, tiny)
        by_distance = (value - values[i]) / (away * away * weights)
        by_value[i] = 1.0 / (away * weights) - smoothing * by_distance
        by_wire[i, 0] = 2.0 * (wires[i, 0] - left) * by_distance
        by_wire[i, 1] = 2.0 * (wires[i, 1] - right) * by_distance
        pulled += smoothing * by_distance
    by_value[best] += pulled  # q_max is in every D_i
    return value


@compiled
def distance_to(left, right, wire_left, wire_right, below, smoothing, tiny):
    """Return D_i of a wire whose value is `below` under the best one's."""
    return (left - wire_left) ** 2 + (right - wire_right) ** 2 + smoothing * below + tiny


@compiled
def squashed(output, start):
    """Return a wheel command in (-1, 1) from a network's output: 0 gives `start`."""
    return tanh(output + 0.5 * log((1.0 + start) / (1.0 - start)))


# Wires begin at the thesis's actions, but inside of the limits, so that they can move.
STARTS = 0.8 * ACTIONS
check_wires = partial(check_count, minimum=1, maximum=len(STARTS))
# Networks of a wire: for the left wheel, the right wheel, the value.
OUTPUTS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class WirePolicy(NetworkPolicy):
    """Choose one of the actions proposed by networks, by Boltzmann's probabilities of their values.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        ``copies * wires * 3`` of them: for each wire the left wheel, the right wheel, the value. The k-th robot
        acts by set ``k % copies``.
    wires : int
        1 to 8.
    encoding, temperature, steps, training
        As for `QPolicy`.

    Raises
    ------
    InvalidValueError
        If the networks do not fit the sensors and wires, or hold anything that is not finite.
    """

    family: ClassVar[str] = "wires"
    checks: ClassVar[dict] = {"wires": check_wires, **NetworkPolicy.checks}
    choices_field: ClassVar[str] = "wires"
    networks_per_choice: ClassVar[int] = OUTPUTS
    wires: int = 4

    def __post_init__(self) -> None:
        self._check_parts()

    def proposals(
        self, readings: ArrayLike, kinds: ArrayLike | None = None, *, numbers: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the wires' actions (n, w, 2) and values (n, w), given readings and kinds (n, s)."""
        known = self._kernel_arguments(readings, kinds, numbers)
        actions, values = np.empty((len(known[0]), self.wires, 2)), np.empty((len(known[0]), self.wires))
        propose_all(*known, actions, values)
        return actions, values

    def _choices(
        self, readings: ArrayLike, kinds: ArrayLike | None, numbers: ArrayLike | None
    ) -> tuple[np.ndarray, np.ndarray]:
        actions, values = self.proposals(readings, kinds, numbers=numbers)
        return values, actions


@compiled
def propose_all(distance, kind, ranges, weights, numbers, actions, values):
    """Write the wires' actions (n, w, 2) and values (n, w) of every robot."""
    robots, wires = values.shape
    copies = weights[3].shape[0] // (OUTPUTS * wires)
    now, hidden = np.empty((1, weights[0].shape[1])), np.empty((OUTPUTS * wires, weights[0].shape[2]))
    for i in range(robots):
        number = numbers[i] if numbers.shape[0] else i
        write_inputs(distance, kind, ranges, i, 0, now, 0)
        propose(weights, (number % copies) * OUTPUTS * wires, now, 0, hidden, actions[i], values[i])


@compiled
def propose(weights, first, inputs, row, hidden, actions, values):
    """Write one robot's wires and values, by its networks from `first` on; `hidden` is left for learning."""
    inner, inner_bias, outer, outer_bias = weights
    for w in range(values.shape[0]):
        for side in range(2):
            m = OUTPUTS * w + side
            output = forward(inner, inner_bias, outer, outer_bias, first + m, inputs, row, hidden[m])
            actions[w, side] = squashed(output, STARTS[w, side])
        m = OUTPUTS * w + 2
        values[w] = forward(inner, inner_bias, outer, outer_bias, first + m, inputs, row, hidden[m])


@dataclass(kw_only=True)
class WireFittedQ(Learner[WirePolicy]):
    """Learn the values of wheel commands, continuous in [-1, 1] of max_speed; always active.

    Networks propose a few actions, the wires, and their values; values between wires are interpolated, see
    `wire_value`. Every step, Q(s, u) of the action u that was taken is moved by back-propagation
    through the interpolation towards ``Q + alpha (r + gamma q_max(s') - Q)``. A wire is chosen by Boltzmann's
    probabilities, and a normal error of `jitter` times the temperature added to each wheel.

    Parameters
    ----------
    wires : int
        1 to 8; they begin near the thesis's actions, in their order.
    jitter : float
        Share of max_speed at temperature 1, at least 0.
    reward, encoding, alpha, eta, last_eta, gamma, beta, first_temperature, last_temperature, critical, reward_of, \
shared, self_adjusting, bump_rate, bump_window, bump_distance, alert_gamma, least_speed, frozen
        As for `QLearning`.
    start : WirePolicy, optional
        The initial policy of new robots.

    Raises
    ------
    InvalidValueError, UnknownNameError, LearningError
        As for `QLearning`.

    Examples
    --------
    >>> WireFittedQ(wires=5).reward
    'c'
    """

    policy_class = WirePolicy
    of_policies = agreed = ("wires", "encoding")
    checks: ClassVar[dict[str, Check]] = {
        "wires": check_wires,
        "jitter": partial(check_number, minimum=0, maximum=10),
    }
    last_action = ((2,), np.float64, math.nan)
    wires: int = 4
    jitter: float = 0.2
    reward: str = "c"
    start: WirePolicy | None = None
    name: str = "WireFittedQ"

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Learn from the last step, choose, and drive robots that no other layer drives.

        In Python, since NumPy draws normal errors by no function that compiled ones can call.
        """
        self.begin()
        robots, lesson = columns_for(senses, command, layer, index), self._lesson()
        lesson.chance[:] = self._rng.random(len(layer))
        errors = float(self.jitter) * self._rng.normal(size=(len(layer), 2))
        networks, action = self._network_lesson(senses), self._column("action")
        if learn_wires(robots, lesson, networks, action, errors, self.wires):
            self._refuse_diverged(int(lesson.diverged[0]))

    def worth(self, row: int) -> list[tuple[str, float]]:
        """Return the values of a robot's wires at its last choice; see `QLearning.worth`."""
        if np.isnan(self._column("action")[row, 0]):
            return []
        outputs = self._last_outputs(row).reshape(self.wires, OUTPUTS)
        ends = np.tanh(outputs[:, :2] + np.arctanh(STARTS[: self.wires]))
        return [
            (f"wheels {left:+.2f} {right:+.2f}", float(value))
            for (left, right), value in zip(ends, outputs[:, 2], strict=True)
        ]


@compiled
def learn_wires(robots, lesson, networks, action, errors, wires):
    """Learn from the last action and choose the next; return a code, see `Lesson`."""
    distance, kind, command, layer = robots.distance, robots.kind, robots.command, robots.layer
    ranges, weights, inputs, lessons = networks.ranges, networks.weights, networks.inputs, networks.lessons
    rewards, temperature, bumps, pace = networks.rewards, networks.temperature, networks.bumps, networks.pace
    reward, rates, cooling, bumping = networks.reward, networks.rates, networks.cooling, networks.bumping
    gamma, alert, critical = networks.discounts
    shared, self_adjusting, frozen, afterwards = networks.options
    now, hidden = np.empty((1, inputs.shape[1])), np.empty((OUTPUTS * wires, weights[0].shape[2]))
    ends, values = np.empty((wires, 2)), np.empty(wires)
    diverged = -1
    for i in range(layer.shape[0]):
        first = 0 if shared else i * OUTPUTS * wires
        nearest = write_inputs(distance, kind, ranges, i, robots.design[i], now, 0)
        propose(weights, first, now, 0, hidden, ends, values)
        if not math.isnan(action[i, 0]):
            reading = nearest if afterwards else least_of(inputs, i, distance.shape[1])
            rewards[i] = rewarded(reward, reading, action[i, 0], action[i, 1], critical)
            rate = rate_of(rates, temperature[i], cooling)
            discount = discount_of(gamma, alert, bumps[i], bumping[0], self_adjusting)
            target = rewards[i] + discount * values[best_of(values)]
            if not frozen and not learn_wire_value(
                weights, first, inputs, i, hidden, ends, values, action, target, rate
            ):
                diverged = i if diverged < 0 else diverged
            elif not frozen:
                lessons[i] += 1
            propose(weights, first, now, 0, hidden, ends, values)
        if not frozen:
            ahead = 0.5 * (action[i, 0] + action[i, 1]) if not math.isnan(action[i, 0]) else bumping[3]
            adapt(distance, i, ahead, temperature, bumps, pace, cooling, bumping, self_adjusting)
        action[i, 0] = math.nan
        if layer[i] < 0:
            w = chosen(values, temperature[i], lesson.chance[i])
            for side in range(2):
                tried = ends[w, side] + temperature[i] * errors[i, side]
                action[i, side] = min(max(tried, -1.0), 1.0)
                command[i, side] = robots.max_speed[i] * action[i, side]
            layer[i] = robots.place
        for k in range(inputs.shape[1]):
            inputs[i, k] = now[0, k]
    return end_lesson(lesson, diverged)


@compiled
def learn_wire_value(weights, first, inputs, i, hidden, ends, values, action, target, rate):
    """Move Q of the action of robot i to its target; return False, changing nothing, if it diverges."""
    inner, inner_bias, outer, outer_bias = weights
    wires = values.shape[0]
    propose(weights, first, inputs, i, hidden, ends, values)
    by_end, by_value = np.empty((wires, 2)), np.empty(wires)
    value = interpolate(action[i, 0], action[i, 1], ends, values, SMOOTHING, TINY, by_end, by_value)
    step = rate * (target - value)
    steps = np.empty(OUTPUTS * wires)
    bounded = abs(step) <= LARGEST
    for w in range(wires):
        for side in range(2):
            steps[OUTPUTS * w + side] = step * (by_end[w, side] * (1.0 - ends[w, side] * ends[w, side]))
        steps[OUTPUTS * w + 2] = step * by_value[w]
    for m in range(OUTPUTS * wires):
        bounded = bounded and is_bounded(outer, first + m, steps[m])
    if bounded:
        for m in range(OUTPUTS * wires):
            back_propagate(inner, inner_bias, outer, outer_bias, first + m, inputs, i, hidden[m], steps[m])
    return bounded
