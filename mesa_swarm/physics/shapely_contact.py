"""Contact through Shapely alone: slow and readable, the oracle of `contact`, whose rules and constants it shares.

Nobody's centre is ever inside a solid: `find_room` and the length of the pieces see to that, so that the
nearest point of an outline always tells the way out.
"""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import Point, Polygon, STRtree
from shapely.geometry.polygon import orient

from mesa_swarm.physics.contact import (
    MOST_PUSHES,
    MOST_SWEEPS,
    SLOP,
    coincident_direction,
    turn_along_faces,
)
from mesa_swarm.physics.motion import advance, count_pieces
from mesa_swarm.physics.shapely_solids import Solids
from mesa_swarm.physics.standing import ON_FACE
from mesa_swarm.world.statics import ROBOT

# A robot is pushed by others at most this share of its radius at once.
LONGEST_PUSH = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One overlap of a robot: how deep, the unit vector out of it, whether a flat face, and with what."""

    depth: float
    normal: np.ndarray
    flat: bool
    kind: int
    index: int


class Contacts:
    """The deepest touch of every robot in this step, in the swarm's columns, and of a face in this piece."""

    def __init__(self, columns: dict[str, np.ndarray]) -> None:
        self.number = columns["number"]
        self.kind, self.index = columns["contact_kind"], columns["contact_index"]
        self.normal, self.depth = columns["contact_normal"], columns["contact_depth"]
        self.kind[:], self.index[:], self.normal[:], self.depth[:] = -1, -1, 0.0, 0.0
        self.face = np.zeros((len(self.kind), 3))

    def note(self, i: int, touch: Touch) -> None:
        """Keep a touch of robot i if it is its deepest."""
        if touch.depth > self.depth[i]:
            self.kind[i], self.index[i] = touch.kind, touch.index
            self.normal[i], self.depth[i] = touch.normal, touch.depth
        if touch.flat and touch.depth > self.face[i, 2]:
            self.face[i] = *touch.normal, touch.depth


def travel(columns: dict[str, np.ndarray], motion: np.ndarray, turn_angle: float, solids: Solids) -> np.ndarray:
    """Move all robots through one step, resolve every contact, and return how far faces turned each.

    Parameters
    ----------
    columns : dict
        Of the swarm; position, heading, collided and contact_... are written.
    motion : ndarray, shape (n, 3)
        What the wheels ask for.
    turn_angle : float, rad
    solids : Solids
    """
    position, heading, radius = columns["position"], columns["heading"], columns["radius"]
    contacts, extra_turn = Contacts(columns), np.zeros(len(heading))
    pieces = count_pieces(motion, radius)
    for _ in range(pieces):
        before = position.copy()
        contacts.face[:] = 0.0
        advance(position, heading, motion, pieces)
        if not separate(position, radius, solids, contacts, MOST_SWEEPS):
            put_back(position, before, radius, solids, contacts)
        turn_along_faces(heading, motion, contacts.face, turn_angle, extra_turn)
    columns["collided"][:] = contacts.depth > 0.0
    return extra_turn


def separate(
    position: np.ndarray,
    radius: np.ndarray,
    solids: Solids,
    contacts: Contacts,
    most_sweeps: int,
) -> bool:
    """Push until nothing overlaps, at most `most_sweeps` times, and return whether nothing does."""
    free = np.array([leave_statics(i, position, radius[i], solids, contacts) for i in range(len(radius))])
    for _ in range(most_sweeps):
        pairs = overlapping_pairs(position, radius)
        if not len(pairs):
            return bool(free.all())
        for i in push_pairs(position, radius, pairs, contacts):
            free[i] = leave_statics(i, position, radius[i], solids, contacts)
    return False


