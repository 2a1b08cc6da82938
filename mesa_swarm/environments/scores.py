"""Observations and rewards of robots, and measures of their episodes."""

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import Any, NamedTuple, Protocol

import numpy as np
import shapely

from mesa_swarm.analysis.coverage import cells_from_places
from mesa_swarm.base.errors import InvalidValueError, SwarmError, check_choice
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import directions_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import CodeRows, FlagRows, Flags, Integers, RealRows, Reals, SingleRows
from mesa_swarm.learning.actions import ENCODINGS, ranges_of
from mesa_swarm.learning.rewards import REWARDS, rewarded
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.statics import FIRE, OBSTACLE, ROBOT

# The blocks of a typed observation, in their order.
KINDS = (OBSTACLE, ROBOT, FIRE)
BODY, HOME, HEARD = 4, 4, 3
OBSERVED = itemgetter("distance", "kind", "radiation", "line", "temperature", "hot", "heat", "fire")
# What robots broadcast, the sensor of their nest, and that of what they carry.
MESSAGE, NEST, CARRIED = "signal", "nest", "carried"

LARGEST_REWARD = 1e6
# Of the grid on which coverage is counted, and the columns of which a tally is made.
CELLS = (40, 40)
TALLIED = itemgetter("command", "max_speed", "collided", "position")


def cells_in_reach(model: SwarmModel, places: np.ndarray, radius: float | None = None) -> np.ndarray:
    """Return which cells (40, 40) robots can reach from these places (n, 2), as if each were alone.

    The radius is by default that of the smallest robot that there is.
    """
    if radius is None:
        radius = float(model.swarm.radius.min())
    solids = [(body.shape.geometry, body.shape.radius) for body in model.obstacle_list if body.contact]
    solids += [(shapely.Point(x, y), fire_radius) for x, y, fire_radius in model.fires.discs.tolist()]
    return cells_from_places(model.map.bounds, solids, radius, places, CELLS)


