"""Snapshots: columns of the swarm over the last steps, as arrays."""

from collections import deque
from collections.abc import Iterable

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, check_count, shortened, unknown_name
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.robots.swarm import Swarm

# What explaining a decision needs, and what happened next.
DECISIONS = (
    "position",
    "heading",
    "command",
    "layer",
    "distance",
    "kind",
    "collided",
    "temperature",
    "heat",
    "hot",
    "fire",
    "heard_from",
    "heard_goal",
)
# What processes overwrite after robots have decided on it.
HEAT = ("temperature", "heat", "hot", "fire")


class Snapshots:
    """Columns of a swarm as they were after each of the last steps; made by `SwarmModel.watch`.

    ``snapshots["position"]`` is an array of shape (k, n, 2): one row a stored step, oldest first. The
    readings, the heat (`temperature`, `heat`, `hot`, `fire`), the command and the layer in a row are what robots
    knew and did in that step, the position is where they were after it. When robots are added or removed, or are given
    another control, earlier steps are dropped: rows would no longer be the same robots, nor the same layers.
    """

    def __init__(
        self, swarm: Swarm, *, last: int | None = None, every: int | Trigger = 1, columns: tuple[str, ...] = DECISIONS
    ) -> None:
        self._swarm = swarm
        if isinstance(columns, str) or not all(isinstance(name, str) for name in columns):
            raise InvalidValueError(f"columns is {shortened(columns)}; expected names such as ('position', 'layer')")
        self.columns = tuple(columns)
        for name in self.columns:
            if name not in swarm.columns:
                raise UnknownNameError(unknown_name("column", name, swarm.columns))
        # Columns of a control's memory, stored besides while they exist.
        self.noted: tuple[str, ...] = ()
        self.trigger = Trigger.of(every, minimum=1)
        self._stored: deque = deque(maxlen=None if last is None else check_count("last", last, minimum=1))
        self._numbers = swarm.number
        self._version = swarm.version
        self._heat_before: dict[str, np.ndarray] = {}

    def __len__(self) -> int:
        """How many steps are stored."""
        return len(self._rows)

    @property
    def every(self) -> int:
        """Steps from one to the next."""
        return self.trigger.every

    def note(self) -> None:
        """Store the heat that robots decided on, before a process overwrites it."""
        self._heat_before = {name: self._swarm.columns[name].copy() for name in HEAT if name in self.columns}

    def forget(self) -> None:
        """Drop all steps."""
        self._stored.clear()

    def append(self, step: int) -> None:
        """Store the swarm as it is now."""
        now, before = self._swarm.columns, self._heat_before
        names = dict.fromkeys((*self.columns, *self.noted))
        self._rows.append((step, {name: before[name] if name in before else now[name].copy() for name in names}))
        self._heat_before = {}

    @property
    def steps(self) -> np.ndarray:
        """The stored steps, oldest first, shape (k,)."""
        return np.array([step for step, _ in self._rows], np.int64)

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column at all stored steps, shape (k, n, ...)."""
        if name not in self.columns:
            raise UnknownNameError(unknown_name("watched column", name, self.columns))
        if not self._rows:
            return np.empty((0, *self._swarm.columns[name].shape), self._swarm.columns[name].dtype)
        return np.stack([columns[name] for _, columns in self._rows])

    def at(self, step: int) -> dict[str, np.ndarray]:
        """Return all stored columns after one step, by name.

        Raises
        ------
        InvalidValueError
            If that step is not stored.
        """
        for stored, columns in reversed(self._rows):
            if stored == step:
                return dict(columns)
        steps = self.steps
        choice = f"stored are {len(steps)} from {steps[0]} to {steps[-1]}" if len(steps) else "none are stored yet"
        raise InvalidValueError(f"step {shortened(step)} is not stored; {choice}; store more with watch(last=...)")

    @property
    def _rows(self) -> deque:
        """The stored steps of the present robots."""
        swarm = self._swarm
        if self._version != swarm.version:
            if not np.array_equal(self._numbers, swarm.number):
                self.forget()
            self._version, self._numbers = swarm.version, swarm.number
        return self._stored


def check_watched(
    snapshots: Snapshots | None, columns: Iterable[str], purpose: str, call: str = "watch()"
) -> Snapshots:
    """Return snapshots that suffice for a purpose; others are refused, with the call that is missing."""
    if snapshots is None:
        raise InvalidValueError(f"no steps are stored to {purpose}; call model.{call} before the steps in question")
    missing = [name for name in columns if name not in snapshots.columns]
    if missing:
        names = ", ".join(missing)
        raise InvalidValueError(
            f"columns needed to {purpose} are not stored: {names}; add them to model.watch(columns=...)"
        )
    if not len(snapshots):
        raise InvalidValueError(
            f"no step is stored to {purpose}: none was taken since watch() was called, robots were added or removed, "
            "or the control was changed; run the model on"
        )
    return snapshots
