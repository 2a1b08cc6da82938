"""Tables of values of actions in discrete states, as `TableQLearning` and `LearnFires` learn them."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number
from mesa_swarm.learning.actions import as_floats
from mesa_swarm.learning.learner import ChoosingLayer
from mesa_swarm.learning.policy import SensorLayout, check_layout

HOTTEST = 1e6


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class ValueTables:
    """Values of actions in states, one table or several: base class of `TablePolicy` and `SkillPolicy`.

    Parameters
    ----------
    sensors : SensorLayout
        Of the robots that learned.
    values : ndarray, shape (copies, states, actions)
        The k-th robot acts by table ``k % copies``.
    temperature : float
        Of the choice, above 0.
    steps : int
        Robot-steps of training, 0 for none.
    training : dict
        Provenance, and figures of its training.
    """

    sensors: SensorLayout
    values: np.ndarray
    temperature: float = 0.2
    steps: int = 0
    training: dict = field(default_factory=dict)

    def _check(self, states: int, actions: int) -> None:
        """Refuse tables of another shape, and what is out of its range."""
        check_layout(self.sensors)
        values = as_floats(self.values)
        if values.ndim != 3 or not len(values) or values.shape[1:] != (states, actions):
            raise InvalidValueError(f"values have shape {values.shape}; expected (copies, {states}, {actions})")
        if not np.isfinite(values).all():
            raise InvalidValueError("values hold numbers that are not finite; train the policy anew")
        object.__setattr__(self, "values", values)
        check_number("temperature", self.temperature, above=0, maximum=HOTTEST)
        check_count("steps", self.steps, maximum=2**62)

    @property
    def copies(self) -> int:
        """The number of robots' tables."""
        return len(self.values)

    def of_robot(self, index: int) -> Self:
        """Return the policy of one robot, 0 to ``copies - 1``, to share it with others."""
        k = check_count("index", index, maximum=self.copies - 1)
        return replace(self, values=self.values[k : k + 1].copy())


class TableLayer(ChoosingLayer):
    """Base of layers that learn such tables."""

    shared: bool

    def _init_robots(self, new: np.ndarray, known: np.ndarray) -> None:
        """Let new robots begin with the table that is shared, or with those of the start."""
        values = self._column("values")
        if self.shared and len(known):
            values[new] = values[known[0]]
        elif self.start is not None:
            number = np.zeros_like(new) if self.shared else self._robots.columns["number"][new]
            values[new] = self.start.values[number % self.start.copies]
