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
"""

import math
from typing import NamedTuple

import numpy as np
import shapely

from mesa_swarm.physics.contact import SLOP
from mesa_swarm.physics.motion import LONGEST_PIECE, sinc
from mesa_swarm.physics.surroundings import Room, Stop, Surroundings
from mesa_swarm.world.bodies import Load, Pose

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


class RobotPush(NamedTuple):
    """One robot's push: unit vector into the load, lever arm about the centre, force in 0..1, and way."""

    x: float
    y: float
    arm: float
    force: float
    way: float


class Wrench(NamedTuple):
    """A force and a torque, in full pushes and in full pushes times map units."""

    x: float
    y: float
    torque: float


def push_all(surroundings: Surroundings, room: Room, columns: dict, motion: np.ndarray) -> dict[int, Pose]:
    """Move every load that is pushed hard enough; return the old poses of those that moved."""
    longest = LONGEST_PIECE * float(columns["radius"].min(initial=math.inf))
    before = {}
    for k, load in enumerate(surroundings.loads):
        pushes, old = pushes_on(load, columns, motion), load.pose
        load.pushers = len(pushes)
        move_load(load, pushes, min(longest, load.form.thickness), room)
        load.moved = load.pose != old
        if load.moved:
            before[k] = old
            surroundings.follow(k)
    return before


def pushes_on(load: Load, columns: dict, motion: np.ndarray) -> list[RobotPush]:
    """Return the pushes of the robots that touch a load, or would in this step, and drive into it."""
    position, radius = columns["position"], columns["radius"]
    x, y, _ = load.pose
    apart = load.form.reach + radius + np.abs(motion[:, 0]) + np.abs(motion[:, 1])
    near = np.flatnonzero((position[:, 0] - x) ** 2 + (position[:, 1] - y) ** 2 <= apart**2)
    if not len(near):
        return []
    lines = shapely.shortest_line(load.shape.geometry, shapely.points(position[near]))
    pushes = []
    for i, line in zip(near.tolist(), shapely.get_coordinates(lines).reshape(-1, 4).tolist(), strict=True):
        push = _push_of(line, float(radius[i]), load, motion[i].tolist(), float(columns["heading"][i]))
        limit = float(columns["max_speed"][i])
        if push is not None and push.way > EQUAL * limit:
            pushes.append(push._replace(force=min(push.force / limit, 1.0)))
    return pushes


def _push_of(line: list[float], radius: float, load: Load, motion: list[float], heading: float) -> RobotPush | None:
    """Return the push of one robot, its force still a speed, or None; the line is from the load to its centre."""
    px, py, qx, qy = line
    length = math.hypot(px - qx, py - qy)
    if length == 0.0:
        return None
    nx, ny = (px - qx) / length, (py - qy) / length
    half_way, chord = heading + motion[2] / 2.0, sinc(motion[2] / 2.0)
    cosine, sine = math.cos(half_way), math.sin(half_way)
    speed = chord * ((cosine * motion[0] - sine * motion[1]) * nx + (sine * motion[0] + cosine * motion[1]) * ny)
    way = speed - max(length - load.form.radius - radius, 0.0)
    arm = (px - load.pose[0]) * ny - (py - load.pose[1]) * nx
    return RobotPush(nx, ny, arm, speed, way) if way > 0.0 else None


def move_load(load: Load, pushes: list[RobotPush], longest: float, room: Room) -> None:
    """Move a load as far as it is pushed and has room, first straight, then along what it meets.

    No point of it moves farther than `longest` in a step.
    """
    stops: list[Stop] = []
    wrench, left = wrench_of(pushes), 1.0
    for _ in range(MOST_WAYS):
        way = twist_of(borne(wrench, stops, load.form.lever), pushes, load, longest)
        if way is None:
            return
        left -= left * go(load, (left * way[0], left * way[1], left * way[2]), room)
        if left == 0.0:
            return
        stops = room.stops_of(load, 2.0 * longest / 2**HALVINGS)


