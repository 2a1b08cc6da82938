"""HeadOn: two robots that meet head-on decide which leads (thesis 5.2.3.2, 5.3.3, 10.2, its open problem)."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_choice, check_name, check_number
from mesa_swarm.control.layer import CompiledLayer, RobotColumns, Senses, draw_numbers, find_nearest_ahead
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_number, stream_of
from mesa_swarm.kernels.elementary import exp, log
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals
from mesa_swarm.robots.drive import turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import ROBOT

LEADERS = ("speed", "number", "chain")
# What robots broadcast that decide by numbers: one drawn once, below 0 while it is followed; how far away, from centre
# to centre, the robot is that it follows.
NUMBERS = ("number", "follows")
# A sender this near straight ahead is the robot that the front sensor sees.
AHEAD = math.radians(25.0)


@dataclass(kw_only=True)
class HeadOn(CompiledLayer):
    """Turn round on the spot when another robot comes head-on, so that one leads and the other follows.

    By speed, without communication (10.2): both turn round, each at a random speed drawn for this encounter. The
    faster one has turned away first and leads; the slower one then still sees it, going away, and follows (with a layer
    such as `Follow` below). In chains both meet their own followers next, so that chains become shorter.

    By number (5.2.3.2): each robot broadcasts a number, drawn once at random. Of two robots that nothing follows the
    one with the higher number turns round and leads, the lower one waits and follows. A robot that others follow does
    not turn round: it waits for one that none follows to do so, which thereby becomes the head of its chain. Where both
    are followed both go on. A robot is followed if a sender behind it follows something that is as far away as itself,
    and met by a sender ahead of which the same holds. Needs ``communication = Radio(message=("number", "follows"))``.

    By chain: as by number, but only a robot that nothing follows turns round, and only before one that is followed,
    which goes on and follows it. Two that nothing follows, and two that are followed, go on as without this layer.

    Put this layer above `Avoid`, which would make both turn aside.

    Active from when the front sensor sees a robot nearer than `distance` that closes faster than the
    robot's own driving explains, until the robot has turned round by half a turn, or sees ahead a robot that
    goes away.

    Parameters
    ----------
    distance : float
        Map units, at least 0.
    slowest : float
        Speeds are drawn from this share of max_speed to all of it, log-uniformly: what counts is by how many times
        one turns faster than the other. Above 0, at most 1.
    margin : float
        How much faster than by its own speed the other must close, as a share of max_speed, at least 0.
    parting : float
        The other goes away when it is read this much farther than at its nearest, map units, above 0: more than
        the readings of a turning robot differ from sector to sector.
    leader : str
        "speed", "number" or "chain": how it is decided which of two robots leads.
    tolerance : float
        By number or chain: a distance that is heard and one that is sensed, both from centre to centre, are the same
        if they differ by less, map units, above 0.

    Raises
    ------
    InvalidValueError
        If a number is out of its range, or `name` is not one line of text; by number or chain also in the first step of
        a model whose `communication` does not have both messages.
    UnknownNameError
        If `leader` is not one of its names.

    Examples
    --------
    >>> HeadOn(distance=40).slowest
    0.1
    """

    distance: float = 30.0
    slowest: float = 0.1
    margin: float = 0.25
    parting: float = 1.0
    leader: str = "speed"
    tolerance: float = 6.0
    name: str = "HeadOn"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        check_number("HeadOn's distance", self.distance, minimum=0, maximum=LARGEST_RANGE)
        check_number("slowest", self.slowest, above=0, maximum=1)
        check_number("margin", self.margin, minimum=0, maximum=2)
        check_number("parting", self.parting, above=0, maximum=LARGEST_RANGE)
        check_choice("leader", self.leader, LEADERS)
        check_number("tolerance", self.tolerance, above=0, maximum=LARGEST_RANGE)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember the last reading ahead and, of an encounter, the least reading, the speed, the turn that is left."""
        self._swarm, self._prefix, self._rng = swarm, prefix, rng
        for memory in ("front", "least"):
            swarm.remember(f"{prefix}.{memory}", (), np.float64, -1.0)
        for memory in ("speed", "left"):
            swarm.remember(f"{prefix}.{memory}", (), np.float64, 0.0)
        if self.leader != "speed":
            swarm.remember(f"{prefix}.number", (), np.float64, 0.0)

    def lacks(self, senses: Senses) -> str:
        """Return that messages are missing, of a layer that decides by them."""
        if self.leader == "speed" or set(NUMBERS) <= senses.send.keys():
            return ""
        return (
            f"HeadOn decides by {self.leader}, but robots broadcast no numbers; set model.communication = "
            f"Radio(message={NUMBERS})"
        )

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, NamedTuple]:
        """Return what turns the robots that meet another head-on."""
        columns, n = self._swarm.columns, len(robots.layer)
        front, least, speed, left = (columns[f"{self._prefix}.{name}"] for name in ("front", "least", "speed", "left"))
        limits = float(self.distance), float(self.margin), float(self.parting)
        nearest, stream = np.empty(n, np.int64), stream_of(self._rng)
        meeting = Meeting(robots, nearest, *limits, front, least, speed, left, stream)
        if self.leader == "speed":
            return meet_by_speed, SpeedRule(meeting, float(self.slowest), np.empty(n))
        heard = [senses.heard[name] for name in ("n", "range", "bearing", *NUMBERS)]
        numbers = columns[f"{self._prefix}.number"], *(senses.send[name] for name in NUMBERS), *heard
        return meet_by_number, NumberRule(meeting, float(self.tolerance), self.leader == "chain", *numbers)

    def reason(self, moment: Moment) -> Reason:
        """Return which robot it meets."""
        front = moment.forward[0]
        seeing = (front,) if front >= 0 and moment.kind[front] == ROBOT else ()
        sight = f" ({moment.reading(front)})" if seeing else ""
        waits = moment.command[0] == 0.0 == moment.command[1]
        does = "waits for that to turn round, and follows" if waits else "turns round to lead or to follow"
        return Reason(f"it met a robot head-on{sight}: it {does}", seeing)


