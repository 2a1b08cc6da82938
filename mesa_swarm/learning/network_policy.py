"""What policies share whose networks say what there is to choose among, and what it is worth."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_number
from mesa_swarm.learning.actions import ENCODINGS, choose_all
from mesa_swarm.learning.networks import PARTS, Networks, check_networks
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.learning.told import checked_chances, checked_numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkPolicy:
    """Base of `QPolicy` and `WirePolicy`, which choose by Boltzmann's probabilities of what networks say.

    Parameters
    ----------
    sensors, networks, encoding, temperature, steps, training
        As for `QPolicy`; there are as many networks a robot as its family needs.
    """

    family: ClassVar[str]
    counted: ClassVar[str]  # the field that says among how many it chooses
    sensors: SensorLayout
    networks: Networks
    encoding: str = "distance"
    temperature: float = 0.2
    steps: int = 0
    training: dict = field(default_factory=dict)

    @property
    def group(self) -> int:
        """How many networks a robot has."""
        raise NotImplementedError

    def _check_parts(self) -> None:
        """Check that the parts fit together."""
        inputs = ENCODINGS[check_choice("encoding", self.encoding, ENCODINGS)] * len(self.sensors)
        check_number("temperature", self.temperature, above=0)
        check_count("steps", self.steps, maximum=2**62)
        check_networks(self.networks, inputs, self.group)

    @property
    def copies(self) -> int:
        """How many robots' networks there are."""
        return len(self.networks.outer_bias) // self.group

    def of_robot(self, index: int) -> Self:
        """Return the policy of one of the robots alone, to share it with others.

        Parameters
        ----------
        index : int
            0 to ``copies - 1``.
        """
        row = check_count("index", index, maximum=self.copies - 1) * self.group
        return replace(self, networks=Networks(*(w[row : row + self.group].copy() for w in self.networks.weights)))

    @cached_property
    def _ranges(self) -> np.ndarray:
        return np.array([self.sensors.ranges])

    def _known(self, readings: ArrayLike, kinds: ArrayLike | None, numbers: ArrayLike | None) -> tuple:
        """Return readings, kinds, ranges, weights, numbers: by which compiled functions say what there is to choose."""
        distance, kind = self.sensors.check_readings(readings, kinds, self.encoding)
        return distance, kind, self._ranges, self.networks.weights, checked_numbers(numbers, len(distance))

    def _taken(self, values: np.ndarray, chance: ArrayLike | None) -> np.ndarray:
        """Return which one every robot takes (n,), of what each is worth (n, a)."""
        chances = np.empty(0) if chance is None else checked_chances(chance, len(values))
        taken = np.empty(len(values), np.int64)
        choose_all(values, float(self.temperature), chances, taken)
        return taken

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name."""
        return dict(zip(PARTS, self.networks.weights, strict=True))

    def settings(self) -> dict:
        """Return what else it takes to act."""
        return {name: getattr(self, name) for name in (self.counted, "encoding", "temperature")}

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> Self:
        """Return the policy of these parts, as a file has them."""
        if sorted(arrays) != sorted(PARTS) or settings.keys() != {cls.counted, "encoding", "temperature"}:
            raise InvalidValueError(f"a {cls.family} policy has {', '.join(arrays)}; expected {', '.join(PARTS)}")
        networks = Networks(*(arrays[part] for part in PARTS))
        known = {**settings, cls.counted: check_count(cls.counted, settings[cls.counted])}
        known["temperature"] = check_number("temperature", settings["temperature"])
        return cls(sensors=sensors, networks=networks, steps=steps, training=training, **known)
