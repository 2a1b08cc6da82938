"""Random worlds over the whole range that is promised, and the verdict on what both engines make of one.

Worlds are drawn in radii of their smallest robot and then put to scale and in place, so that each family is
hard in one way: speed and crowds, tiny and huge coordinates, outlines of thousands of corners, loads, designs.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely

from mesa_swarm import (
    HolonomicDrive,
    LineSensor,
    ProximitySensor,
    RadiationSensor,
    RobotDesign,
    disc,
    polygon,
)
from mesa_swarm.base.errors import InvalidValueError, PlacementError
from support.random_worlds import World, differences, load_state, state
from support.scenes import PROMISED, worst_load_overlap, worst_overlap

# Both engines do the same sums in another order: in radii, what a step of 200 pieces makes of rounding where nothing
# is unstable (most worlds stay below 1e-11).
EXACT = 1e-9
# Positions are rounded to the spacing of floats at the largest coordinate, in each piece anew.
SPACINGS = 64
# A world is chaotic where robots moved by this share of a radius end farther apart than JUMP, and no less far than a
# tenth of what the engines differ by, which rounding alone moved.
NUDGE, JUMP = 1e-10, 1e-6
LENGTHS = ("position", "load_position", "distance", "contact_depth")
READ = ("distance", "kind", "radiation", "line")
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, kw_only=True)
class Family:
    """Ranges that worlds are drawn from, lengths in radii of the smallest robot.

    Parameters
    ----------
    speed : (float, float)
        Greatest speed of the robots, radii a step.
    robots, obstacles, loads, corners : (int, int)
        How many; corners of each random outline.
    side : (float, float)
        Of the map.
    radius : (float, float)
        Of the smallest robot, map units.
    ratio : float
        Of the largest radius to the smallest.
    offset : (float, float)
        Distance of the map from the origin, map units; 0 leaves it there.
    designs : int
    steps : int
    """

    speed: tuple[float, float] = (0.01, 10.0)
    robots: tuple[int, int] = (1, 14)
    obstacles: tuple[int, int] = (0, 8)
    loads: tuple[int, int] = (0, 2)
    corners: tuple[int, int] = (3, 12)
    side: tuple[float, float] = (25.0, 60.0)
    radius: tuple[float, float] = (5.0, 5.0)
    ratio: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)
    designs: int = 2
    steps: int = 4


FAMILIES = {
    "fast crowds": Family(speed=(20, 100), robots=(12, 20), obstacles=(30, 61), loads=(1, 1), side=(50, 90), steps=3),
    "tiny coordinates": Family(radius=(2e-8, 1e-3)),
    "coordinates 1e9": Family(radius=(5.0, 1e6), offset=(1e7, 9e8)),
    "many corners": Family(corners=(1000, 4000), obstacles=(1, 3), side=(40, 80)),
    "loads": Family(loads=(2, 8), robots=(6, 18), speed=(0.05, 20)),
    "radii 1 to 100": Family(ratio=100.0, designs=4, side=(250, 600), speed=(0.05, 20)),
}


@dataclass
class Verdict:
    """What both engines made of a world.

    Attributes
    ----------
    status : str
        "equal", "chaotic", "no room" where both refuse to settle the robots, or "apart".
    worst : float
        The largest overlap after any step of either engine, in radii.
    """

    status: str = "equal"
    worst: float = -math.inf
    detail: str = ""

    @property
    def promised(self) -> bool:
        return self.worst <= PROMISED


def judged(name: str, seed: int) -> Verdict:
    """Return the verdict on a world of a family: all readings and motions are compared until the first difference."""
    world, r = wide_world(name, seed)
    models = [world.model(engine) for engine in ("compiled", "shapely")]
    spacing = float(np.spacing(np.abs(world.bounds).max()) / r)
    verdict = Verdict()
    for stage in range(2 * FAMILIES[name].steps):
        ours, oracle = (_outcome(model, stage) for model in models)
        verdict.worst = max([verdict.worst, *(_overlap(model, r) for model in models if stage % 2 and ours)])
        if verdict.status == "equal":
            apart = _apart(ours, oracle, r)
            if apart > EXACT + SPACINGS * spacing:
                verdict.status, verdict.detail = _reason(world, r, stage, apart, spacing)
        if ours is None or oracle is None:
            verdict.status = "no room" if verdict.status == "equal" else verdict.status
            return verdict
    return verdict


def _outcome(model, stage: int) -> dict[str, np.ndarray] | None:
    """Return what is read (even stages) or done (odd ones), None where there is no room for the robots."""
    try:
        if stage % 2:
            model.step()
            return state(model) | load_state(model)
        model.sense()
        return {name: getattr(model.swarm, name).copy() for name in READ}
    except PlacementError:
        return None


def _apart(here: dict | None, there: dict | None, r: float) -> float:
    """Return the largest difference of two outcomes, lengths in radii."""
    if here is None or there is None:
        return 0.0 if here is there else math.inf
    return max(value / r if name in LENGTHS else value for name, value in differences(here, there).items())


def _reason(world: World, r: float, stage: int, apart: float, spacing: float) -> tuple[str, str]:
    """Distinguish chaos from disagreement: does the oracle differ from itself if each robot is moved slightly?"""
    outcomes, nudge = [], max(NUDGE, 16 * spacing)
    for direction in range(4):
        model = _nudged(world, r, direction and nudge, direction).model("shapely")
        for early in range(stage):
            _outcome(model, early)
        outcomes.append(_outcome(model, stage))
        jump = max(_apart(outcomes[0], each, r) for each in outcomes)
        if jump >= max(JUMP, 10 * SPACINGS * nudge if nudge > NUDGE else 0.0, min(apart, 1.0) / 10):
            break
    else:
        # Rounding grew as a nudge does.
        if apart <= SPACINGS * spacing * jump / nudge:
            return "equal", ""
        return "apart", f"stage {stage}: {apart:.1e} apart, nudges of {nudge:.0e} move the oracle by {jump:.1e}"
    return "chaotic", f"stage {stage}: {apart:.1e} apart, nudges of {nudge:.0e} move the oracle by {jump:.1e}"


def _nudged(world: World, r: float, distance: float, direction: int) -> World:
    """Return the world with each robot moved and turned on its own, at most by this share of a radius and rad."""
    ways = np.random.default_rng(direction).uniform(-1, 1, world.poses.shape)
    return replace(world, poses=world.poses + distance * ways * [r, r, 1.0])


def _overlap(model, r: float) -> float:
    return max(worst_overlap(model), worst_load_overlap(model) / r if len(model.loads) else -math.inf)


def drawn(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number, its logarithm uniform between those of the ends."""
    return float(low * (high / low) ** rng.random()) if low > 0 else low


