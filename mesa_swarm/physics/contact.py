"""Moving in pieces, pushing apart, restoring, and the contacts of a step as arrays.

A step is cut into pieces of at most half a radius. After each, robots that overlap are pushed apart, half the
overlap each, all at once (independent of order), then out of static bodies, deepest overlap first. Robots that
still overlap after `MOST_SWEEPS` rounds (in a narrow wedge, in a jam) return to where they were before the piece,
and so do those that then overlap them, until no two do. Driven bodies move in the same pieces before the robots do;
robots are pushed out of their way, and where one cannot leave, the body returns as well and has to stop.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.geometry.grid import cell_index, sort_into_cells
from mesa_swarm.geometry.overlap import in_polygon, nearest_on_segment, wrapped
from mesa_swarm.physics.motion import advance, copy_places, count_pieces
from mesa_swarm.physics.moving import advance_bodies, count_body_pieces, return_bodies
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import BORDER, OBSTACLE, ROBOT

# A centre nearer to a flat face than this share of its radius is on it, on whichever side rounding puts it: a load
# that comes half a radius towards a robot that goes half a radius towards it.
ON_FACE = 1e-6
# Overlaps below this share of the radius are rounding. A tenth of what is promised.
SLOP = 1e-7
# NumPy's numbers: Numba would compile a function once more for each literal one that is passed to it.
MOST_SWEEPS, A_ROBOT = np.int64(128), np.int64(ROBOT)
MOST_PUSHES = 12
# Pairs nearer than this share of the least radius are watched while pushing.
MARGIN = 1.0
# Directions of coincident centres: far apart for neighbouring ids.
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@compiled
def deepest_static(x, y, radius, statics):
    """Return depth, normal, flatness and item of the deepest overlap of a disc with static bodies."""
    edges, discs, _, _, bounds, grid, start, items, movers = statics
    found = deepest_listed(x, y, radius, edges, discs, grid, start, items, _deepest_border(x, y, radius, bounds))
    return deepest_moving(x, y, radius, edges, discs, movers, found)


@compiled
def deepest_moving(x, y, radius, edges, discs, movers, found):
    """Return the deepest overlap with driven bodies if it is deeper than what was found."""
    if movers is None:
        return found
    grid, start, items, _ = movers[5]
    return deepest_listed(x, y, radius, edges, discs, grid, start, items, found)


@compiled
def deepest_listed(x, y, radius, edges, discs, grid, start, items, deepest_found):
    """Return the deepest overlap with the items that a grid lists if it is deeper than what was found."""
    deepest, normal_x, normal_y, flat, found = deepest_found
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
    length = math.hypot(bx - ax, by - ay)
    nx, ny = (by - ay) / length, (ax - bx) / length
    return radius - (dx * nx + dy * ny), nx, ny, face


@compiled
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
        ids = [
            -1 if i == BORDER else others.get(k, bodies)[i].unique_id
            for k, i in zip(kind.tolist(), index.tolist(), strict=True)
        ]
        return cls(
            robot=np.array([swarm.agents[row].unique_id for row in rows], np.int64),
            kind=kind,
            other=np.array(ids, np.int64),
            normal=swarm.contact_normal[rows],
            depth=swarm.contact_depth[rows],
        )


@compiled
def travel(
    position, heading, motion, radius, number, turn_angle, grid, statics,
    collided, contact_kind, contact_index, contact_normal, contact_depth, extra_turn,
):  # fmt: skip
    """Move all robots through one step, resolve every contact, and write the contact columns.

    `position` (n, 2) and `heading` are changed; `motion` (n, 3) is the one that the wheels would make, along the body.

    A robot whose travel is farther than `turn_angle` (rad) from a flat face's normal is turned along the face;
    `extra_turn` becomes the turn that faces added. Ids, `number`, decide in which directions coincident centres part.
    The cells of `grid`, see `Grid.numbers`, are at least 2 r + margin wide. `statics` are edges, discs, owner, body,
    bounds, grid numbers, touched_start and touched_items, and `Moving.numbers` or None; see there for how bodies move.
    """
    contact_kind[:] = -1
    contact_index[:] = -1
    contact_normal[:] = 0.0
    contact_depth[:] = 0.0
    extra_turn[:] = 0.0
    before = np.empty_like(position)
    face = np.empty((len(position), 3))
    free = np.empty(len(position), np.bool_)
    pieces = count_body_pieces(count_pieces(motion, radius), radius, statics[8])
    for piece in range(pieces):
        copy_places(position, before)
        face[:] = 0.0
        advance_bodies(piece, pieces, radius, statics[8], statics[0], statics[1])
        stop_jumps(position, radius, statics[0], statics[1], statics[8])
        advance(position, heading, motion, pieces)
        contacts = (contact_kind, contact_index, contact_normal, contact_depth, face)
        settled, listed, pairs = separate(position, radius, number, grid, statics, contacts, free, MOST_SWEEPS)
        if not settled:
            put_back(position, before, radius, grid, statics, contacts, free, listed, pairs)
        turn_along_faces(heading, motion, face, turn_angle, extra_turn)
    for i in range(len(collided)):
        collided[i] = contact_depth[i] > 0.0


@compiled
def separate(position, radius, number, grid, statics, contacts, free, most_sweeps):
    """Push until no two bodies overlap, at most `most_sweeps` times, and return whether that succeeded.

    Whether each robot is clear of all static bodies is written into `free` (n,). Also returned: the positions by
    which pairs of robots near each other were listed, and the pairs.
    """
    n = position.shape[0]
    margin = MARGIN * radius.min() if n else 0.0
    moved = np.empty(n, np.int64)
    push_all_from_statics(np.arange(n), position, radius, statics, contacts, free)
    pairs = near_pairs(position, radius, margin, grid)
    listed = position.copy()
    push = np.zeros((n, 2))
    # Only robots that were moved in the last sweep, and their neighbours, can overlap anything now.
    awake = np.ones(n, np.bool_)
    met = np.empty(pairs.shape[0], np.int64)
    for _ in range(most_sweeps):
        overlaps = push_pairs(position, radius, number, pairs, awake, push, contacts, met)
        if overlaps == 0:
            return free.all(), listed, pairs
        count = apply_pushes(position, push, radius, pairs, met[:overlaps], awake, moved)
        push_all_from_statics(moved[:count], position, radius, statics, contacts, free)
        if 2.0 * farthest_from(listed, position, moved[:count]) > margin:
            pairs = near_pairs(position, radius, margin, grid)
            met = np.empty(pairs.shape[0], np.int64)
            copy_places(position, listed)
            awake[:] = True
    return False, listed, pairs


@compiled
def push_all_from_statics(rows, position, radius, statics, contacts, free):
    """Move the robots in these rows out of static bodies, and write for which ones that was possible."""
    bounds, grid, start, movers = statics[4], statics[5], statics[6], statics[8]
    left, below, per_unit, columns, lines = grid
    for i in rows:
        x, y, r = position[i, 0], position[i, 1], radius[i]
        cell = cell_index(x, left, per_unit, columns) + columns * cell_index(y, below, per_unit, lines)
        # Most robots are near no static body: they have to be quick.
        clear = start[cell] == start[cell + 1] and (
            bounds[0] + r <= x <= bounds[2] - r and bounds[1] + r <= y <= bounds[3] - r
        )
        free[i] = (clear and no_body_near(x, y, movers)) or push_from_statics(i, position, r, statics, contacts)


@compiled
def no_body_near(x, y, movers):
    """Return whether no driven body can be touched from a place."""
    if movers is None:
        return True
    (left, below, per_unit, columns, lines), start, _, _ = movers[5]
    cell = cell_index(x, left, per_unit, columns) + columns * cell_index(y, below, per_unit, lines)
    return start[cell] == start[cell + 1]


@compiled
def farthest_from(listed, position, moved):
    """Return the largest distance of the robots that were moved from where they were listed."""
    square = 0.0
    for i in moved:
        dx, dy = position[i, 0] - listed[i, 0], position[i, 1] - listed[i, 1]
        square = max(square, dx * dx + dy * dy)
    return math.sqrt(square)


@compiled
def apply_pushes(position, push, radius, pairs, met, awake, moved):
    """Push all robots at once, each at most a quarter of its radius; return the count of rows ``moved[:count]``."""
    count = 0
    awake[:] = False
    for k in met:
        for side in range(2):
            i = pairs[k, side]
            if push[i, 0] == 0.0 and push[i, 1] == 0.0:
                continue
            length = math.hypot(push[i, 0], push[i, 1])
            share = min(1.0, 0.25 * radius[i] / length)
            position[i, 0] += share * push[i, 0]
            position[i, 1] += share * push[i, 1]
            push[i, 0], push[i, 1] = 0.0, 0.0
            awake[i] = True
            moved[count] = i
            count += 1
    return count


@compiled
def near_pairs(position, radius, margin, grid):
    """Return the pairs (i, j) of robots that overlap or come within `margin` of it."""
    n = position.shape[0]
    x, y, per_unit, columns, rows = grid
    start = np.zeros(columns * rows + 1, np.int64)
    order = np.empty(n, np.int64)
    cell_of = np.empty(n, np.int64)
    sort_into_cells(position, grid, start, order, cell_of)
    pairs = np.empty((max(n, 16), 2), np.int64)
    count = 0
    largest = radius.max() if n else 0.0
    for i in range(n):
        far = radius[i] + largest + margin
        column, row = cell_of[i] % columns, cell_of[i] // columns
        first = cell_index(position[i, 0] - far, x, per_unit, columns)
        last = cell_index(position[i, 0] + far, x, per_unit, columns)
        highest = cell_index(position[i, 1] + far, y, per_unit, rows)
        # Each pair is found once, from the earlier of its two cells.
        for r in range(row, highest + 1):
            left = column if r == row else first
            for k in range(start[left + columns * r], start[last + columns * r + 1]):
                j = order[k]
                if cell_of[j] == cell_of[i] and j <= i:
                    continue
                near = radius[i] + radius[j] + margin
                dx, dy = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
                if dx * dx + dy * dy < near * near:
                    if count == pairs.shape[0]:
                        pairs = np.concatenate((pairs, np.empty_like(pairs)))
                    pairs[count, 0] = i
                    pairs[count, 1] = j
                    count += 1
    return pairs[:count]


@compiled
def push_pairs(position, radius, number, pairs, awake, push, contacts, met):
    """Add to `push` half of each overlap of two robots (A.7); return how many overlap, rows ``met[:count]``."""
    count = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if not (awake[i] or awake[j]):
            continue
        dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
        distance = math.sqrt(dx * dx + dy * dy)
        overlap = radius[i] + radius[j] - distance
        if overlap <= SLOP * min(radius[i], radius[j]):
            continue
        if distance > 0.0:
            nx, ny = dx / distance, dy / distance
        else:
            nx, ny = coincident_direction(number[i], number[j])
        push[i, 0] += nx * overlap / 2.0
        push[i, 1] += ny * overlap / 2.0
        push[j, 0] -= nx * overlap / 2.0
        push[j, 1] -= ny * overlap / 2.0
        note_contact(i, A_ROBOT, j, nx, ny, overlap, contacts)
        note_contact(j, A_ROBOT, i, -nx, -ny, overlap, contacts)
        met[count] = k
        count += 1
    return count


@compiled
def coincident_direction(a, b):
    """Return a unit vector that depends only on two ids, for robots whose centres coincide."""
    azimuth = GOLDEN_ANGLE * (7919 * min(a, b) + max(a, b))
    side = 1.0 if a < b else -1.0
    return side * math.cos(azimuth), side * math.sin(azimuth)


@compiled
def note_contact(i, kind, index, nx, ny, depth, contacts):
    """Write a contact of robot i if it is its deepest in this step."""
    contact_kind, contact_index, contact_normal, contact_depth, _ = contacts
    if depth > contact_depth[i]:
        contact_kind[i] = kind
        contact_index[i] = index
        contact_normal[i, 0] = nx
        contact_normal[i, 1] = ny
        contact_depth[i] = depth


@compiled
def push_from_statics(i, position, radius, statics, contacts):
    """Move robot i out of static bodies; return whether it is out.

    Deepest overlap first, because the face of a wall that lifts the robot frees it of the corner of the next
    wall, flush with the first: it does not catch on the seam.
    """
    face = contacts[4]
    for _ in range(MOST_PUSHES):
        depth, nx, ny, flat, item = deepest_static(position[i, 0], position[i, 1], radius, statics)
        if depth <= SLOP * radius:
            return True
        position[i, 0] += nx * depth
        position[i, 1] += ny * depth
        kind = OBSTACLE if item == BORDER else statics[3][item]
        note_contact(i, kind, BORDER if item == BORDER else statics[2][item], nx, ny, depth, contacts)
        if flat and depth > face[i, 2]:
            face[i, 0], face[i, 1], face[i, 2] = nx, ny, depth
    return False


@compiled
def put_back(position, before, radius, grid, statics, contacts, free, listed, pairs):
    """Return to their last free place the robots that overlap, and those that then overlap them."""
    n = position.shape[0]
    back = np.zeros(n, np.bool_)
    all_rows = np.arange(n)
    farthest = max(farthest_from(listed, position, all_rows), farthest_from(listed, before, all_rows))
    # All pairs that can overlap, at whichever of its two places each robot ends.
    if n and 2.0 * farthest > MARGIN * radius.min():
        pairs = near_pairs(listed, radius, 2.0 * farthest, grid)
    goes = np.zeros(n, np.bool_)
    for i in range(n):
        if not free[i]:  # the last push may have freed it
            depth = deepest_static(position[i, 0], position[i, 1], radius[i], statics)[0]
            goes[i] = depth > SLOP * radius[i]
    # With driven bodies, those that overlap robots return as well, also after robots have returned.
    _return_bodies(position, radius, statics[0], statics[1], statics[8], goes)
    while True:
        # All that overlap return at once: independent of the order of the pairs.
        for k in range(pairs.shape[0]):
            i, j = pairs[k, 0], pairs[k, 1]
            if not (back[i] and back[j]) and _collide(i, j, position, radius, contacts):
                goes[i], goes[j] = True, True
        went = _return_all(position, before, goes, back)
        if not (_return_bodies(position, radius, statics[0], statics[1], statics[8], goes) or went):
            return


@compiled
def _collide(i, j, position, radius, contacts):
    """Return whether two robots overlap, and note their contact if so."""
    dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    overlap = radius[i] + radius[j] - distance
    if overlap <= SLOP * min(radius[i], radius[j]):
        return False
    if distance > 0.0:
        note_contact(i, A_ROBOT, j, dx / distance, dy / distance, overlap, contacts)
        note_contact(j, A_ROBOT, i, -dx / distance, -dy / distance, overlap, contacts)
    return True


@compiled
def _return_all(position, before, goes, back):
    """Put robots where they were before this piece of the step, and return whether any moved."""
    went = False
    for i in range(position.shape[0]):
        if goes[i] and not back[i]:
            position[i, 0], position[i, 1] = before[i, 0], before[i, 1]
            back[i] = True
            went = True
    return went


@compiled
def _return_bodies(position, radius, edges, discs, movers, goes):
    """Return driven bodies that overlap robots to where they were before this piece, and mark these robots.

    The result is whether a body moved, or a robot was marked that was not before.
    """
    if movers is None:
        return False
    bodies = np.zeros(movers[0][0].shape[0], np.bool_)
    marked = False
    for i in range(position.shape[0]):
        if mark_overlapped(position[i, 0], position[i, 1], radius[i], edges, discs, movers, bodies) and not goes[i]:
            goes[i], marked = True, True
    return return_bodies(bodies, movers, edges, discs) or marked


@compiled
def mark_overlapped(x, y, radius, edges, discs, movers, bodies):
    """Mark the driven bodies that overlap a disc, and return whether there is one."""
    body_of, ((left, below, per_unit, columns, lines), start, items, _) = movers[4], movers[5]
    cell = cell_index(x, left, per_unit, columns) + columns * cell_index(y, below, per_unit, lines)
    any_marked = False
    for k in range(start[cell], start[cell + 1]):
        item = items[k]
        if item < edges.shape[0]:
            depth = edge_overlap(x, y, radius, edges, item)[0]
        else:
            depth = disc_overlap(x, y, radius, discs, item - edges.shape[0])[0]
        if depth > SLOP * radius:
            bodies[body_of[item]] = True
            any_marked = True
    return any_marked


@compiled
def stop_jumps(position, radius, edges, discs, movers):
    """Return bodies that have jumped onto a robot to where they were."""
    if movers is None:
        return
    (place, _, _, _, _, reach), scratch, (_, edge_row, edge_body, _, _) = movers[0], movers[1], movers[2]
    jumps = scratch[4]
    if not jumps.any():
        return
    bodies = np.zeros(len(jumps), np.bool_)
    for i in range(position.shape[0]):
        mark_overlapped(position[i, 0], position[i, 1], radius[i], edges, discs, movers, bodies)
    for b in np.flatnonzero(jumps & ~bodies):
        rows = edge_row[edge_body == b]
        for i in range(position.shape[0]):
            x, y, far = position[i, 0], position[i, 1], reach[b] + radius[i]
            near = len(rows) > 0 and (x - place[b, 0]) ** 2 + (y - place[b, 1]) ** 2 < far * far
            bodies[b] |= near and in_polygon(x, y, edges, rows[0], rows[-1] + 1)
    return_bodies(bodies & jumps, movers, edges, discs)


@compiled
def turn_along_faces(heading, motion, face, turn_angle, extra_turn):
    """Turn robots so that they travel parallel to the flat face that they met at a grazing incidence."""
    for i in range(heading.shape[0]):
        speed = math.hypot(motion[i, 0], motion[i, 1])
        if face[i, 2] == 0.0 or speed == 0.0:
            continue
        ahead, left = motion[i, 0] / speed, motion[i, 1] / speed
        cosine, sine = math.cos(heading[i]), math.sin(heading[i])
        tx, ty = cosine * ahead - sine * left, sine * ahead + cosine * left
        into = -(tx * face[i, 0] + ty * face[i, 1])
        if into <= 0.0 or into >= math.cos(turn_angle):
            continue
        along_x, along_y = tx + into * face[i, 0], ty + into * face[i, 1]
        turn = math.atan2(tx * along_y - ty * along_x, tx * along_x + ty * along_y)
        extra_turn[i] += turn
        heading[i] = wrapped(heading[i] + turn)
