"""The part `robots`: the swarm's columns, where robots are placed, what they sense, do and how they move."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any, cast

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_name, check_number, shortened
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.part import Column, Kernel, Part, Phase, Prepared, Role, Stage
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.model.state import checked_state
from mesa_swarm.model.state_hash import describe_designs
from mesa_swarm.physics.engine import Engine
from mesa_swarm.physics.own_devices import OwnDevices
from mesa_swarm.physics.sensor_noise import SensorNoise
from mesa_swarm.physics.stage_kernels import CountArrays, count_collided
from mesa_swarm.robots.actuators import Actuator
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.devices import Device
from mesa_swarm.robots.robot import SIDES, Robot, add_handles, remove_together
from mesa_swarm.robots.sensors import BUILT_IN, Sensor
from mesa_swarm.world.arena import pause_collection
from mesa_swarm.world.placement import free_places, place_apart
from mesa_swarm.world.shapes import as_numbers

# Columns that follow from parameters, and those that depend on the order in which things were created.
OF_PARAMETERS = frozenset({"radius", "max_speed"})
INDICES = frozenset({"number", "design", "contact_index", "group"})
# What is stored besides columns, with its types.
STORED: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("collisions", "total_collisions", "robot_steps"), (int,)),
    "turn_angle": (float, int, np.float64),
    "noise": (tuple,),
}
LARGEST_NUMBER = 1e15
OF_HANDLES = ("position", "heading", "command", "max_speed", "tendency", "temperature", "group")
SET_BY_HAND, NAMES_OF_MARKS = itemgetter(*OF_HANDLES), [f"{name} of robots" for name in OF_HANDLES]


def check_stored_numbers(name: str, value: Any, kinds: tuple[type, ...]) -> None:
    """Refuse a stored number of another type, below 0 or too large."""
    if type(value) not in kinds or not 0 <= value < LARGEST_NUMBER:
        raise InvalidValueError(f"invalid {name}: {shortened(value)}")


def _check_noise(noise: tuple) -> None:
    _, before, draws = noise
    checked_state(before)
    if not isinstance(draws, np.ndarray) or draws.dtype != float:
        raise InvalidValueError("invalid sensor noise")


def role_of(name: str) -> Role:
    """Return the role of a column of the swarm."""
    return "index" if name in INDICES else "parameter" if name in OF_PARAMETERS else "state"


class RobotsPart(Part):
    """The robots of a model.

    Attributes
    ----------
    swarm : Swarm
    engine : Engine
        What computes sensing and contact.
    turn_angle : float, rad
        A robot that meets a flat side at more than this from its normal is turned parallel to it.
    counts : int64 ndarray, shape (3,)
        `collisions`, `total_collisions` and `robot_steps`.
    """

    name = "robots"
    settings = ("turn_angle",)

    def __init__(self, model: Any, engine: Engine, turn_angle: float) -> None:
        self.model, self.swarm, self.engine, self.turn_angle = model, model.swarm, engine, turn_angle
        self.counts = np.zeros(3, np.int64)
        self._noise: SensorNoise | None = None
        self.devices, self.cache = OwnDevices(), Prepared()

    @property
    def collisions(self) -> int:
        """How many robots overlapped anything in the last step."""
        return int(self.counts[0])

    @collisions.setter
    def collisions(self, collisions: int) -> None:
        self.counts[0] = collisions

    @property
    def total_collisions(self) -> int:
        """The sum of these over all steps."""
        return int(self.counts[1])

    @total_collisions.setter
    def total_collisions(self, collisions: int) -> None:
        self.counts[1] = collisions

    @property
    def robot_steps(self) -> int:
        """The sum of the number of robots over all steps."""
        return int(self.counts[2])

    @robot_steps.setter
    def robot_steps(self, steps: int) -> None:
        self.counts[2] = steps

    def columns(self) -> Mapping[str, Column]:
        """Return the columns of the swarm that no other part has."""
        others = [part.columns() for name, part in self.model.parts.items() if name != self.name]
        of_parts = {id(column.array) for columns in others for column in columns.values() if column.rows == "robots"}
        return {
            name: Column(column, "robots", role_of(name))
            for name, column in self.swarm.columns.items()
            if id(column) not in of_parts
        }

    def stages(self) -> Iterator[Stage]:
        """Sense, act, move."""
        yield Stage(Phase.SENSE, self.sense, "robots read their sensors", **self._sensing())
        if self.swarm.table.actions:
            yield Stage(Phase.ACT, self.act, "actuators do what they are set to", **self._acting())
        yield Stage(Phase.MOVE, self.move, "robots move, and contacts are resolved", **self._moving())
        yield Stage(Phase.COLLECT, self.count_collisions, "collisions are counted", self.counting())

    def _sensing(self) -> dict[str, Any]:
        """Return the fields of the stage that senses: its kernel, with imperfections, or what makes Python due."""
        swarm, parts = self.swarm, self.model.parts
        scene, effect, following = parts.bodies.scene(), parts.imperfections.effect, []
        if effect is not None:
            following.append(effect.reading_kernel(swarm))
        custom = ""
        if swarm.table.readings:
            kernel = self.devices.sensing(self.model, scene)
            custom = "" if kernel else ", ".join(dict.fromkeys(self.devices.without_kernels(self.model)))
            custom = custom or ("" if kernel else self._of_class(Sensor))
            following += [kernel] if effect is None else [kernel, effect.custom_kernel(swarm)]
        fields = self.engine.sensing(swarm, scene, self.sensor_noise(), {custom: custom != ""})
        if fields.get("kernel") is not None:
            fields["kernel"] = sequence_of([fields["kernel"], *following])
        return fields

    def _acting(self) -> dict[str, Any]:
        """Return the fields of the stage of actuators: its kernel, or the names of those without."""
        kernel = self.devices.acting(self.model, self.model.parts.bodies.scene())
        names = ", ".join(dict.fromkeys(self.devices.actuators_without_kernels(self.model)))
        return {"kernel": kernel} if kernel else {"python": names or self._of_class(Actuator)}

    def _moving(self) -> dict[str, Any]:
        """Return the fields of the stage that moves robots, likewise after imperfections of their wheels."""
        swarm, scene, effect = self.swarm, self.model.parts.bodies.scene(), self.model.parts.imperfections.effect
        spoils, driven = (None, swarm.columns["command"]) if effect is None else effect.wheel_kernel(swarm)
        fields = self.engine.moving(swarm, scene, driven, self.turn_angle, self._slip_stream())
        if fields.get("kernel") is not None and spoils is not None:
            fields["kernel"] = sequence_of([self.engine.settling(swarm, scene), spoils, fields["kernel"]])
        return fields

    def _of_class(self, kind: type) -> str:
        """Return the names of custom devices of a class that robots have."""
        devices = [device for design in self.swarm.designs for device in (*design.sensors, *design.actuators)]
        members = [
            device
            for device in devices
            if isinstance(device, Device) and isinstance(device, kind) and type(device) not in BUILT_IN
        ]
        return ", ".join(dict.fromkeys(device.name for device in members))

    def parameters(self) -> dict[str, Any]:
        """Return designs with the rows of their robots, groups, and how robots turn at walls."""
        designs = describe_designs(self.swarm.designs, self.swarm.columns["design"])
        return {"designs": designs, "groups": self.rows_of_groups(), "turn angle": self.turn_angle}

    def store(self) -> dict[str, Any]:
        """Return the counters, the angle at which robots turn, and this step's draws for errors of sensors."""
        return {name: getattr(self, name) for name in STORED}

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned, checked."""
        for name, value in stored.items():
            if name != "noise":
                check_stored_numbers(name, value, STORED[name])
            elif value is not None:
                _check_noise(value)
            setattr(self, name, value)
        self.model.parts.replan()  # of which the angle is a part

    def mark(self) -> dict[str, Any]:
        """Return the columns that handles set, and wheel commands, which persist where no controller decides."""
        swarm = self.swarm
        bytes_of = map(np.ndarray.tobytes, SET_BY_HAND(swarm.columns))
        return {
            **dict(zip(NAMES_OF_MARKS, bytes_of, strict=True)),
            "counters": (self.collisions, self.total_collisions, self.turn_angle),
            "an attribute set to the value that it had": (swarm.disturbed, swarm.version),
        }

    def rows_of_groups(self) -> dict[str, np.ndarray]:
        """Return by the names of groups, of those that have robots, which rows are in them."""
        group, names = self.swarm.columns["group"], self.swarm.groups
        return {names[place]: group == place for place in np.unique(group).tolist() if place >= 0}

    def sense(self) -> None:
        """Read all sensors for the current poses; reading twice gives the same."""
        swarm, model, step = self.swarm, self.model, self.model._completed
        parts = model._parts  # without the cost of the property
        scene, imperfect = parts.bodies.scene(), parts.imperfections.effect
        state = (step, swarm.version, scene)
        if self.cache.state != state or swarm.disturbed:
            self.engine.sense(swarm, scene, step, self.sensor_noise())
            if imperfect is not None:
                imperfect.spoil_readings(swarm, step)
            self.cache.state = state
        if swarm.table.readings:
            # Always: what they read, such as a user's own agents, may have changed since the last reading.
            self.devices.sense(model, scene)
            if imperfect is not None:
                imperfect.spoil_custom(swarm, step)

    def forget_readings(self) -> None:
        """Let sensors be read again, though nothing that a reading depends on seems to have changed."""
        self.cache.state = None

    def act(self) -> None:
        """Let actuators do what they are set to."""
        self.devices.act(self.model, self.model.parts.bodies.scene())

    def move(self) -> None:
        """Move all robots by their commands, and resolve contacts."""
        swarm = self.swarm
        if not len(swarm):
            return
        parts = self.model._parts
        scene, imperfect = parts.bodies.scene(), parts.imperfections.effect
        if swarm.disturbed:
            self.engine.settle(swarm, scene)
            swarm.disturbed = False
        step = self.model._completed
        commands = swarm.columns["command"] if imperfect is None else imperfect.driven_wheels(swarm, step)
        self.engine.move(swarm, scene, commands, self.turn_angle, self._slip_stream())

    def _slip_stream(self) -> np.random.Generator | None:
        """Return what the slip of wheels is drawn from, None where none slips."""
        return self.model.streams["slip"] if self.swarm.table.slips else None

    def count_collisions(self) -> None:
        """Count the robots that overlapped anything in this step."""
        self.counting().run(self.model.steps, len(self.swarm))

    def counting(self) -> Kernel:
        """Return what counts collisions, made anew when the column is another one."""
        kernel, collided = self.cache.kernel, self.swarm.columns["collided"]
        if kernel is None or kernel.kept[0] is not collided:
            block = Block(CountArrays(collided, self.counts))
            kernel = self.cache.kernel = Kernel(count_collided, block.numbers, (collided, block))
        return kernel

    def sensor_noise(self) -> SensorNoise | None:
        """Return what errors of sensors are drawn from, None where no sensor errs."""
        if self._noise is None and self.swarm.table.noisy:
            self._noise = SensorNoise(self.model.streams["noise"])
        return self._noise if self.swarm.table.noisy else None

    @property
    def noise(self) -> tuple | None:
        """A step, the state of the stream before it, and the draws for errors of sensors in it; None without any."""
        return None if self._noise is None else self._noise.store()

    @noise.setter
    def noise(self, noise: tuple | None) -> None:
        self._noise = None
        if noise is not None:
            step, _, draws = noise
            self._noise = SensorNoise(self.model.streams["noise"])
            self._noise.restore(step, draws)

    # ---- robots that are added and removed

    def add_robots(
        self,
        design: RobotDesign,
        n: int | None = None,
        *,
        poses: Iterable[Sequence[float]] | None = None,
        tendency: str | Sequence[str] | None = None,
        group: str = "",
    ) -> list[Robot]:
        """Add robots at free random poses, or at given ones, and return their handles.

        Parameters
        ----------
        design : RobotDesign
            Its radius at least 4e-9 of the largest coordinate of the map and of what is solid, and at least 1e-12.
        n : int
            How many, at free random places with random headings; they never overlap anything.
        poses : iterable of (x, y, heading), instead of n
            Within the map. Robots that overlap anything are moved to free space nearby in the next step.
        tendency : "left", "right" or a sequence of these, optional
            The side to which each turns from what is straight ahead; by default drawn by chance.
        group : str
            The name of a group, by which `model.control` may have an arbiter for them; "" for none.

        Raises
        ------
        PlacementError
            If they do not fit; the message names how many would.
        InvalidValueError
            If neither or both of n and poses are given, a pose is not on the map, the robots are too small for their
            coordinates, or the control is not for such a drive.
        UnknownNameError
            If the design has a part for a field that the model does not have; add the field first.

        Examples
        --------
        >>> from mesa_swarm import AGENT3, SwarmModel
        >>> SwarmModel(rng=1).add_robots(AGENT3, poses=[(100, 200, 0.0)])[0].position
        array([100., 200.])
        """
        self._check_addable(design, group)
        if (n is None) == (poses is None):
            raise InvalidValueError("add_robots takes either n or poses; give exactly one of them")
        if poses is None:
            position, heading = self._free_poses(design, check_count("n", n))
        else:
            position, heading = self._checked_poses(poses)
        sides = self._sides(len(position), tendency)
        if design.battery:
            self.model.parts.imperfections.prepare_wear()
        self.swarm.add(design, position, heading, sides, group)
        robots = add_handles(self.model.space, self.model, self.swarm)
        self.swarm.disturbed |= poses is not None
        self.model.parts.add_rows("robots", len(robots))
        return robots

    def _check_addable(self, design: RobotDesign, group: str) -> None:
        """Refuse robots that the model cannot have."""
        if not isinstance(design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(design)}; expected a RobotDesign such as AGENT9")
        self.swarm.check_devices(design)
        for device in (*design.sensors, *design.actuators):
            device.check_model(self.model)
        if group != "":
            check_name("group", group)
        self.model.parts.control.check_driven(design, group)
        bodies = self.model.parts.bodies
        bodies.check_resolved(design.radius, (body.shape for body in bodies.listed))

    def remove_robots(self, robots: Iterable[Robot]) -> None:
        """Take robots out of the model, between two steps.

        Raises
        ------
        InvalidValueError
            If they are not robots of this model.
        RemovedRobotError
            If one of them is gone already.
        """
        try:
            handles = list(robots)
        except TypeError:  # not iterable
            handles = [cast(Robot, robots)]
        for robot in handles:
            if not isinstance(robot, Robot) or robot.swarm is not self.swarm:
                raise InvalidValueError(f"robots holds {shortened(robot)}; expected some of model.robots")
        remove_together(handles)

    def drop_rows(self, rows: Sequence[int]) -> None:
        """Drop the rows of robots that have left the model, and free what they carried."""
        self.swarm.remove(rows)
        self.model.parts.drop_rows("robots", rows)
        self.model.parts.bodies.robots_left(rows)

    def _free_poses(self, design: RobotDesign, n: int) -> tuple[np.ndarray, np.ndarray]:
        bodies, streams, world = self.model.parts.bodies, self.model.streams, self.model.map
        with pause_collection():
            solid = (body for body in (*bodies.listed, *bodies.fires()) if body.mode != "carried")
            space = free_places(world.bounds, [body.shape for body in solid], design.radius)
        old, radii, where = self.swarm.position, self.swarm.radius, f"map {world.name}"
        position = place_apart(n, design.radius, space, old, radii, streams["placement"], where)
        return position, streams["heading"].uniform(-np.pi, np.pi, n)

    def _checked_poses(self, poses: Iterable[Sequence[float]]) -> tuple[np.ndarray, np.ndarray]:
        try:
            table = np.empty((0, 3)) if not len(rows := list(poses)) else as_numbers(rows)
        except TypeError:  # not iterable
            table = np.empty(0)
        if table.ndim != 2 or table.shape[1] != 3:
            raise InvalidValueError("poses are not rows of three numbers; expected (x, y, heading) each")
        for x, y, heading in table:
            self.model.parts.bodies.checked_point((x, y))
            check_number("heading", heading, minimum=-1e9, maximum=1e9)
        return table[:, :2].copy(), np.array([wrap_angle(heading) for heading in table[:, 2]], dtype=float)

    def _sides(self, n: int, tendency: str | Sequence[str] | None) -> np.ndarray:
        if tendency is None:
            return np.where(self.model.streams["tendency"].random(n) < 0.5, 1.0, -1.0)
        try:
            names = [tendency] * n if isinstance(tendency, str) else list(tendency)
        except TypeError:
            raise InvalidValueError(
                f"tendency is {shortened(tendency)}; expected left, right, or a sequence of these"
            ) from None
        if len(names) != n:
            raise InvalidValueError(f"tendency names {len(names)} sides for {n} robots; expected one each")
        return np.array([SIDES[check_choice("tendency", name, SIDES)] for name in names], dtype=float)
