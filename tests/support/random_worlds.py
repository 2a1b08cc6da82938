"""Random worlds that two engines, or a world and its mirror image, are compared on."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mesa_swarm import (
    AGENT9,
    AGENT_FIRE,
    LineSensor,
    Map,
    ProximitySensor,
    RadiationSensor,
    RobotDesign,
    SwarmModel,
    disc,
    polygon,
)
from mesa_swarm.base.errors import InvalidValueError

BOUNDS = (0.0, 0.0, 200.0, 150.0)
# No sensor of these designs sticks out farther than this.
CLEARANCE = 8.0

ODD = RobotDesign(
    name="odd",
    radius=3.0,
    max_speed=5.0,
    sensors=(
        ProximitySensor(bearing_degrees=10, rays=5, field_of_view_degrees=70),
        ProximitySensor(bearing_degrees=-120, rays=1, range=90),
        ProximitySensor(bearing_degrees=77, rays=2, field_of_view_degrees=310),
        ProximitySensor(bearing_degrees=33, range=60, field_of_view_degrees=0),
        ProximitySensor(bearing_degrees=-5, range=35, field_of_view_degrees=180, mount=(7.0, 2.0)),
        ProximitySensor(bearing_degrees=170, range=25, field_of_view_degrees=251, mount=(-1.0, -6.5)),
        RadiationSensor(bearing_degrees=100, field_of_view_degrees=130, mount=(0.0, 6.0)),
        RadiationSensor(bearing_degrees=-20, field_of_view_degrees=0),
        LineSensor(mount=(2.5, 1.0)),
        LineSensor(mount=(-4.0, 0.5)),
    ),
)
ROUND = RobotDesign(
    name="round",
    radius=7.0,
    sensors=(
        ProximitySensor(range=40, field_of_view_degrees=360, mount=(0.0, 0.0)),
        ProximitySensor(range=0, field_of_view_degrees=90, mount=(2.0, 7.5)),
        ProximitySensor(bearing_degrees=180, range=2, field_of_view_degrees=1e-3),
        RadiationSensor(range=60, field_of_view_degrees=360),
    ),
)
DESIGNS = (AGENT9, AGENT_FIRE, ODD, ROUND)


@dataclass(frozen=True, kw_only=True)
class World:
    """A world as numbers, so that it can be moved about."""

    bounds: tuple[float, float, float, float]
    discs: list[tuple[np.ndarray, float, bool]]
    polygons: list[tuple[np.ndarray, np.ndarray | None, bool]]
    fires: list[tuple[np.ndarray, float, float]]
    designs: tuple[RobotDesign, ...]
    poses: np.ndarray
    design: np.ndarray
    commands: np.ndarray
    tendency: np.ndarray
    # Centre and radius of a disc, or outline and 0, and the resistance.
    loads: tuple[tuple[np.ndarray, float, float], ...] = ()

    def model(self, engine: str = "compiled", **options: object) -> SwarmModel:
        """Return a model of this world, its robots in order, each at its pose and driven by its command."""
        shapes = [disc(centre, radius, contact=solid) for centre, radius, solid in self.discs]
        for outline, hole, solid in self.polygons:
            shapes.append(polygon(outline, [] if hole is None else [hole], contact=solid))
        model = SwarmModel(
            map=Map(name="random", bounds=self.bounds, obstacles=shapes), engine=engine, rng=1, **options
        )
        for position, radius, temperature in self.fires:
            model.add_fire(position, radius=radius, temperature=temperature)
        for points, radius, resistance in self.loads:
            model.add_load(disc(points, radius) if radius else polygon(points), resistance=resistance)
        for d, pose, side in zip(self.design, self.poses, self.tendency, strict=True):
            model.add_robots(self.designs[d], poses=[pose], tendency="left" if side > 0 else "right")
        model.control = Commanded(self.commands)
        return model

    def nudged(self, distance: float) -> "World":
        """Return the same world with all robots moved and turned very slightly."""
        return replace(self, poses=self.poses + distance * np.array([1.0, -0.7, 0.4]))

    def moved(self, move: Callable[[np.ndarray], np.ndarray], turn: Callable[[np.ndarray], np.ndarray]) -> "World":
        """Return the world with every point and every heading changed by these functions."""
        x_min, y_min, x_max, y_max = self.bounds
        corners = move(np.array([[x_min, y_min], [x_max, y_max]]))
        return replace(
            self,
            bounds=(*map(float, corners.min(axis=0)), *map(float, corners.max(axis=0))),
            discs=[(move(centre), radius, solid) for centre, radius, solid in self.discs],
            polygons=[(move(o), None if h is None else move(h), solid) for o, h, solid in self.polygons],
            fires=[(move(position), radius, temperature) for position, radius, temperature in self.fires],
            loads=tuple((move(points), radius, resistance) for points, radius, resistance in self.loads),
            poses=np.column_stack([move(self.poses[:, :2]), turn(self.poses[:, 2])]),
        )

    def reordered(self, order: np.ndarray) -> "World":
        """Return the same world with its robots created in another order."""
        names = ("poses", "design", "commands", "tendency")
        return replace(self, **{name: getattr(self, name)[order] for name in names})


class Commanded:
    """An arbiter that gives every robot the same command in every step."""

    layers = ()

    def __init__(self, commands: np.ndarray) -> None:
        self.commands = commands

    def bound(self, swarm, streams) -> "Commanded":
        """Need nothing of the swarm."""
        return self

    def decide(self, senses, command: np.ndarray, layer: np.ndarray) -> None:
        """Give the commands."""
        command[:] = self.commands


def random_world(seed: int, *, most_robots: int = 12, designs: tuple[RobotDesign, ...] = DESIGNS) -> World:
    """Return a cluttered world in which robots may at first be anywhere, even inside each other."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, most_robots + 1))
    low, high = np.array(BOUNDS[:2]) + CLEARANCE, np.array(BOUNDS[2:]) - CLEARANCE
    design = rng.integers(len(designs), size=n)
    speed = np.array([designs[d].max_speed for d in design])
    return World(
        bounds=BOUNDS,
        discs=[(rng.uniform(low, high), rng.uniform(2, 20), _solid(rng)) for _ in range(rng.integers(4))],
        polygons=[_random_polygon(rng, low, high) for _ in range(rng.integers(5))],
        fires=[(rng.uniform(low, high), rng.uniform(2, 15), rng.uniform(0.1, 1)) for _ in range(rng.integers(3))],
        designs=designs,
        poses=np.column_stack([rng.uniform(low, high, (n, 2)), rng.uniform(-math.pi, math.pi, n)]),
        design=design,
        commands=rng.uniform(-1, 1, (n, 2)) * speed[:, None],
        tendency=rng.choice([-1.0, 1.0], n),
    )


