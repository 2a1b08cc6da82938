"""Learning to fight fires by wheel speeds: Q-networks that all robots share, and shaped rewards."""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_number
from mesa_swarm.control.layer import RobotColumns, Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals, RealTables
from mesa_swarm.learning.actions import ACTIONS, action_of, best_of, chosen, drive_by_action, ranges_of
from mesa_swarm.learning.fire_learning import body_of
from mesa_swarm.learning.learner import (
    CHECKS,
    COUNT,
    INDEX,
    LARGEST,
    NUMBER,
    POSITIVE,
    UNBORN,
    Check,
    Declared,
    Lesson,
    NetworkLayer,
    begin_lesson,
    end_lesson,
)
from mesa_swarm.learning.networks import Networks, PolicyOfNetworks
from mesa_swarm.learning.policy import SensorLayout, check_designs
from mesa_swarm.learning.q_learning import action_values, learn_network_value
from mesa_swarm.robots.design import AGENT_FIRE
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.world.statics import FIRE, ROBOT

NETWORKS, UNITS = len(ACTIONS), 16
# Inputs of a network: for each sensor its reading, whether it sees a robot, whether a fire; then radiation, the robot's
# own heat, and whether it is too hot, takes heat, extinguishes.
OF_SENSOR, OF_BODY = 3, 5
FREE, AT_FIRE, IN_HEAT, COOLING = range(4)
# Columns of each robot's last action.
REMEMBERED = ("inputs", "action", "situation", "age", "lessons", "gain", "seen", "temperature")
# Parameters of the reward.
SHAPING = ("work", "approach", "rest", "scorch", "ahead", "near")


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class FireWheelPolicy(PolicyOfNetworks):
    """Q-networks of the eight wheel actions, which robots learned at fires by `LearnFireWheels`.

    ``LearnFireWheels(start=policy, frozen=True)`` drives robots by it; `save_policy` and `load_policy` store it. Its
    inputs include a robot's heat, which is not among the readings with which `PolicyLayer` asks a `Policy`.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        Eight, each of 3 inputs a sensor and 5 more.
    hold : int
        Steps for which an action lasts, at least 1.
    temperature, steps, training
        As for `QPolicy`.

    Raises
    ------
    InvalidValueError
        If the networks do not fit the sensors.

    Examples
    --------
    >>> eyes = SensorLayout.of(AGENT_FIRE)
    >>> networks = Networks.random(8, inputs=32, hidden=16, rng=np.random.default_rng(1))
    >>> FireWheelPolicy(sensors=eyes, networks=networks).hold
    5
    """

    family: ClassVar[str] = "fire wheels"
    own_layer: ClassVar[str] = "LearnFireWheels"
    checks: ClassVar[dict[str, Check]] = {"temperature": POSITIVE, "hold": CHECKS["hold"]}
    group = NETWORKS
    sensors: SensorLayout
    networks: Networks
    temperature: float = 0.02
    hold: int = 5
    steps: int = 0
    training: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_networks()
        expected = (NETWORKS, OF_SENSOR * len(self.sensors) + OF_BODY, UNITS)
        if self.networks.inner.shape != expected:
            raise InvalidValueError(f"networks have the shape {self.networks.inner.shape}; expected {expected}")


