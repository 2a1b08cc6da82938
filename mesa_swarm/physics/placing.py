"""Finding room for robots that were placed inside a wall or inside each other."""

import math

import numpy as np

from mesa_swarm.base.errors import PlacementError
from mesa_swarm.geometry.grid import GridNumbers
from mesa_swarm.geometry.overlap import is_in_polygon
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of, hypot
from mesa_swarm.physics.contact import SLOP, deepest_static, push_all_from_statics
from mesa_swarm.physics.crowd import CrowdArrays, PairArrays, near_pairs
from mesa_swarm.physics.separation import MARGIN, SETTLED, STRAYED, separate, separate_near
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.swarm import Swarm

SWEEPS = np.int64(400)
# The search for free room goes round in rings this share of a radius apart.
RING = 0.125


def settle_robots(swarm: Swarm, surroundings: Surroundings, grid: GridNumbers) -> None:
    """Move every robot that overlaps anything to free room nearby, whatever the tangle, or raise `PlacementError`.

    `grid` finds robots near each other.
    """
    position, radius, number = (swarm.columns[name] for name in ("position", "radius", "number"))
    if not len(position):
        return
    solids, moving, rings = surroundings.solids, surroundings.moving, surroundings.statics.rings
    leave_solids(position, radius, solids, rings)
    crowd = CrowdArrays.of(grid, position, radius, number)._replace(places=position, radii=radius, numbers=number)
    push_all_from_statics(crowd.rows, position, radius, solids, crowd.contacts, crowd.free)
    crowd.reference[:] = position
    pairs = near_pairs(position, radius, MARGIN * radius.min(), grid)
    blocks = Block(crowd), Block(surroundings.still), Block(PairArrays.of_pairs(pairs))
    crowd_block, statics, near = (block.numbers for block in blocks)
    bodies = crowd_block, statics, None if moving is None else moving.block
    state = separate_near(*bodies, near, SWEEPS)
    is_free_of_overlaps = state == SETTLED
    if state == STRAYED:
        is_free_of_overlaps, _ = separate(*bodies, pairs, SWEEPS)
    if not is_free_of_overlaps:
        robot = leave_each_other(position, radius, solids, rings)
        if robot >= 0:
            raise no_room_error(robot, radius)


def no_room_error(i: int, radius: np.ndarray) -> PlacementError:
    """Return the error for robot i, for which there is no room left."""
    robot = f"robot {i + 1} of {len(radius)} (radius {radius[i]:g})"
    return PlacementError(f"no room is left for {robot}; remove robots or obstacles")


@compiled
def is_free(x, y, radius, statics, rings):
    """Return whether a disc overlaps no static body."""
    if deepest_static(x, y, radius, statics)[0] > SLOP * radius:
        return False
    for p in range(rings.shape[0]):
        if is_in_polygon(x, y, statics.edges, rings[p, 0], rings[p, 1]):
            return False
    return True


@compiled
def overlaps_any(i, x, y, position, radius):
    """Return whether robot i at (x, y) would overlap another."""
    for j in range(position.shape[0]):
        near = radius[i] + radius[j] - SLOP * min(radius[i], radius[j])
        if j != i and (x - position[j, 0]) ** 2 + (y - position[j, 1]) ** 2 < near * near:
            return True
    return False


@compiled
def leave_solids(position, radius, statics, rings):
    """Move robots that are inside a solid body to free room nearby; other robots do not count yet."""
    for i in range(position.shape[0]):
        if not is_free(position[i, 0], position[i, 1], radius[i], statics, rings):
            find_room(i, position, radius, statics, rings, False)


@compiled
def leave_each_other(position, radius, statics, rings):
    """Move, one after the other, robots that still overlap anything; return one without room, or -1."""
    for i in range(position.shape[0]):
        x, y = position[i, 0], position[i, 1]
        fits = is_free(x, y, radius[i], statics, rings) and not overlaps_any(i, x, y, position, radius)
        if not fits and not find_room(i, position, radius, statics, rings, True):
            return i
    return -1


@compiled
def find_room(i, position, radius, statics, rings, apart):
    """Move robot i to the first free place on growing rings around it and return whether there is one."""
    bounds = statics.bounds
    x, y = position[i, 0], position[i, 1]
    farthest = 2.0 * hypot(bounds[2] - bounds[0], bounds[3] - bounds[1])
    distance = 0.0
    while distance < farthest:
        # Larger rings are searched more coarsely, or a large map would take very long.
        distance += max(RING * radius[i], 0.01 * distance)
        places = 16 + min(int(2.0 * math.pi * distance / (RING * radius[i])), 720)
        for k in range(places):
            azimuth = 2.0 * math.pi * k / places
            cosine, sine = direction_of(azimuth)
            px, py = x + distance * cosine, y + distance * sine
            if is_free(px, py, radius[i], statics, rings) and not (apart and overlaps_any(i, px, py, position, radius)):
                position[i, 0], position[i, 1] = px, py
                return True
    return False
