"""The world around the robots as the engines need it, and the room for loads."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry.base import BaseGeometry

from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.physics.contact import StaticArrays
from mesa_swarm.physics.moving import Moving
from mesa_swarm.world.bodies import Body, Load, Pose, placed
from mesa_swarm.world.movers import Driven, Movers
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import LOAD, OBSTACLE, SOURCE, Marks, Statics

# Loads may move this far before they are listed anew, in radii of the largest robot; and this far in one step.
SLACK = 4.0
STEP = 0.5
# Ways of driven bodies are searched for loads at places this share of the thinner body's thickness apart, at no more
# than this number of places.
LOOK = 0.5
MOST_LOOKS = 64


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
    movers: Movers | None

    @classmethod
    def of(cls, statics: Statics, loads: tuple[Load, ...], rows: Sequence[int], movers: Movers | None) -> "Room":
        """Collect the static bodies: all shapes but those with the indices `rows`."""
        still = ~np.isin(statics.owner, rows) | (statics.body == SOURCE)
        lines = shapely.linestrings(statics.edges[still[: len(statics.edges)]].reshape(-1, 2, 2))
        discs = statics.discs[still[len(statics.edges) :]]
        solids = np.concatenate([lines, shapely.points(discs[:, :2])])
        radii = np.concatenate([np.zeros(len(lines)), discs[:, 2]])
        return cls(solids=solids, radii=radii, tree=STRtree(solids), loads=loads, movers=movers)

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
        if self.movers is None:
            return []
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

    `shapes` are obstacles, loads, marks and driven bodies (see `present_shapes`), `codes` their kinds, and `rows` the
    indices of the loads among them, `driven` those of driven bodies, which `moving` moves. `sources` (k, 3) are
    x, y, radius of bodies that radiate heat, with temperature 0 once cold. `listed` are the poses of the loads when the
    tables were made; they may move by `slack` from there. `room` is what loads may not overlap, None without loads.
    """

    bounds: tuple[float, float, float, float]
    shapes: list[Shape]
    sources: np.ndarray
    temperature: np.ndarray
    statics: Statics
    marks: Marks
    loads: tuple[Load, ...] = ()
    rows: tuple[int, ...] = ()
    listed: tuple[Pose, ...] = ()
    slack: float = 0.0
    room: Room | None = None
    codes: tuple[int, ...] = ()
    driven: tuple[int, ...] = ()
    moving: Moving | None = None

    @classmethod
    def of(
        cls,
        bounds: tuple[float, float, float, float],
        shapes: Sequence[Shape],
        sources: np.ndarray,
        temperature: np.ndarray,
        *,
        sight: float,
        touch: float,
        loads: Sequence[tuple[int, Load]] = (),
        codes: Sequence[int] = (),
        driven: Sequence[int] = (),
        movers: Movers | None = None,
    ) -> "Surroundings":
        """Collect all bodies; `sight`, `touch`, `codes`, `driven` as `Statics.of` takes them, loads with indices.

        `movers` are the poses of the driven bodies, in the order of `driven`.
        """
        rows, bodies = tuple(row for row, _ in loads), tuple(load for _, load in loads)
        slack, solid = SLACK * touch, list(shapes)
        for row, load in loads:
            solid[row] = load.form.body_at(load.pose)
        for place, row in enumerate(driven):
            body = cast(Movers, movers).agents[place]
            solid[row] = body.form.body_at(body.pose)
        statics = Statics.of(
            bounds,
            solid,
            sources,
            temperature > 0,
            sight=sight,
            touch=touch,
            loads=rows,
            slack=slack,
            codes=codes,
            driven=driven,
        )
        known = codes or [LOAD if row in rows else OBSTACLE for row in range(len(shapes))]
        return cls(
            bounds,
            list(shapes),
            sources,
            temperature,
            statics,
            Marks.of(shapes),
            bodies,
            rows,
            tuple(load.pose for load in bodies),
            slack - STEP * touch,
            Room.of(statics, bodies, [*rows, *driven], movers) if loads else None,
            tuple(known),
            tuple(driven),
            Moving(movers, list(driven), statics, bounds, sight, touch) if movers is not None and len(driven) else None,
        )

    @property
    def present_shapes(self) -> list[Shape]:
        """All shapes as they are now, those of driven bodies too."""
        if self.moving is not None:
            for row, body in zip(self.driven, self.moving.movers.agents, strict=True):
                self.shapes[row] = body.shape
        return self.shapes

    @property
    def carried(self) -> set[int]:
        """The indices of the shapes that robots carry: they are nowhere."""
        if self.moving is None:
            return set()
        return {self.driven[place] for place in np.flatnonzero(self.moving.movers.carried)}

    @property
    def still(self) -> StaticArrays:
        """What robots can touch besides each other and driven bodies, as compiled functions take it."""
        s = self.statics
        return StaticArrays(s.edges, s.discs, s.owner, s.body, s.bounds, s.touched, None)

    @property
    def solids(self) -> StaticArrays:
        """The same with driven bodies."""
        return self.still._replace(movers=None if self.moving is None else self.moving.arrays)

    def blocked_by_loads(self) -> np.ndarray:
        """Return which driven bodies a load stops: it is where the body is to go, or on the way."""
        movers = cast(Moving, self.moving).movers
        blocked = np.zeros(len(movers), bool)
        for b in np.flatnonzero(movers.asked).tolist() if self.loads else ():
            blocked[b] = any(self._is_in_the_way(load, movers, b) for load in self.loads)
        return blocked

    def _is_in_the_way(self, load: Load, movers: Movers, b: int) -> bool:
        here, there = np.append(movers.position[b], movers.heading[b]), np.append(movers.aim[b], movers.aim_heading[b])
        way = there - here
        way[2] = wrapped(way[2])
        far = movers.reach[b] + load.form.reach
        length = math.hypot(way[0], way[1])
        if math.hypot(here[0] - load.pose[0], here[1] - load.pose[1]) > far + length:
            return False
        form = movers.agents[b].form
        count = math.ceil((length + form.reach * abs(way[2])) / (LOOK * min(form.thickness, load.form.thickness)))
        shares = np.arange(1, min(count, MOST_LOOKS) + 1) / min(count, MOST_LOOKS)
        return any(load.form.overlaps(load.pose, form.shape_at(tuple((here + s * way).tolist()))) for s in shares)

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
