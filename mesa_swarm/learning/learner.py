"""Base classes of learners: networks as columns, temperatures, policies, and state that outlasts an unbinding."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, ClassVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, LearningError, check_choice, check_flag, check_number, shortened
from mesa_swarm.control.layer import Senses
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.learning.actions import ENCODINGS, ranges_of
from mesa_swarm.learning.networks import PARTS, NetworkPolicy, Networks
from mesa_swarm.learning.policy import check_designs, sensors_of
from mesa_swarm.learning.rewards import CRITICAL, NEXT_STATE, REWARD_STATES, REWARDS, STATE
from mesa_swarm.robots.swarm import Swarm


class UnboundState:
    """The columns of a layer that was unbound; it can be read in place of the swarm."""

    def __init__(self, swarm: Swarm, prefix: str) -> None:
        self.swarm, self.prefix, self.designs = swarm, prefix, swarm.designs
        self.provenance = provenance(swarm)
        names = [name for name in swarm.columns if name == "number" or name.startswith(f"{prefix}.")]
        self.columns = {name: swarm.columns[name].copy() for name in names}

    def __len__(self) -> int:
        return len(self.columns["number"])

    def remember(self, name: str, shape: tuple, dtype: type, initial: object) -> np.ndarray:
        """Return the column of this name."""
        return self.columns[name]

    def restore_to(self, prefix: str) -> None:
        """Write the state of robots that still exist to the columns of this prefix."""
        columns = self.swarm.columns
        _, now, then = np.intersect1d(columns["number"], self.columns["number"], return_indices=True)
        for name, old in self.columns.items():
            if name != "number":
                # Columns may have become wider, with robots of more sensors.
                known: Any = (now, *(slice(0, width) for width in old.shape[1:]))
                columns[prefix + name.removeprefix(self.prefix)][known] = old[then]


class LearningLayer:
    """Base of layers that learn: bound again in the same model, they continue as if never unbound."""

    name: str
    frozen: bool
    start: Any = None
    # The swarm, or its columns after unbinding.
    _home: Any = None
    _prefix = ""

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Make the columns of the swarm; continue with what was learned before, if anything."""
        home = self._home
        left = home if isinstance(home, UnboundState) and home.swarm is swarm else None
        if home is not None and left is None:
            self._start_elsewhere()
        self._home, self._prefix, self._rng = swarm, prefix, rng
        self._remember(swarm, prefix)
        if left is not None:
            left.restore_to(prefix)

    def unbind(self) -> None:
        """Copy the columns, which are about to be dropped."""
        self._home = UnboundState(self._robots, self._prefix)

    def _check_frozen(self) -> None:
        """Check that a frozen layer has something to act on."""
        if self.frozen and not (self.start and self.start.steps):
            raise LearningError(
                f"{self.name} is frozen and untrained; give it a trained policy as start, or let it learn"
            )

    def _check_sensors(self) -> None:
        """Check that all robots have the sensors that the start was trained with."""
        if self.start is not None:
            check_designs(self.start.sensors, self._robots)

    def _init_new_robots(self) -> None:
        """Initialise the weights of new robots."""
        born = self._column("born")
        if not born.all():
            self._check_sensors()
            self._init_robots(np.flatnonzero(~born), np.flatnonzero(born))
            born[:] = True

    def _init_robots(self, new: np.ndarray, known: np.ndarray) -> None:
        """Initialise the weights in the rows `new`; those in `known` have learned."""
        raise NotImplementedError

    def _training(self, names: Sequence[str], training: dict) -> dict:
        """Return the steps and training of a policy: parameters, world, what it started from, and what is given."""
        lessons = int(self._column("lessons").sum())
        described = {
            "learner": type(self).__name__,
            "mesa_swarm": version("mesa-swarm"),
            **provenance(self._robots),
            **{name: getattr(self, name) for name in names},
            "robots": len(self._robots),
            "lessons": lessons,
            **({"started_from": self.start.training} if self.start else {}),
            **training,
        }
        return {"steps": lessons + (self.start.steps if self.start else 0), "training": described}

    def _check_diverged(self, row: int, problem: str) -> None:
        """Raise an error about the robot in this row, unless it is -1."""
        if row >= 0:
            robot = self._robots.agents[row]
            raise LearningError(
                f"{self.name} diverged for robot {robot.unique_id} in step {robot.model.steps}: {problem}"
            )

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns."""
        raise NotImplementedError

    def policy(self, **training: str | float) -> Any:
        """Return what the robots have learned so far; see `QLearning.policy`."""
        raise NotImplementedError

    def _start_elsewhere(self) -> None:
        """Let the robots of another model start with what was learned."""
        if self._column("lessons").any():
            self.start = self.policy()

    @property
    def _robots(self) -> Any:
        """The swarm that it belongs to, or its columns after unbinding."""
        if self._home is None:
            raise LearningError(
                f"this {self.name} is in no model, which would learn with a copy of it; ask the copy, such as "
                "model.control.layers[0]"
            )
        return self._home

    def _column(self, name: str) -> np.ndarray:
        return self._robots.columns[f"{self._prefix}.{name}"]


class ChoosingLayer(LearningLayer):
    """Base of layers that learn and choose by chance, at a temperature."""

    @property
    def temperature(self) -> np.ndarray:
        """Of every robot's choice (n,); a copy."""
        return self._column("temperature").copy()