class ObservationEncoder:
    """Turns the columns of robots of one design into rows of numbers in [0, 1].

    A row is, in this order:

    - each proximity sensor's distance / range, 1 if nothing is in range;
    - with encoding "typed": for obstacles, then for robots, then for fires, 1 for each sensor that sees one, else 0;
    - each radiation sensor's temperature;
    - for each line sensor, 1 over a ground mark, else 0;
    - with `body`: the robot's own temperature / `leave` (at most 1), and 1 or 0 for: it is too hot, it takes heat,
      it is extinguishing;
    - with `home`: 1 or 0 for: it carries something; the distance of the nest / `home`, at most 1; (1 + cos) / 2 and
      (1 + sin) / 2 of the nest's bearing; 1, 0.5 and 0.5 where it is out of range;
    - with `messages`: of the nearest robot heard, the distance / `message_range`, (1 + cos) / 2 and (1 + sin) / 2 of
      its bearing, and (1 + x) / 2 of each number x that it sent; 1, and otherwise 0.5, where none is heard.

    Parameters
    ----------
    design : RobotDesign
        With at least one proximity sensor of a range above 0.
    encoding : str
        "distance", or "typed": the kinds of things as well.
    body : bool
        Whether the robot's own heat is observed.
    leave : float
        The temperature at which a robot leaves a fire.
    kinds : tuple of int
        Codes of the three kinds of things.
    home : float
        Range of the sensor "nest", which reads range and bearing; 0 for designs without one.
    messages : int
        How many numbers robots broadcast as "signal".
    message_range : float

    Examples
    --------
    >>> from mesa_swarm.robots.design import AGENT9, AGENT_FIRE
    >>> ObservationEncoder(AGENT9, encoding="distance").width
    9
    >>> ObservationEncoder(AGENT_FIRE, encoding="typed", body=True).width
    41
    """

    def __init__(
        self,
        design: RobotDesign,
        *,
        encoding: str,
        body: bool = False,
        leave: float = 1.0,
        kinds: tuple[int, int, int] = KINDS,
        home: float = 0.0,
        messages: int = 0,
        message_range: float = 1.0,
    ) -> None:
        ranges = [float(sensor.range) for sensor in design.proximity]
        if not ranges or min(ranges) <= 0:
            raise InvalidValueError(
                f"design {design.name} has no proximity sensors, or one of range 0; choose one such as AGENT9"
            )
        self._has_types = check_choice("encoding", encoding, ENCODINGS) == "typed"
        self._reach = np.array(ranges)
        self._body = body
        self._leave = leave
        self._kinds = kinds
        self._parts = len(design.radiation), len(design.line)
        self._home, self._messages, self._message_range = home, messages, message_range
        blocks = 1 + len(KINDS) * self._has_types
        self._width_of_senses = blocks * len(ranges) + sum(self._parts) + BODY * body
        self.width = self._width_of_senses + HOME * (home > 0) + (HEARD + messages) * (messages > 0)

    def observe(self, columns: dict[str, np.ndarray], out: np.ndarray, first: int = 0) -> None:
        """Write the observations of the robots from row `first` on, as many as `out` (k, width) has rows."""
        rows = slice(first, first + len(out))
        readings = OBSERVED(columns)
        if first:
            readings = tuple(column[rows] for column in readings)
        write_observations(*readings, *self._about(), out)
        if self._home:
            place = columns[NEST][rows]
            out[:, self._width_of_senses] = columns[CARRIED][rows, 0] >= 0
            _write_place(place[:, 0] / self._home, place[:, 1], out[:, self._width_of_senses + 1 :])
        if self._messages:
            self._write_heard(columns, rows, out[:, self.width - HEARD - self._messages :])

    def _about(self) -> tuple[Any, ...]:
        """Return what `write_observations` takes besides readings."""
        return self._reach, self._has_types, self._kinds, self._parts, self._body, float(self._leave)

    def kernel_for(self, columns: dict[str, np.ndarray], out: np.ndarray) -> Kernel | None:
        """Return what writes the observations of the first robots, where these are of readings and heat only."""
        if self._home or self._messages:
            return None
        readings: tuple[Any, ...] = OBSERVED(columns)
        return make_kernel(observe_robots, ObserveArrays(*readings, *self._about(), out))  # type: ignore[call-arg]

    def _write_heard(self, columns: dict[str, np.ndarray], rows: slice, out: np.ndarray) -> None:
        away = columns["heard.range"][rows, 0] / self._message_range
        _write_place(away, columns["heard.bearing"][rows, 0], out)
        messages = 0.5 + 0.5 * columns[f"heard.{MESSAGE}"][rows].reshape(len(out), -1)
        np.nan_to_num(messages, copy=False, nan=0.5)
        out[:, HEARD : HEARD + self._messages] = messages


def _write_place(away: np.ndarray, bearing: np.ndarray, out: np.ndarray) -> None:
    """Write a distance, at most 1, and the two shares of a bearing; 1, 0.5 and 0.5 for NaN."""
    unknown, (ahead, left) = np.isnan(away), directions_of(bearing)
    out[:, 0] = np.where(unknown, 1.0, np.minimum(away, 1.0))
    out[:, 1] = np.where(unknown, 0.5, 0.5 + 0.5 * ahead)
    out[:, 2] = np.where(unknown, 0.5, 0.5 + 0.5 * left)