def count(rng: np.random.Generator, ends: tuple[int, int]) -> int:
    return int(rng.integers(ends[0], ends[1] + 1))


def wide_world(name: str, seed: int) -> tuple[World, float]:
    """Return a world of a family, and the radius of its smallest robot."""
    family = FAMILIES[name]
    rng = np.random.default_rng([seed, list(FAMILIES).index(name)])
    r, side = drawn(rng, *family.radius), drawn(rng, *family.side)
    size = r * side * np.array([1.0, rng.uniform(0.5, 1.0)])
    corner = rng.choice([-1.0, 1.0], 2) * drawn(rng, *family.offset)
    bounds = tuple(map(float, (*corner, *(corner + size))))
    designs = tuple(_design(rng, family, r, k) for k in range(family.designs))
    n = count(rng, family.robots)
    design = rng.integers(len(designs), size=n)
    _make_fit(design, np.array([one.radius for one in designs]), float(size.prod()))
    low, high = corner + 1.5 * r, corner + size - 1.5 * r
    discs, outlines = [], []
    for _ in range(count(rng, family.obstacles)):
        _add_obstacle(rng, family, corner, size, r, discs, outlines)
    speed = np.array([designs[d].max_speed for d in design])
    commands = rng.uniform(-1, 1, (n, 2))
    straight = rng.random(n) < 0.5
    commands[straight, 1] = commands[straight, 0] * rng.uniform(0.99, 1.0, straight.sum())
    fires = [
        (rng.uniform(low, high), min(r * rng.uniform(0.5, 3), 9e5), rng.uniform(0.1, 1)) for _ in range(rng.integers(2))
    ]
    world = World(
        bounds=bounds,
        discs=discs,
        polygons=outlines,
        fires=fires,
        designs=designs,
        poses=np.column_stack([rng.uniform(low, high, (n, 2)), rng.uniform(-math.pi, math.pi, n)]),
        design=design,
        commands=commands * speed[:, None],
        tendency=rng.choice([-1.0, 1.0], n),
    )
    return _with_loads(rng, world, count(rng, family.loads), r), r


def _make_fit(design: np.ndarray, radius: np.ndarray, area: float) -> None:
    """Turn robots into the smallest ones from where all would take more than a sixth of the map; the first is one."""
    design[0], taken = 0, 0.0
    for i in range(len(design)):
        taken += math.pi * radius[design[i]] ** 2
        if taken > area / 6:
            taken -= math.pi * radius[design[i]] ** 2
            design[i] = 0


