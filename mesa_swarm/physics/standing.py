"""How deep a disc is in what stands still: the border, edges of polygons, discs."""

import math

from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.geometry.grid import cell_index
from mesa_swarm.geometry.overlap import nearest_on_segment
from mesa_swarm.world.statics import BORDER

# A centre nearer to a flat face than this share of its radius is on it, on whichever side rounding puts it: a load
# that comes half a radius towards a robot that goes half a radius towards it.
ON_FACE = 1e-6


@compiled
def deepest_static(x, y, radius, statics):
    """Return depth, normal, flatness and item of the deepest overlap of a disc with what stands still."""
    edges, discs, _, _, bounds, grid, start, items = statics
    deepest, normal_x, normal_y, flat, found = _deepest_border(x, y, radius, bounds)
    left, below, per_unit, columns, rows = grid
    cell = cell_index(x, left, per_unit, columns) + columns * cell_index(y, below, per_unit, rows)
    for k in range(start[cell], start[cell + 1]):
        item = items[k]
        if item < edges.shape[0]:
            depth, nx, ny, face = edge_overlap(x, y, radius, edges, item)
        else:
            depth, nx, ny = disc_overlap(x, y, radius, discs, item - edges.shape[0])
            face = False
        if depth > deepest:
            deepest, normal_x, normal_y, flat, found = depth, nx, ny, face, item
    return deepest, normal_x, normal_y, flat, found


@compiled
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


@compiled
def edge_overlap(x, y, radius, edges, e):
    """Return depth, normal and flatness of the overlap of a disc with edge e, depth 0 if there is none."""
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
    # Right on the edge: away from its solid side, which is on the left.
    length = math.hypot(bx - ax, by - ay)
    nx, ny = (by - ay) / length, (ax - bx) / length
    return radius - (dx * nx + dy * ny), nx, ny, face


@compiled
def disc_overlap(x, y, radius, discs, k):
    """Return depth and normal of the overlap of a disc with standing disc k, depth 0 if there is none."""
    dx, dy = x - discs[k, 0], y - discs[k, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    depth = radius + discs[k, 2] - distance
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    if distance > 0.0:
        return depth, dx / distance, dy / distance
    return depth, 1.0, 0.0