class TeamEncoder:
    """Turns the columns of robots of several designs into rows of numbers in [0, 1].

    The first robots are those of the first encoder, and so on. Rows are as wide as the widest; the others end in zeros.

    Parameters
    ----------
    encoders : sequence of (ObservationEncoder, int)
        Each with its number of robots.

    Examples
    --------
    >>> from mesa_swarm.robots.design import AGENT3, AGENT9
    >>> nine, three = (ObservationEncoder(design, encoding="distance") for design in (AGENT9, AGENT3))
    >>> team = TeamEncoder([(nine, 2), (three, 1)])
    >>> team.width, team.widths
    (9, (9, 9, 3))
    """

    def __init__(self, encoders: Sequence[tuple[ObservationEncoder, int]]) -> None:
        self._encoders = tuple(encoders)
        self.widths = tuple(encoder.width for encoder, count in encoders for _ in range(count))
        self.width = max(encoder.width for encoder, _ in encoders)

    def without(self, rows: np.ndarray) -> "TeamEncoder":
        """Return the encoder of the team without the robots of these rows, of the same width."""
        ends = np.cumsum([count for _, count in self._encoders])
        block = np.searchsorted(ends, rows, side="right")
        fewer = np.bincount(block, minlength=len(ends)).tolist()
        pairs = zip(self._encoders, fewer, strict=True)
        return TeamEncoder([(encoder, count - less) for (encoder, count), less in pairs])

    def observe(self, columns: dict[str, np.ndarray], out: np.ndarray) -> None:
        """Write the observations of the first robots, as many as `out` (k, width) has rows."""
        out.fill(0.0)
        first = 0
        for encoder, count in self._encoders:
            rows = out[first : first + count]
            if len(rows):
                inputs = np.empty((len(rows), encoder.width), out.dtype)
                encoder.observe(columns, inputs, first)
                rows[:, : encoder.width] = inputs
            first += count


class ObserveArrays(NamedTuple):
    """What `write_observations` takes."""

    distance: RealRows
    kind: CodeRows
    radiation: RealRows
    line: FlagRows
    temperature: Reals
    hot: Flags
    heat: Reals
    fire: Integers
    reach: Reals
    typed: bool
    kinds: tuple[int, int, int]
    parts: tuple[int, int]
    body: bool
    leave: float
    out: SingleRows


@compiled(nogil=True)
def observe_robots(block, step, first, last):
    """Write observations of readings and heat."""
    o = unpack(block, ObserveArrays)
    write_observations(
        o.distance, o.kind, o.radiation, o.line, o.temperature, o.hot, o.heat, o.fire,
        o.reach, o.typed, o.kinds, o.parts, o.body, o.leave, o.out,
    )  # fmt: skip
    return 0


@compiled
def write_observations(
    distance, kind, radiation, line, temperature, hot, heat, fire, reach, typed, kinds, parts, body, leave, out
):
    """Write the first blocks of the rows that `ObservationEncoder` describes; a robot may lack the last columns."""
    sensors = reach.shape[0]
    for i in range(out.shape[0]):
        for s in range(sensors):
            seen = kind[i, s]
            out[i, s] = 1.0 if distance[i, s] < 0.0 else min(distance[i, s] / reach[s], 1.0)
            if typed:
                out[i, sensors + s] = seen == kinds[0]
                out[i, 2 * sensors + s] = seen == kinds[1]
                out[i, 3 * sensors + s] = seen == kinds[2]
        at = 4 * sensors if typed else sensors
        for q in range(parts[0]):
            out[i, at + q] = radiation[i, q]
        at += parts[0]
        for k in range(parts[1]):
            out[i, at + k] = line[i, k]
        at += parts[1]
        if body:
            out[i, at] = min(temperature[i] / leave, 1.0)
            out[i, at + 1] = hot[i]
            out[i, at + 2] = heat[i] > 0.0
            out[i, at + 3] = fire[i] >= 0


def make_kernel(function: Any, arguments: NamedTuple) -> Kernel:
    """Return the kernel of a function and a block of these arguments."""
    block = Block(arguments)
    return Kernel(function, block.numbers, block)


class Score(Protocol):
    """Rewards for the steps of one world.

    It may also have `measures`, which returns the task's own measures of the episode so far, numbers by name, and
    `remove_robots`, which takes the rows of rewarded robots that were removed from the world: without it none may be.
    By ``kernel_for(out, finished)`` it may return a `Kernel` that writes the rewards (k,) of each step, and in
    `finished` (1,) whether the task is done; or None.
    """

    @property
    def finished(self) -> bool:
        """Whether the task is done."""

    def reward(self, out: np.ndarray) -> None:
        """Write the rewards of the last step for the first robots, as many as `out` (k,) has rows."""


