"""Random maps: walls all round, and discs and tilted walls inside that leave the free space connected."""

import math

import numpy as np
import shapely

from mesa_swarm.base.errors import check_count, check_number
from mesa_swarm.base.streams import Streams
from mesa_swarm.kernels.elementary import direction_of
from mesa_swarm.maps.map import Map
from mesa_swarm.maps.map_parts import FireSpot, check_items
from mesa_swarm.world.placement import free_space
from mesa_swarm.world.shapes import Shape, disc, polygon, rectangle

__all__ = ["random_map"]

WIDTH, HEIGHT, WALL = 800.0, 600.0, 20.0
RADII = (15.0, 60.0)
LENGTHS = (60.0, 320.0)
THICKNESSES = (15.0, 50.0)
SHARE_OF_DISCS = 0.4
TRIES = 50
# As on the map openspace_fire: the largest takes more than one robot.
LARGEST_FIRE, RADII_OF_FIRES = 40.0, (13.0, 22.0)
TRIES_OF_FIRES = 500


def random_map(
    number: int,
    *,
    obstacles: int = 8,
    passage: float = 30.0,
    size: tuple[float, float] = (WIDTH, HEIGHT),
    fires: int = 0,
) -> Map:
    """Return a map whose free space is connected; the same arguments return an equal map.

    The obstacles of a number are the same with and without fires.

    Parameters
    ----------
    number : int
        At least 0.
    obstacles : int
        Discs and tilted walls besides the four outer walls, at most 30. Fewer if no more find room.
    passage : float
        A disc of this diameter can get from any place where it fits to any other, above 0, at most 200.
    size : (width, height)
        Map units, 200 to 10,000 each.
    fires : int
        At most 30, a passage or more from each other and from all obstacles, so that robots get to every side of them.
        The first has a radius of 40, the others of 13 to 22. Fewer if no more find room.

    Examples
    --------
    >>> random_map(1) == random_map(1), random_map(1) == random_map(2)
    (True, False)
    >>> len(random_map(1, obstacles=3).obstacles), random_map(1, obstacles=2, size=(400, 300)).bounds
    (7, (0.0, 0.0, 400.0, 300.0))
    >>> [round(fire.radius) for fire in random_map(1, fires=3).fires]
    [40, 18, 17]
    """
    number = check_count("number", number)
    count = check_count("obstacles", obstacles, maximum=30)
    extent = _check_size(size)
    width = check_number("passage", passage, above=0, maximum=200)
    burning = check_count("fires", fires, maximum=30)
    streams = Streams(np.random.SeedSequence(number))
    rng = streams["random map"]
    shapes = _outer_walls(*extent)
    for _ in range(count):
        shapes += _draw_obstacle(shapes, extent, width, rng)
    spots: list[FireSpot] = []
    for _ in range(burning):
        spots += _draw_fire(spots, shapes, extent, width, streams["random fires"])
    return Map(name=f"random {number}", bounds=(0, 0, *extent), obstacles=tuple(shapes), fires=tuple(spots))


def _check_size(size: object) -> tuple[float, float]:
    sides = check_items("size", size, 2, "(width, height)")
    width, height = (check_number("size", side, minimum=200, maximum=10_000) for side in sides)
    return width, height


def _outer_walls(width: float, height: float) -> list[Shape]:
    return [
        rectangle((0, 0), (WALL, height)),
        rectangle((width - WALL, 0), (width, height)),
        rectangle((0, 0), (width, WALL)),
        rectangle((0, height - WALL), (width, height)),
    ]


def _draw_obstacle(
    shapes: list[Shape], extent: tuple[float, float], passage: float, rng: np.random.Generator
) -> list[Shape]:
    """Return one obstacle that leaves the free space in one piece, or an empty list if none is found."""
    for _ in range(TRIES):
        shape = _draw_shape(extent, rng)
        if shape is not None and _is_whole([*shapes, shape], extent, passage):
            return [shape]
    return []


def _draw_shape(extent: tuple[float, float], rng: np.random.Generator) -> Shape | None:
    """Return a disc or a wall; None for a wall whose corners lie beyond the map."""
    width, height = extent
    centre = rng.uniform((WALL, WALL), (width - WALL, height - WALL))
    if rng.random() < SHARE_OF_DISCS:
        return disc(centre, rng.uniform(*RADII))
    length, thickness, turn = rng.uniform(*LENGTHS), rng.uniform(*THICKNESSES), rng.uniform(0, math.pi)
    x, y = direction_of(turn)
    along, across = np.array([x, y]) * length / 2, np.array([-y, x]) * thickness / 2
    corners = centre + np.array([along + across, along - across, -along - across, -along + across])
    inside = (corners >= 0).all() and (corners <= extent).all()
    return polygon(corners) if inside else None


def _draw_fire(
    spots: list[FireSpot], shapes: list[Shape], extent: tuple[float, float], passage: float, rng: np.random.Generator
) -> list[FireSpot]:
    """Return one fire with a passage all round, or an empty list if none is found."""
    radius = rng.uniform(*RADII_OF_FIRES) if spots else LARGEST_FIRE
    points = rng.uniform((0, 0), extent, (TRIES_OF_FIRES, 2))
    burning = [disc(spot.position, spot.radius) for spot in spots]
    room = free_space((0, 0, *extent), [*shapes, *burning], radius + passage)
    free = np.flatnonzero(shapely.contains_xy(room, points))
    return [FireSpot(tuple(points[free[0]].tolist()), radius)] if len(free) else []


def _is_whole(shapes: list[Shape], extent: tuple[float, float], passage: float) -> bool:
    """Return whether the places of a disc as wide as the passage are one piece."""
    space = free_space((0, 0, *extent), shapes, passage / 2)
    return not space.is_empty and len(shapely.get_parts(space)) == 1
