"""Imperfect robots: disturbed readings and wheel speeds, batteries, break-downs."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.physics.radio import GOLDEN, mixed
from mesa_swarm.robots.design import RANGE
from mesa_swarm.robots.drive import no_longer
from mesa_swarm.robots.imperfections import Imperfections, is_ideal
from mesa_swarm.robots.swarm import LASTING, Swarm
from mesa_swarm.world.statics import OBSTACLE

# Purposes of random numbers: independent draws.
FATE, PLACE, PHASE, LENGTH = range(4)
# Channels: proximity sensors from 0, radiation sensors from here, then wheels, the robot as a whole, line sensors.
RADIATION, WHEEL, BODY, LINE = 1_000, 2_000, 3_000, 4_000
NOTHING = -1.0
# State of each robot: the last fresh readings and commands, wheel speeds as they are, charge used, broken.
KEPT: dict[str, tuple[tuple, type, float]] = {
    "distance": (("proximity",), np.float64, NOTHING),
    "kind": (("proximity",), np.int8, -1),
    "radiation": (("radiation",), np.float64, 0.0),
    "line": (("line",), np.bool_, False),
    "wheels": ((2,), np.float64, 0.0),
    "told": ((2,), np.float64, 0.0),
    "used": ((), np.float64, 0.0),
    "broken": ((), np.bool_, False),
}


class Imperfect:
    """Imperfections applied to a swarm.

    Random numbers are functions of the key, the robot's number, the channel and the step: reading twice gives the
    same, and a robot's imperfections do not depend on the other robots.

    Parameters
    ----------
    imperfections : Imperfections
    swarm : Swarm
        Gets columns for readings that are not fresh and for wear.
    key : int
        Of the random numbers, 0 to 2^64 - 1.
    """

    def __init__(self, imperfections: Imperfections, swarm: Swarm, key: int) -> None:
        self.imperfections, self.key = imperfections, key
        for name, column in KEPT.items():
            swarm.remember(f"{LASTING}{name}", *column)
        self._reads = not is_ideal(imperfections.sensing)
        self._drives = not is_ideal(imperfections.driving) or imperfections.battery > 0 or imperfections.failure > 0

    def spoil_readings(self, swarm: Swarm, step: int) -> None:
        """Disturb the readings of all sensors in this step."""
        if not self._reads:
            return
        columns, table, key = swarm.columns, swarm.table, np.uint64(self.key)
        design, number, limits = columns["design"], columns["number"], self.imperfections.sensing.limits
        spoil_proximity(
            columns["distance"],
            columns["kind"],
            kept(swarm, "distance"),
            kept(swarm, "kind"),
            np.ascontiguousarray(table.proximity[:, :, RANGE]),
            design,
            number,
            limits,
            step,
            key,
        )
        radiation, line = columns["radiation"], columns["line"]
        if radiation.shape[1]:
            there = table.radiation[:, :, RANGE] >= 0.0
            spoil_radiation(radiation, kept(swarm, "radiation"), there, design, number, limits, step, key)
        if line.shape[1]:
            there = ~np.isnan(table.line[:, :, 0])
            spoil_line(line, kept(swarm, "line"), there, design, number, limits, step, key)

    @contextmanager
    def driving(self, swarm: Swarm, step: int) -> Iterator[None]:
        """Replace commands by disturbed wheel speeds within the block; afterwards restore them, and write the slip."""
        if not self._drives:
            yield
            return
        command, slip = swarm.columns["command"], swarm.columns["slip"]
        requested = command.copy()
        given = self.imperfections
        spoil_wheels(
            command,
            kept(swarm, "told"),
            kept(swarm, "wheels"),
            kept(swarm, "used"),
            kept(swarm, "broken"),
            swarm.columns["max_speed"],
            swarm.columns["design"],
            swarm.table.sideways,
            swarm.columns["number"],
            given.driving.limits,
            (float(given.battery), float(given.failure)),
            step,
            np.uint64(self.key),
        )
        try:
            yield
            reached = command * (1.0 - slip)
            slip[:] = np.divide(requested - reached, requested, out=np.zeros_like(requested), where=requested != 0.0)
        finally:
            command[:] = requested


def kept(swarm: Swarm, name: str) -> np.ndarray:
    """Return a column of the state of imperfect robots."""
    return swarm.columns[f"{LASTING}{name}"]


@compiled
def chance(key, number, channel, moment, what):
    """Return a number in [0, 1) that the key, robot, channel, moment and question decide.

    Examples
    --------
    >>> 0 <= chance(np.uint64(1), 2, 3, 4, 0) < 1
    True
    """
    bits = mixed(key + GOLDEN * np.uint64(number))
    bits = mixed(bits + GOLDEN * np.uint64(channel))
    bits = mixed(bits + GOLDEN * np.uint64(moment))
    bits = mixed(bits + GOLDEN * np.uint64(what))
    return (bits >> np.uint64(11)) * 2.0**-53


@compiled
def normal(key, number, channel, moment):
    """Return a number of the standard normal distribution (Box and Muller 1958)."""
    length = math.sqrt(-2.0 * math.log(1.0 - chance(key, number, channel, moment, LENGTH)))
    return length * math.cos(2.0 * math.pi * chance(key, number, channel, moment, PHASE))


@compiled
def spoil_proximity(distance, kind, last_distance, last_kind, ranges, design, number, limits, step, key):
    """Disturb the readings of proximity sensors, and store them for steps without a fresh reading."""
    error, dropout, outliers, hold, period, _ = limits
    moment = step // hold
    for i in range(distance.shape[0]):
        for s in range(distance.shape[1]):
            reach = ranges[design[i], s]
            if step % period != 0:
                distance[i, s], kind[i, s] = last_distance[i, s], last_kind[i, s]
            elif reach >= 0.0:
                fate = chance(key, number[i], s, moment, FATE)
                if fate < dropout:
                    distance[i, s], kind[i, s] = NOTHING, -1
                elif fate < dropout + outliers:
                    distance[i, s] = reach * chance(key, number[i], s, moment, PLACE)
                    kind[i, s] = OBSTACLE
                elif distance[i, s] >= 0.0:
                    wrong = distance[i, s] * (1.0 + error * normal(key, number[i], s, moment))
                    distance[i, s] = min(max(wrong, 0.0), reach)
            last_distance[i, s], last_kind[i, s] = distance[i, s], kind[i, s]


@compiled
def spoil_radiation(radiation, last, there, design, number, limits, step, key):
    """Disturb the readings of radiation sensors, temperatures from 0 to 1."""
    error, dropout, outliers, hold, period, _ = limits
    moment = step // hold
    for i in range(radiation.shape[0]):
        for q in range(radiation.shape[1]):
            if not there[design[i], q]:
                continue
            channel = RADIATION + q
            fate = chance(key, number[i], channel, moment, FATE)
            if step % period != 0:
                radiation[i, q] = last[i, q]
            elif fate < dropout:
                radiation[i, q] = 0.0
            elif fate < dropout + outliers:
                radiation[i, q] = chance(key, number[i], channel, moment, PLACE)
            else:
                wrong = radiation[i, q] * (1.0 + error * normal(key, number[i], channel, moment))
                radiation[i, q] = min(max(wrong, 0.0), 1.0)
            last[i, q] = radiation[i, q]


@compiled
def spoil_line(line, last, there, design, number, limits, step, key):
    """Disturb the readings of line sensors, which are yes or no and so have no error: an outlier is either."""
    _, dropout, outliers, hold, period, _ = limits
    moment = step // hold
    for i in range(line.shape[0]):
        for s in range(line.shape[1]):
            if not there[design[i], s]:
                continue
            channel = LINE + s
            fate = chance(key, number[i], channel, moment, FATE)
            if step % period != 0:
                line[i, s] = last[i, s]
            elif fate < dropout:
                line[i, s] = False
            elif fate < dropout + outliers:
                line[i, s] = chance(key, number[i], channel, moment, PLACE) < 0.5
            last[i, s] = line[i, s]


@compiled
def spoil_wheels(command, held, wheels, used, broken, max_speed, design, sideways, number, limits, wear, step, key):
    """Replace commands by disturbed wheel speeds; add up the charge used, and break robots down."""
    error, dropout, outliers, hold, period, lag = limits
    battery, failure = wear
    moment, share = step // hold, 1.0 - math.exp(-1.0 / lag) if lag > 0.0 else 1.0
    for i in range(command.shape[0]):
        if chance(key, number[i], BODY, step, FATE) < failure:
            broken[i] = True
        stands = broken[i] or (battery > 0.0 and used[i] >= battery)
        for w in range(2):
            if step % period == 0:
                held[i, w] = command[i, w]
            wanted, channel = held[i, w], WHEEL + w
            fate = chance(key, number[i], channel, moment, FATE)
            if stands or fate < dropout:
                wanted = 0.0
            elif fate < dropout + outliers:
                wanted = max_speed[i] * (2.0 * chance(key, number[i], channel, moment, PLACE) - 1.0)
            else:
                wanted *= 1.0 + error * normal(key, number[i], channel, moment)
            wheels[i, w] += share * (wanted - wheels[i, w])
            wheels[i, w] = 0.0 if stands else min(max(wheels[i, w], -max_speed[i]), max_speed[i])
        if sideways[design[i]]:
            wheels[i, 0], wheels[i, 1] = no_longer(wheels[i, 0], wheels[i, 1], max_speed[i])
        for w in range(2):
            command[i, w] = wheels[i, w]
            if max_speed[i] > 0.0:
                used[i] += 0.5 * abs(wheels[i, w]) / max_speed[i]
