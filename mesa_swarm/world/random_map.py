"""Random maps: walls all round, and discs and tilted walls inside that leave the free space connected."""

import math

import numpy as np
import shapely

from mesa_swarm.errors import check_count, check_number
from mesa_swarm.streams import Streams
from mesa_swarm.world.map import Map
from mesa_swarm.world.map_parts import listed
from mesa_swarm.world.placement import free_space
from mesa_swarm.world.shapes import Shape, disc, polygon, rectangle

WIDTH, HEIGHT, WALL = 800.0, 600.0, 20.0
RADII = (15.0, 60.0)
LENGTHS = (60.0, 320.0)
THICKNESSES = (15.0, 50.0)
SHARE_OF_DISCS = 0.4
TRIES = 50


def random_map(
    number: int,
    *,
    obstacles: int = 8,
    passage: float = 30.0,
    size: tuple[float, float] = (WIDTH, HEIGHT),
) -> Map:
    """Return a map whose free space is connected; the same arguments return an equal map.

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

    Examples
    --------
    >>> random_map(1) == random_map(1), random_map(1) == random_map(2)
    (True, False)
    >>> len(random_map(1, obstacles=3).obstacles), random_map(1, obstacles=2, size=(400, 300)).bounds
    (7, (0.0, 0.0, 400.0, 300.0))
    """
    number = check_count("number", number)
    wanted = check_count("obstacles", obstacles, maximum=30)
    extent = _checked_size(size)
    width = check_number("passage", passage, above=0, maximum=200)
    rng = Streams(np.random.SeedSequence(number))["random map"]
    shapes = _outer_walls(*extent)
    for _ in range(wanted):
        shapes += _one_more(shapes, extent, width, rng)
    return Map(name=f"random {number}", bounds=(0, 0, *extent), obstacles=tuple(shapes))


def _checked_size(size: object) -> tuple[float, float]:
    sides = listed("size", size, 2, "(width, height)")
    width, height = (check_number("size", side, minimum=200, maximum=10_000) for side in sides)
    return width, height


def _outer_walls(width: float, height: float) -> list[Shape]:
    return [
        rectangle((0, 0), (WALL, height)),
        rectangle((width - WALL, 0), (width, height)),
        rectangle((0, 0), (width, WALL)),
        rectangle((0, height - WALL), (width, height)),
    ]


def _one_more(
    shapes: list[Shape], extent: tuple[float, float], passage: float, rng: np.random.Generator
) -> list[Shape]:
    """Return one obstacle that leaves the free space in one piece, or an empty list if none is found."""
    for _ in range(TRIES):
        drawn = _drawn(extent, rng)
        if drawn is not None and _is_whole([*shapes, drawn], extent, passage):
            return [drawn]
    return []


def _drawn(extent: tuple[float, float], rng: np.random.Generator) -> Shape | None:
    """Return a disc or a wall; None for a wall whose corners lie beyond the map."""
    width, height = extent
    centre = rng.uniform((WALL, WALL), (width - WALL, height - WALL))
    if rng.random() < SHARE_OF_DISCS:
        return disc(centre, rng.uniform(*RADII))
    length, thickness, turn = rng.uniform(*LENGTHS), rng.uniform(*THICKNESSES), rng.uniform(0, math.pi)
    along = np.array([math.cos(turn), math.sin(turn)]) * length / 2
    across = np.array([-math.sin(turn), math.cos(turn)]) * thickness / 2
    corners = centre + np.array([along + across, along - across, -along - across, -along + across])
    inside = (corners >= 0).all() and (corners <= extent).all()
    return polygon(corners) if inside else None


def _is_whole(shapes: list[Shape], extent: tuple[float, float], passage: float) -> bool:
    """Return whether the places of a disc as wide as the passage are one piece."""
    space = free_space((0, 0, *extent), shapes, np.empty((0, 3)), passage / 2)
    return not space.is_empty and len(shapely.get_parts(space)) == 1
