"""HebbianLearning: distance sensors take over a reflex to contacts, by Hebb's rule (distributed adaptive control)."""

import math
import warnings
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.control.layer import RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import sin
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals, RealTables
from mesa_swarm.learning.actions import ranges_of
from mesa_swarm.learning.learner import (
    NUMBER,
    POSITIVE,
    SHARE,
    UNBORN,
    Check,
    Declared,
    Lesson,
    RewardedLayer,
    begin_lesson,
    end_lesson,
)
from mesa_swarm.learning.reflex_policy import CONSTANT, WHIM, ReflexPolicy, nearness
from mesa_swarm.learning.rewards import REWARDS, rewarded

# Of the former rule, which learned from rewards of random trials and did not learn to avoid; they have no effect.
WITHOUT_EFFECT = ("trace", "gamma", "average", "jitter", "persistence")
# Sensors that look at most this far from straight ahead, rad, feel contacts ahead; the others behind.
ASIDE = math.pi / 2 + 1e-9


@dataclass(kw_only=True)
class HebbianLearning(RewardedLayer[ReflexPolicy]):
    """Learn to turn away before a contact from what is sensed during contacts, by Hebb's rule; always active.

    Each robot drives by ``u = c + W' x + U`` within [-1, 1], with x the proximities (0 nothing near, 1 touching), c
    a constant, (1, 1) at first: straight ahead, and U the reflex to a contact, a reading of at most `contact`: ahead or
    at the side, one wheel turns back, U = (0, -2) where the contact is on the left, otherwise (-2, 0); behind, (1, 1)
    is added. In each step with a contact

        ``W <- W + eta (U x' - forgetting W)``

    so that what the sensors read during a contact comes to have the reflex's effect, and has it earlier, since
    sensors look ahead: the distributed adaptive control of [1]_, here with weights straight to the wheels. Contacts
    then become rare, and with them learning. Weights stay within [-limit, limit]. No reward is needed, nor chance.
    Its state outlasts a change of controls as that of `QLearning`.

    Parameters
    ----------
    eta : float
        Rate, 0 to 1.
    forgetting : float
        How much of a weight is forgotten for what is added: U x' / forgetting is where weights end. 0 to 1.
    contact : float
        The largest reading that counts as a contact, map units, at least 0.
    limit : float
        Of the weights, above 0.
    reward : str
        "a", "b" or "c", see `learning.rewards`: what `last_reward` is; nothing is learned from it.
    critical : float
        Of that reward, as for `QLearning`, but 0.4 of the range by default, the thesis's number, where that layer
        has 0.08.
    frozen : bool
        Whether it only acts, without the reflex to contacts or learning; this requires a trained `start`.
    start : ReflexPolicy, optional
        The initial policy of new robots: without hidden units or whim, of distances, linear; by default one that
        drives straight ahead.
    trace, gamma, average, jitter, persistence : float, optional
        Without effect and deprecated: of a former rule, which learned from rewards of random trials.

    Raises
    ------
    InvalidValueError, UnknownNameError
    LearningError
        If it is frozen and has no trained start.

    References
    ----------
    .. [1] Verschure, Krose and Pfeifer, Distributed adaptive control: the self-organization of structured behavior,
       Robotics and Autonomous Systems 9 (1992); Pfeifer and Scheier, Understanding Intelligence (1999), chapter 5.

    Examples
    --------
    >>> HebbianLearning(eta=0.1).forgetting
    0.1
    """

    policy_class = ReflexPolicy
    draws = False
    learned = ("weights", "constant")
    stated = ("eta", "forgetting", "contact", "limit")
    checks: ClassVar[dict[str, Check]] = {
        "forgetting": SHARE,
        "contact": partial(check_number, minimum=0, maximum=1e6),
        "limit": POSITIVE,
    }
    eta: float = 0.03
    forgetting: float = 0.1
    contact: float = 1.0
    limit: float = 10.0
    reward: str = "c"
    critical: float = 0.4
    frozen: bool = False
    start: ReflexPolicy | None = None
    trace: float | None = None
    gamma: float | None = None
    average: float | None = None
    jitter: float | None = None
    persistence: float | None = None
    name: str = "HebbianLearning"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._warn_of_what_has_no_effect()

    def _warn_of_what_has_no_effect(self) -> None:
        """Warn of parameters of the former rule."""
        for name in WITHOUT_EFFECT:
            if getattr(self, name) is not None:
                text = f"{name} of HebbianLearning has no effect and will be removed: it no longer learns from rewards"
                warnings.warn(text, DeprecationWarning, stacklevel=4)

    def _check_start(self) -> None:
        """Check that a start has only linear weights from distances to wheels."""
        start = self.start
        if start is not None:
            if not isinstance(start, ReflexPolicy) or start.memory:
                raise InvalidValueError(f"start is {shortened(start)}; expected a ReflexPolicy without hidden units")
            if (start.encoding, start.squash) != ("distance", "linear"):
                raise InvalidValueError(
                    f"start has encoding {start.encoding!r} and squash {start.squash!r}; "
                    "expected 'distance' and 'linear'"
                )
            if start.wheel[:, WHIM].any():
                raise InvalidValueError("start has weights of the whim, which this does not learn; expected 0")
        super()._check_start()

    def _columns(self) -> dict[str, Declared]:
        """Return the columns: weights, constants, last commands and reward."""
        return {
            "weights": (("proximity", 2), np.float64, 0.0),
            "constant": ((2,), np.float64, 1.0),
            "command": ((2,), np.float64, math.nan),
            "reward": NUMBER,
        }

    def _fields_of_policy(self) -> dict[str, np.ndarray]:
        whim, constant = np.zeros((len(self._robots), 1, 2)), self._column("constant")[:, None]
        wheel = np.concatenate([self._column("weights"), whim, constant], axis=1)
        return {"hidden": np.zeros((*wheel.shape[:2], 0)), "wheel": wheel}

    def _sets_of_start(self) -> dict[str, np.ndarray]:
        wheel: Any = self.start.wheel if self.start else ()
        return {"weights": wheel[:, :WHIM], "constant": wheel[:, CONSTANT]}

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "HebbianRule"]:
        """Return what learns and drives."""
        rule: Any = (
            ranges_of(senses.sensors),
            np.empty(senses.distance.shape[1]),
            *map(self._column, ("weights", "constant", "command", "reward", "lessons")),
            (REWARDS.index(self.reward), float(self.critical)),
            (float(self.eta), float(self.forgetting), float(self.limit)),
            float(self.contact),
            bool(self.frozen),
        )
        return associate, HebbianRule(robots, self._lesson(), *rule)