class Meeting(NamedTuple):
    """What encounters take, whichever way it is decided who leads.

    Parameters
    ----------
    robots : RobotColumns
    nearest : int64 ndarray, shape (n,)
        The sensor that sees the nearest robot ahead, -1 for none, as it is found in a step.
    near, margin, parting : float
        The layer's `distance`, `margin` and `parting`.
    last_reading : ndarray, shape (n,)
        The last reading ahead, -1 for no robot.
    least, speed, angle_left : ndarrays, shape (n,)
        Of an encounter, the least reading, the speed and the turn that is left (rad).
    stream : Stream
    """

    robots: RobotColumns
    nearest: Integers
    near: float
    margin: float
    parting: float
    last_reading: Reals
    least: Reals
    speed: Reals
    angle_left: Reals
    stream: Stream


class SpeedRule(NamedTuple):
    """What `meet_by_speed` takes: the least share of the largest speed, and where the shares of a step are drawn."""

    meeting: Meeting
    slowest: float
    draws: Reals


class NumberRule(NamedTuple):
    """What `meet_by_number` takes: the layer's tolerance, robots' own numbers, what they send, and what they hear."""

    meeting: Meeting
    tolerance: float
    by_chain: bool
    number: Reals
    sent: Reals
    follows: Reals
    senders: Integers
    distances: RealRows
    bearing: RealRows
    heard_numbers: RealRows
    heard_follows: RealRows


@compiled(nogil=True)
def meet_by_speed(block, step, first, last):
    """Turn the robots that meet another head-on, each at a speed of its own."""
    rule = unpack(block, SpeedRule)
    find_ahead(rule.meeting)
    log_of_slowest = log(rule.slowest)
    for i in range(rule.draws.shape[0]):
        rule.draws[i] = exp(draw_number(rule.meeting.stream) * log_of_slowest)
    m = rule.meeting
    robots = m.robots
    meet_head_on(
        m.nearest, robots.distance, robots.kind, robots.design, robots.forward, robots.last_command, robots.max_speed,
        robots.radius, robots.tendency, rule.draws, m.near, m.margin, m.parting, m.last_reading, m.least, m.speed,
        m.angle_left, robots.command, robots.layer, robots.place,
    )  # fmt: skip
    return 0


@compiled(nogil=True)
def meet_by_number(block, step, first, last):
    """Send this robot's number, and how far what it follows is; turn the robots that lead, and halt those that wait."""
    rule = unpack(block, NumberRule)
    find_ahead(rule.meeting)
    draw_numbers(rule.meeting.stream, rule.number)
    announce(rule)
    lead_by_number(rule)
    return 0


@compiled
def find_ahead(meeting):
    """Find what is the nearest robot ahead of each."""
    robots = meeting.robots
    find_nearest_ahead(robots.distance, robots.kind, robots.bearing, robots.design, meeting.nearest)


