"""The part `bodies`: obstacles, loads, driven bodies and marks, and the scene that they make."""

from collections.abc import Container, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, TypeVar, cast

import mesa
import numpy as np

from mesa_swarm.base.errors import (
    BehaviourError,
    InvalidValueError,
    UnknownNameError,
    check_choice,
    shortened,
    unknown_name,
)
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.part import Column, Kernel, Part, Phase, Prepared, Stage
from mesa_swarm.model.state_hash import describe_bodies
from mesa_swarm.physics.carrying import ASTRAY, Carrying, let_go
from mesa_swarm.physics.driven_bodies import BeginArrays, EndArrays, Moving, begin_ways, end_ways
from mesa_swarm.physics.engine import begin_way
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.robot import Robot
from mesa_swarm.world.bodies import (
    LARGEST_HEADING,
    Body,
    BodyTable,
    Form,
    Load,
    Obstacle,
    Pose,
    check_resistance,
    check_temperature,
    handle_classes,
)
from mesa_swarm.world.movers import Driven, Movers, is_led_elsewhere, poses_of_agents
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape, as_numbers
from mesa_swarm.world.statics import CARRIED, DRIVEN, FIRE, FIXED, KINDS, LOAD, MOST_KINDS, OBSTACLE, PUSHED, ROBOT

# The least radius as a share of the largest coordinate: overlap differs from touch by 1e-7 of a radius, which
# may not be less than the rounding of a coordinate. And squares of lengths have to be floats.
FINEST = 4e-9
SMALLEST_RADIUS = 1e-12
# What of the columns of bodies changes from step to step; the others follow from what bodies are.
CHANGING = (
    *("position", "heading", "radius", "temperature", "resistance", "pushers", "moved"),
    *("aim", "aim_heading", "blocked", "fresh"),
)
# What of them functions of arrays may read besides.
READ = ("kind", "mode", "carrier")
POSES, HEAT = "pose of driven bodies", "temperature of bodies"
# Why no process sends a body that moves in such a way.
AT_REST = {FIXED: "is at rest", PUSHED: "is pushed by robots"}


Handle = TypeVar("Handle", bound=Body)


class Described(Prepared):
    """What bodies at rest are, and of which state that is."""

    description: Any = None


class SceneCache:
    """What a part has made of its state, and makes again when that has changed."""

    scene: Surroundings | None = None
    table: Any = None  # of the robots' designs
    moves: bool | None = None
    carrying: Carrying | None = None
    followers = True

    def __init__(self) -> None:
        self.beginning, self.ending, self.described = Prepared(), Prepared(), Described()

    def __reduce__(self) -> tuple:
        return type(self), ()


