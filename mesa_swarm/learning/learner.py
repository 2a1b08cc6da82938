"""What learners share: networks and temperatures of robots as columns, and what becomes a policy."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import InvalidValueError, LearningError, check_choice, check_flag, check_number, shortened
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import ENCODINGS, ranges_of
from mesa_swarm.learning.keeping import Keeper
from mesa_swarm.learning.memory import Memory
from mesa_swarm.learning.network_policy import NetworkPolicy
from mesa_swarm.learning.policy import sensors_of
from mesa_swarm.learning.rewards import REWARDS
from mesa_swarm.robots.swarm import Swarm

# Rewards are within [-1, 1], so that nothing is worth more than 1 / (1 - gamma), at most 1,000: a correction or a
# weight a million times as large has diverged. What is within stays finite.
LARGEST = 1e9
# T_0 of the thesis (8.3).
HOT = 1.0
# What a policy tells of how it was trained.
TOLD = ("reward", "alpha", "eta", "gamma", "beta", "critical", "shared", "self_adjusting")


@dataclass(kw_only=True)
class Learner(Keeper):
    """Base of `QLearning`, which tells what the parameters are, and `WireFittedQ`: they learn in every step."""

    reward: str = "b"
    encoding: str = "distance"
    alpha: float = 0.4
    eta: float = 0.1
    gamma: float = 0.7
    beta: float = 1e-4
    first_temperature: float | None = None
    last_temperature: float = 0.2
    critical: float = 0.4
    shared: bool = False
    self_adjusting: bool = False
    bump_rate: float = 0.02
    bump_window: int = 1000
    bump_distance: float = 0.5
    frozen: bool = False
    start: NetworkPolicy | None = None
    name: str = "Learner"

    def _check_rates(self) -> None:
        check_choice("reward", self.reward, REWARDS)
        check_choice("encoding", self.encoding, ENCODINGS)
        for name in ("alpha", "eta", "beta"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)
        check_number("gamma", self.gamma, minimum=0, maximum=0.999)
        check_number("first_temperature", self._hottest, above=0, maximum=1e6)
        check_number("last_temperature", self.last_temperature, above=0, maximum=1e6)
        for name in ("critical", "bump_rate"):
            check_number(name, getattr(self, name), above=0, maximum=1)
        check_number("bump_window", self.bump_window, minimum=1, maximum=1e9)
        check_number("bump_distance", self.bump_distance, minimum=0, maximum=1e6)
        for name in ("shared", "self_adjusting", "frozen"):
            setattr(self, name, check_flag(name, getattr(self, name)))

    def _check_start(self, family: type[NetworkPolicy], count: int) -> None:
        """Refuse a policy that a learner with so many actions or wires cannot go on with."""
        start = self.start
        if start is None:
            self._check_frozen()
            return
        if not isinstance(start, family):
            raise InvalidValueError(
                f"start is {shortened(start)}; expected a {family.__name__}, as load_policy() returns it"
            )
        known = getattr(start, family.counted)
        if (known, start.encoding) != (count, self.encoding):
            raise InvalidValueError(
                f"start has {known} {family.counted} and encoding {start.encoding!r}; "
                f"expected {count} and {self.encoding!r}"
            )
        self._check_frozen()

    @property
    def _hottest(self) -> float:
        """T_0."""
        return HOT if self.first_temperature is None else self.first_temperature

    @property
    def _begun_at(self) -> float:
        """The temperature at which robots are born."""
        return self._hottest if self.start is None or self.first_temperature is not None else self.start.temperature

    def unbind(self) -> None:
        """Keep what the robots know, as its columns are about to be dropped."""
        super().unbind()
        self._memory = self._networks_in(self._home, self._prefix)

    @property
    def _count(self) -> int:
        """How many networks a robot has."""
        raise NotImplementedError

    def _networks_in(self, swarm: Any, prefix: str) -> Memory:
        return Memory(swarm, prefix, self._count, ENCODINGS[self.encoding], self.start)

    def policy(self, **training: str | float) -> NetworkPolicy:
        """Return what the robots have learned so far; see `QLearning.policy`."""
        raise NotImplementedError

    def _take_along(self) -> None:
        """Let the robots of another model start with what was learned, at the temperature of that."""
        if self._column("lessons").any():
            self.start = self.policy()
            if not self.self_adjusting:
                self.first_temperature = self.start.temperature

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns: networks of a robot, its last inputs and reward, its temperature and recent bumps."""
        per_sensor = ENCODINGS[self.encoding]
        self._memory = self._networks_in(swarm, prefix)
        swarm.remember(f"{prefix}.inputs", (per_sensor, "proximity"), np.float64, 1.0)
        swarm.remember(f"{prefix}.reward", (), np.float64, 0.0)
        swarm.remember(f"{prefix}.temperature", (), np.float64, self._begun_at)
        swarm.remember(f"{prefix}.bumps", (), np.float64, self.bump_rate)
        swarm.remember(f"{prefix}.lessons", (), np.int64, 0)

    @property
    def temperature(self) -> np.ndarray:
        """Of every robot's choice (n,); a copy."""
        return self._column("temperature").copy()

    @property
    def last_reward(self) -> np.ndarray:
        """What every robot got for its last action (n,); a copy."""
        return self._column("reward").copy()

    def _known(self, senses: Senses) -> tuple[object, ...]:
        """Return what every learner's compiled function takes first, and draw each robot's chance of this step."""
        self._memory.give_birth(self._rng, self.shared)
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
            tuple(map(self._column, ("reward", "temperature", "bumps"))),
            self._rng.random(len(inputs)),
            REWARDS.index(self.reward),
            (float(self.alpha) * float(self.eta), float(self.gamma), float(self.critical)),
            (float(self.beta), float(self._hottest), float(self.last_temperature)),
            (float(self.bump_rate), 1.0 / self.bump_window, float(self.bump_distance)),
            (bool(self.shared), bool(self.self_adjusting), bool(self.frozen)),
        )

    def _end_lesson(self, diverged: int) -> None:
        """Let all robots know what was learned, if they share it; raise if it diverged for one of them."""
        if self.shared and not self.frozen:
            self._memory.share()
        if diverged >= 0:
            robot = self._robots.agents[diverged]
            raise LearningError(
                f"{self.name} diverged for robot {robot.unique_id} in step {robot.model.steps}: its values grow beyond "
                "all bounds; lower eta, alpha or gamma"
            )

    def _said(self, row: int, networks: int) -> np.ndarray:
        """Return what the networks of the robot in this row say to the inputs that it had last (networks,)."""
        inner, bias, outer, outer_bias = (
            weights[row * networks : (row + 1) * networks] for weights in self._memory.weights
        )
        inputs = self._column("inputs")[row].ravel()
        hidden = np.tanh(bias + np.einsum("i,mih->mh", inputs, inner))
        return outer_bias + (hidden * outer).sum(axis=1)

    def _learned(self, training: dict) -> dict:
        """Return what every policy has, whatever its family."""
        sensors, lessons = sensors_of(self._robots), int(self._column("lessons").sum())
        self._memory.give_birth(self._rng, self.shared)
        return {
            "sensors": sensors,
            "networks": self._memory.networks(1 if self.shared else len(self._robots)),
            "encoding": self.encoding,
            "temperature": float(self._column("temperature").mean()),
            "steps": lessons + (self.start.steps if self.start else 0),
            "training": self._training(TOLD, lessons, training),
        }


@compiled
def is_bounded(outer, m, step):
    """Return whether network m can take a step of back-propagation and stay within bounds; not if any is NaN."""
    bounded = abs(step) <= LARGEST
    for h in range(outer.shape[1]):
        bounded = bounded and abs(outer[m, h]) <= LARGEST
    return bounded


@compiled
def cool(distance, i, temperature, bumps, cooling, bumping, self_adjusting):
    """Set the temperature of robot i by the clock, or by how often it bumped."""
    beta, first, last = cooling
    usual, forgetting, near = bumping
    bumped = 0.0
    for s in range(distance.shape[1]):
        if 0.0 <= distance[i, s] <= near:
            bumped = 1.0
    bumps[i] += forgetting * (bumped - bumps[i])
    if self_adjusting:
        temperature[i] = last + (first - last) * min(1.0, bumps[i] / usual)
    else:
        temperature[i] -= beta * (temperature[i] - last)