@compiled
def meet_head_on(
    nearest, distance, kind, design, forward, last_command, max_speed, radius, tendency, draws, near, margin, parting,
    last_reading, least, speed, angle_left, command, layer, index,
):  # fmt: skip
    """Begin, go on with and end encounters; `last_reading` is the last reading ahead, -1 for no robot."""
    for i in range(layer.shape[0]):
        s, f = nearest[i], forward[design[i], 0]
        reading = distance[i, f] if f >= 0 and kind[i, f] == ROBOT else -1.0
        if speed[i] > 0.0:
            if s >= 0:
                least[i] = min(least[i], distance[i, s])
            if angle_left[i] <= 0.0 or (s >= 0 and distance[i, s] > least[i] + parting):
                speed[i] = 0.0
        elif 0.0 <= reading < near and last_reading[i] >= 0.0 and layer[i] < 0:
            own = 0.5 * (last_command[i, 0] + last_command[i, 1])
            if last_reading[i] - reading > own + margin * max_speed[i]:
                speed[i], angle_left[i], least[i] = draws[i] * max_speed[i], math.pi, reading
        last_reading[i] = reading
        if speed[i] > 0.0 and layer[i] < 0:
            command[i, 0], command[i, 1] = turn_towards(tendency[i] * angle_left[i], speed[i], radius[i])
            angle_left[i] -= abs(command[i, 1]) / radius[i]
            layer[i] = index


@compiled
def announce(rule):
    """Write what robots broadcast: their number, negative while another follows, and how far what they follow is."""
    robots, nearest, bearing, distances = rule.meeting.robots, rule.meeting.nearest, rule.bearing, rule.distances
    for i in range(nearest.shape[0]):
        s = nearest[i]
        rule.follows[i] = robots.distance[i, s] + 2.0 * robots.radius[i] if s >= 0 else math.nan
        rule.sent[i] = rule.number[i]
        for k in range(rule.senders[i]):
            behind = abs(bearing[i, k]) > 0.5 * math.pi
            if behind and abs(rule.heard_follows[i, k] - distances[i, k]) < rule.tolerance:
                rule.sent[i] = -rule.number[i]


@compiled
def lead_by_number(rule):
    """Begin, go on with and end encounters; a robot that turns round has a `speed` above 0, one that waits below."""
    m = rule.meeting
    robots, speed, least, angle_left = m.robots, m.speed, m.least, m.angle_left
    command, layer = robots.command, robots.layer
    for i in range(layer.shape[0]):
        f = robots.forward[robots.design[i], 0]
        reading = robots.distance[i, f] if f >= 0 and robots.kind[i, f] == ROBOT else -1.0
        if speed[i] != 0.0:
            if reading >= 0.0:
                least[i] = min(least[i], reading)
            if angle_left[i] <= 0.0 or (speed[i] < 0.0 and reading > least[i] + m.parting):
                speed[i] = 0.0
        elif 0.0 <= reading < m.near and m.last_reading[i] >= 0.0 and layer[i] < 0:
            own = 0.5 * (robots.last_command[i, 0] + robots.last_command[i, 1])
            if m.last_reading[i] - reading > own + m.margin * robots.max_speed[i]:
                far = reading + 2.0 * robots.radius[i]
                other = number_ahead(
                    rule.senders[i], rule.distances[i], rule.bearing[i], rule.heard_numbers[i], rule.heard_follows[i],
                    far, rule.tolerance,
                )  # fmt: skip
                role = who_turns(rule.sent[i], other, rule.by_chain)
                # One that waits does so for as long as the other needs to turn round.
                speed[i], angle_left[i], least[i] = role * robots.max_speed[i], math.pi, reading
        m.last_reading[i] = reading
        if speed[i] != 0.0 and layer[i] < 0:
            turn, radius = robots.tendency[i] * angle_left[i], robots.radius[i]
            left_wheel, right_wheel = turn_towards(turn, robots.max_speed[i], radius)
            waits = speed[i] < 0.0
            command[i, 0], command[i, 1] = (0.0, 0.0) if waits else (left_wheel, right_wheel)
            angle_left[i] -= abs(right_wheel) / radius
            layer[i] = robots.place


@compiled
def who_turns(own, other, by_chain):
    """Return 1 for a robot that turns round, -1 for one that waits, 0 for one that goes on.

    Both are given by the numbers that they broadcast, which are negative while another robot follows them.
    """
    if math.isnan(other):
        return 0.0
    if by_chain:
        return 1.0 if own > 0.0 > other else 0.0
    if own <= 0.0 and other <= 0.0:
        return 0.0
    return 1.0 if own > other else -1.0


@compiled
def number_ahead(count, distances, bearing, heard, follows, far, tolerance):
    """Return the number of the sender ahead whose distance is nearest to `far`, NaN if none that sees this robot is.

    A sender that goes away sees another robot ahead, or none.
    """
    number, least = math.nan, math.inf
    for k in range(count):
        meets = abs(bearing[k]) < AHEAD and abs(follows[k] - distances[k]) < tolerance
        if meets and abs(distances[k] - far) < least:
            number, least = heard[k], abs(distances[k] - far)
    return number
