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
        core, heart = placed(load.form.core, load.pose), placed(load.form.heart, load.pose)
        near = self._near(load, core, load.form.core_radius + distance)
        return [stop for solid in near for stop in _stops(solid, heart, load.pose, distance)]

    def _near(self, load: Load, core: BaseGeometry, distance: float) -> Iterator[BaseGeometry]:
        """Yield all that is no farther from the core of a load than a distance."""
        far = distance + self.radii.max(initial=0.0)
        rows = np.sort(self.tree.query(core, predicate="dwithin", distance=far))
        gaps = shapely.distance(core, self.solids[rows]) - self.radii[rows]
        yield from self.solids[rows[gaps <= distance]]
        for other in self.loads:
            body = other.shape
            if other is not load and shapely.distance(core, body.geometry) <= distance + body.radius:
                yield body.geometry


def _stops(solid: BaseGeometry, heart: BaseGeometry, pose: Pose, distance: float) -> Iterator[Stop]:
    """Yield how a load leans on a solid: at each corner that is next to it, or else where it is nearest.

    Directions are those of lines to the heart, for bodies that touch have none between them.
    """
    corners = shapely.points(shapely.get_coordinates(heart))
    near = shapely.distance(solid, corners) <= shapely.distance(solid, heart) + distance
    lines = shapely.shortest_line(solid, corners[near] if near.any() else heart)
    for px, py, qx, qy in shapely.get_coordinates(lines).reshape(-1, 4).tolist():
        length = math.hypot(qx - px, qy - py)
        if length > 0.0:
            x, y = (qx - px) / length, (qy - py) / length
            yield Stop(x, y, (px - pose[0]) * y - (py - pose[1]) * x)
