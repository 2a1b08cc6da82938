"""Whether there is room for something that is put on the map by hand."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.robots.robot import Robot
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.bodies import Body
from mesa_swarm.world.shapes import Shape

# Overlaps below this are rounding.
TOUCHING = 1e-9
NAMES = {"obstacle": "an obstacle", "load": "a load"}


def check_place(model: SwarmModel, shape: Shape, of: Robot | Body | None = None) -> None:
    """Refuse a place where something, `of` itself left out, would overlap another thing or the border of the map."""
    depth, what = deepest(model, shape, of)
    if depth > TOUCHING:
        x, y = shape.position.tolist()
        raise InvalidValueError(
            f"at ({x:.4g}, {y:.4g}) it would overlap {what} by {depth:.3g}; choose a place farther away"
        )


def deepest(model: SwarmModel, shape: Shape, of: Robot | Body | None = None) -> tuple[float, str]:
    """Return the largest overlap of a shape, and with what."""
    x_min, y_min, x_max, y_max = model.map.bounds
    left, low, right, high = shape.bounds
    found = [(max(x_min - left, y_min - low, right - x_max, high - y_max), "the border of the map")]
    bodies = [body for body in model.obstacle_list if body.contact and getattr(body, "carrier", None) is None]
    for body in bodies:
        found.append((-_gap(shape, body.shape), NAMES.get(body.kind, f"a {body.kind}")) if body is not of else found[0])
    for number, fire in enumerate(model.fires.agents, start=1):
        found.append((-_gap(shape, fire.shape), f"fire {number}") if fire is not of else found[0])
    swarm = model.swarm
    gaps = shapely.distance(shape.geometry, shapely.points(swarm.position)) - shape.radius - swarm.radius
    if isinstance(of, Robot):
        gaps[of.row] = np.inf
    if len(gaps):
        nearest = int(np.argmin(gaps))
        found.append((-float(gaps[nearest]), f"robot {swarm.agents[nearest].unique_id}"))
    return max(found, key=lambda one: one[0])


def outline_of(shape: Shape) -> BaseGeometry:
    """Return the area that a shape covers."""
    return shape.geometry.buffer(shape.radius) if shape.is_disc else shape.geometry


def _gap(one: Shape, other: Shape) -> float:
    """Return how far apart two shapes are; below 0 if they overlap, of polygons the side of a square of that area."""
    distance = float(shapely.distance(one.geometry, other.geometry))
    if distance > 0 or one.is_disc or other.is_disc:
        return distance - one.radius - other.radius
    return -float(np.sqrt(shapely.intersection(one.geometry, other.geometry).area))
