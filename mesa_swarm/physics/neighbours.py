"""A sensor of where the nearest robots, or bodies of a kind, are, made like custom ones."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, check_flag, check_number
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.grid import CellLists, Grid, GridNumbers, cell_index
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, direction_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Codes, Integers, RealRows, Reals
from mesa_swarm.physics.broadcasts import NO_LISTS, is_cut_but, is_nearer_robot, sorted_senders
from mesa_swarm.physics.engine import CELLS_PER_ROBOT, FEWEST_CELLS
from mesa_swarm.physics.sensing import rotate_into_frame
from mesa_swarm.robots.actuators import ACT
from mesa_swarm.robots.devices import check_identifier, check_kind, check_spelling
from mesa_swarm.robots.sensors import LARGEST_RANGE, RowsOfSensor, Sensor, begin_reading, end_reading
from mesa_swarm.world.statics import CARRIED, GOES_OUT, KINDS, NOTHING, ROBOT

MOST_NEIGHBOURS = 1000
LAMP = f"{ACT}lamp"
# Where what a robot carries is for others: farther than any sensor sees. And the modes of what has none.
FAR_AWAY, IS_CARRIED, NO_MODES = 1e300, np.int8(CARRIED), np.empty(0, np.int8)


@compiled
def read_neighbours(
    position, heading, rows, places, number, bodies, lamps, reach, occluded, lamp, grid, obstacles, owners, out,
):  # fmt: skip
    """Write range and bearing, and the lamp if wanted, of the nearest robots or bodies, one after the other.

    `bodies` are the indices of bodies as `owners` has them, -1 for robots, of which none sees itself.
    """
    left, below, per_unit, columns, grid_rows = grid
    step = 3 if lamp else 2
    most = out.shape[1] // step
    start, order = sorted_senders(places, grid)
    nearest, squares = np.empty(most, np.int64), np.empty(most)
    for i in range(position.shape[0]):
        x, y, me, count = position[i, 0], position[i, 1], rows[i], 0
        first = cell_index(x - reach, left, per_unit, columns)
        last = cell_index(x + reach, left, per_unit, columns)
        lowest = cell_index(y - reach, below, per_unit, grid_rows)
        highest = cell_index(y + reach, below, per_unit, grid_rows)
        for row in range(lowest, highest + 1):
            for k in range(start[first + columns * row], start[last + columns * row + 1]):
                j = order[k]
                square = (places[j, 0] - x) ** 2 + (places[j, 1] - y) ** 2
                if (j == me and bodies[j] < 0) or square > reach * reach:
                    continue
                if count == most and not is_nearer_robot(
                    square, number[j], squares[most - 1], number[nearest[most - 1]]
                ):
                    continue
                if occluded and is_cut_but(places[j, 0], places[j, 1], x, y, obstacles, owners, bodies[j]):
                    continue
                count = min(count + 1, most)
                place = count - 1
                while place > 0 and is_nearer_robot(square, number[j], squares[place - 1], number[nearest[place - 1]]):
                    squares[place], nearest[place] = squares[place - 1], nearest[place - 1]
                    place -= 1
                squares[place], nearest[place] = square, j
        cosine, sine = direction_of(heading[i])
        for k in range(count):
            j = nearest[k]
            ahead, aside = rotate_into_frame(places[j, 0] - x, places[j, 1] - y, cosine, sine)
            out[i, step * k], out[i, step * k + 1] = math.sqrt(squares[k]), atan2(aside, ahead)
            if lamp:
                out[i, step * k + 2] = lamps[j]


class NeighbourReading(NamedTuple):
    """What `read_all_neighbours` takes: the robots that have the sensor, and other arguments of `read_neighbours`.

    Places are copied from rows of positions, lamps from the first numbers of a column, which is empty without any.
    `mode` is that of bodies, empty of robots.
    """

    robots: RowsOfSensor
    positions: RealRows
    of_places: Integers
    mode: Codes
    places: RealRows
    number: Integers
    bodies: Integers
    lamp_column: RealRows
    lamps: Reals
    reach: float
    occluded: bool
    lamp: bool
    grid: GridNumbers
    edges: RealRows
    discs: RealRows
    touch_cells: CellLists
    driven: CellLists
    owners: Integers


@compiled(nogil=True)
def read_all_neighbours(block, step, first, last):
    """Do what `read_neighbours` does, for all robots that have the sensor."""
    a = unpack(block, NeighbourReading)
    r, places, lamps, lists, driven = a.robots, a.places, a.lamps, a.touch_cells, a.driven
    for k in range(places.shape[0]):
        j = a.of_places[k]
        places[k, 0], places[k, 1] = a.positions[j, 0], a.positions[j, 1]
        if a.mode.shape[0] > 0 and a.mode[j] == IS_CARRIED:
            places[k, 0] = FAR_AWAY
    if a.lamp_column.shape[1] > 0:
        for k in range(lamps.shape[0]):
            lamps[k] = a.lamp_column[k, 0]
    obstacles = a.edges, a.discs, lists.grid, lists.start, lists.items, (driven.grid, driven.start, driven.items)
    begin_reading(r)
    read_neighbours(
        r.own_position, r.own_heading, r.rows, places, a.number, a.bodies, lamps, a.reach, a.occluded, a.lamp, a.grid,
        obstacles, a.owners, r.out,
    )  # fmt: skip
    end_reading(r)
    return 0


@lru_cache(maxsize=64)
def _grid_of(bounds: Bounds, reach: float, robots: int) -> tuple:
    return Grid.over(bounds, max(reach, 1e-9), FEWEST_CELLS + CELLS_PER_ROBOT * robots).numbers


@dataclass(frozen=True, kw_only=True, slots=True)
class NeighbourSensor(Sensor):
    """A sensor of range and bearing of the nearest robots or bodies, of equally near ones of those added first.

    The j-th nearest, from 0, is ``me.neighbour[2 * j]`` away, centre to centre, at ``me.neighbour[2 * j + 1]``, rad in
    [-pi, pi] from the heading; with `lamp` its numbers are three: [3 * j], [3 * j + 1], and its lamp at [3 * j + 2].
    What there is not reads NaN, and so do lamps where no robot has a `Lamp`. Bodies that a robot carries, and sources
    of heat that are out, are not seen.

    Parameters
    ----------
    range : float
        How far it sees, centre to centre, map units, 0 to 1e6.
    k : int
        How many it reads, 1 to 1000.
    occluded : bool
        Whether obstacles, and other bodies that robots bump into, on the straight line between the two centres hide it;
        robots and sources of heat hide nothing.
    lamp : bool
        Whether it reads what the lamps of these robots were set to in the step before.
    kind : str
        What it sees: "robot", or bodies of a kind such as "sheep", which the model has to know: see
        `SwarmModel.add_body` and `SwarmModel.add_kind`.
    name : str
        What rules and columns call it; by default "neighbour" for robots, else the kind.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> from mesa_swarm import RobotDesign, SwarmModel, disc
    >>> model = SwarmModel(rng=1)
    >>> eyes = RobotDesign(sensors=(NeighbourSensor(range=50, k=1),))
    >>> one, other = model.add_robots(eyes, poses=[(100, 100, 0.0), (130, 100, 0.0)])
    >>> model.sense()
    >>> one.neighbour
    array([30.,  0.])

    Robots that see the two nearest sheep, which may be Mesa agents of your own:

    >>> dogs = RobotDesign(sensors=(NeighbourSensor(range=50, k=2, kind="sheep"),))
    >>> model = SwarmModel(rng=1)
    >>> (dog,) = model.add_robots(dogs, poses=[(100, 100, 0.0)])
    >>> sheep = model.add_body(disc((100, 140), 3), kind="sheep")
    >>> model.sense()
    >>> dog.sheep.round(2)
    array([40.  ,  1.57,   nan,   nan])
    """

    range: float = 100.0
    k: int = 4
    occluded: bool = False
    lamp: bool = False
    kind: str = KINDS[ROBOT]
    name: str = ""

    read = staticmethod(read_neighbours)

    def __post_init__(self) -> None:
        """Check every value."""
        check_number("range", self.range, minimum=0, maximum=LARGEST_RANGE)
        check_count("k", self.k, minimum=1, maximum=MOST_NEIGHBOURS)
        check_flag("occluded", self.occluded)
        check_flag("lamp", self.lamp)
        check_identifier("kind of a NeighbourSensor", self.kind)
        if self.lamp and self.kind != KINDS[ROBOT]:
            raise InvalidValueError(f"lamp is True for bodies of the kind {self.kind!r}, which have none; leave it out")
        object.__setattr__(self, "name", self.name or ("neighbour" if self.kind == KINDS[ROBOT] else self.kind))

    def check_model(self, model: Any) -> None:
        """Refuse a misspelt kind of bodies."""
        check_spelling(model, self.kind)

    def check_bodies(self, model: Any) -> None:
        """Refuse a kind of bodies that the model does not know, see `check_kind`."""
        check_kind(model, self, self.kind)

    @property
    def width(self) -> int:
        """How many numbers it reads."""
        return int(self.k) * (3 if self.lamp else 2)

    def arguments(self, model: Any) -> Mapping[str, Any]:
        """Return where all robots or bodies of the kind are, their lamps, and the grid that finds those in range."""
        reach = float(self.range)
        of_kind = _robots(model, self.lamp) if self.kind == KINDS[ROBOT] else _bodies(model, self.kind)
        return {
            **of_kind,
            "reach": reach,
            "occluded": bool(self.occluded),
            "lamp": bool(self.lamp),
            "grid": _grid_of(model.map.bounds, reach, len(of_kind["places"])),
        }

    def kernel_for(self, model: Any, rows: np.ndarray, column: np.ndarray, first: int) -> Kernel | None:
        """Return what reads for the robots in these rows, see `Sensor`; None for what is not seen once it is out."""
        if self.kind == GOES_OUT:
            return None
        named, scene, table = dict(self.arguments(model)), model.parts.bodies.scene(), model.parts.bodies.table
        of_robots, statics, moving = self.kind == KINDS[ROBOT], scene.statics, scene.moving
        lamps = model.swarm.columns.get(LAMP) if self.lamp else None
        count = len(named["places"])
        block = Block(
            NeighbourReading(
                robots=RowsOfSensor.of(model, rows, column, first, int(self.width)),
                positions=model.swarm.columns["position"] if of_robots else table.position,
                of_places=np.arange(count) if of_robots else _rows_of_kind(model, self.kind),
                mode=NO_MODES if of_robots else table.mode,
                places=np.empty((count, 2)),
                number=named["number"],
                bodies=named["bodies"],
                lamp_column=np.empty((0, 0)) if lamps is None else lamps.reshape(count, lamps.size // max(count, 1)),
                lamps=named["lamps"],
                reach=named["reach"],
                occluded=named["occluded"],
                lamp=named["lamp"],
                grid=named["grid"],
                edges=statics.edges,
                discs=statics.discs[: statics.first_apart],
                touch_cells=statics.touch_cells,
                driven=NO_LISTS if moving is None else moving.arrays.touch_cells,
                owners=statics.owner,
            )
        )
        return Kernel(read_all_neighbours, block.numbers, block)


def _robots(model: Any, lamp: bool) -> dict[str, np.ndarray]:
    columns = model.swarm.columns
    lamps = columns.get(LAMP) if lamp else None
    places = columns["position"]
    return {
        "places": places,
        "number": columns["number"],
        "bodies": np.full(len(places), -1),
        "lamps": np.full(len(places), np.nan) if lamps is None else lamps.reshape(len(places), -1)[:, 0].copy(),
    }


def _bodies(model: Any, kind: str) -> dict[str, np.ndarray]:
    """Return the same of the bodies of a kind, without those that are out; what robots carry is far away."""
    table, rows = model.parts.bodies.table, _rows_of_kind(model, kind)
    number, places = table.numbers[rows], table.position[rows]
    places[table.mode[rows] == CARRIED, 0] = FAR_AWAY
    return {"places": places, "number": number, "bodies": number, "lamps": np.empty(0)}


def _rows_of_kind(model: Any, kind: str) -> np.ndarray:
    table, kinds = model.parts.bodies.table, model.kinds
    code = kinds.index(kind) if kind in kinds else NOTHING
    return np.flatnonzero((table.kind == code) & (table.visible_kinds == code))
