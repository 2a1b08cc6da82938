"""Fields: scalars on a grid over the map, which diffuse, evaporate and are stopped by obstacles.

A `Field` declares one, `ScalarField` is the one of a model. Values are amounts in cells, so that their sum is the
total. Each step advances it by

    dF/dt = diffusion * (d2F/dx2 + d2F/dy2),  then  F *= 1 - evaporation

with no flux through the border and, with `walls`, through obstacles. The scheme is explicit in as many equal sub-steps
as make it stable and free of oscillations, that is 4 D (1/dx^2 + 1/dy^2) of them, rounded up: away from the border
the variance of what was deposited at a point grows by exactly 2 D a step in x and in y, totals change by evaporation
alone, and no value becomes negative.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import is_
from typing import Any

import numpy as np
import shapely

from mesa_swarm.base.errors import (
    InvalidValueError,
    UnknownNameError,
    check_flag,
    check_name,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.diffusion import (
    BLOCKED,
    OPEN,
    FieldArrays,
    advance_field,
    block_disc,
    block_polygon,
    cells_at,
    deposit,
    interpolate_cells,
    withdraw,
)
from mesa_swarm.kernels.block import Block
from mesa_swarm.world.read_only import locked_view, read_only
from mesa_swarm.world.shapes import Shape, as_numbers

MOST_CELLS = 50_000_000
MOST_SUB_STEPS = 1000
# Sums of these are finite in every run.
LARGEST_AMOUNT = 1e15
# Of a picture of a field, and the largest of its levels.
MOST_PIXELS = 120_000
LEVELS = 255
NO_SIDES = np.empty((0, 0), np.uint8)


@dataclass(frozen=True, slots=True)
class Field:
    """A declaration of a scalar field: a pheromone, a gas, a temperature, food.

    Parameters
    ----------
    name : str
        An identifier, unique in the model.
    cell : float
        Width and height of a cell, map units, above 0. As many cells as fill the map exactly: they are at most this
        wide and high.
    diffusion : float
        Map units squared a step, at least 0.
    evaporation : float
        The share that is lost in each step, from 0 to 1.
    walls : bool
        Whether obstacles block it; loads, driven bodies, fires and robots never do.

    Raises
    ------
    InvalidValueError
        If one of these is outside its range.

    Examples
    --------
    >>> Field("trail", cell=5.0, diffusion=0.1, evaporation=0.01).walls
    True
    """

    name: str
    cell: float = 10.0
    diffusion: float = 0.0
    evaporation: float = 0.0
    walls: bool = True

    def __post_init__(self) -> None:
        if not check_name("name of a field", self.name).isidentifier():
            raise InvalidValueError(f"name of a field is {shortened(self.name)}; expected an identifier such as trail")
        values = {
            "cell": check_number("cell", self.cell, above=0, maximum=1e9),
            "diffusion": check_number("diffusion", self.diffusion, minimum=0, maximum=1e18),
            "evaporation": check_number("evaporation", self.evaporation, minimum=0, maximum=1),
            "walls": check_flag("walls", self.walls),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def shape(self, bounds: Bounds) -> tuple[int, int]:
        """Return how many rows and columns of cells fill a map.

        Examples
        --------
        >>> Field("trail", cell=10.0).shape((0, 0, 800, 595))
        (60, 80)
        """
        x_min, y_min, x_max, y_max = bounds
        cells = np.array([x_max - x_min, y_max - y_min]) / self.cell
        columns, rows = np.maximum(np.ceil(cells - 1e-9), 1.0).tolist()
        if rows * columns > MOST_CELLS:
            least = math.sqrt((x_max - x_min) * (y_max - y_min) / MOST_CELLS)
            raise InvalidValueError(
                f"cell is {self.cell:g}: field {self.name} would have {rows * columns:.3g} cells; "
                f"expected at most {MOST_CELLS:,}: use a cell of at least {1.01 * least:.3g}"
            )
        return int(rows), int(columns)

    def sub_steps(self, width: float, height: float) -> int:
        """Return how many sub-steps a step takes with cells of this width and height."""
        sub_steps = 4.0 * self.diffusion * (1.0 / width**2 + 1.0 / height**2)
        if sub_steps > MOST_SUB_STEPS:
            most = MOST_SUB_STEPS / 4.0 / (1.0 / width**2 + 1.0 / height**2)
            raise InvalidValueError(
                f"diffusion is {self.diffusion:g}, which takes {sub_steps:.3g} sub-steps with a cell of {self.cell:g}; "
                f"expected at most {MOST_SUB_STEPS}: use a diffusion of at most {most:.3g}, or a cell of at least "
                f"{1.01 * self.cell * math.sqrt(sub_steps / MOST_SUB_STEPS):.3g}"
            )
        return max(1, math.ceil(sub_steps))


class ScalarField:
    """A field of a model, see `Field`; made by `SwarmModel.add_field`.

    Row 0 of its values is at the bottom of the map, column 0 at its left. What is deposited in a cell whose centre is
    within an obstacle enters the nearest free cell instead, and so does what was in a cell that a new obstacle blocks:
    nothing is lost. A field spreads from cell to cell where no obstacle crosses the straight line between their
    centres: the thinnest wall stops it, and a post thinner than a cell may do so between two cells.

    Attributes
    ----------
    declared : Field
    peak : float
        The largest value that a cell has ever had, to which colours of pictures refer.
    changes : int
        How often its values were changed other than by advancing.
    removed : bool
        Whether `SwarmModel.remove_field` took it out of its model: its last values can then be read, nothing else.
    """

    def __init__(self, declaration: Field, bounds: Bounds, walls: Callable[[], Sequence[Shape]] = tuple) -> None:
        rows, columns = declaration.shape(bounds)
        x_min, y_min, x_max, y_max = bounds
        self.frame = (float(x_min), float(y_min), (x_max - x_min) / columns, (y_max - y_min) / rows)
        self._sub_steps = declaration.sub_steps(*self.frame[2:])
        self.declaration = declaration
        self.bounds = bounds
        self.peak = 0.0
        self.changes = 0
        self.removed = False
        self._values = np.zeros((rows, columns))
        self._empty = np.ones(1, np.bool_)  # whether it is, also to compiled functions
        self._shapes = walls if declaration.walls else tuple
        self._walls: _Walls | None = None

    def __repr__(self) -> str:
        rows, columns = self._values.shape
        return f"<ScalarField {self.name}, {rows} rows x {columns} columns, total {self.total:g}>"

    @property
    def name(self) -> str:
        """The name of the field."""
        return self.declaration.name

    @property
    def values(self) -> np.ndarray:
        """The amount in each cell, shape (rows, columns), a read-only view; set it to change all at once.

        Setting takes finite numbers from 0 to 1e15; cells that obstacles block become 0.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> field = SwarmModel(rng=1).add_field(Field("trail", cell=100.0))
        >>> field.values = np.ones((6, 8))
        >>> field.total
        48.0
        """
        return locked_view(self._values)

    @values.setter
    def values(self, values: Any) -> None:
        self._check_present()
        numbers = as_numbers(values)
        if numbers.shape != self._values.shape:
            raise InvalidValueError(
                f"values of field {self.name} are {shortened(values)}; expected numbers of shape {self._values.shape}"
            )
        _check_limits(f"values of field {self.name}", numbers)
        self._values[...] = numbers
        self._values[self.blocked] = 0.0
        self._note_change(float(self._values.max()))

    @property
    def stored_values(self) -> np.ndarray:
        """The array of the values, for compiled functions that read it."""
        return self._values

    @property
    def sides(self) -> np.ndarray:
        """Which sides of cells are open, and which cells are blocked, see `geometry.diffusion`."""
        return self._current_walls().sides

    @property
    def total(self) -> float:
        """The sum of all values."""
        return float(self._values.sum())

    @property
    def blocked(self) -> np.ndarray:
        """Which cells obstacles block: their centres are within one; a bool array (rows, columns)."""
        sides = self._current_walls().sides
        return read_only((sides & BLOCKED > 0) if sides.size else np.zeros(self._values.shape, bool))

    def deposit(self, positions: Any, amounts: Any = 1.0) -> None:
        """Add amounts to the cells in which positions lie.

        Parameters
        ----------
        positions : array-like, shape (n, 2) or (2,)
            On the map.
        amounts : array-like, shape (n,), or float
            From 0 to 1e15. `withdraw` takes away.

        Raises
        ------
        InvalidValueError
            If one is NaN, not on the map, negative, or too large; nothing is added then.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> field = SwarmModel(rng=1).add_field(Field("trail"))
        >>> field.deposit([(101, 305), (101, 305), (799, 5)], [1.0, 2.0, 4.0])
        >>> field.values[30, 10].item(), field.total
        (3.0, 7.0)
        """
        points = self._check_points(positions)
        self.add(points, self._check_amounts(amounts, len(points)))

    def withdraw(self, positions: Any, amounts: Any) -> np.ndarray:
        """Take amounts from the cells in which positions lie, in their order, of each at most what it has.

        Parameters and errors are those of `deposit`.

        Returns
        -------
        ndarray, shape (n,)
            What was taken.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> food = SwarmModel(rng=1).add_field(Field("food"))
        >>> food.deposit((101, 305), 5.0)
        >>> food.withdraw([(101, 305), (101, 305)], 3.0)
        array([3., 2.])
        """
        points = self._check_points(positions)
        limits = self._check_amounts(amounts, len(points))
        withdrawn = np.empty(len(points))
        withdraw(self._values.reshape(-1), self._cells(points), limits, withdrawn)
        self._note_change(0.0)
        return withdrawn

    def at(self, positions: Any) -> np.ndarray:
        """Return the value at positions (n, 2), interpolated between the centres of cells, not through walls.

        A position beyond the border has the value of the nearest place on the map; in an obstacle, of the nearest free
        cell.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        InvalidValueError
            If a coordinate is NaN or infinite.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> field = SwarmModel(rng=1).add_field(Field("trail"))
        >>> field.deposit((105, 305), 4.0)
        >>> field.at([(105, 305), (110, 305), (115, 305)])
        array([4., 2., 0.])
        """
        self._check_present()
        return self.look_up(_check_positions(positions))[0]

    def gradient(self, positions: Any) -> np.ndarray:
        """Return the slopes in x and y at positions (n, 2): they point to where there is more.

        They are central differences, interpolated between the centres of cells like values, not through walls.

        Returns
        -------
        ndarray, shape (n, 2)

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> field = SwarmModel(rng=1).add_field(Field("trail"))
        >>> field.deposit((105, 305), 4.0)
        >>> field.gradient((100, 305))
        array([[0.1, 0. ]])
        """
        self._check_present()
        return self.look_up(_check_positions(positions))[1]

    def advance(self) -> None:
        """Advance by one step, without a model, which advances all of its fields at once."""
        advance_field(self.block().numbers)

    def block(self) -> Block:
        """Return what `advance_field` takes, which is valid as long as the walls are."""
        declaration, (_, _, width, height), walls = self.declaration, self.frame, self._current_walls()
        remaining, share = 1.0 - declaration.evaporation, declaration.diffusion / self._sub_steps
        changes = remaining < 1.0 or declaration.diffusion > 0.0
        return Block(
            FieldArrays(
                values=self._values,
                x_share=share / width**2,
                y_share=share / height**2,
                remaining=remaining,
                sides=walls.sides,
                begins=walls.begins,
                cells=walls.cells,
                sub_steps=self._sub_steps if changes else 0,
                empty=self._empty,
            )
        )

    def add(self, points: np.ndarray, amounts: np.ndarray) -> None:
        """Add amounts at points of which the model knows that they are valid; beyond the border at the nearest cell."""
        if len(points):
            largest = deposit(self._values.reshape(-1), self._cells(points), amounts)
            self._note_change(largest)

    def look_up(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `at` and `gradient` of an array of finite points, shapes (n,) and (n, 2)."""
        levels, slopes = np.empty(len(points)), np.empty((len(points), 2))
        interpolate_cells(self._values, self._current_walls().sides, self.frame, points, levels, slopes)
        return levels, slopes

    def walls_changed(self) -> None:
        """Find out anew which cells are blocked, and move what is in them to the nearest free ones; models call it."""
        if not self.declaration.walls or (self._walls is not None and self._walls.is_of(self._shapes())):
            return
        self._walls = None
        if self._empty[0]:
            return
        covered = np.argwhere(self.blocked & (self._values > 0.0))
        if not len(covered):
            return
        x_min, y_min, width, height = self.frame
        amounts = self._values[tuple(covered.T)]
        self._values[tuple(covered.T)] = 0.0
        self.add((covered[:, ::-1] + 0.5) * (width, height) + (x_min, y_min), amounts)

    def levels(self, most: int = MOST_PIXELS) -> np.ndarray:
        """Return the values as a picture of at most this many pixels, see `levels_of`."""
        return levels_of(average_blocks(self._values, most), self.peak)

    def checkpoint(self) -> dict:
        """Return all that a later step depends on."""
        return {"values": self._values, "peak": self.peak}

    def restore(self, state: dict) -> None:
        """Restore what `checkpoint` returned."""
        values, peak = as_numbers(state["values"]), check_number("peak", state["peak"], minimum=0)
        if values.shape != self._values.shape:
            raise InvalidValueError(f"field {self.name} is stored with shape {values.shape}; expected another map")
        _check_limits(f"values of field {self.name}", values, np.finfo(float).max)
        self._values[...] = values
        self.peak = peak
        self._walls, self._empty[0] = None, not values.any()

    def _check_present(self) -> None:
        if self.removed:
            raise InvalidValueError(f"field {self.name} was removed; expected one of model.fields")

    def _note_change(self, largest: float) -> None:
        self.changes += 1
        self._empty[0] &= largest == 0.0
        self.peak = max(self.peak, largest)

    def _current_walls(self) -> "_Walls":
        if self._walls is None:
            self._walls = _Walls(self._values.shape, self.frame, self._shapes())
        return self._walls

    def _cells(self, points: np.ndarray) -> np.ndarray:
        return cells_at(self._values.shape, self._current_walls().sides, self.frame, points)

    def _check_points(self, positions: Any) -> np.ndarray:
        self._check_present()
        points = _check_positions(positions)
        x_min, y_min, x_max, y_max = self.bounds
        outside = ((points < (x_min, y_min)) | (points > (x_max, y_max))).any(axis=1)
        if outside.any():
            raise InvalidValueError(
                f"position {shortened(points[outside][0])} is not on the map of field {self.name}; expected x and y "
                f"within {[list(self.bounds[::2]), list(self.bounds[1::2])]}"
            )
        return points

    def _check_amounts(self, amounts: Any, n: int) -> np.ndarray:
        numbers = as_numbers(amounts)
        if numbers.shape not in ((), (n,)):
            raise InvalidValueError(
                f"amounts are {shortened(amounts)}; expected a number, or {n} of them, one for each position"
            )
        _check_limits("amounts", numbers)
        return np.ascontiguousarray(np.broadcast_to(numbers, n))


