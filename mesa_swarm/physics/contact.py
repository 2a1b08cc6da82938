"""What a robot overlaps: depth and normal of its deepest overlap, and the contacts of a step as arrays.

Robots leave static and driven bodies deepest overlap first; see `travel` for the step, and `separation` for robots that
overlap each other.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry.grid import CellLists, cell_at
from mesa_swarm.geometry.overlap import nearest_on_segment
from mesa_swarm.kernels.block import borrow, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of, hypot
from mesa_swarm.kernels.type_names import Codes, Integers, RealRows, Reals
from mesa_swarm.physics.driven_bodies import MoverArrays
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import BORDER, OBSTACLE, ROBOT

# A centre nearer to a flat face than this share of its radius is on it, on whichever side rounding puts it: a load
# that comes half a radius towards a robot that goes half a radius towards it.
ON_FACE = 1e-6
# Overlaps below this share of the radius are rounding. A tenth of what is promised.
SLOP = 1e-7
# A NumPy number: Numba would compile a function once more for each literal one that is passed to it.
A_ROBOT = np.int64(ROBOT)
MOST_PUSHES = 12
# Directions of coincident centres: far apart for neighbouring ids.
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


class StaticArrays(NamedTuple):
    """What robots can touch besides each other, as compiled functions take it.

    All but `movers`, the driven bodies, are as in `Statics`.
    """

    edges: RealRows
    discs: RealRows
    owner: Integers
    body: Codes
    bounds: Reals
    touch_cells: CellLists
    movers: MoverArrays | None


class ContactArrays(NamedTuple):
    """The deepest contact of each robot in a step: its kind, the other body, normal and depth.

    `face` (n, 3) has the normal and depth of that with a flat face in this piece of the step.
    """

    kind: Integers
    other: Integers
    normal: RealRows
    depth: Reals
    face: RealRows

    @classmethod
    def of(cls, n: int) -> "ContactArrays":
        """Return room for the contacts of n robots, none yet."""
        return cls(np.full(n, -1), np.full(n, -1), np.zeros((n, 2)), np.zeros(n), np.zeros((n, 3)))


@compiled
def unpack_solids(statics, movers):
    """Return the `StaticArrays` in a block, with the movers in another one, or None."""
    s = unpack(statics, StaticArrays)
    return StaticArrays(s.edges, s.discs, s.owner, s.body, s.bounds, s.touch_cells, unpack(movers, MoverArrays))


@compiled(inline=True)
def deepest_static(x, y, radius, statics):
    """Return depth, normal, flatness and item of the deepest overlap of a disc with static bodies."""
    edges, discs = statics.edges, statics.discs
    border = _deepest_border(x, y, radius, statics.bounds)
    deepest = deepest_listed(x, y, radius, edges, discs, statics.touch_cells, border)
    return deepest_moving(x, y, radius, edges, discs, statics.movers, deepest)


@compiled(inline=True)
def deepest_moving(x, y, radius, edges, discs, movers, deepest):
    """Return the deepest overlap with driven bodies if it is deeper than what was found."""
    if movers is None:
        return deepest
    return deepest_listed(x, y, radius, edges, discs, movers.touch_cells, deepest)


@compiled(inline=True)
def deepest_listed(x, y, radius, edges, discs, lists, deepest_found):
    """Return the deepest overlap with the items that are listed if it is deeper than what was found."""
    deepest, normal_x, normal_y, flat, deepest_item = deepest_found
    start, items, cell = lists.start, lists.items, cell_at(x, y, lists.grid)
    for k in range(start[cell], start[cell + 1]):
        item = items[k]
        if item < edges.shape[0]:
            depth, nx, ny, face = edge_overlap(x, y, radius, edges, item)
        else:
            depth, nx, ny = disc_overlap(x, y, radius, discs, item - edges.shape[0])
            face = False
        if depth > deepest:
            deepest, normal_x, normal_y, flat, deepest_item = depth, nx, ny, face, item
    return deepest, normal_x, normal_y, flat, deepest_item


@compiled(inline=True)
def _deepest_border(x, y, radius, bounds):
    """Return the deepest overlap of a disc with the outside of the map."""
    west, south = radius - (x - bounds[0]), radius - (y - bounds[1])
    east, north = radius - (bounds[2] - x), radius - (bounds[3] - y)
    deepest = max(west, south, east, north)
    if deepest <= 0.0:
        return 0.0, 0.0, 0.0, False, BORDER
    nx = 1.0 if deepest == west else (-1.0 if deepest == east else 0.0)
    ny = 0.0 if nx != 0.0 else (1.0 if deepest == south else -1.0)
    return deepest, nx, ny, True, BORDER


@compiled(inline=True)
def edge_overlap(x, y, radius, edges, e):
    """Return depth, normal and flatness of the overlap of a disc with edge e; depth 0 means no overlap."""
    ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
    if (
        max(ax, bx) + radius <= x or min(ax, bx) - radius >= x
        or max(ay, by) + radius <= y or min(ay, by) - radius >= y
    ):  # fmt: skip
        return 0.0, 0.0, 0.0, False
    px, py, face = nearest_on_segment(x, y, ax, ay, bx, by)
    dx, dy = x - px, y - py
    gap = math.sqrt(dx * dx + dy * dy)
    if gap >= radius:
        return 0.0, 0.0, 0.0, False
    if gap > ON_FACE * radius or (gap > 0.0 and not face):
        return radius - gap, dx / gap, dy / gap, face
    # On the edge: away from its solid side, which is on the left.
    length = hypot(bx - ax, by - ay)
    nx, ny = (by - ay) / length, (ax - bx) / length
    return radius - (dx * nx + dy * ny), nx, ny, face


@compiled(inline=True)
def disc_overlap(x, y, radius, discs, k):
    """Return depth and normal of the overlap of a disc with static disc k; depth 0 means no overlap."""
    dx, dy = x - discs[k, 0], y - discs[k, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    depth = radius + discs[k, 2] - distance
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    if distance > 0.0:
        return depth, dx / distance, dy / distance
    return depth, 1.0, 0.0


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Contacts:
    """The deepest contact of every robot that collided in a step; one row per robot, by ascending unique_id.

    `kind` is the code of one of `model.kinds`, 0 for the border as for obstacles. `other` is the unique_id of the other
    body, -1 for the border and for a body that has been removed since. `normal` (k, 2) is the unit vector from the
    other to the robot, and `depth` the overlap before it was resolved, map units.
    """

    robot: np.ndarray
    kind: np.ndarray
    other: np.ndarray
    normal: np.ndarray
    depth: np.ndarray

    @classmethod
    def of(cls, swarm: Swarm, bodies: Sequence, others: Mapping[int, Sequence]) -> "Contacts":
        """Collect the contacts of the last step; `others` are the agents of kinds that are not listed in `bodies`."""
        rows = np.flatnonzero(swarm.collided)
        kind, index = swarm.contact_kind[rows], swarm.contact_index[rows]
        other, is_body = np.full(len(rows), -1), index != BORDER
        of_robots = is_body & (kind == ROBOT)
        other[of_robots] = swarm.unique_ids[index[of_robots]]
        for place in np.flatnonzero(is_body & ~of_robots).tolist():
            other[place] = others.get(kind[place], bodies)[index[place]].unique_id
        return cls(
            robot=swarm.unique_ids[rows],
            kind=kind,
            other=other,
            normal=swarm.contact_normal[rows],
            depth=swarm.contact_depth[rows],
        )


@compiled(apart=True)
def push_all_from_statics(rows, position, radius, statics, contacts, free):
    """Move the robots in these rows out of static bodies, and write for which ones that was possible."""
    rows, position, radius, free = borrow(rows), borrow(position), borrow(radius), borrow(free)
    statics, contacts = borrow(statics), borrow(contacts)
    bounds, movers, grid, start = statics.bounds, statics.movers, statics.touch_cells.grid, statics.touch_cells.start
    for i in rows:
        x, y, r = position[i, 0], position[i, 1], radius[i]
        cell = cell_at(x, y, grid)
        # Most robots are near no static body: they have to be quick.
        clear = start[cell] == start[cell + 1] and (
            bounds[0] + r <= x <= bounds[2] - r and bounds[1] + r <= y <= bounds[3] - r
        )
        free[i] = (clear and is_clear_of_bodies(x, y, movers)) or push_from_statics(i, position, r, statics, contacts)


@compiled(inline=True)
def is_clear_of_bodies(x, y, movers):
    """Return whether no driven body can be touched from a place."""
    if movers is None:
        return True
    start, cell = movers.touch_cells.start, cell_at(x, y, movers.touch_cells.grid)
    return start[cell] == start[cell + 1]


@compiled
def coincident_direction(a, b):
    """Return a unit vector that depends only on two ids, for robots whose centres coincide."""
    azimuth = GOLDEN_ANGLE * (7919 * min(a, b) + max(a, b))
    side = 1.0 if a < b else -1.0
    x, y = direction_of(azimuth)
    return side * x, side * y


@compiled(inline=True)
def note_contact(i, kind, other, nx, ny, depth, contacts):
    """Write a contact of robot i if it is its deepest in this step."""
    if depth > contacts.depth[i]:
        contacts.kind[i] = kind
        contacts.other[i] = other
        contacts.normal[i, 0] = nx
        contacts.normal[i, 1] = ny
        contacts.depth[i] = depth


@compiled(inline=True)
def push_from_statics(i, position, radius, statics, contacts):
    """Move robot i out of static bodies; return whether it is out.

    Deepest overlap first, because the face of a wall that lifts the robot frees it of the corner of the next
    wall, flush with the first: it does not catch on the seam.
    """
    face = contacts.face
    for _ in range(MOST_PUSHES):
        depth, nx, ny, flat, item = deepest_static(position[i, 0], position[i, 1], radius, statics)
        if depth <= SLOP * radius:
            return True
        position[i, 0] += nx * depth
        position[i, 1] += ny * depth
        kind = OBSTACLE if item == BORDER else statics.body[item]
        note_contact(i, kind, BORDER if item == BORDER else statics.owner[item], nx, ny, depth, contacts)
        if flat and depth > face[i, 2]:
            face[i, 0], face[i, 1], face[i, 2] = nx, ny, depth
    return False