def wrench_of(pushes: list[RobotPush]) -> Wrench:
    """Return the joint push; exactly summed, independent of the order of robots."""
    return Wrench(
        math.fsum(p.force * p.x for p in pushes),
        math.fsum(p.force * p.y for p in pushes),
        math.fsum(p.force * p.arm for p in pushes),
    )


def twist_of(wrench: Wrench, pushes: list[RobotPush], load: Load, longest: float) -> Pose | None:
    """Return the motion of a load in this step, as (x, y, turn), or None if it stays."""
    turn = wrench.torque / load.form.lever**2
    if wrench.x**2 + wrench.y**2 + turn * wrench.torque <= load.resistance**2 * (1.0 + EQUAL):
        return None
    # Robots that are driven back by the others do not affect its speed.
    speeds = [(p, wrench.x * p.x + wrench.y * p.y + turn * p.arm) for p in pushes]
    along = [(p.force * p.way, p.force * speed) for p, speed in speeds if speed > 0.0]
    if not along:
        return None
    rate = math.fsum(way for way, _ in along) / math.fsum(speed for _, speed in along)
    fastest = rate * (math.hypot(wrench.x, wrench.y) + abs(turn) * load.form.reach)
    rate *= min(1.0, longest / fastest)
    return rate * wrench.x, rate * wrench.y, rate * turn


def borne(wrench: Wrench, stops: list[Stop], lever: float) -> Wrench:
    """Return the wrench that remains when the stops bear the load, without friction.

    The forces of the stops are the least, in the metric of the limit surface, that keep the load from moving
    into any of them (projected Gauss and Seidel rounds).
    """
    forces = [0.0] * len(stops)
    hair = HAIR * math.hypot(wrench.x, wrench.y)
    for _ in range(ROUNDS):
        for k, stop in enumerate(stops):
            leaving = wrench.x * stop.x + wrench.y * stop.y + wrench.torque * stop.arm / lever**2
            more = max((hair - leaving) / (1.0 + (stop.arm / lever) ** 2), -forces[k])
            forces[k] += more
            wrench = Wrench(wrench.x + more * stop.x, wrench.y + more * stop.y, wrench.torque + more * stop.arm)
    return wrench


def go(load: Load, way: Pose, room: Room) -> float:
    """Move a load along a way as far as there is room, found by bisection, and return the share of the way."""
    x, y, heading = load.pose

    def pose(share: float) -> Pose:
        return x + share * way[0], y + share * way[1], heading + share * way[2]

    free, step = 0.0, 1.0
    while step >= 0.5**HALVINGS and free < 1.0:
        if room.has_room_for(load, pose(free + step)):
            free += step
        step /= 2.0
    if free > 0.0:
        load.put(pose(free))
    return free


def is_overlapped(load: Load, columns: dict) -> bool:
    """Return whether a robot overlaps a load."""
    position, radius = columns["position"], columns["radius"]
    x, y, _ = load.pose
    apart = load.form.reach + radius
    near = np.flatnonzero((position[:, 0] - x) ** 2 + (position[:, 1] - y) ** 2 < apart**2)
    gaps = shapely.distance(load.shape.geometry, shapely.points(position[near])) - load.form.radius
    return bool((gaps < (1.0 - 2.0 * SLOP) * radius[near]).any())


def stuck_loads(surroundings: Surroundings, columns: dict, before: dict[int, Pose]) -> list[int]:
    """Return which of the loads that moved overlap robots, which could not give way."""
    return [k for k in before if is_overlapped(surroundings.loads[k], columns)]


def take_back(surroundings: Surroundings, room: Room, before: dict[int, Pose], stuck: list[int]) -> None:
    """Return loads to where they were, and those that then overlap them; drop them from `before`."""
    while stuck:
        for k in stuck:
            surroundings.loads[k].put(before.pop(k))
            surroundings.loads[k].moved = False
            surroundings.follow(k)
        stuck = [k for k in before if not room.has_room_for(surroundings.loads[k], surroundings.loads[k].pose)]
