"""Networks as columns of a swarm: they come and go with their robots, and are part of the state of a run."""

import math

import numpy as np

from mesa_swarm.learning.network_policy import NetworkPolicy
from mesa_swarm.learning.networks import PARTS, Networks
from mesa_swarm.learning.policy import check_designs
from mesa_swarm.robots.swarm import Swarm


class Memory:
    """The networks of all robots of a swarm, `count` for each robot.

    Hidden units are twice the proximity sensors of the widest design present. The columns grow with it: new
    weights of robots that were there before are 0, so that what they learned stays.

    Parameters
    ----------
    swarm : Swarm
    prefix : str
        Of the columns' names.
    count : int
        Networks a robot.
    per_sensor : int
        Inputs a proximity sensor.
    start : NetworkPolicy, optional
        What robots know when they are born.

    Raises
    ------
    LearningError
        If robots have other sensors than `start` was trained with.
    """

    def __init__(self, swarm: Swarm, prefix: str, count: int, per_sensor: int, start: NetworkPolicy | None) -> None:
        self._swarm, self._prefix, self._count, self._start = swarm, prefix, count, start
        self._check_start()
        inputs, units = (per_sensor, "proximity"), (2, "proximity")
        shapes = ((count, *inputs, *units), (count, *units), (count, *units), (count,))
        for name, shape in zip(PARTS, shapes, strict=True):
            swarm.remember(f"{prefix}.{name}", shape, np.float64, 0.0)
        swarm.remember(f"{prefix}.born", (), np.bool_, False)

    @property
    def weights(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Views of all networks, robot after robot, as `networks.forward` takes them."""
        inner, inner_bias, outer, outer_bias = (self._swarm.columns[f"{self._prefix}.{part}"] for part in PARTS)
        networks = outer_bias.size
        inputs, units = math.prod(inner.shape[2:4]), math.prod(inner.shape[4:])
        return (
            inner.reshape(networks, inputs, units),
            inner_bias.reshape(networks, units),
            outer.reshape(networks, units),
            outer_bias.reshape(networks),
        )

    def give_birth(self, rng: np.random.Generator, shared: bool) -> None:
        """Give robots that have no networks yet theirs; where they are shared, those of the others."""
        born = self._swarm.columns[f"{self._prefix}.born"]
        if born.all():
            return
        self._check_start()
        new, known = np.flatnonzero(~born), np.flatnonzero(born)
        for index, part in enumerate(PARTS):
            column = self._swarm.columns[f"{self._prefix}.{part}"]
            if shared and len(known):
                column[new] = column[known[0]]
            elif self._start is not None:
                sets = self._start.networks.weights[index].reshape(-1, *column.shape[1:])
                column[new] = sets[0 if shared else self._swarm.columns["number"][new] % len(sets)]
            else:
                limit = self._limit(part)
                column[new] = rng.uniform(-limit, limit, (1 if shared else len(new), *column.shape[1:]))
        born[:] = True

    def _limit(self, part: str) -> float:
        """Return the largest first weight: 1 / sqrt(weights that feed the node), the bias unit's included."""
        shape = self._swarm.columns[f"{self._prefix}.inner"].shape
        feeding = shape[2:4] if part.startswith("inner") else shape[4:]
        return 1.0 / math.sqrt(math.prod(feeding) + 1)

    def _check_start(self) -> None:
        if self._start is not None:
            check_designs(self._start.sensors, self._swarm)

    def networks(self, robots: int) -> Networks:
        """Return copies of the networks of the first robots."""
        return Networks(*(weights[: robots * self._count].copy() for weights in self.weights))

    def checkpoint(self) -> dict:
        """Return nothing: all that is remembered stands in columns of the swarm, which are kept anyway."""
        return {}

    def restore(self, state: dict) -> None:
        """Take nothing: the columns are there already."""

    def share(self) -> None:
        """Give every robot what the first one has."""
        for part in PARTS:
            column = self._swarm.columns[f"{self._prefix}.{part}"]
            column[1:] = column[:1]
