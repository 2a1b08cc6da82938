"""The room of loads: what they may not overlap, and where they lean on it."""

from typing import NamedTuple, cast

import numpy as np
import shapely

from mesa_swarm.geometry.outlines import (
    Outlines,
    gap_of,
    gap_to_point,
    nearest_points,
    normalize_solid,
    outlines_of,
    place_solid,
)
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.kernels.type_names import Codes, Integers, RealRows, Reals
from mesa_swarm.world.bodies import BodyTable, Form
from mesa_swarm.world.statics import CARRIED, Statics

# What is farther than asked for by this share of a load's thickness need not be measured exactly.
MARGIN = 1e-3
# As NumPy has it: Numba would compile a function once more for each literal.
IS_CARRIED = np.int8(CARRIED)


class Forms(NamedTuple):
    """The forms of loads, see `Form`; each has shape (m,). The squares of levers are those of Python."""

    radius: Reals
    core_radius: Reals
    reach: Reals
    thickness: Reals
    lever: Reals
    lever_square: Reals


class Stops(NamedTuple):
    """Where a load leans on bodies: unit vectors towards it, lever arms about its centre, and its points there.

    `force` and `yielding` are scratch of `loads.free_wrench`.
    """

    x: Reals
    y: Reals
    arm: Reals
    point_x: Reals
    point_y: Reals
    force: Reals
    yielding: Reals


class Poses(NamedTuple):
    """Where all bodies are, columns of `BodyTable`, and the rows of loads and of driven bodies in it."""

    position: RealRows
    heading: Reals
    mode: Codes
    loads: Integers
    driven: Integers


class Room(NamedTuple):
    """All solids that loads may not overlap, and themselves.

    Of `outlines`, the first `still` stand still: edges, the border's first, then discs. The bodies of the `loads`
    follow, then `driven` bodies, then cores and hearts of loads, and at last a line, which stands for the way of a
    body. `near` (still + loads + driven,) is scratch.
    """

    outlines: Outlines
    still: int
    loads: int
    driven: int
    forms: Forms
    near: Integers
    stops: Stops


def room_of(statics: Statics, bodies: BodyTable, pushed: np.ndarray, sent: np.ndarray, rows: np.ndarray) -> Room:
    """Return the room of loads; what stands still is all shapes but those with the indices `pushed` and `sent`."""
    still = ~np.isin(statics.shape, [*pushed, *sent])
    lines = shapely.linestrings(statics.edges[still[: len(statics.edges)]].reshape(-1, 2, 2))
    discs = statics.discs[still[len(statics.edges) :]]
    forms, driven = ([cast(Form, bodies.forms[row]) for row in rows[indices].tolist()] for indices in (pushed, sent))
    # Shapes are in normal form.
    solid_bodies = [shapely.normalize(form.outline) for form in (*forms, *driven)]
    solids = [*lines, *shapely.points(discs[:, :2]), *solid_bodies, *(form.core for form in forms)]
    none = [0.0] * len(forms)
    radius = [*[0.0] * len(lines), *discs[:, 2], *(form.radius for form in (*forms, *driven)), *none, *none]
    # Last a line that stands for the way of a body.
    way = shapely.LineString([(0, 0), (0, 0)])
    outlines = outlines_of([*solids, *(form.heart for form in forms), way], [*radius, 0.0])
    corners = [shapely.get_num_coordinates(form.outline) for form in forms]
    most = len(outlines.points) + len(outlines.solids) * max(corners, default=0)
    return Room(
        outlines=outlines,
        still=len(lines) + len(discs),
        loads=len(forms),
        driven=len(driven),
        forms=Forms(
            radius=np.array([form.radius for form in forms], float),
            core_radius=np.array([form.core_radius for form in forms], float),
            reach=np.array([form.reach for form in forms], float),
            thickness=np.array([form.thickness for form in forms], float),
            lever=np.array([form.lever for form in forms], float),
            lever_square=np.array([form.lever**2 for form in forms], float),
        ),
        near=np.zeros(len(solids), np.int64),
        stops=Stops(*(np.zeros(most) for _ in Stops._fields)),
    )


@compiled
def place_outlines(poses, room):
    """Place the outlines of all loads and driven bodies."""
    for k in range(room.loads):
        row = poses.loads[k]
        place_load(k, poses.position[row, 0], poses.position[row, 1], poses.heading[row], room)
    for b in range(room.driven):
        row = poses.driven[b]
        if poses.mode[row] != IS_CARRIED:
            solid = room.still + room.loads + b
            place_solid(solid, poses.position[row, 0], poses.position[row, 1], poses.heading[row], room.outlines)
            normalize_solid(solid, room.outlines)


