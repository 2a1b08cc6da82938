"""What is changed by hand on a page: robots are moved, fires are put out and lit again, discs come and go."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.fire.burning import NO_FIRE, NOT_YET, LightArrays
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.grid import CellLists
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import Bytes, IntegerRows, Integers, RealRows, Reals
from mesa_swarm.model.bodies_part import CHANGING, READ
from mesa_swarm.model.driving import measure_in_place, measures_of_rows
from mesa_swarm.model.measures import ColumnMeasure, Spec
from mesa_swarm.physics.contact import StaticArrays
from mesa_swarm.physics.driven_bodies import list_items
from mesa_swarm.physics.placing import is_free, overlaps_any
from mesa_swarm.physics.surroundings import largest_spare
from mesa_swarm.world.statics import FIRE, OBSTACLE

# What `put_robot` and `put_disc` return where there is no room.
NO_ROOM = 1
# How many discs a page may add.
SPARE_DISCS = 8
# The border's edges come first among items; none is listed as what can be touched.
BORDER_EDGES = 4
# Robots farther from a disc than this share of the distance at which they touch overlap it in no rounding.
CLEAR = 1.0 + 1e-9


class PutArrays(NamedTuple):
    """What `put_robot` takes: a place (2,), positions and radii of robots, and numbers of a block of what is solid."""

    place: Reals
    position: RealRows
    radius: Reals
    statics: Integers
    rings: IntegerRows


@compiled(nogil=True)
def put_robot(block, step, first, last):
    """Put the robot in row `first` at a place; return `NO_ROOM` where it would overlap anything or leave the map."""
    p = unpack(block, PutArrays)
    x, y, statics = p.place[0], p.place[1], unpack(p.statics, StaticArrays)
    low_x, low_y, high_x, high_y = statics.bounds[0], statics.bounds[1], statics.bounds[2], statics.bounds[3]
    if not (low_x <= x <= high_x and low_y <= y <= high_y):
        return NO_ROOM
    if not is_free(x, y, p.radius[first], statics, p.rings) or overlaps_any(first, x, y, p.position, p.radius):
        return NO_ROOM
    p.position[first, 0], p.position[first, 1] = x, y
    return 0


@compiled(nogil=True)
def set_fire(block, step, first, last):
    """Light the fire `first` at temperature 1 if `last` is above 0, otherwise put it out, after this number of steps.

    As by hand in Python, whatever it was before: robots no longer fight one that is put out.
    """
    f = unpack(block, LightArrays)
    burns = last > 0
    f.heat_of[f.rows[first]], f.out[first] = (1.0, False) if burns else (0.0, True)
    f.out_step[first] = NOT_YET if burns else step
    f.seen_as[first] = FIRE if burns else OBSTACLE
    if not burns:
        f.fighters[first] = 0
        f.fire[:] = NO_FIRE
    return 0


class DiscArrays(NamedTuple):
    """What `put_disc` takes.

    Where a disc is to be, x, y, radius (3,); positions and radii of robots; edges and discs of what is solid, their
    lists by cells, how far it is seen and touched, and the items in each of the lists, in descending order. And bytes
    that only the page reads: what bodies are, in the fingerprint.
    """

    place: Reals
    position: RealRows
    radius: Reals
    edges: RealRows
    discs: RealRows
    sight: float
    touch: float
    sight_cells: CellLists
    touch_cells: CellLists
    seen: Integers
    touched: Integers
    described: Bytes


@compiled(nogil=True)
def put_disc(block, step, first, last):
    """Put the disc in row `first` at a place if `last` is above 0, otherwise take it away.

    It returns `NO_ROOM` where a robot is: in Python it would be moved elsewhere.
    """
    d = unpack(block, DiscArrays)
    if last > 0 and meets_robots(d.place[0], d.place[1], d.place[2], d.position, d.radius):
        return NO_ROOM
    for k in range(3):
        d.discs[first, k] = d.place[k] if last > 0 else math.nan
    list_items(d.edges, d.discs, d.seen, d.sight, d.sight_cells)
    list_items(d.edges, d.discs, d.touched, d.touch, d.touch_cells)
    return 0


@compiled
def meets_robots(x, y, radius, position, radii):
    """Return whether a disc overlaps or nearly touches a robot."""
    for i in range(position.shape[0]):
        near = CLEAR * (radius + radii[i])
        if (x - position[i, 0]) ** 2 + (y - position[i, 1]) ** 2 < near * near:
            return True
    return False


def fires_in_hand(model: Any) -> Block:
    """Return what `set_fire` takes of a model with fires."""
    return Block(model.parts.fires.to_light())


class Hand:
    """What a page moves robots of a model with.

    Attributes
    ----------
    block : Block
        Of `PutArrays`.
    place : float64 ndarray, shape (2,)
    """

    def __init__(self, model: Any) -> None:
        columns, engine, scene = model.swarm.columns, model.parts.robots.engine, model.parts.bodies.scene()
        self.place = np.zeros(2)
        positions = columns["position"], columns["radius"]
        self.block = Block(PutArrays(self.place, *positions, engine._statics.numbers, scene.statics.rings))

    def put(self, row: int, x: float, y: float) -> bool:
        """Put a robot at a place, and return whether there is room."""
        self.place[:] = x, y
        return put_robot(self.block.numbers, 0, row, row + 1) == 0


def spare_discs(model: Any) -> int:
    """Return how many discs may come on the page of a model: none where bodies move, or fields flow round them."""
    is_still = not model.parts.bodies.moves and not any(field.declaration.walls for field in model.fields.values())
    return SPARE_DISCS if is_still else 0


# Columns of robots by which functions distinguish bodies: those that come on a page have no number.
NUMBERS_OF_BODIES = ("contact_index",)


def reads_bodies(model: Any, image: Any) -> bool:
    """Return whether a compiled function reads columns or numbers of bodies, and would not see those that come.

    Fires read the temperatures of bodies, and their own rows.
    """
    own = {"temperature", *(("position", "radius") if len(model.fires) else ())}
    columns = [getattr(model.parts.bodies.table, name) for name in {*CHANGING, *READ} - own]
    taken = any(image.takes(f"given_{name}") for name in ("bodies_", *NUMBERS_OF_BODIES))
    return taken or any(map(is_of_bodies, columns_measured(model))) or any(map(image.has_whole, columns))


def is_of_bodies(column: str) -> bool:
    """Return whether this is the name of a column of bodies, or of their numbers."""
    return column.startswith("bodies.") or column in NUMBERS_OF_BODIES


def columns_measured(model: Any) -> Iterator[str]:
    """Iterate over the names of the columns that rows and conditions are of."""
    declared, _ = measures_of_rows(model)
    conditions = [measure_in_place(model, condition.of) for condition in type(model).conditions]
    for measure in (*declared.values(), *conditions):
        if isinstance(measure, ColumnMeasure) and isinstance(measure.spec, Spec):
            yield measure.spec.column


class DiscsInHand:
    """What a page adds and takes away discs of a model with, whose scene has room for them.

    Parameters
    ----------
    model : SwarmModel
    described : bytes
        What bodies are, in the fingerprint.

    Attributes
    ----------
    block : Block
        Of `DiscArrays`.
    place : float64 ndarray, shape (3,)
    described : uint8 ndarray
        The bytes, with room for those of the discs that may come.
    """

    # Of a disc that comes, in the fingerprint: seven numbers, its mode, kind and digits of longer lists.
    MOST_BYTES = 160

    def __init__(self, model: Any, described: bytes) -> None:
        columns, scene = model.swarm.columns, model.parts.bodies.scene()
        statics = scene.statics
        self._scene, self.place = scene, np.zeros(3)
        self.described = np.zeros(len(described) + SPARE_DISCS * self.MOST_BYTES, np.uint8)
        self.described[: len(described)] = np.frombuffer(described, np.uint8)
        items = np.arange(len(statics.edges) + len(statics.discs), dtype=np.int64)[::-1]
        self.block = Block(
            DiscArrays(
                place=self.place,
                position=columns["position"],
                radius=columns["radius"],
                edges=statics.edges,
                discs=statics.discs,
                **model.parts.bodies.reaches(),
                sight_cells=statics.sight_cells,
                touch_cells=statics.touch_cells,
                seen=items.copy(),
                touched=items[: len(items) - BORDER_EDGES].copy(),
                described=self.described,
            )
        )

    @property
    def spare(self) -> list[int]:
        """The rows of discs that may come."""
        last = self._scene.statics.first_apart
        return list(range(last - SPARE_DISCS, last))

    @property
    def own(self) -> Iterator[int]:
        """The rows of the model's own obstacles that are discs."""
        statics, table = self._scene.statics, self._scene.bodies
        for row in range(statics.first_apart - SPARE_DISCS):
            item = len(statics.edges) + row
            is_cold = np.isnan(table.temperature[self._scene.rows[statics.shape[item]]])
            if statics.body[item] == OBSTACLE and is_cold:
                yield row

    @property
    def bounds(self) -> Bounds:
        """Those of the map."""
        return self._scene.bounds

    @property
    def largest(self) -> float:
        """The largest radius of a disc that comes."""
        return largest_spare(self._scene.bounds)

    def put(self, row: int, x: float, y: float, radius: float) -> bool:
        """Put the disc in a row at a place, and return whether there is room."""
        self.place[:] = x, y, radius
        return put_disc(self.block.numbers, 0, row, 1) == 0

    def take(self, row: int) -> None:
        """Take the disc in a row away."""
        put_disc(self.block.numbers, 0, row, 0)
