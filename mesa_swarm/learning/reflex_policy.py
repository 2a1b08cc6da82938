"""Reflexes: weights from readings to wheels, with optional recurrent units and mirror symmetry."""

from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, shortened
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import tanh
from mesa_swarm.learning.policy import (
    DOUBLE,
    LearnedPolicy,
    SensorLayout,
    checked_chances,
    checked_numbers,
)
from mesa_swarm.world.statics import ROBOT

# A wheel's sum is clipped to [-1, 1], or made full speed ahead or back, or softly limited.
SQUASHES = ("linear", "threshold", "tanh")
# Inputs a sensor.
REFLEX_ENCODINGS = {"distance": 1, "typed": 2}
PARTS = ("hidden", "wheel")
# The last rows of weights.
WHIM, CONSTANT = -2, -1
MOST_UNITS = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class ReflexPolicy(LearnedPolicy):
    """Drive each wheel by a weighted sum of how near things are.

    With the proximities ``p_s = 1 - reading / range`` (0 where nothing is in range), h the hidden units' outputs in the
    step before, and a whim z drawn uniformly from -1 to 1,

        ``h <- tanh(U' (p, h, z, 1))``, ``wheels = squash(W' (p, h, z, 1))``

    Without hidden units it is a reflex, as Braitenberg's vehicles have them; with them a small recurrent network,
    which can finish a turn to one side. Without the whim, robots repeat the same path.
    Where the encoding is "typed", p holds the s proximities twice: of all things, and of robots alone.

    Parameters
    ----------
    sensors : SensorLayout
    hidden : ndarray, shape (copies, s + u + 2, u) or, typed, (copies, 2 s + u + 2, u)
        U, the weights into the u hidden units: from the proximities, from the units themselves, from the whim, and
        a constant. The k-th robot acts by set ``k % copies``.
    wheel : ndarray, shape (copies, s + u + 2, 2) or, typed, (copies, 2 s + u + 2, 2)
        W, the weights to the left and right wheel.
    squash : str
        "linear" (cut off at -1 and 1), "threshold" (-1 or 1) or "tanh".
    encoding : str
        "distance", or "typed": also whether a sensor sees a robot.
    steps, training
        As for `QPolicy`.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If the weights do not fit the sensors, or are not finite.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> eyes = SensorLayout.of(AGENT3)
    >>> away = ReflexPolicy.reflex(eyes, [[0, 0], [0, -2], [-2, 0], [1, 1]])  # of front, left, right; a constant
    >>> away.act([[-1.0, -1.0, -1.0], [-1.0, 25.0, -1.0]])
    array([[1., 1.],
           [1., 0.]])
    """

    family: ClassVar[str] = "reflex"
    stored: ClassVar[tuple[str, ...]] = PARTS
    of_copies: ClassVar[tuple[str, ...]] = PARTS
    checks: ClassVar[dict] = {
        "squash": partial(check_choice, choices=SQUASHES),
        "encoding": partial(check_choice, choices=REFLEX_ENCODINGS),
    }
    sensors: SensorLayout
    hidden: np.ndarray
    wheel: np.ndarray
    squash: str = "linear"
    encoding: str = "distance"
    steps: int = 0
    training: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_settings()
        hidden, wheel = np.asarray(self.hidden), np.asarray(self.wheel)
        copies, units = (hidden.shape[0], hidden.shape[-1]) if hidden.ndim == 3 else (0, 0)
        rows = rows_of(self.sensors, units, self.encoding)
        if not copies or hidden.shape != (copies, rows, units) or wheel.shape != (copies, rows, 2):
            raise InvalidValueError(
                f"hidden and wheel have the shapes {hidden.shape} and {wheel.shape}; expected (copies, {rows}, u) "
                f"and (copies, {rows}, 2): inputs of {len(self.sensors)} sensors, u hidden units, a whim, a constant"
            )
        if not (np.isfinite(hidden).all() and np.isfinite(wheel).all()):
            raise InvalidValueError("hidden or wheel holds weights that are not finite; train them anew")

    @classmethod
    def reflex(cls, sensors: SensorLayout, weights: ArrayLike, squash: str = "linear") -> "ReflexPolicy":
        """Return a reflex designed by hand, which needs no training: weights (s + 1, 2), no whim."""
        checked = np.array(fill_masked(weights), dtype=float)
        if checked.shape != (len(sensors) + 1, 2):
            raise InvalidValueError(f"weights have shape {checked.shape}; expected ({len(sensors) + 1}, 2)")
        wheel = np.insert(checked, len(sensors), 0.0, axis=0)[None]
        return cls(sensors=sensors, hidden=np.zeros((1, len(wheel[0]), 0)), wheel=wheel, squash=squash, steps=1)

    @classmethod
    def of_genome(
        cls, sensors: SensorLayout, genome: ArrayLike, *, units: int = 0, encoding: str = "distance", **more: Any
    ) -> "ReflexPolicy":
        """Return the policy whose weights are these numbers, row by row: into the hidden units, then to the wheels.

        There are `genome_length` of them, for 0 to 64 hidden `units`; 0 make reflexes. `encoding` is what its inputs
        are, see `ReflexPolicy`; `more` are other fields of the policy.
        """
        rows, genes = rows_of(sensors, units, encoding), np.array(fill_masked(genome), dtype=float)
        if genes.shape != (rows * (units + 2),):
            raise InvalidValueError(f"genome has shape {genes.shape}; expected ({rows * (units + 2)},)")
        hidden, wheel = np.split(genes, [rows * units])
        shaped, wheels = hidden.reshape(1, rows, units), wheel.reshape(1, rows, 2)
        return cls(sensors=sensors, encoding=encoding, hidden=shaped, wheel=wheels, **more)

    @property
    def memory(self) -> int:
        """The number of values each robot remembers from one step to the next."""
        return self.hidden.shape[2]

    def act(
        self,
        readings: ArrayLike,
        kinds: ArrayLike | None = None,
        chance: ArrayLike | None = None,
        memory: np.ndarray | None = None,
        *,
        numbers: ArrayLike | None = None,
    ) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `Policy.act`.

        Parameters
        ----------
        readings, kinds, chance
            As for `Policy.act`; the whim is ``2 chance - 1``, without chances 0.
        memory : float64 ndarray, shape (n, u), written
            The hidden units' outputs in the step before; 0 without it.
        numbers : int ndarray, shape (n,), optional
            The robot with number k acts by set ``k % copies``; by default 0, 1, and so on.
        """
        distance, kind = self.sensors.check_readings(readings, kinds, self.encoding)
        state = np.zeros((len(distance), self.memory)) if memory is None else memory
        if getattr(state, "dtype", None) != DOUBLE or state.shape != (len(distance), self.memory):
            raise InvalidValueError(
                f"memory is {shortened(memory)}; expected an array of float64, shape {(len(distance), self.memory)}"
            )
        shares = np.empty((len(distance), 2))
        chances = np.full(len(distance), 0.5) if chance is None else checked_chances(chance, len(distance))
        squash, typed = SQUASHES.index(self.squash), self.encoding == "typed"
        count = checked_numbers(numbers, len(distance))
        react(distance, kind, self._ranges, self.hidden, self.wheel, squash, typed, chances, count, state, shares)
        return shares

    @cached_property
    def _ranges(self) -> np.ndarray:
        return np.array(self.sensors.ranges)

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> Self:
        """Return the policy with these parts, from a file; older ones have no encoding."""
        return super().restored(sensors, steps, training, {"encoding": "distance", **settings}, arrays)


def rows_of(sensors: SensorLayout, units: int, encoding: str = "distance") -> int:
    """Return the number of inputs of a unit or wheel: of sensors, hidden units, the whim and the constant."""
    inputs = REFLEX_ENCODINGS[check_choice("encoding", encoding, REFLEX_ENCODINGS)] * len(sensors)
    return inputs + check_count("units", units, maximum=MOST_UNITS) + 2


def genome_length(sensors: SensorLayout, units: int, encoding: str = "distance") -> int:
    """Return the number of weights of a policy."""
    return rows_of(sensors, units, encoding) * (units + 2)


@compiled
def react(distance, kind, ranges, hidden, wheel, squash, typed, chance, numbers, memory, shares):
    """Write the wheel commands of every robot (n, 2), and its hidden units' new outputs (n, u)."""
    sensors, units = distance.shape[1], memory.shape[1]
    inputs = 2 * sensors if typed else sensors
    senses, outputs = np.empty(inputs + units + 2), np.empty(units)
    senses[inputs + units + 1] = 1.0
    for i in range(distance.shape[0]):
        number = numbers[i] if numbers.shape[0] else i
        copy = number % wheel.shape[0]
        for s in range(sensors):
            senses[s] = nearness(distance[i, s], ranges[s])
            if typed:
                senses[sensors + s] = senses[s] if kind[i, s] == ROBOT else 0.0
        for u in range(units):
            senses[inputs + u] = memory[i, u]
        senses[inputs + units] = 2.0 * chance[i] - 1.0
        for u in range(units):
            outputs[u] = tanh(weighted(hidden, copy, u, senses))
        for u in range(units):
            senses[inputs + u] = outputs[u]
            memory[i, u] = outputs[u]
        for side in range(2):
            shares[i, side] = squashed_sum(squash, weighted(wheel, copy, side, senses))


