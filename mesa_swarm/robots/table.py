"""The designs of a world as arrays, one row a design, for the compiled functions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.geometry.sector import half_angle
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.sensors import ProximitySensor, RadiationSensor, mount_of

# Columns of `proximity` and `radiation`; the compiled functions take them as constants.
MOUNT_X, MOUNT_Y, AXIS_X, AXIS_Y, COS_HALF, SIN_HALF, RANGE, RAYS, HALF = range(9)
# Columns of `noise`.
PROBABILITY, MAGNITUDE, HOLD, PERIOD = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class DesignTable:
    """Designs stacked into arrays, padded to the largest number of sensors.

    Parameters
    ----------
    designs : tuple of RobotDesign
    proximity : ndarray, shape (d, s, 9)
        Mount, axis, half angle, range and rays of every proximity sensor, in the body frame.
    bearing : ndarray, shape (d, s), rad in [-pi, pi]
    counts : int64 ndarray, shape (d,)
        How many proximity sensors each design has.
    noise : ndarray, shape (d, s, 4)
        Error probability and magnitude, hold, period.
    radiation : ndarray, shape (d, q, 9)
        Unused rows have range -1.
    line : ndarray, shape (d, l, 2)
        Mounts of the line sensors; unused rows are NaN.
    reach : ndarray, shape (d,)
        How far from the centre the proximity sensors see.
    forward : int64 ndarray, shape (d, 3)
        Indices of the front, left and right proximity sensors, -1 for none.
    slip : ndarray, shape (2, d)
        Probability and magnitude.
    sideways : bool ndarray, shape (d,)
        Whether a command is speeds forward and sideways.
    slips, noisy, slow, exposed : bool
        Whether any wheel slips at random, any sensor errs, any sensor is refreshed less often than every step,
        any proximity sensor sits outside its robot's body, where an obstacle can be.
    """

    designs: tuple[RobotDesign, ...]
    proximity: np.ndarray
    bearing: np.ndarray
    counts: np.ndarray
    noise: np.ndarray
    radiation: np.ndarray
    line: np.ndarray
    reach: np.ndarray
    forward: np.ndarray
    slip: np.ndarray
    sideways: np.ndarray
    slips: bool
    noisy: bool
    slow: bool
    exposed: bool

    @classmethod
    def of(cls, designs: Sequence[RobotDesign]) -> "DesignTable":
        """Stack these designs."""
        proximity = _stacked([[_sector(s, d.radius) for s in d.proximity] for d in designs], 9)
        mounts = np.hypot(proximity[..., MOUNT_X], proximity[..., MOUNT_Y])
        radii = np.array([d.radius for d in designs])[:, None]
        bearings = [[(_wrapped(math.radians(s.bearing_degrees)),) for s in d.proximity] for d in designs]
        noise = _stacked(
            [[(s.error_probability, s.error_magnitude, s.hold, s.period) for s in d.proximity] for d in designs],
            4,
            pad=0.0,
        )
        slip = np.array([(d.slip_probability, d.slip_magnitude) for d in designs]).reshape(-1, 2).T.copy()
        return cls(
            designs=tuple(designs),
            proximity=proximity,
            bearing=_stacked(bearings, 1)[..., 0],
            counts=np.array([len(d.proximity) for d in designs], np.int64),
            noise=noise,
            radiation=_stacked([[_sector(s, d.radius) for s in d.radiation] for d in designs], 9),
            line=_stacked([[s.mount for s in d.line] for d in designs], 2, pad=math.nan),
            reach=np.max(mounts + proximity[..., RANGE], axis=1, initial=0.0),
            forward=np.array([(d.front, d.left, d.right) for d in designs], np.int64).reshape(-1, 3),
            slip=slip,
            sideways=np.array([d.turns is False for d in designs], np.bool_),
            slips=bool((slip[0] * slip[1] > 0).any()),
            noisy=bool((noise[..., PROBABILITY] * noise[..., MAGNITUDE] > 0).any()),
            slow=bool((noise[..., PERIOD] > 1).any()),
            exposed=bool((mounts > radii * (1 + 1e-9)).any()),
        )


def _wrapped(bearing: float) -> float:
    return math.remainder(bearing, 2 * math.pi)


def _sector(sensor: ProximitySensor | RadiationSensor, radius: float) -> tuple[float, ...]:
    bearing = math.radians(sensor.bearing_degrees)
    half = math.radians(sensor.field_of_view_degrees) / 2
    edge = half_angle(math.radians(sensor.field_of_view_degrees))
    axis = (math.cos(bearing), math.sin(bearing))
    return *mount_of(sensor, radius), *axis, *edge, sensor.range, getattr(sensor, "rays", 0), half


def _stacked(rows: Sequence[Sequence[tuple[float, ...]]], width: int, pad: float = -1.0) -> np.ndarray:
    most = max((len(row) for row in rows), default=0)
    table = np.full((len(rows), most, width), pad)
    for d, row in enumerate(rows):
        if row:
            table[d, : len(row)] = row
    return table