@compiled(apart=True)
def place_load(k, x, y, heading, room):
    """Place the outlines of load k: its body, its core and its heart."""
    place_solid(room.still + k, x, y, heading, room.outlines)
    normalize_solid(room.still + k, room.outlines)
    core = room.still + room.loads + room.driven + k
    place_solid(core, x, y, heading, room.outlines)
    place_solid(core + room.loads, x, y, heading, room.outlines)


@compiled
def list_near(k, way, poses, room):
    """List what load k may meet when no point of it moves farther than `way`; return the number of these solids."""
    row = poses.loads[k]
    x, y = poses.position[row, 0], poses.position[row, 1]
    outlines, count = room.outlines, 0
    far = (1.0 + MARGIN) * room.forms.reach[k] + way
    for solid in range(room.still + room.loads + room.driven):
        place = solid - room.still - room.loads
        if solid == room.still + k or (place >= 0 and poses.mode[poses.driven[place]] == IS_CARRIED):
            continue
        # Of a polygon the first ring, around all others.
        ring, reach = outlines.solids[solid], far + outlines.radius[solid]
        x_min, y_min = outlines.boxes[ring, 0] - reach, outlines.boxes[ring, 1] - reach
        if x_min <= x <= outlines.boxes[ring, 2] + reach and y_min <= y <= outlines.boxes[ring, 3] + reach:
            room.near[count] = solid
            count += 1
    return count


@compiled
def is_within(k, solid, distance, room):
    """Return whether a solid is at most this distance from the core of load k, where that is placed."""
    radius = room.outlines.radius[solid]
    core = room.still + room.loads + room.driven + k
    gap = gap_of(core, solid, distance + radius + MARGIN * room.forms.thickness[k], room.outlines)
    # Sums that are equal but for rounding; bits are to stay what they are.
    return gap - radius <= distance if solid < room.still else gap <= distance + radius


@compiled(apart=True)
def has_room(k, x, y, heading, count, room):
    """Return whether load k in a pose overlaps none of the first solids in `room.near` by more than rounding."""
    place_solid(room.still + room.loads + room.driven + k, x, y, heading, room.outlines)
    for n in range(count):
        if is_within(k, room.near[n], room.forms.core_radius[k], room):
            return False
    return True


@compiled(apart=True)
def find_stops(k, distance, count, poses, room):
    """Write the stops of load k and return their number: all that is within a distance of it, of what is near."""
    stop_count = 0
    for n in range(count):
        if is_within(k, room.near[n], room.forms.core_radius[k] + distance, room):
            stop_count = find_stops_on(k, room.near[n], distance, stop_count, poses, room)
    return stop_count


@compiled
def find_stops_on(k, solid, distance, first, poses, room):
    """Write the stops of a load on a solid: corners of either that are this near the other, or the nearest point.

    The direction is that of the line to the load's heart: between bodies that touch it is undefined.
    """
    stops, radius = room.stops, room.outlines.radius[solid]
    heart = room.still + room.loads + room.driven + room.loads + k
    px, py, qx, qy = nearest_points(solid, heart, room.outlines)
    length = hypot(qx - px, qy - py)
    if length == 0.0:
        return first
    last = first
    if room.forms.radius[k] == 0.0:
        last = find_corners(room.still + k, solid, radius + distance, first, last, room)
        last = find_corners(solid, room.still + k, radius + distance, first, last, room)
    if last == first:
        stops.point_x[first], stops.point_y[first] = px, py
        last += 1
    nx, ny = (qx - px) / length, (qy - py) / length
    x, y = poses.position[poses.loads[k], 0], poses.position[poses.loads[k], 1]
    for s in range(first, last):
        ax, ay = stops.point_x[s] - x, stops.point_y[s] - y
        stops.x[s], stops.y[s] = nx, ny
        stops.arm[s] = ax * ny - ay * nx if room.forms.radius[k] == 0.0 else 0.0
    return last


@compiled
def find_corners(a, b, distance, first, last, room):
    """Write the corners of solid a that are within a distance of b, each once, and return where they end."""
    outlines, stops = room.outlines, room.stops
    for place in range(outlines.solids[a], outlines.solids[a + 1]):
        ring = outlines.order[place]
        begin, end = outlines.rings[ring], outlines.rings[ring + 1]
        for v in range(begin, end):
            x, y = outlines.points[v, 0], outlines.points[v, 1]
            if gap_to_point(b, x, y, distance + MARGIN * distance, outlines)[0] <= distance:
                stops.point_x[last], stops.point_y[last] = x, y
                s = first
                while stops.point_x[s] != x or stops.point_y[s] != y:
                    s += 1
                last = max(last, s + 1)
    return last