def _design(rng: np.random.Generator, family: Family, r: float, k: int) -> RobotDesign:
    """Return a random design; the first is the smallest, the second the largest."""
    radius = r * (1.0 if k == 0 else family.ratio if k == 1 else drawn(rng, 1.0, family.ratio))
    radius = min(radius, 1e6)
    sight = min(radius * drawn(rng, 0.5, 15.0), 1e6)
    sensors = [
        ProximitySensor(
            bearing_degrees=rng.uniform(-180, 180),
            range=sight * rng.random(),
            field_of_view_degrees=rng.choice([0.0, 1e-3, rng.uniform(1, 360), 180.0, 360.0]),
            rays=int(rng.choice([0, 0, rng.integers(1, 6)])),
            mount=None if rng.random() < 0.6 else tuple(radius * rng.uniform(-0.9, 0.9, 2)),
        )
        for _ in range(rng.integers(1, 7))
    ]
    sensors.append(RadiationSensor(bearing_degrees=rng.uniform(-180, 180), range=sight, field_of_view_degrees=70.0))
    sensors.append(LineSensor(mount=(0.5 * radius, 0.1 * radius)))
    return RobotDesign(
        name=f"design {k}",
        radius=radius,
        # Pieces of a step are half the least radius long: the large ones are as fast as the small.
        max_speed=r * drawn(rng, *family.speed),
        sensors=tuple(sensors),
        drive=HolonomicDrive() if rng.random() < 0.3 else RobotDesign().drive,
    )


def _add_obstacle(rng, family, corner, size, r, discs, outlines) -> None:
    """Add a disc, a rectangle, a thin wall, a wedge or a star, with or without a hole, solid as a rule."""
    centre, solid = rng.uniform(corner, corner + size), bool(rng.random() < 0.85)
    kind = rng.integers(6)
    crowd = min(1.0, 8.0 / max(family.obstacles))
    if max(family.corners) > 100:
        kind = 5
    hole = None
    if kind == 0:
        discs.append((centre, r * drawn(rng, 0.05, 8.0 * crowd + 0.1), solid))
        return
    if kind in (1, 2):
        thin = 1e-3 if kind == 2 else 0.3
        half = r * np.array([drawn(rng, 0.5, 8.0 * crowd + 1.0), drawn(rng, thin, 2.0 * crowd + thin)])
        points = centre + CORNERS * (half if rng.random() < 0.5 else half[::-1])
        if rng.random() < 0.3:
            points = centre + turned(CORNERS * half, rng.uniform(0, 3))
    elif kind in (3, 4):
        length, opening = r * drawn(rng, 2.0, 12.0 * crowd + 2.1), drawn(rng, 0.01, 1.2)
        azimuth = rng.uniform(-math.pi, math.pi)
        # A notch: two arms that meet at an acute angle, open towards robots.
        arms = np.array([[1, 0], [math.cos(opening), math.sin(opening)], [-0.2, 0.9 * opening], [-0.2, -0.6]]) * length
        tip = np.array([[0.02, 0.0]]) * length
        points = centre + turned(np.vstack([arms[:1], tip, arms[1:]]), azimuth)
    else:
        n = count(rng, family.corners)
        azimuth = rng.uniform(0, 6) + np.arange(n) * 2 * math.pi / n
        away = rng.uniform(0.6 if n > 100 else 0.25, 1.0, n) * r * drawn(rng, 2.0, 14.0 * crowd + 2.0)
        points = away[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
        hole = centre + rng.uniform(0.2, 0.5) * points if rng.random() < 0.5 else None
        points = centre + points
    try:
        shape = polygon(points, [] if hole is None else [hole])
    except InvalidValueError:  # rounded to coordinates so coarse, it crosses itself
        return
    if shape.geometry.distance(shapely.box(*corner, *(corner + size))) == 0.0:
        outlines.append((points, hole, solid))


def turned(points: np.ndarray, turn: float) -> np.ndarray:
    cosine, sine = math.cos(turn), math.sin(turn)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def _with_loads(rng: np.random.Generator, world: World, n: int, r: float) -> World:
    """Return the world with at most this number of light loads, where there is room for them; robots may be inside."""
    low, high = np.array(world.bounds[:2]), np.array(world.bounds[2:])
    model, loads = replace(world.reordered(np.arange(0)), loads=()).model(), []
    for _ in range(40):
        if len(loads) == n:
            break
        centre, resistance = rng.uniform(low, high), drawn(rng, 0.02, 2.0)
        if rng.random() < 0.35:
            load = (centre, r * drawn(rng, 0.3, 4.0), resistance)
        else:
            half = r * np.array([drawn(rng, 0.2, 4.0), drawn(rng, 0.2, 4.0)])
            load = (centre + turned(CORNERS * half, rng.uniform(0, 3)), 0.0, resistance)
        try:
            model.add_load(disc(*load[:2]) if load[1] else polygon(load[0]), resistance=resistance)
            loads.append(load)
        except InvalidValueError:
            continue
    return replace(world, loads=tuple(loads))
