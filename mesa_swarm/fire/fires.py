"""Fires as columns, as Mesa agents, and their history."""

import math
from collections.abc import Iterator
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError, check_number
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import Flags, Integers, Reals, RealTables
from mesa_swarm.physics.stage_kernels import DONE, ONLY
from mesa_swarm.world.arena import Arena, Model
from mesa_swarm.world.bodies import Body, BodyTable
from mesa_swarm.world.read_only import locked_view, read_only
from mesa_swarm.world.shapes import Coordinates, Shape
from mesa_swarm.world.statics import FIRE, FIXED, KINDS

NEVER = -1
# What fires have besides what the table of bodies has of them.
OWN = {"area": np.float64, "out": np.bool_, "out_step": np.int64, "robots": np.int64}
OF_BODIES = ("position", "radius", "temperature")
COLUMNS = ("position", "radius", "area", "temperature", "out", "out_step", "robots")
# That a stored history may have had.
MOST_FIRES = 10_000_000
# Of the rows of the history that a kernel writes before they are taken, and the numbers of all fires in them.
MOST_ROWS, MOST_NUMBERS = 250, 100_000
# What this kernel returns when there is no room for another row.
FULL = 1


class Fires:
    """All fires of a model as columns, in the order in which they were added.

    Columns are read-only; change a fire by its handle, ``model.fires[1].temperature = 0.5``.

    Attributes
    ----------
    position : ndarray, shape (f, 2)
    radius, area, temperature : ndarrays, shape (f,)
        Temperature is in [0, 1].
    out : bool ndarray, shape (f,)
        Extinguished.
    out_step : int64 ndarray, shape (f,)
        The step in which it went out, -1 while it burns.
    robots : int64 ndarray, shape (f,)
        How many fight it now.
    asked : ndarray, shape (f,)
        The temperature at which a process asks for each to be lit again, NaN for none.
    rows : int64 ndarray, shape (f,)
        Of the fires in the table of bodies, which has position, radius and temperature; these are copies.
    history : History

    Examples
    --------
    >>> len(Fires())
    0
    """

    area: NDArray[np.float64]
    out: NDArray[np.bool]
    out_step: NDArray[np.int64]
    robots: NDArray[np.int64]

    def __init__(self, history_every: int | Trigger = 1, table: BodyTable | None = None) -> None:
        self.table = BodyTable() if table is None else table
        self.agents: list[Fire] = []
        self.own: dict[str, np.ndarray] = {name: np.zeros(0, dtype) for name, dtype in OWN.items()}
        self.history = History(history_every)
        self._publish()

    def __setstate__(self, state: dict) -> None:
        """Give copied or unpickled fires views of their own columns."""
        self.__dict__.update(state)
        self._publish()

    def __len__(self) -> int:
        """How many fires there are, those that are out included."""
        return len(self.agents)

    def __getitem__(self, index: int) -> "Fire":
        """Return the handle of one fire."""
        return self.agents[index]

    def __iter__(self) -> Iterator["Fire"]:
        """Iterate over the handles, also while fires are being removed."""
        return iter(list(self.agents))

    def __getattr__(self, name: str) -> np.ndarray:
        """Return a column of the table of bodies in the rows of fires."""
        if name not in OF_BODIES:
            raise AttributeError(f"Fires has no attribute {name}")
        return locked_view(getattr(self.table, name)[self.rows])

    @property
    def rows(self) -> np.ndarray:
        """Rows of the fires in the table of bodies."""
        return read_only(np.flatnonzero(self.table.kind == FIRE))

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """All columns by name."""
        return {name: self.own[name] if name in OWN else getattr(self, name) for name in COLUMNS}

    @property
    def discs(self) -> np.ndarray:
        """x, y and radius, shape (f, 3)."""
        return read_only(np.column_stack([self.position, self.radius]))

    def times_out(self, first: int | None = None) -> dict[str, int | None]:
        """Return the step at which each of the first fires, or of all, went out, or None, by a name for tables.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(map="openspace_fire", rng=1).fires.times_out(2)
        {'fire 1 out at': None, 'fire 2 (largest) out at': None}
        """
        area, times = self.area, {}
        for i, step in enumerate(self.out_step[:first].tolist()):
            largest = " (largest)" if (area[i] > np.delete(area, i)).all() else ""
            times[f"fire {i + 1}{largest} out at"] = step if step >= 0 else None
        return times

    def add(self, fire: "Fire", area: float) -> None:
        """Append a fire."""
        is_out = not fire.temperature > 0
        values = {"area": area, "out": is_out, "out_step": 0 if is_out else NEVER, "robots": 0}
        self.own = {name: np.append(column, values[name]).astype(OWN[name]) for name, column in self.own.items()}
        self.agents.append(fire)
        self.history.add_fire()
        self._publish()

    def remove(self, index: int) -> None:
        """Drop a fire; the handles of the others get their new indices."""
        del self.agents[index]
        self.history.remove_fire(index)
        for place, fire in enumerate(self.agents):
            fire.index = place
        self.own = {name: np.delete(column, index) for name, column in self.own.items()}
        self._publish()

    def _publish(self) -> None:
        self.asked = np.full(len(self.agents), np.nan)
        for name, column in self.own.items():
            setattr(self, name, locked_view(column))


