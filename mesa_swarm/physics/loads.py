r"""Robots move loads quasi-statically, on an ellipsoidal limit surface.

A robot pushes a load if it would drive into it in this step. Its force is its speed straight into the load as
a share of its greatest, so that 1 is a full push. All forces add up to a wrench (F, T) about the centre. The
load stays unless that leaves the limit surface of its friction with the ground,

.. math:: (|F| / R)^2 + (T / (R c))^2 > 1,

where R is its resistance and c the mean distance of its points from the centre; then it moves along the
surface's normal, the twist (F, T / c^2) (Goyal, Ruina and Papadopoulos 1991, Wear 143, 307-330; Howe and
Cutkosky 1996, Int. J. Robotics Research 15, 557-572). The robots that push its way decide its speed: at the points
where they push it moves as fast as they do, on average, weighted by force; a load pushed by equal robots from one
side moves at their speed, and one that turns about a single robot gives way at that robot's speed.

Loads move before the robots do, one after the other in the order in which they were added, at most half the
least radius of a robot a step, and never push one another. Static bodies bear a load without friction, so that
it slides along walls. A load to which robots cannot give way returns to where it was.

Both engines share these functions; their numbers are those of Shapely and of Python, bit for bit.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry.exact_rounding import MOST_PARTS, exact_sum
from mesa_swarm.geometry.outlines import gap_to_point, nearest_to_point
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of, hypot
from mesa_swarm.kernels.type_names import Flags, Integers, RealRows, Reals
from mesa_swarm.physics.arcs import LONGEST_PIECE, sinc
from mesa_swarm.physics.contact import SLOP
from mesa_swarm.physics.driven_bodies import MovingItems, place_items
from mesa_swarm.physics.load_room import Poses, Room, find_stops, has_room, list_near, place_load, place_outlines
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.world.bodies import Pose

# A joint push that exceeds the resistance by less than this share is equal to it but for rounding; a robot whose
# push is a smaller share of a full one drives along the load.
EQUAL = 1e-9
# In a step a load makes at most this number of moves, the first straight, the others along what it meets; the length
# of each is found by bisection.
MOST_WAYS = 4
HALVINGS = 10
# Rounds in which the forces of the stops of a load are found, and its speed away from them, as a share of its way: a
# load that slides may not catch on rounding.
ROUNDS = 16
HAIR = 1e-4


class Pushers(NamedTuple):
    """The robots that may push: (n, 2), rad, map units, map units a step, and their motion (n, 3) in this step."""

    position: RealRows
    heading: Reals
    radius: Reals
    max_speed: Reals
    motion: RealRows


class Pushes(NamedTuple):
    """The pushes on one load: unit vectors into it, lever arms about its centre, forces in 0..1, and ways.

    `along` is how fast its point there moves, per unit of the twist; `terms` and `parts` are scratch of sums.
    """

    x: Reals
    y: Reals
    arm: Reals
    force: Reals
    way: Reals
    along: Reals
    terms: Reals
    parts: Reals


class LoadArrays(NamedTuple):
    """What kernels of loads take: arguments of `push_loads`, items of loads, edges and discs, what is overlapped."""

    robots: Pushers
    poses: Poses
    resistance: Reals
    room: Room
    pushes: Pushes
    pushers: Integers
    moved: Flags
    old: RealRows
    items: MovingItems
    edges: RealRows
    discs: RealRows
    stuck: Flags

    @classmethod
    def of(cls, surroundings: Surroundings, room: Room, columns: dict, motion: np.ndarray) -> "LoadArrays":
        """Return the loads of a world, and what may push them; `motion` is written in each step."""
        table, statics, count, n = surroundings.bodies, surroundings.statics, len(surroundings.loads), len(motion)
        return cls(
            robots=Pushers(motion=motion, **{name: columns[name] for name in Pushers._fields[:-1]}),
            poses=surroundings.poses,
            resistance=table.resistance,
            room=room,
            pushes=Pushes(parts=np.empty(MOST_PARTS), **{name: np.empty(n) for name in Pushes._fields[:-1]}),
            pushers=table.pushers,
            moved=table.moved,
            old=np.empty((count, 3)),
            items=surroundings.items,
            edges=statics.edges,
            discs=statics.discs,
            stuck=np.zeros(count, np.bool_),
        )

    def poses_before(self) -> dict[int, Pose]:
        """Return the poses before this step of the loads that moved and have not returned."""
        return {k: tuple(self.old[k].tolist()) for k in np.flatnonzero(self.moved[self.poses.loads]).tolist()}


@compiled(nogil=True)
def push_loads_of_robots(block, step, first, last):
    """Do what `push_all` does: move every load that is pushed hard enough, of all robots."""
    a = unpack(block, LoadArrays)
    poses, old, has_moved = a.poses, a.old, False
    for k in range(old.shape[0]):
        row = poses.loads[k]
        old[k, 0], old[k, 1], old[k, 2] = poses.position[row, 0], poses.position[row, 1], poses.heading[row]
    push_loads(a.robots, poses, a.resistance, a.room, a.pushes, a.pushers, a.moved)
    for k in range(old.shape[0]):
        has_moved |= a.moved[poses.loads[k]]
    if has_moved:
        place_items(poses.position, poses.heading, a.items, a.edges, a.discs)
    return 0


@compiled(nogil=True)
def note_stuck_loads(block, step, first, last):
    """Write which of the loads that moved are overlapped by a robot, and return how many."""
    a = unpack(block, LoadArrays)
    stuck, count = a.stuck, 0
    for k in range(stuck.shape[0]):
        is_moved = a.moved[a.poses.loads[k]]
        stuck[k] = is_moved and is_overlapped(k, a.robots.position, a.robots.radius, a.poses, a.room)
        count += stuck[k]
    return count


@compiled(nogil=True)
def take_back_loads(block, step, first, last):
    """Return the loads that are noted as stuck to where they were, and those that then overlap them."""
    a = unpack(block, LoadArrays)
    poses, old, stuck, moved, is_any_stuck = a.poses, a.old, a.stuck, a.moved, True
    while is_any_stuck:
        for k in range(stuck.shape[0]):
            if stuck[k]:
                row = poses.loads[k]
                poses.position[row, 0], poses.position[row, 1], poses.heading[row] = old[k, 0], old[k, 1], old[k, 2]
                moved[row] = False
        place_outlines(poses, a.room)
        is_any_stuck = False
        for k in range(stuck.shape[0]):
            stuck[k] = moved[poses.loads[k]] and not has_room_here(k, poses, a.room)
            is_any_stuck |= stuck[k]
    place_items(poses.position, poses.heading, a.items, a.edges, a.discs)
    return 0


def push_all(surroundings: Surroundings, room: Room, columns: dict, motion: np.ndarray) -> dict[int, Pose]:
    """Move every load that is pushed hard enough; return the old poses of those that moved."""
    arrays = LoadArrays.of(surroundings, room, columns, motion)
    push_loads_of_robots(Block(arrays).numbers, 0, 0, len(motion))
    return arrays.poses_before()


@compiled
def push_loads(robots, poses, resistance, room, pushes, pushers, has_moved):
    """Move all loads, one after the other; write how many robots push each, and which ones moved."""
    place_outlines(poses, room)
    least = math.inf
    for radius in robots.radius:
        least = min(least, radius)
    for k in range(room.loads):
        count = find_pushes(k, robots, poses, room, pushes)
        row = poses.loads[k]
        pushers[row] = count
        x, y, heading = poses.position[row, 0], poses.position[row, 1], poses.heading[row]
        longest = min(LONGEST_PIECE * least, room.forms.thickness[k])
        move_load(k, count, longest, resistance[row] * resistance[row], poses, room, pushes)
        has_moved[row] = poses.position[row, 0] != x or poses.position[row, 1] != y or poses.heading[row] != heading


@compiled(apart=True)
def find_pushes(k, robots, poses, room, pushes):
    """Write the pushes of the robots that touch load k, or would in this step, and drive into it; return how many."""
    count, row = 0, poses.loads[k]
    for i in range(robots.radius.shape[0]):
        way = abs(robots.motion[i, 0]) + abs(robots.motion[i, 1])
        dx, dy = robots.position[i, 0] - poses.position[row, 0], robots.position[i, 1] - poses.position[row, 1]
        apart = room.forms.reach[k] + robots.radius[i] + way
        if dx * dx + dy * dy <= apart * apart and find_push(i, k, way, count, robots, poses, room, pushes):
            count += 1
    return count


@compiled
def find_push(i, k, way, place, robots, poses, room, pushes):
    """Write the push of robot i on load k, and return whether there is one: `way` is as far as it might go."""
    qx, qy, radius = robots.position[i, 0], robots.position[i, 1], room.forms.radius[k] + robots.radius[i]
    px, py = nearest_to_point(room.still + k, qx, qy, (1.0 + EQUAL) * (radius + way), room.outlines)
    length = hypot(px - qx, py - qy)
    if length == 0.0:
        return False
    nx, ny = (px - qx) / length, (py - qy) / length
    ahead, left, turn = robots.motion[i, 0], robots.motion[i, 1], robots.motion[i, 2]
    half_way, chord = robots.heading[i] + turn / 2.0, sinc(turn / 2.0)
    cosine, sine = direction_of(half_way)
    speed = chord * ((cosine * ahead - sine * left) * nx + (sine * ahead + cosine * left) * ny)
    pushes.way[place] = speed - max(length - room.forms.radius[k] - robots.radius[i], 0.0)
    pushes.x[place], pushes.y[place] = nx, ny
    row = poses.loads[k]
    pushes.arm[place] = (px - poses.position[row, 0]) * ny - (py - poses.position[row, 1]) * nx
    limit = robots.max_speed[i]
    pushes.force[place] = min(speed / limit, 1.0)
    return pushes.way[place] > 0.0 and pushes.way[place] > EQUAL * limit


@compiled(apart=True)
def move_load(k, count, longest, resistance_square, poses, room, pushes):
    """Move load k as far as it is pushed and has room, first straight, then along what it meets.

    No point of it moves farther than `longest` in a step.
    """
    wrench, left, stops, near = wrench_of(count, pushes), 1.0, 0, -1
    distance = 2.0 * longest / 2**HALVINGS
    for _ in range(MOST_WAYS):
        moves, x, y, turn = twist_of(
            free_wrench(wrench, stops, k, room), count, resistance_square, longest, k, room, pushes
        )
        if not moves:
            return
        if near < 0:
            near = list_near(k, longest + distance, poses, room)
        left -= left * move_along(k, left * x, left * y, left * turn, near, poses, room)
        if left == 0.0:
            return
        stops = find_stops(k, distance, near, poses, room)


@compiled
def wrench_of(count, pushes):
    """Return the joint push, a force and a torque; exactly summed, independent of the order of robots."""
    return (
        sum_of_products(pushes.force, pushes.x, count, pushes),
        sum_of_products(pushes.force, pushes.y, count, pushes),
        sum_of_products(pushes.force, pushes.arm, count, pushes),
    )


@compiled
def sum_of_products(a, b, count, pushes):
    """Return the exactly rounded sum of the products of two columns of pushes."""
    for k in range(count):
        pushes.terms[k] = a[k] * b[k]
    return exact_sum(pushes.terms, count, pushes.parts)


@compiled
def twist_of(wrench, count, resistance_square, longest, k, room, pushes):
    """Return whether load k moves in this step, and its motion: x, y, turn."""
    force_x, force_y, torque = wrench
    turn = torque / room.forms.lever_square[k]
    dissipation = force_x * force_x + force_y * force_y + turn * torque
    if dissipation <= resistance_square * (1.0 + EQUAL):
        return False, 0.0, 0.0, 0.0
    for p in range(count):
        # Robots that are driven back by the others do not affect its speed.
        pushes.along[p] = max(force_x * pushes.x[p] + force_y * pushes.y[p] + turn * pushes.arm[p], 0.0)
    speed = sum_of_products(pushes.force, pushes.along, count, pushes)
    if speed == 0.0:
        return False, 0.0, 0.0, 0.0
    for p in range(count):
        pushes.terms[p] = pushes.force[p] * pushes.way[p] if pushes.along[p] > 0.0 else 0.0
    rate = exact_sum(pushes.terms, count, pushes.parts) / speed
    rate *= min(1.0, longest / (rate * (hypot(force_x, force_y) + abs(turn) * room.forms.reach[k])))
    return True, rate * force_x, rate * force_y, rate * turn


@compiled
def free_wrench(wrench, count, k, room):
    """Return the wrench that remains when the first stops bear load k, without friction.

    The forces of the stops are the least, in the metric of the limit surface, that keep the load from moving
    into any of them (projected Gauss and Seidel rounds).
    """
    x, y, torque = wrench
    stops, lever_square = room.stops, room.forms.lever_square[k]
    hair = HAIR * hypot(x, y)
    for s in range(count):
        stops.force[s] = 0.0
        lever = stops.arm[s] / room.forms.lever[k]
        stops.yielding[s] = 1.0 + lever * lever
    for _ in range(ROUNDS):
        for s in range(count):
            leaving = x * stops.x[s] + y * stops.y[s] + torque * stops.arm[s] / lever_square
            more = max((hair - leaving) / stops.yielding[s], -stops.force[s])
            stops.force[s] += more
            x, y, torque = x + more * stops.x[s], y + more * stops.y[s], torque + more * stops.arm[s]
    return x, y, torque


@compiled
def move_along(k, way_x, way_y, turn, near, poses, room):
    """Move load k along a way as far as there is room, found by bisection, and return the share of the way."""
    row = poses.loads[k]
    x, y, heading = poses.position[row, 0], poses.position[row, 1], poses.heading[row]
    free, step = 0.0, 1.0
    while step >= 0.5**HALVINGS and free < 1.0:
        share = free + step
        if has_room(k, x + share * way_x, y + share * way_y, heading + share * turn, near, room):
            free = share
        step /= 2.0
    if free > 0.0:
        poses.position[row, 0], poses.position[row, 1] = x + free * way_x, y + free * way_y
        poses.heading[row] = wrap_angle(heading + free * turn)
    place_load(k, poses.position[row, 0], poses.position[row, 1], poses.heading[row], room)
    return free


def find_stuck_loads(surroundings: Surroundings, room: Room, loads: Iterable[int], columns: dict) -> list[int]:
    """Return which of the loads that moved are overlapped by a robot."""
    position, radius = columns["position"], columns["radius"]
    return [k for k in loads if is_overlapped(k, position, radius, surroundings.poses, room)]


@compiled
def is_overlapped(k, position, radius, poses, room):
    """Return whether a robot overlaps load k."""
    reach, own_radius, row = room.forms.reach[k], room.forms.radius[k], poses.loads[k]
    for i in range(radius.shape[0]):
        dx, dy = position[i, 0] - poses.position[row, 0], position[i, 1] - poses.position[row, 1]
        apart = reach + radius[i]
        if dx * dx + dy * dy < apart * apart:
            gap, _ = gap_to_point(room.still + k, position[i, 0], position[i, 1], apart, room.outlines)
            if gap - own_radius < (1.0 - 2.0 * SLOP) * radius[i]:
                return True
    return False


def return_loads(surroundings: Surroundings, room: Room, before: dict[int, Pose], stuck: list[int]) -> None:
    """Return loads to where they were, and those that then overlap them; drop them from `before`."""
    table, poses = surroundings.bodies, surroundings.poses
    while stuck:
        for k in stuck:
            row = surroundings.loads[k]
            *table.position[row], table.heading[row] = before.pop(k)
            table.moved[row] = False
        place_outlines(poses, room)
        stuck = [k for k in before if not has_room_here(k, poses, room)]
    surroundings.follow()


@compiled
def has_room_here(k, poses, room):
    """Return whether load k overlaps no body by more than rounding where it is."""
    near, row = list_near(k, 0.0, poses, room), poses.loads[k]
    return has_room(k, poses.position[row, 0], poses.position[row, 1], poses.heading[row], near, room)