class EpisodeTally:
    """Sums over the steps of an episode for the first `count` robots of a world, and which cells they were in.

    `sums` (count, 2) are of forward speeds as shares of the greatest, and of collisions; `fresh` (count,) is 1 for
    the robots that were first in a cell of 40 x 40 in the last step, else 0. Sums of robots that were removed are kept
    apart with the steps that each has taken.
    """

    def __init__(self, count: int, bounds: tuple[float, float, float, float]) -> None:
        self.steps = 0
        self.sums = np.zeros((count, 2))
        self.fresh = np.zeros(count)
        self.visited = np.zeros(CELLS, np.bool_)
        x_min, y_min, x_max, y_max = map(float, bounds)
        self._bounds = x_min, y_min, x_max, y_max
        self._removed_sums = np.zeros((0, 3))  # their two sums, and their steps

    def add(self, columns: dict[str, np.ndarray]) -> None:
        """Add the last step from the swarm's columns."""
        tally_step(*self._arrays(columns))
        self.steps += 1

    def _arrays(self, columns: dict[str, np.ndarray]) -> "TallyArrays":
        last: tuple[Any, ...] = TALLIED(columns)
        return TallyArrays(*last, self._bounds, self.visited, self.fresh, self.sums)  # type: ignore[call-arg]

    def kernel_for(self, columns: dict[str, np.ndarray]) -> Kernel:
        """Return what `add` does, but for counting the steps."""
        return make_kernel(tally_robots, self._arrays(columns))

    def remove_robots(self, rows: np.ndarray) -> None:
        """Keep the sums of robots, by their rows, that were removed apart: those behind them move up."""
        totals = np.column_stack([self.sums[rows], np.full(len(rows), float(self.steps))])
        self._removed_sums = np.vstack([self._removed_sums, totals])
        self.sums, self.fresh = np.delete(self.sums, rows, axis=0), np.delete(self.fresh, rows)

    @property
    def mean_steps(self) -> float:
        """How many steps robots have taken in the mean: all, but for those that were removed."""
        return float(self._by_robot()[:, 2].mean())

    def _by_robot(self) -> np.ndarray:
        """Return the sums and the steps of all robots, shape (count, 3)."""
        return np.vstack([np.column_stack([self.sums, np.full(len(self.sums), float(self.steps))]), self._removed_sums])

    def measures(self, reachable: np.ndarray) -> dict[str, float]:
        """Return steps, collisions per 1,000 steps of the mean and the worst robot, the mean speed, and the coverage.

        The coverage is of the `reachable` cells (40, 40). Without steps all but steps and coverage are NaN.
        """
        cells = int((self.visited & reachable).sum())
        ahead, collided, steps = self._by_robot().T
        mean_steps = steps.mean() or math.nan
        has_steps = steps > 0  # a robot that was removed before its first step has no rate
        rates = 1000.0 * collided[has_steps] / steps[has_steps]
        return {
            "steps": float(self.steps),
            "collisions": float(1000.0 * collided.mean() / mean_steps),
            "worst robot": float(rates.max()) if len(rates) else math.nan,
            "speed ahead": float(ahead.mean() / mean_steps),
            "coverage": cells / max(int(reachable.sum()), 1),
        }


class DrivingScore:
    """Forward speed as a share of the greatest, less `collision_cost` for a collision; never finished."""

    finished = False

    def __init__(self, model: SwarmModel, *, collision_cost: float) -> None:
        self._model = model
        self._cost = collision_cost

    def remove_robots(self, rows: np.ndarray) -> None:
        """Do nothing: rewards depend on the last step only."""

    def reward(self, out: np.ndarray) -> None:
        """Write the rewards of the last step."""
        reward_driving(*self._arrays(out))

    def _arrays(self, out: np.ndarray) -> "DriveRewardArrays":
        columns = self._model.swarm.columns
        return DriveRewardArrays(columns["command"], columns["max_speed"], columns["collided"], float(self._cost), out)

    def kernel_for(self, out: np.ndarray, finished: np.ndarray) -> Kernel:
        """Return what `reward` does."""
        return make_kernel(reward_drivers, self._arrays(out))


