"""World: a Mesa model with a map, robots, obstacles and loads, added and removed between two steps."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import astuple
from typing import Any, ClassVar, Self, cast

import mesa
import numpy as np

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.design import DesignTable, RobotDesign
from mesa_swarm.robots.robot import SIDES, Robot, remove_together
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.streams import Seed, Streams
from mesa_swarm.trigger import Trigger
from mesa_swarm.world.arena import Agents, Arena, as_numbers
from mesa_swarm.world.bodies import Form, Load, Obstacle, checked_resistance
from mesa_swarm.world.fields import Field, Fields, ScalarField
from mesa_swarm.world.map import Map
from mesa_swarm.world.placement import free_places, place_apart
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape, disc
from mesa_swarm.world.statics import LOAD, OBSTACLE

# The least radius as a share of the largest coordinate: overlap differs from touch by 1e-7 of a radius, which
# may not be less than the rounding of a coordinate. And squares of lengths have to be floats.
FINEST = 4e-9
SMALLEST_RADIUS = 1e-12
# Attributes of Mesa's models, of all versions: what changes when Mesa counts a step, and the others.
MESA_COUNTS = ("steps", "_time", "_batch_context", "_suppress", "subscribers", "agent_id_counter")
OF_MESA = (
    *("step", "rng", "_rng", "random", "_seed", "_user_step", "_agents", "_agents_by_type", "_all_agents"),
    *("_simulator", "_event_list", "_event_generators", "_scenario", "_default_schedule", "data_registry"),
)


class World(mesa.Model):
    """The contents of a model, with the obstacles of its map; `EngineModel` adds the step.

    A class declares its attributes where it makes them. All are stored in checkpoints as they are, but those that it
    lists in `_stored_apart`: they are stored in another way, follow from others, or only describe how the model is
    viewed. Those in `_fleeting` change when the model is read. The lists of a class and its bases add up.
    """

    _stored_apart: ClassVar[tuple[str, ...]] = (
        *(*MESA_COUNTS, *OF_MESA, "given", "map", "streams", "space", "swarm", "_obstacles", "_loads", "_scene"),
        *("_scene_table", "_fields"),
    )
    _fleeting: ClassVar[tuple[str, ...]] = (*MESA_COUNTS, "time", "_scene", "_scene_table")

    _fields: dict[str, ScalarField] | None = None  # by name; None without any

    def __new__(cls, *given: Any, **named: Any) -> Self:
        """Store the arguments of the outermost constructor, with which a recorded model is made again."""
        world = super().__new__(cls)
        # Before any constructor of a subclass has changed them; triggers as recordings have them.
        world.given = tuple(map(_plain, given)), {name: _plain(value) for name, value in named.items()}
        return world

    def __init__(self, *, map: str | os.PathLike | Map, rng: Seed) -> None:
        self.map = Map.load(map)
        rng = _checked_seed(rng)
        super().__init__(rng=rng)
        self.streams = Streams(_seed_sequence(rng, self.rng))
        x_min, y_min, x_max, y_max = self.map.bounds
        self.space = Arena([[x_min, x_max], [y_min, y_max]], random=self.random, n_agents=0)
        self.swarm = Swarm()
        self.space.attach(self.swarm)
        self._obstacles: list[Obstacle] = []
        self._loads: list[Load] = []
        self._scene: Surroundings | None = None
        self._scene_table: DesignTable | None = None
        for shape in self.map.obstacles:
            self.add_obstacle(shape)

    @property
    def robots(self) -> Agents[Robot]:
        """The robots as Mesa agents, in the order of the swarm's rows."""
        return Agents(self.swarm.agents, random=self.random)

    @property
    def obstacle_list(self) -> list[Obstacle]:
        """The obstacles, loads and ground marks as a list, which is quicker to look at; to be read only."""
        return self._obstacles

    @property
    def obstacles(self) -> Agents[Obstacle]:
        """The obstacles, loads and ground marks as Mesa agents, in the order in which they were added."""
        return Agents(self._obstacles, random=self.random)

    @property
    def loads(self) -> Agents[Load]:
        """The loads as Mesa agents, in the order in which they were added."""
        return Agents(self._loads, random=self.random)

    def add_robots(
        self,
        design: RobotDesign,
        n: int | None = None,
        *,
        poses: Iterable[Sequence[float]] | None = None,
        tendency: str | Sequence[str] | None = None,
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

        Raises
        ------
        PlacementError
            If they do not fit; the message names how many would.
        InvalidValueError
            If neither or both of n and poses are given, a pose is not on the map, the robots are too small for their
            coordinates, or the control is not for such a drive.

        Examples
        --------
        >>> from mesa_swarm import AGENT3, SwarmModel
        >>> SwarmModel(rng=1).add_robots(AGENT3, poses=[(100, 200, 0.0)])[0].position
        array([100., 200.])
        """
        if not isinstance(design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(design)}; expected a RobotDesign such as AGENT9")
        self.swarm.check_parts(design)
        self._check_driven(design)
        self._check_resolved(design.radius, (obstacle.shape for obstacle in self._obstacles))
        if (n is None) == (poses is None):
            raise InvalidValueError("add_robots takes either n or poses; give exactly one of them")
        if poses is None:
            position, heading = self._free_poses(design, check_count("n", n))
        else:
            position, heading = self._checked_poses(poses)
        sides = self._sides(len(position), tendency)
        rows = self.swarm.add(design, position, heading, sides)
        robots = [Robot(self.space, self, self.swarm, int(row)) for row in rows]
        self.swarm.agents += robots
        self.swarm.disturbed |= poses is not None
        return robots

    def _hot_discs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centre and radius (k, 3) and temperature (k,) of discs that sensors of heat see; here none."""
        return np.empty((0, 3)), np.empty(0)

    def _hot_agents(self) -> Sequence[mesa.Agent]:
        """Return the agents of these discs, in their order."""
        return ()

    def _check_driven(self, design: RobotDesign) -> None:
        """Refuse robots that the control cannot drive; a world without control accepts all."""

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
            chosen = list(robots)
        except TypeError:  # not iterable
            chosen = [cast(Robot, robots)]
        for robot in chosen:
            if not isinstance(robot, Robot) or robot.swarm is not self.swarm:
                raise InvalidValueError(f"robots holds {shortened(robot)}; expected some of model.robots")
        remove_together(chosen)

    def add_obstacle(self, shape: Shape) -> Obstacle:
        """Add an obstacle or a ground mark and return its agent.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> SwarmModel(rng=1).add_obstacle(disc((100, 100), 30)).contact
        True
        """
        _check_shape("obstacle", shape)
        if len(self.swarm):
            self._check_resolved(float(self.swarm.radius.min()), [shape])
        self._check_clear_of_loads("obstacle", shape)
        obstacle = Obstacle(self.space, self, shape)
        self._obstacles.append(obstacle)
        self._scene_changed()
        return obstacle

    def add_load(self, shape: Shape, *, resistance: float) -> Load:
        """Add a body that robots can push, together if need be, and return its agent.

        Parameters
        ----------
        shape : Shape
            At first: within the map, free of obstacles, fires and other loads. Robots there are moved to free space
            nearby in the next step.
        resistance : float
            How many robots' full pushes it withstands, above 0: it moves only when pushed harder than that. A
            robot that drives straight into it at its greatest speed gives one full push.

        Raises
        ------
        InvalidValueError
            If it is a mark on the ground, overlaps anything but robots, or is not within the map.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, rectangle
        >>> SwarmModel(rng=1).add_load(rectangle((100, 100), (140, 120)), resistance=2.5).position
        array([120., 110.])
        """
        _check_shape("load", shape)
        resistance = checked_resistance(resistance)
        if not shape.contact:
            raise InvalidValueError("load is a mark on the ground, which cannot be pushed; leave out contact=False")
        self._check_room_for_load(shape)
        load = Load(self.space, self, shape, resistance)
        self._obstacles.append(load)
        self._loads.append(load)
        self._scene_changed()
        return load

    @property
    def fields(self) -> Fields:
        """The scalar fields by name, in the order in which they were added."""
        return Fields(self._fields or {})

    def add_field(self, field: Field) -> ScalarField:
        """Add a scalar field, empty at first, and return it; it advances in each step, after contacts are resolved.

        Raises
        ------
        InvalidValueError
            If the model has a field of this name, or it would have too many cells or sub-steps.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> trail = model.add_field(Field("trail", cell=10.0, diffusion=0.1, evaporation=0.01))
        >>> trail.deposit((400, 300), 5.0)
        >>> round(model.run(1).fields["trail"].total, 3)
        4.95
        """
        if not isinstance(field, Field):
            raise InvalidValueError(f'field is {shortened(field)}; expected a Field such as Field("trail")')
        if field.name in self.fields:
            raise InvalidValueError(f"the model has a field {field.name} already; expected another name")
        live = ScalarField(field, self.map.bounds, self._walls)
        self._fields = {**(self._fields or {}), field.name: live}
        return live

    def _fields_as_stored(self) -> list:
        """Return the declarations and the states of all fields, as plain values."""
        return [[astuple(field.declared), field.checkpoint()] for field in self.fields.values()]

    def _restore_fields(self, stored: Iterable[tuple[tuple, dict]]) -> None:
        """Restore what `_fields_as_stored` returned; fields that the model has stay the same objects."""
        before, self._fields = self.fields, None
        for declared, state in stored:
            field = Field(*declared)
            known = before.get(field.name)
            if known is None or known.declared != field:
                known = self.add_field(field)
            self._fields = {**(self._fields or {}), field.name: known}
            known.restore(state)

    def _walls(self) -> list[Shape]:
        """Return the shapes of what stops fields: solid obstacles that do not move."""
        return [body.shape for body in self._obstacles if body.contact and not isinstance(body, Load)]

    def _advance_fields(self, fields: dict[str, ScalarField]) -> None:
        for field in fields.values():
            field.advance()

    def obstacles_changed(self) -> None:
        """Update the lists after obstacles or other bodies were removed."""
        for index in reversed(range(len(self._obstacles))):
            if self._obstacles[index].space is None:
                del self._obstacles[index]
                for kind in (OBSTACLE, LOAD):
                    self.swarm.forget_contact(kind, index)
        if self._loads:
            self._loads = [obstacle for obstacle in self._obstacles if isinstance(obstacle, Load)]
        self._scene_changed()

    def _scene_changed(self) -> None:
        self._scene = None
        self.swarm.disturbed = True
        for field in (self._fields or {}).values():
            field.walls_changed()

    def _current_scene(self) -> Surroundings:
        table = self.swarm.table
        if self._scene is None or self._scene_table is not table or (self._loads and self._scene.is_worn):
            shapes = [obstacle.shape for obstacle in self._obstacles]
            discs, temperature = self._hot_discs()
            sight = float(table.reach.max(initial=0.0))
            touch = max((design.radius for design in table.designs), default=1.0)
            loads = [(row, body) for row, body in enumerate(self._obstacles) if isinstance(body, Load)]
            self._scene = Surroundings.of(
                self.map.bounds, shapes, discs, temperature, sight=sight, touch=touch, loads=loads
            )
            self._scene_table = table
        return self._scene

    def _check_resolved(self, radius: float, shapes: Iterable[Shape]) -> None:
        """Refuse robots so small that rounding of positions among these shapes would hide overlaps."""
        if radius >= FINEST * LARGEST_COORDINATE:  # as a rule; there may be many shapes
            return
        boxes = [self.map.bounds, *(shape.bounds for shape in shapes if shape.contact)]
        farthest = max(abs(coordinate) for box in boxes for coordinate in box)
        least = max(FINEST * farthest, SMALLEST_RADIUS)
        if radius < least:
            raise InvalidValueError(
                f"radius of a robot is {radius:g} in a world with coordinates up to {farthest:g}; expected at least "
                f"{least:g}: bring everything nearer to the origin or enlarge the robots"
            )

    def _check_room_for_load(self, shape: Shape) -> None:
        """Refuse a load that is not within the map or overlaps anything but robots."""
        form, pose = Form.of(shape), (*shape.position.tolist(), 0.0)
        if not form.is_within(pose, self.map.bounds):
            raise InvalidValueError(f"load is not within map {self.map.name}, {list(self.map.bounds)}; move it inside")
        others = [("an obstacle or load", body.shape) for body in self._obstacles if body.contact]
        others += [("a fire", disc((x, y), radius)) for x, y, radius in self._hot_discs()[0]]
        for name, other in others:
            if form.overlaps(pose, other):
                raise InvalidValueError(f"load overlaps {name} at {other.position.tolist()}; expected free space")

    def _check_clear_of_loads(self, name: str, shape: Shape) -> None:
        """Refuse an obstacle or a fire that overlaps a load."""
        for load in self._loads:
            if shape.contact and load.form.overlaps(load.pose, shape):
                raise InvalidValueError(f"{name} overlaps a load at {load.position.tolist()}; expected free space")

    def _free_poses(self, design: RobotDesign, n: int) -> tuple[np.ndarray, np.ndarray]:
        shapes = [obstacle.shape for obstacle in self._obstacles]
        space = free_places(self.map.bounds, shapes, self._hot_discs()[0], design.radius)
        old, radii, where = self.swarm.position, self.swarm.radius, f"map {self.map.name}"
        position = place_apart(n, design.radius, space, old, radii, self.streams["placement"], where)
        return position, self.streams["heading"].uniform(-np.pi, np.pi, n)

    def _checked_poses(self, poses: Iterable[Sequence[float]]) -> tuple[np.ndarray, np.ndarray]:
        try:
            table = np.empty((0, 3)) if not len(rows := list(poses)) else as_numbers(rows)
        except TypeError:  # not iterable
            table = np.empty(0)
        if table.ndim != 2 or table.shape[1] != 3:
            raise InvalidValueError("poses are not rows of three numbers; expected (x, y, heading) each")
        for x, y, heading in table:
            self._checked_point((x, y))
            check_number("heading", heading, minimum=-1e9, maximum=1e9)
        return table[:, :2].copy(), np.array([wrapped(heading) for heading in table[:, 2]], dtype=float)

    def _checked_point(self, point: Sequence[float]) -> np.ndarray:
        array = as_numbers(point)
        if array.shape != (2,) or not self.space.in_bounds(array):
            raise InvalidValueError(
                f"position {shortened(point)} is not on map {self.map.name}; "
                f"expected x and y within {self.space.dimensions.tolist()}"
            )
        return array

    def _sides(self, n: int, tendency: str | Sequence[str] | None) -> np.ndarray:
        if tendency is None:
            return np.where(self.streams["tendency"].random(n) < 0.5, 1.0, -1.0)
        try:
            names = [tendency] * n if isinstance(tendency, str) else list(tendency)
        except TypeError:
            raise InvalidValueError(
                f"tendency is {shortened(tendency)}; expected left, right, or a sequence of these"
            ) from None
        if len(names) != n:
            raise InvalidValueError(f"tendency names {len(names)} sides for {n} robots; expected one each")
        return np.array([SIDES[check_choice("tendency", name, SIDES)] for name in names], dtype=float)


def _check_shape(name: str, shape: Shape) -> None:
    if not isinstance(shape, Shape):
        raise InvalidValueError(f"{name} is {shortened(shape)}; expected disc(...), rectangle(...) or polygon(...)")


def _plain(value: object) -> object:
    return value.every if isinstance(value, Trigger) else value


def _checked_seed(rng: Seed) -> Seed:
    """Return what Mesa takes as a seed; anything else is refused before Mesa sees it."""
    if isinstance(rng, np.integer):
        rng = int(rng)
    try:
        if isinstance(rng, bool):
            raise TypeError
        np.random.default_rng(rng)
    except (TypeError, ValueError):
        raise InvalidValueError(
            f"rng is {shortened(rng)}; expected a whole number of at least 0, a SeedSequence, a Generator or None"
        ) from None
    return rng


def _seed_sequence(rng: Seed, generator: np.random.Generator) -> np.random.SeedSequence:
    """Return the root of the streams: the seed itself, or a draw of the generator given instead."""
    if isinstance(rng, (np.random.Generator, np.random.BitGenerator)):
        return np.random.SeedSequence(int(generator.integers(2**63)))
    return cast(np.random.SeedSequence, generator.bit_generator.seed_seq)  # the generator was made of a seed