def overlapping_pairs(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return the pairs (i, j), i < j, of robots that overlap, sorted; shape (k, 2).

    Examples
    --------
    >>> overlapping_pairs(np.array([[0.0, 0], [20, 0], [9, 0]]), np.full(3, 5.0)).tolist()
    [[0, 2]]
    """
    points = shapely.points(position)
    i, j = STRtree(points).query(points, predicate="dwithin", distance=2 * radius.max(initial=0.0))
    overlap = radius[i] + radius[j] - shapely.distance(points[i], points[j])
    deep = (i < j) & (overlap > SLOP * np.minimum(radius[i], radius[j]))
    return np.array(sorted(zip(i[deep], j[deep], strict=True)), np.int64).reshape(-1, 2)


def push_pairs(position: np.ndarray, radius: np.ndarray, pairs: np.ndarray, contacts: Contacts) -> np.ndarray:
    """Push all robots that overlap others at once, half of each overlap (A.7); return who was moved."""
    push = np.zeros_like(position)
    for i, j in pairs:
        touch = touch_of_robots(i, j, position, radius, contacts.number)
        push[i] += touch.normal * touch.depth / 2
        push[j] -= touch.normal * touch.depth / 2
        note_both(i, j, touch, contacts)
    length = np.hypot(*push.T)
    share = np.minimum(1.0, LONGEST_PUSH * radius / np.maximum(length, 1e-300))
    position += share[:, None] * push
    return np.flatnonzero(length)


def touch_of_robots(i: int, j: int, position: np.ndarray, radius: np.ndarray, number: np.ndarray) -> Touch:
    """Return how robot j touches robot i."""
    distance = Point(position[i]).distance(Point(position[j]))
    apart = position[i] - position[j]
    normal = apart / distance if distance > 0.0 else np.array(coincident_direction(number[i], number[j]))
    return Touch(radius[i] + radius[j] - distance, normal, False, ROBOT, j)


def note_both(i: int, j: int, touch: Touch, contacts: Contacts) -> None:
    """Note a touch of robot i by robot j, for both."""
    contacts.note(i, touch)
    contacts.note(j, replace(touch, normal=-touch.normal, index=i))


def leave_statics(i: int, position: np.ndarray, radius: float, solids: Solids, contacts: Contacts) -> bool:
    """Move robot i out of what stands still, deepest overlap first, and return whether it is out."""
    for _ in range(MOST_PUSHES):
        touch = deepest_static(position[i], radius, solids)
        if touch is None:
            return True
        position[i] += touch.depth * touch.normal
        contacts.note(i, touch)
    return False


def deepest_static(centre: np.ndarray, radius: float, solids: Solids) -> Touch | None:
    """Return the deepest overlap of a disc with what stands still, None if there is none."""
    point = Point(centre)
    near = np.sort(solids.tree.query(point, predicate="dwithin", distance=radius))
    touches = [_touch_of_polygon(point, radius, solids, p) for p in near]
    gaps = shapely.distance(point, solids.centres) - solids.radii
    touches += [_touch_of_disc(point, radius, solids, k) for k in np.flatnonzero(gaps < radius).tolist()]
    deepest = max(touches, key=lambda touch: touch.depth, default=None)
    return deepest if deepest and deepest.depth > SLOP * radius else None


def _touch_of_polygon(point: Point, radius: float, solids: Solids, p: int) -> Touch:
    """Return how a disc touches a polygon: a flat face unless the nearest point is a vertex."""
    outline = solids.polygons[p].boundary
    gap, way = outline.distance(point), shapely.shortest_line(outline, point)
    nearest, centre = shapely.get_coordinates(way)
    flat = not (shapely.get_coordinates(outline) == nearest).all(axis=1).any()
    if gap > ON_FACE * radius or (gap > 0.0 and not flat):
        normal = (centre - nearest) / gap
    else:
        normal = way_out(solids.polygons[p], point)
        gap = normal @ (centre - nearest)
    return Touch(radius - gap, normal, bool(flat), solids.polygon_body[p], solids.polygon_owner[p])


def way_out(polygon: Polygon, point: Point) -> np.ndarray:
    """Return the unit vector out of a polygon across the edge that is nearest to a point.

    Examples
    --------
    >>> (way_out(shapely.box(0, 0, 4, 4), Point(4, 1)) + 0.0).tolist()  # no negative zero
    [1.0, 0.0]
    """
    solid = orient(polygon)
    rings = [shapely.get_coordinates(ring) for ring in (solid.exterior, *solid.interiors)]
    edges = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    begin, end = edges[shapely.distance(shapely.linestrings(edges), point).argmin()]
    ahead = (end - begin) / Point(begin).distance(Point(end))
    return np.array([ahead[1], -ahead[0]])


def _touch_of_disc(point: Point, radius: float, solids: Solids, k: int) -> Touch:
    """Return how a disc touches a standing disc."""
    distance = point.distance(solids.centres[k])
    apart = shapely.get_coordinates(point)[0] - shapely.get_coordinates(solids.centres[k])[0]
    depth = radius + solids.radii[k] - distance
    return Touch(depth, apart / distance, False, solids.disc_body[k], solids.disc_owner[k])


def put_back(
    position: np.ndarray,
    before: np.ndarray,
    radius: np.ndarray,
    solids: Solids,
    contacts: Contacts,
) -> None:
    """Return to their last free place the robots that overlap, and those who then overlap them.

    All that overlap return at once, so that the order of robots is nothing.
    """
    discs = zip(position, radius, strict=True)
    back = np.zeros(len(radius), bool)
    goes = np.array([deepest_static(centre, r, solids) is not None for centre, r in discs])
    while True:
        for i, j in overlapping_pairs(position, radius):
            if not (back[i] and back[j]):
                note_both(i, j, touch_of_robots(i, j, position, radius, contacts.number), contacts)
                goes[[i, j]] = True
        if (goes == back).all():
            return
        position[goes] = before[goes]
        back = goes.copy()
