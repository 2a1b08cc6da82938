"""WirePolicy: what `WireFittedQ` has learned, as a policy that no longer learns."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import ACTIONS, ENCODINGS, best_of, chosen, write_inputs
from mesa_swarm.learning.networks import PARTS, Networks, check_networks, forward
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.learning.wire_fitting import squashed

# Where wires begin: at the thesis's actions, but inside of the limits, from where they can move.
STARTS = 0.8 * ACTIONS
# Networks of a wire: what they say of the left wheel, of the right wheel, of the value.
OUTPUTS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class WirePolicy:
    """Choose one of the actions that networks propose, by Boltzmann's probabilities of their values.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        ``copies * wires * 3`` of them: of every wire the left wheel, the right wheel, the value.
    wires : int
        1 to 8.
    encoding, temperature, steps, training
        As for `QPolicy`.

    Raises
    ------
    InvalidValueError
        If the networks do not fit the sensors and wires, or hold anything that is not finite.
    """

    family: ClassVar[str] = "wires"
    sensors: SensorLayout
    networks: Networks
    wires: int = 4
    encoding: str = "distance"
    temperature: float = 0.2
    steps: int = 0
    training: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        inputs = ENCODINGS[check_choice("encoding", self.encoding, ENCODINGS)] * len(self.sensors)
        check_count("wires", self.wires, minimum=1, maximum=len(STARTS))
        check_number("temperature", self.temperature, above=0)
        check_count("steps", self.steps, maximum=2**62)
        check_networks(self.networks, inputs, OUTPUTS * self.wires)

    def proposals(self, readings: np.ndarray, kinds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the wires' actions (n, w, 2) and what they are worth (n, w), given readings and kinds (n, s)."""
        distance, kind = self.sensors.check_readings(readings, kinds)
        actions, values = np.empty((len(distance), self.wires, 2)), np.empty((len(distance), self.wires))
        propose_all(distance, kind, np.array([self.sensors.ranges]), self.networks.weights, actions, values)
        return actions, values

    def act(self, readings: np.ndarray, kinds: np.ndarray, chance: np.ndarray | None = None) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `Policy.act`."""
        actions, values = self.proposals(readings, kinds)
        chances = np.empty(0) if chance is None else np.asarray(chance, dtype=float)
        if chance is not None and chances.shape != (len(values),):
            raise InvalidValueError(f"chance has shape {chances.shape}; expected ({len(values)},)")
        shares = np.empty((len(values), 2))
        take_wires(actions, values, float(self.temperature), chances, shares)
        return shares

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name."""
        return dict(zip(PARTS, self.networks.weights, strict=True))

    def settings(self) -> dict:
        """Return what else it takes to act."""
        return {"wires": self.wires, "encoding": self.encoding, "temperature": self.temperature}

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> "WirePolicy":
        """Return the policy of these parts, as a file has them."""
        if sorted(arrays) != sorted(PARTS) or sorted(settings) != ["encoding", "temperature", "wires"]:
            raise InvalidValueError(f"a wires policy has {', '.join(arrays)}; expected {', '.join(PARTS)}")
        networks = Networks(*(arrays[part] for part in PARTS))
        known = {**settings, "wires": check_count("wires", settings["wires"])}
        known["temperature"] = check_number("temperature", settings["temperature"])
        return cls(sensors=sensors, networks=networks, steps=steps, training=training, **known)


@compiled
def propose_all(distance, kind, ranges, weights, actions, values):
    """Write the wires' actions (n, w, 2) and values (n, w) of every robot."""
    robots, wires = values.shape
    copies = weights[3].shape[0] // (OUTPUTS * wires)
    now, hidden = np.empty((1, weights[0].shape[1])), np.empty((OUTPUTS * wires, weights[0].shape[2]))
    for i in range(robots):
        write_inputs(distance, kind, ranges, i, 0, now, 0)
        propose(weights, (i % copies) * OUTPUTS * wires, now, 0, hidden, actions[i], values[i])


@compiled
def propose(weights, first, inputs, row, hidden, actions, values):
    """Write what the wires of one robot propose, by its networks from `first` on; `hidden` is left for learning."""
    inner, inner_bias, outer, outer_bias = weights
    for w in range(values.shape[0]):
        for side in range(2):
            m = OUTPUTS * w + side
            said = forward(inner, inner_bias, outer, outer_bias, first + m, inputs, row, hidden[m])
            actions[w, side] = squashed(said, STARTS[w, side])
        m = OUTPUTS * w + 2
        values[w] = forward(inner, inner_bias, outer, outer_bias, first + m, inputs, row, hidden[m])


@compiled
def take_wires(actions, values, temperature, chance, shares):
    """Write the chosen wires' commands; without chances, those that are worth most."""
    for i in range(values.shape[0]):
        w = chosen(values[i], temperature, chance[i]) if chance.shape[0] else best_of(values[i])
        shares[i, 0] = actions[i, w, 0]
        shares[i, 1] = actions[i, w, 1]
