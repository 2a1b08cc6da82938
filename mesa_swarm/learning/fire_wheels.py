"""Learning to fight fires by wheel speeds: Q-networks that all robots share, and shaped rewards."""

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, check_flag, check_name, check_number, shortened
from mesa_swarm.control.layer import Senses
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.learning.actions import ACTION_NAMES, ACTIONS, best_of, chosen, ranges_of
from mesa_swarm.learning.learner import LARGEST, ChoosingLayer
from mesa_swarm.learning.networks import PARTS, Networks
from mesa_swarm.learning.policy import SensorLayout, check_designs, check_layout, check_stored, sensors_of
from mesa_swarm.learning.q_learning import action_values, learn_one
from mesa_swarm.robots.design import AGENT_FIRE
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import FIRE, ROBOT

COUNT, UNITS = len(ACTIONS), 16
# Inputs of a network: for each sensor its reading, whether it sees a robot, whether a fire; then radiation, the robot's
# own heat, and whether it is too hot, takes heat, extinguishes.
OF_SENSOR, OF_BODY = 3, 5
FREE, AT_FIRE, IN_HEAT, COOLING = range(4)
# Columns of each robot's last action.
REMEMBERED = ("inputs", "action", "situation", "age", "lessons", "gain", "seen", "temperature")
# Stored in a policy's `training`.
TRAINING_PARAMETERS = ("work", "approach", "rest", "scorch", "ahead", "near", "gamma", "eta", "beta")


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class FireWheelPolicy:
    """Q-networks of the eight wheel actions, which robots learned at fires by `LearnFireWheels`.

    ``LearnFireWheels(start=policy, frozen=True)`` drives robots by it; `save_policy` and `load_policy` store it. Its
    inputs include a robot's heat, which is not among the readings with which `PolicyLayer` asks a `Policy`.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        Eight, each of 3 inputs a sensor and 5 more.
    temperature : float
        Of the choice, above 0.
    hold : int
        Steps for which an action lasts, at least 1.
    steps : int
        Robot-steps of training, 0 for none.
    training : dict
        Provenance, and figures of its training.

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
    sensors: SensorLayout
    networks: Networks
    temperature: float = 0.02
    hold: int = 5
    steps: int = 0
    training: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_layout(self.sensors)
        if not isinstance(self.networks, Networks):
            raise InvalidValueError(f"networks is {shortened(self.networks)}; expected Networks(...)")
        expected = (COUNT, OF_SENSOR * len(self.sensors) + OF_BODY, UNITS)
        if self.networks.inner.shape != expected:
            raise InvalidValueError(f"networks have the shape {self.networks.inner.shape}; expected {expected}")
        check_number("temperature", self.temperature, above=0, maximum=1e6)
        check_count("hold", self.hold, minimum=1)
        check_count("steps", self.steps, maximum=2**62)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name."""
        return dict(zip(PARTS, self.networks.weights, strict=True))

    def settings(self) -> dict:
        """Return the other fields that acting depends on."""
        return {"temperature": self.temperature, "hold": self.hold}

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> "FireWheelPolicy":
        """Return the policy with these parts, from a file."""
        check_stored(cls.family, (*arrays, *settings), (*PARTS, "hold", "temperature"))
        networks = Networks(*(arrays[part] for part in PARTS))
        return cls(sensors=sensors, networks=networks, steps=steps, training=training, **settings)


