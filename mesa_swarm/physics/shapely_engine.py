"""The engine by Shapely alone: slow, short, readable, the reference for the compiled engine.

It shares the arithmetic of wheels, arcs and errors with the compiled engine, its constants, and loads, whose numbers
tests compare with those of Shapely to the last bit; but no other function that measures a shape: it is the oracle that
the other is tested against.

The centre of a robot is never inside a solid, because of `move_to_free_place` and of the length of the pieces: the
nearest point of an outline always shows the way out.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
import shapely
from shapely import LineString, MultiLineString, Point, Polygon, STRtree
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.elementary import atan2, cos, direction_of, directions_of, hypot, vector_lengths
from mesa_swarm.physics.arcs import advance_robots, count_pieces
from mesa_swarm.physics.contact import MOST_PUSHES, ON_FACE, SLOP, coincident_direction
from mesa_swarm.physics.driven_bodies import LONGEST_STEP, MOST_PIECES
from mesa_swarm.physics.engine import CONTACT_COLUMNS, Engine, begin_way
from mesa_swarm.physics.placing import RING, SWEEPS, no_room_error
from mesa_swarm.physics.sensing import add_errors, hold_readings
from mesa_swarm.physics.sensor_noise import SensorNoise
from mesa_swarm.physics.separation import MOST_SWEEPS
from mesa_swarm.physics.stopping import LOOK, MOST_LOOKS
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.physics.travel import turn_along_faces
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, HALF, MOUNT_X, MOUNT_Y, RANGE, RAYS
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.bodies import BodyTable, Form
from mesa_swarm.world.statics import BORDER, CARRIED, NOTHING, OBSTACLE, ROBOT

# Between two points of a wedge's fan: its outer edge then stays beyond the range without long spikes.
WIDEST_STEP = math.radians(60.0)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Solids:
    """All solid polygons and discs of a world; owners are their numbers, bodies their kinds, shapes their indices.

    The first polygon is the outside of the map, as far as any sensor reaches, with owner -1: an obstacle.
    """

    polygons: np.ndarray
    polygon_owner: np.ndarray
    polygon_body: np.ndarray
    tree: STRtree
    centres: np.ndarray
    radii: np.ndarray
    disc_owner: np.ndarray
    disc_body: np.ndarray
    disc_shape: np.ndarray

    @classmethod
    def of(cls, surroundings: Surroundings, margin: float) -> "Solids":
        """Collect all solids; the outside of the map reaches `margin` beyond the border."""
        carried, first = surroundings.carried, len(surroundings.rows) - surroundings.apart
        shapes = enumerate(surroundings.present_shapes)
        solid = [(i, shape) for i, shape in shapes if shape.contact and i not in carried]
        polygons = [(i, shape.geometry) for i, shape in solid if not shape.is_disc]
        polygons.insert(0, (BORDER, ring_around_map(surroundings.bounds, margin)))
        discs = [(i, shape.geometry, shape.radius) for i, shape in solid if shape.is_disc]
        geometries = np.array([geometry for _, geometry in polygons])
        bodies = np.append(surroundings.bodies.kind[surroundings.rows], OBSTACLE).astype(np.int64)
        of_discs = np.array([i for i, _, _ in discs], np.int64)
        return cls(
            polygons=geometries,
            polygon_owner=np.array([i for i, _ in polygons]),
            polygon_body=np.array([bodies[i] for i, _ in polygons]),
            tree=STRtree(geometries),
            centres=np.array([centre for _, centre, _ in discs], object),
            radii=np.array([radius for _, _, radius in discs], float),
            disc_owner=np.where(of_discs >= first, of_discs - first, of_discs),
            disc_body=bodies[of_discs],
            disc_shape=of_discs,
        )

    def gaps(self, places: np.ndarray) -> np.ndarray:
        """Return the distance of each place (n, 2) from the nearest solid; not above 0 inside one."""
        points = shapely.points(places)[:, None]
        to_polygons = shapely.distance(points, self.polygons)
        to_discs = shapely.distance(points, self.centres) - self.radii
        return np.hstack([to_polygons, to_discs]).min(axis=1)


def ring_around_map(bounds: Bounds, margin: float) -> Polygon:
    """Return the outside of a map as far as `margin` from it."""
    x_min, y_min, x_max, y_max = bounds
    around = shapely.box(x_min - margin, y_min - margin, x_max + margin, y_max + margin)
    return Polygon(around.exterior, [shapely.box(*bounds).exterior])


class View(NamedTuple):
    """The view of one sensor: its area as far as its range; the area itself reaches farther."""

    apex: Point
    area: BaseGeometry
    rays: tuple[LineString, ...]
    range: float


def sense_proximity_by_shapely(
    swarm: Swarm, surroundings: Surroundings, solids: Solids, distance: np.ndarray, kind: np.ndarray
) -> None:
    """Write the readings of all proximity sensors, without error; -1 where no body is seen."""
    centres = np.concatenate([solids.centres, shapely.points(swarm.position)])
    radii = np.concatenate([solids.radii, swarm.radius])
    body_kinds = surroundings.bodies.visible_kinds[surroundings.rows[solids.disc_shape]]
    kinds = np.concatenate([body_kinds, np.full(len(swarm), ROBOT)])
    distance[:], kind[:] = -1.0, NOTHING
    for i in range(len(swarm)):
        others = np.arange(len(radii)) != len(solids.radii) + i
        discs = centres[others], radii[others], kinds[others]
        for s in range(swarm.table.counts[swarm.design[i]]):
            view = view_of(swarm, i, swarm.table.proximity[swarm.design[i], s], reach_beyond(radii))
            distance[i, s], kind[i, s] = nearest_in_view(view, solids, *discs)


def sense_radiation_by_shapely(swarm: Swarm, surroundings: Surroundings, radiation: np.ndarray) -> None:
    """Write the highest temperature among the sources of heat in each radiation sensor's sector."""
    bodies = surroundings.bodies
    rows = np.flatnonzero((bodies.temperature > 0) & (bodies.mode != CARRIED)).tolist()
    shapes = [(bodies.shape_of(row), bodies.temperature[row]) for row in rows]
    discs = [(shape.geometry, shape.radius, heat) for shape, heat in shapes if shape.is_disc]
    outlines = [(shape.geometry.boundary, heat) for shape, heat in shapes if not shape.is_disc]
    beyond = reach_beyond(np.array([radius for _, radius, _ in discs], float))
    radiation[:] = 0.0
    for i, design in enumerate(swarm.design):
        for s in range(len(swarm.designs[design].radiation)):
            view = view_of(swarm, i, swarm.table.radiation[design, s], beyond)
            heats = [heat for centre, radius, heat in discs if distance_to_disc(view, centre, radius) <= view.range]
            heats += [heat for line, heat in outlines if view.apex.distance(view.area.intersection(line)) <= view.range]
            radiation[i, s] = max(heats, default=0.0)


