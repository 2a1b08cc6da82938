"""World: a Mesa model with a map, robots, obstacles and loads, added and removed between two steps."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import astuple
from typing import Any, ClassVar, Self, cast

import numpy as np

from mesa_swarm.body_world import BodyWorld
from mesa_swarm.errors import (
    InvalidValueError,
    check_choice,
    check_count,
    check_name,
    check_number,
    shortened,
)
from mesa_swarm.geometry.compiling import compilation
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.mesa_model import declares, seed_sequence, without_scenario
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.design import DesignTable, RobotDesign
from mesa_swarm.robots.real_robots import Scale, scale_or_none
from mesa_swarm.robots.robot import SIDES, Robot, add_handles, remove_together
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.streams import Seed, Streams
from mesa_swarm.trigger import Trigger
from mesa_swarm.world.arena import Agents, Arena, uncollected
from mesa_swarm.world.bodies import Body, Loads
from mesa_swarm.world.fields import Field, NamedFields, ScalarField
from mesa_swarm.world.map import Map
from mesa_swarm.world.placement import free_places, place_apart
from mesa_swarm.world.shapes import Shape, as_numbers


class World(BodyWorld):
    """The contents of a model, with the obstacles of its map; `EngineModel` adds the step.

    A class declares its attributes where it makes them. All are stored in checkpoints as they are, but those that it
    lists in `_stored_apart`: they are stored in another way, follow from others, or only describe how the model is
    viewed. Those in `_fleeting` change when the model is read. The lists of a class and its bases add up.
    """

    _stored_apart: ClassVar[tuple[str, ...]] = (*("given", "map", "streams", "space", "swarm", "_fields", "_scale"),)

    _fields: dict[str, ScalarField] | None = None  # by name; None without any

    def __new__(cls, *given: Any, **named: Any) -> Self:
        """Store the arguments of the outermost constructor, with which a recorded model is made again."""
        if "seed" in named and not declares(cls, "seed"):
            raise InvalidValueError(f"seed was given to {cls.__name__}; the seed of a model is rng, as in rng=1")
        compilation.expect(cls)
        world = super().__new__(cls)
        if "scenario" in named and not declares(cls, "scenario"):
            named = without_scenario(cls, named)
        # Before any constructor of a subclass has changed them; triggers as recordings have them.
        world.given = tuple(map(_plain, given)), {name: _plain(value) for name, value in named.items()}
        return world

    def __init__(self, *, map: str | os.PathLike | Map, rng: Seed, scale: Scale | None = None) -> None:
        self.map, self.scale = Map.load(map), scale
        super().__init__(rng)
        self.streams = Streams(seed_sequence(rng, self.rng))
        x_min, y_min, x_max, y_max = self.map.bounds
        self.space = Arena([[x_min, x_max], [y_min, y_max]], random=self.random, n_agents=0)
        self.swarm = Swarm()
        self.space.attach(self.swarm)
        self._obstacles: list[Body] = []
        self._loads = Loads()
        self.space.attach(self._loads)
        self._scene: Surroundings | None = None
        self._scene_table: DesignTable | None = None
        with uncollected():
            for shape in self.map.obstacles:
                self.add_obstacle(shape)

    @property
    def scale(self) -> Scale | None:
        """How long a metre and a step are, which pictures, charts and tables show; None if it has none.

        Examples
        --------
        >>> from mesa_swarm import E_PUCK, SwarmModel
        >>> model = SwarmModel(scale=E_PUCK.scale, rng=1)
        >>> robots = model.add_robots(E_PUCK.design(), 5)
        >>> round(model.scale.metres(model.map.width), 2)
        5.92
        """
        return self._scale

    @scale.setter
    def scale(self, scale: Scale | None) -> None:
        self._scale = scale_or_none(scale)

    @property
    def robots(self) -> Agents[Robot]:
        """The robots as Mesa agents, in the order of the swarm's rows."""
        found = Agents.listed(self.swarm.agents, self.random)
        self.swarm.listed[id(found)] = found
        return found

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
        if not isinstance(design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(design)}; expected a RobotDesign such as AGENT9")
        self.swarm.check_parts(design)
        for part in (*design.sensors, *design.actuators):
            part.check_model(self)
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
        self._equip(design)
        self.swarm.add(design, position, heading, sides, group)
        robots = add_handles(self.space, self, self.swarm)
        self.swarm.disturbed |= poses is not None
        return robots

    def _equip(self, design: RobotDesign) -> None:
        """Prepare for robots of a design that are about to be added."""

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

    def remove_all_agents(self) -> None:
        """Take all agents out of the model, between two steps; robots at once, which is much quicker."""
        remove_together(self.swarm.agents)
        super().remove_all_agents()

    @property
    def fields(self) -> NamedFields:
        """The scalar fields by name, in the order in which they were added."""
        return NamedFields(self._fields or {})

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

    def remove_field(self, name: str) -> ScalarField:
        """Take a scalar field out of the model, between two steps, and return it with its last values.

        Rows of a recording have no picture of it from then on.

        Raises
        ------
        UnknownNameError
            If the model has no field of this name.
        InvalidValueError
            If a robot has a sensor or an actuator for it.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> trail = model.add_field(Field("trail"))
        >>> trail.deposit((400, 300), 5.0)
        >>> model.remove_field("trail").total, len(model.fields)
        (5.0, 0)
        """
        field = self.fields[name]
        self._check_unused(field.name)
        others = {other: one for other, one in (self._fields or {}).items() if one is not field}
        self._fields, field.removed = others or None, True
        return field

    def _check_unused(self, name: str) -> None:
        """Refuse the name of a field that a sensor or an actuator of a robot is about."""
        designs = self.swarm.designs
        for place in np.unique(self.swarm.columns["design"]).tolist():
            for part in (*designs[place].sensors, *designs[place].actuators):
                if getattr(part, "field", None) == name:
                    robots = int((self.swarm.columns["design"] == place).sum())
                    raise InvalidValueError(
                        f"field {name} is used by {type(part).__name__} {part.name} of {robots} robots; "
                        "remove these robots first"
                    )

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
        for earlier in before.values():
            earlier.removed = self.fields.get(earlier.name) is not earlier

    def _walls(self) -> list[Shape]:
        """Return the shapes of what stops fields: solid bodies that do not move."""
        return [body.shape for body in self._obstacles if body.mode == "fixed" and body.contact]

    def _advance_fields(self, fields: dict[str, ScalarField]) -> None:
        for field in fields.values():
            field.advance()

    def _free_poses(self, design: RobotDesign, n: int) -> tuple[np.ndarray, np.ndarray]:
        with uncollected():
            shapes = [body.shape for body in self._obstacles if not self._is_carried(body)]
            space = free_places(self.map.bounds, shapes, self._heat_sources()[0], design.radius)
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


def _plain(value: object) -> object:
    return value.every if isinstance(value, Trigger) else value
