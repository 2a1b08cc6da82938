"""How wheels move a body, random slip, and the turn towards a target."""

import math
import warnings
from dataclasses import dataclass, fields
from typing import ClassVar, Protocol

import numpy as np

from mesa_swarm.base.errors import check_number
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import hypot


class Drive(Protocol):
    """What turns wheels into motion. The motion of a body is (forward, sideways, turn) a step.

    A custom drive is a class with these two methods; see `DifferentialDrive`, `HolonomicDrive` and `OmniDrive`.
    Its attributes are optional.

    Attributes
    ----------
    numbers : int, optional
        How many numbers a command has, 1 to 12; 2 by default.
    acceleration : float or None, optional
        By how much the wheels' speeds change in a step at most, map units a step; None (the default) for no limit.
        It limits each number alone, and where `turns` is False the velocity as a whole.
    turns : bool or None, optional
        True (the default) if a command is the speeds of wheels left and right, each limited to max_speed; False if
        it is speeds forward and sideways, where the speed of the body is limited; None if it is neither: each number
        is limited, and layers of all kinds may command it.
    """

    def motion(self, wheels: np.ndarray, radius: np.ndarray, motion: np.ndarray) -> None:
        """Write into `motion` (n, 3) what these wheel speeds (n, numbers) do to bodies of these radii (n,)."""

    def wheels(self, motion: np.ndarray, radius: np.ndarray, wheels: np.ndarray) -> None:
        """Write into `wheels` (n, numbers) which wheel speeds would have made these motions (n, 3)."""


def speeds_in_words(numbers: int) -> str:
    """Return what a command is expected to be, such as "two finite wheel speeds"."""
    return f"{ {1: 'one', 2: 'two', 3: 'three'}.get(numbers, numbers) } finite wheel speed{'s' if numbers > 1 else ''}"


class EqualByValues:
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
        values, others = vars(self), vars(other)
        return values.keys() == others.keys() and all(np.array_equal(values[name], others[name]) for name in values)

    def __hash__(self) -> int:
        """Hash as all drives of the same class do."""
        return hash(type(self))


def alike(drive: object, other: object) -> bool:
    """Return whether two drives are equal; deprecated, compare them by ``==``."""
    warnings.warn("alike(one, other) is one == other now", DeprecationWarning, stacklevel=2)
    return EqualByValues.__eq__(drive, other)  # type: ignore[operator]  # any two objects


@dataclass(kw_only=True, eq=False)
class _Motors(EqualByValues):
    """Base of drives whose motors may need time to reach the commanded speed."""

    numbers: ClassVar[int] = 2
    acceleration: float | None = None

    def __post_init__(self) -> None:
        if self.acceleration is not None:
            check_number("acceleration", self.acceleration, above=0)


class DifferentialDrive(_Motors):
    """Two wheels at the rim, left and right, on one axle (track = 2 r).

    v = (v_R + v_L) / 2 (A.4) and omega = (v_R - v_L) / (2 r) (A.2).

    Parameters
    ----------
    acceleration : float or None
        By how much each wheel's rim speed changes in a step at most, map units a step, above 0; None for wheels that
        reach the commanded speed at once.

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


class HolonomicDrive(_Motors):
    """Rollers that move the body in any direction, forward and sideways, and never turn it.

    A command's two numbers are the speeds forward and to the left, in the robot's own frame: a velocity. One that is
    longer than max_speed is shortened to it in the same direction.

    Parameters
    ----------
    acceleration : float or None
        By how much the velocity changes in a step at most, as the length of the difference, map units a step, above 0;
        None for bodies that reach the commanded velocity at once.

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


# Of the azimuths of the three omni-wheels, 60, 180 and -60 degrees: exact, so that a wheel that stands has no slip.
OMNI_SINE = (math.sqrt(0.75), 0.0, -math.sqrt(0.75))
OMNI_COSINE = (0.5, -1.0, 0.5)


