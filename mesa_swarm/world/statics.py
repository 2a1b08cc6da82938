"""All solid bodies but the robots, as arrays for the compiled engine."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from mesa_swarm.geometry.grid import CellLists, Grid, list_boxes_by_cell
from mesa_swarm.world.shapes import Shape

OBSTACLE, ROBOT, FIRE, LOAD, NOTHING = 0, 1, 2, 3, -1
SOURCE = FIRE  # what radiates heat
# The names of these kinds; custom ones follow, as far as the code fits into a byte.
KINDS = ("obstacle", "robot", "fire", "load")
MOST_KINDS = 127
BORDER = -1
FEWEST_CELLS = 4096
CELLS_PER_ITEM = 4
# Few items are worth small cells: most robots then stand in cells that list nothing.
CELLS_PER_FEW_ITEMS, MOST_SMALL_CELLS = 40, 1_000_000
# Many long edges in a grid of many cells would be listed billions of times.
MOST_LISTED = 3_000_000


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Statics:
    """Edges and discs of all solid bodies, those that stand still listed by the cells of a grid.

    An item is an edge (its index below ``len(edges)``) or a disc (the rest). Items of driven bodies are in the tables
    only; `physics.moving` lists them.

    Parameters
    ----------
    edges : ndarray, shape (m, 4)
        ax, ay, bx, by; the solid side is on the left. The first four are the map's border.
    discs : ndarray, shape (k, 3)
        x, y, radius; those of sources of heat from row `first_source` on.
    owner : int64 ndarray, shape (m + k,)
        Index of the shape or of the source of heat that an item belongs to, -1 for the border.
    kind, body : int8 ndarrays, shape (m + k,)
        Of the item as sensors see it, and of the body: 0 obstacle or border, 2 fire, 3 load, from 4 on custom
        kinds. A cold source, a fire that is out, is seen as an obstacle, and remains a fire to bump into.
    rings : int64 ndarray, shape (p, 2)
        First edge, and one past the last, of every solid polygon.
    bounds : ndarray, shape (4,)
    grid : Grid
    seen, touched : CellLists
        The items that can be seen, or touched, from each cell of the grid.
    """

    edges: np.ndarray
    discs: np.ndarray
    owner: np.ndarray
    kind: np.ndarray
    body: np.ndarray
    rings: np.ndarray
    bounds: np.ndarray
    grid: Grid
    seen: CellLists
    touched: CellLists
    first_source: int

    @classmethod
    def of(
        cls,
        bounds: tuple[float, float, float, float],
        shapes: Sequence[Shape],
        sources: np.ndarray,
        hot: np.ndarray,
        *,
        sight: float,
        touch: float,
        loads: Sequence[int] = (),
        slack: float = 0.0,
        codes: Sequence[int] = (),
        driven: Sequence[int] = (),
    ) -> "Statics":
        """Collect the border, the solid shapes and the sources of heat (x, y, radius) of a world.

        Sensors reach `sight` from a robot's centre, and a body within `touch` of it can be touched within a step. The
        shapes with the indices `loads` may move by `slack` before they have to be listed anew, those with the indices
        `driven` are not listed. `codes` are the kinds of all shapes; without them loads are loads, the rest obstacles.
        """
        solid = [(i, shape) for i, shape in enumerate(shapes) if shape.contact]
        edges, edge_owner, rings = _edges_of(solid, _border(bounds))
        discs, disc_owner = _discs_of(solid)
        owner = np.concatenate([edge_owner, disc_owner, np.arange(len(sources))])
        of_shape = (np.arange(len(owner)) < len(owner) - len(sources)) & (owner != BORDER)
        is_load = of_shape & np.isin(owner, loads)
        body, kind = _kinds_of(owner, of_shape, is_load, codes, hot)
        discs = np.concatenate([discs, sources.reshape(-1, 3)])
        boxes = _boxes(edges, discs)
        boxes[is_load] += slack * np.array([-1.0, -1.0, 1.0, 1.0])
        still = np.flatnonzero(~(of_shape & np.isin(owner, driven)))
        boxes = boxes[still]
        grid = _grid_for(boxes, bounds, sight, touch)
        seen_start, seen_items = list_boxes_by_cell(boxes, sight, grid.numbers)
        # The border is never crossed, so contact tests its four coordinates, not its edges.
        touched_start, touched_items = list_boxes_by_cell(boxes[4:], touch, grid.numbers)
        return cls(
            edges=edges,
            discs=discs,
            owner=owner.astype(np.int64),
            kind=kind,
            body=body,
            rings=rings,
            bounds=np.array(bounds, dtype=float),
            grid=grid,
            seen=CellLists(grid.numbers, seen_start, still[seen_items]),
            touched=CellLists(grid.numbers, touched_start, still[touched_items + 4]),
            first_source=len(discs) - len(sources),
        )

    @property
    def seen_as(self) -> np.ndarray:
        """The kinds as which sensors see sources of heat: cold ones are obstacles."""
        return self.kind[len(self.edges) + self.first_source :]

    def rows_of(self, index: int) -> np.ndarray:
        """Return the items of a shape."""
        return np.flatnonzero((self.owner == index) & (self.body != SOURCE))


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


def _grid_for(boxes: np.ndarray, bounds: tuple[float, float, float, float], sight: float, touch: float) -> Grid:
    """Return a grid whose cell count suits the number of items, smaller if they would be listed too often."""
    small = min(CELLS_PER_FEW_ITEMS * len(boxes), MOST_SMALL_CELLS)
    most = FEWEST_CELLS + max(CELLS_PER_ITEM * len(boxes), small)
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    while True:
        grid = Grid.over(bounds, touch, most)
        first, last = np.clip(boxes[:, :2] - sight, low, high), np.clip(boxes[:, 2:] + sight, low, high)
        listed = ((last - first) / grid.cell + 1).prod(axis=1).sum()
        if listed <= max(MOST_LISTED, 4 * len(boxes)) or grid.cells == 1:
            return grid
        most = max(1, min(most, grid.cells) // 4)


def _kinds_of(
    owner: np.ndarray, of_shape: np.ndarray, is_load: np.ndarray, codes: Sequence[int], hot: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what bodies edges and discs are of, and as what sensors see them: a source is an obstacle if not hot."""
    body = np.full(len(owner), OBSTACLE, np.int8)
    body[is_load] = LOAD
    if len(codes):
        body[of_shape] = np.array(codes, np.int8)[owner[of_shape]]
    kind = body.copy()
    first = len(owner) - len(hot)
    body[first:] = SOURCE
    kind[first:] = np.where(hot, SOURCE, OBSTACLE)
    return body, kind


def _border(bounds: Sequence[float]) -> np.ndarray:
    """Return the border's four edges, clockwise: its solid side is outside."""
    x_min, y_min, x_max, y_max = bounds
    corners = [(x_min, y_min), (x_min, y_max), (x_max, y_max), (x_max, y_min), (x_min, y_min)]
    return _segments(np.array(corners, dtype=float))


def _discs_of(shapes: Sequence[tuple[int, Shape]]) -> tuple[np.ndarray, np.ndarray]:
    """Return x, y, radius of the discs among numbered shapes, and their numbers."""
    discs = [(i, s.geometry, s.radius) for i, s in shapes if s.is_disc]
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
        segments = [_segments(shapely.get_coordinates(r)) for r in (polygon.exterior, *polygon.interiors)]
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
