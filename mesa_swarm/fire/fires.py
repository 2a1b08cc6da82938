"""Fires as columns, as Mesa agents, and their history."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError, check_number
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Flags, Integers, Reals, RealTables
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
        self.model.parts["fires"].release_robots(self.index)

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
    """What `store_temperatures` takes: columns, the place of each fire in a row, and the rows that are written."""

    heat_of: Reals
    rows: Integers
    robots: Integers
    out: Flags
    places: Integers
    table: RealTables
    steps: Integers
    written: Integers


# The code that the kernel returns where its table is full, and how many rows that has.
FULL, MOST_ROWS = 1, 1000


@compiled(nogil=True)
def store_temperatures(block, step, first, last):
    """Store a row of the history of fires."""
    h = unpack(block, HistoryArrays)
    rows, robots, out, places, table, written = h.rows, h.robots, h.out, h.places, h.table, h.written
    row = written[0]
    if row == table.shape[0]:
        return FULL
    for f in range(rows.shape[0]):
        table[row, 0, places[f]] = h.heat_of[rows[f]]
        table[row, 1, places[f]] = -1.0 if out[f] else float(robots[f])
    h.steps[row] = step
    written[0] += 1
    return 0


def is_same_key(key: tuple, other: tuple) -> bool:
    """Return whether two keys have the same arrays, and are equal besides."""
    pairs = zip(key, other, strict=True)
    return all(one is two if isinstance(one, np.ndarray) else one == two for one, two in pairs)


def do_nothing() -> None:
    """Do nothing."""


class History:
    """Temperature of every fire, and robots at it, after some steps."""

    def __init__(self, every: int | Trigger) -> None:
        self.trigger = Trigger.of(every, "history_every")
        self._kernel: Kernel | None = None
        # What is called when the interval has changed.
        self.replan: Callable[[], None] = do_nothing
        self._steps: list[int] = []
        self._rows: list[np.ndarray] = []
        # The column of each fire that is there now: columns stay when fires are removed.
        self._places: list[int] = []
        self._fires = 0

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what a copy is given anew."""
        return {**self.__dict__, "_kernel": None, "replan": do_nothing}

    @property
    def width(self) -> int:
        """How many fires there ever were."""
        return self._fires

    @property
    def every(self) -> int:
        """Steps between two rows; 0 for no rows at all; may be changed between steps."""
        return self.trigger.every

    @every.setter
    def every(self, every: int | Trigger) -> None:
        self.trigger = Trigger.of(every, "history_every")
        self.replan()

    def add_fire(self) -> None:
        """Make room for one more fire: a column of its own."""
        self._places.append(self._fires)
        self._fires += 1

    def remove_fire(self, index: int) -> None:
        """End the column of a removed fire: its past stays, and it continues as nan and -1."""
        del self._places[index]

    def kernel(self, fires: "Fires") -> Kernel:
        """Return what stores a row: the temperature of each fire, and robots at it, -1 of one that is out."""
        key = (fires.own["out"], fires.table.temperature, self._fires, list(self._places))
        if self._kernel is None or not is_same_key(self._kernel.kept[0], key):
            places, count = np.array(self._places, np.int64), np.zeros(1, np.int64)
            tables = np.full((MOST_ROWS, 2, self._fires), np.nan), np.zeros(MOST_ROWS, np.int64)
            tables[0][:, 1] = -1.0
            columns = fires.table.temperature, fires.rows.copy(), fires.own["robots"], fires.own["out"]
            block = Block(HistoryArrays(*columns, places, *tables, count))
            finish = partial(self._take, *tables, count)
            kept = key, block
            self._kernel = Kernel(store_temperatures, block.numbers, kept, lambda code: finish(), finish)
        return self._kernel

    def _take(self, table: np.ndarray, steps: np.ndarray, count: np.ndarray) -> None:
        """Take the rows that the kernel has written."""
        rows = int(count[0])
        if rows:
            count[0] = 0
            self._steps += steps[:rows].tolist()
            self._rows += list(table[:rows].copy())

    @property
    def series(self) -> tuple[list[int], list[np.ndarray]]:
        """The steps and the rows as they are: lists that grow."""
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
        self.every, self._places, self._fires = every, list(places), fires

    def forget(self, rows: int) -> None:
        """Drop all but the last rows."""
        del self._steps[: max(0, len(self._steps) - rows)], self._rows[: max(0, len(self._rows) - rows)]

    @property
    def steps(self) -> np.ndarray:
        """The steps of the rows, shape (k,)."""
        return read_only(np.array(self._steps, np.int64))

    @property
    def temperature(self) -> np.ndarray:
        """Temperatures, shape (k, f)."""
        return read_only(self._table(0))

    @property
    def robots(self) -> np.ndarray:
        """Robots at each fire, -1 once it is out, shape (k, f)."""
        return read_only(self._table(1).astype(np.int64))

    def _table(self, part: int) -> np.ndarray:
        width = max((row.shape[1] for row in self._rows), default=0)
        table = np.full((len(self._rows), width), np.nan if part == 0 else -1.0)
        for k, row in enumerate(self._rows):
            table[k, : row.shape[1]] = row[part]
        return table
