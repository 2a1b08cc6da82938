"""How wheels move a body, random slip, and the turn towards a target."""

import math
import warnings
from typing import Protocol

import numpy as np

from mesa_swarm.geometry.compiled import compiled


class Drive(Protocol):
    """What turns wheels into motion. The motion of a body is (forward, sideways, turn) a step.

    A custom drive is a class with these two methods; see `DifferentialDrive` and `HolonomicDrive`.

    Attributes
    ----------
    turns : bool or None, optional
        True (the default) if a command is the speeds of wheels left and right, each limited to max_speed; False if
        it is speeds forward and sideways, where the speed of the body is limited; None if it is neither: each number
        is limited, and layers of all kinds may command it.
    """

    def motion(self, wheels: np.ndarray, radius: np.ndarray, motion: np.ndarray) -> None:
        """Write into `motion` (n, 3) what these wheel speeds (n, 2) do to bodies of these radii (n,)."""

    def wheels(self, motion: np.ndarray, radius: np.ndarray, wheels: np.ndarray) -> None:
        """Write into `wheels` (n, 2) which wheel speeds would have made these motions (n, 3)."""


class _EqualByValues:
    """Base of drives, which are equal if they are of one class and hold the same values, which may be arrays.

    Examples
    --------
    >>> class Geared(DifferentialDrive):
    ...     def __init__(self, ratio):
    ...         self.ratio = ratio
    >>> Geared(2.0) == Geared(2.0), Geared(2.0) == Geared(3.0), Geared(2.0) == DifferentialDrive()
    (True, False, False)
    """

    def __eq__(self, other: object) -> bool:
        """Compare as equal to drives of the same class that hold the same values."""
        if type(self) is not type(other):
            return False
        mine, theirs = vars(self), vars(other)
        return mine.keys() == theirs.keys() and all(np.array_equal(mine[name], theirs[name]) for name in mine)

    def __hash__(self) -> int:
        """Hash as all drives of the same class do."""
        return hash(type(self))


def alike(one: object, other: object) -> bool:
    """Return whether two drives are equal; deprecated, compare them by ``==``."""
    warnings.warn("alike(one, other) is one == other now", DeprecationWarning, stacklevel=2)
    return _EqualByValues.__eq__(one, other)  # type: ignore[operator]  # any two objects


class DifferentialDrive(_EqualByValues):
    """Two wheels at the rim, left and right, on one axle (track = 2 r).

    v = (v_R + v_L) / 2 (A.4) and omega = (v_R - v_L) / (2 r) (A.2).

    Examples
    --------
    >>> motion = np.empty((1, 3))
    >>> DifferentialDrive().motion(np.array([[0.0, 1.0]]), np.array([5.0]), motion)
    >>> motion
    array([[0.5, 0. , 0.1]])
    """

    turns = True

    def motion(self, wheels: np.ndarray, radius: np.ndarray, motion: np.ndarray) -> None:
        """Write the body's motion (n, 3) that rim speeds left and right (n, 2) make."""
        wheels_to_motion(wheels, radius, motion)

    def wheels(self, motion: np.ndarray, radius: np.ndarray, wheels: np.ndarray) -> None:
        """Write the rim speeds (n, 2) that would have made the motion (n, 3)."""
        motion_to_wheels(motion, radius, wheels)


class HolonomicDrive(_EqualByValues):
    """Rollers that move the body in any direction, forward and sideways, and never turn it.

    A command's two numbers are the speeds forward and to the left, in the robot's own frame: a velocity. One that is
    longer than max_speed is shortened to it in the same direction.

    Examples
    --------
    >>> motion = np.empty((1, 3))
    >>> HolonomicDrive().motion(np.array([[0.6, -0.8]]), np.array([5.0]), motion)
    >>> motion
    array([[ 0.6, -0.8,  0. ]])
    """

    turns = False

    def motion(self, wheels: np.ndarray, radius: np.ndarray, motion: np.ndarray) -> None:
        """Write the body's motion (n, 3) that speeds forward and sideways (n, 2) make."""
        motion[:, :2] = wheels
        motion[:, 2] = 0.0

    def wheels(self, motion: np.ndarray, radius: np.ndarray, wheels: np.ndarray) -> None:
        """Write the speeds forward and sideways (n, 2) that would have made the motion (n, 3)."""
        wheels[:] = motion[:, :2]