class OmniDrive(_Motors):
    """Three omni-wheels at the rim, 120 degrees apart, by which a body goes in any direction and turns at once.

    The wheels are at azimuths of 60, 180 and -60 degrees from straight ahead, and a command is their three rim speeds,
    positive counter-clockwise about the body, each limited to max_speed. Their rollers let the body slide along the
    axles. With forward and sideways speed x and y, turn w (rad a step) and radius r, the wheel at azimuth a rolls at
    u = y cos a - x sin a + r w; the other way round x = -2/3 sum(u sin a), y = 2/3 sum(u cos a) and
    w = sum(u) / (3 r). A rule computes its command by `omni_speeds`.

    Parameters
    ----------
    acceleration : float or None
        By how much each wheel's rim speed changes in a step at most, map units a step, above 0; None for wheels that
        reach the commanded speed at once.

    Examples
    --------
    >>> motion = np.empty((1, 3))
    >>> OmniDrive().motion(np.array([[0.5, 0.5, 0.5]]), np.array([5.0]), motion)
    >>> motion.round(9) + 0.0
    array([[0. , 0. , 0.1]])
    """

    numbers = 3
    turns = None

    def motion(self, wheels: np.ndarray, radius: np.ndarray, motion: np.ndarray) -> None:
        """Write the body's motion (n, 3) that three rim speeds (n, 3) make."""
        omni_to_motion(wheels, radius, motion)

    def wheels(self, motion: np.ndarray, radius: np.ndarray, wheels: np.ndarray) -> None:
        """Write the three rim speeds (n, 3) that would have made the motion (n, 3)."""
        motion_to_omni(motion, radius, wheels)


@compiled
def omni_speeds(forward: float, sideways: float, turn: float, radius: float) -> tuple[float, float, float]:
    """Return the three rim speeds by which an `OmniDrive` makes a motion; for use in rules.

    Parameters
    ----------
    forward, sideways : float
        Of the body, to the front and to the left, map units a step.
    turn : float
        To the left, rad a step.
    radius : float
        Of the body, map units.

    Examples
    --------
    >>> left, back, right = omni_speeds(0.0, 1.0, 0.0, 5.0)
    >>> round(left, 3), round(back, 3), round(right, 3)
    (0.5, -1.0, 0.5)
    """
    rim = turn * radius
    return (
        OMNI_COSINE[0] * sideways - OMNI_SINE[0] * forward + rim,
        OMNI_COSINE[1] * sideways - OMNI_SINE[1] * forward + rim,
        OMNI_COSINE[2] * sideways - OMNI_SINE[2] * forward + rim,
    )


@compiled
def omni_motion(speeds, radius):
    """Return the motion of a body on three omni-wheels: ahead, to the left, and the turn."""
    x, y, turn = 0.0, 0.0, 0.0
    for w in range(3):
        x -= OMNI_SINE[w] * speeds[w]
        y += OMNI_COSINE[w] * speeds[w]
        turn += speeds[w]
    return 2.0 * x / 3.0, 2.0 * y / 3.0, turn / (3.0 * radius)


@compiled
def omni_to_motion(wheels, radius, motion):
    """Write the motions (n, 3) of bodies on three omni-wheels."""
    for i in range(wheels.shape[0]):
        speeds = wheels[i, 0], wheels[i, 1], wheels[i, 2]
        motion[i, 0], motion[i, 1], motion[i, 2] = omni_motion(speeds, radius[i])


@compiled
def motion_to_omni(motion, radius, wheels):
    """Write the rim speeds (n, 3) of three omni-wheels that make these motions."""
    for i in range(motion.shape[0]):
        speeds = omni_speeds(motion[i, 0], motion[i, 1], motion[i, 2], radius[i])
        wheels[i, 0], wheels[i, 1], wheels[i, 2] = speeds


@compiled
def differential_motion(left, right, radius):
    """Return the motion of a differential drive (A.2, A.4): ahead, to the left, and the turn."""
    return (right + left) / 2.0, 0.0, (right - left) / (2.0 * radius)


