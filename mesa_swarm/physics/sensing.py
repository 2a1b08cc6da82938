"""Exact readings of all sensors of all robots (PHYSICS 3)."""

import math

import numpy as np

from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.geometry.grid import cell_index
from mesa_swarm.geometry.overlap import in_polygon, nearest_on_segment
from mesa_swarm.geometry.sector import rays_to_disc, rays_to_segment, sector_to_disc, sector_to_segment
from mesa_swarm.robots.design import (
    AXIS_X,
    AXIS_Y,
    COS_HALF,
    HALF,
    HOLD,
    MAGNITUDE,
    MOUNT_X,
    MOUNT_Y,
    PROBABILITY,
    RANGE,
    RAYS,
    SIN_HALF,
)
from mesa_swarm.world.statics import NOTHING, OBSTACLE, ROBOT

# How far, in radii, contact may leave the rim inside a wall.
TOUCH = 1e-6
# How near to its face, in shares of that, a sensor is on it.
ROUNDING = 1e-3
# Robots whose readings are made together: few enough to stay in the nearest cache.
CHUNK = 128


@compiled(nogil=True)
def sense_proximity(
    first, last, order, places, radii, largest_radius, margin, grid, start, heading, design, sensors, counts, reach,
    edges, discs, static_kind, static_grid, seen_start, seen_items, moving, distance, kind, pairs,
):  # fmt: skip
    """Write the readings of robots p in [first, last), without error, -1 where no body is seen; return how many pairs.

    Robots are in the order of cells, see `Crowd`: robot p is in row ``order[p]`` of the columns, at ``places[p]``, and
    cell c holds those from ``start[c]`` on. For `edges` and so on see `Statics`; `moving` is `Moving.seen`, or None.

    In the same search the pairs of robots that come within `margin` of each other are written into `pairs`, each from
    the first of the two; where there are more than it has room for, only their number is right.
    """
    s = distance.shape[1]
    near, what = np.empty((CHUNK, s)), np.empty((CHUNK, s), np.int8)
    axes, designs = np.empty((CHUNK, 2)), np.empty(CHUNK, np.int64)
    seen = np.empty(len(order), np.int64)
    count = 0
    for begin in range(first, last, CHUNK):
        end = min(begin + CHUNK, last)
        _begin_chunk(begin, end, order, heading, design, sensors, counts, axes, designs, near, what)
        _see_statics(
            begin, end, places, axes, radii, designs, sensors, counts, reach, edges, discs, static_kind, static_grid,
            seen_start, seen_items, near, what,
        )  # fmt: skip
        if moving is not None:
            moving_grid, moving_start, moving_items = moving
            _see_statics(
                begin, end, places, axes, radii, designs, sensors, counts, reach, edges, discs, static_kind,
                moving_grid, moving_start, moving_items, near, what,
            )  # fmt: skip
        count = _see_robots(
            begin, end, places, axes, radii, largest_radius, margin, designs, sensors, counts, reach, grid, start, seen,
            near, what, pairs, count,
        )  # fmt: skip
        _write_chunk(begin, end, order, near, what, distance, kind)
    return count


@compiled
def _begin_chunk(begin, end, order, heading, design, sensors, counts, axes, designs, near, what):
    """Begin the readings of some robots with the range of each sensor: nothing farther is seen."""
    for k in range(end - begin):
        i = order[begin + k]
        designs[k] = design[i]
        axes[k, 0], axes[k, 1] = math.cos(heading[i]), math.sin(heading[i])
        for s in range(near.shape[1]):
            near[k, s] = sensors[designs[k], s, RANGE]
            what[k, s] = NOTHING


@compiled
def _write_chunk(begin, end, order, near, what, distance, kind):
    """Write the readings of some robots into their rows."""
    for k in range(end - begin):
        i = order[begin + k]
        for s in range(near.shape[1]):
            distance[i, s] = near[k, s] if what[k, s] != NOTHING else -1.0
            kind[i, s] = what[k, s]