def levels_of(values: np.ndarray, peak: float) -> np.ndarray:
    """Return values as uint8 from 0 to 255: the square roots of their shares of a peak, so that faint ones are seen.

    Examples
    --------
    >>> levels_of(np.array([0.0, 0.01, 1.0, 4.0]), 4.0)
    array([  0,  13, 128, 255], dtype=uint8)
    """
    if peak <= 0.0:
        return np.zeros(values.shape, np.uint8)
    return np.rint(LEVELS * np.sqrt(np.clip(values / peak, 0.0, 1.0))).astype(np.uint8)


def values_of_levels(levels: np.ndarray, peak: float) -> np.ndarray:
    """Return the values for which `levels_of` returned these levels, as nearly as they are known.

    Examples
    --------
    >>> values_of_levels(np.array([0, 128, 255], np.uint8), 4.0).round(2)
    array([0.  , 1.01, 4.  ])
    """
    return peak * (levels / LEVELS) ** 2


def average_blocks(values: np.ndarray, most: int) -> np.ndarray:
    """Return the means of square blocks of cells, so large that there are at most this many; the last may be narrower.

    Examples
    --------
    >>> average_blocks(np.arange(12.0).reshape(3, 4), 5)
    array([[ 2.5,  4.5],
           [ 8.5, 10.5]])
    """
    rows, columns = values.shape
    side = 1
    while -(-rows // side) * -(-columns // side) > most:
        side += 1
    if side == 1:
        return values
    y, x = np.arange(0, rows, side), np.arange(0, columns, side)
    sums = np.add.reduceat(np.add.reduceat(values, y, axis=0, dtype=float), x, axis=1)
    return sums / np.outer(np.diff(np.append(y, rows)), np.diff(np.append(x, columns)))


class NamedFields(Mapping[str, ScalarField]):
    """The fields of a model by name, in the order in which they were added; `SwarmModel.add_field` adds one.

    Examples
    --------
    >>> from mesa_swarm import Field, SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> model.add_field(Field("trail"))
    <ScalarField trail, 60 rows x 80 columns, total 0>
    >>> list(model.fields), "food" in model.fields
    (['trail'], False)
    """

    def __init__(self, fields: dict[str, ScalarField]) -> None:
        self._fields = fields

    def __getitem__(self, name: str) -> ScalarField:
        if name not in self:
            problem = unknown_name("field", name, self._fields) if self._fields else f"unknown field {shortened(name)}"
            raise UnknownNameError(f"{problem}; add it with model.add_field(Field(...))")
        return self._fields[name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._fields

    def get(self, name: str, default: Any = None) -> Any:
        """Return the field of this name, or the default."""
        return self._fields.get(name, default)

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __repr__(self) -> str:
        return f"<NamedFields {', '.join(self._fields)}>"


class _Walls:
    """What obstacles block of a grid, see `geometry.diffusion`: sides, and by rows the cells with a closed link."""

    def __init__(self, shape: tuple[int, int], frame: Bounds, shapes: Sequence[Shape]) -> None:
        self._shapes = tuple(shapes)
        self.sides = np.full(shape, OPEN, np.uint8) if shapes else NO_SIDES
        for solid in shapes:
            _block(self.sides, frame, solid)
        rows, columns = np.nonzero(_differs(self.sides))
        self.begins = np.searchsorted(rows, np.arange(shape[0] + 1))
        self.cells = columns.astype(np.int64)

    def is_of(self, shapes: Sequence[Shape]) -> bool:
        """Return whether these very shapes are what blocks it."""
        return len(shapes) == len(self._shapes) and all(map(is_, shapes, self._shapes))


def _block(sides: np.ndarray, frame: Bounds, solid: Shape) -> None:
    if solid.is_disc:
        block_disc(sides, frame, solid.geometry.x, solid.geometry.y, solid.radius)
        return
    rings = (solid.geometry.exterior, *solid.geometry.interiors)
    corners = [shapely.get_coordinates(ring) for ring in rings]
    block_polygon(sides, frame, np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in corners]))


def _differs(sides: np.ndarray) -> np.ndarray:
    """Return which cells have a closed link, except where it and all around it is blocked: nothing is there."""
    closed = sides & OPEN != OPEN
    blocked = np.pad(sides & BLOCKED > 0, 1, constant_values=True)
    around = blocked[:-2, 1:-1] & blocked[2:, 1:-1] & blocked[1:-1, :-2] & blocked[1:-1, 2:]
    return closed & ~(blocked[1:-1, 1:-1] & around) if sides.size else closed


def _check_positions(positions: Any) -> np.ndarray:
    points = as_numbers(positions)
    if points.shape == (2,):
        points = points[None]
    if points.ndim == 1 and not np.size(positions):
        points = points.reshape(0, 2)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise InvalidValueError(f"positions are {shortened(positions)}; expected finite (x, y), one or rows of them")
    return np.ascontiguousarray(points)


def _check_limits(subject: str, amounts: np.ndarray, most: float = LARGEST_AMOUNT) -> None:
    wrong = ~((amounts >= 0) & (amounts <= most))
    if wrong.any():
        raise InvalidValueError(f"{subject} contain {amounts[wrong].flat[0]:g}; expected numbers from 0 to {most:g}")
