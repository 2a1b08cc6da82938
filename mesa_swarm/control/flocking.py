"""Moving as neighbours move: velocity matching, and Reynolds's three rules.

The layers command a velocity in the robot's own frame, forward and sideways to the left (`HolonomicDrive`), and
are meant to be added up by `VectorSum`. Where Reynolds's birds know how their neighbours fly, these robots estimate it
from how the neighbours' perceived centroid moves.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_choice, check_name, check_number
from mesa_swarm.control.layer import (
    CompiledLayer,
    Memoryless,
    RobotColumns,
    Senses,
    perceive_centroid,
    perceive_robots,
)
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, direction_of, hypot
from mesa_swarm.kernels.type_names import Integers, RealRows
from mesa_swarm.physics.arcs import sinc
from mesa_swarm.robots.design import AXIS_X, AXIS_Y
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT

# How many steps in a row must be compared before there is an estimate.
FEWEST = 3


@dataclass(kw_only=True)
class VelocityMatching(CompiledLayer):
    """Base of layers that move as the neighbours do: it estimates the velocity of the visible centroid of each robot.

    The displacement m of the centroid between two steps, corrected for the command of the robot itself
    (it cannot know whether it slipped), is v = m / dt (5.3, corrected). A sensor sees no motion across its
    sector, and a jump when what it sees passes to its neighbour, so v is the exponential mean over the last
    `memory` steps. Displacements longer than `jump` are others coming into sight or leaving it: not counted.
    """

    memory: float
    jump: float = 15.0
    name: str

    def __post_init__(self) -> None:
        kind = type(self).__name__
        check_name("name", self.name)
        check_number(f"{kind}'s memory", self.memory, minimum=1, maximum=1e6)
        check_number(f"{kind}'s jump", self.jump, above=0)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember where the centroid was, and how it moves."""
        self._swarm, self._prefix = swarm, prefix
        swarm.remember(f"{prefix}.centroid", (2,), np.float64, 0.0)
        swarm.remember(f"{prefix}.velocity", (2,), np.float64, 0.0)
        swarm.remember(f"{prefix}.seen", (), np.int64, 0)
        swarm.remember(f"{prefix}.compared", (), np.int64, 0)

    def _tracking(self, robots: RobotColumns) -> "Tracking":
        """Return what `track_robots` takes."""
        columns, n = self._swarm.columns, len(robots.layer)
        memory = [columns[f"{self._prefix}.{name}"] for name in ("centroid", "seen", "velocity", "compared")]
        # Commands of wheels turn the body, those forward and sideways do not.
        rule = bool(self.commands_wheels), 1.0 / float(self.memory), float(self.jump)
        return Tracking(robots, *rule, np.empty((n, 2)), np.empty(n, np.int64), *memory)


class Tracking(NamedTuple):
    """What `track_robots` takes.

    Parameters
    ----------
    robots : RobotColumns
    commands_wheels : bool
    least_weight, jump : float
        The share of a step in the mean at least, and the longest displacement that counts.
    centroid, seen : ndarrays, shapes (n, 2), (n,)
        What is seen in a step.
    centroid_before, seen_before : ndarrays, shapes (n, 2), (n,)
        What was seen in the step before.
    velocity, compared : ndarrays, shapes (n, 2), (n,)
        The estimates, in the robot's frame, and how many steps in a row were compared.
    """

    robots: RobotColumns
    commands_wheels: bool
    least_weight: float
    jump: float
    centroid: RealRows
    seen: Integers
    centroid_before: RealRows
    seen_before: Integers
    velocity: RealRows
    compared: Integers


@compiled
def track_robots(tracking):
    """Take in this step's readings."""
    t, robots = tracking, tracking.robots
    perceive_robots(robots.distance, robots.kind, robots.sensors, robots.design, t.centroid, t.seen)
    track(
        t.centroid, t.seen, robots.last_command, robots.radius, t.commands_wheels, t.least_weight, t.jump,
        t.centroid_before, t.seen_before, t.velocity, t.compared,
    )  # fmt: skip


