"""Robots of laboratories and classrooms in metres and seconds, and the scale of a model.

Their values are from data sheets and published descriptions or, where these give none that we found, from descriptions
of simulators: size, speed, range and bearings of the e-puck, and size, speed and sensors of the Thymio II, are Webots';
size and range of the Khepera IV are a plugin's for ARGoS, its speed is Webots'. The sources are beside each robot.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, check_name, check_number, shortened
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.sensors import ProximitySensor

LENGTHS = (("km", 1e3), ("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("µm", 1e-6))
# A robot of the thesis is so wide, map units, and so fast, map units a step.
USUAL_DIAMETER = 10.0
USUAL_SPEED = 1.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Scale:
    """How long a metre and a step are: what pictures, charts and tables show beside map units and steps.

    It changes nothing that happens in a model.

    Parameters
    ----------
    units_per_metre : float
        Map units, 1e-9 to 1e9.
    seconds_per_step : float
        1e-9 to 1e9.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> scale = Scale(units_per_metre=100, seconds_per_step=0.1)
    >>> scale.metres(50), scale.seconds(30), scale.ruler(800)
    (0.5, 3.0, (200.0, '2 m'))
    """

    units_per_metre: float
    seconds_per_step: float

    def __post_init__(self) -> None:
        """Check every value."""
        for name in ("units_per_metre", "seconds_per_step"):
            value = check_number(name, getattr(self, name), minimum=1e-9, maximum=1e9)
            object.__setattr__(self, name, value)

    def metres(self, units: Any) -> Any:
        """Return lengths in map units as metres; of an array, each.

        Examples
        --------
        >>> import numpy as np
        >>> scale = Scale(units_per_metre=100, seconds_per_step=0.1)
        >>> scale.metres(50), scale.metres(np.array([0, 250])).tolist()
        (0.5, [0.0, 2.5])
        """
        return units / self.units_per_metre

    def seconds(self, steps: Any) -> Any:
        """Return a number of steps in seconds; of an array, each.

        Examples
        --------
        >>> Scale(units_per_metre=100, seconds_per_step=0.25).seconds(30)
        7.5
        """
        return steps * self.seconds_per_step

    def ruler(self, width: float) -> tuple[float, str]:
        """Return the length (map units) and the text of a scale bar for a picture of this width.

        It is 1, 2 or 5 times a power of ten long, and at most a quarter of the width.

        Parameters
        ----------
        width : float
            Map units, above 0.

        Raises
        ------
        InvalidValueError
            If the width is not a finite number above 0.

        Examples
        --------
        >>> scale = Scale(units_per_metre=100, seconds_per_step=0.1)
        >>> scale.ruler(800), scale.ruler(3)
        ((200.0, '2 m'), (0.5, '5 mm'))
        """
        most = self.metres(check_number("width", width, above=0)) / 4
        power = 10.0 ** math.floor(math.log10(most))
        length = max(power * digit for digit in (1, 2, 5) if digit == 1 or power * digit <= most * (1 + 1e-9))
        name, size = length_unit(length)
        return length * self.units_per_metre, f"{length / size:.6g} {name}"


def length_unit(metres: float) -> tuple[str, float]:
    """Return the name of the largest unit that is not longer than a length, and its own length in metres.

    Examples
    --------
    >>> length_unit(0.05), length_unit(20)
    (('cm', 0.01), ('m', 1.0))
    """
    return next(((name, size) for name, size in LENGTHS if metres >= size * (1 - 1e-9)), LENGTHS[-1])


def check_scale(scale: object) -> Scale | None:
    """Return a model's scale, or refuse what is neither one nor None."""
    if scale is None or isinstance(scale, Scale):
        return scale
    cure = "; of a robot give its scale, such as E_PUCK.scale" if isinstance(scale, RealRobot) else ""
    raise InvalidValueError(
        f"scale is {shortened(scale)}; expected Scale(units_per_metre=..., seconds_per_step=...) or None{cure}"
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class RealRobot:
    """A robot as it is built, in metres and seconds; `design` is what a model takes.

    Parameters
    ----------
    name : str
    diameter : float
        Of the disc that stands for its body, m.
    max_speed : float
        Of each wheel's rim, m/s.
    sensors : tuple of ProximitySensor
        With ranges (and mounts) in m.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> E_PUCK.diameter, E_PUCK.scale.ruler(800)
    (0.074, (135.13513513513513, '1 m'))
    >>> E_PUCK.design().radius, E_PUCK.design().max_speed
    (5.0, 1.0)
    >>> beside = KHEPERA_4.design(scale=E_PUCK.scale)  # on the same map, as much larger and faster as it is
    >>> round(beside.radius, 1), round(beside.max_speed, 1)
    (9.5, 7.8)
    """

    name: str
    diameter: float
    max_speed: float
    sensors: tuple[ProximitySensor, ...] = ()

    def __post_init__(self) -> None:
        """Check every value."""
        check_name("name", self.name)
        check_number("diameter", self.diameter, minimum=1e-6, maximum=1e3)
        check_number("max_speed", self.max_speed, minimum=1e-9, maximum=1e3)
        if not isinstance(self.sensors, tuple) or not all(isinstance(s, ProximitySensor) for s in self.sensors):
            raise InvalidValueError(f"sensors is {shortened(self.sensors)}; expected a tuple of ProximitySensor")

    @property
    def scale(self) -> Scale:
        """The scale at which it is as large and as fast as a robot of the thesis: 10 units wide, 1 unit a step."""
        units = USUAL_DIAMETER / self.diameter
        return Scale(units_per_metre=units, seconds_per_step=USUAL_SPEED / (units * self.max_speed))

    def design(self, scale: Scale | None = None, **changes: Any) -> RobotDesign:
        """Return its design in map units and steps.

        Parameters
        ----------
        scale : Scale, optional
            By default its own.
        **changes
            Other fields of `RobotDesign`.

        Raises
        ------
        InvalidValueError
            If the scale is not one, or a value that follows, or is given, is out of its range.

        Examples
        --------
        >>> design = E_PUCK.design(battery=5000)
        >>> design.radius, design.max_speed, design.battery, round(design.sensors[0].range, 1)
        (5.0, 1.0, 5000, 5.4)
        >>> round(KILOBOT.design(scale=E_PUCK.scale).radius, 2)  # beside an e-puck
        2.23
        """
        own_scale = check_scale(scale)
        units, step = (own_scale or self.scale).units_per_metre, (own_scale or self.scale).seconds_per_step
        body = {"radius": self.diameter * units / 2, "max_speed": self.max_speed * units * step}
        if own_scale is None:  # without rounding
            body = {"radius": USUAL_DIAMETER / 2, "max_speed": USUAL_SPEED}
        sensors = tuple(
            replace(s, range=s.range * units, mount=s.mount and (s.mount[0] * units, s.mount[1] * units))
            for s in self.sensors
        )
        return RobotDesign(**{"name": self.name, **body, "sensors": sensors, **changes})


def _eyes(bearings: tuple[float, ...], reach: float, field_of_view_degrees: float) -> tuple[ProximitySensor, ...]:
    return tuple(
        ProximitySensor(bearing_degrees=b, range=reach, field_of_view_degrees=field_of_view_degrees) for b in bearings
    )


def _ring(count: int, reach: float, field_of_view_degrees: float | None = None) -> tuple[ProximitySensor, ...]:
    """Return sensors evenly round a robot, the first ahead; by default their sectors fill the circle."""
    width = 360.0 / count
    return _eyes(tuple(k * width for k in range(count)), reach, field_of_view_degrees or width)


S_BOT = RealRobot(name="S_BOT", diameter=0.116, max_speed=0.2, sensors=_ring(15, 0.15))
"""The s-bot of the Swarm-bots project (EPFL, 2001 to 2005).

Diameter 116 mm and 15 infrared proximity sensors round the turret: the project's description (F. Mondada et al.,
swarm-bots.org) as encyclopaedias give it. Not found, our choice: their even spacing, range 150 mm, speed 0.2 m/s. The
gripper, which connects robots, and the turret, which turns against the tracks, are not modelled.
"""

I_SWARM = RealRobot(name="I_SWARM", diameter=0.003, max_speed=0.001, sensors=_ring(4, 0.01))
"""The micro-robot of the I-SWARM project (2004 to 2008).

A square of 3 mm, 2 mm high: the thesis's survey. Infrared module in four directions: A. Sanuy et al., Energy Aware
HW/SW Integration in an Autonomous Microrobot (2007), which gives the height as 3 mm. Not found, our choice: range
10 mm, speed 1 mm/s. A disc of the width of its sides stands for the square, wheels for the vibrating legs.
"""

E_PUCK = RealRobot(
    name="E_PUCK", diameter=0.074, max_speed=0.129, sensors=_eyes((17, -17, 46, -46, 90, -90, 151, -151), 0.04, 30)
)
"""The e-puck of EPFL and GCtronic.

Diameter 74 mm, eight infrared sensors of a range of 40 mm, and their bearings: Webots' user guide, its page of the
e-puck (directions 1.27, 0.77, 0, 5.21, 4.21, 3.14, 2.37 and 1.87 rad from the axis to the right). Speed: 1,000 motor
steps a second at 20 steps a turn behind a gear of 50:1 and a wheel radius of 20.5 mm, from the same page, are 0.129
m/s; its table has 0.25 m/s instead, and the FARSA simulator 0.14 m/s. Not found, our choice: field of view 30 degrees.
"""

KHEPERA_4 = RealRobot(name="KHEPERA_4", diameter=0.1408, max_speed=1.0, sensors=_ring(8, 0.12))
"""The Khepera IV of K-Team.

Radius 70.4 mm and infrared range 0.12 m: C. Pinciroli's plugin for ARGoS (argos3-kheperaiv, kheperaiv_measures). Eight
infrared sensors evenly round, the first ahead: the documentation of Buzz for this robot. Speed: 47.61 rad/s at a wheel
radius of 21 mm, Webots' model Khepera4, are 1.0 m/s. Our choice: sectors that fill the circle; ultrasound is left out.
"""

TURTLEBOT_3 = RealRobot(name="TURTLEBOT_3", diameter=hypot(0.138, 0.178), max_speed=0.22, sensors=_ring(24, 3.5, 15.0))
"""The TurtleBot3 Burger of ROBOTIS.

138 mm by 178 mm and 0.22 m/s: ROBOTIS e-manual, TurtleBot3, Specifications. The disc is circumscribed about the
rectangle, 225 mm in diameter. Laser scanner LDS-01, all round, to 3.5 m: guides of that version. Our choice: 24
sectors of 15 degrees, and no least distance.
"""

THYMIO_2 = RealRobot(
    name="THYMIO_2",
    diameter=hypot(0.112, 0.117),
    max_speed=0.2,
    sensors=_eyes((0, 20, -20, 40, -40, 150, -150), 0.1, 20),
)
"""The Thymio II of Mobsya and EPFL.

112 mm by 117 mm, 0.2 m/s, five infrared sensors ahead and two behind: Webots' user guide, page Thymio II. The disc is
circumscribed about the rectangle, 162 mm in diameter. Not found, our choice: bearings, range 0.1 m, field of view 20
degrees.
"""

KILOBOT = RealRobot(
    name="KILOBOT",
    diameter=0.033,
    max_speed=0.01,
    sensors=(ProximitySensor(range=0.1, field_of_view_degrees=360, mount=(0.0, 0.0)),),
)
"""The Kilobot of Harvard University.

Diameter 33 mm, 1 cm/s, and infrared to 10 cm by reflection: M. Rubenstein, C. Ahler and R. Nagpal, Kilobot: A low cost
scalable robot system for collective behaviors (2012), and descriptions of it. It senses how far a neighbour is, not in
which direction: one sensor of all directions at the centre, which here sees walls too. Wheels stand for the legs.
"""

REAL_ROBOTS = {robot.name: robot for robot in (S_BOT, I_SWARM, E_PUCK, KHEPERA_4, TURTLEBOT_3, THYMIO_2, KILOBOT)}
"""The robots above by name."""
