"""Fires as columns, as Mesa agents, and their history."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mesa_swarm.errors import InvalidValueError, RemovedRobotError, check_number
from mesa_swarm.trigger import Trigger
from mesa_swarm.world.arena import Arena, ArenaAgent, Model
from mesa_swarm.world.bodies import Body
from mesa_swarm.world.read_only import read_only
from mesa_swarm.world.shapes import Coordinates, Shape, disc
from mesa_swarm.world.statics import FIRE, KINDS

COLUMNS: dict[str, tuple[tuple[int, ...], type]] = {
    "position": ((2,), np.float64),
    "radius": ((), np.float64),
    "area": ((), np.float64),
    "temperature": ((), np.float64),
    "out": ((), np.bool_),
    "out_step": ((), np.int64),
    "robots": ((), np.int64),
}
NEVER = -1
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
    history : History

    Examples
    --------
    >>> len(Fires())
    0
    """

    position: NDArray[np.float64]
    radius: NDArray[np.float64]
    area: NDArray[np.float64]
    temperature: NDArray[np.float64]
    out: NDArray[np.bool]
    out_step: NDArray[np.int64]
    robots: NDArray[np.int64]

    def __init__(self, history_every: int | Trigger = 1) -> None:
        self.agents: list[Fire] = []
        self.columns: dict[str, np.ndarray] = {
            name: np.zeros((0, *shape), dtype) for name, (shape, dtype) in COLUMNS.items()
        }
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

    @property
    def discs(self) -> np.ndarray:
        """x, y and radius, shape (f, 3)."""
        return read_only(np.column_stack([self.columns["position"], self.columns["radius"]]))

    def times_out(self, first: int | None = None) -> dict[str, int | None]:
        """Return the step at which each of the first fires, or of all, went out, or None, by a name for tables.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(map="openspace_fire", rng=1).fires.times_out(2)
        {'fire 1 out at': None, 'fire 2 (largest) out at': None}
        """
        area, found = self.columns["area"], {}
        for i, step in enumerate(self.columns["out_step"][:first].tolist()):
            largest = " (largest)" if (area[i] > np.delete(area, i)).all() else ""
            found[f"fire {i + 1}{largest} out at"] = step if step >= 0 else None
        return found

    def add(self, position: Coordinates, radius: float, area: float, temperature: float) -> int:
        """Append a fire and return its index."""
        values = {
            "position": position,
            "radius": radius,
            "area": area,
            "temperature": temperature,
            "out": temperature <= 0,
            "out_step": 0 if temperature <= 0 else NEVER,
            "robots": 0,
        }
        for name, (_, dtype) in COLUMNS.items():
            self.columns[name] = np.concatenate([self.columns[name], np.array([values[name]], dtype)])
        self._publish()
        self.history.add_fire()
        return len(self.columns["radius"]) - 1

    def remove(self, index: int) -> None:
        """Drop a fire; the handles of the others get their new indices."""
        del self.agents[index]
        self.history.remove_fire(index)
        for row, fire in enumerate(self.agents):
            fire.row = row
        self.columns = {name: np.delete(column, index, axis=0) for name, column in self.columns.items()}
        self._publish()

    def _publish(self) -> None:
        for name, column in self.columns.items():
            view = column.view()
            view.flags.writeable = False
            setattr(self, name, view)


class Fire(Body):
    """One fire: a body that is a handle on a row of `Fires`. Created by `SwarmModel.add_fire`."""

    fires: Fires
    row: int
    _made_by: ClassVar[str] = "model.add_fire((x, y), area=1.0)"

    def __init__(self, space: Arena, model: Model, fires: Fires, row: int) -> None:
        self.fires = fires
        self.row = row
        super().__init__(space, model, KINDS[FIRE])

    def __repr__(self) -> str:
        if self.row < 0:
            return f"<Fire {self.unique_id}, removed>"
        x, y = (round(float(number), 2) for number in self.position)
        state = "out" if self.out else f"temperature {self.temperature:.3g}"
        return f"<Fire {self.unique_id} at ({x}, {y}), {state}>"

    @property
    def position(self) -> NDArray[np.float64]:
        """Centre, shape (2,)."""
        return read_only(self._read("position").copy())

    @position.setter
    def position(self, value: Coordinates) -> None:
        raise InvalidValueError("fires do not move; remove this one and add another")

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """Its body, a disc."""
        return disc(self.position, self.radius)

    @property
    def radius(self) -> float:
        """Radius of its body, map units."""
        return float(self._read("radius"))

    @property
    def area(self) -> float:
        """Its size: each robot lowers its temperature by k2 / area a step."""
        return float(self._read("area"))

    @property  # type: ignore[override]
    def temperature(self) -> float:
        """Its temperature in [0, 1]; 0 once it is out."""
        return float(self._read("temperature"))

    @temperature.setter
    def temperature(self, value: float) -> None:
        checked = check_number("temperature", value, above=0, maximum=1)
        if self.out:
            raise InvalidValueError("this fire is out; use light(), or add another")
        self.fires.columns["temperature"][self.row] = checked
        self.model.parts["bodies"].changed()  # sensors that were read already are read again

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
        row, columns, step = self._alive(), self.fires.columns, self.model.steps
        for name, value in (("temperature", 0.0), ("out", True), ("out_step", step), ("robots", 0)):
            columns[name][row] = value
        self.model.parts["fires"].release_robots(row)

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
        row, columns = self._alive(), self.fires.columns
        temperature = check_number("temperature", temperature, above=0, maximum=1)
        for name, value in (("temperature", temperature), ("out", False), ("out_step", NEVER)):
            columns[name][row] = value
        self.model.parts["bodies"].changed()  # sensors that were read already are read again

    def remove(self) -> None:
        """Take the fire out of the world, between two steps."""
        row, model = self._alive(), self.model
        model.parts["bodies"].leave(self)
        ArenaAgent.remove(self)
        self.fires.remove(row)
        self.row = -1
        model.parts["fires"].release_robots(row)

    def _alive(self) -> int:
        if self.row < 0:
            raise RemovedRobotError("this fire has been removed; take one from model.fires")
        return self.row

    def _read(self, name: str) -> Any:
        return self.fires.columns[name][self._alive()]


class History:
    """Temperature of every fire, and robots at it, after some steps."""

    def __init__(self, every: int | Trigger) -> None:
        self.trigger = Trigger.of(every, "history_every")
        self._steps: list[int] = []
        self._rows: list[np.ndarray] = []
        # The column of each fire that is there now: columns stay when fires are removed.
        self._places: list[int] = []
        self._fires = 0

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

    def add_fire(self) -> None:
        """Make room for one more fire: a column of its own."""
        self._places.append(self._fires)
        self._fires += 1

    def remove_fire(self, index: int) -> None:
        """End the column of a removed fire: its past stays, and it continues as nan and -1."""
        del self._places[index]

    def append(self, step: int, temperature: np.ndarray, robots: np.ndarray, out: np.ndarray) -> None:
        """Store one row; a fire that is out counts -1 robots."""
        self._steps.append(step)
        row = np.array([np.full(self._fires, np.nan), np.full(self._fires, -1.0)])
        row[:, self._places] = temperature, np.where(out, -1, robots)
        self._rows.append(row)

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

    def _table(self, which: int) -> np.ndarray:
        width = max((row.shape[1] for row in self._rows), default=0)
        table = np.full((len(self._rows), width), np.nan if which == 0 else -1.0)
        for k, row in enumerate(self._rows):
            table[k, : row.shape[1]] = row[which]
        return table
