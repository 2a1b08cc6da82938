"""QPolicy: what Q-learning has learned, as a policy that no longer learns."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.errors import check_choice, check_count
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import ACTIONS, ENCODINGS, checked_actions, write_inputs
from mesa_swarm.learning.network_policy import NetworkPolicy
from mesa_swarm.learning.networks import Networks, forward
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.robots.design import RobotDesign


@dataclass(frozen=True, kw_only=True, eq=False)
class QPolicy(NetworkPolicy):
    """Choose an action by Boltzmann's probabilities of the values that networks give them.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        ``copies * actions`` of them, one robot's after the other's. The k-th robot acts by set ``k % copies``.
    actions : int
        4 or 8.
    encoding : str
        "distance" or "typed".
    temperature : float
        Of the choice, above 0.
    steps : int
        Robot-steps of training, 0 for none.
    training : dict
        Where it comes from, and figures of its training.

    Raises
    ------
    InvalidValueError
        If the networks do not fit the sensors and actions, or hold anything that is not finite.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    >>> policy.act([[20.0, -1.0, -1.0]], [[0, -1, -1]]).shape
    (1, 2)
    """

    family: ClassVar[str] = "q"
    counted: ClassVar[str] = "actions"
    actions: int = 8

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        checked_actions(self.actions)
        self._check_parts()

    @classmethod
    def untrained(
        cls,
        design: RobotDesign,
        *,
        rng: np.random.Generator,
        copies: int = 1,
        actions: int = 8,
        encoding: str = "distance",
        **more: Any,
    ) -> "QPolicy":
        """Return a policy with small random weights for a design; `more` are other fields of the policy."""
        sensors = SensorLayout.of(design)
        inputs = ENCODINGS[check_choice("encoding", encoding, ENCODINGS)] * len(sensors)
        count = check_count("copies", copies, minimum=1) * checked_actions(actions)
        networks = Networks.random(count, inputs=inputs, hidden=2 * len(sensors), rng=rng)
        return cls(sensors=sensors, networks=networks, actions=actions, encoding=encoding, **more)

    @property
    def group(self) -> int:
        """How many networks a robot has: one for each action."""
        return self.actions

    def values(
        self, readings: ArrayLike, kinds: ArrayLike | None = None, *, numbers: ArrayLike | None = None
    ) -> np.ndarray:
        """Return what every action is worth (n, actions), given readings and kinds (n, s); see `act`."""
        known = self._known(readings, kinds, numbers)
        values = np.empty((len(known[0]), self.actions))
        value_of_actions(*known, values)
        return values

    def act(
        self,
        readings: ArrayLike,
        kinds: ArrayLike | None = None,
        chance: ArrayLike | None = None,
        *,
        numbers: ArrayLike | None = None,
    ) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `Policy.act`.

        Parameters
        ----------
        readings, kinds, chance
            As for `Policy.act`.
        numbers : int ndarray, shape (n,), optional
            The robot with number k acts by set ``k % copies``; by default 0, 1, and so on.
        """
        return ACTIONS[self._taken(self.values(readings, kinds, numbers=numbers), chance)]


@compiled
def value_of_actions(distance, kind, ranges, weights, numbers, values):
    """Write what every action is worth to every robot (n, actions)."""
    robots, count = values.shape
    copies = weights[3].shape[0] // count
    now, hidden = np.empty((1, weights[0].shape[1])), np.empty(weights[0].shape[2])
    for i in range(robots):
        number = numbers[i] if numbers.shape[0] else i
        write_inputs(distance, kind, ranges, i, 0, now, 0)
        say_values(weights, (number % copies) * count, now, 0, hidden, values[i])


@compiled
def say_values(weights, first, inputs, row, hidden, values):
    """Write what each action is worth to one robot, by its networks from `first` on."""
    inner, inner_bias, outer, outer_bias = weights
    for a in range(values.shape[0]):
        values[a] = forward(inner, inner_bias, outer, outer_bias, first + a, inputs, row, hidden)