def crowd(seed: int, n: int, size: float, design: RobotDesign = AGENT9) -> World:
    """Return a small room with a disc, a concave polygon, and robots all over it."""
    rng = np.random.default_rng(seed)
    world = random_world(seed, designs=(design,))
    outline = np.array([[0.2, 0.2], [0.5, 0.25], [0.35, 0.4], [0.45, 0.6], [0.15, 0.5]]) * size
    return replace(
        world,
        bounds=(0.0, 0.0, size, size),
        discs=[(np.array([0.7, 0.7]) * size, 0.1 * size, True)],
        polygons=[(outline, None, True)],
        fires=[],
        poses=np.column_stack([rng.uniform(6, size - 6, (n, 2)), rng.uniform(-math.pi, math.pi, n)]),
        design=np.zeros(n, int),
        commands=rng.uniform(-1, 1, (n, 2)) * design.max_speed,
        tendency=rng.choice([-1.0, 1.0], n),
    )


def with_loads(world: World, seed: int, n: int) -> World:
    """Return a world with at most this number of light loads, wherever there is room for them; robots may be inside."""
    rng = np.random.default_rng([seed, n])
    low, high = np.array(world.bounds[:2]), np.array(world.bounds[2:])
    model, loads = replace(world.reordered(np.arange(0)), loads=()).model(), []
    while len(loads) < n:
        centre, resistance = rng.uniform(low, high), rng.uniform(0.05, 1.2)
        outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * rng.uniform(3, 16, 2)
        round_one = (centre, float(rng.uniform(4, 12)), resistance)
        load = round_one if rng.random() < 0.4 else (centre + _turned(outline, rng.uniform(0, 3)), 0.0, resistance)
        try:
            model.add_load(disc(*load[:2]) if load[1] else polygon(load[0]), resistance=resistance)
            loads.append(load)
        except InvalidValueError:
            n -= 1
    return replace(world, loads=tuple(loads))