class HebbianRule(NamedTuple):
    """What `associate` takes.

    Parameters
    ----------
    robots : RobotColumns
    lesson : Lesson
    ranges : ndarray, shape (d, s)
    inputs : ndarray, shape (s,)
        Of one robot.
    weights, constant, last, rewards, lessons : ndarrays of n rows
        Columns of robots; `last` are their last commands.
    paying : (int, float)
        A place in `REWARDS`, and the critical reading.
    rates : tuple of float
        Eta, forgetting and the limit of weights.
    contact : float
    frozen : bool
    """

    robots: RobotColumns
    lesson: Lesson
    ranges: RealRows
    inputs: Reals
    weights: RealTables
    constant: RealRows
    last: RealRows
    rewards: Reals
    lessons: Integers
    paying: tuple[int, float]
    rates: tuple[float, float, float]
    contact: float
    frozen: bool


@compiled(nogil=True)
def associate(block, step, first_row, last_row):
    """Learn from the contacts of each robot, and drive it by its weights and its reflex."""
    rule = unpack(block, HebbianRule)
    if not begin_lesson(rule.lesson):
        return UNBORN
    robots, inputs, weights, constant, last = rule.robots, rule.inputs, rule.weights, rule.constant, rule.last
    distance, layer, paying, frozen = robots.distance, robots.layer, rule.paying, rule.frozen
    for i in range(layer.shape[0]):
        nearest = 0.0
        for s in range(inputs.shape[0]):
            inputs[s] = nearness(distance[i, s], rule.ranges[robots.design[i], s])
            nearest = max(nearest, inputs[s])
        own = not math.isnan(last[i, 0])
        if own:
            rule.rewards[i] = rewarded(paying[0], 1.0 - nearest, last[i, 0], last[i, 1], paying[1])
        left, right = (0.0, 0.0) if frozen else reflex_to(distance, robots.bearing, i, robots.design[i], rule.contact)
        wheels = constant[i, 0], constant[i, 1]
        for s in range(inputs.shape[0]):
            wheels = wheels[0] + weights[i, s, 0] * inputs[s], wheels[1] + weights[i, s, 1] * inputs[s]
        if own and not frozen:
            rule.lessons[i] += 1
            strengthen(weights, i, inputs, left, right, rule.rates)
        last[i, 0] = math.nan
        if layer[i] < 0:
            last[i, 0] = min(max(wheels[0] + left, -1.0), 1.0)
            last[i, 1] = min(max(wheels[1] + right, -1.0), 1.0)
            robots.command[i, 0] = robots.max_speed[i] * last[i, 0]
            robots.command[i, 1] = robots.max_speed[i] * last[i, 1]
            layer[i] = robots.place
    return end_lesson(rule.lesson, -1)  # weights are limited


@compiled
def reflex_to(distance, bearing, i, d, contact):
    """Return what the contacts of robot i add to its left and right wheel."""
    ahead, behind, side = False, False, 0.0
    for s in range(distance.shape[1]):
        if 0.0 <= distance[i, s] <= contact:
            if abs(bearing[d, s]) <= ASIDE:
                ahead = True
                side += sin(bearing[d, s])
            else:
                behind = True
    push = 1.0 if behind else 0.0
    if not ahead:
        return push, push
    return (push, push - 2.0) if side > 0.0 else (push - 2.0, push)


@compiled
def strengthen(weights, i, inputs, left, right, rates):
    """Add ``eta (U x' - forgetting W)`` to the weights of robot i where there is a reflex, within their limits."""
    if left == 0.0 and right == 0.0:
        return
    eta, forgetting, limit = rates
    for s in range(inputs.shape[0]):
        for side, reflex in ((0, left), (1, right)):
            changed = weights[i, s, side] + eta * (reflex * inputs[s] - forgetting * weights[i, s, side])
            weights[i, s, side] = min(max(changed, -limit), limit)
