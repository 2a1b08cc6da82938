"""WirePolicy: what `WireFittedQ` has learned, as a policy that no longer learns."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.errors import check_count
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import ACTIONS, write_inputs
from mesa_swarm.learning.network_policy import NetworkPolicy
from mesa_swarm.learning.networks import forward
from mesa_swarm.learning.wire_fitting import squashed

# Where wires begin: at the thesis's actions, but inside of the limits, from where they can move.
STARTS = 0.8 * ACTIONS
# Networks of a wire: what they say of the left wheel, of the right wheel, of the value.
OUTPUTS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class WirePolicy(NetworkPolicy):
    """Choose one of the actions that networks propose, by Boltzmann's probabilities of their values.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        ``copies * wires * 3`` of them: of every wire the left wheel, the right wheel, the value. The k-th robot
        acts by set ``k % copies``.
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
    counted: ClassVar[str] = "wires"
    wires: int = 4

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        object.__setattr__(self, "wires", check_count("wires", self.wires, minimum=1, maximum=len(STARTS)))
        self._check_parts()

    @property
    def group(self) -> int:
        """How many networks a robot has: three for each wire."""
        return OUTPUTS * self.wires

    def proposals(
        self, readings: ArrayLike, kinds: ArrayLike | None = None, *, numbers: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the wires' actions (n, w, 2) and what they are worth (n, w), given readings and kinds (n, s)."""
        known = self._known(readings, kinds, numbers)
        actions, values = np.empty((len(known[0]), self.wires, 2)), np.empty((len(known[0]), self.wires))
        propose_all(*known, actions, values)
        return actions, values

    def act(
        self,
        readings: ArrayLike,
        kinds: ArrayLike | None = None,
        chance: ArrayLike | None = None,
        *,
        numbers: ArrayLike | None = None,
    ) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `QPolicy.act`."""
        actions, values = self.proposals(readings, kinds, numbers=numbers)
        return actions[np.arange(len(values)), self._taken(values, chance)]


@compiled
def propose_all(distance, kind, ranges, weights, numbers, actions, values):
    """Write the wires' actions (n, w, 2) and values (n, w) of every robot."""
    robots, wires = values.shape
    copies = weights[3].shape[0] // (OUTPUTS * wires)
    now, hidden = np.empty((1, weights[0].shape[1])), np.empty((OUTPUTS * wires, weights[0].shape[2]))
    for i in range(robots):
        number = numbers[i] if numbers.shape[0] else i
        write_inputs(distance, kind, ranges, i, 0, now, 0)
        propose(weights, (number % copies) * OUTPUTS * wires, now, 0, hidden, actions[i], values[i])


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
