"""The world around the robots as the engines need it, and the room for loads."""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np

from mesa_swarm.geometry import Bounds
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.physics.contact import StaticArrays
from mesa_swarm.physics.driven_bodies import Moving, MovingItems, have_strayed, place_items
from mesa_swarm.physics.load_room import Poses, Room, room_of
from mesa_swarm.physics.sensing import Radiating
from mesa_swarm.world.bodies import BodyTable, Form
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import CARRIED, DRIVEN, PUSHED, Marks, Statics, edges_of

# Loads may move this far before they are listed anew, in radii of the largest robot; and this far in one step.
SLACK = 4.0
STEP = 0.5
# The radius of spare discs, at most, in shorter sides of the map.
LARGEST_SPARE = 0.125


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The world without its robots: all bodies, as they are now.

    `rows` are those of its shapes in the table of `bodies`, the last `apart` of them numbered apart (see `Statics`);
    `loads` and `driven` those of the bodies that robots push, and that `moving` moves. `reference` (m, 3) has the poses
    of the loads when the tables were made; they may move by `slack` from there, which is infinite where tables reach
    everywhere. `items` is what `place_items` takes, and `room` what loads may not overlap: None without loads.
    """

    bounds: Bounds
    bodies: BodyTable
    rows: np.ndarray
    apart: int
    statics: Statics
    marks: Marks
    loads: np.ndarray
    driven: np.ndarray
    poses: Poses
    reference: np.ndarray
    slack: float
    items: MovingItems
    radiating: Radiating
    room: Room | None
    moving: Moving | None

    @classmethod
    def of(
        cls,
        bounds: Bounds,
        bodies: BodyTable,
        rows: np.ndarray,
        *,
        sight: float,
        touch: float,
        apart: int = 0,
        room: Room | None = None,
        roams: bool = False,
        spare: int = 0,
    ) -> "Surroundings":
        """Collect the bodies with these rows; `sight`, `touch` and `apart` as `Statics.of` takes them.

        With `roams` loads may go anywhere without tables being made anew, which makes these longer, and there is room
        for `spare` discs more, in a world in which no body moves. `room` is that of the same bodies as before, if
        there is one: of many loads it takes milliseconds to make.
        """
        of_shapes = bodies.mode[rows]
        pushed, sent = (np.flatnonzero(np.isin(of_shapes, modes)) for modes in ((PUSHED,), (DRIVEN, CARRIED)))
        slack = hypot(bounds[2] - bounds[0], bounds[3] - bounds[1]) if roams else SLACK * touch
        tables = {"sight": sight, "touch": touch, "slack": slack, "apart": apart}
        # Corners in the same order at every pose, which those of shapes, in normal form, are not.
        shapes = [bodies.body_of(row) for row in rows.tolist()]
        statics = Statics.of(bounds, shapes, bodies.kind[rows], loads=pushed, driven=sent, **tables)  # type: ignore[arg-type]
        statics.show(bodies.visible_kinds[rows])
        if spare:
            statics = statics.with_spare_discs(spare, largest_spare(bounds), sight=sight, touch=touch)
        loads, driven = rows[pushed], rows[sent]
        moving = Moving(bodies, driven, sent, statics, bounds, sight, touch) if len(driven) else None
        return cls(
            bounds,
            bodies,
            rows,
            apart,
            statics,
            Marks.of(shapes),
            loads=loads,
            driven=driven,
            poses=Poses(bodies.position, bodies.heading, bodies.mode, loads, driven),
            reference=np.column_stack([bodies.position[loads], bodies.heading[loads]]),
            # No point of the map is farther away than tables reach, whatever the bound of `have_strayed` is.
            slack=math.inf if roams else slack - STEP * touch,
            items=list_items_of(statics, bodies, rows, pushed),
            radiating=list_radiating(statics, bodies, rows),
            room=room or (room_of(statics, bodies, pushed, sent, rows) if len(loads) else None),
            moving=moving,
        )

    @property
    def present_shapes(self) -> list[Shape]:
        """The shapes as they are now."""
        return [self.bodies.shape_of(row) for row in self.rows.tolist()]

    @property
    def carried(self) -> set[int]:
        """The indices of the shapes that robots carry: they are nowhere."""
        return set(np.flatnonzero(self.bodies.mode[self.rows] == CARRIED).tolist())

    @property
    def still(self) -> StaticArrays:
        """What robots can touch besides each other and driven bodies, as compiled functions take it."""
        s = self.statics
        return StaticArrays(s.edges, s.discs, s.owner, s.body, s.bounds, s.touch_cells, None)

    @property
    def solids(self) -> StaticArrays:
        """The same with driven bodies."""
        return self.still._replace(movers=None if self.moving is None else self.moving.arrays)

    @property
    def is_worn(self) -> bool:
        """Whether a load has moved so far that the tables have to be made anew before the next step."""
        if self.room is None:
            return False
        table, reach = self.bodies, self.room.forms.reach
        return have_strayed(table.position, table.heading, self.loads, self.reference, reach, self.slack)

    def follow(self) -> None:
        """Update the tables to the present poses of the loads."""
        place_items(self.bodies.position, self.bodies.heading, self.items, self.statics.edges, self.statics.discs)


def largest_spare(bounds: Bounds) -> float:
    """Return how large spare discs may be: a share of the map's shorter side."""
    return LARGEST_SPARE * min(bounds[2] - bounds[0], bounds[3] - bounds[1])


def list_items_of(statics: Statics, bodies: BodyTable, rows: np.ndarray, indices: np.ndarray) -> MovingItems:
    """Return the items of the bodies with these indices among the shapes, and their edges in their own frames."""
    listing = [(int(rows[i]), cast(Form, bodies.forms[rows[i]]), statics.rows_of(i)) for i in indices.tolist()]
    polygons = [(row, edges_of(Shape(form.outline)), items) for row, form, items in listing if not form.radius]
    discs = [(row, items - len(statics.edges)) for row, form, items in listing if form.radius]
    none = np.empty(0, np.int64)
    return MovingItems(
        np.concatenate([np.empty((0, 4)), *(edges for _, edges, _ in polygons)]),
        np.concatenate([none, *(items for _, _, items in polygons)]),
        np.concatenate([none, *(np.full(len(items), row) for row, _, items in polygons)]),
        np.concatenate([none, *(items for _, items in discs)]),
        np.array([row for row, _ in discs], np.int64),
    )


def list_radiating(statics: Statics, bodies: BodyTable, rows: np.ndarray) -> Radiating:
    """Return what radiates of the bodies with these rows."""
    radiates = np.append(~np.isnan(bodies.temperature[rows]), False)[statics.shape]
    edges, discs = np.flatnonzero(radiates[: len(statics.edges)]), np.flatnonzero(radiates[len(statics.edges) :])
    of_edges, of_discs = rows[statics.shape[edges]], rows[statics.shape[discs + len(statics.edges)]]
    return Radiating(statics.discs, discs, of_discs, statics.edges, edges, of_edges, bodies.temperature)
