"""All solid bodies but the robots, as arrays for the compiled engine."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.grid import CellLists, Grid, list_boxes_by_cell
from mesa_swarm.world.shapes import Shape

OBSTACLE, ROBOT, FIRE, LOAD, NOTHING = 0, 1, 2, 3, -1
# The names of these kinds; custom ones follow, as far as the code fits into a byte.
KINDS = ("obstacle", "robot", "fire", "load")
# The kind of what is seen as another kind once it is out.
GOES_OUT = KINDS[FIRE]
MOST_KINDS = 127
# How a body moves: not at all, where it is sent, where robots push it, with the robot that carries it.
MODES = ("fixed", "driven", "pushed", "carried")
FIXED, DRIVEN, PUSHED, CARRIED = range(len(MODES))
BORDER = -1
FEWEST_CELLS = 4096
CELLS_PER_ITEM = 4
# Few items are worth small cells: most robots then stand in cells that list nothing.
CELLS_PER_FEW_ITEMS, MOST_SMALL_CELLS = 40, 1_000_000
# Many long edges in a grid of many cells would be listed billions of times.
MOST_LISTED = 3_000_000
# So few shapes are compared with those of worlds before.
MOST_SHARED_SHAPES = 200
NO_KINDS = np.empty(0, np.int8)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Statics:
    """Edges and discs of all solid bodies, those that stand still listed by the cells of a grid.

    An item is an edge (its index below ``len(edges)``) or a disc (the rest). Items of driven bodies are in the tables
    only; `physics.driven_bodies` lists them.

    Parameters
    ----------
    edges : ndarray, shape (m, 4)
        ax, ay, bx, by; the solid side is on the left. The first four are the map's border.
    discs : ndarray, shape (k, 3)
        x, y, radius; those of shapes that are numbered apart from row `first_apart` on.
    shape, owner : int64 ndarrays, shape (m + k,)
        Index of the shape that an item belongs to, -1 for the border; and its number, as contacts name it.
    kind, body : int8 ndarrays, shape (m + k,)
        Codes of kinds of the item as sensors see it, and of the body.
    rings : int64 ndarray, shape (p, 2)
        First edge, and one past the last, of every solid polygon.
    bounds : ndarray, shape (4,)
    grid : Grid
    sight_cells, touch_cells : CellLists
        The items that can be seen, or touched, from each cell of the grid.
    """

    edges: np.ndarray
    discs: np.ndarray
    shape: np.ndarray
    owner: np.ndarray
    kind: np.ndarray
    body: np.ndarray
    rings: np.ndarray
    bounds: np.ndarray
    grid: Grid
    sight_cells: CellLists
    touch_cells: CellLists
    first_apart: int

    @classmethod
    def of(
        cls,
        bounds: Bounds,
        shapes: Sequence[Shape],
        codes: Sequence[int] | np.ndarray,
        *,
        sight: float,
        touch: float,
        loads: Sequence[int] | np.ndarray = (),
        slack: float = 0.0,
        driven: Sequence[int] | np.ndarray = (),
        apart: int = 0,
    ) -> "Statics":
        """Collect the border and the solid shapes of a world; `codes` are their kinds.

        Sensors reach `sight` from a robot's centre, and a body within `touch` of it can be touched within a step. The
        shapes with the indices `loads` may move by `slack` before they have to be listed anew, those with the indices
        `driven` are not listed. The last `apart` shapes are discs that have numbers of their own, and stop no radio.
        """
        sizes = float(sight), float(touch), float(slack), apart
        if len(loads) or len(driven) or len(shapes) > MOST_SHARED_SHAPES:
            statics = _collect(bounds, tuple(shapes), sizes, loads, driven)
        else:
            statics = _collect_still(tuple(bounds), tuple(shapes), sizes)
        body = _kinds_of(statics.shape, codes)
        return replace(statics, kind=body.copy(), body=body)

    def show(self, codes: Sequence[int] | np.ndarray) -> None:
        """Let sensors see the shapes as these kinds."""
        self.kind[:] = _kinds_of(self.shape, codes)

    @property
    def seen_as(self) -> np.ndarray:
        """The kinds as which sensors see the shapes that are numbered apart."""
        return self.kind[len(self.edges) + self.first_apart :]

    def with_spare_discs(self, count: int, largest: float, *, sight: float, touch: float) -> "Statics":
        """Return the same with rows for discs that may come later, in front of those of shapes numbered apart.

        They are nowhere, NaN, and belong to no shape, as the border. Lists of cells have room for as many discs of this
        `largest` radius; `sight` and `touch` are those that the tables were made with.
        """
        first = len(self.edges) + self.first_apart

        def with_rows(column: np.ndarray, value: int) -> np.ndarray:
            return np.insert(column, first, np.full(count, value, column.dtype))

        def with_room(lists: CellLists, reach: float) -> CellLists:
            room = np.zeros(count * self.grid.most_cells_of(largest + reach), np.int64)
            moved = lists.items + count * (lists.items >= first)
            return lists._replace(start=lists.start.copy(), items=np.append(moved, room))

        return replace(
            self,
            discs=np.insert(self.discs, self.first_apart, np.full((count, 3), np.nan), axis=0),
            shape=with_rows(self.shape, BORDER),
            owner=with_rows(self.owner, BORDER),
            kind=with_rows(self.kind, OBSTACLE),
            body=with_rows(self.body, OBSTACLE),
            sight_cells=with_room(self.sight_cells, sight),
            touch_cells=with_room(self.touch_cells, touch),
            first_apart=self.first_apart + count,
        )

    def rows_of(self, index: int) -> np.ndarray:
        """Return the items of a shape."""
        return np.flatnonzero(self.shape == index)


def _collect(
    bounds: Bounds,
    shapes: tuple[Shape, ...],
    sizes: tuple[float, float, float, int],
    loads: Sequence[int] | np.ndarray = (),
    driven: Sequence[int] | np.ndarray = (),
) -> Statics:
    """Return the tables of shapes, without their kinds; `sizes` are sight, touch, slack and apart of `Statics.of`."""
    sight, touch, slack, apart = sizes
    first = len(shapes) - apart
    solid = [(i, shape) for i, shape in enumerate(shapes) if shape.contact]
    edges, edge_shape, rings = _edges_of(solid, _border(bounds))
    discs, disc_shape = _discs_of(solid)
    shape = np.concatenate([edge_shape, disc_shape]).astype(np.int64)
    boxes = _boxes(edges, discs)
    boxes[np.isin(shape, loads)] += slack * np.array([-1.0, -1.0, 1.0, 1.0])
    still = np.flatnonzero(~np.isin(shape, driven))
    boxes = boxes[still]
    grid = _grid_for(boxes, bounds, sight, touch)
    seen_start, seen_items = list_boxes_by_cell(boxes, sight, grid.numbers)
    # The border is never crossed, so contact tests its four coordinates, not its edges.
    touched_start, touched_items = list_boxes_by_cell(boxes[4:], touch, grid.numbers)
    return Statics(
        edges=edges,
        discs=discs,
        shape=shape,
        owner=np.where(shape >= first, shape - first, shape),
        kind=NO_KINDS,
        body=NO_KINDS,
        rings=rings,
        bounds=np.array(bounds, dtype=float),
        grid=grid,
        sight_cells=CellLists(grid.numbers, seen_start, still[seen_items]),
        touch_cells=CellLists(grid.numbers, touched_start, still[touched_items + 4]),
        first_apart=int(np.count_nonzero(disc_shape < first)),
    )


# Worlds with the same bodies, none of which moves, share all but the kinds, which change as fires go out.
_collect_still = lru_cache(maxsize=32)(_collect)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Marks:
    """The marks on the ground, for line sensors: edges and the rows of each ring, and discs, as in `Statics`."""

    edges: np.ndarray
    rings: np.ndarray
    discs: np.ndarray

    @classmethod
    def of(cls, shapes: Sequence[Shape]) -> "Marks":
        """Collect the shapes that are marks."""
        marks = [(i, shape) for i, shape in enumerate(shapes) if not shape.contact]
        edges, _, rings = _edges_of(marks, np.empty((0, 4)))
        return cls(edges=edges, rings=rings, discs=_discs_of(marks)[0])


def _grid_for(boxes: np.ndarray, bounds: Bounds, sight: float, touch: float) -> Grid:
    """Return a grid whose cell count suits the number of items, smaller if they would be listed too often."""
    small = min(CELLS_PER_FEW_ITEMS * len(boxes), MOST_SMALL_CELLS)
    most = FEWEST_CELLS + max(CELLS_PER_ITEM * len(boxes), small)
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    while True:
        grid = Grid.over(bounds, touch, most)
        first, last = np.clip(boxes[:, :2] - sight, low, high), np.clip(boxes[:, 2:] + sight, low, high)
        entries = ((last - first) / grid.cell + 1).prod(axis=1).sum()
        if entries <= max(MOST_LISTED, 4 * len(boxes)) or grid.cells == 1:
            return grid
        most = max(1, min(most, grid.cells) // 4)


def _kinds_of(shape: np.ndarray, codes: Sequence[int] | np.ndarray) -> np.ndarray:
    """Return the kind of each item; the border is an obstacle."""
    return np.append(np.asarray(codes, np.int8), np.int8(OBSTACLE))[shape]


def _border(bounds: Sequence[float]) -> np.ndarray:
    """Return the border's four edges, clockwise: its solid side is outside."""
    x_min, y_min, x_max, y_max = bounds
    corners = [(x_min, y_min), (x_min, y_max), (x_max, y_max), (x_max, y_min), (x_min, y_min)]
    return _segments(np.array(corners, dtype=float))


