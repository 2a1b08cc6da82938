"""Sensors that a robot may carry: what they are, not what they read."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.geometry.diffusion import interpolate_cells
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import ByteRows, Integers, RealRows, Reals
from mesa_swarm.robots.devices import RESERVED, Device, argument_names, check_device, check_identifier, own_function

LARGEST_RANGE = 1e6
MOST_RAYS = 10_000
LONGEST_HOLD = 10**9

Mount = tuple[float, float]


class Sensor(Device):
    """Base of all sensors; a custom class has a `name`, a `width` and a function `read`.

    ``read`` is a static function that fills `out` (n, width), one row a robot that has the sensor; what it leaves out
    stays NaN, which is nothing. The names of its other parameters decide what it gets: what `arguments` returns, the
    sensor's own attributes, columns of the swarm such as `heading` (n,), the `rows` (n,) of these robots in the
    swarm, and `obstacles` and `owners`, as `is_cut` and `is_cut_but` of `mesa_swarm.physics.broadcasts` take them. It
    changes nothing but `out`, and reading twice gives the same. It is compiled when first used, and runs as plain
    Python where it cannot be.

    A class that derives from another may have ``kernel_for(model, rows, column, first)`` besides, which returns a
    `mesa_swarm.kernels.part.Kernel` that does the same for robots in these rows, from a place in the column on.

    Readings are ``me.compass`` in a rule, ``swarm.compass`` (n, width) and ``robot.compass``; NaN for robots without
    one. Sensors of a design with the same name stand side by side in that column, in their order.

    Attributes
    ----------
    name : str
        One word that no column has.
    width : int
        How many numbers one sensor reads, 1 to 10,000.
    minimum, maximum : float
        Limits of a reading that is disturbed; replaced readings (`Imperfection.outliers`) need both to be finite.
    spoiled : bool
        Whether `SwarmModel.imperfections` disturb what it reads.

    Examples
    --------
    >>> from mesa_swarm import RobotDesign, SwarmModel
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Compass(Sensor):
    ...     name: str = "compass"
    ...
    ...     @staticmethod
    ...     def read(heading, out):
    ...         for i in range(len(out)):
    ...             out[i, 0] = -heading[i]
    >>> model = SwarmModel(rng=1)
    >>> (robot,) = model.add_robots(RobotDesign(sensors=(Compass(),)), poses=[(100, 100, 0.5)])
    >>> model.sense()
    >>> robot.compass
    array([-0.5])
    """

    __slots__ = ()

    read: ClassVar[Any] = None
    minimum: ClassVar[Any] = -math.inf
    maximum: ClassVar[Any] = math.inf
    spoiled: ClassVar[Any] = True


def check_sensor(sensor: Sensor) -> None:
    """Refuse a custom sensor that cannot be used.

    Raises
    ------
    InvalidValueError
        If its name, its width or its function is not what `Sensor` describes.
    """
    if type(sensor) in BUILT_IN:
        return
    check_device("sensor", sensor, "read", RESERVED)
    kind, function = type(sensor).__name__, own_function(sensor, "read")
    if function is None:
        raise InvalidValueError(f"sensor {kind} has no function read; give it a @staticmethod read(..., out)")
    if "out" not in argument_names(function):
        raise InvalidValueError(f"{kind}.read takes no parameter out, which it is to fill; add one")


def _check_sector(sensor: "ProximitySensor | RadiationSensor") -> None:
    check_number("bearing_degrees", sensor.bearing_degrees, minimum=-360, maximum=360)
    check_number("range", sensor.range, minimum=0, maximum=LARGEST_RANGE)
    check_number("field_of_view_degrees", sensor.field_of_view_degrees, minimum=0, maximum=360)
    check_mount(sensor, by_default=True)


def check_mount(device: Any, by_default: bool = False) -> None:
    """Make the mount of a device floats, so that equal devices compare and hash as equal; None is for a default place.

    Raises
    ------
    InvalidValueError
    """
    mount = device.mount
    if mount is None and by_default:
        return
    try:
        x, y = mount
    except (TypeError, ValueError):
        raise InvalidValueError(f"mount is {shortened(mount)}; expected (x, y) in the robot's frame") from None
    x, y = (check_number("mount", value, minimum=-LARGEST_RANGE, maximum=LARGEST_RANGE) for value in (x, y))
    object.__setattr__(device, "mount", (x, y))


@dataclass(frozen=True, kw_only=True, slots=True)
class ProximitySensor(Sensor):
    """An infrared sensor of the distance and kind of the nearest body in its sector.

    Parameters
    ----------
    bearing_degrees : float
        Direction of its axis from the robot's heading, counter-clockwise.
    range : float
        Farthest distance it sees, map units, 0 to 1e6.
    field_of_view_degrees : float
        Full angle of the sector, 0 to 360.
    mount : (x, y), optional
        Where it sits in the robot's frame (x ahead, y left); by default on the rim, at its bearing.
    error_probability, error_magnitude : float
        With this probability (0 to 1) a reading becomes reading * (1 +- magnitude), the sign random,
        clipped to [0, range]. A detection is never invented or lost.
    hold : int
        One draw of the error stays for this many steps, at least 1.
    period : int
        The reading is refreshed after every `period` steps, at least 1.
    rays : int
        0 measures the exact distance; k > 0 looks along k evenly spread rays only, as the thesis did.

    Examples
    --------
    >>> ProximitySensor(bearing_degrees=30, range=16, field_of_view_degrees=30).range
    16
    """

    name = "distance"
    bearing_degrees: float = 0.0
    range: float = 50.0
    field_of_view_degrees: float = 40.0
    mount: Mount | None = None
    error_probability: float = 0.0
    error_magnitude: float = 0.0
    hold: int = 1
    period: int = 1
    rays: int = 0

    def __post_init__(self) -> None:
        """Check every value."""
        _check_sector(self)
        check_number("error_probability", self.error_probability, minimum=0, maximum=1)
        check_number("error_magnitude", self.error_magnitude, minimum=0, maximum=1e6)
        check_count("hold", self.hold, minimum=1, maximum=LONGEST_HOLD)
        check_count("period", self.period, minimum=1, maximum=LONGEST_HOLD)
        check_count("rays", self.rays, maximum=MOST_RAYS)


@dataclass(frozen=True, kw_only=True, slots=True)
class RadiationSensor(Sensor):
    """A sensor of the highest temperature among the fires and other hot bodies that meet its sector, 0 if none.

    Parameters
    ----------
    bearing_degrees, range, field_of_view_degrees, mount
        As for `ProximitySensor`.

    Examples
    --------
    >>> RadiationSensor().range
    80.0
    """

    name = "radiation"
    bearing_degrees: float = 0.0
    range: float = 80.0
    field_of_view_degrees: float = 60.0
    mount: Mount | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        _check_sector(self)


@dataclass(frozen=True, kw_only=True, slots=True)
class LineSensor(Sensor):
    """A downward sensor: whether a point of the robot is over a ground mark.

    Parameters
    ----------
    mount : (x, y)
        The point, in the robot's frame.

    Examples
    --------
    >>> LineSensor(mount=(5.0, 0.0)).mount
    (5.0, 0.0)
    """

    name = "line"
    mount: Mount = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the mount."""
        check_mount(self)


