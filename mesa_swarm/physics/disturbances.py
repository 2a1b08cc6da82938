"""Imperfect robots: disturbed readings and wheel speeds, batteries, break-downs."""

import math
from typing import NamedTuple
from zlib import crc32

import numpy as np

from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import mix_number, number_of_bits
from mesa_swarm.kernels.elementary import cos, exp, log
from mesa_swarm.kernels.part import Kernel, Prepared
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import (
    CodeRows,
    FlagRows,
    Flags,
    Integers,
    IntegerTables,
    RealRows,
    Reals,
)
from mesa_swarm.robots.design import RANGE, places_of_custom_sensors
from mesa_swarm.robots.drive import limit_length
from mesa_swarm.robots.imperfections import Imperfections, is_ideal
from mesa_swarm.robots.sensors import BUILT_IN
from mesa_swarm.robots.swarm import FAILED_SENSORS, FAILED_WHEELS, LAST_READ, LASTING, Swarm
from mesa_swarm.world.statics import OBSTACLE

# Purposes of random numbers: independent draws.
FATE, PLACE, PHASE, LENGTH, SLIP, FAIL = range(6)
# Channels: proximity sensors from 0, radiation sensors from here, then wheels, the robot as a whole, line sensors, and
# sensors of all kinds in the order of the design.
RADIATION, WHEEL, BODY, LINE, SENSOR = 1_000, 2_000, 3_000, 4_000, 5_000
STUCK, FREE = 1, 2
# Error, dropout, outliers, hold, period, lag, see `Imperfection`.
Limits = tuple[float, float, float, int, int, float]
# Those of custom sensors follow from their names, so that adding one does not change another.
CUSTOM, CUSTOM_BITS = 1_000_000, 20
NOTHING = -1.0
# State of each robot: the last fresh readings and commands, wheel speeds as they are, charge used, broken.
KEPT: dict[str, tuple[tuple, type, float]] = {
    "distance": (("proximity",), np.float64, NOTHING),
    "kind": (("proximity",), np.int8, -1),
    "radiation": (("radiation",), np.float64, 0.0),
    "line": (("line",), np.bool_, False),
    "wheels": (("wheels",), np.float64, 0.0),
    "told": (("wheels",), np.float64, 0.0),  # the last fresh command; recordings have this name
    "used": ((), np.float64, 0.0),
    "broken": ((), np.bool_, False),
}


# What built-in sensors read, and the kinds of these, the places in `BUILT_IN`.
OF_SENSORS = ("distance", "kind", "radiation", "line")
OF_PROXIMITY, OF_RADIATION, OF_LINE = range(3)


class ReadingArrays(NamedTuple):
    """What `spoil_all_readings` takes.

    Columns and the key; whether readings are disturbed, and the limits; readings, the last fresh ones, and the largest
    of each sensor of a design, negative for none; scratch. Then whether sensors fail, which have failed, how many each
    design has, of which kinds and in which columns they are, and the probability of a failure.
    """

    design: Integers
    number: Integers
    key: int
    disturbs: bool
    limits: Limits
    distance: RealRows
    kind: CodeRows
    radiation: RealRows
    line: FlagRows
    last_distance: RealRows
    last_kind: CodeRows
    last_radiation: RealRows
    last_line: FlagRows
    farthest: RealRows
    hottest: RealRows
    brightest: RealRows
    no_kind_of_heat: CodeRows
    no_kind_of_line: CodeRows
    bright: RealRows
    last_bright: RealRows
    fails: bool
    failed: FlagRows
    sensors: Integers
    places: IntegerTables
    failure: float


class CustomArrays(NamedTuple):
    """What `spoil_column` takes: arguments of `spoil_any` for a column, whether sensors fail, and where they write."""

    design: Integers
    number: Integers
    key: int
    disturbs: bool
    limits: Limits
    channel: int
    reading: RealRows
    last: RealRows
    least: RealRows
    largest: RealRows
    fails: bool
    failed: FlagRows
    places: IntegerTables