# Arrays are not passed on inside the loops below: each costs as much as evaluating a sensor.


@compiled
def _see_statics(
    begin, end, places, axes, radii, designs, sensors, counts, reach, edges, discs, static_kind, grid, start, items,
    near, what,
):  # fmt: skip
    """Update the readings of some robots by the edges and discs that their cells list."""
    left, below, per_unit, columns, rows = grid
    for k in range(end - begin):
        x, y, d = places[begin + k, 0], places[begin + k, 1], designs[k]
        cell = cell_index(x, left, per_unit, columns) + columns * cell_index(y, below, per_unit, rows)
        for place in range(start[cell], start[cell + 1]):
            item = items[place]
            kind = static_kind[item]
            if item < edges.shape[0]:
                ax, ay = edges[item, 0] - x, edges[item, 1] - y
                bx, by = edges[item, 2] - x, edges[item, 3] - y
                if not segment_within(ax, ay, bx, by, reach[d]):
                    continue
                ax, ay = into_frame(ax, ay, axes[k, 0], axes[k, 1])
                bx, by = into_frame(bx, by, axes[k, 0], axes[k, 1])
                for s in range(counts[d]):
                    seen = look_at_segment(
                        ax - sensors[d, s, MOUNT_X], ay - sensors[d, s, MOUNT_Y],
                        bx - sensors[d, s, MOUNT_X], by - sensors[d, s, MOUNT_Y],
                        sensors[d, s, AXIS_X], sensors[d, s, AXIS_Y], sensors[d, s, COS_HALF],
                        sensors[d, s, SIN_HALF], sensors[d, s, HALF], sensors[d, s, RAYS], near[k, s],
                        TOUCH * radii[begin + k],
                    )  # fmt: skip
                    if is_nearer(seen, kind, near[k, s], what[k, s]):
                        near[k, s], what[k, s] = seen, kind
            else:
                disc = item - edges.shape[0]
                dx, dy = discs[disc, 0] - x, discs[disc, 1] - y
                if dx * dx + dy * dy > (reach[d] + discs[disc, 2]) ** 2:
                    continue
                dx, dy = into_frame(dx, dy, axes[k, 0], axes[k, 1])
                for s in range(counts[d]):
                    seen = look_at_disc(
                        dx - sensors[d, s, MOUNT_X], dy - sensors[d, s, MOUNT_Y], discs[disc, 2],
                        sensors[d, s, AXIS_X], sensors[d, s, AXIS_Y], sensors[d, s, COS_HALF],
                        sensors[d, s, SIN_HALF], sensors[d, s, HALF], sensors[d, s, RAYS], near[k, s],
                    )  # fmt: skip
                    if is_nearer(seen, kind, near[k, s], what[k, s]):
                        near[k, s], what[k, s] = seen, kind


@compiled
def _see_robots(
    begin, end, places, axes, radii, largest_radius, margin, designs, sensors, counts, reach, grid, start, seen_robots,
    near, what, pairs, count,
):  # fmt: skip
    """Update the readings of some robots by the others near them, and list pairs; return how many are listed."""
    left, below, per_unit, columns, rows = grid
    room = pairs.shape[0] - 1
    for k in range(end - begin):
        p, d = begin + k, designs[k]
        x, y, r = places[p, 0], places[p, 1], radii[p]
        far = max(reach[d], r + margin) + largest_radius
        first = cell_index(x - far, left, per_unit, columns)
        last = cell_index(x + far, left, per_unit, columns)
        lowest = cell_index(y - far, below, per_unit, rows)
        highest = cell_index(y + far, below, per_unit, rows)
        found = 0
        for row in range(lowest, highest + 1):
            for q in range(start[first + columns * row], start[last + columns * row + 1]):
                dx, dy = places[q, 0] - x, places[q, 1] - y
                square, near_by = dx * dx + dy * dy, r + radii[q] + margin
                # Without branches, which no processor could foresee: what does not count is written over.
                seen_robots[found] = q
                found += (square <= (reach[d] + radii[q]) ** 2) & (q != p)
                here = min(count, room)
                pairs[here, 0], pairs[here, 1] = p, q
                count += (square < near_by * near_by) & (q > p)
        for place in range(found):
            q = seen_robots[place]
            dx, dy = into_frame(places[q, 0] - x, places[q, 1] - y, axes[k, 0], axes[k, 1])
            for s in range(counts[d]):
                seen = look_at_disc(
                    dx - sensors[d, s, MOUNT_X], dy - sensors[d, s, MOUNT_Y], radii[q],
                    sensors[d, s, AXIS_X], sensors[d, s, AXIS_Y], sensors[d, s, COS_HALF],
                    sensors[d, s, SIN_HALF], sensors[d, s, HALF], sensors[d, s, RAYS], near[k, s],
                )  # fmt: skip
                if is_nearer(seen, ROBOT, near[k, s], what[k, s]):
                    near[k, s], what[k, s] = seen, ROBOT
    return count


