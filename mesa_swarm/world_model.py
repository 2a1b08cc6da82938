"""World: a Mesa model with a map, robots, obstacles and loads, added and removed between two steps."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import astuple
from typing import Any, ClassVar, Self, cast

import mesa
import numpy as np

from mesa_swarm.errors import (
    InvalidValueError,
    UnknownNameError,
    check_choice,
    check_count,
    check_name,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.design import DesignTable, RobotDesign
from mesa_swarm.robots.robot import SIDES, Robot, remove_together
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.streams import Seed, Streams
from mesa_swarm.trigger import Trigger
from mesa_swarm.world.arena import Agents, Arena, as_numbers
from mesa_swarm.world.bodies import Body, Form, Load, Obstacle, checked_resistance
from mesa_swarm.world.fields import Field, Fields, ScalarField
from mesa_swarm.world.map import Map
from mesa_swarm.world.movers import LARGEST_HEADING, Driven, Movers, poses_of_agents
from mesa_swarm.world.placement import free_places, place_apart
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape, disc
from mesa_swarm.world.statics import FIRE, KINDS, LOAD, MOST_KINDS, OBSTACLE, ROBOT

# The least radius as a share of the largest coordinate: overlap differs from touch by 1e-7 of a radius, which
# may not be less than the rounding of a coordinate. And squares of lengths have to be floats.
FINEST = 4e-9
SMALLEST_RADIUS = 1e-12
MODES = ("driven", "fixed", "pushed")
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
        *("_scene_table", "_fields", "_movers", "_kinds"),
    )
    _fleeting: ClassVar[tuple[str, ...]] = (*MESA_COUNTS, "time", "_scene", "_scene_table")

    _fields: dict[str, ScalarField] | None = None  # by name; None without any
    _movers: Movers | None = None  # None until the first driven body
    _kinds: tuple[str, ...] = KINDS

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
        self._obstacles: list[Body] = []
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
    def obstacle_list(self) -> list[Body]:
        """All of `bodies` as a list, which is quicker to look at; to be read only."""
        return self._obstacles

    @property
    def bodies(self) -> Agents[Body]:
        """The obstacles, loads, driven bodies and ground marks as Mesa agents, in the order in which they came."""
        return Agents(self._obstacles, random=self.random)

    @property
    def obstacles(self) -> Agents[Obstacle]:
        """The obstacles, loads and ground marks as Mesa agents, in the order in which they were added."""
        return Agents([body for body in self._obstacles if isinstance(body, Obstacle)], random=self.random)

    @property
    def loads(self) -> Agents[Load]:
        """The loads as Mesa agents, in the order in which they were added."""
        return Agents(self._loads, random=self.random)

    @property
    def displaced(self) -> list[Load | Driven]:
        """The bodies that may change their places, loads and driven bodies, in the order in which they were added."""
        if self._movers is None:
            return [*self._loads]
        return [body for body in self._obstacles if isinstance(body, Load | Driven)]

    @property
    def movers(self) -> Movers:
        """The poses of all driven bodies as arrays, to be read only; see `move_bodies`."""
        return Movers() if self._movers is None else self._movers

    @property
    def kinds(self) -> tuple[str, ...]:
        """The names of what sensors see: the place of a name is its code in `swarm.kind` and `swarm.contact_kind`.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).kinds
        ('obstacle', 'robot', 'fire', 'load')
        """
        return self._kinds

    def kind_code(self, name: str) -> int:
        """Return the code of a kind in readings: what a rule compares ``me.kind[s]`` with.

        Raises
        ------
        UnknownNameError
            If no body of this kind was added.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> model = SwarmModel(rng=1)
        >>> puck = model.add_body(disc((100, 100), 5), kind="puck")
        >>> model.kind_code("puck")
        4
        """
        if name not in self._kinds:
            raise UnknownNameError(unknown_name("kind", name, self._kinds))
        return self._kinds.index(name)

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

        Examples
        --------
        >>> from mesa_swarm import AGENT3, SwarmModel
        >>> SwarmModel(rng=1).add_robots(AGENT3, poses=[(100, 200, 0.0)])[0].position
        array([100., 200.])
        """
        if not isinstance(design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(design)}; expected a RobotDesign such as AGENT9")
        self.swarm.check_parts(design)
        if group != "":
            check_name("group", group)
        self._check_driven(design, group)
        self._check_resolved(design.radius, (obstacle.shape for obstacle in self._obstacles))
        if (n is None) == (poses is None):
            raise InvalidValueError("add_robots takes either n or poses; give exactly one of them")
        if poses is None:
            position, heading = self._free_poses(design, check_count("n", n))
        else:
            position, heading = self._checked_poses(poses)
        sides = self._sides(len(position), tendency)
        rows = self.swarm.add(design, position, heading, sides, group)
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

    def _check_driven(self, design: RobotDesign, group: str) -> None:
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

    def add_body(
        self,
        shape: Shape,
        *,
        kind: str | None = None,
        mode: str = MODES[0],
        agent: mesa.Agent | None = None,
        resistance: float | None = None,
    ) -> Body:
        """Add a body that robots see and bump into, and return its agent.

        Parameters
        ----------
        shape : Shape
            From `disc`, `rectangle` or `polygon`.
        kind : str
            What sensors see: a name of your own, or "obstacle", "load"; by default "load" for pushed bodies, else
            "obstacle". See `kinds`.
        mode : str
            "driven": it goes where ``body.position = (x, y)``, ``body.heading = h`` or ``body.move_to(...)`` puts it.
            "fixed": an obstacle. "pushed": a load, which robots push; needs `resistance`.
        agent : mesa.Agent, optional
            For a driven body, which then follows the agent's `position` or `pos`, and its `heading` if it has
            one, in each step. A body whose agent was removed from the model is removed as well.
        resistance : float
            See `add_load`.

        Raises
        ------
        InvalidValueError
            If a driven body is a mark on the ground, overlaps a load, or has its centre outside the map.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel, disc
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
        >>> predator = model.add_body(disc((120, 100), 5), kind="predator")
        >>> predator.position = (115, 100)
        >>> model.sense()
        >>> robot.distance[0], model.kinds[robot.kind[0]]
        (5.0, 'predator')
        """
        mode = check_choice("mode", mode, MODES)
        _check_shape("body", shape)
        name = self._checked_kind(kind, KINDS[LOAD] if mode == "pushed" else KINDS[OBSTACLE])
        if mode != "pushed" and resistance is not None:
            raise InvalidValueError(f"resistance was given for a {mode} body; leave it out, or use mode='pushed'")
        if mode != "driven" and agent is not None:
            raise InvalidValueError(f"agent was given for a {mode} body; leave it out, or use mode='driven'")
        if mode == "fixed":
            return self._add_fixed(shape, name)
        if mode == "pushed":
            return self._add_pushed(shape, checked_resistance(cast(float, resistance)), name)
        return self._add_driven(shape, name, agent)

    def move_bodies(self, bodies: Sequence[Body], poses: Sequence[Sequence[float]] | np.ndarray) -> None:
        """Ask for poses of driven bodies, all at once: the quick way for many.

        Parameters
        ----------
        bodies : sequence of Driven
            From `add_body`, of this model.
        poses : array_like, shape (m, 3)
            x, y, heading of each; the centres on the map.

        Raises
        ------
        InvalidValueError
            If a body is not a driven one of this model, or a pose is wrong; none has moved then.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> model = SwarmModel(rng=1)
        >>> sheep = [model.add_body(disc((x, 100), 5), kind="sheep") for x in (100, 200, 300)]
        >>> model.run(1).move_bodies(sheep, [(body.position[0], 102, 0.0) for body in sheep])
        >>> model.run(1).movers.position[:, 1]
        array([102., 102., 102.])
        """
        movers, chosen = self._movers, list(bodies)
        if not all(isinstance(body, Driven) and body.movers is movers for body in chosen):
            raise InvalidValueError("bodies holds others than driven bodies of this model; expected some of add_body")
        table = np.empty((0, 3)) if not chosen else as_numbers(poses)
        if table.shape != (len(chosen), 3):
            raise InvalidValueError(f"poses has shape {table.shape}; expected {(len(chosen), 3)}: x, y, heading each")
        low, high = self.space.dimensions.T
        good = ((table[:, :2] >= low) & (table[:, :2] <= high)).all(axis=1) & (np.abs(table[:, 2]) <= LARGEST_HEADING)
        if not good.all():
            wrong = table[int(np.argmin(good))].tolist()
            raise InvalidValueError(
                f"pose {wrong} is not on map {self.map.name}; expected x and y within {self.space.dimensions.tolist()} "
                "and a finite heading"
            )
        if movers is None or not chosen:
            return
        rows = np.array([cast(Driven, body).alive() for body in chosen])
        new = movers.fresh[rows]
        if new.any():
            self._place_new(
                [cast(Driven, body) for body, is_new in zip(chosen, new, strict=True) if is_new], table[new]
            )
        movers.aim[rows] = table[:, :2]
        movers.aim_heading[rows] = wrapped_all(table[:, 2])

    def add_obstacle(self, shape: Shape) -> Obstacle:
        """Add an obstacle or a ground mark and return its agent.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> SwarmModel(rng=1).add_obstacle(disc((100, 100), 30)).contact
        True
        """
        _check_shape("obstacle", shape)
        return self._add_fixed(shape, KINDS[OBSTACLE])

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
        return self._add_pushed(shape, checked_resistance(resistance), KINDS[LOAD])

    def _add_fixed(self, shape: Shape, kind: str) -> Obstacle:
        self._check_fine_enough(shape)
        self._check_clear_of_loads("obstacle", shape)
        obstacle = Obstacle(self.space, self, shape, kind)
        self._take(obstacle)
        return obstacle

    def _add_pushed(self, shape: Shape, resistance: float, kind: str) -> Load:
        if not shape.contact:
            raise InvalidValueError("load is a mark on the ground, which cannot be pushed; leave out contact=False")
        self._check_room_for_load(shape)
        load = Load(self.space, self, shape, resistance, kind)
        self._loads.append(load)
        self._take(load)
        return load

    def _add_driven(self, shape: Shape, kind: str, agent: mesa.Agent | None) -> Driven:
        if not shape.contact:
            raise InvalidValueError("body is a mark on the ground, which cannot be driven; leave out contact=False")
        if agent is not None and not isinstance(agent, mesa.Agent):
            raise InvalidValueError(f"agent is {shortened(agent)}; expected a Mesa agent or None")
        self._check_fine_enough(shape)
        self._checked_point(shape.position)
        self._check_clear_of_loads("body", shape)
        body = Driven(self.space, self, shape, kind, self._made_movers(), agent)
        self._take(body)
        if agent is not None:
            try:
                self.move_bodies([body], poses_of_agents([body], self.space))
            except InvalidValueError:
                body.remove()
                raise
        return body

    def _made_movers(self) -> Movers:
        """Return the table of driven bodies, made with the first of them."""
        if self._movers is None:
            self._movers = Movers()
            self.space.attach(self._movers)
        return self._movers

    def _take(self, body: Body) -> None:
        self._know_kind(body.kind)
        self._obstacles.append(body)
        self._scene_changed()

    def _know_kind(self, name: str) -> None:
        if name not in self._kinds:
            self._kinds = (*self._kinds, name)

    def _place_new(self, bodies: list[Driven], poses: np.ndarray) -> None:
        """Place bodies at once that were added after the last step."""
        for body, pose in zip(bodies, poses.tolist(), strict=True):
            self._check_clear_of_loads("body", body.form.shape_at(tuple(pose)))
        movers, rows = cast(Movers, self._movers), [body.row for body in bodies]
        movers.position[rows], movers.heading[rows] = poses[:, :2], wrapped_all(poses[:, 2])
        self._scene_changed()

    def _follow_agents(self, movers: Movers) -> None:
        """Ask for the poses of the agents that bodies follow, and remove the bodies of agents that were removed."""
        gone = [body for body in movers.followers if body.agent not in self.agents]
        for body in gone:
            body.remove()
        if movers.followers:
            self.move_bodies(movers.followers, poses_of_agents(movers.followers, self.space))

    def _checked_kind(self, kind: str | None, default: str) -> str:
        """Return the name of a kind that bodies may have."""
        if kind is None:
            return default
        if not isinstance(kind, str) or not kind.isidentifier() or kind in (KINDS[ROBOT], KINDS[FIRE]):
            raise InvalidValueError(
                f"kind is {shortened(kind)}; expected a name such as 'door', which is neither 'robot' nor 'fire'"
            )
        if kind not in self._kinds and len(self._kinds) > MOST_KINDS:
            raise InvalidValueError(f"kind is {shortened(kind)}, one too many; expected at most {MOST_KINDS + 1} kinds")
        return kind

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
        return [body.shape for body in self._obstacles if body.contact and body.mode == "fixed"]

    def _advance_fields(self, fields: dict[str, ScalarField]) -> None:
        for field in fields.values():
            field.advance()

    def obstacles_changed(self) -> None:
        """Update the lists after obstacles or other bodies were removed."""
        for index in reversed(range(len(self._obstacles))):
            if self._obstacles[index].space is None:
                del self._obstacles[index]
                for kind in (OBSTACLE, LOAD, *range(len(KINDS), len(self._kinds))):
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
                self.map.bounds,
                shapes,
                discs,
                temperature,
                sight=sight,
                touch=touch,
                loads=loads,
                codes=[self._kinds.index(body.kind) for body in self._obstacles],
                driven=[row for row, body in enumerate(self._obstacles) if isinstance(body, Driven)],
                movers=self._movers,
            )
            self._scene_table = table
        return self._scene

    def _check_fine_enough(self, shape: Shape) -> None:
        if len(self.swarm):
            self._check_resolved(float(self.swarm.radius.min()), [shape])

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


def wrapped_all(headings: np.ndarray) -> np.ndarray:
    """Return headings in [-pi, pi), those that are there already unchanged."""
    outside = np.flatnonzero(~((headings >= -np.pi) & (headings < np.pi)))
    turned = headings.copy()
    turned[outside] = [wrapped(heading) for heading in headings[outside].tolist()]
    return turned


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
