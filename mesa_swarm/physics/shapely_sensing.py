"""Solids and sensing by Shapely alone.

A sector is an exact wedge, a Shapely polygon that reaches beyond the range; distances beyond the range are
dropped afterwards. Discs stay analytic: no circle is approximated by a polygon.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely import LineString, MultiLineString, Point, Polygon, STRtree
from shapely.geometry.base import BaseGeometry

from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, HALF, MOUNT_X, MOUNT_Y, RANGE, RAYS
from mesa_swarm.robots.swarm import Swarm
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
        polygons.insert(0, (BORDER, outside(surroundings.bounds, margin)))
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


def outside(bounds: tuple[float, float, float, float], margin: float) -> Polygon:
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


def sense_proximity(
    swarm: Swarm, surroundings: Surroundings, solids: Solids, distance: np.ndarray, kind: np.ndarray
) -> None:
    """Write the readings of all proximity sensors, without error; -1 where no body is seen."""
    centres = np.concatenate([solids.centres, shapely.points(swarm.position)])
    radii = np.concatenate([solids.radii, swarm.radius])
    seen = surroundings.bodies.seen[surroundings.rows[solids.disc_shape]]
    kinds = np.concatenate([seen, np.full(len(swarm), ROBOT)])
    distance[:], kind[:] = -1.0, NOTHING
    for i in range(len(swarm)):
        others = np.arange(len(radii)) != len(solids.radii) + i
        discs = centres[others], radii[others], kinds[others]
        for s in range(swarm.table.counts[swarm.design[i]]):
            view = view_of(swarm, i, swarm.table.proximity[swarm.design[i], s], reach_beyond(radii))
            distance[i, s], kind[i, s] = nearest(view, solids, *discs)


def sense_radiation(swarm: Swarm, surroundings: Surroundings, radiation: np.ndarray) -> None:
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
            seen = [heat for centre, radius, heat in discs if distance_to_disc(view, centre, radius) <= view.range]
            seen += [heat for line, heat in outlines if view.apex.distance(view.area.intersection(line)) <= view.range]
            radiation[i, s] = max(seen, default=0.0)


def sense_line(swarm: Swarm, surroundings: Surroundings, line: np.ndarray) -> None:
    """Write whether each line sensor is over a mark on the ground."""
    marks = [(shape.geometry, shape.radius) for shape in surroundings.present_shapes if not shape.contact]
    line[:] = False
    for i, design in enumerate(swarm.design):
        for s in range(len(swarm.designs[design].line)):
            point = Point(in_world(swarm, i, swarm.table.line[design, s]))
            line[i, s] = any(point.distance(geometry) <= radius for geometry, radius in marks)


def nearest(view: View, solids: Solids, centres: np.ndarray, radii: np.ndarray, kinds: np.ndarray) -> tuple[float, int]:
    """Return distance and kind of the nearest body in a view; of equally near bodies the lowest kind."""
    polygons = solids.tree.query(view.apex, predicate="dwithin", distance=view.range)
    near = np.flatnonzero(shapely.distance(view.apex, centres) - radii <= view.range)
    seen = [(distance_to_polygon(view, solids.polygons[p]), int(solids.polygon_body[p])) for p in polygons]
    seen += [(distance_to_disc(view, centres[k], radii[k]), int(kinds[k])) for k in near]
    return min((body for body in seen if body[0] <= view.range), default=(-1.0, NOTHING))


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
    apex = in_world(swarm, i, sensor[[MOUNT_X, MOUNT_Y]])
    azimuth = swarm.heading[i] + math.atan2(sensor[AXIS_Y], sensor[AXIS_X])
    half, count, reach = sensor[HALF], int(sensor[RAYS]), sensor[RANGE] + beyond
    turns = np.linspace(-half, half, count) if count > 1 else np.zeros(count)
    if count == 0 and half < math.pi:
        turns = np.array([-half, half])
    rays = tuple(LineString([apex, _toward(apex, azimuth + turn, reach)]) for turn in turns)
    area = MultiLineString(rays) if count else wedge(apex, azimuth, half, reach)
    return View(Point(apex), area, rays, sensor[RANGE])


def reach_beyond(radii: np.ndarray) -> float:
    """Return by how much a view reaches beyond its range: past the centre of any disc whose rim it sees."""
    return 1.0 + radii.max(initial=0.0)


def wedge(apex: np.ndarray, azimuth: float, half: float, reach: float) -> BaseGeometry:
    """Return a wedge that covers the sector of half angle `half` (rad) about an azimuth as far as `reach`.

    A half angle of 0 makes the wedge a line; pi or more, a plain polygon around the apex.
    """
    steps = max(1, math.ceil(2 * half / WIDEST_STEP))
    far = reach / math.cos(half / steps)
    fan = [_toward(apex, azimuth + turn, far) for turn in np.linspace(-half, half, steps + 1)]
    if half == 0.0:
        return LineString([apex, fan[0]])
    return Polygon(fan[:-1]) if half >= math.pi else Polygon([apex, *fan])


def in_world(swarm: Swarm, i: int, mount: np.ndarray) -> np.ndarray:
    """Return the place of a mount of robot i in the world (A.8, A.9)."""
    cosine, sine = math.cos(swarm.heading[i]), math.sin(swarm.heading[i])
    return swarm.position[i] + np.array([[cosine, -sine], [sine, cosine]]) @ mount


def _toward(origin: np.ndarray, azimuth: float, distance: float) -> tuple[float, float]:
    return origin[0] + distance * math.cos(azimuth), origin[1] + distance * math.sin(azimuth)