@dataclass(kw_only=True)
class LearnFireWheels(ChoosingLayer):
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
    gamma : float
        Discount of the next step's value, 0 to below 1.
    eta : float
        Rate of back-propagation, 0 to 1.
    beta : float
        Share of its difference to the limit by which the temperature falls in each step, 0 to 1.
    first_temperature, last_temperature : float
        Of the choice, above 0. With a start, its temperature is the first.
    hold : int
        Steps, at least 1.
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

    def __post_init__(self) -> None:
        check_name("name", self.name)
        for name in ("work", "approach", "rest", "scorch", "ahead", "near"):
            check_number(name, getattr(self, name), minimum=0, maximum=1000)
        for name in ("margin", "first_temperature", "last_temperature", "full_heat"):
            check_number(name, getattr(self, name), above=0, maximum=1e6)
        for name in ("eta", "beta"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)
        check_number("gamma", self.gamma, minimum=0, maximum=0.999)
        check_count("hold", self.hold, minimum=1)
        check_flag("frozen", self.frozen)
        if self.start is not None and not isinstance(self.start, FireWheelPolicy):
            raise InvalidValueError(f"start is {shortened(self.start)}; expected a FireWheelPolicy from policy()")
        self._check_frozen()

    @property
    def _layout(self) -> SensorLayout:
        return SensorLayout.of(AGENT_FIRE) if self.start is None else self.start.sensors

    def _check_sensors(self) -> None:
        """Check that all robots have the sensors of the networks."""
        check_designs(self._layout, self._robots)

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns: networks, the last inputs, action and situation, and what the action has gained."""
        self._check_sensors()
        inputs = OF_SENSOR * len(self._layout) + OF_BODY
        shapes = ((COUNT, inputs, UNITS), (COUNT, UNITS), (COUNT, UNITS), (COUNT,))
        first = self.first_temperature if self.start is None else self.start.temperature
        columns: dict[str, tuple[tuple[int | str, ...], type, object]] = {
            **{part: (shape, np.float64, 0.0) for part, shape in zip(PARTS, shapes, strict=True)},
            "inputs": ((inputs,), np.float64, 0.0),
            **{name: ((), np.int64, -1) for name in ("action", "situation")},
            **{name: ((), np.int64, 0) for name in ("age", "lessons")},
            "gain": ((), np.float64, 0.0),
            "seen": ((), np.float64, -1.0),
            "temperature": ((), np.float64, first),
            "born": ((), np.bool_, False),
        }
        for name, (shape, dtype, initial) in columns.items():
            swarm.remember(f"{prefix}.{name}", shape, dtype, initial)

    def _init_robots(self, new: np.ndarray, known: np.ndarray) -> None:
        """Give new robots the networks that are shared."""
        inputs = self._column("inner").shape[2]
        if self.start is not None:
            weights = self.start.networks.weights
        else:
            weights = Networks.random(COUNT, inputs=inputs, hidden=UNITS, rng=self._rng).weights
        for part, first in zip(PARTS, weights, strict=True):
            self._column(part)[new] = self._column(part)[known[0]] if len(known) else first

    def policy(self, **training: str | float) -> FireWheelPolicy:
        """Return what the robots have learned so far as a policy that no longer learns; see `QLearning.policy`."""
        sensors_of(self._robots)
        check_designs(self._layout, self._robots)
        self._init_new_robots()
        return FireWheelPolicy(
            sensors=self._layout,
            networks=Networks(*(self._column(part)[0].copy() for part in PARTS)),
            temperature=float(self._column("temperature").mean()),
            hold=int(self.hold),
            **self._training(TRAINING_PARAMETERS, training),
        )

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Learn from the last step, choose actions where due, and drive robots that no other layer drives."""
        self._init_new_robots()
        if not len(layer):
            return
        radiation = senses.radiation.max(axis=1) if senses.radiation.shape[1] else np.zeros(len(layer))
        diverged = learn_wheels(
            (senses.distance, senses.kind, ranges_of(senses.sensors), radiation),
            (senses.temperature, senses.heat, senses.hot, senses.fire),
            senses.design, senses.max_speed, senses.last_command,
            tuple(self._column(part)[0] for part in PARTS),
            tuple(map(self._column, REMEMBERED)),
            self._rng.random(len(layer)),
            tuple(float(getattr(self, n)) for n in ("work", "approach", "rest", "scorch", "ahead", "near", "margin")),
            (float(self.gamma), float(self.eta), float(self.beta), float(self.last_temperature)),
            int(self.hold), float(self.full_heat), bool(self.frozen), command, layer, index,
        )  # fmt: skip
        if not self.frozen:
            for column in map(self._column, PARTS):
                column[1:] = column[:1]
        self._check_diverged(diverged, "its values grow beyond all bounds; lower eta or gamma")

    def reason(self, moment: Moment) -> Reason:
        """Return the chosen action."""
        speeds = moment.command / max(float(np.abs(moment.command).max()), 1e-300)
        action = ACTION_NAMES[int(np.argmin(np.abs(ACTIONS - speeds).sum(axis=1)))]
        return Reason(f"it chose {action}, by what it learned and by chance")


