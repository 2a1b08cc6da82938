"""Stacks of small networks, back-propagation, and policies that choose by network outputs."""

import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, LearningError, check_choice, check_count, check_number, shortened
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_between, stream_of
from mesa_swarm.kernels.elementary import exp, tanh, write_tanh
from mesa_swarm.kernels.type_names import Reals
from mesa_swarm.learning.actions import ENCODINGS, as_floats, describe_value
from mesa_swarm.learning.policy import ChoosingPolicy, LearnedPolicy, SensorLayout, checked_numbers

# Of the thesis's regression (6.4); for robots it used 0.1 (8.3).
REGRESSION_RATE = 0.5
PARTS = ("inner", "inner_bias", "outer", "outer_bias")
# Hidden units (thesis 6.1).
TANH = "tanh"
ACTIVATIONS = (TANH, "step", "linear", "logistic")
# Indices of the others.
STEP, LINEAR, LOGISTIC = range(1, 4)
# How tasks that are learned one after another are rehearsed, without which networks forget them (thesis 6.4).
REHEARSALS = ("none", "interleaved", "consolidated")


@dataclass(frozen=True, eq=False)
class Networks:
    """Networks of one form, stacked; the arrays change when they learn.

    ``y = b + sum_h v_h tanh(c_h + sum_k w_kh x_k)``: b and c_h are the weights of the bias units, whose
    output is 1 (thesis 6.1).

    Parameters
    ----------
    inner : ndarray, shape (m, k, h)
        From k inputs to h hidden units.
    inner_bias, outer : ndarrays, shape (m, h)
    outer_bias : ndarray, shape (m,)
    activation : str
        Of hidden units, of the sum x of their inputs: "tanh", "step" (1 from 0 on, else 0), "linear" (k x) or
        "logistic" (1 / (1 + e^(-k x))). A step has no gradient: learning replaces its slope by that of the logistic
        unit, while its output stays a step. Policies have units of tanh.
    gain : float
        The k above, also of tanh(k x); above 0.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If the four are not arrays of finite float64 numbers that fit together.

    Examples
    --------
    >>> Networks.random(3, inputs=9, rng=np.random.default_rng(1)).inner.shape
    (3, 9, 18)
    """

    inner: np.ndarray
    inner_bias: np.ndarray
    outer: np.ndarray
    outer_bias: np.ndarray
    activation: str = field(default=TANH, kw_only=True)
    gain: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        check_choice("activation", self.activation, ACTIVATIONS)
        check_number("gain", self.gain, above=0, maximum=1e6)
        # Compiled functions do not check bounds.
        first = self.inner
        m, k, h = first.shape if isinstance(first, np.ndarray) and first.ndim == 3 else ("m", "k", "h")
        shapes = ((m, k, h), (m, h), (m, h), (m,))
        for name, part, shape in zip(PARTS, self.weights, shapes, strict=True):
            if not isinstance(part, np.ndarray) or part.dtype != np.float64 or part.shape != shape:
                raise InvalidValueError(
                    f"{name} is {describe_value(part)}; expected an array of float64, shape {_row(shape)}"
                )
            if not np.isfinite(part).all():
                raise InvalidValueError(f"{name} holds weights that are not finite; train them anew")

    @classmethod
    def random(
        cls,
        count: int,
        *,
        inputs: int,
        rng: np.random.Generator,
        hidden: int | None = None,
        activation: str = TANH,
        gain: float = 1.0,
    ) -> "Networks":
        """Return networks with small random weights: uniform within 1 / sqrt(weights that feed the node) (6.4).

        Parameters
        ----------
        count, inputs : int
            At least 1.
        rng : numpy.random.Generator
        hidden : int, optional
            Hidden units, twice the inputs by default (thesis 8.1).
        activation, gain
            Of hidden units.
        """
        if not isinstance(rng, np.random.Generator):
            raise InvalidValueError(
                f"rng is {shortened(rng)}; expected a generator such as numpy.random.default_rng(1)"
            )
        m, k = check_count("count", count, minimum=1), check_count("inputs", inputs, minimum=1)
        h = 2 * k if hidden is None else check_count("hidden", hidden, minimum=1)
        return cls(*random_weights(m, k, h, rng), activation=activation, gain=gain)

    @property
    def weights(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The four arrays, for the compiled functions."""
        return self.inner, self.inner_bias, self.outer, self.outer_bias

    def outputs(self, inputs: ArrayLike) -> np.ndarray:
        """Return the output of every network (m,) for its own inputs (m, k)."""
        rows, out = self._checked("inputs", inputs, self.inner.shape[:2]), np.empty(len(self.inner))
        write_outputs(*self._units, *self.weights, rows, out)
        return out

    def learn(self, inputs: ArrayLike, targets: ArrayLike, rate: float = REGRESSION_RATE) -> np.ndarray:
        """Take one step of gradient descent on ``(target - y)^2 / 2`` in every network (6.2).

        Inputs are (m, k), targets (m,), and `rate` is the learning rate eta, 0 to 1. Returned are the errors
        ``target - y`` (m,) before the step.
        """
        rows = self._checked("inputs", inputs, self.inner.shape[:2])
        desired = self._checked("targets", targets, self.outer_bias.shape)
        errors, rate = np.empty(len(desired)), check_number("rate", rate, minimum=0, maximum=1)
        descend(*self._units, *self.weights, rows, desired, rate, errors)
        return errors

    @property
    def _units(self) -> tuple[int, float]:
        """The kind and gain of hidden units."""
        return ACTIVATIONS.index(self.activation), float(self.gain)

    def _checked(self, name: str, values: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
        array = as_floats(values)
        if array.shape != shape or not np.isfinite(array).all():
            raise InvalidValueError(f"{name} is {shortened(values)}; expected finite numbers of shape {shape}")
        return array


class WeightArrays(NamedTuple):
    """What `draw_weights` takes: the four arrays of `Networks` in one row each, their limits, and a stream."""

    inner: Reals
    inner_bias: Reals
    outer: Reals
    outer_bias: Reals
    low: float
    high: float
    stream: Stream

    @classmethod
    def of(cls, weights: Sequence[np.ndarray], rng: np.random.Generator) -> "WeightArrays":
        """Collect these of weights in C order; the generator has to live as long."""
        inputs, hidden = weights[0].shape[1:]
        low, high = 1 / math.sqrt(inputs + 1), 1 / math.sqrt(hidden + 1)
        inner, inner_bias, outer, outer_bias = (array.reshape(-1) for array in weights)
        return cls(inner, inner_bias, outer, outer_bias, low, high, stream_of(rng))


@compiled(nogil=True)
def draw_weights(block, step, first, last):
    """Draw weights uniform within 1 / sqrt(weights that feed the node), the bias included."""
    w = unpack(block, WeightArrays)
    draw_all(w.inner, w.low, w.stream)
    draw_all(w.inner_bias, w.low, w.stream)
    draw_all(w.outer, w.high, w.stream)
    draw_all(w.outer_bias, w.high, w.stream)
    return 0


@compiled
def draw_all(numbers, limit, stream):
    """Draw the numbers of an array, one after the other, uniform within a limit."""
    for k in range(numbers.shape[0]):
        numbers[k] = draw_between(stream, -limit, limit)


def random_weights(networks: int, inputs: int, hidden: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Return the four arrays of `Networks`, uniform within 1 / sqrt(weights that feed the node), the bias included."""
    shapes = (inputs, hidden), (hidden,), (hidden,), ()
    weights = [np.empty((networks, *shape)) for shape in shapes]
    draw_weights(Block(WeightArrays.of(weights, rng)).numbers, 0, 0, 0)
    return weights


def fit(
    x: np.ndarray,
    y: np.ndarray,
    *,
    rng: np.random.Generator,
    networks: int = 1,
    hidden: int = 2,
    presentations: int = 200,
    rate: float = REGRESSION_RATE,
    activation: str = TANH,
    gain: float = 1.0,
) -> Networks:
    """Fit networks of one input to noisy points: the thesis's demonstration of regression (6.3).

    Every round presents all points, in an order drawn for each network and round.

    Parameters
    ----------
    x, y : ndarrays, shape (p,)
        Finite; both of order 1.
    rng : numpy.random.Generator
    networks : int
        The number of fits, each from its own random weights.
    hidden, presentations : int
        Hidden units, and rounds.
    rate : float
        Learning rate.
    activation, gain
        Of hidden units, see `Networks`.

    Returns
    -------
    Networks

    Raises
    ------
    InvalidValueError
        If x and y are not equally many finite numbers, or another value is out of its range.
    LearningError
        If it diverged.

    Examples
    --------
    >>> x = np.linspace(-1, 1, 20)
    >>> fitted = fit(x, np.tanh(2 * x), rng=np.random.default_rng(1))
    >>> abs(fitted.outputs([[0.5]])[0] - np.tanh(1.0)) < 0.1
    np.True_
    """
    networks = check_count("networks", networks, minimum=1)
    stack = Networks.random(networks, inputs=1, hidden=hidden, rng=rng, activation=activation, gain=gain)
    present(stack, points_of(x, y), rng=rng, presentations=presentations, rate=rate)
    return stack


def fit_in_turn(
    tasks: Sequence[tuple[ArrayLike, ArrayLike]],
    *,
    rng: np.random.Generator,
    rehearsal: str = "none",
    networks: int = 1,
    hidden: int = 8,
    presentations: int = 200,
    rate: float = 0.1,
    activation: str = TANH,
) -> list[Networks]:
    """Fit the same networks to one task after another; return them as they are after each.

    Parameters
    ----------
    tasks : sequence of (x, y), ndarrays of shape (p,)
        Points, as for `fit`.
    rng : numpy.random.Generator
    rehearsal : str
        "none": only the points of the task are presented. "interleaved": together with them, the stored points of all
        earlier tasks, in every round. "consolidated": the points of the task alone, and afterwards as many rounds with
        all stored points, those of the task included: twice the presentations.
    networks, hidden, presentations, rate, activation
        As for `fit`.

    Returns
    -------
    list of Networks
        One for each task.

    Raises
    ------
    InvalidValueError, UnknownNameError, LearningError

    Examples
    --------
    >>> left, right = np.linspace(-1, -0.1, 10), np.linspace(0.1, 1, 10)
    >>> tasks = [(left, np.full(10, -0.5)), (right, np.full(10, 0.5))]
    >>> after = {way: fit_in_turn(tasks, rng=np.random.default_rng(1), rehearsal=way)[1] for way in REHEARSALS}
    >>> [bool(abs(after[way].outputs([[-0.5]])[0] + 0.5) < 0.2) for way in REHEARSALS]
    [False, True, True]
    """
    check_choice("rehearsal", rehearsal, REHEARSALS)
    points_of_tasks = _checked_tasks(tasks)
    stack = Networks.random(
        check_count("networks", networks, minimum=1), inputs=1, hidden=hidden, rng=rng, activation=activation
    )
    after = []
    for k, points in enumerate(points_of_tasks):
        stored = np.concatenate(points_of_tasks[: k + 1])
        first = stored if rehearsal == "interleaved" else points
        for rounds in (first, stored) if rehearsal == "consolidated" else (first,):
            present(stack, rounds, rng=rng, presentations=presentations, rate=rate)
        after.append(deepcopy(stack))
    return after


def _checked_tasks(tasks: Sequence[tuple[ArrayLike, ArrayLike]]) -> list[np.ndarray]:
    """Return the points of each task (p, 2)."""
    try:
        pairs = [(x, y) for x, y in tasks]
    except (TypeError, ValueError):
        raise InvalidValueError(f"tasks is {shortened(tasks)}; expected pairs (x, y) of arrays") from None
    if not pairs:
        raise InvalidValueError("tasks is empty; give at least one pair (x, y)")
    return [points_of(x, y) for x, y in pairs]


def present(stack: Networks, points: np.ndarray, *, rng: np.random.Generator, presentations: int, rate: float) -> None:
    """Let networks of one input learn from points (p, 2), all in every round, in orders drawn at random."""
    networks = len(stack.outer_bias)
    for _ in range(check_count("presentations", presentations)):
        order = rng.permuted(np.tile(np.arange(len(points)), (networks, 1)), axis=1)
        for shown in order.T:
            stack.learn(points[shown, :1], points[shown, 1], rate)
    if not all(np.isfinite(part).all() for part in stack.weights):
        raise LearningError(f"the fit diverged: its weights are not finite; lower rate, which is {rate:g}, or scale y")


def points_of(x: ArrayLike, y: ArrayLike) -> np.ndarray:
    """Return x and y as rows of points (p, 2)."""
    columns = {"x": as_floats(x), "y": as_floats(y)}
    for name, column in columns.items():
        if column.ndim != 1 or not len(column) or not np.isfinite(column).all():
            raise InvalidValueError(f"{name} is {describe_value(column)}; expected a row of finite numbers")
    if len(columns["x"]) != len(columns["y"]):
        raise InvalidValueError(f"x has {len(columns['x'])} numbers and y {len(columns['y'])}; expected equal lengths")
    return np.column_stack([columns["x"], columns["y"]])


def _row(shape: tuple[int | str, ...]) -> str:
    """Return a shape, of which some sides may be names."""
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"


@compiled
def write_outputs(kind, gain, inner, inner_bias, outer, outer_bias, inputs, out):
    """Write the output of every network for its own row of inputs (m, k)."""
    hidden, slopes = np.empty(inner.shape[2]), np.empty(inner.shape[2])
    for m in range(inner.shape[0]):
        out[m] = output_of(kind, gain, inner, inner_bias, outer, outer_bias, m, inputs, hidden, slopes)


@compiled
def descend(kind, gain, inner, inner_bias, outer, outer_bias, inputs, targets, rate, errors):
    """Take one step of gradient descent in every network; write the errors before it."""
    hidden, slopes = np.empty(inner.shape[2]), np.empty(inner.shape[2])
    for m in range(inner.shape[0]):
        errors[m] = targets[m] - output_of(kind, gain, inner, inner_bias, outer, outer_bias, m, inputs, hidden, slopes)
        step = rate * errors[m]
        outer_bias[m] += step
        for h in range(hidden.shape[0]):
            back = step * outer[m, h] * slopes[h]
            outer[m, h] += step * hidden[h]
            inner_bias[m, h] += back
            for k in range(inner.shape[1]):
                inner[m, k, h] += back * inputs[m, k]


@compiled
def output_of(kind, gain, inner, inner_bias, outer, outer_bias, m, inputs, hidden, slopes):
    """Return the output of network m for row m of the inputs; write the outputs and slopes of its hidden units."""
    y = outer_bias[m]
    for h in range(hidden.shape[0]):
        total = inner_bias[m, h]
        for k in range(inner.shape[1]):
            total += inner[m, k, h] * inputs[m, k]
        hidden[h], slopes[h] = activated(kind, gain, total)
        y += outer[m, h] * hidden[h]
    return y


@compiled
def activated(kind, gain, x):
    """Return the output of a unit for the sum of its inputs, and its slope; of an index into `ACTIVATIONS`.

    The slope of a step is that of the logistic unit: its own is 0, and at 0 infinite.
    """
    if kind == LINEAR:
        return gain * x, gain
    if kind in (STEP, LOGISTIC):
        y = 1.0 / (1.0 + exp(-gain * x))
        return (y if kind == LOGISTIC else 1.0 if x >= 0.0 else 0.0), gain * y * (1.0 - y)
    y = tanh(gain * x)
    return y, gain * (1.0 - y * y)


@compiled
def forward(inner, inner_bias, outer, outer_bias, m, inputs, i, hidden):
    """Return the output of network m for row i of the inputs; write its hidden units' outputs to `hidden`."""
    units = hidden.shape[0]
    for h in range(units):
        hidden[h] = inner_bias[m, h]
    for k in range(inner.shape[1]):
        x = inputs[i, k]
        for h in range(units):
            hidden[h] += inner[m, k, h] * x
    write_tanh(hidden)
    y = outer_bias[m]
    for h in range(units):
        y += outer[m, h] * hidden[h]
    return y


@compiled
def back_propagate(inner, inner_bias, outer, outer_bias, m, inputs, i, hidden, step):
    """Add ``step * dy/dw`` to every weight w of network m; `hidden`, from `forward`, is overwritten."""
    units = hidden.shape[0]
    outer_bias[m] += step
    for h in range(units):
        output = hidden[h]
        hidden[h] = step * outer[m, h] * (1.0 - output * output)
        outer[m, h] += step * output
        inner_bias[m, h] += hidden[h]
    for k in range(inner.shape[1]):
        x = inputs[i, k]
        for h in range(units):
            inner[m, k, h] += hidden[h] * x


class PolicyOfNetworks(LearnedPolicy):
    """Base of policies that choose by the outputs of networks, stored as the four arrays of their weights."""

    __slots__ = ()
    stored: ClassVar[tuple[str, ...]] = PARTS
    networks: Networks

    @property
    def group(self) -> int:
        """The number of networks of a robot."""
        raise NotImplementedError

    @property
    def copies(self) -> int:
        """The number of robots' sets of networks: the k-th robot acts by set ``k % copies``."""
        return len(self.networks.outer_bias) // self.group

    def _set_of(self, k: int) -> dict[str, Any]:
        rows = slice(k * self.group, (k + 1) * self.group)
        return {"networks": Networks(*(weights[rows].copy() for weights in self.networks.weights))}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name."""
        return dict(zip(PARTS, self.networks.weights, strict=True))

    @classmethod
    def _of_arrays(cls, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
        return {"networks": Networks(*(arrays[part] for part in PARTS))}

    def _check_networks(self) -> None:
        """Check that these are networks, and the other fields."""
        self._check_settings()
        if not isinstance(self.networks, Networks):
            raise InvalidValueError(f"networks is {shortened(self.networks)}; expected Networks(...)")


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkPolicy(PolicyOfNetworks, ChoosingPolicy):
    """Base of `QPolicy` and `WirePolicy`, which choose by Boltzmann's probabilities of network outputs."""

    checks: ClassVar[dict[str, Callable[[str, Any], object]]] = {
        "encoding": partial(check_choice, choices=ENCODINGS),
        "temperature": partial(check_number, above=0),
    }
    choices_field: ClassVar[str]  # the field with the number of choices
    networks_per_choice: ClassVar[int]  # networks for each choice
    sensors: SensorLayout
    networks: Networks
    encoding: str = "distance"
    temperature: float = 0.2
    steps: int = 0
    training: dict = field(default_factory=dict)

    @property
    def group(self) -> int:
        """The number of networks of a robot."""
        return self.networks_per_choice * getattr(self, self.choices_field)

    def _check_parts(self) -> None:
        """Check that the networks form groups for robots with these sensors."""
        self._check_networks()
        inputs = ENCODINGS[self.encoding] * len(self.sensors)
        if (self.networks.activation, self.networks.gain) != (TANH, 1):
            raise InvalidValueError(
                f"networks have {self.networks.activation} units of gain {self.networks.gain:g}; expected tanh of gain "
                "1, as robots learn with"
            )
        m, k, _ = self.networks.inner.shape
        weights = self.networks.weights
        if not m or m % self.group or k != inputs:
            raise InvalidValueError(
                f"networks have the shapes {[w.shape for w in weights]}; expected {inputs} inputs "
                f"and {self.group} networks a robot"
            )
        # They may have learned since construction.
        if not all(np.isfinite(w).all() for w in weights):
            raise InvalidValueError("networks hold weights that are not finite; train them anew")

    @cached_property
    def _ranges(self) -> np.ndarray:
        return np.array([self.sensors.ranges])

    def _kernel_arguments(self, readings: ArrayLike, kinds: ArrayLike | None, numbers: ArrayLike | None) -> tuple:
        """Return readings, kinds, ranges, weights and numbers for the compiled functions."""
        distance, kind = self.sensors.check_readings(readings, kinds, self.encoding)
        return distance, kind, self._ranges, self.networks.weights, checked_numbers(numbers, len(distance))
