"""The world around the robots as the engines need it, and the room for loads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.physics.contact import StaticArrays
from mesa_swarm.physics.load_room import Poses, Room, poses_of, room_of
from mesa_swarm.physics.moving import Moving, MovingItems, place_items
from mesa_swarm.world.bodies import Body, Load, Loads
from mesa_swarm.world.movers import Movers
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import LOAD, OBSTACLE, Marks, Statics, edges_of

# Loads may move this far before they are listed anew, in radii of the largest robot; and this far in one step.
SLACK = 4.0
STEP = 0.5
# Ways of driven bodies are searched for loads at places this share of the thinner body's thickness apart, at no more
# than this number of places.
LOOK = 0.5
MOST_LOOKS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The world without its robots; shapes and temperatures are as they are now.

    `shapes` are obstacles, loads, marks and driven bodies (see `present_shapes`), `codes` their kinds, and `rows` the
    indices of the loads among them, `driven` those of driven bodies, which `moving` moves. `sources` (k, 3) are
    x, y, radius of the discs of a table of their own that radiate heat, with temperature 0 once cold; `lamps` are the
    other bodies that do. `listed` (m, 3) are the poses of the loads
    when the tables were made; they may move by `slack` from there. `poses` are the present ones, `items` what
    `place_items` takes, and `room` is what loads may not overlap: None without loads.
    """

    bounds: tuple[float, float, float, float]
    shapes: list[Shape]
    sources: np.ndarray
    temperature: np.ndarray
    statics: Statics
    marks: Marks
    loads: Loads
    poses: Poses
    listed: np.ndarray
    rows: tuple[int, ...] = ()
    slack: float = 0.0
    items: MovingItems | None = None
    room: Room | None = None
    codes: tuple[int, ...] = ()
    driven: tuple[int, ...] = ()
    moving: Moving | None = None
    lamps: tuple[Body, ...] = ()

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
        loads: Loads | None = None,
        rows: Sequence[int] = (),
        codes: Sequence[int] = (),
        driven: Sequence[int] = (),
        movers: Movers | None = None,
        room: Room | None = None,
        lamps: Sequence[Body] = (),
    ) -> "Surroundings":
        """Collect all bodies; `sight`, `touch`, `codes`, `driven` as `Statics.of` takes them.

        `movers` are the poses of the driven bodies, in the order of `driven`, and `loads` those in the order of `rows`.
        `room` is that of the same bodies as before, if there is one: of many loads it takes milliseconds to make.
        """
        loads = Loads() if loads is None else loads
        slack, solid = SLACK * touch, list(shapes)
        for row, load in zip(rows, loads, strict=True):
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
            loads=loads,
            poses=poses_of(loads, movers),
            listed=np.column_stack([loads.position, loads.heading]),
            rows=tuple(rows),
            slack=slack - STEP * touch,
            items=items_of(statics, loads, rows),
            room=room or (room_of(statics, loads.agents, [*rows, *driven], movers) if len(loads) else None),
            codes=tuple(known),
            driven=tuple(driven),
            lamps=tuple(lamps),
            moving=Moving(movers, list(driven), statics, bounds, sight, touch)
            if movers is not None and driven
            else None,
        )

    def radiating_discs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return x, y, radius (k, 3) and temperature (k,) of all discs that radiate heat, as they are now."""
        if not self.lamps:
            return self.sources, self.temperature
        discs = [body for body in self.lamps if body.shape.is_disc and not _is_carried(body)]
        own = np.array([[*body.shape.position, body.shape.radius] for body in discs]).reshape(-1, 3)
        heat = np.array([body.temperature for body in discs])
        return np.concatenate([self.sources, own]), np.concatenate([self.temperature, heat])

    def radiating_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges (m, 4) of all polygons that radiate heat, as they are now, and temperatures (m,)."""
        polygons = [body for body in self.lamps if not body.shape.is_disc and not _is_carried(body)]
        edges = [edges_of(body.shape) for body in polygons]
        heat = [np.full(len(own), body.temperature) for own, body in zip(edges, polygons, strict=True)]
        return np.concatenate([np.empty((0, 4)), *edges]), np.concatenate([np.empty(0), *heat])

    @property
    def present_shapes(self) -> list[Shape]:
        """All shapes as they are now, those of loads and driven bodies too."""
        for row, load in zip(self.rows, self.loads, strict=True):
            self.shapes[row] = load.shape
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
        if self.room is None:
            return False
        moved = self.poses.position - self.listed[:, :2]
        turned = 2.0 * np.abs(np.sin((self.poses.heading - self.listed[:, 2]) / 2.0))
        return bool((np.hypot(moved[:, 0], moved[:, 1]) + self.room.forms.reach * turned > self.slack).any())

    def follow(self) -> None:
        """Update the tables to the present poses of the loads."""
        place_items(self.poses.position, self.poses.heading, self.items, self.statics.edges, self.statics.discs)


def _is_carried(body: Body) -> bool:
    """Return whether a robot carries a body, which then is nowhere."""
    return getattr(body, "carrier", None) is not None


def items_of(statics: Statics, loads: Loads, rows: Sequence[int]) -> MovingItems:
    """Return the local edges of loads, their rows in the tables and their loads, and rows and loads of discs."""
    polygons = [k for k, load in enumerate(loads) if not load.form.radius]
    edges = [edges_of(Shape(loads[k].form.outline)) for k in polygons]
    discs = [k for k, load in enumerate(loads) if load.form.radius]
    none = np.empty(0, np.int64)
    return MovingItems(
        np.concatenate([np.empty((0, 4)), *edges]),
        np.concatenate([none, *(statics.rows_of(rows[k]) for k in polygons)]),
        np.repeat(np.array(polygons, np.int64), [len(own) for own in edges]),
        np.concatenate([none, *(statics.rows_of(rows[k]) - len(statics.edges) for k in discs)]),
        np.array(discs, np.int64),
    )
