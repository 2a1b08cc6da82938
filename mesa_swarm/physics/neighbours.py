"""A sensor of where the nearest robots are, made of the same parts as custom ones."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from mesa_swarm.errors import check_count, check_flag, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.geometry.grid import Grid, cell_index
from mesa_swarm.physics.engine import CELLS_PER_ROBOT, FEWEST_CELLS
from mesa_swarm.physics.radio import is_cut, is_nearer, sorted_senders
from mesa_swarm.physics.sensing import into_frame
from mesa_swarm.robots.actuators import ACT
from mesa_swarm.robots.sensors import LARGEST_RANGE, Sensor

MOST_NEIGHBOURS = 1000
LAMP = f"{ACT}lamp"


@compiled
def read_neighbours(
    position, heading, rows, places, number, lamps, reach, occluded, lamp, grid, obstacles, out,
):  # fmt: skip
    """Write range and bearing, and the lamp if wanted, of the nearest robots, one after the other."""
    left, below, per_unit, columns, grid_rows = grid
    step = 3 if lamp else 2
    most = out.shape[1] // step
    start, order = sorted_senders(places, grid)
    nearest, squares = np.empty(most, np.int64), np.empty(most)
    for i in range(position.shape[0]):
        x, y, me, found = position[i, 0], position[i, 1], rows[i], 0
        first = cell_index(x - reach, left, per_unit, columns)
        last = cell_index(x + reach, left, per_unit, columns)
        lowest = cell_index(y - reach, below, per_unit, grid_rows)
        highest = cell_index(y + reach, below, per_unit, grid_rows)
        for row in range(lowest, highest + 1):
            for k in range(start[first + columns * row], start[last + columns * row + 1]):
                j = order[k]
                square = (places[j, 0] - x) ** 2 + (places[j, 1] - y) ** 2
                if j == me or square > reach * reach:
                    continue
                if found == most and not is_nearer(square, number[j], squares[most - 1], number[nearest[most - 1]]):
                    continue
                if occluded and is_cut(places[j, 0], places[j, 1], x, y, obstacles):
                    continue
                found = min(found + 1, most)
                place = found - 1
                while place > 0 and is_nearer(square, number[j], squares[place - 1], number[nearest[place - 1]]):
                    squares[place], nearest[place] = squares[place - 1], nearest[place - 1]
                    place -= 1
                squares[place], nearest[place] = square, j
        cosine, sine = math.cos(heading[i]), math.sin(heading[i])
        for k in range(found):
            j = nearest[k]
            ahead, aside = into_frame(places[j, 0] - x, places[j, 1] - y, cosine, sine)
            out[i, step * k], out[i, step * k + 1] = math.sqrt(squares[k]), math.atan2(aside, ahead)
            if lamp:
                out[i, step * k + 2] = lamps[j]


@lru_cache(maxsize=64)
def _grid_of(bounds: tuple[float, float, float, float], reach: float, robots: int) -> tuple:
    return Grid.over(bounds, max(reach, 1e-9), FEWEST_CELLS + CELLS_PER_ROBOT * robots).numbers


@dataclass(frozen=True, kw_only=True, slots=True)
class NeighbourSensor(Sensor):
    """A sensor of range and bearing of the nearest robots, of equally near ones of those added first.

    The j-th nearest, from 0, is ``me.neighbour[2 * j]`` away, centre to centre, at ``me.neighbour[2 * j + 1]``, rad in
    [-pi, pi] from the heading; with `lamp` its numbers are three: [3 * j], [3 * j + 1], and its lamp at [3 * j + 2].
    What there is not reads NaN, and so do lamps where no robot has a `Lamp`.

    Parameters
    ----------
    range : float
        How far it sees, centre to centre, map units, 0 to 1e6.
    k : int
        How many robots it reads, 1 to 1000.
    occluded : bool
        Whether obstacles on the straight line between the two centres hide a robot.
    lamp : bool
        Whether it reads what the lamps of these robots were set to in the step before.
    name : str

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> from mesa_swarm import RobotDesign, SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> eyes = RobotDesign(sensors=(NeighbourSensor(range=50, k=1),))
    >>> one, other = model.add_robots(eyes, poses=[(100, 100, 0.0), (130, 100, 0.0)])
    >>> model.sense()
    >>> one.neighbour
    array([30.,  0.])
    """

    range: float = 100.0
    k: int = 4
    occluded: bool = False
    lamp: bool = False
    name: str = "neighbour"

    read = staticmethod(read_neighbours)

    def __post_init__(self) -> None:
        """Check every value."""
        check_number("range", self.range, minimum=0, maximum=LARGEST_RANGE)
        check_count("k", self.k, minimum=1, maximum=MOST_NEIGHBOURS)
        check_flag("occluded", self.occluded)
        check_flag("lamp", self.lamp)

    @property
    def width(self) -> int:
        """How many numbers it reads."""
        return int(self.k) * (3 if self.lamp else 2)

    def arguments(self, model: Any) -> Mapping[str, Any]:
        """Return where all robots are, their lamps, and the grid that finds those in range."""
        columns, reach = model.swarm.columns, float(self.range)
        lamps = columns.get(LAMP) if self.lamp else None
        places = columns["position"]
        return {
            "places": places,
            "number": columns["number"],
            "lamps": np.full(len(places), np.nan) if lamps is None else lamps.reshape(len(places), -1)[:, 0].copy(),
            "reach": reach,
            "occluded": bool(self.occluded),
            "lamp": bool(self.lamp),
            "grid": _grid_of(model.map.bounds, reach, len(places)),
        }