def _discs_of(shapes: Sequence[tuple[int, Shape]]) -> tuple[np.ndarray, np.ndarray]:
    """Return x, y, radius of the discs among numbered shapes, and their numbers."""
    discs = [(i, shape.geometry, shape.radius) for i, shape in shapes if shape.is_disc]
    if not discs:
        return np.empty((0, 3)), np.empty(0, np.int64)
    numbers, centres, radii = zip(*discs, strict=True)
    return np.column_stack([shapely.get_coordinates(centres), radii]), np.array(numbers, np.int64)


def _edges_of(shapes: Sequence[tuple[int, Shape]], border: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the edges of the border and of the polygons among numbered shapes, owners, and rings' rows."""
    parts, owner, rings = [border], [np.full(len(border), BORDER)], []
    first = len(border)
    for i, shape in shapes:
        if shape.is_disc:
            continue
        polygon = orient(shape.geometry)
        segments = [_segments(shapely.get_coordinates(ring)) for ring in (polygon.exterior, *polygon.interiors)]
        count = sum(map(len, segments))
        parts += segments
        owner.append(np.full(count, i))
        rings.append((first, first + count))
        first += count
    return np.concatenate(parts), np.concatenate(owner), np.array(rings, np.int64).reshape(-1, 2)


def edges_of(shape: Shape) -> np.ndarray:
    """Return the edges of a polygon, shape (m, 4), in the order in which `Statics` has them."""
    return _edges_of([(0, shape)], np.empty((0, 4)))[0]


def _segments(ring: np.ndarray) -> np.ndarray:
    return np.hstack([ring[:-1], ring[1:]])


def _boxes(edges: np.ndarray, discs: np.ndarray) -> np.ndarray:
    low = np.minimum(edges[:, :2], edges[:, 2:])
    high = np.maximum(edges[:, :2], edges[:, 2:])
    radius = discs[:, 2:]
    return np.concatenate([np.hstack([low, high]), np.hstack([discs[:, :2] - radius, discs[:, :2] + radius])])
