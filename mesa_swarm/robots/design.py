"""A robot's body, drive and sensors, the presets, and designs stacked into arrays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, check_name, check_number, read_attribute, shortened
from mesa_swarm.geometry.sector import half_angle
from mesa_swarm.kernels.elementary import direction_of, vector_lengths
from mesa_swarm.robots.actuators import ACT, Actuator, check_actuator, check_device_actions
from mesa_swarm.robots.drive import DifferentialDrive, DirectedSlip, Drive
from mesa_swarm.robots.sensors import (
    BUILT_IN,
    LineSensor,
    ProximitySensor,
    RadiationSensor,
    Sensor,
    check_sensor,
    mount_of,
)

LARGEST_RADIUS = 1e6
# Numbers of a command.
MOST_NUMBERS = 12
# The column of the speeds that motors of limited acceleration have reached.
DRIVE_SPEED = "drive.speed"
# A step is cut into pieces of half a radius: faster robots than this would take too long.
FASTEST_IN_RADII = 1000
MOST_SENSORS = 360
LONGEST_CHARGE = 1e12


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
        Of `ProximitySensor`, `RadiationSensor`, `LineSensor` and other classes of `Sensor`.
    slip_probability, slip_magnitude : float
        Each wheel and step, with this probability, a wheel rolls at m (1 - magnitude); both 0 to 1.
    drive : Drive
        How wheels move the body; `DifferentialDrive()` by default.
    actuators : tuple of Actuator
        What it has besides wheels.
    directed_slip : DirectedSlip, optional
        What the body loses of its motion by direction, None for nothing.
    battery : float
        Steps at full speed that a charge lasts, after which the robot stands; 0 for that of the model's
        `imperfections`, which is without end by default.

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
    actuators: tuple[Actuator, ...] = ()
    battery: float = 0.0
    directed_slip: DirectedSlip | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        radius = check_number("radius", self.radius, above=0, maximum=LARGEST_RADIUS)
        check_number("max_speed", self.max_speed, minimum=0, maximum=FASTEST_IN_RADII * radius)
        check_number("slip_probability", self.slip_probability, minimum=0, maximum=1)
        check_number("slip_magnitude", self.slip_magnitude, minimum=0, maximum=1)
        if self.directed_slip is not None and not isinstance(self.directed_slip, DirectedSlip):
            raise InvalidValueError(
                f"directed_slip is {shortened(self.directed_slip)}; expected DirectedSlip(...) or None"
            )
        check_number("battery", self.battery, minimum=0, maximum=LONGEST_CHARGE)
        check_name("name", self.name)
        self._store_devices("sensors")
        for sensor in self.sensors:
            if not isinstance(sensor, Sensor):
                raise InvalidValueError(
                    f"sensors holds {shortened(sensor)}; expected sensors such as ProximitySensor()"
                )
            check_sensor(sensor)
        self._store_devices("actuators")
        for actuator in self.actuators:
            check_actuator(actuator)
        check_device_actions(self.actuators)
        methods = [read_attribute(self.drive, name) for name in ("motion", "wheels")]
        if isinstance(self.drive, type) or not all(map(callable, methods)):
            raise InvalidValueError(f"drive is {shortened(self.drive)}; expected a drive such as DifferentialDrive()")
        check_count("numbers of drive", self.numbers, minimum=1, maximum=MOST_NUMBERS)
        if self.acceleration != math.inf:
            check_number("acceleration of drive", self.acceleration, above=0)

    def _store_devices(self, name: str) -> None:
        """Store the devices of this name as a tuple, unless it is another value or too long."""
        devices = getattr(self, name)
        if not isinstance(devices, (tuple, list)):
            raise InvalidValueError(f"{name} is {shortened(devices)}; expected a tuple of {name}")
        if len(devices) > MOST_SENSORS:
            raise InvalidValueError(f"{name} has {len(devices)} of them; expected at most {MOST_SENSORS}")
        object.__setattr__(self, name, tuple(devices))

    @property
    def proximity(self) -> tuple[ProximitySensor, ...]:
        """The proximity sensors, in the order of the columns `distance` and `kind`."""
        return tuple(sensor for sensor in self.sensors if isinstance(sensor, ProximitySensor))

    @property
    def radiation(self) -> tuple[RadiationSensor, ...]:
        """The radiation sensors, in the order of the column `radiation`."""
        return tuple(sensor for sensor in self.sensors if isinstance(sensor, RadiationSensor))

    @property
    def line(self) -> tuple[LineSensor, ...]:
        """The line sensors, in the order of the column `line`."""
        return tuple(sensor for sensor in self.sensors if isinstance(sensor, LineSensor))

    @property
    def own(self) -> tuple[Sensor, ...]:
        """The sensors with a function of their own, in their order."""
        return tuple(sensor for sensor in self.sensors if type(sensor) not in BUILT_IN)

    @property
    def turns(self) -> bool | None:
        """What a command is: speeds of wheels left and right (True), forward and sideways (False); see `Drive`."""
        turns = getattr(self.drive, "turns", True)
        return None if turns is None else bool(turns)

    @property
    def numbers(self) -> int:
        """How many numbers a command has: 2, or what the drive declares."""
        return getattr(self.drive, "numbers", 2)

    @property
    def acceleration(self) -> float:
        """By how much the wheels' speeds change in a step at most, map units a step; infinite for no limit."""
        limit = getattr(self.drive, "acceleration", None)
        return math.inf if limit is None else limit

    @property
    def front(self) -> int:
        """Index of the proximity sensor that looks most nearly straight ahead, -1 if none does."""
        bearings = self._bearings
        ahead = [i for i in range(len(bearings)) if abs(bearings[i]) < math.pi / 2]
        return min(ahead, key=lambda i: abs(bearings[i]), default=-1)

    @property
    def left(self) -> int:
        """Index of the forward proximity sensor next to `front` on the left, -1 without one."""
        return self._beside(1)

    @property
    def right(self) -> int:
        """Index of the forward proximity sensor next to `front` on the right, -1 without one."""
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
        return [math.remainder(math.radians(sensor.bearing_degrees), 2 * math.pi) for sensor in self.proximity]

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
"""The robot of the thesis with three infrared sensors: ahead, and 40 degrees to the left and right."""
AGENT6 = RobotDesign(name="AGENT6", sensors=_infrared([0, 60, -60, 120, -120, 180], 40))
"""The robot of the thesis with six infrared sensors all round, 60 degrees apart."""
AGENT9 = RobotDesign(name="AGENT9", sensors=_infrared([0, 30, -30, 60, -60, 90, -90, 140, -140], 30))
"""The robot of the thesis with nine infrared sensors, seven of them in the half ahead."""
AGENT_FIRE = RobotDesign(name="AGENT_FIRE", sensors=(*AGENT9.sensors, RadiationSensor()))
"""`AGENT9` with a sensor for the radiation of fires ahead."""
# Feels heat as far as AGENT9 sees, ahead and on both sides.
_FEELERS = (RadiationSensor(bearing_degrees=b, range=50.0, field_of_view_degrees=60.0) for b in (0, 60, -60))
AGENT_HEAT = RobotDesign(name="AGENT_HEAT", sensors=(*AGENT9.sensors, *_FEELERS))
"""`AGENT9` with three sensors for radiation: ahead, left and right."""