@compiled
def wheels_to_motion(wheels, radius, motion):
    """Write forward speed and turn of differential drives (A.2, A.4)."""
    for i in range(wheels.shape[0]):
        motion[i, 0], motion[i, 1], motion[i, 2] = differential_motion(wheels[i, 0], wheels[i, 1], radius[i])


@compiled
def differential_speeds(forward, turn, radius):
    """Return the rim speeds of a differential drive that make a motion: A.2 and A.4, solved for the wheels."""
    rim = turn * radius
    return forward - rim, forward + rim


@compiled
def motion_to_wheels(motion, radius, wheels):
    """Write the rim speeds of differential drives that make these motions."""
    for i in range(motion.shape[0]):
        wheels[i, 0], wheels[i, 1] = differential_speeds(motion[i, 0], motion[i, 2], radius[i])


# Drives of which compiled functions know the motion, by the codes of their kinds.
DIFFERENTIAL, HOLONOMIC, OMNI = range(3)
KINDS_OF_DRIVES: dict[type, int] = {DifferentialDrive: DIFFERENTIAL, HolonomicDrive: HOLONOMIC, OmniDrive: OMNI}


@compiled
def drive_to_motion(kinds, design, wheels, radius, motion):
    """Write the motions (n, 3) that wheels (n, w) of several kinds of drives make; `kinds` (d,) are of designs."""
    for i in range(wheels.shape[0]):
        kind = kinds[design[i]]
        if kind == DIFFERENTIAL:
            way = differential_motion(wheels[i, 0], wheels[i, 1], radius[i])
        elif kind == HOLONOMIC:
            way = wheels[i, 0], wheels[i, 1], 0.0
        else:
            way = omni_motion((wheels[i, 0], wheels[i, 1], wheels[i, 2]), radius[i])
        motion[i, 0], motion[i, 1], motion[i, 2] = way


@compiled
def motion_to_drive(i, kind, motion, radius, wheels):
    """Write the speeds of robot i's wheels that would have made its motion; numbers that its drive lacks become 0."""
    for w in range(2, wheels.shape[1]):
        wheels[i, w] = 0.0
    if kind == DIFFERENTIAL:
        wheels[i, 0], wheels[i, 1] = differential_speeds(motion[i, 0], motion[i, 2], radius[i])
    elif kind == HOLONOMIC:
        wheels[i, 0], wheels[i, 1] = motion[i, 0], motion[i, 1]
    else:
        speeds = omni_speeds(motion[i, 0], motion[i, 1], motion[i, 2], radius[i])
        wheels[i, 0], wheels[i, 1], wheels[i, 2] = speeds


@compiled
def slip_wheels(command, slip_probability, slip_magnitude, design, draws, wheels):
    """Write the speeds at which wheels really roll: m, or m (1 - wsm) with probability wsp, each alone.

    Parameters
    ----------
    command, wheels : ndarrays, shape (n, w)
    slip_probability, slip_magnitude : ndarrays, shape (d,)
        One a design.
    design : int64 ndarray, shape (n,)
    draws : ndarray, shape (n, w)
        Uniform in [0, 1).
    """
    for i in range(command.shape[0]):
        d = design[i]
        for w in range(command.shape[1]):
            slips = draws[i, w] < slip_probability[d]
            wheels[i, w] = command[i, w] * (1.0 - slip_magnitude[d]) if slips else command[i, w]


@compiled
def accelerate(command, acceleration, design, sideways, speed):
    """Bring the speeds that motors have reached nearer to the commands, by at most their acceleration.

    Parameters
    ----------
    command : ndarray, shape (n, w)
    acceleration : ndarray, shape (d,)
        Of a design, infinite for no limit.
    design : int64 ndarray, shape (n,)
    sideways : bool ndarray, shape (d,)
        Whether the velocity as a whole is limited, or else each number alone.
    speed : ndarray, shape (n, w)
        Those of the step before; written.
    """
    for i in range(command.shape[0]):
        most, as_whole = acceleration[design[i]], sideways[design[i]]
        largest = hypot(command[i, 0] - speed[i, 0], command[i, 1] - speed[i, 1])
        for w in range(command.shape[1]):
            change = command[i, w] - speed[i, w]
            size = largest if as_whole else abs(change)
            speed[i, w] = command[i, w] if size <= most else speed[i, w] + change * (most / size)