class DrivingArrays(NamedTuple):
    """What `drive_imperfectly` takes: arguments of `spoil_wheels` and `fail_wheels`; whether wheels may fail."""

    command: RealRows
    driven: RealRows
    told: RealRows
    wheels: RealRows
    used: Reals
    broken: Flags
    max_speed: Reals
    design: Integers
    sideways: Flags
    numbers: Integers
    number: Integers
    charge: Reals
    limits: Limits
    wear: tuple[float, float, float]
    fails: bool
    failed: CodeRows
    failure: float
    key: int


class Imperfect:
    """Imperfections applied to a swarm, which gets columns for readings that are not fresh and for wear.

    Random numbers are functions of the key, the robot's number, the channel and the step: reading twice gives the
    same, and a robot's imperfections do not depend on the other robots.
    """

    def __init__(self, imperfections: Imperfections, swarm: Swarm, key: int) -> None:
        self.imperfections, self.key = imperfections, key
        for name, column in KEPT.items():
            swarm.remember(f"{LASTING}{name}", *column)
        self._of_readings, self._of_wheels, self._of_custom = Prepared(), Prepared(), Prepared()
        self._disturbs_readings = not is_ideal(imperfections.sensing)
        if imperfections.sensor_failure > 0 or imperfections.wheel_failure > 0:
            swarm.add_failures()
        wears_or_slips = imperfections.battery > 0 or imperfections.failure > 0 or imperfections.slip_probability > 0
        self._disturbs_driving = wears_or_slips or not is_ideal(imperfections.driving)

    def spoil_readings(self, swarm: Swarm, step: int) -> None:
        """Disturb the readings of all built-in sensors in this step, counted from 0."""
        self.reading_kernel(swarm).run(step + 1, len(swarm))

    def reading_kernel(self, swarm: Swarm) -> Kernel:
        """Return what disturbs the readings of built-in sensors, made anew when robots or the key are others."""
        prepared, state = self._of_readings, (swarm.version, self.key)
        if prepared.kernel is None or prepared.state != state:
            block = Block(self._reading_arrays(swarm))
            prepared.state, prepared.kernel = state, Kernel(spoil_all_readings, block.numbers, block)
        return prepared.kernel

    def _reading_arrays(self, swarm: Swarm) -> "ReadingArrays":
        columns, table, fails = swarm.columns, swarm.table, FAILED_SENSORS in swarm.columns
        last = {f"last_{name}": imperfection_column(swarm, name) for name in OF_SENSORS}
        radiation, line = columns["radiation"].shape, columns["line"].shape
        return ReadingArrays(
            design=columns["design"],
            number=columns["number"],
            key=_as_integer(self.key),
            disturbs=self._disturbs_readings,
            limits=self.imperfections.sensing.limits,
            **{name: columns[name] for name in OF_SENSORS},
            **last,
            farthest=np.ascontiguousarray(table.proximity[:, :, RANGE]),
            hottest=np.where(table.radiation[:, :, RANGE] >= 0.0, 1.0, -1.0),
            brightest=np.where(np.isnan(table.line[:, :, 0]), -1.0, 1.0),
            no_kind_of_heat=np.empty(radiation, np.int8),
            no_kind_of_line=np.empty(line, np.int8),
            bright=np.empty(line),
            last_bright=np.empty(line),
            fails=fails,
            failed=columns[FAILED_SENSORS] if fails else np.empty((0, 0), np.bool_),
            sensors=np.array([len(design.sensors) for design in swarm.designs], np.int64),
            places=_places_of_built_in(swarm),
            failure=float(self.imperfections.sensor_failure),
        )

    def spoil_custom(self, swarm: Swarm, step: int) -> None:
        """Disturb what custom sensors read in this step, counted from 0."""
        self.custom_kernel(swarm).run(step + 1, len(swarm))

    def custom_kernel(self, swarm: Swarm) -> Kernel:
        """Return what disturbs the readings of custom sensors, made anew when robots or the key are others."""
        prepared, state = self._of_custom, (swarm.version, self.key)
        if prepared.kernel is None or prepared.state != state:
            blocks = [Block(self._custom_arrays(swarm, name)) for name in swarm.table.readings]
            kernels = [Kernel(spoil_column, block.numbers, block) for block in blocks]
            prepared.state, prepared.kernel = state, sequence_of(kernels)
        return prepared.kernel

    def _custom_arrays(self, swarm: Swarm, name: str) -> "CustomArrays":
        columns, fails = swarm.columns, FAILED_SENSORS in swarm.columns
        least, largest = _limits_of(swarm, name)
        return CustomArrays(
            design=columns["design"],
            number=columns["number"],
            key=_as_integer(self.key),
            disturbs=self._disturbs_readings,
            limits=self.imperfections.sensing.limits,
            channel=CUSTOM + (crc32(name.encode()) << CUSTOM_BITS),
            reading=columns[name],
            last=columns[f"{LAST_READ}{name}"],
            least=least,
            largest=largest,
            fails=fails,
            failed=columns[FAILED_SENSORS] if fails else np.empty((0, 0), np.bool_),
            places=_places_of_custom(swarm, name),
        )

    def driven_wheels(self, swarm: Swarm, step: int) -> np.ndarray:
        """Return the speeds at which motors drive the wheels in a step, counted from 0, (n, w), and wear the robots.

        Where robots' wheels are perfect, that is the column command itself.
        """
        kernel, driven = self.wheel_kernel(swarm)
        if kernel is not None:
            kernel.run(step + 1, len(swarm))
        return driven

    def wheel_kernel(self, swarm: Swarm) -> tuple[Kernel | None, np.ndarray]:
        """Return what writes at which speeds motors drive the wheels, and these, (n, w): commands where it is None."""
        columns, table = swarm.columns, swarm.table
        fails = FAILED_WHEELS in columns
        if not (self._disturbs_driving or fails or table.battery.any()):
            return None, columns["command"]
        prepared, state = self._of_wheels, (swarm.version, self.key)
        if prepared.kernel is None or prepared.state != state:
            arrays = self._wheel_arrays(swarm, fails)
            block = Block(arrays)
            prepared.state, prepared.kernel = state, Kernel(drive_imperfectly, block.numbers, (arrays.driven, block))
        return prepared.kernel, prepared.kernel.kept[0]

    def _wheel_arrays(self, swarm: Swarm, fails: bool) -> "DrivingArrays":
        columns, table, imperfections = swarm.columns, swarm.table, self.imperfections
        slips = float(imperfections.slip_probability), float(imperfections.slip_magnitude)
        return DrivingArrays(
            command=columns["command"],
            driven=np.empty_like(columns["command"]),
            **{name: imperfection_column(swarm, name) for name in ("told", "wheels", "used", "broken")},
            max_speed=columns["max_speed"],
            design=columns["design"],
            sideways=table.sideways,
            numbers=table.numbers,
            number=columns["number"],
            charge=np.where(table.battery > 0.0, table.battery, float(imperfections.battery)),
            limits=imperfections.driving.limits,
            wear=(float(imperfections.failure), *slips),
            fails=fails,
            failed=columns[FAILED_WHEELS] if fails else np.empty((0, 0), np.int8),
            failure=float(imperfections.wheel_failure),
            key=_as_integer(self.key),
        )