class ThesisScore:
    """Reward (a), (b) or (c) of the thesis for the current readings, see `learning.rewards`; never finished."""

    finished = False

    def __init__(self, model: SwarmModel, *, kind: str, critical: float) -> None:
        self._model = model
        self._rule = REWARDS.index(kind), float(critical)
        self._ranges = ranges_of(model.swarm.table.proximity)

    def remove_robots(self, rows: np.ndarray) -> None:
        """Do nothing: rewards depend on the last step only."""

    def reward(self, out: np.ndarray) -> None:
        """Write the rewards of the last step."""
        reward_nearness(*self._arrays(out))

    def _arrays(self, out: np.ndarray) -> "NearnessArrays":
        columns = self._model.swarm.columns
        readings = columns["distance"], columns["design"], self._ranges
        return NearnessArrays(*readings, columns["command"], columns["max_speed"], *self._rule, out)

    def kernel_for(self, out: np.ndarray, finished: np.ndarray) -> Kernel:
        """Return what `reward` does."""
        return make_kernel(reward_readings, self._arrays(out))


class FindingScore:
    """`arrival` for the first time that a robot is at a fire, less `step_cost` a step; finished when all are found."""

    def __init__(self, model: SwarmModel, count: int, *, arrival: float, step_cost: float) -> None:
        self._model = model
        self._worth = float(arrival), float(step_cost)
        self._end = np.full(1, math.nan)  # the step in which the task was done
        self._fires = ids_of_fires(model)
        self.found = np.zeros((count, len(model.fires)), bool)
        self._found_before = np.zeros(len(model.fires), bool)  # by robots that were removed

    @property
    def finished(self) -> bool:
        """Whether each fire was found by a rewarded robot."""
        return bool(self._any_found().all())

    def _any_found(self) -> np.ndarray:
        """Return which fires were found."""
        return self.found.any(axis=0) | self._found_before

    def remove_robots(self, rows: np.ndarray) -> None:
        """Keep which fires removed robots have found: those behind them move up."""
        self._found_before |= self.found[rows].any(axis=0)
        self.found = np.delete(self.found, rows, axis=0)

    def reward(self, out: np.ndarray) -> None:
        """Write the rewards of the last step."""
        check_fires(self._model, self._fires)
        reward_finding(self._model.swarm.columns["fire"], *self._worth, self.found, out)
        if math.isnan(self._end[0]) and self.finished:
            self._end[0] = self._model.steps

    def kernel_for(self, out: np.ndarray, finished: np.ndarray) -> Kernel | None:
        """Return what `reward` does, as long as there are the same fires."""
        if ids_of_fires(self._model) != self._fires:
            return None
        fire, found = self._model.swarm.columns["fire"], (self.found, self._found_before)
        return make_kernel(reward_finders, FindingArrays(fire, *self._worth, *found, self._end, finished, out))

    def measures(self) -> dict[str, float]:
        """Return the share of fires found, and the steps until all were, NaN before that."""
        return {"fires found": float(self._any_found().mean()), "steps until all found": float(self._end[0])}


class ExtinguishingScore:
    """`put_out` for fighting a fire as it goes out, `work` a step of fighting, less `step_cost` a step."""

    def __init__(self, model: SwarmModel, count: int, *, put_out: float, work: float, step_cost: float) -> None:
        self._model = model
        self._worth = float(put_out), float(work), float(step_cost)
        self._end = np.full(1, math.nan)  # the step in which the task was done
        self._fires = ids_of_fires(model)
        self._fought = np.full(count, -1)

    @property
    def finished(self) -> bool:
        """Whether all fires are out."""
        return bool(self._model.fires.out.all())

    def remove_robots(self, rows: np.ndarray) -> None:
        """Forget what removed robots fought: those behind them move up."""
        self._fought = np.delete(self._fought, rows)

    def kernel_for(self, out: np.ndarray, finished: np.ndarray) -> Kernel | None:
        """Return what `reward` does, as long as there are the same fires."""
        if ids_of_fires(self._model) != self._fires:
            return None
        columns = self._model.swarm.columns["fire"], self._model.fires.columns["out"]
        arrays = ExtinguishingArrays(*columns, *self._worth, self._fought, self._end, finished, out)
        return make_kernel(reward_extinguishers, arrays)

    def reward(self, out: np.ndarray) -> None:
        """Write the rewards of the last step."""
        check_fires(self._model, self._fires)
        out_now, fire = self._model.fires.columns["out"], self._model.swarm.columns["fire"]
        reward_extinguishing(fire, out_now, *self._worth, self._fought, out)
        if math.isnan(self._end[0]) and self.finished:
            self._end[0] = self._model.steps

    def measures(self) -> dict[str, float]:
        """Return the share of fires out, 1 or 0 for the largest, and the steps until all were out, NaN before that."""
        fires = self._model.fires.columns
        largest = fires["out"][np.argmax(fires["radius"])]
        return {
            "fires out": float(fires["out"].mean()),
            "largest fire out": float(largest),
            "steps until all out": float(self._end[0]),
        }


