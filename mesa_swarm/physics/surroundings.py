"""The world around the robots as the engines need it, and the room for loads."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry.base import BaseGeometry

from mesa_swarm.world.bodies import Load, Pose, placed
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import LOAD, Marks, Statics

# Loads may move this far before they are listed anew, in radii of the largest robot; and this far in one step.
SLACK = 4.0
STEP = 0.5


class Stop(NamedTuple):
    """A point at which a load leans on a body: unit vector towards the load, and its lever arm about the centre."""

    x: float
    y: float
    arm: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Room:
    """The static lines and discs that are not loads, in a tree, and the loads, as they are now.

    `solids` are the edges, the border's first, then the centres of discs; `radii` are 0 for edges.
    """

    solids: np.ndarray
    radii: np.ndarray
    tree: STRtree
    loads: tuple[Load, ...]

    @classmethod
    def of(cls, statics: Statics, loads: tuple[Load, ...]) -> "Room":
        """Collect the static bodies other than loads."""
        still = statics.body != LOAD
        lines = shapely.linestrings(statics.edges[still[: len(statics.edges)]].reshape(-1, 2, 2))
        discs = statics.discs[still[len(statics.edges) :]]
        solids = np.concatenate([lines, shapely.points(discs[:, :2])])
        radii = np.concatenate([np.zeros(len(lines)), discs[:, 2]])
        return cls(solids=solids, radii=radii, tree=STRtree(solids), loads=loads)

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
        for other in self.loads:
            body = other.shape
            if other is not load and shapely.distance(core, body.geometry) <= distance + body.radius:
                yield body.geometry, body.radius


def _stops(load: Load, solid: BaseGeometry, distance: float) -> list[Stop]:
    """Return the stops of a load on a solid: corners of either that are this near the other, or the nearest point.

    The direction is that of the line to the load's heart: between bodies that touch it is undefined.
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
    """Return the corners of each of two geometries that are within a distance of the other, each once."""
    found: list[tuple[float, float]] = []
    for one, other in ((a, b), (b, a)):
        corners = shapely.get_coordinates(one)
        near = shapely.distance(other, shapely.points(corners)) <= distance
        found += [(x, y) for x, y in corners[near].tolist()]
    return list(dict.fromkeys(found))


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The world without its robots; shapes and temperatures are as they are now.

    `shapes` are obstacles, loads and marks, and `rows` the indices of the loads among them. `fires` (f, 3) are x, y,
    radius, with temperature 0 once out. `listed` are the poses of the loads when the tables were made; they may move by
    `slack` from there. `room` is what loads may not overlap, None without loads.
    """

    bounds: tuple[float, float, float, float]
    shapes: list[Shape]
    fires: np.ndarray
    temperature: np.ndarray
    statics: Statics
    marks: Marks
    loads: tuple[Load, ...] = ()
    rows: tuple[int, ...] = ()
    listed: tuple[Pose, ...] = ()
    slack: float = 0.0
    room: Room | None = None

    @classmethod
    def of(
        cls,
        bounds: tuple[float, float, float, float],
        shapes: Sequence[Shape],
        fires: np.ndarray,
        temperature: np.ndarray,
        *,
        sight: float,
        touch: float,
        loads: Sequence[tuple[int, Load]] = (),
    ) -> "Surroundings":
        """Collect all static bodies; `sight` and `touch` as `Statics.of` takes them, loads with their indices."""
        rows, bodies = tuple(row for row, _ in loads), tuple(load for _, load in loads)
        slack, solid = SLACK * touch, list(shapes)
        for row, load in loads:
            solid[row] = load.form.body_at(load.pose)
        statics = Statics.of(bounds, solid, fires, temperature > 0, sight=sight, touch=touch, loads=rows, slack=slack)
        return cls(
            bounds,
            list(shapes),
            fires,
            temperature,
            statics,
            Marks.of(shapes),
            bodies,
            rows,
            tuple(load.pose for load in bodies),
            slack - STEP * touch,
            Room.of(statics, bodies) if loads else None,
        )

    @property
    def is_worn(self) -> bool:
        """Whether a load has moved so far that the tables have to be made anew before the next step."""
        moved = zip(self.loads, self.listed, strict=True)
        return any(load.farthest_from(pose) > self.slack for load, pose in moved)

    def follow(self, k: int) -> None:
        """Update the tables to the present pose of load k."""
        row, load = self.rows[k], self.loads[k]
        self.shapes[row] = load.shape
        self.statics.follow(row, load.form.body_at(load.pose))
