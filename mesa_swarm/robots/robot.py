"""One robot: a handle on a row of the swarm, and a Mesa agent."""

from collections.abc import Sequence
from typing import Any, ClassVar, Self, cast

import numpy as np
from mesa import Agent, Model
from numpy.typing import NDArray

from mesa_swarm.base.errors import (
    InvalidValueError,
    RemovedRobotError,
    check_choice,
    check_count,
    check_name,
    check_number,
)
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.devices import reserve_names
from mesa_swarm.robots.swarm import FAILED_SENSORS, FAILED_WHEELS, LASTING, WHEELS, Swarm
from mesa_swarm.world.arena import (
    Arena,
    ArenaAgent,
    leave_together,
    pause_collection,
    register_together,
    registers_together,
)
from mesa_swarm.world.read_only import read_only

SIDES = {"left": 1.0, "right": -1.0}


class Robot(ArenaAgent):
    """A robot. It knows its swarm and its row; all else is read from the swarm's columns.

    Created by `SwarmModel.add_robots`; taken out with `remove()` or `SwarmModel.remove_robots`. Reading
    gives copies, which refuse to be written to; setting is checked first. A robot that was removed raises
    `RemovedRobotError`.
    """

    __slots__ = ("model", "row", "swarm", "unique_id")  # the first and the last in the place of a dict for each robot
    swarm: Swarm
    row: int
    _made_by: ClassVar[str] = "model.add_robots(AGENT9, 10) or model.add_robots(AGENT9, poses=[(x, y, heading), ...])"

    def __new__(cls, *arguments: Any, **keywords: Any) -> Self:
        """Refuse `Robot(model)`, as agents of Mesa are made; copies and pickles give nothing."""
        if arguments and isinstance(arguments[0], Model):
            cls._refuse("(model)")
        return super().__new__(cls)

    def __init__(self, space: Arena, model: Model, swarm: Swarm, row: int) -> None:
        self.swarm = swarm
        self.row = row
        super().__init__(space, model)

    def __repr__(self) -> str:
        if self.row < 0:
            return f"<Robot {self.unique_id}, removed>"
        x, y, heading = (round(float(number), 2) for number in (*self.position, self.heading))
        return f"<Robot {self.unique_id} at ({x}, {y}), heading {heading}>"

    def __getattr__(self, name: str) -> Any:
        """Return what its custom sensors of this name read: ``robot.compass``, shape (width,)."""
        # Without the first two, copying a half-made robot would never end.
        if name.startswith("__") or name == "swarm" or name not in self.swarm.table.readings:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        width = sum(int(sensor.width) for sensor in self.design.own if sensor.name == name)
        return self._copied(name, width)

    @property
    def position(self) -> NDArray[np.float64]:
        """Centre of the body, shape (2,), map units."""
        return self._copied("position")

    @position.setter
    def position(self, value: Sequence[float] | np.ndarray) -> None:
        self.alive()
        self._write("position", self.space.checked_point(value))

    @property
    def heading(self) -> float:
        """Direction of travel, rad in [-pi, pi), counter-clockwise from +x."""
        return float(self._read("heading"))

    @heading.setter
    def heading(self, value: float) -> None:
        self._write("heading", wrap_angle(check_number("heading", value)))

    @property
    def max_speed(self) -> float:
        """Limit of the rim speed of each wheel, of its own speed if it goes sideways, map units a step."""
        return float(self._read("max_speed"))

    @max_speed.setter
    def max_speed(self, value: float) -> None:
        limit = self.design.max_speed
        self._write("max_speed", check_number("max_speed", value, minimum=0, maximum=limit))

    @property
    def tendency(self) -> str:
        """The side to which it turns when something is straight ahead: left or right."""
        return "left" if self._read("tendency") > 0 else "right"

    @tendency.setter
    def tendency(self, value: str) -> None:
        self._write("tendency", SIDES[check_choice("tendency", value, SIDES)])

    @property
    def temperature(self) -> float:
        """The heat it has taken from fires and not yet lost."""
        return float(self._read("temperature"))

    @temperature.setter
    def temperature(self, value: float) -> None:
        self._write("temperature", check_number("temperature", value, minimum=0))

    @property
    def design(self) -> RobotDesign:
        """What it is built like."""
        return self.swarm.designs[self._read("design")]

    @property
    def group(self) -> str:
        """The name of its group, "" for none; `model.control` may have an arbiter for each."""
        group = int(self._read("group"))
        return self.swarm.groups[group] if group >= 0 else ""

    @group.setter
    def group(self, value: str) -> None:
        row, model = self.alive(), cast(Any, self.model)
        name = value if value == "" else check_name("group", value)
        model.parts.control.check_driven(self.design, name)
        self.swarm.set_group(row, name)

    @property
    def radius(self) -> float:
        """Radius of its body, map units."""
        return float(self._read("radius"))

    @property
    def command(self) -> NDArray[np.float64]:
        """Commanded rim speeds, left and right, or as many numbers as its drive has."""
        return self._copied("command", self.design.numbers)

    @property
    def layer(self) -> int:
        """Index of the layer that won in the last step, -1 if none was active."""
        return int(self._read("layer"))

    @property
    def task(self) -> int:
        """Its task, as its layers number it, -1 for nothing."""
        return int(self._read("task"))

    @property
    def goal(self) -> NDArray[np.float64]:
        """The position at which it works, in its own frame when it decided, NaN for none."""
        return self._copied("goal")

    @property
    def distance(self) -> NDArray[np.float64]:
        """Readings of its proximity sensors, -1 where nothing is seen."""
        return self._copied("distance", len(self.design.proximity))

    @property
    def kind(self) -> NDArray[np.int8]:
        """What its proximity sensors see: 0 obstacle, 1 robot, 2 fire, 3 load, -1 nothing."""
        return self._copied("kind", len(self.design.proximity))

    @property
    def fire(self) -> int:
        """Index of the fire that it fights, -1 for none."""
        return int(self._read("fire"))

    @property
    def collided(self) -> bool:
        """Whether it ran into anything in the last step."""
        return bool(self._read("collided"))

    @property
    def radiation(self) -> NDArray[np.float64]:
        """Readings of its radiation sensors: temperatures, 0 for no fire."""
        return self._copied("radiation", len(self.design.radiation))

    @property
    def line(self) -> NDArray[np.bool]:
        """Readings of its line sensors: whether each is over a mark."""
        return self._copied("line", len(self.design.line))

    @property
    def slip(self) -> NDArray[np.float64]:
        """The truth about its wheels, left and right: 0 rolled as commanded, 1 not at all (A.5)."""
        return self._copied("slip", self.design.numbers)

    @property
    def heat(self) -> float:
        """What it took from a fire in the last step."""
        return float(self._read("heat"))

    @property
    def hot(self) -> bool:
        """Whether it is too hot to fight fires."""
        return bool(self._read("hot"))

    @property
    def battery(self) -> float:
        """How full its battery is, from 1 down to 0; 1 without one.

        Examples
        --------
        >>> from dataclasses import replace
        >>> from mesa_swarm import AGENT3, SwarmModel
        >>> from mesa_swarm.control import Explore, Subsumption
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(replace(AGENT3, battery=40), poses=[(100, 300, 0.0)])
        >>> model.control = Subsumption(Explore())
        >>> model.run(10).robots[0].battery, model.run(30).robots[0].battery
        (0.75, 0.0)
        """
        return float(self.swarm.battery[self.alive()])

    @property
    def failures(self) -> tuple[str, ...]:
        """What of it failed: "stop", "battery empty", "sensor 2", "wheel 0 stuck" and so on; empty if all works.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> (robot,) = SwarmModel(rng=1).add_robots(AGENT9, 1)
        >>> robot.failures
        ()
        >>> robot.fail("wheel", index=1, how="free")
        >>> robot.fail("stop")
        >>> robot.failures
        ('stop', 'wheel 1 free')
        """
        row, columns = self.alive(), self.swarm.columns
        texts = ["stop"] if f"{LASTING}broken" in columns and columns[f"{LASTING}broken"][row] else []
        texts += ["battery empty"] if self.battery <= 0.0 else []
        if FAILED_SENSORS in columns:
            texts += [f"sensor {index}" for index in np.flatnonzero(columns[FAILED_SENSORS][row]).tolist()]
            wheels = columns[FAILED_WHEELS][row].tolist()
            texts += [f"wheel {index} {WHEELS[state]}" for index, state in enumerate(wheels) if state]
        return tuple(texts)

    def fail(self, what: str, index: int | None = None, how: str = "stuck") -> None:
        """Let the robot, one of its sensors or one of its wheels fail, between two steps, until `repair`.

        A robot that stopped, and likewise one with an empty battery, is stopped at its wheels only: it still senses,
        decides and broadcasts, and others may follow it (`Lead` stays active); it cools a fire at which it stands, and
        holds what it carries.

        Parameters
        ----------
        what : str
            "stop": the robot stands, see above. "sensor": a sensor reads nothing. "wheel": a wheel no longer obeys.
        index : int
            Of the sensor, in the order of ``design.sensors``, or of the wheel: 0 is left, 1 is right.
        how : str
            Of a wheel: "stuck" stands; "free" has no drive, and rolls as fast as the other one.

        Raises
        ------
        InvalidValueError
            If there is no such sensor or wheel, or its drive has no wheels, or no two, of which one may be free.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> (robot,) = SwarmModel(rng=1).add_robots(AGENT9, 1)
        >>> robot.fail("sensor", index=2)
        >>> robot.fail("wheel", index=0)
        >>> robot.failures
        ('sensor 2', 'wheel 0 stuck')
        >>> robot.repair()
        >>> robot.failures
        ()
        """
        row = self.alive()
        check_choice("what", what, ("stop", "sensor", "wheel"))
        state = WHEELS.index(check_choice("how", how, WHEELS[1:]))
        place = 0 if what == "stop" else self._place(what, index, how)
        cast(Any, self.model).parts["imperfections"].prepare_failures()
        columns = self.swarm.columns
        if what == "stop":
            columns[f"{LASTING}broken"][row] = True
        elif what == "sensor":
            columns[FAILED_SENSORS][row, place] = True
        else:
            columns[FAILED_WHEELS][row, place] = state
        self.swarm.disturbed = True  # its sensors are read again

    def repair(self) -> None:
        """Let all of the robot work again, with a full battery.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> (robot,) = SwarmModel(rng=1).add_robots(AGENT9, 1)
        >>> robot.fail("stop")
        >>> robot.repair()
        >>> robot.failures, robot.battery
        ((), 1.0)
        """
        row, columns = self.alive(), self.swarm.columns
        for name in (f"{LASTING}broken", f"{LASTING}used", FAILED_SENSORS, FAILED_WHEELS):
            if name in columns:
                columns[name][row] = 0
        self.swarm.disturbed = True

    def _place(self, what: str, index: int | None, how: str) -> int:
        """Return the index of a sensor or a wheel that there is."""
        design = self.design
        if what == "wheel" and (design.turns is False or (how == "free" and not design.turns)):
            raise InvalidValueError(
                f"what is 'wheel', how is {how!r}, of a robot with {type(design.drive).__name__}; expected robots with "
                "wheels, for a free one with a left and a right wheel"
            )
        count = len(design.sensors) if what == "sensor" else design.numbers
        if index is None or not count:
            raise InvalidValueError(f"index is {index}; expected that of one of {count} {what}s of {design.name}")
        return check_count(f"index of a {what}", index, maximum=count - 1)

    def remove(self) -> None:
        """Take the robot out of the model, between two steps."""
        remove_together([self])

    def alive(self) -> int:
        """Return its row; a removed robot raises an error."""
        if self.row < 0:
            raise RemovedRobotError(f"robot {self.unique_id} was removed; take a handle from model.robots")
        return self.row

    def _read(self, name: str) -> Any:
        return self.swarm.columns[name][self.alive()]

    def _copied(self, name: str, width: int | None = None) -> Any:
        """Return the first numbers of its row of a column, which cannot be written to: that would change nothing."""
        return read_only(self._read(name)[:width].copy())

    def _write(self, name: str, value: Any) -> None:
        row = self.alive()
        self.swarm.columns[name][row] = value
        self.swarm.disturbed = True


def add_handles(space: Arena, model: Model, swarm: Swarm) -> list[Robot]:
    """Make the handles of the rows that have none yet, as `Robot` does one by one, and return them."""
    rows = range(len(swarm.agents), len(swarm.columns["position"]))
    if not rows or not registers_together(model):
        robots = [Robot(space, model, swarm, row) for row in rows]
    else:
        with pause_collection():
            robots = [object.__new__(Robot) for _ in rows]
            for robot in robots:
                robot.swarm = swarm
            register_together(model, space, robots, rows)
    swarm.agents = [*swarm.agents, *robots]
    return robots


def remove_together(robots: Sequence[Robot]) -> None:
    """Take robots out of their model at once, which costs as much as to take out one.

    Raises
    ------
    RemovedRobotError
        If one of them is gone already, before anything is changed.
    """
    rows = {robot.alive(): robot for robot in robots}
    if not rows:
        return
    model = cast(Any, robots[0].model)
    leave_together(list(rows.values()))
    for row in sorted(rows, reverse=True):
        Agent.remove(rows[row])
    model.parts["robots"].drop_rows(sorted(rows))


reserve_names(dir(Robot))
