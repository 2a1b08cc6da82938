"""What stands still, as Shapely geometries: what the Shapely engine senses and touches."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon, STRtree
from shapely.geometry.base import BaseGeometry

from mesa_swarm.physics.scene import Scene
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import BORDER, FIRE, LOAD, OBSTACLE


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Solids:
    """All solid polygons and discs of a world.

    Parameters
    ----------
    polygons : object ndarray of Polygon
        The first is what lies outside the map, as far as any sensor reaches.
    polygon_owner : int64 ndarray
        Index of the obstacle that each polygon is, -1 for the outside.
    polygon_body : int64 ndarray
        0 obstacle or the outside, 3 load.
    tree : STRtree
        Over the polygons.
    centres : object ndarray of Point
        Of the discs: obstacles first, then fires.
    radii : ndarray
    disc_owner : int64 ndarray
        Index of the obstacle or of the fire that each disc is.
    disc_body : int64 ndarray
        0 obstacle, 2 fire, burning or out, 3 load.
    """

    polygons: np.ndarray
    polygon_owner: np.ndarray
    polygon_body: np.ndarray
    tree: STRtree
    centres: np.ndarray
    radii: np.ndarray
    disc_owner: np.ndarray
    disc_body: np.ndarray

    @classmethod
    def of(cls, scene: Scene, margin: float) -> "Solids":
        """Collect what is solid; `margin` is how far beyond the border anything is looked for."""
        solid = [(i, shape) for i, shape in enumerate(scene.shapes) if shape.contact]
        polygons = [(i, shape.geometry) for i, shape in solid if not shape.is_disc]
        polygons.insert(0, (BORDER, outside(scene.bounds, margin)))
        discs = [(i, shape.geometry, shape.radius) for i, shape in solid if shape.is_disc]
        geometries = np.array([geometry for _, geometry in polygons])
        fires, bodies = scene.fires, dict.fromkeys(scene.rows, LOAD)
        return cls(
            polygons=geometries,
            polygon_owner=np.array([i for i, _ in polygons]),
            polygon_body=np.array([bodies.get(i, OBSTACLE) for i, _ in polygons]),
            tree=STRtree(geometries),
            centres=np.array([*(centre for _, centre, _ in discs), *shapely.points(fires[:, :2])], object),
            radii=np.array([*(radius for _, _, radius in discs), *fires[:, 2]], float),
            disc_owner=np.array([*(i for i, _, _ in discs), *range(len(fires))], np.int64),
            disc_body=np.array([*(bodies.get(i, OBSTACLE) for i, _, _ in discs), *[FIRE] * len(fires)], np.int64),
        )

    def disc_kinds(self, burning: np.ndarray) -> np.ndarray:
        """Return what sensors take each disc for: fires that are out are obstacles."""
        kinds = self.disc_body.copy()
        kinds[len(kinds) - len(burning) :][~burning] = OBSTACLE
        return kinds

    def gaps(self, places: np.ndarray) -> np.ndarray:
        """Return how far each place (n, 2) is from the nearest solid; not above 0 inside one."""
        points = shapely.points(places)[:, None]
        to_polygons = shapely.distance(points, self.polygons)
        to_discs = shapely.distance(points, self.centres) - self.radii
        return np.hstack([to_polygons, to_discs]).min(axis=1)


def outside(bounds: tuple[float, float, float, float], margin: float) -> Polygon:
    """Return what lies outside a map, as far as `margin` from it.

    Examples
    --------
    >>> outside((0, 0, 10, 10), 5).area
    300.0
    """
    x_min, y_min, x_max, y_max = bounds
    around = shapely.box(x_min - margin, y_min - margin, x_max + margin, y_max + margin)
    return Polygon(around.exterior, [shapely.box(*bounds).exterior])


def marked_ground(shapes: Sequence[Shape]) -> list[tuple[BaseGeometry, float]]:
    """Return geometry and radius of the marks on the ground; the radius of a polygon is 0."""
    return [(shape.geometry, shape.radius) for shape in shapes if not shape.contact]
