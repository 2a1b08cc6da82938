"""Ant trails: robots that leave a trail choose one of two branches between nest and food.

WHAT IS IT? A nest and food are joined by a bridge of two branches. Robots go to and fro and leave a trail that others
prefer. After some time nearly all go by one branch. Ants prefer the short one, though none knows how long it is.

HOW IT WORKS. Robots follow lanes on the ground, at the right of each branch. Before a fork a robot smells the trail in
the left and in the right branch, L and R, and goes left with probability (k + L)^2 / ((k + L)^2 + (k + R)^2). It leaves
as much trail on each unit of its way. On the short branch robots reach the other end sooner, where they smell only its
trail when they return. A robot waits for others ahead or at its right; now and then, but not near a fork, it passes on
the right.
HOW TO USE IT. `ratio` is the length of the lower branch relative to the upper one; below an amount of trail of `k` the
choice is at random; robots leave the nest one by one, the next in line with probability `leaving` in each step.
THINGS TO NOTICE. The choices of the first robots decide, more than length: what would colonies of hundreds of ants do?
THINGS TO TRY. A large `k`; robots that leave at once. EXTENDING IT. Open the short branch only after 3,000 steps.
REFERENCE. Goss, Aron, Deneubourg, Pasteels, Naturwissenschaften 76 (1989) 579-581; J. Insect Behavior 3 (1990) 159-168.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import shapely

from mesa_swarm import (
    AGENT9,
    Column,
    Emitter,
    Field,
    FieldSensor,
    Map,
    Part,
    Previous,
    RobotDesign,
    Seed,
    Sensor,
    Slider,
    SwarmModel,
    polygon,
    process,
)
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.errors import check_count, check_number

BOUNDS, LEVEL, ENDS, FORKS, MIDDLE = (0.0, 0.0, 715.0, 480.0), 340.0, (15.0, 700.0), (270.0, 570.0), 420.0
# How far branches go off at 45 degrees; half a corridor's width; a lane's distance from its middle; the view ahead.
SLOPE, HALF, ASIDE, AHEAD = 100.0, 20.0, 9.0, 16.0
PATH, NEST, FORK, FOOD, NEAR = 0, 1, 2, 3, 4


def way(side: float, ratio: float) -> shapely.LineString:
    """Return the middle of the way from nest to food by the branch above (1) or below (-1), this much longer."""
    (a, b), y = FORKS, LEVEL + side * SLOPE
    low = y + side * (ratio - 1.0) * (np.sqrt(8.0) * SLOPE + b - a - 2.0 * SLOPE) / 2.0
    turns = [(a + SLOPE, y), (a + SLOPE, low), (b - SLOPE, low), (b - SLOPE, y)]
    return shapely.LineString([(ENDS[0], LEVEL), (a, LEVEL), *turns, (b, LEVEL), (ENDS[1], LEVEL)])


def around(ways: tuple[shapely.LineString, ...]) -> Map:
    """Return a map whose obstacles leave a corridor along each way."""
    corridors = shapely.union_all([line.buffer(HALF, cap_style="flat", join_style="mitre") for line in ways])
    solid = shapely.get_parts(shapely.box(*BOUNDS).difference(corridors))
    walls = [polygon(part.exterior.coords, [hole.coords for hole in part.interiors]) for part in solid]
    return Map(name="double bridge", bounds=BOUNDS, obstacles=tuple(walls))


class Lanes(Part):
    """Corners of four lanes, (4, k, 2), NaN behind the last: the upper one out and back, then the lower one."""

    name = "lanes"

    def __init__(self, lines: list[shapely.LineString]) -> None:
        corners = [shapely.get_coordinates(line) for line in lines]
        self.corners = np.full((len(lines), max(map(len, corners)), 2), np.nan)
        for lane, points in enumerate(corners):
            self.corners[lane, : len(points)] = points

    def columns(self) -> dict[str, Column]:
        """Return the corners."""
        return {"corners": Column(self.corners, role="parameter")}


@dataclass(frozen=True, kw_only=True)
class Ground(Sensor):
    """The place, `NEST` and so on, and the bearings of four lanes: the upper one out and back, then the lower one."""

    name: str = "ground"
    width: int = 5

    @staticmethod
    def read(position: np.ndarray, heading: np.ndarray, lanes_corners: np.ndarray, out: np.ndarray) -> None:
        """Fill `out` (n, 5)."""
        for i in range(len(out)):
            x, y = position[i]
            ahead = abs(x - MIDDLE) - (MIDDLE - FORKS[0])  # of the forks, towards nest or food
            out[i, 0] = PATH
            if x < ENDS[0] + 25.0:
                out[i, 0] = NEST
            elif x > ENDS[1] - 25.0:
                out[i, 0] = FOOD
            elif abs(ahead - 22.5) < 7.5:
                out[i, 0] = FORK
            elif abs(ahead - 50.0) < 50.0:
                out[i, 0] = NEAR
            for lane in range(4):
                corners, nearest, along, there = lanes_corners[lane], np.inf, 0.0, 0.0
                for k in range(len(corners) - 1):  # where on the lane is nearest?
                    a, b = corners[k, 0], corners[k, 1]
                    across, up = corners[k + 1, 0] - a, corners[k + 1, 1] - b
                    length = math.hypot(across, up)
                    if length > 0.0:  # which it is not behind the last corner
                        share = min(max(((x - a) * across + (y - b) * up) / length**2, 0.0), 1.0)
                        away = math.hypot(x - a - share * across, y - b - share * up)
                        if away < nearest:
                            nearest, there = away, along + share * length
                        along += length
                px, py, left = corners[0, 0], corners[0, 1], there + AHEAD
                for k in range(len(corners) - 1):  # what lies ahead of there?
                    across, up = corners[k + 1, 0] - corners[k, 0], corners[k + 1, 1] - corners[k, 1]
                    length = math.hypot(across, up)
                    if length > 0.0 and left >= 0.0:
                        share = min(left / length, 1.0)
                        px, py = corners[k, 0] + share * across, corners[k, 1] + share * up
                        left -= length
                turn = math.atan2(py - y, px - x) - heading[i]
                out[i, 1 + lane] = math.atan2(math.sin(turn), math.cos(turn))


# Robots choose about 29 before a fork: both smell the middle of a branch, 50 beyond it.
ANTENNAE = [FieldSensor(field="trail", mount=(79.0, side * 50.0 + ASIDE)) for side in (1.0, -1.0)]
ANT = RobotDesign(max_speed=2.0, sensors=(*AGENT9.sensors, Ground(), *ANTENNAE), actuators=(Emitter(field="trail"),))


@behaviour(memory={"out": False, "back": 0, "lower": 0, "chosen": False, "aside": 0})
def follow(me: Any, k: float = 2.0, leaving: float = 0.02) -> tuple[float, float]:
    """Leave the nest, turn at nest and food, choose a branch at a fork, wait for others, and follow the lane."""
    memory, place = me.memory, me.ground[0]
    if place == (NEST if memory.back else FOOD):
        memory.back, memory.chosen = 1 - memory.back, False
    if place == FORK and not memory.chosen:
        left, right = (k + me.trail[0]) ** 2, (k + me.trail[1]) ** 2
        goes_left = me.chance * (left + right) < left
        memory.lower, memory.chosen = int(goes_left == memory.back), True
    turn, blocked = me.ground[1 + 2 * memory.lower + memory.back], False
    for s in (0, 2):
        blocked = blocked or (me.kind[s] == 1 and me.distance[s] < 5.0 and abs(turn) < 1.0)
    if not memory.out:
        memory.out = not blocked and me.chance < leaving
        return 0.0, 0.0
    if memory.aside > 0:
        memory.aside -= 1
    elif blocked:
        memory.aside = 15 if place == PATH and me.chance < 0.05 else 0
        return 0.0, 0.0
    turn = max(-1.0, min(1.0, turn - min(memory.aside, 1)))
    me.act.trail = 1.0 - abs(turn)  # the same amount on each unit of the way
    return me.max_speed * min(1.0, 1.0 - 2.0 * turn), me.max_speed * min(1.0, 1.0 + 2.0 * turn)


@process(memory={"upper": 0, "lower": 0})
def count_passages(position: np.ndarray, previous_position: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> None:
    """Count who passes the middle of a branch."""
    for i in range(position.shape[0]):
        if (previous_position[i, 0] < MIDDLE) != (position[i, 0] < MIDDLE):
            branch = upper if position[i, 1] > LEVEL else lower
            branch[0] += 1


class AntTrails(SwarmModel):
    """Robots between nest and food that choose one of two branches by the trail that they leave.

    Examples
    --------
    >>> AntTrails(n_robots=3, rng=1).run(10).results()["passages"]
    0.0
    """

    compares = "ratio", (1.0, 2.0)
    steps_to_compare = 6_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 36, 1, "robots")] = 36,
        ratio: Annotated[float, Slider(1, 2, 0.1, "length of the lower branch relative to the upper one")] = 2.0,
        k: Annotated[float, Slider(0.1, 50, 0.1, "trail below which a choice is at random")] = 2.0,
        evaporation: Annotated[float, Slider(0, 0.05, 0.001, "share of the trail lost in a step")] = 0.002,
        leaving: Annotated[float, Slider(0.005, 1, 0.005, "probability with which the next one leaves")] = 0.02,
        rng: Seed = None,
    ) -> None:
        ways = way(1.0, 1.0), way(-1.0, check_number("ratio", ratio, minimum=1, maximum=2))
        super().__init__(map=around(ways), rng=rng)
        paths = [line for path in ways for line in (path, path.reverse())]
        self.add_part(Lanes([path.offset_curve(-ASIDE, join_style="mitre") for path in paths]))
        self.add_field(Field("trail", cell=5.0, diffusion=0.3, evaporation=evaporation))
        n, p = check_count("n_robots", n_robots, maximum=36), check_number("leaving", leaving, above=0, maximum=1)
        self.add_robots(ANT, poses=[(24.0 + 13.0 * (i // 3), LEVEL + 12.0 * (i % 3 - 1), 0.0) for i in range(n)])
        self.control = Subsumption(follow(k=check_number("k", k, above=0), leaving=p))
        self.add_part(Previous("position"))
        self.passing = self.add_process(count_passages)

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: passages of both branches, and the upper one's share of them."""
        upper, passages = self.passing.upper, self.passing.upper + self.passing.lower
        return {"passages": float(passages), "share of the upper branch": upper / passages if passages else None}