def ids_of_fires(model: SwarmModel) -> tuple[int, ...]:
    """Return the unique_id of each fire."""
    return tuple(fire.unique_id for fire in model.fires)


def check_fires(model: SwarmModel, ids: tuple[int, ...]) -> None:
    """Refuse that fires were added or removed since the episode began: which was found or fought would be another."""
    if ids_of_fires(model) != ids:
        raise SwarmError(
            f"the episode began with {len(ids)} fires, and some were added or removed; expected the same ones: "
            "extinguish one by its put_out(), or choose another map"
        )


class TallyArrays(NamedTuple):
    """What `tally_step` takes."""

    command: RealRows
    max_speed: Reals
    collided: Flags
    position: RealRows
    bounds: tuple[float, float, float, float]
    visited: FlagRows
    fresh: Reals
    sums: RealRows


@compiled(nogil=True)
def tally_robots(block, step, first, last):
    """Add a step to the sums of `EpisodeTally`."""
    t = unpack(block, TallyArrays)
    tally_step(t.command, t.max_speed, t.collided, t.position, t.bounds, t.visited, t.fresh, t.sums)
    return 0


@compiled
def tally_step(command, max_speed, collided, position, bounds, visited, fresh, sums):
    """Add a step to the sums of `EpisodeTally`, write which robots are first in a cell, and mark it as visited."""
    rows, columns = visited.shape
    left, below, right, above = bounds
    for i in range(sums.shape[0]):
        forward = 0.5 * (command[i, 0] + command[i, 1])
        sums[i, 0] += forward / max_speed[i] if max_speed[i] > 0.0 else 0.0
        sums[i, 1] += 1.0 if collided[i] else 0.0
        column = min(max(int((position[i, 0] - left) / (right - left) * columns), 0), columns - 1)
        row = min(max(int((position[i, 1] - below) / (above - below) * rows), 0), rows - 1)
        fresh[i] = 0.0 if visited[row, column] else 1.0
        visited[row, column] = True


class DriveRewardArrays(NamedTuple):
    """What `reward_driving` takes."""

    command: RealRows
    max_speed: Reals
    collided: Flags
    collision_cost: float
    reward: Reals


@compiled(nogil=True)
def reward_drivers(block, step, first, last):
    """Write the rewards of `DrivingScore`."""
    d = unpack(block, DriveRewardArrays)
    reward_driving(d.command, d.max_speed, d.collided, d.collision_cost, d.reward)
    return 0


@compiled
def reward_driving(command, max_speed, collided, collision_cost, reward):
    """Write (left + right) / (2 max_speed) - collision_cost if the robot collided."""
    for i in range(reward.shape[0]):
        forward = 0.5 * (command[i, 0] + command[i, 1])
        reward[i] = forward / max_speed[i] if max_speed[i] > 0.0 else 0.0
        if collided[i]:
            reward[i] -= collision_cost


class NearnessArrays(NamedTuple):
    """What `reward_nearness` takes."""

    distance: RealRows
    design: Integers
    ranges: RealRows
    command: RealRows
    max_speed: Reals
    kind: int
    critical: float
    reward: Reals


