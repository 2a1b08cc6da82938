"""SwarmModel: a Mesa model of robots in a world, and its step, written once."""

import os
from collections.abc import Iterable, Sequence
from hashlib import blake2b

import mesa
import numpy as np
from mesa.agent import AgentSet
from tqdm.auto import tqdm

from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import (
    BehaviourError,
    InvalidValueError,
    check_choice,
    check_count,
    check_number,
)
from mesa_swarm.fire.burning import burn
from mesa_swarm.fire.constants import FireConstants, design_constants
from mesa_swarm.fire.fires import Fire, Fires
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.physics.contacts import Contacts
from mesa_swarm.physics.engine import CompiledEngine, Engine
from mesa_swarm.physics.scene import Scene
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.drive import limit_command
from mesa_swarm.robots.robot import SIDES, Robot
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.streams import Streams
from mesa_swarm.world.arena import Arena
from mesa_swarm.world.map import RADIUS_OF_UNIT_AREA, Map
from mesa_swarm.world.obstacle import Obstacle
from mesa_swarm.world.placement import free_space, place_apart
from mesa_swarm.world.shapes import Shape

ENGINES: dict[str, type[Engine]] = {"compiled": CompiledEngine, "shapely": ShapelyEngine}
# Indices that depend on the order in which things were created say nothing of the state.
NOT_HASHED = frozenset({"number", "design", "contact_index"})