def _as_integer(key: int) -> int:
    """Return the 64 bits of a key as a block holds them."""
    return int(np.uint64(key).view(np.int64))


def _places_of_built_in(swarm: Swarm) -> np.ndarray:
    """Return of each sensor of a design, (d, s, 2), its kind, see `BUILT_IN`, and its column; -1 for custom ones."""
    places = np.full((len(swarm.designs), max((len(d.sensors) for d in swarm.designs), default=0), 2), -1)
    for d, design in enumerate(swarm.designs):
        counts = [0] * len(BUILT_IN)
        for s, sensor in enumerate(design.sensors):
            for kind in (kind for kind, sensor_class in enumerate(BUILT_IN) if isinstance(sensor, sensor_class)):
                places[d, s] = kind, counts[kind]
                counts[kind] += 1
    return places


def _places_of_custom(swarm: Swarm, name: str) -> np.ndarray:
    """Return where each sensor of a design, (d, s, 2), writes into the column of a name: first and width, or 0."""
    places = np.zeros((len(swarm.designs), max((len(d.sensors) for d in swarm.designs), default=0), 2), np.int64)
    for d, design in enumerate(swarm.designs):
        own = [s for s, sensor in enumerate(design.sensors) if type(sensor) not in BUILT_IN]
        for s, (sensor, first) in zip(own, places_of_custom_sensors(design), strict=True):
            if sensor.name == name:
                places[d, s] = first, int(sensor.width)
    return places


