"""HebbianLearning: reflexes strengthened where random trials were rewarded more than expected."""

import math
from dataclasses import dataclass

import numpy as np

from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import InvalidValueError, check_choice, check_flag, check_name, check_number, shortened
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import ranges_of
from mesa_swarm.learning.learner import LARGEST, LearningLayer
from mesa_swarm.learning.policy import sensors_of
from mesa_swarm.learning.reflex_policy import ReflexPolicy, nearness
from mesa_swarm.learning.rewards import REWARDS, rewarded
from mesa_swarm.robots.swarm import Swarm

# Stored in a policy's `training`.
TRAINING_PARAMETERS = ("reward", "eta", "trace", "gamma", "average", "jitter", "persistence", "critical")


@dataclass(kw_only=True)
class HebbianLearning(LearningLayer):
    """Learn weights from readings to wheels by a Hebbian rule that reward modulates; always active.

    Each robot drives by ``u = W' x`` within [-1, 1], with x the proximities (0 nothing near, 1 touching) and a
    constant, plus noise: wheels = u + z within [-1, 1]; z is normal with standard deviation `jitter` and
    autocorrelation `persistence` from step to step. Each robot also learns how much reward to expect, ``v' x``. In
    each step, with r the reward for the last action, x the inputs before and y those after it,

        ``d = r + gamma v' y - v' x``, ``e <- trace e + x z``, ``W <- W + eta d e``, ``v <- v + average d x``

    so that a trial z at x is strengthened if it led to more reward than expected there: a Hebbian rule with a third
    factor [1]_, the surprise, and a trace for rewards that come late. Weights stay within [-limit, limit].
    Its state outlasts a change of controls as that of `QLearning`.

    Parameters
    ----------
    reward : str
        "a", "b" or "c", see `learning.rewards`.
    eta : float
        Rate, 0 to 1.
    trace : float
        How much of the past is still given credit one step later, 0 to below 1.
    gamma : float
        Discount of later rewards, 0 to below 1.
    average : float
        How fast expectations follow, above 0, at most 1.
    jitter : float
        Standard deviation of the trials, as a share of max_speed, 0 to 1.
    persistence : float
        Autocorrelation of trials, since one step moves a robot too little. 0 to below 1.
    critical : float
        As for `QLearning`, but 0.4 of the range by default, the thesis's number, where that layer has 0.08.
    limit : float
        Of the weights, above 0.
    frozen : bool
        Whether it only acts, without trials or learning; this requires a trained `start`.
    start : ReflexPolicy, optional
        The initial policy of new robots: without hidden units or whim, of distances, linear; small random
        weights by default. Expectations start at 0.

    Raises
    ------
    InvalidValueError, UnknownNameError
    LearningError
        If it is frozen and has no trained start.

    References
    ----------
    .. [1] Fremaux and Gerstner, Neuromodulated spike-timing-dependent plasticity, and theory of three-factor learning
       rules, Frontiers in Neural Circuits 9 (2016); for rates: Legenstein, Chase, Schwartz and Maass, A
       reward-modulated Hebbian learning rule can explain experience-dependent network reorganization in a brain
       control task, Journal of Neuroscience 30 (2010).

    Examples
    --------
    >>> HebbianLearning(reward="c").trace
    0.8
    """

    reward: str = "c"
    eta: float = 0.005
    trace: float = 0.8
    gamma: float = 0.9
    average: float = 0.02
    jitter: float = 0.2
    persistence: float = 0.9
    critical: float = 0.4
    limit: float = 4.0
    frozen: bool = False
    start: ReflexPolicy | None = None
    name: str = "HebbianLearning"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_choice("reward", self.reward, REWARDS)
        for name in ("eta", "jitter"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)
        for name in ("trace", "gamma", "persistence"):
            check_number(name, getattr(self, name), minimum=0, maximum=0.999)
        for name in ("average", "critical"):
            check_number(name, getattr(self, name), above=0, maximum=1)
        check_number("limit", self.limit, above=0, maximum=1e6)
        self.frozen = check_flag("frozen", self.frozen)
        if self.start is not None:
            self._check_reflex(self.start)
        self._check_frozen()

    @staticmethod
    def _check_reflex(start: object) -> None:
        """Check that a start has only linear weights from distances to wheels."""
        if not isinstance(start, ReflexPolicy) or start.memory:
            raise InvalidValueError(f"start is {shortened(start)}; expected a ReflexPolicy without hidden units")
        if (start.encoding, start.squash) != ("distance", "linear"):
            raise InvalidValueError(
                f"start has encoding {start.encoding!r} and squash {start.squash!r}; expected 'distance' and 'linear'"
            )
        if start.wheel[:, -2].any():
            raise InvalidValueError("start has weights of the whim, which this does not learn; expected 0")

    def _start_elsewhere(self) -> None:
        """Let the robots of another model start with the weights that were learned."""
        if self._column("lessons").any():
            self.start = self.policy()

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns: weights and traces, last inputs, commands and reward, and expectations."""
        self._check_sensors()
        columns: dict[str, tuple[tuple[int | str, ...], type, object]] = {
            "weights": (("proximity", 2), np.float64, 0.0),
            "constant": ((2,), np.float64, 0.0),
            "trace": (("proximity", 2), np.float64, 0.0),
            "constant_trace": ((2,), np.float64, 0.0),
            "command": ((2,), np.float64, math.nan),
            "tried": ((2,), np.float64, 0.0),
            "reward": ((), np.float64, 0.0),
            "seen": (("proximity",), np.float64, 0.0),
            "expected": (("proximity",), np.float64, 0.0),
            "usual": ((), np.float64, 0.0),
            "lessons": ((), np.int64, 0),
            "born": ((), np.bool_, False),
        }
        for name, (shape, dtype, initial) in columns.items():
            swarm.remember(f"{prefix}.{name}", shape, dtype, initial)

    def policy(self, **training: str | float) -> ReflexPolicy:
        """Return what the robots have learned so far as reflexes that no longer learn; see `QLearning.policy`."""
        sensors = sensors_of(self._robots)
        self._init_new_robots()
        whim, constant = np.zeros((len(self._robots), 1, 2)), self._column("constant")[:, None]
        wheel = np.concatenate([self._column("weights"), whim, constant], axis=1)
        return ReflexPolicy(
            sensors=sensors,
            hidden=np.zeros((*wheel.shape[:2], 0)),
            wheel=wheel,
            **self._training(TRAINING_PARAMETERS, training),
        )

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Learn from the last action, and try the next one with robots that no other layer drives.

        Expectations that diverge are an error that names the robot; what was learned before is unchanged.
        """
        self._init_new_robots()
        self._draw_trials(self._column("tried"))
        diverged = learn_and_try(
            senses.distance,
            ranges_of(senses.sensors),
            senses.design,
            senses.max_speed,
            tuple(map(self._column, ("weights", "constant", "trace", "constant_trace"))),
            self._column("command"),
            tuple(map(self._column, ("reward", "lessons"))),
            tuple(map(self._column, ("seen", "expected", "usual"))),
            self._column("tried"),
            REWARDS.index(self.reward),
            (float(self.eta), float(self.trace), float(self.limit)),
            (float(self.gamma), float(self.average), float(self.critical)),
            bool(self.frozen),
            command,
            layer,
            index,
        )
        self._check_diverged(diverged, "its expectations grow beyond all bounds; lower average or gamma")

    @property
    def last_reward(self) -> np.ndarray:
        """Every robot's reward for its last action (n,); a copy."""
        return self._column("reward").copy()

    def _draw_trials(self, tried: np.ndarray) -> None:
        """Draw the next trials (n, 2); frozen robots try nothing."""
        if self.frozen:
            tried.fill(0.0)
            return
        persistence = float(self.persistence)
        fresh = float(self.jitter) * math.sqrt(1.0 - persistence**2)
        tried[:] = persistence * tried + fresh * self._rng.normal(size=tried.shape)

    def _init_robots(self, new: np.ndarray, known: np.ndarray) -> None:
        """Initialise the weights of new robots."""
        weights, constant = self._column("weights"), self._column("constant")
        if self.start is None:
            weights[new] = self._rng.uniform(-0.1, 0.1, (len(new), *weights.shape[1:]))
            constant[new] = self._rng.uniform(-0.1, 0.1, (len(new), 2))
        else:
            wheel = self.start.wheel[self._robots.columns["number"][new] % len(self.start.wheel)]
            weights[new], constant[new] = wheel[:, :-2], wheel[:, -1]


