"""Events: what happened in a run, by name, as arrays that grow."""

from array import array
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesa_swarm.errors import check_name, check_number

# Stands for the robot of an event that no robot is part of.
WITHOUT_ROBOT = -1
# Series of an event log, with their types: a name is the index of one of `names`.
SERIES = {"step": "q", "code": "q", "unique_id": "q", "value": "d"}


class EventLog:
    """The events of a model, or of a recording, oldest first; add one with `SwarmModel.event`.

    Examples
    --------
    >>> log = EventLog()
    >>> log.append(3, "delivered", 7, 2.0)
    >>> log.append(3, "lost", -1, 1.0)
    >>> log.step, log.name, log.unique_id, log.value
    (array([3, 3]), array(['delivered', 'lost'], dtype='<U9'), array([ 7, -1]), array([2., 1.]))
    """

    def __init__(self) -> None:
        self.names: list[str] = []  # in the order in which they first occurred
        self._codes: dict[str, int] = {}
        self._series: dict[str, Any] = {name: array(kind) for name, kind in SERIES.items()}

    def __len__(self) -> int:
        return len(self._series["step"])

    def __repr__(self) -> str:
        return f"<EventLog of {len(self)} events{': ' if self.names else ''}{', '.join(self.names)}>"

    @property
    def step(self) -> NDArray[np.int64]:
        """The step in which each happened, shape (k,): as Mesa counts, so 0 before the first one."""
        return self._column("step")

    @property
    def name(self) -> NDArray[np.str_]:
        """The name of each, shape (k,)."""
        return np.array(self.names or [""])[self._series["code"]]

    @property
    def unique_id(self) -> NDArray[np.int64]:
        """The robot of each, shape (k,), -1 without one."""
        return self._column("unique_id")

    @property
    def value(self) -> NDArray[np.float64]:
        """How much each is, shape (k,)."""
        return self._column("value")

    def _column(self, name: str) -> np.ndarray:
        return np.array(self._series[name], np.float64 if SERIES[name] == "d" else np.int64)

    def count(self, name: str) -> int:
        """Return how many events have this name."""
        return self._series["code"].count(self._codes.get(name, -1))

    def total(self, name: str) -> float:
        """Return the sum of the values of events of this name."""
        return float(self.value[self.name == name].sum()) if name in self._codes else 0.0

    def append(self, step: int, name: str, unique_id: int, value: float) -> None:
        """Add an event."""
        value = check_number("value of an event", value)
        if not isinstance(name, str) or name not in self._codes:
            self._codes[check_name("name of an event", name)] = len(self.names)
            self.names.append(name)
        for series, number in zip(self._series.values(), (step, self._codes[name], unique_id, value), strict=True):
            series.append(number)

    def arrays(self) -> dict[str, Any]:
        """Return the names and all series, which together are the state of a log."""
        return {"names": list(self.names), **{name: self._column(name) for name in SERIES}}

    def since(self, first: int) -> list[tuple[int, str, int, float]]:
        """Return the events from this one on, as step, name, unique_id and value."""
        return self._rows(slice(first, None))

    def _rows(self, which: slice) -> list[tuple[int, str, int, float]]:
        steps, codes, ids, values = (series[which] for series in self._series.values())
        return list(zip(steps, [self.names[code] for code in codes], ids, values, strict=True))

    def replace(self, rows: Iterable[tuple[int, str, int, float]]) -> None:
        """Have these events instead, checked."""
        self.__init__()  # type: ignore[misc]
        for step, name, unique_id, value in rows:
            self.append(int(step), str(name), int(unique_id), float(value))