def provenance(robots: Swarm | UnboundState) -> dict[str, str | int]:
    """Return the robots' design, map, and the number of steps of their model."""
    if isinstance(robots, UnboundState):
        return robots.provenance
    if not len(robots):
        return {}
    model = robots.agents[0].model
    return {"design": robots.designs[0].name, "map": str(model.map.name), "model_steps": int(model.steps)}


class NetworkColumns:
    """The networks of all robots of a swarm, `count` for each robot, with `per_sensor` inputs a proximity sensor.

    Hidden units are twice the proximity sensors of the widest design present. The columns grow with it: new
    weights of existing robots are 0, so that their outputs do not change.
    """

    def __init__(self, swarm: Swarm, prefix: str, count: int, per_sensor: int) -> None:
        self._swarm, self._prefix = swarm, prefix
        inputs, units = (per_sensor, "proximity"), (2, "proximity")
        shapes = ((count, *inputs, *units), (count, *units), (count, *units), (count,))
        for name, shape in zip(PARTS, shapes, strict=True):
            swarm.remember(f"{prefix}.{name}", shape, np.float64, 0.0)
        swarm.remember(f"{prefix}.born", (), np.bool_, False)

    @property
    def weights(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Views of all networks, robot after robot, for `networks.forward`."""
        inner, inner_bias, outer, outer_bias = (self._swarm.columns[f"{self._prefix}.{part}"] for part in PARTS)
        networks = outer_bias.size
        inputs, units = math.prod(inner.shape[2:4]), math.prod(inner.shape[4:])
        return (
            inner.reshape(networks, inputs, units),
            inner_bias.reshape(networks, units),
            outer.reshape(networks, units),
            outer_bias.reshape(networks),
        )

    def checkpoint(self) -> dict:
        """Return nothing: the state is in columns of the swarm, which are stored anyway."""
        return {}

    def restore(self, state: dict) -> None:
        """Do nothing: the columns are restored by the swarm."""


# Rewards are within [-1, 1], so that values are at most 1 / (1 - gamma), at most 1,000: a correction or a
# weight a million times as large has diverged.
LARGEST = 1e9
# T_0 of the thesis (8.3).
HOT = 1.0
# Stored in a policy's `training`.
TRAINING_PARAMETERS = ("reward", "alpha", "eta", "gamma", "beta", "critical", "reward_of", "shared", "self_adjusting")


@dataclass(kw_only=True)
class Learner(ChoosingLayer):
    """Base of `QLearning`, where the parameters are described, and `WireFittedQ`: they learn in every step."""

    policy_class: ClassVar[type[NetworkPolicy]]  # the class of its policies
    last_action: ClassVar[tuple]  # the column of each robot's last action: shape, type, initial value
    reward: str = "b"
    encoding: str = "distance"
    alpha: float = 0.4
    eta: float = 0.1
    last_eta: float | None = None
    gamma: float = 0.7
    beta: float = 1e-4
    first_temperature: float | None = None
    last_temperature: float = 0.2
    critical: float = CRITICAL
    reward_of: str = STATE
    shared: bool = False
    self_adjusting: bool = False
    bump_rate: float = 0.02
    bump_window: int = 1000
    bump_distance: float = 0.5
    alert_gamma: float | None = None
    least_speed: float | None = None
    frozen: bool = False
    start: NetworkPolicy | None = None
    name: str = "Learner"

    def _check_rates(self) -> None:
        check_choice("reward", self.reward, REWARDS)
        check_choice("reward_of", self.reward_of, REWARD_STATES)
        check_choice("encoding", self.encoding, ENCODINGS)
        for name in ("alpha", "eta", "beta"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)
        check_number("gamma", self.gamma, minimum=0, maximum=0.999)
        check_number("last_eta", self._least_eta, minimum=0, maximum=1)
        check_number("alert_gamma", self._alert, minimum=0, maximum=0.999)
        check_number("first_temperature", self._hottest, above=0, maximum=1e6)
        check_number("last_temperature", self.last_temperature, above=0, maximum=1e6)
        for name in ("critical", "bump_rate"):
            check_number(name, getattr(self, name), above=0, maximum=1)
        check_number("bump_window", self.bump_window, minimum=1, maximum=1e9)
        check_number("bump_distance", self.bump_distance, minimum=0, maximum=1e6)
        if self.least_speed is not None:
            check_number("least_speed", self.least_speed, minimum=-1, maximum=1)
        for name in ("shared", "self_adjusting", "frozen"):
            setattr(self, name, check_flag(name, getattr(self, name)))

    def _check_start(self) -> None:
        """Check that it can continue from its start."""
        start, counted = self.start, self.policy_class.choices_field
        if start is not None and not isinstance(start, self.policy_class):
            raise InvalidValueError(
                f"start is {shortened(start)}; expected a {self.policy_class.__name__}, as load_policy() returns it"
            )
        count = getattr(self, counted)
        if start is not None and (getattr(start, counted), start.encoding) != (count, self.encoding):
            raise InvalidValueError(
                f"start has {getattr(start, counted)} {counted} and encoding {start.encoding!r}; "
                f"expected {count} and {self.encoding!r}"
            )
        self._check_frozen()

    @property
    def _hottest(self) -> float:
        """T_0."""
        return HOT if self.first_temperature is None else self.first_temperature

    @property
    def _least_eta(self) -> float:
        """The rate of back-propagation at the last temperature."""
        return self.eta if self.last_eta is None else self.last_eta

    @property
    def _alert(self) -> float:
        """The gamma of a self-adjusting robot that bumps often."""
        return self.gamma if self.alert_gamma is None else self.alert_gamma

    @property
    def _regulates(self) -> bool:
        """Whether robots adapt T to their speed."""
        return self.self_adjusting and self.least_speed is not None

    @property
    def _begun_at(self) -> float:
        """The initial temperature of robots."""
        return self._hottest if self.start is None or self.first_temperature is not None else self.start.temperature

    def unbind(self) -> None:
        """Copy the columns, which are about to be dropped."""
        super().unbind()
        self._memory = self._networks_in(self._home, self._prefix)

    def _networks_in(self, swarm: Any, prefix: str) -> NetworkColumns:
        self._check_sensors()
        return NetworkColumns(swarm, prefix, self._count, ENCODINGS[self.encoding])

    @property
    def _count(self) -> int:
        """The number of networks of a robot."""
        return self.policy_class.networks_per_choice * getattr(self, self.policy_class.choices_field)

    def _init_robots(self, new: np.ndarray, known: np.ndarray) -> None:
        """Initialise the networks of new robots; shared ones are copied from the others."""
        _, *inputs, _, _ = self._column("inner").shape[1:]
        units = self._column("outer").shape[2:]
        for index, part in enumerate(PARTS):
            column = self._column(part)
            if self.shared and len(known):
                column[new] = column[known[0]]
            elif self.start is not None:
                sets = self.start.networks.weights[index].reshape(-1, *column.shape[1:])
                column[new] = sets[0 if self.shared else self._robots.columns["number"][new] % len(sets)]
            else:
                # At most 1 / sqrt(weights that feed the node), the bias unit's included.
                limit = 1.0 / math.sqrt(math.prod(inputs if part.startswith("inner") else units) + 1)
                size = (1 if self.shared else len(new), *column.shape[1:])
                column[new] = self._rng.uniform(-limit, limit, size)

    def _start_elsewhere(self) -> None:
        """Let the robots of another model start with what was learned, at its temperature."""
        super()._start_elsewhere()
        if self.start is not None and self._column("lessons").any() and not self.self_adjusting:
            self.first_temperature = self.start.temperature

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns: networks of a robot, its last inputs and reward, its temperature and recent bumps."""
        per_sensor = ENCODINGS[self.encoding]
        self._memory = self._networks_in(swarm, prefix)
        swarm.remember(f"{prefix}.inputs", (per_sensor, "proximity"), np.float64, 1.0)
        swarm.remember(f"{prefix}.reward", (), np.float64, 0.0)
        swarm.remember(f"{prefix}.temperature", (), np.float64, self._begun_at)
        swarm.remember(f"{prefix}.bumps", (), np.float64, self.bump_rate)
        if self._regulates:
            swarm.remember(f"{prefix}.pace", (), np.float64, self.least_speed)
        swarm.remember(f"{prefix}.lessons", (), np.int64, 0)
        swarm.remember(f"{prefix}.action", *self.last_action)

    @property
    def discount(self) -> np.ndarray:
        """Every robot's gamma (n,)."""
        share = np.minimum(1.0, self._column("bumps") / self.bump_rate) if self.self_adjusting else 0.0
        return np.full(len(self._robots), self.gamma) + (self._alert - self.gamma) * share

    @property
    def last_reward(self) -> np.ndarray:
        """Every robot's reward for its last action (n,); a copy."""
        return self._column("reward").copy()

    def _known(self, senses: Senses) -> tuple[object, ...]:
        """Return the first arguments of the learners' compiled functions, with each robot's chance of this step."""
        self._init_new_robots()
        inputs = self._column("inputs")
        return (
            senses.distance,
            senses.kind,
            ranges_of(senses.sensors),
            senses.design,
            senses.max_speed,
            self._memory.weights,
            inputs.reshape(len(inputs), math.prod(inputs.shape[1:])),
            self._column("action"),
            self._column("lessons"),
            (*map(self._column, ("reward", "temperature", "bumps")), self._pace()),
            self._rng.random(len(inputs)),
            REWARDS.index(self.reward),
            (float(self.gamma), float(self._alert), float(self.critical)),
            (float(self.alpha) * float(self.eta), float(self.alpha) * float(self._least_eta)),
            (float(self.beta), float(self._hottest), float(self.last_temperature)),
            (float(self.bump_rate), 1.0 / self.bump_window, float(self.bump_distance), float(self.least_speed or 0.0)),
            (bool(self.shared), bool(self.self_adjusting), bool(self.frozen), self.reward_of == NEXT_STATE),
        )

    def _set_apart(self) -> list[str]:
        """Return the names of parameters that a policy stores only where they differ from their defaults."""
        return [] if self.last_eta is None else ["last_eta"]

    def _pace(self) -> np.ndarray:
        """Return every robot's recent speed, which only self-adjusting robots with a least speed remember."""
        return self._robots.columns.get(f"{self._prefix}.pace", np.empty(0)) if self._regulates else np.empty(0)

    def _end_lesson(self, diverged: int) -> None:
        """Copy what was learned to all robots if they share it; raise if it diverged for one of them."""
        if self.shared and not self.frozen:
            for column in map(self._column, PARTS):
                column[1:] = column[:1]
        self._check_diverged(diverged, "its values grow beyond all bounds; lower eta, alpha or gamma")

    def _last_outputs(self, row: int, networks: int) -> np.ndarray:
        """Return the outputs of a robot's networks for its last inputs (networks,)."""
        rows = slice(row * networks, (row + 1) * networks)
        inner, bias, outer, outer_bias = (weights[rows] for weights in self._memory.weights)
        inputs = self._column("inputs")[row].ravel()
        hidden = np.tanh(bias + np.einsum("i,mih->mh", inputs, inner))
        return outer_bias + (hidden * outer).sum(axis=1)

    def _learned(self, training: dict) -> dict:
        """Return the fields that all families of policies have."""
        sensors = sensors_of(self._robots)
        self._init_new_robots()
        networks = self._count * (1 if self.shared else len(self._robots))
        return {
            "sensors": sensors,
            "networks": Networks(*(weights[:networks].copy() for weights in self._memory.weights)),
            "encoding": self.encoding,
            "temperature": float(self._column("temperature").mean()),
            **self._training((*TRAINING_PARAMETERS, *self._set_apart()), training),
        }


@compiled
def is_bounded(outer, m, step):
    """Return whether network m is within bounds and not NaN, and so is its step of back-propagation."""
    bounded = abs(step) <= LARGEST
    for h in range(outer.shape[1]):
        bounded = bounded and abs(outer[m, h]) <= LARGEST
    return bounded


@compiled
def rate_of(rates, temperature, cooling):
    """Return the weight of a correction at a temperature: linear in it, from that at T_0 to that at T_c."""
    first_rate, last_rate = rates
    _, first, last = cooling
    share = (temperature - last) / (first - last) if first != last else 0.0
    return last_rate + (first_rate - last_rate) * min(max(share, 0.0), 1.0)


@compiled
def discount_of(gamma, alert, bumps, usual, self_adjusting):
    """Return the gamma of a robot; a self-adjusting one looks the farther ahead, the more often it has bumped."""
    return gamma + (alert - gamma) * min(1.0, bumps / usual) if self_adjusting else gamma


@compiled
def cool(distance, i, temperature, bumps, cooling, bumping, self_adjusting):
    """Set the temperature of robot i by time, or by its rate of bumps."""
    beta, first, last = cooling
    usual, forgetting, near, _ = bumping
    bumped = 0.0
    for s in range(distance.shape[1]):
        if 0.0 <= distance[i, s] <= near:
            bumped = 1.0
    bumps[i] += forgetting * (bumped - bumps[i])
    if self_adjusting:
        temperature[i] = last + (first - last) * min(1.0, bumps[i] / usual)
    else:
        temperature[i] -= beta * (temperature[i] - last)


@compiled
def regulate(pace, i, ahead, before, temperature, cooling, bumping):
    """Raise the temperature of robot i by a share if it has recently driven fast enough, else lower it."""
    _, first, last = cooling
    _, forgetting, _, least = bumping
    pace[i] += forgetting * (ahead - pace[i])
    change = 1.0 + forgetting if pace[i] >= least else 1.0 - forgetting
    temperature[i] = max(min(before * change, max(first, last)), min(first, last))