@compiled
def learn_and_try(
    distance, ranges, design, max_speed, weights, last, counts, critic, tried, reward, rates, expecting, frozen,
    command, layer, index,
):  # fmt: skip
    """Learn from the last action and try the next; return a robot whose expectations diverged, or -1."""
    rewards, lessons = counts
    diverged = -1
    inputs = np.empty(distance.shape[1])
    for i in range(layer.shape[0]):
        nearest = 0.0
        for s in range(inputs.shape[0]):
            inputs[s] = nearness(distance[i, s], ranges[design[i], s])
            nearest = max(nearest, inputs[s])
        if not math.isnan(last[i, 0]):
            rewards[i] = rewarded(reward, 1.0 - nearest, last[i, 0], last[i, 1], expecting[2])
            if not frozen:
                surprise = surprised(critic, i, rewards[i], inputs, expecting)
                if abs(surprise) <= LARGEST:
                    strengthen(weights, i, surprise, rates)
                    lessons[i] += 1
                else:
                    diverged = i if diverged < 0 else diverged
        last[i, 0] = math.nan
        if layer[i] < 0:
            try_wheels(weights, i, inputs, tried, rates[1], last)
            command[i, 0] = max_speed[i] * last[i, 0]
            command[i, 1] = max_speed[i] * last[i, 1]
            layer[i] = index
        for s in range(inputs.shape[0]):
            critic[0][i, s] = inputs[s]
    return diverged