@compiled
def clear_unused(command, design, numbers):
    """Set to 0 the numbers of commands (n, w) that the drive of a design does not have; `numbers` (d,) it has."""
    for i in range(command.shape[0]):
        for w in range(numbers[design[i]], command.shape[1]):
            command[i, w] = 0.0


@compiled
def limit_command(command, max_speed, design, sideways):
    """Limit commands to each robot's max_speed, in place, and return the first row that is NaN, or -1.

    Parameters
    ----------
    command : ndarray, shape (n, w)
    max_speed : ndarray, shape (n,)
    design : int64 ndarray, shape (n,)
    sideways : bool ndarray, shape (d,)
        Whether commands to robots of a design are velocities, which are limited as a whole, or else each number alone.
    """
    for i in range(command.shape[0]):
        for w in range(command.shape[1]):
            if math.isnan(command[i, w]):
                return i
        if sideways[design[i]]:
            command[i, 0], command[i, 1] = limit_length(command[i, 0], command[i, 1], max_speed[i])
            continue
        for w in range(command.shape[1]):
            value = command[i, w]
            if not (-max_speed[i] <= value <= max_speed[i]):
                command[i, w] = max_speed[i] if value > 0.0 else -max_speed[i]
    return -1


@compiled
def limit_length(x: float, y: float, most: float) -> tuple[float, float]:
    """Return a vector in the same direction of at most this length; infinities count as equally large.

    Examples
    --------
    >>> limit_length(6.0, 8.0, 5.0), limit_length(0.3, 0.4, 5.0), limit_length(1.0, -math.inf, 2.0)
    ((3.0, 4.0), (0.3, 0.4), (0.0, -2.0))
    """
    if math.isinf(x) or math.isinf(y):
        x = math.copysign(1.0, x) if math.isinf(x) else 0.0
        y = math.copysign(1.0, y) if math.isinf(y) else 0.0
    elif hypot(x, y) <= most:
        return x, y
    largest = max(abs(x), abs(y))
    x, y = x / largest, y / largest
    share = most / hypot(x, y)
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


@dataclass(frozen=True, kw_only=True, slots=True)
class DirectedSlip:
    """Share of its motion that a body always loses, by direction: ahead, back, sideways and in a turn.

    Unlike random slip, which is drawn for each wheel, it is the same in every step: that of wheels that roll more
    easily in one direction than in another, or of a floor. The thesis names anisotropic slip as an extension (A.2.2).
    It acts on what a robot drives: robots that others push apart yield alike in all directions.

    Parameters
    ----------
    forward, backward, sideways, turn : float
        Shares, 0 to 1; robots without sideways motion lose none of it.

    Raises
    ------
    InvalidValueError
        If a share is out of its range.

    Examples
    --------
    >>> DirectedSlip(forward=0.1, turn=0.3).shares
    (0.1, 0.0, 0.0, 0.3)
    """

    forward: float = 0.0
    backward: float = 0.0
    sideways: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        """Check every share."""
        for field in fields(self):
            check_number(f"slip {field.name}", getattr(self, field.name), minimum=0, maximum=1)

    @property
    def shares(self) -> tuple[float, float, float, float]:
        """All shares, as the compiled function takes them."""
        return float(self.forward), float(self.backward), float(self.sideways), float(self.turn)


@compiled
def lose_motion(motion, design, shares):
    """Reduce motions (n, 3), ahead, sideways and turning, by the shares (d, 4) that robots of each design lose."""
    for i in range(motion.shape[0]):
        forward, backward, sideways, turn = shares[design[i]]
        motion[i, 0] *= 1.0 - (forward if motion[i, 0] > 0.0 else backward)
        motion[i, 1] *= 1.0 - sideways
        motion[i, 2] *= 1.0 - turn