class BodiesPart(Part):
    """The bodies of a model, in the order in which they came, and the kinds that sensors distinguish.

    Attributes
    ----------
    table : BodyTable
        Obstacles, loads, driven bodies, fires and marks on the ground.
    """

    name = "bodies"

    def __init__(self, model: Any) -> None:
        self.model, self.map, self.space, self.swarm = model, model.map, model.space, model.swarm
        self.table = BodyTable()
        self.space.attach(self.table)
        self.cache, self._roams, self._spare = SceneCache(), False, 0

    def columns(self) -> dict[str, Column]:
        """Return what changes from step to step.

        Bodies at rest have no order that a step depends on, which columns have: hashed are the `parameters`.
        """
        changing = {name: Column(getattr(self.table, name), None, "index") for name in CHANGING}
        return {**changing, **{name: Column(getattr(self.table, name), None, "derived") for name in READ}}

    def stages(self) -> Iterator[Stage]:
        """Follow agents before robots sense; rest before robots move, and afterwards: where bodies may move."""
        self.scene()
        if self.cache.followers:
            yield Stage(Phase.SENSE, self.follow, "bodies follow their agents", python="agents")
        if self.moves:
            yield Stage(Phase.MOVE, self.begin_move, "driven bodies begin their ways", self.beginning())
            yield Stage(Phase.RESOLVE, self.end_move, "bodies rest, and are carried along", self.ending())

    @property
    def kinds(self) -> tuple[str, ...]:
        """The names of all kinds, which readings have as codes."""
        return self.table.kinds

    @property
    def listed(self) -> list[Body]:
        """All bodies but fires, which are numbered apart."""
        return self.table.others

    @property
    def movers(self) -> Movers:
        """The driven bodies."""
        return Movers(self.table)

    @property
    def loads(self) -> list[Load]:
        """The bodies that robots push."""
        return [self.table.agents[row] for row in self.table.rows(PUSHED).tolist()]

    def follow(self) -> None:
        """Ask for the poses of the agents that bodies follow, and remove the bodies of agents that were removed."""
        if not self.cache.followers:
            return
        for body in [body for body in self.followers() if body.agent not in self.model.agents]:
            body.remove()
        followers = self.followers()
        if followers:
            self.move_bodies(followers, poses_of_agents(followers, self.space))

    def followers(self) -> list[Driven]:
        """Return the bodies that follow an agent."""
        return [body for body in self.movers.agents if body.agent is not None]

    def answer(self, asked: Container[str]) -> Iterator[Stage]:
        """Let bodies go where processes have sent them; `asked` are the columns that these write."""
        if "bodies.aim" in asked or "bodies.aim_heading" in asked:
            yield Stage(Phase.PROCESS, self.let_go, "bodies are let go where they were sent", self.letting_go())

    def let_go(self) -> None:
        """Put carried bodies where processes have sent them."""
        if self.cache.followers and len(self._find_astray()):  # of agents compiled functions know nothing
            self._refuse_ways()
        self.letting_go().run(self.model.completed + 1, len(self.swarm))

    def letting_go(self) -> Kernel:
        """Return what ends what processes ask of bodies: it refuses what cannot be, and lets go of carried ones."""
        carrying = self.carrying()
        return Kernel(let_go, carrying.block.numbers, carrying, self._refuse_ways)

    def _refuse_ways(self, code: int = ASTRAY) -> None:
        """Raise an error for the first body that cannot go where it was sent; all such are to stay where they are."""
        table, rows = self.table, self._find_astray()
        error = self._error_of_way(int(rows[0]))
        table.aim[rows], table.aim_heading[rows] = table.position[rows], table.heading[rows]
        raise error

    def _find_astray(self) -> np.ndarray:
        """Return the rows of bodies that were sent where no body can be, or that cannot be sent."""
        table, (low, high) = self.table, self.space.dimensions.T
        on_map = ((table.aim >= low) & (table.aim <= high)).all(axis=1) & np.isfinite(table.aim_heading)
        can_go = on_map & np.isin(table.mode, (DRIVEN, CARRIED))
        can_go[[body.row for body in self.followers() if is_led_elsewhere(body)]] = False
        return np.flatnonzero(table.are_to_move(np.arange(len(table))) & ~can_go)

    def _error_of_way(self, row: int) -> BehaviourError:
        """Return what is wrong with where a process has sent a body."""
        table, body = self.table, self.table.agents[row]
        aim = shortened([*table.aim[row].tolist(), float(table.aim_heading[row])])
        why, expected = "", f"x and y within {self.space.dimensions.tolist()} and a finite heading"
        if table.mode[row] in AT_REST:
            why = f", which {AT_REST[table.mode[row]]},"
            expected = "a driven body: choose those by bodies_kind[b], or add this one with mode='driven'"
        elif body.agent is not None and is_led_elsewhere(body):
            why, expected = ", which follows an agent,", "a driven body without one: move the agent instead"
        return BehaviourError(
            f"a process sent body {body.unique_id}{why} to {aim} in step {self.model.steps}; expected {expected}"
        )

    def begin_step(self) -> None:
        """Forget which bodies are new, before anything of a step: from now on all travel."""
        self.table.fresh[:] = False

    def begin_move(self) -> None:
        """Forget what bodies did in the last step, and store where they are now; in a world without robots, move."""
        if self.moves:
            self.beginning().run(self.model.completed + 1, len(self.swarm))

    def beginning(self) -> Kernel:
        """Return what begins the ways of bodies, made anew when these have changed."""
        scene, prepared = self.scene(), self.cache.beginning
        if prepared.state is not scene:
            table, moving = self.table, scene.moving
            start = (table.position, table.heading) if moving is None else (moving.start, moving.start_heading)
            arrays = BeginArrays(
                pushers=table.pushers,
                moved=table.moved,
                fresh=table.fresh,
                position=table.position,
                heading=table.heading,
                start=start[0],
                start_heading=start[1],
                driven=moving is not None,
                gone=np.zeros(1, np.bool_),
            )
            block = Block(arrays)
            attend = partial(self._go_freely, arrays.gone)
            prepared.state, prepared.kernel = scene, Kernel(begin_ways, block.numbers, block, attend)
        return cast(Kernel, prepared.kernel)

    def _go_freely(self, gone: np.ndarray, code: int) -> None:
        """Move driven bodies in a world without robots."""
        scene = self.scene()
        begin_way(scene)
        cast(Moving, scene.moving).go_freely()
        gone[:] = True

    def end_move(self) -> None:
        """Forget all requests, which are done or were blocked, and put carried bodies where their robots are."""
        if self.moves:
            self.ending().run(self.model.completed + 1, len(self.swarm))

    def ending(self) -> Kernel:
        """Return what ends the ways of bodies, made anew when bodies or robots have changed.

        Where loads have moved far, it has the plan made anew, and with it the scene.
        """
        scene, prepared = self.scene(), self.cache.ending
        state = self.swarm.version, scene
        if prepared.state != state:
            table, robots = self.table, self.swarm.columns
            block = Block(
                EndArrays(
                    position=table.position,
                    heading=table.heading,
                    aim=table.aim,
                    aim_heading=table.aim_heading,
                    mode=table.mode,
                    carrier=table.carrier,
                    robot_position=robots["position"],
                    robot_heading=robots["heading"],
                    loads=scene.loads,
                    reference=scene.reference,
                    load_reach=np.empty(0) if scene.room is None else scene.room.forms.reach,
                    slack=float(scene.slack),
                    noted=np.zeros(1, np.bool_),
                )
            )
            prepared.state, prepared.kernel = state, Kernel(end_ways, block.numbers, block, self._replan)
        return cast(Kernel, prepared.kernel)

    def _replan(self, code: int) -> None:
        """Let the scene be made anew, with the plan, before the next step: until then its tables reach far enough."""
        self.model.parts.replan()
        self.model.driving.flag[:] = True  # so that no further step is driven by this plan

    def carry_along(self) -> None:
        """Put carried bodies where their robots are."""
        table = self.table
        rows, robots = table.rows(CARRIED), self.swarm.columns
        table.position[rows] = table.aim[rows] = robots["position"][table.carrier[rows]]
        table.heading[rows] = table.aim_heading[rows] = robots["heading"][table.carrier[rows]]

    @property
    def moves(self) -> bool:
        """Whether there are bodies that may move."""
        if self.cache.moves is None:
            self.cache.moves = bool((self.table.mode != FIXED).any())
        return self.cache.moves

    def mark(self) -> dict[str, Any]:
        """Return poses of loads and of driven bodies, which may be set by hand."""
        table, loads = self.table, self.table.rows(PUSHED)
        of_loads = (table.position[loads], table.heading[loads], table.resistance[loads]) if len(loads) else ()
        return {
            "pose or resistance of loads": tuple(map(np.ndarray.tobytes, of_loads)),
            POSES: tuple(map(np.ndarray.tobytes, self.movers.poses)),
            HEAT: table.temperature[table.kind != FIRE].tobytes(),
            "kinds": len(self.kinds),
        }

    def store(self) -> dict[str, Any]:
        """Return nothing: bodies are agents, which are stored with all others."""
        return {}

    def parameters(self) -> dict[str, Any]:
        """Return the bounds of the map, what bodies are, and the state of those that move or burn."""
        table, movers = self.table, self.movers
        loads, fires = table.rows(PUSHED), np.flatnonzero(table.kind == FIRE)
        facts: dict[str, Any] = {"map": self.map.bounds, "bodies": self.describe()}
        if len(loads):
            facts["loads"] = [pick_rows(column, loads) for column in (table.position, table.heading, table.resistance)]
        if len(movers):
            columns = table.position, table.heading, table.aim, table.aim_heading, table.fresh, table.blocked
            facts["driven"] = [pick_rows(column, movers.rows) for column in (*columns, table.carrier)]
        if len(fires):
            facts["fires"] = [pick_rows(column, fires) for column in (table.position, table.radius, table.temperature)]
        return facts

    def describe(self) -> list:
        """Return what bodies are, where all are at rest the same until one comes, goes or has another temperature."""
        if self.moves:
            return describe_bodies(self.listed)
        prepared, state = self.cache.described, (self.scene(), self.table.temperature.tobytes())
        if prepared.state != state:
            prepared.state, prepared.description = state, describe_bodies(self.listed)
        return prepared.description

    def fires(self) -> list[Body]:
        """Return the fires."""
        return [self.table.agents[row] for row in np.flatnonzero(self.table.kind == FIRE).tolist()]

    def heat_changed(self) -> None:
        """Let radiation sensors be read again: a body has another temperature."""
        self.cache.scene = None
        self.swarm.disturbed = True

    @property
    def displaced(self) -> list[Load | Driven]:
        """The bodies that may change their places, loads and driven bodies, in the order in which they were added."""
        return [self.table.agents[row] for row in np.flatnonzero(self.table.mode != FIXED).tolist()]

    def add_kind(self, name: str) -> int:
        """Declare a kind of bodies before there is any, and return its code in readings.

        The first body of a kind declares it as well, see `add_body`. A gripper or a sensor for a misspelt kind is
        refused when robots with it are added or take their first step; of any other unknown kind there is a warning.

        Parameters
        ----------
        name : str
            A name of your own, one word; one that is known already stays as it is.

        Raises
        ------
        InvalidValueError
            If it is not one word, or one kind too many.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> model.add_kind("wolf"), model.kinds[-1], model.add_kind("wolf")
        (4, 'wolf', 4)
        """
        if name not in self.kinds:
            self.know_kind(self.checked_kind("" if name is None else name, ""))
        return self.kinds.index(name)

    def kind_code(self, name: str) -> int:
        """Return the code of a kind in readings: what a rule compares ``me.kind[s]`` with.

        Raises
        ------
        UnknownNameError
            If the kind was not declared, and no body of it was added.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> model = SwarmModel(rng=1)
        >>> puck = model.add_body(disc((100, 100), 5), kind="puck")
        >>> model.kind_code("puck")
        4
        """
        if name not in self.kinds:
            cure = f"; declare it by model.add_kind({shortened(name)})" if isinstance(name, str) else ""
            raise UnknownNameError(unknown_name("kind", name, self.kinds, beside=len(cure)) + cure)
        return self.kinds.index(name)

    def add_body(
        self,
        shape: Shape,
        *,
        kind: str | None = None,
        mode: str = "driven",
        agent: mesa.Agent | None = None,
        resistance: float | None = None,
        temperature: float | None = None,
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
        temperature : float, optional
            Of a body that radiates heat, 0 to 1, as `RadiationSensor` reads it; see `Body.temperature`.

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
        >>> float(robot.distance[0]), model.kinds[robot.kind[0]]
        (5.0, 'predator')
        """
        body_class = handle_classes()[check_choice("mode", mode, handle_classes())]
        _check_shape("body", shape)
        name = self.checked_kind(kind, body_class.usual_kind)
        if mode != "pushed" and resistance is not None:
            raise InvalidValueError(f"resistance was given for a {mode} body; leave it out, or use mode='pushed'")
        if mode == "pushed" and resistance is None:
            raise InvalidValueError(
                "resistance was not given for a pushed body; expected how many robots' full pushes it withstands, such "
                "as resistance=0.5"
            )
        if mode != "driven" and agent is not None:
            raise InvalidValueError(f"agent was given for a {mode} body; leave it out, or use mode='driven'")
        if temperature is not None and not shape.contact:
            raise InvalidValueError("temperature was given for a mark on the ground, which does not radiate")
        heat = check_temperature(temperature)
        if mode == "fixed":
            body: Body = self.add_fixed(shape, name)
        elif mode == "pushed":
            body = self.add_pushed(shape, check_resistance(cast(float, resistance)), name)
        else:
            body = self.add_driven(shape, name, agent)
        if temperature is not None:
            body.temperature = heat
        return body

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
        table = self.table
        driven = list(bodies) if isinstance(bodies, Iterable) else [bodies]
        if not all(isinstance(body, Driven) and body.model is self.model for body in driven):
            raise InvalidValueError("bodies holds others than driven bodies of this model; expected some of add_body")
        aims = np.empty((0, 3)) if not driven else as_numbers(poses)
        if aims.shape != (len(driven), 3):
            raise InvalidValueError(f"poses has shape {aims.shape}; expected {(len(driven), 3)}: x, y, heading each")
        low, high = self.space.dimensions.T
        good = ((aims[:, :2] >= low) & (aims[:, :2] <= high)).all(axis=1) & (np.abs(aims[:, 2]) <= LARGEST_HEADING)
        if not good.all():
            wrong = aims[int(np.argmin(good))].tolist()
            raise InvalidValueError(
                f"pose {wrong} is not on map {self.map.name}; expected x and y within {self.space.dimensions.tolist()} "
                "and a finite heading"
            )
        if not driven:
            return
        rows = np.array([cast(Driven, body).alive() for body in driven])
        if (table.mode[rows] == CARRIED).any():
            raise InvalidValueError("bodies holds one that a robot carries; release it first")
        new = table.fresh[rows]
        if new.any():
            self._place_new(rows[new], aims[new])
        table.aim[rows] = aims[:, :2]
        table.aim_heading[rows] = wrap_headings(aims[:, 2])

    def attach(self, robot: Robot, body: Body) -> None:
        """Let a robot carry a driven body, wherever that is: it moves with the robot, and nothing sees or meets it.

        Raises
        ------
        InvalidValueError
            If the robot carries something already, or the body is not a driven one that is free and follows no agent.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel, disc
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
        >>> puck = model.add_body(disc((110, 100), 2), kind="puck")
        >>> model.attach(robot, puck)
        >>> puck.position, model.release(robot), puck.position.round(3)
        (array([100., 100.]), True, array([107., 100.]))
        """
        if not isinstance(robot, Robot) or robot.model is not self.model:
            raise InvalidValueError(f"robot is {shortened(robot)}; expected one of model.robots")
        robot.alive()
        if not isinstance(body, Driven) or body.model is not self.model or body.agent is not None:
            raise InvalidValueError(f"body is {shortened(body)}; expected a driven body of this model without an agent")
        row = body.alive()
        if body.carrier is not None or self.carried_by(robot) is not None:
            raise InvalidValueError(f"body {body.unique_id} or robot {robot.unique_id} is taken; release it first")
        self.table.carrier[row], self.table.mode[row] = robot.row, CARRIED
        self.carry_along()
        if self.cache.scene is not None and self.cache.scene.moving is not None:
            self.cache.scene.moving.place()

    def release(self, robot: Robot) -> bool:
        """Put down in front of a robot what it carries, and return whether there was room and something to put down.

        The place is the nearest to straight ahead, within 60 degrees, where the body is on the map and touches nothing,
        nor is in the way of a body that was sent elsewhere.
        """
        body = self.carried_by(robot)
        if body is None:
            return False
        return self.carrying().release(body.row)

    def carried_by(self, robot: Robot) -> Driven | None:
        """Return the body that a robot carries, or None."""
        rows = np.flatnonzero((self.table.mode == CARRIED) & (self.table.carrier == robot.row))
        return self.table.agents[rows[0]] if len(rows) else None

    def carrying(self) -> Carrying:
        """Return what grips, carries and puts down bodies, made anew when bodies or robots have changed."""
        columns, scene = self.swarm.columns, self.scene()
        if self.cache.carrying is None or not self.cache.carrying.is_of(columns, scene):
            self.cache.carrying = Carrying(columns, scene)
        return self.cache.carrying

    def robots_left(self, rows: Sequence[int]) -> None:
        """Free the bodies that robots carried which were removed from these rows: they stay where they were."""
        table, gone = self.table, np.unique(np.array(rows, np.int64))
        carried = table.rows(CARRIED)
        freed = carried[np.isin(table.carrier[carried], gone)]
        table.mode[freed], table.carrier[freed] = DRIVEN, -1
        table.aim[freed], table.aim_heading[freed] = table.position[freed], table.heading[freed]
        table.carrier[carried] -= np.searchsorted(gone, table.carrier[carried])
        if len(freed):
            self.cache.scene, self.swarm.disturbed = None, True

    def add_obstacle(self, shape: Shape) -> Obstacle:
        """Add an obstacle or a ground mark and return its agent.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> SwarmModel(rng=1).add_obstacle(disc((100, 100), 30)).contact
        True
        """
        _check_shape("obstacle", shape)
        return self.add_fixed(shape, KINDS[OBSTACLE])

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
        return self.add_pushed(shape, check_resistance(resistance), KINDS[LOAD])

    def add_obstacles(self, shapes: Sequence[Shape]) -> None:
        """Add the obstacles and marks of a map, to a world without loads and robots: all at once, which is quicker."""
        for shape in shapes:
            _check_shape("obstacle", shape)
        if shapes:
            Obstacle.of_shapes(self.space, self.model, self.table, shapes, KINDS[OBSTACLE], mode=FIXED)
        self.scene_changed()

    def add_fixed(self, shape: Shape, kind: str) -> Obstacle:
        """Add an obstacle or a mark of a kind."""
        self._check_fine_enough(shape)
        self.check_clear_of_loads("obstacle", shape)
        return self.take(Obstacle, shape, kind, mode=FIXED)

    def add_pushed(self, shape: Shape, resistance: float, kind: str) -> Load:
        """Add a load of a kind."""
        if not shape.contact:
            raise InvalidValueError("load is a mark on the ground, which cannot be pushed; leave out contact=False")
        form = Form.of(shape)
        self.check_room_for_load(form, (*shape.position.tolist(), 0.0))
        return self.take(Load, shape, kind, form, mode=PUSHED, resistance=resistance)

    def add_driven(self, shape: Shape, kind: str, agent: mesa.Agent | None) -> Driven:
        """Add a driven body of a kind, which may follow an agent."""
        if not shape.contact:
            raise InvalidValueError("body is a mark on the ground, which cannot be driven; leave out contact=False")
        if agent is not None and not isinstance(agent, mesa.Agent):
            raise InvalidValueError(f"agent is {shortened(agent)}; expected a Mesa agent or None")
        if agent is not None and (agent not in self.model.agents or isinstance(agent, Robot | Body)):
            raise InvalidValueError(
                f"agent is {shortened(agent)}; expected an agent of this model that is neither robot nor body"
            )
        self._check_fine_enough(shape)
        self.checked_point(shape.position.tolist())
        self.check_clear_of_loads("body", shape)
        body = self.take(Driven, shape, kind, Form.of(shape), mode=DRIVEN, aim=shape.position, fresh=True, agent=agent)
        if agent is not None:
            try:
                self.move_bodies([body], poses_of_agents([body], self.space))
            except InvalidValueError:
                body.remove()
                raise
        return body

    def take(
        self, body_class: type[Handle], shape: Shape, kind: str, form: Form | None = None, **values: Any
    ) -> Handle:
        """Add a body whose values are checked, and rows to the columns that parts have of bodies."""
        self.know_kind(kind)
        body = body_class(self.space, self.model, self.table, shape, kind, form, **values)
        self.model.parts.add_rows("bodies", 1)
        self.scene_changed()
        return body

    def leave(self, body: Body) -> None:
        """Drop the rows that parts have of a body which is about to leave the model."""
        self.model.parts.drop_rows("bodies", [body.row])

    def know_kind(self, name: str) -> None:
        """Let a kind have a code, if it has none."""
        if name not in self.kinds:
            self.table.kinds = (*self.kinds, name)

    def _place_new(self, rows: np.ndarray, poses: np.ndarray) -> None:
        """Place bodies at once that were added after the last step."""
        for row, pose in zip(rows.tolist(), poses.tolist(), strict=True):
            self.check_clear_of_loads("body", cast(Form, self.table.forms[row]).shape_at(tuple(pose)))
        self.table.position[rows], self.table.heading[rows] = poses[:, :2], wrap_headings(poses[:, 2])
        self.scene_changed()

    def checked_kind(self, kind: str | None, default: str) -> str:
        """Return the name of a kind that bodies may have."""
        if kind is None:
            return default
        if not isinstance(kind, str) or not kind.isidentifier() or kind in (KINDS[ROBOT], KINDS[FIRE]):
            raise InvalidValueError(
                f"kind is {shortened(kind)}; expected a name such as 'door'; robots and fires: see add_robots, add_fire"
            )
        if kind not in self.kinds and len(self.kinds) > MOST_KINDS:
            raise InvalidValueError(f"kind is {shortened(kind)}, one too many; expected at most {MOST_KINDS + 1} kinds")
        return kind

    def changed(self) -> None:
        """Update the table after bodies were removed, and what is made of it."""
        removed_bodies = [body for body in self.table.agents if body.space is None]
        numbers = self.table.numbers[[body.row for body in removed_bodies]].tolist() if removed_bodies else []
        for number, body in reversed([*zip(numbers, removed_bodies, strict=True)]):
            if number < len(self.listed):
                for kind in (OBSTACLE, LOAD, *range(len(KINDS), len(self.kinds))):
                    self.swarm.forget_contacts(kind, np.array([number]))
            self.table.drop(body)
        self.scene_changed()

    def scene_changed(self) -> None:
        """Let the tables of bodies be made anew, and fields find their walls."""
        self.cache = SceneCache()
        self.swarm.disturbed = True
        self.model.parts["fields"].walls_changed()

    def let_roam(self, spare: int = 0) -> None:
        """Make the tables of bodies once for all ways that loads can go: for pages, which do not make them anew.

        Where no body moves, they have room for `spare` discs more.
        """
        self._roams, self._spare, self.cache.scene = True, spare, None
        self.model.parts.replan()

    def scene(self) -> Surroundings:
        """Return the world without its robots, as engines need it; made anew where bodies or designs have changed."""
        designs, scene = self.swarm.table, self.cache.scene
        if scene is None or self.cache.table is not designs or scene.is_worn:
            fires, order = self.table.kind == FIRE, np.arange(len(self.table))
            self.cache.scene = Surroundings.of(
                self.map.bounds,
                self.table,
                np.concatenate([order[~fires], order[fires]]),
                **self.reaches(),
                apart=int(fires.sum()),
                # Where tables are only worn, all bodies are what they were.
                room=None if scene is None or self.cache.table is not designs else scene.room,
                roams=self._roams,
                spare=0 if self.moves else self._spare,
            )
            self.cache.table = designs
            self.cache.followers = bool(self.followers())
        return cast(Surroundings, self.cache.scene)

    def reaches(self) -> dict[str, float]:
        """Return how far from its centre any robot sees and can touch what the tables of bodies list, by name."""
        designs = self.swarm.table
        touch = max((design.radius for design in designs.designs), default=1.0)
        return {"sight": float(designs.reach.max(initial=0.0)), "touch": float(touch)}

    def _check_fine_enough(self, shape: Shape) -> None:
        if len(self.swarm):
            self.check_resolved(float(self.swarm.radius.min()), [shape])

    def check_resolved(self, radius: float, shapes: Iterable[Shape]) -> None:
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

    def check_room_for_load(self, form: Form, pose: Pose, load: Load | None = None) -> None:
        """Refuse a load that is to be where it is not within the map or overlaps anything but robots and itself."""
        if not form.is_within(pose, self.map.bounds):
            raise InvalidValueError(f"load is not within map {self.map.name}, {list(self.map.bounds)}; move it inside")
        solid = [body for body in self.listed if body.contact and body is not load and body.mode != "carried"]
        others = [("an obstacle or load", body.shape) for body in solid]
        others += [(f"a {body.kind}", body.shape) for body in self.fires()]
        for name, other in others:
            if form.overlaps(pose, other):
                raise InvalidValueError(f"load overlaps {name} at {other.position.tolist()}; expected free space")

    def check_clear_of_loads(self, name: str, shape: Shape) -> None:
        """Refuse an obstacle or a fire that overlaps a load."""
        for load in self.loads:
            if shape.contact and load.form.overlaps(load.pose, shape):
                raise InvalidValueError(f"{name} overlaps a load at {load.position.tolist()}; expected free space")

    def checked_point(self, point: Sequence[float]) -> np.ndarray:
        """Return a point of the map as an array; another one is refused."""
        array = as_numbers(point)
        if array.shape != (2,) or not self.space.in_bounds(array):
            raise InvalidValueError(
                f"position {shortened(point)} is not on map {self.map.name}; "
                f"expected x and y within {self.space.dimensions.tolist()}"
            )
        return array


def wrap_headings(headings: np.ndarray) -> np.ndarray:
    """Return headings in [-pi, pi), those that are there already unchanged."""
    outside = np.flatnonzero(~((headings >= -np.pi) & (headings < np.pi)))
    turned = headings.copy()
    turned[outside] = [wrap_angle(heading) for heading in headings[outside].tolist()]
    return turned


def _check_shape(name: str, shape: Shape) -> None:
    if not isinstance(shape, Shape):
        raise InvalidValueError(f"{name} is {shortened(shape)}; expected disc(...), rectangle(...) or polygon(...)")


def pick_rows(column: np.ndarray, rows: np.ndarray) -> np.ndarray | list[np.ndarray]:
    """Return rows of a column, ascending: a view of it where they follow each other, otherwise a list of such views.

    Examples
    --------
    >>> column = np.arange(5.0)
    >>> pick_rows(column, np.array([1, 2])), pick_rows(column, np.array([0, 2]))
    (array([1., 2.]), [array([0.]), array([2.])])
    """
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []
    views = [column[run[0] : run[-1] + 1] for run in runs]
    return views[0] if len(views) == 1 else views