@compiled
def track(
    centroid,
    count,
    command,
    radius,
    commands_wheels,
    least_weight,
    jump,
    centroid_before,
    count_before,
    velocity,
    compared,
):
    """Bring the estimates up to date, and remember what is seen now."""
    for i in range(centroid.shape[0]):
        if commands_wheels:
            turn = (command[i, 1] - command[i, 0]) / (2.0 * radius[i])
            chord = 0.5 * (command[i, 0] + command[i, 1]) * sinc(0.5 * turn)
            x, y = direction_of(0.5 * turn)
            ahead, left = chord * x, chord * y
        else:
            turn, ahead, left = 0.0, command[i, 0], command[i, 1]
        cosine, sine = direction_of(turn)
        # Everything is in the frame that the robot has now: turned by `turn`, moved by (ahead, left).
        x, y = centroid_before[i, 0] - ahead, centroid_before[i, 1] - left
        moved_x = centroid[i, 0] - (cosine * x + sine * y)
        moved_y = centroid[i, 1] - (cosine * y - sine * x)
        vx, vy = velocity[i, 0], velocity[i, 1]
        vx, vy = cosine * vx + sine * vy, cosine * vy - sine * vx
        if count[i] == 0:
            vx, vy, compared[i] = 0.0, 0.0, 0
        elif count_before[i] > 0 and hypot(moved_x, moved_y) <= jump:
            compared[i] += 1
            weight = max(least_weight, 1.0 / compared[i])
            vx += weight * (moved_x - vx)
            vy += weight * (moved_y - vy)
        velocity[i, 0], velocity[i, 1] = vx, vy
        centroid_before[i, 0], centroid_before[i, 1] = centroid[i, 0], centroid[i, 1]
        count_before[i] = count[i]


@dataclass(kw_only=True)
class MatchVelocity(VelocityMatching):
    """Drive the arc that takes the robot as far, and in the same direction, as its neighbours moved.

    In one step a robot can reach the point T = m, the displacement of the visible centroid in a step, along
    an arc that begins in its own direction; T must lie ahead. Wheels that would have to turn faster than
    they can are slowed together, so that the robot stays on the arc and needs several steps.

    Active when robots have been seen for a few steps, their centroid moves by at least `slowest`, and T
    lies within 90 degrees. Others, and robots whose neighbours stand still (which would otherwise stand still
    together for ever), are left to the layers below.

    Parameters
    ----------
    memory : float
        Steps over which the neighbours' velocity is averaged, at least 1: sensors without direction
        inside their sectors make single steps useless.
    jump : float
        The centroid of the same neighbours moves at most this far in a step, map units, above 0; where it
        seems to move farther others have come or gone, and the step is not counted.
    slowest : float
        Share of max_speed below which the neighbours count as standing still, 0 to 1.

    Examples
    --------
    >>> MatchVelocity(memory=10).slowest
    0.1
    """

    memory: float = 20.0
    slowest: float = 0.1
    name: str = "MatchVelocity"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("MatchVelocity's slowest", self.slowest, minimum=0, maximum=1)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "ArcRule"]:
        """Return what drives the robots that know how others move."""
        return match_velocities, ArcRule(self._tracking(robots), float(self.slowest))

    def reason(self, moment: Moment) -> Reason:
        """Return which robots it matches."""
        seeing = moment.seeing(ROBOT)
        return Reason(f"it matches the motion of the robots that {len(seeing)} of its sensors see", tuple(seeing))


class ArcRule(NamedTuple):
    """What `match_velocities` takes: `slowest` is the share of max_speed below which neighbours stand still."""

    tracking: Tracking
    slowest: float


@compiled(nogil=True)
def match_velocities(block, step, first, last):
    """Take in this step's readings, and drive the robots that know how others move."""
    rule = unpack(block, ArcRule)
    t, robots = rule.tracking, rule.tracking.robots
    track_robots(t)
    drive_arcs(
        t.velocity, t.compared, FEWEST, rule.slowest, robots.max_speed, robots.radius, robots.command, robots.layer,
        robots.place,
    )  # fmt: skip
    return 0


