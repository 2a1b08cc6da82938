"""What loads may not overlap: the border, the edges of obstacles, discs, and each other; by Shapely."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry.base import BaseGeometry

from mesa_swarm.world.form import Pose, placed
from mesa_swarm.world.load import Load
from mesa_swarm.world.statics import LOAD, Statics


class Stop(NamedTuple):
    """Something that a load leans on: unit vector from it to the load, and its lever arm about the centre."""

    x: float
    y: float
    arm: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Room:
    """The lines and discs that stand still, in a tree, and the loads.

    Parameters
    ----------
    solids : object ndarray of LineString and Point
        Edges, the border's first, and centres of discs.
    radii : ndarray
        Of the discs; 0 for edges.
    tree : STRtree
        Over the solids.
    loads : tuple of Load
        All of them, as they lie now.
    """

    solids: np.ndarray
    radii: np.ndarray
    tree: STRtree
    loads: tuple[Load, ...]

    @classmethod
    def of(cls, statics: Statics, loads: tuple[Load, ...]) -> "Room":
        """Collect what stands still and is no load."""
        still = statics.body != LOAD
        lines = shapely.linestrings(statics.edges[still[: len(statics.edges)]].reshape(-1, 2, 2))
        discs = statics.discs[still[len(statics.edges) :]]
        solids = np.concatenate([lines, shapely.points(discs[:, :2])])
        radii = np.concatenate([np.zeros(len(lines)), discs[:, 2]])
        return cls(solids=solids, radii=radii, tree=STRtree(solids), loads=loads)

    def has_room_for(self, load: Load, pose: Pose) -> bool:
        """Tell whether a load, lying there, overlaps nothing by more than rounding."""
        core = placed(load.form.core, pose)
        return next(self._near(load, core, load.form.core_radius), None) is None

    def stops_of(self, load: Load, distance: float) -> list[Stop]:
        """Return what a load leans on: all that is within a distance of it as it lies now."""
        core = placed(load.form.core, load.pose)
        near = self._near(load, core, load.form.core_radius + distance)
        return [stop for solid, radius in near for stop in _stops(load, solid, radius + distance)]

    def _near(self, load: Load, core: BaseGeometry, distance: float) -> Iterator[tuple[BaseGeometry, float]]:
        """Yield all that is no farther from the core of a load than a distance, with the radii of discs."""
        far = distance + self.radii.max(initial=0.0)
        rows = np.sort(self.tree.query(core, predicate="dwithin", distance=far))
        rows = rows[shapely.distance(core, self.solids[rows]) - self.radii[rows] <= distance]
        yield from zip(self.solids[rows], self.radii[rows].tolist(), strict=True)
        for other in self.loads:
            body = other.shape
            if other is not load and shapely.distance(core, body.geometry) <= distance + body.radius:
                yield body.geometry, body.radius


def _stops(load: Load, solid: BaseGeometry, distance: float) -> list[Stop]:
    """Return how a load leans on a solid: where corners of either are that near the other, or where it is nearest.

    The direction is that of the line to the load's heart, for bodies that touch have none between them.
    """
    x, y, _ = load.pose
    line = shapely.shortest_line(solid, placed(load.form.heart, load.pose))
    (px, py), (qx, qy) = shapely.get_coordinates(line).tolist()
    length = math.hypot(qx - px, qy - py)
    if length == 0.0:
        return []
    nx, ny = (qx - px) / length, (qy - py) / length
    if load.form.radius:
        return [Stop(nx, ny, 0.0)]
    points = _touching_corners(load.shape.geometry, solid, distance)
    return [Stop(nx, ny, (ax - x) * ny - (ay - y) * nx) for ax, ay in points or [(px, py)]]


def _touching_corners(a: BaseGeometry, b: BaseGeometry, distance: float) -> list[tuple[float, float]]:
    """Return the corners of each of two geometries that are within a distance of the other, none of them twice.

    Examples
    --------
    >>> sorted(_touching_corners(shapely.box(0, 0, 4, 4), shapely.box(4, 1, 9, 9), 0.01))
    [(4.0, 1.0), (4.0, 4.0)]
    """
    found: list[tuple[float, float]] = []
    for one, other in ((a, b), (b, a)):
        corners = shapely.get_coordinates(one)
        near = shapely.distance(other, shapely.points(corners)) <= distance
        found += [(x, y) for x, y in corners[near].tolist()]
    return list(dict.fromkeys(found))
