"""Robot designs: a body, its drive and its sensors, and the four presets."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mesa_swarm.errors import InvalidValueError, asked, check_count, check_name, check_number, shortened
from mesa_swarm.robots.drive import DifferentialDrive, Drive
from mesa_swarm.robots.sensors import LineSensor, ProximitySensor, RadiationSensor, Sensor

LARGEST_RADIUS = 1e6
# A step is cut into pieces of half a radius: faster robots than this would take for ever.
FASTEST_IN_RADII = 1000
MOST_SENSORS = 360


@dataclass(frozen=True, kw_only=True, slots=True)
class RobotDesign:
    """What all robots of one kind have in common.

    Parameters
    ----------
    name : str
        For messages and pictures.
    radius : float
        Of the round body, map units, above 0.
    max_speed : float
        Limit of each wheel's rim speed, of the body's speed where it goes sideways, map units a step, 0 to 1000 radii.
    sensors : tuple
        Of `ProximitySensor`, `RadiationSensor` and `LineSensor`.
    slip_probability, slip_magnitude : float
        Each wheel and step, with this probability, a wheel rolls at m (1 - magnitude); both 0 to 1.
    drive : Drive
        How wheels move the body; `DifferentialDrive()` by default.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> RobotDesign(radius=4, sensors=(ProximitySensor(range=20),)).front
    0
    """

    name: str = "robot"
    radius: float = 5.0
    max_speed: float = 1.0
    sensors: tuple[Sensor, ...] = ()
    slip_probability: float = 0.0
    slip_magnitude: float = 0.0
    drive: Drive = field(default_factory=DifferentialDrive)

    def __post_init__(self) -> None:
        """Check every value."""
        radius = check_number("radius", self.radius, above=0, maximum=LARGEST_RADIUS)
        check_number("max_speed", self.max_speed, minimum=0, maximum=FASTEST_IN_RADII * radius)
        check_number("slip_probability", self.slip_probability, minimum=0, maximum=1)
        check_number("slip_magnitude", self.slip_magnitude, minimum=0, maximum=1)
        check_name("name", self.name)
        if not isinstance(self.sensors, (tuple, list)):
            raise InvalidValueError(f"sensors is {shortened(self.sensors)}; expected a tuple of sensors")
        object.__setattr__(self, "sensors", tuple(self.sensors))
        if len(self.sensors) > MOST_SENSORS:
            raise InvalidValueError(f"sensors has {len(self.sensors)} of them; expected at most {MOST_SENSORS}")
        for sensor in self.sensors:
            if not isinstance(sensor, Sensor):
                raise InvalidValueError(
                    f"sensors holds {shortened(sensor)}; expected sensors such as ProximitySensor()"
                )
        methods = [asked(self.drive, name) for name in ("motion", "wheels")]
        if isinstance(self.drive, type) or not all(map(callable, methods)):
            raise InvalidValueError(f"drive is {shortened(self.drive)}; expected a drive such as DifferentialDrive()")

    @property
    def proximity(self) -> tuple[ProximitySensor, ...]:
        """The proximity sensors, in the order of the columns `distance` and `kind`."""
        return tuple(s for s in self.sensors if isinstance(s, ProximitySensor))

    @property
    def radiation(self) -> tuple[RadiationSensor, ...]:
        """The radiation sensors, in the order of the column `radiation`."""
        return tuple(s for s in self.sensors if isinstance(s, RadiationSensor))

    @property
    def line(self) -> tuple[LineSensor, ...]:
        """The line sensors, in the order of the column `line`."""
        return tuple(s for s in self.sensors if isinstance(s, LineSensor))

    @property
    def turns(self) -> bool | None:
        """What a command is: speeds of wheels left and right (True), forward and sideways (False); see `Drive`."""
        told = getattr(self.drive, "turns", True)
        return None if told is None else bool(told)

    @property
    def front(self) -> int:
        """Index of the proximity sensor that looks most nearly straight ahead, -1 if none does."""
        bearings = self._bearings
        ahead = [i for i in range(len(bearings)) if abs(bearings[i]) < math.pi / 2]
        return min(ahead, key=lambda i: abs(bearings[i]), default=-1)

    @property
    def left(self) -> int:
        """Index of the forward proximity sensor next to `front` on the left, -1 if there is none."""
        return self._beside(1)

    @property
    def right(self) -> int:
        """Index of the forward proximity sensor next to `front` on the right, -1 if there is none."""
        return self._beside(-1)

    def with_proximity(self, **changes: Any) -> "RobotDesign":
        """Return the same design with these fields changed in all its proximity sensors.

        Examples
        --------
        >>> AGENT9.with_proximity(range=16).proximity[0].range
        16
        """
        sensors = (replace(s, **changes) if isinstance(s, ProximitySensor) else s for s in self.sensors)
        return replace(self, sensors=tuple(sensors))

    def with_slip(self, *, probability: float, magnitude: float) -> "RobotDesign":
        """Return the same design with wheels that slip like this.

        Examples
        --------
        >>> AGENT9.with_slip(probability=0.1, magnitude=0.5).slip_magnitude
        0.5
        """
        return replace(self, slip_probability=probability, slip_magnitude=magnitude)

    @property
    def _bearings(self) -> list[float]:
        return [math.remainder(math.radians(s.bearing_degrees), 2 * math.pi) for s in self.proximity]

    def _beside(self, side: int) -> int:
        bearings, front = self._bearings, self.front
        if front < 0:
            return -1
        offsets = {i: side * (b - bearings[front]) for i, b in enumerate(bearings) if abs(b) <= math.pi / 2}
        beside = [i for i, offset in offsets.items() if offset > 0]
        return min(beside, key=lambda i: offsets[i], default=-1)


def all_round(count: int = 12, *, range: float = 50.0, **more: Any) -> RobotDesign:
    """Return a design with infrared sensors all round, which divide the circle into equal sectors.

    Parameters
    ----------
    count : int
        Of sensors, 3 to 72; the first looks straight ahead.
    range : float
        Of each, map units.
    **more
        Other fields of `RobotDesign`.

    Examples
    --------
    >>> [sensor.bearing_degrees for sensor in all_round(4, range=80).sensors]
    [0.0, 90.0, 180.0, 270.0]
    """
    width = 360.0 / check_count("count", count, minimum=3, maximum=72)
    bearings = np.arange(count) * width
    eyes = tuple(ProximitySensor(bearing_degrees=float(b), field_of_view_degrees=width, range=range) for b in bearings)
    return RobotDesign(**{"name": "all-round", **more}, sensors=eyes)


def _infrared(bearings: list[float], field_of_view_degrees: float) -> tuple[ProximitySensor, ...]:
    return tuple(ProximitySensor(bearing_degrees=b, field_of_view_degrees=field_of_view_degrees) for b in bearings)


AGENT3 = RobotDesign(name="AGENT3", sensors=_infrared([0, 40, -40], 40))
AGENT6 = RobotDesign(name="AGENT6", sensors=_infrared([0, 60, -60, 120, -120, 180], 40))
AGENT9 = RobotDesign(name="AGENT9", sensors=_infrared([0, 30, -30, 60, -60, 90, -90, 140, -140], 30))
AGENT_FIRE = RobotDesign(name="AGENT_FIRE", sensors=(*AGENT9.sensors, RadiationSensor()))
