"""Controllers that are their own mirror image: half of the weights decide, the others follow."""

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_count
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.learning.reflex_policy import genome_length, rows_of


def half_length(sensors: SensorLayout, units: int, encoding: str = "distance") -> int:
    """Return how many weights decide a policy that is its own mirror image.

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> half_length(SensorLayout.of(AGENT9), 2)
    26
    """
    check_pairs(sensors, units)
    return genome_length(sensors, units, encoding) // 2


def whole_genome(sensors: SensorLayout, half: np.ndarray, *, units: int = 0, encoding: str = "distance") -> np.ndarray:
    """Return the weights of a policy that does the mirror image where everything is the mirror image.

    The left wheel's weights and those of the first half of the hidden units are given. The right wheel and the other
    units have the same ones, exchanged between sensors at mirrored bearings and between mirrored units; the whim's
    weight changes its sign. There is no side, then, to which such a robot always turns, and half as much to search.

    Parameters
    ----------
    sensors : SensorLayout
        Mirrored themselves.
    half : ndarray, shape (half_length(sensors, units, encoding),)
        Row by row into the first units, then one column to the left wheel.
    units : int
        Hidden units, an even number.
    encoding : str
        As of `ReflexPolicy`.

    Returns
    -------
    ndarray, shape (genome_length(sensors, units, encoding),)
        For `ReflexPolicy.of_genome`.

    Raises
    ------
    InvalidValueError
        If the sensors are not mirrored, the units are odd, or `half` has another length.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> whole_genome(SensorLayout.of(AGENT3), [1, 2, 3, 4, 5]).reshape(5, 2)  # front, left, right, whim, constant
    array([[ 1.,  1.],
           [ 2.,  3.],
           [ 3.,  2.],
           [ 4., -4.],
           [ 5.,  5.]])
    """
    rows, genes = rows_of(sensors, units, encoding), np.array(half, dtype=float)
    if genes.shape != (half_length(sensors, units, encoding),):
        length = half_length(sensors, units, encoding)
        raise InvalidValueError(f"half a genome has shape {genes.shape}; expected ({length},)")
    hidden, wheel = np.split(genes, [rows * (units // 2)])
    order, signs = _mirrored_rows(sensors, units, rows)
    columns = hidden.reshape(rows, units // 2), wheel.reshape(rows, 1)
    return np.concatenate([np.hstack([own, own[order] * signs[:, None]]).ravel() for own in columns])


def check_pairs(sensors: SensorLayout, units: int) -> None:
    """Refuse sensors that are not mirrored, and an odd number of units.

    Raises
    ------
    InvalidValueError
    """
    twins_of(sensors)
    if check_count("units", units) % 2:
        raise InvalidValueError(f"units is {units}; expected an even number, as units of a mirrored policy are pairs")


def twins_of(sensors: SensorLayout) -> np.ndarray:
    """Return for each sensor which one is its mirror image; one that looks ahead or back is its own.

    Raises
    ------
    InvalidValueError
        If a sensor has none.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> twins_of(SensorLayout.of(AGENT3))
    array([0, 2, 1])
    """
    eyes = list(zip(sensors.bearings, sensors.ranges, sensors.fields_of_view, strict=True))
    twins = []
    for bearing, *rest in eyes:
        found = [k for k, (other, *more) in enumerate(eyes) if more == rest and (other + bearing) % 360.0 == 0.0]
        if not found:
            raise InvalidValueError(
                f"the sensor at {bearing:g} degrees has no mirror image; expected the same one at {-bearing:g} degrees"
            )
        twins.append(found[0])
    return np.array(twins, np.int64)


def _mirrored_rows(sensors: SensorLayout, units: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return from which row each row of the mirrored weights comes, and with which sign."""
    count = rows - units - 2
    twins = twins_of(sensors)
    of_eyes = [twins + first for first in range(0, count, max(len(sensors), 1))]
    of_units = count + np.roll(np.arange(units), units // 2)
    order = np.concatenate([*of_eyes, of_units, [rows - 2, rows - 1]]).astype(np.int64)
    signs = np.ones(rows)
    signs[-2] = -1.0
    return order, signs