def _limits_of(swarm: Swarm, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits of each place of a custom sensor's column, by design; NaN where readings are not spoiled."""
    least = np.full((len(swarm.designs), swarm.table.readings[name]), np.nan)
    largest = least.copy()
    for d, design in enumerate(swarm.designs):
        for sensor, first in places_of_custom_sensors(design):
            if sensor.name == name and sensor.spoiled:
                place = slice(first, first + int(sensor.width))
                least[d, place], largest[d, place] = sensor.minimum, sensor.maximum
    return least, largest


def imperfection_column(swarm: Swarm, name: str) -> np.ndarray:
    """Return a column of the state of imperfect robots."""
    return swarm.columns[f"{LASTING}{name}"]


@compiled(nogil=True)
def spoil_all_readings(block, step, first, last):
    """Disturb what all built-in sensors read, of all rows, and let those that failed read nothing."""
    r = unpack(block, ReadingArrays)
    design, number, key, moment, limits = r.design, r.number, np.uint64(r.key), step - 1, r.limits
    if r.disturbs:
        by_chance = design, number, moment, key
        spoil(r.distance, r.kind, r.last_distance, r.last_kind, r.farthest, NOTHING, 0, limits, *by_chance)
        # The kinds that only proximity sensors read are neither looked at nor stored for the others.
        heat, no_kind = r.radiation, r.no_kind_of_heat
        spoil(heat, no_kind, r.last_radiation, no_kind, r.hottest, 0.0, RADIATION, limits, *by_chance)
        spoil_lines(r, moment)
    if r.fails:
        break_sensors(r.failed, r.sensors, design, number, r.failure, moment, key)
        blind_sensors(r)
    return 0


@compiled(nogil=True)
def spoil_column(block, step, first, last):
    """Disturb what custom sensors of a name read, of all rows, and let those that failed read nothing."""
    c = unpack(block, CustomArrays)
    design, reading, failed, places = c.design, c.reading, c.failed, c.places
    if c.disturbs:
        by_chance = c.limits, design, c.number, step - 1, np.uint64(c.key)
        spoil_any(reading, c.last, c.least, c.largest, c.channel, *by_chance)
    if c.fails:
        for i in range(failed.shape[0]):
            for s in range(places.shape[1]):
                begin, width = places[design[i], s, 0], places[design[i], s, 1]
                if width > 0 and failed[i, s]:
                    reading[i, begin : begin + width] = math.nan
    return 0


@compiled
def spoil_lines(r, moment):
    """Disturb what line sensors read: yes or no, which has no error: an outlier is either. A mark is dark ground."""
    line, last, bright, last_bright, no_kind = r.line, r.last_line, r.bright, r.last_bright, r.no_kind_of_line
    _, dropout, outliers, hold, period, lag = r.limits
    limits = 0.0, dropout, outliers, hold, period, lag
    for i in range(line.shape[0]):
        for s in range(line.shape[1]):
            bright[i, s], last_bright[i, s] = 1.0 - line[i, s], 1.0 - last[i, s]
    key = np.uint64(r.key)
    spoil(bright, no_kind, last_bright, no_kind, r.brightest, 1.0, LINE, limits, r.design, r.number, moment, key)
    for i in range(line.shape[0]):
        for s in range(line.shape[1]):
            line[i, s], last[i, s] = bright[i, s] < 0.5, last_bright[i, s] < 0.5


@compiled
def blind_sensors(r):
    """Let the built-in sensors that failed (n, s) read nothing."""
    failed, places = r.failed, r.places
    for i in range(failed.shape[0]):
        d = r.design[i]
        for s in range(r.sensors[d]):
            kind, place = places[d, s, 0], places[d, s, 1]
            if not failed[i, s]:
                continue
            if kind == OF_PROXIMITY:
                r.distance[i, place], r.kind[i, place] = NOTHING, -1
            elif kind == OF_RADIATION:
                r.radiation[i, place] = 0.0
            elif kind == OF_LINE:
                r.line[i, place] = False


@compiled(nogil=True)
def drive_imperfectly(block, step, first, last):
    """Write the speeds at which motors drive the wheels, of all rows, and wear the robots."""
    d = unpack(block, DrivingArrays)
    command, driven, moment, key = d.command, d.driven, step - 1, np.uint64(d.key)
    for i in range(command.shape[0]):
        for w in range(command.shape[1]):
            driven[i, w] = command[i, w]
    spoil_wheels(
        driven, d.told, d.wheels, d.used, d.broken, d.max_speed, d.design, d.sideways, d.numbers, d.number, d.charge,
        d.limits, d.wear, moment, key,
    )  # fmt: skip
    if d.fails:
        fail_wheels(driven, d.failed, d.sideways, d.numbers, d.design, d.number, d.failure, moment, key)
    return 0


@compiled
def draw_uniform(key, number, channel, moment, draw):
    """Return a number in [0, 1) that the key, robot, channel, moment and question decide."""
    return number_of_bits(mix_number(mix_number(mix_number(mix_number(key, number), channel), moment), draw))


@compiled
def draw_normal(key, number, channel, moment):
    """Return a number of the standard normal distribution (Box and Muller 1958)."""
    length = math.sqrt(-2.0 * log(1.0 - draw_uniform(key, number, channel, moment, LENGTH)))
    return length * cos(2.0 * math.pi * draw_uniform(key, number, channel, moment, PHASE))


@compiled
def spoil(reading, kind, last, last_kind, largest, nothing, first_channel, limits, design, number, step, key):
    """Disturb readings from 0 to the `largest` of each sensor, and store them for steps without a fresh reading.

    A sensor that sees nothing reads `nothing`; a design has no sensor where `largest` is negative.
    """
    error, dropout, outliers, hold, period, _ = limits
    moment = step // hold
    for i in range(reading.shape[0]):
        for s in range(reading.shape[1]):
            most, channel = largest[design[i], s], first_channel + s
            if most < 0.0:
                continue
            fate = draw_uniform(key, number[i], channel, moment, FATE)
            if step % period != 0:
                reading[i, s], kind[i, s] = last[i, s], last_kind[i, s]
            elif fate < dropout:
                reading[i, s], kind[i, s] = nothing, -1
            elif fate < dropout + outliers:
                reading[i, s], kind[i, s] = most * draw_uniform(key, number[i], channel, moment, PLACE), OBSTACLE
            elif reading[i, s] >= 0.0:
                wrong = reading[i, s] * (1.0 + error * draw_normal(key, number[i], channel, moment))
                reading[i, s] = min(max(wrong, 0.0), most)
            last[i, s], last_kind[i, s] = reading[i, s], kind[i, s]


@compiled
def spoil_any(reading, last, least, largest, first_channel, limits, design, number, step, key):
    """Disturb readings of any range, as `spoil` does; nothing is NaN, and limits of NaN mean to disturb nothing."""
    error, dropout, outliers, hold, period, _ = limits
    moment = step // hold
    for i in range(reading.shape[0]):
        for s in range(reading.shape[1]):
            low, high, channel = least[design[i], s], largest[design[i], s], first_channel + s
            if math.isnan(low):
                continue
            fate = draw_uniform(key, number[i], channel, moment, FATE)
            if step % period != 0:
                reading[i, s] = last[i, s]
            elif fate < dropout:
                reading[i, s] = math.nan
            elif fate < dropout + outliers and math.isfinite(high - low):
                reading[i, s] = low + (high - low) * draw_uniform(key, number[i], channel, moment, PLACE)
            elif not math.isnan(reading[i, s]):
                wrong = reading[i, s] * (1.0 + error * draw_normal(key, number[i], channel, moment))
                reading[i, s] = min(max(wrong, low), high)
            last[i, s] = reading[i, s]


@compiled
def spoil_wheels(
    command, held, wheels, worn, broken, max_speed, design, sideways, numbers, number, charge, limits, wear, step, key
):
    """Replace commands by disturbed wheel speeds; add up the charge used, and break robots down."""
    error, dropout, outliers, hold, period, lag = limits
    failure, slip_probability, slip_magnitude = wear
    moment, share = step // hold, 1.0 - exp(-1.0 / lag) if lag > 0.0 else 1.0
    for i in range(command.shape[0]):
        if draw_uniform(key, number[i], BODY, step, FATE) < failure:
            broken[i] = True
        battery = charge[design[i]]
        stands = broken[i] or (battery > 0.0 and worn[i] >= battery)
        count = numbers[design[i]]
        for w in range(count):
            if step % period == 0:
                held[i, w] = command[i, w]
            command_now, channel = held[i, w], WHEEL + w
            fate = draw_uniform(key, number[i], channel, moment, FATE)
            if stands or fate < dropout:
                command_now = 0.0
            elif fate < dropout + outliers:
                command_now = max_speed[i] * (2.0 * draw_uniform(key, number[i], channel, moment, PLACE) - 1.0)
            else:
                command_now *= 1.0 + error * draw_normal(key, number[i], channel, moment)
            wheels[i, w] += share * (command_now - wheels[i, w])
            wheels[i, w] = 0.0 if stands else min(max(wheels[i, w], -max_speed[i]), max_speed[i])
        if sideways[design[i]]:
            wheels[i, 0], wheels[i, 1] = limit_length(wheels[i, 0], wheels[i, 1], max_speed[i])
        for w in range(count):
            slips = slip_probability > 0.0 and draw_uniform(key, number[i], WHEEL + w, step, SLIP) < slip_probability
            command[i, w] = wheels[i, w] * (1.0 - slip_magnitude) if slips else wheels[i, w]
            if max_speed[i] > 0.0:
                worn[i] += (1.0 / count) * abs(wheels[i, w]) / max_speed[i]


@compiled
def break_sensors(failed, counts, design, number, rate, step, key):
    """Let sensors (n, s) fail by chance; `counts` has how many each design has."""
    if rate <= 0.0:
        return
    for i in range(failed.shape[0]):
        for s in range(counts[design[i]]):
            if draw_uniform(key, number[i], SENSOR + s, step, FAIL) < rate:
                failed[i, s] = True


@compiled
def fail_wheels(command, failed, sideways, numbers, design, number, rate, step, key):
    """Let wheels (n, w) get stuck by chance, and command those that failed: stuck ones stand, free ones follow.

    A free wheel rolls at the mean speed of those that are driven. Bodies that go sideways have no wheels.
    """
    for i in range(command.shape[0]):
        if sideways[design[i]]:
            continue
        total, driven = 0.0, 0
        for w in range(numbers[design[i]]):
            if rate > 0.0 and draw_uniform(key, number[i], WHEEL + w, step, FAIL) < rate and failed[i, w] == 0:
                failed[i, w] = STUCK
            if failed[i, w] == STUCK:
                command[i, w] = 0.0
            if failed[i, w] != FREE:
                total, driven = total + command[i, w], driven + 1
        for w in range(numbers[design[i]]):
            if failed[i, w] == FREE:
                command[i, w] = total / driven if driven else 0.0