class SwarmModel(mesa.Model):
    """A world of robots, obstacles and fires, advanced step by step.

    Parameters
    ----------
    map : str, path or Map
        A built-in map (original, sparse, openspace, openspace_fire), a file (.toml, .svg, .map), or a Map.
    rng : int, SeedSequence, Generator or None
        Seed of everything random. The same seed gives the same bits.
    engine : str
        "compiled", or "shapely": slow and readable, the oracle of the first.
    turn_angle_degrees : float
        A robot whose travel is farther than this from the normal of a flat face that it meets is turned
        parallel to it; 0 to 90.
    fire_constants : FireConstants, optional
        From `design_constants`, whose defaults are used otherwise.
    extinguish_range : float
        A robot whose body is this near to a fire's edge can fight it and takes its heat, at least 0.
    history_every : int
        Steps between two rows of `fires.history`; 0 keeps none.
    model_reporters, agent_reporters : dict, optional
        More of what Mesa's DataCollector collects after every step, besides `collisions` and
        `total_collisions`.

    Attributes
    ----------
    swarm : Swarm
        The robots' columns.
    fires : Fires
        The fires' columns.
    space : Arena
    datacollector : mesa.DataCollector

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel
    >>> from mesa_swarm.control import Avoid, Explore, Subsumption
    >>> model = SwarmModel(map="original", rng=1)
    >>> robots = model.add_robots(AGENT9, 5)
    >>> model.control = Subsumption(Avoid(distance=15), Explore())
    >>> model.run(10).steps
    10
    """

    def __init__(
        self,
        *,
        map: str | os.PathLike | Map = "openspace",
        rng=None,
        engine: str = "compiled",
        turn_angle_degrees: float = 60.0,
        fire_constants: FireConstants | None = None,
        extinguish_range: float = 10.0,
        history_every: int = 1,
        model_reporters: dict | None = None,
        agent_reporters: dict | None = None,
    ) -> None:
        self._turn_angle = np.radians(check_number("turn_angle_degrees", turn_angle_degrees, minimum=0, maximum=90))
        self.extinguish_range = check_number("extinguish_range", extinguish_range, minimum=0, maximum=1e9)
        self._engine: Engine = ENGINES[check_choice("engine", engine, ENGINES)]()
        self.map = Map.load(map)
        super().__init__(rng=_checked_seed(rng))
        self.streams = Streams(_seed_sequence(rng, self.rng))
        x_min, y_min, x_max, y_max = self.map.bounds
        self.space = Arena([[x_min, x_max], [y_min, y_max]], random=self.random, n_agents=0)
        self.swarm = Swarm()
        self.space.attach(self.swarm)
        self.fires = Fires(check_count("history_every", history_every))
        self.space.attach(self.fires)
        self.fire_constants = fire_constants or design_constants()
        self.collisions = 0
        self.total_collisions = 0
        self._obstacles: list[Obstacle] = []
        self._scene: Scene | None = None
        self._control = None
        self._senses: Senses | None = None
        self._versions = {"senses": -1, "table": None}
        self._completed = 0
        self._sensed: tuple | None = None
        self._noise: tuple | None = None
        self._burns = False
        reporters = {"collisions": "collisions", "total_collisions": "total_collisions"}
        self.datacollector = mesa.DataCollector(
            model_reporters={**reporters, **(model_reporters or {})}, agent_reporters=agent_reporters
        )
        for shape in self.map.obstacles:
            self.add_obstacle(shape)
        for spot in self.map.fires:
            self.add_fire(spot.position, radius=spot.radius, temperature=spot.temperature)

    # ---- what is in the world

    @property
    def robots(self) -> AgentSet:
        """The robots as Mesa agents, in the order of the swarm's rows."""
        return AgentSet(self.swarm.agents, random=self.random)

    @property
    def obstacles(self) -> AgentSet:
        """The obstacles and ground marks as Mesa agents, in the order in which they were added."""
        return AgentSet(self._obstacles, random=self.random)

    @property
    def control(self):
        """What drives the robots: an arbiter such as `Subsumption`, or None."""
        return self._control

    @control.setter
    def control(self, control) -> None:
        if control is not None and not callable(getattr(control, "bound", None)):
            raise InvalidValueError(
                f"control is {control!r:.60}; expected an arbiter such as Subsumption(Avoid(), Explore())"
            )
        self.swarm.forget()
        self._control = None if control is None else control.bound(self.swarm, self.streams)

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
        n : int
            How many, at free random places with random headings; they never overlap anything.
        poses : iterable of (x, y, heading), instead of n
            Within the map. Robots put where there is no room are moved to room nearby in the next step.
        tendency : "left", "right" or a sequence of these, optional
            The side to which each turns from what is straight ahead; by default drawn by chance.

        Raises
        ------
        PlacementError
            If they do not fit; the message says how many would.
        InvalidValueError
            If neither or both of n and poses are given, or a pose is not on the map.

        Examples
        --------
        >>> from mesa_swarm import AGENT3, SwarmModel
        >>> SwarmModel(rng=1).add_robots(AGENT3, poses=[(100, 200, 0.0)])[0].position
        array([100., 200.])
        """
        if not isinstance(design, RobotDesign):
            raise InvalidValueError(f"design is {design!r:.60}; expected a RobotDesign such as AGENT9")
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

    def remove_robots(self, robots: Iterable[Robot]) -> None:
        """Take robots out of the model, between two steps."""
        for robot in list(robots):
            robot.remove()

    def add_obstacle(self, shape: Shape) -> Obstacle:
        """Add an obstacle or a ground mark and return its agent.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> SwarmModel(rng=1).add_obstacle(disc((100, 100), 30)).contact
        True
        """
        if not isinstance(shape, Shape):
            raise InvalidValueError(f"obstacle is {shape!r:.60}; expected disc(...), rectangle(...) or polygon(...)")
        obstacle = Obstacle(self.space, self, shape)
        self._obstacles.append(obstacle)
        self.obstacles_changed()
        return obstacle

    def add_fire(
        self,
        position: Sequence[float],
        *,
        radius: float | None = None,
        area: float | None = None,
        temperature: float = 1.0,
    ) -> Fire:
        """Add a fire and return its agent.

        Parameters
        ----------
        position : (x, y)
            Within the map.
        radius, area : float
            Either or both; area = (radius / 10) ** 2 unless both are given.
        temperature : float
            Above 0, at most 1.
        """
        point = self._checked_point(position)
        if radius is None and area is None:
            raise InvalidValueError("add_fire got neither radius nor area; give one of them")
        if radius is None:
            radius = RADIUS_OF_UNIT_AREA * np.sqrt(check_number("area", area, above=0, maximum=1e12))
        radius = check_number("radius", radius, above=0, maximum=1e6)
        area = (radius / RADIUS_OF_UNIT_AREA) ** 2 if area is None else area
        check_number("area", area, above=0, maximum=1e12)
        check_number("temperature", temperature, above=0, maximum=1)
        row = self.fires.add(point, radius, area, temperature)
        fire = Fire(self.space, self, self.fires, row)
        self.fires.agents.append(fire)
        self._burns = True
        self.obstacles_changed()
        return fire

    def obstacles_changed(self) -> None:
        """Take note that obstacles or fires were added or removed."""
        self._obstacles = [obstacle for obstacle in self._obstacles if obstacle.space is not None]
        self._scene = None
        self.swarm.disturbed = True

    def fires_changed(self) -> None:
        """Take note that a fire was removed: nobody fights it any more."""
        self.swarm.columns["fire"].fill(-1)
        self.obstacles_changed()

    # ---- the step

    def step(self) -> None:
        """Advance the world by one step.

        ==========  ================================================  ===========================================
        phase       reads                                             writes
        ==========  ================================================  ===========================================
        sense       position, heading, obstacles, fires               distance, kind, radiation, line
        decide      what robots know (`control.Senses`)               command, layer
        move        command                                           position, heading
        resolve     position, obstacles, fires                        position, heading, slip, collided, contacts
        burn        position                                          fires' temperature, robots' temperature, fire
        collect     everything                                        datacollector, history
        ==========  ================================================  ===========================================

        Every robot acts on what was published after the previous step; nothing depends on their order.
        """
        self.sense()
        self._decide()
        self._move()
        self._burn()
        self._completed += 1
        self._collect()

    def sense(self) -> None:
        """Read all sensors in the world as it is now; reading twice gives the same."""
        scene = self._current_scene()
        state = (self._completed, self.swarm.version, scene)
        if self._sensed == state and not self.swarm.disturbed:
            return
        self._engine.sense(self.swarm, scene, self._completed, self._noise_draws())
        self._sensed = state

    def run(self, steps: int, progress: bool = False) -> "SwarmModel":
        """Take so many steps, fewer if the model stops running, and return the model.

        Parameters
        ----------
        steps : int
        progress : bool
            Whether to show a bar with the time left.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).run(3).steps
        3
        """
        for _ in tqdm(range(check_count("steps", steps)), disable=not progress, unit="step"):
            if not self.running:
                break
            self.step()
        return self

    def _decide(self) -> None:
        columns = self.swarm.columns
        command, layer = columns["command"], columns["layer"]
        if self._control is None:
            return
        if self._versions["senses"] != self.swarm.version:
            self._senses = Senses.of(self.swarm)
            self._versions["senses"] = self.swarm.version
        self._control.decide(self._senses, command, layer)
        wrong = limit_command(command, columns["max_speed"])
        if wrong >= 0:
            name = self._control.layers[layer[wrong]].name if layer[wrong] >= 0 else "no layer"
            raise BehaviourError(
                f"{name} commanded NaN to robot {self.swarm.agents[wrong].unique_id} in step {self.steps}; "
                "expected two finite wheel speeds"
            )

    def _move(self) -> None:
        scene, table = self._current_scene(), self.swarm.table
        if not len(self.swarm):
            return
        if self.swarm.disturbed:
            self._engine.settle(self.swarm, scene)
            self.swarm.disturbed = False
        draws = self.streams["slip"].random((len(self.swarm), 2)) if table.slips else None
        self._engine.move(self.swarm, scene, self._turn_angle, draws)

    def _burn(self) -> None:
        if not self._burns:
            return
        columns, fires, c = self.swarm.columns, self.fires.columns, self.fire_constants
        scene = self._current_scene()
        went_out = burn(
            columns["position"],
            columns["radius"],
            scene.fires,
            fires["area"],
            (c.k1, c.k2, c.k3, c.k4, c.leave, c.join),
            self.extinguish_range,
            self.steps,
            fires["temperature"],
            fires["out"],
            fires["out_step"],
            fires["robots"],
            columns["temperature"],
            columns["heat"],
            columns["hot"],
            columns["fire"],
        )
        if went_out:
            scene.statics.mark_burning(~fires["out"])

    def _collect(self) -> None:
        self.collisions = int(np.count_nonzero(self.swarm.columns["collided"]))
        self.total_collisions += self.collisions
        history = self.fires.history
        if self._burns and history.every and self._completed % history.every == 0:
            fires = self.fires
            history.append(self.steps, fires.temperature, fires.robots, fires.out)
        self.datacollector.collect(self)

    # ---- what one reads after the step

    @property
    def contacts(self) -> "Contacts":
        """The deepest contact of every robot that collided in the last step."""
        return Contacts.of(self.swarm, self._obstacles, self.fires.agents)

    def state_hash(self) -> str:
        """Return a fingerprint of the published state: equal for equal runs, on every machine and Python.

        All sensors are read first, so that having looked at the readings or not makes no difference.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).state_hash() == SwarmModel(rng=1).state_hash()
        True
        """
        self.sense()
        digest = blake2b(digest_size=16)
        digest.update(f"{self._completed}".encode())
        for prefix, columns in (("robots", self.swarm.columns), ("fires", self.fires.columns)):
            for name, column in sorted(columns.items()):
                if name not in NOT_HASHED:
                    digest.update(f"{prefix}.{name} {column.shape}".encode())
                    digest.update(np.ascontiguousarray(column + 0 if column.dtype.kind == "f" else column))
        return digest.hexdigest()

    # ---- small parts

    def _current_scene(self) -> Scene:
        table = self.swarm.table
        if self._scene is None or self._versions["table"] is not table:
            shapes = [obstacle.shape for obstacle in self._obstacles]
            discs, temperature = self.fires.discs, self.fires.columns["temperature"]
            sight = float(table.reach.max(initial=0.0))
            touch = max((design.radius for design in table.designs), default=1.0)
            self._scene = Scene.of(self.map.bounds, shapes, discs, temperature, sight=sight, touch=touch)
            self._versions["table"] = table
        return self._scene

    def _noise_draws(self) -> np.ndarray | None:
        """Return this step's draws for the sensors' errors, the same ones however often it is sensed."""
        if not self.swarm.table.noisy:
            return None
        shape = self.swarm.distance.shape
        if self._noise is None or self._noise[:2] != (self._completed, shape):
            self._noise = (self._completed, shape, self.streams["noise"].random(shape))
        return self._noise[2]

    def _free_poses(self, design: RobotDesign, n: int) -> tuple[np.ndarray, np.ndarray]:
        shapes = [obstacle.shape for obstacle in self._obstacles]
        space = free_space(self.map.bounds, shapes, self.fires.discs, design.radius)
        old, radii, where = self.swarm.position, self.swarm.radius, f"map {self.map.name}"
        position = place_apart(n, design.radius, space, old, radii, self.streams["placement"], where)
        return position, self.streams["heading"].uniform(-np.pi, np.pi, n)

    def _checked_poses(self, poses: Iterable[Sequence[float]]) -> tuple[np.ndarray, np.ndarray]:
        try:
            table = np.array(list(poses), dtype=float).reshape(-1, 3)
        except (TypeError, ValueError):
            raise InvalidValueError("poses are not rows of three numbers; expected (x, y, heading) each") from None
        for x, y, heading in table:
            self._checked_point((x, y))
            check_number("heading", heading, minimum=-1e9, maximum=1e9)
        return table[:, :2].copy(), np.array([wrapped(heading) for heading in table[:, 2]], dtype=float)

    def _checked_point(self, point: Sequence[float]) -> np.ndarray:
        array = np.asarray(point, dtype=float)
        if array.shape != (2,) or not self.space.in_bounds(array):
            raise InvalidValueError(
                f"position {tuple(point)!r:.60} is not on map {self.map.name}; "
                f"expected x and y within {self.space.dimensions.tolist()}"
            )
        return array

    def _sides(self, n: int, tendency: str | Sequence[str] | None) -> np.ndarray:
        if tendency is None:
            return np.where(self.streams["tendency"].random(n) < 0.5, 1.0, -1.0)
        names = [tendency] * n if isinstance(tendency, str) else list(tendency)
        if len(names) != n:
            raise InvalidValueError(f"tendency names {len(names)} sides for {n} robots; expected one each")
        return np.array([SIDES[check_choice("tendency", name, SIDES)] for name in names], dtype=float)


def _checked_seed(rng):
    """Refuse what cannot seed a model, in words, before Mesa tries."""
    try:
        np.random.default_rng(rng)
    except (TypeError, ValueError):
        raise InvalidValueError(
            f"rng is {rng!r:.60}; expected a whole number of at least 0, a SeedSequence, a Generator or None"
        ) from None
    return rng


def _seed_sequence(rng, generator: np.random.Generator) -> np.random.SeedSequence:
    """Return what the streams grow from: the seed itself, or a draw where a generator was handed over."""
    if isinstance(rng, (np.random.Generator, np.random.BitGenerator)):
        return np.random.SeedSequence(int(generator.integers(2**63)))
    return generator.bit_generator.seed_seq