@compiled
def read_field(position, heading, mount, amounts, sides, frame, out):
    """Look a field up where the sensors of robots are, see `geometry.diffusion.look_up`."""
    points = np.empty((len(out), 2))
    for i in range(len(out)):
        cosine, sine = direction_of(heading[i])
        points[i, 0] = position[i, 0] + cosine * mount[0] - sine * mount[1]
        points[i, 1] = position[i, 1] + sine * mount[0] + cosine * mount[1]
    interpolate_cells(amounts, sides, frame, points, out[:, 0], np.empty((len(out), 2)))


class RowsOfSensor(NamedTuple):
    """The robots that have a sensor, and where it writes.

    Columns of the swarm, and the rows of these robots; scratch of as many rows: poses and readings (k, width); the
    column of readings, and where in it the sensor begins to write.
    """

    position: RealRows
    heading: Reals
    rows: Integers
    own_position: RealRows
    own_heading: Reals
    out: RealRows
    column: RealRows
    first: int

    @classmethod
    def of(cls, model: Any, rows: np.ndarray, column: np.ndarray, first: int, width: int) -> "RowsOfSensor":
        """Return the robots in these rows, with scratch."""
        columns, k = model.swarm.columns, len(rows)
        scratch = np.empty((k, 2)), np.empty(k), np.empty((k, width))
        return cls(columns["position"], columns["heading"], np.array(rows), *scratch, column, first)


@compiled
def begin_reading(r):
    """Copy the poses of the robots that have a sensor, which at first reads nothing, NaN."""
    rows, position, heading, own_position, own_heading = r.rows, r.position, r.heading, r.own_position, r.own_heading
    for i in range(rows.shape[0]):
        row = rows[i]
        own_position[i, 0], own_position[i, 1], own_heading[i] = position[row, 0], position[row, 1], heading[row]
    r.out[:] = np.nan


