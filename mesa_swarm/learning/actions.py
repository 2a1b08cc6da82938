"""Actions, Boltzmann's choice among them, and inputs of networks."""

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import exp
from mesa_swarm.robots.design import RANGE
from mesa_swarm.world.statics import FIRE, LOAD, ROBOT

# Left and right wheel as shares of max_speed (thesis 8.1); `actions=4` takes the first four.
ACTIONS = np.array(
    [(-1, -1), (-1, 1), (1, -1), (1, 1), (-1, 0), (0, -1), (1, 0), (0, 1)],
    dtype=np.float64,
)
ACTIONS.flags.writeable = False
ACTION_NAMES = (
    "back",
    "left on the spot",
    "right on the spot",
    "forward",
    "backward right",
    "backward left",
    "forward right",
    "forward left",
)
# Inputs a sensor: its distance; with "typed" also whether it sees a robot, a fire, a load.
ENCODINGS = {"distance": 1, "typed": 4}


def boltzmann(values: ArrayLike, temperature: float) -> np.ndarray:
    """Return the probability of each action: ``P_i = exp(Q_i / T) / sum_j exp(Q_j / T)`` (7.4).

    Parameters
    ----------
    values : ndarray, shape (a,)
        Finite; differences of any size do not overflow.
    temperature : float
        Above 0; the higher, the more random the choice.

    Returns
    -------
    ndarray, shape (a,)
        Sums to 1.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> boltzmann([3.0, 2.0, 1.0], 1.0).round(3)
    array([0.665, 0.245, 0.09 ])
    >>> boltzmann([3000.0, 2000.0], 0.2)
    array([1., 0.])
    """
    array = as_floats(values)
    if array.ndim != 1 or not len(array) or not np.isfinite(array).all():
        raise InvalidValueError(f"values is {shortened(values)}; expected a row of finite numbers")
    warmth = check_number("temperature", temperature, above=0)
    shares = np.array([exp((value - array.max()) / warmth) for value in array])
    return shares / shares.sum()


def as_floats(values: ArrayLike) -> np.ndarray:
    """Return values as a C-contiguous array of floats; NaN, which every check refuses, if they are not numbers."""
    try:
        return np.asarray(fill_masked(values), dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError):
        return np.array(np.nan)


def describe_value(value: object) -> str:
    """Return an array's type and shape, and any other value itself, for an error message."""
    return f"an array of {value.dtype}, shape {value.shape}" if isinstance(value, np.ndarray) else shortened(value)


def temperature_at(step: float, *, beta: float, first: float = 1.0, last: float = 0.2) -> float:
    """Return the temperature of the choice after a number of steps: ``T_c + (T_0 - T_c) (1 - beta)^t`` (8.3).

    Parameters
    ----------
    step : int
    beta : float
        0 to 1.
    first, last : float
        T_0 and T_c, above 0.

    Examples
    --------
    >>> round(temperature_at(33_000, beta=1e-4), 4)
    0.2295
    """
    check_number("step", step, minimum=0)
    check_number("beta", beta, minimum=0, maximum=1)
    check_number("first", first, above=0)
    check_number("last", last, above=0)
    return last + (first - last) * (1.0 - beta) ** step


def checked_actions(actions: int) -> int:
    """Return the number of actions if it is 4 or 8."""
    return check_action_count("actions", actions)


def check_action_count(name: str, actions: object) -> int:
    """Return the number of actions, the value of a parameter of this name, if it is 4 or 8."""
    if not isinstance(actions, int | np.integer) or actions not in (4, 8):
        raise InvalidValueError(f"{name} is {shortened(actions)}; expected 4 or 8, a whole number")
    return int(actions)


def action_of(command: np.ndarray) -> str:
    """Return the name of the action that wheel commands (2,) are nearest to, as shares of the faster wheel."""
    speeds = command / max(float(np.abs(command).max()), 1e-300)
    return ACTION_NAMES[int(np.argmin(np.abs(ACTIONS - speeds).sum(axis=1)))]


def named_values(values: np.ndarray) -> list[tuple[str, float]]:
    """Return the name and the value of each action."""
    return [(name, float(value)) for name, value in zip(ACTION_NAMES, values, strict=False)]


@compiled
def chosen(values, temperature, chance):
    """Return the action that a number from 0 to 1 draws by Boltzmann's probabilities."""
    best = values[0]
    for a in range(1, values.shape[0]):
        best = max(best, values[a])
    total = 0.0
    for a in range(values.shape[0]):
        total += exp((values[a] - best) / temperature)
    left = chance * total
    for a in range(values.shape[0]):
        left -= exp((values[a] - best) / temperature)
        if left < 0.0:
            return a
    return best_of(values)  # a chance near 1, by rounding


@compiled
def drive_by_action(action, i, max_speed, command, layer, index):
    """Drive robot i by an action."""
    command[i, 0] = max_speed[i] * ACTIONS[action, 0]
    command[i, 1] = max_speed[i] * ACTIONS[action, 1]
    layer[i] = index


@compiled
def choose_all(values, temperature, chance, taken):
    """Write which action every robot takes, given values (n, a); without chances, the one of largest value."""
    for i in range(values.shape[0]):
        taken[i] = chosen(values[i], temperature, chance[i]) if chance.shape[0] else best_of(values[i])


@compiled
def best_of(values):
    """Return the action of the largest value; of equals the first."""
    best = 0
    for a in range(1, values.shape[0]):
        if values[a] > values[best]:
            best = a
    return best


@compiled
def write_inputs(distance, kind, ranges, i, d, inputs, row):
    """Write the readings of robot i of design d into a row of inputs; return the least as a share of its range.

    A sensor with nothing in range gives 1, its full range: -1 would mean nearer than touching.
    """
    sensors = distance.shape[1]
    nearest = 1.0
    for s in range(sensors):
        share = 1.0
        if distance[i, s] >= 0.0 and ranges[d, s] > 0.0:
            share = min(distance[i, s] / ranges[d, s], 1.0)
        inputs[row, s] = share
        nearest = min(nearest, share)
        if inputs.shape[1] > sensors:
            inputs[row, sensors + s] = 1.0 if kind[i, s] == ROBOT else 0.0
            inputs[row, 2 * sensors + s] = 1.0 if kind[i, s] == FIRE else 0.0
            inputs[row, 3 * sensors + s] = 1.0 if kind[i, s] == LOAD else 0.0
    return nearest


@compiled
def least_of(inputs, i, sensors):
    """Return the least reading of robot i, as a share of its range, in its last inputs (n, k)."""
    least = 1.0
    for s in range(sensors):
        least = min(least, inputs[i, s])
    return least


def ranges_of(sensors: np.ndarray) -> np.ndarray:
    """Return the range of every proximity sensor (d, s), of a table of designs (d, s, 9)."""
    return np.ascontiguousarray(sensors[:, :, RANGE])