@compiled
def nearness(distance, reach):
    """Return the proximity of a reading: 1 touching, 0 nothing in range."""
    if distance < 0.0 or reach <= 0.0:
        return 0.0
    return 1.0 - min(distance / reach, 1.0)


@compiled
def weighted(weights, copy, column, inputs):
    """Return the weighted sum of the inputs."""
    total = 0.0
    for k in range(inputs.shape[0]):
        total += weights[copy, k, column] * inputs[k]
    return total


@compiled
def squashed_sum(squash, total):
    """Return a wheel command in [-1, 1]; `squash` is an index into `SQUASHES`."""
    if squash == 0:
        return min(max(total, -1.0), 1.0)
    if squash == 1:
        return 1.0 if total > 0.0 else -1.0
    return tanh(total)


def half_length(sensors: SensorLayout, units: int, encoding: str = "distance") -> int:
    """Return the number of free weights of a mirror-symmetric policy."""
    twins_of(sensors)
    if check_count("units", units) % 2:
        raise InvalidValueError(f"units is {units}; expected an even number, as units of a mirrored policy are pairs")
    return genome_length(sensors, units, encoding) // 2


def whole_genome(sensors: SensorLayout, half: np.ndarray, *, units: int = 0, encoding: str = "distance") -> np.ndarray:
    """Return the weights of a policy whose actions are mirrored where its readings are, for `ReflexPolicy.of_genome`.

    `half` holds `half_length` numbers: the left wheel's weights and those of the first half of the hidden units: row by
    row into the units, then one column to the wheel. The right wheel and the other units have the same ones, exchanged
    between sensors at mirrored bearings and between mirrored units; the whim's weight changes its sign. Such a robot
    has no preferred side, and half as many weights to search.
    """
    rows, genes = rows_of(sensors, units, encoding), np.array(half, dtype=float)
    length = half_length(sensors, units, encoding)
    if genes.shape != (length,):
        raise InvalidValueError(f"half a genome has shape {genes.shape}; expected ({length},)")
    hidden, wheel = np.split(genes, [rows * (units // 2)])
    order, signs = _mirrored_rows(sensors, units, rows)
    columns = hidden.reshape(rows, units // 2), wheel.reshape(rows, 1)
    return np.concatenate([np.hstack([own, own[order] * signs[:, None]]).ravel() for own in columns])


def twins_of(sensors: SensorLayout) -> np.ndarray:
    """Return for each sensor the index of its mirror image; one that looks ahead or back is its own."""
    eyes, twins = sensors.rows, []
    for bearing, *rest in eyes:
        mirrors = [k for k, (other, *more) in enumerate(eyes) if more == rest and (other + bearing) % 360.0 == 0.0]
        if not mirrors:
            raise InvalidValueError(
                f"the sensor at {bearing:g} degrees has no mirror image; expected the same one at {-bearing:g} degrees"
            )
        twins.append(mirrors[0])
    return np.array(twins, np.int64)


def _mirrored_rows(sensors: SensorLayout, units: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the source row and the sign of each row of the mirrored weights."""
    count = rows - units - 2
    twins = twins_of(sensors)
    of_eyes = [twins + first for first in range(0, count, max(len(sensors), 1))]
    of_units = count + np.roll(np.arange(units), units // 2)
    order = np.concatenate([*of_eyes, of_units, [rows + WHIM, rows + CONSTANT]]).astype(np.int64)
    signs = np.ones(rows)
    signs[WHIM] = -1.0
    return order, signs