def sense_line_by_shapely(swarm: Swarm, surroundings: Surroundings, line: np.ndarray) -> None:
    """Write whether each line sensor is over a mark on the ground."""
    marks = [(shape.geometry, shape.radius) for shape in surroundings.present_shapes if not shape.contact]
    line[:] = False
    for i, design in enumerate(swarm.design):
        for s in range(len(swarm.designs[design].line)):
            point = Point(place_in_world(swarm, i, swarm.table.line[design, s]))
            line[i, s] = any(point.distance(geometry) <= radius for geometry, radius in marks)


def nearest_in_view(
    view: View, solids: Solids, centres: np.ndarray, radii: np.ndarray, kinds: np.ndarray
) -> tuple[float, int]:
    """Return distance and kind of the nearest body in a view; of equally near bodies the lowest kind."""
    polygons = solids.tree.query(view.apex, predicate="dwithin", distance=view.range)
    near = np.flatnonzero(shapely.distance(view.apex, centres) - radii <= view.range)
    bodies = [(distance_to_polygon(view, solids.polygons[p]), int(solids.polygon_body[p])) for p in polygons]
    bodies += [(distance_to_disc(view, centres[k], radii[k]), int(kinds[k])) for k in near]
    return min((body for body in bodies if body[0] <= view.range), default=(-1.0, NOTHING))


def distance_to_polygon(view: View, polygon: Polygon) -> float:
    """Return the distance from the apex to the nearest part of a polygon in the view, NaN if outside."""
    if view.apex.intersects(polygon):
        return 0.0
    return view.apex.distance(view.area.intersection(polygon))


def distance_to_disc(view: View, centre: Point, radius: float) -> float:
    """Return the distance from the apex to the nearest part of a disc in the view, `inf` if outside."""
    gap = view.apex.distance(centre) - radius
    if gap <= 0.0:
        return 0.0
    if view.area.covers(centre):
        return gap
    return min((_first_hit(ray, centre, radius) for ray in view.rays), default=math.inf)


