"""Named worlds and checks that tests share."""

import math
from itertools import combinations

import numpy as np
from shapely.geometry import Point, box

from mesa_swarm import AGENT9, Map, RobotDesign, SwarmModel, polygon, rectangle
from mesa_swarm.control import PASS, behaviour

# What the physics promises (PHYSICS 4).
PROMISED = 1e-6


@behaviour
def ahead(me, speed=1.0):
    """Drive straight on at a share of the greatest speed, whatever comes."""
    if speed > 9.0:
        return PASS
    return speed * me.max_speed, speed * me.max_speed


@behaviour
def circle(me, left=0.5, right=1.0):
    """Drive in a circle."""
    if left > 9.0:
        return PASS
    return left * me.max_speed, right * me.max_speed


def empty(width: float = 400.0, height: float = 300.0, **options) -> SwarmModel:
    """Return a world that has a border and nothing else."""
    return SwarmModel(map=Map(name="empty", bounds=(0, 0, width, height)), **{"rng": 1, **options})


def blind(radius: float = 5.0, max_speed: float = 1.0) -> RobotDesign:
    """Return a robot without sensors."""
    return RobotDesign(name="blind", radius=radius, max_speed=max_speed)


def wedge(angle_degrees: float, length: float = 150.0) -> SwarmModel:
    """Return a world with a horizontal wedge that opens to the left and narrows to the right."""
    model = empty(400.0, 300.0)
    half = math.radians(angle_degrees) / 2
    tip, rise = (300.0, 150.0), length * math.tan(half)
    upper = [tip, (tip[0] - length, tip[1] + rise), (tip[0] - length, 290), (310, 290)]
    lower = [tip, (310, 10), (tip[0] - length, 10), (tip[0] - length, tip[1] - rise)]
    model.add_obstacle(polygon(upper))
    model.add_obstacle(polygon(lower))
    return model


def corridor(width: float, length: float = 200.0) -> SwarmModel:
    """Return a world with a horizontal corridor, closed at its right end."""
    model = empty(400.0, 300.0)
    model.add_obstacle(rectangle((100, 150 + width / 2), (100 + length, 250)))
    model.add_obstacle(rectangle((100, 50), (100 + length, 150 - width / 2)))
    model.add_obstacle(rectangle((100 + length, 50), (120 + length, 250)))
    return model


def nine(sight: float = 50.0) -> RobotDesign:
    """Return AGENT9 with sensors of this range."""
    return AGENT9.with_proximity(range=sight)


def worst_overlap(model: SwarmModel) -> float:
    """Return the largest overlap of any body, relative to its radius, found by Shapely and by all pairs."""
    x_min, y_min, x_max, y_max = model.map.bounds
    worst = -math.inf
    for (x, y), r in zip(model.swarm.position, model.swarm.radius, strict=True):
        border = r - min(x - x_min, x_max - x, y - y_min, y_max - y)
        solids = [r + o.shape.radius - o.shape.geometry.distance(Point(x, y)) for o in model.obstacles if o.contact]
        fires = [r + f.radius - np.hypot(*(f.position - (x, y))) for f in model.fires]
        worst = max(worst, max([border, *solids, *fires]) / r)
    for (p, r), (q, s) in combinations(zip(model.swarm.position, model.swarm.radius, strict=True), 2):
        worst = max(worst, (r + s - np.hypot(*(p - q))) / min(r, s))
    return worst


def worst_load_overlap(model: SwarmModel) -> float:
    """Return how far any load reaches beyond the border, or into anything but robots, map units, by Shapely."""
    inside, worst = box(*model.map.bounds), -math.inf
    for load in model.loads:
        x_min, y_min, x_max, y_max = load.shape.bounds
        worst = max(
            worst, *(np.array([x_max, y_max]) - inside.bounds[2:]), *(inside.bounds[:2] - np.array([x_min, y_min]))
        )
        others = [(o.shape.geometry, o.shape.radius) for o in model.obstacles if o is not load and o.contact]
        others += [(Point(fire.position), fire.radius) for fire in model.fires]
        worst = max([worst, *(_depth(load.shape, geometry, radius) for geometry, radius in others)])
    return worst


def _depth(shape, geometry, radius: float) -> float:
    """Return how deep two bodies overlap: of two polygons no less than half of what they share is thick."""
    if shape.radius or radius:
        gap = shape.geometry.distance(geometry)
        return math.inf if gap == 0.0 else shape.radius + radius - gap
    shared = shape.geometry.intersection(geometry)
    return 2.0 * shared.area / shared.length if shared.area else -shape.geometry.distance(geometry)
