"""Exact readings of all sensors of all robots (PHYSICS 3)."""

import math
from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry.grid import CellLists, cell_at, cell_index
from mesa_swarm.geometry.overlap import is_in_polygon, nearest_on_segment
from mesa_swarm.geometry.sector import rays_to_disc, rays_to_segment, sector_to_disc, sector_to_segment
from mesa_swarm.kernels.bits import lowest_bit
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of, hypot
from mesa_swarm.kernels.prefetch import FEWEST_ROWS, fetch_to_read, fetch_to_write
from mesa_swarm.kernels.type_names import CodeRows, Codes, IntegerRows, Integers, RealRows, Reals, RealTables
from mesa_swarm.physics.arcs import recall_direction
from mesa_swarm.physics.crowd import CrowdArrays
from mesa_swarm.physics.driven_bodies import MoverArrays
from mesa_swarm.physics.sector_tables import FAR, LANES, LARGER, groups_of, lanes_at_edge
from mesa_swarm.robots.design import (
    AXIS_X,
    AXIS_Y,
    COS_HALF,
    HALF,
    HOLD,
    MAGNITUDE,
    MOUNT_X,
    MOUNT_Y,
    PERIOD,
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
# Discs near these robots that are noted before sensors look at them: at most, and room for those of a robot.
MOST_FOUND, FOUND_OF_ROBOT = 2048, 16
# A NumPy number: Numba would compile a function once more for a literal one that is passed to it.
NONE = np.int64(0)


class ChunkArrays(NamedTuple):
    """Scratch for the `CHUNK` robots whose readings are made together, row 0 that of the first.

    Directions, designs, and readings so far, those in groups, see `sector_tables`; rows of the discs that were found
    near them; and of those that robots of a design look at, `owner` to `radius`, with where sensors see them.
    """

    axes: RealRows
    designs: Integers
    near: RealTables
    kinds: CodeRows
    found: IntegerRows
    owner: Integers
    hits: Integers
    kind: Codes
    ahead: Reals
    aside: Reals
    radius: Reals
    x: Reals
    y: Reals
    beside: Reals

    @classmethod
    def of(cls, count: int, robots: int) -> "ChunkArrays":
        """Return scratch for robots of at most `count` sensors: of many small worlds, all stays in caches."""
        groups, n = groups_of(count), min(robots, CHUNK)
        m = min(FOUND_OF_ROBOT * (n + 1), MOST_FOUND)
        near, kinds = np.empty((n, groups, LANES)), np.empty((n, LANES * groups), np.int8)
        found, (owner, hits) = np.empty((m, 2), np.int64), np.empty((2, m), np.int64)
        numbers, kind = np.empty((6, m)), np.empty(m, np.int8)
        return cls(np.empty((n, 2)), np.empty(n, np.int64), near, kinds, found, owner, hits, kind, *numbers)


class EyeArrays(NamedTuple):
    """What proximity sensors read, and where they write.

    The largest radius of a robot, and `margin`, the distance within which pairs are listed; columns and tables of the
    swarm, with `table` of `tables_of_sectors` and its clearance; edges, discs, kinds of both and lists as in `Statics`;
    then the columns that are written; and scratch, which no two threads may share.
    """

    largest_radius: float
    margin: float
    heading: Reals
    design: Integers
    sensors: RealTables
    table: RealTables
    clearance: float
    counts: Integers
    reach: Reals
    edges: RealRows
    discs: RealRows
    static_kind: Codes
    sight_cells: CellLists
    distance: RealRows
    kind: CodeRows
    chunk: ChunkArrays


class Radiating(NamedTuple):
    """What radiates heat: rows of the discs and edges of `Statics`, and of the table of bodies.

    Items of what a robot carries are nowhere, and have NaN as coordinates.
    """

    discs: RealRows
    disc_row: Integers
    disc_body: Integers
    edges: RealRows
    edge_row: Integers
    edge_body: Integers
    temperature: Reals


@compiled(nogil=True, apart=True)
def sense_proximity(eyes, crowd, movers, first, last, pairs):
    """Write the readings of robots p in [first, last), without error, -1 where no body is seen; return how many pairs.

    Robots are in the order of cells, see `CrowdArrays`. All is in blocks; `movers` is None without driven bodies.

    In the same search the pairs of robots that come within the margin of each other are written into `pairs`, each from
    the first of the two; where there are more than it has room for, only their number is right.
    """
    count = NONE
    for begin in range(first, last, CHUNK):
        end = min(begin + CHUNK, last)
        _begin_chunk(eyes, crowd, begin, end)
        _fetch_rows(eyes, crowd, begin, end, min(end + CHUNK, last))
        found = _find_statics(eyes, crowd, unpack(eyes, EyeArrays).sight_cells, begin, end, NONE)
        if movers is not None:
            found = _find_statics(eyes, crowd, unpack(movers, MoverArrays).sight_cells, begin, end, found)
        found, count = _find_robots(eyes, crowd, begin, end, found, pairs, count)
        _see_discs(eyes, crowd, begin, found)
        _write_chunk(eyes, crowd, begin, end)
    return count


@compiled
def _begin_chunk(eyes, crowd, begin, end):
    """Begin the readings of some robots with the range of each sensor: nothing farther is seen."""
    e, order, known = unpack(eyes, EyeArrays), unpack(crowd, CrowdArrays).order, unpack(crowd, CrowdArrays).directions
    heading, design, table, axes, designs, near, kinds = (
        e.heading, e.design, e.table, e.chunk.axes, e.chunk.designs, e.chunk.near, e.chunk.kinds
    )  # fmt: skip
    groups = table.shape[0] // e.counts.shape[0]
    for k in range(end - begin):
        i = order[begin + k]
        designs[k] = design[i]
        axes[k, 0], axes[k, 1] = recall_direction(i, heading[i], known)
        for g in range(groups):
            for s in range(LANES):
                near[k, g, s] = table[designs[k] * groups + g, FAR, s]
                kinds[k, LANES * g + s] = NOTHING


@compiled
def _fetch_rows(eyes, crowd, begin, end, end_of_next):
    """Ask for what is written of some robots, and for what is read at the beginning of the next ones."""
    e, c = unpack(eyes, EyeArrays), unpack(crowd, CrowdArrays)
    order, heading, design, directions, distance, kind = (
        c.order, e.heading, e.design, c.directions, e.distance, e.kind
    )  # fmt: skip
    if order.shape[0] < FEWEST_ROWS:
        return
    sensors, readings = distance.shape[1], distance.reshape(distance.size)
    for p in range(begin, end):
        i = order[p]
        fetch_to_write(readings, i * sensors)
        fetch_to_write(readings, i * sensors + sensors - 1)
        fetch_to_write(kind, i)
    for p in range(end, end_of_next):
        i = order[p]
        fetch_to_read(heading, i)
        fetch_to_read(design, i)
        fetch_to_read(directions, i)


@compiled
def _write_chunk(eyes, crowd, begin, end):
    """Write the readings of some robots into their rows."""
    e, order = unpack(eyes, EyeArrays), unpack(crowd, CrowdArrays).order
    near, kinds, distance, kind = e.chunk.near, e.chunk.kinds, e.distance, e.kind
    for k in range(end - begin):
        i = order[begin + k]
        for s in range(distance.shape[1]):
            distance[i, s] = near[k, s // LANES, s % LANES] if kinds[k, s] != NOTHING else -1.0
            kind[i, s] = kinds[k, s]


# Arrays are not passed on inside the loops below: each costs as much as evaluating a sensor.


@compiled(apart=True)
def _find_statics(eyes, crowd, lists, begin, end, m):
    """Update readings by the edges that the cells of some robots list, and note the discs; return how many."""
    e, c = unpack(eyes, EyeArrays), unpack(crowd, CrowdArrays)
    places, radii, axes, designs, reach = c.reference, c.radii, e.chunk.axes, e.chunk.designs, e.reach
    table, sensors, counts, near, kinds = e.table, e.sensors, e.counts, e.chunk.near, e.chunk.kinds
    edges, discs, static_kind, found, clearance = e.edges, e.discs, e.static_kind, e.chunk.found, e.clearance
    grid, start, items = lists.grid, lists.start, lists.items
    groups = table.shape[0] // counts.shape[0]
    for k in range(end - begin):
        x, y, d = places[begin + k, 0], places[begin + k, 1], designs[k]
        cell = cell_at(x, y, grid)
        for place in range(start[cell], start[cell + 1]):
            item = items[place]
            if item >= edges.shape[0]:
                disc = item - edges.shape[0]
                dx, dy = discs[disc, 0] - x, discs[disc, 1] - y
                if m == found.shape[0]:
                    _see_discs(eyes, crowd, begin, m)
                    m = NONE
                found[m, 0], found[m, 1] = k, -1 - disc
                m += dx * dx + dy * dy <= (reach[d] + discs[disc, 2]) ** 2
                continue
            ax, ay = edges[item, 0] - x, edges[item, 1] - y
            bx, by = edges[item, 2] - x, edges[item, 3] - y
            if not (
                is_segment_within(ax, ay, bx, by, reach[d]) and is_line_within(ax, ay, bx, by, reach[d] + clearance)
            ):
                continue
            kind = static_kind[item]
            ax, ay = rotate_into_frame(ax, ay, axes[k, 0], axes[k, 1])
            bx, by = rotate_into_frame(bx, by, axes[k, 0], axes[k, 1])
            for g in range(groups):
                lanes = lanes_at_edge(table, groups * d + g, near, k, g, ax, ay, bx, by, clearance)
                while lanes != 0:
                    lane = lowest_bit(lanes)
                    s = LANES * g + lane
                    lanes &= lanes - 1
                    gap = look_at_segment(
                        ax - sensors[d, s, MOUNT_X], ay - sensors[d, s, MOUNT_Y],
                        bx - sensors[d, s, MOUNT_X], by - sensors[d, s, MOUNT_Y],
                        sensors[d, s, AXIS_X], sensors[d, s, AXIS_Y], sensors[d, s, COS_HALF],
                        sensors[d, s, SIN_HALF], sensors[d, s, HALF], sensors[d, s, RAYS], near[k, g, lane],
                        TOUCH * radii[begin + k],
                    )  # fmt: skip
                    if is_nearest_body(gap, kind, near[k, g, lane], kinds[k, s]):
                        near[k, g, lane], kinds[k, s] = gap, kind
    return m


@compiled(apart=True)
def _find_robots(eyes, crowd, begin, end, m, pairs, count):
    """Note the robots near each of some robots, and list pairs; return the numbers of both."""
    e, c = unpack(eyes, EyeArrays), unpack(crowd, CrowdArrays)
    places, radii, designs, reach, start, found = c.reference, c.radii, e.chunk.designs, e.reach, c.start, e.chunk.found
    margin, largest_radius = e.margin, e.largest_radius
    left, below, per_unit, columns, rows = c.grid
    room, most = pairs.shape[0] - 1, found.shape[0]
    for k in range(end - begin):
        p, sight = begin + k, reach[designs[k]]
        x, y, r = places[p, 0], places[p, 1], radii[p]
        far = max(sight, r + margin) + largest_radius
        first = cell_index(x - far, left, per_unit, columns)
        last = cell_index(x + far, left, per_unit, columns)
        lowest = cell_index(y - far, below, per_unit, rows)
        highest = cell_index(y + far, below, per_unit, rows)
        for row in range(lowest, highest + 1):
            item, end_of_row = start[first + columns * row], start[last + columns * row + 1]
            while item < end_of_row:
                stop = min(end_of_row, item + most)
                if m + stop - item > most:
                    _see_discs(eyes, crowd, begin, m)
                    m = NONE
                for q in range(item, stop):
                    dx, dy = places[q, 0] - x, places[q, 1] - y
                    square, near_by = dx * dx + dy * dy, r + radii[q] + margin
                    # Without branches, which no processor could foresee: what does not count is written over.
                    found[m, 0], found[m, 1] = k, q
                    m += (square <= (sight + radii[q]) ** 2) & (q != p)
                    place = min(count, room)
                    pairs[place, 0], pairs[place, 1] = p, q
                    count += (square < near_by * near_by) & (q > p)
                item = stop
    return m, count


@compiled(apart=True)
def _see_discs(eyes, crowd, begin, m):
    """Update the readings of some robots by the m discs that were found near them: robots, or -1 - k for disc k.

    Sensor by sensor, first the discs that are beside its sector or beyond its range are sorted out, in a loop without
    branches: most are.
    """
    e, c, room = unpack(eyes, EyeArrays), unpack(crowd, CrowdArrays), unpack(eyes, EyeArrays).chunk
    places, radii, axes, designs, found = c.reference, c.radii, room.axes, room.designs, room.found
    sensors, counts, near, kinds = e.sensors, e.counts, room.near, room.kinds
    discs, disc_kind = e.discs, e.static_kind[e.edges.shape[0] :]
    owner, kind, hits, ahead, aside = room.owner, room.kind, room.hits, room.ahead, room.aside
    radius, x, y, beside = room.radius, room.x, room.y, room.beside
    for d in range(counts.shape[0]):
        n = 0
        for f in range(m):
            k, q = found[f, 0], found[f, 1]
            px, py = places[begin + k, 0], places[begin + k, 1]
            if q >= 0:
                dx, dy, radius[n], kind[n] = places[q, 0] - px, places[q, 1] - py, radii[q], ROBOT
            else:
                q = -1 - q
                dx, dy, radius[n], kind[n] = discs[q, 0] - px, discs[q, 1] - py, discs[q, 2], disc_kind[q]
            owner[n] = k
            ahead[n], aside[n] = rotate_into_frame(dx, dy, axes[k, 0], axes[k, 1])
            n += designs[k] == d
        for s in range(counts[d]):
            g, lane = s // LANES, s % LANES
            mount_x, mount_y, ux, uy = (
                sensors[d, s, MOUNT_X], sensors[d, s, MOUNT_Y], sensors[d, s, AXIS_X], sensors[d, s, AXIS_Y],
            )  # fmt: skip
            cos_half, sin_half, far = sensors[d, s, COS_HALF], sensors[d, s, SIN_HALF], sensors[d, s, RANGE]
            half, rays = sensors[d, s, HALF], int(sensors[d, s, RAYS])
            # A sector of more than half a circle has no side that could be sorted out.
            wide = math.inf if cos_half < 0.0 else 0.0
            for f in range(n):
                x[f], y[f] = rotate_into_frame(ahead[f] - mount_x, aside[f] - mount_y, ux, uy)
                side = max(abs(y[f]) * cos_half - x[f] * sin_half, -x[f]) - (radius[f] + wide)
                beyond = x[f] * x[f] + y[f] * y[f] - (far + radius[f]) ** 2
                beside[f] = max(side, beyond)
            count = 0
            for f in range(n):
                hits[count] = f
                count += beside[f] <= 0.0
            for f in hits[:count]:
                k = owner[f]
                if rays > 0:
                    gap = rays_to_disc(x[f], y[f], radius[f], half, rays, near[k, g, lane])
                else:
                    gap = sector_to_disc(x[f], y[f], radius[f], cos_half, sin_half, near[k, g, lane])
                if is_nearest_body(gap, kind[f], near[k, g, lane], kinds[k, s]):
                    near[k, g, lane], kinds[k, s] = gap, kind[f]


@compiled
def rotate_into_frame(x, y, axis_x, axis_y):
    """Return a vector in a frame whose x axis is the unit vector (axis_x, axis_y)."""
    return axis_x * x + axis_y * y, axis_x * y - axis_y * x


@compiled
def is_segment_within(ax, ay, bx, by, far):
    """Return whether the box around a segment meets a square of half side `far` about the origin."""
    return min(ax, bx) <= far and max(ax, bx) >= -far and min(ay, by) <= far and max(ay, by) >= -far


@compiled
def is_line_within(ax, ay, bx, by, far):
    """Return whether the line through a segment comes within `far` of the origin, or by rounding might."""
    dx, dy = bx - ax, by - ay
    across = ax * dy - ay * dx
    return not across * across > LARGER * far * far * (dx * dx + dy * dy)


@compiled
def look_at_segment(ax, ay, bx, by, axis_x, axis_y, cos_half, sin_half, half, rays, limit, touch):
    """Return the distance of an edge, relative to the sensor's mount, within its sector, `inf` if outside.

    A sensor just behind the edge, on its solid side, reads 0: it is on the rim of a robot that touches a wall.
    """
    if is_just_behind(ax, ay, bx, by, touch):
        return 0.0
    ax, ay = rotate_into_frame(ax, ay, axis_x, axis_y)
    bx, by = rotate_into_frame(bx, by, axis_x, axis_y)
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
def is_nearest_body(gap, body_kind, distance, kind):
    """Return whether this is the nearest so far; of equally near bodies the lowest kind, independent of order."""
    return gap < distance or (gap == distance and (kind == NOTHING or body_kind < kind))


@compiled
def sense_inside(position, heading, design, sensors, counts, edges, edge_kind, rings, bounds, distance, kind):
    """Write 0 for the sensors that are inside a solid polygon or beyond the border."""
    for i in range(position.shape[0]):
        d = design[i]
        cosine, sine = direction_of(heading[i])
        for s in range(counts[d]):
            mx, my = sensors[d, s, MOUNT_X], sensors[d, s, MOUNT_Y]
            x = position[i, 0] + cosine * mx - sine * my
            y = position[i, 1] + sine * mx + cosine * my
            if not (bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]):
                distance[i, s], kind[i, s] = 0.0, OBSTACLE
            for p in range(rings.shape[0]):
                body_kind = edge_kind[rings[p, 0]]
                nearest = math.inf if kind[i, s] == NOTHING else distance[i, s]
                nearer = is_nearest_body(0.0, body_kind, nearest, kind[i, s])
                if nearer and is_in_polygon(x, y, edges, rings[p, 0], rings[p, 1]):
                    distance[i, s], kind[i, s] = 0.0, body_kind


@compiled
def add_errors(distance, design, sensors, noise, draws, step, error):
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
def hold_readings(moment, design, noise, old_distance, old_kind, distance, kind):
    """Put back the old readings of sensors that are not due in this step: those whose period does not divide it."""
    for i in range(distance.shape[0]):
        for s in range(distance.shape[1]):
            if moment % max(int(noise[design[i], s, PERIOD]), 1) != 0:
                distance[i, s], kind[i, s] = old_distance[i, s], old_kind[i, s]


@compiled
def sense_radiation(position, heading, design, sensors, radiating, radiation):
    """Write the highest temperature among what radiates in each radiation sensor's sector, cold things having 0.

    `radiating` are the numbers of a block of `Radiating`.
    """
    heat = unpack(radiating, Radiating)
    for i in range(position.shape[0]):
        d = design[i]
        cosine, sine = direction_of(heading[i])
        pose = position[i, 0], position[i, 1], cosine, sine
        for s in range(radiation.shape[1]):
            radiation[i, s] = 0.0
            if sensors[d, s, RANGE] >= 0.0:
                sense_hot_discs(i, s, pose, sensors[d, s], heat, radiation)
                sense_hot_edges(i, s, pose, sensors[d, s], heat, radiation)


@compiled
def sense_hot_discs(i, s, pose, sensor, heat, radiation):
    """Raise a reading of robot i to the highest temperature among the discs in the sensor's sector."""
    for k in range(heat.disc_row.shape[0]):
        disc, temperature = heat.disc_row[k], heat.temperature[heat.disc_body[k]]
        if temperature > radiation[i, s]:
            x, y = place_in_sensor(heat.discs[disc, 0], heat.discs[disc, 1], pose, sensor)
            limits = sensor[COS_HALF], sensor[SIN_HALF], sensor[RANGE]
            if sector_to_disc(x, y, heat.discs[disc, 2], *limits) < math.inf:
                radiation[i, s] = temperature


@compiled
def sense_hot_edges(i, s, pose, sensor, heat, radiation):
    """Raise a reading of robot i to the highest temperature among the edges in the sensor's sector."""
    for k in range(heat.edge_row.shape[0]):
        edge, temperature = heat.edge_row[k], heat.temperature[heat.edge_body[k]]
        if temperature > radiation[i, s]:
            ax, ay = place_in_sensor(heat.edges[edge, 0], heat.edges[edge, 1], pose, sensor)
            bx, by = place_in_sensor(heat.edges[edge, 2], heat.edges[edge, 3], pose, sensor)
            limits = sensor[COS_HALF], sensor[SIN_HALF], sensor[RANGE]
            if sector_to_segment(ax, ay, bx, by, *limits) < math.inf:
                radiation[i, s] = temperature


@compiled
def place_in_sensor(x, y, pose, sensor):
    """Return a point of the world in the frame of a sensor; `pose` is x, y, cosine and sine of the robot's heading."""
    robot_x, robot_y, cosine, sine = pose
    dx, dy = x - robot_x, y - robot_y
    ahead = cosine * dx + sine * dy - sensor[MOUNT_X]
    left = cosine * dy - sine * dx - sensor[MOUNT_Y]
    ux, uy = sensor[AXIS_X], sensor[AXIS_Y]
    return ahead * ux + left * uy, left * ux - ahead * uy


@compiled
def sense_line(position, heading, design, mounts, marks, rings, discs, line):
    """Write whether each line sensor is over a mark on the ground, a polygon or one of `discs` (x, y, radius).

    `marks` are the edges of the polygons and `rings` the rows of each, as in `Statics`.
    """
    for i in range(position.shape[0]):
        d = design[i]
        cosine, sine = direction_of(heading[i])
        for s in range(line.shape[1]):
            mx, my = mounts[d, s, 0], mounts[d, s, 1]
            x = position[i, 0] + cosine * mx - sine * my
            y = position[i, 1] + sine * mx + cosine * my
            line[i, s] = False
            for p in range(rings.shape[0]):
                if is_in_polygon(x, y, marks, rings[p, 0], rings[p, 1]):
                    line[i, s] = True
            for k in range(discs.shape[0]):
                if hypot(x - discs[k, 0], y - discs[k, 1]) <= discs[k, 2]:
                    line[i, s] = True