@compiled
def drive_arcs(velocity, compared, fewest, slowest, max_speed, radius, command, layer, index):
    """Write the commands of robots that know their neighbours' velocity and are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        x, y = velocity[i, 0], velocity[i, 1]
        length = hypot(x, y)
        if layer[i] >= 0 or compared[i] < fewest or x <= 0.0 or length < slowest * max_speed[i]:
            continue
        bearing = atan2(y, x)
        # The chord of an arc that turns by 2 b points along b, and is sinc(b) times as long as the arc.
        speed, rim = length / sinc(bearing), 2.0 * bearing * radius[i]
        share = min(1.0, max_speed[i] / (speed + abs(rim)))
        command[i, 0] = share * (speed - rim)
        command[i, 1] = share * (speed + rim)
        layer[i] = index


WHAT = ("robots", "others", "everything")


@dataclass(frozen=True, kw_only=True)
class Separate(Memoryless):
    """Move away from what is near: the nearer, the faster.

    Active when a sensor sees something nearer than `distance`. Each such sensor adds a vector away from what it
    sees, of length 1 - reading / distance; the sum, at most 1 long, times max_speed is the velocity.

    Parameters
    ----------
    distance : float
        Map units, above 0.
    what : str
        "robots", "others" (obstacles, fires, loads) or "everything".

    Examples
    --------
    >>> Separate(distance=10, what="robots").name
    'Separate'
    """

    distance: float = 15.0
    what: str = "everything"
    name: str = "Separate"
    commands_wheels: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Separate's distance", self.distance, above=0, maximum=LARGEST_RANGE)
        check_choice("what", self.what, WHAT)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "SeparateRule"]:
        """Return what writes velocities away from what is near."""
        return separate_from, SeparateRule(robots, float(self.distance), WHAT.index(self.what))

    def reason(self, moment: Moment) -> Reason:
        """Return what is near."""
        near = [int(s) for s in np.flatnonzero(moment.kind >= 0) if moment.distance[s] < self.distance]
        seeing = [s for s in near if WHAT[int(moment.kind[s] != ROBOT)] == self.what or self.what == "everything"]
        return Reason("near: " + ", ".join(map(moment.reading, seeing)), tuple(seeing))


class SeparateRule(NamedTuple):
    """What `separate_from` takes: a distance, and a place in `WHAT`."""

    robots: RobotColumns
    near: float
    what: int


@compiled(nogil=True)
def separate_from(block, step, first, last):
    """Write velocities away from what is nearer than `near`, of robots that are driven by no earlier layer."""
    rule = unpack(block, SeparateRule)
    robots, near = rule.robots, rule.near
    distance, kind, sensors, layer = robots.distance, robots.kind, robots.sensors, robots.layer
    for i in range(layer.shape[0]):
        if layer[i] >= 0:
            continue
        d, x, y, count = robots.design[i], 0.0, 0.0, 0
        for s in range(distance.shape[1]):
            is_meant = rule.what == 2 or (kind[i, s] == ROBOT) == (rule.what == 0)
            if kind[i, s] >= 0 and is_meant and distance[i, s] < near:
                weight = 1.0 - distance[i, s] / near
                x -= weight * sensors[d, s, AXIS_X]
                y -= weight * sensors[d, s, AXIS_Y]
                count += 1
        if count:
            share = robots.max_speed[i] / max(1.0, hypot(x, y))
            robots.command[i, 0], robots.command[i, 1] = share * x, share * y
            layer[i] = robots.place
    return 0


@dataclass(kw_only=True)
class Align(VelocityMatching):
    """Move as the neighbours move.

    Active when robots have been seen for a few steps.

    Parameters
    ----------
    memory : float
        Steps over which the neighbours' velocity is averaged, at least 1.
    jump : float
        The centroid of the same neighbours moves at most this far in a step, map units, above 0.

    Examples
    --------
    >>> Align(memory=5).name
    'Align'
    """

    memory: float = 10.0
    name: str = "Align"
    commands_wheels: ClassVar[bool] = False

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "AlignRule"]:
        """Return what writes the neighbours' velocities."""
        return align_robots, AlignRule(self._tracking(robots))

    def reason(self, moment: Moment) -> Reason:
        """Return which robots it matches."""
        seeing = moment.seeing(ROBOT)
        return Reason(f"it moves as the robots that {len(seeing)} of its sensors see", tuple(seeing))


class AlignRule(NamedTuple):
    """What `align_robots` takes."""

    tracking: Tracking


