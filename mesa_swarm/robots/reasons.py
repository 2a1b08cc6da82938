"""Why a robot did what it did: the layer that won, in words, with the sensors that triggered it."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.robots.design import AXIS_X, AXIS_Y, MOUNT_X, MOUNT_Y
from mesa_swarm.world.statics import KINDS

# Speeds below this are rounding.
TINY = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What one robot knew in one step, and its command.

    Parameters
    ----------
    distance, kind : ndarrays, shape (s,)
    sensors : ndarray, shape (s, 9)
        Of its design, see `DesignTable`.
    bearing : ndarray, shape (s,), rad
    forward : (int, int, int)
        Indices of its front, left and right sensor, -1 for none.
    command : ndarray, shape (numbers,)
        In this step.
    turns : bool
        Whether the command is wheel speeds left and right; else it is speeds forward and sideways.
    columns : dict
        Its other stored columns, by name: heat, hot, fire, ...
    moved : (float, float, float) or None
        What the command asks of the body: speeds forward and sideways, and the turn, rad. None where `turns` states it.
    kinds : tuple of str
        The names of what `kind` has the codes of.
    """

    distance: np.ndarray
    kind: np.ndarray
    sensors: np.ndarray
    bearing: np.ndarray
    forward: tuple[int, int, int]
    command: np.ndarray
    turns: bool
    columns: dict
    moved: tuple[float, ...] | None = None
    kinds: tuple[str, ...] = KINDS

    def seeing(self, kind: int, *, ahead: bool = False) -> list[int]:
        """Return the sensors that see such a thing, nearest first; only those within 90 degrees if `ahead`."""
        sensors = [s for s in np.flatnonzero(self.kind == kind) if not ahead or abs(self.bearing[s]) < np.pi / 2 - 1e-9]
        # Of equals the first counts, as in the layers; of those ahead the one that is most nearly so.
        return sorted(map(int, sensors), key=lambda s: (self.distance[s], abs(self.bearing[s]) if ahead else 0.0))

    def nearest(self, kind: int, *, ahead: bool = False) -> list[int]:
        """Return the sensor that sees the nearest such thing, in a list; an empty list if none does."""
        return self.seeing(kind, ahead=ahead)[:1]

    def position_of(self, sensors: list[int]) -> np.ndarray:
        """Return the mean of the positions that these sensors' readings are taken for, in the robot's frame."""
        table = self.sensors[sensors]
        reach = self.distance[sensors]
        x = table[:, MOUNT_X] + reach * table[:, AXIS_X]
        return np.array([x.mean(), (table[:, MOUNT_Y] + reach * table[:, AXIS_Y]).mean()])

    @property
    def motion(self) -> str:
        """Its command in words, such as "turns left on the spot", "goes ahead at 0.7", "stays"."""
        if self.moved is not None:
            return _motion_in_words(*self.moved)
        left, right = self.command
        if abs(left) + abs(right) < TINY:
            return "stays"
        if not self.turns:
            return _motion_in_words(left, right, 0.0)
        if abs(right - left) < TINY:
            return f"{'goes ahead' if left > 0 else 'backs up'} at {abs(left):.2g}"
        how = "on the spot" if abs(left + right) < TINY else "while moving"
        return f"turns {'left' if right > left else 'right'} {how}"

    def name(self, sensor: int) -> str:
        """Return a sensor's name: front, left or right sensor, or its bearing.

        A bearing is written in degrees, positive to the left.
        """
        for side, index in zip(("front", "left", "right"), self.forward, strict=True):
            if index == sensor:
                return f"{side} sensor"
        return f"sensor at {np.degrees(self.bearing[sensor]):+.0f} degrees"

    def reading(self, sensor: int) -> str:
        """Return a sensor's reading in words, such as "left sensor 9.3 (a robot)"."""
        kind = int(self.kind[sensor])
        value = f"{self.distance[sensor]:.1f} ({self._thing(kind)})" if kind >= 0 else "nothing"
        return f"{self.name(sensor)} {value}"

    def _thing(self, kind: int) -> str:
        """Return what has a code in words, such as "an obstacle"."""
        if kind >= len(self.kinds):
            return "another body"
        name = self.kinds[kind]
        return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def _motion_in_words(forward: float, sideways: float, turn: float) -> str:
    """Return the motion of a body that may go in any direction and turn at once."""
    speed, side = np.hypot(forward, sideways), "left" if turn > 0 else "right"
    if speed < TINY:
        return "stays" if abs(turn) < TINY else f"turns {side} on the spot"
    where = f"moves at {speed:.2g} towards {np.degrees(np.arctan2(sideways, forward)):+.0f} degrees"
    return where if abs(turn) < TINY else f"{where} while turning {side}"


@dataclass(frozen=True, slots=True)
class Reason:
    """Why a layer was active.

    Parameters
    ----------
    words : str
        Such as "left sensor 9.3 < 15".
    sensors : tuple of int
        Proximity sensors that triggered the layer.
    """

    words: str
    sensors: tuple[int, ...] = ()