@compiled(nogil=True)
def reward_readings(block, step, first, last):
    """Write the rewards of `ThesisScore`."""
    r = unpack(block, NearnessArrays)
    reward_nearness(r.distance, r.design, r.ranges, r.command, r.max_speed, r.kind, r.critical, r.reward)
    return 0


@compiled
def reward_nearness(distance, design, ranges, command, max_speed, kind, critical, reward):
    """Write the thesis's reward for the least reading and the wheel commands."""
    for i in range(reward.shape[0]):
        nearest = 1.0
        for s in range(distance.shape[1]):
            if distance[i, s] >= 0.0:
                nearest = min(nearest, distance[i, s] / ranges[design[i], s])
        speed = max_speed[i] if max_speed[i] > 0.0 else 1.0
        reward[i] = rewarded(kind, nearest, command[i, 0] / speed, command[i, 1] / speed, critical)


class FindingArrays(NamedTuple):
    """What `reward_finding` takes; which fires removed robots have found, the step of the end, and the flag of it."""

    fire: Integers
    arrival: float
    step_cost: float
    found: FlagRows
    found_before: Flags
    end: Reals
    finished: Flags
    reward: Reals


@compiled(nogil=True)
def reward_finders(block, step, first, last):
    """Write the rewards of `FindingScore`, and whether each fire was found."""
    f = unpack(block, FindingArrays)
    found, finished = f.found, True
    reward_finding(f.fire, f.arrival, f.step_cost, found, f.reward)
    for k in range(found.shape[1]):
        finished = finished and (f.found_before[k] or np.any(found[:, k]))
    note_end(finished, step, f.end, f.finished)
    return 0


@compiled
def note_end(is_finished, step, end, finished):
    """Note whether the task is done, and in which step it was for the first time."""
    finished[0] = is_finished
    if is_finished and math.isnan(end[0]):
        end[0] = step


@compiled
def reward_finding(fire, arrival, step_cost, found, reward):
    """Write -step_cost, and `arrival` more at a fire that is new to the robot; note that it is found."""
    for i in range(reward.shape[0]):
        reward[i] = -step_cost
        if fire[i] >= 0 and not found[i, fire[i]]:
            found[i, fire[i]] = True
            reward[i] += arrival


class ExtinguishingArrays(NamedTuple):
    """What `reward_extinguishing` takes, the step of the end, and the flag of it."""

    fire: Integers
    out: Flags
    put_out: float
    work: float
    step_cost: float
    fought: Integers
    end: Reals
    finished: Flags
    reward: Reals


@compiled(nogil=True)
def reward_extinguishers(block, step, first, last):
    """Write the rewards of `ExtinguishingScore`, and whether all fires are out."""
    e = unpack(block, ExtinguishingArrays)
    reward_extinguishing(e.fire, e.out, e.put_out, e.work, e.step_cost, e.fought, e.reward)
    note_end(np.all(e.out), step, e.end, e.finished)
    return 0


@compiled
def reward_extinguishing(fire, out, put_out, work, step_cost, fought, reward):
    """Write -step_cost, `work` more while fighting, `put_out` more if what it fought is out; note what it fights."""
    for i in range(reward.shape[0]):
        before = fought[i]
        reward[i] = -step_cost
        if fire[i] >= 0:
            reward[i] += work
        if before >= 0 and out[before]:  # only in this step: a fire that is out is not fought
            reward[i] += put_out
        fought[i] = fire[i]


@compiled
def cluster_sizes(position, link, sizes):
    """Write how many robots are in each robot's cluster, itself included (single linkage)."""
    n = position.shape[0]
    root = np.arange(n)
    for i in range(n):
        for j in range(i):
            dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
            if dx * dx + dy * dy <= link * link:
                a, b = i, j
                while root[a] != a:
                    a = root[a]
                while root[b] != b:
                    b = root[b]
                root[max(a, b)] = min(a, b)
    sizes[:] = 0
    for i in range(n):
        a = i
        while root[a] != a:
            a = root[a]
        root[i] = a
        sizes[a] += 1
    for i in range(n - 1, -1, -1):
        sizes[i] = sizes[root[i]]
