"""Loads by Shapely and plain Python, one by one: the oracle of the compiled loads, whose bits are to be the same."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry.base import BaseGeometry

from mesa_swarm.kernels.elementary import direction_of, hypot
from mesa_swarm.physics import engine
from mesa_swarm.physics.arcs import LONGEST_PIECE, sinc
from mesa_swarm.physics.contact import SLOP
from mesa_swarm.physics.engine import CompiledEngine
from mesa_swarm.physics.loads import EQUAL, HAIR, HALVINGS, MOST_WAYS, ROUNDS
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.world.bodies import Body, Load, Pose, placed
from mesa_swarm.world.movers import Driven, Movers
from mesa_swarm.world.statics import FIXED

from .tables import note, put


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


class Stop(NamedTuple):
    """A point at which a load leans on a body: unit vector towards the load, and its lever arm about the centre."""

    x: float
    y: float
    arm: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Room:
    """The static lines and discs that stand still, in a tree, and the loads and driven bodies, as they are now.

    `solids` are the edges, the border's first, then the centres of discs; `radii` are 0 for edges.
    """

    solids: np.ndarray
    radii: np.ndarray
    tree: STRtree
    loads: tuple[Load, ...]
    movers: Movers

    @classmethod
    def around(cls, surroundings: Surroundings) -> "Room":
        """Return the room of a world: its static bodies, loads, and driven bodies."""
        statics, table = surroundings.statics, surroundings.bodies
        loads = tuple(table.agents[row] for row in surroundings.loads)
        moving = np.append(table.mode[surroundings.rows] != FIXED, False)
        still = ~moving[statics.shape]
        lines = shapely.linestrings(statics.edges[still[: len(statics.edges)]].reshape(-1, 2, 2))
        discs = statics.discs[still[len(statics.edges) :]]
        solids = np.concatenate([lines, shapely.points(discs[:, :2])])
        radii = np.concatenate([np.zeros(len(lines)), discs[:, 2]])
        return cls(solids=solids, radii=radii, tree=STRtree(solids), loads=loads, movers=Movers(table))

    def has_room_for(self, load: Load, pose: Pose) -> bool:
        """Return whether a load in this pose overlaps no body by more than rounding."""
        core = placed(load.form.core, pose)
        return next(self._near(load, core, load.form.core_radius), None) is None

    def stops_of(self, load: Load, distance: float) -> list[Stop]:
        """Return the stops of a load: all that is within a distance of it as it is now."""
        core = placed(load.form.core, load.pose)
        near = self._near(load, core, load.form.core_radius + distance)
        return [stop for solid, radius in near for stop in _stops(load, solid, radius + distance)]

    def _near(self, load: Load, core: BaseGeometry, distance: float) -> Iterator[tuple[BaseGeometry, float]]:
        """Yield all that is at most this distance from the core of a load, with the radii of discs."""
        far = distance + self.radii.max(initial=0.0)
        rows = np.sort(self.tree.query(core, predicate="dwithin", distance=far))
        rows = rows[shapely.distance(core, self.solids[rows]) - self.radii[rows] <= distance]
        yield from zip(self.solids[rows], self.radii[rows].tolist(), strict=True)
        others: list[Body] = [other for other in self.loads if other is not load]
        for body in (other.shape for other in [*others, *self._driven_near(load, core, distance)]):
            if shapely.distance(core, body.geometry) <= distance + body.radius:
                yield body.geometry, body.radius

    def _driven_near(self, load: Load, core: BaseGeometry, distance: float) -> list[Driven]:
        """Return the driven bodies that may be at most this distance from the core of a load."""
        x, y = shapely.get_coordinates(shapely.centroid(core))[0]
        apart = np.hypot(*(self.movers.position - (x, y)).T)
        near = np.flatnonzero((apart <= self.movers.reach + load.form.reach + distance) & ~self.movers.carried)
        return [self.movers.agents[row] for row in near]


def _stops(load: Load, solid: BaseGeometry, distance: float) -> list[Stop]:
    """Return the stops of a load on a solid: corners of either that are this near the other, or the nearest point.

    The direction is that of the line to the load's heart: between bodies that touch it is undefined.
    """
    x, y, _ = load.pose
    line = shapely.shortest_line(solid, placed(load.form.heart, load.pose))
    (px, py), (qx, qy) = shapely.get_coordinates(line).tolist()
    length = hypot(qx - px, qy - py)
    if length == 0.0:
        return []
    nx, ny = (qx - px) / length, (qy - py) / length
    if load.form.radius:
        return [Stop(nx, ny, 0.0)]
    points = _touching_corners(load.shape.geometry, solid, distance)
    return [Stop(nx, ny, (ax - x) * ny - (ay - y) * nx) for ax, ay in points or [(px, py)]]


def _touching_corners(a: BaseGeometry, b: BaseGeometry, distance: float) -> list[tuple[float, float]]:
    """Return the corners of each of two geometries that are within a distance of the other, each once."""
    found: list[tuple[float, float]] = []
    for one, other in ((a, b), (b, a)):
        corners = shapely.get_coordinates(one)
        near = shapely.distance(other, shapely.points(corners)) <= distance
        found += [(x, y) for x, y in corners[near].tolist()]
    return list(dict.fromkeys(found))


def loads_in(surroundings: Surroundings) -> list[Load]:
    """Return the loads of a world."""
    return [surroundings.bodies.agents[row] for row in surroundings.loads]


def push_all(surroundings: Surroundings, room: Room, columns: dict, motion: np.ndarray) -> dict[int, Pose]:
    """Move every load that is pushed hard enough; return the old poses of those that moved."""
    longest = LONGEST_PIECE * float(columns["radius"].min(initial=math.inf))
    before = {}
    for k, load in enumerate(loads_in(surroundings)):
        pushes, old = pushes_on(load, columns, motion), load.pose
        move_load(load, pushes, min(longest, load.form.thickness), room)
        note(load, moved=load.pose != old, pushers=len(pushes))
        if load.moved:
            before[k] = old
            surroundings.follow()
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
    length = hypot(px - qx, py - qy)
    if length == 0.0:
        return None
    nx, ny = (px - qx) / length, (py - qy) / length
    half_way, chord = heading + motion[2] / 2.0, sinc(motion[2] / 2.0)
    cosine, sine = direction_of(half_way)
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
    if wrench.x * wrench.x + wrench.y * wrench.y + turn * wrench.torque <= load.resistance * load.resistance * (
        1.0 + EQUAL
    ):
        return None
    # Robots that are driven back by the others do not affect its speed.
    speeds = [(p, wrench.x * p.x + wrench.y * p.y + turn * p.arm) for p in pushes]
    along = [(p.force * p.way, p.force * speed) for p, speed in speeds if speed > 0.0]
    if not along:
        return None
    rate = math.fsum(way for way, _ in along) / math.fsum(speed for _, speed in along)
    fastest = rate * (hypot(wrench.x, wrench.y) + abs(turn) * load.form.reach)
    rate *= min(1.0, longest / fastest)
    return rate * wrench.x, rate * wrench.y, rate * turn


def borne(wrench: Wrench, stops: list[Stop], lever: float) -> Wrench:
    """Return the wrench that remains when the stops bear the load, without friction.

    The forces of the stops are the least, in the metric of the limit surface, that keep the load from moving
    into any of them (projected Gauss and Seidel rounds).
    """
    forces = [0.0] * len(stops)
    hair = HAIR * hypot(wrench.x, wrench.y)
    for _ in range(ROUNDS):
        for k, stop in enumerate(stops):
            leaving = wrench.x * stop.x + wrench.y * stop.y + wrench.torque * stop.arm / lever**2
            more = max((hair - leaving) / (1.0 + (stop.arm / lever) * (stop.arm / lever)), -forces[k])
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
        put(load, pose(free))
    return free


def is_overlapped(load: Load, columns: dict) -> bool:
    """Return whether a robot overlaps a load."""
    position, radius = columns["position"], columns["radius"]
    x, y, _ = load.pose
    apart = load.form.reach + radius
    near = np.flatnonzero((position[:, 0] - x) ** 2 + (position[:, 1] - y) ** 2 < apart**2)
    gaps = shapely.distance(load.shape.geometry, shapely.points(position[near])) - load.form.radius
    return bool((gaps < (1.0 - 2.0 * SLOP) * radius[near]).any())


def take_back(surroundings: Surroundings, room: Room, before: dict[int, Pose], stuck: list[int]) -> None:
    """Return loads to where they were, and those that then overlap them; drop them from `before`."""
    while stuck:
        for k in stuck:
            load = loads_in(surroundings)[k]
            put(load, before.pop(k))
            note(load, moved=False, pushers=load.pushers)
            surroundings.follow()
        stuck = [k for k in before if not room.has_room_for(loads_in(surroundings)[k], loads_in(surroundings)[k].pose)]


def stuck_loads(surroundings: Surroundings, room: Room, moved: Iterable[int], columns: dict) -> list[int]:
    """Return which of the loads that moved are overlapped by a robot."""
    return [k for k in moved if is_overlapped(loads_in(surroundings)[k], columns)]


def use(monkeypatch) -> None:
    """Let models move their loads by these functions, stage by stage."""
    monkeypatch.setattr(CompiledEngine, "_move_kernel_for", lambda *arguments: None)
    monkeypatch.setattr(engine, "push_all", lambda around, _, *rest: push_all(around, Room.around(around), *rest))
    monkeypatch.setattr(engine, "find_stuck_loads", stuck_loads)
    monkeypatch.setattr(engine, "return_loads", lambda around, _, *rest: take_back(around, Room.around(around), *rest))