class Fire(Body):
    """One fire: a disc that radiates and burns, see `Burning`. Created by `SwarmModel.add_fire`.

    Its `index` is its place in `fires`.
    """

    fires: Fires
    index: int
    _made_by: ClassVar[str] = "model.add_fire((x, y), area=1.0)"

    def __init__(self, space: Arena, model: Model, fires: Fires, shape: Shape, area: float, temperature: float) -> None:
        self.fires, self.index = fires, len(fires)
        super().__init__(space, model, fires.table, shape, KINDS[FIRE], mode=FIXED, temperature=temperature)
        fires.add(self, area)

    def __repr__(self) -> str:
        if self.space is None:
            return f"<Fire {self.unique_id}, removed>"
        x, y = (round(float(number), 2) for number in self.position)
        state = "out" if self.out else f"temperature {self.temperature:.3g}"
        return f"<Fire {self.unique_id} at ({x}, {y}), {state}>"

    @property
    def position(self) -> NDArray[np.float64]:
        """Centre, shape (2,)."""
        return read_only(self.table.position[self._alive()].copy())

    @position.setter
    def position(self, value: Coordinates) -> None:
        raise InvalidValueError("fires do not move; remove this one and add another")

    @property
    def shape(self) -> Shape:
        """Its body, a disc."""
        return self.table.shape_of(self._alive())

    @property
    def radius(self) -> float:
        """Radius of its body, map units."""
        return float(self.table.radius[self._alive()])

    @property
    def area(self) -> float:
        """Its size: each robot lowers its temperature by k2 / area a step."""
        return float(self._read("area"))

    @property  # type: ignore[override]
    def temperature(self) -> float:
        """Its temperature in [0, 1]; 0 once it is out."""
        return float(self.table.temperature[self._alive()])

    @temperature.setter
    def temperature(self, value: float) -> None:
        temperature = check_number("temperature", value, above=0, maximum=1)
        if self.out:
            raise InvalidValueError("this fire is out; use light(), or add another")
        self.table.temperature[self.row] = temperature
        self.model.parts["bodies"].scene_changed()  # sensors that were read already are read again

    @property
    def out(self) -> bool:
        """Whether it is out."""
        return bool(self._read("out"))

    @property
    def robots(self) -> int:
        """How many robots fight it now."""
        return int(self._read("robots"))

    def put_out(self) -> None:
        """Put the fire out by hand, between two steps; robots that fight it are released.

        Of one that is out the step in which it went out is from now on this one.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> fire = model.add_fire((400, 300), radius=20)
        >>> fire.put_out()
        >>> fire.out, fire.temperature
        (True, 0.0)
        """
        self.table.temperature[self._alive()] = 0.0
        for name, value in (("out", True), ("out_step", self.model.steps), ("robots", 0)):
            self.fires.own[name][self.index] = value
        self.model.swarm.columns["fire"].fill(-1)
        self.model.parts["bodies"].scene_changed()

    def light(self, temperature: float = 1.0) -> None:
        """Light the fire again by hand, between two steps.

        Parameters
        ----------
        temperature : float
            Above 0, at most 1.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> fire = model.add_fire((400, 300), radius=20)
        >>> fire.put_out(), fire.light(0.5)
        (None, None)
        >>> fire.out, fire.temperature
        (False, 0.5)
        """
        row = self._alive()
        self.table.temperature[row] = check_number("temperature", temperature, above=0, maximum=1)
        self.fires.own["out"][self.index], self.fires.own["out_step"][self.index] = False, NEVER
        self.model.parts["bodies"].scene_changed()  # sensors that were read already are read again

    def remove(self) -> None:
        """Take the fire out of the world, between two steps."""
        self._alive()
        super().remove()
        index, self.index = self.index, -1
        self.fires.remove(index)
        self.model.parts["fires"].release_robots(index)

    def _alive(self) -> int:
        if self.space is None:
            raise RemovedRobotError("this fire has been removed; take one from model.fires")
        return self.row

    def _read(self, name: str) -> Any:
        self._alive()
        return self.fires.own[name][self.index]