@compiled
def learn_wheels(
    eyes, body, design, max_speed, last_command, weights, memory, chance, shaping, rates, hold, full_heat, frozen,
    command, layer, index,
):  # fmt: skip
    """Learn from the last step, choose actions where due; return a robot whose values diverged, or -1."""
    distance, kind, ranges, radiation = eyes
    temperature, heat, hot, fire = body
    inputs, action, situation, age, lessons, gain, seen, boltzmann = memory
    gamma, eta, beta, coolest = rates
    now, hidden, values = np.empty((1, inputs.shape[1])), np.empty(weights[0].shape[2]), np.empty(weights[3].shape[0])
    diverged = -1
    for i in range(layer.shape[0]):
        states = (2 if heat[i] > 0.0 else 3) if hot[i] else (1 if fire[i] >= 0 else 0)
        nearest, clearance = observed(distance, kind, ranges[design[i]], i, now)
        rest = now.shape[1] - OF_BODY
        now[0, rest], now[0, rest + 1] = radiation[i], min(temperature[i] / full_heat, 1.0)
        now[0, rest + 2], now[0, rest + 3], now[0, rest + 4] = hot[i], heat[i] > 0.0, fire[i] >= 0
        if action[i] >= 0:
            moved = 0.5 * (last_command[i, 0] + last_command[i, 1]) / max(max_speed[i], 1e-300)
            came = (seen[i] - nearest) / max(max_speed[i], 1e-300)
            reward = shaped(states, nearest, seen[i], came, moved, clearance, shaping)
            gain[i] += gamma ** age[i] * reward
            age[i] += 1
        seen[i] = nearest
        if action[i] < 0 or age[i] >= hold or states != situation[i]:
            action_values(weights, 0, now, 0, hidden, values)
            if action[i] >= 0 and not frozen:
                target = gain[i] + gamma ** age[i] * values[best_of(values)]
                if abs(target) > LARGEST or not learn_one(weights, action[i], inputs, i, hidden, target, eta):
                    diverged = i if diverged < 0 else diverged
                else:
                    lessons[i] += age[i]
                action_values(weights, 0, now, 0, hidden, values)
            inputs[i] = now[0]
            situation[i], age[i], gain[i] = states, 0, 0.0
            action[i] = chosen(values, boltzmann[i], chance[i])
        if not frozen:
            boltzmann[i] -= beta * (boltzmann[i] - coolest)
        if layer[i] < 0:
            command[i, 0] = max_speed[i] * ACTIONS[action[i], 0]
            command[i, 1] = max_speed[i] * ACTIONS[action[i], 1]
            layer[i] = index
        else:
            action[i] = -1
    return diverged


@compiled
def observed(distance, kind, ranges, i, now):
    """Write what robot i sees; return the nearest reading of a fire, and of anything else, -1 and infinity for none."""
    sensors = distance.shape[1]
    fire, other = -1.0, math.inf
    for s in range(sensors):
        near = distance[i, s] >= 0.0 and ranges[s] > 0.0
        now[0, s] = 1.0 - min(distance[i, s] / ranges[s], 1.0) if near else 0.0
        now[0, sensors + s] = 1.0 if kind[i, s] == ROBOT else 0.0
        now[0, 2 * sensors + s] = 1.0 if kind[i, s] == FIRE else 0.0
        if near and kind[i, s] == FIRE:
            fire = distance[i, s] if fire < 0.0 else min(fire, distance[i, s])
        elif near:
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