def _first_hit(ray: LineString, centre: Point, radius: float) -> float:
    """Return the distance along a ray to a disc that does not contain its beginning (A.12, A.13)."""
    along, across = ray.project(centre), ray.distance(centre)
    return along - math.sqrt(radius**2 - across**2) if across <= radius else math.inf


def view_of(swarm: Swarm, i: int, sensor: np.ndarray, beyond: float) -> View:
    """Return the view of a sensor of robot i, a row of `DesignTable.proximity` or `radiation`; see `reach_beyond`."""
    apex = place_in_world(swarm, i, sensor[[MOUNT_X, MOUNT_Y]])
    azimuth = swarm.heading[i] + atan2(sensor[AXIS_Y], sensor[AXIS_X])
    half, count, reach = sensor[HALF], int(sensor[RAYS]), sensor[RANGE] + beyond
    turns = np.linspace(-half, half, count) if count > 1 else np.zeros(count)
    if count == 0 and half < math.pi:
        turns = np.array([-half, half])
    rays = tuple(LineString([apex, _toward(apex, azimuth + turn, reach)]) for turn in turns)
    area = MultiLineString(rays) if count else make_wedge(apex, azimuth, half, reach)
    return View(Point(apex), area, rays, sensor[RANGE])


def reach_beyond(radii: np.ndarray) -> float:
    """Return by how much a view reaches beyond its range: past the centre of any disc whose rim it sees."""
    return 1.0 + radii.max(initial=0.0)


def make_wedge(apex: np.ndarray, azimuth: float, half: float, reach: float) -> BaseGeometry:
    """Return a wedge that covers the sector of half angle `half` (rad) about an azimuth as far as `reach`.

    A half angle of 0 makes the wedge a line; pi or more, a plain polygon around the apex.
    """
    steps = max(1, math.ceil(2 * half / WIDEST_STEP))
    far = reach / cos(half / steps)
    fan = [_toward(apex, azimuth + turn, far) for turn in np.linspace(-half, half, steps + 1)]
    if half == 0.0:
        return LineString([apex, fan[0]])
    return Polygon(fan[:-1]) if half >= math.pi else Polygon([apex, *fan])


def place_in_world(swarm: Swarm, i: int, mount: np.ndarray) -> np.ndarray:
    """Return the place of a mount of robot i in the world (A.8, A.9)."""
    cosine, sine = direction_of(swarm.heading[i])
    return swarm.position[i] + np.array([[cosine, -sine], [sine, cosine]]) @ mount


def _toward(origin: np.ndarray, azimuth: float, distance: float) -> tuple[float, float]:
    cosine, sine = direction_of(azimuth)
    return origin[0] + distance * cosine, origin[1] + distance * sine


# A robot is pushed by others at most this share of its radius at once.
LONGEST_PUSH = 0.25
FEWEST_PLACES, MOST_PLACES = 16, 720
# Each ring is at least this much wider than the last: a large map would otherwise take very long.
GROWTH = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One overlap of a robot: depth, unit vector out of it, whether with a flat face, and the other body."""

    depth: float
    normal: np.ndarray
    flat: bool
    kind: int
    index: int


class Touches:
    """The deepest touch of every robot in this step, in the swarm's columns, and of a face in this piece."""

    def __init__(self, columns: dict[str, np.ndarray]) -> None:
        self.number = columns["number"]
        self.kind, self.index, self.normal, self.depth = (columns[name] for name in CONTACT_COLUMNS)
        self.kind[:], self.index[:], self.normal[:], self.depth[:] = -1, -1, 0.0, 0.0
        self.face = np.zeros((len(self.kind), 3))

    def note(self, i: int, touch: Touch) -> None:
        """Write a touch of robot i if it is its deepest."""
        if touch.depth > self.depth[i]:
            self.kind[i], self.index[i] = touch.kind, touch.index
            self.normal[i], self.depth[i] = touch.normal, touch.depth
        if touch.flat and touch.depth > self.face[i, 2]:
            self.face[i] = *touch.normal, touch.depth


def stop_at_loads_by_shapely(surroundings: Surroundings) -> None:
    """Write which driven bodies a load stops: it is where the body is to go, or on the way."""
    table, rows = surroundings.bodies, surroundings.driven
    for row, is_sent in zip(rows.tolist(), table.are_to_move(rows).tolist(), strict=True):
        loads = surroundings.loads.tolist() if is_sent else []
        table.blocked[row] = any(is_in_the_way(load, row, table) for load in loads)