def hauled(seed: int, n: int = 14, size: float = 110.0) -> World:
    """Return a room with loads, and robots free of each other that drive at the nearest one."""
    world = with_loads(crowd(seed, n=n, size=size), seed, 12)
    if not world.loads:
        return hauled(seed + 1, n, size)
    rng = np.random.default_rng([seed, 2])
    still = replace(world, commands=np.zeros((n, 2))).model()
    still.step()
    place = still.swarm.position
    centres = np.array([points.reshape(-1, 2).mean(axis=0) for points, _, _ in world.loads])
    ways = centres - place[:, None]
    nearest = ways[np.arange(n), np.hypot(*ways.T).T.argmin(axis=1)]
    heading = np.arctan2(nearest[:, 1], nearest[:, 0]) + rng.uniform(-0.5, 0.5, n)
    wheels = 1.0 - rng.uniform(0, 0.3, (n, 2))
    return replace(world, poses=np.column_stack([place, heading]), commands=wheels * AGENT9.max_speed)


def outcome(model: SwarmModel) -> dict[str, np.ndarray]:
    """Return what is read before a step, and where robots are after it."""
    model.sense()
    read = {name: getattr(model.swarm, name).copy() for name in ("distance", "kind", "radiation", "line")}
    model.step()
    return read | state(model)


def state(model: SwarmModel) -> dict[str, np.ndarray]:
    """Return what a step writes of the robots' motion."""
    names = ("position", "heading", "slip", "collided", "contact_kind", "contact_depth")
    return {name: getattr(model.swarm, name).copy() for name in names}


def differences(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> dict[str, float]:
    """Return, for each name, the largest difference; headings are compared round the circle."""
    found = {}
    for name, left in a.items():
        apart = np.abs(left.astype(float) - b[name])
        if name == "heading":
            apart = np.minimum(apart, 2 * math.pi - apart)
        found[name] = float(apart.max(initial=0.0))
    return found


def load_state(model: SwarmModel) -> dict[str, np.ndarray]:
    """Return where the loads are and what happened to them in the last step."""
    loads = list(model.loads)
    return {
        "load_position": np.array([load.position for load in loads]).reshape(-1, 2),
        "load_heading": np.array([load.heading for load in loads]),
        "load_pushers": np.array([load.pushers for load in loads]),
    }


def _turned(points: np.ndarray, turn: float) -> np.ndarray:
    cosine, sine = math.cos(turn), math.sin(turn)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def _solid(rng: np.random.Generator) -> bool:
    return bool(rng.random() < 0.7)


def _random_polygon(rng, low, high) -> tuple[np.ndarray, np.ndarray | None, bool]:
    """Return a rectangle, or a star, concave as a rule, with or without a hole."""
    centre = rng.uniform(low + 12, high - 12)
    if rng.random() < 0.4:
        half = rng.uniform(2, 25, 2)
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return centre + corners * half, None, _solid(rng)
    n = int(rng.integers(3, 10))
    azimuth = rng.uniform(0, 6) + np.arange(n) * 2 * math.pi / n
    points = rng.uniform(6, 30, n)[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    hole = centre + 0.5 * points if rng.random() < 0.4 else None
    return centre + points, hole, _solid(rng)