@compiled
def into_frame(x, y, axis_x, axis_y):
    """Return a vector in a frame whose x axis is the unit vector (axis_x, axis_y)."""
    return axis_x * x + axis_y * y, axis_x * y - axis_y * x


@compiled
def segment_within(ax, ay, bx, by, far):
    """Return whether the box around a segment meets a square of half side `far` about the origin."""
    return min(ax, bx) <= far and max(ax, bx) >= -far and min(ay, by) <= far and max(ay, by) >= -far


@compiled
def look_at_disc(x, y, radius, axis_x, axis_y, cos_half, sin_half, half, rays, limit):
    """Return the distance of a disc, relative to the sensor's mount, within its sector, `inf` if outside."""
    x, y = into_frame(x, y, axis_x, axis_y)
    if rays > 0.0:
        return rays_to_disc(x, y, radius, half, int(rays), limit)
    return sector_to_disc(x, y, radius, cos_half, sin_half, limit)


@compiled
def look_at_segment(ax, ay, bx, by, axis_x, axis_y, cos_half, sin_half, half, rays, limit, touch):
    """Return the distance of an edge, relative to the sensor's mount, within its sector, `inf` if outside.

    A sensor just behind the edge, on its solid side, reads 0: it is on the rim of a robot that touches a wall.
    """
    if is_just_behind(ax, ay, bx, by, touch):
        return 0.0
    ax, ay = into_frame(ax, ay, axis_x, axis_y)
    bx, by = into_frame(bx, by, axis_x, axis_y)
    if rays > 0.0:
        return rays_to_segment(ax, ay, bx, by, half, int(rays), limit)
    return sector_to_segment(ax, ay, bx, by, cos_half, sin_half, limit)


@compiled
def is_just_behind(ax, ay, bx, by, touch):
    """Return whether the origin is on the left of the edge a-b and at most `touch` away, or on it.

    An origin in front of the edge by rounding alone counts as on it: the direction of the foot is arbitrary there.
    """
    side = ax * by - bx * ay
    dx, dy = bx - ax, by - ay
    touch = touch if side > 0.0 else ROUNDING * touch
    if side * side > touch * touch * (dx * dx + dy * dy):
        return False
    x, y, _ = nearest_on_segment(0.0, 0.0, ax, ay, bx, by)
    return x * x + y * y <= touch * touch


@compiled
def is_nearer(seen, what, distance, kind):
    """Return whether this is the nearest so far; of equally near bodies the lowest kind, independent of order."""
    return seen < distance or (seen == distance and (kind == NOTHING or what < kind))