# Columns of `proximity` and `radiation`; the compiled functions take them as constants.
MOUNT_X, MOUNT_Y, AXIS_X, AXIS_Y, COS_HALF, SIN_HALF, RANGE, RAYS, HALF = range(9)
# Columns of `noise`.
PROBABILITY, MAGNITUDE, HOLD, PERIOD = range(4)


# Tables by the identities of their designs, which they keep alive, so that no other can have one of these.
TABLES: dict[tuple[int, ...], "DesignTable"] = {}
MOST_TABLES = 100


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
    directed : ndarray, shape (d, 4)
        The shares of motion that each design loses, see `DirectedSlip`.
    battery : ndarray, shape (d,)
        Steps at full speed that a charge lasts, 0 for what the model decides.
    sideways : bool ndarray, shape (d,)
        Whether a command is speeds forward and sideways.
    numbers : int64 ndarray, shape (d,)
        How many numbers a command has.
    acceleration : ndarray, shape (d,)
        The greatest change of the wheels' speeds in a step, infinite for no limit.
    wheels : int
        The width of commands: the most numbers of any design, at least 2.
    mixed, limited, slides : bool
        Whether any design has fewer numbers than that, any a limited acceleration, any a directed slip.
    slips, noisy, slow, exposed : bool
        Whether any wheel slips at random, any sensor errs, any sensor is refreshed less often than every step,
        any proximity sensor sits outside its robot's body, where an obstacle can be.
    readings : dict
        Name and width of each column that sensors with a function of their own fill.
    actions : dict
        Name of each actuator: its width, and whether it holds.
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
    directed: np.ndarray
    battery: np.ndarray
    sideways: np.ndarray
    numbers: np.ndarray
    acceleration: np.ndarray
    wheels: int
    mixed: bool
    limited: bool
    slides: bool
    slips: bool
    noisy: bool
    slow: bool
    exposed: bool
    readings: dict[str, int]
    actions: dict[str, tuple[int, bool]]

    @classmethod
    def of(cls, designs: Sequence[RobotDesign]) -> "DesignTable":
        """Stack these designs; worlds whose robots have the very same designs share a table, which is only read."""
        key = tuple(map(id, designs))
        table = TABLES.get(key)
        if table is None:
            if len(TABLES) >= MOST_TABLES:
                TABLES.clear()
            table = TABLES[key] = cls._stack(designs)
        return table

    @classmethod
    def _stack(cls, designs: Sequence[RobotDesign]) -> "DesignTable":
        proximity = _stack_devices([[_sector(s, d.radius) for s in d.proximity] for d in designs], 9)
        # Rows of padding have a range below 0, and no mount.
        is_sensor = proximity[..., RANGE] >= 0.0
        mounts = np.where(is_sensor, vector_lengths(proximity[..., MOUNT_X], proximity[..., MOUNT_Y]), 0.0)
        radii = np.array([d.radius for d in designs])[:, None]
        noises = [[(s.error_probability, s.error_magnitude, s.hold, s.period) for s in d.proximity] for d in designs]
        noise = _stack_devices(noises, 4, pad=0.0)
        numbers = np.array([d.numbers for d in designs], np.int64)
        wheels = int(numbers.max(initial=2))
        acceleration = np.array([d.acceleration for d in designs], float)
        slip = np.array([(d.slip_probability, d.slip_magnitude) for d in designs]).reshape(-1, 2).T.copy()
        return cls(
            designs=tuple(designs),
            proximity=proximity,
            bearing=_stack_devices([[(bearing,) for bearing in d._bearings] for d in designs], 1)[..., 0],
            counts=np.array([len(d.proximity) for d in designs], np.int64),
            noise=noise,
            radiation=_stack_devices([[_sector(s, d.radius) for s in d.radiation] for d in designs], 9),
            line=_stack_devices([[s.mount for s in d.line] for d in designs], 2, pad=math.nan),
            reach=np.max(mounts + proximity[..., RANGE], axis=1, initial=0.0),
            forward=np.array([(d.front, d.left, d.right) for d in designs], np.int64).reshape(-1, 3),
            slip=slip,
            directed=np.array([(d.directed_slip or DirectedSlip()).shares for d in designs], float).reshape(-1, 4),
            slides=any(d.directed_slip is not None for d in designs),
            battery=np.array([d.battery for d in designs], float),
            sideways=np.array([d.turns is False for d in designs], np.bool_),
            numbers=numbers,
            acceleration=acceleration,
            wheels=wheels,
            mixed=bool((numbers < wheels).any()),
            limited=bool(np.isfinite(acceleration).any()),
            slips=bool((slip[0] * slip[1] > 0).any()),
            noisy=bool((noise[..., PROBABILITY] * noise[..., MAGNITUDE] > 0).any()),
            slow=bool((noise[..., PERIOD] > 1).any()),
            exposed=bool((mounts > radii * (1 + 1e-9)).any()),
            readings=_readings(designs),
            actions=check_device_actions(a for design in designs for a in design.actuators),
        )

    def columns(self) -> dict[str, tuple[tuple, type, object]]:
        """Return the columns of a swarm that custom devices and drives need: shape, type, value at first."""
        read: dict[str, Any] = {name: ((width,), np.float64, math.nan) for name, width in self.readings.items()}
        for name, (width, _) in self.actions.items():
            read[f"{ACT}{name}"] = ((width,) if width > 1 else (), np.float64, 0.0)
        if self.limited:
            read[DRIVE_SPEED] = ((self.wheels,), np.float64, 0.0)
        return read


