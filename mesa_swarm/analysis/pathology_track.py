"""Robots' behaviour in consecutive steps, and stretches of steps with a property."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.analysis.arrays import check_array, check_steps, check_whole
from mesa_swarm.errors import InvalidValueError

OBSTACLE, ROBOT, FIRE, LOAD = 0, 1, 2, 3
# A command below this share of max_speed is rounding.
NOTHING = 1e-9


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Track:
    """The recorded arrays, checked; see `pathology.find_pathologies`."""

    steps: np.ndarray
    position: np.ndarray
    heading: np.ndarray
    command: np.ndarray
    layer: np.ndarray
    distance: np.ndarray
    kind: np.ndarray
    radius: np.ndarray
    max_speed: np.ndarray
    forward: np.ndarray

    @classmethod
    def of(
        cls,
        *,
        steps: ArrayLike,
        position: ArrayLike,
        heading: ArrayLike,
        command: ArrayLike,
        layer: ArrayLike,
        distance: ArrayLike,
        kind: ArrayLike,
        radius: ArrayLike,
        max_speed: ArrayLike,
        forward: ArrayLike,
    ) -> "Track":
        """Check the arrays and return them as a track."""
        steps = check_steps(steps)
        if (np.diff(steps) != 1).any():
            raise InvalidValueError("steps are not consecutive; expected every step: watch with every=1")
        k = len(steps)
        radius = check_array("radius", radius, ("n",))
        n = len(radius)
        distance = check_array("distance", distance, (k, n, "s"))
        sensors = distance.shape[2]
        forward = check_whole("forward", forward, (n, 3))
        if ((forward < -1) | (forward >= sensors)).any():
            raise InvalidValueError(f"forward has an invalid sensor; expected -1 to {sensors - 1}")
        return cls(
            steps=steps,
            position=check_array("position", position, (k, n, 2)),
            heading=check_array("heading", heading, (k, n)),
            command=check_array("command", command, (k, n, 2)),
            layer=check_whole("layer", layer, (k, n)),
            distance=distance,
            kind=check_whole("kind", kind, (k, n, sensors)),
            radius=radius,
            max_speed=check_array("max_speed", max_speed, (n,)),
            forward=forward,
        )

    @property
    def turn(self) -> np.ndarray:
        """Side to which each robot turns in each step (k, n): 1 left, -1 right, 0 neither."""
        return self._sign(self.command[..., 1] - self.command[..., 0])

    @property
    def travel(self) -> np.ndarray:
        """Whether each robot is commanded forwards (1), backwards (-1) or neither (0) in each step (k, n)."""
        return self._sign(self.command.sum(axis=2))

    def reads(self, kinds: tuple[int, ...], near: float, which: int) -> np.ndarray:
        """Return the steps (k, n) in which the front (0), left (1) or right (2) sensor reads such a near body."""
        k, n, sensors = self.kind.shape
        if not sensors:
            return np.zeros((k, n), bool)
        index, rows = self.forward[:, which], np.arange(n)
        kind, distance = self.kind[:, rows, index], self.distance[:, rows, index]
        return np.isin(kind, kinds) & (distance >= 0) & (distance < near) & (index >= 0)

    def _sign(self, speed: np.ndarray) -> np.ndarray:
        return np.sign(np.where(np.abs(speed) > NOTHING * self.max_speed, speed, 0.0))


def last_before(sign: np.ndarray) -> np.ndarray:
    """Return for each step (k, n) the last one before it in which the sign was not 0, or -1."""
    last = np.where(sign != 0, np.arange(len(sign))[:, None], -1)
    last = np.maximum.accumulate(last, axis=0)
    return np.concatenate([np.full((1, sign.shape[1]), -1), last[:-1]])[: len(sign)]


def flips_of(sign: np.ndarray) -> np.ndarray:
    """Return the steps (k, n) in which the sign is the opposite of the last one that was not 0."""
    before = last_before(sign)
    return (before >= 0) & (sign * at(sign, before) < 0)


def at(values: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return each robot's value in another step (k, n), which may be -1: an arbitrary value then."""
    return values[frame, np.arange(frame.shape[1])] if len(values) else values


def covered(shape: tuple[int, int], row: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return a mask (k, n) of the steps `first` to `last`, inclusive, of these rows."""
    change = np.zeros((shape[0] + 1, shape[1]), np.int64)
    np.add.at(change, (first, row), 1)
    np.add.at(change, (last + 1, row), -1)
    return change.cumsum(axis=0)[:-1] > 0


def runs(mask: np.ndarray) -> list[tuple[int, int, int]]:
    """Return (row, first, last) of every run of true values along the first axis."""
    edge = np.diff(mask.astype(np.int8), axis=0, prepend=0, append=0).T
    row, first = np.nonzero(edge > 0)
    _, end = np.nonzero(edge < 0)
    return [(int(i), int(a), int(b) - 1) for i, a, b in zip(row, first, end, strict=True)]


def lasting(mask: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Return first step and row of every stretch of `length` steps in a row, without step 0.

    Step 0 is left out as the positions before it are unknown.
    """
    if len(mask) <= length:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    total = np.concatenate([np.zeros((1, mask.shape[1]), np.int64), mask.cumsum(axis=0)])
    first, row = np.nonzero(total[length + 1 :] - total[1:-length] == length)
    return first + 1, row