@compiled
def sense_inside(position, heading, design, sensors, counts, edges, edge_kind, rings, bounds, distance, kind):
    """Write 0 for the sensors that are inside a solid polygon or beyond the border."""
    for i in range(position.shape[0]):
        d = design[i]
        cosine, sine = math.cos(heading[i]), math.sin(heading[i])
        for s in range(counts[d]):
            mx, my = sensors[d, s, MOUNT_X], sensors[d, s, MOUNT_Y]
            x = position[i, 0] + cosine * mx - sine * my
            y = position[i, 1] + sine * mx + cosine * my
            if not (bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]):
                distance[i, s], kind[i, s] = 0.0, OBSTACLE
            for p in range(rings.shape[0]):
                what = edge_kind[rings[p, 0]]
                nearest = math.inf if kind[i, s] == NOTHING else distance[i, s]
                nearer = is_nearer(0.0, what, nearest, kind[i, s])
                if nearer and in_polygon(x, y, edges, rings[p, 0], rings[p, 1]):
                    distance[i, s], kind[i, s] = 0.0, what


@compiled
def err(distance, design, sensors, noise, draws, step, error):
    """Disturb readings: with probability p a distance d becomes d (1 +- magnitude), within [0, range]; -1 stays -1.

    Of `draws`, uniform in [0, 1), those below p / 2 subtract, and from there to p add. The relative error is drawn anew
    in steps that `hold` divides, and held in `error` meanwhile.
    """
    for i in range(distance.shape[0]):
        d = design[i]
        for s in range(distance.shape[1]):
            if step % max(int(noise[d, s, HOLD]), 1) == 0:
                error[i, s] = 0.0
                if draws[i, s] < noise[d, s, PROBABILITY]:
                    subtract = draws[i, s] < noise[d, s, PROBABILITY] / 2.0
                    error[i, s] = -noise[d, s, MAGNITUDE] if subtract else noise[d, s, MAGNITUDE]
            if distance[i, s] >= 0.0 and error[i, s] != 0.0:
                wrong = distance[i, s] * (1.0 + error[i, s])
                distance[i, s] = min(max(wrong, 0.0), sensors[d, s, RANGE])


@compiled
def sense_radiation(position, heading, design, sensors, sources, temperature, radiation):
    """Write the highest temperature among the sources of heat (x, y, radius) in each radiation sensor's sector.

    A cold one has the temperature 0.
    """
    for i in range(position.shape[0]):
        d = design[i]
        cosine, sine = math.cos(heading[i]), math.sin(heading[i])
        for s in range(radiation.shape[1]):
            radiation[i, s] = 0.0
            for f in range(sources.shape[0]):
                if temperature[f] <= radiation[i, s] or sensors[d, s, RANGE] < 0.0:
                    continue
                dx, dy = sources[f, 0] - position[i, 0], sources[f, 1] - position[i, 1]
                x = cosine * dx + sine * dy - sensors[d, s, MOUNT_X]
                y = cosine * dy - sine * dx - sensors[d, s, MOUNT_Y]
                ux, uy = sensors[d, s, AXIS_X], sensors[d, s, AXIS_Y]
                seen = sector_to_disc(
                    x * ux + y * uy, y * ux - x * uy, sources[f, 2],
                    sensors[d, s, COS_HALF], sensors[d, s, SIN_HALF], sensors[d, s, RANGE],
                )  # fmt: skip
                if seen < math.inf:
                    radiation[i, s] = temperature[f]


@compiled
def sense_line(position, heading, design, mounts, marks, rings, discs, line):
    """Write whether each line sensor is over a mark on the ground, a polygon or one of `discs` (x, y, radius).

    `marks` are the edges of the polygons and `rings` the rows of each, as in `Statics`.
    """
    for i in range(position.shape[0]):
        d = design[i]
        cosine, sine = math.cos(heading[i]), math.sin(heading[i])
        for s in range(line.shape[1]):
            mx, my = mounts[d, s, 0], mounts[d, s, 1]
            x = position[i, 0] + cosine * mx - sine * my
            y = position[i, 1] + sine * mx + cosine * my
            line[i, s] = False
            for p in range(rings.shape[0]):
                if in_polygon(x, y, marks, rings[p, 0], rings[p, 1]):
                    line[i, s] = True
            for k in range(discs.shape[0]):
                if math.hypot(x - discs[k, 0], y - discs[k, 1]) <= discs[k, 2]:
                    line[i, s] = True
