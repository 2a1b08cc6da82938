"""Crowded worlds with driven bodies that go wherever they are sent, and what no step may break there."""

import math

import numpy as np
import shapely

from mesa_swarm import SwarmModel, disc, polygon
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.physics.contact import SLOP

from .random_worlds import World, crowd, with_loads


def driven_world(seed: int, *, robots: int = 16, size: float = 100.0, loads: int = 0) -> tuple[World, list]:
    """Return a world and the shapes of its driven bodies: discs and polygons, some thin."""
    rng = np.random.default_rng([seed, 7])
    world = crowd(seed, n=robots, size=size)
    if loads:
        world = with_loads(world, seed, loads)
    shapes = []
    for _ in range(rng.integers(1, 5)):
        centre = rng.uniform(10, size - 10, 2)
        if rng.random() < 0.5:
            shapes.append(disc(centre, rng.uniform(1, 9)))
            continue
        half, turn = rng.uniform(0.4, 14, 2), rng.uniform(0, 3)
        corners = np.array([[-1, -1], [1, -1], [0.3, 1], [-1, 1]]) * half
        axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        shapes.append(polygon(corners @ axes.T + centre))
    return world, shapes


def with_driven(world: World, shapes: list, engine: str = "compiled") -> SwarmModel:
    """Return the model of a world with driven bodies, as far as loads leave room for them."""
    model = world.model(engine)
    for shape in shapes:
        try:
            model.add_body(shape, kind="driven")
        except InvalidValueError:
            continue
    model.step()  # robots that were placed inside anything move away
    return model


def send(model: SwarmModel, rng: np.random.Generator) -> None:
    """Send each driven body somewhere: nearby, or far away, or nowhere."""
    movers = model.movers
    farthest = rng.choice([0.0, 1.0, 6.0, 25.0, 200.0], len(movers))
    low, high = np.array(model.map.bounds).reshape(2, 2)
    places = np.clip(movers.position + farthest[:, None] * rng.uniform(-1, 1, (len(movers), 2)), low, high)
    turns = movers.heading + rng.choice([0.0, 0.1, 3.0], len(movers)) * rng.uniform(-1, 1, len(movers))
    model.move_bodies(movers.agents, np.column_stack([places, turns]))


def check_apart(model: SwarmModel) -> None:
    """Assert that no robot overlaps a robot, a body, a fire or the border, and no load overlaps a driven body."""
    position, radius = model.swarm.position, model.swarm.radius
    slack = 3 * SLOP * radius
    points = shapely.points(position)
    for body in model.bodies:
        if body.contact:
            gaps = shapely.distance(body.shape.geometry, points) - body.shape.radius
            assert (gaps >= radius - slack).all(), body
    apart = np.hypot(*(position[:, None] - position).T) + np.diag(np.full(len(radius), np.inf))
    assert (apart >= radius + radius[:, None] - slack).all()
    low, high = np.array(model.map.bounds).reshape(2, 2)
    assert (position >= low + (radius - slack)[:, None]).all()
    assert (position <= high - (radius - slack)[:, None]).all()
    for load in model.loads:
        assert not any(load.form.overlaps(load.pose, body.shape) for body in model.movers.agents)