@compiled
def end_reading(r):
    """Write readings into the column of the sensor."""
    rows, out, column, first = r.rows, r.out, r.column, r.first
    for i in range(rows.shape[0]):
        for w in range(out.shape[1]):
            column[rows[i], first + w] = out[i, w]


class FieldReading(NamedTuple):
    """What `read_fields` takes: the robots, the sensor's mount, and the field as `geometry.diffusion` takes it."""

    robots: RowsOfSensor
    mount: tuple[float, float]
    amounts: RealRows
    sides: ByteRows
    frame: tuple[float, float, float, float]


@compiled(nogil=True)
def read_fields(block, step, first, last):
    """Do what `read_field` does, for all robots that have the sensor."""
    f = unpack(block, FieldReading)
    r = f.robots
    begin_reading(r)
    read_field(r.own_position, r.own_heading, f.mount, f.amounts, f.sides, f.frame, r.out)
    end_reading(r)
    return 0


@dataclass(frozen=True, kw_only=True, slots=True)
class FieldSensor(Sensor):
    """A sensor of a scalar field at a point: its value there, interpolated between cells, see `ScalarField.at`.

    Parameters
    ----------
    field : str
        The name of a field of the model, which has to be there before the robots.
    mount : (x, y)
        The point, in the robot's frame (x ahead, y left). Where it is beyond the map, or in an obstacle, it reads the
        nearest place that is not.
    name : str
        What rules and columns call it; by default the name of the field.

    Examples
    --------
    >>> from mesa_swarm import Field, FieldSensor, RobotDesign, SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> model.add_field(Field("trail", cell=10.0)).deposit((105, 305), 4.0)
    >>> antennae = FieldSensor(field="trail", mount=(5, 5)), FieldSensor(field="trail", mount=(5, -5))
    >>> (robot,) = model.add_robots(RobotDesign(sensors=antennae), poses=[(100, 300, 0.0)])
    >>> model.sense()
    >>> robot.trail
    array([4., 0.])
    """

    field: str
    mount: Mount = (0.0, 0.0)
    name: str = ""
    minimum = 0.0
    read = staticmethod(read_field)

    def __post_init__(self) -> None:
        """Check every value."""
        check_identifier("field of a FieldSensor", self.field)
        check_mount(self)
        object.__setattr__(self, "name", self.name or self.field)

    def check_model(self, model: Any) -> None:
        """Refuse a model without the field."""
        _ = model.fields[self.field]

    def arguments(self, model: Any) -> Mapping[str, Any]:
        """Return the field as `geometry.diffusion` takes it."""
        field = model.fields[self.field]
        return {"amounts": field.values, "sides": field.sides, "frame": field.frame}

    def kernel_for(self, model: Any, rows: np.ndarray, column: np.ndarray, first: int) -> Kernel:
        """Return what reads the field for the robots in these rows, see `Sensor`."""
        field, robots = model.fields[self.field], RowsOfSensor.of(model, rows, column, first, int(self.width))
        block = Block(FieldReading(robots, self.mount, *field.arrays()[:3]))
        return Kernel(read_fields, block.numbers, block)


# What the engines read themselves, into columns of their own.
BUILT_IN = (ProximitySensor, RadiationSensor, LineSensor)


def laser_sensor(bearing_degrees: float = 0.0, range: float = 200.0) -> ProximitySensor:
    """Return a laser range finder: a proximity sensor that is long and narrow.

    Examples
    --------
    >>> laser_sensor(90).field_of_view_degrees
    1.0
    """
    return ProximitySensor(bearing_degrees=bearing_degrees, range=range, field_of_view_degrees=1.0)


def bump_sensor(bearing_degrees: float = 0.0, field_of_view_degrees: float = 90.0) -> ProximitySensor:
    """Return a bumper: a proximity sensor that sees next to nothing but what touches it.

    Examples
    --------
    >>> bump_sensor().range
    0.5
    """
    return ProximitySensor(bearing_degrees=bearing_degrees, range=0.5, field_of_view_degrees=field_of_view_degrees)


def mount_of(sensor: ProximitySensor | RadiationSensor, radius: float) -> Mount:
    """Return where a sensor sits on a robot of this radius: its mount, or the rim at its bearing.

    Examples
    --------
    >>> mount_of(ProximitySensor(bearing_degrees=0), 5.0)
    (5.0, 0.0)
    """
    if sensor.mount is not None:
        return sensor.mount
    bearing = math.radians(sensor.bearing_degrees)
    x, y = direction_of(bearing)
    return radius * x, radius * y
