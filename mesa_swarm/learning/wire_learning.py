"""WireFittedQ: Q-learning with continuous actions, by wire fitting (thesis 7.3.2, 10.3)."""

import math
from dataclasses import dataclass

import numpy as np

from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import check_count, check_name, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import best_of, chosen, write_inputs
from mesa_swarm.learning.learner import LARGEST, Learner, cool, is_bounded
from mesa_swarm.learning.networks import back_propagate
from mesa_swarm.learning.rewards import rewarded
from mesa_swarm.learning.wire_fitting import SMOOTHING, TINY, interpolate
from mesa_swarm.learning.wire_policy import OUTPUTS, STARTS, WirePolicy, propose
from mesa_swarm.robots.swarm import Swarm


@dataclass(kw_only=True)
class WireFittedQ(Learner):
    """Learn which wheel commands pay, any between full speed back and full speed ahead; always active.

    Networks propose a few actions, the wires, and say what each is worth; what lies between is interpolated, see
    `wire_fitting.wire_value`. Every step, Q(s, u) of the action u that was taken is moved by back-propagation
    through the interpolation towards ``Q + alpha (r + gamma q_max(s') - Q)``. A wire is chosen by Boltzmann's
    probabilities, and a normal error of `jitter` times the temperature added to each wheel.

    Parameters
    ----------
    wires : int
        1 to 8; they begin near the thesis's actions, in their order.
    jitter : float
        Share of max_speed at temperature 1, at least 0.
    reward, encoding, alpha, eta, gamma, beta, first_temperature, last_temperature, critical, shared, \
self_adjusting, bump_rate, bump_window, bump_distance, frozen
        As for `QLearning`.
    start : WirePolicy, optional
        What robots know when they are born.

    Raises
    ------
    InvalidValueError, UnknownNameError, LearningError
        As for `QLearning`.

    Examples
    --------
    >>> WireFittedQ(wires=5).reward
    'c'
    """

    wires: int = 4
    jitter: float = 0.2
    reward: str = "c"
    start: WirePolicy | None = None
    name: str = "WireFittedQ"

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_name("name", self.name)
        check_count("wires", self.wires, minimum=1, maximum=len(STARTS))
        check_number("jitter", self.jitter, minimum=0, maximum=10)
        self._check_rates()
        self._check_start(WirePolicy, self.wires)

    @property
    def _count(self) -> int:
        return OUTPUTS * self.wires

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns, of each robot's last action too."""
        super()._remember(swarm, prefix)
        swarm.remember(f"{prefix}.action", (2,), np.float64, math.nan)

    def policy(self, **training: str | float) -> WirePolicy:
        """Return what the robots have learned so far as a policy that no longer learns; see `QLearning.policy`."""
        return WirePolicy(wires=self.wires, **self._learned(training))

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Learn from the last action, and choose the next one for robots that no other layer drives.

        Raises
        ------
        LearningError
            If what a robot is to learn lies beyond all bounds; all that it learned before is kept.
        """
        known = self._known(senses)
        errors = float(self.jitter) * self._rng.normal(size=(len(layer), 2))
        self._end_lesson(learn_wires(*known, errors, self.wires, command, layer, index))

    def worth(self, row: int) -> list[tuple[str, float]]:
        """Return what each wire is worth to a robot where it was when it chose last; see `QLearning.worth`."""
        if np.isnan(self._column("action")[row, 0]):
            return []
        said = self._said(row, OUTPUTS * self.wires).reshape(self.wires, OUTPUTS)
        ends = np.tanh(said[:, :2] + np.arctanh(STARTS[: self.wires]))
        return [
            (f"wheels {left:+.2f} {right:+.2f}", float(value))
            for (left, right), value in zip(ends, said[:, 2], strict=True)
        ]


@compiled
def learn_wires(
    distance, kind, ranges, design, max_speed, weights, inputs, action, lessons, memory, chance,
    reward, rates, cooling, bumping, options, errors, wires, command, layer, index,
):  # fmt: skip
    """Learn from the last action and choose the next; return a robot whose values diverged, or -1."""
    rewards, temperature, bumps = memory
    rate, gamma, critical = rates
    shared, self_adjusting, frozen = options
    now, hidden = np.empty((1, inputs.shape[1])), np.empty((OUTPUTS * wires, weights[0].shape[2]))
    ends, values = np.empty((wires, 2)), np.empty(wires)
    diverged = -1
    for i in range(layer.shape[0]):
        first = 0 if shared else i * OUTPUTS * wires
        nearest = write_inputs(distance, kind, ranges, i, design[i], now, 0)
        propose(weights, first, now, 0, hidden, ends, values)
        if not math.isnan(action[i, 0]):
            rewards[i] = rewarded(reward, nearest, action[i, 0], action[i, 1], critical)
            wanted = rewards[i] + gamma * values[best_of(values)]
            if not frozen and not learn_one(weights, first, inputs, i, hidden, ends, values, action, wanted, rate):
                diverged = i if diverged < 0 else diverged
            elif not frozen:
                lessons[i] += 1
            propose(weights, first, now, 0, hidden, ends, values)
        if not frozen:
            cool(distance, i, temperature, bumps, cooling, bumping, self_adjusting)
        action[i, 0] = math.nan
        if layer[i] < 0:
            w = chosen(values, temperature[i], chance[i])
            for side in range(2):
                tried = ends[w, side] + temperature[i] * errors[i, side]
                action[i, side] = min(max(tried, -1.0), 1.0)
                command[i, side] = max_speed[i] * action[i, side]
            layer[i] = index
        for k in range(inputs.shape[1]):
            inputs[i, k] = now[0, k]
    return diverged


@compiled
def learn_one(weights, first, inputs, i, hidden, ends, values, action, wanted, rate):
    """Move Q of what robot i did to what is wanted; return whether that was within bounds, else change nothing."""
    inner, inner_bias, outer, outer_bias = weights
    wires = values.shape[0]
    propose(weights, first, inputs, i, hidden, ends, values)
    by_end, by_value = np.empty((wires, 2)), np.empty(wires)
    value = interpolate(action[i, 0], action[i, 1], ends, values, SMOOTHING, TINY, by_end, by_value)
    step = rate * (wanted - value)
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
