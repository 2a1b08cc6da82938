"""The part `events`: what happened in a run, by name, as arrays that grow."""

from array import array
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesa_swarm.base.errors import InvalidValueError, check_name, check_number, shortened
from mesa_swarm.kernels.event_rows import COUNT, EventBuffer, key_of_name, mix_event
from mesa_swarm.kernels.measuring import ONLY
from mesa_swarm.kernels.part import Part
from mesa_swarm.robots.robot import Robot
from mesa_swarm.world.read_only import read_only

# Stands for the robot of an event that no robot is part of.
WITHOUT_ROBOT = -1
# Series of an event log, with their types: a name is the index of one of `names`.
SERIES = {"step": "q", "code": "q", "unique_id": "q", "value": "d"}


class EventLog:
    """The events of a model, or of a recording, oldest first; add one with `SwarmModel.event`.

    Attributes
    ----------
    names : list of str
        In the order in which they first occurred.
    digest : uint64 ndarray, shape (2,)
        How many events happened, those that compiled functions have reported since among them, and 64 bits that depend
        on all of them in their order: what the fingerprint of a model is of.

    Examples
    --------
    >>> log = EventLog()
    >>> log.append(3, "delivered", 7, 2.0)
    >>> log.append(3, "lost", -1, 1.0)
    >>> log.step, log.name, log.unique_id, log.value
    (array([3, 3]), array(['delivered', 'lost'], dtype='<U9'), array([ 7, -1]), array([2., 1.]))
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.digest = np.zeros(2, np.uint64)
        self._codes: dict[str, int] = {}
        self._counts: list[int] = []
        self._totals: list[float] = []
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
        return read_only(np.array(self.names or [""])[self._series["code"]])

    @property
    def unique_id(self) -> NDArray[np.int64]:
        """The robot of each, shape (k,), -1 without one."""
        return self._column("unique_id")

    @property
    def value(self) -> NDArray[np.float64]:
        """How much each is, shape (k,)."""
        return self._column("value")

    def _column(self, name: str) -> np.ndarray:
        return read_only(np.array(self._series[name], np.float64 if SERIES[name] == "d" else np.int64))

    @property
    def counts(self) -> dict[str, int]:
        """How many events there are of each name, in the order in which names first occurred."""
        return dict(zip(self.names, self._counts, strict=True))

    def count(self, name: str) -> int:
        """Return how many events have this name, 0 for an unknown one."""
        return self._counts[self._codes[name]] if name in self._codes else 0

    def total(self, name: str) -> float:
        """Return the sum of the values of events of this name."""
        return self._totals[self._codes[name]] if name in self._codes else 0.0

    def append(self, step: int, name: str, unique_id: int, value: float, is_mixed: bool = False) -> None:
        """Add an event, to the digest as well if that has not got it yet."""
        value = check_number("value of an event", value)
        if not isinstance(name, str) or name not in self._codes:
            self._codes[check_name("name of an event", name)] = len(self.names)
            self.names.append(name)
            self._counts.append(0)
            self._totals.append(0.0)
        self._counts[self._codes[name]] += 1
        self._totals[self._codes[name]] += value
        for series, number in zip(self._series.values(), (step, self._codes[name], unique_id, value), strict=True):
            series.append(number)
        if not is_mixed:
            mix_event(self.digest, step, key_of_name(name), unique_id, value)

    def arrays(self) -> dict[str, Any]:
        """Return the names and all series, which together are the state of a log."""
        return {"names": list(self.names), **{name: self._column(name) for name in SERIES}}

    def rows(self, first: int = 0, end: int | None = None) -> list[tuple[int, str, int, float]]:
        """Return events as step, name, unique_id and value, from the first one to that before the end."""
        steps, codes, ids, values = (series[first:end] for series in self._series.values())
        return list(zip(steps, [self.names[code] for code in codes], ids, values, strict=True))

    def series(self) -> dict[str, Any]:
        """Return the names and all series as they are: sequences that grow."""
        return {"names": self.names, **self._series}

    def replace(self, series: dict[str, list]) -> None:
        """Have other events instead, given as `series` returns them, and checked."""
        codes = [int(code) for code in series["code"]]
        names = [str(name) for name in series["names"]]
        if len({len(series[name]) for name in SERIES}) > 1 or not all(0 <= code < len(names) for code in codes):
            raise InvalidValueError("series of events are not of one length, or name what has no name")
        for values in (self.names, self._codes, self._counts, self._totals):
            values.clear()
        for values in self._series.values():
            del values[:]
        self.digest[:] = 0
        for step, code, unique_id, value in zip(*(series[name] for name in SERIES), strict=True):
            self.append(int(step), names[code], int(unique_id), float(value))


class EventsPart(Part):
    """What happened in a run.

    Attributes
    ----------
    log : EventLog
    """

    name = "events"

    def __init__(self, model: Any) -> None:
        self.model = model
        self.log = EventLog()
        self._reported: list[str] = []

    @cached_property
    def buffer(self) -> EventBuffer:
        """Events that compiled functions have reported since, with codes of their own; large, where there are such."""
        return EventBuffer.empty()

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the buffer: its events are added to the log before."""
        self.flush()
        return {name: value for name, value in self.__dict__.items() if name != "buffer"}

    def code_of(self, name: str) -> int:
        """Return the code of events of a name in the buffer."""
        if name not in self._reported:
            self._reported.append(name)
        return self._reported.index(name)

    @property
    def reported(self) -> list[str]:
        """The names of the events in the buffer, by their codes."""
        return self._reported

    def flush(self) -> None:
        """Add to the log what compiled functions have reported."""
        if not self._reported:
            return
        buffer = self.buffer
        count, buffer.filled[ONLY] = int(buffer.filled[ONLY]), 0
        columns = (buffer.step, buffer.code, buffer.unique_id, buffer.value)
        for step, code, unique_id, value in zip(*(column[:count].tolist() for column in columns), strict=True):
            self.log.append(step, self._reported[code], unique_id, value, is_mixed=True)

    def parameters(self) -> dict[str, Any]:
        """Return the digest of the log, where there are events or may be."""
        reports = any(getattr(process, "events", ()) for process in self.model.processes)
        return {"digest": self.log.digest} if reports or self.log.digest[COUNT] else {}

    def mark(self) -> dict[str, Any]:
        """Return how many events there are."""
        return {"events": len(self.log)}

    def store(self) -> dict[str, Any]:
        """Return nothing: events are collected data, of which only new ones are stored."""
        return {}

    def event(self, name: str, *, robot: Robot | None = None, value: float = 1.0) -> None:
        """Note that something happened in this step: it is counted, hashed, stored, recorded, and shown in replays.

        Parameters
        ----------
        name : str
            One line of text, the same for events of one kind.
        robot : Robot, optional
            To which, or by which, it happened.
        value : float
            How much, any finite number.

        Raises
        ------
        InvalidValueError
            If a value is not permitted, or the robot is of another model.
        RemovedRobotError
            If the robot was removed.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(AGENT9, 1)
        >>> model.event("delivered", robot=robot, value=2.0)
        >>> model.event("delivered")
        >>> len(model.events), model.events.value, model.events.count("delivered")
        (2, array([2., 1.]), 2)
        """
        unique_id = WITHOUT_ROBOT
        if robot is not None:
            if not isinstance(robot, Robot) or robot.model is not self.model:
                raise InvalidValueError(f"robot is {shortened(robot)}; expected one of this model's robots, or None")
            robot.alive()
            unique_id = robot.unique_id
        self.flush()  # in their order
        self.log.append(self.model.steps, name, unique_id, value)