class HistoryArrays(NamedTuple):
    """What `store_row` takes.

    The room for rows, temperatures and robots of each (k, 2, f), and for their steps; how many there are, every how
    many steps one is due, and by how much the steps of the model are more than those completed; then the rows of fires
    in the table of bodies, the columns of rows that each has, and columns of bodies and fires.
    """

    rows: RealTables
    steps: Integers
    written: Integers
    every: Integers
    ahead: Integers
    fires: Integers
    places: Integers
    temperature: Reals
    robots: Integers
    out: Flags


@compiled(nogil=True)
def store_row(block, step, first, last):
    """Store a row of the history of all fires, whichever rows of robots these are, if one is due after this step."""
    h = unpack(block, HistoryArrays)
    rows, count, every = h.rows, h.written[ONLY], h.every[ONLY]
    if every == 0 or (step - h.ahead[ONLY]) % every != 0:
        return DONE
    if count == rows.shape[0]:
        return FULL
    for place in range(rows.shape[2]):
        rows[count, 0, place], rows[count, 1, place] = math.nan, -1.0
    for f in range(h.fires.shape[0]):
        place = h.places[f]
        rows[count, 0, place] = h.temperature[h.fires[f]]
        rows[count, 1, place] = -1.0 if h.out[f] else h.robots[f]
    h.steps[count] = step
    h.written[ONLY] = count + 1
    return DONE