@compiled
def wheels_to_motion(wheels, radius, motion):
    """Write forward speed and turn of differential drives (A.2, A.4)."""
    for i in range(wheels.shape[0]):
        left, right = wheels[i, 0], wheels[i, 1]
        motion[i, 0] = (right + left) / 2.0
        motion[i, 1] = 0.0
        motion[i, 2] = (right - left) / (2.0 * radius[i])


@compiled
def motion_to_wheels(motion, radius, wheels):
    """Write the rim speeds of differential drives that make these motions: A.2 and A.4, solved for the wheels."""
    for i in range(motion.shape[0]):
        forward, rim = motion[i, 0], motion[i, 2] * radius[i]
        wheels[i, 0] = forward - rim
        wheels[i, 1] = forward + rim


@compiled
def slipped_wheels(command, slip_probability, slip_magnitude, design, draws, wheels):
    """Write the speeds at which wheels really roll: m, or m (1 - wsm) with probability wsp, each alone.

    Parameters
    ----------
    command, wheels : ndarrays, shape (n, 2)
    slip_probability, slip_magnitude : ndarrays, shape (d,)
        One a design.
    design : int64 ndarray, shape (n,)
    draws : ndarray, shape (n, 2)
        Uniform in [0, 1).
    """
    for i in range(command.shape[0]):
        d = design[i]
        for w in range(2):
            slips = draws[i, w] < slip_probability[d]
            wheels[i, w] = command[i, w] * (1.0 - slip_magnitude[d]) if slips else command[i, w]


@compiled
def limit_command(command, max_speed, design, sideways):
    """Limit commands to each robot's max_speed, in place, and return the first row that is NaN, or -1.

    Parameters
    ----------
    command : ndarray, shape (n, 2)
    max_speed : ndarray, shape (n,)
    design : int64 ndarray, shape (n,)
    sideways : bool ndarray, shape (d,)
        Whether commands to robots of a design are velocities, which are limited as a whole, or else each number alone.
    """
    for i in range(command.shape[0]):
        if math.isnan(command[i, 0]) or math.isnan(command[i, 1]):
            return i
        if sideways[design[i]]:
            command[i, 0], command[i, 1] = no_longer(command[i, 0], command[i, 1], max_speed[i])
            continue
        for w in range(2):
            value = command[i, w]
            if not (-max_speed[i] <= value <= max_speed[i]):
                command[i, w] = max_speed[i] if value > 0.0 else -max_speed[i]
    return -1


@compiled
def no_longer(x: float, y: float, most: float) -> tuple[float, float]:
    """Return a vector in the same direction of at most this length; infinities count as equally large.

    Examples
    --------
    >>> no_longer(6.0, 8.0, 5.0), no_longer(0.3, 0.4, 5.0), no_longer(1.0, -math.inf, 2.0)
    ((3.0, 4.0), (0.3, 0.4), (0.0, -2.0))
    """
    if math.isinf(x) or math.isinf(y):
        x = math.copysign(1.0, x) if math.isinf(x) else 0.0
        y = math.copysign(1.0, y) if math.isinf(y) else 0.0
    elif math.hypot(x, y) <= most:
        return x, y
    largest = max(abs(x), abs(y))
    x, y = x / largest, y / largest
    share = most / math.hypot(x, y)
    return share * x, share * y


@compiled
def turn_towards(bearing: float, speed: float, radius: float) -> tuple[float, float]:
    """Return wheel speeds that turn on the spot towards a bearing (rad), in one step if `speed` allows it.

    Examples
    --------
    >>> turn_towards(-1.0, 2.0, 5.0)
    (2.0, -2.0)
    """
    rim = min(abs(bearing) * radius, speed)
    return (-rim, rim) if bearing > 0.0 else (rim, -rim)


@compiled
def approach(bearing: float, critical_angle: float, speed: float, radius: float) -> tuple[float, float]:
    """Return wheel speeds that turn on the spot towards a bearing, or go straight if it is ahead.

    Examples
    --------
    >>> approach(0.0, 0.2, 1.0, 5.0)
    (1.0, 1.0)
    """
    if abs(bearing) <= critical_angle:
        return speed, speed
    return turn_towards(bearing, speed, radius)