@dataclass(kw_only=True)
class LearnFireWheels(NetworkLayer[FireWheelPolicy]):
    """Learn to find and extinguish fires by the eight wheel actions of the thesis; always active.

    All robots share one network for each action, of 16 hidden units, whose inputs are what `ExtinguishFires` lets
    robots observe: readings and the kinds of things, radiation, and the robot's own heat. An action lasts `hold` steps,
    or until the robot arrives at a fire, leaves it, becomes too hot, gets out of the heat, or is cool; then its network
    makes a step of back-propagation towards ``R + gamma^n max_a' Q(s', a')``, with R the discounted reward of the n
    steps, and the next action is chosen by Boltzmann's probabilities (7.4). No skill is given, and no layer need avoid
    collisions: rewards lead robots there. A step is worth

    - `work` while the robot extinguishes;
    - `-scorch` while it is too hot and takes heat;
    - `rest` while it is too hot, takes no heat and sees a fire;
    - otherwise `approach` for each max_speed by which the nearest fire that it sees came nearer, or, seeing none,
      `ahead` times its mean wheel speed as a share of max_speed;
    - and `near` (reading / `margin` - 1) for the nearest obstacle or robot within `margin`.

    Parameters
    ----------
    work, approach, rest, scorch, ahead, near : float
        At least 0.
    margin : float
        Map units, above 0.
    eta : float
        Rate of back-propagation, 0 to 1.
    gamma, beta, first_temperature, last_temperature, hold
        As for `LearnFires`.
    full_heat : float
        The heat that counts as 1 among the inputs, above 0.
    frozen : bool
        Whether it only acts, without learning; this requires a trained `start`.
    start : FireWheelPolicy, optional
        The initial policy, small random weights by default.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.
    LearningError
        If it is frozen and has no trained start, or robots have other proximity sensors than AGENT_FIRE.

    Examples
    --------
    >>> LearnFireWheels(eta=0.05).hold
    5
    """

    policy_class = FireWheelPolicy
    of_policies = ("hold",)
    stated = (*SHAPING, "gamma", "eta", "beta")
    checks: ClassVar[dict[str, Check]] = {
        **dict.fromkeys(SHAPING, partial(check_number, minimum=0, maximum=1000)),
        **dict.fromkeys(("margin", "full_heat"), POSITIVE),
    }
    shared = True
    units = (UNITS,)
    work: float = 0.1
    approach: float = 0.1
    rest: float = 0.05
    scorch: float = 0.1
    ahead: float = 0.03
    near: float = 0.1
    margin: float = 8.0
    gamma: float = 0.97
    eta: float = 0.05
    beta: float = 2e-4
    first_temperature: float = 0.3
    last_temperature: float = 0.02
    hold: int = 5
    full_heat: float = 100.0
    frozen: bool = False
    start: FireWheelPolicy | None = None
    name: str = "LearnFireWheels"

    @property
    def _count(self) -> int:
        return NETWORKS

    @property
    def _layout(self) -> SensorLayout:
        return SensorLayout.of(AGENT_FIRE) if self.start is None else self.start.sensors

    @property
    def _inputs(self) -> tuple[int | str, ...]:
        return (OF_SENSOR * len(self._layout) + OF_BODY,)

    def _check_sensors(self) -> None:
        """Check that all robots have the sensors of the networks."""
        check_designs(self._layout, self._robots)

    def _columns(self) -> dict[str, Declared]:
        """Return the columns: networks, the last inputs, action and situation, and what the action has gained."""
        return {
            **super()._columns(),
            "inputs": (self._inputs, np.float64, 0.0),
            **dict.fromkeys(("action", "situation"), INDEX),
            "age": COUNT,
            "gain": NUMBER,
            "seen": ((), np.float64, -1.0),
        }

    def _init_robots(self, new: np.ndarray, others: np.ndarray) -> None:
        """Give new robots the networks that are shared."""
        if len(others) and self.start is None:
            self._begin(new)  # which is overwritten: robots that come later have always drawn too
        super()._init_robots(new, others)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "WheelRule"]:
        """Return what learns and chooses."""
        _, inputs, hidden = self._weights[0].shape
        rule: Any = (
            ranges_of(senses.sensors),
            self._weights,
            *map(self._column, REMEMBERED),
            tuple(float(getattr(self, name)) for name in (*SHAPING, "margin")),
            (float(self.gamma), float(self.eta), float(self.beta), float(self.last_temperature)),
            int(self.hold),
            float(self.full_heat),
            bool(self.frozen),
            np.empty((1, inputs)),
            np.empty(hidden),
            np.empty(NETWORKS),
        )
        return learn_wheels, WheelRule(robots, self._lesson(), *rule)

    def reason(self, moment: Moment) -> Reason:
        """Return the chosen action."""
        return Reason(f"it chose {action_of(moment.command)}, by what it learned and by chance")


class WheelRule(NamedTuple):
    """What `learn_wheels` takes.

    Parameters
    ----------
    robots : RobotColumns
    lesson : Lesson
    ranges : ndarray, shape (d, s)
    weights : tuple of ndarrays
        Of the networks, see `networks.forward`.
    inputs, action, situation, age, lessons, gain, seen, boltzmann : ndarrays of n rows
        The columns `REMEMBERED`.
    shaping : tuple of float
        `SHAPING`, and the margin.
    rates : tuple of float
        Gamma, eta, beta and T_c.
    hold : int
    full_heat : float
    frozen : bool
    now, hidden, values : ndarrays
        For inputs, units and outputs of one robot.
    """

    robots: RobotColumns
    lesson: Lesson
    ranges: RealRows
    weights: tuple[RealTables, RealRows, RealRows, Reals]
    inputs: RealRows
    action: Integers
    situation: Integers
    age: Integers
    lessons: Integers
    gain: Reals
    seen: Reals
    boltzmann: Reals
    shaping: tuple[float, float, float, float, float, float, float]
    rates: tuple[float, float, float, float]
    hold: int
    full_heat: float
    frozen: bool
    now: RealRows
    hidden: Reals
    values: Reals