@compiled
def surprised(critic, i, reward, inputs, expecting):
    """Return ``r + gamma v' y - v' x`` of robot i, and correct its expectations, unless it is beyond bounds."""
    seen, expected, usual = critic
    gamma, average = expecting[0], expecting[1]
    before, after = usual[i], usual[i]
    for s in range(inputs.shape[0]):
        before += expected[i, s] * seen[i, s]
        after += expected[i, s] * inputs[s]
    surprise = reward + gamma * after - before
    if abs(surprise) <= LARGEST:
        usual[i] += average * surprise
        for s in range(inputs.shape[0]):
            expected[i, s] += average * surprise * seen[i, s]
    return surprise


@compiled
def strengthen(weights, i, surprise, rates):
    """Add ``eta d e`` to the weights of robot i, within their limits."""
    into, constant, trace, constant_trace = weights
    step, limit = rates[0] * surprise, rates[2]
    for side in range(2):
        for s in range(into.shape[1]):
            into[i, s, side] = min(max(into[i, s, side] + step * trace[i, s, side], -limit), limit)
        constant[i, side] = min(max(constant[i, side] + step * constant_trace[i, side], -limit), limit)


@compiled
def try_wheels(weights, i, inputs, tried, decay, last):
    """Write the wheel speeds of robot i to `last`, and add its trial to its trace."""
    into, constant, trace, constant_trace = weights
    for side in range(2):
        total = constant[i, side]
        for s in range(inputs.shape[0]):
            total += into[i, s, side] * inputs[s]
        wanted = min(max(total, -1.0), 1.0)
        last[i, side] = min(max(wanted + tried[i, side], -1.0), 1.0)
        # The trial before limiting, whose mean is 0: at full speed any bad surprise would otherwise strengthen it.
        for s in range(inputs.shape[0]):
            trace[i, s, side] = decay * trace[i, s, side] + inputs[s] * tried[i, side]
        constant_trace[i, side] = decay * constant_trace[i, side] + tried[i, side]
