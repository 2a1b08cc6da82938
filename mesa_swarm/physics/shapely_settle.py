"""Finding room for robots put where there is none, through Shapely alone: the oracle of `settle`."""

import math
from collections.abc import Iterator

import numpy as np
import shapely
from shapely import Point

from mesa_swarm.errors import PlacementError
from mesa_swarm.physics.contact import SLOP
from mesa_swarm.physics.settle import RING, SWEEPS
from mesa_swarm.physics.shapely_contact import Contacts, separate
from mesa_swarm.physics.shapely_solids import Solids

FEWEST_PLACES, MOST_PLACES = 16, 720
# Each ring is at least this much wider than the last: a large map would otherwise take for ever.
GROWTH = 0.01


def settle(columns: dict[str, np.ndarray], bounds: tuple[float, ...], solids: Solids) -> None:
    """Move every robot that overlaps anything to free room nearby, whatever the tangle.

    Raises
    ------
    PlacementError
        If there is no room left for a robot.
    """
    position, radius = columns["position"], columns["radius"]
    for i in range(len(radius)):
        if not is_free(position[i : i + 1], radius[i], solids)[0]:
            find_room(i, position, radius, bounds, solids, apart=False)
    contacts = Contacts({name: column.copy() for name, column in columns.items()})
    if not separate(position, radius, solids, contacts, SWEEPS):
        leave_each_other(position, radius, bounds, solids)


def leave_each_other(position: np.ndarray, radius: np.ndarray, bounds: tuple[float, ...], solids: Solids) -> None:
    """Move, one after the other, robots that still overlap anything."""
    for i in range(len(radius)):
        here = position[i : i + 1]
        if is_free(here, radius[i], solids)[0] and is_apart(i, here, position, radius)[0]:
            continue
        if not find_room(i, position, radius, bounds, solids, apart=True):
            raise PlacementError(
                f"no room is left for robot {i + 1} of {len(radius)} (radius {radius[i]:g}); remove robots or obstacles"
            )


def is_free(places: np.ndarray, radius: float, solids: Solids) -> np.ndarray:
    """Return whether a disc at each of these places overlaps nothing that stands still."""
    return solids.gaps(places) >= radius - SLOP * radius


def is_on_map(places: np.ndarray, bounds: tuple[float, ...]) -> np.ndarray:
    """Return whether each of these places is within the map.

    Examples
    --------
    >>> is_on_map(np.array([[3.0, 4.0], [3.0, 11.0]]), (0, 0, 10, 10)).tolist()
    [True, False]
    """
    inside = (places >= bounds[:2]) & (places <= bounds[2:])
    return np.logical_and.reduce(inside, axis=1)


def is_apart(i: int, places: np.ndarray, position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return whether robot i, were it at each of these places, would overlap no other."""
    others = np.arange(len(radius)) != i
    near = radius[i] + radius[others] - SLOP * np.minimum(radius[i], radius[others])
    distance = shapely.distance(shapely.points(places)[:, None], shapely.points(position[others]))
    return (distance >= near).all(axis=1)


def find_room(
    i: int,
    position: np.ndarray,
    radius: np.ndarray,
    bounds: tuple[float, ...],
    solids: Solids,
    *,
    apart: bool,
) -> bool:
    """Move robot i to the first free place on growing rings around it and return whether there is one."""
    for places in rings(position[i].copy(), radius[i], bounds):
        # What is solid about the outside ends somewhere; beyond that there is no room either.
        free = is_on_map(places, bounds) & is_free(places, radius[i], solids)
        if apart:
            free &= is_apart(i, places, position, radius)
        if free.any():
            position[i] = places[np.argmax(free)]
            return True
    return False


def rings(centre: np.ndarray, radius: float, bounds: tuple[float, ...]) -> Iterator[np.ndarray]:
    """Yield places on growing circles around a point until they are beyond the map.

    Examples
    --------
    >>> next(rings(np.zeros(2), 8.0, (0, 0, 10, 10)))[0]
    array([1., 0.])
    """
    farthest = 2 * Point(bounds[:2]).distance(Point(bounds[2:]))
    distance = 0.0
    while distance < farthest:
        distance += max(RING * radius, GROWTH * distance)
        count = FEWEST_PLACES + min(int(2 * math.pi * distance / (RING * radius)), MOST_PLACES)
        azimuth = 2 * math.pi * np.arange(count) / count
        yield centre + distance * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
