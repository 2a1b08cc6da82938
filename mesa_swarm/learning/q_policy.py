"""QPolicy: what Q-learning has learned, as a policy that no longer learns."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import ACTIONS, ENCODINGS, best_of, chosen, write_inputs
from mesa_swarm.learning.networks import PARTS, Networks, check_networks, forward
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.robots.design import RobotDesign


@dataclass(frozen=True, kw_only=True, eq=False)
class QPolicy:
    """Choose an action by Boltzmann's probabilities of the values that networks give them.

    Parameters
    ----------
    sensors : SensorLayout
    networks : Networks
        ``copies * actions`` of them, one robot's after the other's. Robot i acts by set ``i % copies``.
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
    sensors: SensorLayout
    networks: Networks
    actions: int = 8
    encoding: str = "distance"
    temperature: float = 0.2
    steps: int = 0
    training: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        inputs = ENCODINGS[check_choice("encoding", self.encoding, ENCODINGS)] * len(self.sensors)
        if self.actions not in (4, 8):
            raise InvalidValueError(f"actions is {self.actions!r:.60}; expected 4 or 8")
        check_number("temperature", self.temperature, above=0)
        check_count("steps", self.steps, maximum=2**62)
        check_networks(self.networks, inputs, self.actions)

    @classmethod
    def untrained(cls, design: RobotDesign, *, rng: np.random.Generator, copies: int = 1, **options) -> "QPolicy":
        """Return a policy with small random weights for a design; `options` are fields of the policy."""
        sensors = SensorLayout.of(design)
        count = copies * options.get("actions", 8)
        inputs = ENCODINGS[options.get("encoding", "distance")] * len(sensors)
        networks = Networks.random(count, inputs=inputs, hidden=2 * len(sensors), rng=rng)
        return cls(sensors=sensors, networks=networks, **options)

    @property
    def copies(self) -> int:
        """How many robots' networks there are."""
        return len(self.networks.outer_bias) // self.actions

    def of_robot(self, index: int) -> "QPolicy":
        """Return the policy of one of the robots alone, to share it with others.

        Parameters
        ----------
        index : int
            0 to ``copies - 1``.
        """
        row = check_count("index", index, maximum=self.copies - 1) * self.actions
        networks = Networks(*(w[row : row + self.actions].copy() for w in self.networks.weights))
        return QPolicy(
            sensors=self.sensors, networks=networks, steps=self.steps, training=self.training, **self.settings()
        )

    def values(self, readings: np.ndarray, kinds: np.ndarray) -> np.ndarray:
        """Return what every action is worth (n, actions), given readings and kinds (n, s)."""
        distance, kind = self.sensors.check_readings(readings, kinds)
        values = np.empty((len(distance), self.actions))
        value_of_actions(distance, kind, np.array([self.sensors.ranges]), self.networks.weights, values)
        return values

    def act(self, readings: np.ndarray, kinds: np.ndarray, chance: np.ndarray | None = None) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `Policy.act`."""
        values = self.values(readings, kinds)
        shares = np.empty((len(values), 2))
        chances = np.empty(0) if chance is None else np.asarray(chance, dtype=float)
        if chance is not None and chances.shape != (len(values),):
            raise InvalidValueError(f"chance has shape {chances.shape}; expected ({len(values)},)")
        choose_all(values, float(self.temperature), chances, shares)
        return shares

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name."""
        return dict(zip(PARTS, self.networks.weights, strict=True))

    def settings(self) -> dict:
        """Return what else it takes to act."""
        return {"actions": self.actions, "encoding": self.encoding, "temperature": self.temperature}

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> "QPolicy":
        """Return the policy of these parts, as a file has them."""
        if sorted(arrays) != sorted(PARTS) or sorted(settings) != ["actions", "encoding", "temperature"]:
            raise InvalidValueError(f"a q policy has {', '.join(arrays)}; expected {', '.join(PARTS)}")
        networks = Networks(*(arrays[part] for part in PARTS))
        known = {**settings, "actions": check_count("actions", settings["actions"])}
        known["temperature"] = check_number("temperature", settings["temperature"])
        return cls(sensors=sensors, networks=networks, steps=steps, training=training, **known)


def check_start(start: QPolicy | None, actions: int, encoding: str) -> None:
    """Refuse a policy that a learner with these actions and this encoding cannot go on with.

    Raises
    ------
    InvalidValueError
    """
    if start is None:
        return
    if not isinstance(start, QPolicy):
        raise InvalidValueError(f"start is {shortened(start)}; expected a QPolicy, as load_policy() returns it")
    if (start.actions, start.encoding) != (actions, encoding):
        raise InvalidValueError(
            f"start has {start.actions} actions and encoding {start.encoding!r}; expected {actions} and {encoding!r}"
        )


@compiled
def value_of_actions(distance, kind, ranges, weights, values):
    """Write what every action is worth to every robot (n, actions)."""
    inner, inner_bias, outer, outer_bias = weights
    robots, count = values.shape
    copies = outer_bias.shape[0] // count
    now, hidden = np.empty((1, inner.shape[1])), np.empty(inner.shape[2])
    for i in range(robots):
        write_inputs(distance, kind, ranges, i, 0, now, 0)
        for a in range(count):
            m = (i % copies) * count + a
            values[i, a] = forward(inner, inner_bias, outer, outer_bias, m, now, 0, hidden)


@compiled
def choose_all(values, temperature, chance, shares):
    """Write the chosen actions' wheel commands; without chances, those that are worth most."""
    for i in range(values.shape[0]):
        a = chosen(values[i], temperature, chance[i]) if chance.shape[0] else best_of(values[i])
        shares[i, 0] = ACTIONS[a, 0]
        shares[i, 1] = ACTIONS[a, 1]