@compiled(nogil=True)
def align_robots(block, step, first, last):
    """Take in this step's readings, and write the neighbours' velocities."""
    t = unpack(block, AlignRule).tracking
    robots = t.robots
    track_robots(t)
    align(t.velocity, t.compared, FEWEST, robots.max_speed, robots.command, robots.layer, robots.place)
    return 0


@compiled
def align(velocity, compared, fewest, max_speed, command, layer, index):
    """Write the neighbours' velocities, at most max_speed, of robots that are driven by no earlier layer."""
    for i in range(layer.shape[0]):
        if layer[i] >= 0 or compared[i] < fewest:
            continue
        length = hypot(velocity[i, 0], velocity[i, 1])
        share = min(1.0, max_speed[i] / length) if length > 0.0 else 0.0
        command[i, 0], command[i, 1] = share * velocity[i, 0], share * velocity[i, 1]
        layer[i] = index


@dataclass(frozen=True, kw_only=True)
class Cohere(Memoryless):
    """Move towards the perceived centroid of the neighbours, slower as it gets near.

    Active when a robot is seen.

    Parameters
    ----------
    distance : float
        Centroids nearer than this, map units, above 0, are approached more slowly: by their share of it.

    Examples
    --------
    >>> Cohere().distance
    40.0
    """

    distance: float = 40.0
    name: str = "Cohere"
    commands_wheels: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Cohere's distance", self.distance, above=0, maximum=LARGEST_RANGE)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "CohereRule"]:
        """Return what writes velocities towards the centroid."""
        return cohere, CohereRule(robots, float(self.distance))

    def reason(self, moment: Moment) -> Reason:
        """Return how far the centroid is."""
        seeing = moment.seeing(ROBOT)
        distance = hypot(*moment.position_of(seeing))
        return Reason(f"the centroid of the robots it sees is {distance:.1f} away", tuple(seeing))


class CohereRule(NamedTuple):
    """What `cohere` takes: centroids nearer than `near` are approached more slowly."""

    robots: RobotColumns
    near: float


@compiled(nogil=True)
def cohere(block, step, first, last):
    """Write velocities towards the centroid, of robots that are driven by no earlier layer."""
    rule = unpack(block, CohereRule)
    robots = rule.robots
    for i in range(robots.layer.shape[0]):
        if robots.layer[i] >= 0:
            continue
        x, y, count = perceive_centroid(robots.distance, robots.kind, robots.sensors, robots.design, i)
        if count:
            share = robots.max_speed[i] / max(rule.near, hypot(x, y))
            robots.command[i, 0], robots.command[i, 1] = share * x, share * y
            robots.layer[i] = robots.place
    return 0


@dataclass(frozen=True, kw_only=True)
class Cruise(Memoryless):
    """Go on in the direction of the robot's last command; at first, ahead. Always active.

    Parameters
    ----------
    speed : float
        Share of max_speed, 0 to 1.

    Examples
    --------
    >>> Cruise(speed=0.5).name
    'Cruise'
    """

    speed: float = 0.7
    name: str = "Cruise"
    commands_wheels: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("Cruise's speed", self.speed, minimum=0, maximum=1)

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "CruiseRule"]:
        """Return what writes velocities along the last command."""
        return cruise, CruiseRule(robots, float(self.speed))

    def reason(self, moment: Moment) -> Reason:
        """Return that it is always active."""
        return Reason("it goes on as before")


class CruiseRule(NamedTuple):
    """What `cruise` takes: a share of max_speed."""

    robots: RobotColumns
    share: float


@compiled(nogil=True)
def cruise(block, step, first, last):
    """Write velocities along the last command, of robots that are driven by no earlier layer."""
    rule = unpack(block, CruiseRule)
    robots = rule.robots
    for i in range(robots.layer.shape[0]):
        if robots.layer[i] >= 0:
            continue
        x, y = robots.last_command[i, 0], robots.last_command[i, 1]
        length = hypot(x, y)
        if length > 0.0:
            x, y = x / length, y / length
        else:
            x, y = 1.0, 0.0
        speed = rule.share * robots.max_speed[i]
        robots.command[i, 0], robots.command[i, 1] = speed * x, speed * y
        robots.layer[i] = robots.place
    return 0