def places_of_custom_sensors(design: RobotDesign) -> list[tuple[Sensor, int]]:
    """Return the sensors of a design with a function of their own, and where in its column each begins to write."""
    places, ends = [], dict.fromkeys((sensor.name for sensor in design.own), 0)
    for sensor in design.own:
        places.append((sensor, ends[sensor.name]))
        ends[sensor.name] += int(sensor.width)
    return places


def _readings(designs: Sequence[RobotDesign]) -> dict[str, int]:
    widths: dict[str, int] = {}
    for design in designs:
        for sensor, first in places_of_custom_sensors(design):
            widths[sensor.name] = max(widths.get(sensor.name, 0), first + int(sensor.width))
    return widths


def _sector(sensor: ProximitySensor | RadiationSensor, radius: float) -> tuple[float, ...]:
    bearing = math.radians(sensor.bearing_degrees)
    half = math.radians(sensor.field_of_view_degrees) / 2
    edge = half_angle(math.radians(sensor.field_of_view_degrees))
    axis = direction_of(bearing)
    return *mount_of(sensor, radius), *axis, *edge, sensor.range, getattr(sensor, "rays", 0), half


def _stack_devices(rows: Sequence[Sequence[tuple[float, ...]]], width: int, pad: float = -1.0) -> np.ndarray:
    most = max((len(row) for row in rows), default=0)
    table = np.full((len(rows), most, width), pad)
    for d, row in enumerate(rows):
        if row:
            table[d, : len(row)] = row
    return table