class History:
    """Temperature of every fire, and robots at it, after some steps.

    A kernel writes rows into an array, from which they are taken when they are read or the array is full.
    """

    def __init__(self, every: int | Trigger) -> None:
        # Of one number each, also for the kernel.
        self._every, self._count, self._ahead = np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros(1, np.int64)
        self.every = every  # type: ignore[assignment]
        self._steps: list[int] = []
        self._rows: list[np.ndarray] = []
        # The column of each fire that is there now: columns stay when fires are removed.
        self._places: list[int] = []
        self._fires = 0
        self.changes: object = object()  # another one when columns are
        self._written: tuple[np.ndarray, np.ndarray] = np.empty(0, np.int64), np.empty((0, 2, 0))

    def __getstate__(self) -> dict[str, Any]:
        """Take all rows from the array: a copy writes into another."""
        self._take_rows()
        return self.__dict__ | {"_written": (np.empty(0, np.int64), np.empty((0, 2, 0)))}

    @property
    def width(self) -> int:
        """How many fires there ever were."""
        return self._fires

    @property
    def every(self) -> int:
        """Steps between two rows; 0 for no rows at all; may be changed between steps."""
        return int(self._every[ONLY])

    @every.setter
    def every(self, every: int | Trigger) -> None:
        self._every[ONLY] = Trigger.of(every, "history_every").every

    def add_fire(self) -> None:
        """Make room for one more fire: a column of its own."""
        self._take_rows()
        self._places.append(self._fires)
        self._fires, self.changes = self._fires + 1, object()

    def remove_fire(self, index: int) -> None:
        """End the column of a removed fire: its past stays, and it continues as nan and -1."""
        self._take_rows()
        del self._places[index]
        self.changes = object()

    def kernel(self, fires: Fires) -> Kernel:
        """Return what stores a row for these fires after the steps in which one is due; valid while these stay."""
        self._take_rows()
        if not self._fires:
            return sequence_of([])
        count = max(1, min(MOST_ROWS, MOST_NUMBERS // max(self._fires, 1)))
        steps, rows = self._written = np.empty(count, np.int64), np.empty((count, 2, self._fires))
        block = Block(
            HistoryArrays(
                rows=rows,
                steps=steps,
                written=self._count,
                every=self._every,
                ahead=self._ahead,
                fires=fires.rows.copy(),
                places=np.array(self._places, np.int64),
                temperature=fires.table.temperature,
                robots=fires.own["robots"],
                out=fires.own["out"],
            )
        )
        return Kernel(store_row, block.numbers, block, lambda code: self._take_rows())

    def count_from(self, steps: int, completed: int) -> None:
        """Note by how much the steps that rows are of are more than those completed, which decide when one is due."""
        self._ahead[ONLY] = steps - completed

    def _take_rows(self) -> None:
        """Append the rows that the kernel has written to the others."""
        count = int(self._count[ONLY])
        if count:
            steps, rows = self._written
            self._steps.extend(steps[:count].tolist())
            self._rows.extend(row.copy() for row in rows[:count])  # arrays of their own, as they are stored
            self._count[ONLY] = 0

    @property
    def room(self) -> tuple[int, np.ndarray]:
        """How many rows the kernel writes before they are taken, and where it counts them."""
        return len(self._written[0]), self._count

    @property
    def series(self) -> tuple[list[int], list[np.ndarray]]:
        """The steps and the rows as they are: lists that grow."""
        self._take_rows()
        return self._steps, self._rows

    @property
    def places(self) -> tuple[int, list[int]]:
        """How many fires there ever were, and the column of each that is there now."""
        return self._fires, list(self._places)

    def restore(self, every: int, fires: int, places: list[int], *, present: int) -> None:
        """Take back the interval and `places`, of as many fires as are `present`; rows are restored apart."""
        numbers = all(type(number) is int and number >= 0 for number in (every, fires, *places))
        if not numbers or len(places) != present or any(place >= fires for place in places) or fires > MOST_FIRES:
            raise InvalidValueError("invalid history of fires")
        self._take_rows()
        self.every, self._places, self._fires, self.changes = every, list(places), fires, object()

    def forget(self, rows: int) -> None:
        """Drop all but the last rows."""
        self._take_rows()
        del self._steps[: max(0, len(self._steps) - rows)], self._rows[: max(0, len(self._rows) - rows)]

    @property
    def steps(self) -> np.ndarray:
        """The steps of the rows, shape (k,)."""
        return read_only(np.array(self.series[0], np.int64))

    @property
    def temperature(self) -> np.ndarray:
        """Temperatures, shape (k, f)."""
        return read_only(self._table(0))

    @property
    def robots(self) -> np.ndarray:
        """Robots at each fire, -1 once it is out, shape (k, f)."""
        return read_only(self._table(1).astype(np.int64))

    def _table(self, part: int) -> np.ndarray:
        _, rows = self.series
        width = max((row.shape[1] for row in rows), default=0)
        table = np.full((len(rows), width), np.nan if part == 0 else -1.0)
        for k, row in enumerate(rows):
            table[k, : row.shape[1]] = row[part]
        return table