@compiled(nogil=True)
def learn_wheels(block, step, first_row, last_row):
    """Learn from the last step of each robot, and choose actions where due."""
    rule = unpack(block, WheelRule)
    if not begin_lesson(rule.lesson):
        return UNBORN
    robots, weights, now, hidden, values = rule.robots, rule.weights, rule.now, rule.hidden, rule.values
    temperature, heat, hot, fire, layer = robots.temperature, robots.heat, robots.hot, robots.fire, robots.layer
    inputs, action, situation, age, lessons = rule.inputs, rule.action, rule.situation, rule.age, rule.lessons
    gain, seen, boltzmann, frozen = rule.gain, rule.seen, rule.boltzmann, rule.frozen
    gamma, eta, beta, coolest = rule.rates
    diverged = -1
    for i in range(layer.shape[0]):
        states = body_of(fire[i] >= 0, hot[i], heat[i])
        nearest, clearance = write_sight(robots.distance, robots.kind, rule.ranges[robots.design[i]], i, now)
        rest = now.shape[1] - OF_BODY
        now[0, rest], now[0, rest + 1] = feel_strongest(robots.radiation, i), min(temperature[i] / rule.full_heat, 1.0)
        now[0, rest + 2], now[0, rest + 3], now[0, rest + 4] = hot[i], heat[i] > 0.0, fire[i] >= 0
        if action[i] >= 0:
            moved = 0.5 * (robots.last_command[i, 0] + robots.last_command[i, 1]) / max(robots.max_speed[i], 1e-300)
            came = (seen[i] - nearest) / max(robots.max_speed[i], 1e-300)
            reward = shaped(states, nearest, seen[i], came, moved, clearance, rule.shaping)
            gain[i] += gamma ** age[i] * reward
            age[i] += 1
        seen[i] = nearest
        if action[i] < 0 or age[i] >= rule.hold or states != situation[i]:
            action_values(weights, 0, now, 0, hidden, values)
            if action[i] >= 0 and not frozen:
                target = gain[i] + gamma ** age[i] * values[best_of(values)]
                if abs(target) > LARGEST or not learn_network_value(weights, action[i], inputs, i, hidden, target, eta):
                    diverged = i if diverged < 0 else diverged
                else:
                    lessons[i] += age[i]
                action_values(weights, 0, now, 0, hidden, values)
            inputs[i] = now[0]
            situation[i], age[i], gain[i] = states, 0, 0.0
            action[i] = chosen(values, boltzmann[i], rule.lesson.chance[i])
        if not frozen:
            boltzmann[i] -= beta * (boltzmann[i] - coolest)
        if layer[i] < 0:
            drive_by_action(action[i], i, robots.max_speed, robots.command, layer, robots.place)
        else:
            action[i] = -1
    return end_lesson(rule.lesson, diverged)


@compiled
def feel_strongest(radiation, i):
    """Return the largest reading of the radiation sensors of robot i, 0 without any."""
    strongest = 0.0
    for q in range(radiation.shape[1]):
        strongest = max(strongest, radiation[i, q])
    return strongest


@compiled
def write_sight(distance, kind, ranges, i, out):
    """Write what robot i sees; return the nearest reading of a fire (-1 for none) and of anything else (infinity)."""
    sensors = distance.shape[1]
    fire, other = -1.0, math.inf
    for s in range(sensors):
        sees = distance[i, s] >= 0.0 and ranges[s] > 0.0
        out[0, s] = 1.0 - min(distance[i, s] / ranges[s], 1.0) if sees else 0.0
        out[0, sensors + s] = 1.0 if kind[i, s] == ROBOT else 0.0
        out[0, 2 * sensors + s] = 1.0 if kind[i, s] == FIRE else 0.0
        if sees and kind[i, s] == FIRE:
            fire = distance[i, s] if fire < 0.0 else min(fire, distance[i, s])
        elif sees:
            other = min(other, distance[i, s])
    return fire, other


@compiled
def shaped(situation, nearest, before, came, moved, clearance, shaping):
    """Return the reward of a step; `nearest` and `before` are readings of the nearest fire now and a step earlier."""
    work, approach, rest, scorch, ahead, near, margin = shaping
    reward = near * (clearance / margin - 1.0) if clearance < margin else 0.0
    if situation == AT_FIRE:
        return reward + work
    if situation == IN_HEAT:
        return reward - scorch
    if situation == COOLING:
        return reward + (rest if nearest >= 0.0 else 0.0)
    if nearest >= 0.0:
        return reward + (approach * came if before >= 0.0 else 0.0)
    return reward + ahead * moved