def is_in_the_way(load: int, row: int, table: BodyTable) -> bool:
    """Return whether a load overlaps a driven body at a place of its way, of those at which it is looked for."""
    form, other, pose = cast(Form, table.forms[row]), cast(Form, table.forms[load]), table.pose_of(load)
    start = np.array(table.pose_of(row))
    way = np.append(table.aim[row], table.aim_heading[row]) - start
    way[2] = wrap_angle(way[2])
    length = hypot(way[0], way[1])
    if hypot(start[0] - pose[0], start[1] - pose[1]) > form.reach + other.reach + length:
        return False
    count = math.ceil((length + form.reach * abs(way[2])) / (LOOK * min(form.thickness, other.thickness)))
    shares = np.arange(1, min(count, MOST_LOOKS) + 1) / min(count, MOST_LOOKS)
    return any(other.overlaps(pose, form.shape_at(tuple((start + share * way).tolist()))) for share in shares)


class Travelling:
    """The driven bodies on their way through a step, and all solids as they are in each piece of it."""

    def __init__(self, surroundings: Surroundings, make_solids: Callable[[], Solids], radius: np.ndarray) -> None:
        self.solids, self._make_solids = make_solids(), make_solids
        self._bodies, self._rows = table, rows = surroundings.bodies, surroundings.driven
        self._begin = self._before = self._poses()
        self._longest = LONGEST_STEP * radius.min(initial=math.inf)
        self._end = np.column_stack([table.aim[rows], table.aim_heading[rows]])
        ways = self._end - self._begin
        self._turns = np.array([wrap_angle(turn) for turn in ways[:, 2]])
        far = vector_lengths(ways[:, 0], ways[:, 1]) + table.reach[rows] * abs(self._turns)
        self._pieces_of = np.ceil(far / self._longest - 1e-9)

    def pieces(self, pieces: int) -> int:
        """Return the number of pieces of a step, more than those of the robots if bodies travel farther."""
        travels = self._pieces_of[self._under_way & (self._pieces_of <= MOST_PIECES)]
        return max(pieces, int(travels.max(initial=0.0)))

    def advance(self, piece: int, pieces: int, position: np.ndarray, radius: np.ndarray) -> None:
        """Move the bodies through a piece of their way; those that have too far to go jump in the first one."""
        self._before = self._poses()
        moves = self._under_way
        for b in np.flatnonzero(moves).tolist():
            jumps = self._pieces_of[b] > MOST_PIECES
            if jumps or piece == pieces - 1:
                self._put(b, self._end[b])
            else:
                pose = self._begin[b] + (piece + 1) / pieces * (self._end[b] - self._begin[b])
                self._put(b, (*pose[:2], wrap_angle(self._begin[b, 2] + (piece + 1) / pieces * self._turns[b])))
            if jumps and self._overlapped(b, position, radius).any():
                self._stop(b)
        if moves.any():
            self.solids = self._make_solids()

    def return_overlapping(self, position: np.ndarray, radius: np.ndarray, goes: np.ndarray) -> bool:
        """Return the bodies that overlap robots to where they were before this piece, and mark these robots.

        The result is whether a body moved, or a robot was marked that was not before.
        """
        has_changed = False
        poses = self._poses()
        for b in range(len(poses)):
            if self._bodies.mode[self._rows[b]] == CARRIED:
                continue
            overlapped = self._overlapped(b, position, radius)
            has_changed |= bool((overlapped & ~goes).any())
            goes |= overlapped
            if overlapped.any() and (poses[b] != self._before[b]).any():
                self._stop(b)
                has_changed = True
        if has_changed:
            self.solids = self._make_solids()
        return has_changed

    @property
    def _under_way(self) -> np.ndarray:
        return (self._pieces_of > 0) & ~self._bodies.blocked[self._rows]

    def _poses(self) -> np.ndarray:
        return np.column_stack([self._bodies.position[self._rows], self._bodies.heading[self._rows]])

    def _put(self, b: int, pose: Sequence[float] | np.ndarray) -> None:
        row = self._rows[b]
        self._bodies.position[row], self._bodies.heading[row] = pose[:2], pose[2]

    def _stop(self, b: int) -> None:
        self._put(b, self._before[b])
        self._bodies.blocked[self._rows[b]] = True

    def _overlapped(self, b: int, position: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Return which robots overlap a body."""
        shape = self._bodies.shape_of(self._rows[b])
        gaps = shapely.distance(shape.geometry, shapely.points(position)) - shape.radius
        return gaps < radius - SLOP * radius


def travel_by_shapely(
    columns: dict[str, np.ndarray], motion: np.ndarray, turn_angle: float, bodies: Travelling
) -> np.ndarray:
    """Move all robots through one step, resolve every contact, and return by how much faces turned each (rad).

    Of the swarm's columns, position, heading, collided and contact_... are written.
    """
    position, heading, radius = columns["position"], columns["heading"], columns["radius"]
    contacts, extra_turn = Touches(columns), np.zeros(len(heading))
    pieces = bodies.pieces(count_pieces(motion, radius))
    for piece in range(pieces):
        before = position.copy()
        contacts.face[:] = 0.0
        bodies.advance(piece, pieces, position, radius)
        advance_robots(position, heading, motion, pieces)
        if not separate_by_shapely(position, radius, bodies.solids, contacts, int(MOST_SWEEPS)):
            return_overlapping(position, before, radius, bodies.solids, contacts, bodies)
        turn_along_faces(np.arange(len(heading)), heading, motion, contacts.face, turn_angle, extra_turn)
    columns["collided"][:] = contacts.depth > 0.0
    return extra_turn


def separate_by_shapely(
    position: np.ndarray, radius: np.ndarray, solids: Solids, contacts: Touches, most_sweeps: int
) -> bool:
    """Push until no two bodies overlap, at most `most_sweeps` times, and return whether that succeeded."""
    free = np.array([leave_statics(i, position, radius[i], solids, contacts) for i in range(len(radius))])
    for _ in range(most_sweeps):
        pairs = overlapping_pairs(position, radius)
        if not len(pairs):
            return bool(free.all())
        for i in push_robot_pairs(position, radius, pairs, contacts):
            free[i] = leave_statics(i, position, radius[i], solids, contacts)
    return False


def overlapping_pairs(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return the pairs (i, j), i < j, of robots that overlap, sorted; shape (k, 2)."""
    points = shapely.points(position)
    i, j = STRtree(points).query(points, predicate="dwithin", distance=2 * radius.max(initial=0.0))
    overlap = radius[i] + radius[j] - shapely.distance(points[i], points[j])
    deep = (i < j) & (overlap > SLOP * np.minimum(radius[i], radius[j]))
    return np.array(sorted(zip(i[deep], j[deep], strict=True)), np.int64).reshape(-1, 2)


def push_robot_pairs(position: np.ndarray, radius: np.ndarray, pairs: np.ndarray, contacts: Touches) -> np.ndarray:
    """Push all robots that overlap others at once, half of each overlap (A.7); return the rows that moved."""
    push = np.zeros_like(position)
    for i, j in pairs:
        touch = touch_of_robots(i, j, position, radius, contacts.number)
        push[i] += touch.normal * touch.depth / 2
        push[j] -= touch.normal * touch.depth / 2
        note_both(i, j, touch, contacts)
    length = vector_lengths(*push.T)
    share = np.minimum(1.0, LONGEST_PUSH * radius / np.maximum(length, 1e-300))
    position += share[:, None] * push
    return np.flatnonzero(length)


def touch_of_robots(i: int, j: int, position: np.ndarray, radius: np.ndarray, number: np.ndarray) -> Touch:
    """Return the touch of robot i by robot j."""
    distance = Point(position[i]).distance(Point(position[j]))
    apart = position[i] - position[j]
    normal = apart / distance if distance > 0.0 else np.array(coincident_direction(number[i], number[j]))
    return Touch(radius[i] + radius[j] - distance, normal, False, ROBOT, j)


def note_both(i: int, j: int, touch: Touch, contacts: Touches) -> None:
    """Note a touch of robot i by robot j, for both."""
    contacts.note(i, touch)
    contacts.note(j, replace(touch, normal=-touch.normal, index=i))


def leave_statics(i: int, position: np.ndarray, radius: float, solids: Solids, contacts: Touches) -> bool:
    """Move robot i out of static bodies, deepest overlap first, and return whether it is out."""
    for _ in range(MOST_PUSHES):
        touch = deepest_solid(position[i], radius, solids)
        if touch is None:
            return True
        position[i] += touch.depth * touch.normal
        contacts.note(i, touch)
    return False


def deepest_solid(centre: np.ndarray, radius: float, solids: Solids) -> Touch | None:
    """Return the deepest overlap of a disc with static bodies, or None."""
    point = Point(centre)
    near = np.sort(solids.tree.query(point, predicate="dwithin", distance=radius))
    touches = [_touch_of_polygon(point, radius, solids, p) for p in near]
    gaps = shapely.distance(point, solids.centres) - solids.radii
    touches += [_touch_of_disc(point, radius, solids, k) for k in np.flatnonzero(gaps < radius).tolist()]
    deepest = max(touches, key=lambda touch: touch.depth, default=None)
    return deepest if deepest and deepest.depth > SLOP * radius else None


def _touch_of_polygon(point: Point, radius: float, solids: Solids, p: int) -> Touch:
    """Return the touch of a disc by a polygon: of a flat face unless the nearest point is a vertex."""
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
    """Return the unit vector out of a polygon across the edge that is nearest to a point."""
    solid = orient(polygon)
    rings = [shapely.get_coordinates(ring) for ring in (solid.exterior, *solid.interiors)]
    edges = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    begin, end = edges[shapely.distance(shapely.linestrings(edges), point).argmin()]
    ahead = (end - begin) / Point(begin).distance(Point(end))
    return np.array([ahead[1], -ahead[0]])


def _touch_of_disc(point: Point, radius: float, solids: Solids, k: int) -> Touch:
    """Return the touch of a disc by a static disc."""
    distance = point.distance(solids.centres[k])
    apart = shapely.get_coordinates(point)[0] - shapely.get_coordinates(solids.centres[k])[0]
    depth = radius + solids.radii[k] - distance
    return Touch(depth, apart / distance, False, solids.disc_body[k], solids.disc_owner[k])


def return_overlapping(
    position: np.ndarray,
    before: np.ndarray,
    radius: np.ndarray,
    solids: Solids,
    contacts: Touches,
    bodies: Travelling | None = None,
) -> None:
    """Return to their last free place the robots and driven bodies that overlap, and those that then overlap them.

    All that overlap return at once: independent of the order of robots.
    """
    discs = zip(position, radius, strict=True)
    back = np.zeros(len(radius), bool)
    goes = np.array([deepest_solid(centre, r, solids) is not None for centre, r in discs])
    if bodies is not None:
        bodies.return_overlapping(position, radius, goes)
    while True:
        for i, j in overlapping_pairs(position, radius):
            if not (back[i] and back[j]):
                note_both(i, j, touch_of_robots(i, j, position, radius, contacts.number), contacts)
                goes[[i, j]] = True
        went = (goes != back).any()
        position[goes] = before[goes]
        back = goes.copy()
        has_changed = bodies is not None and bodies.return_overlapping(position, radius, goes)
        if not (went or has_changed):
            return


def settle_by_shapely(columns: dict[str, np.ndarray], bounds: tuple[float, ...], solids: Solids) -> None:
    """Move every robot that overlaps anything to free room nearby, whatever the tangle, or raise `PlacementError`."""
    position, radius = columns["position"], columns["radius"]
    for i in range(len(radius)):
        if not is_free_of_solids(position[i : i + 1], radius[i], solids)[0]:
            move_to_free_place(i, position, radius, bounds, solids, apart=False)
    contacts = Touches({name: column.copy() for name, column in columns.items()})
    if not separate_by_shapely(position, radius, solids, contacts, int(SWEEPS)):
        separate_placed_robots(position, radius, bounds, solids)


def separate_placed_robots(position: np.ndarray, radius: np.ndarray, bounds: tuple[float, ...], solids: Solids) -> None:
    """Move, one after the other, robots that still overlap anything."""
    for i in range(len(radius)):
        place = position[i : i + 1]
        if is_free_of_solids(place, radius[i], solids)[0] and is_apart_from_robots(i, place, position, radius)[0]:
            continue
        if not move_to_free_place(i, position, radius, bounds, solids, apart=True):
            raise no_room_error(i, radius)


def is_free_of_solids(places: np.ndarray, radius: float, solids: Solids) -> np.ndarray:
    """Return whether a disc at each of these places overlaps no static body."""
    return solids.gaps(places) >= radius - SLOP * radius


def is_on_map(places: np.ndarray, bounds: tuple[float, ...]) -> np.ndarray:
    """Return whether each of these places is within the map."""
    inside = (places >= bounds[:2]) & (places <= bounds[2:])
    return np.logical_and.reduce(inside, axis=1)


def is_apart_from_robots(i: int, places: np.ndarray, position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return whether robot i at each of these places would overlap no other."""
    others = np.arange(len(radius)) != i
    near = radius[i] + radius[others] - SLOP * np.minimum(radius[i], radius[others])
    distance = shapely.distance(shapely.points(places)[:, None], shapely.points(position[others]))
    return (distance >= near).all(axis=1)


def move_to_free_place(
    i: int, position: np.ndarray, radius: np.ndarray, bounds: tuple[float, ...], solids: Solids, *, apart: bool
) -> bool:
    """Move robot i to the first free place on growing rings around it and return whether there is one."""
    for places in places_on_rings(position[i].copy(), radius[i], bounds):
        # The solid outside is a ring of finite width; beyond it, off the map, a place would count as free.
        free = is_on_map(places, bounds) & is_free_of_solids(places, radius[i], solids)
        if apart:
            free &= is_apart_from_robots(i, places, position, radius)
        if free.any():
            position[i] = places[np.argmax(free)]
            return True
    return False


def places_on_rings(centre: np.ndarray, radius: float, bounds: tuple[float, ...]) -> Iterator[np.ndarray]:
    """Yield places on growing circles around a point until they are beyond the map."""
    farthest = 2 * Point(bounds[:2]).distance(Point(bounds[2:]))
    distance = 0.0
    while distance < farthest:
        distance += max(RING * radius, GROWTH * distance)
        count = FEWEST_PLACES + min(int(2 * math.pi * distance / (RING * radius)), MOST_PLACES)
        azimuth = 2 * math.pi * np.arange(count) / count
        yield centre + distance * np.column_stack(directions_of(azimuth))


class ShapelyEngine(Engine):
    """Sensing and contact by Shapely: the readable twin of `CompiledEngine`. One thread does all."""

    def __init__(self) -> None:
        super().__init__()
        self._solid: tuple[Surroundings, Solids] | None = None
        self._noted: tuple[Any, ...] = (None, None)

    def sense(self, swarm: Swarm, surroundings: Surroundings, step: int, noise: SensorNoise | None) -> None:
        """Write the columns distance, kind, radiation and line."""
        columns, table, design = swarm.columns, swarm.table, swarm.columns["design"]
        distance, kind = columns["distance"], columns["kind"]
        state = step, swarm.version, surroundings
        if self._noted[0] != state:  # of a step that is sensed again the readings before it are the same
            self._noted = state, (distance.copy(), kind.copy())
        sense_proximity_by_shapely(swarm, surroundings, self._solids_of(swarm, surroundings), distance, kind)
        if noise is not None and len(swarm):
            draws = noise.draw(step, distance.shape)
            add_errors(distance, design, table.proximity, table.noise, draws, step, columns["error"])
        hold_readings(step, design, table.noise, *self._noted[1], distance, kind)
        sense_radiation_by_shapely(swarm, surroundings, columns["radiation"])
        sense_line_by_shapely(swarm, surroundings, columns["line"])

    def travel(self, swarm: Swarm, surroundings: Surroundings, motion: np.ndarray, turn_angle: float) -> np.ndarray:
        """Write position, heading and the contact columns."""
        begin_way(surroundings, stop_at_loads_by_shapely)
        bodies = Travelling(surroundings, lambda: self._solids_of(swarm, surroundings), swarm.radius)
        extra_turn = travel_by_shapely(swarm.columns, motion, turn_angle, bodies)
        if surroundings.moving is not None:
            surroundings.moving.place()
        return extra_turn

    def settle(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Move robots that overlap anything to free room nearby."""
        settle_by_shapely(swarm.columns, surroundings.bounds, self._solids_of(swarm, surroundings))

    def _solids_of(self, swarm: Swarm, surroundings: Surroundings) -> Solids:
        """Return all solids, collected anew when the surroundings are others, and where bodies may have moved."""
        moves = len(surroundings.loads) or surroundings.moving
        if self._solid is None or self._solid[0] is not surroundings or moves:
            largest = max((design.radius for design in swarm.designs), default=0.0)
            margin = 1.0 + 2.0 * (largest + swarm.table.reach.max(initial=0.0))
            self._solid = surroundings, Solids.of(surroundings, margin)
        return self._solid[1]
