"""What learners share: networks and temperatures of robots as columns, and what becomes a policy."""

import numpy as np

from mesa_swarm.errors import LearningError, check_choice, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import ENCODINGS
from mesa_swarm.learning.memory import Memory
from mesa_swarm.learning.rewards import REWARDS
from mesa_swarm.robots.swarm import Swarm

# What a policy tells of how it was trained.
TOLD = ("reward", "alpha", "eta", "gamma", "beta", "critical", "shared", "self_adjusting")


class Learner:
    """Base of the layers that learn in every step, with networks of each robot's own; see `QLearning`."""

    def _check_rates(self) -> None:
        check_choice("reward", self.reward, REWARDS)
        check_choice("encoding", self.encoding, ENCODINGS)
        for name in ("alpha", "eta", "beta"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)
        check_number("gamma", self.gamma, minimum=0, maximum=0.999)
        for name in ("first_temperature", "last_temperature"):
            check_number(name, getattr(self, name), above=0, maximum=1e6)
        for name in ("critical", "bump_rate"):
            check_number(name, getattr(self, name), above=0, maximum=1)
        check_number("bump_window", self.bump_window, minimum=1, maximum=1e9)
        check_number("bump_distance", self.bump_distance, minimum=0, maximum=1e6)

    def _remember(self, swarm: Swarm, prefix: str, rng: np.random.Generator, networks: int, more: dict) -> None:
        """Make the columns: `networks` a robot, its last inputs and reward, its temperature and recent bumps."""
        per_sensor = ENCODINGS[self.encoding]
        self._swarm, self._rng, self._prefix = swarm, rng, prefix
        self._memory = Memory(swarm, prefix, networks, per_sensor, self.start)
        for name, column in {
            "inputs": ((per_sensor, "proximity"), np.float64, 1.0),
            "reward": ((), np.float64, 0.0),
            "temperature": ((), np.float64, self.first_temperature),
            "bumps": ((), np.float64, self.bump_rate),
            "lessons": ((), np.int64, 0),
            **more,
        }.items():
            swarm.remember(f"{prefix}.{name}", *column)

    def _column(self, name: str) -> np.ndarray:
        return self._swarm.columns[f"{self._prefix}.{name}"]

    @property
    def temperature(self) -> np.ndarray:
        """Of every robot's choice (n,); a copy."""
        return self._column("temperature").copy()

    @property
    def last_reward(self) -> np.ndarray:
        """What every robot got for its last action (n,); a copy."""
        return self._column("reward").copy()

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
        self._memory.give_birth(self._rng, self.shared)
        sensors, lessons = self._memory.sensors(), int(self._column("lessons").sum())
        told = {name: getattr(self, name) for name in TOLD}
        return {
            "sensors": sensors,
            "networks": self._memory.networks(1 if self.shared else len(self._swarm)),
            "encoding": self.encoding,
            "temperature": float(self._column("temperature").mean()),
            "steps": lessons + (self.start.steps if self.start else 0),
            "training": {**told, "robots": len(self._swarm), "lessons": lessons, **training},
        }

    def _divergence(self, row: int) -> LearningError:
        robot = self._swarm.agents[row]
        return LearningError(
            f"{self.name} diverged for robot {robot.unique_id} in step {robot.model.steps}: its values are not "
            "finite; lower eta, alpha or gamma"
        )


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
